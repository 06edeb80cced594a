//! Libraries of functions: what is translated means what the Rust function means, what has no form is
//! refused with its place, and a signature does not change behind its users' backs.
#![allow(
    clippy::manual_swap,
    clippy::neg_cmp_op_on_partial_ord,
    reason = "the functions are what is translated, as somebody may write them"
)]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use hankel_codegen::Error;
use hankel_codegen::functions::folder::{Folder, read as read_record};
use hankel_codegen::functions::ir::Library;
use hankel_codegen::functions::print::Naming;
use hankel_codegen::functions::source::CrateText;
use hankel_codegen::functions::{FORMS, Refusal, read};
use hankel_dsl::glam::{UVec2, Vec2, Vec3};
use hankel_dsl::{Real, array_element, array_element_mut, function, lit, math, to_i32, unroll};

/// A crate of one file.
fn krate(text: &str) -> CrateText {
    CrateText {
        name: "sample".into(),
        version: "1.2.3".into(),
        licence: "MIT".into(),
        files: [("src/lib.rs".to_owned(), text.to_owned())].into(),
    }
}

fn libraries(text: &str) -> Result<Vec<Library>, Refusal> {
    read(&[krate(text)])
}

/// A library of one function `f`.
fn one(body: &str) -> Result<Vec<Library>, Refusal> {
    libraries(&format!(
        "{body}\nhankel_dsl::library!(sample {{ api: 1, functions: [f] }});"
    ))
}

fn text(libraries: &[Library], form: &str) -> String {
    let naming = Naming {
        prefix: "hankel".into(),
        library: libraries[0].name.clone(),
    };
    let form = FORMS.iter().find(|f| f.name == form).expect("a form");
    form.text(&libraries[0], &naming, "0")
}

/// Functions, and their source.
macro_rules! both {
    ($($tokens:tt)*) => {
        $($tokens)*
        const SOURCE: &str = stringify!($($tokens)*);
    };
}

both! {
    #[derive(Clone, Copy)]
    struct Pair<R> {
        near: R,
        far: R,
    }

    impl<R: Real> Pair<R> {
        fn new(near: R, far: R) -> Self {
            Self { near, far }
        }

        fn turned(self) -> Self {
            let Self { near, far } = self;
            Self { near: far, ..self }.with(near)
        }

        fn with(self, far: R) -> Self {
            Self { far, ..self }
        }
    }

    fn swapped<const N: usize>(mut x: [f32; N], first: &mut f32) -> [f32; N] {
        let kept = x[0];
        x[0] = x[N - 1];
        x[usize::saturating_sub(N, 1)] = kept;
        *first += x[0];
        x
    }

    fn signed<const NEGATIVE: bool>(x: f32) -> f32 {
        if NEGATIVE { -x } else { x }
    }

    fn passed_on<const NEGATIVE: bool>(x: f32) -> f32 {
        signed::<NEGATIVE>(x) * 3.0
    }

    macro_rules! series {
        ($y:expr; $first:expr, $($next:expr),*) => {{
            let mut sum = $y * lit!($first);
            $( sum = (sum + lit!($next)) * $y; )*
            sum
        }};
    }

    fn horner<R: Real>(x: R) -> R {
        series!(x; 1.0 / 6.0, -0.5, 1.0)
    }

    /// Order of operations, signs and brackets.
    #[function]
    pub fn order(a: f32, b: f32, c: f32) -> f32 {
        let x = a - (b - c) - -a;
        let y = a / (b / c) / c * (a * -b);
        let z = -(a + b) * c - (a * (b * c) + (c + a));
        x * 0.5 - (y - z * -2.0)
    }

    /// Structures, references, arrays and patterns.
    #[function]
    pub fn parts(v: Vec3, t: f32) -> Vec2 {
        let pair = Pair::new(v.x, Real::max(v.y, t)).turned();
        let mut first = t;
        let [a, b, ..] = swapped([pair.near, pair.far, v.z], &mut first);
        let (a, b) = (b, a);
        let a = passed_on::<true>(a) + passed_on::<false>(b) + signed::<true>(b);
        let scale = |x: f32| x * first + a;
        let m = Vec2::new(scale(a), scale(b)) * t - Vec2::splat(b);
        m + Vec2::new(1.0, 2.0)
    }

    /// Loops whose turns are not told apart, and one with a count that is not known.
    #[function]
    pub fn loops(x: f32, turns: u32) -> f32 {
        let mut v = x;
        let mut w = x * x;
        let mut i = 0;
        while i < 7 {
            let next = v * 0.75 + w * 0.125;
            (v, w) = (w, next);
            i += 1;
        }
        unroll!(_i in 0..4, {
            v = (v + w) * 0.5;
        });
        let mut powers = [x; 4];
        unroll!(k in 1..4, max 7, loop if true, {
            let before = array_element(&powers, k as u32 - 1);
            *array_element_mut(&mut powers, k as u32) = before * x;
            w -= v * k as f32;
        });
        let last = array_element_mut(&mut powers, 3);
        *last += w;
        w = powers[3];
        let mut j = 0_u32;
        while j < turns & 15 {
            w = w * 0.5 + j as f32;
            j += 1;
        }
        v + w + horner(x)
    }

    /// Branches with statements and without.
    #[function]
    pub fn branches(x: f32, y: f32) -> f32 {
        let mut sign = 1.0;
        let size = if x < y {
            sign = -1.0;
            let d = y - x;
            d * d
        } else {
            x - y
        };
        let is_odd = (x > 0.5) & !(y > 0.5) | (x < -0.5 && y < -0.5 || x == y);
        let kind = if is_odd { 3_u32 } else { 5 };
        size * sign + kind as f32
    }

    /// Bits and whole numbers.
    #[function]
    pub fn bits(word: u32, x: f32) -> UVec2 {
        let whole = to_i32(Real::clamp(x, -100.0, 100.0));
        let low = (word & 0xff) << 3 | word >> 29;
        let mixed = word.wrapping_mul(747_796_405).wrapping_add(whole as u32) ^ x.to_bits();
        UVec2::new(low | mixed & 0xf0f0, if whole < 3 { mixed } else { u32::max(low, 9) })
    }

    /// Names that languages reserve.
    #[function]
    pub fn reserved(sample: f32, half: f32) -> f32 {
        let mix = sample * half;
        let discard = mix - half;
        let near = discard * mix;
        let out = near + sample;
        out * near
    }

    /// Calls another function.
    #[function]
    pub fn calls(x: f32, y: f32) -> f32 {
        let pair = parts(Vec3::new(x, y, x), order(x, y, x));
        pair.x + branches(pair.y, y) - horner(y)
    }
}

