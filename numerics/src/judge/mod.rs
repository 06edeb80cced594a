//! An independent judge of bounds: what is the least, and what the greatest share of depths below
//! `z`, over all distributions with given means of given functions of depth?
//!
//! It answers by Algorithm 1 of \[MSM\] (C. Peters, R. Klein: *Moment Shadow Mapping*, 2015): a
//! linear programme over weights of sampled depths, which knows nothing of the theory of moments
//! and works for any functions. As in the supplement's section 6 it begins with 251 uniform samples
//! and is solved again with more of them near the support points of the last solution; unlike
//! there it goes on until the bound is exact to rounding, and proves it. The programme itself is
//! solved by `clarabel`, an interior-point method, to twelve digits (a simplex method in `f64`
//! stops at eight, and those that are there keep the dual solution, the proof, to themselves).
//!
//! # How exact
//! On a grid with spacing h alone, a bound is too tight by about D h²/8, where D is the second
//! derivative of the dual function at the support points: 1e-5 to 1e-3 for 251 samples and 4 to 10
//! moments. Each round divides the spacing by 16 there. Every result carries a
//! [`margin`](Judged::margin) within which the exact bounds lie, from the dual function: typically
//! 1e-12. It grows with the bound's [`sensitivity`](Judged::sensitivity) to the moments, that is,
//! where few distributions have them; beyond [`SENSITIVITY_LIMIT`] the bounds are those of moments
//! that differ by [`residual`](Judged::residual), since no `f64` programme can tell them apart.
//!
//! # Example
//! Half of the depths at 0.2, half at 0.8, known by two moments (Cantelli's inequality):
//! ```
//! use hankel_numerics::judge::{DepthFunction, Judge, Range};
//!
//! let judge = Judge::new(&DepthFunction::powers(2)?, Range::Line)?;
//! let judged = judge.bounds(&[1.0, 0.5, 0.34], 0.9)?;
//! assert!((judged.lower - 0.64).abs() < 1e-9);
//! assert!((judged.upper - 1.0).abs() < 1e-9);
//! # Ok::<(), hankel_numerics::judge::JudgeError>(())
//! ```

mod candidates;
mod evaluation;
mod feasible;
mod functions;
mod programme;
mod simplex;
mod system;
mod table;

pub use candidates::{Group, MOST_FUNCTIONS, Ranking, Score, choices_of, rank};
pub use evaluation::{Evaluation, Region, evaluate, regions};
pub use functions::DepthFunction;
pub use programme::SENSITIVITY_LIMIT;
pub use table::{TableError, table};

use programme::{Least, Side, least};
use system::{Instance, System};

/// The depths that a distribution may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// From `low` to `high`, both included.
    Interval {
        /// The least depth.
        low: f64,
        /// The greatest depth.
        high: f64,
    },
    /// Any real number (Hamburger's problem).
    Line,
}

impl Range {
    /// Depths from 0 to 1.
    pub const UNIT: Self = Self::Interval {
        low: 0.0,
        high: 1.0,
    };
    /// Depths from -1 to 1.
    pub const SYMMETRIC: Self = Self::Interval {
        low: -1.0,
        high: 1.0,
    };
}

