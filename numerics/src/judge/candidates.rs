//! All candidates for what a shadow map could hold, ranked (\[MSM\], section 3.2, and its supplement, section 6).
//!
//! A candidate is a choice of some of the 37 functions of depth. Its error on a region is the distance of the best lower
//! bound that their means allow to percentage-closer filtering with the same bias. Programmes are solved as published: with
//! 251 uniform samples of [0, 1], then twice more with finer ones about the support points. [`evaluate`](super::evaluate)
//! goes on to the end, for a few candidates.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::simplex::Programme;
use super::{DepthFunction, Region};

/// Uniform samples of the first programme.
const SAMPLES: usize = 251;

/// How much finer samples become about support points with each further programme.
const FINER: [f64; 2] = [1.0 / 8.0, 1.0 / 64.0];

/// New samples on each side of a support point.
const BESIDE: i32 = 8;

/// Of a function, what is left of it without those before; less than this is rounding.
const DEPENDENT: f64 = 1e-8;

/// The most functions of a candidate: there are 435 897 of five.
pub const MOST_FUNCTIONS: usize = 5;

/// Regions of one shadow map.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// The regions.
    pub regions: Vec<Region>,
    /// How much its mean error counts: the paper has the number of fragments in the stack of maps.
    pub weight: f64,
}

/// How well a candidate does.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// The functions, in the paper's order.
    pub functions: Vec<DepthFunction>,
    /// The mean absolute error of the lower bound as a shadow intensity, from 0 to 1: that of the groups by their weights.
    pub mean: f64,
    /// That of each group.
    pub groups: Vec<f64>,
}

/// All candidates.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// The best first; of equal ones the first in the paper's order.
    pub scores: Vec<Score>,
    /// Programmes that took too many steps, as a share: their bounds count as they were then.
    pub unfinished: f64,
}

impl Ranking {
    /// The place of a candidate, from 1 on, whatever the order of its functions.
    #[must_use]
    pub fn place(&self, functions: &[DepthFunction]) -> Option<usize> {
        let is_it = |score: &Score| {
            score.functions.len() == functions.len()
                && functions.iter().all(|f| score.functions.contains(f))
        };
        self.scores.iter().position(is_it).map(|i| i + 1)
    }
}

/// A region with all that does not depend on the candidate.
struct Prepared {
    receiver: f64,
    shadow: f64,
    means: [f64; DepthFunction::ALL.len()],
}

/// The uniform samples, and all functions there.
struct Grid {
    places: [f64; SAMPLES],
    values: Vec<[f64; SAMPLES]>,
}

impl Grid {
    fn new() -> Self {
        let places = std::array::from_fn(|i| i as f64 / (SAMPLES - 1) as f64);
        Self {
            places,
            values: DepthFunction::ALL
                .map(|f| places.map(|z| f.eval(z)))
                .to_vec(),
        }
    }
}

/// Ranks all choices of `count` functions, 1 to [`MOST_FUNCTIONS`]. `advance` is told how many of them are done, from any
/// thread.
///
/// # Panics
///
/// If `count` is out of range.
#[must_use]
pub fn rank(count: usize, groups: &[Group], advance: &(dyn Fn(usize) + Sync)) -> Ranking {
    assert!((1..=MOST_FUNCTIONS).contains(&count), "{count} functions");
    let grid = Grid::new();
    let prepared: Vec<Vec<Prepared>> = groups
        .iter()
        .map(|group| group.regions.par_iter().map(prepare).collect())
        .collect();
    let choices = choices(count);
    let done = AtomicUsize::new(0);
    let unfinished = AtomicUsize::new(0);
    let mut scores: Vec<Score> = choices
        .par_iter()
        .map(|choice| {
            let groups_of = |regions: &Vec<Prepared>| {
                let (error, failures) = match count {
                    1 => error::<2>(choice, &grid, regions),
                    2 => error::<3>(choice, &grid, regions),
                    3 => error::<4>(choice, &grid, regions),
                    4 => error::<5>(choice, &grid, regions),
                    _ => error::<6>(choice, &grid, regions),
                };
                unfinished.fetch_add(failures, Ordering::Relaxed);
                error
            };
            let errors: Vec<f64> = prepared.iter().map(groups_of).collect();
            let total: f64 = groups.iter().map(|g| g.weight).sum();
            let weighted = groups.iter().zip(&errors).map(|(g, e)| g.weight * e);
            let score = Score {
                functions: choice.iter().map(|i| DepthFunction::ALL[*i]).collect(),
                mean: weighted.sum::<f64>() / total,
                groups: errors,
            };
            advance(done.fetch_add(1, Ordering::Relaxed) + 1);
            score
        })
        .collect();
    scores.sort_by(|a, b| a.mean.total_cmp(&b.mean));
    let regions: usize = groups.iter().map(|g| g.regions.len()).sum();
    Ranking {
        unfinished: unfinished.into_inner() as f64 / (regions * scores.len()).max(1) as f64,
        scores,
    }
}

