//! How exact the elementary functions are, over all arguments of `f32`.
//!
//! The record of it, `src/math/accuracy.md`, is written by
//!
//! ```sh
//! HANKEL_WRITE_ACCURACY=1 cargo test --release -p hankel-dsl --test elementary -- --ignored
//! ```
//!
//! which takes minutes a function (`HANKEL_FUNCTIONS=sin,cos` takes these alone, `HANKEL_STRIDE=101`
//! a part of the arguments, which the record then says). Without the variable it compares. The other
//! tests take a part of the arguments, and the record's worst ones.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use hankel_dsl::math::{self, Elementary};
use hankel_dsl::native::{Arg, Call, Entry, Mode};
use hankel_dsl::{Element, kernel};

/// A function of one argument, and the same one of `f64` by the standard library.
struct One {
    name: &'static str,
    reference: fn(f64) -> f64,
}

macro_rules! ones {
    ($count:literal: $($name:ident = $reference:expr;)*) => {
        const ONES: [One; $count] = [$(One { name: stringify!($name), reference: $reference }),*];
        $(
            /// The function of that name.
            #[kernel(compute, threads(64), precision(f32, f64))]
            fn $name<R: Elementary>(#[element] x: R) -> R {
                math::$name(x)
            }
        )*
        hankel_dsl::kernels![atan2, pow, fma, $($name),*];
    };
}

ones! {
    17:
    sin = f64::sin;
    cos = f64::cos;
    tan = f64::tan;
    asin = f64::asin;
    acos = f64::acos;
    atan = f64::atan;
    sinh = f64::sinh;
    cosh = f64::cosh;
    tanh = f64::tanh;
    exp = f64::exp;
    exp2 = f64::exp2;
    exp_m1 = f64::exp_m1;
    ln = f64::ln;
    log2 = f64::log2;
    ln_1p = f64::ln_1p;
    cbrt = f64::cbrt;
    round = f64::round;
}

/// Three arguments.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
struct Three<R> {
    x: R,
    y: R,
    z: R,
}

/// The function of that name.
#[kernel(compute, threads(64), precision(f32, f64))]
fn atan2<R: Elementary>(#[element] of: Three<R>) -> R {
    math::atan2(of.x, of.y)
}

/// The function of that name.
#[kernel(compute, threads(64), precision(f32, f64))]
fn pow<R: Elementary>(#[element] of: Three<R>) -> R {
    math::pow(of.x, of.y)
}

/// The function of that name.
#[kernel(compute, threads(64), precision(f32, f64))]
fn fma<R: Elementary>(#[element] of: Three<R>) -> R {
    math::fma(of.x, of.y, of.z)
}

/// A function of two arguments.
struct Two {
    name: &'static str,
    reference: fn(f64, f64) -> f64,
}

const TWOS: [Two; 2] = [
    Two {
        name: "atan2",
        reference: f64::atan2,
    },
    Two {
        name: "pow",
        reference: f64::powf,
    },
];

const SCALARS: Mode = Mode::REFERENCE;

const LANES: Mode = Mode {
    lanes: true,
    ..Mode::REFERENCE
};

fn entry(name: &str) -> Entry {
    let all = entries();
    let found = all.into_iter().find(|e| e.kernel.name == name);
    found.unwrap_or_else(|| panic!("no {name}"))
}

fn run<A: bytemuck::Pod, T: bytemuck::Pod>(
    entry: &Entry,
    arguments: &[A],
    out: &mut [T],
    mode: Mode,
) {
    (entry.run)(&mut Call {
        args: vec![
            Arg::Bytes(bytemuck::cast_slice(arguments)),
            Arg::BytesMut(bytemuck::cast_slice_mut(out)),
        ],
        constants: vec![],
        mode,
    })
    .unwrap();
}

/// Two to the power of `n`.
fn power_of_two(n: i32) -> f64 {
    f64::from_bits(((n + 1023) as u64) << 52)
}

