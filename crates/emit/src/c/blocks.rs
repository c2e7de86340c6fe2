//! Solve blocks in C: small symmetric ones written out, others by `lu.c`, nonlinear ones by `newton/`.

use std::fmt::Write;

use halfarrow_compiler::program::elimination::Definite;
use halfarrow_compiler::program::{Block, Program, Reads, Solve};
use rustc_hash::FxHashMap;

use super::derivatives::Expressions;
use super::patterns::FULL_AT_MOST;
use super::write::{Body, Reading, Writer};
use crate::Real;

/// Symmetric linear equations of up to this many unknowns are written out.
const WRITTEN_OUT: usize = 6;

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

/// Where linear blocks with a constant matrix keep their factors.
#[derive(Debug, Clone, Default)]
pub(super) struct Factored {
    /// Number, first place and first place of the order of each such block.
    pub places: FxHashMap<u32, (usize, usize, usize)>,
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
                factored.size += elimination_room(block, real);
                factored.orders += n + usize::from(matrix.factors.is_some());
            }
        }
        factored
    }
}

impl Writer<'_> {
    pub fn linear(&self, f: &mut Body, solve: &Solve, reads: &Reading, number: usize) {
        let (a, d, block) = (&reads.values[..], &reads.rates[..], solve.block.0);
        let n = solve.unknowns.len();
        let fail = format!("        return ha_fail(m, MODEL_SINGULAR, {block}, {});\n    }}", f.shape.time);
        let moves = solve.unknowns.iter().any(|out| f.moves[out.0 as usize]);
        if n == 1 {
            let _ = writeln!(f.text, "    if (!ha_is_pivot({})) {{\n{fail}", a[0]);
            let out = solve.unknowns[0].0;
            if !f.read[out as usize] {
                return;
            }
            let rate = moves.then(|| {
                let right = d[1].clone().unwrap_or_else(|| "0.0".into());
                match &d[0] {
                    Some(da) => format!("({right} - {da} * v{out}) / {}", a[0]),
                    None => format!("{right} / {}", a[0]),
                }
            });
            return self.put(f, out, &format!("{} / {}", a[1], a[0]), rate.as_deref());
        }
        let (matrix, right) = a.split_at(solve.pattern.len());
        let (pattern, entries) = self.patterns.of_block(self.program, solve.block);
        let symmetric = self.program.blocks[solve.block].is_symmetric();
        if symmetric && n <= WRITTEN_OUT && !moves && !self.factored.places.contains_key(&block) {
            let zero = || "0.0".to_string();
            let mut full = vec![zero(); n * n];
            solve.pattern.places().zip(matrix).for_each(|((i, j), entry)| full[i * n + j] = entry.clone());
            let call = format!("!ha_linear(m, {pattern}, a, b, s{number})");
            let written = Written { number, rounding: self.real.epsilon() * n as f64, call: &call, fail: &fail };
            written.definite(&mut f.text, &full, matrix, right);
            return self.solved(f, solve, number);
        }
        let _ = writeln!(f.text, "    const double a{number}[] = {{{}}};", matrix.join(", "));
        let _ = writeln!(f.text, "    const double b{number}[] = {{{}}};", right.join(", "));
        let _ = writeln!(f.text, "    double s{number}[{n}];");
        let lu = match self.factored.places.get(&block) {
            Some((which, place, order)) => {
                let call = format!(
                    "ha_linear_constant(m, {which}, {place}, {order}, {pattern}, a{number}, b{number}, s{number})"
                );
                let _ = writeln!(f.text, "    if (!{call}) {{\n{fail}");
                format!("m->factors + {place}, m->factors_order + {order}, {pattern}")
            }
            None => {
                let _ =
                    writeln!(f.text, "    if (!ha_linear(m, {pattern}, a{number}, b{number}, s{number})) {{\n{fail}");
                format!("m->work, m->order, {pattern}")
            }
        };
        if moves {
            let zero = |d: &Option<String>| d.clone().unwrap_or_else(|| "0.0".into());
            let (matrix, right) = d.split_at(entries);
            let (matrix, right): (Vec<_>, Vec<_>) =
                (matrix.iter().map(zero).collect(), right.iter().map(zero).collect());
            let _ = writeln!(f.text, "    const double da{number}[] = {{{}}};", matrix.join(", "));
            let _ = writeln!(f.text, "    const double db{number}[] = {{{}}};", right.join(", "));
            let _ = writeln!(f.text, "    double ds{number}[{n}];");
            let _ = writeln!(f.text, "    ha_linear_rate({lu}, da{number}, db{number}, s{number}, ds{number});");
        }
        self.solved(f, solve, number);
    }

    pub fn newton(&self, f: &mut Body, solve: &Solve, reads: &Reading, number: usize) {
        let (a, d, block) = (&reads.values[..], &reads.rates[..], solve.block.0);
        let n = solve.unknowns.len();
        let list = |values: Vec<String>| if values.is_empty() { "0.0".to_string() } else { values.join(", ") };
        let _ = writeln!(f.text, "    const double o{number}[] = {{{}}};", list(a.to_vec()));
        let _ = writeln!(f.text, "    double s{number}[{n}];");
        let which = self.newton.binary_search(&solve.block).expect("all blocks in use are known");
        if solve.unknowns.iter().any(|out| f.moves[out.0 as usize]) {
            let rates = d.iter().map(|d| d.clone().unwrap_or_else(|| "0.0".into())).collect();
            let _ = writeln!(f.text, "    const double e{number}[] = {{{}}};", list(rates));
            let _ = writeln!(f.text, "    double ds{number}[{n}];");
            let _ = writeln!(
                f.text,
                "    status = ha_root_along(m, {which}, o{number}, e{number}, s{number}, ds{number});"
            );
        } else {
            let _ = writeln!(f.text, "    status = ha_find_root(m, {which}, o{number}, s{number});");
        }
        let _ = writeln!(
            f.text,
            "    if (status != MODEL_OK) {{\n        return ha_fail(m, status, {block}, {});\n    }}",
            f.shape.time
        );
        self.solved(f, solve, number);
    }

    fn solved(&self, f: &mut Body, solve: &Solve, number: usize) {
        for (i, out) in solve.unknowns.iter().enumerate() {
            if f.read[out.0 as usize] {
                let rate = f.moves[out.0 as usize].then(|| format!("ds{number}[{i}]"));
                self.put(f, out.0, &format!("s{number}[{i}]"), rate.as_deref());
            }
        }
    }
}

