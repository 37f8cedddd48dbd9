//! Compiled stages. Each has a bind group layout of the buffers that its source names, numbered as in `wgsl/implicit/layout.wgsl`.

use std::collections::HashMap;
use std::sync::Arc;

use super::shaders::{self, SCAN, Stage};
use crate::contract::EngineError;
use crate::gpu::device::{Gpu, Variant};

/// A stage ready to run.
pub struct Compiled {
    pub pipeline: wgpu::ComputePipeline,
    pub layout: wgpu::BindGroupLayout,
    /// Binding and name of its storage buffers; the uniform parameters are at 0.
    pub storage: Vec<(u32, &'static str)>,
}

/// All stages for a kernel, a transfer and the scene's kind of laws.
pub struct Pipelines {
    pub stages: HashMap<Stage, Compiled>,
    pub scan: [wgpu::ComputePipeline; 3],
    pub scan_layout: wgpu::BindGroupLayout,
}

fn entry(binding: u32, ty: wgpu::BufferBindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}

const STORAGE: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: false };

fn layout(gpu: &Gpu, name: &str, entries: &[wgpu::BindGroupLayoutEntry]) -> wgpu::BindGroupLayout {
    gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(name), entries })
}

impl Pipelines {
    /// Those of a variant, compiled once a device.
    pub fn of(gpu: &Gpu, variant: Variant) -> Result<Arc<Self>, EngineError> {
        let mut cache = gpu.implicit.lock().expect("no panic while compiling");
        if let Some(compiled) = cache.get(&variant) {
            return Ok(compiled.clone());
        }
        let compiled = Arc::new(Self::compile(gpu, variant));
        gpu.check()?;
        cache.insert(variant, compiled.clone());
        Ok(compiled)
    }

    fn compile(gpu: &Gpu, variant: Variant) -> Self {
        let flag = |on: bool| f64::from(u8::from(on));
        let constants = [("MLS", flag(variant.mls)), ("PRINCIPAL", flag(variant.principal))];
        let stage = |stage: Stage| {
            let source = shaders::source(stage, variant.kernel);
            let storage = shaders::used(&source);
            let mut entries = vec![entry(0, wgpu::BufferBindingType::Uniform)];
            entries.extend(storage.iter().map(|&(binding, _)| entry(binding, STORAGE)));
            let layout = layout(gpu, stage.name(), &entries);
            let pipeline = gpu.compile(stage.name(), &source, &[Some(&layout)], &constants);
            (stage, Compiled { pipeline, layout, storage })
        };
        let scan_layout = layout(gpu, "scan", &[0, 1, 2].map(|binding| entry(binding, STORAGE)));
        let scan = SCAN.map(|(name, source)| gpu.compile(name, source, &[Some(&scan_layout)], &[]));
        Self { stages: Stage::ALL.into_iter().map(stage).collect(), scan, scan_layout }
    }
}
