//! `gridfall keys`: who may use a server, and how much of it.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand};
use jiff::Timestamp;
use serde_json::{Value, json};

use super::CliError;
use super::serve::runtime;
use super::talk::remark;
use gridfall_service::store::{
    DataDir, JobStore, Key, MAX_KEY_NAME, NewKey, Quotas, Scope, Secret, Standing, StoreError, USAGE_DAYS, Usage,
};

/// Make, list and revoke the keys of clients, also while a server runs on the same data.
///
/// Once there is a key, the server asks everybody for one, and will not stop to. What jobs a key has submitted
/// belong to it, and keys see nothing of each other's.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

/// The database of a server.
#[derive(Debug, Args)]
struct Place {
    /// The server's data directory.
    #[arg(long, default_value = "./gridfall-data", value_name = "DIR", env = "GRIDFALL_DATA_DIR")]
    data_dir: PathBuf,
    /// The server's database, if it has another one than the file in its data directory.
    #[arg(long, value_name = "URL", env = "GRIDFALL_DATABASE", hide_env_values = true)]
    database: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a key and print its secret, which nobody can see again.
    Create {
        /// For people, logs and metrics: 1 to 64 letters, digits and any of `.`, `_`, `-`.
        #[arg(value_parser = name)]
        name: String,
        /// What it allows: `read` results, `submit` jobs, too, or `admin`: all that is on the server.
        #[arg(long, default_value = "submit", value_name = "read|submit|admin")]
        scope: Scope,
        /// The key ends after so many days. Without, it has no end.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=36_500))]
        expires_days: Option<u32>,
        #[command(flatten)]
        quotas: QuotaArguments,
        #[command(flatten)]
        place: Place,
    },
    /// List all keys.
    List {
        #[command(flatten)]
        place: Place,
    },
    /// Show a key, its quotas and what it has used.
    Show {
        name: String,
        #[command(flatten)]
        place: Place,
    },
    /// Set the quotas of a key, all of them: those left out are none.
    Limit {
        name: String,
        #[command(flatten)]
        quotas: QuotaArguments,
        #[command(flatten)]
        place: Place,
    },
    /// Give a key another secret, as when it became known or is to expire. The old one is void; what belongs to
    /// the key stays its own. A key that was revoked is good again.
    Renew {
        name: String,
        /// The key ends after so many days from now. Without, it has no end.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=36_500))]
        expires_days: Option<u32>,
        #[command(flatten)]
        place: Place,
    },
    /// End a key. Servers refuse it within 3 seconds; its jobs stay.
    Revoke {
        name: String,
        #[command(flatten)]
        place: Place,
    },
}

#[derive(Debug, Args)]
struct QuotaArguments {
    /// Most jobs of the key that wait.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(i64).range(1..))]
    max_queued: Option<i64>,
    /// Most jobs of the key that run at a time.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(i64).range(1..))]
    max_running: Option<i64>,
    /// Most particles of a scene.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(i64).range(1..))]
    max_particles: Option<i64>,
    /// Most bytes of outputs and uploads that are kept for the key.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(i64).range(1..))]
    max_bytes: Option<i64>,
    /// Most time on devices within 30 days (s).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(i64).range(1..))]
    max_device_seconds: Option<i64>,
}

impl QuotaArguments {
    fn quotas(&self) -> Quotas {
        Quotas {
            queued: self.max_queued,
            running: self.max_running,
            particles: self.max_particles,
            bytes: self.max_bytes,
            device_s: self.max_device_seconds,
        }
    }
}

fn name(text: &str) -> Result<String, String> {
    let sound = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
    if (1..=MAX_KEY_NAME).contains(&text.len()) && text.bytes().all(sound) {
        Ok(text.to_owned())
    } else {
        Err(format!("a name has 1 to {MAX_KEY_NAME} letters, digits and any of `.`, `_`, `-`"))
    }
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    runtime()?.block_on(run(arguments.command))
}

async fn run(command: Command) -> Result<(), CliError> {
    match command {
        Command::Create { name, scope, expires_days, quotas, place } => {
            let store = open(&place).await?;
            let new = NewKey { name, scope, expires_at: end(expires_days), quotas: quotas.quotas() };
            let Some((key, secret)) = store.create_key(&new).await.map_err(failed)? else {
                let name = new.name;
                return Err(CliError::BadInput(format!(
                    "there is a key {name} already; take another name, or give that one another secret: \
                     gridfall keys renew {name}"
                )));
            };
            hand_over(&key, &secret, place.json);
        }
        Command::Renew { name, expires_days, place } => {
            let renewed = open(&place).await?.renew_key(&name, end(expires_days)).await.map_err(failed)?;
            let (key, secret) = renewed.ok_or_else(|| unknown(&name))?;
            hand_over(&key, &secret, place.json);
        }
        Command::List { place } => {
            let keys = open(&place).await?.keys().await.map_err(failed)?;
            if place.json {
                print_json(&keys.iter().map(described).collect::<Vec<_>>());
            } else {
                list(&keys);
            }
        }
        Command::Show { name, place } => show(&open(&place).await?, &name, place.json).await?,
        Command::Limit { name, quotas, place } => {
            let store = open(&place).await?;
            store.set_quotas(&name, quotas.quotas()).await.map_err(failed)?.ok_or_else(|| unknown(&name))?;
            show(&store, &name, place.json).await?;
        }
        Command::Revoke { name, place } => {
            let revoked = open(&place).await?.revoke_key(&name).await.map_err(failed)?;
            let key = revoked.ok_or_else(|| unknown(&name))?;
            if place.json {
                print_json(&described(&key));
            } else {
                println!("revoked {}", key.name);
            }
        }
    }
    Ok(())
}

