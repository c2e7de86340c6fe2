//! A routine for lanes: its instructions in another order, so that many of one kind stand together.
//!
//! To find out what an instruction does takes longer than to do it. Every value keeps the operation it comes from, hence
//! its bits; only the order of what does not read each other changes.

use super::operands::{moved, reads, written};
use halfarrow_compiler::program::{Instruction, Register, Routine, Solve};
use std::collections::BTreeMap;

/// What stands together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Add,
    Sub,
    Mul,
    Div,
    Neg,
}

/// A step of the packed routine.
#[derive(Debug, Clone)]
pub(crate) enum Run {
    /// Operations of one kind: result and operands, in their slots.
    Many(Kind, Vec<[u32; 3]>),
    /// Any other instruction, on slots.
    One(Instruction),
    /// A solve block.
    Solve(Block),
}

/// A solve block, which works on the registers of a frame.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    /// Its number in the routine.
    pub solve: usize,
    /// What it reads: slot and register.
    pub reads: Vec<(u32, Register)>,
    /// What it finds: slot and register.
    pub finds: Vec<(u32, Register)>,
}

/// The packed routine.
#[derive(Debug, Clone, Default)]
pub(crate) struct Packed {
    pub runs: Vec<Run>,
    /// Slots of what is wanted.
    pub outputs: Vec<u32>,
    /// Slots in all; those of fixed registers are their registers.
    pub slots: usize,
}

/// An instruction on values that are written once.
struct Item {
    kind: Option<Kind>,
    instruction: Instruction,
    reads: Vec<u32>,
    writes: Vec<u32>,
}

impl Packed {
    /// The routine in packed order; registers below `fixed` are given.
    pub fn new(routine: &Routine, fixed: u32) -> Packed {
        let mut named = Named { of: BTreeMap::new(), fixed, next: fixed };
        let items: Vec<Item> = routine.code.iter().map(|i| named.item(routine, i)).collect();
        let outputs: Vec<u32> = routine.outputs.iter().map(|&r| named.read(r)).collect();
        let order = packed_order(&items, named.next);
        Slots::new(fixed, named.next, &items, &order, &outputs).place(routine, &items, order, &outputs)
    }
}

/// Registers as values that are written once.
struct Named {
    of: BTreeMap<Register, u32>,
    fixed: u32,
    next: u32,
}

impl Named {
    fn read(&self, r: Register) -> u32 {
        if r < self.fixed { r } else { self.of[&r] }
    }

    fn write(&mut self, r: Register) -> u32 {
        self.of.insert(r, self.next);
        self.next += 1;
        self.next - 1
    }

    fn item(&mut self, routine: &Routine, instruction: &Instruction) -> Item {
        use Instruction::*;
        if let Solve { solve } = *instruction {
            let solve = &routine.solves[solve as usize];
            assert!(solve.shared.is_none(), "rates and recorded values share no factors");
            let reads = read_by(solve).map(|r| self.read(r)).collect();
            let writes = solve.unknowns.iter().map(|&r| self.write(r)).collect();
            return Item { kind: None, instruction: *instruction, reads, writes };
        }
        let kind = match instruction {
            Add { .. } => Some(Kind::Add),
            Sub { .. } => Some(Kind::Sub),
            Mul { .. } => Some(Kind::Mul),
            Div { .. } => Some(Kind::Div),
            Neg { .. } => Some(Kind::Neg),
            _ => None,
        };
        let mut read = Vec::new();
        reads(instruction, |r| read.push(self.read(r)));
        let writes = written(instruction).map(|r| self.write(r)).into_iter().collect();
        Item { kind, instruction: *instruction, reads: read, writes }
    }
}

/// What a solve block reads from outside.
fn read_by(solve: &Solve) -> impl Iterator<Item = Register> + '_ {
    let linear = solve.guess.is_empty();
    let of_linear = if linear { &solve.matrix[..] } else { &[] };
    let right = if linear { &solve.right[..] } else { &[] };
    solve.outer.iter().chain(of_linear).chain(right).copied()
}

