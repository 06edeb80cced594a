//! What makes a shader slow wherever it runs, found in naga's representation of it:
//!
//! - a *dynamic index* into a variable or value of a function: registers have no numbers that a
//!   program could compute, so the array goes to memory, or every access becomes a chain of
//!   selections. Buffers, textures and workgroup memory are memory to begin with, and not meant;
//! - a *loop* that a compiler cannot unroll, because it cannot tell how often it turns.
//!
//! A loop can be unrolled if it has an integer counter that starts from a constant, changes by a
//! constant once in each turn, and is compared with a constant in the only place where the loop
//! is left. Specialisation constants are constants here: they are when a pipeline is made.
//!
//! Findings are not errors: a filter whose radius is an input needs its loop. `hankel check` fails
//! on more than a budget allows, and the project's own tests hold every kernel to none that maps
//! rows to rows.

use std::collections::HashSet;
use std::fmt;

use naga::{
    AddressSpace, BinaryOperator, Block, Expression, Function, Handle, LocalVariable, Module,
    ScalarKind, Span, Statement, TypeInner, UnaryOperator,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::translate::{each_statement, each_within};

/// What was found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Finding {
    /// The entry point, or a function that it calls.
    pub function: String,
    /// What it is.
    pub construct: Construct,
    /// What is indexed, or why the number of iterations is not known.
    pub message: String,
    /// Line in the source, from 1, if that was given.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub line: Option<u32>,
}

