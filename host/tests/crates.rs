//! Other people's kernel crates: found, built, loaded; and what is said of those that are none.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use hankel_dsl::native::Mode;
use hankel_host::crates::{CrateError, KernelCrate, Native};
use hankel_host::device::{Bind, Device, NativeDevice};
use hankel_host::flush;
use hankel_host::worker::Worker;

/// A folder for a crate, emptied but for its build.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("crates")
        .join(name);
    fs::create_dir_all(folder.join("src")).unwrap();
    folder
}

fn write(path: PathBuf, text: &str) {
    fs::write(path, text).unwrap();
}

fn manifest(folder: &Path, rest: &str) -> PathBuf {
    let path = folder.join("Cargo.toml");
    let name = folder.file_name().unwrap().to_str().unwrap();
    write(
        path.clone(),
        &format!(
            "[package]\nname = \"{name}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n\n\
             [workspace]\n{rest}"
        ),
    );
    path
}

/// Kernels run in processes of this program, a call for a second at most.
fn worker() -> Worker {
    Worker {
        program: env!("CARGO_BIN_EXE_hankel-host-worker").into(),
        arguments: Vec::new(),
        limit: Duration::from_millis(1000),
    }
}

fn refused(manifest: &Path) -> CrateError {
    KernelCrate::load(manifest, Native::Descriptions, &worker(), &mut |_| {}).unwrap_err()
}

