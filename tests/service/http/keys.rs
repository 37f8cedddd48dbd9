//! Keys over HTTP: who is let in, who sees what, and how much there may be of it.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use gridfall_service::store::{JobStore, NewKey, Quotas, Scope};
use jiff::Timestamp;
use serde_json::{Value, json};

use super::support::{Answer, Server, endless, short};

const JSON: (&str, &str) = ("content-type", "application/json");
const NOWHERE: &str = "01890000-0000-7000-8000-000000000000";

/// Runs `gridfall keys` on a data directory. Returns what it prints.
pub fn keys(dir: &Path, arguments: &[&str]) -> String {
    let program = env!("CARGO_BIN_EXE_gridfall");
    let ran = Command::new(program).arg("keys").args(arguments).arg("--data-dir").arg(dir).output().unwrap();
    assert!(ran.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&ran.stderr));
    String::from_utf8(ran.stdout).unwrap().trim().to_owned()
}

/// A key that was good for a moment.
fn expired(dir: &Path) -> String {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let store = JobStore::open(&dir.join("gridfall.sqlite")).await.unwrap();
        let expires_at = Some(Timestamp::now() - Duration::from_secs(1));
        let new = NewKey { name: "old".into(), scope: Scope::Admin, expires_at, quotas: Quotas::default() };
        let (_, secret) = store.create_key(&new).await.unwrap().unwrap();
        store.close().await;
        secret.reveal().to_owned()
    })
}

/// A client with a key.
struct Caller<'a>(&'a Server, String);

impl Caller<'_> {
    fn call(&self, method: &str, path: &str, headers: &[(&str, &str)], body: impl Into<Vec<u8>>) -> Answer {
        let bearer = format!("Bearer {}", self.1);
        let mut all = headers.to_vec();
        if !self.1.is_empty() {
            all.push(("authorization", &bearer));
        }
        self.0.call(method, path, &all, body)
    }

    fn get(&self, path: &str) -> Answer {
        self.call("GET", path, &[], "")
    }

    fn post(&self, path: &str, body: &Value) -> Answer {
        self.call("POST", path, &[JSON], body.to_string())
    }

    /// Submits a scene and waits for its end. Returns the job's path.
    fn run(&self, scene: &Value) -> String {
        let answer = self.post("/v1/jobs", &json!({ "scene": scene }));
        assert_eq!(answer.status, 202, "{}", answer.json());
        let path = answer.header("location").to_owned();
        let ended = self.call("GET", &path, &[("prefer", "wait=60")], "").json();
        assert_eq!(ended["status"], "succeeded", "{ended:#}");
        path
    }
}

/// A tetrahedron in an upload, and a scene of it.
const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

fn of_asset(id: &str) -> Value {
    json!({
        "gridfall": 1, "name": "upload", "domain": { "min": [0, 0, 0], "max": [1, 1, 1], "dx": 0.125 },
        "materials": {
            "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e4, "poissons_ratio": 0.3 }
        },
        "bodies": [{ "name": "b", "material": "jelly", "shape": { "mesh": { "asset": id } } }],
        "time": { "end": 0.02, "frame_rate": 50 }
    })
}

/// What one key has, with every kind of thing among it.
struct Things {
    job: String,
    sweep: String,
    asset: String,
    scene: String,
}

impl Things {
    fn of(caller: &Caller) -> Self {
        let mut stateful = short();
        stateful["output"] = json!({ "state": true });
        stateful["name"] = "secret-name".into();
        let asset = caller.call("PUT", "/v1/assets", &[], TETRAHEDRON);
        assert_eq!(asset.status, 201, "{}", asset.json());
        let asset = asset.json()["id"].as_str().unwrap().to_owned();
        let kept = caller.post("/v1/scenes", &json!({ "scene": of_asset(&asset) }));
        assert_eq!(kept.status, 201, "{}", kept.json());
        let sweep = json!({ "scene": short(), "name": "secret-sweep", "grid": { "seed": [1, 2] } });
        let sweep = caller.post("/v1/sweeps", &sweep).json()["id"].as_str().unwrap().to_owned();
        let job = caller.run(&stateful).rsplit('/').next().unwrap().to_owned();
        Self { job, sweep, asset, scene: kept.json()["id"].as_str().unwrap().to_owned() }
    }

    fn ids(&self) -> [&str; 4] {
        [&self.job, &self.sweep, &self.asset, &self.scene]
    }