/// How far a result lies from what it should be, in units of the last place that an `f32` of the
/// right size has. Infinity counts as 2^128.
fn error(result: f32, right: f64) -> f64 {
    if right.is_nan() || result.is_nan() {
        return if right.is_nan() && result.is_nan() {
            0.0
        } else {
            f64::INFINITY
        };
    }
    if right == 0.0 || right.abs() < 1e-60 {
        // Zeros have signs.
        let same = result.is_sign_negative() == right.is_sign_negative();
        return if same {
            f64::from(result.abs()) / 1.4e-45
        } else {
            f64::INFINITY
        };
    }
    let limit = power_of_two(128);
    let result = if result.is_infinite() {
        limit.copysign(result.into())
    } else {
        f64::from(result)
    };
    let right = right.clamp(-limit, limit);
    let exponent = ((right.to_bits() >> 52) & 0x7ff) as i32 - 1023;
    (result - right).abs() / power_of_two(exponent.clamp(-126, 127) - 23)
}

#[derive(Clone, Copy)]
struct Worst {
    error: f64,
    at: u64,
}

const BLOCK: u64 = 1 << 14;

/// The worst of `count` arguments. `measure` takes a range of their numbers.
fn worst(count: u64, measure: impl Fn(u64, u64) -> Worst + Sync) -> Worst {
    let next = AtomicU64::new(0);
    let all = Mutex::new(Worst::NONE);
    let work = || {
        let mut own = Worst::NONE;
        loop {
            let from = next.fetch_add(BLOCK, Ordering::Relaxed);
            if from >= count {
                break;
            }
            own.take(measure(from, count.min(from + BLOCK)));
        }
        all.lock().unwrap().take(own);
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(work);
        }
    });
    all.into_inner().unwrap()
}

impl Worst {
    const NONE: Self = Self {
        error: -1.0,
        at: u64::MAX,
    };

    /// Of equals the first argument, whoever met it.
    fn take(&mut self, other: Self) {
        if other.error > self.error || (other.error == self.error && other.at < self.at) {
            *self = other;
        }
    }
}

/// [`error`], without its cases where both numbers are ordinary.
#[inline(always)]
fn quick_error(result: f32, right: f64) -> f64 {
    let exponent = (right.to_bits() >> 52) & 0x7ff;
    // From 2^-126 to 2^126.
    if (897..1149).contains(&exponent) {
        let units = f64::from_bits((2046 + 23 - exponent) << 52);
        let error = (f64::from(result) - right).abs() * units;
        if error < 2.0 {
            return error;
        }
    }
    error(result, right)
}

impl One {
    /// Whether the function of a negative number is that of the positive one, but for the sign.
    fn mirrors(&self) -> bool {
        [
            "sin", "cos", "tan", "asin", "atan", "sinh", "cosh", "tanh", "cbrt", "round",
        ]
        .contains(&self.name)
    }

    /// The worst of all arguments, or of every `stride`th. Where the function mirrors, the negative
    /// ones are compared with the positive ones.
    fn worst(&self, stride: u64) -> Worst {
        let entry = entry(self.name);
        let all = if self.mirrors() { 1_u64 << 31 } else { 1 << 32 };
        let even = ["cos", "cosh"].contains(&self.name);
        worst(all.div_ceil(stride), |from, to| {
            let xs: Vec<f32> = (from..to)
                .map(|i| f32::from_bits((i * stride) as u32))
                .collect();
            let mut results = vec![0.0_f32; xs.len()];
            run(&entry, &xs, &mut results, LANES);
            if self.mirrors() {
                let others: Vec<f32> = xs.iter().map(|x| -x).collect();
                let mut mirrored = vec![0.0_f32; xs.len()];
                run(&entry, &others, &mut mirrored, LANES);
                for ((x, a), b) in xs.iter().zip(&results).zip(mirrored) {
                    let b = if even { b } else { -b };
                    let same = a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
                    assert!(same, "{} of {x:e} and of its negative", self.name);
                }
            }
            let mut worst = Worst::NONE;
            for (x, result) in xs.iter().zip(results) {
                let error = quick_error(result, (self.reference)(f64::from(*x)));
                if error > worst.error {
                    worst = Worst {
                        error,
                        at: x.to_bits().into(),
                    };
                }
            }
            worst
        })
    }

