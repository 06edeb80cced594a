//! Where in the source an instruction comes from, as far as rust-gpu says so.

use std::collections::HashMap;

use rspirv::dr::{Block, Instruction, Module, Operand};
use rspirv::spirv::{Op, Word};

use super::{id, literal, op};

/// The names of source files.
pub struct Lines {
    files: HashMap<Word, String>,
}

impl Lines {
    pub fn of(module: &Module) -> Self {
        let files = module
            .debug_string_source
            .iter()
            .filter(|it| op(it) == Op::String)
            .filter_map(|it| match it.operands.first() {
                Some(Operand::LiteralString(name)) => Some((it.result_id?, name.clone())),
                _ => None,
            })
            .collect();
        Self { files }
    }

    /// `path:line:column` of the instruction at `place`, or the last one before it in the block that
    /// is the author's: what is inlined from libraries is not.
    pub fn before(&self, block: &Block, place: usize) -> Option<String> {
        let lines = block.instructions[..=place].iter().rev();
        lines
            .filter(|it| op(it) == Op::Line)
            .find_map(|it| self.told(it))
    }

    fn told(&self, line: &Instruction) -> Option<String> {
        let file = self.files.get(&id(line, 0)?)?;
        let elsewhere = ["/library/core/", "/registry/src/", "/rustc/"];
        if elsewhere.iter().any(|mark| file.contains(mark)) {
            return None;
        }
        let path = crate::diagnostics::shown(std::path::Path::new(file));
        Some(format!(
            "{path}:{}:{}",
            literal(line, 1)?,
            literal(line, 2)?
        ))
    }
}
