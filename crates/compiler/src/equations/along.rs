//! Forms that keep all storages: what defines every variable along the drawn strokes, or in the solved structure, and
//! which unknowns are left. Source: `method.md`, sections 3 and 4.

use super::definitions::{Definition, Definitions};
use super::minimal::{Assembled, Cell, Chosen, Later, variables_of_laws};
use super::{AlgebraicRole, StateKind, Unavailable};
use crate::algebra::{Expr, Symbol};
use crate::bond_graph::{Kind, PortRef};
use crate::causal_graph::{CausalGraph, Role};

/// What becomes of a storage in derivative causality.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Treatment {
    /// It integrates like the others; what its bond carries is a multiplier that keeps up its relation to them.
    Multiplier,
    /// Its rate is left free: it is a break variable, and the relation of the storage to the others the equation.
    Free,
    /// It is no unknown: it follows from the others, its rate by differentiation.
    Eliminated,
}

/// An unknown without a rate, and what vanishes for its sake.
#[derive(Debug, Clone, Copy)]
pub struct Closure {
    /// The unknown; `None` where a free rate of a state takes its place.
    pub unknown: Option<(Symbol, AlgebraicRole)>,
    /// What vanishes.
    pub residual: Expr,
}

/// Writes down what defines every variable, with every storage that `treat` does not eliminate as a state. Independent
/// variables without a storage are unknowns, or if `speeds` is `Free` states with a free rate.
pub fn assemble_all<'a>(
    causal: &'a CausalGraph,
    treat: &dyn Fn(PortRef) -> Treatment,
    speeds: Treatment,
) -> Result<(Assembled<'a>, Vec<Closure>), (Symbol, Unavailable)> {
    let graph = &causal.graph;
    let mut d = Definitions::new(graph.exprs.clone(), graph);
    for &symbol in &causal.ports.undetermined {
        d.missing.insert(symbol, Unavailable::Undetermined);
    }
    d.of_laws = variables_of_laws(causal);
    for (&symbol, row) in &causal.ports.definitions {
        let value = row.expr(&mut d.x);
        d.set(symbol, value);
    }
    let mut assembled = Assembled::empty(d);
    assembled.imposed_and_algebraic(causal);
    let mut closures = assembled.all_storages(causal, treat);
    closures.extend(assembled.virtual_speeds(causal, speeds));
    assembled.signals();
    assembled.rates()?;
    assembled.d.define_user_rates();
    Ok((assembled, closures))
}

impl<'a> Assembled<'a> {
    fn all_storages(&mut self, causal: &'a CausalGraph, treat: &dyn Fn(PortRef) -> Treatment) -> Vec<Closure> {
        let cells: Vec<Cell<'a>> = causal.ports.ports.iter().filter_map(|state| self.cell(causal, state)).collect();
        for cell in &cells {
            self.d.stored.insert(cell.stored, cell.rate);
        }
        let mut closures = Vec::new();
        for cell in &cells {
            match (cell.state.role, treat(cell.state.port)) {
                (Role::Independent, _) => self.independent(cell),
                (_, Treatment::Eliminated) if self.eliminate_storage(cell) => {}
                (_, Treatment::Multiplier) => closures.extend(self.with_multiplier(cell)),
                _ => closures.extend(self.with_free_rate(cell)),
            }
        }
        self.sort_states();
        closures
    }

    /// A storage that follows from others; `false` if its stored quantity cannot be written down.
    fn eliminate_storage(&mut self, cell: &Cell) -> bool {
        let Some(stored) = self.stored_of(cell) else { return false };
        self.d.set(cell.stored, stored);
        self.later.push(Later::Dependent { rate: cell.rate, stored: cell.stored });
        true
    }

    /// Takes away what the structure says of the storage's co-energy variable; it becomes what vanishes.
    fn relation(&mut self, cell: &Cell) -> Option<Expr> {
        let structure = self.d.of.remove(&cell.z)?.expr();
        let own = self.d.x.sym(cell.z);
        Some(self.d.x.sub(own, structure))
    }

    fn with_multiplier(&mut self, cell: &Cell) -> Option<Closure> {
        let residual = self.relation(cell)?;
        self.independent(cell);
        if self.d.states.contains_key(&cell.stored) {
            // The rate of the stored quantity is the multiplier itself; the state gets a rate of its own name.
            let rate = self.d.rate_symbol(cell.stored);
            self.d.states.insert(cell.stored, rate);
            let multiplier = self.d.x.sym(cell.rate);
            self.d.set(rate, multiplier);
        }
        let element = cell.state.port.element;
        self.d.free.insert(cell.rate);
        Some(Closure { unknown: Some((cell.rate, AlgebraicRole::Multiplier(element))), residual })
    }

    fn with_free_rate(&mut self, cell: &Cell) -> Option<Closure> {
        let residual = self.relation(cell)?;
        self.independent(cell);
        // By its speed: the bond carries the rate of the stored quantity, whatever the rate of the speed is.
        if let Some(Later::Speed { stored, bond, .. }) = self.later.pop_if(|l| l.is_speed_of(cell.z)) {
            self.later.push(Later::Free { stored, bond });
        }
        self.d.free.insert(self.d.states.get(&cell.z).copied().unwrap_or(cell.rate));
        Some(Closure { unknown: None, residual })
    }

    /// Independent variables without a storage: they, or their rates, are unknown, and their reactions vanish.
    fn virtual_speeds(&mut self, causal: &CausalGraph, treatment: Treatment) -> Vec<Closure> {
        let mut closures = Vec::new();
        for v in &causal.ports.virtual_speeds {
            let residual = self.d.x.sym(v.reaction);
            let unknown = if treatment == Treatment::Free {
                let rate = self.d.state(v.speed);
                self.d.free.insert(rate);
                let kind = StateKind::Storage(Some(v.junction));
                self.states.push(Chosen { symbol: v.speed, kind, meaning: None, tracked: v.speed });
                None
            } else {
                self.d.free.insert(v.speed);
                Some((v.speed, AlgebraicRole::Multiplier(v.junction)))
            };
            closures.push(Closure { unknown, residual });
        }
        self.sort_states();
        closures
    }

    /// Laws that give no value to what their element sets: that is an unknown.
    pub fn open_laws(&mut self, causal: &CausalGraph) -> Vec<Closure> {
        self.open(causal, |_| true)
    }

    /// Constraints: what they carry is an unknown.
    pub fn open_constraints(&mut self, causal: &CausalGraph) -> Vec<Closure> {
        self.open(causal, |kind| !matches!(kind, Kind::Resistor(_)))
    }

    fn open(&mut self, causal: &CausalGraph, test: impl Fn(&Kind) -> bool) -> Vec<Closure> {
        let mut closures = Vec::new();
        for state in causal.ports.ports.iter().filter(|p| matches!(p.role, Role::Algebraic(_))) {
            let element = state.port.element;
            let kind = &causal.graph.elements[element].kind;
            if let Some(Definition::Implicit(residual)) = self.d.of.get(&state.input).copied()
                && test(kind)
            {
                self.d.of.remove(&state.input);
                self.d.free.insert(state.input);
                let law = matches!(kind, Kind::Resistor(_));
                let cause = if law { AlgebraicRole::Law(element) } else { AlgebraicRole::Multiplier(element) };
                closures.push(Closure { unknown: Some((state.input, cause)), residual });
            }
        }
        closures
    }
}
