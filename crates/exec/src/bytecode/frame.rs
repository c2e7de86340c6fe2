//! Registers and the code that runs on them.

use super::block_batch::{BatchWorkspace, BlockBatches};
use super::conditions::{Conditions, table_on};
use super::elimination::Factors;
use super::instruction::{Instruction, Operation, Register, Routine, Solve};
use super::newton::Newton;
use super::orientation::Orientation;
use super::piece_of;
use super::registers::Layout;
use super::wide::HasFrame;
use halfarrow_compiler::algebra::Table1d;
use halfarrow_compiler::for_each_op;
use halfarrow_compiler::program::calculus::{Calculus, Plain};
use halfarrow_compiler::program::{Block, ConditionId, Op, Program, Reads};
use std::sync::Arc;

/// A guarded divisor vanishes below this part of the terms that it is made of.
pub(crate) const PIVOT_BELOW: f64 = 64.0 * f64::EPSILON;

/// The inner code of a Newton block in another form.
pub(crate) trait InnerCode: std::fmt::Debug + Send + Sync {
    /// Runs it, with derivatives if `along`.
    fn run(&self, frame: &mut Frame, solve: &Solve, along: bool);
}

/// Why a routine stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum SolveError {
    /// A guarded divisor vanishes.
    Vanished { guard: u32 },
    /// A linear block has no unique solution.
    Singular { block: u32 },
    /// A Newton block found none.
    NoConvergence { block: u32, iterations: usize, residual: f64 },
    /// The equation of a Newton block has no solution: where it comes nearest to one, and what is left there.
    NoSolution { block: u32, nearest: f64, residual: f64 },
    /// The solution followed ends; what one of its unknowns was, and what it is in another solution.
    Ended { block: u32, unknown: usize, from: f64, to: f64 },
    /// Positions are not found where their motion leads.
    OffMotion { block: u32 },
    /// The bound on evaluations of a Newton block is hit.
    Bound { block: u32, evaluations: usize },
}

/// Everything a routine reads and writes; all memory is taken in [`new`](Frame::new).
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    /// Values.
    pub r: Vec<f64>,
    /// Derivatives along the present direction.
    pub d: Vec<f64>,
    pub conditions: Conditions,
    pub solvers: Vec<Solver>,
    /// What values are the sums of, in magnitude, where somebody asks.
    pub(super) terms: Vec<f64>,
    /// Set values of parameters.
    pub set: Vec<Option<f64>>,
    /// The parameter whose derivative by itself is 1, where routines run along parameters.
    pub varied: Option<u32>,
    pub tables: Vec<Table1d>,
    pub(super) time: u32,
    /// The code of the Newton block that is being solved, where it is not to be interpreted.
    pub inner: Option<Arc<dyn InnerCode>>,
    /// Newton blocks of the routine that runs which are solved in batches.
    pub batches: Option<Arc<BlockBatches>>,
    pub(super) workspace: BatchWorkspace,
}

/// What a solve block needs.
#[derive(Debug, Clone)]
pub(crate) struct Solver {
    pub factors: Factors,
    /// Right-hand side and solution.
    pub(super) x: Vec<f64>,
    pub(super) orientation: Orientation,
    rate: Vec<f64>,
    /// Whether the matrix reads parameters alone, and has been factored since they were set.
    pub constant: bool,
    factored: bool,
    pub newton: Newton,
}

impl Solver {
    /// The unknowns as they were found last.
    pub fn found(&self) -> &[f64] {
        if self.newton.x.is_empty() { &self.x } else { &self.newton.x }
    }
}

