//! Shapes without a closed form: files are read, and signed distances are sampled, before a scene is judged as a whole.

use std::collections::HashMap;
use std::sync::Arc;

use crate::Limits;
use crate::assets::{Assets, Refusal, Source};
use crate::fault::{Faults, join};
use crate::mesh::{self, MAX_SAMPLES, Plan, TriangleMesh, heightfield};
use crate::points;
use crate::schema::{Fill, Points, Scene, Shape};
use gridfall_core::sim::collider::Field;

/// Samples of a field along a cell of the grid.
const SAMPLES_PER_CELL: f64 = 2.0;

/// The scene with every heightfield and mesh sampled that can be; why others cannot is among the faults. Faults of the document that
/// are left to validation leave shapes unsampled.
pub fn resolve(scene: &Scene, limits: &Limits, assets: &dyn Assets, faults: &mut Faults) -> Scene {
    let mut scene = scene.clone();
    let dx = scene.domain.dx;
    if !((2..=3).contains(&scene.dimension) && dx > 0.0 && dx.is_finite()) {
        return scene;
    }
    let dimension = scene.dimension as usize;
    let (spacing, most) = (dx / SAMPLES_PER_CELL, limits.max_memory_bytes);
    let mut resolver = Resolver { dimension, assets, faults, most, meshes: HashMap::new(), fields: HashMap::new() };
    for (n, body) in scene.bodies.iter_mut().enumerate() {
        if let Some(shape) = &mut body.shape {
            resolver.shape(shape, &format!("/bodies/{n}/shape"), spacing);
        }
        for (k, grip) in body.grips.iter_mut().enumerate() {
            resolver.shape(&mut grip.shape, &format!("/bodies/{n}/grips/{k}/shape"), spacing);
        }
        if let Some(points) = &mut body.points {
            points.read = resolver.points(points, &format!("/bodies/{n}/points"));
        }
        for (k, grip) in body.grips.iter_mut().enumerate() {
            resolver.shape(&mut grip.shape, &format!("/bodies/{n}/grips/{k}/shape"), spacing);
        }
    }
    for (n, source) in scene.sources.iter_mut().enumerate() {
        resolver.shape(&mut source.shape, &format!("/sources/{n}/shape"), spacing);
    }
    for (n, collider) in scene.colliders.iter_mut().enumerate() {
        resolver.shape(&mut collider.shape, &format!("/colliders/{n}/shape"), spacing);
    }
    scene
}

