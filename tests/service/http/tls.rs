//! TLS, as curl sees it.

use std::fs;
use std::path::Path;
use std::process::Command;

use rcgen::generate_simple_self_signed;

use super::support::{Server, short};

/// A certificate for this machine, and its key.
fn certificate(folder: &Path) -> [String; 2] {
    let made = generate_simple_self_signed(["localhost".to_owned(), "127.0.0.1".to_owned()]).unwrap();
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let (chain, key) = (path("chain.pem"), path("key.pem"));
    fs::write(&chain, made.cert.pem()).unwrap();
    fs::write(&key, made.signing_key.serialize_pem()).unwrap();
    [chain, key]
}

fn curl(arguments: &[&str]) -> (bool, String) {
    let ran =
        Command::new("curl").args(["-sS", "--noproxy", "*", "--max-time", "60"]).args(arguments).output().unwrap();
    (ran.status.success(), String::from_utf8_lossy(&ran.stdout).into_owned() + &String::from_utf8_lossy(&ran.stderr))
}

#[test]
fn a_server_speaks_tls_and_tells_browsers_to_stay_with_it() {
    let dir = tempfile::tempdir().unwrap();
    let [chain, key] = certificate(dir.path());
    let secret = super::keys::keys(dir.path(), &["create", "a"]);
    let server = Server::start_with(dir.path(), &["--tls-cert", &chain, "--tls-key", &key]);
    assert!(server.url.starts_with("https://127.0.0.1:"), "{}", server.url);
    let trusted = ["--cacert", chain.as_str(), "-i"];
    let ask = |more: &[&str], path: &str| curl(&[&trusted, more, &[&format!("{}{path}", server.url)]].concat());
    let (_, answer) = ask(&[], "/livez");
    assert!(answer.starts_with("HTTP/1.1 200") && answer.contains("strict-transport-security: max-age="), "{answer}");
    assert!(!curl(&[&format!("{}/livez", server.url)]).0, "nobody knows who made the certificate");
    assert!(!curl(&[&server.url.replace("https", "http")]).0, "what is not TLS is not answered");

    let bearer = format!("authorization: Bearer {secret}");
    let body = dir.path().join("body.json");
    fs::write(&body, serde_json::json!({ "scene": short() }).to_string()).unwrap();
    let sent =
        ["-H", &bearer, "-H", "content-type: application/json", "--data-binary", &format!("@{}", body.display())];
    let (_, answer) = ask(&sent, "/v1/jobs");
    assert!(answer.starts_with("HTTP/1.1 202"), "{answer}");
    let job = answer.lines().find_map(|line| line.strip_prefix("location: ")).unwrap().trim().to_owned();
    // Streams, and files by ranges.
    let (_, events) = ask(&["-H", &bearer, "-N"], &format!("{job}/events"));
    assert!(events.contains("succeeded"), "{events}");
    let (_, part) = ask(&["-H", &bearer, "-r", "0-7", "-o", "/dev/null"], &format!("{job}/recording.mcap"));
    assert!(part.starts_with("HTTP/1.1 206") || part.is_empty(), "{part}");

    fs::write(&body, serde_json::json!({ "key": secret }).to_string()).unwrap();
    let (_, signed) = ask(&[&["-X", "PUT"], &sent[2..]].concat(), "/v1/session");
    assert!(signed.contains("; SameSite=Strict; Secure"), "{signed}");
}

#[test]
fn what_is_no_certificate_is_refused_with_the_option() {
    let dir = tempfile::tempdir().unwrap();
    let [chain, key] = certificate(dir.path());
    let other = tempfile::tempdir().unwrap();
    let [other_chain, _] = certificate(other.path());
    let serve = |chain: &str, key: &str| {
        let ran = Command::new(env!("CARGO_BIN_EXE_gridfall"))
            .args(["serve", "--listen", "127.0.0.1:0", "--backend", "cpu", "--data-dir"])
            .arg(dir.path())
            .args(["--tls-cert", chain, "--tls-key", key])
            .output()
            .unwrap();
        (ran.status.code(), String::from_utf8_lossy(&ran.stderr).into_owned())
    };
    for (chain, key, part) in [
        (key.as_str(), chain.as_str(), "--tls-cert"),
        (&chain, &chain, "--tls-key"),
        ("/nowhere.pem", &key, "/nowhere.pem"),
        (&other_chain, &key, "the key that it was made for"),
    ] {
        let (code, said) = serve(chain, key);
        assert!(code == Some(2) && said.contains(part), "{code:?} {said}");
    }
}
