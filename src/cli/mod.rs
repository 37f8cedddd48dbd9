//! The command line: arguments, progress and exit codes. One file per command.

mod adapters;
mod bench;
mod bench_implicit;
mod bench_table;
mod check;
mod demo;
mod device;
mod executor;
mod export;
mod frames;
mod init;
mod interrupt;
mod keys;
mod logs;
mod manual;
mod material;
mod render;
mod run;
mod schema;
mod serve;
mod surface;
mod talk;
mod verify;
mod worker;

use std::fmt;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use gridfall_scene::Fault;

/// A headless, GPU-first compute service for the material point method (MPM).
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
struct Arguments {
    /// Say nothing but results and errors.
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Serve(Box<serve::Arguments>),
    Worker(worker::Arguments),
    Keys(keys::Arguments),
    Init(init::Arguments),
    Run(run::Arguments),
    Check(check::Arguments),
    Material(material::Arguments),
    Demo(demo::Arguments),
    Export(export::Arguments),
    Render(render::Arguments),
    Surface(surface::Arguments),
    Adapters(adapters::Arguments),
    Bench(bench::Arguments),
    Verify(verify::Arguments),
    Schema(schema::Arguments),
    Completions(manual::CompletionArguments),
    Man(manual::ManArguments),
}

impl Command {
    fn execute(self) -> Result<(), CliError> {
        match self {
            Self::Serve(arguments) => serve::execute(*arguments),
            Self::Worker(arguments) => worker::execute(arguments),
            Self::Keys(arguments) => keys::execute(arguments),
            Self::Init(arguments) => init::execute(arguments),
            Self::Run(arguments) => run::execute(arguments),
            Self::Check(arguments) => check::execute(arguments),
            Self::Material(arguments) => material::execute(arguments),
            Self::Demo(arguments) => demo::execute(arguments),
            Self::Export(arguments) => export::execute(arguments),
            Self::Render(arguments) => render::execute(arguments),
            Self::Surface(arguments) => surface::execute(arguments),
            Self::Adapters(arguments) => adapters::execute(arguments),
            Self::Bench(arguments) => bench::execute(arguments),
            Self::Verify(arguments) => verify::execute(arguments),
            Self::Schema(arguments) => schema::execute(arguments),
            Self::Completions(arguments) => manual::completions(arguments),
            Self::Man(arguments) => manual::man(arguments),
        }
    }
}

/// Parses the command line and runs the command. Returns 0 when done, 1 when a job failed, 2 for
/// bad input.
pub fn main() -> ExitCode {
    return_large_arrays();
    let arguments = Arguments::parse();
    if arguments.quiet {
        talk::be_quiet();
    }
    match arguments.command.execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            error.exit_code()
        }
    }
}

/// Makes the allocator return arrays of a megabyte and more to the system as soon as they are freed.
/// By default glibc comes to keep those below 32 MiB for itself: a sixth of the memory of a run.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn return_large_arrays() {
    // SAFETY: it only sets a parameter of malloc.
    unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, 1 << 20) };
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn return_large_arrays() {}

/// Why a command failed.
#[derive(Debug)]
enum CliError {
    /// The work itself failed.
    Failed(String),
    /// The command could not start with this input.
    BadInput(String),
    /// The command was told to stop, and is to end with this code.
    Stopped(u8),
    /// A scene has faults.
    Faults { scene: String, faults: Vec<Fault> },
}

impl CliError {
    fn exit_code(&self) -> ExitCode {
        match self {
            Self::Failed(_) => ExitCode::from(1),
            Self::Stopped(code) => ExitCode::from(*code),
            Self::BadInput(_) | Self::Faults { .. } => ExitCode::from(2),
        }
    }
}

impl fmt::Display for CliError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Failed(message) | Self::BadInput(message) => write!(f, "error: {message}"),
            Self::Stopped(_) => write!(f, "told to stop; the job goes on in another attempt"),
            Self::Faults { scene, faults } => {
                let n = faults.len();
                write!(f, "error: {scene} has {n} {}", if n == 1 { "fault" } else { "faults" })?;
                faults.iter().try_for_each(|fault| write!(f, "\n  {fault}"))
            }
        }
    }
}
