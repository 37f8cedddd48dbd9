//! Grid coordinates packed into one number, to sort and look them up by.

/// Nodes of a block along an axis are 2 to this power.
const BLOCK_BITS: u32 = 2;

/// Coordinates of `BITS` bits each, sign included, as one number in lexicographic order.
pub fn pack<const BITS: u32, const D: usize>(coordinates: [i32; D]) -> u64 {
    coordinates.iter().fold(0, |key, &c| key << BITS | (c + (1 << (BITS - 1))) as u64)
}

/// The coordinates that [`pack`] made a number of; what lies above them is ignored.
pub fn unpack<const BITS: u32, const D: usize>(key: u64) -> [i32; D] {
    let field = |a: usize| key >> (BITS * (D - 1 - a) as u32) & ((1 << BITS) - 1);
    std::array::from_fn(|a| field(a) as i32 - (1 << (BITS - 1)))
}

/// Bits of a number that [`pack_by_blocks`] makes.
pub const fn by_blocks_bits(bits: u32, dimension: usize) -> u32 {
    (bits + BLOCK_BITS) * dimension as u32
}

/// A node's index in order of its block of 4^D, whose coordinates have `BITS` bits each, then of
/// its place in there: nodes near each other in space are so in memory.
pub fn pack_by_blocks<const BITS: u32, const D: usize>(index: [i32; D]) -> u64 {
    let block = pack::<BITS, D>(index.map(|i| i >> BLOCK_BITS));
    index.iter().fold(block, |key, &i| key << BLOCK_BITS | (i & ((1 << BLOCK_BITS) - 1)) as u64)
}

/// The index that [`pack_by_blocks`] made a number of; what lies above it is ignored.
pub fn unpack_by_blocks<const BITS: u32, const D: usize>(key: u64) -> [i32; D] {
    let block = unpack::<BITS, D>(key >> (BLOCK_BITS * D as u32));
    let place = |a: usize| key >> (BLOCK_BITS * (D - 1 - a) as u32) & ((1 << BLOCK_BITS) - 1);
    std::array::from_fn(|a| block[a] << BLOCK_BITS | place(a) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_pack_and_keep_their_order() {
        let ascending = [[-3, 5, -1], [-3, 5, 0], [-2, -7, 9], [0, 0, 0], [4, -1, 2]];
        assert!(ascending.windows(2).all(|w| pack::<21, 3>(w[0]) < pack::<21, 3>(w[1])));
        assert!(ascending.iter().all(|&c| unpack::<21, 3>(pack::<21, 3>(c)) == c));
        assert_eq!(unpack::<21, 2>(1 << 42 | pack::<21, 2>([-1, 7])), [-1, 7]);
    }

    #[test]
    fn nodes_pack_block_by_block() {
        let ascending = [[-5, 3, -1], [-4, 0, 0], [-1, 3, 3], [-4, 0, 4], [-1, 7, -1], [0, -9, 2], [3, -9, 1]];
        assert!(ascending.windows(2).all(|w| pack_by_blocks::<18, 3>(w[0]) < pack_by_blocks::<18, 3>(w[1])));
        assert!(ascending.iter().all(|&i| unpack_by_blocks::<18, 3>(pack_by_blocks::<18, 3>(i)) == i));
        let above = 1 << by_blocks_bits(18, 2);
        assert!(pack_by_blocks::<18, 2>([i32::from(i16::MAX); 2]) < above);
        assert_eq!(unpack_by_blocks::<18, 2>(above | pack_by_blocks::<18, 2>([-6, 7])), [-6, 7]);
    }
}
