//! What a server or its worker logs, and how.

use std::io::IsTerminal;

use clap::{Args, ValueEnum};
use tracing_subscriber::EnvFilter;

use super::CliError;
use super::talk::is_quiet;

#[derive(Debug, Args)]
pub struct LogArguments {
    /// How to log on standard error.
    #[arg(long, value_enum, default_value_t = LogFormat::Text, env = "GRIDFALL_LOG_FORMAT")]
    log_format: LogFormat,
    /// What to log, such as `debug` or `warn,gridfall=info` [default:
    /// warn,gridfall=info,gridfall_service=info,audit=info, with --quiet warn].
    #[arg(long, value_name = "FILTER", env = "GRIDFALL_LOG")]
    log: Option<String>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum LogFormat {
    /// Lines for people.
    Text,
    /// An object a line, for programs.
    Json,
}

impl LogArguments {
    /// Begins to log.
    pub fn start(&self) -> Result<(), CliError> {
        let usual = if is_quiet() { "warn" } else { "warn,gridfall=info,gridfall_service=info,audit=info" };
        let log = self.log.as_deref().unwrap_or(usual);
        let filter = EnvFilter::try_new(log).map_err(|error| {
            CliError::BadInput(format!("--log {log}: {error}; write a level such as `info`, or module=level"))
        })?;
        let logs = tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_writer(std::io::stderr)
            .with_ansi(std::io::stderr().is_terminal());
        match self.log_format {
            LogFormat::Text => logs.init(),
            LogFormat::Json => logs.json().flatten_event(true).with_current_span(true).with_span_list(false).init(),
        }
        Ok(())
    }
}
