//! Values to code: what is not needed left out, registers reused.

use super::values::{Op, Reads};
use super::{Block, BlockId, ConditionId, Program, Value};
use crate::algebra::Function;
use crate::ids::Id;
use rustc_hash::FxHashMap;

/// A place for one number.
pub type Register = u32;

/// One step of a routine. `out` is written, the others are read; `out` may be one of them.
#[allow(missing_docs)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Instruction {
    /// The parameter's set value, or `default` where none is set.
    Parameter {
        out: Register,
        index: u32,
        default: Register,
    },
    Neg {
        out: Register,
        a: Register,
    },
    Add {
        out: Register,
        a: Register,
        b: Register,
    },
    Sub {
        out: Register,
        a: Register,
        b: Register,
    },
    Mul {
        out: Register,
        a: Register,
        b: Register,
    },
    Div {
        out: Register,
        a: Register,
        b: Register,
    },
    Powi {
        out: Register,
        a: Register,
        n: u32,
    },
    Pow {
        out: Register,
        a: Register,
        b: Register,
    },
    Call {
        f: Function,
        out: Register,
        a: Register,
    },
    Call2 {
        f: Function,
        out: Register,
        a: Register,
        b: Register,
    },
    Positive {
        out: Register,
        a: Register,
    },
    Side {
        out: Register,
        a: Register,
        condition: ConditionId,
    },
    Floor {
        out: Register,
        a: Register,
        condition: ConditionId,
    },
    And {
        out: Register,
        a: Register,
        b: Register,
    },
    Or {
        out: Register,
        a: Register,
        b: Register,
    },
    Not {
        out: Register,
        a: Register,
    },
    Select {
        out: Register,
        c: Register,
        a: Register,
        b: Register,
    },
    Table {
        out: Register,
        a: Register,
        table: u32,
        piece: Option<ConditionId>,
    },
    TableSlope {
        out: Register,
        a: Register,
        table: u32,
        piece: Option<ConditionId>,
    },
    TableCurvature {
        out: Register,
        a: Register,
        table: u32,
        piece: Option<ConditionId>,
    },
    /// Stops if the pivot vanishes against its scale.
    Watch {
        pivot: Register,
        scale: Register,
        watch: u32,
    },
    /// A solve block: index into [`Routine::solves`].
    Solve {
        solve: u32,
    },
}

/// A solve block in a routine.
#[derive(Debug, Clone, PartialEq)]
pub struct Solve {
    /// The block.
    pub block: BlockId,
    /// The block that has factored the same matrix, if there is one.
    pub shared: Option<BlockId>,
    /// Where the unknowns are written.
    pub unknowns: Vec<Register>,
    /// Newton: where the guess is put before `code` runs; empty for a linear block.
    pub guess: Vec<Register>,
    /// Newton: what varies outside and is read by `code`, in the order of the values; the same in every routine.
    pub outer: Vec<Register>,
    /// Newton: computes right side and matrix at the guess; it holds no solve blocks.
    pub code: Vec<Instruction>,
    /// Matrix of a linear block, Jacobian of a Newton block, row by row.
    pub matrix: Vec<Register>,
    /// The places of the matrix that are not 0 whatever happens.
    pub entries: Vec<u32>,
    /// Right-hand side of a linear block, residuals of a Newton block.
    pub right: Vec<Register>,
}

/// Code that computes some values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Routine {
    /// The code.
    pub code: Vec<Instruction>,
    /// Its solve blocks.
    pub solves: Vec<Solve>,
    /// Where the wanted values stand when it has run.
    pub outputs: Vec<Register>,
    /// Number of registers it needs, fixed ones included.
    pub registers: u32,
}

/// Registers that keep their contents between routines: parameters, constants and what is computed from them; time,
/// inputs, held signals, conserved constants, states, each group in order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layout {
    /// The register of each value that has a fixed one.
    pub registers: FxHashMap<Value, Register>,
    /// Constants and their registers.
    pub constants: Vec<(Register, f64)>,
    /// First register of the parameters.
    pub parameters: Register,
    /// Register of time.
    pub time: Register,
    /// First register of the inputs.
    pub inputs: Register,
    /// First register of the held signals.
    pub held: Register,
    /// First register of the conserved constants.
    pub conserved: Register,
    /// First register of the states.
    pub states: Register,
    /// First register of their rates; there are some only in implicit form.
    pub rates: Register,
    /// Number of fixed registers.
    pub size: u32,
}

