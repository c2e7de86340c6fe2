//! Exact derivatives of values by givens, as values of a program: sparse, with solve blocks by the implicit function
//! theorem.

use super::op::Op;
use super::values::{Reads, Values};
use super::{Block, BlockId, Matrix, Program, Value, verify};
use crate::ids::{Id, Table};
use rustc_hash::FxHashMap;
use std::rc::Rc;
use std::sync::Arc;

/// A derivative that is not zero whatever the values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct JacobianEntry {
    /// What is differentiated: index into the wanted values.
    pub row: u32,
    /// By what: index into the givens.
    pub column: u32,
    /// The derivative, a value of [`Differentiated::program`].
    pub value: Value,
}

/// A program with the derivatives of some of its values.
#[derive(Debug, Clone)]
pub struct Differentiated {
    /// The program with more values, and more blocks that share the factors of the others; ids of the first one keep their
    /// meaning. What of them reads parameters alone is [`determined`](Program::determined) together with the values of the entries.
    pub program: Program,
    /// The derivatives that may be nonzero, by row, in a row by column.
    pub entries: Vec<JacobianEntry>,
}

impl Program {
    /// Derivatives of the rates (of an implicit form: rates and residuals) by the states.
    ///
    /// ```
    /// # use halfarrow_compiler::{bond_graph::NoFiles, compile::{Text, compile}, equations::Form};
    /// let text = Text { name: "m", text: "model M\nI:m(2) -> 1:v\n", files: &NoFiles, overrides: &[] };
    /// # let text = Text { name: "m", text: "model M\n1:v -> I:m(2)\nv -> R:b(f^2)\n", files: &NoFiles, overrides: &[] };
    /// let program = compile(text, Form::Minimal).unwrap().ir;
    /// let jacobian = program.jacobian();
    /// assert_eq!((jacobian.entries[0].row, jacobian.entries[0].column), (0, 0));
    /// ```
    pub fn jacobian(&self) -> Differentiated {
        let rates: Vec<Value> = self.states.iter().map(|s| s.rate).collect();
        let states: Vec<Op> = (0..self.states.len() as u32).map(Op::State).collect();
        self.differentiate(&rates, &states)
    }

    /// Derivatives of wanted values by givens: states, inputs, held signals, time, rates, parameters, conserved
    /// constants ([`Op::is_given`]). All other givens rest; a parameter given by others does not follow them. Conditions
    /// rest too, as they do in [`Values`] that read them.
    pub fn differentiate(&self, wanted: &[Value], givens: &[Op]) -> Differentiated {
        let mut work = Differentiation {
            values: self.values.clone(),
            blocks: self.blocks.clone(),
            gradients: FxHashMap::default(),
            of_blocks: FxHashMap::default(),
        };
        let one = work.values.number(1.0);
        for (column, &op) in givens.iter().enumerate() {
            if let Some(value) = self.values.find(op) {
                work.gradients.insert(value, Rc::from([(column as u32, one)]));
            }
        }
        let live = self.dataflow().live(wanted, true);
        for (value, op) in self.values.iter() {
            if live[value.index()] && !self.values.reads(value).includes(Reads::GUESS) && !op.is_given() {
                work.differentiate(value, op);
            }
        }
        let mut entries = Vec::new();
        for (row, value) in wanted.iter().enumerate() {
            let gradients = work.gradients.get(value).into_iter().flat_map(|s| s.iter());
            entries.extend(gradients.map(|&(column, value)| JacobianEntry { row: row as u32, column, value }));
        }
        work.values.settle();
        let program = Program { values: work.values, blocks: work.blocks, ..self.clone() };
        debug_assert_eq!(verify(&program), Ok(()), "{}", self.name);
        Differentiated { program, entries }
    }
}

/// Derivatives by column, columns ascending.
type SparseGradient = Rc<[(u32, Value)]>;

struct Differentiation {
    values: Values,
    blocks: Table<BlockId, Block>,
    /// Of values that move.
    gradients: FxHashMap<Value, SparseGradient>,
    /// Of the unknowns of blocks.
    of_blocks: FxHashMap<BlockId, Vec<SparseGradient>>,
}