    fn at(&self, bits: u64) -> f64 {
        let (x, mut result) = (f32::from_bits(bits as u32), [0.0_f32]);
        run(&entry(self.name), &[x], &mut result, SCALARS);
        error(result[0], (self.reference)(x.into()))
    }
}

/// Both arguments in one number's bits.
fn both(bits: u64) -> Three<f32> {
    Three {
        x: f32::from_bits((bits >> 32) as u32),
        y: f32::from_bits(bits as u32),
        z: 0.0,
    }
}

/// splitmix64.
fn random(i: u64) -> u64 {
    let mut x = i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Bits of two arguments: any bits, or from 2^-8 to 2^8, where most powers are neither zero nor
/// infinite.
fn pair(i: u64) -> u64 {
    let x = random(i);
    if i & 1 == 0 {
        return x;
    }
    let near = |half: u64| (half & 0x87ff_ffff) + 0x3b80_0000;
    near(x >> 32) << 32 | near(x & 0xffff_ffff)
}

impl Two {
    /// Of pseudo-random pairs.
    fn worst(&self, count: u64) -> Worst {
        let entry = entry(self.name);
        worst(count, |from, to| {
            let bits: Vec<u64> = (from..to).map(pair).collect();
            let pairs: Vec<Three<f32>> = bits.iter().map(|bits| both(*bits)).collect();
            let mut results = vec![0.0_f32; pairs.len()];
            run(&entry, &pairs, &mut results, LANES);
            let mut worst = Worst::NONE;
            for ((bits, pair), result) in bits.iter().zip(pairs).zip(results) {
                let right = (self.reference)(pair.x.into(), pair.y.into());
                worst.take(Worst {
                    error: error(result, right),
                    at: *bits,
                });
            }
            worst
        })
    }

    fn at(&self, bits: u64) -> f64 {
        let (of, mut result) = (both(bits), [0.0_f32]);
        run(&entry(self.name), &[of], &mut result, SCALARS);
        error(result[0], (self.reference)(of.x.into(), of.y.into()))
    }
}

fn record_path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src/math/accuracy.md")
}

/// What the record says of each function: the error as it is printed, and the argument.
fn record() -> BTreeMap<String, (String, u64)> {
    let text = std::fs::read_to_string(record_path()).unwrap();
    text.lines()
        .skip(2)
        .map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let bits = cells[5].trim_matches('`').trim_start_matches("0x");
            let bits = u64::from_str_radix(&bits.replace('_', ""), 16).unwrap();
            let name = cells[1].trim_matches('`').to_owned();
            (name, (cells[2].to_owned(), bits))
        })
        .collect()
}

fn shown(error: f64) -> String {
    format!("{error:.3}")
}

