//! Values to routines: what computes some of them, each value once, what is not needed left out.

use super::op::Op;
use super::values::Reads;
use super::{Block, BlockId, Program, SMALL, Value};
use crate::ids::{Id, id};
use crate::sparse::Pattern;
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::Arc;

id!(
    /// A value within a routine, numbered in the order in which they are defined.
    Local
);

/// What a step of a routine reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Arg {
    /// A value that stands before any routine runs: given ([`Op::is_given`]), or of parameters alone. In the preamble the
    /// latter stand as soon as they are computed.
    Given(Value),
    /// The result of an earlier step.
    Local(Local),
    /// In the code of a Newton block: what it reads from outside, an index into [`Method::Newton::outer`].
    Outer(u32),
    /// In the code of a Newton block: the guess of an unknown.
    Guess(u32),
}

/// A step of a routine.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// An operation on what earlier steps have found.
    Op {
        /// What it defines.
        out: Local,
        /// What it does; no given.
        op: Op<Arg>,
    },
    /// A parameter: its set value, or its default where none is set.
    Parameter {
        /// What it defines.
        out: Local,
        /// Which parameter.
        index: u32,
        /// Its default.
        default: Arg,
    },
    /// Stops if a divisor vanishes against its scale.
    Guard {
        /// Which divisor: index into [`Program::pivot_guards`].
        guard: u32,
        /// The divisor.
        pivot: Arg,
        /// Its scale.
        scale: Arg,
    },
    /// A solve block.
    Solve(Box<Solve>),
}

/// A solve block in a routine.
#[derive(Debug, Clone, PartialEq)]
pub struct Solve {
    /// The block.
    pub block: BlockId,
    /// Its unknowns, which it defines.
    pub unknowns: Vec<Local>,
    /// Where the matrix may differ from 0.
    pub pattern: Arc<Pattern>,
    /// How it is solved.
    pub method: Method,
}

/// How a solve block is solved, and what it reads.
#[derive(Debug, Clone, PartialEq)]
pub enum Method {
    /// By elimination.
    Linear {
        /// The block that has factored the same matrix, if there is one.
        shared: Option<BlockId>,
        /// The entries of the matrix; none where the factors of a large one are shared.
        matrix: Vec<Arg>,
        /// The right-hand side.
        right: Vec<Arg>,
    },
    /// By Newton.
    Newton {
        /// What varies outside and is read by `code`, in the order of the values; the same in every routine.
        outer: Vec<Arg>,
        /// Computes the residuals, then the entries of the Jacobian, at the guess; it holds no solve blocks.
        code: Code,
    },
}

/// Steps in order, and what is wanted of them.
///
/// Invariant (see [`verify`](Code::verify)): each local is defined by one step, in the order of the numbers, before any
/// step reads it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Code {
    /// The steps.
    pub steps: Vec<Step>,
    /// What is wanted.
    pub outputs: Vec<Arg>,
    /// For each local the value of the program that it is; none for an unknown that nothing reads.
    pub values: Vec<Option<Value>>,
}

/// What computes some values of a program.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Routine {
    /// The values.
    pub wanted: Vec<Value>,
    /// What computes them; its outputs are they.
    pub code: Code,
}

impl Solve {
    /// What it reads from outside.
    pub fn reads(&self) -> impl Iterator<Item = Arg> + '_ {
        let (first, second): (&[Arg], &[Arg]) = match &self.method {
            Method::Linear { matrix, right, .. } => (matrix, right),
            Method::Newton { outer, .. } => (outer, &[]),
        };
        first.iter().chain(second).copied()
    }
}

impl Step {
    /// Calls `visit` with all that it reads; of a Newton block what it reads from outside.
    pub fn for_each_read(&self, mut visit: impl FnMut(Arg)) {
        match self {
            Step::Op { op, .. } => op.for_each_operand(visit),
            Step::Parameter { default, .. } => visit(*default),
            Step::Guard { pivot, scale, .. } => [*pivot, *scale].into_iter().for_each(visit),
            Step::Solve(solve) => solve.reads().for_each(visit),
        }
    }

    /// What it defines.
    pub fn defines(&self) -> &[Local] {
        match self {
            Step::Op { out, .. } | Step::Parameter { out, .. } => std::slice::from_ref(out),
            Step::Guard { .. } => &[],
            Step::Solve(solve) => &solve.unknowns,
        }
    }
}

impl Code {
    /// Takes the next local, which is this value of the program.
    pub fn define(&mut self, value: Option<Value>) -> Local {
        self.values.push(value);
        Local::new(self.values.len() - 1)
    }

