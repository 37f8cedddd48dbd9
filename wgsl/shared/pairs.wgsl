// Sums kept as an unevaluated pair (high, low) of floats, so that a sum over millions has the
// precision of its terms.

/// Knuth's two-sum, and the low parts beside it.
fn add_pairs(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let s = a.x + b.x;
    let v = s - a.x;
    let e = (a.x - (s - v)) + (b.x - v) + (a.y + b.y);
    let high = s + e;
    return vec2<f32>(high, e - (high - s));
}
