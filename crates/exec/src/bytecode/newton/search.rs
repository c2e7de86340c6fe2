//! The root of a block: the continuation of the previous solution, at the start and after events any.

use super::damped::{Globalization, NotConverged};
use super::workspace::Newton;
use crate::bytecode::frame::{Frame, SolveError, entries};
use crate::bytecode::instruction::Solve;

/// First guesses after the previous solution and zero, at the start and after events.
const OTHER_STARTS: [f64; 6] = [1e-3, -1e-3, 1.0, -1.0, 1e3, -1e3];
/// Where the laws have no value at any of these: magnitudes of one unknown from 1 on, by this factor, and of pairs.
const STEP_APART: f64 = 1.05;
const FARTHEST: f64 = 1e4;
const STARTS_APART: [f64; 10] = [1.0, 3.0, 10.0, 20.0, 40.0, 70.0, 100.0, 200.0, 400.0, 1e3];

/// Why the continuation of the previous solution was not found.
#[derive(Debug, Clone, Copy)]
enum NoContinuation {
    /// There is another root.
    OtherRoot { unknown: usize, root: f64 },
    /// No root was found.
    NotConverged(NotConverged),
    /// Positions are not found where their motion leads.
    OffMotion,
}

impl Frame {
    /// Finds the root of a block that continues its previous solution, at a start any root; leaves it in `newton.x` and in
    /// the guesses.
    pub(in crate::bytecode) fn find_root(&mut self, solve: &Solve) -> Result<(), SolveError> {
        if !self.has_root(solve) {
            self.find_single_root(solve)?;
        }
        let Frame { r, solvers, .. } = self;
        let root = &solvers[solve.block.0 as usize].newton.x;
        solve.guess.iter().zip(root).for_each(|(&guess, &x)| r[guess as usize] = x);
        Ok(())
    }

    /// Whether the root is known, or has been found in a batch of blocks of the same shape.
    fn has_root(&mut self, solve: &Solve) -> bool {
        if self.is_fresh(solve) || self.rests(solve) {
            return true;
        }
        self.solve_batch(solve);
        self.is_fresh(solve)
    }

    /// Whether the root is the previous solution, since the block reads what it read there.
    fn rests(&mut self, solve: &Solve) -> bool {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        let rests = newton.rests(solve.outer.iter().map(|&register| r[register as usize]));
        if rests {
            newton.rest();
        }
        rests
    }

    /// Puts the unknowns of a Newton block where they belong if its root needs no search of its own; whether it does not.
    #[inline]
    pub fn put_known_root(&mut self, solve: &Solve) -> bool {
        if solve.guess.is_empty() || !self.has_root(solve) {
            return false;
        }
        let Frame { r, solvers, .. } = self;
        let root = &solvers[solve.block.0 as usize].newton.x;
        solve.unknowns.iter().zip(root).for_each(|(&out, &x)| r[out as usize] = x);
        true
    }

    /// Whether the root found last is the one sought: the block reads what it read then.
    fn is_fresh(&self, solve: &Solve) -> bool {
        let newton = &self.solvers[solve.block.0 as usize].newton;
        let same = |(value, &register): (&f64, &u32)| value.to_bits() == self.r[register as usize].to_bits();
        newton.fresh && newton.outer.iter().zip(&solve.outer).all(same)
    }

    fn find_single_root(&mut self, solve: &Solve) -> Result<(), SolveError> {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        (newton.evaluations, newton.fresh, newton.valued) = (0, false, false);
        (newton.short, newton.regular) = (true, false);
        newton.floating.now.fill(false);
        newton.floor.fill(0.0);
        newton.outer.iter_mut().zip(&solve.outer).for_each(|(value, &register)| *value = r[register as usize]);
        if let Err(why) = self.continue_root(solve) {
            let found = match self.newton_of(solve).following {
                false => self.search(solve),
                true if matches!(why, NoContinuation::OffMotion) => false,
                true => solve.right.len() == 1 && self.continue_by_scan(solve),
            };
            if !found {
                return Err(self.solve_error(solve, why));
            }
        }
        self.store_jacobian(solve);
        self.newton_of(solve).fresh = !has_conditions(solve);
        Ok(())
    }

