// Compact C² kernel K(x) = 1 - |x| + sin(2π|x|)/2π on the dual grid (CK-MPM §4): 8 nodes of each of
// two grids at ±dx/4.
// SHIFT = ¼: base nodes of a particle at x (in cells) are floor(x - ¼) = floor(y) and floor(x + ¼)
// = floor(y + ½).
//
// Weights without trigonometry or cancellation: per axis and grid let u = frac(x - s/4) and v =
// min(u, 1 - u). Then v⁺ + v⁻ = ½, the smaller weight of a pair is g(v) = v - sin(2πv)/2π, its
// slope h(v) = 1 - cos 2πv, and with a = min(v⁺, v⁻) ≤ ¼
//     g(½ - a) = ½ - 2a + g(a),  h(½ - a) = 2 - h(a),
// so that two short polynomials in a² serve both grids with full relative precision down to the
// kernel's edge.

const GRIDS = 2u;
const NODES = 2u;
const SHIFT = 0.25;

struct Stencil {
    base: array<vec3<i32>, 2>,         // first node, relative to the block; grid + then grid -
    d: array<vec3<f32>, 2>,            // base node minus particle, in cells
    w: array<array<vec3<f32>, 2>, 2>,  // grid, node: per axis
    dw: array<array<vec3<f32>, 2>, 2>, // per axis and cell
}

/// h(a) = 1 - cos 2πa for a ≤ ¼; t = (2πa)².
fn steepness(a: vec3<f32>, t: vec3<f32>) -> vec3<f32> {
    return a * a * 19.739208802178716 * (1.0 - t * (1.0 / 12.0 - t * (1.0 / 360.0 - t * (1.0 / 20160.0
        - t * (1.0 / 1814400.0 - t * (1.0 / 239500800.0 - t * (1.0 / 43589145600.0)))))));
}

struct Profile { g_plus: vec3<f32>, g_minus: vec3<f32>, h_plus: vec3<f32>, h_minus: vec3<f32>, high: vec3<bool> }

/// g and h on both grids from the fraction f = u⁺; `high` where u⁺ > ½ (there u⁻ < ½).
fn profile(f: vec3<f32>) -> Profile {
    let v = min(f, 1.0 - f);     // v⁺; v⁻ = ½ - v⁺
    let far = v > vec3<f32>(0.25);
    let a = select(v, 0.5 - v, far);
    let t = a * a * 39.478417604357434; // (2πa)²
    // Taylor: 6/(2k+3)! and 2/(2k+2)!, (2π)²/6 and (2π)²/2 in front; t ≤ 2.47, so that the rest is
    // below 1e-9.
    let g = a * a * a * 6.579736267392905 * (1.0 - t * (0.05 - t * (1.0 / 840.0 - t * (1.0 / 60480.0
        - t * (1.0 / 6652800.0 - t * (1.0 / 1037836800.0))))));
    let h = steepness(a, t);
    let g_far = 0.5 - 2.0 * a + g;
    let h_far = 2.0 - h;
    let high = f > vec3<f32>(0.5);
    return Profile(select(g, g_far, far), select(g_far, g, far), select(h, h_far, far), select(h_far, h, far), high);
}

/// Where a particle is in its cell, by axis and for both grids: first nodes, weights of the lower and the upper
/// node, slopes of the latter (those of the lower are opposite).
struct Spot {
    base: vec3<f32>,       // grid +, relative to the block: whole numbers
    f: vec3<f32>,          // the particle minus that node, in cells
    step: vec3<f32>,       // grid -'s first node minus grid +'s
    lower_plus: vec3<f32>,
    upper_plus: vec3<f32>,
    lower_minus: vec3<f32>,
    upper_minus: vec3<f32>,
    slope_plus: vec3<f32>,
    slope_minus: vec3<f32>,
    skew: vec3<f32>,       // mean distance of grid +'s nodes from the particle; of grid -'s, the opposite
}

