//! What the books of blocks, bins and work must hold, from where the particles are.

use std::collections::{BTreeMap, BTreeSet};

use gridfall_core::sim::setup::{Axis, Kernel, Setup};
use gridfall_engine::explicit::gpu::Bookkeeping;
use gridfall_engine::explicit::gpu::layout::{BLOCK_NODES, Groups, NODE_CHANNELS, WORK_MAX};

/// What positions on the two engines may differ by (cells).
const NEAR: f64 = 1e-4;
/// Most workgroups along x of a dispatch that is folded.
pub const FOLD: u32 = 32768;

/// The device's books, and where particles are on the CPU (m, by id).
#[derive(Clone)]
pub struct Moment {
    pub books: Bookkeeping,
    pub x: Vec<[f64; 3]>,
}

/// The first fault.
type Verdict = Result<(), String>;
/// Looks at the last moment of a history, which begins with a frame's start.
type Check = fn(&Setup, &[Moment]) -> Verdict;

/// All checks, and what they look at.
pub const CHECKS: [(&str, Check); 6] = [
    ("counts", check_counts),
    ("blocks", check_blocks),
    ("bins", |_, history| homes(history).map(drop)),
    ("places", check_places),
    ("work", check_work),
    ("grid", check_grid),
];

fn last(history: &[Moment]) -> &Moment {
    &history[history.len() - 1]
}

macro_rules! ensure {
    ($holds:expr, $($fault:tt)+) => {{ let holds: bool = $holds; if !holds { return Err(format!($($fault)+)); } }};
}

/// A particle's block, and its offset there (cells).
type Home = (u32, [f32; 3]);

/// Where the bins have the particles, by id. Fault: a particle that is not in exactly one, or bins
/// that do not lie one behind the other.
fn homes(history: &[Moment]) -> Result<Vec<Home>, String> {
    let (books, at_start) = (&last(history).books, history.len() == 1);
    let (live, active) = (books.positions.len(), books.blocks.list.len());
    let mut bins = vec![0; active];
    let mut homes = vec![None; live];
    let mut taken = BTreeSet::new();
    for (particle, &[slot, rank]) in books.destinations.iter().enumerate() {
        let slot = slot as usize;
        ensure!(slot < active, "particle {particle} goes to slot {slot} of {active}");
        let place = (books.bins[slot] + rank) as usize;
        ensure!(place < live && taken.insert(place), "place {place} is taken twice, or beyond the last bin");
        bins[slot] += 1;
        let at = books.list[place] as usize;
        ensure!(at < live, "place {place} holds particle {at} of {live}");
        let [x, y, z, id] = books.positions[at];
        ensure!(particle == if at_start { id as usize } else { at }, "place {place} is not particle {particle}'s");
        ensure!((id as usize) < live && homes[id as usize].is_none(), "particle {id} is in two bins");
        homes[id as usize] = Some((books.blocks.list[slot], [x, y, z].map(f32::from_bits)));
    }
    ensure!(taken.len() == live, "{} places are taken", taken.len());
    let mut starts: Vec<(u32, u32)> = books.bins.iter().zip(bins).map(|(&start, n)| (start, n)).collect();
    starts.retain(|&(_, n)| n > 0);
    starts.sort_unstable();
    let mut sum = 0;
    for (start, n) in starts {
        ensure!(start == sum, "a bin starts at {start} instead of {sum}");
        sum += n;
    }
    Ok(homes.into_iter().map(|home| home.expect("as many places as particles")).collect())
}

/// Blocks as triples.
struct Table<'a>(&'a Bookkeeping);

