//! Slurm, by the programs that its users have: `sbatch`, `squeue`, `scancel`, and `sacct` where there is accounting.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use tokio::io::AsyncWriteExt;
use tokio::process::Command;
use tokio::time::timeout;

use super::{Answer, Batch, Cluster, ClusterError, Seen, State, printable};

/// How long one of Slurm's programs may take. They themselves wait for a controller that is away.
const PATIENCE: Duration = Duration::from_secs(60);
/// Jobs of an array where Slurm does not say how many it takes.
const USUAL_ARRAY: usize = 1000;
/// Before the end of its time a process is told so long (s), to save its state.
const WARNING_S: u32 = 60;
/// Last bytes of a process's output that a failure quotes.
const QUOTED: u64 = 600;
/// Options of `sbatch` that are Gridfall's.
const OWN: [&str; 16] = [
    "--array",
    "--chdir",
    "--clusters",
    "--comment",
    "--error",
    "--export",
    "--hold",
    "--job-name",
    "--no-requeue",
    "--open-mode",
    "--output",
    "--parsable",
    "--requeue",
    "--signal",
    "--test-only",
    "--wait",
];
/// Variables by which Slurm's programs would do or say something else than what is asked for, or begin with them.
const IN_THE_WAY: [&str; 6] = ["SBATCH_EXPORT", "SBATCH_WAIT", "SBATCH_REQUEUE", "SQUEUE_", "SCANCEL_", "SACCT_"];

/// How jobs are handed to Slurm.
#[derive(Clone, Debug)]
pub struct SlurmOptions {
    /// The program that runs an attempt, the same on all nodes.
    pub program: PathBuf,
    /// The data directory, the same on all nodes; with `files`, a folder that each node has for itself.
    pub folder: PathBuf,
    /// URL of the object storage, if that is where the files are. Processes get it by the environment.
    pub files: Option<String>,
    /// URL of the job database. Processes get it by the environment.
    pub database: String,
    /// Arguments of the program, besides those that say what to run.
    pub arguments: Vec<String>,
    /// More options of `sbatch`, such as `--partition=gpu` or `--gres=gpu:1`.
    pub sbatch: Vec<String>,
}

/// Slurm, as the user that the server runs as.
#[derive(Debug)]
pub struct Slurm {
    options: SlurmOptions,
    largest_array: usize,
}

impl Slurm {
    /// Fails if an option is not for this, or Slurm's programs are not installed here. Its controller may be away.
    pub async fn new(options: SlurmOptions) -> Result<Self, ClusterError> {
        for option in &options.sbatch {
            let name = option.split('=').next().unwrap_or_default();
            if !name.starts_with("--") {
                return Err(ClusterError::Refused(format!(
                    "--sbatch {option:?} is no long option; write it as sbatch takes it, such as --sbatch=--gres=gpu:1"
                )));
            }
            if OWN.contains(&name) {
                return Err(ClusterError::Refused(format!(
                    "--sbatch {option:?}: Gridfall gives {name} itself; leave it out"
                )));
            }
        }
        std::fs::create_dir_all(outputs(&options))
            .map_err(|error| ClusterError::Refused(format!("{}: {error}", outputs(&options).display())))?;
        let largest_array = match ask("scontrol", ["show", "config"]).await {
            Ok(config) => largest_array(&config).unwrap_or(USUAL_ARRAY),
            Err(Refusal::NotThere(error)) => {
                return Err(ClusterError::Refused(format!(
                    "Slurm's programs are not to be found ({error}); install Slurm's client here and put it into PATH"
                )));
            }
            Err(Refusal::Said(error)) => {
                tracing::warn!(error, "Slurm's controller does not answer; jobs wait until it does");
                USUAL_ARRAY
            }
        };
        Ok(Self { options, largest_array })
    }

    /// What a shell of the cluster's runs.
    fn script(&self, batch: &Batch) -> String {
        let ids: Vec<String> = batch.jobs.iter().map(|job| job.id.to_string()).collect();
        let mut program = vec![self.options.program.to_string_lossy().into_owned(), "worker".into()];
        program.extend(self.options.arguments.iter().cloned());
        let folder = self.options.folder.to_string_lossy().into_owned();
        program.extend(["--quiet".into(), "--data-dir".into(), folder, "--attempt".into(), batch.attempt.to_string()]);
        let program = shlex::try_join(program.iter().map(String::as_str)).expect("no argument has a zero byte");
        // Where processes are not confined to what their job was given, they keep to it all the same.
        format!(
            "#!/bin/sh\n\
             set -- {}\n\
             shift \"${{SLURM_ARRAY_TASK_ID:-0}}\"\n\
             export RAYON_NUM_THREADS=\"${{RAYON_NUM_THREADS:-$SLURM_CPUS_ON_NODE}}\"\n\
             exec {program} --job \"$1\" \
             --cluster-job \"${{SLURM_ARRAY_JOB_ID:-$SLURM_JOB_ID}}${{SLURM_ARRAY_TASK_ID:+_$SLURM_ARRAY_TASK_ID}}\"\n",
            ids.join(" ")
        )
    }