impl Frame {
    pub fn new(program: &Program, layout: &Layout, registers: u32) -> Frame {
        let solver = |block: &Block| {
            let n = block.size();
            let constant = matches!(block, Block::Linear { matrix, .. }
                if matrix.values.entries().iter().all(|&v| program.values.reads(v) == Reads::PARAMETERS));
            let newton = match block {
                Block::Newton { jacobian, .. } => {
                    Newton::new(n, jacobian.values.pattern().len(), jacobian.factors.is_some())
                }
                Block::Linear { .. } => Newton::new(0, 0, false),
            };
            let shared = matches!(block, Block::Linear { shared: Some(_), .. });
            Solver {
                factors: Factors::new(block),
                x: vec![0.0; n],
                orientation: Orientation::new(if shared || constant { 0 } else { n }),
                rate: vec![0.0; n],
                constant,
                factored: false,
                newton,
            }
        };
        let mut solvers: Vec<Solver> = program.blocks.values().map(solver).collect();
        program.positions.iter().for_each(|p| solvers[p.block.0 as usize].newton.positions = true);
        let mut r = vec![0.0; registers.max(layout.size) as usize];
        layout.constants.iter().for_each(|&(register, value)| r[register as usize] = value);
        Frame {
            d: vec![0.0; r.len()],
            terms: vec![0.0; r.len()],
            r,
            conditions: Conditions::new(program.conditions.values()),
            solvers,
            set: vec![None; program.parameters.len()],
            varied: None,
            tables: program.tables.clone(),
            time: layout.time,
            inner: None,
            batches: None,
            workspace: BatchWorkspace::default(),
        }
    }

    /// Makes room for a routine.
    pub fn reserve(&mut self, routine: &Routine) {
        let size = self.r.len().max(routine.registers as usize);
        self.r.resize(size, 0.0);
        self.d.resize(size, 0.0);
        self.terms.resize(size, 0.0);
        for solve in &routine.solves {
            self.solvers[solve.block.0 as usize].newton.reserve(solve.outer.len());
        }
    }

    /// Makes room for batches of Newton blocks.
    pub fn reserve_batches(&mut self, batches: &BlockBatches) {
        self.workspace.reserve(batches);
    }

    /// From now on Newton blocks are solved in these batches, if there are any.
    pub fn begin(&mut self, batches: Option<&Arc<BlockBatches>>) {
        self.batches = batches.cloned();
        self.workspace.turn += 1;
    }

    /// Forgets what was kept for the old parameters.
    pub fn parameters_changed(&mut self) {
        for solver in &mut self.solvers {
            (solver.factored, solver.newton.fresh) = (false, false);
        }
    }

    /// A value and its derivative.
    pub fn pair(&self, register: u32) -> (f64, f64) {
        (self.r[register as usize], self.d[register as usize])
    }

    /// Runs a routine.
    pub fn run(&mut self, routine: &Routine) -> Result<(), SolveError> {
        self.all::<false>(routine)
    }

    /// Runs it with derivatives along the direction that the fixed registers have in `d`.
    pub fn run_along(&mut self, routine: &Routine) -> Result<(), SolveError> {
        self.all::<true>(routine)
    }

    fn all<const ALONG: bool>(&mut self, routine: &Routine) -> Result<(), SolveError> {
        self.part::<ALONG>(routine, &routine.code)
    }

    /// Runs a part of the code of a routine.
    pub fn part<const ALONG: bool>(&mut self, routine: &Routine, code: &[Instruction]) -> Result<(), SolveError> {
        for instruction in code {
            match instruction {
                Instruction::Op(operation) => self.operation::<ALONG>(operation),
                Instruction::Solve { solve } => self.solve::<ALONG>(&routine.solves[*solve as usize])?,
                Instruction::Guard { pivot, scale, guard } => {
                    let (pivot, scale) = (self.r[*pivot as usize], self.r[*scale as usize]);
                    if !Frame::is_pivot(pivot, scale) {
                        return Err(SolveError::Vanished { guard: *guard });
                    }
                }
                Instruction::Parameter { out, index, default } => {
                    let set = self.set[*index as usize];
                    let rate = match set {
                        _ if self.varied == Some(*index) => 1.0,
                        Some(_) => 0.0,
                        None => self.d[*default as usize],
                    };
                    self.put::<ALONG>(*out, set.unwrap_or(self.r[*default as usize]), rate);
                }
            }
        }
        Ok(())
    }

