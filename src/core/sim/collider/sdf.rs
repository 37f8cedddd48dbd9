//! Solids as signed distance programs: postfix instructions over primitives, the form that both CPU
//! and GPU evaluate.
//!
//! All primitives except sampled ones have exact distances. Union, intersection, difference and
//! shell keep the sign exact and the value a lower bound of the true distance (1-Lipschitz).
//! Sampling and contact need no more than that.

use std::sync::Arc;

use super::field::DistanceField;

/// Half extent of a 2D shape along z (m), which stands for an infinite one.
pub const FLAT_HALF_EXTENT: f64 = 1e30;

/// A primitive solid in its own frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Primitive {
    /// Half extents (m); centred on the origin.
    Box([f64; 3]),
    /// Radius (m).
    Sphere(f64),
    /// Radius and half height (m), along z.
    Cylinder(f64, f64),
    /// Radius and half the length of the axis (m), along z.
    Capsule(f64, f64),
    /// Radius at the lower end, radius at the upper end, half height (m), along z.
    Cone(f64, f64, f64),
    /// Major and minor radius (m), about z.
    Torus(f64, f64),
    /// All points with z <= 0.
    HalfSpace,
    /// A sampled field whose lengths are multiplied by the factor.
    Grid(Arc<DistanceField>, f64),
}

impl Primitive {
    /// Signed distance of a point in the primitive's frame (m).
    pub fn distance(&self, x: [f64; 3]) -> f64 {
        match *self {
            Self::Box(h) => capped([x[0].abs() - h[0], x[1].abs() - h[1], x[2].abs() - h[2]]),
            Self::Sphere(r) => length(x) - r,
            Self::Cylinder(r, h) => capped([x[0].hypot(x[1]) - r, x[2].abs() - h, f64::NEG_INFINITY]),
            Self::Capsule(r, h) => length([x[0], x[1], x[2] - x[2].clamp(-h, h)]) - r,
            Self::Cone(base, top, h) => cone([x[0].hypot(x[1]), x[2]], base, top, h),
            Self::Torus(major, minor) => (x[0].hypot(x[1]) - major).hypot(x[2]) - minor,
            Self::HalfSpace => x[2],
            Self::Grid(ref field, scale) => scale * field.distance(x.map(|x| x / scale)),
        }
    }

    /// The primitive scaled by `factor` about its origin.
    pub fn scaled(&self, factor: f64) -> Self {
        match *self {
            Self::Box(h) => Self::Box(h.map(|h| factor * h)),
            Self::Sphere(r) => Self::Sphere(factor * r),
            Self::Cylinder(r, h) => Self::Cylinder(factor * r, factor * h),
            Self::Capsule(r, h) => Self::Capsule(factor * r, factor * h),
            Self::Cone(base, top, h) => Self::Cone(factor * base, factor * top, factor * h),
            Self::Torus(major, minor) => Self::Torus(factor * major, factor * minor),
            Self::HalfSpace => Self::HalfSpace,
            Self::Grid(ref field, scale) => Self::Grid(field.clone(), factor * scale),
        }
    }
}

/// Distance to a cone in the half-plane (radius, height) of a point: the smaller of the distances
/// to its caps and to its side.
fn cone([r, z]: [f64; 2], base: f64, top: f64, h: f64) -> f64 {
    let cap = [r - r.min(if z < 0.0 { base } else { top }), z.abs() - h];
    // From the point to the nearest point of the side, which runs from (top, h) along `down`.
    let down = [base - top, -2.0 * h];
    let along = ((r - top) * down[0] + (z - h) * down[1]) / (down[0] * down[0] + down[1] * down[1]);
    let along = along.clamp(0.0, 1.0);
    let side = [r - top - down[0] * along, z - h - down[1] * along];
    let inside = side[0] < 0.0 && cap[1] < 0.0;
    let distance = cap[0].hypot(cap[1]).min(side[0].hypot(side[1]));
    if inside { -distance } else { distance }
}

/// Distance to the corner region where all `q` <= 0.
fn capped(q: [f64; 3]) -> f64 {
    length(q.map(|a| a.max(0.0))) + q[0].max(q[1]).max(q[2]).min(0.0)
}

fn length(x: [f64; 3]) -> f64 {
    (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]).sqrt()
}

