//! The colliders of a frame, out of the messages that viewers get: shapes as triangles, and where they are.

use std::f64::consts::TAU;

use foxglove::messages::{FrameTransforms, Pose, Quaternion, SceneEntity, SceneUpdate, Vector3};
use nalgebra::{Point3, UnitQuaternion, Vector3 as V3};

use crate::surface::Mesh;

/// Pieces around spheres and cylinders.
const AROUND: usize = 48;
/// Digits of vertices, over the size of the shape: no display has more.
const DIGITS: f64 = 6.0;

/// What a frame has besides its points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameSolids {
    /// Simulated time (s).
    pub time_s: f64,
    /// Number of the set of shapes. It changes when a collider appears or goes.
    pub edition: u32,
    /// Lower and upper corner of the domain (m). 2D domains are a cell thick, about z = 0.
    pub domain: [[f64; 3]; 2],
    /// All colliders that there are in the frame.
    pub solids: Vec<Solid>,
}

/// A collider in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solid {
    pub name: String,
    /// It is hollow or holds something, and what is inside should be seen.
    pub translucent: bool,
    /// Whether it ever moves.
    pub moves: bool,
    /// Where the origin of its own frame is (m), and the turn of that frame: x, y, z, w of a unit quaternion.
    pub position: [f64; 3],
    pub orientation: [f64; 4],
    /// Corners in its own frame (m): that of space, where it does not move.
    pub vertices: Vec<[f64; 3]>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// What the latest messages of a frame say. `None` where they are none of this program's.
pub fn solids(shapes: &SceneUpdate, edition: u32, frames: &FrameTransforms, time_s: f64) -> Option<FrameSolids> {
    let (domain, colliders) = shapes.entities.split_first()?;
    let outline = domain.lines.first()?;
    let corner = place(outline.pose.as_ref());
    let points = outline.points.iter().map(|point| corner.map([point.x, point.y, point.z]));
    let bound = |of: fn(f64, f64) -> f64| points.clone().reduce(|a, b| std::array::from_fn(|i| of(a[i], b[i])));
    let solid = |entity: &SceneEntity| {
        let frame = frames.transforms.iter().find(|frame| frame.child_frame_id == entity.frame_id);
        let moves = frame.is_some_and(|frame| frame.child_frame_id.starts_with("colliders/"));
        let frame = frame.filter(|_| moves).map(|frame| (frame.translation.as_ref(), frame.rotation.as_ref()));
        let (position, orientation) = frame.unwrap_or_default();
        let Placement(position, turn) = Placement(vector(position), quaternion(orientation));
        let Mesh { vertices, triangles } = mesh(entity);
        Solid {
            name: entity.id.clone(),
            translucent: colors(entity).any(|alpha| alpha < 1.0),
            moves,
            position: position.into(),
            orientation: [turn.i, turn.j, turn.k, turn.w],
            vertices,
            triangles,
        }
    };
    let domain = [bound(f64::min)?, bound(f64::max)?];
    Some(FrameSolids { time_s, edition, domain, solids: colliders.iter().map(solid).collect() })
}

fn colors(entity: &SceneEntity) -> impl Iterator<Item = f64> {
    let SceneEntity { cubes, spheres, cylinders, triangles, .. } = entity;
    let solid = cubes.iter().map(|cube| cube.color.as_ref());
    let round = spheres.iter().map(|sphere| sphere.color.as_ref());
    let long = cylinders.iter().map(|cylinder| cylinder.color.as_ref());
    let meshed = triangles.iter().map(|list| list.color.as_ref());
    solid.chain(round).chain(long).chain(meshed).flatten().map(|color| color.a)
}

/// All parts of an entity as triangles.
fn mesh(entity: &SceneEntity) -> Mesh {
    let mut whole = Mesh::default();
    for cube in &entity.cubes {
        add(&mut whole, &prism(4, [1.0; 2]), cube.pose.as_ref(), cube.size.as_ref());
    }
    for sphere in &entity.spheres {
        add(&mut whole, &ball(), sphere.pose.as_ref(), sphere.size.as_ref());
    }
    for cylinder in &entity.cylinders {
        let part = prism(AROUND, [cylinder.bottom_scale, cylinder.top_scale]);
        add(&mut whole, &part, cylinder.pose.as_ref(), cylinder.size.as_ref());
    }
    for list in &entity.triangles {
        let vertices = list.points.iter().map(|point| [point.x, point.y, point.z]).collect();
        let triangles = list.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        let whole_size = Vector3 { x: 1.0, y: 1.0, z: 1.0 };
        add(&mut whole, &Mesh { vertices, triangles }, list.pose.as_ref(), Some(&whole_size));
    }
    whole
}

/// Puts a part of size 1 in its place.
fn add(whole: &mut Mesh, part: &Mesh, pose: Option<&Pose>, size: Option<&Vector3>) {
    let (pose, size) = (place(pose), vector(size));
    let (first, longest) = (whole.vertices.len() as u32, extent(part).component_mul(&size).amax());
    let scale = 10f64.powf((DIGITS - longest.max(f64::MIN_POSITIVE).log10()).round());
    let put =
        |v: &[f64; 3]| pose.map([v[0] * size.x, v[1] * size.y, v[2] * size.z]).map(|x| (x * scale).round() / scale);
    whole.vertices.extend(part.vertices.iter().map(put));
    whole.triangles.extend(part.triangles.iter().map(|t| t.map(|corner| first + corner)));
}

fn extent(part: &Mesh) -> V3<f64> {
    let corners = || part.vertices.iter().map(|v| V3::from(*v));
    let bound = |of: fn(&V3<f64>, &V3<f64>) -> V3<f64>| corners().reduce(|a, b| of(&a, &b)).unwrap_or_default();
    bound(V3::sup) - bound(V3::inf)
}

