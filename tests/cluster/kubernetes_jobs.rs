//! The life of a job in Kubernetes: each state there means one thing for the job.

use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

use super::kubernetes::{self, Kubernetes};
use super::life::{half_way, log, long, signal, sweep_of_seven, undisturbed_long, with_checkpoint};
use super::support::{self, Server};
use super::work::{compare, scenes};
use super::{cluster_job, on_kubernetes, postgres, serve_alone, undisturbed};

fn start(cluster: &Kubernetes, dir: &tempfile::TempDir) -> Server {
    changed(cluster, dir, |job| job)
}

/// The same by another manifest.
fn changed(cluster: &Kubernetes, dir: &tempfile::TempDir, change: impl Fn(Value) -> Value) -> Server {
    on_kubernetes(cluster, &dir.path().join("data"), &postgres::shared().database(), &[], change)
}

/// Waits until Kubernetes has the job.
fn in_kubernetes(server: &Server, job: &str) -> String {
    cluster_job(&server.wait_until(job, "a Job in Kubernetes", |job| job["cluster_job"].is_string()))
}

/// Waits until the job's log says something.
fn told(server: &Server, job: &str, what: &str) {
    for _ in 0..600 {
        if log(server, job).contains(what) {
            return;
        }
        sleep(Duration::from_millis(50));
    }
    panic!("{what:?} is not in {}", log(server, job));
}

fn cancel(server: &Server, job: &str) {
    assert!([200, 202].contains(&server.call("POST", &format!("{job}/cancel"), &[], "").status));
    server.wait_for(job, "canceled");
}

#[test]
fn kubernetes_runs_a_job_and_can_tell_whose_it_is() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let expected = undisturbed(&dir.path().join("undisturbed"));
    let server = start(&cluster, &dir);
    let jobs: Vec<String> = scenes().into_iter().map(|scene| server.submit(scene)).collect();
    for (job, expected) in jobs.iter().zip(&expected) {
        let ended = server.wait_for(job, "succeeded");
        assert_eq!((&ended["attempt"], &ended["backend"]["kind"]), (&json!(1), &json!("cpu")));
        compare(&server, job, expected);
        let name = cluster_job(&ended);
        assert_eq!(name, format!("gridfall-{}-1", ended["id"].as_str().unwrap()));
        cluster.wait_for_end(&name, "Complete", "");
        let made = cluster.job(&name).unwrap();
        assert_eq!(made["metadata"]["labels"]["gridfall/job"], ended["id"]);
        assert_eq!(made["metadata"]["annotations"]["gridfall/name"], ended["name"]);
        assert_eq!(made["spec"]["template"]["spec"]["activeDeadlineSeconds"], 600);
        assert!(!made.to_string().contains("postgres://"), "{made:#}");
        assert!(log(&server, job).contains(&format!("attempt 1 was handed to Kubernetes as job {name}")));
    }
    let ready = server.get("/readyz");
    assert_eq!(ready.status, 200, "{}", String::from_utf8_lossy(&ready.body));
    let lists = cluster.state().lists.clone();
    let ours = |list: &String| list.ends_with(" app.kubernetes.io/managed-by=gridfall");
    assert!(lists.iter().all(ours), "{lists:?}");
}

#[test]
fn a_sweep_is_a_job_each_with_its_label() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    let path = sweep_of_seven(&server);
    let id = path.rsplit('/').next().unwrap();
    let submitted = cluster.state().submitted.clone();
    let of_sweep = submitted.iter().filter(|job| job["metadata"]["labels"]["gridfall/sweep"] == id);
    assert_eq!(of_sweep.count(), 7);
}

#[test]
fn a_job_that_is_canceled_here_leaves_kubernetes() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = changed(&cluster, &dir, two_devices);
    let (runs, waits) = (server.submit(support::endless()), server.submit(support::endless()));
    let running = cluster_job(&server.wait_for_frames(&runs, 1));
    let waiting = in_kubernetes(&server, &waits);
    told(
        &server,
        &waits,
        "it waits in Kubernetes: Unschedulable: 0/1 nodes are available: 1 Insufficient nvidia.com/gpu.",
    );
    for job in [&waits, &runs] {
        cancel(&server, job);
    }
    cluster.wait_until_gone(&waiting);
    cluster.wait_until(&running, "over", |job, pod| {
        job.is_none_or(|job| job["status"]["succeeded"] == 1)
            && pod.is_none_or(|pod| pod["status"]["phase"] != "Running")
    });
}

