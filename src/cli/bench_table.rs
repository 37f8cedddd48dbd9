//! A measurement as text.

use std::fmt::{self, Write};

use crate::bench::compare::{Compared, Verdict};
use crate::bench::{Row, Spread, Stage, spelled};

/// Several lines; the last one ends.
pub fn text(row: &Row) -> String {
    let mut text = String::new();
    write(&mut text, row).expect("a string takes everything");
    text
}

fn write(to: &mut String, row: &Row) -> fmt::Result {
    let software = if row.backend.software { " (software)" } else { "" };
    let driver = Some(&row.backend.driver).filter(|driver| !driver.is_empty());
    let driver = driver.map(|driver| format!(", {driver}")).unwrap_or_default();
    writeln!(to, "{}: {} particles on {}{software}{driver}", row.case, row.particles, row.backend.device)?;
    let (kernel, precision) = (spelled(&row.kernel), spelled(&row.precision));
    let rounds = format!("{} rounds of {} steps", row.rounds, row.steps);
    writeln!(to, "  {kernel} {precision}, dt {:.3e} s, {rounds} from one state", row.dt_s)?;
    writeln!(to, "  {} M particle-steps/s", millions(&row.particle_steps_per_s))?;
    writeln!(to, "  {:.1} s wall a simulated second", row.wall_s_per_simulated_s)?;
    writeln!(
        to,
        "  {:.1} % of the copy bandwidth of {:.1} GB/s at the floor of {:.0} B a particle-step",
        100.0 * row.floor_share,
        row.copy_bandwidth_b_s / 1e9,
        row.floor_bytes
    )?;
    let memory = |bytes: u64| {
        format!("{:.1} MiB, {:.0} B a particle", bytes as f64 / f64::from(1 << 20), bytes as f64 / row.particles as f64)
    };
    if let Some(bytes) = row.host_bytes {
        writeln!(to, "  host memory {}", memory(bytes))?;
    }
    if let Some(bytes) = row.device_bytes {
        writeln!(to, "  device memory {}", memory(bytes))?;
    }
    if let (Some(blocks), Some(dispatches)) = (row.blocks, row.dispatches) {
        writeln!(to, "  {blocks} active blocks, {dispatches} dispatches a step")?;
    }
    stages(to, row)?;
    match &row.compared {
        Some(compared) => comparison(to, row, compared),
        None => Ok(()),
    }
}

/// Stages with times and bytes, and their sums.
fn stages(to: &mut String, row: &Row) -> fmt::Result {
    if row.stages.is_empty() {
        return Ok(());
    }
    writeln!(to, "  {:<12} {:>34} {:>9} {:>9} {:>9}", "stage", "µs a step", "B read", "B written", "GB/s")?;
    for stage in &row.stages {
        let time = stage
            .time_us
            .map_or_else(|| "—".into(), |time| format!("{:.1} ({:.1}–{:.1})", time.median, time.min, time.max));
        let bytes = |bytes: Option<f64>| bytes.map_or_else(|| "—".into(), |bytes| format!("{bytes:.1}"));
        let (read, written) = (bytes(stage.read_bytes), bytes(stage.written_bytes));
        let rate = rate(stage, row.particles).map_or_else(|| "—".into(), |rate| format!("{:.1}", rate / 1e9));
        writeln!(to, "  {:<12} {time:>34} {read:>9} {written:>9} {rate:>9}", stage.stage)?;
    }
    if let Some(bytes) = row.bytes() {
        let floor = bytes / row.floor_bytes;
        writeln!(to, "  all stages must move {bytes:.0} B a particle-step, {floor:.1} times the floor")?;
    }
    Ok(())
}

/// Bytes that a stage must move over its time (B/s).
fn rate(stage: &Stage, particles: usize) -> Option<f64> {
    let bytes = (stage.read_bytes? + stage.written_bytes?) * particles as f64;
    Some(bytes / (1e-6 * stage.time_us?.median))
}

fn comparison(to: &mut String, row: &Row, compared: &Compared) -> fmt::Result {
    let verdict = match compared.verdict {
        Verdict::Faster => "faster, outside the spread",
        Verdict::Slower => "slower, outside the spread",
        Verdict::WithinSpread => "within the spread",
    };
    let (old, new) = (millions(&compared.before), millions(&row.particle_steps_per_s));
    writeln!(to, "  {:.3} times commit {}: {old} → {new}, {verdict}", compared.ratio, compared.commit)
}

fn millions(rate: &Spread) -> String {
    format!("{:.2} ({:.2}–{:.2})", rate.median / 1e6, rate.min / 1e6, rate.max / 1e6)
}
