//! The manifests that users are given, and the Jobs that the server makes of them, against the published schemas.

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::guide::{self, ROOT};
use super::kubernetes::Kubernetes;
use super::{job_manifest, on_kubernetes, postgres, support};

/// The oldest version that Kubernetes' makers support, and the newest that the validator knows.
const VERSIONS: [&str; 2] = ["1.33", "1.37"];

/// Documents that their schemas allow, without fields that they do not have. Returns how many were looked at.
fn validate(file: &Path) -> usize {
    let interpreter = std::env::var("GRIDFALL_PYTHON").unwrap_or("python3".into());
    let mut looked = 0;
    for version in VERSIONS {
        let ran = Command::new(&interpreter)
            .args([concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/validate_manifests.py"), version])
            .arg(file)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&ran.stdout);
        assert!(ran.status.success(), "{}: {said}{}", file.display(), String::from_utf8_lossy(&ran.stderr));
        looked = said.trim().parse().unwrap();
    }
    looked
}

/// The folder of the manifests.
fn folder() -> std::path::PathBuf {
    Path::new(ROOT).join("deploy/kubernetes")
}

#[test]
fn the_manifests_are_valid() {
    let counts = [("data", 1), ("job", 1), ("namespace", 1), ("rights", 3), ("secret.example", 1), ("server", 2)];
    for (name, count) in counts {
        assert_eq!(validate(&folder().join(format!("{name}.yaml"))), count, "{name}");
    }
    // Kueue's and kustomize's own kinds have no published schema there.
    let unchecked = ["kueue.yaml", "kustomization.yaml"];
    let files: Vec<String> =
        fs::read_dir(folder()).unwrap().map(|file| file.unwrap().file_name().into_string().unwrap()).collect();
    let known =
        |file: &String| unchecked.contains(&&**file) || counts.iter().any(|(name, _)| *file == format!("{name}.yaml"));
    assert!(files.iter().all(known), "{files:?}");
}

#[test]
fn a_fault_in_a_manifest_is_found() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("job.yaml");
    let text = fs::read_to_string(folder().join("job.yaml")).unwrap();
    for (right, wrong) in [("mountPath", "mountpath"), ("ttlSecondsAfterFinished: 3600", "ttlSecondsAfterFinished: 1d")]
    {
        assert!(text.contains(right));
        fs::write(&file, text.replace(right, wrong)).unwrap();
        assert!(std::panic::catch_unwind(|| validate(&file)).is_err(), "{wrong}");
    }
}

#[test]
fn kustomize_puts_them_together() {
    let built = Command::new("kubectl").arg("kustomize").arg(folder()).output().unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("all.yaml");
    fs::write(&file, &built.stdout).unwrap();
    assert_eq!(validate(&file), 8);
    let all: Vec<Value> = serde_saphyr::from_multiple(&String::from_utf8(built.stdout).unwrap()).unwrap();
    let named = |kind: &str| all.iter().find(|one| one["kind"] == kind).unwrap_or_else(|| panic!("{kind}"));
    // The server reads the template, and the rights are those of the account that it has.
    let pod = &named("Deployment")["spec"]["template"]["spec"];
    let map = named("ConfigMap");
    let volumes = pod["volumes"].as_array().unwrap();
    assert!(volumes.iter().any(|volume| volume["configMap"]["name"] == map["metadata"]["name"]), "{volumes:?}");
    assert_eq!(map["data"]["job.yaml"], fs::read_to_string(folder().join("job.yaml")).unwrap());
    assert_eq!(pod["serviceAccountName"], named("ServiceAccount")["metadata"]["name"]);
    assert_eq!(named("RoleBinding")["subjects"][0]["namespace"], "gridfall");
    // Both mount one volume under one path.
    let job: Value = serde_saphyr::from_str(map["data"]["job.yaml"].as_str().unwrap()).unwrap();
    let job_pod = &job["spec"]["template"]["spec"];
    assert_eq!(pod["volumes"][0], job_pod["volumes"][0]);
    assert_eq!(pod["containers"][0]["volumeMounts"][0], job_pod["containers"][0]["volumeMounts"][0]);
    assert_eq!(pod["containers"][0]["env"][0], job_pod["containers"][0]["env"][0]);
}

#[test]
fn the_servers_arguments_are_those_of_the_program() {
    let text = fs::read_to_string(folder().join("server.yaml")).unwrap();
    let documents: Vec<Value> = serde_saphyr::from_multiple(&text).unwrap();
    let container = &documents[0]["spec"]["template"]["spec"]["containers"][0];
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let data_dir = dir.path().join("data");
    fs::create_dir(&data_dir).unwrap();
    let job = dir.path().join("job.yaml");
    fs::write(&job, job_manifest(&data_dir).to_string()).unwrap();
    let mut command = cluster.command(env!("CARGO_BIN_EXE_gridfall"));
    for argument in container["args"].as_array().unwrap() {
        let argument = argument.as_str().unwrap().replace("=/data", &format!("={}", data_dir.display()));
        let argument = argument.replace("/etc/gridfall/job.yaml", &job.display().to_string());
        command.arg(argument.replace("0.0.0.0:8080", "0.0.0.0:0"));
    }
    let allowed = container["env"][1]["value"].as_str().unwrap();
    let database = postgres::shared().database();
    command.env("GRIDFALL_DATABASE", &database).env(container["env"][1]["name"].as_str().unwrap(), allowed);
    let mut server = command.stdout(std::process::Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(server.stdout.take().unwrap()), &mut line).unwrap();
    server.kill().unwrap();
    server.wait().unwrap();
    assert!(line.contains("listening on http://0.0.0.0:"), "{line:?}");
}

#[test]
fn the_jobs_that_the_server_makes_are_valid() {
    let (cluster, dir) = (Kubernetes::start(), tempfile::tempdir().unwrap());
    let server = on_kubernetes(&cluster, &dir.path().join("data"), &postgres::shared().database(), &[], |job| job);
    let jobs = [server.submit(support::short()), server.submit(support::short())];
    for job in &jobs {
        server.wait_for(job, "succeeded");
    }
    let submitted = cluster.state().submitted.clone();
    assert_eq!(submitted.len(), 2);
    for job in submitted {
        let file = dir.path().join("submitted.yaml");
        fs::write(&file, job.to_string()).unwrap();
        assert_eq!(validate(&file), 1);
    }
}

#[test]
fn the_commands_of_the_guide_run() {
    let package = tempfile::tempdir().unwrap();
    guide::install_package(package.path());
    let (_, blocks) = guide::pages().into_iter().find(|(name, _)| name == "kubernetes").expect("there is such a page");
    let (cluster, database) = (Kubernetes::start(), postgres::shared().database());
    // A reader has the rights of an administrator.
    let configuration = cluster.administrator().display().to_string();
    let environment = [("KUBECONFIG", configuration.as_str()), ("GRIDFALL_DATABASE", &database)];
    assert!(guide::run("kubernetes", &blocks, package.path(), &environment));
    let state = cluster.state();
    let made = |path: &str| state.others.contains_key(&format!("{path}/gridfall"));
    let namespaced = "/apis/apps/v1/namespaces/gridfall/deployments";
    assert!(made("/api/v1/namespaces") && made(namespaced), "{:?}", state.others.keys());
    assert_eq!(state.others.len(), 9, "{:?}", state.others.keys());
}
