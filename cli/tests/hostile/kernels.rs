//! Kernels that do not come back.

use std::fs;
use std::path::Path;

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

/// Both in one test: the crate is built once.
#[test]
fn a_kernel_that_does_not_come_back_is_named_with_its_row() {
    let desk = Desk::new();
    desk.write(
        "bad/Cargo.toml",
        format!(
            "[package]\nname = \"bad\"\nversion = \"0.1.0\"\nedition = \"2024\"\n[workspace]\n\
             [dependencies]\nhankel-dsl = {{ path = {:?} }}\n",
            root().join("kernels/dsl")
        ),
    );
    desk.write("bad/src/lib.rs", KERNELS);
    // What it depends on is built once for all tests of this kind.
    let shared = Path::new(env!("CARGO_TARGET_TMPDIR")).join("crates/parabola/target");
    desk.write(
        ".cargo/config.toml",
        format!("[build]\ntarget-dir = {shared:?}\n"),
    );
    fs::copy(root().join("Cargo.lock"), desk.path("bad/Cargo.lock")).expect("a copy");
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
