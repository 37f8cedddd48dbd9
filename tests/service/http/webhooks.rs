//! Webhooks as their receivers see them.

use std::net::TcpListener;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::receiver::{Message, Receiver, status, verify};
use super::support::{Server, endless, short};

const LOCAL: &[&str] = &["--allow-webhook-address", "127.0.0.0/8", "--webhook-retry-seconds", "0.05"];

fn start(dir: &Path) -> Server {
    Server::start_with(dir, LOCAL)
}

/// Adds a webhook; its path and its secret.
fn add(server: &Server, url: &str, events: &[&str]) -> (String, String) {
    let answer = server.post_json("/v1/webhooks", &json!({ "url": url, "events": events }));
    assert_eq!(answer.status, 201, "{}", String::from_utf8_lossy(&answer.body));
    (answer.header("location").to_owned(), answer.json()["secret"].as_str().unwrap().to_owned())
}

fn kinds(messages: &[Message]) -> Vec<String> {
    messages.iter().map(Message::kind).collect()
}

/// Waits until the newest delivery of a webhook is as wanted.
fn delivery(server: &Server, webhook: &str, wanted: impl Fn(&Value) -> bool) -> Value {
    let started = Instant::now();
    loop {
        let list = server.get(&format!("{webhook}/deliveries")).json();
        if wanted(&list["deliveries"][0]) {
            return list["deliveries"][0].clone();
        }
        assert!(started.elapsed() < Duration::from_secs(60), "{list:#}");
        sleep(Duration::from_millis(20));
    }
}

#[test]
fn receivers_are_told_what_happens_and_can_trust_it() {
    let dir = tempfile::tempdir().unwrap();
    let server = start(dir.path());
    let (all, ends) = (Receiver::start(|_, _| status(204)), Receiver::start(|_, _| status(200)));
    let (webhook, secret) = add(&server, &all.url(), &[]);
    let (_, other_secret) = add(&server, &format!("{}?a=b", ends.url()), &["job.succeeded", "sweep.finished"]);
    assert_ne!(secret, other_secret);
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let messages = all.wait_for(3);
    let mut seen = kinds(&messages);
    seen.sort();
    assert_eq!(seen, ["job.queued", "job.started", "job.succeeded"]);
    verify(&messages, &secret);
    let end = messages.iter().find(|message| message.kind() == "job.succeeded").unwrap();
    let shown = server.job(&job);
    let event = end.event();
    assert_eq!(event["data"], shown, "the job as the API shows it");
    assert_eq!(event["timestamp"], shown["finished_at"]);
    assert!(event["data"].get("scene").is_none());
    assert_eq!(end.headers["content-type"], "application/json");
    assert!(end.headers["user-agent"].starts_with("gridfall/") && end.path == "/hook");
    // The other one asked for ends only.
    let sweep = json!({ "scene": short(), "grid": { "seed": [1, 2] }, "name": "two" });
    assert_eq!(server.post_json("/v1/sweeps", &sweep).status, 202);
    let messages = ends.wait_for(4);
    assert_eq!(messages.iter().filter(|message| message.kind() == "job.succeeded").count(), 3);
    let last = messages.iter().find(|message| message.kind() == "sweep.finished").unwrap();
    assert!(last.event()["data"]["ended"] == true && last.event()["data"]["jobs"]["succeeded"] == 2);
    assert_eq!(last.path, "/hook?a=b");
    verify(&messages, &other_secret);
    // A test, what is kept of it, and what is gone with the webhook.
    let test = server.call("POST", &format!("{webhook}/test"), &[], "");
    assert_eq!((test.status, test.json()["status"].as_str()), (202, Some("pending")));
    let kept = delivery(&server, &webhook, |one| one["status"] == "delivered");
    assert_eq!(
        (&kept["id"], &kept["answer"]["status"], &kept["attempts"]),
        (&test.json()["id"], &json!(204), &json!(1))
    );
    let metrics = String::from_utf8(server.get("/metrics").body).unwrap();
    assert!(metrics.contains("gridfall_webhook_deliveries_total{result=\"delivered\"}"), "{metrics}");
    assert!(server.get(&webhook).json().get("secret").is_none());
    let listed = server.get(&format!("{webhook}/deliveries?limit=2")).json();
    assert!(listed["deliveries"].as_array().unwrap().len() == 2 && listed["next_cursor"].is_string());
    assert_eq!(server.call("DELETE", &webhook, &[], "").status, 204);
    for path in [webhook.clone(), format!("{webhook}/deliveries")] {
        assert_eq!(server.get(&path).json()["code"], "webhook_not_found");
    }
}

