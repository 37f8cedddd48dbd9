//! What measurements say of the machine: host memory, and the copy bandwidth that speeds are compared with.

use std::time::Instant;

use rayon::prelude::*;

use gridfall_engine::EngineError;
use gridfall_engine::choice::Devices;
use gridfall_engine::explicit::gpu::timing;

/// Bytes that a line of a file of `/proc` says, which has them in KiB.
fn kib_line(path: &str, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = text.lines().find(|line| line.starts_with(name))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib << 10)
}

/// Host memory that can be had without swapping (bytes); 4 GiB where the system does not say.
pub fn available_bytes() -> u64 {
    kib_line("/proc/meminfo", "MemAvailable:").unwrap_or(4 << 30)
}

/// Host memory that this process takes (bytes), if the system says.
pub fn resident_bytes() -> Option<u64> {
    kib_line("/proc/self/status", "VmRSS:")
}

/// Bytes read and written per second by a plain copy on the device.
pub fn copy_bandwidth(devices: &Devices) -> Result<f64, EngineError> {
    match devices.gpu() {
        Some(gpu) => timing::copy_bandwidth(gpu),
        None => Ok(of_memory()),
    }
}

/// That of copies of large arrays on all threads; the best of several.
fn of_memory() -> f64 {
    const CHUNK: usize = 8 << 20;
    let from = vec![1u8; 16 * CHUNK];
    let mut to = vec![0u8; 16 * CHUNK];
    let mut best: f64 = 0.0;
    for _ in 0..4 {
        let begin = Instant::now();
        to.par_chunks_mut(CHUNK).zip(from.par_chunks(CHUNK)).for_each(|(to, from)| to.copy_from_slice(from));
        best = best.max(2.0 * from.len() as f64 / begin.elapsed().as_secs_f64());
    }
    std::hint::black_box(&to);
    best
}
