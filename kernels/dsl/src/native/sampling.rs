//! Texels and samplers on the host, by the formulas of the Vulkan specification, chapter "Image
//! Operations". WebGPU, Direct3D and Metal compute the same, as far as they say.
//!
//! What a device may do otherwise, and what a kernel's tolerance must therefore allow:
//! - Weights between texels are rounded to `subTexelPrecisionBits`, and weights between levels to
//!   `mipmapPrecisionBits`: 4 at least, 8 on common hardware. With the texels' difference `d`, each
//!   of them is up to `d / 2^bits / 2` off.
//! - A nearest texel or level is another one where the coordinate or the level of detail is that
//!   close to the middle between two.
//! - From gradients, implicit ones too, the level of detail may be larger than here: the length of
//!   a gradient may be taken as anything from its largest component to the sum of them, times the
//!   root of 2.

use glam::{UVec4, Vec3, Vec4};

use super::call::{Address, Filter, Sampler, TextureRef, level_size, texture_bytes};
use super::sanitize;

/// A level of a layer of a texture.
#[derive(Clone, Copy)]
struct Level<'a> {
    size: [u32; 3],
    samples: u32,
    texture: &'a TextureRef<'a>,
    /// Its first byte.
    start: usize,
}

impl<'a> Level<'a> {
    /// Both are made to exist.
    fn of(texture: &'a TextureRef<'a>, level: u32, layer: u32) -> Self {
        let t = texture;
        let (level, layer) = (level.min(t.levels - 1), layer.min(t.layers - 1));
        let size = level_size(t.size, level);
        let before = texture_bytes(t.size, level, t.layers, t.samples, t.format);
        let own = size.iter().fold(t.format.bytes(), |n, s| n * *s as usize) * t.samples as usize;
        Self {
            size,
            samples: t.samples,
            texture,
            start: before + own * layer as usize,
        }
    }

    /// The nearest texel that there is.
    fn nearest(&self, at: [u32; 3]) -> [u32; 3] {
        [0, 1, 2].map(|d| at[d].min(self.size[d] - 1))
    }

    fn texel(&self, at: [u32; 3], sample: u32) -> Vec4 {
        self.texture.format.load(self.bytes(at, sample))
    }

    fn bytes(&self, at: [u32; 3], sample: u32) -> &'a [u8] {
        let [width, height, _] = self.size.map(|n| n as usize);
        let texel = (at[2] as usize * height + at[1] as usize) * width + at[0] as usize;
        let index = texel * self.samples as usize + sample.min(self.samples - 1) as usize;
        &self.texture.bytes[self.start + index * self.texture.format.bytes()..]
    }
}

/// The texel at `at`; the nearest one, where there is none.
#[inline]
pub fn load(t: &TextureRef<'_>, at: [u32; 3], layer: u32, level: u32, sample: u32) -> Vec4 {
    let level = Level::of(t, level, layer);
    level.texel(level.nearest(at), sample)
}

/// The same of a texture of integers; signed ones come as their bits.
#[inline]
pub fn load_integer(
    t: &TextureRef<'_>,
    at: [u32; 3],
    layer: u32,
    level: u32,
    sample: u32,
) -> UVec4 {
    let level = Level::of(t, level, layer);
    t.format
        .load_integer(level.bytes(level.nearest(at), sample))
}

/// The coordinate of a texel that may lie beyond the edge ("Wrapping Operation").
#[inline]
fn wrap(i: i64, size: u32, address: Address) -> u32 {
    let size = i64::from(size);
    let i = match address {
        Address::ClampToEdge => i.clamp(0, size - 1),
        Address::Repeat => i.rem_euclid(size),
        Address::MirrorRepeat => {
            let i = i.rem_euclid(2 * size);
            if i < size { i } else { 2 * size - 1 - i }
        }
    };
    // In 0..size, which came from a u32.
    i as u32
}

