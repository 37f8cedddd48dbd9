//! A Slurm cluster of one node, of the tests' own, gone with the process that started it.

use std::fs;
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::daemon::Daemon;

/// How long Slurm may take to do what it is told.
const PATIENCE: Duration = Duration::from_secs(60);

/// `munged`, `slurmctld` and `slurmd`. The node has eight processors and two devices, whatever the machine has.
pub struct Slurm {
    dir: PathBuf,
    munged: Option<Daemon>,
    controller: Mutex<Option<Daemon>>,
    node: Mutex<Option<Daemon>>,
}

/// The cluster that the tests of a program share.
pub fn shared() -> &'static Slurm {
    static SHARED: OnceLock<Slurm> = OnceLock::new();
    SHARED.get_or_init(Slurm::start)
}

impl Slurm {
    pub fn start() -> Self {
        let dir = tempfile::tempdir().unwrap().keep();
        for folder in ["state", "spool", "log"] {
            fs::create_dir(dir.join(folder)).unwrap();
        }
        fs::set_permissions(&dir, fs::Permissions::from_mode(0o755)).unwrap();
        let key = dir.join("munge.key");
        fs::write(&key, (0..1024).map(|_| rand::random::<u8>()).collect::<Vec<_>>()).unwrap();
        fs::set_permissions(&key, fs::Permissions::from_mode(0o400)).unwrap();
        for gpu in ["gpu0", "gpu1"] {
            fs::write(dir.join(gpu), "").unwrap();
        }
        fs::write(dir.join("gres.conf"), format!("Name=gpu File={}/gpu[0-1]\n", dir.display())).unwrap();
        fs::write(dir.join("slurm.conf"), configuration(&dir)).unwrap();
        let at = |name: &str| dir.join(name).display().to_string();
        let munged = Some(daemon(
            &dir,
            "munged",
            &[
                "--foreground".into(),
                "--force".into(),
                format!("--key-file={}", at("munge.key")),
                format!("--socket={}", at("munge.sock")),
                format!("--pid-file={}", at("munged.pid")),
                format!("--seed-file={}", at("munge.seed")),
                format!("--log-file={}", at("log/munged")),
            ],
        ));
        let started = Instant::now();
        while !dir.join("munge.sock").exists() {
            assert!(started.elapsed() < PATIENCE, "munged does not start");
            sleep(Duration::from_millis(20));
        }
        let slurm = Self { dir, munged, controller: Mutex::new(None), node: Mutex::new(None) };
        slurm.start_controller();
        slurm.start_node();
        slurm.wait_for_node();
        slurm
    }

    pub fn start_controller(&self) {
        *self.controller.lock().unwrap() = Some(daemon(&self.dir, "slurmctld", &["-D".into()]));
    }

    pub fn start_node(&self) {
        *self.node.lock().unwrap() = Some(daemon(&self.dir, "slurmd", &["-D".into()]));
    }

    /// SIGKILL.
    pub fn kill_controller(&self) {
        drop(self.controller.lock().unwrap().take());
    }

    /// SIGKILL of the node's daemon; what it has started goes on.
    pub fn kill_node(&self) {
        drop(self.node.lock().unwrap().take());
    }

    /// Waits until the node takes jobs.
    pub fn wait_for_node(&self) {
        let started = Instant::now();
        loop {
            let state = self.try_ask("sinfo", &["--noheader", "--format=%T", "--partition=low"]).unwrap_or_default();
            if ["idle", "mixed", "allocated"].contains(&state.as_str()) {
                return;
            }
            self.heal();
            assert!(started.elapsed() < PATIENCE, "the node is {state:?}; see {}/log", self.dir.display());
            sleep(Duration::from_millis(100));
        }
    }

    /// What an administrator does about a node that Slurm has taken out of service.
    pub fn heal(&self) {
        let state = self.try_ask("sinfo", &["--noheader", "--format=%T", "--partition=low"]).unwrap_or_default();
        if state.starts_with("down") || state.starts_with("drain") {
            let _ = self.try_ask("scontrol", &["update", "nodename=ALL", "state=resume"]);
        }
    }

    /// The file by which Slurm's programs find this cluster.
    pub fn configuration(&self) -> String {
        self.dir.join("slurm.conf").display().to_string()
    }

    /// A command that finds this cluster.
    pub fn command(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", self.configuration());
        command
    }