const LIBRARY: &str = "\nhankel_dsl::library!(sample { api: 1, functions: [order, parts, loops, \
                       branches, bits, reserved, calls] });";

/// Values that tell operations apart.
fn values() -> Vec<f32> {
    let mut all = vec![
        0.0, 1.0, -1.0, 0.5, -0.5, 0.6, -0.6, 3.0, 1e-3, -77.25, 0.1, 1e6,
    ];
    let mut state = 1_u32;
    for _ in 0..20 {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        all.push((state >> 8) as f32 / 8_388_608.0 - 1.0);
    }
    all
}

/// What the functions give natively, a line of bits for each call.
fn natively() -> String {
    let mut lines = Vec::new();
    let bits = |x: f32| if x == 0.0 { 0 } else { x.to_bits() };
    for &x in &values() {
        for &y in &values() {
            let z = x * y + 0.25;
            let p = parts(Vec3::new(x, y, z), y);
            let b = bits_of(x, y);
            let all = [
                bits(order(x, y, z)),
                bits(p.x),
                bits(p.y),
                bits(loops(x, b)),
                bits(branches(x, y)),
                bits_function(b, y).x,
                bits_function(b, y).y,
                bits(reserved(x, y)),
                bits(calls(x, y)),
            ];
            lines.push(all.map(|w| format!("{w:08x}")).join(" "));
        }
    }
    lines.join("\n")
}

fn bits_function(word: u32, x: f32) -> UVec2 {
    bits(word, x)
}

fn bits_of(x: f32, y: f32) -> u32 {
    x.to_bits() ^ y.to_bits().rotate_left(7)
}

fn run(command: &mut Command) -> String {
    let done = command
        .output()
        .unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let words = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.success(), "{command:?}\n{words}");
    String::from_utf8_lossy(&done.stdout).trim_end().to_owned()
}

fn same(name: &str, given: &str, expected: &str) {
    // NaNs have any bits.
    let nan = |w: &str| u32::from_str_radix(w, 16).is_ok_and(|b| f32::from_bits(b).is_nan());
    assert_eq!(given.lines().count(), expected.lines().count(), "{name}");
    for (i, (a, b)) in given.lines().zip(expected.lines()).enumerate() {
        for (j, (x, y)) in a.split(' ').zip(b.split(' ')).enumerate() {
            assert!(
                x == y || (nan(x) && nan(y)),
                "{name}: row {i}, value {j}: {x} for {y}"
            );
        }
    }
}