    /// Whether a divisor is clearly not 0.
    #[inline]
    pub(super) fn is_pivot(pivot: f64, scale: f64) -> bool {
        pivot != 0.0 && pivot.abs() > PIVOT_BELOW * scale
    }

    /// The inner code of a Newton block.
    pub(super) fn inner<const ALONG: bool>(&mut self, solve: &Solve) {
        match self.inner.take() {
            Some(code) => {
                code.run(self, solve, ALONG);
                self.inner = Some(code);
            }
            None => self.plain::<ALONG>(&solve.code),
        }
    }

    pub(crate) fn plain<const ALONG: bool>(&mut self, code: &[Operation]) {
        code.iter().for_each(|operation| self.operation::<ALONG>(operation));
    }

    pub fn solve<const ALONG: bool>(&mut self, solve: &Solve) -> Result<(), SolveError> {
        if solve.guess.is_empty() {
            self.linear::<ALONG>(solve)
        } else if !ALONG && self.put_known_root(solve) {
            Ok(())
        } else {
            self.newton::<ALONG>(solve)
        }
    }

    fn linear<const ALONG: bool>(&mut self, solve: &Solve) -> Result<(), SolveError> {
        let Frame { r, d, solvers, .. } = self;
        let solver = &mut solvers[solve.shared.unwrap_or(solve.block).0 as usize];
        if solve.shared.is_none() && !(solver.constant && solver.factored) {
            solver.factored = solver.factors.factor(entries(solve, r)).is_ok();
            solver.orientation.fresh = solver.factored && !solver.constant;
        }
        solver.x.iter_mut().zip(&solve.right).for_each(|(x, &b)| *x = r[b as usize]);
        if !solver.factored {
            return Err(SolveError::Singular { block: solve.block.0 });
        }
        solver.factors.solve(&mut solver.x);
        if ALONG {
            assert!(
                solve.shared.is_none() || !solve.matrix.is_empty(),
                "what shares large factors is itself a derivative"
            );
            for (i, rate) in solver.rate.iter_mut().enumerate() {
                let row = solve.pattern.row(i).map(|e| (solve.matrix[e], solve.pattern.columns()[e]));
                let moved: f64 = row.map(|(m, column)| d[m as usize] * solver.x[column as usize]).sum();
                *rate = d[solve.right[i] as usize] - moved;
            }
            solver.factors.solve(&mut solver.rate);
            solve.unknowns.iter().zip(&solver.rate).for_each(|(&out, &rate)| d[out as usize] = rate);
        }
        solve.unknowns.iter().zip(&solver.x).for_each(|(&out, &x)| r[out as usize] = x);
        Ok(())
    }

    fn newton<const ALONG: bool>(&mut self, solve: &Solve) -> Result<(), SolveError> {
        self.find_root(solve)?;
        let size = solve.right.len();
        if ALONG {
            solve.guess.iter().for_each(|&g| self.d[g as usize] = 0.0);
            self.inner::<true>(solve);
            let Frame { r, d, solvers, .. } = self;
            let solver = &mut solvers[solve.block.0 as usize];
            if solver.factors.factor(entries(solve, r)).is_err() {
                return Err(SolveError::Singular { block: solve.block.0 });
            }
            (0..size).for_each(|i| solver.rate[i] = -d[solve.right[i] as usize]);
            solver.factors.solve(&mut solver.rate);
            solve.unknowns.iter().zip(&solver.rate).for_each(|(&out, &rate)| d[out as usize] = rate);
        }
        let root = &self.solvers[solve.block.0 as usize].newton.x;
        solve.unknowns.iter().zip(root).for_each(|(&out, &x)| self.r[out as usize] = x);
        Ok(())
    }

    fn condition<const ALONG: bool>(&mut self, condition: ConditionId, a: u32) -> f64 {
        let value = self.r[a as usize];
        if ALONG {
            let t = self.r[self.time as usize];
            self.conditions.value_after(condition, (value, self.d[a as usize]), t, &self.tables)
        } else {
            self.conditions.value(condition, value, &self.tables)
        }
    }

