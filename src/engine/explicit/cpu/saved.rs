//! What a frame starts from, as bytes: the blocks' particles, bit by bit.

use std::io::{self, Read, Write};

use bytemuck::Pod;

use super::chunk::{Chunk, LANES, State};
use super::simulation::{Block, Simulation};
use crate::state::{foreign, get_count, get_into, get_one, get_reactions, get_touch};
use crate::state::{put, put_reactions, put_touch};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::touch::Touch;

/// No domain has blocks so far from its corner.
const FARTHEST_BLOCK: u32 = 1 << 20;

impl<T: Real + Pod, const D: usize> Simulation<T, D> {
    pub fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        put(to, &[self.time_s])?;
        put_reactions(to, &self.stopped)?;
        put_reactions(to, &self.pressed)?;
        put(to, &[self.blocks.len() as u64])?;
        for block in &self.blocks {
            put(to, &[block.field])?;
            put(to, &block.coordinates)?;
            put(to, &[block.chunks.len() as u64])?;
            block.chunks.iter().try_for_each(|chunk| save_chunk(chunk, to))?;
        }
        Ok(())
    }

    /// The order of particles in blocks is that of the saved run: sums that follow it stay the same.
    pub fn restore(&mut self, from: &mut dyn Read) -> io::Result<()> {
        self.clear();
        self.time_s = get_one(from)?;
        get_reactions(from, &mut self.stopped)?;
        get_reactions(from, &mut self.pressed)?;
        let most = self.setup.total_particles();
        let blocks = (0..get_count(from, most, "blocks")?).map(|_| {
            let field = get_one(from)?;
            let mut coordinates = [0; D];
            get_into(from, &mut coordinates)?;
            if coordinates.iter().any(|c: &i32| c.unsigned_abs() > FARTHEST_BLOCK) {
                return Err(foreign(&format!("a block at {coordinates:?}")));
            }
            let chunks = (0..get_count(from, most, "chunks")?).map(|_| self.restore_chunk(from));
            let chunks = chunks.collect::<io::Result<Vec<_>>>()?;
            let (inside, planes) = (self.inside(&coordinates), self.planes(&coordinates));
            // The start of the frame bins, and finds where walls are.
            Ok(Block { field, coordinates, chunks, inside, planes, walls: None })
        });
        self.blocks = blocks.collect::<io::Result<_>>()?;
        // Every particle that there is, once.
        let mut seen = vec![false; self.count().min(most)];
        for chunk in self.blocks.iter().flat_map(|block| &block.chunks) {
            for &id in &chunk.id[..chunk.count] {
                match seen.get_mut(id as usize) {
                    Some(seen) if !*seen => *seen = true,
                    _ => return Err(foreign(&format!("particle {id} has no place"))),
                }
            }
        }
        Ok(())
    }

    fn restore_chunk(&self, from: &mut dyn Read) -> io::Result<Chunk<T, D>> {
        let [body, count]: [u32; 2] = get_one(from)?;
        let setup = self.constants.bodies.get(body as usize).ok_or_else(|| foreign(&format!("body {body}")))?;
        if count == 0 || count as usize > LANES {
            return Err(foreign(&format!("{count} particles in {LANES} lanes")));
        }
        let touch = self.springs.get(body as usize).map(Touch::new);
        let mut chunk = Chunk::empty(body, setup.kind(), touch);
        chunk.count = count as usize;
        get_into(from, &mut chunk.id)?;
        let (vectors, matrices) = (chunk.x.iter_mut().chain(&mut chunk.v), chunk.b.iter_mut().flatten());
        vectors.chain(matrices).try_for_each(|lanes| get_into(from, lanes))?;
        match &mut chunk.state {
            State::Solid { f, plastic, grad_v } => {
                let grad_v = grad_v.iter_mut().flat_map(|grad_v| grad_v.iter_mut().flatten());
                let lanes = f.iter_mut().flatten().chain([plastic]).chain(grad_v);
                lanes.into_iter().try_for_each(|lanes| get_into(from, lanes))?;
            }
            State::Fluid { j, grad_v } => {
                let grad_v = grad_v.iter_mut().flat_map(|grad_v| grad_v.iter_mut().flatten());
                [j].into_iter().chain(grad_v).try_for_each(|lanes| get_into(from, lanes))?;
            }
        }
        if let Some(touches) = &mut chunk.touch {
            for touch in touches.iter_mut() {
                *touch = get_touch(from)?;
            }
        }
        Ok(chunk)
    }
}

fn save_chunk<T: Real + Pod, const D: usize>(chunk: &Chunk<T, D>, to: &mut dyn Write) -> io::Result<()> {
    put(to, &[chunk.body, chunk.count as u32])?;
    put(to, &chunk.id)?;
    let (vectors, matrices) = (chunk.x.iter().chain(&chunk.v), chunk.b.iter().flatten());
    vectors.chain(matrices).try_for_each(|lanes| put(to, lanes))?;
    match &chunk.state {
        State::Solid { f, plastic, grad_v } => {
            let grad_v = grad_v.iter().flat_map(|grad_v| grad_v.iter().flatten());
            f.iter().flatten().chain([plastic]).chain(grad_v).try_for_each(|lanes| put(to, lanes))?;
        }
        State::Fluid { j, grad_v } => {
            let grad_v = grad_v.iter().flat_map(|grad_v| grad_v.iter().flatten());
            [j].into_iter().chain(grad_v).try_for_each(|lanes| put(to, lanes))?;
        }
    }
    chunk.touch.iter().flat_map(|touches| touches.iter()).try_for_each(|touch| put_touch(to, touch))
}
