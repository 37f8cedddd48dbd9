//! `/colliders` and `/tf`: obstacles and the domain as `foxglove.SceneUpdate`, motions as
//! `foxglove.FrameTransforms`.
//!
//! Shapes are sent in the frame of their collider, at frame 0 and whenever a collider appears or
//! disappears. Each message has all of them, so that a viewer that seeks finds them in the latest
//! message. The frames of moving colliders are sent with every frame, in one message for the same
//! reason.
//!
//! Not every viewer draws a `SceneUpdate`, but all draw points. So `/colliders/NAME` has points of the
//! collider's surface as a `foxglove.PointCloud`, empty while there is no such collider.

use std::iter;

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, Duration, FrameTransform, FrameTransforms, LinePrimitive,
    PackedElementField, Point3, PointCloud, Pose, Quaternion, SceneEntity, SceneEntityDeletion, SceneUpdate,
    SpherePrimitive, Timestamp, TriangleListPrimitive, Vector3, line_primitive, scene_entity_deletion,
};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use super::surface;
use gridfall_core::sim::collider::{Collider, Primitive, Sdf, SdfOp};
use gridfall_core::sim::setup::Setup;

/// Coordinate frame of everything that does not move.
pub const WORLD: &str = "world";

/// The frame that Rerun's views are in, which it connects with no other.
const RERUN: &str = "tf#/";

/// Cells along the longest side of a meshed collider, and of one that is drawn as points.
const RESOLUTION: usize = 64;
const COARSE: usize = 24;
/// sRGB.
const GREY: [u8; 3] = [140, 148, 158];

/// Which colliders exist at a time.
pub fn present(setup: &Setup, time_s: f64) -> Vec<bool> {
    setup.colliders.iter().map(|collider| collider.is_present(time_s)).collect()
}

/// The shapes of all existing colliders in their poses at time 0, and the removal of all others.
pub fn scene(setup: &Setup, present: &[bool], timestamp: Timestamp) -> SceneUpdate {
    let mut entities =
        vec![SceneEntity { lines: vec![domain_outline(setup)], ..entity("domain", WORLD.into(), timestamp) }];
    let mut deletions = Vec::new();
    for (collider, present) in setup.colliders.iter().zip(present) {
        if !present {
            deletions.push(SceneEntityDeletion {
                timestamp: Some(timestamp),
                r#type: scene_entity_deletion::Type::MatchingId.into(),
                id: collider.name.clone(),
            });
            continue;
        }
        let mut shape = entity(&collider.name, frame_of(collider), timestamp);
        draw(setup, collider, &mut shape);
        entities.push(shape);
    }
    SceneUpdate { entities, deletions }
}

/// Puts the domain's corner where viewers look first. Rerun's views show nothing without it, and
/// nothing sharp far from their origin.
fn anchor(setup: &Setup, timestamp: Timestamp) -> FrameTransform {
    let Pose { position, orientation } = at(relative([0.0; 3], setup.origin));
    FrameTransform {
        timestamp: Some(timestamp),
        parent_frame_id: RERUN.into(),
        child_frame_id: WORLD.into(),
        translation: position,
        rotation: orientation,
    }
}

/// The transforms of the world's and of the moving colliders' frames.
pub fn transforms(setup: &Setup, time_s: f64, timestamp: Timestamp) -> FrameTransforms {
    let moving = setup.colliders.iter().filter(|collider| collider.motion.moves());
    let transform = |collider: &Collider| {
        let pose = collider.motion.pose(time_s);
        FrameTransform {
            timestamp: Some(timestamp),
            parent_frame_id: WORLD.into(),
            child_frame_id: frame_name(collider),
            translation: Some(vector(pose.translation)),
            rotation: Some(quaternion(&pose.rotation)),
        }
    };
    FrameTransforms { transforms: iter::once(anchor(setup, timestamp)).chain(moving.map(transform)).collect() }
}

