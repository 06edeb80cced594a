//! Geometry: where vertices go. Matrices are given as rows and multiplied by explicit sums, whose
//! order is then the same on every backend.

use hankel_dsl::glam::{Vec3, Vec4};
use hankel_dsl::{Element, kernel};

/// A projective transform.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Transform {
    /// Row of the clip-space x coordinate.
    pub row_x: Vec4,
    /// Row of the clip-space y coordinate, up positive.
    pub row_y: Vec4,
    /// Row of the clip-space depth; depth / w is 0 at the near plane and 1 at the far plane.
    pub row_z: Vec4,
    /// Row of w.
    pub row_w: Vec4,
}

/// `row` times the point `p`.
#[inline(always)]
pub fn row_times_point(row: Vec4, p: Vec3) -> f32 {
    row.x * p.x + row.y * p.y + row.z * p.z + row.w
}

impl Transform {
    /// The point `p` in clip space.
    #[inline(always)]
    pub fn apply(&self, p: Vec3) -> Vec4 {
        Vec4::new(
            row_times_point(self.row_x, p),
            row_times_point(self.row_y, p),
            row_times_point(self.row_z, p),
            row_times_point(self.row_w, p),
        )
    }
}

/// A vertex as the light sees it, for the depth-only pass of the shadow map.
#[kernel(
    vertex,
    parity(non_finite, why = "sums of products: those of absurd numbers overflow")
)]
pub fn light_depth(#[attribute] position: Vec3, #[uniform] light: &Transform) -> Vec4 {
    light.apply(position)
}

/// A vertex of a triangle that covers the target: the fragment forms of image passes are drawn with it, as three
/// vertices without attributes.
#[kernel(vertex)]
pub fn full_screen(#[vertex_index] vertex: u32) -> Vec4 {
    // The target is from -1 to 1.
    let x = if vertex == 1 { 3.0 } else { -1.0 };
    let y = if vertex == 2 { 3.0 } else { -1.0 };
    Vec4::new(x, y, 0.0, 1.0)
}
