//! Lists the scenes of the library, so that they are in the program.

use std::fmt::Write;
use std::path::Path;

fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let folder = folder.canonicalize().expect("the repository has a folder of scenes");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed={}", folder.display());
    let entries = std::fs::read_dir(&folder).expect("the folder of scenes can be read");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("the folder can be read").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|end| end == "json"));
    paths.sort();
    let mut code = String::from("const SCENES: &[(&str, &str)] = &[\n");
    for path in paths {
        let name = path.file_stem().and_then(|name| name.to_str()).expect("names of scenes are plain");
        writeln!(code, "    ({name:?}, include_str!({path:?})),").expect("a string grows");
    }
    code.push_str("];\n");
    let out = std::env::var("OUT_DIR").expect("Cargo names a folder");
    std::fs::write(Path::new(&out).join("library.rs"), code).expect("Cargo's folder can be written");
}
