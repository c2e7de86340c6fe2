//! Positions that constraints determine: from one to the next by where the motion leads.
//!
//! Two motions may lead through one position, as where a parallelogram lies flat. Newton's method from the solution before
//! leads into either of them there; the smooth one is where the rates point that the positions had, on either side of it:
//! [Allgower and Georg], "Introduction to Numerical Continuation Methods", chapter 8, on jumping over bifurcation points.

use super::damped::Globalization;
use super::workspace::Newton;
use super::{CLOSE_TO_ROUNDING, REGULAR};
use crate::bytecode::frame::Frame;
use crate::bytecode::instruction::Solve;

/// The way of positions is short if along it the Jacobian changes by at most this part: no other motion is near.
const SHORT: f64 = 0.5;
/// Or the way is not much against the size of the positions (1 at most), or leads to where they are expected.
const FEW: f64 = 0.25;
/// Elsewhere, how near positions are to where they are expected, by their distance from where the Jacobian is singular.
const STRAYED: f64 = 0.25;
/// The way is at most so many times that distance: nearer, motions are not told apart.
const NEAREST: f64 = 50.0;
/// Nearer than this, times the root of their size, rates of positions are rounding.
const CLOSE_TO_SINGULAR: f64 = 1e-7;
/// A position counts with its own size, or this one.
const LEAST_SIZE: f64 = 0.05;
/// Part of their size by which positions move in a step at most that move no state: no error of one makes steps short there.
const LOOKED_AT: f64 = 0.03;
/// Part of their size by which rates may change over a way that is not short.
const TURNED: f64 = 0.25;

/// How positions move.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Motion {
    /// Whether that is known.
    pub known: bool,
    /// When, in s, and the time passed since they were looked at before.
    time: f64,
    passed: f64,
    /// Their rates, and the rates of these.
    rates: Vec<f64>,
    bends: Vec<f64>,
    /// Where the last step began: how long it took, in s (0 if it is not known), and positions and rates there.
    span: f64,
    start: Vec<f64>,
    start_rates: Vec<f64>,
    /// The solution before the previous one.
    pub left: Vec<f64>,
}

impl Frame {
    /// Whether the unknowns are positions whose motion from the previous solution is known, which is at another time.
    pub(super) fn is_in_motion(&mut self, solve: &Solve) -> bool {
        let t = self.r[self.time as usize];
        let newton = self.newton_of(solve);
        newton.following && newton.motion.known && newton.motion.time != t
    }

    /// Goes where the motion leads, if it can be told from others at this distance. Leaves the block evaluated there.
    pub(super) fn follow_motion(&mut self, solve: &Solve) -> bool {
        let t = self.r[self.time as usize];
        let newton = self.newton_of(solve);
        newton.expect(t);
        newton.offset.fill(0.0);
        newton.start.copy_from_slice(&newton.expected);
        // A position that is 0 is so against its size.
        newton.floor.fill(LEAST_SIZE);
        let found = self.iterate(solve, Globalization::Damped).is_ok();
        let newton = self.newton_of(solve);
        newton.floor.fill(0.0);
        found && self.factor(solve) && {
            let newton = self.newton_of(solve);
            let size = newton.x.iter().fold(LEAST_SIZE, |most, x| most.max(x.abs()));
            let (way, strayed) = (between(&newton.x, &newton.previous), between(&newton.x, &newton.expected));
            let change = self.change_on_way(solve);
            // A whole turn would end at the same Jacobian.
            let no_turn = way <= FEW * size.min(1.0) || strayed <= 0.5 * way;
            let short = way <= CLOSE_TO_ROUNDING * size || change <= SHORT * way && no_turn;
            let newton = self.newton_of(solve);
            (newton.short, newton.regular) = (short, change <= REGULAR * way);
            // From where the Jacobian is singular.
            let distance = way * (way / change);
            let far = distance >= f64::max(way / NEAREST, CLOSE_TO_SINGULAR * size.sqrt());
            // Samples inside a step that has been made may lie anywhere.
            let ahead = t > newton.motion.time;
            short || (far || !ahead) && strayed <= STRAYED * distance
        }
    }

