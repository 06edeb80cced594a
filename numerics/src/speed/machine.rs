//! What the machine could do at best: bytes and operations per second.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use fearless_simd::{Level, Simd, dispatch};
use hankel_dsl::math::Elementary;
use hankel_dsl::native::lanes::{Scalar, Work, level, levels, on_lanes};
use hankel_dsl::native::layout::Lane;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::count::Operations;
use crate::families::{Format, Precision};

/// A machine's limits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Threads that "all cores" means.
    pub threads: usize,
    /// Bytes of each array that bandwidth is measured with.
    pub array_bytes: usize,
    /// Of memory, on one thread and on all.
    pub bandwidth: [Bandwidth; 2],
    /// Of arithmetic, for each instruction set and precision.
    pub peaks: Vec<Peak>,
}

/// Memory bandwidth in bytes per second. As kernels are counted: what is read and what is written,
/// not what a processor fetches before it writes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bandwidth {
    /// `a = b`
    pub copy: f64,
    /// `a = b + s c`
    pub triad: f64,
}

impl Bandwidth {
    /// The greater one.
    #[must_use]
    pub fn best(&self) -> f64 {
        self.copy.max(self.triad)
    }
}

/// Operations per second, each on one number: an instruction on 16 lanes is 16.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Peak {
    /// The instruction set.
    pub level: String,
    /// The number format.
    pub precision: Precision,
    /// Numbers in a register.
    pub lanes: usize,
    /// Products and sums, as many of each, on one thread.
    pub simple: f64,
    /// The same on all threads together.
    pub simple_all: f64,
    /// Quotients, on one thread.
    pub divisions: f64,
    /// Square roots, on one thread.
    pub roots: f64,
}

impl Peak {
    /// How long these operations take on one thread at least: quotients and roots at their own rates.
    #[must_use]
    pub fn seconds(&self, operations: &Operations) -> f64 {
        operations.simple() / self.simple
            + operations.quotients / self.divisions
            + operations.roots / self.roots
    }
}

impl Limits {
    /// Measures them. `quick` takes a tenth of the time and smaller arrays.
    #[must_use]
    pub fn measure(quick: bool) -> Self {
        let array_bytes = array_bytes(quick);
        let seconds = if quick { 0.02 } else { 0.2 };
        let peaks = levels()
            .into_iter()
            .flat_map(|(name, level)| {
                [
                    peak::<f32>(name, level, seconds),
                    peak::<f64>(name, level, seconds),
                ]
            })
            .collect();
        Self {
            threads: rayon::current_num_threads(),
            array_bytes,
            bandwidth: bandwidth(array_bytes, if quick { 3 } else { 9 }),
            peaks,
        }
    }

    /// The peak of an instruction set.
    #[must_use]
    pub fn peak(&self, level: &str, precision: Precision) -> Option<&Peak> {
        self.peaks
            .iter()
            .find(|p| p.level == level && p.precision == precision)
    }
}

/// Four times the largest cache that the system tells of, at least 64 MiB; else 256 MiB. At most
/// 2 GiB.
fn array_bytes(quick: bool) -> usize {
    const MIB: usize = 1 << 20;
    if quick {
        return 64 * MIB;
    }
    let cache = (0..8)
        .filter_map(|i| {
            let path = format!("/sys/devices/system/cpu/cpu0/cache/index{i}/size");
            let text = std::fs::read_to_string(Path::new(&path)).ok()?;
            let (number, unit) = text.trim().split_at(text.trim().len().checked_sub(1)?);
            let number: usize = number.parse().ok()?;
            match unit {
                "K" => number.checked_mul(1 << 10),
                "M" => number.checked_mul(MIB),
                _ => None,
            }
        })
        .max();
    cache.map_or(256 * MIB, |bytes| {
        (bytes.saturating_mul(4)).clamp(64 * MIB, 2048 * MIB)
    })
}

/// What is done with a part of three arrays, of which the first is written.
type Pass<'a> = &'a (dyn Fn(&mut [f64], &[f64], &[f64]) + Sync);

/// The best of several runs, on one thread and on all.
fn bandwidth(array_bytes: usize, runs: usize) -> [Bandwidth; 2] {
    /// Numbers that a thread takes at once.
    const CHUNK: usize = 1 << 16;
    let count = array_bytes / size_of::<f64>();
    let (mut a, b, c) = (vec![0.0_f64; count], vec![1.0; count], vec![2.0; count]);
    let scale = black_box(3.0_f64);
    let best = level().unwrap_or_else(Level::baseline);
    let copy = |a: &mut [f64], b: &[f64], _: &[f64]| a.copy_from_slice(b);
    let triad = |a: &mut [f64], b: &[f64], c: &[f64]| {
        dispatch!(best, simd => sums(simd, a, b, c, scale));
    };
    let mut run = |all: bool, arrays: usize, f: Pass<'_>| {
        (0..=runs)
            .map(|_| {
                let start = Instant::now();
                if all {
                    a.par_chunks_mut(CHUNK)
                        .zip(b.par_chunks(CHUNK).zip(c.par_chunks(CHUNK)))
                        .for_each(|(a, (b, c))| f(a, b, c));
                } else {
                    f(&mut a, &b, &c);
                }
                black_box(&mut a);
                (arrays * array_bytes) as f64 / start.elapsed().as_secs_f64()
            })
            // The first touches the pages.
            .skip(1)
            .fold(0.0, f64::max)
    };
    [false, true].map(|all| Bandwidth {
        copy: run(all, 2, &copy),
        triad: run(all, 3, &triad),
    })
}

