//! Every shader is valid WGSL, and every struct that Rust and WGSL share has the same layout in both.

use std::mem::offset_of;

use gridfall_core::sim::setup::Kernel;
use gridfall_engine::explicit::gpu::layout;
use gridfall_engine::explicit::gpu::shaders::{Stage, source};
use gridfall_engine::implicit::gpu::linear::kernels::{self, Kernel as Linear};
use gridfall_engine::implicit::gpu::linear::layout as linear;
use gridfall_engine::implicit::gpu::{layout as implicit, shaders};

fn parse_text(name: &str, text: &str) -> naga::Module {
    naga::front::wgsl::parse_str(text).unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(text)))
}

fn validate(name: &str, module: &naga::Module) {
    naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all())
        .validate(module)
        .unwrap_or_else(|e| panic!("{name}: {e:?}"));
}

fn parse(stage: Stage, kernel: Kernel) -> naga::Module {
    parse_text(&format!("{} ({kernel:?})", stage.name()), &source(stage, kernel))
}

fn parse_linear(stage: Linear, kernel: Kernel) -> naga::Module {
    parse_text(&format!("{} ({kernel:?})", stage.name()), &kernels::source(stage, kernel))
}

#[test]
fn every_stage_is_valid_for_both_kernels() {
    for kernel in [Kernel::Compact, Kernel::Quadratic] {
        for stage in Stage::ALL {
            validate(stage.name(), &parse(stage, kernel));
        }
        for stage in shaders::Stage::ALL {
            let text = shaders::source(stage, kernel);
            validate(stage.name(), &parse_text(stage.name(), &text));
            let buffers = shaders::used(&text).len();
            assert!(buffers <= 32, "{} names {buffers} buffers", stage.name());
        }
        for &stage in Linear::ALL {
            validate(stage.name(), &parse_linear(stage, kernel));
        }
    }
    for (name, text) in shaders::SCAN {
        validate(name, &parse_text(name, text));
    }
}

macro_rules! twin {
    ($module:expr, $type:ident: $($field:ident),+) => { twin!($module, layout, $type: $($field),+) };
    ($module:expr, $layout:ident, $type:ident: $($field:ident),+) => {{
        let (_, ty) = $module.types.iter().find(|(_, t)| t.name.as_deref() == Some(stringify!($type)))
            .unwrap_or_else(|| panic!("no WGSL struct {}", stringify!($type)));
        let naga::TypeInner::Struct { members, span } = &ty.inner else { panic!("{} is no struct", stringify!($type)) };
        let shader: Vec<(String, usize)> =
            members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect();
        let rust = vec![$((stringify!($field).to_string(), offset_of!($layout::$type, $field))),+];
        assert_eq!(rust, shader, "{}", stringify!($type));
        assert_eq!(size_of::<$layout::$type>(), *span as usize, "size of {}", stringify!($type));
    }};
}

#[test]
fn shared_structs_agree() {
    let m = parse(Stage::G2p2g, Kernel::Compact);
    twin!(m, Params: blocks, particles, cells, dx, gravity, dt, pad, capacity, periodic, colliders, mass_scale,
        momentum_scale, soft_shift, first_step, soft_demand, soft_growth, live, spare1, walls);
    twin!(m, Status: halt, error, error_particle, max_shift, max_speed, step, index, work_count, cursor, stale, needed,
        max_demand, isolated, finished, groups);
    twin!(m, Body: mass, volume, material, demand);
    twin!(m, Material: model, a, b, c, d, e, spare0, spare1);
    twin!(m, SdfOp: r0, r1, r2, size, code, grid);
    twin!(m, Collider: first, count, kind, friction);
    twin!(m, Pose: r0, r1, r2, linear, angular, center);
    twin!(m, Work: block, start, count, unused);
    let m = parse_text("boundary", &shaders::source(shaders::Stage::Boundary, Kernel::Compact));
    twin!(m, implicit, Params: blocks, particles, cells, dx, gravity, dt, pad, capacity, periodic, colliders, room, stride, rows,
        mass_floor, walls);
    twin!(m, implicit, Status: error, error_particle, max_shift, max_speed, blocks, rows, separating, released,
        rubbing, spare0, spare1, spare2);
    twin!(m, implicit, Sweep: r0, r1, r2);
    twin!(m, implicit, Touch: normal, velocity, arm, impulse);
    let m = parse_linear(Linear::GaussSeidel, Kernel::Compact);
    twin!(m, linear, Level: low, rows, blocks, stride, period, grids, groups, degree, range, sliding, factor, spare);
    twin!(m, linear, Colour: colour, half, counts, spare);
    let m = parse_linear(Linear::Decide, Kernel::Compact);
    twin!(m, linear, State: energy, residual2, slope, alpha, halvings, flags, spare);
    let m = parse_linear(Linear::Ritz, Kernel::Compact);
    twin!(m, linear, Lanczos: count, rz, spare0, spare1, alpha, beta);
}

fn constant(module: &naga::Module, name: &str) -> u32 {
    let found = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name));
    let (_, c) = found.unwrap_or_else(|| panic!("no {name}"));
    match module.global_expressions[c.init] {
        naga::Expression::Literal(naga::Literal::U32(v)) => v,
        ref e => panic!("{name}: {e:?}"),
    }
}

#[test]
fn shared_constants_agree() {
    let m = parse(Stage::G2p2g, Kernel::Compact);
    for (name, rust) in [
        ("HALT_BLOCKS", layout::HALT_BLOCKS),
        ("HALT_REPLAN", layout::HALT_REPLAN),
        ("HALT_ERROR", layout::HALT_ERROR),
        ("HALT_MASS", layout::HALT_MASS),
        ("HALT_MOMENTUM", layout::HALT_MOMENTUM),
        ("ERROR_NAN", layout::ERROR_NAN),
        ("ERROR_CFL", layout::ERROR_CFL),
        ("ERROR_DOMAIN", layout::ERROR_DOMAIN),
        ("ERROR_RANGE", layout::ERROR_RANGE),
        ("GROUPS_STALE", layout::Groups::Stale as u32),
        ("GROUPS_WORK", layout::Groups::Work as u32),
        ("GROUPS_BLOCKS_IN", layout::Groups::BlocksIn as u32),
        ("GROUPS_BLOCKS_OUT", layout::Groups::BlocksOut as u32),
        ("GROUPS_SLOTS_OUT", layout::Groups::SlotsOut as u32),
        ("GROUPS_PARTICLES", layout::Groups::Particles as u32),
        ("WORK_MAX", layout::WORK_MAX as u32),
    ] {
        assert_eq!(constant(&m, name), rust, "{name}");
    }
    let m = parse_linear(Linear::Decide, Kernel::Compact);
    for (name, rust) in [
        ("ACCEPTED", linear::ACCEPTED),
        ("INDEFINITE", linear::INDEFINITE),
        ("DROPPED", linear::DROPPED),
        ("BROKEN", linear::BROKEN),
    ] {
        assert_eq!(constant(&m, name), rust, "{name}");
    }
}
