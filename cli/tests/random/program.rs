//! Random programs: typed, with an end, and the same for the same seed.
//!
//! A program is a tree. What its expressions can be made of is a table of forms, so that a new operation
//! is one line; what the numbers may do is said there, too:
//! - Integers wrap, shifts and indices are masked, divisors are odd: nothing is undefined anywhere.
//! - Floats are of two kinds. [`Floats::Whole`]: integers of few bits, of which every sum and product is
//!   exact however it is contracted or reordered, so that every language must give the same bits.
//!   [`Floats::Rounded`]: any, in kernels that are `exact`; languages that promise no rounding do not get
//!   them.
//! - Loops count, and nothing calls itself.

use hankel_dsl::native::inputs::Source;

/// A type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ty {
    Bool,
    U32,
    I32,
    F32,
    Vec2,
    Vec3,
    Vec4,
    UVec3,
}

use Ty::{Bool, F32, I32, U32, UVec3, Vec2, Vec3, Vec4};

impl Ty {
    const ALL: [Self; 8] = [Bool, U32, I32, F32, Vec2, Vec3, Vec4, UVec3];
    /// What functions take and give, and arrays have.
    const SCALARS: [Self; 3] = [U32, I32, F32];

    /// Its name in Rust.
    pub const fn name(self) -> &'static str {
        match self {
            Bool => "bool",
            U32 => "u32",
            I32 => "i32",
            F32 => "f32",
            Vec2 => "Vec2",
            Vec3 => "Vec3",
            Vec4 => "Vec4",
            UVec3 => "UVec3",
        }
    }
}

/// What a kernel's floats are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Floats {
    Whole,
    Rounded,
}

/// An operation: `{0}`, `{1}`, … are its operands.
#[derive(Debug, PartialEq, Eq)]
pub struct Form {
    pub result: Ty,
    pub operands: &'static [Ty],
    pub text: &'static str,
    /// Only in kernels with such floats.
    only: Option<Floats>,
}

const fn form(result: Ty, operands: &'static [Ty], text: &'static str) -> Form {
    Form {
        result,
        operands,
        text,
        only: None,
    }
}

const fn rounded(result: Ty, operands: &'static [Ty], text: &'static str) -> Form {
    Form {
        only: Some(Floats::Rounded),
        ..form(result, operands, text)
    }
}

