//! What a medium scatters towards the camera, by rays: from places along each pixel's rays to the light.

use hankel_dsl::glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::{Arriving, Errors, Pixels};
use crate::error::Result;
use crate::scene::{Mesh, Scene};
use crate::visibility::cast::{Hit, SAMPLES, Segment, in_bands};

/// Rays through a pixel, along x and along y.
const GRID: u32 = 4;
/// Steps along a ray at first.
const FIRST: u32 = 16;
/// Steps beyond which nothing is gained.
const MOST: u32 = 1 << 14;
/// The steps are enough if their doubling changes this share of the least error that is reported.
const SHARE: f64 = 0.1;

/// A ray from the camera to what it meets.
struct Ray {
    segment: Segment,
    /// Its length.
    length: f64,
    /// What the medium takes of its light, from 0 to 1.
    taken: f64,
    /// Where in its part the place of each step lies, from 0 to 1.
    offset: f64,
    /// Places that are lit; those behind translucent casters count as what reaches them.
    lit: f64,
    /// Its pixel, and by which number it goes on to the light: of an area, the rays of a pixel have different
    /// points.
    pixel: [u32; 2],
    number: u32,
}

/// The scattered light of all pixels: the share of light that is scattered towards the camera and reaches it, but
/// for the phase function and what is absorbed. The integral ∫ V(s) σ exp(-σ s) ds along a ray of length d, with the
/// visibility V by a ray to the light, is taken over equal parts of 1 - exp(-σ s), a place in each; 16 rays of a pixel
/// have these places moved by different amounts.
pub struct Scattered {
    pixels: Pixels,
    width: u32,
    height: u32,
    extinction: f64,
    steps: u32,
    rays: Vec<Ray>,
}

impl Scattered {
    /// With a few steps at first. `None` for a scene without a medium.
    #[must_use]
    pub fn new(scene: &Scene, mesh: &Mesh) -> Option<Self> {
        let extinction = f64::from(scene.medium.as_ref()?.extinction);
        let pixels = Pixels::of(scene, mesh);
        let eye = scene.camera.eye.as_dvec3();
        let count = GRID * GRID;
        let ray = |i: u32| {
            let (pixel, number) = (i / count, i % count);
            let at = [pixel % scene.width, pixel / scene.width];
            let inside = [number % GRID, number / GRID];
            let inside = inside.map(|k| (f64::from(k) + 0.5) / f64::from(GRID));
            let seen = pixels.lens.segment(at, inside);
            // Rays that meet nothing end at the far plane.
            let end = pixels.caster.first(&seen).map_or(1.0, |hit| hit.t);
            let way = seen.at(end) - eye;
            let length = way.length();
            Ray {
                segment: Segment::new(eye, way),
                length,
                taken: -f64::exp_m1(-extinction * length),
                offset: offset(pixel, number),
                lit: 0.0,
                pixel: at,
                number: number * GRID * GRID,
            }
        };
        let rays: Vec<Ray> = (0..scene.width * scene.height * count)
            .into_par_iter()
            .map(ray)
            .collect();
        let mut this = Self {
            pixels,
            width: scene.width,
            height: scene.height,
            extinction,
            steps: FIRST,
            rays,
        };
        this.look(FIRST, |_| None, &mut |_| ());
        Some(this)
    }

    /// Steps along each ray.
    #[must_use]
    pub const fn steps(&self) -> u32 {
        self.steps
    }

    /// Looks from places along each ray, one in each of `steps` parts: all parts, or of a ray with this number those
    /// that are even (0) or odd (1).
    fn look(
        &mut self,
        steps: u32,
        parts: impl Fn(usize) -> Option<u32> + Sync,
        advance: &mut dyn FnMut(f32),
    ) {
        const BAND: usize = 1 << 10;
        let (pixels, extinction) = (&self.pixels, self.extinction);
        in_bands(&mut self.rays, BAND, advance, |band, rays: &mut [Ray]| {
            for (i, ray) in rays.iter_mut().enumerate() {
                let parts = parts(band * BAND + i);
                let light = |k: u32| {
                    let share = (f64::from(k) + ray.offset) / f64::from(steps);
                    let s = -f64::ln_1p(-share * ray.taken) / extinction;
                    let t = (s / ray.length).min(1.0);
                    pixels.reaching(&ray.segment, t, ray.pixel, ray.number)
                };
                let wanted = (0..steps).filter(|k| parts.is_none_or(|parity| k % 2 == parity));
                ray.lit += wanted.map(light).sum::<f64>();
            }
        });
    }

    /// The picture.
    #[must_use]
    pub fn picture(&self) -> Arriving {
        self.of(|ray| ray.taken * ray.lit / f64::from(self.steps))
    }

