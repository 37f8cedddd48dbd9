//! Tells the crate its target and, in release builds from a git checkout, its commit.

use std::process::Command;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=GRIDFALL_COMMIT");
    println!("cargo:rustc-env=GRIDFALL_TARGET={}", std::env::var("TARGET").unwrap());
    println!("cargo:rustc-env=GRIDFALL_COMMIT={}", commit().unwrap_or_else(|| "unknown".into()));
}

/// `GRIDFALL_COMMIT` if set (images are built without `.git`), otherwise what git says. Development
/// builds do not ask git, because they would be rebuilt after every commit.
fn commit() -> Option<String> {
    if let Ok(commit) = std::env::var("GRIDFALL_COMMIT") {
        return Some(commit);
    }
    if std::env::var("PROFILE").ok()? != "release" {
        return None;
    }
    println!("cargo:rerun-if-changed={}", git(&["rev-parse", "--git-path", "logs/HEAD"])?);
    git(&["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"])
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
