//! What the conditions of a Job and its Pod mean for an attempt.

use k8s_openapi::api::batch::v1::{Job, JobCondition};
use k8s_openapi::api::core::v1::{ContainerStateTerminated, ContainerStatus, Pod, PodStatus};

use jiff::{SignedDuration, Timestamp};

use super::STOPPED;
use crate::jobs::cluster::State;

/// A Pod that ought to be gone for so long is on a node that does not answer.
const OVERDUE: SignedDuration = SignedDuration::from_secs(30);

/// Why the kubelet does not run a Pod, or no longer, where the program has no part in it. Pods that wanted more than
/// the node had left, or whose node shuts down, have no condition that says so.
const DISPLACED: [&str; 8] = [
    "NodeAffinity",
    "NodeLost",
    "NodeShutdown",
    "Preempting",
    "Shutdown",
    "Terminated",
    "UnexpectedAdmissionError",
    "AdmissionFailed",
];

fn condition<'a>(job: &'a Job, kind: &str) -> Option<&'a JobCondition> {
    let conditions = job.status.as_ref()?.conditions.as_ref()?;
    conditions.iter().find(|condition| condition.type_ == kind && condition.status == "True")
}

/// Whether a Job has ended.
pub fn finished(job: &Job) -> bool {
    condition(job, "Complete").is_some() || condition(job, "Failed").is_some()
}

/// Whether only the Pod tells what there is to know.
pub fn needs_pod(job: &Job) -> bool {
    condition(job, "Complete").is_none() && !is_ready(job)
}

fn is_ready(job: &Job) -> bool {
    let status = job.status.as_ref();
    status.and_then(|status| status.ready).unwrap_or(0) > 0 && condition(job, "Failed").is_none()
}

/// What became of a Job.
pub fn state(job: &Job, pod: Option<&Pod>, now: Timestamp) -> State {
    if condition(job, "Complete").is_some() {
        return State::Completed;
    }
    if let Some(failed) = condition(job, "Failed") {
        return ended(failed, pod);
    }
    if job.metadata.deletion_timestamp.is_some() {
        return State::Canceled;
    }
    // The time is that when it is to be gone.
    let gone_at = pod.and_then(|pod| pod.metadata.deletion_timestamp.as_ref());
    if gone_at.is_some_and(|at| now.duration_since(at.0) > OVERDUE) {
        return State::Displaced("its node does not answer any more".into());
    }
    let ends = job.status.as_ref().and_then(|status| status.terminating).unwrap_or(0) > 0;
    if is_ready(job) || ends || condition(job, "FailureTarget").or(condition(job, "SuccessCriteriaMet")).is_some() {
        return State::Alive;
    }
    let suspended = job.spec.as_ref().and_then(|spec| spec.suspend).unwrap_or(false);
    match pod {
        Some(pod) => of_pod(pod),
        None if suspended => {
            let message = condition(job, "Suspended").and_then(|condition| condition.message.clone());
            State::Waiting(said("the Job is suspended", message.as_deref().unwrap_or_default()))
        }
        None => State::Waiting("Kubernetes has made no Pod for it yet".into()),
    }
}

/// The state of a Job that has not ended, by its Pod.
fn of_pod(pod: &Pod) -> State {
    let status = pod.status.clone().unwrap_or_default();
    // It ends, or has ended, and the Job is about to say so.
    if pod.metadata.deletion_timestamp.is_some() || status.phase.as_deref() != Some("Pending") {
        return State::Alive;
    }
    let scheduled = status.conditions.iter().flatten().find(|condition| condition.type_ == "PodScheduled");
    let node = pod.spec.as_ref().and_then(|spec| spec.node_name.as_ref());
    if node.is_none() {
        let (reason, message) = scheduled.map(|c| (c.reason.clone(), c.message.clone())).unwrap_or_default();
        let reason = reason.unwrap_or_else(|| "it has no node yet".into());
        return State::Waiting(said(&reason, &message.unwrap_or_default()));
    }
    // What goes on in its containers may be seen late.
    let waiting = containers(&status).find_map(|container| container.state.as_ref()?.waiting.clone());
    let (reason, message) = waiting.map(|waiting| (waiting.reason, waiting.message)).unwrap_or_default();
    State::Starting(said(reason.as_deref().unwrap_or("ContainerCreating"), &message.unwrap_or_default()))
}

/// How a Job ended that has failed.
fn ended(failed: &JobCondition, pod: Option<&Pod>) -> State {
    let reason = failed.reason.as_deref().unwrap_or("Failed");
    let message = failed.message.as_deref().unwrap_or_default();
    match reason {
        "DeadlineExceeded" => return State::TimedOut,
        // There is one rule, for Pods that were disrupted.
        "PodFailurePolicy" => {
            let disrupted = pod.and_then(disruption);
            return State::Displaced(disrupted.unwrap_or_else(|| said(reason, message)));
        }
        _ => {}
    }
    let Some(pod) = pod else { return State::Failed(said(reason, message)) };
    let status = pod.status.clone().unwrap_or_default();
    let why = status.reason.as_deref().unwrap_or_default();
    let about = status.message.as_deref().unwrap_or_default();
    if why == "DeadlineExceeded" {
        return State::TimedOut;
    }
    if let Some(disrupted) = disruption(pod) {
        return State::Displaced(disrupted);
    }
    if DISPLACED.contains(&why) || why.starts_with("OutOf") {
        return State::Displaced(said(why, about));
    }
    match terminated(&status) {
        Some(end) if end.exit_code == i32::from(STOPPED) => State::Displaced("its process was told to stop".into()),
        // Evicted for what it took itself.
        _ if !why.is_empty() => State::Failed(said(why, about)),
        Some(end) => {
            let reason = end.reason.as_deref().unwrap_or("Error");
            State::Failed(format!("{reason} (exit code {})", end.exit_code))
        }
        None => State::Failed(said(reason, message)),
    }
}

/// Why a Pod lost its place.
fn disruption(pod: &Pod) -> Option<String> {
    let conditions = pod.status.as_ref()?.conditions.as_ref()?;
    let disrupted =
        conditions.iter().find(|condition| condition.type_ == "DisruptionTarget" && condition.status == "True")?;
    let reason = disrupted.reason.as_deref().unwrap_or("DisruptionTarget");
    Some(said(reason, disrupted.message.as_deref().unwrap_or_default()))
}

/// All containers of a Pod. Those that come first may keep it waiting.
fn containers(status: &PodStatus) -> impl Iterator<Item = &ContainerStatus> {
    let first = status.init_container_statuses.iter().flatten();
    first.chain(status.container_statuses.iter().flatten())
}

/// How the containers ended: that of the program, or one before it that failed.
fn terminated(status: &PodStatus) -> Option<ContainerStateTerminated> {
    let ended = |container: &ContainerStatus| container.state.as_ref()?.terminated.clone();
    let program = containers(status).find(|container| container.name == "gridfall").and_then(ended);
    program.or_else(|| containers(status).filter_map(ended).find(|end| end.exit_code != 0))
}

/// What the process of a Pod said last, once it has ended.
pub fn last_words(pod: &Pod) -> Option<String> {
    let end = terminated(pod.status.as_ref()?)?;
    Some(end.message?.trim().to_owned()).filter(|said| !said.is_empty())
}

fn said(reason: &str, message: &str) -> String {
    if message.is_empty() { reason.to_owned() } else { format!("{reason}: {message}") }
}
