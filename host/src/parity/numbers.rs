//! The numbers that a kernel writes, and how far two runs of it are apart.

use std::borrow::Cow;
use std::cmp::Ordering;

use hankel_dsl::native::describe::{Kernel, Role, Tolerance, Type};
use serde::{Deserialize, Serialize};

use super::compare::{Distance, Kind};
use super::execute::Written;
use super::intervals::Intervals;
use crate::device::slots::{self, Use};
use crate::flat;
use crate::inputs::{self, Case, Class};

/// What a comparison found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Invocations compared.
    pub cases: u64,
    /// Numbers compared.
    pub values: u64,
    /// The largest distance in units in the last place, or in steps of an integer or normalised
    /// format.
    pub largest_ulp: u64,
    /// The largest difference as numbers; `None` if it is not finite.
    pub largest_absolute: Option<f64>,
    /// Numbers beyond the tolerance.
    pub beyond: u64,
    /// The first number beyond the tolerance; else the first that differs at all.
    pub first: Option<Difference>,
}

impl Default for Found {
    fn default() -> Self {
        Self {
            cases: 0,
            values: 0,
            largest_ulp: 0,
            largest_absolute: Some(0.0),
            beyond: 0,
            first: None,
        }
    }
}

/// Two numbers that differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Class of the inputs.
    pub class: Class,
    /// Invocation, or texel counted row by row.
    pub invocation: u64,
    /// Which number of the output.
    pub value: String,
    /// The reference's.
    pub expected: String,
    /// What came out.
    pub got: String,
    /// How far apart, in units in the last place or steps.
    pub ulp: u64,
    /// What that invocation read as its own: names and values.
    pub inputs: Vec<(String, String)>,
}

/// What a way to run a kernel may differ by.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rules {
    /// Of ordinary inputs and of those at the edges.
    pub tolerance: Tolerance,
    /// Subnormal numbers may be taken for zero.
    pub flushes: bool,
    /// Samplers round products of weights, which [`Intervals`] have to know.
    #[serde(default)]
    pub rounds_products: bool,
    /// Of absurd inputs the results are compared like others; else only in that what is finite in
    /// the reference is finite.
    pub hostile: bool,
}

impl Rules {
    /// A kernel's own tolerance, which is for inputs as in use: with one, absurd inputs, for which
    /// no condition is bounded, need only give finite results. So do those of a sampler: of a
    /// coordinate far away no fraction of a texel is left.
    #[must_use]
    pub fn of(kernel: &Kernel, tolerance: Tolerance) -> Self {
        let samples = kernel
            .params
            .iter()
            .any(|p| matches!(p.role, Role::Sampler { .. }));
        Self {
            hostile: tolerance.ulp == 0 && tolerance.absolute == 0.0 && !samples,
            tolerance,
            flushes: inputs::flushes(kernel),
            rounds_products: false,
        }
    }
}

/// The numbers that a kernel writes.
#[derive(Debug)]
pub struct Numbers<'a> {
    kernel: &'a Kernel,
    outputs: Vec<Out>,
}

impl<'a> Numbers<'a> {
    /// Those of `kernel`.
    #[must_use]
    pub fn of(kernel: &'a Kernel) -> Self {
        Self {
            kernel,
            outputs: outputs(kernel),
        }
    }

    /// All of them, in order.
    #[must_use]
    pub fn values(&self, written: &Written) -> Vec<f64> {
        let mut all = Vec::new();
        self.each(written, written, false, |_, _, _, d| all.push(d.a));
        all
    }

    /// How many of the numbers that a case wrote are not finite, and the first of them.
    #[must_use]
    pub fn non_finite(&self, case: &Case, written: &Written) -> (u64, Option<Difference>) {
        let (mut n, mut first) = (0, None);
        self.each(written, written, false, |i, name, kind, d| {
            if !d.a.is_finite() {
                n += 1;
                first.get_or_insert_with(|| self.difference(case, i, name, kind, &d));
            }
        });
        (n, first)
    }

    /// Compares what a case wrote with the reference, and adds what it finds to `found`. A number
    /// within its interval is right; one outside of it may be as far away from it as the tolerance
    /// says.
    pub fn compare(
        &self,
        case: &Case,
        rules: &Rules,
        intervals: Option<&Intervals>,
        reference: &Written,
        written: &Written,
        found: &mut Found,
    ) {
        found.cases += case.invocations as u64;
        let lengths = |w: &Written| w.iter().map(Vec::len).collect::<Vec<_>>();
        if lengths(reference) != lengths(written) {
            found.beyond += 1;
        }
        if case.class == Class::Hostile && !rules.hostile {
            self.each(reference, written, false, |i, name, kind, d| {
                found.values += 1;
                if d.a.is_finite() && !d.b.is_finite() {
                    found.beyond += 1;
                    found.largest_ulp = found.largest_ulp.max(d.ulp);
                    found.largest_absolute = None;
                    if found.beyond == 1 {
                        found.first = Some(self.difference(case, i, name, kind, &d));
                    }
                }
            });
            return;
        }
        let tolerance = &rules.tolerance;
        let mut index = 0;
        self.each(reference, written, rules.flushes, |i, name, kind, d| {
            let interval = intervals.and_then(|all| all.of(index));
            index += 1;
            found.values += 1;
            if d.ulp == 0 {
                return;
            }
            let outside = interval.map_or(d.absolute, |interval| interval.distance(d.b));
            let fits = d.ulp <= tolerance.ulp.into() || outside <= tolerance.absolute;
            let first_beyond = !fits && found.beyond == 0;
            found.beyond += u64::from(!fits);
            found.largest_ulp = found.largest_ulp.max(d.ulp);
            found.largest_absolute = found
                .largest_absolute
                .map(|x| x.max(d.absolute))
                .filter(|x| x.is_finite());
            if found.first.is_none() || first_beyond {
                found.first = Some(self.difference(case, i, name, kind, &d));
            }
        });
    }

