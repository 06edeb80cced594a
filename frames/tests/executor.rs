//! What runs, and what does not: counted at the device.

mod common;

use common::Counting;
use hankel_conformance::Pair;
use hankel_conformance::general::Grid;
use hankel_dsl::glam::{UVec2, Vec3};
use hankel_frames::graph::{Graph, Handle};
use hankel_frames::scene::{Light, Scene};
use hankel_frames::{Clock, Executor, Frame, FrameError, NoShaders, Quiet, Show};
use hankel_host::device::{Backend, NativeDevice, open};

fn run(executor: &mut Executor<'_>) -> Vec<String> {
    let run = executor.run(Clock::Passes, &mut Quiet);
    let run = run.unwrap_or_else(|e| panic!("{e}"));
    run.ran.into_iter().map(|t| t.name).collect()
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytemuck::pod_collect_to_vec(bytes)
}

/// a and b are sums of their own parameters over a grid; both, of both.
struct Diamond {
    graph: Graph,
    /// Parameters of a, b and both.
    grids: [Handle; 3],
    cells: Handle,
    both: Handle,
}

fn grid(weight: f32) -> Grid {
    Grid {
        weight,
        padding: 0,
        size: UVec2::new(4, 4),
    }
}

fn diamond() -> Diamond {
    let mut graph = Graph::new(hankel_conformance::entries());
    let cells = graph.buffer("cells", &[1.0_f32; 16]);
    let grids = ["a", "b", "both"].map(|label| graph.parameter(label, &grid(1.0)));
    let mut pass = |label: &'static str, grid, cells| {
        let pass = graph.compute(label, "blur_grid");
        let pass = pass.arg("grid", grid).arg("cells", cells).elements(16);
        pass.unwrap_or_else(|e| panic!("{e}"))
    };
    let a = pass("a", grids[0], cells);
    let b = pass("b", grids[1], a);
    let both = pass("both", grids[2], b);
    graph.keep(both);
    Diamond {
        graph,
        grids,
        cells,
        both,
    }
}

#[test]
fn only_what_a_change_reaches_runs() {
    let (mut device, counts) = Counting::new(NativeDevice::new());
    let Diamond {
        graph,
        grids,
        cells,
        both,
    } = diamond();
    let mut executor = Executor::new(&mut device, &NoShaders, graph).unwrap();
    assert_eq!(run(&mut executor), ["a", "b", "both"]);
    assert_eq!(floats(&executor.read(both).unwrap()), [27.0; 16]);
    assert!(run(&mut executor).is_empty());
    // The same value again is no change.
    executor.set(grids[0], &grid(1.0)).unwrap();
    assert!(run(&mut executor).is_empty());
    executor.set(grids[2], &grid(2.0)).unwrap();
    assert_eq!(run(&mut executor), ["both"]);
    assert_eq!(floats(&executor.read(both).unwrap()), [54.0; 16]);
    executor.set(grids[1], &grid(2.0)).unwrap();
    assert_eq!(run(&mut executor), ["b", "both"]);
    executor.set_buffer(cells, &[2.0_f32; 16]).unwrap();
    assert_eq!(run(&mut executor), ["a", "b", "both"]);
    assert_eq!(floats(&executor.read(both).unwrap()), [216.0; 16]);
    drop(executor);
    assert_eq!(counts.get().dispatches, 3 + 1 + 2 + 3);
}

#[test]
fn values_that_cannot_be_set_or_read_are_refused() {
    let mut device = NativeDevice::new();
    let Diamond {
        mut graph,
        grids,
        cells,
        both,
    } = diamond();
    let constant = graph.constant("constant", &1.0_f32);
    let mut executor = Executor::new(&mut device, &NoShaders, graph).unwrap();
    let says = |result: Result<(), FrameError>, wanted: &str| {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(wanted), "{error}");
    };
    says(
        executor.set(grids[0], &1.0_f32),
        "`a`: it holds Grid, not f32",
    );
    says(
        executor.set(constant, &2.0_f32),
        "`constant`: it is constant",
    );
    says(executor.set(both, &2.0_f32), "`both`: a pass writes it");
    says(
        executor.set_buffer(cells, &[1.0_f32; 3]),
        "`cells`: it has 64 bytes, not 12",
    );
    says(
        executor.set(diamond().cells, &1.0_f32),
        "the handle belongs to another graph",
    );
    says(executor.read(both).map(drop), "`both`: it is not there");
    run(&mut executor);
    assert!(executor.read(both).is_ok());
}

