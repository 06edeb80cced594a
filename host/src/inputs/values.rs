//! Single numbers, and groups of numbers that only make sense together: moments, unit vectors.

use fastrand::Rng;
use hankel_dsl::glam::Vec4;
use hankel_dsl::native::describe::{Scalar, TexelFormat};

use super::Class;
use crate::device::TextureShape;
use crate::flat::{Leaf, Number};

/// Makes numbers of one class.
#[derive(Clone, Debug)]
pub struct Values {
    /// Where chance comes from.
    pub rng: Rng,
    /// What they are like.
    pub class: Class,
    /// The smallest and the largest magnitude of absurd numbers other than zero.
    pub magnitudes: (f64, f64),
}

/// What a number is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Domain {
    /// From one value to another.
    Range(f64, f64),
    /// Of any magnitude between two positive ones.
    Magnitude(f64, f64),
}

/// The domain of numbers with a certain name, for fields whose documentation gives no range. The
/// last part of the name counts: `settings.moment_bias` is a bias.
#[must_use]
pub fn by_name(path: &str) -> Option<Domain> {
    let last = path
        .rsplit(['.', '_'])
        .find(|p| !matches!(*p, "" | "x" | "y" | "z" | "w"))?;
    let last = last.split('[').next().unwrap_or(last);
    Some(match last {
        // Biases and strengths of biases as published lie between these.
        "bias" | "strength" => Domain::Magnitude(1e-7, 1e-2),
        "depth" | "receiver" | "visibility" | "shadow" | "weight" | "leak" | "cut"
        | "intensity" | "reduction" | "uv" | "opacity" | "alpha" => Domain::Range(0.0, 1.0),
        // A list of weights sums to about one.
        "weights" => Domain::Range(0.0, 0.15),
        "radius" | "taps" => Domain::Range(0.0, 4.0),
        "sigma" => Domain::Range(0.5, 4.0),
        "scale" | "size" | "width" | "height" => Domain::Range(0.5, 2.0),
        _ => return None,
    })
}

/// The range that a field's documentation gives: the first `[a, b]` or `from a to b`.
#[must_use]
pub fn documented(summary: &str) -> Option<Domain> {
    let number = |text: &str| {
        let text = text.trim().trim_end_matches(['.', ',', ';', ')']);
        text.parse::<f64>().ok().filter(|x| x.is_finite())
    };
    let range = |a: &str, b: &str| {
        let (a, b) = (number(a)?, number(b)?);
        (a <= b).then_some(Domain::Range(a, b))
    };
    let bracketed = summary.match_indices('[').find_map(|(i, _)| {
        let (inside, _) = summary[i + 1..].split_once(']')?;
        let (a, b) = inside.split_once(',')?;
        range(a, b)
    });
    bracketed.or_else(|| {
        let words: Vec<&str> = summary.split_whitespace().collect();
        words.windows(4).find_map(|w| match w {
            ["from", a, "to", b] => range(a, b),
            _ => None,
        })
    })
}

/// The number of a moment field: `b1` is 1, `moments.b4` is 4.
fn moment(path: &str) -> Option<i32> {
    let name = path.rsplit('.').next()?;
    let order: i32 = name.strip_prefix('b')?.parse().ok()?;
    (1..=16).contains(&order).then_some(order)
}

impl Values {
    /// `count` elements of `stride` bytes.
    pub fn elements(
        &mut self,
        name: &str,
        leaves: &[Leaf],
        stride: usize,
        count: usize,
        is_uniform: bool,
    ) -> Vec<u8> {
        let mut bytes = vec![0; stride * count];
        for element in bytes.chunks_exact_mut(stride.max(1)) {
            self.element(name, leaves, element, is_uniform);
        }
        bytes
    }

