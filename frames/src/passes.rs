//! Passes that techniques share: functions that take handles and return a handle.

use std::borrow::Cow;
use std::marker::PhantomData;

use hankel_dsl::glam::{IVec2, UVec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::layout::Element;
use hankel_dsl::native::{Address, Filter, Sampler};
use hankel_host::device::{Blend, Format};
use hankel_moments::Fixed6;
use hankel_moments::bias::{Bias, SYMMETRIC_4_16_LECTURE, SYMMETRIC_4_32, UNIT_4_16};
use hankel_shadows::blur::Taps;
use hankel_shadows::mips::Raster;
use hankel_shadows::shade::encoding;
use hankel_shadows::soft::{Halving, Level, Pyramid, PyramidLines};

use crate::graph::{AddCompute, AddDraw, Graph, Handle, Result, Shape, Surfaces};
use crate::scene::{Area, DepthRange, Shadow};
use crate::techniques::{DepthBias, Map};

/// How maps are looked up.
pub const BILINEAR: Sampler = Sampler::new(Filter::Linear, Address::ClampToEdge);

/// What techniques of scattering start from beside that.
#[derive(Clone, Copy, Debug)]
pub struct Volume {
    /// How pixels look into the world, [`hankel_shadows::scattering::View`].
    pub view: Handle,
    /// What scatters, [`hankel_shadows::scattering::Medium`].
    pub medium: Handle,
    /// How rays from the camera are rows of the shadow map; of a directional light only.
    pub rectification: Option<Rectification>,
    /// Steps along a ray, where one is marched along.
    pub steps: u32,
}

/// How rays from the camera are rows of a directional light's shadow map.
#[derive(Clone, Copy, Debug)]
pub struct Rectification {
    /// The coordinates, [`hankel_shadows::scattering::Rectified`].
    pub rectified: Handle,
    /// Each row's direction, and its extinction per unit of radius.
    pub rows: Handle,
    /// Texels of a row, and rows.
    pub texels: [u32; 2],
}

/// What every technique starts from.
#[derive(Clone, Copy, Debug)]
pub struct Given {
    /// World-space positions of the vertices.
    pub positions: Handle,
    /// Unit normals that they are lit by.
    pub normals: Handle,
    /// Their own unit normals: the planes that pixels see.
    pub planes: Handle,
    /// Their colours.
    pub colours: Handle,
    /// Three for each triangle.
    pub indices: Handle,
    /// Translucent triangles, if there are any; they are not among `indices`.
    pub translucent: Option<Translucent>,
    /// From the world to the shadow map, [`hankel_shadows::depth::Transform`].
    pub light_view: Handle,
    /// From the world to the picture, [`hankel_shadows::depth::Transform`].
    pub camera: Handle,
    /// How the light shines and its map is read, [`hankel_shadows::shade::Light`].
    pub light: Handle,
    /// How large it is, [`hankel_shadows::soft::Area`].
    pub area: Handle,
    /// The light's outline.
    pub source: Area,
    /// Whether it is a spot light.
    pub is_spot: bool,
    /// What is between surfaces, if anything is.
    pub volume: Option<Volume>,
    /// What the scene asks for.
    pub shadow: Shadow,
    /// Pixels of the picture.
    pub size: [u32; 2],
    /// What its pixels are.
    pub format: TexelFormat,
    /// The colour where nothing is.
    pub background: [f64; 4],
    /// Whether the picture shows translucent surfaces, not only their shadow.
    pub is_tinted: bool,
}

/// Triangles that let a share of the light pass.
#[derive(Clone, Copy, Debug)]
pub struct Translucent {
    /// Three for each triangle, from the farthest from the light to the nearest.
    pub indices: Handle,
    /// Of each vertex, the share of light that does not pass.
    pub opacities: Handle,
}

/// What [`Graph::omit`] calls translucent casters that cast no shadow on surfaces.
pub const TRANSLUCENT: &str = "shadow of translucent casters";

/// The same of those that cast no shadow in a medium.
pub const TRANSLUCENT_IN_MEDIUM: &str = "shadow of translucent casters in the medium";

/// The name of `kernel` for textures with as many samples as the scene asks for: that of one sample has `_single` after
/// the first word of its name.
#[must_use]
pub fn by_samples(given: &Given, kernel: &str) -> String {
    match (given.shadow.multisampling, kernel.split_once('_')) {
        (1, Some((first, others))) => format!("{first}_single_{others}"),
        _ => kernel.into(),
    }
}

/// Depth as the light sees it, of opaque casters only, with as many samples as the scene asks for.
///
/// # Errors
/// [`crate::graph::GraphError`], as of all functions here.
pub fn light_depth(graph: &mut Graph, given: &Given) -> Result<Handle> {
    if given.translucent.is_some() {
        graph.omit(
            TRANSLUCENT,
            "of each sample the map holds the nearest depth, and a share of it cannot be told",
        );
    }
    opaque_depth(graph, given)
}

/// Depth as the light sees it, of opaque casters, for techniques that see to the others.
///
/// # Errors
/// See [`light_depth`].
pub fn opaque_depth(graph: &mut Graph, given: &Given) -> Result<Handle> {
    if given.translucent.is_none() {
        graph.omit("blending", "no caster is translucent");
    }
    let surfaces = Surfaces {
        positions: given.positions,
        indices: given.indices,
        clip_from_world: given.light_view,
    };
    let size = [given.shadow.size; 2];
    let pass = graph
        .draw("depth", surfaces, "light_depth")
        .arg("position", given.positions)
        .arg("light", given.light_view);
    match given.shadow.multisampling {
        1 => pass.single_depth(size),
        _ => pass.depth(size),
    }
}

/// Depth as the camera sees it, with so many samples of each pixel.
///
/// # Errors
/// See [`light_depth`].
pub fn camera_depth(graph: &mut Graph, given: &Given, samples: u32) -> Result<Handle> {
    let surfaces = Surfaces {
        positions: given.positions,
        indices: given.indices,
        clip_from_world: given.camera,
    };
    let pass = graph
        .draw("camera depth", surfaces, "light_depth")
        .arg("position", given.positions)
        .arg("light", given.camera);
    match samples {
        1 => pass.single_depth(given.size),
        _ => pass.depth(given.size),
    }
}

/// The maps of four power moments: the moment bias pulls towards a published target, by the published
/// strength.
pub const POWER_MOMENTS: &[Map] = &[
    Map {
        format: TexelFormat::Rgba16Unorm,
        depth_range: DepthRange::Symmetric,
        encoding: encoding::SYMMETRIC,
        ..biased(SYMMETRIC_4_16_LECTURE)
    },
    Map {
        format: TexelFormat::Rgba16Unorm,
        depth_range: DepthRange::Unit,
        encoding: encoding::UNIT,
        ..biased(UNIT_4_16)
    },
    Map {
        format: TexelFormat::Rgba32Float,
        depth_range: DepthRange::Symmetric,
        encoding: encoding::PLAIN,
        ..biased(SYMMETRIC_4_32)
    },
];

/// A map whose moments are pulled towards a published target, by the published strength.
pub(crate) const fn biased(bias: Bias) -> Map {
    let target = bias.four();
    Map {
        moment_bias: bias.strength as f32,
        bias_target: [target.b1, target.b2, target.b3, target.b4],
        ..DEPTHS[0]
    }
}

/// The one map of techniques that make none of the light's depths.
pub const DEPTHS: &[Map] = &[Map {
    format: TexelFormat::R32Float,
    depth_range: DepthRange::Unit,
    encoding: 0,
    moment_bias: 0.0,
    bias_target: [0.0; 4],
}];

/// The kernel that makes the mean of four power moments of each texel's samples, as one of [`POWER_MOMENTS`].
const fn resolve_moments(given: &Given) -> &'static str {
    match given.shadow.map.encoding {
        encoding::UNIT => "resolve_unit",
        encoding::SYMMETRIC => "resolve_symmetric",
        _ => "resolve_plain",
    }
}

