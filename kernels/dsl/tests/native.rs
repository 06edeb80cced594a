//! The native executor: what it runs, and what it refuses.

use hankel_dsl::native::describe::{Output, Precision, Role, Stage, TexelFormat};
use hankel_dsl::native::{Arg, Call, CallError, Mode, TextureMut, TextureRef};
use hankel_dsl::{Buffer, Element, Real, Texture2d, glam::*, kernel, lit};

/// A row.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
struct Row<R> {
    /// Summand.
    a: R,
    /// Another.
    b: R,
}

/// The sum's root.
#[kernel(compute, threads(64), precision(f32, f64))]
fn root<R: Real>(#[uniform] scale: &Row<R>, #[element] row: Row<R>) -> Row<R> {
    let sum = (row.a * scale.a + row.b * scale.b).abs();
    Row {
        a: sum.sqrt(),
        b: R::select(row.a.lt(row.b), row.a, lit!(0.1)),
    }
}

/// Reads where it is told to.
#[kernel(compute, threads(64))]
fn look_up(#[storage] table: Buffer<'_, f32>, #[element] at: u32) -> f32 {
    table.get(at)
}

/// A texel and its neighbour below.
#[kernel(compute, threads(8, 8), texture(rgba16unorm))]
fn pair(#[index] at: UVec2, #[texture] source: Texture2d<'_>) -> Vec4 {
    source.load(at) + source.load(at + UVec2::Y) * 0.5
}

hankel_dsl::kernels![root, look_up, pair];

fn bytes<T: bytemuck::Pod>(values: &[T]) -> &[u8] {
    bytemuck::cast_slice(values)
}

fn entry(name: &str) -> hankel_dsl::native::Entry {
    entries()
        .into_iter()
        .find(|e| e.kernel.name == name)
        .unwrap()
}

fn run_root(rows: &[Row<f32>], out: &mut [Row<f32>], mode: Mode) -> Result<(), CallError> {
    let scale = Row { a: 0.3_f32, b: 1.7 };
    (entry("root").run)(&mut Call {
        args: vec![
            Arg::Bytes(bytes(core::slice::from_ref(&scale))),
            Arg::Bytes(bytes(rows)),
            Arg::BytesMut(bytemuck::cast_slice_mut(out)),
        ],
        constants: vec![],
        mode,
    })
}

#[test]
fn one_function_makes_an_entry_point_for_each_precision() {
    let names: Vec<_> = entries()
        .into_iter()
        .map(|e| (e.kernel.name, e.kernel.precision))
        .collect();
    assert_eq!(
        names,
        [
            ("root".into(), Some(Precision::F32)),
            ("root_f64".into(), Some(Precision::F64)),
            ("look_up".into(), None),
            ("pair".into(), None),
        ]
    );
}

#[test]
fn the_description_follows_the_signature() {
    let k = entry("root_f64").kernel;
    assert_eq!(k.summary, "The sum's root.");
    assert!(matches!(
        k.stage,
        Stage::Compute {
            threads: [64, 1, 1],
            dimensions: 1,
            cooperative: false,
            ..
        }
    ));
    let Role::Element { binding: 1, layout } = &k.params[1].role else {
        panic!("{:?}", k.params)
    };
    assert_eq!(
        (layout.name.as_str(), layout.size, layout.align),
        ("Row", 16, 8)
    );
    assert_eq!(
        (layout.fields[1].name.as_str(), layout.fields[1].offset),
        ("b", 8)
    );
    assert_eq!(layout.fields[1].summary, "Another.");
    assert!(matches!(k.outputs[0], Output::Buffer { binding: 2, .. }));
}

#[test]
fn lanes_and_threads_change_no_bit() {
    // No multiple of any lane count, and more than one chunk.
    let rows: Vec<_> = (0..10_007)
        .map(|i| Row {
            a: (i as f32).sin() * 1e3,
            b: (i as f32 * 0.7).cos(),
        })
        .collect();
    let mut reference = vec![Row { a: 0.0, b: 0.0 }; rows.len()];
    run_root(&rows, &mut reference, Mode::REFERENCE).unwrap();
    // Fewer than any group of lanes, one more than a group of most, several chunks.
    for count in [3, 33, rows.len()] {
        for (lanes, parallel) in [(false, false), (false, true), (true, false), (true, true)] {
            let mut out = vec![Row { a: 0.0, b: 0.0 }; count];
            let mode = Mode {
                lanes,
                parallel,
                ..Mode::REFERENCE
            };
            run_root(&rows[..count], &mut out, mode).unwrap();
            assert_eq!(bytes(&out), bytes(&reference[..count]));
        }
    }
    assert_eq!(reference[0].a, 1.7_f32.sqrt());
}

