//! The equations of a bond graph in one of its forms, in the order in which they are evaluated.

mod blocks;
mod conserved;
mod definitions;
mod derive;
mod display;
mod minimal;
mod observed;
mod text;

use crate::algebra::{Expr, Symbol};
use crate::bond_graph::{BondGraph, ElementId};
use crate::ids::Map;
use crate::span::Span;
use crate::unit::Unit;

pub use blocks::LinearRow;
pub use definitions::Definition;
pub use derive::derive_equations;
pub use display::{Dependent, DisplayEquation, Shown, show};
pub use text::{Style, print, print_dependent, print_expr, print_meanings, print_symbol};

/// A formulation, `method.md`, section 4.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Form {
    /// One explicit ODE per degree of freedom, nothing else.
    Minimal,
}

/// Equations in evaluation order.
///
/// Given time, inputs, held signals, parameters, conserved constants and states, the steps define one symbol after the
/// other; a step reads only what is given or defined before it. The rates of the states and all observed variables are
/// among the symbols so defined. Steps that a caller does not need (say, reactions while integrating) can be left out.
#[derive(Debug, Clone)]
pub struct Equations {
    /// The form.
    pub form: Form,
    /// The graph; its pool holds the expressions of this stage too.
    pub graph: BondGraph,
    /// The states, in order.
    pub states: Vec<State>,
    /// Quantities that stay at their start value, each in place of a state.
    pub conserved: Vec<Conserved>,
    /// The steps.
    pub steps: Vec<Step>,
    /// What can be recorded: every effort, flow, `q`, `p` under element names, junction variables, signals, lets and outputs.
    pub observed: Vec<Observed>,
    /// What the start of the run has to satisfy.
    pub conditions: Vec<Condition>,
    /// What defines each variable, before loops were opened.
    pub definitions: Map<Symbol, Definition>,
    /// The rows of all linear loops.
    pub rows: Vec<LinearRow>,
    /// Co-energy variables of the storages that depend on others.
    pub dependent: Vec<Symbol>,
    /// What a state is that is no variable of its own (`pi = X + S^T X_d`), in stored quantities.
    pub meanings: Vec<(Symbol, Expr)>,
    /// Differentiation index of what is left, 0 for an explicit ODE.
    pub index: u8,
    /// Number of independent storages.
    pub dof: usize,
    /// What stays implicit: unknowns of the Newton blocks.
    pub implicit: Vec<Symbol>,
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

/// Kinds of states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StateKind {
    /// State of a storage, or of a group of dependent storages.
    Storage(Option<ElementId>),
    /// An integrated signal.
    Signal,
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
}

/// One step of an evaluation.
#[derive(Debug, Clone)]
pub enum Step {
    /// `symbol = value`.
    Assign {
        /// What is defined.
        symbol: Symbol,
        /// Its value.
        value: Expr,
    },
    /// `matrix · unknowns = right`, solved by LU with pivoting; a vanishing pivot stops the run.
    Linear {
        /// What is defined.
        unknowns: Vec<Symbol>,
        /// Row by row.
        matrix: Vec<Vec<Expr>>,
        /// Right-hand side.
        right: Vec<Expr>,
        /// The elements concerned, for messages.
        elements: Vec<ElementId>,
    },
    /// `residuals = 0`, solved by Newton from the previous solution (or `start`); divergence stops the run.
    Newton {
        /// What is defined.
        unknowns: Vec<Symbol>,
        /// Definitions inside the block, in order, which may read the unknowns.
        body: Vec<(Symbol, Expr)>,
        /// The residuals, as many as unknowns, in unknowns, body and what is defined before.
        residuals: Vec<Expr>,
        /// The elements concerned, for messages.
        elements: Vec<ElementId>,
    },
    /// `pivot` has been divided by: if it vanishes the run stops.
    Watch {
        /// The expression.
        pivot: Expr,
        /// The elements concerned, for messages.
        elements: Vec<ElementId>,
    },
}

/// A variable that can be recorded.
#[derive(Debug, Clone)]
pub struct Observed {
    /// Its name, as `--record` takes it.
    pub name: String,
    /// Its value, or why it has none.
    pub value: Result<Expr, Unavailable>,
    /// SI unit, where known.
    pub unit: Option<Unit>,
    /// Whether it is recorded without being asked for: states and outputs.
    pub default: bool,
}

/// Why a variable has no value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unavailable {
    /// The junction structure does not determine it.
    Undetermined,
    /// It needs the time derivative of this input.
    NeedsRateOf(String),
    /// It needs a rate that is only defined through itself.
    Unsolvable,
}

impl std::fmt::Display for Unavailable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Unavailable::Undetermined => f.write_str("the junction structure does not determine it"),
            Unavailable::NeedsRateOf(input) => write!(f, "it needs the time derivative of the input {input}"),
            Unavailable::Unsolvable => f.write_str("it needs a rate that is only defined through itself"),
        }
    }
}

/// A start value: `residual = 0` at the start.
#[derive(Debug, Clone)]
pub struct Condition {
    /// In symbols that the steps define, states and parameters.
    pub residual: Expr,
    /// The variable it is about, as shown: `I1.f`.
    pub name: String,
    /// The value asked for.
    pub value: Expr,
    /// Where it stands.
    pub span: Span,
}
