#[kernel(compute, threads(64))]
pub fn checked(#[element] a: i32, #[element] b: i32) -> i32 {
    a.checked_add(b & 3).unwrap_or(-1)
}
