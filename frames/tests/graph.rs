//! What does not fit is refused while the graph is made, with the pass, the kernel and the
//! parameter.

use hankel_conformance::general::Grid;
use hankel_conformance::{Affine, Pair};
use hankel_dsl::glam::{IVec2, UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::native::Entry;
use hankel_dsl::native::describe::TexelFormat;
use hankel_frames::graph::{Graph, GraphError, Handle, Surfaces};
use hankel_frames::passes::BILINEAR;
use hankel_host::device::TextureShape;
use hankel_shadows::blur::Taps;
use hankel_shadows::depth::Transform;
use hankel_shadows::shade::Light;

fn kernels() -> Vec<Entry> {
    // Of two with one name the first is found: both crates have a `tint`.
    let mut all = hankel_conformance::entries();
    all.extend(hankel_shadows::entries());
    all
}

fn graph() -> Graph {
    Graph::new(kernels())
}

const PAIR: Pair<f32> = Pair { x: 1.0, w: 2.0 };

const TRANSFORM: Transform = Transform {
    row_x: Vec4::X,
    row_y: Vec4::Y,
    row_z: Vec4::Z,
    row_w: Vec4::W,
};

/// Depth with one and with four samples.
fn depths(graph: &mut Graph) -> [Handle; 2] {
    [1, 4].map(|samples| graph.cleared("depth", TextureShape::depth(64, 64).multisampled(samples)))
}

fn refused<T: std::fmt::Debug>(result: Result<T, GraphError>, wanted: &[&str]) {
    let error = result.expect_err("it does not fit").to_string();
    for part in wanted {
        assert!(error.contains(part), "`{part}` is not in: {error}");
    }
}

#[test]
fn kernels_are_found_by_their_names() {
    let mut g = graph();
    refused(
        g.compute("smooth", "nothing_like_it").image([8, 8]),
        &[
            "pass `smooth`, kernel `nothing_like_it`",
            "there is no such kernel",
            "kernels!",
        ],
    );
    refused(
        g.compute("smooth", "blur").image([8, 8]),
        &["`blur_rgba16unorm`, `blur_rgba32float`: name one of them"],
    );
    refused(
        g.compute("resolve", "resolve_symmetrix").image([8, 8]),
        &["did you mean", "`resolve_symmetric`"],
    );
    refused(
        g.compute("resolve", "surface").image([8, 8]),
        &["it is a vertex kernel", "a compute kernel here"],
    );
    refused(
        g.compute("filter", "blur_fragment").image([8, 8]),
        &["it is a fragment kernel", "a compute kernel here"],
    );
    let positions = g.buffer("positions", &[Vec3::ZERO; 3]);
    let indices = g.buffer("indices", &[0_u32, 1, 2]);
    let surfaces = Surfaces {
        positions,
        indices,
        clip_from_world: g.parameter("view", &TRANSFORM),
    };
    let drawn = g.draw("filter", surfaces, "full_screen");
    refused(
        drawn
            .fragment("blur_fragment")
            .colour([8, 8], TexelFormat::Rgba16Float, [0.0; 4]),
        &[
            "kernel `blur_fragment`",
            "the fragment form of an image pass",
            "`set_image_passes`",
        ],
    );
    assert!(g.passes().is_empty());
}

#[test]
fn arguments_are_given_by_name_and_once() {
    let mut g = graph();
    let [one, four] = depths(&mut g);
    let place = "pass `resolve`, kernel `resolve_symmetric`, ";
    refused(
        g.compute("resolve", "resolve_symmetric").image([64, 64]),
        &[place, "`depth`: it is not given"],
    );
    refused(
        g.compute("resolve", "resolve_symmetric")
            .arg("map", four)
            .image([64, 64]),
        &[place, "`map`: it takes no such argument, but `depth`"],
    );
    refused(
        g.compute("resolve", "resolve_symmetric")
            .arg("depth", four)
            .arg("depth", four)
            .image([64, 64]),
        &[place, "`depth`: it is given twice"],
    );
    refused(
        g.compute("resolve", "resolve_symmetric")
            .arg("depth", four)
            .constant("taps", 4)
            .image([64, 64]),
        &[place, "`taps`: it has no such constant, but `samples`"],
    );
    refused(
        g.compute("resolve", "resolve_symmetric")
            .arg("depth", four)
            .constant("samples", 3)
            .image([64, 64]),
        &[place, "`samples`: it is 3, but must be one of [1.0, 4.0]"],
    );
    refused(
        g.compute("resolve", "resolve_symmetric")
            .arg("depth", four)
            .constant("samples", 0.5_f32)
            .image([64, 64]),
        &[
            place,
            "`samples`: it is a whole number from 0",
            "`0.5` is not",
        ],
    );
    refused(
        g.compute("resolve", "resolve_symmetric")
            .arg("depth", one)
            .image([64, 64]),
        &[
            place,
            "`depth`: it has one sample, but the kernel reads several",
        ],
    );
    refused(
        g.compute("resolve", "resolve_symmetric")
            .arg("depth", BILINEAR)
            .image([64, 64]),
        &[place, "`depth`: it must be a texture"],
    );
    refused(
        g.compute("resolve", "resolve_symmetric")
            .arg("depth", four)
            .elements(64),
        &[place, "`output`: it is a texture: give its size"],
    );
    refused(
        g.compute("resolve", "resolve_symmetric")
            .arg("depth", four)
            .finish(),
        &["it has 1 outputs, but sizes of 0 are given"],
    );
    // What is refused leaves nothing behind.
    let before = (g.passes().len(), g.values().len());
    assert_eq!(before, (2, 2));
    let map = g.compute("resolve", "resolve_symmetric").arg("depth", four);
    assert!(map.image([64, 64]).is_ok());
}

#[test]
fn types_are_compared_and_not_only_sizes() {
    let mut g = graph();
    let pairs = g.buffer("pairs", &[PAIR; 10]);
    // As large as what the kernel takes, and something else.
    let vectors = g.parameter("vectors", &[Vec2::ONE; 2]);
    refused(
        g.compute("move", "affine")
            .arg("map", vectors)
            .arg("pair", pairs)
            .elements(10),
        &["`map`: `vectors` holds f32x2[2], but the kernel takes Affine"],
    );
    let short = g.constant("step", &IVec2::X);
    let map = g.cleared("map", TextureShape::d2(64, 64, TexelFormat::Rgba16Unorm));
    refused(
        g.compute("blur", "blur_rgba16unorm")
            .arg("taps", short)
            .arg("source", map)
            .image([64, 64]),
        &["`taps`: `step` holds i32x2, but the kernel takes Taps"],
    );
    let taps = g.constant("taps", &Taps::new(IVec2::X, &[1.0]));
    refused(
        g.compute("blur", "blur_rgba16unorm")
            .arg("taps", taps)
            .arg("source", taps)
            .image([64, 64]),
        &["`source`: it must be a texture"],
    );
}

#[test]
fn sizes_fit_the_invocations() {
    let mut g = graph();
    let pairs = g.buffer("pairs", &[PAIR; 10]);
    let double = Affine {
        scale: 1.0_f64,
        offset: 0.0,
    };
    let double = g.parameter("double", &double);
    refused(
        g.compute("move", "affine")
            .arg("map", double)
            .arg("pair", pairs)
            .elements(10),
        &["`map`: `double` holds another Affine than the kernel takes"],
    );
    let map = Affine {
        scale: 1.0_f32,
        offset: 0.0,
    };
    let map = g.parameter("map", &map);
    refused(
        g.compute("move", "affine")
            .arg("map", map)
            .arg("pair", pairs)
            .elements(11),
        &["`pair`: it has 10 elements, but 11 invocations run"],
    );
    let cells = g.buffer("cells", &[1.0_f32; 12]);
    let grid = Grid {
        weight: 1.0,
        padding: 0,
        size: UVec2::new(4, 3),
    };
    let grid = g.parameter("grid", &grid);
    let pass = g.compute("blur", "blur_grid").arg("grid", grid);
    refused(
        pass.arg("cells", cells).elements(11),
        &["`output`: it has 11 elements, but 12 invocations run"],
    );
    let pass = g.compute("blur", "blur_grid").arg("grid", grid);
    assert!(pass.arg("cells", cells).elements(12).is_ok());
}

/// A handle stands for what was there when it was returned.
#[test]
fn what_was_changed_in_its_place_has_a_new_handle() {
    let mut g = graph();
    let given = g.buffer("pairs", &[PAIR; 10]);
    refused(
        g.compute("halve", "halve").arg("pair", given).finish(),
        &["`pair`: the kernel writes it, but it was given: begin with `zeros`"],
    );
    let before = g.zeros::<Pair<f32>>("pairs", 10);
    let written = g.compute("halve", "halve").arg("pair", before).finish();
    let after = written.unwrap().changed("pair").unwrap();
    refused(
        g.compute("again", "halve").arg("pair", before).finish(),
        &[
            "pass `again`, kernel `halve`, `pair`",
            "pass `halve` has changed `pairs` in its place",
        ],
    );
    let written = g.compute("again", "halve").arg("pair", after).finish();
    assert!(written.unwrap().changed("pair").is_some());
    let mut other = graph();
    refused(
        other.compute("halve", "halve").arg("pair", after).finish(),
        &["the handle belongs to another graph"],
    );
}

#[test]
fn nothing_is_read_and_written_at_once() {
    let mut g = graph();
    let numbers = g.zeros::<u32>("numbers", 13);
    refused(
        g.compute("scatter", "scatter")
            .arg("x", numbers)
            .arg("out", numbers)
            .finish(),
        &["`out`: it is written, and also given as `x`: use two"],
    );
}

#[test]
fn draws_are_checked_as_well() {
    let mut g = graph();
    let positions = g.buffer("positions", &[Vec3::ZERO; 4]);
    let normals = g.buffer("normals", &[Vec3::Y; 4]);
    let few = g.buffer("colours", &[Vec3::ONE; 3]);
    let wrong = g.buffer("colours", &[Vec4::ONE; 4]);
    let indices = g.buffer("indices", &[0_u32, 1, 2, 0, 2, 3]);
    let camera = g.parameter("camera", &TRANSFORM);
    let surfaces = Surfaces {
        positions,
        indices,
        clip_from_world: camera,
    };
    let light = g.parameter("light", &<Light as bytemuck::Zeroable>::zeroed());
    let map = g.cleared("map", TextureShape::d2(64, 64, TexelFormat::Rgba16Unorm));
    fn shade<'g>(
        g: &'g mut Graph,
        surfaces: Surfaces,
        [normals, colours]: [Handle; 2],
        fragment: &'static str,
    ) -> hankel_frames::graph::AddDraw<'g> {
        g.draw("shade", surfaces, "surface")
            .arg("position", surfaces.positions)
            .arg("normal", normals)
            .arg("colour", colours)
            .arg("camera", surfaces.clip_from_world)
            .fragment(fragment)
    }
    let size = [32, 16];
    let format = TexelFormat::Rgba16Float;
    let nothing = [0.0; 4];
    refused(
        shade(&mut g, surfaces, [normals, few], "shade_pcf").colour(size, format, nothing),
        &["kernel `surface`, `colour`: it has 3 elements, but there are 4 vertices"],
    );
    refused(
        shade(&mut g, surfaces, [normals, wrong], "shade_pcf").colour(size, format, nothing),
        &["kernel `surface`, `colour`: `colours` holds f32x4, but the kernel takes f32x3"],
    );
    refused(
        shade(&mut g, surfaces, [normals; 2], "resolve_plain").colour(size, format, nothing),
        &[
            "kernel `resolve_plain`: it is a compute kernel",
            "a fragment kernel here",
        ],
    );
    refused(
        shade(&mut g, surfaces, [normals; 2], "shade_vsm").colour(size, format, nothing),
        &["pass `shade`, kernel `shade_vsm`: there is no such kernel"],
    );
    refused(
        shade(&mut g, surfaces, [normals; 2], "shade_hamburger")
            .arg("light", light)
            .arg("map", map)
            .arg("sampler", BILINEAR)
            .constant("encoding", 9)
            .colour(size, format, nothing),
        &["`encoding`: it is 9, but must be one of"],
    );
    refused(
        shade(&mut g, surfaces, [normals; 2], "tint").colour(size, format, nothing),
        &["kernel `tint`, `map`: it is not given"],
    );
    let affine = g.parameter("affine", &<Affine<f32> as bytemuck::Zeroable>::zeroed());
    refused(
        shade(&mut g, surfaces, [normals; 2], "tint")
            .arg("map", affine)
            .colour(size, format, nothing),
        &[
            "kernel `tint`, `colour`",
            "`surface` hands on f32x3 at location 0, but this is f32x4",
        ],
    );
    refused(
        g.draw("depth", surfaces, "light_depth")
            .arg("position", positions)
            .arg("light", camera)
            .depth([0, 4]),
        &["pass `depth`: its depth is 0x4"],
    );
    let odd = g.buffer("odd", &[0_u32, 1]);
    let bad = Surfaces {
        indices: odd,
        ..surfaces
    };
    refused(
        g.draw("depth", bad, "light_depth").depth([4, 4]),
        &["pass `depth`: its indices: 2 of them are no triangles"],
    );
    let bad = Surfaces {
        clip_from_world: light,
        ..surfaces
    };
    refused(
        g.draw("depth", bad, "light_depth").depth([4, 4]),
        &["its clip_from_world: `light` is not a buffer of Transform"],
    );
    let whole = shade(&mut g, surfaces, [normals; 2], "shade_hamburger")
        .arg("light", light)
        .arg("map", map)
        .arg("sampler", BILINEAR)
        .colour(size, format, nothing);
    g.keep(whole.unwrap());
    assert_eq!(g.summary().passes.len(), 2);
}

