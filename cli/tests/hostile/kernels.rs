//! Kernels that do not come back, or do what no shader may.

use std::fs;

use crate::desk::{Desk, root};

const KERNELS: &str = r#"//! Test.
#![no_std]
use hankel_dsl::kernel;
/// Never ends for 3.
#[kernel(compute, threads(64))]
pub fn endless(#[element] x: f32) -> f32 {
    while x == 3.0 {
        core::hint::black_box(x);
    }
    x
}
fn deep(n: u32) -> u32 {
    let a = core::hint::black_box([n; 1024]);
    if n == 0 { 0 } else { deep(n - 1) + a[5] }
}
/// Takes more stack than there is for 2.
#[kernel(compute, threads(64))]
pub fn bottomless(#[element] x: f32) -> f32 {
    if x == 2.0 { deep(1 << 20) as f32 } else { x }
}
hankel_dsl::kernels![endless, bottomless];
"#;

/// A folder with a crate in `bad`, with these sources. Tests share a target folder, so that each has
/// a name of its own.
fn bad(name: &str, sources: &str) -> Desk {
    let desk = Desk::new();
    desk.write(
        "bad/Cargo.toml",
        format!(
            "[package]\nname = \"{name}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n[workspace]\n\
             [dependencies]\nhankel-dsl = {{ path = {:?} }}\n",
            root().join("kernels/dsl")
        ),
    );
    desk.write("bad/src/lib.rs", sources);
    // What it depends on is built once for all tests of this kind.
    let shared = root().join("target");
    desk.write(
        ".cargo/config.toml",
        format!("[build]\ntarget-dir = {shared:?}\n"),
    );
    fs::copy(root().join("Cargo.lock"), desk.path("bad/Cargo.lock")).expect("a copy");
    desk
}

/// Both in one test: the crate is built once.
#[test]
fn a_kernel_that_does_not_come_back_is_named_with_its_row() {
    let desk = bad("bad", KERNELS);
    desk.write("rows.csv", "x\n1\n2\n3\n");
    for (kernel, words) in [
        ("endless", ["row 3", "x = 3", "was ended after 1 s"]),
        ("bottomless", ["row 2", "x = 2", "overflowed its stack"]),
    ] {
        let line = format!(
            "eval {kernel} --manifest-path bad/Cargo.toml --input rows.csv --output out.csv --limit 1"
        );
        let run = desk.hankel(&line);
        run.fails(1, &words);
        run.fails(1, &[kernel, "rows.csv"]);
        assert!(!desk.path("out.csv").exists());
    }
}

