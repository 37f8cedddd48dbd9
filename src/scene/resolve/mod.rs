//! What a document only refers to: files are read, and the signed distances of shapes without a
//! closed form are sampled, before a scene is judged as a whole.

mod meshes;

use std::collections::HashMap;
use std::sync::Arc;

use gridfall_core::sim::collider::DistanceField;
use gridfall_core::sim::notice::Notice;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::source::Effort;

use crate::assets::{Assets, Refusal, Source};
use crate::fault::{Faults, join};
use crate::limits::Limits;
use crate::mesh::{MAX_SAMPLES, Mended, Plan, TriangleMesh, heightfield};
use crate::schema::{Fill, Points, Scene, Shape, Start};
use crate::shape::Fields;
use crate::{points, state};

/// What sampling meshes and heightfields may take, in parts of [`Limits::max_work`]: enough for one of a
/// hundred cells in each direction.
const SAMPLING: u64 = 4;

/// Samples of a field along a cell of the grid.
const SAMPLES_PER_CELL: f64 = 2.0;

/// What files and sampled shapes add to a scene document. Both tables are keyed by the JSON pointer
/// of the value that refers to the data, and lack an entry where that value is at fault.
#[derive(Debug, Default)]
pub(crate) struct Resolved {
    /// Signed distances of heightfields and meshes.
    pub fields: Fields,
    /// Particles of bodies, by the pointer of their `points`.
    pub points: HashMap<String, points::Points>,
    /// What the run begins with, if the scene has a `start`.
    pub start: Option<Particles>,
    /// What was mended, and what may not be what the user meant.
    pub notices: Vec<Notice>,
}

/// Reads every file of a scene and samples every heightfield and mesh. What fails for reasons that
/// are not in the document becomes a fault here; faults of the document are left to validation.
pub(crate) fn resolve(scene: &Scene, limits: &Limits, assets: &dyn Assets, faults: &mut Faults) -> Resolved {
    let dx = scene.domain.dx;
    if !((2..=3).contains(&scene.dimension) && dx > 0.0 && dx.is_finite()) {
        return Resolved::default();
    }
    let mut resolver = Resolver {
        dimension: scene.dimension as usize,
        assets,
        faults,
        memory_bytes: limits.max_memory_bytes,
        effort: Effort::at_most(limits.max_work.saturating_mul(SAMPLING)),
        meshes: HashMap::new(),
        sampled: HashMap::new(),
        resolved: Resolved::default(),
    };
    let spacing = dx / SAMPLES_PER_CELL;
    for (n, body) in scene.bodies.iter().enumerate() {
        if let Some(shape) = &body.shape {
            resolver.shape(shape, &format!("/bodies/{n}/shape"), spacing);
        }
        for (k, grip) in body.grips.iter().enumerate() {
            resolver.shape(&grip.shape, &format!("/bodies/{n}/grips/{k}/shape"), spacing);
        }
        if let Some(points) = &body.points {
            resolver.points(points, format!("/bodies/{n}/points"));
        }
    }
    for (n, source) in scene.sources.iter().enumerate() {
        resolver.shape(&source.shape, &format!("/sources/{n}/shape"), spacing);
    }
    for (n, collider) in scene.colliders.iter().enumerate() {
        resolver.shape(&collider.shape, &format!("/colliders/{n}/shape"), spacing);
    }
    if let Some(start) = &scene.start {
        resolver.start(start);
    }
    resolver.resolved
}

/// The field that names a file (`asset` or `file`), and the file's name.
type FileKey = (&'static str, String);

struct Resolver<'a> {
    dimension: usize,
    assets: &'a dyn Assets,
    faults: &'a mut Faults,
    /// Memory left for samples (bytes).
    memory_bytes: u64,
    /// The work of sampling.
    effort: Effort,
    /// Meshes read and mended so far, as solids or as sheets; none where the file is at fault.
    meshes: HashMap<(FileKey, bool), Option<Arc<Mended>>>,
    /// Fields of meshes sampled so far, by file, filling and spacing (as bits).
    sampled: HashMap<(FileKey, Fill, u64), Arc<DistanceField>>,
    resolved: Resolved,
}

