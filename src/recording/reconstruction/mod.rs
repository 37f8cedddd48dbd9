//! Surfaces of bodies as triangle meshes, made of the recorded points by
//! [splashsurf](https://github.com/InteractiveComputerGraphics/splashsurf): an SPH density, marching cubes, and a
//! smoothing that leaves thin parts as they are (Löschner et al. 2023, "Weighted Laplacian Smoothing for Surface
//! Reconstruction of Particle-based Fluids").

mod glb;
mod obj;
mod ply;
mod skin;

use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use rayon::prelude::*;
use splashsurf_lib::nalgebra::Vector3;

use crate::appearance::local;
use crate::cloud::Cloud;
use crate::excerpt::select;
use crate::export::ExportError;
use crate::files::{RecordingError, write_atomically};
use crate::frames::FrameIndex;
use crate::palette::{Palette, Rgb};
use crate::scenery::{OtherScene, Scenery};
use gridfall_core::sim::setup::Body;
use skin::Skin;

/// A form of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Wavefront.
    Obj,
    /// Polygon file format, binary and little-endian.
    Ply,
    /// glTF, binary.
    Glb,
}

impl Format {
    pub const ALL: [Self; 3] = [Self::Obj, Self::Ply, Self::Glb];

    /// The name, which is also the extension of files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Glb => "glb",
        }
    }

    /// The form of a file of this name, by its extension.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        Self::ALL.into_iter().find(|format| format.name().eq_ignore_ascii_case(extension))
    }
}

/// Why there is no surface.
#[derive(Debug, thiserror::Error)]
pub enum SurfaceError {
    #[error("2D scenes have no surface; draw them (render), or export their points")]
    Plane,
    #[error("frame {frame} has {points} points, and surfaces are made of {most} at most; ask for fewer (max_points)")]
    TooMany { frame: u64, points: usize, most: usize },
    #[error("no surface can be made of the points of \"{body}\": {reason}")]
    Failed { body: String, reason: String },
    #[error(transparent)]
    OtherScene(#[from] OtherScene),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// Of how many points surfaces are made at most: of more, they take gigabytes.
pub const MOST_POINTS: usize = 4_000_000;

/// Makes surfaces of frames of one recording.
pub struct Surfaces<'a> {
    scenery: &'a Scenery,
    /// Whether a body has a surface.
    wanted: Vec<bool>,
    most: usize,
    palette: Palette,
}

/// Size of what was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    pub vertices: usize,
    pub triangles: usize,
}

impl<'a> Surfaces<'a> {
    /// Of the bodies and sources of these names, of all without any; of at most `most` points a frame.
    ///
    /// # Errors
    /// When there is none of a name, or the scene is two-dimensional.
    pub fn new(scenery: &'a Scenery, bodies: &[String], most: usize) -> Result<Self, SurfaceError> {
        if scenery.dimension() == 2 {
            return Err(SurfaceError::Plane);
        }
        let known = scenery.names();
        let mut wanted = vec![bodies.is_empty(); known.len()];
        for name in bodies {
            let number = known.iter().position(|known| known == name);
            wanted[number.ok_or_else(|| ExportError::NoBody { name: name.clone(), known: known.clone() })?] = true;
        }
        let palette = Palette::new(&scenery.setup, &scenery.appearance);
        Ok(Self { scenery, wanted, most, palette })
    }

