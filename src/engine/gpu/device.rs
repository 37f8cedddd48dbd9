//! Adapters and the device: finding, opening, pipelines, and what happens when it is lost.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use serde::Serialize;

use crate::contract::{Backend, EngineError};
use crate::explicit::gpu::shaders::{self, Stage};
use gridfall_core::sim::setup::{Kernel, Material, Setup, Transfer};

/// Storage buffers of the one bind group that all stages share.
pub const STORAGE_BUFFERS: u32 = 26;
/// Workgroup memory that the largest stage takes (bytes): read tile, scatter tile and tables of the compact kernel.
const WORKGROUP_BYTES: u32 = 22 * 1024;

/// What `gridfall adapters` shows.
#[derive(Clone, Debug, Serialize)]
pub struct AdapterSummary {
    pub name: String,
    pub backend: String,
    pub kind: String,
    pub driver: String,
    /// A driver that runs on the CPU: used only when asked for by name.
    pub software: bool,
    /// Why the engine cannot use it, if it cannot.
    pub unusable: Option<String>,
}

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    descriptor.flags = wgpu::InstanceFlags::empty();
    wgpu::Instance::new(descriptor)
}

fn is_software(info: &wgpu::AdapterInfo) -> bool {
    info.device_type == wgpu::DeviceType::Cpu
}

fn unusable(adapter: &wgpu::Adapter) -> Option<String> {
    let limits = adapter.limits();
    if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
        return Some(format!(
            "{} storage buffers a stage; {STORAGE_BUFFERS} are needed",
            limits.max_storage_buffers_per_shader_stage
        ));
    }
    // wgpu does not check this one, and a driver may lose the device over it.
    if limits.max_compute_workgroup_storage_size < WORKGROUP_BYTES {
        return Some(format!(
            "{} bytes of workgroup memory; {WORKGROUP_BYTES} are needed",
            limits.max_compute_workgroup_storage_size
        ));
    }
    None
}

/// All adapters of this machine; empty without a driver.
pub fn list_adapters() -> Vec<AdapterSummary> {
    let instance = instance();
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()))
        .iter()
        .map(|adapter| {
            let info = adapter.get_info();
            AdapterSummary {
                software: is_software(&info),
                unusable: unusable(adapter),
                kind: format!("{:?}", info.device_type),
                backend: info.backend.to_string(),
                driver: driver(&info),
                name: info.name,
            }
        })
        .collect()
}

fn driver(info: &wgpu::AdapterInfo) -> String {
    format!("{} {}", info.driver, info.driver_info).trim().to_string()
}

/// What pipelines are specialised for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    pub kernel: Kernel,
    /// MLS instead of APIC.
    pub mls: bool,
    /// Some law works in principal space.
    pub principal: bool,
}

impl Variant {
    pub fn of(setup: &Setup) -> Self {
        let closed_form = |m: &Material| {
            matches!(m, Material::FixedCorotated(_) | Material::NeoHookean(_) | Material::WeaklyCompressibleFluid(_))
        };
        Self {
            kernel: setup.kernel,
            mls: setup.transfer == Transfer::Mls,
            principal: !setup.materials.iter().all(closed_form),
        }
    }
}

/// Compiled stages of one variant.
pub struct Pipelines {
    pub stages: HashMap<Stage, wgpu::ComputePipeline>,
}

