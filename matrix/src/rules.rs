//! What each column may differ by, and what it cannot take.

use hankel_codegen::translate::refused_by_naga;
use hankel_dsl::native::describe::{Kernel, Scalar, Tolerance};
use hankel_host::device::slots::{self, Use};
use hankel_host::flat;
use hankel_host::parity::numbers::Rules;

use crate::column::Column;

/// What `kernel` may differ by in `column`, whose device flushes subnormal numbers or not. What flushes has a reference
/// that does, if `flushed_reference`; otherwise its absurd inputs, of which many are subnormal,
/// need only give finite results.
#[must_use]
pub fn of(kernel: &Kernel, column: Column, flushes: bool, flushed_reference: bool) -> Rules {
    if matches!(column, Column::Native | Column::NativeSimd) {
        let exact = Tolerance {
            ulp: 0,
            absolute: 0.0,
            non_finite: false,
            why: "the same operations, neither fused nor reordered".into(),
        };
        return Rules::of(kernel, exact);
    }
    let mut rules = Rules::of(kernel, kernel.tolerance.clone());
    if flushes {
        rules.flushes = true;
        rules.hostile &= flushed_reference;
    }
    rules
}

/// What a column's compiler is known to lack that `kernel`, whose text is `code`, needs.
#[must_use]
pub fn lacking(kernel: &Kernel, column: Column, code: &[u8]) -> Option<String> {
    if column == Column::SpirvNaga {
        let what = refused_by_naga(code)?;
        return Some(format!("{what} (naga does not read them from SPIR-V)"));
    }
    if column != Column::HlslGlslang {
        return None;
    }
    // `tests/upstream/glslang-wave-prefix`.
    let scans = [&b"WavePrefixSum("[..], b"WavePrefixProduct("]
        .iter()
        .any(|name| code.windows(name.len()).any(|it| it == *name));
    if scans {
        return Some(
            "scans of waves (glslang's HLSL includes the own value in `WavePrefixSum` and \
             `WavePrefixProduct`)"
                .into(),
        );
    }
    // `tests/upstream/glslang-wide-constructors`.
    if code.windows(9).any(|it| it == b"uint64_t(") {
        return Some("conversions to 64-bit integers (glslang's HLSL has no `uint64_t(x)`)".into());
    }
    let wide = slots::slots(kernel).iter().any(|slot| match slot.role {
        Use::Uniform(l)
        | Use::Element(l)
        | Use::ElementMut(l)
        | Use::Storage(l)
        | Use::StorageMut { layout: l, .. }
        | Use::Output(l) => flat::leaves(l)
            .iter()
            .any(|leaf| matches!(leaf.scalar, Scalar::F64 | Scalar::U64 | Scalar::I64)),
        _ => false,
    });
    // `tests/upstream/glslang-templated-load`.
    wide.then(|| {
        "64-bit numbers in buffers (glslang's HLSL has no `Load<double>`, nor `Load<uint64_t>`)"
            .into()
    })
}