    /// The path of an operation on these, and on what is not there.
    fn fill(&self, path: &str) -> (String, String) {
        let nothing = format!("sha256:{}", "0".repeat(64));
        let (id, none) = match path.split('/').nth(2).unwrap_or_default() {
            "jobs" => (self.job.as_str(), NOWHERE),
            "sweeps" => (self.sweep.as_str(), NOWHERE),
            "assets" => (self.asset.as_str(), nothing.as_str()),
            _ => (self.scene.as_str(), nothing.as_str()),
        };
        let name = if path.contains("library") { "quickstart" } else { "water" };
        let path = path.replace("{frame}", "1").replace("{name}", name);
        (path.replace("{id}", id), path.replace("{id}", none))
    }
}

/// A body that an operation takes.
fn body(path: &str, method: &str) -> (Vec<(&'static str, &'static str)>, Vec<u8>) {
    let json = |value: Value| (vec![JSON], value.to_string().into_bytes());
    match (method, path) {
        ("post", "/v1/jobs" | "/v1/scenes:validate") => json(json!({ "scene": short() })),
        ("post", "/v1/scenes") => json(json!({ "scene": short() })),
        ("post", "/v1/sweeps" | "/v1/sweeps:validate") => json(json!({ "scene": short(), "grid": { "seed": [1] } })),
        ("post", "/v1/jobs:cancel" | "/v1/jobs:delete") => {
            json(json!({ "status": ["queued", "running", "succeeded", "failed", "canceled"] }))
        }
        ("post", "/v1/jobs/{id}/rerun") => json(json!({})),
        ("post", "/v1/materials/test") => json(json!({ "material": "water", "test": "uniaxial" })),
        ("put", "/v1/session") => json(json!({ "key": "gf_none" })),
        // Another file: the same one would be the stranger's own.
        ("put", _) => (vec![], TETRAHEDRON.replace("v 1 0 0", "v 2 0 0").into_bytes()),
        _ => (vec![], vec![]),
    }
}

#[test]
fn a_foreign_key_sees_nothing_of_anothers_on_any_route() {
    let dir = tempfile::tempdir().unwrap();
    let secret = |arguments: &[&str]| keys(dir.path(), &[&["create"], arguments].concat());
    let (a, b, reader) = (secret(&["a"]), secret(&["b"]), secret(&["reader", "--scope", "read"]));
    let (admin, revoked, old) = (secret(&["admin", "--scope", "admin"]), secret(&["gone"]), expired(dir.path()));
    keys(dir.path(), &["revoke", "gone"]);
    let server = Server::start(dir.path());
    let caller = |secret: &str| Caller(&server, secret.to_owned());
    let (a, b, reader, admin) = (caller(&a), caller(&b), caller(&reader), caller(&admin));
    let things = Things::of(&a);
    let unknown = format!("gf_{}_{}", "0".repeat(10), "0".repeat(64));

    let document = server.get("/openapi.json").json();
    let mut walked = 0;
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let (own, none) = things.fill(path);
            let (headers, body) = body(path, method);
            let ask = |caller: &Caller, path: &str| caller.call(&method.to_uppercase(), path, &headers, body.clone());
            let what = format!("{method} {path}");
            walked += 1;
            let asked = operation["security"].as_array().unwrap();
            if asked.is_empty() {
                let answer = ask(&caller(""), &own);
                assert!(answer.status != 401 || path == "/v1/session", "{what}");
                assert!(things.ids().iter().all(|id| !String::from_utf8_lossy(&answer.body).contains(id)), "{what}");
                continue;
            }
            let scope = asked[1]["key"][0].as_str().unwrap();
            let answer = ask(&caller(""), &own);
            assert_eq!((answer.status, &answer.json()["code"]), (401, &json!("key_required")), "{what}");
            assert_eq!(answer.header("www-authenticate"), "Bearer realm=\"gridfall\"", "{what}");
            for bad in [&unknown, &revoked, &old, "gf_none"] {
                let answer = ask(&caller(bad), &own);
                assert_eq!((answer.status, &answer.json()["code"]), (401, &json!("key_refused")), "{what}");
                assert!(!String::from_utf8_lossy(&answer.body).contains(bad), "{what}");
            }
            let lacking = if scope == "admin" { &b } else { &reader };
            if scope != "read" {
                let answer = ask(lacking, &own);
                assert_eq!((answer.status, &answer.json()["code"]), (403, &json!("insufficient_scope")), "{what}");
                assert!(answer.json()["detail"].as_str().unwrap().contains(scope), "{what}");
            }
            if scope == "admin" {
                continue;
            }
            let strangers: &[&Caller] = if scope == "read" { &[&reader, &b] } else { &[&b] };
            for stranger in strangers {
                let answer = ask(stranger, &own);
                let said = String::from_utf8_lossy(&answer.body).into_owned();
                if path.contains("{id}") {
                    assert_eq!(answer.status, 404, "{what}: {said}");
                    let nowhere = ask(stranger, &none);
                    // To the letter what is said of that which is not there.
                    let (id, other) = (own.split('/').nth(3).unwrap(), none.split('/').nth(3).unwrap());
                    assert_eq!(said, String::from_utf8_lossy(&nowhere.body).replace(other, id), "{what}");
                } else {
                    assert!(answer.status < 500, "{what}: {said}");
                    for part in things.ids().iter().chain(&["secret-name", "secret-sweep"]).filter(|_| method != "put")
                    {
                        assert!(!said.contains(part), "{what}: {said}");
                    }
                }
            }
        }
    }
    assert!(walked >= 45, "{walked} operations");

    // Nothing was changed, and whoever may sees it.
    for caller in [&a, &admin] {
        let job = caller.get(&format!("/v1/jobs/{}", things.job)).json();
        assert_eq!((&job["status"], &job["name"]), (&json!("succeeded"), &json!("secret-name")));
        assert_eq!(caller.get(&format!("/v1/sweeps/{}", things.sweep)).json()["total"], 2);
        assert_eq!(caller.get(&format!("/v1/assets/{}", things.asset)).body, TETRAHEDRON.as_bytes());
        for list in ["/v1/jobs", "/v1/sweeps", "/v1/assets", "/v1/scenes"] {
            let said = String::from_utf8_lossy(&caller.get(list).body).into_owned();
            assert!(things.ids().iter().any(|id| said.contains(id)), "{list}: {said}");
        }
        assert_eq!(caller.get(&format!("/v1/jobs/{}/thumbnail.png", things.job)).status, 200);
    }
}

