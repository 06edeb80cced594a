//! Triangles with normals.

use hankel_dsl::glam::{Affine3A, DVec3, Mat3A, Vec3};

/// Indexed triangles in world space: metres or any other unit, y up, right-handed. Front faces
/// wind counter-clockwise; both sides are seen and cast shadows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Where the vertices are.
    pub positions: Vec<Vec3>,
    /// Unit normals, one for each vertex.
    pub normals: Vec<Vec3>,
    /// Share of light that comes back, red, green and blue from 0 to 1, one for each vertex.
    pub colours: Vec<Vec3>,
    /// Share of light that does not pass, from 0 to 1, one for each vertex; those beyond its end are opaque. A
    /// triangle is translucent if one of its vertices is.
    pub opacities: Vec<f32>,
    /// Three vertices each.
    pub triangles: Vec<[u32; 3]>,
}

/// The smallest box along the axes that holds something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub low: Vec3,
    /// Largest coordinates.
    pub high: Vec3,
}

impl Bounds {
    /// The box around the points; `None` without a point.
    #[must_use]
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Option<Self> {
        points.into_iter().fold(None, |bounds, p| {
            Some(bounds.map_or(Self { low: p, high: p }, |b: Self| Self {
                low: b.low.min(p),
                high: b.high.max(p),
            }))
        })
    }

    /// Its middle.
    #[must_use]
    pub fn centre(&self) -> Vec3 {
        (self.low + self.high) * 0.5
    }

    /// Its edges' lengths.
    #[must_use]
    pub fn size(&self) -> Vec3 {
        self.high - self.low
    }
}

