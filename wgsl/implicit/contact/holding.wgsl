// Springs that hold or press, by body, and what has changed of them.
//
// uses implicit/contact/springs

fn count_holding(link: Link, hold: u32) {
    if (link.grip != APART || hold == BOND || hold == RAIL) {
        atomicAdd(&holding[HOLDING_BODIES + link.body], 1u);
    }
}
