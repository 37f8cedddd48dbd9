//! Grid, system and objective as the device has them, for comparison with the CPU.

use super::interface::{Evaluate, slots};
use super::layout::{Link, PRESS_CHANNELS, Params};
use super::step::DeviceStep;
use crate::contract::EngineError;
use crate::implicit::solver::objective::{Freedom, NodeId};

/// A node that particles touch.
#[derive(Clone, Copy, Debug)]
pub struct NodeReading {
    pub id: NodeId<3>,
    /// kg.
    pub mass: f64,
    /// m/s, at the step's start.
    pub velocity: [f64; 3],
    /// ξ_i (Pa).
    pub stiffness: f64,
    /// m/s: where the solver starts, and what is prescribed; after the step, the velocity at its
    /// end.
    pub target: [f64; 3],
}

/// The system of a step.
#[derive(Clone, Debug)]
pub struct SystemReading {
    pub ids: Vec<NodeId<3>>,
    pub freedoms: Vec<Freedom<3>>,
    pub masses: Vec<f64>,
    pub scales: Vec<f64>,
    /// Δv (m/s).
    pub dv: Vec<[f64; 3]>,
    /// By row and slot.
    pub columns: Vec<Vec<u32>>,
    /// By row and slot (kg).
    pub blocks: Vec<Vec<[[f64; 3]; 3]>>,
    /// By row: the sum of its blocks (kg).
    pub anchors: Vec<[[f64; 3]; 3]>,
}

/// A particle near a face.
#[derive(Clone, Copy, Debug)]
pub struct LinkReading {
    pub id: u32,
    pub collider: u32,
    /// Of friction (N).
    pub limit: f64,
    /// N; after the step, what the face took (N s).
    pub force: [f64; 3],
    /// N/m.
    pub stiffness: [[f64; 3]; 3],
}

/// Particles in some order.
#[derive(Clone, Debug, PartialEq)]
pub struct ParticleReading {
    /// Offset in the block (cells, f32 bits), and block.
    pub positions: Vec<[u32; 4]>,
    /// Id and body.
    pub tags: Vec<[u32; 2]>,
    /// By particle: v, B, F and, if any law has one, the plastic state, as f32 bits.
    pub states: Vec<Vec<u32>>,
}

/// Blocks and particles of a step that has begun.
#[derive(Clone, Debug)]
pub struct SortReading {
    pub params: Params,
    /// By block of the dense table: its slot + 1, or 0.
    pub table: Vec<u32>,
    /// By slot: its block.
    pub blocks: Vec<u32>,
    /// Particles by cell of a slot.
    pub counts: Vec<u32>,
    /// The first particle of a cell, and one more.
    pub starts: Vec<u32>,
    pub before: ParticleReading,
    pub sorted: ParticleReading,
}

impl DeviceStep {
    /// What the sort at a step's beginning has made of blocks and particles.
    pub fn sorting(&self) -> Result<SortReading, EngineError> {
        let (counts, memory) = (&self.buffers.counts, &self.buffers.memory);
        let cells = counts.capacity * counts.cells();
        Ok(SortReading {
            params: self.params,
            table: memory.read(&self.gpu, "table", counts.table)?,
            blocks: memory.read(&self.gpu, "block_list", self.buffers.blocks)?,
            counts: memory.read(&self.gpu, "counts", cells)?,
            starts: memory.read(&self.gpu, "starts", cells + 1)?,
            before: self.listed(["position_in", "tag_in", "state_in"])?,
            sorted: self.listed(["position", "tag", "state"])?,
        })
    }

    fn listed(&self, [position, tag, state]: [&str; 3]) -> Result<ParticleReading, EngineError> {
        let (n, memory) = (self.buffers.live, &self.buffers.memory);
        let (room, channels) = (self.buffers.counts.particles, self.buffers.counts.channels);
        let values: Vec<u32> = memory.read(&self.gpu, state, channels * room)?;
        Ok(ParticleReading {
            positions: memory.read(&self.gpu, position, n)?,
            tags: memory.read(&self.gpu, tag, n)?,
            states: (0..n).map(|at| (0..channels).map(|k| values[k * room + at]).collect()).collect(),
        })
    }

    /// The nodes that particles touch. `ended`: after the step's end.
    pub fn nodes(&self, ended: bool) -> Result<Vec<NodeReading>, EngineError> {
        let grids = self.buffers.counts.grids();
        let (blocks, memory) = (self.buffers.blocks, &self.buffers.memory);
        let n = blocks * grids * 64;
        let list: Vec<u32> = memory.read(&self.gpu, "block_list", blocks)?;
        let node: Vec<[f32; 4]> = memory.read(&self.gpu, "node", n)?;
        let stiffness: Vec<f32> = memory.read(&self.gpu, "node_scale", n)?;
        let target: Vec<[f32; 4]> = memory.read(&self.gpu, if ended { "moving" } else { "begin" }, n)?;
        let small = |v: [f32; 4]| [v[0], v[1], v[2]].map(f64::from);
        let reading = |at: usize| {
            let [nx, ny, _] = self.params.blocks;
            let block = list[at / (64 * grids)];
            let corner = [block % nx, block / nx % ny, block / (nx * ny)];
            let local = [at % 4, at / 4 % 4, at / 16 % 4];
            let index = std::array::from_fn(|a| 4 * corner[a] as i32 + local[a] as i32 - self.params.pad[a]);
            NodeReading {
                id: NodeId { grid: (at / 64 % grids) as u8, index },
                mass: f64::from(node[at][3]),
                velocity: small(node[at]),
                stiffness: f64::from(stiffness[at]),
                target: small(target[at]),
            }
        };
        Ok((0..n).filter(|&at| node[at][3] > 0.0).map(reading).collect())
    }

