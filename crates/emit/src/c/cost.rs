//! What a step costs at most, counted in the code that was written.

use std::ops::{Add, Mul};

use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::program::{self, Arg, Block, BlockId, Code, Method, Op, Program, Solve, Step};

use super::patterns::FULL_AT_MOST;
use super::plan::Plan;

/// Jumps within one step at most; more of them are an error.
const MOST_JUMPS: u64 = 64;
/// The same where events follow each other as fast as impacts do that accumulate.
pub(super) const MOST_EVENTS: u64 = 256;
/// Steps at most in which a crossing is located: the whole one, its parts, halvings of one of them, and the way to the crossing.
const LOOKS: u64 = 86;
/// Of each event indicator the looks where it turns round within a step.
const TURNS: u64 = 3;
/// Rounds of what happens at one instant at most.
const MOST_ROUNDS: u64 = 200;
/// Evaluations of a Newton block at most while a solution is followed, the looks at its end counted.
const EVALUATIONS: u64 = 2_000 + 400;
/// The same at the start and at jumps: attempts from eight points, and a search over all magnitudes.
const EVALUATIONS_AT_JUMPS: u64 = 20_000 + 400;

/// What a function does.
#[derive(Debug, Clone, Default)]
pub(super) struct OperationCount {
    /// Additions, products, comparisons.
    pub operations: u64,
    /// Divisions and square roots.
    pub divisions: u64,
    /// Elementary functions.
    pub calls: u64,
    /// Linear solve blocks.
    pub solves: u64,
    /// Newton blocks: how often each is solved, and what one evaluation of it costs.
    pub newton: Vec<(BlockId, u64, u64)>,
}

impl OperationCount {
    /// What code does.
    pub fn of(program: &Program, code: &Code) -> OperationCount {
        let mut work = OperationCount::default();
        code.steps.iter().for_each(|step| work.step(program, step));
        work
    }

    /// What a step does.
    pub fn of_step(program: &Program, step: &Step) -> OperationCount {
        let mut work = OperationCount::default();
        work.step(program, step);
        work
    }

    fn step(&mut self, program: &Program, step: &Step) {
        match step {
            Step::Op { op, .. } => self.count(*op),
            Step::Parameter { .. } | Step::Guard { .. } => self.operations += 1,
            Step::Solve(solve) => self.solve(program, solve),
        }
    }

    /// Operations of all kinds, without those of Newton blocks.
    pub fn own(&self) -> u64 {
        self.operations + self.divisions + self.calls
    }

    fn count(&mut self, op: Op<Arg>) {
        match (op.cost(), op) {
            (_, Op::Call(Function::Sqrt, _)) | (program::Cost::Division, _) => self.divisions += 1,
            (_, Op::Floor(..)) => self.operations += 1,
            (program::Cost::Power, Op::Powi(n, _)) => self.operations += u64::from(2 * n.max(1).ilog2()),
            (program::Cost::Table, _) => self.operations += 40,
            (program::Cost::Call, _) => self.calls += 1,
            _ => self.operations += 1,
        }
    }

    fn solve(&mut self, program: &Program, solve: &Solve) {
        let n = solve.unknowns.len();
        match &solve.method {
            Method::Linear { .. } => {
                self.solves += 1;
                self.operations += elimination(&program.blocks[solve.block]);
            }
            Method::Newton { code, .. } => {
                let one = OperationCount::of(program, code);
                let one = one.operations + one.divisions + one.calls;
                self.newton.push((solve.block, 1, one + elimination(&program.blocks[solve.block]) + 20 * n as u64));
            }
        }
    }

    /// The same with derivatives beside the values.
    pub fn along(self) -> OperationCount {
        OperationCount { operations: 4 * self.operations, divisions: 3 * self.divisions, calls: 2 * self.calls, ..self }
    }

    fn newton_solves(&self) -> u64 {
        self.newton.iter().map(|n| n.1).sum()
    }

    /// All operations, if each Newton block takes so many evaluations.
    pub fn total(&self, evaluations: u64) -> u64 {
        let newton: u64 = self.newton.iter().map(|(_, times, one)| times * one * evaluations).sum();
        self.operations + self.divisions + self.calls + newton
    }
}

/// Factoring, first as a symmetric or sparse matrix, two solutions and a refinement.
fn elimination(block: &Block) -> u64 {
    let n = block.size() as u64;
    let full = if n < 2 { n } else { n * n * n + n * n * n / 3 + 10 * n * n };
    match &block.matrix().factors {
        Some(factors) if block.size() > FULL_AT_MOST => factors.operations(),
        Some(factors) => factors.operations() + full,
        None => full,
    }
}

impl Add for OperationCount {
    type Output = OperationCount;
    fn add(mut self, other: OperationCount) -> OperationCount {
        self.operations += other.operations;
        self.divisions += other.divisions;
        self.calls += other.calls;
        self.solves += other.solves;
        for (block, times, one) in other.newton {
            match self.newton.iter_mut().find(|n| n.0 == block) {
                Some(known) => known.1 += times,
                None => self.newton.push((block, times, one)),
            }
        }
        self
    }
}

impl Mul<u64> for OperationCount {
    type Output = OperationCount;
    fn mul(mut self, n: u64) -> OperationCount {
        self.operations *= n;
        self.divisions *= n;
        self.calls *= n;
        self.solves *= n;
        self.newton.iter_mut().for_each(|(_, times, _)| *times *= n);
        self.newton.retain(|n| n.1 > 0);
        self
    }
}

