//! What templates must have, what Jobs are made of them, and what becomes of those.

use k8s_openapi::api::batch::v1::Job;
use k8s_openapi::api::core::v1::Pod;
use serde_json::{Value, json};
use uuid::Uuid;

use super::states::{last_words, needs_pod, state};
use super::template::{Template, name};
use crate::jobs::cluster::{Batch, State};
use crate::store::Candidate;

const DEPLOYED: &str = include_str!("../../../../../deploy/kubernetes/job.yaml");

fn template(text: &str) -> Result<Template, String> {
    let arguments = vec!["--backend".into(), "gpu".into()];
    Template::read(text, "/data/gridfall".into(), None, arguments).map_err(|error| error.to_string())
}

fn batch(deaths: i64, estimate_s: f64) -> Batch {
    let job = Candidate {
        id: Uuid::from_u128(1),
        attempt: 3,
        name: "a|b\nc".into(),
        sweep: Some((Uuid::from_u128(2), "s".into())),
        estimate_s: None,
        deaths,
    };
    let comment = job.id.to_string();
    Batch { name: job.name.clone(), comment, estimate_s, attempt: 3, deaths, jobs: vec![job] }
}

#[test]
fn a_job_is_the_template_and_what_is_gridfalls() {
    let batch = batch(1, 3600.0);
    let job = template(DEPLOYED).unwrap().job(&batch, &batch.jobs[0]);
    let id = Uuid::from_u128(1).to_string();
    assert_eq!(job["metadata"]["name"], format!("gridfall-{id}-3"));
    assert_eq!(name(&batch.jobs[0]), format!("gridfall-{id}-3"));
    let labels = json!({ "app.kubernetes.io/name": "gridfall", "app.kubernetes.io/managed-by": "gridfall",
        "gridfall/job": id, "gridfall/attempt": "3", "gridfall/sweep": Uuid::from_u128(2).to_string() });
    assert_eq!(job["metadata"]["labels"], labels);
    assert_eq!(job["spec"]["template"]["metadata"]["labels"], labels, "Pods are listed by them, too");
    assert_eq!(job["metadata"]["annotations"], json!({ "gridfall/name": "abc" }));
    let pod = &job["spec"]["template"]["spec"];
    let set = (&job["spec"]["backoffLimit"], &pod["restartPolicy"], &pod["terminationGracePeriodSeconds"]);
    assert_eq!(set, (&json!(0), &json!("Never"), &json!(60)));
    assert_eq!(pod["activeDeadlineSeconds"], 2 * 4 * 3600);
    assert_eq!(pod["automountServiceAccountToken"], false);
    let rules = json!([{ "action": "FailJob", "onPodConditions": [{ "type": "DisruptionTarget", "status": "True" }] }]);
    assert_eq!(job["spec"]["podFailurePolicy"]["rules"], rules);
    let container = &pod["containers"][0];
    assert_eq!(container["terminationMessagePolicy"], "FallbackToLogsOnError");
    let arguments: Vec<&str> = container["args"].as_array().unwrap().iter().map(|a| a.as_str().unwrap()).collect();
    let line = format!(
        "worker --backend gpu --data-dir /data/gridfall --stopped-code 75 --attempt 3 --job {id} --cluster-job \
         gridfall-{id}-3"
    );
    assert_eq!(arguments.join(" "), line);
    // What is the operator's stays.
    assert_eq!(container["resources"]["limits"]["nvidia.com/gpu"], 1);
    let mut own: Value = serde_saphyr::from_str(DEPLOYED).unwrap();
    own["spec"]["template"]["spec"]["activeDeadlineSeconds"] = 99.into();
    own["spec"]["ttlSecondsAfterFinished"] = 700.into();
    let job = template(&own.to_string()).unwrap().job(&batch, &batch.jobs[0]);
    assert_eq!(job["spec"]["template"]["spec"]["activeDeadlineSeconds"], 99);
    assert_eq!(job["spec"]["ttlSecondsAfterFinished"], 700);
}

