//! What derivative causality says about a linear graph: the rank of its state matrix.

use super::ports::{Wishes, solve_part};
use super::strokes::parts;
use super::{CausalGraph, PortState, Role};
use crate::algebra::{Expr, Exprs, Symbol};
use crate::bond_graph::{BondGraph, Kind, Meaning, PortRef, ResistorLaw, StorageLaw};

/// Rank of the state matrix `A` of a linear graph, read from causality: the number of independent storages less that of
/// the storages that stay in integral causality when derivative causality is preferred. The graph has a solution at rest
/// for every constant input, and `A` has no eigenvalue zero, exactly if no storage stays. Source: \[SD\].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StateRank {
    /// Number of independent storages, the order of `A`.
    pub order: usize,
    /// Rank of `A` at the given parameters.
    pub rank: usize,
    /// The storages that stay in integral causality, in the order of the graph.
    pub integral: Vec<PortRef>,
}

/// The rank of the state matrix; `None` if a law is not linear, or a modulus or value reads what varies with the state.
pub fn state_rank(causal: &CausalGraph) -> Option<StateRank> {
    let graph = &causal.graph;
    let mut x = graph.exprs.clone();
    if !is_linear(&mut x, graph) {
        return None;
    }
    let independent = causal.ports.ports.iter().filter(|p| p.role == Role::Independent).count();
    let order = independent + causal.ports.virtual_speeds.len();
    let mut integral = Vec::new();
    for members in parts(graph) {
        let wishes = Wishes { derivative_first: true, ..Wishes::default() };
        let solved = solve_part(&mut x, graph, &members, &wishes);
        let stays = |p: &&PortState| p.role == Role::Dependent;
        integral.extend(solved.ports.iter().filter(stays).map(|p| p.port));
    }
    integral.sort_unstable();
    Some(StateRank { order, rank: order.saturating_sub(integral.len()), integral })
}

/// Whether all laws are linear with constant coefficients, and sources and moduli read no variable of the graph.
fn is_linear(x: &mut Exprs, graph: &BondGraph) -> bool {
    let constant = |x: &Exprs, e: Expr| {
        let parameter = |s: Symbol| matches!(graph.variables.get(&s).map(|v| v.meaning), Some(Meaning::Parameter(_)));
        x.symbols_of(e).into_iter().all(parameter)
    };
    let outside = |x: &Exprs, e: Expr| {
        let given = |s: Symbol| {
            let meaning = graph.variables.get(&s).map(|v| v.meaning);
            matches!(meaning, Some(Meaning::Parameter(_) | Meaning::Time | Meaning::Input(_)))
        };
        x.symbols_of(e).into_iter().all(given)
    };
    graph.elements.values().all(|element| {
        let bonds = element.ports.iter().map(|p| &graph.bonds[p.bond]);
        let mut variables: Vec<Symbol> = bonds.flat_map(|b| [b.effort, b.flow]).collect();
        let laws: Vec<Expr> = match &element.kind {
            Kind::Transformer { modulus } | Kind::Gyrator { modulus } => return constant(x, *modulus),
            Kind::EffortSource { value } | Kind::FlowSource { value } => return outside(x, *value),
            Kind::ZeroCompliance { flow } => return outside(x, *flow),
            Kind::Resistor(laws) => laws
                .iter()
                .map(|law| match *law {
                    ResistorLaw::Resistive(e) | ResistorLaw::Conductive(e) | ResistorLaw::Implicit(e) => e,
                })
                .collect(),
            Kind::Inertance(storage) | Kind::Compliance(storage) => {
                variables.extend(&storage.stored);
                let known = storage.laws.iter().any(|l| matches!(l, StorageLaw::Known { .. }));
                if known {
                    return false;
                }
                storage
                    .laws
                    .iter()
                    .map(|law| match *law {
                        StorageLaw::Integral(e) | StorageLaw::Derivative(e) | StorageLaw::Implicit(e) => e,
                        StorageLaw::Known { law, .. } => law,
                    })
                    .collect()
            }
            Kind::ResidualEffort { residual } | Kind::ResidualFlow { residual } => residual.iter().copied().collect(),
            _ => Vec::new(),
        };
        laws.into_iter().all(|law| match x.linear_in(law, &variables) {
            Some((coefficients, rest)) => coefficients.into_iter().chain([rest]).all(|e| constant(x, e)),
            None => false,
        })
    })
}