/// Where a texture is sampled: in a layer of one, two or three dimensions, or from a cube's middle.
#[derive(Clone, Copy)]
pub enum Place {
    /// By coordinates in a layer of so many dimensions.
    Flat {
        /// Coordinates, from 0 to 1 within the texture.
        at: Vec3,
        /// Dimensions.
        dimensions: usize,
        /// The layer.
        layer: u32,
        /// Texels further along each axis, of the level that is read.
        shift: [i32; 3],
    },
    /// In a direction in the cube that begins at a layer.
    Cube {
        /// The direction; its length does not matter.
        direction: Vec3,
        /// The layer of its first face.
        first: u32,
    },
}

/// Which face of a cube lies in a direction, and where on it, from -1 to 1 ("Cube Map Face
/// Selection").
fn face(r: Vec3) -> (u32, [f32; 2]) {
    let a = r.abs();
    let (face, s, t, major) = if a.z >= a.x && a.z >= a.y {
        if r.z >= 0.0 {
            (4, r.x, -r.y, a.z)
        } else {
            (5, -r.x, -r.y, a.z)
        }
    } else if a.y >= a.x {
        if r.y >= 0.0 {
            (2, r.x, r.z, a.y)
        } else {
            (3, r.x, -r.z, a.y)
        }
    } else if r.x >= 0.0 {
        (0, -r.z, -r.y, a.x)
    } else {
        (1, r.z, -r.y, a.x)
    };
    // The middle of a face where there is no direction.
    let major = if major == 0.0 { 1.0 } else { major };
    (face, [s / major, t / major])
}

/// The direction of a point on a face's plane, the inverse of [`face`].
fn direction(face: u32, [s, t]: [f32; 2]) -> Vec3 {
    match face {
        0 => Vec3::new(1.0, -t, -s),
        1 => Vec3::new(-1.0, -t, s),
        2 => Vec3::new(s, 1.0, t),
        3 => Vec3::new(s, -1.0, -t),
        4 => Vec3::new(s, -t, 1.0),
        _ => Vec3::new(-s, -t, -1.0),
    }
}

/// The texels of a level around a place, and how much of the second in each direction.
struct Taps<'a> {
    own: Level<'a>,
    /// Of a cube: the level, the layer of its first face, and the face.
    cube: Option<(u32, u32, u32)>,
    base: [i64; 3],
    weight: [f32; 3],
    address: [Address; 3],
}

impl<'a> Taps<'a> {
    fn new(
        t: &'a TextureRef<'a>,
        sampler: &Sampler,
        place: Place,
        level: u32,
        linear: bool,
    ) -> Self {
        let (at, dimensions, cube, layer, shift) = match place {
            Place::Flat {
                at,
                dimensions,
                layer,
                shift,
            } => (at.to_array(), dimensions, None, layer, shift),
            Place::Cube { direction, first } => {
                let (face, [s, t]) = face(direction);
                let at = [s * 0.5 + 0.5, t * 0.5 + 0.5, 0.0];
                (at, 2, Some((level, first, face)), first + face, [0; 3])
            }
        };
        let own = Level::of(t, level, layer);
        let size = own.size;
        let (mut base, mut weight) = ([0; 3], [0.0; 3]);
        for d in (0..dimensions).filter(|&d| d < 2 || size[2] > 1) {
            let x = at[d] * size[d] as f32;
            let x = if linear { x - 0.5 } else { x };
            let x = match sampler.deviation.offset[d] {
                _ if !sampler.deviation.levels.has(level) => x,
                0 => x,
                n => x + f32::from(n) / 1024.0,
            };
            let floor = x.floor();
            base[d] = (floor as i64).saturating_add(shift[d].into());
            weight[d] = if linear { x - floor } else { 0.0 };
        }
        let mut address = sampler.address;
        if cube.is_some() {
            address = [Address::ClampToEdge; 3];
            // A coordinate of 1 is the last texel's; filters cross edges.
            for base in base.iter_mut().take(if linear { 0 } else { 2 }) {
                *base = (*base).clamp(0, i64::from(size[0]) - 1);
            }
        }
        Self {
            own,
            cube,
            base,
            weight,
            address,
        }
    }

    /// A texel; none beyond a cube's corner.
    fn tap(&self, step: [i64; 3]) -> Option<Vec4> {
        self.place(step).map(|(level, at)| level.texel(at, 0))
    }

