//! Subgroups on the host: what each operation gives, for every size, and what is reported.

use hankel_dsl::native::{Arg, Call, CallError, Mode, SUBGROUP_SIZES, describe::Subgroups};
use hankel_dsl::{
    barrier, cooperative, glam::*, kernel, quad_broadcast, quad_swap_diagonal, quad_swap_x,
    quad_swap_y, subgroup_add, subgroup_all, subgroup_and, subgroup_any, subgroup_ballot,
    subgroup_broadcast, subgroup_broadcast_first, subgroup_exclusive_add, subgroup_exclusive_mul,
    subgroup_inclusive_add, subgroup_inclusive_mul, subgroup_max, subgroup_min, subgroup_mul,
    subgroup_or, subgroup_shuffle, subgroup_shuffle_down, subgroup_shuffle_up,
    subgroup_shuffle_xor, subgroup_xor,
};

/// Invocations of a workgroup: no multiple of any size.
const THREADS: usize = 75;

/// Who it is.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn who(
    #[subgroup_size] size: u32,
    #[subgroup_invocation_id] lane: u32,
    #[subgroup_id] subgroup: u32,
    #[subgroup_count] subgroups: u32,
    #[element] _x: Option<u32>,
) -> UVec4 {
    UVec4::new(size, lane, subgroup, subgroups)
}

/// Votes.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn votes(#[element] x: Option<u32>) -> UVec4 {
    let odd = x.unwrap_or(0) & 1 == 1;
    let ballot = subgroup_ballot(odd);
    UVec4::new(
        subgroup_any(odd).into(),
        subgroup_all(odd).into(),
        ballot.x,
        ballot.y,
    )
}

/// Values of others.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn shuffles(#[subgroup_invocation_id] lane: u32, #[element] x: Option<u32>) -> UVec4 {
    let x = x.unwrap_or(0);
    UVec4::new(
        subgroup_shuffle(x, lane / 2),
        subgroup_shuffle_xor(x, 1),
        subgroup_shuffle_up(x, 1),
        subgroup_shuffle_down(x, 3),
    )
}

/// Values of certain ones, of vectors.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn broadcasts(#[element] x: Option<u32>) -> UVec4 {
    let x = x.unwrap_or(0);
    let third = subgroup_broadcast::<_, 2>(UVec4::new(x, 1, 2, x + 1));
    UVec4::new(
        third.x,
        third.w,
        subgroup_broadcast_first(x),
        quad_broadcast::<u32, 1>(x),
    )
}

/// Values of the quad.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn quads(#[element] x: Option<u32>) -> UVec4 {
    let x = x.unwrap_or(0);
    UVec4::new(quad_swap_x(x), quad_swap_y(x), quad_swap_diagonal(x), 0)
}

/// Reductions of unsigned integers.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn reductions(#[element] x: Option<u32>) -> UVec4 {
    let x = x.unwrap_or(0);
    UVec4::new(
        subgroup_add(x) ^ subgroup_mul(x),
        subgroup_min(x) ^ subgroup_max(x),
        subgroup_and(x) ^ subgroup_or(x),
        subgroup_xor(x),
    )
}

/// Reductions of signed integers and floats.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn signed(#[element] x: Option<u32>) -> IVec4 {
    let x = 50 - x.unwrap_or(0) as i32;
    IVec4::new(
        subgroup_min(x),
        subgroup_max(x),
        subgroup_add(x as f32) as i32,
        subgroup_min(Vec2::new(0.0, x as f32)).y as i32,
    )
}

/// Scans.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn scans(#[element] x: Option<u32>) -> UVec4 {
    let x = x.unwrap_or(0);
    UVec4::new(
        subgroup_inclusive_add(x),
        subgroup_exclusive_add(x),
        subgroup_inclusive_mul(x),
        subgroup_exclusive_mul(x),
    )
}

/// A sum in a helper.
#[cooperative]
fn doubled(x: u32) -> u32 {
    barrier();
    2 * subgroup_add(x)
}

