// What nodes tell particles beside velocities, in one word: cells filled, and the share of the
// node's room outside colliders.
//
// In 16 bits each the former is good to 3e-5 of a cell, the latter to 8e-6, which is as much of the
// least room that counts; a half float would be good to 5e-4 of a full node only. More than the
// range of the former is next to what asks for coarser sums (SOFT_LIMIT), and counts as its end.

const MOST_FILLED = 4.0;

struct NodeFill { filled: f32, room: f32 }

fn packed_fill(node: NodeFill) -> u32 {
    return pack2x16unorm(vec2<f32>(node.filled / MOST_FILLED, node.room));
}

fn unpacked(word: u32) -> NodeFill {
    let shares = unpack2x16unorm(word);
    return NodeFill(shares.x * MOST_FILLED, shares.y);
}