/// The values in an array of a language.
fn listed(suffix: &str) -> String {
    let all: Vec<String> = values().iter().map(|v| format!("{v:?}{suffix}")).collect();
    all.join(", ")
}

/// What C prints: `body` for every pair of values `x`, `y`, and a new line.
fn printed_by_c(libraries: &[Library], body: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("hankel_sample.h"), text(libraries, "c")).unwrap();
    let program = format!(
        "#include \"hankel_sample.h\"\n#include <stdio.h>\nint main(void) {{\n    const float v[] = {{ {} }};\n    \
         const int n = sizeof v / sizeof *v;\n    for (int i = 0; i < n; i++) for (int j = 0; j < n; j++) {{\n        \
         float x = v[i], y = v[j];\n        {body}\n        printf(\"\\n\");\n    }}\n    return 0;\n}}\n",
        listed("f")
    );
    std::fs::write(at("program.c"), program).unwrap();
    let mut cc = Command::new("cc");
    cc.args([
        "-std=c99",
        "-O2",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-pedantic",
    ]);
    run(cc.arg("-o").args([at("c"), at("program.c")]).arg("-lm"));
    run(&mut Command::new(at("c")))
}

/// What Rust prints: the words of `all` for every pair of values `x`, `y`, a line each.
fn printed_by_rust(libraries: &[Library], all: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("hankel_sample.rs"), text(libraries, "rust")).unwrap();
    let program = format!(
        "mod hankel_sample;\nuse hankel_sample::*;\nfn main() {{\n    let v = [{}];\n    for x in v {{\n        \
         for y in v {{\n            let all: Vec<u32> = {all};\n            \
         let words: Vec<String> = all.iter().map(|w| format!(\"{{w:08x}}\")).collect();\n            \
         println!(\"{{}}\", words.join(\" \"));\n        }}\n    }}\n}}\n",
        listed("_f32")
    );
    std::fs::write(at("program.rs"), program).unwrap();
    let mut rustc = Command::new("rustc");
    rustc.args(["--edition", "2024", "-O", "-A", "dead_code", "-o"]);
    run(rustc.args([at("rust"), at("program.rs")]));
    run(&mut Command::new(at("rust")))
}

#[test]
fn c_and_rust_mean_what_the_source_means() {
    let libraries = libraries(&format!("{SOURCE}{LIBRARY}")).unwrap_or_else(|e| panic!("{e}"));
    let expected = natively();
    // Both zeros are one.
    let c = printed_by_c(
        &libraries,
        "#define OF(x) ((x) == 0.0f ? 0u : hankel_bits_of(x))
        float z = x * y + 0.25f;
        uint32_t k = hankel_bits_of(y);
        uint32_t b = hankel_bits_of(x) ^ (k << 7 | k >> 25);
        hankel_float2 p = hankel_parts(hankel_make_float3(x, y, z), y);
        hankel_uint2 q = hankel_bits(b, y);
        printf(\"%08x %08x %08x %08x %08x %08x %08x %08x %08x\", OF(hankel_order(x, y, z)),
            OF(p.x), OF(p.y), OF(hankel_loops(x, b)), OF(hankel_branches(x, y)), q.x, q.y,
            OF(hankel_reserved(x, y)), OF(hankel_calls(x, y)));",
    );
    same("C", &c, &expected);
    let rust = printed_by_rust(
        &libraries,
        "{
                let of = |x: f32| if x == 0.0 { 0 } else { x.to_bits() };
                let z = x * y + 0.25;
                let b = x.to_bits() ^ y.to_bits().rotate_left(7);
                let (p, q) = (parts([x, y, z], y), bits(b, y));
                vec![of(order(x, y, z)), of(p[0]), of(p[1]), of(loops(x, b)), of(branches(x, y)),
                    q[0], q[1], of(reserved(x, y)), of(calls(x, y))]
            }",
    );
    same("Rust", &rust, &expected);
}

