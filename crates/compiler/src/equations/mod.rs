//! The equations of a bond graph in one of its forms, in the order in which they are evaluated.

mod along;
mod assumptions;
mod blocks;
mod breaks;
mod conserved;
mod definitions;
mod derive;
mod domains;
mod exchanges;
mod expansion;
mod form;
mod forms;
mod freedom;
mod independent_rows;
mod index;
mod jumps;
mod loops;
mod minimal;
mod momenta;
mod observed;
mod points;
mod position_relations;
mod positions;
mod recognition;
mod recursion;
mod relations;
mod rows;
mod stiff;
mod supports;
mod symmetry;
mod verify;

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::algebra::{Assumption, Expr, Symbol};
use crate::bond_graph::{BondGraph, ElementId, Kind, PortRef};
pub use crate::causal_paths::{Certificate, Count};
use crate::ids::Map;
use crate::span::Span;
use crate::sparse::SparseMatrix;
use crate::unit::Unit;

pub use blocks::LinearRow;
pub(crate) use blocks::{Ordered, substituted};
pub use definitions::Definition;
pub(crate) use definitions::Definitions;
pub use derive::{derive_equations, derive_minimal};
pub use exchanges::{Exchanged, Exchanges};
pub(crate) use expansion::{CLOSED, expansions, named_sources, put_in};
pub use form::Form;
pub use jumps::{Impulse, Jumps};
pub use momenta::Momentum;
pub use observed::bare_name;
pub use position_relations::{PositionRelation, Unkept, UnkeptRelation};
pub use relations::{Moved, Relations};
pub use verify::verify;

/// Equations in evaluation order.
///
/// Given time, inputs, held signals, parameters, conserved constants and unknowns, the steps define one symbol after the
/// other; a step reads only what is given or defined before it. All observed variables are among the symbols so
/// defined. Steps that a caller does not need (say, reactions while integrating) can be left out.
///
/// The unknowns are the states, then the algebraic ones. A state whose rate is among the symbols that the steps define
/// has an explicit equation, `x' = f`. The rates of the other states are given too, and as many residuals vanish as
/// there are such states and algebraic unknowns. So one type says every form: explicit without residuals,
/// semi-explicit with algebraic unknowns, implicit with free rates.
#[derive(Debug, Clone)]
pub struct Equations {
    /// The form.
    pub form: Form,
    /// The graph; its pool holds the expressions of this stage too.
    pub graph: BondGraph,
    /// The states, in order.
    pub states: Vec<State>,
    /// Positions that constraints on displacements determine: computed, not integrated.
    pub positions: Vec<Position>,
    /// Unknowns without a rate, in order.
    pub algebraic: Vec<Algebraic>,
    /// What vanishes: one expression for each state whose rate is free, then one for each algebraic unknown.
    pub residuals: Vec<Expr>,
    /// Quantities that stay at their start value, each in place of a state.
    pub conserved: Vec<Conserved>,
    /// How states move together whatever laws say, for the search of equilibria.
    pub relations: Relations,
    /// Relations between positions that the rates of the states keep, and nothing else: they drift.
    pub position_relations: Vec<PositionRelation>,
    /// Relations between speeds that are not among these, with the reason.
    pub unkept_relations: Vec<UnkeptRelation>,
    /// The steps.
    pub steps: Vec<EquationStep>,
    /// What can be recorded: every effort, flow, `q`, `p` under element names, junction variables, signals, lets and outputs.
    pub observed: Vec<Observed>,
    /// What the start of the run has to satisfy.
    pub conditions: Vec<InitialCondition>,
    /// Where the search of the start begins.
    pub guesses: Vec<Guess>,
    /// Where laws have a value, for messages.
    pub domains: Vec<LawDomain>,
    /// What defines each variable, before loops were opened.
    pub definitions: Map<Symbol, Definition>,
    /// The rows of all linear loops.
    pub rows: Vec<LinearRow>,
    /// Names for parts of these rows: what the unknowns of a loop do to its variables.
    pub of_loops: BTreeSet<Symbol>,
    /// Co-energy variables of the storages that depend on others.
    pub dependent: Vec<Symbol>,
    /// What a state is that is no variable of its own (`pi = X + S^T X_d`), in stored quantities.
    pub meanings: Vec<(Symbol, Expr)>,
    /// Differentiation index of what is left, 0 for an explicit ODE.
    pub index: u8,
    /// Index of each unknown, at least 1: one more than how often an equation is differentiated until it is known.
    pub indices: Vec<u8>,
    /// Numbers of differential and algebraic equations; integrated signals are not counted.
    pub counts: Count,
    /// For each state the variable of the bond graph that tells it: itself, or the co-energy variable of its storage.
    pub tracked: Vec<Symbol>,
    /// Sums of stored quantities that no jump of a source changes; speeds as [`tracked`](Equations::tracked) names them.
    pub momenta: Vec<Momentum>,
    /// Which variables could be independent in place of others, where divisors may vanish while running.
    pub exchanges: Exchanges,
    /// How storages change at events; none where no event changes them, and in forms that go by the minimal one there.
    pub jumps: Option<Jumps>,
    /// Rates that nothing defines.
    pub free_rates: BTreeSet<Symbol>,
    /// How few break variables open all loops, where the form has any.
    pub breaks: BreakBound,
    /// Form `inverted`: which storage was inverted for which path, and why no other.
    pub certificate: Option<Certificate>,
    /// Number of independent storages.
    pub dof: usize,
    /// What stays implicit: unknowns of the Newton blocks.
    pub implicit: Vec<Symbol>,
    /// What must hold of parameters that may change: where it does not, the equations are others.
    pub assumptions: Vec<Assumption>,
}

