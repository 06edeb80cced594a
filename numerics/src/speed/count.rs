//! How many operations a kernel does: its own source, run with numbers that remember what they
//! come from. Counted is what the results depend on, as a compiler would leave it: nothing that no
//! result needs, nothing twice, and no arithmetic with constants alone.

use std::array;
use std::cell::RefCell;
use std::collections::HashMap;
use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, MulAssign, Neg, Not, Sub, SubAssign};

use hankel_dsl::bytemuck::{Pod, cast_slice, cast_slice_mut};
use hankel_dsl::native::layout::{Lane, Lanewise, Splat};
use hankel_dsl::{Mask, Real};
use hankel_shadows::moment_bounds as kernels;
use serde::{Deserialize, Serialize};

use crate::families::{Format, Row};

/// Operations on numbers. Of what only moves them, nothing is counted, and nothing of what combines
/// truth values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Operations {
    /// Sums and differences.
    pub sums: f64,
    /// Products.
    pub products: f64,
    /// Products whose rounding error is taken by one fused operation, where there is one.
    pub fused: f64,
    /// Quotients.
    pub quotients: f64,
    /// Square roots.
    pub roots: f64,
    /// Comparisons, minima and maxima.
    pub comparisons: f64,
    /// Selections.
    pub selections: f64,
    /// Changes of sign, magnitudes, roundings to whole numbers.
    pub others: f64,
}

impl Operations {
    /// All that are not quotients or roots: an instruction each, as fast as a sum.
    #[must_use]
    pub fn simple(&self) -> f64 {
        self.sums + self.products + self.fused + self.comparisons + self.selections + self.others
    }

    /// Floating-point operations as they are usually counted: sums, products, quotients and roots,
    /// and two for a fused one.
    #[must_use]
    pub fn flops(&self) -> f64 {
        self.sums + self.products + 2.0 * self.fused + self.quotients + self.roots
    }

    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            sums: f(self.sums, other.sums),
            products: f(self.products, other.products),
            fused: f(self.fused, other.fused),
            quotients: f(self.quotients, other.quotients),
            roots: f(self.roots, other.roots),
            comparisons: f(self.comparisons, other.comparisons),
            selections: f(self.selections, other.selections),
            others: f(self.others, other.others),
        }
    }
}

/// What an operation is, or where a value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Kind {
    Input,
    /// The bits of an `f64`.
    Constant(u64),
    Truth(bool),
    Sum,
    Difference,
    Product,
    /// The rounding error of a product, which is the third operand.
    Fused,
    Quotient,
    Root,
    Less,
    AtMost,
    Equal,
    Least,
    Greatest,
    Select,
    Negative,
    Magnitude,
    Floor,
    And,
    Or,
    Not,
}

impl Kind {
    fn is_truth(self) -> bool {
        matches!(
            self,
            Self::Less | Self::AtMost | Self::Equal | Self::And | Self::Or | Self::Not
        )
    }

    fn commutes(self) -> bool {
        matches!(
            self,
            Self::Sum | Self::Product | Self::Equal | Self::And | Self::Or
        )
    }
}

/// An operation and what it is done to, by number; unused operands are `NONE`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Node {
    kind: Kind,
    operands: [u32; 3],
}

const NONE: u32 = u32::MAX;

/// Everything that was computed, without repetitions, and the values in all lanes. Those of `f32` are the same in `f64`, and
/// truth values are 0 and 1.
#[derive(Default)]
struct Graph {
    nodes: Vec<Node>,
    values: Vec<[f64; TOGETHER]>,
    numbers: HashMap<Node, u32>,
    outputs: Vec<u32>,
}

thread_local! {
    static GRAPH: RefCell<Graph> = RefCell::default();
}

impl Graph {
    fn add(&mut self, node: Node, values: impl FnOnce(&Self) -> [f64; TOGETHER]) -> u32 {
        if let Some(number) = self.numbers.get(&node) {
            return *number;
        }
        let values = values(self);
        let number = self.nodes.len() as u32;
        self.numbers.insert(node, number);
        self.nodes.push(node);
        self.values.push(values);
        number
    }

    /// The values of operands in one lane.
    fn lane(&self, operands: [u32; 3], lane: usize) -> [f64; 3] {
        operands.map(|o| self.values.get(o as usize).map_or(0.0, |it| it[lane]))
    }

