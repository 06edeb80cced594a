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

/// `c` stays a number, and `v` a vector: the loop assigns each to itself.
#[kernel(compute, threads(64))]
pub fn vector(#[element] x: UVec4) -> UVec4 {
    let (mut v, mut c) = (UVec3::new(0, 0, 2), x.z);
    if x.x == 7 {
        v = UVec3::new(0, 0, 3);
    } else if x.y == 5 {
        let mut n = 0;
        while n < 4 {
            n += 1;
            (c, c) = (c, c);
            (v, v) = (v, v);
        }
    }
    UVec4::new(1 % (v.z | 1), c, 0, 0)
}
