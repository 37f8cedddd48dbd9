//! Meaning of shapes: lengths, radii, axes, and whether the program fits the evaluator.

use gridfall_core::sim::collider::SDF_STACK;

use crate::fault::join;
use crate::schema::{Fill, Shape};
use crate::validate::check::Check;

/// Most primitives and operations of one shape.
const MAX_OPS: usize = 4096;

/// Judges a whole shape.
pub fn check_shape(check: &mut Check, at: &str, shape: &Shape) {
    check_part(check, at, shape);
    if !(check.has_dimension() && check.faults.clean(at)) {
        return;
    }
    let sdf = check.sdf(at, shape);
    if sdf.ops.len() > MAX_OPS {
        let reason = format!("the shape has {} parts; {MAX_OPS} is the most", sdf.ops.len());
        check.fault(at, "too_complex", reason, "split it into several bodies or colliders");
    } else if sdf.stack_depth() > SDF_STACK {
        let reason = format!("differences are nested {} deep; {SDF_STACK} is the most", sdf.stack_depth());
        check.fault(at, "too_deep", reason, "subtract the parts one after another in a single difference");
    }
}

/// Judges a shape that is filled or held: it has no sheet.
pub fn check_solid(check: &mut Check, at: &str, shape: &Shape) {
    check_shape(check, at, shape);
    let remedy = "sheets are for colliders; write `watertight` or `winding-number`, or give it thickness";
    no_sheet(check, at, shape, "a sheet has no inside to be filled or held", remedy);
}

/// Refuses a sheet in a shape.
fn no_sheet(check: &mut Check, at: &str, shape: &Shape, reason: &str, remedy: &str) {
    if let Some(at) = sheet_in(at, shape) {
        check.fault(&at, "needs_inside", reason, remedy);
    }
}

/// The first `fill` of a shape that makes a sheet of a mesh.
pub fn sheet_in(at: &str, shape: &Shape) -> Option<String> {
    let at = join(at, shape.key());
    match shape {
        Shape::Mesh { fill: Fill::Sheet, .. } => Some(join(&at, "fill")),
        Shape::Union(shapes) | Shape::Intersection(shapes) | Shape::Difference(shapes) => {
            shapes.iter().enumerate().find_map(|(n, shape)| sheet_in(&join(&at, n), shape))
        }
        Shape::Translate { shape, .. }
        | Shape::Rotate { shape, .. }
        | Shape::Scale { shape, .. }
        | Shape::Shell { shape, .. } => sheet_in(&join(&at, "shape"), shape),
        _ => None,
    }
}

fn check_part(check: &mut Check, at: &str, shape: &Shape) {
    let key = shape.key();
    let at = join(at, key);
    let field = |name: &str| join(&at, name);
    if shape.is_solid_only() && check.has_dimension() && check.dimension == 2 {
        let reason = format!("a {key} needs three dimensions");
        check.fault(&at, "needs_3d", reason, "in 2D write its cross-section from boxes and spheres");
        return;
    }
    match shape {
        Shape::Box { min, max } => {
            check.vector(&field("min"), min);
            check.vector(&field("max"), max);
            if check.has_dimension() && check.faults.clean(&at) {
                for a in 0..check.dimension {
                    if max[a] <= min[a] {
                        let reason = format!("max {} is not above min {}", max[a], min[a]);
                        check.fault(&join(&field("max"), a), "empty", reason, "write a larger max");
                    }
                }
            }
        }
        Shape::Sphere { center, radius } => {
            check.vector(&field("center"), center);
            check.positive(&field("radius"), *radius, "the radius");
        }
        Shape::Cylinder { center, axis, radius, height } | Shape::Capsule { center, axis, radius, height } => {
            check.vector(&field("center"), center);
            direction(check, &field("axis"), axis);
            check.positive(&field("radius"), *radius, "the radius");
            check.positive(&field("height"), *height, "the height");
        }
        Shape::Cone { base, axis, radius, top_radius, height } => {
            check.vector(&field("base"), base);
            direction(check, &field("axis"), axis);
            check.positive(&field("radius"), *radius, "the radius");
            check.not_negative(&field("top_radius"), *top_radius, "the radius at the top");
            check.positive(&field("height"), *height, "the height");
        }
        Shape::Torus { center, axis, major_radius, minor_radius } => {
            check.vector(&field("center"), center);
            direction(check, &field("axis"), axis);
            check.positive(&field("major_radius"), *major_radius, "the major radius");
            check.positive(&field("minor_radius"), *minor_radius, "the minor radius");
        }
        Shape::HalfSpace { point, normal } => {
            check.vector(&field("point"), point);
            direction(check, &field("normal"), normal);
        }
        Shape::Heightfield { min, max, base, heights } => {
            heightfield(check, &at, [min, max], *base, heights);
            sampled(check, &at);
        }
        Shape::Mesh { asset, file, .. } => {
            if asset.is_some() == file.is_some() {
                let reason = if asset.is_some() { "`asset` is given beside `file`" } else { "the mesh is missing" };
                let remedy = "give one of `asset`, an upload's id, and `file`, a path (command line only)";
                check.fault(&at, "not_one_source", reason, remedy);
            }
            sampled(check, &at);
        }
        Shape::Union(shapes) => several(check, &at, key, shapes, 1),
        Shape::Intersection(shapes) => {
            several(check, &at, key, shapes, 1);
            let mut sheets = shapes.iter().enumerate().filter_map(|(n, shape)| sheet_in(&join(&at, n), shape));
            if let (Some(_), Some(at)) = (sheets.next(), sheets.next()) {
                let remedy = "unite them, or give one of them an inside";
                check.fault(&at, "needs_inside", "two sheets have no more than a line in common", remedy);
            }
        }
        Shape::Difference(shapes) => {
            several(check, &at, key, shapes, 2);
            for (n, shape) in shapes.iter().enumerate().skip(1) {
                let remedy = "list the sheet first to cut it, or give it an inside";
                no_sheet(check, &join(&at, n), shape, "a sheet has no inside to be taken away", remedy);
            }
        }
        Shape::Translate { offset, shape } => {
            check.vector(&field("offset"), offset);
            check_part(check, &field("shape"), shape);
        }
        Shape::Rotate { axis, angle_degrees, center, shape } => {
            // The default axis is z, the only one in 2D.
            if check.dimension == 2 && check.has_dimension() {
                if !(axis.len() == 3 && axis[0] == 0.0 && axis[1] == 0.0 && axis[2] != 0.0) {
                    check.fault(&field("axis"), "needs_3d", "in 2D there is only one axis", "take `axis` out");
                }
            } else {
                direction(check, &field("axis"), axis);
            }
            check.finite(&field("angle_degrees"), *angle_degrees);
            if let Some(center) = center {
                check.vector(&field("center"), center);
            }
            check_part(check, &field("shape"), shape);
        }
        Shape::Scale { factor, center, shape } => {
            check.positive(&field("factor"), *factor, "the factor");
            if let Some(center) = center {
                check.vector(&field("center"), center);
            }
            check_part(check, &field("shape"), shape);
        }
        Shape::Shell { thickness, shape } => {
            check.positive(&field("thickness"), *thickness, "the thickness");
            check_part(check, &field("shape"), shape);
            let reason = "a shell lies inside its shape, and a sheet has no inside";
            no_sheet(check, &field("shape"), shape, reason, "take the shell out: a sheet has two sides by itself");
        }
    }
}