/// One instruction of a signed distance program in postfix order.
///
/// Rigid motions inside a shape are folded into its primitives, so that only primitives have a
/// frame.
#[derive(Clone, Debug, PartialEq)]
pub enum SdfOp {
    /// Push the distance to a primitive whose local coordinates are `rotation (x - translation)`
    /// (row-major).
    Primitive { primitive: Primitive, rotation: [f64; 9], translation: [f64; 3] },
    /// Pop b, a; push min(a, b).
    Union,
    /// Pop b, a; push max(a, b).
    Intersection,
    /// Pop b, a; push max(a, -b).
    Difference,
    /// Replace d by max(d, -(d + thickness)).
    Shell(f64),
}

/// A solid as a signed distance program (negative inside, m).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sdf {
    pub ops: Vec<SdfOp>,
}

/// Deepest stack that a program may need. Validation rejects programs that need more.
pub const SDF_STACK: usize = 8;

impl Sdf {
    /// Signed distance at a point (m), negative inside. An empty program is empty space.
    pub fn distance(&self, x: [f64; 3]) -> f64 {
        let mut stack = [f64::INFINITY; SDF_STACK];
        let mut top = 0;
        for op in &self.ops {
            match op {
                SdfOp::Primitive { primitive, rotation, translation } => {
                    let offset = [x[0] - translation[0], x[1] - translation[1], x[2] - translation[2]];
                    stack[top] = primitive.distance(rotate(rotation, offset));
                    top += 1;
                }
                SdfOp::Union => {
                    top -= 1;
                    stack[top - 1] = stack[top - 1].min(stack[top]);
                }
                SdfOp::Intersection => {
                    top -= 1;
                    stack[top - 1] = stack[top - 1].max(stack[top]);
                }
                SdfOp::Difference => {
                    top -= 1;
                    stack[top - 1] = stack[top - 1].max(-stack[top]);
                }
                SdfOp::Shell(thickness) => stack[top - 1] = stack[top - 1].max(-(stack[top - 1] + thickness)),
            }
        }
        stack[0]
    }

    /// A box that contains the solid, lower then upper corner (m); infinite where the solid is
    /// unbounded.
    ///
    /// It is exact for primitives in their own frame and for unions of them; otherwise it may be
    /// too large. Empty space has lower > upper.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let mut stack: Vec<[[f64; 3]; 2]> = Vec::new();
        for op in &self.ops {
            match op {
                SdfOp::Primitive { primitive, rotation, translation } => {
                    stack.push(primitive_bounds(primitive, rotation, translation));
                }
                SdfOp::Union => {
                    let ([lower_b, upper_b], [lower_a, upper_a]) = (stack.pop().unwrap(), stack.pop().unwrap());
                    stack.push([zip(lower_a, lower_b, f64::min), zip(upper_a, upper_b, f64::max)]);
                }
                SdfOp::Intersection => {
                    let ([lower_b, upper_b], [lower_a, upper_a]) = (stack.pop().unwrap(), stack.pop().unwrap());
                    stack.push([zip(lower_a, lower_b, f64::max), zip(upper_a, upper_b, f64::min)]);
                }
                SdfOp::Difference => {
                    stack.pop();
                }
                SdfOp::Shell(_) => {}
            }
        }
        stack.pop().unwrap_or([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]])
    }

    /// All sampled primitives with their scales.
    pub fn fields(&self) -> impl Iterator<Item = (&Arc<DistanceField>, f64)> {
        self.ops.iter().filter_map(|op| match op {
            SdfOp::Primitive { primitive: Primitive::Grid(field, scale), .. } => Some((field, *scale)),
            _ => None,
        })
    }

    /// Whether some of it is a surface without inside.
    pub fn is_sheet(&self) -> bool {
        self.fields().any(|(field, _)| field.sheet)
    }

    /// By how much two distances may differ beyond the distance between their points (m). It is 0
    /// without sampled primitives.
    pub fn slack(&self) -> f64 {
        self.fields().map(|(field, scale)| scale * field.slack()).fold(0.0, f64::max)
    }

    /// Depth of the stack that the program needs; at most [`SDF_STACK`] in a valid problem.
    pub fn stack_depth(&self) -> usize {
        let (mut depth, mut deepest) = (0usize, 0);
        for op in &self.ops {
            match op {
                SdfOp::Primitive { .. } => depth += 1,
                SdfOp::Union | SdfOp::Intersection | SdfOp::Difference => depth -= 1,
                SdfOp::Shell(_) => {}
            }
            deepest = deepest.max(depth);
        }
        deepest
    }
}

