//! Viewers fetch and unpack whole chunks, so what is plotted must not share one with what is large.

use gridfall_core::sim::setup::Integrator;
use serde_json::json;

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
        let large = ["/particles", "/camera", "/colliders"]
            .iter()
            .find(|&&topic| topics.as_array().unwrap().contains(&json!(topic)));
        if let Some(topic) = large {
            assert_eq!(topics, &json!([topic]));
        }
        sizes[usize::from(large.is_some())] += size;
        clouds += u64::from(large == Some(&"/particles"));
    }
    assert_eq!(clouds, 6);
    // Schemas among it, which are most of it in so short a recording.
    assert!(20 * sizes[0] < sizes[1], "{} bytes of small topics beside {} bytes", sizes[0], sizes[1]);
}