impl Differentiation {
    fn differentiate(&mut self, value: Value, op: Op) {
        let gradients = match op {
            Op::Solution(block, unknown) => {
                if !self.of_blocks.contains_key(&block) {
                    let gradients = self.of_block(block);
                    self.of_blocks.insert(block, gradients);
                }
                Rc::clone(&self.of_blocks[&block][unknown as usize])
            }
            _ => self.of_operation(value, &FxHashMap::default()),
        };
        if !gradients.is_empty() {
            self.gradients.insert(value, gradients);
        }
    }

    /// SparseGradient of an operation from those of its operands; `inner` goes before the others.
    fn of_operation(&mut self, value: Value, inner: &FxHashMap<Value, SparseGradient>) -> SparseGradient {
        let mut operands: Vec<(Value, SparseGradient)> = Vec::with_capacity(3);
        self.values.op(value).for_each_operand(|v| {
            if let Some(gradients) = inner.get(&v).or_else(|| self.gradients.get(&v)) {
                operands.push((v, Rc::clone(gradients)));
            }
        });
        let columns = columns_of(operands.iter().map(|(_, s)| s));
        let mut gradients = Vec::with_capacity(columns.len());
        for column in columns {
            let of = |v: Value| operands.iter().find(|(o, _)| *o == v).and_then(|(_, s)| at(s, column));
            if let Some(slope) = self.values.derivative(value, &of) {
                gradients.push((column, slope));
            }
        }
        gradients.into()
    }

    fn of_block(&mut self, block: BlockId) -> Vec<SparseGradient> {
        let (matrix, right, shared) = match self.blocks[block].clone() {
            Block::Linear { matrix, right, shared, .. } => {
                let unknowns: Vec<Value> = (0..right.len()).map(|i| self.solution(block, i)).collect();
                let right = self.right_of_linear(&matrix, &right, &unknowns);
                (matrix, right, shared.or(unknowns.first().copied()))
            }
            Block::Newton { residuals, jacobian, .. } => {
                let (matrix, right) = self.right_of_newton(block, &residuals, &jacobian);
                (Arc::new(matrix), right, None)
            }
        };
        self.solved(block, &matrix, &right, shared)
    }

    /// An unknown of a block; all of them are read by what reads one.
    fn solution(&mut self, block: BlockId, unknown: usize) -> Value {
        let reads = self.blocks[block].reads().fold(Reads::PARAMETERS, |all, v| all.with(self.values.reads(v)));
        self.values.add(Op::Solution(block, unknown as u32), reads.without(Reads::GUESS))
    }

    /// `A u = b` gives `A u' = b' - A' u`: the right-hand side for each column, one slope list a row.
    fn right_of_linear(&mut self, matrix: &Matrix, right: &[Value], unknowns: &[Value]) -> Vec<SparseGradient> {
        let mut rows = Vec::with_capacity(right.len());
        for (row, b) in matrix.values.rows().zip(right) {
            let mut sum: Vec<(u32, Value)> = self.gradients.get(b).map(|s| s.to_vec()).unwrap_or_default();
            for (k, entry) in row {
                let Some(gradients) = self.gradients.get(entry).cloned() else { continue };
                for &(column, slope) in gradients.iter() {
                    let term = self.values.times(slope, unknowns[k]);
                    self.subtract(&mut sum, column, term);
                }
            }
            rows.push(sum.into());
        }
        rows
    }