/// The map of four power moments, as one of [`POWER_MOMENTS`], of opaque and translucent casters.
///
/// # Errors
/// See [`light_depth`].
pub fn moment_map(graph: &mut Graph, given: &Given) -> Result<Handle> {
    let kernel = resolve_moments(given);
    let blended = Blended::halves("translucent_moments");
    resolve_casters(graph, given, kernel, &blended)?.image([given.shadow.size; 2])
}

/// How the moments of translucent casters are blended.
pub struct Blended {
    /// The fragment kernel. Its constant `part` is the number of a draw, if there are several.
    pub fragment: &'static str,
    /// Of each draw, its label and the name of its result in `resolve_translucent_…`.
    pub draws: &'static [(&'static str, &'static str)],
}

impl Blended {
    /// In two halves, which are more than four channels together with the opacity.
    #[must_use]
    pub const fn halves(fragment: &'static str) -> Self {
        Self {
            fragment,
            draws: &[
                ("blend first half", "first"),
                ("blend second half", "second"),
            ],
        }
    }
}

/// Begins the pass that makes a map of power moments of opaque and translucent casters, by the kernel `resolve_…`; where
/// there are translucent ones, by `resolve_translucent_…`, from what is blended: in 32-bit floats if the map has those,
/// else in 16 bits.
///
/// # Errors
/// See [`light_depth`].
pub fn resolve_casters<'g>(
    graph: &'g mut Graph,
    given: &Given,
    kernel: &str,
    blended: &Blended,
) -> Result<AddCompute<'g>> {
    let depth = opaque_depth(graph, given)?;
    let Some(translucent) = given.translucent else {
        return Ok(resolve_depth(graph, given, kernel, depth));
    };
    let map = given.shadow.map;
    let (format, encoding) = match (map.format, map.depth_range) {
        (TexelFormat::Rgba32Float | TexelFormat::Rg32Float, _) => {
            (TexelFormat::Rgba32Float, encoding::PLAIN)
        }
        (_, DepthRange::Unit) => (TexelFormat::Rgba16Unorm, encoding::UNIT),
        (_, DepthRange::Symmetric) => (TexelFormat::Rgba16Unorm, encoding::SYMMETRIC),
    };
    let mut results = Vec::new();
    for (part, (label, name)) in blended.draws.iter().enumerate() {
        let mut pass = draw_translucent(graph, given, &translucent, label, given.light_view)
            .fragment(blended.fragment)
            .constant("encoding", encoding)
            .blend(Blend::Alpha)
            .before(depth);
        if blended.draws.len() > 1 {
            pass = pass.constant("part", part as u32);
        }
        results.push((*name, samples_of_map(pass, given, format, [0.0; 4])?));
    }
    let kernel = kernel.replacen("resolve_", "resolve_translucent_", 1);
    let pass = resolve_depth(graph, given, &kernel, depth);
    Ok(results
        .into_iter()
        .fold(pass, |pass, (name, result)| pass.arg(name, result)))
}

