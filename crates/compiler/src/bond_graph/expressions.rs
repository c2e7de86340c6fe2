//! The expressions of a graph, visited always in the same order.

use super::{BondGraph, Clause, ElementId, Kind, ResistorLaw, SetValuedLaw, Shape, Storage, StorageLaw, Trigger};
use crate::algebra::{Expr, Exprs};

impl BondGraph {
    /// Whether a ratio of the graph may leap: a modulus with a condition, a constraint with a corner.
    pub fn has_leaping_ratios(&self) -> bool {
        self.elements.values().any(|element| element.kind.moduli().into_iter().any(|m| self.exprs.may_leap(m)))
    }

    /// Whether a set-valued law is in a branch that an impulse ends, as one that sticks.
    pub fn may_be_released(&self) -> bool {
        self.set_valued.iter().any(|law| law.branch().released.is_some())
    }

    /// The expressions of laws, signals, named values, constraints and guesses.
    pub(super) fn expressions(&self) -> Vec<Expr> {
        let mut all: Vec<Expr> =
            self.elements.values().flat_map(|e| e.kind.expressions().into_iter().chain(e.carries)).collect();
        all.extend(self.signals.values().flat_map(|s| std::iter::once(s.rate).chain(s.initial)));
        all.extend(self.held.values().map(|h| h.source));
        all.extend(self.clauses.iter().flat_map(Clause::expressions));
        all.extend(self.lets.iter().chain(&self.outputs).map(|n| n.value));
        all.extend(self.constraints.iter().flat_map(|c| [c.expr, c.multiplier]));
        all.extend(self.set_valued.iter().flat_map(SetValuedLaw::expressions));
        all.extend(self.shapes.iter().flat_map(Shape::values).map(|n| n.value));
        all.extend(self.guesses.iter().flat_map(|g| [g.what, g.value]));
        all
    }

    /// What moves the model: the expressions of laws, each with its element, of signals and of events.
    pub(crate) fn moved_by(&self) -> Vec<(Expr, Option<ElementId>)> {
        let mut all = Vec::new();
        self.clone().rewrite_laws(&mut |_, e, element| {
            all.push((e, element));
            e
        });
        all
    }

    /// Puts other expressions into the places of those that [move](BondGraph::moved_by) the model.
    pub(crate) fn rewrite_laws(&mut self, rewrite: &mut dyn FnMut(&mut Exprs, Expr, Option<ElementId>) -> Expr) {
        let x = &mut self.exprs;
        for (id, element) in self.elements.iter_mut() {
            element.kind.for_each_expr(&mut |e| *e = rewrite(x, *e, Some(id)));
        }
        for law in &mut self.set_valued {
            let element = law.element;
            law.for_each_expr(&mut |e| *e = rewrite(x, *e, Some(element)));
        }
        let mut others = |e: &mut Expr| *e = rewrite(x, *e, None);
        for (_, signal) in self.signals.iter_mut() {
            others(&mut signal.rate);
            signal.initial.iter_mut().for_each(&mut others);
        }
        self.held.iter_mut().for_each(|(_, h)| others(&mut h.source));
        self.clauses.iter_mut().for_each(|c| c.for_each_expr(&mut others));
    }
}

impl Clause {
    /// The expressions of the clause: its trigger, then the new values.
    pub(super) fn expressions(&self) -> impl Iterator<Item = Expr> + '_ {
        std::iter::once(self.trigger.expr()).chain(self.actions.iter().map(|a| a.value))
    }

    /// Visits every expression of the clause.
    pub(super) fn for_each_expr(&mut self, visit: &mut dyn FnMut(&mut Expr)) {
        let (Trigger::Becomes(e) | Trigger::Every(e)) = &mut self.trigger;
        visit(e);
        self.actions.iter_mut().for_each(|a| visit(&mut a.value));
    }
}

impl Kind {
    /// The expressions of the element.
    pub(super) fn expressions(&self) -> Vec<Expr> {
        let mut all = Vec::new();
        self.clone().for_each_expr(&mut |e| all.push(*e));
        all
    }

    /// Visits every expression of the element.
    pub(super) fn for_each_expr(&mut self, visit: &mut dyn FnMut(&mut Expr)) {
        match self {
            Kind::Zero | Kind::One | Kind::EffortDetector | Kind::FlowDetector => {}
            Kind::EffortSource { value: e } | Kind::FlowSource { value: e } | Kind::ZeroCompliance { flow: e } => {
                visit(e)
            }
            Kind::Transformer { modulus: e } | Kind::Gyrator { modulus: e } => visit(e),
            Kind::MatrixTransformer(m) | Kind::MatrixGyrator(m) => m.entries.iter_mut().for_each(visit),
            Kind::ResidualEffort { residual } | Kind::ResidualFlow { residual } => residual.iter_mut().for_each(visit),
            Kind::Inertance(s) | Kind::Compliance(s) => s.for_each_expr(visit),
            Kind::Resistor(laws) | Kind::SkewGyrator(laws) => laws.iter_mut().for_each(|law| match law {
                ResistorLaw::Resistive(e) | ResistorLaw::Conductive(e) | ResistorLaw::Implicit(e) => {
                    visit(e);
                }
            }),
        }
    }
}

impl Storage {
    fn for_each_expr(&mut self, visit: &mut dyn FnMut(&mut Expr)) {
        for law in &mut self.laws {
            match law {
                StorageLaw::Integral(e) | StorageLaw::Derivative(e) | StorageLaw::Implicit(e) => visit(e),
                StorageLaw::Known { displacement, law } => {
                    visit(displacement);
                    visit(law);
                }
            }
        }
        self.energy.iter_mut().for_each(visit);
    }
}
