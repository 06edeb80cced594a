//! From a scene to a picture.

use std::borrow::Cow;
use std::time::Instant;

use hankel_dsl::glam::{Mat4, Vec3, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_host::device::{self, Backend, Device};
use hankel_moments::FixedPoint;
use hankel_shadows::depth::Transform;
use hankel_shadows::shade::Light;
use hankel_shadows::soft::{Area, MOST_REACH};
use serde::Serialize;

use crate::error::{FrameError, Result};
use crate::executor::{Clock, Executor, Memory, Progress, Run, Shaders, Timing};
use crate::graph::{self, Graph, Handle, Summary, Work};
use crate::passes::{Given, Translucent};
use crate::picture::{Difference, Picture};
use crate::scene::{Camera, CameraView, Fit, LightView, Mesh, Scene};
use crate::volume::Space;

/// What is seen where nothing is: a pale sky, in linear light.
const BACKGROUND: [f32; 3] = [0.5, 0.6, 0.72];
/// Light from the sky.
const AMBIENT: Vec4 = Vec4::new(0.24, 0.28, 0.33, 0.0);
/// What the light adds on a surface that faces it.
pub(crate) const IRRADIANCE: f32 = 1.15;
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

pub(crate) fn light_view(scene: &Scene, direction: Vec3, mesh: &Mesh) -> LightView {
    let shadow = &scene.shadow;
    // The filter and the sampler's interpolation stay inside of the map.
    let margin = shadow.filter / 2 + 1;
    match shadow.fit {
        Fit::Scene => LightView::new(direction, mesh, shadow.size, margin),
        Fit::Camera => {
            let camera = camera_view(scene, &scene.camera, mesh);
            let fitted = match scene.medium {
                Some(_) => LightView::fitted_to_space,
                None => LightView::fitted,
            };
            fitted(direction, mesh, shadow.size, margin, &camera)
        }
    }
}

/// What a frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Show {
    /// The scene, lit.
    Picture,
    /// The share of light that arrives, 1 minus the shadow, in 32-bit floats: white surfaces that
    /// face the light everywhere, seen through translucent ones. The same passes by the same kernels make it.
    Light,
    /// The share of light that the medium scatters towards the camera, but for its phase function and what it
    /// absorbs, in 32-bit floats: black surfaces. The same passes by the same kernels make it.
    Scattered,
}

/// The light as the shading kernels take it.
pub(crate) fn light(scene: &Scene, view: &LightView, show: Show) -> Light {
    let shadow = &scene.shadow;
    let clip = view.clip_from_world;
    let (irradiance, ambient) = match show {
        Show::Picture => (IRRADIANCE, AMBIENT),
        Show::Light | Show::Scattered => (1.0, Vec4::ZERO),
    };
    Light {
        row_u: clip.row(0) * 0.5 + Vec4::W * 0.5,
        // Rows of the map count from the top.
        row_v: clip.row(1) * -0.5 + Vec4::W * 0.5,
        row_depth: clip.row(2),
        toward: (-view.direction).extend(irradiance),
        ambient,
        bias_target: Vec4::from_array(shadow.map.bias_target),
        moment_bias: shadow.moment_bias,
        depth_bias: shadow.depth_bias,
        light_leak: shadow.leak_cut,
        filter_radius: shadow.filter / 2,
    }
}

/// Steepness, depth over width, of the steepest surface that must not shade itself in a soft shadow.
const STEEPEST: f32 = 2.0;
/// The same for a region that is compared as a whole: of a steeper one, less than half is in front of its
/// own middle, and moments bound little of that. More would lose what is in contact.
const MARGIN: f32 = 0.5;

/// The light's area as the kernels of soft shadows take it.
pub(crate) fn area(scene: &Scene, view: &LightView) -> Area {
    let radius = scene.area.radius;
    let spread = view.texel.map(|texel| radius * view.depth / texel);
    // Texels of the largest rectangle that is read of a table, which is a texel wide at least.
    let [x, y] = spread.map(|s| 2 * s.clamp(0.5, MOST_REACH).ceil() as u32);
    Area {
        spread: spread.into(),
        slack: (STEEPEST * radius).min(0.5),
        margin: (MARGIN * radius).min(0.5),
        one: FixedPoint::for_kernel(x * y).one,
        padding: 0,
    }
}

