//! What the guide says of Docker, Prometheus and Grafana fits the files of the repository. Docker and Grafana
//! themselves are not at hand.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::guide::pages;

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// The blocks of a page that have a mark.
fn blocks(page: &str, mark: &str) -> Vec<String> {
    let (_, blocks) = pages().into_iter().find(|(name, _)| name == page).unwrap();
    blocks.into_iter().filter(|(known, _)| known == mark).map(|(_, code)| code).collect()
}

/// The argument of a line of the Dockerfile.
fn line(dockerfile: &str, word: &str) -> String {
    let mut found = dockerfile.lines().filter_map(|line| line.strip_prefix(word)).map(|rest| rest.trim().to_owned());
    found.next_back().unwrap_or_else(|| panic!("the Dockerfile has no {word}"))
}

fn gridfall(arguments: &[&str]) -> (bool, String) {
    let ran = Command::new(env!("CARGO_BIN_EXE_gridfall")).args(arguments).output().unwrap();
    (ran.status.success(), String::from_utf8_lossy(&ran.stdout).into_owned())
}

/// Files below a folder.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        match path.is_dir() {
            true => files(&path, found),
            false => found.push(path),
        }
    }
}

#[test]
fn the_image_is_built_of_all_that_the_program_is_built_of() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let ignored = read(".dockerignore");
    let kept: BTreeSet<&str> = ignored.lines().filter_map(|line| line.strip_prefix('!')).collect();
    assert!(ignored.starts_with("*\n") && kept.contains("Cargo.lock"), "{ignored}");
    let mut sources = Vec::new();
    files(&root.join("src"), &mut sources);
    let mut needed = BTreeSet::from(["src".to_owned()]);
    for path in sources.iter().filter(|path| path.extension().is_some_and(|end| end == "rs")) {
        let text = std::fs::read_to_string(path).unwrap();
        // What is included by a path of its own, and the folders that build scripts list.
        for included in
            ["include_str!(\"", "include_bytes!(\"", "include!(\""].iter().flat_map(|mark| text.split(mark).skip(1))
        {
            let mut place = path.parent().unwrap().to_owned();
            for part in Path::new(included.split('"').next().unwrap()).components() {
                match part {
                    Component::ParentDir => drop(place.pop()),
                    part => place.push(part),
                }
            }
            let inside = place.strip_prefix(root).unwrap_or_else(|_| panic!("{}: {}", path.display(), place.display()));
            needed.insert(inside.components().next().unwrap().as_os_str().to_str().unwrap().to_owned());
        }
        if path.ends_with("build.rs") {
            let named = ["files(\"", "\"../../"].into_iter().flat_map(|mark| text.split(mark).skip(1));
            let folders = named.filter_map(|rest| rest.split(['"', '/']).next()).filter(|name| !name.is_empty());
            needed.extend(folders.map(str::to_owned));
        }
    }
    assert!(needed.contains("docs") && needed.contains("wgsl"), "{needed:?}");
    for folder in needed {
        assert!(kept.contains(folder.as_str()), ".dockerignore keeps {folder} out of the build");
    }
}

#[test]
fn commands_of_docker_fit_the_dockerfile() {
    let dockerfile = read("Dockerfile");
    let (port, volume) = (line(&dockerfile, "EXPOSE"), line(&dockerfile, "VOLUME"));
    assert_eq!(line(&dockerfile, "ENTRYPOINT"), "[\"gridfall\"]");
    let command = line(&dockerfile, "CMD");
    assert!(command.contains(&format!("0.0.0.0:{port}")) && command.contains(&volume), "{command}");
    let command: Vec<String> = serde_json::from_str(&command).unwrap();
    let (ok, help) = gridfall(&[&command[0], "--help"]);
    assert!(ok && command.iter().filter(|word| word.starts_with("--")).all(|option| help.contains(option.as_str())));
    let page = blocks("docker", "console").concat() + &blocks("docker", "yaml compose").concat();
    let page = page.replace("\\\n", " ");
    let mut published = 0;
    for words in
        page.lines().map(|line| line.split(|c: char| c.is_whitespace() || "[]\",".contains(c)).collect::<Vec<_>>())
    {
        for word in &words {
            if let Some(inside) = word.strip_prefix("127.0.0.1:8080:") {
                assert_eq!(inside, port, "{word}");
                published += 1;
            }
            if let Some(inside) = word.strip_prefix("gridfall-data:").filter(|inside| !inside.is_empty()) {
                assert_eq!(inside, volume, "{word}");
            }
            if let Some(variable) = word.split(['=', ':']).next().filter(|name| name.starts_with("GRIDFALL_")) {
                assert!(variable == "GRIDFALL_COMMIT" || help.contains(&format!("[env: {variable}")), "{variable}");
            }
        }
        // What follows the image's name are arguments of the program.
        if words.first() == Some(&"docker") && words.get(1) == Some(&"run") {
            let at = words.iter().position(|word| *word == "gridfall").expect("an image is named");
            if let Some(command) = words.get(at + 1).filter(|word| !word.is_empty()) {
                assert!(gridfall(&[command, "--help"]).0, "gridfall has no command {command}");
            }
        }
    }
    assert!(published >= 3, "{page}");
    assert!(line(&dockerfile, "ENV NVIDIA").contains("graphics"));
}

#[test]
fn prometheus_takes_the_configuration_and_the_rules() {
    let folder = tempfile::tempdir().unwrap();
    let [configuration] = blocks("grafana", "yaml prometheus").try_into().expect("the page has one configuration");
    std::fs::write(folder.path().join("prometheus.yml"), configuration).unwrap();
    std::fs::write(folder.path().join("alerts.yml"), read("api/grafana/alerts.yml")).unwrap();
    let check = ["check", "config", "prometheus.yml"];
    let ran = Command::new("promtool").args(check).current_dir(folder.path()).output();
    let ran = ran.unwrap_or_else(|error| panic!("promtool: {error}; tests/run installs it"));
    let said = format!("{}{}", String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
    assert!(ran.status.success() && said.contains("7 rules found"), "{said}");
}

#[test]
fn the_page_of_grafana_knows_every_panel_and_every_alert() {
    let page = read("docs/guide/grafana.md");
    let dashboard: Value = serde_json::from_str(&read("api/grafana/gridfall.json")).unwrap();
    let rows: String = page.lines().filter(|line| line.starts_with('|')).collect::<Vec<_>>().join("\n");
    for panel in dashboard["panels"].as_array().unwrap() {
        let title = panel["title"].as_str().unwrap();
        let short = title.split(", ").next().unwrap();
        assert!(rows.contains(short), "docs/guide/grafana.md says nothing of the panel {title:?}");
    }
    let alerts = read("api/grafana/alerts.yml");
    let names: Vec<&str> = alerts.split("- alert: ").skip(1).map(|rest| rest.split('\n').next().unwrap()).collect();
    for name in &names {
        assert!(rows.contains(&format!("`{name}`")), "docs/guide/grafana.md says nothing of the alert {name}");
    }
    assert_eq!(names.len(), rows.matches("| `Gridfall").count(), "the page has other alerts than the rules");
}