    /// Whether some elements may lie in any order.
    pub fn has_unordered(&self) -> bool {
        self.outputs.iter().any(|out| out.unordered)
    }

    /// Calls `f` with every number of what was written: element, name, distance.
    fn each(
        &self,
        reference: &Written,
        written: &Written,
        flush: bool,
        mut f: impl FnMut(usize, &str, &Kind, Distance),
    ) {
        for ((out, a), b) in self.outputs.iter().zip(reference).zip(written) {
            let (a, b) = if out.unordered {
                (out.sorted(a), out.sorted(b))
            } else {
                (Cow::Borrowed(&a[..]), Cow::Borrowed(&b[..]))
            };
            let elements = a.chunks_exact(out.stride).zip(b.chunks_exact(out.stride));
            for (i, (a, b)) in elements.enumerate() {
                for (name, kind, offset) in &out.values {
                    f(
                        i,
                        name,
                        kind,
                        kind.compare(&a[*offset..], &b[*offset..], flush),
                    );
                }
            }
        }
    }

    fn difference(
        &self,
        case: &Case,
        i: usize,
        name: &str,
        kind: &Kind,
        d: &Distance,
    ) -> Difference {
        Difference {
            class: case.class,
            invocation: i as u64,
            value: name.into(),
            expected: kind.spelled(d.a),
            got: kind.spelled(d.b),
            ulp: d.ulp,
            inputs: inputs::of_invocation(self.kernel, case, i),
        }
    }
}

/// The numbers of one thing that is written.
#[derive(Debug)]
struct Out {
    /// Bytes of an element or texel.
    stride: usize,
    /// Name, type and place of each number of it.
    values: Vec<(String, Kind, usize)>,
    /// Which element lies where says nothing.
    unordered: bool,
}

impl Out {
    /// The elements in an order that does not depend on where they lay: by their numbers.
    fn sorted(&self, bytes: &[u8]) -> Cow<'static, [u8]> {
        let mut elements: Vec<&[u8]> = bytes.chunks_exact(self.stride).collect();
        elements.sort_by(|a, b| {
            self.values
                .iter()
                .map(|(_, kind, offset)| kind.order(&a[*offset..], &b[*offset..]))
                .find(|order| order.is_ne())
                .unwrap_or(Ordering::Equal)
        });
        Cow::Owned(elements.concat())
    }
}

/// What a kernel writes, in the order of its slots.
fn outputs(kernel: &Kernel) -> Vec<Out> {
    let mut all = Vec::new();
    for slot in slots::slots(kernel)
        .into_iter()
        .filter(|s| s.role.is_written())
    {
        let leaves = match slot.role {
            Use::ElementMut(layout) | Use::StorageMut { layout, .. } | Use::Output(layout) => {
                flat::leaves(layout)
            }
            Use::Interface(ty) => flat::type_leaves(ty),
            Use::Atomic { scalar, .. } => flat::type_leaves(&Type::Scalar { scalar }),
            Use::StorageTexture { format, .. } => {
                let kind = Kind::of(format);
                let channels = &["r", "g", "b", "a"][..format.channels()];
                let values = match kind {
                    // All of them are one value.
                    Kind::Packed(_) => {
                        vec![(format!("{}.{}", slot.name, channels.concat()), kind, 0)]
                    }
                    _ => channels
                        .iter()
                        .enumerate()
                        .map(|(i, c)| (format!("{}.{c}", slot.name), kind, i * kind.bytes()))
                        .collect(),
                };
                all.push(Out {
                    stride: format.bytes(),
                    values,
                    unordered: false,
                });
                continue;
            }
            _ => continue,
        };
        let values = leaves
            .into_iter()
            .map(|l| {
                (
                    flat::join(&slot.name, &l.path),
                    Kind::Scalar(l.scalar),
                    l.offset,
                )
            })
            .collect();
        all.push(Out {
            stride: slot.role.element_bytes().unwrap_or(1),
            values,
            unordered: matches!(
                slot.role,
                Use::StorageMut {
                    unordered: true,
                    ..
                } | Use::Atomic {
                    unordered: true,
                    ..
                }
            ),
        });
    }
    all
}
