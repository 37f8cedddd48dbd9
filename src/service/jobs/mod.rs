//! Running jobs: admission of scenes, and the worker that takes jobs from the store and runs them
//! to the end.

pub mod admission;
mod attempt;
mod counters;
mod log;
mod resume;
pub mod retention;
mod watch;
mod worker;

use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use tokio::sync::Notify;

pub use attempt::panic_message;
pub use counters::{Counters, StatusLabel};
pub use worker::{Settings, Worker};

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;
use gridfall_engine::choice::Devices;
use gridfall_engine::{Backend, Engine, EngineError};

/// Where a worker gets its engines from. Created and used on the worker's own thread.
pub trait EngineSource {
    /// Loads a problem on the device that suits it.
    fn engine(&self, setup: &Setup, particles: Particles) -> Result<Box<dyn Engine>, EngineError>;

    /// Which devices are open, and why, for people.
    fn describe(&self) -> String;

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

    fn devices(&self) -> Vec<Backend> {
        let gpu = self.gpu().map(|gpu| gpu.backend(self.reason()));
        gpu.into_iter().chain([Backend::this_cpu(self.reason())]).collect()
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

/// How long a run may take to reach the end of its frame, where it saves its state, when the server stops.
const GRACE: Duration = Duration::from_secs(3);

/// What the worker and the rest of the server share.
#[derive(Debug)]
pub struct Shared {
    wake: Notify,
    /// When the worker was asked to stop.
    stop: OnceLock<Instant>,
    device: Mutex<DeviceState>,
    devices: Mutex<Vec<Backend>>,
    pub counters: Counters,
}

impl Default for Shared {
    fn default() -> Self {
        Self {
            wake: Notify::new(),
            stop: OnceLock::new(),
            device: Mutex::new(DeviceState::Opening),
            devices: Mutex::default(),
            counters: Counters::default(),
        }
    }
}

impl Shared {
    /// Tells the worker that there may be a new job.
    pub fn wake(&self) {
        self.wake.notify_one();
    }

    /// Asks the worker to put its job back and to end.
    pub fn stop(&self) {
        // Asked again, it has stopped since the first time.
        let _ = self.stop.set(Instant::now());
        self.wake.notify_one();
    }

    pub fn device(&self) -> DeviceState {
        self.device.lock().expect("no code panics while it holds this lock").clone()
    }

    /// The devices that the worker has opened.
    pub fn devices(&self) -> Vec<Backend> {
        self.devices.lock().expect("no code panics while it holds this lock").clone()
    }

    fn set_devices(&self, devices: Vec<Backend>) {
        *self.devices.lock().expect("no code panics while it holds this lock") = devices;
    }

    fn stopping(&self) -> bool {
        self.stop.get().is_some()
    }

    /// Whether the frame at hand has had its time to end.
    fn must_stop(&self) -> bool {
        self.stop.get().is_some_and(|since| since.elapsed() > GRACE)
    }

    fn set_device(&self, state: DeviceState) {
        *self.device.lock().expect("no code panics while it holds this lock") = state;
    }
}
