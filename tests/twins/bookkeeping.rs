//! Which blocks are active, whose bin a particle is in, who works on what, and which nodes are
//! empty: on the GPU as the host makes it out from the particles, after a frame's start and after
//! each of some steps, on random states. Planted errors are caught.
//!
//! Where particles are comes from the CPU engine in f64.

mod checks;

use gridfall_core::sim::setup::{Precision, Problem, Setup};
use gridfall_engine::explicit::cpu::stages;
use gridfall_engine::explicit::gpu::layout::{BLOCK_NODES, Groups, NODE_CHANNELS, WORK_MAX};
use gridfall_engine::explicit::gpu::{Bookkeeping, Staged};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::common;
use checks::{CHECKS, FOLD, Moment};

const DT_S: f64 = 2e-3;
const DX: f64 = 0.0625;

/// `cells` along each axis, some of them periodic; bodies of soft matter, each a box of cells.
fn scene(kernel: &str, boundary: &str, cells: [u32; 3], per_cell: u32, boxes: &[[[u32; 3]; 2]]) -> Problem {
    let metres = |cells: [u32; 3]| cells.map(|n| f64::from(n) * DX);
    let body = |(k, [min, max]): (usize, &[[u32; 3]; 2])| {
        let (min, max) = (metres(*min), metres(*max));
        format!(
            r#"{{ "name": "b{k}", "material": "jelly", "sampling": "jittered", "particles_per_cell": {per_cell},
                  "shape": {{ "box": {{ "min": {min:?}, "max": {max:?} }} }} }}"#
        )
    };
    let bodies: Vec<String> = boxes.iter().enumerate().map(body).collect();
    let mut problem = common::problem(&format!(
        r#"{{ "gridfall": 1, "name": "blocks",
        "domain": {{ "min": [0, 0, 0], "max": {:?}, "dx": {DX}, "boundary": {{ {boundary} }} }},
        "gravity": [0, 0, -1],
        "materials": {{ "jelly": {{ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 100,
            "poissons_ratio": 0.3 }} }},
        "bodies": [ {} ],
        "time": {{ "end": 1 }}, "solver": {{ "kernel": "{kernel}" }} }}"#,
        metres(cells),
        bodies.join(", ")
    ));
    problem.setup.cfl = 1.0;
    problem
}

fn say(name: &str, kernel: &str, seed: u64) -> ChaCha8Rng {
    println!("{name} {kernel} seed {seed}");
    ChaCha8Rng::seed_from_u64(seed)
}

/// Bodies that go up to 0.7 cells a step without meeting, one of them on the floor, around two
/// periodic axes of which one is two blocks long.
fn flock(kernel: &str, seed: u64) -> Problem {
    let mut rng = say("flock", kernel, seed);
    let boxes = [[[1, 0, 8], [6, 4, 13]], [[11, 3, 0], [16, 8, 4]], [[21, 2, 9], [26, 5, 14]]];
    let axes = r#""x": "periodic", "y": "periodic", "z-": { "contact": "slip" }"#;
    let mut problem = scene(kernel, axes, [32, 8, 24], 8, &boxes);
    common::randomise(&mut problem, &mut rng);
    let fastest = [0.35, 0.7, 0.7].map(|cells| cells * DX / DT_S);
    let mut drifts: [[f64; 3]; 3] =
        [0; 3].map(|_| fastest.map(|v| v * rng.random_range(0.8..1.0) * if rng.random() { 1.0 } else { -1.0 }));
    drifts[1][2] = 0.0;
    let p = &mut problem.particles;
    for id in 0..p.len() {
        let drift = drifts[p.body[id] as usize];
        (0..3).for_each(|a| p.v[id][a] += drift[a]);
    }
    problem
}

