//! Compilers that are programs of their own: `spirv-val`, and Tint, the WGSL front end of Chrome.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::compile::Module;
use crate::programs::Program;

/// Where tests/run and tests/shaders/nvidia install what is no part of the system.
pub fn installed() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("it is in the target directory").join("shaders")
}

/// A file of this test.
pub fn beside(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/shaders").join(name)
}

/// Runs a command that must succeed; its standard output. Errors have all that it said, or what would provide it.
pub fn output(command: &mut Command, remedy: &str) -> Result<String, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let ran = command.output().map_err(|e| format!("{name}: {e}; {remedy}"))?;
    let text = String::from_utf8_lossy(&ran.stdout).into_owned();
    if ran.status.success() {
        return Ok(text);
    }
    Err(format!("{}{}{name}: {}", text, String::from_utf8_lossy(&ran.stderr), ran.status))
}

/// What `spirv-val` has against modules, by name.
pub fn spirv_val<'a>(modules: impl IntoIterator<Item = (&'a str, &'a Module)>) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("module.spv");
    let check = |(name, module): (&str, &Module)| {
        let bytes: Vec<u8> = module.spirv.iter().flat_map(|word| word.to_le_bytes()).collect();
        fs::write(&path, bytes).expect("room for a module");
        let mut command = Command::new("spirv-val");
        command.args(["--target-env", "vulkan1.3"]).arg(&path);
        output(&mut command, "tests/run installs it (spirv-tools)").err().map(|e| format!("{name}: {e}"))
    };
    modules.into_iter().filter_map(check).collect()
}

/// What Tint has against programs. It is not given constants (its null device has too small limits
/// for pipelines), so programs that differ only in those are one.
pub fn tint(programs: &[Program]) -> Result<(), String> {
    let sources: BTreeMap<&str, &str> = programs.iter().rev().map(|p| (p.wgsl.as_str(), p.name.as_str())).collect();
    let sources: Vec<_> =
        sources.iter().map(|(wgsl, name)| serde_json::json!({ "name": name, "wgsl": wgsl })).collect();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("programs.json");
    fs::write(&path, serde_json::to_vec(&sources).expect("plain text")).expect("room for the sources");
    let mut command = Command::new("node");
    command.arg(beside("tint.mjs")).arg(installed().join("tint")).arg(&path);
    output(&mut command, "tests/run installs it (nodejs)").map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::compile;

    fn program(body: &str) -> Program {
        let wgsl = format!(
            "@group(0) @binding(0) var<storage, read_write> a: array<u32>;\nvar<workgroup> n: u32;\n\
             @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {{ {body} }}"
        );
        Program { name: "planted".into(), wgsl, constants: vec![], checked: true }
    }

    #[test]
    fn spirv_val_refuses_an_invalid_module() {
        let mut module = compile(&program("a[i] = n;")).unwrap();
        assert_eq!(spirv_val([("sound", &module)]), Vec::<String>::new());
        // The last instruction is the function's end.
        module.spirv.pop();
        let faults = spirv_val([("planted", &module)]);
        assert!(faults.len() == 1 && faults[0].starts_with("planted: ") && faults[0].contains("error"), "{faults:?}");
    }

    #[test]
    fn tint_refuses_a_barrier_that_not_all_lanes_reach() {
        tint(&[program("let end = workgroupUniformLoad(&n); for (var k = 0u; k < end; k++) { workgroupBarrier(); }")])
            .unwrap();
        let planted = program("for (var k = 0u; k < n; k++) { workgroupBarrier(); }");
        assert!(compile(&planted).is_ok(), "naga does not see it");
        let fault = tint(&[planted]).unwrap_err();
        assert!(fault.contains("planted") && fault.contains("uniform control flow"), "{fault}");
    }
}
