//! Damped Newton from one point.

use super::SETTLED;
use super::workspace::Newton;
use crate::bytecode::frame::{Frame, put_entries};
use crate::bytecode::instruction::Solve;

/// Iterations of one attempt.
const ITERATIONS: usize = 100;
/// The same at the start and after jumps: from far up an exponential law every step takes off one constant of it only.
const ITERATIONS_AT_START: usize = 2_000;
/// Shortest fraction of a step that is tried.
const SHORTEST: f64 = 1e-12;
/// The same while a solution is followed.
const SHORTEST_FOLLOWING: f64 = 1e-6;
/// Iterations of an attempt in a short stride, and the shortest fraction of a step.
const SHORT_ITERATIONS: usize = 10;
const SHORT_FRACTION: f64 = 0.1;
/// Contraction of the first step below which the solution is near without doubt.
pub(in crate::bytecode) const NEAR: f64 = 0.25;
/// A step that shrinks as the last one did, with the same Jacobian, leaves about twice its square over the last: below
/// this, rounding.
pub(in crate::bytecode) const FINISHED: f64 = 0.125 * f64::EPSILON;

/// What an attempt may lead to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Trust {
    /// Any root that damped steps find.
    Damped,
    /// A root that few steps find.
    Kink,
    /// A root that the first step comes near to, or none.
    Contraction,
}

/// An attempt that failed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Miss {
    pub(super) iterations: usize,
    pub(super) residual: f64,
}

/// What became of a step.
pub(super) enum Damped {
    Done,
    Moved,
    Stuck,
}

impl Frame {
    /// Newton from `newton.kept`.
    pub(super) fn attempt(&mut self, solve: &Solve, trust: Trust) -> Result<(), Miss> {
        let n = solve.right.len();
        let newton = self.newton_of(solve);
        // The way in short strides needs its share of the evaluations.
        let last = newton.evaluations + newton.limit() / 4;
        newton.x.copy_from_slice(&newton.kept);
        newton.near = true;
        newton.lead.fill(0.0);
        newton.opening.fill(0.0);
        (0..n).for_each(|i| newton.size[i] = newton.x[i].abs().max(newton.floor[i]));
        if !self.evaluate(solve, false) {
            return Err(Miss { iterations: 0, residual: f64::NAN });
        }
        let most = match trust {
            Trust::Kink => SHORT_ITERATIONS,
            _ if self.newton_of(solve).following => ITERATIONS,
            _ => ITERATIONS_AT_START,
        };
        for iteration in 0..most {
            if self.residual(solve) == 0.0 {
                return Ok(());
            }
            let newton = self.newton_of(solve);
            if newton.exhausted() || newton.evaluations > last {
                return Err(Miss { iterations: iteration, residual: self.residual(solve) });
            }
            if !self.factor(solve) {
                self.nudge(solve, iteration);
                if !self.evaluate(solve, false) {
                    return Err(Miss { iterations: iteration, residual: f64::NAN });
                }
                continue;
            }
            self.newton_step(solve);
            if iteration == 0 {
                let Frame { r, solvers, .. } = self;
                let newton = &mut solvers[solve.block.0 as usize].newton;
                newton.lead.copy_from_slice(&newton.step);
                for (i, &right) in solve.right.iter().enumerate() {
                    newton.opening[i] = newton.offset[i] - r[right as usize];
                }
                newton.weigh_what_rests(solve, r);
            }
            let size = self.relative_step(solve);
            if !size.is_finite() {
                break;
            }
            let (damped, near) = self.damped(solve, size, trust);
            self.newton_of(solve).near &= iteration > 0 || near;
            if trust == Trust::Contraction && !self.newton_of(solve).near {
                return Err(Miss { iterations: iteration + 1, residual: self.residual(solve) });
            }
            match damped {
                Damped::Done => return Ok(()),
                Damped::Moved => {}
                Damped::Stuck => {
                    return Err(Miss { iterations: iteration + 1, residual: self.residual(solve) });
                }
            }
        }
        Err(Miss { iterations: most, residual: self.residual(solve) })
    }

    /// Takes the step, or as much of it as makes the next one shorter; and whether all of it left little to do.
    pub(super) fn damped(&mut self, solve: &Solve, size: f64, trust: Trust) -> (Damped, bool) {
        let mut fraction = 1.0;
        loop {
            let newton = self.newton_of(solve);
            for i in 0..newton.x.len() {
                newton.trial[i] = newton.x[i] + fraction * newton.step[i];
            }
            let finite = self.evaluate(solve, true);
            if finite {
                let next = self.next_step(solve);
                if next <= (1.0 - 0.25 * fraction) * size || size <= 2.0 * f64::EPSILON {
                    self.accept_trial(solve);
                    let near = fraction == 1.0 && (next <= NEAR * size || size <= SETTLED);
                    if near && next * next <= FINISHED * size {
                        self.take_next_step(solve);
                        return (Damped::Done, true);
                    }
                    return (if size <= 4.0 * f64::EPSILON { Damped::Done } else { Damped::Moved }, near);
                }
            }
            if size <= SETTLED {
                // Rounding keeps the step from shrinking: it is as good as it gets.
                self.evaluate(solve, false);
                return (Damped::Done, true);
            }
            fraction *= 0.5;
            let newton = self.newton_of(solve);
            let shortest = match trust {
                Trust::Kink => SHORT_FRACTION,
                _ if newton.following => SHORTEST_FOLLOWING,
                _ => SHORTEST,
            };
            if fraction < shortest || newton.exhausted() {
                if trust == Trust::Damped && self.crosses_kink(solve) {
                    self.accept_trial(solve);
                    return (Damped::Moved, false);
                }
                let rounding = self.is_rounding(solve) && self.is_near_rounding(solve) || self.is_at_rounding(solve);
                return if rounding { (Damped::Done, true) } else { (Damped::Stuck, false) };
            }
        }
    }