/// The template with other values; `null` takes one away.
fn with(changes: &[(&str, Value)]) -> String {
    let mut job: Value = serde_saphyr::from_str(DEPLOYED).unwrap();
    for (path, value) in changes {
        let (parent, field) = path.rsplit_once('/').unwrap();
        let parent = job.pointer_mut(parent).unwrap().as_object_mut().unwrap();
        match value {
            Value::Null => parent.remove(field),
            value => parent.insert(field.to_owned(), value.clone()),
        };
    }
    template(&job.to_string()).unwrap_err()
}

#[test]
fn a_template_that_cannot_be_used_is_told_by_field_fault_and_remedy() {
    const POD: &str = "/spec/template/spec";
    const CONTAINER: &str = "/spec/template/spec/containers/0";
    let at = |field: &str| format!("{CONTAINER}/{field}");
    let cases = [
        ("/kind".into(), json!("Pod"), "kind is \"Pod\" of \"batch/v1\"; write"),
        ("/apiVersion".into(), json!("batch/v2"), "kind is \"Job\" of \"batch/v2\"; write"),
        ("/metadata/namespace".into(), json!("a"), "metadata.namespace is given; leave it out; --kubernetes-namespace"),
        ("/spec/podFailurePolicy".into(), json!({ "rules": [] }), "spec.podFailurePolicy is given; leave it out"),
        ("/spec/backoffLimit".into(), json!(6), "spec.backoffLimit is 6; leave it out; it is 0"),
        ("/spec/parallelism".into(), json!(2), "spec.parallelism is 2; leave it out; it is 1"),
        ("/spec/activeDeadlineSeconds".into(), json!(60), "counts the time that a job waits, too; give spec.template"),
        ("/spec/ttlSecondsAfterFinished".into(), json!(5), "spec.ttlSecondsAfterFinished is 5; give at least 600"),
        ("/spec/ttlSecondsAfterFinished".into(), json!("1d"), "spec.ttlSecondsAfterFinished is wrong: invalid type"),
        (
            format!("{POD}/restartPolicy"),
            json!("OnFailure"),
            "restartPolicy is \"OnFailure\"; leave it out; it is Never",
        ),
        (at("name"), json!("other"), "spec.template.spec.containers has none that is named gridfall; give one"),
        (at("image"), Value::Null, "spec.template.spec.containers[0].image is missing; name an image"),
        (at("args"), json!(["serve"]), "spec.template.spec.containers[0].args is given; leave it out"),
        (at("env"), Value::Null, "containers[0].env has no GRIDFALL_DATABASE; take it from a Secret"),
        (
            at("env"),
            json!([{ "name": "GRIDFALL_DATABASE", "value": "postgres://a:b@c/d" }]),
            "containers[0].env has GRIDFALL_DATABASE, which all can read who may list Jobs; take it from a Secret",
        ),
        (at("volumeMounts"), Value::Null, "volumeMounts holds no data directory /data/gridfall; mount the volume"),
        (
            at("volumeMounts"),
            json!([{ "name": "data", "mountPath": "/data/grid" }]),
            "volumeMounts holds no data directory /data/gridfall",
        ),
    ];
    for (path, value, expected) in cases {
        let said = with(&[(&path, value)]);
        assert!(said.starts_with("--kubernetes-job: ") && said.contains(expected), "{path}: {said}");
    }
    assert!(template("a: [").unwrap_err().contains("is not the YAML of one Job"));
    assert!(template(&format!("{DEPLOYED}---\n{DEPLOYED}")).unwrap_err().contains("give one document"));
}

#[test]
fn a_secret_as_a_whole_will_do() {
    let mut job: Value = serde_saphyr::from_str(DEPLOYED).unwrap();
    let container = &mut job["spec"]["template"]["spec"]["containers"][0];
    container.as_object_mut().unwrap().remove("env");
    container["envFrom"] = json!([{ "secretRef": { "name": "gridfall" } }]);
    template(&job.to_string()).unwrap();
}

