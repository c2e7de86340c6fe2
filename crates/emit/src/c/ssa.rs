//! Routines as steps on values that are written once.

use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::program::{
    Block, BlockId, ConditionId, Instruction, Layout, Program, Register, Routine, Solve,
};
use rustc_hash::FxHashMap;

/// What a step reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Arg {
    /// A fixed register.
    Fixed(Register),
    /// The result of a step.
    Local(u32),
    /// What a Newton block reads from outside.
    Outer(u32),
    /// The guess of a Newton block.
    Guess(u32),
}

/// What a step does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Act {
    Neg,
    Add,
    Sub,
    Mul,
    Div,
    Powi(u32),
    Pow,
    Call(Function),
    Call2(Function),
    Positive,
    Side(ConditionId),
    Floor(ConditionId),
    And,
    Or,
    Not,
    Select,
    /// On the held piece if there is a condition.
    Table(u32, Option<ConditionId>),
    TableSlope(u32, Option<ConditionId>),
    TableCurvature(u32, Option<ConditionId>),
    /// The set value of a parameter, or what the step reads.
    Parameter(u32),
    Watch(u32),
    /// Reads the matrix, then the right side.
    Linear(BlockId),
    /// Reads what stands outside.
    Newton(BlockId),
}

/// A step.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pub act: Act,
    pub args: Vec<Arg>,
    pub outs: Vec<u32>,
}

/// Steps in order, and the values wanted.
#[derive(Debug, Clone, Default)]
pub(super) struct Code {
    pub steps: Vec<Step>,
    pub outputs: Vec<Arg>,
    /// The fixed registers written, with their values: the preamble.
    pub fixed: Vec<(Register, Arg)>,
    pub locals: u32,
}

/// The code of Newton blocks: residuals, then the Jacobian row by row.
pub(super) type Inner = FxHashMap<BlockId, Code>;

/// The code of a Newton block that computes of what its first `n` outputs are the sums, in magnitude.
pub(super) fn terms_of(code: &Code, n: usize) -> Code {
    let (steps, locals, outputs) = (Vec::with_capacity(2 * code.steps.len()), code.locals, Vec::new());
    let mut terms = Terms { code: Code { steps, outputs, fixed: Vec::new(), locals }, of: FxHashMap::default() };
    for step in &code.steps {
        terms.code.steps.push(step.clone());
        let [a, b] = [0, 1].map(|i| step.args.get(i).copied());
        let (Some(a), [out]) = (a, &step.outs[..]) else { continue };
        let sum = match (step.act, b) {
            (Act::Neg, _) => terms.of(a),
            (Act::Add | Act::Sub, Some(b)) => terms.both(Act::Add, a, b),
            (Act::Mul, Some(b)) => terms.both(Act::Mul, a, b),
            (Act::Div, Some(b)) => {
                let (over, under) = (terms.of(a), terms.step(Act::Call(Function::Abs), vec![b]));
                terms.step(Act::Div, vec![over, under])
            }
            _ => continue,
        };
        terms.of.insert(Arg::Local(*out), sum);
    }
    let outputs = code.outputs[..n].iter().map(|&a| terms.of(a)).collect();
    terms.code.outputs = outputs;
    terms.code.without_the_unread()
}

struct Terms {
    code: Code,
    /// What values are the sums of.
    of: FxHashMap<Arg, Arg>,
}

impl Terms {
    fn step(&mut self, act: Act, args: Vec<Arg>) -> Arg {
        let local = self.code.locals;
        self.code.locals += 1;
        self.code.steps.push(Step { act, args, outs: vec![local] });
        Arg::Local(local)
    }

    fn of(&mut self, a: Arg) -> Arg {
        if let Some(&known) = self.of.get(&a) {
            return known;
        }
        let size = self.step(Act::Call(Function::Abs), vec![a]);
        self.of.insert(a, size);
        size
    }

    fn both(&mut self, act: Act, a: Arg, b: Arg) -> Arg {
        let args = vec![self.of(a), self.of(b)];
        self.step(act, args)
    }
}

/// The steps of a routine; the code of its Newton blocks is added to `inner`.
pub(super) fn of_routine(program: &Program, layout: &Layout, routine: &Routine, inner: &mut Inner) -> Code {
    let mut reader = Reader { layout, env: FxHashMap::default(), code: Code::default() };
    for instruction in &routine.code {
        match *instruction {
            Instruction::Solve { solve } => reader.solve(program, &routine.solves[solve as usize], inner),
            ref plain => reader.plain(plain),
        }
    }
    reader.code.outputs = routine.outputs.iter().map(|&r| reader.read(r)).collect();
    let mut fixed: Vec<(Register, Arg)> =
        reader.env.iter().filter(|(r, _)| **r < layout.size).map(|(&r, &a)| (r, a)).collect();
    fixed.sort_unstable_by_key(|(r, _)| *r);
    reader.code.fixed = fixed;
    reader.code.without_the_unread()
}

struct Reader<'a> {
    layout: &'a Layout,
    env: FxHashMap<Register, Arg>,
    code: Code,
}

