//! What is read after a place in a routine.

use halfarrow_compiler::program::{Instruction, Register, Solve};
use std::collections::BTreeSet;

/// Calls `visit` with each register that an instruction reads; solve blocks are not visited.
fn reads(instruction: &Instruction, mut visit: impl FnMut(Register)) {
    use Instruction::*;
    match *instruction {
        Neg { a, .. } | Powi { a, .. } | Call { a, .. } | Positive { a, .. } | Side { a, .. } => visit(a),
        Floor { a, .. } | Not { a, .. } | Table { a, .. } | TableSlope { a, .. } | TableCurvature { a, .. } => visit(a),
        Add { a, b, .. } | Sub { a, b, .. } | Mul { a, b, .. } | Div { a, b, .. } | Pow { a, b, .. } => {
            visit(a);
            visit(b);
        }
        Call2 { a, b, .. } | And { a, b, .. } | Or { a, b, .. } => {
            visit(a);
            visit(b);
        }
        Select { c, a, b, .. } => [c, a, b].into_iter().for_each(visit),
        Watch { pivot, scale, .. } => [pivot, scale].into_iter().for_each(visit),
        Parameter { default, .. } => visit(default),
        Solve { .. } => {}
    }
}

/// The register that an instruction writes.
fn written(instruction: &Instruction) -> Option<Register> {
    use Instruction::*;
    match *instruction {
        Neg { out, .. } | Powi { out, .. } | Call { out, .. } | Positive { out, .. } | Side { out, .. } => Some(out),
        Floor { out, .. } | Not { out, .. } | Table { out, .. } | TableSlope { out, .. } => Some(out),
        TableCurvature { out, .. } | Parameter { out, .. } | Select { out, .. } => Some(out),
        Add { out, .. } | Sub { out, .. } | Mul { out, .. } | Div { out, .. } | Pow { out, .. } => Some(out),
        Call2 { out, .. } | And { out, .. } | Or { out, .. } => Some(out),
        Watch { .. } | Solve { .. } => None,
    }
}

/// Registers that are read before they are written.
#[derive(Debug, Clone, Default)]
pub(super) struct Live(BTreeSet<Register>);

impl Live {
    pub fn of(registers: &[Register]) -> Live {
        Live(registers.iter().copied().collect())
    }

    /// Goes back over an instruction.
    pub fn before(&mut self, instruction: &Instruction) {
        if let Some(out) = written(instruction) {
            self.0.remove(&out);
        }
        reads(instruction, |register| {
            self.0.insert(register);
        });
    }

    /// Goes back over a solve block.
    pub fn before_solve(&mut self, solve: &Solve) {
        for register in &solve.unknowns {
            self.0.remove(register);
        }
        self.0.extend(solve.matrix.iter().chain(&solve.right));
        solve.code.iter().rev().for_each(|instruction| self.before(instruction));
        for register in &solve.guess {
            self.0.remove(register);
        }
        self.0.extend(&solve.outer);
    }

    pub fn registers(&self) -> Vec<Register> {
        self.0.iter().copied().collect()
    }
}
