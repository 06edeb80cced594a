//! Textures that are written anywhere, and texels that are gathered, natively.
#![allow(missing_docs)]

use hankel_dsl::access::Read;
use hankel_dsl::format::{R32Uint, Rgba8Sint};
use hankel_dsl::glam::{IVec4, UVec2, Vec2, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::{
    self, Address, Arg, Call, CallError, Deviation, Entry, Filter, Mode, TextureMut, TextureRef,
};
use hankel_dsl::{Sampler, StorageMut, StorageTexture2d, Texture2d, kernel};

/// Writes one texel, to where the uniform says.
#[kernel(compute, threads(1), range(1))]
fn mark(#[uniform] at: &UVec2, #[texture] marks: StorageTexture2d<'_, R32Uint>) {
    marks.store(*at, 7);
}

/// The first channels of the texels around a point.
#[kernel(
    compute,
    threads(1),
    parity(ulp = 0, absolute = 0.0, why = "texels as they are")
)]
fn around(
    #[element] at: Vec2,
    #[texture] source: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    source.gather::<0>(sampler, at)
}

/// The last texel of a level of integers, and a storage texture's texel that is only read.
#[kernel(compute, threads(1), range(1))]
fn integers(
    #[texture] counts: Texture2d<'_, u32>,
    #[texture] shorts: StorageTexture2d<'_, Rgba8Sint, Read>,
    #[storage] out: StorageMut<'_, i32>,
) {
    out.set(
        0,
        counts.load_level(counts.level_size(1) - UVec2::ONE, 1).w as i32,
    );
    out.set(1, shorts.load(UVec2::new(1, 0)).y);
}

/// Writes a number to a channel of 8 bits.
#[kernel(compute, threads(1))]
fn short(#[element] x: i32, #[texture] shorts: StorageTexture2d<'_, Rgba8Sint>) {
    shorts.store(UVec2::ZERO, IVec4::new(0, 0, 0, x));
}

/// The texels around a point, filtered.
#[kernel(
    compute,
    threads(1),
    parity(ulp = 0, absolute = 1e-2, why = "a sampler rounds its weights")
)]
fn filtered(
    #[element] at: Vec2,
    #[texture] source: Texture2d<'_>,
    #[sampler] sampler: Sampler,
) -> Vec4 {
    source.sample_level(sampler, at, 0.0)
}

hankel_dsl::kernels![mark, around, filtered, integers, short];

fn run(name: &str, args: Vec<Arg<'_>>) -> Result<(), CallError> {
    let all: Vec<Entry> = entries();
    let entry = all.iter().find(|e| e.kernel.name == name).expect("listed");
    (entry.run)(&mut Call {
        args,
        constants: Vec::new(),
        mode: Mode::REFERENCE,
    })
}

fn marked(at: UVec2) -> Result<[u32; 6], CallError> {
    let mut texels = [0_u32; 6];
    let texture = TextureMut {
        size: [3, 2, 1],
        format: TexelFormat::R32Uint,
        bytes: bytemuck::cast_slice_mut(&mut texels),
    };
    let at = [at];
    run(
        "mark",
        vec![
            Arg::Bytes(bytemuck::cast_slice(&at)),
            Arg::TextureMut(texture),
        ],
    )?;
    Ok(texels)
}

#[test]
fn any_texel_is_written() {
    assert_eq!(marked(UVec2::new(2, 0)).unwrap(), [0, 0, 7, 0, 0, 0]);
    assert_eq!(marked(UVec2::new(0, 1)).unwrap(), [0, 0, 0, 7, 0, 0]);
}

#[test]
fn a_texel_outside_is_reported() {
    // It is in memory, as the first texel of the next row.
    let message = marked(UVec2::new(3, 0)).unwrap_err().to_string();
    assert!(message.contains("[3, 0, 0] is out of range"), "{message}");
}

/// A texture in memory.
fn texels(size: [u32; 3], levels: u32, format: TexelFormat, bytes: &[u8]) -> Arg<'_> {
    Arg::Texture(TextureRef {
        size,
        levels,
        layers: 1,
        samples: 1,
        number: 0,
        format,
        bytes,
    })
}

