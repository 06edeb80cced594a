//! Variables that hold what another one holds.
//!
//! A value that a loop has computed is used behind it. naga's reader keeps it in a variable for each such use, written
//! before the loop's `break`. Mostly the loop's own variable still has the value there.

use std::collections::{HashMap, HashSet};

use naga::{Arena, Block, Expression, Function, Handle, LocalVariable, Module, Statement};

use super::locals::drop_stores;
use super::walk::{each_statement, each_within, functions_mut, local};

type Local = Handle<LocalVariable>;

/// Puts one variable in the place of those that hold the same wherever they are read.
pub fn drop_copies(module: &mut Module) {
    functions_mut(module).for_each(|function| {
        while let Some((copy, original)) = found(function) {
            for (_, expression) in function.expressions.iter_mut() {
                if let Expression::LocalVariable(local) = expression
                    && *local == copy
                {
                    *local = original;
                }
            }
        }
    });
}

/// A variable, and another one that has the same value wherever the first is read. The store to the first is removed.
fn found(function: &mut Function) -> Option<(Local, Local)> {
    let facts = Facts::of(function);
    let (copy, original) = facts.in_block(&function.body)?;
    let expressions = &function.expressions;
    let mut body = std::mem::take(&mut function.body);
    drop_stores(&mut body, &|pointer| {
        local(expressions, pointer) == Some(copy)
    });
    function.body = body;
    Some((copy, original))
}

struct Facts<'a> {
    function: &'a Function,
    /// Variables that are stored to as a whole, and by one statement.
    once: HashSet<Local>,
    /// How often each is read.
    reads: HashMap<Local, usize>,
    /// Those that others may write, or write in part.
    shared: HashSet<Local>,
}

impl<'a> Facts<'a> {
    fn of(function: &'a Function) -> Self {
        let expressions = &function.expressions;
        let mut stores: HashMap<Local, usize> = HashMap::new();
        let mut reads = HashMap::new();
        let mut shared = HashSet::new();
        each_statement(&function.body, &mut |statement| match statement {
            Statement::Emit(range) => {
                for handle in range.clone() {
                    if let Some(read) = read(expressions, handle) {
                        *reads.entry(read).or_default() += 1;
                    }
                }
            }
            Statement::Store { pointer, .. } => match local(expressions, *pointer) {
                Some(local) => *stores.entry(local).or_default() += 1,
                None => shared.extend(root(expressions, *pointer)),
            },
            Statement::Call { arguments, .. } => {
                shared.extend(arguments.iter().filter_map(|it| root(expressions, *it)));
            }
            Statement::Atomic { pointer, .. } | Statement::WorkGroupUniformLoad { pointer, .. } => {
                shared.extend(root(expressions, *pointer));
            }
            Statement::RayQuery { query, .. } => shared.extend(root(expressions, *query)),
            _ => {}
        });
        let has_value = |local: &Local| function.local_variables[*local].init.is_some();
        let once = stores.into_iter().filter(|(_, count)| *count == 1);
        let once = once.map(|(local, _)| local);
        Self {
            once: once
                .filter(|it| !shared.contains(it) && !has_value(it))
                .collect(),
            function,
            reads,
            shared,
        }
    }

    fn in_block(&self, block: &Block) -> Option<(Local, Local)> {
        self.stored_twice(block)
            .or_else(|| {
                block.iter().enumerate().find_map(|(at, it)| match it {
                    Statement::Loop {
                        body,
                        break_if: None,
                        ..
                    } => self.kept_by_loop(body, &block[at + 1..]),
                    _ => None,
                })
            })
            .or_else(|| block.iter().find_map(|it| self.within(it)))
    }

    fn within(&self, statement: &Statement) -> Option<(Local, Local)> {
        match statement {
            Statement::Block(inner) => self.in_block(inner),
            Statement::If { accept, reject, .. } => {
                self.in_block(accept).or_else(|| self.in_block(reject))
            }
            Statement::Switch { cases, .. } => {
                cases.iter().find_map(|case| self.in_block(&case.body))
            }
            Statement::Loop {
                body, continuing, ..
            } => self.in_block(body).or_else(|| self.in_block(continuing)),
            _ => None,
        }
    }

    /// Two that get the same value by two stores in a row, and no other.
    fn stored_twice(&self, block: &Block) -> Option<(Local, Local)> {
        let mut run: Vec<(Handle<Expression>, Local)> = Vec::new();
        for statement in block {
            let Some((into, value)) = self.whole_store(statement) else {
                run.clear();
                continue;
            };
            if !self.once.contains(&into) {
                run.clear();
                continue;
            }
            let first = run.iter().find(|(stored, _)| *stored == value);
            match first {
                Some((_, first)) if self.of_one_type(into, *first) => return Some((into, *first)),
                _ => run.push((value, into)),
            }
        }
        None
    }

    /// One that is stored in a loop, before all that leaves it, from a variable that does not change until the loop is
    /// left, nor where the copy is read: in `behind` alone.
    fn kept_by_loop(&self, body: &Block, behind: &[Statement]) -> Option<(Local, Local)> {
        let expressions = &self.function.expressions;
        let last_exit = (0..body.len()).rev().find(|at| leaves(&body[*at]))?;
        body.iter().enumerate().find_map(|(at, statement)| {
            let (copy, value) = self.whole_store(statement)?;
            let Expression::Load { pointer } = expressions[value] else {
                return None;
            };
            let original = local(expressions, pointer)?;
            let loaded = body[..at].iter().position(|it| emits(it, value))?;
            let is_kept = copy != original
                && self.once.contains(&copy)
                && !self.shared.contains(&original)
                && self.of_one_type(copy, original)
                && !body[..at].iter().any(leaves)
                && !self.is_stored(&body[loaded..=last_exit], original)
                && !self.is_stored(behind, original)
                && self.reads_in(behind, copy) == self.reads.get(&copy).copied().unwrap_or(0);
            is_kept.then_some((copy, original))
        })
    }

