//! From a scene's medium to what the kernels of single scattering take.

use std::borrow::Cow;
use std::f64::consts::PI;

use hankel_dsl::glam::{DVec3, Vec3, Vec4};
use hankel_moments::{rectified_bounds, row_extinction, row_inclinations};
use hankel_shadows::scattering::{Medium, Rectified, View};

use crate::frame::{Show, camera_view};
use crate::graph::Graph;
use crate::passes::{Rectification, Volume};
use crate::scene::{CameraView, Light, LightView, Mesh, Scene, Source};

/// How much of a harmless distribution is mixed into means of moments: 32-bit sums of a few hundred of them
/// are rounded by some 1e-6.
const MOMENT_BIAS: f32 = 5e-6;

/// What kernels take.
pub(crate) struct Space {
    pub view: View,
    pub medium: Medium,
    /// Rays from the camera as rows of the shadow map, and what differs from row to row; of a directional light only.
    pub rectified: Option<(Rectified, Vec<Vec4>)>,
}

impl Space {
    /// Of a scene's camera and one of its lights, with what its map holds; `None` for a scene without a medium, and
    /// where what is shown is not behind it.
    pub fn of(
        scene: &Scene,
        light: &Light,
        light_view: &LightView,
        mesh: &Mesh,
        show: Show,
    ) -> Option<Self> {
        let medium = scene.medium.filter(|_| show != Show::Light)?;
        let camera = camera_view(scene, &scene.camera, mesh);
        let (source, anisotropy) = match show {
            // Surfaces take the irradiance as what a white one sends out: divided by π.
            Show::Picture => {
                let albedo = medium.scattering / medium.extinction;
                (albedo * PI as f32, medium.anisotropy)
            }
            // All that is scattered counts as 1.
            Show::Scattered | Show::Light => (4.0 * PI as f32, 0.0),
        };
        let rectified = match light.source {
            Source::Directional { .. } => {
                Some(rectified(scene, &camera, light_view, medium.extinction))
            }
            Source::Spot(_) => None,
        };
        Some(Self {
            view: view(&camera, [scene.width, scene.height]),
            medium: Medium {
                extinction: medium.extinction,
                source,
                anisotropy,
                steps: medium.steps,
            },
            rectified,
        })
    }

    /// `named` makes labels that tell lights apart.
    pub fn add_to(
        &self,
        graph: &mut Graph,
        named: &dyn Fn(&'static str) -> Cow<'static, str>,
    ) -> Volume {
        let view = graph.parameter(named("view"), &self.view);
        let medium = graph.parameter(named("medium"), &self.medium);
        let rectification = self
            .rectified
            .as_ref()
            .map(|(rectified, rows)| Rectification {
                rectified: graph.parameter(named("rectified"), rectified),
                rows: graph.buffer(named("rows"), rows),
                texels: [rectified.columns, rectified.rows],
            });
        Volume {
            view,
            medium,
            rectification,
            steps: self.medium.steps,
        }
    }
}

fn view(camera: &CameraView, size: [u32; 2]) -> View {
    let [right, up, forward] = camera.axes;
    let [width, height] = size.map(|n| n as f32);
    let [near, far] = camera.range.map(f64::from);
    let first = forward + right * (1.0 / width - 1.0) + up * (1.0 - 1.0 / height);
    View {
        eye: camera.eye.extend((1.0 / near) as f32),
        first: first.extend((1.0 / far - 1.0 / near) as f32),
        right: (right * (2.0 / width)).extend(0.0),
        down: (up * (-2.0 / height)).extend(0.0),
    }
}

/// The rectified map, which has as many texels as the shadow map, and its rows.
fn rectified(
    scene: &Scene,
    camera: &CameraView,
    light_view: &LightView,
    extinction: f32,
) -> (Rectified, Vec<Vec4>) {
    let clip = light_view.clip_from_world;
    let axis = |i: usize| clip.row(i).truncate().as_dvec3().normalize();
    let axes: [DVec3; 3] = [0, 1, 2].map(axis);
    let corners = camera.far_corners().map(|q| axes.map(|axis| axis.dot(q)));
    let bounds = rectified_bounds(corners);
    let away = |azimuth: f64| axes[0] * azimuth.cos() + axes[1] * azimuth.sin();
    let across = away(bounds.azimuth);
    let aside = away(bounds.azimuth + 0.5 * PI);
    let eye = light_view.clip_from_world.as_dmat4();
    let eye = eye.transform_point3(camera.eye.as_dvec3());
    let eye = [0.5 + 0.5 * eye.x, 0.5 - 0.5 * eye.y, eye.z].map(|x| x as f32);
    let size = scene.shadow.size;
    let rows = (0..size).map(|row| {
        let share = 2.0 * (f64::from(row) + 0.5) / f64::from(size) - 1.0;
        let azimuth = bounds.azimuth + share * bounds.half_azimuth;
        let (least, largest) = row_inclinations(corners, azimuth);
        let extinction = row_extinction(f64::from(extinction), least, largest);
        away(azimuth).as_vec3().extend(extinction as f32)
    });
    let rectified = Rectified {
        across: across.as_vec3().extend(bounds.radius as f32),
        aside: aside.as_vec3().extend(bounds.half_azimuth as f32),
        along: axes[2].as_vec3().extend(light_view.depth),
        eye: Vec3::from_array(eye).extend(MOMENT_BIAS),
        middle: (0.5 * (bounds.least + bounds.largest)) as f32,
        scale: (2.0 / (bounds.largest - bounds.least).max(1e-6)) as f32,
        columns: size,
        rows: size,
    };
    (rectified, rows.collect())
}
