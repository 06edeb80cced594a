//! Particles that are moved in place: gravity, drag, a ground that they bounce off, a fountain that they
//! come from again when their time is over.

use hankel_dsl::glam::{Vec3, Vec4};
use hankel_dsl::{Element, kernel};

/// A particle.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Particle {
    /// Where it is, and how long it still lives in seconds.
    #[range(0.0..=4.0)]
    pub place: Vec4,
    /// Its velocity in metres a second.
    #[range(-5.0..=5.0)]
    pub velocity: Vec4,
}

/// A step of time.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Step {
    /// The acceleration of gravity in metres a second squared.
    #[default(-9.81)]
    #[range(-10.0..=0.0)]
    pub gravity: f32,
    /// The share of the velocity that drag takes off in a second.
    #[default(0.1)]
    #[range(0.0..=1.0)]
    pub drag: f32,
    /// The share of the velocity that a bounce leaves.
    #[default(0.6)]
    #[range(0.0..=1.0)]
    pub bounce: f32,
    /// Its length in seconds.
    #[default(0.01)]
    #[range(0.001..=0.05)]
    pub time: f32,
    /// How long a particle lives, in seconds.
    #[default(4.0)]
    #[range(1.0..=4.0)]
    pub life: f32,
    /// The number of this step.
    pub number: u32,
}

/// Bits that depend on all bits of a number (PCG: O'Neill 2014; as a hash, Jarzynski and Olano, Hash
/// Functions for GPU Rendering, 2020, `pcg`).
#[inline(always)]
pub fn hash(x: u32) -> u32 {
    let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// From 0 to 1, 1 excluded, of the upper 24 bits.
#[inline(always)]
pub fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Moves a particle by one step (semi-implicit Euler).
#[kernel(
    compute,
    threads(256),
    pinned,
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn particles_step(#[index] i: u32, #[uniform] step: &Step, #[element] particle: &mut Particle) {
    let life = particle.place.w - step.time;
    if life <= 0.0 {
        let a = hash(i ^ hash(step.number));
        let b = hash(a);
        let c = hash(b);
        particle.place = Vec4::new(0.0, 0.0, 0.0, step.life);
        particle.velocity = Vec4::new(unit(a) - 0.5, unit(b) * 2.0 + 4.0, unit(c) - 0.5, 0.0);
        return;
    }
    let mut velocity = particle.velocity.truncate() * (1.0 - step.drag * step.time);
    velocity.y += step.gravity * step.time;
    let mut place = particle.place.truncate() + velocity * step.time;
    if place.y < 0.0 {
        place.y = -place.y * step.bounce;
        velocity = Vec3::new(velocity.x, -velocity.y, velocity.z) * step.bounce;
    }
    particle.place = place.extend(life);
    particle.velocity = velocity.extend(particle.velocity.w);
}
