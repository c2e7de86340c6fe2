//! Continuation: from root to root in strides.

use super::attempt::Trust;
use super::path::LOOKS;
use crate::bytecode::frame::Frame;
use crate::bytecode::instruction::Solve;

/// Shortest part of the way from one solution to the next that is gone at once.
const SHORTEST_STRIDE: f64 = 1e-6;
/// Part of the way below which a few looks tell whether it is straight: over a kink of a law no step contracts. The
/// solution must have moved by no more than `SHORT_MOVE` of its magnitude.
const SHORT_STRIDE: f64 = 1e-3;
const SHORT_MOVE: f64 = 1e-2;

impl Frame {
    /// Goes from the memory in strides, each short enough to tell the root: along what the block has read and reads now,
    /// or from a point that is no root along the roots of `residual - (1 - s) residual(memory)`.
    pub(super) fn approach(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.offset.fill(0.0);
        newton.kept.copy_from_slice(&newton.memory);
        newton.base.copy_from_slice(&newton.jacobian_memory);
        newton.x.copy_from_slice(&newton.memory);
        if !newton.following && !self.evaluate(solve, false) {
            return false;
        }
        for (i, &right) in solve.right.iter().enumerate() {
            let residual = self.r[right as usize];
            self.newton_of(solve).first[i] = residual;
        }
        let (mut s, mut stride) = (0.0f64, 0.25f64);
        while stride > SHORTEST_STRIDE && !self.newton_of(solve).exhausted() {
            let next = (s + stride).min(1.0);
            self.go_to(solve, next);
            let short = stride <= SHORT_STRIDE;
            let trust = if short { Trust::Kink } else { Trust::Contraction };
            let found = self.attempt(solve, trust).is_ok();
            let goes_on =
                found && (self.goes_on(solve) || short && self.moves_little(solve) && self.is_straight(solve, LOOKS));
            if goes_on || self.floats(solve) {
                if goes_on {
                    self.newton_of(solve).floating.now.fill(false);
                }
                if next == 1.0 {
                    return true;
                }
                self.keep_jacobian(solve);
                let newton = self.newton_of(solve);
                newton.kept.copy_from_slice(&newton.x);
                newton.base.copy_from_slice(&newton.jacobian);
                (s, stride) = (next, 2.0 * stride);
            } else {
                stride *= 0.5;
            }
        }
        self.go_to(solve, 1.0);
        false
    }

    /// Sets what the block reads, or what is taken off its residuals, to a part of the way.
    fn go_to(&mut self, solve: &Solve, part: f64) {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        if !newton.following {
            newton.offset.iter_mut().zip(&newton.first).for_each(|(o, f)| *o = (1.0 - part) * f);
            return;
        }
        for (&register, (now, before)) in solve.outer.iter().zip(newton.outer.iter().zip(&newton.outer_memory)) {
            r[register as usize] = if part == 1.0 { *now } else { before + part * (now - before) };
        }
    }

    fn moves_little(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        let little = |i: usize| (newton.x[i] - newton.kept[i]).abs() <= SHORT_MOVE * newton.span[i];
        (0..newton.x.len()).all(little)
    }
}
