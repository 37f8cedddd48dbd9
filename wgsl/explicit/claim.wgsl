// Activation of blocks.
//
// uses explicit/table

/// Activates a block of the `_out` side once.
fn claim(block: u32) {
    var entry = entry_of(block);
    var probes = 0u;
    // An exchange may fail without a cause.
    for (var tries = 0u; tries < 2u * PROBES && probes < PROBES; tries++) {
        // Reading first keeps the compare-and-swap rare: nearly all of the 27 claims on a block find it taken.
        var found = atomicLoad(&table_out[2u * entry]);
        if (found == 0u) {
            let taken = atomicCompareExchangeWeak(&table_out[2u * entry], 0u, block + 1u);
            if (taken.exchanged) {
                let slot = atomicAdd(&report.wanted, 1u);
                if (slot < params.capacity) {
                    blocks_out[slot] = block;
                    atomicStore(&table_out[2u * entry + 1u], slot + 1u);
                }
                return;
            }
            found = taken.old_value;
        }
        if (found == block + 1u) {
            return;
        }
        if (found != 0u) {
            entry = entry_after(entry);
            probes += 1u;
        }
    }
    // No entry is free nearby: the host makes the table larger.
    atomicMax(&report.wanted, params.capacity + 1u);
}
