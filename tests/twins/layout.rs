//! Every shader is valid WGSL, and every struct that Rust and WGSL share has the same layout in both.

use std::mem::offset_of;

use gridfall_core::sim::touch;
use gridfall_core::sim::volume;
use gridfall_engine::explicit::gpu::layout;
use gridfall_engine::gpu::{Fills, Shader, Variant, WORKGROUP};
use gridfall_engine::implicit::gpu::layout as implicit;
use gridfall_engine::implicit::gpu::linear::layout as linear;
use gridfall_engine::programs::programs;

/// A program in one of its variants.
fn parse(name: &str) -> naga::Module {
    let variant = Variant::samples().last().unwrap();
    let shader = Shader::new(name, variant, WORKGROUP).unwrap_or_else(|e| panic!("{name}: {e}"));
    naga::front::wgsl::parse_str(&shader.wgsl).unwrap()
}

#[test]
fn every_program_is_valid() {
    let programs = programs().unwrap_or_else(|e| panic!("{e}"));
    println!("{} programs", programs.len());
    assert!(programs.iter().all(|shader| !shader.bindings.is_empty()));
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
    let m = parse("explicit/g2p2g");
    twin!(m, Params: blocks, particles, cells, dx, gravity, dt, pad, capacity, periodic, colliders, mass_scale,
        momentum_scale, soft_shift, first_step, soft_demand, soft_growth, live, cell_scale,
        first_kick, last_kick, last_step, end_dt, fields, sided, resets, steps, lowest,
        table_shift, highest, spare1, outer_low, spare2, outer_high, spare3, walls, contacts);
    twin!(m, Report: halt, asks, error, error_particle, max_shift, max_speed, max_demand, started, step, ran, blocks,
        wanted, needed, work, work_count, cursor, isolated, finished);
    twin!(m, Body: mass, volume, material, demand, rate, full, crowded, stiffness, damping, spacing, spare0, spare1);
    twin!(m, Material: model, a, b, c, d, e, damping, spare);
    twin!(m, SdfOp: r0, r1, r2, size, code, grid);
    twin!(m, Collider: first, count, kind, friction, slack, touches, spare0, spare1);
    twin!(m, Pose: r0, r1, r2, linear, angular, center);
    twin!(m, Work: block, start, count, touched, at, layer);
    let m = parse("implicit/boundary");
    twin!(m, implicit, Params: blocks, particles, cells, dx, gravity, dt, pad, capacity, periodic, colliders, room,
        stride, rows,
        mass_floor, tangent, flowing, touch, links, link_room, mass_unit, spare0, spare1, walls);
    twin!(m, implicit, Report: error, error_particle, max_shift, max_speed, blocks, rows, separating, released,
        rubbing, most_strain, links, spare0);
    twin!(m, implicit, Sweep: r0, r1, r2);
    twin!(m, implicit, Touch: normal, velocity, arm, impulse);
    twin!(m, implicit, Link: particle, collider, body, grip, limit);
    let m = parse("implicit/linear/gauss_seidel");
    twin!(m, linear, Level: low, rows, blocks, stride, period, grids, groups, degree, range, sliding, factor, spare);
    twin!(m, linear, Colour: colour, half, counts, spare);
    let m = parse("implicit/linear/decide");
    twin!(m, linear, State: energy, residual2, slope, alpha, halvings, flags, spare);
    let m = parse("implicit/linear/cg_turn");
    twin!(m, linear, Cg: zr, beta, alpha, count, size2, mass, motion2, pap);
    let m = parse("implicit/linear/ritz");
    twin!(m, linear, Lanczos: count, rz, spare0, spare1, alpha, beta);
}

fn literal(module: &naga::Module, name: &str) -> naga::Literal {
    let found = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name));
    let (_, c) = found.unwrap_or_else(|| panic!("no {name}"));
    match module.global_expressions[c.init] {
        naga::Expression::Literal(literal) => literal,
        ref e => panic!("{name}: {e:?}"),
    }
}

