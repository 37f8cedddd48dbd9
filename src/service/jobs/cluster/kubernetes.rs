//! Kubernetes: a Job of one Pod for each attempt, made from a template of the operator's.
//!
//! A Job's name follows from the job and the number of its attempt, so that a submission can be repeated. The Job
//! never starts a second Pod: the next attempt is a Job of its own.

mod states;
mod template;

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Duration;

use hyper::http::{Request, header};
use jiff::Timestamp;
use k8s_openapi::NamespaceResourceScope;
use k8s_openapi::api::batch::v1::Job;
use k8s_openapi::api::core::v1::Pod;
use kube::api::{Api, DeleteParams, ListParams, ObjectList, Preconditions, Resource};
use kube::{Client, Config, Error};
use serde::de::DeserializeOwned;
use serde_json::Value;
use tokio::time::{sleep, timeout};
use uuid::Uuid;

use super::{Answer, Batch, Cluster, ClusterError, Seen, State};
use crate::store::Candidate;
use states::{finished, state};
use template::{JOB_LABEL, Template};

/// What a process ends with that was told to stop, and has put its job back (`EX_TEMPFAIL`). What Kubernetes evicts is
/// then no success for it.
pub const STOPPED: u8 = 75;
/// How long the API server may take for an answer.
const PATIENCE: Duration = Duration::from_secs(30);
/// How often a question is put that it has no time for, and how long to wait at most before it is put again.
const TRIES: usize = 4;
const LONGEST_WAIT_S: u32 = 5;
/// Objects of one page of a list.
const PAGE: u32 = 500;
/// Only these are listed.
const OURS: &str = "app.kubernetes.io/managed-by=gridfall";

/// How jobs are handed to Kubernetes.
#[derive(Clone, Debug)]
pub struct KubernetesOptions {
    /// Where Jobs are made; by default the namespace of the configuration.
    pub namespace: Option<String>,
    /// The manifest of a Job, in YAML.
    pub template: String,
    /// The data directory, the same in the containers; with `files`, a folder that each container has for itself.
    pub folder: PathBuf,
    /// URL of the object storage, if that is where the files are. Containers get it by the environment.
    pub files: Option<String>,
    /// Arguments of the program, besides those that say what to run.
    pub arguments: Vec<String>,
}

/// Kubernetes, as the user of the kubeconfig, or as the service account of the Pod that the server runs in.
pub struct Kubernetes {
    client: Client,
    namespace: String,
    template: Template,
    /// What was last seen of the Jobs that were asked for.
    last: Mutex<HashMap<String, Remembered>>,
}

#[derive(Clone, Debug, Default)]
struct Remembered {
    /// It was there, and had not ended. Kubernetes deletes no such Job by itself.
    unfinished: bool,
    said: String,
}

impl Kubernetes {
    /// Fails if the template is not fit for this, as far as the API server tells, or there is no configuration. The API
    /// server may be away.
    pub async fn new(options: KubernetesOptions) -> Result<Self, ClusterError> {
        let template = Template::read(&options.template, options.folder, options.files, options.arguments)?;
        let mut config = Config::infer().await.map_err(|error| {
            ClusterError::Refused(format!(
                "{error}; set KUBECONFIG to a kubeconfig, or run the server in a Pod that has a service account"
            ))
        })?;
        config.connect_timeout = Some(PATIENCE);
        config.read_timeout = Some(PATIENCE);
        config.write_timeout = Some(PATIENCE);
        config.reset_reader_on_write = true;
        // Its own would go on for minutes.
        config.default_retry = false;
        let namespace = options.namespace.unwrap_or_else(|| config.default_namespace.clone());
        let client = Client::try_from(config).map_err(|error| ClusterError::Refused(text(&error)))?;
        let kubernetes = Self { client, namespace, template, last: Mutex::default() };
        kubernetes.try_template().await?;
        Ok(kubernetes)
    }

    /// Asks the API server what it thinks of a Job of the template, which it does not make.
    async fn try_template(&self) -> Result<(), ClusterError> {
        let job =
            Candidate { id: Uuid::nil(), attempt: 1, name: "dry run".into(), sweep: None, estimate_s: None, deaths: 0 };
        let batch = Batch {
            name: job.name.clone(),
            comment: job.id.to_string(),
            estimate_s: 0.0,
            attempt: 1,
            deaths: 0,
            jobs: vec![job],
        };
        match self.create(&self.template.job(&batch, &batch.jobs[0]), true).await {
            Ok(()) => Ok(()),
            Err(Error::Api(status)) if [400, 422].contains(&status.code) => Err(ClusterError::Refused(format!(
                "--kubernetes-job: the API server does not take a Job of this template: {}",
                status.message
            ))),
            Err(Error::Api(status)) if status.code == 404 => Err(ClusterError::Refused(format!(
                "namespace {:?}: {}; make it, or name another with --kubernetes-namespace",
                self.namespace, status.message
            ))),
            Err(error) => {
                tracing::warn!(error = text(&error), "Kubernetes takes no Jobs now; jobs wait until it does");
                Ok(())
            }
        }
    }

