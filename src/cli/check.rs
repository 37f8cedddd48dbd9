//! `gridfall check`: all faults of a scene, or what a run would cost here.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use serde::Serialize;
use serde_json::json;

use super::CliError;
use super::device::DeviceArguments;
use super::run::{integration, load};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Problem, Setup};
use gridfall_engine::choice::Devices;
use gridfall_engine::{Backend, Control, EngineError};
use gridfall_scene::estimate::{Estimate, Integration, Limit, estimate};
use gridfall_scene::shown;

/// Wall time of a calibration (s); the warm-up of a device takes as long again.
const CALIBRATION_S: f64 = 2.0;

/// Validate a scene and estimate what a run costs: particles, memory, step, and run time on this
/// device.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The scene (JSON), or a recording with one; - reads standard input.
    scene: PathBuf,
    /// Replace a value of the scene, such as solver.kernel=quadratic; may be given several times.
    #[arg(long = "set", value_name = "PATH=VALUE")]
    overrides: Vec<String>,
    /// Print one JSON document on standard output, faults included.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    device: DeviceArguments,
}

/// Speed of a device on a problem.
#[derive(Debug, Serialize)]
struct Speed {
    backend: Backend,
    particle_steps_per_s: f64,
    /// Estimated wall time of the whole run (s), without writing its recording.
    run_s: f64,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let problem = match load(&arguments.scene, &arguments.overrides) {
        Ok((_, problem)) => problem,
        Err(error) => {
            if let (true, CliError::Faults { faults, .. }) = (arguments.json, &error) {
                println!("{:#}", json!({ "valid": false, "faults": faults }));
            }
            return Err(error);
        }
    };
    let estimate = estimate(&problem);
    let Problem { setup, particles } = problem;
    let bad_device = |e: EngineError| CliError::BadInput(e.to_string());
    let devices = Devices::open(arguments.device.choice(), arguments.device.adapter.as_deref()).map_err(bad_device)?;
    let speed = calibrate(&devices, &setup, particles, &estimate).map_err(|e| CliError::Failed(e.to_string()))?;
    if arguments.json {
        let notices = &setup.notices;
        let name = &setup.name;
        let answer = json!({ "valid": true, "name": name, "notices": notices, "estimate": estimate, "speed": speed });
        println!("{answer:#}");
    } else {
        print!("{}", text(&setup, &estimate, &speed));
    }
    Ok(())
}

/// Runs the beginning of a problem briefly: a few steps to warm up, then as many as fit into the
/// time.
fn calibrate(
    devices: &Devices,
    setup: &Setup,
    particles: Particles,
    estimate: &Estimate,
) -> Result<Speed, EngineError> {
    let mut count = particles.len();
    let mut engine = devices.engine(setup, particles)?;
    if count == 0 {
        let emission = (0..setup.frames).map(|frame| setup.emission(frame)).find(|new| !new.is_empty());
        let emission = emission.expect("a problem has particles");
        count = emission.len();
        engine.append(emission)?;
    }
    let mut done = 0;
    let mut measure = |steps: f64| -> Result<f64, EngineError> {
        let clock = Clock { started: Instant::now(), step: AtomicU64::new(done) };
        let steps = match engine.advance_frame(steps * estimate.dt_s, &clock) {
            Ok(stats) => stats.steps,
            Err(EngineError::Canceled) => clock.step.load(Ordering::Relaxed).saturating_sub(done),
            Err(e) => return Err(e),
        };
        done += steps;
        Ok(steps.max(1) as f64 / clock.started.elapsed().as_secs_f64())
    };
    let steps = |speed: f64| (speed * CALIBRATION_S).clamp(1.0, estimate.steps as f64);
    let warm_up = measure(3f64.min(estimate.steps as f64))?;
    let steps_per_s = measure(steps(warm_up))?;
    Ok(Speed {
        backend: engine.backend().clone(),
        particle_steps_per_s: steps_per_s * count as f64,
        run_s: estimate.particle_steps / (steps_per_s * count as f64),
    })
}

/// Ends a calibration that takes longer than expected.
struct Clock {
    started: Instant,
    step: AtomicU64,
}

impl Control for Clock {
    fn canceled(&self) -> bool {
        self.started.elapsed() > Duration::from_secs_f64(2.0 * CALIBRATION_S)
    }

