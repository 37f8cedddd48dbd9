//! Meshes of a scene: read, mended, sampled, and compared with what their faces enclose.

use std::sync::Arc;

use gridfall_core::sim::collider::DistanceField;
use gridfall_core::sim::notice::Notice;

use super::Resolver;
use crate::assets::Source;
use crate::fault::join;
use crate::mesh::{self, Mended, TriangleMesh, filled_volume};
use crate::schema::Fill;

/// Share of a mesh's volume by which its file's numbers may be off, and by which the filled volume
/// may differ without a word.
const TOLERATED: f64 = 0.01;

/// Share of a mesh's volume that is left where its shape is lost.
const LOST: f64 = 0.5;

impl Resolver<'_> {
    pub(super) fn mesh(&mut self, source: Source, fill: Fill, spacing: f64, at: &str) -> Option<Arc<DistanceField>> {
        let file = source.key();
        let is_sheet = fill == Fill::Sheet;
        let key = (file.clone(), fill, spacing.to_bits());
        let place = join(at, source.field());
        let file = (file, is_sheet);
        if let Some(field) = self.sampled.get(&key) {
            return Some(field.clone());
        }
        let mesh = match self.meshes.get(&file) {
            Some(mesh) => mesh.clone(),
            None if is_sheet => self.read_sheet(source, at),
            None => self.read_mesh(source, at),
        };
        self.meshes.insert(file, mesh.clone());
        let Some(mended) = mesh else {
            // The fault is that of the first shape that names the file.
            self.faults.spoil(at);
            return None;
        };
        if fill == Fill::Watertight {
            let (open, edges) = mended.open;
            if open > 0 {
                let reason = format!(
                    "the mesh is not closed: {open} of its {edges} edges are open, \
                     or have faces that disagree about the outside"
                );
                let remedy = "close its holes (in Blender: Select Non Manifold, then Fill), \
                              or add \"fill\": \"winding-number\" to have them closed";
                self.faults.add(at, "not_watertight", reason, format!("{remedy}{}", or_sheet(at)));
                return None;
            }
        }
        if is_sheet {
            self.precise_sheet(&mended.mesh, spacing, &place)?;
        }
        let field = self.sample(&mended.mesh, fill, spacing, at)?;
        if !is_sheet {
            self.compare(&mended, &field, at)?;
        }
        self.sampled.insert(key, field.clone());
        Some(field)
    }

    fn read(&mut self, source: Source, at: &str) -> Option<TriangleMesh> {
        let bytes = self.bytes(source, at)?;
        let bad = |error: mesh::MeshError| {
            let reason = format!("the mesh cannot be used: {}", error.0);
            let remedy = "export it anew as STL, OBJ, PLY or glTF, with triangles";
            self.faults.add(&join(at, source.field()), "bad_mesh", reason, remedy);
        };
        mesh::read(&bytes).map_err(bad).ok()
    }

    fn read_sheet(&mut self, source: Source, at: &str) -> Option<Arc<Mended>> {
        let mended = mesh::mend_sheet(self.read(source, at)?);
        let area: f64 = (0..mended.mesh.triangles.len()).map(|n| mended.mesh.area(n)).sum();
        if area.is_nan() || area <= 0.0 {
            let remedy = "export it anew, with triangles";
            self.faults.add(&join(at, source.field()), "bad_mesh", "the mesh has no area", remedy);
            return None;
        }
        self.resolved.notices.extend(notices(&mended, at));
        Some(Arc::new(mended))
    }

    fn read_mesh(&mut self, source: Source, at: &str) -> Option<Arc<Mended>> {
        let mesh = self.read(source, at)?;
        let place = join(at, source.field());
        let room = mesh.box_volume();
        if room > 0.0 {
            // A mesh that is rounded so far may have any other fault as well, but for this reason.
            self.precise(&mesh, room, &place)?;
        }
        let Ok(mended) = mesh::mend(mesh) else {
            let reason = "its faces cannot agree about the outside: a way around it ends on the other side, \
                          as on a Möbius strip";
            let remedy = format!("rebuild the faces there, so that they bound a solid{}", or_sheet(at));
            self.faults.add(&place, "not_orientable", reason, remedy);
            return None;
        };
        let volume = mended.nesting.volume;
        if volume <= 0.0 {
            let reason = "the mesh encloses no volume";
            let remedy = format!("give it thickness; a sheet is no solid{}", or_sheet(at));
            self.faults.add(&place, "bad_mesh", reason, remedy);
            return None;
        }
        self.precise(&mended.mesh, volume, &place)?;
        self.resolved.notices.extend(notices(&mended, at));
        Some(Arc::new(mended))
    }

    /// Refuses a mesh of this volume (m³) if the numbers of its file are too coarse for its shape.
    fn precise(&mut self, mesh: &TriangleMesh, volume: f64, at: &str) -> Option<()> {
        let rounding = mesh.rounding();
        if rounding <= TOLERATED * volume {
            return Some(());
        }
        let coarsest = (0..3).max_by(|&a, &b| mesh.resolution[a].total_cmp(&mesh.resolution[b])).unwrap_or(0);
        let reason = format!(
            "the file's numbers have eaten the shape: {}; the volume may be off by {:.0} %",
            steps(mesh, coarsest),
            (100.0 * rounding / volume).min(100.0).ceil()
        );
        let remedy = "move the model to the origin before exporting it, and to its place by `translate`; \
                      or export OBJ, or PLY with doubles";
        self.faults.add(at, "imprecise_mesh", reason, remedy);
        None
    }

    /// Refuses a sheet whose faces may be off by a share of the distance between samples (m).
    fn precise_sheet(&mut self, mesh: &TriangleMesh, spacing: f64, at: &str) -> Option<()> {
        let coarse = (0..3).find(|&a| 0.5 * mesh.resolution[a] > TOLERATED * spacing);
        let Some(coarsest) = coarse else { return Some(()) };
        let reason = format!("the file's numbers are too coarse for its faces: {}", steps(mesh, coarsest));
        let remedy = "move the model to the origin before exporting it, and to its place by `translate`; \
                      or export OBJ, or PLY with doubles";
        self.faults.add(at, "imprecise_mesh", reason, remedy);
        None
    }

    /// Compares what is filled with what the faces enclose.
    fn compare(&mut self, mended: &Mended, field: &DistanceField, at: &str) -> Option<()> {
        let (filled, enclosed) = (filled_volume(field), mended.nesting.volume);
        let off = filled / enclosed - 1.0;
        if off.abs() <= TOLERATED {
            return Some(());
        }
        let mut reason = format!(
            "the filled volume is {:.1} % {} than what the faces enclose: {filled:.4e} m³ against {enclosed:.4e} m³",
            100.0 * off.abs(),
            if off > 0.0 { "larger" } else { "smaller" }
        );
        let crossing = mended.nesting.crossing > 0;
        let closed = mended.open.0 == 0;
        if closed && !crossing && !(LOST..1.0 / LOST).contains(&(filled / enclosed)) {
            reason += &format!("; its parts are too fine for samples every {} m", field.spacing);
            self.faults.add(at, "shape_lost", reason, "lower dx, or thicken the thin parts");
            return None;
        }
        let remedy = match (closed, crossing) {
            (true, false) => "lower dx if that matters: thin parts, edges and corners are rounded by a share of dx",
            (true, true) => "unite the parts that cross (in Blender: Boolean, Union) if that is not what they share",
            (false, _) => "close the holes; a winding number bulges over large ones, where the faces are cut off flat",
        };
        self.notice(at, "volume_differs", reason, remedy);
        Some(())
    }

    fn notice(&mut self, at: &str, code: &str, reason: String, remedy: &str) {
        let (pointer, code, remedy) = (at.to_owned(), code.to_owned(), remedy.to_owned());
        self.resolved.notices.push(Notice { pointer, code, reason, remedy });
    }
}