    /// Where a texel lies; nowhere beyond a cube's corner.
    fn place(&self, step: [i64; 3]) -> Option<(Level<'a>, [u32; 3])> {
        let at = [0, 1, 2].map(|d| self.base[d] + step[d]);
        let Some((level, first, face_here)) = self.cube else {
            let at = [0, 1, 2].map(|d| wrap(at[d], self.own.size[d], self.address[d]));
            return Some((self.own, at));
        };
        let n = i64::from(self.own.size[0]);
        let beyond = |i: i64| i < 0 || i >= n;
        match (beyond(at[0]), beyond(at[1])) {
            (true, true) => None,
            (false, false) => Some((self.own, [at[0] as u32, at[1] as u32, 0])),
            // The texel across the edge lies in the direction of its middle on this face's plane.
            _ => {
                let middle = |i: i64| (2 * i + 1) as f32 / n as f32 - 1.0;
                let (face, on) = face(direction(face_here, [middle(at[0]), middle(at[1])]));
                let index = |x: f32| (((x * 0.5 + 0.5) * n as f32) as i64).clamp(0, n - 1) as u32;
                let level = Level::of(self.own.texture, level, first + face);
                Some((level, [index(on[0]), index(on[1]), 0]))
            }
        }
    }

    /// The four texels of a slice: (0, 0), (1, 0), (0, 1), (1, 1). What lies beyond a cube's corner
    /// is the mean of the other three.
    fn square(&self, dz: i64, of: &impl Fn(Vec4) -> Vec4) -> [Vec4; 4] {
        let taps = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[x, y]| self.tap([x, y, dz]).map(of));
        let there = taps.iter().flatten().copied().sum::<Vec4>();
        taps.map(|tap| tap.unwrap_or(there / 3.0))
    }
}

/// One level, filtered ("Texel Filtering"): of each texel what `of` makes of it.
fn filter(
    t: &TextureRef<'_>,
    sampler: &Sampler,
    place: Place,
    level: u32,
    filter: Filter,
    of: &impl Fn(Vec4) -> Vec4,
) -> Vec4 {
    let taps = Taps::new(t, sampler, place, level, filter == Filter::Linear);
    if filter == Filter::Nearest {
        // The nearest texel of a cube is on the face itself.
        return of(taps.tap([0; 3]).unwrap_or(Vec4::ZERO));
    }
    let weight = taps.weight;
    let slice = |dz: i64| {
        let [a, b, c, d] = taps.square(dz, of);
        let near = a * (1.0 - weight[0]) + b * weight[0];
        let far = c * (1.0 - weight[0]) + d * weight[0];
        let value = near * (1.0 - weight[1]) + far * weight[1];
        match sampler.deviation.twist {
            _ if !sampler.deviation.levels.has(level) => value,
            0 => value,
            n => value + (a - b - c + d) * (f32::from(n) / 1024.0),
        }
    };
    let front = slice(0);
    let value = if weight[2] == 0.0 {
        front
    } else {
        front * (1.0 - weight[2]) + slice(1) * weight[2]
    };
    match sampler.deviation.channels {
        [0, 0, 0, 0] => value,
        _ if sampler.deviation.texture != t.number => value,
        channels => {
            let read = [taps.square(0, of), taps.square(1, of)];
            let largest = read.as_flattened().iter().map(|tap| tap.abs());
            let largest = largest.fold(Vec4::ZERO, Vec4::max);
            let steps = channels.map(|n| f32::from(n) / 16_777_216.0);
            value + largest * Vec4::from_array(steps)
        }
    }
}