    /// Keeps the Jacobian at the point evaluated last.
    pub(super) fn store_jacobian(&mut self, solve: &Solve) {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        newton.jacobian.iter_mut().zip(entries(solve, r)).for_each(|(j, entry)| *j = entry);
    }

    /// Why there is no root to continue with.
    fn solve_error(&mut self, solve: &Solve, why: NoContinuation) -> SolveError {
        let (block, newton) = (solve.block.0, self.newton_of(solve));
        match why {
            NoContinuation::OtherRoot { unknown, root } => {
                SolveError::Ended { block, unknown, from: newton.previous[unknown], to: root }
            }
            NoContinuation::OffMotion => SolveError::OffMotion { block },
            NoContinuation::NotConverged(_) if newton.exhausted() => {
                SolveError::Bound { block, evaluations: newton.limit() }
            }
            NoContinuation::NotConverged(_) if solve.right.len() == 1 => match self.scan(solve) {
                true => {
                    let newton = self.newton_of(solve);
                    SolveError::Ended { block, unknown: 0, from: newton.previous[0], to: newton.x[0] }
                }
                false => self.least_residual(solve),
            },
            NoContinuation::NotConverged(NotConverged { iterations, residual }) => {
                SolveError::NoConvergence { block, iterations, residual }
            }
        }
    }

    pub(super) fn newton_of(&mut self, solve: &Solve) -> &mut Newton {
        &mut self.solvers[solve.block.0 as usize].newton
    }

    /// The root that continues the previous solution.
    fn continue_root(&mut self, solve: &Solve) -> Result<(), NoContinuation> {
        if self.is_in_motion(solve) {
            return if self.follow_motion(solve) { Ok(()) } else { Err(NoContinuation::OffMotion) };
        }
        let newton = self.newton_of(solve);
        newton.start_at_previous();
        let first = self.iterate(solve, Globalization::Damped);
        // A root that is the previous one to the last bit is no other, small as all unknowns are beside what rounding makes of them.
        let newton = self.newton_of(solve);
        let stays = first.is_ok() && newton.x == newton.previous;
        if stays
            || first.is_ok() && self.is_continuation(solve)
            || first.is_ok() && self.newton_of(solve).following && self.is_unique_near_path(solve)
            || self.previous_is_root(solve)
            || self.solve_rank_deficient(solve)
        {
            return Ok(());
        }
        let newton = self.newton_of(solve);
        newton.floating.now.fill(false);
        for i in 0..newton.x.len() {
            newton.magnitude[i] = newton.x[i].abs().max(newton.previous[i].abs());
        }
        let why = match first {
            Ok(()) => self.other_root(solve),
            Err(failed) => NoContinuation::NotConverged(failed),
        };
        let found = self.continue_in_steps(solve) || self.continue_above_rounding(solve) || self.continue_far(solve);
        self.newton_of(solve).regular = false;
        if found { Ok(()) } else { Err(why) }
    }

    /// The same by corrections of which ever so little is taken: from where all laws are all but flat, as squares of flows near 0 are.
    fn continue_far(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        if !newton.following || newton.positions {
            return false;
        }
        newton.floating.now.fill(false);
        newton.start_at_previous();
        self.iterate(solve, Globalization::Far).is_ok() && self.is_unique_near_path(solve)
    }

    /// The same of one equation whose law is so steep on the way that no correction leads there: the root is bracketed, and counts if
    /// nothing turns round between the previous solution and it.
    fn continue_by_scan(&mut self, solve: &Solve) -> bool {
        if !self.scan(solve) {
            return false;
        }
        self.newton_of(solve).start_at_previous();
        self.is_unique_near_path(solve)
    }

