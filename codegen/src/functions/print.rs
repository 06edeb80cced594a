//! What all languages are printed by: a language says how its types, literals, operators and
//! statements look, the rest is the same everywhere.

use super::ends::early;
use super::ir::{
    Binary, Builtin, COLUMNS, Constant, Expr, Function, Id, Kind, Leave, Library, Literal, Scalar,
    Signature, Stmt, Struct, Type, Unary,
};
use super::names::pascal;
use crate::comment;

/// Columns of a line at most.
pub const WIDTH: usize = 110;

/// How strongly a text holds together: what is weaker than its surroundings is put in brackets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bond {
    /// A choice: `a ? b : c`.
    Choice,
    /// `a || b`
    Or,
    /// `a && b`
    And,
    /// Operators of bits; never mixed with others without brackets.
    Bits,
    /// `a < b`
    Comparison,
    /// `a + b`
    Sum,
    /// `a * b`
    Product,
    /// `-a`
    Sign,
    /// A name, a number, a call.
    Atom,
}

/// A piece of text.
pub type Piece = (String, Bond);

/// An atom.
pub fn atom(text: impl Into<String>) -> Piece {
    (text.into(), Bond::Atom)
}

/// How names of the library look from outside.
#[derive(Clone, Debug)]
pub struct Naming {
    /// `hankel`
    pub prefix: String,
    /// The library's name.
    pub library: String,
}

impl Naming {
    /// `hankel_hamburger_bound`
    pub fn function(&self, name: &str) -> String {
        if self.prefix.is_empty() {
            name.into()
        } else {
            format!("{}_{name}", self.prefix)
        }
    }

    /// `HANKEL_SHADOWS_BIAS`
    pub fn constant(&self, name: &str) -> String {
        format!("{}_{name}", self.guard())
    }

    /// `HankelBounds`
    pub fn structure(&self, name: &str) -> String {
        format!("{}{name}", pascal(&self.prefix))
    }

    /// `HANKEL_SHADOWS`
    pub fn guard(&self) -> String {
        self.function(&self.library).to_uppercase()
    }
}

/// A language.
pub trait Dialect {
    /// How names look.
    fn naming(&self) -> &Naming;

    /// A type.
    fn ty(&self, ty: &Type) -> String;

    /// A number.
    fn literal(&self, literal: Literal) -> Piece;

    /// Something that every language has. Arguments are printed, and have their expressions' types.
    fn builtin(&self, which: Builtin, args: &[Piece], types: &[&Type]) -> Piece;

    /// A vector or structure from its parts.
    fn construct(&self, ty: &Type, parts: &[Piece]) -> Piece;

    /// The head of a function with its opening brace.
    fn head(&self, function: &Function) -> String;

    /// A local that keeps its value.
    fn constant_local(&self, name: &str, ty: &Type, value: &Piece) -> String;

    /// A local that changes.
    fn variable(&self, name: &str, ty: &Type, value: &Piece) -> String {
        self.constant_local(name, ty, value)
    }

    /// Another value for a local.
    fn assign(&self, name: &str, value: &Piece) -> String {
        format!("{name} = {};", value.0)
    }

    /// The head of a counting loop.
    fn counting(&self, name: &str, ty: &Type, from: &Piece, to: &Piece) -> String {
        format!(
            "for ({} {name} = {}; {name} < {}; {name}++) {{",
            self.ty(ty),
            from.0,
            bracketed(to, Bond::Sum)
        )
    }

