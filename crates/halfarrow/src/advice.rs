//! What a fixed step is to a model, from its eigenvalues at the start: said before anything is computed with it.

use halfarrow_compiler::equations::Form;
use halfarrow_compiler::program::Trigger;
use halfarrow_exec as exec;
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::{Events as _, System};
use nalgebra::{Complex, DMatrix, DVector};

use crate::linear_algebra::eigenvalues;
use crate::model::Model;
use crate::run::Start;

/// States up to which eigenvalues are computed.
const MOST_STATES: usize = 300;

/// Growth of an amplitude that should not grow, in the time of a radian, that is to be known.
const GROWTH: f64 = 1e-2;

/// Part of its size by which an eigenvalue has to be damped for growth to be more than inaccuracy.
const DAMPED: f64 = 1e-3;

/// Step times frequency beyond which an implicit method does not see an oscillation.
const UNSEEN: f64 = 1.0;

/// Step times rate beyond which the midpoint rule lets what should decay change its sign from step to step.
const RINGING: f64 = 2.0;

/// What is wrong with a step.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    Grows,
    Unseen,
    Rings,
}

impl Model {
    /// Whether a fixed step is too long for the fastest motion that the model has at its start, in words: which state asks for
    /// which step. `None` where it is not, where the model has no start, or more than a few hundred states.
    pub fn step_advice(&self, form: Form, method: FixedMethod, step: f64, start: Start) -> Option<String> {
        let mut system = self.system_in(form).ok()?;
        let x = self.start(&mut system, start).ok()?;
        advice(&system, &x, method, step)
    }
}

/// The same for a system that starts at `x`.
pub(crate) fn advice(system: &exec::Model, x: &[f64], method: FixedMethod, step: f64) -> Option<String> {
    let matrix = matrix_at(system, x)?;
    let wanted = |z: &[f64; 2]| longest(method, *z, step);
    let (mode, longest) = eigenvalues(&matrix)?
        .into_iter()
        .map(|z| (z, wanted(&z)))
        .filter(|(_, longest)| *longest < step)
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let state = leading_state(&matrix, mode).map_or(String::new(), |state| system.state_name(state));
    Some(words(method, step, mode, longest, &state))
}

/// Periods of events that are no multiple of a fixed step: steps are shorter there.
pub(crate) fn off_step(system: &exec::Model, step: f64) -> Option<String> {
    let every = system.program().clauses.iter().filter_map(|c| match c.trigger {
        Trigger::Every(period) => Some((&c.name, system.constant(period)? / step)),
        Trigger::Becomes(_) => None,
    });
    let (name, steps) = every.into_iter().find(|(_, steps)| (steps - steps.round()).abs() > 1e-9 * steps.max(1.0))?;
    Some(format!("`{name}` is {steps} steps of {step} s: the step before each of its events is a shorter one"))
}

/// The eigenvalues of a system at its start `x`, if one may be greater than `rate`, in 1/s; `None` also if it has too many states,
/// or none can be had.
pub(crate) fn fast_at_start(system: &exec::Model, x: &[f64], rate: f64) -> Option<Vec<[f64; 2]>> {
    let matrix = matrix_at(system, x)?;
    let size = matrix.iter().map(|row| row.iter().map(|entry| entry.abs()).sum()).fold(0.0, f64::max);
    if size > rate { eigenvalues(&matrix) } else { None }
}

/// Derivatives of the rates by the states, just after the start.
fn matrix_at(system: &exec::Model, x: &[f64]) -> Option<Vec<Vec<f64>>> {
    if x.is_empty() || x.len() > MOST_STATES {
        return None;
    }
    let (mut system, mut x) = (system.clone(), x.to_vec());
    system.handle_event(0.0, &mut x).ok()?;
    Some(system.linearise(0.0, &x, &[]).ok()?.a)
}

/// The longest step up to `step` that does for an eigenvalue.
fn longest(method: FixedMethod, z: [f64; 2], step: f64) -> f64 {
    let does = |h: f64| fault(method, z, h).is_none();
    if does(step) {
        return step;
    }
    let mut low = step;
    while !does(low) {
        low *= 0.5;
        if low < f64::MIN_POSITIVE {
            return low;
        }
    }
    let mut high = 2.0 * low;
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if does(middle) { low = middle } else { high = middle }
    }
    low
}

/// What a step of `h` makes of a motion with an eigenvalue, in 1/s.
fn fault(method: FixedMethod, [re, im]: [f64; 2], h: f64) -> Option<Fault> {
    let size = libm::hypot(re, im);
    if size == 0.0 || re > GROWTH * size {
        return None; // it grows by itself
    }
    let oscillates = im.abs() > re.abs();
    if method.is_implicit() {
        let unseen = oscillates && h * im.abs() > UNSEEN;
        let rings = method == FixedMethod::ImplicitMidpoint && !oscillates && h * size > RINGING;
        return if unseen { Some(Fault::Unseen) } else { rings.then_some(Fault::Rings) };
    }
    let factor = amplification(method, Complex::new(re, im) * h).norm();
    let growth = libm::log(factor) / (h * size);
    let grows = growth > GROWTH || (re < -DAMPED * size && factor > 1.0 + 1e-9);
    grows.then_some(Fault::Grows)
}