    /// Appends an operation.
    pub fn push(&mut self, op: Op<Arg>, value: Option<Value>) -> Arg {
        let out = self.define(value);
        self.steps.push(Step::Op { out, op });
        Arg::Local(out)
    }

    /// Its solve blocks.
    pub fn solves(&self) -> impl Iterator<Item = &Solve> {
        self.steps.iter().filter_map(|step| if let Step::Solve(solve) = step { Some(&**solve) } else { None })
    }
}

impl Program {
    /// The values of parameters alone that anything reads, or that are wanted besides; constants and parameters among
    /// them, in order.
    pub fn determined(&self, more: &[Value]) -> Vec<Value> {
        let live = self.live_anywhere(more);
        let is = |v: Value, op: Op| {
            matches!(op, Op::Parameter(_)) || live[v.index()] && self.values.reads(v) == Reads::PARAMETERS
        };
        self.values.iter().filter(|&(v, op)| is(v, op)).map(|(v, _)| v).collect()
    }

    /// The routine that computes all that reads parameters alone; divisors among it are guarded. `determined` is what
    /// [`determined`](Program::determined) gives.
    pub fn preamble(&self, determined: &[Value]) -> Routine {
        Builder::new(self, true).build(determined, &self.watches_of(true))
    }

    /// Blocks whose unknowns are positions with rates that have values, of those given.
    pub fn motion_blocks(&self, among: &[BlockId]) -> Vec<BlockId> {
        if self.positions.is_empty() {
            return Vec::new();
        }
        let moves = |id: &BlockId| {
            let with_rate = self.positions.iter().filter(|p| p.block == *id && p.rate.is_some());
            with_rate.count() == self.blocks[*id].size()
        };
        self.blocks.ids().filter(|id| among.contains(id)).filter(moves).collect()
    }

    /// The rates of the positions that blocks determine, block by block, in the order of their unknowns.
    pub fn rates_of_positions(&self, blocks: &[BlockId]) -> Vec<Value> {
        let of_block = |id: BlockId| {
            let mut own: Vec<_> = self.positions.iter().filter(|p| p.block == id).collect();
            own.sort_by_key(|p| p.unknown);
            own.into_iter().filter_map(|p| p.rate)
        };
        blocks.iter().flat_map(|&id| of_block(id)).collect()
    }

    /// An unknown of each of some blocks, of those that anything reads, in the order of [`Program::values`]: where these are
    /// computed the blocks are solved.
    pub fn unknowns_of(&self, blocks: &[BlockId]) -> Vec<Value> {
        let mut left: FxHashSet<BlockId> = blocks.iter().copied().collect();
        let mut is_first = |op: Op| if let Op::Solution(block, _) = op { left.remove(&block) } else { false };
        self.values.iter().filter(|(_, op)| is_first(*op)).map(|(value, _)| value).collect()
    }

    /// The routine that computes the wanted values, in the order of [`Program::values`].
    pub fn routine(&self, wanted: &[Value]) -> Routine {
        Builder::new(self, false).build(wanted, &[])
    }

    /// The same at the start of a run, where positions are unknowns like the states: they stand before the routine runs.
    pub fn start_routine(&self, wanted: &[Value]) -> Routine {
        let positions: Vec<Value> = self.positions.iter().map(|p| p.value).collect();
        self.routine_given(wanted, &positions, &[])
    }

    /// The same where more values stand before the routine runs, with some divisors guarded.
    pub(super) fn routine_given(&self, wanted: &[Value], given: &[Value], pivot_guards: &[u32]) -> Routine {
        let given = given.iter().copied().collect();
        Builder { given, ..Builder::new(self, false) }.build(wanted, pivot_guards)
    }

    /// The same, with all divisors guarded that vary.
    pub fn guarded_routine(&self, wanted: &[Value]) -> Routine {
        Builder::new(self, false).build(wanted, &self.watches_of(false))
    }

    /// The pivot guards of divisors that read parameters alone, or of the others.
    pub(super) fn watches_of(&self, parameters: bool) -> Vec<u32> {
        let fixed = |v: Value| self.values.reads(v) == Reads::PARAMETERS;
        let chosen =
            self.pivot_guards.iter().enumerate().filter(|(_, w)| (fixed(w.pivot) && fixed(w.scale)) == parameters);
        chosen.map(|(index, _)| index as u32).collect()
    }

    fn live_anywhere(&self, more: &[Value]) -> Vec<bool> {
        let wanted: Vec<Value> = self.wanted_anywhere().into_iter().chain(more.iter().copied()).collect();
        self.dataflow().live(&wanted, true)
    }

