//! The sky by day (Preetham, Shirley and Smits, A Practical Analytic Model for Daylight, 1999, appendix
//! A.2), as a picture of the upper half of all directions.

use hankel_dsl::glam::{UVec2, Vec2, Vec3, Vec4};
use hankel_dsl::math::native::{acos, exp};
use hankel_dsl::math::{sin_cos, tan};
use hankel_dsl::{Element, Real, kernel};

/// What the sky depends on.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Conditions {
    /// The angle between the sun and the zenith in radians.
    #[range(0.0..=1.4)]
    pub sun: f32,
    /// How hazy the air is: 2 is clear, 10 is haze.
    #[range(2.0..=6.0)]
    pub turbidity: f32,
}

/// What is the same for all directions. In each vector: chromaticities x and y, luminance.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Model {
    /// Perez' coefficients A to E.
    #[range(-0.5..=0.0)]
    pub perez: [Vec4; 5],
    /// What Perez' function is multiplied by: colour of the zenith over the function's value there.
    #[range(0.1..=0.4)]
    pub scale: Vec4,
    /// Direction to the sun, z up.
    #[unit_vector]
    pub sun: Vec4,
}

/// Perez' function of a direction: `cosine` of its angle to the zenith, `angle` to the sun.
#[inline(always)]
fn perez(coefficients: &[Vec4; 5], cosine: f32, angle: f32, cos_angle: f32) -> Vec3 {
    let [a, b, c, d, e] = *coefficients;
    let channel = |a: f32, b: f32, c: f32, d: f32, e: f32| {
        (1.0 + a * exp(b / cosine)) * (1.0 + c * exp(d * angle) + e * cos_angle * cos_angle)
    };
    Vec3::new(
        channel(a.x, b.x, c.x, d.x, e.x),
        channel(a.y, b.y, c.y, d.y, e.y),
        channel(a.z, b.z, c.z, d.z, e.z),
    )
}

/// The model of a sky, from its conditions.
#[kernel(
    compute,
    threads(64),
    pinned,
    parity(
        ulp = 256,
        absolute = 1e-5,
        why = "each exponential may be off by 3 + 2 abs(x) ulp, x being at most 4, and languages that cannot pin arithmetic add up in another order; sums of unlike signs enlarge that"
    )
)]
pub fn sky_model(#[element] sky: Conditions) -> Model {
    // Beyond these the model has no meaning.
    let t = Real::clamp(sky.turbidity, 1.7, 10.0);
    let s = Real::clamp(sky.sun, 0.0, 1.5);
    let line = |x: Vec2, y: Vec2, luminance: Vec2| {
        Vec4::new(
            x.x * t + x.y,
            y.x * t + y.y,
            luminance.x * t + luminance.y,
            0.0,
        )
    };
    let coefficients = [
        line(
            Vec2::new(-0.0193, -0.2592),
            Vec2::new(-0.0167, -0.2608),
            Vec2::new(0.1787, -1.4630),
        ),
        line(
            Vec2::new(-0.0665, 0.0008),
            Vec2::new(-0.0950, 0.0092),
            Vec2::new(-0.3554, 0.4275),
        ),
        line(
            Vec2::new(-0.0004, 0.2125),
            Vec2::new(-0.0079, 0.2102),
            Vec2::new(-0.0227, 5.3251),
        ),
        line(
            Vec2::new(-0.0641, -0.8989),
            Vec2::new(-0.0441, -1.6537),
            Vec2::new(0.1206, -2.5771),
        ),
        line(
            Vec2::new(-0.0033, 0.0452),
            Vec2::new(-0.0109, 0.0529),
            Vec2::new(-0.0670, 0.3703),
        ),
    ];
    let cubic = |c: Vec4| ((c.x * s + c.y) * s + c.z) * s + c.w;
    let zenith_x = (cubic(Vec4::new(0.00166, -0.00375, 0.00209, 0.0)) * t
        + cubic(Vec4::new(-0.02903, 0.06377, -0.03202, 0.00394)))
        * t
        + cubic(Vec4::new(0.11693, -0.21196, 0.06052, 0.25886));
    let zenith_y = (cubic(Vec4::new(0.00275, -0.00610, 0.00317, 0.0)) * t
        + cubic(Vec4::new(-0.04214, 0.08970, -0.04153, 0.00516)))
        * t
        + cubic(Vec4::new(0.15346, -0.26756, 0.06670, 0.26688));
    let chi = (4.0 / 9.0 - t / 120.0) * (core::f32::consts::PI - 2.0 * s);
    let luminance = (4.0453 * t - 4.9710) * tan(chi) - 0.2155 * t + 2.4192;
    let (sine, cosine) = sin_cos(s);
    let at_zenith = perez(&coefficients, 1.0, s, cosine);
    let scale = Vec3::new(zenith_x, zenith_y, luminance) / at_zenith;
    Model {
        perez: coefficients,
        scale: scale.extend(0.0),
        sun: Vec4::new(sine, 0.0, cosine, 0.0),
    }
}

/// The sky over a disc: the zenith in the middle, the horizon at its edge, equal areas (Lambert's
/// projection). Linear sRGB, luminance in kcd/m².
#[kernel(
    compute,
    threads(8, 8),
    texture(rgba16float),
    pinned,
    parity(
        ulp = 1,
        absolute = 8e-3,
        non_finite,
        why = "the arc cosine may be off by 6.77e-5, which moves x, y and luminance by 8e-6 with these coefficients, and a colour by 8e-3 where y is 0.03; rounding to the format is the driver's choice; exponentials of absurd numbers overflow"
    )
)]
pub fn sky(
    #[index] at: UVec2,
    #[uniform]
    #[values(61, 37)]
    picture: &UVec2,
    #[uniform] model: &Model,
) -> Vec4 {
    let uv = (Vec2::new(at.x as f32, at.y as f32) + 0.5)
        / Vec2::new(picture.x as f32, picture.y as f32)
        * 2.0
        - 1.0;
    let radius = uv.length_squared();
    if radius > 0.99 {
        return Vec4::new(0.0, 0.0, 0.0, 1.0);
    }
    // z = 1 - r²; the other two fill the length up to 1.
    let cosine = 1.0 - radius;
    let flat = uv * Real::sqrt(2.0 - radius);
    let direction = Vec3::new(flat.x, flat.y, cosine);
    let cos_angle = Real::clamp(direction.dot(model.sun.truncate()), -1.0, 1.0);
    let value = perez(&model.perez, cosine, acos(cos_angle), cos_angle) * model.scale.truncate();
    // From chromaticities and luminance to CIE XYZ. No colour has a y below 0.03.
    let (x, y, luminance) = (value.x, Real::max(value.y, 0.03), value.z);
    let per_y = luminance / y;
    let xyz = Vec3::new(x * per_y, luminance, (1.0 - x - y) * per_y);
    let row = |r: f32, g: f32, b: f32| xyz.dot(Vec3::new(r, g, b));
    // IEC 61966-2-1: XYZ to linear sRGB. Colours out of gamut, and light beyond what the format holds, are
    // cut off.
    let shown = |x: f32| {
        if x > 0.0 {
            if x < 60_000.0 { x } else { 60_000.0 }
        } else {
            0.0
        }
    };
    Vec4::new(
        shown(row(3.2406, -1.5372, -0.4986)),
        shown(row(-0.9689, 1.8758, 0.0415)),
        shown(row(0.0557, -0.2040, 1.0570)),
        1.0,
    )
}
