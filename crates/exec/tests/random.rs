//! Random programs: values against the expressions, derivatives against differences.

use crate::recipes;

use halfarrow_sim::{Events, System};
use proptest::prelude::*;
use recipes::{Recipe, STATES, build, recipe};

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn derivatives_are_those_of_differences(recipe in recipe(), x in prop::array::uniform3(-2.0f64..2.0), v in prop::array::uniform3(-1.0f64..1.0)) {
        let mut model = build(&recipe).0.model();
        let mut start = x.to_vec();
        model.handle_event(0.7, &mut start).unwrap();
        let mut jv = [0.0; STATES];
        prop_assume!(model.directional_derivative(0.7, &x, &v, &mut jv).is_ok());
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
        model.handle_event(0.7, &mut x.to_vec()).unwrap();
        let pattern = model.sparsity().clone();
        let mut values = vec![0.0; pattern.nonzeros()];
        let mut jv = [0.0; STATES];
        prop_assume!(model.directional_derivative(0.7, &x, &[1.0; STATES], &mut jv).is_ok());
        prop_assert_eq!(model.jacobian(0.7, &x, &mut values), Ok(true));
        for column in 0..STATES {
            let mut v = [0.0; STATES];
            v[column] = 1.0;
            prop_assume!(model.directional_derivative(0.7, &x, &v, &mut jv).is_ok());
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
            prop_assume!(model.directional_derivative(0.7, &x, &v, &mut jv).is_ok());
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