    fn table<const ALONG: bool>(&mut self, a: u32, table: u32, piece: Option<ConditionId>) -> [f64; 4] {
        let piece = match piece {
            Some(condition) => self.condition::<ALONG>(condition, a) as usize,
            None => piece_of(&self.tables[table as usize], self.r[a as usize]),
        };
        table_on(&self.tables[table as usize], piece, self.r[a as usize])
    }

    /// The value of a condition at an operand.
    pub(super) fn condition_at(&mut self, condition: ConditionId, operand: f64) -> f64 {
        self.conditions.value(condition, operand, &self.tables)
    }

    /// Value and derivatives of a table at an operand.
    pub(super) fn table_at(&mut self, operand: f64, table: u32, piece: Option<ConditionId>) -> [f64; 4] {
        let piece = match piece {
            Some(condition) => self.condition_at(condition, operand) as usize,
            None => piece_of(&self.tables[table as usize], operand),
        };
        table_on(&self.tables[table as usize], piece, operand)
    }

    #[inline]
    fn put<const ALONG: bool>(&mut self, out: Register, value: f64, rate: f64) {
        self.r[out as usize] = value;
        if ALONG {
            self.d[out as usize] = rate;
        }
    }

    /// One operation: its value, and by the rules of the table its rate.
    #[inline]
    #[allow(unused_variables, reason = "each rule reads what it needs")]
    pub(super) fn operation<const ALONG: bool>(&mut self, operation: &Operation) {
        let out = operation.out;
        macro_rules! compute {
            (($k:ident $value:ident)
             given { $($(#[$given_doc:meta])* $given:ident $(($($given_part:ident: $given_kind:ty),*))?;)* }
             plain { $($(#[$plain_doc:meta])* $plain:ident($($part:ident: $kind:ty),*) [$($a:ident $da:ident $A:ident),*] {
                cost: $cost:ident, value: $meaning:expr, text: $text:literal, c: $c:expr, derivative: $derivative:expr,
             })* }
             held $held:tt) => {
                match operation.op {
                    $(Op::$plain($($part,)* $($a),*) => {
                        $(let $da = if ALONG { Some(self.d[$a as usize]) } else { None };)*
                        $(let $a = self.r[$a as usize];)*
                        let $value = $meaning;
                        let $k = &mut Plain;
                        let rate = if ALONG { $derivative.unwrap_or(0.0) } else { 0.0 };
                        self.put::<ALONG>(out, $value, rate);
                    })*
                    Op::Sign(condition, a) | Op::Floor(condition, a) => {
                        let value = self.condition::<ALONG>(condition, a);
                        self.put::<ALONG>(out, value, 0.0);
                    }
                    Op::Table(table, piece, a) => self.look_up::<ALONG>(out, a, (table, piece), 0),
                    Op::TableSlope(table, piece, a) => self.look_up::<ALONG>(out, a, (table, piece), 1),
                    Op::TableCurvature(table, piece, a) => self.look_up::<ALONG>(out, a, (table, piece), 2),
                    $(Op::$given { .. })|* => unreachable!("given before the routine runs"),
                }
            };
        }
        for_each_op!(compute);
    }

    /// A table, or its derivative of some order.
    fn look_up<const ALONG: bool>(
        &mut self,
        out: Register,
        a: Register,
        (table, piece): (u32, Option<ConditionId>),
        order: usize,
    ) {
        let rate = if ALONG { self.d[a as usize] } else { 0.0 };
        let found = self.table::<ALONG>(a, table, piece);
        self.put::<ALONG>(out, found[order], Plain.along(|_| found[order + 1], rate));
    }
}

impl HasFrame for Frame {
    fn frame(&mut self) -> &mut Frame {
        self
    }
}

/// The entries of the matrix of a solve block.
pub(super) fn entries(solve: &Solve, r: &[f64]) -> impl Iterator<Item = f64> {
    solve.matrix.iter().map(|&entry| r[entry as usize])
}
