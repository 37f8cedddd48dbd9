//! `gridfall serve`: the server.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::device::{DeviceArguments, ServerDevices};
use super::executor::{ExecutorArguments, Home};
use super::logs::LogArguments;
use super::{CliError, interrupt};
use gridfall_engine::choice::Devices;
use gridfall_service::http::{self, Certificate, Config, Options, Patience};
use gridfall_service::jobs::retention::Keep;
use gridfall_service::jobs::{EngineSource, OpenDevices, Settings, yield_to_requests};

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
    /// Keep the outputs of jobs and the uploads in S3 or what speaks its protocol: s3://BUCKET or
    /// s3://BUCKET/PREFIX. The data directory then holds copies. The endpoint, the region and the
    /// credentials come from AWS_ENDPOINT_URL, AWS_REGION, AWS_ACCESS_KEY_ID and
    /// AWS_SECRET_ACCESS_KEY, or from the machine's role.
    #[arg(long, value_name = "URL", env = "GRIDFALL_FILES")]
    files: Option<String>,
    /// With --files: room for copies of recordings and last states here (bytes). More of them are removed, and fetched
    /// when they are asked for.
    #[arg(long, default_value_t = 20 << 30, value_name = "N", env = "GRIDFALL_CACHE_BYTES")]
    cache_bytes: u64,
    /// Listen on an address that other machines can reach, although there are no keys.
    /// Anyone who can reach the server can then run, read and delete jobs: for containers and
    /// networks that keep strangers out. Once there are keys (`gridfall keys create`), everybody is
    /// asked for one.
    #[arg(long, env = "GRIDFALL_INSECURE_NO_AUTH")]
    insecure_no_auth: bool,
    /// Ask everybody for a key, even before there is one.
    #[arg(long, env = "GRIDFALL_REQUIRE_KEYS")]
    require_keys: bool,
    /// Speak TLS (https) with this certificate: a PEM file with those that it depends on. It is read
    /// again when it changes.
    #[arg(long, value_name = "FILE", requires = "tls_key", env = "GRIDFALL_TLS_CERT")]
    tls_cert: Option<PathBuf>,
    /// The private key of --tls-cert, a PEM file.
    #[arg(long, value_name = "FILE", requires = "tls_cert", env = "GRIDFALL_TLS_KEY")]
    tls_key: Option<PathBuf>,
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
    /// Small jobs that each device may run at a time beside another job. They leave most of a device idle,
    /// and many of them end sooner together.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u16).range(..=64),
        env = "GRIDFALL_SMALL_JOBS")]
    small_jobs: u16,
    /// With --small-jobs: the most particles of a small job.
    #[arg(long, default_value_t = Settings::default().small_particles, value_name = "N",
        env = "GRIDFALL_SMALL_PARTICLES")]
    small_particles: u64,
    /// Let pages of this origin use the API, its scheme, host and port. Repeatable.
    #[arg(long, value_name = "ORIGIN", value_parser = origin, env = "GRIDFALL_CORS_ORIGIN", value_delimiter = ',')]
    cors_origin: Vec<String>,
    /// A name by which clients reach the server, besides its addresses and localhost. Requests that
    /// change something under another name are refused, because a stranger's page may have made
    /// them. Repeatable.
    #[arg(long, value_name = "NAME", env = "GRIDFALL_ALLOW_HOST", value_delimiter = ',')]
    allow_host: Vec<String>,
    /// Free disk space below which no job is accepted and the server is not ready (bytes).
    #[arg(long, default_value_t = Config::default().min_free_bytes, value_name = "N",
        env = "GRIDFALL_MIN_FREE_BYTES")]
    min_free_bytes: u64,
    /// Work of counting the particles of one scene: distances asked for, times the parts of the
    /// shape. Costlier scenes are refused.
    #[arg(long, default_value_t = Config::default().max_work, value_name = "N")]
    max_work: u64,
    /// Requests that are answered at a time; more are refused with 503.
    #[arg(long, default_value_t = Config::default().max_in_flight, value_name = "N")]
    max_in_flight: usize,
    /// Connections at a time; those beyond get 503 for all but health, metrics and cancel.
    #[arg(long, default_value_t = Config::default().max_connections, value_name = "N")]
    max_connections: usize,
    /// Remove jobs and their files this many days after their end. Without, they are kept for ever.
    #[arg(long, value_name = "N", env = "GRIDFALL_KEEP_DAYS", value_parser = clap::value_parser!(u32).range(1..))]
    keep_days: Option<u32>,
    /// Remove the oldest ended jobs while the files of all jobs take more bytes than this.
    #[arg(long, value_name = "N", env = "GRIDFALL_KEEP_BYTES")]
    keep_bytes: Option<u64>,
    /// Addresses that webhooks may be at although they are not on the internet: a range (CIDR) or an address.
    /// Repeatable.
    #[arg(long, value_name = "CIDR", value_parser = http::address_range, env = "GRIDFALL_ALLOW_WEBHOOK_ADDRESS",
        value_delimiter = ',')]
    allow_webhook_address: Vec<http::AddressRange>,
    /// Times that a message to a webhook is sent before it is given up.
    #[arg(long, default_value_t = Patience::default().attempts, value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..=100))]
    webhook_attempts: u32,
    /// Wait before a message that did not arrive is sent again (s). Each further wait is three times as long, up to
    /// eight hours.
    #[arg(long, default_value_t = Patience::default().first_wait_s, value_name = "SECONDS", value_parser = positive)]
    webhook_retry_seconds: f64,
    #[command(flatten)]
    logs: LogArguments,
    #[command(flatten)]
    devices: ServerDevices,
    #[command(flatten)]
    executor: ExecutorArguments,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    arguments.logs.start()?;
    // Each connection and each download takes a file descriptor.
    if let Err(error) = rlimit::increase_nofile_limit(u64::MAX) {
        tracing::warn!(%error, "cannot raise the limit of open files");
    }
    rayon::ThreadPoolBuilder::new()
        .start_handler(|_| yield_to_requests())
        .build_global()
        .map_err(|error| CliError::Failed(format!("cannot start threads: {error}")))?;
    let runtime = runtime()?;
    let home = Home {
        data_dir: &arguments.data_dir,
        database: arguments.database.as_deref(),
        files: arguments.files.as_deref(),
        checkpoint_seconds: arguments.checkpoint_seconds,
    };
    let executor = runtime.block_on(arguments.executor.choose(arguments.devices, home))?;
    let certificate = arguments.tls_cert.zip(arguments.tls_key).map(|(chain, key)| Certificate { chain, key });
    let scheme = if certificate.is_some() { "https" } else { "http" };
    let options = Options {
        listen: arguments.listen,
        data_dir: arguments.data_dir,
        database: arguments.database,
        files: arguments.files.map(|files| (files, arguments.cache_bytes)),
        insecure_no_auth: arguments.insecure_no_auth,
        certificate,
        keep: Keep {
            time: arguments.keep_days.map(|days| Duration::from_secs(u64::from(days) * 86_400)),
            bytes: arguments.keep_bytes,
        },
        config: Config {
            max_queued: arguments.max_queued,
            require_keys: arguments.require_keys,
            cors_origins: arguments.cors_origin.iter().filter_map(|origin| origin.parse().ok()).collect(),
            allowed_hosts: arguments.allow_host,
            min_free_bytes: arguments.min_free_bytes,
            max_work: arguments.max_work,
            max_in_flight: arguments.max_in_flight,
            max_connections: arguments.max_connections,
            webhook_addresses: arguments.allow_webhook_address,
            webhook_patience: Patience {
                attempts: arguments.webhook_attempts,
                first_wait_s: arguments.webhook_retry_seconds,
            },
            ..Config::default()
        },
        checkpoint_every: Duration::from_secs_f64(arguments.checkpoint_seconds),
        small_jobs: (arguments.small_jobs.into(), arguments.small_particles),
        executor,
    };
    let served = runtime.block_on(async {
        let shutdown = interrupt::requested().map_err(|error| CliError::Failed(error.to_string()))?;
        let listening = |address| println!("listening on {scheme}://{address}");
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

pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (1e-3..=1e6).contains(&seconds) => Ok(seconds),
        _ => Err("give seconds between 0.001 and 1,000,000".into()),
    }
}

/// An origin as browsers send it: scheme, host and, unless usual, port.
fn origin(text: &str) -> Result<String, String> {
    let rest = text.strip_prefix("https://").or_else(|| text.strip_prefix("http://"));
    let sound = |rest: &str| !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_graphic() && !b"/?#@*,".contains(&b));
    if rest.is_some_and(sound) {
        Ok(text.to_ascii_lowercase())
    } else {
        Err("an origin is a scheme and a host without a path, such as https://app.example or http://localhost:3000"
            .into())
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
