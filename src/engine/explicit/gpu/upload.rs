//! Coordinates and particle states as device data.

use std::ops::Range;

use super::layout::{MOST_FIELDS, PAD_BLOCKS, Params, TOUCH_CHANNELS};
use super::scene::contact_code;
use crate::contract::EngineError;
use gridfall_core::maths::linalg::{det, from_row_major};
use gridfall_core::sim::pair;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Axis, ContactKind, Kernel, Material, Setup};
use gridfall_core::sim::side::{self, Plates};
use gridfall_core::sim::touch::Touch;

/// Cells by which a kernel's base node is shifted: y = x/dx - shift has floor(y) as its first node
/// (`SHIFT` in the shaders).
pub fn shift(kernel: Kernel) -> f64 {
    if kernel == Kernel::Quadratic { 0.5 } else { 0.25 }
}

/// Sign s of each grid, whose nodes lie at (i + s/4) dx.
pub fn grid_offsets(kernel: Kernel) -> &'static [i32] {
    if kernel == Kernel::Quadratic { &[0] } else { &[1, -1] }
}

/// Blocks of room beyond either end of each axis.
fn pads(setup: &Setup) -> [usize; 3] {
    setup.axes.map(|axis| if axis == Axis::Periodic { 0 } else { PAD_BLOCKS })
}

/// Blocks of a layer along each axis.
fn extent(setup: &Setup) -> [usize; 3] {
    let pad = pads(setup);
    std::array::from_fn(|a| setup.cells[a].div_ceil(4) + 2 * pad[a])
}

/// Whether an i32 can count the blocks of all layers.
pub fn is_numbered(setup: &Setup) -> bool {
    let count = extent(setup).iter().fold(side::layers(setup), |n, blocks| n.saturating_mul(*blocks));
    count < i32::MAX as usize
}

/// By field: contact kind, friction, mass of a full node.
fn contacts(setup: &Setup) -> [[f32; 4]; MOST_FIELDS] {
    let mut all = [[0.0; 4]; MOST_FIELDS];
    for ((to, contact), full) in all.iter_mut().zip(pair::contacts(setup)).zip(pair::full_nodes(setup)) {
        *to = [contact_code(contact) as f32, contact.friction as f32, full as f32, 0.0];
    }
    all
}

/// Everything about the device's coordinates and state layout that does not change during a run.
#[derive(Clone)]
pub struct DeviceLayout {
    origin: [f64; 3],
    dx: f64,
    shift: f64,
    blocks: [usize; 3],
    pad: [usize; 3],
    periodic: [bool; 3],
    /// By body: first block of its layer of the table.
    layer: Vec<usize>,
    /// Layers of the table.
    fields: usize,
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
    /// Of those that know something of contact: the first ones, or none.
    pub touches: Vec<u32>,
}