impl Program {
    /// The fixed registers.
    pub fn layout(&self) -> Layout {
        self.layout_with(&[])
    }

    /// The fixed registers where these values are wanted too.
    pub fn layout_with(&self, more: &[Value]) -> Layout {
        let mut layout = Layout { parameters: 0, ..Layout::default() };
        let mut next = self.parameters.len() as u32;
        let live = self.live_anywhere(more);
        for (value, op) in self.values.iter().filter(|(v, _)| live[v.index()]) {
            let computed = self.values.reads(value) == Reads::PARAMETERS && !matches!(op, Op::Parameter(_));
            if computed {
                layout.registers.insert(value, next);
                if let Op::Constant(bits) = op {
                    layout.constants.push((next, f64::from_bits(bits)));
                }
                next += 1;
            }
        }
        layout.time = next;
        layout.inputs = next + 1;
        layout.held = layout.inputs + self.inputs.len() as u32;
        layout.conserved = layout.held + self.held.len() as u32;
        layout.states = layout.conserved + self.conserved.len() as u32;
        layout.rates = layout.states + self.states.len() as u32;
        layout.size = layout.rates + if self.implicit.is_some() { self.states.len() as u32 } else { 0 };
        for (value, op) in self.values.iter() {
            let register = match op {
                Op::Parameter(i) => layout.parameters + i,
                Op::Time => layout.time,
                Op::Input(i) => layout.inputs + i,
                Op::Held(i) => layout.held + i,
                Op::Conserved(i) => layout.conserved + i,
                Op::State(i) => layout.states + i,
                Op::Rate(i) => layout.rates + i,
                _ => continue,
            };
            layout.registers.insert(value, register);
        }
        layout
    }

    /// The code that computes all that reads parameters alone, into its fixed registers; divisors among it are watched.
    pub fn preamble(&self, layout: &Layout) -> Routine {
        let mut wanted: Vec<Value> = layout.registers.keys().copied().collect();
        wanted.retain(|&v| self.values.reads(v) == Reads::PARAMETERS);
        wanted.sort_unstable();
        Builder::new(self, layout, true).build(&wanted, &self.watches_of(true))
    }

    /// The code that computes the wanted values from the fixed registers, in the order of [`Program::values`].
    pub fn routine(&self, layout: &Layout, wanted: &[Value]) -> Routine {
        Builder::new(self, layout, false).build(wanted, &[])
    }

    /// The same, with all divisors watched that vary.
    pub fn watched_routine(&self, layout: &Layout, wanted: &[Value]) -> Routine {
        Builder::new(self, layout, false).build(wanted, &self.watches_of(false))
    }

    /// The watches of divisors that read parameters alone, or of the others.
    fn watches_of(&self, parameters: bool) -> Vec<u32> {
        let fixed = |v: Value| self.values.reads(v) == Reads::PARAMETERS;
        let chosen = self.watches.iter().enumerate().filter(|(_, w)| (fixed(w.pivot) && fixed(w.scale)) == parameters);
        chosen.map(|(index, _)| index as u32).collect()
    }

    /// Marks what the wanted values read, themselves included; with what parameters alone determine if `deep`.
    pub(super) fn live(&self, wanted: &[Value], deep: bool) -> Vec<bool> {
        let mut live = vec![false; self.values.len()];
        wanted.iter().for_each(|v| live[v.index()] = true);
        for (value, op) in self.values.iter().rev() {
            if !live[value.index()] || (!deep && self.values.reads(value) == Reads::PARAMETERS) {
                continue;
            }
            match op {
                Op::Solution(block, _) => self.blocks[block].reads().for_each(|v| live[v.index()] = true),
                Op::Parameter(i) => live[self.parameters[i as usize].default.index()] = true,
                _ => op.for_each_operand(|v| live[v.index()] = true),
            }
        }
        live
    }