    /// Leaves the innermost loop, or its turn.
    fn leave(&self, what: Leave) -> &'static str {
        match what {
            Leave::Loop => "break;",
            Leave::Turn => "continue;",
        }
    }

    /// The end of a loop.
    fn end_of_loop(&self) -> &'static str {
        "}"
    }

    /// The head of a branch.
    fn condition(&self, condition: &Piece) -> String {
        format!("if ({}) {{", condition.0)
    }

    /// Between the two sides of a branch.
    fn otherwise(&self) -> &'static str {
        "} else {"
    }

    /// The end of a branch.
    fn end_of_branch(&self) -> &'static str {
        "}"
    }

    /// The result, in the last line.
    fn give(&self, _: &Type, value: &Piece) -> String {
        format!("return {};", value.0)
    }

    /// Whether a branch can return.
    fn returns_early(&self) -> bool {
        true
    }

    /// The same before the last line.
    fn give_early(&self, ty: &Type, value: &Piece) -> String {
        self.give(ty, value)
    }

    /// The end of a function.
    fn end(&self, _: &Function) -> String {
        "}".into()
    }

    /// A component, column or member.
    fn member(&self, of: &Piece, ty: &Type, name: &str) -> Piece {
        let of = bracketed(of, Bond::Atom);
        match ty {
            Type::Matrix(_) => atom(format!("{of}[{}]", column(name))),
            _ => atom(format!("{of}.{name}")),
        }
    }

    /// A component of a matrix's column.
    fn element(&self, matrix: &Piece, ty: &Type, column: &str, row: &str) -> Piece {
        let size = match ty {
            Type::Matrix(size) => *size,
            _ => 0,
        };
        let column = self.member(matrix, ty, column);
        self.member(&column, &Type::Vector(Scalar::F32, size), row)
    }

    /// An operator of one operand.
    fn unary(&self, op: Unary, x: &Piece) -> Piece {
        let sign = match op {
            Unary::Negate => "-",
            Unary::Not => "!",
            Unary::Invert => "~",
        };
        (format!("{sign}{}", bracketed(x, Bond::Atom)), Bond::Sign)
    }

    /// An operator of two operands.
    fn binary(&self, op: Binary, a: &Piece, b: &Piece, _: &Type) -> Piece {
        operator(op, a, b)
    }

    /// A call of another function of the library.
    fn call(&self, name: &str, args: &[Piece]) -> Piece {
        atom(format!("{}({})", self.naming().function(name), list(args)))
    }

    /// A call of what the host looks up.
    fn lookup(&self, function: &Function, id: Id, _: &Signature, args: &[Piece]) -> Piece {
        atom(format!("{}({})", function.locals[id].name, list(args)))
    }

    /// A call's argument that is a lookup.
    fn passed(&self, function: &Function, id: Id) -> Piece {
        atom(function.locals[id].name.clone())
    }

    /// A local's name.
    fn local(&self, name: &str) -> String {
        name.into()
    }

    /// A line of comment.
    fn comment(&self, text: &str) -> String {
        format!("// {}", comment::line(text))
    }

    /// One step of indentation.
    fn indent(&self) -> &'static str {
        "    "
    }
}

/// With brackets if it holds together less than asked for.
pub fn bracketed(piece: &Piece, least: Bond) -> String {
    if piece.1 < least {
        format!("({})", piece.0)
    } else {
        piece.0.clone()
    }
}

/// Separated by commas.
pub fn list(pieces: &[Piece]) -> String {
    let all: Vec<&str> = pieces.iter().map(|p| p.0.as_str()).collect();
    all.join(", ")
}

/// An operator as most languages have it. Order of operations is that of the source, to the bracket.
pub fn operator(op: Binary, a: &Piece, b: &Piece) -> Piece {
    let (sign, own) = match op {
        Binary::Add => ("+", Bond::Sum),
        Binary::Subtract => ("-", Bond::Sum),
        Binary::Multiply => ("*", Bond::Product),
        Binary::Divide => ("/", Bond::Product),
        Binary::Less => ("<", Bond::Comparison),
        Binary::LessEqual => ("<=", Bond::Comparison),
        Binary::Greater => (">", Bond::Comparison),
        Binary::GreaterEqual => (">=", Bond::Comparison),
        Binary::Equal => ("==", Bond::Comparison),
        Binary::NotEqual => ("!=", Bond::Comparison),
        Binary::And => ("&&", Bond::And),
        Binary::Or => ("||", Bond::Or),
        Binary::BitAnd => ("&", Bond::Bits),
        Binary::BitOr => ("|", Bond::Bits),
        Binary::BitXor => ("^", Bond::Bits),
        Binary::ShiftLeft => ("<<", Bond::Bits),
        Binary::ShiftRight => (">>", Bond::Bits),
    };
    // On the left the same operator needs no bracket; on the right it always does. Signs on the
    // right are in brackets, so that `a - -b` is never written.
    let (left, right) = match own {
        Bond::Sum => (Bond::Sum, Bond::Product),
        Bond::Product => (Bond::Product, Bond::Sign),
        Bond::Comparison => (Bond::Sum, Bond::Sum),
        Bond::And => (Bond::And, Bond::Comparison),
        Bond::Or => (Bond::Or, Bond::Comparison),
        _ => (Bond::Atom, Bond::Atom),
    };
    let chains = |p: &Piece| match own {
        // `a && b || c` is written with brackets: not every language takes it without.
        Bond::And | Bond::Or => p.1 == own || p.1 >= Bond::Comparison,
        _ => p.1 >= left,
    };
    let a = if chains(a) {
        a.0.clone()
    } else {
        format!("({})", a.0)
    };
    let b = if b.1 == Bond::Sign && own >= Bond::Sum {
        format!("({})", b.0)
    } else {
        bracketed(b, right)
    };
    (format!("{a} {sign} {b}"), own)
}

