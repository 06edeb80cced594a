/// `a` becomes `c` only where `x.w & 3` is 0.
#[kernel(compute, threads(64))]
pub fn wrong(#[element] x: UVec4) -> UVec4 {
    let (mut a, mut c) = (x.x, x.z);
    for _ in 0..x.y & 3 {
        for _ in 0..7 {
            if x.w & 3 == 0 {
                (c, a) = (c, c);
            }
        }
        c += 1;
    }
    let b = c;
    for _ in 0..3 {
        c = x.y;
    }
    UVec4::new(a, b, c, 0)
}
