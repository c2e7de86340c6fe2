//! How functions are called, and what one is while it is written.

use halfarrow_compiler::program::{Arg, Code, Repetition, Step, Value};
use rustc_hash::FxHashMap;

use super::place::Tables;
use super::turns::before;
use crate::c::function::Parameter;
use crate::c::written::{Line, Part, Series, Variable, Written, written};

/// How a function is called.
#[derive(Debug, Clone, Copy)]
pub(in crate::c) struct Shape {
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Whether it gives no status.
    pub void: bool,
    /// Time, where failures note it.
    pub time: Time,
    /// The givens that move, if derivatives are wanted.
    pub along: Option<Moving>,
    /// Whether what it gives is in double precision whatever real numbers are.
    pub wide: bool,
}

/// When a function fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::c) enum Time {
    /// At the time for which it is called.
    Given,
    /// At any time.
    Always,
}

impl Time {
    /// In C.
    pub fn text(self) -> &'static str {
        match self {
            Time::Given => "t",
            Time::Always => "((double)NAN)",
        }
    }
}

/// What has derivatives.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::c) struct Moving {
    /// The rate of time.
    pub time: Option<TimeRate>,
    pub inputs: bool,
    pub held: bool,
    pub conserved: bool,
    pub states: bool,
    /// What a Newton block reads from outside.
    pub outer: bool,
}

/// How fast time runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::c) enum TimeRate {
    /// One second a second.
    One,
    /// As the direction says.
    OfDirection,
}

/// A function while it is written.
pub(in crate::c) struct Body<'c> {
    pub shape: Shape,
    pub code: &'c Code,
    /// Which locals have derivatives that somebody asks for.
    pub moves: Vec<bool>,
    /// Which locals are in double precision whatever real numbers are.
    pub(super) wide: Vec<bool>,
    /// Which are read.
    pub read: Vec<bool>,
    /// The chunk that computes each local; none for what a loop computes.
    pub(super) home: Vec<usize>,
    /// The step that does.
    pub(super) definition: Vec<usize>,
    /// Where a local is kept that crosses from one chunk, loop or turn to another, and where its derivative is.
    pub(super) place: Vec<usize>,
    pub(super) rate_place: Vec<usize>,
    pub(super) chunk: usize,
    /// What in the last turn of a loop is the last value of what goes on from turn to turn: of which local of the first turn.
    pub(super) last_of: FxHashMap<usize, usize>,
    /// The loop that is being written.
    pub(super) turning: Option<Repetition>,
    /// What loops of this chunk read.
    pub(super) tables: Tables,
    /// Which outputs each local is.
    pub(super) outputs: Vec<Vec<usize>>,
    /// Angles whose sine and cosine are both wanted in this chunk, with the number of the pair once it is computed.
    pub(super) turns: FxHashMap<Arg, Option<usize>>,
    /// What the locals are in the model, where they have a name there.
    pub(super) names: Vec<Option<String>>,
    /// What other routines read of what is computed.
    pub(super) kept: FxHashMap<u32, Value>,
    pub lines: Vec<Line>,
}

impl Body<'_> {
    /// A line that declares so many numbers.
    pub fn line(&mut self, written: Written, numbers: usize) {
        self.lines.push(Line::new(written, numbers));
    }

    /// A line that declares a constant of so many numbers.
    pub fn constant(&mut self, variable: Variable, written: Written, numbers: usize) {
        self.lines.push(Line::constant(variable, written, numbers));
    }

    /// A line that puts a value somewhere.
    pub fn assign(&mut self, place: &dyn Part, value: &Written) {
        self.line(written!("    {} = {};", place, value), 0);
    }

    /// Whether a local is a variable where lines are written now.
    pub(super) fn is_variable(&self, local: usize) -> bool {
        let of_this_turn = |r: &Repetition| (r.first..r.first + r.length).contains(&self.definition[local]);
        self.home[local] == self.chunk || self.turning.as_ref().is_some_and(of_this_turn)
    }

    /// The variables that hold a local and its derivative.
    pub(super) fn variables(&self, local: usize) -> [Variable; 2] {
        match self.last_of.get(&local) {
            Some(&first) => before(first),
            None => [Series::Value(local as u32), Series::Rate(local as u32)].map(Variable::Number),
        }
    }

    /// A step in all turns of the loop that is being written, or alone.
    pub(super) fn turns_of(&self, at: usize) -> impl Iterator<Item = &Step> {
        let (length, turns) = self.turning.map_or((1, 1), |r| (r.length, r.turns));
        (0..turns).map(move |turn| &self.code.steps[at + turn * length])
    }

    /// Whether what is computed by now first has this value; what no chunk computes stands in the last one.
    pub(super) fn is_here(&self, a: Arg, chunks: usize) -> bool {
        match a {
            Arg::Local(i) => self.home[i.0 as usize] == self.chunk && !self.last_of.contains_key(&(i.0 as usize)),
            _ => self.chunk + 1 == chunks,
        }
    }
}

/// What a step reads, in C: values and derivatives.
pub(in crate::c) struct Reading {
    /// The number of what fails.
    pub which: Written,
    pub values: Vec<Written>,
    pub rates: Vec<Option<Written>>,
}