/// Adds a draw into all samples of the light's map, as many as its depth has.
///
/// # Errors
/// See [`light_depth`].
pub fn samples_of_map(
    pass: AddDraw<'_>,
    given: &Given,
    format: TexelFormat,
    background: [f64; 4],
) -> Result<Handle> {
    let size = [given.shadow.size; 2];
    match given.shadow.multisampling {
        1 => pass.single_samples(size, format, background),
        _ => pass.samples(size, format, background),
    }
}

/// Begins the pass that draws translucent triangles as a light or a camera sees them.
pub fn draw_translucent<'g>(
    graph: &'g mut Graph,
    given: &Given,
    translucent: &Translucent,
    label: &'static str,
    view: Handle,
) -> AddDraw<'g> {
    let surfaces = Surfaces {
        positions: given.positions,
        indices: translucent.indices,
        clip_from_world: view,
    };
    graph
        .draw(label, surfaces, "translucent")
        .arg("position", given.positions)
        .arg("colour", given.colours)
        .arg("opacity", translucent.opacities)
        .arg("view", view)
}

/// A picture as it is seen through the translucent triangles before its surfaces: they absorb, each channel for
/// itself, and scatter nothing.
///
/// # Errors
/// See [`light_depth`].
pub fn see_through(graph: &mut Graph, given: &Given, picture: Handle) -> Result<Handle> {
    let Some(translucent) = given.translucent.filter(|_| given.is_tinted) else {
        return Ok(picture);
    };
    let surfaces = Surfaces {
        positions: given.positions,
        indices: given.indices,
        clip_from_world: given.camera,
    };
    let depth = graph
        .draw("depth of the picture", surfaces, "light_depth")
        .arg("position", given.positions)
        .arg("light", given.camera)
        .depth(given.size)?;
    let tint = draw_translucent(graph, given, &translucent, "tint", given.camera)
        .fragment("tint")
        .blend(Blend::Multiplicative)
        .before(depth)
        .colour(given.size, given.format, [1.0; 4])?;
    graph
        .compute("tinted picture", "tinted")
        .arg("picture", picture)
        .arg("tint", tint)
        .image(given.size)
}

