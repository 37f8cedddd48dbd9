//! Shapes to signed distance programs. Placements and factors of scale are folded into the
//! primitives, so that their distances stay exact.

mod placement;

use std::collections::HashMap;
use std::sync::Arc;

use gridfall_core::sim::collider::{DistanceField, FLAT_HALF_EXTENT, Primitive, Sdf, SdfOp, axis_angle, rotate};

use crate::fault::join;
use crate::schema::Shape;
use crate::vectors::vector3;
use placement::{Placement, unit};

/// Sampled signed distances of heightfields and meshes, by the JSON pointer of the heightfield or
/// mesh in the document.
pub(crate) type Fields = HashMap<String, Arc<DistanceField>>;

/// The signed distance program of a valid shape, whose JSON pointer is `at`.
pub(crate) fn sdf(shape: &Shape, at: &str, fields: &Fields, dimension: usize) -> Sdf {
    let mut ops = Vec::new();
    Compiler { fields, dimension }.compile(shape, at, &Placement::world(), &mut ops);
    Sdf { ops }
}

struct Compiler<'a> {
    fields: &'a Fields,
    dimension: usize,
}

impl Compiler<'_> {
    fn compile(&self, shape: &Shape, at: &str, placement: &Placement, ops: &mut Vec<SdfOp>) {
        let at = join(at, shape.key());
        let part_at = join(&at, "shape");
        let along = |axis: &[f64], center: &[f64]| placement.along(vector3(axis), vector3(center));
        match shape {
            Shape::Box { min, max } => {
                let (min, max) = (vector3(min), vector3(max));
                let mut half: [f64; 3] = std::array::from_fn(|a| 0.5 * (max[a] - min[a]));
                if self.dimension == 2 {
                    half[2] = FLAT_HALF_EXTENT;
                }
                let center = std::array::from_fn(|a| 0.5 * (min[a] + max[a]));
                ops.push(placement.moved(center).primitive(Primitive::Box(half)));
            }
            Shape::Sphere { center, radius } => {
                ops.push(placement.moved(vector3(center)).primitive(Primitive::Sphere(*radius)));
            }
            Shape::Cylinder { center, axis, radius, height } => {
                ops.push(along(axis, center).primitive(Primitive::Cylinder(*radius, 0.5 * height)));
            }
            Shape::Capsule { center, axis, radius, height } => {
                ops.push(along(axis, center).primitive(Primitive::Capsule(*radius, 0.5 * height)));
            }
            Shape::Cone { base, axis, radius, top_radius, height } => {
                let middle = along(axis, base).moved([0.0, 0.0, 0.5 * height]);
                ops.push(middle.primitive(Primitive::Cone(*radius, *top_radius, 0.5 * height)));
            }
            Shape::Torus { center, axis, major_radius, minor_radius } => {
                ops.push(along(axis, center).primitive(Primitive::Torus(*major_radius, *minor_radius)));
            }
            Shape::HalfSpace { point, normal } => ops.push(along(normal, point).primitive(Primitive::HalfSpace)),
            Shape::Heightfield { .. } | Shape::Mesh { .. } => {
                let field = self.fields.get(&at).expect("`resolve` samples the shapes of every valid scene");
                ops.push(placement.primitive(Primitive::Grid(field.clone(), 1.0)));
            }
            Shape::Union(shapes) => self.combine(shapes, SdfOp::Union, &at, placement, ops),
            Shape::Intersection(shapes) => self.combine(shapes, SdfOp::Intersection, &at, placement, ops),
            Shape::Difference(shapes) => self.combine(shapes, SdfOp::Difference, &at, placement, ops),
            Shape::Translate { offset, shape } => {
                self.compile(shape, &part_at, &placement.moved(vector3(offset)), ops);
            }
            Shape::Rotate { axis, angle_degrees, center, shape } => {
                let turn = axis_angle(unit(vector3(axis)), angle_degrees.to_radians());
                let center = center.as_deref().map_or([0.0; 3], vector3);
                let turned = rotate(&turn, center);
                let inner = placement.then(&turn, std::array::from_fn(|a| center[a] - turned[a]));
                self.compile(shape, &part_at, &inner, ops);
            }
            Shape::Scale { factor, center, shape } => {
                let center = center.as_deref().map_or([0.0; 3], vector3);
                let moved = placement.moved(center.map(|c| (1.0 - factor) * c));
                self.compile(shape, &part_at, &moved.scaled(*factor), ops);
            }
            Shape::Shell { thickness, shape } => {
                self.compile(shape, &part_at, placement, ops);
                ops.push(SdfOp::Shell(placement.scale() * thickness));
            }
        }
    }

    /// A left fold of an operation. The order of the operands of a union or an intersection does
    /// not matter: the deepest comes first, which keeps the stack low.
    fn combine(&self, shapes: &[Shape], op: SdfOp, at: &str, placement: &Placement, ops: &mut Vec<SdfOp>) {
        let mut operands: Vec<Vec<SdfOp>> = Vec::with_capacity(shapes.len());
        for (n, shape) in shapes.iter().enumerate() {
            let mut operand = Vec::new();
            self.compile(shape, &join(at, n), placement, &mut operand);
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
}
