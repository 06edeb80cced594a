//! What SIMD lanes gain, and how far they are from what memory allows: each map in nanoseconds per
//! row, scalar, with every instruction set that the processor has, and on all cores; and the bytes
//! that it reads and writes in that time, beside a plain copy that reads and writes as many. Once
//! for rows that stay in a cache, once for rows that do not, unless arithmetic takes so long that
//! memory hardly matters.
//!
//! Each figure is the fastest of several rounds: whatever else the machine does only adds. Scalar,
//! lanes and copy take turns in one process, so that it disturbs all alike. Arguments are parts of names: `cargo bench -p hankel-shadows --bench lanes -- vsm`.

use std::process::Command;
use std::time::{Duration, Instant};

use hankel_dsl::bytemuck::{cast_slice, cast_slice_mut};
use hankel_dsl::native::describe::{Output, Role};
use hankel_dsl::native::lanes::{level_name, levels};
use hankel_dsl::native::{Arg, Call, Entry, Mode};

/// Rows of up to 128 bytes that a second-level cache holds.
const CACHED: usize = 1 << 12;
/// Rows that no cache holds.
const STREAMED: usize = 1 << 21;
/// Nanoseconds of scalar arithmetic per row from which on memory hardly matters.
const SLOW: f64 = 20.0;
/// What a line's measurements take at least, and the rounds that they take at least.
const SPENT: Duration = Duration::from_millis(300);
const ROUNDS: usize = 15;
/// Names the one level that a child process measures.
const CHILD: &str = "HANKEL_BENCH_CHILD";

fn main() {
    // cargo passes `--bench`, which does not matter here.
    let parts: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .collect();
    if std::env::var_os(CHILD).is_some() {
        return measure(&parts);
    }
    println!(
        "{:<26} {:<9} {:>8} {:>10} {:>9} {:>6} {:>10} {:>7} {:>9} {:>5}",
        "kernel",
        "lanes",
        "rows",
        "scalar ns",
        "lanes ns",
        "ratio",
        "cores ns",
        "GB/s",
        "copy GB/s",
        "part"
    );
    let me = std::env::current_exe().expect("the benchmark has a path");
    for (name, _) in levels() {
        let status = Command::new(&me)
            .args(&parts)
            .env(CHILD, "1")
            .env("HANKEL_SIMD", name)
            .status();
        assert!(
            status.is_ok_and(|s| s.success()),
            "the measurement with {name} failed"
        );
    }
}

fn measure(parts: &[String]) {
    for entry in hankel_shadows::entries().iter().filter(|e| {
        e.kernel.precision.is_some()
            && (parts.is_empty() || parts.iter().any(|p| e.kernel.name.contains(p)))
    }) {
        for rows in [CACHED, STREAMED] {
            let t = times(entry, rows);
            let moved = |ns: f64| t.bytes / ns;
            println!(
                "{:<26} {:<9} {rows:>8} {:>10.2} {:>9.2} {:>6.1} {:>10.2} {:>7.1} {:>9.1} {:>4.0}%",
                entry.kernel.name,
                level_name(),
                t.scalar,
                t.lanes,
                t.scalar / t.lanes,
                t.cores,
                moved(t.lanes),
                moved(t.copy),
                100.0 * t.copy / t.lanes,
            );
            if t.scalar > SLOW {
                break;
            }
        }
    }
}

/// Moments of two or three surfaces and a receiver, as many numbers as an element has.
fn numbers(per_element: usize) -> Vec<f64> {
    let mut state = 1_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    let mut all = Vec::with_capacity(CACHED * per_element);
    for _ in 0..CACHED {
        let (a, b, c, share) = (random(), random(), random(), random());
        let moment =
            |n: i32| 0.5 * a.powi(n) + 0.5 * (share * b.powi(n) + (1.0 - share) * c.powi(n));
        let receiver = random();
        let mut row: Vec<f64> = (1..per_element as i32).map(moment).collect();
        row.push(receiver);
        all.extend(row);
    }
    all
}

/// Nanoseconds per row.
struct Times {
    scalar: f64,
    lanes: f64,
    /// Lanes, on all cores.
    cores: f64,
    /// A copy of half as many bytes as a row moves: it reads and writes them.
    copy: f64,
    /// What a row reads and writes.
    bytes: f64,
}

fn times(entry: &Entry, rows: usize) -> Times {
    let size = if entry.kernel.name.ends_with("_f64") {
        8
    } else {
        4
    };
    let (mut uniform, mut uniform_size, mut row_in) = (Vec::new(), None, 0);
    let mut once = Vec::new();
    for param in &entry.kernel.params {
        match &param.role {
            Role::Uniform { layout, .. } => {
                uniform = vec![0_u128; layout.size as usize / 16 + 1];
                uniform_size = Some(layout.size as usize);
            }
            Role::Element { layout, .. } => {
                row_in = layout.size as usize;
                let values = numbers(row_in / size);
                once = if size == 8 {
                    values.iter().flat_map(|x| x.to_ne_bytes()).collect()
                } else {
                    values
                        .iter()
                        .flat_map(|x| (*x as f32).to_ne_bytes())
                        .collect()
                };
            }
            _ => {}
        }
    }
    let Some(Output::Buffer { layout, .. }) = entry.kernel.outputs.first() else {
        unreachable!("a map over buffers writes a buffer")
    };
    let (bytes_in, bytes_out) = (rows * row_in, rows * layout.size as usize);
    // 16 bytes of alignment fit every element. Both are long enough for the copy.
    let half = (bytes_in + bytes_out) / 2;
    let mut input = vec![0_u128; bytes_in.max(half).div_ceil(16)];
    for (to, from) in cast_slice_mut::<_, u8>(&mut input)
        .iter_mut()
        .zip(once.iter().cycle())
    {
        *to = *from;
    }
    let mut output = vec![0_u128; bytes_out.max(half).div_ceil(16)];
    let mut copied = vec![0_u128; half.div_ceil(16)];
    let modes = [(false, false), (true, false), (true, true)];
    let mut taken = [const { Vec::new() }; 4];
    let begin = Instant::now();
    while begin.elapsed() < SPENT || taken[0].len() < ROUNDS {
        for ((lanes, parallel), times) in modes.into_iter().zip(&mut taken) {
            let mut args = Vec::new();
            if let Some(size) = uniform_size {
                args.push(Arg::Bytes(&cast_slice(&uniform)[..size]));
            }
            args.push(Arg::Bytes(&cast_slice(&input)[..bytes_in]));
            args.push(Arg::BytesMut(&mut cast_slice_mut(&mut output)[..bytes_out]));
            let mut call = Call {
                args,
                constants: Vec::new(),
                mode: Mode {
                    lanes,
                    parallel,
                    ..Mode::REFERENCE
                },
            };
            let start = Instant::now();
            (entry.run)(&mut call).expect("the arguments fit");
            times.push(start.elapsed());
        }
        let start = Instant::now();
        cast_slice_mut::<_, u8>(&mut copied)[..half]
            .copy_from_slice(&cast_slice::<_, u8>(&input)[..half]);
        std::hint::black_box(&mut copied);
        taken[3].push(start.elapsed());
    }
    let [scalar, lanes, cores, copy] =
        taken.map(|v| v.into_iter().min().unwrap_or_default().as_nanos() as f64 / rows as f64);
    Times {
        scalar,
        lanes,
        cores,
        copy,
        bytes: (row_in + layout.size as usize) as f64,
    }
}
