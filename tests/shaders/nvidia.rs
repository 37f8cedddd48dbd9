//! The table of NVIDIA's compiler, which is too large for every test run: each row carries a hash
//! of what it was made from.

use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::process::Command;
use std::sync::Arc;

use sha2::{Digest, Sha256};

use crate::compare::missing;
use crate::compile::{Compiled, Module, distinct};
use crate::table::{Row, parse, part, render, rows, with_part};
use crate::tools::{beside, installed, output};

/// The part of the document.
const PART: &str = "nvidia";

const ARCHITECTURES: [Architecture; 2] = [
    Architecture { name: "sm_80", shared_bytes: 164 * 1024 },
    Architecture { name: "sm_90", shared_bytes: 228 * 1024 },
];

/// Shared memory that the system takes of each workgroup.
const SYSTEM_BYTES: u64 = 1024;

/// A compute capability and what its multiprocessors have. Both have 65,536 registers, 64 warps and 32 workgroups.
struct Architecture {
    name: &'static str,
    shared_bytes: u64,
}

impl Architecture {
    /// Warps that a multiprocessor can hold at once.
    fn warps(&self, registers: u64, shared: u64, lanes: u64) -> u64 {
        let warps = lanes.div_ceil(32);
        // A warp gets registers in steps of 256 from one of four files; a workgroup's shared memory
        // has the system's too.
        let by_registers = 4 * (65_536 / 4 / (32 * registers).next_multiple_of(256)) / warps;
        let by_shared = self.shared_bytes / (shared + SYSTEM_BYTES);
        by_registers.min(by_shared).min(64 / warps).min(32) * warps
    }
}

fn heads() -> Vec<String> {
    let own =
        |a: &Architecture| ["instructions", "registers", "stack B", "warps"].map(|what| format!("{} {what}", a.name));
    ["shared B".to_string()].into_iter().chain(ARCHITECTURES.iter().flat_map(own)).collect()
}

/// 12 hexadecimal digits of HLSL.
fn hash<'a>(modules: impl Iterator<Item = &'a Module>) -> String {
    let texts: BTreeSet<&str> = modules.map(|module| module.hlsl.as_str()).collect();
    let sha = texts.iter().fold(Sha256::new(), |sha, text| sha.chain_update(text));
    sha.finalize().iter().take(6).map(|byte| format!("{byte:02x}")).collect()
}

/// Of today's shaders of a row.
fn todays(row: &Row, all: &[Compiled]) -> Option<String> {
    Some(hash(all.iter().filter(|c| row.covers(&c.name)).map(|c| &*c.module)))
}

/// What the table says of shaders that are no longer those of today.
pub fn faults(document: &str, all: &[Compiled]) -> Result<Vec<String>, String> {
    let table = parse(part(document, PART)?, heads().len())?;
    let mut faults = missing(&table, all.iter().map(|c| c.name.as_str()));
    let stale = table.iter().filter(|row| row.hash != todays(row, all));
    faults.extend(stale.map(|row| format!("{}: has changed since", row.label())));
    Ok(faults)
}

