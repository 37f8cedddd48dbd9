//! A problem as device data: coordinates, particle states, bodies, materials, colliders.

use super::layout::{self, PAD_BLOCKS, Params};
use crate::contract::EngineError;
use gridfall_core::material::Law;
use gridfall_core::material::parameters::Elasticity;
use gridfall_core::maths::linalg::{det, from_row_major};
use gridfall_core::sim::collider::{Collider, Primitive, SdfOp};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Axis, Contact, ContactKind, Kernel, Material, Setup};
use gridfall_core::sim::timestep::demands_at_rest_1_s2;

/// Cells by which a kernel's base node is shifted: y = x/dx - shift has floor(y) as its first node
/// (`SHIFT` in the shaders).
pub fn shift(kernel: Kernel) -> f64 {
    if kernel == Kernel::Quadratic { 0.5 } else { 0.25 }
}

/// Sign s of each grid, whose nodes lie at (i + s/4) dx.
pub fn grid_offsets(kernel: Kernel) -> &'static [i32] {
    if kernel == Kernel::Quadratic { &[0] } else { &[1, -1] }
}

/// Everything about the device's coordinates and state layout that does not change during a run.
pub struct DeviceLayout {
    origin: [f64; 3],
    dx: f64,
    shift: f64,
    blocks: [usize; 3],
    pad: [usize; 3],
    periodic: [bool; 3],
    /// Of the particles that there are.
    pub body_of: Vec<u32>,
    /// By body.
    fluid: Vec<bool>,
    /// By body: whether particles have a plastic state.
    plastic: Vec<bool>,
    /// Deformation channels a particle: 1 if all bodies are fluids, 9 for F, 10 if any body has a
    /// plastic state.
    pub channels: usize,
}

/// Particle states in device form.
pub struct DeviceState {
    pub position: Vec<[u32; 4]>,
    pub velocity: Vec<f32>,
    pub deformation: Vec<f32>,
}

impl DeviceLayout {
    pub fn new(setup: &Setup) -> Self {
        let periodic = setup.axes.map(|a| a == Axis::Periodic);
        let pad = periodic.map(|p| if p { 0 } else { PAD_BLOCKS });
        let of_bodies = |property: fn(&Material) -> bool| -> Vec<bool> {
            setup.bodies.iter().map(|b| property(&setup.materials[b.material])).collect()
        };
        let (fluid, plastic) = (of_bodies(Material::is_fluid), of_bodies(Material::has_plastic_state));
        Self {
            origin: setup.origin,
            dx: setup.dx,
            shift: shift(setup.kernel),
            blocks: std::array::from_fn(|a| setup.cells[a].div_ceil(4) + 2 * pad[a]),
            pad: pad.map(|p| 4 * p),
            periodic,
            body_of: Vec::new(),
            channels: match (fluid.iter().all(|&f| f), plastic.contains(&true)) {
                (true, _) => 1,
                (false, false) => 9,
                (false, true) => 10,
            },
            fluid,
            plastic,
        }
    }

    pub fn table_len(&self) -> usize {
        self.blocks.iter().product()
    }

    /// Blocks that hold particles, or lie beside one that does: what the first activation will ask
    /// for.
    pub fn active_blocks(&self, position: &[[u32; 4]]) -> usize {
        let mut seen = vec![false; self.table_len()];
        for p in position {
            seen[p[3] as usize] = true;
        }
        let occupied: Vec<usize> = (0..seen.len()).filter(|&i| seen[i]).collect();
        let n = self.blocks.map(|b| b as i64);
        for block in occupied {
            let b = block as i64;
            let at = [b % n[0], (b / n[0]) % n[1], b / (n[0] * n[1])];
            for k in 0..27 {
                let c: [i64; 3] = std::array::from_fn(|a| at[a] + [k % 3, (k / 3) % 3, k / 9][a] - 1);
                let c: [i64; 3] = std::array::from_fn(|a| if self.periodic[a] { c[a].rem_euclid(n[a]) } else { c[a] });
                if (0..3).all(|a| c[a] >= 0 && c[a] < n[a]) {
                    seen[((c[2] * n[1] + c[1]) * n[0] + c[0]) as usize] = true;
                }
            }
        }
        seen.iter().filter(|&&s| s).count()
    }

