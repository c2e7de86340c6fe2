//! The roles of ports by pairs of rows and variables or by elimination in a prime field, and definitions from the rows of the
//! elements as they stand.
//!
//! Which variable of a port follows from which takes no more than ranks, and these are the same in a prime field where every
//! symbol has a random value (up to a probability of 2^-60). No expression is made that the definitions do not need, so that
//! a chain of bodies costs as much as its junctions, not the sums along it.
//!
//! Rows of a chain get long all the same where inner variables are eliminated from them. Most structures need none of it: as
//! many variables as can be paired with rows that hold them are at least as many as these rows determine. Pairs are found for
//! the variables in the order in which elimination takes them. If the rows of the variables that have one are independent then
//! no variable before has less of them by elimination than by pairs, so that both take the same ones. Rows are independent
//! where those of each loop of pairs are.

use std::collections::BTreeMap;

use super::Role;
use super::matched::{block_rows, blocks, matched_rows, numbered};
use super::ports::{CausalityPreferences, Net, NetPort, Offer, Solved, law_causality};
use crate::algebra::{
    Coefficients, Elimination, Estimate, Estimates, Evaluator, Expr, Exprs, NumericPoint, ONE, Pivot, PrimeField,
    Quality, SparseRow, Symbol, Zero, eliminate,
};
use crate::bond_graph::PortCausality;
use crate::ids::Id;
use crate::sparse::Joining;

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
        if let Some(found) = self.roles_by_pairs(x, &rows, preferences) {
            return Some(found);
        }
        // A law that may go either way is chosen by sizes, which the values do not tell.
        let mut doubtful = false;
        let causality = |_: &A, port: &NetPort, divisors: [Option<A::Entry>; 2]| {
            doubtful |= divisors.iter().all(Option::is_some);
            law_causality(port, divisors.map(|e| e.map(|_| 1.0)), preferences)
        };
        let (done, outputs) = self.eliminated_over(x, rows, preferences, causality);
        let regular = !doubtful && done.rest.is_empty() && done.degenerate.is_empty();
        let pivots = done.pivots.iter().map(|p| (p.column, p.source));
        regular.then(|| self.regular(pivots, outputs)).flatten()
    }

    /// Columns that follow from others, each with a row for it, if all that has to follow does.
    fn regular(
        &self,
        pivots: impl Iterator<Item = (usize, usize)>,
        outputs: BTreeMap<usize, Role>,
    ) -> Option<(Elimination, BTreeMap<usize, Role>)> {
        let pivot = |(column, source)| Pivot { column, row: SparseRow(Vec::new()), divisor: ONE, source };
        let pivots: Vec<Pivot> = pivots.map(pivot).collect();
        let mut defined = vec![false; self.symbols.len()];
        pivots.iter().for_each(|pivot| defined[pivot.column] = true);
        // Each port gives one of its variables and is given the other, whatever rounding takes for zero.
        let one_of_each = outputs.iter().all(|(&p, &role)| {
            let port = &self.ports[p];
            let output = port.output(role);
            defined[output] && !defined[port.effort + port.flow - output]
        });
        let regular = one_of_each
            && self.inner.iter().all(|&c| defined[c])
            && !outputs.values().any(|&role| role == Role::Redundant);
        regular.then(|| (Elimination { pivots, ..Elimination::default() }, outputs))
    }

    /// The same where pairs of rows and columns tell it; `None` where they do not, whatever the reason.
    fn roles_by_pairs<A: Coefficients>(
        &self,
        x: &mut A,
        rows: &[SparseRow<A::Entry>],
        preferences: &CausalityPreferences,
    ) -> Option<(Elimination, BTreeMap<usize, Role>)> {
        // Rows in which a variable stands by itself come first, as elimination prefers them.
        let mut holders: Vec<Vec<usize>> = vec![Vec::new(); self.symbols.len()];
        for unit in [true, false] {
            for (row, entries) in rows.iter().enumerate() {
                for &(column, e) in &entries.0 {
                    match x.zero(e) {
                        Zero::No if (x.quality(e).0 == Quality::Unit) == unit => holders[column].push(row),
                        Zero::Given => return None,
                        _ => {}
                    }
                }
            }
        }
        let mut joining = Joining::new(&holders, rows.len());
        let mut outputs: BTreeMap<usize, Role> = BTreeMap::new();
        // The order of elimination, see `eliminated_over`.
        let storages = self.storage_order(preferences);
        for &column in &self.inner {
            joining.join(column).then_some(())?;
        }
        for p in self.ports_where(|o| matches!(o, Offer::Imposed(_))) {
            joining.join(self.ports[p].conjugate()).then_some(())?;
            outputs.insert(p, Role::Source);
        }
        for &p in &storages {
            joining.join(self.ports[p].conjugate());
        }
        for p in self.ports_where(|o| o == Offer::Law).into_iter().rev() {
            let port = &self.ports[p];
            let causality = match [port.effort, port.flow].map(|column| joining.finds(column)) {
                [true, false] => PortCausality::Conductive,
                [false, true] => PortCausality::Resistive,
                _ => return None,
            };
            joining.join(port.column(causality == PortCausality::Conductive));
            outputs.insert(p, Role::Algebraic(causality));
        }
        for &p in storages.iter().rev() {
            let dependent = joining.join(self.ports[p].given());
            outputs.insert(p, if dependent { Role::Dependent } else { Role::Independent });
        }
        // Where a row is left over the others cannot be told from it.
        let column_of: Vec<usize> = joining.pairs.row_of.iter().copied().collect::<Option<_>>()?;
        are_independent(x, rows, &column_of).then_some(())?;
        self.regular(column_of.into_iter().zip(0..), outputs)
    }
}

/// Whether rows are independent, by those of each loop of pairs.
fn are_independent<A: Coefficients>(x: &mut A, rows: &[SparseRow<A::Entry>], column_of: &[usize]) -> bool {
    let row_of: BTreeMap<usize, usize> = column_of.iter().copied().zip(0..).collect();
    let all: Vec<&SparseRow<A::Entry>> = rows.iter().collect();
    blocks(&all, &row_of).into_iter().filter(|columns| columns.len() > 1).all(|columns| {
        if columns.len() > BLOCK {
            return false;
        }
        let own: Vec<&SparseRow<A::Entry>> = columns.iter().map(|column| all[row_of[column]]).collect();
        let (read, own) = numbered(&own);
        let columns = columns.iter().filter_map(|column| read.binary_search(column).ok()).collect::<Vec<_>>();
        let done = eliminate(x, own, std::slice::from_ref(&columns));
        done.pivots.len() == columns.len() && done.degenerate.is_empty()
    })
}

/// A value between 1 and 2 that no other symbol has.
fn somewhere(symbol: Symbol) -> f64 {
    1.0 + (0.618_033_988_749_894_9 * (symbol.index() as f64 + 1.0)).fract()
}
