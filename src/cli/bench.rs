//! `gridfall bench`: measures the named cases, or a scene, as a table or JSON, and compares with earlier measurements;
//! `bench implicit` compares implicit methods.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde::de::DeserializeOwned;

use super::device::DeviceArguments;
use super::talk::remark;
use super::{CliError, bench_implicit, bench_table};
use crate::bench::amount::Amount;
use crate::bench::cases::Case;
use crate::bench::{self, BenchError, Row, compare};
use gridfall_core::sim::setup::{Kernel, Precision};
use gridfall_engine::choice::Devices;

/// Measure speed: particle-steps a second, time and bytes of each stage, share of the memory bandwidth.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// Scene file to measure instead of the named cases.
    scene: Option<PathBuf>,
    /// Cases (fluid, pair, sand, nacc, bullet); default: all.
    #[arg(long, value_delimiter = ',', value_name = "NAME", value_parser = named::<Case>, conflicts_with = "scene")]
    cases: Vec<Case>,
    /// Particles of each case, as in 17k, 0.8M or `largest`: as many as fit. Default: those that results are published
    /// with on a real GPU, else 17k and 262k.
    #[arg(long, value_delimiter = ',', value_name = "COUNT", conflicts_with = "scene")]
    particles: Vec<Amount>,
    /// Interpolation kernel of the named cases.
    #[arg(long, default_value = "compact", value_parser = named::<Kernel>)]
    kernel: Kernel,
    /// Precision of the named cases; f64 runs on the CPU only.
    #[arg(long, default_value = "f32", value_parser = named::<Precision>)]
    precision: Precision,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
    /// Earlier measurements (--json) to compare with, row by row.
    #[arg(long, value_name = "OLD.json")]
    compare: Option<PathBuf>,
    /// Take the measurements from a file (--json) instead of making them.
    #[arg(long, value_name = "NEW.json", conflicts_with_all = ["scene", "cases", "particles"])]
    from: Option<PathBuf>,
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
    let read = |path: &PathBuf| compare::read(path).map_err(CliError::BadInput);
    // Before hours of measurements.
    let old = arguments.compare.as_ref().map(read).transpose()?;
    let mut report = Report { json: arguments.json, old, rows: Vec::new() };
    let outcome = match (&arguments.from, &arguments.scene) {
        (Some(path), _) => {
            read(path)?.into_iter().for_each(|row| report.add(row));
            Ok(())
        }
        (None, Some(path)) => measure_scene(&arguments, path, &mut report),
        (None, None) => measure_cases(&arguments, &mut report),
    };
    report.end();
    outcome
}

/// Rows as they come.
struct Report {
    json: bool,
    /// Rows to compare with.
    old: Option<Vec<Row>>,
    rows: Vec<Row>,
}

impl Report {
    fn add(&mut self, mut row: Row) {
        row.compared = None;
        if let Some(old) = &self.old {
            compare::compare_row(&mut row, old);
        }
        if !self.json {
            print!("{}", bench_table::text(&row));
        }
        self.rows.push(row);
    }

    /// What was done is worth printing even if something failed.
    fn end(self) {
        if self.json {
            println!("{}", serde_json::to_string_pretty(&self.rows).expect("rows are plain data"));
        }
        if let Some(old) = &self.old {
            compare::doubts(&self.rows, old).into_iter().for_each(|doubt| eprintln!("warning: {doubt}"));
        }
    }
}

fn open(arguments: &Arguments) -> Result<(Devices, f64), CliError> {
    let devices = Devices::open(arguments.device.choice(), arguments.device.adapter.as_deref())
        .map_err(|e| CliError::BadInput(e.to_string()))?;
    let bandwidth = bench::copy_bandwidth(&devices).map_err(|e| CliError::Failed(e.to_string()))?;
    Ok((devices, bandwidth))
}

fn measure_scene(arguments: &Arguments, path: &Path, report: &mut Report) -> Result<(), CliError> {
    let json = std::fs::read_to_string(path)
        .map_err(|e| CliError::BadInput(format!("cannot read {}: {e}", path.display())))?;
    let (devices, bandwidth) = open(arguments)?;
    let case = path.display().to_string();
    report.add(bench::measure(&devices, bandwidth, &json, &case).map_err(|e| failed(e, &case))?);
    Ok(())
}

/// The smallest first. Errors: of a case that failed, after all others are done.
fn measure_cases(arguments: &Arguments, report: &mut Report) -> Result<(), CliError> {
    let (devices, bandwidth) = open(arguments)?;
    let on_processor = devices.gpu().is_none_or(|gpu| gpu.is_software());
    let cases = if arguments.cases.is_empty() { &Case::ALL[..] } else { &arguments.cases };
    let (kernel, precision) = (arguments.kernel, arguments.precision);
    let mut asked = Vec::new();
    for &case in cases {
        let amounts = if arguments.particles.is_empty() { case.amounts(on_processor) } else { &arguments.particles };
        for amount in amounts {
            let particles = amount.particles(&devices, case, kernel, precision).map_err(|e| failed(e, case.name()))?;
            asked.push((particles, case));
        }
    }
    asked.sort_by_key(|(particles, _)| *particles);
    let mut outcome = Ok(());
    for (particles, case) in asked {
        let name = case.name();
        remark(format_args!("{name}: about {particles} particles"));
        match bench::measure(&devices, bandwidth, &case.scene(particles, kernel, precision), name) {
            Ok(row) => report.add(row),
            Err(error) => {
                remark(format_args!("{name}: failed"));
                outcome = Err(failed(error, &format!("{name} of {particles} particles")));
            }
        }
    }
    outcome
}

fn failed(error: BenchError, scene: &str) -> CliError {
    match error {
        BenchError::Faults(faults) => CliError::Faults { scene: scene.into(), faults },
        BenchError::Engine(e) => CliError::Failed(format!("{scene}: {e}")),
    }
}
