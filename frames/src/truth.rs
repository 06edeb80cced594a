//! How wrong a shadow is: pictures of the light that arrives, by a technique and by rays.
//!
//! - [`by_rays`] knows no map: 256 rays through each pixel, and one from each place that they meet
//!   towards the light; each towards another point of it if the light has an area. Of the light, translucent
//!   surfaces let pass the product of 1 minus each one's opacity. Of a spot light it is what its cone leaves of it,
//!   whatever the distance; of several lights their mean, those left out that reach nothing. A surface that is
//!   turned from the light by its interpolated normal, with which it is shaded, gets none.
//! - [`filtered`] is what a filtered shadow map is meant to be: the same weights as the technique's
//!   filter and lookup, over all depth samples, in double precision. A technique that gives a lower
//!   bound is nowhere darker.
//! - [`regions`] has what filter kernels see in the map.
//! - [`scattering`] has the light that a medium scatters, by rays from along each pixel's rays.
//!
//! All of it runs on this machine's processor.

pub mod regions;
pub mod scattering;

use hankel_dsl::glam::{DVec3, Vec3, Vec4};
use hankel_host::device::{Device, NativeDevice};
use hankel_shadows::depth::row_times_point;
use serde::{Deserialize, Serialize};

use crate::error::{FrameError, Result};
use crate::executor::{Clock, NoShaders, Progress, Quiet, Shaders};
use crate::frame::{Frame, Show, camera_view, transform};
use crate::lights::{Lit, facing, light_view, reaching, uniform};
use crate::passes::gaussian;
use crate::picture::Picture;
use crate::scene::{Light, LightView, Mesh, Scene, Source};
use crate::techniques::DepthBias;
use crate::visibility::SAMPLES;
use crate::visibility::cast::{Caster, Hit, Lens, Segment, in_bands, places};
use crate::visibility::fragments::{Fragments, Varying};

/// The light that arrives at what each pixel sees, from 0 (shadow) to 1; 1 where nothing is. Or the share of light
/// that a medium scatters there, from 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Arriving {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Rows from the top.
    pub values: Vec<f32>,
}

/// How far a picture of the light is from the truth. A value of 1 is all light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Root of the mean squared error.
    pub rms: f64,
    /// Of 100 pixels, 99 are no farther off.
    pub percentile_99: f64,
    /// No pixel is farther off.
    pub worst: f64,
    /// Mean of what is too light.
    pub wrongly_lit: f64,
    /// Mean of what is too dark.
    pub wrongly_dark: f64,
}

impl Arriving {
    /// How far this is from `truth`.
    ///
    /// # Errors
    /// [`FrameError::Sizes`] unless both have the same size.
    pub fn errors(&self, truth: &Self) -> Result<Errors> {
        let sizes = [self, truth].map(|p| [p.width, p.height]);
        if sizes[0] != sizes[1] {
            return Err(FrameError::Sizes {
                left: sizes[0],
                right: sizes[1],
            });
        }
        let pairs = self.values.iter().zip(&truth.values);
        let off: Vec<f64> = pairs.map(|(a, b)| f64::from(*a) - f64::from(*b)).collect();
        let count = off.len().max(1) as f64;
        let mean = |of: fn(f64) -> f64| off.iter().map(|x| of(*x)).sum::<f64>() / count;
        let mut sorted: Vec<f64> = off.iter().map(|x| x.abs()).collect();
        sorted.sort_by(f64::total_cmp);
        let rank = (sorted.len() * 99).div_ceil(100).saturating_sub(1);
        Ok(Errors {
            rms: mean(|x| x * x).sqrt(),
            percentile_99: sorted.get(rank).copied().unwrap_or(0.0),
            worst: sorted.last().copied().unwrap_or(0.0),
            wrongly_lit: mean(|x| x.max(0.0)),
            wrongly_dark: mean(|x| (-x).max(0.0)),
        })
    }
}

/// Colours of what is right, too light and too dark, in sRGB.
const RIGHT: [u8; 3] = [255; 3];
const TOO_LIGHT: [u8; 3] = [214, 96, 0];
const TOO_DARK: [u8; 3] = [0, 92, 190];

impl Arriving {
    fn picture_of(&self, pixels: impl Iterator<Item = [u8; 3]>) -> Picture {
        Picture {
            width: self.width,
            height: self.height,
            pixels: pixels.collect(),
        }
    }

