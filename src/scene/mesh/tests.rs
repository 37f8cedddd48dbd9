//! Formats, welding, watertightness, signed distances of meshes.

use gridfall_core::sim::collider::FAR_ERROR;
use gridfall_core::sim::source::Effort;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::bvh::Bvh;
use super::triangles::dot;
use super::*;
use crate::schema::Fill;

/// The cube from 0 to 1, facing outwards.
pub(super) fn cube() -> TriangleMesh {
    heightfield::solid(&[0.0; 2], &[1.0; 2], 0.0, &[vec![1.0; 2], vec![1.0; 2]]).unwrap()
}

/// A ball of radius 1 about the origin, of `n` bands.
pub(in crate::mesh) fn ball(n: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh { vertices: vec![[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], ..TriangleMesh::default() };
    let pi = std::f64::consts::PI;
    for band in 1..n {
        let (sin, cos) = (pi * band as f64 / n as f64).sin_cos();
        for k in 0..2 * n {
            let (s, c) = (pi * k as f64 / n as f64).sin_cos();
            mesh.vertices.push([sin * c, sin * s, -cos]);
        }
    }
    let vertex = |band: usize, k: usize| (2 + (band - 1) * 2 * n + k % (2 * n)) as u32;
    for k in 0..2 * n {
        mesh.triangles.push([0, vertex(1, k + 1), vertex(1, k)]);
        mesh.triangles.push([1, vertex(n - 1, k), vertex(n - 1, k + 1)]);
        for band in 1..n - 1 {
            let [a, b, c, d] = [vertex(band, k), vertex(band, k + 1), vertex(band + 1, k + 1), vertex(band + 1, k)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// The volume that a mesh encloses, as its faces are.
pub(super) fn volume(mesh: &TriangleMesh) -> f64 {
    mesh.volume_of(0..mesh.triangles.len() as u32, mesh.vertices[0])
}

/// Open edges, and all.
fn open(mesh: &TriangleMesh) -> (usize, usize) {
    mend(mesh.clone()).unwrap().open
}

fn binary_stl(mesh: &TriangleMesh) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for t in &mesh.triangles {
        bytes.extend([0; 12]);
        for x in t.iter().flat_map(|v| mesh.vertices[*v as usize]) {
            bytes.extend((x as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fn ascii_stl(mesh: &TriangleMesh) -> Vec<u8> {
    let vertex = |v: &u32| {
        let [x, y, z] = mesh.vertices[*v as usize];
        format!("vertex {x} {y} {z}\n")
    };
    let facet = |t: &[u32; 3]| {
        let corners: String = t.iter().map(vertex).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    format!("solid cube\n{}endsolid cube\n", mesh.triangles.iter().map(facet).collect::<String>()).into_bytes()
}

fn obj(mesh: &TriangleMesh) -> Vec<u8> {
    let vertices: String = mesh.vertices.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let faces: String =
        mesh.triangles.iter().map(|[a, b, c]| format!("f {}//1 {}//1 {}//1\n", a + 1, b + 1, c + 1)).collect();
    format!("# a cube\nmtllib none.mtl\no cube\n{vertices}vn 0 0 1\nusemtl none\ns off\n{faces}").into_bytes()
}

fn ply(mesh: &TriangleMesh) -> Vec<u8> {
    let vertices: String = mesh.vertices.iter().map(|[x, y, z]| format!("{x} {y} {z} 255\n")).collect();
    let faces: String = mesh.triangles.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n")).collect();
    format!(
        "ply\nformat ascii 1.0\ncomment a cube\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}",
        mesh.vertices.len(),
        mesh.triangles.len()
    )
    .into_bytes()
}

/// glTF with its data in base64; y is up there, and a node moves it by (0, 0.5, 0).
fn gltf(mesh: &TriangleMesh) -> Vec<u8> {
    use base64::Engine;
    let mut data = Vec::new();
    for [x, y, z] in &mesh.vertices {
        for value in [*x, *z - 0.5, -*y] {
            data.extend((value as f32).to_le_bytes());
        }
    }
    let positions = data.len();
    mesh.triangles.iter().flatten().for_each(|v| data.extend((*v as u16).to_le_bytes()));
    serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "translation": [0, 0.5, 0] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": mesh.vertices.len(), "type": "VEC3",
              "min": [0, -0.5, -1], "max": [1, 0.5, 0] },
            { "bufferView": 1, "componentType": 5123, "count": 3 * mesh.triangles.len(), "type": "SCALAR" } ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": positions },
            { "buffer": 0, "byteOffset": positions, "byteLength": data.len() - positions } ],
        "buffers": [{ "byteLength": data.len(),
            "uri": format!("data:application/octet-stream;base64,{}", base64::prelude::BASE64_STANDARD.encode(&data)) }]
    })
    .to_string()
    .into_bytes()
}

#[test]
fn every_format_gives_the_same_closed_cube() {
    for (name, bytes) in [
        ("binary STL", binary_stl(&cube())),
        ("ASCII STL", ascii_stl(&cube())),
        ("OBJ", obj(&cube())),
        ("PLY", ply(&cube())),
        ("glTF", gltf(&cube())),
    ] {
        let mesh = read(&bytes).unwrap_or_else(|error| panic!("{name}: {error:?}"));
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 12), "{name}");
        assert_eq!(open(&mesh), (0, 18), "{name}");
        assert!((volume(&mesh) - 1.0).abs() < 1e-6, "{name}: volume {}", volume(&mesh));
        assert_eq!(mesh.bounds(), [[0.0; 3], [1.0; 3]], "{name}");
    }
}

#[test]
fn what_is_no_mesh_is_refused_and_never_panics() {
    for (bytes, part) in [
        (b"hello".to_vec(), "none of STL, OBJ, PLY and glTF"),
        (vec![0xff; 300], "none of"),
        (b"v 0 0 0\nv 1 0 0\n".to_vec(), "no triangles"),
        (b"v 0 0 0\nf 1 2 3\n".to_vec(), "broken"),
        (b"v 0 0 0\nv 0 0 0\nv 1 0 0\nf 1 2 3\n".to_vec(), "without area"),
        (b"v 0 0 nan\nv 0 1 0\nv 1 0 0\nf 1 2 3\n".to_vec(), "not a number"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n".to_vec(), "lack x, y or z"),
        (
            b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n".to_vec(),
            "broken",
        ),
        (b"glTF\x02\0\0\0\xff\xff\xff\xff".to_vec(), "broken"),
        (br#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":4,"uri":"far.bin"}]}"#.to_vec(), "another file"),
        (b"solid x\nfacet normal 0 0 0\nouter loop\nvertex 1 2\n".to_vec(), "broken"),
    ] {
        let error = read(&bytes).unwrap_err();
        assert!(error.0.contains(part), "{:?}: {}", String::from_utf8_lossy(&bytes), error.0);
    }
    // A file that is cut short anywhere is refused or read, without a panic.
    for whole in [binary_stl(&cube()), ply(&cube()), gltf(&cube()), obj(&cube()), ascii_stl(&cube())] {
        for end in (0..whole.len()).step_by(7) {
            let _ = read(&whole[..end]);
        }
    }
}

#[test]
fn nearly_equal_vertices_are_one() {
    let mut mesh = read(&binary_stl(&cube())).unwrap();
    let mut loose = TriangleMesh::default();
    for (n, t) in mesh.triangles.iter().enumerate() {
        for v in t {
            // Below the tolerance, differently for every triangle.
            let shift = 3e-7 * (n as f64 / 12.0 - 0.5);
            loose.triangles.extend(
                loose.vertices.len().is_multiple_of(3).then(|| [0, 1, 2].map(|k| loose.vertices.len() as u32 + k)),
            );
            loose.vertices.push(mesh.vertices[*v as usize].map(|x| x + shift));
        }
    }
    loose.weld();
    assert_eq!((loose.vertices.len(), open(&loose)), (8, (0, 18)));
    mesh.triangles.pop();
    assert_eq!(open(&mesh), (3, 18));
}

#[test]
fn a_ball_has_the_distances_of_a_ball() {
    let mesh = ball(48);
    assert_eq!(open(&mesh).0, 0);
    assert!(volume(&mesh) > 4.1);
    let field = Plan::new(&mesh, 0.05, 3).sample(&mesh, Fill::Watertight, &Effort::unlimited()).unwrap();
    for k in 0..5000 {
        let x: [f64; 3] = std::array::from_fn(|a| f64::from((k * [37, 91, 53][a]) % 401) / 160.0 - 1.25);
        let exact = dot(x, x).sqrt() - 1.0;
        let within = x.iter().all(|a| a.abs() < 1.05);
        // A chord's sagitta is 2e-3; interpolation rounds the cone at the centre.
        let tolerance = if exact < -0.9 { 0.05 } else { 4e-3 };
        assert!(
            !within || (field.distance(x) - exact).abs() < tolerance,
            "{} at {x:?}, {exact} expected",
            field.distance(x)
        );
        assert!(field.distance(x) < exact + 0.05);
    }
}

#[test]
fn distances_are_exact_near_the_surface_and_hardly_off_far_from_it() {
    const SEED: u64 = 15;
    println!("seed {SEED}");
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    // A ball with dents, and triangles from 0.1 to 3 spacings long.
    for n in [12, 40] {
        let mut mesh = ball(n);
        for v in &mut mesh.vertices {
            let dent = random.random_range(0.9..1.0);
            *v = v.map(|x| dent * x);
        }
        let plan = Plan::new(&mesh, 0.03, 3);
        let field = plan.sample(&mesh, Fill::Watertight, &Effort::unlimited()).unwrap();
        let bvh = Bvh::new(&mesh);
        let mut worst = 0.0f64;
        for _ in 0..20_000 {
            let at = random.random_range(0..field.samples.len());
            let x = plan.point(at);
            let (exact, found) = (bvh.nearest(x, 0, &mut 0).0, f64::from(field.samples[at]));
            let is_inside = bvh.winding(x, &mut 0) > 0.5;
            assert!(exact < 1e-6 || is_inside == (found < 0.0), "{x:?}: {found}");
            let off = (found.abs() - exact) / field.spacing;
            assert!(off > -1e-5 && (exact > 4.0 * field.spacing || off < 1e-5), "{x:?}: {found}, {exact} is right");
            worst = worst.max(off);
        }
        println!("{n}: off by {worst} spacings at most");
        assert!(worst < FAR_ERROR, "{worst}");
    }
}

#[test]
fn winding_numbers_close_holes() {
    // Without its top, a cube is filled up to where the top was and little beyond.
    let mut mesh = cube();
    mesh.triangles.retain(|t| !t.iter().all(|v| mesh.vertices[*v as usize][2] == 1.0));
    assert_eq!(mesh.triangles.len(), 10);
    assert_eq!(open(&mesh).0, 4);
    let field = Plan::new(&mesh, 0.0625, 3).sample(&mesh, Fill::WindingNumber, &Effort::unlimited()).unwrap();
    let inside = |x: [f64; 3]| field.distance(x) < 0.0;
    assert!(inside([0.5, 0.5, 0.5]) && inside([0.1, 0.9, 0.9]) && inside([0.5, 0.5, 0.7]));
    assert!(!inside([0.5, 0.5, 1.1]) && !inside([0.5, 0.5, -0.05]) && !inside([1.05, 0.5, 0.5]));
    // Away from the hole, distances are those of the cube; across it there is no jump.
    assert!((field.distance([0.5, 0.5, -0.1]) - 0.1).abs() < 0.01, "{}", field.distance([0.5, 0.5, -0.1]));
    let mut last = field.distance([0.5, 0.5, 0.5]);
    for k in 1..=100 {
        let d = field.distance([0.5, 0.5, 0.5 + 0.01 * f64::from(k)]);
        assert!((d - last).abs() < 0.0101 + 1e-3, "{last} to {d}");
        last = d;
    }
}

#[test]
fn a_heightfield_is_closed_and_has_its_volume() {
    let heights: Vec<Vec<f64>> =
        (0..5).map(|j| (0..7).map(|i| 1.0 + 0.2 * f64::from(i) - 0.1 * f64::from(j)).collect()).collect();
    let mesh = heightfield::solid(&[-1.0, 2.0], &[2.0, 3.0], 0.5, &heights).unwrap();
    assert_eq!(open(&mesh).0, 0);
    // A plane: its mean height is that of the middle.
    let mean = 1.0 + 0.2 * 3.0 - 0.1 * 2.0;
    assert!((volume(&mesh) - 3.0 * (mean - 0.5)).abs() < 1e-12, "{}", volume(&mesh));
    let section = heightfield::section(&[-1.0], &[2.0], 0.5, &[vec![1.0, 2.0]]).unwrap();
    assert_eq!(open(&section).0, 0);
    assert!(volume(&section) > 0.0);
    let field = Plan::new(&section, 0.1, 2).sample(&section, Fill::Watertight, &Effort::unlimited()).unwrap();
    assert_eq!(field.size[2], 1);
    for (x, y, expected) in [(0.5, 0.6, -0.1), (0.5, 0.3, 0.2), (-1.2, 0.7, 0.2), (0.5, 1.5, 0.0)] {
        let d = field.distance([x, y, 0.0]);
        assert!((d - expected).abs() < 1e-3, "{d} at {x} {y}, {expected} expected");
    }
}

#[test]
fn the_filled_volume_is_that_of_the_body() {
    for (mesh, spacing) in [(cube(), 0.07), (ball(48), 0.05)] {
        let exact = volume(&mesh);
        let filled =
            filled_volume(&Plan::new(&mesh, spacing, 3).sample(&mesh, Fill::Watertight, &Effort::unlimited()).unwrap());
        assert!((filled / exact - 1.0).abs() < 1e-2, "{filled} m³, {exact} expected");
    }
    // A sheet far thinner than the lattice is hardly there.
    let mut sheet = cube();
    sheet.vertices.iter_mut().for_each(|v| v[2] = 0.003 * v[2] + 0.4321);
    let filled =
        filled_volume(&Plan::new(&sheet, 0.07, 3).sample(&sheet, Fill::Watertight, &Effort::unlimited()).unwrap());
    assert!(!(0.5 * 0.003..2.0 * 0.003).contains(&filled), "{filled}");
}

#[test]
fn numbers_of_a_file_have_a_resolution() {
    let moved = |by: f64| {
        let mut mesh = cube();
        mesh.vertices.iter_mut().for_each(|v| v[1] += by);
        mesh
    };
    let near = read(&binary_stl(&moved(0.0))).unwrap();
    assert!(near.rounding() < 1e-6, "{}", near.rounding());
    // 2^19 m: f32 has steps of 1/16 m.
    for bytes in [binary_stl(&moved(524_288.0)), ascii_stl(&moved(524_288.0))] {
        let far = read(&bytes).unwrap();
        assert_eq!(far.resolution[1], 0.0625);
        assert!((far.rounding() - 0.0625).abs() < 1e-3, "{}", far.rounding());
    }
    assert_eq!(read(&obj(&moved(524_288.0))).unwrap().rounding(), 0.0);
    let doubles = String::from_utf8(ply(&moved(524_288.0))).unwrap().replace("float", "double");
    assert_eq!(read(doubles.as_bytes()).unwrap().rounding(), 0.0);
    assert!(read(&ply(&moved(524_288.0))).unwrap().rounding() > 0.06);
    // Up is y in glTF, and z here; the numbers are those before the node's translation.
    let mut high = cube();
    high.vertices.iter_mut().for_each(|v| v[2] += 524_288.0);
    assert!(read(&gltf(&high)).unwrap().resolution[2] > 0.03);
}
