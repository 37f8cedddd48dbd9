//! Meshes and particles in files, as uploads are examined and as scenes use them.

use gridfall_scene::assets::{Assets, Refusal, Source, examine};
use gridfall_scene::{self as scene};
use serde_json::{Value, json};

use super::campaign;
use super::scenes::{LIMITS, codes};

/// The same file, whichever is asked for.
struct Only<'a>(&'a [u8]);

impl Assets for Only<'_> {
    fn read(&self, _: Source) -> Result<Vec<u8>, Refusal> {
        Ok(self.0.to_vec())
    }
}

fn document(dimension: usize, body: Value, colliders: Value) -> Value {
    let fields = json!({ "name": "b", "material": "m" });
    let mut all = fields.as_object().unwrap().clone();
    all.extend(body.as_object().unwrap().clone());
    json!({
        "gridfall": 1, "name": "files", "dimension": dimension,
        "domain": { "min": vec![-1; dimension], "max": vec![1; dimension], "dx": 0.125 },
        "materials": { "m": { "model": "neo-hookean", "density": 2, "youngs_modulus": 1, "poissons_ratio": 0.3 } },
        "bodies": [all], "colliders": colliders, "time": { "end": 1 },
    })
}

/// What comes of a file in a scene.
fn used(document: &Value, file: &[u8]) -> String {
    let scene = scene::from_value(document).unwrap_or_else(|faults| panic!("{faults:#?}"));
    match scene::problem_with(&scene, &LIMITS, &Only(file)) {
        Ok(_) => "used".into(),
        Err(faults) => {
            let reasons: String = faults.iter().map(|fault| fault.reason.as_str()).collect();
            codes(&faults) + &reasons
        }
    }
}

#[test]
fn mesh() {
    let solid = |fill: &str| json!({ "shape": { "mesh": { "file": "a", "fill": fill } } });
    let block = json!({ "shape": { "box": { "min": [-0.5, -0.5, 0.25], "max": [0.5, 0.5, 0.75] } } });
    let sheet = json!([{ "name": "c", "contact": "separate", "shape": { "mesh": { "file": "a", "fill": "sheet" } } }]);
    let documents = [
        document(3, solid("watertight"), json!([])),
        document(3, solid("winding-number"), json!([])),
        document(3, block, sheet),
    ];
    campaign::run("mesh", Vec::new(), |input| {
        let first = examine(input);
        let uses = documents.iter().filter(|_| first.is_ok()).map(|document| used(document, input));
        let uses: Vec<String> = uses.collect();
        format!("{first:?} {}", uses.join(" "))
    });
}

#[test]
fn points() {
    let body = json!({ "points": { "file": "a" } });
    let documents = [document(2, body.clone(), json!([])), document(3, body, json!([]))];
    campaign::run("points", Vec::new(), |input| {
        let uses: Vec<String> = documents.iter().map(|document| used(document, input)).collect();
        format!("{:?} {}", examine(input), uses.join(" "))
    });
}