    fn jobs(&self) -> Api<Job> {
        Api::namespaced(self.client.clone(), &self.namespace)
    }

    /// Makes a Job. Fields that the API server does not know are an error: it would drop them.
    async fn create(&self, job: &Value, dry_run: bool) -> Result<(), Error> {
        let path = Job::url_path(&(), Some(&self.namespace));
        let dry_run = if dry_run { "&dryRun=All" } else { "" };
        let uri = format!("{path}?fieldManager=gridfall&fieldValidation=Strict{dry_run}");
        let question = || {
            let request = Request::post(&uri).header(header::CONTENT_TYPE, "application/json");
            let request = request.body(job.to_string().into_bytes()).map_err(Error::HttpError)?;
            Ok(self.client.request::<Job>(request))
        };
        ask(question).await.map(drop)
    }

    /// Makes a Job, unless there is one of this attempt that has not ended.
    async fn offer(&self, name: &str, id: Uuid, job: &Value) -> Result<(), ClusterError> {
        match self.create(job, false).await {
            Err(Error::Api(status)) if status.code == 409 && status.reason != "Conflict" => {}
            made => return made.map_err(error),
        }
        let jobs = self.jobs();
        let there = ask(|| Ok(jobs.get_opt(name))).await.map_err(error)?;
        let Some(there) = there else {
            return Err(ClusterError::Refused(format!("Job {name} was deleted just now; it is tried again")));
        };
        let labels = there.metadata.labels.as_ref();
        let is_ours = labels.and_then(|labels| labels.get(JOB_LABEL)).is_some_and(|label| *label == id.to_string());
        if !is_ours {
            let namespace = &self.namespace;
            return Err(ClusterError::Refused(format!(
                "there is a Job {name} in the namespace {namespace} that is not Gridfall's; delete it"
            )));
        }
        if there.metadata.deletion_timestamp.is_none() && !finished(&there) {
            return Ok(());
        }
        // Its process ended before it had begun.
        let preconditions = Some(Preconditions { uid: there.metadata.uid.clone(), resource_version: None });
        self.delete(name, &DeleteParams { preconditions, ..DeleteParams::background() }).await.map_err(error)?;
        self.create(job, false).await.map_err(error)
    }

    /// Deletes a Job and what is of it, if it is there.
    async fn delete(&self, name: &str, parameters: &DeleteParams) -> Result<(), Error> {
        let jobs = self.jobs();
        match ask(|| Ok(jobs.delete(name, parameters))).await {
            Err(Error::Api(status)) if status.code == 404 => Ok(()),
            deleted => deleted.map(drop),
        }
    }

    /// All objects of a kind that are Gridfall's.
    async fn list<K>(&self) -> Result<Vec<K>, ClusterError>
    where
        K: Resource<Scope = NamespaceResourceScope, DynamicType = ()> + Clone + DeserializeOwned + std::fmt::Debug,
    {
        let api: Api<K> = Api::namespaced(self.client.clone(), &self.namespace);
        let mut parameters = ListParams::default().labels(OURS).limit(PAGE);
        let mut found = Vec::new();
        loop {
            let page: ObjectList<K> = match ask(|| Ok(api.list(&parameters))).await {
                Ok(page) => page,
                // The rest of the list has become too old.
                Err(Error::Api(status)) if status.code == 410 && parameters.continue_token.is_some() => {
                    parameters.continue_token = None;
                    found.clear();
                    continue;
                }
                Err(trouble) => return Err(error(trouble)),
            };
            found.extend(page.items);
            parameters.continue_token = page.metadata.continue_.filter(|token| !token.is_empty());
            if parameters.continue_token.is_none() {
                return Ok(found);
            }
        }
    }

    /// The newest Pod of each Job, where a Job does not tell enough by itself.
    async fn pods(&self, needed: bool) -> Result<HashMap<String, Pod>, ClusterError> {
        let mut pods: HashMap<String, Pod> = HashMap::new();
        let found = if needed { self.list::<Pod>().await? } else { Vec::new() };
        for pod in found {
            let owners = pod.metadata.owner_references.iter().flatten();
            let Some(job) = owners.filter(|owner| owner.kind == "Job").map(|owner| owner.name.clone()).next() else {
                continue;
            };
            let is_older = |other: &Pod| other.metadata.creation_timestamp <= pod.metadata.creation_timestamp;
            if pods.get(&job).is_none_or(is_older) {
                pods.insert(job, pod);
            }
        }
        Ok(pods)
    }
}

