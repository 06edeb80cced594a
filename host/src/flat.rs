//! Structures taken apart into their numbers: one name, type and place for each, as columns of a
//! table or as values to generate and compare.

use hankel_dsl::F16;
use hankel_dsl::native::describe::{Inputs, Layout, Scalar, Type};

use crate::device::slots::scalar_bytes;

/// A number inside a value.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf {
    /// Where it is: `field`, `field.x`, `field[2]`, `outer.inner`; empty for a plain number,
    /// `.x` for a part of a plain vector.
    pub path: String,
    /// Its type.
    pub scalar: Scalar,
    /// Bytes from the value's start.
    pub offset: usize,
    /// The documentation of the field that it belongs to.
    pub summary: String,
    /// What the attributes of the field, and of those around it, say of it.
    pub inputs: Inputs,
    /// Which component of a vector it is, and of how many; 0 of 1 for a scalar.
    pub component: (usize, usize),
}

/// The numbers of a structure or a plain value, in the order of their places.
#[must_use]
pub fn leaves(layout: &Layout) -> Vec<Leaf> {
    let mut all = Vec::new();
    layout_leaves(layout, "", 0, &Inputs::default(), &mut all);
    all
}

/// The numbers of a value of type `ty`.
#[must_use]
pub fn type_leaves(ty: &Type) -> Vec<Leaf> {
    let mut all = Vec::new();
    collect(ty, "", "", 0, &Inputs::default(), &mut all);
    all
}

/// A leaf's name as part of a value called `prefix`.
#[must_use]
pub fn join(prefix: &str, path: &str) -> String {
    if prefix.is_empty() || path.is_empty() || path.starts_with(['.', '[']) {
        format!("{prefix}{path}")
    } else {
        format!("{prefix}.{path}")
    }
}

fn layout_leaves(layout: &Layout, prefix: &str, at: usize, outer: &Inputs, all: &mut Vec<Leaf>) {
    for field in &layout.fields {
        let path = join(prefix, &field.name);
        let inputs = field.inputs.within(outer);
        let at = at + field.offset as usize;
        collect(&field.ty, &path, &field.summary, at, &inputs, all);
    }
}

fn collect(ty: &Type, path: &str, summary: &str, at: usize, inputs: &Inputs, all: &mut Vec<Leaf>) {
    let mut push = |path: String, scalar, offset, component| {
        all.push(Leaf {
            path,
            scalar,
            offset,
            summary: summary.into(),
            inputs: inputs.clone(),
            component,
        });
    };
    match ty {
        Type::Scalar { scalar } => push(path.into(), *scalar, at, (0, 1)),
        Type::Vector { scalar, size } => {
            for (i, axis) in ["x", "y", "z", "w"]
                .into_iter()
                .enumerate()
                .take(*size as usize)
            {
                push(
                    format!("{path}.{axis}"),
                    *scalar,
                    at + i * scalar_bytes(*scalar),
                    (i, *size as usize),
                );
            }
        }
        Type::Array {
            element,
            length,
            stride,
        } => {
            for i in 0..*length as usize {
                let path = format!("{path}[{i}]");
                let at = at + i * *stride as usize;
                collect(element, &path, summary, at, inputs, all);
            }
        }
        Type::Struct { layout } => layout_leaves(layout, path, at, inputs, all),
    }
}

/// A number of any of the scalar types.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// `f32`.
    F32(f32),
    /// `f64`.
    F64(f64),
    /// `u32`.
    U32(u32),
    /// `i32`.
    I32(i32),
    /// `u64`.
    U64(u64),
    /// `i64`.
    I64(i64),
    /// The bits of an [`F16`].
    F16(u16),
}

impl Number {
    /// The nearest [`F16`].
    #[must_use]
    pub fn half(x: f64) -> Self {
        let near = x as f32;
        let exact = f64::from(near) == x || !near.is_finite();
        // What an `f32` does not hold is cut off, and its last bit set: so there is no tie that is none, and no second
        // rounding.
        let beyond = f64::from(near).abs() > x.abs();
        let cut = near.to_bits() - u32::from(beyond && !exact);
        let odd = f32::from_bits(cut | u32::from(!exact));
        Self::F16(F16::new(odd).to_bits() as u16)
    }

    /// Reads the number of type `scalar` at the start of `bytes`; 0 if there are too few. A truth
    /// value is a `u32`.
    #[must_use]
    pub fn read(scalar: Scalar, bytes: &[u8]) -> Self {
        fn take<const N: usize>(bytes: &[u8]) -> [u8; N] {
            bytes.first_chunk().copied().unwrap_or([0; N])
        }
        match scalar {
            Scalar::F32 => Self::F32(f32::from_le_bytes(take(bytes))),
            Scalar::F64 => Self::F64(f64::from_le_bytes(take(bytes))),
            Scalar::U32 | Scalar::Bool => Self::U32(u32::from_le_bytes(take(bytes))),
            Scalar::I32 => Self::I32(i32::from_le_bytes(take(bytes))),
            Scalar::U64 => Self::U64(u64::from_le_bytes(take(bytes))),
            Scalar::I64 => Self::I64(i64::from_le_bytes(take(bytes))),
            Scalar::F16 => Self::F16(u16::from_le_bytes(take(bytes))),
        }
    }

