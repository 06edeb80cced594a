//! From the world to clip space: x to the right and y up from -1 to 1, depth from 0 (near) to 1.

use hankel_dsl::glam::camera::rh::proj::directx::perspective;
use hankel_dsl::glam::camera::rh::view::look_at_mat4;
use hankel_dsl::glam::{DMat4, DVec3, DVec4, Mat4, Vec3, Vec4};

use super::mesh::Mesh;
use super::{Camera, Spot};

/// What the camera sees of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// From the world to clip space, perspective.
    pub clip_from_world: Mat4,
    /// Where the camera is.
    pub eye: Vec3,
    /// To the middle of the picture's right edge, to that of its upper edge, and to its middle, all at a distance
    /// of 1 along the view; the first two from the third.
    pub axes: [Vec3; 3],
    /// Distances of the near and of the far plane along the view.
    pub range: [f32; 2],
}

/// What a light sees of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightView {
    /// From the world to clip space. Of a directional light it is orthographic: depth is linear, and all of the
    /// mesh lies strictly within. Of a spot light it is perspective, and holds what lies within the cone.
    pub clip_from_world: Mat4,
    /// The way the light goes; unit length.
    pub direction: Vec3,
    /// What depth 0 to 1 is in world units.
    pub depth: f32,
    /// By how much the depth changes from 0 to 1 where w is 1, as a multiple of how it changes on the mean: 1 of an
    /// orthographic view. It falls with the square of w.
    pub slope: f32,
    /// Edge of a texel in world units, along the map's x and y; of a spot light at the far end of its depth.
    pub texel: [f32; 2],
    /// How far off depth 0 is along a spot light's axis; `None` of a directional light.
    pub near: Option<f32>,
}

impl CameraView {
    /// A view of the whole mesh: near and far planes hold all of it that lies before the camera.
    /// `aspect` is width over height.
    #[must_use]
    pub fn new(camera: &Camera, mesh: &Mesh, aspect: f32) -> Self {
        let forward = (camera.target - camera.eye).normalize();
        let mut near = f32::INFINITY;
        let mut far = 0.0_f32;
        for p in &mesh.positions {
            let depth = (*p - camera.eye).dot(forward);
            near = near.min(depth);
            far = far.max(depth);
        }
        // A mesh behind the camera, or one around it.
        let far = if far > 0.0 { far * 1.001 } else { 1.0 };
        let near = near.min(far * 0.5).max(far * 1e-4) * 0.999;
        let fov = camera.fov.to_radians();
        let half = (0.5 * fov).tan();
        let right = forward.cross(camera.up).normalize();
        Self {
            axes: [
                right * (half * aspect),
                right.cross(forward) * half,
                forward,
            ],
            range: [near, far],
            clip_from_world: perspective(fov, aspect, near, far)
                * look_at_mat4(camera.eye, camera.target, camera.up),
            eye: camera.eye,
        }
    }
}

/// Planes that bound clip space: a point is within where its product with none is negative.
const CLIP: [DVec4; 6] = [
    DVec4::new(1.0, 0.0, 0.0, 1.0),
    DVec4::new(-1.0, 0.0, 0.0, 1.0),
    DVec4::new(0.0, 1.0, 0.0, 1.0),
    DVec4::new(0.0, -1.0, 0.0, 1.0),
    DVec4::new(0.0, 0.0, 1.0, 0.0),
    DVec4::new(0.0, 0.0, -1.0, 1.0),
];

impl CameraView {
    /// From the camera to the corners of its far plane, one after the other around it.
    #[must_use]
    pub fn far_corners(&self) -> [DVec3; 4] {
        let [right, up, forward] = self.axes.map(Vec3::as_dvec3);
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| (forward + right * x + up * y) * f64::from(self.range[1]))
    }

    /// The corners of what is left of a triangle within the view: at least three, or none.
    #[must_use]
    pub fn clipped(&self, corners: [Vec3; 3]) -> Vec<DVec3> {
        let corners = corners.map(Vec3::as_dvec3);
        clipped(&self.clip_from_world.as_dmat4(), corners.to_vec())
    }
}

