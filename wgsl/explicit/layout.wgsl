// Buffers and structs of the explicit engine. The Rust twins are in
// src/engine/explicit/gpu/layout.rs; a test compares them field by field.
//
// Block: 4³ nodes of each grid. Slot: place of an active block in `grid_*`. The `_in` side belongs
// to the grid that holds the particles' transfer at the step's start, the `_out` side to the one
// that this step fills; the host swaps them.
//
// Particle coordinates: y = x/dx - SHIFT (+ padding), stored as block and offset in [0, 4), so that
// a particle keeps full f32 precision however large the domain is.
//
// uses shared/structs, shared/blocks

const MOST_FIELDS = 9u;

struct Params {
    blocks: vec3<u32>,       // extent of the domain, with room around it, in blocks
    particles: u32,          // room for them: the stride of channels
    cells: vec3<f32>,        // extent of the domain in cells
    dx: f32,                 // m
    gravity: vec3<f32>,      // m/s²
    dt: f32,                 // s
    pad: vec3<i32>,          // cells from the table's corner to the domain's, 0 on periodic axes
    capacity: u32,           // block slots
    periodic: vec3<u32>,
    colliders: u32,
    mass_scale: f32,         // fixed-point units per kg
    momentum_scale: f32,     // fixed-point units per kg m/s
    soft_shift: f32,         // displacement a step, in cells, above which the host plans smaller steps
    first_step: u32,         // step that `poses` begins with
    soft_demand: f32,        // demand of a material (1/s²) above which the host plans smaller steps
    soft_growth: f32,        // entry of dt ∇v above which it does
    live: u32,               // particles that there are
    cell_scale: f32,         // fixed-point units, of what FILLS_* names, per cell that is filled
    first_kick: f32,         // time over which forces act before the motion of step 0 (s)
    last_kick: f32,          // and before that of `last_step` (s); all others: dt
    last_step: u32,
    end_dt: f32,             // time over which the frame's last g2p moves particles (s)
    fields: u32,             // layers of blocks: bodies with contact of their own, and one; or sides
    sided: u32,              // 1 if layers are sides of plates
    resets: u32,             // 1 if g2p resets particles that are alone
    steps: u32,              // of the run so far, for `dither`
    // In y, from the domain's corner (cells):
    lowest: vec3<f32>,       // where the planes of sticky walls stop particles
    table_shift: u32,        // 32 - log2 of the entries of the block table
    highest: vec3<f32>,
    spare1: u32,
    outer_low: vec3<f32>,    // beyond which particles have left the domain
    spare2: u32,
    outer_high: vec3<f32>,
    spare3: u32,
    walls: array<vec4<f32>, 6>, // x-, x+, y-, y+, z-, z+: contact kind, friction, unused, unused
    contacts: array<vec4<f32>, MOST_FIELDS>, // by field: contact kind, friction, kg of a full node, unused
}

struct Report {
    halt: atomic<u32>,       // HALT_* bits; any stops all later steps until the host clears it
    asks: atomic<u32>,       // HALT_* bits that the step now running will leave
    error: atomic<u32>,      // ERROR_* bits
    error_particle: atomic<u32>, // lowest id that raised an error
    max_shift: atomic<u32>,  // largest displacement of one step so far in cells, f32 bits
    max_speed: atomic<u32>,  // largest |v| + sqrt(3) dx |C| at the last g2p (m/s), f32 bits
    max_demand: atomic<u32>, // largest demand of a material at the last g2p (1/s²), f32 bits
    started: u32,            // 1 once the frame's start is done
    step: u32,               // steps done since; the number of the one now running
    ran: u32,                // 1 if the step now running, or the frame's start, was begun
    blocks: u32,             // blocks of the `_in` side
    wanted: atomic<u32>,     // blocks of the `_out` side, also those that there is no slot for
    needed: u32,             // most blocks that an activation asked for
    work: u32,               // entries of `work`
    work_count: atomic<u32>, // entries of it that the next step will have
    cursor: atomic<u32>,     // particles handed out to bins
    isolated: atomic<u32>,   // particles reset at the last g2p
    finished: u32,           // 1 once the frame's last step has run
}

