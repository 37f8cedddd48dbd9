//! What docs/TESTING.md claims to be compared: every program of the GPU engines, by tests that are
//! there.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use gridfall_engine::explicit::gpu as explicit;
use gridfall_engine::implicit::gpu::linear::stages as linear;
use gridfall_engine::implicit::gpu::stages as implicit;

const HEADING: &str = "## What is compared with what";

/// Names in backquotes.
fn quoted(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}

/// Programs and tests of the table's rows: a folder and files in it, …, tests as `module::name`.
fn claims(page: &str) -> (BTreeSet<String>, BTreeSet<String>) {
    let (_, section) = page.split_once(HEADING).expect(HEADING);
    let (mut programs, mut tests) = (BTreeSet::new(), BTreeSet::new());
    for row in section.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row.trim_matches('|').split('|').collect();
        let mut names = quoted(cells[0]);
        let folder = names.next().expect("rows begin with a name");
        programs.extend(names.map(|name| format!("{folder}{name}")));
        tests.extend(quoted(cells[cells.len() - 1]).map(String::from));
    }
    (programs, tests)
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// All tests of the engines, as `module::name`.
fn tests() -> BTreeSet<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = BTreeSet::new();
    for path in ["tests/twins", "src/engine"].iter().flat_map(|folder| files(&root.join(folder))) {
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        let module = path.file_stem().unwrap().to_string_lossy().into_owned();
        for part in text.split("#[test]").skip(1) {
            let name = part.split_once("fn ").and_then(|(_, rest)| rest.split_once('(')).expect("a function").0;
            found.insert(format!("{module}::{name}"));
        }
    }
    found
}

fn faults(page: &str) -> Vec<String> {
    let (claimed, by) = claims(page);
    let programs = [explicit::programs(), implicit::programs(), linear::programs()].concat();
    let programs: BTreeSet<String> = programs.into_iter().map(String::from).collect();
    let lacking = programs.difference(&claimed).map(|name| format!("{name} is compared with nothing"));
    let unknown = claimed.difference(&programs).map(|name| format!("there is no program {name}"));
    let known = tests();
    let gone = by.iter().filter(|name| !known.contains(*name)).map(|name| format!("there is no test {name}"));
    lacking.chain(unknown).chain(gone).collect()
}

#[test]
fn every_program_is_compared() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/TESTING.md")).unwrap();
    assert_eq!(faults(&page), [""; 0]);
    let planted = [
        (" `weigh`", "", "implicit/weigh is compared with nothing"),
        (" `weigh`", " `weigh` `weight`", "there is no program implicit/weight"),
        ("two_loop_recursion", "three_loop_recursion", "there is no test lbfgs::three_loop_recursion"),
    ];
    for (right, wrong, fault) in planted {
        assert_eq!(faults(&page.replace(right, wrong)), [fault]);
    }
}
