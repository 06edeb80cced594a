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
    /// Two picket fences on open ground, one behind the other: thin casters side by side.
    Fence,
    /// A tree and hedges: thousands of leaves, many of which shade one place.
    Foliage,
    /// Poles with wires before a wall: casters thinner than a texel.
    Wires,
    /// Things that touch the ground, from boxes to sheets of a few millimetres.
    Contact,
    /// A lattice of thin bars and some plates, high above open ground: casters far from their shadows.
    Far,
    /// The inside of a room with one window with bars, a table and a chair: little light in much shadow.
    Room,
    /// Slatted floors one above the other: places that several layers of casters shade in part.
    Layers,
    /// A hall of columns on a long field, seen from one end: near and far shadows in one picture.
    Columns,
    /// Panes of glass of several opacities one above the other, with opaque things between them, and a ball.
    Glass,
    /// Open ground: nothing casts a shadow but on itself.
    Empty,
}

impl Procedural {
    /// The scene's triangles.
    #[must_use]
    pub fn mesh(self) -> Mesh {
        let mut mesh = Mesh::default();
        match self {
            Self::Yard => yard(&mut mesh),
            Self::Box => {
                ground(&mut mesh, 2.0, 2.0, PAINT);
                mesh.aligned_block(Vec3::new(-0.5, 0.0, -0.5), Vec3::new(0.5, 1.0, 0.5));
            }
            Self::Fence => {
                ground(&mut mesh, 6.0, 5.0, SOIL);
                for z in [-1.5, 1.5] {
                    fence(&mut mesh, Vec3::new(-5.0, 0.0, z), Vec3::new(5.0, 0.0, z));
                }
            }
            Self::Foliage => foliage(&mut mesh),
            Self::Wires => {
                ground(&mut mesh, 8.0, 7.0, SOIL);
                mesh.aligned_block(Vec3::new(-8.0, 0.0, -3.4), Vec3::new(8.0, 4.0, -3.0));
                mesh.paint(PAINT);
                poles(&mut mesh);
            }
            Self::Contact => contact(&mut mesh),
            Self::Far => far(&mut mesh),
            Self::Room => room(&mut mesh),
            Self::Layers => layers(&mut mesh),
            Self::Columns => columns(&mut mesh),
            Self::Glass => glass(&mut mesh),
            Self::Empty => ground(&mut mesh, 5.0, 5.0, SOIL),
        }
        mesh.paint(PAINT);
        mesh
    }
}

