//! The linear programme on samples, and the refinement of the samples.
//!
//! With weights w >= 0 at the samples, least is sum c w subject to moments that agree. Its dual asks
//! for a combination P of the basis functions that stays below c, with the greatest mean. P is what
//! makes the result a proof: wherever P exceeds c between the samples, P less that excess is below c
//! everywhere, so its mean bounds every distribution. Refinement ends when P nowhere exceeds c.
//!
//! A support point between two samples is shared by both, in proportion: their centroid lies within
//! the square of their distance of where it should be. So samples are added there, and the distance
//! is squared with each round.
//!
//! The moments may be off by what they were rounded by, so that there is always a distribution if
//! there was one before; in the dual that is what P's coefficients cost. Beyond that, moments are
//! not enforced but at a price for each unit: so those of no distribution have a
//! distance. In the dual the price bounds P's coefficients. It is low at first, since the solver's accuracy is relative to it.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT};

use super::feasible::{self, Weight, feasible};
use super::system::{Instance, System};
use super::{JudgeError, Point};

/// The largest change of a bound for a change of a moment (in the basis) that is resolved.
pub const SENSITIVITY_LIMIT: f64 = 1e9;

/// The price at first, and what it is raised by.
const FIRST_PRICE: f64 = 1e3;

/// The excess over c at which refinement ends, and what the solver is asked for.
const TOLERANCE: f64 = 1e-12;

/// Rounds without a better solution after which there will be none.
const STALLED: usize = 2;

/// Samples are added at a support point and at these parts of its samples' distance from it.
const PARTS: [f64; 2] = [1.0 / 16.0, 1.0 / 256.0];

/// The least distance of samples, as a part of the range: nearer columns are the same to a solver.
const NEAREST: f64 = 1e-9;

/// A margin that is as good as none: where both the estimate and what is proved are below, what is proved is told.
const LITTLE: f64 = 1e-10;

/// How far from the query weights may be that are taken for its own, as parts of the range: each is tried.
const BESIDE: [f64; 4] = [0.0, 1e-8, 1e-6, 1e-4];

/// Places between two samples where the excess is looked for.
const LOOKS: u32 = 8;

/// The side of the query on which weight counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Below,
    Above,
}

/// The least weight on one side.
#[derive(Clone, Debug)]
pub struct Least {
    /// No distribution has less, up to rounding.
    pub value: f64,
    /// How much less `value` may be than the exact optimum: proved where `residual` is 0, else an estimate.
    pub margin: f64,
    /// How far the moments of the weights are from the given ones, beyond rounding: the sum over
    /// the basis. 0 where there are weights with these moments.
    pub residual: f64,
    /// The largest coefficient of P.
    pub sensitivity: f64,
    /// Coordinates with weights in the programme.
    support: Vec<(f64, f64)>,
}

impl Least {
    /// The distribution that attains the bound, as depths and shares; what is at infinity has none.
    pub fn points(&self, instance: &Instance<'_>) -> Vec<Point> {
        self.support
            .iter()
            .map(|&(t, w)| Point {
                depth: instance.depth(t),
                weight: w * instance.total * instance.system().worth(t),
            })
            .filter(|p| p.weight > 1e-12 * instance.total && p.depth.is_finite())
            .collect()
    }
}

/// A sample: its coordinate and the basis functions there.
struct Sample {
    t: f64,
    column: Vec<f64>,
}

struct Programme<'a> {
    system: &'a System,
    instance: &'a Instance<'a>,
    query: f64,
    side: Side,
    price: f64,
    samples: Vec<Sample>,
}

/// A support point.
struct Atom {
    t: f64,
    weight: f64,
    /// The distance of the samples that share it, or of the next ones.
    spacing: f64,
}

/// What the solver found: P's coefficients, and the weights of the samples.
struct Solution {
    coefficients: Vec<f64>,
    weights: Vec<f64>,
}

