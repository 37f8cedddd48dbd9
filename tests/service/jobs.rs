//! The worker survives faults of engines, and every job that it takes ends.

use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::Setup;
use gridfall_engine::{Backend, Control, Engine, EngineError, FrameStats, StateError};
use gridfall_service::jobs::{DeviceState, EngineSource, Executor, OpenDevices, Settings, Workers};
use gridfall_service::store::{DataDir, Job, JobStore, MAX_DEATHS, NewJob, Status, Submission};
use uuid::Uuid;

const SCENE: &str = r#"{
    "gridfall": 1, "name": "square", "dimension": 2,
    "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.125 },
    "materials": {
        "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 }
    },
    "bodies": [{ "name": "square", "material": "jelly",
        "shape": { "box": { "min": [0.25, 0.25], "max": [0.75, 0.75] } } }],
    "time": { "end": 0.3, "frame_rate": 10 }
}"#;

/// What an engine does in its second frame.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    GoOn,
    Panic,
    Diverge,
    LoseDevice,
    /// Waits until another engine is loaded.
    Meet,
}

/// An engine that moves nothing and meets its fate in its second frame.
struct Fake {
    backend: Backend,
    particles: Particles,
    frame: u32,
    fate: Fate,
    loaded: Arc<AtomicUsize>,
}

impl Engine for Fake {
    fn backend(&self) -> &Backend {
        &self.backend
    }

