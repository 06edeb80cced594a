//! Subgroups: votes, exchange, reductions, scans, quads; kernels whose results depend on their size,
//! and such that do not.

use hankel_dsl::glam::{IVec2, UVec4, Vec2, Vec4};
use hankel_dsl::{
    Shared, StorageMut, barrier, cooperative, kernel, quad_broadcast, quad_swap_diagonal,
    quad_swap_x, quad_swap_y, subgroup_add, subgroup_all, subgroup_and, subgroup_any,
    subgroup_ballot, subgroup_broadcast, subgroup_broadcast_first, subgroup_exclusive_add,
    subgroup_exclusive_mul, subgroup_inclusive_add, subgroup_inclusive_mul, subgroup_max,
    subgroup_min, subgroup_mul, subgroup_or, subgroup_shuffle, subgroup_shuffle_down,
    subgroup_shuffle_up, subgroup_shuffle_xor, subgroup_xor,
};

/// The sum of each workgroup: its subgroups add without memory, and the first invocation their sums.
#[kernel(compute, threads(64), range(x))]
pub fn quick_sum(
    #[local_index] me: u32,
    #[group_id] group: u32,
    #[subgroup_id] subgroup: u32,
    #[subgroup_count] subgroups: u32,
    #[subgroup_invocation_id] lane: u32,
    #[shared] sums: Shared<'_, u32, 16>,
    #[element] x: Option<u32>,
    #[storage] out: StorageMut<'_, u32>,
) {
    let sum = subgroup_add(x.unwrap_or(0));
    if lane == 0 {
        sums.set(subgroup, sum);
    }
    barrier();
    if me == 0 {
        let mut all = 0_u32;
        let mut i = 0;
        while i < subgroups {
            all = all.wrapping_add(sums.get(i));
            i += 1;
        }
        out.set(group, all);
    }
}

/// The sum over the invocations of the workgroup before this one.
#[cooperative]
pub fn sum_before(
    subgroup: u32,
    lane: u32,
    size: u32,
    sums: Shared<'_, u32, 16>,
    mine: u32,
) -> u32 {
    let before = subgroup_exclusive_add(mine);
    if lane == size - 1 {
        sums.set(subgroup, before.wrapping_add(mine));
    }
    barrier();
    let mut sum = before;
    let mut i = 0;
    while i < subgroup {
        sum = sum.wrapping_add(sums.get(i));
        i += 1;
    }
    sum
}

/// Where in its workgroup each odd number goes, if the odd ones are to stand together.
#[kernel(compute, threads(64), cooperative(sum_before))]
pub fn places_of_odd(
    #[subgroup_id] subgroup: u32,
    #[subgroup_invocation_id] lane: u32,
    #[subgroup_size] size: u32,
    #[shared] sums: Shared<'_, u32, 16>,
    #[element] x: Option<u32>,
) -> u32 {
    sum_before(subgroup, lane, size, sums, x.unwrap_or(0) & 1)
}

/// What the subgroup says of a number: whether any is odd, all are, which are, and how many of those
/// stand before.
#[kernel(compute, threads(64), depends(subgroup_size))]
pub fn votes(#[subgroup_invocation_id] lane: u32, #[element] x: Option<u32>) -> UVec4 {
    let x = x.unwrap_or(0);
    let odd = x & 1 == 1;
    let which = subgroup_ballot(odd);
    // Subgroups of 64 have a second word.
    let (low, high) = if lane < 32 {
        (which.x & ((1 << (lane & 31)) - 1), 0)
    } else {
        (which.x, which.y & ((1 << (lane & 31)) - 1))
    };
    let votes = u32::from(subgroup_any(x & 7 == 7)) + 2 * u32::from(subgroup_all(x & 7 != 3));
    UVec4::new(
        votes,
        which.x,
        which.y,
        low.count_ones() + high.count_ones(),
    )
}

