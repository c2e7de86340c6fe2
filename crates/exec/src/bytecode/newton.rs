//! Newton's method for a solve block: damped by the natural test, exact Jacobian, to rounding.

use super::frame::{Frame, Trouble};
use halfarrow_compiler::program::Solve;

/// Iterations of one attempt.
const ITERATIONS: usize = 100;
/// Shortest fraction of a step that is tried.
const SHORTEST: f64 = 1e-12;
/// A relative step below this that no longer improves the residual is rounding.
const SETTLED: f64 = 1e-9;
/// Attempts from other points after those from the last solution and from zero.
const OTHER_STARTS: [f64; 6] = [1e-3, -1e-3, 1.0, -1.0, 1e3, -1e3];

/// Memory and working space of a Newton block.
#[derive(Debug, Clone)]
pub(crate) struct Newton {
    /// Where the next solution starts: part of the model's state.
    pub memory: Vec<f64>,
    /// The last solution found.
    pub x: Vec<f64>,
    step: Vec<f64>,
    trial: Vec<f64>,
    next: Vec<f64>,
    /// Greatest magnitude of each unknown so far.
    size: Vec<f64>,
    /// What is subtracted from the residuals on the way from a point where they do not vanish.
    offset: Vec<f64>,
    first: Vec<f64>,
    /// The last root on that way.
    kept: Vec<f64>,
}

impl Newton {
    pub fn new(size: usize) -> Newton {
        let line = vec![0.0; size];
        Newton {
            memory: line.clone(),
            x: line.clone(),
            step: line.clone(),
            trial: line.clone(),
            next: line.clone(),
            size: line.clone(),
            offset: line.clone(),
            first: line.clone(),
            kept: line,
        }
    }
}

/// An attempt that failed.
#[derive(Debug, Clone, Copy)]
struct Miss {
    iterations: usize,
    residual: f64,
}

impl Frame {
    /// Finds the root of a block from its memory, or from elsewhere; leaves it in `newton.x` and in the guesses.
    pub(super) fn find_root(&mut self, solve: &Solve) -> Result<(), Trouble> {
        let block = solve.block.0 as usize;
        self.newton_of(solve).offset.fill(0.0);
        let newton = self.newton_of(solve);
        newton.x.copy_from_slice(&newton.memory);
        let Err(first) = self.attempt(solve) else { return Ok(()) };
        for start in std::iter::once(0.0).chain(OTHER_STARTS) {
            self.newton_of(solve).x.fill(start);
            if self.attempt(solve).is_ok() {
                return Ok(());
            }
        }
        if self.approach(solve) {
            return Ok(());
        }
        let Miss { iterations, residual } = first;
        Err(Trouble::NoConvergence { block: block as u32, iterations, residual })
    }

    fn newton_of(&mut self, solve: &Solve) -> &mut Newton {
        &mut self.solvers[solve.block.0 as usize].newton
    }

    /// Follows the roots of `residual - (1 - s) residual(start)` from the memory at `s = 0` to `s = 1`.
    fn approach(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.x.copy_from_slice(&newton.memory);
        newton.offset.fill(0.0);
        if !self.evaluate(solve, false) {
            return false;
        }
        for (i, &right) in solve.right.iter().enumerate() {
            let residual = self.r[right as usize];
            self.newton_of(solve).first[i] = residual;
        }
        let (mut s, mut stride) = (0.0f64, 0.1f64);
        while stride > 1e-5 {
            let next = (s + stride).min(1.0);
            let newton = self.newton_of(solve);
            newton.offset.iter_mut().zip(&newton.first).for_each(|(o, f)| *o = (1.0 - next) * f);
            newton.kept.copy_from_slice(&newton.x);
            if self.attempt(solve).is_ok() {
                if next == 1.0 {
                    return true;
                }
                (s, stride) = (next, 2.0 * stride);
            } else {
                let newton = self.newton_of(solve);
                newton.x.copy_from_slice(&newton.kept);
                stride *= 0.5;
            }
        }
        self.newton_of(solve).offset.fill(0.0);
        false
    }

