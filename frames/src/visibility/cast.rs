//! Ray casting: what a rasteriser would find, found another way.
//!
//! The tree's boxes are tested in single precision and are a little larger than needed. A corner
//! of a triangle is projected along the ray, alike for every triangle that has it, and rounded to
//! single precision; products of such numbers are exact in double precision, and so are the signs
//! that tell on which side of an edge the ray passes. A ray cannot slip through a closed surface,
//! not even through a corner of it (the idea of Woop, Benthin, Wald: Watertight Ray/Triangle
//! Intersection, 2013).
//!
//! The tree's crate has its own series of `glam`; points cross over as arrays.

use std::cmp::Ordering;
use std::collections::HashSet;

use hankel_dsl::glam::{DMat4, DVec3, Mat4, Vec3, Vec4};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::{Ray, RayHit};
use rayon::prelude::*;

use crate::scene::Mesh;

/// Where the samples of a pixel lie, as Vulkan's standard locations have it for four.
pub const SAMPLES: [[f64; 2]; 4] = [
    [0.375, 0.125],
    [0.875, 0.375],
    [0.125, 0.625],
    [0.625, 0.875],
];

/// Where the sample of a texel lies that has one.
const MIDDLE: [[f64; 2]; 1] = [[0.5, 0.5]];

/// Where the samples of a pixel or texel lie that has one, or as many as [`SAMPLES`].
#[must_use]
pub const fn places(samples: u32) -> &'static [[f64; 2]] {
    match samples {
        1 => &MIDDLE,
        _ => &SAMPLES,
    }
}

/// Places along a segment that are no farther apart than this share of it are one, if the triangles there are
/// neighbours.
const SAME: f64 = 1e-9;

/// Triangles that rays can be cast at.
pub struct Caster {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// What the tree's numbers mean.
    leaves: Vec<u32>,
    tree: Bvh2,
}

/// What a ray met first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// How far along the ray, in units of its direction.
    pub t: f64,
    /// Which triangle.
    pub triangle: u32,
}

/// A ray from `t` = 0 to 1.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    origin: DVec3,
    direction: DVec3,
    /// At right angles to the direction and to each other.
    across: [DVec3; 2],
}

impl Segment {
    /// From a point on, as far as `direction` is long; it must not be zero.
    #[must_use]
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        let (u, v) = direction.normalize_or(DVec3::Z).any_orthonormal_pair();
        Self {
            origin,
            direction,
            across: [u, v],
        }
    }

    /// The point at `t`.
    #[must_use]
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// Corners as seen along the segment, which itself is the point (0, 0).
    fn seen(&self, corners: [Vec3; 3]) -> [[f64; 2]; 3] {
        corners.map(|p| self.across.map(|axis| axis.dot(p.as_dvec3() - self.origin)))
    }

    /// The weights of a triangle's corners where the segment's line meets the triangle's plane,
    /// also beyond the triangle; `None` for a line along the plane.
    #[must_use]
    pub fn weights(&self, corners: [Vec3; 3]) -> Option<[f64; 3]> {
        let areas = areas(self.seen(corners));
        let sum: f64 = areas.iter().sum();
        let weights = areas.map(|a| a / sum);
        weights.iter().all(|w| w.is_finite()).then_some(weights)
    }

    /// The ray for the tree, as long as the segment and a little longer.
    fn ray(&self) -> Ray {
        let length = self.direction.length();
        let direction = self.direction / length;
        Ray::new(
            self.origin.as_vec3().to_array().into(),
            direction.as_vec3().to_array().into(),
            0.0,
            (length * 1.0001) as f32,
        )
    }

    /// Where the segment meets a triangle.
    #[must_use]
    pub fn meet(&self, corners: [Vec3; 3]) -> Option<f64> {
        let areas = areas(self.seen(corners).map(|p| p.map(|x| f64::from(x as f32))));
        if !(areas.iter().all(|&a| a >= 0.0) || areas.iter().all(|&a| a <= 0.0)) {
            return None;
        }
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a);
        let t = normal.dot(a - self.origin) / normal.dot(self.direction);
        // A ray along the plane sees none of it: not a number, or infinite.
        (0.0..=1.0).contains(&t).then_some(t)
    }
}

/// Twice the signed areas of the triangles that (0, 0) makes with the edges.
fn areas([a, b, c]: [[f64; 2]; 3]) -> [f64; 3] {
    let area = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
    [area(b, c), area(c, a), area(a, b)]
}

