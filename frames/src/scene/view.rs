//! From the world to clip space: x to the right and y up from -1 to 1, depth from 0 (near) to 1.

use hankel_dsl::glam::camera::rh::proj::directx::perspective;
use hankel_dsl::glam::camera::rh::view::look_at_mat4;
use hankel_dsl::glam::{Mat4, Vec3, Vec4};

use super::Camera;
use super::mesh::Mesh;

/// What the camera sees of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// From the world to clip space, perspective.
    pub clip_from_world: Mat4,
    /// Where the camera is.
    pub eye: Vec3,
}

/// What a directional light sees of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightView {
    /// From the world to clip space, orthographic: depth is linear, and all of the mesh lies
    /// strictly within.
    pub clip_from_world: Mat4,
    /// The way the light goes; unit length.
    pub direction: Vec3,
    /// What depth 0 to 1 is in world units.
    pub depth: f32,
    /// Edge of a texel in world units, along the map's x and y.
    pub texel: [f32; 2],
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
        Self {
            clip_from_world: perspective(fov, aspect, near, far)
                * look_at_mat4(camera.eye, camera.target, camera.up),
            eye: camera.eye,
        }
    }
}

impl LightView {
    /// The tightest box around the mesh that goes along the light, with `margin` texels of a map
    /// of `size` texels left free at each side for the filter.
    #[must_use]
    pub fn new(direction: Vec3, mesh: &Mesh, size: u32, margin: u32) -> Self {
        let direction = direction.normalize();
        // Texel rows along the world's axes where that can be: edges of buildings alias less.
        let reference = if direction.y.abs() < 0.99 {
            Vec3::Y
        } else {
            Vec3::Z
        };
        let right = direction.cross(reference).normalize();
        let up = right.cross(direction);
        let axes = [right, up, direction].map(|a| a.as_dvec3());
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for p in &mesh.positions {
            for (i, axis) in axes.iter().enumerate() {
                let x = p.as_dvec3().dot(*axis);
                low[i] = low[i].min(x);
                high[i] = high[i].max(x);
            }
        }
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
            direction,
            depth: extent[2] as f32,
            texel: [0, 1].map(|i| (extent[i] / f64::from(size)) as f32),
        }
    }
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
}