/// Particles three blocks from each other, each with its own 27: more blocks than a dispatch has
/// along x.
fn dust(kernel: &str, seed: u64) -> Problem {
    let mut rng = say("dust", kernel, seed);
    let axes = r#""x": "periodic", "y": "periodic", "z": "periodic""#;
    let mut problem = scene(kernel, axes, [144; 3], 1, &[[[0; 3], [12; 3]]]);
    let p = &mut problem.particles;
    assert_eq!(p.len(), 12 * 12 * 12);
    for id in 0..p.len() {
        let place = [id % 12, id / 12 % 12, id / 144];
        p.x[id] = std::array::from_fn(|a| DX * (12.0 * place[a] as f64 + 4.5 + rng.random_range(0.0..3.9)));
        p.v[id] = std::array::from_fn(|_| rng.random_range(-0.9..0.9) * DX / DT_S);
    }
    problem
}

/// One body, so dense that a block has more particles than a workgroup takes.
fn crowd(kernel: &str, seed: u64) -> Problem {
    let mut rng = say("crowd", kernel, seed);
    let mut problem = scene(kernel, "", [16; 3], 27, &[[[5; 3], [10; 3]]]);
    common::randomise(&mut problem, &mut rng);
    problem.particles.x.iter_mut().for_each(|x| *x = [0; 3].map(|_| DX * rng.random_range(4.0..9.0)));
    problem
}

/// A frame's start, and what follows from some steps.
fn history(problem: &Problem, steps: usize) -> Vec<Moment> {
    let setup = Setup { precision: Precision::F64, ..problem.setup.clone() };
    let mut cpu = stages(&setup, problem.particles.clone());
    cpu.start_frame();
    let mut engine = common::gpu_engine(problem);
    let (mut gpu, _) = Staged::p2g(&mut engine, DT_S).unwrap();
    let mut moments = vec![Moment { books: gpu.bookkeeping().unwrap(), x: cpu.particles().x }];
    for k in 0..steps {
        gpu.g2p2g().unwrap();
        cpu.p2g(DT_S);
        cpu.grid_update(DT_S, k as f64 * DT_S, DT_S);
        cpu.g2p(DT_S);
        cpu.bin();
        moments.push(Moment { books: gpu.bookkeeping().unwrap(), x: cpu.particles().x });
    }
    moments
}

/// Checks a scene's moments, each after all before it.
fn checked(problem: &Problem, steps: usize) -> Vec<Moment> {
    let moments = history(problem, steps);
    for k in 0..moments.len() {
        for (name, check) in CHECKS {
            check(&problem.setup, &moments[..=k]).unwrap_or_else(|fault| panic!("after {k} steps, {name}: {fault}"));
        }
    }
    moments
}

/// The moments up to the first that has left a block behind which was active two steps before, and
/// that block.
fn parting(moments: &[Moment]) -> (&[Moment], usize) {
    let left = |k: &usize| {
        let [then, now] = [k - 2, *k].map(|k| &moments[k].books.blocks.list);
        then.iter().find(|block| !now.contains(block)).map(|&block| (&moments[..=*k], block as usize))
    };
    (2..moments.len()).find_map(|k| left(&k)).expect("some block is left, so that its entry goes stale")
}

#[test]
fn blocks_and_bins_follow_the_particles() {
    for (kernel, seed) in [("compact", 51), ("quadratic", 52)] {
        let moments = checked(&flock(kernel, seed), 6);
        println!("block {} is left", parting(&moments).1);
    }
}

#[test]
fn a_crowded_block_is_shared_out() {
    for (kernel, seed) in [("compact", 53), ("quadratic", 54)] {
        let moments = checked(&crowd(kernel, seed), 2);
        assert!(moments.iter().all(|m| m.books.work.iter().any(|item| item.count as usize == WORK_MAX)));
    }
}

#[test]
fn more_blocks_than_a_dispatch_is_wide() {
    let moments = checked(&dust("quadratic", 55), 2);
    assert!(moments.iter().all(|m| m.books.blocks.list.len() as u32 > FOLD));
}

/// A particle of another block than the first one's.
fn stranger(books: &Bookkeeping) -> usize {
    let slots = &books.destinations;
    (1..slots.len()).find(|&k| slots[k][0] != slots[0][0]).expect("two blocks hold particles")
}

