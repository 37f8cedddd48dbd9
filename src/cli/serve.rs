//! `gridfall serve`: the server.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use tracing_subscriber::EnvFilter;

use super::device::DeviceArguments;
use super::{CliError, interrupt};
use gridfall_engine::choice::Devices;
use gridfall_service::http::{self, Config, Options};
use gridfall_service::jobs::{EngineSource, OpenDevices};

/// Run the server. It ends gracefully on SIGINT and SIGTERM: the running job goes back into the
/// queue.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Address and port; port 0 takes a free one. The address taken is printed.
    #[arg(long, default_value = "127.0.0.1:8080", env = "GRIDFALL_LISTEN")]
    listen: SocketAddr,
    /// Where jobs and their recordings are kept. One server a directory.
    #[arg(long, default_value = "./gridfall-data", value_name = "DIR", env = "GRIDFALL_DATA_DIR")]
    data_dir: PathBuf,
    /// Where the queue is kept: postgres://USER:PASSWORD@HOST/NAME, or sqlite:PATH; by default a file in the data
    /// directory. Other users of the machine can read command lines: pass a password by the environment.
    #[arg(long, value_name = "URL", env = "GRIDFALL_DATABASE", hide_env_values = true)]
    database: Option<String>,
    /// Listen on an address that other machines can reach, although nobody is asked for a key.
    /// Anyone who can reach the server can then run, read and delete jobs: for containers and
    /// networks that keep strangers out.
    #[arg(long, env = "GRIDFALL_INSECURE_NO_AUTH")]
    insecure_no_auth: bool,
    /// Jobs that may wait; more are refused with 429.
    #[arg(
        long,
        default_value_t = Config::default().max_queued,
        value_name = "N",
        value_parser = clap::value_parser!(i64).range(1..)
    )]
    max_queued: i64,
    /// Save a running job's state this often (s); after a crash it goes on from there.
    #[arg(
        long,
        default_value_t = 30.0,
        value_name = "SECONDS",
        value_parser = positive,
        env = "GRIDFALL_CHECKPOINT_SECONDS"
    )]
    checkpoint_seconds: f64,
    #[command(flatten)]
    device: DeviceArguments,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn,gridfall=info"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    let options = Options {
        listen: arguments.listen,
        data_dir: arguments.data_dir,
        database: arguments.database,
        insecure_no_auth: arguments.insecure_no_auth,
        config: Config { max_queued: arguments.max_queued, ..Config::default() },
        checkpoint_every: Duration::from_secs_f64(arguments.checkpoint_seconds),
        devices: opener(arguments.device),
    };
    let runtime = runtime()?;
    let served = runtime.block_on(async {
        let shutdown = interrupt::requested().map_err(|error| CliError::Failed(error.to_string()))?;
        let listening = |address| println!("listening on http://{address}");
        http::serve(options, listening, shutdown).await.map_err(|error| {
            if error.is_bad_input() {
                CliError::BadInput(error.to_string())
            } else {
                CliError::Failed(error.to_string())
            }
        })
    });
    // Scenes may still be under validation for clients that have gone.
    runtime.shutdown_timeout(Duration::from_millis(100));
    served
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (1e-3..=1e6).contains(&seconds) => Ok(seconds),
        _ => Err("give seconds between 0.001 and 1,000,000".into()),
    }
}

/// How the worker opens its devices.
pub fn opener(device: DeviceArguments) -> OpenDevices {
    Box::new(move || {
        let devices = Devices::open(device.choice(), device.adapter.as_deref())?;
        Ok(Box::new(devices) as Box<dyn EngineSource>)
    })
}

pub fn runtime() -> Result<tokio::runtime::Runtime, CliError> {
    tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| CliError::Failed(format!("cannot start: {error}")))
}
