//! Where values stand in C that stand before a routine runs.

use std::cell::RefCell;

use halfarrow_compiler::program::{Op, Program, Reads, Value};
use rustc_hash::FxHashMap;

use super::write::{Moving, TimeRate};
use super::written::{Written, written};
use crate::Real;

/// The places of givens: parameters, what follows from them, time, inputs, held signals, conserved constants, states,
/// positions at the start.
#[derive(Debug, Clone)]
pub(super) struct Givens<'a> {
    program: &'a Program,
    real: Real,
    /// The place in `m->c` of each that is computed from parameters.
    derived: FxHashMap<Value, usize>,
    /// The place in `m->positions` of each that is given at the start.
    positions: FxHashMap<Value, usize>,
    /// The place of each of them that is read in double precision.
    exact: RefCell<FxHashMap<Value, usize>>,
}

impl<'a> Givens<'a> {
    pub fn new(program: &'a Program, real: Real) -> Givens<'a> {
        let determined = program.determined(&[]);
        let computed = determined.iter().filter(|v| !program.values.op(**v).is_given());
        let derived = computed.enumerate().map(|(place, &v)| (v, place)).collect();
        let positions = program.positions.iter().enumerate().map(|(k, p)| (p.value, k)).collect();
        Givens { program, real, derived, positions, exact: RefCell::default() }
    }

    /// How many values are computed from parameters.
    pub fn derived(&self) -> usize {
        self.derived.len()
    }

    /// How many of them are read in double precision, as far as is written.
    pub fn exact(&self) -> usize {
        self.exact.borrow().len()
    }

    /// Whether something in double precision reads it.
    pub fn is_exact(&self, value: Value) -> bool {
        matches!(self.program.values.op(value), Op::Parameter(_)) || self.exact.borrow().contains_key(&value)
    }

    /// Whether it follows from time and parameters alone.
    pub fn is_timely(&self, value: Value) -> bool {
        self.is_time(value) || self.program.values.reads(value) == Reads::PARAMETERS
    }

    /// Whether it is time.
    pub fn is_time(&self, value: Value) -> bool {
        self.program.values.op(value) == Op::Time
    }

    /// A value in C.
    pub fn written(&self, value: Value) -> Written {
        match self.program.values.op(value) {
            Op::Constant(bits) => Written::of(self.real.number(bits.number())),
            Op::Parameter(i) => written!("m->p[{}]", i),
            Op::Time => Written::of("t"),
            Op::Input(i) => written!("m->u[{}]", i),
            Op::Held(i) => written!("m->z[{}]", i),
            Op::Conserved(i) => written!("m->k[{}]", i),
            Op::State(i) => written!("x[{}]", i),
            Op::Solution(..) if self.positions.contains_key(&value) => {
                written!("m->positions[{}]", self.positions[&value])
            }
            _ => written!("m->c[{}]", self.derived[&value]),
        }
    }

    /// A value in C, in double precision.
    pub fn wide_written(&self, value: Value) -> Written {
        match self.program.values.op(value) {
            _ if self.real == Real::Double => self.written(value),
            Op::Constant(bits) => Written::of(Real::Double.number(bits.number())),
            Op::Time => self.written(value),
            Op::Parameter(i) => written!("m->p_exact[{}]", i),
            _ if self.derived.contains_key(&value) => {
                let mut exact = self.exact.borrow_mut();
                let next = exact.len();
                written!("m->c_exact[{}]", *exact.entry(value).or_insert(next))
            }
            _ => written!("({}){}", Real::Double.kind(), self.written(value)),
        }
    }

    /// Its place in directions of derivatives; none if it is of parameters alone.
    pub fn direction(&self, value: Value) -> Option<usize> {
        let [_, held, conserved, states, positions, _] = self.directions();
        match self.program.values.op(value) {
            Op::Time => Some(0),
            Op::Input(i) => Some(1 + i as usize),
            Op::Held(i) => Some(held + i as usize),
            Op::Conserved(i) => Some(conserved + i as usize),
            Op::State(i) => Some(states + i as usize),
            _ => self.positions.get(&value).map(|k| positions + k),
        }
    }

    /// First places of inputs, held signals, conserved constants, states and positions in directions, and their number of
    /// places.
    pub fn directions(&self) -> [usize; 6] {
        let p = self.program;
        let held = 1 + p.inputs.len();
        let conserved = held + p.held.len();
        let states = conserved + p.conserved.len();
        let positions = states + p.states.len();
        [1, held, conserved, states, positions, positions + p.positions.len()]
    }

    /// Its derivative in C, if it moves.
    pub fn rate(&self, value: Value, moving: Moving) -> Option<Written> {
        let place = self.direction(value)?;
        let moves = match self.program.values.op(value) {
            Op::Time if moving.time == Some(TimeRate::One) => return Some(Written::of(self.real.number(1.0))),
            Op::Time => moving.time.is_some(),
            Op::Input(_) => moving.inputs,
            Op::Held(_) => moving.held,
            Op::Conserved(_) => moving.conserved,
            _ => moving.states,
        };
        moves.then(|| written!("e[{}]", place))
    }
}
