//! Sources: shapes that emit a stream of particles between two times.
//!
//! The stream is a lattice that moves with the source's velocity v: the lattice point that is at X
//! at time 0 is at X + v t. A point that enters the shape during a frame is emitted at the frame's
//! start, at its position at that time, upstream of the shape. Without gravity the stream is
//! regular and has no gaps at frame boundaries. The emitted particles follow from the scene alone,
//! and the mass that has entered through a face of area A grows as ρ A v t. Points that are inside
//! the shape when the source opens are not emitted.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use rayon::prelude::*;

use super::collider::Sdf;

/// Points this close to the surface (in spacings) count as on it.
const TIE: f64 = 1e-9;
/// Steps along a ray. Rays that graze a surface for longer count as missing it.
const MAX_MARCH: usize = 256;

/// How many distances were asked for, and after how many the search for points is abandoned.
#[derive(Debug)]
pub struct Effort {
    pub spent: AtomicU64,
    pub most: u64,
}

impl Effort {
    pub fn at_most(most: u64) -> Self {
        Self { spent: AtomicU64::new(0), most }
    }

    pub fn unlimited() -> Self {
        Self::at_most(u64::MAX)
    }

    pub fn is_over(&self) -> bool {
        self.spent.load(Relaxed) > self.most
    }
}

/// Distances that following a point until it enters is counted as.
const ENTRY_EFFORT: u64 = 8;

/// A source, ready to emit.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Index of its body in [`crate::sim::setup::Setup::bodies`].
    pub body: usize,
    /// The shape; it is bounded.
    pub sdf: Sdf,
    /// Not zero (m/s).
    pub velocity: [f64; 3],
    /// The source emits what enters its shape from the first time up to the second (s).
    pub open_s: [f64; 2],
    /// Spacing of the lattice (m).
    pub spacing: f64,
    /// A corner of a lattice cell at time 0 (m).
    pub origin: [f64; 3],
    pub dimension: usize,
    pub frame_s: f64,
    /// Number of particles emitted at the start of each frame; zero after the last entry.
    pub by_frame: Vec<u64>,
}

impl Source {
    /// Number of particles emitted during the whole run.
    pub fn total(&self) -> u64 {
        self.by_frame.iter().sum()
    }

    /// Number of lattice points to test for a frame (frame 0 begins at time 0).
    pub fn candidates(&self, frame: u32) -> f64 {
        self.range(frame).iter().map(|r| (r.end - r.start) as f64).product()
    }