    fn sbatch(&self, batch: &Batch) -> Vec<String> {
        let is_array = batch.jobs.len() > 1;
        // The file is named as the job is.
        let folder = outputs(&self.options).display().to_string().replace('%', "%%");
        let output = format!("{folder}/{}.out", if is_array { "%A_%a" } else { "%A" });
        let mut options = vec![
            "--parsable".into(),
            // What cannot be put back is canceled by a controller that comes back and finds it on a node.
            "--requeue".into(),
            format!("--job-name=gridfall {}", printable(&batch.name)),
            format!("--comment={}", batch.comment),
            format!("--chdir={}", self.options.folder.display()),
            format!("--output={output}"),
            "--export=ALL".into(),
            format!("--signal=B:TERM@{WARNING_S}"),
        ];
        if std::env::var_os("SBATCH_TIMELIMIT").is_none() {
            options.push(format!("--time={}", batch.minutes()));
        }
        if is_array {
            options.push(format!("--array=0-{}", batch.jobs.len() - 1));
        }
        options.extend(self.options.sbatch.iter().cloned());
        options
    }
}

impl Cluster for Slurm {
    fn name(&self) -> &'static str {
        "Slurm"
    }

    fn largest_batch(&self) -> usize {
        self.largest_array
    }

    fn submit<'a>(&'a self, batch: &'a Batch) -> Answer<'a, Vec<String>> {
        Box::pin(async move {
            let mut sbatch = Command::new("sbatch");
            sbatch.args(self.sbatch(batch)).env("GRIDFALL_DATABASE", &self.options.database);
            sbatch.envs(self.options.files.iter().map(|files| ("GRIDFALL_FILES", files)));
            let said = run(sbatch, Some(self.script(batch))).await?;
            let job = said.trim().split(';').next().unwrap_or_default();
            if job.is_empty() || !job.bytes().all(|byte| byte.is_ascii_digit()) {
                return Err(ClusterError::Refused(format!(
                    "sbatch said {said:?} where the number of a job was expected"
                )));
            }
            Ok(match batch.jobs.len() {
                1 => vec![job.to_owned()],
                n => (0..n).map(|task| format!("{job}_{task}")).collect(),
            })
        })
    }

    fn cancel<'a>(&'a self, jobs: &'a [String]) -> Answer<'a, ()> {
        Box::pin(async move {
            // Those that have ended already are no fault.
            ask("scancel", ["--quiet"].into_iter().chain(jobs.iter().map(String::as_str))).await?;
            Ok(())
        })
    }

    fn observe<'a>(&'a self, jobs: &'a [String]) -> Answer<'a, HashMap<String, Seen>> {
        Box::pin(async move {
            let said =
                ask("squeue", ["--me", "--all", "--noheader", "--array", "--states=all", "--format=%i|%T|%k|%r"])
                    .await?;
            let mut states = states(&said);
            let gone: Vec<&str> = jobs.iter().filter(|&job| !states.contains_key(job)).map(String::as_str).collect();
            if !gone.is_empty() {
                // Where there is no accounting, nobody remembers them.
                let list = format!("--jobs={}", gone.join(","));
                let options = ["--noheader", "--allocations", "--parsable2", "--format=JobID,State,Comment", &list];
                if let Ok(said) = ask("sacct", options).await {
                    // That it began and never ended is no news.
                    let ends = self::states(&said).into_iter();
                    states.extend(ends.filter(|(_, seen)| !matches!(seen.state, State::Waiting(_) | State::Alive)));
                }
            }
            Ok(states)
        })
    }

    fn last_words(&self, job: &str) -> String {
        tail(&output(&self.options, job))
    }

    fn forget(&self, job: &str) {
        // It may have written nothing.
        let _ = std::fs::remove_file(output(&self.options, job));
    }
}

