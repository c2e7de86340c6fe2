//! The causal graph: a bond graph in which every port has its causality.
//!
//! Two layers, kept apart because they can differ (`method.md`, section 2): what is *true* of the ports, found by exact
//! elimination ([`Ports`]), and what is *drawn* on the bonds, the strokes, along which causal paths are read.

mod assign;
pub mod break_set;
mod by_size;
mod carried;
mod contradiction;
mod digits;
mod drawn;
mod local;
mod matched;
mod modes;
mod ports;
mod rank;
mod repeated;
mod roles;
mod rules;
mod shares;
pub mod signals;
pub(crate) mod start_point;
mod strokes;
mod text;
mod two_ports;
mod verify;

use std::collections::BTreeMap;

use smallvec::{SmallVec, smallvec};

use crate::algebra::{Expr, Exprs, ONE, Symbol};
use crate::bond_graph::{BondGraph, BondId, PortCausality, PortRef};
use crate::ids::{Map, Table};

pub use assign::assign_causality;
pub use carried::{reading_shares, shares};
pub use contradiction::warnings;
pub(crate) use digits::{magnitude_of_slope, vanishes};
pub use drawn::{as_drawn, by_hand, resistors_first, without_constraints};
pub use modes::in_first_mode;
pub use ports::Virtual;
pub(crate) use ports::{circuits, imposes_effort, rank_given};
pub use rank::{Reach, StateRank, control_reach, observe_reach, state_rank};
pub use rules::{in_order, kept_in, kept_junctions};
pub use shares::{SharedReactions, shared_reactions};
pub use verify::verify;

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
/// Invariants (see [`verify`]): one bond sets the effort of each 0-junction, one the flow of each 1-junction, unless some
/// of its strokes are `Undetermined`, or its variable is independent without a storage ([`Ports::virtual_speeds`]): then
/// it is given from outside, as by a source, and no bond sets it.
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
    /// The ports in order of their elements, each with its input and its role, which is exact.
    pub ports: Vec<PortState>,
    /// Definitions of variables by other variables, triangular: substituted in turn they end at inputs.
    pub definitions: Map<Symbol, Combination>,
    /// Loops among these definitions, as the elements write them.
    pub loops: Vec<LoopRows>,
    /// Divisors that are not known to be nonzero: they are guarded during a run.
    pub watched: Vec<Expr>,
    /// Expressions that vanish at the given parameters only.
    pub degenerate: Vec<Expr>,
    /// Variables (bond efforts or flows) that the junction structure leaves undetermined.
    pub undetermined: Vec<Symbol>,
    /// Constraints on displacements that others keep wherever the machine can be, by their numbers: they carry nothing.
    pub repeated: Vec<usize>,
    /// Independent variables that sit on no storage, `method.md`, 5.2.
    pub virtual_speeds: Vec<Virtual>,
    /// Why variables have priority as independent ones over the order of the model.
    pub kept: BTreeMap<Symbol, Kept>,
    /// The entries of [`BondGraph::preferences`] that could not be met, by their numbers.
    pub unmet: Vec<usize>,
    /// Relations among imposed variables alone that the structure implies; they hold, or there would have been an error.
    pub demands: Vec<Combination>,
}

/// A loop of the junction structure: each of its variables with a row in which it occurs, a sum that vanishes.
pub type LoopRows = Vec<(Symbol, Combination)>;

/// Why a variable has priority as an independent one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// The modeller prefers it.
    Preferred,
    /// Its integral occurs in a modulus.
    IntegralInModulus,
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
pub struct Combination(pub Terms);

/// Terms of a combination, two of them held in place.
pub type Terms = SmallVec<[(Symbol, Expr); 2]>;

impl Ports {
    /// The state of a port.
    pub fn of(&self, port: PortRef) -> Option<&PortState> {
        self.ports.binary_search_by_key(&port, |p| p.port).ok().map(|i| &self.ports[i])
    }

    /// A variable as a combination of inputs alone; `known` keeps what has been worked out.
    pub fn resolve(&self, x: &mut Exprs, symbol: Symbol, known: &mut Map<Symbol, Combination>) -> Combination {
        self.resolve_into(x, symbol, known);
        known.get(&symbol).cloned().unwrap_or_else(|| Combination::of(symbol, ONE))
    }

    /// Resolves a variable, and all variables in its definition, into combinations of inputs alone, stored in `known`. An
    /// input stays as it is.
    pub fn resolve_into(&self, x: &mut Exprs, symbol: Symbol, known: &mut Map<Symbol, Combination>) {
        let mut open = vec![symbol];
        while let Some((next, definition)) = self.next_to_resolve(&mut open, |s| known.contains_key(s)) {
            let flat = definition.substitute(x, |s| known.get(&s), &self.undetermined);
            known.insert(next, flat);
        }
    }