    fn whole_store(&self, statement: &Statement) -> Option<(Local, Handle<Expression>)> {
        match statement {
            Statement::Store { pointer, value } => {
                Some((local(&self.function.expressions, *pointer)?, *value))
            }
            _ => None,
        }
    }

    fn of_one_type(&self, a: Local, b: Local) -> bool {
        let variables = &self.function.local_variables;
        variables[a].ty == variables[b].ty
    }

    fn is_stored(&self, statements: &[Statement], variable: Local) -> bool {
        let mut any = false;
        for statement in statements {
            each_within(statement, &mut |it| {
                any |= self
                    .whole_store(it)
                    .is_some_and(|(into, _)| into == variable);
            });
        }
        any
    }

    fn reads_in(&self, statements: &[Statement], variable: Local) -> usize {
        let mut count = 0;
        for statement in statements {
            each_within(statement, &mut |it| {
                if let Statement::Emit(range) = it {
                    let reads = range.clone();
                    let reads = reads.filter_map(|it| read(&self.function.expressions, it));
                    count += reads.filter(|it| *it == variable).count();
                }
            });
        }
        count
    }
}

/// The variable that is read by an expression, as a whole or in part.
fn read(expressions: &Arena<Expression>, handle: Handle<Expression>) -> Option<Local> {
    match expressions[handle] {
        Expression::Load { pointer } => root(expressions, pointer),
        _ => None,
    }
}

/// The variable that a pointer points into.
fn root(expressions: &Arena<Expression>, mut pointer: Handle<Expression>) -> Option<Local> {
    loop {
        match expressions[pointer] {
            Expression::LocalVariable(local) => return Some(local),
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => {
                pointer = base
            }
            _ => return None,
        }
    }
}

fn emits(statement: &Statement, value: Handle<Expression>) -> bool {
    match statement {
        Statement::Emit(range) => range.clone().any(|it| it == value),
        _ => false,
    }
}

/// Whether a statement of a loop has a `break` of that loop.
fn leaves(statement: &Statement) -> bool {
    let any = |block: &Block| block.iter().any(leaves);
    match statement {
        Statement::Break => true,
        Statement::Block(inner) => any(inner),
        Statement::If { accept, reject, .. } => any(accept) || any(reject),
        // A `break` in it is its own.
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use naga::back::wgsl;
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;
    use crate::translate::cleanup::drop_unused_locals;

    /// What becomes of a function's body.
    fn cleaned(body: &str) -> String {
        let text = format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<f32>;
            @compute @workgroup_size(1) fn main() {{
                var sum: f32; var last: f32; var again: f32; var i: i32;
                sum = out[1];
                i = 0;
                {body}
            }}"
        );
        let mut module = naga::front::wgsl::parse_str(&text).unwrap();
        drop_copies(&mut module);
        naga::compact::compact(&mut module, naga::compact::KeepUnused::No);
        drop_unused_locals(&mut module);
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
        let info = validator.validate(&module).unwrap();
        wgsl::write_string(&module, &info, wgsl::WriterFlags::empty()).unwrap()
    }

    fn copies(text: &str) -> [bool; 2] {
        ["var last", "var again"].map(|name| text.contains(name))
    }

    #[test]
    fn the_variable_of_a_loop_is_read_behind_it() {
        let text = cleaned(
            "loop {
                let now = sum;
                last = now;
                again = now;
                if i >= 4 { break; }
                sum = now + 1.0;
                i += 1;
            }
            out[0] = last + again;",
        );
        assert_eq!(copies(&text), [false, false], "{text}");
        assert!(text.contains("let _e") && text.contains("= sum;"), "{text}");
    }

    #[test]
    fn what_two_variables_hold_is_in_one() {
        let text = cleaned("last = out[2]; again = out[2]; out[0] = last + again;");
        assert_eq!(copies(&text), [true, true], "two loads\n{text}");
        let text = cleaned("let x = out[2]; last = x; again = x; out[0] = last + again;");
        assert_eq!(copies(&text), [true, false], "{text}");
        let text =
            cleaned("let x = out[2]; last = x; again = x; again = 1.0; out[0] = last + again;");
        assert_eq!(copies(&text), [true, true], "{text}");
    }

    #[test]
    fn what_differs_stays() {
        for (body, why) in [
            (
                "loop { let now = sum; last = now; sum = now + 1.0; if i >= 4 { break; } i += 1; } out[0] = last;",
                "it changes before the loop is left",
            ),
            (
                "loop { let now = sum; last = now; if i >= 4 { break; } sum = now + 1.0; i += 1; }
                sum = 3.0; out[0] = last;",
                "it changes behind the loop",
            ),
            (
                "loop { if i > 7 { break; } let now = sum; last = now; if i >= 4 { break; } sum = now + 1.0; i += 1; }
                out[0] = last;",
                "the loop is left before the copy is made",
            ),
            (
                "loop { out[3] = last; let now = sum; last = now; if i >= 4 { break; } sum = now + 1.0; i += 1; }
                out[0] = last;",
                "the copy is read in the loop",
            ),
            (
                "loop {
                    i += 1;
                    if i > 9 { break; }
                    out[i] = last;
                    sum = f32(i);
                    loop { let now = sum; last = now; if i > 3 { break; } i += 1; }
                }",
                "the copy is read in the next turn of an outer loop",
            ),
        ] {
            let text = cleaned(body);
            assert!(text.contains("var last"), "{why}\n{text}");
        }
    }
}
