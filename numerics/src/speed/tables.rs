//! The figures as a report.

use hankel_dsl::native::lanes::levels;

use super::count::TOGETHER;
use super::errors::ERROR_FAMILIES;
use super::{ErrorOf, Solver, Speed, Timing, Work};
use crate::families::Precision;
use crate::report::{Axis, Cell, Column, Plot, Point, Report, Series, Style, Table, pareto_front};

impl Speed {
    /// Tables and plots of everything; `command` is what made it.
    #[must_use]
    pub fn report(&self, command: &str) -> Report {
        let mut report = Report::new("Moment bounds: speed and error", command);
        report.fact("processor", &self.processor);
        report.fact("instruction set of the lanes", &self.level);
        report.fact("threads for all cores", self.limits.threads);
        report.fact("rows of a call", self.rows);
        report.fact("rounds", self.rounds);
        report.fact("seed", self.seed);
        report.fact("times", "one thread: processor time; all cores: wall time");
        match &self.peer {
            Some(peer) => report.fact("beside", peer),
            None => report.notes.push(
                "diffmoments was not measured: ask for it with `--against diffmoments`".into(),
            ),
        }
        let speedups = self.speedups();
        report.tables.extend([
            self.times(),
            self.calls(),
            self.fronts(),
            self.against_limits(),
            self.limits_of_machine(),
            self.error_table(),
        ]);
        if !speedups.rows.is_empty() {
            report.tables.insert(0, speedups);
        }
        for family in ERROR_FAMILIES {
            report.plots.push(self.pareto(family));
        }
        report.plots.push(self.times_by_order());
        report
    }

    /// Median nanoseconds for a row.
    #[must_use]
    pub fn time(
        &self,
        solver: Solver,
        n: usize,
        precision: Precision,
        path: &str,
        threads: usize,
    ) -> Option<f64> {
        self.timings
            .iter()
            .find(|t| {
                (t.solver, t.n, t.precision, t.threads) == (solver, n, precision, threads)
                    && t.path == path
            })
            .map(Timing::median)
    }

    fn orders(&self) -> Vec<usize> {
        let mut orders: Vec<usize> = self.timings.iter().map(|t| t.n).collect();
        orders.sort_unstable();
        orders.dedup();
        orders
    }

    /// How much faster than `diffmoments`.
    fn speedups(&self) -> Table {
        let mut table = Table::new(
            "against-diffmoments",
            format!(
                "Against diffmoments, one thread each: medians over {} rounds of turns on the \
                 same {} rows, nanoseconds for a row. Its derivatives can start from roots that \
                 were retained when the bound was computed, which takes that bound's time before; \
                 everything else starts from the moments.",
                self.rounds, self.rows
            ),
            [
                Column::text("what"),
                Column::count("n"),
                Column::text("precision"),
                Column::fixed("diffmoments", 1).of("ns"),
                Column::fixed("roots retained", 1).of("ns"),
                Column::fixed("lanes", 2).of("ns"),
                Column::fixed("times faster", 1),
                Column::fixed("than retained", 1),
                Column::fixed("all cores", 2).of("ns"),
                Column::fixed("times faster on all", 1),
            ],
        );
        for (own, [plain, retained]) in [
            (Solver::Plain, [Solver::Peer, Solver::PeerRetained]),
            (Solver::Compensated, [Solver::Peer, Solver::PeerRetained]),
            (
                Solver::Adjoint,
                [Solver::PeerAdjoint, Solver::PeerAdjointRetained],
            ),
            (
                Solver::CompensatedAdjoint,
                [Solver::PeerAdjoint, Solver::PeerAdjointRetained],
            ),
        ] {
            for precision in [Precision::F32, Precision::F64] {
                for n in self.orders() {
                    let peer = |solver| self.time(solver, n, precision, "library", 1);
                    let lanes = |threads| self.time(own, n, precision, &self.level, threads);
                    let all = match self.limits.threads {
                        1 => None,
                        threads => lanes(threads),
                    };
                    let (Some(plain), Some(one)) = (peer(plain), lanes(1)) else {
                        continue;
                    };
                    let retained = peer(retained);
                    table.push([
                        own.name().into(),
                        n.into(),
                        precision.to_string().into(),
                        plain.into(),
                        retained.into(),
                        one.into(),
                        (plain / one).into(),
                        retained.map(|retained| retained / one).into(),
                        all.into(),
                        all.map(|all| plain / all).into(),
                    ]);
                }
            }
        }
        table
    }

