// Quadratic B-spline on one grid: 27 nodes, D = dx²/4.
// SHIFT = ½: the base node of a particle at x (in cells) is floor(x - ½) = floor(y).

const GRIDS = 1u;
const NODES = 3u;
const SHIFT = 0.5;

struct Stencil {
    base: array<vec3<i32>, 1>,        // first node, relative to the block
    d: array<vec3<f32>, 1>,           // base node minus particle, in cells
    w: array<array<vec3<f32>, 3>, 1>, // per axis
    dw: array<array<vec3<f32>, 3>, 1>, // per axis and cell
}

fn stencil(y: vec3<f32>) -> Stencil {
    let b = floor(y);
    let f = y - b; // x - base - ½
    var s: Stencil;
    s.base[0] = vec3<i32>(b);
    s.d[0] = -(f + 0.5);
    let g = 1.0 - f;
    s.w[0] = array(0.5 * g * g, 0.75 - (f - 0.5) * (f - 0.5), 0.5 * f * f);
    s.dw[0] = array(-g, 1.0 - 2.0 * f, f);
    return s;
}

/// A D⁻¹ dx².
fn times_inverse_moment(a: mat3x3<f32>, y: vec3<f32>) -> mat3x3<f32> {
    return a * 4.0;
}

/// A diag(p)⁻¹.
fn times_inverse_spread(a: mat3x3<f32>, y: vec3<f32>) -> mat3x3<f32> {
    return a * 4.0;
}

/// Mean distance of the nodes from the particle, Σ w d.
fn grid_mean(y: vec3<f32>, grid: u32) -> vec3<f32> {
    return vec3<f32>(0.0);
}

/// A D / dx².
fn times_moment(a: mat3x3<f32>, y: vec3<f32>) -> mat3x3<f32> {
    return a * 0.25;
}

fn node_offset(grid: u32) -> f32 {
    return 0.0;
}

/// ½ of the dual grid's means; 1 for a single grid.
const GRID_SHARE = 1.0;

/// Share of a node's room that is inside a plane wall which it lies y inside of, by axis
/// (`ShapeFunction::inside`).
fn inside(y: vec3<f32>) -> vec3<f32> {
    let a = abs(y);
    let outer = max(1.5 - a, vec3<f32>(0.0));
    let tail = select(0.5 - 0.75 * a + a * a * a / 3.0, outer * outer * outer / 6.0, a >= vec3<f32>(0.5));
    return select(1.0 - tail, tail, y <= vec3<f32>(0.0));
}

/// Nodes of a particle that is so far inside of a wall have all their room (cells).
const ROOM_REACH = 3.0;
