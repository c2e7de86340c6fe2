//! Where values stand: places of arrays, one after the other where a loop goes along them.

use std::fmt::{self, Display};

use super::Body;
use crate::Real;
use crate::c::written::{Part, Variable, Written, written};

/// Numbers on a line of a table.
const ON_A_LINE: usize = 12;

/// A place of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::c) struct Place {
    pub array: &'static str,
    pub index: usize,
}

impl Place {
    /// The first places of an array.
    pub fn first(array: &'static str, n: usize) -> Vec<Place> {
        (0..n).map(|index| Place { array, index }).collect()
    }
}

impl Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}[{}]", self.array, self.index)
    }
}

impl Part for Place {}

/// Where a value is found.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::c) enum Spot {
    Number(f64),
    Place(Place),
    /// A variable, or something else that is read as it is.
    Written(Written),
}

impl Spot {
    /// It in C, numbers in this precision.
    pub fn written(self, real: Real) -> Written {
        match self {
            Spot::Number(value) => Written::of(real.number(value)),
            Spot::Place(place) => written!("{}", place),
            Spot::Written(written) => written,
        }
    }
}

/// Tables that the loops of a function read.
#[derive(Debug, Default)]
pub(super) struct Tables {
    indices: Vec<Vec<usize>>,
    numbers: Vec<(Vec<u64>, Real)>,
    /// Declarations that are still to be written.
    pub declared: Vec<Written>,
}

impl Tables {
    /// An index that depends on the turn: by a rule, or by a table, which does for all that differ from it by a constant.
    pub fn index(&mut self, all: &[usize]) -> Written {
        let step = all[1] as i64 - all[0] as i64;
        if all.windows(2).all(|pair| pair[1] as i64 - pair[0] as i64 == step) {
            return ruled(all[0], step);
        }
        let shift = |known: &[usize]| all[0] as i64 - known[0] as i64;
        let fits = |known: &Vec<usize>| {
            known.len() == all.len() && known.iter().zip(all).all(|(k, a)| *a as i64 - *k as i64 == shift(known))
        };
        let table = self.indices.iter().position(fits).unwrap_or_else(|| {
            self.declare(&format!("int at{}", self.indices.len()), all.iter().map(usize::to_string));
            self.indices.push(all.to_vec());
            self.indices.len() - 1
        });
        match shift(&self.indices[table]) {
            0 => written!("at{}[{}]", table, Variable::Turn),
            more if more > 0 => written!("at{}[{}] + {}", table, Variable::Turn, more as usize),
            less => written!("at{}[{}] - {}", table, Variable::Turn, less.unsigned_abs() as usize),
        }
    }

    /// A number that depends on the turn.
    pub fn number(&mut self, all: &[f64], real: Real) -> Written {
        let bits: Vec<u64> = all.iter().map(|v| v.to_bits()).collect();
        if bits.iter().all(|b| *b == bits[0]) {
            return Written::of(real.number(all[0]));
        }
        let known = self.numbers.iter().position(|(known, size)| *known == bits && *size == real);
        let table = known.unwrap_or_else(|| {
            let name = format!("{} n{}", real.kind(), self.numbers.len());
            self.declare(&name, all.iter().map(|&v| real.number(v)));
            self.numbers.push((bits, real));
            self.numbers.len() - 1
        });
        written!("n{}[{}]", table, Variable::Turn)
    }

    fn declare(&mut self, name: &str, values: impl Iterator<Item = String>) {
        let values: Vec<String> = values.collect();
        let lines: Vec<String> = values.chunks(ON_A_LINE).map(|line| format!("        {}", line.join(", "))).collect();
        let text = format!("    static const {name}[] = {{\n{}\n    }};", lines.join(",\n"));
        self.declared.push(Written::of(text));
    }
}

/// An index that grows by a step with each turn.
fn ruled(first: usize, step: i64) -> Written {
    let turn = Variable::Turn;
    match (first, step) {
        (first, 0) => written!("{}", first),
        (0, 1) => written!("{}", turn),
        (first, 1) => written!("{} + {}", turn, first),
        (0, step) => written!("{} * {}", step as usize, turn),
        (first, -1) => written!("{} - {}", first, turn),
        (first, step) if step < 0 => written!("{} - {} * {}", first, step.unsigned_abs() as usize, turn),
        (first, step) => written!("{} * {} + {}", step as usize, turn, first),
    }
}

/// An index of the present turn where it is the first one.
pub(super) fn along(f: &Body, first: usize) -> Written {
    ruled(first, i64::from(f.turning.is_some()))
}