impl DeviceLayout {
    pub fn new(setup: &Setup) -> Self {
        let periodic = setup.axes.map(|a| a == Axis::Periodic);
        let pad = pads(setup);
        let of_bodies = |property: fn(&Material) -> bool| -> Vec<bool> {
            setup.bodies.iter().map(|b| property(&setup.materials[b.material])).collect()
        };
        let (fluid, plastic) = (of_bodies(Material::is_fluid), of_bodies(Material::has_plastic_state));
        let blocks = extent(setup);
        let size: usize = blocks.iter().product();
        Self {
            origin: setup.origin,
            dx: setup.dx,
            shift: shift(setup.kernel),
            layer: pair::fields(setup).into_iter().map(|field| field * size).collect(),
            fields: side::layers(setup),
            blocks,
            pad: pad.map(|p| 4 * p),
            periodic,
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
        self.fields * self.layer_len()
    }

    /// Blocks of one layer of the table.
    fn layer_len(&self) -> usize {
        self.blocks.iter().product()
    }

    /// Blocks that hold particles, or lie beside one that does: what the first activation will ask
    /// for. Errors as those of [`Self::state`].
    pub fn active_blocks(&self, particles: &Particles, plates: &Plates) -> Result<usize, EngineError> {
        let mut occupied: Vec<u32> = Vec::new();
        for id in 0..particles.len() {
            let block = self.place(particles, id, plates)?[3];
            // Neighbours in the list are neighbours in space.
            if occupied.last() != Some(&block) {
                occupied.push(block);
            }
        }
        occupied.sort_unstable();
        occupied.dedup();
        let n = self.blocks.map(|b| b as i64);
        let beside = |block: u32| {
            let b = i64::from(block);
            let at = [b % n[0], (b / n[0]) % n[1], (b / (n[0] * n[1])) % n[2]];
            let layer = b - b % self.layer_len() as i64;
            (0..27).filter_map(move |k| {
                let c: [i64; 3] = std::array::from_fn(|a| at[a] + [k % 3, (k / 3) % 3, k / 9][a] - 1);
                let c: [i64; 3] = std::array::from_fn(|a| if self.periodic[a] { c[a].rem_euclid(n[a]) } else { c[a] });
                let inside = (0..3).all(|a| c[a] >= 0 && c[a] < n[a]);
                inside.then_some((layer + (c[2] * n[1] + c[1]) * n[0] + c[0]) as u32)
            })
        };
        let mut all: Vec<u32> = occupied.into_iter().flat_map(beside).collect();
        all.sort_unstable();
        all.dedup();
        Ok(all.len())
    }

    /// States of some particles by id; plates tell the layers of those near them. Errors:
    /// [`EngineError::LeftDomain`] for a particle outside all blocks.
    pub fn state(&self, all: &Particles, some: Range<usize>, plates: &Plates) -> Result<DeviceState, EngineError> {
        let within = |id: usize| id.min(all.touch.len());
        let touches = &all.touch[within(some.start)..within(some.end)];
        let (n, known) = (some.len(), touches.len());
        let mut state = DeviceState {
            position: Vec::with_capacity(n),
            velocity: vec![0.0; 12 * n],
            deformation: vec![0.0; self.channels * n],
            touches: vec![0; TOUCH_CHANNELS * known],
        };
        for (id, touch) in touches.iter().enumerate() {
            state.touches[id] = touch.with;
            for (k, value) in (1..).zip([touch.radius].iter().chain(&touch.stretch)) {
                state.touches[k * known + id] = (*value as f32).to_bits();
            }
        }
        for (at, id) in some.enumerate() {
            state.position.push(self.place(all, id, plates)?);
            for k in 0..3 {
                state.velocity[k * n + at] = all.v[id][k] as f32;
                for column in 0..3 {
                    // Device distances are in cells.
                    state.velocity[(3 + 3 * column + k) * n + at] = (all.b[id][3 * k + column] / self.dx) as f32;
                }
            }
            if self.plastic[all.body[id] as usize] {
                state.deformation[9 * n + at] = all.plastic[id] as f32;
            }
            let f = &all.f[id];
            if self.fluid[all.body[id] as usize] {
                state.deformation[at] = det(&from_row_major::<f64, 3>(f)) as f32;
            } else {
                for (row, column) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
                    state.deformation[(3 * column + row) * n + at] = f[3 * row + column] as f32;
                }
            }
        }
        Ok(state)
    }

    /// Offset in the block (f32 bits) and block of a particle.
    fn place(&self, particles: &Particles, id: usize, plates: &Plates) -> Result<[u32; 4], EngineError> {
        let x = particles.x[id];
        let side = plates.layer(x) as usize * self.layer_len();
        let layer = self.layer[particles.body[id] as usize] + side;
        self.position(x, layer).ok_or_else(|| EngineError::LeftDomain {
            step: 0,
            time_s: 0.0,
            what: format!("particle {id} starts at {x:?}"),
        })
    }

    fn position(&self, x: [f64; 3], layer: usize) -> Option<[u32; 4]> {
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
        let index = layer + (block[2] * self.blocks[1] + block[1]) * self.blocks[0] + block[0];
        Some([offset[0].to_bits(), offset[1].to_bits(), offset[2].to_bits(), index as u32])
    }

    /// What the first `live` particles remember of contact.
    /// `n`: the stride of channels.
    pub fn touches(touches: &[u32], live: usize, n: usize) -> Vec<Touch> {
        let value = |k: usize, id: usize| f64::from(f32::from_bits(touches[k * n + id]));
        let touch = |id: usize| {
            let with = touches[id];
            let stretch = if with == 0 { [0.0; 3] } else { [2, 3, 4].map(|k| value(k, id)) };
            Touch { radius: value(1, id), stretch, with }
        };
        (0..live).map(touch).collect()
    }

