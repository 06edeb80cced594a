//! Built-in scenes. Sizes are metres; the same name always makes the same triangles.

use hankel_dsl::glam::{Quat, Vec3};
use rand_core::Rng;
use rand_pcg::Pcg32;
use serde::Deserialize;

use super::mesh::Mesh;

/// A built-in scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Procedural {
    /// Everything that is hard on filtered shadow maps: a picket fence, a tree and hedges of
    /// thousands of leaves, poles with wires, boxes and balls that touch the ground, and a valley
    /// far below that catches shadows of several layers at once.
    Yard,
    /// One box on a square of ground: the smallest scene with a shadow.
    Box,
}

impl Procedural {
    /// The scene's triangles.
    #[must_use]
    pub fn mesh(self) -> Mesh {
        match self {
            Self::Yard => yard(),
            Self::Box => {
                let mut mesh = Mesh::default();
                mesh.quad([
                    Vec3::new(-2.0, 0.0, 2.0),
                    Vec3::new(2.0, 0.0, 2.0),
                    Vec3::new(2.0, 0.0, -2.0),
                    Vec3::new(-2.0, 0.0, -2.0),
                ]);
                mesh.aligned_block(Vec3::new(-0.5, 0.0, -0.5), Vec3::new(0.5, 1.0, 0.5));
                mesh.paint(PAINT);
                mesh
            }
        }
    }
}

/// Numbers from 0 to 1 and what is made of them.
struct Chance(Pcg32);

