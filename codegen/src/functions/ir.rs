//! The small representation that every language is printed from: typed expressions of scalars,
//! locals in the order in which they are computed, loops and branches. Structures, tuples, arrays
//! and closures of the source are gone by then; what is left has a form in every language.

use std::rc::Rc;

pub use hankel_dsl::native::layout::COLUMNS;

/// A scalar type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Scalar {
    /// 32-bit float.
    F32,
    /// 32-bit unsigned integer.
    U32,
    /// 32-bit signed integer.
    I32,
    /// Truth value.
    Bool,
}

/// A type at a function's interface, or of a local.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Type {
    /// A scalar.
    Scalar(Scalar),
    /// A vector of 2, 3 or 4 components.
    Vector(Scalar, usize),
    /// A square matrix of floats, with so many columns.
    Matrix(usize),
    /// A structure of the library, by its name in Rust.
    Struct(String),
    /// What the host looks up: a function that it hands in, by its place among
    /// [`Function::params`].
    Lookup(Box<Signature>),
}

/// Parameters and result of what the host looks up.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Signature {
    /// The parameters' types.
    pub params: Vec<Type>,
    /// The result's type.
    pub result: Type,
}

impl Type {
    /// A float.
    pub const F32: Self = Self::Scalar(Scalar::F32);
    /// An unsigned integer.
    pub const U32: Self = Self::Scalar(Scalar::U32);
    /// A signed integer.
    pub const I32: Self = Self::Scalar(Scalar::I32);
    /// A truth value.
    pub const BOOL: Self = Self::Scalar(Scalar::Bool);

    /// The components of a vector or matrix, or the scalar itself.
    pub fn scalar(&self) -> Option<Scalar> {
        match self {
            Self::Scalar(s) | Self::Vector(s, _) => Some(*s),
            Self::Matrix(_) => Some(Scalar::F32),
            Self::Struct(_) | Self::Lookup(_) => None,
        }
    }
}

/// A number or truth value that is known.
#[derive(Clone, Copy, Debug)]
pub enum Literal {
    /// A finite float.
    F32(f32),
    /// An unsigned integer.
    U32(u32),
    /// A signed integer.
    I32(i32),
    /// A truth value.
    Bool(bool),
}

impl PartialEq for Literal {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::F32(a), Self::F32(b)) => a.to_bits() == b.to_bits(),
            (Self::U32(a), Self::U32(b)) => a == b,
            (Self::I32(a), Self::I32(b)) => a == b,
            (Self::Bool(a), Self::Bool(b)) => a == b,
            _ => false,
        }
    }
}

impl Literal {
    /// Its type.
    pub fn scalar(self) -> Scalar {
        match self {
            Self::F32(_) => Scalar::F32,
            Self::U32(_) => Scalar::U32,
            Self::I32(_) => Scalar::I32,
            Self::Bool(_) => Scalar::Bool,
        }
    }
}

/// A local, by its place among [`Function::locals`].
pub type Id = usize;

/// An expression.
pub type Expr = Rc<Node>;

/// An expression with its type.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// The type.
    pub ty: Type,
    /// What it is.
    pub kind: Kind,
}

/// What an expression is.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// A number.
    Literal(Literal),
    /// A local or parameter.
    Local(Id),
    /// A component (`x`), a matrix's column ([`COLUMNS`]) or a structure's member.
    Member(Expr, String),
    /// `-x`, `!x`
    Unary(Unary, Expr),
    /// `a + b`
    Binary(Binary, Expr, Expr),
    /// Something that every language has.
    Builtin(Builtin, Vec<Expr>),
    /// Another function of the library, by its name in Rust.
    Call(String, Vec<Expr>),
    /// What the host looks up, by the parameter.
    Lookup(Id, Vec<Expr>),
    /// A vector from its components, a matrix from its columns, or a structure from its members.
    Construct(Vec<Expr>),
}

/// An operator of one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unary {
    /// `-`
    Negate,
    /// `!` of a truth value.
    Not,
    /// `!` of an integer's bits.
    Invert,
}

