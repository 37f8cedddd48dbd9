//! glTF 2.0 with its data inside: GLB, or JSON with base64 data.

use std::borrow::Cow;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::Source;
use gltf::mesh::Mode;

use super::triangles::{MeshError, TriangleMesh, f32_spacing};

/// How deeply nodes may be nested.
const MAX_DEPTH: usize = 64;

/// All triangles of the default scene, with every node in its place, rotated from y up to z up.
pub fn mesh(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let file = gltf::Gltf::from_slice(bytes).map_err(|error| MeshError(format!("the glTF is broken: {error}")))?;
    let mut buffers: Vec<Cow<[u8]>> = Vec::new();
    for buffer in file.buffers() {
        buffers.push(match buffer.source() {
            Source::Bin => Cow::Borrowed(file.blob.as_deref().unwrap_or_default()),
            Source::Uri(uri) => {
                let data = uri.strip_prefix("data:").and_then(|rest| rest.split_once(";base64,"));
                let (_, data) = data.ok_or_else(|| {
                    MeshError::new("the glTF keeps its data in another file; export it as one file (.glb)")
                })?;
                let data = BASE64_STANDARD.decode(data);
                Cow::Owned(data.map_err(|error| MeshError(format!("the glTF's data is broken: {error}")))?)
            }
        });
    }
    let scene = file.default_scene().or_else(|| file.scenes().next());
    let scene = scene.ok_or_else(|| MeshError::new("the glTF has no scene"))?;
    let mut mesh = TriangleMesh::default();
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    for node in scene.nodes() {
        add(&node, &identity, &buffers, 0, &mut mesh)?;
    }
    Ok(mesh)
}

/// Columns first, as glTF has them.
type Matrix = [[f64; 4]; 4];

fn add(
    node: &gltf::Node,
    parent: &Matrix,
    buffers: &[Cow<[u8]>],
    depth: usize,
    mesh: &mut TriangleMesh,
) -> Result<(), MeshError> {
    if depth > MAX_DEPTH {
        return Err(MeshError(format!("the glTF's nodes are nested more than {MAX_DEPTH} deep")));
    }
    let own = node.transform().matrix();
    let to_world: Matrix = std::array::from_fn(|column| {
        std::array::from_fn(|row| (0..4).map(|k| parent[k][row] * f64::from(own[column][k])).sum())
    });
    for primitive in node.mesh().iter().flat_map(|mesh| mesh.primitives()) {
        if primitive.mode() != Mode::Triangles {
            return Err(MeshError(format!("the glTF has {:?}, where triangles belong", primitive.mode())));
        }
        let positions = primitive.get(&gltf::Semantic::Positions);
        let sound = positions
            .is_some_and(|p| p.count() > 0 && p.data_type() == DataType::F32 && p.dimensions() == Dimensions::Vec3);
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|data| data.as_ref()));
        let Some(positions) = reader.read_positions().filter(|_| sound) else {
            return Err(MeshError::new("the glTF has triangles without positions in f32"));
        };
        let first = mesh.vertices.len() as u32;
        let mut spacing = [0.0f64; 3];
        mesh.vertices.extend(positions.map(|p| {
            let p = [f64::from(p[0]), f64::from(p[1]), f64::from(p[2]), 1.0];
            (0..3).for_each(|k| spacing[k] = spacing[k].max(f32_spacing(p[k])));
            let [x, y, z]: [f64; 3] = std::array::from_fn(|row| (0..4).map(|k| to_world[k][row] * p[k]).sum());
            [x, -z, y]
        }));
        // The file's numbers are those before nodes put them in their place.
        let [x, y, z] = [0, 1, 2].map(|row| (0..3).map(|k| (to_world[k][row] * spacing[k]).abs()).sum());
        let placed: [f64; 3] = [x, z, y];
        mesh.resolution = std::array::from_fn(|a| mesh.resolution[a].max(placed[a]));
        let count = mesh.vertices.len() as u32 - first;
        let indices: Vec<u32> = match primitive.indices() {
            Some(indices) if indices.count() == 0 => Vec::new(),
            Some(_) => reader.read_indices().map(|indices| indices.into_u32().collect()).unwrap_or_default(),
            None => (0..count).collect(),
        };
        if indices.iter().any(|i| *i >= count) {
            return Err(MeshError(format!("the glTF has triangles beyond its {count} vertices")));
        }
        mesh.triangles.extend(indices.as_chunks::<3>().0.iter().map(|t| t.map(|v| first + v)));
    }
    node.children().try_for_each(|child| add(&child, &to_world, buffers, depth + 1, mesh))
}