    /// The same where an unknown that is 0 but for the rounding of others hides it: corrections of such an unknown are never
    /// small against it, but they are against the rounding it is made of.
    fn continue_above_rounding(&mut self, solve: &Solve) -> bool {
        if !self.newton_of(solve).following || !self.find_rounding_floors(solve) {
            return false;
        }
        let newton = self.newton_of(solve);
        newton.floating.now.fill(false);
        newton.start_at_previous();
        let at_once = self.iterate(solve, Globalization::Damped).is_ok();
        let found = at_once && (self.is_continuation(solve) || self.is_unique_near_path(solve))
            || self.continue_in_steps(solve);
        if !found {
            self.newton_of(solve).floor.fill(0.0);
        }
        found
    }

    /// The root found is another one: the unknown that differs most.
    fn other_root(&mut self, solve: &Solve) -> NoContinuation {
        let newton = self.newton_of(solve);
        let leap = |i: usize| (newton.x[i] - newton.previous[i]).abs() / newton.scale[i].max(f64::MIN_POSITIVE);
        let unknown = (0..newton.x.len()).fold(0, |most, i| if leap(i) > leap(most) { i } else { most });
        NoContinuation::OtherRoot { unknown, root: newton.x[unknown] }
    }

    /// Any root, by iterations from several first guesses.
    pub(super) fn search(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.start.copy_from_slice(&newton.previous);
        if self.search_from(solve) {
            return true;
        }
        for start in std::iter::once(0.0).chain(OTHER_STARTS) {
            self.newton_of(solve).start.fill(start);
            if self.search_from(solve) {
                return true;
            }
        }
        // Each unknown at another value: between equal ones, laws such as that of an orifice have infinite slopes.
        let n = solve.right.len();
        for start in OTHER_STARTS.into_iter().filter(|_| n > 1) {
            let apart = |i: usize| start * ((i + 1) as f64 / n as f64);
            self.newton_of(solve).start.iter_mut().enumerate().for_each(|(i, own)| *own = apart(i));
            if self.search_from(solve) {
                return true;
            }
        }
        if n > 1 && !self.newton_of(solve).valued && self.search_apart(solve) {
            return true;
        }
        self.newton_of(solve).floating.now.fill(false);
        n == 1 && self.scan(solve)
    }

    /// A root by an iteration from the start that is set. What floated on a way that led nowhere floats no more.
    fn search_from(&mut self, solve: &Solve) -> bool {
        self.newton_of(solve).floating.now.fill(false);
        if self.iterate(solve, Globalization::Damped).is_ok() || self.solve_rank_deficient(solve) {
            return true;
        }
        self.newton_of(solve).floating.now.fill(false);
        self.iterate_by_least_norm(solve)
    }

    /// Where the laws have no value at any of the starts so far, as an exponential that overflows: one unknown elsewhere, in
    /// small steps, then two of them, the others 0, on up to half the evaluations.
    fn search_apart(&mut self, solve: &Solve) -> bool {
        let n = solve.right.len();
        for one in 0..n {
            let mut distance = 1.0;
            while distance < FARTHEST {
                if [distance, -distance].into_iter().any(|way| self.search_at(solve, (one, way), (one, way))) {
                    return true;
                }
                distance *= STEP_APART;
            }
        }
        let starts = || STARTS_APART.into_iter().flat_map(|start| [start, -start]);
        for (one, other) in (0..n).flat_map(|one| (one + 1..n).map(move |other| (one, other))) {
            for (way, beside) in starts().flat_map(|way| starts().map(move |beside| (way, beside))) {
                if self.search_at(solve, (one, way), (other, beside)) {
                    return true;
                }
            }
        }
        false
    }

    /// The same from where all unknowns but these are 0.
    fn search_at(&mut self, solve: &Solve, one: (usize, f64), other: (usize, f64)) -> bool {
        let newton = self.newton_of(solve);
        if newton.evaluations > newton.limit() / 2 {
            return false;
        }
        newton.start.fill(0.0);
        [other, one].into_iter().for_each(|(unknown, way)| newton.start[unknown] = way);
        newton.trial.copy_from_slice(&newton.start);
        self.evaluate(solve, true) && self.search_from(solve)
    }
}

/// Whether inner code reads conditions, which may be held or not.
fn has_conditions(solve: &Solve) -> bool {
    solve.code.iter().any(|operation| operation.op.is_held())
}