impl Cluster for Kubernetes {
    fn name(&self) -> &'static str {
        "Kubernetes"
    }

    fn largest_batch(&self) -> usize {
        1
    }

    fn submit<'a>(&'a self, batch: &'a Batch) -> Answer<'a, Vec<String>> {
        Box::pin(async move {
            let mut names = Vec::new();
            for candidate in &batch.jobs {
                let name = template::name(candidate);
                let job = self.template.job(batch, candidate);
                self.offer(&name, candidate.id, &job).await?;
                // Of one with the same name, before.
                self.last.lock().expect("nobody panics with it").remove(&name);
                names.push(name);
            }
            Ok(names)
        })
    }

    fn cancel<'a>(&'a self, jobs: &'a [String]) -> Answer<'a, ()> {
        Box::pin(async move {
            for job in jobs {
                self.delete(job, &DeleteParams::background()).await.map_err(error)?;
                if let Some(last) = self.last.lock().expect("nobody panics with it").get_mut(job) {
                    last.unfinished = false;
                }
            }
            Ok(())
        })
    }

    fn observe<'a>(&'a self, jobs: &'a [String]) -> Answer<'a, HashMap<String, Seen>> {
        Box::pin(async move {
            let listed = self.list::<Job>().await?;
            let listed: HashMap<String, Job> =
                listed.into_iter().filter_map(|job| Some((job.metadata.name.clone()?, job))).collect();
            let pods = self.pods(jobs.iter().filter_map(|job| listed.get(job)).any(states::needs_pod)).await?;
            let mut seen = HashMap::new();
            for (name, job) in &listed {
                let labels = job.metadata.labels.as_ref();
                let comment = labels.and_then(|labels| labels.get(JOB_LABEL)).cloned().unwrap_or_default();
                seen.insert(name.clone(), Seen { state: state(job, pods.get(name), Timestamp::now()), comment });
            }
            let mut last = self.last.lock().expect("nobody panics with it");
            let mut now = HashMap::new();
            for name in jobs {
                let before = last.remove(name).unwrap_or_default();
                let there = listed.get(name);
                if there.is_none() && before.unfinished {
                    // Somebody has deleted it.
                    seen.insert(name.clone(), Seen { state: State::Canceled, comment: String::new() });
                }
                let said = pods.get(name).and_then(states::last_words).unwrap_or(before.said);
                // Once it is told that it was deleted, it is told until the offer is settled.
                let unfinished = there.map_or(before.unfinished, |job| !finished(job));
                now.insert(name.clone(), Remembered { unfinished, said });
            }
            *last = now;
            Ok(seen)
        })
    }

    fn last_words(&self, job: &str) -> String {
        self.last.lock().expect("nobody panics with it").get(job).map(|last| last.said.clone()).unwrap_or_default()
    }

    fn forget(&self, _: &str) {
        // Kubernetes keeps it with the Pod.
    }
}

/// Puts a question, again where the API server has no time for it.
async fn ask<T, F>(mut question: impl FnMut() -> Result<F, Error>) -> Result<T, Error>
where
    F: Future<Output = Result<T, Error>>,
{
    let mut tries = 1;
    loop {
        let answer = timeout(PATIENCE, question()?).await.unwrap_or_else(|_| {
            Err(Error::Service(format!("the API server gave no answer within {} s", PATIENCE.as_secs()).into()))
        });
        match answer {
            Err(Error::Api(status)) if status.code == 429 && tries < TRIES => {
                let wait = status.details.map_or(0, |details| details.retry_after_seconds);
                sleep(Duration::from_secs(wait.clamp(1, LONGEST_WAIT_S).into())).await;
                tries += 1;
            }
            answer => return answer,
        }
    }
}

/// What is refused, is so for a reason of the Job's. All else concerns all of them.
fn error(error: Error) -> ClusterError {
    match &error {
        Error::Api(status) if [400, 403, 404, 409, 413, 422].contains(&status.code) => {
            ClusterError::Refused(text(&error))
        }
        _ => ClusterError::Away(text(&error)),
    }
}

fn text(error: &Error) -> String {
    match error {
        Error::Api(status) => {
            let what = if status.reason.is_empty() { "an error" } else { &status.reason };
            format!("the API server says {} ({what}): {}", status.code, status.message)
        }
        // What is wrong is said by the last cause.
        error => {
            let mut cause: &dyn std::error::Error = error;
            while let Some(source) = cause.source() {
                cause = source;
            }
            format!("the API server cannot be asked: {cause}")
        }
    }
}

#[cfg(test)]
mod tests;