const FAULTS: &str = r#"//! Test.
#![no_std]
use hankel_dsl::glam::UVec4;
use hankel_dsl::{Atomics, Buffer, Shared, StorageMut, barrier, dpdx, kernel, subgroup_add};
/// Right: its numbers do not meet.
#[kernel(compute, threads(64))]
pub fn fine(#[element] x: u32, #[storage(unordered)] all: StorageMut<'_, u32>, #[atomic] n: Atomics<'_>) {
    let i = n.add(0, 1);
    if i < all.len() {
        all.set(i, x);
    }
}
/// A race in a buffer.
#[kernel(compute, threads(64))]
pub fn race(#[index] i: u32, #[element] x: u32, #[storage] all: StorageMut<'_, u32>) {
    all.set(0, x + i % 2);
}
/// A barrier in a branch.
#[kernel(compute, threads(64))]
pub fn branch(#[local_index] me: u32, #[element] x: Option<u32>) -> u32 {
    if me < 5 {
        barrier();
    }
    x.unwrap_or(0)
}
/// Reads what nobody wrote.
#[kernel(compute, threads(64))]
pub fn unwritten(#[shared] tile: Shared<'_, u32, 4>, #[element] x: Option<u32>) -> u32 {
    tile.get(1) & x.unwrap_or(0)
}
/// The order shows.
#[kernel(compute, threads(64))]
pub fn order(#[element] x: u32, #[atomic] n: Atomics<'_>) -> u32 {
    n.add(0, 1) + (x & 0)
}
/// Which elements are kept shows the order, wherever they lie.
#[kernel(compute, threads(64))]
pub fn kept(
    #[element] x: u32,
    #[atomic] #[length(1)] n: Atomics<'_>,
    #[storage(unordered)] #[length(16)] kept: StorageMut<'_, u32>,
) {
    let i = n.add(0, 1);
    if i < 16 {
        kept.set(i, x);
    }
}
/// Wraps for large numbers.
#[kernel(compute, threads(64))]
pub fn wraps(#[element] x: u32) -> u32 {
    x + 17
}
/// Shifts by up to 255.
#[kernel(compute, threads(64))]
pub fn shift(#[element] x: u32) -> u32 {
    1 << (x & 255)
}
/// Divides by zero.
#[kernel(compute, threads(64))]
pub fn divides(#[element] x: u32) -> u32 {
    7 / x
}
/// Reads beyond the end.
#[kernel(compute, threads(64))]
pub fn beyond(#[index] i: u32, #[element] x: u32, #[storage] table: Buffer<'_, u32>) -> u32 {
    table.get(i * 1000) & x
}
/// Does not end for 0.
#[kernel(compute, threads(64))]
pub fn endless(#[element] x: u32) -> u32 {
    while x == 0 {
        core::hint::black_box(x);
    }
    x
}
/// Differs where subgroups have another size.
#[kernel(compute, threads(64))]
pub fn sized(#[element] x: Option<u32>) -> u32 {
    subgroup_add(x.unwrap_or(0) | 1)
}
/// Adds in a part of the subgroup.
#[kernel(compute, threads(64))]
pub fn parted(#[element] x: Option<u32>) -> u32 {
    if x.unwrap_or(0) & 1 == 0 {
        subgroup_add(1)
    } else {
        0
    }
}
/// All fragments write the same element.
#[kernel(fragment)]
pub fn crowded(#[varying] x: u32, #[storage] last: StorageMut<'_, u32>) -> u32 {
    last.set(3, x);
    x
}
/// A derivative behind a write.
#[kernel(fragment)]
pub fn late(#[varying] x: f32, #[atomic] count: Atomics<'_>) -> f32 {
    count.add(0, 1);
    dpdx(x)
}
/// Multiplies what wraps, within glam.
#[kernel(compute, threads(64))]
pub fn scaled(#[element] v: UVec4) -> UVec4 {
    v * 1_664_525
}
hankel_dsl::kernels![
    fine, race, branch, unwritten, order, kept, wraps, shift, divides, beyond, endless, sized, parted,
    crowded, late, scaled
];
"#;

#[test]
fn what_no_shader_may_do_is_named_with_its_line() {
    let desk = bad("faulty", FAULTS);
    let run = desk.hankel("sanitize --manifest-path bad/Cargo.toml --limit 2");
    let said = run.code(1).out();
    let says = |words: &[&str]| {
        let found = said.split("\n").collect::<Vec<_>>();
        let of = found.iter().position(|line| *line == words[0]);
        let fault = found[of.unwrap_or_else(|| panic!("no {} in {said}", words[0])) + 1];
        for word in words {
            assert!(
                fault.contains(word) || *word == words[0],
                "no `{word}` in: {fault}"
            );
        }
    };
    let line = |text: &str| {
        let at = FAULTS.lines().position(|line| line.contains(text));
        format!("lib.rs:{}:", at.expect("it is there") + 1)
    };
    for (source, words) in [
        ("all.set(0, x", ["race", "data race", "element 0 of `all`"]),
        ("        barrier();", ["branch", "not uniform", "has ended"]),
        (
            "tile.get(1)",
            ["unwritten", "of `tile`", "before anything was written"],
        ),
        ("x + 17", ["wraps", "attempt to add with overflow", "src/"]),
        (
            "1 << (x & 255)",
            ["shift", "attempt to shift left with overflow", "src/"],
        ),
        ("7 / x", ["divides", "attempt to divide by zero", "src/"]),
        (
            "v * 1_664_525",
            [
                "scaled",
                "attempt to multiply with overflow",
                "called from bad/src/",
            ],
        ),
        ("table.get(i", ["beyond", "out of", "src/"]),
        (
            "        subgroup_add(1)",
            ["parted", "not the same for the subgroup", "has ended"],
        ),
        (
            "last.set(3",
            ["crowded", "data race", "element 3 of `last`"],
        ),
        (
            "dpdx(x)",
            ["late", "a derivative", "behind a write to memory"],
        ),
    ] {
        says(&words);
        says(&[words[0], &line(source)]);
    }
    says(&[
        "order",
        "depends on the order of the invocations",
        "unordered",
    ]);
    says(&[
        "kept",
        "depends on the order of the invocations",
        "which elements are written does, too",
    ]);
    says(&[
        "sized",
        "depends on the size of subgroups",
        "depends(subgroup_size)",
    ]);
    says(&["endless", "was ended after 2 s"]);
    assert!(said.contains("16 kernels: 15 with faults"), "{said}");
}
