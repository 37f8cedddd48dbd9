// One colour of block Gauss–Seidel: x_i ← x_i + D_i⁻¹ (b − A x)_i. Nodes of a colour are no
// neighbours of each other, so each is updated in place. Rows as in product.wgsl. Colours: index
// mod `counts` of the quadratic kernel's nodes (radius 2, so 3 or more); of the compact pair the
// position in half cells (grid 0 even, grid 1 odd, neighbours up to 3 apart, so 4 or more). The
// counts divide a periodic axis.
//
// uses implicit/linear/level, implicit/linear/vectors, implicit/linear/product

struct Colour {
    colour: vec3<i32>,
    // Of the compact pair.
    half: u32,
    counts: vec3<i32>,
    spare: u32,
}

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> columns: array<u32>;
@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read> inverse: array<f32>;
@group(0) @binding(4) var<storage, read> ids: array<vec4<i32>>;
@group(0) @binding(5) var<storage, read> b: array<f32>;
@group(0) @binding(6) var<storage, read_write> x_in: array<f32>;
@group(0) @binding(7) var<storage, read> turn: Colour;
@group(0) @binding(8) var<storage, read> anchors: array<f32>;

fn gathered(row: u32) -> vec3<f32> {
    return vec3<f32>(x_in[row], x_in[level.stride + row], x_in[2u * level.stride + row]);
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let n = level.stride;
    let row = group.x * ROWS + lane % ROWS;
    var wanted = row < level.rows;
    if (wanted) {
        let id = ids[row];
        let at = select(id.xyz, 2 * id.xyz - id.w, turn.half == 1u);
        wanted = all(((at % turn.counts) + turn.counts) % turn.counts == turn.colour);
    }
    let ax = product(row, lane, wanted);
    if (lane >= ROWS || !wanted) {
        return;
    }
    let step = inverse_times(row, vec3<f32>(b[row], b[n + row], b[2u * n + row]) - ax);
    for (var a = 0u; a < 3u; a++) {
        x_in[a * n + row] += step[a];
    }
}
