//! Branches as they were written. rust-gpu hands an `Option` on as a tag, even that of a `for` loop's `next`: the tag is
//! chosen in one branch and tested in the next one, so that a loop leaves at its end, behind all that its last turn
//! skips. spirv-opt does not follow a tag from one branch to another.
//!
//! What is known where a block is entered decides its branch: who comes from there leaves the loop at once.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Block, Function, Instruction, Module, Operand};
use rspirv::spirv::{Op, Word};

use super::edit::{Editor, before_end, replace_each};
use super::{id, op};

/// How many operations back a value is looked for.
const DEPTH: u32 = 8;

/// How many blocks in a row a branch is looked back from.
const MOST_BLOCKS: usize = 8;

/// What is known of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Known {
    Truth(bool),
    Number(u32),
}

/// Constants of the module.
fn constants(module: &Module) -> HashMap<Word, Known> {
    let known = module.types_global_values.iter().filter_map(|it| {
        let known = match op(it) {
            Op::ConstantTrue => Known::Truth(true),
            Op::ConstantFalse => Known::Truth(false),
            Op::Constant => match it.operands.as_slice() {
                [Operand::LiteralBit32(bits)] => Known::Number(*bits),
                _ => return None,
            },
            _ => return None,
        };
        Some((it.result_id?, known))
    });
    known.collect()
}

/// Tags that are conditions, as the conditions that they are; parts of what is not defined, and choices between it and
/// something. Tells whether there was one.
pub fn fold(module: &mut Module) -> bool {
    let known = constants(module);
    let mut made: HashMap<Word, Instruction> = HashMap::new();
    for it in module.all_inst_iter() {
        let is_needed = matches!(op(it), Op::Select | Op::Undef);
        if let (true, Some(result)) = (is_needed, it.result_id) {
            made.insert(result, it.clone());
        }
    }
    let is_undefined = |value: Word| made.get(&value).is_some_and(|it| op(it) == Op::Undef);
    let truth = |value: Word| match known.get(&value) {
        Some(Known::Truth(truth)) => Some(*truth),
        _ => None,
    };
    let mut folded = false;
    replace_each(module, |_, it| {
        let (ty, result) = (it.result_type?, it.result_id?);
        let operand = |place: usize| id(it, place);
        // A condition, or the contrary of one.
        let condition = match op(it) {
            Op::Select => match (operand(0)?, truth(operand(1)?), truth(operand(2)?)) {
                (condition, Some(true), Some(false)) => Some((condition, true)),
                (condition, Some(false), Some(true)) => Some((condition, false)),
                _ => None,
            },
            Op::LogicalEqual | Op::LogicalNotEqual => {
                let is_equal = op(it) == Op::LogicalEqual;
                let (one, other) = (operand(0)?, operand(1)?);
                match (truth(one), truth(other)) {
                    (None, Some(truth)) => Some((one, truth == is_equal)),
                    (Some(truth), None) => Some((other, truth == is_equal)),
                    _ => None,
                }
            }
            Op::IEqual | Op::INotEqual => {
                let (one, other) = (operand(0)?, operand(1)?);
                let (chosen, constant) = match (known.get(&one), known.get(&other)) {
                    (None, Some(constant)) => (one, constant),
                    (Some(constant), None) => (other, constant),
                    _ => return None,
                };
                let select = made.get(&chosen).filter(|it| op(it) == Op::Select)?;
                let is_equal = |place: usize| Some(known.get(&id(select, place)?)? == constant);
                let is_wanted = op(it) == Op::IEqual;
                match (is_equal(1)?, is_equal(2)?) {
                    (true, false) => Some((id(select, 0)?, is_wanted)),
                    (false, true) => Some((id(select, 0)?, !is_wanted)),
                    _ => None,
                }
            }
            _ => None,
        };
        let new = match (condition, op(it)) {
            (Some((condition, true)), _) => (Op::CopyObject, vec![Operand::IdRef(condition)]),
            (Some((condition, false)), _) => (Op::LogicalNot, vec![Operand::IdRef(condition)]),
            (None, Op::CompositeExtract) if is_undefined(operand(0)?) => (Op::Undef, Vec::new()),
            (None, Op::Select) if is_undefined(operand(1)?) => {
                (Op::CopyObject, vec![Operand::IdRef(operand(2)?)])
            }
            (None, Op::Select) if is_undefined(operand(2)?) => {
                (Op::CopyObject, vec![Operand::IdRef(operand(1)?)])
            }
            _ => return None,
        };
        folded = true;
        Some(vec![Instruction::new(new.0, Some(ty), Some(result), new.1)])
    });
    for function in &mut module.functions {
        folded |= forward(function);
    }
    folded
}

