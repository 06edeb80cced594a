//! What a tile's depths settle: nothing that is left out is missing, and no picture is farther from the
//! truth.

mod common;

use std::path::Path;

use common::shaders;
use hankel_dsl::glam::{UVec2, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_frames::graph::{Graph, Handle};
use hankel_frames::scene::{Mesh, Scene};
use hankel_frames::truth::{by_rays, by_technique};
use hankel_frames::{Clock, Executor, Quiet, Show, graph_of};
use hankel_host::device::{
    Bind, Device, NativeDevice, Program, Shader, TextureShape, VulkanDevice,
};
use hankel_shadows::soft::PyramidLines;
use hankel_shadows::tiles::{Listed, tiles_of};

fn scene(geometry: &str, shadow: &str) -> (Scene, Mesh) {
    let eye = if geometry == "box" {
        "[1.9, 1.6, 3.1]"
    } else {
        "[7.4, 6.2, 12.4]"
    };
    let text = format!(
        "[geometry]\nprocedural = '{geometry}'\n[camera]\neye = {eye}\ntarget = [-0.2, 0.2, -0.3]\n\
         [light]\ndirection = [0.62, -0.62, 0.48]\n[shadow]\n{shadow}\n\
         [output]\nwidth = 160\nheight = 90\n"
    );
    let scene = Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    (scene, mesh)
}

/// What a pass of that name has written last.
fn written(graph: &Graph, label: &str) -> Vec<Handle> {
    let pass = graph.passes().iter().rfind(|pass| pass.label == label);
    let pass = pass.unwrap_or_else(|| panic!("there is no pass `{label}`"));
    pass.writes.clone()
}

/// The texels of a scene's filtered map; of a list, how many tiles it has, and of how many.
fn map(device: &mut dyn Device, technique: &str, shadow: &str) -> (Vec<Vec4>, Option<[u32; 2]>) {
    let (scene, mesh) = scene("yard", &format!("technique = '{technique}'\n{shadow}"));
    let (mut graph, ..) = graph_of(&scene, &mesh, Show::Light).unwrap();
    let last = match scene.shadow.filter {
        1 => "resolve",
        _ => "blur columns",
    };
    let map = written(&graph, last)[0];
    graph.keep(map);
    let has_tiles = technique == "hamburger-tiles";
    let listed = has_tiles.then(|| {
        let of_listed = |h: &&Handle| graph.value(**h).is_some_and(|v| v.label == "listed");
        let all = written(&graph, "tile list");
        let listed = *all.iter().find(of_listed).unwrap();
        graph.keep(listed);
        listed
    });
    let shaders = shaders();
    let mut executor = Executor::new(device, &shaders, graph).unwrap();
    executor.run(Clock::Frame, &mut Quiet).unwrap();
    let count = listed.map(|listed| {
        let listed: Vec<Listed> = bytemuck::pod_collect_to_vec(&executor.read(listed).unwrap());
        [listed[0].tiles, tiles_of(scene.shadow.size).pow(2)]
    });
    let format = TexelFormat::Rgba16Unorm;
    let bytes = executor.read(map).unwrap();
    let texels = bytes.chunks_exact(format.bytes());
    (texels.map(|t| format.load(t)).collect(), count)
}

/// Where no caster comes near, the map holds what resolving and blurring would give; elsewhere it was
/// resolved and blurred. Of a map that is no whole number of tiles, too, and with a filter that reaches
/// beyond the next tile.
#[test]
fn listed_tiles_make_the_whole_map() {
    let step = 1.0 / 65535.0;
    for (size, filter) in [(256, 5), (250, 1), (251, 9), (256, 17)] {
        let shadow = format!("size = {size}\nfilter = {filter}\nfit = 'scene'");
        let mut devices: [Box<dyn Device>; 2] = [
            Box::new(NativeDevice::new()),
            Box::new(VulkanDevice::new().unwrap()),
        ];
        for device in &mut devices {
            let (whole, _) = map(&mut **device, "hamburger", &shadow);
            let (tiled, listed) = map(&mut **device, "hamburger-tiles", &shadow);
            assert_eq!(whole.len(), tiled.len());
            let pairs = whole.iter().zip(&tiled);
            let off = pairs.map(|(a, b)| (*a - *b).abs().max_element());
            let off = off.fold(0.0, f32::max);
            // A tie may be rounded either way.
            assert!(off < 1.5 * step, "{}, {shadow}: {off}", device.name());
            let [listed, all] = listed.unwrap();
            println!("{}, {size}, {filter}: {listed} of {all}", device.name());
            assert!(0 < listed && listed < all, "{listed} of {all}");
        }
    }
}

/// What is settled is nearer the truth, or as near.
#[test]
fn tiles_leave_no_picture_farther_from_the_rays() {
    for geometry in ["box", "yard"] {
        for (plain, tiles) in [
            ("hamburger", "hamburger-tiles"),
            ("pcf-gaussian", "pcf-gaussian-tiles"),
        ] {
            let picture = |technique: &str| {
                let shadow = format!("size = 1024\ntechnique = '{technique}'");
                let (scene, mesh) = scene(geometry, &shadow);
                let truth = by_rays(&scene, &mesh, &mut |_| ());
                let picture = by_technique(&scene, &mesh).unwrap_or_else(|e| panic!("{e}"));
                (picture.errors(&truth).unwrap(), picture)
            };
            let ((errors, all), (settled_errors, settled)) = (picture(plain), picture(tiles));
            let apart = settled.errors(&all).unwrap();
            println!("{geometry}: {plain} {errors}; {tiles} {settled_errors}; apart {apart}");
            // A thousandth of it is rounding: where hardly anything is settled, both are alike.
            assert!(
                settled_errors.rms <= 1.001 * errors.rms,
                "{geometry}: {plain} {errors}, {tiles} {settled_errors}"
            );
            // What it changes is less than what is wrong.
            assert!(apart.rms < errors.rms, "{geometry}, {tiles}: {apart}");
        }
    }
}

/// A uniform that says how far a kernel runs may be a buffer on the device: as far, to the bit; and of
/// nothing, nothing runs.
#[test]
fn a_buffer_says_how_many_run() {
    let entries = hankel_shadows::entries();
    let entry = entries.iter().find(|e| e.kernel.name == "prefix_sums");
    let entry = entry.unwrap();
    let shaders = shaders();
    let table: Vec<u32> = (0..4 * 5 * 331_u32)
        .map(|i| i.wrapping_mul(2_654_435_761))
        .collect();
    let mut devices: [Box<dyn Device>; 2] = [
        Box::new(NativeDevice::new()),
        Box::new(VulkanDevice::new().unwrap()),
    ];
    for device in &mut devices {
        let mut summed = |invocations: u32, in_buffer: bool| {
            let lines = PyramidLines {
                size: UVec2::new(331, 5),
                invocations,
                across: 0,
            };
            let lines = bytemuck::bytes_of(&lines);
            let said = device.buffer_from("lines", lines).unwrap();
            let sums = device
                .buffer_from("table", bytemuck::cast_slice(&table))
                .unwrap();
            let program = Program {
                kernel: &entry.kernel,
                constants: &[],
                native: Some(&entry.run),
                shader: Some(Shader::SpirvPassthrough(&shaders["prefix_sums"])),
            };
            let says = if in_buffer {
                Bind::Buffer(said)
            } else {
                Bind::Bytes(lines)
            };
            device
                .dispatch(&program, &[says, Bind::Buffer(sums)])
                .unwrap();
            bytemuck::pod_collect_to_vec::<u8, u32>(&device.read_buffer(sums).unwrap())
        };
        let expected = summed(5 * 64, false);
        assert_ne!(expected, table);
        assert_eq!(summed(5 * 64, true), expected);
        assert_eq!(summed(0, true), table);
    }
}

/// Where a pass writes how far a kernel runs, the graph has to know how far that may be.
#[test]
fn how_far_at_most_is_said_and_checked() {
    let added = |most: Option<[u32; 3]>, is_known: bool| {
        let mut graph = Graph::new(hankel_shadows::entries());
        let depth = TextureShape::depth(64, 64).multisampled(4);
        let depth = graph.cleared("depth", depth);
        let map = TextureShape::d2(64, 64, TexelFormat::Rgba16Unorm);
        let map = graph.cleared("map", map);
        let list = graph.constants("list", &[0_u32, 1]);
        let known = Listed {
            size: [64, 1].into(),
            tiles: 1,
            padding: 0,
        };
        let listed = match is_known {
            true => graph.parameter("listed", &known),
            false => graph.zeros::<Listed>("listed", 1),
        };
        let mut pass = graph
            .compute("resolve", "resolve_symmetric_tiles")
            .arg("listed", listed)
            .arg("list", list)
            .arg("depth", depth)
            .arg("map", map);
        if let Some(most) = most {
            pass = pass.at_most(most);
        }
        pass.finish().map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(added(Some([64, 65535, 1]), false), Ok(()));
    assert_eq!(added(None, true), Ok(()));
    for (most, is_known, wanted) in [
        (None, false, "`listed`: a pass writes how far"),
        (Some([64, 65536, 1]), false, "[1, 65536, 1] workgroups"),
        (Some([64, 1, 1]), true, "leave `at_most` out"),
    ] {
        let error = added(most, is_known).unwrap_err();
        assert!(error.contains(wanted), "{error}");
    }
}
