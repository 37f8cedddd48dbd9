//! The dispatcher: offers the jobs that wait, and settles the offers that are over.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use jiff::Timestamp;
use tokio::time::{sleep, timeout};
use uuid::Uuid;

use super::{Batch, Cluster, ClusterError, State};
use crate::jobs::worker::put_in_order;
use crate::jobs::{DeviceState, Shared, StatusLabel, log};
use crate::store::{Candidate, DataDir, Failure, JobStore, LEASE, Offer, OfferEnd, Status, StoreError};

/// How long jobs that come together are gathered.
const GATHER: Duration = Duration::from_millis(250);
/// How long a process may take to end after its job.
const LINGER: Duration = Duration::from_secs(60);
/// Jobs that are canceled with one question.
const CANCELED_TOGETHER: usize = 500;
/// Refusals after which a round offers no more.
const REFUSALS: usize = 8;
/// How long a job waits, in rounds: that the scheduler has refused, and after a process that died before it had begun,
/// which is multiplied for each death.
const ROUNDS_AFTER_REFUSAL: u32 = 12;
const ROUNDS_AFTER_DEATH: u32 = 3;

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
    /// Jobs that are not offered before then. What is lost of this with the server is offered too soon.
    paused: HashMap<Uuid, Instant>,
    /// What the log of a job was last told of its waiting.
    told: HashMap<Uuid, String>,
    /// Why the scheduler takes nothing.
    refusal: Option<String>,
    /// The database was away: leases are not looked at before then, for whoever holds one could not renew it.
    patient_until: Instant,
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
        let (paused, told) = (HashMap::new(), HashMap::new());
        let patient_until = Instant::now();
        Self { store, data, shared, cluster, every, most, paused, told, refusal: None, patient_until }
    }

    /// For ever.
    pub async fn run(mut self) {
        loop {
            let name = self.cluster.name();
            let trouble = match self.round().await {
                Ok(()) => self.refusal.clone(),
                Err(error) => {
                    if matches!(error, Trouble::Store(_)) {
                        self.patient_until = Instant::now() + LEASE;
                    }
                    Some(error.to_string())
                }
            };
            let state = match trouble {
                None => DeviceState::Ready(format!("{name}: it starts a process for each job")),
                Some(trouble) => DeviceState::Unusable(format!("{name}: jobs wait: {trouble}")),
            };
            if let DeviceState::Unusable(reason) = &state
                && self.shared.device() != state
            {
                tracing::error!("{reason}");
            }
            self.shared.set_device(0, state);
            // The scheduler is not asked more often than once a second, however many jobs come.
            let least = self.every.min(Duration::from_secs(1));
            sleep(least).await;
            if timeout(self.every - least, self.shared.wake.notified()).await.is_ok() {
                sleep(GATHER).await;
            }
        }
    }

    async fn round(&mut self) -> Result<(), Trouble> {
        if Instant::now() >= self.patient_until {
            for job in self.store.expire(|id| log::tail(&self.data.job(id))).await? {
                let files = self.data.job(job.id);
                log::note(&files, &format!("nothing was heard of its process for too long; the job is {}", job.status));
                self.ended(job.id, job.status).await;
            }
        }
        let offers = self.store.offers().await?;
        let names: Vec<String> = offers.iter().map(|offer| offer.cluster_job.clone()).collect();
        let states = self.cluster.observe(&names).await?;
        let leftovers = self.store.leftovers().await?;
        let of = |name: &String, job, sweep| states.get(name).filter(|seen| seen.is_of(job, sweep));
        let left = leftovers.iter().filter(|left| of(&left.cluster_job, left.id, left.sweep).is_some());
        let mut unwanted: Vec<String> = left.map(|left| left.cluster_job.clone()).collect();
        let (mut over, mut held) = (Vec::new(), 0);
        for offer in &offers {
            let state = of(&offer.cluster_job, offer.id, offer.sweep).map(|seen| &seen.state);
            let there = matches!(state, Some(State::Waiting(_) | State::Starting(_) | State::Alive));
            let is_over = !there || is_over(offer, state);
            // What was displaced may be started once more.
            if there && (is_over || is_unwanted(offer)) || matches!(state, Some(State::Displaced(_))) {
                unwanted.push(offer.cluster_job.clone());
            }
            if is_over {
                over.push((offer, state));
                continue;
            }
            held += 1;
            if let Some(State::Waiting(reason) | State::Starting(reason)) = state {
                self.tell(offer.id, &format!("it waits in {}: {reason}", self.cluster.name()));
            }
        }
        // First, so that what fails here is tried again.
        for names in unwanted.chunks(CANCELED_TOGETHER) {
            self.cluster.cancel(names).await?;
        }
        self.store.forget_leftovers(&leftovers).await?;
        for (offer, state) in over {
            self.settle(offer, state).await?;
        }
        self.offer(self.most.saturating_sub(held)).await
    }

    /// Says something in a job's log, unless it was said last.
    fn tell(&mut self, job: Uuid, what: &str) {
        if self.told.get(&job).is_none_or(|told| told != what) {
            log::note(&self.data.job(job), what);
            self.told.insert(job, what.to_owned());
        }
    }

    /// Does what is to be done if that is a job's last state.
    async fn ended(&mut self, job: Uuid, status: Status) {
        if status.is_terminal() {
            self.shared.counters.finished.get_or_create(&StatusLabel { status }).inc();
            put_in_order(&self.store, &self.data, job).await;
            self.told.remove(&job);
            self.paused.remove(&job);
        }
    }

    /// Ends an offer that the scheduler has done with, or does not know.
    async fn settle(&mut self, offer: &Offer, state: Option<&State>) -> Result<(), StoreError> {
        let Some(end) = self.end(offer, state) else { return Ok(()) };
        let Some(status) = self.store.withdraw(offer, &end).await? else { return Ok(()) };
        if offer.status.is_terminal() {
            self.told.remove(&offer.id);
        } else if !matches!(end, OfferEnd::Passed) {
            let why = match (&end, state) {
                (OfferEnd::Canceled, _) => "somebody canceled it there".into(),
                (OfferEnd::TimedOut(failure) | OfferEnd::Died(failure), _) => failure.message.clone(),
                (_, Some(State::Displaced(word))) => word.clone(),
                (_, Some(State::Waiting(_))) => "its place was taken back".into(),
                _ => "nothing was heard of it for too long".into(),
            };
            let (cluster, job) = (self.cluster.name(), &offer.cluster_job);
            self.tell(offer.id, &format!("{cluster} job {job} is over: {why}; the job is {status}"));
            tracing::info!(job = %offer.id, cluster_job = job, %status, why, "an offer is over");
            if matches!(end, OfferEnd::Died(_) | OfferEnd::Interrupted) && !offer.claimed {
                // What is wrong is not wrong with the job, and may pass.
                let deaths = self.store.get(offer.id).await?.map_or(0, |job| job.deaths);
                let rounds = ROUNDS_AFTER_DEATH.saturating_pow(deaths.clamp(1, 8) as u32);
                self.paused.insert(offer.id, Instant::now() + self.every * rounds);
            }
            self.ended(offer.id, status).await;
        }
        if !matches!(end, OfferEnd::Died(_)) {
            self.cluster.forget(&offer.cluster_job);
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
            let said = self.cluster.last_words(job);
            if !said.is_empty() {
                message = format!("{message}. It said last:\n{said}");
            }
            Failure::new("crashed", message)
        };
        Some(match state {
            _ if offer.status.is_terminal() => OfferEnd::Interrupted,
            _ if offer.is_passed() => OfferEnd::Passed,
            Some(State::Canceled) => OfferEnd::Canceled,
            Some(State::Waiting(_) | State::Starting(_) | State::Alive | State::Displaced(_)) => OfferEnd::Interrupted,
            Some(State::TimedOut) => OfferEnd::TimedOut(died("was not done when its time was up")),
            Some(State::Failed(word)) => OfferEnd::Died(died(&format!("ended as {word}"))),
            // It was told that its time was nearly up, and put the job back.
            Some(State::Completed) if waits && offer.claimed => {
                OfferEnd::TimedOut(died("was told to stop, again and again before it had saved its state"))
            }
            Some(State::Completed) => OfferEnd::Died(died("ended without bringing the job to an end")),
            None if waits && offer.claimed => OfferEnd::Interrupted,
            None if waits => OfferEnd::Died(died("is not known any more")),
            // Its lease will tell.
            None => return None,
        })
    }

    /// Offers at most so many jobs.
    async fn offer(&mut self, most: usize) -> Result<(), Trouble> {
        self.paused.retain(|_, until| *until > Instant::now());
        if most == 0 {
            return Ok(());
        }
        let mut candidates = self.store.candidates((most + self.paused.len()) as i64).await?;
        if candidates.is_empty() {
            self.refusal = None;
        }
        candidates.retain(|job| !self.paused.contains_key(&job.id));
        candidates.truncate(most);
        let mut batches = VecDeque::from(batches(candidates, self.cluster.largest_batch()));
        let mut refusals = 0;
        while let Some(batch) = batches.pop_front() {
            match self.cluster.submit(&batch).await {
                Ok(names) => {
                    self.refusal = None;
                    self.note(&batch, &names).await?;
                }
                Err(error @ ClusterError::Away(_)) => return Err(error.into()),
                Err(error) => {
                    // One of them may be in the way of the others, or they may be too many.
                    if let Some((first, second)) = batch.halves() {
                        batches.push_front(second);
                        batches.push_front(first);
                    } else {
                        let job = batch.jobs[0].id;
                        self.tell(job, &format!("{} does not take it: {error}", self.cluster.name()));
                        self.paused.insert(job, Instant::now() + self.every * ROUNDS_AFTER_REFUSAL);
                    }
                    self.refusal = Some(error.to_string());
                    refusals += 1;
                    if refusals == REFUSALS {
                        break;
                    }
                }
            }
        }
        Ok(())
    }

    /// Notes what was offered.
    async fn note(&mut self, batch: &Batch, names: &[String]) -> Result<(), Trouble> {
        let mut unwanted = Vec::new();
        for (job, name) in batch.jobs.iter().zip(names) {
            if self.store.offered(job.id, job.attempt, name).await? {
                self.tell(
                    job.id,
                    &format!("attempt {} was handed to {} as job {name}", job.attempt, self.cluster.name()),
                );
            } else {
                unwanted.push(name.clone());
            }
        }
        if !unwanted.is_empty() {
            self.cluster.cancel(&unwanted).await?;
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

/// Whether an attempt is over of which the scheduler still has something: the job has gone on without it, it waits to
/// be started once more, or its process was not heard of for too long. One that has put its job back is to end in the
/// time of a lease, and the scheduler to tell why.
fn is_over(offer: &Offer, state: Option<&State>) -> bool {
    let waits_again = offer.claimed && matches!(state, Some(State::Waiting(_)));
    let is_lost = offer.claimed && offer.status == Status::Queued && offer.expired;
    !offer.status.is_terminal() && (offer.is_passed() || waits_again || is_lost)
}

/// Groups the first attempts at the jobs of a sweep; all others stand alone. Their order stays that of the first of
/// each group.
fn batches(candidates: Vec<Candidate>, largest: usize) -> Vec<Batch> {
    let mut batches: Vec<Batch> = Vec::new();
    // Where the group of a sweep is that has room.
    let mut open: HashMap<Uuid, usize> = HashMap::new();
    for job in candidates {
        let estimate_s = job.estimate_s.unwrap_or(0.0);
        let sweep = job.sweep.clone().filter(|_| job.attempt == 1);
        if let Some((sweep, _)) = &sweep
            && let Some(&at) = open.get(sweep)
            && batches[at].jobs.len() < largest
        {
            batches[at].estimate_s = batches[at].estimate_s.max(estimate_s);
            batches[at].deaths = batches[at].deaths.max(job.deaths);
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
        let (attempt, deaths) = (job.attempt, job.deaths);
        batches.push(Batch { jobs: vec![job], name, comment: comment.to_string(), estimate_s, attempt, deaths });
    }
    batches
}

impl Batch {
    /// Two of half the size; none of one job.
    fn halves(&self) -> Option<(Self, Self)> {
        let (first, second) = self.jobs.split_at(self.jobs.len() / 2);
        let of = |jobs: &[Candidate]| Self { jobs: jobs.to_vec(), ..self.clone() };
        (!first.is_empty()).then(|| (of(first), of(second)))
    }
}