    /// Light as shades of grey, evenly from 0 to 1.
    #[must_use]
    pub fn picture(&self) -> Picture {
        let grey = |v: &f32| [(v.clamp(0.0, 1.0) * 255.0).round() as u8; 3];
        self.picture_of(self.values.iter().map(grey))
    }

    /// Where it differs from the truth: white where it does not, orange where it is too light, blue
    /// where it is too dark; the stronger, the farther off.
    ///
    /// # Errors
    /// [`FrameError::Sizes`] unless both have the same size.
    pub fn off(&self, truth: &Self) -> Result<Picture> {
        let sizes = [self, truth].map(|p| [p.width, p.height]);
        if sizes[0] != sizes[1] {
            return Err(FrameError::Sizes {
                left: sizes[0],
                right: sizes[1],
            });
        }
        let colour = |(a, b): (&f32, &f32)| {
            let off = (a - b).clamp(-1.0, 1.0);
            let to = if off > 0.0 { TOO_LIGHT } else { TOO_DARK };
            // Small errors are to be seen as well.
            let share = off.abs().sqrt();
            std::array::from_fn(|i| {
                (f32::from(RIGHT[i]) * (1.0 - share) + f32::from(to[i]) * share).round() as u8
            })
        };
        Ok(self.picture_of(self.values.iter().zip(&truth.values).map(colour)))
    }
}

impl std::fmt::Display for Errors {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "rms {:.4}, 99 % {:.4}, worst {:.4}, wrongly lit {:.5}, wrongly dark {:.5}",
            self.rms, self.percentile_99, self.worst, self.wrongly_lit, self.wrongly_dark
        )
    }
}

/// What the scene's technique lets arrive.
///
/// # Errors
/// See [`FrameError`].
pub fn by_technique(scene: &Scene, mesh: &Mesh) -> Result<Arriving> {
    by_technique_on(&mut NativeDevice::new(), &NoShaders, scene, mesh)
}

/// The same on a device.
///
/// # Errors
/// See [`FrameError`].
pub fn by_technique_on(
    device: &mut dyn Device,
    shaders: &dyn Shaders,
    scene: &Scene,
    mesh: &Mesh,
) -> Result<Arriving> {
    shown(device, shaders, scene, mesh, Show::Light)
}

/// What the scene's medium scatters towards the camera, by the scene's technique: see [`Show::Scattered`].
///
/// # Errors
/// See [`FrameError`].
pub fn scattered_by_technique(scene: &Scene, mesh: &Mesh) -> Result<Arriving> {
    scattered_by_technique_on(&mut NativeDevice::new(), &NoShaders, scene, mesh)
}

/// The same on a device.
///
/// # Errors
/// See [`FrameError`].
pub fn scattered_by_technique_on(
    device: &mut dyn Device,
    shaders: &dyn Shaders,
    scene: &Scene,
    mesh: &Mesh,
) -> Result<Arriving> {
    shown(device, shaders, scene, mesh, Show::Scattered)
}

fn shown(
    device: &mut dyn Device,
    shaders: &dyn Shaders,
    scene: &Scene,
    mesh: &Mesh,
    show: Show,
) -> Result<Arriving> {
    let mut frame = Frame::still(device, shaders, scene, mesh, show)?;
    frame.run(Clock::Frame, &mut Quiet)?;
    Ok(Arriving {
        width: scene.width,
        height: scene.height,
        values: frame.linear()?.iter().map(|c| c.x).collect(),
    })
}

/// A technique's errors on a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Against [`by_rays`]: what an observer would say.
    pub rays: Errors,
    /// Against [`filtered`], with the depth bias that compared depths need: what the reconstruction adds. Only for lights
    /// that are points.
    pub filtered: Option<Errors>,
    /// Of what the medium scatters, against rays. Only of a scene with a medium.
    pub scattered: Option<scattering::Compared>,
}

