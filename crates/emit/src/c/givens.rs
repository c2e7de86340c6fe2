//! Where values stand in C that stand before a routine runs.

use std::cell::RefCell;

use halfarrow_compiler::program::{Op, Program, Reads, Value};
use rustc_hash::FxHashMap;

use super::write::{Moving, TimeRate};
use super::write::{Place, Spot};
use super::written::Written;
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
    /// The place of each that was found before; only while code is written that begins with them.
    pub found: FxHashMap<Value, Place>,
    /// The place of each of them that is read in double precision.
    exact: RefCell<FxHashMap<Value, usize>>,
}

impl<'a> Givens<'a> {
    pub fn new(program: &'a Program, real: Real) -> Givens<'a> {
        let determined = program.determined(&[]);
        let computed = determined.iter().filter(|v| !program.values.op(**v).is_given());
        let derived = computed.enumerate().map(|(place, &v)| (v, place)).collect();
        let positions = program.positions.iter().enumerate().map(|(k, p)| (p.value, k)).collect();
        let (found, exact) = (FxHashMap::default(), RefCell::default());
        Givens { program, real, derived, positions, found, exact }
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
        self.spot(value).written(self.real)
    }

    /// A value in C, in double precision.
    pub fn wide_written(&self, value: Value) -> Written {
        let (spot, wide) = self.wide_spot(value);
        let real = if wide { Real::Double } else { self.real };
        super::write::cast(spot.written(real), real, Real::Double)
    }

    /// Where a value stands.
    pub fn spot(&self, value: Value) -> Spot {
        let place = |array, index| Spot::Place(Place { array, index });
        if let Some(&place) = self.found.get(&value) {
            return Spot::Place(place);
        }
        match self.program.values.op(value) {
            Op::Constant(bits) => Spot::Number(bits.number()),
            Op::Parameter(i) => place("m->p", i as usize),
            Op::Time => Spot::Written(Written::of("t")),
            Op::Input(i) => place("m->u", i as usize),
            Op::Held(i) => place("m->z", i as usize),
            Op::Conserved(i) => place("m->k", i as usize),
            Op::State(i) => place("x", i as usize),
            Op::Solution(..) if self.positions.contains_key(&value) => place("m->positions", self.positions[&value]),
            _ => place("m->c", self.derived[&value]),
        }
    }

    /// Where a value stands in double precision, or in that of real numbers if it does not; and whether it does.
    pub fn wide_spot(&self, value: Value) -> (Spot, bool) {
        let place = |array, index| (Spot::Place(Place { array, index }), true);
        match self.program.values.op(value) {
            _ if self.real == Real::Double => (self.spot(value), true),
            Op::Constant(_) | Op::Time => (self.spot(value), true),
            Op::Parameter(i) => place("m->p_exact", i as usize),
            _ if self.derived.contains_key(&value) => {
                let mut exact = self.exact.borrow_mut();
                let next = exact.len();
                place("m->c_exact", *exact.entry(value).or_insert(next))
            }
            _ => (self.spot(value), false),
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

    /// Where its derivative stands, if it moves.
    pub fn rate(&self, value: Value, moving: Moving) -> Option<Spot> {
        let place = self.direction(value)?;
        let moves = match self.program.values.op(value) {
            Op::Time if moving.time == Some(TimeRate::One) => return Some(Spot::Number(1.0)),
            Op::Time => moving.time.is_some(),
            Op::Input(_) => moving.inputs,
            Op::Held(_) => moving.held,
            Op::Conserved(_) => moving.conserved,
            _ => moving.states,
        };
        moves.then_some(Spot::Place(Place { array: "e", index: place }))
    }
}
