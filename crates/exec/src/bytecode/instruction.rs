//! The bytecode: operations on registers, and the code that they make.

use halfarrow_compiler::program::{self, BlockId, Op};
use halfarrow_compiler::sparse::Pattern;
use std::sync::Arc;

/// A place for one number.
pub(crate) type Register = u32;

/// An operation on registers; `out` may be one of its operands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Operation {
    pub out: Register,
    pub op: Op<Register>,
}

/// What the interpreter does in one go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Instruction {
    /// An operation.
    Op(Operation),
    /// The parameter's set value, or `default` where none is set.
    Parameter { out: Register, index: u32, default: Register },
    /// Stops if the pivot vanishes against its scale.
    Guard { pivot: Register, scale: Register, guard: u32 },
    /// A solve block: index into [`Routine::solves`].
    Solve { solve: u32 },
}

/// A solve block in a routine.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Solve {
    /// The block.
    pub block: BlockId,
    /// The block that has factored the same matrix, if there is one.
    pub shared: Option<BlockId>,
    /// Where the unknowns are written.
    pub unknowns: Vec<Register>,
    /// Newton: where the guess is put before `code` runs; empty for a linear block.
    pub guess: Vec<Register>,
    /// Newton: what varies outside and is read by `code`, in the order of the values; the same in every routine.
    pub outer: Vec<Register>,
    /// Newton: computes right side and matrix at the guess.
    pub code: Vec<Operation>,
    /// The entries of the matrix of a linear block (none where factors are shared), of the Jacobian of a Newton block.
    pub matrix: Vec<Register>,
    /// Where they stand.
    pub pattern: Arc<Pattern>,
    /// Right-hand side of a linear block, residuals of a Newton block.
    pub right: Vec<Register>,
}

/// A routine on registers.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Routine {
    /// The code.
    pub code: Vec<Instruction>,
    /// Its solve blocks.
    pub solves: Vec<Solve>,
    /// Where the wanted values stand when it has run.
    pub outputs: Vec<Register>,
    /// Number of registers it needs, fixed ones included.
    pub registers: u32,
    /// What it was made of.
    pub source: program::Code,
}

impl Routine {
    /// Every register that it reads, those that it has written before too.
    pub fn for_each_read(&self, mut see: impl FnMut(Register)) {
        for instruction in &self.code {
            match instruction {
                Instruction::Op(operation) => operation.op.for_each_operand(&mut see),
                Instruction::Parameter { default, .. } => see(*default),
                Instruction::Guard { pivot, scale, .. } => [*pivot, *scale].into_iter().for_each(&mut see),
                Instruction::Solve { solve } => {
                    let solve = &self.solves[*solve as usize];
                    solve.code.iter().for_each(|operation| operation.op.for_each_operand(&mut see));
                    solve.outer.iter().chain(&solve.matrix).chain(&solve.right).for_each(|&register| see(register));
                }
            }
        }
        self.outputs.iter().for_each(|&register| see(register));
    }
}
