//! Whether an expression is zero whatever its symbols are.

use super::assumptions::Decided;
use super::exprs::Exprs;
use super::field;
use super::fingerprint::{GENERIC, GIVEN, POISON};
use super::node::{Expr, Node, Symbol};
use super::precise::{Calls, Point, Values, Verdict};
use astro_float_num::{BigFloat, Consts};
use rustc_hash::FxHashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Points that have to agree before an expression counts as zero by its values.
const POINTS: usize = 12;
/// Of these, points at which many digits are asked: all symbols of one sign, all of the other, and mixed. Where it is zero there, few
/// digits tell whether it is another branch elsewhere.
const EXACT_POINTS: usize = 3;
/// Points that are tried for that: at some of them the expression may be undefined.
const TRIED: u64 = 48;
/// Values that are kept.
const ROUGH_AT_MOST: usize = 1 << 22;
const EXACT_AT_MOST: usize = 1 << 18;

/// What values at random points have told: it stays true, since a pool never changes what it has.
#[derive(Debug, Default)]
pub(super) struct Told {
    /// Whether an expression vanishes, in general or at the given parameters.
    vanishes: Mutex<FxHashMap<(Expr, bool), bool>>,
    /// What is given has these values: parameters that others are given by are evaluated once.
    given: Mutex<FxHashMap<Symbol, f64>>,
    /// Functions of many digits at the points: most of what a value costs.
    calls: Mutex<Calls>,
    /// Values at the points: long expressions have their parts in common.
    at: Mutex<AtPoints>,
}

/// Values of few digits and of many by point, in general and at the given parameters.
#[derive(Debug, Default)]
struct AtPoints {
    rough: FxHashMap<(u64, bool), Values<f64>>,
    exact: FxHashMap<(u64, bool), Values<BigFloat>>,
}

impl AtPoints {
    /// Makes room where there are too many.
    fn bound(&mut self) {
        if self.rough.values().map(Values::len).sum::<usize>() > ROUGH_AT_MOST {
            self.rough.clear();
        }
        if self.exact.values().map(Values::len).sum::<usize>() > EXACT_AT_MOST {
            self.exact.clear();
        }
    }
}

impl Clone for Told {
    /// A copy of a pool goes another way.
    fn clone(&self) -> Told {
        Told::default()
    }
}

