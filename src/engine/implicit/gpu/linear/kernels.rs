//! The shaders of the linear algebra: what each is made of, their pipelines, and lists of dispatches.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use wgpu::{BindingResource, Buffer};

use crate::contract::EngineError;
use crate::gpu::device::Gpu;
use gridfall_core::sim::setup;

macro_rules! wgsl {
    ($name:literal) => {
        include_str!(concat!("../../../../../wgsl/implicit/linear/", $name, ".wgsl"))
    };
}

macro_rules! kernels {
    ($($variant:ident $name:literal [$($part:literal)*]),+ $(,)?) => {
        /// Compute entry points, in the order in which a step first uses them.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Kernel {
            $($variant),+
        }

        impl Kernel {
            pub const ALL: &[Kernel] = &[$(Kernel::$variant),+];

            pub fn name(self) -> &'static str {
                match self {
                    $(Kernel::$variant => $name),+
                }
            }

            /// The shared files that it uses, and its own.
            fn parts(self) -> Vec<&'static str> {
                match self {
                    $(Kernel::$variant => vec![$(wgsl!($part),)* wgsl!($name)]),+
                }
            }
        }
    };
}

kernels! {
    Nonzeros "nonzeros" [],
    MarkFine "mark_fine" ["parents"],
    Mark "mark" ["parents"],
    Count "count" [],
    Offsets "offsets" ["scan"],
    Number "number" ["scan"],
    Link "link" ["parents"],
    Columns "columns" [],
    Galerkin "galerkin" ["freedom"],
    Diagonal "diagonal" [],
    LanczosStart "lanczos_start" ["lanczos" "vectors" "reduce"],
    LanczosRatio "lanczos_ratio" ["lanczos" "reduce"],
    LanczosProduct "lanczos_product" ["lanczos" "product" "reduce"],
    LanczosUpdate "lanczos_update" ["lanczos" "vectors" "reduce"],
    Ritz "ritz" ["lanczos"],
    ChebyshevFirst "chebyshev_first" ["vectors"],
    Chebyshev "chebyshev" ["vectors" "product"],
    GaussSeidel "gauss_seidel" ["vectors" "product"],
    Residual "residual" ["product"],
    Restrict "restrict" ["vectors" "freedom"],
    Prolong "prolong" ["freedom"],
    Begin "begin" ["reduce"],
    Backward "backward" ["pair" "reduce"],
    Project "project" ["freedom" "reduce"],
    Forward "forward" ["pair" "reduce"],
    Adopt "adopt" ["state" "reduce"],
    Search "search" ["state" "reduce"],
    Attempt "attempt" ["state"],
    Measure "measure" ["reduce"],
    Decide "decide" ["state" "reduce"],
    Accept "accept" ["state" "reduce"],
    Finish "finish" ["state" "pair" "reduce"],
}

/// The complete source of an entry point for a transfer kernel: quadratic, or else the compact pair.
pub fn source(kernel: Kernel, transfer: setup::Kernel) -> String {
    let stencil =
        if transfer == setup::Kernel::Quadratic { wgsl!("stencil_quadratic") } else { wgsl!("stencil_compact") };
    let mut parts = vec![wgsl!("level"), stencil];
    parts.extend(kernel.parts());
    parts.join("\n")
}

/// Compiled entry points for one transfer kernel; each when first used.
pub struct Pipelines {
    transfer: setup::Kernel,
    compiled: Mutex<HashMap<Kernel, Arc<wgpu::ComputePipeline>>>,
}

impl Pipelines {
    pub fn new(transfer: setup::Kernel) -> Self {
        Self { transfer, compiled: Mutex::default() }
    }

    fn get(&self, gpu: &Gpu, kernel: Kernel) -> Arc<wgpu::ComputePipeline> {
        let mut compiled = self.compiled.lock().unwrap();
        let compile = || Arc::new(gpu.compile(kernel.name(), &source(kernel, self.transfer), &[], &[]));
        compiled.entry(kernel).or_insert_with(compile).clone()
    }
}

/// Dispatches in order, as data: built once, recorded as often as needed.
#[derive(Default)]
pub struct Program {
    steps: Vec<(Arc<wgpu::ComputePipeline>, wgpu::BindGroup, [u32; 2])>,
}

/// What a program is built with.
#[derive(Clone, Copy)]
pub struct Tools<'a> {
    pub gpu: &'a Gpu,
    pub pipelines: &'a Pipelines,
}

impl Program {
    /// Appends a dispatch; `resources` in the order of the bindings.
    pub fn push(&mut self, tools: Tools, kernel: Kernel, resources: &[BindingResource], groups: [u32; 2]) {
        let pipeline = tools.pipelines.get(tools.gpu, kernel);
        let entries: Vec<wgpu::BindGroupEntry> = resources
            .iter()
            .enumerate()
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: binding as u32, resource: resource.clone() })
            .collect();
        let bind = tools.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(kernel.name()),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        self.steps.push((pipeline, bind, groups));
    }

    /// Appends a dispatch that binds whole buffers.
    pub fn push_whole(&mut self, tools: Tools, kernel: Kernel, buffers: &[&Buffer], groups: [u32; 2]) {
        let resources: Vec<BindingResource> = buffers.iter().map(|buffer| buffer.as_entire_binding()).collect();
        self.push(tools, kernel, &resources, groups);
    }

    pub fn record(&self, pass: &mut wgpu::ComputePass) {
        for (pipeline, bind, [x, y]) in &self.steps {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bind, &[]);
            pass.dispatch_workgroups(*x, *y, 1);
        }
    }

    /// Runs the program in a submission of its own.
    pub fn submit(&self, gpu: &Gpu) -> Result<(), EngineError> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        self.record(&mut encoder.begin_compute_pass(&Default::default()));
        gpu.queue.submit([encoder.finish()]);
        gpu.check()
    }
}
