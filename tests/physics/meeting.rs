//! Bodies with contact of their own: they slide on others, part from them, and rest on them.

use crate::problems::*;
use gridfall_core::sim::diagnostics::Row;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Contact, ContactKind, Problem};
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, FrameStats, NoControl};
use gridfall_scene::schema::{Kernel, Transfer};

const DX: f64 = 1.0 / 32.0;
const G: f64 = 9.81;
const KERNELS: [Kernel; 3] = [Kernel::Compact, Kernel::Quadratic, Kernel::Cubic];

fn separate(friction: f64) -> Option<Contact> {
    Some(Contact { kind: ContactKind::Separate, friction })
}

/// A box of cells, from `min` to `max` (dx); all of the third axis in 2D.
fn cells(min: Vec3, max: Vec3) -> impl Fn(Vec3) -> bool {
    in_box(min.map(|x| x * DX), max.map(|x| x * DX))
}

fn frames(problem: &Problem, count: usize, mut each: impl FnMut(&Particles, &FrameStats)) {
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    for _ in 0..count {
        let stats = engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap();
        each(&engine.snapshot().unwrap(), &stats);
    }
}

fn part(problem: &Problem, body: usize) -> std::ops::Range<usize> {
    problem.setup.bodies[body].particles.clone()
}

/// Σ m v of a body.
fn momentum_of(problem: &Problem, p: &Particles, body: usize) -> Vec3 {
    let mut total = [0.0; 3];
    for i in part(problem, body) {
        (0..3).for_each(|a| total[a] += mass(problem, p, i) * p.v[i][a]);
    }
    total
}

/// Two blocks that touch, away from all walls; the upper one is body 1.
fn touching(dimension: usize, kernel: Kernel, transfer: Transfer) -> Problem {
    let mut problem = empty(dimension, [16.0, 20.0, if dimension == 3 { 16.0 } else { 1.0 }], DX);
    (problem.setup.kernel, problem.setup.transfer) = (kernel, transfer);
    let deep = if dimension == 3 { [5.0, 11.0] } else { [0.0, 0.0] };
    for (low, v) in [(6.0, -0.4), (10.0, 0.4)] {
        let block = cells([5.0, low, deep[0]], [11.0, low + 4.0, deep[1]]);
        fill(&mut problem, elastic(1e5, 0.3, 1000.0), 2, block, uniform([0.1, v, 0.0]));
    }
    problem
}

#[test]
fn to_part_takes_no_force() {
    for dimension in [2, 3] {
        for kernel in KERNELS {
            for transfer in [Transfer::Pic, Transfer::Apic, Transfer::Mls] {
                let mut problem = touching(dimension, kernel, transfer);
                let lost = |problem: &Problem| {
                    let (p, _) = run(problem, 2);
                    let [before, after] = [&problem.particles, &p].map(|p| momentum_of(problem, p, 1)[1]);
                    1.0 - after / before
                };
                let stuck = lost(&problem);
                problem.setup.bodies[1].contact = separate(0.4);
                let freed = lost(&problem);
                println!("{dimension}D {kernel:?} {transfer:?}: stuck {stuck:.3}, freed {freed:.1e}");
                assert!(freed.abs() < 1e-12, "{dimension}D {kernel:?} {transfer:?}: lost {freed:e}");
                assert!(stuck > 0.3, "without contact they stick: {stuck}");
            }
        }
    }
}

/// Acceleration of a block along a layer below it, under gravity tilted by `slope`.
fn slides(dimension: usize, kernel: Kernel, slope: f64, friction: f64, layer_on_top: bool) -> f64 {
    let deep: f64 = if dimension == 3 { 4.0 } else { 0.0 };
    let mut problem = empty(dimension, [44.0, 14.0, deep.max(1.0)], DX);
    problem.setup.kernel = kernel;
    problem.setup.gravity = [G * slope.sin(), -G * slope.cos(), 0.0];
    problem.setup.axes[1] = walls(ContactKind::Sticky);
    let layer = cells([0.0, 0.0, 0.0], [44.0, 4.0, deep]);
    let block = cells([6.0, 4.0, 0.0], [14.0, 8.0, deep]);
    fill(&mut problem, elastic(2e6, 0.3, 1000.0), 2, layer, uniform([0.0; 3]));
    fill(&mut problem, elastic(1e6, 0.3, 1000.0), 2, block, uniform([0.0; 3]));
    problem.setup.bodies[usize::from(!layer_on_top)].contact = separate(friction);
    let mut way = Vec::new();
    frames(&problem, 24, |p, _| way.push(centre(p, part(&problem, 1))[0]));
    // From the second half, after the block has settled: x = x0 + v t + ½ a t².
    let h = 8.0 * problem.setup.frame_s;
    (way[23] - 2.0 * way[15] + way[7]) / (h * h)
}

const SCHEMES: [(usize, Kernel); 4] =
    [(2, Kernel::Compact), (2, Kernel::Quadratic), (2, Kernel::Cubic), (3, Kernel::Compact)];

#[test]
fn a_block_slides_on_a_layer_with_coulomb_friction() {
    let slope = 24f64.to_radians();
    for (dimension, kernel) in SCHEMES {
        for degrees in [0f64, 15.0] {
            let friction = degrees.to_radians().tan();
            let exact = G * (slope.sin() - friction * slope.cos());
            for layer in [false, true] {
                let a = slides(dimension, kernel, slope, friction, layer);
                let off = 100.0 * (a / exact - 1.0);
                println!("{dimension}D {kernel:?} {degrees}°: {a:.4} m/s², exact {exact:.4} ({off:+.2} %)");
                assert!(off.abs() < 5.0, "{dimension}D {kernel:?} {degrees}°: {a} m/s², exact {exact}");
            }
        }
        // µ > tan θ.
        let a = slides(dimension, kernel, slope, 30f64.to_radians().tan(), false);
        println!("{dimension}D {kernel:?} 30°: {a:.4} m/s²");
        assert!(a.abs() < 0.05, "{dimension}D {kernel:?}: it should stick, and has {a} m/s²");
    }
}

