//! Points at which expressions are compared by their values.

use rustc_hash::FxHashMap;

use crate::algebra::{Evaluator, Expr, Exprs, Symbol, scattered};
use crate::ids::Id;

/// How many points are tried.
pub const POINTS: usize = 3;
/// Values are equal that differ by no more than this part of them.
pub const ROUNDING: f64 = 1e-10;

/// The solution of linear equations with a full matrix; not finite if it has none.
pub fn solved(n: usize, mut full: Vec<f64>, mut right: Vec<f64>) -> Vec<f64> {
    for k in 0..n {
        let pivot =
            (k..n).max_by(|&a, &b| full[a * n + k].abs().total_cmp(&full[b * n + k].abs())).expect("it has rows");
        (0..n).for_each(|j| full.swap(k * n + j, pivot * n + j));
        right.swap(k, pivot);
        for i in k + 1..n {
            let factor = full[i * n + k] / full[k * n + k];
            (k..n).for_each(|j| full[i * n + j] -= factor * full[k * n + j]);
            right[i] -= factor * right[k];
        }
    }
    for k in (0..n).rev() {
        let sum: f64 = (k + 1..n).map(|j| full[k * n + j] * right[j]).sum();
        right[k] = (right[k] - sum) / full[k * n + k];
    }
    right
}

/// A value between 1 and 2 that no other symbol has at this point, nor do sums or products of others.
pub fn somewhere(point: usize, symbol: Symbol) -> f64 {
    mixed(point, 2 * symbol.index() as u64)
}

fn mixed(point: usize, number: u64) -> f64 {
    scattered(point as u64, number)
}

/// The value of an expression at a point where symbols have these values. What has a corner or a jump has a value of its own,
/// as a symbol has: a few points lie on one side of it, where a tyre in flight has no force at all. `known`: what is known of
/// this point already.
pub fn value(x: &Exprs, point: usize, e: Expr, at: &dyn Fn(Symbol) -> f64, known: &mut FxHashMap<Expr, f64>) -> f64 {
    if let Some(&value) = known.get(&e) {
        return value;
    }
    for corner in x.corners(e) {
        known.entry(corner).or_insert_with(|| mixed(point, 2 * corner.index() as u64 + 1));
    }
    let mut at = |s: Symbol| at(s);
    let mut values = Evaluator::knowing(x, &mut at, std::mem::take(known));
    let value = values.value(e);
    *known = values.into_known();
    value
}

/// The smallest pivot of a full matrix by the greatest one, rows and then columns weighed by their greatest entry and pivots
/// sought everywhere; 0 if an entry is not finite.
pub fn least_pivot(n: usize, mut full: Vec<f64>) -> f64 {
    let greatest =
        |full: &[f64], at: &dyn Fn(usize) -> usize| (0..n).fold(0.0f64, |most, k| most.max(full[at(k)].abs()));
    for i in 0..n {
        let scale = greatest(&full, &|k| i * n + k);
        (0..n).for_each(|k| full[i * n + k] /= scale);
    }
    for j in 0..n {
        let scale = greatest(&full, &|k| k * n + j);
        (0..n).for_each(|k| full[k * n + j] /= scale);
    }
    if !full.iter().all(|a| a.is_finite()) {
        return 0.0;
    }
    let (mut first, mut last) = (0.0, 0.0);
    for k in 0..n {
        let places = (k..n).flat_map(|i| (k..n).map(move |j| (i, j)));
        let size = |&(i, j): &(usize, usize)| full[i * n + j].abs();
        let (i, j) = places.max_by(|a, b| size(a).total_cmp(&size(b))).expect("there are entries");
        last = full[i * n + j].abs();
        first = if k == 0 { last } else { first };
        if last == 0.0 {
            return 0.0;
        }
        (0..n).for_each(|c| full.swap(k * n + c, i * n + c));
        (0..n).for_each(|r| full.swap(r * n + k, r * n + j));
        for row in k + 1..n {
            let factor = full[row * n + k] / full[k * n + k];
            (k..n).for_each(|c| full[row * n + c] -= factor * full[k * n + c]);
        }
    }
    last / first
}
