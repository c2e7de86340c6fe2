//! Routines backwards: from what their outputs weigh to what all that they read weighs. Source: [GriewankWalther].

use super::frame::{Frame, SolveError};
use super::instruction::{Instruction, Operation, Register, Routine, Solve};
use halfarrow_compiler::for_each_op;
use halfarrow_compiler::program::calculus::Plain;
use halfarrow_compiler::program::{ConditionId, Op};

/// The weight of each register: the derivative by it of the weighted sum of the outputs.
#[derive(Debug, Clone, Default)]
pub(crate) struct Weights {
    of: Vec<f64>,
    /// Right-hand side and solution of a solve block.
    block: Vec<f64>,
}

impl Weights {
    /// The weight of a register.
    pub fn of(&self, register: Register) -> f64 {
        self.of[register as usize]
    }
}

impl Frame {
    /// Goes back through a routine that [keeps](super::Layout::keeping) its values and has just run, its outputs weighted.
    pub fn run_back(
        &mut self,
        routine: &Routine,
        outputs: impl Iterator<Item = f64>,
        weights: &mut Weights,
    ) -> Result<(), SolveError> {
        weights.of.resize(self.r.len(), 0.0);
        weights.of.fill(0.0);
        routine.outputs.iter().zip(outputs).for_each(|(&output, weight)| weights.of[output as usize] += weight);
        for instruction in routine.code.iter().rev() {
            match instruction {
                Instruction::Op(operation) => self.back(operation, weights),
                Instruction::Solve { solve } => self.back_through(&routine.solves[*solve as usize], weights)?,
                Instruction::Guard { .. } => {}
                Instruction::Parameter { .. } => unreachable!("parameters have their values before a routine runs"),
            }
        }
        Ok(())
    }

    /// The unknowns `x` of `A x = b` weigh `w`: then `b` weighs `y = A⁻ᵀ w`, and an entry of `A` in row i, column j `-y_i x_j`.
    /// Those of `g(x, a) = 0` are the same with the Jacobian in the place of `A` and `-g` in that of `b`.
    fn back_through(&mut self, solve: &Solve, weights: &mut Weights) -> Result<(), SolveError> {
        let Weights { of, block } = weights;
        block.clear();
        block.extend(solve.unknowns.iter().map(|&unknown| std::mem::take(&mut of[unknown as usize])));
        if block.iter().all(|&weight| weight == 0.0) {
            return Ok(());
        }
        if solve.guess.is_empty() {
            self.solvers[solve.shared.unwrap_or(solve.block).0 as usize].factors.solve_transposed(block);
            assert!(
                solve.shared.is_none() || !solve.matrix.is_empty(),
                "what shares large factors is itself a derivative"
            );
            solve.right.iter().zip(&*block).for_each(|(&right, y)| of[right as usize] += y);
            for (&entry, (row, column)) in solve.matrix.iter().zip(solve.pattern.places()) {
                of[entry as usize] -= block[row] * self.r[solve.unknowns[column] as usize];
            }
            return Ok(());
        }
        solve.guess.iter().zip(&solve.unknowns).for_each(|(&guess, &x)| self.r[guess as usize] = self.r[x as usize]);
        self.plain::<false>(&solve.code);
        let Frame { r, solvers, .. } = self;
        let factors = &mut solvers[solve.block.0 as usize].factors;
        if factors.factor(solve.matrix.iter().map(|&entry| r[entry as usize])).is_err() {
            return Err(SolveError::Singular { block: solve.block.0 });
        }
        factors.solve_transposed(block);
        solve.right.iter().zip(&*block).for_each(|(&right, y)| of[right as usize] -= y);
        solve.code.iter().rev().for_each(|operation| self.back(operation, weights));
        // The unknowns themselves are what the equations are solved for.
        solve.guess.iter().for_each(|&guess| weights.of[guess as usize] = 0.0);
        Ok(())
    }

    /// One operation: what its operands weigh, by the rules of the table, whose rates are linear.
    #[allow(unused_variables, unused_assignments, reason = "each rule reads what it needs")]
    fn back(&mut self, operation: &Operation, weights: &mut Weights) {
        let weight = std::mem::take(&mut weights.of[operation.out as usize]);
        if weight == 0.0 {
            return;
        }
        macro_rules! compute {
            (($k:ident $value:ident)
             given { $($(#[$given_doc:meta])* $given:ident $(($($given_part:ident: $given_kind:ty),*))?;)* }
             plain { $($(#[$plain_doc:meta])* $plain:ident($($part:ident: $kind:ty),*) [$($a:ident $da:ident $A:ident),*] {
                cost: $cost:ident, value: $meaning:expr, text: $text:literal, c: $c:expr, derivative: $derivative:expr,
             })* }
             held $held:tt) => {
                match operation.op {
                    $(Op::$plain($($part,)* $($a),*) => {
                        let operands = [$($a),*];
                        $(let $a = self.r[$a as usize];)*
                        let $value = self.r[operation.out as usize];
                        for (moving, &operand) in operands.iter().enumerate() {
                            let mut place = 0;
                            $(
                                let $da = (place == moving).then_some(weight);
                                place += 1;
                            )*
                            let $k = &mut Plain;
                            weights.of[operand as usize] += $derivative.unwrap_or(0.0);
                        }
                    })*
                    Op::Sign(..) | Op::Floor(..) => {}
                    Op::Table(table, piece, a) => self.back_through_table((a, weight), (table, piece), 1, weights),
                    Op::TableSlope(table, piece, a) => self.back_through_table((a, weight), (table, piece), 2, weights),
                    Op::TableCurvature(table, piece, a) => {
                        self.back_through_table((a, weight), (table, piece), 3, weights);
                    }
                    $(Op::$given { .. })|* => unreachable!("given before the routine runs"),
                }
            };
        }
        for_each_op!(compute);
    }

    fn back_through_table(
        &mut self,
        (a, weight): (Register, f64),
        (table, piece): (u32, Option<ConditionId>),
        order: usize,
        weights: &mut Weights,
    ) {
        weights.of[a as usize] += weight * self.table_at(self.r[a as usize], table, piece)[order];
    }
}