    /// Writes the surfaces of a frame of the recording `target`, whose frames `index` knows.
    ///
    /// # Errors
    /// When there is no such frame, none can be made of it, the recording cannot be read, or the file not written.
    pub fn write(
        &self,
        (index, target): (&FrameIndex, &Path),
        frame: u64,
        format: Format,
        to: impl Write + Seek,
        path: &Path,
    ) -> Result<Written, SurfaceError> {
        let cloud = index.points(target, frame)?.ok_or(ExportError::NoFrame { frame, frames: index.len() })?;
        let model = self.model(&cloud, frame)?;
        let mut to = BufWriter::with_capacity(1 << 18, to);
        let written = match format {
            Format::Obj => obj::write(&model, &mut to),
            Format::Ply => ply::write(&model, &mut to),
            Format::Glb => glb::write(&model, &mut to),
        };
        written.and_then(|()| to.flush()).map_err(RecordingError::io("write", path))?;
        let count = |of: fn(&Skin) -> usize| model.parts.iter().map(|part| of(&part.skin)).sum();
        Ok(Written { vertices: count(|skin| skin.positions.len()), triangles: count(|skin| skin.triangles.len()) })
    }

    /// The same into a file, which other processes see complete or not at all.
    ///
    /// # Errors
    /// As [`Self::write`].
    pub fn write_file(
        &self,
        recording: (&FrameIndex, &Path),
        frame: u64,
        format: Format,
        path: &Path,
    ) -> Result<Written, SurfaceError> {
        write_atomically(path, |file, partial| self.write(recording, frame, format, file, partial))
    }

    fn model(&self, cloud: &Cloud, frame: u64) -> Result<Model, SurfaceError> {
        let setup = &self.scenery.setup;
        let bodies = self.scenery.bodies(cloud)?;
        let chosen: Vec<u32> = (0..cloud.len() as u32).filter(|k| self.wanted[bodies[*k as usize] as usize]).collect();
        let n = chosen.len().min(self.most);
        if n > MOST_POINTS {
            return Err(SurfaceError::TooMany { frame, points: n, most: MOST_POINTS });
        }
        let some = select(chosen.len(), n, setup.seed).into_iter().map(|k| chosen[k as usize]);
        let growth = self.scenery.growth(n, chosen.len());
        let mut points: Vec<skin::Points> = vec![skin::Points::default(); setup.bodies.len()];
        let (position, velocity) = (cloud.positions(), cloud.velocities());
        for k in some {
            let (point, body) = (cloud.point(k as usize), bodies[k as usize] as usize);
            points[body].positions.push(Vector3::from(<[f32; 3]>::from(local(setup, position(point)))));
            points[body].velocities.extend(velocity.as_ref().map(|velocity| Vector3::from(velocity(point))));
        }
        let part = |(number, (body, points)): (usize, (&Body, &skin::Points))| {
            let spacing = (growth * body.volume0.cbrt()) as f32;
            let skin = skin::skin(points, spacing)
                .map_err(|reason| SurfaceError::Failed { body: body.name.clone(), reason })?;
            Ok(Part { name: body.name.clone(), number, color: self.palette.color(number as u32, 0.0), skin })
        };
        let bodies = setup.bodies.par_iter().zip(&points).enumerate();
        let there = bodies.filter(|(_, (_, points))| !points.positions.is_empty());
        let parts = there.map(part).collect::<Result<Vec<_>, SurfaceError>>()?;
        Ok(Model { time_s: cloud.time_s(), corner: setup.origin, parts })
    }
}

/// The surfaces of a frame.
struct Model {
    time_s: f64,
    /// What positions are relative to (m).
    corner: [f64; 3],
    parts: Vec<Part>,
}

/// The surface of a body.
struct Part {
    name: String,
    number: usize,
    color: Rgb,
    skin: Skin,
}

impl Model {
    /// A position in the scene (m).
    fn global(&self, x: [f32; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.corner[a] + f64::from(x[a]))
    }

    /// Whether vertices have velocities.
    fn moves(&self) -> bool {
        !self.parts.is_empty() && self.parts.iter().all(|part| !part.skin.velocities.is_empty())
    }
}

/// A name that fits into a line of text.
fn line_of(name: &str) -> String {
    name.replace(char::is_control, " ")
}

/// Writes numbers, little-endian.
fn reals(to: &mut impl Write, numbers: &[f32]) -> io::Result<()> {
    numbers.iter().try_for_each(|number| to.write_all(&number.to_le_bytes()))
}