fn constant(module: &naga::Module, name: &str) -> u32 {
    match literal(module, name) {
        naga::Literal::U32(v) => v,
        other => panic!("{name}: {other:?}"),
    }
}

fn number(module: &naga::Module, name: &str) -> f32 {
    match literal(module, name) {
        naga::Literal::F32(v) => v,
        naga::Literal::AbstractFloat(v) => v as f32,
        other => panic!("{name}: {other:?}"),
    }
}

#[test]
fn shared_constants_agree() {
    let m = parse("explicit/g2p2g");
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
        ("PROBES", layout::TABLE_PROBES),
        ("PART_CHANNELS", layout::PART_CHANNELS as u32),
        ("WORK_MAX", layout::WORK_MAX as u32),
        ("CHANNEL", layout::BLOCK_NODES as u32),
        ("NODE_CHANNELS", layout::NODE_CHANNELS as u32),
        ("FILLED", (layout::BLOCK_NODES * (layout::NODE_CHANNELS - 1)) as u32),
        ("GRID_STRIDE", (layout::BLOCK_NODES * layout::NODE_CHANNELS) as u32),
        ("FILLS_NOTHING", Fills::Nothing as u32),
        ("FILLS_MASS", Fills::Mass as u32),
        ("FILLS_VOLUME", Fills::Volume as u32),
    ] {
        assert_eq!(constant(&m, name), rust, "{name}");
    }
    let bin = parse("explicit/bin");
    for (name, groups) in [("GROUPS_WORK", layout::Groups::Work), ("GROUPS_BLOCKS", layout::Groups::Blocks)] {
        assert_eq!(constant(&bin, name), groups as u32, "{name}");
    }
    assert_eq!(number(&m, "STIRRED"), volume::STIRRED as f32);
    assert_eq!(number(&m, "NOISE"), volume::NOISE as f32);
    assert_eq!(number(&m, "DENSEST"), volume::DENSEST as f32);
    assert_eq!(number(&m, "FULLEST"), volume::FULLEST as f32);
    assert_eq!(number(&m, "GRADUAL"), volume::GRADUAL as f32);
    let m = parse("explicit/measure");
    assert_eq!(constant(&m, "PART"), layout::PART as u32);
    assert_eq!(constant(&m, "RECORD"), layout::RECORD as u32);
    assert_eq!(constant(&parse("explicit/select"), "PLAIN"), layout::PLAIN as u32);
    let m = parse("explicit/touch");
    for (name, rust) in [
        ("STANDOFF", touch::STANDOFF),
        ("BONDED", touch::BONDED),
        ("SOFT", touch::SOFT),
        ("LEAST_STEP", touch::LEAST_STEP_DX),
    ] {
        assert_eq!(number(&m, name), rust as f32, "{name}");
    }
    let m = parse("implicit/tensor");
    for (name, rust) in [
        ("TRIAL", implicit::Tangent::Trial),
        ("TURNED", implicit::Tangent::Turned),
        ("FLOWING", implicit::Tangent::Flowing),
    ] {
        assert_eq!(constant(&m, name), rust as u32, "{name}");
    }
    let m = parse("implicit/contact/near");
    assert_eq!(number(&m, "UNMET"), implicit::UNMET);
    assert_eq!(number(&m, "APPEARS"), implicit::APPEARS);
    let m = parse("implicit/contact/renew");
    for (name, rust) in [
        ("HOLDING_LIMITS", implicit::HOLDING_LIMITS),
        ("HOLDING_GRIPS", implicit::HOLDING_GRIPS),
        ("HOLDING_MASS", implicit::HOLDING_MASS),
        ("HOLDING_BODIES", implicit::HOLDING_BODIES),
    ] {
        assert_eq!(constant(&m, name), rust as u32, "{name}");
    }
    let m = parse("implicit/linear/decide");
    for (name, rust) in [
        ("ACCEPTED", linear::ACCEPTED),
        ("INDEFINITE", linear::INDEFINITE),
        ("DROPPED", linear::DROPPED),
        ("BROKEN", linear::BROKEN),
    ] {
        assert_eq!(constant(&m, name), rust, "{name}");
    }
}