    /// Newton from `newton.x`.
    fn attempt(&mut self, solve: &Solve) -> Result<(), Miss> {
        let n = solve.right.len();
        let newton = self.newton_of(solve);
        (0..n).for_each(|i| newton.size[i] = newton.x[i].abs());
        if !self.evaluate(solve, false) {
            return Err(Miss { iterations: 0, residual: f64::NAN });
        }
        for iteration in 0..ITERATIONS {
            if self.residual(solve) == 0.0 {
                return Ok(());
            }
            if !self.factor(solve) {
                self.nudge(solve, iteration);
                if !self.evaluate(solve, false) {
                    return Err(Miss { iterations: iteration, residual: f64::NAN });
                }
                continue;
            }
            self.newton_step(solve);
            let size = self.relative_step(solve);
            if !size.is_finite() {
                break;
            }
            match self.damped(solve, size) {
                Damped::Done => return Ok(()),
                Damped::Moved => {}
                Damped::Stuck => {
                    return Err(Miss { iterations: iteration + 1, residual: self.residual(solve) });
                }
            }
        }
        Err(Miss { iterations: ITERATIONS, residual: self.residual(solve) })
    }

    /// Takes the step, or as much of it as makes the next one shorter.
    fn damped(&mut self, solve: &Solve, size: f64) -> Damped {
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
                    return if size <= 4.0 * f64::EPSILON { Damped::Done } else { Damped::Moved };
                }
            }
            if size <= SETTLED {
                // Rounding keeps the step from shrinking: it is as good as it gets.
                self.evaluate(solve, false);
                return Damped::Done;
            }
            fraction *= 0.5;
            if fraction < SHORTEST {
                self.evaluate(solve, false);
                return Damped::Stuck;
            }
        }
    }

    fn accept_trial(&mut self, solve: &Solve) {
        let newton = self.newton_of(solve);
        newton.x.copy_from_slice(&newton.trial);
        newton.size.iter_mut().zip(&newton.x).for_each(|(size, x)| *size = size.max(x.abs()));
    }

    /// Runs the code at `x` (or the trial point); whether residuals and Jacobian are finite.
    fn evaluate(&mut self, solve: &Solve, trial: bool) -> bool {
        let newton = &self.solvers[solve.block.0 as usize].newton;
        let point = if trial { &newton.trial } else { &newton.x };
        solve.guess.iter().zip(point).for_each(|(&g, &x)| self.r[g as usize] = x);
        self.plain::<false>(&solve.code);
        solve.right.iter().chain(&solve.matrix).all(|&v| self.r[v as usize].is_finite())
    }

    /// Greatest residual at the point evaluated last.
    fn residual(&self, solve: &Solve) -> f64 {
        let offset = &self.solvers[solve.block.0 as usize].newton.offset;
        let residuals = solve.right.iter().zip(offset).map(|(&v, o)| (self.r[v as usize] - o).abs());
        residuals.fold(0.0, f64::max)
    }

    fn factor(&mut self, solve: &Solve) -> bool {
        let Frame { r, solvers, .. } = self;
        let lu = &mut solvers[solve.block.0 as usize].lu;
        lu.matrix().iter_mut().zip(&solve.matrix).for_each(|(a, &m)| *a = r[m as usize]);
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
    fn next_step(&mut self, solve: &Solve) -> f64 {
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
        for (i, x) in newton.x.iter_mut().enumerate() {
            let away = 1e-3 * (1.0 + iteration as f64) * newton.size[i].max(1.0);
            *x += if i % 2 == iteration % 2 { away } else { 0.5 * away };
        }
    }
}

/// What became of a step.
enum Damped {
    Done,
    Moved,
    Stuck,
}