impl Table<'_> {
    fn corner(&self, block: u32) -> [i64; 3] {
        let [nx, ny, _] = self.0.params.blocks;
        [block % nx, block / nx % ny, block / (nx * ny)].map(i64::from)
    }

    /// Of a block or node that may lie beyond a periodic axis; `size`: of a block.
    fn wrapped(&self, at: [i64; 3], size: i64) -> Option<[i64; 3]> {
        let p = &self.0.params;
        let mut out = at;
        for a in 0..3 {
            let extent = size * i64::from(p.blocks[a]);
            if p.periodic[a] != 0 {
                out[a] = at[a].rem_euclid(extent);
            } else if !(0..extent).contains(&at[a]) {
                return None;
            }
        }
        Some(out)
    }

    fn block(&self, at: [i64; 3]) -> Option<u32> {
        let [nx, ny, _] = self.0.params.blocks.map(i64::from);
        self.wrapped(at, 1).map(|[x, y, z]| ((z * ny + y) * nx + x) as u32)
    }

    /// A block and those beside it.
    fn around(&self, block: u32) -> impl Iterator<Item = u32> + '_ {
        let at = self.corner(block);
        let beside = move |k: i64| std::array::from_fn(|a| at[a] + k / 3i64.pow(a as u32) % 3 - 1);
        (0..27).filter_map(move |k| self.block(beside(k)))
    }
}

/// mark, activate, sweep.
fn check_blocks(_: &Setup, history: &[Moment]) -> Verdict {
    // A step's blocks are those around where the particles were before it.
    let now = &last(history).books;
    let past = &history[..history.len() - 1];
    let held = homes(if past.is_empty() { history } else { past })?;
    let table = Table(now);
    let slots: BTreeMap<u32, usize> = now.blocks.list.iter().copied().zip(1..).collect();
    ensure!(slots.len() == now.blocks.list.len(), "a block has two slots");
    let holding: BTreeSet<u32> = held.iter().map(|home| home.0).collect();
    let expected: BTreeSet<u32> = holding.iter().flat_map(|&block| table.around(block)).collect();
    for (block, &entry) in (0..).zip(&now.blocks.table) {
        let slot = slots.get(&block).copied().unwrap_or_default();
        ensure!(entry as usize == slot, "the table has {entry} for block {block}, the list {slot}");
        ensure!(expected.contains(&block) == (slot > 0), "block {block} is active or not, and should not be so");
    }
    ensure!(now.blocks_before.table.iter().all(|&entry| entry == 0), "the table of the other side is not empty");
    ensure!(now.grid_before.iter().all(|&value| value == 0), "the grid of the other side is not empty");
    Ok(())
}

/// g2p2g, or the upload: every particle in the block where the CPU has it.
fn check_places(setup: &Setup, history: &[Moment]) -> Verdict {
    let (now, homes) = (last(history), homes(history)?);
    let (p, table) = (&now.books.params, Table(&now.books));
    let shift = if setup.kernel == Kernel::Quadratic { 0.5 } else { 0.25 };
    for (id, ((block, offset), x)) in homes.iter().zip(&now.x).enumerate() {
        let corner = table.corner(*block);
        for a in 0..3 {
            ensure!((0.0..4.0).contains(&offset[a]), "particle {id} lies outside its block");
            let here = 4.0 * corner[a] as f64 + f64::from(offset[a]) + shift - f64::from(p.pad[a]);
            let mut apart = here - (x[a] - setup.origin[a]) / setup.dx;
            if setup.axes[a] == Axis::Periodic {
                let around = setup.cells[a] as f64;
                apart -= around * (apart / around).round();
            }
            ensure!(apart.abs() < NEAR, "particle {id} is {apart} cells from where it should be");
        }
    }
    Ok(())
}

/// sweep: every place in the bins in one item.
fn check_work(_: &Setup, history: &[Moment]) -> Verdict {
    let (books, homes) = (&last(history).books, homes(history)?);
    let block_of = |place: usize| homes[books.positions[books.list[place] as usize][3] as usize].0;
    let mut items: Vec<_> = books.work.iter().map(|item| (item.start, item.count, item.block)).collect();
    items.sort_unstable();
    let mut end = 0;
    for &(start, count, block) in &items {
        ensure!(
            start == end && count > 0,
            "a work item covers {start} to {}, the next one is due at {end}",
            start + count
        );
        ensure!(count as usize <= WORK_MAX, "a work item of {count} particles");
        end += count;
        ensure!(end as usize <= homes.len(), "a work item ends at {end}");
        ensure!((start..end).all(|place| block_of(place as usize) == block), "a work item leaves block {block}");
    }
    ensure!(end as usize == homes.len(), "work ends at {end}");
    // No more items than needed.
    let short = items.windows(2).filter(|pair| pair[0].2 == pair[1].2 && (pair[0].1 as usize) < WORK_MAX).count();
    ensure!(short == 0, "{short} items could have been longer");
    Ok(())
}

