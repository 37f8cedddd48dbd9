//! `gridfall bench`: measures the named cases, or a scene, as a table or JSON; `bench implicit`
//! compares implicit methods.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use serde::de::DeserializeOwned;

use super::device::DeviceArguments;
use super::talk::remark;
use super::{CliError, bench_implicit};
use crate::bench::{self, BenchError, CASES, Row, Size};
use gridfall_core::sim::setup::{Kernel, Precision};
use gridfall_engine::choice::Devices;

/// Measure speed: particle-steps a second, GPU time per stage, share of the memory bandwidth.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// Scene file to measure instead of the named cases.
    scene: Option<PathBuf>,
    /// Sizes of the named cases (small, medium, large); default: all on a real GPU, else small and
    /// medium.
    #[arg(long, value_delimiter = ',', value_parser = named::<Size>)]
    sizes: Vec<Size>,
    /// Interpolation kernel of the named cases.
    #[arg(long, default_value = "compact", value_parser = named::<Kernel>)]
    kernel: Kernel,
    /// Precision of the named cases; f64 runs on the CPU only.
    #[arg(long, default_value = "f32", value_parser = named::<Precision>)]
    precision: Precision,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    device: DeviceArguments,
}

#[derive(Debug, Subcommand)]
enum Command {
    Implicit(bench_implicit::Arguments),
}

/// Parses a name as scenes spell it.
pub(super) fn named<T: DeserializeOwned>(name: &str) -> Result<T, String> {
    serde_json::from_value(serde_json::Value::String(name.into())).map_err(|e| e.to_string())
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    if let Some(Command::Implicit(arguments)) = arguments.command {
        return bench_implicit::execute(arguments);
    }
    let devices = Devices::open(arguments.device.choice(), arguments.device.adapter.as_deref())
        .map_err(|e| CliError::BadInput(e.to_string()))?;
    let mut rows = Vec::new();
    let mut measure = |json: &str, case: &str, size: &str| -> Result<(), CliError> {
        let problem = bench::problem(json).map_err(|e| failed(e, case))?;
        remark(format_args!("{case} {size}: {} particles", problem.particles.len()));
        let row = bench::measure(&devices, &problem, case, size).map_err(|e| failed(e, case))?;
        if !arguments.json {
            print(&row);
        }
        rows.push(row);
        Ok(())
    };
    if let Some(path) = &arguments.scene {
        let json = std::fs::read_to_string(path)
            .map_err(|e| CliError::BadInput(format!("cannot read {}: {e}", path.display())))?;
        measure(&json, &path.display().to_string(), "scene")?;
    } else {
        let software = devices.gpu().is_none_or(|g| g.is_software());
        let sizes = match &arguments.sizes[..] {
            [] if software => &Size::ALL[..2],
            [] => &Size::ALL[..],
            chosen => chosen,
        };
        for case in CASES {
            for &size in sizes {
                measure(&bench::scene_json(case, size, arguments.kernel, arguments.precision), case, size.name())?;
            }
        }
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&rows).expect("rows are plain data"));
    }
    Ok(())
}

fn failed(error: BenchError, scene: &str) -> CliError {
    match error {
        BenchError::Faults(faults) => CliError::Faults { scene: scene.into(), faults },
        BenchError::Engine(e) => CliError::Failed(e.to_string()),
    }
}

fn print(row: &Row) {
    let rate = row.particle_steps_per_s;
    println!("{} {} on {} ({})", row.case, row.size, row.backend.device, row.backend.reason);
    println!("  {} particles, {} {}, dt {:.3e} s", row.particles, name(&row.kernel), name(&row.precision), row.dt_s);
    println!("  {:.2} M particle-steps/s (min {:.2}, max {:.2})", rate.median / 1e6, rate.min / 1e6, rate.max / 1e6);
    println!("  {:.1} s wall a simulated second", row.wall_s_per_simulated_s);
    println!(
        "  {:.1} % of the copy bandwidth of {:.1} GB/s at {:.0} B a particle-step",
        100.0 * row.floor_share,
        row.copy_bandwidth_b_s / 1e9,
        row.floor_bytes
    );
    for stage in &row.stages {
        println!("  {:>12} {:>10.1} µs a step", stage.stage, stage.us_per_step);
    }
}

/// The spelling of a value in scenes.
pub(super) fn name(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}