impl Reader<'_> {
    fn read(&self, r: Register) -> Arg {
        self.env.get(&r).copied().unwrap_or(Arg::Fixed(r))
    }

    fn write(&mut self, r: Register) -> u32 {
        let local = self.code.locals;
        self.code.locals += 1;
        self.env.insert(r, Arg::Local(local));
        local
    }

    fn step(&mut self, act: Act, reads: &[Register], outs: &[Register]) {
        let args = reads.iter().map(|&r| self.read(r)).collect();
        let outs = outs.iter().map(|&r| self.write(r)).collect();
        self.code.steps.push(Step { act, args, outs });
    }

    fn plain(&mut self, instruction: &Instruction) {
        use Instruction::*;
        match *instruction {
            Parameter { out, index, default } => self.step(Act::Parameter(index), &[default], &[out]),
            Neg { out, a } => self.step(Act::Neg, &[a], &[out]),
            Add { out, a, b } => self.step(Act::Add, &[a, b], &[out]),
            Sub { out, a, b } => self.step(Act::Sub, &[a, b], &[out]),
            Mul { out, a, b } => self.step(Act::Mul, &[a, b], &[out]),
            Div { out, a, b } => self.step(Act::Div, &[a, b], &[out]),
            Powi { out, a, n } => self.step(Act::Powi(n), &[a], &[out]),
            Pow { out, a, b } => self.step(Act::Pow, &[a, b], &[out]),
            Call { f, out, a } => self.step(Act::Call(f), &[a], &[out]),
            Call2 { f, out, a, b } => self.step(Act::Call2(f), &[a, b], &[out]),
            Positive { out, a } => self.step(Act::Positive, &[a], &[out]),
            Side { out, a, condition } => self.step(Act::Side(condition), &[a], &[out]),
            Floor { out, a, condition } => self.step(Act::Floor(condition), &[a], &[out]),
            And { out, a, b } => self.step(Act::And, &[a, b], &[out]),
            Or { out, a, b } => self.step(Act::Or, &[a, b], &[out]),
            Not { out, a } => self.step(Act::Not, &[a], &[out]),
            Select { out, c, a, b } => self.step(Act::Select, &[c, a, b], &[out]),
            Table { out, a, table, piece } => self.step(Act::Table(table, piece), &[a], &[out]),
            TableSlope { out, a, table, piece } => self.step(Act::TableSlope(table, piece), &[a], &[out]),
            TableCurvature { out, a, table, piece } => self.step(Act::TableCurvature(table, piece), &[a], &[out]),
            Watch { pivot, scale, watch } => self.step(Act::Watch(watch), &[pivot, scale], &[]),
            Solve { .. } => unreachable!("a solve block is no plain instruction"),
        }
    }

    fn solve(&mut self, program: &Program, solve: &Solve, inner: &mut Inner) {
        match program.blocks[solve.block] {
            Block::Linear { .. } => {
                let reads: Vec<Register> = solve.matrix.iter().chain(&solve.right).copied().collect();
                self.step(Act::Linear(solve.block), &reads, &solve.unknowns);
            }
            Block::Newton { .. } => {
                inner.entry(solve.block).or_insert_with(|| self.inside(solve));
                self.step(Act::Newton(solve.block), &solve.outer, &solve.unknowns);
            }
        }
    }

    /// What a Newton block evaluates.
    fn inside(&self, solve: &Solve) -> Code {
        let outer = solve.outer.iter().enumerate().map(|(i, &r)| (r, Arg::Outer(i as u32)));
        let guess = solve.guess.iter().enumerate().map(|(i, &r)| (r, Arg::Guess(i as u32)));
        let mut reader = Reader { layout: self.layout, env: outer.chain(guess).collect(), code: Code::default() };
        solve.code.iter().for_each(|instruction| reader.plain(instruction));
        reader.code.outputs = solve.right.iter().chain(&solve.matrix).map(|&r| reader.read(r)).collect();
        debug_assert!(reader.code.outputs.iter().all(|a| !matches!(a, Arg::Fixed(r) if *r >= self.layout.size)));
        reader.code.without_the_unread()
    }
}

impl Code {
    /// Without steps that nothing reads and that cannot fail.
    pub fn without_the_unread(mut self) -> Code {
        let mut read = vec![false; self.locals as usize];
        let mut mark = |a: &Arg| {
            if let Arg::Local(i) = a {
                read[*i as usize] = true;
            }
        };
        self.outputs.iter().for_each(&mut mark);
        self.fixed.iter().for_each(|(_, a)| mark(a));
        let mut kept = Vec::with_capacity(self.steps.len());
        for step in self.steps.into_iter().rev() {
            let stays = matches!(step.act, Act::Watch(_) | Act::Linear(_) | Act::Newton(_));
            if stays || step.outs.iter().any(|&out| read[out as usize]) {
                step.args.iter().for_each(|a| {
                    if let Arg::Local(i) = a {
                        read[*i as usize] = true;
                    }
                });
                kept.push(step);
            }
        }
        kept.reverse();
        self.steps = kept;
        self
    }

    /// Whether each local is read by a step or wanted.
    pub fn read(&self) -> Vec<bool> {
        let mut read = vec![false; self.locals as usize];
        let wanted = self.outputs.iter().chain(self.fixed.iter().map(|(_, a)| a));
        for a in self.steps.iter().flat_map(|s| &s.args).chain(wanted) {
            if let Arg::Local(i) = a {
                read[*i as usize] = true;
            }
        }
        read
    }
}