/// `bound` is a function of each kernel's own kind of floats: it keeps them to where all is well.
const FORMS: &[Form] = &[
    form(U32, &[U32, U32], "{0}.wrapping_add({1})"),
    form(U32, &[U32, U32], "{0}.wrapping_sub({1})"),
    form(U32, &[U32, U32], "{0}.wrapping_mul({1})"),
    form(U32, &[U32, U32], "({0} & {1})"),
    form(U32, &[U32, U32], "({0} | {1})"),
    form(U32, &[U32, U32], "({0} ^ {1})"),
    form(U32, &[U32], "(!{0})"),
    form(U32, &[U32], "({0} as i8 as u32)"),
    form(U32, &[I32], "({0} as u16 as i32 as u32)"),
    form(I32, &[U32], "({0} as u8 as i16 as i32)"),
    form(I32, &[I32], "({0} as i16 as u16 as i32)"),
    form(U32, &[U32, U32], "({0} << ({1} & 31))"),
    form(U32, &[U32, U32], "({0} >> ({1} & 31))"),
    form(U32, &[U32, U32], "({0} / ({1} | 1))"),
    form(U32, &[U32, U32], "({0} % ({1} | 1))"),
    form(U32, &[U32, U32], "{0}.rotate_left({1} & 31)"),
    form(U32, &[U32], "{0}.count_ones()"),
    form(U32, &[U32], "{0}.leading_zeros()"),
    form(U32, &[U32], "{0}.trailing_zeros()"),
    form(U32, &[U32], "{0}.reverse_bits()"),
    form(U32, &[U32], "{0}.swap_bytes()"),
    form(U32, &[I32], "({0} as u32)"),
    form(U32, &[F32], "(bound({0}) as i32 as u32)"),
    form(U32, &[Bool], "u32::from({0})"),
    form(U32, &[Bool, U32, U32], "if {0} { {1} } else { {2} }"),
    form(U32, &[U32, U32], "least({0}, {1})"),
    form(U32, &[U32], "table.get({0} % table.len())"),
    form(U32, &[U32], "settings.keys[({0} & 1) as usize].z"),
    form(U32, &[], "settings.seed"),
    form(U32, &[], "row.a"),
    form(U32, &[], "i"),
    form(U32, &[UVec3], "{0}.x"),
    form(U32, &[UVec3], "{0}.z"),
    form(I32, &[I32, I32], "{0}.wrapping_add({1})"),
    form(I32, &[I32, I32], "{0}.wrapping_sub({1})"),
    form(I32, &[I32, I32], "{0}.wrapping_mul({1})"),
    form(I32, &[I32], "{0}.wrapping_neg()"),
    form(I32, &[I32, I32], "({0} & {1})"),
    form(I32, &[I32, I32], "({0} ^ {1})"),
    form(I32, &[I32, U32], "({0} << ({1} & 31))"),
    form(I32, &[I32, U32], "({0} >> ({1} & 31))"),
    // Neither by 0, nor of the least number by -1.
    form(I32, &[I32, I32], "(({0} >> 1) / ({1} | 1))"),
    form(I32, &[I32, I32], "(({0} >> 1) % ({1} | 1))"),
    form(I32, &[U32], "({0} as i32)"),
    form(I32, &[F32], "(bound({0}) as i32)"),
    form(I32, &[Bool, I32, I32], "if {0} { {1} } else { {2} }"),
    form(I32, &[], "settings.offset"),
    form(I32, &[], "row.b"),
    form(F32, &[F32, F32], "bound({0} + {1})"),
    form(F32, &[F32, F32], "bound({0} - {1})"),
    form(F32, &[F32, F32], "bound({0} * {1})"),
    form(F32, &[F32, F32, F32], "bound({0} * {1} + {2})"),
    form(F32, &[F32], "(-{0})"),
    form(F32, &[F32], "Real::abs({0})"),
    form(F32, &[F32, F32], "Real::min({0}, {1})"),
    form(F32, &[F32, F32], "Real::max({0}, {1})"),
    form(F32, &[F32], "Real::floor({0} * 0.25)"),
    form(F32, &[U32], "(({0} & 0x7ff) as f32)"),
    form(F32, &[I32], "(({0} % 1000) as f32)"),
    form(F32, &[Bool, F32, F32], "if {0} { {1} } else { {2} }"),
    form(F32, &[Vec2, Vec2], "bound({0}.dot({1}))"),
    form(F32, &[Vec3, Vec3], "bound({0}.dot({1}))"),
    form(F32, &[Vec4], "{0}.w"),
    form(F32, &[Vec3], "{0}.y"),
    form(F32, &[Vec2], "{0}.x"),
    form(F32, &[U32], "bound(floats.get({0} % floats.len()))"),
    form(F32, &[], "bound(settings.scale)"),
    form(F32, &[], "bound(row.x)"),
    form(F32, &[], "bound(row.y)"),
    rounded(F32, &[F32, F32], "bound({0} / (1.0 + {1} * {1}))"),
    rounded(F32, &[F32], "Real::sqrt(1.0 + Real::abs({0}))"),
    rounded(F32, &[F32, F32, F32, F32], "bound({0} * {1} - {2} * {3})"),
    rounded(F32, &[F32, F32], "bound({0} + {1} + {0})"),
    form(Bool, &[U32, U32], "({0} < {1})"),
    form(Bool, &[U32, U32], "({0} == {1})"),
    form(Bool, &[I32, I32], "({0} >= {1})"),
    form(Bool, &[I32, I32], "({0} != {1})"),
    form(Bool, &[F32, F32], "({0} < {1})"),
    form(Bool, &[F32, F32], "({0} >= {1})"),
    form(Bool, &[Bool, Bool], "({0} && {1})"),
    form(Bool, &[Bool, Bool], "({0} || {1})"),
    form(Bool, &[Bool, Bool], "({0} ^ {1})"),
    form(Bool, &[Bool], "(!{0})"),
    form(Bool, &[U32], "({0} & 1 == 0)"),
    form(Vec2, &[F32, F32], "Vec2::new({0}, {1})"),
    form(Vec2, &[Vec3], "{0}.truncate()"),
    form(Vec3, &[F32, F32, F32], "Vec3::new({0}, {1}, {2})"),
    form(Vec3, &[Vec2, F32], "{0}.extend({1})"),
    form(Vec3, &[Vec3, Vec3], "bound3({0} + {1})"),
    form(Vec3, &[Vec3, Vec3], "bound3({0} * {1})"),
    form(Vec3, &[Vec3, F32], "bound3({0} * {1})"),
    form(Vec3, &[Vec3], "(-{0})"),
    form(Vec3, &[Bool, Vec3, Vec3], "if {0} { {1} } else { {2} }"),
    form(Vec4, &[Vec3, F32], "{0}.extend({1})"),
    form(Vec4, &[Vec2, Vec2], "Vec4::new({0}.x, {1}.y, {0}.y, {1}.x)"),
    form(UVec3, &[U32, U32, U32], "UVec3::new({0}, {1}, {2})"),
    form(UVec3, &[UVec3, UVec3], "({0} ^ {1})"),
    form(UVec3, &[UVec3], "({0} >> 3_u32)"),
];

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Expr {
    /// A constant, of the type's own making from these bits.
    Literal(Ty, u32),
    /// A variable.
    Variable(Ty, u32),
    /// An element of a local array of four.
    Element(Ty, u32, Box<Expr>),
    /// An operation of [`FORMS`].
    Form(&'static Form, Vec<Expr>),
    /// A call of one of the kernel's functions.
    Call(Ty, u32, Vec<Expr>),
}

impl Expr {
    pub fn ty(&self) -> Ty {
        match self {
            Self::Literal(ty, _)
            | Self::Variable(ty, _)
            | Self::Element(ty, ..)
            | Self::Call(ty, ..) => *ty,
            Self::Form(form, _) => form.result,
        }
    }

    pub fn parts(&self) -> &[Self] {
        match self {
            Self::Literal(..) | Self::Variable(..) => &[],
            Self::Element(_, _, index) => std::slice::from_ref(index),
            Self::Form(_, parts) | Self::Call(_, _, parts) => parts,
        }
    }

    pub fn parts_mut(&mut self) -> &mut [Self] {
        match self {
            Self::Literal(..) | Self::Variable(..) => &mut [],
            Self::Element(_, _, index) => std::slice::from_mut(index),
            Self::Form(_, parts) | Self::Call(_, _, parts) => parts,
        }
    }
}

/// A statement. Variables and arrays are numbered over the whole kernel.
#[derive(Clone, Debug, PartialEq)]
pub enum Stmt {
    Let(u32, Expr),
    Assign(u32, Expr),
    /// At once: mostly the values of other variables, or their own.
    AssignBoth([u32; 2], [Expr; 2]),
    /// Four elements.
    Array(u32, [Expr; 4]),
    SetElement(u32, Expr, Expr),
    If(Expr, Vec<Stmt>, Vec<Stmt>),
    /// One of the blocks, by a number; the variable gets which. (Arms without a value of their own can
    /// become one block, which rust-gpu 0.10 refuses: `tests/upstream/rust-gpu-equal-arms`.)
    Match(u32, Expr, Vec<Vec<Stmt>>),
    /// So many rounds; the variable counts them.
    Loop(Style, u32, u32, Vec<Stmt>),
    /// Within a loop.
    BreakIf(Expr),
    ContinueIf(Expr),
    /// Ends the function.
    ReturnIf(Expr, Expr),
    /// Adds to one of 8 counters.
    Count(Expr, Expr),
    /// Writes the invocation's own element of the buffer, and takes what stands there then.
    Store(u32, Expr),
    /// Gives a number to another invocation of the workgroup; the variable gets another one's.
    Exchange(u32, u32, Expr),
}

/// How a loop is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    For,
    While,
    Loop,
}

