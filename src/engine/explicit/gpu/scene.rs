//! Bodies, materials and colliders as device data, for both engines.

use super::layout;
use crate::gpu::memory::{Memory, Size, storage};
use crate::gpu::{Gpu, law_number};
use gridfall_core::material::Law;
use gridfall_core::sim::collider::{Collider, Primitive, SdfOp, sided, sides};
use gridfall_core::sim::reaction::WALLS;
use gridfall_core::sim::setup::{Body, Contact, ContactAt, ContactKind, Material, Setup};
use gridfall_core::sim::timestep::demands_at_rest_1_s2;
use gridfall_core::sim::touch::Springs;
use gridfall_core::sim::volume;

/// What of a scene stays the same in every step, by the names of its buffers. Signed distance
/// programs and the samples of their fields are in coordinates relative to `domain.min`.
#[derive(Default)]
pub struct SceneData {
    pub bodies: Vec<layout::Body>,
    pub materials: Vec<layout::Material>,
    pub sdf_ops: Vec<layout::SdfOp>,
    pub sdf_samples: Vec<f32>,
    pub colliders: Vec<layout::Collider>,
}

impl SceneData {
    pub fn new(setup: &Setup) -> Self {
        let body = |(b, demand): (&Body, f64)| {
            let follows = volume::relaxation(setup, b);
            let springs = Springs::of(setup, b);
            layout::Body {
                mass: b.mass as f32,
                volume: b.volume0 as f32,
                material: b.material as u32,
                demand: demand as f32,
                rate: follows.map_or(0.0, |r| r.rate_1_s as f32),
                crowded: follows.map_or(0.0, |r| r.crowded_1_s as f32),
                full: follows.map_or(0.0, |r| r.full as f32),
                stiffness: springs.stiffness as f32,
                damping: springs.damping as f32,
                spacing: springs.spacing as f32,
                ..layout::Body::default()
            }
        };
        let mut data = Self {
            bodies: setup.bodies.iter().zip(demands_at_rest_1_s2(setup)).map(body).collect(),
            materials: setup.materials.iter().map(material).collect(),
            ..Self::default()
        };
        for c in &setup.colliders {
            data.colliders.push(layout::Collider {
                first: data.sdf_ops.len() as u32,
                count: c.sdf.ops.len() as u32,
                kind: contact_code(c.contact),
                friction: c.contact.friction as f32,
                slack: c.sdf.slack() as f32,
                touches: match setup.contact_at {
                    ContactAt::Particles if !c.grip => 1 + u32::from(c.sdf.is_sheet()),
                    _ => 0,
                },
                ..layout::Collider::default()
            });
            let samples = &mut data.sdf_samples;
            data.sdf_ops.extend(c.sdf.ops.iter().map(|op| sdf_op(op, setup.origin, samples)));
        }
        data
    }

    pub fn sizes(&self) -> SceneSizes {
        let colliders = self.colliders.len();
        let buffers = [
            storage("bodies", size_of_val(&self.bodies[..])),
            storage("materials", size_of_val(&self.materials[..])),
            storage("sdf_ops", self.sdf_ops.len().max(1) * size_of::<layout::SdfOp>()),
            storage("sdf_samples", self.sdf_samples.len().max(1) * size_of::<f32>()),
            storage("colliders", colliders.max(1) * size_of::<layout::Collider>()),
        ];
        SceneSizes { buffers, colliders }
    }

    /// Fills the buffers.
    pub fn write(&self, gpu: &Gpu, memory: &Memory) {
        memory.write(gpu, "bodies", 0, &self.bodies);
        memory.write(gpu, "materials", 0, &self.materials);
        memory.write(gpu, "sdf_ops", 0, &self.sdf_ops);
        memory.write(gpu, "sdf_samples", 0, &self.sdf_samples);
        memory.write(gpu, "colliders", 0, &self.colliders);
    }
}

/// What a scene decides about the sizes of buffers.
#[derive(Clone, Copy, Debug)]
pub struct SceneSizes {
    /// Those of [`SceneData`].
    pub buffers: [Size; 5],
    pub colliders: usize,
}

impl SceneSizes {
    /// The colliders' poses in some steps.
    pub fn poses(&self, steps: usize) -> Size {
        storage("poses", self.colliders.max(1) * steps * size_of::<layout::Pose>())
    }

    /// Numbers that one set of the surfaces' reactions takes.
    pub fn reaction_sums(&self) -> usize {
        6 * (WALLS + self.colliders)
    }
}

