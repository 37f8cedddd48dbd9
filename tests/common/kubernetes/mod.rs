//! A stand-in for a Kubernetes cluster of one node: the API for Jobs and Pods as its documentation has it, what the Job
//! controller, the scheduler, the kubelet and Kueue do about them, and containers that are processes of this machine.
//!
//! It is no Kubernetes: what is not documented, or wrong here, no test finds.

mod api;
mod node;

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::path::PathBuf;
use std::process::{Child, Command};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock};
use std::thread::{JoinHandle, sleep};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::runtime::Runtime;

/// How long it may take to do what it is told.
const PATIENCE: Duration = Duration::from_secs(60);
/// How often its controllers look.
const TICK: Duration = Duration::from_millis(20);
pub const NAMESPACE: &str = "gridfall";
/// What the server shows, which may do what deploy/kubernetes/rights.yaml says; and what an administrator shows.
pub const TOKEN: &str = "of-the-server";
const ADMINISTRATOR: &str = "of-an-administrator";
/// The image that has Gridfall. All others cannot be pulled.
pub const IMAGE: &str = "registry.example/gridfall:1";
/// Devices of the node.
const DEVICES: i64 = 2;

/// The cluster.
pub struct Kubernetes {
    state: Arc<Mutex<State>>,
    port: u16,
    certificate: api::Certificate,
    dir: PathBuf,
    api: Mutex<Option<Runtime>>,
    over: Arc<AtomicBool>,
    controllers: Option<JoinHandle<()>>,
}

/// What etcd, and the node, would keep.
#[derive(Default)]
pub struct State {
    pub jobs: BTreeMap<String, Value>,
    pub pods: BTreeMap<String, Value>,
    /// All else, by path. Nothing happens to it.
    pub others: BTreeMap<String, Value>,
    /// Values by Secret and key.
    secrets: HashMap<(String, String), String>,
    processes: HashMap<String, Process>,
    /// All Jobs that were asked for, as they came.
    pub submitted: Vec<Value>,
    /// Lists, and what was asked for them.
    pub lists: Vec<String>,
    /// Answers to the next requests that would make a Job; none is a connection that breaks once it is done.
    pub answers: VecDeque<Option<(u16, Value)>>,
    made: u64,
    dir: PathBuf,
    /// The controllers do nothing.
    asleep: bool,
    /// The node does nothing, and has no process.
    node_down: bool,
    /// Jobs that come are suspended, as Kueue does.
    pub suspends: bool,
}

impl State {
    /// What is in the Secrets.
    pub fn secret_values(&self) -> impl Iterator<Item = &String> {
        self.secrets.values()
    }
}

struct Process {
    child: Child,
    log: PathBuf,
    /// When it was told to end, and how long it may take.
    told: Option<(Instant, Duration)>,
}

/// The cluster that the tests of a program share.
pub fn shared() -> &'static Kubernetes {
    static SHARED: OnceLock<Kubernetes> = OnceLock::new();
    SHARED.get_or_init(Kubernetes::start)
}

