//! Arguments that choose the device.

use clap::{Args, ValueEnum};

use gridfall_engine::choice::Choice;

#[derive(Clone, Debug, Args)]
pub struct DeviceArguments {
    /// Where to run: a real GPU if there is one, else the CPU (auto), or one of them.
    #[arg(long, value_enum, default_value_t = Backend::Auto, env = "GRIDFALL_BACKEND")]
    backend: Backend,
    /// Part of the name of a GPU adapter, or #N for the one of that number; the only way to a software
    /// Vulkan driver.
    #[arg(long, value_name = "NAME", env = "GRIDFALL_ADAPTER")]
    pub adapter: Option<String>,
}

/// The same for a server, which may have several.
#[derive(Clone, Debug, Args)]
pub struct ServerDevices {
    /// Where to run: a real GPU if there is one, else the CPU (auto), or one of them.
    #[arg(long, value_enum, default_value_t = Backend::Auto, env = "GRIDFALL_BACKEND")]
    backend: Backend,
    /// Part of the name of a GPU adapter, or #N for the one of that number. Repeatable: one job runs at a
    /// time on each.
    #[arg(long, value_name = "NAME", env = "GRIDFALL_ADAPTER", value_delimiter = ',')]
    adapter: Vec<String>,
}

impl ServerDevices {
    /// By adapter; one without a name if none is named.
    pub fn each(self) -> Vec<DeviceArguments> {
        let Self { backend, adapter } = self;
        if adapter.is_empty() {
            return vec![DeviceArguments { backend, adapter: None }];
        }
        adapter.into_iter().map(|adapter| DeviceArguments { backend, adapter: Some(adapter) }).collect()
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Backend {
    Auto,
    Gpu,
    Cpu,
}

impl DeviceArguments {
    /// The same as they are written.
    pub fn arguments(&self) -> Vec<String> {
        let backend = self.backend.to_possible_value().expect("all values can be written");
        let mut arguments = vec!["--backend".into(), backend.get_name().to_owned()];
        arguments.extend(self.adapter.iter().flat_map(|adapter| ["--adapter".into(), adapter.clone()]));
        arguments
    }

    pub fn choice(&self) -> Choice {
        match self.backend {
            Backend::Auto => Choice::Auto,
            Backend::Gpu => Choice::Gpu,
            Backend::Cpu => Choice::Cpu,
        }
    }
}