#[test]
fn what_has_no_form_is_refused_with_its_place() {
    let cases = [
        (
            "pub fn f(x: f32) -> f32 {\n    x % 2.0\n}",
            "src/lib.rs:3:5",
            "floor",
        ),
        (
            "pub fn f(x: u32) -> f32 {\n    let a = [1.0_f32, 2.0];\n    a[x as usize]\n}",
            "src/lib.rs:4:7",
            "usize",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    x.sin()\n}",
            "src/lib.rs:3:5",
            "`sin`",
        ),
        (
            "pub fn f(x: f64) -> f32 {\n    0.0\n}",
            "src/lib.rs:2:13",
            "f64",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    for i in (0..3).chain(5..6) {}\n    x\n}",
            "src/lib.rs:3:15",
            "a range",
        ),
        (
            "pub fn f(x: f32, n: u32) -> f32 {\n    for i in 0..n {\n        if x < i as f32 {\n            return 2.0;\n        }\n    }\n    x\n}",
            "src/lib.rs:4:9",
            "it is in a loop",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    loop {\n        if x < 1.0 {\n            break;\n        }\n    }\n    x\n}",
            "src/lib.rs:3:5",
            "for i in",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    match x {\n        _ if x < 1.0 => 2.0,\n        y @ _ => y,\n    }\n}",
            "src/lib.rs:5:9",
            "pattern",
        ),
        (
            "pub fn f(x: Half) -> f32 {\n    0.0\n}\npub struct Half(f32);",
            "src/lib.rs:2:13",
            "no names",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    helper(x)\n}\nfn helper(x: f32) -> f32 {\n    helper(x)\n}",
            "src/lib.rs:6:5",
            "circles",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    f(x)\n}",
            "src/lib.rs:2",
            "calls itself",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    unknown(x)\n}",
            "src/lib.rs:3:5",
            "not found",
        ),
        (
            "pub fn f(x: u32, y: u32) -> u32 {\n    x / y\n}",
            "src/lib.rs:3:5",
            "quotient",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    unsafe { x }\n}",
            "src/lib.rs:3:5",
            "unsafe",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    let mut y = x;\n    while y < 1.0 {\n        y += 1.0;\n    }\n    y\n}",
            "src/lib.rs:4:5",
            "counts",
        ),
        (
            "pub fn f(x: f32) -> f32 {\n    dbg!(x)\n}",
            "src/lib.rs:3:5",
            "dbg",
        ),
    ];
    for (body, place, reason) in cases {
        let refusal = match one(&format!("#[function]\n{body}")) {
            Err(refusal) => refusal,
            Ok(libraries) => panic!("{body}\nbecame\n{}", text(&libraries, "wgsl")),
        };
        assert!(
            refusal.place.starts_with(place) && refusal.reason.contains(reason),
            "{body}\n{refusal}"
        );
    }
}

#[test]
fn a_list_that_names_nothing_is_refused() {
    let text =
        "fn f(x: f32) -> f32 { x }\nhankel_dsl::library!(sample { api: 1, functions: [f] });";
    assert!(libraries(text).unwrap_err().reason.contains("#[function]"));
    let text = "hankel_dsl::library!(sample { api: 1, functions: [g] });";
    assert!(
        libraries(text)
            .unwrap_err()
            .reason
            .contains("no such function")
    );
    let text = "hankel_dsl::library!(sample { functions: [] });";
    assert!(libraries(text).unwrap_err().reason.contains("api"));
}

#[test]
fn text_is_as_a_person_writes_it() {
    let source = "/// Doubles `x` \\[Knuth\\].\n#[function]\npub fn f(x: f32) -> f32 {\n    // Twice β².\n    \
                  let y = x * 2.0;\n    y * y\n}";
    let libraries = one(source).unwrap();
    let wgsl = text(&libraries, "wgsl");
    let function = "/// Doubles `x` [Knuth].\nfn hankel_f(x: f32) -> f32 {\n    // Twice beta^2.\n    \
                    let y = x * 2.0;\n    return y * y;\n}\n";
    assert!(wgsl.ends_with(function), "{wgsl}");
    assert!(
        wgsl.starts_with(
            "// SPDX-License-Identifier: MIT\n// sample 1.2.3, library `sample`, API 1 "
        )
    );
    let naga_oil = text(&libraries, "naga-oil");
    assert!(naga_oil.starts_with("#define_import_path hankel::sample\n"));
    let glsl = text(&libraries, "glsl");
    assert!(
        glsl.contains("highp float hankel_f(highp float x) {"),
        "{glsl}"
    );
    assert!(!glsl.contains("#version"), "{glsl}");
    let msl = text(&libraries, "msl");
    assert!(
        msl.contains("inline float f(float x) {\n    #pragma METAL fp contract(off)"),
        "{msl}"
    );
    let tsl = text(&libraries, "tsl");
    let function = "/** Doubles `x` [Knuth]. */\nexport const f = /*@__PURE__*/ Fn(([x]) => {\n    // Twice \
                    beta^2.\n    const y = x.mul(2).toConst('y');\n    return y.mul(y);\n}).setLayout({\n    name: \
                    'hankel_f', type: 'float', inputs: [\n        { name: 'x', type: 'float' },\n    ],\n});\n";
    assert!(tsl.ends_with(function), "{tsl}");
    assert!(
        tsl.contains("import {\n    Fn\n} from 'three/tsl';\n"),
        "{tsl}"
    );
}

