//! A receiver of webhooks that answers as tests want.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::{sleep, spawn};
use std::time::{Duration, Instant};

use serde_json::Value;

/// A request as it came.
#[derive(Clone, Debug)]
pub struct Message {
    pub path: String,
    pub headers: BTreeMap<String, String>,
    pub body: String,
}

impl Message {
    pub fn id(&self) -> &str {
        &self.headers["webhook-id"]
    }

    pub fn event(&self) -> Value {
        serde_json::from_str(&self.body).unwrap()
    }

    pub fn kind(&self) -> String {
        self.event()["type"].as_str().unwrap().to_owned()
    }
}

/// What a receiver does with its n-th message, from 0.
pub type Behaviour = dyn Fn(usize, &Message) -> String + Send + Sync;

pub struct Receiver {
    pub address: SocketAddr,
    received: Arc<Mutex<Vec<Message>>>,
}

/// The head of an answer without a body.
pub fn status(code: u16) -> String {
    format!("HTTP/1.1 {code} status\r\ncontent-length: 0\r\nconnection: close\r\n\r\n")
}

impl Receiver {
    pub fn start(behaviour: impl Fn(usize, &Message) -> String + Send + Sync + 'static) -> Self {
        Self::on(TcpListener::bind("127.0.0.1:0").unwrap(), behaviour)
    }

    pub fn on(listener: TcpListener, behaviour: impl Fn(usize, &Message) -> String + Send + Sync + 'static) -> Self {
        let address = listener.local_addr().unwrap();
        let (received, behaviour): (Arc<Mutex<Vec<Message>>>, Arc<Behaviour>) = (Arc::default(), Arc::new(behaviour));
        let kept = received.clone();
        spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                let (kept, behaviour) = (kept.clone(), behaviour.clone());
                spawn(move || answer(stream, &kept, &*behaviour));
            }
        });
        Self { address, received }
    }

    pub fn url(&self) -> String {
        format!("http://{}/hook", self.address)
    }

    pub fn received(&self) -> Vec<Message> {
        self.received.lock().unwrap().clone()
    }

    /// Waits for so many messages, and returns all that there are then.
    pub fn wait_for(&self, messages: usize) -> Vec<Message> {
        let started = Instant::now();
        loop {
            let received = self.received();
            if received.len() >= messages {
                return received;
            }
            assert!(started.elapsed() < Duration::from_secs(120), "{messages} messages never came: {received:#?}");
            sleep(Duration::from_millis(20));
        }
    }
}

fn answer(stream: TcpStream, kept: &Mutex<Vec<Message>>, behaviour: &Behaviour) {
    let mut reader = BufReader::new(&stream);
    let mut line = String::new();
    if reader.read_line(&mut line).unwrap_or(0) == 0 {
        return;
    }
    let path = line.split(' ').nth(1).unwrap().to_owned();
    let mut headers = BTreeMap::new();
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).unwrap();
        let Some((name, value)) = line.trim_end().split_once(": ") else { break };
        headers.insert(name.to_ascii_lowercase(), value.to_owned());
    }
    let mut body = vec![0; headers["content-length"].parse().unwrap()];
    reader.read_exact(&mut body).unwrap();
    let message = Message { path, headers, body: String::from_utf8(body).unwrap() };
    let n = {
        let mut kept = kept.lock().unwrap();
        kept.push(message.clone());
        kept.len() - 1
    };
    // Whoever asked may have gone.
    let _ = (&stream).write_all(behaviour(n, &message).as_bytes());
}

/// Checks messages with the Python library of Standard Webhooks.
pub fn verify(messages: &[Message], secret: &str) {
    const SCRIPT: &str = "\
import json, sys
from standardwebhooks.webhooks import Webhook, WebhookVerificationError
given = json.load(sys.stdin)
webhook = Webhook(given['secret'])
for headers, body in given['messages']:
    assert webhook.verify(body, headers) == json.loads(body)
    try:
        webhook.verify(body + ' ', headers)
        sys.exit('another body has the same signature')
    except WebhookVerificationError:
        pass
print(len(given['messages']))
";
    let interpreter = std::env::var("GRIDFALL_PYTHON").unwrap_or("python3".into());
    let given = serde_json::json!({
        "secret": secret,
        "messages": messages.iter().map(|message| (&message.headers, &message.body)).collect::<Vec<_>>(),
    });
    let mut python =
        Command::new(interpreter).args(["-c", SCRIPT]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    python.stdin.take().unwrap().write_all(given.to_string().as_bytes()).unwrap();
    let ended = python.wait_with_output().unwrap();
    assert!(ended.status.success());
    assert_eq!(String::from_utf8_lossy(&ended.stdout).trim(), messages.len().to_string());
}
