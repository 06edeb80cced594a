//! The figures as reports.

use super::singularities::{Deviation, NEIGHBOURHOOD, Singularities};
use super::table_1::{NEAR, PUBLISHED, Table1};
use crate::families::Precision;
use crate::report::{Cell, Column, Report, Table};
use crate::stress::Solver;

impl Table1 {
    /// The table, with the paper's figures beside it; `command` is what made it.
    #[must_use]
    pub fn report(&self, command: &str) -> Report {
        let mut report = Report::new(
            "Moment bounds: the measures of the paper's Table 1",
            command,
        );
        report.fact("rows of each order and precision (Table 1)", self.samples);
        report.fact("seed", self.seed);
        if let Some(peer) = &self.peer {
            report.fact("beside", peer);
        }
        let mut table = Table::new(
            "table-1",
            format!(
                "Means over random rows, those left out with a Hankel matrix that is not positive \
                 definite or a query within {NEAR} of a singularity. Derivatives against double-double \
                 (exact) and, in f64, against forward differences, which is what the paper's figures \
                 are against"
            ),
            [
                Column::count("n"),
                Column::text("precision"),
                Column::text("solver"),
                Column::count("rows"),
                Column::count("left out"),
                Column::count("not finite"),
                Column::number("moments"),
                Column::number("paper"),
                Column::number("dB/dm, exact"),
                Column::number("dB/dm, differences"),
                Column::number("paper"),
                Column::number("dB/deta, exact"),
                Column::number("dB/deta, differences"),
                Column::number("paper"),
            ],
        );
        for l in &self.lines {
            let published = l.n.checked_sub(1).and_then(|i| PUBLISHED.get(i));
            let of_double = published.filter(|_| l.precision == Precision::F64);
            let reproduction = published.and_then(|p| match l.precision {
                Precision::F32 => p.reproduction_f32,
                Precision::F64 => Some(p.reproduction_f64),
            });
            table.push([
                l.n.into(),
                l.precision.to_string().into(),
                l.solver.name().into(),
                l.rows.into(),
                (l.singular + l.near).into(),
                l.non_finite.into(),
                l.reproduction.into(),
                reproduction.into(),
                l.d_moments.into(),
                l.d_moments_differences.into(),
                of_double.map(|p| p.d_moments).into(),
                l.d_eta.into(),
                l.d_eta_differences.into(),
                of_double.map(|p| p.d_eta).into(),
            ]);
        }
        report.tables.push(table);
        let mut reference = Table::new(
            "derivative-reference",
            "The reference derivative, the adjoint in double-double, beside differences of \
             the bound in 300 bits: the largest difference relative to the derivative or, below 1, to 1",
            [
                Column::count("n"),
                Column::count("rows"),
                Column::number("difference"),
            ],
        );
        for &(n, rows, difference) in &self.reference {
            reference.push([n.into(), rows.into(), difference.into()]);
        }
        report.tables.push(reference);
        report
    }
}

impl Singularities {
    /// The figures; `command` is what made them.
    #[must_use]
    pub fn report(&self, command: &str) -> Report {
        let mut report = Report::new("Moment bounds at singularities", command);
        report.fact("moment vectors of each order and precision", self.samples);
        report.fact("seed", self.seed);
        if let Some(peer) = &self.peer {
            report.fact("beside", peer);
        }
        let mut table = Table::new(
            "singularities",
            format!(
                "Lower bound and derivatives at every root of P_n, and at 16 queries within \
                 {NEIGHBOURHOOD:e} of each: distance from the exact value at the root, largest and \
                 99 %; beside it how far exact values go"
            ),
            [
                Column::count("n"),
                Column::text("precision"),
                Column::text("solver"),
                Column::count("vectors"),
                Column::count("queries"),
                Column::count("bounds not finite"),
                Column::count("derivatives not finite"),
                Column::number("bound"),
                Column::number("99 %"),
                Column::number("exact"),
                Column::number("dB/dm"),
                Column::number("99 %"),
                Column::number("exact"),
                Column::number("dB/deta"),
                Column::number("99 %"),
                Column::number("exact"),
            ],
        );
        let mut errors = Table::new(
            "singularities-errors",
            "The same queries: errors against exact values at the query itself",
            [
                Column::count("n"),
                Column::text("precision"),
                Column::text("solver"),
                Column::number("bound 50 %"),
                Column::number("99 %"),
                Column::number("max"),
                Column::number("dB/dm 50 %"),
                Column::number("99 %"),
                Column::number("max"),
                Column::number("dB/deta 50 %"),
                Column::number("99 %"),
                Column::number("max"),
            ],
        );
        for l in &self.lines {
            let key: [Cell; 3] = [
                l.n.into(),
                l.precision.to_string().into(),
                l.solver.name().into(),
            ];
            let of_limit = |d: Deviation| -> [Cell; 3] {
                [
                    d.limit.greatest.into(),
                    d.limit.ninety_nine.into(),
                    d.exact.into(),
                ]
            };
            let of_error = |d: Deviation| -> [Cell; 3] {
                [
                    d.error.median.into(),
                    d.error.ninety_nine.into(),
                    d.error.greatest.into(),
                ]
            };
            let all = [l.bound, l.d_moments, l.d_eta];
            let counts: [Cell; 4] = [
                l.vectors.into(),
                l.queries.into(),
                l.non_finite_bounds.into(),
                l.non_finite_gradients.into(),
            ];
            table.rows.push(
                key.iter()
                    .cloned()
                    .chain(counts)
                    .chain(all.into_iter().flat_map(of_limit))
                    .collect(),
            );
            errors.rows.push(
                key.into_iter()
                    .chain(all.into_iter().flat_map(of_error))
                    .collect(),
            );
        }
        if self.lines.iter().all(|l| l.solver == Solver::Plain) {
            report.notes.push(
                "diffmoments was not measured: ask for it with `--against diffmoments`".into(),
            );
        }
        report.tables.push(table);
        report.tables.push(errors);
        report
    }
}