impl Equations {
    /// All unknowns: states, then algebraic ones.
    pub fn unknowns(&self) -> Vec<Symbol> {
        self.states.iter().map(|s| s.symbol).chain(self.algebraic.iter().map(|a| a.symbol)).collect()
    }

    /// Whether the rate of a state is free: an equation without an explicit rate determines it.
    pub fn is_free(&self, state: &State) -> bool {
        self.free_rates.contains(&state.rate)
    }

    /// The variable of the bond that carries the rate of the quantity stored behind a state, by its number.
    pub fn carried(&self, state: usize) -> Option<Symbol> {
        let (symbol, tracked) = (self.states[state].symbol, self.tracked[state]);
        let StateKind::Storage(Some(element)) = self.states[state].kind else { return None };
        let ports = (0..self.graph.elements[element].ports.len() as u32).map(|port| PortRef { element, port });
        let mut ports = ports.filter_map(|port| Some((port, self.graph.storage_symbols(port)?)));
        let stored = |port: PortRef| match &self.graph.elements[element].kind {
            Kind::Inertance(storage) | Kind::Compliance(storage) => storage.stored.get(port.port as usize).copied(),
            _ => None,
        };
        ports.find(|(port, (z, _))| *z == tracked || stored(*port) == Some(symbol)).map(|(_, (_, rate))| rate)
    }
}

/// A state.
#[derive(Debug, Clone)]
pub struct State {
    /// Its symbol.
    pub symbol: Symbol,
    /// The symbol of its rate, which a step defines.
    pub rate: Symbol,
    /// Its name: `m.f`, `C.q`, `phi`.
    pub name: String,
    /// Whether it belongs to the graph or to a signal.
    pub kind: StateKind,
    /// SI unit, where known.
    pub unit: Option<Unit>,
    /// Where it comes from.
    pub span: Span,
}

/// A position that a constraint on displacements determines: in place of a state.
#[derive(Debug, Clone)]
pub struct Position {
    /// Its symbol, which a step defines.
    pub symbol: Symbol,
    /// Its name: `spring.q`, `phi`.
    pub name: String,
    /// The constraint that defines it, by its place among those of the graph.
    pub constraint: usize,
    /// Its rate.
    pub rate: Expr,
    /// Whether an iteration finds it, which follows one of several solutions: that which the start has chosen.
    pub by_iteration: bool,
    /// SI unit, where known.
    pub unit: Option<Unit>,
    /// Where it comes from.
    pub span: Span,
}

