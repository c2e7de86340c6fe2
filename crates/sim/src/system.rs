//! What can be integrated.

use crate::{Failure, Sparsity};

/// What is integrated: `x' = f(t, x)`, possibly with algebraic solve blocks inside, which stay hidden.
///
/// # Jumps and sides
///
/// Between two jumps every function here is smooth, so that a step may evaluate it anywhere, slightly beyond the
/// step included. A system therefore holds a *mode*, which only [`cross_jump`](System::cross_jump) changes:
///
/// - the *current interval* of time, from the jump last crossed to the one [`next_jump`](System::next_jump) announces.
///   Conditions on time alone, corners of tables and held samples are evaluated as in the inside of this interval,
///   whatever `t` they are asked at. So `if t < 0.3 then a else b` gives `a` in a step that ends at 0.3, and `b` at the
///   same instant after `cross_jump(0.3, …)`.
/// - the *side* of each switching function of the state: `true` while it is `> 0`, `false` while it is `<= 0`
///   (a condition `x >= 0` is the negation of the side of `-x`). Both branches must be evaluable a little beyond the
///   switch.
///
/// An integration starts with `cross_jump(from, x)`: the start counts as a jump. It stops exactly at each jump and each
/// located crossing, calls `cross_jump` and goes on from there.
///
/// All slices have the documented lengths; times are in s, everything else in the unit of its variable.
pub trait System {
    /// Number of states: the length of `x`, `dx`, `v` and `jv`.
    fn states(&self) -> usize;

    /// How messages name a state, as in `body.p`. Called only when a run fails.
    fn state_name(&self, state: usize) -> String {
        format!("state {}", state + 1)
    }

    /// How messages name a switching function, as in `the condition of valve`. Called only when a run fails.
    fn switch_name(&self, switch: usize) -> String {
        format!("condition {}", switch + 1)
    }

    /// How messages name a recorded value, as in `R1.e`. Called only when a run fails.
    fn observed_name(&self, value: usize) -> String {
        format!("recorded value {}", value + 1)
    }

    /// Typical magnitude of each state, one entry a state, each at least 0; 0 where it is not known. Absolute
    /// tolerances come from it when the user gives none.
    fn scales(&self) -> &[f64];

    /// Rates `dx = f(t, x)` in the present mode.
    ///
    /// # Errors
    /// A failure names time and element: not finite, vanishing pivot, failed Newton, law out of its domain. A
    /// variable-step method tries a shorter step before it gives up.
    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure>;

    /// Directional derivative `jv = (∂f/∂x)(t, x) · v`, exact, in the present mode.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn tangent(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure>;

    /// Derivative of the rates by time alone, `out = (∂f/∂t)(t, x)`, exact, in the present mode: what sources, inputs and
    /// held signals do to them.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn drift(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure>;

    /// Where `∂f/∂x` may be nonzero, in whatever mode.
    fn sparsity(&self) -> &Sparsity;

    /// All of `∂f/∂x` at once, in the present mode: its nonzeros in the order of [`sparsity`](System::sparsity). False if
    /// the system has it by [`tangent`](System::tangent) only; then nothing is written.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        let _ = (t, x, values);
        Ok(false)
    }

    /// Values recorded at `(t, x)`, [`observed`](System::observed) of them.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn observe(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure>;

    /// Number of values that [`observe`](System::observe) writes.
    fn observed(&self) -> usize;

    /// The first instant after `t` known in advance at which something jumps: a step in a source, a corner of an input
    /// table, the next sample or the arrival of a delayed jump. `None`: nothing jumps any more. The integrator stops
    /// exactly there, to the last bit.
    fn next_jump(&mut self, t: f64) -> Option<f64>;

    /// Whether the jump announced at `t` is a mere corner, as between rows of an input table: neither values nor rates jump
    /// there, only slopes. Asked before it is crossed.
    fn is_corner(&mut self, t: f64) -> bool {
        let _ = t;
        false
    }

    /// The integration stands at `t`: at its start, exactly at an announced jump, or just past a located crossing. Up
    /// to here the old mode was used. Moves the current interval if `t` has reached the jump, takes the sides of all
    /// switching functions from their values at `(t, x)`, and may change `x`.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn cross_jump(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure>;

    /// The step that ends at `(t, x)` is accepted, or the run starts there: Newton starting points and delay buffers, which belong to the
    /// model's state, move on. Times never decrease from call to call.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn accept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure>;

    /// Number of switching functions of the state (`if x > 0`); 0 if there are none.
    fn switches(&self) -> usize;

    /// Switching functions at `(t, x)`, [`switches`](System::switches) of them, in the present mode, each continuous
    /// in `t` and `x`.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn switch_values(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure>;
}