#[test]
#[ignore = "minutes a function"]
fn all_arguments() {
    let variable = |name: &str| std::env::var(name).ok();
    let wanted = variable("HANKEL_FUNCTIONS");
    let wanted = |name: &str| {
        wanted
            .as_deref()
            .is_none_or(|all| all.split(',').any(|one| one == name))
    };
    let stride = variable("HANKEL_STRIDE").map_or(1, |n| n.parse().unwrap());
    let tried = match stride {
        1 => "all".into(),
        n => format!("every {n}th"),
    };
    let mut table = record_lines();
    for one in ONES.iter().filter(|one| wanted(one.name)) {
        let found = one.worst(stride);
        let x = f32::from_bits(found.at as u32);
        assert!(found.error <= 1.0, "{}: {} at {x:e}", one.name, found.error);
        let error = shown(found.error);
        let line = format!("| {error} | {tried} | `{x:e}` | `0x{:08x}` |", found.at);
        println!("{} {line}", one.name);
        table.insert(one.name.into(), line);
    }
    for two in TWOS.iter().filter(|two| wanted(two.name)) {
        let found = two.worst((1 << 28) / stride);
        let of = both(found.at);
        assert!(found.error <= 1.0, "{}: {}", two.name, found.error);
        let line = format!(
            "| {} | {} million pairs | `{:e}`, `{:e}` | `0x{:016x}` |",
            shown(found.error),
            ((1 << 28) / stride) >> 20,
            of.x,
            of.y,
            found.at
        );
        println!("{} {line}", two.name);
        table.insert(two.name.into(), line);
    }
    let names = ONES.iter().map(|one| one.name);
    let names: Vec<_> = names.chain(TWOS.iter().map(|two| two.name)).collect();
    let mut text = String::from(
        "| function | worst error, ulp | of arguments | at | bits |\n| --- | --- | --- | --- | --- |\n",
    );
    for name in names {
        if let Some(line) = table.get(name) {
            writeln!(text, "| `{name}` {line}").unwrap();
        }
    }
    if variable("HANKEL_WRITE_ACCURACY").is_some() {
        std::fs::write(record_path(), text).unwrap();
    } else {
        assert_eq!(std::fs::read_to_string(record_path()).unwrap(), text);
    }
}

/// The record's lines behind the names.
fn record_lines() -> BTreeMap<String, String> {
    let text = std::fs::read_to_string(record_path()).unwrap_or_default();
    text.lines()
        .skip(2)
        .filter_map(|line| {
            let (name, rest) = line.trim_start_matches("| ").split_once(" | ")?;
            Some((name.trim_matches('`').to_owned(), format!("| {rest}")))
        })
        .collect()
}

/// Each function is as far off at the record's argument as it says, and nowhere farther, of those
/// arguments that are tried: a function that changes changes the record.
#[test]
fn the_record_is_current() {
    let record = record();
    assert_eq!(record.len(), ONES.len() + TWOS.len());
    // Prime, so that all last bits occur.
    let stride = 4099;
    for one in &ONES {
        let (said, at) = &record[one.name];
        assert_eq!(&shown(one.at(*at)), said, "{}", one.name);
        let found = one.worst(stride);
        assert!(
            found.error <= said.parse::<f64>().unwrap() + 5e-4,
            "{}: {} at {:08x}",
            one.name,
            found.error,
            found.at
        );
    }
    for two in &TWOS {
        let (said, at) = &record[two.name];
        assert_eq!(&shown(two.at(*at)), said, "{}", two.name);
        let found = two.worst(1 << 20);
        assert!(
            found.error <= said.parse::<f64>().unwrap() + 5e-4,
            "{}: {} at {:016x}",
            two.name,
            found.error,
            found.at
        );
    }
}

fn same(a: f32, b: f32) -> bool {
    a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
}