    /// By how much the way from the previous solution to the root is missed by the Jacobian there in place of that at the
    /// root. By the way's length: how much longer that is than the distance of the root from where the Jacobian is
    /// singular.
    fn change_on_way(&mut self, solve: &Solve) -> f64 {
        let Frame { r, solvers, .. } = self;
        let solver = &mut solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        for i in 0..newton.x.len() {
            let terms = solve.pattern.row(i).map(|e| {
                let column = solve.pattern.columns()[e] as usize;
                (r[solve.matrix[e] as usize] - newton.previous_jacobian[e])
                    * (newton.x[column] - newton.previous[column])
            });
            newton.simplified[i] = terms.sum();
        }
        solver.factors.solve(&mut newton.simplified);
        let change = newton.simplified.iter().map(|way| way * way).sum::<f64>().sqrt();
        if change.is_finite() { change } else { f64::INFINITY }
    }
}

impl Newton {
    /// Where the motion leads until `t`.
    fn expect(&mut self, t: f64) {
        let Newton { motion, expected, previous, .. } = self;
        let gone = t - motion.time;
        if gone < 0.0 && -gone <= motion.span {
            // Inside the last step: the cubic through both its ends.
            let (s, h) = (1.0 + gone / motion.span, motion.span);
            for (i, expected) in expected.iter_mut().enumerate() {
                let way = previous[i] - motion.start[i];
                let (first, last) = (h * motion.start_rates[i] - way, way - h * motion.rates[i]);
                *expected = motion.start[i] + s * (way + (1.0 - s) * ((1.0 - s) * first + s * last));
            }
            return;
        }
        for (i, expected) in expected.iter_mut().enumerate() {
            *expected = previous[i] + gone * (motion.rates[i] + 0.5 * gone * motion.bends[i]);
        }
    }

    /// The time in which positions move by a small part of their size, as they move at the previous solution.
    pub fn longest_way(&self) -> f64 {
        let Motion { known, rates, bends, .. } = &self.motion;
        if !known {
            return f64::INFINITY;
        }
        let longest = |((x, rate), bend): ((&f64, &f64), &f64)| {
            let way = LOOKED_AT * x.abs().clamp(LEAST_SIZE, 1.0);
            f64::min(way / rate.abs(), (2.0 * way / bend.abs()).sqrt())
        };
        self.previous.iter().zip(rates).zip(bends).map(longest).fold(f64::INFINITY, f64::min)
    }

    /// The previous solution, positions, is that at `t`; rates follow.
    pub fn arrive(&mut self, t: f64) {
        let motion = &mut self.motion;
        (motion.passed, motion.time) = (t - motion.time, t);
        if motion.passed != 0.0 {
            std::mem::swap(&mut motion.start, &mut motion.left);
            motion.span = 0.0;
        }
    }

    /// Notes the rates with which positions go on from the previous solution. Whether they go on smoothly from where they
    /// came: not where the solution has got into another motion.
    pub fn note_rates(&mut self, rates: impl ExactSizeIterator<Item = f64> + Clone) -> bool {
        let motion = &mut self.motion;
        motion.rates.resize(rates.len(), 0.0);
        motion.bends.resize(rates.len(), 0.0);
        motion.start_rates.resize(rates.len(), 0.0);
        let passed = motion.passed;
        let looked_at_before = std::mem::replace(&mut motion.known, true);
        if !looked_at_before {
            motion.bends.fill(0.0);
            motion.span = 0.0;
        } else if passed != 0.0 {
            motion.span = passed;
            motion.start_rates.copy_from_slice(&motion.rates);
        }
        let (mut turned, mut size) = (0.0f64, [0.0f64; 2]);
        for ((before, bend), rate) in motion.rates.iter_mut().zip(&mut motion.bends).zip(rates) {
            if looked_at_before && passed != 0.0 {
                let off = rate - *before - passed * *bend;
                turned += off * off;
                size = [size[0] + *before * *before, size[1] + rate * rate];
                *bend = (rate - *before) / passed;
            }
            *before = rate;
        }
        let [before, after] = size;
        self.short || turned <= TURNED * TURNED * before.max(after)
    }
}

fn between(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}
