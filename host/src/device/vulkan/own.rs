//! Shaders of the device's own, for what Vulkan or WebGPU neither do nor tell.

use super::VulkanDevice;

/// A pipeline of the one entry point of `text`, which is WGSL.
pub(super) fn pipeline(device: &wgpu::Device, label: &str, text: String) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(label),
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: Default::default(),
        cache: None,
    })
}

impl VulkanDevice {
    /// Submits `groups` workgroups of a [`pipeline`], with `resources` at bindings 0, 1 and so on.
    pub(super) fn run_own<'a>(
        &self,
        device: &wgpu::Device,
        label: &str,
        pipeline: &wgpu::ComputePipeline,
        resources: impl IntoIterator<Item = wgpu::BindingResource<'a>>,
        [x, y, z]: [u32; 3],
    ) {
        let entries: Vec<wgpu::BindGroupEntry<'a>> = (0..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(label),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(x, y, z);
        }
        self.queue.submit([encoder.finish()]);
    }
}