/// True for hollow shapes and grips, so that what they hold is visible.
pub fn translucent(collider: &Collider) -> bool {
    collider.grip || collider.sdf.ops.iter().any(|op| matches!(op, SdfOp::Difference | SdfOp::Shell(_)))
}

/// Lower and upper corner of the domain. 2D scenes are drawn one cell thick, about z = 0.
pub fn domain_box(setup: &Setup) -> [[f64; 3]; 2] {
    let lower = setup.origin;
    let upper = std::array::from_fn(|a| lower[a] + setup.cells[a] as f64 * setup.dx);
    if setup.dimension == 3 {
        return [lower, upper];
    }
    let half = 0.5 * setup.dx;
    [[lower[0], lower[1], -half], [upper[0], upper[1], half]]
}

fn frame_name(collider: &Collider) -> String {
    format!("colliders/{}", collider.name)
}

/// The frame that a collider's shape is in.
fn frame_of(collider: &Collider) -> String {
    if collider.motion.moves() { frame_name(collider) } else { WORLD.into() }
}

/// The topic of a collider's points.
pub fn points_topic(collider: &Collider) -> String {
    format!("/colliders/{}", collider.name)
}

/// Points of a collider's surface in its pose at time 0; none while it does not exist.
pub fn points(setup: &Setup, collider: &Collider, present: bool, timestamp: Timestamp) -> PointCloud {
    let [corner, _] = domain_box(setup);
    let mesh = if present { mesh(setup, collider, COARSE) } else { surface::Mesh::default() };
    let mut data = Vec::with_capacity(16 * mesh.vertices.len());
    for vertex in mesh.vertices {
        relative(vertex, corner).iter().for_each(|x| data.extend((*x as f32).to_le_bytes()));
        data.extend(GREY.iter().chain(&[255]));
    }
    let scalars = ["x", "y", "z"].into_iter().zip((0..).step_by(4)).map(|field| (field, NumericType::Float32));
    let colors = ["red", "green", "blue", "alpha"].into_iter().zip(12..).map(|field| (field, NumericType::Uint8));
    let field = |((name, offset), kind): ((&str, u32), NumericType)| PackedElementField {
        name: name.into(),
        offset,
        r#type: kind.into(),
    };
    PointCloud {
        timestamp: Some(timestamp),
        frame_id: frame_of(collider),
        pose: Some(at(corner)),
        point_stride: 16,
        fields: scalars.chain(colors).map(field).collect(),
        data: data.into(),
    }
}

/// The surface of a collider within the domain, in its pose at time 0.
fn mesh(setup: &Setup, collider: &Collider, resolution: usize) -> surface::Mesh {
    let sdf: &Sdf = &collider.sdf;
    let [domain_lower, domain_upper] = domain_box(setup);
    let [lower, upper] = sdf.bounds();
    let lower: [f64; 3] = std::array::from_fn(|a| lower[a].max(domain_lower[a]));
    let upper: [f64; 3] = std::array::from_fn(|a| upper[a].min(domain_upper[a]));
    if (0..3).any(|a| lower[a] >= upper[a]) {
        return surface::Mesh::default();
    }
    let flat = if setup.dimension == 3 { 1.0 } else { 0.0 };
    // A sheet is drawn as a plate that no cell is too large for.
    let longest = (0..3).map(|a| upper[a] - lower[a]).fold(0.0, f64::max);
    let half = if sdf.is_sheet() { 0.9 * longest / resolution as f64 } else { 0.0 };
    surface::mesh(|x| sdf.distance([x[0], x[1], flat * x[2]]) - half, lower, upper, resolution)
}

fn entity(id: &str, frame_id: String, timestamp: Timestamp) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp),
        frame_id,
        id: id.into(),
        // Stays until replaced, and moves with its frame.
        lifetime: Some(Duration::new(0, 0)),
        frame_locked: true,
        ..Default::default()
    }
}