    /// States by id. Errors: [`EngineError::LeftDomain`] for a particle outside the block table.
    pub fn state(&self, particles: &Particles) -> Result<DeviceState, EngineError> {
        let n = particles.len();
        let mut state = DeviceState {
            position: Vec::with_capacity(n),
            velocity: vec![0.0; 12 * n],
            deformation: vec![0.0; self.channels * n],
        };
        for id in 0..n {
            state.position.push(self.position(particles.x[id]).ok_or_else(|| EngineError::LeftDomain {
                step: 0,
                time_s: 0.0,
                what: format!("particle {id} starts at {:?}", particles.x[id]),
            })?);
            for k in 0..3 {
                state.velocity[k * n + id] = particles.v[id][k] as f32;
                for column in 0..3 {
                    // Device distances are in cells.
                    state.velocity[(3 + 3 * column + k) * n + id] = (particles.b[id][3 * k + column] / self.dx) as f32;
                }
            }
            if self.plastic[particles.body[id] as usize] {
                state.deformation[9 * n + id] = particles.plastic[id] as f32;
            }
            let f = &particles.f[id];
            if self.fluid[particles.body[id] as usize] {
                state.deformation[id] = det(&from_row_major::<f64, 3>(f)) as f32;
            } else {
                for (row, column) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
                    state.deformation[(3 * column + row) * n + id] = f[3 * row + column] as f32;
                }
            }
        }
        Ok(state)
    }

    fn position(&self, x: [f64; 3]) -> Option<[u32; 4]> {
        let mut offset = [0.0f32; 3];
        let mut block = [0usize; 3];
        for a in 0..3 {
            let mut y = (x[a] - self.origin[a]) / self.dx - self.shift + self.pad[a] as f64;
            let extent = 4.0 * self.blocks[a] as f64;
            if self.periodic[a] {
                y = y.rem_euclid(extent);
                if y >= extent {
                    y = 0.0;
                }
            }
            if !(y >= 0.0 && y < extent) {
                return None;
            }
            block[a] = (y / 4.0) as usize;
            // f32 rounding may reach the next block's edge.
            offset[a] = ((y - 4.0 * block[a] as f64) as f32).min(4.0f32.next_down());
        }
        let index = (block[2] * self.blocks[1] + block[1]) * self.blocks[0] + block[0];
        Some([offset[0].to_bits(), offset[1].to_bits(), offset[2].to_bits(), index as u32])
    }

    /// Device states as particles in scene coordinates.
    /// `n`: the stride of channels.
    pub fn particles(&self, position: &[[u32; 4]], velocity: &[f32], deformation: &[f32], n: usize) -> Particles {
        let mut out = Particles { body: self.body_of.clone(), ..Particles::default() };
        for id in 0..position.len() {
            let p = position[id];
            let block = p[3] as usize;
            let at = [
                block % self.blocks[0],
                (block / self.blocks[0]) % self.blocks[1],
                block / (self.blocks[0] * self.blocks[1]),
            ];
            out.x.push(std::array::from_fn(|a| {
                let mut cells = 4.0 * at[a] as f64 + f64::from(f32::from_bits(p[a])) + self.shift - self.pad[a] as f64;
                if self.periodic[a] {
                    cells = cells.rem_euclid(4.0 * self.blocks[a] as f64);
                }
                self.origin[a] + cells * self.dx
            }));
            out.v.push(std::array::from_fn(|k| f64::from(velocity[k * n + id])));
            out.b.push(std::array::from_fn(|i| f64::from(velocity[(3 + 3 * (i % 3) + i / 3) * n + id]) * self.dx));
            let plastic = self.plastic[self.body_of[id] as usize];
            out.plastic.push(if plastic { f64::from(deformation[9 * n + id]) } else { 0.0 });
            out.f.push(if self.fluid[self.body_of[id] as usize] {
                let s = f64::from(deformation[id]).cbrt();
                [s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, s]
            } else {
                std::array::from_fn(|i| f64::from(deformation[(3 * (i % 3) + i / 3) * n + id]))
            });
        }
        out
    }

    /// The constant part of the shaders' parameters.
    pub fn params(&self, setup: &Setup) -> Params {
        Params {
            blocks: self.blocks.map(|b| b as u32),
            particles: setup.total_particles() as u32,
            live: self.body_of.len() as u32,
            cells: setup.cells.map(|c| c as f32),
            dx: setup.dx as f32,
            gravity: setup.gravity.map(|g| g as f32),
            pad: self.pad.map(|p| p as i32),
            periodic: self.periodic.map(u32::from),
            colliders: setup.colliders.len() as u32,
            walls: std::array::from_fn(|w| match setup.axes[w / 2] {
                Axis::Periodic => [0.0; 4],
                Axis::Walls(walls) => [contact_code(walls[w % 2]) as f32, walls[w % 2].friction as f32, 0.0, 0.0],
            }),
            ..Params::default()
        }
    }
}