/// An operator of two operands of one type (but for shifts, whose second is unsigned).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Binary {
    /// `+`, wrapping for integers.
    Add,
    /// `-`, wrapping for integers.
    Subtract,
    /// `*`, wrapping for integers.
    Multiply,
    /// `/`
    Divide,
    /// `<`
    Less,
    /// `<=`
    LessEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterEqual,
    /// `==`
    Equal,
    /// `!=`
    NotEqual,
    /// And of truth values.
    And,
    /// Or of truth values.
    Or,
    /// And of bits.
    BitAnd,
    /// Or of bits.
    BitOr,
    /// Exclusive or of bits.
    BitXor,
    /// `<<`
    ShiftLeft,
    /// `>>`
    ShiftRight,
}

/// What every language has under some name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Builtin {
    /// The smaller one.
    Min,
    /// The larger one.
    Max,
    /// Magnitude.
    Abs,
    /// Square root.
    Sqrt,
    /// The largest integer that is not larger.
    Floor,
    /// `select(condition, a, b)`: `a` where it holds, else `b`.
    Select,
    /// To a float.
    ToF32,
    /// To an unsigned integer; the number is in range.
    ToU32,
    /// To a signed integer, without its fraction; the number is in range.
    ToI32,
    /// A float's bits.
    BitsOf,
    /// The float that has these bits.
    FromBits,
    /// A function of the device's own, of floats.
    Native(Native),
}

/// The device's own functions, as exact as each language says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Native {
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
    /// Tangent.
    Tan,
    /// Arc sine.
    Asin,
    /// Arc cosine.
    Acos,
    /// Arc tangent.
    Atan,
    /// The angle of an ordinate and an abscissa.
    Atan2,
    /// The power of e.
    Exp,
    /// The power of 2.
    Exp2,
    /// Natural logarithm.
    Ln,
    /// Logarithm to base 2.
    Log2,
    /// A power.
    Pow,
}

impl Native {
    /// By its name in `hankel_dsl::math::native`.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "sin" => Self::Sin,
            "cos" => Self::Cos,
            "tan" => Self::Tan,
            "asin" => Self::Asin,
            "acos" => Self::Acos,
            "atan" => Self::Atan,
            "atan2" => Self::Atan2,
            "exp" => Self::Exp,
            "exp2" => Self::Exp2,
            "ln" => Self::Ln,
            "log2" => Self::Log2,
            "pow" => Self::Pow,
            _ => return None,
        })
    }

    /// Its name in most shading languages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sin => "sin",
            Self::Cos => "cos",
            Self::Tan => "tan",
            Self::Asin => "asin",
            Self::Acos => "acos",
            Self::Atan => "atan",
            Self::Atan2 => "atan2",
            Self::Exp => "exp",
            Self::Exp2 => "exp2",
            Self::Ln => "log",
            Self::Log2 => "log2",
            Self::Pow => "pow",
        }
    }
}

/// A statement.
#[derive(Clone, Debug, PartialEq)]
pub enum Stmt {
    /// A line of comment.
    Comment(String),
    /// A local that keeps its value.
    Let(Id, Expr),
    /// A local that changes.
    Var(Id, Expr),
    /// Gives a local another value.
    Assign(Id, Expr),
    /// A branch.
    If(Expr, Vec<Stmt>, Vec<Stmt>),
    /// Counts the local, an `i32` or `u32`, from the first number to below the second.
    For(Id, Expr, Expr, Vec<Stmt>),
    /// Leaves the innermost loop, or its turn; only the last statement of a block.
    Leave(Leave),
    /// Ends the function; only its last statement.
    Return(Expr),
}

/// What a statement leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leave {
    /// The loop: `break`.
    Loop,
    /// Its turn: `continue`.
    Turn,
}

/// A local or parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Local {
    /// Its name: the Rust variable's, made unique.
    pub name: String,
    /// Its type.
    pub ty: Type,
    /// How much the name says.
    pub rank: Rank,
}

/// How a local came to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rank {
    /// A part of a value that has no variable of its own in the source.
    Part,
    /// The parameter of a function whose body was put in place.
    Argument,
    /// A variable of the source.
    Variable,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Param {
    /// The local that it is.
    pub id: Id,
    /// Its type.
    pub ty: Type,
}

/// A function of a library.
#[derive(Clone, Debug, PartialEq)]
pub struct Function {
    /// Its name in Rust.
    pub name: String,
    /// Its documentation, a line each.
    pub docs: Vec<String>,
    /// File, as the crate names it, and line.
    pub place: String,
    /// Its parameters.
    pub params: Vec<Param>,
    /// What it gives.
    pub result: Type,
    /// Parameters and locals.
    pub locals: Vec<Local>,
    /// Its statements; the last one returns.
    pub body: Vec<Stmt>,
}

