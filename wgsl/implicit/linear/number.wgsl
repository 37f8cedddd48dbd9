// Numbers a level's nodes in the order of its table. Marks become rows, or NONE; a workgroup 1024
// entries.
//
// uses implicit/linear/level, shared/prefix

@group(0) @binding(0) var<uniform> level: Level;
@group(0) @binding(1) var<storage, read> sums: array<u32>;
@group(0) @binding(2) var<storage, read_write> table: array<u32>;
@group(0) @binding(3) var<storage, read_write> ids: array<vec4<i32>>;

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let last = entries(level);
    let first = group.x * 1024u + lane * 4u;
    var marks = vec4<u32>();
    for (var k = 0u; k < 4u; k++) {
        if (first + k < last) {
            marks[k] = table[first + k];
        }
    }
    let own = marks.x + marks.y + marks.z + marks.w;
    var row = sums[group.x] + inclusive(lane, own) - own;
    for (var k = 0u; k < 4u; k++) {
        if (first + k < last) {
            if (marks[k] == 1u) {
                table[first + k] = row;
                ids[row] = id_of(level, first + k);
                row += 1u;
            } else {
                table[first + k] = NONE;
            }
        }
    }
}