#[test]
fn integers_are_read_as_they_are_and_only_as_such() {
    // 2 x 1 texels, then one.
    let counts: Vec<u32> = (0..12).map(|i| u32::MAX - i).collect();
    let shorts = [1_i8, 2, 3, 4, 5, -128, 7, 8];
    let call = |format: TexelFormat| {
        let mut out = [0_i32; 2];
        let args = vec![
            texels([2, 1, 1], 2, format, bytemuck::cast_slice(&counts)),
            texels(
                [2, 1, 1],
                1,
                TexelFormat::Rgba8Sint,
                bytemuck::cast_slice(&shorts),
            ),
            Arg::BytesMut(bytemuck::cast_slice_mut(&mut out)),
        ];
        run("integers", args).map(|()| out)
    };
    assert_eq!(call(TexelFormat::Rgba32Uint), Ok([-12, -128]));
    let message = call(TexelFormat::Rgba32Float).unwrap_err().to_string();
    assert!(message.contains("reads uint channels"), "{message}");
}

#[test]
fn what_a_format_does_not_hold_is_reported() {
    let short = |x: i32| {
        let mut texel = [0_i8; 4];
        let args = vec![
            Arg::Bytes(bytemuck::bytes_of(&x)),
            Arg::TextureMut(TextureMut {
                size: [1, 1, 1],
                format: TexelFormat::Rgba8Sint,
                bytes: bytemuck::cast_slice_mut(&mut texel),
            }),
        ];
        run("short", args).map(|()| texel[3])
    };
    assert_eq!(short(-128), Ok(-128));
    let message = short(128).unwrap_err().to_string();
    assert!(
        message.contains("does not hold [0, 0, 0, 128]"),
        "{message}"
    );
}

/// What a kernel reads at a place of a texture of 32-bit floats.
fn read(
    name: &str,
    at: Vec2,
    size: [u32; 2],
    texels: &[f32],
    sampler: native::Sampler,
) -> [f32; 4] {
    let mut out = [Vec4::ZERO];
    let texture = TextureRef {
        size: [size[0], size[1], 1],
        levels: 1,
        layers: 1,
        samples: 1,
        number: 0,
        format: TexelFormat::R32Float,
        bytes: bytemuck::cast_slice(texels),
    };
    run(
        name,
        vec![
            Arg::Bytes(bytemuck::cast_slice(&[at])),
            Arg::Texture(texture),
            Arg::Sampler(sampler),
            Arg::BytesMut(bytemuck::cast_slice_mut(&mut out)),
        ],
    )
    .unwrap();
    out[0].to_array()
}

#[test]
fn four_texels_are_gathered_counterclockwise_from_the_lower_left() {
    let texels: Vec<f32> = (0..12).map(|i| i as f32).collect();
    let gathered = |address: Address, at: Vec2| {
        let sampler = native::Sampler::new(Filter::Linear, address);
        read("around", at, [4, 3], &texels, sampler)
    };
    let middle = Vec2::new(2.0 / 4.0, 1.0 / 3.0);
    assert_eq!(gathered(Address::ClampToEdge, middle), [5.0, 6.0, 2.0, 1.0]);
    assert_eq!(gathered(Address::Repeat, Vec2::ZERO), [3.0, 0.0, 8.0, 11.0]);
}

#[test]
fn a_deviation_changes_weights_and_channels_as_it_says() {
    let filtered = |texels: [f32; 4], deviation: Deviation| {
        let sampler = native::Sampler {
            deviation,
            ..native::Sampler::new(Filter::Linear, Address::ClampToEdge)
        };
        read("filtered", Vec2::splat(0.5), [2, 2], &texels, sampler)[0]
    };
    let columns = [0.0, 1.0, 0.0, 1.0];
    let moved = Deviation {
        offset: [256, 0, 0],
        ..Deviation::NONE
    };
    let summed = Deviation {
        channels: [4, 0, 0, 0],
        ..Deviation::NONE
    };
    let twisted = Deviation {
        twist: 2,
        ..Deviation::NONE
    };
    let corner = [0.0, 0.0, 0.0, 1.0];
    assert_eq!(filtered(columns, Deviation::NONE), 0.5);
    assert_eq!(filtered(columns, moved), 0.75);
    assert_eq!(filtered(columns, summed), 0.5 + 1.0 / 4_194_304.0);
    // The weights along either axis stay.
    assert_eq!(filtered(columns, twisted), 0.5);
    assert_eq!(filtered(corner, twisted), 0.25 + 1.0 / 512.0);
}