/// Solves the programme `rounds` times, each time with more samples near the support points, or
/// until it is exact to [`TOLERANCE`].
pub fn least(
    instance: &Instance<'_>,
    query: f64,
    side: Side,
    rounds: usize,
) -> Result<Least, JudgeError> {
    let system = instance.system();
    let mut grid = system.samples();
    let (first, last) = system.ends();
    if first < query && query < last && !grid.contains(&query) {
        grid.push(query);
        grid.sort_by(f64::total_cmp);
    }
    let mut programme = Programme {
        system,
        instance,
        query,
        side,
        price: FIRST_PRICE,
        samples: Vec::new(),
    };
    programme.samples = grid.into_iter().map(|t| programme.sample(t)).collect();

    let mut best: Option<Least> = None;
    // What distributions with the moments have: the optimum is not greater.
    let mut attained = f64::INFINITY;
    let mut stalled = 0;
    for round in 1..=rounds.max(1) {
        let solution = programme.solve()?;
        let peaks = programme.peaks(&solution.coefficients);
        let worst = peaks.iter().fold(0.0_f64, |a, &(_, excess)| a.max(excess));
        let atoms = programme.atoms(&solution.weights);
        let found = programme.judged(&solution, &atoms, worst);
        attained = attained.min(programme.attained(&atoms).unwrap_or(f64::INFINITY));
        let is_bounded = found.sensitivity > 0.5 * programme.price;
        let before = best.as_ref().map_or(f64::INFINITY, |b| b.margin);
        stalled = if found.margin < 0.5 * before {
            0
        } else {
            stalled + 1
        };
        if found.margin <= before {
            best = Some(found);
        }
        let is_finer = programme.refine(&atoms, &peaks);
        if is_bounded && programme.price < SENSITIVITY_LIMIT {
            if round < rounds {
                // Another programme, with which this solution does not compare.
                programme.price *= FIRST_PRICE;
                (best, stalled) = (None, 0);
            }
        } else if before.min(worst) <= TOLERANCE || stalled >= STALLED || !is_finer {
            break;
        }
    }
    // Prices that have decided, not the moments, leave the exact bound unknown.
    if let Some(best) = &mut best
        && best.sensitivity > 0.5 * programme.price
    {
        best.margin = f64::INFINITY;
    }
    if let Some(best) = &mut best {
        // Both sides are proved, whatever the prices. The moments of the weights are not the given ones to the last digit.
        let rest = best.sensitivity * feasible::allowed(instance).sum::<f64>();
        let proved = (attained - best.value).max(0.0) + rest;
        // Weights that were moved may be worse ones.
        if proved <= (2.0 * best.margin).max(LITTLE) && proved.is_finite() {
            best.margin = proved;
            best.residual = 0.0;
        }
    }
    best.ok_or(JudgeError::Solver {
        status: "its solution is not finite".into(),
    })
}