    /// A row for each solver, order and precision, a column for each way to run it.
    fn times(&self) -> Table {
        let own = || self.timings.iter().filter(|t| !t.solver.is_peer());
        let mut ways: Vec<(&str, usize)> = Vec::new();
        for t in own() {
            let way = (t.path.as_str(), t.threads);
            if !ways.contains(&way) {
                ways.push(way);
            }
        }
        // From the plainest to the fastest.
        let narrow_first: Vec<&str> = levels().iter().rev().map(|(name, _)| *name).collect();
        ways.sort_by_key(|(path, threads)| {
            let place = match *path {
                "scalar" => 0,
                path => 1 + narrow_first.iter().position(|n| *n == path).unwrap_or(0),
            };
            (place, *threads)
        });
        let columns = ways.iter().map(|(path, threads)| {
            let name = match threads {
                1 => (*path).to_owned(),
                n => format!("{path}, {n} threads"),
            };
            Column::fixed(name, 2).of("ns")
        });
        let mut table = Table::new(
            "times",
            format!(
                "Median run time for one row by instruction set, everything in turns: calls on {} \
                 rows, {} rounds. One thread where none are named.",
                self.rows, self.rounds
            ),
            [
                Column::text("what"),
                Column::count("n"),
                Column::text("precision"),
            ]
            .into_iter()
            .chain(columns),
        );
        let mut seen = Vec::new();
        for t in own() {
            let what = (t.solver, t.n, t.precision);
            if seen.contains(&what) {
                continue;
            }
            seen.push(what);
            let head: [Cell; 3] = [
                t.solver.name().into(),
                t.n.into(),
                t.precision.to_string().into(),
            ];
            let times = ways.iter().map(|(path, threads)| {
                self.time(t.solver, t.n, t.precision, path, *threads).into()
            });
            table.push(head.into_iter().chain(times));
        }
        table
    }

    /// The same, a row for each way.
    fn calls(&self) -> Table {
        let mut table = Table::new(
            "calls",
            format!(
                "Run times for one row, everything in turns: calls on {} rows, {} rounds",
                self.rows, self.rounds
            ),
            [
                Column::text("what"),
                Column::count("n"),
                Column::text("precision"),
                Column::text("path"),
                Column::count("threads"),
                Column::fixed("median", 2).of("ns"),
                Column::fixed("least", 2).of("ns"),
                Column::count("calls"),
            ],
        )
        .detail();
        for t in &self.timings {
            table.push([
                t.solver.name().into(),
                t.n.into(),
                t.precision.to_string().into(),
                t.path.as_str().into(),
                t.threads.into(),
                t.median().into(),
                t.least().into(),
                t.times.len().into(),
            ]);
        }
        table
    }

    /// What memory and arithmetic would allow, in nanoseconds for a row, on one thread.
    #[must_use]
    pub fn least_possible(&self, work: &Work) -> Option<(f64, f64)> {
        let peak = self.limits.peak(&self.level, work.precision)?;
        let memory = work.bytes as f64 / self.limits.bandwidth[0].best();
        Some((memory * 1e9, peak.seconds(&work.operations) * 1e9))
    }

    fn against_limits(&self) -> Table {
        let mut table = Table::new(
            "limits",
            format!(
                "How near kernels come to the machine's limits, on one thread with {}: bytes over \
                 bandwidth, and operations over peaks (quotients and roots over their own). \
                 Operations are those of the kernel's source that a result depends on, as {TOGETHER} \
                 rows run together: a loop goes on until the last is done; `needed` is the arithmetic of \
                 rows that run alone, as a share of that. `reached` is the greater limit's share of the \
                 time measured; above 100 % where quotients are computed beside other arithmetic, which \
                 the limit adds up. All is counted in f32: in f64, loops for roots may take more turns.",
                self.level
            ),
            [
                Column::text("what"),
                Column::count("n"),
                Column::text("precision"),
                Column::count("bytes"),
                Column::fixed("sums", 0),
                Column::fixed("products", 0),
                Column::fixed("fused", 0),
                Column::fixed("quotients", 0),
                Column::fixed("roots", 0),
                Column::fixed("comparisons", 0),
                Column::fixed("selections", 0),
                Column::fixed("others", 0),
                Column::percent("needed", 0),
                Column::fixed("memory", 2).of("ns"),
                Column::fixed("arithmetic", 2).of("ns"),
                Column::fixed("measured", 2).of("ns"),
                Column::percent("reached", 0),
                Column::text("bound by"),
                Column::percent("of peak flops", 0),
            ],
        );
        for work in &self.work {
            let Some((memory, arithmetic)) = self.least_possible(work) else {
                continue;
            };
            let measured = self.time(work.solver, work.n, work.precision, &self.level, 1);
            let peak = self.limits.peak(&self.level, work.precision);
            let flops = measured
                .zip(peak)
                .map(|(ns, peak)| work.operations.flops() / (ns * 1e-9) / peak.simple);
            let needed =
                peak.map(|peak| peak.seconds(&work.needed) / peak.seconds(&work.operations));
            let o = &work.operations;
            table.push([
                work.solver.name().into(),
                work.n.into(),
                work.precision.to_string().into(),
                work.bytes.into(),
                o.sums.into(),
                o.products.into(),
                o.fused.into(),
                o.quotients.into(),
                o.roots.into(),
                o.comparisons.into(),
                o.selections.into(),
                o.others.into(),
                needed.into(),
                memory.into(),
                arithmetic.into(),
                measured.into(),
                measured.map(|ns| memory.max(arithmetic) / ns).into(),
                if memory > arithmetic {
                    "memory"
                } else {
                    "arithmetic"
                }
                .into(),
                flops.into(),
            ]);
        }
        table
    }

