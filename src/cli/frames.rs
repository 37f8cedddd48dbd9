//! Frames of recordings: how arguments name them, and files made of them.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::Ordering;

use clap::Args;

use super::talk::{bar, remark};
use super::{CliError, interrupt};
use gridfall_recording::FrameIndex;
use gridfall_recording::export::ExportError;

/// A range of frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    pub first: u64,
    /// Before this one; `None` for all.
    pub end: Option<u64>,
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<u64>().map_err(|_| format!("\"{text}\" is no number of a frame"));
        let Some((first, last)) = text.split_once("..") else {
            let frame = number(text)?;
            return Ok(Self { first: frame, end: Some(frame.saturating_add(1)) });
        };
        let first = if first.is_empty() { 0 } else { number(first)? };
        let end = match last.strip_prefix('=') {
            Some(last) => Some(number(last)?.saturating_add(1)),
            None if last.is_empty() => None,
            None => Some(number(last)?),
        };
        if end.is_some_and(|end| end <= first) {
            return Err(format!("there is no frame in {text}"));
        }
        Ok(Self { first, end })
    }
}

impl Frames {
    /// The numbers of these frames of so many, every `step`-th of them.
    ///
    /// # Errors
    /// When one that was named is not there.
    pub fn of(self, frames: u64, step: u64) -> Result<Vec<u64>, ExportError> {
        let Self { first, end } = self;
        // What was named must be there; what was not, need not.
        let last = end.map_or(first, |end| end - 1);
        if last >= frames {
            return Err(ExportError::NoFrame { frame: last, frames });
        }
        Ok((first..end.unwrap_or(frames)).step_by(step as usize).collect())
    }
}

/// What of a recording becomes files of other programs, and where they go.
#[derive(Debug, Args)]
pub struct FrameArguments {
    /// The recording (MCAP), finished or not (NAME.mcap.partial).
    pub recording: PathBuf,
    /// Frames from 0: one (7), from A to before B (A..B), to B (A..=B), or all from A (A..); all by default.
    #[arg(long, value_name = "FRAMES", default_value = "..")]
    frames: Frames,
    /// Of these frames the first, and every K-th after it.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    every: u64,
    /// Only this body or source; may be given several times. The recording needs the field "body".
    #[arg(long = "body", value_name = "NAME")]
    pub bodies: Vec<String>,
    /// At most so many points a frame, the same share of all parts; all by default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    max_points: Option<u32>,
    /// The folder of the files, or the file of one frame (OUT.ply); the current folder by default.
    #[arg(short, long, value_name = "OUT", default_value = ".")]
    pub output: PathBuf,
}

impl FrameArguments {
    pub fn index(&self) -> Result<FrameIndex, CliError> {
        let mut index = FrameIndex::default();
        index.look(&self.recording).map_err(|error| CliError::BadInput(error.to_string()))?;
        Ok(index)
    }

    /// Numbers of the frames of a recording.
    pub fn frames(&self, index: &FrameIndex) -> Result<Vec<u64>, CliError> {
        self.frames.of(index.len(), self.every).map_err(|error| CliError::BadInput(error.to_string()))
    }

    pub fn max_points(&self) -> usize {
        self.max_points.map_or(usize::MAX, |most| most as usize)
    }

    /// Where so many frames go: into the file that `output` is the name of, which is one of a known form, or into its
    /// folder, which is made.
    pub fn target(&self, is_file: bool, frames: usize, extension: &'static str) -> Result<Target, CliError> {
        let output = self.output.display();
        if is_file && frames > 1 {
            let reason = format!("{output} is the file of one frame, and {frames} are to be written");
            return Err(CliError::BadInput(format!("{reason}; name one with --frames, or a folder")));
        }
        if is_file {
            return Ok(Target::File(self.output.clone()));
        }
        std::fs::create_dir_all(&self.output)
            .map_err(|error| CliError::BadInput(format!("cannot create {output}: {error}")))?;
        Ok(Target::Folder { folder: self.output.clone(), stem: stem(&self.recording), extension })
    }
}

/// Where frames go.
pub enum Target {
    /// One, into this file.
    File(PathBuf),
    /// Each into a file of this folder, whose name begins and ends like this.
    Folder { folder: PathBuf, stem: String, extension: &'static str },
}

impl Target {
    /// The file of a frame.
    pub fn of(&self, frame: u64) -> PathBuf {
        match self {
            Self::File(path) => path.clone(),
            Self::Folder { folder, stem, extension } => folder.join(format!("{stem}.{frame:04}.{extension}")),
        }
    }

    /// The files, for people.
    fn said(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Folder { folder, stem, extension } => {
                folder.join(format!("{stem}.*.{extension}")).display().to_string()
            }
        }
    }
}

/// Has each frame written, with a bar, until one fails or the user interrupts. `write` returns how many `things` the
/// file has. Says what was written, also if it is not all.
pub fn write_each(
    frames: &[u64],
    target: &Target,
    things: &str,
    mut write: impl FnMut(u64, &Path) -> Result<usize, CliError>,
) -> Result<(), CliError> {
    let interrupted = interrupt::flag().map_err(|error| CliError::Failed(error.to_string()))?;
    let progress = bar(frames.len() as u64);
    let (mut written, mut sum) = (0, 0);
    let mut outcome = Ok(());
    for &frame in frames {
        if interrupted.load(Ordering::Relaxed) {
            outcome = Err(CliError::Failed(format!("interrupted after {written} of {} frames", frames.len())));
            break;
        }
        match write(frame, &target.of(frame)) {
            Ok(n) => (written, sum) = (written + 1, sum + n),
            Err(error) => {
                outcome = Err(error);
                break;
            }
        }
        progress.set_position(written);
        progress.set_message(format!("frames, {sum} {things}"));
    }
    progress.finish_and_clear();
    if written > 0 {
        let frames = if written == 1 { "frame" } else { "frames" };
        remark(format_args!("wrote {}: {written} {frames}, {sum} {things}", target.said()));
    }
    outcome
}

/// The recording's name without its extensions.
fn stem(recording: &Path) -> String {
    let name = recording.file_name().map_or_else(|| "frame".into(), |name| name.to_string_lossy().into_owned());
    let finished = name.strip_suffix(".partial").unwrap_or(&name);
    finished.strip_suffix(".mcap").unwrap_or(finished).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_frames() {
        let range = |text: &str| text.parse::<Frames>().map(|Frames { first, end }| (first, end));
        assert_eq!(range(".."), Ok((0, None)));
        assert_eq!(range("7"), Ok((7, Some(8))));
        assert_eq!(range("3.."), Ok((3, None)));
        assert_eq!(range("3..5"), Ok((3, Some(5))));
        assert_eq!(range("..=5"), Ok((0, Some(6))));
        for wrong in ["", "x", "5..5", "5..3", "-1", "1..x", "1...3"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn names_of_files() {
        let target = Target::Folder { folder: "out".into(), stem: "dam".into(), extension: "ply" };
        assert_eq!(target.of(12), Path::new("out/dam.0012.ply"));
    }

    #[test]
    fn names_of_recordings() {
        for name in ["a/dam.mcap", "dam.mcap.partial", "dam"] {
            assert_eq!(stem(Path::new(name)), "dam");
        }
    }
}
