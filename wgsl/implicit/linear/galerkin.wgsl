// Galerkin product H¹ = R H P, R = Pᵀ (HOT §5.3): the block of coarse nodes I and I + d is
//     Σ_ab w_a w_b S_a H[2I + a, 2(I + d) + b] S_b,   a, b ∈ {−1, 0, 1}³, w = 2^−(number of odd components).
// S is folded into H already except into the diagonal blocks of sliding nodes, which carry trace/3
// (I − S) as well; S H S removes it. The sum of a coarse row is Σ_a w_a of those of the fine rows,
// since the weights of a fine node add up to 1; it is never a difference of large numbers.
// In: fine values and anchors, children, freedoms of the fine nodes. Out: coarse values and anchors.
// A thread a coarse row and slot, neighbouring threads neighbouring rows. Everything is gathered: no
// race.
//
// uses implicit/linear/level, implicit/linear/freedom, implicit/linear/stencil_*

@group(0) @binding(0) var<uniform> fine: Level;
@group(0) @binding(1) var<uniform> coarse: Level;
@group(0) @binding(2) var<storage, read> ids: array<vec4<i32>>;
@group(0) @binding(3) var<storage, read> children: array<u32>;
@group(0) @binding(4) var<storage, read> freedoms: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> fine_values: array<f32>;
@group(0) @binding(6) var<storage, read_write> values: array<f32>;
@group(0) @binding(7) var<storage, read> fine_anchors: array<f32>;
@group(0) @binding(8) var<storage, read_write> anchors: array<f32>;

fn anchor(row: u32) -> mat3x3<f32> {
    let step = fine.stride;
    return mat3x3<f32>(
        fine_anchors[row], fine_anchors[row + 3u * step], fine_anchors[row + 6u * step],
        fine_anchors[row + step], fine_anchors[row + 4u * step], fine_anchors[row + 7u * step],
        fine_anchors[row + 2u * step], fine_anchors[row + 5u * step], fine_anchors[row + 8u * step],
    );
}

// Columns of the fine block.
fn block(slot: u32, row: u32) -> mat3x3<f32> {
    let at = 9u * slot * fine.stride + row;
    let step = fine.stride;
    return mat3x3<f32>(
        fine_values[at], fine_values[at + 3u * step], fine_values[at + 6u * step],
        fine_values[at + step], fine_values[at + 4u * step], fine_values[at + 7u * step],
        fine_values[at + 2u * step], fine_values[at + 5u * step], fine_values[at + 8u * step],
    );
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {
    let row = thread.x;
    let slot = thread.y;
    if (row >= coarse.rows) {
        return;
    }
    let grid = ids[row].w;
    let n = neighbour(slot, grid);
    let limits = reach(grid, n.other);
    var sum = mat3x3<f32>();
    var whole = mat3x3<f32>();
    for (var child = 0u; child < 27u; child++) {
        let found = children[child * coarse.stride + row];
        if (found == 0u) {
            continue;
        }
        let a = vec3<i32>(vec3<u32>(child / 9u, child / 3u % 3u, child % 3u)) - 1;
        let base = coarse.factor * n.offset - a;
        let widest = coarse.factor - 1;
        if (slot == CENTRE) {
            let odd = abs(a);
            var own = anchor(found - 1u);
            if (fine.sliding == 1u) {
                own = projection(freedoms[found - 1u]) * own;
            }
            whole += (1.0 / f32(1u << u32(odd.x + odd.y + odd.z))) * own;
        }
        let from_b = max(-widest, limits.x - base);
        let to_b = min(widest, limits.y - base);
        for (var bx = from_b.x; bx <= to_b.x; bx++) {
            for (var by = from_b.y; by <= to_b.y; by++) {
                for (var bz = from_b.z; bz <= to_b.z; bz++) {
                    let b = vec3<i32>(bx, by, bz);
                    let odd = abs(a) + abs(b);
                    let fine_slot = slot_of(base + b, grid, n.other);
                    var h = block(fine_slot, found - 1u);
                    if (fine_slot == CENTRE && fine.sliding == 1u) {
                        let s = projection(freedoms[found - 1u]);
                        h = s * h * s;
                    }
                    sum += (1.0 / f32(1u << u32(odd.x + odd.y + odd.z))) * h;
                }
            }
        }
    }
    let at = 9u * slot * coarse.stride + row;
    for (var r = 0u; r < 3u; r++) {
        for (var c = 0u; c < 3u; c++) {
            values[at + (3u * r + c) * coarse.stride] = sum[c][r];
            if (slot == CENTRE) {
                anchors[row + (3u * r + c) * coarse.stride] = whole[c][r];
            }
        }
    }
}