    fn element(&mut self, name: &str, leaves: &[Leaf], element: &mut [u8], is_uniform: bool) {
        // Moments of the same element belong to the same depths.
        let depths = self.depths();
        let unit = self.unit_vector();
        let mut axis = 0;
        for leaf in leaves {
            let path = crate::flat::join(name, &leaf.path);
            let is_float = matches!(leaf.scalar, Scalar::F32 | Scalar::F64);
            let meaningful = is_float && self.class != Class::Hostile;
            let number = if let Some(order) = moment(&path).filter(|_| meaningful) {
                depths.iter().map(|(z, w)| w * z.powi(order)).sum()
            } else if meaningful && is_normal(&path) {
                axis += 1;
                unit[(axis - 1) % 3]
            } else {
                let domain = documented(&leaf.summary).or_else(|| by_name(&path));
                match leaf.scalar {
                    Scalar::F32 => self.float(domain, false),
                    Scalar::F64 => self.float(domain, true),
                    Scalar::U32 | Scalar::I32 => {
                        let value = self.integer(leaf.scalar, domain, is_uniform);
                        value.write(&mut element[leaf.offset..]);
                        continue;
                    }
                }
            };
            if leaf.scalar == Scalar::F64 {
                Number::F64(number)
            } else {
                Number::F32(number as f32)
            }
            .write(&mut element[leaf.offset..]);
        }
    }

    /// One to six depths with weights that sum to one.
    fn depths(&mut self) -> Vec<(f64, f64)> {
        let low = if self.rng.bool() { 0.0 } else { -1.0 };
        let count = match self.class {
            // One surface, or two in almost the same place: where the moment problem degenerates.
            Class::Edge => self.rng.usize(1..=2),
            Class::Ordinary | Class::Hostile => self.rng.usize(1..=6),
        };
        let mut depths: Vec<(f64, f64)> = (0..count)
            .map(|_| (low + (1.0 - low) * self.rng.f64(), 0.01 + self.rng.f64()))
            .collect();
        if self.class == Class::Edge {
            for d in &mut depths {
                d.0 = match self.rng.u32(..4) {
                    0 => low,
                    1 => 1.0,
                    2 => 0.0,
                    _ => d.0,
                };
            }
            if count == 2 && self.rng.bool() {
                // Inwards: what lies at an end stays in the range.
                depths[1].0 = depths[0].0 - depths[0].0.signum() * 1e-4 * self.rng.f64();
            }
        }
        let sum: f64 = depths.iter().map(|d| d.1).sum();
        for d in &mut depths {
            d.1 /= sum;
        }
        depths
    }

    fn unit_vector(&mut self) -> [f64; 3] {
        if self.class == Class::Edge {
            let mut v = [0.0; 3];
            v[self.rng.usize(..3)] = if self.rng.bool() { 1.0 } else { -1.0 };
            return v;
        }
        loop {
            let v = [(); 3].map(|()| self.rng.f64() * 2.0 - 1.0);
            let square: f64 = v.iter().map(|x| x * x).sum();
            if (1e-3..=1.0).contains(&square) {
                return v.map(|x| x / square.sqrt());
            }
        }
    }

    fn float(&mut self, domain: Option<Domain>, double: bool) -> f64 {
        let domain = domain.unwrap_or(Domain::Range(-1.0, 1.0));
        match (self.class, domain) {
            (Class::Ordinary, Domain::Range(a, b)) => a + (b - a) * self.rng.f64(),
            (Class::Ordinary, Domain::Magnitude(a, b)) => a * (b / a).powf(self.rng.f64()),
            (Class::Edge, Domain::Range(a, b) | Domain::Magnitude(a, b)) => {
                let t = self.rng.f64();
                let near = 1e-6 * t;
                match self.rng.u32(..8) {
                    0 => a,
                    1 => b,
                    2 => 0.5 * (a + b),
                    3 => a + (b - a) * near,
                    4 => b - (b - a) * near,
                    5 => 0.0f64.clamp(a, b),
                    6 => (b - a) * near + 0.0f64.clamp(a, b),
                    _ => a + (b - a) * t,
                }
            }
            (Class::Hostile, _) => self.absurd(double),
        }
    }

