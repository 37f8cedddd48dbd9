//! Puts the shaders into the binary: writes a table of the files of `wgsl/`, for `gpu/source.rs`.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    // Asked when it runs: checkouts that share a target directory share the program, too.
    let here = env::var("CARGO_MANIFEST_DIR").expect("Cargo sets it");
    let root = Path::new(&here).join("../../wgsl").canonicalize()?;
    println!("cargo::rerun-if-changed={}", root.display());
    let mut files = Vec::new();
    list(&root, &mut files)?;
    files.sort();
    let mut table = String::from("[\n");
    for path in files {
        let name = path.strip_prefix(&root).expect("below the root").with_extension("");
        // The same on every system.
        let name = name.to_str().expect("plain names").replace('\\', "/");
        table += &format!("({name:?}, include_str!({path:?})),\n");
    }
    table += "]";
    fs::write(Path::new(&env::var("OUT_DIR").expect("Cargo sets it")).join("wgsl.rs"), table)
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            list(&path, files)?;
        } else if path.extension().is_some_and(|extension| extension == "wgsl") {
            files.push(path);
        }
    }
    Ok(())
}
