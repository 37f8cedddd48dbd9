// Places in the upper triangle of a symmetric 9 × 9 matrix.

fn upper(i: u32, j: u32) -> u32 {
    let low = min(i, j);
    return low * 9u - (low * (low + 1u)) / 2u + max(i, j);
}