/// A prism about z from −½ to ½ with `n` sides, those of its ends scaled; a cube has four.
fn prism(n: usize, scale: [f64; 2]) -> Mesh {
    // The corners of a cube are outside of the circle that cylinders are in.
    let radius = if n == 4 { 0.5f64.sqrt() } else { 0.5 };
    let turn = |k: usize| TAU * (k as f64 + if n == 4 { 0.5 } else { 0.0 }) / n as f64;
    let ring = |end: usize| {
        let z = end as f64 - 0.5;
        (0..n).map(move |k| [radius * scale[end] * turn(k).cos(), radius * scale[end] * turn(k).sin(), z])
    };
    let vertices: Vec<[f64; 3]> = ring(0).chain(ring(1)).collect();
    let m = n as u32;
    let sides = (0..m).flat_map(|k| {
        let (next, up) = ((k + 1) % m, m);
        [[k, next, next + up], [k, next + up, k + up]]
    });
    let ends = (1..m - 1).flat_map(|k| [[0, k + 1, k], [m, m + k, m + k + 1]]);
    Mesh { triangles: sides.chain(ends).collect(), vertices }
}

/// A sphere of diameter 1.
fn ball() -> Mesh {
    let (around, up) = (AROUND as u32, AROUND as u32 / 2);
    let at = |i: u32, k: u32| {
        let (turn, rise) = (TAU * f64::from(k) / f64::from(around), TAU * (f64::from(i) / f64::from(up) - 0.5) / 2.0);
        [0.5 * rise.cos() * turn.cos(), 0.5 * rise.cos() * turn.sin(), 0.5 * rise.sin()]
    };
    let vertices = (0..=up).flat_map(|i| (0..around).map(move |k| at(i, k))).collect();
    let quad = |i: u32, k: u32| {
        let [a, b] = [i * around + k, i * around + (k + 1) % around];
        [[a, b, b + around], [a, b + around, a + around]]
    };
    // At the poles one of the two is a line.
    let triangles = (0..up).flat_map(|i| {
        (0..around).flat_map(move |k| {
            let [lower, upper] = quad(i, k);
            [(i > 0).then_some(lower), (i + 1 < up).then_some(upper)].into_iter().flatten()
        })
    });
    Mesh { triangles: triangles.collect(), vertices }
}

/// A position and a turn.
struct Placement(V3<f64>, UnitQuaternion<f64>);

impl Placement {
    fn map(&self, x: [f64; 3]) -> [f64; 3] {
        (self.1 * Point3::from(x) + self.0).coords.into()
    }
}

fn place(pose: Option<&Pose>) -> Placement {
    let position = pose.and_then(|pose| pose.position.as_ref());
    Placement(vector(position), quaternion(pose.and_then(|pose| pose.orientation.as_ref())))
}

fn vector(v: Option<&Vector3>) -> V3<f64> {
    v.map_or_else(V3::zeros, |v| V3::new(v.x, v.y, v.z))
}

fn quaternion(q: Option<&Quaternion>) -> UnitQuaternion<f64> {
    q.map_or_else(UnitQuaternion::identity, |q| {
        UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a closed surface whose triangles face outwards.
    fn volume(mesh: &Mesh) -> f64 {
        let v = |n: u32| V3::from(mesh.vertices[n as usize]);
        mesh.triangles.iter().map(|t| v(t[0]).dot(&v(t[1]).cross(&v(t[2]))) / 6.0).sum()
    }

    /// Every edge is of two triangles, which pass it in opposite directions.
    fn closed(mesh: &Mesh) -> bool {
        let edges = || mesh.triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
        let all: std::collections::HashSet<_> = edges().collect();
        all.len() == edges().count() && edges().all(|[a, b]| all.contains(&[b, a]))
    }

    #[test]
    fn primitives_are_closed_and_have_their_volumes() {
        let cube = prism(4, [1.0; 2]);
        assert!(closed(&cube) && (volume(&cube) - 1.0).abs() < 1e-12, "{}", volume(&cube));
        let corner = cube.vertices.iter().flatten().map(|x| x.abs());
        assert!(corner.clone().all(|x| (x - 0.5).abs() < 1e-12));
        let cylinder = prism(AROUND, [1.0; 2]);
        assert!(closed(&cylinder) && (volume(&cylinder) / (TAU / 8.0) - 1.0).abs() < 0.01);
        // A cone that ends in half its width: π h (a² + a b + b²) / 3.
        let cone = prism(AROUND, [1.0, 0.5]);
        assert!(closed(&cone) && (volume(&cone) / (TAU / 8.0 * 7.0 / 12.0) - 1.0).abs() < 0.01);
        let ball = ball();
        assert!((volume(&ball) / (TAU / 12.0) - 1.0).abs() < 0.02, "{}", volume(&ball));
        assert!(ball.vertices.iter().all(|v| (V3::from(*v).norm() - 0.5).abs() < 1e-12));
    }

    #[test]
    fn parts_are_turned_scaled_and_moved() {
        let mut whole = Mesh::default();
        let quarter = Quaternion { x: 0.0, y: 0.0, z: 0.5f64.sqrt(), w: 0.5f64.sqrt() };
        let pose = Pose { position: Some(Vector3 { x: 10.0, y: 0.0, z: 0.0 }), orientation: Some(quarter) };
        add(&mut whole, &prism(4, [1.0; 2]), Some(&pose), Some(&Vector3 { x: 4.0, y: 2.0, z: 0.5 }));
        let high = |a: usize| whole.vertices.iter().map(|v| v[a]).fold(f64::NEG_INFINITY, f64::max);
        assert_eq!([high(0), high(1), high(2)], [11.0, 2.0, 0.25]);
        assert_eq!(volume(&whole), 4.0);
    }
}
