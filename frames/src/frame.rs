//! From a scene to a picture.

use std::borrow::Cow;
use std::time::Instant;

use hankel_dsl::glam::{Mat4, Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_host::device::{self, Backend, Device};
use hankel_shadows::depth::Transform;
use serde::Serialize;

use crate::error::{FrameError, Result};
use crate::executor::{Clock, Executor, Memory, Progress, Run, Shaders, Timing};
use crate::graph::{self, Graph, GraphError, Handle, Omission, Summary, Work};
use crate::lights::{Lit, area, facing, light_view, reaching, translucent, uniform};
use crate::passes::{Given, Translucent};
use crate::picture::{Difference, Linear, Picture};
use crate::scene::{Camera, CameraView, Fit, Light, LightView, Mesh, Scene};
use crate::volume::Space;

/// What is seen where nothing is: a pale sky, in linear light.
const BACKGROUND: [f32; 3] = [0.5, 0.6, 0.72];
/// What pictures are kept in until they are encoded: linear light.
const PICTURE: TexelFormat = TexelFormat::Rgba16Float;

pub(crate) fn transform(clip_from_world: Mat4) -> Transform {
    Transform {
        row_x: clip_from_world.row(0),
        row_y: clip_from_world.row(1),
        row_z: clip_from_world.row(2),
        row_w: clip_from_world.row(3),
    }
}

pub(crate) fn camera_view(scene: &Scene, camera: &Camera, mesh: &Mesh) -> CameraView {
    CameraView::new(camera, mesh, scene.width as f32 / scene.height as f32)
}

/// What a frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Show {
    /// The scene, lit.
    Picture,
    /// The share of light that arrives, in 32-bit floats: 1 minus the shadow where a surface is turned to the light,
    /// 0 where it is turned away; seen through translucent surfaces. The same passes by the same kernels make it.
    Light,
    /// The share of light that the medium scatters towards the camera, but for its phase function and what it
    /// absorbs, in 32-bit floats: black surfaces. The same passes by the same kernels make it.
    Scattered,
}

/// The graph of a scene's frame: what its technique starts from for each light, and the picture, in linear light.
/// Lights that reach nothing that the camera sees are left out.
///
/// # Errors
/// [`graph::GraphError`] for a technique that does not fit its kernels, or that is not for the scene's lights.
pub fn graph(scene: &Scene, mesh: &Mesh, show: Show) -> graph::Result<(Graph, Vec<Given>, Handle)> {
    let (numbers, omitted) = reaching(scene, mesh);
    let (mut graph, given, picture) = with_lights(scene, mesh, show, &numbers)?;
    for Omission { what, why } in omitted {
        graph.omit(what, why);
    }
    Ok((graph, given, picture))
}

/// An error if the technique of the scene's medium is not for a light; the first has the number 0.
fn refused(scene: &Scene, number: usize, light: &Light) -> graph::Result<()> {
    let technique = scene.medium.map(|medium| medium.technique);
    match technique.and_then(|technique| light.refuses(technique)) {
        Some(instead) => Err(GraphError::Light {
            number: number + 1,
            problem: format!("the technique of `[medium]` must be {instead}"),
        }),
        None => Ok(()),
    }
}