    fn limits_of_machine(&self) -> Table {
        let mut table = Table::new(
            "machine",
            format!(
                "What the machine does at best, in 10^9 per second: bytes to and from memory \
                 (arrays of {} MiB, best run), and operations on numbers in registers \
                 (independent chains, as many products as sums; best run)",
                self.limits.array_bytes >> 20
            ),
            [
                Column::text("limit"),
                Column::text("precision"),
                Column::fixed("one thread", 1),
                Column::fixed("all cores", 1),
            ],
        );
        let [one, all] = &self.limits.bandwidth;
        for (name, one, all) in [
            ("memory, copy [bytes]", one.copy, all.copy),
            ("memory, triad [bytes]", one.triad, all.triad),
        ] {
            table.push([
                name.into(),
                Cell::Empty,
                (one * 1e-9).into(),
                (all * 1e-9).into(),
            ]);
        }
        for peak in &self.limits.peaks {
            for (name, one, all) in [
                ("sums and products", peak.simple, Some(peak.simple_all)),
                ("quotients", peak.divisions, None),
                ("square roots", peak.roots, None),
            ] {
                table.push([
                    format!("{}, {name}", peak.level).into(),
                    peak.precision.to_string().into(),
                    (one * 1e-9).into(),
                    all.map(|all| all * 1e-9).into(),
                ]);
            }
        }
        table
    }

    fn error_table(&self) -> Table {
        let mut table = Table::new(
            "errors",
            format!(
                "Errors of lower bounds as shares of the total, against the same source in \
                 double-double, over up to {} rows of a family; results that are not finite \
                 count as 1. Diffmoments computes the same bounds whether it retains roots or not.",
                self.error_rows
            ),
            [
                Column::text("family"),
                Column::text("what"),
                Column::count("n"),
                Column::text("precision"),
                Column::count("rows"),
                Column::count("not finite"),
                Column::number("50 %"),
                Column::number("90 %"),
                Column::number("99 %"),
                Column::number("greatest"),
            ],
        );
        for e in &self.errors {
            table.push([
                e.family.as_str().into(),
                e.solver.name().into(),
                e.n.into(),
                e.precision.to_string().into(),
                e.rows.into(),
                e.not_finite.into(),
                e.quantiles.median.into(),
                e.quantiles.ninety.into(),
                e.quantiles.ninety_nine.into(),
                e.quantiles.greatest.into(),
            ]);
        }
        table
    }

