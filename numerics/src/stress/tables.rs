//! The figures as a report.

use super::{Agreement, Cell, Solver, Stress};
use crate::families::{Family, ORDERS, Precision};
use crate::report::{Axis, Column, Plot, Report, Series, Style, Table};

impl Stress {
    /// Tables and plots of everything; `command` is what made it.
    #[must_use]
    pub fn report(&self, command: &str) -> Report {
        let mut report = Report::new("Moment bounds under stress", command);
        report.fact("rows of each family, order and precision", self.samples);
        report.fact("seed", self.seed);
        report.fact("instruction set of the lanes", &self.level);
        match &self.peer {
            Some(peer) => report.fact("beside", peer),
            None => report.notes.push(
                "diffmoments was not measured: ask for it with `--against diffmoments`".into(),
            ),
        }
        report.notes.extend(self.notes.iter().cloned());
        report.tables.push(self.totals());
        for solver in [Solver::Compensated, Solver::Plain, Solver::Published] {
            report.tables.push(self.overview(solver));
        }
        for solver in [Solver::Compensated, Solver::Plain] {
            if self.derivatives.iter().any(|d| d.solver == solver) {
                report.tables.push(self.overview_of_derivatives(solver));
            }
        }
        report.tables.push(self.errors());
        if self.peer.is_some() {
            report.tables.push(self.against());
        }
        if self.cells.iter().any(|c| c.solver == Solver::Compensated) {
            report.tables.push(self.gains());
        }
        report.tables.push(self.references());
        report.tables.push(self.families());
        for precision in [Precision::F32, Precision::F64] {
            if self.cells.iter().any(|c| c.precision == precision) {
                report.plots.push(self.ninety_by_order(precision));
            }
        }
        report
    }

    /// The cells of one backend: that which all solvers of ours have.
    fn first_of(&self, cell: &Cell, solver: Solver) -> Option<&Cell> {
        self.cells.iter().find(|c| {
            c.solver == solver
                && (&c.family, c.n, c.precision) == (&cell.family, cell.n, cell.precision)
        })
    }

