//! Points that push each other apart, each layer at its depth.
//!
//! In every round, points closer than `REACH` repel each other, the more the closer, and what they
//! gained in the rounds before carries them on. Those of a layer then return to its depth.

use rayon::prelude::*;

use super::neighbours::Cells;
use super::seeds::Seeds;
use super::{BETWEEN, LAYERS, Solid};

/// Rounds, and those at the end in which points slow down and the layers below no longer push the
/// first one, so that they do not make it uneven.
const ROUNDS: usize = 60;
const SLOWING: usize = 20;

/// Rounds after the last push, until the layers are at their depths at sharp edges as well.
const LAST_ROUNDS: usize = 6;

/// Points closer than this repel each other (spacings).
const REACH: f64 = 1.5;

/// How far a repulsion of 1 moves a point in a round, and the farthest that points move (spacings).
const STEP: f64 = 0.1;
const FARTHEST: f64 = 0.2;

/// The share of its motion that a point keeps in the next round, and the same while slowing down.
const KEPT: [f64; 2] = [0.8, 0.4];

/// Half the step of the differences that the slope of the depth is taken from (spacings).
const SLOPE_STEP: f64 = 1.0 / 32.0;

/// Where the depth has a smaller slope than this, there is no way down: it is a ridge.
const LEAST_SLOPE: f64 = 0.5;

/// A layer needs this depth below it (spacings). Half a spacing is the whole layer.
const ROOM_BELOW: f64 = 0.4;

/// Steps of half a spacing in search of that depth: at a corner of a box, one along each axis.
const TURNS: usize = 3;

type Point = [f64; 3];

/// Moves the points apart and the layers to their depths.
pub fn relax(solid: &Solid, seeds: &mut Seeds) {
    let h = solid.lattice.spacing;
    let deepest = (LAYERS as f64 + BETWEEN) * h;
    let depths: Vec<f64> = seeds.x.par_iter().map(|x| solid.depth(*x)).collect();
    let depths = &depths;
    let between = |least: f64, most: f64| (0..depths.len()).filter(move |&n| (least..most).contains(&depths[n]));
    // Those that move come first; behind them, those of the lattice that they may touch.
    let moving: Vec<usize> = between(f64::NEG_INFINITY, deepest).collect();
    let resting = between(deepest, deepest + (REACH + 1.0) * h);
    let mut x: Vec<Point> = moving.iter().copied().chain(resting).map(|n| seeds.x[n]).collect();
    let layers: Vec<usize> = moving.iter().map(|&n| seeds.layer[n] as usize).collect();
    let settled = |x: &[Point]| -> Vec<Settled> {
        x.par_iter().zip(&layers).map(|(x, layer)| settle(solid, *x, *layer)).collect()
    };

    let mut motion = vec![[0.0; 3]; moving.len()];
    let mut is_below = vec![false; x.len()];
    for round in 0..ROUNDS {
        let is_slowing = round + SLOWING >= ROUNDS;
        let kept = KEPT[usize::from(is_slowing)];
        let ignores = |n: usize, other: usize| is_slowing && layers[n] == 0 && is_below[other];
        for (n, push) in pushes(&x, moving.len(), h, ignores) {
            motion[n] = limited(std::array::from_fn(|a| kept * motion[n][a] + STEP * h * push[a]), FARTHEST * h);
        }
        let pushed: Vec<Point> = x.iter().zip(&motion).map(|(x, m)| std::array::from_fn(|a| x[a] + m[a])).collect();
        for (n, to) in settled(&pushed).into_iter().enumerate() {
            motion[n] = limited(std::array::from_fn(|a| to.x[a] - x[n][a]), FARTHEST * h);
            (x[n], is_below[n]) = (to.x, to.is_below);
        }
    }
    for _ in 0..LAST_ROUNDS {
        for (n, to) in settled(&x).into_iter().enumerate() {
            x[n] = to.x;
        }
    }
    for (&n, x) in moving.iter().zip(x) {
        seeds.x[n] = x;
    }
}