#[test]
fn nothing_of_anothers_is_reached_by_naming_it() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (keys(dir.path(), &["create", "a"]), keys(dir.path(), &["create", "b"]));
    let server = Server::start(dir.path());
    let (a, b) = (Caller(&server, a), Caller(&server, b));
    let things = Things::of(&a);
    let refused = |body: Value, code: &str| {
        let answer = b.post("/v1/jobs", &body);
        assert_eq!((answer.status, &answer.json()["code"]), (422, &json!(code)), "{}", answer.json());
        answer.json()
    };
    refused(json!({ "scene_id": things.scene }), "invalid_request");
    refused(json!({ "scene": short(), "start_from": things.job }), "invalid_request");
    let faults = refused(json!({ "scene": of_asset(&things.asset) }), "invalid_scene");
    assert_eq!(faults["faults"][0]["code"], "unknown_asset", "{faults}");

    // The same bytes are new to the other, and then its own.
    assert_eq!(b.call("PUT", "/v1/assets", &[], TETRAHEDRON).status, 201);
    assert_eq!(b.call("PUT", "/v1/assets", &[], TETRAHEDRON).status, 200);
    b.run(&of_asset(&things.asset));
    assert_eq!(b.get("/v1/assets").json()["assets"].as_array().unwrap().len(), 1);
    // Neither a result nor an idempotency key is another's.
    let again = json!({ "scene": a.get(&format!("/v1/jobs/{}/scene", things.job)).json(), "reuse": true });
    let keyed: &[(&str, &str)] = &[JSON, ("idempotency-key", "k")];
    for caller in [&a, &b] {
        let answer = caller.call("POST", "/v1/jobs", keyed, again.to_string());
        let expected = if caller.1 == a.1 { 200 } else { 202 };
        assert_eq!(answer.status, expected, "{}", answer.json());
        let other = caller.call(
            "POST",
            "/v1/jobs",
            &[JSON, ("idempotency-key", &caller.1[3..13])],
            json!({ "scene": short() }).to_string(),
        );
        assert_eq!(other.status, 202);
    }
    // A state that becomes an upload is the key's who starts from it.
    let from = a.post(
        "/v1/jobs",
        &json!({ "scene": a.get(&format!("/v1/jobs/{}/scene", things.job)).json(), "start_from": things.job }),
    );
    assert_eq!(from.status, 202, "{}", from.json());
    assert_eq!(a.get("/v1/assets").json()["assets"].as_array().unwrap().len(), 2);
}