/// All levels that a level of detail takes ("Image Level(s) Selection").
fn levels(
    t: &TextureRef<'_>,
    sampler: &Sampler,
    place: Place,
    detail: f32,
    of: &impl Fn(Vec4) -> Vec4,
) -> Vec4 {
    look_for_direction(place);
    let between = if detail <= 0.0 {
        sampler.magnify
    } else {
        sampler.minify
    };
    let detail = match sampler.deviation.level {
        0 => detail,
        n => detail + f32::from(n) / 1024.0,
    };
    let detail = detail.clamp(0.0, (t.levels - 1) as f32);
    let one = |level: u32| filter(t, sampler, place, level, between, of);
    match sampler.mip {
        Filter::Nearest => one(((detail + 0.5).ceil() - 1.0) as u32),
        Filter::Linear => {
            let (fine, weight) = (detail.floor() as u32, detail.fract());
            if weight == 0.0 {
                one(fine)
            } else {
                one(fine) * (1.0 - weight) + one(fine + 1) * weight
            }
        }
    }
}

/// The sanitizer says where a direction is none, so that it has no face ("Cube Map Face Selection"): a device may read
/// anything then. Subnormal numbers may count as 0.
fn look_for_direction(place: Place) {
    if let Place::Cube { direction, .. } = place
        && direction.abs().max_element() < f32::MIN_POSITIVE
    {
        sanitize::no_direction();
    }
}

/// A filtered value at a level of detail.
pub fn sample(t: &TextureRef<'_>, sampler: &Sampler, place: Place, detail: f32) -> Vec4 {
    levels(t, sampler, place, detail, &|texel| texel)
}

/// How much of the texels compares with the reference, from 0 to 1 ("Depth Compare Operation").
pub fn compare(
    t: &TextureRef<'_>,
    sampler: &Sampler,
    place: Place,
    reference: f32,
    detail: f32,
) -> f32 {
    let of = |texel: Vec4| Vec4::splat(holds(sampler, reference, texel.x));
    levels(t, sampler, place, detail, &of).x
}

/// 1 where the comparison holds.
fn holds(sampler: &Sampler, reference: f32, texel: f32) -> f32 {
    // Whoever calls has looked that there is one.
    let how = sampler
        .compare
        .is_some_and(|how| how.holds(reference, texel));
    f32::from(u8::from(how))
}

/// A channel of the four texels that a linear filter reads at level 0, in the order in which they
/// are gathered.
pub fn gather(t: &TextureRef<'_>, sampler: &Sampler, place: Place, channel: usize) -> Vec4 {
    gathered(t, sampler, place, &|texel| Vec4::splat(texel[channel]))
}

/// The same of a texture of integers; signed ones come as their bits. Beyond a cube's corner, where there is no texel, it
/// is one of the other three: devices differ.
pub fn gather_integers(
    t: &TextureRef<'_>,
    sampler: &Sampler,
    place: Place,
    channel: usize,
) -> UVec4 {
    look_for_direction(place);
    let taps = Taps::new(t, sampler, place, 0, true);
    let texel = |step: [i64; 3]| {
        let (level, at) = taps.place(step)?;
        Some(t.format.load_integer(level.bytes(at, 0))[channel])
    };
    let four = [[0, 1], [1, 1], [1, 0], [0, 0]].map(|[x, y]| texel([x, y, 0]));
    let inside = four.iter().flatten().next().copied().unwrap_or(0);
    UVec4::from_array(four.map(|it| it.unwrap_or(inside)))
}

/// The same with a comparison of each.
pub fn gather_compare(t: &TextureRef<'_>, sampler: &Sampler, place: Place, reference: f32) -> Vec4 {
    let of = |texel: Vec4| Vec4::splat(holds(sampler, reference, texel.x));
    gathered(t, sampler, place, &of)
}

fn gathered(
    t: &TextureRef<'_>,
    sampler: &Sampler,
    place: Place,
    of: &impl Fn(Vec4) -> Vec4,
) -> Vec4 {
    look_for_direction(place);
    let [a, b, c, d] = Taps::new(t, sampler, place, 0, true).square(0, of);
    Vec4::new(c.x, d.x, b.x, a.x)
}