#[test]
fn with_an_object_storage_no_volume_is_needed() {
    let mut job: Value = serde_saphyr::from_str(DEPLOYED).unwrap();
    let container = &mut job["spec"]["template"]["spec"]["containers"][0];
    container.as_object_mut().unwrap().remove("volumeMounts");
    let files = Some("s3://simulations/gridfall".to_owned());
    let template = Template::read(&job.to_string(), "/tmp".into(), files, Vec::new()).unwrap();
    let batch = batch(0, 0.0);
    let job = template.job(&batch, &batch.jobs[0]);
    let container = &job["spec"]["template"]["spec"]["containers"][0];
    let file = json!({ "name": "GRIDFALL_FILES", "value": "s3://simulations/gridfall" });
    assert_eq!((&container["env"][1], &container["args"][2]), (&file, &json!("/tmp")));
    assert_eq!(container["env"][0]["name"], "GRIDFALL_DATABASE");
}

fn job(spec: Value, status: Value) -> Job {
    let mut whole = json!({ "apiVersion": "batch/v1", "kind": "Job", "metadata": {}, "spec": { "template": {} } });
    whole["spec"].as_object_mut().unwrap().extend(spec.as_object().unwrap().clone());
    whole["status"] = status;
    serde_json::from_value(whole).unwrap()
}

fn pod(status: Value, node: Option<&str>) -> Pod {
    let spec = json!({ "containers": [], "nodeName": node });
    let whole = json!({ "apiVersion": "v1", "kind": "Pod", "metadata": {}, "spec": spec, "status": status });
    serde_json::from_value(whole).unwrap()
}

fn is(kind: &str, reason: &str, message: &str) -> Value {
    json!([{ "type": kind, "status": "True", "reason": reason, "message": message }])
}

fn seen(job: &Job, pod: Option<&Pod>) -> State {
    state(job, pod, "2026-01-01T00:01:00Z".parse().unwrap())
}

#[test]
fn a_job_that_has_not_ended_waits_or_runs() {
    let fresh = job(json!({}), json!({}));
    assert_eq!(seen(&fresh, None), State::Waiting("Kubernetes has made no Pod for it yet".into()));
    let suspended =
        job(json!({ "suspend": true }), json!({ "conditions": is("Suspended", "JobSuspended", "Job suspended") }));
    assert_eq!(seen(&suspended, None), State::Waiting("the Job is suspended: Job suspended".into()));
    let running = pod(json!({ "phase": "Running" }), Some("n"));
    assert_eq!(seen(&suspended, Some(&running)), State::Alive, "it may still save its state");
    let ready = job(json!({}), json!({ "active": 1, "ready": 1 }));
    assert_eq!((seen(&ready, None), needs_pod(&ready)), (State::Alive, false));
    let active = job(json!({}), json!({ "active": 1, "ready": 0 }));
    assert!(needs_pod(&active));
    let no_room =
        json!([{ "type": "PodScheduled", "status": "False", "reason": "Unschedulable", "message": "0/9 nodes" }]);
    let no_room = pod(json!({ "phase": "Pending", "conditions": no_room }), None);
    assert_eq!(seen(&active, Some(&no_room)), State::Waiting("Unschedulable: 0/9 nodes".into()));
    let waiting = |reason: &str| {
        let container = json!({ "name": "gridfall", "image": "", "imageID": "", "ready": false, "restartCount": 0,
            "state": { "waiting": { "reason": reason, "message": "why" } } });
        pod(json!({ "phase": "Pending", "containerStatuses": [container] }), Some("n"))
    };
    for reason in ["ImagePullBackOff", "ErrImagePull", "ContainerCreating", "CreateContainerConfigError"] {
        let expected = State::Starting(format!("{reason}: why"));
        assert_eq!(seen(&active, Some(&waiting(reason))), expected, "its process may have begun by now");
    }
    assert_eq!(
        seen(&active, Some(&pod(json!({ "phase": "Pending" }), Some("n")))),
        State::Starting("ContainerCreating".into())
    );
    for phase in ["Running", "Succeeded", "Failed", "Unknown"] {
        assert_eq!(seen(&active, Some(&pod(json!({ "phase": phase }), Some("n")))), State::Alive);
    }
    let ends = job(json!({}), json!({ "terminating": 1 }));
    assert_eq!(seen(&ends, None), State::Alive);
    let target = job(json!({}), json!({ "conditions": is("FailureTarget", "BackoffLimitExceeded", "") }));
    assert_eq!(seen(&target, None), State::Alive);
}

