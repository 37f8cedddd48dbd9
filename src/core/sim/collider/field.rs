//! Sampled signed distances: solids and sheets without a closed form, as values on a lattice with
//! trilinear interpolation.

/// Lowest bits of a sheet's sample, which say the sides of a cell's corners.
const SIDES: u32 = 0x7f;

/// Sides of a cell that a sheet goes through in a way that eight corners cannot tell: it is filled up.
/// They alternate from corner to corner, as those of no other cell do.
pub const SOLID: u8 = 0b1001_0110;

/// Half the thickness of a sheet where it fills a cell, in spacings: no point of a cell has an
/// interpolated distance larger than its own by more than √¾.
pub const FILLING: f64 = 0.8661;

/// The least sample of a sheet (m): bits of smaller numbers may be lost on GPUs.
const LEAST: f32 = 1e-30;

/// Most by which a sample far from the surface may be too large (spacings). Of a ball with dents at
/// random it is 0.11.
pub const FAR_ERROR: f64 = 0.25;

/// A signed distance field on a lattice in its own frame. The solid lies inside the lattice's box,
/// away from its faces.
///
/// In 2D the lattice has one sample along z and the field does not vary along it.
#[derive(Clone, PartialEq)]
pub struct DistanceField {
    /// Position of the first sample (m).
    pub origin: [f64; 3],
    /// Distance between samples (m).
    pub spacing: f64,
    /// Samples along each axis.
    pub size: [usize; 3],
    /// Distances (m), negative inside; x runs fastest. Those of a sheet are made by [`sided`].
    pub samples: Vec<f32>,
    /// It is a surface without inside.
    pub sheet: bool,
    /// A box around the solid, lower then upper corner (m); infinite along z in 2D.
    pub bounds: [[f64; 3]; 2],
}

impl DistanceField {
    /// Signed distance at a point (m). Inside the lattice's box it is trilinear. Outside it is
    /// sqrt(e² + d²), with e the distance to the box and d the value at the nearest point of the
    /// box. No point of the solid is nearer than that, because the box is convex.
    ///
    /// The distance to a sheet is never negative, and has a kink there that no interpolation meets.
    /// In cells that the sheet goes through, the corners on one side of it count as negative, and
    /// the interpolated value without its sign is the distance.
    pub fn distance(&self, x: [f64; 3]) -> f64 {
        let (mut index, mut share, mut away) = ([0; 3], [0.0; 3], 0.0);
        for a in 0..3 {
            let last = (self.size[a] - 1) as f64;
            if last == 0.0 {
                continue;
            }
            let at = (x[a] - self.origin[a]) / self.spacing;
            let held = at.clamp(0.0, last);
            away += (at - held) * (at - held);
            index[a] = (held as usize).min(self.size[a] - 2);
            share[a] = held - index[a] as f64;
        }
        let first = index[0] + self.size[0] * (index[1] + self.size[1] * index[2]);
        let sides = if self.sheet { sides(self.samples[first]) } else { 0 };
        let filled = sides == SOLID;
        let value = |corner: usize| -> f64 {
            let (mut at, mut stride, mut weight) = (0, 1, 1.0);
            for a in 0..3 {
                let upper = corner >> a & 1;
                weight *= if upper == 1 { share[a] } else { 1.0 - share[a] };
                // An axis with a single sample has no upper neighbour and gives it no weight.
                at += stride * (index[a] + upper).min(self.size[a] - 1);
                stride *= self.size[a];
            }
            let beyond = sides >> corner & 1 == 1 && !filled;
            weight * f64::from(if beyond { -self.samples[at] } else { self.samples[at] })
        };
        let value: f64 = (0..8).map(value).sum();
        let value = if self.sheet { value.abs() - if filled { FILLING * self.spacing } else { 0.0 } } else { value };
        if away == 0.0 { value } else { value.hypot(self.spacing * away.sqrt()) }
    }

    /// By how much the field may differ between two points beyond their distance (m). An
    /// interpolated value is a mean of exact ones, so it is off by no more than the mean distance
    /// to their places, at most √¾ of the spacing, and by [`FAR_ERROR`]. Two values differ by twice
    /// that. In a cell that a sheet goes through, a value may be too small by the cell's diagonal.
    pub fn slack(&self) -> f64 {
        (3f64.sqrt() * if self.sheet { 1.5 } else { 1.0 } + 2.0 * FAR_ERROR) * self.spacing
    }

    /// Half of the solid's least thickness along an axis (m), as far as samples tell: from ridges of the distance,
    /// where it grows to both sides.
    pub fn half_thickness(&self) -> f64 {
        if self.sheet {
            return 0.0;
        }
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        let depth = |k: usize| f64::from(self.samples[k]);
        let is_ridge = |k: usize, a: usize| {
            let i = k / strides[a] % self.size[a];
            let grows = |there: usize| depth(there) > depth(k) + 0.5 * self.spacing;
            i >= 2 && i + 2 < self.size[a] && grows(k - 2 * strides[a]) && grows(k + 2 * strides[a])
        };
        let inside = (0..self.samples.len()).filter(|&k| depth(k) < 0.5 * self.spacing);
        inside.filter(|&k| (0..3).any(|a| is_ridge(k, a))).map(|k| (-depth(k)).max(0.0)).fold(f64::INFINITY, f64::min)
    }

