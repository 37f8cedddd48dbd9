//! The dispatcher: offers the jobs that wait, and settles the offers that are over.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use tokio::time::timeout;

use super::{Batch, Cluster, ClusterError, State};
use crate::jobs::{DeviceState, Shared, StatusLabel, log};
use crate::store::{Candidate, DataDir, Failure, JobStore, Offer, OfferEnd, Status, StoreError};

/// How long jobs that come together are gathered.
const GATHER: Duration = Duration::from_millis(250);
/// How long a process may take to end after its job.
const LINGER: Duration = Duration::from_secs(60);
/// Last bytes of a process's output that a failure quotes.
const QUOTED: usize = 600;

/// Hands jobs to a cluster's scheduler.
pub struct Dispatcher {
    store: JobStore,
    data: Arc<DataDir>,
    shared: Arc<Shared>,
    cluster: Arc<dyn Cluster>,
    /// How often the scheduler is asked.
    every: Duration,
    /// Offers that the scheduler may hold at a time.
    most: usize,
}

/// Why a round was not finished.
#[derive(Debug, thiserror::Error)]
enum Trouble {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Cluster(#[from] ClusterError),
}

impl Dispatcher {
    pub fn new(
        store: JobStore,
        data: Arc<DataDir>,
        shared: Arc<Shared>,
        cluster: Arc<dyn Cluster>,
        every: Duration,
        most: usize,
    ) -> Self {
        Self { store, data, shared, cluster, every, most }
    }

    /// For ever.
    pub async fn run(self) {
        loop {
            let state = match self.round().await {
                Ok(()) => DeviceState::Ready(format!("{}: it starts a process for each job", self.cluster.name())),
                Err(error) => DeviceState::Unusable(format!("{}: jobs wait: {error}", self.cluster.name())),
            };
            if let DeviceState::Unusable(reason) = &state
                && self.shared.device() != state
            {
                tracing::error!("{reason}");
            }
            self.shared.set_device(0, state);
            // A new job wakes it; all others wait for a while, so that what comes together is offered together.
            let _ = timeout(self.every, self.shared.wake.notified()).await;
            tokio::time::sleep(self.every.min(GATHER)).await;
        }
    }

    async fn round(&self) -> Result<(), Trouble> {
        for job in self.store.expire(|id| log::tail(&self.data.job(id))).await? {
            let note = format!("nothing was heard of its process for too long; the job is {}", job.status);
            log::note(&self.data.job(job.id), &note);
        }
        let offers = self.store.offers().await?;
        let names: Vec<String> = offers.iter().map(|offer| offer.cluster_job.clone()).collect();
        // Also without offers: so it is known whether there is a scheduler.
        let states = self.cluster.observe(&names).await?;
        let mut unwanted = Vec::new();
        let mut held = 0;
        for offer in &offers {
            match states.get(&offer.cluster_job) {
                Some(state @ (State::Waiting | State::Alive)) => {
                    let over = is_over(offer, state);
                    if over || is_unwanted(offer) {
                        unwanted.push(offer.cluster_job.clone());
                    }
                    if over {
                        self.settle(offer, Some(state)).await?;
                    } else {
                        held += 1;
                    }
                }
                state => self.settle(offer, state).await?,
            }
        }
        if !unwanted.is_empty() {
            self.cluster.cancel(&unwanted).await?;
        }
        self.offer(self.most.saturating_sub(held)).await
    }

    /// Ends an offer that the scheduler has done with, or does not know.
    async fn settle(&self, offer: &Offer, state: Option<&State>) -> Result<(), StoreError> {
        let Some(end) = self.end(offer, state) else { return Ok(()) };
        let Some(status) = self.store.withdraw(offer, &end).await? else { return Ok(()) };
        let files = self.data.job(offer.id);
        if status.is_terminal() && (offer.claimed || !offer.status.is_terminal()) {
            self.shared.counters.finished.get_or_create(&StatusLabel { status }).inc();
        }
        if !offer.status.is_terminal() {
            let why = match &end {
                OfferEnd::Canceled => "somebody canceled it there".into(),
                OfferEnd::Interrupted => match state {
                    Some(State::Displaced(word)) => word.clone(),
                    Some(State::Waiting) => "its place was taken back".into(),
                    Some(State::Alive) => "nothing was heard of it for too long".into(),
                    _ => "it put the job back".into(),
                },
                OfferEnd::TimedOut(failure) | OfferEnd::Died(failure) => failure.message.clone(),
            };
            let (cluster, job) = (self.cluster.name(), &offer.cluster_job);
            log::note(&files, &format!("{cluster} job {job} is over: {why}; the job is {status}"));
            tracing::info!(job = %offer.id, cluster_job = job, %status, why, "an offer is over");
        }
        let output = self.cluster.output(&offer.cluster_job);
        // Of what went well nothing is to be read.
        if status == Status::Succeeded || std::fs::metadata(&output).is_ok_and(|file| file.len() == 0) {
            let _ = std::fs::remove_file(output);
        }
        Ok(())
    }

