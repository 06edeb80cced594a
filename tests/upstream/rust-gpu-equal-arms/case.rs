/// Changes some numbers; two arms do nothing.
#[kernel(compute, threads(64))]
pub fn arms(#[element] x: u32) -> u32 {
    let mut y = x;
    match x % 3 {
        0 => y = 5,
        1 => {}
        2 => {}
        _ => y = 7,
    }
    y
}
