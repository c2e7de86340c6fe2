//! What is read after a place in a routine.

use crate::bytecode::{Operation, Register, Solve};
use std::collections::BTreeSet;

/// Registers that are read before they are written.
#[derive(Debug, Clone, Default)]
pub(super) struct Live(BTreeSet<Register>);

impl Live {
    pub fn of(registers: &[Register]) -> Live {
        Live(registers.iter().copied().collect())
    }

    /// Goes back over an operation.
    pub fn before(&mut self, operation: &Operation) {
        self.0.remove(&operation.out);
        operation.op.for_each_operand(|register| self.read(register));
    }

    /// Notes that a register is read.
    pub fn read(&mut self, register: Register) {
        self.0.insert(register);
    }

    /// Goes back over a solve block.
    pub fn before_solve(&mut self, solve: &Solve) {
        for register in &solve.unknowns {
            self.0.remove(register);
        }
        self.0.extend(solve.matrix.iter().chain(&solve.right));
        solve.code.iter().rev().for_each(|operation| self.before(operation));
        for register in &solve.guess {
            self.0.remove(register);
        }
        self.0.extend(&solve.outer);
    }

    pub fn registers(&self) -> Vec<Register> {
        self.0.iter().copied().collect()
    }
}
