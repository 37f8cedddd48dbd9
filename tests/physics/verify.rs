//! `gridfall verify --quick` as a test: every case on the CPU, and one on the software GPU.

use gridfall::verify::{self, CASES, Case, Extent, Scope, Target};
use gridfall_engine::choice::{Choice, Devices};

fn pass(cases: &[&'static Case], devices: &Devices, target: Target) {
    let scope = Scope { devices, targets: &[target], extent: Extent::Quick, log: &|line| println!("{line}") };
    let (mut told, mut failed) = (Vec::new(), Vec::new());
    verify::run(cases, scope, |case, outcome| {
        assert!(!outcome.rows.is_empty(), "{} reports nothing", case.name);
        told.push(case.name);
        failed.extend(outcome.rows.into_iter().filter(|row| !row.pass));
    });
    assert_eq!(told, cases.iter().map(|case| case.name).collect::<Vec<_>>());
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
fn every_case_passes_on_the_cpu() {
    let devices = Devices::open(Choice::Cpu, None).unwrap();
    let quick: Vec<_> = CASES.iter().filter(|case| case.quick).collect();
    pass(&quick, &devices, Target::Cpu);
}

#[test]
fn a_case_passes_on_the_gpu() {
    // A missing driver is a failure, not a skip (see tests/run).
    let adapter = std::env::var("GRIDFALL_TEST_ADAPTER").unwrap_or_else(|_| "llvmpipe".into());
    let devices = Devices::open(Choice::Gpu, Some(&adapter)).unwrap();
    let free_fall: Vec<_> = CASES.iter().filter(|case| case.name == "free-fall").collect();
    pass(&free_fall, &devices, Target::Gpu);
}

#[test]
fn names_are_unique_and_claims_are_sentences() {
    for (n, case) in CASES.iter().enumerate() {
        assert!(CASES[..n].iter().all(|other| other.name != case.name), "{} is there twice", case.name);
        assert!(case.claim.len() > 20 && !case.source.is_empty(), "{} says nothing", case.name);
    }
}
