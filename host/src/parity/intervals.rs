//! What a sampler may do to each number of a result.
//!
//! A device rounds the weights between texels to some bits: 8 on desktop devices
//! (`subTexelPrecisionBits` in Vulkan), which Direct3D demands. Whichever way it rounds, a weight is
//! off by at most 1/256. This is as if the coordinate were off by 1/256 of a texel. So the kernel is
//! run natively with its coordinates moved by up to that along each axis, on a grid of five places
//! (three along each axis of a 3-D texture). A number may lie between the least and the greatest
//! result. What lies between the places of the grid may go beyond them by as much as the largest step
//! between two neighbours.
//!
//! The fraction of a level of detail has 8 bits in Direct3D 11 as well, so that the level is moved by
//! 1/256 up and down, where a texture has levels.
//!
//! A bilinear filter has four weights, products of those along both axes. NVIDIA's GPUs round these to 8 bits, too, such
//! that the weights along either axis stay (`host/tests/filter.rs` measures it): the product is off by up to 1/512, which
//! no place of a coordinate is like. For [such devices](Products::Rounded) the kernel is run with products moved up and
//! down as well, at nine of the places, and the levels of even and of odd number are moved one after the other: of two
//! neighbours, one may be rounded up and the other down.
//!
//! The filter's own sums round, too: an interpolation is off by at most one unit of 2^-24 of the largest texel, natively
//! and on the device. Texels of a plane take two interpolations, those of a volume three, and levels another one. So
//! each channel of each texture is moved up and down by 4 to 8 units; what the channels change is added up.
//!
//! Coordinates and levels of all that is read through one sampler are moved alike. What several samplers change is added
//! up.

use hankel_dsl::native::describe::{Channels, Kernel, Role, TextureKind};
use hankel_dsl::native::{Deviation, Levels};

use super::execute::Written;
use super::numbers::Numbers;
use crate::inputs::{Case, Input};

/// Places along an axis, in 1/1024 of a texel: up to 1/256.
const PLACES: [i16; 5] = [-4, -2, 0, 2, 4];
/// The same for 3-D textures.
const PLACES_3D: [i16; 3] = [-4, 0, 4];
/// Rounding of a level of detail, in 1/1024: 1/256.
const LEVEL: i16 = 4;
/// Rounding of a product of two weights, in 1/1024: 1/512, half a step of 8 bits.
const TWIST: i8 = 2;
/// Rounding of an interpolation, natively and on the device, in 2^-24 of the largest texel.
const INTERPOLATION: i8 = 2;

/// Where a number may lie, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The least.
    pub low: f64,
    /// The greatest.
    pub high: f64,
}

impl Interval {
    /// How far `x` lies outside: 0 inside, infinite for what is no number.
    #[must_use]
    pub fn distance(self, x: f64) -> f64 {
        if x >= self.low && x <= self.high {
            return 0.0;
        }
        let distance = f64::max(self.low - x, x - self.high);
        if distance.is_nan() {
            f64::INFINITY
        } else {
            distance
        }
    }
}

/// What a device does with the products of two weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Products {
    /// They are as exact as floats are.
    Exact,
    /// They are rounded to 8 bits ([`rounds_products`](crate::device::VulkanDevice::rounds_products)).
    Rounded,
}

/// Where each number of a result may lie.
#[derive(Clone, Debug, PartialEq)]
pub struct Intervals(Vec<Interval>);

impl Intervals {
    /// Of the number that is at `index` in [`Numbers::values`].
    #[must_use]
    pub fn of(&self, index: usize) -> Option<Interval> {
        self.0.get(index).copied()
    }