/// The same with these of its lights.
fn with_lights(
    scene: &Scene,
    mesh: &Mesh,
    show: Show,
    numbers: &[usize],
) -> graph::Result<(Graph, Vec<Given>, Handle)> {
    let technique = scene.shadow.technique;
    for (number, light) in scene.lights.iter().enumerate() {
        refused(scene, number, light)?;
    }
    let camera = camera_view(scene, &scene.camera, mesh);
    let mut graph = Graph::new(hankel_shadows::entries());
    let vertices = mesh.positions.len();
    let (colours, format, [red, green, blue]) = match show {
        Show::Picture => (
            Cow::Borrowed(&mesh.colours),
            PICTURE,
            BACKGROUND.map(f64::from),
        ),
        Show::Light => (
            Cow::Owned(vec![Vec3::ONE; vertices]),
            TexelFormat::Rgba32Float,
            [1.0; 3],
        ),
        Show::Scattered => (
            Cow::Owned(vec![Vec3::ZERO; vertices]),
            TexelFormat::Rgba32Float,
            [0.0; 3],
        ),
    };
    let positions = graph.buffer("positions", &mesh.positions);
    let colours = graph.buffer("colours", &colours);
    let indices = graph.buffer("indices", mesh.opaque().as_flattened());
    let is_translucent = !mesh.translucent().is_empty();
    let opacities = is_translucent.then(|| graph.buffer("opacities", &mesh.all_opacities()));
    let camera = graph.parameter("camera", &transform(camera.clip_from_world));
    // For pictures of the light alone, each light has normals of its own: see `facing`. Planes are the surfaces'.
    let planes = match show {
        Show::Light => graph.buffer("planes", &mesh.normals),
        Show::Picture | Show::Scattered => graph.buffer("normals", &mesh.normals),
    };
    let own_normals = (show != Show::Light).then_some(planes);
    for (value, meaning) in [
        (positions, "Positions of the vertices in world space."),
        (colours, "Colours of the vertices, linear."),
        (indices, "Three vertices for each triangle."),
        (camera, "From world space to the clip space of the picture."),
    ] {
        graph.describe(value, meaning);
    }
    let mut all = Vec::with_capacity(numbers.len());
    let mut sum: Option<Handle> = None;
    for (i, number) in numbers.iter().enumerate() {
        let light = &scene.lights[*number];
        let view = light_view(scene, light, mesh);
        let lit = Lit {
            light,
            view: &view,
            is_first: i == 0,
            count: numbers.len(),
        };
        // Of several lights, each has its own.
        let named = |label: &'static str| -> Cow<'static, str> {
            match numbers.len() {
                1 => label.into(),
                _ => format!("{label} of light {}", number + 1).into(),
            }
        };
        let normals =
            own_normals.unwrap_or_else(|| graph.buffer(named("normals"), &facing(light, mesh)));
        let translucent = opacities.map(|opacities| {
            let triangles = translucent(light, mesh);
            Translucent {
                indices: graph.buffer(named("translucent indices"), triangles.as_flattened()),
                opacities,
            }
        });
        let space = Space::of(scene, light, &view, mesh, show);
        let given = Given {
            positions,
            normals,
            planes,
            colours,
            indices,
            translucent,
            light_view: graph.parameter(named("light's view"), &transform(view.clip_from_world)),
            camera,
            light: graph.parameter(named("light"), &uniform(scene, &lit, show)),
            area: graph.parameter(named("light's area"), &area(light, &view)),
            source: light.area,
            is_spot: light.spot().is_some(),
            volume: space.map(|space| space.add_to(&mut graph, &named)),
            shadow: scene.shadow,
            size: [scene.width, scene.height],
            format,
            // What is behind all surfaces is there once.
            background: match i {
                0 => [red, green, blue, 1.0],
                _ => [0.0, 0.0, 0.0, 1.0],
            },
            is_tinted: show == Show::Picture,
        };
        describe(&mut graph, &given);
        let mut picture = (technique.add)(&mut graph, &given)?;
        // Where there is a medium, there is its volume.
        match scene.medium.as_ref().zip(given.volume) {
            Some((medium, volume)) => {
                picture = (medium.technique.add)(&mut graph, &given, &volume, picture)?;
            }
            None => graph.omit("scattering", "there is no medium"),
        }
        sum = Some(match sum {
            None => picture,
            Some(before) => graph
                .compute("sum", format!("sum_lights_{}", format.name()))
                .arg("first", before)
                .arg("second", picture)
                .image(given.size)?,
        });
        all.push(given);
    }
    let Some(picture) = sum else {
        let problem = "there is none: a scene has one light or more".into();
        return Err(GraphError::Light { number: 1, problem });
    };
    if scene.shadow.mips && !graph.omitted().iter().any(|it| it.what == "mips") {
        let has_levels = |pass: &graph::Pass| matches!(pass.work, Work::Levels(_));
        if !graph.passes().iter().any(has_levels) {
            graph.omit("mips", "the technique interpolates no map");
        }
    }
    graph.set_image_passes(scene.image_passes)?;
    graph.keep(picture);
    Ok((graph, all, picture))
}

