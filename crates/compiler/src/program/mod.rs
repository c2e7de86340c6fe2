//! The program: what is evaluated to integrate a model and to record its variables.
//!
//! [`schedule`] turns the steps of [`Equations`](crate::equations::Equations) into one list of [values](Program::values), each an operation on
//! values before it, equal ones shared. From it [`Program::routine`] takes what computes a chosen few of
//! them, everything else left out: one routine for the rates, one for what is recorded, one for switching functions. Values that read parameters alone are computed once for each set of parameters, by the
//! [preamble](Program::preamble).
//!
//! # Conditions
//!
//! Truth values are the numbers 0 and 1. Whatever makes a value jump or bend — a comparison, `abs`, `min`, `floor`, a
//! corner of a table — reads a [`Condition`], which whoever runs the program may hold fixed while it integrates. Both
//! branches of an `if` are evaluated: there are no side effects, and a branch without a value does no harm as long as
//! it is not chosen. Inside a Newton block conditions that read its unknowns are not held.

#[macro_use]
mod op;

mod angles;
mod bounds;
pub mod calculus;
mod checks;
mod dataflow;
mod dependence;
mod derive;
pub mod elimination;
mod events;
mod idle;
mod jacobian;
mod kept;
mod lower;
mod nearness;
mod operations;
mod parts;
mod print;
mod ratios;
mod repetition;
mod roots;
mod routine;
mod samples;
mod schedule;
mod sharing;
mod start;
mod swings;
mod triggers;
mod values;
mod verify;

pub use bounds::{Bounds, Margin};
pub use events::{Action, Bound, Clause, Impulse, Jumps, Measure, SetValued, Target, Trigger};
pub use jacobian::{Differentiated, JacobianEntry};
pub use op::{Bits, Cost, Op};
pub use parts::RatesInParts;
pub use ratios::{Ratios, Told};
pub use repetition::Repetition;
pub(crate) use repetition::frequent_distances;
pub use routine::{Arg, Code, Local, Method, Routine, Solve, Step};
pub use schedule::schedule;
pub use start::StartGroup;
pub use values::{ListedValues, Reads, Values};
pub use verify::verify;

use std::collections::BTreeMap;
use std::sync::Arc;

pub use crate::algebra::Holds;
use crate::algebra::{Symbol, Table1d};
use crate::bond_graph::{HeldKind, ParameterKind};
pub use crate::equations::{
    DomainKind, Exchanged, Exchanges, ObservedKind, Unavailable, Unkept, UnkeptRelation, bare_name,
};
use crate::ids::{Table, id};
use crate::span::Span;
use crate::sparse::{SparseMatrix, SymbolicFactors};
use crate::unit::Unit;
use dataflow::Dataflow;

/// Linear blocks of at most so many unknowns are small: what shares their factors has their entries too.
pub const SMALL: usize = 12;

id!(
    /// A value: an entry of [`Program::values`].
    Value
);
id!(
    /// A solve block.
    BlockId
);
id!(
    /// A condition.
    ConditionId
);

