//! What filter kernels see in a scene's shadow map: the input of the evaluation of candidates for what
//! a map should hold (\[MSM\], supplement, section 6).

use hankel_dsl::glam::{DVec3, Mat4, Vec3};

use crate::lights::light_view;
use crate::passes::gaussian;
use crate::scene::{Mesh, Scene};
use crate::visibility::cast::{Caster, Hit, Lens, Segment};

/// A filter kernel around a surface in the light's view, which need not be the foremost one.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Depths of the kernel's texels, from 0 to 1, and their weights, whose sum is 1.
    pub depths: Vec<[f64; 2]>,
    /// The surface's own depth, less its bias.
    pub receiver: f64,
}

/// Regions of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Regions {
    /// The regions.
    pub regions: Vec<Region>,
    /// Surfaces behind a texel on average.
    pub layers: f64,
}

/// Where a surface goes beside the middle of its texel.
#[derive(Clone, Copy, Debug)]
struct Slope {
    /// Change of depth from a texel to the next, along the map's x and y.
    per_texel: [f64; 2],
}

impl Slope {
    /// Of a triangle; `None` if the light sees it edge-on.
    fn of(clip_from_world: Mat4, corners: [Vec3; 3], size: u32) -> Option<Self> {
        let [a, b, c] = corners.map(|p| clip_from_world.as_dmat4().project_point3(p.as_dvec3()));
        let normal: DVec3 = (b - a).cross(c - a);
        // Clip space is two units wide.
        let per_texel = [normal.x, normal.y].map(|n| -n / normal.z * 2.0 / f64::from(size));
        per_texel
            .iter()
            .all(|slope| slope.is_finite())
            .then_some(Self { per_texel })
    }

    /// How far the surface's plane comes towards the light within so many texels along x and y.
    fn rise(self, texels: f64) -> f64 {
        texels * self.per_texel.iter().map(|slope| slope.abs()).sum::<f64>()
    }
}

/// At least `count` regions of the shadow map of a scene's first light, with its size and its Gaussian, and one depth for
/// each texel. Texels are taken evenly (the R2 sequence of M. Roberts, 2018), and of each one every surface behind it,
/// as in a stack of maps; those that the light sees edge-on are left out. The bias is the least with which a plane does
/// not shade itself within the kernel. Opaque triangles alone count.
#[must_use]
pub fn regions(scene: &Scene, mesh: &Mesh, count: usize) -> Regions {
    let mut found = Regions {
        regions: Vec::new(),
        layers: 0.0,
    };
    let triangles = mesh.opaque();
    let Some(light) = scene.lights.first().filter(|_| !triangles.is_empty()) else {
        return found;
    };
    let size = scene.shadow.size;
    let view = light_view(scene, light, mesh);
    let clip_from_world = view.clip_from_world.as_dmat4();
    let lens = Lens::new(view.clip_from_world, size, size);
    let foremost = Caster::new(&mesh.positions, &triangles);
    let layers = Caster::of_layers(&mesh.positions, &triangles);
    let half = gaussian(scene.shadow.filter);
    let radius = half.len() as i64 - 1;
    let weight = |i: i64| f64::from(half[i.unsigned_abs() as usize]);
    let total: f64 = (-radius..=radius).map(weight).sum();
    let segment = |x: u32, y: u32| lens.segment([x, y], [0.5; 2]);
    let depth_of = |ray: &Segment, hit: Hit| clip_from_world.project_point3(ray.at(hit.t)).z;
    let depth = |x: i64, y: i64| {
        let within = |i: i64| i.clamp(0, i64::from(size) - 1) as u32;
        let ray = segment(within(x), within(y));
        foremost.first(&ray).map_or(1.0, |hit| depth_of(&ray, hit))
    };
    // Enough texels for a map of which a hundredth is covered.
    let most = count.saturating_mul(100);
    let mut texels = 0;
    while found.regions.len() < count && texels < most {
        texels += 1;
        let place = [0.754_877_666_246_693, 0.569_840_290_998_053]
            .map(|step| ((step * texels as f64).fract() * f64::from(size)) as u32);
        let ray = segment(place[0], place[1]);
        let surfaces = layers.all(&ray);
        if surfaces.is_empty() {
            continue;
        }
        let [x, y] = place.map(i64::from);
        let mut depths = Vec::new();
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                let share = weight(dx) * weight(dy) / (total * total);
                depths.push([depth(x + dx, y + dy), share]);
            }
        }
        for hit in surfaces {
            let corners = layers.corners(hit.triangle);
            if let Some(slope) = Slope::of(view.clip_from_world, corners, size) {
                found.regions.push(Region {
                    depths: depths.clone(),
                    receiver: (depth_of(&ray, hit) - slope.rise(radius as f64)).max(0.0),
                });
            }
        }
    }
    found.layers = found.regions.len() as f64 / texels as f64;
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(procedural: &str, direction: [f32; 3]) -> (Scene, Mesh) {
        let text = format!(
            "[geometry]\nprocedural = '{procedural}'\n[camera]\neye = [2, 6, 4]\ntarget = [0, 0, 0]\n\
             [light]\ndirection = {direction:?}\n[shadow]\nsize = 128\nfilter = 5\n\
             [output]\nwidth = 32\nheight = 24\n"
        );
        let scene = Scene::parse(&text, std::path::Path::new("test.toml")).unwrap();
        let mesh = scene.mesh().unwrap();
        (scene, mesh)
    }

    /// Ground without a caster: the bias is large enough for a slanted light, and no larger than the slope.
    #[test]
    fn open_ground_does_not_shade_itself() {
        let (scene, mesh) = scene("empty", [0.6, -1.0, 0.2]);
        let found = regions(&scene, &mesh, 60);
        assert!(found.regions.len() >= 60 && found.layers > 0.2);
        for region in &found.regions {
            let weights: f64 = region.depths.iter().map(|d| d[1]).sum();
            assert!((weights - 1.0).abs() < 1e-12);
            let nearest = region.depths.iter().map(|d| d[0]).fold(1.0, f64::min);
            assert!(
                (nearest - region.receiver).abs() < 1e-6,
                "{nearest} {region:?}"
            );
        }
    }

    /// Behind a box lies the ground, and the far side of the box between them.
    #[test]
    fn surfaces_behind_others_are_regions_too() {
        let (scene, mesh) = scene("box", [0.3, -1.0, 0.2]);
        let found = regions(&scene, &mesh, 400);
        let hidden = found.regions.iter().filter(|region| {
            let nearer = region.depths.iter().filter(|d| d[0] < region.receiver);
            nearer.map(|d| d[1]).sum::<f64>() > 0.99
        });
        let share = hidden.count() as f64 / found.regions.len() as f64;
        assert!((0.02..0.7).contains(&share), "{share}");
        assert_eq!(found, regions(&scene, &mesh, 400));
    }

    #[test]
    fn a_scene_without_triangles_has_no_regions() {
        let (scene, _) = scene("box", [0.3, -1.0, 0.2]);
        let found = regions(&scene, &Mesh::default(), 10);
        assert_eq!((found.regions.len(), found.layers), (0, 0.0));
    }
}
