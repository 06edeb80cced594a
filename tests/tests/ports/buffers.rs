//! Ports that read and write buffers.

use hankel_dsl::bytemuck::bytes_of;
use hankel_dsl::glam::UVec2;
use hankel_dsl::native::inputs::Source;
use hankel_example_ports::matrix::Shape;
use hankel_example_ports::particles::{Particle, Step};
use hankel_host::device::{Bind, BufferId};

use crate::run::{Port, Prepared, Runner, Scale};

pub const MATRIX: Port = Port {
    file: "matrix",
    what: "tiled product of two matrices",
    kernels: &["matrix_product"],
    prepare: |runner, scale| {
        let (rows, inner, columns) = match scale {
            Scale::Small => (37, 50, 61),
            Scale::Large => (256, 256, 256),
        };
        let mut chance = Source::new(1);
        let mut numbers =
            |n: u32| -> Vec<f32> { (0..n).map(|_| chance.between(-1.0, 1.0) as f32).collect() };
        let (a, b) = (numbers(rows * inner), numbers(inner * columns));
        let shape = Shape {
            size: UVec2::new(columns, rows),
            inner,
            padding: 0,
        };
        let (left, right) = (runner.buffer(&a), runner.buffer(&b));
        let out = runner.zeros((rows * columns * 4) as usize);
        Prepared {
            work: Box::new(move |runner| {
                runner.dispatch(
                    "matrix_product",
                    &[
                        Bind::Bytes(bytes_of(&shape)),
                        Bind::Buffer(left),
                        Bind::Buffer(right),
                        Bind::Buffer(out),
                    ],
                );
            }),
            check: Box::new(move |runner| {
                let product: Vec<f32> = runner.read(out);
                for row in 0..rows {
                    for column in 0..columns {
                        let terms = (0..inner).map(|k| {
                            f64::from(a[(row * inner + k) as usize])
                                * f64::from(b[(k * columns + column) as usize])
                        });
                        let (sum, size) =
                            terms.fold((0.0, 0.0), |(sum, size), x| (sum + x, size + f64::abs(x)));
                        // The error of a sum of so many products (Higham 2002, section 3.1).
                        let most = size * f64::from(inner) * f64::from(f32::EPSILON) * 0.5;
                        let is = f64::from(product[(row * columns + column) as usize]);
                        assert!(
                            (is - sum).abs() <= most,
                            "({row}, {column}): {is}, not {sum}"
                        );
                    }
                }
            }),
        }
    },
};

/// Exclusive prefix sums of `numbers`, in place.
struct Scan {
    levels: Vec<(BufferId, BufferId)>,
}

impl Scan {
    fn new(runner: &mut Runner<'_>, numbers: u32) -> Self {
        let mut levels = Vec::new();
        let mut n = numbers;
        loop {
            let blocks = n.div_ceil(256);
            let (sums, totals) = (
                runner.zeros(n as usize * 4),
                runner.zeros(blocks as usize * 4),
            );
            levels.push((sums, totals));
            if blocks == 1 {
                return Self { levels };
            }
            n = blocks;
        }
    }

    /// Gives where the sums are.
    fn run(&self, runner: &mut Runner<'_>, numbers: BufferId) -> BufferId {
        let mut from = numbers;
        for (sums, totals) in &self.levels {
            runner.dispatch("scan_blocks", &[from, *totals, *sums].map(Bind::Buffer));
            from = *totals;
        }
        for pair in self.levels.windows(2).rev() {
            runner.dispatch("scan_add", &[pair[0].0, pair[1].0].map(Bind::Buffer));
        }
        self.levels[0].0
    }
}

pub const SORT: Port = Port {
    file: "sort",
    what: "prefix sums and stable radix sort of keys with values",
    kernels: &["scan_blocks", "scan_add", "sort_count", "sort_scatter"],
    prepare: |runner, scale| {
        let n = scale.of(20_001, 1 << 17);
        let mut chance = Source::new(2);
        // Some keys are equal.
        let keys: Vec<u32> = (0..n).map(|_| chance.bits() as u32 & 0xff00_0fff).collect();
        let values: Vec<u32> = (0..n).collect();
        let given = (runner.buffer(&keys), runner.buffer(&values));
        let bytes = n as usize * 4;
        let pairs = [0, 1].map(|_| (runner.zeros(bytes), runner.zeros(bytes)));
        let counts = 16 * n.div_ceil(256);
        let counted = runner.zeros(counts as usize * 4);
        let scan = Scan::new(runner, counts);
        Prepared {
            work: Box::new(move |runner| {
                let mut from = given;
                for pass in 0..8_u32 {
                    let shift = (pass * 4).to_le_bytes();
                    let digit = Bind::Bytes(&shift);
                    let to = pairs[pass as usize % 2];
                    let args = [digit, Bind::Buffer(from.0), Bind::Buffer(counted)];
                    runner.dispatch("sort_count", &args);
                    let offsets = scan.run(runner, counted);
                    let [a, b, c, d, e] = [from.0, from.1, offsets, to.0, to.1].map(Bind::Buffer);
                    runner.dispatch("sort_scatter", &[digit, a, b, c, d, e]);
                    from = to;
                }
            }),
            check: Box::new(move |runner| {
                let (sorted, moved): (Vec<u32>, Vec<u32>) =
                    (runner.read(pairs[1].0), runner.read(pairs[1].1));
                let mut expected: Vec<(u32, u32)> = keys.iter().copied().zip(0..).collect();
                expected.sort_by_key(|(key, _)| *key);
                let is: Vec<(u32, u32)> = sorted.into_iter().zip(moved).collect();
                assert_eq!(is, expected);
            }),
        }
    },
};