/// A structure at a function's interface.
#[derive(Clone, Debug, PartialEq)]
pub struct Struct {
    /// Its name in Rust.
    pub name: String,
    /// Its documentation.
    pub docs: Vec<String>,
    /// Members with their documentation.
    pub members: Vec<(String, Type, Vec<String>)>,
}

/// A constant of a library.
#[derive(Clone, Debug, PartialEq)]
pub struct Constant {
    /// Its name in Rust.
    pub name: String,
    /// Its documentation.
    pub docs: Vec<String>,
    /// Its type: a scalar or vector.
    pub ty: Type,
    /// Its components.
    pub values: Vec<Literal>,
}

/// Everything that a `library!` names, and what that calls.
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    /// Its name.
    pub name: String,
    /// The crate that it is from, and its version.
    pub krate: String,
    /// The crate's version.
    pub version: String,
    /// The number that rises when a signature changes.
    pub api: u32,
    /// Its documentation.
    pub docs: Vec<String>,
    /// The licence, as SPDX writes it.
    pub licence: String,
    /// What the keys in documentation stand for: `[MSM] C. Peters, R. Klein: …`.
    pub references: Vec<String>,
    /// Structures, each before those that hold it.
    pub structs: Vec<Struct>,
    /// Constants.
    pub constants: Vec<Constant>,
    /// Functions, each before those that call it.
    pub functions: Vec<Function>,
}

impl Library {
    /// A structure by its name.
    pub fn structure(&self, name: &str) -> Option<&Struct> {
        self.structs.iter().find(|s| s.name == name)
    }

    /// A function by its name.
    pub fn function(&self, name: &str) -> Option<&Function> {
        self.functions.iter().find(|f| f.name == name)
    }
}

/// Calls `with` for an expression and everything in it.
pub fn walk(e: &Expr, with: &mut dyn FnMut(&Expr)) {
    with(e);
    match &e.kind {
        Kind::Literal(_) | Kind::Local(_) => {}
        Kind::Member(x, _) | Kind::Unary(_, x) => walk(x, with),
        Kind::Binary(_, a, b) => {
            walk(a, with);
            walk(b, with);
        }
        Kind::Builtin(_, all)
        | Kind::Call(_, all)
        | Kind::Lookup(_, all)
        | Kind::Construct(all) => all.iter().for_each(|x| walk(x, with)),
    }
}

/// The expression with some of its parts replaced: where `with` gives something.
pub fn replace(e: &Expr, with: &dyn Fn(&Expr) -> Option<Expr>) -> Expr {
    if let Some(other) = with(e) {
        return other;
    }
    let all = |v: &[Expr]| v.iter().map(|x| replace(x, with)).collect();
    let kind = match &e.kind {
        Kind::Literal(_) | Kind::Local(_) => return e.clone(),
        Kind::Member(x, name) => Kind::Member(replace(x, with), name.clone()),
        Kind::Unary(op, x) => Kind::Unary(*op, replace(x, with)),
        Kind::Binary(op, a, b) => Kind::Binary(*op, replace(a, with), replace(b, with)),
        Kind::Builtin(b, v) => Kind::Builtin(*b, all(v)),
        Kind::Call(name, v) => Kind::Call(name.clone(), all(v)),
        Kind::Lookup(id, v) => Kind::Lookup(*id, all(v)),
        Kind::Construct(v) => Kind::Construct(all(v)),
    };
    Rc::new(Node {
        ty: e.ty.clone(),
        kind,
    })
}

/// Calls `with` for every expression that a statement holds directly, and for those of the
/// statements in it.
pub fn expressions(body: &[Stmt], with: &mut dyn FnMut(&Expr)) {
    for stmt in body {
        match stmt {
            Stmt::Comment(_) | Stmt::Leave(_) => {}
            Stmt::Let(_, e) | Stmt::Var(_, e) | Stmt::Assign(_, e) | Stmt::Return(e) => with(e),
            Stmt::If(c, a, b) => {
                with(c);
                expressions(a, with);
                expressions(b, with);
            }
            Stmt::For(_, from, to, body) => {
                with(from);
                with(to);
                expressions(body, with);
            }
        }
    }
}