/// Repulsion of each of the first `moving` points by all others but those that `ignores` names.
fn pushes(x: &[Point], moving: usize, h: f64, ignores: impl Fn(usize, usize) -> bool + Sync) -> Vec<(usize, Point)> {
    let reach = REACH * h;
    Cells::new(x, reach).map(|points, around| {
        let push = |n: usize| {
            let mut push = [0.0; 3];
            for &other in around {
                let r: Point = std::array::from_fn(|a| x[n][a] - x[other as usize][a]);
                let square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
                if square > 0.0 && square < reach * reach && !ignores(n, other as usize) {
                    let u = square.sqrt() / reach;
                    let strength = (1.0 - u) / (u * u * u * reach);
                    push = std::array::from_fn(|a| push[a] + strength * r[a]);
                }
            }
            push
        };
        let moved = points.iter().map(|&n| n as usize).filter(|&n| n < moving);
        moved.map(|n| (n, push(n))).collect::<Vec<_>>()
    })
}

/// Where a point has settled.
struct Settled {
    x: Point,
    /// Whether it is in a layer below the first one.
    is_below: bool,
}

/// The nearest place at the depth of a point's layer; for points below the layers and where the solid
/// is too thin for the layer, the nearest place that is half a spacing deep. Where there is none, the
/// deepest place on the way.
fn settle(solid: &Solid, x: Point, layer: usize) -> Settled {
    let (h, depth) = (solid.lattice.spacing, solid.depth(x));
    let free = |x: Point| Settled { x, is_below: false };
    if layer == LAYERS && depth >= 0.5 * h {
        return free(x);
    }
    let Some(down) = down(solid, x) else { return free(x) };
    let way = |target: f64| ((target - depth) / down.steepness).clamp(-1.5 * h, 1.5 * h);
    if layer < LAYERS && layer > 0 {
        let target = (layer as f64 + 0.5) * h;
        let to = down.after(x, way(target));
        if has_room_below(solid, to, target) {
            return Settled { x: to, is_below: true };
        }
    }
    if depth >= 0.5 * h && layer > 0 {
        return free(x);
    }
    let way = way(0.5 * h);
    if way <= 0.0 {
        return free(down.after(x, way));
    }
    // Beyond a ridge the depth falls as it rose: half of what is missing there is too far.
    let missing = depth + way * down.steepness - solid.depth(down.after(x, way));
    free(down.after(x, way - 0.5 * missing.clamp(0.0, way)))
}

/// Whether the solid is deep enough below a point for the layer at `depth`. The way down turns a few
/// times, as it does at edges.
fn has_room_below(solid: &Solid, mut x: Point, depth: f64) -> bool {
    let h = solid.lattice.spacing;
    (0..TURNS).any(|_| match down(solid, x) {
        Some(down) => {
            x = down.after(x, 0.5 * h);
            solid.depth(x) >= depth + ROOM_BELOW * h
        }
        None => false,
    })
}

/// The way down from a point.
struct Down {
    /// A unit vector.
    direction: Point,
    /// By how much the depth rises along it.
    steepness: f64,
}

impl Down {
    fn after(&self, x: Point, way: f64) -> Point {
        std::array::from_fn(|a| x[a] + way * self.direction[a])
    }
}

/// The way down, by central differences; none on a ridge.
fn down(solid: &Solid, x: Point) -> Option<Down> {
    let step = SLOPE_STEP * solid.lattice.spacing;
    let difference = |a: usize| {
        let (mut ahead, mut behind) = (x, x);
        ahead[a] += step;
        behind[a] -= step;
        (solid.depth(ahead) - solid.depth(behind)) / (2.0 * step)
    };
    let slope: Point = std::array::from_fn(|a| if a < solid.lattice.dimension { difference(a) } else { 0.0 });
    let steepness = slope.iter().map(|s| s * s).sum::<f64>().sqrt();
    (steepness >= LEAST_SLOPE).then(|| Down { direction: slope.map(|s| s / steepness), steepness })
}

fn limited(v: Point, longest: f64) -> Point {
    let length = v.iter().map(|v| v * v).sum::<f64>().sqrt();
    if length > longest { v.map(|v| v * longest / length) } else { v }
}
