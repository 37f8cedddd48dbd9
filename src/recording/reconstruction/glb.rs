//! glTF, binary: a node and a mesh a body, velocities as `_VELOCITY`. Positions are relative to the domain's corner,
//! which the root node has, and which it turns to the y axis up that glTF has.

use std::borrow::Cow;
use std::io::{self, Write};
use std::mem;

use gltf::binary::{Glb, Header};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::{Stride, Target, View};
use gltf::json::material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::scene::UnitQuaternion;
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Asset, Buffer, Index, Material, Mesh, Node, Root, Scene};

use super::{Model, Part, line_of, reals};

/// A quarter turn from z up to y up, as x, y, z, w.
const UPRIGHT: [f32; 4] = [-std::f32::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f32::consts::FRAC_1_SQRT_2];
/// In bytes.
const VECTOR: usize = 12;

pub fn write(model: &Model, to: &mut impl Write) -> io::Result<()> {
    let mut file = File::default();
    let asset = Asset { generator: Some(format!("gridfall {}", crate::provenance::VERSION)), ..Asset::default() };
    file.root.asset = asset;
    let mut children = Vec::new();
    for part in &model.parts {
        children.push(file.part(part)?);
    }
    let [x, y, z] = model.corner;
    // In the axes of glTF.
    let corner = [x, z, -y].map(|c| c as f32);
    let name = Some(format!("t = {} s", model.time_s));
    let children = (!children.is_empty()).then_some(children);
    let all = Node { children, name, rotation: Some(UnitQuaternion(UPRIGHT)), translation: Some(corner), ..node() };
    let all = file.root.push(all);
    let scene = Scene { extensions: None, extras: None, name: None, nodes: vec![all] };
    file.root.scene = Some(file.root.push(scene));
    file.write(to)
}

/// What is written, and the numbers that it refers to.
#[derive(Default)]
struct File {
    root: Root,
    numbers: Vec<u8>,
}

impl File {
    fn part(&mut self, part: &Part) -> io::Result<Index<Node>> {
        let skin = &part.skin;
        let name = Some(line_of(&part.name));
        let positions = self.vectors(&skin.positions, true)?;
        let mut attributes = std::collections::BTreeMap::from([
            (Valid(Semantic::Positions), positions),
            (Valid(Semantic::Normals), self.vectors(&skin.normals, false)?),
        ]);
        if !skin.velocities.is_empty() {
            attributes.insert(Valid(Semantic::Extras("VELOCITY".into())), self.vectors(&skin.velocities, false)?);
        }
        let indices = self.indices(&skin.triangles);
        let [r, g, b] = part.color;
        let material = self.root.push(Material {
            name: name.clone(),
            pbr_metallic_roughness: PbrMetallicRoughness {
                base_color_factor: PbrBaseColorFactor([r, g, b, 1.0]),
                metallic_factor: StrengthFactor(0.0),
                roughness_factor: StrengthFactor(0.5),
                ..PbrMetallicRoughness::default()
            },
            ..Material::default()
        });
        let primitive = Primitive {
            attributes,
            extensions: None,
            extras: None,
            indices: Some(indices),
            material: Some(material),
            mode: Valid(Mode::Triangles),
            targets: None,
        };
        let mesh =
            Mesh { extensions: None, extras: None, name: name.clone(), primitives: vec![primitive], weights: None };
        let mesh = self.root.push(mesh);
        Ok(self.root.push(Node { mesh: Some(mesh), name, ..node() }))
    }

    fn vectors(&mut self, vectors: &[[f32; 3]], bounded: bool) -> io::Result<Index<Accessor>> {
        let start = self.numbers.len();
        reals(&mut self.numbers, vectors.as_flattened())?;
        let bound = |best: fn(f32, f32) -> f32| {
            let of = |a: usize| vectors.iter().map(|v| v[a]).reduce(best).unwrap_or(0.0);
            bounded.then(|| gltf::json::Value::from(vec![of(0), of(1), of(2)]))
        };
        let kind = (ComponentType::F32, Type::Vec3);
        let (min, max) = (bound(f32::min), bound(f32::max));
        let accessor = self.accessor(start, vectors.len(), kind, Target::ArrayBuffer, Some(Stride(VECTOR)));
        Ok(self.root.push(Accessor { min, max, ..accessor }))
    }

    fn indices(&mut self, triangles: &[[u32; 3]]) -> Index<Accessor> {
        let start = self.numbers.len();
        self.numbers.extend(triangles.as_flattened().iter().flat_map(|corner| corner.to_le_bytes()));
        let kind = (ComponentType::U32, Type::Scalar);
        let accessor = self.accessor(start, 3 * triangles.len(), kind, Target::ElementArrayBuffer, None);
        self.root.push(accessor)
    }

    /// Of the numbers from `start` to the end.
    fn accessor(
        &mut self,
        start: usize,
        count: usize,
        (component, kind): (ComponentType, Type),
        target: Target,
        byte_stride: Option<Stride>,
    ) -> Accessor {
        let view = View {
            buffer: Index::new(0),
            byte_length: (self.numbers.len() - start).into(),
            byte_offset: Some(start.into()),
            byte_stride,
            name: None,
            target: Some(Valid(target)),
            extensions: None,
            extras: None,
        };
        Accessor {
            buffer_view: Some(self.root.push(view)),
            byte_offset: None,
            count: count.into(),
            component_type: Valid(GenericComponentType(component)),
            extensions: None,
            extras: None,
            type_: Valid(kind),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
        }
    }

    fn write(mut self, to: &mut impl Write) -> io::Result<()> {
        if !self.numbers.is_empty() {
            let byte_length = self.numbers.len().into();
            self.root.push(Buffer { byte_length, name: None, uri: None, extensions: None, extras: None });
        }
        let json = gltf::json::serialize::to_vec(&self.root)?;
        let bin = mem::take(&mut self.numbers);
        let bin = (!bin.is_empty()).then_some(Cow::Owned(bin));
        // The length is worked out where it is written.
        let header = Header { magic: *b"glTF", version: 2, length: 0 };
        let glb = Glb { header, json: Cow::Owned(json), bin };
        glb.to_writer(to).map_err(io::Error::other)
    }
}

fn node() -> Node {
    Node {
        camera: None,
        children: None,
        extensions: None,
        extras: None,
        matrix: None,
        mesh: None,
        name: None,
        rotation: None,
        scale: None,
        translation: None,
        skin: None,
        weights: None,
    }
}
