//! A Vulkan device that compiles compute pipelines and says what became of them; nothing runs on it.

use std::ffi::CStr;

use ash::{khr, vk};
use serde::{Deserialize, Serialize};

use crate::compile::Module;

/// What a driver says of a pipeline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Figures {
    pub instructions: u64,
    /// Vector registers of a lane.
    pub registers: u64,
    pub workgroup_bytes: u64,
    /// Memory of a wave for what did not fit in registers, arrays included.
    pub scratch_bytes: u64,
    /// Waves that a SIMD can hold at once.
    pub waves: u64,
    /// Registers spilled, scalar and vector.
    pub spills: u64,
}

/// A device of plain Vulkan with what wgpu would turn on.
pub struct Device {
    /// Driver and version, for example "Mesa 22.3.6".
    pub driver: String,
    device: ash::Device,
    statistics: khr::pipeline_executable_properties::Device,
    // What the above live in.
    _instance: ash::Instance,
    _entry: ash::Entry,
}

fn text(chars: &[std::ffi::c_char]) -> String {
    // SAFETY: drivers end their fixed-size strings with a zero.
    unsafe { CStr::from_ptr(chars.as_ptr()) }.to_string_lossy().into_owned()
}

impl Device {
    /// The first device of the driver that the environment names.
    pub fn open() -> Result<Self, String> {
        // SAFETY: plain Vulkan calls; what they are given outlives them.
        unsafe {
            let entry = ash::Entry::load().map_err(|e| format!("no Vulkan loader: {e}; install libvulkan1"))?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None).map_err(|e| format!("no Vulkan driver: {e}"))?;
            let physical = instance.enumerate_physical_devices().map_err(|e| format!("no device: {e}"))?;
            let &physical = physical.first().ok_or("no device")?;

            let mut driver = vk::PhysicalDeviceDriverProperties::default();
            let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
            instance.get_physical_device_properties2(physical, &mut properties);
            let (name, version) = (text(&properties.properties.device_name), properties.properties.api_version);
            if !name.to_lowercase().contains("null") || version < vk::API_VERSION_1_3 {
                return Err(format!("{name} is no null hardware with Vulkan 1.3"));
            }

            let queue = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
            let extensions = [khr::pipeline_executable_properties::NAME, ash::ext::robustness2::NAME];
            let extensions = extensions.map(CStr::as_ptr);
            let core = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true);
            let mut robust = vk::PhysicalDeviceRobustness2FeaturesEXT::default().robust_buffer_access2(true);
            let mut executables =
                vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queue)
                .enabled_extension_names(&extensions)
                .enabled_features(&core)
                .push_next(&mut robust)
                .push_next(&mut executables);
            let device = instance.create_device(physical, &info, None).map_err(|e| format!("{name}: {e}"))?;
            let statistics = khr::pipeline_executable_properties::Device::new(&instance, &device);
            Ok(Self { driver: text(&driver.driver_info), device, statistics, _instance: instance, _entry: entry })
        }
    }

    /// Compiles a module as a pipeline and asks what became of it.
    pub fn measure(&self, module: &Module) -> Result<Figures, String> {
        let made = self.layouts(module).and_then(|layouts| self.pipeline(module, &layouts));
        self.figures(made.map_err(|e| format!("no pipeline: {e}"))?)
    }

    // What these create is small and goes with the process.

    fn layouts(&self, module: &Module) -> Result<Vec<vk::DescriptorSetLayout>, vk::Result> {
        let groups = module.bindings.iter().map(|b| b.group + 1).max().unwrap_or(0);
        let kind = |uniform| match uniform {
            true => vk::DescriptorType::UNIFORM_BUFFER,
            false => vk::DescriptorType::STORAGE_BUFFER,
        };
        let layout = |group| {
            let own = module.bindings.iter().filter(|b| b.group == group);
            let entry = vk::DescriptorSetLayoutBinding::default()
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE);
            let entries: Vec<_> = own.map(|b| entry.binding(b.binding).descriptor_type(kind(b.uniform))).collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&entries);
            // SAFETY: as in `open`.
            unsafe { self.device.create_descriptor_set_layout(&info, None) }
        };
        (0..groups).map(layout).collect()
    }

    fn pipeline(&self, module: &Module, layouts: &[vk::DescriptorSetLayout]) -> Result<vk::Pipeline, vk::Result> {
        // SAFETY: as in `open`; naga validated the module, and the layouts have what it binds.
        unsafe {
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(layouts);
            let layout = self.device.create_pipeline_layout(&info, None)?;
            let info = vk::ShaderModuleCreateInfo::default().code(&module.spirv);
            let shader = self.device.create_shader_module(&info, None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(shader)
                .name(c"main");
            let info = vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
                .layout(layout)
                .stage(stage);
            let made = self.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None);
            Ok(made.map_err(|(_, e)| e)?[0])
        }
    }

    fn figures(&self, pipeline: vk::Pipeline) -> Result<Figures, String> {
        let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
        // SAFETY: a compute pipeline has the one executable 0, and this one was made with its statistics.
        let all = unsafe { self.statistics.get_pipeline_executable_statistics(&info) }.map_err(|e| e.to_string())?;
        let of = |name: &str| {
            let found = all.iter().find(|s| text(&s.name) == name);
            // SAFETY: RADV's statistics are all 64-bit integers.
            found.map(|s| unsafe { s.value.u64 }).ok_or_else(|| format!("the driver does not say \"{name}\""))
        };
        Ok(Figures {
            instructions: of("Instructions")?,
            registers: of("VGPRs")?,
            workgroup_bytes: of("LDS size")?,
            scratch_bytes: of("Scratch size")?,
            waves: of("Subgroups per SIMD")?,
            spills: of("Spilled SGPRs")? + of("Spilled VGPRs")?,
        })
    }
}
