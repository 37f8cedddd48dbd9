//! The operator's Job, and what Gridfall writes into it.

use std::path::{Path, PathBuf};

use k8s_openapi::api::batch::v1::Job;
use serde_json::{Map, Value, json};

use super::STOPPED;
use crate::jobs::cluster::{Batch, ClusterError, printable};
use crate::store::Candidate;

/// Labels of a Job and its Pod. All that Gridfall lists has the first.
pub const MANAGED_BY: (&str, &str) = ("app.kubernetes.io/managed-by", "gridfall");
pub const JOB_LABEL: &str = "gridfall/job";
const ATTEMPT_LABEL: &str = "gridfall/attempt";
const SWEEP_LABEL: &str = "gridfall/sweep";
/// What the job is called, which may be what no label may be.
const NAME_ANNOTATION: &str = "gridfall/name";
/// The container that runs the program.
const CONTAINER: &str = "gridfall";
/// Where the address of the database is.
const DATABASE: &str = "GRIDFALL_DATABASE";
/// Where the object storage is. Its credentials are the operator's to give.
const FILES: &str = "GRIDFALL_FILES";
/// How long (s) an ended Job stays, to be looked at; at least so long, for the server to see how it ended.
const KEPT_S: u64 = 3600;
const LEAST_KEPT_S: u64 = 600;
/// How long (s) a process may take to save its state.
const GRACE_S: u64 = 60;

/// Fields that must be what Gridfall relies on, if they are there at all.
const FIXED: [(&str, &str, i64); 3] = [
    ("/spec/backoffLimit", "the next attempt is a Job of its own", 0),
    ("/spec/completions", "each job has a Job of its own", 1),
    ("/spec/parallelism", "each job has a Job of its own", 1),
];
/// Fields that are Gridfall's.
const OWN: [&str; 7] = [
    "/spec/backoffLimitPerIndex",
    "/spec/completionMode",
    "/spec/manualSelector",
    "/spec/podFailurePolicy",
    "/spec/selector",
    "/spec/successPolicy",
    "/metadata/generateName",
];

/// A Job without what differs from attempt to attempt.
#[derive(Clone, Debug)]
pub struct Template {
    job: Value,
    folder: PathBuf,
    files: Option<String>,
    arguments: Vec<String>,
}

/// The name of the Job of an attempt.
pub fn name(job: &Candidate) -> String {
    format!("gridfall-{}-{}", job.id, job.attempt)
}

/// A fault of the template: the field, what is wrong with it, and what to do.
fn fault(field: &str, what: &str, remedy: &str) -> ClusterError {
    let field = field.trim_start_matches('/').replace('/', ".");
    ClusterError::Refused(format!("--kubernetes-job: {field} {what}; {remedy}"))
}

impl Template {
    /// Reads a manifest and looks whether it can be a template.
    pub fn read(
        text: &str,
        folder: PathBuf,
        files: Option<String>,
        arguments: Vec<String>,
    ) -> Result<Self, ClusterError> {
        let job: Value = serde_saphyr::from_str(text).map_err(|error| {
            ClusterError::Refused(format!("--kubernetes-job is not the YAML of one Job: {error}; give one document"))
        })?;
        let template = Self { job, folder, files, arguments };
        template.check()?;
        Ok(template)
    }

    fn check(&self) -> Result<(), ClusterError> {
        let job = &self.job;
        if job["kind"] != "Job" || job["apiVersion"] != "batch/v1" {
            let what = format!("is {} of {}", job["kind"], job["apiVersion"]);
            return Err(fault("kind", &what, "write `apiVersion: batch/v1` and `kind: Job`"));
        }
        // Types, and names of enumerations.
        let typed: Result<Job, _> = serde_path_to_error::deserialize(job);
        typed.map_err(|error| {
            fault(&error.path().to_string(), &format!("is wrong: {}", error.inner()), "set it right")
        })?;
        if job.pointer("/metadata/namespace").is_some() {
            return Err(fault("/metadata/namespace", "is given", "leave it out; --kubernetes-namespace chooses it"));
        }
        for field in OWN {
            if job.pointer(field).is_some() {
                return Err(fault(field, "is given", "leave it out; Gridfall sets it"));
            }
        }
        for (field, why, value) in FIXED {
            if let Some(given) = job.pointer(field)
                && *given != value
            {
                return Err(fault(field, &format!("is {given}"), &format!("leave it out; it is {value}, for {why}")));
            }
        }
        if job.pointer("/spec/activeDeadlineSeconds").is_some() {
            let remedy = "give spec.template.spec.activeDeadlineSeconds, or leave it out";
            return Err(fault("/spec/activeDeadlineSeconds", "counts the time that a job waits, too", remedy));
        }
        let ttl = job.pointer("/spec/ttlSecondsAfterFinished").and_then(Value::as_u64);
        if let Some(ttl) = ttl.filter(|&ttl| ttl < LEAST_KEPT_S) {
            let remedy = format!("give at least {LEAST_KEPT_S}: the server has to see how a Job ended");
            return Err(fault("/spec/ttlSecondsAfterFinished", &format!("is {ttl}"), &remedy));
        }
        let pod = job.pointer("/spec/template/spec").cloned().unwrap_or_default();
        if let Some(policy) = pod.get("restartPolicy").filter(|&policy| policy != "Never") {
            let remedy = "leave it out; it is Never, for the next attempt is a Job of its own";
            return Err(fault("/spec/template/spec/restartPolicy", &format!("is {policy}"), remedy));
        }
        self.check_container(&pod)
    }