/// Symmetric linear equations that are written out; the solution stands in `s<number>`.
struct Written<'a> {
    number: usize,
    /// Pivots below this fraction of the entry that they come from are rounding.
    rounding: f64,
    /// The call for matrices that are not definite, with their entries in `a` and right side in `b`, and what is done
    /// where it fails.
    call: &'a str,
    fail: &'a str,
}

impl Written<'_> {
    /// As `lu.c` does where the matrix, given row by row and by its entries, is definite; else by it.
    fn definite(&self, text: &mut String, full: &[String], entries: &[String], right: &[String]) {
        let (n, number) = (right.len(), self.number);
        let _ = writeln!(text, "    double s{number}[{n}];\n    {{");
        let mut k = Expressions::new(text, "e".into(), false);
        k.indent = "        ";
        let matrix: Vec<_> = full.iter().map(|entry| k.whole(entry)).collect();
        let factors = Definite::factor(&mut k, &matrix, n, self.rounding);
        let asked = std::mem::take(&mut k.asked).join(" && ");
        k.line(&format!("if ({asked}) {{"));
        k.indent = "            ";
        let mut solution: Vec<_> = right.iter().map(|b| k.whole(b)).collect();
        factors.solve(&mut k, &mut solution);
        for (i, x) in solution.into_iter().enumerate() {
            let x = k.text(x);
            k.line(&format!("s{number}[{i}] = {x};"));
        }
        k.indent = "        ";
        k.line("} else {");
        k.line(&format!("    const double a[] = {{{}}};", entries.join(", ")));
        k.line(&format!("    const double b[] = {{{}}};", right.join(", ")));
        k.line(&format!("    if ({}) {{", self.call));
        self.fail.lines().for_each(|l| k.line(l));
        k.line("}");
        text.push_str("    }\n");
    }
}