#[test]
fn a_message_is_sent_again_until_it_arrives_and_is_the_same_each_time() {
    let dir = tempfile::tempdir().unwrap();
    let server = start(dir.path());
    let receiver = Receiver::start(|n, _| match n {
        0 => status(500),
        // Nothing, a broken answer, and what is no success.
        1 => String::new(),
        2 => "HTTP/1.1 2".into(),
        3 => status(404),
        _ => status(202),
    });
    let (webhook, secret) = add(&server, &receiver.url(), &["job.canceled"]);
    let job = server.submit(endless());
    server.call("POST", &format!("{job}/cancel"), &[], "");
    let messages = receiver.wait_for(5);
    let kept = delivery(&server, &webhook, |one| one["status"] == "delivered");
    assert_eq!((&kept["attempts"], &kept["next_at"]), (&json!(5), &Value::Null));
    assert!(messages.iter().all(|message| message.id() == messages[0].id() && message.body == messages[0].body));
    verify(&messages, &secret);
    sleep(Duration::from_millis(1500));
    assert_eq!(receiver.received().len(), 5);
}

#[test]
fn what_does_not_arrive_is_given_up_and_can_be_sent_again() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start_with(dir.path(), &[LOCAL, &["--webhook-attempts", "3"]].concat());
    let receiver = Receiver::start(|n, _| {
        let long = "x".repeat(100_000);
        if n < 3 { format!("HTTP/1.1 503 no\r\ncontent-length: 100000\r\n\r\n{long}") } else { status(200) }
    });
    let (webhook, _) = add(&server, &receiver.url(), &["job.queued"]);
    server.submit(short());
    let dead = delivery(&server, &webhook, |one| one["status"] == "dead");
    let said = dead["answer"]["text"].as_str().unwrap();
    assert_eq!((&dead["attempts"], &dead["answer"]["status"], said.len()), (&json!(3), &json!(503), 1024));
    let listed = server.get(&format!("{webhook}/deliveries?status=dead")).json();
    assert_eq!(listed["deliveries"].as_array().unwrap().len(), 1);
    let metrics = String::from_utf8(server.get("/metrics").body).unwrap();
    assert!(metrics.contains("gridfall_webhook_dead_letters 1"), "{metrics}");
    let retry = format!("{webhook}/deliveries/{}/retry", dead["id"].as_str().unwrap());
    assert_eq!(server.call("POST", &retry, &[], "").status, 202);
    let kept = delivery(&server, &webhook, |one| one["status"] == "delivered");
    assert_eq!((&kept["id"], &kept["attempts"]), (&dead["id"], &json!(4)));
    assert!(receiver.received().iter().all(|message| message.id() == dead["id"]));
    let none = format!("{webhook}/deliveries/msg_none/retry");
    assert_eq!(server.call("POST", &none, &[], "").json()["code"], "delivery_not_found");
}

#[test]
fn a_receiver_that_is_gone_is_told_nothing_more() {
    let dir = tempfile::tempdir().unwrap();
    let server = start(dir.path());
    let receiver = Receiver::start(|_, _| status(410));
    let (webhook, _) = add(&server, &receiver.url(), &[]);
    server.call("POST", &format!("{webhook}/test"), &[], "");
    delivery(&server, &webhook, |one| one["status"] == "dead");
    assert_eq!(server.get(&webhook).json()["enabled"], false);
    let job = server.submit(short());
    server.wait_for(&job, "succeeded");
    let refused = server.call("POST", &format!("{webhook}/test"), &[], "");
    assert_eq!((refused.status, refused.json()["code"].as_str()), (409, Some("webhook_disabled")));
    sleep(Duration::from_millis(1200));
    assert_eq!(receiver.received().len(), 1);
}

/// One that answers late holds up neither itself, for more than its time, nor others.
#[test]
fn a_slow_receiver_holds_nobody_up() {
    let dir = tempfile::tempdir().unwrap();
    let server = start(dir.path());
    let slow = Receiver::start(|n, _| {
        if n < 6 {
            sleep(Duration::from_secs(18));
        }
        status(200)
    });
    let quick = Receiver::start(|_, _| status(200));
    let (late, _) = add(&server, &slow.url(), &["webhook.test"]);
    // The same machine under another address, which is another host.
    let (prompt, _) = add(&server, &format!("http://localhost:{}/hook", quick.address.port()), &["webhook.test"]);
    for _ in 0..6 {
        server.call("POST", &format!("{late}/test"), &[], "");
    }
    slow.wait_for(4);
    let asked = Instant::now();
    server.call("POST", &format!("{prompt}/test"), &[], "");
    quick.wait_for(1);
    assert!(asked.elapsed() < Duration::from_secs(8), "{:?}", asked.elapsed());
    sleep(Duration::from_secs(2));
    assert_eq!(slow.received().len(), 4, "more at a time than one host gets");
    let kept = delivery(&server, &late, |_| {
        let all = server.get(&format!("{late}/deliveries")).json();
        all["deliveries"].as_array().unwrap().iter().any(|one| one["answer"]["text"].is_string())
    });
    assert!(kept.is_object());
    let all = server.get(&format!("{late}/deliveries")).json();
    let said = all["deliveries"].as_array().unwrap().iter().find(|one| one["answer"]["text"].is_string()).unwrap();
    assert_eq!(
        (&said["answer"]["status"], &said["answer"]["text"]),
        (&Value::Null, &json!("no whole answer within 15 s"))
    );
}

