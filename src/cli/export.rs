//! `gridfall export`: frames of a recording as files of other programs.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use clap::{Args, ValueEnum};

use super::frames::{Frames, stem};
use super::talk::{bar, remark};
use super::{CliError, interrupt};
use gridfall_recording::export::{self, ExportError, Format, Selection, Series};
use gridfall_recording::{FrameIndex, RecordingError};

/// Write frames of a recording as files for other programs: a file a frame, and for ParaView a list of them (.pvd).
///
/// Positions are those of the scene (m, f64). All else is as it was recorded: the fields that the scene names in
/// output.fields, and colours. A run records at most output.preview_points points a frame.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording (MCAP), finished or not (NAME.mcap.partial).
    recording: PathBuf,
    /// Form of the files: ply, vtp (ParaView), npz (NumPy) or csv; by the extension of OUT, or else vtp.
    #[arg(short, long, value_enum)]
    format: Option<FormatName>,
    /// Frames from 0: one (7), from A to before B (A..B), to B (A..=B), or all from A (A..); all by default.
    #[arg(long, value_name = "FRAMES", default_value = "..")]
    frames: Frames,
    /// Of these frames the first, and every K-th after it.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    every: u64,
    /// Only points of this body or source; may be given several times. The recording needs the field "body".
    #[arg(long = "body", value_name = "NAME")]
    bodies: Vec<String>,
    /// At most so many points a frame, the same share of all parts; all by default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    max_points: Option<u32>,
    /// The folder of the files, or the file of one frame (OUT.ply); the current folder by default.
    #[arg(short, long, value_name = "OUT", default_value = ".")]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum FormatName {
    Ply,
    Vtp,
    Npz,
    Csv,
}

impl From<FormatName> for Format {
    fn from(name: FormatName) -> Self {
        match name {
            FormatName::Ply => Self::Ply,
            FormatName::Vtp => Self::Vtp,
            FormatName::Npz => Self::Npz,
            FormatName::Csv => Self::Csv,
        }
    }
}

/// Where a frame goes.
enum Target {
    /// Into this file, alone.
    File(PathBuf),
    /// Into a file of this folder, whose name begins like this.
    Folder(PathBuf, String),
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let recording = &arguments.recording;
    let named = Format::of(&arguments.output).filter(|_| !arguments.output.is_dir());
    let format = arguments.format.map(Format::from).or(named).unwrap_or(Format::Vtp);
    let most = arguments.max_points.map_or(usize::MAX, |most| most as usize);
    let unread = |error: RecordingError| CliError::BadInput(error.to_string());
    let mut index = FrameIndex::default();
    index.look(recording).map_err(unread)?;
    let names = index.bodies(recording).map_err(unread)?;
    let selection = Selection::new(names, &arguments.bodies, most).map_err(refused)?;
    let frames = arguments.frames.of(index.len(), arguments.every).map_err(refused)?;
    let target = match named {
        Some(_) if frames.len() > 1 => {
            let (file, n) = (arguments.output.display(), frames.len());
            let reason = format!("{file} is the file of one frame, and {n} are to be exported");
            return Err(CliError::BadInput(format!("{reason}; name one with --frames, or a folder")));
        }
        Some(_) => Target::File(arguments.output.clone()),
        None => {
            let folder = arguments.output.clone();
            std::fs::create_dir_all(&folder)
                .map_err(|error| CliError::BadInput(format!("cannot create {}: {error}", folder.display())))?;
            Target::Folder(folder, stem(recording))
        }
    };

    let interrupted = interrupt::flag().map_err(|error| CliError::Failed(error.to_string()))?;
    let progress = bar(frames.len() as u64);
    let (mut series, mut written, mut points) = (Series::default(), 0, 0);
    let mut outcome = Ok(());
    for frame in &frames {
        if interrupted.load(Ordering::Relaxed) {
            outcome = Err(CliError::Failed(format!("interrupted after {written} of {} frames", frames.len())));
            break;
        }
        let (path, name) = target.of(*frame, format);
        match export::write_file((&index, recording), *frame, (format, &selection), &path) {
            Ok((time_s, n)) => {
                series.add(time_s, &name);
                (written, points) = (written + 1, points + n);
            }
            Err(error) => {
                outcome = Err(refused(error));
                break;
            }
        }
        progress.set_position(written);
        progress.set_message(format!("frames, {points} points"));
    }
    progress.finish_and_clear();
    // The files so far are a series, too.
    if let (Target::Folder(folder, stem), Format::Vtp) = (&target, format)
        && written > 0
    {
        let list = folder.join(format!("{stem}.pvd"));
        series.write(&list).map_err(|error| CliError::Failed(error.to_string()))?;
    }
    if written > 0 {
        let frames = if written == 1 { "frame" } else { "frames" };
        remark(format_args!("wrote {}: {written} {frames}, {points} points", target.said(format)));
    }
    outcome
}

impl Target {
    /// Path of a frame, and its name in the folder.
    fn of(&self, frame: u64, format: Format) -> (PathBuf, String) {
        match self {
            Self::File(path) => (path.clone(), String::new()),
            Self::Folder(folder, stem) => {
                let name = format!("{stem}.{frame:04}.{}", format.name());
                (folder.join(&name), name)
            }
        }
    }

    fn said(&self, format: Format) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Folder(folder, stem) => {
                let name = match format {
                    Format::Vtp => format!("{stem}.pvd"),
                    _ => format!("{stem}.*.{}", format.name()),
                };
                folder.join(name).display().to_string()
            }
        }
    }
}

/// What was asked for is not there, or a file failed.
fn refused(error: ExportError) -> CliError {
    match error {
        ExportError::Recording(error) => CliError::Failed(error.to_string()),
        error => CliError::BadInput(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn names_of_files() {
        let folder = Target::Folder("out".into(), "dam".into());
        assert_eq!(folder.of(12, Format::Ply).0, Path::new("out/dam.0012.ply"));
    }
}