/// The level of detail of gradients of the coordinates ("Scale Factor Operation" and
/// "Level-of-Detail Operation"), without anisotropy.
pub fn detail(t: &TextureRef<'_>, place: Place, dx: Vec3, dy: Vec3) -> f32 {
    let (dx, dy) = match place {
        Place::Flat { .. } => (dx, dy),
        Place::Cube { direction, .. } => (
            face_derivative(direction, dx),
            face_derivative(direction, dy),
        ),
    };
    let size = Vec3::new(t.size[0] as f32, t.size[1] as f32, t.size[2] as f32);
    (dx * size).length().max((dy * size).length()).log2()
}

/// The derivative of the place on a cube's face along a derivative of the direction ("Cube Map
/// Derivative Transformation").
fn face_derivative(r: Vec3, d: Vec3) -> Vec3 {
    let parts = |v: Vec3, face: u32| match face {
        0 => [-v.z, -v.y, v.x],
        1 => [v.z, -v.y, -v.x],
        2 => [v.x, v.z, v.y],
        3 => [v.x, -v.z, -v.y],
        4 => [v.x, -v.y, v.z],
        _ => [-v.x, -v.y, -v.z],
    };
    let (face, _) = face(r);
    let ([s, t, major], [ds, dt, dmajor]) = (parts(r, face), parts(d, face));
    let along = |c: f32, dc: f32| 0.5 * (major * dc - c * dmajor) / (major * major);
    Vec3::new(along(s, ds), along(t, dt), 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::native::call::Compare;
    use crate::native::describe::TexelFormat;
    use std::vec::Vec;

    fn texture(texels: &[f32], size: [u32; 3], levels: u32, layers: u32) -> TextureRef<'_> {
        TextureRef {
            size,
            levels,
            layers,
            samples: 1,
            number: 0,
            format: TexelFormat::R32Float,
            bytes: bytemuck::cast_slice(texels),
        }
    }

    fn at(x: f32, y: f32) -> Place {
        Place::Flat {
            at: Vec3::new(x, y, 0.0),
            dimensions: 2,
            layer: 0,
            shift: [0; 3],
        }
    }

    const LINEAR: Sampler = Sampler::new(Filter::Linear, Address::ClampToEdge);
    const NEAREST: Sampler = Sampler::new(Filter::Nearest, Address::ClampToEdge);

    #[test]
    fn levels_lie_one_after_the_other_and_halve() {
        // 5 x 3, 2 x 1, 1 x 1.
        let texels: Vec<f32> = (0..18).map(|i| i as f32).collect();
        let t = texture(&texels, [5, 3, 1], 3, 1);
        assert_eq!(texture_bytes(t.size, 3, 1, 1, t.format), 18 * 4);
        assert_eq!(load(&t, [4, 2, 0], 0, 0, 0).x, 14.0);
        assert_eq!(load(&t, [1, 0, 0], 0, 1, 0).x, 16.0);
        assert_eq!(load(&t, [9, 9, 9], 0, 9, 0).x, 17.0);
    }

    #[test]
    fn levels_are_chosen_and_mixed_as_the_specification_says() {
        let texels: Vec<f32> = [[1.0; 16].as_slice(), &[2.0; 4], &[4.0]].concat();
        let t = texture(&texels, [4, 4, 1], 3, 1);
        let near = |detail: f32| sample(&t, &NEAREST, at(0.5, 0.5), detail).x;
        let details = [-1.0, 0.5, 0.51, 1.5, 1.51, 9.0];
        assert_eq!(details.map(near), [1.0, 1.0, 2.0, 2.0, 4.0, 4.0]);
        let linear = |detail: f32| sample(&t, &LINEAR, at(0.5, 0.5), detail).x;
        assert_eq!([0.0, 0.25, 1.5, 7.0].map(linear), [1.0, 1.25, 3.0, 4.0]);
    }

    #[test]
    fn the_level_of_detail_tells_which_filter_counts() {
        let texels = [0.0, 1.0, 2.0, 3.0];
        let t = texture(&texels, [4, 1, 1], 1, 1);
        let sampler = Sampler {
            magnify: Filter::Nearest,
            ..LINEAR
        };
        assert_eq!(sample(&t, &sampler, at(0.5, 0.5), 0.0).x, 2.0);
        assert_eq!(sample(&t, &sampler, at(0.5, 0.5), 0.1).x, 1.5);
    }

    #[test]
    fn what_lies_beyond_the_edge_is_clamped_repeated_or_mirrored() {
        let all = |address| [-3, -1, 0, 2, 3, 5, 6].map(|i| wrap(i, 3, address));
        assert_eq!(all(Address::ClampToEdge), [0, 0, 0, 2, 2, 2, 2]);
        assert_eq!(all(Address::Repeat), [0, 2, 0, 2, 0, 2, 0]);
        assert_eq!(all(Address::MirrorRepeat), [2, 0, 0, 2, 2, 0, 0]);
    }

    #[test]
    fn gradients_in_texels_are_powers_of_two_per_level() {
        let t = texture(&[0.0; 32], [8, 4, 1], 1, 1);
        let of = |dx: Vec3, dy: Vec3| detail(&t, at(0.0, 0.0), dx, dy);
        assert_eq!(of(Vec3::X, Vec3::ZERO), 3.0);
        assert_eq!(of(Vec3::X / 8.0, Vec3::Y), 2.0);
        assert_eq!(of(Vec3::ZERO, Vec3::ZERO), f32::NEG_INFINITY);
    }

    #[test]
    fn a_comparison_is_made_before_the_filter() {
        let t = texture(&[0.2, 0.8], [2, 1, 1], 1, 1);
        let sampler = Sampler {
            compare: Some(Compare::Less),
            ..LINEAR
        };
        let lit = |reference| compare(&t, &sampler, at(0.5, 0.5), reference, 0.0);
        assert_eq!([0.1, 0.5, 0.9].map(lit), [1.0, 0.5, 0.0]);
        let four = gather_compare(&t, &sampler, at(0.5, 0.5), 0.5);
        assert_eq!(four.to_array(), [0.0, 1.0, 1.0, 0.0]);
        for (how, lit) in Compare::ALL.into_iter().zip([
            [false, false, false],
            [true, false, false],
            [false, true, false],
            [true, true, false],
            [false, false, true],
            [true, false, true],
            [false, true, true],
            [true, true, true],
        ]) {
            assert_eq!([0.0, 0.5, 1.0].map(|r| how.holds(r, 0.5)), lit, "{how:?}");
        }
    }

    #[test]
    fn faces_and_directions_are_inverse() {
        for number in 0..6 {
            let (found, on) = face(direction(number, [0.25, -0.5]) * 3.0);
            assert_eq!((found, on), (number, [0.25, -0.5]));
        }
    }

    #[test]
    fn a_cube_is_filtered_across_its_edges() {
        // 2 x 2 texels each, with the face's number.
        let texels: Vec<f32> = (0..24).map(|i| (i / 4) as f32).collect();
        let t = texture(&texels, [2, 2, 1], 1, 6);
        let of = |direction: Vec3| {
            let place = Place::Cube {
                direction,
                first: 0,
            };
            sample(&t, &LINEAR, place, 0.0).x
        };
        assert_eq!(of(Vec3::X), 0.0);
        assert_eq!(of(Vec3::NEG_Z), 5.0);
        // Halfway between +x and +z, +y.
        assert_eq!(of(Vec3::new(1.0, 0.0, 1.0)), 2.0);
        assert_eq!(of(Vec3::new(1.0, 1.0, 0.0)), 1.0);
        // The corner of +x, +y, +z: the mean of three, and of what replaces the fourth.
        assert!((of(Vec3::ONE) - 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_turn_of_a_direction_is_a_step_on_the_face() {
        let place = Place::Cube {
            direction: Vec3::new(2.0, 0.5, 0.25),
            first: 0,
        };
        let t = texture(&[0.0; 96], [4, 4, 1], 1, 6);
        // Half a face, which is 2 texels.
        let step = Vec3::new(0.0, 2.0, 0.0);
        assert_eq!(detail(&t, place, step, Vec3::ZERO), 1.0);
        // Along the direction itself nothing moves.
        let along = Vec3::new(2.0, 0.5, 0.25);
        assert_eq!(detail(&t, place, along, Vec3::ZERO), f32::NEG_INFINITY);
    }
}