#[test]
fn a_kernel_crate_is_built_loaded_and_run() {
    let folder = folder("parabola");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let manifest = manifest(
        &folder,
        &format!(
            "\n[dependencies]\nhankel-dsl = {{ path = {:?} }}\n",
            root.join("kernels/dsl")
        ),
    );
    // The same versions as here, so that nothing new is fetched, and where the command line's tests have built them.
    fs::copy(root.join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    fs::create_dir_all(folder.join(".cargo")).unwrap();
    write(
        folder.join(".cargo/config.toml"),
        &format!("[build]\ntarget-dir = {:?}\n", root.join("target")),
    );
    write(
        folder.join("src/lib.rs"),
        "//! Test.\n#![no_std]\nuse hankel_dsl::{Buffer, Element, Real, kernel, lit};\n\
         /// A point.\n#[derive(Clone, Copy, Element)]\n#[repr(C)]\npub struct Point<R> {\n\
         /// Abscissa.\npub x: R,\n}\n\
         /// Half the square.\n#[kernel(compute, threads(64), precision(f32, f64))]\n\
         pub fn parabola<R: Real>(#[element] point: Point<R>) -> Point<R> {\n\
         Point { x: point.x * point.x * lit!(0.5) }\n}\n\
         /// Reads beyond the end.\n#[kernel(compute, threads(64))]\n\
         pub fn beyond(#[index] i: u32, #[storage] table: Buffer<'_, f32>) -> f32 {\n\
         table.get(i + table.len())\n}\n\
         /// Never ends for 77.\n#[kernel(compute, threads(64))]\n\
         pub fn endless(#[element] x: f32) -> f32 {\n\
         while x == 77.0 { core::hint::black_box(x); }\nx\n}\n\
         fn deep(n: u32) -> u32 {\n\
         let a = core::hint::black_box([n; 1024]);\n\
         if n == 0 { 0 } else { deep(n - 1) + a[5] }\n}\n\
         /// Takes more stack than there is for 55.\n#[kernel(compute, threads(64))]\n\
         pub fn bottomless(#[element] x: f32) -> f32 {\n\
         if x == 55.0 { deep(1 << 20) as f32 } else { x }\n}\n\
         /// All are fine alone.\n#[kernel(compute, threads(64))]\n\
         pub fn slow(#[element] x: f32) -> f32 {\n\
         let mut y = x;\nfor _ in 0..8_000_000 { y = core::hint::black_box(y * 0.5); }\ny\n}\n\
         hankel_dsl::kernels![parabola, beyond, endless, bottomless, slow];\n",
    );
    let mut lines = Vec::new();
    let described =
        KernelCrate::load(&manifest, Native::Descriptions, &worker(), &mut |_| {}).unwrap();
    let selected = ["parabola".to_string()];
    let one = KernelCrate::load(&manifest, Native::Of(&selected), &worker(), &mut |_| {}).unwrap();
    let mut line = |l: &str| lines.push(l.to_string());
    let loaded = KernelCrate::load(&manifest, Native::All, &worker(), &mut line).unwrap();
    assert!(lines.iter().any(|l| l.contains("Finished")), "{lines:?}");
    assert_eq!(loaded.name, "parabola");
    let text = loaded.entry("parabla").unwrap_err().to_string();
    assert!(
        text.contains("parabola, parabola_f64, beyond, endless"),
        "{text}"
    );

    let mut device = NativeDevice::new();
    let points: Vec<u8> = (0..100).flat_map(|i| (i as f32).to_le_bytes()).collect();
    let out = device.buffer("out", points.len()).unwrap();
    let entry = loaded.entry("parabola").unwrap();
    device
        .dispatch(
            &entry.program(None, &[]),
            &[Bind::Bytes(&points), Bind::Buffer(out)],
        )
        .unwrap();
    let result: Vec<f32> = bytemuck::pod_collect_to_vec(&device.read_buffer(out).unwrap());
    assert_eq!((result[3], result[99]), (4.5, 4900.5));

    // Its process flushes subnormal numbers where the caller's thread does.
    let slightest: Vec<u8> = 1.5e-19_f32.to_le_bytes().repeat(100);
    for flushes in [false, true] {
        let run = || {
            let mut device = NativeDevice::with_mode(Mode::REFERENCE);
            let out = device.buffer("out", slightest.len()).unwrap();
            let args = [Bind::Bytes(&slightest), Bind::Buffer(out)];
            device.dispatch(&entry.program(None, &[]), &args).unwrap();
            let result: Vec<f32> = bytemuck::pod_collect_to_vec(&device.read_buffer(out).unwrap());
            result[5]
        };
        if flushes {
            if let Some(result) = flush::flushed(run) {
                assert_eq!(result, 0.0);
            }
        } else {
            assert!(run() > 0.0);
        }
    }

    // The same description whatever was built; only what was asked for runs.
    let kernels = |of: &KernelCrate| {
        of.entries
            .iter()
            .map(|e| e.kernel.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(kernels(&described), kernels(&loaded));
    assert_eq!(kernels(&one), kernels(&loaded));
    for (from, runs) in [(&described, false), (&one, true)] {
        let entry = from.entry("parabola").unwrap();
        let result = device.dispatch(
            &entry.program(None, &[]),
            &[Bind::Bytes(&points), Bind::Buffer(out)],
        );
        assert_eq!(result.is_ok(), runs, "{result:?}");
    }
    let error = device
        .dispatch(
            &one.entry("parabola_f64").unwrap().program(None, &[]),
            &[Bind::Bytes(&points), Bind::Buffer(out)],
        )
        .unwrap_err();
    assert!(error.to_string().contains("was not built"), "{error}");

    let entry = loaded.entry("beyond").unwrap();
    let error = device
        .dispatch(
            &entry.program(None, &[]),
            &[Bind::Bytes(&points), Bind::Buffer(out)],
        )
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("`beyond`") && error.contains("panicked"),
        "{error}"
    );
    let error = device
        .dispatch(&entry.program(None, &[]), &[Bind::Buffer(out)])
        .unwrap_err();
    assert!(error.to_string().contains("table, output"), "{error}");

    // A kernel that does not come back is an outcome with its input, and the end of its process
    // alone.
    for (kernel, words) in [
        (
            "endless",
            &["was ended after 1 s", "at element 77", "x = 77"][..],
        ),
        (
            "bottomless",
            &["overflowed its stack", "at element 55", "x = 55"],
        ),
        ("slow", &["was ended after 1 s"]),
    ] {
        let began = Instant::now();
        let entry = loaded.entry(kernel).unwrap();
        let error = device
            .dispatch(
                &entry.program(None, &[]),
                &[Bind::Bytes(&points), Bind::Buffer(out)],
            )
            .unwrap_err()
            .to_string();
        for words in words {
            assert!(error.contains(words), "{kernel}: {error}");
        }
        assert_eq!(error.contains("at element"), kernel != "slow", "{error}");
        assert!(began.elapsed() < Duration::from_secs(20), "{kernel}");
    }
    let entry = loaded.entry("parabola").unwrap();
    device
        .dispatch(
            &entry.program(None, &[]),
            &[Bind::Bytes(&points), Bind::Buffer(out)],
        )
        .unwrap();
}

#[test]
fn what_is_no_kernel_crate_is_named() {
    let text = refused(Path::new("no/such/Cargo.toml")).to_string();
    assert!(
        text.contains("no/such/Cargo.toml") && text.contains("no such file"),
        "{text}"
    );

    let program = folder("program");
    write(program.join("src/main.rs"), "fn main() {}\n");
    let text = refused(&manifest(&program, "")).to_string();
    assert!(text.contains("`program` has no library"), "{text}");

    let virtual_one = folder("virtual");
    write(virtual_one.join("Cargo.toml"), "[workspace]\n");
    let text = refused(&virtual_one).to_string();
    assert!(text.contains("workspace without a package"), "{text}");

    let garbled = folder("garbled");
    write(garbled.join("Cargo.toml"), "[package\n");
    let error = refused(&garbled);
    assert!(matches!(error, CrateError::Manifest { .. }), "{error}");
    assert!(error.to_string().contains("garbled"), "{error}");
}

#[test]
fn a_crate_that_does_not_compile_shows_the_compilers_words() {
    let broken = folder("broken");
    write(broken.join("src/lib.rs"), "pub fn f() -> u32 { \"one\" }\n");
    let error = refused(&manifest(&broken, ""));
    assert!(matches!(error, CrateError::Build { .. }), "{error}");
    let text = error.to_string();
    assert!(
        text.contains("`broken` does not compile") && text.contains("E0308"),
        "{text}"
    );
    assert!(text.contains("src/lib.rs:1"), "{text}");
}

#[test]
fn a_crate_without_kernels_says_what_to_add() {
    let plain = folder("plain");
    write(plain.join("src/lib.rs"), "pub fn f() -> u32 { 1 }\n");
    let text = refused(&manifest(&plain, "")).to_string();
    assert!(text.contains("kernels!"), "{text}");
}