/// `a ? b : c`
pub fn choice(args: &[Piece]) -> Piece {
    let condition = bracketed(&args[0], Bond::Comparison);
    let a = bracketed(&args[1], Bond::Or);
    let b = bracketed(&args[2], Bond::Or);
    (format!("{condition} ? {a} : {b}"), Bond::Choice)
}

/// `name(a, b)`
pub fn called(name: &str, args: &[Piece]) -> Piece {
    atom(format!("{name}({})", list(args)))
}

/// A float with as few digits as read back to the same bits, never without a point or an exponent.
pub fn digits(value: f32) -> String {
    format!("{value:?}")
}

/// A float with a suffix, a negative one as a sign.
pub fn signed(text: String) -> Piece {
    if text.starts_with('-') {
        (text, Bond::Sign)
    } else {
        atom(text)
    }
}

/// Prints a function's text, but not its documentation.
pub fn function(dialect: &dyn Dialect, function: &Function) -> String {
    let mut lines = Vec::new();
    for line in dialect.head(function).split('\n') {
        lines.extend(wrapped(line, dialect.indent()));
    }
    let printer = Printer { dialect, function };
    if dialect.returns_early() {
        printer.block(&early(&function.body), 1, &mut lines);
    } else {
        printer.block(&function.body, 1, &mut lines);
    }
    lines.push(dialect.end(function));
    let mut text = String::new();
    for line in lines {
        text.push_str(&line);
        text.push('\n');
    }
    text
}

struct Printer<'a> {
    dialect: &'a dyn Dialect,
    function: &'a Function,
}