/// Takes the value itself where a phi has no other. Tells whether there was one.
fn forward(function: &mut Function) -> bool {
    let mut names: HashMap<Word, Word> = HashMap::new();
    for phi in function.all_inst_iter().filter(|it| op(it) == Op::Phi) {
        let Some(result) = phi.result_id else {
            continue;
        };
        let values = (0..phi.operands.len() / 2).filter_map(|i| id(phi, 2 * i));
        let mut others = values.filter(|value| *value != result);
        if let Some(value) = others.next()
            && others.all(|other| other == value)
        {
            names.insert(result, value);
        }
    }
    if names.is_empty() {
        return false;
    }
    let end = |mut value: Word| {
        // Phis of a loop that nothing enters may stand for each other.
        for _ in 0..names.len() {
            match names.get(&value) {
                Some(next) => value = *next,
                None => break,
            }
        }
        value
    };
    for block in &mut function.blocks {
        let is_kept = |it: &Instruction| it.result_id.is_none_or(|it| !names.contains_key(&it));
        block.instructions.retain(is_kept);
        for operand in block
            .instructions
            .iter_mut()
            .flat_map(|it| &mut it.operands)
        {
            if let Operand::IdRef(value) = operand {
                *value = end(*value);
            }
        }
    }
    true
}

/// Leaves loops where it is known that they end, and settles branches whose condition is known. Tells whether there was
/// one.
pub fn thread(module: &mut Module) -> bool {
    let has_loops = module
        .all_inst_iter()
        .any(|it| matches!(op(it), Op::LoopMerge));
    if !has_loops {
        return false;
    }
    let known = constants(module);
    let mut changed = false;
    for number in 0..module.functions.len() {
        loop {
            let graph = Graph::of(&module.functions[number], &known);
            let Some(exit) = graph.exit() else {
                break;
            };
            leave(module, number, &exit);
            changed = true;
        }
        let graph = Graph::of(&module.functions[number], &known);
        let (settled, open) = (graph.settled(), graph.open());
        if !settled.is_empty() {
            settle(module, number, &settled);
            changed = true;
        }
        for (block, on) in open {
            let function = &mut module.functions[number];
            let on = function.blocks[on].label_id();
            let instructions = &mut function.blocks[block].instructions;
            let merge = instructions
                .iter_mut()
                .find(|it| op(it) == Op::SelectionMerge);
            if let Some((merge, on)) = merge.and_then(|it| it.operands.first_mut()).zip(on) {
                *merge = Operand::IdRef(on);
            }
            changed = true;
        }
    }
    changed
}

/// How a block hands on.
enum End {
    /// To the block with this number.
    Branch(usize),
    /// By a condition: to the first if it holds, else to the second.
    Conditional(Word, usize, usize),
    Other,
}

/// A loop's blocks, by their numbers.
struct Loop {
    header: usize,
    merge: usize,
    continues: usize,
}

/// From which block to which one a loop is left early.
struct Exit {
    /// The block that leaves.
    from: usize,
    /// The blocks that it goes through now, one after the other; all that they do is left out.
    through: Vec<usize>,
    /// The block that comes before `to` on that way.
    last: usize,
    /// The loop's merge block.
    to: usize,
    /// Blocks of the loop.
    inside: HashSet<usize>,
}

impl Exit {
    /// Labels of the blocks that are not of the loop.
    fn outside(&self, function: &Function) -> HashSet<Word> {
        let blocks = function.blocks.iter().enumerate();
        let outside = blocks.filter(|(block, _)| !self.inside.contains(block));
        outside.filter_map(|(_, block)| block.label_id()).collect()
    }

    /// Instructions of blocks that are not of the loop.
    fn behind<'f>(&self, function: &'f Function) -> impl Iterator<Item = &'f Instruction> {
        let blocks = function.blocks.iter().enumerate();
        let outside = blocks.filter(|(block, _)| !self.inside.contains(block));
        outside.flat_map(|(_, block)| &block.instructions)
    }
}

/// The blocks of a function, and what comes before what.
pub(super) struct Graph<'a> {
    function: &'a Function,
    known: &'a HashMap<Word, Known>,
    ends: Vec<End>,
    before: Vec<Vec<usize>>,
    /// The block that each way to a block comes through last; itself for the first one, none where no way goes.
    dominator: Vec<Option<usize>>,
    made: HashMap<Word, (usize, &'a Instruction)>,
    loops: Vec<Loop>,
    /// Blocks that end in a switch, and where it is over.
    switches: Vec<(usize, Option<usize>)>,
}