    /// Memory taken by the samples (bytes).
    pub fn bytes(&self) -> u64 {
        size_of_val(self.samples.as_slice()) as u64
    }
}

/// A sheet's sample for the distance `u` (m), with the sides of the cell whose lowest corner it is: bit
/// k is for the corner at upper x, y, z where bits 0, 1, 2 of k are 1. Corner 0 has bit 0, and none
/// has another where no sheet goes through. The distance is off by at most 1/131072 of itself.
pub fn sided(u: f32, sides: u8) -> f32 {
    let bits = u.max(LEAST).to_bits();
    let marked = bits & !SIDES | u32::from(sides >> 1);
    // The nearest number that ends so.
    let off = i64::from(marked) - i64::from(bits);
    let step = SIDES + 1;
    f32::from_bits(match off {
        65.. => marked - step,
        ..-64 => marked + step,
        _ => marked,
    })
}

/// The sides of the cell whose lowest corner has this sample.
pub fn sides(sample: f32) -> u8 {
    (sample.to_bits() << 1) as u8
}

impl std::fmt::Debug for DistanceField {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "DistanceField({:?} samples of {} m from {:?})", self.size, self.spacing, self.origin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(size: [usize; 3]) -> DistanceField {
        let (origin, spacing) = ([-0.7, -0.6, if size[2] == 1 { 0.0 } else { -0.65 }], 0.1);
        let sample = |k: usize| {
            let i = [k % size[0], k / size[0] % size[1], k / (size[0] * size[1])];
            let x: [f64; 3] = std::array::from_fn(|a| origin[a] + i[a] as f64 * spacing);
            (x.iter().map(|a| a * a).sum::<f64>().sqrt() - 0.4) as f32
        };
        let samples = (0..size[0] * size[1] * size[2]).map(sample).collect();
        DistanceField { origin, spacing, size, samples, sheet: false, bounds: [[-0.4; 3], [0.4; 3]] }
    }

    #[test]
    fn follows_the_exact_distance_inside_and_stays_below_it_outside() {
        for size in [[15, 13, 14], [15, 13, 1]] {
            let field = ball(size);
            for k in 0..4000 {
                let x: [f64; 3] = std::array::from_fn(|a| f64::from((k * [37, 91, 53][a]) % 401) / 100.0 - 2.0);
                let x = if size[2] == 1 { [x[0], x[1], 0.0] } else { x };
                let exact = x.iter().map(|a| a * a).sum::<f64>().sqrt() - 0.4;
                let d = field.distance(x);
                assert!(d < exact + 0.03, "{d} at {x:?}, {exact} expected");
                assert!(x.iter().any(|a| a.abs() > 0.6) || d > exact - 0.01, "{d} at {x:?}, {exact} expected");
                // Continuous at the faces of the box.
                let step = 1e-9;
                let near = field.distance([x[0] + step, x[1] - step, x[2]]);
                assert!((near - d).abs() < 4.0 * step);
            }
        }
    }

    #[test]
    fn samples_are_met_exactly() {
        let field = ball([15, 13, 14]);
        for (k, sample) in field.samples.iter().enumerate() {
            let i = [k % 15, k / 15 % 13, k / (15 * 13)];
            let x = std::array::from_fn(|a| field.origin[a] + i[a] as f64 * field.spacing);
            assert!((field.distance(x) - f64::from(*sample)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_sample_keeps_its_distance_and_its_sides() {
        for sides in (0..=254).step_by(2) {
            for u in [0.0, 1e-20, 0.1, 0.99999994, 1.0, 123.456] {
                let sample = sided(u, sides);
                assert_eq!(super::sides(sample), sides);
                assert!((sample - u).abs() <= u / 131_072.0 + 1e-29, "{sample} for {u}");
            }
        }
    }

    /// The square |x| < 1 in the plane z = 0.3 of a lattice of whole numbers.
    #[test]
    fn a_sheet_lies_between_its_samples() {
        let u = |k: usize| (k / 64) as f32 - 1.3;
        let sides = |k: usize| if k / 64 == 1 { 0xf0 } else { 0 };
        let samples = (0..256).map(|k| sided(u(k).abs(), sides(k))).collect();
        let field = DistanceField {
            origin: [-4.0, -4.0, -1.0],
            spacing: 1.0,
            size: [8, 8, 4],
            samples,
            sheet: true,
            bounds: [[-4.0, -4.0, -0.7], [4.0, 4.0, 1.3]],
        };
        for k in 0..=30 {
            let z = f64::from(k) * 0.1 - 1.0;
            let d = field.distance([0.3, -0.7, z]);
            assert!((d - (z - 0.3).abs()).abs() < 1e-5, "{d} at {z}");
        }
    }
}