/// The graph of a scene's frame: what its technique starts from, and the picture, in linear light.
///
/// # Errors
/// [`graph::GraphError`] for a technique that does not fit its kernels.
pub fn graph(scene: &Scene, mesh: &Mesh, show: Show) -> graph::Result<(Graph, Given, Handle)> {
    let view = light_view(scene, scene.light, mesh);
    let camera = camera_view(scene, &scene.camera, mesh);
    let mut graph = Graph::new(hankel_shadows::entries());
    let translucent = mesh.translucent_along(view.direction);
    let translucent = (!translucent.is_empty()).then(|| Translucent {
        indices: graph.buffer("translucent indices", translucent.as_flattened()),
        opacities: graph.buffer("opacities", &mesh.all_opacities()),
    });
    let vertices = mesh.positions.len();
    let (normals, colours, format, [r, g, b]) = match show {
        Show::Picture => (
            Cow::Borrowed(&mesh.normals),
            Cow::Borrowed(&mesh.colours),
            PICTURE,
            BACKGROUND.map(f64::from),
        ),
        Show::Light => (
            Cow::Owned(vec![-view.direction; vertices]),
            Cow::Owned(vec![Vec3::ONE; vertices]),
            TexelFormat::Rgba32Float,
            [1.0; 3],
        ),
        Show::Scattered => (
            Cow::Borrowed(&mesh.normals),
            Cow::Owned(vec![Vec3::ZERO; vertices]),
            TexelFormat::Rgba32Float,
            [0.0; 3],
        ),
    };
    let space = Space::of(scene, mesh, show);
    let lit = graph.buffer("normals", &normals);
    // Those of the light alone are lit as if they faced it.
    let planes = match show {
        Show::Light => graph.buffer("planes", &mesh.normals),
        Show::Picture | Show::Scattered => lit,
    };
    let given = Given {
        positions: graph.buffer("positions", &mesh.positions),
        normals: lit,
        planes,
        colours: graph.buffer("colours", &colours),
        indices: graph.buffer("indices", mesh.opaque().as_flattened()),
        translucent,
        light_view: graph.parameter("light's view", &transform(view.clip_from_world)),
        camera: graph.parameter("camera", &transform(camera.clip_from_world)),
        light: graph.parameter("light", &light(scene, &view, show)),
        area: graph.parameter("light's area", &area(scene, &view)),
        source: scene.area,
        volume: space.map(|space| space.add_to(&mut graph)),
        shadow: scene.shadow,
        size: [scene.width, scene.height],
        format,
        background: [r, g, b, 1.0],
        is_tinted: show == Show::Picture,
    };
    for (value, meaning) in [
        (given.positions, "Positions of the vertices in world space."),
        (
            given.normals,
            "Unit normals of the vertices in world space.",
        ),
        (given.colours, "Colours of the vertices, linear."),
        (given.indices, "Three vertices for each triangle."),
        (
            given.light_view,
            "From world space to the clip space of the shadow map.",
        ),
        (
            given.camera,
            "From world space to the clip space of the picture.",
        ),
        (
            given.light,
            "The light, and how its shadow map is read. The rows follow from the transform to the shadow \
             map's clip space: u and v are half of x and of -y plus a half, depth is z.",
        ),
        (given.area, "The light's area, as its shadow map sees it."),
    ] {
        graph.describe(value, meaning);
    }
    if let Some(volume) = given.volume {
        for (value, meaning) in [
            (
                volume.view,
                "How pixels look into the world; it follows from the camera.",
            ),
            (volume.medium, "What scatters between surfaces."),
            (
                volume.rectified,
                "Coordinates in which rays from the camera are rows of the shadow map; they follow from the camera \
                 and the light.",
            ),
            (
                volume.rows,
                "What differs from row to row of the rectified map; it follows from the camera and the light.",
            ),
        ] {
            graph.describe(value, meaning);
        }
    }
    let mut picture = (scene.shadow.technique.add)(&mut graph, &given)?;
    // Where there is a medium, there is its volume.
    match scene.medium.as_ref().zip(given.volume) {
        Some((medium, volume)) => {
            picture = (medium.technique.add)(&mut graph, &given, &volume, picture)?;
        }
        None => graph.omit("scattering", "there is no medium"),
    }
    if scene.shadow.mips && !graph.omitted().iter().any(|it| it.what == "mips") {
        let has_levels = |pass: &graph::Pass| matches!(pass.work, Work::Levels(_));
        if !graph.passes().iter().any(has_levels) {
            graph.omit("mips", "the technique interpolates no map");
        }
    }
    graph.keep(picture);
    Ok((graph, given, picture))
}