/// A function, which sees its parameters only.
#[derive(Clone, Debug, PartialEq)]
pub struct Function {
    pub parameters: Vec<(Ty, u32)>,
    pub body: Vec<Stmt>,
    pub result: Expr,
}

/// A kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    pub seed: u64,
    pub floats: Floats,
    /// Its invocations exchange numbers through workgroup memory.
    pub cooperative: bool,
    pub functions: Vec<Function>,
    pub body: Vec<Stmt>,
    /// A `u32`, an `i32`, a `f32`.
    pub result: [Expr; 3],
}

impl Program {
    /// Statements and operations.
    pub fn size(&self) -> usize {
        let functions = self.functions.iter();
        let functions: usize = functions
            .map(|it| 1 + statements(&it.body) + operations(&it.result))
            .sum();
        functions + statements(&self.body) + self.result.iter().map(operations).sum::<usize>()
    }
}

fn operations(expr: &Expr) -> usize {
    // A literal is the simplest.
    let own = usize::from(!matches!(expr, Expr::Literal(..)));
    own + expr.parts().iter().map(operations).sum::<usize>()
}

fn statements(block: &[Stmt]) -> usize {
    let one = |it: &Stmt| {
        2 + expressions(it).iter().map(|e| operations(e)).sum::<usize>()
            + blocks(it).iter().map(|b| statements(b)).sum::<usize>()
    };
    block.iter().map(one).sum()
}

