//! Viewers fetch and unpack whole chunks, so what is plotted must not share one with what is large.

use std::collections::BTreeSet;

use gridfall_core::sim::setup::Integrator;

use super::fixture::{problem, python, record};

#[test]
fn clouds_pictures_and_shapes_have_chunks_of_their_own() {
    let directory = tempfile::tempdir().unwrap();
    let mut problem = problem(0.05);
    problem.setup.integrator = Integrator::Implicit;
    let recording = &python(&[], &[record(&problem, directory.path()).recording])[0];
    let mut sizes = [0, 0];
    let mut clouds = 0;
    for chunk in recording["chunks"].as_array().unwrap() {
        let (size, topics) = (chunk[1].as_u64().unwrap(), &chunk[2]);
        let topics = topics.as_array().unwrap().iter().map(|topic| topic.as_str().unwrap());
        let kind =
            |topic: &str| ["/particles", "/camera", "/colliders"].iter().position(|&large| topic.starts_with(large));
        let kinds: BTreeSet<_> = topics.map(kind).collect();
        assert!(kinds.len() <= 1, "{chunk}");
        let kind = kinds.into_iter().flatten().next();
        sizes[usize::from(kind.is_some())] += size;
        clouds += u64::from(kind == Some(0));
    }
    assert_eq!(clouds, 6);
    // Schemas among it, which are most of it in so short a recording.
    assert!(20 * sizes[0] < sizes[1], "{} bytes of small topics beside {} bytes", sizes[0], sizes[1]);
}