const LOOKUP: &str = "/// The mean of what is looked up.\n#[function]\npub fn f(count: u32, depth_at: impl \
                      Fn(u32) -> f32) -> f32 {\n    let mut sum = depth_at(0);\n    let mut i = 1;\n    while i \
                      < count {\n        sum += depth_at(i);\n        i += 1;\n    }\n    sum / count as f32\n}";

#[test]
fn what_the_host_looks_up_is_handed_in() {
    let libraries = one(LOOKUP).unwrap();
    // By a macro where there are no functions as values.
    let glsl = text(&libraries, "glsl");
    assert!(glsl.contains("#if defined(HANKEL_DEPTH_AT)\n"), "{glsl}");
    assert!(glsl.contains("HANKEL_DEPTH_AT(i)"), "{glsl}");
    assert!(
        text(&libraries, "msl")
            .contains("template <typename DepthAt>\ninline float f(uint count, DepthAt depth_at)")
    );
    assert!(!text(&libraries, "wgsl").contains("fn hankel_f"));
    // In JavaScript a function that gives a node. Its loop's name is its own, for others may run around it.
    let tsl = text(&libraries, "tsl");
    let function = "/** The mean of what is looked up. */\nexport const f = (count, depthAt) => Fn(([count]) => {\n    \
                    const sum = depthAt(uint(0)).toVar();\n    Loop({ start: uint(1), end: count, type: 'uint', \
                    condition: '<', name: 'hankel_f_i' }, (each) => {\n        const i = \
                    each.hankel_f_i.toConst();\n        sum.assign(sum.add(depthAt(i)));\n    });\n    return \
                    sum.div(float(count));\n})(count);\n";
    assert!(tsl.ends_with(function), "{tsl}");

    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("hankel_sample.h"), text(&libraries, "c")).unwrap();
    let program = "#include \"hankel_sample.h\"\n#include <stdio.h>\n\
                   static float at(void *context, uint32_t i) { return ((float *)context)[i]; }\n\
                   int main(void) {\n    float depths[3] = { 1.0f, 2.0f, 6.0f };\n\
                   \x20   printf(\"%g\", hankel_f(3u, at, depths));\n    return 0;\n}\n";
    std::fs::write(at("program.c"), program).unwrap();
    let mut cc = Command::new("cc");
    cc.args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-o"]);
    run(cc.args([at("c"), at("program.c")]).arg("-lm"));
    assert_eq!(run(&mut Command::new(at("c"))), "3");
}

fn folder_of(body: &str, api: u32) -> Folder {
    let text = format!(
        "#[function]\n{body}\nhankel_dsl::library!(sample {{ api: {api}, functions: [f] }});"
    );
    Folder::new(&libraries(&text).unwrap(), "hankel", &[], "0").unwrap()
}

#[test]
fn a_changed_signature_needs_another_number() {
    let out = tempfile::tempdir().unwrap();
    let old = folder_of("pub fn f(x: f32) -> f32 { x }", 1);
    let report = old.write(out.path(), false).unwrap();
    assert_eq!((report.functions, report.unchanged), (1, 0));
    assert_eq!(old.write(out.path(), false).unwrap().written.len(), 0);
    assert!(old.check(out.path()).unwrap().is_fine());

    // Another body is another text, and no more.
    let body = folder_of("pub fn f(x: f32) -> f32 { x * 2.0 }", 1);
    assert!(!body.check(out.path()).unwrap().is_fine());

    let changed = folder_of("pub fn f(x: f32, y: f32) -> f32 { x * y }", 1);
    for error in [
        changed.write(out.path(), false).unwrap_err(),
        changed.check(out.path()).unwrap_err(),
    ] {
        assert!(matches!(&error, Error::Api { api: 1, .. }), "{error}");
        assert!(
            error
                .to_string()
                .contains("`f` was (x: f32) -> f32 and is (x: f32, y: f32) -> f32")
        );
        assert!(error.advice().unwrap().contains("api: 2"));
    }
    assert!(
        old.check(out.path()).unwrap().is_fine(),
        "nothing was written"
    );

    let raised = folder_of("pub fn f(x: f32, y: f32) -> f32 { x * y }", 2);
    raised.write(out.path(), false).unwrap();
    assert!(raised.check(out.path()).unwrap().is_fine());
    assert_eq!(
        read_record(out.path()).unwrap().unwrap().libraries["sample"].api,
        2
    );
}