/// The expressions of a statement itself.
pub fn expressions(statement: &Stmt) -> Vec<&Expr> {
    match statement {
        Stmt::Let(_, e)
        | Stmt::Assign(_, e)
        | Stmt::If(e, ..)
        | Stmt::Match(_, e, _)
        | Stmt::BreakIf(e)
        | Stmt::ContinueIf(e)
        | Stmt::Store(_, e)
        | Stmt::Exchange(_, _, e) => vec![e],
        Stmt::AssignBoth(_, both) => both.iter().collect(),
        Stmt::Array(_, all) => all.iter().collect(),
        Stmt::SetElement(_, a, b) | Stmt::ReturnIf(a, b) | Stmt::Count(a, b) => vec![a, b],
        Stmt::Loop(..) => Vec::new(),
    }
}

/// The same, to be changed.
pub fn expressions_mut(statement: &mut Stmt) -> Vec<&mut Expr> {
    match statement {
        Stmt::Let(_, e)
        | Stmt::Assign(_, e)
        | Stmt::If(e, ..)
        | Stmt::Match(_, e, _)
        | Stmt::BreakIf(e)
        | Stmt::ContinueIf(e)
        | Stmt::Store(_, e)
        | Stmt::Exchange(_, _, e) => vec![e],
        Stmt::AssignBoth(_, both) => both.iter_mut().collect(),
        Stmt::Array(_, all) => all.iter_mut().collect(),
        Stmt::SetElement(_, a, b) | Stmt::ReturnIf(a, b) | Stmt::Count(a, b) => vec![a, b],
        Stmt::Loop(..) => Vec::new(),
    }
}

/// The blocks within a statement.
pub fn blocks(statement: &Stmt) -> Vec<&Vec<Stmt>> {
    match statement {
        Stmt::If(_, a, b) => vec![a, b],
        Stmt::Match(_, _, all) => all.iter().collect(),
        Stmt::Loop(.., body) => vec![body],
        _ => Vec::new(),
    }
}

/// The same, to be changed.
pub fn blocks_mut(statement: &mut Stmt) -> Vec<&mut Vec<Stmt>> {
    match statement {
        Stmt::If(_, a, b) => vec![a, b],
        Stmt::Match(_, _, all) => all.iter_mut().collect(),
        Stmt::Loop(.., body) => vec![body],
        _ => Vec::new(),
    }
}

/// Makes programs.
struct Maker {
    chance: Source,
    floats: Floats,
    cooperative: bool,
    /// Types of the functions' parameters, and their result's.
    signatures: Vec<(Vec<Ty>, Ty)>,
    /// What can be seen: variables that can be assigned, those that only count, arrays.
    variables: Vec<(Ty, u32)>,
    counters: Vec<u32>,
    arrays: Vec<(Ty, u32)>,
    next: u32,
    /// Within a function: nothing of the kernel's own is there.
    inside: bool,
    loops: u32,
    /// What an early return gives; none where there is none.
    returns: Option<Ty>,
}

/// The program of a seed.
pub fn program(seed: u64) -> Program {
    let mut chance = Source::new(seed);
    let floats = chance.pick(&[Floats::Whole, Floats::Whole, Floats::Rounded]);
    let cooperative = chance.count(0, 5) == 0;
    let mut maker = Maker {
        chance,
        floats,
        cooperative,
        signatures: Vec::new(),
        variables: Vec::new(),
        counters: Vec::new(),
        arrays: Vec::new(),
        next: 0,
        inside: true,
        loops: 0,
        returns: None,
    };
    let functions = (0..maker.chance.count(0, 2))
        .map(|_| maker.function())
        .collect();
    maker.inside = false;
    maker.next = 100;
    let count = maker.chance.count(4, 12);
    let body = maker.block(count, 3);
    let result = [U32, I32, F32].map(|ty| maker.result(ty));
    Program {
        seed,
        floats,
        cooperative,
        functions,
        body,
        result,
    }
}

impl Maker {
    fn fresh(&mut self) -> u32 {
        self.next += 1;
        self.next
    }

