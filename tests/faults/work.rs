//! Jobs of a second or two, and what they leave when nothing disturbs them.

use std::path::Path;

use serde_json::{Value, json};

use super::support::Server;

/// Outputs that must be the same, to the byte.
const OUTPUTS: [&str; 4] =
    ["recording.mcap", "diagnostics?format=csv", "diagnostics?per=step&format=csv", "thumbnail.png"];

/// Explicit and implicit runs with memories: a stream, contact with friction, plastic flow.
pub fn scenes() -> Vec<Value> {
    let scene = |name: &str, integrator: &str, rate: u32, materials: Value, rest: Value| {
        let mut scene = json!({
            "gridfall": 1, "name": name, "dimension": 2, "gravity": [0, -9.81],
            "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.05 },
            "materials": materials, "time": { "end": 0.5, "frame_rate": rate },
            "solver": { "integrator": integrator },
            "colliders": [{ "name": "post", "contact": "separate", "friction": 0.3,
                "shape": { "box": { "min": [0.45, 0], "max": [0.55, 0.25] } } }],
        });
        scene.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
        scene
    };
    let jelly = json!({ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 });
    let water = json!({ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 5e4 });
    let tin = json!({ "model": "von-mises", "density": 2000, "youngs_modulus": 1e6, "poissons_ratio": 0.3,
        "yield_stress": 1e4 });
    let block = |material: &str, low: [f64; 2], high: [f64; 2]| {
        json!({ "name": material, "material": material, "velocity": [0.5, 0],
            "shape": { "box": { "min": low, "max": high } } })
    };
    let (low, high) = ([0.3, 0.4], [0.5, 0.6]);
    vec![
        scene("jelly", "explicit", 200, json!({ "jelly": jelly }), json!({ "bodies": [block("jelly", low, high)] })),
        scene(
            "tap",
            "explicit",
            100,
            json!({ "water": water }),
            json!({
                "bodies": [block("water", [0.1, 0.1], [0.4, 0.3])],
                "sources": [{ "name": "tap", "material": "water", "velocity": [0, -1], "from": 0.1, "until": 0.4,
                    "shape": { "box": { "min": [0.6, 0.7], "max": [0.8, 0.75] } } }],
            }),
        ),
        scene("tin", "implicit", 100, json!({ "tin": tin }), json!({ "bodies": [block("tin", low, high)] })),
    ]
}

/// The outputs of a job that has succeeded, by name.
pub fn outputs(server: &Server, job: &str) -> Vec<(&'static str, Vec<u8>)> {
    let get = |name: &'static str| {
        let answer = server.get(&format!("{job}/{name}"));
        assert_eq!(answer.status, 200, "{job}/{name}: {}", String::from_utf8_lossy(&answer.body));
        (name, answer.body)
    };
    OUTPUTS.map(get).into()
}

/// What the scenes leave, each run once on a server that nothing disturbs.
pub fn undisturbed(dir: &Path) -> Vec<Vec<(&'static str, Vec<u8>)>> {
    on(&Server::start(dir))
}

/// What they leave on a server.
pub fn on(server: &Server) -> Vec<Vec<(&'static str, Vec<u8>)>> {
    let jobs: Vec<String> = scenes().into_iter().map(|scene| server.submit(scene)).collect();
    let of = |job: &String| {
        server.wait_for(job, "succeeded");
        outputs(server, job)
    };
    jobs.iter().map(of).collect()
}

/// Fails unless a job's outputs are those of the undisturbed run.
pub fn compare(server: &Server, job: &str, expected: &[(&str, Vec<u8>)]) {
    for ((name, bytes), (_, expected)) in outputs(server, job).iter().zip(expected) {
        let at = bytes.iter().zip(expected).position(|(a, b)| a != b);
        assert!(
            bytes == expected,
            "{job}/{name} has {} bytes, undisturbed {}; they differ first at {at:?}",
            bytes.len(),
            expected.len()
        );
    }
}

/// Fails unless all jobs, each with the number of its scene, succeed with the outputs of undisturbed runs, and some of
/// them in more than one attempt.
pub fn all_succeed(server: &Server, jobs: &[(String, usize)], expected: &[Vec<(&str, Vec<u8>)>]) {
    let mut attempts = 0;
    let mut resumed = 0;
    for (job, kind) in jobs {
        let ended = server.wait_for(job, "succeeded");
        let attempt = ended["attempt"].as_u64().unwrap();
        attempts += attempt;
        resumed += u64::from(attempt > 1);
        compare(server, job, &expected[*kind]);
    }
    println!("{} jobs in {attempts} attempts, {resumed} of them with more than one", jobs.len());
    assert!(resumed > 0, "no kill hit a job");
}