/// Why there is no judgement.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum JudgeError {
    /// A name that no function has.
    #[error(
        "there is no depth function `{text}`; there are: {}, and powers up to z^{}",
        known(),
        DepthFunction::MAX_POWER
    )]
    UnknownFunction {
        /// What was given.
        text: String,
    },
    /// Too few functions or too many.
    #[error("{count} functions of depth; give 1 to {}", DepthFunction::MAX_POWER)]
    FunctionCount {
        /// How many.
        count: usize,
    },
    /// An interval that is none.
    #[error("depths from {low} to {high} are no range; give two finite numbers, the lower first")]
    Range {
        /// The given least depth.
        low: f64,
        /// The given greatest depth.
        high: f64,
    },
    /// A function that is not defined on the whole range.
    #[error(
        "{function} has no finite value at depth {z}, which the range includes; give a narrower range"
    )]
    Domain {
        /// The function.
        function: DepthFunction,
        /// The depth.
        z: f64,
    },
    /// Functions that have no bound on the line.
    #[error(
        "without a range of depths the functions must be z, z^2, and so on up to an even power, in this order; give these, or a range"
    )]
    Line,
    /// A function that tells nothing new.
    #[error(
        "{function} is a combination of 1 and the functions before it, or too nearly so for f64; leave it out"
    )]
    Dependent {
        /// The function.
        function: DepthFunction,
    },
    /// Not as many moments as functions.
    #[error("{given} moments; {wanted} are wanted: the total weight, and one for each function")]
    MomentCount {
        /// How many there are.
        given: usize,
        /// How many there should be.
        wanted: usize,
    },
    /// A moment that is no number.
    #[error("m{index} = {value} is not finite")]
    Moment {
        /// Which.
        index: usize,
        /// What it is.
        value: f64,
    },
    /// A total weight that no distribution has.
    #[error("m0 = {value} is not a total weight; it must be positive")]
    Mass {
        /// What it is.
        value: f64,
    },
    /// Even moments that are far from possible.
    #[error(
        "no distribution has these moments: (1 + x^2)^n would have a mean that is not positive, for depths x about their mean"
    )]
    EvenMoment,
    /// Moments too large.
    #[error(
        "the moments overflow when they are moved to the middle of the range; scale the depths"
    )]
    Overflow,
    /// A query that is no number.
    #[error("z = {z} is not a number")]
    Query {
        /// What it is.
        z: f64,
    },
    /// Moments that no distribution has.
    #[error(
        "no distribution in the range has these moments: the nearest that one has are {distance:.2e} away (in an orthogonal basis of the functions' span, relative to the total weight)"
    )]
    Infeasible {
        /// The sum of the moments' distances.
        distance: f64,
    },
    /// The solver broke down.
    #[error("the linear programme could not be solved: {status}")]
    Solver {
        /// The solver's words.
        status: String,
    },
}

fn known() -> String {
    DepthFunction::ALL.map(|f| f.to_string()).join(", ")
}

/// A depth with a weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The depth.
    pub depth: f64,
    /// The weight, in the unit of the zeroth moment.
    pub weight: f64,
}

/// The bounds of what lies below a depth.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// The least weight strictly below `z`, from 0 to m0. Never above the exact one but by
    /// rounding.
    pub lower: f64,
    /// The greatest weight at or below `z`, from 0 to m0. Never below the exact one but by
    /// rounding.
    pub upper: f64,
    /// The exact bounds are within this of the given ones, in the unit of m0.
    ///
    /// Where [`residual`](Self::residual) is 0, this is proved: there are distributions with the moments, up to their
    /// rounding to `f64`, that have no more than the bound and this. Elsewhere it is an estimate: it counts to first order
    /// what the solver misses of the moments, which may be too little, and is m0 where
    /// [`sensitivity`](Self::sensitivity) reaches its limit, [`SENSITIVITY_LIMIT`].
    pub margin: f64,
    /// How far the moments of the supports are from the given ones, beyond rounding: the larger sum
    /// of distances of the two, in an orthogonal basis, relative to the total weight. 0 where distributions with the
    /// moments were found near the supports of both.
    pub residual: f64,
    /// The largest derivative of a bound to a moment, in that basis and that unit.
    pub sensitivity: f64,
    /// A distribution that attains the lower bound. On the line, what lies at infinity is left out.
    pub lower_support: Vec<Point>,
    /// A distribution that attains the upper bound.
    pub upper_support: Vec<Point>,
}

/// A judge of bounds for certain functions and a range of depths.
#[derive(Clone, Debug)]
pub struct Judge {
    system: System,
    count: usize,
    rounds: usize,
}

/// Rounds after which nothing is left to refine.
const ROUNDS: usize = 10;

