//! Eigenvalues, by the library; complex numbers as pairs of real and imaginary part.

use faer::Mat;
use nalgebra::DMatrix;
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use petgraph::algo::tarjan_scc;
use petgraph::graph::DiGraph;

/// A complex number: real and imaginary part.
pub(crate) type Complex = [f64; 2];

/// Entries whose squares are numbers.
const SQUARED: std::ops::Range<f64> = 1e-100..1e100;
/// Matrices that are tried to see what roundings do.
const TRIALS: u32 = 3;

/// Eigenvalues of a square matrix, by imaginary parts within real ones, ascending; `None` if it is not finite, or they
/// are not found.
///
/// States that act on each other both ways have eigenvalues of their own: what acts in one way only moves none of them, and
/// rounding of it would. Each such group is balanced: scales range over many decades in one model.
pub(crate) fn eigenvalues(rows: &[Vec<f64>]) -> Option<Vec<Complex>> {
    let n = rows.len();
    if rows.iter().flatten().any(|entry| !entry.is_finite()) {
        return None;
    }
    let acts = (0..n).flat_map(|i| (0..n).filter(move |&j| rows[i][j] != 0.0).map(move |j| (j as u32, i as u32)));
    let mut graph = DiGraph::<(), ()>::from_edges(acts);
    for _ in graph.node_count()..n {
        graph.add_node(());
    }
    let mut found = Vec::with_capacity(n);
    for mut group in tarjan_scc(&graph) {
        group.sort_unstable();
        match group[..] {
            [alone] => found.push([rows[alone.index()][alone.index()], 0.0]),
            _ => found.extend(of_group(&DMatrix::from_fn(group.len(), group.len(), |i, j| {
                rows[group[i].index()][group[j].index()]
            }))?),
        }
    }
    found.iter().flatten().all(|part| part.is_finite()).then(|| sorted(found))
}

/// Eigenvalues of states that act on each other.
fn of_group(matrix: &DMatrix<f64>) -> Option<Vec<Complex>> {
    let n = matrix.nrows();
    // Squares that overflow would keep the library from ever ending.
    let most = matrix.amax();
    let unit = if SQUARED.contains(&most) || most == 0.0 { 1.0 } else { most };
    let mut balanced = matrix / unit;
    balance_parlett_reinsch(&mut balanced);
    let found = Mat::from_fn(n, n, |i, j| balanced[(i, j)]).eigenvalues().ok()?;
    Some(found.into_iter().map(|z| [z.re * unit, z.im * unit]).collect())
}

/// By how much each eigenvalue is uncertain if every entry of the matrix is known to so many roundings only: the distance
/// to its own eigenvalue of matrices that differ by that. `None` if they are not found.
pub(crate) fn uncertainties(rows: &[Vec<f64>], values: &[Complex], roundings: f64) -> Option<Vec<f64>> {
    let mut most = vec![0.0f64; values.len()];
    for seed in 1..=TRIALS {
        let mut noise = seed;
        let mut shaken = rows.to_vec();
        for entry in shaken.iter_mut().flatten() {
            *entry *= 1.0 + roundings * f64::EPSILON * scatter(&mut noise);
        }
        let others = eigenvalues(&shaken)?;
        most.iter_mut().zip(moved(values, &others)).for_each(|(most, by)| *most = most.max(by));
    }
    Some(most)
}

/// From -1 to 1: Numerical Recipes' quick generator. Any scatter of signs and sizes will do that is the same every time.
pub(crate) fn scatter(noise: &mut u32) -> f64 {
    *noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    f64::from(*noise) / f64::from(u32::MAX) * 2.0 - 1.0
}

/// How far each value is from its own one among others: the nearest pairs belong together, and each value is in one pair, so
/// that a value in the middle of a cluster is not taken for all that have moved around it.
pub(crate) fn moved(values: &[Complex], others: &[Complex]) -> Vec<f64> {
    let apart = |z: &Complex, w: &Complex| libm::hypot(w[0] - z[0], w[1] - z[1]);
    let row =
        |(i, z): (usize, &Complex)| others.iter().enumerate().map(|(j, w)| (apart(z, w), i, j)).collect::<Vec<_>>();
    let mut pairs: Vec<(f64, usize, usize)> = values.iter().enumerate().flat_map(row).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut taken = vec![false; others.len()];
    let mut by: Vec<Option<f64>> = vec![None; values.len()];
    for (apart, i, j) in pairs {
        if by[i].is_none() && !taken[j] {
            (by[i], taken[j]) = (Some(apart), true);
        }
    }
    by.into_iter().map(|by| by.unwrap_or(f64::INFINITY)).collect()
}

/// By real, then imaginary part; equal up to rounding counts as equal, so that pairs stay together.
fn sorted(mut values: Vec<Complex>) -> Vec<Complex> {
    let size = values.iter().map(|z| libm::hypot(z[0], z[1])).fold(0.0f64, f64::max);
    let step = (1e-9 * size).max(f64::MIN_POSITIVE);
    let place = |x: f64| (x / step).round();
    values.sort_by(|a, b| place(a[0]).total_cmp(&place(b[0])).then(a[1].total_cmp(&b[1])));
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: &[Complex], wanted: &[Complex], tolerance: f64) {
        assert_eq!(found.len(), wanted.len(), "{found:?}");
        for (a, b) in found.iter().zip(wanted) {
            let apart = libm::hypot(a[0] - b[0], a[1] - b[1]);
            assert!(apart <= tolerance * libm::hypot(b[0], b[1]).max(1e-300), "{found:?} is not {wanted:?}");
        }
    }

    #[test]
    fn known_spectra() {
        near(&eigenvalues(&[vec![3.0]]).unwrap(), &[[3.0, 0.0]], 1e-15);
        near(&eigenvalues(&[vec![0.0, 1.0], vec![-4.0, 0.0]]).unwrap(), &[[0.0, -2.0], [0.0, 2.0]], 1e-15);
        // Scales nine decades apart.
        let stiff = [vec![-1.0, 1e9], vec![-1e-9, -2.0]];
        let root = libm::sqrt(0.75);
        near(&eigenvalues(&stiff).unwrap(), &[[-1.5, -root], [-1.5, root]], 1e-12);
        // Poles nine decades apart are told apart, a double one is known to half of the digits.
        let poles = eigenvalues(&stiff).unwrap();
        assert!(uncertainties(&stiff, &poles, 16.0).unwrap().iter().all(|off| *off > 0.0 && *off < 1e-13));
        let double = [vec![1.0, 1.0], vec![0.0, 1.0 + 1e-14]];
        let poles = eigenvalues(&double).unwrap();
        assert!(uncertainties(&double, &poles, 16.0).unwrap().iter().all(|off| *off < 1e-7));
        // Two integrators in a row between others that act in one way only: poles at 0 to the last digit.
        let row =
            [[0.0, 0.0, 3.0, 0.0], [7.0, 0.0, 0.0, 0.3], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1e7, -2.0]].map(Vec::from);
        assert_eq!(eigenvalues(&row).unwrap(), [[-2.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]);
        assert_eq!(eigenvalues(&[]).unwrap(), Vec::<Complex>::new());
        assert!(eigenvalues(&[vec![f64::NAN]]).is_none());
    }
}
