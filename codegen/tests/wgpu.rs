//! The headers for users of wgpu, included and run: a kernel whose bindings are in two groups, neither of
//! them group 0, gives what it gives with all of them there.

mod support;

use std::num::NonZeroU64;

use hankel_codegen::build::generate;

/// As a host includes them. They are made in `placement.rs`, which compares them, too.
#[allow(
    clippy::all,
    dead_code,
    unused_qualifications,
    reason = "generated, and more than one host uses"
)]
mod shaders {
    include!("placed/include/hankel.rs");
    include!("placed/include/hankel_wgpu.rs");
}

struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
}

impl Gpu {
    fn new() -> Self {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        let instance = wgpu::Instance::new(descriptor);
        let adapter = pollster::block_on(instance.request_adapter(&Default::default())).expect(
            "this test needs a Vulkan driver (Debian: apt-get install mesa-vulkan-drivers)",
        );
        let (device, queue) =
            pollster::block_on(adapter.request_device(&Default::default())).unwrap();
        Self { device, queue }
    }

    fn buffer(&self, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: bytes.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    fn group(
        &self,
        layout: &wgpu::BindGroupLayout,
        buffers: &[(u32, &wgpu::Buffer)],
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = buffers
            .iter()
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding: *binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout,
            entries: &entries,
        })
    }

    /// Runs one workgroup, and reads a buffer.
    fn run(
        &self,
        pipeline: &wgpu::ComputePipeline,
        groups: &[(u32, wgpu::BindGroup)],
        out: &wgpu::Buffer,
    ) -> Vec<u8> {
        let copy = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: out.size(),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            for (number, group) in groups {
                pass.set_bind_group(*number, group, &[]);
            }
            pass.dispatch_workgroups(1, 1, 1);
        }
        encoder.copy_buffer_to_buffer(out, 0, &copy, 0, out.size());
        self.queue.submit([encoder.finish()]);
        copy.slice(..)
            .map_async(wgpu::MapMode::Read, |mapped| mapped.unwrap());
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .unwrap();
        copy.slice(..).get_mapped_range().unwrap().to_vec()
    }
}

#[test]
fn a_kernel_runs_with_its_bindings_elsewhere() {
    use shaders::bound::{wgsl_bindings as at, wgsl_groups as group};
    use shaders::on_wgpu::bound;
    assert_eq!((group::SETTINGS, group::INPUT, group::OUT), (1, 1, 3));
    assert_eq!((at::SETTINGS, at::INPUT, at::OUT), (0, 1, 5));
    assert_eq!((bound::LAYOUT_1.len(), bound::LAYOUT_3.len()), (2, 1));
    let least = match bound::LAYOUT_3[0].ty {
        wgpu::BindingType::Buffer {
            min_binding_size, ..
        } => min_binding_size,
        other => panic!("{other:?}"),
    };
    assert_eq!(least, NonZeroU64::new(8));

    const ROWS: usize = 3;
    let gpu = Gpu::new();
    let settings = shaders::Settings {
        bias: 3e-5,
        depth_bias: 1e-3,
        pad0: 0.0,
        pad1: 0.0,
    };
    let settings = gpu.buffer(&settings.to_bytes(), wgpu::BufferUsages::UNIFORM);
    let mut rows = Vec::new();
    for row in 0..ROWS {
        let (a, b) = (0.2 + 0.1 * row as f32, 0.7);
        let moment = |n: i32| 0.5 * (a.powi(n) + f32::powi(b, n));
        let moments = shaders::Moments {
            b1: moment(1),
            b2: moment(2),
            b3: moment(3),
            b4: moment(4),
            z: 0.5,
        };
        rows.extend(moments.to_bytes());
    }
    let input = gpu.buffer(&rows, wgpu::BufferUsages::STORAGE);
    let new_output = || gpu.buffer(&[0; 8 * ROWS], wgpu::BufferUsages::STORAGE);

    let out = new_output();
    let groups = [
        (
            group::SETTINGS,
            gpu.group(
                &bound::bind_group_layout_1(&gpu.device),
                &[(at::SETTINGS, &settings), (at::INPUT, &input)],
            ),
        ),
        (
            group::OUT,
            gpu.group(&bound::bind_group_layout_3(&gpu.device), &[(at::OUT, &out)]),
        ),
    ];
    let elsewhere = gpu.run(&bound::pipeline(&gpu.device), &groups, &out);

    // The same text with everything in group 0, laid out by wgpu.
    let generated = generate(&support::request(), &support::modules()).unwrap();
    let text = String::from_utf8(generated.files["wgsl/bound.wgsl"].clone()).unwrap();
    let module = gpu
        .device
        .create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
    let pipeline = gpu
        .device
        .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: Some("bound"),
            compilation_options: Default::default(),
            cache: None,
        });
    let out = new_output();
    let groups = [(
        0,
        gpu.group(
            &pipeline.get_bind_group_layout(0),
            &[(0, &settings), (1, &input), (2, &out)],
        ),
    )];
    let by_default = gpu.run(&pipeline, &groups, &out);
    assert_eq!(elsewhere, by_default);
    let visibilities: Vec<f32> = by_default
        .chunks_exact(8)
        .map(|row| f32::from_le_bytes([row[0], row[1], row[2], row[3]]))
        .collect();
    assert!(
        visibilities.iter().all(|it| it.is_finite() && *it != 0.0),
        "{visibilities:?}"
    );
}
