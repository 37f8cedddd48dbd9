//! `gridfall verify --quick` as a test: every case on the CPU, and one on the software GPU.

use gridfall::verify::{self as cases, CASES, Extent, Target};
use gridfall_engine::choice::{Choice, Devices};

fn passes(name: &str, devices: &Devices, target: Target) {
    let case = CASES.iter().find(|case| case.name == name).unwrap();
    let outcome = cases::run(case, devices, &[target], Extent::Quick, &|line| println!("{line}"));
    assert!(!outcome.rows.is_empty(), "{name} reports nothing");
    let failed: Vec<_> = outcome.rows.iter().filter(|row| !row.pass).collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
fn every_case_passes_on_the_cpu() {
    let devices = Devices::open(Choice::Cpu, None).unwrap();
    for case in CASES.iter().filter(|case| case.quick) {
        passes(case.name, &devices, Target::Cpu);
    }
}

#[test]
fn a_case_passes_on_the_gpu() {
    // A missing driver is a failure, not a skip (see tests/run).
    let adapter = std::env::var("GRIDFALL_TEST_ADAPTER").unwrap_or_else(|_| "llvmpipe".into());
    let devices = Devices::open(Choice::Gpu, Some(&adapter)).unwrap();
    passes("free-fall", &devices, Target::Gpu);
}

#[test]
fn names_are_unique_and_claims_are_sentences() {
    for (n, case) in CASES.iter().enumerate() {
        assert!(CASES[..n].iter().all(|other| other.name != case.name), "{} is there twice", case.name);
        assert!(case.claim.len() > 20 && !case.source.is_empty(), "{} says nothing", case.name);
    }
}
