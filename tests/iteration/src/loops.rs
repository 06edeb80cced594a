//! Loops over ranges, and the same loops by `while`: the test `lean` compares what they cost.

use hankel_dsl::kernel;

/// A step of a sum that depends on the order.
fn step(sum: u32, i: u32) -> u32 {
    (sum ^ i).wrapping_mul(0x9e37_79b1).rotate_left(5)
}

/// Up to a number that is not known when it is compiled.
#[kernel(compute, threads(64))]
pub fn counted_by_for(#[element] x: u32) -> u32 {
    let mut sum = x;
    for i in 0..x & 15 {
        sum = step(sum, i);
    }
    sum
}

/// [`counted_by_for`] by `while`.
#[kernel(compute, threads(64))]
pub fn counted_by_while(#[element] x: u32) -> u32 {
    let mut sum = x;
    let end = x & 15;
    let mut i = 0;
    while i < end {
        sum = step(sum, i);
        i += 1;
    }
    sum
}

/// The places around a pixel: signed ranges within each other, and a way out of the inner one.
#[kernel(compute, threads(64))]
pub fn window_by_for(#[element] x: u32) -> u32 {
    let reach = (x & 7) as i32;
    let mut sum = x;
    for dy in -reach..reach {
        for dx in -1..2 {
            let place = (dy * 16 + dx) as u32;
            if sum == place {
                break;
            }
            sum = step(sum, place);
        }
    }
    sum
}

/// [`window_by_for`] by `while`.
#[kernel(compute, threads(64))]
pub fn window_by_while(#[element] x: u32) -> u32 {
    let reach = (x & 7) as i32;
    let mut sum = x;
    let mut dy = -reach;
    while dy < reach {
        let mut dx = -1;
        while dx < 2 {
            let place = (dy * 16 + dx) as u32;
            if sum == place {
                break;
            }
            sum = step(sum, place);
            dx += 1;
        }
        dy += 1;
    }
    sum
}
