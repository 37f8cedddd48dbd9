//! `gridfall surface`: surfaces of bodies as meshes.

use clap::{Args, ValueEnum};

use super::CliError;
use super::frames::{FrameArguments, write_each};
use super::run::load_recorded;
use gridfall_recording::Scenery;
use gridfall_recording::export::ExportError;
use gridfall_recording::reconstruction::{Format, SurfaceError, Surfaces};

/// Write the surfaces of bodies as triangle meshes, a file a frame, to be rendered in other programs.
///
/// Each body has a closed surface of its own, with normals, and velocities where the recording has them (PLY, glTF).
/// They are made of the recorded points of a 3D scene: run the scene with more output.preview_points for finer ones.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(flatten)]
    what: FrameArguments,
    /// Form of the files: obj, ply or glb (glTF, y up); by the extension of OUT, or else ply.
    #[arg(short, long, value_enum)]
    format: Option<FormatName>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum FormatName {
    Obj,
    Ply,
    Glb,
}

impl From<FormatName> for Format {
    fn from(name: FormatName) -> Self {
        match name {
            FormatName::Obj => Self::Obj,
            FormatName::Ply => Self::Ply,
            FormatName::Glb => Self::Glb,
        }
    }
}

pub fn execute(Arguments { what, format }: Arguments) -> Result<(), CliError> {
    let recording = &what.recording;
    let named = Format::of(&what.output).filter(|_| !what.output.is_dir());
    let format = format.map(Format::from).or(named).unwrap_or(Format::Ply);
    let index = what.index()?;
    let frames = what.frames(&index)?;
    let scenery = Scenery::new(load_recorded(recording)?);
    let surfaces = Surfaces::new(&scenery, &what.bodies, what.max_points()).map_err(refused)?;
    let target = what.target(named.is_some(), frames.len(), format.name())?;
    write_each(&frames, &target, "triangles", |frame, path| {
        let written = surfaces.write_file((&index, recording), frame, format, path).map_err(refused)?;
        Ok(written.triangles)
    })
}

/// What was asked for is not there, or a file failed.
fn refused(error: SurfaceError) -> CliError {
    match error {
        SurfaceError::Recording(error) | SurfaceError::Export(ExportError::Recording(error)) => {
            CliError::Failed(error.to_string())
        }
        error @ SurfaceError::Failed { .. } => CliError::Failed(error.to_string()),
        error => CliError::BadInput(error.to_string()),
    }
}
