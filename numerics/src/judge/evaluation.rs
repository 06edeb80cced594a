//! The paper's automated evaluation of what a shadow map should hold (\[MSM\], supplement, section
//! 6): how far from the truth are the best bounds that certain functions' means allow?
//!
//! The paper took filter regions and receivers from layered shadow maps of three scenes, which are
//! not at hand. Here regions are made: what a filter kernel sees of one to three slanted surfaces,
//! with a receiver on one of them. The figure of merit is the paper's: the mean absolute difference
//! of the lower bound to percentage-closer filtering with the same depth bias, as a share. The paper
//! solves each programme three times and finds the error that this leaves "large enough to impact
//! the ranking"; here they are refined to the end.

use rayon::prelude::*;

use super::{DepthFunction, Judge, JudgeError, Point, Range};

/// Depths that a filter kernel sees of each surface.
const TEXELS: u32 = 16;

/// What a filter kernel sees, and a receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Depths in [0, 1], with weights that add up to 1.
    pub depths: Vec<Point>,
    /// The receiver's depth, its bias included.
    pub receiver: f64,
}

impl Region {
    /// The share of depths that lie before the receiver: percentage-closer filtering.
    #[must_use]
    pub fn shadow(&self) -> f64 {
        self.depths
            .iter()
            .filter(|p| p.depth < self.receiver)
            .map(|p| p.weight)
            .sum()
    }

    /// The total weight and the functions' means.
    #[must_use]
    pub fn moments(&self, functions: &[DepthFunction]) -> Vec<f64> {
        let mean = |f: &dyn Fn(f64) -> f64| -> f64 {
            self.depths.iter().map(|p| p.weight * f(p.depth)).sum()
        };
        std::iter::once(mean(&|_| 1.0))
            .chain(functions.iter().map(|f| mean(&|z| f.eval(z))))
            .collect()
    }
}

/// Regions that a seed gives: one or two surfaces at depths from 0.1 to 0.9, in every tenth region three,
/// which cover random shares of the kernel and spread over 1e-3 to 0.1 of depth within it; the
/// receiver lies on one of them, biased by half of its spread.
#[must_use]
pub fn regions(count: usize, seed: u64) -> Vec<Region> {
    let mut random = fastrand::Rng::with_seed(seed);
    (0..count)
        .map(|_| {
            let count = match random.u32(..20) {
                0..9 => 1,
                9..18 => 2,
                _ => 3,
            };
            let surfaces: Vec<(f64, f64, f64)> = (0..count)
                .map(|_| {
                    let spread = 1e-3 * 100.0_f64.powf(random.f64());
                    let middle = 0.1 + 0.8 * random.f64();
                    (middle, spread, 0.05 + random.f64())
                })
                .collect();
            let total: f64 = surfaces.iter().map(|s| s.2).sum();
            let depths = surfaces
                .iter()
                .flat_map(|&(middle, spread, share)| {
                    (0..TEXELS).map(move |i| {
                        let across = (f64::from(i) + 0.5) / f64::from(TEXELS) - 0.5;
                        Point {
                            depth: spread.mul_add(across, middle),
                            weight: share / (total * f64::from(TEXELS)),
                        }
                    })
                })
                .collect();
            let (middle, spread, _) = surfaces[random.usize(..surfaces.len())];
            Region {
                depths,
                receiver: 0.5_f64.mul_add(-spread, middle),
            }
        })
        .collect()
}

/// How well bounds from certain functions' means do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// The mean absolute error of the lower bound as a shadow intensity, from 0 to 1: the figure by
    /// which candidates are ranked.
    pub mean: f64,
    /// The largest error.
    pub worst: f64,
    /// The mean may be off by this; see [`Judged::margin`](super::Judged::margin).
    pub margin: f64,
}

/// Evaluates a candidate for what a shadow map holds: the means of `functions`, of depths in
/// [0, 1].
///
/// # Errors
/// [`JudgeError`], for functions that depend on each other or are too many.
pub fn evaluate(functions: &[DepthFunction], regions: &[Region]) -> Result<Evaluation, JudgeError> {
    let judge = Judge::new(functions, Range::UNIT)?;
    let errors = regions
        .par_iter()
        .map(|region| {
            let (bound, margin) = judge.lower(&region.moments(functions), region.receiver)?;
            Ok(((region.shadow() - bound).abs(), margin))
        })
        .collect::<Result<Vec<_>, JudgeError>>()?;
    let count = errors.len().max(1) as f64;
    Ok(Evaluation {
        mean: errors.iter().map(|e| e.0).sum::<f64>() / count,
        worst: errors.iter().map(|e| e.0).fold(0.0, f64::max),
        margin: errors.iter().map(|e| e.1).sum::<f64>() / count,
    })
}
