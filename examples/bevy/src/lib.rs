//! Bevy's own shadow shaders with moment shadows: naga_oil composes them with a module whose function takes
//! the place of `bevy_pbr::shadow_sampling::sample_shadow_map` and calls Hankel's. Bevy itself is not built; a small
//! renderer fills the buffers that Bevy would fill.

mod lights;

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;

use hankel_example_renderer::{Drawn, Gpu, MAP_SIZE, SCENE, SIZE};
use naga_oil::compose::{
    ComposableModuleDescriptor, Composer, ImportDefinition, NagaModuleDescriptor, ShaderDefValue,
};

/// Bevy's modules that its shadows need, each after those that it imports.
const MODULES: [&str; 11] = [
    "bevy_render/src/maths.wgsl",
    "bevy_render/src/color_operations.wgsl",
    "bevy_render/src/globals.wgsl",
    "bevy_render/src/view/view.wgsl",
    "bevy_pbr/src/atmosphere/types.wgsl",
    "bevy_pbr/src/render/rgb9e5.wgsl",
    "bevy_pbr/src/render/utils.wgsl",
    "bevy_pbr/src/render/mesh_view_types.wgsl",
    "bevy_pbr/src/render/mesh_view_bindings.wgsl",
    "bevy_pbr/src/render/shadow_sampling.wgsl",
    "bevy_pbr/src/render/shadows.wgsl",
];

/// What Bevy defines for its shaders on a desktop.
fn definitions() -> HashMap<String, ShaderDefValue> {
    [
        ("MAX_CASCADES_PER_LIGHT", 4),
        ("MAX_DIRECTIONAL_LIGHTS", 10),
        ("MAX_RECT_LIGHTS", 8),
        ("AVAILABLE_STORAGE_BUFFER_BINDINGS", 8),
        ("MATERIAL_BIND_GROUP", 3),
    ]
    .map(|(name, value)| (name.to_owned(), ShaderDefValue::UInt(value)))
    .into_iter()
    .chain([(
        "SHADOW_FILTER_METHOD_GAUSSIAN".to_owned(),
        ShaderDefValue::Bool(true),
    )])
    .collect()
}

/// What Bevy's `Shader::additional_imports` has for a module that only overrides.
fn import(name: &str) -> ImportDefinition {
    ImportDefinition {
        import: name.to_owned(),
        ..Default::default()
    }
}

/// Bevy's lookup of shadows, with moments in it, as one validated module. `bevy` is the folder with the
/// sources of bevy_pbr and bevy_render, `library` the text that
/// `hankel build --form functions` wrote to `naga-oil/hankel_shadows.wgsl`.
///
/// # Errors
///
/// A source cannot be read or composed.
pub fn compose(bevy: &Path, library: &str) -> Result<naga::Module, Box<dyn Error>> {
    let mut composer = Composer::default().with_capabilities(naga::valid::Capabilities::all());
    let mut add = |source: &str, file_path: &str| {
        let module = ComposableModuleDescriptor {
            source,
            file_path,
            shader_defs: definitions(),
            ..Default::default()
        };
        let added = composer.add_composable_module(module);
        let result = added.map(|_| ()).map_err(|error| error.inner.to_string());
        result.map_err(|problem| format!("{file_path}: {problem}"))
    };
    for file in MODULES {
        let path = bevy.join(file);
        let text = std::fs::read_to_string(&path)
            .map_err(|error| format!("{}: {error}", path.display()))?;
        add(&text, file)?;
    }
    // Glue:
    add(library, "hankel_shadows.wgsl")?;
    add(include_str!("moment_shadows.wgsl"), "moment_shadows.wgsl")?;
    // End of glue.
    let shader = NagaModuleDescriptor {
        source: include_str!("find_shadows.wgsl"),
        file_path: "find_shadows.wgsl",
        shader_defs: definitions(),
        // Glue:
        additional_imports: &[import("moment_shadows")],
        // End of glue.
        ..Default::default()
    };
    let composed = composer.make_naga_module(shader);
    composed.map_err(|error| error.emit_to_string(&composer).into())
}

/// Draws the scene; the arguments are those of [`compose`].
///
/// # Errors
///
/// There are no shaders, or no device.
pub fn draw(bevy: &Path, library: &str) -> Result<Drawn, Box<dyn Error>> {
    let gpu = Gpu::new(wgpu::Features::FLOAT32_FILTERABLE)?;
    let module = compose(bevy, library)?;
    let lights = gpu.uniform(&lights::uniform(&module)?);
    let theirs = gpu.pipeline(
        wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(module)),
        "find_shadows",
    );
    let text = format!("{SCENE}{}", include_str!("surfaces.wgsl"));
    let pipeline = |entry| gpu.pipeline(wgpu::ShaderSource::Wgsl(text.as_str().into()), entry);
    let moment_maps = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d {
            width: MAP_SIZE[0],
            height: MAP_SIZE[1],
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    let layers = moment_maps.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    });
    // What Bevy binds, too, and its soft shadows would read: the light has none.
    let depths = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d::default(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Depth32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    let depths = depths.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    let comparison = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        compare: Some(wgpu::CompareFunction::GreaterEqual),
        ..Default::default()
    });
    let globals = gpu.uniform(&[0; 256]);
    let of_view = [
        (1, lights.as_entire_binding()),
        (5, wgpu::BindingResource::TextureView(&depths)),
        (6, wgpu::BindingResource::Sampler(&comparison)),
        (11, globals.as_entire_binding()),
    ];
    let pixels = SIZE[0] * SIZE[1];
    let surfaces = gpu.buffer(32 * pixels);
    let [shadows, picture, truth] = [0; 3].map(|_| gpu.buffer(4 * pixels));
    let [over_map, over_picture] = [MAP_SIZE, SIZE].map(|size| size.map(|n| n.div_ceil(8)));
    let texture = || wgpu::BindingResource::TextureView(&layers);
    let (surface, shadow) = (
        || surfaces.as_entire_binding(),
        || shadows.as_entire_binding(),
    );

    gpu.run(&pipeline("fill_map"), &[&[(0, texture())]], over_map);
    gpu.run(
        &pipeline("find_surfaces"),
        &[&[(1, surface())]],
        over_picture,
    );
    let of_material = [
        (100, texture()),
        (101, wgpu::BindingResource::Sampler(&sampler)),
    ];
    gpu.run(
        &theirs,
        &[&of_view, &[(0, surface())], &[(0, shadow())], &of_material],
        [pixels.div_ceil(64), 1],
    );
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
