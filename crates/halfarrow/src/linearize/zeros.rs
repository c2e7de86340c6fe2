//! Invariant zeros by reduction to a system with an invertible feedthrough. Source: \[EV\].
//!
//! The pencil of a system has as many infinite generalised eigenvalues as outputs lag behind inputs, and in numbers these
//! come out as large finite ones. So states that only carry an input towards an output are taken out first, by orthogonal
//! transformations; what is left has finite zeros alone, which are plain eigenvalues.

use nalgebra::DMatrix;

use halfarrow_exec::Linearised;

use crate::linear_algebra::{Complex, eigenvalues};

/// Singular values below this part of the greatest count as zero.
const RANK: f64 = 1e-11;

/// A system in matrices.
#[derive(Clone)]
struct Quadruple {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
}

/// The invariant zeros: where the pencil of the system has a lower rank than elsewhere. `None` if they do not come out.
pub(super) fn zeros(linear: &Linearised) -> Option<Vec<Complex>> {
    let (n, m, p) = (linear.a.len(), linear.b.first().or(linear.d.first()).map_or(0, Vec::len), linear.d.len());
    if m == 0 || p == 0 {
        return Some(Vec::new());
    }
    let full = |rows: &[Vec<f64>], r: usize, c: usize| DMatrix::from_fn(r, c, |i, j| rows[i][j]);
    let whole = Quadruple {
        a: full(&linear.a, n, n),
        b: full(&linear.b, n, m),
        c: full(&linear.c, p, n),
        d: full(&linear.d, p, m),
    };
    let reduced = compress(&compress(&scaled(whole)?).transposed());
    let order = reduced.a.nrows();
    let left = match reduced.d.nrows() {
        0 => reduced.a,
        _ => &reduced.a - &reduced.b * reduced.d.clone().lu().solve(&reduced.c)?,
    };
    let rows: Vec<Vec<f64>> = (0..order).map(|i| (0..order).map(|j| left[(i, j)]).collect()).collect();
    eigenvalues(&rows)
}

/// Rows, columns and states of like size, so that one threshold serves all; zeros stay.
fn scaled(mut q: Quadruple) -> Option<Quadruple> {
    let n = q.a.nrows();
    let states = nalgebra::linalg::balancing::balance_parlett_reinsch(&mut q.a);
    for i in 0..n {
        let factor = states[i];
        q.b.row_mut(i).iter_mut().for_each(|b| *b /= factor);
        q.c.column_mut(i).iter_mut().for_each(|c| *c *= factor);
    }
    let size = q.a.amax();
    for j in 0..q.b.ncols() {
        let most = q.b.column(j).amax().max(q.d.column(j).amax());
        let factor = if most > 0.0 { size.max(f64::MIN_POSITIVE) / most } else { 1.0 };
        q.b.column_mut(j).scale_mut(factor);
        q.d.column_mut(j).scale_mut(factor);
    }
    for i in 0..q.c.nrows() {
        let most = q.c.row(i).amax().max(q.d.row(i).amax());
        let factor = if most > 0.0 { size.max(f64::MIN_POSITIVE) / most } else { 1.0 };
        q.c.row_mut(i).scale_mut(factor);
        q.d.row_mut(i).scale_mut(factor);
    }
    [&q.a, &q.b, &q.c, &q.d].iter().all(|m| m.iter().all(|v| v.is_finite())).then_some(q)
}

impl Quadruple {
    fn transposed(&self) -> Quadruple {
        let [a, b, c, d] = [&self.a, &self.c, &self.b, &self.d].map(DMatrix::transpose);
        Quadruple { a, b, c, d }
    }
}

/// Takes out states until the feedthrough has full row rank; outputs that then see nothing go.
fn compress(q: &Quadruple) -> Quadruple {
    let mut q = q.clone();
    let size = [&q.a, &q.b, &q.c, &q.d].iter().map(|m| m.amax()).fold(0.0, f64::max);
    loop {
        let (n, p) = (q.a.nrows(), q.d.nrows());
        let (rows, rank) = row_compression(&q.d, size);
        if rank == p {
            return q;
        }
        let (c, d) = (&rows * &q.c, &rows * &q.d);
        let hidden = c.rows(rank, p - rank).into_owned();
        // Columns of the states: those that the rows without feedthrough see come last.
        let (turned, seen) = row_compression(&hidden.transpose(), size);
        if seen == 0 {
            // These outputs see nothing at all.
            return Quadruple { c: c.rows(0, rank).into_owned(), d: d.rows(0, rank).into_owned(), ..q };
        }
        let keep = n - seen;
        let turn = DMatrix::from_fn(n, n, |i, j| turned[((i + seen) % n.max(1), j)]).transpose();
        let a = turn.transpose() * &q.a * &turn;
        let b = turn.transpose() * &q.b;
        let c = c.rows(0, rank).into_owned() * &turn;
        let stack = |above: DMatrix<f64>, below: DMatrix<f64>| {
            let columns = above.ncols().max(below.ncols());
            DMatrix::from_fn(above.nrows() + below.nrows(), columns, |i, j| {
                if i < above.nrows() { above[(i, j)] } else { below[(i - above.nrows(), j)] }
            })
        };
        q = Quadruple {
            c: stack(c.columns(0, keep).into_owned(), a.view((keep, 0), (seen, keep)).into_owned()),
            d: stack(d.rows(0, rank).into_owned(), b.rows(keep, seen).into_owned()),
            a: a.view((0, 0), (keep, keep)).into_owned(),
            b: b.rows(0, keep).into_owned(),
        };
    }
}