/// Least distance between the surfaces of two bodies, half a spacing beyond their particles (dx).
fn gap(problem: &Problem, p: &Particles) -> f64 {
    let least = part(problem, 1).map(|i| p.x[i][1]).fold(f64::MAX, f64::min);
    let most = part(problem, 0).map(|i| p.x[i][1]).fold(f64::MIN, f64::max);
    (least - most) / DX - 0.5
}

/// A block above a table or a block; `low` is where it begins (dx).
fn above(dimension: usize, kernel: Kernel, table: [f64; 2], low: f64) -> Problem {
    let deep = if dimension == 3 { [4.0, 8.0, 12.0] } else { [0.0, 0.0, 1.0] };
    let mut problem = empty(dimension, [16.0, 20.0, deep[2]], DX);
    problem.setup.kernel = kernel;
    problem.setup.gravity = [0.0, -G, 0.0];
    problem.setup.axes[1] = walls(ContactKind::Sticky);
    let wide = if table == [6.0, 10.0] { deep } else { [0.0, deep[2], 0.0] };
    let table = cells([table[0], 0.0, wide[0]], [table[1], 4.0, wide[1]]);
    let block = cells([6.0, low, deep[0]], [10.0, low + 4.0, deep[1]]);
    fill(&mut problem, elastic(2e5, 0.3, 1000.0), 2, table, uniform([0.0; 3]));
    fill(&mut problem, elastic(2e5, 0.3, 1000.0), 2, block, uniform([0.0; 3]));
    problem.setup.bodies[1].contact = separate(0.3);
    problem
}

#[test]
fn a_stack_rests() {
    for (dimension, kernel) in SCHEMES {
        let problem = above(dimension, kernel, [6.0, 10.0], 4.0);
        let weight: f64 = (0..problem.particles.len()).map(|i| G * mass(&problem, &problem.particles, i)).sum();
        let (mut force, mut side, mut rest, mut n) = (0.0, 0.0f64, 0.0, 0);
        frames(&problem, 96, |p, stats| {
            n += 1;
            if n > 48 {
                force -= stats.reactions[2].force[1] / 48.0;
            }
            let [a, b] = [0, 1].map(|body| centre(p, part(&problem, body)));
            side = side.max((a[0] - b[0]).abs() / DX);
            rest = (b[1] - a[1]) / DX;
        });
        let off = force / weight - 1.0;
        println!("{dimension}D {kernel:?}: reaction {off:+.1e}, sideways {side:.1e} dx, centres {rest:.3} dx apart");
        assert!(off.abs() < 0.01 && side < 0.2 && (rest - 4.0).abs() < 0.5, "{dimension}D {kernel:?}");
    }
}

#[test]
fn a_body_that_was_dropped_does_not_hover() {
    for (dimension, kernel) in SCHEMES {
        for height in [1.0, 2.25, 3.5] {
            let problem = above(dimension, kernel, [2.0, 14.0], 4.0 + height);
            let mut gaps = Vec::new();
            frames(&problem, 72, |p, _| gaps.push(gap(&problem, p)));
            let (least, rest) = (gaps.iter().copied().fold(f64::MAX, f64::min), gaps[71]);
            println!("{dimension}D {kernel:?} from {height}: least {least:.3} dx, at rest {rest:.3} dx");
            assert!(least > -1.0 && rest.abs() < 0.6, "{dimension}D {kernel:?}: {least} dx, {rest} dx");
        }
    }
}

#[test]
fn a_head_on_collision_keeps_momentum_and_gains_no_energy() {
    for (dimension, kernel) in SCHEMES {
        let deep = if dimension == 3 { [5.0, 9.0, 14.0] } else { [0.0, 0.0, 1.0] };
        let mut problem = empty(dimension, [28.0, 14.0, deep[2]], DX);
        problem.setup.kernel = kernel;
        for (low, v) in [(5.75, 0.5), (16.25, -0.5)] {
            let block = cells([low, 4.0, deep[0]], [low + 6.0, 10.0, deep[1]]);
            fill(&mut problem, neo_hookean(1e5, 0.3, 1000.0), 2, block, uniform([v, 0.0, 0.0]));
            problem.setup.bodies.last_mut().unwrap().contact = separate(0.2);
        }
        let energy = |p: &Particles| {
            let row = Row::measure(&problem.setup, p, 0, 0.0, &FrameStats::default());
            row.kinetic_j + row.affine_j + row.strain_j
        };
        let scale = momentum_of(&problem, &problem.particles, 0)[0];
        let (start, mut most, mut off, mut back) = (energy(&problem.particles), 0.0f64, 0.0f64, 0.0);
        let mut kept = 0.0;
        frames(&problem, 20, |p, _| {
            kept = energy(p) / start;
            most = most.max(kept);
            off = off.max(norm(momentum(&problem, p)) / scale);
            back = -momentum_of(&problem, p, 0)[0] / scale;
        });
        println!(
            "{dimension}D {kernel:?}: momentum off {off:.0e}, energy at most {most:.9}, kept {kept:.2}, {back:.2}"
        );
        assert!(off < 1e-13 && most < 1.0 + 1e-9 && back > 0.6, "{dimension}D {kernel:?}");
    }
}
