//! Dispatches whose size is in a buffer: WebGPU wants numbers of workgroups there, kernels say how many
//! invocations run. A shader of three lines makes the one of the other.

use hankel_dsl::native::describe::Kernel;

use super::super::error::Result;
use super::{BufferId, VulkanDevice, own};

const LABEL: &str = "workgroups of a range";

const SHADER: &str = "
struct Asked {
    threads: vec3<u32>,
    first: u32,
    dimensions: u32,
    most: u32,
}
@group(0) @binding(0) var<storage, read> says: array<u32>;
@group(0) @binding(1) var<uniform> asked: Asked;
@group(0) @binding(2) var<storage, read_write> groups: array<u32, 3>;

@compute @workgroup_size(1)
fn main() {
    for (var i = 0u; i < 3u; i++) {
        var n = 1u;
        if (i < asked.dimensions) {
            n = says[asked.first + i];
        }
        let whole = n / asked.threads[i];
        groups[i] = min(whole + u32(n > whole * asked.threads[i]), asked.most);
    }
}
";

/// What every such dispatch uses.
#[derive(Debug)]
pub struct Indirect {
    pipeline: wgpu::ComputePipeline,
    /// `Asked` of the shader.
    asked: wgpu::Buffer,
    /// Numbers of workgroups along x, y, z.
    groups: wgpu::Buffer,
}

impl Indirect {
    fn new(device: &wgpu::Device) -> Self {
        let buffer = |label, size, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        Self {
            pipeline: own::pipeline(device, LABEL, SHADER.into()),
            asked: buffer(
                "asked",
                32,
                wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            ),
            groups: buffer(
                "workgroups",
                12,
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT,
            ),
        }
    }
}

impl VulkanDevice {
    /// How many workgroups of `threads` invocations a kernel needs for the range that `says` holds
    /// `offset` bytes from its start, at most as many along an axis as the device can run. The buffer holds
    /// it until the next call.
    pub(super) fn groups_of(
        &mut self,
        kernel: &Kernel,
        threads: [u32; 3],
        says: BufferId,
        offset: u32,
        dimensions: u32,
    ) -> Result<wgpu::Buffer> {
        let during = || format!("reading how far kernel `{}` runs", kernel.name);
        let indirect = match self.indirect.take() {
            Some(indirect) => indirect,
            None => self.guarded(&during, Indirect::new)?,
        };
        let [x, y, z] = threads.map(|n| n.max(1));
        let most = self.limits.max_compute_workgroups_per_dimension;
        let asked = [x, y, z, offset / 4, dimensions, most, 0, 0];
        let result = self.memory(says).and_then(|memory| {
            self.guarded(&during, |device| {
                self.queue
                    .write_buffer(&indirect.asked, 0, bytemuck::cast_slice(&asked));
                let buffers = [&memory.buffer, &indirect.asked, &indirect.groups];
                let resources = buffers.map(|buffer| buffer.as_entire_binding());
                self.run_own(device, LABEL, &indirect.pipeline, resources, [1; 3]);
            })
        });
        let groups = indirect.groups.clone();
        self.indirect = Some(indirect);
        result.map(|()| groups)
    }
}
