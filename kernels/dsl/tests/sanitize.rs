//! The sanitizer: a planted fault of each kind is found, with the lines and the invocations, and
//! what is right is left alone.

use hankel_dsl::access::ReadWrite;
use hankel_dsl::format::R32Uint;
use hankel_dsl::glam::{UVec2, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::sanitize::Order;
use hankel_dsl::native::{
    self, Address, Arg, Call, CallError, Filter, Mode, TextureMut, TextureRef,
};
use hankel_dsl::{
    Atomics, Sampler, Shared, SharedAtomics, StorageMut, StorageTexture2d, Texture2dArray,
    TextureCube, barrier, kernel, storage_barrier,
};

/// Reads what its neighbour writes.
#[kernel(compute, threads(8), range(8))]
fn neighbour(#[index] i: u32, #[storage] sums: StorageMut<'_, u32>) {
    sums.set(i, i);
    sums.set(i, sums.get((i + 1) % 8));
}

/// Two invocations write one element.
#[kernel(compute, threads(8), range(8))]
fn both(#[index] i: u32, #[storage] sums: StorageMut<'_, UVec2>) {
    sums.set(i / 2, UVec2::new(i, i));
}

/// The same, counted by atomic operations.
#[kernel(compute, threads(8), range(8))]
fn counted(#[index] i: u32, #[atomic] sums: Atomics<'_>) {
    sums.add(i / 2, i);
}

/// Reads its neighbour's element without a barrier.
#[kernel(compute, threads(8), range(16))]
fn no_barrier(#[local_index] me: u32, #[shared] tile: Shared<'_, u32, 8>) -> u32 {
    tile.set(me, me);
    tile.get(me ^ 1)
}

/// With one, but overwrites it before the neighbour has read it.
#[kernel(compute, threads(8), range(16))]
fn one_barrier(#[local_index] me: u32, #[shared] tile: Shared<'_, u32, 8>) -> u32 {
    tile.set(me, me);
    barrier();
    let other = tile.get(me ^ 1);
    tile.set(me, other);
    other
}

/// As it should be.
#[kernel(compute, threads(8), range(16))]
fn two_barriers(#[local_index] me: u32, #[shared] tile: Shared<'_, u32, 8>) -> u32 {
    tile.set(me, me);
    barrier();
    let other = tile.get(me ^ 1);
    barrier();
    tile.set(me, other);
    barrier();
    tile.get(7 - me)
}

/// A barrier of the wrong kind: it orders workgroup memory, not the buffer.
#[kernel(compute, threads(8), range(8))]
fn wrong_barrier(#[local_index] me: u32, #[storage] all: StorageMut<'_, u32>) -> u32 {
    all.set(me, me);
    barrier();
    all.get(7 - me)
}

/// The right one.
#[kernel(compute, threads(8), range(8))]
fn right_barrier(#[local_index] me: u32, #[storage] all: StorageMut<'_, u32>) -> u32 {
    all.set(me, me);
    storage_barrier();
    all.get(7 - me)
}

/// The right one, but the other element is another workgroup's.
#[kernel(compute, threads(8), range(16))]
fn other_group(#[index] i: u32, #[storage] all: StorageMut<'_, u32>) -> u32 {
    all.set(i, i);
    storage_barrier();
    all.get(15 - i)
}

/// Reads workgroup memory that nobody wrote.
#[kernel(compute, threads(8), range(8))]
fn unwritten(#[local_index] me: u32, #[shared] tile: Shared<'_, u32, 8>) -> u32 {
    if me > 2 {
        tile.set(me, me);
    }
    barrier();
    tile.get(me)
}

/// Counts in workgroup memory that one invocation writes at the start, which nothing orders.
#[kernel(compute, threads(8), range(8))]
fn not_yet(#[local_index] me: u32, #[shared] count: SharedAtomics<'_, u32, 1>) -> u32 {
    if me == 0 {
        count.store(0, 0);
    }
    count.add(0, 1);
    barrier();
    count.load(0)
}

/// Two invocations write one texel.
#[kernel(compute, threads(8), range(8))]
fn texel(#[index] i: u32, #[texture] marks: StorageTexture2d<'_, R32Uint>) {
    marks.store(UVec2::new(i / 2, 1), i);
}

/// Turns its own texel and reads its neighbour's, which the barrier does not order.
#[kernel(compute, threads(8), range(8))]
fn next_texel(#[index] i: u32, #[texture] marks: StorageTexture2d<'_, R32Uint, ReadWrite>) {
    let own = UVec2::new(i, 0);
    marks.store(own, !marks.load(own));
    storage_barrier();
    let next = marks.load(UVec2::new((i + 1) & 7, 0));
    if next == 3 {
        marks.store(own, next);
    }
}

/// Writes beyond the end.
#[kernel(compute, threads(8), range(8))]
fn beyond(#[index] i: u32, #[storage] all: StorageMut<'_, u32>) {
    all.set(i * 3, i);
}

/// Reads a texel of a layer and a level, of which the last may not be there.
#[kernel(compute, threads(8), range(8))]
fn sample(
    #[index] i: u32,
    #[constant(id = 0, default = 0)] layer: u32,
    #[constant(id = 1, default = 0)] level: u32,
    #[texture] layers: Texture2dArray<'_>,
) -> f32 {
    let width = layers.level_size(level).x;
    layers
        .load_level(UVec2::new(i % 4, width - 1), layer, level)
        .x
}

/// A cube in the direction that its element has.
#[kernel(compute, threads(8))]
fn around(
    #[element] at: Vec4,
    #[texture] sky: TextureCube<'_>,
    #[sampler] sampler: Sampler,
) -> f32 {
    sky.sample_level(sampler, at.truncate(), 0.0).x
}

hankel_dsl::kernels![
    around,
    sample,
    neighbour,
    both,
    counted,
    no_barrier,
    one_barrier,
    two_barriers,
    wrong_barrier,
    right_barrier,
    other_group,
    unwritten,
    not_yet,
    texel,
    next_texel,
    beyond
];

/// Runs a kernel with `counts` words for each thing that it writes.
fn run<const N: usize>(
    name: &str,
    counts: [usize; N],
    order: Order,
) -> Result<[Vec<u32>; N], String> {
    let entry = entries().into_iter().find(|e| e.kernel.name == name);
    let mut written = counts.map(|n| vec![0_u32; n]);
    let result = (entry.unwrap().run)(&mut Call {
        args: written
            .iter_mut()
            .map(|it| Arg::BytesMut(bytemuck::cast_slice_mut(it)))
            .collect(),
        constants: vec![],
        mode: Mode::sanitized(order),
    });
    match result {
        Ok(()) => Ok(written),
        Err(CallError::Panic { message }) => Err(message),
        Err(other) => panic!("{other}"),
    }
}

/// What is found whatever the order.
fn fault<const N: usize>(name: &str, counts: [usize; N]) -> String {
    for order in [Order::Descending, Order::Shuffled(3)] {
        run(name, counts, order).unwrap_err();
    }
    run(name, counts, Order::Ascending).unwrap_err()
}

/// The line of this file that holds a text, counted from 1.
fn line(text: &str) -> usize {
    let all = include_str!("sanitize.rs");
    all.lines().position(|line| line.contains(text)).unwrap() + 1
}

#[test]
fn races_in_buffers_are_named_with_both_lines() {
    let message = fault("neighbour", [8]);
    let (write, read) = (line("sums.set(i, i);"), line("sums.get((i + 1) % 8)"));
    for part in [
        "data race: invocation (0, 0, 0) reads element 1 of `sums`",
        &format!("sanitize.rs:{read}:"),
        "and invocation (1, 0, 0) writes it",
        &format!("sanitize.rs:{write}:"),
        "Atomics",
    ] {
        assert!(message.contains(part), "{part}: {message}");
    }
    let message = fault("both", [8]);
    assert!(
        message.contains("(0, 0, 0) writes element 0 of `sums`")
            && message.contains("(1, 0, 0) writes it"),
        "{message}"
    );
    assert_eq!(
        run("counted", [4], Order::Ascending).unwrap()[0],
        [1, 5, 9, 13]
    );
}

#[test]
fn races_in_workgroup_memory_want_a_barrier() {
    // Its neighbour has not run yet.
    let message = fault("no_barrier", [16]);
    assert!(message.contains("reads element 1 of `tile`"), "{message}");
    assert!(message.contains("put a barrier() between"), "{message}");
    let message = fault("one_barrier", [16]);
    let (read, write) = (
        line("let other = tile.get(me ^ 1);"),
        line("tile.set(me, other);"),
    );
    assert!(
        message.contains(&format!("sanitize.rs:{read}:")),
        "{message}"
    );
    assert!(
        message.contains(&format!("sanitize.rs:{write}:")),
        "{message}"
    );
    for order in Order::ALL {
        let [out] = run("two_barriers", [16], order).unwrap();
        assert_eq!(out[..8], [6, 7, 4, 5, 2, 3, 0, 1]);
    }
}

#[test]
fn a_barrier_orders_its_own_memory_within_its_workgroup() {
    let message = fault("wrong_barrier", [8, 8]);
    assert!(
        message.contains("put a storage_barrier() between"),
        "{message}"
    );
    for order in Order::ALL {
        assert_eq!(run("right_barrier", [8, 8], order).unwrap()[1][0], 7);
    }
    let message = fault("other_group", [16, 16]);
    assert!(message.contains("within a workgroup"), "{message}");
}

#[test]
fn workgroup_memory_is_written_before_it_is_read() {
    let message = fault("unwritten", [8]);
    assert!(message.contains("of `tile`"), "{message}");
    assert!(message.contains("before anything was written"), "{message}");
    // In ascending order it happens to be written in time.
    run("not_yet", [8], Order::Ascending).unwrap();
    let message = run("not_yet", [8], Order::Descending).unwrap_err();
    assert!(message.contains("before anything was written"), "{message}");
}

#[test]
fn a_texel_has_one_writer() {
    let entry = entries().into_iter().find(|e| e.kernel.name == "texel");
    let mut bytes = [0_u32; 8];
    let result = (entry.unwrap().run)(&mut Call {
        args: vec![Arg::TextureMut(TextureMut {
            size: [4, 2, 1],
            format: TexelFormat::R32Uint,
            bytes: bytemuck::cast_slice_mut(&mut bytes),
        })],
        constants: vec![],
        mode: Mode::sanitized(Order::Ascending),
    });
    let message = result.unwrap_err().to_string();
    assert!(message.contains("element 4 of `marks`"), "{message}");
}

#[test]
fn no_barrier_orders_texels() {
    let entry = entries()
        .into_iter()
        .find(|e| e.kernel.name == "next_texel");
    let mut bytes = [0_u32; 8];
    let result = (entry.unwrap().run)(&mut Call {
        args: vec![Arg::TextureMut(TextureMut {
            size: [8, 1, 1],
            format: TexelFormat::R32Uint,
            bytes: bytemuck::cast_slice_mut(&mut bytes),
        })],
        constants: vec![],
        mode: Mode::sanitized(Order::Ascending),
    });
    let message = result.unwrap_err().to_string();
    let place = line("let next = marks.load(UVec2::new((i + 1) & 7, 0));");
    assert!(message.contains("no barrier orders texels"), "{message}");
    assert!(
        message.contains(&format!("sanitize.rs:{place}:")),
        "{message}"
    );
}

#[test]
fn what_is_out_of_range_is_named_with_its_line() {
    let message = fault("beyond", [8]);
    let place = format!("sanitize.rs:{}:", line("all.set(i * 3, i);"));
    assert!(message.contains("index 9 is out of range"), "{message}");
    assert!(message.contains(&place), "{message}");
}

#[test]
fn texels_levels_and_layers_that_are_not_there_are_named() {
    let read = |[layer, level]: [u32; 2], mode| {
        let entry = entries().into_iter().find(|e| e.kernel.name == "sample");
        // Four by four texels, and two by two.
        let texels = vec![0_u8; 4 * (16 + 4) * 2];
        let mut out = [0.0_f32; 8];
        (entry.unwrap().run)(&mut Call {
            args: vec![
                Arg::Texture(TextureRef {
                    size: [4, 4, 1],
                    levels: 2,
                    layers: 2,
                    samples: 1,
                    number: 0,
                    format: TexelFormat::R32Float,
                    bytes: &texels,
                }),
                Arg::BytesMut(bytemuck::cast_slice_mut(&mut out)),
            ],
            constants: vec![layer, level],
            mode,
        })
        .map_err(|e| e.to_string())
    };
    let sanitized = Mode::sanitized(Order::Ascending);
    read([1, 0], sanitized).unwrap();
    let place = format!(
        "sanitize.rs:{}:",
        line(".load_level(UVec2::new(i % 4, width - 1), layer, level)")
    );
    for (wrong, reader) in [([2, 0], 0), ([0, 2], 0), ([0, 1], 2)] {
        let message = read(wrong, sanitized).unwrap_err();
        assert!(
            message.contains(&format!("invocation ({reader}, 0, 0) reads texel")),
            "{message}"
        );
        assert!(message.contains(&place), "{message}");
        // Otherwise the nearest one is read.
        read(wrong, Mode::REFERENCE).unwrap();
    }
}

#[test]
fn a_cube_that_is_sampled_in_no_direction_is_named() {
    let read = |z: f32, mode| {
        let entry = entries().into_iter().find(|e| e.kernel.name == "around");
        let mut places = [Vec4::X; 8];
        places[5] = Vec4::new(0.0, 0.0, z, 1.0);
        let mut out = [1.0_f32; 8];
        (entry.unwrap().run)(&mut Call {
            args: vec![
                Arg::Bytes(bytemuck::cast_slice(&places)),
                Arg::Texture(TextureRef {
                    size: [1, 1, 1],
                    levels: 1,
                    layers: 6,
                    samples: 1,
                    number: 0,
                    format: TexelFormat::R32Float,
                    bytes: &[0; 24],
                }),
                Arg::Sampler(native::Sampler::new(Filter::Linear, Address::ClampToEdge)),
                Arg::BytesMut(bytemuck::cast_slice_mut(&mut out)),
            ],
            constants: vec![],
            mode,
        })
        .map_err(|e| e.to_string())?;
        Ok::<_, String>(out)
    };
    let sanitized = Mode::sanitized(Order::Ascending);
    assert_eq!(read(-1e-3, sanitized), Ok([0.0; 8]));
    for none in [0.0, -0.0, f32::from_bits(7)] {
        let message = read(none, sanitized).unwrap_err();
        let words = "invocation (5, 0, 0) samples a cube in the direction (0, 0, 0)";
        assert!(message.contains(words), "{message}");
        // Otherwise some texel is read.
        assert_eq!(read(none, Mode::REFERENCE), Ok([0.0; 8]));
    }
}

#[test]
fn plain_calls_are_not_looked_at() {
    let entry = entries().into_iter().find(|e| e.kernel.name == "both");
    let mut words = [0_u32; 8];
    (entry.unwrap().run)(&mut Call {
        args: vec![Arg::BytesMut(bytemuck::cast_slice_mut(&mut words))],
        constants: vec![],
        mode: Mode::REFERENCE,
    })
    .unwrap();
    assert_eq!(words, [1, 1, 3, 3, 5, 5, 7, 7]);
}