/// The corners of what is left of a convex polygon within a view: at least three, or none.
fn clipped(clip_from_world: &DMat4, corners: Vec<DVec3>) -> Vec<DVec3> {
    let corners = corners.into_iter();
    let mut polygon: Vec<(DVec3, DVec4)> = corners
        .map(|p| (p, *clip_from_world * p.extend(1.0)))
        .collect();
    for plane in CLIP {
        let mut within = Vec::with_capacity(polygon.len() + 1);
        for (i, b) in polygon.iter().enumerate() {
            let a = &polygon[(i + polygon.len() - 1) % polygon.len()];
            let (da, db) = (plane.dot(a.1), plane.dot(b.1));
            if (da < 0.0) != (db < 0.0) {
                let t = da / (da - db);
                within.push((a.0.lerp(b.0, t), a.1.lerp(b.1, t)));
            }
            if db >= 0.0 {
                within.push(*b);
            }
        }
        polygon = within;
    }
    polygon.into_iter().map(|(p, _)| p).collect()
}

/// A box along three axes, empty at first.
#[derive(Clone, Copy)]
struct Extent {
    low: [f64; 3],
    high: [f64; 3],
}

impl Extent {
    const NONE: Self = Self {
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };

    fn of(axes: &[DVec3; 3], points: impl IntoIterator<Item = DVec3>) -> Self {
        let mut this = Self::NONE;
        for p in points {
            for (i, axis) in axes.iter().enumerate() {
                let x = p.dot(*axis);
                this.low[i] = this.low[i].min(x);
                this.high[i] = this.high[i].max(x);
            }
        }
        this
    }

    fn and(&mut self, other: &Self) {
        for i in 0..3 {
            self.low[i] = self.low[i].min(other.low[i]);
            self.high[i] = self.high[i].max(other.high[i]);
        }
    }
}

impl LightView {
    /// The tightest box around the mesh that goes along the light, with `margin` texels of a map
    /// of `size` texels left free at each side for the filter.
    #[must_use]
    pub fn new(direction: Vec3, mesh: &Mesh, size: u32, margin: u32) -> Self {
        let axes = axes(direction);
        let points = mesh.positions.iter().map(|p| p.as_dvec3());
        Self::of(axes, Extent::of(&axes, points), size, margin)
    }

    /// The same around what a camera sees of the mesh, be it hidden or not. Towards the light the box
    /// goes as far as what may cast shadows into it. Without anything that the camera sees, as
    /// [`LightView::new`].
    #[must_use]
    pub fn fitted(
        direction: Vec3,
        mesh: &Mesh,
        size: u32,
        margin: u32,
        camera: &CameraView,
    ) -> Self {
        let axes = axes(direction);
        let mut seen = Extent::NONE;
        for t in 0..mesh.triangles.len() {
            seen.and(&Extent::of(&axes, camera.clipped(mesh.corners(t))));
        }
        Self::around(axes, seen, mesh, size, margin)
    }

    /// The same around all that a camera sees through, from itself to its far plane, as far as the mesh could cast
    /// shadows there.
    #[must_use]
    pub fn fitted_to_space(
        direction: Vec3,
        mesh: &Mesh,
        size: u32,
        margin: u32,
        camera: &CameraView,
    ) -> Self {
        let axes = axes(direction);
        let eye = camera.eye.as_dvec3();
        let corners = camera.far_corners().map(|q| eye + q);
        let mut seen = Extent::of(&axes, corners.into_iter().chain([eye]));
        let all = Extent::of(&axes, mesh.positions.iter().map(|p| p.as_dvec3()));
        for i in 0..3 {
            seen.low[i] = seen.low[i].max(all.low[i]);
            seen.high[i] = seen.high[i].min(all.high[i]);
        }
        if (0..3).any(|i| seen.low[i] > seen.high[i]) {
            seen = Extent::NONE;
        }
        Self::around(axes, seen, mesh, size, margin)
    }