#[test]
fn quotas_are_kept_and_say_what_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let bounds = ["--max-queued", "2", "--max-particles", "100", "--max-bytes", "2000", "--max-device-seconds", "3600"];
    let secret = keys(dir.path(), &[&["create", "a"], &bounds[..]].concat());
    let server = Server::start(dir.path());
    let a = Caller(&server, secret);
    let refused = |answer: Answer, code: &str, parts: &[&str]| {
        let problem = answer.json();
        assert_eq!(problem["code"], code, "{problem}");
        let detail = problem["detail"].as_str().unwrap();
        assert!(parts.iter().all(|part| detail.contains(part)), "{detail}");
        answer.status
    };
    let mut fine = short();
    fine["domain"]["dx"] = json!(0.03125);
    for path in ["/v1/jobs", "/v1/scenes:validate"] {
        let status =
            refused(a.post(path, &json!({ "scene": fine })), "quota_exceeded", &["256 particles", "100", "coarsen"]);
        assert_eq!(status, 403);
    }
    let job = a.post("/v1/jobs", &json!({ "scene": endless() }));
    let running = job.header("location").to_owned();
    while a.get(&running).json()["status"] != "running" {
        std::thread::sleep(Duration::from_millis(20));
    }
    for _ in 0..2 {
        assert_eq!(a.post("/v1/jobs", &json!({ "scene": short() })).status, 202);
    }
    let answer = a.post("/v1/jobs", &json!({ "scene": short() }));
    assert!(!answer.header("retry-after").is_empty());
    assert_eq!(refused(answer, "queue_full", &["2 jobs of this key"]), 429);
    a.post(&format!("{running}/cancel"), &json!({}));
    // What has been left is measured, and no more may be added to it.
    let full = || a.get("/v1/usage").json()["keys"][0]["bytes"].as_u64().unwrap() > 2000;
    while !full() {
        std::thread::sleep(Duration::from_millis(100));
    }
    let answer = a.post("/v1/jobs", &json!({ "scene": short() }));
    assert_eq!(refused(answer, "quota_exceeded", &["bytes are kept", "2000", "delete jobs"]), 403);
    assert_eq!(refused(a.call("PUT", "/v1/assets", &[], TETRAHEDRON), "quota_exceeded", &["this upload"]), 403);
    let usage = a.get("/v1/usage").json();
    let used = &usage["keys"][0];
    assert!(used["device_s"].as_f64().unwrap() > 0.0 && used["jobs"] == 3, "{usage}");
    assert_eq!(used["key"]["quotas"]["particles"], 100);
    // Time on devices, once it is used up; more, and it goes on.
    keys(dir.path(), &["limit", "a", "--max-device-seconds", "1"]);
    std::thread::sleep(Duration::from_secs(4));
    let used = a.get("/v1/usage").json()["keys"][0]["device_s"].as_f64().unwrap();
    let answer = a.post("/v1/jobs", &json!({ "scene": short() }));
    if used >= 1.0 {
        assert_eq!(refused(answer, "quota_exceeded", &["30 days", "1 s may be"]), 403);
    } else {
        assert_eq!(answer.status, 202);
    }
    let shown: Value = serde_json::from_str(&keys(dir.path(), &["show", "a", "--json"])).unwrap();
    assert!(shown["used"]["device_s"].as_f64().unwrap() >= used && shown["quotas"]["device_s"] == 1, "{shown}");
}