/// What is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Construct {
    /// An index that is not constant, into a function's own array, vector or matrix.
    DynamicIndex,
    /// A loop without a constant number of iterations.
    Loop,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`", self.function)?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        let what = match self.construct {
            Construct::DynamicIndex => "a dynamic index",
            Construct::Loop => "a loop that cannot be unrolled",
        };
        write!(f, ": {what}: {}", self.message)
    }
}

/// Looks through all functions of a module, in their order. `source` is the text that the module
/// was read from, if it was: findings then have lines.
pub fn of_module(module: &Module, source: Option<&str>) -> Vec<Finding> {
    let mut found = Vec::new();
    let called = module
        .functions
        .iter()
        .map(|(_, function)| (function.name.as_deref().unwrap_or_default(), function));
    let entries = module
        .entry_points
        .iter()
        .map(|entry| (entry.name.as_str(), &entry.function));
    for (name, function) in entries.chain(called) {
        let mut lint = Lint {
            module,
            function,
            found: Vec::new(),
        };
        lint.indices();
        lint.loops(&function.body, false, &mut Vec::new());
        let line = |span: Span| {
            let source = source.filter(|_| span.is_defined())?;
            // Spans are of the text only if it is the one that was read.
            source.get(..span.to_range()?.start)?;
            Some(span.location(source).line_number)
        };
        found.extend(
            lint.found
                .into_iter()
                .map(|(construct, message, span)| Finding {
                    function: name.into(),
                    construct,
                    message,
                    line: line(span),
                }),
        );
    }
    found
}

type Local = Handle<LocalVariable>;
type Value = Handle<Expression>;

struct Lint<'a> {
    module: &'a Module,
    function: &'a Function,
    found: Vec<(Construct, String, Span)>,
}

/// A block that is being walked, and how far.
struct Frame<'a> {
    block: &'a Block,
    at: usize,
    /// It belongs to a loop.
    repeats: bool,
}

impl<'a> Lint<'a> {
    fn indices(&mut self) {
        for (handle, expression) in self.function.expressions.iter() {
            let Expression::Access { base, index } = *expression else {
                continue;
            };
            if self.is_constant(index) {
                continue;
            }
            if let Some(what) = self.own(base) {
                let message = format!("{what} has an index that is not constant");
                let span = self.function.expressions.get_span(handle);
                self.found.push((Construct::DynamicIndex, message, span));
            }
        }
    }

    /// What an indexed expression is part of, if it is the function's own.
    fn own(&self, mut base: Value) -> Option<String> {
        let named = |name: &Option<String>| match name {
            Some(name) => format!("`{name}`"),
            None => "a variable".into(),
        };
        let mut is_value = false;
        loop {
            base = match self.function.expressions[base] {
                Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => base,
                Expression::Load { pointer } => {
                    is_value = true;
                    pointer
                }
                Expression::LocalVariable(local) => {
                    return Some(named(&self.function.local_variables[local].name));
                }
                Expression::GlobalVariable(global) => {
                    let global = &self.module.global_variables[global];
                    let own = is_value || global.space == AddressSpace::Private;
                    return own.then(|| named(&global.name));
                }
                Expression::FunctionArgument(index) => {
                    let argument = self.function.arguments.get(index as usize)?;
                    let memory = match self.module.types[argument.ty].inner {
                        TypeInner::Pointer { space, .. }
                        | TypeInner::ValuePointer { space, .. } => {
                            !matches!(space, AddressSpace::Function | AddressSpace::Private)
                        }
                        _ => false,
                    };
                    return (is_value || !memory).then(|| named(&argument.name));
                }
                Expression::Constant(constant) => {
                    return Some(named(&self.module.constants[constant].name));
                }
                _ => return Some("a value".into()),
            };
        }
    }

    fn loops(&mut self, block: &'a Block, repeats: bool, around: &mut Vec<Frame<'a>>) {
        for (at, (statement, span)) in block.span_iter().enumerate() {
            around.push(Frame { block, at, repeats });
            match statement {
                Statement::Block(inner) => self.loops(inner, false, around),
                Statement::If { accept, reject, .. } => {
                    self.loops(accept, false, around);
                    self.loops(reject, false, around);
                }
                Statement::Switch { cases, .. } => {
                    for case in cases {
                        self.loops(&case.body, false, around);
                    }
                }
                Statement::Loop {
                    body,
                    continuing,
                    break_if,
                } => {
                    let turn = Turn::of(body, continuing, *break_if);
                    if let Err(why) = self.countable(&turn, around) {
                        self.found.push((Construct::Loop, why.into(), *span));
                    }
                    self.loops(body, true, around);
                    self.loops(continuing, true, around);
                }
                _ => {}
            }
            around.pop();
        }
    }

    /// Whether the number of turns is known, or why not.
    fn countable(&self, turn: &Turn<'_>, around: &[Frame<'_>]) -> Result<(), &'static str> {
        let condition = match (turn.exits, turn.condition) {
            (0, _) => return Err("it is never left"),
            (1, Some(condition)) => condition,
            (1, None) => return Err("it is left at a place that not every iteration reaches"),
            _ => return Err("it is left in several places"),
        };
        let counter = self.compared(condition, turn)?;
        let stores = turn
            .each
            .iter()
            .filter_map(|statement| self.stored(statement, counter));
        let values: Vec<Value> = stores.collect();
        let in_all = self.stores(turn.blocks, counter);
        let step = match values[..] {
            [value] if in_all == 1 && !self.is_passed(counter) => value,
            _ => return Err("its counter does not change exactly once in each iteration"),
        };
        if self.linear(step, turn) != Some((counter, true)) {
            return Err("its counter does not change by a constant");
        }
        if !self.starts_constant(counter, around) {
            return Err("its counter does not start from a constant");
        }
        Ok(())
    }

    /// The counter that a condition compares with a constant.
    fn compared(&self, mut condition: Value, turn: &Turn<'_>) -> Result<Local, &'static str> {
        use BinaryOperator::*;
        while let Expression::Unary {
            op: UnaryOperator::LogicalNot,
            expr,
        } = self.function.expressions[condition]
        {
            condition = expr;
        }
        let Expression::Binary {
            op: Equal | NotEqual | Less | LessEqual | Greater | GreaterEqual,
            left,
            right,
        } = self.function.expressions[condition]
        else {
            return Err("the loop does not end by comparing a counter");
        };
        let counters = [left, right].map(|side| self.linear(side, turn));
        match (counters, self.is_constant(left), self.is_constant(right)) {
            ([Some((counter, _)), _], _, true) | ([_, Some((counter, _))], true, _) => Ok(counter),
            ([None, None], ..) => Err("the loop does not end by comparing a counter"),
            _ => Err("its counter is not compared with a constant"),
        }
    }

    /// The integer variable that the expression is the present value of, and whether a constant
    /// other than zero was added to it.
    fn linear(&self, value: Value, turn: &Turn<'_>) -> Option<(Local, bool)> {
        match self.function.expressions[value] {
            Expression::Load { pointer } if turn.computed.contains(&value) => {
                let local = self.local(pointer)?;
                let ty = self.function.local_variables[local].ty;
                let is_integer = matches!(
                    self.module.types[ty].inner,
                    TypeInner::Scalar(scalar) if is_integer(scalar.kind)
                );
                is_integer.then_some((local, false))
            }
            Expression::Binary {
                op: op @ (BinaryOperator::Add | BinaryOperator::Subtract),
                left,
                right,
            } => {
                let (counter, added) = if self.is_constant(right) {
                    (left, right)
                } else if self.is_constant(left) && op == BinaryOperator::Add {
                    (right, left)
                } else {
                    return None;
                };
                let (local, moved) = self.linear(counter, turn)?;
                Some((local, moved || !self.is_zero(added)))
            }
            // From signed to unsigned and back: the bits stay.
            Expression::As { expr, kind, .. } if is_integer(kind) => self.linear(expr, turn),
            _ => None,
        }
    }

    /// Whether the variable has a constant when the loop begins that the frames lead to.
    fn starts_constant(&self, counter: Local, around: &[Frame<'_>]) -> bool {
        for frame in around.iter().rev() {
            for statement in frame.block[..frame.at].iter().rev() {
                if let Some(value) = self.stored(statement, counter) {
                    return self.is_constant(value);
                }
                let mut stores = 0;
                each_within(statement, &mut |inner| {
                    stores += usize::from(self.stored(inner, counter).is_some());
                });
                if stores > 0 {
                    return false;
                }
            }
            // It has what the last turn of the outer loop left.
            if frame.repeats {
                return false;
            }
        }
        match self.function.local_variables[counter].init {
            Some(value) => self.is_constant(value),
            // Zero, in naga's representation.
            None => true,
        }
    }

    fn local(&self, pointer: Value) -> Option<Local> {
        match self.function.expressions[pointer] {
            Expression::LocalVariable(local) => Some(local),
            _ => None,
        }
    }

    /// What the statement stores to the variable.
    fn stored(&self, statement: &Statement, to: Local) -> Option<Value> {
        match *statement {
            Statement::Store { pointer, value } if self.local(pointer) == Some(to) => Some(value),
            _ => None,
        }
    }

    fn stores(&self, blocks: [&Block; 2], to: Local) -> usize {
        let mut stores = 0;
        for block in blocks {
            each_statement(block, &mut |statement| {
                stores += usize::from(self.stored(statement, to).is_some());
            });
        }
        stores
    }

    /// Whether another function gets a pointer to the variable.
    fn is_passed(&self, variable: Local) -> bool {
        let mut passed = false;
        each_statement(&self.function.body, &mut |statement| {
            if let Statement::Call { arguments, .. } = statement {
                passed |= arguments
                    .iter()
                    .any(|argument| self.local(*argument) == Some(variable));
            }
        });
        passed
    }

    /// Whether the driver's compiler knows the value.
    fn is_constant(&self, value: Value) -> bool {
        match self.function.expressions[value] {
            Expression::Literal(_)
            | Expression::Constant(_)
            | Expression::Override(_)
            | Expression::ZeroValue(_) => true,
            Expression::Unary { expr, .. } | Expression::As { expr, .. } => self.is_constant(expr),
            Expression::Binary { left, right, .. } => {
                self.is_constant(left) && self.is_constant(right)
            }
            _ => false,
        }
    }

    fn is_zero(&self, constant: Value) -> bool {
        use naga::Literal::*;
        let expression = match &self.function.expressions[constant] {
            Expression::Constant(constant) => {
                &self.module.global_expressions[self.module.constants[*constant].init]
            }
            other => other,
        };
        matches!(
            expression,
            Expression::ZeroValue(_)
                | Expression::Literal(U32(0) | I32(0) | U64(0) | I64(0) | AbstractInt(0))
        )
    }
}

fn is_integer(kind: ScalarKind) -> bool {
    matches!(kind, ScalarKind::Sint | ScalarKind::Uint)
}

/// One turn of a loop.
struct Turn<'a> {
    blocks: [&'a Block; 2],
    /// Statements that are executed in each turn but the last.
    each: Vec<&'a Statement>,
    /// What is computed in it.
    computed: HashSet<Value>,
    /// Places where the loop is left.
    exits: usize,
    /// What decides whether it is left, if every turn comes there.
    condition: Option<Value>,
}

impl<'a> Turn<'a> {
    fn of(body: &'a Block, continuing: &'a Block, break_if: Option<Value>) -> Self {
        let mut turn = Self {
            blocks: [body, continuing],
            each: Vec::new(),
            computed: HashSet::new(),
            exits: usize::from(break_if.is_some()) + exits(body, true),
            condition: break_if,
        };
        for block in turn.blocks {
            each_statement(block, &mut |statement| {
                if let Statement::Emit(range) = statement {
                    turn.computed.extend(range.clone());
                }
            });
        }
        turn.collect(body);
        // After a `continue`, what is in `continuing` is executed all the same.
        turn.collect(continuing);
        turn
    }

    /// Takes what is executed in each turn. Says whether it goes on after the block.
    fn collect(&mut self, block: &'a Block) -> bool {
        for statement in block {
            match statement {
                Statement::Block(inner) => {
                    if !self.collect(inner) {
                        return false;
                    }
                }
                Statement::If {
                    condition,
                    accept,
                    reject,
                } if leaves(accept) || leaves(reject) => {
                    self.condition.get_or_insert(*condition);
                    let stays = if leaves(accept) { reject } else { accept };
                    if !self.collect(stays) {
                        return false;
                    }
                }
                other => {
                    let mut goes_on = true;
                    each_within(other, &mut |inner| {
                        goes_on &= !matches!(inner, Statement::Continue);
                    });
                    // A loop's own `continue` is none of this one's.
                    if !goes_on && !matches!(other, Statement::Loop { .. }) {
                        return false;
                    }
                    self.each.push(other);
                }
            }
        }
        true
    }
}

/// Whether a block ends by leaving the loop.
fn leaves(block: &Block) -> bool {
    matches!(
        block.last(),
        Some(Statement::Break | Statement::Return { .. } | Statement::Kill)
    )
}

/// Where a loop is left: `break`, and what leaves the function. In a `switch`, `break` does not
/// leave the loop.
fn exits(block: &Block, breaks: bool) -> usize {
    block
        .iter()
        .map(|statement| match statement {
            Statement::Break => usize::from(breaks),
            Statement::Return { .. } | Statement::Kill => 1,
            Statement::Block(inner) => exits(inner, breaks),
            Statement::If { accept, reject, .. } => exits(accept, breaks) + exits(reject, breaks),
            Statement::Switch { cases, .. } => {
                cases.iter().map(|case| exits(&case.body, false)).sum()
            }
            Statement::Loop {
                body, continuing, ..
            } => exits(body, false) + exits(continuing, false),
            _ => 0,
        })
        .sum()
}