    /// Around what is seen, and towards the light around what may cast shadows there.
    fn around(axes: [DVec3; 3], mut seen: Extent, mesh: &Mesh, size: u32, margin: u32) -> Self {
        if seen.low[0] > seen.high[0] {
            let points = mesh.positions.iter().map(|p| p.as_dvec3());
            return Self::of(axes, Extent::of(&axes, points), size, margin);
        }
        // With the filter's margin.
        let free = f64::from(margin) / f64::from(size);
        let reach = [0, 1].map(|i| (seen.high[i] - seen.low[i]) * (0.5 + 2.0 * free));
        let middle = [0, 1].map(|i| 0.5 * (seen.high[i] + seen.low[i]));
        for t in 0..mesh.triangles.len() {
            let caster = Extent::of(&axes, mesh.corners(t).map(Vec3::as_dvec3));
            let overlaps = |i: usize| {
                caster.low[i] <= middle[i] + reach[i] && caster.high[i] >= middle[i] - reach[i]
            };
            if overlaps(0) && overlaps(1) {
                seen.low[2] = seen.low[2].min(caster.low[2]);
            }
        }
        Self::of(axes, seen, size, margin)
    }

    fn of(axes: [DVec3; 3], Extent { low, high }: Extent, size: u32, margin: u32) -> Self {
        // No extent, none to divide by; f32 coordinates tell nothing below their own step.
        let largest = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
        let at_least = f64::max(largest * 1e-3, f64::MIN_POSITIVE);
        let free = f64::from(margin.min(size / 4)) / f64::from(size);
        let mut rows = [Vec4::W; 3];
        let mut extent = [0.0; 3];
        for i in 0..3 {
            let middle = 0.5 * (low[i] + high[i]);
            // Depths keep off 0 and 1, where rounding could put a receiver beyond the map.
            let widen = if i == 2 {
                1.01
            } else {
                1.0 / (1.0 - 2.0 * free)
            };
            extent[i] = (high[i] - low[i]).max(at_least) * widen;
            let (scale, shift) = if i == 2 { (1.0, 0.5) } else { (2.0, 0.0) };
            let row = axes[i] * (scale / extent[i]);
            let offset = shift - middle * scale / extent[i];
            rows[i] = row.as_vec3().extend(offset as f32);
        }
        Self {
            clip_from_world: Mat4::from_cols(rows[0], rows[1], rows[2], Vec4::W).transpose(),
            direction: axes[2].as_vec3(),
            depth: extent[2] as f32,
            slope: 1.0,
            texel: [0, 1].map(|i| (extent[i] / f64::from(size)) as f32),
            near: None,
        }
    }
}

/// A spot light's near plane is no nearer than this share of the scene's size: what is nearer to it casts no shadow.
const NEAREST: f64 = 1e-3;
/// What lies within the map keeps off depths 0 and 1 by this much, as with a directional light: moments close to the
/// ends are delicate, and rounding puts nothing beyond them.
const SPARE: f64 = 0.005;

/// A frustum of a spot light: tangents to the right and up, and distances along its axis.
struct Frustum {
    axes: [DVec3; 3],
    position: DVec3,
    within: Extent,
}

impl Frustum {
    /// Coordinates as in `within`.
    fn seen(&self, place: DVec3) -> [f64; 3] {
        let [x, y, z] = self.axes.map(|axis| axis.dot(place - self.position));
        [x / z, y / z, z]
    }

    fn clip_from_world(&self) -> DMat4 {
        let Extent { low, high } = self.within;
        let [right, up, along] = self.axes;
        let row = |axis: DVec3, offset: f64| axis.extend(offset - axis.dot(self.position));
        let across = |i: usize, axis: DVec3| {
            let wide = high[i] - low[i];
            row(
                axis * (2.0 / wide) - along * ((high[i] + low[i]) / wide),
                0.0,
            )
        };
        let (near, far) = (low[2], high[2]);
        let rows = [
            across(0, right),
            across(1, up),
            row(along * (far / (far - near)), -far * near / (far - near)),
            row(along, 0.0),
        ];
        DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose()
    }

    /// What of these polygons lies within.
    fn extent(&self, polygons: impl Iterator<Item = Vec<DVec3>>) -> Extent {
        let clip = self.clip_from_world();
        let mut extent = Extent::NONE;
        for place in polygons.flat_map(|polygon| clipped(&clip, polygon)) {
            for (i, x) in self.seen(place).into_iter().enumerate() {
                extent.low[i] = extent.low[i].min(x);
                extent.high[i] = extent.high[i].max(x);
            }
        }
        extent
    }
}