/// Parameters as the shaders know them.
pub fn material(material: &Material) -> layout::Material {
    let damping = material.damping() as f32;
    let parameters = match Law::<f64>::new(material) {
        Law::FixedCorotated(l) => [l.mu, l.lambda, 0.0, 0.0, 0.0],
        Law::NeoHookean(l) => [l.mu, l.lambda, 0.0, 0.0, 0.0],
        Law::WeaklyCompressibleFluid(l) => [l.b, l.gamma, l.viscosity, 0.0, 0.0],
        Law::StvkHencky(l) => [l.mu, l.lambda, 0.0, 0.0, 0.0],
        Law::VonMises(l) => [l.hencky.mu, l.hencky.lambda, l.radius, 0.0, 0.0],
        Law::DruckerPrager(l) => {
            let s = l.slopes(3);
            [l.elastic.mu, l.elastic.lambda, s.friction, s.dilatancy, s.strength]
        }
        Law::Nacc(l) => [l.mu, l.lambda, l.m, l.beta, l.xi],
        Law::Snow(l) => [l.elastic.mu, l.elastic.lambda, l.least, l.most, l.hardening],
        Law::MohrCoulomb(l) => [l.elastic.mu, l.elastic.lambda, l.sin_friction, l.sin_dilatancy, l.strength],
    };
    let [a, b, c, d, e] = parameters.map(|x| x as f32);
    layout::Material { model: law_number(material), a, b, c, d, e, damping, ..layout::Material::default() }
}

fn sdf_op(op: &SdfOp, origin: [f64; 3], samples: &mut Vec<f32>) -> layout::SdfOp {
    let plain = |code, size| layout::SdfOp { code, size, ..Default::default() };
    match op {
        SdfOp::Union => plain(16, [0.0; 3]),
        SdfOp::Intersection => plain(17, [0.0; 3]),
        SdfOp::Difference => plain(18, [0.0; 3]),
        SdfOp::Shell(thickness) => plain(19, [*thickness as f32, 0.0, 0.0]),
        SdfOp::Primitive { primitive, rotation: r, translation: t } => {
            let small = |x: [f64; 3]| x.map(|x| x as f32);
            // Local coordinates start at `corner` and count in `unit`s.
            let (mut corner, mut unit, mut grid) = ([0.0; 3], 1.0, [0; 4]);
            let (code, size) = match *primitive {
                Primitive::Box(half) => (0, small(half)),
                Primitive::Sphere(radius) => (1, small([radius, 0.0, 0.0])),
                Primitive::Cylinder(radius, half_height) => (2, small([radius, half_height, 0.0])),
                Primitive::Torus(major, minor) => (3, small([major, minor, 0.0])),
                Primitive::HalfSpace => (4, [0.0; 3]),
                Primitive::Capsule(radius, half) => (5, small([radius, half, 0.0])),
                Primitive::Cone(base, top, half) => (6, small([base, top, half])),
                Primitive::Grid(ref field, scale) => {
                    (corner, unit) = (field.origin.map(|x| scale * x), scale * field.spacing);
                    let [x, y, z] = field.size.map(|n| n as u32);
                    grid = [samples.len() as u32, x, y, z];
                    let scaled = |d: &f32| (scale * f64::from(*d)) as f32;
                    if field.sheet {
                        samples.extend(field.samples.iter().map(|d| sided(scaled(d), sides(*d))));
                        (8, small([unit, 0.0, 0.0]))
                    } else {
                        samples.extend(field.samples.iter().map(scaled));
                        (7, small([unit, 0.0, 0.0]))
                    }
                }
            };
            // local = (R (x + origin - t) - corner) / unit for x relative to the domain.
            let row = |i: usize| {
                let w = (0..3).map(|a| r[3 * i + a] * (origin[a] - t[a])).sum::<f64>() - corner[i];
                [r[3 * i], r[3 * i + 1], r[3 * i + 2], w].map(|x| (x / unit) as f32)
            };
            layout::SdfOp { r0: row(0), r1: row(1), r2: row(2), size, code, grid }
        }
    }
}

/// Pose of a collider at a time, for positions relative to `domain.min`; velocities are those of the
/// `move_s` (s) that follow ([`Collider::over`]).
pub fn pose(collider: &Collider, origin: [f64; 3], time_s: f64, move_s: f64) -> layout::Pose {
    let placed = collider.over(time_s, move_s);
    let now = placed.motion;
    let (linear, angular, secant) = placed.rates();
    let (r, t) = (now.pose.rotation, now.pose.translation);
    // x_start + origin = Rᵀ (x + origin - t)  ⇒  x_start = Rᵀ (x - t'), t' = t - origin + R origin
    let shifted: [f64; 3] =
        std::array::from_fn(|i| t[i] - origin[i] + (0..3).map(|a| r[3 * i + a] * origin[a]).sum::<f64>());
    let row = |i: usize| [r[i] as f32, r[3 + i] as f32, r[6 + i] as f32, shifted[i] as f32];
    let center = std::array::from_fn::<f64, 3, _>(|a| now.center[a] - origin[a]);
    let present = collider.is_present(time_s);
    let with = |v: [f64; 3], w: f32| [v[0] as f32, v[1] as f32, v[2] as f32, w];
    layout::Pose {
        r0: row(0),
        r1: row(1),
        r2: row(2),
        linear: with(linear, if present { 1.0 } else { 0.0 }),
        angular: with(angular, secant as f32),
        center: with(center, if present && !collider.grip { 1.0 } else { 0.0 }),
    }
}

pub(super) fn contact_code(contact: Contact) -> u32 {
    match contact.kind {
        ContactKind::Sticky => 0,
        ContactKind::Slip => 1,
        ContactKind::Separate => 2,
    }
}
