//! Every pipeline that the engine can make, as source and constants. The one file here that knows the engine.

use gridfall::gpu::implicit::linear::kernels as linear;
use gridfall::gpu::{implicit::shaders as implicit, shaders as explicit};
use gridfall::sim::problem::Kernel;

/// What a compute pipeline is made of; its entry point is `main`.
pub struct Program {
    /// `engine/shader`, then what it is specialised for: `explicit/g2p2g compact mls closed`.
    pub name: String,
    pub wgsl: String,
    /// Values of override constants.
    pub constants: Vec<(&'static str, f64)>,
}

/// Lanes of a workgroup on a real GPU.
const WORKGROUP: f64 = 128.0;

/// All pipelines of all variants.
pub fn programs() -> Vec<Program> {
    let mut all = Vec::new();
    for (kernel, kernel_name) in [(Kernel::Compact, "compact"), (Kernel::Quadratic, "quadratic")] {
        for (transfer, mls) in [("mls", 1.0), ("apic", 0.0)] {
            for (laws, principal) in [("closed", 0.0), ("principal", 1.0)] {
                let variant = format!("{kernel_name} {transfer} {laws}");
                all.extend(explicit::Stage::ALL.map(|stage| Program {
                    name: format!("explicit/{} {variant}", stage.name()),
                    wgsl: explicit::source(stage, kernel),
                    constants: vec![("WORKGROUP", WORKGROUP), ("MLS", mls), ("PRINCIPAL", principal)],
                }));
                all.extend(implicit::Stage::ALL.map(|stage| Program {
                    name: format!("implicit/{} {variant}", stage.name()),
                    wgsl: implicit::source(stage, kernel),
                    constants: vec![("MLS", mls), ("PRINCIPAL", principal)],
                }));
            }
        }
        all.extend(linear::Kernel::ALL.iter().map(|&stage| Program {
            name: format!("linear/{} {kernel_name}", stage.name()),
            wgsl: linear::source(stage, kernel),
            constants: vec![],
        }));
    }
    all.extend(implicit::SCAN.map(|(name, source)| Program {
        name: format!("implicit/{name}"),
        wgsl: source.into(),
        constants: vec![],
    }));
    all
}
