//! What lies where, and which passes have to run. Nothing here touches a device.

use std::collections::BTreeSet;

use crate::graph::{Graph, Handle, Origin, Shape};

/// Given values that something depends on and that may change.
type Sources = BTreeSet<usize>;

/// Where values lie. Values that are never needed at the same time share a block.
#[derive(Clone, Debug, PartialEq)]
pub struct Blocks {
    /// The block of each value; none for what no needed pass touches.
    pub of: Vec<Option<usize>>,
    /// What each block is.
    pub shapes: Vec<Shape>,
    /// Bytes of all blocks, had each value one of its own.
    pub unshared: usize,
}

/// A block while blocks are dealt out.
struct Open {
    /// The last pass that needs it; `None` for ever.
    until: Option<usize>,
    /// What those depend on that had it.
    sources: Vec<Sources>,
}

/// What the passes and values of a graph depend on.
struct Dependence {
    passes: Vec<Sources>,
    values: Vec<Sources>,
}

fn dependence(graph: &Graph) -> Dependence {
    let mut values = vec![Sources::new(); graph.values().len()];
    for (i, value) in graph.values().iter().enumerate() {
        if let Origin::Given {
            is_constant: false, ..
        } = value.origin
        {
            values[i].insert(i);
        }
    }
    let mut passes = Vec::new();
    for pass in graph.passes() {
        let all = pass.reads.iter().flat_map(|h| values[h.at()].iter());
        let sources: Sources = all.copied().collect();
        for written in &pass.writes {
            values[written.at()].clone_from(&sources);
        }
        passes.push(sources);
    }
    Dependence { passes, values }
}

/// Values that share a place because one is made of the other, as far as needed passes go.
struct Chain {
    members: Vec<usize>,
    begin: usize,
    /// The last pass that needs it; `None` if it must last from run to run.
    end: Option<usize>,
    sources: Sources,
}

fn chains(graph: &Graph, needed: &[bool], on: &Dependence) -> Vec<Chain> {
    let values = graph.values();
    let mut chains: Vec<Chain> = Vec::new();
    let mut chain_of = vec![None; values.len()];
    for (p, pass) in graph
        .passes()
        .iter()
        .enumerate()
        .filter(|(p, _)| needed[*p])
    {
        for read in &pass.reads {
            let Some(chain) = chain_of[read.at()] else {
                continue;
            };
            let chain: &mut Chain = &mut chains[chain];
            chain.end = chain.end.map(|end| end.max(p));
            // The reader may run without the writer: the value has to last, but for one that the
            // reader itself changes.
            let writer = values[read.at()].pass();
            let is_changed = pass.writes.iter().any(
                |w| matches!(values[w.at()].origin, Origin::Changed { from, .. } if from == *read),
            );
            if !is_changed && writer.is_some_and(|w| on.passes[w] != on.passes[p]) {
                chain.end = None;
            }
        }
        for written in &pass.writes {
            let i = written.at();
            let chain = match values[i].origin {
                Origin::Changed { from, .. } => chain_of[from.at()],
                _ => None,
            };
            let chain = chain.unwrap_or_else(|| {
                chains.push(Chain {
                    members: Vec::new(),
                    begin: p,
                    end: Some(p),
                    sources: Sources::new(),
                });
                chains.len() - 1
            });
            chain_of[i] = Some(chain);
            chains[chain].members.push(i);
            chains[chain].sources.extend(&on.values[i]);
        }
    }
    for kept in graph.kept() {
        if let Some(chain) = chain_of[kept.at()] {
            chains[chain].end = None;
        }
    }
    chains
}

/// Whether one can be where the other was.
fn alike(a: &Shape, b: &Shape) -> bool {
    match (a, b) {
        (Shape::Buffer { bytes: a, .. }, Shape::Buffer { bytes: b, .. }) => a == b,
        (Shape::Texture(a), Shape::Texture(b)) => a == b,
        _ => false,
    }
}

impl Blocks {
    /// Deals blocks out. A value that lasts from run to run may have the block of one that lives
    /// before it within a run, if it is made anew whenever that is.
    pub fn new(graph: &Graph, needed: &[bool]) -> Self {
        let on = dependence(graph);
        let values = graph.values();
        let mut this = Self {
            of: vec![None; values.len()],
            shapes: Vec::new(),
            unshared: 0,
        };
        let mut open: Vec<Open> = Vec::new();
        let passes = graph.passes().iter().zip(needed).filter(|(_, n)| **n);
        let read: BTreeSet<usize> = passes
            .flat_map(|(p, _)| p.reads.iter().map(|h| h.at()))
            .chain(graph.kept().iter().map(|h| h.at()))
            .collect();
        for i in read {
            if values[i].pass().is_none() {
                this.of[i] = Some(this.shapes.len());
                this.shapes.push(values[i].shape.clone());
                this.unshared += values[i].shape.bytes();
                open.push(Open {
                    until: None,
                    sources: Vec::new(),
                });
            }
        }
        for chain in chains(graph, needed, &on) {
            let shape = &values[chain.members[0]].shape;
            let free = (0..open.len()).find(|&b| {
                alike(&this.shapes[b], shape)
                    && open[b].until.is_some_and(|until| until < chain.begin)
                    && (chain.end.is_some()
                        || open[b].sources.iter().all(|s| s.is_subset(&chain.sources)))
            });
            this.unshared += shape.bytes();
            let block = free.unwrap_or_else(|| {
                this.shapes.push(shape.clone());
                open.push(Open {
                    until: None,
                    sources: Vec::new(),
                });
                open.len() - 1
            });
            open[block].until = chain.end;
            open[block].sources.push(chain.sources);
            for member in chain.members {
                this.of[member] = Some(block);
            }
        }
        this
    }

