//! The native rasteriser: which triangle each sample of a pixel sees, and what the fragment stage
//! is given for it.
//!
//! As with multisampling hardware, a pixel is shaded once for each triangle that it sees, at the
//! pixel's centre, be that inside of the triangle or not.

use super::cast::{Caster, Lens, SAMPLES, in_bands};
/// No triangle.
const NONE: u32 = u32::MAX;

/// A pixel: the fragment that each sample sees, `NONE` for the background.
#[derive(Clone, Copy)]
struct Pixel {
    triangles: [u32; SAMPLES.len()],
}

/// Values at the vertices, interpolated for the fragments.
pub struct Varying {
    /// Floats of one value.
    pub components: usize,
    /// The values of all vertices.
    pub vertices: Vec<f32>,
}

/// The fragments of a picture.
pub struct Fragments {
    pixels: Vec<Pixel>,
    count: usize,
    width: usize,
}

/// The different triangles of a pixel in the order in which its samples see them.
fn distinct(pixel: &Pixel) -> impl Iterator<Item = u32> {
    let t = pixel.triangles;
    (0..t.len())
        .filter(move |&i| t[i] != NONE && !t[..i].contains(&t[i]))
        .map(move |i| t[i])
}

impl Fragments {
    /// Casts a ray through each sample. `advance` is told the share that is done.
    #[must_use]
    pub fn find(
        caster: &Caster,
        lens: &Lens,
        [width, height]: [u32; 2],
        advance: &mut dyn FnMut(f32),
    ) -> Self {
        let empty = Pixel {
            triangles: [NONE; SAMPLES.len()],
        };
        let width = width as usize;
        let mut pixels = vec![empty; width * height as usize];
        in_bands(&mut pixels, width, advance, |y, row| {
            for (x, pixel) in row.iter_mut().enumerate() {
                for (triangle, at) in pixel.triangles.iter_mut().zip(SAMPLES) {
                    let segment = lens.segment([x as u32, y as u32], at);
                    *triangle = caster.first(&segment).map_or(NONE, |hit| hit.triangle);
                }
            }
        });
        let count = pixels.iter().map(|p| distinct(p).count()).sum();
        Self {
            pixels,
            count,
            width,
        }
    }

    /// How many there are.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Share of the pixels whose samples do not all see the same.
    #[must_use]
    pub fn edges(&self) -> f64 {
        let mixed = |p: &&Pixel| p.triangles.iter().any(|&t| t != p.triangles[0]);
        self.pixels.iter().filter(mixed).count() as f64 / self.pixels.len().max(1) as f64
    }

    /// Values at the fragments, interpolated with perspective at their pixels' centres.
    #[must_use]
    pub fn interpolate(&self, caster: &Caster, lens: &Lens, varyings: &[Varying]) -> Vec<Vec<f32>> {
        let mut all: Vec<Vec<f32>> = varyings
            .iter()
            .map(|v| Vec::with_capacity(v.components * self.count()))
            .collect();
        for (i, pixel) in self.pixels.iter().enumerate() {
            let at = [(i % self.width) as u32, (i / self.width) as u32];
            let segment = lens.segment(at, [0.5, 0.5]);
            for triangle in distinct(pixel) {
                // Seen edge-on through the centre, any point of the triangle will do.
                let weights = segment
                    .weights(caster.corners(triangle))
                    .unwrap_or([1.0 / 3.0; 3]);
                let corners = caster.vertices(triangle).map(|v| v as usize);
                for (values, varying) in all.iter_mut().zip(varyings) {
                    values.extend((0..varying.components).map(|c| {
                        let at = |k: usize| {
                            f64::from(varying.vertices[corners[k] * varying.components + c])
                        };
                        (weights[0] * at(0) + weights[1] * at(1) + weights[2] * at(2)) as f32
                    }));
                }
            }
        }
        all
    }

    /// For each pixel the fragment of each sample, `None` for the background.
    pub fn samples(&self) -> impl Iterator<Item = [Option<usize>; SAMPLES.len()]> + '_ {
        let mut first = 0;
        self.pixels.iter().map(move |pixel| {
            let base = first;
            first += distinct(pixel).count();
            pixel
                .triangles
                .map(|t| distinct(pixel).position(|d| d == t).map(|i| base + i))
        })
    }
}
