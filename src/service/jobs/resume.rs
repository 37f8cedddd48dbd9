//! What a new attempt may go on from.

use super::attempt::outputs;
use super::log;
use crate::store::JobFiles;
use gridfall_recording::checkpoint::{self, Checkpoint};
use gridfall_recording::run::Earlier;

/// The whole checkpoints of the attempts before `attempt`, the farthest first. Others are told of in the job's log.
pub(super) fn candidates(files: &JobFiles, attempt: i64) -> Vec<Earlier> {
    let attempts = match files.attempts() {
        Ok(attempts) => attempts,
        Err(error) => {
            log::note(files, &format!("earlier attempts cannot be looked at: {error}"));
            return Vec::new();
        }
    };
    let mut found = Vec::new();
    for earlier in attempts.into_iter().filter(|&earlier| earlier < attempt) {
        let outputs = outputs(&files.attempt(earlier));
        let paths = outputs.checkpoints.as_deref().map_or_else(|| Ok(Vec::new()), checkpoint::list);
        for path in paths.unwrap_or_default() {
            match Checkpoint::open(&path) {
                Ok(checkpoint) => found.push(Earlier { checkpoint, outputs: outputs.clone() }),
                Err(error) => log::note(files, &error.to_string()),
            }
        }
    }
    // Stable: of two of one frame, the later attempt's.
    found.sort_by_key(|earlier| std::cmp::Reverse(earlier.checkpoint.reached.frame));
    found
}
