//! RADV, Mesa's driver of AMD's GPUs, on "null hardware": it compiles every pipeline for GPUs that are not there.
//!
//! An environment variable that the driver reads once chooses the family, and a compiler may crash;
//! so each family has a process of its own, which is this test program again with only [`worker`].

use std::collections::HashMap;
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::Command;

use crate::compile::{Compiled, compiled, distinct};
use crate::device::{Device, Figures};

/// A generation of GPUs and the step in which its compiler hands out vector registers.
pub struct Family {
    /// What Mesa calls it; the later names are those of other Mesa versions.
    names: &'static [&'static str],
    pub title: &'static str,
    pub register_step: u64,
}

pub const FAMILIES: [Family; 3] = [
    Family { names: &["vega10"], title: "GCN 5", register_step: 4 },
    Family { names: &["navi21"], title: "RDNA 2", register_step: 8 },
    Family { names: &["gfx1100", "navi31"], title: "RDNA 3", register_step: 12 },
];

/// What a family's compiler made of all programs.
pub struct Report {
    /// Driver and version, for example "Mesa 22.3.6".
    pub driver: String,
    /// By program.
    pub figures: HashMap<String, Figures>,
}

/// Where a worker is to write.
const OUT: &str = "GRIDFALL_RADV_REPORT";

/// Does nothing unless [`run`] started it. Writes a line with the driver, then a line for each
/// module: name, tab, figures.
#[test]
fn worker() {
    let Ok(out) = std::env::var(OUT) else { return };
    let mut out = fs::File::create(out).unwrap();
    let device = Device::open().unwrap();
    writeln!(out, "{}", device.driver).unwrap();
    for (name, module) in distinct(compiled()) {
        // Written before the compiler runs, so that a crash has a name.
        write!(out, "{name}\t").unwrap();
        out.flush().unwrap();
        let figures = device.measure(module).unwrap();
        writeln!(out, "{}", serde_json::to_string(&figures).unwrap()).unwrap();
    }
}

/// The driver's file among those of all Vulkan drivers.
fn driver() -> Result<PathBuf, String> {
    let folders = ["/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/usr/share/vulkan/icd.d"];
    let entries = folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let mut found: Vec<_> = entries
        .filter(|entry| entry.file_name().to_string_lossy().starts_with("radeon_icd"))
        .map(|entry| entry.path())
        .collect();
    // This machine's, should there be one for 32-bit programs too.
    found.sort_by_key(|path| !path.to_string_lossy().contains(std::env::consts::ARCH));
    found.into_iter().next().ok_or("Mesa's RADV is not installed; tests/run installs it (mesa-vulkan-drivers)".into())
}

fn run(name: &str) -> Result<Report, String> {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("radv-{name}-{}", std::process::id()));
    let ran = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "radv::worker", "--nocapture"])
        .env(OUT, &path)
        .env("RADV_FORCE_FAMILY", name)
        .env("VK_DRIVER_FILES", driver()?)
        .env("VK_ICD_FILENAMES", driver()?)
        .env("NODEVICE_SELECT", "1")
        .env("MESA_SHADER_CACHE_DISABLE", "true")
        .output()
        .map_err(|e| e.to_string())?;
    let written = fs::read_to_string(&path).unwrap_or_default();
    let _ = fs::remove_file(&path);
    let mut lines = written.lines();
    let driver = lines.next().unwrap_or_default().to_string();
    if !ran.status.success() {
        let last = lines.next_back().unwrap_or("no program yet").trim_end();
        let said = format!("{}{}", String::from_utf8_lossy(&ran.stdout), String::from_utf8_lossy(&ran.stderr));
        return Err(format!("RADV as {name} at {last}: {}\n{said}", ran.status));
    }
    let parsed = lines.map(|line| {
        let (name, figures) = line.split_once('\t').expect("a tab in each line");
        (name.to_string(), serde_json::from_str(figures).expect("figures of each program"))
    });
    Ok(Report { driver, figures: parsed.collect() })
}

/// Every family's report, with an entry for each program.
pub fn reports(all: &[Compiled]) -> Result<Vec<Report>, String> {
    let report = |family: &Family| {
        let mut faults = Vec::new();
        for name in family.names {
            match run(name) {
                Ok(report) => return Ok(report),
                Err(fault) => faults.push(fault),
            }
        }
        Err(faults.join("\n"))
    };
    let reports: Result<Vec<Report>, String> = std::thread::scope(|scope| {
        let running = FAMILIES.each_ref().map(|family| scope.spawn(move || report(family)));
        running.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    let mut reports = reports?;
    for report in &mut reports {
        report.figures = spread(&report.figures, all);
    }
    Ok(reports)
}

/// From the programs whose modules were measured to all that share them.
fn spread(measured: &HashMap<String, Figures>, all: &[Compiled]) -> HashMap<String, Figures> {
    let of = |c: &Compiled| {
        let first = all.iter().find(|other| std::sync::Arc::ptr_eq(&other.module, &c.module)).expect("itself at least");
        (c.name.clone(), measured[&first.name])
    };
    all.iter().map(of).collect()
}

/// What must not be, whatever the table says: registers spilled, or arrays in memory.
pub fn faults(report: &Report, title: &str) -> Vec<String> {
    let mut faults: Vec<_> = report.figures.iter().filter(|(_, f)| f.spills > 0 || f.scratch_bytes > 0).collect();
    faults.sort_by_key(|(name, _)| *name);
    let line = |(name, f): (&String, &Figures)| {
        let Figures { spills, scratch_bytes, registers, .. } = f;
        format!("{name}: {title}: {spills} registers spilled, {scratch_bytes} B of scratch memory, {registers} VGPRs")
    };
    faults.into_iter().map(line).collect()
}
