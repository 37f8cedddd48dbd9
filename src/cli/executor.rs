//! Arguments that choose what runs a server's jobs.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use clap::{Args, ValueEnum};

use super::CliError;
use super::device::ServerDevices;
use super::serve::opener;
use gridfall_service::jobs::Executor;
use gridfall_service::jobs::cluster::{Slurm, SlurmOptions};

#[derive(Debug, Args)]
pub struct ExecutorArguments {
    /// What runs the jobs: this process, or a cluster's scheduler, which starts `gridfall worker` for each. All its
    /// nodes need a database that they can reach, and the data directory under the same path, or --files and
    /// --cluster-scratch.
    #[arg(long, value_enum, default_value_t = Kind::Local, env = "GRIDFALL_EXECUTOR")]
    executor: Kind,
    /// With --executor slurm: an option of sbatch, such as --sbatch=--partition=gpu or --sbatch=--gres=gpu:1.
    /// Repeatable. What sbatch reads from the environment (SBATCH_PARTITION and others) works, too.
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// With another executor than local: look at the scheduler this often (s).
    #[arg(long, default_value_t = 5.0, value_name = "SECONDS", value_parser = super::serve::positive,
        env = "GRIDFALL_CLUSTER_SECONDS")]
    cluster_seconds: f64,
    /// With another executor than local: jobs that the scheduler may hold at a time, waiting and running. The others
    /// wait here, where their priorities count.
    #[arg(long, default_value_t = 1000, value_name = "N", value_parser = clap::value_parser!(u32).range(1..),
        env = "GRIDFALL_CLUSTER_JOBS")]
    cluster_jobs: u32,
    /// With another executor than local, and --files: a folder of each node's own for what its jobs have not taken to
    /// the object storage yet. It must be there. Then no data directory is shared.
    #[arg(long, value_name = "DIR", env = "GRIDFALL_CLUSTER_SCRATCH")]
    cluster_scratch: Option<PathBuf>,
    /// With another executor than local: this program on the nodes [default: where it is here].
    #[arg(long, value_name = "PATH", env = "GRIDFALL_CLUSTER_PROGRAM")]
    cluster_program: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    Local,
    Slurm,
}

/// What processes of the cluster need to know of the server.
pub struct Home<'a> {
    pub data_dir: &'a std::path::Path,
    pub database: Option<&'a str>,
    pub files: Option<&'a str>,
    pub checkpoint_seconds: f64,
}

impl ExecutorArguments {
    pub async fn choose(self, devices: ServerDevices, home: Home<'_>) -> Result<Executor, CliError> {
        match self.executor {
            Kind::Local if !self.sbatch.is_empty() => {
                Err(CliError::BadInput("--sbatch is for Slurm; add --executor slurm".into()))
            }
            Kind::Local => Ok(Executor::Local(devices.each().into_iter().map(opener).collect())),
            Kind::Slurm => self.slurm(devices, home).await,
        }
    }

    async fn slurm(self, devices: ServerDevices, home: Home<'_>) -> Result<Executor, CliError> {
        let database = home.database.filter(|url| url.starts_with("postgres")).ok_or_else(|| {
            CliError::BadInput(
                "--executor slurm: processes on other machines cannot use a database in a file; give --database \
                 postgres://USER:PASSWORD@HOST/NAME, with a host that all nodes can reach"
                    .into(),
            )
        })?;
        let [device] = &devices.each()[..] else {
            return Err(CliError::BadInput(
                "--executor slurm: each job runs on the device that Slurm gives it; give --adapter once at most, and \
                 ask for the device with --sbatch=--gres=gpu:1"
                    .into(),
            ));
        };
        let absolute = |path: &std::path::Path| {
            std::path::absolute(path).map_err(|error| CliError::BadInput(format!("{}: {error}", path.display())))
        };
        let program = match self.cluster_program {
            Some(program) => program,
            None => std::env::current_exe()
                .map_err(|error| CliError::Failed(format!("cannot tell where this program is: {error}")))?,
        };
        let mut arguments = device.arguments();
        arguments.extend(["--checkpoint-seconds".into(), home.checkpoint_seconds.to_string()]);
        let folder = match (home.files, &self.cluster_scratch) {
            (None, None) => home.data_dir,
            (Some(_), Some(scratch)) => scratch,
            (Some(_), None) => {
                return Err(CliError::BadInput(
                    "--files: give --cluster-scratch DIR, too: a folder of each node's own, such as /tmp".into(),
                ));
            }
            (None, Some(_)) => {
                return Err(CliError::BadInput(
                    "--cluster-scratch is for files in an object storage; give --files s3://BUCKET, too, or leave it \
                     out"
                    .into(),
                ));
            }
        };
        let options = SlurmOptions {
            program,
            folder: absolute(folder)?,
            files: home.files.map(str::to_owned),
            database: database.to_owned(),
            arguments,
            sbatch: self.sbatch,
        };
        let slurm =
            Slurm::new(options).await.map_err(|error| CliError::BadInput(format!("--executor slurm: {error}")))?;
        Ok(Executor::Cluster {
            cluster: Arc::new(slurm),
            every: Duration::from_secs_f64(self.cluster_seconds),
            most: self.cluster_jobs as usize,
        })
    }
}