    /// Positions at which particles are emitted at the start of a frame (m), in the order of their
    /// ids.
    pub fn entering(&self, frame: u32) -> impl ParallelIterator<Item = [f64; 3]> + '_ {
        self.entering_within(frame, None)
    }

    /// [`Self::entering`], or only some of it once the effort is over.
    pub fn entering_within<'a>(
        &'a self,
        frame: u32,
        effort: Option<&'a Effort>,
    ) -> impl ParallelIterator<Item = [f64; 3]> + 'a {
        let [start, end] = self.window(frame);
        let [first, second, third] = self.range(frame);
        let reach = self.speed() * (end - start) + TIE * self.spacing;
        first.into_par_iter().flat_map_iter(move |i| {
            // Rows run along the last axis.
            let (rows, along) =
                if self.dimension == 2 { (0..1, second.clone()) } else { (second.clone(), third.clone()) };
            rows.flat_map(move |j| {
                let index = move |k| if self.dimension == 2 { [i, k, 0] } else { [i, j, k] };
                let mut next = along.start;
                let end_of_row = along.end;
                std::iter::from_fn(move || {
                    while next < end_of_row && effort.is_none_or(|effort| !effort.is_over()) {
                        let index = index(next);
                        let x = self.at(index, start);
                        let distance = self.sdf.distance(x);
                        next += 1 + self.skipped(distance, start, reach);
                        if let Some(effort) = effort {
                            effort.spent.fetch_add(if distance <= reach { ENTRY_EFFORT } else { 1 }, Relaxed);
                        }
                        // One evaluation settles most points: they are too far away.
                        if distance <= reach
                            && let Some(entry) = self.entry(index)
                            && entry >= start
                            && entry < end
                        {
                            return Some(x);
                        }
                    }
                    None
                })
            })
        })
    }

    /// How many of the next points of a row cannot enter in a frame that begins at `start`, because
    /// this one is so far outside the shape, or so deep inside: what is inside then has entered
    /// before.
    fn skipped(&self, distance: f64, start: f64, reach: f64) -> i64 {
        let slack = self.sdf.slack();
        let spare = if distance > 0.0 {
            distance - reach - slack
        } else if start >= self.open_s[0] {
            -distance - slack - TIE * self.spacing
        } else {
            0.0
        };
        // A little less, so that rounding does not matter.
        (spare / self.spacing * (1.0 - 1e-9) - 1e-6).floor().max(0.0) as i64
    }

    /// Start and end of a frame (s).
    fn window(&self, frame: u32) -> [f64; 2] {
        [frame, frame + 1].map(|n| f64::from(n) * self.frame_s)
    }

    fn speed(&self) -> f64 {
        self.velocity.iter().map(|v| v * v).sum::<f64>().sqrt()
    }

    /// Position of a lattice point at a time.
    fn at(&self, index: [i64; 3], t: f64) -> [f64; 3] {
        std::array::from_fn(|a| {
            if a >= self.dimension {
                return 0.0;
            }
            self.origin[a] + (index[a] as f64 + 0.5) * self.spacing + self.velocity[a] * t
        })
    }

    /// Indices of the points inside the shape's bounds, and of those that may get there within the
    /// frame.
    fn range(&self, frame: u32) -> [Range<i64>; 3] {
        let [start, end] = self.window(frame);
        if end <= self.open_s[0] || start >= self.open_s[1] {
            return [0..0, 0..0, 0..0];
        }
        let [lower, upper] = self.sdf.bounds();
        std::array::from_fn(|a| {
            if a >= self.dimension {
                return 0..1;
            }
            let v = self.velocity[a];
            let way = v * (end - start);
            let index = |x: f64| (x - self.origin[a] - v * start) / self.spacing;
            let (low, high) = (index(lower[a] - way.max(0.0)), index(upper[a] - way.min(0.0)));
            low.floor() as i64 - 1..high.ceil() as i64 + 1
        })
    }

    /// When a lattice point first enters the open shape (s), by sphere tracing (Hart 1996). The
    /// result is the same for every frame that asks.
    fn entry(&self, index: [i64; 3]) -> Option<f64> {
        let tie = TIE * self.spacing;
        let start = self.at(index, 0.0);
        let [lower, upper] = self.sdf.bounds();
        let [mut near, mut far] = self.open_s;
        for a in 0..self.dimension {
            let v = self.velocity[a];
            if v == 0.0 {
                if start[a] < lower[a] || start[a] > upper[a] {
                    return None;
                }
                continue;
            }
            let (one, other) = ((lower[a] - start[a]) / v, (upper[a] - start[a]) / v);
            near = near.max(one.min(other));
            far = far.min(one.max(other));
        }
        let speed = self.speed();
        if near == self.open_s[0] && self.sdf.distance(self.at(index, near)) < -tie {
            return None;
        }
        let mut t = near;
        for _ in 0..MAX_MARCH {
            if t >= far {
                return None;
            }
            let distance = self.sdf.distance(self.at(index, t));
            if distance <= tie {
                return Some(t);
            }
            t += distance / speed;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::collider::{Primitive, SdfOp};
    use crate::sim::particles::IDENTITY;

    fn source(primitive: Primitive, velocity: [f64; 3], open_s: [f64; 2]) -> Source {
        let sdf = Sdf { ops: vec![SdfOp::Primitive { primitive, rotation: IDENTITY, translation: [0.5, 0.4, 0.3] }] };
        let (spacing, origin, frame_s) = (0.02, [0.0; 3], 1.0 / 48.0);
        Source { body: 0, sdf, velocity, open_s, spacing, origin, dimension: 3, frame_s, by_frame: vec![] }
    }

    fn emitted(source: &Source, frames: u32) -> Vec<Vec<[f64; 3]>> {
        (0..frames).map(|frame| source.entering(frame).collect()).collect()
    }

    #[test]
    fn a_face_lets_through_area_times_speed_times_time() {
        let source = source(Primitive::Box([0.1, 0.1, 0.04]), [0.0, 0.0, -1.5], [0.0, 0.5]);
        let all: usize = emitted(&source, 48).iter().map(Vec::len).sum();
        // 10 × 10 points every 0.02 m of 0.75 m: 37.5 layers.
        assert!(all == 3700 || all == 3800, "{all}");
    }

    #[test]
    fn points_that_are_passed_over_do_not_enter() {
        let shapes = [Primitive::Box([0.13, 0.11, 0.2]), Primitive::Sphere(0.15), Primitive::Torus(0.12, 0.05)];
        for (primitive, dimension) in shapes.into_iter().flat_map(|shape| [(shape.clone(), 2), (shape, 3)]) {
            for velocity in [[0.0, -1.5, 0.0], [0.7, -0.3, 1.1], [1e-4, 0.0, 0.0]] {
                let mut source = source(primitive.clone(), velocity, [0.03, 0.15]);
                source.dimension = dimension;
                if dimension == 2 {
                    source.velocity[2] = 0.0;
                }
                for frame in 0..8 {
                    let [start, end] = source.window(frame);
                    let [first, second, third] = source.range(frame);
                    let plain = first.flat_map(|i| {
                        let third = third.clone();
                        second.clone().flat_map(move |j| third.clone().map(move |k| [i, j, k]))
                    });
                    let enters = |index: &[i64; 3]| source.entry(*index).is_some_and(|t| t >= start && t < end);
                    let plain: Vec<[f64; 3]> = plain.filter(enters).map(|index| source.at(index, start)).collect();
                    assert_eq!(source.entering(frame).collect::<Vec<_>>(), plain, "{velocity:?} {dimension} {frame}");
                }
            }
        }
    }

    #[test]
    fn the_stream_is_one_lattice_without_gaps_or_doubles() {
        for velocity in [[0.0, 0.0, -1.5], [0.7, -0.3, 1.1], [3.0, 0.0, 0.0]] {
            let source = source(Primitive::Sphere(0.12), velocity, [0.1, 0.61]);
            let mut indices = Vec::new();
            for (frame, points) in emitted(&source, 48).iter().enumerate() {
                let t = frame as f64 * source.frame_s;
                for x in points {
                    let index: [f64; 3] = std::array::from_fn(|a| (x[a] - velocity[a] * t) / source.spacing - 0.5);
                    assert!(index.iter().all(|i| (i - i.round()).abs() < 1e-9), "off the lattice: {index:?}");
                    indices.push(index.map(|i| i.round() as i64));
                    assert!(source.sdf.distance(*x) > -1e-9 || t < source.open_s[0], "put in inside the shape");
                }
            }
            let count = indices.len();
            indices.sort_unstable();
            indices.dedup();
            assert_eq!(indices.len(), count, "a point was emitted twice");
            let speed = source.speed();
            let expected = std::f64::consts::PI * 0.12f64.powi(2) * speed * 0.51 / source.spacing.powi(3);
            println!("{velocity:?}: {count} points, expected {expected:.0}");
            assert!((count as f64 / expected - 1.0).abs() < 0.04);
        }
    }
}