    fn accept_trial(&mut self, solve: &Solve) {
        let newton = self.newton_of(solve);
        newton.x.copy_from_slice(&newton.trial);
        newton.size.iter_mut().zip(&newton.x).for_each(|(size, x)| *size = size.max(x.abs()));
    }

    /// Takes the step that would come next, with the Jacobian as it was before the last one.
    fn take_next_step(&mut self, solve: &Solve) {
        let newton = self.newton_of(solve);
        for i in 0..newton.x.len() {
            newton.x[i] += newton.next[i];
            newton.size[i] = newton.size[i].max(newton.x[i].abs());
        }
    }

    pub(in crate::bytecode) fn evaluate_root(&mut self, solve: &Solve) -> bool {
        self.evaluate(solve, false)
    }

    pub(in crate::bytecode) fn is_exhausted(&mut self, solve: &Solve) -> bool {
        self.newton_of(solve).exhausted()
    }

    /// Runs the code at `x` (or the trial point); whether residuals and Jacobian are finite.
    pub(super) fn evaluate(&mut self, solve: &Solve, trial: bool) -> bool {
        let newton = self.newton_of(solve);
        newton.evaluations += 1;
        let newton = &self.solvers[solve.block.0 as usize].newton;
        let point = if trial { &newton.trial } else { &newton.x };
        solve.guess.iter().zip(point).for_each(|(&g, &x)| self.r[g as usize] = x);
        self.inner::<false>(solve);
        let entries = solve.entries.iter().map(|&place| solve.matrix[place as usize]);
        entries.chain(solve.right.iter().copied()).all(|v| self.r[v as usize].is_finite())
    }

    /// Greatest residual at the point evaluated last.
    pub(super) fn residual(&self, solve: &Solve) -> f64 {
        let offset = &self.solvers[solve.block.0 as usize].newton.offset;
        let residuals = solve.right.iter().zip(offset).map(|(&v, o)| (self.r[v as usize] - o).abs());
        residuals.fold(0.0, f64::max)
    }

    pub(in crate::bytecode) fn factor(&mut self, solve: &Solve) -> bool {
        let Frame { r, solvers, .. } = self;
        let lu = &mut solvers[solve.block.0 as usize].lu;
        put_entries(lu.matrix(), solve, r);
        lu.factor().is_ok()
    }

    /// The Newton step at the point evaluated last.
    fn newton_step(&mut self, solve: &Solve) {
        let Frame { r, solvers, .. } = self;
        let solver = &mut solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        for (i, &right) in solve.right.iter().enumerate() {
            newton.step[i] = newton.offset[i] - r[right as usize];
        }
        solver.lu.solve(&mut newton.step);
    }

    /// Greatest component of the step against its unknown.
    fn relative_step(&mut self, solve: &Solve) -> f64 {
        let newton = self.newton_of(solve);
        let mut most: f64 = 0.0;
        for i in 0..newton.step.len() {
            let size = newton.step[i].abs();
            if !size.is_finite() {
                return f64::NAN;
            }
            most = most.max(size / newton.size[i].max(size).max(f64::MIN_POSITIVE));
        }
        most
    }

    /// What the next step would be with the present Jacobian, measured as [`relative_step`](Self::relative_step) does.
    pub(super) fn next_step(&mut self, solve: &Solve) -> f64 {
        let Frame { r, solvers, .. } = self;
        let solver = &mut solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        for (i, &right) in solve.right.iter().enumerate() {
            newton.next[i] = newton.offset[i] - r[right as usize];
        }
        solver.lu.solve(&mut newton.next);
        let mut most: f64 = 0.0;
        for i in 0..newton.next.len() {
            let size = newton.size[i].max(newton.step[i].abs()).max(f64::MIN_POSITIVE);
            let next = newton.next[i].abs() / size;
            most = if next.is_nan() { f64::INFINITY } else { most.max(next) };
        }
        most
    }

    /// Leaves a point at which the Jacobian is singular.
    fn nudge(&mut self, solve: &Solve, iteration: usize) {
        let newton = self.newton_of(solve);
        newton.near = false;
        for (i, x) in newton.x.iter_mut().enumerate() {
            let away = 1e-3 * (1.0 + iteration as f64) * newton.size[i].max(1.0);
            *x += if i % 2 == iteration % 2 { away } else { 0.5 * away };
        }
    }
}

impl Newton {
    /// Gives an unknown that is 0, and stays so in the first step, the magnitude at which it would count in one of the
    /// equations: what little it moves afterwards is no failure of the step. The last of a flat law is such a one.
    fn weigh_what_rests(&mut self, solve: &Solve, r: &[f64]) {
        let n = self.x.len();
        for j in 0..n {
            if self.size[j] != 0.0 || self.step[j] != 0.0 {
                continue;
            }
            let mut least = f64::INFINITY;
            for row in solve.matrix.chunks_exact(n) {
                let own = r[row[j] as usize].abs();
                let mut others = 0.0;
                for k in (0..n).filter(|&k| k != j) {
                    others += r[row[k] as usize].abs() * self.size[k].max(self.step[k].abs());
                }
                if own > 0.0 && others > 0.0 {
                    least = least.min(others / own);
                }
            }
            if least < f64::INFINITY {
                self.size[j] = least;
            }
        }
    }
}
