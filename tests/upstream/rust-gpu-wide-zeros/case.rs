#[kernel(compute, threads(64))]
pub fn zeros(#[element] x: u32) -> u32 {
    (u64::from(x) << 20).leading_zeros()
}
