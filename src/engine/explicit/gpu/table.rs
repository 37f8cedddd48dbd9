//! The table of active blocks (`wgsl/explicit/table.wgsl`): its size, and the table itself as the host makes it.

use super::layout::TABLE_PROBES;

/// log2 of the entries for so many slots. At least half of the entries stay free, so that free ones are near.
fn bits(capacity: usize) -> u32 {
    (2 * capacity.max(8)).next_power_of_two().ilog2()
}

/// Entries, each a block + 1 (0: none) and its slot + 1.
pub fn entries(capacity: usize) -> usize {
    1 << bits(capacity)
}

/// `table_shift` of the shaders' parameters.
pub fn shift(capacity: usize) -> u32 {
    32 - bits(capacity)
}

/// Where a block is looked for, in this order.
fn places(block: u32, shift: u32) -> impl Iterator<Item = usize> {
    let first = block.wrapping_mul(0x9e37_79b9) >> shift;
    (0..TABLE_PROBES).map(move |k| (first.wrapping_add(k) & (u32::MAX >> shift)) as usize)
}

/// The table of blocks by slot. `None` if it is too crowded for one of them.
pub fn of_blocks(blocks: &[u32], capacity: usize) -> Option<Vec<[u32; 2]>> {
    let mut table = vec![[0; 2]; entries(capacity)];
    for (slot, &block) in (1..).zip(blocks) {
        let free = places(block, shift(capacity)).find(|&k| table[k][0] == 0)?;
        table[free] = [block + 1, slot];
    }
    Some(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Balls and sheets of blocks, in domains whose sides are powers of two or not, are found again, soon.
    #[test]
    fn blocks_are_near_where_their_hash_points() {
        for (n, label) in [([512, 256, 256], "powers of two"), ([67, 129, 40], "odd"), ([8, 8, 8], "small")] {
            let all = (0..n[2]).flat_map(|z| (0..n[1]).flat_map(move |y| (0..n[0]).map(move |x| [x, y, z])));
            let r = n.iter().min().unwrap() / 4;
            let near = |[x, y, z]: [i32; 3]| (x - r).pow(2) + (y - r).pow(2) + (z - r).pow(2) < r * r;
            let kind = |name: &str, at: [i32; 3]| match name {
                "ball" => near(at),
                "sheet" => at[2] == 1,
                _ => at[0] == 0,
            };
            for name in ["ball", "sheet", "wall"] {
                let blocks: Vec<u32> = all
                    .clone()
                    .filter(|&at| kind(name, at))
                    .map(|[x, y, z]| ((z * n[1] + y) * n[0] + x) as u32)
                    .collect();
                let capacity = blocks.len() + 64;
                let table = of_blocks(&blocks, capacity).expect("near places are free");
                let probes = |block: u32| {
                    places(block, shift(capacity)).position(|k| table[k][0] == block + 1).expect("it is there") + 1
                };
                let (most, sum) = blocks.iter().fold((0, 0), |(most, sum), &block| {
                    let n = probes(block);
                    (n.max(most), sum + n)
                });
                let mean = sum as f64 / blocks.len() as f64;
                println!("{label}, {name}: {} blocks, {mean:.2} probes, at most {most}", blocks.len());
                assert!(mean < 2.0 && most < 64);
            }
        }
    }

    #[test]
    fn a_table_without_room_is_refused() {
        // All of one hash.
        let inverse = (0..5).fold(1u32, |x, _| x.wrapping_mul(2u32.wrapping_sub(0x9e37_79b9u32.wrapping_mul(x))));
        let blocks: Vec<u32> = (0..200).map(|k: u32| k.wrapping_mul(inverse)).collect();
        assert!(of_blocks(&blocks[..100], 1 << 12).is_some());
        assert!(of_blocks(&blocks, 1 << 12).is_none());
    }
}
