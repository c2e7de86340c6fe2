//! What one evaluation takes, counted in the code that is run.

use super::Model;
use crate::bytecode::{Instruction, Operation, Routine, Solve};
use halfarrow_compiler::program::{Block, Cost, Op, Program};

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

    pub(super) fn of(routine: &Routine, program: &Program) -> Operations {
        let mut counted = Operations::default();
        // What is handed through or guarded is not counted, blocks are below.
        let operations = routine.code.iter().filter_map(|i| if let Instruction::Op(o) = i { Some(o) } else { None });
        operations.for_each(|operation| counted.count(operation));
        routine.solves.iter().for_each(|solve| counted.solve(solve, &program.blocks[solve.block]));
        counted
    }

    fn count(&mut self, &Operation { op, .. }: &Operation) {
        match (op.cost(), op) {
            (Cost::Given, _) => {}
            (Cost::Addition, _) => self.additions += 1,
            (Cost::Multiplication, _) => self.multiplications += 1,
            (Cost::Division, _) => self.divisions += 1,
            (Cost::Power, Op::Powi(n, _)) => self.multiplications += (n.ilog2() + n.count_ones() - 1) as usize,
            (Cost::Power | Cost::Call | Cost::Table, _) => self.calls += 1,
        }
    }

    /// Elimination with one right side, sparse where the block is, and the code of an iteration.
    fn solve(&mut self, solve: &Solve, block: &Block) {
        let n = solve.unknowns.len();
        let (Block::Linear { matrix, .. } | Block::Newton { jacobian: matrix, .. }) = block;
        let (products, divisions) = match &matrix.factors {
            Some(factors) => {
                let (lower, upper) = (&factors.lower, &factors.upper);
                let rows = lower.columns().iter().map(|&k| upper.columns_of(k as usize).len()).sum::<usize>();
                // Once more for the refinement, with the residual before it.
                (rows + 2 * (lower.len() + upper.len()) + factors.matrix.len(), lower.len() + 2 * n)
            }
            None => {
                (n * n.saturating_sub(1) * (2 * n).saturating_sub(1) / 6 + n * n.saturating_sub(1), n * (n + 1) / 2)
            }
        };
        self.multiplications += products;
        self.additions += products;
        self.divisions += divisions;
        if !solve.guess.is_empty() {
            self.iterated += 1;
            self.additions += n;
            solve.code.iter().for_each(|operation| self.count(operation));
        }
    }
}

impl Model {
    /// What one evaluation of the rates takes.
    pub fn operations(&self) -> Operations {
        Operations::of(&self.code.rates, self.program())
    }
}
