//! The damped Newton iteration from one point.

use super::CLOSE_TO_ROUNDING;
use crate::bytecode::frame::Frame;
use crate::bytecode::instruction::Solve;

/// Iterations at most while a solution is followed.
const ITERATIONS: usize = 100;
/// The same at the start and after events: far up an exponential law every correction is one constant of it only.
const ITERATIONS_AT_START: usize = 2_000;
/// The same in a [`Brief`](Globalization::Brief) iteration.
const ITERATIONS_BRIEF: usize = 10;
/// Least damping factor while a solution is followed.
const MIN_DAMPING: f64 = 1e-6;
/// The same at the start and after events.
const MIN_DAMPING_AT_START: f64 = 1e-12;
/// The same in a [`Brief`](Globalization::Brief) iteration.
const MIN_DAMPING_BRIEF: f64 = 0.1;
/// Contraction factor of the first, undamped step below which the iteration surely is in the region of local convergence.
pub(in crate::bytecode) const CONTRACTION: f64 = 0.25;
/// Where the simplified correction is `k` times the correction, that after it is about `2 k` times the simplified one:
/// below this, rounding.
pub(in crate::bytecode) const CONVERGED: f64 = 0.125 * f64::EPSILON;

/// Where a correction is not longer than this it leads to the root. Positions are looked at once more: where a motion stands
/// still, rounding must not move them.
pub(in crate::bytecode) const LEAST_CORRECTION: f64 = 4.0 * f64::EPSILON;

/// How far from its first guess an iteration may lead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Globalization {
    /// To any root that damped steps find.
    Damped,
    /// To any root that steps find which are damped as at the start.
    Far,
    /// To a root that few, hardly damped steps find.
    Brief,
    /// To a root in whose region of local convergence it begins.
    Local,
}

/// An iteration that failed.
#[derive(Debug, Clone, Copy)]
pub(super) struct NotConverged {
    pub(super) iterations: usize,
    pub(super) residual: f64,
}

/// What became of a step.
enum StepOutcome {
    Converged,
    Accepted,
    Rejected,
}

impl Frame {
    /// Newton's method from `newton.start`; leaves the root in `newton.x`.
    pub(super) fn iterate(&mut self, solve: &Solve, globalization: Globalization) -> Result<(), NotConverged> {
        let newton = self.newton_of(solve);
        // Continuation needs its share of the evaluations.
        let last_evaluation = newton.evaluations + newton.limit() / 4;
        newton.begin_iteration();
        if !self.evaluate(solve, false) {
            return Err(NotConverged { iterations: 0, residual: f64::NAN });
        }
        self.newton_of(solve).valued = true;
        let most = self.iteration_limit(solve, globalization);
        for iteration in 0..most {
            if self.vanishes(solve) {
                return Ok(());
            }
            let newton = self.newton_of(solve);
            if newton.exhausted() || newton.evaluations > last_evaluation {
                return Err(self.not_converged(solve, iteration));
            }
            if !self.factor(solve) {
                self.perturb(solve, iteration);
                if !self.evaluate(solve, false) {
                    return Err(NotConverged { iterations: iteration, residual: f64::NAN });
                }
                continue;
            }
            self.newton_correction(solve);
            self.newton_of(solve).first_factors = iteration == 0;
            if iteration == 0 {
                self.store_first_correction(solve);
            }
            let norm = self.correction_norm(solve);
            if !norm.is_finite() {
                break;
            }
            let newton = self.newton_of(solve);
            if norm <= LEAST_CORRECTION && !newton.positions {
                newton.rests = iteration == 0;
                newton.add_correction();
                return Ok(());
            }
            let (outcome, contracts) = self.damped_step(solve, norm, globalization);
            self.newton_of(solve).contracts &= iteration > 0 || contracts;
            if globalization == Globalization::Local && !self.newton_of(solve).contracts {
                return Err(self.not_converged(solve, iteration + 1));
            }
            match outcome {
                StepOutcome::Converged => return Ok(()),
                StepOutcome::Accepted => {}
                StepOutcome::Rejected => return Err(self.not_converged(solve, iteration + 1)),
            }
        }
        Err(self.not_converged(solve, most))
    }