    fn live_anywhere(&self, more: &[Value]) -> Vec<bool> {
        let mut wanted: Vec<Value> = self.states.iter().map(|s| s.rate).chain(more.iter().copied()).collect();
        wanted.extend(self.observed.iter().filter_map(|o| o.value.clone().ok()));
        wanted.extend(self.start.iter().flat_map(|c| [c.residual, c.asked]));
        wanted.extend(self.guesses.iter().flat_map(|g| [g.residual, g.asked]));
        wanted.extend(self.held.iter().flat_map(|h| [h.source, h.time]));
        wanted.extend(self.momenta.values());
        wanted.extend(self.inputs.iter().map(|i| i.default));
        wanted.extend(self.parameters.iter().map(|p| p.default));
        wanted.extend(self.watches.iter().flat_map(|w| [w.pivot, w.scale]));
        wanted.extend(self.conditions.values().map(|c| c.operand));
        wanted.extend(self.assumptions.iter().flat_map(|a| [a.value, a.scale]));
        let asked = |d: &super::Domain| d.asked.as_ref().map(|a| a.1);
        wanted.extend(self.domains.iter().flat_map(|d| [Some(d.argument), asked(d), d.limit]).flatten());
        self.live(&wanted, true)
    }
}

const NONE: u32 = u32::MAX;

/// Values in the order in which they are computed, then given registers.
struct Builder<'a> {
    program: &'a Program,
    layout: &'a Layout,
    preamble: bool,
    register: Vec<u32>,
    /// Position after which a value is read no more.
    last_use: Vec<u32>,
    free: Vec<u32>,
    next: u32,
    routine: Routine,
}

/// What is computed at a position.
#[derive(Clone, Copy)]
enum Item {
    Value(Value),
    Inner(Value),
    Open(BlockId),
    Close(BlockId),
    Watch(u32),
}

impl<'a> Builder<'a> {
    fn new(program: &'a Program, layout: &'a Layout, preamble: bool) -> Self {
        let n = program.values.len();
        let mut register = vec![NONE; n];
        layout.registers.iter().for_each(|(v, &r)| register[v.index()] = r);
        Builder {
            program,
            layout,
            preamble,
            register,
            last_use: vec![0; n],
            free: Vec::new(),
            next: layout.size,
            routine: Routine::default(),
        }
    }

    fn build(mut self, wanted: &[Value], watches: &[u32]) -> Routine {
        let mut roots = wanted.to_vec();
        let watched = |w: &u32| &self.program.watches[*w as usize];
        roots.extend(watches.iter().map(watched).flat_map(|w| [w.pivot, w.scale]));
        let live = self.program.live(&roots, self.preamble);
        let items = self.order(&live, watches);
        self.find_last_uses(&items);
        wanted.iter().for_each(|v| self.last_use[v.index()] = u32::MAX);
        items.iter().enumerate().for_each(|(at, &item)| self.emit(at as u32, item, &live));
        self.routine.outputs = wanted.iter().map(|v| self.register[v.index()]).collect();
        self.routine.registers = self.next;
        self.routine
    }

    /// Whether the value is there before the routine runs.
    fn is_fixed(&self, v: Value) -> bool {
        let op = self.program.values.op(v);
        match self.preamble {
            true => op.is_given() && !matches!(op, Op::Parameter(_)),
            false => op.is_given() || self.program.values.reads(v) == Reads::PARAMETERS,
        }
    }

