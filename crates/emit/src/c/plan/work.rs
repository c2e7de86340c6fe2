//! What a step costs, and the columns of its matrix.

use halfarrow_compiler::program::{BlockId, EventTrigger};

use super::Plan;
use crate::Method;
use crate::c::cost::{Cost, OperationCount};

impl Plan<'_> {
    /// Rows of the nonzeros of each column of the Jacobian.
    pub(in crate::c) fn columns(&self) -> Vec<Vec<usize>> {
        let mut columns = vec![Vec::new(); self.program.states.len()];
        for (row, reads) in self.program.dependence.iter().enumerate() {
            reads.iter().for_each(|&column| columns[column as usize].push(row));
        }
        columns
    }

    /// Columns in groups, no two of a group with a nonzero in the same row; as `halfarrow_sim::Sparsity::groups`.
    pub(super) fn column_groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut taken: Vec<Vec<bool>> = Vec::new();
        for (column, rows) in self.columns().iter().enumerate() {
            let free = taken.iter().position(|taken| rows.iter().all(|&row| !taken[row]));
            let group = free.unwrap_or_else(|| {
                groups.push(Vec::new());
                taken.push(vec![false; self.program.states.len()]);
                groups.len() - 1
            });
            groups[group].push(column);
            rows.iter().for_each(|&row| taken[group][row] = true);
        }
        groups
    }

    /// Operations to factor the matrix of an implicit step and to solve with it so many times.
    fn step_elimination(&self, solutions: u64) -> u64 {
        let n = self.program.states.len() as u64;
        let full = n * n * n + (4 + 2 * solutions) * n * n;
        self.step_order.as_ref().map_or(full, |order| order.operations(solutions.max(1)))
    }

    /// What a step costs at most.
    pub(in crate::c) fn cost(&self) -> Cost {
        let w = &self.works;
        let method = self.export.method;
        let n = self.program.states.len() as u64;
        let mut step = match method {
            Method::ImplicitMidpoint => {
                let groups = self.column_groups().len() as u64;
                let mut one = w.rates.clone() + w.directional.clone() * groups;
                one.operations += self.step_elimination(0);
                one * 20
            }
            Method::LinearlyImplicitEuler | Method::Rosenbrock => {
                let (groups, stages) = (self.column_groups().len() as u64, method.stages() as u64);
                let mut all = w.rates.clone() * stages + w.directional.clone() * (groups + 1);
                all.operations += self.step_elimination(stages) + stages * (2 * stages + 4) * n;
                all
            }
            // At the beginning, and where an event changes all of the Jacobian.
            Method::LinearlyImplicitBdf2 => {
                let nonzeros = self.columns().iter().map(|rows| rows.len() as u64).sum::<u64>();
                let parts = self.column_groups().len() as u64 + 2;
                let mut all = match self.compares_rates() {
                    true => w.rates.clone() * (parts + 2 + u64::from(self.beside.is_some())),
                    false => w.rates.clone() * 2 + w.directional.clone() * parts,
                };
                all.operations += 2 * self.step_elimination(3) + 8 * nonzeros + 60 * n;
                all
            }
            _ => {
                let stages = method.stages() as u64;
                let mut all = w.rates.clone() * stages;
                all.operations += stages * (stages + 3) * n;
                all
            }
        };
        step = step + w.switching.clone() + w.observe.clone() + w.ahead.clone() + w.watched.clone();
        let follows = |blocks: &[BlockId], work: &OperationCount| {
            if blocks.is_empty() { OperationCount::default() } else { work.clone() }
        };
        let followed = follows(&self.rates_blocks, &w.solutions) + follows(&self.shown_blocks, &w.observe);
        let sources = if self.delays.is_empty() {
            OperationCount::default()
        } else {
            w.rates.clone() + w.sources.clone().along()
        };
        let tried = if self.motion_of_rates > 0 { w.solutions.clone() } else { OperationCount::default() };
        step = step + tried + followed.clone() + sources.clone() + self.putting_back();
        let held = (self.delays.len() + self.samples.len()) as u64;
        let curves =
            self.clocks.iter().filter(|&&c| self.program.conditions[c].trigger == EventTrigger::CurvedTime).count()
                as u64;
        let looks = 2 + curves * (2 * 4000 + 4 * 2200);
        let clock = if self.clocks.is_empty() { OperationCount::default() } else { w.clock.clone() * looks };
        let sampled = (w.rates.clone() + w.sources.clone().along()) * if held > 0 { held.max(1) } else { 0 };
        let returns = match self.events.returning.is_empty() {
            true => OperationCount::default(),
            false => w.rates.clone() + w.returns.clone(),
        };
        step = step + w.returns.clone();
        let mut jump = clock + sampled + w.switching.clone() * 2 + sources + followed + returns;
        if self.program.jumps.as_ref().is_some_and(|jumps| jumps.leaps) {
            jump = jump + w.round.clone() * 3 + w.switching.clone();
        }
        // A round takes the sides of conditions anew, where storages share out what they keep before and behind that too.
        let round = if self.program.clauses.is_empty() {
            OperationCount::default()
        } else {
            w.round.clone() + w.switching.clone() * if self.program.jumps.is_some() { 3 } else { 1 }
        };
        Cost::new(step, jump, round, self)
    }
}