/// What is evaluated.
///
/// Invariants (see [`verify`]): every value reads values before it; a value that reads a guess of a Newton block is read
/// by that block and by such values only; all numbers in it are those of something.
#[derive(Debug, Clone)]
pub struct Program {
    /// Name of the model.
    pub name: String,
    /// All values, in an order in which they can be evaluated.
    pub values: Values,
    /// Solve blocks, in the order in which they are evaluated.
    pub blocks: Table<BlockId, Block>,
    /// Conditions, those that others read before these.
    pub conditions: Table<ConditionId, Condition>,
    /// Tables; the ids in the operations are those of the expression pool.
    pub tables: Vec<Table1d>,
    /// Parameters and constants.
    pub parameters: Vec<Parameter>,
    /// Inputs.
    pub inputs: Vec<Input>,
    /// Signals held from earlier times.
    pub held: Vec<HeldSignal>,
    /// What happens at events.
    pub clauses: Vec<Clause>,
    /// Set-valued laws, in the order of the text; bounds of their branches are the last clauses.
    pub set_valued: Vec<SetValued>,
    /// How storages change at events, where they do and another form does not tell.
    pub jumps: Option<Jumps>,
    /// States; in implicit form all unknowns, states before algebraic ones.
    pub states: Vec<State>,
    /// Positions that constraints on displacements determine by an iteration. At the start of a run they are unknowns
    /// beside the states; from there on each iteration follows the solution that the start has found.
    pub positions: Vec<Position>,
    /// What the equations are if they are no explicit rates.
    pub implicit: Option<Implicit>,
    /// The value of each variable of the bond graph that has one, by its symbol: the same in all forms of a graph.
    pub variables: BTreeMap<Symbol, Value>,
    /// For each state the variable of the bond graph that tells it.
    pub tracked: Vec<Symbol>,
    /// Sums of stored quantities that no jump of a source changes, by the variable of the bond graph that tells the
    /// independent storage among them: the same in all forms of a graph.
    pub momenta: BTreeMap<Symbol, Value>,
    /// Explicit rates whose states are speeds: the states that a jump of a source changes, each with the sum of stored
    /// quantities that it does not. Empty where nothing jumps.
    pub kept: Vec<(u32, Value)>,
    /// Constants fixed by the start values.
    pub conserved: Vec<String>,
    /// For each of them the variable that follows from it in place of a state.
    pub replaced: Vec<Symbol>,
    /// Which variables could be independent in place of others, where divisors may vanish while running.
    pub exchanges: Exchanges,
    /// How states move together whatever laws say.
    pub relations: Relations,
    /// Relations between positions that the rates of the states keep, and nothing else: they drift.
    pub position_relations: Vec<PositionRelation>,
    /// Relations between speeds that are not among these, with the reason.
    pub unkept_relations: Vec<UnkeptRelation>,
    /// What can be recorded.
    pub observed: Vec<Observed>,
    /// What the start of a run has to satisfy.
    pub start: Vec<StartCondition>,
    /// Where the search of the start begins, in the order in which they are placed.
    pub guesses: Vec<StartGuess>,
    /// Divisors that must not vanish.
    pub pivot_guards: Vec<PivotGuard>,
    /// What must hold for laws to have values, for messages.
    pub domains: Vec<LawDomain>,
    /// What must hold of parameters: where it does not, the equations are others than these.
    pub assumptions: Vec<Assumption>,
    /// Whether states may come to rest where a law is infinitely steep.
    pub steep: bool,
    /// For each state the states that its rate or residual reads, ascending; their free rates count as they.
    pub dependence: Vec<Vec<u32>>,
}

/// A parameter or constant.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its value where none is set: a value of constants and other parameters.
    pub default: Value,
    /// Whether it cannot be set.
    pub constant: bool,
    /// Whether that is because it shapes the model, which is compiled anew for another value.
    pub shapes: bool,
    /// What it is.
    pub kind: ParameterKind,
    /// SI unit, where known.
    pub unit: Option<Unit>,
}

/// An input.
#[derive(Debug, Clone)]
pub struct Input {
    /// Its name.
    pub name: String,
    /// Its value where nothing is connected, in parameters.
    pub default: Value,
    /// The unit that it is declared in.
    pub unit: Option<Unit>,
    /// The SI unit that follows from its value and from where it is read, where known.
    pub deduced: Option<Unit>,
}

/// A delayed or sampled signal, a discrete variable.
#[derive(Debug, Clone)]
pub struct HeldSignal {
    /// Its name.
    pub name: String,
    /// The signal that is delayed or sampled; the start value of a discrete variable.
    pub source: Value,
    /// Delay or period in s, in parameters.
    pub time: Value,
    /// What it is.
    pub kind: HeldKind,
}

/// A form that is not `x' = f(t, x)`: `F(t, y, y') = 0`, as many equations as unknowns.
#[derive(Debug, Clone)]
pub struct Implicit {
    /// For each equation whether it is `y' - rate`, of the unknown with its number; if not, the value in the place of the
    /// rate is the residual.
    pub explicit: Vec<bool>,
    /// For each unknown whether it is a state, with a rate; if not, it is algebraic.
    pub differential: Vec<bool>,
    /// Index of each unknown, at least 1.
    pub indices: Vec<u8>,
    /// States whose rate is free, with what their bond carries: the variable of the bond graph and its value here.
    pub carried: Vec<(u32, Symbol, Value)>,
}