impl<'a> Graph<'a> {
    pub(super) fn of(function: &'a Function, known: &'a HashMap<Word, Known>) -> Self {
        let labels: HashMap<Word, usize> = function
            .blocks
            .iter()
            .enumerate()
            .filter_map(|(number, block)| Some((block.label_id()?, number)))
            .collect();
        let at = |it: &Instruction, place| labels.get(&id(it, place)?).copied();
        let mut graph = Self {
            function,
            known,
            ends: Vec::new(),
            before: vec![Vec::new(); function.blocks.len()],
            dominator: vec![None; function.blocks.len()],
            made: HashMap::new(),
            loops: Vec::new(),
            switches: Vec::new(),
        };
        let mut after: Vec<Vec<usize>> = Vec::new();
        for (number, block) in function.blocks.iter().enumerate() {
            let mut end = End::Other;
            let mut next = Vec::new();
            let mut merge = None;
            for it in &block.instructions {
                if let Some(result) = it.result_id {
                    graph.made.insert(result, (number, it));
                }
                match op(it) {
                    Op::LoopMerge => {
                        if let (Some(merge), Some(continues)) = (at(it, 0), at(it, 1)) {
                            graph.loops.push(Loop {
                                header: number,
                                merge,
                                continues,
                            });
                        }
                    }
                    Op::SelectionMerge => merge = at(it, 0),
                    Op::Branch => {
                        next.extend(at(it, 0));
                        end = next.first().map_or(End::Other, |to| End::Branch(*to));
                    }
                    Op::BranchConditional => {
                        next.extend([at(it, 1), at(it, 2)].into_iter().flatten());
                        if let (Some(condition), [yes, no]) = (id(it, 0), next.as_slice()) {
                            end = End::Conditional(condition, *yes, *no);
                        }
                    }
                    Op::Switch => {
                        let all = it.operands.iter().filter_map(Operand::id_ref_any);
                        next.extend(all.filter_map(|it| labels.get(&it)));
                        graph.switches.push((number, merge));
                    }
                    _ => {}
                }
            }
            next.sort_unstable();
            next.dedup();
            graph.ends.push(end);
            after.push(next);
        }
        graph.find_dominators(&after);
        for (number, next) in after.iter().enumerate() {
            for to in next {
                if graph.dominator[number].is_some() {
                    graph.before[*to].push(number);
                }
            }
        }
        graph
    }

    /// K. Cooper, T. Harvey and K. Kennedy: A Simple, Fast Dominance Algorithm, 2001.
    fn find_dominators(&mut self, after: &[Vec<usize>]) {
        if after.is_empty() {
            return;
        }
        // Blocks so that those before one come first, but for loops.
        let (mut order, mut seen) = (Vec::new(), vec![false; after.len()]);
        let mut stack = vec![(0, 0)];
        seen[0] = true;
        while let Some((block, child)) = stack.pop() {
            match after[block].get(child) {
                Some(next) => {
                    stack.push((block, child + 1));
                    if !seen[*next] {
                        seen[*next] = true;
                        stack.push((*next, 0));
                    }
                }
                None => order.push(block),
            }
        }
        order.reverse();
        let mut place = vec![0; after.len()];
        for (number, block) in order.iter().enumerate() {
            place[*block] = number;
        }
        let mut before = vec![Vec::new(); after.len()];
        for block in &order {
            for next in &after[*block] {
                before[*next].push(*block);
            }
        }
        self.dominator[0] = Some(0);
        let mut changed = true;
        while changed {
            changed = false;
            for block in order.iter().skip(1) {
                let mut found: Option<usize> = None;
                for from in &before[*block] {
                    if self.dominator[*from].is_none() {
                        continue;
                    }
                    found = Some(match found {
                        None => *from,
                        Some(mut one) => {
                            let mut other = *from;
                            while one != other {
                                // Both lead up to the first block, which is before all others.
                                let later = if place[one] > place[other] {
                                    &mut one
                                } else {
                                    &mut other
                                };
                                *later = self.dominator[*later].unwrap_or(0);
                            }
                            one
                        }
                    });
                }
                if self.dominator[*block] != found {
                    self.dominator[*block] = found;
                    changed = true;
                }
            }
        }
    }

    /// The blocks that each way to a block comes through, from itself to the first one.
    fn above(&self, block: usize) -> impl Iterator<Item = usize> {
        let first = self.dominator[block].map(|_| block);
        std::iter::successors(first, |block| {
            self.dominator[*block].filter(|above| above != block)
        })
    }

    /// Whether each way to a block comes through another one.
    pub(super) fn dominates(&self, one: usize, other: usize) -> bool {
        self.above(other).any(|block| block == one)
    }

    /// The header and the merge block of each loop.
    pub(super) fn loops(&self) -> impl Iterator<Item = (usize, usize)> {
        self.loops.iter().map(|it| (it.header, it.merge))
    }

    /// How many blocks each way to a block comes through.
    pub(super) fn depth(&self, block: usize) -> usize {
        self.above(block).count()
    }

    fn is_in(&self, found: &Loop, block: usize) -> bool {
        self.dominates(found.header, block) && !self.dominates(found.merge, block)
    }

