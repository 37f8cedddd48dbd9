// Start of a frame: publishes the number of work items that the first binning made, for p2g. One thread.

@group(1) @binding(0) var<storage, read_write> dispatches: array<vec4<u32>>;

@compute @workgroup_size(1)
fn main() {
    want(GROUPS_WORK, select(atomicLoad(&status.work_count), 0u, halted()));
}