/// The remedy that colliders have, too.
fn or_sheet(at: &str) -> &'static str {
    if !at.starts_with("/colliders/") {
        return "";
    }
    "; or add \"fill\": \"sheet\": a collider may be a sheet, which has no inside and two sides"
}

/// How coarse a mesh's numbers are along an axis.
fn steps(mesh: &TriangleMesh, axis: usize) -> String {
    let (name, reach) = (["x", "y", "z"][axis], mesh.largest()[axis]);
    format!("{name} reaches {reach:.3e} m, where f32 has steps of {:.1e} m", mesh.resolution[axis])
}

/// What was mended, and what may be meant otherwise.
fn notices(mended: &Mended, at: &str) -> Vec<Notice> {
    let nesting = &mended.nesting;
    let all = mended.mesh.triangles.len();
    let some = |n: usize, one: &str, many: &str| match n {
        0 => None,
        1 => Some(format!("1 {one}")),
        _ => Some(format!("{n} {many}")),
    };
    let of = |all: usize, what: &str| format!("of {all} {what}");
    let done: Vec<String> = [
        some(mended.duplicates, "duplicate face was taken out", "duplicate faces were taken out"),
        some(mended.seams, "T-junction was closed", "T-junctions were closed"),
        some(mended.faces, &of(all, "faces was turned"), &of(all, "faces were turned"))
            .map(|faces| format!("{faces} to agree with the neighbours about the outside")),
        some(nesting.turned, &of(mended.parts, "parts was inside out"), &of(mended.parts, "parts were inside out"))
            .map(|parts| format!("{parts}, now turned")),
    ]
    .into_iter()
    .flatten()
    .collect();
    let notice = |code: &str, reason: String, remedy: &str| Notice {
        pointer: at.to_owned(),
        code: code.to_owned(),
        reason,
        remedy: remedy.to_owned(),
    };
    let repair = "repair it in the program that made it, if this is not what was meant";
    let mut notices = Vec::new();
    if !done.is_empty() {
        let reason = format!("the mesh was mended: {}", done.join(", "));
        notices.push(notice("mended_mesh", reason, repair));
    }
    if let Some(parts) = some(nesting.swallowed, "closed part lies", "closed parts lie") {
        let reason = format!("{parts} inside another and faces the same way: filled like the part around");
        notices.push(notice("nested_part", reason, "turn its faces around if it is to be a hollow"));
    }
    notices
}
