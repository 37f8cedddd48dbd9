//! Files of pictures: PNG, animated PNG and GIF, and MP4 by the program ffmpeg.

use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::{Image, RenderError};
use crate::files::{RecordingError, partial_path, publish};

/// A form of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// One picture.
    Png,
    /// Animated PNG.
    Apng,
    Gif,
    /// H.264, by ffmpeg.
    Mp4,
}

impl Format {
    pub const ALL: [Self; 4] = [Self::Png, Self::Apng, Self::Gif, Self::Mp4];

    /// The name, which is also the extension of files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Apng => "apng",
            Self::Gif => "gif",
            Self::Mp4 => "mp4",
        }
    }

    /// The form of a file of this name, by its extension.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        Self::ALL.into_iter().find(|format| format.name().eq_ignore_ascii_case(extension))
    }
}

/// Colours of a GIF are chosen from every tenth pixel: more take long, and are not seen.
const GIF_SPEED: i32 = 10;

/// A file that gets one picture after the other, and its name when it is whole.
pub struct Film {
    path: PathBuf,
    partial: PathBuf,
    writer: Writer,
}

enum Writer {
    Png(BufWriter<File>),
    Apng(Box<png::Writer<BufWriter<File>>>),
    Gif(Box<gif::Encoder<BufWriter<File>>>, u16),
    Mp4(Child),
}

impl Film {
    /// A file of so many pictures of one size, at so many a second.
    ///
    /// # Errors
    /// When the file cannot be created, or cannot be of such pictures.
    pub fn create(
        path: &Path,
        format: Format,
        size: [usize; 2],
        (pictures, per_second): (u32, f64),
    ) -> Result<Self, RenderError> {
        let partial = partial_path(path);
        let open = || File::create(&partial).map(BufWriter::new).map_err(RecordingError::io("create", &partial));
        let [width, height] = size;
        let failed =
            |error: &dyn std::fmt::Display| RenderError::Film(format!("cannot begin {}: {error}", path.display()));
        let writer = match format {
            Format::Png => Writer::Png(open()?),
            Format::Apng => {
                let mut encoder = png::Encoder::new(open()?, width as u32, height as u32);
                encoder.set_color(png::ColorType::Rgb);
                encoder.set_depth(png::BitDepth::Eight);
                encoder.set_animated(pictures, 0).map_err(|error| failed(&error))?;
                let delay = (1000.0 / per_second).round() as u16;
                encoder.set_frame_delay(delay, 1000).map_err(|error| failed(&error))?;
                Writer::Apng(Box::new(encoder.write_header().map_err(|error| failed(&error))?))
            }
            Format::Gif => {
                let mut encoder =
                    gif::Encoder::new(open()?, width as u16, height as u16, &[]).map_err(|error| failed(&error))?;
                encoder.set_repeat(gif::Repeat::Infinite).map_err(|error| failed(&error))?;
                // Browsers take pictures of less than 2/100 s as ones of 1/10 s.
                Writer::Gif(Box::new(encoder), ((100.0 / per_second).round() as u16).max(2))
            }
            Format::Mp4 => Writer::Mp4(ffmpeg(size, per_second, &partial)?),
        };
        Ok(Self { path: path.to_owned(), partial, writer })
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add(&mut self, image: &Image) -> Result<(), RenderError> {
        let partial = &self.partial;
        let failed =
            |error: &dyn std::fmt::Display| RenderError::Film(format!("cannot write {}: {error}", partial.display()));
        match &mut self.writer {
            Writer::Png(file) => file.write_all(&image.png()).map_err(|error| failed(&error)),
            Writer::Apng(writer) => writer.write_image_data(&image.rgb).map_err(|error| failed(&error)),
            Writer::Gif(encoder, delay) => {
                let [width, height] = image.size.map(|side| side as u16);
                let mut frame = gif::Frame::from_rgb_speed(width, height, &image.rgb, GIF_SPEED);
                frame.delay = *delay;
                encoder.write_frame(&frame).map_err(|error| failed(&error))
            }
            Writer::Mp4(child) => {
                let written = child.stdin.as_mut().expect("it is piped").write_all(&image.rgb);
                written.map_err(|error| failed(&said(child).unwrap_or_else(|| error.to_string())))
            }
        }
    }

    /// Ends the file and gives it its name.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(self) -> Result<(), RenderError> {
        let Self { path, partial, writer } = self;
        let failed =
            |error: &dyn std::fmt::Display| RenderError::Film(format!("cannot end {}: {error}", partial.display()));
        match writer {
            Writer::Png(mut file) => file.flush().map_err(|error| failed(&error))?,
            Writer::Apng(writer) => writer.finish().map_err(|error| failed(&error))?,
            Writer::Gif(encoder, _) => {
                let mut file = encoder.into_inner().map_err(|error| failed(&error))?;
                file.flush().map_err(|error| failed(&error))?;
            }
            Writer::Mp4(mut child) => {
                drop(child.stdin.take());
                if let Some(reason) = said(&mut child) {
                    return Err(failed(&reason));
                }
            }
        }
        Ok(publish(&partial, &path)?)
    }

    /// Leaves nothing behind.
    pub fn abandon(self) {
        if let Writer::Mp4(mut child) = self.writer {
            // It may have ended by itself.
            let _ = child.kill();
            let _ = child.wait();
        }
        let _ = std::fs::remove_file(&self.partial);
    }
}

/// Waits for the end of ffmpeg. What it said, if it failed.
fn said(child: &mut Child) -> Option<String> {
    drop(child.stdin.take());
    let mut text = String::new();
    if let Some(mut errors) = child.stderr.take() {
        // What can be read is better than nothing.
        let _ = errors.read_to_string(&mut text);
    }
    match child.wait() {
        Ok(status) if status.success() => None,
        Ok(status) => Some(format!("ffmpeg ended with {status}: {}", text.trim())),
        Err(error) => Some(format!("ffmpeg: {error}")),
    }
}

/// Starts ffmpeg, which takes pictures on its standard input.
fn ffmpeg([width, height]: [usize; 2], per_second: f64, to: &Path) -> Result<Child, RenderError> {
    if width % 2 == 1 || height % 2 == 1 {
        let reason = format!("mp4 has an even width and height, and {width}x{height} is odd; change the size");
        return Err(RenderError::Film(reason));
    }
    let mut command = Command::new("ffmpeg");
    command.args(["-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]);
    command.args(["-s", &format!("{width}x{height}"), "-r", &per_second.to_string(), "-i", "-"]);
    // Players take unlabelled films of this size as bt709; half the colours is what all of them can show.
    command.args(["-vf", "scale=out_color_matrix=bt709:out_range=tv", "-c:v", "libx264", "-crf", "17"]);
    command.args(["-pix_fmt", "yuv420p", "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"]);
    command.args(["-movflags", "+faststart", "-f", "mp4"]).arg(to);
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().map_err(|error| {
        let reason = if error.kind() == std::io::ErrorKind::NotFound {
            "mp4 is made by the program ffmpeg, which is not here; install it, or write a .gif or .apng".to_owned()
        } else {
            format!("cannot start ffmpeg: {error}")
        };
        RenderError::Film(reason)
    })
}