/// Lanes compute what scalars do, at special numbers too.
#[test]
fn lanes_are_scalars() {
    let special = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        -0.5,
        2.0,
        -2.0,
        3.0,
        -3.0,
        1.5,
        -2.5,
        1e-40,
        -1e-40,
        88.8,
        104.5,
        f64::MAX,
        f64::MIN,
        f64::MIN_POSITIVE,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NAN,
    ];
    let mut wide: Vec<f64> = special.into();
    wide.extend((0..50_000).map(|i| f64::from_bits(random(i))));
    wide.extend((0..50_000).map(|i| f64::from(f32::from_bits(random(i) as u32))));
    wide.extend((0..50_000).map(|i| (random(i) >> 11) as f64 / 1e14 - 40.0));
    let single: Vec<f32> = wide.iter().map(|x| *x as f32).collect();
    for one in &ONES {
        let entries = [entry(one.name), entry(&format!("{}_f64", one.name))];
        let (mut scalars, mut lanes) = (vec![0.0_f32; wide.len()], vec![0.0_f32; wide.len()]);
        run(&entries[0], &single, &mut scalars, SCALARS);
        run(&entries[0], &single, &mut lanes, LANES);
        for ((x, a), b) in single.iter().zip(&scalars).zip(&lanes) {
            assert!(same(*a, *b), "{} of {x:e}: {a:e} and {b:e}", one.name);
        }
        let (mut scalars, mut lanes) = (vec![0.0_f64; wide.len()], vec![0.0_f64; wide.len()]);
        run(&entries[1], &wide, &mut scalars, SCALARS);
        run(&entries[1], &wide, &mut lanes, LANES);
        for ((x, a), b) in wide.iter().zip(&scalars).zip(&lanes) {
            let same = a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
            assert!(same, "{} of {x:e}: {a:e} and {b:e}", one.name);
        }
    }
    let mut threes: Vec<Three<f64>> = Vec::new();
    for x in special {
        for y in special {
            threes.push(Three { x, y, z: 1e-9 });
        }
    }
    threes.extend((0..100_000).map(|i| {
        let number = |i: u64| {
            f64::from(f32::from_bits(
                (random(i) as u32 & 0x87ff_ffff) + 0x3b80_0000,
            ))
        };
        Three {
            x: number(3 * i),
            y: number(3 * i + 1),
            z: number(3 * i + 2),
        }
    }));
    let singles: Vec<Three<f32>> = threes
        .iter()
        .map(|t| Three {
            x: t.x as f32,
            y: t.y as f32,
            z: t.z as f32,
        })
        .collect();
    for name in ["atan2", "pow", "fma"] {
        // What a fused operation does beyond its range is not said.
        let from = if name == "fma" {
            special.len().pow(2)
        } else {
            0
        };
        let (singles, threes) = (&singles[from..], &threes[from..]);
        let (mut scalars, mut lanes) = (vec![0.0_f32; threes.len()], vec![0.0_f32; threes.len()]);
        run(&entry(name), singles, &mut scalars, SCALARS);
        run(&entry(name), singles, &mut lanes, LANES);
        for ((of, a), b) in singles.iter().zip(&scalars).zip(&lanes) {
            assert!(same(*a, *b), "{name} of {of:?}: {a:e} and {b:e}");
        }
        let entry = entry(&format!("{name}_f64"));
        let (mut scalars, mut lanes) = (vec![0.0_f64; threes.len()], vec![0.0_f64; threes.len()]);
        run(&entry, threes, &mut scalars, SCALARS);
        run(&entry, threes, &mut lanes, LANES);
        for ((of, a), b) in threes.iter().zip(&scalars).zip(&lanes) {
            let same = a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
            assert!(same, "{name} of {of:?}: {a:e} and {b:e}");
        }
    }
}

/// IEEE 754's answers of both functions of two arguments, where the standard library has them.
#[test]
fn special_arguments_of_two() {
    let special = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        -0.5,
        2.0,
        -2.0,
        3.0,
        -3.0,
        1e-40,
        -1e-40,
        1e38,
        -1e38,
        f32::MAX,
        f32::MIN_POSITIVE,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        16_777_217.0,
    ];
    for two in &TWOS {
        for x in special {
            for y in special {
                let bits = u64::from(x.to_bits()) << 32 | u64::from(y.to_bits());
                let error = two.at(bits);
                assert!(error <= 1.0, "{} of {x:e} and {y:e}: {error}", two.name);
            }
        }
    }
}

/// The fused operation is the standard library's, in its range.
#[test]
fn fused_operations_round_once() {
    let mut checked = 0;
    for i in 0..1_000_000 {
        let number =
            |i: u64, close: u32| f32::from_bits((random(i) as u32 & 0x87ff_ffff) + (close << 23));
        let (a, b) = (number(3 * i, 120), number(3 * i + 1, 120));
        // Near the negative product every other time, where its error is what is left.
        let c = if i % 2 == 0 {
            -(a * b) * (1.0 + f32::EPSILON * (i % 16) as f32)
        } else {
            number(3 * i + 2, 119)
        };
        let (right, is) = (a.mul_add(b, c), math::fma(a, b, c));
        assert!(right == is, "{a:e} {b:e} {c:e}: {is:e}, not {right:e}");
        let (a, b, c) = (f64::from(a) / 3.0, f64::from(b) / 7.0, f64::from(c) / 21.0);
        let (right, is) = (a.mul_add(b, c), math::fma(a, b, c));
        assert!(right == is, "{a:e} {b:e} {c:e}: {is:e}, not {right:e}");
        checked += 1;
    }
    assert_eq!(checked, 1_000_000);
}