#[test]
fn browsers_sign_in_by_a_cookie_that_no_page_reads() {
    let dir = tempfile::tempdir().unwrap();
    let secret = keys(dir.path(), &["create", "a"]);
    let server = Server::start(dir.path());
    let sign_in = |key: &str, headers: &[(&str, &str)]| {
        server.call("PUT", "/v1/session", &[&[JSON], headers].concat(), json!({ "key": key }).to_string())
    };
    assert_eq!(server.get("/v1/session").json(), json!({ "keys_required": true, "key": null }));
    assert_eq!(sign_in("gf_none", &[]).json()["code"], "key_refused");
    assert_eq!(sign_in(&secret, &[("origin", "https://evil.example")]).json()["code"], "foreign_origin");
    let answer = sign_in(&secret, &[]);
    assert_eq!((answer.status, &answer.json()["key"]["name"]), (200, &json!("a")));
    let cookie = answer.header("set-cookie").to_owned();
    for part in ["; HttpOnly", "; SameSite=Strict", "; Path=/"] {
        assert!(cookie.contains(part), "{cookie}");
    }
    assert!(!cookie.contains("Secure"), "it would not come back without TLS: {cookie}");
    let cookie = cookie.split(';').next().unwrap();
    let signed = |path: &str| server.call("GET", path, &[("cookie", cookie)], "");
    assert_eq!(signed("/v1/jobs").status, 200);
    assert_eq!(signed("/v1/jobs").header("cache-control"), "no-store");
    assert_eq!(signed("/v1/session").json()["key"]["scope"], "submit");
    let out = server.call("DELETE", "/v1/session", &[("cookie", cookie)], "");
    assert!(out.status == 204 && out.header("set-cookie").contains("Max-Age=0"));
    // Another secret, and the cookie is worth nothing.
    let other = keys(dir.path(), &["renew", "a"]);
    std::thread::sleep(Duration::from_secs(4));
    assert_eq!(signed("/v1/jobs").json()["code"], "key_refused");
    assert_eq!(Caller(&server, other).get("/v1/jobs").status, 200);
}

#[test]
fn a_server_asks_from_the_first_key_on_and_tells_who_did_what() {
    let dir = tempfile::tempdir().unwrap();
    let log = dir.path().join("log");
    let server =
        Server::start_logging(dir.path(), &["--log-format", "json"], Stdio::from(std::fs::File::create(&log).unwrap()));
    let before = server.submit(short());
    assert_eq!(server.get("/v1/usage").json()["keys"], json!([]));
    let secret = keys(dir.path(), &["create", "a"]);
    let asked = || server.get("/v1/jobs").status == 401;
    while !asked() {
        std::thread::sleep(Duration::from_millis(100));
    }
    let a = Caller(&server, secret.clone());
    assert_eq!(a.get(&before).status, 404, "what was nobody's is the operator's");
    let path = a.run(&short());
    assert_eq!(a.get(&path).json()["key"], a.get("/v1/session").json()["key"]["id"]);
    keys(dir.path(), &["revoke", "a"]);
    while a.get(&path).status != 401 {
        std::thread::sleep(Duration::from_millis(100));
    }
    let text = std::fs::read_to_string(&log).unwrap();
    assert!(!text.contains(&secret) && !text.contains(&secret[14..]), "the log has a secret");
    let lines: Vec<Value> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    let audit: Vec<&Value> = lines.iter().filter(|line| line["target"] == "audit").collect();
    let job = path.rsplit('/').next().unwrap();
    let has = |who: &str, method: &str, path: &str, job: &str, status: u16| {
        audit.iter().any(|line| {
            [("who", who), ("method", method), ("path", path), ("job", job)]
                .iter()
                .all(|(name, value)| line[*name] == **value)
                && line["status"] == status
        })
    };
    assert!(has("a", "POST", "/v1/jobs", job, 202), "{audit:#?}");
    assert!(has("a", "GET", &before, before.rsplit('/').next().unwrap(), 404), "{audit:#?}");
    assert!(has("nobody", "GET", "/v1/jobs", "", 401) && has("nobody", "GET", &path, job, 401), "{audit:#?}");
    drop(server);

    // It is open to other machines without --insecure-no-auth now, and not without keys.
    let open = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gridfall"));
        command.args(["serve", "--backend", "cpu", "--data-dir"]).arg(dir.path()).args(more);
        command
    };
    let mut child = open(&["--listen", "0.0.0.0:0"]).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut line = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(child.stdout.take().unwrap()), &mut line).unwrap();
    assert!(line.starts_with("listening on http://0.0.0.0:"), "{line}");
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn metrics_name_keys() {
    let dir = tempfile::tempdir().unwrap();
    let (a, admin) = (keys(dir.path(), &["create", "a"]), keys(dir.path(), &["create", "ops", "--scope", "admin"]));
    let server = Server::start_with(dir.path(), &["--require-keys"]);
    Caller(&server, a).run(&short());
    let text = String::from_utf8(Caller(&server, admin).get("/metrics").body).unwrap();
    assert!(text.contains("gridfall_key_jobs{key=\"a\",status=\"queued\"} 0"), "{text}");
    let seconds = text.lines().find_map(|line| line.strip_prefix("gridfall_key_device_seconds_total{key=\"a\"} "));
    assert!(seconds.unwrap().parse::<f64>().unwrap() >= 0.0);
    assert!(text.contains("gridfall_key_requests_total{key=\"a\"}"), "{text}");
}
