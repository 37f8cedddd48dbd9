//! What commands say beside their results, on standard error: remarks and progress, unless `--quiet`.

use std::fmt::Display;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

static QUIET: AtomicBool = AtomicBool::new(false);

/// From here on only results and errors.
pub fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

pub fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Says something that is neither a result nor an error.
pub fn remark(text: impl Display) {
    if !is_quiet() {
        eprintln!("{text}");
    }
}

/// A progress bar, hidden where standard error is no terminal.
pub fn bar(length: u64) -> ProgressBar {
    if is_quiet() {
        return ProgressBar::hidden();
    }
    let template = "[{elapsed_precise}] {bar:40} {pos}/{len} {msg} eta {eta}";
    let bar = ProgressBar::new(length).with_style(ProgressStyle::with_template(template).expect("a valid template"));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