/// The document with a table of today's shaders. Rows that still hold are kept, unless another compiler made them.
pub fn update(document: &str, all: &'static [Compiled]) -> Result<String, String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let versions = measure(&[])?.0;
    let old = part(document, PART)?;
    let kept = if old.contains(&versions) { parse(old, heads().len())? } else { vec![] };
    // A row holds for its programs while they are the same, and for any program by another name.
    let known = |name: &str, module: &Module| {
        let own = Some(hash([module].into_iter()));
        let holds = |row: &&Row| row.hash == own || row.covers(name) && row.hash == todays(row, all);
        kept.iter().find(holds).map(|row| row.figures.clone())
    };
    let new: Vec<_> = distinct(all).into_iter().filter(|(name, module)| known(name, module).is_none()).collect();
    let mut files = Vec::new();
    for (k, (_, module)) in new.iter().enumerate() {
        files.push(folder.path().join(format!("{k}.hlsl")).to_string_lossy().into_owned());
        fs::write(&files[k], &module.hlsl).map_err(|e| e.to_string())?;
    }
    println!("{} of {} modules are new to the table", new.len(), distinct(all).len());
    let measured: HashMap<*const Module, Vec<u64>> = if new.is_empty() {
        HashMap::new()
    } else {
        let lines = measure(&files)?.1;
        new.iter().zip(lines).map(|((_, module), line)| (*module as *const Module, figures(module, &line))).collect()
    };

    let of = |c: &Compiled| known(&c.name, &c.module).unwrap_or_else(|| measured[&Arc::as_ptr(&c.module)].clone());
    let mut table = rows(all.iter().map(|c| (c.name.clone(), of(c))));
    for row in &mut table {
        row.hash = todays(row, all);
    }
    let architectures = ARCHITECTURES.map(|a| a.name).join(" and ");
    let text = format!("Compiled by {versions} for {architectures}.\n\n{}", render(&heads(), &table));
    with_part(document, PART, &text)
}

/// In the order of [`heads`].
fn figures(module: &Module, line: &serde_json::Value) -> Vec<u64> {
    let number = |a: &Architecture, what: &str| line[a.name][what].as_u64().expect("a number of each kind");
    let shared = |a: &Architecture| number(a, "shared").saturating_sub(SYSTEM_BYTES);
    let own = |a: &Architecture| {
        let registers = number(a, "registers");
        let warps = a.warps(registers, shared(a), module.lanes);
        [number(a, "instructions"), registers, number(a, "stack"), warps]
    };
    let shared = ARCHITECTURES.iter().map(shared).max();
    shared.into_iter().chain(ARCHITECTURES.iter().flat_map(own)).collect()
}

/// The compiler's versions, and a line of JSON for each file of HLSL.
fn measure(files: &[String]) -> Result<(String, Vec<serde_json::Value>), String> {
    let mut command = Command::new("python3");
    command
        .arg(beside("sass.py"))
        .arg(installed().join("nvidia"))
        .arg(ARCHITECTURES.map(|a| a.name).join(","))
        .args(files);
    let said = output(&mut command, "install Python 3")?;
    let mut lines = said.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON"));
    let versions = lines.next().and_then(|line| Some(line["versions"].as_str()?.to_string()));
    Ok((versions.ok_or("no versions")?, lines.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn occupancy_is_that_of_the_programming_guide() {
        let [a100, h100] = &ARCHITECTURES;
        assert_eq!(h100.warps(32, 0, 128), 64);
        assert_eq!(h100.warps(95, 21_924, 128), 20);
        assert_eq!(a100.warps(32, 21_924, 128), 28, "7 workgroups by shared memory");
        assert_eq!(a100.warps(255, 0, 32), 8);
    }

    #[test]
    fn a_changed_shader_makes_its_row_stale() {
        let program = |name: &str, hlsl: &str| {
            let module = Module { spirv: vec![], hlsl: hlsl.into(), bindings: vec![], lanes: 64 };
            Compiled { name: name.into(), module: Arc::new(module) }
        };
        let mut all = [program("a/one compact", "1"), program("a/one quadratic", "2"), program("a/two", "3")];
        let figures = vec![1; heads().len()];
        let mut table = rows(all.iter().map(|c| (c.name.clone(), figures.clone())));
        table.iter_mut().for_each(|row| row.hash = todays(row, &all));
        let document = format!("<!-- nvidia -->\n{}<!-- end of nvidia -->\n", render(&heads(), &table));
        assert_eq!(faults(&document, &all).unwrap(), Vec::<String>::new());
        all[1] = program("a/one quadratic", "changed");
        assert_eq!(faults(&document, &all).unwrap(), ["a/one: has changed since"]);
    }
}