impl Printer<'_> {
    fn name(&self, id: Id) -> String {
        self.dialect.local(&self.function.locals[id].name)
    }

    fn block(&self, body: &[Stmt], depth: usize, lines: &mut Vec<String>) {
        let indent = self.dialect.indent().repeat(depth);
        let d = self.dialect;
        for (i, stmt) in body.iter().enumerate() {
            let text = match stmt {
                Stmt::Comment(text) => {
                    lines.push(format!("{indent}{}", d.comment(&ascii(text))));
                    continue;
                }
                Stmt::Let(id, e) => d.constant_local(&self.name(*id), &e.ty, &self.expression(e)),
                Stmt::Var(id, e) => d.variable(&self.name(*id), &e.ty, &self.expression(e)),
                Stmt::Assign(id, e) => d.assign(&self.name(*id), &self.expression(e)),
                Stmt::Leave(what) => d.leave(*what).to_owned(),
                Stmt::Return(e) if depth == 1 && i + 1 == body.len() => {
                    d.give(&e.ty, &self.expression(e))
                }
                Stmt::Return(e) => d.give_early(&e.ty, &self.expression(e)),
                Stmt::If(c, a, b) => {
                    push(d, lines, &indent, &d.condition(&self.expression(c)));
                    self.block(a, depth + 1, lines);
                    if !b.is_empty() {
                        lines.push(format!("{indent}{}", d.otherwise()));
                        self.block(b, depth + 1, lines);
                    }
                    lines.push(format!("{indent}{}", d.end_of_branch()));
                    continue;
                }
                Stmt::For(id, from, to, inner) => {
                    let (from, to) = (self.expression(from), self.expression(to));
                    let ty = &self.function.locals[*id].ty;
                    push(
                        d,
                        lines,
                        &indent,
                        &d.counting(&self.name(*id), ty, &from, &to),
                    );
                    self.block(inner, depth + 1, lines);
                    lines.push(format!("{indent}{}", d.end_of_loop()));
                    continue;
                }
            };
            push(d, lines, &indent, &text);
        }
    }

    fn expression(&self, e: &Expr) -> Piece {
        let d = self.dialect;
        let all = |v: &[Expr]| -> Vec<Piece> { v.iter().map(|x| self.expression(x)).collect() };
        match &e.kind {
            Kind::Literal(l) => d.literal(*l),
            Kind::Local(id) => match &e.ty {
                Type::Lookup(_) => d.passed(self.function, *id),
                _ => atom(self.name(*id)),
            },
            Kind::Member(of, name) => match &of.kind {
                Kind::Member(matrix, column) if matches!(matrix.ty, Type::Matrix(_)) => {
                    d.element(&self.expression(matrix), &matrix.ty, column, name)
                }
                _ => d.member(&self.expression(of), &of.ty, name),
            },
            Kind::Unary(op, x) => d.unary(*op, &self.expression(x)),
            Kind::Binary(op, a, b) => {
                d.binary(*op, &self.expression(a), &self.expression(b), &a.ty)
            }
            Kind::Builtin(which, v) => {
                let types: Vec<&Type> = v.iter().map(|x| &x.ty).collect();
                d.builtin(*which, &all(v), &types)
            }
            Kind::Call(name, v) => d.call(name, &all(v)),
            Kind::Lookup(id, v) => {
                let Type::Lookup(signature) = &self.function.locals[*id].ty else {
                    return atom(self.name(*id));
                };
                d.lookup(self.function, *id, signature, &all(v))
            }
            Kind::Construct(v) => d.construct(&e.ty, &all(v)),
        }
    }
}

/// Whether a value is a number, vector or matrix in `f32` that rounds on its way: where a language pins
/// locals, it must be one.
pub fn rounds(ty: &Type, value: &Piece) -> bool {
    let is_float = matches!(
        ty,
        Type::Scalar(Scalar::F32) | Type::Vector(Scalar::F32, _) | Type::Matrix(_)
    );
    is_float
        && [" + ", " - ", " * ", " / "]
            .iter()
            .any(|op| value.0.contains(op))
}

/// Adds a statement, in lines that are not too long.
fn push(dialect: &dyn Dialect, lines: &mut Vec<String>, indent: &str, text: &str) {
    for part in text.split('\n') {
        let further = format!("{indent}{}", dialect.indent());
        lines.extend(wrapped(&format!("{indent}{part}"), &further));
    }
}

/// Breaks a line at spaces that are least inside of brackets.
pub fn wrapped(line: &str, indent: &str) -> Vec<String> {
    let mut out = Vec::new();
    let mut rest = line.to_owned();
    while columns(&rest) > WIDTH {
        let Some(at) = best_break(&rest) else {
            break;
        };
        let tail = rest.split_off(at);
        out.push(rest.trim_end().to_owned());
        rest = format!("{indent}{}", tail.trim_start());
    }
    out.push(rest);
    out
}

fn columns(text: &str) -> usize {
    text.chars().map(|c| if c == '\t' { 4 } else { 1 }).sum()
}

