//! Bodies that will stick to each other, because they are close and neither has contact of its own.

use std::collections::HashMap;

use gridfall_core::sim::notice::Notice;
use gridfall_core::sim::pair;
use gridfall_core::sim::setup::{Body, Problem};
use gridfall_core::sim::volume;

/// Solid bodies without contact of their own that begin within a cell of each other, one notice a body.
/// Across the seam of a periodic axis nothing is looked for.
pub(super) fn sticking(problem: &Problem) -> Vec<Notice> {
    let setup = &problem.setup;
    let solid = |body: &Body| volume::relaxation(setup, body).is_none() && pair::own(body).is_none();
    let bodies: Vec<(usize, &Body)> = setup.bodies.iter().enumerate().filter(|(_, body)| solid(body)).collect();
    let bounds: Vec<Bounds> = bodies.iter().map(|(_, body)| Bounds::of(problem, body)).collect();
    let mut notices = Vec::new();
    for ((k, &(n, body)), earlier) in bodies.iter().enumerate().zip(earlier_near(&bounds)) {
        let near = |&other: &usize| meet(problem, [body, bodies[other].1], [&bounds[k], &bounds[other]]);
        let names: Vec<String> =
            earlier.into_iter().filter(near).map(|other| format!("'{}'", bodies[other].1.name)).collect();
        if !names.is_empty() {
            let names = names.join(", ");
            notices.push(Notice {
                pointer: format!("/bodies/{n}"),
                code: "bodies_stick".into(),
                reason: format!(
                    "'{}' begins within a cell of {names}, and they will stick where they touch",
                    body.name
                ),
                remedy: "if they should slide or part, give one of each two `\"contact\": \"separate\"`".into(),
            });
        }
    }
    notices
}

/// For each body those before it, ascending, whose surroundings meet its own: a sweep along the axis
/// on which the bodies are spread most.
fn earlier_near(bounds: &[Bounds]) -> Vec<Vec<usize>> {
    let spread = |a: usize| {
        let lower = bounds.iter().map(|b| b.lower[a]);
        lower.clone().fold(f64::NEG_INFINITY, f64::max) - lower.fold(f64::INFINITY, f64::min)
    };
    let axis = (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
    let mut order: Vec<usize> = (0..bounds.len()).collect();
    order.sort_by(|&a, &b| bounds[a].start(axis).total_cmp(&bounds[b].start(axis)));
    let (mut found, mut open) = (vec![Vec::new(); bounds.len()], Vec::<usize>::new());
    for k in order {
        open.retain(|&other| bounds[other].end(axis) >= bounds[k].start(axis));
        for &other in &open {
            if bounds[k].meets(&bounds[other], bounds[k].reach + bounds[other].reach) {
                found[k.max(other)].push(k.min(other));
            }
        }
        open.push(k);
    }
    found.iter_mut().for_each(|others| others.sort_unstable());
    found
}

struct Bounds {
    lower: [f64; 3],
    upper: [f64; 3],
    /// Half of a cell, and half the spacing of the particles: where the reaches of two bodies meet,
    /// their surfaces are within a cell.
    reach: f64,
}

impl Bounds {
    fn of(problem: &Problem, body: &Body) -> Self {
        let x = &problem.particles.x[body.particles.clone()];
        let fold = |start: f64, best: fn(f64, f64) -> f64| -> [f64; 3] {
            std::array::from_fn(|a| x.iter().map(|x| x[a]).fold(start, best))
        };
        let spacing = body.volume0.powf(1.0 / problem.setup.dimension as f64);
        Self {
            lower: fold(f64::INFINITY, f64::min),
            upper: fold(f64::NEG_INFINITY, f64::max),
            reach: 0.5 * (problem.setup.dx + spacing),
        }
    }

    fn start(&self, axis: usize) -> f64 {
        self.lower[axis] - self.reach
    }

    fn end(&self, axis: usize) -> f64 {
        self.upper[axis] + self.reach
    }

    fn has(&self, x: &[f64; 3], within: f64) -> bool {
        (0..3).all(|a| x[a] >= self.lower[a] - within && x[a] <= self.upper[a] + within)
    }

    fn meets(&self, other: &Self, within: f64) -> bool {
        (0..3).all(|a| self.lower[a] - within <= other.upper[a] && other.lower[a] - within <= self.upper[a])
    }
}

/// Whether the surfaces of two bodies, half a spacing beyond their particles, are within a cell of each other.
fn meet(problem: &Problem, bodies: [&Body; 2], bounds: [&Bounds; 2]) -> bool {
    let within = bounds[0].reach + bounds[1].reach;
    let of = |body: &Body| problem.particles.x[body.particles.clone()].iter();
    let cell = |x: &[f64; 3]| x.map(|x| (x / within).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<[f64; 3]>> = HashMap::new();
    of(bodies[0]).filter(|x| bounds[1].has(x, within)).for_each(|x| cells.entry(cell(x)).or_default().push(*x));
    let close = |x: &[f64; 3], y: &[f64; 3]| (0..3).map(|a| (x[a] - y[a]).powi(2)).sum::<f64>() <= within * within;
    let mut others = of(bodies[1]).filter(|x| bounds[0].has(x, within));
    others.any(|x| {
        let home = cell(x);
        (0..27).any(|k| {
            let there = std::array::from_fn(|a| home[a] + [k % 3, k / 3 % 3, k / 9][a] - 1);
            cells.get(&there).is_some_and(|found| found.iter().any(|y| close(x, y)))
        })
    })
}