/// The segments through a clip space: one for each sample of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    world_from_clip: DMat4,
    step: [f64; 2],
}

impl Lens {
    /// For pictures of the given size that show what `clip_from_world` does.
    #[must_use]
    pub fn new(clip_from_world: Mat4, width: u32, height: u32) -> Self {
        Self {
            world_from_clip: clip_from_world.as_dmat4().inverse(),
            step: [2.0 / f64::from(width), 2.0 / f64::from(height)],
        }
    }

    /// From the near plane to the far plane through a point of a pixel, (0, 0) its upper left
    /// corner and (1, 1) its lower right one.
    #[must_use]
    pub fn segment(&self, pixel: [u32; 2], [x, y]: [f64; 2]) -> Segment {
        let x = (f64::from(pixel[0]) + x) * self.step[0] - 1.0;
        let y = 1.0 - (f64::from(pixel[1]) + y) * self.step[1];
        let near = self.world_from_clip.project_point3(DVec3::new(x, y, 0.0));
        let far = self.world_from_clip.project_point3(DVec3::new(x, y, 1.0));
        Segment::new(near, far - near)
    }
}

impl Caster {
    /// Builds the tree for [`Caster::first`]. Indices are in range: whoever fills a mesh sees to it.
    #[must_use]
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        // Of triangles in the same place, a ray meets the first: the others only cost time, each
        // one in each ray.
        let mut places = HashSet::with_capacity(triangles.len());
        let is_new = |i: &u32| {
            let corners = triangles[*i as usize].map(|v| positions[v as usize]);
            places.insert(corners.map(|p| p.to_array().map(f32::to_bits)))
        };
        let leaves = (0..triangles.len() as u32).filter(is_new).collect();
        Self::with_leaves(positions, triangles, leaves)
    }

    /// Builds the tree for [`Caster::all`]: of triangles in the same place, a ray meets each.
    #[must_use]
    pub fn of_layers(positions: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let leaves = (0..triangles.len() as u32).collect();
        Self::with_leaves(positions, triangles, leaves)
    }

    fn with_leaves(positions: &[Vec3], triangles: &[[u32; 3]], leaves: Vec<u32>) -> Self {
        let far = positions.iter().map(|p| p.abs().max_element());
        let slack = 4e-6 * far.fold(0.0, f32::max);
        let corners_of = |i: u32| triangles[i as usize].map(|v| positions[v as usize]);
        let boxes: Vec<Aabb> = leaves
            .iter()
            .map(|&i| {
                let [a, b, c] = corners_of(i);
                let (low, high) = (a.min(b).min(c) - slack, a.max(b).max(c) + slack);
                Aabb::new(low.to_array().into(), high.to_array().into())
            })
            .collect();
        let mut time = std::time::Duration::ZERO;
        let tree = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut time);
        Self {
            positions: positions.to_vec(),
            triangles: triangles.to_vec(),
            leaves,
            tree,
        }
    }

    /// A mesh's opaque triangles, for [`Caster::first`].
    #[must_use]
    pub fn of(mesh: &Mesh) -> Self {
        Self::new(&mesh.positions, &mesh.opaque())
    }

    /// A mesh's translucent triangles, for [`Caster::all`]; `None` if there are none.
    #[must_use]
    pub fn of_translucent(mesh: &Mesh) -> Option<Self> {
        let triangles = mesh.translucent();
        (!triangles.is_empty()).then(|| Self::of_layers(&mesh.positions, &triangles))
    }

    /// The vertices of a triangle.
    #[must_use]
    pub fn vertices(&self, triangle: u32) -> [u32; 3] {
        self.triangles[triangle as usize]
    }

    /// The corners of a triangle.
    #[must_use]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.vertices(triangle).map(|v| self.positions[v as usize])
    }

    /// How many vertices there are.
    #[must_use]
    pub const fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// The first triangle that a segment meets.
    #[must_use]
    pub fn first(&self, segment: &Segment) -> Option<Hit> {
        let length = segment.direction.length();
        let ray = segment.ray();
        let mut best: Option<Hit> = None;
        let mut near = RayHit::none();
        near.t = ray.tmax;
        self.tree.ray_traverse(ray, &mut near, |_, slot| {
            let triangle = self.leaves[self.tree.primitive_indices[slot] as usize];
            let Some(t) = segment.meet(self.corners(triangle)) else {
                return f32::INFINITY;
            };
            if best.is_some_and(|b| b.t < t || (b.t == t && b.triangle < triangle)) {
                return f32::INFINITY;
            }
            best = Some(Hit { t, triangle });
            // Whatever may still be nearer must not be pruned away by rounding.
            ((t * length) as f32).next_up()
        });
        best
    }

    /// All triangles that a segment meets, from the nearest to the farthest. Where it passes through what
    /// neighbours share, a corner or an edge, it meets one of them.
    #[must_use]
    pub fn all(&self, segment: &Segment) -> Vec<Hit> {
        let ray = segment.ray();
        let mut hits: Vec<Hit> = Vec::new();
        let mut none = RayHit::none();
        none.t = ray.tmax;
        self.tree.ray_traverse(ray, &mut none, |_, slot| {
            let triangle = self.leaves[self.tree.primitive_indices[slot] as usize];
            hits.extend(
                segment
                    .meet(self.corners(triangle))
                    .map(|t| Hit { t, triangle }),
            );
            // Nothing is hidden.
            f32::INFINITY
        });
        hits.sort_by(|a, b| {
            (a.t, a.triangle)
                .partial_cmp(&(b.t, b.triangle))
                .unwrap_or(Ordering::Equal)
        });
        let mut apart: Vec<Hit> = Vec::with_capacity(hits.len());
        for hit in hits {
            let own = self.corners(hit.triangle);
            let is_met = |other: &Hit| {
                let corners = self.corners(other.triangle);
                let shared = own.iter().filter(|c| corners.contains(c)).count();
                // Those that share all three are two surfaces in one place.
                hit.t - other.t < SAME && (shared == 1 || shared == 2)
            };
            if !apart.iter().any(is_met) {
                apart.push(hit);
            }
        }
        apart
    }

    /// A value at the vertices, where a segment meets a triangle.
    #[must_use]
    pub fn at(&self, segment: &Segment, hit: Hit, values: &[f32]) -> f32 {
        let [a, b, c] = self
            .vertices(hit.triangle)
            .map(|v| f64::from(values[v as usize]));
        let [wa, wb, wc] = self.weights(segment, hit.triangle);
        (wa * a + wb * b + wc * c) as f32
    }

    /// A vector at the vertices, where a segment meets a triangle.
    #[must_use]
    pub fn vector_at(&self, segment: &Segment, hit: Hit, values: &[Vec3]) -> DVec3 {
        let [a, b, c] = self
            .vertices(hit.triangle)
            .map(|v| values[v as usize].as_dvec3());
        let [wa, wb, wc] = self.weights(segment, hit.triangle);
        a * wa + b * wb + c * wc
    }

    /// How much of each vertex is in the place where a segment meets a triangle. Seen edge-on, any point of the
    /// triangle will do.
    pub(crate) fn weights(&self, segment: &Segment, triangle: u32) -> [f64; 3] {
        let weights = segment.weights(self.corners(triangle));
        weights.unwrap_or([1.0 / 3.0; 3])
    }

    /// The share of light that passes all that a segment meets, of surfaces with these opacities at their
    /// vertices: the product of 1 minus each.
    #[must_use]
    pub fn transmittance(&self, segment: &Segment, opacities: &[f32]) -> f32 {
        let hits = self.all(segment).into_iter();
        let passes = |hit| 1.0 - self.at(segment, hit, opacities).clamp(0.0, 1.0);
        hits.map(passes).product()
    }

    /// The depth at each of these places in every texel of a map: 1 where nothing is. `clip` is where the vertices go
    /// in clip space, `lens` the same transform; `advance` is told the share that is done.
    #[must_use]
    pub fn depths(
        &self,
        lens: &Lens,
        clip: &[Vec4],
        [width, height]: [u32; 2],
        places: &[[f64; 2]],
        advance: &mut dyn FnMut(f32),
    ) -> Vec<f32> {
        let row_len = width as usize * places.len();
        let mut depths = vec![1.0; row_len * height as usize];
        in_bands(&mut depths, row_len, advance, |y, row: &mut [f32]| {
            for (x, texel) in row.chunks_mut(places.len()).enumerate() {
                for (depth, at) in texel.iter_mut().zip(places) {
                    let segment = lens.segment([x as u32, y as u32], *at);
                    if let Some(hit) = self.first(&segment) {
                        *depth = self.depth(&segment, hit, clip);
                    }
                }
            }
        });
        depths
    }

    /// The depth where a segment meets a triangle.
    pub(crate) fn depth(&self, segment: &Segment, hit: Hit, clip: &[Vec4]) -> f32 {
        let vertices = self.vertices(hit.triangle).map(|v| clip[v as usize]);
        let Some(weights) = segment.weights(self.corners(hit.triangle)) else {
            return hit.t as f32;
        };
        let at = |of: fn(&Vec4) -> f32| -> f64 {
            let products = weights.iter().zip(&vertices);
            products.map(|(w, v)| w * f64::from(of(v))).sum()
        };
        let z = at(|v| v.z);
        // Without perspective w is 1, but for what rounding makes of the weights' sum.
        if vertices.iter().all(|v| v.w == 1.0) {
            z as f32
        } else {
            (z / at(|v| v.w)) as f32
        }
    }
}