#[test]
fn a_short_buffer_is_refused() {
    let rows = [Row { a: 0.0, b: 0.0 }; 3];
    let mut out = [Row { a: 0.0, b: 0.0 }; 4];
    let error = run_root(&rows, &mut out, Mode::default()).unwrap_err();
    assert_eq!(
        error,
        CallError::Length {
            name: "row",
            expected: 4,
            got: 3
        }
    );
}

#[test]
fn missing_arguments_are_counted() {
    let mut call = Call {
        args: vec![],
        constants: vec![],
        mode: Mode::default(),
    };
    let error = (entry("root").run)(&mut call).unwrap_err();
    assert_eq!(error.to_string(), "3 arguments are expected, 0 were given");
}

#[test]
fn an_index_out_of_range_is_reported_not_fatal() {
    let mut out = [0.0_f32; 2];
    let error = (entry("look_up").run)(&mut Call {
        args: vec![
            Arg::Bytes(bytes(&[1.0_f32, 2.0])),
            Arg::Bytes(bytes(&[1_u32, 2])),
            Arg::BytesMut(bytemuck::cast_slice_mut(&mut out)),
        ],
        constants: vec![],
        mode: Mode::REFERENCE,
    })
    .unwrap_err();
    assert!(
        matches!(&error, CallError::Panic { message } if message.contains("index is 2")),
        "{error}"
    );
}

#[test]
fn texels_are_clamped_to_the_edge_and_to_the_format() {
    let source: Vec<f32> = (0..6)
        .flat_map(|i| [i as f32 * 0.2, 0.5, 0.0, 1.0])
        .collect();
    let mut out = [0_u8; 6 * 8];
    (entry("pair").run)(&mut Call {
        args: vec![
            Arg::Texture(TextureRef {
                size: [3, 2, 1],
                levels: 1,
                layers: 1,
                samples: 1,
                number: 0,
                format: TexelFormat::Rgba32Float,
                bytes: bytes(&source),
            }),
            Arg::TextureMut(TextureMut {
                size: [3, 2, 1],
                format: TexelFormat::Rgba16Unorm,
                bytes: &mut out,
            }),
        ],
        constants: vec![],
        mode: Mode::default(),
    })
    .unwrap();
    let texel = |i: usize| TexelFormat::Rgba16Unorm.load(&out[i * 8..]);
    // 0.2 + 0.5 * 0.8, and in the last row the neighbour is the texel itself.
    assert!((texel(1).x - 0.6).abs() < 1e-5);
    assert!((texel(3).x - 0.9).abs() < 1e-5);
    assert_eq!(texel(5), Vec4::new(1.0, 0.75, 0.0, 1.0).round_to_unorm16());
}

trait RoundToUnorm16 {
    fn round_to_unorm16(self) -> Self;
}

impl RoundToUnorm16 for Vec4 {
    fn round_to_unorm16(self) -> Self {
        (self * 65535.0).round() / 65535.0
    }
}

#[test]
fn a_texture_of_another_format_is_refused() {
    let mut out = [0_u8; 4];
    let error = (entry("pair").run)(&mut Call {
        args: vec![
            Arg::Texture(TextureRef {
                size: [1, 1, 1],
                levels: 1,
                layers: 1,
                samples: 1,
                number: 0,
                format: TexelFormat::R32Float,
                bytes: &[0; 4],
            }),
            Arg::TextureMut(TextureMut {
                size: [1, 1, 1],
                format: TexelFormat::Rgba8Unorm,
                bytes: &mut out,
            }),
        ],
        constants: vec![],
        mode: Mode::default(),
    })
    .unwrap_err();
    assert_eq!(
        error.to_string(),
        "argument `output`: it is rgba8unorm, the kernel writes rgba16unorm"
    );
}
