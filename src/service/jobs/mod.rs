//! Running jobs: admission of scenes; the workers, one a device, that take jobs from the store and run them to the end;
//! and in the place of these a cluster's scheduler, which starts a process for each attempt.

pub mod admission;
mod attempt;
pub mod cluster;
mod counters;
mod log;
mod process;
mod resume;
pub mod retention;
mod watch;
mod worker;

use std::sync::{Mutex, MutexGuard, OnceLock};
use std::time::{Duration, Instant};

use tokio::sync::Notify;

pub use attempt::panic_message;
pub use counters::{Counters, StatusLabel};
pub use process::{Order, ProcessError, work_off};
pub use worker::{Executor, Settings, Workers, complete};

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;
use gridfall_engine::choice::Devices;
use gridfall_engine::{Backend, Engine, EngineError};

/// Where a worker gets its engines from. Created on the worker's own thread, and used there and on those of its small
/// jobs.
pub trait EngineSource: Sync {
    /// Loads a problem on the device that suits it.
    fn engine(&self, setup: &Setup, particles: Particles) -> Result<Box<dyn Engine>, EngineError>;

    /// Which devices are open, and why, for people.
    fn describe(&self) -> String;

    /// Memory that this process has taken of the GPU (bytes); none where there is none, or it does not say.
    fn memory_bytes(&self) -> Option<u64> {
        None
    }

    /// The devices that are open, the preferred one first.
    fn devices(&self) -> Vec<Backend> {
        Vec::new()
    }
}

impl EngineSource for Devices {
    fn engine(&self, setup: &Setup, particles: Particles) -> Result<Box<dyn Engine>, EngineError> {
        Devices::engine(self, setup, particles)
    }

    fn describe(&self) -> String {
        match self.gpu() {
            Some(gpu) => format!("{}: {}", gpu.backend(self.reason()).device, self.reason()),
            None => format!("the CPU: {}", self.reason()),
        }
    }

    fn memory_bytes(&self) -> Option<u64> {
        self.gpu()?.memory_bytes()
    }

    fn devices(&self) -> Vec<Backend> {
        let gpu = self.gpu().map(|gpu| gpu.backend(self.reason()));
        gpu.into_iter().chain([Backend::this_cpu(self.reason())]).collect()
    }
}

/// Lets other threads of the process go before this one. A simulation takes every processor there is, and requests
/// need little, but soon. For the threads that simulate, those of rayon's global pool among them.
///
/// On Linux such a thread is of the idle class. A kernel that preempts lazily lets a thread that computes go on to the
/// next tick, up to 4 ms, before one that has been woken, unless it is of this class: a request, which threads hand on
/// to each other, waited once at each hand. The class means only that the other threads of the same session or control
/// group go first, such as those of a container.
pub fn yield_to_requests() {
    #[cfg(target_os = "linux")]
    {
        use thread_priority::{
            NormalThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy, set_thread_priority_and_policy,
            thread_native_id,
        };
        let idle = ThreadSchedulePolicy::Normal(NormalThreadSchedulePolicy::Idle);
        // Where it is not allowed, requests are slower.
        let _ = set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Min, idle);
    }
}

/// Opens the devices; called again after one was lost.
pub type OpenDevices = Box<dyn Fn() -> Result<Box<dyn EngineSource>, EngineError> + Send>;

/// State of the worker's devices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceState {
    Opening,
    /// Which devices are open, and why.
    Ready(String),
    /// No device could be opened, and why; the worker will try again.
    Unusable(String),
    /// The worker has ended.
    Stopped,
}

/// What the workers and the rest of the server share.
#[derive(Debug)]
pub struct Shared {
    wake: Notify,
    /// For those that run small jobs only: they must not take the others' calls.
    wake_small: Notify,
    /// When the workers were asked to stop.
    stop: OnceLock<Instant>,
    /// How long a run may then take to reach the end of its frame, where it saves its state.
    grace: Duration,
    /// By worker: the state of its devices, and those that are open.
    devices: Mutex<Vec<(DeviceState, Vec<Backend>)>>,
    pub counters: Counters,
}

impl Shared {
    /// Of so many workers, whose devices are being opened. Once they are asked to stop, their runs may take as long
    /// as `grace` to reach the end of a frame, where they save their states.
    pub fn new(workers: usize, grace: Duration) -> Self {
        Self {
            wake: Notify::new(),
            wake_small: Notify::new(),
            stop: OnceLock::new(),
            grace,
            devices: Mutex::new(vec![(DeviceState::Opening, Vec::new()); workers]),
            counters: Counters::default(),
        }
    }

    /// Tells a worker that there may be a new job.
    pub fn wake(&self) {
        self.wake.notify_one();
        self.wake_small.notify_one();
    }

    /// Asks the workers to put their jobs back and to end.
    pub fn stop(&self) {
        // Asked again, they have stopped since the first time.
        let _ = self.stop.set(Instant::now());
        // One that is about to wait is woken by the next one's end.
        self.wake.notify_waiters();
        self.wake_small.notify_waiters();
        self.wake();
    }

    /// The state of the workers' devices: that of the worker that is nearest to running a job.
    pub fn device(&self) -> DeviceState {
        let rank = |state: &DeviceState| match state {
            DeviceState::Ready(_) => 0,
            DeviceState::Opening => 1,
            DeviceState::Unusable(_) => 2,
            DeviceState::Stopped => 3,
        };
        let states = self.lock().iter().map(|(state, _)| state.clone()).collect::<Vec<_>>();
        states.into_iter().min_by_key(rank).expect("there is a worker")
    }

    /// The devices that workers have opened, the preferred ones first; the CPU, which all have, once.
    pub fn devices(&self) -> Vec<Backend> {
        let mut devices: Vec<Backend> = self.lock().iter().flat_map(|(_, devices)| devices.clone()).collect();
        devices.sort_by_key(|device| device.kind == "cpu");
        let gpus = devices.iter().filter(|device| device.kind != "cpu").count();
        devices.truncate(gpus + 1);
        devices
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(DeviceState, Vec<Backend>)>> {
        self.devices.lock().expect("no code panics while it holds this lock")
    }

    fn set_devices(&self, worker: usize, devices: Vec<Backend>) {
        self.lock()[worker].1 = devices;
    }

    fn stopping(&self) -> bool {
        self.stop.get().is_some()
    }

    /// Whether the frame at hand has had its time to end.
    fn must_stop(&self) -> bool {
        self.stop.get().is_some_and(|since| since.elapsed() > self.grace)
    }

    fn set_device(&self, worker: usize, state: DeviceState) {
        self.lock()[worker].0 = state;
    }
}