/// An opened device, shared by all runs of a process.
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub limits: wgpu::Limits,
    pub info: wgpu::AdapterInfo,
    pub timestamps: bool,
    pub layout: wgpu::BindGroupLayout,
    pub dispatch_layout: wgpu::BindGroupLayout,
    pub workgroup: u32,
    pipelines: Mutex<HashMap<Variant, Arc<Pipelines>>>,
    /// The same of the implicit engine.
    pub(crate) implicit: Mutex<HashMap<Variant, Arc<crate::implicit::gpu::Pipelines>>>,
    /// First error since the last check; one run's failure is not the next one's.
    fault: Arc<Mutex<Option<String>>>,
    /// Set for good when the device is gone.
    lost: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the best real GPU, or the adapter whose name contains `adapter` (case ignored), software drivers included.
    ///
    /// Errors: [`EngineError::NoDevice`] that says what was found and what would help.
    pub fn open(adapter: Option<&str>) -> Result<Self, EngineError> {
        let instance = instance();
        let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        let names = found.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ");
        let names = if names.is_empty() { "none".to_string() } else { names };
        found.retain(|a| {
            let info = a.get_info();
            match adapter {
                Some(part) => info.name.to_lowercase().contains(&part.to_lowercase()),
                None => !is_software(&info),
            }
        });
        found.sort_by_key(|a| a.get_info().device_type != wgpu::DeviceType::DiscreteGpu);
        let Some(chosen) = found.into_iter().next() else {
            return Err(EngineError::NoDevice(match adapter {
                Some(part) => format!("no adapter's name contains \"{part}\"; found: {names}"),
                None => format!("no GPU with a Vulkan, Metal or DX12 driver; found: {names}"),
            }));
        };
        Self::from_adapter(&chosen)
    }

    fn from_adapter(adapter: &wgpu::Adapter) -> Result<Self, EngineError> {
        let info = adapter.get_info();
        if let Some(why) = unusable(adapter) {
            return Err(EngineError::NoDevice(format!("{} offers only {why}", info.name)));
        }
        let limits = adapter.limits();
        let timing = wgpu::Features::TIMESTAMP_QUERY;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("gridfall"),
            required_features: adapter.features() & timing,
            required_limits: limits.clone(),
            ..Default::default()
        }))
        .map_err(|e| EngineError::NoDevice(format!("{}: {e}", info.name)))?;
        let (fault, lost) = (Arc::new(Mutex::new(None)), Arc::new(Mutex::new(None)));
        let (on_error, on_lost) = (fault.clone(), lost.clone());
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            on_error.lock().unwrap().get_or_insert(e.to_string());
        }));
        device.set_device_lost_callback(move |reason, message| {
            on_lost.lock().unwrap().get_or_insert(format!("{reason:?}: {message}"));
        });
        let layout = bind_group_layout(&device);
        let dispatch_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("dispatches"),
            entries: &[storage_entry(0)],
        });
        // Lanes of a software driver are slow to start; a GPU hides latency behind more of them.
        let workgroup = if is_software(&info) { 64 } else { 128 };
        Ok(Self {
            timestamps: device.features().contains(timing),
            limits,
            info,
            layout,
            dispatch_layout,
            workgroup,
            pipelines: Mutex::default(),
            implicit: Mutex::default(),
            fault,
            lost,
            device,
            queue,
        })
    }

    /// Description for job records; `reason` says why it was chosen.
    pub fn backend(&self, reason: &str) -> Backend {
        Backend {
            kind: "gpu".into(),
            device: self.info.name.clone(),
            driver: driver(&self.info),
            software: is_software(&self.info),
            reason: reason.into(),
        }
    }

    /// Whether the driver runs on the CPU.
    pub fn is_software(&self) -> bool {
        is_software(&self.info)
    }

    /// The first error that the driver reported since the last check, if any.
    pub fn check(&self) -> Result<(), EngineError> {
        if let Some(why) = &*self.lost.lock().unwrap() {
            return Err(EngineError::DeviceLost(why.clone()));
        }
        match self.fault.lock().unwrap().take() {
            Some(e) if e.to_lowercase().contains("out of memory") => Err(EngineError::Capacity(e)),
            Some(e) => Err(EngineError::DeviceLost(e)),
            None => Ok(()),
        }
    }

    /// Waits for everything that was submitted.
    pub fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<(), EngineError> {
        self.device
            .poll(wgpu::PollType::Wait { submission_index: submission, timeout: None })
            .map_err(|e| EngineError::DeviceLost(e.to_string()))?;
        self.check()
    }

    /// Compiles a variant's stages once.
    pub fn pipelines(&self, variant: Variant) -> Result<Arc<Pipelines>, EngineError> {
        let mut cache = self.pipelines.lock().unwrap();
        if let Some(p) = cache.get(&variant) {
            return Ok(p.clone());
        }
        let compile = |stage: Stage| {
            let mut groups = vec![Some(&self.layout)];
            if stage.writes_dispatches() {
                groups.push(Some(&self.dispatch_layout));
            }
            let constants = [
                ("WORKGROUP", f64::from(self.workgroup)),
                ("MLS", f64::from(u8::from(variant.mls))),
                ("PRINCIPAL", f64::from(u8::from(variant.principal))),
            ];
            self.compile(stage.name(), &shaders::source(stage, variant.kernel), &groups, &constants)
        };
        let stages = Stage::ALL.iter().map(|&stage| (stage, compile(stage))).collect();
        self.check()?;
        let compiled = Arc::new(Pipelines { stages });
        cache.insert(variant, compiled.clone());
        Ok(compiled)
    }

    /// A pipeline of the entry point `main` of a source. Without `groups` it has the one bind group that the source asks for.
    pub(crate) fn compile(
        &self,
        name: &str,
        source: &str,
        groups: &[Option<&wgpu::BindGroupLayout>],
        constants: &[(&str, f64)],
    ) -> wgpu::ComputePipeline {
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(name), source: wgpu::ShaderSource::Wgsl(source.into()) };
        let mut checks = wgpu::ShaderRuntimeChecks::checked();
        // Every loop of ours is bounded; naga's guard is a 64-bit counter in each of them.
        checks.force_loop_bounding = false;
        // SAFETY: the only check that is off is the loop bound, and no shader of ours has an unbounded loop.
        let module = unsafe { self.device.create_shader_module_trusted(descriptor, checks) };
        let layout = (!groups.is_empty()).then(|| {
            self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(name),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        });
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: layout.as_ref(),
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        })
    }
}

fn storage_entry(binding: u32) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Storage { read_only: false },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let mut entries = vec![wgpu::BindGroupLayoutEntry {
        binding: 0,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }];
    entries.extend((1..=STORAGE_BUFFERS).map(storage_entry));
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("state"), entries: &entries })
}
