//! Runs followed backwards: how much a sum of what was recorded weighs each state on the way, and each constant.
//!
//! Forwards, one direction at a time, a derivative costs an evaluation for each constant; backwards, all of them come of one
//! way. Between two events the weights `λ` of the states go by `λ' = -(∂f/∂x)ᵀ λ`, and those of the constants gather
//! `(∂f/∂c)ᵀ λ`. A method of fixed step is followed step by step, by the transposed derivative of the very step; otherwise
//! the weights are integrated along the path that the run has taken. Source: [CaoLiPetzoldSerban].

use crate::fixed_step::FixedMethod;
use crate::{AbsoluteTolerance, Events, Failure, Method, Nobody, Options, Sparsity, Stopped, System, simulate};

/// What a run went through, to be followed backwards.
pub trait Backwards {
    /// How messages name a state.
    fn state_name(&self, state: usize) -> String;

    /// Typical magnitudes of the states on the way, one for each state; 0 where they stayed 0.
    fn magnitudes(&self) -> &[f64];

    /// Those of the constants, 0 where they are 0.
    fn constants(&self) -> &[f64];

    /// Where `(∂f/∂x)ᵀ` may be nonzero.
    fn sparsity(&self) -> &Sparsity;

    /// `(∂f/∂x)ᵀ w` at a time on the way, and `(∂f/∂c)ᵀ w`.
    ///
    /// # Errors
    /// What the system reports there.
    fn products(&mut self, t: f64, w: &[f64], states: &mut [f64], constants: &mut [f64]) -> Result<(), Failure>;
}

/// Takes the weights of states and constants from `from` back to `to`, between which nothing jumps; `rtol` is the relative
/// error allowed in a step, the method one of variable step.
///
/// # Errors
/// What the system reports, or no step is short enough.
pub fn follow_back(
    path: &mut dyn Backwards,
    (from, to): (f64, f64),
    (method, rtol): (Method, f64),
    states: &mut [f64],
    constants: &mut [f64],
) -> Result<(), Failure> {
    let n = states.len();
    let share = |weight: f64, magnitude: f64| (weight * magnitude).abs();
    let greatest = states.iter().zip(path.magnitudes()).map(|(w, m)| share(*w, *m)).fold(0.0, f64::max);
    let greatest = if greatest > 0.0 { greatest } else { states.iter().fold(0.0, |most, w| f64::max(most, w.abs())) };
    if greatest == 0.0 {
        return Ok(());
    }
    // An error of a weight counts by what it is an error of: the weighted sum.
    let allowed = |magnitude: &f64| {
        let allowed = rtol * greatest * if *magnitude > 0.0 { 1e-2 / magnitude } else { 1.0 };
        allowed.clamp(f64::MIN_POSITIVE, f64::MAX)
    };
    let each = path.magnitudes().iter().map(allowed).chain(path.constants().iter().map(allowed)).collect();
    let columns = (0..n + constants.len()).map(|c| if c < n { path.sparsity().column(c).to_vec() } else { Vec::new() });
    let sparsity = Sparsity::from_columns(columns);
    let options =
        Options { method, from: -from, to: -to, rtol, atol: AbsoluteTolerance::Each(each), ..Options::default() };
    let mut point: Vec<f64> = states.iter().chain(&*constants).copied().collect();
    let mut weights =
        Weights { unknown: vec![0.0; n + constants.len()], rest: vec![0.0; constants.len()], path, sparsity };
    simulate(&mut weights, &options, &mut point, &mut Nobody).map_err(|stopped| turned(stopped, from))?;
    let (found, gathered) = point.split_at(n);
    states.copy_from_slice(found);
    constants.copy_from_slice(gathered);
    Ok(())
}

/// A failure on the way back, at its time on the way forth.
fn turned(stopped: Stopped, from: f64) -> Failure {
    let Stopped { failure, time, .. } = stopped;
    let time = if time.is_finite() { -time } else { from };
    match failure {
        // What the system reports has its own time.
        Failure::StepTooSmall { .. } | Failure::NoConvergence { .. } => Failure::NotDifferentiable {
            time,
            what: "the run, followed backwards".into(),
            reason: format!("its weights cannot be integrated there ({failure})"),
        },
        other => other,
    }
}

/// A system whose derivatives can be had transposed.
pub trait Transposed {
    /// The system itself.
    fn system(&mut self) -> &mut dyn System;

