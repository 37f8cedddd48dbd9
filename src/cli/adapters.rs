//! `gridfall adapters`: the GPUs of this machine.

use clap::Args;

use super::CliError;
use gridfall_engine::gpu;

/// List GPU adapters, and whether the engine can use them.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let adapters = gpu::list_adapters();
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&adapters).expect("summaries are plain data"));
        return Ok(());
    }
    if adapters.is_empty() {
        println!("no adapters: no Vulkan, Metal or DX12 driver was found; scenes run on the CPU");
    }
    for (number, a) in adapters.iter().enumerate() {
        let use_ = match (&a.unusable, a.software) {
            (Some(why), _) => format!("cannot be used: {why}"),
            (None, true) => format!("software: used only by name, --adapter \"{}\"", a.name),
            (None, false) => "used by default".into(),
        };
        println!("#{number} {} ({}, {}, {})\n  {use_}", a.name, a.backend, a.kind, a.driver);
    }
    Ok(())
}