impl Chance {
    fn new(seed: u64) -> Self {
        Self(Pcg32::new(seed, 0x0a02_bdbf_7bb3_c0a7))
    }

    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        (self.0.next_u32() >> 8) as f32 / (1 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// A direction, all alike likely.
    fn direction(&mut self) -> Vec3 {
        let y = self.between(-1.0, 1.0);
        let (sin, cos) = (self.unit() * std::f32::consts::TAU).sin_cos();
        let r = (1.0 - y * y).max(0.0).sqrt();
        Vec3::new(r * cos, y, r * sin)
    }
}

const WOOD: Vec3 = Vec3::new(0.4, 0.27, 0.16);
const PAINT: Vec3 = Vec3::new(0.72, 0.7, 0.66);
const METAL: Vec3 = Vec3::new(0.3, 0.31, 0.34);

fn yard() -> Mesh {
    let mut mesh = Mesh::default();
    // The yard is the top of a slab; the valley lies far below it.
    mesh.aligned_block(Vec3::new(-8.0, -0.6, -6.0), Vec3::new(8.0, 0.0, 6.0));
    mesh.paint(Vec3::new(0.46, 0.43, 0.38));
    mesh.quad([
        Vec3::new(-24.0, -9.0, 14.0),
        Vec3::new(24.0, -9.0, 14.0),
        Vec3::new(24.0, -9.0, -34.0),
        Vec3::new(-24.0, -9.0, -34.0),
    ]);
    mesh.paint(Vec3::new(0.3, 0.36, 0.22));
    for (x, z, height) in [(-13.0, -19.0, 4.5), (-3.0, -26.0, 6.5), (8.0, -20.0, 3.5)] {
        let low = Vec3::new(x - 1.6, -9.0, z - 1.6);
        mesh.aligned_block(low, low + Vec3::new(3.2, height, 3.2));
    }
    mesh.paint(Vec3::new(0.5, 0.42, 0.4));
    fence(
        &mut mesh,
        Vec3::new(-7.8, 0.0, -5.7),
        Vec3::new(7.8, 0.0, -5.7),
    );
    fence(
        &mut mesh,
        Vec3::new(-7.7, 0.0, 2.5),
        Vec3::new(-7.7, 0.0, -5.5),
    );
    mesh.paint(PAINT);
    tree(&mut mesh, Vec3::new(-4.0, 0.0, -2.2), 1);
    hedge(
        &mut mesh,
        Vec3::new(2.6, 0.0, -4.7),
        Vec3::new(7.2, 0.0, -4.7),
        2,
    );
    mesh.paint(Vec3::new(0.22, 0.38, 0.1));
    poles(&mut mesh);
    mesh.paint(METAL);
    boxes(&mut mesh);
    mesh
}

/// Pickets and two rails between two points of the ground.
fn fence(mesh: &mut Mesh, from: Vec3, to: Vec3) {
    let along = (to - from).normalize_or(Vec3::X);
    let across = along.cross(Vec3::Y);
    let length = from.distance(to);
    let count = (length / 0.16) as u32;
    for i in 0..count {
        let foot = from + along * ((i as f32 + 0.5) / count as f32 * length);
        mesh.block(
            foot + Vec3::Y * 0.55,
            [along * 0.03, Vec3::Y * 0.55, across * 0.012],
        );
    }
    for height in [0.25, 0.85] {
        let middle = (from + to) * 0.5 + Vec3::Y * height - across * 0.03;
        mesh.block(
            middle,
            [along * (length * 0.5), Vec3::Y * 0.035, across * 0.018],
        );
    }
}

/// A leaf: a small card. It is shaded as a part of the crown that it belongs to, with a normal
/// away from the crown's middle, as is usual for foliage.
fn leaf(mesh: &mut Mesh, chance: &mut Chance, at: Vec3, outward: Vec3, size: f32) {
    let turn = Quat::from_axis_angle(
        chance.direction(),
        chance.between(0.0, std::f32::consts::PI),
    );
    let (u, v) = (turn * Vec3::X * size, turn * Vec3::Y * (size * 0.6));
    let normal = (outward + chance.direction() * 0.4).normalize_or(Vec3::Y);
    mesh.quad_with_normal([at - u, at - v, at + u, at + v], normal);
}

fn tree(mesh: &mut Mesh, foot: Vec3, seed: u64) {
    let mut chance = Chance::new(seed);
    let fork = foot + Vec3::new(0.1, 1.6, 0.05);
    mesh.rod(foot, fork, 0.13, 12);
    mesh.paint(WOOD);
    let mut tips = Vec::new();
    for _ in 0..14 {
        let tip = fork + (chance.direction() + Vec3::Y * 0.75) * chance.between(0.8, 1.35);
        mesh.rod(fork, tip, 0.035, 6);
        for _ in 0..4 {
            let twig = tip + (chance.direction() + Vec3::Y * 0.2) * chance.between(0.2, 0.55);
            mesh.rod(tip, twig, 0.012, 4);
            tips.push(twig);
        }
    }
    mesh.paint(WOOD);
    let crown = fork + Vec3::Y * 0.8;
    for tip in tips {
        for _ in 0..70 {
            let at = tip + chance.direction() * (0.42 * chance.unit().sqrt());
            let outward = (at - crown).normalize_or(Vec3::Y);
            let size = chance.between(0.04, 0.08);
            leaf(mesh, &mut chance, at, outward, size);
        }
    }
}

fn hedge(mesh: &mut Mesh, from: Vec3, to: Vec3, seed: u64) {
    let mut chance = Chance::new(seed);
    for _ in 0..2600 {
        let (sin, cos) = (chance.unit() * std::f32::consts::PI).sin_cos();
        let r = chance.unit().sqrt();
        let across = Vec3::new(0.0, 0.8 * r * sin, 0.45 * r * cos);
        let at = from + (to - from) * chance.unit() + across;
        let outward = across.normalize_or(Vec3::Y);
        let size = chance.between(0.03, 0.07);
        leaf(mesh, &mut chance, at, outward, size);
    }
}

/// Thin poles, and wires that sag between them.
fn poles(mesh: &mut Mesh) {
    let feet = [-6.5, -2.2, 2.2, 6.5].map(|x| Vec3::new(x, 0.0, 3.4));
    for foot in feet {
        mesh.rod(foot, foot + Vec3::Y * 3.2, 0.03, 8);
        let arm = foot + Vec3::Y * 3.0;
        mesh.rod(arm - Vec3::Z * 0.4, arm + Vec3::Z * 0.4, 0.02, 6);
    }
    for pair in feet.windows(2) {
        for side in [-0.36, 0.0, 0.36] {
            let offset = Vec3::new(0.0, 3.02, side);
            let point = |i: u32| {
                let t = i as f32 / 12.0;
                pair[0].lerp(pair[1], t) + offset - Vec3::Y * (1.2 * t * (1.0 - t))
            };
            for i in 0..12 {
                mesh.rod(point(i), point(i + 1), 0.006, 4);
            }
        }
    }
}

/// Boxes on boxes, a ladder against them, and balls on the ground.
fn boxes(mesh: &mut Mesh) {
    let turned = |angle: f32, half: Vec3| {
        let turn = Quat::from_rotation_y(angle);
        [
            turn * Vec3::X * half.x,
            turn * Vec3::Y * half.y,
            turn * Vec3::Z * half.z,
        ]
    };
    let mut height = 0.0;
    for (i, side) in [0.62_f32, 0.5, 0.36, 0.24].into_iter().enumerate() {
        let angle = 0.35 + 0.5 * i as f32;
        mesh.block(
            Vec3::new(3.1, height + side, -0.8),
            turned(angle, Vec3::splat(side)),
        );
        height += 2.0 * side;
    }
    mesh.paint(Vec3::new(0.55, 0.33, 0.2));
    mesh.block(
        Vec3::new(5.3, 0.3, 0.6),
        turned(-0.3, Vec3::new(0.9, 0.3, 0.35)),
    );
    mesh.block(
        Vec3::new(5.3, 0.64, 0.6),
        turned(-0.3, Vec3::new(0.95, 0.04, 0.4)),
    );
    mesh.paint(PAINT);
    for rail in [-0.22, 0.22] {
        mesh.rod(
            Vec3::new(1.2, 0.0, -0.5 + rail),
            Vec3::new(2.6, 2.3, -0.5 + rail),
            0.025,
            8,
        );
    }
    for i in 1..9 {
        let at = Vec3::new(1.2, 0.0, -0.5).lerp(Vec3::new(2.6, 2.3, -0.5), i as f32 / 9.0);
        mesh.rod(at - Vec3::Z * 0.22, at + Vec3::Z * 0.22, 0.016, 6);
    }
    mesh.paint(WOOD);
    for (x, z, radius) in [
        (0.2, 1.6, 0.42),
        (1.15, 1.9, 0.22),
        (-0.7, 2.1, 0.14),
        (0.75, 2.5, 0.09),
    ] {
        mesh.sphere(Vec3::new(x, radius, z), radius, 24);
    }
    mesh.paint(Vec3::new(0.6, 0.16, 0.12));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_yard_is_large_sound_and_always_the_same() {
        let mesh = Procedural::Yard.mesh();
        assert_eq!(mesh, Procedural::Yard.mesh());
        assert!(mesh.triangles.len() > 15_000, "{}", mesh.triangles.len());
        assert_eq!(mesh.positions.len(), mesh.normals.len());
        assert_eq!(mesh.positions.len(), mesh.colours.len());
        assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4));
        let mut sound = mesh.clone();
        sound.drop_degenerate();
        assert_eq!(sound.triangles.len(), mesh.triangles.len());
    }
}