/// A state.
#[derive(Debug, Clone)]
pub struct State {
    /// Its name.
    pub name: String,
    /// Its rate, or the residual in its place.
    pub rate: Value,
    /// SI unit, where known.
    pub unit: Option<Unit>,
}

/// How states move together, whatever the laws of elements say: rows that share all their drives with others.
#[derive(Debug, Clone, Default)]
pub struct Relations {
    /// The rows.
    pub rows: Vec<Moved>,
    /// Number of drives.
    pub drives: usize,
    /// Whether there may be rows that are not written out, because all of them together are too long.
    pub unwritten: bool,
}

/// One row: `Σ factor · quantity' = Σ coefficient · drive`.
#[derive(Debug, Clone)]
pub struct Moved {
    /// Factors and quantities.
    pub quantity: Vec<(Value, Value)>,
    /// Drives, by their number, and their coefficients.
    pub by: Vec<(usize, Value)>,
}

impl Relations {
    /// Everything that the rows are made of.
    pub fn values(&self) -> impl Iterator<Item = Value> + '_ {
        let quantities = self.rows.iter().flat_map(|r| r.quantity.iter().flat_map(|&(factor, x)| [factor, x]));
        quantities.chain(self.rows.iter().flat_map(|r| r.by.iter().map(|b| b.1)))
    }
}

/// A relation between states that keeps its value.
#[derive(Debug, Clone)]
pub struct PositionRelation {
    /// It vanishes, or keeps the value that it has at the start.
    pub value: Value,
    /// Whether it vanishes: it is a constraint.
    pub vanishes: bool,
    /// The states that it reads, by their numbers, with its derivatives by them.
    pub slopes: Vec<(u32, Value)>,
    /// What keeps its value, as text, where positions may drift from it.
    pub told: Option<String>,
}

impl PositionRelation {
    /// Everything that it is made of: its value first.
    pub fn values(&self) -> impl Iterator<Item = Value> + '_ {
        std::iter::once(self.value).chain(self.slopes.iter().map(|s| s.1))
    }
}

/// A position that an iteration determines.
#[derive(Debug, Clone)]
pub struct Position {
    /// Its name.
    pub name: String,
    /// The variable of the bond graph that it is.
    pub symbol: Symbol,
    /// Its rate, where that has a value.
    pub rate: Option<Value>,
    /// Its value: a solution of a Newton block, all of whose unknowns are positions.
    pub value: Value,
    /// The block.
    pub block: BlockId,
    /// Its place among the unknowns of the block.
    pub unknown: u32,
}

/// A variable that can be recorded.
#[derive(Debug, Clone)]
pub struct Observed {
    /// Its name.
    pub name: Arc<str>,
    /// Its value, or why it has none.
    pub value: Result<Value, Unavailable>,
    /// SI unit, where known.
    pub unit: Option<Unit>,
    /// What it is.
    pub kind: ObservedKind,
    /// Whether it is recorded without being asked for.
    pub default: bool,
}

/// Values of a program beyond which it is long.
const LONG: usize = 10_000;

impl Program {
    /// The states that variables tell; behind them are those that stand still in this mode, which nobody asks for.
    pub fn own_states(&self) -> &[State] {
        &self.states[..self.tracked.len()]
    }

    /// Number of unknowns of the start: states, then conserved constants, then positions.
    pub fn start_unknowns(&self) -> usize {
        self.states.len() + self.conserved.len() + self.positions.len()
    }

    /// Whether code for its derivatives is so long that it has left the caches of a processor when it runs again: then differences
    /// of rates, whose code has just run, take a tenth of the time (measured on cars of 20,000 values and more).
    pub fn is_long(&self) -> bool {
        self.values.len() > LONG
    }

    /// The parameter that is this, by its number, if there is one.
    pub fn parameter_of(&self, kind: ParameterKind) -> Option<usize> {
        self.parameters.iter().position(|p| p.kind == kind)
    }
}

