//! Programs: shaders as pipelines that find their buffers by name, and lists of their dispatches.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use naga::valid::{Capabilities, ValidationFlags, Validator};

use super::device::Gpu;
use super::memory::Scope;
use super::source::{compose, file, is_unchecked};
use super::variant::Variant;
use crate::contract::EngineError;

/// Storage buffers that a program may bind: fewer than GPUs that are worth it offer a stage.
pub const STORAGE_BUFFERS: u32 = 20;

/// A buffer that a shader's entry point uses.
#[derive(Clone, Debug)]
pub struct Binding {
    /// Of the global variable.
    pub name: String,
    pub binding: u32,
    pub kind: BindingKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    Uniform,
    ReadOnly,
    ReadWrite,
}

/// A complete shader, whose entry point is `main`; all that a pipeline is made from.
#[derive(Clone, Debug)]
pub struct Shader {
    /// File in `wgsl/` and what it is specialised for, as in `explicit/p2g compact mls closed`.
    pub name: String,
    pub wgsl: String,
    /// Values of its override constants.
    pub constants: Vec<(&'static str, f64)>,
    /// Whether indices into arrays are checked as it runs; accesses to buffers are checked by the device anyway.
    pub checked: bool,
    /// All in group 0.
    pub bindings: Vec<Binding>,
    /// Workgroup memory (bytes).
    pub workgroup_bytes: u32,
}

impl Shader {
    /// The file `name` of `wgsl/` with all that it uses. `workgroup`: lanes of the workgroups that
    /// may be of any size.
    ///
    /// Errors: what is wrong with the shader.
    pub fn new(name: &str, variant: Variant, workgroup: u32) -> Result<Self, String> {
        Self::of_text(&format!("{name} {}", variant.name()), file(name)?, variant, workgroup)
    }

    /// A text that is no file.
    pub fn of_text(name: &str, text: &str, variant: Variant, workgroup: u32) -> Result<Self, String> {
        let wgsl = compose(text, variant.kernel)?;
        let module = naga::front::wgsl::parse_str(&wgsl).map_err(|e| e.emit_to_string(&wgsl))?;
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        let info = validator.validate(&module).map_err(|e| e.emit_to_string(&wgsl))?;
        let main = info.get_entry_point(0);
        let used = || module.global_variables.iter().filter(|(handle, _)| !main[*handle].is_empty());
        let binding = |(_, global): (_, &naga::GlobalVariable)| {
            let kind = match global.space {
                naga::AddressSpace::Uniform => BindingKind::Uniform,
                naga::AddressSpace::Storage { access } if access.contains(naga::StorageAccess::STORE) => {
                    BindingKind::ReadWrite
                }
                _ => BindingKind::ReadOnly,
            };
            Some(Binding { name: global.name.clone()?, binding: global.binding?.binding, kind })
        };
        let bytes = |(_, global): (_, &naga::GlobalVariable)| {
            let here = global.space == naga::AddressSpace::WorkGroup;
            here.then(|| module.types[global.ty].inner.size(module.to_ctx()))
        };
        let declared = |name: &str| module.overrides.iter().any(|(_, o)| o.name.as_deref() == Some(name));
        Ok(Self {
            name: name.to_string(),
            constants: variant.constants(workgroup).into_iter().filter(|(name, _)| declared(name)).collect(),
            checked: !is_unchecked(text),
            bindings: used().filter_map(binding).collect(),
            workgroup_bytes: used().filter_map(bytes).sum(),
            wgsl,
        })
    }

    /// Storage buffers that it binds.
    pub fn storage_buffers(&self) -> usize {
        self.bindings.iter().filter(|b| b.kind != BindingKind::Uniform).count()
    }
}

/// What makes two programs the same: source and constants, with the bits of their values.
pub(super) type Key = (String, Vec<(&'static str, u64)>);

/// A shader, compiled.
pub struct Program {
    /// File in `wgsl/`.
    pub name: &'static str,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    bindings: Vec<Binding>,
}

impl Program {
    /// Binds what it uses. Panics if that is not all in `scope`: a test runs every program.
    fn bind(&self, gpu: &Gpu, scope: &Scope) -> wgpu::BindGroup {
        let entry = |Binding { name, binding, .. }: &Binding| wgpu::BindGroupEntry {
            binding: *binding,
            resource: scope.find(name).unwrap_or_else(|| panic!("{}: no buffer `{name}`", self.name)),
        };
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.name),
            layout: &self.layout,
            entries: &self.bindings.iter().map(entry).collect::<Vec<_>>(),
        })
    }
}

impl Gpu {
    /// The program of a shader, compiled once a device.
    pub fn program(&self, name: &'static str, shader: Shader) -> Arc<Program> {
        let constants = shader.constants.iter().map(|&(name, value)| (name, value.to_bits())).collect();
        let key = (shader.wgsl.clone(), constants);
        let mut programs = self.programs.lock().expect("no panic while compiling");
        programs.entry(key).or_insert_with(|| Arc::new(self.compile(name, shader))).clone()
    }

