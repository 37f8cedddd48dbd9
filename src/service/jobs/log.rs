//! The log of a job: a line for what happens to it, with the time, for people.

use std::fs::{self, OpenOptions};
use std::io::{self, Write};

use jiff::Timestamp;

use crate::store::JobFiles;

/// Lines that a failure quotes.
const QUOTED: usize = 5;

/// Adds a line. A log that cannot be written stops nothing.
pub fn note(files: &JobFiles, line: &str) {
    if let Err(error) = add(files, line) {
        tracing::warn!(%error, path = %files.log().display(), "cannot write a job's log");
    }
}

fn add(files: &JobFiles, line: &str) -> io::Result<()> {
    let path = files.log();
    if let Some(dir) = path.parent() {
        fs::create_dir_all(dir)?;
    }
    let mut file = OpenOptions::new().create(true).append(true).open(path)?;
    file.write_all(format!("{:.3} {}\n", Timestamp::now(), line.replace('\n', "; ")).as_bytes())
}

/// The last lines, for a failure.
pub fn tail(files: &JobFiles) -> String {
    let text = fs::read_to_string(files.log()).unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(QUOTED)..].join("; ")
}