/// What depends on a shape that was not sampled cannot be judged; the reason for that is a fault of
/// its own.
fn sampled(check: &mut Check, at: &str) {
    if !check.resolved.fields.contains_key(at) {
        check.faults.spoil(at);
    }
}

fn heightfield(check: &mut Check, at: &str, [min, max]: [&[f64]; 2], base: f64, heights: &[Vec<f64>]) {
    check.finite(&join(at, "base"), base);
    if !check.has_dimension() {
        return;
    }
    let axes = check.dimension - 1;
    check.vector_of(&join(at, "min"), min, axes);
    check.vector_of(&join(at, "max"), max, axes);
    if check.faults.clean(&join(at, "min")) && check.faults.clean(&join(at, "max")) {
        for a in 0..axes {
            if max[a] <= min[a] {
                let reason = format!("max {} is not above min {}", max[a], min[a]);
                check.fault(&join(&join(at, "max"), a), "empty", reason, "write a larger max");
            }
        }
    }
    let at = join(at, "heights");
    let rows = if axes == 1 { 1..=1 } else { 2..=usize::MAX };
    if !rows.contains(&heights.len()) {
        let remedy = if axes == 1 { "in 2D write one row, along x" } else { "write at least 2 rows of at least 2" };
        check.fault(&at, "wrong_length", format!("{} rows of heights", heights.len()), remedy);
        return;
    }
    for (j, row) in heights.iter().enumerate() {
        let at = join(&at, j);
        if row.len() < 2 || row.len() != heights[0].len() {
            let reason = format!("a row of {} heights; the first has {}", row.len(), heights[0].len());
            check.fault(&at, "wrong_length", reason, "write rows of the same length, at least 2");
        }
        for (i, height) in row.iter().enumerate() {
            if check.finite(&join(&at, i), *height) && *height < base {
                let reason = format!("the height {height} is below the base {base}");
                check.fault(&join(&at, i), "below_base", reason, "raise it or lower the base");
            }
        }
    }
}

fn several(check: &mut Check, at: &str, key: &str, shapes: &[Shape], least: usize) {
    if shapes.len() < least {
        let reason = format!("a {key} of {} shapes", shapes.len());
        check.fault(at, "too_few_shapes", reason, format!("list at least {least}"));
    }
    for (n, shape) in shapes.iter().enumerate() {
        check_part(check, &join(at, n), shape);
    }
}

/// Judges a direction, a vector that is not zero.
pub fn direction(check: &mut Check, at: &str, v: &[f64]) {
    check.vector(at, v);
    if check.faults.clean(at) && v.iter().all(|a| *a == 0.0) {
        check.fault(at, "zero_vector", "a direction of length zero", "write a vector that is not zero");
    }
}