// A run of particles of one block, the work of one workgroup.
// touched: 1 if contact has left something for its particles (explicit/touched).
// at: coordinates of the block; layer: first block of its layer.
struct Work { block: u32, start: u32, count: u32, touched: u32, at: vec3<i32>, layer: u32 }

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> report: Report;
@group(0) @binding(2) var<storage, read_write> table_in: array<vec2<u32>>; // see explicit/table
@group(0) @binding(3) var<storage, read_write> table_out: array<atomic<u32>>; // the same, value after value
@group(0) @binding(4) var<storage, read_write> blocks_in: array<u32>; // block by slot
@group(0) @binding(5) var<storage, read_write> blocks_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> grid_in: array<i32>; // slot, grid, channel, node
@group(0) @binding(7) var<storage, read_write> grid_out: array<atomic<i32>>;
@group(0) @binding(8) var<storage, read_write> bins: array<atomic<u32>>; // slot of `_out` -> count, then start
@group(0) @binding(9) var<storage, read_write> work: array<Work>;
@group(0) @binding(10) var<storage, read_write> destinations: array<vec2<u32>>; // particle -> slot, rank in its bin
@group(0) @binding(11) var<storage, read_write> list: array<u32>; // bin position -> particle
@group(0) @binding(12) var<storage, read_write> position_in: array<vec4<u32>>; // offset in block (f32 bits), id
@group(0) @binding(13) var<storage, read_write> position_out: array<vec4<u32>>;
@group(0) @binding(14) var<storage, read_write> deformation_in: array<f32>; // see explicit/state_io, as for the next
@group(0) @binding(15) var<storage, read_write> deformation_out: array<f32>;
@group(0) @binding(16) var<storage, read_write> frame_position: array<vec4<u32>>; // by id: offset (f32 bits), block
@group(0) @binding(17) var<storage, read_write> frame_velocity: array<f32>;
@group(0) @binding(18) var<storage, read_write> frame_deformation: array<f32>;
@group(0) @binding(19) var<storage, read> body_of: array<u32>; // by id
@group(0) @binding(20) var<storage, read> bodies: array<Body>;
@group(0) @binding(21) var<storage, read> materials: array<Material>;
@group(0) @binding(22) var<storage, read> sdf_ops: array<SdfOp>;
@group(0) @binding(23) var<storage, read> colliders: array<Collider>;
@group(0) @binding(24) var<storage, read> poses: array<Pose>;
@group(0) @binding(25) var<storage, read> sdf_samples: array<f32>; // of all fields, x fastest (m)
@group(0) @binding(26) var<storage, read_write> reactions: array<atomic<u32>>; // replica, surface, two words a sum

@group(0) @binding(31) var<storage, read_write> rest_in: array<f32>;
@group(0) @binding(32) var<storage, read_write> rest_out: array<f32>;
@group(0) @binding(33) var<storage, read_write> frame_rest: array<f32>;
@group(0) @binding(34) var<storage, read_write> frame_velocity_1: array<f32>;
@group(0) @binding(35) var<storage, read_write> frame_velocity_2: array<f32>;
@group(0) @binding(27) var<storage, read_write> touches: array<u32>; // by id, channel-major: holds, radius, stretch

override WORKGROUP: u32 = 64u;
/// How a node's share of filled cells is known.
override FILLS: u32 = 2u;
/// Whether some collider acts on particles.
override TOUCHES: bool = true;

// Channels of a block's nodes in `grid_*`: mass, momentum by axis, and what fills the node. After
// the grid update velocities lie in the momentum's place, and in the last one what `fill` reads.
const CHANNEL = 64u;
const NODE_CHANNELS = 5u;
const FILLED = 256u;      // first of the last channel
const GRID_STRIDE = 320u; // of a block's nodes of one grid

const FILLS_NOTHING = 0u; // nobody asks
const FILLS_MASS = 1u;    // by its mass, because there is one material
const FILLS_VOLUME = 2u;  // by the rest volumes that p2g sums

const NOWHERE = 0xffffffffu;

const HALT_BLOCKS = 1u;   // more blocks wanted than there are slots; the step was not begun
const HALT_REPLAN = 2u;   // a particle moved further than planned; the step is complete
const HALT_ERROR = 4u;
const HALT_MASS = 8u;     // node masses near the fixed-point range; the step is complete
const HALT_MOMENTUM = 16u;

const ERROR_NAN = 1u;
const ERROR_CFL = 2u;     // a particle moved a cell or more in one step
const ERROR_DOMAIN = 4u;
const ERROR_RANGE = 8u;   // fixed-point overflow

const SOFT_LIMIT = 536870912;  // 2^29: beyond it the scale is re-planned
const HARD_LIMIT = 1073741824; // 2^30

/// Most particles a workgroup takes; more of a block are shared out.
const WORK_MAX = 1024u;

/// Time over which forces act before the motion of a step (s).
fn kick(step: u32) -> f32 {
    if (step == 0u) {
        return params.first_kick;
    }
    return select(params.dt, params.last_kick, step == params.last_step);
}

/// Whether the step goes on. It is not begun after a halt, or if it lacks room.
fn running() -> bool {
    return atomicLoad(&report.halt) == 0u && atomicLoad(&report.wanted) <= params.capacity;
}

/// The work of a workgroup; empty if there is none.
fn job_of(item: u32) -> Work {
    var job: Work;
    if (running() && item < report.work) {
        job = work[item];
    }
    return job;
}

/// The block at an offset from that of the work, in its layer; -1 outside.
fn beside(job: Work, offset: vec3<i32>) -> i32 {
    let there = block_index(job.at + offset);
    return select(there + i32(job.layer), -1, there < 0);
}

/// Stops the run when the step is over. The step's results are then of no use.
fn fail(code: u32, id: u32) {
    atomicOr(&report.error, code);
    atomicMin(&report.error_particle, id);
}

/// Stops the run when the step is over, which is complete.
fn ask(halt: u32) {
    atomicOr(&report.asks, halt);
}

fn neighbour(i: u32) -> vec3<i32> {
    return vec3<i32>(vec3<u32>(i % 3u, (i / 3u) % 3u, i / 9u)) - vec3<i32>(1);
}