#[test]
fn what_hankel_did_not_write_stays() {
    let out = tempfile::tempdir().unwrap();
    let folder = folder_of("pub fn f(x: f32) -> f32 { x }", 1);
    folder.write(out.path(), false).unwrap();
    let file = out.path().join(Path::new("wgsl/hankel_sample.wgsl"));
    std::fs::write(&file, "mine").unwrap();
    assert!(matches!(
        folder.write(out.path(), false),
        Err(Error::InTheWay { .. })
    ));
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    assert!(!folder.check(out.path()).unwrap().is_fine());
    folder.write(out.path(), true).unwrap();
    assert!(folder.check(out.path()).unwrap().is_fine());
}

#[test]
fn a_prefix_is_a_name() {
    let libraries = one("#[function]\npub fn f(x: f32) -> f32 { x }").unwrap();
    for prefix in ["", "Hankel", "9x", "a__b", "a_", "float", "my-engine"] {
        assert!(
            Folder::new(&libraries, prefix, &[], "0").is_err(),
            "{prefix}"
        );
    }
    let naming = Naming {
        prefix: "my_engine".into(),
        library: "sample".into(),
    };
    let hlsl = FORMS.iter().find(|f| f.name == "hlsl").unwrap();
    let text = hlsl.text(&libraries[0], &naming, "0");
    assert!(text.contains("float my_engine_f(float x)"), "{text}");
    assert!(text.contains("#ifndef MY_ENGINE_SAMPLE_HLSL"), "{text}");
}

/// Rust's names become JavaScript's, but none hides what the module imports or gives, or another local.
#[test]
fn names_are_those_of_javascript_and_unique() {
    let source = "/// By `b_b` and [`two_max`].\n#[function]\npub fn f(b_b: f32, bB: f32, uv_uint: f32) -> f32 {\n    \
                  let undefined = b_b * bB;\n    let two_max = two_max(undefined, uv_uint) - undefined;\n    \
                  two_max * two_max + undefined\n}\n/// Twice the larger one.\n#[function]\npub fn two_max(a: f32, b: f32) -> \
                  f32 {\n    Real::max(a, b) * 2.0\n}";
    let tsl = text(&one(source).unwrap(), "tsl");
    let function = "/** By `bB` and `twoMax`. */\nexport const f = /*@__PURE__*/ Fn(([bB, bB_, uvUint]) => {\n    \
                    const undefined_ = bB.mul(bB_).toConst('undefined_');\n    const twoMaxValue = twoMax(undefined_, \
                    uvUint).sub(undefined_).toConst('twoMaxValue');\n    return twoMaxValue.mul(twoMaxValue).add(undefined_);\n\
                    }).setLayout({";
    assert!(tsl.contains(function), "{tsl}");
}

#[test]
fn types_lie_beside_the_module() {
    let libraries = one("/// Half.\n#[function]\npub fn f(x: f32) -> f32 { x * 0.5 }").unwrap();
    let files = hankel_codegen::functions::files(&libraries, "mine", "0");
    assert!(files["tsl/mine_sample.tsl.js"].contains("name: 'mine_f'"));
    let types = &files["tsl/mine_sample.tsl.d.ts"];
    assert!(
        types.ends_with("/** Half. */\nexport function f(x: Float): Node<'float'>;\n"),
        "{types}"
    );
}

/// What a local is stays beside its name: a long value is broken within, not before it.
#[test]
fn long_values_are_broken_behind_their_names() {
    let body = "/// A long sum.\n#[function]\npub fn f(length_of_the_first: f32, length_of_the_second: f32) \
                -> f32 {\n    let root_of_both = Real::sqrt(Real::max(length_of_the_first * \
                length_of_the_first + length_of_the_second * length_of_the_second, 1e-20));\n    \
                root_of_both / (root_of_both + 1.0)\n}";
    let libraries = one(body).unwrap_or_else(|e| panic!("{e}"));
    for form in ["hlsl", "glsl", "msl", "wgsl", "c"] {
        let text = text(&libraries, form);
        let broken = text
            .lines()
            .any(|l| l.ends_with("float") || l.ends_with("let"));
        assert!(!broken, "{form}: {text}");
        let line = text.lines().find(|l| l.contains(" root_of_both = "));
        assert!(line.is_some_and(|l| l.contains("max")), "{form}: {text}");
        assert!(text.lines().all(|l| l.len() <= 110), "{form}: {text}");
    }
}

