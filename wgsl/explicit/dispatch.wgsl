// Folding of large dispatches into two dimensions: a dimension takes at most 65,535 workgroups.
//
// uses explicit/layout

// Workgroup counts (x, y, z) of the indirect dispatches, 16 bytes apart. Only programs that are not
// dispatched indirectly may bind them as storage.
@group(0) @binding(27) var<storage, read_write> dispatches: array<vec4<u32>>;

fn want(which: u32, groups: u32) {
    report.groups[which] = groups;
    let x = min(groups, 32768u);
    let y = (groups + 32767u) / 32768u;
    dispatches[which] = select(vec4<u32>(x, y, 1u, 0u), vec4<u32>(0u), groups == 0u);
}