    /// How an offer ended; `None` where that is not known yet.
    fn end(&self, offer: &Offer, state: Option<&State>) -> Option<OfferEnd> {
        let waits = offer.status == Status::Queued;
        let died = |what: &str| {
            let (cluster, job) = (self.cluster.name(), &offer.cluster_job);
            let mut message = format!(
                "{cluster} job {job}, which ran attempt {}, {what}; look at the scheduler's record of it, or make the \
                 scene smaller",
                offer.attempt
            );
            let said = tail(&self.cluster.output(job));
            if !said.is_empty() {
                message = format!("{message}. It said last:\n{said}");
            }
            Failure::new("crashed", message)
        };
        Some(match state {
            _ if offer.status.is_terminal() => OfferEnd::Interrupted,
            Some(State::Canceled) => OfferEnd::Canceled,
            Some(State::Waiting | State::Alive | State::Displaced(_)) => OfferEnd::Interrupted,
            Some(State::TimedOut) => OfferEnd::TimedOut(died("was not done when its time was up")),
            Some(State::Failed(word)) => OfferEnd::Died(died(&format!("ended as {word}"))),
            // It put the job back.
            Some(State::Completed) if waits && offer.claimed => OfferEnd::Interrupted,
            Some(State::Completed) => OfferEnd::Died(died("ended without bringing the job to an end")),
            None if waits && offer.claimed => OfferEnd::Interrupted,
            None if waits => OfferEnd::Died(died("is not known any more")),
            // Its lease will tell.
            None => return None,
        })
    }

    /// Offers at most so many jobs.
    async fn offer(&self, most: usize) -> Result<(), Trouble> {
        if most == 0 {
            return Ok(());
        }
        let candidates = self.store.candidates(most as i64).await?;
        for batch in batches(candidates, self.cluster.largest_batch()) {
            let names = self.cluster.submit(&batch).await?;
            for (job, name) in batch.jobs.iter().zip(&names) {
                if self.store.offered(job.id, job.attempt, name).await? {
                    let note = format!("attempt {} was handed to {} as job {name}", job.attempt, self.cluster.name());
                    log::note(&self.data.job(job.id), &note);
                } else {
                    self.cluster.cancel(std::slice::from_ref(name)).await?;
                }
            }
        }
        Ok(())
    }
}

/// Whether nobody needs any more what the scheduler still has of an offer.
fn is_unwanted(offer: &Offer) -> bool {
    match offer.status {
        Status::Queued => false,
        Status::Running => offer.cancel_requested || !offer.claimed,
        // Its process is about to end.
        _ if offer.claimed => offer
            .finished_at
            .is_some_and(|at| Timestamp::now().as_microsecond().saturating_sub(at) > LINGER.as_micros() as i64),
        _ => true,
    }
}

/// Whether an attempt is over of which the scheduler still has something: it waits to be started once more, or its
/// process was not heard of for too long. One that has put its job back is to end in the time of a lease, and the
/// scheduler to tell why.
fn is_over(offer: &Offer, state: &State) -> bool {
    let open = !offer.status.is_terminal();
    offer.claimed && open && (*state == State::Waiting || offer.status == Status::Queued && offer.expired)
}

/// Groups the first attempts at the jobs of a sweep; all others stand alone. Their order stays that of the first of
/// each group.
fn batches(candidates: Vec<Candidate>, largest: usize) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    // Where the group of a sweep is that has room.
    let mut open: HashMap<uuid::Uuid, usize> = HashMap::new();
    for job in candidates {
        let estimate_s = job.estimate_s.unwrap_or(0.0);
        let sweep = job.sweep.clone().filter(|_| job.attempt == 1);
        if let Some((sweep, _)) = &sweep
            && let Some(&at) = open.get(sweep)
            && batches[at].jobs.len() < largest
        {
            batches[at].estimate_s = batches[at].estimate_s.max(estimate_s);
            batches[at].jobs.push(job);
            continue;
        }
        let (name, comment) = match sweep {
            Some((sweep, name)) => {
                open.insert(sweep, batches.len());
                (name, sweep)
            }
            None => (job.name.clone(), job.id),
        };
        let attempt = job.attempt;
        batches.push(Batch { jobs: vec![job], name, comment: comment.to_string(), estimate_s, attempt });
    }
    batches
}

/// The last words of a process.
fn tail(output: &Path) -> String {
    let Ok(bytes) = std::fs::read(output) else { return String::new() };
    String::from_utf8_lossy(&bytes[bytes.len().saturating_sub(QUOTED)..]).trim().to_owned()
}
