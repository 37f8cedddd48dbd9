//! Clients that generators make of the OpenAPI document do what users do; linters find no error in it. So does the
//! Python client of the project.

use std::path::Path;
use std::process::Command;

use super::assets::mesh;
use super::support::{Server, endless, short};

#[test]
fn generated_clients_do_what_users_do() {
    let (data, work) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let server = Server::start(data.path());
    let file = |name: &str, text: Vec<u8>| std::fs::write(work.path().join(name), text).unwrap();
    file("openapi.json", server.get("/openapi.json").body);
    let walled = |mut scene: serde_json::Value| {
        scene["domain"]["boundary"] =
            serde_json::json!({ "x": "periodic", "y-": { "contact": "separate", "friction": 0.3 } });
        // Clients know both ways to write a material.
        scene["materials"]["known"] = serde_json::json!({ "preset": "water", "viscosity": 0.01 });
        scene.to_string().into_bytes()
    };
    file("scene.json", walled(short()));
    file("endless.json", walled(endless()));
    file("mesh.obj", mesh(0.25).into_bytes());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients/run");
    let tools = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("clients");
    let ran = Command::new(script).arg(tools).arg(&server.url).arg(work.path()).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
    println!("{said}");
    assert!(ran.status.success(), "{said}");
}

#[test]
fn the_python_client_does_what_users_do() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("clients/python/tests/run");
    let tools = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("python");
    let ran = Command::new(script).arg(tools).env("GRIDFALL_BINARY", env!("CARGO_BIN_EXE_gridfall")).output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
    println!("{said}");
    assert!(ran.status.success(), "{said}");
}
