//! How the device filters textures, where Vulkan leaves it a choice that shows in results.

use super::super::error::Result;
use super::{VulkanDevice, own};

/// Places along either axis between the middles of four texels: odd, so that few weights have 8 bits.
const PLACES: u32 = 63;

/// Of the first channel only texel (1, 1) is one: what is filtered is its weight, the product of those along both axes. Of
/// the second (1, 0) and (1, 1) are, of the third (0, 1) and (1, 1): these are the weights along x and along y.
const TEXELS: [[u16; 4]; 4] = [[0; 4], [0, ONE, 0, 0], [0, 0, ONE, 0], [ONE, ONE, ONE, 0]];

/// 1 in 16 bits. Textures of 8 bits are filtered in integers by some.
const ONE: u16 = 0x3c00;

/// What the product may be off by if only sums and products of 32 bits round it.
const SUMS: f32 = 16.0 / (1 << 24) as f32;

fn shader() -> String {
    format!(
        "@group(0) @binding(0) var texels: texture_2d<f32>;
         @group(0) @binding(1) var filtering: sampler;
         @group(0) @binding(2) var<storage, read_write> results: array<vec4<f32>>;

         @compute @workgroup_size({PLACES})
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             let at = (vec2<f32>(id.xy) + 0.5) / {PLACES}.0;
             results[id.y * {PLACES}u + id.x] = textureSampleLevel(texels, filtering, 0.25 + 0.5 * at, 0.0);
         }}"
    )
}

impl VulkanDevice {
    /// Whether it rounds the four weights of a bilinear filter, so that they are no products of the weights along the
    /// axes; measured once.
    ///
    /// # Errors
    /// The driver's.
    pub fn rounds_products(&mut self) -> Result<bool> {
        if let Some(known) = self.rounds_products {
            return Ok(known);
        }
        let filtered = self.filtered()?;
        let rounds = filtered
            .iter()
            .any(|[product, x, y, _]| (product - x * y).abs() > SUMS);
        self.rounds_products = Some(rounds);
        Ok(rounds)
    }

    /// What the device filters of [`TEXELS`].
    fn filtered(&self) -> Result<Vec<[f32; 4]>> {
        let during = || "measuring how textures are filtered".to_owned();
        let size = u64::from(PLACES * PLACES) * 16;
        let results = self.guarded(&during, |device| {
            let extent = wgpu::Extent3d {
                width: 2,
                height: 2,
                depth_or_array_layers: 1,
            };
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some("texels"),
                size: extent,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba16Float,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            });
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(2 * 8),
                rows_per_image: None,
            };
            let texels = bytemuck::cast_slice(&TEXELS);
            self.queue
                .write_texture(texture.as_image_copy(), texels, layout, extent);
            let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("filtering"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            });
            let results = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("results"),
                size,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            let view = texture.create_view(&Default::default());
            let resources = [
                wgpu::BindingResource::TextureView(&view),
                wgpu::BindingResource::Sampler(&sampler),
                results.as_entire_binding(),
            ];
            let pipeline = own::pipeline(device, "filter", shader());
            self.run_own(device, "filter", &pipeline, resources, [1, PLACES, 1]);
            results
        })?;
        let bytes = self.download(&results, size, "measured filter")?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }
}
