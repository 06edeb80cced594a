//! From a scene's lights to what kernels take of each, and which of them a picture can do without.

use hankel_dsl::glam::{DVec3, Vec3, Vec4};
use hankel_shadows::shade::Light as Uniform;
use hankel_shadows::soft::Area;

use crate::frame::{Show, camera_view};
use crate::graph::Omission;
use crate::scene::{CameraView, Fit, Light, LightView, Mesh, Scene, Source, Spot};

/// Light from the sky.
const AMBIENT: Vec4 = Vec4::new(0.24, 0.28, 0.33, 0.0);
/// What a light of strength 1 adds on a surface that faces it.
const IRRADIANCE: f32 = 1.15;

/// What a light's map holds.
pub fn light_view(scene: &Scene, light: &Light, mesh: &Mesh) -> LightView {
    let shadow = &scene.shadow;
    // The filter and the sampler's interpolation stay inside of the map.
    let (size, margin) = (shadow.size, shadow.filter / 2 + 1);
    let camera = match shadow.fit {
        Fit::Scene => None,
        Fit::Camera => Some(camera_view(scene, &scene.camera, mesh)),
    };
    // Other techniques shade from the light's middle alone.
    let radius = match shadow.technique.is_soft {
        true => light.area.radius,
        false => 0.0,
    };
    match (light.source, camera) {
        (Source::Spot(spot), camera) => {
            // A medium scatters in all of the cone.
            let camera = camera.filter(|_| scene.medium.is_none());
            LightView::spot(&spot, mesh, size, margin, camera.as_ref(), radius)
        }
        (Source::Directional { direction }, None) => LightView::new(direction, mesh, size, margin),
        (Source::Directional { direction }, Some(camera)) => {
            let fitted = match scene.medium {
                Some(_) => LightView::fitted_to_space,
                None => LightView::fitted,
            };
            fitted(direction, mesh, size, margin, &camera, radius)
        }
    }
}

/// One of the lights that a frame has.
#[derive(Clone, Copy, Debug)]
pub struct Lit<'a> {
    pub light: &'a Light,
    /// What its map holds.
    pub view: &'a LightView,
    /// Whether it comes with the light from the sky, which is there once.
    pub is_first: bool,
    /// How many lights there are. What is told of several is their mean.
    pub count: usize,
}

/// The light as the shading kernels take it.
pub fn uniform(scene: &Scene, lit: &Lit<'_>, show: Show) -> Uniform {
    let Lit {
        light,
        view,
        is_first,
        count,
    } = *lit;
    let shadow = &scene.shadow;
    let clip = view.clip_from_world;
    let share = 1.0 / count as f32;
    let (colour, ambient) = match show {
        Show::Picture if is_first => (light.colour * light.strength * IRRADIANCE, AMBIENT),
        Show::Picture => (light.colour * light.strength * IRRADIANCE, Vec4::ZERO),
        Show::Light | Show::Scattered => (Vec3::splat(share), Vec4::ZERO),
    };
    let (position, cone, falls) = match light.source {
        Source::Directional { direction } => ((-direction).extend(0.0), Vec4::W, false),
        Source::Spot(spot) => {
            let [scale, offset] = spot.fade();
            let axis = spot.direction.as_dvec3() * scale;
            let cone = axis.extend(offset).as_vec4();
            (spot.position.extend(1.0), cone, show == Show::Picture)
        }
    };
    Uniform {
        row_u: (clip.row(0) + clip.row(3)) * 0.5,
        // Rows of the map count from the top.
        row_v: (clip.row(3) - clip.row(1)) * 0.5,
        row_depth: clip.row(2),
        row_w: clip.row(3),
        position,
        colour,
        falloff: if falls { 1.0 } else { 0.0 },
        cone,
        ambient,
        bias_target: Vec4::from_array(shadow.map.bias_target),
        moment_bias: shadow.moment_bias,
        depth_bias: shadow.depth_bias.share(view, shadow.radius()) * view.slope,
        light_leak: shadow.leak_cut,
        filter_radius: shadow.filter / 2,
    }
}

/// Steepness, depth over width, of the steepest surface that must not shade itself in a soft shadow.
const STEEPEST: f32 = 2.0;
/// The same for a region that is compared as a whole: of a steeper one, less than half is in front of its
/// own middle, and moments bound little of that. More would lose what is in contact.
const MARGIN: f32 = 0.5;

/// The light's area as the kernels of soft shadows take it.
pub fn area(light: &Light, view: &LightView) -> Area {
    // What the light spans as seen from depth 0, and how much less of that from depth 1.
    let (radius, narrowing) = match view.near {
        None => (light.area.radius, 0.0),
        Some(near) => (light.area.radius / near, view.depth / (near + view.depth)),
    };
    let spread = view.texel.map(|texel| radius * view.depth / texel);
    Area {
        spread: spread.into(),
        slack: (STEEPEST * radius).min(0.5),
        margin: (MARGIN * radius).min(0.5),
        narrowing,
        padding: 0.0,
    }
}

/// Normals for pictures of what arrives of a light: the way to the light, times its product with the normal of the
/// surface. Interpolated, they face the light where the surface does, and are turned from it elsewhere.
pub fn facing(light: &Light, mesh: &Mesh) -> Vec<Vec3> {
    let vertices = mesh.positions.iter().zip(&mesh.normals);
    let facing = |(place, normal): (&Vec3, &Vec3)| {
        let toward = light.toward(place.as_dvec3()).as_vec3();
        toward * normal.dot(toward)
    };
    vertices.map(facing).collect()
}

/// Translucent triangles, the farthest from the light first.
pub fn translucent(light: &Light, mesh: &Mesh) -> Vec<[u32; 3]> {
    match light.source {
        Source::Directional { direction } => mesh.translucent_along(direction),
        Source::Spot(spot) => mesh.translucent_from(spot.position),
    }
}