/// What a step costs at most.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cost {
    /// Additions, products, comparisons of a step in which nothing jumps; of the midpoint rule in all its iterations.
    pub operations: u64,
    /// Divisions and square roots of such a step.
    pub divisions: u64,
    /// Elementary functions of such a step.
    pub calls: u64,
    /// Linear solve blocks of such a step.
    pub linear_solves: u64,
    /// Newton blocks solved in such a step.
    pub newton_solves: u64,
    /// Evaluations at most in each of them.
    pub newton_evaluations: u64,
    /// Newton iterations of the method in a step.
    pub method_iterations: u64,
    /// Operations of all kinds in such a step, if all Newton blocks take all their evaluations.
    pub total: u64,
    /// Operations of all kinds that a jump adds.
    pub jump_total: u64,
    /// Jumps in a step at most; each of them begins a part of the step that costs as much as one.
    pub most_jumps: u64,
    /// Points of a delay at most; each step may look at all of them.
    pub delay_points: u64,
    /// Size of the work arrays of the model, in numbers.
    pub memory: u64,
    /// Modes of set-valued laws, each with equations of its own; 0 without such laws.
    pub modes: u64,
    /// Whether the equations keep their independent variables where others would tell the motion.
    pub keeps_variables: bool,
}

/// Jumps within one step at most.
pub(super) fn most_jumps(plan: &Plan) -> u64 {
    if plan.events.conditional.is_empty() { MOST_JUMPS } else { MOST_EVENTS }
}

/// Steps that are made at most to locate a crossing within one.
pub(super) fn most_looks(plan: &Plan) -> u64 {
    if plan.locates() { LOOKS + TURNS * plan.sizes.indicators as u64 } else { 0 }
}

impl Cost {
    pub(super) fn new(step: OperationCount, jump: OperationCount, round: OperationCount, plan: &Plan) -> Cost {
        let s = &plan.sizes;
        let p = plan.export.program;
        let jumps = !(p.held.is_empty() && p.conditions.is_empty() && p.clauses.is_empty());
        let implicit = plan.export.method == crate::Method::ImplicitMidpoint;
        let newton_solves = step.newton_solves();
        Cost {
            operations: step.operations,
            divisions: step.divisions,
            calls: step.calls,
            linear_solves: step.solves,
            newton_solves,
            newton_evaluations: if newton_solves > 0 { EVALUATIONS } else { 0 },
            method_iterations: if implicit { 20 } else { 0 },
            total: step.total(EVALUATIONS),
            jump_total: jump.total(EVALUATIONS_AT_JUMPS * 9)
                + MOST_ROUNDS * round.total(EVALUATIONS_AT_JUMPS * 9)
                + most_looks(plan) * step.total(EVALUATIONS),
            most_jumps: if jumps || !plan.export.program.inputs.is_empty() { most_jumps(plan) } else { 0 },
            delay_points: plan.delays.iter().map(|d| d.1 as u64).sum(),
            memory: (s.memory + s.work + s.crossing + s.factors + s.derived) as u64,
            modes: 0,
            keeps_variables: plan.watched.is_some(),
        }
    }

    /// What the mode that costs most does; where a mode is sought each of them may be tried.
    pub(super) fn of_modes(plans: &[Plan]) -> Cost {
        let all: Vec<Cost> = plans.iter().map(Plan::cost).collect();
        let most = |of: fn(&Cost) -> u64| all.iter().map(of).max().unwrap_or(0);
        let tried = plans[0].mode.as_ref().map_or(0, |tables| tables.modes.counts().0 as u64);
        Cost {
            operations: most(|c| c.operations),
            divisions: most(|c| c.divisions),
            calls: most(|c| c.calls),
            linear_solves: most(|c| c.linear_solves),
            newton_solves: most(|c| c.newton_solves),
            newton_evaluations: most(|c| c.newton_evaluations),
            method_iterations: most(|c| c.method_iterations),
            total: most(|c| c.total),
            jump_total: most(|c| c.jump_total) * (1 + tried),
            most_jumps: most(|c| c.most_jumps),
            delay_points: most(|c| c.delay_points),
            memory: most(|c| c.memory),
            modes: tried,
            keeps_variables: plans.iter().any(|plan| plan.watched.is_some()),
        }
    }

    /// It in words, a line each.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "a step without jumps: {} operations, {} divisions, {} elementary functions",
            self.operations, self.divisions, self.calls
        )];
        if self.method_iterations > 0 {
            lines.push(format!("in them {} Newton iterations of the method", self.method_iterations));
        }
        if self.linear_solves > 0 {
            lines.push(format!("{} linear solve blocks", self.linear_solves));
        }
        if self.newton_solves > 0 {
            lines.push(format!(
                "{} solutions of Newton blocks, each at most {} evaluations",
                self.newton_solves, self.newton_evaluations
            ));
        }
        lines.push(format!("{} operations of all kinds at most", self.total));
        if self.most_jumps > 0 {
            lines.push(format!(
                "at most {} jumps in a step, each as much again and {} operations more",
                self.most_jumps, self.jump_total
            ));
        }
        if self.modes > 0 {
            lines.push(format!(
                "{} modes in a table, each with equations of its own; where one ends each may be tried",
                self.modes
            ));
        }
        if self.keeps_variables {
            lines.push(
                "one choice of independent variables: it stops where a position is passed at which they do not tell the motion"
                    .to_string(),
            );
        }
        lines
    }
}
