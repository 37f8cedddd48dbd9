//! Contact of a block's particles with the faces of colliders (see [`gridfall_core::sim::touch`]).
//!
//! After G2P has moved particles, none has gone through a face, and springs are carried along; P2G
//! takes the springs' impulses. In: particles, colliders. Out: particles, impulses, and what
//! colliders took. Distances are f64, and are asked for near colliders only.

use super::chunk::{Chunk, Lanes};
use super::tile::{BLOCK, SLACK};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::reaction::{self, Reaction, WALLS};
use gridfall_core::sim::setup::{Axis, Setup};
use gridfall_core::sim::surface::Surface;
use gridfall_core::sim::touch::{BONDED, STANDOFF, Springs, Touch};

/// Distance, as a share of the standoff, at which a particle that was stopped meets a sheet again; it
/// stands farther from the face that has stopped it.
const AGAIN: f64 = 0.2;

/// What the particles of a block may touch.
pub struct Contacts<'a> {
    setup: &'a Setup,
    /// By body.
    springs: &'a [Springs],
    near: Vec<&'a Surface<'a>>,
    /// The block's node 0 (m).
    corner: [f64; 3],
}

impl<'a> Contacts<'a> {
    /// Those of a block; none if nothing is near. A distance changes by at most the distance moved (and a slack of
    /// sampled shapes), so that the one at the block's middle decides.
    pub fn of<const D: usize>(
        setup: &'a Setup,
        springs: &'a [Springs],
        surfaces: &'a [Surface<'a>],
        block: &[i32; D],
    ) -> Option<Self> {
        let (mut corner, mut middle) = ([0.0; 3], [0.0; 3]);
        for a in 0..D {
            corner[a] = setup.origin[a] + f64::from(BLOCK * block[a]) * setup.dx;
            middle[a] = corner[a] + (0.5 * f64::from(BLOCK) + 0.25) * setup.dx;
        }
        // What strays and what surfaces move is within a cell each.
        let reach = (0.5 * f64::from(BLOCK) + 0.25 + f64::from(SLACK)) * (D as f64).sqrt() + 2.0;
        // Particles of a block on a periodic seam may be on the other side of the domain.
        let folds = (0..D).any(|a| {
            let first = BLOCK * block[a] - SLACK;
            setup.axes[a] == Axis::Periodic && (first < 0 || first + BLOCK + 2 * SLACK + 1 > setup.cells[a] as i32)
        });
        let is_near = |s: &&Surface| folds || s.before.distance(middle) <= reach * setup.dx + s.before.slack();
        let near: Vec<_> = surfaces.iter().filter(is_near).collect();
        (!near.is_empty()).then_some(Self { setup, springs, near, corner })
    }

    /// The block's node 0 (m), seen from where a particle is in the domain's own period.
    fn corner<T: Real, const D: usize>(&self, x: &[Lanes<T>; D], l: usize) -> [f64; 3] {
        let unfolded = self.place(self.corner, x, l);
        let folded = self.setup.wrapped(unfolded);
        std::array::from_fn(|a| self.corner[a] + (folded[a] - unfolded[a]))
    }

    fn place<T: Real, const D: usize>(&self, corner: [f64; 3], x: &[Lanes<T>; D], l: usize) -> [f64; 3] {
        let mut place = corner;
        for a in 0..D {
            place[a] += self.setup.dx * x[a][l].to_f64();
        }
        place
    }

    /// A particle meets the faces that appear.
    fn meet(&self, x: [f64; 3], springs: &Springs, touch: &mut Touch) {
        for surface in self.near.iter().filter(|surface| surface.appears) {
            let distance = surface.after.distance(x);
            if distance <= BONDED * springs.spacing {
                touch.meet(springs, surface.number(), surface.contact, distance);
            }
        }
    }

    /// After a step of `dt` (s) that took particles from `from`: stops those that would go through a face, and carries
    /// springs along.
    pub fn follow<T: Real, const D: usize>(
        &self,
        chunk: &mut Chunk<T, D>,
        from: &[Lanes<T>; D],
        mass: f64,
        dt: f64,
        taken: &mut Taken,
    ) {
        let springs = &self.springs[chunk.body as usize];
        let Some(mut touches) = chunk.touch.take() else { return };
        for l in 0..chunk.count {
            let corner = self.corner(from, l);
            let (start, mut end) = (self.place(corner, from, l), self.place(corner, &chunk.x, l));
            let least = STANDOFF * springs.spacing;
            let mut stopped = false;
            for surface in &self.near {
                if let Some(share) = surface.before.meets(&surface.after, start, end, least) {
                    end = surface.stop([start, end], share, springs.spacing, self.setup.dx);
                    self.check(surface, chunk, l, corner, [start, end], mass, dt, taken);
                    stopped = true;
                }
            }
            // What slides along a face may slide through a sheet, which has no inside to come back from.
            for surface in self.near.iter().filter(|surface| stopped && surface.after.is_sheet()) {
                if let Some(share) = surface.before.meets(&surface.after, start, end, AGAIN * least) {
                    end = surface.on_the_way([start, end], share);
                    self.put(chunk, l, corner, end);
                }
            }
            let touch = &mut touches[l];
            if touch.with == 0 {
                continue;
            }
            match self.near.iter().find(|surface| surface.number() == touch.with) {
                Some(surface) => {
                    let carried = surface.carried(start);
                    touch.stretch = surface.turned(std::array::from_fn(|a| touch.stretch[a] + end[a] - carried[a]));
                }
                None => *touch = Touch::new(springs),
            }
        }
        chunk.touch = Some(touches);
    }

    fn put<T: Real, const D: usize>(&self, chunk: &mut Chunk<T, D>, l: usize, corner: [f64; 3], x: [f64; 3]) {
        for a in 0..D {
            chunk.x[a][l] = T::from_f64((x[a] - corner[a]) / self.setup.dx);
        }
    }

    /// Puts a particle where it was stopped, without the velocity that takes it there again.
    #[allow(clippy::too_many_arguments)]
    fn check<T: Real, const D: usize>(
        &self,
        surface: &Surface,
        chunk: &mut Chunk<T, D>,
        l: usize,
        corner: [f64; 3],
        [start, end]: [[f64; 3]; 2],
        mass: f64,
        dt: f64,
        taken: &mut Taken,
    ) {
        let n = surface.face(end, surface.after.distance(end), self.setup.dx).normal;
        let carried = surface.carried(start);
        let inward = (0..D).map(|a| (chunk.v[a][l].to_f64() - (carried[a] - start[a]) / dt) * n[a]).sum::<f64>();
        self.put(chunk, l, corner, end);
        for a in 0..D {
            chunk.v[a][l] -= T::from_f64(inward.min(0.0) * n[a]);
        }
        taken.take(self.setup, surface, n.map(|n| mass * inward.min(0.0) * n), end);
    }

    /// Impulses (N s; 2D: per metre) of the springs over `dt` (s).
    pub fn press<T: Real, const D: usize>(
        &self,
        chunk: &mut Chunk<T, D>,
        dt: f64,
        impulses: &mut [Lanes<T>; D],
        taken: &mut Taken,
    ) {
        let springs = &self.springs[chunk.body as usize];
        let Some(mut touches) = chunk.touch.take() else { return };
        for l in 0..chunk.count {
            let touch = &mut touches[l];
            let x = self.place(self.corner(&chunk.x, l), &chunk.x, l);
            self.meet(x, springs, touch);
            let mut v = [0.0; 3];
            for a in 0..D {
                v[a] = chunk.v[a][l].to_f64();
            }
            let (mut sum, mut nearest) = ([0.0; 3], f64::INFINITY);
            for surface in &self.near {
                let distance = surface.after.distance(x);
                nearest = nearest.min(distance);
                if distance >= touch.radius && touch.with != surface.number() {
                    continue;
                }
                let force = touch.press(springs, &surface.face(x, distance, self.setup.dx), &v);
                taken.take(self.setup, surface, force.map(|f| -f * dt), x);
                sum = std::array::from_fn(|a| sum[a] + force[a]);
            }
            touch.recover(springs, nearest);
            for a in 0..D {
                impulses[a][l] = T::from_f64(sum[a] * dt);
            }
        }
        chunk.touch = Some(touches);
    }
}

/// What surfaces take from the particles of a block; empty until one takes something.
#[derive(Clone, Debug, Default)]
pub struct Taken(Vec<Reaction>);

impl Taken {
    fn take(&mut self, setup: &Setup, surface: &Surface, impulse: [f64; 3], at: [f64; 3]) {
        if impulse == [0.0; 3] {
            return;
        }
        self.0.resize(reaction::surfaces(setup), Reaction::default());
        let center = surface.after.motion.center;
        self.0[WALLS + surface.index].take(impulse, std::array::from_fn(|a| at[a] - center[a]));
    }

    pub fn add_to(&self, sums: &mut [Reaction]) {
        reaction::add_all(sums, &self.0);
    }
}

/// Releases the particles of a chunk that nothing is near.
pub fn release<T: Real, const D: usize>(springs: &[Springs], chunk: &mut Chunk<T, D>) {
    let springs = &springs[chunk.body as usize];
    if let Some(touches) = &mut chunk.touch {
        touches[..chunk.count].iter_mut().filter(|touch| touch.with != 0).for_each(|t| *t = Touch::new(springs));
    }
}