/// How many choices of `count` functions there are.
#[must_use]
pub fn choices_of(count: usize) -> usize {
    (0..count).fold(1, |n, i| n * (DepthFunction::ALL.len() - i) / (i + 1))
}

/// All choices, as places in [`DepthFunction::ALL`], in ascending order.
fn choices(count: usize) -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..count {
        let extended = all.iter().flat_map(|choice| {
            let next = choice.last().map_or(0, |last| last + 1);
            (next..DepthFunction::ALL.len()).map(|i| [choice.as_slice(), &[i]].concat())
        });
        all = extended.collect();
    }
    all
}

fn prepare(region: &Region) -> Prepared {
    let means = DepthFunction::ALL.map(|f| {
        region
            .depths
            .iter()
            .map(|p| p.weight * f.eval(p.depth))
            .sum()
    });
    Prepared {
        receiver: region.receiver,
        shadow: region.shadow(),
        means,
    }
}

/// 1 and the functions, made orthonormal on the grid: `rows[k]` has the coefficients of the k-th combination, which
/// are 0 if the function tells nothing that those before it do not.
fn orthonormal<const K: usize>(choice: &[usize], grid: &Grid) -> [[f64; K]; K] {
    let mut rows = [[0.0; K]; K];
    let mut made: Vec<[f64; SAMPLES]> = Vec::with_capacity(K);
    let dot = |a: &[f64; SAMPLES], b: &[f64; SAMPLES]| {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / SAMPLES as f64
    };
    for k in 0..K {
        let mut values = match k.checked_sub(1) {
            None => [1.0; SAMPLES],
            Some(i) => grid.values[choice[i]],
        };
        let mut row = [0.0; K];
        row[k] = 1.0;
        let before = dot(&values, &values).sqrt();
        // Twice is enough (W. Kahan; B. Parlett, The Symmetric Eigenvalue Problem, 1980, section 6.9).
        for _ in 0..2 {
            for (other, its_row) in made.iter().zip(&rows) {
                let shared = dot(&values, other);
                for (v, o) in values.iter_mut().zip(other) {
                    *v -= shared * o;
                }
                for (c, o) in row.iter_mut().zip(its_row) {
                    *c -= shared * o;
                }
            }
        }
        let norm = dot(&values, &values).sqrt();
        let scale = if norm > DEPENDENT * before {
            1.0 / norm
        } else {
            0.0
        };
        rows[k] = row.map(|c| c * scale);
        made.push(values.map(|v| v * scale));
    }
    rows
}

/// The mean error over regions, and how many programmes took too many steps.
fn error<const K: usize>(choice: &[usize], grid: &Grid, regions: &[Prepared]) -> (f64, usize) {
    let rows = orthonormal::<K>(choice, grid);
    let combine =
        |raw: [f64; K]| rows.map(|row| row.iter().zip(raw).map(|(c, x)| c * x).sum::<f64>());
    let raw = |value: &dyn Fn(usize) -> f64| {
        std::array::from_fn::<f64, K, _>(|k| k.checked_sub(1).map_or(1.0, |i| value(choice[i])))
    };
    let column = |z: f64| combine(raw(&|i| DepthFunction::ALL[i].eval(z)));
    let uniform: Vec<[f64; K]> = (0..SAMPLES)
        .map(|at| combine(raw(&|i| grid.values[i][at])))
        .collect();
    let mut unfinished = 0;
    let mut sum = 0.0;
    for region in regions {
        let z = region.receiver;
        let cost = |place: f64| if place < z { 1.0 } else { 0.0 };
        let mut programme = Programme::new(combine(raw(&|i| region.means[i])));
        let mut places = grid.places.to_vec();
        places.push(z);
        let costs = grid.places.iter().map(|place| cost(*place));
        programme.extend(uniform.iter().copied().zip(costs));
        programme.extend([(column(z), 0.0)]);
        let mut is_finished = programme.solve();
        for finer in FINER {
            let spacing = finer / (SAMPLES - 1) as f64;
            let support: Vec<f64> = programme.support().map(|(i, _)| places[i]).collect();
            for middle in support {
                for step in (-BESIDE..=BESIDE).filter(|step| *step != 0) {
                    let place = f64::from(step).mul_add(spacing, middle);
                    if (0.0..=1.0).contains(&place) {
                        programme.extend([(column(place), cost(place))]);
                        places.push(place);
                    }
                }
            }
            is_finished &= programme.solve();
        }
        unfinished += usize::from(!is_finished);
        sum += (region.shadow - programme.value().clamp(0.0, 1.0)).abs();
    }
    (sum / regions.len().max(1) as f64, unfinished)
}

