//! PLY: meshes with faces, and points with or without velocities.

use std::io::BufRead;

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType};

use super::triangles::{MeshError, TriangleMesh, f32_spacing};

/// The properties of a vertex that are read; those that the file lacks are NaN.
const NAMES: [&str; 6] = ["x", "y", "z", "vx", "vy", "vz"];

/// An element of any kind: the properties that are read, and the corners of a face.
struct Element {
    values: [f64; 6],
    corners: Vec<u32>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { values: [f64::NAN; 6], corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if let Some(n) = NAMES.iter().position(|known| *known == name) {
            let Some(value) = number(&property) else { return PropertyAccessResult::UnsupportedType };
            self.values[n] = value;
        } else if matches!(name, "vertex_indices" | "vertex_index") {
            let Some(corners) = property.to_u32_list() else { return PropertyAccessResult::UnsupportedType };
            self.corners = corners;
        } else {
            return PropertyAccessResult::Ignored;
        }
        PropertyAccessResult::Set
    }
}

fn number(property: &Property) -> Option<f64> {
    Some(match *property {
        Property::Char(v) => v.into(),
        Property::UChar(v) => v.into(),
        Property::Short(v) => v.into(),
        Property::UShort(v) => v.into(),
        Property::Int(v) => v.into(),
        Property::UInt(v) => v.into(),
        Property::Float(v) => v.into(),
        Property::Double(v) => v,
        _ => return None,
    })
}

/// What a file holds.
#[derive(Default)]
struct Contents {
    vertices: Vec<Element>,
    faces: Vec<Element>,
    /// Which of [`NAMES`] the vertices have.
    has: [bool; 6],
    /// Whether positions are in f32.
    single: bool,
}

fn contents(bytes: &[u8]) -> Result<Contents, MeshError> {
    // After the first line the parser repeats the file.
    let first = |error: &dyn std::fmt::Display| error.to_string().lines().next().unwrap_or_default().to_owned();
    let broken = |error: &dyn std::fmt::Display| MeshError(format!("the PLY is broken: {}", first(error)));
    let parser = Parser::<Element>::new();
    let mut reader = Reader::new(bytes);
    let header = parser.read_header(&mut reader).map_err(|e| broken(&e))?;
    let mut contents = Contents::default();
    for definition in header.elements.values() {
        // Each has a byte at least. Those without properties could else be more than there is memory for.
        if definition.count > bytes.len() || (definition.properties.is_empty() && definition.count > 0) {
            let more = format!("it has less data than {} elements `{}` take", definition.count, definition.name);
            return Err(broken(&more));
        }
        let read = parser.read_payload_for_element(&mut reader, definition, &header).map_err(|e| broken(&e))?;
        match definition.name.as_str() {
            "vertex" => {
                contents.has = NAMES.map(|name| definition.properties.contains_key(name));
                let positions = NAMES[..3].iter().filter_map(|name| definition.properties.get(&(*name).to_owned()));
                let float = PropertyType::Scalar(ScalarType::Float);
                contents.single = positions.into_iter().any(|property| property.data_type == float);
                contents.vertices = read;
            }
            "face" => contents.faces = read,
            _ => {}
        }
    }
    if reader.get_mut().fill_buf().is_ok_and(|rest| rest.iter().any(|byte| !byte.is_ascii_whitespace())) {
        return Err(broken(&"there is more in it than its header says"));
    }
    Ok(contents)
}

/// The faces of a PLY; polygons are cut into fans.
pub fn mesh(bytes: &[u8]) -> Result<TriangleMesh, MeshError> {
    let Contents { vertices, faces, has, single } = contents(bytes)?;
    if !has[..3].iter().all(|has| *has) {
        return Err(MeshError::new("its vertices lack x, y or z"));
    }
    if faces.is_empty() {
        return Err(MeshError::new("it has no faces; points are for a body's `points`"));
    }
    let fan = |face: &Element| -> Vec<[u32; 3]> {
        let corners = &face.corners;
        (2..corners.len()).map(|n| [corners[0], corners[n - 1], corners[n]]).collect()
    };
    let mut mesh = TriangleMesh {
        vertices: vertices.iter().map(|v| [v.values[0], v.values[1], v.values[2]]).collect(),
        triangles: faces.iter().flat_map(fan).collect(),
        ..TriangleMesh::default()
    };
    if single {
        mesh.resolution = mesh.largest().map(f32_spacing);
    }
    Ok(mesh)
}

/// One vector per vertex.
type Vectors = Vec<[f64; 3]>;

/// The vertices of a PLY, and their velocities if the file has all three components.
pub fn points(bytes: &[u8]) -> Result<(Vectors, Option<Vectors>), MeshError> {
    let Contents { vertices, has, .. } = contents(bytes)?;
    if !has[..3].iter().all(|has| *has) {
        return Err(MeshError::new("its vertices lack x, y or z"));
    }
    let three = |first: usize| vertices.iter().map(|v| [0, 1, 2].map(|a| v.values[first + a])).collect();
    Ok((three(0), has[3..].iter().all(|has| *has).then(|| three(3))))
}