/// An orthogonal matrix that leaves in the first rows of `m` all it has, and zero in the others; and its rank.
fn row_compression(m: &DMatrix<f64>, size: f64) -> (DMatrix<f64>, usize) {
    let n = m.nrows();
    if n == 0 || m.ncols() == 0 || m.amax() <= RANK * size {
        return (DMatrix::identity(n, n), 0);
    }
    // Columns of zeros make the left factor square.
    let wide = DMatrix::from_fn(n, m.ncols().max(n), |i, j| if j < m.ncols() { m[(i, j)] } else { 0.0 });
    let svd = wide.svd(true, false);
    let mut order: Vec<usize> = (0..svd.singular_values.len()).collect();
    order.sort_by(|&a, &b| svd.singular_values[b].total_cmp(&svd.singular_values[a]));
    let rank = order.iter().filter(|&&i| svd.singular_values[i] > RANK * size).count();
    let u = svd.u.unwrap_or_else(|| DMatrix::identity(n, n));
    (DMatrix::from_fn(n, n, |i, j| u[(j, order[i])]), rank)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(a: &[&[f64]], b: &[&[f64]], c: &[&[f64]], d: &[&[f64]]) -> Linearised {
        let own = |m: &[&[f64]]| m.iter().map(|row| row.to_vec()).collect::<Vec<_>>();
        Linearised { a: own(a), b: own(b), c: own(c), d: own(d), ..Linearised::default() }
    }

    #[test]
    fn chains_of_integrators_have_no_zeros() {
        let a: [&[f64]; 3] = [&[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0], &[-6.0, -11.0, -6.0]];
        let chain = system(&a, &[&[0.0], &[0.0], &[1.0]], &[&[1.0, 0.0, 0.0]], &[&[0.0]]);
        assert_eq!(zeros(&chain), Some(vec![]));
    }

    #[test]
    fn numerators_have_their_roots() {
        // (s + 2)(s - 3) over a denominator of order 3, in companion form.
        let a: [&[f64]; 3] = [&[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0], &[-6.0, -11.0, -6.0]];
        let found = zeros(&system(&a, &[&[0.0], &[0.0], &[1.0]], &[&[-6.0, -1.0, 1.0]], &[&[0.0]])).unwrap();
        assert_eq!(found.len(), 2);
        assert!((found[0][0] + 2.0).abs() < 1e-10 && (found[1][0] - 3.0).abs() < 1e-10, "{found:?}");
    }

    #[test]
    fn a_feedthrough_has_as_many_zeros_as_states() {
        // 1 + 1/(s + 1) = (s + 2)/(s + 1)
        let found = zeros(&system(&[&[-1.0]], &[&[1.0]], &[&[1.0]], &[&[1.0]])).unwrap();
        assert!(found.len() == 1 && (found[0][0] + 2.0).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn outputs_that_repeat_each_other_have_the_zeros_of_one() {
        // (s + 2)/((s + 1)(s + 3)), seen twice.
        let a: [&[f64]; 2] = [&[0.0, 1.0], &[-3.0, -4.0]];
        let found = zeros(&system(&a, &[&[0.0], &[1.0]], &[&[2.0, 1.0], &[4.0, 2.0]], &[&[0.0], &[0.0]])).unwrap();
        assert!(found.len() == 1 && (found[0][0] + 2.0).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn different_outputs_have_no_zero_in_common() {
        // 1/(s + 1) and (s + 2)/(s + 1)^2 vanish nowhere together.
        let a: [&[f64]; 2] = [&[-1.0, 1.0], &[0.0, -1.0]];
        let found = zeros(&system(&a, &[&[1.0], &[1.0]], &[&[0.0, 1.0], &[1.0, 0.0]], &[&[0.0], &[0.0]])).unwrap();
        assert!(found.is_empty(), "{found:?}");
    }
}