impl Kubernetes {
    pub fn start() -> Self {
        let dir = tempfile::tempdir().unwrap().keep();
        let state = Arc::new(Mutex::new(State { dir: dir.clone(), ..State::default() }));
        let (listener, over) = (std::net::TcpListener::bind("127.0.0.1:0").unwrap(), Arc::new(AtomicBool::new(false)));
        let port = listener.local_addr().unwrap().port();
        let (looked, ended) = (state.clone(), over.clone());
        let controllers = std::thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                looked.lock().unwrap().tick();
                sleep(TICK);
            }
        });
        let certificate = api::Certificate::make();
        let api = Mutex::new(Some(api::serve(listener, &certificate, state.clone())));
        let kubernetes = Self { state, port, certificate, dir, api, over, controllers: Some(controllers) };
        std::fs::write(kubernetes.kubeconfig(), kubernetes.configuration(TOKEN)).unwrap();
        std::fs::write(kubernetes.administrator(), kubernetes.configuration(ADMINISTRATOR)).unwrap();
        kubernetes
    }

    pub fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    pub fn kubeconfig(&self) -> PathBuf {
        self.dir.join("kubeconfig")
    }

    /// The kubeconfig of an administrator.
    pub fn administrator(&self) -> PathBuf {
        self.dir.join("administrator")
    }

    fn configuration(&self, token: &str) -> String {
        let authority = self.dir.join("ca.crt");
        std::fs::write(&authority, &self.certificate.pem).unwrap();
        let server = format!("https://127.0.0.1:{}", self.port);
        json!({
            "apiVersion": "v1", "kind": "Config", "current-context": "stand-in",
            "clusters": [{ "name": "stand-in", "cluster": { "server": server, "certificate-authority": authority } }],
            "users": [{ "name": "server", "user": { "token": token } }],
            "contexts": [{ "name": "stand-in",
                "context": { "cluster": "stand-in", "user": "server", "namespace": NAMESPACE } }],
        })
        .to_string()
    }

    /// A command that finds this cluster.
    pub fn command(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new(program);
        command.env("KUBECONFIG", self.kubeconfig());
        command
    }

    /// A command in a Pod: it finds the cluster as all do there, and has no kubeconfig. It needs the right to mount.
    pub fn command_in_pod(&self, program: &str) -> Command {
        let account = self.dir.join("account");
        std::fs::create_dir(&account).unwrap();
        for (name, text) in [("token", TOKEN), ("namespace", NAMESPACE), ("ca.crt", &self.certificate.pem)] {
            std::fs::write(account.join(name), text).unwrap();
        }
        let script = r#"mount -t tmpfs none /run && mkdir -p /run/secrets/kubernetes.io/serviceaccount && \
            cp "$0"/* /run/secrets/kubernetes.io/serviceaccount && exec "$@""#;
        let mut command = Command::new("unshare");
        command.args(["--mount", "--map-root-user", "sh", "-c", script]).arg(account).arg(program);
        command.env_remove("KUBECONFIG").env("HOME", "/nonexistent");
        command.env("KUBERNETES_SERVICE_HOST", "127.0.0.1").env("KUBERNETES_SERVICE_PORT", self.port.to_string());
        command
    }

    /// What `kubectl` says.
    pub fn ask(&self, arguments: &[&str]) -> String {
        let mut kubectl = Command::new("kubectl");
        kubectl.env("KUBECONFIG", self.administrator()).env("HOME", &self.dir);
        let answer = kubectl.args(arguments).output().unwrap();
        assert!(answer.status.success(), "kubectl {arguments:?}: {}", String::from_utf8_lossy(&answer.stderr));
        String::from_utf8(answer.stdout).unwrap().trim().to_owned()
    }

    /// A Secret with one value.
    pub fn keep_secret(&self, name: &str, key: &str, value: &str) {
        self.state().secrets.insert((name.into(), key.into()), value.into());
    }

    /// All connections break, and nobody listens.
    pub fn kill_api(&self) {
        if let Some(api) = self.api.lock().unwrap().take() {
            api.shutdown_background();
        }
    }

    pub fn start_api(&self) {
        let started = Instant::now();
        let listener = loop {
            match std::net::TcpListener::bind(("127.0.0.1", self.port)) {
                Ok(listener) => break listener,
                Err(error) => assert!(started.elapsed() < PATIENCE, "port {}: {error}", self.port),
            }
            sleep(TICK);
        };
        *self.api.lock().unwrap() = Some(api::serve(listener, &self.certificate, self.state.clone()));
    }

    /// The controllers and the kubelet stop; processes go on.
    pub fn kill_controllers(&self) {
        self.state().asleep = true;
    }

    pub fn start_controllers(&self) {
        self.state().asleep = false;
    }

    /// The node dies, with all its processes.
    pub fn kill_node(&self) {
        self.state().kill_node();
    }

    pub fn start_node(&self) {
        self.state().start_node();
    }

    /// Nobody has heard of the node for too long: its Pods are to be deleted.
    pub fn give_up_node(&self) {
        let mut state = self.state();
        let on_node = state.pods.iter().filter(|(_, pod)| pod["spec"].get("nodeName").is_some());
        for pod in on_node.map(|(name, _)| name.clone()).collect::<Vec<_>>() {
            state.disrupt(&pod, "DeletionByTaintManager", "Taint manager: deleting due to NoExecute taint");
        }
    }

    /// Evicts the Pod of a Job.
    pub fn evict(&self, job: &str) {
        let mut state = self.state();
        let pod = state.pod_of(job).expect("the Job has a Pod");
        state.disrupt(&pod, "EvictionByEvictionAPI", "Eviction API: evicting");
    }

    /// Sets `spec.suspend`, as Kueue does.
    pub fn suspend(&self, job: &str, suspend: bool) {
        self.state().jobs.get_mut(job).expect("there is such a Job")["spec"]["suspend"] = suspend.into();
    }

    /// What there is of a Job.
    pub fn job(&self, name: &str) -> Option<Value> {
        self.state().jobs.get(name).cloned()
    }

    /// Waits until a Job is what is wanted.
    pub fn wait_until(&self, name: &str, what: &str, wanted: impl Fn(Option<&Value>, Option<&Value>) -> bool) {
        let started = Instant::now();
        loop {
            let state = self.state();
            let (job, pod) = (state.jobs.get(name), state.pod_of(name).map(|pod| state.pods[&pod].clone()));
            if wanted(job, pod.as_ref()) {
                return;
            }
            let seen = format!("{job:#?}, {pod:#?}");
            drop(state);
            assert!(started.elapsed() < PATIENCE, "{name} is not {what}: {seen}");
            sleep(TICK);
        }
    }

    pub fn wait_for_end(&self, name: &str, condition: &str, reason: &str) {
        let found = |job: Option<&Value>, _: Option<&Value>| {
            let conditions = job.and_then(|job| job["status"]["conditions"].as_array().cloned()).unwrap_or_default();
            conditions.iter().any(|c| c["type"] == condition && reason.is_empty() || c["reason"] == reason)
        };
        self.wait_until(name, condition, found);
    }

    pub fn wait_until_gone(&self, name: &str) {
        self.wait_until(name, "gone", |job, pod| job.is_none() && pod.is_none());
    }
}

impl Drop for Kubernetes {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(controllers) = self.controllers.take() {
            let _ = controllers.join();
        }
        self.kill_api();
        self.state().kill_node();
        let _ = std::fs::remove_dir_all(&self.dir);
    }
}