    fn advance_frame(&mut self, frame_s: f64, control: &dyn Control) -> Result<FrameStats, EngineError> {
        while self.fate == Fate::Meet && self.loaded.load(Ordering::SeqCst) < 2 {
            if control.canceled() {
                return Err(EngineError::Canceled);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.frame += 1;
        match self.fate {
            Fate::Panic if self.frame == 2 => panic!("an index out of bounds, say"),
            Fate::Diverge if self.frame == 2 => {
                Err(EngineError::Diverged { step: 7, time_s: 0.1, what: "a velocity is not a number".into() })
            }
            Fate::LoseDevice if self.frame == 2 => Err(EngineError::DeviceLost("it fell off the bus".into())),
            _ => Ok(FrameStats { steps: 1, dt_s: frame_s, ..FrameStats::default() }),
        }
    }

    fn append(&mut self, particles: Particles) -> Result<(), EngineError> {
        self.particles.append(particles);
        Ok(())
    }

    fn snapshot(&mut self) -> Result<Particles, EngineError> {
        Ok(self.particles.clone())
    }

    fn save(&mut self, to: &mut dyn Write) -> Result<(), StateError> {
        Ok(to.write_all(&self.frame.to_le_bytes())?)
    }

    fn restore(&mut self, from: &mut dyn Read) -> Result<(), StateError> {
        let mut frame = [0; 4];
        from.read_exact(&mut frame)?;
        self.frame = u32::from_le_bytes(frame);
        Ok(())
    }
}

/// Engines with the given fates, in order; the last fate applies to all that follow.
struct Fakes {
    fates: Vec<Fate>,
    loaded: Arc<AtomicUsize>,
}

impl EngineSource for Fakes {
    fn engine(&self, _: &Setup, particles: Particles) -> Result<Box<dyn Engine>, EngineError> {
        let n = self.loaded.fetch_add(1, Ordering::SeqCst).min(self.fates.len() - 1);
        let backend = Backend {
            kind: "cpu".into(),
            device: "fake".into(),
            driver: String::new(),
            software: false,
            reason: "a test".into(),
        };
        let loaded = self.loaded.clone();
        Ok(Box::new(Fake { backend, particles, frame: 0, fate: self.fates[n], loaded }))
    }

    fn describe(&self) -> String {
        "fakes".into()
    }
}

/// A worker on a fresh data directory whose engines meet these fates. Counts how often its devices
/// were opened.
struct Bench {
    _dir: tempfile::TempDir,
    data: Arc<DataDir>,
    store: JobStore,
    workers: Workers,
    opened: Arc<AtomicUsize>,
}

impl Bench {
    async fn start(fates: &[Fate], failed_openings: usize) -> Self {
        // No checkpoint, however slow the machine.
        let settings = Settings { checkpoint_every: Duration::from_secs(3600), ..Settings::default() };
        Self::start_workers(1, settings, fates, failed_openings).await
    }

    async fn start_workers(workers: usize, settings: Settings, fates: &[Fate], failed_openings: usize) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let data = Arc::new(DataDir::open(dir.path()).unwrap());
        let store = JobStore::open(&data.database()).await.unwrap();
        let (opened, loaded) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
        let open = || -> OpenDevices {
            let (count, loaded, fates) = (opened.clone(), loaded.clone(), fates.to_vec());
            Box::new(move || {
                if count.fetch_add(1, Ordering::SeqCst) < failed_openings {
                    return Err(EngineError::NoDevice("it is not there yet".into()));
                }
                Ok(Box::new(Fakes { fates: fates.clone(), loaded: loaded.clone() }) as Box<dyn EngineSource>)
            })
        };
        let open = (0..workers).map(|_| open()).collect();
        let workers = Workers::start(store.clone(), data.clone(), settings, Executor::Local(open)).await.unwrap();
        Self { _dir: dir, data, store, workers, opened }
    }

    async fn submit(&self) -> Uuid {
        let new = NewJob {
            name: "square".into(),
            scene: SCENE.into(),
            particles: 64,
            frames: 4,
            end_time_s: 0.3,
            integrator: "explicit".into(),
            integrator_reason: "it is a test".into(),
            ..NewJob::default()
        };
        let Submission::Accepted(job) = self.store.submit(&new, 10).await.unwrap() else { panic!("not accepted") };
        self.workers.shared().wake();
        job.id
    }

    async fn ended(&self, id: Uuid) -> Job {
        self.until(|| async { self.store.get(id).await.unwrap().filter(|job| job.status.is_terminal()) }).await
    }

    async fn until<T, F: Future<Output = Option<T>>>(&self, look: impl Fn() -> F) -> T {
        let started = Instant::now();
        loop {
            if let Some(found) = look().await {
                return found;
            }
            assert!(started.elapsed() < Duration::from_secs(60), "it never came");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    fn opened(&self) -> usize {
        self.opened.load(Ordering::SeqCst)
    }
}

fn frames(recording: &Path) -> usize {
    let bytes = std::fs::read(recording).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    messages.filter(|message| message.channel.topic == "/diagnostics").count()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_panic_fails_its_job_and_the_next_one_runs_on_fresh_devices() {
    let bench = Bench::start(&[Fate::Panic, Fate::GoOn], 0).await;
    let job = bench.ended(bench.submit().await).await;
    let failure = job.failure.unwrap();
    assert_eq!((job.status, failure.code.as_str()), (Status::Failed, "internal"));
    assert!(failure.message.contains("out of bounds"), "{failure:?}");
    // Frames 0 and 1 were written before the panic.
    assert_eq!(frames(&bench.data.job(job.id).attempt(job.attempt).recording()), 2);

    let next = bench.ended(bench.submit().await).await;
    assert_eq!((next.status, next.attempt), (Status::Succeeded, 1));
    assert_eq!(frames(&bench.data.job(next.id).attempt(next.attempt).recording()), 4);
    assert_eq!(bench.opened(), 2);
    bench.workers.stop(Duration::from_secs(60)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_failure_of_the_scene_has_the_engines_code_and_keeps_the_frames_before_it() {
    let bench = Bench::start(&[Fate::Diverge, Fate::GoOn], 0).await;
    let job = bench.ended(bench.submit().await).await;
    assert_eq!((job.status, job.failure.unwrap().code.as_str()), (Status::Failed, "diverged"));
    assert_eq!(frames(&bench.data.job(job.id).attempt(job.attempt).recording()), 2);
    assert_eq!(bench.ended(bench.submit().await).await.status, Status::Succeeded);
    assert_eq!(bench.opened(), 1, "the devices had no part in it");
    bench.workers.stop(Duration::from_secs(60)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_is_tried_again_after_a_lost_device_and_given_up_when_that_never_ends() {
    let mut fates = vec![Fate::LoseDevice, Fate::GoOn];
    fates.extend([Fate::LoseDevice; MAX_DEATHS as usize]);
    fates.push(Fate::GoOn);
    let bench = Bench::start(&fates, 0).await;
    let job = bench.ended(bench.submit().await).await;
    assert_eq!((job.status, job.attempt), (Status::Succeeded, 2));
    assert_eq!(frames(&bench.data.job(job.id).attempt(job.attempt).recording()), 4);

    let job = bench.ended(bench.submit().await).await;
    let failure = job.failure.unwrap();
    assert_eq!((job.status, job.attempt, failure.code.as_str()), (Status::Failed, MAX_DEATHS, "device_lost"));
    assert!(failure.message.contains("fell off the bus"), "{failure:?}");
    assert_eq!(bench.ended(bench.submit().await).await.status, Status::Succeeded);
    assert_eq!(bench.opened(), 2 + MAX_DEATHS as usize);
    bench.workers.stop(Duration::from_secs(60)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_goes_on_from_its_checkpoint_after_a_lost_device() {
    let settings = Settings { checkpoint_every: Duration::ZERO, ..Settings::default() };
    let bench = Bench::start_workers(1, settings, &[Fate::LoseDevice, Fate::GoOn], 0).await;
    let job = bench.ended(bench.submit().await).await;
    assert_eq!((job.status, job.attempt), (Status::Succeeded, 2));
    let files = bench.data.job(job.id);
    assert_eq!(frames(&files.attempt(2).recording()), 4);
    let log = std::fs::read_to_string(files.log()).unwrap();
    assert!(log.contains("attempt 2 runs after frame 1"), "{log}");
    bench.workers.stop(Duration::from_secs(60)).await;
}

/// Each job waits for the other to be loaded.
#[tokio::test(flavor = "multi_thread")]
async fn a_server_runs_a_job_on_each_of_its_devices_at_a_time() {
    let bench = Bench::start_workers(2, Settings::default(), &[Fate::Meet], 0).await;
    let jobs = [bench.submit().await, bench.submit().await];
    for job in jobs {
        let job = bench.ended(job).await;
        assert_eq!((job.status, job.attempt), (Status::Succeeded, 1));
    }
    assert_eq!(bench.opened(), 2);
    bench.workers.stop(Duration::from_secs(60)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_wait_for_a_device_that_comes_late() {
    let bench = Bench::start(&[Fate::GoOn], 1).await;
    let id = bench.submit().await;
    let shared = bench.workers.shared();
    let reason = bench
        .until(|| async {
            match shared.device() {
                DeviceState::Unusable(reason) => Some(reason),
                _ => None,
            }
        })
        .await;
    assert!(reason.contains("not there yet"), "{reason}");
    assert_eq!(bench.ended(id).await.status, Status::Succeeded);
    assert_eq!(shared.device(), DeviceState::Ready("fakes".into()));
    bench.workers.stop(Duration::from_secs(60)).await;
    assert_eq!(shared.device(), DeviceState::Stopped);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scene_that_this_version_does_not_accept_fails_with_its_faults() {
    let bench = Bench::start(&[Fate::GoOn], 0).await;
    let new = NewJob {
        name: "old".into(),
        scene: SCENE.replace("\"density\": 1000", "\"density\": -1000"),
        particles: 64,
        frames: 4,
        end_time_s: 0.3,
        integrator: "explicit".into(),
        integrator_reason: "it is a test".into(),
        ..NewJob::default()
    };
    let Submission::Accepted(job) = bench.store.submit(&new, 10).await.unwrap() else { panic!("not accepted") };
    bench.workers.shared().wake();
    let failure = bench.ended(job.id).await.failure.unwrap();
    assert_eq!(failure.code, "invalid_scene");
    assert!(failure.message.contains("/materials/jelly/density"), "{failure:?}");
    bench.workers.stop(Duration::from_secs(60)).await;
}
