//! Files to meshes: STL, OBJ, PLY and glTF, recognised by their first bytes.

use std::io::Cursor;

use super::triangles::{MeshError, TriangleMesh, f32_spacing};
use super::{gltf, ply};

/// Most triangles that a mesh may have.
pub(super) const MAX_TRIANGLES: usize = 8_000_000;

/// What a file seems to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Stl,
    Obj,
    Ply,
    Gltf,
}

impl Format {
    /// The usual extension of its files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stl => "stl",
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Gltf => "gltf",
        }
    }
}

/// The format of a mesh; none if it is not a known one.
pub fn format(bytes: &[u8]) -> Option<Format> {
    let head = &bytes[..bytes.len().min(4096)];
    let starts = |mark: &[u8]| head.trim_ascii_start().starts_with(mark);
    let binary_stl = bytes.len() >= 84 && {
        let count = u32::from_le_bytes([bytes[80], bytes[81], bytes[82], bytes[83]]);
        bytes.len() as u64 == 84 + 50 * u64::from(count)
    };
    if starts(b"ply") {
        Some(Format::Ply)
    } else if binary_stl || starts(b"solid") {
        Some(Format::Stl)
    } else if starts(b"glTF") || starts(b"{") {
        Some(Format::Gltf)
    } else {
        let text = std::str::from_utf8(bytes).ok()?;
        text.lines().any(|line| line.trim_start().starts_with("v ")).then_some(Format::Obj)
    }
}

/// Reads a mesh and welds its vertices. Lengths are in metres. The y axis of glTF points up and
/// becomes z.
pub fn read(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let mut mesh = match format(bytes) {
        Some(Format::Stl) => stl(bytes),
        Some(Format::Obj) => obj(bytes),
        Some(Format::Ply) => ply::mesh(bytes),
        Some(Format::Gltf) => gltf::mesh(bytes),
        None => Err(MeshError::new("it is none of STL, OBJ, PLY and glTF")),
    }?;
    if mesh.triangles.is_empty() {
        return Err(MeshError::new("it has no triangles"));
    }
    if mesh.triangles.len() > MAX_TRIANGLES {
        return Err(MeshError(format!("it has {} triangles; {MAX_TRIANGLES} is the most", mesh.triangles.len())));
    }
    let vertices = mesh.vertices.len();
    if mesh.triangles.iter().flatten().any(|v| *v as usize >= vertices) {
        return Err(MeshError(format!("a triangle names a vertex beyond the {vertices} that there are")));
    }
    if mesh.vertices.iter().flatten().any(|x| x.is_nan() || x.abs() > 1e12) {
        return Err(MeshError::new("a vertex is not a number below 1e12"));
    }
    mesh.weld();
    if mesh.triangles.is_empty() {
        return Err(MeshError::new("all its triangles are without area"));
    }
    Ok(mesh)
}

fn stl(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let broken = |error: std::io::Error| MeshError(format!("the STL is broken: {error}"));
    let mut reader = Cursor::new(bytes);
    let mut mesh = TriangleMesh::default();
    for triangle in stl_io::create_stl_reader(&mut reader).map_err(broken)? {
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(triangle.map_err(broken)?.vertices.map(|v| v.0.map(f64::from)));
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh.resolution = mesh.largest().map(f32_spacing);
    Ok(mesh)
}

fn obj(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    // Textures and normals are not needed, and the reader computes with their numbers without a check.
    let needed = |line: &&[u8]| !["vt", "vn"].iter().any(|kind| line.trim_ascii_start().starts_with(kind.as_bytes()));
    let bytes = bytes.split_inclusive(|c| *c == b'\n').filter(needed).collect::<Vec<_>>().concat();
    let no_materials = |_: &std::path::Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(&bytes), &options, no_materials)
        .map_err(|error| MeshError(format!("the OBJ is broken: {error}")))?;
    let mut mesh = TriangleMesh::default();
    for model in models {
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(model.mesh.positions.as_chunks::<3>().0);
        mesh.triangles.extend(model.mesh.indices.as_chunks::<3>().0.iter().map(|t| t.map(|v| first + v)));
    }
    Ok(mesh)
}