    /// `F(u, x) = 0` gives `(∂F/∂u) u' = -(∂F/∂x) x'`, at the solution: the matrix, and the right-hand side.
    fn right_of_newton(
        &mut self,
        block: BlockId,
        residuals: &[Value],
        jacobian: &Matrix,
    ) -> (Matrix, Vec<SparseGradient>) {
        let n = residuals.len();
        let mut there: FxHashMap<Value, Value> = FxHashMap::default();
        for unknown in 0..n {
            let solution = self.solution(block, unknown);
            if let Some(guess) = self.values.find(Op::Guess(block, unknown as u32)) {
                there.insert(guess, solution);
            }
        }
        let matrix = jacobian.map(|&v| self.at_solution(v, &mut there));
        let mut inner: FxHashMap<Value, SparseGradient> = FxHashMap::default();
        there.values().for_each(|&v| {
            inner.insert(v, Rc::from([]));
        });
        let mut rows = Vec::with_capacity(n);
        for &residual in residuals {
            for v in self.inside(residual) {
                let moved = self.at_solution(v, &mut there);
                if !inner.contains_key(&moved) || !matches!(self.values.op(v), Op::Guess(..)) {
                    let gradients = self.of_operation(moved, &inner);
                    inner.insert(moved, gradients);
                }
            }
            let moved = self.at_solution(residual, &mut there);
            let gradients = inner.get(&moved).or_else(|| self.gradients.get(&moved)).cloned();
            let minus =
                gradients.iter().flat_map(|s| s.iter()).map(|&(column, v)| (column, self.values.neg(v))).collect();
            rows.push(minus);
        }
        (matrix, rows)
    }

    /// What a value reads that reads guesses, itself included, in order.
    fn inside(&self, value: Value) -> Vec<Value> {
        let mut seen = rustc_hash::FxHashSet::default();
        let mut open = vec![value];
        while let Some(v) = open.pop() {
            if self.values.reads(v).includes(Reads::GUESS) && seen.insert(v) {
                self.values.op(v).for_each_operand(|v| open.push(v));
            }
        }
        let mut found: Vec<Value> = seen.into_iter().collect();
        found.sort_unstable();
        found
    }

    /// A value with the solution in the place of the guess.
    fn at_solution(&mut self, value: Value, there: &mut FxHashMap<Value, Value>) -> Value {
        for v in self.inside(value) {
            if !there.contains_key(&v) {
                let op = self.values.op(v).map_operands(|v| there.get(&v).copied().unwrap_or(v));
                let moved = self.values.op_of(op);
                there.insert(v, moved);
            }
        }
        there.get(&value).copied().unwrap_or(value)
    }

    fn subtract(&mut self, sum: &mut Vec<(u32, Value)>, column: u32, term: Value) {
        match sum.binary_search_by_key(&column, |(c, _)| *c) {
            Ok(place) => sum[place].1 = self.values.minus(sum[place].1, term),
            Err(place) => {
                let minus = self.values.neg(term);
                sum.insert(place, (column, minus));
            }
        }
    }

    /// Solves for the gradients of all unknowns, column by column, with one factorisation.
    fn solved(
        &mut self,
        block: BlockId,
        matrix: &Arc<Matrix>,
        right: &[SparseGradient],
        shared: Option<Value>,
    ) -> Vec<SparseGradient> {
        let elements = self.blocks[block].elements().to_string();
        let zero = self.values.number(0.0);
        let mut gradients: Vec<Vec<(u32, Value)>> = vec![Vec::new(); right.len()];
        let mut shared = shared;
        for column in columns_of(right.iter()) {
            let right = right.iter().map(|s| at(s, column).unwrap_or(zero)).collect();
            let (matrix, elements) = (Arc::clone(matrix), elements.clone());
            let solving = self.blocks.push(Block::Linear { matrix, right, shared, elements });
            for (unknown, gradients) in gradients.iter_mut().enumerate() {
                gradients.push((column, self.solution(solving, unknown)));
            }
            shared = shared.or_else(|| Some(self.solution(solving, 0)));
        }
        gradients.into_iter().map(Rc::from).collect()
    }
}

fn at(gradients: &SparseGradient, column: u32) -> Option<Value> {
    let place = gradients.binary_search_by_key(&column, |(c, _)| *c).ok()?;
    Some(gradients[place].1)
}

fn columns_of<'a>(gradients: impl Iterator<Item = &'a SparseGradient>) -> Vec<u32> {
    let mut columns: Vec<u32> = gradients.flat_map(|s| s.iter().map(|(column, _)| *column)).collect();
    columns.sort_unstable();
    columns.dedup();
    columns
}