    /// What one of Slurm's programs says.
    pub fn ask(&self, program: &str, arguments: &[&str]) -> String {
        self.try_ask(program, arguments).unwrap_or_else(|error| panic!("{program} {arguments:?}: {error}"))
    }

    fn try_ask(&self, program: &str, arguments: &[&str]) -> Result<String, String> {
        let answer = self.command(program).args(arguments).output().unwrap();
        if answer.status.success() {
            Ok(String::from_utf8(answer.stdout).unwrap().trim().to_owned())
        } else {
            Err(String::from_utf8_lossy(&answer.stderr).into_owned())
        }
    }

    /// Slurm's word for the state of a job.
    pub fn state(&self, job: &str) -> String {
        self.ask("squeue", &["--noheader", "--array", "--states=all", "--format=%T", "--jobs", job])
    }

    /// Waits until a job is in this state.
    pub fn wait_for(&self, job: &str, state: &str) {
        let started = Instant::now();
        while self.state(job) != state {
            assert!(started.elapsed() < PATIENCE, "job {job} is {}, and {state} was expected", self.state(job));
            sleep(Duration::from_millis(100));
        }
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        let _ = self.try_ask("scancel", &["--me", "--signal=KILL"]);
        self.kill_node();
        self.kill_controller();
        drop(self.munged.take());
        if std::thread::panicking() {
            println!("what Slurm logged is in {}", self.dir.join("log").display());
        } else {
            let _ = fs::remove_dir_all(&self.dir);
        }
    }
}

/// Starts one of Slurm's programs.
fn daemon(dir: &Path, program: &str, arguments: &[String]) -> Daemon {
    let log = fs::File::create(dir.join("log").join(format!("{program}.said"))).unwrap();
    let mut command = Command::new(find(program));
    command.args(arguments).env("SLURM_CONF", dir.join("slurm.conf"));
    Daemon::start(&command, log)
}

/// Debian keeps daemons out of the search path of users.
fn find(program: &str) -> String {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let places = std::env::split_paths(&path).chain([PathBuf::from("/usr/sbin"), PathBuf::from("/sbin")]);
    let found = places.map(|place| place.join(program)).find(|program| program.exists());
    found.unwrap_or_else(|| panic!("{program} is not installed; tests/run installs it")).display().to_string()
}

fn configuration(dir: &Path) -> String {
    let said = |program: &str, argument: &str| {
        String::from_utf8(Command::new(program).arg(argument).output().unwrap().stdout).unwrap().trim().to_owned()
    };
    let (host, user) = (said("hostname", "-s"), said("id", "-un"));
    let port = || TcpListener::bind(("127.0.0.1", 0)).unwrap().local_addr().unwrap().port();
    let (controller, node) = (port(), port());
    let dir = dir.display();
    format!(
        "ClusterName=gridfall\n\
         SlurmctldHost={host}(127.0.0.1)\n\
         SlurmUser={user}\n\
         SlurmdUser={user}\n\
         SlurmctldPort={controller}\n\
         SlurmdPort={node}\n\
         AuthType=auth/munge\n\
         AuthInfo=socket={dir}/munge.sock\n\
         StateSaveLocation={dir}/state\n\
         SlurmdSpoolDir={dir}/spool\n\
         SlurmctldPidFile={dir}/slurmctld.pid\n\
         SlurmdPidFile={dir}/slurmd.pid\n\
         SlurmctldLogFile={dir}/log/slurmctld\n\
         SlurmdLogFile={dir}/log/slurmd\n\
         ProctrackType=proctrack/linuxproc\n\
         TaskPlugin=task/none\n\
         MpiDefault=none\n\
         JobAcctGatherType=jobacct_gather/none\n\
         AccountingStorageType=accounting_storage/none\n\
         SlurmdParameters=config_overrides\n\
         SchedulerParameters=sched_interval=1,bf_interval=1,batch_sched_delay=0\n\
         SelectType=select/cons_tres\n\
         SelectTypeParameters=CR_Core\n\
         ReturnToService=2\n\
         SlurmdTimeout=20\n\
         GresTypes=gpu\n\
         MaxArraySize=5\n\
         PreemptType=preempt/partition_prio\n\
         PreemptMode=REQUEUE\n\
         NodeName={host} NodeAddr=127.0.0.1 CPUs=8 Gres=gpu:2\n\
         PartitionName=low Nodes=ALL Default=YES PriorityTier=1\n\
         PartitionName=high Nodes=ALL PriorityTier=2\n"
    )
}