    fn function(&mut self) -> Function {
        let parameters: Vec<(Ty, u32)> = (0..self.chance.count(1, 3))
            .map(|_| (self.chance.pick(&Ty::SCALARS), self.fresh()))
            .collect();
        let ty = self.chance.pick(&Ty::SCALARS);
        (self.variables, self.returns) = (parameters.clone(), Some(ty));
        (self.counters, self.arrays) = (Vec::new(), Vec::new());
        let count = self.chance.count(1, 4);
        let body = self.block_in_place(count, 2);
        let result = self.result(ty);
        (self.variables, self.arrays) = (Vec::new(), Vec::new());
        self.returns = None;
        let types = parameters.iter().map(|p| p.0).collect();
        self.signatures.push((types, ty));
        Function {
            parameters,
            body,
            result,
        }
    }

    /// A value that depends on what was computed.
    fn result(&mut self, ty: Ty) -> Expr {
        let own: Vec<(Ty, u32)> = self
            .variables
            .iter()
            .copied()
            .filter(|v| v.0 == ty)
            .collect();
        match own.last() {
            Some((ty, id)) if self.chance.count(0, 3) > 0 => Expr::Variable(*ty, *id),
            _ => self.expr(ty, 3),
        }
    }

    /// Statements whose variables nobody sees after them.
    fn block(&mut self, count: u32, depth: u32) -> Vec<Stmt> {
        // The outermost block's are seen by the result.
        if depth == 3 {
            return self.block_in_place(count, depth);
        }
        let (variables, counters, arrays) =
            (self.variables.len(), self.counters.len(), self.arrays.len());
        let block = self.block_in_place(count, depth);
        self.variables.truncate(variables);
        self.counters.truncate(counters);
        self.arrays.truncate(arrays);
        block
    }

    fn block_in_place(&mut self, count: u32, depth: u32) -> Vec<Stmt> {
        (0..count).map(|_| self.statement(depth)).collect()
    }

    fn statement(&mut self, depth: u32) -> Stmt {
        loop {
            let assignable = !self.variables.is_empty();
            return match self.chance.count(0, 23) {
                0..=5 => {
                    let ty = self.chance.pick(&Ty::ALL);
                    let value = self.expr(ty, 3);
                    let id = self.fresh();
                    self.variables.push((ty, id));
                    Stmt::Let(id, value)
                }
                6..=9 if assignable => {
                    let (ty, id) = self.variable();
                    Stmt::Assign(id, self.expr(ty, 3))
                }
                10 => {
                    let ty = self.chance.pick(&Ty::SCALARS);
                    let all = [(); 4].map(|()| self.expr(ty, 2));
                    let id = self.fresh();
                    self.arrays.push((ty, id));
                    Stmt::Array(id, all)
                }
                11 if !self.arrays.is_empty() => {
                    let all = self.arrays.clone();
                    let (ty, id) = self.chance.pick(&all);
                    Stmt::SetElement(id, self.expr(U32, 2), self.expr(ty, 2))
                }
                12..=13 if depth > 0 => {
                    let condition = self.expr(Bool, 2);
                    let count = self.chance.count(1, 3);
                    let accept = self.block(count, depth - 1);
                    let count = self.chance.count(0, 2);
                    Stmt::If(condition, accept, self.block(count, depth - 1))
                }
                14 if depth > 0 => {
                    let number = self.expr(U32, 2);
                    let arms = (0..self.chance.count(2, 4))
                        .map(|_| {
                            let count = self.chance.count(0, 2);
                            self.block(count, depth - 1)
                        })
                        .collect();
                    let id = self.fresh();
                    self.variables.push((U32, id));
                    Stmt::Match(id, number, arms)
                }
                15..=16 if depth > 0 => {
                    let style = self.chance.pick(&[Style::For, Style::While, Style::Loop]);
                    let (id, rounds) = (self.fresh(), self.chance.count(0, 6));
                    self.counters.push(id);
                    self.loops += 1;
                    let count = self.chance.count(1, 4);
                    let body = self.block(count, depth - 1);
                    self.loops -= 1;
                    self.counters.retain(|it| *it != id);
                    Stmt::Loop(style, id, rounds, body)
                }
                17 if self.loops > 0 => {
                    let condition = self.expr(Bool, 2);
                    if self.chance.count(0, 1) == 0 {
                        Stmt::BreakIf(condition)
                    } else {
                        Stmt::ContinueIf(condition)
                    }
                }
                18 => match self.returns {
                    Some(ty) => Stmt::ReturnIf(self.expr(Bool, 2), self.expr(ty, 2)),
                    None => continue,
                },
                19 if !self.inside => Stmt::Count(self.expr(U32, 2), self.expr(U32, 2)),
                20 if !self.inside && !self.cooperative => {
                    let value = self.expr(U32, 2);
                    let id = self.fresh();
                    self.variables.push((U32, id));
                    Stmt::Store(id, value)
                }
                // Where control flow is the same for all: in no block.
                21 if self.cooperative && !self.inside && depth == 3 => {
                    let value = self.expr(U32, 2);
                    let (id, by) = (self.fresh(), self.chance.count(1, 63));
                    self.variables.push((U32, id));
                    Stmt::Exchange(id, by, value)
                }
                22..=23 if assignable => {
                    let targets = [self.variable(), self.variable()];
                    let values = targets.map(|(ty, _)| self.moved(ty));
                    Stmt::AssignBoth(targets.map(|(_, id)| id), values)
                }
                _ => continue,
            };
        }
    }