    fn constant(&self, number: u32) -> Option<f64> {
        match self.nodes.get(number as usize)?.kind {
            Kind::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    fn is_constant(&self, number: u32) -> bool {
        self.nodes
            .get(number as usize)
            .is_some_and(|node| matches!(node.kind, Kind::Constant(_) | Kind::Truth(_)))
    }

    /// What the outputs depend on.
    fn count(&self) -> Operations {
        let mut is_live = vec![false; self.nodes.len()];
        let mut open = self.outputs.clone();
        let mut operations = Operations::default();
        while let Some(number) = open.pop() {
            let (Some(node), Some(seen)) = (
                self.nodes.get(number as usize),
                is_live.get_mut(number as usize),
            ) else {
                continue;
            };
            if std::mem::replace(seen, true) {
                continue;
            }
            open.extend(node.operands.iter().filter(|o| **o != NONE));
            let o = &mut operations;
            *match node.kind {
                Kind::Input | Kind::Constant(_) | Kind::Truth(_) => continue,
                Kind::And | Kind::Or | Kind::Not => continue,
                Kind::Sum | Kind::Difference => &mut o.sums,
                Kind::Product => &mut o.products,
                Kind::Fused => &mut o.fused,
                Kind::Quotient => &mut o.quotients,
                Kind::Root => &mut o.roots,
                Kind::Less | Kind::AtMost | Kind::Equal | Kind::Least | Kind::Greatest => {
                    &mut o.comparisons
                }
                Kind::Select => &mut o.selections,
                Kind::Negative | Kind::Magnitude | Kind::Floor => &mut o.others,
            } += 1.0;
        }
        operations
    }
}

/// The number of an operation's result. `value` computes it in one lane; where all operands are constants, all lanes are
/// alike.
fn node(kind: Kind, operands: [u32; 3], value: impl Fn([f64; 3]) -> f64) -> u32 {
    GRAPH.with_borrow_mut(|graph| {
        let is_fixed = |o: &u32| *o == NONE || graph.is_constant(*o);
        if operands.iter().all(is_fixed) {
            let value = value(graph.lane(operands, 0));
            let kind = if kind.is_truth() {
                Kind::Truth(value != 0.0)
            } else {
                Kind::Constant(value.to_bits())
            };
            let node = Node {
                kind,
                operands: [NONE; 3],
            };
            return graph.add(node, |_| [value; TOGETHER]);
        }
        let mut ordered = operands;
        if kind.commutes() && ordered[0] > ordered[1] {
            ordered.swap(0, 1);
        }
        let node = Node {
            kind,
            operands: ordered,
        };
        graph.add(node, |graph| {
            array::from_fn(|lane| value(graph.lane(operands, lane)))
        })
    })
}

fn input(values: [f64; TOGETHER]) -> u32 {
    GRAPH.with_borrow_mut(|graph| {
        // Told apart from all others by its own number.
        let number = graph.nodes.len() as u32;
        let node = Node {
            kind: Kind::Input,
            operands: [NONE, NONE, number],
        };
        graph.add(node, |_| values)
    })
}

fn constant_of(number: u32) -> Option<f64> {
    GRAPH.with_borrow(|graph| graph.constant(number))
}

/// What `f` does to compute the numbers that it returns.
pub fn operations_of<P: Format, const N: usize>(f: impl FnOnce() -> [Counted<P>; N]) -> Operations {
    traced(|| {
        let outputs = f().map(|x| x.number);
        GRAPH.with_borrow_mut(|graph| graph.outputs.extend(outputs));
    })
}

fn traced(f: impl FnOnce()) -> Operations {
    GRAPH.set(Graph::default());
    f();
    let operations = GRAPH.with_borrow(Graph::count);
    GRAPH.set(Graph::default());
    operations
}

/// Rows that run together: as many as lanes of AVX-512 take at once in `f32`. A loop goes on until the last of
/// them is done, and its operations are done for all.
pub const TOGETHER: usize = 64;

/// Lanes that remember what they come from, on the thread where they were made. A number is only its place there, and its
/// operations are calls: kernels are inlined wholly, and with values in them they were half of this crate's code.
#[derive(Clone, Copy, Debug)]
pub struct Counted<P> {
    number: u32,
    of: PhantomData<P>,
}

/// The result of comparing such numbers.
#[derive(Clone, Copy, Debug)]
pub struct CountedMask {
    number: u32,
}

impl<P: Format> Counted<P> {
    /// A number from outside, the same in all lanes.
    #[must_use]
    pub fn input(value: P) -> Self {
        Self::inputs([value; TOGETHER])
    }

    /// A number from outside for each lane.
    #[must_use]
    pub fn inputs(values: [P; TOGETHER]) -> Self {
        Self::numbered(input(values.map(P::widen)))
    }

    /// The values in all lanes.
    #[must_use]
    pub fn values(self) -> [P; TOGETHER] {
        GRAPH.with_borrow(|graph| graph.values[self.number as usize].map(P::round))
    }

    fn numbered(number: u32) -> Self {
        Self {
            number,
            of: PhantomData,
        }
    }

    #[inline(never)]
    fn fixed(value: f64) -> Self {
        Self::numbered(node(Kind::Constant(value.to_bits()), [NONE; 3], |_| value))
    }

    /// An operation on one number.
    fn each(self, kind: Kind, f: impl Fn(P) -> P) -> Self {
        let operands = [self.number, NONE, NONE];
        Self::numbered(node(kind, operands, |[a, ..]| f(P::round(a)).widen()))
    }

    /// An operation on two numbers.
    fn with(self, o: Self, kind: Kind, f: impl Fn(P, P) -> P) -> Self {
        let operands = [self.number, o.number, NONE];
        let value = |[a, b, _]: [f64; 3]| f(P::round(a), P::round(b)).widen();
        Self::numbered(node(kind, operands, value))
    }

    fn compared(self, o: Self, kind: Kind, f: impl Fn(f64, f64) -> bool) -> CountedMask {
        CountedMask::of(kind, [self.number, o.number, NONE], f)
    }

    fn is(self, x: f64) -> bool {
        constant_of(self.number).is_some_and(|c| c.to_bits() == x.to_bits())
    }
}

impl CountedMask {
    fn of(kind: Kind, operands: [u32; 3], f: impl Fn(f64, f64) -> bool) -> Self {
        let value = |[a, b, _]: [f64; 3]| f64::from(u8::from(f(a, b)));
        Self {
            number: node(kind, operands, value),
        }
    }

    fn values(self) -> [bool; TOGETHER] {
        GRAPH.with_borrow(|graph| graph.values[self.number as usize].map(|it| it != 0.0))
    }
}

impl BitAnd for CountedMask {
    type Output = Self;
    #[inline(never)]
    fn bitand(self, o: Self) -> Self {
        let both = |a, b| a != 0.0 && b != 0.0;
        Self::of(Kind::And, [self.number, o.number, NONE], both)
    }
}

impl BitOr for CountedMask {
    type Output = Self;
    #[inline(never)]
    fn bitor(self, o: Self) -> Self {
        let either = |a, b| a != 0.0 || b != 0.0;
        Self::of(Kind::Or, [self.number, o.number, NONE], either)
    }
}

impl Not for CountedMask {
    type Output = Self;
    #[inline(never)]
    fn not(self) -> Self {
        Self::of(Kind::Not, [self.number, NONE, NONE], |a, _| a == 0.0)
    }
}

impl Mask for CountedMask {
    #[inline(never)]
    fn any(self) -> bool {
        self.values().contains(&true)
    }
    #[inline(never)]
    fn all(self) -> bool {
        !self.values().contains(&false)
    }
}

impl<P: Format> Add for Counted<P> {
    type Output = Self;
    #[inline(never)]
    fn add(self, o: Self) -> Self {
        self.with(o, Kind::Sum, |a, b| a + b)
    }
}

impl<P: Format> Sub for Counted<P> {
    type Output = Self;
    #[inline(never)]
    fn sub(self, o: Self) -> Self {
        if o.is(0.0) {
            return self;
        }
        self.with(o, Kind::Difference, |a, b| a - b)
    }
}

impl<P: Format> Mul for Counted<P> {
    type Output = Self;
    #[inline(never)]
    fn mul(self, o: Self) -> Self {
        if self.is(1.0) {
            return o;
        }
        if o.is(1.0) {
            return self;
        }
        self.with(o, Kind::Product, |a, b| a * b)
    }
}

impl<P: Format> Div for Counted<P> {
    type Output = Self;
    #[inline(never)]
    fn div(self, o: Self) -> Self {
        // A quotient by a power of two is a product.
        let mantissa = (1_u64 << 52) - 1;
        match constant_of(o.number) {
            Some(c) if c.is_normal() && c.to_bits() & mantissa == 0 => self * Self::fixed(1.0 / c),
            _ => self.with(o, Kind::Quotient, |a, b| a / b),
        }
    }
}

impl<P: Format> Neg for Counted<P> {
    type Output = Self;
    #[inline(never)]
    fn neg(self) -> Self {
        self.each(Kind::Negative, |x| -x)
    }
}

macro_rules! assign {
    ($($operator:ident $function:ident $by:tt),*) => {$(
        impl<P: Format> $operator for Counted<P> {
            fn $function(&mut self, o: Self) {
                *self = *self $by o;
            }
        }
    )*};
}

assign!(AddAssign add_assign +, SubAssign sub_assign -, MulAssign mul_assign *);

impl<P: Format> Real for Counted<P> {
    type Mask = CountedMask;
    const IS_WIDE: bool = P::IS_WIDE;

    fn literal<const BITS: u64>() -> Self {
        Self::fixed(P::literal::<BITS>().widen())
    }
    #[inline(never)]
    fn epsilon() -> Self {
        Self::fixed(P::epsilon().widen())
    }
    #[inline(never)]
    fn sqrt(self) -> Self {
        self.each(Kind::Root, P::sqrt)
    }
    #[inline(never)]
    fn abs(self) -> Self {
        self.each(Kind::Magnitude, P::abs)
    }
    #[inline(never)]
    fn floor(self) -> Self {
        self.each(Kind::Floor, P::floor)
    }
    #[inline(never)]
    fn min(self, o: Self) -> Self {
        self.with(o, Kind::Least, P::min)
    }
    #[inline(never)]
    fn max(self, o: Self) -> Self {
        self.with(o, Kind::Greatest, P::max)
    }
    #[inline(never)]
    fn lt(self, o: Self) -> CountedMask {
        self.compared(o, Kind::Less, |a, b| a < b)
    }
    #[inline(never)]
    fn le(self, o: Self) -> CountedMask {
        self.compared(o, Kind::AtMost, |a, b| a <= b)
    }
    #[inline(never)]
    fn eq(self, o: Self) -> CountedMask {
        self.compared(o, Kind::Equal, |a, b| a == b)
    }
    #[inline(never)]
    fn select(mask: CountedMask, a: Self, b: Self) -> Self {
        let is_known = GRAPH.with_borrow(|graph| graph.is_constant(mask.number));
        if is_known || a.number == b.number {
            return if mask.values()[0] { a } else { b };
        }
        let operands = [mask.number, a.number, b.number];
        let chosen = |[mask, a, b]: [f64; 3]| if mask != 0.0 { a } else { b };
        Self::numbered(node(Kind::Select, operands, chosen))
    }
    // As lanes do both.
    #[inline(never)]
    fn two_sum(self, o: Self) -> (Self, Self) {
        let sum = self + o;
        let from_o = sum - self;
        (sum, (self - (sum - from_o)) + (o - from_o))
    }
    #[inline(never)]
    fn two_product(self, o: Self) -> (Self, Self) {
        let product = self * o;
        let operands = [self.number, o.number, product.number];
        let error = |[a, b, _]: [f64; 3]| P::round(a).two_product(P::round(b)).1.widen();
        (product, Self::numbered(node(Kind::Fused, operands, error)))
    }
}

/// What makes rows of plain numbers into one of such numbers, and back.
// SAFETY: `columns` writes every column.
unsafe impl<P: Format> Lane for Counted<P> {
    type Scalar = P;
    const LANES: usize = TOGETHER;
    fn splat(value: P) -> Self {
        Self::input(value)
    }
    fn columns<T: Pod>(rows: &[T], columns: &mut [MaybeUninit<Self>]) {
        let table: &[P] = cast_slice(rows);
        let width = columns.len();
        for (at, column) in columns.iter_mut().enumerate() {
            column.write(Self::inputs(array::from_fn(|row| table[row * width + at])));
        }
    }
    fn put_columns<T: Pod>(columns: &[Self], rows: &mut [T]) {
        let table: &mut [P] = cast_slice_mut(rows);
        for (at, column) in columns.iter().enumerate() {
            for (row, value) in column.values().into_iter().enumerate() {
                table[row * columns.len() + at] = value;
            }
            GRAPH.with_borrow_mut(|graph| graph.outputs.push(column.number));
        }
    }
}

/// Mean operations for a row in `f32`, where as many rows as [`TOGETHER`] run together, or where each runs `alone`:
/// the difference is what lanes compute while they wait for others. Rows that fill no group are left out. `None`
/// for a function that is no kernel for bounds. In `f64`, loops for roots may take more turns than are counted here.
#[must_use]
pub fn per_row(function: &str, n: usize, rows: &[Row<f32>], alone: bool) -> Option<Operations> {
    let size = if alone { 1 } else { TOGETHER };
    macro_rules! kernel {
        ($($kernel:ident $order:literal $Row:ident -> $Out:ident { $($m:ident $k:literal),* } $($d_bound:ident)?;)*) => {
            match function {
                $(stringify!($kernel) if n == $order => rows
                    .chunks_exact(size)
                    .map(|rows| {
                        let plain = |i: usize| {
                            let row = &rows[i % size];
                            kernels::$Row {
                                $($m: row.m[$k],)*
                                eta: row.eta,
                                $($d_bound: 1.0_f32,)?
                            }
                        };
                        traced(|| {
                            let settings = Splat::<f32>::splat::<Counted<f32>>(
                                kernels::BoundSettings { overestimation: 0.0_f32, bias: 0.0 },
                            );
                            let plain: [_; TOGETHER] = array::from_fn(plain);
                            let row = Lanewise::<f32>::load::<Counted<f32>>(&plain);
                            let out = kernels::$kernel(&settings, row);
                            let mut plain: [kernels::$Out<f32>; TOGETHER] = bytemuck::Zeroable::zeroed();
                            Lanewise::<f32>::store::<Counted<f32>>(&out, &mut plain);
                        })
                    })
                    .fold(Operations::default(), |sum, one| sum.zip(one, |a, b| a + b)),)*
                _ => return None,
            }
        };
    }
    let sum = kernel! {
        moment_bound_n1 1 Row1 -> Bound { m0 0, m1 1, m2 2 };
        moment_bound_n2 2 Row2 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4 };
        moment_bound_n3 3 Row3 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6 };
        moment_bound_n4 4 Row4 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8 };
        moment_bound_n5 5 Row5 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10 };
        moment_bound_n6 6 Row6 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10, m11 11, m12 12 };
        moment_bound_compensated_n1 1 Row1 -> Bound { m0 0, m1 1, m2 2 };
        moment_bound_compensated_n2 2 Row2 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4 };
        moment_bound_compensated_n3 3 Row3 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6 };
        moment_bound_compensated_n4 4 Row4 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8 };
        moment_bound_compensated_n5 5 Row5 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10 };
        moment_bound_compensated_n6 6 Row6 -> Bound { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10, m11 11, m12 12 };
        moment_bound_adjoint_n1 1 AdjointRow1 -> Derivative1 { m0 0, m1 1, m2 2 } d_bound;
        moment_bound_adjoint_n2 2 AdjointRow2 -> Derivative2 { m0 0, m1 1, m2 2, m3 3, m4 4 } d_bound;
        moment_bound_adjoint_n3 3 AdjointRow3 -> Derivative3 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6 } d_bound;
        moment_bound_adjoint_n4 4 AdjointRow4 -> Derivative4 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8 } d_bound;
        moment_bound_adjoint_n5 5 AdjointRow5 -> Derivative5 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10 } d_bound;
        moment_bound_adjoint_n6 6 AdjointRow6 -> Derivative6 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10, m11 11, m12 12 } d_bound;
        moment_bound_adjoint_compensated_n1 1 AdjointRow1 -> Derivative1 { m0 0, m1 1, m2 2 } d_bound;
        moment_bound_adjoint_compensated_n2 2 AdjointRow2 -> Derivative2 { m0 0, m1 1, m2 2, m3 3, m4 4 } d_bound;
        moment_bound_adjoint_compensated_n3 3 AdjointRow3 -> Derivative3 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6 } d_bound;
        moment_bound_adjoint_compensated_n4 4 AdjointRow4 -> Derivative4 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8 } d_bound;
        moment_bound_adjoint_compensated_n5 5 AdjointRow5 -> Derivative5 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10 } d_bound;
        moment_bound_adjoint_compensated_n6 6 AdjointRow6 -> Derivative6 { m0 0, m1 1, m2 2, m3 3, m4 4, m5 5, m6 6, m7 7, m8 8, m9 9, m10 10, m11 11, m12 12 } d_bound;
    };
    let count = (rows.len() / size).max(1) as f64;
    Some(sum.zip(sum, |a, _| a / count))
}
