//! Both backends draw the same picture. The shaders are the committed SPIR-V of the built-in
//! kernels.

mod common;

use std::path::Path;

use common::shaders;
use hankel_frames::scene::Scene;
use hankel_frames::{Comparison, Quiet, compare, render, techniques};
use hankel_host::device::Backend;

fn scene(geometry: &str, light: &str, shadow: &str) -> Scene {
    let eye = match geometry {
        "box" => "[1.9, 1.6, 3.1]",
        "glass" => "[3.4, 2.6, 4.6]",
        _ => "[7.4, 6.2, 12.4]",
    };
    let size = match shadow.contains("size = ") {
        true => "",
        false => "size = 256",
    };
    let text = format!(
        r#"
        [geometry]
        procedural = "{geometry}"
        [camera]
        eye = {eye}
        target = [-0.2, 0.2, -0.3]
        [light]
        direction = [0.62, -0.62, 0.48]
        {light}
        [shadow]
        {size}
        {shadow}
        [output]
        width = 240
        height = 135
        "#
    );
    Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"))
}

fn both(geometry: &str, light: &str, shadow: &str) -> Comparison {
    let scene = scene(geometry, light, shadow);
    compare(&scene, &shaders(), 16, &mut Quiet).unwrap_or_else(|e| panic!("{e}"))
}

fn agree(geometry: &str, shadow: &str) {
    lit_agree(geometry, "", shadow);
}

fn lit_agree(geometry: &str, light: &str, shadow: &str) {
    let c = both(geometry, light, shadow);
    let edges = c.native.edges.unwrap_or(0.0);
    let what = format!(
        "{geometry}, {light}, {shadow}: {}, edges {edges:.4}",
        c.difference
    );
    assert!(edges > 0.01 && edges < 0.8, "{what}");
    assert!(c.difference.over_1 <= c.limit(), "{what}");
    // The picture shows something: not all of one colour.
    let first = c.vulkan.picture.pixels[0];
    let other = c
        .vulkan
        .picture
        .pixels
        .iter()
        .filter(|p| **p != first)
        .count();
    assert!(other * 4 > c.vulkan.picture.pixels.len(), "{what}");
}

#[test]
fn every_technique_agrees_on_a_box() {
    for technique in techniques::ALL {
        for map in technique.maps {
            let (format, range) = (map.format.name(), map.depth_range.name());
            agree(
                "box",
                &format!(
                    "technique = '{}'\nformat = '{format}'\ndepth_range = '{range}'",
                    technique.name
                ),
            );
        }
    }
}

/// A table of so many texels is more than a kernel of 64 invocations in one dimension can run over: 65 535 workgroups
/// along an axis are what every device has.
#[test]
fn tables_of_soft_shadows_are_made_of_large_maps() {
    for technique in ["soft", "soft-6", "vssm"] {
        let [small, large] = [1024, 2048].map(|size| {
            let shadow = format!("technique = '{technique}'\nsize = {size}");
            let scene = scene("box", "radius = 0.1", &shadow);
            let drawn = render(&scene, Backend::Vulkan, &shaders(), &mut Quiet);
            drawn.unwrap_or_else(|e| panic!("{e}")).picture
        });
        let difference = small.difference(&large, 1).unwrap();
        assert!(difference.over_8 < 0.03, "{technique}: {difference}");
    }
}

#[test]
fn every_map_agrees_in_the_yard() {
    for map in [
        "",
        "depth_range = 'unit'",
        "format = 'rgba32float'",
        "filter = 1",
    ] {
        agree("yard", map);
    }
}

/// Levels that samplers interpolate, looked up with a footprint.
#[test]
fn mip_levels_agree_in_the_yard() {
    for map in [
        "technique = 'hamburger'\nanisotropy = 1",
        "technique = 'hamburger'\nformat = 'rgba32float'\nanisotropy = 16",
        "technique = 'hausdorff'\nanisotropy = 4",
        "technique = 'hamburger-6'\nanisotropy = 4",
        "technique = 'moments-4'\nanisotropy = 4",
        "technique = 'moments-10'\nanisotropy = 4",
        "technique = 'convolution'\nanisotropy = 4",
        "technique = 'convolution-8'\nformat = 'rgba16unorm'\nanisotropy = 4",
        "technique = 'vsm'\nanisotropy = 4",
        "technique = 'vsm'\nformat = 'rg32float'\nanisotropy = 4",
        "technique = 'tmsm'\nanisotropy = 4",
        "technique = 'esm'\nanisotropy = 4",
        "technique = 'evsm4'\nanisotropy = 4",
        "technique = 'evsm2'\nformat = 'rg16float'\nanisotropy = 4",
    ] {
        agree("yard", &format!("size = 500\nmips = true\n{map}"));
    }
}

#[test]
fn glass_agrees() {
    for technique in ["hamburger", "hamburger-6", "hausdorff", "pcf", "esm"] {
        agree("glass", &format!("technique = '{technique}'"));
    }
}

#[test]
fn soft_shadows_agree_in_the_yard() {
    for technique in ["pcss", "vssm", "soft", "soft-6"] {
        let light = "radius = 0.1\nshape = 'square'";
        lit_agree("yard", light, &format!("technique = '{technique}'"));
    }
}