/// What a step of an explicit method multiplies a motion by; `z`: step times eigenvalue. Source: [HW], IV.2.
fn amplification(method: FixedMethod, z: Complex<f64>) -> Complex<f64> {
    let order = match method {
        FixedMethod::Euler => 1,
        FixedMethod::Heun => 2,
        _ => 4,
    };
    let (mut sum, mut term) = (Complex::new(1.0, 0.0), Complex::new(1.0, 0.0));
    for k in 1..=order {
        term *= z / f64::from(k);
        sum += term;
    }
    sum
}

/// The state with the greatest part in a motion: the product of what it does in it and of what acts on it.
fn leading_state(matrix: &[Vec<f64>], [re, im]: [f64; 2]) -> Option<usize> {
    let n = matrix.len();
    // Beside the eigenvalue, so that there is a solution, which is the eigenvector but for a little.
    let beside = Complex::new(re, im) * (1.0 + 1e-9);
    let shifted = DMatrix::from_fn(n, n, |i, j| {
        Complex::new(matrix[i][j], 0.0) - if i == j { beside } else { Complex::new(0.0, 0.0) }
    });
    let vector = |shifted: DMatrix<Complex<f64>>| {
        let lu = shifted.lu();
        let any = DVector::from_fn(n, |i, _| Complex::new(1.0 + (i % 3) as f64, (i % 2) as f64));
        let once: DVector<Complex<f64>> = lu.solve(&any)?;
        let size = once.iter().fold(0.0f64, |most, z| most.max(z.norm()));
        lu.solve(&once.map(|z| z / size))
    };
    let (right, left) = (vector(shifted.clone())?, vector(shifted.transpose())?);
    let part = |i: &usize| (right[*i] * left[*i]).norm();
    (0..n).filter(|i| part(i).is_finite()).max_by(|a, b| part(a).total_cmp(&part(b)))
}

fn words(method: FixedMethod, step: f64, [re, im]: [f64; 2], longest: f64, state: &str) -> String {
    let oscillates = im.abs() > re.abs();
    let motion = match oscillates {
        true => format!("oscillates with {} rad/s", short(im.abs())),
        false => format!("has a time constant of {} s", short(1.0 / libm::hypot(re, im))),
    };
    let what = match fault(method, [re, im], step) {
        Some(Fault::Unseen) => "which steps that long do not follow",
        Some(Fault::Rings) => "and changes its sign from step to step instead of decaying",
        _ => "and grows without bound instead",
    };
    let other = match method.is_implicit() {
        true if oscillates => "",
        true => ", or rosenbrock",
        false => ", or an implicit method such as rosenbrock",
    };
    format!(
        "a step of {} s is too long: at the start {state} {motion}, {what}; take at most {} s{other}",
        short(step),
        rounded_down(longest)
    )
}

/// Three digits.
fn short(x: f64) -> String {
    let rounded: f64 = format!("{x:.2e}").parse().unwrap_or(x);
    if (1e-3..1e6).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}

/// Two digits, no more than there is.
fn rounded_down(x: f64) -> String {
    let text = format!("{x:.1e}");
    let nearest: f64 = text.parse().unwrap_or(x);
    let unit: f64 = text.split_once('e').and_then(|(_, e)| format!("1e{e}").parse().ok()).unwrap_or(0.0);
    short(if nearest > x { nearest - 0.1 * unit } else { nearest })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_are_those_of_the_methods() {
        let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-3 * wanted, "{found} is not {wanted}");
        near(longest(FixedMethod::Euler, [-1.0, 0.0], 10.0), 2.0);
        near(longest(FixedMethod::Heun, [-10.0, 0.0], 10.0), 0.2);
        near(longest(FixedMethod::Rk4, [-1.0, 0.0], 10.0), 2.7853);
        assert!((2.8..2.95).contains(&longest(FixedMethod::Rk4, [0.0, 1.0], 10.0)));
        near(longest(FixedMethod::ImplicitMidpoint, [-4.0, 0.0], 10.0), 0.5);
        assert_eq!(longest(FixedMethod::Rosenbrock, [-1e9, 0.0], 1.0), 1.0);
        assert_eq!(longest(FixedMethod::Rk4, [5.0, 0.0], 1.0), 1.0);
    }

    #[test]
    fn the_state_that_moves_fastest_is_named() {
        let matrix = [vec![-1.0, 0.5, 0.0], vec![0.1, -1e6, 2.0], vec![0.0, 0.0, -3.0]];
        assert_eq!(leading_state(&matrix, [-1e6, 0.0]), Some(1));
        assert_eq!(leading_state(&matrix, [-3.0, 0.0]), Some(2));
    }
}