    /// The picture if nothing cast shadows: what a technique that sees no shadow gives.
    #[must_use]
    pub fn unshadowed(&self) -> Arriving {
        self.of(|ray| ray.taken)
    }

    fn of(&self, of: impl Fn(&Ray) -> f64) -> Arriving {
        let pixel = |rays: &[Ray]| {
            let sum: f64 = rays.iter().map(&of).sum();
            (sum / rays.len().max(1) as f64) as f32
        };
        let rays = self.rays.chunks((GRID * GRID) as usize);
        Arriving {
            width: self.width,
            height: self.height,
            values: rays.map(pixel).collect(),
        }
    }

    /// Doubles the steps; tells by how much the picture has changed, as the root of the mean square. Each place
    /// that there was is one of the new ones.
    ///
    /// # Errors
    /// None in practice: both pictures have one size.
    pub fn refine(&mut self, advance: &mut dyn FnMut(f32)) -> Result<f64> {
        let before = self.picture();
        // The place of part k lies in part 2 k of the new ones, or in 2 k + 1; the other one gets one.
        let has_first = |ray: &Ray| ray.offset < 0.5;
        let first: Vec<bool> = self.rays.iter().map(has_first).collect();
        for ray in &mut self.rays {
            ray.offset = (2.0 * ray.offset).fract();
        }
        self.steps *= 2;
        self.look(self.steps, |i| Some(u32::from(first[i])), advance);
        Ok(self.picture().errors(&before)?.rms)
    }
}

/// A number from 0 to 1 for a pixel's ray, in 24 bits: those of a pixel are spread evenly, and moved from pixel to
/// pixel.
fn offset(pixel: u32, number: u32) -> f64 {
    let mut hash = pixel.wrapping_mul(0x9e37_79b9);
    hash = (hash ^ hash >> 15).wrapping_mul(0x2c1b_3c6d);
    hash ^= hash >> 12;
    let part = f64::from(number.wrapping_mul(7) % (GRID * GRID)) / f64::from(GRID * GRID);
    let moved = part + f64::from(hash) / f64::from(u32::MAX);
    (moved.fract() * f64::from(1 << 24)).floor() / f64::from(1 << 24)
}

/// Of each pixel, the share of light that passes the medium before what it sees: the mean of its samples. 1 in a
/// scene without a medium.
#[must_use]
pub fn transmittance(scene: &Scene, mesh: &Mesh) -> Arriving {
    let pixels = Pixels::of(scene, mesh);
    let extinction = scene.medium.map_or(0.0, |m| f64::from(m.extinction));
    let eye = scene.camera.eye.as_dvec3();
    let of = |i: u32| {
        let at = [i % scene.width, i / scene.width];
        let passing = SAMPLES.map(|inside| pixels.ray(eye, at, inside).passing(extinction));
        (passing.iter().sum::<f64>() / SAMPLES.len() as f64) as f32
    };
    let all = (0..scene.width * scene.height).into_par_iter();
    Arriving {
        width: scene.width,
        height: scene.height,
        values: all.map(of).collect(),
    }
}

/// Light as it is seen through a medium that passes `through` of it and scatters `scattered`, each pixel for itself.
/// It is from 0 to 1, as these three are, and as what passes and what is scattered are at most 1 together.
#[must_use]
pub fn behind(light: &Arriving, through: &Arriving, scattered: &Arriving) -> Arriving {
    let all = light.values.iter().zip(&through.values);
    let all = all.zip(&scattered.values);
    Arriving {
        values: all.map(|((v, t), s)| v * t + s).collect(),
        ..*light
    }
}

/// What a ray from the camera meets, at a distance; the far plane where that is nothing.
struct Met {
    segment: Segment,
    length: f64,
    surface: Option<Hit>,
}

impl Met {
    /// The share of light that comes through.
    fn passing(&self, extinction: f64) -> f64 {
        (-extinction * self.length).exp()
    }
}

impl Pixels {
    /// The ray through a place in a pixel, (0, 0) its upper left corner and (1, 1) its lower right one.
    fn ray(&self, eye: DVec3, pixel: [u32; 2], inside: [f64; 2]) -> Met {
        let seen = self.lens.segment(pixel, inside);
        let hit = self.caster.first(&seen);
        let way = seen.at(hit.map_or(1.0, |hit| hit.t)) - eye;
        Met {
            segment: Segment::new(eye, way),
            length: way.length(),
            surface: hit.map(|hit| Hit { t: 1.0, ..hit }),
        }
    }
}

/// The light of single pixels as it is seen through a medium, with what that scatters: by 256 rays to the surfaces
/// and on to the light, and by 16 rays and steps along them. Phase function and what is absorbed are left out, so
/// that it is from 0 to 1, see [`behind`].
pub struct Through {
    pixels: Pixels,
    eye: DVec3,
    width: u32,
    count: u32,
    extinction: f64,
    steps: u32,
}