/// Kinds of states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StateKind {
    /// State of a storage, or of a group of dependent storages.
    Storage(Option<ElementId>),
    /// An integrated signal.
    Signal,
}

/// An unknown without a rate.
#[derive(Debug, Clone)]
pub struct Algebraic {
    /// Its symbol.
    pub symbol: Symbol,
    /// The variable of the bond graph that it is.
    pub tracked: Symbol,
    /// Its name: `R1.e`, `ZCx.e`.
    pub name: String,
    /// What it is there for.
    pub cause: AlgebraicRole,
    /// SI unit, where known.
    pub unit: Option<Unit>,
}

/// What an algebraic unknown is there for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AlgebraicRole {
    /// It opens a loop of variables: the loop closes where the residual vanishes.
    Break,
    /// It is the law of an element that gives no value to what the element sets.
    Law(ElementId),
    /// It is what a constraint or a dependent storage takes: the residual is the relation that it keeps up.
    Multiplier(ElementId),
}

/// How many break variables there are, and whether fewer could do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BreakBound {
    /// How many there are.
    pub number: usize,
    /// Proven: so many are needed at least. Equal to `number` for all components up to 30 signals.
    pub at_least: usize,
}

/// A combination of stored quantities that no motion changes.
#[derive(Debug, Clone)]
pub struct Conserved {
    /// The symbol of its constant value.
    pub symbol: Symbol,
    /// Its name.
    pub name: String,
    /// What is conserved, in stored quantities.
    pub value: Expr,
    /// The variable of the graph that tells the state in whose place it stands.
    pub replaced: Symbol,
}

/// One step of an evaluation.
#[derive(Debug, Clone)]
pub enum EquationStep {
    /// `symbol = value`.
    Assign {
        /// What is defined.
        symbol: Symbol,
        /// Its value.
        value: Expr,
    },
    /// `matrix · unknowns = right`, solved by LU with pivoting; a vanishing pivot stops the run.
    Linear(Box<LinearBlock>),
    /// `residuals = 0`, solved by Newton from the previous solution (or `start`); divergence stops the run.
    Newton(Box<NewtonBlock>),
    /// `pivot` has been divided by: if it vanishes the run stops.
    Guard {
        /// The expression.
        pivot: Expr,
        /// The elements concerned, for messages.
        elements: Vec<ElementId>,
    },
}

/// Linear equations that are solved together: see [`EquationStep::Linear`].
#[derive(Debug, Clone)]
pub struct LinearBlock {
    /// What is defined.
    pub unknowns: Vec<Symbol>,
    /// The matrix.
    pub matrix: SparseMatrix<Expr>,
    /// Right-hand side.
    pub right: Vec<Expr>,
    /// The elements concerned, for messages.
    pub elements: Vec<ElementId>,
}

/// Equations that are solved together by iteration: see [`EquationStep::Newton`].
#[derive(Debug, Clone)]
pub struct NewtonBlock {
    /// What is defined.
    pub unknowns: Vec<Symbol>,
    /// Definitions inside the block, in order, which may read the unknowns.
    pub body: Vec<(Symbol, Expr)>,
    /// The residuals, as many as unknowns, in unknowns, body and what is defined before.
    pub residuals: Vec<Expr>,
    /// The elements concerned, for messages.
    pub elements: Vec<ElementId>,
}

impl From<LinearBlock> for EquationStep {
    fn from(block: LinearBlock) -> EquationStep {
        EquationStep::Linear(Box::new(block))
    }
}

impl From<NewtonBlock> for EquationStep {
    fn from(block: NewtonBlock) -> EquationStep {
        EquationStep::Newton(Box::new(block))
    }
}

