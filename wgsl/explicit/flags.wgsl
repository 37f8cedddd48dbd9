// What a lane has to say of its particles, told once a work item.
//
// uses explicit/layout

struct Flags {
    error: u32,     // ERROR_* bits
    particle: u32,  // lowest id that raised one
    replan: bool,
    farthest: f32,  // largest displacement (cells)
}

fn no_flags() -> Flags {
    return Flags(0u, 0xffffffffu, false, 0.0);
}

fn note(flags: ptr<function, Flags>, error: u32, id: u32) {
    (*flags).error |= error;
    (*flags).particle = min((*flags).particle, id);
}

fn tell(flags: Flags) {
    if (flags.error != 0u) {
        fail(flags.error, flags.particle);
    }
    if (flags.replan) {
        ask(HALT_REPLAN);
    }
}