/// Measures the scene's technique.
///
/// # Errors
/// See [`FrameError`].
pub fn measure(scene: &Scene, mesh: &Mesh, progress: &mut dyn Progress) -> Result<Measured> {
    let steps = if scene.medium.is_some() { 5 } else { 3 };
    progress.begin("light by the technique", 1, steps);
    let picture = by_technique(scene, mesh)?;
    let is_point = scene.lights.iter().all(|light| light.area.radius == 0.0);
    progress.begin("light by all samples", 2, steps);
    let soft = is_point.then(|| {
        let compared = as_compared(scene);
        filtered(&compared, mesh, &mut |share| progress.advance(share))
    });
    progress.begin("light by rays", 3, steps);
    let sharp = by_rays(scene, mesh, &mut |share| progress.advance(share));
    let mut scattered = None;
    if scene.medium.is_some() {
        progress.begin("scattered light by the technique", 4, steps);
        let picture = scattered_by_technique(scene, mesh)?;
        progress.begin("scattered light by rays", 5, steps);
        let mut advance = |share| progress.advance(share);
        scattered = scattering::compare(scene, mesh, &[&picture], &mut advance)?;
    }
    Ok(Measured {
        scattered: scattered.map(|(compared, _)| compared),
        rays: picture.errors(&sharp)?,
        filtered: soft.map(|soft| picture.errors(&soft)).transpose()?,
    })
}

/// The scene with a depth bias for [`filtered`]: techniques that compare no single depths need none, but without one the
/// reference has surfaces that shade themselves.
fn as_compared(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    if scene.shadow.depth_bias == DepthBias::NONE {
        scene.shadow.depth_bias = DepthBias::COMPARED;
    }
    scene
}

/// Rays through a pixel, along x and along y.
const GRID: u32 = 16;

/// How far from a surface a ray towards the light begins, in lengths of the scene's diagonal: what
/// single-precision corners leave uncertain, many times over.
const AWAY: f64 = 1e-5;

/// What rays say of single pixels.
pub struct Pixels {
    caster: Caster,
    translucent: Option<Layers>,
    lens: Lens,
    /// Length of the scene's diagonal.
    diagonal: f64,
    lamps: Vec<Lamp>,
}

/// A light that rays go to.
struct Lamp {
    light: Light,
    /// From its middle to that of its edge, along x and y of the shadow map: of a directional light as seen from one
    /// unit before it; nothing for a point.
    axes: [DVec3; 2],
    /// Of each vertex, see [`facing`].
    facing: Vec<Vec3>,
}

/// 1 where a surface is turned to the light, 0 where it is turned away: the cosine that shading makes of a normal of
/// [`facing`], interpolated, and of the way to the light.
fn turned_to(facing: DVec3, toward: DVec3) -> f64 {
    let cosine = facing.normalize_or_zero().dot(toward.normalize_or_zero());
    cosine.max(0.0)
}

impl Lamp {
    fn of(scene: &Scene, light: &Light, mesh: &Mesh) -> Self {
        let clip = light_view(scene, light, mesh).clip_from_world;
        let radius = f64::from(light.area.radius);
        // Across the light's way: rows of a perspective view have a part along it.
        let along = light.direction().as_dvec3();
        let axis = |i| {
            let row = clip.row(i).truncate().as_dvec3();
            row.reject_from_normalized(along).normalize_or_zero()
        };
        Self {
            light: *light,
            axes: [0, 1].map(|i| axis(i) * radius),
            facing: facing(light, mesh),
        }
    }

    /// What the cone of a spot light leaves of its light at a place.
    fn within(&self, place: DVec3) -> f64 {
        self.light.spot().map_or(1.0, |spot| spot.within(place))
    }

    /// The way from a place to the light, all of it to a spot light. Ray `i` of a pixel goes to another point of an
    /// area.
    fn toward(&self, place: DVec3, pixel: [u32; 2], i: u32) -> DVec3 {
        let middle = self.light.toward(place);
        if self.light.area.radius == 0.0 {
            return middle;
        }
        let [x, y] = self.light.area.point(light_sample(pixel, i));
        middle + self.axes[0] * x + self.axes[1] * y
    }
}

/// Translucent surfaces.
struct Layers {
    caster: Caster,
    /// Of each vertex.
    opacities: Vec<f32>,
}

impl Layers {
    fn of(mesh: &Mesh) -> Option<Self> {
        Some(Self {
            caster: Caster::of_translucent(mesh)?,
            opacities: mesh.all_opacities(),
        })
    }

