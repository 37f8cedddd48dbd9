//! Device memory: named buffers, checked against the device's limits before they are made, and how
//! programs find them.

use std::collections::HashMap;

use bytemuck::Pod;
use wgpu::{BindingResource, Buffer, BufferBinding, BufferUsages as Usage};

use super::device::Gpu;
use crate::contract::EngineError;

/// Bytes between slots of a buffer that are bound one at a time: the largest offset alignment of
/// any device.
pub const SLOT: u64 = 256;
/// Fewest bytes of a buffer: a shader's array of vectors has one.
const LEAST: usize = 16;

/// A buffer to be made.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    pub name: &'static str,
    pub bytes: usize,
    usage: Usage,
}

/// A buffer that shaders read or write.
pub const fn storage(name: &'static str, bytes: usize) -> Size {
    Size { name, bytes, usage: Usage::STORAGE }
}

/// A buffer of parameters.
pub const fn uniform(name: &'static str, bytes: usize) -> Size {
    Size { name, bytes, usage: Usage::UNIFORM }
}

/// A buffer of numbers of workgroups that the device decides on.
pub const fn indirect(name: &'static str, bytes: usize) -> Size {
    Size { name, bytes, usage: Usage::STORAGE.union(Usage::INDIRECT) }
}

/// All buffers of a memory.
#[derive(Clone, Debug)]
pub struct Sizes {
    pub buffers: Vec<Size>,
    /// What asks for them, as in "12 nodes".
    pub load: String,
    /// What helps when one of them is too large.
    pub remedy: &'static str,
}

impl Sizes {
    pub fn total_bytes(&self) -> usize {
        self.buffers.iter().map(|size| size.bytes).sum()
    }

    /// Errors: [`EngineError::Capacity`] when a buffer does not fit the device.
    pub fn check(&self, limits: &wgpu::Limits) -> Result<(), EngineError> {
        let most = most_bytes(limits);
        let Some(Size { name, bytes, .. }) = self.buffers.iter().find(|size| size.bytes as u64 > most) else {
            return Ok(());
        };
        Err(EngineError::Capacity(format!(
            "buffer `{name}` would take {bytes} bytes for {}; one buffer holds at most {most} on this device: {}",
            self.load, self.remedy
        )))
    }
}

/// Most bytes of a buffer.
pub fn most_bytes(limits: &wgpu::Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Buffers by the names that they have in shaders.
///
/// `a_in` and `a_out` are a pair: on side 1 they change places.
#[derive(Default)]
pub struct Memory {
    buffers: HashMap<&'static str, Buffer>,
}

impl Memory {
    /// Makes zeroed buffers. Errors: [`EngineError::Capacity`] when one does not fit the device.
    pub fn new(gpu: &Gpu, sizes: &Sizes) -> Result<Self, EngineError> {
        let mut memory = Self::default();
        memory.grow(gpu, sizes, 0, &[])?;
        Ok(memory)
    }

    /// Makes anew, and zeroed, every buffer that is to be larger. Those named in `keep`, as seen
    /// from `side`, have their contents copied. Errors as in [`Memory::new`].
    pub fn grow(&mut self, gpu: &Gpu, sizes: &Sizes, side: usize, keep: &[&str]) -> Result<(), EngineError> {
        sizes.check(&gpu.limits)?;
        let small = |size: &&Size| self.buffers.get(size.name).is_none_or(|old| old.size() < size.padded());
        let made: Vec<_> = sizes.buffers.iter().filter(small).map(|size| (size.name, size.create(gpu))).collect();
        if !keep.is_empty() {
            gpu.submit(|encoder| {
                for old in keep.iter().map(|name| self.of_side(name, side)) {
                    if let Some((_, new)) = made.iter().find(|(name, _)| self.buffers.get(name) == Some(old)) {
                        encoder.copy_buffer_to_buffer(old, 0, new, 0, old.size());
                    }
                }
            });
        }
        self.buffers.extend(made);
        gpu.check()
    }

    /// Makes a buffer of another memory one of this one, too.
    pub fn share(&mut self, name: &'static str, buffer: &Buffer) {
        self.buffers.insert(name, buffer.clone());
    }

    pub fn get(&self, name: &str) -> &Buffer {
        self.of_side(name, 0)
    }

    /// A buffer as it is called on a side.
    pub fn of_side(&self, name: &str, side: usize) -> &Buffer {
        self.find(name, side).unwrap_or_else(|| panic!("no buffer `{name}`"))
    }

    fn find(&self, name: &str, side: usize) -> Option<&Buffer> {
        let partner = |ours: &str, theirs: &str| {
            let stem = name.strip_suffix(ours)?;
            self.buffers.get(format!("{stem}{theirs}").as_str())
        };
        let across = || partner("_in", "_out").or_else(|| partner("_out", "_in"));
        let other = if side == 1 { across() } else { None };
        other.or_else(|| self.buffers.get(name))
    }

    /// Writes values from element `first` on.
    pub fn write<T: Pod>(&self, gpu: &Gpu, name: &str, first: usize, values: &[T]) {
        gpu.queue.write_buffer(self.get(name), (first * size_of::<T>()) as u64, bytemuck::cast_slice(values));
    }

    /// Writes a value into a slot.
    pub fn write_slot<T: Pod>(&self, gpu: &Gpu, name: &str, index: usize, value: &T) {
        gpu.queue.write_buffer(self.get(name), SLOT * index as u64, bytemuck::bytes_of(value));
    }

    /// The first `count` elements.
    pub fn read<T: Pod>(&self, gpu: &Gpu, name: &str, count: usize) -> Result<Vec<T>, EngineError> {
        gpu.read(self.get(name), count)
    }

    /// `count` elements from `first` on.
    pub fn read_from<T: Pod>(&self, gpu: &Gpu, name: &str, first: usize, count: usize) -> Result<Vec<T>, EngineError> {
        gpu.read_from(self.get(name), first, count)
    }
}

impl Size {
    fn padded(&self) -> u64 {
        self.bytes.next_multiple_of(4).max(LEAST) as u64
    }

    fn create(&self, gpu: &Gpu) -> Buffer {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(self.name),
            size: self.padded(),
            usage: self.usage | Usage::COPY_SRC | Usage::COPY_DST,
            mapped_at_creation: false,
        })
    }
}

