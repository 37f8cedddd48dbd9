//! Where a shape is placed: scale, rotation and translation.

use gridfall_core::sim::collider::{Primitive, SdfOp, rotate};
use gridfall_core::sim::particles::IDENTITY;

/// A placement: x_world = scale rotation x_local + translation.
pub struct Placement {
    scale: f64,
    rotation: [f64; 9],
    translation: [f64; 3],
}

impl Placement {
    /// Where local and world coordinates are the same.
    pub fn world() -> Self {
        Self { scale: 1.0, rotation: IDENTITY, translation: [0.0; 3] }
    }

    /// The placement of something that is turned by `rotation` and moved to `translation` inside
    /// this one.
    pub fn then(&self, rotation: &[f64; 9], translation: [f64; 3]) -> Self {
        let t = rotate(&self.rotation, translation.map(|t| self.scale * t));
        Self {
            scale: self.scale,
            rotation: product(&self.rotation, rotation),
            translation: std::array::from_fn(|a| self.translation[a] + t[a]),
        }
    }

    /// The placement of something moved to `translation` inside this one.
    pub fn moved(&self, translation: [f64; 3]) -> Self {
        self.then(&IDENTITY, translation)
    }

    /// The placement of something at `translation` whose local z axis points along `axis`.
    pub fn along(&self, axis: [f64; 3], translation: [f64; 3]) -> Self {
        self.then(&basis_to(axis), translation)
    }

    /// This placement with lengths inside it multiplied by `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        Self { scale: factor * self.scale, ..self }
    }

    /// Length in the world of a unit of local length.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// A primitive placed here.
    pub fn primitive(&self, primitive: Primitive) -> SdfOp {
        let (rotation, translation) = (transposed(&self.rotation), self.translation);
        SdfOp::Primitive { primitive: primitive.scaled(self.scale), rotation, translation }
    }
}

/// A rotation that takes z to the direction of `axis` (Duff et al. 2017, Building an orthonormal
/// basis, revisited).
fn basis_to(axis: [f64; 3]) -> [f64; 9] {
    let [x, y, z] = unit(axis);
    let sign = 1f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [1.0 + sign * x * x * a, b, x, sign * b, sign + y * y * a, y, -sign * x, -y, z]
}

/// The direction of a vector.
pub fn unit(v: [f64; 3]) -> [f64; 3] {
    // Scaled first, so that no component is too large or too small to square.
    let largest = v.iter().fold(0.0f64, |m, a| m.max(a.abs()));
    let v = v.map(|a| a / largest);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    v.map(|a| a / length)
}

fn product(a: &[f64; 9], b: &[f64; 9]) -> [f64; 9] {
    std::array::from_fn(|k| (0..3).map(|j| a[3 * (k / 3) + j] * b[3 * j + k % 3]).sum())
}

fn transposed(a: &[f64; 9]) -> [f64; 9] {
    std::array::from_fn(|k| a[3 * (k % 3) + k / 3])
}