    /// Any finite number, the extreme ones often.
    fn absurd(&mut self, double: bool) -> f64 {
        let (least, most) = self.magnitudes;
        loop {
            let x = self.any_absurd(double);
            if x == 0.0 || (least..=most).contains(&x.abs()) {
                return x;
            }
        }
    }

    fn any_absurd(&mut self, double: bool) -> f64 {
        let (largest, normal, least) = if double {
            (f64::MAX, f64::MIN_POSITIVE, f64::from_bits(1))
        } else {
            (
                f32::MAX.into(),
                f32::MIN_POSITIVE.into(),
                f32::from_bits(1).into(),
            )
        };
        let sign = if self.rng.bool() { 1.0 } else { -1.0 };
        sign * match self.rng.u32(..12) {
            0 => 0.0,
            1 => least,
            2 => normal * self.rng.f64(),
            3 => normal,
            4 => largest,
            5 => largest * self.rng.f64(),
            6 => 1e30,
            7 => 1e-30,
            8 => 1e6 * self.rng.f64(),
            9 => self.rng.f64(),
            _ => loop {
                let x = if double {
                    f64::from_bits(self.rng.u64(..))
                } else {
                    f32::from_bits(self.rng.u32(..)).into()
                };
                if x.is_finite() {
                    break x;
                }
            },
        }
    }

    fn integer(&mut self, scalar: Scalar, domain: Option<Domain>, is_uniform: bool) -> Number {
        let bounds = match domain {
            Some(Domain::Range(a, b) | Domain::Magnitude(a, b)) => Some((a as i64, b as i64)),
            None if is_uniform => Some((0, 8)),
            None => None,
        };
        let (a, b) = bounds.unwrap_or(match scalar {
            Scalar::I32 => (i32::MIN.into(), i32::MAX.into()),
            _ => (0, u32::MAX.into()),
        });
        let b = b.max(a);
        // The ends, 0, 1, -1 and their neighbours come often: divisors and masks are made of them.
        let special = match self.class {
            Class::Ordinary => 4,
            Class::Edge | Class::Hostile => 2,
        };
        let value = if self.rng.u32(..special) == 0 {
            let some = [a, b, 0, 1, -1, 2, a.saturating_add(1), b.saturating_sub(1)];
            some[self.rng.usize(..some.len())].clamp(a, b)
        } else {
            self.rng.i64(a..=b)
        };
        match scalar {
            Scalar::I32 => Number::I32(value.clamp(i32::MIN.into(), i32::MAX.into()) as i32),
            _ => Number::U32(value.clamp(0, u32::MAX.into()) as u32),
        }
    }

    /// The samples of a texture: moments where its name says so, else numbers in [0, 1].
    pub fn texels(&mut self, name: &str, shape: &TextureShape) -> Vec<u8> {
        let format: TexelFormat = shape.format.texel();
        let mut bytes = vec![0; shape.bytes()];
        let domain = Some(Domain::Range(0.0, 1.0));
        for texel in bytes.chunks_exact_mut(format.bytes()) {
            let v = if name.contains("moment") && self.class != Class::Hostile {
                let depths = self.depths();
                let b = |n: i32| depths.iter().map(|(z, w)| w * z.powi(n)).sum::<f64>() as f32;
                Vec4::new(b(1), b(2), b(3), b(4))
            } else {
                Vec4::from_array([(); 4].map(|()| self.float(domain, false) as f32))
            };
            format.store(texel, v);
        }
        bytes
    }
}

