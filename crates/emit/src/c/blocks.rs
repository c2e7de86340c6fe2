//! Solve blocks in C: small symmetric ones written out, others by `lu.c`, nonlinear ones by `newton/`.

use halfarrow_compiler::program::elimination::{Definite, is_written_out};
use halfarrow_compiler::program::{Block, BlockId, Method, Program, Reads, Solve};
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;

use super::derivatives::Expressions;
use super::patterns::FULL_AT_MOST;
use super::write::{Body, Reading, Writer};
use super::written::{Series, Variable, Written, needed, written};
use crate::Real;

/// Numbers that `lu.c` takes for a matrix: twice the full matrix, scales of rows, work, what is left, and in single
/// precision the magnitudes of columns. For a sparse one its entries and factors, weights, inverse pivots and a row, and
/// a full matrix where it may be treated as one.
pub(super) fn elimination_room(block: &Block, real: Real) -> usize {
    let n = block.size();
    let lines = if real == Real::Double { 3 * n } else { 4 * n };
    let full = full_room(block);
    match &block.matrix().factors {
        None => full + lines,
        Some(f) => f.matrix.len() + f.lower.len() + f.upper.len() + 3 * n + lines + full,
    }
}

/// Numbers of two full matrices; none for large sparse blocks.
pub(super) fn full_room(block: &Block) -> usize {
    let n = block.size();
    if block.matrix().factors.is_none() || n <= FULL_AT_MOST { 2 * n * n } else { 0 }
}

/// Where linear blocks with a constant matrix keep their factors, and those whose factors serve others.
#[derive(Debug, Clone, Default)]
pub(super) struct Factored {
    /// Number, first place and first place of the order of each such block.
    pub places: FxHashMap<u32, (usize, usize, usize)>,
    /// First place and first place of the order of each block whose matrix varies and is that of others too.
    pub lent: FxHashMap<u32, (usize, usize)>,
    /// Numbers taken in all.
    pub size: usize,
    /// Places of orders taken in all.
    pub orders: usize,
}

impl Factored {
    /// Those of a program.
    pub fn of(program: &Program, real: Real) -> Factored {
        let mut factored = Factored::default();
        for (id, block) in program.blocks.iter() {
            let Block::Linear { matrix, .. } = block else { continue };
            let n = block.size();
            if n > 1 && matrix.values.entries().iter().all(|&v| program.values.reads(v) == Reads::PARAMETERS) {
                let number = factored.places.len();
                factored.places.insert(id.0, (number, factored.size, factored.orders));
                factored.take_room(block, real);
            }
        }
        let lenders = program.blocks.ids().filter_map(|id| program.factors_of(id));
        let lenders: BTreeSet<BlockId> = lenders.filter(|id| !factored.places.contains_key(&id.0)).collect();
        for id in lenders.into_iter().filter(|id| program.blocks[*id].size() > 1) {
            factored.lent.insert(id.0, (factored.size, factored.orders));
            factored.take_room(&program.blocks[id], real);
        }
        factored
    }

    fn take_room(&mut self, block: &Block, real: Real) {
        self.size += elimination_room(block, real);
        self.orders += block.size() + usize::from(block.matrix().factors.is_some());
    }
}

