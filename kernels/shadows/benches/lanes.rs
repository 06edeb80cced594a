//! What SIMD lanes gain: each map in nanoseconds per element on one thread, scalar and with every
//! instruction set that the processor has. Medians; scalar and lanes take turns in one process, so
//! that a noisy machine disturbs both alike.

use std::process::Command;
use std::time::Instant;

use hankel_dsl::bytemuck::{cast_slice, cast_slice_mut};
use hankel_dsl::native::describe::{Output, Role};
use hankel_dsl::native::lanes::levels;
use hankel_dsl::native::{Arg, Call, Entry, Mode};

const ELEMENTS: usize = 1 << 15;
const ROUNDS: usize = 101;
/// Names the one level that a child process measures.
const CHILD: &str = "HANKEL_BENCH_CHILD";

fn main() {
    // cargo passes `--bench`, and test runs pass filters: neither matters here.
    if std::env::var_os(CHILD).is_some() {
        return measure();
    }
    println!(
        "{:<26} {:<9} {:>10} {:>10} {:>7}",
        "kernel", "lanes", "scalar ns", "lanes ns", "ratio"
    );
    let me = std::env::current_exe().expect("the benchmark has a path");
    for (name, _) in levels() {
        let status = Command::new(&me)
            .env(CHILD, "1")
            .env("HANKEL_SIMD", name)
            .status();
        assert!(
            status.is_ok_and(|s| s.success()),
            "the measurement with {name} failed"
        );
    }
}

fn measure() {
    for entry in hankel_shadows::entries()
        .iter()
        .filter(|e| e.kernel.precision.is_some())
    {
        let (scalar, lanes) = times(entry);
        println!(
            "{:<26} {:<9} {scalar:>10.2} {lanes:>10.2} {:>7.1}",
            entry.kernel.name,
            hankel_dsl::native::lanes::level_name(),
            scalar / lanes
        );
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
    let mut all = Vec::with_capacity(ELEMENTS * per_element);
    for _ in 0..ELEMENTS {
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

/// Median nanoseconds per element, scalar and on lanes.
fn times(entry: &Entry) -> (f64, f64) {
    let size = if entry.kernel.name.ends_with("_f64") {
        8
    } else {
        4
    };
    let (mut uniform, mut elements) = (None, Vec::new());
    for param in &entry.kernel.params {
        match &param.role {
            Role::Uniform { layout, .. } => {
                uniform = Some(vec![0_u128; layout.size as usize / 16 + 1])
            }
            Role::Element { layout, .. } => {
                let values = numbers(layout.size as usize / size);
                elements = if size == 8 {
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
    // 16 bytes of alignment fit every element.
    let mut input = vec![0_u128; elements.len().div_ceil(16)];
    cast_slice_mut::<_, u8>(&mut input)[..elements.len()].copy_from_slice(&elements);
    let mut output = vec![0_u128; (ELEMENTS * layout.size as usize).div_ceil(16)];
    let mut taken = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        for lanes in [false, true] {
            let mut args = Vec::new();
            if let Some(uniform) = &uniform {
                let bytes = entry.kernel.params.iter().find_map(|p| match &p.role {
                    Role::Uniform { layout, .. } => Some(layout.size as usize),
                    _ => None,
                });
                args.push(Arg::Bytes(&cast_slice(uniform)[..bytes.unwrap_or(0)]));
            }
            args.push(Arg::Bytes(&cast_slice(&input)[..elements.len()]));
            let bytes = ELEMENTS * layout.size as usize;
            args.push(Arg::BytesMut(&mut cast_slice_mut(&mut output)[..bytes]));
            let mut call = Call {
                args,
                constants: Vec::new(),
                mode: Mode {
                    lanes,
                    parallel: false,
                },
            };
            let start = Instant::now();
            (entry.run)(&mut call).expect("the arguments fit");
            taken[usize::from(lanes)].push(start.elapsed().as_nanos() as f64 / ELEMENTS as f64);
        }
    }
    let median = |mut v: Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v[v.len() / 2]
    };
    let [scalar, lanes] = taken;
    (median(scalar), median(lanes))
}
