//! Reactions that are not unique are recorded as those of least norm.
//!
//! With `μ` the shares of what repeats others, all other reactions are `λ = λ_0 + B μ`: the least `|μ|² + |λ|²` is where
//! `(1 + Bᵀ B) μ = -Bᵀ λ_0`. `B` is exact, by derivatives along the shares; the motion does not depend on them.

use super::compiled::ModeId;
use super::{Model, minimum_norm};
use crate::bytecode::Routine;
use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::program::Value;
use halfarrow_sim::Failure;

/// How reactions are shared.
#[derive(Debug, Clone)]
pub(super) struct Shares {
    /// The inputs that are the shares, by their numbers.
    inputs: Vec<usize>,
    reactions: Vec<Symbol>,
    /// Computes the reactions, in this mode.
    routine: Option<(ModeId, Routine)>,
}

impl Model {
    /// From now on these inputs, the shares of constraints that repeat others, are recorded as they are where they and the
    /// reactions have the least sum of squares, each in its SI unit, and so is all that depends on them.
    pub fn share_reactions(&mut self, inputs: Vec<usize>, reactions: Vec<Symbol>) {
        self.shares = Some(Box::new(Shares { inputs, reactions, routine: None }));
    }

    /// Puts the shares at `(t, x)`, where everything stands, into the registers of their inputs.
    pub(super) fn place_shares(&mut self, t: f64) -> Result<(), Failure> {
        let Some(mut shares) = self.shares.take() else { return Ok(()) };
        let placed = self.least_shares(t, &mut shares);
        self.shares = Some(shares);
        self.rated = None;
        placed
    }

    fn least_shares(&mut self, t: f64, shares: &mut Shares) -> Result<(), Failure> {
        if shares.routine.as_ref().is_none_or(|(mode, _)| *mode != self.run.mode) {
            let variables = &self.code.program.variables;
            let wanted: Vec<Value> = shares.reactions.iter().filter_map(|s| variables.get(s).copied()).collect();
            shares.routine = Some((self.run.mode, self.routine_for(&wanted)));
        }
        let Some((_, routine)) = &shares.routine else { return Ok(()) };
        let (first, columns, rows) = (self.code.layout.inputs as usize, shares.inputs.len(), routine.outputs.len());
        shares.inputs.iter().for_each(|&i| self.frame.r[first + i] = 0.0);
        let mut jacobian = vec![0.0; (rows + columns) * columns];
        let mut residual = vec![0.0; rows + columns];
        for (column, &input) in shares.inputs.iter().enumerate() {
            self.still();
            self.frame.d[first + input] = 1.0;
            self.frame.run_along(routine).map_err(|error| self.failure(t, error))?;
            for (row, &register) in routine.outputs.iter().enumerate() {
                jacobian[row * columns + column] = self.frame.d[register as usize];
                residual[row] = self.frame.r[register as usize];
            }
            jacobian[(rows + column) * columns + column] = 1.0;
        }
        self.still();
        let weights = vec![1.0; rows + columns];
        if let Some(least) = minimum_norm::weighed_step(&jacobian, &residual, columns, weights) {
            shares.inputs.iter().zip(least.step).for_each(|(&i, share)| self.frame.r[first + i] = share);
        }
        Ok(())
    }
}