impl Told {
    pub(super) fn calls(&self) -> MutexGuard<'_, Calls> {
        self.calls.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn at(&self) -> MutexGuard<'_, AtPoints> {
        self.at.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn given(&self) -> MutexGuard<'_, FxHashMap<Symbol, f64>> {
        self.given.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn vanishes(&self) -> MutexGuard<'_, FxHashMap<(Expr, bool), bool>> {
        self.vanishes.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Exprs {
    /// Whether the expression is zero for all values of its symbols for which it is defined (up to a probability of
    /// about 2^-60).
    ///
    /// Where the fingerprint decides, nothing else is looked at: for rational expressions, sine, cosine and
    /// exponential of sums of symbols. Else values at random points with 50 digits and more decide. Expressions with
    /// corners or jumps are never called zero by their values: what a rare branch does shows at no random point.
    pub fn is_zero(&self, e: Expr) -> bool {
        self.is_zero_in(e, false)
    }

    /// Whether the expression is zero at the given parameters, for all values of what is not given.
    pub fn is_zero_given(&self, e: Expr) -> bool {
        let zero = self.is_zero_in(e, true);
        if zero && !self.is_zero(e) {
            self.decide_zero(e);
        }
        zero
    }

    /// Whether a square matrix is known to have a determinant that is not zero at the given parameters: by its values at
    /// random points of a prime field, where these are beyond doubt. Dividing symbolically takes a time that grows
    /// exponentially with its size.
    pub fn is_regular_given(&self, matrix: &[Vec<Expr>]) -> bool {
        let sure = |e: &Expr| !self.entry(*e).properties.opaque[1];
        matrix.iter().flatten().all(sure)
            && GIVEN.into_iter().any(|lane| {
                let values = matrix.iter().map(|row| row.iter().map(|&e| self.fingerprint(e)[lane]).collect());
                is_regular(values.collect())
            })
    }

    fn is_zero_in(&self, e: Expr, given: bool) -> bool {
        let lanes = &self.fingerprint(e)[if given { GIVEN } else { GENERIC }];
        let zero = lanes_vanish(lanes);
        let properties = &self.entry(e).properties;
        if zero && !properties.radical {
            return true;
        }
        let vanishes = self.vanishes_by_values(e, given);
        if vanishes {
            self.note_positive_symbols(e);
        }
        vanishes
    }

    fn vanishes_by_values(&self, e: Expr, given: bool) -> bool {
        let lanes = &self.fingerprint(e)[if given { GIVEN } else { GENERIC }];
        let (zero, poisoned) = (lanes_vanish(lanes), lanes.iter().all(|&v| v == POISON));
        let properties = &self.entry(e).properties;
        if !zero && !poisoned && !properties.opaque[usize::from(given)] {
            return false;
        }
        if !zero && properties.piecewise {
            return false;
        }
        if let Some(&told) = self.told.vanishes().get(&(e, given)) {
            return told;
        }
        let vanishes = match self.node(e) {
            // What cancels in a product does so in one of its factors, where it is small beside the terms of that.
            Node::Mul(factors) => factors.iter().any(|&factor| self.is_zero_in(factor, given)),
            Node::Whole(inner) => self.is_zero_in(*inner, given),
            _ => self.is_zero_by_values(e, given),
        };
        self.told.vanishes().insert((e, given), vanishes);
        vanishes
    }

    /// Roots and magnitudes vanish in sums by the signs of what stands in them.
    fn note_positive_symbols(&self, e: Expr) {
        for part in self.below(&[e], &|e| !self.is_constant(e)) {
            if matches!(self.node(part), Node::Symbol(s) if self.facts(*s).positive) {
                self.assumptions.decide(part, Decided::POSITIVE);
            }
        }
    }

    fn is_zero_by_values(&self, e: Expr, given: bool) -> bool {
        let Ok(mut constants) = Consts::new() else { return false };
        let mut zeros = 0;
        for number in 0..TRIED {
            let point = Point { pool: self, number, given };
            let mut known = self.told.at();
            known.bound();
            let rough = known.rough.entry((number, given)).or_default();
            let verdict = match point.verdict::<f64>(e, rough, &mut constants) {
                Verdict::Zero if zeros >= EXACT_POINTS => Verdict::Zero,
                Verdict::Nonzero => Verdict::Nonzero,
                _ => {
                    let exact = known.exact.entry((number, given)).or_default();
                    point.verdict::<BigFloat>(e, exact, &mut constants)
                }
            };
            match verdict {
                Verdict::Nonzero => return false,
                Verdict::Zero => zeros += 1,
                Verdict::Unknown => {}
            }
            if zeros == POINTS || (zeros > 0 && self.is_constant(e)) {
                return true;
            }
        }
        false
    }
}

/// Whether what is known of the lanes is zero, and something is known.
fn lanes_vanish(lanes: &[u64]) -> bool {
    let mut known = lanes.iter().filter(|&&v| v != POISON).peekable();
    known.peek().is_some() && known.all(|&v| v == 0)
}

/// Whether a square matrix over the prime field is regular; `false` if an entry is undefined.
fn is_regular(mut rows: Vec<Vec<u64>>) -> bool {
    if rows.iter().flatten().any(|&v| v == POISON) {
        return false;
    }
    for column in 0..rows.len() {
        let Some(pivot) = (column..rows.len()).find(|&r| rows[r][column] != 0) else { return false };
        rows.swap(column, pivot);
        let Some(inverse) = field::inverse(rows[column][column]) else { return false };
        let (above, below) = rows.split_at_mut(column + 1);
        for row in below {
            let factor = field::mul(row[column], inverse);
            for (entry, &own) in row.iter_mut().zip(&above[column]).skip(column) {
                *entry = field::sub(*entry, field::mul(factor, own));
            }
        }
    }
    true
}
