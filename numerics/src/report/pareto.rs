//! What cannot be had both cheaper and better.

/// Indices of the points that no other point is at least as good as in both coordinates and better
/// than in one, where less is better; from the least first coordinate to the greatest. Of equal
/// points the first counts. What is not a number or infinite is never on the front.
#[must_use]
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|&i| points[i].0.is_finite() && points[i].1.is_finite())
        .collect();
    order.sort_by(|&i, &j| {
        let (a, b) = (points[i], points[j]);
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i].1 < least;
        least = least.min(points[i].1);
        better
    });
    order
}

#[cfg(test)]
mod tests {
    use super::pareto_front;

    #[test]
    fn of_crafted_points() {
        assert!(pareto_front(&[]).is_empty());
        // A staircase with one dominated point, in no order.
        let points = [(3.0, 1.0), (1.0, 3.0), (2.0, 2.0), (2.5, 2.5)];
        assert_eq!(pareto_front(&points), [1, 2, 0]);
        // Equal in one coordinate: the better in the other.
        assert_eq!(pareto_front(&[(1.0, 2.0), (1.0, 1.0)]), [1]);
        assert_eq!(pareto_front(&[(1.0, 1.0), (2.0, 1.0)]), [0]);
        // Twins count once.
        assert_eq!(pareto_front(&[(1.0, 1.0), (1.0, 1.0)]), [0]);
    }

    #[test]
    fn leaves_out_what_failed() {
        let points = [
            (1.0, f64::NAN),
            (f64::NAN, 0.0),
            (2.0, f64::INFINITY),
            (3.0, 0.5),
        ];
        assert_eq!(pareto_front(&points), [3]);
    }

    /// By the definition, on pseudo-random points.
    #[test]
    fn is_what_nothing_dominates() {
        let mut random = fastrand::Rng::with_seed(3);
        for _ in 0..200 {
            let points: Vec<(f64, f64)> = (0..random.usize(0..30))
                .map(|_| (f64::from(random.u8(0..12)), f64::from(random.u8(0..12))))
                .collect();
            let front = pareto_front(&points);
            for (i, p) in points.iter().enumerate() {
                let dominated = points
                    .iter()
                    .any(|q| q.0 <= p.0 && q.1 <= p.1 && (q.0 < p.0 || q.1 < p.1));
                let twin = points[..i].contains(p);
                assert_eq!(front.contains(&i), !dominated && !twin, "{i} of {points:?}");
            }
        }
    }
}