/// A job that takes all devices.
fn two_devices(mut job: Value) -> Value {
    job["spec"]["template"]["spec"]["containers"][0]["resources"]["limits"]["nvidia.com/gpu"] = 2.into();
    job
}

#[test]
fn a_job_that_is_deleted_in_kubernetes_is_canceled() {
    for propagation in ["background", "foreground"] {
        let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
        let server = changed(&cluster, &dir, two_devices);
        let (runs, waits) = (server.submit(support::endless()), server.submit(support::endless()));
        let running = cluster_job(&server.wait_for_frames(&runs, 1));
        let waiting = in_kubernetes(&server, &waits);
        told(&server, &waits, "Unschedulable");
        for job in [&waiting, &running] {
            cluster.ask(&["delete", "job", job, &format!("--cascade={propagation}"), "--wait=false"]);
        }
        for job in [&waits, &runs] {
            server.wait_for(job, "canceled");
            assert!(log(&server, job).contains("somebody canceled it there"), "{}", log(&server, job));
        }
        cluster.wait_until_gone(&running);
    }
}

#[test]
fn a_job_that_is_evicted_goes_on_from_where_it_was() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    let (job, expected) = half_way(&server);
    let first = cluster_job(&server.job(&job));
    cluster.evict(&first);
    let ended = server.wait_for(&job, "succeeded");
    assert_eq!(ended["attempt"], 2, "{}", log(&server, &job));
    let told = log(&server, &job);
    assert!(told.contains("is over: PodFailurePolicy") && told.contains("has condition DisruptionTarget"), "{told}");
    assert!(told.contains("runs after frame"), "{told}");
    cluster.wait_until_gone(&first);
    compare(&server, &job, expected);
}

#[test]
fn a_pod_that_is_deleted_costs_no_job() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    let (job, expected) = half_way(&server);
    let pod = cluster.state().pod_of(&cluster_job(&server.job(&job))).unwrap();
    cluster.ask(&["delete", "pod", &pod, "--wait=false"]);
    assert_eq!(server.wait_for(&job, "succeeded")["attempt"], 2);
    compare(&server, &job, expected);
}

#[test]
fn kueue_lets_a_job_wait_and_takes_its_place_back() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    cluster.state().suspends = true;
    let server = changed(&cluster, &dir, |mut job| {
        job["metadata"]["labels"]["kueue.x-k8s.io/queue-name"] = "gridfall".into();
        job
    });
    let job = server.submit(long());
    let first = in_kubernetes(&server, &job);
    told(&server, &job, "it waits in Kubernetes: the Job is suspended");
    cluster.suspend(&first, false);
    with_checkpoint(&server, &job);
    cluster.suspend(&first, true);
    server.wait_until(&job, "a second Job", |job| cluster_job(job) != first);
    cluster.wait_until_gone(&first);
    cluster.suspend(&cluster_job(&server.job(&job)), false);
    let ended = server.wait_for(&job, "succeeded");
    assert_eq!(ended["attempt"], 2, "{}", log(&server, &job));
    compare(&server, &job, undisturbed_long());
}

#[test]
fn a_process_that_has_lost_its_job_changes_nothing() {
    let (cluster, dir) = (kubernetes::shared(), tempfile::tempdir().unwrap());
    let (database, data_dir) = (postgres::shared().database(), dir.path().join("data"));
    let server = on_kubernetes(cluster, &data_dir, &database, &[], |job| job);
    let (job, expected) = half_way(&server);
    assert!(signal(&job, "-STOP"));
    server.terminate();
    let server = serve_alone(&data_dir, &["--database", &database]);
    server.wait_until(&job, "a second attempt", |job| job["attempt"] == 2);
    assert!(signal(&job, "-CONT"));
    server.wait_for(&job, "succeeded");
    told(&server, &job, "attempt 1: ended after the job was taken from it");
    compare(&server, &job, expected);
}

#[test]
fn a_process_that_hangs_is_ended_and_another_goes_on() {
    let (cluster, dir) = (kubernetes::shared(), tempfile::tempdir().unwrap());
    // A process that is stopped hears nothing until it is killed.
    let server = changed(cluster, &dir, |mut job| {
        job["spec"]["template"]["spec"]["terminationGracePeriodSeconds"] = 1.into();
        job
    });
    let job = server.submit(long());
    with_checkpoint(&server, &job);
    let first = cluster_job(&server.job(&job));
    assert!(signal(&job, "-STOP"));
    assert_eq!(server.wait_for(&job, "succeeded")["attempt"], 2);
    assert!(log(&server, &job).contains("nothing was heard of it for too long"), "{}", log(&server, &job));
    cluster.wait_until_gone(&first);
}