    /// Every variant with an error and a time on one thread: its name, its time, its error.
    fn variants<'a>(
        &'a self,
        family: &'a str,
    ) -> impl Iterator<Item = (&'a ErrorOf, &'a Timing, f64, f64)> {
        self.errors
            .iter()
            .filter(move |e| e.family == family)
            .flat_map(|e| {
                self.timings
                    .iter()
                    .filter(|t| {
                        (t.solver, t.n, t.precision) == (e.solver, e.n, e.precision)
                            && t.threads == 1
                    })
                    .map(move |t| (e, t, t.median(), e.quantiles.ninety))
            })
    }

    /// What no other variant of the same order beats in both run time and error; the orders one
    /// after the other. Between orders there is nothing to compare: a larger one gives a tighter
    /// bound.
    fn fronts_of<'a>(&'a self, family: &'a str) -> Vec<Vec<(&'a ErrorOf, &'a Timing, f64, f64)>> {
        let all: Vec<_> = self.variants(family).collect();
        self.orders()
            .into_iter()
            .map(|n| {
                let mine: Vec<_> = all.iter().filter(|v| v.0.n == n).copied().collect();
                let points: Vec<(f64, f64)> = mine.iter().map(|v| (v.2, v.3)).collect();
                pareto_front(&points).into_iter().map(|i| mine[i]).collect()
            })
            .collect()
    }

    fn fronts(&self) -> Table {
        let mut table = Table::new(
            "pareto",
            "Pareto fronts of run time and error on one thread: what no other variant of the same \
             n beats in both",
            [
                Column::text("family"),
                Column::count("n"),
                Column::text("what"),
                Column::text("precision"),
                Column::text("path"),
                Column::fixed("median", 2).of("ns"),
                Column::number("90 % error"),
            ],
        );
        for family in ERROR_FAMILIES {
            for (e, t, time, error) in self.fronts_of(family).into_iter().flatten() {
                table.push([
                    family.into(),
                    e.n.into(),
                    e.solver.name().into(),
                    e.precision.to_string().into(),
                    t.path.as_str().into(),
                    time.into(),
                    error.into(),
                ]);
            }
        }
        table
    }

    fn pareto(&self, family: &str) -> Plot {
        let all: Vec<_> = self.variants(family).collect();
        let mut series: Vec<Series> = Group::ALL
            .into_iter()
            .map(|group| {
                let mine = all.iter().filter(|v| Group::of(v.0, v.1) == group);
                Series::new(group.name(), Style::Dots, mine.map(|v| (v.2, v.3)))
            })
            .filter(|series| !series.points.is_empty())
            .collect();
        for (i, front) in self.fronts_of(family).into_iter().enumerate() {
            let points = front.into_iter().map(|(e, t, x, y)| {
                let compensated = match e.solver {
                    Solver::Compensated => " compensated",
                    _ => "",
                };
                Point {
                    title: String::new(),
                    x,
                    y,
                    label: format!("n={} {}{compensated} {}", e.n, e.precision, t.path),
                }
            });
            series.push(Series {
                name: if i == 0 { "Pareto front of each n" } else { "" }.into(),
                style: Style::Front,
                points: points.collect(),
            });
        }
        Plot {
            id: format!("pareto-{family}"),
            caption: format!(
                "Run time against error of every variant on one thread, family `{family}`. Ringed: \
                 what no other variant of the same n beats in both. A larger n gives tighter \
                 bounds, which this does not show."
            ),
            x: Axis::logarithmic("median time for a bound [ns]"),
            y: Axis::logarithmic("90 % error, share of the total"),
            series,
        }
    }

    fn times_by_order(&self) -> Plot {
        let mut series = Vec::new();
        for precision in [Precision::F32, Precision::F64] {
            for (solver, path) in [
                (Solver::Plain, self.level.as_str()),
                (Solver::Adjoint, self.level.as_str()),
                (Solver::Peer, "library"),
                (Solver::PeerAdjoint, "library"),
            ] {
                let points: Vec<(f64, f64)> = self
                    .orders()
                    .into_iter()
                    .filter_map(|n| Some((n as f64, self.time(solver, n, precision, path, 1)?)))
                    .collect();
                if !points.is_empty() {
                    let name = format!("{} {precision}", solver.name());
                    series.push(Series::new(name, Style::Line, points));
                }
            }
        }
        Plot {
            id: "times".into(),
            caption: format!(
                "Median run time by order, one thread; kernels on {} lanes",
                self.level
            ),
            x: Axis::linear("n"),
            y: Axis::logarithmic("time for a row [ns]"),
            series,
        }
    }
}

/// What has a colour of its own in a plot.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Group {
    LanesF32,
    CompensatedF32,
    LanesF64,
    Scalar,
    Peer,
}

impl Group {
    const ALL: [Self; 5] = [
        Self::LanesF32,
        Self::CompensatedF32,
        Self::LanesF64,
        Self::Scalar,
        Self::Peer,
    ];

    fn of(error: &ErrorOf, timing: &Timing) -> Self {
        match (error.solver, error.precision, timing.path.as_str()) {
            (solver, ..) if solver.is_peer() => Self::Peer,
            (_, _, "scalar") => Self::Scalar,
            (_, Precision::F64, _) => Self::LanesF64,
            (Solver::Compensated, ..) => Self::CompensatedF32,
            _ => Self::LanesF32,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::LanesF32 => "f32 lanes",
            Self::CompensatedF32 => "f32 lanes, compensated",
            Self::LanesF64 => "f64 lanes",
            Self::Scalar => "scalar",
            Self::Peer => "diffmoments",
        }
    }
}
