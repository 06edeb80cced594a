//! Single numbers, as the attributes of a field or parameter have them.

use std::collections::BTreeMap;

use fastrand::Rng;
use hankel_dsl::glam::{UVec4, Vec4};
use hankel_dsl::native::describe::{Channels, Domain, Inputs, Scalar, TexelFormat};

use super::{Class, InputError};
use crate::device::{Format, TextureShape};
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
    /// How many elements or texels the kernel's buffers and textures have, by their names.
    pub lengths: BTreeMap<String, usize>,
}

/// Where floats lie unless an attribute says otherwise.
const FLOATS: Domain = Domain::Range {
    least: -1.0,
    most: 1.0,
};

/// Where texels lie unless an attribute says otherwise.
const TEXELS: Domain = Domain::Range {
    least: 0.0,
    most: 1.0,
};

impl Values {
    /// `count` elements of `stride` bytes; `outer` is what the parameter's own attributes say.
    ///
    /// # Errors
    /// An attribute that refers to a parameter that is not there.
    pub fn elements(
        &mut self,
        leaves: &[Leaf],
        outer: &Inputs,
        stride: usize,
        count: usize,
    ) -> Result<Vec<u8>, InputError> {
        let leaves: Vec<(&Leaf, Option<Domain>)> = leaves
            .iter()
            .map(|leaf| Ok((leaf, self.resolved(leaf.inputs.within(outer).domain)?)))
            .collect::<Result<_, InputError>>()?;
        let mut bytes = vec![0; stride * count];
        let distinct = match leaves[..] {
            [(leaf, Some(Domain::Distinct))] => self.distinct(leaf.scalar, count),
            _ => None,
        };
        for (i, element) in bytes.chunks_exact_mut(stride.max(1)).enumerate() {
            match &distinct {
                Some(numbers) => element[..4].copy_from_slice(&numbers[i].to_le_bytes()),
                None => self.element(&leaves, element),
            }
        }
        Ok(bytes)
    }

    /// So many integers of 32 bits in any order, no two alike: from 0 on; of hostile inputs anywhere.
    fn distinct(&mut self, scalar: Scalar, count: usize) -> Option<Vec<u32>> {
        if !matches!(scalar, Scalar::U32 | Scalar::I32) {
            return None;
        }
        let mut numbers: Vec<u32> = (0..u32::try_from(count).ok()?).collect();
        self.rng.shuffle(&mut numbers);
        if self.class == Class::Hostile {
            // An odd factor maps no two numbers to one.
            let factor = self.rng.u32(..) | 1;
            for n in &mut numbers {
                *n = n.wrapping_mul(factor);
            }
        }
        Some(numbers)
    }

    /// Counts and indices as the numbers that they are here.
    fn resolved(&self, domain: Option<Domain>) -> Result<Option<Domain>, InputError> {
        let count = |param: &str| {
            let count = self.lengths.get(param).copied();
            count.ok_or_else(|| InputError::NoParameter {
                param: param.into(),
            })
        };
        Ok(match domain {
            Some(Domain::CountOf { param }) => Some(Domain::Values {
                values: vec![count(&param)? as f64],
            }),
            Some(Domain::IndexOf { param }) => Some(Domain::Range {
                least: 0.0,
                most: count(&param)?.saturating_sub(1) as f64,
            }),
            other => other,
        })
    }

    fn element(&mut self, leaves: &[(&Leaf, Option<Domain>)], element: &mut [u8]) {
        let mut unit = [0.0; 4];
        for (leaf, domain) in leaves {
            let (component, of) = leaf.component;
            let number = match (leaf.scalar, domain) {
                (Scalar::U32 | Scalar::I32 | Scalar::U64 | Scalar::I64 | Scalar::Bool, _) => {
                    self.integer(leaf.scalar, domain.as_ref())
                }
                (_, Some(Domain::UnitVector)) if self.class != Class::Hostile => {
                    if component == 0 {
                        unit = self.unit_vector(of);
                    }
                    float(leaf.scalar, unit[component.min(3)])
                }
                (scalar, domain) => {
                    let domain = domain.as_ref().unwrap_or(&FLOATS);
                    float(scalar, self.float(domain, scalar))
                }
            };
            number.write(&mut element[leaf.offset..]);
        }
    }