/// Subgroups by a helper only, in control flow that differs from subgroup to subgroup.
#[kernel(compute, threads(75), depends(subgroup_size), cooperative(doubled))]
fn helped(#[element] x: Option<u32>) -> u32 {
    doubled(x.unwrap_or(0))
}

/// Each subgroup goes its own way.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn ways(#[subgroup_id] subgroup: u32, #[element] _x: Option<u32>) -> u32 {
    let mut sum = 0;
    for _ in 0..subgroup {
        sum += subgroup_add(1);
    }
    sum
}

/// Adds in one half of the subgroup.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn diverges(#[subgroup_invocation_id] lane: u32, #[element] _x: Option<u32>) -> u32 {
    if lane < 2 { subgroup_add(1) } else { 0 }
}

/// Gives each invocation a distance of its own.
#[kernel(compute, threads(75), depends(subgroup_size))]
fn uneven(#[subgroup_invocation_id] lane: u32, #[element] _x: Option<u32>) -> u32 {
    subgroup_shuffle_up(lane, lane)
}

/// Asks for an invocation that small subgroups do not have.
#[kernel(compute, threads(64), depends(subgroup_size))]
fn beyond(#[element] x: Option<u32>) -> u32 {
    subgroup_broadcast::<_, 5>(x.unwrap_or(0))
}

hankel_dsl::kernels![
    who, votes, shuffles, broadcasts, quads, reductions, signed, scans, helped, ways, diverges,
    uneven, beyond
];

fn run(name: &str, mode: Mode, words: usize) -> Result<Vec<Vec<u32>>, CallError> {
    let all = entries();
    let entry = all.iter().find(|e| e.kernel.name == name).unwrap();
    let x: Vec<u32> = (0..THREADS as u32).collect();
    let mut out = vec![0_u128; THREADS * words.div_ceil(4)];
    let out_bytes = &mut bytemuck::cast_slice_mut(&mut out)[..THREADS * words * 4];
    let mut args = vec![Arg::Bytes(bytemuck::cast_slice(&x))];
    args.push(Arg::BytesMut(out_bytes));
    (entry.run)(&mut Call {
        args,
        constants: Vec::new(),
        mode,
    })?;
    let out: &[u32] = bytemuck::cast_slice(&out);
    Ok(out[..THREADS * words]
        .chunks(words)
        .map(<[u32]>::to_vec)
        .collect())
}

/// What stands in the subgroup of `i`, and which of it `i` is.
fn subgroup_of(i: usize, size: usize) -> (Vec<u32>, usize) {
    let start = i / size * size;
    let all = start as u32..(start + size).min(THREADS) as u32;
    (all.collect(), i - start)
}

