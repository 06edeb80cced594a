//! Textures that are written anywhere, and texels that are gathered, natively.
#![allow(missing_docs)]

use hankel_dsl::format::R32Uint;
use hankel_dsl::glam::{UVec2, Vec2, Vec4};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::{
    Address, Arg, Call, CallError, Entry, Filter, Mode, TextureMut, TextureRef,
};
use hankel_dsl::{Sampler, StorageTexture2d, Texture2d, kernel};

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

hankel_dsl::kernels![mark, around];

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

#[test]
fn four_texels_are_gathered_counterclockwise_from_the_lower_left() {
    let texels: Vec<f32> = (0..12).map(|i| i as f32).collect();
    let gathered = |address: Address, at: Vec2| {
        let mut out = [Vec4::ZERO];
        let texture = TextureRef {
            size: [4, 3, 1],
            levels: 1,
            layers: 1,
            samples: 1,
            format: TexelFormat::R32Float,
            bytes: bytemuck::cast_slice(&texels),
        };
        let sampler = hankel_dsl::native::Sampler::new(Filter::Linear, address);
        run(
            "around",
            vec![
                Arg::Bytes(bytemuck::cast_slice(&[at])),
                Arg::Texture(texture),
                Arg::Sampler(sampler),
                Arg::BytesMut(bytemuck::cast_slice_mut(&mut out)),
            ],
        )
        .unwrap();
        out[0].to_array()
    };
    let middle = Vec2::new(2.0 / 4.0, 1.0 / 3.0);
    assert_eq!(gathered(Address::ClampToEdge, middle), [5.0, 6.0, 2.0, 1.0]);
    assert_eq!(gathered(Address::Repeat, Vec2::ZERO), [3.0, 0.0, 8.0, 11.0]);
}