    /// The innermost loop that a block is in.
    fn loop_of(&self, block: usize) -> Option<&Loop> {
        let around = self.loops.iter().filter(|it| self.is_in(it, block));
        around.max_by_key(|it| self.above(it.header).count())
    }

    /// What each way to the edge from a block to another one has decided.
    fn facts(&self, from: usize, to: Option<usize>) -> HashMap<Word, Known> {
        let mut facts = HashMap::new();
        let mut learn = |from: usize, to: usize| {
            if let End::Conditional(condition, yes, no) = self.ends[from]
                && yes != no
            {
                facts.entry(condition).or_insert(Known::Truth(to == yes));
            }
        };
        if let Some(to) = to {
            learn(from, to);
        }
        for block in self.above(from) {
            if let [before] = self.before[block].as_slice() {
                learn(*before, block);
            }
        }
        facts
    }

    /// A value at the end of a way through some blocks, each of which leads to the next one.
    fn value(
        &self,
        value: Word,
        way: &[usize],
        facts: &HashMap<Word, Known>,
        depth: u32,
    ) -> Option<Known> {
        if let Some(known) = self.known.get(&value).or_else(|| facts.get(&value)) {
            return Some(*known);
        }
        let depth = depth.checked_sub(1)?;
        let (block, it) = *self.made.get(&value)?;
        let operand = |place| self.value(id(it, place)?, way, facts, depth);
        let truth = |place| match operand(place)? {
            Known::Truth(truth) => Some(truth),
            Known::Number(_) => None,
        };
        let is_equal = || Some(operand(0)? == operand(1)?);
        match op(it) {
            Op::Phi => {
                let place = way.iter().position(|it| *it == block)?;
                let before = *way.get(place.checked_sub(1)?)?;
                let coming = incoming(it, self.function.blocks[before].label_id()?)?;
                // What comes from there was there at its end.
                self.value(coming, &way[..place], facts, depth)
            }
            Op::CopyObject => operand(0),
            Op::LogicalNot => Some(Known::Truth(!truth(0)?)),
            Op::LogicalEqual | Op::IEqual => Some(Known::Truth(is_equal()?)),
            Op::LogicalNotEqual | Op::INotEqual => Some(Known::Truth(!is_equal()?)),
            Op::LogicalAnd => match (truth(0), truth(1)) {
                (Some(false), _) | (_, Some(false)) => Some(Known::Truth(false)),
                (Some(true), Some(true)) => Some(Known::Truth(true)),
                _ => None,
            },
            Op::LogicalOr => match (truth(0), truth(1)) {
                (Some(true), _) | (_, Some(true)) => Some(Known::Truth(true)),
                (Some(false), Some(false)) => Some(Known::Truth(false)),
                _ => None,
            },
            Op::Select => operand(if truth(0)? { 1 } else { 2 }),
            _ => None,
        }
    }

    /// A block whose branch is decided by where it is entered from, such that a loop is left.
    fn exit(&self) -> Option<Exit> {
        for (number, end) in self.ends.iter().enumerate() {
            let End::Conditional(condition, yes, no) = *end else {
                continue;
            };
            if yes == no {
                continue;
            }
            let mut rows = vec![self.row_to(number)];
            while let Some(through) = rows.pop() {
                let into = through[0];
                let before = &self.before[into];
                let mut instructions = self.instructions(&through);
                if before.len() < 2 || !instructions.all(may_be_left_out) {
                    continue;
                }
                let Some(found) = self.loop_of(into) else {
                    continue;
                };
                for from in before.iter().copied() {
                    let is_alike = self
                        .loop_of(from)
                        .is_some_and(|it| it.header == found.header);
                    if !is_alike
                        || self.dominates(found.continues, from)
                        || self.before[found.merge].contains(&from)
                        || matches!(self.ends[from], End::Other)
                        || self.is_in_switch(found, from)
                    {
                        continue;
                    }
                    let facts = self.facts(from, Some(into));
                    let way: Vec<usize> = [from].into_iter().chain(through.clone()).collect();
                    let Some(Known::Truth(truth)) = self.value(condition, &way, &facts, DEPTH)
                    else {
                        // It may be known where ways come together before.
                        let is_joint = self.before[from].len() > 1
                            && matches!(self.ends[from], End::Branch(_));
                        if is_joint && way.len() <= MOST_BLOCKS && !through.contains(&from) {
                            rows.push(way);
                        }
                        continue;
                    };
                    let (last, to) = self.behind(found, number, if truth { yes } else { no });
                    if to != found.merge {
                        continue;
                    }
                    let blocks = 0..self.function.blocks.len();
                    let exit = Exit {
                        from,
                        through: through.clone(),
                        last,
                        to,
                        inside: blocks.filter(|block| self.is_in(found, *block)).collect(),
                    };
                    if self.can_be_made(&exit) {
                        return Some(exit);
                    }
                }
            }
        }
        None
    }