/// A condition on the start of a run: `residual = 0`.
#[derive(Debug, Clone)]
pub struct StartCondition {
    /// The variable it is about, as shown.
    pub name: String,
    /// What vanishes.
    pub residual: Value,
    /// The value asked for.
    pub asked: Value,
    /// It is a constraint: it holds whatever start values are given.
    pub firm: bool,
    /// It is about freedom that remains, and gives way to what is given. Such conditions stand last.
    pub weak: bool,
    /// States (by index) and, after them, conserved constants and positions that the residual reads, ascending.
    pub reads: Vec<u32>,
    /// Where it stands.
    pub span: Span,
}

/// Where the search of the start begins for one unknown: there `residual` vanishes, as far as one step of Newton tells.
#[derive(Debug, Clone)]
pub struct StartGuess {
    /// What is guessed, as shown.
    pub name: String,
    /// The guess.
    pub asked: Value,
    /// What vanishes.
    pub residual: Value,
    /// The state (by index) or, after them, conserved constant or position that is placed.
    pub unknown: u32,
    /// States and, after them, conserved constants and positions that the residual reads, ascending.
    pub reads: Vec<u32>,
    /// Where it stands.
    pub span: Span,
}

/// A divisor: if it vanishes the run stops.
#[derive(Debug, Clone)]
pub struct PivotGuard {
    /// The divisor.
    pub pivot: Value,
    /// Magnitude of the terms it is the sum of, 0 if it is no sum: below rounding of it the divisor counts as zero.
    pub scale: Value,
    /// The elements concerned, for messages.
    pub elements: String,
    /// The divisor as text, or what it reads if that would be long.
    pub divisor: String,
}

/// Something that was taken for granted of parameters when the equations were derived.
#[derive(Debug, Clone)]
pub struct Assumption {
    /// A value of parameters alone.
    pub value: Value,
    /// Magnitude of the terms that it is the sum of: below rounding of it the value counts as zero.
    pub scale: Value,
    /// What holds of it.
    pub holds: Holds,
    /// The same in words, such as `a - b is zero`.
    pub text: String,
}

impl Assumption {
    /// A value below this fraction of its scale is rounding of the operations that lead to it.
    pub const ROUNDING: f64 = 1e-13;

    /// Whether it holds of a value with this scale.
    pub fn holds_of(&self, value: f64, scale: f64) -> bool {
        match self.holds {
            Holds::Zero => value.abs() <= Assumption::ROUNDING * scale,
            Holds::NotZero => value.abs() > Assumption::ROUNDING * scale.abs(),
            Holds::Positive => value > 0.0,
            Holds::NotNegative => value >= 0.0,
        }
    }
}

/// A list of names for a message: its first ones, and how many more there are.
pub fn first_of(names: &str) -> String {
    const MOST: usize = 4;
    let all: Vec<&str> = names.split(", ").collect();
    match all.len() > MOST + 1 {
        true => format!("{} and {} more", all[..MOST].join(", "), all.len() - MOST),
        false => names.to_string(),
    }
}

/// What must hold for a law to have a value.
#[derive(Debug, Clone)]
pub struct LawDomain {
    /// The variable that the law gives.
    pub given: String,
    /// The elements concerned.
    pub elements: String,
    /// What must lie in the domain.
    pub argument: Value,
    /// Where it must lie.
    pub kind: DomainKind,
    /// The only variable that it reads, if there is just one.
    pub asked: Option<(String, Value)>,
    /// The value of that variable at which the domain ends, in parameters.
    pub limit: Option<Value>,
}

/// What decides between the pieces of a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    /// What it reads.
    pub operand: Value,
    /// How it decides.
    pub kind: ConditionKind,
    /// When it may change.
    pub trigger: EventTrigger,
}

/// How a condition decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ConditionKind {
    /// Whether the operand is above zero.
    Sign,
    /// The greatest integer not above the operand.
    Floor,
    /// The piece of this table (index into [`Program::tables`]) that the operand is in: number of points not above it.
    Piece(u32),
}

impl ConditionKind {
    /// Number of switching functions that it needs.
    pub fn switches(self) -> usize {
        match self {
            ConditionKind::Sign => 1,
            ConditionKind::Floor | ConditionKind::Piece(_) => 2,
        }
    }
}