/// Compares a kernel with a function of the subgroup's numbers, which are those of the invocations,
/// and of the own one among them; none is any value.
fn agrees(name: &str, expected: impl Fn(&[u32], usize) -> [Option<u32>; 4]) {
    use hankel_dsl::native::sanitize::Order;
    for size in SUBGROUP_SIZES {
        let modes = [Mode::REFERENCE, Mode::default()]
            .into_iter()
            .chain(Order::ALL.map(Mode::sanitized));
        for mode in modes {
            let rows = run(name, mode.in_subgroups_of(size), 4).unwrap();
            for (i, row) in rows.iter().enumerate() {
                let (all, own) = subgroup_of(i, size as usize);
                for (got, expected) in row.iter().zip(expected(&all, own)) {
                    assert!(
                        expected.is_none_or(|it| it == *got),
                        "{name}, size {size}, {mode:?}, invocation {i}: {got}, not {expected:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn invocations_know_their_subgroup() {
    for size in SUBGROUP_SIZES {
        let rows = run("who", Mode::REFERENCE.in_subgroups_of(size), 4).unwrap();
        for (i, row) in (0..).zip(rows) {
            assert_eq!(row, [size, i % size, i / size, 75_u32.div_ceil(size)]);
        }
    }
    assert_eq!(
        run("who", Mode::REFERENCE.in_subgroups_of(12), 4),
        Err(CallError::Subgroups { size: 12 })
    );
}

#[test]
fn each_operation_gives_what_its_text_says() {
    let some = |values: [u32; 4]| values.map(Some);
    agrees("votes", |all, _| {
        let bits: u64 = all
            .iter()
            .zip(0..)
            .map(|(x, i)| u64::from(x & 1) << i)
            .sum();
        let odd = |x: &u32| x & 1 == 1;
        some([
            all.iter().any(odd).into(),
            all.iter().all(odd).into(),
            bits as u32,
            (bits >> 32) as u32,
        ])
    });
    agrees("shuffles", |all, own| {
        [
            all.get(own / 2).copied(),
            all.get(own ^ 1).copied(),
            own.checked_sub(1).map(|i| all[i]),
            all.get(own + 3).copied(),
        ]
    });
    agrees("broadcasts", |all, own| {
        some([
            all[2],
            all[2] + 1,
            all[0],
            *all.get(own & !3 | 1).unwrap_or(&0xa5a5_a5a5),
        ])
    });
    agrees("quads", |all, own| {
        let at = |i: usize| all.get(i).copied();
        [at(own ^ 1), at(own ^ 2), at(own ^ 3), Some(0)]
    });
    agrees("reductions", |all, _| {
        let fold = |f: fn(u32, u32) -> u32| all.iter().copied().reduce(f).unwrap();
        some([
            fold(u32::wrapping_add) ^ fold(u32::wrapping_mul),
            fold(u32::min) ^ fold(u32::max),
            fold(|a, b| a & b) ^ fold(|a, b| a | b),
            fold(|a, b| a ^ b),
        ])
    });
    agrees("signed", |all, _| {
        let mine = all.iter().map(|x| 50 - *x as i32);
        let (least, most) = (mine.clone().min().unwrap(), mine.clone().max().unwrap());
        some([least, most, mine.sum(), least].map(|x| x as u32))
    });
    agrees("scans", |all, own| {
        let sum = |end: usize| all[..end].iter().sum();
        let product = |end: usize| all[..end].iter().fold(1, |a: u32, b| a.wrapping_mul(*b));
        some([sum(own + 1), sum(own), product(own + 1), product(own)])
    });
}

#[test]
fn a_helper_exchanges_and_subgroups_go_their_own_ways() {
    for size in SUBGROUP_SIZES {
        let mode = Mode::REFERENCE.in_subgroups_of(size);
        let (helped, ways) = (
            run("helped", mode, 1).unwrap(),
            run("ways", mode, 1).unwrap(),
        );
        for i in 0..THREADS {
            let (all, _) = subgroup_of(i, size as usize);
            assert_eq!(helped[i], [2 * all.iter().sum::<u32>()]);
            assert_eq!(ways[i], [i as u32 / size * all.len() as u32]);
        }
    }
    for entry in entries() {
        assert_eq!(
            entry.kernel.subgroups,
            Subgroups::Sized,
            "{}",
            entry.kernel.name
        );
    }
}

#[test]
fn what_is_wrong_is_reported() {
    let message = |name: &str, size: u32| {
        let mode = Mode::REFERENCE.in_subgroups_of(size);
        run(name, mode, 1).unwrap_err().to_string()
    };
    let diverged = message("diverges", 8);
    assert!(
        diverged.contains("an operation of the subgroup in control flow that is not the same")
            && diverged.contains("invocation (0, 0, 0) waits at kernels/dsl/tests/subgroups.rs:")
            && diverged.contains("invocation (2, 0, 0) has ended"),
        "{diverged}"
    );
    let uneven = message("uneven", 4);
    assert!(
        uneven.contains("the delta of subgroup_shuffle_up at kernels/dsl/tests/subgroups.rs:")
            && uneven.contains("must be the same for the subgroup"),
        "{uneven}"
    );
    let beyond = message("beyond", 4);
    assert!(
        beyond.contains("takes the value of invocation 5 of a subgroup of 4"),
        "{beyond}"
    );
    assert!(run("beyond", Mode::REFERENCE.in_subgroups_of(8), 1).is_ok());
    let alone = std::panic::catch_unwind(|| subgroup_any(true)).unwrap_err();
    let words = alone.downcast_ref::<String>().unwrap();
    assert!(
        words.contains("subgroup_any() was called outside"),
        "{words}"
    );
}
