//! The native executor of kernels whose invocations work together, and of those that write where
//! they like: what comes out, and what it reports.
#![allow(
    unused_qualifications,
    reason = "barriers and helpers are found by their path, too"
)]

use hankel_dsl::native::{Arg, Call, CallError, Mode};
use hankel_dsl::{
    Atomics, Shared, StorageMut, barrier, cooperative, glam::*, kernel, storage_barrier,
};

/// Mirrors each workgroup's numbers.
#[kernel(compute, threads(8))]
fn mirror(
    #[local_index] me: u32,
    #[shared] slots: Shared<'_, u32, 8>,
    #[element] x: Option<u32>,
) -> u32 {
    slots.set(me, x.unwrap_or(0));
    hankel_dsl::barrier();
    slots.get(7 - me)
}

/// Waits in one half of the workgroup only.
#[kernel(compute, threads(8), range(16))]
fn diverges(#[local_index] me: u32) -> u32 {
    if me < 4 {
        barrier();
    }
    me
}

/// Waits at another place in each half.
#[kernel(compute, threads(4, 2), range(4, 2))]
fn elsewhere(#[local_id] local: UVec2) -> u32 {
    if local.y == 0 {
        barrier();
    } else {
        storage_barrier();
    }
    local.x
}

/// What is in workgroup memory before anyone writes it.
#[kernel(compute, threads(8), range(8))]
fn unwritten(#[local_index] me: u32, #[shared] slots: Shared<'_, u32, 8>) -> u32 {
    slots.get(me)
}

/// Reads beyond the workgroup's memory.
#[kernel(compute, threads(8), range(8))]
fn beyond(#[local_index] me: u32, #[shared] slots: Shared<'_, u32, 8>) -> u32 {
    slots.set(me, 1);
    slots.get(me + 1)
}

/// The sum of two; waits on the way.
#[cooperative]
fn through<T: hankel_dsl::Stored + core::ops::Add<Output = T>>(
    me: u32,
    slots: Shared<'_, T, 8>,
    x: T,
) -> T {
    slots.set(me, x);
    barrier();
    let sum = slots.get(me) + slots.get(me ^ 1);
    barrier();
    sum
}

/// Calls a helper that calls a helper, by its path and with its type.
#[kernel(compute, threads(8), range(8), cooperative(twice))]
fn helped(#[local_index] me: u32, #[shared] slots: Shared<'_, u32, 8>) -> u32 {
    self::twice(me, slots)
}

/// Waits in another helper.
#[cooperative(through)]
fn twice(me: u32, slots: Shared<'_, u32, 8>) -> u32 {
    let once = through::<u32>(me, slots, me);
    through(me, slots, once)
}

/// Writes where it is told.
#[kernel(compute, threads(8))]
fn scatter(#[element] at: u32, #[storage] out: StorageMut<'_, Vec2>) {
    out.set(at, Vec2::new(at as f32, 1.0));
}

/// A number for each invocation, in place, and what it was.
#[kernel(compute, threads(8))]
fn number(
    #[index] i: u32,
    #[element] x: &mut u32,
    #[atomic] counts: Atomics<'_, i32>,
) -> (u32, f32) {
    let before = *x;
    *x = i;
    counts.min(0, -(i as i32));
    (before, 0.5)
}

hankel_dsl::kernels![
    mirror, diverges, elsewhere, unwritten, beyond, helped, scatter, number
];

fn run(name: &str, args: Vec<Arg<'_>>, mode: Mode) -> Result<(), CallError> {
    let entry = entries().into_iter().find(|e| e.kernel.name == name);
    (entry.unwrap().run)(&mut Call {
        args,
        constants: vec![],
        mode,
    })
}

fn bytes<T: bytemuck::Pod>(values: &mut [T]) -> &mut [u8] {
    bytemuck::cast_slice_mut(values)
}

fn panics(name: &str, count: usize) -> String {
    let mut out = vec![0_u32; count];
    let result = run(name, vec![Arg::BytesMut(bytes(&mut out))], Mode::REFERENCE);
    match result {
        Err(CallError::Panic { message }) => message,
        other => panic!("{other:?}"),
    }
}

#[test]
fn invocations_of_a_workgroup_see_what_the_others_wrote() {
    // The last workgroup has fewer numbers than invocations.
    let x: Vec<u32> = (0..1003).collect();
    for mode in [Mode::REFERENCE, Mode::default()] {
        let mut out = vec![0_u32; x.len()];
        let args = vec![
            Arg::Bytes(bytemuck::cast_slice(&x)),
            Arg::BytesMut(bytes(&mut out)),
        ];
        run("mirror", args, mode).unwrap();
        for (i, value) in out.iter().enumerate() {
            let other = (i / 8 * 8 + 7 - i % 8) as u32;
            assert_eq!(*value, if other < 1003 { other } else { 0 });
        }
    }
}