/// Says what a light's values mean.
fn describe(graph: &mut Graph, given: &Given) {
    for (value, meaning) in [
        (
            given.normals,
            "Unit normals of the vertices in world space.",
        ),
        (
            given.light_view,
            "From world space to the clip space of the shadow map.",
        ),
        (
            given.light,
            "The light, and how its shadow map is read. The rows follow from the transform to the shadow \
             map's clip space, whose rows are x, y, z and w: u is half of x + w, v half of w - y, depth is z.",
        ),
        (given.area, "The light's area, as its shadow map sees it."),
    ] {
        graph.describe(value, meaning);
    }
    let Some(volume) = given.volume else {
        return;
    };
    for (value, meaning) in [
        (
            volume.view,
            "How pixels look into the world; it follows from the camera.",
        ),
        (volume.medium, "What scatters between surfaces."),
    ] {
        graph.describe(value, meaning);
    }
    let Some(rectification) = volume.rectification else {
        return;
    };
    for (value, meaning) in [
        (
            rectification.rectified,
            "Coordinates in which rays from the camera are rows of the shadow map; they follow from the camera \
             and the light.",
        ),
        (
            rectification.rows,
            "What differs from row to row of the rectified map; it follows from the camera and the light.",
        ),
    ] {
        graph.describe(value, meaning);
    }
}

/// A scene's frame on a device: to be drawn again after the camera or a light has moved.
pub struct Frame<'d> {
    executor: Executor<'d>,
    scene: Scene,
    mesh: &'d Mesh,
    show: Show,
    /// Of each light that the frame has, its number in the scene.
    numbers: Vec<usize>,
    given: Vec<Given>,
    picture: Handle,
}

impl<'d> Frame<'d> {
    /// Makes everything that the frame needs on the device, with all lights: they may reach something after the
    /// camera or a light has moved.
    ///
    /// # Errors
    /// See [`FrameError`].
    pub fn new(
        device: &'d mut dyn Device,
        shaders: &'d dyn Shaders,
        scene: &Scene,
        mesh: &'d Mesh,
        show: Show,
    ) -> Result<Self> {
        let numbers: Vec<usize> = (0..scene.lights.len()).collect();
        let made = with_lights(scene, mesh, show, &numbers)?;
        Self::of(device, shaders, scene, mesh, show, (numbers, made))
    }

    /// The same for one picture: lights that reach nothing that the camera sees are left out.
    ///
    /// # Errors
    /// See [`FrameError`].
    pub fn still(
        device: &'d mut dyn Device,
        shaders: &'d dyn Shaders,
        scene: &Scene,
        mesh: &'d Mesh,
        show: Show,
    ) -> Result<Self> {
        let (numbers, _) = reaching(scene, mesh);
        let made = graph(scene, mesh, show)?;
        Self::of(device, shaders, scene, mesh, show, (numbers, made))
    }

    fn of(
        device: &'d mut dyn Device,
        shaders: &'d dyn Shaders,
        scene: &Scene,
        mesh: &'d Mesh,
        show: Show,
        (numbers, (graph, given, picture)): (Vec<usize>, (Graph, Vec<Given>, Handle)),
    ) -> Result<Self> {
        Ok(Self {
            executor: Executor::new(device, shaders, graph)?,
            scene: scene.clone(),
            mesh,
            show,
            numbers,
            given,
            picture,
        })
    }

    /// Moves the camera.
    ///
    /// # Errors
    /// [`FrameError::Device`].
    pub fn set_camera(&mut self, camera: &Camera) -> Result<()> {
        self.scene.camera = *camera;
        let view = camera_view(&self.scene, camera, self.mesh);
        let transform = transform(view.clip_from_world);
        let numbers = self.numbers.clone();
        for (i, number) in numbers.into_iter().enumerate() {
            // It is one for all.
            if i == 0 {
                self.executor.set(self.given[i].camera, &transform)?;
            }
            match self.scene.shadow.fit {
                Fit::Scene => {
                    let light = self.scene.lights[number];
                    let view = light_view(&self.scene, &light, self.mesh);
                    self.set_space(i, &view)?;
                }
                Fit::Camera => self.set_light(number, &self.scene.lights[number].clone())?,
            }
        }
        Ok(())
    }