    /// `(∂f/∂x)ᵀ w` at `(t, x)`, and adds `(∂f/∂c)ᵀ w` to what the constants weigh.
    ///
    /// # Errors
    /// As [`rates`](System::rates).
    fn transposed(
        &mut self,
        t: f64,
        x: &[f64],
        w: &[f64],
        states: &mut [f64],
        constants: &mut [f64],
    ) -> Result<(), Failure>;
}

impl FixedMethod {
    /// Whether its steps can be followed backwards: those of linearly implicit methods would need second derivatives.
    pub fn goes_back(self) -> bool {
        use FixedMethod::{LinearlyImplicitBdf2, LinearlyImplicitEuler, Rosenbrock};
        !matches!(self, Rosenbrock | LinearlyImplicitEuler | LinearlyImplicitBdf2)
    }
}

/// The weights as a system in the time that runs backwards.
struct Weights<'p> {
    path: &'p mut dyn Backwards,
    sparsity: Sparsity,
    /// Scales are not known: tolerances are given.
    unknown: Vec<f64>,
    rest: Vec<f64>,
}

impl System for Weights<'_> {
    fn states(&self) -> usize {
        self.unknown.len()
    }

    fn state_name(&self, state: usize) -> String {
        match state < self.path.magnitudes().len() {
            true => format!("the weight of {}", self.path.state_name(state)),
            false => "the weight of a constant".into(),
        }
    }

    fn scales(&self) -> &[f64] {
        &self.unknown
    }

    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), Failure> {
        let n = self.path.magnitudes().len();
        let (states, constants) = dy.split_at_mut(n);
        self.path.products(-t, &y[..n], states, constants)
    }

    fn directional_derivative(&mut self, t: f64, _: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        let n = self.path.magnitudes().len();
        // What the constants gather is solved for after the states.
        jv[n..].fill(0.0);
        self.path.products(-t, &v[..n], &mut jv[..n], &mut self.rest)
    }

    fn time_derivative(&mut self, _: f64, _: &[f64], _: &mut [f64]) -> Result<(), Failure> {
        unreachable!("asked for by linearly implicit methods alone")
    }

    fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }
}

impl Events for Weights<'_> {
    fn next_time_event(&mut self, _: f64) -> Option<f64> {
        None
    }

    fn indicators(&self) -> usize {
        0
    }

    fn event_indicators(&mut self, _: f64, _: &[f64], _: &mut [f64]) -> Result<(), Failure> {
        Ok(())
    }

    fn handle_event(&mut self, _: f64, _: &mut [f64]) -> Result<(), Failure> {
        Ok(())
    }

    fn accept(&mut self, _: f64, _: &[f64]) -> Result<(), Failure> {
        Ok(())
    }

    fn observed(&self) -> usize {
        0
    }

    fn observe(&mut self, _: f64, _: &[f64], _: &mut [f64]) -> Result<(), Failure> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x' = -c x` along `x = exp(-c t)`, and with it the weights of its end.
    struct Decay {
        c: [f64; 1],
        magnitudes: [f64; 1],
        sparsity: Sparsity,
    }

    impl Backwards for Decay {
        fn state_name(&self, _: usize) -> String {
            "x".into()
        }
        fn magnitudes(&self) -> &[f64] {
            &self.magnitudes
        }
        fn constants(&self) -> &[f64] {
            &self.c
        }
        fn sparsity(&self) -> &Sparsity {
            &self.sparsity
        }
        fn products(&mut self, t: f64, w: &[f64], states: &mut [f64], constants: &mut [f64]) -> Result<(), Failure> {
            states[0] = -self.c[0] * w[0];
            constants[0] = -libm::exp(-self.c[0] * t) * w[0];
            Ok(())
        }
    }

    #[test]
    fn weights_of_a_decay_are_those_in_closed_form() {
        for method in [Method::Explicit, Method::Radau, Method::Bdf] {
            let mut decay = Decay { c: [3.0], magnitudes: [1.0], sparsity: Sparsity::dense(1) };
            let (mut states, mut constants) = ([1.0], [0.5]);
            follow_back(&mut decay, (2.0, 0.0), (method, 1e-9), &mut states, &mut constants).unwrap();
            let end = libm::exp(-6.0);
            assert!((states[0] - end).abs() < 1e-7 * end, "{method:?} {}", states[0]);
            assert!((constants[0] - 0.5 + 2.0 * end).abs() < 1e-7 * end, "{method:?} {}", constants[0]);
        }
    }
}