/// Four values in a row need two places, whoever is kept; results are those of four.
#[test]
fn values_of_other_times_share_a_place() {
    let mut device = NativeDevice::new();
    let mut graph = Graph::new(hankel_conformance::entries());
    let cells = graph.buffer("cells", &[1.0_f32; 16]);
    let constant = graph.constant("grid", &grid(1.0));
    let last = graph.parameter("last", &grid(1.0));
    let mut value = cells;
    for (label, grid) in [
        ("a", constant),
        ("b", constant),
        ("c", constant),
        ("d", last),
    ] {
        let pass = graph.compute(label, "blur_grid").arg("grid", grid);
        value = pass.arg("cells", value).elements(16).unwrap();
    }
    graph.keep(value);
    let mut executor = Executor::new(&mut device, &NoShaders, graph).unwrap();
    let memory = executor.memory();
    assert_eq!(memory.unshared - memory.bytes, 2 * 64);
    let check = |executor: &mut Executor<'_>, ran: &[&str], wanted: f32| {
        assert_eq!(run(executor), ran);
        assert_eq!(floats(&executor.read(value).unwrap()), [wanted; 16]);
    };
    check(&mut executor, &["a", "b", "c", "d"], 81.0);
    executor.set(last, &grid(2.0)).unwrap();
    check(&mut executor, &["d"], 162.0);
    executor.set_buffer(cells, &[2.0_f32; 16]).unwrap();
    check(&mut executor, &["a", "b", "c", "d"], 324.0);
    executor.set(last, &grid(1.0)).unwrap();
    check(&mut executor, &["d"], 162.0);
}

/// What is added to begins anew whenever it is added to anew.
#[test]
fn changes_in_place_begin_anew() {
    let mut device = NativeDevice::new();
    let mut graph = Graph::new(hankel_conformance::entries());
    let numbers = graph.buffer("numbers", &[3_u32; 10]);
    let bins = graph.zeros::<u32>("bins", 16);
    let counted = graph.compute("count", "histogram").arg("x", numbers);
    let bins = counted.arg("bins", bins).finish().unwrap();
    let bins = bins.changed("bins").unwrap();
    graph.keep(bins);
    let mut executor = Executor::new(&mut device, &NoShaders, graph).unwrap();
    let sum = |executor: &mut Executor<'_>| -> u32 {
        let bytes = executor.read(bins).unwrap();
        // The fifth is the largest number.
        let bins: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
        bins[..4].iter().sum()
    };
    assert_eq!(run(&mut executor), ["bins", "count"]);
    assert_eq!(sum(&mut executor), 10);
    assert!(run(&mut executor).is_empty());
    executor.set_buffer(numbers, &[4_u32; 10]).unwrap();
    assert_eq!(run(&mut executor), ["bins", "count"]);
    assert_eq!(sum(&mut executor), 10);
    executor.forget();
    run(&mut executor);
    assert_eq!(sum(&mut executor), 10);
}

#[test]
fn what_a_later_pass_changes_cannot_be_kept() {
    let mut device = NativeDevice::new();
    let mut graph = Graph::new(hankel_conformance::entries());
    let before = graph.zeros::<Pair<f32>>("pairs", 4);
    let halved = graph.compute("halve", "halve").arg("pair", before);
    let after = halved.finish().unwrap().changed("pair").unwrap();
    graph.keep(before);
    graph.keep(after);
    let error = Executor::new(&mut device, &NoShaders, graph).err().unwrap();
    assert!(
        error.to_string().contains("a later pass changes it"),
        "{error}"
    );
}

