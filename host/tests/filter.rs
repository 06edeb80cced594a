//! How a device's samplers filter: what [`hankel_host::parity::intervals`] takes them to do at most.

mod common;

use common::*;
use hankel_dsl::native::describe::*;
use hankel_dsl::native::{Address, Filter, Sampler};
use hankel_host::device::{Bind, Device, Program, Shader, TextureShape};

/// Places along either axis of the picture of results.
const PLACES: u32 = 251;
/// Texels along either axis of the texture's first level.
const TEXELS: u32 = 8;
/// What a weight may be off by: half a step of 8 bits is enough, a whole one is allowed.
const WEIGHT: f32 = 1.0 / 256.0;
/// What the product of two weights may be off by, if the device rounds it: half a step of 8 bits.
const PRODUCT: f32 = 0.5 / 256.0;
/// What the sums of a filter may be off by, as a share of the largest texel.
const SUMS: f32 = 4.0 / (1 << 24) as f32;

/// The place along an axis that number `i` of the picture samples, in texels from the middle of the first, and the
/// level.
fn place(i: u32) -> (f32, f32) {
    let at = i as f32 / PLACES as f32;
    let u = (3.5 + at * 2.0) / TEXELS as f32;
    (u * TEXELS as f32 - 0.5, at)
}

/// What a device samples at these places, with linear filters, of a texture whose texels at column x, row y and
/// level are `texel(x, y, level)`.
fn sampled(by_level: bool, texel: impl Fn(u32, u32, u32) -> [f32; 4]) -> Vec<[f32; 4]> {
    let level = if by_level { "at.x" } else { "0.0" };
    let text = format!(
        "@group(0) @binding(0) var map: texture_2d<f32>;
         @group(0) @binding(1) var filtering: sampler;
         @group(0) @binding(2) var out: texture_storage_2d<rgba32float, write>;
         @compute @workgroup_size(8, 8) fn sampled(@builtin(global_invocation_id) id: vec3<u32>) {{
             let at = vec2<f32>(id.xy) / {PLACES}.0;
             let uv = (3.5 + at * 2.0) / {TEXELS}.0;
             textureStore(out, vec2<i32>(id.xy), textureSampleLevel(map, filtering, uv, {level}));
         }}"
    );
    let texture = TextureKind::Texture2d;
    let map = param(
        "map",
        Role::Texture {
            binding: 0,
            texture,
        },
    );
    let filtering = Role::Sampler {
        binding: 1,
        sampler: SamplerKind::Filtering,
    };
    let out = Output::Texture {
        binding: 2,
        format: TexelFormat::Rgba32Float,
        dimensions: 2,
    };
    let params = vec![
        map,
        param("filtering", filtering),
        param("index", Role::Index),
    ];
    let kernel = kernel("sampled", compute([8, 8, 1], 2), params, vec![out]);
    let program = Program {
        kernel: &kernel,
        constants: &[],
        native: None,
        shader: Some(Shader::Wgsl {
            text: &text,
            entry_point: "sampled",
        }),
    };
    let mut texels = Vec::new();
    for level in 0..2 {
        let size = TEXELS >> level;
        for i in 0..size * size {
            texels.push(texel(i % size, i / size, level));
        }
    }
    let mut device = vulkan();
    let float = TexelFormat::Rgba32Float;
    let shape = TextureShape::d2(TEXELS, TEXELS, float).with_levels(2);
    let map = device.texture_from("map", &shape, bytemuck::cast_slice(&texels));
    let out = device.texture("out", &TextureShape::d2(PLACES, PLACES, float));
    let (map, out) = (map.unwrap(), out.unwrap());
    let sampler = Sampler::new(Filter::Linear, Address::ClampToEdge);
    let args = [
        Bind::Texture(map),
        Bind::Sampler(sampler),
        Bind::Texture(out),
    ];
    device.dispatch(&program, &args).unwrap();
    bytemuck::pod_collect_to_vec(&device.read_texture(out).unwrap())
}

/// Columns, rows and results.
fn each(results: &[[f32; 4]]) -> impl Iterator<Item = (u32, u32, [f32; 4])> {
    (0..)
        .zip(results)
        .map(|(i, r)| (i % PLACES, i / PLACES, *r))
}

#[test]
fn weights_between_texels_are_those_of_a_place_a_256th_of_a_texel_off_at_most() {
    let results = sampled(false, |x, y, _| {
        let (x, y) = (x as f32, y as f32);
        [x, y, x * y, 1.0]
    });
    let (mut along, mut across, mut sum) = (0.0f32, 0.0f32, 0.0f32);
    for (i, j, [x, y, product, one]) in each(&results) {
        along = along
            .max((x - place(i).0).abs())
            .max((y - place(j).0).abs());
        // The texel's product of column and row is x * y if the weights of four texels are products of those along both
        // axes, and off by as much as they are.
        across = across.max((product - x * y).abs());
        sum = sum.max((one - 1.0).abs());
    }
    let largest = (TEXELS - 1) as f32;
    let rounds_products = vulkan().rounds_products().unwrap();
    println!(
        "weights are off by {:.2} / 256, their products by {:.3} / 256{}, their sum by {:.1} / 2^24",
        along * 256.0,
        across * 256.0,
        if rounds_products { " (rounded)" } else { "" },
        sum * (1 << 24) as f32
    );
    assert!(along <= WEIGHT + SUMS * largest, "{along}");
    let product = if rounds_products { PRODUCT } else { 0.0 };
    assert!(across <= product + SUMS * largest * largest, "{across}");
    assert!(sum <= SUMS, "{sum}");
}

#[test]
fn weights_between_levels_are_those_of_a_level_a_256th_off_at_most() {
    let results = sampled(true, |_, _, level| [level as f32, 1.0, 0.0, 1.0]);
    let (mut level, mut sum) = (0.0f32, 0.0f32);
    for (i, _, [between, one, ..]) in each(&results) {
        level = level.max((between - place(i).1).abs());
        sum = sum.max((one - 1.0).abs());
    }
    println!("levels are off by {:.2} / 256", level * 256.0);
    assert!(level <= WEIGHT + SUMS, "{level}");
    assert!(sum <= SUMS, "{sum}");
}