impl Mesh {
    /// The box around all vertices; `None` without a vertex.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(self.positions.iter().copied())
    }

    /// The three corners of a triangle. Its indices are in range: whoever fills a mesh sees to it.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|i| self.positions[i as usize])
    }

    /// All indices, three for each triangle.
    #[must_use]
    pub fn indices(&self) -> &[u32] {
        self.triangles.as_flattened()
    }

    fn is_translucent(&self, triangle: &[u32; 3]) -> bool {
        let opacity = |v: &u32| self.opacities.get(*v as usize);
        triangle.iter().filter_map(opacity).any(|o| *o < 1.0)
    }

    /// The opaque triangles.
    #[must_use]
    pub fn opaque(&self) -> Vec<[u32; 3]> {
        let all = self.triangles.iter();
        all.filter(|t| !self.is_translucent(t)).copied().collect()
    }

    /// The translucent triangles.
    #[must_use]
    pub fn translucent(&self) -> Vec<[u32; 3]> {
        let all = self.triangles.iter();
        all.filter(|t| self.is_translucent(t)).copied().collect()
    }

    /// The translucent triangles from the farthest to the nearest as seen along a direction, by their middles.
    #[must_use]
    pub fn translucent_along(&self, direction: Vec3) -> Vec<[u32; 3]> {
        self.translucent_by(|place| place.dot(direction.as_dvec3()))
    }

    /// The same for what is seen from a place, by its distance.
    #[must_use]
    pub fn translucent_from(&self, position: Vec3) -> Vec<[u32; 3]> {
        self.translucent_by(|place| place.distance(position.as_dvec3()))
    }

    fn translucent_by(&self, depth: impl Fn(DVec3) -> f64) -> Vec<[u32; 3]> {
        let mut triangles = self.translucent();
        let of = |t: &[u32; 3]| -> f64 {
            let corner = |v: &u32| depth(self.positions[*v as usize].as_dvec3());
            t.iter().map(corner).sum()
        };
        triangles.sort_by(|a, b| of(b).total_cmp(&of(a)));
        triangles
    }

    /// The opacity of each vertex.
    #[must_use]
    pub fn all_opacities(&self) -> Vec<f32> {
        let mut all = self.opacities.clone();
        all.resize(self.positions.len(), 1.0);
        all
    }

    /// Gives all vertices that have no opacity yet this one.
    pub fn fade(&mut self, opacity: f32) {
        self.opacities.resize(self.positions.len(), opacity);
    }

    /// Adds another mesh's triangles.
    pub fn append(&mut self, other: &Self) {
        let base = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.normals.extend_from_slice(&other.normals);
        self.colours.extend_from_slice(&other.colours);
        if !other.opacities.is_empty() {
            self.opacities.resize(base as usize, 1.0);
            self.opacities.extend_from_slice(&other.opacities);
        }
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|i| base + i)));
    }

    /// Drops triangles without area, which nothing can hit and which have no normal. Corners that
    /// are not finite count as such.
    pub fn drop_degenerate(&mut self) {
        let positions = &self.positions;
        self.triangles.retain(|t| {
            let [a, b, c] = t.map(|i| positions[i as usize].as_dvec3());
            let area = (b - a).cross(c - a).length_squared();
            area.is_finite() && area > 0.0
        });
    }

    /// Normals from the triangles that share a vertex, each weighted by its angle there.
    pub fn compute_normals(&mut self) {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        for t in &self.triangles {
            let corners = t.map(|i| self.positions[i as usize]);
            let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let Some(face) = face.try_normalize() else {
                continue;
            };
            for k in 0..3 {
                let (u, v) = (
                    corners[(k + 1) % 3] - corners[k],
                    corners[(k + 2) % 3] - corners[k],
                );
                sums[t[k] as usize] += face * u.angle_between(v);
            }
        }
        self.normals = sums
            .iter()
            .map(|n| n.try_normalize().unwrap_or(Vec3::Y))
            .collect();
    }

    /// Moves the mesh. A transform that mirrors also turns the triangles round, so that front
    /// faces stay in front.
    pub fn transform(&mut self, by: &Affine3A) {
        // Cofactors: the inverse transpose but for a factor, and defined for every matrix.
        let m = by.matrix3;
        let cofactors = Mat3A::from_cols(
            m.y_axis.cross(m.z_axis),
            m.z_axis.cross(m.x_axis),
            m.x_axis.cross(m.y_axis),
        );
        let mirrored = m.determinant() < 0.0;
        for p in &mut self.positions {
            *p = by.transform_point3(*p);
        }
        for n in &mut self.normals {
            let turned = cofactors * *n;
            *n = (if mirrored { -turned } else { turned })
                .try_normalize()
                .unwrap_or(Vec3::Y);
        }
        if mirrored {
            for t in &mut self.triangles {
                t.swap(1, 2);
            }
        }
    }

    /// Colours all vertices that have no colour yet.
    pub fn paint(&mut self, colour: Vec3) {
        self.colours.resize(self.positions.len(), colour);
    }

    /// Adds a flat polygon with four corners, counter-clockwise as seen from its front.
    pub fn quad(&mut self, corners: [Vec3; 4]) {
        let normal = (corners[1] - corners[0]).cross(corners[3] - corners[0]);
        self.quad_with_normal(corners, normal.try_normalize().unwrap_or(Vec3::Y));
    }

    /// Adds a flat polygon with four corners that is shaded with the given unit normal.
    pub fn quad_with_normal(&mut self, corners: [Vec3; 4], normal: Vec3) {
        let base = self.positions.len() as u32;
        self.positions.extend(corners);
        self.normals.extend([normal; 4]);
        self.triangles
            .extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }

    /// Adds a box with the given middle; `axes` are its three half edges, at right angles.
    pub fn block(&mut self, centre: Vec3, axes: [Vec3; 3]) {
        let [x, y, z] = axes;
        for (n, u, v) in [(x, y, z), (y, z, x), (z, x, y)] {
            for side in [1.0, -1.0] {
                let (n, u) = (n * side, u * side);
                self.quad([
                    centre + n - u - v,
                    centre + n + u - v,
                    centre + n + u + v,
                    centre + n - u + v,
                ]);
            }
        }
    }

    /// Adds a box along the axes.
    pub fn aligned_block(&mut self, low: Vec3, high: Vec3) {
        let half = (high - low) * 0.5;
        self.block(
            (low + high) * 0.5,
            [Vec3::X * half.x, Vec3::Y * half.y, Vec3::Z * half.z],
        );
    }

    /// Adds a round rod between two points, with smooth normals and open ends.
    pub fn rod(&mut self, from: Vec3, to: Vec3, radius: f32, sides: u32) {
        let Some(along) = (to - from).try_normalize() else {
            return;
        };
        let (u, v) = along.any_orthonormal_pair();
        let base = self.positions.len() as u32;
        for i in 0..sides {
            let (sin, cos) = (i as f32 / sides as f32 * std::f32::consts::TAU).sin_cos();
            let normal = u * cos + v * sin;
            for end in [from, to] {
                self.positions.push(end + normal * radius);
                self.normals.push(normal);
            }
        }
        for i in 0..sides {
            let (a, b) = (base + 2 * i, base + 2 * ((i + 1) % sides));
            self.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        }
    }

    /// Adds a sphere of `rings` rings with smooth normals.
    pub fn sphere(&mut self, centre: Vec3, radius: f32, rings: u32) {
        let base = self.positions.len() as u32;
        let sectors = 2 * rings;
        for i in 0..=rings {
            // The poles are points and the seam closes: a ray finds no gap.
            let (sin_t, cos_t) = match i {
                0 => (0.0, 1.0),
                _ if i == rings => (0.0, -1.0),
                _ => (i as f32 / rings as f32 * std::f32::consts::PI).sin_cos(),
            };
            for j in 0..=sectors {
                let turn = (j % sectors) as f32 / sectors as f32;
                let (sin_p, cos_p) = (turn * std::f32::consts::TAU).sin_cos();
                let normal = Vec3::new(sin_t * sin_p, cos_t, sin_t * cos_p);
                self.positions.push(centre + normal * radius);
                self.normals.push(normal);
            }
        }
        let row = sectors + 1;
        for i in 0..rings {
            for j in 0..sectors {
                let a = base + i * row + j;
                if i > 0 {
                    self.triangles.push([a, a + row, a + 1]);
                }
                if i + 1 < rings {
                    self.triangles.push([a + 1, a + row, a + row + 1]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Six times the volume that the triangles enclose: positive where they face outwards.
    fn volume(mesh: &Mesh) -> f32 {
        (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                a.dot(b.cross(c))
            })
            .sum()
    }

    #[test]
    fn solids_face_outwards() {
        let mut block = Mesh::default();
        block.aligned_block(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0));
        assert!((volume(&block) - 36.0).abs() < 1e-4);
        let mut sphere = Mesh::default();
        sphere.sphere(Vec3::ZERO, 1.0, 32);
        assert!((volume(&sphere) / 6.0 - 4.19).abs() < 0.05);
        let mut rod = Mesh::default();
        rod.rod(Vec3::ZERO, Vec3::Y, 1.0, 64);
        for t in 0..rod.triangles.len() {
            let [a, b, c] = rod.corners(t);
            let outward = (a + b + c) * Vec3::new(1.0, 0.0, 1.0);
            assert!((b - a).cross(c - a).dot(outward) > 0.0);
        }
    }

    #[test]
    fn computed_normals_are_those_of_a_sphere() {
        let mut sphere = Mesh::default();
        sphere.sphere(Vec3::ZERO, 1.0, 32);
        let exact = sphere.normals.clone();
        sphere.compute_normals();
        for &i in sphere.indices() {
            let (n, e) = (sphere.normals[i as usize], exact[i as usize]);
            assert!(n.dot(e) > 0.99, "{n} {e}");
        }
    }

    #[test]
    fn a_mirror_keeps_fronts_in_front() {
        let mut mesh = Mesh::default();
        mesh.sphere(Vec3::ZERO, 1.0, 8);
        let before = volume(&mesh);
        mesh.transform(&Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)));
        assert!((volume(&mesh) - before).abs() < 1e-4);
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            assert!(p.dot(*n) > 0.9);
        }
    }

    #[test]
    fn translucent_triangles_come_from_the_farthest_to_the_nearest() {
        let mut mesh = Mesh::default();
        let pane = |y: f32| {
            [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]].map(|[x, z]| Vec3::new(x, y, z))
        };
        mesh.quad(pane(0.0));
        assert!(mesh.translucent().is_empty());
        mesh.fade(1.0);
        for y in [2.0, 1.0, 3.0] {
            mesh.quad(pane(y));
            mesh.fade(0.5);
        }
        mesh.quad(pane(4.0));
        assert_eq!(
            mesh.opaque(),
            [[0, 1, 2], [0, 2, 3], [16, 17, 18], [16, 18, 19]]
        );
        let heights = |direction: Vec3| -> Vec<f32> {
            let triangles = mesh.translucent_along(direction);
            triangles
                .iter()
                .map(|t| mesh.positions[t[0] as usize].y)
                .collect()
        };
        assert_eq!(heights(Vec3::NEG_Y), [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
        assert_eq!(heights(Vec3::Y), [3.0, 3.0, 2.0, 2.0, 1.0, 1.0]);
        assert_eq!(mesh.all_opacities()[..5], [1.0, 1.0, 1.0, 1.0, 0.5]);
        assert_eq!(mesh.all_opacities()[16..], [1.0; 4]);
        // What is added to an opaque mesh keeps its opacity.
        let mut ground = Mesh::default();
        ground.quad(pane(-1.0));
        ground.append(&mesh);
        assert_eq!(ground.opaque().len(), 6);
        assert_eq!(ground.translucent().len(), 6);
    }

    #[test]
    fn triangles_without_area_go() {
        let mut mesh = Mesh::default();
        mesh.quad([Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y]);
        mesh.triangles.extend([[0, 0, 1], [1, 1, 1]]);
        mesh.positions[3] = Vec3::NAN;
        mesh.drop_degenerate();
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }
}
