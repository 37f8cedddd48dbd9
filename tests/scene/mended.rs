//! Meshes with the faults that files have: mended and said, or refused with the reason; the mass is
//! always that of the solid that was meant.

use std::path::Path;

use gridfall_core::sim::setup::Problem;
use gridfall_scene::assets::LocalFiles;
use gridfall_scene::{self as scene, Fault, Limits};
use serde_json::{Value, json};

/// Corners of a box, by the bits of their number: x, y, z.
fn corners(min: [f64; 3], max: [f64; 3]) -> Vec<[f64; 3]> {
    (0..8).map(|k| std::array::from_fn(|a| [min, max][k >> a & 1][a])).collect()
}

/// The faces of a box, outwards.
const FACES: [[usize; 3]; 12] = [
    [0, 2, 3],
    [0, 3, 1],
    [0, 1, 5],
    [0, 5, 4],
    [1, 3, 7],
    [1, 7, 5],
    [3, 2, 6],
    [3, 6, 7],
    [2, 0, 4],
    [2, 4, 6],
    [4, 5, 7],
    [4, 7, 6],
];

/// An OBJ file in the making.
#[derive(Default)]
struct Obj {
    vertices: Vec<[f64; 3]>,
    faces: Vec<Vec<usize>>,
}

impl Obj {
    /// Adds a box; `inwards` turns all its faces.
    fn with(mut self, min: [f64; 3], max: [f64; 3], inwards: bool) -> Self {
        let first = self.vertices.len();
        self.vertices.extend(corners(min, max));
        self.faces.extend(FACES.iter().map(|face| {
            let [a, b, c] = face.map(|v| first + v);
            if inwards { vec![a, c, b] } else { vec![a, b, c] }
        }));
        self
    }

    fn text(&self) -> String {
        let vertices = self.vertices.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
        let face = |face: &Vec<usize>| face.iter().map(|v| (v + 1).to_string()).collect::<Vec<_>>().join(" ");
        vertices.chain(self.faces.iter().map(|f| format!("f {}\n", face(f)))).collect()
    }