#[cfg(test)]
mod tests {
    use super::super::{evaluate, regions};
    use super::*;

    fn group(count: usize, seed: u64) -> Group {
        Group {
            name: "made".into(),
            regions: regions(count, seed),
            weight: 1.0,
        }
    }

    #[test]
    fn every_choice_is_there_once() {
        assert_eq!(
            [1, 2, 3, 4, 5].map(choices_of),
            [37, 666, 7770, 66_045, 435_897]
        );
        let all = choices(3);
        assert_eq!(all.len(), choices_of(3));
        assert!(all.windows(2).all(|w| w[0] < w[1]));
        assert!(all.iter().all(|c| c.windows(2).all(|w| w[0] < w[1])));
    }

    /// The other way to the same figure: an interior-point method, refined until nothing changes.
    #[test]
    fn errors_are_those_of_the_exact_programmes() {
        let group = group(40, 5);
        let prepared: Vec<Prepared> = group.regions.iter().map(prepare).collect();
        let grid = Grid::new();
        let mut seen = 0;
        for choice in choices(2).iter().step_by(37) {
            let functions: Vec<DepthFunction> =
                choice.iter().map(|i| DepthFunction::ALL[*i]).collect();
            let Ok(exact) = evaluate(&functions, &group.regions) else {
                continue;
            };
            seen += 1;
            let (error, unfinished) = error::<3>(choice, &grid, &prepared);
            assert_eq!(unfinished, 0);
            assert!(
                (error - exact.mean).abs() < 2e-3 + exact.margin,
                "{functions:?} {error} {exact:?}"
            );
        }
        assert!(seen > 12, "{seen}");
    }

    /// What a function adds that others have said already is nothing.
    #[test]
    fn dependent_functions_add_nothing() {
        let group = group(30, 9);
        let prepared: Vec<Prepared> = group.regions.iter().map(prepare).collect();
        let grid = Grid::new();
        let at = |name: &str| {
            let f: DepthFunction = name.parse().unwrap();
            DepthFunction::ALL.iter().position(|g| *g == f).unwrap()
        };
        let both = [at("cosh(z)"), at("sinh(z)")];
        let three = [at("exp(z)"), at("cosh(z)"), at("sinh(z)")];
        let (two, _) = error::<3>(&both, &grid, &prepared);
        let (three, _) = error::<4>(&three, &grid, &prepared);
        assert!((two - three).abs() < 1e-6, "{two} {three}");
    }

    #[test]
    fn pairs_are_ranked() {
        let groups = [
            group(12, 1),
            Group {
                weight: 3.0,
                ..group(12, 2)
            },
        ];
        let ranking = rank(2, &groups, &|_| ());
        assert_eq!(ranking.scores.len(), choices_of(2));
        assert_eq!(ranking.unfinished, 0.0);
        assert!(ranking.scores.windows(2).all(|w| w[0].mean <= w[1].mean));
        for score in &ranking.scores {
            let mean = (score.groups[0] + 3.0 * score.groups[1]) / 4.0;
            assert!((score.mean - mean).abs() < 1e-12 && (0.0..=1.0).contains(&mean));
        }
        let variance = DepthFunction::powers(2).unwrap();
        let backwards = [variance[1], variance[0]];
        let place = ranking.place(&variance);
        assert!(place.is_some() && place == ranking.place(&backwards));
        assert_eq!(ranking.place(&variance[..1]), None);
    }
}
