//! Which unknowns of a loop its variables read, and what solving for them costs.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use crate::algebra::{Expr, Exprs, Symbol};
use crate::sparse::{Columns, Pattern, SymbolicFactors, Unions, full_operations};

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
        let only = |k: usize| Columns::from([k as u32]);
        let mut of: FxHashMap<Symbol, Columns> = unknown.iter().map(|(&s, &k)| (s, only(k))).collect();
        let mut unions = Unions::default();
        let mut rows = Vec::new();
        for &(symbol, value) in body {
            let mut read = unions.of(x.symbols_of(value).iter().filter_map(|s| of.get(s)));
            if read.len() > longest {
                let own = only(unknown.len());
                unknown.insert(symbol, unknown.len());
                rows.push(unions.of([&read, &own]));
                read = own;
            }
            of.insert(symbol, read);
        }
        let residual = |&residual: &Expr| unions.of(x.symbols_of(residual).iter().filter_map(|s| of.get(s)));
        let residuals: Vec<Columns> = residuals.iter().map(residual).collect();
        let columns = |row: &Columns| row.iter().map(|&column| column as usize).collect::<Vec<_>>();
        let pattern = Pattern::new(residuals.iter().chain(&rows).map(columns));
        Supports { unknown, pattern }
    }

    /// Additions and products to form the matrix, to factor it and to solve the equations; `None` if these are more than `most`.
    pub fn operations(&self, most: u64) -> Option<u64> {
        let forming = 2 * self.pattern.len() as u64;
        let solving = to_solve_within(&self.pattern, most.checked_sub(forming)?)?;
        Some(solving + forming)
    }
}

/// Additions and products to solve equations with these entries once.
pub fn to_solve(pattern: &Pattern) -> u64 {
    let full = full_operations(pattern.size());
    SymbolicFactors::of_large(pattern).map_or(full, |factors| factors.operations())
}

/// The same; `None` if these are more than `most`, which is found out on the way.
fn to_solve_within(pattern: &Pattern, most: u64) -> Option<u64> {
    let full = full_operations(pattern.size());
    if full <= most {
        return Some(to_solve(pattern));
    }
    SymbolicFactors::of_large_within(pattern, most).map(|factors| factors.operations()).filter(|&found| found <= most)
}
