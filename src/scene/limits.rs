//! What a scene may ask for at most.

/// Limits on the cost of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    pub max_particles: u64,
    /// Host memory of one run (bytes).
    pub max_memory_bytes: u64,
    /// Steps of the whole run.
    pub max_steps: u64,
    /// Work of finding out how many particles a scene has: distances asked for, each counted as
    /// many times as its shape has parts. A core does a hundred million or two in a second. Sampling
    /// meshes and heightfields may take four times as much besides.
    pub max_work: u64,
}

impl Default for Limits {
    /// As many particles and as much memory as this machine can hold, and steps for some weeks of
    /// its time. The work of judging is not limited.
    fn default() -> Self {
        Self {
            max_particles: 1 << 30,
            max_memory_bytes: host_memory_bytes() / 10 * 9,
            max_steps: 1_000_000_000,
            max_work: u64::MAX,
        }
    }
}

/// Memory of this machine (bytes); 8 GiB where the system does not say.
fn host_memory_bytes() -> u64 {
    let total = |text: String| -> Option<u64> {
        let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
        line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib << 10)
    };
    std::fs::read_to_string("/proc/meminfo").ok().and_then(total).unwrap_or(8 << 30)
}