    /// An unresolved variable, among the open ones and those that their definitions lead to, whose definition reads resolved
    /// variables only; `None` if all are resolved.
    pub(crate) fn next_to_resolve(
        &self,
        open: &mut Vec<Symbol>,
        known: impl Fn(&Symbol) -> bool,
    ) -> Option<(Symbol, &Combination)> {
        // Depth can equal the length of a chain of bonds, so the recursion keeps its own stack.
        while let Some(&top) = open.last() {
            let Some(definition) = self.definitions.get(&top).filter(|_| !known(&top)) else {
                open.pop();
                continue;
            };
            let before = open.len();
            let missing = |s: &Symbol| self.definitions.contains_key(s) && !known(s);
            open.extend(definition.0.iter().map(|t| t.0).filter(missing));
            if open.len() == before {
                return Some((top, definition));
            }
        }
        None
    }
}

impl Combination {
    /// One term.
    pub fn of(symbol: Symbol, coefficient: Expr) -> Combination {
        Combination(smallvec![(symbol, coefficient)])
    }

    /// The combination as an expression.
    pub fn expr(&self, x: &mut Exprs) -> Expr {
        let terms: SmallVec<[Expr; 4]> = self
            .0
            .iter()
            .map(|&(s, c)| {
                let s = x.sym(s);
                x.mul(&[c, s])
            })
            .collect();
        x.add(&terms)
    }

    /// The coefficient of a symbol, if it occurs.
    pub fn coefficient(&self, symbol: Symbol) -> Option<Expr> {
        self.0.binary_search_by_key(&symbol, |t| t.0).ok().map(|i| self.0[i].1)
    }

    /// The combination with symbols replaced by those that they are aliases of, like terms collected.
    pub(crate) fn renamed(&self, x: &mut Exprs, other: &impl Fn(Symbol) -> Symbol) -> Combination {
        let mut sum = Sum::default();
        self.0.iter().for_each(|&(s, c)| sum.add(x, other(s), c));
        sum.combination()
    }

    /// The combination with known combinations substituted for their symbols.
    pub(crate) fn substitute<'k>(
        &self,
        x: &mut Exprs,
        known: impl Fn(Symbol) -> Option<&'k Combination>,
        undetermined: &[Symbol],
    ) -> Combination {
        if self.0.iter().all(|t| known(t.0).is_none()) {
            return self.clone();
        }
        if let [(only, coefficient)] = self.0[..]
            && x.is_number(coefficient).is_some_and(|n| n.is_one())
            && let Some(row) = known(only)
        {
            return row.clone();
        }
        let mut sum = Sum::default();
        for &(s, c) in &self.0 {
            let own = [(s, c)];
            let inner = known(s);
            for &(t, e) in inner.map_or(&own[..], |k| &k.0) {
                let product = if inner.is_some() { x.mul(&[c, e]) } else { e };
                sum.add(x, t, product);
            }
        }
        let mut sum = sum.combination();
        for (_, e) in &mut sum.0 {
            if x.is_number(*e).is_none() {
                *e = x.bounded(*e);
            }
        }
        sum.0.retain(|term| stays(x, *term, undetermined));
        sum
    }
}

/// Up to so many terms of a sum stand in a row.
const FEW: usize = 16;

/// A sum of terms, those of one symbol added up: few in a row, many in a tree.
#[derive(Default)]
struct Sum {
    few: Terms,
    many: BTreeMap<Symbol, Expr>,
}

impl Sum {
    fn add(&mut self, x: &mut Exprs, symbol: Symbol, term: Expr) {
        if self.few.len() == FEW {
            self.many.extend(self.few.drain(..));
        }
        if !self.many.is_empty() {
            let value = self.many.get(&symbol).map_or(term, |&old| x.add(&[old, term]));
            self.many.insert(symbol, value);
            return;
        }
        match self.few.binary_search_by_key(&symbol, |t| t.0) {
            Ok(at) => self.few[at].1 = x.add(&[self.few[at].1, term]),
            Err(at) => self.few.insert(at, (symbol, term)),
        }
    }

    fn combination(self) -> Combination {
        Combination(if self.many.is_empty() { self.few } else { self.many.into_iter().collect() })
    }
}

/// Whether a term of a combination stays: its coefficient does not vanish. One that vanishes only at the given parameters
/// is kept, except that of an undetermined variable.
pub(crate) fn stays(x: &mut Exprs, (symbol, coefficient): (Symbol, Expr), undetermined: &[Symbol]) -> bool {
    if undetermined.contains(&symbol) { !x.is_zero_given(coefficient) } else { !x.is_zero(coefficient) }
}

/// The size of an expression at the given parameters, every other symbol taken as 1.
pub(crate) fn magnitude(x: &Exprs, e: Expr) -> f64 {
    fn value(x: &Exprs, s: Symbol) -> f64 {
        x.facts(s).given.map_or(1.0, |g| x.eval(g, &mut |s| value(x, s)))
    }
    x.eval(e, &mut |s| value(x, s)).abs()
}

#[cfg(test)]
mod tests;
