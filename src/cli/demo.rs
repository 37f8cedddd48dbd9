//! `gridfall demo`: a server, a job and its recording, in one command.

use std::fs::{self, File};
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use clap::Args;
use serde_json::{Value, json};
use tokio::sync::oneshot;
use ureq::Agent;

use super::device::DeviceArguments;
use super::serve::{opener, runtime};
use super::talk::bar;
use super::{CliError, interrupt};
use gridfall_service::http::{self, Config, Options};
use gridfall_service::jobs::Executor;
use gridfall_service::jobs::Settings;
use gridfall_service::jobs::retention::Keep;

/// Embedded in the program, so that the demo works from any directory.
const SCENE: &str = include_str!("../../scenes/quickstart.json");

/// Start a server on a free loopback port, run scenes/quickstart.json on it over HTTP, and download
/// the results.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Where to write the recording and the picture.
    #[arg(short, long, default_value = ".", value_name = "DIR")]
    output: PathBuf,
    /// Leave the server up until Ctrl-C.
    #[arg(long)]
    keep: bool,
    #[command(flatten)]
    device: DeviceArguments,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    fs::create_dir_all(&arguments.output)
        .map_err(|error| CliError::BadInput(format!("cannot write to {}: {error}", arguments.output.display())))?;
    let server = Server::start(arguments.device)?;
    println!("Server at {}", server.url);
    show(&server.url, &arguments.output)?;
    if arguments.keep {
        println!("\nThe server stays up at {} until Ctrl-C; its jobs are gone with it.", server.url);
        let runtime = runtime()?;
        let ended = runtime.block_on(async {
            interrupt::requested()?.await;
            Ok::<_, io::Error>(())
        });
        ended.map_err(|error| CliError::Failed(error.to_string()))?;
    }
    server.stop()
}

/// Submits the scene, follows the job, downloads its results and prints a summary.
fn show(url: &str, output: &Path) -> Result<(), CliError> {
    let client = Client::new(url);
    let scene: Value = serde_json::from_str(SCENE).expect("the tests check every scene of the repository");
    let description = scene["description"].as_str().unwrap_or_default().to_owned();
    let mut job = client.post("/v1/jobs", &json!({ "scene": scene }))?;
    let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap_or_default());
    println!("Submitted scenes/quickstart.json, {} particles: {url}{path}", job["particles"]);

    let bar = bar(job["progress"]["frames"].as_u64().unwrap_or(0));
    while matches!(job["status"].as_str(), Some("queued" | "running")) {
        thread::sleep(Duration::from_millis(100));
        job = client.get(&path)?;
        bar.set_position(job["progress"]["frames_written"].as_u64().unwrap_or(0));
        let speed = job["progress"]["particle_steps_per_s"].as_f64().unwrap_or(0.0);
        bar.set_message(format!("frames, {:.2} M particle-steps/s", speed / 1e6));
    }
    bar.finish_and_clear();
    if job["status"] != "succeeded" {
        return Err(CliError::Failed(format!("the job {}: {}", job["status"], job["failure"]["message"])));
    }

    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let (backend, progress) = (&job["backend"], &job["progress"]);
    println!("Ran on {} ({}): {}", text(&backend["device"]), text(&backend["kind"]), text(&backend["reason"]));
    println!(
        "{} frames, {} steps, {:.2} M particle-steps/s",
        progress["frames_written"],
        progress["step"],
        progress["particle_steps_per_s"].as_f64().unwrap_or(0.0) / 1e6
    );
    let (recording, picture) = (output.join("gridfall-demo.mcap"), output.join("gridfall-demo.png"));
    for (part, file) in [("recording.mcap", &recording), ("thumbnail.png", &picture)] {
        let bytes = client.download(&format!("{path}/{part}"), file)?;
        println!("Wrote {} ({:.1} MB)", file.display(), bytes as f64 / 1e6);
    }
    println!(
        "\n{description}\n\n\
         Open {mcap} in Lichtblick (https://lichtblick-suite.github.io) or Foxglove (https://app.foxglove.dev): \
         add a 3D\n\
         panel and press play. Or read it in Python: pip install mcap mcap-protobuf-support, then\n\n\
         \x20 from mcap.reader import make_reader\n\
         \x20 from mcap_protobuf.decoder import DecoderFactory\n\
         \x20 for _, channel, _, message in make_reader(open('{mcap}', 'rb'), decoder_factories=[DecoderFactory()])\\\n\
         \x20         .iter_decoded_messages(topics=['/diagnostics']):\n\
         \x20     print(message)",
        mcap = recording.display()
    );
    Ok(())
}