impl Writer<'_> {
    pub fn linear(&self, f: &mut Body, solve: &Solve, reads: &Reading, number: usize) {
        let a = &reads.values[..];
        let n = solve.unknowns.len();
        let moves = solve.unknowns.iter().any(|out| f.moves[out.0 as usize]);
        if n == 1 {
            return self.quotient(f, solve, reads, moves);
        }
        if !moves && self.is_written_out(solve) {
            self.definite(f, solve, a, number);
            return self.solved(f, solve, number);
        }
        let (pattern, entries) = self.patterns.of_block(self.program, solve.block);
        let (factors, solution) = self.eliminated(f, solve, a, number, &pattern);
        if moves {
            let (matrix, right) = reads.rates.split_at(entries);
            let (matrix, right) = (self.rates(f, "da", number, matrix), self.rates(f, "db", number, right));
            let rates = self.room(f, "ds", number, n);
            let function = needed("ha_linear_rate");
            f.line(
                written!("    {}({}, {}, {}, {}, {}, {});", function, factors, pattern, matrix, right, solution, rates),
                0,
            );
        }
        self.solved(f, solve, number);
    }

    /// Several equations, solved: where their factors stand, and the solution.
    fn eliminated(
        &self,
        f: &mut Body,
        solve: &Solve,
        a: &[Written],
        number: usize,
        pattern: &Written,
    ) -> (String, Variable) {
        let (matrix, right) = a.split_at(a.len() - solve.unknowns.len());
        let Factored { places, lent, .. } = &self.factored;
        let at = |place: &usize, order: &usize| format!("m->factors + {place}, m->factors_order + {order}");
        let lender = if let Method::Linear { shared, .. } = &solve.method { *shared } else { None };
        let (constant, borrowed) = (places.get(&solve.block.0), lender.and_then(|lender| lent.get(&lender.0)));
        if let (None, Some((place, order))) = (constant, borrowed) {
            let (factors, right) = (at(place, order), self.array(f, "b", number, right));
            let solution = self.room(f, "s", number, solve.unknowns.len());
            let function = needed("ha_linear_borrowed");
            f.line(written!("    {}({}, {}, {}, {});", function, factors, pattern, right, solution), 0);
            return (factors, solution);
        }
        let (matrix, right) = (self.array(f, "a", number, matrix), self.array(f, "b", number, right));
        let solution = self.room(f, "s", number, solve.unknowns.len());
        let (call, factors) = match constant {
            Some((which, place, order)) => {
                let function = needed("ha_linear_constant");
                let call = written!("{}(m, {}, {}, {}, {}, {}", function, which, place, order, pattern, matrix);
                (call, at(place, order))
            }
            None => {
                let lends = lent.get(&solve.block.0);
                let factors = lends.map_or("m->work, m->order".to_string(), |(place, order)| at(place, order));
                (written!("{}({}, {}, {}", needed("ha_linear"), factors, pattern, matrix), factors)
            }
        };
        let unsolved = written!("!{}, {}, {})", call, right, solution);
        f.lines.push(self.fail_if(&unsolved, "SINGULAR", &solve.block.0, f.shape.time));
        (factors, solution)
    }

    /// Whether equations are written out where nothing moves: symmetric ones that are not too many.
    pub fn is_written_out(&self, solve: &Solve) -> bool {
        let block = &self.program.blocks[solve.block];
        let varies = !self.factored.places.contains_key(&solve.block.0);
        let linear = matches!(solve.method, Method::Linear { .. });
        let whole = block.matrix().factors.is_none() && solve.unknowns.len() > 1;
        linear && varies && whole && block.is_symmetric() && is_written_out(&solve.pattern)
    }

    /// One equation.
    fn quotient(&self, f: &mut Body, solve: &Solve, reads: &Reading, moves: bool) {
        let (a, d) = (&reads.values[..], &reads.rates[..]);
        let vanishes = written!("!{}({})", needed("ha_is_pivot"), a[0]);
        f.lines.push(self.fail_if(&vanishes, "SINGULAR", &reads.which, f.shape.time));
        let out = solve.unknowns[0].0;
        if !f.read[out as usize] {
            return;
        }
        let rate = moves.then(|| {
            let right = d[1].clone().unwrap_or_else(|| Written::of(self.real.number(0.0)));
            match &d[0] {
                Some(da) => written!("({} - {} * {}) / {}", right, da, Variable::Number(Series::Value(out)), a[0]),
                None => written!("{} / {}", right, a[0]),
            }
        });
        self.put(f, out, &written!("{} / {}", a[1], a[0]), rate.as_ref());
    }

    pub fn newton(&self, f: &mut Body, solve: &Solve, reads: &Reading, number: usize) {
        let outer = self.array(f, "o", number, &reads.values);
        let solution = self.room(f, "s", number, solve.unknowns.len());
        let which = self.newton.binary_search(&solve.block).expect("all blocks in use are known");
        let call = match solve.unknowns.iter().any(|out| f.moves[out.0 as usize]) {
            true => {
                let rates = self.rates(f, "e", number, &reads.rates);
                let moved = self.room(f, "ds", number, solve.unknowns.len());
                let function = needed("ha_root_along");
                written!("{}(m, {}, {}, {}, {}, {})", function, which, outer, rates, solution, moved)
            }
            false => written!("{}(m, {}, {}, {})", needed("ha_find_root"), which, outer, solution),
        };
        if self.program.positions.iter().any(|p| p.block == solve.block) {
            f.line(written!("    m->sought_at = {};", f.shape.time.text()), 0);
        }
        f.line(written!("    {} = {};", Variable::Status, call), 0);
        let failure = written!("{}(m, status, {}, {})", needed("ha_fail"), solve.block.0, f.shape.time.text());
        f.line(written!("    if (status != {}_OK) {{\n        return {};\n    }}", self.capitals, failure), 0);
        self.solved(f, solve, number);
    }

    /// Declares an array of values.
    fn array(&self, f: &mut Body, kind: &'static str, number: usize, values: &[Written]) -> Variable {
        let array = Variable::Array(kind, number);
        let list = match values {
            [] => Written::of(self.real.number(0.0)),
            values => Written::list(values),
        };
        let declared = written!("    const {} {}[] = {{{}}};", self.real.kind(), array, list);
        f.constant(array, declared, values.len().max(1));
        array
    }

    /// Declares an array of rates, 0 where nothing moves.
    fn rates(&self, f: &mut Body, kind: &'static str, number: usize, rates: &[Option<Written>]) -> Variable {
        let zero = || Written::of(self.real.number(0.0));
        let rates: Vec<Written> = rates.iter().map(|d| d.clone().unwrap_or_else(zero)).collect();
        self.array(f, kind, number, &rates)
    }

    /// Declares room for a solution.
    fn room(&self, f: &mut Body, kind: &'static str, number: usize, n: usize) -> Variable {
        let array = Variable::Array(kind, number);
        f.line(written!("    {} {}[{}];", self.real.kind(), array, n), n);
        array
    }

    fn solved(&self, f: &mut Body, solve: &Solve, number: usize) {
        for (i, out) in solve.unknowns.iter().enumerate() {
            if f.read[out.0 as usize] {
                let rate = f.moves[out.0 as usize].then(|| written!("{}[{}]", Variable::Array("ds", number), i));
                self.put(f, out.0, &written!("{}[{}]", Variable::Array("s", number), i), rate.as_ref());
            }
        }
    }

    /// Symmetric equations written out, as `lu.c` solves them where the matrix is definite; else it does.
    fn definite(&self, f: &mut Body, solve: &Solve, a: &[Written], number: usize) {
        let n = solve.unknowns.len();
        let (entries, right) = a.split_at(solve.pattern.len());
        let (pattern, _) = self.patterns.of_block(self.program, solve.block);
        let solution = self.room(f, "s", number, n);
        let failure = self.failure("SINGULAR", &solve.block.0, f.shape.time);
        f.line(Written::of("    {"), 0);
        let mut k = Expressions::new(&mut f.lines, Series::Elimination, self.real);
        k.indent = "        ";
        let matrix: Vec<_> = entries.iter().map(|entry| k.push(entry.clone())).collect();
        let factors = Definite::factor(&mut k, (&solve.pattern, &matrix), self.real.epsilon() * n as f64);
        let asked = std::mem::take(&mut k.asked);
        let asked = asked.into_iter().reduce(|all, one| written!("{} && {}", all, one)).expect("a pivot");
        k.line(&written!("if ({}) {{", asked), 0);
        k.indent = "            ";
        let mut unknowns: Vec<_> = right.iter().map(|b| k.push(b.clone())).collect();
        factors.solve(&mut k, &mut unknowns);
        for (i, x) in unknowns.into_iter().enumerate() {
            let x = k.written(x);
            k.line(&written!("{}[{}] = {};", solution, i, x), 0);
        }
        k.indent = "        ";
        k.line(&Written::of("} else {"), 0);
        k.indent = "            ";
        let kind = self.real.kind();
        k.line(&written!("const {} a[] = {{{}}};", kind, Written::list(entries)), entries.len());
        k.line(&written!("const {} b[] = {{{}}};", kind, Written::list(right)), n);
        k.line(&written!("if (!{}(m->work, m->order, {}, a, b, {})) {{", needed("ha_linear"), pattern, solution), 0);
        k.line(&written!("    return {};", failure), 0);
        k.line(&Written::of("}"), 0);
        k.indent = "        ";
        k.line(&Written::of("}"), 0);
        f.line(Written::of("    }"), 0);
    }
}