impl LightView {
    /// What a spot light sees of a mesh within its cone, with `margin` texels left free at each side for the filter;
    /// only what `camera` sees of it, if there is one, and what may cast shadows on that. Its depths are those of
    /// the projection, as a rasteriser has them, and reach from the first caster to the last receiver. Without
    /// anything within the cone, depths do not matter.
    #[must_use]
    pub fn spot(
        spot: &Spot,
        mesh: &Mesh,
        size: u32,
        margin: u32,
        camera: Option<&CameraView>,
    ) -> Self {
        let axes = axes(spot.direction);
        let position = spot.position.as_dvec3();
        let from = mesh.positions.iter().map(|p| p.as_dvec3() - position);
        let reach = from.map(DVec3::length).fold(f64::MIN_POSITIVE, f64::max);
        let tangent = (0.5 * f64::from(spot.angle).to_radians()).tan();
        let mut frustum = Frustum {
            axes,
            position,
            within: Extent {
                low: [-tangent, -tangent, reach * NEAREST],
                high: [tangent, tangent, reach * 1.01],
            },
        };
        let all =
            || (0..mesh.triangles.len()).map(|t| mesh.corners(t).map(Vec3::as_dvec3).to_vec());
        let receivers = match camera {
            Some(camera) => {
                let clip = camera.clip_from_world.as_dmat4();
                frustum.extent(all().map(|corners| clipped(&clip, corners)))
            }
            None => frustum.extent(all()),
        };
        if receivers.low[2] < receivers.high[2] {
            if camera.is_some() {
                // A map without an extent has no texels.
                let least = tangent * 1e-3;
                for i in 0..2 {
                    let middle = 0.5 * (receivers.low[i] + receivers.high[i]);
                    let half = (0.5 * (receivers.high[i] - receivers.low[i])).max(least);
                    frustum.within.low[i] = middle - half;
                    frustum.within.high[i] = middle + half;
                }
            }
            frustum.within.high[2] = receivers.high[2] * 1.001;
        }
        let free = f64::from(margin.min(size / 4)) / f64::from(size);
        for i in 0..2 {
            let [low, high] = [frustum.within.low[i], frustum.within.high[i]];
            let widen = 0.5 * (high - low) * (1.0 / (1.0 - 2.0 * free) - 1.0);
            frustum.within.low[i] = low - widen;
            frustum.within.high[i] = high + widen;
        }
        // What lies between the light and the receivers. Depth is linear in the reciprocal of the distance.
        let casters = frustum.extent(all());
        let far = frustum.within.high[2];
        let near = casters.low[2].max(frustum.within.low[2]).min(far * 0.5);
        let spare = (1.0 / near - 1.0 / far) * SPARE / (1.0 - 2.0 * SPARE);
        frustum.within.low[2] = 1.0 / (1.0 / near + spare);
        frustum.within.high[2] = 1.0 / (1.0 / far - spare).max(0.5 / far);
        let Extent { low, high } = frustum.within;
        let depth = high[2] - low[2];
        Self {
            clip_from_world: frustum.clip_from_world().as_mat4(),
            direction: spot.direction,
            depth: depth as f32,
            slope: (low[2] * high[2]) as f32,
            texel: [0, 1].map(|i| ((high[i] - low[i]) * high[2] / f64::from(size)) as f32),
            near: Some(low[2] as f32),
        }
    }
}

/// To the right in the map, up in it, and the way the light goes.
fn axes(direction: Vec3) -> [DVec3; 3] {
    let direction = direction.normalize();
    // Texel rows along the world's axes where that can be: edges of buildings alias less.
    let reference = if direction.y.abs() < 0.99 {
        Vec3::Y
    } else {
        Vec3::Z
    };
    let right = direction.cross(reference).normalize();
    let up = right.cross(direction);
    [right, up, direction].map(|a| a.as_dvec3())
}

#[cfg(test)]
mod tests {
    use super::super::Procedural;
    use super::*;