    fn progress(&self, step: u64, _time_s: f64) {
        self.step.store(step, Ordering::Relaxed);
    }
}

fn text(setup: &Setup, estimate: &Estimate, speed: &Speed) -> String {
    let cells: Vec<String> = estimate.cells[..setup.dimension].iter().map(usize::to_string).collect();
    let bodies = setup.bodies.len();
    let memory = match estimate.device_memory_bytes {
        Some(bytes) => format!("{} on the CPU, {} on a GPU", size(estimate.host_memory_bytes), size(bytes)),
        None => format!("{} on the CPU (GPUs do not run this scene)", size(estimate.host_memory_bytes)),
    };
    let rows = [
        (
            "particles",
            format!("{} in {bodies} {}", grouped(estimate.particles), if bodies == 1 { "body" } else { "bodies" }),
        ),
        ("grid", format!("{} cells of {} m, {} active blocks", cells.join(" × "), setup.dx, grouped(estimate.blocks))),
        ("memory", memory),
        ("integrator", integration(setup)),
        (
            "",
            format!(
                "{}; {}",
                predicted("explicit", Some(&estimate.explicit)),
                predicted("implicit", estimate.implicit.as_ref())
            ),
        ),
        ("step", format!("{:.3e} s, set by {}", estimate.dt_s, estimate.dt_reason)),
        ("then", runners_up(estimate)),
        (
            "steps",
            format!(
                "{} a frame, {} for {} frames ({} s)",
                grouped(estimate.steps_per_frame),
                grouped(estimate.steps),
                grouped(u64::from(estimate.frames)),
                significant(estimate.simulated_s)
            ),
        ),
        ("device", format!("{} ({}): {}", speed.backend.device, speed.backend.kind, speed.backend.reason)),
        ("speed", format!("{:.2} million particle-steps a second", speed.particle_steps_per_s / 1e6)),
        ("run time", format!("about {}", duration(speed.run_s))),
    ];
    let mut text = format!("{}: valid\n", setup.name);
    for (label, value) in rows {
        text += &format!("  {label:<10} {value}\n");
    }
    for notice in &setup.notices {
        text += &format!("  {:<10} {}\n", "notice", shown(&notice.to_string()));
    }
    text
}

/// The predicted cost of one way to integrate.
fn predicted(name: &str, cost: Option<&Integration>) -> String {
    match cost {
        Some(cost) => format!(
            "{name}: {} steps of {:.1e} s, about {} on two cores",
            grouped(cost.steps),
            cost.dt_s,
            duration(cost.two_cores_s)
        ),
        None => format!("{name}: not with these materials"),
    }
}

/// The bounds that would limit the step if the current one were relaxed.
fn runners_up(estimate: &Estimate) -> String {
    let limit = |l: &Limit| match &l.body {
        Some(body) => format!("{} of '{body}' {:.3e} s", l.rule, l.dt_s),
        None => format!("{} {:.3e} s", l.rule, l.dt_s),
    };
    estimate.dt_limits.iter().skip(1).take(3).map(limit).collect::<Vec<_>>().join(", ")
}

/// 1234567 as 1,234,567.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

fn size(bytes: u64) -> String {
    let units = ["KiB", "MiB", "GiB", "TiB"];
    let mut value = bytes as f64 / 1024.0;
    let mut unit = 0;
    while value >= 1024.0 && unit + 1 < units.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.1} {}", units[unit])
}

fn significant(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn duration(seconds: f64) -> String {
    let s = seconds.round() as u64;
    match s {
        0..=1 => format!("{seconds:.1} s"),
        2..=119 => format!("{s} s"),
        120..=7199 => format!("{} min {:02} s", s / 60, s % 60),
        7200..=172_799 => format!("{} h {:02} min", s / 3600, s / 60 % 60),
        _ => format!("{} days {} h", s / 86_400, s / 3600 % 24),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([grouped(0), grouped(999), grouped(1000), grouped(1234567)], ["0", "999", "1,000", "1,234,567"]);
        assert_eq!([size(2048), size(5 << 20), size(3 << 40)], ["2.0 KiB", "5.0 MiB", "3.0 TiB"]);
        assert_eq!(
            [duration(0.26), duration(75.4), duration(200.0), duration(8000.0)],
            ["0.3 s", "75 s", "3 min 20 s", "2 h 13 min"]
        );
    }
}
