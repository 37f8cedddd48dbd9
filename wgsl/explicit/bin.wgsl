// Step or frame's start, at its end: writes every particle's index into its block's bin. One thread a particle; ranks
// are distinct, so no two write one place.
// The first thread also does what is to be done once: it counts the step, and says how many workgroups the next one
// needs. The others do not look at what it changes.
//
// uses explicit/layout

// Workgroup counts (x, y, z) of the next step's indirect dispatches, 16 bytes apart.
@group(0) @binding(28) var<storage, read_write> dispatches_out: array<vec4<u32>>;

const GROUPS_WORK = 0u;
const GROUPS_BLOCKS = 1u;

/// Folds large dispatches into two dimensions: a dimension takes at most 65,535 workgroups.
fn folded(groups: u32) -> vec4<u32> {
    return select(vec4<u32>(min(groups, 32768u), (groups + 32767u) / 32768u, 1u, 0u), vec4<u32>(0u), groups == 0u);
}

fn commit() {
    if (report.ran == 0u) {
        if (atomicLoad(&report.wanted) > params.capacity) {
            report.needed = max(report.needed, atomicLoad(&report.wanted));
            atomicOr(&report.halt, HALT_BLOCKS);
        }
        return;
    }
    report.blocks = atomicLoad(&report.wanted);
    report.needed = max(report.needed, report.blocks);
    report.work = atomicLoad(&report.work_count);
    dispatches_out[GROUPS_WORK] = folded(report.work);
    dispatches_out[GROUPS_BLOCKS] = folded(report.blocks);
    atomicStore(&report.wanted, 0u);
    atomicStore(&report.work_count, 0u);
    atomicStore(&report.cursor, 0u);
    if (atomicLoad(&report.error) != 0u) {
        atomicStore(&report.halt, HALT_ERROR);
        return;
    }
    atomicStore(&report.halt, atomicExchange(&report.asks, 0u));
    report.step += report.started;
    report.started = 1u;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) count: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let particle = group_index(group, count) * WORKGROUP + lane;
    if (particle < params.live && report.ran != 0u) {
        let to = destinations[particle];
        // A particle with an error has no destination.
        if (to.x != NOWHERE) {
            list[atomicLoad(&bins[to.x]) + to.y] = particle;
        }
    }
    if (particle == 0u) {
        commit();
    }
}