fn spot(y: vec3<f32>) -> Spot {
    let b = floor(y);
    let f = y - b;
    let q = profile(f);
    // u⁺ = f ≤ ½: the far, upper node of grid + has the small weight, and u⁻ = f + ½ the lower one of grid -.
    let upper = 1.0 - q.g_plus;
    let lower = 1.0 - q.g_minus;
    let step = select(vec3<f32>(0.0), vec3<f32>(1.0), f >= vec3<f32>(0.5));
    // s = cos(2πx)/2π = -sin(2πu⁺)/2π, and sin(2πv)/2π = v - g(v).
    let sine = min(f, 1.0 - f) - q.g_plus;
    return Spot(b, f, step,
        select(upper, q.g_plus, q.high), select(q.g_plus, upper, q.high),
        select(lower, q.g_minus, f < vec3<f32>(0.5)), select(q.g_minus, lower, f < vec3<f32>(0.5)),
        q.h_plus, q.h_minus, select(-sine, sine, q.high));
}

fn stencil(y: vec3<f32>) -> Stencil {
    let at = spot(y);
    var s: Stencil;
    s.base[0] = vec3<i32>(at.base);
    s.base[1] = vec3<i32>(at.base + at.step);
    s.d[0] = -at.f;
    s.d[1] = at.step - 0.5 - at.f;
    s.w[0] = array(at.lower_plus, at.upper_plus);
    s.w[1] = array(at.lower_minus, at.upper_minus);
    s.dw[0] = array(-at.slope_plus, at.slope_plus);
    s.dw[1] = array(-at.slope_minus, at.slope_minus);
    return s;
}

/// D/dx² = diag(p) + s sᵀ.
struct Moments { p: vec3<f32>, s: vec3<f32> }

fn moments(y: vec3<f32>) -> Moments {
    let at = spot(y);
    return Moments(0.5 * (at.lower_plus * at.upper_plus + at.lower_minus * at.upper_minus), at.skew);
}

/// A D⁻¹ dx² by Sherman–Morrison: A diag(1/p) - (A q) qᵀ / (1 + s·q), q = s/p.
fn times_inverse(a: mat3x3<f32>, m: Moments) -> mat3x3<f32> {
    let inverse = 1.0 / m.p;
    let q = m.s * inverse;
    let aq = (a * q) * (1.0 / (1.0 + dot(m.s, q)));
    return mat3x3<f32>(a[0] * inverse.x - aq * q.x, a[1] * inverse.y - aq * q.y, a[2] * inverse.z - aq * q.z);
}

fn times_inverse_moment(a: mat3x3<f32>, y: vec3<f32>) -> mat3x3<f32> {
    return times_inverse(a, moments(y));
}

/// A diag(p)⁻¹: the moments about each grid's own mean have no skew part.
fn times_inverse_spread(a: mat3x3<f32>, y: vec3<f32>) -> mat3x3<f32> {
    let p = moments(y).p;
    return mat3x3<f32>(a[0] / p.x, a[1] / p.y, a[2] / p.z);
}

/// Mean distance of a grid's nodes from the particle, Σ w d = ± s.
fn grid_mean(y: vec3<f32>, grid: u32) -> vec3<f32> {
    let s = moments(y).s;
    return select(s, -s, grid == 1u);
}

/// A D / dx².
fn times_moment(a: mat3x3<f32>, y: vec3<f32>) -> mat3x3<f32> {
    let m = moments(y);
    let along = a * m.s;
    return mat3x3<f32>(a[0] * m.p.x + along * m.s.x, a[1] * m.p.y + along * m.s.y, a[2] * m.p.z + along * m.s.z);
}

fn node_offset(grid: u32) -> f32 {
    return select(0.25, -0.25, grid == 1u);
}

/// ½ of the dual grid's means; 1 for a single grid.
const GRID_SHARE = 0.5;

/// Share of a node's room that is inside a plane wall which it lies y inside of, by axis
/// (`ShapeFunction::inside`).
fn inside(y: vec3<f32>) -> vec3<f32> {
    let a = min(abs(y), vec3<f32>(1.0));
    let v = min(a, 1.0 - a);
    let far = v > vec3<f32>(0.25);
    let b = select(v, 0.5 - v, far);
    let h = steepness(b, b * b * 39.478417604357434);
    let tail = 0.5 - a + 0.5 * a * a - select(h, 2.0 - h, far) * (1.0 / 39.478417604357434);
    return select(1.0 - tail, tail, y <= vec3<f32>(0.0));
}

/// Nodes of a particle that is so far inside of a wall have all their room (cells).
const ROOM_REACH = 2.0;
