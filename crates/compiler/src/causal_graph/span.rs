//! What the co-energy variables of storages and imposed variables span: whether a motion follows from them.
//!
//! Which variables stand in a row tells that, not their coefficients: values in a prime field do (up to a probability of 2^-60)
//! where they decide what is zero, and no expression is made.

use std::collections::BTreeMap;

use smallvec::SmallVec;

use super::ports::{Solved, Virtual};
use super::{Combination, Ports, Role};
use crate::algebra::{Coefficients, Exprs, PrimeField, Residues, Symbol, Zero};
use crate::bond_graph::{BondGraph, Kind};
use crate::ids::Map;

/// What co-energy variables and imposed variables span.
pub(super) struct Span<'a> {
    graph: &'a BondGraph,
    ports: Ports,
    /// Roles of ports by the variables that they are given.
    roles: BTreeMap<Symbol, Role>,
    /// Variables over what elements give.
    known: Map<Symbol, Combination>,
    /// The same with coefficients in the prime field; `None` where these do not decide.
    residues: Map<Symbol, Option<Row>>,
}

type Row = SmallVec<[(Symbol, Residues); 4]>;

impl<'a> Span<'a> {
    pub fn of(graph: &'a BondGraph, solved: &Solved) -> Span<'a> {
        Span {
            graph,
            ports: Ports { definitions: solved.definitions.iter().cloned().collect(), ..Ports::default() },
            roles: solved.ports.iter().map(|p| (p.input, p.role)).collect(),
            known: Map::new(),
            residues: Map::new(),
        }
    }

    /// Whether the common variable of a junction is a combination of them, not of imposed variables alone.
    pub fn holds(&mut self, x: &mut Exprs, speed: &Virtual) -> bool {
        let junction = &self.graph.elements[speed.junction];
        let bond = &self.graph.bonds[junction.ports[0].bond];
        let common = if matches!(junction.kind, Kind::One) { bond.flow } else { bond.effort };
        let read = self.inputs_of(x, common);
        let roles: Option<Vec<Role>> = read.iter().map(|s| self.roles.get(s).copied()).collect();
        let spanning = |role: &Role| matches!(role, Role::Independent | Role::Source | Role::Redundant);
        roles.is_some_and(|roles| roles.iter().all(spanning) && roles.contains(&Role::Independent))
    }

    /// What elements give of which a variable is made.
    fn inputs_of(&mut self, x: &mut Exprs, symbol: Symbol) -> Vec<Symbol> {
        let mut open = vec![symbol];
        while let Some((next, definition)) = self.ports.next_to_resolve(&mut open, |s| self.residues.contains_key(s)) {
            let row = put_in(x, definition, &self.residues);
            self.residues.insert(next, row);
        }
        match self.residues.get(&symbol) {
            Some(Some(row)) => row.iter().map(|t| t.0).collect(),
            Some(None) => self.ports.resolve(x, symbol, &mut self.known).0.iter().map(|t| t.0).collect(),
            None => vec![symbol],
        }
    }
}

/// A definition over what elements give, without terms that are zero; `None` where the prime field does not tell.
fn put_in(x: &Exprs, definition: &Combination, known: &Map<Symbol, Option<Row>>) -> Option<Row> {
    let mut field = PrimeField;
    let mut sum: BTreeMap<Symbol, Residues> = BTreeMap::new();
    for &(symbol, coefficient) in &definition.0 {
        let factor = x.residues(coefficient)?;
        let own: Row = SmallVec::from_slice(&[(symbol, PrimeField::ONE)]);
        let row = match known.get(&symbol) {
            Some(row) => row.as_ref()?,
            None => &own,
        };
        for &(symbol, e) in row {
            let term = field.times(factor, e);
            let entry = sum.entry(symbol);
            entry.and_modify(|sum| *sum = field.plus(*sum, term)).or_insert(term);
        }
    }
    Some(sum.into_iter().filter(|t| field.zero(t.1) != Zero::Always).collect())
}
