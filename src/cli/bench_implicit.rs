//! `gridfall bench implicit`: compares the methods of the implicit integrator, as a table or JSON.

use std::time::Duration;

use clap::Args;

use super::CliError;
use super::bench::named;
use super::device::DeviceArguments;
use crate::bench::implicit::{Case, REFERENCE, Row, SCENES, labels};
use crate::bench::spelled;
use gridfall_core::sim::setup::{Kernel, Problem};
use gridfall_engine::choice::Devices;

/// Compare the methods of the implicit integrator on reduced scenes of the HOT paper: time, outer
/// and inner iterations, ratio to hot.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Scenes (twist, boxes, donut, …, stiffness-sweep); default: all.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Methods as scenes spell them, and hot-published: hot with gauss-seidel smoothing and
    /// adaptive coarse solves; default: all.
    #[arg(long, value_delimiter = ',')]
    methods: Vec<String>,
    /// Interpolation kernels.
    #[arg(long, value_delimiter = ',', default_value = "quadratic", value_parser = named::<Kernel>)]
    kernels: Vec<Kernel>,
    /// Tolerances ε; several show how the methods converge.
    #[arg(long, value_delimiter = ',', default_value = "1e-7")]
    tolerances: Vec<f64>,
    /// Frames of each run at most.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Wall time of each run at most (s); what takes longer has not converged.
    #[arg(long, default_value_t = 600.0)]
    limit: f64,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    device: DeviceArguments,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let names: Vec<String> = SCENES.iter().map(|(name, _)| (*name).to_owned()).collect();
    let scenes = chosen(&arguments.scenes, names, "scene")?;
    let methods = chosen(&arguments.methods, labels(), "method")?;
    let limit = Duration::try_from_secs_f64(arguments.limit)
        .map_err(|error| CliError::BadInput(format!("--limit {}: {error}", arguments.limit)))?;
    let devices = Devices::open(arguments.device.choice(), arguments.device.adapter.as_deref())
        .map_err(|error| CliError::BadInput(error.to_string()))?;
    let mut rows: Vec<Row> = Vec::new();
    for case in Case::all(&scenes, &methods, &arguments.kernels, &arguments.tolerances) {
        let what = format!("{} {} {}", case.scene, case.variant, case.method);
        let problem = match case.problem(arguments.frames) {
            Ok(problem) => problem,
            Err(faults) => {
                eprintln!(
                    "{what}: left out: {}",
                    faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
                );
                continue;
            }
        };
        let Problem { setup, particles } = problem;
        let mut engine =
            devices.engine(&setup, particles).map_err(|error| CliError::Failed(format!("{what}: {error}")))?;
        let (row, error) = case.run(&setup, engine.as_mut(), limit);
        if let Some(error) = error {
            eprintln!("{what}: ended early: {error}");
        }
        if !arguments.json {
            if rows.is_empty() {
                println!("{HEADER}");
            }
            println!("{}", line(&row, &rows));
        }
        rows.push(row);
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&rows).expect("rows are plain data"));
    }
    Ok(())
}

/// The names that were asked for, or all if none were.
fn chosen(asked: &[String], known: Vec<String>, what: &str) -> Result<Vec<String>, CliError> {
    match asked.iter().find(|name| !known.contains(name)) {
        Some(name) => {
            let message = format!("there is no {what} `{name}` to compare; there are {}", known.join(", "));
            Err(CliError::BadInput(message))
        }
        // In the order of the table, so that the reference comes first.
        None => Ok(known.into_iter().filter(|name| asked.is_empty() || asked.contains(name)).collect()),
    }
}

const HEADER: &str = "\
scene            variant   method         kernel     steps   time (s)  s/frame max  outer/step  inner/step   \
time: hot  outer: hot  converged";

/// A row of the table; `before` contains that of the reference.
fn line(row: &Row, before: &[Row]) -> String {
    let same = |other: &&Row| {
        (&other.scene, &other.variant, other.kernel) == (&row.scene, &row.variant, row.kernel)
            && other.method == REFERENCE
    };
    let reference = before.iter().find(same);
    let ratio = |value: f64, of: fn(&Row) -> f64| match reference {
        Some(reference) => format!("{:.2}", value / of(reference)),
        None => "—".into(),
    };
    let steps = row.steps.max(1) as f64;
    format!(
        "{:<16} {:<9} {:<14} {:<9} {:>6} {:>10.2} {:>12.2} {:>11.1} {:>11.1} {:>11} {:>11}  {}",
        row.scene,
        row.variant,
        row.method,
        spelled(&row.kernel),
        row.steps,
        row.time_s,
        row.frame_time_s.iter().fold(0.0f64, |most, &s| most.max(s)),
        row.outer_iterations as f64 / steps,
        row.inner_iterations as f64 / steps,
        ratio(row.time_s, |r| r.time_s),
        ratio(row.outer_iterations as f64 / steps, |r| r.outer_iterations as f64 / r.steps.max(1) as f64),
        if row.converged { "yes" } else { "NO" }
    )
}