    fn stl(&self) -> Vec<u8> {
        let mut bytes = vec![0; 80];
        bytes.extend((self.faces.len() as u32).to_le_bytes());
        for face in &self.faces {
            bytes.extend([0; 12]);
            face.iter().flat_map(|v| self.vertices[*v]).for_each(|x| bytes.extend((x as f32).to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }
}

/// The box that most cases spoil.
fn block() -> Obj {
    Obj::default().with([0.0; 3], [1.0, 0.5, 0.75], false)
}

const VOLUME: f64 = 0.375;

fn scene(mesh: Value) -> Value {
    json!({
        "gridfall": 1, "name": "mended", "domain": { "min": [-1, -1, -1], "max": [2, 2, 2], "dx": 0.0625 },
        "materials": { "m": { "model": "neo-hookean", "density": 2, "youngs_modulus": 1, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "b", "material": "m", "shape": mesh } ],
        "time": { "end": 1 },
    })
}

fn judge(document: &Value, folder: &Path) -> Result<Problem, Vec<Fault>> {
    let files = LocalFiles { folder: folder.to_owned() };
    scene::problem_with(&scene::from_value(document)?, &Limits::default(), &files)
}

/// What comes of a mesh in a file of this name, filled in both ways.
fn judged(name: &str, bytes: impl AsRef<[u8]>) -> [Result<Problem, Vec<Fault>>; 2] {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join(name), bytes).unwrap();
    ["watertight", "winding-number"].map(|fill| {
        let document = scene(json!({ "mesh": { "file": name, "fill": fill } }));
        judge(&document, dir.path())
    })
}

/// Expects a body of this volume and notices with these codes and words, filled in either way.
fn expect(name: &str, obj: &Obj, volume: f64, notices: &[(&str, &str)]) {
    for problem in judged("mesh.obj", obj.text()) {
        let problem = problem.unwrap_or_else(|faults| panic!("{name}: {faults:#?}"));
        let filled = problem.setup.bodies.iter().map(|b| b.volume0 * b.particles.len() as f64).sum::<f64>();
        assert!((filled / volume - 1.0).abs() < 1e-3, "{name}: {filled} m³, {volume} expected");
        let got: Vec<&str> = problem.setup.notices.iter().map(|n| n.code.as_str()).collect();
        let wanted: Vec<&str> = notices.iter().map(|n| n.0).collect();
        assert_eq!(got, wanted, "{name}: {:#?}", problem.setup.notices);
        for (notice, (_, words)) in problem.setup.notices.iter().zip(notices) {
            assert!(notice.reason.contains(words), "{name}: {notice}");
            assert!(notice.pointer == "/bodies/0/shape/mesh" && !notice.remedy.is_empty(), "{name}: {notice}");
        }
    }
}

#[test]
fn a_sound_mesh_is_taken_without_a_word() {
    expect("box", &block(), VOLUME, &[]);
    let hollow = block().with([0.25, 0.125, 0.25], [0.75, 0.375, 0.5], true);
    expect("hollow", &hollow, VOLUME - 0.5 * 0.25 * 0.25, &[]);
}

#[test]
fn a_flipped_face_is_turned_back() {
    for n in 0..12 {
        let mut obj = block();
        obj.faces[n].reverse();
        expect("one flipped", &obj, VOLUME, &[("mended_mesh", "1 of 12 faces was turned")]);
    }
    let mut obj = block();
    (0..4).for_each(|n| obj.faces[3 * n].reverse());
    expect("four flipped", &obj, VOLUME, &[("mended_mesh", "4 of 12 faces were turned")]);
}

#[test]
fn a_part_inside_out_is_turned() {
    let far = ([1.25, 0.25, 0.0], [1.75, 0.75, 0.5]);
    let obj = block().with(far.0, far.1, true);
    expect("two parts", &obj, VOLUME + 0.125, &[("mended_mesh", "1 of 2 parts was inside out")]);
    let all = Obj::default().with([0.0; 3], [1.0, 0.5, 0.75], true).with(far.0, far.1, true);
    expect("both", &all, VOLUME + 0.125, &[("mended_mesh", "2 of 2 parts were inside out")]);
    // A part in a hollow is no hollow.
    let nested = block().with([0.125; 3], [0.875, 0.375, 0.625], true);
    let obj = nested.with([0.25, 0.1875, 0.25], [0.75, 0.3125, 0.5], true);
    let volume = VOLUME - 0.75 * 0.25 * 0.5 + 0.5 * 0.125 * 0.25;
    expect("core", &obj, volume, &[("mended_mesh", "1 of 3 parts was inside out")]);
}

#[test]
fn a_part_that_faces_like_the_one_around_it_is_solid_and_said() {
    let obj = block().with([0.25, 0.125, 0.25], [0.75, 0.375, 0.5], false);
    expect("solid in solid", &obj, VOLUME, &[("nested_part", "1 closed part lies inside another")]);
}

#[test]
fn duplicates_and_t_junctions_are_mended() {
    let mut twice = block();
    let face = twice.faces[5].clone();
    twice.faces.push(face);
    expect("duplicate", &twice, VOLUME, &[("mended_mesh", "1 duplicate face was taken out")]);
    // The neighbour of an edge is split in its middle.
    let mut split = block();
    split.vertices.push([0.5, 0.5, 0.75]);
    let at = split.faces.iter().position(|f| *f == [3, 6, 7]).unwrap();
    split.faces[at] = vec![3, 6, 8];
    split.faces.push(vec![3, 8, 7]);
    expect("T-junction", &split, VOLUME, &[("mended_mesh", "1 T-junction was closed")]);
}

#[test]
fn an_stl_far_from_the_origin_is_refused() {
    let far = |by: f64| {
        let mut obj = block();
        obj.vertices.iter_mut().for_each(|v| v[1] += by);
        obj
    };
    for faults in judged("far.stl", far(3e5).stl()).map(Result::unwrap_err) {
        assert_eq!((faults.len(), faults[0].code), (1, "imprecise_mesh"), "{faults:#?}");
        assert_eq!(faults[0].pointer, "/bodies/0/shape/mesh/file");
        assert!(faults[0].reason.contains("y reaches") && faults[0].reason.contains("f32"), "{}", faults[0]);
    }
    // A hundred metres away, and in a format with more digits, it is as good as new.
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("near.stl"), far(100.0).stl()).unwrap();
    std::fs::write(dir.path().join("far.obj"), far(3e5).text()).unwrap();
    for (file, by) in [("near.stl", 100.0), ("far.obj", 3e5)] {
        let back = json!({ "translate": { "offset": [0, -by, 0], "shape": { "mesh": { "file": file } } } });
        let problem = judge(&scene(back), dir.path()).unwrap_or_else(|faults| panic!("{faults:#?}"));
        let filled = problem.setup.bodies[0].volume0 * problem.particles.len() as f64;
        assert!((filled / VOLUME - 1.0).abs() < 1e-3, "{file}: {filled} m³");
    }
}

#[test]
fn what_bounds_no_solid_is_refused() {
    let strip = |n: usize| {
        let mut obj = Obj::default();
        for k in 0..n {
            let turn = std::f64::consts::TAU * k as f64 / n as f64;
            for side in [-0.3, 0.3] {
                let r = 0.6 + side * (0.5 * turn).cos();
                obj.vertices.push([r * turn.cos(), r * turn.sin(), side * (0.5 * turn).sin()]);
            }
        }
        let vertex = |k: usize, side: usize| if k < n { 2 * k + side } else { 1 - side };
        for k in 0..n {
            let [a, b, c, d] = [vertex(k, 0), vertex(k, 1), vertex(k + 1, 0), vertex(k + 1, 1)];
            obj.faces.extend([vec![a, c, b], vec![b, c, d]]);
        }
        obj
    };
    let sheet = Obj { vertices: corners([0.0; 3], [1.0, 1.0, 0.0]), faces: vec![vec![0, 1, 3], vec![0, 3, 2]] };
    for (obj, code) in [(strip(24), "not_orientable"), (sheet, "bad_mesh")] {
        for faults in judged("mesh.obj", obj.text()).map(Result::unwrap_err) {
            assert_eq!((faults.len(), faults[0].code), (1, code), "{faults:#?}");
        }
    }
}

#[test]
fn a_volume_that_differs_is_said_and_a_lost_one_refused() {
    let thick = |by: f64| Obj::default().with([0.0, 0.0, 0.01], [1.0, 1.0, 0.01 + by], false);
    // Samples are 1/32 m apart.
    for problem in judged("mesh.obj", thick(0.045).text()) {
        let problem = problem.unwrap_or_else(|faults| panic!("{faults:#?}"));
        let notice = &problem.setup.notices[0];
        assert_eq!((problem.setup.notices.len(), notice.code.as_str()), (1, "volume_differs"), "{notice}");
        assert!(notice.reason.contains("smaller") && notice.remedy.contains("dx"), "{notice}");
    }
    for faults in judged("mesh.obj", thick(0.005).text()).map(Result::unwrap_err) {
        assert_eq!((faults.len(), faults[0].code), (1, "shape_lost"), "{faults:#?}");
    }
    // Two parts that cross share room, and enclose more than is filled.
    let obj = block().with([0.5, 0.25, 0.25], [1.5, 0.75, 1.0], false);
    let shared = 0.5 * 0.25 * 0.5;
    for problem in judged("mesh.obj", obj.text()) {
        let problem = problem.unwrap_or_else(|faults| panic!("{faults:#?}"));
        let filled = problem.setup.bodies[0].volume0 * problem.particles.len() as f64;
        assert!((filled / (2.0 * VOLUME - shared) - 1.0).abs() < 0.01, "{filled} m³");
        assert!(problem.setup.notices[0].remedy.contains("unite"), "{:?}", problem.setup.notices);
    }
}
