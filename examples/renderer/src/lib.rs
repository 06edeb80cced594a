//! What the examples have before Hankel comes: a scene in WGSL, and wgpu's devices, pipelines and
//! buffers in a few functions. Everything is drawn by compute shaders, without a window.

pub mod check;

use std::error::Error;
use std::fs::File;
use std::path::Path;

use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// The scene: what rays hit, and how it is shaded.
pub const SCENE: &str = include_str!("scene.wgsl");

/// Pixels of the picture, as in the scene.
pub const SIZE: [u32; 2] = [600, 360];

/// Texels of the shadow map, as in the scene.
pub const MAP_SIZE: [u32; 2] = [256, 256];

/// The light's axes in world space, as in the scene.
pub const LIGHT_RIGHT: [f32; 3] = [-0.6247, 0.0, -0.78087];
/// The second axis.
pub const LIGHT_UP: [f32; 3] = [-0.49976, 0.76838, 0.39981];
/// The third axis: towards the light.
pub const TOWARD_LIGHT: [f32; 3] = [0.6, 0.64, -0.48];

/// Half the extent that the light's map covers along each axis, as in the scene.
pub const EXTENT: [f32; 3] = [7.0, 7.0, 14.0];

/// What an example draws.
pub struct Drawn {
    /// The picture, four bytes a pixel.
    pub picture: Vec<u8>,
    /// The shadow of each pixel, from 0 (lit) to 1, by the shadow map.
    pub shadows: Vec<f32>,
    /// The shadow of each pixel, 0 or 1, by a ray; 0 in the sky, 0.5 on what turns away from the light.
    pub truth: Vec<f32>,
}

/// A device and its queue.
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
}

impl Gpu {
    /// The first device that wgpu finds, with these features.
    ///
    /// # Errors
    ///
    /// There is no device, or it lacks a feature.
    pub fn new(required_features: wgpu::Features) -> Result<Self, Box<dyn Error>> {
        let instance = wgpu::Instance::default();
        let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
        let wanted = wgpu::DeviceDescriptor {
            required_features,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&wanted))?;
        Ok(Self { device, queue })
    }

    /// The pipeline of an entry point, with the layout that its shader needs.
    #[must_use]
    pub fn pipeline(&self, source: wgpu::ShaderSource<'_>, entry: &str) -> wgpu::ComputePipeline {
        let module = self
            .device
            .create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(entry),
                source,
            });
        self.device
            .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            })
    }

    /// A buffer of `bytes` bytes that shaders write.
    #[must_use]
    pub fn buffer(&self, bytes: u32) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(bytes),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        })
    }

    /// A uniform buffer with these contents.
    #[must_use]
    pub fn uniform(&self, contents: &[u8]) -> wgpu::Buffer {
        self.device.create_buffer_init(&BufferInitDescriptor {
            label: None,
            contents,
            usage: wgpu::BufferUsages::UNIFORM,
        })
    }

    /// Runs a pipeline in so many workgroups, with the resources of each bind group.
    pub fn run(
        &self,
        pipeline: &wgpu::ComputePipeline,
        groups: &[&[(u32, wgpu::BindingResource<'_>)]],
        workgroups: [u32; 2],
    ) {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(pipeline);
        for (index, resources) in (0..).zip(groups) {
            let entries: Vec<_> = resources
                .iter()
                .map(|(binding, resource)| wgpu::BindGroupEntry {
                    binding: *binding,
                    resource: resource.clone(),
                })
                .collect();
            let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &pipeline.get_bind_group_layout(index),
                entries: &entries,
            });
            pass.set_bind_group(index, &group, &[]);
        }
        pass.dispatch_workgroups(workgroups[0], workgroups[1], 1);
        drop(pass);
        self.queue.submit([encoder.finish()]);
    }

    /// What is in a buffer.
    ///
    /// # Errors
    ///
    /// The device is lost.
    pub fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>, Box<dyn Error>> {
        let copy = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: buffer.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
        self.queue.submit([encoder.finish()]);
        copy.slice(..).map_async(wgpu::MapMode::Read, |_| ());
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        Ok(copy.slice(..).get_mapped_range()?.to_vec())
    }

    /// What is in a buffer of floats.
    ///
    /// # Errors
    ///
    /// The device is lost.
    pub fn read_floats(&self, buffer: &wgpu::Buffer) -> Result<Vec<f32>, Box<dyn Error>> {
        let bytes = self.read(buffer)?;
        let words = bytes.chunks_exact(4);
        Ok(words
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect())
    }
}

/// Writes a picture as PNG.
///
/// # Errors
///
/// The file cannot be written.
pub fn save(path: &Path, picture: &[u8]) -> Result<(), Box<dyn Error>> {
    let mut encoder = png::Encoder::new(File::create(path)?, SIZE[0], SIZE[1]);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(picture)?;
    Ok(writer.finish()?)
}
