// The active blocks of a side, by hash: entries of a block + 1 (0: none) and its slot + 1, at the first free place from
// where the block's hash points. The host keeps half of the entries free (src/engine/explicit/gpu/table.rs). Memory
// follows what is active, however large the domain is.
//
// uses explicit/layout

/// Entries that are looked at before a block is given up.
const PROBES = 128u;

fn entry_of(block: u32) -> u32 {
    return (block * 0x9e3779b9u) >> params.table_shift;
}

fn entry_after(entry: u32) -> u32 {
    return (entry + 1u) & (0xffffffffu >> params.table_shift);
}

/// Slot + 1 of a block on the `_in` side; 0 if it is not active.
fn slot_in(block: u32) -> u32 {
    var entry = entry_of(block);
    for (var tries = 0u; tries < PROBES; tries++) {
        let found = table_in[entry];
        if (found.x == block + 1u) {
            return found.y;
        }
        if (found.x == 0u) {
            break;
        }
        entry = entry_after(entry);
    }
    return 0u;
}

/// Slot + 1 of a block on the `_out` side, after all were claimed.
fn slot_out(block: u32) -> u32 {
    var entry = entry_of(block);
    for (var tries = 0u; tries < PROBES; tries++) {
        let found = atomicLoad(&table_out[2u * entry]);
        if (found == block + 1u) {
            return atomicLoad(&table_out[2u * entry + 1u]);
        }
        if (found == 0u) {
            break;
        }
        entry = entry_after(entry);
    }
    return 0u;
}