    /// Moves a light, or makes it another one of its kind; the first has the number 0.
    ///
    /// # Errors
    /// [`FrameError::Device`]; [`FrameError::Value`] for a light that the frame does not have.
    pub fn set_light(&mut self, number: usize, light: &Light) -> Result<()> {
        let Some(i) = self.numbers.iter().position(|n| *n == number) else {
            return Err(FrameError::Value {
                value: format!("light {number}"),
                problem: format!(
                    "the frame has {} lights, counted from 0",
                    self.numbers.len()
                ),
            });
        };
        refused(&self.scene, number, light)?;
        let given = self.given[i];
        if self.scene.medium.is_some() && given.is_spot != light.spot().is_some() {
            let kind = if given.is_spot {
                "a spot light"
            } else {
                "a directional light"
            };
            return Err(GraphError::Light {
                number: number + 1,
                problem: format!(
                    "it must stay {kind}: in a medium, each kind has passes of its own"
                ),
            }
            .into());
        }
        self.scene.lights[number] = *light;
        let view = light_view(&self.scene, light, self.mesh);
        let lit = Lit {
            light,
            view: &view,
            is_first: i == 0,
            count: self.numbers.len(),
        };
        let uniform = uniform(&self.scene, &lit, self.show);
        if self.show == Show::Light {
            let normals = facing(light, self.mesh);
            self.executor.set_buffer(given.normals, &normals)?;
        }
        if let Some(Translucent { indices, .. }) = given.translucent {
            let triangles = translucent(light, self.mesh);
            let triangles = triangles.as_flattened();
            self.executor.set_buffer(indices, triangles)?;
        }
        self.executor.set(given.light, &uniform)?;
        self.executor.set(given.area, &area(light, &view))?;
        let transform = transform(view.clip_from_world);
        self.executor.set(given.light_view, &transform)?;
        self.set_space(i, &view)
    }

    /// What the medium's kernels take of camera and light.
    fn set_space(&mut self, i: usize, view: &LightView) -> Result<()> {
        let light = &self.scene.lights[self.numbers[i]];
        let space = Space::of(&self.scene, light, view, self.mesh, self.show);
        let (Some(volume), Some(space)) = (self.given[i].volume, space) else {
            return Ok(());
        };
        self.executor.set(volume.view, &space.view)?;
        if let (Some(of), Some((rectified, rows))) = (volume.rectification, space.rectified) {
            self.executor.set(of.rectified, &rectified)?;
            self.executor.set_buffer(of.rows, &rows)?;
        }
        Ok(())
    }

    /// Runs what has to run; see [`Executor::run`].
    ///
    /// # Errors
    /// [`FrameError::Device`].
    pub fn run(&mut self, clock: Clock, progress: &mut dyn Progress) -> Result<Run> {
        self.executor.run(clock, progress)
    }

    /// The executor.
    pub const fn executor(&mut self) -> &mut Executor<'d> {
        &mut self.executor
    }

    /// What the picture's texels are.
    fn graph_format(&self) -> TexelFormat {
        self.given.first().map_or(PICTURE, |given| given.format)
    }

    /// The picture of the last run, in linear light, rows from the top.
    ///
    /// # Errors
    /// [`FrameError::Value`] before the first run; [`FrameError::Device`].
    pub fn linear(&mut self) -> Result<Vec<Vec4>> {
        let texels = self.executor.read(self.picture)?;
        let format = self.graph_format();
        let texels = texels.chunks_exact(format.bytes());
        Ok(texels.map(|t| format.load(t)).collect())
    }

    /// The picture of the last run.
    ///
    /// # Errors
    /// As for [`Frame::linear`].
    pub fn picture(&mut self) -> Result<Picture> {
        Ok(Picture::from_linear(
            self.scene.width,
            self.scene.height,
            self.linear()?.into_iter(),
        ))
    }
}

/// A picture and how it came about. All but the picture can be serialised.
#[derive(Clone, Debug, Serialize)]
pub struct Rendering {
    /// The picture.
    #[serde(skip)]
    pub picture: Picture,
    /// The same in linear light.
    #[serde(skip)]
    pub linear: Linear,
    /// Which device made it.
    pub device: String,
    /// The scene's triangles.
    pub triangles: usize,
    /// Edge of the shadow map's texels in world units, along x and y; of the first light's map.
    pub texel: [f32; 2],
    /// Share of the pixels whose samples see different triangles, where that was counted
    /// (natively): where rounding may decide what a sample sees.
    pub edges: Option<f64>,
    /// What was done, and what was not.
    pub plan: Summary,
    /// What it took on the device.
    pub memory: Memory,
    /// How long it took, in order.
    pub timings: Vec<Timing>,
}

