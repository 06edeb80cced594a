//! Six moment shadow mapping.

use hankel_moments::{Bounds, Moments6};

use super::{Float, cholesky_solve, root};

/// Both bounds, from the 4x4 Cholesky factorisation, the cubic's roots and the interpolation
/// polynomial.
#[must_use]
pub fn six_moments<T: Float>(m: Moments6<T>, z: T) -> Bounds<T> {
    let one = T::round(1.0);
    let b = [one, m.b1, m.b2, m.b3, m.b4, m.b5, m.b6];
    let mut hankel = [[T::default(); 4]; 4];
    for (i, row) in hankel.iter_mut().enumerate() {
        row.copy_from_slice(&b[i..i + 4]);
    }
    let c = cholesky_solve(4, &hankel, &[one, z, z * z, z * z * z]);
    let others = cubic_roots(c);
    let share = |own: f64| interpolated(z, T::round(own), others, [m.b1, m.b2, m.b3]);
    Bounds {
        lower: share(0.0),
        upper: share(1.0),
    }
}

/// Roots of a cubic with three real roots, lowest coefficient first, by the cosine of a third of an
/// angle (J. Blinn, *How to Solve a Cubic Equation, Part 5*, 2007).
fn cubic_roots<T: Float>(c: [T; 4]) -> [T; 3] {
    let third = T::round(1.0 / 3.0);
    let (x, y, z) = (c[0] / c[3], c[1] / c[3] * third, c[2] / c[3] * third);
    let delta = [-z * z + y, -y * z + x, z * x - y * y];
    let discriminant = T::round(4.0) * delta[0] * delta[2] - delta[1] * delta[1];
    let depressed = [-(z + z) * delta[0] + delta[1], delta[0]];
    let theta = T::atan2(root(discriminant), -depressed[0]) * third;
    let (cos, sin) = (Float::cos(theta), Float::sin(theta));
    let half = T::round(-0.5);
    let side = T::round(0.5 * 3.0_f64.sqrt());
    let scale = root(-depressed[1]) * T::round(2.0);
    [cos, half * cos - side * sin, half * cos + side * sin].map(|x| scale * x - z)
}

/// The mean of the polynomial that is `own` at `z` and at the other points 1 below it and 0 above, by
/// divided differences.
fn interpolated<T: Float>(z: T, own: T, others: [T; 3], moments: [T; 3]) -> T {
    let zero = T::default();
    let one = T::round(1.0);
    let side = |x: T| if x < z { one } else { zero };
    let x = [z, others[0], others[1], others[2]];
    let mut d = [own, side(x[1]), side(x[2]), side(x[3])];
    for k in 1..4 {
        for i in (k..4).rev() {
            d[i] = (d[i] - d[i - 1]) / (x[i] - x[i - k]);
        }
    }
    // Newton's form to powers.
    let mut p = [d[3], zero, zero, zero];
    for i in (0..3).rev() {
        for k in (1..4).rev() {
            p[k] = p[k - 1] - x[i] * p[k];
        }
        p[0] = d[i] - x[i] * p[0];
    }
    p[0] + p[1] * moments[0] + p[2] * moments[1] + p[3] * moments[2]
}
