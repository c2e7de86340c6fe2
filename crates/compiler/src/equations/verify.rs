//! What holds of all equations that this stage gives; a breach is our fault, not the modeller's.

use std::collections::{BTreeMap, BTreeSet};

use super::{EquationStep, Equations};
use crate::algebra::Symbol;

/// Checks the invariants of [`Equations`]: every unknown has a name and a symbol of its own, what can be recorded has
/// one meaning a name, nothing is defined twice or both unknown and defined, and there are as many residuals as unknowns
/// that no step gives a rate.
///
/// # Errors
/// The first breach, in words for us.
pub fn verify(equations: &Equations) -> Result<(), String> {
    names(equations)?;
    symbols(equations)?;
    let defined: BTreeSet<Symbol> = equations.steps.iter().flat_map(EquationStep::defined).collect();
    let open = equations.states.iter().filter(|s| !defined.contains(&s.rate)).count();
    let (unknown, vanish) = (open + equations.algebraic.len(), equations.residuals.len());
    if unknown != vanish {
        return Err(format!("{vanish} expressions vanish for {unknown} unknowns"));
    }
    Ok(())
}

fn names(equations: &Equations) -> Result<(), String> {
    once(equations.states.iter().map(|s| &s.name), |name| format!("two states are called `{name}`"))?;
    once(equations.conserved.iter().map(|c| &c.name), |name| format!("two constants are called `{name}`"))?;
    once(equations.observed.iter().map(|o| &o.name), |name| format!("two variables are called `{name}`"))?;
    // The two ends of a bond that two elements share have one name: they are one variable.
    let own = |symbol| equations.graph.exprs.untwinned(symbol);
    let states = equations.states.iter().map(|s| (s.name.as_str(), own(s.symbol)));
    let mut known: BTreeMap<&str, Symbol> = states.collect();
    for unknown in &equations.algebraic {
        if known.insert(&unknown.name, own(unknown.symbol)).is_some_and(|other| other != own(unknown.symbol)) {
            return Err(format!("two unknowns are called `{}`", unknown.name));
        }
    }
    Ok(())
}

fn symbols(equations: &Equations) -> Result<(), String> {
    let name = |s: &Symbol| format!("`{}` is unknown or defined twice", equations.graph.exprs.label(*s));
    let conserved = equations.conserved.iter().map(|c| c.symbol);
    let defined = equations.steps.iter().flat_map(EquationStep::defined);
    let all: Vec<Symbol> = equations.unknowns().into_iter().chain(conserved).chain(defined).collect();
    once(all.iter(), name)
}

fn once<'a, T: Ord + 'a>(all: impl Iterator<Item = &'a T>, breach: impl Fn(&T) -> String) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    all.into_iter().find(|one| !seen.insert(*one)).map_or(Ok(()), |again| Err(breach(again)))
}

impl EquationStep {
    /// The symbols that the step defines; the body of an iteration is written out after it once more.
    pub(super) fn defined(&self) -> Vec<Symbol> {
        match self {
            EquationStep::Assign { symbol, .. } => vec![*symbol],
            EquationStep::Linear(block) => block.unknowns.clone(),
            EquationStep::Newton(block) => block.unknowns.clone(),
            EquationStep::Guard { .. } => Vec::new(),
        }
    }
}
