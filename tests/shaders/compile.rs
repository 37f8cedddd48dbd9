//! Programs through naga: SPIR-V with the options of wgpu's Vulkan backend, and HLSL.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use naga::back::{hlsl, pipeline_constants, spv};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::{AddressSpace, ShaderStage};

use crate::programs::{Program, programs};

/// A binding of a compute shader.
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    pub group: u32,
    pub binding: u32,
    /// A uniform buffer instead of a storage buffer.
    pub uniform: bool,
}

/// A program with its constants filled in.
pub struct Module {
    pub spirv: Vec<u32>,
    pub hlsl: String,
    pub bindings: Vec<Binding>,
    /// Lanes of a workgroup.
    pub lanes: u64,
}

/// A program and what naga made of it; programs that come out the same share a module.
pub struct Compiled {
    pub name: String,
    pub module: Arc<Module>,
}

/// SPIR-V as wgpu 30 asks for it on a Vulkan 1.3 device with robust buffers, for modules that keep
/// all runtime checks but the bound of loops, and perhaps of indices, and whose workgroup memory is not cleared.
/// Capabilities are those that every device has.
fn spirv_options(checked: bool) -> spv::Options<'static> {
    spv::Options {
        lang_version: (1, 6),
        flags: spv::WriterFlags::LABEL_VARYINGS | spv::WriterFlags::FORCE_POINT_SIZE,
        fake_missing_bindings: true,
        capabilities: Some([spv::Capability::Shader, spv::Capability::Matrix].into_iter().collect()),
        bounds_check_policies: BoundsCheckPolicies {
            index: if checked { BoundsCheckPolicy::Restrict } else { BoundsCheckPolicy::Unchecked },
            buffer: BoundsCheckPolicy::Unchecked,
            image_load: BoundsCheckPolicy::Unchecked,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        ..Default::default()
    }
}

fn hlsl_options(checked: bool) -> hlsl::Options {
    hlsl::Options {
        shader_model: hlsl::ShaderModel::V6_0,
        fake_missing_bindings: true,
        zero_initialize_workgroup_memory: false,
        restrict_indexing: checked,
        force_loop_bounding: false,
        ..Default::default()
    }
}

/// Errors say what naga found, with the place in the source.
pub fn compile(program: &Program) -> Result<Module, String> {
    let module = naga::front::wgsl::parse_str(&program.wgsl).map_err(|e| e.emit_to_string(&program.wgsl))?;
    let mut validator = naga::valid::Validator::new(Default::default(), naga::valid::Capabilities::empty());
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(&program.wgsl))?;
    let constants = program.constants.iter().map(|&(name, value)| (name.to_string(), value)).collect();
    let entry = Some((ShaderStage::Compute, "main"));
    let (module, info) =
        pipeline_constants::process_overrides(&module, &info, entry, &constants).map_err(|e| e.to_string())?;

    let pipeline = spv::PipelineOptions { shader_stage: ShaderStage::Compute, entry_point: "main".into() };
    let spirv = spv::write_vec(&module, &info, &spirv_options(program.checked), Some(&pipeline))
        .map_err(|e| format!("SPIR-V: {e}"))?;
    let (mut text, options, pipeline) = (String::new(), hlsl_options(program.checked), Default::default());
    hlsl::Writer::new(&mut text, &options, &pipeline).write(&module, &info, None).map_err(|e| format!("HLSL: {e}"))?;

    let binding = |(_, global): (_, &naga::GlobalVariable)| {
        let at = global.binding?;
        Some(Binding { group: at.group, binding: at.binding, uniform: global.space == AddressSpace::Uniform })
    };
    let bindings = module.global_variables.iter().filter_map(binding).collect();
    let lanes = module.entry_points[0].workgroup_size.iter().map(|&n| u64::from(n)).product();
    Ok(Module { spirv, hlsl: text, bindings, lanes })
}

/// All programs, compiled once a process.
pub fn compiled() -> &'static [Compiled] {
    static ALL: OnceLock<Vec<Compiled>> = OnceLock::new();
    ALL.get_or_init(|| {
        let mut known: HashMap<Vec<u32>, Arc<Module>> = HashMap::new();
        let one = |program: Program| {
            let module = compile(&program).unwrap_or_else(|e| panic!("{}: {e}", program.name));
            let shared = known.entry(module.spirv.clone()).or_insert_with(|| Arc::new(module));
            Compiled { module: shared.clone(), name: program.name }
        };
        programs().into_iter().map(one).collect()
    })
}

/// Each module once, with the name of the first program that has it.
pub fn distinct(all: &'static [Compiled]) -> Vec<(&'static str, &'static Module)> {
    let mut seen = std::collections::HashSet::new();
    all.iter().filter(|c| seen.insert(Arc::as_ptr(&c.module))).map(|c| (c.name.as_str(), &*c.module)).collect()
}
