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
    for (k, &(n, body)) in bodies.iter().enumerate() {
        let near = |&other: &usize| meet(problem, [body, bodies[other].1], [&bounds[k], &bounds[other]]);
        let names: Vec<String> = (0..k).filter(near).map(|other| format!("'{}'", bodies[other].1.name)).collect();
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

struct Bounds {
    lower: [f64; 3],
    upper: [f64; 3],
}

impl Bounds {
    fn of(problem: &Problem, body: &Body) -> Self {
        let x = &problem.particles.x[body.particles.clone()];
        let fold = |start: f64, best: fn(f64, f64) -> f64| -> [f64; 3] {
            std::array::from_fn(|a| x.iter().map(|x| x[a]).fold(start, best))
        };
        Self { lower: fold(f64::INFINITY, f64::min), upper: fold(f64::NEG_INFINITY, f64::max) }
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
    let setup = &problem.setup;
    let spacing = |body: &Body| body.volume0.powf(1.0 / setup.dimension as f64);
    let within = setup.dx + 0.5 * (spacing(bodies[0]) + spacing(bodies[1]));
    if !bounds[0].meets(bounds[1], within) {
        return false;
    }
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
