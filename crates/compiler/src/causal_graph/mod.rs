//! The causal graph: a bond graph in which every port has its causality.
//!
//! Two layers, kept apart because they can differ (`method.md`, section 2): what is *true* of the ports, found by exact
//! elimination ([`Ports`]), and what is *drawn* on the bonds, the strokes, along which causal paths are read.

pub mod break_set;
pub mod signals;

use std::collections::BTreeMap;

use crate::algebra::{Expr, Symbol};
use crate::bond_graph::{BondGraph, BondId, PortCausality, PortRef};
use crate::ids::Table;

/// Where the causal stroke of a bond sits: at the end that the effort runs towards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stroke {
    /// At the end where the bond starts.
    From,
    /// At the end where the half arrow is.
    To,
    /// Nowhere: effort and flow of this bond are not determined (a circulating flow), all ports are.
    Undetermined,
}

/// A bond graph with its causality.
///
/// Invariant: one bond sets the effort of each 0-junction, one the flow of each 1-junction, unless some of its strokes
/// are `Undetermined`.
#[derive(Debug, Clone)]
pub struct CausalGraph {
    /// The graph; its pool holds the expressions of this stage too.
    pub graph: BondGraph,
    /// The stroke of every bond.
    pub strokes: Table<BondId, Stroke>,
    /// The exact relations of the junction structure.
    pub ports: Ports,
}

/// The junction structure in input-output form: every port has one variable as input and its conjugate as output, and
/// every variable of every determined bond is a linear combination of inputs. Source: `method.md`, 5.1.
#[derive(Debug, Clone, Default)]
pub struct Ports {
    /// The ports in order of their elements, each with its input, the priority class and the truth about it.
    pub ports: Vec<PortState>,
    /// Definitions of variables by other variables, triangular: following them ends at inputs.
    pub definitions: BTreeMap<Symbol, Combination>,
    /// Expressions that were divided by and are not known to be nonzero: they are watched while running.
    pub watched: Vec<Expr>,
    /// Expressions that vanish at the given parameters only.
    pub degenerate: Vec<Expr>,
    /// Variables (bond efforts or flows) that the junction structure leaves undetermined.
    pub undetermined: Vec<Symbol>,
}

/// One port and its causality.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortState {
    /// The port.
    pub port: PortRef,
    /// What the port is to the junction structure.
    pub role: Role,
    /// The variable that the element gives.
    pub input: Symbol,
    /// Its conjugate, which the junction structure gives.
    pub output: Symbol,
}

/// What a port is to the junction structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// It has its variable imposed from outside.
    Source,
    /// A source or constraint that repeats what others impose: its own reaction is undetermined.
    Redundant,
    /// A storage whose co-energy variable is independent.
    Independent,
    /// A storage whose co-energy variable follows from others.
    Dependent,
    /// An algebraic law, with the causality that the equations use.
    Algebraic(PortCausality),
}

/// A linear combination of variables: sorted by symbol, no zero coefficient.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Combination(pub Vec<(Symbol, Expr)>);
