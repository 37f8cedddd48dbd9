// Folding of large dispatches into two dimensions: a dimension takes at most 65,535 workgroups.

fn want(which: u32, groups: u32) {
    status.groups[which] = groups;
    let x = min(groups, 32768u);
    dispatches[which] = vec4<u32>(x, select((groups + 32767u) / 32768u, 0u, groups == 0u), select(1u, 0u, groups == 0u), 0u);
}