/// A variable that can be recorded.
#[derive(Debug, Clone)]
pub struct Observed {
    /// Its name, as `--record` takes it.
    pub name: Arc<str>,
    /// Its value, or why it has none.
    pub value: Result<Expr, Unavailable>,
    /// SI unit, where known.
    pub unit: Option<Unit>,
    /// What it is.
    pub kind: ObservedKind,
    /// Whether it is recorded without being asked for: states and outputs.
    pub default: bool,
}

/// What a variable is that can be recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ObservedKind {
    /// An effort: of a bond, or that of a constraint.
    Effort,
    /// An effort without what a constraint at the rates puts on it: by these the junctions balance.
    Bare,
    /// A flow.
    Flow,
    /// What an inertance stores.
    Momentum,
    /// What a compliance stores.
    Displacement,
    /// A sum of stored quantities that is a state.
    Sum,
    /// The force of a spring in the place of a constraint.
    Spring,
    /// How far a constraint is from being met: it has no value but for errors.
    Drift,
    /// An integrated signal.
    Signal,
    /// An input.
    Input,
    /// An output or a `let`.
    Named,
}

/// Why a variable has no value; as small as what it stands in the place of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unavailable {
    /// The junction structure does not determine it.
    Undetermined,
    /// It needs the time derivative of this input.
    NeedsRateOf(Arc<String>),
    /// It needs the rate of this unknown, which the form does not have.
    NeedsRateOfUnknown(Arc<String>),
    /// It needs a rate that is only defined through itself.
    Unsolvable,
}

impl std::fmt::Display for Unavailable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Unavailable::Undetermined => f.write_str("the junction structure does not determine it"),
            Unavailable::NeedsRateOf(input) => write!(f, "it needs the time derivative of the input {input}"),
            Unavailable::NeedsRateOfUnknown(unknown) => {
                write!(f, "it needs the rate of {unknown}, an algebraic unknown of this form")
            }
            Unavailable::Unsolvable => f.write_str("it needs a rate that is only defined through itself"),
        }
    }
}

/// A start value: `residual = 0` at the start.
#[derive(Debug, Clone)]
pub struct InitialCondition {
    /// In symbols that the steps define, states and parameters.
    pub residual: Expr,
    /// The variable it is about, as shown: `I1.f`.
    pub name: String,
    /// The value asked for.
    pub value: Expr,
    /// It is a constraint: it holds whatever start values are given.
    pub firm: bool,
    /// Nobody asked for it: freedom that remains is to be zero. It gives way to what is given.
    pub weak: bool,
    /// Where it stands.
    pub span: Span,
}

/// Where the search of the start begins for something: where `residual` is 0. It never has to be.
#[derive(Debug, Clone)]
pub struct Guess {
    /// What is guessed less its guess, in symbols that the steps define, states and parameters.
    pub residual: Expr,
    /// What is guessed, as shown: `spring.q`.
    pub name: String,
    /// The guess.
    pub value: Expr,
    /// Where it stands.
    pub span: Span,
}

/// What must hold for a law to have a value.
#[derive(Debug, Clone)]
pub struct LawDomain {
    /// The variable that the law gives.
    pub symbol: Symbol,
    /// The elements concerned.
    pub elements: Vec<ElementId>,
    /// What must lie in the domain.
    pub argument: Expr,
    /// Where it must lie.
    pub kind: DomainKind,
    /// The only variable that it reads, if there is just one.
    pub asked: Option<Symbol>,
    /// The value of that variable at which the domain ends, in parameters, where it can be written down.
    pub limit: Option<Expr>,
}

/// Where an argument must lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DomainKind {
    /// Above zero.
    Positive,
    /// Not below zero.
    NotNegative,
    /// Between two numbers, themselves included.
    Within(f64, f64),
}

impl DomainKind {
    /// Whether a number lies in it.
    pub fn holds(self, argument: f64) -> bool {
        match self {
            DomainKind::Positive => argument > 0.0,
            DomainKind::NotNegative => argument >= 0.0,
            DomainKind::Within(low, high) => low <= argument && argument <= high,
        }
    }
}
