// Gather of the compact kernel: weighted means over the 8 nodes of each grid, and of the differences along
// each axis.
//
// On two nodes Σ w v = v_0 + w_1 (v_1 - v_0): exact where all velocities are the same, so that no error of Σ w = 1
// is a steady gain or loss of momentum. With D_a the mean of the differences along axis a, w_0 w_1 the spread of a
// grid's nodes about their mean, and w' the slope,
//     Σ w v d_a = (w_0 w_1)_a D_a + v̄ s_a,  Σ v ∂_a w = w'_a D_a.
//
// uses explicit/gathered

struct Means { v: vec3<f32>, x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, fill: vec2<f32> }

/// Along x: of a row's two nodes.
struct Row { v: vec3<f32>, x: vec3<f32>, fill: vec2<f32> }

fn row_mean(at: u32, w: f32) -> Row {
    let low = read_tile[at];
    let high = read_tile[at + 1u];
    let first = bitcast<vec3<f32>>(low.xyz);
    let difference = bitcast<vec3<f32>>(high.xyz) - first;
    var row = Row(first + w * difference, difference, vec2<f32>(0.0));
    if (FILLS != FILLS_NOTHING) {
        let fill = fill_units(low.w);
        row.fill = fill + w * (fill_units(high.w) - fill);
    }
    return row;
}

/// Along x and y.
struct Layer { v: vec3<f32>, x: vec3<f32>, y: vec3<f32>, fill: vec2<f32> }

fn layer_mean(at: u32, side: u32, w: vec3<f32>) -> Layer {
    let low = row_mean(at, w.x);
    let high = row_mean(at + side, w.x);
    let difference = high.v - low.v;
    return Layer(low.v + w.y * difference, low.x + w.y * (high.x - low.x), difference,
        low.fill + w.y * (high.fill - low.fill));
}

/// Of the nodes from place `at` of a tile with `side` nodes to an edge; `w`: weights of the upper nodes.
fn means(at: u32, side: u32, w: vec3<f32>) -> Means {
    let low = layer_mean(at, side, w);
    let high = layer_mean(at + side * side, side, w);
    let difference = high.v - low.v;
    return Means(low.v + w.z * difference, low.x + w.z * (high.x - low.x), low.y + w.z * (high.y - low.y), difference,
        low.fill + w.z * (high.fill - low.fill));
}

fn gather(y: vec3<f32>) -> Gathered {
    let s = spot(y);
    let plus = means(first_read(0u, s.base), READ_PLUS, s.upper_plus);
    let minus = means(first_read(1u, s.base + s.step), READ_MINUS, s.upper_minus);
    let spread_plus = s.lower_plus * s.upper_plus;
    let spread_minus = s.lower_minus * s.upper_minus;
    let along_x = plus.x * spread_plus.x + minus.x * spread_minus.x;
    let along_y = plus.y * spread_plus.y + minus.y * spread_minus.y;
    let along_z = plus.z * spread_plus.z + minus.z * spread_minus.z;
    let apart = 0.5 * (plus.v - minus.v);
    var out: Gathered;
    out.v = minus.v + apart;
    out.B = mat3x3<f32>(0.5 * along_x + apart * s.skew.x, 0.5 * along_y + apart * s.skew.y,
        0.5 * along_z + apart * s.skew.z);
    out.fill = FILL_UNIT * 0.5 * (plus.fill + minus.fill);
    if (!MLS) {
        let a = 0.5 * s.slope_plus;
        let b = 0.5 * s.slope_minus;
        out.gradient = mat3x3<f32>(plus.x * a.x + minus.x * b.x, plus.y * a.y + minus.y * b.y,
            plus.z * a.z + minus.z * b.z);
    } else if (CENTRED) {
        let inverse = 1.0 / (spread_plus + spread_minus);
        out.gradient = mat3x3<f32>(along_x * inverse.x, along_y * inverse.y, along_z * inverse.z);
    } else {
        out.gradient = times_inverse_moment(out.B, y);
    }
    return out;
}