    /// All ends, as bytes.
    pub fn bytes(&self) -> impl Iterator<Item = u8> + '_ {
        let ends = self.0.iter().flat_map(|i| [i.low, i.high]);
        ends.flat_map(f64::to_le_bytes)
    }

    /// What the samplers of `kernel` may do to what it writes with the inputs of `case`, `reference`
    /// with samplers as specified; none for a kernel without samplers. `run` runs a case natively. Samplers of devices
    /// that round `products` may do more.
    ///
    /// # Errors
    /// Those of `run`.
    pub fn find<E>(
        kernel: &Kernel,
        case: &Case,
        reference: &Written,
        products: Products,
        mut run: impl FnMut(&Case) -> Result<Written, E>,
    ) -> Result<Option<Self>, E> {
        let samplers: Vec<usize> = (0..case.args.len())
            .filter(|&i| matches!(case.args[i], Input::Sampler(_)))
            .collect();
        if samplers.is_empty() {
            return Ok(None);
        }
        let numbers = Numbers::of(kernel);
        let centre = numbers.values(reference);
        let grid = Grid::of(kernel);
        let mut intervals: Vec<Interval> = centre
            .iter()
            .map(|&x| Interval { low: x, high: x })
            .collect();
        let has_levels = case.args.iter().any(has_levels);
        let textures = filtered(kernel);
        for sampler in samplers {
            let mut with = |deviation: Deviation| {
                let mut moved = case.clone();
                if let Input::Sampler(s) = &mut moved.args[sampler] {
                    s.deviation = deviation;
                }
                run(&moved).map(|written| numbers.values(&written))
            };
            let moved: &[Levels] = match products {
                Products::Rounded if has_levels => &[Levels::Even, Levels::Odd],
                _ => &[Levels::All],
            };
            for &levels in moved {
                let mut at = |offset, twist| {
                    with(Deviation {
                        levels,
                        offset,
                        twist,
                        ..Deviation::NONE
                    })
                };
                let places = grid.offsets().map(|offset| at(offset, 0));
                let places = places.collect::<Result<Vec<_>, _>>()?;
                let twisted = match products {
                    Products::Exact => Vec::new(),
                    Products::Rounded => {
                        let ends = grid.coarse().offsets();
                        let both = ends.flat_map(|it| [(it, -TWIST), (it, TWIST)]);
                        both.map(|(offset, twist)| at(offset, twist))
                            .collect::<Result<_, _>>()?
                    }
                };
                for (i, interval) in intervals.iter_mut().enumerate() {
                    let (down, up) = reach(i, centre[i], places.iter().chain(&twisted));
                    let step = grid.step(i, &places);
                    interval.low -= down + step;
                    interval.high += up + step;
                }
            }
            let mut sums = Vec::new();
            let rounding = INTERPOLATION * (grid.axes as i8 + i8::from(has_levels));
            for (texture, channel) in textures.iter().flat_map(|it| (0..4).map(move |c| (*it, c))) {
                for sign in [-rounding, rounding] {
                    let mut deviation = Deviation {
                        texture,
                        ..Deviation::NONE
                    };
                    deviation.channels[channel] = sign;
                    sums.push(with(deviation)?);
                }
            }
            if has_levels {
                for level in [-LEVEL, LEVEL] {
                    sums.push(with(Deviation {
                        level,
                        ..Deviation::NONE
                    })?);
                }
            }
            for (i, interval) in intervals.iter_mut().enumerate() {
                let rounding = added(i, centre[i], &sums);
                interval.low -= rounding;
                interval.high += rounding;
            }
        }
        Ok(Some(Self(intervals)))
    }
}

/// The numbers of a kernel's textures that a sampler may interpolate.
fn filtered(kernel: &Kernel) -> Vec<u8> {
    let textures = kernel.params.iter().filter_map(|it| match &it.role {
        Role::Texture { texture, .. } => Some(*texture),
        _ => None,
    });
    let is_filtered = |it: &TextureKind| it.channels() == Channels::Float && !it.is_multisampled();
    textures
        .zip(0..)
        .filter(|(texture, _)| is_filtered(texture))
        .map(|(_, number)| number)
        .collect()
}

/// Whether an argument is a texture with more than one level.
fn has_levels(arg: &Input) -> bool {
    matches!(arg, Input::Texture { shape, .. } if shape.levels > 1)
}

/// Places of a coordinate along each axis.
#[derive(Clone, Copy, Debug)]
struct Grid {
    places: &'static [i16],
    axes: u32,
}

impl Grid {
    fn of(kernel: &Kernel) -> Self {
        let volume = |role: &Role| {
            let Role::Texture { texture, .. } = role else {
                return false;
            };
            *texture == TextureKind::Texture3d
        };
        if kernel.params.iter().any(|p| volume(&p.role)) {
            Self {
                places: &PLACES_3D,
                axes: 3,
            }
        } else {
            Self {
                places: &PLACES,
                axes: 2,
            }
        }
    }

    /// All places, the first axis fastest.
    fn offsets(self) -> impl Iterator<Item = [i16; 3]> {
        let n = self.places.len();
        (0..n.pow(self.axes)).map(move |at| {
            let mut offset = [0; 3];
            for (axis, value) in offset.iter_mut().enumerate().take(self.axes as usize) {
                *value = self.places[at / n.pow(axis as u32) % n];
            }
            offset
        })
    }