    fn variable(&mut self) -> (Ty, u32) {
        let all = self.variables.clone();
        self.chance.pick(&all)
    }

    /// Mostly the value of a variable. There is one of this type.
    fn moved(&mut self, ty: Ty) -> Expr {
        if self.chance.count(0, 3) == 0 {
            return self.expr(ty, 2);
        }
        let all = self.variables.iter().filter(|v| v.0 == ty);
        let all: Vec<u32> = all.map(|v| v.1).collect();
        Expr::Variable(ty, self.chance.pick(&all))
    }

    fn expr(&mut self, ty: Ty, depth: u32) -> Expr {
        let known: Vec<(Ty, u32)> = self
            .variables
            .iter()
            .copied()
            .filter(|v| v.0 == ty)
            .collect();
        if !known.is_empty() && self.chance.count(0, 2) == 0 {
            let (ty, id) = self.chance.pick(&known);
            return Expr::Variable(ty, id);
        }
        if ty == U32 && !self.counters.is_empty() && self.chance.count(0, 3) == 0 {
            let counters = self.counters.clone();
            return Expr::Variable(U32, self.chance.pick(&counters));
        }
        if depth == 0 {
            let inputs = |form: &&'static Form| form.result == ty && form.operands.is_empty();
            let inputs: Vec<&'static Form> = FORMS.iter().filter(inputs).collect();
            if !self.inside && !inputs.is_empty() && self.chance.count(0, 3) > 0 {
                return Expr::Form(self.chance.pick(&inputs), Vec::new());
            }
            return Expr::Literal(ty, self.chance.bits() as u32);
        }
        let arrays: Vec<(Ty, u32)> = self.arrays.iter().copied().filter(|v| v.0 == ty).collect();
        if !arrays.is_empty() && self.chance.count(0, 2) == 0 {
            let (ty, id) = self.chance.pick(&arrays);
            return Expr::Element(ty, id, Box::new(self.expr(U32, depth - 1)));
        }
        let functions: Vec<usize> = (0..self.signatures.len())
            .filter(|n| self.signatures[*n].1 == ty)
            .collect();
        if !functions.is_empty() && self.chance.count(0, 3) == 0 {
            let n = self.chance.pick(&functions);
            let types = self.signatures[n].0.clone();
            let arguments = types.iter().map(|ty| self.expr(*ty, depth - 1)).collect();
            return Expr::Call(ty, n as u32, arguments);
        }
        let fits = |form: &&'static Form| {
            let outside = ["row.", "settings.", "table.", "floats."];
            let outside = outside.iter().any(|it| form.text.contains(it)) || form.text == "i";
            // Where a division or an index fails, an invocation would end before a barrier: that is
            // refused, even where neither can fail.
            let fails = ["{1} | 1", "len()", "as usize"];
            let fails = fails.iter().any(|it| form.text.contains(it));
            form.result == ty
                && !(self.cooperative && fails)
                && form.only.is_none_or(|floats| floats == self.floats)
                && !(self.inside && outside)
        };
        let forms: Vec<&'static Form> = FORMS.iter().filter(fits).collect();
        if forms.is_empty() || self.chance.count(0, 15) == 0 {
            return Expr::Literal(ty, self.chance.bits() as u32);
        }
        let form = self.chance.pick(&forms);
        let parts = form.operands.iter().map(|ty| self.expr(*ty, depth - 1));
        Expr::Form(form, parts.collect())
    }
}