fn primitive_bounds(primitive: &Primitive, rotation: &[f64; 9], translation: &[f64; 3]) -> [[f64; 3]; 2] {
    // The local z axis is the third row of the rotation.
    let axis = [rotation[6], rotation[7], rotation[8]];
    let around = |reach: [f64; 3]| [zip(*translation, reach, |t, r| t - r), zip(*translation, reach, |t, r| t + r)];
    let disc = |a: usize| disc_reach(rotation, a);
    let each = |reach: &dyn Fn(usize) -> f64| around([reach(0), reach(1), reach(2)]);
    match *primitive {
        Primitive::Box(h) => each(&|a| (0..3).map(|k| rotation[3 * k + a].abs() * h[k]).sum()),
        Primitive::Sphere(r) => each(&|_| r),
        Primitive::Cylinder(r, half) => each(&|a| disc(a) * r + axis[a].abs() * half),
        Primitive::Capsule(r, half) => each(&|a| r + axis[a].abs() * half),
        Primitive::Cone(base, top, half) => {
            let end = |a: usize, side: f64| {
                let (below, above) = (side * disc(a) * base - axis[a] * half, side * disc(a) * top + axis[a] * half);
                translation[a] + if side > 0.0 { below.max(above) } else { below.min(above) }
            };
            [-1.0, 1.0].map(|side| [end(0, side), end(1, side), end(2, side)])
        }
        Primitive::Torus(major, minor) => each(&|a| disc(a) * major + minor),
        Primitive::Grid(ref field, scale) => {
            let corner = |k: usize, b: usize| scale * field.bounds[k >> b & 1][b];
            let (mut lower, mut upper) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for k in 0..8 {
                for a in 0..3 {
                    // An axis that does not contribute adds nothing, even if it is infinitely long.
                    let terms = (0..3).filter(|b| rotation[3 * b + a] != 0.0);
                    let x = translation[a] + terms.map(|b| rotation[3 * b + a] * corner(k, b)).sum::<f64>();
                    (lower[a], upper[a]) = (lower[a].min(x), upper[a].max(x));
                }
            }
            [lower, upper]
        }
        Primitive::HalfSpace => {
            // An axis-aligned wall bounds one side.
            let mut bounds = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
            for a in 0..3 {
                if axis[a].abs() > 1.0 - 1e-15 {
                    bounds[if axis[a] > 0.0 { 1 } else { 0 }][a] = translation[a];
                }
            }
            bounds
        }
    }
}

/// Extent along world axis `a` of the unit disc normal to the local z axis.
fn disc_reach(rotation: &[f64; 9], a: usize) -> f64 {
    rotation[a].hypot(rotation[3 + a])
}

fn zip(a: [f64; 3], b: [f64; 3], f: impl Fn(f64, f64) -> f64) -> [f64; 3] {
    [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2])]
}

/// R x for a row-major matrix.
pub fn rotate(r: &[f64; 9], x: [f64; 3]) -> [f64; 3] {
    [
        r[0] * x[0] + r[1] * x[1] + r[2] * x[2],
        r[3] * x[0] + r[4] * x[1] + r[5] * x[2],
        r[6] * x[0] + r[7] * x[1] + r[8] * x[2],
    ]
}

/// Rᵀ x for a row-major matrix.
pub fn rotate_back(r: &[f64; 9], x: [f64; 3]) -> [f64; 3] {
    [
        r[0] * x[0] + r[3] * x[1] + r[6] * x[2],
        r[1] * x[0] + r[4] * x[1] + r[7] * x[2],
        r[2] * x[0] + r[5] * x[1] + r[8] * x[2],
    ]
}

/// Rotation by `angle` (rad) about a unit `axis` (Rodrigues), row-major.
pub fn axis_angle(axis: [f64; 3], angle: f64) -> [f64; 9] {
    let [x, y, z] = axis;
    let (s, c) = angle.sin_cos();
    let t = 1.0 - c;
    [
        c + t * x * x,
        t * x * y - s * z,
        t * x * z + s * y,
        t * x * y + s * z,
        c + t * y * y,
        t * y * z - s * x,
        t * x * z - s * y,
        t * y * z + s * x,
        c + t * z * z,
    ]
}
