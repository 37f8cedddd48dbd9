//! How many particles a case is to have, and the most that a device has room for.

use std::str::FromStr;

use super::cases::Case;
use super::{BenchError, machine, problem};
use gridfall_core::sim::setup::{Kernel, Precision};
use gridfall_engine::EngineError;
use gridfall_engine::choice::Devices;
use gridfall_engine::explicit::gpu::GpuEngine;
use gridfall_scene::estimate::estimate;

/// A number of particles, as in `17k`, `0.8M` or `largest`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Amount {
    About(usize),
    /// As many as fit.
    Largest,
}

/// Fewest particles of a case: below, its bodies are no bodies any more.
const FEWEST: usize = 1000;
/// Share of the available host memory that a case may take.
const HOST_SHARE: f64 = 0.8;

impl FromStr for Amount {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "largest" {
            return Ok(Self::Largest);
        }
        let (digits, unit) = match text.strip_suffix(['k', 'M']) {
            Some(digits) if text.ends_with('M') => (digits, 1e6),
            Some(digits) => (digits, 1e3),
            None => (text, 1.0),
        };
        let number = digits.parse::<f64>().ok().map(|n| (n * unit).round());
        match number.filter(|n| (FEWEST as f64..=1e9).contains(n)) {
            Some(n) => Ok(Self::About(n as usize)),
            None => Err(format!("give {FEWEST} to 1000M particles, as in 17k, 0.8M or 262144, or `largest`")),
        }
    }
}

impl Amount {
    /// What a case is asked for.
    pub fn particles(
        self,
        devices: &Devices,
        case: Case,
        kernel: Kernel,
        precision: Precision,
    ) -> Result<usize, BenchError> {
        match self {
            Self::About(particles) => Ok(particles),
            Self::Largest => largest(devices, case, kernel, precision),
        }
    }
}

/// The most particles of a case whose buffers are all within the limits of the GPU, and that the host has memory
/// for. How much memory a GPU has, its driver does not tell us.
///
/// Errors: not even the fewest fit.
fn largest(devices: &Devices, case: Case, kernel: Kernel, precision: Precision) -> Result<usize, BenchError> {
    let small = problem(&case.scene(FEWEST, kernel, precision))?;
    let a_particle = estimate(&small).host_memory_bytes as f64 / small.particles.len() as f64;
    let on_host = (HOST_SHARE * machine::available_bytes() as f64 / a_particle) as usize;
    let mut setup = small.setup;
    let mut fits = |particles: usize| match devices.gpu() {
        Some(gpu) => {
            let shape = case.shape(particles);
            setup.cells = shape.cells;
            particles <= on_host && GpuEngine::bytes_for(gpu, &setup, shape.particles(), shape.blocks()).is_ok()
        }
        None => particles <= on_host,
    };
    most(FEWEST, on_host.max(FEWEST), &mut fits).ok_or_else(|| {
        let what = format!("not even {FEWEST} particles of {} fit this device and this machine's memory", case.name());
        BenchError::Engine(EngineError::Capacity(what))
    })
}

/// The most between two numbers that fits, to one in a thousand.
fn most(low: usize, high: usize, fits: &mut dyn FnMut(usize) -> bool) -> Option<usize> {
    if fits(high) {
        return Some(high);
    }
    let (mut low, mut high) = (fits(low).then_some(low)?, high);
    while high - low > 1 + low / 1000 {
        let middle = low + (high - low) / 2;
        if fits(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_read_as_they_are_said() {
        let read = |text: &str| text.parse::<Amount>();
        assert_eq!(read("17k"), Ok(Amount::About(17_000)));
        assert_eq!(read("0.8M"), Ok(Amount::About(800_000)));
        assert_eq!(read("262144"), Ok(Amount::About(262_144)));
        assert_eq!(read("largest"), Ok(Amount::Largest));
        for wrong in ["", "k", "10", "-1M", "1G", "2000M", "NaN", "small", "Largest"] {
            assert!(read(wrong).unwrap_err().contains("as in 17k"), "{wrong}");
        }
    }

    #[test]
    fn the_most_is_found() {
        for limit in [1000, 1001, 31_337, 44_739_242] {
            let found = most(1000, 1 << 30, &mut |n| n <= limit).unwrap();
            assert!(found <= limit && found as f64 >= 0.999 * limit as f64 - 1.0, "{found} of {limit}");
        }
        assert_eq!(most(1000, 5000, &mut |_| true), Some(5000));
        assert_eq!(most(1000, 5000, &mut |_| false), None);
    }
}
