//! Texel coordinates.

/// `i` moved to the nearest coordinate of `size` texels, 0 to `size - 1`.
#[inline(always)]
pub(crate) fn within(i: i32, size: u32) -> u32 {
    let last = size as i32 - 1;
    let i = if i < 0 { 0 } else { i };
    (if i > last { last } else { i }) as u32
}
