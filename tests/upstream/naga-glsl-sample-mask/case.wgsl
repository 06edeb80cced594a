@fragment
fn main(@builtin(sample_mask) covered: u32) -> @builtin(sample_mask) u32 {
    return covered & 5u;
}
