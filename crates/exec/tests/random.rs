//! Random programs: values against the expressions, derivatives against differences.

mod common;

use common::Sketch;
use halfarrow_compiler::algebra::{Expr, Function};
use halfarrow_compiler::equations::Step;
use halfarrow_sim::System;
use proptest::prelude::*;

const STATES: usize = 3;

/// How each further expression is made of two earlier ones.
type Recipe = Vec<(u8, usize, usize)>;

fn recipe() -> impl Strategy<Value = Recipe> {
    proptest::collection::vec((0u8..14, any::<usize>(), any::<usize>()), 1..40)
}

fn build(recipe: &Recipe) -> (Sketch, Vec<Expr>) {
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
                let matrix = vec![vec![three, bounded], vec![one, three]];
                s.step(Step::Linear { unknowns: vec![u, v], matrix, right: vec![b, a], elements: vec![] });
                e
            }
            _ => {
                // y + y³ + tanh(a) y = b: one solution.
                let (y, e) = s.symbol(&format!("y{number}"));
                let (cube, three) = (s.x.powi(e, 3), s.number(3.0));
                let slope = s.x.add(&[three, bounded]);
                let terms = [s.x.mul(&[slope, e]), cube, s.x.neg(b)];
                let residual = s.x.add(&terms);
                s.step(Step::Newton { unknowns: vec![y], body: vec![], residuals: vec![residual], elements: vec![] });
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

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn derivatives_are_those_of_differences(recipe in recipe(), x in prop::array::uniform3(-2.0f64..2.0), v in prop::array::uniform3(-1.0f64..1.0)) {
        let mut model = build(&recipe).0.model();
        let mut start = x.to_vec();
        model.cross_jump(0.7, &mut start).unwrap();
        let mut jv = [0.0; STATES];
        prop_assume!(model.tangent(0.7, &x, &v, &mut jv).is_ok());
        let mut at = |h: f64| {
            let moved: Vec<f64> = x.iter().zip(&v).map(|(x, v)| x + h * v).collect();
            let mut dx = [0.0; STATES];
            model.rates(0.7, &moved, &mut dx).map(|()| dx)
        };
        let h = 1e-4;
        let values: Result<Vec<_>, _> = [-2.0, -1.0, 1.0, 2.0].iter().map(|k| at(k * h)).collect();
        prop_assume!(values.is_ok());
        let [a, b, c, d] = &values.unwrap()[..] else { unreachable!() };
        for i in 0..STATES {
            let difference = (8.0 * (c[i] - b[i]) - (d[i] - a[i])) / (12.0 * h);
            let curved = (d[i] - 2.0 * c[i] + 2.0 * b[i] - a[i]).abs() / h;
            let allowed = 1e-7 * (1.0 + a[i].abs() + jv[i].abs()) + curved;
            prop_assert!((jv[i] - difference).abs() <= allowed, "{}: {} {}", i, jv[i], difference);
        }
    }

    #[test]
    fn derivatives_at_once_are_those_along_directions(recipe in recipe(), x in prop::array::uniform3(-2.0f64..2.0)) {
        let program = halfarrow_compiler::program::schedule(&build(&recipe).0.equations());
        let mut model = halfarrow_exec::Model::with_jacobian(program).unwrap();
        model.cross_jump(0.7, &mut x.to_vec()).unwrap();
        let pattern = model.sparsity().clone();
        let mut values = vec![0.0; pattern.nonzeros()];
        let mut jv = [0.0; STATES];
        prop_assume!(model.tangent(0.7, &x, &[1.0; STATES], &mut jv).is_ok());
        prop_assert_eq!(model.jacobian(0.7, &x, &mut values), Ok(true));
        for column in 0..STATES {
            let mut v = [0.0; STATES];
            v[column] = 1.0;
            prop_assume!(model.tangent(0.7, &x, &v, &mut jv).is_ok());
            for (place, &row) in pattern.places(column).zip(pattern.column(column)) {
                let size = 1.0 + jv[row].abs();
                prop_assert!((values[place] - jv[row]).abs() <= 1e-9 * size, "{} {}", values[place], jv[row]);
            }
        }
    }

    /// What stands nowhere in the sparsity does not move.
    #[test]
    fn the_sparsity_holds_all_that_moves(recipe in recipe(), x in prop::array::uniform3(-2.0f64..2.0)) {
        let mut model = build(&recipe).0.model();
        for column in 0..STATES {
            let (mut v, mut jv) = ([0.0; STATES], [0.0; STATES]);
            v[column] = 1.0;
            prop_assume!(model.tangent(0.7, &x, &v, &mut jv).is_ok());
            for (row, &entry) in jv.iter().enumerate() {
                prop_assert!(entry == 0.0 || model.sparsity().column(column).contains(&row));
            }
        }
    }

    #[test]
    fn values_are_those_of_the_expressions(recipe in recipe(), x in prop::array::uniform3(-2.0f64..2.0)) {
        let recipe: Recipe = recipe.into_iter().map(|(kind, a, b)| (kind % 12, a, b)).collect();
        let (s, last) = build(&recipe);
        let symbols: Vec<_> = (0..STATES).map(|i| s.x.find_symbol(&format!("x{i}")).unwrap()).collect();
        let exprs = s.x.clone();
        let mut model = s.model();
        let mut dx = [0.0; STATES];
        prop_assume!(model.rates(0.7, &x, &mut dx).is_ok());
        for (e, dx) in last.into_iter().zip(dx) {
            let exact = exprs.eval(e, &mut |symbol| match symbols.iter().position(|&s| s == symbol) {
                Some(i) => x[i],
                None if exprs.name(symbol) == "k" => 2.0,
                None => 0.7,
            });
            prop_assert!((dx - exact).abs() <= 1e-9 * (1.0 + exact.abs()), "{} {}", dx, exact);
        }
    }
}
