// y = A x by rows, as y_i = anchor_i x_r + Σ_j A_ij (x_j − x_r), anchor_i the sum of the row: what stiff
// bodies do as a whole costs them nothing then, whatever the rounding of A. r is i itself, or of a
// light node the neighbour that it follows (diagonal.wgsl).
// 32 rows a workgroup, their slots dealt to 8 lanes each, whose sums are added in order. Neighbouring
// lanes read neighbouring rows of slot-major values. The entry point says what x is by
// `gathered(row)`.
//
// uses implicit/linear/level, implicit/linear/stencil_*

const ROWS = 32u;
const PARTS = 8u;

var<workgroup> parts: array<vec3<f32>, 256>;

// To be called by all lanes of the workgroup; every lane gets the sum of its row.
fn product(row: u32, lane: u32, wanted: bool) -> vec3<f32> {
    var sum = vec3<f32>();
    if (wanted) {
        let n = level.stride;
        let own = gathered(u32(anchors[9u * n + row]));
        for (var slot = lane / ROWS; slot < SLOTS; slot += PARTS) {
            // Without a neighbour the block is zero.
            let j = columns[slot * n + row];
            let x = gathered(select(j, row, j == NONE)) - own;
            let at = 9u * slot * n + row;
            sum += vec3<f32>(
                values[at] * x.x + values[at + n] * x.y + values[at + 2u * n] * x.z,
                values[at + 3u * n] * x.x + values[at + 4u * n] * x.y + values[at + 5u * n] * x.z,
                values[at + 6u * n] * x.x + values[at + 7u * n] * x.y + values[at + 8u * n] * x.z,
            );
        }
        if (lane < ROWS) {
            sum += vec3<f32>(
                anchors[row] * own.x + anchors[row + n] * own.y + anchors[row + 2u * n] * own.z,
                anchors[row + 3u * n] * own.x + anchors[row + 4u * n] * own.y + anchors[row + 5u * n] * own.z,
                anchors[row + 6u * n] * own.x + anchors[row + 7u * n] * own.y + anchors[row + 8u * n] * own.z,
            );
        }
    }
    parts[lane] = sum;
    workgroupBarrier();
    var total = parts[lane % ROWS];
    for (var p = 1u; p < PARTS; p++) {
        total += parts[p * ROWS + lane % ROWS];
    }
    return total;
}
