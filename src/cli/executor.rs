//! Arguments that choose what runs a server's jobs.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::{Args, ValueEnum};

use super::CliError;
use super::device::ServerDevices;
use super::serve::opener;
use gridfall_service::jobs::Executor;
use gridfall_service::jobs::cluster::{Cluster, Kubernetes, KubernetesOptions, Slurm, SlurmOptions};

#[derive(Debug, Args)]
pub struct ExecutorArguments {
    /// What runs the jobs: this process, or a cluster's scheduler, which starts `gridfall worker` for each. All its
    /// nodes, or containers, need a database that they can reach, and the data directory under the same path, or
    /// --files and --cluster-scratch.
    #[arg(long, value_enum, default_value_t = Kind::Local, env = "GRIDFALL_EXECUTOR")]
    executor: Kind,
    /// With --executor slurm: an option of sbatch, such as --sbatch=--partition=gpu or --sbatch=--gres=gpu:1.
    /// Repeatable. What sbatch reads from the environment (SBATCH_PARTITION and others) works, too.
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    sbatch: Vec<String>,
    /// With --executor kubernetes: the manifest of a Job (YAML), from which the Job of each attempt is made. It has the
    /// image, the volumes, what to ask of a node, and a Secret with GRIDFALL_DATABASE.
    #[arg(long, value_name = "FILE", env = "GRIDFALL_KUBERNETES_JOB")]
    kubernetes_job: Option<PathBuf>,
    /// With --executor kubernetes: where Jobs are made [default: the namespace of the kubeconfig, or of the server's
    /// Pod].
    #[arg(long, value_name = "NAME", env = "GRIDFALL_KUBERNETES_NAMESPACE")]
    kubernetes_namespace: Option<String>,
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
    /// With --executor slurm: this program on the nodes [default: where it is here].
    #[arg(long, value_name = "PATH", env = "GRIDFALL_CLUSTER_PROGRAM")]
    cluster_program: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    Local,
    Slurm,
    Kubernetes,
}

/// What processes of the cluster need to know of the server.
pub struct Home<'a> {
    pub data_dir: &'a Path,
    pub database: Option<&'a str>,
    pub files: Option<&'a str>,
    pub checkpoint_seconds: f64,
}

impl ExecutorArguments {
    pub async fn choose(self, devices: ServerDevices, home: Home<'_>) -> Result<Executor, CliError> {
        let for_another = |option: &str, name: &str| {
            let name = name.to_lowercase();
            Err(CliError::BadInput(format!("{option} is for {name}; add --executor {name}")))
        };
        match self.executor {
            Kind::Local | Kind::Kubernetes if !self.sbatch.is_empty() => for_another("--sbatch", "slurm"),
            // By the environment it may come to servers that have no use for it.
            Kind::Local | Kind::Slurm if self.kubernetes_job.is_some() => for_another("--kubernetes-job", "kubernetes"),
            Kind::Local => Ok(Executor::Local(devices.each().into_iter().map(opener).collect())),
            Kind::Slurm => self.slurm(devices, home).await,
            Kind::Kubernetes => self.kubernetes(devices, home).await,
        }
    }

    async fn slurm(self, devices: ServerDevices, home: Home<'_>) -> Result<Executor, CliError> {
        let database = database(&home, "slurm")?;
        let arguments = arguments(devices, &home, "slurm", "--sbatch=--gres=gpu:1")?;
        let program = match &self.cluster_program {
            Some(program) => program.clone(),
            None => std::env::current_exe()
                .map_err(|error| CliError::Failed(format!("cannot tell where this program is: {error}")))?,
        };
        let (folder, files) = (self.folder(&home)?, home.files.map(str::to_owned));
        let (database, sbatch) = (database.to_owned(), self.sbatch.clone());
        let options = SlurmOptions { program, folder, files, database, arguments, sbatch };
        let slurm = Slurm::new(options).await;
        Ok(self.cluster(Arc::new(slurm.map_err(|error| CliError::BadInput(format!("--executor slurm: {error}")))?)))
    }

    async fn kubernetes(self, devices: ServerDevices, home: Home<'_>) -> Result<Executor, CliError> {
        // The processes have it by the template.
        database(&home, "kubernetes")?;
        let arguments = arguments(devices, &home, "kubernetes", "resources in the manifest of --kubernetes-job")?;
        let Some(file) = &self.kubernetes_job else {
            return Err(CliError::BadInput(
                "--executor kubernetes: no Job is given to make others from; give --kubernetes-job FILE, such as \
                 deploy/kubernetes/job.yaml of the repository"
                    .into(),
            ));
        };
        let template = std::fs::read_to_string(file)
            .map_err(|error| CliError::BadInput(format!("--kubernetes-job {}: {error}", file.display())))?;
        let (folder, files) = (self.folder(&home)?, home.files.map(str::to_owned));
        let namespace = self.kubernetes_namespace.clone();
        let kubernetes = Kubernetes::new(KubernetesOptions { namespace, template, folder, files, arguments }).await;
        let kubernetes = kubernetes.map_err(|error| CliError::BadInput(format!("--executor kubernetes: {error}")))?;
        Ok(self.cluster(Arc::new(kubernetes)))
    }

    /// The folder that processes have.
    fn folder(&self, home: &Home<'_>) -> Result<PathBuf, CliError> {
        match (home.files, &self.cluster_scratch) {
            (None, None) => absolute(home.data_dir),
            (Some(_), Some(scratch)) => absolute(scratch),
            (Some(_), None) => Err(CliError::BadInput(
                "--files: give --cluster-scratch DIR, too: a folder of each node's own, such as /tmp".into(),
            )),
            (None, Some(_)) => Err(CliError::BadInput(
                "--cluster-scratch is for files in an object storage; give --files s3://BUCKET, too, or leave it out"
                    .into(),
            )),
        }
    }

    fn cluster(self, cluster: Arc<dyn Cluster>) -> Executor {
        let every = Duration::from_secs_f64(self.cluster_seconds);
        Executor::Cluster { cluster, every, most: self.cluster_jobs as usize }
    }
}

/// The database, if processes on other machines can use it.
fn database<'a>(home: &Home<'a>, executor: &str) -> Result<&'a str, CliError> {
    home.database.filter(|url| url.starts_with("postgres")).ok_or_else(|| {
        CliError::BadInput(format!(
            "--executor {executor}: processes on other machines cannot use a database in a file; give --database \
             postgres://USER:PASSWORD@HOST/NAME, with a host that all nodes can reach"
        ))
    })
}

/// Arguments of all processes.
fn arguments(devices: ServerDevices, home: &Home<'_>, executor: &str, by: &str) -> Result<Vec<String>, CliError> {
    let [device] = &devices.each()[..] else {
        return Err(CliError::BadInput(format!(
            "--executor {executor}: each job runs on the device that the scheduler gives it; give --adapter once at \
             most, and ask for the device with {by}"
        )));
    };
    let mut arguments = device.arguments();
    arguments.extend(["--checkpoint-seconds".into(), home.checkpoint_seconds.to_string()]);
    Ok(arguments)
}

fn absolute(path: &Path) -> Result<PathBuf, CliError> {
    std::path::absolute(path).map_err(|error| CliError::BadInput(format!("{}: {error}", path.display())))
}