#[test]
fn a_crash_between_a_change_and_its_delivery_loses_nothing() {
    let dir = tempfile::tempdir().unwrap();
    // A port that nobody listens on yet.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    drop(listener);
    let server = start(dir.path());
    let (_, secret) = add(&server, &format!("http://{address}/hook"), &["job.succeeded"]);
    let jobs: Vec<String> = (0..3).map(|_| server.submit(short())).collect();
    for job in &jobs {
        server.wait_for(job, "succeeded");
    }
    server.kill();
    // The receiver dies with a message in its hands, too: the connection breaks.
    let receiver =
        Receiver::on(TcpListener::bind(address).unwrap(), |n, _| if n == 0 { String::new() } else { status(200) });
    let server = start(dir.path());
    let messages = receiver.wait_for(4);
    verify(&messages, &secret);
    let about = |message: &Message| format!("/v1/jobs/{}", message.event()["data"]["id"].as_str().unwrap());
    for job in &jobs {
        let told: Vec<&Message> = messages.iter().filter(|message| about(message) == *job).collect();
        assert!(!told.is_empty() && told.iter().all(|message| message.id() == told[0].id()), "{job}: {messages:#?}");
    }
    // Killed while it sends: the message comes again under the same id.
    drop(server);
}

#[test]
fn a_server_that_dies_while_it_sends_sends_again() {
    let dir = tempfile::tempdir().unwrap();
    let receiver = Receiver::start(|n, _| {
        if n == 0 {
            sleep(Duration::from_secs(3));
        }
        status(200)
    });
    let server = start(dir.path());
    let (webhook, _) = add(&server, &receiver.url(), &[]);
    server.call("POST", &format!("{webhook}/test"), &[], "");
    receiver.wait_for(1);
    server.kill();
    let server = start(dir.path());
    // Its lease has to end first.
    let messages = receiver.wait_for(2);
    assert_eq!(messages[0].id(), messages[1].id());
    delivery(&server, &webhook, |one| one["status"] == "delivered" && one["attempts"] == 2);
}

#[test]
fn addresses_of_the_inside_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    for url in [
        "http://127.0.0.1/",
        "http://127.0.0.1:1/x",
        "http://[::1]/",
        "http://169.254.169.254/latest/meta-data",
        "http://10.0.0.1/",
        "http://192.168.0.1/",
        "http://[fd00:ec2::254]/",
        "http://[::ffff:127.0.0.1]/",
        "http://0x7f.1/",
        // A name of the machine itself.
        "http://localhost/",
        "https://localhost:8443/",
        "http://no-such-name.invalid/",
        "ftp://example.com/",
        "http://me:secret@1.1.1.1/",
        "/hook",
    ] {
        let answer = server.post_json("/v1/webhooks", &json!({ "url": url }));
        assert_eq!((answer.status, answer.json()["code"].as_str()), (422, Some("webhook_refused")), "{url}");
        let detail = answer.json()["detail"].as_str().unwrap().to_owned();
        assert!(detail.starts_with("/url: ") && detail.len() > 20, "{detail}");
    }
    for (member, value) in [("secret", json!("whsec_short")), ("events", json!(["job.vanished"])), ("x", json!(1))] {
        let mut request = json!({ "url": "https://1.1.1.1/" });
        request[member] = value;
        assert_eq!(server.post_json("/v1/webhooks", &request).json()["code"], "invalid_request", "{member}");
    }
    assert_eq!(server.get("/v1/webhooks").json()["webhooks"], json!([]));
}

/// An address that was allowed once is judged again each time that it is called; redirects are not followed.
#[test]
fn no_way_leads_inside() {
    let dir = tempfile::tempdir().unwrap();
    let inside = Receiver::start(|_, _| status(200));
    let to = inside.url();
    let receiver = Receiver::start(move |_, _| {
        format!("HTTP/1.1 307 elsewhere\r\nlocation: {to}\r\ncontent-length: 0\r\nconnection: close\r\n\r\n")
    });
    let server = Server::start_with(dir.path(), &[LOCAL, &["--webhook-attempts", "2"]].concat());
    let (webhook, _) = add(&server, &receiver.url(), &[]);
    server.call("POST", &format!("{webhook}/test"), &[], "");
    let dead = delivery(&server, &webhook, |one| one["status"] == "dead");
    assert_eq!(dead["answer"]["status"], 307);
    assert_eq!((receiver.received().len(), inside.received().len()), (2, 0));
    drop(server);
    // The same webhook where the operator allows less.
    let server = Server::start_with(dir.path(), &["--webhook-attempts", "1"]);
    server.call("POST", &format!("{webhook}/test"), &[], "");
    let dead = delivery(&server, &webhook, |one| one["status"] == "dead");
    assert!(dead["answer"]["text"].as_str().unwrap().contains("--allow-webhook-address 127.0.0.1"), "{dead:#}");
    assert_eq!(receiver.received().len(), 2);
}