/// All that is ready of the kind of which most is, again and again.
fn packed_order(items: &[Item], values: u32) -> Vec<Vec<usize>> {
    let mut readers: Vec<Vec<usize>> = vec![Vec::new(); values as usize];
    let mut missing = vec![0usize; items.len()];
    let mut made_by = vec![usize::MAX; values as usize];
    for (i, item) in items.iter().enumerate() {
        for &read in item.reads.iter().filter(|&&read| made_by[read as usize] != usize::MAX) {
            readers[read as usize].push(i);
            missing[i] += 1;
        }
        item.writes.iter().for_each(|&value| made_by[value as usize] = i);
    }
    let mut ready: BTreeMap<Option<Kind>, Vec<usize>> = BTreeMap::new();
    for (i, item) in items.iter().enumerate().filter(|(i, _)| missing[*i] == 0) {
        ready.entry(item.kind).or_default().push(i);
    }
    let mut order = Vec::new();
    loop {
        // What is no arithmetic waits until there is nothing else.
        let most =
            ready.iter().filter(|(_, all)| !all.is_empty()).max_by_key(|(kind, all)| (kind.is_some(), all.len()));
        let Some(kind) = most.map(|(kind, _)| *kind) else { return order };
        let now = ready.remove(&kind).unwrap_or_default();
        for &i in &now {
            for &value in &items[i].writes {
                for &reader in &readers[value as usize] {
                    missing[reader] -= 1;
                    if missing[reader] == 0 {
                        ready.entry(items[reader].kind).or_default().push(reader);
                    }
                }
            }
        }
        order.push(now);
    }
}

/// Places for values: as few as may be, so that they stay near.
struct Slots {
    of: Vec<u32>,
    /// How often a value is still read.
    left: Vec<usize>,
    free: Vec<u32>,
    next: u32,
    fixed: u32,
}

impl Slots {
    fn new(fixed: u32, values: u32, items: &[Item], order: &[Vec<usize>], outputs: &[u32]) -> Slots {
        let mut left = vec![0; values as usize];
        let all = order.iter().flatten().flat_map(|&i| &items[i].reads);
        all.chain(outputs).for_each(|&value| left[value as usize] += 1);
        Slots { of: (0..values).collect(), left, free: Vec::new(), next: fixed, fixed }
    }

    fn read(&mut self, value: u32) -> u32 {
        let slot = self.of[value as usize];
        self.left[value as usize] -= 1;
        if value >= self.fixed && self.left[value as usize] == 0 {
            self.free.push(slot);
        }
        slot
    }

    fn write(&mut self, value: u32) -> u32 {
        let slot = self.free.pop().unwrap_or_else(|| {
            self.next += 1;
            self.next - 1
        });
        self.of[value as usize] = slot;
        if self.left[value as usize] == 0 {
            self.free.push(slot);
        }
        slot
    }

    fn place(mut self, routine: &Routine, items: &[Item], order: Vec<Vec<usize>>, outputs: &[u32]) -> Packed {
        let mut runs = Vec::with_capacity(order.len());
        for group in order {
            let kind = items[group[0]].kind;
            let mut many = Vec::with_capacity(group.len());
            for i in group {
                let item = &items[i];
                let reads: Vec<u32> = item.reads.iter().map(|&value| self.read(value)).collect();
                let writes: Vec<u32> = item.writes.iter().map(|&value| self.write(value)).collect();
                match (kind, item.instruction) {
                    (Some(_), _) => many.push([writes[0], reads[0], reads.get(1).copied().unwrap_or(reads[0])]),
                    (None, Instruction::Solve { solve }) => {
                        let solve = solve as usize;
                        let block = &routine.solves[solve];
                        let reads = reads.into_iter().zip(read_by(block)).collect();
                        let finds = writes.into_iter().zip(block.unknowns.iter().copied()).collect();
                        runs.push(Run::Solve(Block { solve, reads, finds }));
                    }
                    (None, instruction) => runs.push(Run::One(moved(instruction, &reads, writes.first().copied()))),
                }
            }
            if let Some(kind) = kind {
                runs.push(Run::Many(kind, many));
            }
        }
        let outputs = outputs.iter().map(|&value| self.of[value as usize]).collect();
        Packed { runs, outputs, slots: self.next as usize }
    }
}
