//! Whatever bytes come in, nothing panics, hangs or takes all memory: mutations of good and bad inputs, seeded.
//!
//! `GRIDFALL_FUZZ_SECONDS` is the time of each target (2 by default), `GRIDFALL_FUZZ_SEED` starts other sequences.
//! What fails is in `target/fuzz`; `GRIDFALL_FUZZ_INPUT=FILE tests/run --test fuzz TARGET` repeats it. Files in
//! `corpus/TARGET` are tried first, and are where mutations start: once mended, a failure is kept there.

#[path = "../scene/cases.rs"]
mod cases;

mod campaign;
mod checkpoints;
mod files;
mod json;
mod mutate;
mod ranges;
mod recordings;
mod scenes;
