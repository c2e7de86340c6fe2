use super::super::*;
use super::reader::read;
use proptest::prelude::*;

type Matrix = Vec<Vec<Rational>>;

/// Rank and reduced row echelon form with the columns in the given order, the dense way.
fn dense(mut m: Matrix, columns: &[usize]) -> (Matrix, Vec<usize>) {
    let (mut pivots, mut done) = (Vec::new(), 0);
    for &c in columns {
        let Some(row) = (done..m.len()).find(|&r| !m[r][c].is_zero()) else { continue };
        m.swap(done, row);
        let inverse = m[done][c].recip().unwrap();
        m[done].iter_mut().for_each(|e| *e = &*e * &inverse);
        for other in 0..m.len() {
            if other != done && !m[other][c].is_zero() {
                let factor = m[other][c].clone();
                for k in 0..m[other].len() {
                    let change = &factor * &m[done][k];
                    m[other][k] = &m[other][k] - &change;
                }
            }
        }
        pivots.push(c);
        done += 1;
    }
    (m, pivots)
}

fn sparse(x: &mut Exprs, m: &Matrix) -> Vec<SparseRow> {
    m.iter()
        .map(|row| {
            let entries = row.iter().enumerate().filter(|e| !e.1.is_zero());
            SparseRow(entries.map(|(c, e)| (c, x.number(e.clone()))).collect())
        })
        .collect()
}

fn matrix() -> impl Strategy<Value = Matrix> {
    (1usize..8, 1usize..10).prop_flat_map(|(rows, columns)| {
        let entry = prop_oneof![3 => Just(Rational::from(0)), 2 => (-2i64..3).prop_map(Rational::from),
            1 => ((-3i64..4), (1i64..4)).prop_map(|(n, d)| Rational::new(n, d))];
        prop::collection::vec(prop::collection::vec(entry, columns), rows)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn agrees_with_dense_elimination(m in matrix(), split in 0usize..10) {
        let columns = m[0].len();
        let split = split.min(columns);
        let mut x = Exprs::default();
        let rows = sparse(&mut x, &m);
        let classes = [(0..split).collect::<Vec<_>>(), (split..columns).collect()];
        let done = eliminate(&mut x, rows, &classes);
        let order: Vec<usize> = (0..columns).collect();
        let (_, dense_pivots) = dense(m.clone(), &order);
        prop_assert_eq!(done.pivots.len(), dense_pivots.len(), "rank");
        prop_assert!(done.rest.is_empty() && done.watched.is_empty() && done.degenerate.is_empty());
        let in_first = |pivots: &[usize]| pivots.iter().filter(|&&c| c < split).count();
        let own: Vec<usize> = done.pivots.iter().map(|p| p.column).collect();
        prop_assert_eq!(in_first(&own), in_first(&dense_pivots), "the first class gives all the pivots it can");
        // With its own choice of pivots the dense way finds the same relations.
        let (reduced, _) = dense(m, &own);
        let mut back = back_substitute(&done);
        for (row, &column) in own.iter().enumerate() {
            let expressed = back.express(&mut x, column);
            let expected: Vec<(usize, Rational)> = (0..columns)
                .filter(|c| *c != column && !reduced[row][*c].is_zero())
                .map(|c| (c, -&reduced[row][c]))
                .collect();
            let found: Vec<(usize, Rational)> =
                expressed.0.iter().map(|&(c, e)| (c, x.is_number(e).unwrap().clone())).collect();
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn symbolic_relations_hold(m in matrix()) {
        // Every nonzero entry is a symbol of its own; what comes out solves every row.
        let mut x = Exprs::default();
        let mut symbols = Vec::new();
        let rows: Vec<SparseRow> = m.iter().map(|row| {
            let entries = row.iter().enumerate().filter(|e| !e.1.is_zero());
            SparseRow(entries.map(|(c, _)| {
                let s = x.symbol(&format!("s{}", symbols.len()), Facts::default());
                symbols.push(s);
                (c, x.sym(s))
            }).collect())
        }).collect();
        let columns = m[0].len();
        let done = eliminate(&mut x, rows.clone(), &[(0..columns).collect()]);
        prop_assert_eq!(done.pivots.len(), done.watched.len());
        let mut back = back_substitute(&done);
        let solution: Vec<SparseRow> = (0..columns).map(|c| back.express(&mut x, c)).collect();
        for row in &rows {
            for free in 0..columns {
                let terms: Vec<Expr> = row.0.iter().filter_map(|&(c, e)| {
                    let at = solution[c].0.iter().find(|s| s.0 == free)?.1;
                    Some(x.mul(&[e, at]))
                }).collect();
                let sum = x.add(&terms);
                prop_assert!(x.is_zero(sum));
            }
        }
    }
}

#[test]
fn takes_simple_pivots_first() {
    let mut x = Exprs::default();
    let row =
        |x: &mut Exprs, entries: &[(usize, &str)]| SparseRow(entries.iter().map(|(c, t)| (*c, read(x, t))).collect());
    let rows = vec![row(&mut x, &[(0, "q"), (1, "K"), (2, "1")]), row(&mut x, &[(0, "1"), (1, "2*K"), (2, "q")])];
    let done = eliminate(&mut x, rows, &[vec![0, 1]]);
    assert_eq!(done.pivots[0].divisor, ONE);
    assert_eq!(done.pivots[0].column, 0);
    assert_eq!(done.watched, vec![read(&mut x, "K - 2*K*q")]);
}

#[test]
fn pivots_that_vanish_at_the_parameters_are_dropped() {
    let mut x = Exprs::default();
    let one = ONE;
    let gain = read(&mut x, "1 - R1/R2");
    let rows = vec![SparseRow(vec![(0, gain), (1, one)])];
    let done = eliminate(&mut x, rows, &[vec![0], vec![1]]);
    assert_eq!(done.degenerate, vec![gain]);
    assert_eq!(done.pivots[0].column, 1);
}

#[test]
fn rows_without_candidates_are_left() {
    let mut x = Exprs::default();
    let two = x.int(2);
    let rows = vec![SparseRow(vec![(0, ONE), (2, ONE)]), SparseRow(vec![(0, two), (2, ONE), (3, ONE)])];
    let done = eliminate(&mut x, rows, &[vec![0, 1]]);
    assert_eq!(done.rest, vec![SparseRow(vec![(2, MINUS_ONE), (3, ONE)])]);
}

/// A ladder of junctions: rows `e(k) - e(k+1) - r(k)` and `f(k) - f(k+1) - g(k)`.
#[test]
fn long_ladders_stay_sparse() {
    let mut x = Exprs::default();
    let n = 4000;
    let mut rows = Vec::new();
    for k in 0..n {
        for part in 0..2 {
            let at = |k: usize| 4 * k + part;
            rows.push(SparseRow(vec![(at(k), ONE), (4 * k + 2 + part, MINUS_ONE), (at(k + 1), MINUS_ONE)]));
        }
    }
    let ports: Vec<usize> = (0..n).flat_map(|k| [4 * k, 4 * k + 1]).collect();
    let done = eliminate(&mut x, rows, &[ports]);
    assert_eq!(done.pivots.len(), 2 * n);
    assert!(done.pivots.iter().map(|p| p.row.0.len()).sum::<usize>() <= 12 * n, "no fill");
}