impl Resolver<'_> {
    /// `spacing` is the distance between samples in the shape's own coordinates (m).
    fn shape(&mut self, shape: &Shape, at: &str, spacing: f64) {
        let at = join(at, shape.key());
        match shape {
            Shape::Union(shapes) | Shape::Intersection(shapes) | Shape::Difference(shapes) => {
                for (n, shape) in shapes.iter().enumerate() {
                    self.shape(shape, &join(&at, n), spacing);
                }
            }
            Shape::Translate { shape, .. } | Shape::Rotate { shape, .. } | Shape::Shell { shape, .. } => {
                self.shape(shape, &join(&at, "shape"), spacing);
            }
            Shape::Scale { factor, shape, .. } => {
                let spacing = spacing / *factor;
                if spacing > 0.0 && spacing.is_finite() {
                    self.shape(shape, &join(&at, "shape"), spacing);
                }
            }
            Shape::Heightfield { min, max, base, heights } => {
                let solid = match self.dimension {
                    2 => heightfield::section(min, max, *base, heights),
                    _ => heightfield::solid(min, max, *base, heights),
                };
                let field = solid.and_then(|mesh| self.sample(&mesh, Fill::Watertight, spacing, &at));
                self.resolved.fields.extend(field.map(|field| (at, field)));
            }
            Shape::Mesh { asset, file, fill } if self.dimension == 3 => {
                let source = Source::of(asset, file);
                let field = source.and_then(|source| self.mesh(source, *fill, spacing, &at));
                self.resolved.fields.extend(field.map(|field| (at, field)));
            }
            Shape::Mesh { .. }
            | Shape::Box { .. }
            | Shape::Sphere { .. }
            | Shape::Cylinder { .. }
            | Shape::Capsule { .. }
            | Shape::Cone { .. }
            | Shape::Torus { .. }
            | Shape::HalfSpace { .. } => {}
        }
    }

    fn points(&mut self, points: &Points, at: String) {
        let Some(source) = Source::of(&points.asset, &points.file) else { return };
        let Some(bytes) = self.bytes(source, &at) else { return };
        match points::read(&bytes, self.dimension) {
            Ok(points) => drop(self.resolved.points.insert(at, points)),
            Err(error) => {
                let reason = format!("the points cannot be used: {error}");
                let remedy = "write a PLY with x, y, z, or an npz with `x` (n × d), and `v`, `F`, `volume` if wanted";
                self.faults.add(&join(&at, source.field()), "bad_points", reason, remedy);
            }
        }
    }

    fn start(&mut self, start: &Start) {
        let Some(source) = Source::of(&start.asset, &start.file) else { return };
        let Some(bytes) = self.bytes(source, "/start") else { return };
        match state::read(&bytes, self.dimension) {
            Ok(particles) => self.resolved.start = Some(particles),
            Err(error) => {
                let reason = format!("the state cannot be used: {error}");
                let remedy = "take the state that a run with \"output\": {\"state\": true} of as many dimensions left";
                self.faults.add(&join("/start", source.field()), "bad_state", reason, remedy);
            }
        }
    }

    fn bytes(&mut self, source: Source, at: &str) -> Option<Vec<u8>> {
        let refused = |refusal: Refusal| {
            self.faults.add(&join(at, source.field()), refusal.code, refusal.reason, refusal.remedy);
        };
        self.assets.read(source).map_err(refused).ok()
    }

    fn sample(&mut self, mesh: &TriangleMesh, fill: Fill, spacing: f64, at: &str) -> Option<Arc<DistanceField>> {
        let plan = Plan::new(mesh, spacing, self.dimension);
        let samples = plan.samples();
        if samples > MAX_SAMPLES {
            let reason = format!("at half a dx the shape takes {samples} samples; {MAX_SAMPLES} is the most");
            self.faults.add(at, "too_large", reason, "raise dx, or scale the shape down");
            return None;
        }
        // Distances, and while they are made their triangles, what is exact and regions.
        let bytes = 17 * samples;
        if bytes > self.memory_bytes {
            let reason = format!("the shape's samples take {} MiB, more than is left of the limit", bytes >> 20);
            self.faults.add(at, "too_much_memory", reason, "raise dx, or scale the shape down");
            return None;
        }
        self.memory_bytes -= 4 * samples;
        let field = plan.sample(mesh, fill, &self.effort);
        if field.is_none() {
            let reason = format!(
                "sampling it takes too much work: it has {} triangles, and at half a dx {samples} samples",
                mesh.triangles.len()
            );
            let remedy = "raise dx, scale the shape down, or simplify it; \
                          `gridfall run` has no such limit, and the server's is --max-work";
            self.faults.add(at, "too_costly", reason, remedy);
        }
        field.map(Arc::new)
    }
}
