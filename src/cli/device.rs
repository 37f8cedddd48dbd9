//! Arguments that choose the device.

use clap::{Args, ValueEnum};

use gridfall_engine::choice::Choice;

#[derive(Clone, Debug, Args)]
pub struct DeviceArguments {
    /// Where to run: a real GPU if there is one, else the CPU (auto), or one of them.
    #[arg(long, value_enum, default_value_t = Backend::Auto, env = "GRIDFALL_BACKEND")]
    backend: Backend,
    /// Part of the name of a GPU adapter; the only way to a software Vulkan driver.
    #[arg(long, value_name = "NAME", env = "GRIDFALL_ADAPTER")]
    pub adapter: Option<String>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Backend {
    Auto,
    Gpu,
    Cpu,
}

impl DeviceArguments {
    pub fn choice(&self) -> Choice {
        match self.backend {
            Backend::Auto => Choice::Auto,
            Backend::Gpu => Choice::Gpu,
            Backend::Cpu => Choice::Cpu,
        }
    }
}