    /// Depth and opacity of all surfaces at each of these places in every texel of a map.
    fn of_samples(
        &self,
        lens: &Lens,
        clip: &[Vec4],
        size: u32,
        places: &[[f64; 2]],
    ) -> Vec<Vec<[f32; 2]>> {
        let row_len = size as usize * places.len();
        let mut all = vec![Vec::new(); row_len * size as usize];
        in_bands(
            &mut all,
            row_len,
            &mut |_| (),
            |y, row: &mut [Vec<[f32; 2]>]| {
                for (i, sample) in row.iter_mut().enumerate() {
                    let texel = [(i / places.len()) as u32, y as u32];
                    let segment = lens.segment(texel, places[i % places.len()]);
                    let surface = |hit| {
                        let opacity = self.caster.at(&segment, hit, &self.opacities);
                        [self.caster.depth(&segment, hit, clip), opacity]
                    };
                    *sample = self.caster.all(&segment).into_iter().map(surface).collect();
                }
            },
        );
        all
    }
}

impl Pixels {
    /// For a scene's camera and light.
    #[must_use]
    pub fn of(scene: &Scene, mesh: &Mesh) -> Self {
        let view = camera_view(scene, &scene.camera, mesh);
        let (numbers, _) = reaching(scene, mesh);
        let lamp = |number: usize| Lamp::of(scene, &scene.lights[number], mesh);
        Self {
            caster: Caster::of(mesh),
            translucent: Layers::of(mesh),
            lens: Lens::new(view.clip_from_world, scene.width, scene.height),
            diagonal: mesh.bounds().map_or(1.0, |b| f64::from(b.size().length())),
            lamps: numbers.into_iter().map(lamp).collect(),
        }
    }

    /// The share of 256 rays through a pixel that meet nothing, or a place from which a ray reaches
    /// the light, each with the share of light that passes translucent surfaces on its way. If the light has an area, each goes on towards another point of it, so that the
    /// pixel's value is the visible share of the light, and the pixel's own average, at once. The
    /// points are a Hammersley set, moved in each pixel by another amount.
    #[must_use]
    pub fn light(&self, pixel: [u32; 2]) -> f32 {
        let arriving = |i: u32| {
            let at = [i % GRID, i / GRID].map(|k| (f64::from(k) + 0.5) / f64::from(GRID));
            let segment = self.lens.segment(pixel, at);
            let hit = self.caster.first(&segment);
            hit.map_or(1.0, |hit| self.arriving(&segment, hit, pixel, i))
        };
        let sum: f64 = (0..GRID * GRID).map(arriving).sum();
        (sum / f64::from(GRID * GRID)) as f32
    }

    /// The share of the light that arrives at what a segment meets, the mean of all lights: [`Pixels::reaching`]
    /// where that is turned to the light.
    fn arriving(&self, segment: &Segment, hit: Hit, pixel: [u32; 2], i: u32) -> f64 {
        let place = segment.at(hit.t);
        self.mean(|lamp| {
            let facing = self.caster.vector_at(segment, hit, &lamp.facing);
            let turned = turned_to(facing, lamp.light.toward(place));
            if turned == 0.0 {
                return 0.0;
            }
            turned * self.reaching_of(lamp, place, pixel, i)
        })
    }

    /// The share of the light that reaches a place of a segment, the mean of all lights: none through an opaque
    /// caster, some through a translucent one. Ray `i` of a pixel goes to another point of an area.
    fn reaching(&self, segment: &Segment, t: f64, pixel: [u32; 2], i: u32) -> f64 {
        let place = segment.at(t);
        self.mean(|lamp| self.reaching_of(lamp, place, pixel, i))
    }

    /// The mean of all lights.
    fn mean(&self, of: impl Fn(&Lamp) -> f64) -> f64 {
        self.lamps.iter().map(of).sum::<f64>() / self.lamps.len().max(1) as f64
    }

    /// [`Pixels::reaching`] of one light.
    fn reaching_of(&self, lamp: &Lamp, place: DVec3, pixel: [u32; 2], i: u32) -> f64 {
        let within = lamp.within(place);
        if within == 0.0 {
            return 0.0;
        }
        let toward = lamp.toward(place, pixel, i);
        let away = self.diagonal * AWAY;
        let (from, way) = match lamp.light.source {
            Source::Directional { .. } => (place + toward * away, toward * (2.0 * self.diagonal)),
            Source::Spot(_) => {
                let before = toward.normalize_or_zero() * away;
                (place + before, toward - before)
            }
        };
        within * self.passing(&Segment::new(from, way))
    }

