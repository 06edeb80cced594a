//! Programs as a kernel crate.

use std::fmt::Write as _;

use super::program::{Expr, Floats, Function, Program, Stmt, Style, Ty};

/// What every crate begins with.
const HEAD: &str = "//! Kernels that were made at random.
#![no_std]
#![allow(warnings)]

use hankel_dsl::glam::{UVec3, UVec4, Vec2, Vec3, Vec4};
use hankel_dsl::*;

/// What an invocation reads.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Row {
    /// Any number.
    pub a: u32,
    /// Any number.
    pub b: i32,
    /// A float.
    #[range(-100.0..=100.0)]
    pub x: f32,
    /// A float.
    #[range(-3.0..=3.0)]
    pub y: f32,
}

/// What all invocations read.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Settings {
    /// Numbers by index.
    pub keys: [UVec4; 2],
    /// Any number.
    pub seed: u32,
    /// Any number.
    pub offset: i32,
    /// A float.
    #[range(-50.0..=50.0)]
    pub scale: f32,
    /// Fills the structure up.
    pub padding: u32,
}

/// What an invocation writes.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Out {
    /// A number.
    pub a: u32,
    /// A number.
    pub b: i32,
    /// A float.
    pub x: f32,
}

/// The least of two.
fn least(a: u32, b: u32) -> u32 {
    if a < b { a } else { b }
}

/// Floats that are integers from -2048 to 2047.
pub mod whole {
    use super::*;
    pub fn bound(x: f32) -> f32 {
        let x = if x > 4_194_304.0 { 4_194_304.0 } else if x < -4_194_304.0 { -4_194_304.0 } else { x };
        ((x as i32 & 0xfff) - 2048) as f32
    }
    pub fn bound3(v: Vec3) -> Vec3 {
        Vec3::new(bound(v.x), bound(v.y), bound(v.z))
    }
}

/// Floats that are neither large nor nearly zero.
pub mod rounded {
    use super::*;
    pub fn bound(x: f32) -> f32 {
        let x = if x > 10_000.0 { 10_000.0 } else if x < -10_000.0 { -10_000.0 } else { x };
        if x > -0.001 && x < 0.001 { 0.0 } else { x }
    }
    pub fn bound3(v: Vec3) -> Vec3 {
        Vec3::new(bound(v.x), bound(v.y), bound(v.z))
    }
}
";

/// The text of a crate with these kernels: `k0`, `k1`, and so on.
pub fn library(programs: &[&Program]) -> String {
    let mut text = String::from(HEAD);
    let mut names = String::new();
    for (n, program) in programs.iter().enumerate() {
        text += &kernel(n, program);
        let _ = writeln!(names, "    m{n}::k{n},");
    }
    text + "\nkernels![\n" + &names + "];\n"
}

/// A kernel in a module of its own.
fn kernel(n: usize, program: &Program) -> String {
    let floats = match program.floats {
        Floats::Whole => "whole",
        Floats::Rounded => "rounded",
    };
    let exact = match program.floats {
        Floats::Whole => "",
        Floats::Rounded => "exact, ",
    };
    let mut writer = Writer::default();
    for (number, function) in program.functions.iter().enumerate() {
        writer.function(number, function);
    }
    let uses = Uses::of(program);
    let mut parameters = String::from("#[index] i: u32");
    if program.cooperative {
        parameters += ", #[local_index] me: u32, #[shared] mail: Shared<'_, u32, 64>";
    }
    parameters += if program.cooperative {
        ", #[element] row: Option<Row>"
    } else {
        ", #[element] row: Row"
    };
    for (used, parameter) in [
        (uses.settings, "#[uniform] settings: &Settings"),
        (uses.table, "#[storage] table: Buffer<'_, u32>"),
        (
            uses.floats,
            "#[storage] #[range(-100.0..=100.0)] floats: Buffer<'_, f32>",
        ),
        (uses.counters, "#[atomic] counters: Atomics<'_>"),
        (uses.own, "#[storage] own: StorageMut<'_, u32>"),
    ] {
        if used {
            parameters += ", ";
            parameters += parameter;
        }
    }
    let _ = write!(
        writer.text,
        "    /// Seed {seed}.\n    #[kernel(compute, threads(64), {exact}{range}parity(ulp = 0, absolute = 0.0, why = \"made at random\"))]\n    pub fn k{n}({parameters}) -> Out {{\n",
        seed = program.seed,
        range = if program.cooperative {
            "range(row), "
        } else {
            ""
        },
    );
    writer.depth = 2;
    if program.cooperative {
        writer.line("let there = row.is_some();");
        writer.line("let row = row.unwrap_or(Row { a: 3, b: 4, x: 5.0, y: 6.0 });");
    }
    writer.block(&program.body);
    let [a, b, x] = program.result.each_ref().map(expr);
    writer.line(&format!("Out {{ a: {a}, b: {b}, x: {x} }}"));
    format!(
        "\n/// A kernel.\npub mod m{n} {{\n    use super::*;\n    use super::{floats}::*;\n\n{}    }}\n}}\n",
        writer.text
    )
}