    fn iteration_limit(&mut self, solve: &Solve, globalization: Globalization) -> usize {
        match globalization {
            Globalization::Brief => ITERATIONS_BRIEF,
            _ if self.newton_of(solve).following => ITERATIONS,
            _ => ITERATIONS_AT_START,
        }
    }

    fn least_damping(&mut self, solve: &Solve, globalization: Globalization) -> f64 {
        match globalization {
            Globalization::Brief => MIN_DAMPING_BRIEF,
            Globalization::Far => MIN_DAMPING_AT_START,
            _ if self.newton_of(solve).following => MIN_DAMPING,
            _ => MIN_DAMPING_AT_START,
        }
    }

    fn not_converged(&self, solve: &Solve, iterations: usize) -> NotConverged {
        NotConverged { iterations, residual: self.residual(solve) }
    }

    /// Takes the correction with the greatest damping factor `1, 1/2, 1/4 ...` that passes the restricted natural
    /// monotonicity test: the simplified correction behind it is [`shortened`]. Also whether the undamped step contracts.
    /// `norm`: of the correction.
    fn damped_step(&mut self, solve: &Solve, norm: f64, globalization: Globalization) -> (StepOutcome, bool) {
        let least_damping = self.least_damping(solve, globalization);
        let mut damping = 1.0;
        loop {
            self.newton_of(solve).set_trial(damping);
            if self.evaluate(solve, true) {
                let simplified = self.simplified_correction_norm(solve, false);
                if simplified <= shortened(damping) * norm || norm <= 2.0 * f64::EPSILON {
                    return self.accept_step(solve, damping, norm, simplified);
                }
            }
            if norm <= CLOSE_TO_ROUNDING {
                // Rounding keeps the correction from getting shorter: it is as good as it gets.
                self.evaluate(solve, false);
                return (StepOutcome::Converged, true);
            }
            damping *= 0.5;
            if damping < least_damping || self.newton_of(solve).exhausted() {
                return self.reject_step(solve, norm, globalization);
            }
        }
    }

    /// Goes to the trial point, and where the iteration converges quadratically by the simplified correction too.
    fn accept_step(&mut self, solve: &Solve, damping: f64, norm: f64, simplified: f64) -> (StepOutcome, bool) {
        let newton = self.newton_of(solve);
        newton.accept_trial();
        let contracts = damping == 1.0 && (simplified <= CONTRACTION * norm || norm <= CLOSE_TO_ROUNDING);
        if contracts && simplified * simplified <= CONVERGED * norm {
            newton.add_simplified_correction();
            return (StepOutcome::Converged, true);
        }
        (if norm <= LEAST_CORRECTION { StepOutcome::Converged } else { StepOutcome::Accepted }, contracts)
    }

    /// No damping factor passes: there is a nonsmooth point, or the residuals are rounding, or the iteration fails.
    fn reject_step(&mut self, solve: &Solve, norm: f64, globalization: Globalization) -> (StepOutcome, bool) {
        let to_any_root = matches!(globalization, Globalization::Damped | Globalization::Far);
        if to_any_root && self.crosses_nonsmooth_point(solve, norm) {
            self.newton_of(solve).accept_trial();
            return (StepOutcome::Accepted, false);
        }
        let rounding = self.stagnates_at_rounding(solve) && self.is_near_rounding(solve) || self.is_at_rounding(solve);
        if rounding { (StepOutcome::Converged, true) } else { (StepOutcome::Rejected, false) }
    }
}

/// How much of a correction may be left behind this part of it: the restricted natural monotonicity test.
pub(super) fn shortened(damping: f64) -> f64 {
    1.0 - 0.25 * damping
}
