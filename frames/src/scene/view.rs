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
    let world_from_clip = clip_from_world.transpose();
    cut(&CLIP.map(|plane| world_from_clip * plane), corners)
}

/// The corners of what is left of a convex polygon where the product with no plane is negative: at least three, or
/// none.
fn cut(planes: &[DVec4], mut polygon: Vec<DVec3>) -> Vec<DVec3> {
    for plane in planes {
        let mut within = Vec::with_capacity(polygon.len() + 1);
        for (i, b) in polygon.iter().enumerate() {
            let a = &polygon[(i + polygon.len() - 1) % polygon.len()];
            let (da, db) = (plane.dot(a.extend(1.0)), plane.dot(b.extend(1.0)));
            if (da < 0.0) != (db < 0.0) {
                within.push(a.lerp(*b, da / (da - db)));
            }
            if db >= 0.0 {
                within.push(*b);
            }
        }
        polygon = within;
    }
    polygon
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

    /// Its middle along an axis, and half its width.
    fn middle(&self, i: usize) -> (f64, f64) {
        let [low, high] = [self.low[i], self.high[i]];
        (0.5 * (high + low), 0.5 * (high - low))
    }

    /// Whether nothing is within. A plane across an axis is something.
    fn is_empty(&self) -> bool {
        self.low[2] > self.high[2]
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

    /// The same around what a camera sees of the mesh, be it hidden or not, and around all that lies between that and
    /// a light of this half width, the tangent of an angle. Towards the light the box goes as far as what may cast
    /// shadows into it. Without anything that the camera sees, as [`LightView::new`].
    #[must_use]
    pub fn fitted(
        direction: Vec3,
        mesh: &Mesh,
        size: u32,
        margin: u32,
        camera: &CameraView,
        radius: f32,
    ) -> Self {
        let axes = axes(direction);
        let mut seen = Extent::NONE;
        for t in 0..mesh.triangles.len() {
            seen.and(&Extent::of(&axes, camera.clipped(mesh.corners(t))));
        }
        Self::around(axes, seen, mesh, size, margin, radius)
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
        radius: f32,
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
        Self::around(axes, seen, mesh, size, margin, radius)
    }

    /// Around what is seen, and towards the light around what may cast shadows there.
    fn around(
        axes: [DVec3; 3],
        mut seen: Extent,
        mesh: &Mesh,
        size: u32,
        margin: u32,
        radius: f32,
    ) -> Self {
        if seen.is_empty() {
            let points = mesh.positions.iter().map(|p| p.as_dvec3());
            return Self::of(axes, Extent::of(&axes, points), size, margin);
        }
        if radius > 0.0 {
            let planes = between(&axes, &seen, f64::from(radius));
            let polygons = all(mesh).map(|corners| cut(&planes, corners));
            seen.and(&Extent::of(&axes, polygons.flatten()));
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

/// All triangles of a mesh.
fn all(mesh: &Mesh) -> impl Iterator<Item = Vec<DVec3>> {
    (0..mesh.triangles.len()).map(|t| mesh.corners(t).map(Vec3::as_dvec3).to_vec())
}

/// Planes around the places that may hide a part of a directional light from something within `seen`. A light of this
/// half width is seen from a receiver through a region that is as much wider than a point as it is before the
/// receiver, times the half width; no receiver is farther than the far end of `seen`.
fn between(axes: &[DVec3; 3], seen: &Extent, radius: f64) -> [DVec4; 5] {
    let (along, far) = (axes[2], seen.high[2]);
    let aside = |i: usize, side: f64| {
        let (middle, half) = seen.middle(i);
        let offset = half + side * middle + radius * far;
        (axes[i] * -side - along * radius).extend(offset)
    };
    [
        aside(0, 1.0),
        aside(0, -1.0),
        aside(1, 1.0),
        aside(1, -1.0),
        (-along).extend(far),
    ]
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
    /// Planes around the places that may hide a part of a light of half width `radius` from something within
    /// `receivers`. Towards the light, the regions that receivers see it through end in the light, not in its middle:
    /// at a distance z they are wider by half its width times 1 - z / far.
    fn between(&self, receivers: &Extent, radius: f64) -> [DVec4; 6] {
        let along = self.axes[2];
        let (near, far) = (self.within.low[2], receivers.high[2]);
        let plane = |normal: DVec3, offset: f64| normal.extend(offset - normal.dot(self.position));
        let aside = |i: usize, side: f64| {
            let (middle, half) = receivers.middle(i);
            let slope = half + side * middle - radius / far;
            plane(along * slope - self.axes[i] * side, radius)
        };
        [
            aside(0, 1.0),
            aside(0, -1.0),
            aside(1, 1.0),
            aside(1, -1.0),
            plane(along, -near),
            plane(-along, far),
        ]
    }

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
        self.extent_of(polygons.flat_map(|polygon| clipped(&clip, polygon)))
    }

    /// What these places, all before the light, lie between.
    fn extent_of(&self, places: impl Iterator<Item = DVec3>) -> Extent {
        let mut extent = Extent::NONE;
        for place in places {
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
    /// only what `camera` sees of it, if there is one, and what may cast shadows on that. What lies between that and
    /// all of the light is there as well, `radius` being half the width of the light: also outside of the cone, as seen
    /// from the light's middle, but not farther aside than in the widest cone. Its depths are those of the projection,
    /// as a rasteriser has them, and reach from the first caster to the last receiver. Without anything within the cone,
    /// depths do not matter. Where the camera sees nothing of what is there, it is as without a camera.
    #[must_use]
    pub fn spot(
        spot: &Spot,
        mesh: &Mesh,
        size: u32,
        margin: u32,
        camera: Option<&CameraView>,
        radius: f32,
    ) -> Self {
        let axes = axes(spot.direction);
        let position = spot.position.as_dvec3();
        let from = mesh.positions.iter().map(|p| p.as_dvec3() - position);
        let reach = from.map(DVec3::length).fold(f64::MIN_POSITIVE, f64::max);
        let half = |degrees: f32| (0.5 * f64::from(degrees).to_radians()).tan();
        let tangent = half(spot.angle);
        let mut frustum = Frustum {
            axes,
            position,
            within: Extent {
                low: [-tangent, -tangent, reach * NEAREST],
                high: [tangent, tangent, reach * 1.01],
            },
        };
        let seen = camera.map(|camera| {
            let clip = camera.clip_from_world.as_dmat4();
            frustum.extent(all(mesh).map(|corners| clipped(&clip, corners)))
        });
        let seen = seen.filter(|seen| !seen.is_empty());
        let receivers = seen.unwrap_or_else(|| frustum.extent(all(mesh)));
        if !receivers.is_empty() {
            if seen.is_some() {
                // A map without an extent has no texels.
                let least = tangent * 1e-3;
                for i in 0..2 {
                    let (middle, half) = receivers.middle(i);
                    let half = half.max(least);
                    frustum.within.low[i] = middle - half;
                    frustum.within.high[i] = middle + half;
                }
            }
            if radius > 0.0 {
                let planes = frustum.between(&receivers, f64::from(radius));
                let casters = all(mesh).flat_map(|corners| cut(&planes, corners));
                let casters = frustum.extent_of(casters);
                // In a map that is wider still, what is before the light has hardly a texel.
                let widest = half(Spot::MAX_ANGLE);
                for i in 0..2 {
                    let Extent { low, high } = &mut frustum.within;
                    low[i] = low[i].min(casters.low[i].max(-widest));
                    high[i] = high[i].max(casters.high[i].min(widest));
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
        let casters = frustum.extent(all(mesh));
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
            LightView::fitted(direction, &mesh, 256, 4, &view, 0.0),
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
        assert_eq!(
            LightView::fitted(direction, &mesh, 256, 4, &view, 0.1),
            whole
        );
    }

    /// A lid above a floor that is much larger than what the camera sees of it.
    fn lid() -> (Mesh, CameraView) {
        let mut mesh = Mesh::default();
        for (half, y) in [(4.0, 0.0), (1.2, 3.0)] {
            let corners = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
            mesh.quad(corners.map(|[x, z]| Vec3::new(half * x, y, half * z)));
            mesh.paint(Vec3::ONE);
        }
        let camera = Camera {
            eye: Vec3::new(0.4, 2.0, 0.01),
            target: Vec3::new(0.4, 0.0, 0.0),
            up: Vec3::Y,
            fov: 30.0,
        };
        let view = CameraView::new(&camera, &mesh, 1.5);
        (mesh, view)
    }

    /// How many ways from what a camera sees to a grid of points of a light end in the mesh; the map holds where. `ways`
    /// are those from a place.
    fn held(
        light: &LightView,
        mesh: &Mesh,
        camera: &CameraView,
        ways: impl Fn(DVec3) -> Vec<DVec3>,
    ) -> usize {
        use crate::visibility::cast::{Caster, Lens, Segment};
        let (width, height) = (24, 16);
        let lens = Lens::new(camera.clip_from_world, width, height);
        let caster = Caster::of(mesh);
        let mut hidden = 0;
        for i in 0..width * height {
            let segment = lens.segment([i % width, i / width], [0.5, 0.5]);
            let Some(hit) = caster.first(&segment) else {
                continue;
            };
            let place = segment.at(hit.t);
            for way in ways(place) {
                let segment = Segment::new(place + way * 1e-6, way);
                let Some(hit) = caster.first(&segment) else {
                    continue;
                };
                let place = segment.at(hit.t).as_vec3();
                let clip = light.clip_from_world.project_point3(place);
                let is_held = clip.x.abs() <= 1.0 && clip.y.abs() <= 1.0;
                assert!(is_held && clip.z > 0.0 && clip.z < 1.0, "{place} {clip}");
                hidden += 1;
            }
        }
        hidden
    }

    const GRID: [f64; 5] = [-1.0, -0.6, 0.0, 0.7, 1.0];

    #[test]
    fn a_fitted_map_holds_what_hides_any_part_of_a_directional_light() {
        let (mesh, view) = lid();
        let direction = Vec3::new(0.1, -1.0, 0.05);
        let [right, up, along] = axes(direction);
        let radius = 0.3;
        let of = |radius: f32| LightView::fitted(direction, &mesh, 256, 4, &view, radius);
        let (point, area) = (of(0.0), of(radius));
        let ways = |_| {
            let way = |x: f64, y: f64| (right * x + up * y) * f64::from(radius) - along;
            let rows = GRID.iter().map(|y| GRID.map(|x| way(x, *y) * 100.0));
            rows.flatten().collect()
        };
        let hidden = held(&area, &mesh, &view, ways);
        assert!(hidden > 5000, "{hidden}");
        // Not more than that, and never more than all.
        let whole = LightView::new(direction, &mesh, 256, 4);
        for i in 0..2 {
            assert!(area.texel[i] > point.texel[i] && area.texel[i] < 0.5 * whole.texel[i]);
            let wide = LightView::fitted(direction, &mesh, 256, 4, &view, 100.0);
            assert!(wide.texel[i] <= whole.texel[i] * 1.000_01);
        }
    }

    #[test]
    fn a_map_holds_what_hides_any_part_of_a_spot_light() {
        let (mesh, view) = lid();
        let spot = Spot {
            position: Vec3::new(0.0, 9.0, 0.0),
            direction: Vec3::new(0.0, -1.0, 0.01).normalize(),
            angle: 20.0,
            inner: 10.0,
        };
        let [right, up, _] = axes(spot.direction);
        let radius = 4.0;
        let ways = |place: DVec3| {
            let way = |x: f64, y: f64| {
                let light = spot.position.as_dvec3() + (right * x + up * y) * f64::from(radius);
                light - place
            };
            let rows = GRID.iter().map(|y| GRID.map(|x| way(x, *y)));
            rows.flatten().collect()
        };
        let of = |camera: Option<&CameraView>, radius| {
            LightView::spot(&spot, &mesh, 256, 4, camera, radius)
        };
        for camera in [None, Some(&view)] {
            let light = of(camera, radius);
            let hidden = held(&light, &mesh, &view, ways);
            assert!(hidden > 4000, "{hidden}");
        }
        // A fitted map is never the coarser one.
        for radius in [0.0, 0.5, radius, 100.0] {
            let (whole, fitted) = (of(None, radius), of(Some(&view), radius));
            for i in 0..2 {
                assert!(fitted.texel[i] <= whole.texel[i] * 1.000_01, "{radius}");
            }
        }
    }

    /// All that a lamp shines on is equally far from it here.
    #[test]
    fn a_map_of_a_floor_below_a_lamp_is_fitted() {
        let mesh = Procedural::Empty.mesh();
        let camera = Camera {
            eye: Vec3::new(0.3, 2.0, 0.01),
            target: Vec3::new(0.3, 0.0, 0.0),
            up: Vec3::Y,
            fov: 20.0,
        };
        let view = CameraView::new(&camera, &mesh, 1.5);
        let spot = Spot {
            position: Vec3::new(0.0, 3.0, 0.0),
            direction: Vec3::NEG_Y,
            angle: 60.0,
            inner: 50.0,
        };
        let of = |camera| LightView::spot(&spot, &mesh, 256, 4, camera, 0.0);
        let (whole, fitted) = (of(None), of(Some(&view)));
        for i in 0..2 {
            assert!(
                fitted.texel[i] < 0.5 * whole.texel[i],
                "{fitted:?} {whole:?}"
            );
        }
        // What is three off is all that there is.
        let end = whole.near.unwrap() + whole.depth;
        assert!(end < 3.1, "{end}");
        // A camera that sees nothing of it.
        let away = Camera {
            eye: Vec3::new(0.0, 3.0, 6.0),
            target: Vec3::new(0.0, 5.0, 12.0),
            ..camera
        };
        let blind = CameraView::new(&away, &mesh, 1.5);
        assert_eq!(of(Some(&blind)), whole);
    }
}
