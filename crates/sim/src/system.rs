//! What can be integrated.

use crate::{Events, Failure, Sparsity};

/// What is integrated: `x' = f(t, x)`, possibly with algebraic solve blocks inside, which stay hidden.
///
/// All functions are evaluated in the present mode of the system, which its [`Events`] describe and change; their point is
/// `x`.
///
/// All slices have the documented lengths; times are in s, everything else in the unit of its variable.
pub trait System {
    /// Number of states: the length of `x`, `dx`, `v` and `jv`.
    fn states(&self) -> usize;

    /// How messages name a state, as in `body.p`. Called only when a run fails.
    fn state_name(&self, state: usize) -> String {
        format!("state {}", state + 1)
    }

    /// Typical magnitude of each state, one entry a state, each at least 0; 0 where it is not known. Absolute
    /// tolerances come from it when the user gives none.
    fn scales(&self) -> &[f64];

    /// Rates `dx = f(t, x)`.
    ///
    /// # Errors
    /// A failure names time and element: not finite, vanishing pivot, failed Newton, law out of its domain. A
    /// variable-step method tries a shorter step before it gives up.
    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure>;

    /// Directional derivative `jv = (∂f/∂x)(t, x) · v`, exact.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn directional_derivative(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure>;

    /// Derivative of the rates by time alone, `out = (∂f/∂t)(t, x)`, exact: what sources, inputs and held signals do to
    /// them.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn time_derivative(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure>;

    /// Whether differences of the rates do where a Jacobian need not be exact, since directional derivatives take much longer.
    fn compares_rates(&self) -> bool {
        false
    }

    /// Whether laws are infinitely steep where states may come to rest, as that of an orifice between equal levels: then slopes
    /// are taken beside such points, as far as an error is allowed.
    fn is_steep(&self) -> bool {
        false
    }

    /// Where `∂f/∂x` may be nonzero, in whatever mode.
    fn sparsity(&self) -> &Sparsity;

    /// Of how many equal blocks on its diagonal `∂f/∂x` is made, with nothing beside them: then one of them is factored for
    /// all. The states and [`sparsity`](System::sparsity) are those of all blocks.
    fn blocks(&self) -> usize {
        1
    }

    /// All of `∂f/∂x` at once: its nonzeros in the order of [`sparsity`](System::sparsity). False if the system has it by
    /// [`directional_derivative`](System::directional_derivative) only; then nothing is written.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        let _ = (t, x, values);
        Ok(false)
    }
}

/// A system with events: what a run takes.
pub trait HybridSystem: System + Events {}

impl<S: System + Events> HybridSystem for S {}
