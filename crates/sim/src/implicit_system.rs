//! What can be integrated in implicit form.

use crate::{Failure, Sparsity};

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
/// # Jumps and sides
///
/// As for [`System`](crate::System): between two jumps every function here is smooth, and only
/// [`cross_jump`](ImplicitSystem::cross_jump) changes the mode.
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

    /// How messages name a switching function, as in `the condition of valve`. Called only when a run fails.
    fn switch_name(&self, switch: usize) -> String {
        format!("condition {}", switch + 1)
    }

    /// How messages name a recorded value, as in `R1.e`. Called only when a run fails.
    fn observed_name(&self, value: usize) -> String {
        format!("recorded value {}", value + 1)
    }

    /// Typical magnitude of each unknown where a run starts at `t`, `span` s before its end, one entry an unknown, each at
    /// least 0; 0 where it is not known. Absolute tolerances come from it when the user gives none.
    ///
    /// # Errors
    /// As [`residual`](ImplicitSystem::residual).
    fn scales(&mut self, t: f64, span: f64) -> Result<Vec<f64>, Failure>;

    /// Index of an unknown: 1, 2 or 3.
    fn index(&self, unknown: usize) -> u8;

    /// Residuals `out = F(t, y, y')` in the present mode. `yp` of an algebraic unknown is not read.
    ///
    /// # Errors
    /// A failure names time and element: not finite, vanishing pivot, law out of its domain. A shorter step is tried
    /// before the run gives up.
    fn residual(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure>;

    /// Where `∂F/∂y` or `∂F/∂y'` may be nonzero, in whatever mode: one column an unknown, one row an equation.
    fn sparsity(&self) -> &Sparsity;

    /// Exact derivatives in the present mode: `dy = ∂F/∂y` and `dyp = ∂F/∂y'`, each one entry for every nonzero of
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

    /// Values recorded at `(t, y, y')`, [`observed`](ImplicitSystem::observed) of them.
    ///
    /// # Errors
    /// As [`residual`](ImplicitSystem::residual).
    fn observe(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure>;

    /// Number of values that [`observe`](ImplicitSystem::observe) writes.
    fn observed(&self) -> usize;

    /// The first instant after `t` known in advance at which something jumps. `None`: nothing jumps any more. The
    /// integrator stops exactly there, to the last bit.
    fn next_jump(&mut self, t: f64) -> Option<f64>;

    /// Whether the jump announced at `t` is a mere corner, as between rows of an input table: no value jumps there. Asked
    /// before it is crossed.
    fn is_corner(&mut self, t: f64) -> bool {
        let _ = t;
        false
    }

    /// The integration stands at `t`: at its start, exactly at an announced jump, or just past a located crossing. Moves
    /// the current interval, takes the sides, and leaves `y` and `yp` consistent with the new mode: `F = 0`, and the
    /// hidden constraints of a higher index hold as well. `yp` of an algebraic unknown may be anything finite.
    ///
    /// # Errors
    /// As [`residual`](ImplicitSystem::residual).
    fn cross_jump(&mut self, t: f64, y: &mut [f64], yp: &mut [f64]) -> Result<(), Failure>;

    /// The step that ends at `(t, y, y')` is accepted, or the run starts there. Times never decrease from call to call.
    ///
    /// # Errors
    /// As [`residual`](ImplicitSystem::residual).
    fn accept(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(), Failure>;

    /// Number of switching functions; 0 if there are none.
    fn switches(&self) -> usize;

    /// Switching functions at `(t, y, y')`, [`switches`](ImplicitSystem::switches) of them, in the present mode. The side
    /// of one is `true` while it is `> 0`.
    ///
    /// # Errors
    /// As [`residual`](ImplicitSystem::residual).
    fn switch_values(&mut self, t: f64, y: &[f64], yp: &[f64], g: &mut [f64]) -> Result<(), Failure>;
}