    /// Whether all that is used behind the loop of what the block makes can be made before it, too.
    fn can_be_made(&self, exit: &Exit) -> bool {
        let blocks = &self.function.blocks;
        let outside = exit.outside(self.function);
        let Some(last) = blocks[exit.last].label_id() else {
            return false;
        };
        let phis = blocks[exit.to].instructions.iter();
        let phis = phis.take_while(|it| op(it) == Op::Phi);
        let mut left: Vec<Word> = phis.filter_map(|phi| incoming(phi, last)).collect();
        let own = self.instructions(&exit.through);
        left.extend(own.filter_map(|it| it.result_id).filter(|value| {
            exit.behind(self.function)
                .any(|it| uses(it, *value, &outside))
        }));
        let mut seen = HashSet::new();
        while let Some(value) = left.pop() {
            let Some((block, it)) = self.made.get(&value) else {
                continue;
            };
            let Some(place) = exit.through.iter().position(|it| it == block) else {
                continue;
            };
            if !seen.insert(value) {
                continue;
            }
            if op(it) == Op::Phi {
                // From the first block's phis comes what was made before.
                let before = place.checked_sub(1).map(|it| exit.through[it]);
                let label = before.and_then(|it| blocks[it].label_id());
                left.extend(label.and_then(|label| incoming(it, label)));
                continue;
            }
            if !may_be_repeated(it) {
                return false;
            }
            left.extend(it.operands.iter().filter_map(Operand::id_ref_any));
        }
        true
    }

    /// A `break` there would end the switch alone, in the languages.
    fn is_in_switch(&self, found: &Loop, block: usize) -> bool {
        self.switches.iter().any(|(switch, merge)| {
            let is_over = merge.is_some_and(|merge| self.dominates(merge, block));
            self.is_in(found, *switch) && self.dominates(*switch, block) && !is_over
        })
    }

    /// The blocks of which each one alone leads to the next one, and that to nothing else, up to a block.
    fn row_to(&self, block: usize) -> Vec<usize> {
        let before = |block: &usize| match self.before[*block].as_slice() {
            [before] if matches!(self.ends[*before], End::Branch(_)) => {
                let is_plain = |it: &Instruction| !matches!(op(it), Op::Phi | Op::LoopMerge);
                let instructions = &self.function.blocks[*block].instructions;
                instructions.iter().all(is_plain).then_some(*before)
            }
            _ => None,
        };
        let mut row: Vec<usize> = std::iter::successors(Some(block), before)
            .take(self.ends.len())
            .collect();
        row.reverse();
        row
    }

    fn instructions(&self, blocks: &[usize]) -> impl Iterator<Item = &'a Instruction> {
        let function = self.function;
        blocks
            .iter()
            .flat_map(|block| &function.blocks[*block].instructions)
    }

    /// Where a way leads that goes on through blocks that do nothing, up to the end of a loop, and the block before.
    fn behind(&self, found: &Loop, mut last: usize, mut to: usize) -> (usize, usize) {
        for _ in 0..self.ends.len() {
            let is_empty = self.function.blocks[to].instructions.len() == 1;
            match self.ends[to] {
                End::Branch(next) if is_empty && to != found.merge => {
                    last = to;
                    to = next;
                }
                _ => break,
            }
        }
        (last, to)
    }

    /// Blocks that either leave their loop or go on, and where they go on. What is there is no longer a part of an `if`
    /// then: what it makes is there for all that follows.
    fn open(&self) -> Vec<(usize, usize)> {
        let label = |block: usize| self.function.blocks[block].label_id().map(Operand::IdRef);
        let merges: HashSet<&Operand> = self
            .function
            .all_inst_iter()
            .filter(|it| matches!(op(it), Op::SelectionMerge | Op::LoopMerge))
            .flat_map(|it| &it.operands)
            .collect();
        let on = |block: usize| {
            let End::Conditional(_, yes, no) = self.ends[block] else {
                return None;
            };
            let found = self.loop_of(block)?;
            let leaves = |to| self.behind(found, block, to).1 == found.merge;
            let on = match (leaves(yes), leaves(no)) {
                (true, false) => no,
                (false, true) => yes,
                _ => return None,
            };
            let instructions = &self.function.blocks[block].instructions;
            let is_closed = instructions.iter().any(|it| op(it) == Op::SelectionMerge);
            let is_free = self.before[on] == [block] && !merges.contains(&label(on)?);
            (is_closed && is_free).then_some((block, on))
        };
        (0..self.ends.len()).filter_map(on).collect()
    }

    /// Conditions that are decided by what each way to their place has decided: the block, the instruction, its operand,
    /// and what the condition is.
    fn settled(&self) -> Vec<(usize, usize, usize, bool)> {
        let mut settled = Vec::new();
        let reached = (0..self.ends.len()).filter(|block| self.dominator[*block].is_some());
        for block in reached {
            let here = self.facts(block, None);
            let instructions = &self.function.blocks[block].instructions;
            for (place, it) in instructions.iter().enumerate() {
                let conditions = match op(it) {
                    Op::BranchConditional | Op::LogicalNot => 0..1,
                    Op::LogicalAnd | Op::LogicalOr => 0..2,
                    Op::Select => 0..3,
                    Op::Phi => 0..it.operands.len(),
                    _ => continue,
                };
                for operand in conditions {
                    let Some(value) = id(it, operand) else {
                        continue;
                    };
                    if self.known.contains_key(&value) {
                        continue;
                    }
                    let known = if op(it) == Op::Phi {
                        self.coming(it, operand, block)
                    } else if here.is_empty() {
                        None
                    } else {
                        self.value(value, &[block], &here, DEPTH)
                    };
                    if let Some(Known::Truth(truth)) = known {
                        settled.push((block, place, operand, truth));
                    }
                }
            }
        }
        settled
    }

    /// What is known of the value in an operand of a phi, where it comes from.
    fn coming(&self, phi: &Instruction, operand: usize, block: usize) -> Option<Known> {
        let (value, label) = (id(phi, operand)?, id(phi, operand + 1)?);
        let mut before = self.before[block].iter().copied();
        let from = before.find(|it| self.function.blocks[*it].label_id() == Some(label))?;
        let facts = self.facts(from, Some(block));
        // Values of other phis here are those of the turn before.
        self.value(value, &[from], &facts, DEPTH)
    }
}