    /// Bytes of all blocks.
    pub fn bytes(&self) -> usize {
        self.shapes.iter().map(Shape::bytes).sum()
    }
}

/// What was done, and what is where.
#[derive(Clone, Debug)]
pub struct State {
    /// The value that each block holds.
    holds: Vec<Option<usize>>,
    /// Of each value: another number whenever its content is another.
    stamps: Vec<u64>,
    /// Of each pass: the stamps of what it read when it ran last.
    seen: Vec<Option<Vec<u64>>>,
    last: u64,
}

impl State {
    /// Nothing was done; what is given is there.
    pub fn new(graph: &Graph, blocks: &Blocks) -> Self {
        let mut holds = vec![None; blocks.shapes.len()];
        for (i, value) in graph.values().iter().enumerate() {
            if let (None, Some(block)) = (value.pass(), blocks.of[i]) {
                holds[block] = Some(i);
            }
        }
        Self {
            holds,
            stamps: vec![0; graph.values().len()],
            seen: vec![None; graph.passes().len()],
            last: 0,
        }
    }

    /// Whether a value is in its block now.
    pub fn is_there(&self, blocks: &Blocks, value: Handle) -> bool {
        blocks.of[value.at()].is_some_and(|block| self.holds[block] == Some(value.at()))
    }

    /// A number that is another whenever the value's content is another.
    pub fn stamp(&self, value: Handle) -> u64 {
        self.stamps[value.at()]
    }

    /// What is given is another now.
    pub fn changed(&mut self, value: Handle) {
        self.last += 1;
        self.stamps[value.at()] = self.last;
    }

    /// Every pass has to run again.
    pub fn forget(&mut self) {
        self.seen.fill(None);
    }

    /// Which passes have to run: those whose inputs are others than when they ran last, and those
    /// whose output another one overwrote although it is needed again.
    pub fn due(&self, graph: &Graph, needed: &[bool], blocks: &Blocks) -> Vec<bool> {
        let passes = graph.passes();
        let mut due = vec![false; passes.len()];
        let mut is_fresh = vec![false; self.stamps.len()];
        for (p, pass) in passes.iter().enumerate().filter(|(p, _)| needed[*p]) {
            let reads = &pass.reads;
            due[p] = reads.iter().any(|h| is_fresh[h.at()])
                || self.seen[p].as_ref().is_none_or(|seen| {
                    !reads
                        .iter()
                        .map(|h| self.stamps[h.at()])
                        .eq(seen.iter().copied())
                });
            if due[p] {
                for written in &pass.writes {
                    is_fresh[written.at()] = true;
                }
            }
        }
        loop {
            let mut more = None;
            for (p, pass) in passes.iter().enumerate().filter(|(p, _)| due[*p]) {
                more = more.or_else(|| self.missing(graph, blocks, &due, p, &pass.reads));
            }
            more = more.or_else(|| self.missing(graph, blocks, &due, passes.len(), graph.kept()));
            match more {
                Some(pass) => due[pass] = true,
                None => return due,
            }
        }
    }

    /// The pass that makes the first of `wanted` that will not be there before pass `before`.
    fn missing(
        &self,
        graph: &Graph,
        blocks: &Blocks,
        due: &[bool],
        before: usize,
        wanted: &[Handle],
    ) -> Option<usize> {
        wanted.iter().find_map(|handle| {
            let writer = graph.values()[handle.at()].pass()?;
            let block = blocks.of[handle.at()];
            let written = (0..before).rev().filter(|p| due[*p]).find_map(|p| {
                let writes = graph.passes()[p].writes.iter();
                writes.map(|w| w.at()).find(|w| blocks.of[*w] == block)
            });
            let there = written.or(block.and_then(|b| self.holds[b]));
            (there != Some(handle.at())).then_some(writer)
        })
    }

    /// A pass begins: what it writes is nothing yet.
    pub fn begin(&mut self, graph: &Graph, blocks: &Blocks, pass: usize) {
        for written in &graph.passes()[pass].writes {
            if let Some(block) = blocks.of[written.at()] {
                self.holds[block] = None;
            }
        }
    }

    /// A pass is done. Made anew of the same, its outputs are what they were.
    pub fn end(&mut self, graph: &Graph, blocks: &Blocks, pass: usize) {
        let reads = graph.passes()[pass].reads.iter();
        let seen: Vec<u64> = reads.map(|h| self.stamps[h.at()]).collect();
        let is_same = self.seen[pass].as_ref() == Some(&seen);
        for written in &graph.passes()[pass].writes {
            if let Some(block) = blocks.of[written.at()] {
                self.holds[block] = Some(written.at());
            }
            if !is_same {
                self.changed(*written);
            }
        }
        self.seen[pass] = Some(seen);
    }
}