/// The store, without the lock of the data directory, which a server may have.
async fn open(place: &Place) -> Result<JobStore, CliError> {
    let opened = match &place.database {
        Some(url) => JobStore::connect(url).await,
        None => {
            std::fs::create_dir_all(&place.data_dir)
                .map_err(|error| CliError::BadInput(format!("--data-dir {}: {error}", place.data_dir.display())))?;
            JobStore::open(&DataDir::database_in(&place.data_dir)).await
        }
    };
    opened.map_err(|error| match error {
        StoreError::Url { .. } | StoreError::Unreachable { .. } => CliError::BadInput(error.to_string()),
        _ => CliError::Failed(error.to_string()),
    })
}

fn failed(error: StoreError) -> CliError {
    CliError::Failed(error.to_string())
}

fn unknown(name: &str) -> CliError {
    CliError::BadInput(format!("there is no key {name}; gridfall keys list shows all"))
}

fn end(days: Option<u32>) -> Option<Timestamp> {
    days.map(|days| Timestamp::now() + Duration::from_secs(u64::from(days) * 86_400))
}

/// The secret on standard output, alone, so that a script can keep it.
fn hand_over(key: &Key, secret: &Secret, json: bool) {
    if json {
        let mut described = described(key);
        described["key"] = secret.reveal().into();
        print_json(&described);
    } else {
        let end = key.expires_at.map_or("has no end".into(), |end| format!("ends at {end:.0}"));
        remark(format_args!(
            "The key {} ({}) {end}. It is shown this once; send it as `Authorization: Bearer …`.",
            key.name, key.scope
        ));
        println!("{}", secret.reveal());
    }
}

fn print_json(value: &impl serde::Serialize) {
    println!("{}", serde_json::to_string_pretty(value).expect("keys are plain data"));
}

fn standing(key: &Key) -> &'static str {
    match key.standing(Timestamp::now()) {
        Standing::Good => "good",
        Standing::Expired => "expired",
        Standing::Revoked => "revoked",
    }
}

fn described(key: &Key) -> Value {
    let mut described = serde_json::to_value(key).expect("a key is plain data");
    described["standing"] = standing(key).into();
    described
}

fn time(time: Option<Timestamp>) -> String {
    time.map_or("never".into(), |time| format!("{time:.0}"))
}

fn list(keys: &[Key]) {
    if keys.is_empty() {
        println!("there are no keys: the server asks nobody for one");
        return;
    }
    let width = keys.iter().map(|key| key.name.len()).max().unwrap_or(0).max(4);
    let line = |name: &str, scope: &str, standing: &str, ends: &str, used: &str| {
        println!("{name:width$}  {scope:6}  {standing:8}  {ends:20}  {used}");
    };
    line("NAME", "SCOPE", "STANDING", "ENDS", "LAST USED");
    for key in keys {
        line(&key.name, key.scope.as_str(), standing(key), &time(key.expires_at), &time(key.last_used_at));
    }
}

async fn show(store: &JobStore, name: &str, json: bool) -> Result<(), CliError> {
    let key = store.key(name).await.map_err(failed)?.ok_or_else(|| unknown(name))?;
    let usage = store.usage(Some(&key.id)).await.map_err(failed)?.pop().ok_or_else(|| unknown(name))?;
    let Usage { key, queued, running, jobs, device_s, bytes, .. } = usage;
    if json {
        let mut described = described(&key);
        described["used"] =
            json!({ "queued": queued, "running": running, "jobs": jobs, "bytes": bytes, "device_s": device_s });
        print_json(&described);
        return Ok(());
    }
    let Quotas { queued: max_queued, running: max_running, particles, bytes: max_bytes, device_s: max_device } =
        key.quotas;
    let most = |most: Option<i64>| most.map_or(String::new(), |most| format!(" of {most}"));
    println!("{} ({}, id {}): {}", key.name, key.scope, key.id, standing(&key));
    println!("  made {:.0}, ends {}, last used {}", key.created_at, time(key.expires_at), time(key.last_used_at));
    println!("  jobs that wait          {queued}{}", most(max_queued));
    println!("  jobs that run           {running}{}", most(max_running));
    println!("  particles of a scene    {}", particles.map_or("any number".into(), |most| format!("at most {most}")));
    println!("  bytes kept              {bytes}{}", most(max_bytes));
    println!("  in {USAGE_DAYS} days: device time  {device_s:.1} s{}", most(max_device));
    println!("  in {USAGE_DAYS} days: jobs         {jobs}");
    Ok(())
}
