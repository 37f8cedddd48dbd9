//! Frames of recordings, as arguments name them.

use std::path::Path;
use std::str::FromStr;

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

/// The recording's name without its extensions.
pub fn stem(recording: &Path) -> String {
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
    fn names_of_recordings() {
        for name in ["a/dam.mcap", "dam.mcap.partial", "dam"] {
            assert_eq!(stem(Path::new(name)), "dam");
        }
    }
}