/// bin, for the next step: counts, and the workgroups that they ask for.
fn check_counts(_: &Setup, history: &[Moment]) -> Verdict {
    let books: Vec<&Bookkeeping> = history.iter().map(|moment| &moment.books).collect();
    let now = books[books.len() - 1];
    let report = &now.report;
    let active = |k: usize| books[k].blocks.list.len() as u32;
    let steps = books.len() - 1;
    ensure!(report.halt == 0 && report.asks == 0 && report.error == 0, "halted: {report:?}");
    ensure!(report.started == 1 && report.ran == 1, "the step was not begun: {report:?}");
    ensure!(report.step as usize == steps, "step {} instead of {steps}", report.step);
    let most = (0..=steps).map(active).max();
    ensure!(Some(report.needed) == most, "{} blocks were needed, {most:?} wanted", report.needed);
    let left = [report.wanted, report.work_count, report.cursor];
    ensure!(left == [0; 3], "counters of the last step are {left:?}");
    ensure!(report.work as usize == now.work.len(), "{} work items instead of {}", report.work, now.work.len());
    for (which, groups) in [(Groups::Work, report.work), (Groups::Blocks, active(steps))] {
        let folded = if groups == 0 { [0; 4] } else { [groups.min(FOLD), groups.div_ceil(FOLD), 1, 0] };
        ensure!(now.dispatches[which as usize] == folded, "{which:?}: {groups} workgroups are not {folded:?}");
    }
    Ok(())
}

/// Nodes that a particle touches on a grid, relative to its block.
fn touched(kernel: Kernel, grid: usize, offset: [f32; 3]) -> impl Iterator<Item = [i64; 3]> {
    let across = if kernel == Kernel::Quadratic { 3 } else { 2 };
    let first = offset.map(|y| (y + 0.5 * grid as f32).floor() as i64);
    (0..across * across * across)
        .map(move |k: i64| std::array::from_fn(|a| first[a] + k / across.pow(a as u32) % across))
}

/// sweep: nodes that no particle touches are empty, and all mass on the others is the particles'.
fn check_grid(setup: &Setup, history: &[Moment]) -> Verdict {
    let (books, homes) = (&last(history).books, homes(history)?);
    let table = Table(books);
    let grids = if setup.kernel == Kernel::Quadratic { 1 } else { 2 };
    let mut reached = vec![false; books.blocks.list.len() * grids * BLOCK_NODES];
    for (block, offset) in homes {
        for (grid, n) in (0..grids).flat_map(|grid| touched(setup.kernel, grid, offset).map(move |n| (grid, n))) {
            let corner = table.corner(block);
            let at = table.wrapped(std::array::from_fn(|a| 4 * corner[a] + n[a]), 4).expect("nodes of active blocks");
            let block = table.block(at.map(|i| i / 4)).expect("in the table");
            let slot = books.blocks.table[block as usize] as usize - 1;
            let [x, y, z] = at.map(|i| (i % 4) as usize);
            reached[(slot * grids + grid) * BLOCK_NODES + x + 4 * y + 16 * z] = true;
        }
    }
    let mut mass = vec![0.0; grids];
    for (k, values) in books.grid.chunks_exact(BLOCK_NODES * NODE_CHANNELS).enumerate() {
        for node in 0..BLOCK_NODES {
            let empty = (0..NODE_CHANNELS).all(|c| values[c * BLOCK_NODES + node] == 0);
            ensure!(reached[k * BLOCK_NODES + node] || empty, "a node that nothing touches is not empty");
            mass[k % grids] += f64::from(values[node]);
        }
    }
    let whole: f64 = setup.bodies.iter().map(|b| b.mass * b.particles.len() as f64).sum();
    for mass in mass {
        let share = mass / (whole * f64::from(books.params.mass_scale));
        ensure!((share - 1.0).abs() < 1e-6, "a grid has {share} of the mass");
    }
    Ok(())
}