/// The distance at which moments are no longer taken for rounded ones of a distribution.
const INFEASIBLE: f64 = 1e-9;

impl Judge {
    /// A judge for the means of `functions` over distributions on `range`.
    ///
    /// # Errors
    /// [`JudgeError`], if the functions are too many, depend on each other or are not defined on
    /// the range.
    pub fn new(functions: &[DepthFunction], range: Range) -> Result<Self, JudgeError> {
        Ok(Self {
            system: System::new(functions, range)?,
            count: functions.len() + 1,
            rounds: ROUNDS,
        })
    }

    /// Solves each programme no more than `rounds` times, where the paper's evaluation does so
    /// three times. The [`margin`](Judged::margin) tells what is lost. With fewer than ten, moments
    /// that no distribution has are not refused, since the samples may be what is missing: their
    /// margin is m0, and the [`residual`](Judged::residual) tells.
    #[must_use]
    pub fn rounds(self, rounds: usize) -> Self {
        Self { rounds, ..self }
    }

    /// The sharp bounds of the weight below `z` over all distributions with these moments: the
    /// total weight m0 > 0, then the sum of weight times function, for each function in order.
    ///
    /// # Errors
    /// [`JudgeError`], for moments that are not finite, too few or too many, or that no
    /// distribution has: the error says how far the nearest are that one has.
    pub fn bounds(&self, moments: &[f64], z: f64) -> Result<Judged, JudgeError> {
        let (instance, query) = self.instance(moments, z)?;
        let below = self.least(&instance, query, Side::Below)?;
        let above = self.least(&instance, query, Side::Above)?;
        let (mass, total) = (moments[0], instance.total);
        Ok(Judged {
            lower: (below.value * total).clamp(0.0, mass),
            upper: (mass - above.value * total).clamp(0.0, mass),
            margin: (below.margin.max(above.margin) * total + 2.0 * f64::EPSILON * mass).min(mass),
            residual: below.residual.max(above.residual),
            sensitivity: below.sensitivity.max(above.sensitivity),
            lower_support: below.points(&instance),
            upper_support: above.points(&instance),
        })
    }

    /// The lower bound alone, and its margin.
    fn lower(&self, moments: &[f64], z: f64) -> Result<(f64, f64), JudgeError> {
        let (instance, query) = self.instance(moments, z)?;
        let below = self.least(&instance, query, Side::Below)?;
        let total = instance.total;
        let value = (below.value * total).clamp(0.0, moments[0]);
        Ok((value, (below.margin * total).min(moments[0])))
    }

    /// Moments and query in the programme's terms.
    fn instance(&self, moments: &[f64], z: f64) -> Result<(Instance<'_>, f64), JudgeError> {
        if moments.len() != self.count {
            return Err(JudgeError::MomentCount {
                given: moments.len(),
                wanted: self.count,
            });
        }
        for (index, &value) in moments.iter().enumerate() {
            if !value.is_finite() {
                return Err(JudgeError::Moment { index, value });
            }
        }
        if moments[0].is_nan() || moments[0] <= 0.0 {
            return Err(JudgeError::Mass { value: moments[0] });
        }
        if z.is_nan() {
            return Err(JudgeError::Query { z });
        }
        let instance = self.system.instance(moments)?;
        let query = instance.coordinate(z);
        Ok((instance, query))
    }

    fn least(&self, instance: &Instance<'_>, query: f64, side: Side) -> Result<Least, JudgeError> {
        let least = least(instance, query, side, self.rounds)?;
        // Prices below their limit are those at which all moments are met. With samples that are
        // still coarse, the limit is met by moments of a distribution between them, too.
        let is_refined = self.rounds >= ROUNDS;
        let is_bounded = least.sensitivity > 0.5 * SENSITIVITY_LIMIT;
        if is_refined && is_bounded && least.residual > INFEASIBLE {
            return Err(JudgeError::Infeasible {
                distance: least.residual,
            });
        }
        Ok(least)
    }
}
