//! `gridfall render`: pictures and films of a recording.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;

use super::frames::Frames;
use super::run::load_recorded;
use super::talk::{bar, remark};
use super::{CliError, interrupt};
use gridfall_recording::export::ExportError;
use gridfall_recording::render::{Aim, Bounds, Film, Format, Look, RenderError, Renderer, Size};
use gridfall_recording::{Cloud, FrameIndex, RecordingError, Scenery};

/// Draw a picture of a frame (.png), or a film of all (.gif, .apng, or .mp4 with ffmpeg).
///
/// What is drawn are the recorded points, with the colliders of the scene that the recording carries.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording (MCAP), finished or not (NAME.mcap.partial).
    recording: PathBuf,
    /// The file; its extension says what it is: png, gif, apng or mp4.
    #[arg(short, long, value_name = "OUT.png|gif|apng|mp4")]
    output: PathBuf,
    /// The frame of a picture, from 0, or last.
    #[arg(long, value_name = "N|last", default_value = "last", conflicts_with = "frames")]
    frame: Frame,
    /// The frames of a film: from A to before B (A..B), to B (A..=B), or all from A (A..); all by default.
    #[arg(long, value_name = "FRAMES", default_value = "..")]
    frames: Frames,
    /// Of these frames the first, and every K-th after it.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    every: u64,
    /// Frames of a film a second.
    #[arg(long, value_name = "FPS", default_value_t = 25.0, value_parser = rate)]
    fps: f64,
    /// Width and height (pixels).
    #[arg(long, value_name = "WxH", default_value = "960x540")]
    size: Size,
    /// Where the camera stands: azimuth and elevation (degrees), distance (m) or zoom, look_at (x,y,z in m), such as
    /// azimuth=30,elevation=20,look_at=0.5,0.5,0.2. What is left out is chosen so that all is seen.
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    camera: Option<Aim>,
    /// Colour by a recorded field (speed, J, von_mises, stress_xx, …) or by body, with a legend. Without it points have
    /// the colours that were recorded.
    #[arg(long, visible_alias = "colour-by", value_name = "FIELD")]
    color_by: Option<String>,
    /// Values with the first and the last colour; those of nearly all points by default.
    #[arg(long, value_name = "LOW,HIGH", requires = "color_by", allow_hyphen_values = true)]
    range: Option<Bounds>,
    /// Only points of this body or source; may be given several times.
    #[arg(long = "body", value_name = "NAME")]
    bodies: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Frame {
    Number(u64),
    Last,
}

impl std::str::FromStr for Frame {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "last" {
            return Ok(Self::Last);
        }
        text.parse().map(Self::Number).map_err(|_| format!("\"{text}\" is neither the number of a frame nor last"))
    }
}

fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| (0.1..=120.0).contains(rate));
    rate.ok_or_else(|| "films have 0.1 to 120 frames a second".into())
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let (recording, output) = (&arguments.recording, &arguments.output);
    let format = Format::of(output).ok_or_else(|| {
        let reason = format!("{} is no name of a picture or film", output.display());
        CliError::BadInput(format!("{reason}; end it in .png, .gif, .apng or .mp4"))
    })?;
    let unread = |error: RecordingError| CliError::BadInput(error.to_string());
    let mut index = FrameIndex::default();
    index.look(recording).map_err(unread)?;
    // First of all: a recording of another program has none.
    let scenery = Scenery::new(load_recorded(recording)?);
    let frames = match (format, arguments.frame) {
        (Format::Png, Frame::Last) => vec![index.len().checked_sub(1).ok_or_else(|| no_frame(0, &index))?],
        (Format::Png, Frame::Number(frame)) if frame < index.len() => vec![frame],
        (Format::Png, Frame::Number(frame)) => return Err(no_frame(frame, &index)),
        _ => arguments.frames.of(index.len(), arguments.every).map_err(|error| refused(error.into()))?,
    };
    let look = Look {
        size: arguments.size,
        aim: arguments.camera.unwrap_or_default(),
        color_by: arguments.color_by,
        bounds: arguments.range,
        bodies: arguments.bodies,
    };
    let renderer = Renderer::new(&scenery, &look).map_err(refused)?;
    let film =
        Film::create(output, format, look.size.pixels(), (frames.len() as u32, arguments.fps)).map_err(refused)?;
    let work = Work { index, recording, renderer, frames: &frames };
    let drawn = work.draw(film)?;
    let what = if drawn == 1 { "1 picture".into() } else { format!("{drawn} pictures") };
    remark(format_args!("wrote {}: {what}", output.display()));
    Ok(())
}

struct Work<'a> {
    index: FrameIndex,
    recording: &'a Path,
    renderer: Renderer<'a>,
    frames: &'a [u64],
}

impl Work<'_> {
    fn draw(&self, mut film: Film) -> Result<usize, CliError> {
        let interrupted = interrupt::flag().map_err(|error| CliError::Failed(error.to_string()))?;
        let outcome = self.add_all(&mut film, &interrupted);
        if outcome.is_err() {
            film.abandon();
            return outcome;
        }
        film.finish().map_err(refused)?;
        outcome
    }

    fn add_all(&self, film: &mut Film, interrupted: &AtomicBool) -> Result<usize, CliError> {
        let looks = if self.renderer.wants_bounds() { 2 } else { 1 };
        let progress = bar(looks * self.frames.len() as u64);
        let step = |what: &'static str| {
            progress.inc(1);
            progress.set_message(what);
            if interrupted.load(Ordering::Relaxed) {
                return Err(CliError::Failed("interrupted; nothing was written".into()));
            }
            Ok(())
        };
        // The same colours in all frames.
        let mut bounds: Option<Bounds> = None;
        for frame in self.frames.iter().filter(|_| looks == 2) {
            if let Some(new) = self.renderer.bounds(&self.cloud(*frame)?).map_err(refused)? {
                bounds = Some(bounds.map_or(new, |bounds| bounds.and(new)));
            }
            step("frames looked at")?;
        }
        for frame in self.frames {
            let image = self.renderer.draw(&self.cloud(*frame)?, bounds).map_err(refused)?;
            film.add(&image).map_err(refused)?;
            step("frames drawn")?;
        }
        progress.finish_and_clear();
        Ok(self.frames.len())
    }

    fn cloud(&self, frame: u64) -> Result<Cloud, CliError> {
        let found = self.index.points(self.recording, frame).map_err(|error| refused(error.into()))?;
        found.ok_or_else(|| no_frame(frame, &self.index))
    }
}

fn no_frame(frame: u64, index: &FrameIndex) -> CliError {
    refused(ExportError::NoFrame { frame, frames: index.len() }.into())
}

/// What was asked for is not there, or a file failed.
fn refused(error: RenderError) -> CliError {
    match error {
        RenderError::Recording(error) | RenderError::Export(ExportError::Recording(error)) => {
            CliError::Failed(error.to_string())
        }
        error => CliError::BadInput(error.to_string()),
    }
}