#[test]
fn what_is_deleted_is_canceled_or_lost() {
    let mut deleted = job(json!({}), json!({ "active": 1, "ready": 1 }));
    deleted.metadata.deletion_timestamp = serde_json::from_value(json!("2026-01-01T00:00:00Z")).unwrap();
    assert_eq!(seen(&deleted, None), State::Canceled);
    // Of a node that does not answer.
    let ends = job(json!({}), json!({ "terminating": 1 }));
    let mut lost = pod(json!({ "phase": "Running" }), Some("n"));
    lost.metadata.deletion_timestamp = serde_json::from_value(json!("2026-01-01T00:00:40Z")).unwrap();
    assert_eq!(seen(&ends, Some(&lost)), State::Alive);
    lost.metadata.deletion_timestamp = serde_json::from_value(json!("2026-01-01T00:00:20Z")).unwrap();
    assert!(matches!(seen(&ends, Some(&lost)), State::Displaced(_)));
}

#[test]
fn a_job_ends_by_its_reason() {
    assert_eq!(seen(&job(json!({}), json!({ "conditions": is("Complete", "", "") })), None), State::Completed);
    let failed = |reason: &str| job(json!({}), json!({ "conditions": is("Failed", reason, "m") }));
    assert_eq!(seen(&failed("DeadlineExceeded"), None), State::TimedOut);
    assert_eq!(seen(&failed("PodFailurePolicy"), None), State::Displaced("PodFailurePolicy: m".into()));
    let evicted = pod(
        json!({ "phase": "Failed", "conditions": is("DisruptionTarget", "PreemptionByScheduler", "p") }),
        Some("n"),
    );
    assert_eq!(seen(&failed("PodFailurePolicy"), Some(&evicted)), State::Displaced("PreemptionByScheduler: p".into()));
    let limit = failed("BackoffLimitExceeded");
    assert!(needs_pod(&limit));
    assert_eq!(seen(&limit, None), State::Failed("BackoffLimitExceeded: m".into()));
    assert_eq!(seen(&limit, Some(&evicted)), State::Displaced("PreemptionByScheduler: p".into()));
    let of_pod = |status: Value| seen(&limit, Some(&pod(status, Some("n"))));
    assert_eq!(of_pod(json!({ "phase": "Failed", "reason": "DeadlineExceeded" })), State::TimedOut);
    for reason in ["UnexpectedAdmissionError", "OutOfnvidia.com/gpu", "NodeShutdown", "NodeAffinity", "NodeLost"] {
        let status = json!({ "phase": "Failed", "reason": reason, "message": "m" });
        assert_eq!(of_pod(status), State::Displaced(format!("{reason}: m")));
    }
    let too_much = json!({ "phase": "Failed", "reason": "Evicted", "message": "ephemeral storage" });
    assert_eq!(of_pod(too_much), State::Failed("Evicted: ephemeral storage".into()), "that was its own");
    let ended = |code: i32, reason: &str| {
        let end = json!({ "terminated": { "exitCode": code, "reason": reason, "message": "last words\n" } });
        let container = json!({ "name": "gridfall", "image": "", "imageID": "", "ready": false, "restartCount": 0,
            "state": end });
        json!({ "phase": "Failed", "containerStatuses": [container] })
    };
    assert_eq!(of_pod(ended(137, "OOMKilled")), State::Failed("OOMKilled (exit code 137)".into()));
    assert_eq!(of_pod(ended(1, "Error")), State::Failed("Error (exit code 1)".into()));
    assert_eq!(of_pod(ended(75, "Error")), State::Displaced("its process was told to stop".into()));
    assert_eq!(last_words(&pod(ended(1, "Error"), None)).as_deref(), Some("last words"));
    let first = json!({ "phase": "Failed", "initContainerStatuses": [{ "name": "wait", "image": "", "imageID": "",
        "ready": false, "restartCount": 0, "state": { "terminated": { "exitCode": 2, "reason": "Error" } } }] });
    assert_eq!(of_pod(first), State::Failed("Error (exit code 2)".into()));
}