/// What each invocation sums up in a loop, summed over the subgroup, and said by the first one: all of it from another
/// block than that of the operation.
#[kernel(compute, threads(64), depends(subgroup_size))]
pub fn after_loops(#[subgroup_invocation_id] lane: u32, #[element] x: Option<u32>) -> UVec4 {
    let x = x.unwrap_or(1);
    let mut sum = 0_u32;
    let mut i = 0;
    while i < (x & 3) + 1 {
        sum = sum.wrapping_mul(3).wrapping_add(x >> i);
        i += 1;
    }
    let all = subgroup_add(sum);
    let mut from = lane;
    while from > 5 {
        from /= 2;
    }
    let shuffled = subgroup_shuffle(sum, from);
    let mut is_odd = false;
    while i > 0 {
        is_odd ^= x >> i & 1 == 1;
        i -= 1;
    }
    let which = subgroup_ballot(is_odd);
    UVec4::new(all, shuffled, which.x, which.y)
}

/// Values of other invocations of the subgroup; of the neighbours where there are some.
#[kernel(compute, threads(64), depends(subgroup_size))]
pub fn exchanged(
    #[subgroup_invocation_id] lane: u32,
    #[subgroup_size] size: u32,
    #[element] x: Option<u32>,
) -> UVec4 {
    let x = x.unwrap_or(7);
    let (up, down) = (subgroup_shuffle_up(x, 1), subgroup_shuffle_down(x, 2));
    let before = if lane > 0 { up } else { 0 };
    let after = if lane + 2 < size { down } else { 0 };
    let backwards = subgroup_shuffle(x, size - 1 - lane);
    let across = subgroup_shuffle_xor(x, size / 2);
    let first = subgroup_broadcast_first(x) ^ subgroup_broadcast::<_, 2>(x);
    UVec4::new(before, after, backwards ^ first, across)
}

/// Every reduction and every scan of integers, some of them of vectors.
#[kernel(compute, threads(64), depends(subgroup_size))]
pub fn reduced(#[element] x: Option<u32>) -> UVec4 {
    let x = x.unwrap_or(1);
    let signed = x as i32;
    let bits = subgroup_and(x | 0xff) ^ subgroup_or(x & 0xff00) ^ subgroup_xor(x);
    let extremes = subgroup_min(IVec2::new(signed, -(signed >> 1)));
    let greatest = subgroup_max(x) ^ subgroup_max(signed) as u32 ^ subgroup_min(x);
    let products =
        subgroup_mul(x | 1) ^ subgroup_inclusive_mul(x | 1) ^ subgroup_exclusive_mul(x | 1);
    let sums = subgroup_inclusive_add(x) ^ subgroup_exclusive_add(x >> 1);
    UVec4::new(
        bits ^ extremes.x as u32 ^ extremes.y as u32,
        greatest,
        products,
        sums ^ subgroup_add(UVec4::new(x, 1, x ^ 3, 2)).z,
    )
}

/// Sums, products and extremes of floats; all are small integers, so that no order rounds.
#[kernel(compute, threads(64), depends(subgroup_size))]
pub fn reduced_floats(#[element] x: Option<u32>) -> Vec4 {
    let x = (x.unwrap_or(0) & 15) as f32;
    // At most 2^4.
    let factor = if x == 3.0 { 2.0 } else { 1.0 };
    let sums = subgroup_add(Vec2::new(x, x + 1.0));
    Vec4::new(
        sums.x + sums.y * 0.5,
        subgroup_max(x) - subgroup_min(x),
        subgroup_inclusive_add(x) - subgroup_exclusive_add(x),
        subgroup_mul(factor) * 0.5,
    )
}

/// Values of the other three invocations of the quad: the same for every size of subgroups.
#[kernel(compute, threads(64))]
pub fn quads(#[element] x: Option<u32>) -> UVec4 {
    let x = x.unwrap_or(9);
    UVec4::new(
        quad_swap_x(x),
        quad_swap_y(x),
        quad_swap_diagonal(x),
        quad_broadcast::<_, 1>(x),
    )
}