/// Begins the pass that makes a map of the light's depths.
pub fn resolve<'g>(
    graph: &'g mut Graph,
    given: &Given,
    kernel: impl Into<Cow<'static, str>>,
) -> AddCompute<'g> {
    let format = given.shadow.map.format;
    if Format::Texel(format).has_32_bit_floats() {
        graph.omit("quantisation", "32 bits hold what is filtered as it is");
    }
    graph.compute("resolve", kernel)
}

/// Begins the pass that makes a map of the light's depths, by the kernel `resolve_…` for several samples or by its
/// counterpart for one.
pub fn resolve_depth<'g>(
    graph: &'g mut Graph,
    given: &Given,
    kernel: &str,
    depth: Handle,
) -> AddCompute<'g> {
    resolve(graph, given, by_samples(given, kernel)).arg("depth", depth)
}

/// The filtered maps that `kernel` makes of the light's depths: a texture for each of `names`, which are those of the
/// parameters that it is looked up by.
///
/// # Errors
/// See [`light_depth`].
pub fn filtered_maps(
    graph: &mut Graph,
    given: &Given,
    kernel: &str,
    names: &[&'static str],
) -> Result<Vec<(&'static str, Handle)>> {
    let depth = light_depth(graph, given)?;
    let maps = textures(
        resolve_depth(graph, given, kernel, depth),
        given,
        names.len(),
    )?;
    blurred(graph, given, &maps, names)
}

/// Adds a pass that makes so many textures of the size of the light's map.
///
/// # Errors
/// See [`light_depth`].
pub fn textures(pass: AddCompute<'_>, given: &Given, count: usize) -> Result<Vec<Handle>> {
    let size = [given.shadow.size, given.shadow.size, 1];
    let pass = (0..count).fold(pass, |pass, _| pass.texels(size));
    Ok(pass.finish()?.outputs)
}

/// Maps after the filter, each with its name.
///
/// # Errors
/// See [`light_depth`].
pub fn blurred(
    graph: &mut Graph,
    given: &Given,
    maps: &[Handle],
    names: &[&'static str],
) -> Result<Vec<(&'static str, Handle)>> {
    names
        .iter()
        .zip(maps)
        .map(|(name, map)| Ok((*name, blur(graph, given, *map)?)))
        .collect()
}

/// Weights of a Gaussian with `taps` taps: of the centre and of the taps to one side. They reach
/// to two standard deviations, and the centre plus twice the others is 1.
#[must_use]
pub fn gaussian(taps: u32) -> Vec<f32> {
    let radius = taps / 2;
    let sigma = f64::from(radius.max(1)) / 2.0;
    let raw: Vec<f64> = (0..=radius)
        .map(|i| (-0.5 * (f64::from(i) / sigma).powi(2)).exp())
        .collect();
    let sum = 2.0 * raw.iter().sum::<f64>() - raw[0];
    raw.iter().map(|w| (w / sum) as f32).collect()
}

/// The pass along `step` of a Gaussian with `taps` taps.
pub fn taps_along(graph: &mut Graph, taps: u32, step: IVec2) -> Handle {
    let pass = graph.constant("taps", &Taps::new(step, &gaussian(taps)));
    graph.describe(
        pass,
        "A pass of the filter: its direction in texels, and its weights from the centre on.",
    );
    pass
}

/// The Gaussian that the scene asks for, along rows and along columns; the map itself where that
/// is one texel wide.
///
/// # Errors
/// See [`light_depth`].
pub fn blur(graph: &mut Graph, given: &Given, map: Handle) -> Result<Handle> {
    let taps = given.shadow.filter;
    let Some(Shape::Texture(shape)) = graph.value(map).map(|v| v.shape.clone()) else {
        return Ok(map);
    };
    if taps <= 1 {
        graph.omit("blur", "the filter is one texel wide");
        return Ok(map);
    }
    let kernel = format!("blur_{}", shape.format.name());
    let mut map = map;
    for (label, step) in [("blur rows", IVec2::X), ("blur columns", IVec2::Y)] {
        let pass = taps_along(graph, taps, step);
        map = graph
            .compute(label, kernel.clone())
            .arg("taps", pass)
            .arg("source", map)
            .note(format!("{taps} taps"))
            .image([shape.size[0], shape.size[1]])?;
    }
    Ok(map)
}

/// A filtered map with all of its mip levels.
///
/// # Errors
/// See [`light_depth`].
pub fn mips(graph: &mut Graph, map: Handle) -> Result<Handle> {
    let Some(Shape::Texture(shape)) = graph.value(map).map(|v| v.shape.clone()) else {
        return Ok(map);
    };
    let mut levels = vec![map];
    let mut finer = map;
    for level in 1..shape.most_levels() {
        let [width, height, _] = shape.level_size(level);
        finer = graph
            .compute("mips", format!("halve_{}", shape.format.name()))
            .arg("source", finer)
            .image([width, height])?;
        levels.push(finer);
    }
    graph.levels("mips", &levels)
}

/// The kernels that make a pyramid of summed-area tables, with elements of type `T`.
pub struct Tables<T> {
    /// Makes elements of depths.
    pub resolve: &'static str,
    /// Makes a level of the one before.
    pub halve: &'static str,
    /// Adds elements up along lines.
    pub sum: &'static str,
    /// What an element is.
    pub element: PhantomData<T>,
}

/// Of four moments.
pub const TABLES: Tables<UVec4> = Tables {
    resolve: "resolve_summed",
    halve: "halve_summed",
    sum: "prefix_sums",
    element: PhantomData,
};

/// Of six.
pub const TABLES_6: Tables<Fixed6> = Tables {
    resolve: "resolve_summed_6",
    halve: "halve_summed_6",
    sum: "prefix_sums_6",
    element: PhantomData,
};

/// Summed-area tables of each texel's mean moments, and what levels there are
/// ([`Pyramid`]).
///
/// # Errors
/// See [`light_depth`].
pub fn summed_area<T: Element>(
    graph: &mut Graph,
    given: &Given,
    depth: Handle,
    kernels: &Tables<T>,
) -> Result<[Handle; 2]> {
    graph.omit("blur", "the filter's width differs from pixel to pixel");
    graph.omit("mips", "the table has regions of all sizes");
    let size = [given.shadow.size; 2];
    let pyramid = Pyramid::of(size);
    let levels: Vec<Level> = pyramid.all().collect();
    let elements: u32 = levels
        .iter()
        .map(|level| level.size.element_product())
        .sum();
    let texels = graph.constant("size", &pyramid.size);
    let empty = graph.zeros::<T>("table", elements as usize);
    let resolved = graph
        .compute("resolve", by_samples(given, kernels.resolve))
        .arg("size", texels)
        .arg("depth", depth)
        .arg("table", empty)
        .finish()?;
    // All of these kernels write their table.
    let mut table = resolved.changed("table").unwrap_or(empty);
    for level in levels.windows(2) {
        let halving = Halving {
            size: level[1].size,
            whole: level[0].size,
            first: level[0].first,
            padding: 0,
        };
        let halving = graph.constant("halving", &halving);
        let pass = graph.compute("halve", kernels.halve);
        let halved = pass.arg("halving", halving).arg("table", table).finish()?;
        table = halved.changed("table").unwrap_or(table);
    }
    for (label, across) in [("sum rows", 0), ("sum columns", 1)] {
        let lines = levels.iter().map(|level| level.size[1 - across]);
        let lines = PyramidLines {
            size: pyramid.size,
            invocations: 64 * lines.sum::<u32>(),
            across: across as u32,
        };
        let lines = graph.constant("lines", &lines);
        let pass = graph.compute(label, kernels.sum);
        let summed = pass.arg("lines", lines).arg("table", table).finish()?;
        table = summed.changed("table").unwrap_or(table);
    }
    let pyramid = graph.constant("pyramid", &pyramid);
    Ok([table, pyramid])
}

/// A picture as it is seen through the medium, by a kernel that `kernel` with the picture's format names, which looks at
/// so many samples of each pixel; `bind` gives it what it looks up.
///
/// # Errors
/// See [`light_depth`].
pub fn scatter(
    graph: &mut Graph,
    given: &Given,
    volume: &Volume,
    picture: Handle,
    kernel: &str,
    samples: u32,
    bind: impl FnOnce(AddCompute<'_>) -> AddCompute<'_>,
) -> Result<Handle> {
    let surfaces = camera_depth(graph, given, samples)?;
    let pass = graph
        .compute("scatter", format!("{kernel}_{}", given.format.name()))
        .arg("view", volume.view)
        .arg("medium", volume.medium)
        .arg("light", given.light)
        .arg("picture", picture)
        .arg("surfaces", surfaces);
    bind(pass).image(given.size)
}

/// The picture by a fragment kernel over `world`, `normal` and `colour`; `bind` gives it the map.
///
/// # Errors
/// See [`light_depth`].
pub fn shade(
    graph: &mut Graph,
    given: &Given,
    kernel: impl Into<Cow<'static, str>>,
    bind: impl FnOnce(AddDraw<'_>) -> AddDraw<'_>,
) -> Result<Handle> {
    let pass = surface(graph, given, "surface").fragment(kernel);
    let pass = bind(pass.arg("light", given.light));
    let picture = pass.colour(given.size, given.format, given.background)?;
    see_through(graph, given, picture)
}

/// Begins the pass that draws the picture; `vertex` hands on at least `world`, `normal` and `colour`.
fn surface<'g>(graph: &'g mut Graph, given: &Given, vertex: &'static str) -> AddDraw<'g> {
    if given.shadow.depth_bias == DepthBias::NONE {
        graph.omit("depth bias", "it is 0");
    }
    let surfaces = Surfaces {
        positions: given.positions,
        indices: given.indices,
        clip_from_world: given.camera,
    };
    graph
        .draw("shade", surfaces, vertex)
        .arg("position", given.positions)
        .arg("normal", given.normals)
        .arg("colour", given.colours)
        .arg("camera", given.camera)
}

/// As [`shade`] for a kernel that interpolates `maps`, each by its parameter's name. If the scene asks for mip
/// levels, they get them, and the kernel is the one whose name ends in `_mips`.
///
/// # Errors
/// See [`light_depth`].
pub fn shade_filtered(
    graph: &mut Graph,
    given: &Given,
    kernel: &'static str,
    maps: &[(&'static str, Handle)],
    bind: impl FnOnce(AddDraw<'_>) -> AddDraw<'_>,
) -> Result<Handle> {
    fn with<'g>(pass: AddDraw<'g>, maps: &[(&'static str, Handle)]) -> AddDraw<'g> {
        let pass = pass.arg("sampler", BILINEAR);
        maps.iter()
            .fold(pass, |pass, (name, map)| pass.arg(*name, *map))
    }
    if !given.shadow.mips {
        graph.omit("mips", "the map is read at its own resolution");
        return shade(graph, given, kernel, |pass| bind(with(pass, maps)));
    }
    let mut maps = maps.to_vec();
    for (_, map) in &mut maps {
        *map = mips(graph, *map)?;
    }
    let [width, height] = given.size.map(|n| n as f32);
    let raster = Raster {
        width,
        height,
        anisotropy: given.shadow.anisotropy as f32,
    };
    let raster = graph.constant("raster", &raster);
    graph.describe(
        raster,
        "Pixels of the picture, and how long what one sees of the shadow map may be.",
    );
    let pass = surface(graph, given, "surface_with_plane")
        .arg("plane", given.planes)
        .fragment(format!("{kernel}_mips"))
        .arg("light", given.light)
        .arg("camera", given.camera)
        .arg("raster", raster);
    let pass = bind(with(pass, &maps));
    let picture = pass.colour(given.size, given.format, given.background)?;
    see_through(graph, given, picture)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_sums_to_one_and_falls() {
        for taps in [1, 3, 7, 31] {
            let w = gaussian(taps);
            assert_eq!(w.len() as u32, taps / 2 + 1);
            let sum = 2.0 * w.iter().sum::<f32>() - w[0];
            assert!((sum - 1.0).abs() < 1e-6, "{taps}: {sum}");
            assert!(w.windows(2).all(|p| p[0] > p[1]));
        }
    }
}