    #[test]
    fn the_light_sees_all_and_leaves_the_margin() {
        let mesh = Procedural::Yard.mesh();
        let (size, margin) = (256, 8);
        for direction in [Vec3::NEG_Y, Vec3::new(1.0, -1.0, 0.5), Vec3::X] {
            let light = LightView::new(direction, &mesh, size, margin);
            let inner = 1.0 - 2.0 * margin as f32 / size as f32;
            let mut reached = 0.0_f32;
            for p in &mesh.positions {
                let clip = light.clip_from_world.project_point3(*p);
                assert!(clip.x.abs() <= inner + 1e-5 && clip.y.abs() <= inner + 1e-5);
                assert!(clip.z > 0.0 && clip.z < 1.0);
                reached = reached.max(clip.x.abs());
            }
            assert!(reached > inner - 1e-4);
            let step = light
                .clip_from_world
                .transform_vector3(light.direction * light.depth);
            assert!((step - Vec3::Z).length() < 1e-5);
        }
    }

    #[test]
    fn the_camera_sees_its_target_in_the_middle() {
        let mesh = Procedural::Box.mesh();
        let camera = Camera {
            eye: Vec3::new(3.0, 4.0, 5.0),
            target: Vec3::Y,
            up: Vec3::Y,
            fov: 40.0,
        };
        let view = CameraView::new(&camera, &mesh, 1.5);
        let middle = view.clip_from_world.project_point3(camera.target);
        assert!(middle.x.abs() < 1e-5 && middle.y.abs() < 1e-5);
        assert!(view.clip_from_world.project_point3(Vec3::Y * 1.5).y > 0.0);
        for p in &mesh.positions {
            let z = view.clip_from_world.project_point3(*p).z;
            assert!(z > 0.0 && z < 1.0, "{z}");
        }
    }

    #[test]
    fn a_fitted_light_sees_what_the_camera_sees_and_its_casters() {
        let mesh = Procedural::Columns.mesh();
        let camera = Camera {
            eye: Vec3::new(1.6, 4.0, 22.0),
            target: Vec3::new(-0.6, 0.0, 13.0),
            up: Vec3::Y,
            fov: 20.0,
        };
        let view = CameraView::new(&camera, &mesh, 1.5);
        let direction = Vec3::new(0.7, -0.6, -0.35);
        let (whole, fitted) = (
            LightView::new(direction, &mesh, 256, 4),
            LightView::fitted(direction, &mesh, 256, 4, &view),
        );
        assert!(fitted.texel[0] * fitted.texel[1] < 0.5 * whole.texel[0] * whole.texel[1]);
        assert!(fitted.depth <= whole.depth);
        let lens = crate::visibility::cast::Lens::new(view.clip_from_world, 48, 32);
        let caster = crate::visibility::cast::Caster::of(&mesh);
        let mut seen = 0;
        for i in 0..48 * 32 {
            let segment = lens.segment([i % 48, i / 48], [0.5, 0.5]);
            let Some(hit) = caster.first(&segment) else {
                continue;
            };
            seen += 1;
            let place = segment.at(hit.t).as_vec3();
            let clip = fitted.clip_from_world.project_point3(place);
            let inner = 1.0 - 8.0 / 256.0 + 1e-4;
            assert!(
                clip.x.abs() < inner && clip.y.abs() < inner,
                "{place} {clip}"
            );
            assert!(clip.z > 0.0 && clip.z < 1.0, "{place} {clip}");
            // What shades it lies within as well.
            let toward = -direction.as_dvec3() * 100.0;
            let away = segment.at(hit.t) + toward * 1e-6;
            let to_light = crate::visibility::cast::Segment::new(away, toward);
            if let Some(hit) = caster.first(&to_light) {
                let clip = fitted
                    .clip_from_world
                    .project_point3(to_light.at(hit.t).as_vec3());
                assert!(clip.z > 0.0, "{place} {clip}");
            }
        }
        assert!(seen > 800, "{seen}");
        // A camera that sees nothing.
        let away = Camera {
            eye: Vec3::new(1.6, 10.0, 22.0),
            target: Vec3::new(1.6, 60.0, 23.0),
            ..camera
        };
        let view = CameraView::new(&away, &mesh, 1.5);
        assert_eq!(LightView::fitted(direction, &mesh, 256, 4, &view), whole);
    }
}