/// What comes into a phi from a block.
fn incoming(phi: &Instruction, from: Word) -> Option<Word> {
    let pairs = (0..phi.operands.len() / 2).map(|i| (id(phi, 2 * i), id(phi, 2 * i + 1)));
    let mut of_block = pairs.filter(|(_, block)| *block == Some(from));
    of_block.next().and_then(|(value, _)| value)
}

/// Whether nobody sees that an instruction is not carried out.
fn may_be_left_out(it: &Instruction) -> bool {
    matches!(
        op(it),
        Op::Phi
            | Op::SelectionMerge
            | Op::Branch
            | Op::BranchConditional
            | Op::Load
            | Op::AccessChain
            | Op::InBoundsAccessChain
            | Op::ExtInst
            | Op::FAdd
            | Op::FSub
            | Op::FMul
            | Op::FDiv
            | Op::FNegate
            | Op::FOrdLessThan
            | Op::FOrdLessThanEqual
            | Op::FOrdGreaterThan
            | Op::FOrdGreaterThanEqual
            | Op::FOrdEqual
            | Op::FUnordNotEqual
            | Op::ConvertSToF
            | Op::ConvertUToF
    ) || may_be_repeated(it)
}

/// Whether an instruction gives the same wherever it stands, and nothing is noted of it: not so of arithmetic that is
/// held as it is written.
fn may_be_repeated(it: &Instruction) -> bool {
    matches!(
        op(it),
        Op::CopyObject
            | Op::CompositeExtract
            | Op::CompositeConstruct
            | Op::CompositeInsert
            | Op::Undef
            | Op::LogicalNot
            | Op::LogicalAnd
            | Op::LogicalOr
            | Op::LogicalEqual
            | Op::LogicalNotEqual
            | Op::IEqual
            | Op::INotEqual
            | Op::ULessThan
            | Op::ULessThanEqual
            | Op::UGreaterThan
            | Op::UGreaterThanEqual
            | Op::SLessThan
            | Op::SLessThanEqual
            | Op::SGreaterThan
            | Op::SGreaterThanEqual
            | Op::IAdd
            | Op::ISub
            | Op::IMul
            | Op::BitwiseAnd
            | Op::BitwiseOr
            | Op::BitwiseXor
            | Op::Bitcast
            | Op::Select
    )
}

