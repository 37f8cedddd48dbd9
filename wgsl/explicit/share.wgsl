// What nodes tell particles beside velocities, in one word: cells filled, and the share of the
// node's room outside colliders.
//
// In 17 and 15 bits both are good to 1.5e-5; a half float would be good to 5e-4 of a full node only.
// More than the range of the former is next to what asks for coarser sums (SOFT_LIMIT), and counts as
// its end.

const MOST_FILLED = 4.0;

struct NodeFill { filled: f32, room: f32 }

fn packed_fill(node: NodeFill) -> u32 {
    let filled = u32(round(131071.0 * clamp(node.filled / MOST_FILLED, 0.0, 1.0)));
    return (filled << 15u) | u32(round(32767.0 * clamp(node.room, 0.0, 1.0)));
}

fn unpacked(word: u32) -> NodeFill {
    return NodeFill(f32(word >> 15u) * (MOST_FILLED / 131071.0), f32(word & 32767u) / 32767.0);
}