impl Programme<'_> {
    fn sample(&self, t: f64) -> Sample {
        Sample {
            t,
            column: self.system.column(t),
        }
    }

    /// c, on the open interval that `within` lies in, as far as its ends.
    fn cost(&self, t: f64, within: f64) -> f64 {
        let counts = match self.side {
            Side::Below => within < self.query,
            Side::Above => within > self.query,
        };
        if counts { self.system.worth(t) } else { 0.0 }
    }

    fn solve(&self) -> Result<Solution, JudgeError> {
        let Instance {
            targets, rounding, ..
        } = self.instance;
        let size = targets.len();
        let count = self.samples.len();
        // Columns of the matrix: P's coefficients, then bounds of their magnitudes. Rows: P <= c at
        // each sample; a coefficient and its negative at most its bound; the bound at most the price.
        let height = count + 3 * size;
        let mut starts = vec![0];
        let mut rows = Vec::with_capacity(size * (count + 5));
        let mut values = Vec::with_capacity(size * (count + 5));
        for k in 0..size {
            rows.extend(0..count);
            values.extend(self.samples.iter().map(|s| s.column[k]));
            rows.extend([count + 3 * k, count + 3 * k + 1]);
            values.extend([1.0, -1.0]);
            starts.push(rows.len());
        }
        for k in 0..size {
            rows.extend((0..3).map(|i| count + 3 * k + i));
            values.extend([-1.0, -1.0, 1.0]);
            starts.push(rows.len());
        }
        let matrix = CscMatrix::new(height, 2 * size, starts, rows, values);
        let mut limits: Vec<f64> = self.samples.iter().map(|s| self.cost(s.t, s.t)).collect();
        for _ in 0..size {
            limits.extend([0.0, 0.0, self.price]);
        }
        let objective: Vec<f64> = targets
            .iter()
            .map(|b| -b)
            .chain(rounding.iter().copied())
            .collect();

        let failed = |status: String| JudgeError::Solver { status };
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .presolve_enable(false)
            // Prices far above the costs leave no room for the usual regularisation.
            .static_regularization_constant(1e-14)
            .iterative_refinement_reltol(1e-15)
            .iterative_refinement_abstol(1e-15)
            .tol_gap_abs(TOLERANCE)
            .tol_gap_rel(TOLERANCE)
            // Which is relative to the price.
            .tol_feas(TOLERANCE / self.price)
            .build()
            .map_err(|e| failed(e.to_string()))?;
        let mut solver = DefaultSolver::new(
            &CscMatrix::zeros((2 * size, 2 * size)),
            &objective,
            &matrix,
            &limits,
            &[NonnegativeConeT(height)],
            settings,
        )
        .map_err(|e| failed(e.to_string()))?;
        solver.solve();
        // Whatever the solver thinks of its solution: its quality is measured here.
        let status = solver.solution.status;
        let solution = solver.solution;
        if solution.x.iter().chain(&solution.z).all(|x| x.is_finite()) {
            Ok(Solution {
                coefficients: solution.x[..size].to_vec(),
                weights: solution.z[..count].iter().map(|w| w.max(0.0)).collect(),
            })
        } else {
            Err(failed(format!("{status:?}")))
        }
    }

    /// The local maxima of P's excess over c: where, and how much.
    fn peaks(&self, coefficients: &[f64]) -> Vec<(f64, f64)> {
        let p =
            |column: &[f64]| -> f64 { column.iter().zip(coefficients).map(|(a, b)| a * b).sum() };
        let mut peaks = Vec::new();
        // On either side of the query c is smooth.
        for is_below in [true, false] {
            let within = if is_below { f64::MIN } else { f64::MAX };
            let over = |t: f64| p(&self.system.column(t)) - self.cost(t, within);
            let here: Vec<f64> = self
                .samples
                .iter()
                .map(|s| s.t)
                .filter(|&t| t == self.query || (t < self.query) == is_below)
                .collect();
            let mut looks: Vec<(f64, f64)> = Vec::new();
            for (i, &a) in here.iter().enumerate() {
                looks.push((a, over(a)));
                if let Some(&b) = here.get(i + 1) {
                    looks.extend((1..LOOKS).map(|k| {
                        let t = a + (b - a) * (f64::from(k) / f64::from(LOOKS));
                        (t, over(t))
                    }));
                }
            }
            for (i, &look) in looks.iter().enumerate() {
                let before = i.checked_sub(1).map(|i| looks[i]);
                let after = looks.get(i + 1).copied();
                let is_peak =
                    before.is_none_or(|b| look.1 >= b.1) && after.is_none_or(|a| look.1 > a.1);
                if is_peak {
                    let low = before.map_or(look.0, |b| b.0);
                    let high = after.map_or(look.0, |a| a.0);
                    let top = highest(&over, low, high);
                    peaks.push(if top.1 > look.1 { top } else { look });
                }
            }
        }
        peaks
    }

    /// What a solution proves, given P's greatest excess over c.
    fn judged(&self, solution: &Solution, atoms: &[Atom], worst: f64) -> Least {
        let Solution {
            coefficients,
            weights,
        } = solution;
        let Instance {
            targets, rounding, ..
        } = self.instance;
        let mean: f64 = coefficients.iter().zip(targets).map(|(c, b)| c * b).sum();
        let uncertain: f64 = coefficients
            .iter()
            .zip(rounding)
            .map(|(c, r)| (c * r).abs())
            .sum();
        let mut rest: Vec<f64> = targets.iter().map(|b| -b).collect();
        let mut cost = 0.0;
        for (sample, w) in self.samples.iter().zip(weights) {
            cost += w * self.cost(sample.t, sample.t);
            for (r, v) in rest.iter_mut().zip(&sample.column) {
                *r += w * v;
            }
        }
        // The cost once the weights' moments were put right, at the prices that P gives.
        let repair: f64 = coefficients.iter().zip(&rest).map(|(c, r)| c * r).sum();
        let value = mean - worst - uncertain;
        let sensitivity = coefficients.iter().fold(0.0_f64, |a, c| a.max(c.abs()));
        let missed: f64 = rest
            .iter()
            .zip(rounding)
            .map(|(rest, rounding)| (rest.abs() - rounding).max(0.0))
            .sum();
        Least {
            value,
            margin: (cost - repair - value).abs() + uncertain + sensitivity * missed,
            residual: missed,
            sensitivity,
            support: atoms.iter().map(|a| (a.t, a.weight)).collect(),
        }
    }

    /// The least that weights near these have on the side that counts, once they have the moments; `None` if there are
    /// none.
    fn attained(&self, atoms: &[Atom]) -> Option<f64> {
        let (first, last) = self.system.ends();
        // A solver leaves weights of the query point beside it, where they count.
        let tries = BESIDE.into_iter().filter_map(|part| {
            let is_at_query = |atom: &&Atom| (atom.t - self.query).abs() <= part * (last - first);
            let at_query: f64 = atoms.iter().filter(is_at_query).map(|it| it.weight).sum();
            let others = atoms.iter().filter(|it| !is_at_query(it));
            // Nor do those at an end move away from it.
            let end = |t: f64| {
                [first, last]
                    .into_iter()
                    .find(|end| (t - end).abs() <= part * (last - first))
            };
            let mut weights: Vec<Weight> = others
                .map(|atom| Weight {
                    t: end(atom.t).unwrap_or(atom.t),
                    weight: atom.weight,
                    is_fixed: end(atom.t).is_some(),
                })
                .collect();
            if at_query > 0.0 {
                weights.push(Weight {
                    t: self.query,
                    weight: at_query,
                    is_fixed: true,
                });
            }
            let found = feasible(self.instance, weights)?;
            let costs = found.iter().map(|it| it.weight * self.cost(it.t, it.t));
            Some(costs.sum())
        });
        tries.min_by(f64::total_cmp)
    }

    /// The weights, those of neighbouring samples on the same side of the query put together.
    fn atoms(&self, weights: &[f64]) -> Vec<Atom> {
        let place = |i: usize| self.samples[i].t.partial_cmp(&self.query);
        let heavy: Vec<usize> = (0..weights.len())
            .filter(|&i| weights[i] > NEGLIGIBLE)
            .collect();
        heavy
            .chunk_by(|&i, &j| j == i + 1 && place(i) == place(j))
            .map(|group| {
                let weight: f64 = group.iter().map(|&i| weights[i]).sum();
                let t = group
                    .iter()
                    .map(|&i| weights[i] * self.samples[i].t)
                    .sum::<f64>()
                    / weight;
                let (first, last) = (group[0], group[group.len() - 1]);
                let next = self.samples.get(last + 1).map(|s| s.t - t);
                let previous = first.checked_sub(1).map(|i| t - self.samples[i].t);
                let beside = [next, previous]
                    .into_iter()
                    .flatten()
                    .fold(f64::MAX, f64::min);
                let extent = self.samples[last].t - self.samples[first].t;
                Atom {
                    t,
                    weight,
                    spacing: if extent > 0.0 { extent } else { beside },
                }
            })
            .collect()
    }

    /// Adds samples at the support points and wherever else P exceeds c; false if there are enough
    /// already.
    fn refine(&mut self, atoms: &[Atom], peaks: &[(f64, f64)]) -> bool {
        let (first, last) = self.system.ends();
        let nearest = NEAREST * (last - first);
        let mut wanted = Vec::new();
        for atom in atoms.iter().filter(|a| a.t != self.query) {
            wanted.push(atom.t);
            for part in PARTS {
                wanted.extend([atom.t - part * atom.spacing, atom.t + part * atom.spacing]);
            }
        }
        wanted.extend(peaks.iter().filter(|p| p.1 > TOLERANCE).map(|p| p.0));
        let before = self.samples.len();
        for t in wanted {
            let at = self.samples.partition_point(|s| s.t < t);
            let is_near = |s: Option<&Sample>| s.is_some_and(|s| (s.t - t).abs() < nearest);
            let is_known = is_near(self.samples.get(at))
                || is_near(at.checked_sub(1).and_then(|i| self.samples.get(i)));
            if first <= t && t <= last && !is_known {
                let sample = self.sample(t);
                self.samples.insert(at, sample);
            }
        }
        self.samples.len() > before
    }
}

/// The maximum of a function that has one in an interval, by golden sections.
fn highest(f: &impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> (f64, f64) {
    let section = 0.5 * (5.0_f64.sqrt() - 1.0);
    let at = |t: f64| (t, f(t));
    let mut a = at(high - section * (high - low));
    let mut b = at(low + section * (high - low));
    for _ in 0..40 {
        if a.1 > b.1 {
            high = b.0;
            b = a;
            a = at(high - section * (high - low));
        } else {
            low = a.0;
            a = b;
            b = at(low + section * (high - low));
        }
    }
    if a.1 > b.1 { a } else { b }
}

/// Weights that an interior-point method leaves where there is none.
const NEGLIGIBLE: f64 = 1e-9;
