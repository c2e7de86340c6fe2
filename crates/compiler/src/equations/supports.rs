//! Which unknowns of a loop its variables read, and what solving for them costs.

use std::collections::{BTreeMap, BTreeSet};

use crate::algebra::{Expr, Exprs, Symbol};
use crate::sparse::{Pattern, SymbolicFactors, full_operations};

/// The unknowns of a loop, and where its matrix has entries.
#[derive(Debug)]
pub struct Supports {
    /// The number of each unknown.
    pub unknown: BTreeMap<Symbol, usize>,
    pattern: Pattern,
}

impl Supports {
    /// Of a loop with these unknowns, definitions of other variables in order and residuals. A variable that would read
    /// more than `longest` unknowns is an unknown itself; its row is that of its definition.
    pub fn of(x: &Exprs, unknowns: &[Symbol], body: &[(Symbol, Expr)], residuals: &[Expr], longest: usize) -> Supports {
        let mut unknown: BTreeMap<Symbol, usize> = unknowns.iter().enumerate().map(|(k, &s)| (s, k)).collect();
        let mut of: BTreeMap<Symbol, BTreeSet<usize>> =
            unknown.iter().map(|(&s, &k)| (s, BTreeSet::from([k]))).collect();
        let mut rows = Vec::new();
        for &(symbol, value) in body {
            let mut read = reads(x, value, &of);
            if read.len() > longest {
                let own = unknown.len();
                unknown.insert(symbol, own);
                read.insert(own);
                rows.push(std::mem::replace(&mut read, BTreeSet::from([own])));
            }
            of.insert(symbol, read);
        }
        let residuals = residuals.iter().map(|&residual| reads(x, residual, &of));
        let pattern = Pattern::new(residuals.chain(rows).collect::<Vec<_>>());
        Supports { unknown, pattern }
    }

    /// Additions and products to form the matrix, to factor it and to solve the equations.
    pub fn operations(&self) -> u64 {
        to_solve(&self.pattern) + 2 * self.pattern.len() as u64
    }
}

/// Additions and products to solve equations with these entries once.
pub fn to_solve(pattern: &Pattern) -> u64 {
    let full = full_operations(pattern.size());
    SymbolicFactors::of_large(pattern).map_or(full, |factors| factors.operations())
}

fn reads(x: &Exprs, e: Expr, of: &BTreeMap<Symbol, BTreeSet<usize>>) -> BTreeSet<usize> {
    x.symbols_of(e).iter().filter_map(|s| of.get(s)).flatten().copied().collect()
}