#[test]
fn mip_levels_halve() {
    let mut g = graph();
    let format = TexelFormat::Rgba16Unorm;
    let mut texture = |size: [u32; 2]| {
        let shape = TextureShape::d2(size[0], size[1], format);
        g.cleared(format!("{size:?}"), shape)
    };
    let [whole, half, quarter, least] = [[5, 3], [2, 1], [1, 1], [1, 1]].map(&mut texture);
    let numbers = g.buffer("numbers", &[1.0_f32]);
    refused(
        g.levels("mips", &[]),
        &["pass `mips`, level 0", "it is not given"],
    );
    refused(
        g.levels("mips", &[whole, quarter]),
        &["pass `mips`, level 1", "`[1, 1]`", "2x1 of rgba16unorm"],
    );
    refused(
        g.levels("mips", &[whole, numbers]),
        &["level 1", "`numbers` is a buffer"],
    );
    refused(
        g.levels("mips", &[whole, half, quarter, least]),
        &["level 3", "3 are all"],
    );
    assert_eq!(g.passes().len(), 4);
    let all = g.levels("mips", &[whole, half, quarter]).unwrap();
    assert_eq!(g.levels("again", &[whole, half, quarter]).unwrap(), all);
    g.keep(all);
    let text = g.summary().to_string();
    assert!(
        text.contains("mips: copies, 5x3, rgba16unorm, 3 levels"),
        "{text}"
    );
}

/// Passes that nothing kept needs are not part of the frame.
#[test]
fn only_what_is_needed_is_planned() {
    let mut g = graph();
    let [_, depth] = depths(&mut g);
    let plain = g.compute("a", "resolve_plain").arg("depth", depth);
    plain.image([64, 64]).unwrap();
    let unit = g.compute("b", "resolve_unit").arg("depth", depth);
    let unit = unit.image([64, 64]).unwrap();
    g.keep(unit);
    let names: Vec<String> = g.summary().passes.into_iter().map(|p| p.pass).collect();
    assert_eq!(names, ["depth", "b"]);
}