/// A server on a thread of this process, with a data directory of its own.
struct Server {
    url: String,
    stop: oneshot::Sender<()>,
    thread: JoinHandle<Result<(), CliError>>,
    data_dir: PathBuf,
}

impl Server {
    fn start(device: DeviceArguments) -> Result<Self, CliError> {
        let data_dir = std::env::temp_dir().join(format!("gridfall-demo-{}", std::process::id()));
        let options = Options {
            listen: SocketAddr::from(([127, 0, 0, 1], 0)),
            data_dir: data_dir.clone(),
            database: None,
            files: None,
            insecure_no_auth: false,
            certificate: None,
            keep: Keep::default(),
            config: Config::default(),
            checkpoint_every: Settings::default().checkpoint_every,
            small_jobs: (0, 0),
            executor: Executor::Local(vec![opener(device)]),
        };
        let (stop, stopped) = oneshot::channel();
        let (listening, address) = mpsc::channel();
        let thread = thread::spawn(move || {
            let runtime = runtime()?;
            let shutdown = async {
                // Dropped if the demo fails, which also ends the server.
                let _ = stopped.await;
            };
            let report = |address| listening.send(address).expect("the demo waits for the address");
            let served = runtime.block_on(http::serve(options, report, shutdown));
            served.map_err(|error| CliError::Failed(error.to_string()))
        });
        match address.recv() {
            Ok(address) => Ok(Self { url: format!("http://{address}"), stop, thread, data_dir }),
            Err(_) => Err(join(thread).err().unwrap_or_else(|| CliError::Failed("the server ended at once".into()))),
        }
    }

    fn stop(self) -> Result<(), CliError> {
        // The receiver is gone only if the server has ended by itself; joining reports that.
        let _ = self.stop.send(());
        let ended = join(self.thread);
        fs::remove_dir_all(&self.data_dir)
            .map_err(|error| CliError::Failed(format!("cannot remove {}: {error}", self.data_dir.display())))?;
        ended
    }
}

fn join(thread: JoinHandle<Result<(), CliError>>) -> Result<(), CliError> {
    thread.join().unwrap_or_else(|_| Err(CliError::Failed("the server panicked".into())))
}

/// Talks to the server over HTTP, like any other client.
struct Client<'a> {
    url: &'a str,
    agent: Agent,
}

impl<'a> Client<'a> {
    fn new(url: &'a str) -> Self {
        Self { url, agent: Agent::config_builder().http_status_as_error(false).proxy(None).build().into() }
    }

    fn get(&self, path: &str) -> Result<Value, CliError> {
        json_body(self.agent.get(format!("{}{path}", self.url)).call().map_err(failed)?)
    }

    fn post(&self, path: &str, body: &Value) -> Result<Value, CliError> {
        json_body(self.agent.post(format!("{}{path}", self.url)).send_json(body).map_err(failed)?)
    }

    /// Returns the number of bytes.
    fn download(&self, path: &str, to: &Path) -> Result<u64, CliError> {
        let response = self.agent.get(format!("{}{path}", self.url)).call().map_err(failed)?;
        if !response.status().is_success() {
            json_body(response)?;
            return Err(CliError::Failed(format!("the server did not send {path}")));
        }
        let write = || io::copy(&mut response.into_body().into_reader(), &mut File::create(to)?);
        write().map_err(|error| CliError::Failed(format!("cannot write {}: {error}", to.display())))
    }
}

/// Parses the JSON of an answer; an error response becomes an error.
fn json_body(mut response: ureq::http::Response<ureq::Body>) -> Result<Value, CliError> {
    let body: Value = response.body_mut().read_json().map_err(failed)?;
    if response.status().is_success() {
        Ok(body)
    } else {
        Err(CliError::Failed(format!("the server refused: {body:#}")))
    }
}

fn failed(error: ureq::Error) -> CliError {
    CliError::Failed(format!("the server does not answer: {error}"))
}
