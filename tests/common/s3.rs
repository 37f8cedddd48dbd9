//! A server of S3 of the tests' own, gone with the process that started it. It keeps what it has in a folder.

use std::fs;
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::daemon::Daemon;

const BUCKET: &str = "recordings";
const PATIENCE: Duration = Duration::from_secs(30);

pub struct S3 {
    dir: PathBuf,
    port: u16,
    server: Mutex<Option<Daemon>>,
}

impl S3 {
    pub fn start() -> Self {
        let dir = tempfile::tempdir().unwrap().keep();
        fs::create_dir_all(dir.join("root").join(BUCKET)).unwrap();
        let port = TcpListener::bind(("127.0.0.1", 0)).unwrap().local_addr().unwrap().port();
        let s3 = Self { dir, port, server: Mutex::default() };
        s3.restart();
        s3
    }

    pub fn kill(&self) {
        self.server.lock().unwrap().take();
    }

    pub fn restart(&self) {
        let tools = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("s3s");
        let mut command = Command::new(tools.join("bin/s3s-fs"));
        command.args(["--host", "127.0.0.1", "--port", &self.port.to_string()]);
        command.args(["--access-key", "gridfall", "--secret-key", "secret"]).arg(self.dir.join("root"));
        command.env("RUST_LOG", "error");
        let log = fs::File::options().create(true).append(true).open(self.dir.join("log")).unwrap();
        *self.server.lock().unwrap() = Some(Daemon::start(&command, log));
        let started = Instant::now();
        while TcpStream::connect(("127.0.0.1", self.port)).is_err() {
            assert!(started.elapsed() < PATIENCE, "s3s-fs does not listen; tests/run installs it");
            sleep(Duration::from_millis(10));
        }
    }

    /// How programs find it.
    pub fn environment(&self) -> [(&'static str, String); 4] {
        [
            ("AWS_ENDPOINT_URL", format!("http://127.0.0.1:{}", self.port)),
            ("AWS_REGION", "us-east-1".into()),
            ("AWS_ACCESS_KEY_ID", "gridfall".into()),
            ("AWS_SECRET_ACCESS_KEY", "secret".into()),
        ]
    }

    /// The address of a prefix.
    pub fn url(&self, prefix: &str) -> String {
        format!("s3://{BUCKET}/{prefix}")
    }

    /// The objects below a prefix, with their sizes (bytes).
    pub fn objects(&self, prefix: &str) -> Vec<(String, u64)> {
        let bucket = self.dir.join("root").join(BUCKET);
        let mut found = Vec::new();
        let mut folders = vec![bucket.join(prefix)];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
                match entry.metadata() {
                    Ok(metadata) if metadata.is_dir() => folders.push(entry.path()),
                    Ok(metadata) => {
                        let path = entry.path();
                        found.push((path.strip_prefix(&bucket).unwrap().display().to_string(), metadata.len()));
                    }
                    // Removed meanwhile.
                    Err(_) => {}
                }
            }
        }
        found.sort();
        found
    }

    /// Fails unless each list that tells of published outputs tells of whole ones. Returns the number of lists.
    pub fn check_published(&self, prefix: &str) -> usize {
        let objects = self.objects(prefix);
        let lists: Vec<&str> = objects.iter().filter_map(|(path, _)| path.strip_suffix("/published.json")).collect();
        for folder in &lists {
            let path = self.dir.join("root").join(BUCKET).join(folder).join("published.json");
            let list: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
            for file in list["files"].as_array().unwrap() {
                let (name, bytes) = (file["name"].as_str().unwrap(), file["bytes"].as_u64().unwrap());
                let path = format!("{folder}/{}/{name}", list["published"].as_str().unwrap());
                assert!(objects.contains(&(path, bytes)), "{folder} lacks {file} of {list:#}");
            }
        }
        lists.len()
    }
}