    fn check_container(&self, pod: &Value) -> Result<(), ClusterError> {
        let containers = pod["containers"].as_array().map(Vec::as_slice).unwrap_or_default();
        let Some(at) = containers.iter().position(|container| container["name"] == CONTAINER) else {
            let remedy = "give one, whose image has Gridfall";
            return Err(fault("/spec/template/spec/containers", "has none that is named gridfall", remedy));
        };
        let container = &containers[at];
        let field = |name: &str| format!("/spec/template/spec/containers[{at}]/{name}");
        if container["image"].as_str().is_none_or(str::is_empty) {
            return Err(fault(&field("image"), "is missing", "name an image that has Gridfall"));
        }
        if container.get("args").is_some() {
            return Err(fault(&field("args"), "is given", "leave it out; Gridfall says what to run"));
        }
        let variables = container["env"].as_array().map(Vec::as_slice).unwrap_or_default();
        let by_secret = "take it from a Secret: valueFrom.secretKeyRef, or envFrom.secretRef";
        match variables.iter().find(|variable| variable["name"] == DATABASE) {
            Some(variable) if variable.pointer("/valueFrom/secretKeyRef").is_none() => {
                let what = format!("has {DATABASE}, which all can read who may list Jobs");
                return Err(fault(&field("env"), &what, by_secret));
            }
            Some(_) => {}
            None => {
                let sources = container["envFrom"].as_array().map(Vec::as_slice).unwrap_or_default();
                if !sources.iter().any(|source| source.get("secretRef").is_some()) {
                    return Err(fault(&field("env"), &format!("has no {DATABASE}"), by_secret));
                }
            }
        }
        let mounts = container["volumeMounts"].as_array().map(Vec::as_slice).unwrap_or_default();
        let mut paths = mounts.iter().filter_map(|mount| mount["mountPath"].as_str());
        // A folder of a container's own may be in its image.
        if self.files.is_none() && !paths.any(|path| self.folder.starts_with(Path::new(path))) {
            let what = format!("holds no data directory {}", self.folder.display());
            return Err(fault(
                &field("volumeMounts"),
                &what,
                "mount the volume of the server there, under the same path",
            ));
        }
        Ok(())
    }

    /// The Job of an attempt.
    pub fn job(&self, batch: &Batch, candidate: &Candidate) -> Value {
        let mut job = self.job.clone();
        let id = candidate.id.to_string();
        let mut labels = vec![
            (MANAGED_BY.0, MANAGED_BY.1.to_owned()),
            (JOB_LABEL, id.clone()),
            (ATTEMPT_LABEL, candidate.attempt.to_string()),
        ];
        labels.extend(candidate.sweep.as_ref().map(|(sweep, _)| (SWEEP_LABEL, sweep.to_string())));
        let metadata = object(&mut job["metadata"]);
        metadata.insert("name".into(), name(candidate).into());
        describe(metadata, &labels, &candidate.name);
        let spec = object(&mut job["spec"]);
        spec.insert("backoffLimit".into(), 0.into());
        spec.entry("ttlSecondsAfterFinished").or_insert(KEPT_S.into());
        // What a node or an eviction does to a Pod is no failure of the program.
        spec.insert(
            "podFailurePolicy".into(),
            json!({ "rules": [
                { "action": "FailJob", "onPodConditions": [{ "type": "DisruptionTarget", "status": "True" }] },
            ] }),
        );
        let template = object(&mut spec["template"]);
        describe(object(template.entry("metadata").or_insert_with(|| json!({}))), &labels, &candidate.name);
        let pod = object(&mut template["spec"]);
        pod.insert("restartPolicy".into(), "Never".into());
        pod.entry("activeDeadlineSeconds").or_insert((batch.minutes() * 60).into());
        pod.entry("terminationGracePeriodSeconds").or_insert(GRACE_S.into());
        // The program does not talk to Kubernetes.
        pod.entry("automountServiceAccountToken").or_insert(false.into());
        let containers = pod.get_mut("containers").and_then(Value::as_array_mut).into_iter().flatten();
        for container in containers.filter(|container| container["name"] == CONTAINER).map(object) {
            container.insert("args".into(), self.arguments(candidate).into());
            if let Some(files) = &self.files {
                let variables = container.entry("env").or_insert_with(|| json!([]));
                if let Some(variables) = variables.as_array_mut() {
                    variables.retain(|variable| variable["name"] != FILES);
                    variables.push(json!({ "name": FILES, "value": files }));
                }
            }
            // A Pod's status then tells what its process said last.
            container.entry("terminationMessagePolicy").or_insert("FallbackToLogsOnError".into());
        }
        job
    }

    fn arguments(&self, candidate: &Candidate) -> Vec<String> {
        let mut arguments = vec!["worker".into()];
        arguments.extend(self.arguments.iter().cloned());
        let mut give = |option: &str, value: String| arguments.extend([option.to_owned(), value]);
        give("--data-dir", self.folder.to_string_lossy().into_owned());
        give("--stopped-code", STOPPED.to_string());
        give("--attempt", candidate.attempt.to_string());
        give("--job", candidate.id.to_string());
        give("--cluster-job", name(candidate));
        arguments
    }
}

/// Labels and annotations, beside those of the operator's.
fn describe(metadata: &mut Map<String, Value>, labels: &[(&str, String)], name: &str) {
    let all = object(metadata.entry("labels").or_insert_with(|| json!({})));
    all.extend(labels.iter().map(|(label, value)| ((*label).to_owned(), value.as_str().into())));
    let annotations = object(metadata.entry("annotations").or_insert_with(|| json!({})));
    annotations.insert(NAME_ANNOTATION.into(), printable(name).into());
}

/// An object, made where nothing is.
fn object(value: &mut Value) -> &mut Map<String, Value> {
    if !value.is_object() {
        *value = json!({});
    }
    value.as_object_mut().expect("it is one")
}
