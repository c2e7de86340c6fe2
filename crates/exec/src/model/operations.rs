//! What one evaluation takes, counted in the code that is run.

use super::Model;
use halfarrow_compiler::program::{Instruction, Routine, Solve};

/// Operations of one evaluation of rates or residuals.
///
/// Comparisons and choices count as additions, powers with whole exponents as multiplications, functions, other powers and
/// tables as calls. A block of linear equations counts with its elimination, a block solved by Newton with one
/// iteration: how many it takes is known to a run alone.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Operations {
    /// Additions, subtractions, changes of sign, comparisons.
    pub additions: usize,
    /// Multiplications.
    pub multiplications: usize,
    /// Divisions.
    pub divisions: usize,
    /// Calls of functions and tables.
    pub calls: usize,
    /// Blocks solved by Newton.
    pub iterated: usize,
}

impl Operations {
    /// All of them, each counted once.
    pub fn total(&self) -> usize {
        self.additions + self.multiplications + self.divisions + self.calls
    }

    fn of(routine: &Routine) -> Operations {
        let mut counted = Operations::default();
        routine.code.iter().for_each(|instruction| counted.count(instruction));
        routine.solves.iter().for_each(|solve| counted.solve(solve));
        counted
    }

    fn count(&mut self, instruction: &Instruction) {
        match instruction {
            Instruction::Neg { .. }
            | Instruction::Add { .. }
            | Instruction::Sub { .. }
            | Instruction::Positive { .. }
            | Instruction::Side { .. }
            | Instruction::And { .. }
            | Instruction::Or { .. }
            | Instruction::Not { .. }
            | Instruction::Select { .. } => self.additions += 1,
            Instruction::Mul { .. } => self.multiplications += 1,
            Instruction::Div { .. } => self.divisions += 1,
            Instruction::Powi { n, .. } => self.multiplications += (n.ilog2() + n.count_ones() - 1) as usize,
            Instruction::Pow { .. }
            | Instruction::Call { .. }
            | Instruction::Call2 { .. }
            | Instruction::Floor { .. }
            | Instruction::Table { .. }
            | Instruction::TableSlope { .. }
            | Instruction::TableCurvature { .. } => self.calls += 1,
            // Handed through, watched, or counted with its block.
            Instruction::Parameter { .. } | Instruction::Watch { .. } | Instruction::Solve { .. } => {}
        }
    }

    /// Elimination of a full matrix with one right side, and the code of an iteration.
    fn solve(&mut self, solve: &Solve) {
        let n = solve.unknowns.len();
        let products = n * n.saturating_sub(1) * (2 * n).saturating_sub(1) / 6 + n * n.saturating_sub(1);
        self.multiplications += products;
        self.additions += products;
        self.divisions += n * (n + 1) / 2;
        if !solve.guess.is_empty() {
            self.iterated += 1;
            self.additions += n;
            solve.code.iter().for_each(|instruction| self.count(instruction));
        }
    }
}

impl Model {
    /// What one evaluation of the rates takes.
    pub fn operations(&self) -> Operations {
        Operations::of(&self.code.rates)
    }
}