impl Rendering {
    /// Wall time of all parts.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.timings.iter().map(|t| t.seconds).sum()
    }
}

/// Both pictures of a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// From this machine's processor.
    pub native: Rendering,
    /// From Vulkan.
    pub vulkan: Rendering,
    /// How they differ.
    pub difference: Difference,
}

/// Share of the pixels where rounding of the sampler's weights, of the target to half precision and
/// of the moments to 16 bits may be seen, away from edges.
const ROUNDED: f64 = 0.01;

impl Comparison {
    /// The share of pixels that may differ by more than 1/255 between the backends.
    ///
    /// A rasteriser puts vertices on a grid of 1/256 pixel, rays do not. So an edge may be half a
    /// step and a rounding away from where the ray sees it, at most 1/256 pixel, and a sample sees
    /// another triangle only if it lies in a strip of that half-width along the edge. A strip
    /// crosses at most sqrt(2) of a pixel; four samples, none likelier than another to lie in it: of
    /// the pixels with an edge, at most 4 * sqrt(2) * 2/256 = 4.4 % have such a sample. The same
    /// happens to texels of the shadow map, where a changed sample is a quarter of one texel and the
    /// filter spreads it: its share of the picture is counted as once more as much.
    #[must_use]
    pub fn limit(&self) -> f64 {
        let edges = self.native.edges.unwrap_or(0.0);
        2.0 * 4.0 * 2.0_f64.sqrt() * 2.0 / 256.0 * edges + ROUNDED
    }
}

/// By how much [`compare`] amplifies the difference picture unless told otherwise.
pub const AMPLIFICATION: u32 = 16;

/// Loads the scene's geometry, opens a device, and renders.
///
/// # Errors
/// See [`FrameError`].
pub fn render(
    scene: &Scene,
    backend: Backend,
    shaders: &dyn Shaders,
    progress: &mut dyn Progress,
) -> Result<Rendering> {
    let mesh = scene.mesh()?;
    let mut device = open(backend)?;
    render_on(&mut *device, scene, &mesh, shaders, progress)
}

/// Renders a scene natively and on Vulkan, and compares the pictures; `amplification` is that of
/// the difference picture.
///
/// # Errors
/// See [`FrameError`].
pub fn compare(
    scene: &Scene,
    shaders: &dyn Shaders,
    amplification: u32,
    progress: &mut dyn Progress,
) -> Result<Comparison> {
    // Whether there is a driver shows before the long work starts.
    let mut vulkan = open(Backend::Vulkan)?;
    let mut native = open(Backend::Native)?;
    let mesh = scene.mesh()?;
    let native = render_on(&mut *native, scene, &mesh, shaders, progress)?;
    let vulkan = render_on(&mut *vulkan, scene, &mesh, shaders, progress)?;
    let difference = native.picture.difference(&vulkan.picture, amplification)?;
    Ok(Comparison {
        native,
        vulkan,
        difference,
    })
}

/// Renders a scene's triangles once, on a device that is open already.
///
/// # Errors
/// See [`FrameError`].
pub fn render_on(
    device: &mut dyn Device,
    scene: &Scene,
    mesh: &Mesh,
    shaders: &dyn Shaders,
    progress: &mut dyn Progress,
) -> Result<Rendering> {
    let start = Instant::now();
    let name = device.name().to_string();
    let mut frame = Frame::still(device, shaders, scene, mesh, Show::Picture)?;
    let mut timings = vec![Timing::new("set-up", start.elapsed())];
    let run = frame.run(Clock::Passes, progress)?;
    timings.extend(run.ran);
    let start = Instant::now();
    let linear = Linear {
        width: scene.width,
        height: scene.height,
        pixels: frame.linear()?,
    };
    timings.push(Timing::new("read back", start.elapsed()));
    Ok(Rendering {
        picture: linear.picture(),
        linear,
        device: name,
        triangles: mesh.triangles.len(),
        texel: light_view(scene, &scene.lights[0], mesh).texel,
        edges: run.edges,
        plan: frame.executor.graph().summary(),
        memory: frame.executor.memory(),
        timings,
    })
}

fn open(backend: Backend) -> Result<Box<dyn Device>> {
    device::open(backend).map_err(|source| FrameError::Device {
        during: format!("opening the {backend} device"),
        source,
    })
}