/// The folder of what processes write. On nodes that share none it is one that they have.
fn outputs(options: &SlurmOptions) -> PathBuf {
    if options.files.is_some() { options.folder.clone() } else { options.folder.join("cluster") }
}

fn output(options: &SlurmOptions, job: &str) -> PathBuf {
    outputs(options).join(format!("{job}.out"))
}

/// The end of a file; nothing where it cannot be read.
fn tail(file: &Path) -> String {
    let read = || -> io::Result<Vec<u8>> {
        let mut file = File::open(file)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(QUOTED)))?;
        let mut bytes = Vec::new();
        file.take(QUOTED).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    String::from_utf8_lossy(&read().unwrap_or_default()).trim().to_owned()
}

/// Lines of `job|state|comment`, perhaps with `|reason`.
fn states(said: &str) -> HashMap<String, Seen> {
    let line = |line: &str| {
        let mut fields = line.trim().splitn(4, '|');
        let (job, word, comment) = (fields.next()?, fields.next()?, fields.next()?);
        let comment = if comment == "(null)" { "" } else { comment };
        let state = state(word, fields.next().unwrap_or_default());
        Some((job.to_owned(), Seen { state, comment: comment.to_owned() }))
    };
    said.lines().filter_map(line).collect()
}

/// Slurm's words for what becomes of jobs, one by one.
fn state(word: &str, reason: &str) -> State {
    // Nothing but a person would start it again.
    if reason.ends_with("failed requeued held") {
        return State::Displaced(reason.into());
    }
    // "CANCELLED by 1000"
    match word.split(' ').next().unwrap_or_default() {
        "PENDING" | "REQUEUED" | "REQUEUE_FED" | "REQUEUE_HOLD" | "RESV_DEL_HOLD" | "SPECIAL_EXIT" => {
            State::Waiting(reason.into())
        }
        "CONFIGURING" | "RUNNING" | "SUSPENDED" | "STOPPED" | "SIGNALING" | "RESIZING" | "STAGE_OUT" | "COMPLETING" => {
            State::Alive
        }
        "COMPLETED" => State::Completed,
        "CANCELLED" => State::Canceled,
        "TIMEOUT" => State::TimedOut,
        "PREEMPTED" | "NODE_FAIL" | "BOOT_FAIL" | "REVOKED" => State::Displaced(word.into()),
        // FAILED, OUT_OF_MEMORY, DEADLINE, LAUNCH_FAILED, RECONFIG_FAIL, and what later releases add.
        _ => State::Failed(word.into()),
    }
}

fn largest_array(config: &str) -> Option<usize> {
    let value = config.lines().find_map(|line| line.trim().strip_prefix("MaxArraySize")?.trim().strip_prefix('='))?;
    // Arrays can be forbidden.
    value.trim().parse().ok().map(|size: usize| size.max(1))
}

/// Why a program of Slurm's gave no answer.
enum Refusal {
    /// It is not installed.
    NotThere(String),
    Said(String),
}

impl From<Refusal> for ClusterError {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::NotThere(error) | Refusal::Said(error) => Self::Refused(error),
        }
    }
}

async fn ask(program: &str, arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Result<String, Refusal> {
    let mut command = Command::new(program);
    command.args(arguments);
    run(command, None).await
}

/// What a program says.
async fn run(mut command: Command, input: Option<String>) -> Result<String, Refusal> {
    let program = command.as_std().get_program().to_string_lossy().into_owned();
    command.stdin(if input.is_some() { Stdio::piped() } else { Stdio::null() });
    for (name, _) in std::env::vars_os() {
        if IN_THE_WAY.iter().any(|start| name.to_string_lossy().starts_with(start)) {
            command.env_remove(name);
        }
    }
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).kill_on_drop(true);
    let mut child = command.spawn().map_err(|error| Refusal::NotThere(format!("{program}: {error}")))?;
    let answer = async {
        if let (Some(input), Some(mut stdin)) = (input, child.stdin.take()) {
            stdin.write_all(input.as_bytes()).await?;
        }
        child.wait_with_output().await
    };
    let output = match timeout(PATIENCE, answer).await {
        Ok(Ok(output)) => output,
        Ok(Err(error)) => return Err(Refusal::Said(format!("{program}: {error}"))),
        Err(_) => return Err(Refusal::Said(format!("{program} gave no answer within {} s", PATIENCE.as_secs()))),
    };
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        let said = String::from_utf8_lossy(&output.stderr).trim().replace('\n', "; ");
        Err(Refusal::Said(format!("{program}: {said}")))
    }
}

#[cfg(test)]
mod tests;