    /// All values that are read from outside.
    pub(super) fn wanted_anywhere(&self) -> Vec<Value> {
        let mut wanted: Vec<Value> = self.states.iter().map(|s| s.rate).collect();
        wanted.extend(self.observed.iter().filter_map(|o| o.value.clone().ok()));
        wanted.extend(self.start.iter().flat_map(|c| [c.residual, c.asked]));
        wanted.extend(self.guesses.iter().flat_map(|g| [g.residual, g.asked]));
        wanted.extend(self.held.iter().flat_map(|h| [h.source, h.time]));
        wanted.extend(self.clauses.iter().flat_map(|c| c.values()));
        wanted.extend(self.jumps.iter().flat_map(|j| j.values()));
        wanted.extend(self.momenta.values());
        wanted.extend(self.positions.iter().filter_map(|p| p.rate));
        wanted.extend(self.inputs.iter().map(|i| i.default));
        wanted.extend(self.parameters.iter().map(|p| p.default));
        wanted.extend(self.pivot_guards.iter().flat_map(|w| [w.pivot, w.scale]));
        wanted.extend(self.conditions.values().map(|c| c.operand));
        wanted.extend(self.assumptions.iter().flat_map(|a| [a.value, a.scale]));
        let asked = |d: &super::LawDomain| d.asked.as_ref().map(|a| a.1);
        wanted.extend(self.domains.iter().flat_map(|d| [Some(d.argument), asked(d), d.limit]).flatten());
        wanted
    }
}

/// Puts together a routine.
struct Builder<'a> {
    program: &'a Program,
    preamble: bool,
    /// More values that stand before the routine runs.
    given: FxHashSet<Value>,
    local: Locals,
    /// Blocks that are solved so far.
    solved: FxHashSet<BlockId>,
    code: Code,
    /// The Newton block that is open.
    inner: Inner,
}

/// The local of each value of a program that has one.
struct Locals(Vec<Option<Local>>);

impl Locals {
    fn of(program: &Program) -> Locals {
        Locals(vec![None; program.values.len()])
    }

    fn get(&self, value: Value) -> Option<Local> {
        self.0[value.index()]
    }

    fn insert(&mut self, value: Value, local: Local) {
        self.0[value.index()] = Some(local);
    }
}

/// The code of a Newton block while it is put together.
#[derive(Default)]
struct Inner {
    /// What varies outside and is read inside.
    outer: Vec<Value>,
    local: FxHashMap<Value, Local>,
    code: Code,
}

/// What is computed at a position.
#[derive(Clone, Copy)]
enum Item {
    Value(Value),
    Inner(Value),
    Open(BlockId),
    Close(BlockId),
    PivotGuard(u32),
}

impl<'a> Builder<'a> {
    fn new(program: &'a Program, preamble: bool) -> Self {
        let (local, code, inner) = (Locals::of(program), Code::default(), Inner::default());
        let (given, solved) = (FxHashSet::default(), FxHashSet::default());
        Builder { program, preamble, given, local, solved, code, inner }
    }

    fn build(mut self, wanted: &[Value], pivot_guards: &[u32]) -> Routine {
        let mut roots = wanted.to_vec();
        let guarded = |w: &u32| &self.program.pivot_guards[*w as usize];
        roots.extend(pivot_guards.iter().map(guarded).flat_map(|w| [w.pivot, w.scale]));
        if roots.is_empty() {
            return Routine { wanted: roots, code: self.code };
        }
        let live = self.program.dataflow().live_but_for(&roots, self.preamble, &self.given);
        self.order(&live, pivot_guards).into_iter().for_each(|item| self.emit(item));
        self.code.outputs = wanted.iter().map(|&v| self.arg(v)).collect();
        debug_assert_eq!(self.code.verify(), Ok(()), "{}", self.program.name);
        Routine { wanted: wanted.to_vec(), code: self.code }
    }

