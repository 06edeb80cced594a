//! The triangle that covers a target: what full-screen passes are drawn with.

use hankel_dsl::glam::Vec4;
use hankel_dsl::kernel;

/// Corner 0, 1 or 2 of it.
#[kernel(vertex)]
pub fn screen(#[vertex_index] corner: u32) -> Vec4 {
    let x = if corner == 1 { 3.0 } else { -1.0 };
    let y = if corner == 2 { 3.0 } else { -1.0 };
    Vec4::new(x, y, 0.0, 1.0)
}
