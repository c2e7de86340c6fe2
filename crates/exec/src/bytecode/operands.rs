//! What an instruction reads and writes.

use halfarrow_compiler::program::{Instruction, Register};

/// Calls `visit` with each register that an instruction reads; solve blocks are not visited.
pub(crate) fn reads(instruction: &Instruction, mut visit: impl FnMut(Register)) {
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
pub(crate) fn written(instruction: &Instruction) -> Option<Register> {
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

/// The same instruction on other registers, in the order in which [`reads`] visits them; it is no solve block or parameter.
pub(crate) fn moved(instruction: Instruction, read: &[Register], out: Option<Register>) -> Instruction {
    use Instruction::*;
    let out = out.unwrap_or_default();
    let a = read[0];
    let b = || read[1];
    match instruction {
        Powi { n, .. } => Powi { out, a, n },
        Pow { .. } => Pow { out, a, b: b() },
        Call { f, .. } => Call { f, out, a },
        Call2 { f, .. } => Call2 { f, out, a, b: b() },
        Positive { .. } => Positive { out, a },
        Side { condition, .. } => Side { out, a, condition },
        Floor { condition, .. } => Floor { out, a, condition },
        And { .. } => And { out, a, b: b() },
        Or { .. } => Or { out, a, b: b() },
        Not { .. } => Not { out, a },
        Select { .. } => Select { out, c: a, a: b(), b: read[2] },
        Table { table, piece, .. } => Table { out, a, table, piece },
        TableSlope { table, piece, .. } => TableSlope { out, a, table, piece },
        TableCurvature { table, piece, .. } => TableCurvature { out, a, table, piece },
        Watch { watch, .. } => Watch { pivot: a, scale: b(), watch },
        Add { .. } => Add { out, a, b: b() },
        Sub { .. } => Sub { out, a, b: b() },
        Mul { .. } => Mul { out, a, b: b() },
        Div { .. } => Div { out, a, b: b() },
        Neg { .. } => Neg { out, a },
        Parameter { .. } | Solve { .. } => unreachable!("neither stands in a routine for lanes as it is"),
    }
}
