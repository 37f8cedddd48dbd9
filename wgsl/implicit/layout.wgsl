// Buffers and structs of the implicit step. Rust twins: src/engine/implicit/gpu/layout.rs; a test
// compares them.
//
// Block: 4³ nodes of each grid. Slot: place of a block that particles touch, in the order of the
// dense table. Dense node:
// (slot * GRIDS + grid) * 64 + x + 4 y + 16 z. Row: place of a node in the system that is solved;
// prescribed nodes have none.
// Particles: y = x/dx - SHIFT (+ padding) as block and offset in [0, 4); node n of a grid lies at n
// + node_offset(grid) - SHIFT in y.
// Before a step's sort particles lie anyhow (`_in`), after it by cell and id.
//
// uses shared/structs, shared/blocks

struct Params {
    blocks: vec3<u32>,       // extent of the dense block table
    particles: u32,          // particles that there are
    cells: vec3<f32>,        // extent of the domain in cells
    dx: f32,                 // m
    gravity: vec3<f32>,      // m/s²
    dt: f32,                 // s
    pad: vec3<i32>,          // cells from the table's corner to the domain's, 0 on periodic axes
    capacity: u32,           // block slots
    periodic: vec3<u32>,
    colliders: u32,
    room: u32,               // room for particles: the stride of their channels
    stride: u32,             // room for rows: the stride of the system's vectors
    rows: u32,               // nodes of the system
    mass_floor: f32,         // nodes lighter than this (kg) fall freely, without forces
    tangent: u32,            // derivative that the matrix is made of: TRIAL, TURNED or FLOWING
    flowing: u32,            // 1 if plastic laws flow within the step
    touch: u32,              // first channel of what particles remember of contact; 0: no collider acts on them
    links: u32,              // particles and faces near them
    link_room: u32,          // room for such: the stride of `press`
    mass_unit: f32,          // units of a sum of masses a kg
    spare0: u32,
    spare1: u32,
    walls: array<vec4<f32>, 6>, // x-, x+, y-, y+, z-, z+: contact kind, friction, unused, unused
}

struct Report {
    error: atomic<u32>,          // ERROR_* bits
    error_particle: atomic<u32>, // lowest id that raised one
    max_shift: atomic<u32>,      // largest displacement of the step along an axis in cells, f32 bits
    max_speed: atomic<u32>,      // largest |v| (m/s) after it, f32 bits
    blocks: u32,                 // that particles touch
    rows: u32,                   // nodes that are solved for
    separating: atomic<u32>,     // 1 if a separating surface constrains a node
    released: u32,               // 1 if nodes were let go
    rubbing: u32,                // 1 if nodes have friction
    most_strain: atomic<u32>,    // largest strain that `reach` has seen, f32 bits
    links: u32,                  // particles and faces near them
    spare0: u32,
}

// A particle and a face near it. body: of the particle; grip: APART, HOLDS or SLIDES
// (implicit/contact/springs); limit: of friction (N).
struct Link { particle: u32, collider: u32, body: u32, grip: u32, limit: f32 }

// Which velocity a collider has in the step: v = rows · (x - center, 1), so that x + dt v is where
// the turning surface takes x.
struct Sweep { r0: vec4<f32>, r1: vec4<f32>, r2: vec4<f32> }