/// Adds a solid to an entity: as one of the viewer's primitives if there is one, otherwise as
/// triangles.
fn draw(setup: &Setup, collider: &Collider, entity: &mut SceneEntity) {
    let sdf: &Sdf = &collider.sdf;
    let color = Some(Color { r: 0.55, g: 0.58, b: 0.62, a: if translucent(collider) { 0.4 } else { 1.0 } });
    if let ([SdfOp::Primitive { primitive, rotation, translation }], 3) = (sdf.ops.as_slice(), setup.dimension) {
        // The program's rotation maps into the primitive's frame; a pose maps out of it.
        let orientation = Matrix3::from_row_slice(rotation).transpose();
        let pose = Some(Pose { position: Some(vector(*translation)), orientation: Some(unit_quaternion(orientation)) });
        match *primitive {
            Primitive::Box(half) => {
                let size = Some(vector(half.map(|h| 2.0 * h)));
                return entity.cubes.push(CubePrimitive { pose, size, color });
            }
            Primitive::Sphere(r) => {
                let size = Some(vector([2.0 * r; 3]));
                return entity.spheres.push(SpherePrimitive { pose, size, color });
            }
            Primitive::Cylinder(r, half) => {
                let size = Some(vector([2.0 * r, 2.0 * r, 2.0 * half]));
                return entity.cylinders.push(CylinderPrimitive {
                    pose,
                    size,
                    bottom_scale: 1.0,
                    top_scale: 1.0,
                    color,
                });
            }
            // The viewer's scales are the radii of the two ends relative to the larger one.
            Primitive::Cone(base, top, half) => {
                let r = base.max(top);
                return entity.cylinders.push(CylinderPrimitive {
                    pose,
                    size: Some(vector([2.0 * r, 2.0 * r, 2.0 * half])),
                    bottom_scale: base / r,
                    top_scale: top / r,
                    color,
                });
            }
            Primitive::Capsule(..) | Primitive::Torus(..) | Primitive::HalfSpace | Primitive::Grid(..) => {}
        }
    }
    let [corner, _] = domain_box(setup);
    let mesh = mesh(setup, collider, RESOLUTION);
    if mesh.triangles.is_empty() {
        return;
    }
    entity.triangles.push(TriangleListPrimitive {
        pose: Some(at(corner)),
        points: mesh.vertices.into_iter().map(|x| point(relative(x, corner))).collect(),
        color,
        indices: mesh.triangles.into_iter().flatten().collect(),
        ..Default::default()
    });
}

fn domain_outline(setup: &Setup) -> LinePrimitive {
    let corners = domain_box(setup);
    let corner = |k: usize| {
        let x = [corners[k & 1][0], corners[k >> 1 & 1][1], corners[k >> 2][2]];
        point(relative(x, corners[0]))
    };
    let edges = (0..8).flat_map(|k| [1, 2, 4].into_iter().filter(move |bit| k & bit == 0).map(move |bit| (k, k | bit)));
    LinePrimitive {
        r#type: line_primitive::Type::LineList.into(),
        pose: Some(at(corners[0])),
        thickness: 1.0,
        scale_invariant: true,
        points: edges.flat_map(|(from, to)| [corner(from), corner(to)]).collect(),
        color: Some(Color { r: 0.5, g: 0.55, b: 0.6, a: 0.8 }),
        ..Default::default()
    }
}

/// An unturned pose. Viewers draw points in f32, so those of an entity are relative to such a pose near
/// them.
fn at(position: [f64; 3]) -> Pose {
    Pose { position: Some(vector(position)), orientation: Some(quaternion(&gridfall_core::sim::particles::IDENTITY)) }
}

fn relative(x: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|a| x[a] - to[a])
}

fn vector([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

fn point([x, y, z]: [f64; 3]) -> Point3 {
    Point3 { x, y, z }
}

fn quaternion(rotation: &[f64; 9]) -> Quaternion {
    unit_quaternion(Matrix3::from_row_slice(rotation))
}

fn unit_quaternion(rotation: Matrix3<f64>) -> Quaternion {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}