/// An elementary function is written once, and called; what it is made of of numbers' bits has a form.
#[test]
fn elementary_functions_stay_calls() {
    let file = |path: &str, text: &str| (path.to_owned(), text.to_owned());
    let dsl = CrateText {
        name: "hankel_dsl".into(),
        files: [
            file("src/lib.rs", "pub mod math;"),
            file(
                "src/math/mod.rs",
                "mod exponential; mod primitives; pub use exponential::exp;",
            ),
            file(
                "src/math/exponential.rs",
                "use super::Elementary;\n/// `e` to the power of `x`.\n#[must_use]\npub fn exp<R: \
                 Elementary>(x: R) -> R { (x + lit!(1.0)).guard() * x.power_of_two() }",
            ),
            file(
                "src/math/primitives.rs",
                "impl Elementary for f32 { fn power_of_two(self) -> Self { \
                 Self::from_bits(((crate::to_i32(self).wrapping_add(127)) as u32) << 23) } }",
            ),
        ]
        .into(),
        ..CrateText::default()
    };
    let body = "use hankel_dsl::math;\n/// A cosine.\n#[function]\npub fn f(x: f32) -> f32 { math::exp(x) + \
                math::exp(-x) }\nhankel_dsl::library!(sample { api: 1, functions: [f] });";
    let libraries = read(&[krate(body), dsl]).unwrap_or_else(|e| panic!("{e}"));
    let text = text(&libraries, "hlsl");
    let calls = "hankel_exp(x) + hankel_exp(-x)";
    assert!(text.contains(calls), "{text}");
    assert_eq!(
        text.matches("float hankel_exp(float x)").count(),
        1,
        "{text}"
    );
    assert!(
        text.contains("asfloat(uint(int(x) + 127) << 23u)"),
        "{text}"
    );
    assert!(text.contains("max(x + 1.0f, -8.507059e37f)"), "{text}");
}

#[test]
fn self_is_the_type_with_its_parameters() {
    // `A` is in no argument of `made`.
    let libraries = one("use hankel_dsl::{Real, apart, function, lit};
        trait Rule<R: Real>: Copy { fn of(x: R) -> Self; fn number(self) -> R; }
        #[derive(Clone, Copy)] struct Twice<R>(R);
        impl<R: Real> Rule<R> for Twice<R> {
            fn of(x: R) -> Self { Self(x * lit!(2.0)) }
            fn number(self) -> R { self.0 }
        }
        struct Held<R, A> { x: A, unit: R }
        impl<R: Real, A: Rule<R>> Held<R, A> {
            fn new(x: R) -> Self { Self::made(x) }
            fn made(x: R) -> Self { Held { x: A::of(x), unit: lit!(3.0) } }
            fn both(&self) -> R { self.x.number() * self.unit }
        }
        #[apart(R, if true)] fn held<R: Real>(x: R) -> Held<R, Twice<R>> { Held::<R, Twice<R>>::new(x) }
        #[function] fn f(x: f32) -> f32 { held::<f32>(x).both() }")
    .expect("it is translated");
    let glsl = text(&libraries, "glsl");
    assert!(glsl.contains("x * 2.0 * 3.0"), "{glsl}");
}

/// The sources of a crate of this repository.
fn crate_of(name: &str, folder: &Path) -> CrateText {
    fn read_into(folder: &Path, at: &str, files: &mut BTreeMap<String, String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("{at}/{}", path.file_name().unwrap().to_string_lossy());
            if path.is_dir() {
                read_into(&path, &name, files);
            } else if name.ends_with(".rs") {
                files.insert(name, std::fs::read_to_string(&path).unwrap());
            }
        }
    }
    let mut files = BTreeMap::new();
    read_into(&folder.join("src"), "src", &mut files);
    CrateText {
        name: name.into(),
        files,
        ..CrateText::default()
    }
}

