//! `gridfall surface`: surfaces of bodies as meshes.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use clap::{Args, ValueEnum};

use super::frames::{Frames, stem};
use super::run::load_recorded;
use super::talk::{bar, remark};
use super::{CliError, interrupt};
use gridfall_recording::export::ExportError;
use gridfall_recording::reconstruction::{Format, SurfaceError, Surfaces, Written};
use gridfall_recording::{FrameIndex, RecordingError, Scenery};

/// Write the surfaces of bodies as triangle meshes, a file a frame, to be rendered in other programs.
///
/// Each body has a closed surface of its own, with normals, and velocities where the recording has them (PLY, glTF).
/// They are made of the recorded points: run the scene with more output.preview_points for finer ones.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording (MCAP) of a 3D scene, finished or not (NAME.mcap.partial).
    recording: PathBuf,
    /// Form of the files: obj, ply or glb (glTF, y up); by the extension of OUT, or else ply.
    #[arg(short, long, value_enum)]
    format: Option<FormatName>,
    /// Frames from 0: one (7), from A to before B (A..B), to B (A..=B), or all from A (A..); all by default.
    #[arg(long, value_name = "FRAMES", default_value = "..")]
    frames: Frames,
    /// Of these frames the first, and every K-th after it.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    every: u64,
    /// Only the surface of this body or source; may be given several times.
    #[arg(long = "body", value_name = "NAME")]
    bodies: Vec<String>,
    /// Of at most so many points a frame, the same share of all parts; all by default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    max_points: Option<u32>,
    /// The folder of the files, or the file of one frame (OUT.ply); the current folder by default.
    #[arg(short, long, value_name = "OUT", default_value = ".")]
    output: PathBuf,
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

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let (recording, output) = (&arguments.recording, &arguments.output);
    let named = Format::of(output).filter(|_| !output.is_dir());
    let format = arguments.format.map(Format::from).or(named).unwrap_or(Format::Ply);
    let unread = |error: RecordingError| CliError::BadInput(error.to_string());
    let mut index = FrameIndex::default();
    index.look(recording).map_err(unread)?;
    let frames = arguments.frames.of(index.len(), arguments.every).map_err(|error| refused(error.into()))?;
    if named.is_some() && frames.len() > 1 {
        let reason = format!("{} is the file of one frame, and {} are to be written", output.display(), frames.len());
        return Err(CliError::BadInput(format!("{reason}; name one with --frames, or a folder")));
    }
    let scenery = Scenery::new(load_recorded(recording)?);
    let most = arguments.max_points.map_or(usize::MAX, |most| most as usize);
    let surfaces = Surfaces::new(&scenery, &arguments.bodies, most).map_err(refused)?;
    let stem = stem(recording);
    let path = |frame: u64| match named {
        Some(_) => output.clone(),
        None => output.join(format!("{stem}.{frame:04}.{}", format.name())),
    };
    if named.is_none() {
        std::fs::create_dir_all(output)
            .map_err(|error| CliError::BadInput(format!("cannot create {}: {error}", output.display())))?;
    }

    let interrupted = interrupt::flag().map_err(|error| CliError::Failed(error.to_string()))?;
    let progress = bar(frames.len() as u64);
    let (mut written, mut triangles) = (0, 0);
    let mut outcome = Ok(());
    for frame in &frames {
        if interrupted.load(Ordering::Relaxed) {
            outcome = Err(CliError::Failed(format!("interrupted after {written} of {} frames", frames.len())));
            break;
        }
        match surfaces.write_file((&index, recording), *frame, format, &path(*frame)) {
            Ok(Written { triangles: more, .. }) => (written, triangles) = (written + 1, triangles + more),
            Err(error) => {
                outcome = Err(refused(error));
                break;
            }
        }
        progress.set_position(written);
        progress.set_message(format!("frames, {triangles} triangles"));
    }
    progress.finish_and_clear();
    if written > 0 {
        let frames = if written == 1 { "frame" } else { "frames" };
        let files = match named {
            Some(_) => output.clone(),
            None => output.join(format!("{stem}.*.{}", format.name())),
        };
        remark(format_args!("wrote {}: {written} {frames}, {triangles} triangles", files.display()));
    }
    outcome
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
