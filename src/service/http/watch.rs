//! Watching jobs: one look at the store now and then for all clients that watch the same job.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use tokio::sync::watch;
use uuid::Uuid;

use super::dto;
use super::jobs::version;
use super::problem::{Problem, internal};
use super::state::Api;
use crate::store::Job;

/// How often a watched job is looked at. Its worker writes progress about as often.
const INTERVAL: Duration = Duration::from_millis(200);

/// A job as it stood at a look; none once it is deleted.
pub type Seen = Option<Arc<View>>;

#[derive(Debug, PartialEq)]
pub struct View {
    pub job: Job,
    /// The job as JSON, and its entity tag.
    pub body: Vec<u8>,
    pub tag: String,
    /// Length of its log (bytes).
    pub log_bytes: u64,
}

/// The jobs that are watched.
#[derive(Debug, Default)]
pub struct Watches(Mutex<HashMap<Uuid, watch::Receiver<Seen>>>);

impl Watches {
    fn lock(&self) -> MutexGuard<'_, HashMap<Uuid, watch::Receiver<Seen>>> {
        self.0.lock().expect("no code panics while it holds this lock")
    }
}

impl Api {
    /// What becomes of a job. The channel is closed after its end was sent.
    pub(super) async fn watch(&self, id: Uuid) -> Result<watch::Receiver<Seen>, Problem> {
        if let Some(known) = self.watches.lock().get(&id) {
            return Ok(known.clone());
        }
        let first = look(self, id).await?.ok_or_else(|| Problem::job_not_found(id))?;
        let mut watched = self.watches.lock();
        if let Some(known) = watched.get(&id) {
            return Ok(known.clone());
        }
        let (sender, receiver) = watch::channel(Some(Arc::new(first)));
        watched.insert(id, receiver.clone());
        drop(watched);
        tokio::spawn(keep_looking(self.clone(), id, sender));
        Ok(receiver)
    }
}

async fn look(api: &Api, id: Uuid) -> Result<Option<View>, Problem> {
    let Some(job) = api.store.get(id).await? else { return Ok(None) };
    if api.data.objects().is_some() {
        // Those who watch are told of the log. They do not wait for it.
        let (data, watched) = (api.data.clone(), job.clone());
        tokio::spawn(async move {
            if let Err(error) = data.fetch(&watched, &[]).await {
                tracing::warn!(job = %id, %error, "cannot fetch what a job has come to on another machine");
            }
        });
    }
    let log_bytes = tokio::fs::metadata(api.data.job(id).log()).await.map_or(0, |metadata| metadata.len());
    let body = serde_json::to_vec(&dto::Job::from(job.clone())).map_err(internal)?;
    let tag = version(&body).tag().to_owned();
    Ok(Some(View { job, body, tag, log_bytes }))
}

/// Looks until the job has ended or nobody watches it any more.
async fn keep_looking(api: Api, id: Uuid, sender: watch::Sender<Seen>) {
    loop {
        let ended = sender.borrow().as_ref().is_none_or(|view| view.job.status.is_terminal());
        {
            // Under the lock, so that nobody begins to watch in between. One receiver is the table's.
            let mut watched = api.watches.lock();
            if ended || sender.receiver_count() <= 1 {
                watched.remove(&id);
                return;
            }
        }
        tokio::time::sleep(INTERVAL).await;
        // A look that failed was logged; the next one may succeed.
        if let Ok(view) = look(&api, id).await {
            sender.send_if_modified(|seen| {
                let changed = seen.as_deref() != view.as_ref();
                if changed {
                    *seen = view.map(Arc::new);
                }
                changed
            });
        }
    }
}
