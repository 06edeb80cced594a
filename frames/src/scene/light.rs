//! Lights.

use hankel_dsl::glam::{DVec3, Vec3};
use serde::Deserialize;

use crate::scattering::Scattering;

/// A light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Where its light comes from.
    pub source: Source,
    /// How large it is. Of a spot light, across its axis.
    pub area: Area,
    /// Of a directional light, the irradiance of a surface that faces it, as a multiple of that of the light that
    /// scenes have without this; of a spot light the same at a distance of 1. 0 to [`Light::MAX_STRENGTH`].
    pub strength: f32,
    /// What of it each channel has, linear, 0 to 1.
    pub colour: Vec3,
}

/// Where a light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// From infinitely far away.
    Directional {
        /// The way the light goes; unit length.
        direction: Vec3,
    },
    /// From a place, within a cone.
    Spot(Spot),
}

/// A light in a place, which shines into a cone and falls off with the square of the distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Where it is.
    pub position: Vec3,
    /// The way it shines; unit length.
    pub direction: Vec3,
    /// From edge to edge of the cone, degrees: 1 to [`Spot::MAX_ANGLE`].
    pub angle: f32,
    /// From edge to edge of the part that does not fade, degrees: 0 to less than `angle`.
    pub inner: f32,
}

impl Light {
    /// The greatest strength.
    pub const MAX_STRENGTH: f32 = 1e6;

    /// A white light of strength 1 from infinitely far away; `direction` is the way it goes, not zero.
    #[must_use]
    pub fn directional(direction: Vec3) -> Self {
        Self::new(Source::Directional {
            direction: direction.normalize(),
        })
    }

    /// A white light of strength 1 that is a point.
    #[must_use]
    pub const fn new(source: Source) -> Self {
        Self {
            source,
            area: Area {
                radius: 0.0,
                shape: AreaShape::Disc,
            },
            strength: 1.0,
            colour: Vec3::ONE,
        }
    }

    /// The way the light goes, or the axis of its cone; unit length.
    #[must_use]
    pub const fn direction(&self) -> Vec3 {
        match self.source {
            Source::Directional { direction } => direction,
            Source::Spot(spot) => spot.direction,
        }
    }

    /// The way from a place to the light's middle: all of it to a spot light, of unit length to one that is infinitely
    /// far away.
    #[must_use]
    pub fn toward(&self, place: DVec3) -> DVec3 {
        match self.source {
            Source::Directional { direction } => -direction.as_dvec3().normalize_or(DVec3::Y),
            Source::Spot(spot) => spot.position.as_dvec3() - place,
        }
    }

    /// What a medium's technique would have to be, if this one is not for the light; `None` if it is.
    #[must_use]
    pub fn refuses(&self, scattering: &Scattering) -> Option<&'static str> {
        self.spot().and(scattering.not_for_spots)
    }

    /// The spot light, if it is one.
    #[must_use]
    pub const fn spot(&self) -> Option<&Spot> {
        match &self.source {
            Source::Directional { .. } => None,
            Source::Spot(spot) => Some(spot),
        }
    }
}

impl Spot {
    /// The widest cone, degrees: a map of a wider one has few texels in its middle.
    pub const MAX_ANGLE: f32 = 150.0;

    /// Scale and offset of the cosine of the angle from the axis, such that their sum is 0 at the edge of the
    /// cone and 1 where it begins to fade (glTF, KHR_lights_punctual, "Inner and Outer Cone Angles").
    #[must_use]
    pub fn fade(&self) -> [f64; 2] {
        let cosine = |degrees: f32| (0.5 * f64::from(degrees).to_radians()).cos();
        let (outer, inner) = (cosine(self.angle), cosine(self.inner));
        let scale = 1.0 / (inner - outer).max(1e-6);
        [scale, -outer * scale]
    }

    /// Inward normals of a pyramid around the cone: a place is within where their products with the way to it from
    /// the light are none negative.
    #[must_use]
    pub fn pyramid(&self) -> [DVec3; 4] {
        let along = self.direction.as_dvec3();
        let (right, up) = along.any_orthonormal_pair();
        let tangent = (0.5 * f64::from(self.angle).to_radians()).tan();
        [right, -right, up, -up].map(|side| side + along * tangent)
    }

    /// What the cone leaves of the light on its way to a place, 0 to 1.
    #[must_use]
    pub fn within(&self, place: DVec3) -> f64 {
        let way = (place - self.position.as_dvec3()).normalize_or_zero();
        let [scale, offset] = self.fade();
        let fade = scale * way.dot(self.direction.as_dvec3()) + offset;
        fade.clamp(0.0, 1.0).powi(2)
    }
}

/// What of the sky a light fills, around the direction that it comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Area {
    /// Its half width. Of a directional light the tangent of the angle between its middle and the middle of its
    /// edge, 0 (a point) to [`Area::MAX_RADIUS`]; the sun has 0.0047. Of a spot light a length.
    pub radius: f32,
    /// Its outline.
    pub shape: AreaShape,
}

/// The outline of a light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AreaShape {
    /// A disc.
    #[default]
    Disc,
    /// A square whose edges are along those of the shadow map.
    Square,
}

impl Area {
    /// The largest half width of a directional light: 45 degrees to each side.
    pub const MAX_RADIUS: f32 = 1.0;

    /// A point of the light, in units of its half width, for a point of the unit square: what is
    /// uniform there is uniform on the light. A disc's is Shirley and Chiu's concentric map.
    #[must_use]
    pub fn point(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (x, y) = (2.0 * x - 1.0, 2.0 * y - 1.0);
        if self.shape == AreaShape::Square {
            return [x, y];
        }
        let (radius, part, turn) = if x.abs() > y.abs() {
            (x, y / x, 0.0)
        } else if y == 0.0 {
            (0.0, 0.0, 0.0)
        } else {
            // A quarter turn on, and backwards.
            (y, -x / y, std::f64::consts::FRAC_PI_2)
        };
        let (sin, cos) = (part * std::f64::consts::FRAC_PI_4 + turn).sin_cos();
        [radius * cos, radius * sin]
    }
}
