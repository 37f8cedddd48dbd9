//! The scenes of jobs, as pictures and surfaces need them, and who draws.

use std::sync::{Arc, Mutex};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;
use uuid::Uuid;

use super::extract::Room;
use super::problem::{Code, Problem, internal};
use super::scenes::by_judges;
use super::state::Api;
use gridfall_recording::Scenery;
use gridfall_scene as scene;

/// Scenes that are kept ready, those that were used last.
const KNOWN: usize = 8;
/// Pictures and surfaces that are made at a time: each takes all threads, and a few hundred megabytes.
const ARTISTS: usize = 1;

/// Scenes that are ready, by job.
#[derive(Debug)]
pub struct Sceneries {
    known: Mutex<Vec<(Uuid, Arc<Scenery>)>>,
    artists: Arc<Semaphore>,
}

impl Default for Sceneries {
    fn default() -> Self {
        Self { known: Mutex::default(), artists: Arc::new(Semaphore::new(ARTISTS)) }
    }
}

impl Sceneries {
    /// Waits for a turn to draw. To be held by the work, and not by the request: a client that disconnects does not
    /// make it cheaper.
    pub async fn turn(&self, api: &Api) -> Result<OwnedSemaphorePermit, Problem> {
        match timeout(api.config.validation_wait, self.artists.clone().acquire_owned()).await {
            Ok(permit) => permit.map_err(internal),
            Err(_) => {
                let detail = "other pictures and surfaces are being made; ask again";
                Err(Problem::new(Code::Overloaded, detail).retry_after(2))
            }
        }
    }

    /// The scene of a job.
    pub async fn of(&self, api: &Api, job: Uuid) -> Result<Arc<Scenery>, Problem> {
        if let Some(scenery) = self.kept(job) {
            return Ok(scenery);
        }
        let text = api.store.scene(job).await?.ok_or_else(|| Problem::job_not_found(job))?;
        let (limits, assets) = (api.config.limits, api.data.assets());
        let made = by_judges(api, Room::default(), move || {
            let problem = scene::problem_with(&scene::parse(&text)?, &limits, &assets);
            problem.map(|problem| Arc::new(Scenery::new(problem)))
        });
        let scenery = made.await?.map_err(Problem::invalid_scene)?;
        let mut known = self.known.lock().expect("no code panics while it holds this lock");
        known.retain(|(other, _)| *other != job);
        known.insert(0, (job, scenery.clone()));
        known.truncate(KNOWN);
        Ok(scenery)
    }

    fn kept(&self, job: Uuid) -> Option<Arc<Scenery>> {
        let mut known = self.known.lock().expect("no code panics while it holds this lock");
        let at = known.iter().position(|(other, _)| *other == job)?;
        let entry = known.remove(at);
        known.insert(0, entry);
        Some(known[0].1.clone())
    }
}
