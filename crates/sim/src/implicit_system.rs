//! What can be integrated in implicit form.

use crate::{Events, Failure, Sparsity};

/// What is integrated in implicit form: `F(t, y, y') = 0`, as many equations as unknowns. `∂F/∂y'` may depend on `y` and
/// may be singular: unknowns whose rate occurs nowhere are algebraic.
///
/// | form | `F` |
/// |---|---|
/// | explicit | `y' - f(t, y)` |
/// | semi-explicit | `M y' - f(t, y)`, `M` constant and singular |
/// | fully implicit | anything |
///
/// # Index
///
/// [`index`](ImplicitSystem::index) tells for each unknown how often the equations have to be differentiated until its
/// rate is known as a function of the unknowns, at least 1: 1 for unknowns with a differential equation and for algebraic
/// ones of index 1; 2, 3 for those of higher index. In a pendulum `q' = v, v' = g + Gᵀ λ` these are, `q, v, λ`: with
/// the length as the constraint 1, 2, 3; with the velocity 1, 1, 2; with the acceleration 1, 1, 1. Errors of an unknown
/// of index `i` are weighted with the step to the power `i - 1`, without which no step is short enough.
///
/// All functions are evaluated in the present mode of the system, which its [`Events`] describe and change; their point is
/// `y`, then `y'`.
///
/// All slices have the documented lengths; times are in s, everything else in the unit of its unknown or equation.
pub trait ImplicitSystem {
    /// Number of unknowns, which is that of the equations: the length of `y`, `yp` and residuals.
    fn unknowns(&self) -> usize;

    /// How messages name an unknown, as in `body.p`. Called only when a run fails.
    fn unknown_name(&self, unknown: usize) -> String {
        format!("unknown {}", unknown + 1)
    }

    /// How messages name an equation, as in `the rate of body.p`. Called only when a run fails.
    fn equation_name(&self, equation: usize) -> String {
        format!("equation {}", equation + 1)
    }

    /// Typical magnitude of each unknown where a run starts at `t`, `span` s before its end, one entry an unknown, each at
    /// least 0; 0 where it is not known. Absolute tolerances come from it when the user gives none.
    ///
    /// # Errors
    /// As [`residual`](ImplicitSystem::residual).
    fn scales(&mut self, t: f64, span: f64) -> Result<Vec<f64>, Failure>;

    /// What sort each unknown is of, one entry an unknown: those of one sort are told in the same unit, and what is rounding
    /// beside the greatest of them says nothing. Each is of its own where that is not known.
    fn sorts(&self) -> Vec<usize> {
        (0..self.unknowns()).collect()
    }

    /// Index of an unknown: 1, 2 or 3.
    fn index(&self, unknown: usize) -> u8;

    /// Whether laws are infinitely steep where unknowns may come to rest, as [`System::is_steep`](crate::System::is_steep).
    fn is_steep(&self) -> bool {
        false
    }

    /// Residuals `out = F(t, y, y')`. `yp` of an algebraic unknown is not read.
    ///
    /// # Errors
    /// A failure names time and element: not finite, vanishing pivot, law out of its domain. A shorter step is tried
    /// before the run gives up.
    fn residual(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure>;

    /// Where `∂F/∂y` or `∂F/∂y'` may be nonzero, in whatever mode: one column an unknown, one row an equation.
    fn sparsity(&self) -> &Sparsity;

    /// Of how many equal blocks on their diagonal `∂F/∂y` and `∂F/∂y'` are made, with nothing beside them.
    fn blocks(&self) -> usize {
        1
    }

    /// Exact derivatives: `dy = ∂F/∂y` and `dyp = ∂F/∂y'`, each one entry for every nonzero of
    /// [`sparsity`](ImplicitSystem::sparsity), column by column, rows ascending. Entries that are 0 are written as well.
    ///
    /// # Errors
    /// As [`residual`](ImplicitSystem::residual).
    fn jacobian(&mut self, t: f64, y: &[f64], yp: &[f64], dy: &mut [f64], dyp: &mut [f64]) -> Result<(), Failure>;

    /// In semi-explicit form with a mass matrix of ones and zeros: for each equation whether it is `y_i' - f_i(t, y)`
    /// (`true`), of the unknown with the same number, or `- f_i(t, y)` (`false`), which holds no rate. `None` for every
    /// other form. Methods for semi-explicit systems of index 1 ask for it.
    fn semi_explicit(&self) -> Option<&[bool]> {
        None
    }

    /// Whether events may lead to other unknowns.
    fn changes_unknowns(&self) -> bool {
        false
    }

    /// All unknowns, then their rates, where the last event has led to other ones: the method begins anew there. From that
    /// event on until they are asked for, what is asked at any point is answered at this one, and
    /// [`exchange_independent`](Events::exchange_independent) says that the system has changed.
    fn new_point(&mut self) -> Option<Vec<f64>> {
        None
    }
}

/// A system in implicit form with events: what a run takes.
pub trait HybridImplicitSystem: ImplicitSystem + Events {}

impl<S: ImplicitSystem + Events> HybridImplicitSystem for S {}

/// The unknowns and the rates of a point of a system in implicit form.
pub fn halves(point: &[f64]) -> (&[f64], &[f64]) {
    point.split_at(point.len() / 2)
}

/// As [`halves`].
pub fn halves_mut(point: &mut [f64]) -> (&mut [f64], &mut [f64]) {
    let half = point.len() / 2;
    point.split_at_mut(half)
}
