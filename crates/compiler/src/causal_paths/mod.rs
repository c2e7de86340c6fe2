//! Zero-order causal paths: found along the strokes, classed, with gain, break variables and components.
//! Source: `method.md`, section 3.

use crate::algebra::{Expr, Symbol};
use crate::bond_graph::{BondId, ElementId, PortRef};

/// All that is known about the zero-order causal paths of a graph.
#[derive(Debug, Clone)]
pub struct CausalPaths {
    /// The paths, by class, then in the order of the graph.
    pub paths: Vec<Path>,
    /// Whether `paths` holds every simple path; if not, one for every break variable.
    pub complete: bool,
    /// The strongly connected components of the algebraic signals (classes 2 to 4).
    pub components: Vec<Component>,
    /// Storages drawn in derivative causality, each with the multiplier that the classical form adds for it.
    pub dependent: Vec<PortRef>,
    /// The pool that holds gains and determinants.
    pub exprs: crate::algebra::Exprs,
}

/// One zero-order causal path.
#[derive(Debug, Clone)]
pub struct Path {
    /// 1 to 4, `method.md`, section 3.
    pub class: u8,
    /// What it runs between: storages (1), resistors (2, 3), junctions of the loop in order (4).
    pub elements: Vec<ElementId>,
    /// All elements that it meets, in order.
    pub route: Vec<ElementId>,
    /// The bonds in order, each with the variable that the path follows.
    pub signals: Vec<(BondId, Symbol)>,
    /// The loop gain.
    pub gain: Expr,
    /// The break variables of the minimum set that lie on it.
    pub breaks: Vec<Symbol>,
    /// Index into [`CausalPaths::components`] (classes 2 to 4).
    pub component: Option<usize>,
}

/// A strongly connected set of algebraic signals.
#[derive(Debug, Clone)]
pub struct Component {
    /// The signals, in the order of the graph.
    pub signals: Vec<Symbol>,
    /// A minimum set of break variables.
    pub breaks: Vec<Symbol>,
    /// Whether `breaks` is proven minimum; else `lower_bound` says how many are needed at least.
    pub exact: bool,
    /// A proven lower bound on the number of break variables.
    pub lower_bound: usize,
    /// The determinant of the component (Mason): product and sum of loop gains, 1 if there were no loop.
    pub determinant: Option<Expr>,
    /// Whether the determinant vanishes for all parameters, or at the given ones: the loop alone is singular.
    pub singular: bool,
}
