//! On which side of the imaginary axis poles are, and how many of their digits are known.

use serde::Serialize;

use crate::linear_algebra::{Complex, uncertainties};

/// Where the poles are, beyond what rounding leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stability {
    /// All are left of the imaginary axis: motions die out.
    Asymptotic,
    /// None is right of it, and some are on it: nothing drives these motions and nothing damps them.
    Marginal,
    /// Some are right of it: motions grow.
    Unstable,
}

/// Roundings that every entry of a matrix has seen.
const ROUNDINGS: f64 = 64.0;
/// Poles known to fewer digits are told.
const DIGITS: f64 = 6.0;
/// Larger matrices are not tried out: a pole counts as it comes.
pub(super) const AT_MOST: usize = 200;

/// Where the poles of a matrix are, and a note on those of which few digits are known.
pub(super) fn stability(a: &[Vec<f64>], poles: &[Complex]) -> (Stability, Option<String>) {
    let known = if poles.len() <= AT_MOST { uncertainties(a, poles, ROUNDINGS) } else { None };
    let known = known.unwrap_or_else(|| vec![0.0; poles.len()]);
    let size = |p: &Complex| libm::hypot(p[0], p[1]);
    // The iteration for eigenvalues itself leaves a rounding of the greatest one.
    let floor = f64::EPSILON * poles.iter().map(size).fold(0.0, f64::max);
    let off: Vec<f64> = known.iter().map(|off| off.max(floor)).collect();
    // A real part below rounding of its own pole is none, however near the neighbours are; a few trials do not find the
    // worst that roundings do.
    let reach = |p: &Complex, off: f64| (2.0 * off).max(4.0 * f64::EPSILON * size(p));
    let beyond = |(p, off): (&Complex, &f64)| p[0] > reach(p, *off);
    let within = |(p, off): (&Complex, &f64)| p[0] < -reach(p, *off);
    let both = || poles.iter().zip(&off);
    let stability = match (both().any(beyond), both().all(within)) {
        (true, _) => Stability::Unstable,
        (false, true) => Stability::Asymptotic,
        (false, false) => Stability::Marginal,
    };
    (stability, worst("pole", poles, &off))
}

/// The pole, or zero, of which the fewest digits are known, if these are few.
pub(super) fn worst(what: &str, poles: &[Complex], off: &[f64]) -> Option<String> {
    let digits = |p: &Complex, off: f64| -libm::log10(off / libm::hypot(p[0], p[1]));
    // A pole below a rounding of the greatest one is zero, and known as that.
    let size = |p: &Complex| libm::hypot(p[0], p[1]);
    let zero = 4.0 * f64::EPSILON * poles.iter().map(size).fold(0.0, f64::max);
    let moving = poles.iter().zip(off).filter(|(p, _)| size(p) > zero);
    let (pole, known) = moving
        .map(|(p, off)| (p, digits(p, *off)))
        .filter(|(_, known)| *known < DIGITS)
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let known = known.max(0.0).floor();
    let name =
        if pole[1] == 0.0 { format!("{:.3e}", pole[0]) } else { format!("{:.3e} ± {:.3e} i", pole[0], pole[1].abs()) };
    Some(format!(
        "of the {what} {name} about {known} digits are known: the entries of the matrix are of such different magnitudes, or \
         {what}s so near to each other, that rounding moves it"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::eigenvalues;

    fn told(a: &[Vec<f64>]) -> (Stability, Option<String>) {
        stability(a, &eigenvalues(a).unwrap())
    }

    #[test]
    fn sides_of_the_axis() {
        assert_eq!(told(&[vec![0.0, 1.0], vec![-4.0, 0.0]]), (Stability::Marginal, None));
        assert_eq!(told(&[vec![-1e-9, 1.0], vec![-4.0, 0.0]]), (Stability::Asymptotic, None));
        assert_eq!(told(&[vec![1e-9, 1.0], vec![-4.0, 0.0]]), (Stability::Unstable, None));
        assert_eq!(told(&[vec![-6.7e-17]]), (Stability::Asymptotic, None));
        assert_eq!(told(&[]), (Stability::Asymptotic, None));
        // An angle and the spring that follows it: one pole is zero, up to rounding.
        let kept = [vec![-10.0, -894.427, 100.0], vec![0.447214, 0.0, -5e-26], vec![1.0, 0.0, 0.0]];
        assert_eq!(told(&kept), (Stability::Marginal, None));
    }

    #[test]
    fn poles_that_rounding_moves_are_told() {
        // A row of integrators with feedback: three poles at the third root of 1e-30, of a matrix with entries of 1.
        let (side, note) = told(&[vec![-1.0, 1.0, 0.0], vec![-1.0, 1.0, 1.0], vec![1e-30, 0.0, 0.0]]);
        assert_eq!(side, Stability::Marginal);
        assert!(note.is_some_and(|note| note.contains("0 digits")), "{side:?}");
    }
}
