//! Lists the scenes of the library and the pages of the guide, so that they are in the program.

use std::fmt::Write;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let scenes = files("scenes", &["json"]);
    let stem = |path: &Path| path.file_stem().and_then(|name| name.to_str()).expect("names are plain").to_owned();
    let scenes = scenes.iter().filter(|(name, _)| !name.contains('/')).map(|(_, path)| (stem(path), path));
    write("library.rs", &list("SCENES", "&str", "include_str", scenes));

    let pages = files("docs", &["md"]);
    let pictures = files("docs", &["png", "svg"]);
    let named = |files: &'static [(String, PathBuf)]| files.iter().map(|(name, path)| (name.clone(), path));
    let (pages, pictures) = (pages.leak(), pictures.leak());
    let code = list("PAGES", "&str", "include_str", named(pages))
        + &list("PICTURES", "&[u8]", "include_bytes", named(pictures));
    write("guide.rs", &code);
}

/// The files below a folder of the repository that end in one of these ways, by their paths in it, sorted.
fn files(folder: &str, ends: &[&str]) -> Vec<(String, PathBuf)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(folder);
    let root = root.canonicalize().unwrap_or_else(|error| panic!("the repository has a folder {folder}: {error}"));
    let (mut found, mut folders) = (Vec::new(), vec![root.clone()]);
    while let Some(folder) = folders.pop() {
        println!("cargo:rerun-if-changed={}", folder.display());
        for entry in std::fs::read_dir(&folder).expect("the folder can be read") {
            let path = entry.expect("the folder can be read").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| ends.iter().any(|known| *known == end)) {
                let name = path.strip_prefix(&root).expect("it is below").to_str().expect("names are plain").to_owned();
                found.push((name, path));
            }
        }
    }
    found.sort();
    found
}

/// A constant with names and contents of files.
fn list<'a>(constant: &str, kind: &str, include: &str, files: impl Iterator<Item = (String, &'a PathBuf)>) -> String {
    let mut code = format!("const {constant}: &[(&str, {kind})] = &[\n");
    for (name, path) in files {
        writeln!(code, "    ({name:?}, {include}!({path:?})),").expect("a string grows");
    }
    code + "];\n"
}

fn write(name: &str, code: &str) {
    let out = std::env::var("OUT_DIR").expect("Cargo names a folder");
    std::fs::write(Path::new(&out).join(name), code).expect("Cargo's folder can be written");
}
