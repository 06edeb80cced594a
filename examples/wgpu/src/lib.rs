//! Moment shadows in a renderer that is plain wgpu: the renderer fills a map with moments and finds what
//! each pixel receives; a kernel of Hankel says how much shadow that is.

use std::error::Error;

use hankel_example_renderer::{Drawn, Gpu, MAP_SIZE, SCENE, SIZE};

#[allow(dead_code, unused_qualifications)] // Of what is generated, this program needs a part.
mod hankel {
    // Glue:
    include!(concat!(env!("HANKEL_SHADERS"), "/include/hankel.rs"));
    include!(concat!(env!("HANKEL_SHADERS"), "/include/hankel_wgpu.rs"));
    // End of glue.
}

/// Draws the scene.
///
/// # Errors
///
/// There is no device, or it is lost.
pub fn draw() -> Result<Drawn, Box<dyn Error>> {
    let gpu = Gpu::new(wgpu::Features::empty())?;
    let text = format!("{SCENE}{}", include_str!("renderer.wgsl"));
    let pipeline = |entry| gpu.pipeline(wgpu::ShaderSource::Wgsl(text.as_str().into()), entry);
    let pixels = SIZE[0] * SIZE[1];
    let map = gpu.buffer(16 * MAP_SIZE[0] * MAP_SIZE[1]);
    let receivers = gpu.buffer(20 * pixels);
    let [shadows, picture, truth] = [0; 3].map(|_| gpu.buffer(4 * pixels));
    let (map, receivers) = (map.as_entire_binding(), receivers.as_entire_binding());
    let shadow = || shadows.as_entire_binding();
    let [over_map, over_picture] = [MAP_SIZE, SIZE].map(|size| size.map(|n| n.div_ceil(8)));

    gpu.run(&pipeline("fill_map"), &[&[(0, map.clone())]], over_map);
    let resources = [(0, map), (1, receivers.clone())];
    gpu.run(&pipeline("find_receivers"), &[&resources], over_picture);

    find_shadows(&gpu, receivers, shadow());
    let resources = [
        (2, shadow()),
        (3, picture.as_entire_binding()),
        (4, truth.as_entire_binding()),
    ];
    gpu.run(&pipeline("shade"), &[&resources], over_picture);
    Ok(Drawn {
        picture: gpu.read(&picture)?,
        shadows: gpu.read_floats(&shadows)?,
        truth: gpu.read_floats(&truth)?,
    })
}

/// The shadow of each receiver, by the kernel.
#[rustfmt::skip]
fn find_shadows(gpu: &Gpu, receivers: wgpu::BindingResource<'_>, shadows: wgpu::BindingResource<'_>) {
    // Glue:
    use hankel::{Moments4, Settings, hamburger_4msm::{WORKGROUP_SIZE, bindings as at}};
    let kernel = hankel::on_wgpu::hamburger_4msm::pipeline(&gpu.device);
    let bias_target = Moments4 { b1: 0.0, b2: 0.375, b3: 0.0, b4: 0.375 };
    let settings = Settings { bias_target, moment_bias: 5e-7, depth_bias: 1e-3, light_leak: 0.02, least_variance: 0.0 };
    gpu.run(&kernel, &[&[(at::SETTINGS, gpu.uniform(&settings.to_bytes()).as_entire_binding()),
        (at::RECEIVER, receivers), (at::OUT, shadows)]], [(SIZE[0] * SIZE[1]).div_ceil(WORKGROUP_SIZE[0]), 1]);
    // End of glue.
}