    /// The share of light that passes what a segment meets.
    fn passing(&self, to_light: &Segment) -> f64 {
        if self.caster.first(to_light).is_some() {
            return 0.0;
        }
        let translucent = self.translucent.as_ref();
        translucent.map_or(1.0, |t| {
            f64::from(t.caster.transmittance(to_light, &t.opacities))
        })
    }
}

/// A point of the unit square for ray `i` of a pixel. Rays that are neighbours in the pixel have
/// points far from each other.
fn light_sample([x, y]: [u32; 2], i: u32) -> [f64; 2] {
    const RAYS: u32 = GRID * GRID;
    // Any odd factor permutes the numbers below a power of two.
    let j = (i * 167 + 91) % RAYS;
    let reversed = j.reverse_bits() >> (32 - RAYS.trailing_zeros());
    let mut hash = (y << 16 | x).wrapping_mul(0x9e37_79b9);
    let mut shift = || {
        hash = (hash ^ hash >> 15).wrapping_mul(0x2c1b_3c6d);
        hash ^= hash >> 12;
        f64::from(hash) / f64::from(u32::MAX)
    };
    [j, reversed].map(|k| ((f64::from(k) + 0.5) / f64::from(RAYS) + shift()).fract())
}

/// [`Pixels::light`] of all pixels.
#[must_use]
pub fn by_rays(scene: &Scene, mesh: &Mesh, advance: &mut dyn FnMut(f32)) -> Arriving {
    let pixels = Pixels::of(scene, mesh);
    let (width, height) = (scene.width, scene.height);
    let mut values = vec![0.0; width as usize * height as usize];
    in_bands(
        &mut values,
        width as usize,
        advance,
        |y, row: &mut [f32]| {
            for (x, value) in row.iter_mut().enumerate() {
                *value = pixels.light([x as u32, y as u32]);
            }
        },
    );
    Arriving {
        width,
        height,
        values,
    }
}

/// Depth samples of the light's map, and a filter over them.
struct Filter {
    size: i64,
    /// Samples of a texel.
    samples: usize,
    depths: Vec<f32>,
    /// Depth and opacity of the translucent surfaces in each sample; empty without any.
    translucent: Vec<Vec<[f32; 2]>>,
    /// Of the taps from one side to the other; their sum is 1.
    weights: Vec<f64>,
}

impl Filter {
    /// What a light's map holds, and the scene's filter.
    fn of(
        scene: &Scene,
        mesh: &Mesh,
        caster: &Caster,
        view: &LightView,
        advance: &mut dyn FnMut(f32),
    ) -> Self {
        let size = scene.shadow.size;
        let from_light = transform(view.clip_from_world);
        let vertices = mesh.positions.iter();
        let clip: Vec<Vec4> = vertices.map(|p| from_light.apply(*p)).collect();
        let lens = Lens::new(view.clip_from_world, size, size);
        let half = gaussian(scene.shadow.filter);
        let weights = half[1..].iter().rev().chain(&half).map(|w| f64::from(*w));
        let weights: Vec<f64> = weights.collect();
        let sum: f64 = weights.iter().sum();
        let places = places(scene.shadow.multisampling);
        Self {
            size: i64::from(size),
            samples: places.len(),
            translucent: Layers::of(mesh)
                .map_or_else(Vec::new, |t| t.of_samples(&lens, &clip, size, places)),
            depths: caster.depths(&lens, &clip, [size; 2], places, advance),
            weights: weights.iter().map(|w| w / sum).collect(),
        }
    }

    /// The share of light that does not get past a depth in a sample.
    fn shadow(&self, sample: usize, z: f32) -> f64 {
        if self.depths[sample] < z {
            return 1.0;
        }
        let surfaces = self.translucent.get(sample).into_iter().flatten();
        let nearer = surfaces.filter(|[depth, _]| *depth < z);
        1.0 - nearer
            .map(|[_, opacity]| 1.0 - f64::from(*opacity))
            .product::<f64>()
    }