fn best_break(line: &str) -> Option<usize> {
    let start = line.len() - line.trim_start().len();
    let mut depth = 0_i32;
    let mut best: Option<(i32, usize)> = None;
    let mut column = 0;
    let bytes = line.as_bytes();
    // A name stays on the line of what it gets, unless that leaves no place to break at.
    let assigned = line.find(" = ").map_or(0, |at| at + 3);
    for (i, c) in line.char_indices() {
        column += if c == '\t' { 4 } else { 1 };
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            // Before a method of what a call gave.
            '.' if column <= WIDTH && i > start + 12 && bytes.get(i - 1) == Some(&b')') => {
                let weight = depth * 4 + 2;
                if best.is_none_or(|(w, _)| weight <= w) {
                    best = Some((weight, i));
                }
            }
            // Before an operator, after a comma; not after `=` at once.
            ' ' if i > start + 12 && column <= WIDTH => {
                let after_operator = matches!(
                    bytes.get(i - 1),
                    Some(
                        b'+' | b'-'
                            | b'*'
                            | b'/'
                            | b'<'
                            | b'>'
                            | b'='
                            | b'?'
                            | b':'
                            | b'&'
                            | b'|'
                            | b'!'
                            | b'^'
                    )
                );
                let empty_bracket = matches!(bytes.get(i - 1), Some(b'('))
                    || matches!(bytes.get(i + 1), Some(b')' | b'{' | b';' | b'='));
                // After a comma rather than within a sum, and that rather than within a product.
                let next = bytes.get(i + 1);
                let weight = match (bytes.get(i - 1), next) {
                    (Some(b','), _) => 0,
                    (_, Some(b'?' | b':' | b'|' | b'&')) => 1,
                    (_, Some(b'*' | b'/')) => 3,
                    _ => 2,
                };
                let weight = depth * 4 + weight;
                let weight = if i < assigned { weight + 1000 } else { weight };
                if !after_operator && !empty_bracket && best.is_none_or(|(w, _)| weight <= w) {
                    best = Some((weight, i));
                }
            }
            _ => {}
        }
    }
    best.map(|(_, i)| i).or_else(|| {
        // Nothing but calls within calls: behind a bracket.
        line.char_indices()
            .take(WIDTH)
            .filter(|(i, c)| *c == '(' && *i > start + 12)
            .map(|(i, _)| i + 1)
            .last()
    })
}

/// Lines of documentation in a language's comment, not too long.
pub fn documented(lines: &[String], prefix: &str) -> String {
    let mut text = String::new();
    for line in reflowed(lines) {
        text.push_str(format!("{prefix} {line}").trim_end());
        text.push('\n');
    }
    text
}

/// Documentation as `/** … */`.
pub fn block_comment(docs: &[String]) -> String {
    if docs.is_empty() {
        return String::new();
    }
    let text = documented(docs, " *").replace("*/", "* /");
    format!("/**\n{text} */\n")
}

/// Text that every compiler takes: not all of them read more than ASCII, even in comments.
pub fn ascii(text: &str) -> String {
    let mut out = String::new();
    let mut raised = false;
    for c in text.chars() {
        let power = match c {
            '\u{2070}' => "0",
            '\u{b9}' => "1",
            '\u{b2}' => "2",
            '\u{b3}' => "3",
            '\u{2074}' => "4",
            '\u{2075}' => "5",
            '\u{2076}' => "6",
            '\u{2077}' => "7",
            '\u{2078}' => "8",
            '\u{2079}' => "9",
            '\u{207b}' => "-",
            '\u{1d40}' => "T",
            '\u{207f}' => "n",
            _ => "",
        };
        if !power.is_empty() {
            if !raised {
                out.push('^');
            }
            out.push_str(power);
            raised = true;
            continue;
        }
        raised = false;
        match c {
            '\u{e4}' => out.push_str("ae"),
            '\u{f6}' => out.push_str("oe"),
            '\u{fc}' => out.push_str("ue"),
            '\u{df}' => out.push_str("ss"),
            '\u{3b1}' => out.push_str("alpha"),
            '\u{3b2}' => out.push_str("beta"),
            '\u{3b5}' => out.push_str("epsilon"),
            '\u{3ba}' => out.push_str("kappa"),
            '\u{3c0}' => out.push_str("pi"),
            '\u{3c3}' => out.push_str("sigma"),
            '\u{3a3}' => out.push_str("Sigma"),
            '\u{3c6}' => out.push_str("phi"),
            '\u{2026}' => out.push_str("..."),
            '\u{d7}' => out.push('x'),
            '\u{b7}' => out.push('*'),
            '\u{2013}' | '\u{2014}' | '\u{2212}' => out.push('-'),
            '\u{2264}' => out.push_str("<="),
            '\u{2265}' => out.push_str(">="),
            '\u{2018}' | '\u{2019}' => out.push('\''),
            '\u{201c}' | '\u{201d}' => out.push('"'),
            c if c.is_ascii() => out.push(c),
            _ => out.push('?'),
        }
    }
    out
}

