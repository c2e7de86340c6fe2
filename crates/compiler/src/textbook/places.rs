//! Where symbols stand in printed equations, so that they read as people write them.

use std::collections::BTreeMap;

use super::Shown;
use crate::algebra::{Expr, Place, Sort, Symbol};
use crate::bond_graph::{BondGraph, Kind, Meaning, ResistorLaw, StorageLaw};
use crate::equations::StateKind;

/// The places of all symbols.
///
/// Factors: weights and other values of sources before laws of elements before moduli, `M g a cos φ`; in each the
/// parameters in the order in which they are declared. Terms: parameters as declared, states in the order of the model.
pub fn of(shown: &Shown) -> BTreeMap<Symbol, Place> {
    let equations = &shown.equations;
    let graph = &equations.graph;
    let uses = uses(graph);
    let mut places = BTreeMap::new();
    let place = |sort, family, index| Place { sort, family, factor: index, term: index };
    for (&symbol, variable) in &graph.variables {
        let own = match variable.meaning {
            Meaning::Parameter(id) => {
                place(Sort::Parameter, uses.get(&symbol).copied().unwrap_or_default().family(), id.0)
            }
            Meaning::Time | Meaning::Input(_) => place(Sort::Given, 1, symbol.0),
            _ => place(Sort::Variable, 2, symbol.0),
        };
        places.insert(symbol, own);
    }
    for (&(symbol, _), index) in shown.sources.iter().zip(0..) {
        let sort = if graph.variables.contains_key(&symbol) { Sort::Given } else { Sort::Variable };
        places.insert(symbol, place(sort, 0, index));
    }
    for (definition, index) in shown.definitions.iter().zip(0..) {
        let given = |s: Symbol| places.get(&s).is_some_and(|place: &Place| place.sort == Sort::Parameter);
        let constant = equations.graph.exprs.symbols_of(definition.value).into_iter().all(given);
        let sort = if constant { Sort::Parameter } else { Sort::Variable };
        places.insert(definition.symbol, place(sort, 4, u32::MAX / 4 + index));
    }
    for (conserved, index) in equations.conserved.iter().zip(0..) {
        places.insert(conserved.symbol, place(Sort::Parameter, 4, u32::MAX / 2 + index));
    }
    for (state, index) in equations.states.iter().zip(0..) {
        // Among factors signals first, which stand for moduli as parameters do.
        let family = u8::from(state.kind != StateKind::Signal);
        places.insert(state.symbol, place(Sort::Variable, family, index));
        places.insert(state.rate, place(Sort::Rate, family, index));
    }
    places
}

/// Where a parameter stands in the model.
#[derive(Debug, Clone, Copy, Default)]
struct Use {
    source: bool,
    element: bool,
}

impl Use {
    fn family(self) -> u8 {
        match (self.source, self.element) {
            (true, true) => 0,
            (true, false) => 1,
            (false, true) => 2,
            (false, false) => 3,
        }
    }
}

fn uses(graph: &BondGraph) -> BTreeMap<Symbol, Use> {
    let mut uses: BTreeMap<Symbol, Use> = BTreeMap::new();
    let mut note = |e: Expr, source: bool| {
        for symbol in graph.exprs.symbols_of(e) {
            let entry = uses.entry(symbol).or_default();
            *if source { &mut entry.source } else { &mut entry.element } = true;
        }
    };
    for element in graph.elements.values() {
        match &element.kind {
            Kind::EffortSource { value } | Kind::FlowSource { value } => note(*value, true),
            Kind::Inertance(storage) | Kind::Compliance(storage) => {
                for law in &storage.laws {
                    match *law {
                        StorageLaw::Integral(e) | StorageLaw::Derivative(e) | StorageLaw::Implicit(e) => note(e, false),
                        StorageLaw::Known { law, .. } => note(law, false),
                    }
                }
            }
            Kind::Resistor(laws) | Kind::SkewGyrator(laws) => {
                for law in laws {
                    match *law {
                        ResistorLaw::Resistive(e) | ResistorLaw::Conductive(e) | ResistorLaw::Implicit(e) => {
                            note(e, false);
                        }
                    }
                }
            }
            _ => {}
        }
    }
    uses
}
