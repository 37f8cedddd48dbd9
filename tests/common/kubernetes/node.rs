//! What the Job controller, the scheduler and the kubelet do, by the documentation.

use std::fs::File;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::{DEVICES, IMAGE, NAMESPACE, Process, State};

/// Bytes of a log that a Pod's status has.
const LAST_WORDS: usize = 2048;

fn now() -> String {
    after(0)
}

/// The time in so many seconds.
fn after(seconds: u64) -> String {
    let at = jiff::Timestamp::now() + Duration::from_secs(seconds);
    at.strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

fn is_true(object: &Value, kind: &str) -> bool {
    let conditions = object["status"]["conditions"].as_array().cloned().unwrap_or_default();
    conditions.iter().any(|condition| condition["type"] == kind && condition["status"] == "True")
}

fn set(object: &mut Value, kind: &str, status: &str, reason: &str, message: &str) {
    let condition = json!({ "type": kind, "status": status, "reason": reason, "message": message,
        "lastTransitionTime": now() });
    let conditions = &mut object["status"]["conditions"];
    if !conditions.is_array() {
        *conditions = json!([]);
    }
    let conditions = conditions.as_array_mut().unwrap();
    conditions.retain(|condition| condition["type"] != kind);
    conditions.push(condition);
}

fn has_ended(pod: &Value) -> bool {
    ["Succeeded", "Failed"].contains(&pod["status"]["phase"].as_str().unwrap_or_default())
}

fn devices(pod: &Value) -> i64 {
    let of = |container: &Value| {
        let device = &container["resources"]["limits"]["nvidia.com/gpu"];
        device.as_i64().or_else(|| device.as_str()?.parse().ok()).unwrap_or(0)
    };
    pod["spec"]["containers"].as_array().unwrap().iter().map(of).sum()
}

impl State {
    pub fn make_job(&mut self, mut job: Value) -> Value {
        self.made += 1;
        let name = job["metadata"]["name"].as_str().unwrap().to_owned();
        job["metadata"]["uid"] = format!("uid-{}", self.made).into();
        job["metadata"]["namespace"] = NAMESPACE.into();
        job["metadata"]["creationTimestamp"] = now().into();
        let queued = job["metadata"]["labels"].get("kueue.x-k8s.io/queue-name").is_some();
        if self.suspends && queued {
            job["spec"]["suspend"] = true.into();
        }
        job["status"] = json!({});
        self.jobs.insert(name, job.clone());
        job
    }

    /// The newest Pod of a Job.
    pub fn pod_of(&self, job: &str) -> Option<String> {
        let of = |pod: &&Value| pod["metadata"]["ownerReferences"][0]["name"] == job;
        let pods = self.pods.values().filter(of);
        let newest = pods.max_by_key(|pod| pod["metadata"]["uid"].as_str().unwrap().len())?;
        Some(newest["metadata"]["name"].as_str().unwrap().to_owned())
    }

    pub fn delete_job(&mut self, name: &str, foreground: bool) {
        let uid = self.jobs[name]["metadata"]["uid"].clone();
        if foreground {
            let metadata = &mut self.jobs.get_mut(name).unwrap()["metadata"];
            metadata["deletionTimestamp"] = now().into();
            metadata["finalizers"] = json!(["foregroundDeletion"]);
        } else {
            self.jobs.remove(name);
        }
        let of = |pod: &&Value| pod["metadata"]["ownerReferences"][0]["uid"] == uid;
        let pods: Vec<String> =
            self.pods.values().filter(of).map(|pod| pod["metadata"]["name"].as_str().unwrap().into()).collect();
        for pod in pods {
            self.delete_pod(&pod);
        }
    }

    pub fn delete_pod(&mut self, name: &str) {
        let pod = self.pods.get_mut(name).unwrap();
        let grace = pod["spec"]["terminationGracePeriodSeconds"].as_u64().unwrap_or(30);
        if pod["metadata"].get("deletionTimestamp").is_none() {
            pod["metadata"]["deletionTimestamp"] = after(grace).into();
        }
    }

    pub fn disrupt(&mut self, name: &str, reason: &str, message: &str) {
        let pod = self.pods.get_mut(name).unwrap();
        if !has_ended(pod) {
            set(pod, "DisruptionTarget", "True", reason, message);
            self.delete_pod(name);
        }
    }

    pub fn kill_node(&mut self) {
        self.node_down = true;
        for process in self.processes.values_mut() {
            let _ = process.child.kill();
            let _ = process.child.wait();
        }
        self.processes.clear();
    }

    /// The kubelet finds that what ran is gone.
    pub fn start_node(&mut self) {
        self.node_down = false;
    }

    pub fn tick(&mut self) {
        if self.asleep {
            return;
        }
        for name in self.jobs.keys().cloned().collect::<Vec<_>>() {
            self.control(&name);
        }
        for name in self.pods.keys().cloned().collect::<Vec<_>>() {
            self.schedule(&name);
            if !self.node_down {
                self.run(&name);
            }
            self.collect(&name);
        }
    }

    /// The Job controller.
    fn control(&mut self, name: &str) {
        let pod = self.pod_of(name).map(|pod| self.pods[&pod].clone());
        let of_this = |pod: &Value| pod["metadata"]["ownerReferences"][0]["uid"] == self.jobs[name]["metadata"]["uid"];
        let pod = pod.filter(of_this);
        let job = self.jobs.get_mut(name).unwrap();
        if is_true(job, "Complete") || is_true(job, "Failed") {
            if job["metadata"].get("deletionTimestamp").is_some() && pod.is_none() {
                self.jobs.remove(name);
            }
            return;
        }
        if job["metadata"].get("deletionTimestamp").is_some() {
            if pod.is_none() {
                self.jobs.remove(name);
            }
            return;
        }
        if job["spec"]["suspend"] == true {
            if !is_true(job, "Suspended") {
                set(job, "Suspended", "True", "JobSuspended", "Job suspended");
            }
            let ends = pod.is_some();
            job["status"]["active"] = 0.into();
            job["status"]["ready"] = 0.into();
            job["status"]["terminating"] = i64::from(ends).into();
            if let Some(pod) = pod {
                let pod = pod["metadata"]["name"].as_str().unwrap().to_owned();
                // It counts for nothing.
                self.pods.get_mut(&pod).unwrap()["metadata"]["finalizers"] = json!([]);
                self.delete_pod(&pod);
            }
            return;
        }
        if is_true(job, "Suspended") {
            set(job, "Suspended", "False", "JobResumed", "Job resumed");
        }
        let Some(pod) = pod else {
            if job["status"].get("startTime").is_some()
                && job["status"]["terminating"] == 0
                && job["status"]["active"] == 1
            {
                // Somebody has removed its Pod by force.
                job["status"]["active"] = 0.into();
                set(job, "Failed", "True", "BackoffLimitExceeded", "Job has reached the specified backoff limit");
                return;
            }
            job["status"]["startTime"] = now().into();
            job["status"]["active"] = 1.into();
            job["status"]["ready"] = 0.into();
            job["status"]["terminating"] = 0.into();
            return self.make_pod(name);
        };
        let is_leaving = pod["metadata"].get("deletionTimestamp").is_some();
        if !has_ended(&pod) {
            job["status"]["active"] = i64::from(!is_leaving).into();
            job["status"]["terminating"] = i64::from(is_leaving).into();
            job["status"]["ready"] = i64::from(!is_leaving && is_true(&pod, "Ready")).into();
            return;
        }
        for count in ["active", "ready", "terminating"] {
            job["status"][count] = 0.into();
        }
        if pod["status"]["phase"] == "Succeeded" {
            job["status"]["succeeded"] = 1.into();
            job["status"]["completionTime"] = now().into();
            set(job, "SuccessCriteriaMet", "True", "CompletionsReached", "Reached expected number of succeeded pods");
            set(job, "Complete", "True", "CompletionsReached", "Reached expected number of succeeded pods");
        } else {
            job["status"]["failed"] = 1.into();
            let (reason, message) = failure(job, &pod);
            set(job, "FailureTarget", "True", reason, &message);
            set(job, "Failed", "True", reason, &message);
        }
        let pod = pod["metadata"]["name"].as_str().unwrap();
        self.pods.get_mut(pod).unwrap()["metadata"]["finalizers"] = json!([]);
    }

    fn make_pod(&mut self, job: &str) {
        self.made += 1;
        let name = format!("{job}-{:05}", self.made);
        let of = &self.jobs[job];
        let template = of["spec"]["template"].clone();
        let mut metadata = template["metadata"].clone();
        metadata["name"] = name.as_str().into();
        metadata["namespace"] = NAMESPACE.into();
        metadata["uid"] = format!("{:0>9}", self.made).into();
        metadata["creationTimestamp"] = now().into();
        metadata["finalizers"] = json!(["batch.kubernetes.io/job-tracking"]);
        metadata["ownerReferences"] = json!([{ "apiVersion": "batch/v1", "kind": "Job", "name": job,
            "uid": of["metadata"]["uid"], "controller": true, "blockOwnerDeletion": true }]);
        let pod = json!({ "apiVersion": "v1", "kind": "Pod", "metadata": metadata, "spec": template["spec"],
            "status": { "phase": "Pending" } });
        self.pods.insert(name, pod);
    }

    /// The scheduler.
    fn schedule(&mut self, name: &str) {
        let on_node = |pod: &&Value| pod["spec"].get("nodeName").is_some() && !has_ended(pod);
        let taken: i64 = self.pods.values().filter(on_node).map(devices).sum();
        let node_down = self.node_down;
        let pod = self.pods.get_mut(name).unwrap();
        let leaves = pod["metadata"].get("deletionTimestamp").is_some();
        if pod["spec"].get("nodeName").is_some() || has_ended(pod) {
            return;
        }
        if leaves {
            // Nobody runs it, so the collector of Pods ends it.
            pod["status"]["phase"] = "Failed".into();
            return;
        }
        if node_down {
            let why = "0/1 nodes are available: 1 node(s) had untolerated taint {node.kubernetes.io/unreachable: }.";
            set(pod, "PodScheduled", "False", "Unschedulable", why);
        } else if taken + devices(pod) > DEVICES {
            let why = "0/1 nodes are available: 1 Insufficient nvidia.com/gpu.";
            set(pod, "PodScheduled", "False", "Unschedulable", why);
        } else {
            pod["spec"]["nodeName"] = "node".into();
            set(pod, "PodScheduled", "True", "", "");
        }
    }

    /// The kubelet.
    fn run(&mut self, name: &str) {
        let pod = self.pods.get_mut(name).unwrap();
        if pod["spec"].get("nodeName").is_none() || has_ended(pod) {
            return;
        }
        let leaves = pod["metadata"].get("deletionTimestamp").is_some();
        let Some(process) = self.processes.get_mut(name) else {
            if pod["status"]["phase"] == "Running" {
                // It was there, and the node was not.
                end(pod, 137, "Error", String::new());
                return;
            }
            if leaves {
                end(pod, 137, "Error", String::new());
                return;
            }
            return self.start(name);
        };
        if let Some(status) = process.child.try_wait().unwrap() {
            let log = std::fs::read(&process.log).unwrap_or_default();
            let log = String::from_utf8_lossy(&log[log.len().saturating_sub(LAST_WORDS)..]).into_owned();
            self.processes.remove(name);
            let code = status.code().unwrap_or_else(|| 128 + status.signal().unwrap_or(0));
            let is_killed = pod["metadata"]["annotations"]["test/oom"] == "yes";
            let reason = if code == 0 {
                "Completed"
            } else if is_killed {
                "OOMKilled"
            } else {
                "Error"
            };
            end(pod, code, reason, log);
            return;
        }
        let is_late = pod["spec"]["activeDeadlineSeconds"].as_i64().is_some_and(|seconds| {
            let started: jiff::Timestamp = pod["status"]["startTime"].as_str().unwrap().parse().unwrap();
            jiff::Timestamp::now().as_second() - started.as_second() >= seconds
        });
        if is_late {
            pod["status"]["reason"] = "DeadlineExceeded".into();
            pod["status"]["message"] = "Pod was active on the node longer than the specified deadline".into();
        }
        let pid = process.child.id() as i32;
        match process.told {
            Some((at, grace)) if at.elapsed() > grace => kill(pid, libc::SIGKILL),
            Some(_) => {}
            None if leaves || is_late => {
                kill(pid, libc::SIGTERM);
                let grace = pod["spec"]["terminationGracePeriodSeconds"].as_u64().unwrap_or(30);
                process.told = Some((Instant::now(), Duration::from_secs(grace)));
            }
            None => {}
        }
    }

    /// Pulls the image, and starts the container.
    fn start(&mut self, name: &str) {
        let log = self.dir.join(format!("{name}.log"));
        let pod = self.pods.get_mut(name).unwrap();
        let container = pod["spec"]["containers"].as_array().unwrap().iter().find(|c| c["name"] == "gridfall").unwrap();
        let container = container.clone();
        pod["status"]["startTime"] = now().into();
        let waits = |reason: &str, message: &str| {
            json!([{ "name": "gridfall", "image": container["image"], "imageID": "", "ready": false, "restartCount": 0,
                "state": { "waiting": { "reason": reason, "message": message } } }])
        };
        if container["image"] != IMAGE {
            let image = container["image"].as_str().unwrap();
            pod["status"]["containerStatuses"] =
                waits("ImagePullBackOff", &format!("Back-off pulling image {image:?}"));
            return;
        }
        let texts = |value: &Value| -> Vec<String> {
            value.as_array().into_iter().flatten().map(|text| text.as_str().unwrap().to_owned()).collect()
        };
        let mut line = texts(&container["command"]);
        if line.is_empty() {
            line.push(env!("CARGO_BIN_EXE_gridfall").into());
        }
        line.extend(texts(&container["args"]));
        let mut command = Command::new(&line[0]);
        // Its files are those of this machine.
        command.args(&line[1..]).env_clear().env("PATH", std::env::var_os("PATH").unwrap_or_default());
        // What a limit of processors makes programs see.
        if let Some(limit) = container["resources"]["limits"]["cpu"].as_str() {
            command.env("RAYON_NUM_THREADS", limit);
        }
        for variable in container["env"].as_array().into_iter().flatten() {
            let secret = &variable["valueFrom"]["secretKeyRef"];
            let value = match secret["name"].as_str() {
                Some(secret_name) => {
                    let key = (secret_name.to_owned(), secret["key"].as_str().unwrap().to_owned());
                    match self.secrets.get(&key) {
                        Some(value) => value.clone(),
                        None => {
                            let why = format!("secret {:?} not found", key.0);
                            pod["status"]["containerStatuses"] = waits("CreateContainerConfigError", &why);
                            return;
                        }
                    }
                }
                None => variable["value"].as_str().unwrap_or_default().to_owned(),
            };
            command.env(variable["name"].as_str().unwrap(), value);
        }
        let said = File::create(&log).unwrap();
        command.stdin(std::process::Stdio::null()).stdout(said.try_clone().unwrap()).stderr(said).process_group(0);
        match command.spawn() {
            Ok(child) => {
                self.processes.insert(name.into(), Process { child, log, told: None });
                pod["status"]["phase"] = "Running".into();
                pod["status"]["containerStatuses"] = json!([{ "name": "gridfall", "image": container["image"],
                    "imageID": "", "ready": true, "restartCount": 0, "state": { "running": { "startedAt": now() } } }]);
                set(pod, "Ready", "True", "", "");
            }
            Err(error) => {
                end(pod, 128, "StartError", format!("exec: {:?}: {error}", line[0]));
            }
        }
    }

    /// What is deleted goes once nobody holds it.
    fn collect(&mut self, name: &str) {
        let pod = &self.pods[name];
        let is_held = pod["metadata"]["finalizers"].as_array().is_some_and(|held| !held.is_empty());
        let owner = pod["metadata"]["ownerReferences"][0]["name"].as_str().unwrap();
        let uid = &pod["metadata"]["ownerReferences"][0]["uid"];
        let is_orphan = self
            .jobs
            .get(owner)
            .is_none_or(|job| job["metadata"]["uid"] != *uid || job["metadata"].get("deletionTimestamp").is_some());
        let is_over = has_ended(pod) || pod["spec"].get("nodeName").is_none();
        if pod["metadata"].get("deletionTimestamp").is_some() && is_over && (!is_held || is_orphan) {
            self.pods.remove(name);
        }
    }
}

/// By the Job's policy.
fn failure(job: &Value, pod: &Value) -> (&'static str, String) {
    let rules = job["spec"]["podFailurePolicy"]["rules"].as_array().cloned().unwrap_or_default();
    let name = pod["metadata"]["name"].as_str().unwrap();
    for (i, rule) in rules.iter().enumerate() {
        let kinds = rule["onPodConditions"].as_array().cloned().unwrap_or_default();
        if let Some(kind) = kinds.iter().find(|kind| is_true(pod, kind["type"].as_str().unwrap())) {
            assert_eq!(rule["action"], "FailJob");
            let kind = kind["type"].as_str().unwrap();
            let what = format!("Pod {NAMESPACE}/{name} has condition {kind} matching FailJob rule at index {i}");
            return ("PodFailurePolicy", what);
        }
    }
    ("BackoffLimitExceeded", "Job has reached the specified backoff limit".into())
}

/// A Pod whose container has ended.
fn end(pod: &mut Value, code: i32, reason: &str, said: String) {
    let is_late = pod["status"]["reason"] == "DeadlineExceeded";
    pod["status"]["phase"] = if code == 0 && !is_late { "Succeeded" } else { "Failed" }.into();
    let image = pod["spec"]["containers"][0]["image"].clone();
    let policy = &pod["spec"]["containers"][0]["terminationMessagePolicy"];
    let said = if code != 0 && policy == "FallbackToLogsOnError" { said } else { String::new() };
    let ended = json!({ "exitCode": code, "reason": reason, "message": said, "finishedAt": now() });
    pod["status"]["containerStatuses"] = json!([{ "name": "gridfall", "image": image, "imageID": "", "ready": false,
        "restartCount": 0, "state": { "terminated": ended } }]);
    set(pod, "Ready", "False", "PodCompleted", "");
}

fn kill(pid: i32, signal: i32) {
    // SAFETY: it only sends a signal to a child that has not been waited for.
    unsafe { libc::kill(pid, signal) };
}
