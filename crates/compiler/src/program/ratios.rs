//! Which variables could be independent in place of others, as values with what tells them.

use std::collections::BTreeSet;

use super::{Exchanged, Program, Reads, Step, Value, first_of};
use crate::algebra::Symbol;

/// Variables that could change places.
#[derive(Debug, Clone)]
pub struct Ratios {
    /// Those that are independent, with their values and what tells them.
    pub independent: Vec<(Exchanged, Value, Told)>,
    /// The others.
    pub dependent: Vec<(Exchanged, Value)>,
    /// What ratios between them are divided by, where it varies.
    pub pivots: Vec<Value>,
    /// Whether they are to be looked at whatever became of these: there are none, or ratios follow from equations that are solved
    /// together, which may be singular, too, and are few.
    pub always: bool,
}

/// Unknowns of solve blocks, times independent variables, up to which ratios are looked at after each step.
const FEW: usize = 64;

/// What tells an independent variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Told {
    /// A state.
    State(u32),
    /// A conserved constant.
    Conserved(u32),
}

impl Ratios {
    /// The values of those that are independent, then of the others.
    pub fn values(&self) -> Vec<Value> {
        self.independent.iter().map(|k| k.1).chain(self.dependent.iter().map(|o| o.1)).collect()
    }

    /// What tells those that are independent in a program, for messages.
    pub fn tellers(&self, program: &Program) -> String {
        let name = |told: Told| match told {
            Told::State(k) => program.states[k as usize].name.as_str(),
            Told::Conserved(k) => program.conserved[k as usize].as_str(),
        };
        first_of(&self.independent.iter().map(|k| name(k.2)).collect::<Vec<_>>().join(", "))
    }
}

impl Program {
    /// The variables that could change places while a run goes on; `None` if there are none.
    pub fn ratios(&self) -> Option<Ratios> {
        let value = |e: &Exchanged| self.variables.get(&e.symbol).copied();
        let of = |symbols: &[Symbol], e: &Exchanged| symbols.iter().position(|s| *s == e.told_by).map(|k| k as u32);
        let told = |e: &Exchanged| {
            of(&self.tracked, e).map(Told::State).or_else(|| of(&self.replaced, e).map(Told::Conserved))
        };
        let known = self.exchanges.independent.iter().filter_map(|e| Some((*e, value(e)?, told(e)?)));
        let independent: Vec<(Exchanged, Value, Told)> = known.collect();
        let dependent: Vec<_> = self.exchanges.dependent.iter().filter_map(|e| Some((*e, value(e)?))).collect();
        // All of them, or the rest would be looked at as if it stood still.
        let all = independent.len() == self.exchanges.independent.len();
        let pivots: BTreeSet<Value> = self.pivot_guards.iter().map(|guard| guard.pivot).collect();
        let varies = |pivot: &Value| self.values.reads(*pivot) != Reads::PARAMETERS;
        let pivots: Vec<Value> = pivots.into_iter().filter(varies).collect();
        if !all || independent.is_empty() || dependent.is_empty() {
            return None;
        }
        let mut ratios = Ratios { independent, dependent, pivots, always: false };
        let code = self.routine(&ratios.values()).code;
        let solved = |step: &Step| if let Step::Solve(solve) = step { solve.unknowns.len() } else { 0 };
        let unknowns: usize = code.steps.iter().map(solved).sum();
        let few = unknowns > 0 && unknowns * ratios.independent.len() <= FEW;
        ratios.always = ratios.pivots.is_empty() || few;
        Some(ratios)
    }
}