    /// The share of light that does not get past `z`, of the filter's depths around a texel.
    fn around(&self, x: i64, y: i64, z: f32) -> f64 {
        let radius = self.weights.len() as i64 / 2;
        let within = |i: i64| i.clamp(0, self.size - 1);
        let mut sum = 0.0;
        for (dy, wy) in (-radius..).zip(&self.weights) {
            for (dx, wx) in (-radius..).zip(&self.weights) {
                let texel = within(y + dy) * self.size + within(x + dx);
                let first = texel as usize * self.samples;
                let samples = first..first + self.samples;
                let shadows = samples.map(|sample| self.shadow(sample, z)).sum::<f64>();
                sum += wy * wx * shadows;
            }
        }
        sum / self.samples as f64
    }

    /// The same between the four nearest texels, as a sampler interpolates.
    fn at(&self, u: f32, v: f32, z: f32) -> f64 {
        let place = |t: f32| f64::from(t) * self.size as f64 - 0.5;
        let (x, y) = (place(u), place(v));
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let (x, y) = (x.floor() as i64, y.floor() as i64);
        let mut sum = 0.0;
        for (dy, wy) in [(0, 1.0 - fy), (1, fy)] {
            for (dx, wx) in [(0, 1.0 - fx), (1, fx)] {
                // What the sampler repeats at the edge, the filter has to repeat as well.
                let (x, y) = (x + dx, y + dy);
                let last = self.size - 1;
                sum += wx * wy * self.around(x.clamp(0, last), y.clamp(0, last), z);
            }
        }
        sum
    }
}