    /// Whether the value is there before the routine runs.
    fn is_fixed(&self, v: Value) -> bool {
        let op = self.program.values.op(v);
        match self.preamble {
            true => op.is_given() && !matches!(op, Op::Parameter(_)),
            false => op.is_given() || self.program.values.reads(v) == Reads::PARAMETERS || self.given.contains(&v),
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

    fn order(&self, live: &[bool], pivot_guards: &[u32]) -> Vec<Item> {
        let program = self.program;
        let sequence = self.sequence(live);
        let mut place = vec![0u32; program.values.len()];
        (0u32..).zip(&sequence).for_each(|(at, v)| place[v.index()] = at);
        let mut watch_after: FxHashMap<Value, Vec<u32>> = FxHashMap::default();
        let mut items = Vec::new();
        for &guard in pivot_guards {
            let w = &program.pivot_guards[guard as usize];
            let last = [w.pivot, w.scale].into_iter().filter(|&v| !self.is_fixed(v)).max_by_key(|v| place[v.index()]);
            match last {
                Some(last) => watch_after.entry(last).or_default().push(guard),
                None => items.push(Item::PivotGuard(guard)),
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
            items.extend(watch_after.get(&value).into_iter().flatten().copied().map(Item::PivotGuard));
        }
        items
    }

    fn emit(&mut self, item: Item) {
        match item {
            Item::Value(v) => self.value(v),
            Item::Inner(v) => {
                let op = self.program.values.op(v).map_operands(|o| self.inner_arg(o));
                let out = self.inner.code.define(Some(v));
                self.inner.code.steps.push(Step::Op { out, op });
                self.inner.local.insert(v, out);
            }
            Item::Open(block) => {
                let varies = |v: &Value| self.program.values.reads(*v) != Reads::PARAMETERS;
                let mut outer: Vec<Value> = self.outer_reads(block).into_iter().filter(varies).collect();
                outer.sort_unstable();
                outer.dedup();
                self.inner = Inner { outer, ..Inner::default() };
            }
            Item::Close(block) => self.close(block),
            Item::PivotGuard(guard) => {
                let w = &self.program.pivot_guards[guard as usize];
                let (pivot, scale) = (self.arg(w.pivot), self.arg(w.scale));
                self.code.steps.push(Step::Guard { guard, pivot, scale });
            }
        }
    }

    fn value(&mut self, v: Value) {
        let op = self.program.values.op(v);
        let step = match op {
            Op::Parameter(index) => {
                let default = self.arg(self.program.parameters[index as usize].default);
                Step::Parameter { out: self.code.define(Some(v)), index, default }
            }
            _ => {
                let op = op.map_operands(|o| self.arg(o));
                Step::Op { out: self.code.define(Some(v)), op }
            }
        };
        self.local.insert(v, step.defines()[0]);
        self.code.steps.push(step);
    }

    fn close(&mut self, block: BlockId) {
        let program = self.program;
        let of = |this: &Self, values: &[Value]| values.iter().map(|&v| this.arg(v)).collect::<Vec<Arg>>();
        let matrix = &program.blocks[block].matrix().values;
        let method = match &program.blocks[block] {
            Block::Linear { right, .. } => {
                // What was factored before the routine runs may have been factored otherwise since.
                let shared = program.factors_of(block).filter(|lender| self.solved.contains(lender));
                let right = of(self, right);
                // Whoever shares no factors, or differentiates, forms a small matrix again.
                let own = if shared.is_none() || matrix.size() <= SMALL { matrix.entries() } else { &[] };
                Method::Linear { shared, matrix: of(self, own), right }
            }
            Block::Newton { residuals, .. } => {
                let outputs = residuals.iter().chain(matrix.entries()).map(|&v| self.inner_arg(v)).collect();
                let Inner { outer, code, .. } = std::mem::take(&mut self.inner);
                let code = Code { outputs, ..code };
                Method::Newton { outer: of(self, &outer), code }
            }
        };
        let unknowns = (0..program.blocks[block].size()).map(|i| {
            let solution = program.values.find(Op::Solution(block, i as u32));
            let local = self.code.define(solution);
            if let Some(value) = solution {
                self.local.insert(value, local);
            }
            local
        });
        let unknowns = unknowns.collect();
        self.solved.insert(block);
        let pattern = Arc::clone(matrix.pattern());
        self.code.steps.push(Step::Solve(Box::new(Solve { block, unknowns, pattern, method })));
    }

    fn arg(&self, v: Value) -> Arg {
        self.local.get(v).map_or(Arg::Given(v), Arg::Local)
    }

    /// What stands in the code of the open block for a value.
    fn inner_arg(&self, v: Value) -> Arg {
        let varies = self.program.values.reads(v) != Reads::PARAMETERS;
        match self.program.values.op(v) {
            Op::Guess(_, i) => Arg::Guess(i),
            _ if !varies => Arg::Given(v),
            _ => match self.inner.local.get(&v) {
                Some(&local) => Arg::Local(local),
                None => {
                    let place = self.inner.outer.binary_search(&v);
                    Arg::Outer(place.expect("what varies and is read inside is known before") as u32)
                }
            },
        }
    }

    /// What stands outside a block and is read inside.
    fn outer_reads(&self, block: BlockId) -> Vec<Value> {
        let mut found = Vec::new();
        let mut seen = FxHashSet::default();
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
}
