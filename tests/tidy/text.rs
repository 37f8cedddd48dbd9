//! Rules about text: lengths of lines and files, opening comments, nothing unfinished or silenced,
//! scenes that say what they show.

use std::path::Path;

use super::{Source, caught, none, sources};

/// Maximum columns of a line of code, and of a line of Markdown.
const MAX_CODE: usize = 120;
const MAX_MARKDOWN: usize = 100;

/// Maximum lines of a source file. Beyond that, the file should be split.
const MAX_LINES: usize = 500;

/// Lines longer than `most`. Rows of Markdown tables cannot be wrapped.
fn long_lines(files: &[Source], most: usize) -> Vec<String> {
    let mut faults = Vec::new();
    for file in files {
        let tables = file.path.ends_with(".md");
        for (n, line) in file.text.lines().enumerate() {
            let columns = line.chars().count();
            if columns > most && !(tables && line.trim_start().starts_with('|')) {
                faults.push(format!("{}:{}: {columns} columns; {most} is the most", file.path, n + 1));
            }
        }
    }
    faults
}

fn long_files(files: &[Source]) -> Vec<String> {
    let long = |file: &&Source| file.text.lines().count() > MAX_LINES;
    files
        .iter()
        .filter(long)
        .map(|file| format!("{} has over {MAX_LINES} lines; look for the seam", file.path))
        .collect()
}

/// Files that do not begin with `mark`, a comment that says what they are.
fn without_opening(files: &[Source], mark: &str) -> Vec<String> {
    let silent = |file: &&Source| !file.text.starts_with(mark);
    files.iter().filter(silent).map(|file| format!("{} does not say what it is", file.path)).collect()
}

fn unfinished(files: &[Source]) -> Vec<String> {
    const MARKS: [&str; 5] = ["todo!(", "unimplemented!(", "#[ignore", "allow(dead_code", "FIXME"];
    let mut faults = Vec::new();
    // All but this file, which has to name them.
    for file in files.iter().filter(|file| !file.path.ends_with("tidy/text.rs")) {
        let found = MARKS.iter().filter(|mark| file.text.contains(**mark));
        faults.extend(found.map(|mark| format!("{} has {mark}", file.path)));
    }
    faults
}

fn code() -> Vec<Source> {
    [sources("src", "rs"), sources("tests", "rs"), sources("wgsl", "wgsl"), scripts()].concat()
}

/// The dashboard, and what uses it in a browser.
fn scripts() -> Vec<Source> {
    [sources("src", "js"), sources("tests/dashboard", "mjs")].concat()
}

#[test]
fn lines_of_code_fit_a_screen() {
    none(&long_lines(&[code(), sources("clients", "py")].concat(), MAX_CODE));
    let fault = Source::new("src/a.rs", &format!("//! A.\n// {}\n", "x".repeat(MAX_CODE)));
    caught(&long_lines(&[fault], MAX_CODE), &["src/a.rs:2", "123 columns"]);
}

#[test]
fn lines_of_markdown_fit_a_page() {
    let pages = ["README.md", "CONTRIBUTING.md", "clients/python/README.md"].map(|page| {
        let path = format!("{}/{page}", env!("CARGO_MANIFEST_DIR"));
        Source::new(page, &std::fs::read_to_string(path).unwrap())
    });
    none(&long_lines(&[pages.to_vec(), sources("docs", "md")].concat(), MAX_MARKDOWN));
    let table = format!("| {} |\n", "x".repeat(MAX_MARKDOWN));
    let fault = Source::new("docs/A.md", &format!("{table}{}\n", "x".repeat(MAX_MARKDOWN + 1)));
    caught(&long_lines(&[fault], MAX_MARKDOWN), &["docs/A.md:2", "101 columns"]);
}

/// Links of pages in `docs/` to files that are not below it, or not there. mdBook serves what is below only.
fn stray_links(files: &[Source]) -> Vec<String> {
    let mut faults = Vec::new();
    for file in files {
        let folder = file.path.rsplit_once('/').map_or("", |(folder, _)| folder);
        for link in file.text.split("](").skip(1).filter_map(|rest| rest.split([')', ' ']).next()) {
            let target = link.split('#').next().unwrap_or_default();
            if target.is_empty() || target.contains("://") || target.starts_with('/') {
                continue;
            }
            let mut place: Vec<&str> = folder.split('/').collect();
            for part in target.split('/') {
                match part {
                    ".." => place.truncate(place.len().saturating_sub(1)),
                    part => place.push(part),
                }
            }
            let there = Path::new(env!("CARGO_MANIFEST_DIR")).join(place.join("/")).is_file();
            if place.first() != Some(&"docs") || !there {
                faults.push(format!("{} links to {link}, which is no file of docs/", file.path));
            }
        }
    }
    faults
}

#[test]
fn pages_link_to_pages_and_pictures() {
    none(&stray_links(&sources("docs", "md")));
    let fault = |link: &str| stray_links(&[Source::new("docs/guide/a.md", &format!("See [it]({link})."))]);
    none(&fault("../NUMERICS.md#flow"));
    caught(&fault("../NUMBERS.md"), &["docs/guide/a.md", "../NUMBERS.md"]);
    caught(&fault("../../api/openapi.json"), &["no file of docs/"]);
}

#[test]
fn files_fit_a_head() {
    none(&long_files(&code()));
    caught(&long_files(&[Source::new("src/a.rs", &"\n".repeat(MAX_LINES + 1))]), &["src/a.rs"]);
}

#[test]
fn every_file_says_what_it_is() {
    none(&without_opening(&[sources("src", "rs"), sources("tests", "rs")].concat(), "//!"));
    none(&without_opening(&[sources("wgsl", "wgsl"), scripts()].concat(), "//"));
    none(&without_opening(&sources("clients/python/src", "py"), "\"\"\""));
    caught(&without_opening(&[Source::new("src/a.rs", "mod b;\n")], "//!"), &["src/a.rs"]);
}

#[test]
fn nothing_is_unfinished_or_silenced() {
    none(&unfinished(&[code(), sources("clients", "py")].concat()));
    caught(&unfinished(&[Source::new("src/a.rs", "fn a() { todo!() }")]), &["src/a.rs"]);
}

#[test]
fn every_scene_says_what_to_look_for() {
    let scenes = sources("scenes", "json");
    assert!(scenes.len() >= 7, "only {} scenes", scenes.len());
    for file in scenes {
        let scene: serde_json::Value = serde_json::from_str(&file.text).unwrap();
        let description = scene["description"].as_str().unwrap_or_default();
        assert!(description.len() > 20, "{} has no description", file.path);
        let name = file.path.trim_start_matches("scenes/").trim_end_matches(".json");
        assert_eq!(scene["name"].as_str(), Some(name), "{}", file.path);
    }
}