/// Makes every check look at what it must not pass.
#[test]
fn planted_errors_are_caught() {
    let flown = flock("compact", 57);
    let journey = checked(&flown, 6);
    let (journey, gone) = parting(&journey);
    let packed = crowd("compact", 56);
    let press = checked(&packed, 2);
    type Plant<'a> = &'a dyn Fn(&mut Moment);
    let planted: [(&str, &str, Plant); 24] = [
        ("counts", "a workgroup too few", &|m| m.books.dispatches[Groups::Work as usize][0] -= 1),
        ("counts", "a dispatch of the step before", &|m| m.books.dispatches[Groups::Blocks as usize][0] += 1),
        ("counts", "a halt", &|m| m.books.report.halt = 2),
        ("counts", "a count that goes on", &|m| m.books.report.cursor = 1),
        ("blocks", "a block is missing", &|m| {
            let block = m.books.blocks.list.pop().unwrap();
            m.books.blocks.table[block as usize] = 0;
        }),
        ("blocks", "a block that nobody needs", &|m| {
            m.books.blocks.list.push(gone as u32);
            m.books.blocks.table[gone] = m.books.blocks.list.len() as u32;
        }),
        ("blocks", "a block with two slots", &|m| m.books.blocks.list[1] = m.books.blocks.list[0]),
        ("blocks", "a stale entry of the table", &|m| m.books.blocks.table[gone] = 1),
        ("blocks", "slots exchanged", &|m| m.books.blocks.list.swap(2, 3)),
        ("blocks", "an entry left on the other side", &|m| m.books.blocks_before.table[gone] = 1),
        ("blocks", "a sum left on the other side", &|m| *m.books.grid_before.last_mut().unwrap() = -1),
        ("bins", "a place taken twice", &|m| m.books.destinations[1] = m.books.destinations[0]),
        ("bins", "a place that holds another particle", &|m| m.books.list.swap(7, 8)),
        ("bins", "a particle in two bins", &|m| m.books.positions[3][3] = m.books.positions[4][3]),
        ("bins", "a rank skipped", &|m| m.books.destinations[5][1] += 1),
        ("bins", "a bin off by one", &|m| {
            let slot = m.books.destinations[0][0] as usize;
            m.books.bins[slot] += 1;
        }),
        ("places", "two particles in each other's bins", &|m| {
            let other = stranger(&m.books);
            m.books.positions.swap(0, other);
        }),
        ("places", "a particle a thousandth of a cell away", &|m| m.x[9][1] += 1e-3 * DX),
        ("work", "an item is missing", &|m| m.books.work.truncate(1)),
        ("work", "items overlap", &|m| m.books.work[1].start -= 1),
        ("work", "an item for another block", &|m| m.books.work[0].block += 1),
        ("work", "an item that goes on in the next bin", &|m| m.books.work[0].count += 1),
        ("grid", "a node not cleared", &|m| *m.books.grid.iter_mut().find(|value| **value == 0).unwrap() = 1),
        ("grid", "a sum not cleared", &|m| {
            // Of the masses, which come first of the channels of a block's nodes: one that is
            // no speck.
            let is_mass =
                |(at, value): &(usize, &mut i32)| at % (BLOCK_NODES * NODE_CHANNELS) < BLOCK_NODES && **value > 1 << 20;
            *m.books.grid.iter_mut().enumerate().find(is_mass).unwrap().1 *= 2;
        }),
    ];
    let caught = |problem: &Problem, moments: &[Moment], group: &str, name: &str, plant: Plant| {
        let mut wrong = moments.to_vec();
        plant(wrong.last_mut().unwrap());
        let (_, check) = CHECKS.iter().find(|(known, _)| *known == group).expect(group);
        let fault = check(&problem.setup, &wrong).expect_err(name);
        println!("{name}: {fault}");
    };
    for (group, name, plant) in planted {
        caught(&flown, journey, group, name, plant);
    }
    // Two items of one block as one.
    caught(&packed, &press, "work", "an item too long", &|m| {
        let work = &mut m.books.work;
        let full = work.iter().position(|item| item.count as usize == WORK_MAX).unwrap();
        let end = work[full].start + work[full].count;
        let next = work.iter().position(|item| item.start == end).unwrap();
        work[full].count += work[next].count;
        work.remove(next);
    });
}