fn scene(technique: &str) -> Scene {
    let text = format!(
        "[geometry]\nprocedural = 'box'\n[camera]\neye = [2, 6, 4]\ntarget = [0, 0.2, 0]\n\
         [light]\ndirection = [1, -1, 0.4]\n[shadow]\nsize = 64\ntechnique = '{technique}'\n\
         [output]\nwidth = 48\nheight = 32\n"
    );
    Scene::parse(&text, std::path::Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"))
}

fn names(frame: &mut Frame<'_>) -> Vec<String> {
    run(frame.executor())
}

/// The camera reaches the picture only; the light reaches everything; nothing reaches nothing.
fn moves(backend: Backend, shaders: &dyn hankel_frames::Shaders) {
    let (mut device, counts) = Counting::new(open(backend).unwrap_or_else(|e| panic!("{e}")));
    let scene = scene("hamburger");
    let mesh = scene.mesh().unwrap();
    let all = ["depth", "resolve", "blur rows", "blur columns", "shade"];
    let mut frame = Frame::new(&mut device, shaders, &scene, &mesh, Show::Picture).unwrap();
    assert_eq!(names(&mut frame), all);
    let first = frame.picture().unwrap();
    let mut camera = scene.camera;
    camera.eye += Vec3::X;
    frame.set_camera(&camera).unwrap();
    assert_eq!(names(&mut frame), ["shade"]);
    let moved = frame.picture().unwrap();
    assert_ne!(moved, first);
    let quiet = frame.run(Clock::Frame, &mut Quiet).unwrap();
    assert_eq!((quiet.ran.len(), quiet.unchanged.len()), (0, 5));
    let turned = Light::directional(Vec3::new(-1.0, -1.0, 0.2));
    frame.set_light(0, &turned).unwrap();
    assert_eq!(names(&mut frame), all);
    assert_ne!(frame.picture().unwrap(), moved);
    // Back again, it is the picture of before.
    frame.set_light(0, &scene.lights[0]).unwrap();
    frame.set_camera(&scene.camera).unwrap();
    names(&mut frame);
    assert_eq!(frame.picture().unwrap(), first);
    // The blurred map stays from frame to frame, in the place of the unblurred one.
    let memory = frame.executor().memory();
    let map = 64 * 64 * 8;
    assert_eq!(memory.unshared - memory.bytes, map);
    drop(frame);
    // Three whole frames and one picture. Rays need a kernel's run for each stage of a draw.
    let work = counts.get().dispatches + counts.get().draws;
    let expected = match backend {
        Backend::Native => 3 * (1 + 3 + 2) + 2,
        Backend::Vulkan => 3 * 5 + 1,
    };
    assert_eq!(work, expected, "{:?}", counts.get());
}

#[test]
fn a_camera_that_moves_leaves_the_map_alone() {
    moves(Backend::Native, &NoShaders);
}

#[test]
fn a_camera_that_moves_leaves_the_map_alone_on_vulkan() {
    moves(Backend::Vulkan, &common::shaders());
}

/// A thousand frames take what the first one took: all that was made is there, and no more.
fn thousand(backend: Backend, shaders: &dyn hankel_frames::Shaders) {
    let (mut device, counts) = Counting::new(open(backend).unwrap_or_else(|e| panic!("{e}")));
    let scene = scene("pcf");
    let mesh = scene.mesh().unwrap();
    let mut frame = Frame::new(&mut device, shaders, &scene, &mesh, Show::Picture).unwrap();
    let mut camera = scene.camera;
    frame.run(Clock::Frame, &mut Quiet).unwrap();
    let memory = frame.executor().memory();
    let made = counts.get().made;
    for i in 0..1000 {
        camera.eye.x = 2.0 + (i % 7) as f32 * 0.25;
        frame.set_camera(&camera).unwrap();
        frame.run(Clock::Frame, &mut Quiet).unwrap();
    }
    assert_eq!(frame.executor().memory(), memory);
    assert_eq!(counts.get().made, made);
    drop(frame);
    let counts = counts.get();
    assert_eq!(counts.made, counts.freed, "what was made is freed");
    assert_eq!(counts.bytes, memory.bytes, "the bytes told are those made");
}

#[test]
fn a_thousand_frames_do_not_grow() {
    thousand(Backend::Native, &NoShaders);
}

#[test]
fn a_thousand_frames_do_not_grow_on_vulkan() {
    thousand(Backend::Vulkan, &common::shaders());
}

#[test]
fn the_steady_state_has_a_time_for_each_pass() {
    let mut device = NativeDevice::new();
    let scene = scene("vsm");
    let mesh = scene.mesh().unwrap();
    let mut frame = Frame::new(&mut device, &NoShaders, &scene, &mesh, Show::Picture).unwrap();
    let names = names(&mut frame);
    let steady = frame.executor().steady(3).unwrap();
    let timed: Vec<String> = steady.iter().map(|t| t.name.clone()).collect();
    assert_eq!(timed, names);
    assert!(steady.iter().all(|t| t.seconds > 0.0));
}