    /// The ends and the middle along each axis.
    fn coarse(self) -> Self {
        Self {
            places: &PLACES_3D,
            ..self
        }
    }

    /// The largest step of number `i` between two neighbours, which may be hidden between them.
    fn step(self, i: usize, places: &[Vec<f64>]) -> f64 {
        self.neighbours()
            .map(|(a, b)| apart(places[a][i], places[b][i]))
            .fold(0.0, f64::max)
    }

    /// Pairs of neighbours.
    fn neighbours(self) -> impl Iterator<Item = (usize, usize)> {
        let n = self.places.len();
        (0..self.axes).flat_map(move |axis| {
            let stride = n.pow(axis);
            (0..n.pow(self.axes))
                .filter(move |at| at / stride % n + 1 < n)
                .map(move |at| (at, at + stride))
        })
    }
}

/// How far number `i` of these results lies below and above `centre`.
fn reach<'a>(i: usize, centre: f64, results: impl Iterator<Item = &'a Vec<f64>>) -> (f64, f64) {
    let (mut down, mut up) = (0.0_f64, 0.0_f64);
    for values in results {
        let d = apart(values[i], centre);
        if values[i] < centre {
            down = down.max(d);
        } else {
            up = up.max(d);
        }
    }
    (down, up)
}

/// How far all of these together may take number `i` from `centre`; they are pairs: a channel or the level, down and up.
fn added(i: usize, centre: f64, sums: &[Vec<f64>]) -> f64 {
    sums.chunks(2)
        .map(|pair| {
            let distances = pair.iter().map(|values| apart(values[i], centre));
            distances.fold(0.0, f64::max)
        })
        .sum()
}

/// The distance; nothing between equal infinities and between NaNs, infinite where only one is
/// finite.
fn apart(a: f64, b: f64) -> f64 {
    if a == b || (a.is_nan() && b.is_nan()) {
        return 0.0;
    }
    let d = (a - b).abs();
    if d.is_nan() { f64::INFINITY } else { d }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_from_an_interval() {
        let interval = Interval {
            low: -1.0,
            high: 2.0,
        };
        for (x, distance) in [
            (-1.0, 0.0),
            (0.5, 0.0),
            (2.0, 0.0),
            (-1.5, 0.5),
            (4.0, 2.0),
            (f64::INFINITY, f64::INFINITY),
            (f64::NAN, f64::INFINITY),
        ] {
            assert_eq!(interval.distance(x), distance, "{x}");
        }
        let all = Interval {
            low: f64::NEG_INFINITY,
            high: f64::INFINITY,
        };
        assert_eq!(all.distance(f64::NAN), f64::INFINITY);
        assert_eq!(all.distance(1e300), 0.0);
    }

    #[test]
    fn neighbours_differ_along_one_axis() {
        for grid in [
            Grid {
                places: &PLACES,
                axes: 2,
            },
            Grid {
                places: &PLACES_3D,
                axes: 3,
            },
        ] {
            let all: Vec<[i16; 3]> = grid.offsets().collect();
            let n = grid.places.len();
            assert_eq!(all.len(), n.pow(grid.axes));
            let pairs: Vec<(usize, usize)> = grid.neighbours().collect();
            assert_eq!(
                pairs.len(),
                grid.axes as usize * (n - 1) * n.pow(grid.axes - 1)
            );
            let step = grid.places[1] - grid.places[0];
            for (a, b) in pairs {
                let apart: i16 = (0..3).map(|d| (all[a][d] - all[b][d]).abs()).sum();
                assert_eq!(apart, step);
            }
        }
    }

    #[test]
    fn what_lies_between_places_and_what_channels_change_counts() {
        let grid = Grid {
            places: &PLACES_3D,
            axes: 2,
        };
        // x + 10 y on a grid of -1, 0, 1.
        let places: Vec<Vec<f64>> = grid
            .offsets()
            .map(|[x, y, _]| vec![f64::from(x / 4) + 10.0 * f64::from(y / 4)])
            .collect();
        let mut sums = vec![vec![0.0]; 8];
        sums[0] = vec![0.25];
        sums[1] = vec![-0.5];
        sums[6] = vec![2.0];
        assert_eq!(reach(0, 0.0, places.iter()), (11.0, 11.0));
        assert_eq!(grid.step(0, &places), 10.0);
        assert_eq!(added(0, 0.0, &sums), 2.5);
    }
}
