//! A real server process on a free loopback port, and a client for it.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use ureq::http::{HeaderMap, Method, Request};

/// A generous timeout: what takes longer than this never comes.
const PATIENCE: Duration = Duration::from_secs(300);

pub struct Server {
    child: Child,
    pub url: String,
    data_dir: PathBuf,
}

pub struct Answer {
    pub status: u16,
    pub headers: HeaderMap,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|error| panic!("{error} in {:?}", String::from_utf8_lossy(&self.body)))
    }

    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().unwrap())
    }
}

impl Server {
    /// Starts a server on a data directory and waits until it listens.
    pub fn start(data_dir: &Path) -> Self {
        Self::start_with(data_dir, &[])
    }

    /// The same with more arguments.
    pub fn start_with(data_dir: &Path, more: &[&str]) -> Self {
        Self::start_logging(data_dir, more, Stdio::inherit())
    }

    /// The same with its log to another place than that of the tests.
    pub fn start_logging(data_dir: &Path, more: &[&str], log: Stdio) -> Self {
        Self::launch(Command::new(env!("CARGO_BIN_EXE_gridfall")), data_dir, more, log)
    }

    /// The same with a command of the caller's, which gets the arguments.
    pub fn launch(mut command: Command, data_dir: &Path, more: &[&str], log: Stdio) -> Self {
        let mut child = command
            .args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--data-dir"])
            .arg(data_dir)
            .args(more)
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let url = line.trim().strip_prefix("listening on ").expect("the server says where it listens").to_owned();
        Self { child, url, data_dir: data_dir.to_owned() }
    }

    pub fn call(&self, method: &str, path: &str, headers: &[(&str, &str)], body: impl Into<Vec<u8>>) -> Answer {
        let agent: ureq::Agent =
            ureq::Agent::config_builder().http_status_as_error(false).proxy(None).max_redirects(0).build().into();
        let mut request =
            Request::builder().method(Method::try_from(method).unwrap()).uri(format!("{}{path}", self.url));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let body = body.into();
        let response =
            if body.is_empty() { agent.run(request.body(()).unwrap()) } else { agent.run(request.body(body).unwrap()) };
        let mut response = response.unwrap_or_else(|error| panic!("{method} {path}: {error}"));
        let body = response.body_mut().with_config().limit(1 << 30).read_to_vec().unwrap();
        Answer { status: response.status().as_u16(), headers: response.headers().clone(), body }
    }

    pub fn get(&self, path: &str) -> Answer {
        self.call("GET", path, &[], "")
    }

    pub fn post_json(&self, path: &str, body: &Value) -> Answer {
        self.call("POST", path, &[("content-type", "application/json")], body.to_string())
    }

    /// Submits a scene and returns the path of its job.
    pub fn submit(&self, scene: Value) -> String {
        let answer = self.post_json("/v1/jobs", &json!({ "scene": scene }));
        assert_eq!(answer.status, 202, "{}", String::from_utf8_lossy(&answer.body));
        answer.header("location").to_owned()
    }

    pub fn job(&self, path: &str) -> Value {
        let answer = self.get(path);
        assert_eq!(answer.status, 200);
        answer.json()
    }

    /// Polls a job until it is in the wanted state.
    pub fn wait_until(&self, path: &str, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let started = Instant::now();
        loop {
            let job = self.job(path);
            if wanted(&job) {
                return job;
            }
            assert!(started.elapsed() < PATIENCE, "{what} never came: {job:#}");
            sleep(Duration::from_millis(20));
        }
    }

    pub fn wait_for(&self, path: &str, status: &str) -> Value {
        self.wait_until(path, status, |job| {
            let terminal = ["succeeded", "failed", "canceled"].iter().any(|end| job["status"] == *end);
            assert!(!terminal || job["status"] == status, "{status} was expected: {job:#}");
            job["status"] == status
        })
    }

    /// Waits until a job has written some frames.
    pub fn wait_for_frames(&self, path: &str, frames: u64) -> Value {
        self.wait_until(path, "frames", |job| job["progress"]["frames_written"].as_u64() >= Some(frames))
    }

    /// The folder of a job.
    pub fn job_dir(&self, job: &str) -> PathBuf {
        self.data_dir.join("jobs").join(job.rsplit('/').next().unwrap())
    }

    /// The file of an output of a job's last attempt.
    pub fn file(&self, job: &str, name: &str) -> PathBuf {
        self.job_dir(job).join(self.job(job)["attempt"].to_string()).join(name)
    }

    /// SIGKILL: none of the server's code runs any more.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// SIGTERM, and the exit status.
    pub fn terminate(mut self) -> ExitStatus {
        let status = Command::new("kill").arg(self.child.id().to_string()).status().unwrap();
        assert!(status.success());
        let started = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(started.elapsed() < PATIENCE, "the server does not end");
            sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended already, if the test wanted that.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A falling elastic square of 64 particles; `end_s` seconds at 100 frames per second.
pub fn scene(end_s: f64) -> Value {
    json!({
        "gridfall": 1, "name": "square", "dimension": 2,
        "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.0625 },
        "gravity": [0, -9.81],
        "materials": {
            "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 }
        },
        "bodies": [{
            "name": "square", "material": "jelly", "shape": { "box": { "min": [0.375, 0.375], "max": [0.625, 0.625] } }
        }],
        "time": { "end": end_s, "frame_rate": 100 }
    })
}

/// A job that finishes in a moment.
pub fn short() -> Value {
    scene(0.05)
}

/// A job that runs too long to wait for.
pub fn endless() -> Value {
    scene(999.0)
}