/// What percentage-closer filtering lets arrive that has the weights of the scene's filter and of
/// bilinear lookup, and compares all depth samples, each with the list of all translucent surfaces in it; nothing
/// at a surface that is turned from the light. `leak_cut` is not part of it.
#[must_use]
pub fn filtered(scene: &Scene, mesh: &Mesh, advance: &mut dyn FnMut(f32)) -> Arriving {
    let caster = Caster::of(mesh);
    let camera = camera_view(scene, &scene.camera, mesh);
    let lens = Lens::new(camera.clip_from_world, scene.width, scene.height);
    let pixels = [scene.width, scene.height];
    let fragments = Fragments::find(&caster, &lens, pixels, places(SAMPLES), &mut |s| {
        advance(s * 0.3);
    });
    let interpolated = |vertices: &[Vec3]| {
        let varying = Varying {
            components: 3,
            vertices: bytemuck::cast_slice(vertices).to_vec(),
        };
        let of = fragments.interpolate(&caster, &lens, &[varying]);
        bytemuck::cast_slice::<f32, Vec3>(&of[0]).to_vec()
    };
    let world = interpolated(&mesh.positions);
    let mut arriving = vec![0.0; world.len()];
    let (numbers, _) = reaching(scene, mesh);
    let count = numbers.len();
    for (i, number) in numbers.into_iter().enumerate() {
        let light = &scene.lights[number];
        let mut advance =
            |share: f32| advance(0.3 + 0.7 * (i as f32 + share) / count.max(1) as f32);
        let view = light_view(scene, light, mesh);
        let filter = Filter::of(scene, mesh, &caster, &view, &mut |s| advance(s * 0.6));
        let lit = Lit {
            light,
            view: &view,
            is_first: i == 0,
            count,
        };
        let uniform = uniform(scene, &lit, Show::Light);
        let lamp = Lamp::of(scene, light, mesh);
        let facing = interpolated(&lamp.facing);
        let mut rest = |share: f32| advance(0.6 + share * 0.4);
        in_bands(
            &mut arriving,
            1 << 10,
            &mut rest,
            |band, part: &mut [f64]| {
                let places = world[band << 10..].iter().zip(&facing[band << 10..]);
                for (value, (p, facing)) in part.iter_mut().zip(places) {
                    let place = p.as_dvec3();
                    let turned = turned_to(facing.as_dvec3(), light.toward(place));
                    let within = turned * lamp.within(place);
                    if within > 0.0 {
                        let row = |row: Vec4| row_times_point(row, *p);
                        let w = row(uniform.row_w);
                        let z = row(uniform.row_depth) / w - uniform.depth_bias / (w * w);
                        let shadow = filter.at(row(uniform.row_u) / w, row(uniform.row_v) / w, z);
                        *value += within * (1.0 - shadow) / count as f64;
                    }
                }
            },
        );
    }
    let pixel = |samples: [Option<usize>; SAMPLES as usize]| {
        let sum: f64 = samples.iter().map(|s| s.map_or(1.0, |i| arriving[i])).sum();
        (sum / f64::from(SAMPLES)) as f32
    };
    Arriving {
        width: scene.width,
        height: scene.height,
        values: fragments.samples().map(pixel).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Area;

    fn row(values: &[f32]) -> Arriving {
        Arriving {
            width: values.len() as u32,
            height: 1,
            values: values.to_vec(),
        }
    }

    #[test]
    fn errors_tell_light_from_dark() {
        let truth = row(&[0.0, 1.0, 0.5, 0.5]);
        let errors = row(&[0.5, 1.0, 0.25, 0.5]).errors(&truth).unwrap();
        assert!((errors.rms - (0.3125_f64 / 4.0).sqrt()).abs() < 1e-12);
        assert_eq!((errors.percentile_99, errors.worst), (0.5, 0.5));
        assert_eq!((errors.wrongly_lit, errors.wrongly_dark), (0.125, 0.0625));
        assert!(row(&[0.0]).errors(&truth).is_err());
        // The 99th of 100 is not the last.
        let mut one_off = vec![0.0; 100];
        one_off[7] = 1.0;
        let errors = row(&one_off).errors(&row(&[0.0; 100])).unwrap();
        assert_eq!((errors.percentile_99, errors.worst), (0.0, 1.0));
    }

    /// The share of a light on one side of a line through it, from each pixel.
    #[test]
    fn rays_reach_all_of_the_light_alike() {
        use crate::scene::AreaShape;
        for shape in [AreaShape::Disc, AreaShape::Square] {
            let area = Area { radius: 1.0, shape };
            for (edge, turn) in [(-0.7_f64, 0.0_f64), (0.0, 0.3), (0.45, 0.8), (0.9, 2.1)] {
                let beyond = match shape {
                    AreaShape::Disc => {
                        (edge.acos() - edge * (1.0 - edge * edge).sqrt()) / std::f64::consts::PI
                    }
                    AreaShape::Square if turn == 0.0 => (1.0 - edge) / 2.0,
                    AreaShape::Square => continue,
                };
                for pixel in [[0, 0], [1, 0], [17, 940]] {
                    let points = (0..GRID * GRID).map(|i| area.point(light_sample(pixel, i)));
                    let count = points
                        .filter(|[x, y]| x * turn.cos() + y * turn.sin() > edge)
                        .count();
                    let share = count as f64 / f64::from(GRID * GRID);
                    assert!(
                        (share - beyond).abs() < 0.02,
                        "{shape:?} {edge}: {share} {beyond}"
                    );
                }
            }
        }
    }

    #[test]
    fn pictures_of_errors_tell_light_from_dark() {
        let (light, truth) = (row(&[1.0, 0.0, 0.5]), row(&[0.0, 1.0, 0.5]));
        assert_eq!(
            light.off(&truth).unwrap().pixels,
            [TOO_LIGHT, TOO_DARK, RIGHT]
        );
        assert_eq!(light.picture().pixels, [[255; 3], [0; 3], [128; 3]]);
        assert!(light.off(&row(&[0.0])).is_err());
    }

    #[test]
    fn a_filter_weighs_depths_as_it_should() {
        // Two texels, the left one near with all samples, the right one far with all but one.
        let mut depths = vec![0.2_f32; 4];
        depths.extend([0.8, 0.8, 0.8, 0.2]);
        depths.extend([0.9; 8]);
        let mut filter = Filter {
            size: 2,
            samples: SAMPLES as usize,
            depths,
            translucent: Vec::new(),
            weights: vec![1.0],
        };
        assert_eq!(filter.around(0, 0, 0.5), 1.0);
        assert_eq!(filter.around(1, 0, 0.5), 0.25);
        assert_eq!(filter.around(9, -3, 0.5), 0.25);
        // Half way between the two, and half way down.
        assert_eq!(filter.at(0.5, 0.25, 0.5), 0.625);
        assert_eq!(filter.at(0.5, 0.5, 0.5), 0.3125);
        // Two surfaces in one sample, of which one is farther than the receiver; none in the others.
        filter.translucent = vec![Vec::new(); 16];
        filter.translucent[4] = vec![[0.3, 0.5], [0.4, 0.5], [0.6, 0.5]];
        assert_eq!(filter.around(1, 0, 0.5), 0.25 + 0.75 / 4.0);
    }
}