    /// The system, with its matrix as the last assembly left it.
    pub fn system(&self) -> Result<SystemReading, EngineError> {
        let system = &self.buffers.system;
        let (n, stride) = (system.rows as usize, system.stride as usize);
        let slots = slots(system.kernel) as usize;
        let ids: Vec<[i32; 4]> = system.memory.read(&self.gpu, "ids", n)?;
        let freedoms: Vec<[f32; 4]> = system.memory.read(&self.gpu, "freedoms", n)?;
        let masses: Vec<f32> = system.memory.read(&self.gpu, "masses", n)?;
        let scales: Vec<f32> = system.memory.read(&self.gpu, "scales", n)?;
        let columns: Vec<u32> = system.memory.read(&self.gpu, "columns", slots * stride)?;
        let values: Vec<f32> = system.memory.read(&self.gpu, "values", 9 * slots * stride)?;
        let anchors: Vec<f32> = system.memory.read(&self.gpu, "anchors", 9 * stride)?;
        let freedom = |f: &[f32; 4]| {
            let direction = [f[0], f[1], f[2]].map(f64::from);
            match f[3] {
                0.0 => Freedom::Free,
                1.0 => Freedom::Plane(direction),
                _ => Freedom::Line(direction),
            }
        };
        let entries = |values: &[f32], slot: usize, row: usize| -> [[f64; 3]; 3] {
            std::array::from_fn(|a| std::array::from_fn(|c| f64::from(values[(slot * 9 + 3 * a + c) * stride + row])))
        };
        Ok(SystemReading {
            ids: ids.iter().map(|i| NodeId { grid: i[3] as u8, index: [i[0], i[1], i[2]] }).collect(),
            freedoms: freedoms.iter().map(freedom).collect(),
            masses: masses.iter().map(|&m| f64::from(m)).collect(),
            scales: scales.iter().map(|&s| f64::from(s)).collect(),
            dv: self.vectors("dv")?,
            columns: (0..n).map(|row| (0..slots).map(|slot| columns[slot * stride + row]).collect()).collect(),
            blocks: (0..n).map(|row| (0..slots).map(|slot| entries(&values, slot, row)).collect()).collect(),
            anchors: (0..n).map(|row| entries(&anchors, 0, row)).collect(),
        })
    }

    /// The particles near faces, with what these do to them as last evaluated.
    pub fn links(&self) -> Result<Vec<LinkReading>, EngineError> {
        let (n, room, memory) = (self.buffers.links, self.buffers.counts.links, &self.buffers.memory);
        if n == 0 {
            return Ok(Vec::new());
        }
        let links: Vec<Link> = memory.read(&self.gpu, "links", n)?;
        let press: Vec<f32> = memory.read(&self.gpu, "press", PRESS_CHANNELS * room)?;
        let tags: Vec<[u32; 2]> = memory.read(&self.gpu, "tag", self.buffers.live)?;
        let reading = |(at, link): (usize, &Link)| {
            let value = |channel: usize| f64::from(press[channel * room + at]);
            LinkReading {
                id: tags[link.particle as usize][0],
                collider: link.collider,
                limit: f64::from(link.limit),
                force: [0, 1, 2].map(value),
                stiffness: [[3, 4, 5], [4, 6, 7], [5, 7, 8]].map(|row| row.map(value)),
            }
        };
        Ok(links.iter().enumerate().map(reading).collect())
    }

    fn vectors(&self, name: &str) -> Result<Vec<[f64; 3]>, EngineError> {
        let (n, stride) = (self.buffers.system.rows as usize, self.buffers.system.stride as usize);
        let values: Vec<f32> = self.buffers.system.memory.read(&self.gpu, name, 3 * stride)?;
        Ok((0..n).map(|i| [0, 1, 2].map(|a| f64::from(values[a * stride + i]))).collect())
    }

    /// Puts Δv (m/s) in the place of the solver's.
    pub fn set_dv(&self, dv: &[[f64; 3]]) {
        let stride = self.buffers.system.stride as usize;
        let mut values = vec![0.0f32; 3 * stride];
        for (i, v) in dv.iter().enumerate() {
            (0..3).for_each(|a| values[a * stride + i] = v[a] as f32);
        }
        self.buffers.system.memory.write(&self.gpu, "dv", 0, &values);
    }

    /// [`Self::reach`] of the direction in `dv`.
    pub fn reach_along_dv(&self) -> Result<f64, EngineError> {
        self.gpu.submit(|encoder| self.look_at_dv(encoder));
        self.reach()
    }

    /// The matrix at `dv`.
    pub fn assemble(&self) {
        self.gpu.submit(|encoder| {
            self.look_at_dv(encoder);
            self.record_hessian(&mut encoder.begin_compute_pass(&Default::default()));
        });
    }

    /// E (J) and ∇E (kg m/s) at Δv.
    pub fn evaluate(&self) -> Result<(f64, Vec<[f64; 3]>), EngineError> {
        Ok((self.energy()?, self.vectors("gradient")?))
    }
}
