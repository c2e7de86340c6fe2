//! Which sines and cosines of sums are computed from those of the single angles.
//!
//! A pendulum of `n` links reads the cosine of every difference of two angles: `n²/2` of them, made of the sines and
//! cosines of `n` angles by a product or two each.

use crate::algebra::{Expr, Exprs, Function, Node};
use petgraph::unionfind::UnionFind;
use rustc_hash::{FxHashMap, FxHashSet};

/// The sums whose sine and cosine are made of those of their terms: where that takes fewer angles. `exprs` is all that
/// is evaluated.
pub(super) fn sums_of_angles(x: &Exprs, exprs: &[Expr]) -> FxHashSet<Expr> {
    let mut arguments = Vec::new();
    for &e in exprs {
        if let Node::Call(Function::Sin | Function::Cos, argument) = x.node(e) {
            arguments.push(argument[0]);
        }
    }
    arguments.sort_unstable();
    arguments.dedup();
    let is_sum = |&e: &Expr| matches!(x.node(e), Node::Add(_));
    let (sums, singles): (Vec<Expr>, Vec<Expr>) = arguments.into_iter().partition(is_sum);
    let mut angles: FxHashMap<Vec<Expr>, usize> = FxHashMap::default();
    let mut terms_of: Vec<Vec<usize>> = Vec::with_capacity(sums.len());
    for &sum in &sums {
        let Node::Add(terms) = x.node(sum) else { unreachable!("sums were picked") };
        let of = |&term: &Expr| {
            let next = angles.len();
            *angles.entry(angle(x, term)).or_insert(next)
        };
        terms_of.push(terms.iter().map(of).collect());
    }
    // Sums that share an angle are judged together.
    let mut groups = UnionFind::<usize>::new(angles.len());
    terms_of.iter().for_each(|terms| terms.windows(2).for_each(|pair| _ = groups.union(pair[0], pair[1])));
    let mut gain: FxHashMap<usize, i64> = FxHashMap::default();
    terms_of.iter().for_each(|terms| *gain.entry(groups.find(terms[0])).or_default() += 1);
    angles.values().for_each(|&angle| *gain.entry(groups.find(angle)).or_default() -= 1);
    let there: FxHashSet<usize> = singles.iter().filter_map(|&e| angles.get(&angle(x, e)).copied()).collect();
    there.into_iter().for_each(|angle| *gain.entry(groups.find(angle)).or_default() += 1);
    sums.into_iter().zip(&terms_of).filter(|(_, terms)| gain[&groups.find(terms[0])] > 0).map(|(sum, _)| sum).collect()
}

/// An angle up to its sign.
fn angle(x: &Exprs, term: Expr) -> Vec<Expr> {
    match x.node(term) {
        Node::Mul(factors) if x.is_number(factors[0]).is_some_and(|n| n.abs().is_one()) => factors[1..].to_vec(),
        Node::Mul(factors) => factors.to_vec(),
        _ => vec![term],
    }
}