    /// The values in the order in which they are computed: their own, but if there are several Newton blocks, these as
    /// soon as all that they read is there, one after the other.
    fn sequence(&self, live: &[bool]) -> Vec<Value> {
        let program = self.program;
        let wanted = |v: &Value| live[v.index()] && !self.is_fixed(*v);
        let mut all: Vec<Value> = program.values.iter().map(|(v, _)| v).filter(wanted).collect();
        let newton = |v: &Value| match program.values.op(*v) {
            Op::Solution(block, _) => matches!(program.blocks[block], Block::Newton { .. }).then_some(block),
            _ => None,
        };
        let mut blocks = all.iter().filter_map(newton);
        let first = blocks.next();
        if blocks.all(|block| Some(block) == first) {
            return all;
        }
        // How many blocks stand behind one another before a value.
        let mut depth = vec![0u32; program.values.len()];
        let mut depth_of_block: FxHashMap<BlockId, u32> = FxHashMap::default();
        for (v, op) in program.values.iter() {
            depth[v.index()] = match op {
                Op::Solution(block, _) => *depth_of_block
                    .entry(block)
                    .or_insert_with(|| 1 + program.blocks[block].reads().map(|r| depth[r.index()]).max().unwrap_or(0)),
                _ => {
                    let mut most = 0;
                    op.for_each_operand(|o| most = most.max(depth[o.index()]));
                    most
                }
            };
        }
        let solution = |v: Value| matches!(program.values.op(v), Op::Solution(..));
        all.sort_by_key(|&v| (depth[v.index()], !solution(v), v));
        all
    }

    fn order(&self, live: &[bool], watches: &[u32]) -> Vec<Item> {
        let program = self.program;
        let sequence = self.sequence(live);
        let mut place = vec![0u32; program.values.len()];
        (0u32..).zip(&sequence).for_each(|(at, v)| place[v.index()] = at);
        let mut watch_after: FxHashMap<Value, Vec<u32>> = FxHashMap::default();
        let mut items = Vec::new();
        for &watch in watches {
            let w = &program.watches[watch as usize];
            let last = [w.pivot, w.scale].into_iter().filter(|&v| !self.is_fixed(v)).max_by_key(|v| place[v.index()]);
            match last {
                Some(last) => watch_after.entry(last).or_default().push(watch),
                None => items.push(Item::Watch(watch)),
            }
        }
        let mut inner: FxHashMap<BlockId, Vec<Value>> = FxHashMap::default();
        let mut owner: FxHashMap<Value, BlockId> = FxHashMap::default();
        let mut closed = vec![false; program.blocks.len()];
        for value in sequence {
            let op = program.values.op(value);
            match op {
                Op::Guess(block, _) => {
                    owner.insert(value, block);
                }
                Op::Solution(block, _) => {
                    if !std::mem::replace(&mut closed[block.index()], true) {
                        items.push(Item::Open(block));
                        items.extend(inner.remove(&block).unwrap_or_default().into_iter().map(Item::Inner));
                        items.push(Item::Close(block));
                    }
                }
                _ if program.values.reads(value).includes(Reads::GUESS) => {
                    let mut block = None;
                    op.for_each_operand(|v| block = block.or(owner.get(&v).copied()));
                    let block = block.expect("what reads a guess belongs to its block");
                    owner.insert(value, block);
                    inner.entry(block).or_default().push(value);
                }
                _ => items.push(Item::Value(value)),
            }
            items.extend(watch_after.remove(&value).unwrap_or_default().into_iter().map(Item::Watch));
        }
        items
    }

    fn find_last_uses(&mut self, items: &[Item]) {
        let program = self.program;
        let mut close_at = vec![0; program.blocks.len()];
        let mut open = None;
        for (at, item) in items.iter().enumerate() {
            match item {
                Item::Open(block) => open = Some(*block),
                Item::Close(block) => {
                    close_at[block.index()] = at as u32;
                    open = None;
                    program.blocks[*block].reads().for_each(|v| self.last_use[v.index()] = at as u32);
                }
                _ => {}
            }
            debug_assert!(open.is_none() || matches!(item, Item::Open(_) | Item::Inner(_)));
        }
        let mut block = None;
        for (at, item) in items.iter().enumerate() {
            let mut used = |v: Value, at: u32| self.last_use[v.index()] = self.last_use[v.index()].max(at);
            match *item {
                Item::Open(b) => block = Some(b),
                Item::Close(_) => block = None,
                Item::Value(v) => program.values.op(v).for_each_operand(|v| used(v, at as u32)),
                Item::Inner(v) => {
                    let close = block.map_or(at as u32, |b| close_at[b.index()]);
                    // What stands outside the block is read in every iteration.
                    program.values.op(v).for_each_operand(|v| {
                        let inside = program.values.reads(v).includes(Reads::GUESS);
                        used(v, if inside { at as u32 } else { close });
                    });
                }
                Item::Watch(w) => {
                    let w = &program.watches[w as usize];
                    used(w.pivot, at as u32);
                    used(w.scale, at as u32);
                }
            }
        }
    }

