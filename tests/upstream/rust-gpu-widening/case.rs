#[kernel(compute, threads(64))]
pub fn widened(#[element] x: i32, #[element] y: u32) -> (u64, i64) {
    (x as u64, y as i64)
}
