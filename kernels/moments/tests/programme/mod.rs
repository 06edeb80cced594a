//! Algorithm 1: bounds by linear programming over distributions on a grid, which knows nothing of
//! moments' theory.

use microlp::{ComparisonOp, OptimizationDirection, Problem};

/// The least and the greatest share of `counts`, over all distributions on `grid` for which each
/// function has the mean given; none if the solver finds no distribution. The least leaves out what
/// lies on the query point, the greatest has it.
pub fn bounds(
    functions: &[(&dyn Fn(f64) -> f64, f64)],
    grid: &[f64],
    least: impl Fn(f64) -> bool,
    greatest: impl Fn(f64) -> bool,
) -> Option<(f64, f64)> {
    let solve = |direction, counts: &dyn Fn(f64) -> bool| {
        let mut problem = Problem::new(direction);
        let weights: Vec<_> = grid
            .iter()
            .map(|z| problem.add_var(f64::from(u8::from(counts(*z))), (0.0, 1.0)))
            .collect();
        let mut require = |f: &dyn Fn(f64) -> f64, mean: f64| {
            let row: Vec<_> = weights.iter().zip(grid).map(|(w, z)| (*w, f(*z))).collect();
            problem.add_constraint(row, ComparisonOp::Eq, mean);
        };
        require(&|_| 1.0, 1.0);
        for (f, mean) in functions {
            require(f, *mean);
        }
        problem.solve().ok().map(|solution| solution.objective())
    };
    Some((
        solve(OptimizationDirection::Minimize, &least)?,
        solve(OptimizationDirection::Maximize, &greatest)?,
    ))
}