/// Which parameters a program takes.
#[derive(Default)]
struct Uses {
    settings: bool,
    table: bool,
    floats: bool,
    counters: bool,
    own: bool,
}

impl Uses {
    fn of(program: &Program) -> Self {
        let mut writer = Writer::default();
        writer.block(&program.body);
        let text = writer.text + &program.result.each_ref().map(expr).concat();
        Self {
            settings: text.contains("settings."),
            table: text.contains("table."),
            floats: text.contains("floats."),
            counters: text.contains("counters."),
            own: text.contains("own."),
        }
    }
}

#[derive(Default)]
struct Writer {
    text: String,
    depth: usize,
}

impl Writer {
    fn line(&mut self, line: &str) {
        self.text.push_str(&"    ".repeat(self.depth));
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn function(&mut self, number: usize, function: &Function) {
        let parameters: Vec<String> = function
            .parameters
            .iter()
            .map(|(ty, id)| format!("mut v{id}: {}", ty.name()))
            .collect();
        let (parameters, result) = (parameters.join(", "), function.result.ty().name());
        self.depth = 1;
        self.line(&format!("fn f{number}({parameters}) -> {result} {{"));
        self.depth = 2;
        self.block(&function.body);
        self.line(&expr(&function.result));
        self.depth = 1;
        self.line("}\n");
    }

    fn inner(&mut self, block: &[Stmt]) {
        self.depth += 1;
        self.block(block);
        self.depth -= 1;
    }

    fn block(&mut self, block: &[Stmt]) {
        for statement in block {
            self.statement(statement);
        }
    }

    fn statement(&mut self, statement: &Stmt) {
        match statement {
            Stmt::Let(id, value) => {
                let ty = value.ty().name();
                self.line(&format!("let mut v{id}: {ty} = {};", expr(value)));
            }
            Stmt::Assign(id, value) => self.line(&format!("v{id} = {};", expr(value))),
            Stmt::AssignBoth([a, b], [x, y]) => {
                self.line(&format!("(v{a}, v{b}) = ({}, {});", expr(x), expr(y)));
            }
            Stmt::Array(id, all) => {
                let (ty, all) = (all[0].ty().name(), all.each_ref().map(expr).join(", "));
                self.line(&format!("let mut a{id}: [{ty}; 4] = [{all}];"));
            }
            Stmt::SetElement(id, index, value) => self.line(&format!(
                "a{id}[({} & 3) as usize] = {};",
                expr(index),
                expr(value)
            )),
            Stmt::If(condition, accept, reject) => {
                self.line(&format!("if {} {{", expr(condition)));
                self.inner(accept);
                if !reject.is_empty() {
                    self.line("} else {");
                    self.inner(reject);
                }
                self.line("}");
            }
            Stmt::Match(id, number, arms) => {
                let count = arms.len();
                self.line(&format!(
                    "let mut v{id}: u32 = match {} % {count} {{",
                    expr(number)
                ));
                for (n, arm) in arms.iter().enumerate() {
                    let pattern = if n + 1 == count {
                        "_".into()
                    } else {
                        n.to_string()
                    };
                    self.line(&format!("    {pattern} => {{"));
                    self.depth += 1;
                    self.inner(arm);
                    self.line(&format!("    {}", 7 * n + 3));
                    self.depth -= 1;
                    self.line("    }");
                }
                self.line("};");
            }
            Stmt::Loop(style, id, rounds, body) => {
                match style {
                    Style::For => self.line(&format!("for v{id} in 0..{rounds}_u32 {{")),
                    Style::While => {
                        self.line(&format!("let mut n{id} = 0_u32;"));
                        self.line(&format!("while n{id} < {rounds} {{"));
                    }
                    Style::Loop => {
                        self.line(&format!("let mut n{id} = 0_u32;"));
                        self.line("loop {");
                        self.line(&format!("    if n{id} >= {rounds} {{"));
                        self.line("        break;");
                        self.line("    }");
                    }
                }
                if *style != Style::For {
                    // What the body sees does not change within it.
                    self.line(&format!("    let v{id} = n{id};"));
                    self.line(&format!("    n{id} += 1;"));
                }
                self.inner(body);
                self.line("}");
            }
            Stmt::BreakIf(condition) => self.guarded(condition, "break;"),
            Stmt::ContinueIf(condition) => self.guarded(condition, "continue;"),
            Stmt::ReturnIf(condition, value) => {
                self.guarded(condition, &format!("return {};", expr(value)));
            }
            Stmt::Count(counter, by) => {
                self.line(&format!(
                    "counters.add({} & 7, {});",
                    expr(counter),
                    expr(by)
                ));
            }
            Stmt::Store(id, value) => {
                self.line(&format!("own.set(i, {});", expr(value)));
                self.line(&format!("let mut v{id} = own.get(i);"));
            }
            Stmt::Exchange(id, by, value) => {
                self.line(&format!("mail.set(me, {});", expr(value)));
                self.line("barrier();");
                self.line(&format!("let mut v{id} = mail.get((me + {by}) & 63);"));
                self.line("barrier();");
            }
        }
    }

    fn guarded(&mut self, condition: &Expr, what: &str) {
        self.line(&format!("if {} {{", expr(condition)));
        self.line(&format!("    {what}"));
        self.line("}");
    }
}

fn expr(it: &Expr) -> String {
    match it {
        Expr::Literal(ty, bits) => literal(*ty, *bits),
        Expr::Variable(_, id) => format!("v{id}"),
        Expr::Element(_, id, index) => format!("a{id}[({} & 3) as usize]", expr(index)),
        Expr::Call(_, n, arguments) => {
            let all: Vec<String> = arguments.iter().map(expr).collect();
            format!("f{n}({})", all.join(", "))
        }
        Expr::Form(form, parts) => {
            let mut text = form.text.to_owned();
            for (n, part) in parts.iter().enumerate() {
                text = text.replace(&format!("{{{n}}}"), &expr(part));
            }
            // What begins with a word of control needs brackets where an operand follows.
            if text.starts_with("if ") {
                format!("({text})")
            } else {
                text
            }
        }
    }
}

/// A constant of these bits: small ones often.
fn literal(ty: Ty, bits: u32) -> String {
    let small = bits >> 8 & 0xff;
    let number = match bits & 3 {
        0 => bits >> 2,
        1 => [0, 1, u32::MAX, 1 << 31][(small & 3) as usize],
        _ => small,
    };
    let float = |bits: u32| format!("{}.0_f32", (bits >> 4 & 31) as i32 - 16);
    match ty {
        Ty::Bool => (bits & 1 == 1).to_string(),
        Ty::U32 => format!("{number}_u32"),
        Ty::I32 => format!("({number}_u32 as i32)"),
        Ty::F32 => format!("({})", float(bits)),
        Ty::Vec2 => format!("Vec2::new({}, {})", float(bits), float(bits >> 5)),
        Ty::Vec3 => format!(
            "Vec3::new({}, {}, {})",
            float(bits),
            float(bits >> 5),
            float(bits >> 10)
        ),
        Ty::Vec4 => format!("Vec4::splat({})", float(bits)),
        Ty::UVec3 => format!("UVec3::new({number}, {small}, {})", bits & 7),
    }
}