    fn unit_vector(&mut self, size: usize) -> [f64; 4] {
        let mut v = [0.0; 4];
        let size = size.clamp(1, 4);
        if self.class == Class::Edge || size == 1 {
            v[self.rng.usize(..size)] = if self.rng.bool() { 1.0 } else { -1.0 };
            return v;
        }
        loop {
            v[..size].fill_with(|| self.rng.f64() * 2.0 - 1.0);
            let square: f64 = v.iter().map(|x| x * x).sum();
            if (1e-3..=1.0).contains(&square) {
                return v.map(|x| x / square.sqrt());
            }
        }
    }

    fn float(&mut self, domain: &Domain, scalar: Scalar) -> f64 {
        let (a, b) = match *domain {
            Domain::Values { ref values } if !values.is_empty() => {
                return values[self.rng.usize(..values.len())];
            }
            Domain::Range { least, most } | Domain::Magnitude { least, most } => (least, most),
            _ => (-1.0, 1.0),
        };
        match (self.class, domain) {
            (Class::Ordinary, Domain::Magnitude { .. }) => a * (b / a).powf(self.rng.f64()),
            (Class::Ordinary, _) => a + (b - a) * self.rng.f64(),
            (Class::Edge, _) => {
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
            (Class::Hostile, _) => self.absurd(scalar),
        }
    }

    /// Any finite number, the extreme ones often.
    fn absurd(&mut self, scalar: Scalar) -> f64 {
        let (least, most) = self.magnitudes;
        loop {
            let x = self.any_absurd(scalar);
            if x == 0.0 || (least..=most).contains(&x.abs()) {
                return x;
            }
        }
    }

    fn any_absurd(&mut self, scalar: Scalar) -> f64 {
        let half = |bits: u16| Number::F16(bits).to_f64();
        let (largest, normal, least) = match scalar {
            Scalar::F64 => (f64::MAX, f64::MIN_POSITIVE, f64::from_bits(1)),
            Scalar::F16 => (half(0x7bff), half(0x0400), half(0x0001)),
            _ => (
                f32::MAX.into(),
                f32::MIN_POSITIVE.into(),
                f32::from_bits(1).into(),
            ),
        };
        let sign = if self.rng.bool() { 1.0 } else { -1.0 };
        sign * match self.rng.u32(..12) {
            0 => 0.0,
            1 => least,
            2 => normal * self.rng.f64(),
            3 => normal,
            4 => largest,
            5 => largest * self.rng.f64(),
            6 => f64::min(1e30, largest),
            7 => f64::max(1e-30, least),
            8 => f64::min(1e6, largest) * self.rng.f64(),
            9 => self.rng.f64(),
            _ => loop {
                let x = match scalar {
                    Scalar::F64 => f64::from_bits(self.rng.u64(..)),
                    Scalar::F16 => half(self.rng.u16(..)),
                    _ => f32::from_bits(self.rng.u32(..)).into(),
                };
                if x.is_finite() {
                    break x;
                }
            },
        }
    }

    /// Integers keep to their domain in every class: they are counts and indices, and what lies
    /// beyond is a mistake of the caller. Its ends, 0, 1, -1 and their neighbours come often.
    fn integer(&mut self, scalar: Scalar, domain: Option<&Domain>) -> Number {
        let (mut a, mut b) = match scalar {
            Scalar::I32 => (i64::from(i32::MIN), i64::from(i32::MAX)),
            Scalar::I64 => (i64::MIN, i64::MAX),
            // Those above are made of two below.
            Scalar::U64 => (0, i64::MAX),
            Scalar::Bool => (0, 1),
            _ => (0, i64::from(u32::MAX)),
        };
        let value = match domain {
            Some(Domain::Values { values }) if !values.is_empty() => {
                (values[self.rng.usize(..values.len())] as i64).clamp(a, b)
            }
            _ => {
                if let Some(Domain::Range { least, most } | Domain::Magnitude { least, most }) =
                    domain
                {
                    a = (least.ceil() as i64).clamp(a, b);
                    b = (most.floor() as i64).clamp(a, b);
                }
                let special = match self.class {
                    Class::Ordinary => 4,
                    Class::Edge | Class::Hostile => 2,
                };
                if self.rng.u32(..special) == 0 {
                    let some = [a, b, 0, 1, -1, 2, a.saturating_add(1), b.saturating_sub(1)];
                    some[self.rng.usize(..some.len())].clamp(a, b)
                } else {
                    self.rng.i64(a..=b)
                }
            }
        };
        // Both fit: `a` and `b` do.
        match scalar {
            Scalar::I32 => Number::I32(value as i32),
            Scalar::I64 => Number::I64(value),
            // Without a domain, the upper half as often as the lower.
            Scalar::U64 if domain.is_none() && self.rng.bool() => Number::U64(!(value as u64)),
            Scalar::U64 => Number::U64(value as u64),
            _ => Number::U32(value as u32),
        }
    }

    /// The samples of a texture of integers.
    fn integer_texels(
        &mut self,
        inputs: &Inputs,
        shape: &TextureShape,
    ) -> Result<Vec<u8>, InputError> {
        let format = shape.format.texel();
        let domain = held(format, self.resolved(inputs.domain.clone())?);
        let scalar = match format.numbers() {
            Channels::Sint => Scalar::I32,
            _ => Scalar::U32,
        };
        let mut bytes = vec![0; shape.bytes()];
        for texel in bytes.chunks_exact_mut(format.bytes()) {
            let channels = [(); 4].map(|()| match self.integer(scalar, Some(&domain)) {
                Number::I32(x) => x as u32,
                Number::U32(x) => x,
                _ => 0,
            });
            format.store_integer(texel, UVec4::from_array(channels));
        }
        Ok(bytes)
    }

    /// The samples of a texture.
    ///
    /// # Errors
    /// As of [`Values::elements`].
    pub fn texels(&mut self, inputs: &Inputs, shape: &TextureShape) -> Result<Vec<u8>, InputError> {
        if shape.format.texel().is_integer() {
            return self.integer_texels(inputs, shape);
        }
        let depth = shape.format == Format::Depth32;
        let domain = self.resolved(inputs.domain.clone())?.unwrap_or(TEXELS);
        let format: TexelFormat = shape.format.texel();
        let mut bytes = vec![0; shape.bytes()];
        for texel in bytes.chunks_exact_mut(format.bytes()) {
            let v = Vec4::from_array([(); 4].map(|()| self.float(&domain, Scalar::F32) as f32));
            // A depth buffer holds nothing else.
            let v = if depth {
                v.clamp(Vec4::ZERO, Vec4::ONE)
            } else {
                v
            };
            format.store(texel, v);
        }
        Ok(bytes)
    }
}

/// Numbers that a format's channels can hold, and that a domain has.
fn held(format: TexelFormat, domain: Option<Domain>) -> Domain {
    let bits = format.channel_bits()[0] as i32;
    let (least, most) = match format.numbers() {
        Channels::Sint => (-(2.0_f64.powi(bits - 1)), 2.0_f64.powi(bits - 1) - 1.0),
        _ => (0.0, 2.0_f64.powi(bits) - 1.0),
    };
    match domain {
        Some(Domain::Values { values }) => Domain::Values {
            values: values.iter().map(|v| v.clamp(least, most)).collect(),
        },
        Some(Domain::Range { least: a, most: b } | Domain::Magnitude { least: a, most: b }) => {
            Domain::Range {
                least: a.clamp(least, most),
                most: b.clamp(least, most),
            }
        }
        _ => Domain::Range { least, most },
    }
}

fn float(scalar: Scalar, x: f64) -> Number {
    match scalar {
        Scalar::F64 => Number::F64(x),
        Scalar::F16 => Number::half(x.clamp(-65504.0, 65504.0)),
        _ => Number::F32(x as f32),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(class: Class) -> Values {
        Values {
            rng: Rng::with_seed(7),
            class,
            magnitudes: (0.0, f64::MAX),
            lengths: [("table".to_owned(), 5)].into(),
        }
    }

    fn leaf(path: &str, scalar: Scalar, offset: usize, domain: Option<Domain>) -> Leaf {
        Leaf {
            path: path.into(),
            scalar,
            offset,
            summary: "A depth in [0, 1], from 3 to 4; default 7.".into(),
            inputs: Inputs {
                domain,
                ..Inputs::default()
            },
            component: (0, 1),
        }
    }

    #[test]
    fn names_and_documentation_say_nothing() {
        let leaves: Vec<Leaf> = ["depth", "b1", "normal.x", "bias", "width"]
            .iter()
            .enumerate()
            .map(|(i, name)| leaf(name, Scalar::F32, 4 * i, None))
            .collect();
        let bytes = values(Class::Ordinary)
            .elements(&leaves, &Inputs::default(), 20, 4000)
            .unwrap();
        for column in 0..5 {
            let all: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes)
                .into_iter()
                .skip(column)
                .step_by(5)
                .collect();
            let least = all.iter().copied().fold(f32::MAX, f32::min);
            let most = all.iter().copied().fold(f32::MIN, f32::max);
            assert!(least < -0.99 && most > 0.99, "{column}: {least} to {most}");
        }
    }

    #[test]
    fn ranges_are_kept_except_by_hostile_floats() {
        let range = |least, most| Some(Domain::Range { least, most });
        let mut leaves = vec![
            leaf("z", Scalar::F32, 0, range(0.0, 1.0)),
            leaf("n", Scalar::U32, 4, range(1.0, 3.0)),
        ];
        for i in 0..3 {
            let mut part = leaf("d", Scalar::F32, 8 + 4 * i, Some(Domain::UnitVector));
            part.component = (i, 3);
            leaves.push(part);
        }
        for class in Class::ALL {
            let bytes = values(class)
                .elements(&leaves, &Inputs::default(), 20, 2000)
                .unwrap();
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

    #[test]
    fn distinct_integers_are_distinct() {
        let leaves = [leaf("place", Scalar::U32, 0, Some(Domain::Distinct))];
        for class in Class::ALL {
            let bytes = values(class)
                .elements(&leaves, &Inputs::default(), 4, 5000)
                .unwrap();
            let mut all: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
            assert!(!all.is_sorted(), "{class}");
            all.sort_unstable();
            all.dedup();
            assert_eq!(all.len(), 5000, "{class}");
            assert_eq!(all.last() == Some(&4999), class != Class::Hostile);
        }
    }

    #[test]
    fn integers_meet_zero_one_minus_one_and_the_extremes() {
        for class in Class::ALL {
            let leaves = [
                leaf("i", Scalar::I32, 0, None),
                leaf("u", Scalar::U32, 4, None),
            ];
            let bytes = values(class)
                .elements(&leaves, &Inputs::default(), 8, 4099)
                .unwrap();
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
    fn counts_indices_and_lists_are_what_they_say() {
        let of = |param: &str| Domain::CountOf {
            param: param.into(),
        };
        let index = Domain::IndexOf {
            param: "table".into(),
        };
        let listed = Domain::Values {
            values: vec![2.0, 7.0],
        };
        let leaves = [
            leaf("n", Scalar::U32, 0, Some(of("table"))),
            leaf("i", Scalar::U32, 4, Some(index)),
            leaf("v", Scalar::U32, 8, Some(listed)),
        ];
        for class in Class::ALL {
            let bytes = values(class)
                .elements(&leaves, &Inputs::default(), 12, 500)
                .unwrap();
            let all: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes);
            let mut indices = [0; 5];
            for e in all.chunks(3) {
                assert_eq!(e[0], 5);
                indices[e[1] as usize] += 1;
                assert!(matches!(e[2], 2 | 7));
            }
            assert!(indices.iter().all(|n| *n > 0), "{indices:?}");
        }
        let error = values(Class::Ordinary)
            .elements(
                &[leaf("n", Scalar::U32, 0, Some(of("tabel")))],
                &Inputs::default(),
                4,
                1,
            )
            .unwrap_err();
        assert!(error.to_string().contains("`tabel`"), "{error}");
    }
}
