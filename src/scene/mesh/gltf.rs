//! glTF 2.0 with its data inside: GLB, or JSON with base64 data.

use std::borrow::Cow;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use gltf::accessor::sparse::IndexType;
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::{Source, View};
use gltf::mesh::Mode;

use super::read::MAX_TRIANGLES;
use super::triangles::{MeshError, TriangleMesh, f32_spacing};

/// How deeply nodes may be nested.
const MAX_DEPTH: usize = 64;
/// Most corners of triangles, and most vertices.
const MAX_CORNERS: usize = 3 * MAX_TRIANGLES;

/// All triangles of the default scene, with every node in its place, rotated from y up to z up.
pub fn mesh(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    // The reader takes this length to be no shorter than the head that it is in.
    if bytes.starts_with(b"glTF") && bytes.get(8..12).is_none_or(|length| length[0] < 12 && length[1..] == [0; 3]) {
        return Err(MeshError::new("the glTF is broken: it is shorter than its head"));
    }
    let unread = |error: gltf::Error| MeshError(format!("the glTF is broken: {error}"));
    // The reader's own checks look these up.
    let unchecked = gltf::Gltf::from_slice_without_validation(bytes).map_err(unread)?;
    let root = unchecked.document.as_json();
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    if primitives.flat_map(|primitive| primitive.attributes.values()).any(|at| at.value() >= root.accessors.len()) {
        return Err(broken("attributes"));
    }
    let file = gltf::Gltf::from_slice(bytes).map_err(unread)?;
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
    let mut seen = vec![false; file.nodes().count()];
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    for node in scene.nodes() {
        add(&node, &identity, &buffers, 0, &mut seen, &mut mesh)?;
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
    seen: &mut [bool],
    mesh: &mut TriangleMesh,
) -> Result<(), MeshError> {
    if depth > MAX_DEPTH {
        return Err(MeshError(format!("the glTF's nodes are nested more than {MAX_DEPTH} deep")));
    }
    // Ways through shared nodes may be more than can be gone.
    if std::mem::replace(&mut seen[node.index()], true) {
        return Err(MeshError(format!("the glTF's node {} has more than one place in the scene", node.index())));
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
        let positions = positions.filter(|p| (p.data_type(), p.dimensions()) == (DataType::F32, Dimensions::Vec3)).map(
            |positions| {
                let read = values(&positions, buffers).ok_or_else(|| broken("positions"))?;
                let number = |v: &[u8], a: usize| f32::from_le_bytes(v[4 * a..][..4].try_into().expect("four bytes"));
                Ok(read.into_iter().map(move |v| [0, 1, 2].map(|a| number(v, a))))
            },
        );
        let Some(positions) = positions.transpose()? else {
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
            Some(indices) => {
                let read = values(&indices, buffers).filter(|_| whole_numbers(&indices));
                let whole = |v: &[u8]| v.iter().rev().fold(0, |n, byte| n << 8 | u32::from(*byte));
                read.ok_or_else(|| broken("indices"))?.into_iter().map(whole).collect()
            }
            None => (0..count).collect(),
        };
        if mesh.vertices.len() > MAX_CORNERS || 3 * mesh.triangles.len() + indices.len() > MAX_CORNERS {
            return Err(MeshError(format!("the glTF has too many triangles; {MAX_TRIANGLES} is the most")));
        }
        if indices.iter().any(|i| *i >= count) {
            return Err(MeshError(format!("the glTF has triangles beyond its {count} vertices")));
        }
        mesh.triangles.extend(indices.as_chunks::<3>().0.iter().map(|t| t.map(|v| first + v)));
    }
    node.children().try_for_each(|child| add(&child, &to_world, buffers, depth + 1, seen, mesh))
}

fn whole_numbers(accessor: &gltf::Accessor) -> bool {
    accessor.dimensions() == Dimensions::Scalar
        && matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32)
}

fn broken(what: &str) -> MeshError {
    MeshError(format!("the glTF's {what} are not all in its data"))
}

/// The bytes of each value of an accessor; none if they are not all in the data.
fn values<'a>(accessor: &gltf::Accessor, buffers: &'a [Cow<[u8]>]) -> Option<Vec<&'a [u8]>> {
    if accessor.count() == 0 {
        return Some(Vec::new());
    }
    let size = accessor.size();
    // Values that are all zero but for some would be no mesh.
    let mut values = part(&accessor.view()?, accessor.offset(), accessor.count(), size, buffers)?;
    if let Some(sparse) = accessor.sparse().filter(|sparse| sparse.count() > 0) {
        let (at, new) = (sparse.indices(), sparse.values());
        let width = match at.index_type() {
            IndexType::U8 => 1,
            IndexType::U16 => 2,
            IndexType::U32 => 4,
        };
        let at = part(&at.view(), at.offset(), sparse.count(), width, buffers)?;
        let new = part(&new.view(), new.offset(), sparse.count(), size, buffers)?;
        for (at, new) in at.into_iter().zip(new) {
            let at = at.iter().rev().fold(0, |n, byte| n << 8 | usize::from(*byte));
            *values.get_mut(at)? = new;
        }
    }
    Some(values)
}

/// `count` values of `size` bytes in a view, from an offset on.
fn part<'a>(view: &View, offset: usize, count: usize, size: usize, buffers: &'a [Cow<[u8]>]) -> Option<Vec<&'a [u8]>> {
    let data = buffers.get(view.buffer().index())?;
    let data = data.get(view.offset()..)?.get(..view.length())?.get(offset..)?;
    // No value overlaps the next, so that there are no more than bytes.
    let stride = view.stride().unwrap_or(size);
    let length = stride.checked_mul(count.checked_sub(1)?)?.checked_add(size)?;
    if stride < size || size == 0 || length > data.len() {
        return None;
    }
    Some((0..count).map(|n| &data[n * stride..][..size]).collect())
}