/// Whether a line of Markdown does not go on with the paragraph before it: a list, a heading, a table, a quote
/// or code.
fn begins_a_block(line: &str) -> bool {
    let numbered = line.trim_start_matches(|c: char| c.is_ascii_digit());
    ["- ", "* ", "#", "|", ">", "```", "    "]
        .iter()
        .any(|mark| line.starts_with(mark))
        || numbered.len() < line.len() && numbered.starts_with(". ")
}

/// Documentation without what only rustdoc understands.
pub fn reflowed(lines: &[String]) -> Vec<String> {
    let mut out = Vec::new();
    let mut carried = String::new();
    for line in lines {
        let mut plain = ascii(line)
            .replace("\\[", "[")
            .replace("\\]", "]")
            .replace("[`", "`")
            .replace("`]", "`");
        // `` `name`(path) `` was a link.
        while let Some(at) = plain.find("`(") {
            match plain[at..].find(')') {
                Some(end) if !plain[at + 2..at + end].contains(' ') => {
                    plain.replace_range(at + 1..=at + end, "");
                }
                _ => break,
            }
        }
        // What did not fit into a line of a paragraph begins the next one.
        if !carried.is_empty() {
            if plain.is_empty() || begins_a_block(&plain) {
                out.push(std::mem::take(&mut carried));
            } else {
                plain = format!("{carried} {plain}");
                carried.clear();
            }
        }
        let mut rest = plain.as_str();
        while rest.chars().count() > WIDTH - 8 {
            let cut = rest
                .char_indices()
                .take(WIDTH - 8)
                .filter(|(_, c)| *c == ' ')
                .map(|(i, _)| i)
                .last();
            let Some(cut) = cut else {
                break;
            };
            out.push(rest[..cut].to_owned());
            rest = &rest[cut + 1..];
            carried = rest.to_owned();
        }
        if carried.is_empty() {
            out.push(rest.to_owned());
        }
    }
    if !carried.is_empty() {
        out.push(carried);
    }
    out
}

/// The lines that every file begins with.
pub fn provenance(library: &Library, sha256: &str) -> Vec<String> {
    let mut lines: Vec<String> = comment::licence(&library.licence).into_iter().collect();
    lines.push(format!(
        "{} {}, library `{}`, API {} (sources sha256 {}), written by hankel {}. Do not edit.",
        library.krate,
        library.version,
        library.name,
        library.api,
        sha256.get(..12).unwrap_or(sha256),
        crate::VERSION
    ));
    if !library.references.is_empty() {
        lines.push(String::new());
        for reference in &library.references {
            lines.push(format!("- {reference}"));
        }
        lines.push(String::new());
    }
    lines
}

/// A constant's components.
pub fn components(dialect: &dyn Dialect, constant: &Constant) -> Piece {
    let parts: Vec<Piece> = constant
        .values
        .iter()
        .map(|v| dialect.literal(*v))
        .collect();
    match constant.ty {
        Type::Vector(..) => dialect.construct(&constant.ty, &parts),
        _ => parts.into_iter().next().unwrap_or_else(|| atom("0")),
    }
}

/// Members of a structure, a line each with its documentation.
pub fn members(structure: &Struct, prefix: &str, line: &dyn Fn(&str, &Type) -> String) -> String {
    let mut text = String::new();
    for (name, ty, docs) in &structure.members {
        for doc in documented(docs, prefix).lines() {
            text.push_str(&format!("    {doc}\n"));
        }
        text.push_str(&format!("    {}\n", line(name, ty)));
    }
    text
}

/// `x` to `w` as a number.
pub fn component(name: &str) -> usize {
    ["x", "y", "z", "w"]
        .iter()
        .position(|n| *n == name)
        .unwrap_or(0)
}

/// The number of a matrix's column.
pub fn column(name: &str) -> usize {
    COLUMNS.iter().position(|n| *n == name).unwrap_or(0)
}

/// The name of a scalar where names are put together: `float2`, `uint3`.
pub fn c_like(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::F32 => "float",
        Scalar::U32 => "uint",
        Scalar::I32 => "int",
        Scalar::Bool => "bool",
    }
}