/// Makes the loop's exit that was found.
fn leave(module: &mut Module, number: usize, exit: &Exit) {
    let Some(bound) = module.header.as_ref().map(|header| header.bound) else {
        return;
    };
    let function = &mut module.functions[number];
    let label = |block: usize| function.blocks[block].label_id().unwrap_or_default();
    let into = exit.through[0];
    let [from, through, last, to] = [exit.from, into, exit.last, exit.to].map(label);
    // Each block with the label of the one before it.
    let before = [exit.from].into_iter().chain(exit.through.iter().copied());
    let blocks = before.zip(&exit.through).flat_map(|(before, block)| {
        let instructions = function.blocks[*block].instructions.iter();
        instructions.map(move |it| (label(before), it.clone()))
    });
    let mut copies = Copies {
        instructions: blocks.collect(),
        bound,
        known: HashMap::new(),
        made: Vec::new(),
    };
    // What the block makes and others use behind the loop comes through its merge block from now on.
    let own: Vec<(Word, Option<Word>)> = copies
        .instructions
        .iter()
        .filter_map(|(_, it)| Some((it.result_id?, it.result_type)))
        .collect();
    let before: Vec<Word> = function
        .blocks
        .iter()
        .filter(|block| block.instructions.last().is_some_and(|it| leads_to(it, to)))
        .filter_map(Block::label_id)
        .collect();
    let outside = exit.outside(function);
    let mut phis = Vec::new();
    for (value, ty) in own {
        if !exit.behind(function).any(|it| uses(it, value, &outside)) {
            continue;
        }
        let new = copies.new_id();
        let mut operands: Vec<Operand> = Vec::new();
        for block in &before {
            operands.extend([Operand::IdRef(value), Operand::IdRef(*block)]);
        }
        for (block, it) in function.blocks.iter_mut().enumerate() {
            if !exit.inside.contains(&block) {
                for it in &mut it.instructions {
                    replace(it, value, new, &outside);
                }
            }
        }
        phis.push(Instruction::new(Op::Phi, ty, Some(new), operands));
    }
    let merge = &mut function.blocks[exit.to].instructions;
    merge.splice(0..0, phis);
    for phi in merge.iter_mut().take_while(|it| op(it) == Op::Phi) {
        if let Some(value) = incoming(phi, last) {
            let value = copies.of(value);
            phi.operands
                .extend([Operand::IdRef(value), Operand::IdRef(from)]);
        }
    }
    for phi in function.blocks[into]
        .instructions
        .iter_mut()
        .take_while(|it| op(it) == Op::Phi)
    {
        let pairs = phi.operands.chunks(2);
        let others = pairs.filter(|pair| pair.get(1) != Some(&Operand::IdRef(from)));
        phi.operands = others.flatten().cloned().collect();
    }
    let block = &mut function.blocks[exit.from].instructions;
    if let Some(end) = block.last_mut() {
        for operand in &mut end.operands {
            if *operand == Operand::IdRef(through) {
                *operand = Operand::IdRef(to);
            }
        }
    }
    let at = before_end(&function.blocks[exit.from]);
    let block = &mut function.blocks[exit.from].instructions;
    block.splice(at..at, copies.made);
    if let Some(header) = &mut module.header {
        header.bound = copies.bound;
    }
}

fn leads_to(end: &Instruction, to: Word) -> bool {
    end.operands.contains(&Operand::IdRef(to))
}

/// Whether an instruction behind a loop uses a value, but for what comes from the loop itself into a phi.
fn uses(it: &Instruction, value: Word, outside: &HashSet<Word>) -> bool {
    let mut copy = it.clone();
    replace(&mut copy, value, 0, outside);
    copy.operands != it.operands
}

fn replace(it: &mut Instruction, value: Word, new: Word, outside: &HashSet<Word>) {
    let is_phi = op(it) == Op::Phi;
    for place in 0..it.operands.len() {
        let is_of_loop = is_phi && id(it, place + 1).is_none_or(|from| !outside.contains(&from));
        if it.operands[place] == Operand::IdRef(value) && !is_of_loop {
            it.operands[place] = Operand::IdRef(new);
        }
    }
}

/// What some blocks make, made at the end of one that comes before them.
struct Copies {
    /// Each with the block that comes before its own.
    instructions: Vec<(Word, Instruction)>,
    bound: Word,
    known: HashMap<Word, Word>,
    made: Vec<Instruction>,
}

impl Copies {
    fn new_id(&mut self) -> Word {
        self.bound += 1;
        self.bound - 1
    }

    /// The value that stands for one of theirs.
    fn of(&mut self, value: Word) -> Word {
        if let Some(found) = self.known.get(&value) {
            return *found;
        }
        let mut made = self.instructions.iter();
        let Some((before, it)) = made.find(|(_, it)| it.result_id == Some(value)).cloned() else {
            return value;
        };
        let found = if op(&it) == Op::Phi {
            incoming(&it, before).map_or(value, |coming| self.of(coming))
        } else {
            let mut copy = it;
            for operand in &mut copy.operands {
                if let Operand::IdRef(value) = operand {
                    *value = self.of(*value);
                }
            }
            let new = self.new_id();
            copy.result_id = Some(new);
            self.made.push(copy);
            new
        };
        self.known.insert(value, found);
        found
    }
}

/// Puts constants in the place of conditions.
fn settle(module: &mut Module, number: usize, settled: &[(usize, usize, usize, bool)]) {
    let mut editor = Editor::new(module);
    let ty = editor.bool_type();
    let (yes, no) = (editor.truth(ty), editor.falsehood(ty));
    for (block, place, operand, truth) in settled {
        let it = &mut module.functions[number].blocks[*block].instructions[*place];
        it.operands[*operand] = Operand::IdRef(if *truth { yes } else { no });
    }
}

