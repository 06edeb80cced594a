//! Marching cubes (Lorensen and Cline, Marching Cubes, 1987): the surface where a field on a grid has a
//! value. The table of triangles is derived, not copied: [`table`].

use hankel_dsl::glam::{UVec3, Vec3, Vec4};
use hankel_dsl::{Atomics, Buffer, Element, StorageMut, kernel};

/// The grid.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Grid {
    /// Cells along each axis; there is one value more.
    pub cells: UVec3,
    /// The value on the surface.
    #[range(-0.3..=0.3)]
    pub level: f32,
}

/// A triangle, counter-clockwise where the field is above the level. Unit: cells.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Triangle {
    /// A corner.
    pub a: Vec4,
    /// A corner.
    pub b: Vec4,
    /// A corner.
    pub c: Vec4,
}

/// The triangles of each cell, in whatever order; the counter says how many. What `triangles` has no
/// room for is left out.
///
/// `table` has two words for each of 256 cases, see [`table`].
#[kernel(
    compute,
    threads(4, 4, 4),
    range(grid.cells),
    parity(non_finite, why = "differences of absurd values overflow")
)]
pub fn marching_cubes(
    #[index] cell: UVec3,
    #[uniform] grid: &Grid,
    #[storage]
    #[length(1344)]
    field: Buffer<'_, f32>,
    #[storage]
    #[length(512)]
    table: Buffer<'_, u32>,
    #[atomic] count: Atomics<'_>,
    #[storage(unordered)]
    #[length(5005)]
    triangles: StorageMut<'_, Triangle>,
) {
    let row = grid.cells.x + 1;
    let slice = row * (grid.cells.y + 1);
    let origin = cell.x + row * cell.y + slice * cell.z;
    // Corner `c` lies at the bits of `c`: x, y, z.
    let value = |c: u32| field.get(origin + (c & 1) + row * ((c >> 1) & 1) + slice * (c >> 2));
    let mut case = 0;
    let mut corner = 0;
    while corner < 8 {
        if value(corner) < grid.level {
            case |= 1 << corner;
        }
        corner += 1;
    }
    let low = table.get(case * 2);
    let high = table.get(case * 2 + 1);
    let number = high >> 28;
    let number = if number > 5 { 5 } else { number };
    if number == 0 {
        return;
    }
    let from = Vec3::new(cell.x as f32, cell.y as f32, cell.z as f32);
    // Where the surface meets the edge of the `i`-th corner of a triangle.
    let point = |i: u32| {
        let word = if i < 8 {
            low >> (4 * i)
        } else {
            high >> (4 * (i - 8))
        };
        let (a, b) = ends(word & 15);
        let (at_a, at_b) = (value(a), value(b));
        let t = (grid.level - at_a) / (at_b - at_a);
        let start = Vec3::new((a & 1) as f32, ((a >> 1) & 1) as f32, (a >> 2) as f32);
        let end = Vec3::new((b & 1) as f32, ((b >> 1) & 1) as f32, (b >> 2) as f32);
        (from + start + (end - start) * t).extend(1.0)
    };
    let first = count.add(0, number);
    let mut i = 0;
    while i < number {
        if first + i < triangles.len() {
            let triangle = Triangle {
                a: point(3 * i),
                b: point(3 * i + 1),
                c: point(3 * i + 2),
            };
            triangles.set(first + i, triangle);
        }
        i += 1;
    }
}

/// The corners that an edge joins, the lower one first. Edges 0 to 3 lie along x, 4 to 7 along y, 8 to 11
/// along z; the other two coordinates are the bits of what is left.
#[inline(always)]
fn ends(edge: u32) -> (u32, u32) {
    let (u, v) = (edge & 1, (edge >> 1) & 1);
    if edge < 4 {
        (u * 2 + v * 4, u * 2 + v * 4 + 1)
    } else if edge < 8 {
        (u + v * 4, u + v * 4 + 2)
    } else {
        (u + v * 2, u + v * 2 + 4)
    }
}

#[cfg(not(target_arch = "spirv"))]
pub use derived::table;

#[cfg(not(target_arch = "spirv"))]
mod derived {
    use std::vec;
    use std::vec::Vec;

    use super::ends;

    /// The corners of each face, counter-clockwise from outside.
    const FACES: [[u32; 4]; 6] = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];

    fn edge_between(a: u32, b: u32) -> u32 {
        let pair = (a.min(b), a.max(b));
        (0..12)
            .find(|edge| ends(*edge) == pair)
            .unwrap_or_else(|| panic!("corners {a} and {b} are not neighbours"))
    }

    /// The triangles of a case, whose bit `c` says that corner `c` is below the level: edges, three for
    /// each.
    ///
    /// On each face, each run of corners below the level is cut off by a line from the edge before it
    /// to the edge after it, counter-clockwise from outside; where two such corners lie opposite each other, they stay apart. The face
    /// of the neighbour has the same corners and so the same lines: there are no holes. Every edge with
    /// the surface on it has one line to it and one from it, so that lines make loops, which are filled
    /// by fans.
    fn triangles(case: u32) -> Vec<u32> {
        let below = |corner: u32| case >> corner & 1 == 1;
        let mut next = [None; 12];
        for face in FACES {
            for i in 0..4 {
                // A run begins after corner i.
                if below(face[i]) || !below(face[(i + 1) % 4]) {
                    continue;
                }
                let mut end = i + 1;
                while below(face[(end + 1) % 4]) {
                    end += 1;
                }
                let enters = edge_between(face[i], face[(i + 1) % 4]);
                let leaves = edge_between(face[end % 4], face[(end + 1) % 4]);
                next[enters as usize] = Some(leaves);
            }
        }
        let mut edges = Vec::new();
        for start in 0..12_u32 {
            let mut around = Vec::new();
            let mut at = start;
            while let Some(to) = next[at as usize].take() {
                around.push(at);
                at = to;
            }
            for i in 2..around.len() {
                edges.extend([around[0], around[i - 1], around[i]]);
            }
        }
        edges
    }

    /// Two words for each case: the edges of up to five triangles, four bits each, the first in the
    /// lowest bits, and in the highest four bits of the second word how many triangles there are.
    #[must_use]
    pub fn table() -> Vec<u32> {
        let mut words = vec![0_u32; 512];
        for case in 0..256 {
            let edges = triangles(case);
            assert!(
                edges.len() <= 15,
                "case {case} has more than five triangles"
            );
            for (i, edge) in edges.iter().enumerate() {
                words[case as usize * 2 + i / 8] |= edge << (4 * (i % 8));
            }
            words[case as usize * 2 + 1] |= (edges.len() as u32 / 3) << 28;
        }
        words
    }
}
