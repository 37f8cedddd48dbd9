//! The pages of the guide, and what runs their commands.
//!
//! Blocks are marked: `sh` and `python` run in order, `sh server` runs beside the others to the end of the page, `json
//! patch` is merged into the quickstart scene, `json shape` and `json material` stand in it (`reference`), `yaml` is
//! for other programs (`containers`), `console` is for machines that the tests do not have.

use std::fmt::Write;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;

pub const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Name of a page, and its blocks with what they are marked as.
pub type Page = (String, Vec<(String, String)>);

pub fn pages() -> Vec<Page> {
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(Path::new(ROOT).join("docs/guide")).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|end| end == "md"));
    paths.sort();
    paths
        .iter()
        .map(|path| {
            let text = std::fs::read_to_string(path).unwrap();
            let block = |part: &str| {
                let (mark, code) = part.split_once('\n').unwrap();
                (mark.trim().to_owned(), code.to_owned())
            };
            let blocks = text.split("```").skip(1).step_by(2).map(block).collect();
            (path.file_stem().unwrap().to_str().unwrap().to_owned(), blocks)
        })
        .collect()
}

/// A page's commands as one script for bash.
fn script(blocks: &[(String, String)]) -> String {
    let mut script = String::from("set -euo pipefail\ntrap 'kill $(jobs -p) 2>/dev/null || true; wait' EXIT\n");
    for (mark, code) in blocks {
        let _ = match mark.as_str() {
            "sh" => writeln!(script, "{code}"),
            "sh server" => writeln!(
                script,
                "{} &\nuntil curl -sf localhost:8080/readyz >/dev/null; do sleep 0.1; done",
                code.trim()
            ),
            "python" => writeln!(script, "\"$GUIDE_PYTHON\" - <<'END'\n{code}END"),
            "console" | "json patch" | "json shape" | "json material" | "yaml prometheus" | "yaml compose" => continue,
            other => panic!("a block is marked {other:?}, which tests/common/guide.rs does not know"),
        };
    }
    // Ports of the server, and of what it talks to.
    for port in ["8080", "8081"] {
        let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        script = script.replace(port, &free.to_string());
    }
    script
}

/// The interpreter that has what the Python package needs.
fn python() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("python/bin/python")
}

/// Installs the Python package into a folder of its own.
pub fn install_package(folder: &Path) {
    let build = "cd \"$1\" && \"$0\" -m flit_core.wheel --outdir \"$2\" . && \
        \"$0\" -m pip install -q --no-index --no-deps --target \"$2\" \"$2\"/*.whl";
    let client = Path::new(ROOT).join("clients/python");
    let ran = Command::new("bash").args(["-c", build]).arg(python()).arg(client).arg(folder).output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
}

/// Runs a page's commands, with more environment. Returns false if it has none.
pub fn run(name: &str, blocks: &[(String, String)], package: &Path, environment: &[(&str, &str)]) -> bool {
    if !blocks.iter().any(|(mark, _)| mark.starts_with("sh") || mark == "python") {
        return false;
    }
    let script = script(blocks);
    let folder = tempfile::tempdir().unwrap();
    // What a reader has who has cloned the repository.
    std::os::unix::fs::symlink(Path::new(ROOT).join("deploy"), folder.path().join("deploy")).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_gridfall"));
    let (programs, python) = (program.parent().unwrap(), python());
    let interpreters = python.parent().unwrap();
    let path = format!("{}:{}:{}", programs.display(), interpreters.display(), std::env::var("PATH").unwrap());
    let ran = Command::new("bash")
        .args(["-c", &script])
        .current_dir(folder.path())
        .env("PATH", path)
        .env("GRIDFALL_BINARY", program)
        .env("GUIDE_PYTHON", &python)
        .env("PYTHONPATH", package)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .envs(environment.iter().copied())
        .output()
        .unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
    println!("== {name}\n{said}");
    assert!(ran.status.success(), "docs/guide/{name}.md: {}\n{said}\n{script}", ran.status);
    true
}