#[cfg(test)]
mod tests {
    use super::super::store;
    use super::super::tests::of_wgsl;
    use crate::finish::{optimise, validate};

    use super::*;

    /// The instructions of a kernel of that body, optimised; `sum` is what it gives.
    fn optimised(body: &str) -> Vec<Op> {
        let module = of_wgsl(&format!(
            "@group(0) @binding(0) var<storage> x: array<u32>;
             @group(0) @binding(1) var<storage, read_write> out: array<u32>;
             @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                 let n = x[id.x];
                 var sum = 0u;
                 {body}
                 out[id.x] = sum;
             }}"
        ));
        let (words, _) = optimise(module, "test").unwrap();
        let module = super::super::load(&words, "test").unwrap();
        validate(&store(&module), "test").unwrap();
        let function = module.functions.last().unwrap();
        function.all_inst_iter().map(op).collect()
    }

    fn count(all: &[Op], wanted: Op) -> usize {
        all.iter().filter(|it| **it == wanted).count()
    }

    #[test]
    fn a_loop_ends_where_its_range_does() {
        let all = optimised(
            "var next = 0u;
             loop {
                 var some = 0u; var i = 0u;
                 if next < n { some = 1u; i = next; next = next + 1u; }
                 if some != 0u { sum = sum * 3u + i; } else { break; }
             }",
        );
        assert_eq!(count(&all, Op::BranchConditional), 1, "{all:?}");
        assert_eq!(count(&all, Op::Phi), 2, "{all:?}");
        assert_eq!(count(&all, Op::Select), 0, "{all:?}");
    }

    #[test]
    fn what_the_last_turn_made_is_there_behind_the_loop() {
        // `last` is made in the block that the loop's exit goes through.
        let all = optimised(
            "var next = 0u; var last = 0u;
             loop {
                 var some = 0u; var i = 7u;
                 if next < n { some = 1u; i = next; next = next + 1u; }
                 last = i * 5u + next;
                 if some != 0u { sum = sum * 3u + i; } else { break; }
             }
             sum = sum ^ last;",
        );
        assert_eq!(count(&all, Op::BranchConditional), 1, "{all:?}");
        assert_eq!(count(&all, Op::BitwiseXor), 1, "{all:?}");
    }

    #[test]
    fn a_break_leaves_a_loop_over_a_range_at_once() {
        // As rust-gpu has it: whether the loop goes on is chosen in two branches, one within the other.
        let all = optimised(
            "var next = 0u;
             loop {
                 var on = false;
                 if next < n {
                     let here = sum ^ next;
                     if here != 7u { sum = here * 3u; on = true; }
                     next = next + 1u;
                 }
                 if !on { break; }
             }",
        );
        assert_eq!(count(&all, Op::BranchConditional), 2, "{all:?}");
        assert_eq!(count(&all, Op::LogicalNot), 0, "{all:?}");
    }

    #[test]
    fn a_loop_within_a_loop_ends_where_its_range_does() {
        // Behind the inner loop there is nothing but the next turn of the outer one.
        let all = optimised(
            "for (var row = 0u; row < n; row++) {
                 var next = 0u;
                 loop {
                     var on = false;
                     if next < row {
                         let here = sum ^ next;
                         if here != 7u { sum = here * 3u; on = true; }
                         next = next + 1u;
                     }
                     if !on { break; }
                 }
             }",
        );
        assert_eq!(count(&all, Op::BranchConditional), 3, "{all:?}");
        assert_eq!(count(&all, Op::LogicalNot), 0, "{all:?}");
    }

    #[test]
    fn an_included_end_is_one_flag() {
        let all = optimised(
            "var next = 1u; var done = false;
             loop {
                 var some = 0u; var i = 0u;
                 if !(done || next > n) {
                     some = 1u; i = next;
                     if next < n { next = next + 1u; } else { done = true; }
                 }
                 if some == 1u { sum = sum * 3u + i; } else { break; }
             }",
        );
        // Whether it is done, whether there is one, and whether it is the last one.
        assert!(count(&all, Op::BranchConditional) <= 3, "{all:?}");
        assert_eq!(count(&all, Op::IEqual), 0, "{all:?}");
    }

    #[test]
    fn a_switch_is_not_left_with_its_loop() {
        let all = optimised(
            "var next = 0u;
             loop {
                 var some = 0u;
                 switch (n + next) & 3u {
                     case 0u: { if next < n { some = 1u; } }
                     case 1u: { some = 1u; }
                     default: { if next * 2u < n { some = 1u; } }
                 }
                 next = next + 1u;
                 if some != 0u { sum = sum * 3u + next; } else { break; }
             }",
        );
        assert_eq!(count(&all, Op::Switch), 1, "{all:?}");
    }
}