struct Resolver<'a> {
    dimension: usize,
    assets: &'a dyn Assets,
    faults: &'a mut Faults,
    /// Memory left for samples (bytes).
    most: u64,
    /// By source, whether it is a file, and its text; none after a fault.
    meshes: HashMap<(&'static str, String), Option<Arc<TriangleMesh>>>,
    /// And by filling and spacing.
    fields: HashMap<(&'static str, String, Fill, u64), Arc<Field>>,
}

impl Resolver<'_> {
    /// `spacing`: between samples in the shape's own frame (m).
    fn shape(&mut self, shape: &mut Shape, at: &str, spacing: f64) {
        let mut several = |key: &str, shapes: &mut [Shape]| {
            for (n, shape) in shapes.iter_mut().enumerate() {
                self.shape(shape, &format!("{at}/{key}/{n}"), spacing);
            }
        };
        match shape {
            Shape::Union(shapes) => several("union", shapes),
            Shape::Intersection(shapes) => several("intersection", shapes),
            Shape::Difference(shapes) => several("difference", shapes),
            Shape::Translate { shape, .. } => self.shape(shape, &format!("{at}/translate/shape"), spacing),
            Shape::Rotate { shape, .. } => self.shape(shape, &format!("{at}/rotate/shape"), spacing),
            Shape::Shell { shape, .. } => self.shape(shape, &format!("{at}/shell/shape"), spacing),
            Shape::Scale { factor, shape, .. } => {
                let spacing = spacing / *factor;
                if spacing > 0.0 && spacing.is_finite() {
                    self.shape(shape, &format!("{at}/scale/shape"), spacing);
                }
            }
            Shape::Heightfield { min, max, base, heights, field } => {
                let solid = match self.dimension {
                    2 => heightfield::section(min, max, *base, heights),
                    _ => heightfield::solid(min, max, *base, heights),
                };
                *field = solid.and_then(|mesh| self.sample(&mesh, Fill::Watertight, spacing, &join(at, "heightfield")));
            }
            Shape::Mesh { asset, file, fill, field } if self.dimension == 3 => {
                if let Some(source) = Source::of(asset, file) {
                    *field = self.mesh(source, *fill, spacing, &join(at, "mesh"));
                }
            }
            _ => {}
        }
    }

    fn mesh(&mut self, source: Source, fill: Fill, spacing: f64, at: &str) -> Option<Arc<Field>> {
        let (kind, name) = source.key();
        let key = (kind, name.clone(), fill, spacing.to_bits());
        if let Some(field) = self.fields.get(&key) {
            return Some(field.clone());
        }
        let mesh = match self.meshes.get(&(kind, name.clone())) {
            Some(mesh) => mesh.clone(),
            None => self.read(source, at),
        };
        self.meshes.insert((kind, name), mesh.clone());
        let Some(mut mesh) = mesh else {
            // The first shape that names the file has the fault.
            self.faults.spoil(at);
            return None;
        };
        if fill == Fill::Watertight {
            let (open, edges) = mesh.open_edges();
            if open > 0 {
                let reason = format!(
                    "the mesh is not closed: {open} of its {edges} edges are open, or have faces that disagree about the outside"
                );
                let remedy = "close its holes (in Blender: Select Non Manifold, then Fill), or add \"fill\": \"winding-number\" to have them closed";
                self.faults.add(at, "not_watertight", reason, remedy);
                return None;
            }
        }
        // Some programs write closed meshes inside out.
        if mesh.volume() < 0.0 {
            Arc::make_mut(&mut mesh).flip();
        }
        let field = self.sample(&mesh, fill, spacing, at)?;
        self.fields.insert(key, field.clone());
        Some(field)
    }

    fn points(&mut self, points: &Points, at: &str) -> Option<Arc<points::Points>> {
        let source = Source::of(&points.asset, &points.file)?;
        let bytes = self.bytes(source, at)?;
        match points::read(&bytes, self.dimension) {
            Ok(points) => Some(Arc::new(points)),
            Err(error) => {
                let reason = format!("the points cannot be used: {error}");
                let remedy = "write a PLY with x, y, z, or an npz with `x` (n × d), and `v`, `F`, `volume` if wanted";
                self.faults.add(&join(at, source.field()), "bad_points", reason, remedy);
                None
            }
        }
    }

    fn bytes(&mut self, source: Source, at: &str) -> Option<Vec<u8>> {
        let refused = |refusal: Refusal| {
            self.faults.add(&join(at, source.field()), refusal.code, refusal.reason, refusal.remedy);
        };
        self.assets.read(source).map_err(refused).ok()
    }

    fn read(&mut self, source: Source, at: &str) -> Option<Arc<TriangleMesh>> {
        let bytes = self.bytes(source, at)?;
        let at = join(at, source.field());
        match mesh::read(&bytes) {
            Ok(mesh) => Some(Arc::new(mesh)),
            Err(error) => {
                let reason = format!("the mesh cannot be used: {}", error.0);
                self.faults.add(&at, "bad_mesh", reason, "export it anew as STL, OBJ, PLY or glTF, with triangles");
                None
            }
        }
    }

    fn sample(&mut self, mesh: &TriangleMesh, fill: Fill, spacing: f64, at: &str) -> Option<Arc<Field>> {
        let plan = Plan::new(mesh, spacing, self.dimension);
        let samples = plan.samples();
        if samples > MAX_SAMPLES {
            let reason = format!("at half a dx the shape takes {samples} samples; {MAX_SAMPLES} is the most");
            self.faults.add(at, "too_large", reason, "raise dx, or scale the shape down");
            return None;
        }
        let bytes = 4 * samples;
        if bytes > self.most {
            let reason = format!("the shape's samples take {} MiB, more than is left of the limit", bytes >> 20);
            self.faults.add(at, "too_much_memory", reason, "raise dx, or scale the shape down");
            return None;
        }
        self.most -= bytes;
        Some(Arc::new(plan.sample(mesh, fill)))
    }
}