/// Results of `f64` in `data/elementary_f64.txt`: a function, two arguments, and the result in two
/// parts, each as its bits, computed with 400 to 2600 bits by mpmath.
#[test]
fn double_precision_is_within_an_ulp() {
    let text = include_str!("data/elementary_f64.txt");
    let mut worst: BTreeMap<&str, f64> = BTreeMap::new();
    for line in text.lines() {
        let (name, numbers) = line.split_once(' ').unwrap();
        let numbers: Vec<f64> = numbers
            .split(' ')
            .map(|bits| f64::from_bits(u64::from_str_radix(bits, 16).unwrap()))
            .collect();
        let [x, y, high, low] = numbers[..] else {
            panic!("{line}")
        };
        let mut result = [0.0_f64];
        let entry = entry(&format!("{name}_f64"));
        if ["atan2", "pow"].contains(&name) {
            run(&entry, &[Three { x, y, z: 0.0 }], &mut result, SCALARS);
        } else {
            run(&entry, &[x], &mut result, SCALARS);
        }
        let exponent = ((high.to_bits() >> 52) & 0x7ff) as i32 - 1023;
        let ulp = power_of_two((exponent - 52).max(-1022));
        let error = ((result[0] - high) - low).abs() / ulp;
        assert!(error <= 1.0, "{name} of {x:e}, {y:e}: {error} ulp");
        let all = worst.entry(name).or_insert(0.0);
        *all = all.max(error);
    }
    println!("{worst:?}");
    assert_eq!(worst.len(), ONES.len() - 1 + TWOS.len());
}

/// What a function costs natively: nanoseconds an argument, of the standard library's, of the
/// portable one, and of that in lanes. `cargo test --release -p hankel-dsl --test elementary --
/// --ignored cost --nocapture`
#[test]
#[ignore = "measures"]
fn cost() {
    let xs: Vec<f32> = (0..1 << 14)
        .map(|i| i as f32 / 16_384.0 * 0.98 + 0.01)
        .collect();
    let mut out = vec![0.0_f32; xs.len()];
    // The best of several runs.
    let time = |work: &mut dyn FnMut()| {
        let best = (0..40).map(|_| {
            let start = std::time::Instant::now();
            work();
            start.elapsed().as_secs_f64()
        });
        best.fold(f64::INFINITY, f64::min) * 1e9 / xs.len() as f64
    };
    type Named = (&'static str, fn(f32) -> f32);
    let library: [Named; 16] = [
        ("sin", f32::sin),
        ("cos", f32::cos),
        ("tan", f32::tan),
        ("asin", f32::asin),
        ("acos", f32::acos),
        ("atan", f32::atan),
        ("sinh", f32::sinh),
        ("cosh", f32::cosh),
        ("tanh", f32::tanh),
        ("exp", f32::exp),
        ("exp2", f32::exp2),
        ("exp_m1", f32::exp_m1),
        ("ln", f32::ln),
        ("log2", f32::log2),
        ("ln_1p", f32::ln_1p),
        ("cbrt", f32::cbrt),
    ];
    for (name, function) in library {
        let entry = entry(name);
        let std = time(&mut || {
            for (x, out) in xs.iter().zip(&mut out) {
                *out = function(std::hint::black_box(*x));
            }
        });
        let scalar = time(&mut || run(&entry, &xs, &mut out, SCALARS));
        let lanes = time(&mut || run(&entry, &xs, &mut out, LANES));
        println!("{name}: {std:.1} {scalar:.1} {lanes:.1}");
        assert!(out.iter().all(|x| x.is_finite()));
    }
}