fn contact_code(contact: Contact) -> u32 {
    match contact.kind {
        ContactKind::Sticky => 0,
        ContactKind::Slip => 1,
        ContactKind::Separate => 2,
    }
}

pub fn bodies(setup: &Setup) -> Vec<layout::Body> {
    (setup.bodies.iter())
        .zip(demands_at_rest_1_s2(setup))
        .map(|(b, demand)| layout::Body {
            mass: b.mass as f32,
            volume: b.volume0 as f32,
            material: b.material as u32,
            demand: demand as f32,
        })
        .collect()
}

pub fn materials(setup: &Setup) -> Vec<layout::Material> {
    setup.materials.iter().map(material).collect()
}

/// Parameters as the shaders know them; models are numbered as in `wgsl/shared/state.wgsl`.
pub fn material(material: &Material) -> layout::Material {
    let (model, parameters) = match Law::<f64>::new(material) {
        Law::FixedCorotated(l) => (0, [l.mu, l.lambda, 0.0, 0.0, 0.0]),
        Law::NeoHookean(l) => (1, [l.mu, l.lambda, 0.0, 0.0, 0.0]),
        Law::WeaklyCompressibleFluid(l) => (2, [l.b, l.gamma, l.viscosity, 0.0, 0.0]),
        Law::StvkHencky(l) => (3, [l.mu, l.lambda, 0.0, 0.0, 0.0]),
        Law::VonMises(l) => {
            let model = if l.elasticity == Elasticity::Hencky { 4 } else { 5 };
            (model, [l.hencky.mu, l.hencky.lambda, l.radius, 0.0, 0.0])
        }
        Law::DruckerPrager(l) => (6, [l.elastic.mu, l.elastic.lambda, l.slope, 0.0, 0.0]),
        Law::Nacc(l) => (7, [l.mu, l.lambda, l.m, l.beta, l.xi]),
        Law::Snow(l) => (8, [l.elastic.mu, l.elastic.lambda, l.least, l.most, l.hardening]),
    };
    let [a, b, c, d, e] = parameters.map(|x| x as f32);
    layout::Material { model, a, b, c, d, e, ..layout::Material::default() }
}

/// Signed distance programs, the samples of their fields, and colliders, in coordinates relative to
/// `domain.min`.
pub fn colliders(setup: &Setup) -> (Vec<layout::SdfOp>, Vec<f32>, Vec<layout::Collider>) {
    let (mut ops, mut samples, mut out) = (Vec::new(), Vec::new(), Vec::new());
    for c in &setup.colliders {
        out.push(layout::Collider {
            first: ops.len() as u32,
            count: c.sdf.ops.len() as u32,
            kind: contact_code(c.contact),
            friction: c.contact.friction as f32,
        });
        ops.extend(c.sdf.ops.iter().map(|op| sdf_op(op, setup.origin, &mut samples)));
    }
    (ops, samples, out)
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
                    samples.extend(field.samples.iter().map(|d| (scale * f64::from(*d)) as f32));
                    (7, small([unit, 0.0, 0.0]))
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

/// Pose of a collider at a time, for positions relative to `domain.min`.
pub fn pose(collider: &Collider, origin: [f64; 3], time_s: f64) -> layout::Pose {
    let now = collider.motion.at(time_s);
    let (r, t) = (now.pose.rotation, now.pose.translation);
    // x_start + origin = Rᵀ (x + origin - t)  ⇒  x_start = Rᵀ (x - t'), t' = t - origin + R origin
    let shifted: [f64; 3] =
        std::array::from_fn(|i| t[i] - origin[i] + (0..3).map(|a| r[3 * i + a] * origin[a]).sum::<f64>());
    let row = |i: usize| [r[i] as f32, r[3 + i] as f32, r[6 + i] as f32, shifted[i] as f32];
    let center = std::array::from_fn::<f64, 3, _>(|a| now.center[a] - origin[a]);
    let with = |v: [f64; 3], w: f32| [v[0] as f32, v[1] as f32, v[2] as f32, w];
    layout::Pose {
        r0: row(0),
        r1: row(1),
        r2: row(2),
        linear: with(now.linear_velocity, if collider.is_present(time_s) { 1.0 } else { 0.0 }),
        angular: with(now.angular_velocity, 0.0),
        center: with(center, 0.0),
    }
}