/// A part of a buffer on its way to the host.
pub struct Arriving {
    staging: Buffer,
    submission: wgpu::SubmissionIndex,
}

impl Arriving {
    /// Waits for its bytes, on whatever thread. They may be less aligned than what they are made of.
    pub fn arrive<R>(self, gpu: &Gpu, take: impl FnOnce(&[u8]) -> R) -> Result<R, EngineError> {
        gpu.wait(Some(self.submission))?;
        let view = self.staging.get_mapped_range(..).map_err(|e| EngineError::DeviceLost(format!("{e:?}")))?;
        Ok(take(&view))
    }
}

impl Gpu {
    /// Asks for `count` bytes of a buffer from byte `first` on, as they are after all that was submitted.
    pub fn request(&self, buffer: &Buffer, first: u64, count: u64) -> Arriving {
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: count,
            usage: Usage::MAP_READ | Usage::COPY_DST,
            mapped_at_creation: false,
        });
        let submission = self.submit(|encoder| encoder.copy_buffer_to_buffer(buffer, first, &staging, 0, count));
        staging.map_async(wgpu::MapMode::Read, .., |_| {});
        Arriving { staging, submission }
    }

    /// A buffer's first `count` elements.
    pub fn read<T: Pod>(&self, buffer: &Buffer, count: usize) -> Result<Vec<T>, EngineError> {
        self.read_from(buffer, 0, count)
    }

    /// `count` elements of a buffer from element `first` on.
    pub fn read_from<T: Pod>(&self, buffer: &Buffer, first: usize, count: usize) -> Result<Vec<T>, EngineError> {
        let bytes = |elements: usize| (elements * size_of::<T>()) as u64;
        let values = |bytes: &[u8]| bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect();
        self.request(buffer, bytes(first), bytes(count)).arrive(self, values)
    }
}

/// A slot of a buffer.
pub fn slot(buffer: &Buffer, index: usize) -> BindingResource<'_> {
    let size = wgpu::BufferSize::new(SLOT);
    BindingResource::Buffer(BufferBinding { buffer, offset: SLOT * index as u64, size })
}

/// Where a program finds its buffers by the names of its globals; the place that was added first
/// wins.
#[derive(Clone, Default)]
pub struct Scope<'a> {
    places: Vec<Place<'a>>,
}

#[derive(Clone)]
enum Place<'a> {
    One(&'a str, BindingResource<'a>),
    All { prefix: &'static str, memory: &'a Memory, side: usize },
}

impl<'a> Scope<'a> {
    pub fn of(memory: &'a Memory) -> Self {
        Self::default().and(memory)
    }

    pub fn and(self, memory: &'a Memory) -> Self {
        self.and_side(memory, 0)
    }

    /// With pairs as they are on a side.
    pub fn and_side(self, memory: &'a Memory, side: usize) -> Self {
        self.prefixed("", memory, side)
    }

    /// A memory whose buffers are called `prefix` and their name.
    pub fn prefixed(mut self, prefix: &'static str, memory: &'a Memory, side: usize) -> Self {
        self.places.push(Place::All { prefix, memory, side });
        self
    }

    pub fn with(self, name: &'a str, buffer: &'a Buffer) -> Self {
        self.with_part(name, buffer.as_entire_binding())
    }

    pub fn with_part(mut self, name: &'a str, part: BindingResource<'a>) -> Self {
        self.places.push(Place::One(name, part));
        self
    }

    pub(super) fn find(&self, name: &str) -> Option<BindingResource<'a>> {
        self.places.iter().find_map(|place| match place {
            Place::One(own, part) => (*own == name).then(|| part.clone()),
            Place::All { prefix, memory, side } => {
                let buffer = memory.find(name.strip_prefix(prefix)?, *side)?;
                Some(buffer.as_entire_binding())
            }
        })
    }
}
