//! `gridfall verify`: the verification cases on this machine, as a table or JSON.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use serde::Serialize;

use super::CliError;
use super::device::DeviceArguments;
use super::talk::remark;
use crate::verify::{self, CASES, Case, Curve, Extent, Row, Scope, Target};
use gridfall_engine::choice::{Choice, Devices};
use gridfall_recording::provenance;

/// Check this build and this machine against known answers. Exit code 1 if a row fails.
///
/// Runs on the CPU in f64 and, where a real GPU is found or one is named, the cases that a GPU can
/// run on that as well.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Run this case only; may be repeated.
    #[arg(long = "case", value_name = "NAME", value_parser = case)]
    cases: Vec<&'static str>,
    /// A few variants of each case, coarse: under a minute (the default).
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// Every variant, as documented in docs/VALIDATION.md: ten minutes on two cores.
    #[arg(long)]
    full: bool,
    /// List the cases with their claims, and do nothing.
    #[arg(long)]
    list: bool,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
    /// Write the curves of the cases to this directory, as CSV.
    #[arg(long, value_name = "DIR")]
    curves: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArguments,
}

/// The output of `--json`.
#[derive(Serialize)]
struct Report {
    version: &'static str,
    commit: &'static str,
    extent: &'static str,
    /// The adapter, if one was used.
    gpu: Option<String>,
    wall_s: f64,
    passed: usize,
    failed: usize,
    rows: Vec<Row>,
}

fn case(name: &str) -> Result<&'static str, String> {
    let known = CASES.iter().find(|case| case.name == name);
    known.map(|case| case.name).ok_or_else(|| {
        let names: Vec<&str> = CASES.iter().map(|case| case.name).collect();
        format!("the cases are {}", names.join(", "))
    })
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    if arguments.list {
        CASES.iter().for_each(describe);
        return Ok(());
    }
    let choice = arguments.device.choice();
    let devices =
        Devices::open(choice, arguments.device.adapter.as_deref()).map_err(|e| CliError::BadInput(e.to_string()))?;
    let mut targets = Vec::new();
    if choice != Choice::Gpu {
        targets.push(Target::Cpu);
    }
    if devices.gpu().is_some() {
        targets.push(Target::Gpu);
    }
    let extent = if arguments.full { Extent::Full } else { Extent::Quick };
    let begin = Instant::now();
    let (mut rows, mut curves) = (Vec::new(), Vec::new());
    let cases: Vec<&Case> =
        CASES.iter().filter(|c| arguments.cases.is_empty() || arguments.cases.contains(&c.name)).collect();
    let scope = Scope { devices: &devices, targets: &targets, extent, log: &|line| remark(line) };
    verify::run(&cases, scope, |case, outcome| {
        remark(format_args!("{}: {:.1} s", case.name, outcome.wall.as_secs_f64()));
        if !arguments.json && !outcome.rows.is_empty() {
            describe(case);
            outcome.rows.iter().for_each(print);
        }
        rows.extend(outcome.rows);
        curves.extend(outcome.curves);
    });
    if let Some(directory) = &arguments.curves {
        write_curves(directory, &curves)?;
    }
    let failed = rows.iter().filter(|row| !row.pass).count();
    let summary = format!("{} rows, {failed} failed", rows.len());
    if arguments.json {
        let report = Report {
            version: provenance::VERSION,
            commit: provenance::COMMIT,
            extent: if arguments.full { "full" } else { "quick" },
            gpu: devices.gpu().map(|gpu| gpu.backend(devices.reason()).device),
            wall_s: begin.elapsed().as_secs_f64(),
            passed: rows.len() - failed,
            failed,
            rows,
        };
        println!("{}", serde_json::to_string_pretty(&report).expect("rows are plain data"));
    } else {
        println!("{summary}");
    }
    if failed > 0 { Err(CliError::Failed(summary)) } else { Ok(()) }
}

fn describe(case: &Case) {
    println!("{}: {} ({})", case.name, case.claim, case.source);
}

fn print(row: &Row) {
    let verdict = if row.pass { "pass" } else { "FAIL" };
    let (expected, got) = (verify::number(row.expected), verify::number(row.got));
    println!(
        "  {verdict}  {:<8} {:<22} {:<40} expected {expected:>10} got {got:>10} {} ({})",
        row.engine,
        row.variant,
        row.quantity,
        row.unit,
        row.tolerance_text()
    );
    if let Some(error) = &row.error {
        println!("        {error}");
    }
}

fn write_curves(directory: &std::path::Path, curves: &[Curve]) -> Result<(), CliError> {
    let cannot = |e: std::io::Error| CliError::BadInput(format!("cannot write {}: {e}", directory.display()));
    std::fs::create_dir_all(directory).map_err(cannot)?;
    for curve in curves {
        std::fs::write(directory.join(format!("{}.csv", curve.name)), verify::curve_csv(curve)).map_err(cannot)?;
    }
    Ok(())
}