/// Whether a path is a part of a normal or a direction.
fn is_normal(path: &str) -> bool {
    let mut parts = path.rsplit('.');
    let component = matches!(parts.next(), Some("x" | "y" | "z"));
    component
        && parts
            .next()
            .is_some_and(|p| p.ends_with("normal") || p.ends_with("direction"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(class: Class) -> Values {
        Values {
            rng: Rng::with_seed(7),
            class,
            magnitudes: (0.0, f64::MAX),
        }
    }

    fn leaf(path: &str, scalar: Scalar, offset: usize, summary: &str) -> Leaf {
        Leaf {
            path: path.into(),
            scalar,
            offset,
            summary: summary.into(),
        }
    }

    #[test]
    fn documentation_gives_ranges() {
        for (text, range) in [
            ("Depth in [0, 1].", Some((0.0, 1.0))),
            ("Cosine, [-1, 1], see [MSM].", Some((-1.0, 1.0))),
            ("As in [MSM, 2]; from 0 to 2.5.", Some((0.0, 2.5))),
            ("From the light.", None),
            ("", None),
            ("A list [a, b].", None),
            ("Backwards [1, 0].", None),
        ] {
            assert_eq!(
                documented(text),
                range.map(|(a, b)| Domain::Range(a, b)),
                "{text}"
            );
        }
    }

    #[test]
    fn moments_belong_to_depths() {
        let leaves: Vec<Leaf> = (0..4)
            .map(|i| leaf(&format!("b{}", i + 1), Scalar::F64, i * 8, ""))
            .collect();
        for class in [Class::Ordinary, Class::Edge] {
            let bytes = values(class).elements("moments", &leaves, 32, 500, false);
            for m in bytes.chunks(32) {
                let b: Vec<f64> = bytemuck::pod_collect_to_vec(m);
                // Hölder: a distribution's even moments grow no faster than this.
                assert!(b[1] - b[0] * b[0] > -1e-12, "{b:?}");
                assert!(b[3] - b[1] * b[1] > -1e-12, "{b:?}");
                assert!(b.iter().all(|x| x.abs() <= 1.0 + 1e-9), "{b:?}");
            }
        }
    }

    #[test]
    fn integers_meet_zero_one_minus_one_and_the_extremes() {
        for class in Class::ALL {
            let leaves = [leaf("i", Scalar::I32, 0, ""), leaf("u", Scalar::U32, 4, "")];
            let bytes = values(class).elements("p", &leaves, 8, 4099, false);
            let all: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
            let (i, u): (Vec<_>, Vec<_>) = all.chunks(2).map(|e| (e[0] as i32, e[1])).unzip();
            for wanted in [0, 1, -1, i32::MIN, i32::MAX] {
                assert!(i.contains(&wanted), "{class}: {wanted}");
            }
            for wanted in [0, 1, u32::MAX] {
                assert!(u.contains(&wanted), "{class}: {wanted}");
            }
        }
    }

    #[test]
    fn ranges_are_kept_except_by_hostile_floats() {
        let leaves = [
            leaf("z", Scalar::F32, 0, "Depth in [0, 1]."),
            leaf("n", Scalar::U32, 4, "Taps, [1, 3]."),
            leaf("normal.x", Scalar::F32, 8, ""),
            leaf("normal.y", Scalar::F32, 12, ""),
            leaf("normal.z", Scalar::F32, 16, ""),
        ];
        for class in Class::ALL {
            let bytes = values(class).elements("p", &leaves, 20, 2000, false);
            let mut beyond = 0;
            for e in bytes.chunks(20) {
                let f: Vec<f32> = bytemuck::pod_collect_to_vec(e);
                let n: Vec<u32> = bytemuck::pod_collect_to_vec(e);
                assert!(f.iter().all(|x| x.is_finite()));
                assert!((1..=3).contains(&n[1]));
                let square: f32 = f[2..].iter().map(|x| x * x).sum();
                if class == Class::Hostile {
                    beyond += u32::from(!(0.0..=1.0).contains(&f[0]));
                } else {
                    assert!((0.0..=1.0).contains(&f[0]));
                    assert!((square - 1.0).abs() < 1e-5);
                }
            }
            assert_eq!(beyond > 500, class == Class::Hostile);
        }
    }
}
