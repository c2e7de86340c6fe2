//! The roles of ports by elimination in a prime field, and definitions from the rows of the elements as they stand.
//!
//! Which variable of a port follows from which takes no more than ranks, and these are the same in a prime field where every
//! symbol has a random value (up to a probability of 2^-60). No expression is made that the definitions do not need, so that
//! a chain of bodies costs as much as its junctions, not the sums along it.

use std::collections::{BTreeMap, BTreeSet};

use super::Role;
use super::matched::{block_rows, matched_rows};
use super::ports::{CausalityPreferences, Net, NetPort, Solved, law_causality};
use crate::algebra::{
    Elimination, Evaluator, Exprs, NumericPoint, ONE, Pivot, PrimeField, Residues, SparseRow, Symbol,
};
use crate::ids::Id;

/// A pivot below this fraction of what it is a sum of is none but for rounding.
const ROUNDING: f64 = 1e-9;

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
                blocks.rows
            }
        };
        solved.definitions.extend(rows.into_iter().map(|row| self.definition(row)));
        Some(solved)
    }

    /// The columns that follow from others, each with the row that it was found by, and the roles of the ports.
    fn roles(&self, x: &Exprs, preferences: &CausalityPreferences) -> Option<(Elimination, BTreeMap<usize, Role>)> {
        let mut decided = true;
        let mut values = |row: &SparseRow| {
            let values = row.0.iter().map(|&(column, e)| {
                decided &= x.residues(e).is_some();
                Some((column, x.likely_residues(e)?))
            });
            values.collect::<Option<_>>().map(SparseRow)
        };
        let rows = self.rows.iter().map(&mut values).collect::<Option<_>>()?;
        // A law that may go either way is chosen by sizes, which the field does not tell.
        let mut doubtful = false;
        let causality = |_: &PrimeField, port: &NetPort, divisors: [Option<Residues>; 2]| {
            doubtful |= divisors.iter().all(Option::is_some);
            law_causality(port, divisors.map(|e| e.map(|_| 1.0)), preferences)
        };
        let (done, outputs) = self.eliminated_over(&mut PrimeField, rows, preferences, causality);
        let mut defined = vec![false; self.symbols.len()];
        done.pivots.iter().for_each(|pivot| defined[pivot.column] = true);
        let regular = !doubtful
            && done.rest.is_empty()
            && done.degenerate.is_empty()
            && self.inner.iter().all(|&c| defined[c])
            && !outputs.values().any(|&role| role == Role::Redundant)
            && (decided || self.pivots_stand(x, &done));
        let pivot =
            |p: &Pivot<_>| Pivot { column: p.column, row: SparseRow(Vec::new()), divisor: ONE, source: p.source };
        let pivots = done.pivots.iter().map(pivot).collect();
        regular.then(|| (Elimination { pivots, ..Elimination::default() }, outputs))
    }

    /// Whether no pivot vanishes at a point where every symbol has a value of its own: what a prime field does not tell of
    /// roots and functions.
    fn pivots_stand<E>(&self, x: &Exprs, done: &Elimination<E>) -> bool {
        let mut of =
            |s: Symbol| x.facts(s).given.and_then(|given| x.given_value(given)).unwrap_or_else(|| somewhere(s));
        let mut values = Evaluator::new(x, &mut of);
        let turn: BTreeMap<usize, usize> = done.pivots.iter().enumerate().map(|(k, p)| (p.column, k)).collect();
        let mut reduced: Vec<BTreeMap<usize, f64>> = Vec::with_capacity(done.pivots.len());
        for (k, pivot) in done.pivots.iter().enumerate() {
            let mut row: BTreeMap<usize, f64> =
                self.rows[pivot.source].0.iter().map(|&(column, e)| (column, values.value(e))).collect();
            let mut greatest = row.values().fold(0.0f64, |most, v| most.max(v.abs()));
            let mut waiting: BTreeSet<usize> =
                row.keys().filter_map(|c| turn.get(c)).copied().filter(|&i| i < k).collect();
            while let Some(first) = waiting.pop_first() {
                let Some(factor) = row.remove(&done.pivots[first].column) else { continue };
                for (&column, value) in &reduced[first] {
                    let entry = row.entry(column).or_insert(0.0);
                    *entry -= factor * value;
                    greatest = greatest.max((factor * value).abs());
                    waiting.extend(turn.get(&column).copied().filter(|&i| i < k));
                }
            }
            let Some(own) = row.remove(&pivot.column).filter(|own| own.abs() > ROUNDING * greatest) else {
                return false;
            };
            row.values_mut().for_each(|value| *value /= own);
            reduced.push(row);
        }
        true
    }
}

/// A value between 1 and 2 that no other symbol has.
fn somewhere(symbol: Symbol) -> f64 {
    1.0 + (0.618_033_988_749_894_9 * (symbol.index() as f64 + 1.0)).fract()
}