/// Rows in parallel, some at a time, so that progress can be told in between.
pub(crate) fn in_bands<T: Send>(
    all: &mut [T],
    row_len: usize,
    advance: &mut dyn FnMut(f32),
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let rows = all.len() / row_len.max(1);
    let band = rows.div_ceil(32).max(1);
    for (i, part) in all.chunks_mut(band * row_len).enumerate() {
        part.par_chunks_mut(row_len)
            .enumerate()
            .for_each(|(y, row)| work(i * band + y, row));
        advance(((i + 1) * band).min(rows) as f32 / rows as f32);
    }
}

#[cfg(test)]
mod tests {
    use hankel_dsl::glam::camera::rh::proj::directx::{orthographic, perspective};
    use hankel_dsl::glam::camera::rh::view::look_at_mat4;

    use super::*;
    use crate::scene::Procedural;

    #[test]
    fn a_closed_surface_has_no_gaps() {
        let mut mesh = Mesh::default();
        mesh.sphere(Vec3::ZERO, 1.0, 40);
        mesh.drop_degenerate();
        let caster = Caster::of(&mesh);
        // Towards every vertex and the middle of every edge: where gaps would be.
        for t in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(t);
            for target in [a, b, c, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5] {
                let origin = target.as_dvec3() * 3.0;
                let hit = caster.first(&Segment::new(origin, -origin)).unwrap();
                assert!((hit.t - 2.0 / 3.0).abs() < 1e-2, "{hit:?}");
            }
        }
    }

    #[test]
    fn the_tree_finds_what_trying_all_finds() {
        let mesh = Procedural::Yard.mesh();
        let caster = Caster::of(&mesh);
        let view = perspective(0.8, 1.0, 0.1, 200.0)
            * look_at_mat4(Vec3::new(9.0, 5.0, 8.0), Vec3::ZERO, Vec3::Y);
        let lens = Lens::new(view, 16, 16);
        let mut hits = 0;
        for i in 0..256 {
            let segment = lens.segment([i % 16, i / 16], SAMPLES[0]);
            let all = (0..mesh.triangles.len())
                .filter_map(|i| segment.meet(mesh.corners(i)))
                .min_by(f64::total_cmp);
            assert_eq!(caster.first(&segment).map(|h| h.t), all);
            hits += usize::from(all.is_some());
        }
        assert!(hits > 100);
    }

    #[test]
    fn a_sloping_plane_has_its_analytic_depth() {
        let mut mesh = Mesh::default();
        mesh.quad(
            [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]]
                .map(|[x, z]| Vec3::new(x, 0.5 * x, z)),
        );
        let view = orthographic(-1.0, 1.0, -1.0, 1.0, 0.0, 4.0)
            * look_at_mat4(Vec3::Y * 2.0, Vec3::ZERO, Vec3::NEG_Z);
        let clip: Vec<Vec4> = mesh
            .positions
            .iter()
            .map(|p| view * p.extend(1.0))
            .collect();
        let mut done = 0.0;
        let mut advance = |share: f32| {
            assert!(share > done);
            done = share;
        };
        let depths = Caster::of(&mesh).depths(
            &Lens::new(view, 8, 8),
            &clip,
            [8, 8],
            &SAMPLES,
            &mut advance,
        );
        assert_eq!(done, 1.0);
        for (i, texel) in depths.chunks(4).enumerate() {
            for (depth, at) in texel.iter().zip(SAMPLES) {
                let x = ((i % 8) as f64 + at[0]) / 4.0 - 1.0;
                let expected = (2.0 - 0.5 * x) / 4.0;
                assert!(
                    (f64::from(*depth) - expected).abs() < 1e-6,
                    "{depth} {expected}"
                );
            }
        }
    }
}