#[test]
fn a_barrier_that_some_pass_by_is_reported_with_both_invocations() {
    let message = panics("diverges", 16);
    assert!(
        message.contains(
            "in workgroup (0, 0, 0), invocation (0, 0, 0) waits at kernels/dsl/tests/workgroup.rs:"
        ) || message
            .contains("in workgroup (0, 0, 0), invocation (0, 0, 0) waits at tests/workgroup.rs:"),
        "{message}"
    );
    assert!(
        message.ends_with("but invocation (4, 0, 0) has ended"),
        "{message}"
    );
}

#[test]
fn two_barriers_are_not_one() {
    let message = panics("elsewhere", 8);
    assert!(
        message.contains("but invocation (0, 1, 0) waits at "),
        "{message}"
    );
}

#[test]
fn workgroup_memory_begins_with_nothing_of_use() {
    let mut out = vec![0_u32; 8];
    let args = vec![Arg::BytesMut(bytes(&mut out))];
    run("unwritten", args, Mode::REFERENCE).unwrap();
    assert_eq!(out, [0xa5a5_a5a5; 8]);
}

#[test]
fn an_index_beyond_workgroup_memory_is_reported() {
    let message = panics("beyond", 8);
    assert_eq!(
        message,
        "index 8 is out of range: the memory has 8 elements"
    );
}

#[test]
fn helpers_wait_too() {
    let mut out = vec![0_u32; 8];
    let args = vec![Arg::BytesMut(bytes(&mut out))];
    run("helped", args, Mode::REFERENCE).unwrap();
    assert_eq!(out, [2, 2, 10, 10, 18, 18, 26, 26]);
}

#[test]
#[should_panic(expected = "barrier() was called outside of a workgroup")]
fn a_barrier_needs_a_workgroup() {
    barrier();
}

#[test]
fn what_is_written_anywhere_lies_there() {
    let at: Vec<u32> = (0..5000).map(|i| (i * 7) % 5000).collect();
    let mut out = vec![Vec2::ZERO; 5000];
    let args = vec![
        Arg::Bytes(bytemuck::cast_slice(&at)),
        Arg::BytesMut(bytes(&mut out)),
    ];
    run("scatter", args, Mode::default()).unwrap();
    assert!(
        out.iter()
            .enumerate()
            .all(|(i, v)| *v == Vec2::new(i as f32, 1.0))
    );
}

#[test]
fn an_index_beyond_a_buffer_is_reported() {
    let mut out = vec![Vec2::ZERO; 3];
    let args = vec![
        Arg::Bytes(bytemuck::cast_slice(&[0_u32, 3])),
        Arg::BytesMut(bytes(&mut out)),
    ];
    let Err(CallError::Panic { message }) = run("scatter", args, Mode::REFERENCE) else {
        panic!("it ran");
    };
    assert_eq!(
        message,
        "index 3 is out of range: the memory has 3 elements"
    );
}

#[test]
fn an_element_is_changed_in_place_beside_two_outputs() {
    let mut x: Vec<u32> = (100..110).collect();
    let (mut before, mut half) = (vec![0_u32; 10], vec![0_f32; 10]);
    let mut counts = [5_i32];
    let args = vec![
        Arg::BytesMut(bytes(&mut x)),
        Arg::BytesMut(bytes(&mut counts)),
        Arg::BytesMut(bytes(&mut before)),
        Arg::BytesMut(bytes(&mut half)),
    ];
    run("number", args, Mode::default()).unwrap();
    assert_eq!(x, (0..10).collect::<Vec<_>>());
    assert_eq!(before, (100..110).collect::<Vec<_>>());
    assert_eq!((half, counts), (vec![0.5; 10], [-9]));
}

#[test]
fn an_output_that_is_too_short_is_refused() {
    let mut x = [0_u32; 10];
    let (mut before, mut half) = (vec![0_u32; 10], vec![0_f32; 9]);
    let mut counts = [0_i32];
    let args = vec![
        Arg::BytesMut(bytes(&mut x)),
        Arg::BytesMut(bytes(&mut counts)),
        Arg::BytesMut(bytes(&mut before)),
        Arg::BytesMut(bytes(&mut half)),
    ];
    assert!(matches!(
        run("number", args, Mode::default()),
        Err(CallError::Length {
            name: "output[1]",
            ..
        })
    ));
}
