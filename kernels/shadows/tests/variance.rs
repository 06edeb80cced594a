//! What variance shadow mapping takes from the map.

use hankel_dsl::glam::{Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::{Address, Filter, Sampler, TextureRef};
use hankel_dsl::{Sampler as Sampled, Texture2d};
use hankel_moments::variance_2;
use hankel_shadows::shade::{Light, encoding};
use hankel_shadows::variance::shade_variance;

/// The bias is the least variance and nothing else: moments that a bias target is mixed into have a
/// larger variance already, so that the shadow would be biased twice.
#[test]
fn the_bias_counts_once() {
    let (b1, b2, bias) = (-0.2_f32, 0.05_f32, 0.01_f32);
    let texel = [b1, b2];
    let bytes: Vec<u8> = texel.iter().flat_map(|x| x.to_ne_bytes()).collect();
    let map = Texture2d::new(TextureRef {
        size: [1, 1, 1],
        levels: 1,
        layers: 1,
        samples: 1,
        number: 0,
        format: TexelFormat::Rg32Float,
        bytes: &bytes,
    });
    let sampler = Sampled::new(Sampler::new(Filter::Linear, Address::ClampToEdge));
    let light = Light {
        row_u: Vec4::W * 0.5,
        row_v: Vec4::W * 0.5,
        row_depth: Vec4::new(0.0, 0.0, 1.0, 0.0),
        row_w: Vec4::W,
        position: Vec4::Z,
        colour: Vec3::ONE,
        falloff: 0.0,
        cone: Vec4::W,
        ambient: Vec4::ZERO,
        bias_target: Vec4::new(0.0, 0.63, 0.0, 0.63),
        moment_bias: bias,
        depth_bias: 0.0,
        light_leak: 0.0,
        filter_radius: 0,
    };
    for depth in [0.45_f32, 0.5, 0.7] {
        let world = Vec3::new(0.0, 0.0, depth);
        let shaded = shade_variance(
            world,
            Vec3::Z,
            Vec3::ONE,
            &light,
            map,
            sampler,
            encoding::PLAIN,
        );
        let expected = 1.0 - variance_2(b1, b2, 2.0 * depth - 1.0, bias);
        assert!((shaded.x - expected).abs() < 1e-6, "{shaded} {expected}");
        assert!(expected > 0.01 && expected < 0.99, "{expected}");
    }
}
