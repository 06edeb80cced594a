//! The product of two matrices, tile by tile through workgroup memory.

use hankel_dsl::glam::UVec2;
use hankel_dsl::{Buffer, Element, Shared, barrier, kernel};

/// Rows and columns of a tile.
const TILE: u32 = 16;

/// Sizes of the matrices, which lie in their buffers row by row.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Shape {
    /// Columns and rows of the product.
    #[range(1..=40)]
    pub size: UVec2,
    /// Columns of the left matrix, rows of the right one.
    #[range(1..=40)]
    pub inner: u32,
    /// Fills the structure up.
    pub padding: u32,
}

/// The product of two matrices of any size. Tiles that reach beyond a matrix are filled up with zeros.
#[kernel(
    compute,
    threads(16, 16),
    range(shape.size),
    parity(non_finite, why = "sums and products of absurd numbers overflow")
)]
pub fn matrix_product(
    #[index] at: UVec2,
    #[local_id] local: UVec2,
    #[local_index] me: u32,
    #[shared] left: Shared<'_, f32, 256>,
    #[shared] right: Shared<'_, f32, 256>,
    #[uniform] shape: &Shape,
    #[storage]
    #[length(2440)]
    a: Buffer<'_, f32>,
    #[storage]
    #[length(2440)]
    b: Buffer<'_, f32>,
) -> f32 {
    let (columns, rows, inner) = (shape.size.x, shape.size.y, shape.inner);
    let mut sum = 0.0;
    let mut start = 0;
    while start < inner {
        let (column, row) = (start + local.x, start + local.y);
        let mut of_left = 0.0;
        if at.y < rows && column < inner {
            of_left = a.get(at.y * inner + column);
        }
        let mut of_right = 0.0;
        if row < inner && at.x < columns {
            of_right = b.get(row * columns + at.x);
        }
        left.set(me, of_left);
        right.set(me, of_right);
        barrier();
        let mut k = 0;
        while k < TILE {
            sum += left.get(local.y * TILE + k) * right.get(k * TILE + local.x);
            k += 1;
        }
        barrier();
        start += TILE;
    }
    sum
}
