//! A routine for SIMD batches: its instructions in another order, so that many of one kind stand together.
//!
//! To dispatch an instruction takes longer than to execute it. Every value keeps the operation it comes from, hence
//! its bits; only the order of what does not read each other changes.

use super::instruction::{Operation, Register, Routine, Solve};
use super::registers::Layout;
use halfarrow_compiler::program::{Arg, BlockId, Code, Method, Op, Step};
use std::collections::BTreeMap;

/// Operations that are packed together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Arithmetic {
    Add,
    Sub,
    Mul,
    Div,
    Neg,
}

/// A step of the packed routine.
#[derive(Debug, Clone)]
pub(crate) enum PackedStep {
    /// Operations of one kind: result and operands, in their slots.
    Many(Arithmetic, Vec<[u32; 3]>),
    /// Any other operation, on slots.
    One(Operation),
    /// A divisor that must not vanish against its scale.
    Guard { pivot: u32, scale: u32 },
    /// A solve block.
    Solve(PackedSolve),
}

/// A solve block, which works on the registers of a frame.
#[derive(Debug, Clone)]
pub(crate) struct PackedSolve {
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
    pub runs: Vec<PackedStep>,
    /// Slots of what is wanted.
    pub outputs: Vec<u32>,
    /// Slots in all; those of fixed registers are their registers.
    pub slots: usize,
}

/// A step with the numbers of what it reads and defines: fixed slots first, then the locals of the code.
struct PackedItem<'a> {
    kind: Option<Arithmetic>,
    step: &'a Step,
    reads: Vec<u32>,
    writes: Vec<u32>,
}

impl Packed {
    /// The routine in packed order; registers below `fixed` are given.
    pub fn new(layout: &Layout, routine: &Routine) -> Packed {
        let slot = |a: Arg| match a {
            Arg::Given(value) => layout.registers[value],
            Arg::Local(local) => layout.size + local.0,
            Arg::Outer(_) | Arg::Guess(_) => unreachable!("no code of a Newton block"),
        };
        Packed::of(&routine.source, layout.size, &routine.solves, slot)
    }

    /// Code in packed order. `slot` is where it finds what it reads: below `fixed`, or a local that far above.
    pub fn of(code: &Code, fixed: u32, solves: &[Solve], slot: impl Fn(Arg) -> u32) -> Packed {
        let item = |step| PackedItem::of(step, fixed, &slot);
        let mut items: Vec<PackedItem> = code.steps.iter().map(item).collect();
        after_factors(&mut items);
        let outputs: Vec<u32> = code.outputs.iter().map(|&a| slot(a)).collect();
        let values = fixed + code.values.len() as u32;
        let order = packed_order(&items, values);
        Slots::new(fixed, values, &items, &order, &outputs).place(solves, &items, order, &outputs)
    }
}

impl PackedItem<'_> {
    fn of<'s>(step: &'s Step, fixed: u32, slot: &impl Fn(Arg) -> u32) -> PackedItem<'s> {
        let kind = match step {
            Step::Op { op: Op::Add(..), .. } => Some(Arithmetic::Add),
            Step::Op { op: Op::Sub(..), .. } => Some(Arithmetic::Sub),
            Step::Op { op: Op::Mul(..), .. } => Some(Arithmetic::Mul),
            Step::Op { op: Op::Div(..), .. } => Some(Arithmetic::Div),
            Step::Op { op: Op::Neg(..), .. } => Some(Arithmetic::Neg),
            _ => None,
        };
        let mut reads = Vec::new();
        step.for_each_read(|a| reads.push(slot(a)));
        PackedItem { kind, step, reads, writes: step.defines().iter().map(|out| fixed + out.0).collect() }
    }
}

/// Blocks that share factors come after the one that makes them, as if they read what that one finds.
fn after_factors(items: &mut [PackedItem]) {
    let mut found: BTreeMap<BlockId, u32> = BTreeMap::new();
    for item in items {
        let Step::Solve(solve) = item.step else { continue };
        if let Method::Linear { shared: Some(of), .. } = solve.method {
            item.reads.push(found[&of]);
        }
        found.insert(solve.block, item.writes[0]);
    }
}

/// Where a solve block of the frame has what it reads from outside, in the order of [`program::Solve::reads`].
fn read_by(solve: &Solve) -> impl Iterator<Item = Register> + '_ {
    let linear = solve.guess.is_empty();
    let (matrix, right) = if linear { (&solve.matrix[..], &solve.right[..]) } else { (&[][..], &[][..]) };
    solve.outer.iter().chain(matrix).chain(right).copied()
}

/// List scheduling: all that is ready of the kind of which most is, again and again.
fn packed_order(items: &[PackedItem], values: u32) -> Vec<Vec<usize>> {
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
    let mut ready: BTreeMap<Option<Arithmetic>, Vec<usize>> = BTreeMap::new();
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
    fn new(fixed: u32, values: u32, items: &[PackedItem], order: &[Vec<usize>], outputs: &[u32]) -> Slots {
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

    fn place(mut self, solves: &[Solve], items: &[PackedItem], order: Vec<Vec<usize>>, outputs: &[u32]) -> Packed {
        let number_of: BTreeMap<u32, usize> = solves.iter().enumerate().map(|(i, s)| (s.block.0, i)).collect();
        let mut runs = Vec::with_capacity(order.len());
        for group in order {
            let kind = items[group[0]].kind;
            let mut many = Vec::with_capacity(group.len());
            for i in group {
                let item = &items[i];
                let reads: Vec<u32> = item.reads.iter().map(|&value| self.read(value)).collect();
                let writes: Vec<u32> = item.writes.iter().map(|&value| self.write(value)).collect();
                match (kind, item.step) {
                    (Some(_), _) => many.push([writes[0], reads[0], reads.get(1).copied().unwrap_or(reads[0])]),
                    (None, Step::Op { op, .. }) => {
                        let mut reads = reads.into_iter();
                        let op = op.map_operands(|_| reads.next().expect("as many slots as operands"));
                        runs.push(PackedStep::One(Operation { out: writes[0], op }));
                    }
                    (None, Step::Guard { .. }) => {
                        runs.push(PackedStep::Guard { pivot: reads[0], scale: reads[1] });
                    }
                    (None, Step::Solve(solve)) => {
                        let solve = number_of[&solve.block.0];
                        let block = &solves[solve];
                        let reads = reads.into_iter().zip(read_by(block)).collect();
                        let finds = writes.into_iter().zip(block.unknowns.iter().copied()).collect();
                        runs.push(PackedStep::Solve(PackedSolve { solve, reads, finds }));
                    }
                    (None, Step::Parameter { .. }) => unreachable!("parameters are set lane by lane"),
                }
            }
            if let Some(kind) = kind {
                runs.push(PackedStep::Many(kind, many));
            }
        }
        let outputs = outputs.iter().map(|&value| self.of[value as usize]).collect();
        Packed { runs, outputs, slots: self.next as usize }
    }
}
