//! Rigid obstacles: a signed distance field, a contact and a motion.

use super::problem::Contact;

/// A primitive solid in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Primitive {
    /// Half extents (m), centred on the origin.
    Box([f64; 3]),
    /// Radius (m).
    Sphere(f64),
    /// Radius and half height (m), along z.
    Cylinder(f64, f64),
    /// Major and minor radius (m), about z.
    Torus(f64, f64),
    /// All points with z <= 0.
    HalfSpace,
}

/// One instruction of a signed distance program in postfix order, the common form of CPU and GPU evaluation.
///
/// Rigid motions inside a shape are folded into its primitives, so that only primitives have a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SdfOp {
    /// Push the distance to a primitive whose local coordinates are `rotation (x - translation)` (row-major).
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

/// Deepest stack that a program may need; validation refuses more.
pub const SDF_STACK: usize = 8;

/// Position and orientation at an instant: x_world = rotation x_start + translation (row-major).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub rotation: [f64; 9],
    pub translation: [f64; 3],
}

/// Rigid motion with constant linear and angular velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Centre of rotation at time 0 (m).
    pub center: [f64; 3],
    pub linear_velocity: [f64; 3],
    pub angular_velocity: [f64; 3],
}

/// A rigid obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Collider {
    pub name: String,
    pub sdf: Sdf,
    pub contact: Contact,
    pub motion: Motion,
}