/// Every elementary function of the DSL is in libraries, and means there what it means here.
#[test]
fn elementary_functions_mean_what_they_mean_here() {
    macro_rules! functions {
        ($($name:ident)*; $($pair:ident)*; $($device:ident)*; $($of_two:ident)*) => {
            const NAMES: &[&str] = &[$(stringify!($name)),*];
            const PAIRS: &[&str] = &[$(stringify!($pair)),*];
            const DEVICE: &[&str] = &[$(stringify!($device)),*];
            const DEVICE_PAIRS: &[&str] = &[$(stringify!($of_two)),*];
            fn here(x: f32, y: f32) -> Vec<f32> {
                vec![
                    $(math::$name(x),)* $(math::$pair(x, y),)*
                    $(math::native::$device(x),)* $(math::native::$of_two(x, y),)*
                ]
            }
        };
    }
    functions!(
        sin cos tan asin acos atan sinh cosh tanh exp exp2 exp_m1 ln ln_1p log2 cbrt floor ceil
        trunc round fract sign;
        pow atan2 step;
        sin cos tan asin acos atan exp exp2 ln log2;
        pow atan2
    );
    let mut source = String::new();
    let mut calls = Vec::new();
    for (module, prefix, one, two) in [
        ("math", "of", NAMES, PAIRS),
        ("math::native", "native", DEVICE, DEVICE_PAIRS),
    ] {
        for name in one {
            source += &format!(
                "/// Itself.\n#[function]\npub fn {prefix}_{name}(x: f32) -> f32 {{ {module}::{name}(x) }}\n"
            );
            calls.push((format!("{prefix}_{name}"), false));
        }
        for name in two {
            source += &format!(
                "/// Itself.\n#[function]\npub fn {prefix}_{name}(x: f32, y: f32) -> f32 {{ {module}::{name}(x, y) }}\n"
            );
            calls.push((format!("{prefix}_{name}"), true));
        }
    }
    let names: Vec<&str> = calls.iter().map(|(name, _)| name.as_str()).collect();
    let source = format!(
        "use hankel_dsl::{{function, math}};\n{source}hankel_dsl::library!(sample {{ api: 1, functions: [{}] }});",
        names.join(", ")
    );
    let dsl = Path::new(env!("CARGO_MANIFEST_DIR")).join("../kernels/dsl");
    let libraries =
        read(&[krate(&source), crate_of("hankel_dsl", &dsl)]).unwrap_or_else(|e| panic!("{e}"));
    let lines = |of: &dyn Fn(f32, f32) -> Vec<f32>| {
        let mut lines = Vec::new();
        for x in values() {
            for y in values() {
                let words = of(x, y).into_iter().map(|v| format!("{:08x}", v.to_bits()));
                lines.push(words.collect::<Vec<_>>().join(" "));
            }
        }
        lines.join("\n")
    };
    let expected = lines(&here);
    let printed: Vec<String> = calls
        .iter()
        .map(|(name, of_two)| {
            let args = if *of_two { "x, y" } else { "x" };
            let space = if *name == calls[0].0 { "" } else { " " };
            format!("printf(\"{space}%08x\", hankel_bits_of(hankel_{name}({args})));")
        })
        .collect();
    let c = printed_by_c(&libraries, &printed.join("\n        "));
    same("C", &c, &expected);
    let written: Vec<String> = calls
        .iter()
        .map(|(name, of_two)| format!("{name}({}).to_bits()", if *of_two { "x, y" } else { "x" }))
        .collect();
    let rust = printed_by_rust(&libraries, &format!("vec![{}]", written.join(", ")));
    same("Rust", &rust, &expected);
}

/// Branches that go on double what follows: that has an end.
#[test]
fn early_ends_do_not_grow_without_end() {
    let branch = "if x > 0.0 { if y > 0.0 { return y; } x += 1.0; } else { x -= 1.0; }\n";
    let body = |count: usize| {
        format!(
            "#[function]\npub fn f(a: f32, y: f32) -> f32 {{\nlet mut x = a;\n{}x\n}}",
            branch.repeat(count)
        )
    };
    assert!(one(&body(3)).is_ok());
    let refusal = one(&body(40)).unwrap_err();
    assert!(refusal.reason.contains("too many branches"), "{refusal}");
}

/// What follows a branch is not put beside a name that would hide one of its own.
#[test]
fn early_ends_keep_what_names_mean() {
    let arm = "match kind { n if n > 3 => { if x < 0.0 { return 1.0; } } _ => {} }";
    let body = |name: &str| {
        format!(
            "#[function]\npub fn f(x: f32, kind: u32) -> f32 {{\n    let {name} = 5.0;\n    {arm}\n    x + {name}\n}}"
        )
    };
    assert!(one(&body("other")).is_ok());
    let refusal = one(&body("n")).unwrap_err();
    assert!(refusal.reason.contains("read later"), "{refusal}");
}