    fn emit(&mut self, at: u32, item: Item, live: &[bool]) {
        match item {
            Item::Value(v) => {
                let op = self.program.values.op(v);
                let instruction = self.instruction(v, op, at);
                self.routine.code.push(instruction);
            }
            Item::Inner(v) => {
                let op = self.program.values.op(v);
                let instruction = self.instruction(v, op, at);
                let solve = self.routine.solves.last_mut().expect("inner code stands in an open block");
                solve.code.push(instruction);
            }
            Item::Open(block) => self.open(block),
            Item::Close(block) => self.close(block, at, live),
            Item::Watch(watch) => {
                let w = &self.program.watches[watch as usize];
                let (pivot, scale) = (self.register[w.pivot.index()], self.register[w.scale.index()]);
                self.routine.code.push(Instruction::Watch { pivot, scale, watch });
                [w.pivot, w.scale].into_iter().for_each(|v| self.release(v, at));
            }
        }
    }

    fn open(&mut self, block: BlockId) {
        let newton = matches!(self.program.blocks[block], Block::Newton { .. });
        let size = if newton { self.program.blocks[block].size() } else { 0 };
        let guess: Vec<Register> = (0..size).map(|_| self.take()).collect();
        for (i, &register) in guess.iter().enumerate() {
            if let Some(v) = self.program.values.find(Op::Guess(block, i as u32)) {
                self.register[v.index()] = register;
                self.last_use[v.index()] = NONE; // until the block is closed
            }
        }
        let (unknowns, code) = (Vec::new(), Vec::new());
        let (matrix, right, outer) = (Vec::new(), Vec::new(), Vec::new());
        let shared = self.program.shared(block);
        self.routine.solves.push(Solve {
            block,
            shared,
            unknowns,
            guess,
            outer,
            code,
            matrix,
            entries: Vec::new(),
            right,
        });
    }

    fn close(&mut self, block: BlockId, at: u32, live: &[bool]) {
        let (matrix, right) = match &self.program.blocks[block] {
            Block::Linear { matrix, right, .. } => (matrix, right),
            Block::Newton { jacobian, residuals, .. } => (jacobian, residuals),
        };
        let of = |values: &[Value]| values.iter().map(|v| self.register[v.index()]).collect::<Vec<_>>();
        let (matrix_registers, right_registers) = (of(matrix), of(right));
        let newton = matches!(self.program.blocks[block], Block::Newton { .. });
        let mut outer = if newton { self.outer_reads(block) } else { Vec::new() };
        outer.sort_unstable();
        outer.dedup();
        let varies = |v: &&Value| self.program.values.reads(**v) != Reads::PARAMETERS;
        let outer: Vec<Register> = outer.iter().filter(varies).map(|v| self.register[v.index()]).collect();
        let mut dead = Vec::new();
        let mut unknowns = Vec::new();
        for i in 0..right.len() {
            let solution = self.program.values.find(Op::Solution(block, i as u32));
            let fixed = solution.map(|v| self.register[v.index()]).filter(|&r| r < self.layout.size);
            let register = fixed.unwrap_or_else(|| self.take());
            unknowns.push(register);
            match solution {
                Some(v) if live[v.index()] => self.register[v.index()] = register,
                _ if fixed.is_none() => dead.push(register),
                _ => {}
            }
        }
        let solve = self.routine.solves.last_mut().expect("a block is open");
        let entries = (0u32..).zip(matrix).filter(|(_, v)| self.program.values.constant(**v) != Some(0.0));
        solve.entries = entries.map(|(place, _)| place).collect();
        (solve.matrix, solve.right, solve.unknowns) = (matrix_registers, right_registers, unknowns);
        solve.outer = outer;
        self.free.extend(&solve.guess);
        self.free.extend(dead);
        let index = self.routine.solves.len() as u32 - 1;
        self.routine.code.push(Instruction::Solve { solve: index });
        let mut reads: Vec<Value> = self.program.blocks[block].reads().collect();
        reads.extend(self.outer_reads(block));
        reads.sort_unstable();
        reads.dedup();
        reads.into_iter().for_each(|v| self.release(v, at));
    }

