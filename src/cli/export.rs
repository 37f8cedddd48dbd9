//! `gridfall export`: frames of a recording as files of other programs.

use clap::{Args, ValueEnum};

use super::CliError;
use super::frames::{FrameArguments, Target, write_each};
use super::talk::remark;
use gridfall_recording::export::{self, ExportError, Format, Selection, Series};

/// Write frames of a recording as files for other programs: a file a frame, and for ParaView a list of them (.pvd).
///
/// Positions are those of the scene (m, f64). All else is as it was recorded: the fields that the scene names in
/// output.fields, and colours. A run records at most output.preview_points points a frame.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(flatten)]
    what: FrameArguments,
    /// Form of the files: ply, vtp (ParaView), npz (NumPy) or csv; by the extension of OUT, or else vtp.
    #[arg(short, long, value_enum)]
    format: Option<FormatName>,
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

pub fn execute(Arguments { what, format }: Arguments) -> Result<(), CliError> {
    let recording = &what.recording;
    let named = Format::of(&what.output).filter(|_| !what.output.is_dir());
    let format = format.map(Format::from).or(named).unwrap_or(Format::Vtp);
    let index = what.index()?;
    let names = index.bodies(recording).map_err(|error| CliError::BadInput(error.to_string()))?;
    let selection = Selection::new(names, &what.bodies, what.max_points()).map_err(refused)?;
    let frames = what.frames(&index)?;
    let target = what.target(named.is_some(), frames.len(), format.name())?;
    let mut series = Series::default();
    let mut listed = false;
    let outcome = write_each(&frames, &target, "points", |frame, path| {
        let (time_s, points) =
            export::write_file((&index, recording), frame, (format, &selection), path).map_err(refused)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        series.add(time_s, &name);
        listed = true;
        Ok(points)
    });
    // The files so far are a series, too.
    if let (Target::Folder { folder, stem, .. }, Format::Vtp, true) = (&target, format, listed) {
        let list = folder.join(format!("{stem}.pvd"));
        series.write(&list).map_err(|error| CliError::Failed(error.to_string()))?;
        remark(format_args!("{} lists them for ParaView", list.display()));
    }
    outcome
}

/// What was asked for is not there, or a file failed.
fn refused(error: ExportError) -> CliError {
    match error {
        ExportError::Recording(error) => CliError::Failed(error.to_string()),
        error => CliError::BadInput(error.to_string()),
    }
}