    /// Device states as particles in scene coordinates.
    /// `n`: the stride of channels.
    pub fn particles(
        &self,
        body: Vec<u32>,
        position: &[[u32; 4]],
        velocity: &[f32],
        deformation: &[f32],
        n: usize,
    ) -> Particles {
        let mut out = Particles::default();
        for (id, &body) in body.iter().enumerate() {
            out.x.push(self.scene_position(position[id]));
            out.v.push(std::array::from_fn(|k| f64::from(velocity[k * n + id])));
            out.b.push(std::array::from_fn(|i| f64::from(velocity[(3 + 3 * (i % 3) + i / 3) * n + id]) * self.dx));
            let (f, plastic) = self.scene_deformation(body, |k| deformation[k * n + id]);
            out.f.push(f);
            out.plastic.push(plastic);
        }
        out.body = body;
        out
    }

    /// A position in scene coordinates (m).
    pub fn scene_position(&self, p: [u32; 4]) -> [f64; 3] {
        let block = p[3] as usize;
        let at = [
            block % self.blocks[0],
            (block / self.blocks[0]) % self.blocks[1],
            (block / (self.blocks[0] * self.blocks[1])) % self.blocks[2],
        ];
        std::array::from_fn(|a| {
            let mut cells = 4.0 * at[a] as f64 + f64::from(f32::from_bits(p[a])) + self.shift - self.pad[a] as f64;
            if self.periodic[a] {
                cells = cells.rem_euclid(4.0 * self.blocks[a] as f64);
            }
            self.origin[a] + cells * self.dx
        })
    }

    /// F and the plastic state of a particle of a body, from its channels.
    pub fn scene_deformation(&self, body: u32, channel: impl Fn(usize) -> f32) -> ([f64; 9], f64) {
        let plastic = if self.plastic[body as usize] { f64::from(channel(9)) } else { 0.0 };
        if self.fluid[body as usize] {
            let s = f64::from(channel(0)).cbrt();
            return ([s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, s], plastic);
        }
        (std::array::from_fn(|i| f64::from(channel(3 * (i % 3) + i / 3))), plastic)
    }

    /// Where sticky walls stop particles on the way down and up an axis, and where they have left the domain: in
    /// the shaders' y, from the domain's corner.
    fn limits(&self, setup: &Setup, axis: usize) -> [f32; 4] {
        let end = setup.cells[axis] as f64;
        let y = |x: f64| (x - self.shift) as f32;
        let Axis::Walls(walls) = setup.axes[axis] else {
            return [f32::MIN, f32::MAX, f32::MIN, f32::MAX];
        };
        let [low, high] = walls.map(|wall| wall.kind == ContactKind::Sticky);
        [if low { y(0.0) } else { f32::MIN }, if high { y(end) } else { f32::MAX }, y(-1.0), y(end + 1.0)]
    }

    /// The constant part of the shaders' parameters.
    pub fn params(&self, setup: &Setup) -> Params {
        let limits = [0, 1, 2].map(|axis| self.limits(setup, axis));
        let limit = |k: usize| limits.map(|of_axis| of_axis[k]);
        Params {
            blocks: self.blocks.map(|b| b as u32),
            particles: setup.total_particles() as u32,
            cells: setup.cells.map(|c| c as f32),
            dx: setup.dx as f32,
            gravity: setup.gravity.map(|g| g as f32),
            pad: self.pad.map(|p| p as i32),
            periodic: self.periodic.map(u32::from),
            colliders: setup.colliders.len() as u32,
            fields: self.fields as u32,
            sided: u32::from(side::acts(setup)),
            contacts: contacts(setup),
            lowest: limit(0),
            highest: limit(1),
            outer_low: limit(2),
            outer_high: limit(3),
            walls: std::array::from_fn(|w| match setup.axes[w / 2] {
                Axis::Periodic => [0.0; 4],
                Axis::Walls(walls) => [contact_code(walls[w % 2]) as f32, walls[w % 2].friction as f32, 0.0, 0.0],
            }),
            ..Params::default()
        }
    }
}