#[test]
fn a_node_that_dies_costs_no_job() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    let (job, expected) = half_way(&server);
    let first = cluster_job(&server.job(&job));
    cluster.kill_node();
    // Kubernetes takes minutes to give it up; the lease is over long before.
    server.wait_until(&job, "a second Job", |job| cluster_job(job) != first);
    cluster.start_node();
    let ended = server.wait_for(&job, "succeeded");
    assert_eq!(ended["attempt"], 2, "{}", log(&server, &job));
    cluster.wait_until_gone(&first);
    compare(&server, &job, expected);
}

#[test]
fn a_node_that_is_given_up_before_its_lease_is_over_costs_no_job() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = start(&cluster, &dir);
    let (job, expected) = half_way(&server);
    cluster.kill_node();
    cluster.give_up_node();
    cluster.start_node();
    let ended = server.wait_for(&job, "succeeded");
    assert_eq!(ended["attempt"], 2, "{}", log(&server, &job));
    assert!(log(&server, &job).contains("has condition DisruptionTarget"), "{}", log(&server, &job));
    compare(&server, &job, expected);
}

#[test]
fn an_attempt_whose_time_is_up_is_followed_by_another() {
    let (cluster, dir) = (kubernetes::shared(), tempfile::tempdir().unwrap());
    let server = changed(cluster, &dir, |mut job| {
        job["spec"]["template"]["spec"]["activeDeadlineSeconds"] = 2.into();
        job
    });
    let mut scene = long();
    scene["time"]["end"] = 12.0.into();
    let job = server.submit(scene);
    let ended = server.wait_for(&job, "succeeded");
    assert!(ended["attempt"].as_u64() > Some(1), "{ended:#}");
    assert!(log(&server, &job).contains("was not done when its time was up"), "{}", log(&server, &job));
}

#[test]
fn a_program_that_does_not_start_fails_the_job_with_what_it_said() {
    let (cluster, dir) = (kubernetes::shared(), tempfile::tempdir().unwrap());
    let server = changed(cluster, &dir, |mut job| {
        job["spec"]["template"]["spec"]["containers"][0]["command"] = json!(["/nowhere/gridfall"]);
        job
    });
    let job = server.submit(support::short());
    let ended = server.wait_for(&job, "failed");
    assert_eq!(ended["failure"]["code"], "crashed");
    let message = ended["failure"]["message"].as_str().unwrap();
    assert!(message.contains("ended as StartError (exit code 128)"), "{message}");
    assert!(message.contains("It said last") && message.contains("/nowhere/gridfall"), "{message}");
}

#[test]
fn a_job_whose_image_or_secret_is_missing_waits_and_says_why() {
    let (cluster, dir) = (kubernetes::shared(), tempfile::tempdir().unwrap());
    let image = changed(cluster, &dir, |mut job| {
        job["spec"]["template"]["spec"]["containers"][0]["image"] = "registry.example/gridfal:1".into();
        job
    });
    let job = image.submit(support::short());
    told(
        &image,
        &job,
        "it waits in Kubernetes: ImagePullBackOff: Back-off pulling image \"registry.example/gridfal:1\"",
    );
    cancel(&image, &job);
    let dir = tempfile::tempdir().unwrap();
    let secret = changed(cluster, &dir, |mut job| {
        let container = &mut job["spec"]["template"]["spec"]["containers"][0];
        container["env"][0]["valueFrom"]["secretKeyRef"]["name"] = "another".into();
        job
    });
    let job = secret.submit(support::short());
    told(&secret, &job, "it waits in Kubernetes: CreateContainerConfigError: secret \"another\" not found");
    cancel(&secret, &job);
    cluster.wait_until_gone(&cluster_job(&secret.job(&job)));
}

#[test]
fn the_database_may_be_away_for_a_while() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let mut database = postgres::Postgres::start();
    let server = on_kubernetes(&cluster, &dir.path().join("data"), &database.database(), &[], |job| job);
    let (job, expected) = half_way(&server);
    database.stop();
    sleep(Duration::from_secs(2));
    database.restart();
    server.wait_for(&job, "succeeded");
    compare(&server, &job, expected);
}
