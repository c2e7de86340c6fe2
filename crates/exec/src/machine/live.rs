//! What is read after a place in a routine.

use super::chunk::ChunkItem;
use crate::bytecode::{Operation, Register, Solve};

/// Registers that are read before they are written.
#[derive(Debug, Clone, Default)]
pub(super) struct Live(Vec<bool>);

impl Live {
    pub fn of<'a>(registers: impl IntoIterator<Item = &'a Register>) -> Live {
        let mut live = Live::default();
        live.read_all(registers);
        live
    }

    /// Goes back over some code; what it writes that is read behind it, in order.
    pub fn before_all(&mut self, items: &[ChunkItem]) -> Vec<Register> {
        let mut written: Vec<Register> = items.iter().flat_map(ChunkItem::written).copied().collect();
        written.retain(|&register| self.holds(register));
        written.sort_unstable();
        written.dedup();
        for item in items.iter().rev() {
            match item {
                ChunkItem::Op(operation) => self.before(operation),
                ChunkItem::Guard { pivot, scale, .. } => self.read_all([pivot, scale]),
                ChunkItem::Solve(solve) => self.before_solve(solve),
            }
        }
        written
    }

    /// Goes back over a solve block.
    pub fn before_solve(&mut self, solve: &Solve) {
        solve.unknowns.iter().for_each(|&register| self.written(register));
        self.read_all(solve.matrix.iter().chain(&solve.right));
        solve.code.iter().rev().for_each(|operation| self.before(operation));
        solve.guess.iter().for_each(|&register| self.written(register));
        self.read_all(&solve.outer);
    }

    fn before(&mut self, operation: &Operation) {
        self.written(operation.out);
        operation.op.for_each_operand(|register| self.read_all([&register]));
    }

    fn holds(&self, register: Register) -> bool {
        self.0.get(register as usize).is_some_and(|&read| read)
    }

    fn written(&mut self, register: Register) {
        if let Some(read) = self.0.get_mut(register as usize) {
            *read = false;
        }
    }

    fn read_all<'a>(&mut self, registers: impl IntoIterator<Item = &'a Register>) {
        for &register in registers {
            let place = register as usize;
            if place >= self.0.len() {
                self.0.resize(place + 1, false);
            }
            self.0[place] = true;
        }
    }
}
