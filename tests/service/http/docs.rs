//! Pages for people are in the binary, and lead to each other.

use super::support::Server;

#[test]
fn the_page_of_error_codes_in_the_repository_is_current() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/ERRORS.md");
    let kept = std::fs::read_to_string(path).unwrap();
    let current = gridfall_service::http::error_codes();
    assert!(kept == current, "docs/ERRORS.md is out of date: run `gridfall schema errors > docs/ERRORS.md`");
}

#[test]
fn every_problem_leads_to_its_explanation() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let problem = server.get("/v1/jobs/7").json();
    let (page, anchor) = problem["type"].as_str().unwrap().split_once('#').unwrap();
    let answer = server.get(page);
    assert!(answer.header("content-type").starts_with("text/html"));
    let text = String::from_utf8(answer.body).unwrap();
    assert!(text.contains(&format!("<dt id=\"{anchor}\">")), "{anchor}");
    let body = text.split("</style>").nth(1).unwrap();
    assert!(!body.contains('{'), "something was not filled in: {body}");
}

/// All that a page loads.
fn links(page: &str) -> Vec<String> {
    let marks = ["src=\"", "href=\""];
    let quoted = marks.iter().flat_map(|mark| page.split(mark).skip(1).filter_map(|rest| rest.split('"').next()));
    quoted.map(str::to_owned).collect()
}

#[test]
fn the_reference_needs_no_network() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    assert_eq!(server.get("/docs").header("location"), "/docs/");
    let page = server.get("/docs/");
    assert_eq!(page.status, 200);
    let loaded = links(&String::from_utf8(page.body).unwrap());
    assert!(loaded.len() >= 3, "{loaded:?}");
    for link in loaded {
        let path = format!("/docs/{}", link.trim_start_matches("./"));
        let answer = server.get(&path);
        assert_eq!(answer.status, 200, "{link} is not on this server");
        assert!(!answer.body.is_empty(), "{link}");
    }
    let start = String::from_utf8(server.get("/docs/swagger-initializer.js").body).unwrap();
    assert!(start.contains("/openapi.json") && !start.contains("http://") && !start.contains("https://"), "{start}");
}

/// The sources below a folder, in one text.
fn sources(folder: &std::path::Path, text: &mut String) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        match entry.is_dir() {
            true => sources(&entry, text),
            false if entry.extension().is_some_and(|end| end == "rs") => {
                *text += &std::fs::read_to_string(&entry).unwrap();
            }
            false => {}
        }
    }
}

#[test]
fn every_way_to_fail_is_explained() {
    let page = gridfall_service::http::error_codes();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut service, engine) = (String::new(), std::fs::read_to_string(root.join("src/engine/contract.rs")).unwrap());
    sources(&root.join("src/service"), &mut service);
    let arms = engine.split("fn code(").nth(1).unwrap().split("\n    }\n").next().unwrap();
    let made = service.split("Failure::new(").skip(1).filter_map(|rest| rest.trim_start().strip_prefix('"'));
    // The store fails jobs whose deadline has passed in one statement.
    let stored = service.split("failure_code = '").skip(1).filter_map(|rest| rest.split('\'').next());
    let codes = made.chain(arms.split("=> \"").skip(1)).filter_map(|rest| rest.split('"').next()).chain(stored);
    let codes: std::collections::BTreeSet<&str> = codes.filter(|code| *code != "canceled").collect();
    assert!(codes.len() >= 8, "{codes:?}");
    for code in codes {
        assert!(page.contains(&format!("### failure: {code}\n")), "{code} is not on the page; see http/docs/advice.rs");
    }
}

#[test]
fn the_dashboard_shows_metrics_that_there_are() {
    let dir = tempfile::tempdir().unwrap();
    let server = Server::start(dir.path());
    let job = server.submit(super::support::short());
    server.wait_for(&job, "succeeded");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/api/grafana/gridfall.json");
    let dashboard = std::fs::read_to_string(path).unwrap();
    serde_json::from_str::<serde_json::Value>(&dashboard).unwrap();
    let name = |rest: &str| rest.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').next().unwrap().to_owned();
    let shown: std::collections::BTreeSet<String> = dashboard.split("gridfall_").skip(1).map(name).collect();
    assert!(shown.len() >= 6, "{shown:?}");
    // The worker counts a job just after its end can be seen.
    let has =
        |name: &String| String::from_utf8(server.get("/metrics").body).unwrap().contains(&format!("gridfall_{name}"));
    // Where there is no GPU, nothing is taken of one.
    for metric in shown.iter().filter(|metric| *metric != "device_memory_bytes") {
        let found = (0..100).any(|_| {
            has(metric) || {
                std::thread::sleep(std::time::Duration::from_millis(50));
                false
            }
        });
        assert!(found, "there is no metric gridfall_{metric}");
    }
}
