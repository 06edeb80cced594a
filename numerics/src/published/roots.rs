//! Real roots of polynomials that have no others.

use super::{Float, root};

/// Steps after which a bracket has no number left between its ends.
const STEPS: usize = 200;

/// All roots of a polynomial, lowest coefficient first; infinity for each that its leading
/// coefficients, being 0, leave out.
pub fn real_roots<T: Float>(p: &[T]) -> Vec<T> {
    let degree = p.len() - 1;
    match degree {
        0 => Vec::new(),
        1 => vec![-p[0] / p[1]],
        2 => quadratic(p[0], p[1], p[2]),
        _ => bracketed(p),
    }
}

/// W. Kahan, *On the Cost of Floating-Point Computation Without Extra-Precise Arithmetic*, 2004: the
/// discriminant with one rounding, and the sum that does not cancel.
fn quadratic<T: Float>(c: T, b: T, a: T) -> Vec<T> {
    let half = b * T::round(-0.5);
    let product = a * c;
    let error = T::fused(a, c, -product);
    let discriminant = T::fused(half, half, -product) - error;
    let root = root(discriminant);
    let sum = if half < T::default() {
        half - root
    } else {
        half + root
    };
    vec![sum / a, c / sum]
}

/// Newton's steps in brackets made by the roots of the derivative (C. Yuksel, *High-Performance
/// Polynomial Root Finding for Graphics*, 2022).
fn bracketed<T: Float>(p: &[T]) -> Vec<T> {
    let degree = p.len() - 1;
    if p[degree] == T::default() {
        let mut roots = real_roots(&p[..degree]);
        roots.push(T::INFINITY);
        return roots;
    }
    let derivative: Vec<T> = (1..=degree).map(|k| p[k] * T::round(k as f64)).collect();
    let mut turns: Vec<T> = real_roots(&derivative)
        .into_iter()
        .filter(|t| t.widen().is_finite())
        .collect();
    turns.sort_by(|a, b| a.widen().total_cmp(&b.widen()));
    let mut roots = Vec::new();
    for i in 0..=turns.len() {
        let low = i.checked_sub(1).map(|i| turns[i]);
        let high = turns.get(i).copied();
        let bracket = match (low, high) {
            (Some(low), Some(high)) => Some((low, high)),
            (Some(low), None) => beyond(p, low, T::round(1.0)).map(|high| (low, high)),
            (None, Some(high)) => beyond(p, high, T::round(-1.0)).map(|low| (low, high)),
            (None, None) => None,
        };
        roots.push(bracket.map_or(T::INFINITY, |(low, high)| within(p, &derivative, low, high)));
    }
    roots.resize(degree, T::INFINITY);
    roots
}

fn value<T: Float>(p: &[T], x: T) -> T {
    p.iter().rev().fold(T::default(), |sum, &c| sum * x + c)
}

/// A place beyond the outermost turn where the polynomial has the other sign.
fn beyond<T: Float>(p: &[T], from: T, mut step: T) -> Option<T> {
    let sign = value(p, from) < T::default();
    let mut x = from + step;
    while x.widen().is_finite() {
        let there = value(p, x);
        if !there.widen().is_finite() {
            return None;
        }
        if (there < T::default()) != sign {
            return Some(x);
        }
        step = step + step;
        x = from + step;
    }
    None
}

fn within<T: Float>(p: &[T], derivative: &[T], mut low: T, mut high: T) -> T {
    let is_negative = value(p, low) < T::default();
    let mut x = (low + high) * T::round(0.5);
    for _ in 0..STEPS {
        let here = value(p, x);
        if (here < T::default()) == is_negative {
            low = x;
        } else {
            high = x;
        }
        let newton = x - here / value(derivative, x);
        let next = if newton > low && newton < high {
            newton
        } else {
            (low + high) * T::round(0.5)
        };
        if next == x {
            break;
        }
        x = next;
    }
    x
}
