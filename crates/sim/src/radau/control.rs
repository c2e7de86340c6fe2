//! The length of the steps. Source: [HW], IV.8.

use super::newton::MOST_ITERATIONS;

/// Part of the step that would just meet the tolerance.
const SAFETY: f64 = 0.9;

/// A step is at most this much shorter than the one before.
const SHORTEST: f64 = 0.2;

/// A step is at most this much longer than the one before.
const LONGEST: f64 = 8.0;

/// What the controller remembers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Control {
    /// Length and error of the last accepted step since the restart.
    last: Option<(f64, f64)>,
    /// Whether the step before this one, of the same start, was in vain.
    rejected: bool,
}

impl Control {
    /// Whether an error too large may come from a transient that is damped anyway.
    pub(super) fn is_doubtful(&self) -> bool {
        self.rejected || self.last.is_none()
    }

    /// The step was in vain.
    pub(super) fn rejected(&mut self) {
        self.rejected = true;
    }

    /// The length of the step after one of `h` with this error, accepted if that is below 1.
    pub(super) fn next_step_size(&mut self, h: f64, error: f64, iterations: usize) -> f64 {
        let most = MOST_ITERATIONS as f64;
        let safety = SAFETY.min(SAFETY * (1.0 + 2.0 * most) / (iterations as f64 + 2.0 * most));
        let shrink = |shrink: f64| shrink.clamp(1.0 / LONGEST, 1.0 / SHORTEST);
        let plain = shrink(error.sqrt().sqrt() / safety);
        if error >= 1.0 {
            self.rejected = true;
            return if self.last.is_none() { 0.1 * h } else { h / plain };
        }
        // The controller of Gustafsson: errors that grow from step to step are foreseen.
        let foreseen = self
            .last
            .map_or(0.0, |(length, before)| shrink(length / h * (error * error / before).sqrt().sqrt() / SAFETY));
        let next = h / plain.max(foreseen);
        self.last = Some((h, error.max(1e-2)));
        if std::mem::take(&mut self.rejected) { next.min(h) } else { next }
    }
}
