//! The native rasteriser: which triangles each sample of a pixel sees, and what the fragment stage
//! is given for them.
//!
//! As with multisampling hardware, a pixel is shaded once for each triangle that it sees, at the
//! pixel's centre, be that inside of the triangle or not.

use std::ops::Range;

use hankel_dsl::glam::Vec4;

use super::cast::{Caster, Hit, Lens, SAMPLES, Segment, in_bands};

/// A triangle that some samples of a pixel see.
#[derive(Clone, Copy)]
struct Fragment {
    triangle: u32,
    /// Which samples, bit by bit.
    samples: u8,
}

/// Values at the vertices, interpolated for the fragments.
pub struct Varying {
    /// Floats of one value.
    pub components: usize,
    /// The values of all vertices.
    pub vertices: Vec<f32>,
}

/// The fragments of a picture, pixel after pixel, those of a pixel in the order in which they are drawn.
pub struct Fragments {
    all: Vec<Fragment>,
    /// Where each pixel's begin, and where the last one's end.
    starts: Vec<usize>,
    width: usize,
    /// Samples of a pixel.
    samples: usize,
}

impl Fragments {
    /// What each sample sees first; `samples` are where they lie in a pixel. `advance` is told the share that is done.
    #[must_use]
    pub fn find(
        caster: &Caster,
        lens: &Lens,
        size: [u32; 2],
        samples: &[[f64; 2]],
        advance: &mut dyn FnMut(f32),
    ) -> Self {
        Self::of(lens, size, samples, advance, |_, segment, see| {
            if let Some(hit) = caster.first(segment) {
                see(hit.triangle);
            }
        })
    }

    /// All that each sample sees, in the order of the triangles. `clip` is where the vertices go in clip space;
    /// what is not nearer than `depths`, one for each sample, is not seen.
    #[must_use]
    pub fn layers(
        caster: &Caster,
        lens: &Lens,
        size: [u32; 2],
        samples: &[[f64; 2]],
        clip: &[Vec4],
        depths: Option<&[f32]>,
        advance: &mut dyn FnMut(f32),
    ) -> Self {
        Self::of(lens, size, samples, advance, |sample, segment, see| {
            let is_nearer = |hit: &Hit| {
                depths.is_none_or(|depths| caster.depth(segment, *hit, clip) < depths[sample])
            };
            let seen = caster.all(segment).into_iter().filter(is_nearer);
            seen.for_each(|hit| see(hit.triangle));
        })
    }

    /// `look` tells which triangles a sample sees, by its number and segment.
    fn of(
        lens: &Lens,
        [width, height]: [u32; 2],
        samples: &[[f64; 2]],
        advance: &mut dyn FnMut(f32),
        look: impl Fn(usize, &Segment, &mut dyn FnMut(u32)) + Sync,
    ) -> Self {
        let width = width as usize;
        let mut pixels: Vec<Vec<Fragment>> = vec![Vec::new(); width * height as usize];
        in_bands(&mut pixels, width, advance, |y, row| {
            for (x, pixel) in row.iter_mut().enumerate() {
                for (i, at) in samples.iter().enumerate() {
                    let segment = lens.segment([x as u32, y as u32], *at);
                    let sample = (y * width + x) * samples.len() + i;
                    look(sample, &segment, &mut |triangle| {
                        let found = pixel.iter_mut().find(|f| f.triangle == triangle);
                        match found {
                            Some(fragment) => fragment.samples |= 1 << i,
                            None => pixel.push(Fragment {
                                triangle,
                                samples: 1 << i,
                            }),
                        }
                    });
                }
                pixel.sort_unstable_by_key(|f| f.triangle);
            }
        });
        let mut starts = vec![0];
        starts.extend(pixels.iter().scan(0, |end, pixel| {
            *end += pixel.len();
            Some(*end)
        }));
        Self {
            all: pixels.into_iter().flatten().collect(),
            starts,
            width,
            samples: samples.len(),
        }
    }

    /// How many there are.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.all.len()
    }

    /// Numbers of each pixel's fragments.
    fn pixels(&self) -> impl Iterator<Item = Range<usize>> {
        self.starts.windows(2).map(|w| w[0]..w[1])
    }

    /// Share of the pixels whose samples do not all see the same.
    #[must_use]
    pub fn edges(&self) -> f64 {
        let all = (1 << self.samples) - 1;
        let is_mixed = |p: &Range<usize>| self.all[p.clone()].iter().any(|f| f.samples != all);
        let count = self.starts.len() - 1;
        self.pixels().filter(is_mixed).count() as f64 / count.max(1) as f64
    }

    /// Values at the fragments, interpolated with perspective at their pixels' centres.
    #[must_use]
    pub fn interpolate(&self, caster: &Caster, lens: &Lens, varyings: &[Varying]) -> Vec<Vec<f32>> {
        let mut all: Vec<Vec<f32>> = varyings
            .iter()
            .map(|v| Vec::with_capacity(v.components * self.count()))
            .collect();
        for (i, pixel) in self.pixels().enumerate() {
            let at = [(i % self.width) as u32, (i / self.width) as u32];
            let segment = lens.segment(at, [0.5, 0.5]);
            for Fragment { triangle, .. } in &self.all[pixel] {
                let weights = caster.weights(&segment, *triangle);
                let corners = caster.vertices(*triangle).map(|v| v as usize);
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

    /// For each pixel the fragments in the order in which they are drawn, each by its number, with whether each
    /// sample sees it.
    pub fn drawn(
        &self,
    ) -> impl Iterator<Item = impl Iterator<Item = (usize, [bool; SAMPLES.len()])>> {
        self.pixels().map(|pixel| {
            pixel.map(|i| {
                let samples = self.all[i].samples;
                (i, std::array::from_fn(|s| samples >> s & 1 == 1))
            })
        })
    }

    /// For each pixel the fragment that each sample sees last, `None` for the background.
    pub fn samples(&self) -> impl Iterator<Item = [Option<usize>; SAMPLES.len()]> {
        self.drawn().map(|pixel| {
            pixel.fold([None; SAMPLES.len()], |last, (i, sees)| {
                std::array::from_fn(|s| if sees[s] { Some(i) } else { last[s] })
            })
        })
    }
}
