//! The trigonometric bound in 300 bits, by another way than the kernel's: K from the covariance's adjugate, the arc in
//! the vector of half the angle, and Newton's method until nothing changes.

use std::sync::OnceLock;

use hankel_dsl::Real;

use crate::numbers::Wide;

/// Steps of the search at most: bisections included.
const STEPS: usize = 400;

/// Below this a step changes nothing: its square is less than a rounding.
const SHORT: f64 = 1e-46;

fn wide(x: f64) -> Wide {
    Wide::from(x)
}

/// π, by Machin's formula.
pub fn pi() -> Wide {
    static PI: OnceLock<Wide> = OnceLock::new();
    *PI.get_or_init(|| {
        let arctangent_of_one_over = |k: f64| {
            let x = wide(1.0) / wide(k);
            let mut power = x;
            let mut sum = wide(0.0);
            for n in 0..220 {
                sum += power / wide(f64::from(2 * n + 1));
                power *= -(x * x);
            }
            sum
        };
        wide(16.0) * arctangent_of_one_over(5.0) - wide(4.0) * arctangent_of_one_over(239.0)
    })
}

/// Cosine and sine of πz for z from 0 to 1, by Taylor's series about 1/2 with 80 terms: what remains is below 1e-100.
pub fn half_angle<R: Real + From<f64>>(z: R, pi: R) -> (R, R) {
    let x = (z - R::from(0.5)) * pi;
    let (mut cos, mut sin) = (R::from(0.0), R::from(0.0));
    let mut term = R::from(1.0);
    for k in 0..40 {
        let k = f64::from(2 * k);
        cos += term;
        term = term * x / R::from(k + 1.0);
        sin += term;
        term = -(term * x / R::from(k + 2.0));
    }
    (-sin, cos)
}

/// The least and the greatest share below depth z of distributions with moments c1, s1, c2, s2, which must be those of
/// one that is not degenerate. z is clamped to [0, 1].
pub fn bounds(m: [Wide; 4], z: Wide) -> [Wide; 2] {
    let [c1, s1, c2, s2] = m;
    let (zero, one) = (wide(0.0), wide(1.0));
    // Exact at both ends.
    let query = if z <= zero {
        Vector { x: one, y: zero }
    } else if z >= one {
        Vector { x: -one, y: zero }
    } else {
        let (x, y) = half_angle(z, pi());
        Vector { x, y }
    };
    let mirrored = Vector {
        x: -query.x,
        y: query.y,
    };
    [lower(m, query), one - lower([c1, -s1, c2, -s2], mirrored)]
}

#[derive(Clone, Copy)]
struct Vector {
    x: Wide,
    y: Wide,
}

impl Vector {
    fn normalized(self) -> Self {
        let length = (self.x * self.x + self.y * self.y).sqrt();
        Self {
            x: self.x / length,
            y: self.y / length,
        }
    }

    /// The direction with twice the angle.
    fn doubled(self) -> Self {
        Self {
            x: self.x * self.x - self.y * self.y,
            y: wide(2.0) * self.x * self.y,
        }
    }

    fn cross(self, other: Self) -> Wide {
        self.x * other.y - self.y * other.x
    }
}

/// K and the inverse of the covariance.
struct Kernel {
    mean: Vector,
    xx: Wide,
    xy: Wide,
    yy: Wide,
}

impl Kernel {
    fn new([c1, s1, c2, s2]: [Wide; 4]) -> Self {
        let (one, half) = (wide(1.0), wide(0.5));
        let xx = (one + c2) * half - c1 * c1;
        let yy = (one - c2) * half - s1 * s1;
        let xy = s2 * half - c1 * s1;
        let determinant = xx * yy - xy * xy;
        Self {
            mean: Vector { x: c1, y: s1 },
            xx: yy / determinant,
            xy: -xy / determinant,
            yy: xx / determinant,
        }
    }

    fn product(&self, a: Vector, b: Vector) -> Wide {
        a.x * (self.xx * b.x + self.xy * b.y) + a.y * (self.xy * b.x + self.yy * b.y)
    }

    fn relative(&self, a: Vector) -> Vector {
        Vector {
            x: a.x - self.mean.x,
            y: a.y - self.mean.y,
        }
    }