/// A scene's frame on a device: to be drawn again after the camera or the light has moved.
pub struct Frame<'d> {
    executor: Executor<'d>,
    scene: Scene,
    mesh: &'d Mesh,
    show: Show,
    given: Given,
    picture: Handle,
}

impl<'d> Frame<'d> {
    /// Makes everything that the frame needs on the device.
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
        let (graph, given, picture) = graph(scene, mesh, show)?;
        Ok(Self {
            executor: Executor::new(device, shaders, graph)?,
            scene: scene.clone(),
            mesh,
            show,
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
        self.executor.set(self.given.camera, &transform)?;
        match self.scene.shadow.fit {
            Fit::Scene => self.set_space(),
            Fit::Camera => self.set_light(self.scene.light),
        }
    }

    /// Turns the light: `direction` is the way it goes, not zero.
    ///
    /// # Errors
    /// [`FrameError::Device`].
    pub fn set_light(&mut self, direction: Vec3) -> Result<()> {
        self.scene.light = direction;
        let view = light_view(&self.scene, direction, self.mesh);
        let uniform = light(&self.scene, &view, self.show);
        if self.show == Show::Light {
            let normals = vec![-view.direction; self.mesh.positions.len()];
            self.executor.set_buffer(self.given.normals, &normals)?;
        }
        if let Some(translucent) = self.given.translucent {
            let triangles = self.mesh.translucent_along(view.direction);
            let indices = triangles.as_flattened();
            self.executor.set_buffer(translucent.indices, indices)?;
        }
        self.executor.set(self.given.light, &uniform)?;
        let area = area(&self.scene, &view);
        self.executor.set(self.given.area, &area)?;
        let transform = transform(view.clip_from_world);
        self.executor.set(self.given.light_view, &transform)?;
        self.set_space()
    }

    /// What the medium's kernels take of camera and light.
    fn set_space(&mut self) -> Result<()> {
        let space = Space::of(&self.scene, self.mesh, self.show);
        let (Some(volume), Some(space)) = (self.given.volume, space) else {
            return Ok(());
        };
        self.executor.set(volume.view, &space.view)?;
        self.executor.set(volume.rectified, &space.rectified)?;
        self.executor.set_buffer(volume.rows, &space.rows)
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

    /// The picture of the last run, in linear light, rows from the top.
    ///
    /// # Errors
    /// [`FrameError::Value`] before the first run; [`FrameError::Device`].
    pub fn linear(&mut self) -> Result<Vec<Vec4>> {
        let texels = self.executor.read(self.picture)?;
        let format = self.given.format;
        let texels = texels.chunks_exact(format.bytes());
        Ok(texels.map(|t| format.load(t)).collect())
    }

    /// The picture of the last run.
    ///
    /// # Errors
    /// As for [`Frame::linear`].
    pub fn picture(&mut self) -> Result<Picture> {
        let [width, height] = self.given.size;
        Ok(Picture::from_linear(
            width,
            height,
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
    /// Which device made it.
    pub device: String,
    /// The scene's triangles.
    pub triangles: usize,
    /// Edge of the shadow map's texels in world units, along x and y.
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
    let mut frame = Frame::new(device, shaders, scene, mesh, Show::Picture)?;
    let mut timings = vec![Timing::new("set-up", start.elapsed())];
    let run = frame.run(Clock::Passes, progress)?;
    timings.extend(run.ran);
    let start = Instant::now();
    let picture = frame.picture()?;
    timings.push(Timing::new("read back", start.elapsed()));
    Ok(Rendering {
        picture,
        device: name,
        triangles: mesh.triangles.len(),
        texel: light_view(scene, scene.light, mesh).texel,
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
