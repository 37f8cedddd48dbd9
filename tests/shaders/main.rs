//! The compilers of real GPUs see every shader, and docs/SHADERS.md says what they made of it.

mod compare;
mod compile;
mod device;
mod nvidia;
mod programs;
mod radv;
mod table;
mod tools;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use compare::{Column, Rule};
use compile::{compiled, distinct};
use radv::{FAMILIES, Report};

fn document() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/SHADERS.md")
}

fn read() -> String {
    fs::read_to_string(document()).expect("docs/SHADERS.md")
}

/// Replaces the document at once: another test may be reading it.
fn write(text: &str) {
    let path = document();
    let new = path.with_extension("new");
    fs::write(&new, text).and_then(|()| fs::rename(new, path)).expect("docs/ can be written");
}

/// What is to be written instead of compared: "nvidia" for its table, anything else for RADV's.
fn updating() -> Option<String> {
    std::env::var("GRIDFALL_UPDATE").ok().filter(|what| !what.is_empty())
}

#[test]
fn every_module_is_valid_spirv() {
    let faults = tools::spirv_val(distinct(compiled()));
    assert!(faults.is_empty(), "spirv-val refuses\n{}", faults.join("\n"));
}

#[test]
fn tint_accepts_every_shader() {
    if let Err(faults) = tools::tint(&programs::programs()) {
        panic!("Tint refuses\n{faults}");
    }
}

fn columns() -> Vec<Column> {
    let mut columns = vec![Column::new("workgroup B", Rule::Within(0))];
    for family in FAMILIES {
        let column = |what: &str, rule| Column::new(format!("{} {what}", family.title), rule);
        columns.push(column("instructions", Rule::Part(0.1)));
        columns.push(column("VGPRs", Rule::Within(family.register_step)));
        columns.push(column("waves", Rule::Shown));
    }
    columns
}

/// Every program's figures, in the order of the columns.
fn figures(reports: &[Report]) -> Vec<(String, Vec<u64>)> {
    let of = |name: &String| {
        let own = reports.iter().map(|report| report.figures[name]);
        let bytes = own.clone().map(|f| f.workgroup_bytes).max().into_iter();
        bytes.chain(own.flat_map(|f| [f.instructions, f.registers, f.waves])).collect()
    };
    compiled().iter().map(|c| (c.name.clone(), of(&c.name))).collect()
}

#[test]
fn radv_spills_nothing_and_makes_of_every_shader_what_the_table_says() {
    let reports = radv::reports(compiled()).unwrap_or_else(|e| panic!("{e}"));
    let (today, columns, driver) = (figures(&reports), columns(), &reports[0].driver);
    if updating().is_some_and(|what| what != "nvidia") {
        let heads: Vec<String> = columns.iter().map(|c| c.head.clone()).collect();
        let text = format!("Compiled by RADV of {driver}.\n\n{}", table::render(&heads, &table::rows(today.clone())));
        write(&table::with_part(&read(), "radv", &text).unwrap());
    }

    let mut faults: Vec<String> =
        reports.iter().zip(&FAMILIES).flat_map(|(report, family)| radv::faults(report, family.title)).collect();
    let document = read();
    let kept = table::part(&document, "radv").unwrap();
    let same = kept.contains(&format!("RADV of {driver}."));
    let columns = if same { columns } else { columns.iter().map(Column::loosened).collect() };
    if !same {
        // Not by a macro, whose output a test that passes would hide.
        let note = format!("{driver} is not the table's: only instructions are compared, within 30 %\n");
        std::io::stderr().write_all(note.as_bytes()).unwrap();
    }
    faults.extend(compare::faults(&columns, &table::parse(kept, columns.len()).unwrap(), &today));
    assert!(
        faults.is_empty(),
        "{}\nSpills and scratch memory must go. If the rest is meant: GRIDFALL_UPDATE=1 tests/run --test shaders",
        faults.join("\n")
    );
}

#[test]
fn the_nvidia_table_is_of_todays_shaders() {
    if updating().is_some_and(|what| what == "nvidia") {
        write(&nvidia::update(&read(), compiled()).unwrap_or_else(|e| panic!("{e}")));
    }
    let faults = nvidia::faults(&read(), compiled()).unwrap();
    assert!(
        faults.is_empty(),
        "the NVIDIA table of docs/SHADERS.md is not of today's shaders\n{}\nRun tests/shaders/nvidia (no GPU needed).",
        faults.join("\n")
    );
}