    /// What must be 0, summed over families and orders.
    fn totals(&self) -> Table {
        let mut table = Table::new(
            "totals",
            "Results that are no number, or not from 0 to m_0, over all families and orders",
            [
                Column::text("solver"),
                Column::text("backend"),
                Column::text("precision"),
                Column::count("rows"),
                Column::count("valid"),
                Column::count("undecided"),
                Column::count("not finite"),
                Column::count("out of range"),
                Column::count("other bits than scalar"),
            ],
        );
        let mut keys: Vec<(Solver, &str, Precision)> = Vec::new();
        for c in &self.cells {
            let key = (c.solver, c.backend.as_str(), c.precision);
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        keys.sort_by_key(|&(solver, _, precision)| (solver, precision));
        for key in keys {
            let of_key = |c: &&Cell| (c.solver, c.backend.as_str(), c.precision) == key;
            let cells: Vec<&Cell> = self.cells.iter().filter(of_key).collect();
            let sum = |f: fn(&Cell) -> u64| cells.iter().map(|c| f(c)).sum::<u64>();
            let bits: Option<u64> = cells.iter().map(|c| c.other_bits).sum();
            table.push([
                key.0.name().into(),
                key.1.into(),
                key.2.to_string().into(),
                sum(|c| c.rows).into(),
                sum(|c| c.valid).into(),
                sum(|c| c.undecided).into(),
                sum(|c| c.non_finite).into(),
                sum(|c| c.out_of_range).into(),
                bits.into(),
            ]);
        }
        table
    }

    /// The main figure, by family and order: the worst row.
    fn overview(&self, solver: Solver) -> Table {
        let orders: Vec<usize> = ORDERS
            .filter(|&n| self.cells.iter().any(|c| c.n == n))
            .collect();
        let headings = orders.iter().map(|n| Column::number(format!("n = {n}")));
        let mut table = Table::new(
            format!("over-{}", solver.name()),
            format!(
                "Error over sensitivity of the {} solver: the greatest of all valid rows. The \
                 sensitivity is what rounding each number of the row and the result once does to the \
                 answer (nothing: no valid rows, or another number of moments)",
                solver.name()
            ),
            [Column::text("family"), Column::text("precision")]
                .into_iter()
                .chain(headings),
        );
        for precision in [Precision::F32, Precision::F64] {
            for (family, _) in &self.agreement {
                let mut row: Vec<crate::report::Cell> =
                    vec![family.as_str().into(), precision.to_string().into()];
                for &n in &orders {
                    let cell = self.cells.iter().find(|c| {
                        (c.family.as_str(), c.precision) == (family, precision)
                            && (c.solver, c.n) == (solver, n)
                    });
                    row.push(cell.and_then(|c| c.over).map(|o| o.greatest).into());
                }
                if row[2..].iter().any(|c| *c != crate::report::Cell::Empty) {
                    table.push(row);
                }
            }
        }
        table
    }

    /// The worst row's derivative, by family and order.
    fn overview_of_derivatives(&self, solver: Solver) -> Table {
        let of_solver = || self.derivatives.iter().filter(move |d| d.solver == solver);
        let orders: Vec<usize> = ORDERS.filter(|&n| of_solver().any(|d| d.n == n)).collect();
        let headings = orders.iter().map(|n| Column::number(format!("n = {n}")));
        let mut table = Table::new(
            format!("derivatives-over-{}", solver.name()),
            format!(
                "Error over sensitivity of the {} derivatives: the greatest of all derivatives of all \
                 valid rows. The sensitivity is what rounding each number of the row and the result once \
                 does to a derivative; one that is less than epsilon times the greatest of its row counts \
                 as that",
                solver.name()
            ),
            [Column::text("family"), Column::text("precision")]
                .into_iter()
                .chain(headings),
        );
        for precision in [Precision::F32, Precision::F64] {
            for (family, _) in &self.agreement {
                let of_order = |n: usize| {
                    of_solver().find(|d| {
                        (d.family.as_str(), d.precision, d.n) == (family.as_str(), precision, n)
                    })
                };
                let mut row: Vec<crate::report::Cell> =
                    vec![family.as_str().into(), precision.to_string().into()];
                for &n in &orders {
                    row.push(of_order(n).and_then(|d| d.over).map(|o| o.greatest).into());
                }
                if row[2..].iter().any(|c| *c != crate::report::Cell::Empty) {
                    table.push(row);
                }
            }
        }
        table
    }

    /// Every cell.
    fn errors(&self) -> Table {
        let mut table = Table::new(
            "errors",
            "Errors of valid rows as shares of m_0, the larger one of the lower and the upper bound; \
             what is not a number counts as 1",
            [
                Column::text("family"),
                Column::count("n"),
                Column::text("precision"),
                Column::text("solver"),
                Column::text("backend"),
                Column::count("rows"),
                Column::count("valid"),
                Column::number("50 %"),
                Column::number("90 %"),
                Column::number("99 %"),
                Column::number("max"),
                Column::number("over sensitivity 50 %"),
                Column::number("99 %"),
                Column::number("max"),
                Column::count("not finite"),
                Column::count("out of range"),
                Column::count("undecided"),
                Column::count("worst row"),
            ],
        );
        for c in &self.cells {
            table.push([
                c.family.as_str().into(),
                c.n.into(),
                c.precision.to_string().into(),
                c.solver.name().into(),
                c.backend.as_str().into(),
                c.rows.into(),
                c.valid.into(),
                c.error.map(|e| e.median).into(),
                c.error.map(|e| e.ninety).into(),
                c.error.map(|e| e.ninety_nine).into(),
                c.error.map(|e| e.greatest).into(),
                c.over.map(|o| o.median).into(),
                c.over.map(|o| o.ninety_nine).into(),
                c.over.map(|o| o.greatest).into(),
                c.non_finite.into(),
                c.out_of_range.into(),
                c.undecided.into(),
                c.worst.into(),
            ]);
        }
        // As long as there are families times orders times solvers.
        table.is_detail = self.cells.len() > 60;
        table
    }

    /// Quotients of quantiles with `diffmoments`, cells where that is better first.
    fn against(&self) -> Table {
        let mut table = Table::new(
            "against-diffmoments",
            "Errors over those of diffmoments on the same rows (below 1: better), plain solver, \
             worst quotients first; quantiles of both below half a rounding error count as alike",
            [
                Column::text("family"),
                Column::count("n"),
                Column::text("precision"),
                Column::count("valid"),
                Column::number("50 %"),
                Column::number("90 %"),
                Column::number("99 %"),
                Column::number("max"),
                Column::number("own 90 %"),
                Column::number("its 90 %"),
                Column::count("its not finite"),
                Column::count("its out of range"),
            ],
        );
        let mut rows: Vec<(f64, Vec<crate::report::Cell>)> = Vec::new();
        for peer in self.cells.iter().filter(|c| c.solver == Solver::Peer) {
            let Some(own) = self.first_of(peer, Solver::Plain) else {
                continue;
            };
            let floor = match peer.precision {
                Precision::F32 => f64::from(f32::EPSILON) / 2.0,
                Precision::F64 => f64::EPSILON / 2.0,
            };
            let quotient = |own: f64, its: f64| own.max(floor) / its.max(floor);
            let quotients: Option<Vec<f64>> = own.error.zip(peer.error).map(|(a, b)| {
                vec![
                    quotient(a.median, b.median),
                    quotient(a.ninety, b.ninety),
                    quotient(a.ninety_nine, b.ninety_nine),
                    quotient(a.greatest, b.greatest),
                ]
            });
            let at = |i: usize| quotients.as_ref().map(|q| q[i]);
            // Quantiles; the greatest error of a sample is chance.
            let worst = (0..3).filter_map(at).fold(0.0, f64::max);
            rows.push((
                worst,
                vec![
                    own.family.as_str().into(),
                    own.n.into(),
                    own.precision.to_string().into(),
                    own.valid.into(),
                    at(0).into(),
                    at(1).into(),
                    at(2).into(),
                    at(3).into(),
                    own.error.map(|e| e.ninety).into(),
                    peer.error.map(|e| e.ninety).into(),
                    peer.non_finite.into(),
                    peer.out_of_range.into(),
                ],
            ));
        }
        rows.sort_by(|a, b| b.0.total_cmp(&a.0));
        table.rows = rows.into_iter().map(|r| r.1).collect();
        table.shown = Some(20);
        table
    }

    /// What compensation gains.
    fn gains(&self) -> Table {
        let mut table = Table::new(
            "compensated",
            "90 % errors of the plain and the compensated solver",
            [
                Column::text("family"),
                Column::count("n"),
                Column::text("precision"),
                Column::count("valid"),
                Column::number("plain"),
                Column::number("compensated"),
                Column::number("times lower"),
            ],
        );
        let compensated = self
            .cells
            .iter()
            .filter(|c| c.solver == Solver::Compensated);
        let mut seen: Vec<(&str, usize, Precision)> = Vec::new();
        for c in compensated {
            let key = (c.family.as_str(), c.n, c.precision);
            if seen.contains(&key) {
                continue;
            }
            seen.push(key);
            let Some((plain, own)) = self
                .first_of(c, Solver::Plain)
                .and_then(|p| p.error.zip(c.error))
            else {
                continue;
            };
            table.push([
                c.family.as_str().into(),
                c.n.into(),
                c.precision.to_string().into(),
                c.valid.into(),
                plain.ninety.into(),
                own.ninety.into(),
                (plain.ninety / own.ninety).into(),
            ]);
        }
        table.is_detail = table.rows.len() > 60;
        table
    }

    /// How well the reference was confirmed.
    fn references(&self) -> Table {
        let mut table = Table::new(
            "reference",
            "The reference beside 300 bits (beyond: off by more than a sixteenth of the measured \
             precision's rounding error) and beside the linear programme (beyond: by more than its \
             own margin; unresolved: too ill-conditioned for its f64)",
            [
                Column::text("family"),
                Column::count("300 bits: rows"),
                Column::number("largest difference"),
                Column::count("beyond"),
                Column::count("programme: rows"),
                Column::number("largest difference"),
                Column::count("beyond"),
                Column::count("unresolved"),
            ],
        );
        for (family, a) in &self.agreement {
            let Agreement {
                wide_rows,
                wide_difference,
                wide_beyond,
                programme_rows,
                programme_difference,
                programme_beyond,
                programme_unresolved,
            } = *a;
            table.push([
                family.as_str().into(),
                wide_rows.into(),
                (wide_rows > 0).then_some(wide_difference).into(),
                wide_beyond.into(),
                programme_rows.into(),
                (programme_rows > 0).then_some(programme_difference).into(),
                programme_beyond.into(),
                programme_unresolved.into(),
            ]);
        }
        table
    }

    /// What the families are.
    fn families(&self) -> Table {
        let mut table = Table::new(
            "families",
            "What the rows are",
            [Column::text("family"), Column::text("rows")],
        );
        for (name, _) in &self.agreement {
            if let Some(family) = Family::named(name) {
                table.push([family.name.into(), family.summary.into()]);
            }
        }
        table.is_detail = true;
        table
    }

    /// 90 % errors by order, a line for each family.
    fn ninety_by_order(&self, precision: Precision) -> Plot {
        let mut series: Vec<Series> = Vec::new();
        for (family, _) in &self.agreement {
            let points: Vec<(f64, f64)> = self
                .agreement_orders(family, precision)
                .into_iter()
                .collect();
            if !points.is_empty() {
                series.push(Series::new(family.as_str(), Style::Line, points));
            }
        }
        Plot {
            id: format!("errors-{precision}"),
            caption: format!("90 % errors of the plain solver in {precision}, by order"),
            x: Axis::linear("n"),
            y: Axis::logarithmic("error / m_0"),
            series,
        }
    }

    fn agreement_orders(&self, family: &str, precision: Precision) -> Vec<(f64, f64)> {
        let mut points: Vec<(f64, f64)> = Vec::new();
        for c in &self.cells {
            let wanted = c.family == family && c.precision == precision;
            let first = points.last().is_none_or(|p| p.0 < c.n as f64);
            if wanted && first && c.solver == Solver::Plain {
                points.extend(c.error.map(|e| (c.n as f64, e.ninety)));
            }
        }
        points
    }
}
