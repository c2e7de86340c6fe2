//! The roles of ports by elimination in a prime field, and definitions from the rows of the elements as they stand.
//!
//! Which variable of a port follows from which takes no more than ranks, and these are the same in a prime field where every
//! symbol has a random value (up to a probability of 2^-60). No expression is made that the definitions do not need, so that
//! a chain of bodies costs as much as its junctions, not the sums along it.

use std::collections::BTreeMap;

use super::Role;
use super::matched::{block_rows, matched_rows};
use super::ports::{CausalityPreferences, Net, NetPort, Solved, law_causality};
use crate::algebra::{
    Coefficients, Elimination, Estimate, Estimates, Evaluator, Expr, Exprs, NumericPoint, ONE, Pivot, PrimeField,
    SparseRow, Symbol,
};
use crate::ids::Id;

/// Blocks with more columns than this are left to the elimination of the whole, which looks for common divisors.
const BLOCK: usize = 400;

impl Net {
    /// The part solved by its roles. `None` if something is redundant, undetermined, contradictory or degenerate, or if
    /// definitions would take what only expressions tell: sizes of coefficients, or large blocks.
    pub(super) fn solved_by_roles(
        &self,
        x: &mut Exprs,
        preferences: &CausalityPreferences,
        point: Option<&NumericPoint>,
    ) -> Option<Solved> {
        let (done, outputs) = self.roles(x, preferences)?;
        let mut solved = Solved::default();
        self.report_ports(&outputs, preferences, &mut solved);
        let matched = x.if_found(|x| matched_rows(x, &self.rows, &done));
        let rows = match matched {
            Some(rows) => rows,
            None => {
                let blocks = x.if_found(|x| block_rows(x, &self.rows, &done, BLOCK, point))?;
                solved.watched = blocks.divisors;
                solved.loops = blocks.loops.into_iter().map(|block| self.loop_rows(block)).collect();
                blocks.rows
            }
        };
        solved.definitions.extend(rows.into_iter().map(|row| self.definition(row)));
        Some(solved)
    }

    /// The columns that follow from others, each with the row that it was found by, and the roles of the ports.
    fn roles(&self, x: &Exprs, preferences: &CausalityPreferences) -> Option<(Elimination, BTreeMap<usize, Role>)> {
        let values = |row: &SparseRow| {
            let values = row.0.iter().map(|&(column, e)| Some((column, x.residues(e)?)));
            values.collect::<Option<_>>().map(SparseRow)
        };
        match self.rows.iter().map(values).collect::<Option<_>>() {
            Some(rows) => self.roles_over(&mut PrimeField, rows, preferences),
            None => self.roles_over(&mut Estimates, self.estimates(x)?, preferences),
        }
    }

    /// The rows at two points; `None` if a coefficient has no value there.
    fn estimates(&self, x: &Exprs) -> Option<Vec<SparseRow<Estimate>>> {
        let (mut anywhere, mut as_given) = (somewhere, |s: Symbol| match x.facts(s).given {
            Some(given) => x.given_value(given).unwrap_or(f64::NAN),
            None => somewhere(s),
        });
        let (mut generic, mut given) = (Evaluator::new(x, &mut anywhere), Evaluator::new(x, &mut as_given));
        let mut estimate = |e: Expr| {
            let values = [generic.value(e), given.value(e)];
            values.iter().all(|v| v.is_finite()).then(|| Estimate::new(values[0], values[1]))
        };
        let mut row = |row: &SparseRow| {
            let entries = row.0.iter().map(|&(column, e)| Some((column, estimate(e)?)));
            entries.collect::<Option<_>>().map(SparseRow)
        };
        self.rows.iter().map(&mut row).collect()
    }

    fn roles_over<A: Coefficients>(
        &self,
        x: &mut A,
        rows: Vec<SparseRow<A::Entry>>,
        preferences: &CausalityPreferences,
    ) -> Option<(Elimination, BTreeMap<usize, Role>)> {
        // A law that may go either way is chosen by sizes, which the values do not tell.
        let mut doubtful = false;
        let causality = |_: &A, port: &NetPort, divisors: [Option<A::Entry>; 2]| {
            doubtful |= divisors.iter().all(Option::is_some);
            law_causality(port, divisors.map(|e| e.map(|_| 1.0)), preferences)
        };
        let (done, outputs) = self.eliminated_over(x, rows, preferences, causality);
        let mut defined = vec![false; self.symbols.len()];
        done.pivots.iter().for_each(|pivot| defined[pivot.column] = true);
        // Each port gives one of its variables and is given the other, whatever rounding takes for zero.
        let one_of_each = outputs.iter().all(|(&p, &role)| {
            let port = &self.ports[p];
            let output = port.output(role);
            defined[output] && !defined[port.effort + port.flow - output]
        });
        let regular = !doubtful
            && one_of_each
            && done.rest.is_empty()
            && done.degenerate.is_empty()
            && self.inner.iter().all(|&c| defined[c])
            && !outputs.values().any(|&role| role == Role::Redundant);
        let pivot =
            |p: &Pivot<_>| Pivot { column: p.column, row: SparseRow(Vec::new()), divisor: ONE, source: p.source };
        let pivots = done.pivots.iter().map(pivot).collect();
        regular.then(|| (Elimination { pivots, ..Elimination::default() }, outputs))
    }
}

/// A value between 1 and 2 that no other symbol has.
fn somewhere(symbol: Symbol) -> f64 {
    1.0 + (0.618_033_988_749_894_9 * (symbol.index() as f64 + 1.0)).fract()
}