/// A rectangle of ground around the origin, with the given half edges.
fn ground(mesh: &mut Mesh, x: f32, z: f32, colour: Vec3) {
    mesh.quad([[-x, z], [x, z], [x, -z], [-x, -z]].map(|[x, z]| Vec3::new(x, 0.0, z)));
    mesh.paint(colour);
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
const SOIL: Vec3 = Vec3::new(0.46, 0.43, 0.38);
const LEAVES: Vec3 = Vec3::new(0.22, 0.38, 0.1);
const CLAY: Vec3 = Vec3::new(0.55, 0.33, 0.2);

fn yard(mesh: &mut Mesh) {
    // The yard is the top of a slab; the valley lies far below it.
    mesh.aligned_block(Vec3::new(-8.0, -0.6, -6.0), Vec3::new(8.0, 0.0, 6.0));
    mesh.paint(SOIL);
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
    fence(mesh, Vec3::new(-7.8, 0.0, -5.7), Vec3::new(7.8, 0.0, -5.7));
    fence(mesh, Vec3::new(-7.7, 0.0, 2.5), Vec3::new(-7.7, 0.0, -5.5));
    mesh.paint(PAINT);
    tree(mesh, Vec3::new(-4.0, 0.0, -2.2), 1);
    hedge(
        mesh,
        Vec3::new(2.6, 0.0, -4.7),
        Vec3::new(7.2, 0.0, -4.7),
        2,
    );
    mesh.paint(LEAVES);
    poles(mesh);
    mesh.paint(METAL);
    boxes(mesh);
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
    mesh.paint(CLAY);
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

fn foliage(mesh: &mut Mesh) {
    ground(mesh, 7.0, 6.0, SOIL);
    tree(mesh, Vec3::new(-1.6, 0.0, -0.6), 3);
    hedge(
        mesh,
        Vec3::new(-5.0, 0.0, -4.0),
        Vec3::new(5.0, 0.0, -4.0),
        4,
    );
    hedge(mesh, Vec3::new(1.8, 0.0, 1.2), Vec3::new(5.0, 0.0, 0.2), 5);
    mesh.paint(LEAVES);
}

/// The yard's boxes and balls, and sheets from 20 to 2 millimetres that lie on the ground.
fn contact(mesh: &mut Mesh) {
    ground(mesh, 6.0, 5.0, SOIL);
    boxes(mesh);
    for (i, thickness) in [0.02_f32, 0.01, 0.005, 0.002].into_iter().enumerate() {
        let low = Vec3::new(-3.6 + 0.8 * i as f32, 0.0, -0.4 + 0.3 * i as f32);
        mesh.aligned_block(low, low + Vec3::new(0.6, thickness, 0.45));
    }
    mesh.paint(PAINT);
    // A stair of low steps, each of which shades the next.
    for i in 0..10 {
        let low = Vec3::new(-4.6 + 0.3 * i as f32, 0.0, -3.4);
        mesh.aligned_block(low, low + Vec3::new(0.3, 0.04 * (i + 1) as f32, 1.6));
    }
    mesh.paint(METAL);
}

/// A lattice 40 m above the ground, and plates at 12 m.
fn far(mesh: &mut Mesh) {
    ground(mesh, 6.0, 6.0, SOIL);
    for i in 0..9 {
        let at = -4.0 + i as f32;
        let (x, z) = (Vec3::X * 4.4, Vec3::Z * 4.4);
        let (across, along) = (Vec3::new(0.0, 40.0, at), Vec3::new(at, 40.0, 0.0));
        mesh.rod(across - x, across + x, 0.05, 6);
        mesh.rod(along - z, along + z, 0.02, 6);
    }
    mesh.paint(METAL);
    for (x, z, half) in [(-2.5, 1.5, 0.5), (0.5, -1.0, 0.25), (2.5, 2.0, 0.12)] {
        let at = Vec3::new(x, 12.0, z);
        mesh.aligned_block(
            at - Vec3::new(half, 0.02, half),
            at + Vec3::new(half, 0.02, half),
        );
    }
    // Something near the ground, so that shadows of both kinds meet.
    mesh.aligned_block(Vec3::new(-0.4, 0.0, 0.6), Vec3::new(0.4, 0.8, 1.4));
    mesh.paint(CLAY);
}

/// 6 by 5 m, 3 m high, walls 20 cm thick; the window is in the wall at negative x.
fn room(mesh: &mut Mesh) {
    let mut wall = |low: [f32; 3], high: [f32; 3]| {
        mesh.aligned_block(Vec3::from_array(low), Vec3::from_array(high));
    };
    wall([-3.2, -0.2, -2.7], [3.2, 0.0, 2.7]);
    wall([-3.2, 3.0, -2.7], [3.2, 3.2, 2.7]);
    wall([3.0, 0.0, -2.7], [3.2, 3.0, 2.7]);
    wall([-3.0, 0.0, -2.7], [3.0, 3.0, -2.5]);
    wall([-3.0, 0.0, 2.5], [3.0, 3.0, 2.7]);
    // Around the window: 2 m wide, 1.4 m high.
    wall([-3.2, 0.0, -2.7], [-3.0, 0.9, 2.7]);
    wall([-3.2, 2.3, -2.7], [-3.0, 3.0, 2.7]);
    wall([-3.2, 0.9, -2.7], [-3.0, 2.3, -1.0]);
    wall([-3.2, 0.9, 1.0], [-3.0, 2.3, 2.7]);
    mesh.paint(PAINT);
    for z in [-0.5, 0.0, 0.5] {
        mesh.rod(Vec3::new(-3.1, 0.9, z), Vec3::new(-3.1, 2.3, z), 0.025, 8);
    }
    mesh.rod(
        Vec3::new(-3.1, 1.6, -1.0),
        Vec3::new(-3.1, 1.6, 1.0),
        0.02,
        8,
    );
    mesh.paint(METAL);
    table(mesh, Vec3::new(-0.6, 0.0, 0.1), [0.7, 0.4], 0.75);
    table(mesh, Vec3::new(0.7, 0.0, 0.9), [0.22, 0.22], 0.45);
    mesh.aligned_block(Vec3::new(0.88, 0.47, 0.68), Vec3::new(0.92, 0.95, 1.12));
    mesh.paint(WOOD);
    mesh.sphere(Vec3::new(-0.7, 0.9, 0.0), 0.12, 16);
    mesh.paint(CLAY);
}

/// A table on four legs; `half` are half its edges.
fn table(mesh: &mut Mesh, foot: Vec3, [x, z]: [f32; 2], height: f32) {
    let top = foot + Vec3::Y * height;
    mesh.aligned_block(top - Vec3::new(x, 0.02, z), top + Vec3::new(x, 0.02, z));
    for (sx, sz) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        let leg = foot + Vec3::new(sx * (x - 0.05), 0.0, sz * (z - 0.05));
        mesh.rod(leg, leg + Vec3::Y * (height - 0.02), 0.025, 8);
    }
}

/// Four floors of slats, turned against each other, on posts.
fn layers(mesh: &mut Mesh) {
    ground(mesh, 6.0, 6.0, SOIL);
    for (floor, width) in [0.16_f32, 0.1, 0.22, 0.06].into_iter().enumerate() {
        let turn = Quat::from_rotation_y(0.4 + 0.65 * floor as f32);
        let height = 0.6 + 0.9 * floor as f32;
        let count = (3.6 / (2.2 * width)) as u32;
        for i in 0..count {
            let at = (i as f32 + 0.5) / count as f32 * 3.6 - 1.8;
            let half = [
                turn * Vec3::X * 1.8,
                Vec3::Y * 0.015,
                turn * Vec3::Z * (width * 0.5),
            ];
            mesh.block(turn * Vec3::Z * at + Vec3::Y * height, half);
        }
    }
    mesh.paint(WOOD);
    for (x, z) in [(-1.4, -1.4), (-1.4, 1.4), (1.4, -1.4), (1.4, 1.4)] {
        mesh.rod(Vec3::new(x, 0.0, z), Vec3::new(x, 3.4, z), 0.05, 10);
    }
    mesh.paint(METAL);
}

/// Two rows of columns, 60 m long, with beams on top of them.
fn columns(mesh: &mut Mesh) {
    ground(mesh, 14.0, 36.0, SOIL);
    for side in [-3.0, 3.0] {
        for i in 0..16 {
            let foot = Vec3::new(side, 0.0, 30.0 - 4.0 * i as f32);
            mesh.aligned_block(
                foot - Vec3::new(0.5, 0.0, 0.5),
                foot + Vec3::new(0.5, 0.25, 0.5),
            );
            mesh.rod(foot, foot + Vec3::Y * 5.0, 0.35, 20);
        }
        mesh.aligned_block(
            Vec3::new(side - 0.5, 5.0, -31.0),
            Vec3::new(side + 0.5, 5.5, 31.0),
        );
    }
    for i in 0..16 {
        let z = 30.0 - 4.0 * i as f32;
        mesh.aligned_block(
            Vec3::new(-3.5, 5.5, z - 0.15),
            Vec3::new(3.5, 5.8, z + 0.15),
        );
    }
}

/// Three panes on a frame of posts, one above the other and the topmost slanted; a block stands on the ground
/// and a shelf lies between the panes. Beside them a ball of glass and an opaque one.
fn glass(mesh: &mut Mesh) {
    ground(mesh, 5.0, 5.0, SOIL);
    for (x, z) in [(-1.5, -1.1), (-1.5, 1.1), (1.5, -1.1), (1.5, 1.1)] {
        mesh.rod(Vec3::new(x, 0.0, z), Vec3::new(x, 2.3, z), 0.04, 10);
    }
    mesh.paint(METAL);
    mesh.aligned_block(Vec3::new(-0.5, 0.0, -0.4), Vec3::new(0.1, 0.5, 0.2));
    mesh.aligned_block(Vec3::new(-0.9, 1.18, -0.2), Vec3::new(0.9, 1.22, 0.5));
    mesh.sphere(Vec3::new(2.7, 0.4, 1.0), 0.4, 20);
    mesh.paint(WOOD);
    mesh.fade(1.0);
    let panes = [
        (0.8, 0.0, 0.35, Vec3::new(0.2, 0.5, 0.8)),
        (1.6, 0.0, 0.55, Vec3::new(0.8, 0.3, 0.2)),
        (2.1, 0.25, 0.3, Vec3::new(0.3, 0.7, 0.3)),
    ];
    for (height, slope, opacity, colour) in panes {
        let along = Vec3::new(1.3, slope, 0.0);
        let across = Vec3::new(0.0, 0.0, 0.95);
        let middle = Vec3::new(0.1 * height, height, 0.0);
        mesh.quad([
            middle - along + across,
            middle + along + across,
            middle + along - across,
            middle - along - across,
        ]);
        mesh.paint(colour);
        mesh.fade(opacity);
    }
    mesh.sphere(Vec3::new(-2.6, 0.7, 0.8), 0.7, 24);
    mesh.paint(Vec3::new(0.5, 0.7, 0.8));
    mesh.fade(0.4);
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Procedural; 12] = [
        Procedural::Yard,
        Procedural::Box,
        Procedural::Fence,
        Procedural::Foliage,
        Procedural::Wires,
        Procedural::Contact,
        Procedural::Far,
        Procedural::Room,
        Procedural::Layers,
        Procedural::Columns,
        Procedural::Glass,
        Procedural::Empty,
    ];

    #[test]
    fn scenes_are_sound_and_always_the_same() {
        for scene in ALL {
            let mesh = scene.mesh();
            assert_eq!(mesh, scene.mesh(), "{scene:?}");
            assert_eq!(mesh.positions.len(), mesh.normals.len(), "{scene:?}");
            assert_eq!(mesh.positions.len(), mesh.colours.len(), "{scene:?}");
            let is_unit = |n: &Vec3| (n.length() - 1.0).abs() < 1e-4;
            assert!(mesh.normals.iter().all(is_unit), "{scene:?}");
            let mut sound = mesh.clone();
            sound.drop_degenerate();
            assert_eq!(sound.triangles.len(), mesh.triangles.len(), "{scene:?}");
        }
        assert!(Procedural::Yard.mesh().triangles.len() > 15_000);
        assert_eq!(Procedural::Empty.mesh().triangles.len(), 2);
    }
}
