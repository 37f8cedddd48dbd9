//! Adapters and the device: finding, opening, submitting, and what happens when it is lost.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use serde::Serialize;

use super::program::{Key, Program, STORAGE_BUFFERS};
use crate::contract::{Backend, EngineError};

/// Workgroup memory that a program may take (bytes). The largest has the read tile, the scatter
/// tile and the tables of the compact kernel.
pub const WORKGROUP_BYTES: u32 = 24 * 1024;
/// Lanes of a workgroup on a GPU, for programs that leave it open: many hide latency. At least 27, one a neighbour of a
/// block.
pub const WORKGROUP: u32 = 128;
/// The same on a software driver, whose lanes are slow to start.
const SOFTWARE_WORKGROUP: u32 = 64;

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

/// An opened device, shared by all runs of a process.
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub limits: wgpu::Limits,
    pub info: wgpu::AdapterInfo,
    pub timestamps: bool,
    /// Lanes of a workgroup, for programs that leave it open.
    pub workgroup: u32,
    pub(super) programs: Mutex<HashMap<Key, Arc<Program>>>,
    /// First error since the last check; one run's failure is not the next one's.
    fault: Arc<Mutex<Option<String>>>,
    /// Set for good when the device is gone.
    lost: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the best real GPU, or the adapter whose name contains `adapter` (case ignored), software
    /// drivers included, or for `#N` the one of that number among all, counted from 0.
    ///
    /// Errors: [`EngineError::NoDevice`] that says what was found and what would help.
    pub fn open(adapter: Option<&str>) -> Result<Self, EngineError> {
        let instance = instance();
        let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        let names = found.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ");
        let names = if names.is_empty() { "none".to_string() } else { names };
        let number = adapter.and_then(|adapter| adapter.strip_prefix('#')?.parse::<usize>().ok());
        if let Some(number) = number {
            let chosen = found.into_iter().nth(number);
            let missing = || EngineError::NoDevice(format!("there is no adapter #{number}; found: {names}"));
            return Self::from_adapter(&chosen.ok_or_else(missing)?);
        }
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
        let workgroup = if is_software(&info) { SOFTWARE_WORKGROUP } else { WORKGROUP };
        Ok(Self {
            timestamps: device.features().contains(timing),
            limits,
            info,
            workgroup,
            programs: Mutex::default(),
            fault,
            lost,
            device,
            queue,
        })
    }

    /// Memory that was taken of the device (bytes), if the driver's allocator says.
    pub fn memory_bytes(&self) -> Option<u64> {
        self.device.generate_allocator_report().map(|report| report.total_reserved_bytes)
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

    /// Records commands and submits them.
    pub fn submit(&self, record: impl FnOnce(&mut wgpu::CommandEncoder)) -> wgpu::SubmissionIndex {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        record(&mut encoder);
        self.queue.submit([encoder.finish()])
    }

    /// Records a pass and submits it.
    pub fn pass(&self, record: impl FnOnce(&mut wgpu::ComputePass)) -> wgpu::SubmissionIndex {
        self.submit(|encoder| record(&mut encoder.begin_compute_pass(&Default::default())))
    }
}

/// The device of unit tests: software Vulkan unless `GRIDFALL_TEST_ADAPTER` names another.
#[cfg(test)]
pub(crate) fn test_gpu() -> Gpu {
    let name = std::env::var("GRIDFALL_TEST_ADAPTER").unwrap_or_else(|_| "llvmpipe".into());
    Gpu::open(Some(&name)).unwrap_or_else(|e| panic!("GPU tests need a Vulkan driver (see tests/run): {e}"))
}