pub const HISTOGRAM: Port = Port {
    file: "histogram",
    what: "histogram through counters in workgroup memory",
    kernels: &["histogram"],
    prepare: |runner, scale| {
        let n = scale.of(30_000, 1 << 20);
        let mut chance = Source::new(3);
        let numbers: Vec<f32> = (0..n)
            .map(|_| (0.5 + 0.3 * chance.normal()) as f32)
            .collect();
        let given = runner.buffer(&numbers);
        let counts = runner.zeros(256 * 4);
        Prepared {
            work: Box::new(move |runner| {
                runner.clear(counts);
                runner.dispatch("histogram", &[given, counts].map(Bind::Buffer));
            }),
            check: Box::new(move |runner| {
                let mut expected = [0_u32; 256];
                for x in &numbers {
                    let bin = (f64::from(*x) * 256.0).floor().clamp(0.0, 255.0);
                    expected[bin as usize] += 1;
                }
                assert_eq!(runner.read::<u32>(counts), expected);
            }),
        }
    },
};

pub const COMPACTION: Port = Port {
    file: "compaction",
    what: "elements above a threshold, without gaps",
    kernels: &["compact_above"],
    prepare: |runner, scale| {
        let n = scale.of(30_000, 1 << 19);
        let mut chance = Source::new(4);
        let numbers: Vec<f32> = (0..n).map(|_| chance.between(-1.0, 1.0) as f32).collect();
        let given = runner.buffer(&numbers);
        let (count, kept) = (runner.zeros(4), runner.zeros(n as usize * 4));
        Prepared {
            work: Box::new(move |runner| {
                let threshold = 0.25_f32.to_le_bytes();
                runner.clear(count);
                let [a, b, c] = [given, count, kept].map(Bind::Buffer);
                runner.dispatch("compact_above", &[Bind::Bytes(&threshold), a, b, c]);
            }),
            check: Box::new(move |runner| {
                let found = runner.read::<u32>(count)[0] as usize;
                let mut is: Vec<f32> = runner.read(kept);
                is.truncate(found);
                is.sort_by(f32::total_cmp);
                let mut expected: Vec<f32> =
                    numbers.iter().copied().filter(|x| *x > 0.25).collect();
                expected.sort_by(f32::total_cmp);
                assert_eq!(is, expected);
            }),
        }
    },
};

pub const PARTICLES: Port = Port {
    file: "particles",
    what: "particles that are moved in place",
    kernels: &["particles_step"],
    prepare: |runner, scale| {
        let n = scale.of(1000, 1 << 18);
        let steps = scale.of(50, 4);
        let mut chance = Source::new(5);
        let mut number = |low, high| chance.between(low, high) as f32;
        let particles: Vec<Particle> = (0..n)
            .map(|i| {
                // The first half flies free, others come to the ground, or to their end.
                let height = if i < n / 2 { 30.0 } else { 0.2 };
                let life = if i % 4 == 3 { 0.3 } else { 4.0 };
                Particle {
                    place: [number(-1.0, 1.0), height, number(-1.0, 1.0), life].into(),
                    velocity: [number(-2.0, 2.0), number(-3.0, 3.0), number(-2.0, 2.0), 7.0].into(),
                }
            })
            .collect();
        let step = Step {
            gravity: -9.81,
            drag: 0.0,
            bounce: 0.6,
            time: 0.01,
            life: 4.0,
            number: 11,
        };
        let there = runner.buffer(&particles);
        Prepared {
            work: Box::new(move |runner| {
                for i in 0..steps {
                    let step = Step { number: i, ..step };
                    let args = [Bind::Bytes(bytes_of(&step)), Bind::Buffer(there)];
                    runner.dispatch("particles_step", &args);
                }
            }),
            check: Box::new(move |runner| {
                let moved: Vec<Particle> = runner.read(there);
                let (time, gravity, k) = (0.01_f64, -9.81_f64, f64::from(steps));
                let (mut free, mut bounced, mut born) = (0, 0, 0);
                for (i, (before, after)) in particles.iter().zip(&moved).enumerate() {
                    if before.place.w < 0.5 {
                        // 0.3 s are over: it started anew, less than 0.25 s ago.
                        born += 1;
                        assert!(
                            after.place.w > 3.74 && after.place.w < 4.0,
                            "{i}: {after:?}"
                        );
                        assert!(
                            after.place.y >= 0.0 && after.place.y < 1.5,
                            "{i}: {after:?}"
                        );
                        continue;
                    }
                    assert_eq!(after.velocity.w, 7.0);
                    let fallen = |y: f64, v: f64| {
                        y + k * time * v + gravity * time * time * k * (k + 1.0) / 2.0
                    };
                    let (y, v) = (f64::from(before.place.y), f64::from(before.velocity.y));
                    if i < (n / 2) as usize {
                        // The closed form of the sums of semi-implicit Euler.
                        free += 1;
                        let expected = fallen(y, v);
                        assert!(
                            (f64::from(after.place.y) - expected).abs() < 1e-4,
                            "{i}: {after:?}, not {expected}"
                        );
                        let x = f64::from(before.place.x) + k * time * f64::from(before.velocity.x);
                        assert!(
                            (f64::from(after.place.x) - x).abs() < 1e-5,
                            "{i}: {after:?}, not {x}"
                        );
                    } else if fallen(y, v) < -0.1 {
                        bounced += 1;
                        let energy = |p: &Particle| {
                            0.5 * p.velocity.truncate().length_squared() + 9.81 * p.place.y
                        };
                        assert!(after.place.y >= 0.0, "{i}: {after:?}");
                        assert!(energy(after) < energy(before), "{i}: {after:?}");
                    }
                }
                assert!(
                    free > 100 && bounced > 50 && born > 100,
                    "{free} {bounced} {born}"
                );
            }),
        }
    },
};