// A surface that constrains a node. normal.w: friction; velocity.w: the surface's place among all,
// as bits; arm: from its centre to the node (m), w = HOLDING, SLIPPERY or SEPARATING; impulse: what
// it gives the node (N s), w = strength of its friction, µ J.
struct Touch { normal: vec4<f32>, velocity: vec4<f32>, arm: vec4<f32>, impulse: vec4<f32> }

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> report: Report;
@group(0) @binding(3) var<storage, read_write> block_list: array<u32>; // slot -> block
@group(0) @binding(4) var<storage, read_write> prefix: array<u32>; // sums before an entry, of blocks, then of rows
@group(0) @binding(5) var<storage, read_write> counts: array<atomic<u32>>; // particles a cell (of a slot)
@group(0) @binding(6) var<storage, read_write> starts: array<u32>; // first particle of a cell, and one more
@group(0) @binding(7) var<storage, read_write> list: array<u32>; // sorted place -> unsorted place
@group(0) @binding(8) var<storage, read_write> keys: array<vec2<u32>>; // unsorted place -> cell, rank in it
@group(0) @binding(9) var<storage, read_write> position_in: array<vec4<u32>>; // offset in block (f32 bits), block
@group(0) @binding(10) var<storage, read_write> tag_in: array<vec2<u32>>; // id, body
@group(0) @binding(11) var<storage, read_write> state_in: array<f32>; // channel-major: v, B/dx, F, plastic, contact
@group(0) @binding(12) var<storage, read_write> position: array<vec4<u32>>;
@group(0) @binding(13) var<storage, read_write> tag: array<vec2<u32>>;
@group(0) @binding(14) var<storage, read_write> state: array<f32>;
@group(0) @binding(15) var<storage, read_write> node: array<vec4<f32>>; // dense node: velocity at the start, mass
@group(0) @binding(16) var<storage, read_write> node_scale: array<f32>; // ξ_i = Σ w m ξ_p / m_i (Pa)
@group(0) @binding(17) var<storage, read_write> moving: array<vec4<f32>>; // what Δv is added to; at last, the sum
@group(0) @binding(18) var<storage, read_write> freedom: array<vec4<f32>>; // as `freedoms`; w = PRESCRIBED, NOWHERE
@group(0) @binding(19) var<storage, read_write> begin: array<vec4<f32>>; // velocity that the solve begins with
@group(0) @binding(20) var<storage, read_write> row_of: array<u32>; // dense node -> row or NO_NODE
@group(0) @binding(21) var<storage, read_write> predicted: array<f32>; // channel-major: (I + dt ∇v) F for `moving`
@group(0) @binding(22) var<storage, read_write> push: array<f32>; // channel-major: A of what nodes get, w A d or A ∇w
@group(0) @binding(23) var<storage, read_write> tensor: array<f32>; // channel-major: upper half of the 9 × 9 stiffness
@group(0) @binding(24) var<storage, read_write> partials: array<vec2<f32>>; // energy by block, then by block and grid
@group(0) @binding(25) var<storage, read> bodies: array<Body>;
@group(0) @binding(26) var<storage, read> materials: array<Material>;
@group(0) @binding(27) var<storage, read> characteristic: array<f32>; // ξ_p by body (Pa)
@group(0) @binding(28) var<storage, read> sdf_ops: array<SdfOp>;
@group(0) @binding(29) var<storage, read> sdf_samples: array<f32>;
@group(0) @binding(30) var<storage, read> colliders: array<Collider>;
@group(0) @binding(31) var<storage, read> poses: array<Pose>; // at the step's start, then after it
@group(0) @binding(32) var<storage, read> sweeps: array<Sweep>;
@group(0) @binding(33) var<storage, read_write> ids: array<vec4<i32>>; // from here on: `System`
@group(0) @binding(34) var<storage, read_write> columns: array<u32>;
@group(0) @binding(35) var<storage, read_write> values: array<f32>;
@group(0) @binding(36) var<storage, read_write> freedoms: array<vec4<f32>>;
@group(0) @binding(37) var<storage, read_write> masses: array<f32>;
@group(0) @binding(38) var<storage, read_write> scales: array<f32>;
@group(0) @binding(39) var<storage, read_write> dv: array<f32>;
@group(0) @binding(40) var<storage, read> trial: array<f32>;
@group(0) @binding(41) var<storage, read_write> gradient: array<f32>;
@group(0) @binding(42) var<storage, read_write> energy: array<f32>;
@group(0) @binding(43) var<storage, read> control: array<u32>;
@group(0) @binding(44) var<storage, read_write> touches: array<Touch>; // three a dense node
@group(0) @binding(45) var<storage, read_write> reactions: array<f32>; // block, surface, force and moment
@group(0) @binding(46) var<storage, read_write> presses: array<vec4<f32>>; // block and grid: push, pull (N s), friction
@group(0) @binding(47) var<storage, read_write> anchors: array<f32>;
@group(0) @binding(48) var<storage, read_write> speeds: array<f32>;
@group(0) @binding(60) var<storage, read_write> faces: array<u32>; // that are near a particle
@group(0) @binding(61) var<storage, read_write> link_starts: array<u32>; // first link of a particle, and one more
@group(0) @binding(62) var<storage, read_write> links: array<Link>; // by particle, then by collider
@group(0) @binding(63) var<storage, read_write> press: array<f32>; // channel-major by link: force or impulse, stiffness
@group(0) @binding(64) var<storage, read_write> holding: array<atomic<u32>>; // see HOLDING_*

const LANES = 64u;
const NO_NODE = 0xffffffffu;

// Kinds of surfaces, in arm.w of a touch.
const SLIPPERY = 0.0;
const HOLDING = 1.0;
const SEPARATING = 2.0;

// Kinds of nodes, in freedom.w.
const FREE = 0.0;
const PLANE = 1.0;
const LINE = 2.0;
const PRESCRIBED = 3.0;
const NOWHERE = 4.0;

// Tangents: the derivative at the trial; at the step's start, turned to where the trial is; the
// same, but of laws that flow within the step the tangent of their flow.
const TRIAL = 0u;
const TURNED = 1u;
const FLOWING = 2u;
// Entries of `holding`: whether limits of friction have changed, and grips; mass of the nodes that are
// solved for; from the last on, springs that hold or press by body.
const HOLDING_LIMITS = 0u;
const HOLDING_GRIPS = 1u;
const HOLDING_MASS = 2u;
const HOLDING_BODIES = 3u;

/// In linear.w of a pose: the collider is there, and was not when particles last met faces.
const APPEARS: f32 = 2.0;

const ERROR_NAN = 1u;
const ERROR_DOMAIN = 4u;

fn fail(code: u32, id: u32) {
    atomicOr(&report.error, code);
    atomicMin(&report.error_particle, id);
}

/// Item of a lane in a dispatch of LANES wide workgroups.
fn item(group: vec3<u32>, groups: vec3<u32>, lane: u32) -> u32 {
    return group_index(group, groups) * LANES + lane;
}