    /// Writes it to the start of `bytes`, which must be long enough.
    pub fn write(self, bytes: &mut [u8]) {
        match self {
            Self::F32(x) => bytes[..4].copy_from_slice(&x.to_le_bytes()),
            Self::F64(x) => bytes[..8].copy_from_slice(&x.to_le_bytes()),
            Self::U32(x) => bytes[..4].copy_from_slice(&x.to_le_bytes()),
            Self::I32(x) => bytes[..4].copy_from_slice(&x.to_le_bytes()),
            Self::U64(x) => bytes[..8].copy_from_slice(&x.to_le_bytes()),
            Self::I64(x) => bytes[..8].copy_from_slice(&x.to_le_bytes()),
            Self::F16(x) => bytes[..2].copy_from_slice(&x.to_le_bytes()),
        }
    }

    /// As `f64`: exactly, but for integers of more than 53 bits.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        match self {
            Self::F32(x) => x.into(),
            Self::F64(x) => x,
            Self::U32(x) => x.into(),
            Self::I32(x) => x.into(),
            Self::U64(x) => x as f64,
            Self::I64(x) => x as f64,
            Self::F16(bits) => F16::from_bits(bits.into()).get().into(),
        }
    }
}

/// The shortest text that parses back to the same number.
impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::F32(x) => write!(f, "{x:?}"),
            Self::F64(x) => write!(f, "{x:?}"),
            Self::U32(x) => write!(f, "{x}"),
            Self::I32(x) => write!(f, "{x}"),
            Self::U64(x) => write!(f, "{x}"),
            Self::I64(x) => write!(f, "{x}"),
            Self::F16(bits) => write!(f, "{:?}", F16::from_bits((*bits).into()).get()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hankel_dsl::native::describe::Field;

    #[test]
    fn every_number_of_a_structure_has_a_name_and_a_place() {
        let field = |name: &str, ty, offset, size| Field {
            name: name.into(),
            summary: String::new(),
            ty,
            offset,
            size,
            inputs: Inputs::default(),
        };
        let inner = Layout {
            name: "Inner".into(),
            size: 8,
            align: 4,
            fields: vec![
                field(
                    "a",
                    Type::Scalar {
                        scalar: Scalar::U32,
                    },
                    0,
                    4,
                ),
                field(
                    "b",
                    Type::Scalar {
                        scalar: Scalar::I32,
                    },
                    4,
                    4,
                ),
            ],
        };
        let outer = Layout {
            name: "Outer".into(),
            size: 48,
            align: 16,
            fields: vec![
                field(
                    "v",
                    Type::Vector {
                        scalar: Scalar::F32,
                        size: 3,
                    },
                    0,
                    12,
                ),
                field(
                    "list",
                    Type::Array {
                        element: Box::new(Type::Struct { layout: inner }),
                        length: 2,
                        stride: 8,
                    },
                    16,
                    16,
                ),
                field(
                    "x",
                    Type::Scalar {
                        scalar: Scalar::F64,
                    },
                    32,
                    8,
                ),
            ],
        };
        let all = leaves(&outer);
        let found: Vec<(&str, usize)> = all.iter().map(|l| (l.path.as_str(), l.offset)).collect();
        assert_eq!(
            found,
            [
                ("v.x", 0),
                ("v.y", 4),
                ("v.z", 8),
                ("list[0].a", 16),
                ("list[0].b", 20),
                ("list[1].a", 24),
                ("list[1].b", 28),
                ("x", 32)
            ]
        );
        assert_eq!(all[7].scalar, Scalar::F64);
        let plain = type_leaves(&Type::Vector {
            scalar: Scalar::F32,
            size: 2,
        });
        assert_eq!(join("uv", &plain[1].path), "uv.y");
        assert_eq!(join("p", "q"), "p.q");
        assert_eq!(join("p", ""), "p");
    }

    #[test]
    fn numbers_survive_bytes_and_text() {
        let mut b = [0; 8];
        for n in [
            Number::F32(0.1),
            Number::F64(-5e-324),
            Number::U32(u32::MAX),
            Number::I32(-7),
            Number::U64(u64::MAX),
            Number::I64(i64::MIN),
            Number::half(-0.1),
        ] {
            n.write(&mut b);
            let scalar = match n {
                Number::F32(_) => Scalar::F32,
                Number::F64(_) => Scalar::F64,
                Number::U32(_) => Scalar::U32,
                Number::I32(_) => Scalar::I32,
                Number::U64(_) => Scalar::U64,
                Number::I64(_) => Scalar::I64,
                Number::F16(_) => Scalar::F16,
            };
            assert_eq!(Number::read(scalar, &b), n);
        }
        assert_eq!(Number::F32(0.1).to_string(), "0.1");
        assert_eq!(Number::half(0.1).to_string(), "0.099975586");
        // A little above the middle of two halves, which as an `f32` it would be.
        let above = 1.0 + 2_f64.powi(-11) + 2_f64.powi(-40);
        assert_eq!(Number::half(above), Number::F16(0x3c01));
        assert_eq!(Number::half(-above), Number::F16(0xbc01));
        assert_eq!(Number::half(1.0 + 2_f64.powi(-11)), Number::F16(0x3c00));
        assert_eq!(
            Number::F64(0.1f32.into()).to_string(),
            "0.10000000149011612"
        );
    }
}
