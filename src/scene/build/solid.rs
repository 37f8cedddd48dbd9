//! Shapes to signed distance programs: placements and factors of scale are folded into the primitives, whose distances stay exact.

use crate::schema::Shape;
use gridfall_core::sim::collider::{FLAT_HALF_EXTENT, Primitive, Sdf, SdfOp, axis_angle, rotate};
use gridfall_core::sim::particles::IDENTITY;

/// A vector of the scene's dimension as three components, missing ones zero.
pub fn vector3(v: &[f64]) -> [f64; 3] {
    std::array::from_fn(|a| v.get(a).copied().unwrap_or(0.0))
}

/// The signed distance program of a valid shape.
pub fn sdf(shape: &Shape, dimension: usize) -> Sdf {
    let mut ops = Vec::new();
    let world = Frame { scale: 1.0, rotation: IDENTITY, translation: [0.0; 3] };
    compile(shape, &world, dimension, &mut ops);
    Sdf { ops }
}

/// A placement: x_world = scale rotation x_local + translation.
struct Frame {
    scale: f64,
    rotation: [f64; 9],
    translation: [f64; 3],
}

impl Frame {
    /// The frame of something placed at `translation` with `rotation` inside this one.
    fn then(&self, rotation: &[f64; 9], translation: [f64; 3]) -> Self {
        let t = rotate(&self.rotation, translation.map(|t| self.scale * t));
        Self {
            scale: self.scale,
            rotation: product(&self.rotation, rotation),
            translation: std::array::from_fn(|a| self.translation[a] + t[a]),
        }
    }

    fn primitive(&self, primitive: Primitive) -> SdfOp {
        let (rotation, translation) = (transposed(&self.rotation), self.translation);
        SdfOp::Primitive { primitive: primitive.scaled(self.scale), rotation, translation }
    }
}

fn compile(shape: &Shape, frame: &Frame, dimension: usize, ops: &mut Vec<SdfOp>) {
    let place = |center: [f64; 3], axis: [f64; 3]| frame.then(&basis_to(axis), center);
    match shape {
        Shape::Box { min, max } => {
            let (min, max) = (vector3(min), vector3(max));
            let mut half: [f64; 3] = std::array::from_fn(|a| 0.5 * (max[a] - min[a]));
            if dimension == 2 {
                half[2] = FLAT_HALF_EXTENT;
            }
            let center = std::array::from_fn(|a| 0.5 * (min[a] + max[a]));
            ops.push(frame.then(&IDENTITY, center).primitive(Primitive::Box(half)));
        }
        Shape::Sphere { center, radius } => {
            ops.push(frame.then(&IDENTITY, vector3(center)).primitive(Primitive::Sphere(*radius)));
        }
        Shape::Cylinder { center, axis, radius, height } => {
            ops.push(place(vector3(center), vector3(axis)).primitive(Primitive::Cylinder(*radius, 0.5 * height)));
        }
        Shape::Capsule { center, axis, radius, height } => {
            ops.push(place(vector3(center), vector3(axis)).primitive(Primitive::Capsule(*radius, 0.5 * height)));
        }
        Shape::Cone { base, axis, radius, top_radius, height } => {
            let frame = place(vector3(base), vector3(axis)).then(&IDENTITY, [0.0, 0.0, 0.5 * height]);
            ops.push(frame.primitive(Primitive::Cone(*radius, *top_radius, 0.5 * height)));
        }
        Shape::Torus { center, axis, major_radius, minor_radius } => {
            ops.push(place(vector3(center), vector3(axis)).primitive(Primitive::Torus(*major_radius, *minor_radius)));
        }
        Shape::HalfSpace { point, normal } => {
            ops.push(place(vector3(point), vector3(normal)).primitive(Primitive::HalfSpace));
        }
        Shape::Heightfield { field, .. } | Shape::Mesh { field, .. } => {
            let field = field.clone().expect("scene::resolve samples the shapes of every scene that is valid");
            ops.push(frame.primitive(Primitive::Grid(field, 1.0)));
        }
        Shape::Union(shapes) => combine(shapes, SdfOp::Union, frame, dimension, ops),
        Shape::Intersection(shapes) => combine(shapes, SdfOp::Intersection, frame, dimension, ops),
        Shape::Difference(shapes) => combine(shapes, SdfOp::Difference, frame, dimension, ops),
        Shape::Translate { offset, shape } => compile(shape, &frame.then(&IDENTITY, vector3(offset)), dimension, ops),
        Shape::Rotate { axis, angle_degrees, center, shape } => {
            let turn = axis_angle(unit(vector3(axis)), angle_degrees.to_radians());
            let center = center.as_deref().map_or([0.0; 3], vector3);
            let turned = rotate(&turn, center);
            compile(shape, &frame.then(&turn, std::array::from_fn(|a| center[a] - turned[a])), dimension, ops);
        }
        Shape::Scale { factor, center, shape } => {
            let center = center.as_deref().map_or([0.0; 3], vector3);
            let moved = frame.then(&IDENTITY, center.map(|c| (1.0 - factor) * c));
            compile(shape, &Frame { scale: factor * frame.scale, ..moved }, dimension, ops);
        }
        Shape::Shell { thickness, shape } => {
            compile(shape, frame, dimension, ops);
            ops.push(SdfOp::Shell(frame.scale * thickness));
        }
    }
}

/// Left fold of an operation. The operands of union and intersection may trade places, the deepest first to keep the stack low.
fn combine(shapes: &[Shape], op: SdfOp, frame: &Frame, dimension: usize, ops: &mut Vec<SdfOp>) {
    let mut operands: Vec<Vec<SdfOp>> = Vec::with_capacity(shapes.len());
    for shape in shapes {
        let mut operand = Vec::new();
        compile(shape, frame, dimension, &mut operand);
        operands.push(operand);
    }
    if op != SdfOp::Difference {
        operands.sort_by_key(|ops| std::cmp::Reverse(Sdf { ops: ops.clone() }.stack_depth()));
    }
    for (n, operand) in operands.into_iter().enumerate() {
        ops.extend(operand);
        if n > 0 {
            ops.push(op.clone());
        }
    }
}

/// A rotation that takes z to the direction of `axis` (Duff et al. 2017, Building an orthonormal basis, revisited).
fn basis_to(axis: [f64; 3]) -> [f64; 9] {
    let [x, y, z] = unit(axis);
    let sign = 1f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [1.0 + sign * x * x * a, b, x, sign * b, sign + y * y * a, y, -sign * x, -y, z]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
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