/// What moves a condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventTrigger {
    /// Time alone, and between two changes of other conditions in a straight line: its next change has a closed form.
    LinearTime,
    /// Time alone, along some other curve.
    CurvedTime,
    /// States, inputs or held signals; rates read it.
    State,
    /// States, inputs or held signals, but no rate reads it: it needs no event.
    RecordedOnly,
}

/// A solve block.
#[derive(Debug, Clone)]
pub enum Block {
    /// `matrix · unknowns = right`.
    Linear {
        /// The matrix.
        matrix: Arc<Matrix>,
        /// Right-hand side.
        right: Vec<Value>,
        /// A solution of an earlier block with the same matrix, whose factors serve.
        shared: Option<Value>,
        /// The elements concerned, for messages.
        elements: String,
    },
    /// `residuals = 0` by Newton.
    Newton {
        /// The residuals at the guess, as many as unknowns.
        residuals: Vec<Value>,
        /// Their exact derivatives by the guess.
        jacobian: Arc<Matrix>,
        /// Names of the unknowns, for messages.
        unknowns: Vec<String>,
        /// The elements concerned, for messages.
        elements: String,
    },
}

/// The matrix of a solve block.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    /// What of it may differ from 0.
    pub values: SparseMatrix<Value>,
    /// How it is eliminated if it is large and sparse; if not, as a full one.
    pub factors: Option<Arc<SymbolicFactors>>,
}

impl Matrix {
    /// A matrix with these values.
    pub fn new(values: SparseMatrix<Value>) -> Matrix {
        let factors = SymbolicFactors::of_large(values.pattern()).map(Arc::new);
        Matrix { values, factors }
    }

    /// The matrix with other values in the same places.
    pub fn map(&self, to: impl FnMut(&Value) -> Value) -> Matrix {
        Matrix { values: self.values.map(to), factors: self.factors.clone() }
    }
}

impl Program {
    /// The block whose factors serve this one.
    pub fn factors_of(&self, block: BlockId) -> Option<BlockId> {
        let Block::Linear { shared: Some(solution), .. } = self.blocks[block] else { return None };
        let Op::Solution(block, _) = self.values.op(solution) else { panic!("factors are shared with a block") };
        Some(block)
    }
}

impl Block {
    /// Number of unknowns.
    pub fn size(&self) -> usize {
        match self {
            Block::Linear { right, .. } => right.len(),
            Block::Newton { residuals, .. } => residuals.len(),
        }
    }
    /// What its solution depends on where its equations read so much: one that is iterated for and moves follows the one before,
    /// and is not to be had at any time that is asked for.
    pub fn reads_of_solution(&self, reads: Reads) -> Reads {
        match self {
            Block::Newton { .. } if reads != Reads::PARAMETERS => reads.with(Reads::STATE),
            _ => reads,
        }
    }
    /// Its matrix, or that of the derivatives of its residuals.
    pub fn matrix(&self) -> &Arc<Matrix> {
        let (Block::Linear { matrix, .. } | Block::Newton { jacobian: matrix, .. }) = self;
        matrix
    }
    /// Whether its matrix is symmetric whatever the values.
    pub fn is_symmetric(&self) -> bool {
        self.matrix().values.is_symmetric()
    }
    /// What it reads.
    pub fn reads(&self) -> impl Iterator<Item = Value> + '_ {
        let (right, shared) = match self {
            Block::Linear { right, shared, .. } => (right, *shared),
            Block::Newton { residuals, .. } => (residuals, None),
        };
        self.matrix().values.entries().iter().chain(right).copied().chain(shared)
    }
    /// The name of an unknown, for messages; empty in a linear block.
    pub fn unknown(&self, index: usize) -> &str {
        match self {
            Block::Linear { .. } => "",
            Block::Newton { unknowns, .. } => &unknowns[index],
        }
    }
    /// The elements concerned, for messages.
    pub fn elements(&self) -> &str {
        match self {
            Block::Linear { elements, .. } | Block::Newton { elements, .. } => elements,
        }
    }
}
