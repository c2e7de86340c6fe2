//! Invariant zeros by reduction to a system with an invertible feedthrough. Source: \[EV\].
//!
//! The pencil of a system has as many infinite generalised eigenvalues as outputs lag behind inputs, and in numbers these
//! come out as large finite ones. So states that only carry an input towards an output are taken out first; what is left
//! has finite zeros alone, which are plain eigenvalues.

use super::known::{Known, TRIALS};
use super::stability::{AT_MOST, worst};
use super::state_space::{Rows, StateSpace, largest};
use crate::linear_algebra::{Complex, eigenvalues, moved};

/// The invariant zeros: where the pencil of the system has a lower rank than elsewhere; and a note on the one of which the
/// fewest digits are known, if these are few. `None` if they do not come out.
pub(super) fn zeros(system: Option<&StateSpace>) -> (Option<Vec<Complex>>, Option<String>) {
    let Some(system) = system else { return (None, None) };
    if system.inputs == 0 || system.c.is_empty() {
        return (Some(Vec::new()), None);
    }
    let mut system = system.clone();
    system.compress();
    let mut system = system.transposed();
    system.compress();
    system.without_feedthrough();
    let of = |trial: usize| {
        let row = |&i: &usize| system.free.iter().map(|&j| system.a[i][j].in_trial(trial)).collect();
        eigenvalues(&system.free.iter().map(row).collect::<Vec<Vec<f64>>>())
    };
    let Some(found) = of(0) else { return (None, None) };
    let mut off = vec![0.0f64; found.len()];
    let trials = if found.len() <= AT_MOST { TRIALS } else { 0 };
    for others in (1..=trials).filter_map(of) {
        off.iter_mut().zip(moved(&found, &others)).for_each(|(off, by)| *off = off.max(by));
    }
    let note = worst("zero", &found, &off);
    (Some(found), note)
}

impl StateSpace {
    /// Takes out states until the feedthrough has full row rank; outputs that then see nothing go.
    fn compress(&mut self) {
        loop {
            let rank = echelon(&mut self.d, &mut self.c);
            if rank == self.d.len() {
                return;
            }
            // Outputs without feedthrough are kept at zero, and so are the states that they see, one each.
            let hidden = self.c.split_off(rank);
            self.d.truncate(rank);
            let seen = self.held_by(hidden);
            self.hold(&seen);
        }
    }

    /// The inputs that keep the outputs at zero put into the rates: `a - b d⁻¹ c`.
    fn without_feedthrough(&mut self) {
        // Each row then holds one input by the states.
        let rank = echelon(&mut self.d, &mut self.c);
        for at in 0..rank {
            let Some(input) = self.d[at].iter().position(|entry| !entry.is_zero()) else { continue };
            let pivot = self.d[at][input];
            for &i in &self.free {
                let (factor, a) = (self.b[i][input].over(pivot), &mut self.a[i]);
                a.iter_mut().zip(&self.c[at]).for_each(|(a, c)| *a = a.less(factor, *c));
            }
        }
    }
}

/// Brings rows to a form in which each has a column of its own, of which all others have nothing, by combinations that also
/// serve the rows beside them; rows that have nothing left come last. How many have something.
fn echelon(rows: &mut Rows, beside: &mut Rows) -> usize {
    let mut rank = 0;
    while rank < rows.len() {
        // The largest part of what its row has keeps factors small.
        let best = (rank..rows.len())
            .filter_map(|i| largest(&rows[i]).map(|j| (i, j)))
            .max_by(|a, b| rows[a.0][a.1].size().total_cmp(&rows[b.0][b.1].size()));
        let Some((from, column)) = best else { break };
        rows.swap(rank, from);
        beside.swap(rank, from);
        for i in (0..rows.len()).filter(|&i| i != rank) {
            if rows[i][column].is_zero() {
                continue;
            }
            let factor = rows[i][column].over(rows[rank][column]);
            for matrix in [&mut *rows, &mut *beside] {
                let pivot = matrix[rank].clone();
                matrix[i].iter_mut().zip(&pivot).for_each(|(entry, pivot)| *entry = entry.less(factor, *pivot));
            }
            rows[i][column] = Known::ZERO;
        }
        rank += 1;
    }
    rank
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfarrow_exec::Linearised;

    fn system(a: &[&[f64]], b: &[&[f64]], c: &[&[f64]], d: &[&[f64]]) -> Linearised {
        let own = |m: &[&[f64]]| m.iter().map(|row| row.to_vec()).collect::<Vec<_>>();
        Linearised { a: own(a), b: own(b), c: own(c), d: own(d), ..Linearised::default() }
    }

    fn of(linear: &Linearised) -> Option<Vec<Complex>> {
        zeros(StateSpace::scaled(linear).as_ref()).0
    }

    #[test]
    fn chains_of_integrators_have_no_zeros() {
        let a: [&[f64]; 3] = [&[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0], &[-6.0, -11.0, -6.0]];
        let chain = system(&a, &[&[0.0], &[0.0], &[1.0]], &[&[1.0, 0.0, 0.0]], &[&[0.0]]);
        assert_eq!(of(&chain), Some(vec![]));
    }

    #[test]
    fn numerators_have_their_roots() {
        // (s + 2)(s - 3) over a denominator of order 3, in companion form.
        let a: [&[f64]; 3] = [&[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0], &[-6.0, -11.0, -6.0]];
        let found = of(&system(&a, &[&[0.0], &[0.0], &[1.0]], &[&[-6.0, -1.0, 1.0]], &[&[0.0]])).unwrap();
        assert_eq!(found.len(), 2);
        assert!((found[0][0] + 2.0).abs() < 1e-10 && (found[1][0] - 3.0).abs() < 1e-10, "{found:?}");
    }

    #[test]
    fn a_feedthrough_has_as_many_zeros_as_states() {
        // 1 + 1/(s + 1) = (s + 2)/(s + 1)
        let found = of(&system(&[&[-1.0]], &[&[1.0]], &[&[1.0]], &[&[1.0]])).unwrap();
        assert!(found.len() == 1 && (found[0][0] + 2.0).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn outputs_that_repeat_each_other_have_the_zeros_of_one() {
        // (s + 2)/((s + 1)(s + 3)), seen twice.
        let a: [&[f64]; 2] = [&[0.0, 1.0], &[-3.0, -4.0]];
        let found = of(&system(&a, &[&[0.0], &[1.0]], &[&[2.0, 1.0], &[4.0, 2.0]], &[&[0.0], &[0.0]])).unwrap();
        assert!(found.len() == 1 && (found[0][0] + 2.0).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn different_outputs_have_no_zero_in_common() {
        // 1/(s + 1) and (s + 2)/(s + 1)^2 vanish nowhere together.
        let a: [&[f64]; 2] = [&[-1.0, 1.0], &[0.0, -1.0]];
        let found = of(&system(&a, &[&[1.0], &[1.0]], &[&[0.0, 1.0], &[1.0, 0.0]], &[&[0.0], &[0.0]])).unwrap();
        assert!(found.is_empty(), "{found:?}");
    }
}