/// The numbers of the lights that a picture needs, and why it does not need the others. Where none reaches
/// anything, the first one stays, as the picture needs a light.
pub fn reaching(scene: &Scene, mesh: &Mesh) -> (Vec<usize>, Vec<Omission>) {
    let mut kept = Vec::new();
    let mut omitted = Vec::new();
    if let [_] = scene.lights[..] {
        return (vec![0], omitted);
    }
    let seen = Seen::of(&camera_view(scene, &scene.camera, mesh), mesh);
    for (number, light) in scene.lights.iter().enumerate() {
        match unreached(scene, light, &seen) {
            Some(why) => omitted.push(Omission {
                what: format!("light {}", number + 1).into(),
                why: why.into(),
            }),
            None => kept.push(number),
        }
    }
    if kept.is_empty() {
        kept.push(0);
        omitted.remove(0);
    }
    (kept, omitted)
}

/// Why a light reaches nothing; `None` if it may.
fn unreached(scene: &Scene, light: &Light, seen: &Seen<'_>) -> Option<&'static str> {
    if light.strength == 0.0 {
        return Some("its strength is 0");
    }
    if light.colour == Vec3::ZERO {
        return Some("its colour is black");
    }
    if scene.medium.is_some() {
        // It shines through what is between surfaces.
        return None;
    }
    match light.source {
        Source::Directional { direction } => (!seen.faces(|normal, _| normal.dot(-direction)))
            .then_some("all that the camera sees is turned from it"),
        Source::Spot(spot) => {
            if !seen.faces(|normal, place| normal.dot(spot.position - place)) {
                return Some("all that the camera sees is turned from it");
            }
            (!seen.is_within(&spot)).then_some("nothing that the camera sees is within its cone")
        }
    }
}

/// Surfaces within a camera's view, hidden or not.
struct Seen<'a> {
    mesh: &'a Mesh,
    triangles: Vec<[u32; 3]>,
    /// What of each lies within the view.
    polygons: Vec<Vec<DVec3>>,
}

impl<'a> Seen<'a> {
    fn of(camera: &CameraView, mesh: &'a Mesh) -> Self {
        let (mut triangles, mut polygons) = (Vec::new(), Vec::new());
        for triangle in mesh.opaque() {
            let corners = triangle.map(|v| mesh.positions[v as usize]);
            let polygon = camera.clipped(corners);
            if !polygon.is_empty() {
                triangles.push(triangle);
                polygons.push(polygon);
            }
        }
        Self {
            mesh,
            triangles,
            polygons,
        }
    }

    /// Whether `cosine`, by a normal and a place, may be above 0 anywhere. It is linear in both, so that corners
    /// bound it.
    fn faces(&self, cosine: impl Fn(Vec3, Vec3) -> f32) -> bool {
        let of = |v: u32| {
            (
                self.mesh.normals[v as usize],
                self.mesh.positions[v as usize],
            )
        };
        self.triangles.iter().any(|triangle| {
            let corners = triangle.map(of);
            let places = corners.map(|(_, place)| place);
            corners
                .iter()
                .any(|(normal, _)| places.iter().any(|place| cosine(*normal, *place) > 0.0))
        })
    }

    /// Whether something may lie within a cone: within the pyramid around it.
    fn is_within(&self, spot: &Spot) -> bool {
        let pyramid = spot.pyramid();
        // All corners of a polygon beyond one of its sides.
        self.polygons.iter().any(|polygon| {
            let is_beyond = |side: &DVec3| {
                let from = spot.position.as_dvec3();
                polygon.iter().all(|place| side.dot(*place - from) < 0.0)
            };
            !pyramid.iter().any(is_beyond)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{AreaShape, Procedural};

    /// A place hides the light's edge from a receiver where the way between them passes: as far from the receiver in
    /// the map as the penumbra reaches, for both kinds of lights, wherever the two are.
    #[test]
    fn penumbrae_reach_as_far_as_the_light_is_seen_by() {
        let mesh = Procedural::Box.mesh();
        let size = 256;
        let spot = Spot {
            position: Vec3::new(-0.9, 2.2, 0.7),
            direction: Vec3::new(0.4, -1.0, -0.3).normalize(),
            angle: 90.0,
            inner: 60.0,
        };
        let directional = Light::directional(Vec3::new(0.4, -1.0, -0.3));
        for mut light in [directional, Light::new(Source::Spot(spot))] {
            light.area.radius = 0.2;
            light.area.shape = AreaShape::Square;
            let view = match light.source {
                Source::Spot(spot) => LightView::spot(&spot, &mesh, size, 3, None, 0.2),
                Source::Directional { direction } => LightView::new(direction, &mesh, size, 3),
            };
            let area = area(&light, &view);
            let along = light.direction().as_dvec3();
            let across = view.clip_from_world.row(0).truncate().as_dvec3();
            let across = across.reject_from_normalized(along).normalize();
            let project = |place: DVec3| {
                let clip = view.clip_from_world.as_dmat4() * place.extend(1.0);
                clip.truncate() / clip.w
            };
            let receiver = DVec3::new(0.3, 0.0, -0.2);
            for share in [0.1, 0.3, 0.6] {
                let edge = light.toward(receiver) + across * f64::from(light.area.radius);
                let (behind, before) = (project(receiver), project(receiver + edge * share));
                let texels = 0.5 * (before.x - behind.x) * f64::from(size);
                let reach = f64::from(area.spread.x) * (behind.z - before.z);
                assert!(
                    (texels - reach).abs() < 1e-3 * reach.abs() && reach > 0.5,
                    "{light:?}, {share}: {texels}, {reach}"
                );
            }
        }
    }
}