    fn compile(&self, name: &'static str, shader: Shader) -> Program {
        let descriptor =
            wgpu::ShaderModuleDescriptor { label: Some(name), source: wgpu::ShaderSource::Wgsl(shader.wgsl.into()) };
        let mut checks = wgpu::ShaderRuntimeChecks::checked();
        // Every loop of ours is bounded; naga's guard is a 64-bit counter in each of them.
        checks.force_loop_bounding = false;
        checks.bounds_checks = shader.checked;
        // SAFETY: no shader of ours has an unbounded loop. Those without checks of indices keep them in range
        // themselves, as their heads say; buffers are as large as the counts that index them.
        let module = unsafe { self.device.create_shader_module_trusted(descriptor, checks) };
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            // Of what the entry point uses, as in `bindings`.
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &shader.constants,
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        let layout = pipeline.get_bind_group_layout(0);
        Program { name, pipeline, layout, bindings: shader.bindings }
    }
}

/// A variant's programs by name, each compiled when first used.
pub struct Programs {
    variant: Variant,
    known: Mutex<HashMap<&'static str, Arc<Program>>>,
}

impl Programs {
    pub fn new(variant: Variant) -> Self {
        Self { variant, known: Mutex::default() }
    }

    /// Panics if the shader is faulty: a test compiles all of them.
    fn get(&self, gpu: &Gpu, name: &'static str) -> Arc<Program> {
        let mut known = self.known.lock().expect("no panic while compiling");
        let make = || {
            let shader = Shader::new(name, self.variant, gpu.workgroup);
            gpu.program(name, shader.unwrap_or_else(|e| panic!("{name}: {e}")))
        };
        known.entry(name).or_insert_with(make).clone()
    }
}

/// What dispatches are made with.
#[derive(Clone, Copy)]
pub struct Tools<'a> {
    pub gpu: &'a Gpu,
    pub programs: &'a Programs,
}

/// How many workgroups a dispatch has.
#[derive(Clone, Copy, Debug)]
pub enum Workgroups<'a> {
    /// So many, folded into two dimensions (`group_index` in the shaders).
    Folded(usize),
    /// In x and y.
    Grid([u32; 2]),
    /// As the device decided: three numbers in a buffer, from a byte on.
    Device(&'a wgpu::Buffer, u64),
}

/// Most workgroups in x of a folded dispatch; 65,535 is the limit.
const FOLD: usize = 32768;

/// So many workgroups or a few more, in x and y.
pub fn folded(n: usize) -> [u32; 2] {
    [n.min(FOLD) as u32, n.div_ceil(FOLD) as u32]
}

/// A program with its buffers and an extent, of which its number of workgroups follows.
pub struct Dispatch<E> {
    program: Arc<Program>,
    bind: wgpu::BindGroup,
    pub extent: E,
}

impl<E> Dispatch<E> {
    /// Of a program by the name of its file in `wgsl/`.
    pub fn new(tools: Tools, (name, extent): (&'static str, E), scope: &Scope) -> Self {
        let program = tools.programs.get(tools.gpu, name);
        Self::of(tools.gpu, program, extent, scope)
    }

    pub fn of(gpu: &Gpu, program: Arc<Program>, extent: E, scope: &Scope) -> Self {
        let bind = program.bind(gpu, scope);
        Self { program, bind, extent }
    }

    /// The program's file in `wgsl/`.
    pub fn name(&self) -> &'static str {
        self.program.name
    }

    pub fn record(&self, pass: &mut wgpu::ComputePass, groups: Workgroups) {
        pass.set_pipeline(&self.program.pipeline);
        pass.set_bind_group(0, &self.bind, &[]);
        match groups {
            Workgroups::Folded(n) => {
                let [x, y] = folded(n);
                pass.dispatch_workgroups(x, y, 1);
            }
            Workgroups::Grid([x, y]) => pass.dispatch_workgroups(x, y, 1),
            Workgroups::Device(buffer, offset) => pass.dispatch_workgroups_indirect(buffer, offset),
        }
    }
}

/// Dispatches in order, made once and recorded as often as needed.
pub struct Dispatches<E = Workgroups<'static>> {
    list: Vec<Dispatch<E>>,
}

impl<E> Default for Dispatches<E> {
    fn default() -> Self {
        Self { list: Vec::new() }
    }
}

impl<E: Copy> Dispatches<E> {
    /// Of stages that find their buffers in one scope.
    pub fn new(tools: Tools, stages: &[(&'static str, E)], scope: &Scope) -> Self {
        let list = stages.iter().map(|&stage| Dispatch::new(tools, stage, scope)).collect();
        Self { list }
    }

    pub fn push(&mut self, dispatch: Dispatch<E>) {
        self.list.push(dispatch);
    }

    pub fn iter(&self) -> impl Iterator<Item = &Dispatch<E>> {
        self.list.iter()
    }

    /// Records all; `groups` says what extents stand for.
    pub fn record_with<'a>(&self, pass: &mut wgpu::ComputePass, groups: impl Fn(E) -> Workgroups<'a>) {
        self.list.iter().for_each(|dispatch| dispatch.record(pass, groups(dispatch.extent)));
    }
}

impl Dispatches {
    pub fn record(&self, pass: &mut wgpu::ComputePass) {
        self.record_with(pass, |groups| groups);
    }

    /// Runs them in a submission of their own.
    pub fn submit(&self, gpu: &Gpu) -> Result<(), EngineError> {
        gpu.pass(|pass| self.record(pass));
        gpu.check()
    }
}