    /// What stands outside a block and is read inside: those whose last use is its end. Found from its code's values.
    fn outer_reads(&self, block: BlockId) -> Vec<Value> {
        let mut found = Vec::new();
        let mut seen = rustc_hash::FxHashSet::default();
        let mut open: Vec<Value> = self.program.blocks[block].reads().collect();
        while let Some(v) = open.pop() {
            if !self.program.values.reads(v).includes(Reads::GUESS) {
                found.push(v);
            } else if seen.insert(v) {
                self.program.values.op(v).for_each_operand(|v| open.push(v));
            }
        }
        found
    }

    fn take(&mut self) -> Register {
        self.free.pop().unwrap_or_else(|| {
            self.next += 1;
            self.next - 1
        })
    }

    /// Frees the register of a value that is read for the last time here.
    fn release(&mut self, v: Value, at: u32) {
        let register = self.register[v.index()];
        if self.last_use[v.index()] == at && register != NONE && register >= self.layout.size {
            self.free.push(register);
            self.last_use[v.index()] = NONE;
        }
    }

    fn instruction(&mut self, value: Value, op: Op, at: u32) -> Instruction {
        let r = |v: Value| self.register[v.index()];
        let mut operands = [NONE; 3];
        let mut n = 0;
        op.for_each_operand(|v| {
            operands[n] = r(v);
            n += 1;
        });
        let [a, b, c] = operands;
        op.for_each_operand(|v| self.release(v, at));
        let out = match self.register[value.index()] {
            NONE => self.take(),
            fixed => fixed,
        };
        self.register[value.index()] = out;
        if self.last_use[value.index()] == 0 && out >= self.layout.size {
            self.free.push(out); // nobody reads it
        }
        match op {
            Op::Parameter(index) => {
                let default = self.register[self.program.parameters[index as usize].default.index()];
                Instruction::Parameter { out, index, default }
            }
            Op::Neg(_) => Instruction::Neg { out, a },
            Op::Add(..) => Instruction::Add { out, a, b },
            Op::Sub(..) => Instruction::Sub { out, a, b },
            Op::Mul(..) => Instruction::Mul { out, a, b },
            Op::Div(..) => Instruction::Div { out, a, b },
            Op::Powi(_, n) => Instruction::Powi { out, a, n },
            Op::Pow(..) => Instruction::Pow { out, a, b },
            Op::Call(f, _) => Instruction::Call { f, out, a },
            Op::Call2(f, ..) => Instruction::Call2 { f, out, a, b },
            Op::Positive(_) => Instruction::Positive { out, a },
            Op::Side(condition, _) => Instruction::Side { out, a, condition },
            Op::Floor(condition, _) => Instruction::Floor { out, a, condition },
            Op::And(..) => Instruction::And { out, a, b },
            Op::Or(..) => Instruction::Or { out, a, b },
            Op::Not(_) => Instruction::Not { out, a },
            Op::Select(..) => Instruction::Select { out, c: a, a: b, b: c },
            Op::Table(table, piece, _) => Instruction::Table { out, a, table, piece },
            Op::TableSlope(table, piece, _) => Instruction::TableSlope { out, a, table, piece },
            Op::TableCurvature(table, piece, _) => Instruction::TableCurvature { out, a, table, piece },
            Op::Constant(_) | Op::Time | Op::Input(_) | Op::Held(_) | Op::Conserved(_) | Op::State(_) | Op::Rate(_) => {
                unreachable!("given before the routine runs")
            }
            Op::Guess(..) | Op::Solution(..) => unreachable!("written by its block"),
        }
    }
}
