//! The root of a block: the one that goes on from the last, else any.

use super::attempt::{Miss, Trust};
use super::workspace::Newton;
use crate::bytecode::frame::{Frame, Trouble, put_entries};
use crate::bytecode::instruction::Solve;

/// Attempts from other points after those from the last solution and from zero, at the start and after jumps.
const OTHER_STARTS: [f64; 6] = [1e-3, -1e-3, 1.0, -1.0, 1e3, -1e3];

/// Why the root that goes on from the last one was not found.
#[derive(Debug, Clone, Copy)]
enum Missed {
    /// There is another one.
    Elsewhere { unknown: usize, root: f64 },
    /// None was found.
    All(Miss),
}

impl Frame {
    /// Finds the root of a block that goes on from its memory, at a start any root; leaves it in `newton.x` and in the
    /// guesses.
    pub(in crate::bytecode) fn find_root(&mut self, solve: &Solve) -> Result<(), Trouble> {
        if !self.has_root(solve) {
            self.find_root_alone(solve)?;
        }
        let Frame { r, solvers, .. } = self;
        let root = &solvers[solve.block.0 as usize].newton.x;
        solve.guess.iter().zip(root).for_each(|(&guess, &x)| r[guess as usize] = x);
        Ok(())
    }

    /// Whether the root is known, or has been found beside those of blocks of the same shape.
    fn has_root(&mut self, solve: &Solve) -> bool {
        if !self.is_fresh(solve) {
            self.solve_abreast(solve);
            return self.is_fresh(solve);
        }
        true
    }

    /// Puts the unknowns of a Newton block where they belong if its root needs no search of its own; whether it does not.
    #[inline]
    pub fn takes_root(&mut self, solve: &Solve) -> bool {
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

    fn find_root_alone(&mut self, solve: &Solve) -> Result<(), Trouble> {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        (newton.evaluations, newton.fresh) = (0, false);
        newton.floating.now.fill(false);
        newton.floor.fill(0.0);
        newton.outer.iter_mut().zip(&solve.outer).for_each(|(value, &register)| *value = r[register as usize]);
        if let Err(missed) = self.follow(solve)
            && (self.newton_of(solve).following || !self.search(solve))
        {
            return Err(self.trouble(solve, missed));
        }
        self.keep_jacobian(solve);
        self.newton_of(solve).fresh = !has_conditions(solve);
        Ok(())
    }

    /// Takes note of the Jacobian at the point evaluated last.
    pub(super) fn keep_jacobian(&mut self, solve: &Solve) {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        put_entries(&mut newton.jacobian, solve, r);
    }

    /// Why there is no root to go on with.
    fn trouble(&mut self, solve: &Solve, missed: Missed) -> Trouble {
        let (block, newton) = (solve.block.0, self.newton_of(solve));
        match missed {
            Missed::Elsewhere { unknown, root } => {
                Trouble::Ended { block, unknown, from: newton.memory[unknown], to: root }
            }
            Missed::All(_) if newton.exhausted() => Trouble::Bound { block, evaluations: newton.limit() },
            Missed::All(_) if solve.right.len() == 1 => match self.scan(solve) {
                true => {
                    let newton = self.newton_of(solve);
                    Trouble::Ended { block, unknown: 0, from: newton.memory[0], to: newton.x[0] }
                }
                false => self.nowhere(solve),
            },
            Missed::All(Miss { iterations, residual }) => Trouble::NoConvergence { block, iterations, residual },
        }
    }

    pub(super) fn newton_of(&mut self, solve: &Solve) -> &mut Newton {
        &mut self.solvers[solve.block.0 as usize].newton
    }

    /// The root that goes on from the memory.
    fn follow(&mut self, solve: &Solve) -> Result<(), Missed> {
        let newton = self.newton_of(solve);
        newton.offset.fill(0.0);
        newton.kept.copy_from_slice(&newton.memory);
        newton.base.copy_from_slice(&newton.jacobian_memory);
        let first = self.attempt(solve, Trust::Damped);
        if first.is_ok() && (self.goes_on(solve) || self.newton_of(solve).following && self.is_the_only_one(solve))
            || self.stays(solve)
            || self.floats(solve)
        {
            return Ok(());
        }
        let newton = self.newton_of(solve);
        newton.floating.now.fill(false);
        for i in 0..newton.x.len() {
            newton.span[i] = newton.x[i].abs().max(newton.memory[i].abs());
        }
        let missed = match first {
            Ok(()) => self.elsewhere(solve),
            Err(miss) => Missed::All(miss),
        };
        if self.approach(solve) || self.follows_above_rounding(solve) { Ok(()) } else { Err(missed) }
    }

    /// The root that goes on from the memory, where an unknown that is 0 but for the rounding of others hides it: steps of
    /// such an unknown are never small against it, but they are against what rounding leaves of it.
    fn follows_above_rounding(&mut self, solve: &Solve) -> bool {
        if !self.newton_of(solve).following || !self.find_floors(solve) {
            return false;
        }
        let newton = self.newton_of(solve);
        newton.floating.now.fill(false);
        newton.offset.fill(0.0);
        newton.kept.copy_from_slice(&newton.memory);
        newton.base.copy_from_slice(&newton.jacobian_memory);
        let at_once = self.attempt(solve, Trust::Damped).is_ok();
        let found = at_once && (self.goes_on(solve) || self.is_the_only_one(solve)) || self.approach(solve);
        if !found {
            self.newton_of(solve).floor.fill(0.0);
        }
        found
    }

    /// The root found is another one: the unknown that differs most.
    fn elsewhere(&mut self, solve: &Solve) -> Missed {
        let newton = self.newton_of(solve);
        let leap = |i: usize| (newton.x[i] - newton.memory[i]).abs() / newton.size[i].max(f64::MIN_POSITIVE);
        let unknown = (0..newton.x.len()).fold(0, |most, i| if leap(i) > leap(most) { i } else { most });
        Missed::Elsewhere { unknown, root: newton.x[unknown] }
    }

    /// Any root.
    pub(super) fn search(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.kept.copy_from_slice(&newton.memory);
        if self.attempt(solve, Trust::Damped).is_ok() || self.floats(solve) {
            return true;
        }
        for start in std::iter::once(0.0).chain(OTHER_STARTS) {
            self.newton_of(solve).kept.fill(start);
            if self.attempt(solve, Trust::Damped).is_ok() || self.floats(solve) {
                return true;
            }
        }
        self.newton_of(solve).floating.now.fill(false);
        solve.right.len() == 1 && self.scan(solve)
    }
}

/// Whether inner code reads conditions, which may be held or not.
fn has_conditions(solve: &Solve) -> bool {
    solve.code.iter().any(|operation| operation.op.is_held())
}
