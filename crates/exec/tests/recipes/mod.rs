//! Random programs, each made by a recipe.
#![allow(dead_code)]

use super::common::Sketch;
use halfarrow_compiler::algebra::{Expr, Function};
use halfarrow_compiler::equations::{LinearBlock, NewtonBlock};
use halfarrow_compiler::sparse::SparseMatrix;
use proptest::prelude::*;

/// States of each of them.
pub const STATES: usize = 3;

/// How each further expression is made of two earlier ones.
pub type Recipe = Vec<(u8, usize, usize)>;

pub fn recipe() -> impl Strategy<Value = Recipe> {
    proptest::collection::vec((0u8..14, any::<usize>(), any::<usize>()), 1..40)
}

pub fn build(recipe: &Recipe) -> (Sketch, Vec<Expr>) {
    let mut s = Sketch::default();
    let mut all: Vec<Expr> = (0..STATES).map(|i| s.state(&format!("x{i}"))).collect();
    let two = s.number(2.0);
    all.push(s.parameter("k", two));
    all.push(s.t);
    for (number, &(kind, a, b)) in recipe.iter().enumerate() {
        let (a, b) = (all[a % all.len()], all[b % all.len()]);
        let bounded = s.call(Function::Tanh, a);
        let e = match kind {
            0 | 1 => s.x.add(&[a, b]),
            2 => s.x.sub(a, b),
            3 | 4 => s.x.mul(&[bounded, b]),
            5 => {
                let square = s.x.powi(b, 2);
                let one = s.number(1.0);
                let below = s.x.add(&[one, square]);
                s.x.div(a, below)
            }
            6 => s.call(Function::Sin, a),
            7 => s.call(Function::Atan, a),
            8 => s.call(Function::Exp, bounded),
            9 => {
                let exponent = s.call(Function::Exp, bounded);
                let (one, b) = (s.number(1.5), s.call(Function::Sin, b));
                let base = s.x.add(&[one, b]);
                s.x.pow(base, exponent)
            }
            10 => {
                let condition = s.less(a, b);
                s.x.select(condition, bounded, b)
            }
            11 => s.call(Function::Abs, a),
            12 => {
                let (u, e) = s.symbol(&format!("u{number}"));
                let (v, _) = s.symbol(&format!("v{number}"));
                let (three, one) = (s.number(3.0), s.number(1.0));
                let matrix = SparseMatrix::full(vec![vec![three, bounded], vec![one, three]]);
                s.step(LinearBlock { unknowns: vec![u, v], matrix, right: vec![b, a], elements: vec![] }.into());
                e
            }
            _ => {
                // y + y³ + tanh(a) y = b: one solution.
                let (y, e) = s.symbol(&format!("y{number}"));
                let (cube, three) = (s.x.powi(e, 3), s.number(3.0));
                let slope = s.x.add(&[three, bounded]);
                let terms = [s.x.mul(&[slope, e]), cube, s.x.neg(b)];
                let residual = s.x.add(&terms);
                s.step(
                    NewtonBlock { unknowns: vec![y], body: vec![], residuals: vec![residual], elements: vec![] }.into(),
                );
                e
            }
        };
        all.push(e);
    }
    let last: Vec<Expr> = all[all.len() - STATES..].to_vec();
    for (i, &e) in last.iter().enumerate() {
        s.rate(&format!("x{i}"), e);
    }
    (s, last)
}
