//! The polynomial of the last step.

use super::Stages;
use super::tableau::{NODES, STAGES, increment_weights, rate_weights};

/// How far the polynomial is off inside the step at most, relative to the fourth derivative times the step to the power 4,
/// divided by 4!: the errors of the stages are part of that.
const OFF: f64 = 0.03;

/// The polynomial of degree 3 through the start of a step and its stages.
pub(super) struct Collocation {
    start: f64,
    /// `None`: there is no last step.
    end: Option<f64>,
    y: Vec<f64>,
    z: Stages,
    /// Where the step before started, if this one went on from its end.
    before: Option<f64>,
    y_before: Vec<f64>,
}

impl Collocation {
    pub(super) fn new(size: usize) -> Collocation {
        let vector = || vec![0.0; size];
        Collocation {
            start: 0.0,
            end: None,
            y: vector(),
            z: [vector(), vector(), vector()],
            before: None,
            y_before: vector(),
        }
    }

    pub(super) fn forget(&mut self) {
        self.end = None;
    }

    pub(super) fn start(&self) -> f64 {
        self.start
    }

    /// The unknowns where the step started.
    pub(super) fn start_values(&mut self) -> &mut Vec<f64> {
        &mut self.y
    }

    pub(super) fn ends_at(&self, t: f64) -> bool {
        self.end == Some(t)
    }

    /// Takes over a step from `(start, y)` to `end` with the increments `z`, and leaves others there.
    pub(super) fn take(&mut self, start: f64, end: f64, y: &[f64], z: &mut Stages) {
        self.before = self.ends_at(start).then_some(self.start);
        std::mem::swap(&mut self.y, &mut self.y_before);
        self.start = start;
        self.end = Some(end);
        self.y.copy_from_slice(y);
        std::mem::swap(&mut self.z, z);
    }

    /// Adds the last increment to `y`, and writes the rates there.
    pub(super) fn end(&self, y: &mut [f64], yp: &mut [f64]) {
        y.iter_mut().zip(&self.z[STAGES - 1]).for_each(|(y, z)| *y += z);
        self.weigh(rate_weights(1.0), yp);
        let length = self.length();
        yp.iter_mut().for_each(|rate| *rate /= length);
    }

    /// Unknowns and rates at the end of a shorter step to `t` from the same start with the increments `z`.
    pub(super) fn increments_to(&self, t: f64, z: &Stages, y: &mut [f64], yp: &mut [f64]) {
        let ([a, b, c], length) = (rate_weights(1.0), t - self.start);
        for i in 0..y.len() {
            y[i] = self.y[i] + z[STAGES - 1][i];
            yp[i] = (a * z[0][i] + b * z[1][i] + c * z[2][i]) / length;
        }
    }

    /// Lets the step end at `t` with the increments `z`, and leaves others there.
    pub(super) fn end_at(&mut self, t: f64, z: &mut Stages) {
        self.end = Some(t);
        std::mem::swap(&mut self.z, z);
    }

    /// Unknowns at a time.
    pub(super) fn state(&self, t: f64, y: &mut [f64]) {
        self.weigh(increment_weights((t - self.start) / self.length()), y);
        y.iter_mut().zip(&self.y).for_each(|(y, start)| *y += start);
    }

    /// Rates at a time.
    pub(super) fn rates(&self, t: f64, yp: &mut [f64]) {
        let length = self.length();
        self.weigh(rate_weights((t - self.start) / length), yp);
        yp.iter_mut().for_each(|rate| *rate /= length);
    }

    /// How far the polynomial may be off inside the step: judged by one more node, the start of the step before. `false`
    /// if there is none.
    pub(super) fn doubt(&self, doubt: &mut [f64]) -> bool {
        let Some(before) = self.before else { return false };
        let node = (before - self.start) / self.length();
        let share = OFF / NODES.iter().fold(node, |product, other| product * (node - other));
        self.weigh(increment_weights(node), doubt);
        for (i, doubt) in doubt.iter_mut().enumerate() {
            *doubt = share * (self.y_before[i] - self.y[i] - *doubt);
        }
        true
    }

    /// Increments in a shorter step from the same start.
    pub(super) fn shortened(&self, h: f64, z: &mut Stages) {
        for (z, node) in z.iter_mut().zip(NODES) {
            self.weigh(increment_weights(node * h / self.length()), z);
        }
    }

    /// Increments in a step of `h` that starts where this one ends, if the polynomial went on.
    pub(super) fn extrapolate(&self, h: f64, z: &mut Stages) {
        for (z, node) in z.iter_mut().zip(NODES) {
            let mut weights = increment_weights(1.0 + node * h / self.length());
            weights[STAGES - 1] -= 1.0;
            self.weigh(weights, z);
        }
    }

    fn length(&self) -> f64 {
        self.end.map_or(0.0, |end| end - self.start)
    }

    fn weigh(&self, [a, b, c]: [f64; STAGES], out: &mut [f64]) {
        let [first, second, third] = &self.z;
        out.iter_mut().enumerate().for_each(|(i, out)| *out = a * first[i] + b * second[i] + c * third[i]);
    }
}