/// Pixels by which the steps are chosen.
const PROBED: u32 = 512;

impl Through {
    /// With as many steps that twice as many change some of the pixels by less than `change`, as the root of the
    /// mean square. `None` for a scene without a medium.
    #[must_use]
    pub fn new(scene: &Scene, mesh: &Mesh, change: f64) -> Option<Self> {
        let mut this = Self {
            extinction: f64::from(scene.medium.as_ref()?.extinction),
            pixels: Pixels::of(scene, mesh),
            eye: scene.camera.eye.as_dvec3(),
            width: scene.width,
            count: scene.width * scene.height,
            steps: FIRST,
        };
        let probed = this.count.min(PROBED);
        let look = |this: &Self| -> Vec<f64> {
            let pixels = (0..probed).into_par_iter();
            // Spread over the picture.
            let number = |i: u32| (u64::from(i) * u64::from(this.count) / u64::from(probed)) as u32;
            pixels.map(|i| this.scattered(number(i))).collect()
        };
        let mut before = look(&this);
        while this.steps < MOST {
            this.steps *= 2;
            let now = look(&this);
            let pairs = before.iter().zip(&now);
            let squares: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
            if (squares / f64::from(probed.max(1))).sqrt() < change {
                break;
            }
            before = now;
        }
        Some(this)
    }

    /// Steps along each ray.
    #[must_use]
    pub const fn steps(&self) -> u32 {
        self.steps
    }

    /// What a pixel sees; pixels are counted from the upper left one, row by row.
    #[must_use]
    pub fn pixel(&self, number: u32) -> f32 {
        (self.surfaces(number) + self.scattered(number)) as f32
    }

    /// What of that comes from surfaces.
    #[must_use]
    pub fn surfaces(&self, number: u32) -> f64 {
        const RAYS: u32 = super::GRID * super::GRID;
        let at = [number % self.width, number / self.width];
        let ray = |i: u32| {
            let inside = [i % super::GRID, i / super::GRID];
            let inside = inside.map(|k| (f64::from(k) + 0.5) / f64::from(super::GRID));
            let met = self.pixels.ray(self.eye, at, inside);
            let arriving = |hit| self.pixels.arriving(&met.segment, hit, at, i);
            met.surface.map_or(1.0, arriving) * met.passing(self.extinction)
        };
        (0..RAYS).map(ray).sum::<f64>() / f64::from(RAYS)
    }

    /// What of that the medium scatters.
    #[must_use]
    pub fn scattered(&self, number: u32) -> f64 {
        let at = [number % self.width, number / self.width];
        let ray = |i: u32| {
            let inside = [i % GRID, i / GRID].map(|k| (f64::from(k) + 0.5) / f64::from(GRID));
            let met = self.pixels.ray(self.eye, at, inside);
            let taken = -f64::exp_m1(-self.extinction * met.length);
            let offset = offset(number, i);
            let lit = |k: u32| {
                let share = (f64::from(k) + offset) / f64::from(self.steps);
                let s = -f64::ln_1p(-share * taken) / self.extinction;
                let t = (s / met.length).min(1.0);
                self.pixels.reaching(&met.segment, t, at, i * GRID * GRID)
            };
            taken * (0..self.steps).map(lit).sum::<f64>() / f64::from(self.steps)
        };
        (0..GRID * GRID).map(ray).sum::<f64>() / f64::from(GRID * GRID)
    }
}

/// How far pictures of scattered light are from the truth, and how sure that is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    /// Of each picture.
    pub errors: Vec<Errors>,
    /// Steps along each ray of the truth.
    pub steps: u32,
    /// By how much the last doubling of the steps has changed the truth: the root of the mean square.
    pub change: f64,
}

/// Compares pictures of what the scene's medium scatters with the truth, whose steps are doubled until a doubling
/// changes it by less than a tenth of the least error. `None` for a scene without a medium.
///
/// # Errors
/// [`crate::FrameError::Sizes`] for pictures of another size than the scene's.
pub fn compare(
    scene: &Scene,
    mesh: &Mesh,
    pictures: &[&Arriving],
    advance: &mut dyn FnMut(f32),
) -> Result<Option<(Compared, Arriving)>> {
    let Some(mut truth) = Scattered::new(scene, mesh) else {
        return Ok(None);
    };
    loop {
        let change = truth.refine(advance)?;
        let picture = truth.picture();
        let errors = pictures
            .iter()
            .map(|p| p.errors(&picture))
            .collect::<Result<Vec<_>>>()?;
        let least = errors.iter().map(|e| e.rms).fold(f64::INFINITY, f64::min);
        if change <= SHARE * least || truth.steps >= MOST {
            let steps = truth.steps;
            let compared = Compared {
                errors,
                steps,
                change,
            };
            return Ok(Some((compared, picture)));
        }
    }
}
