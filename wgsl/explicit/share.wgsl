// What nodes tell particles beside velocities, in one word: cells filled, and the share of the
// node's room outside walls and colliders.
//
// In 16 bits each both are good to 3e-5 of a full node; a half float would be good to 5e-4 only.
// More than the range of the former is next to what asks for coarser sums (SOFT_LIMIT), and counts as
// its end.

const MOST_FILLED = 4.0;
/// Of what `fill_units` gives.
const FILL_UNIT = vec2<f32>(MOST_FILLED / 65535.0, 1.0 / 65535.0);

struct NodeFill { filled: f32, room: f32 }

fn packed_fill(node: NodeFill) -> u32 {
    return pack2x16unorm(vec2<f32>(node.filled / MOST_FILLED, node.room));
}

/// Cells filled and room, in units that need no scaling before they are averaged.
fn fill_units(packed: i32) -> vec2<f32> {
    let word = u32(packed);
    return vec2<f32>(f32(word & 65535u), f32(word >> 16u));
}