    fn value(&self, a: Vector, b: Vector) -> Wide {
        wide(1.0) + self.product(self.relative(a), self.relative(b))
    }

    /// Half the angle of the first direction from depth 0 on where K with `a` is 0; there it is `at_start`.
    fn zero(&self, a: Vector, at_start: Wide) -> Vector {
        let a = self.relative(a);
        let x = self.xx * a.x + self.xy * a.y;
        let y = self.xy * a.x + self.yy * a.y;
        let sign = wide(if at_start < wide(0.0) { -1.0 } else { 1.0 });
        let (start, mixed) = (sign * at_start, sign * y);
        let west = sign * (at_start - wide(2.0) * x);
        let disk = mixed * mixed - start * west;
        let root = disk.max(wide(0.0)).sqrt();
        let vector = if mixed > wide(0.0) {
            Vector {
                x: -west,
                y: mixed + root,
            }
        } else {
            Vector {
                x: root - mixed,
                y: start,
            }
        };
        vector.normalized()
    }
}

fn lower(m: [Wide; 4], query: Vector) -> Wide {
    let (zero, one, two) = (wide(0.0), wide(1.0), wide(2.0));
    let kernel = Kernel::new(m);
    let s = Vector { x: one, y: zero };
    let q = query.doubled();
    let (a, c, d) = (kernel.value(s, s), kernel.value(q, q), kernel.value(s, q));
    if d < zero {
        let low = kernel.zero(q, d);
        let high = kernel.zero(s, a);
        return one
            / greatest(low, high, |half| {
                // 1/w and two derivatives to the angle.
                let x = half.doubled();
                let tangent = Vector { x: -x.y, y: x.x };
                let (from_mean, to_s, to_q) =
                    (kernel.relative(x), kernel.relative(s), kernel.relative(q));
                let (own, ks, kq) = (kernel.value(x, x), kernel.value(x, s), kernel.value(x, q));
                let (ds, dq) = (kernel.product(tangent, to_s), kernel.product(tangent, to_q));
                let (bs, bq) = (-kernel.product(x, to_s), -kernel.product(x, to_q));
                let bend = kernel.product(tangent, tangent) - kernel.product(x, from_mean);
                [
                    own - ks * kq / d,
                    two * kernel.product(tangent, from_mean) - (ds * kq + ks * dq) / d,
                    two * bend - (bs * kq + two * ds * dq + ks * bq) / d,
                ]
            });
    }
    if query.x * (kernel.mean.x - one) + query.y * kernel.mean.y <= zero {
        return zero;
    }
    let small = a.min(c);
    let at_ends = if d >= small || query.y == zero {
        one / small
    } else {
        (a + c - two * d) / (a * c - d * d)
    };
    (one - at_ends).max(zero)
}

/// The greatest value between two half angles of a function whose logarithm is concave: given are its value and two
/// derivatives.
fn greatest(mut low: Vector, mut high: Vector, function: impl Fn(Vector) -> [Wide; 3]) -> Wide {
    let zero = wide(0.0);
    let [at_low, slope_low, _] = function(low);
    if slope_low <= zero {
        return at_low;
    }
    let [at_high, slope_high, _] = function(high);
    if slope_high >= zero {
        return at_high;
    }
    let middle = |a: Vector, b: Vector| {
        Vector {
            x: a.x + b.x,
            y: a.y + b.y,
        }
        .normalized()
    };
    let mut here = middle(low, high);
    let mut greatest = at_low.max(at_high);
    for _ in 0..STEPS {
        let [value, slope, bend] = function(here);
        greatest = greatest.max(value);
        if slope > zero {
            low = here;
        } else {
            high = here;
        }
        let slope = slope / value;
        let bend = bend / value - slope * slope;
        // Half the angle's step.
        let step = -(slope / bend) * wide(0.5);
        if step.abs() < wide(SHORT) {
            break;
        }
        let next = Vector {
            x: here.x - step * here.y,
            y: here.y + step * here.x,
        }
        .normalized();
        let is_inside = bend < zero
            && step.abs() < wide(0.5)
            && low.cross(next) >= zero
            && next.cross(high) >= zero;
        here = if is_inside { next } else { middle(low, high) };
    }
    greatest
}