#[inline(always)]
fn sums<S: Simd>(_simd: S, a: &mut [f64], b: &[f64], c: &[f64], scale: f64) {
    for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
        *a = b + scale * c;
    }
}

/// What is repeated.
#[derive(Clone, Copy)]
enum Operation {
    Simple,
    Divide,
    Root,
}

/// Chains of operations that do not wait for each other: of products and of sums this many each, and each on the two
/// registers of a group of lanes. With two constants they fill sixteen registers, the fewest of any instruction set here;
/// the operations of one chain follow each other after 5 to 11 others, more than any has latency.
const CHAINS: usize = 3;

fn peak<T: Format + Scalar>(name: &str, level: Level, seconds: f64) -> Peak {
    let start: [T; 2 * CHAINS] = std::array::from_fn(|i| T::round(1.0 + i as f64 / 64.0));
    let run = |operation: Operation, rounds: u32| {
        let chains = Chains {
            operation,
            start: &start,
            rounds,
        };
        // `levels` has no other than those with lanes.
        on_lanes(level, chains).unwrap_or_default()
    };
    let lanes = run(Operation::Simple, 0);
    let rate = |operation: Operation| {
        let per_round = match operation {
            Operation::Simple => 2 * CHAINS,
            Operation::Divide | Operation::Root => CHAINS,
        };
        let rounds = rounds_for(seconds / 8.0, |rounds| {
            run(operation, rounds);
        });
        // The best of eight: whatever else runs on this machine only takes from it.
        let least = (0..8)
            .map(|_| {
                let start = Instant::now();
                run(operation, rounds);
                start.elapsed().as_secs_f64()
            })
            .fold(f64::INFINITY, f64::min);
        (
            (per_round * lanes) as f64 * f64::from(rounds) / least,
            rounds,
        )
    };
    let (simple, rounds) = rate(Operation::Simple);
    let all = (0..4)
        .map(|_| {
            let start = Instant::now();
            rayon::broadcast(|_| run(Operation::Simple, rounds));
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min);
    let operations = (2 * CHAINS * lanes * rayon::current_num_threads()) as f64;
    Peak {
        level: name.into(),
        precision: T::PRECISION,
        // A group of lanes is two registers.
        lanes: lanes / 2,
        simple,
        simple_all: operations * f64::from(rounds) / all,
        divisions: rate(Operation::Divide).0,
        roots: rate(Operation::Root).0,
    }
}

/// How many rounds take so long.
fn rounds_for(seconds: f64, run: impl Fn(u32)) -> u32 {
    let mut rounds = 64_u32;
    loop {
        let start = Instant::now();
        run(rounds);
        let taken = start.elapsed().as_secs_f64();
        if taken >= seconds || rounds > u32::MAX / 4 {
            return rounds;
        }
        rounds *= 2;
    }
}

/// Rounds of operations; gives the lanes of each.
struct Chains<'a, T> {
    operation: Operation,
    start: &'a [T; 2 * CHAINS],
    rounds: u32,
}

impl<T: Scalar + Format> Work for Chains<'_, T> {
    type Scalar = T;
    type Output = usize;

    #[inline(always)]
    fn run<L: Lane<Scalar = T> + Elementary>(self) -> usize {
        // What the compiler does not know to be 1 and 0.
        let (one, zero) = (
            L::splat(black_box(T::round(1.0))),
            L::splat(black_box(T::round(0.0))),
        );
        let mut x = [one; 2 * CHAINS];
        for (x, start) in x.iter_mut().zip(black_box(self.start)) {
            *x = L::splat(*start);
        }
        match self.operation {
            Operation::Simple => {
                for _ in 0..self.rounds {
                    for k in 0..CHAINS {
                        x[k] *= one;
                        x[CHAINS + k] += zero;
                    }
                }
            }
            Operation::Divide => {
                for _ in 0..self.rounds {
                    for x in x.iter_mut().take(CHAINS) {
                        *x = *x / one;
                    }
                }
            }
            Operation::Root => {
                for _ in 0..self.rounds {
                    for x in x.iter_mut().take(CHAINS) {
                        *x = x.sqrt();
                    }
                }
            }
        }
        let mut sum = x[0];
        for x in &x[1..] {
            sum += *x;
        }
        black_box(sum);
        L::LANES
    }
}
