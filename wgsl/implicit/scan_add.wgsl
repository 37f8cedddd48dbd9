// Adds to each entry's sum what lies before its chunk. One lane an entry, and one for the sum of
// all.

@group(0) @binding(0) var<storage, read_write> entries: array<u32>;
@group(0) @binding(1) var<storage, read_write> before: array<u32>;
@group(0) @binding(2) var<storage, read_write> totals: array<u32>;

@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = arrayLength(&entries);
    let i = (group.y * groups.x + group.x) * 256u + lane;
    if (i <= n) {
        before[i] += totals[min(i, n - 1u) / 2048u];
    }
}
