//! Steps as C functions: straight lines and loops in chunks, what crosses from one to the next in the model's work array.

mod copies;
mod crossing;
mod place;
mod precision;
mod rates;
mod shape;
mod steps;
mod turns;

pub(super) use place::{Place, Spot};
pub(super) use precision::cast;
pub(super) use shape::{Body, Moving, Reading, Shape, Time, TimeRate};

use halfarrow_compiler::program::elimination::products;
use halfarrow_compiler::program::{Arg, BlockId, Code, Local, Op, Program, Repetition, Step, Value};
use rustc_hash::FxHashMap;

use super::Export;
use super::blocks::Factored;
use super::function::{Function, Gives};
use super::givens::Givens;
use super::patterns::Patterns;
use super::variables::Variables;
use super::written::{Line, Needed, Part, Variable, Written, needed, without_the_unread, written};
use crate::Real;
use copies::Copied;
use crossing::crossed;
use place::Tables;
use steps::turns;

/// Steps in one C function: compilers take more than linear time for long ones.
const CHUNK: usize = 250;

/// Writes functions.
pub(super) struct Writer<'a> {
    pub program: &'a Program,
    /// The name of the model in capitals, before the codes of failures.
    pub capitals: String,
    pub givens: Givens<'a>,
    pub factored: Factored,
    /// Places of the work array taken so far.
    pub crossing: usize,
    variables: Variables,
    /// The size of real numbers.
    pub real: Real,
    /// Places of the array for what crosses in double precision, if real numbers are less.
    pub wide_crossing: usize,
    /// The Newton blocks in use, by which they are numbered.
    pub newton: &'a [BlockId],
    pub patterns: &'a Patterns,
}

impl<'a> Writer<'a> {
    pub fn new(export: &Export<'a>, name: &str, newton: &'a [BlockId], patterns: &'a Patterns) -> Writer<'a> {
        let Export { program, real, .. } = *export;
        let factored = Factored::of(program, real);
        let givens = Givens::new(program, real);
        let variables = Variables::of(program, &givens);
        let capitals = name.to_ascii_uppercase();
        Writer { program, capitals, givens, factored, crossing: 0, variables, real, wide_crossing: 0, newton, patterns }
    }

    /// A call that takes note of a failure and gives its code.
    pub fn failure(&self, code: &str, place: &dyn Part, time: Time) -> Written {
        written!("{}(m, {}_{}, {}, {})", needed("ha_fail"), self.capitals, code, place, time.text())
    }

    /// Lines that give up with a failure where a condition holds.
    pub fn fail_if(&self, condition: &Written, code: &str, place: &dyn Part, time: Time) -> Line {
        let failure = self.failure(code, place, time);
        Line::new(written!("    if ({}) {{\n        return {};\n    }}", condition, failure), 0)
    }

    /// The functions that compute code, of which the last has this name; `values` says where its outputs go, `rates` where
    /// their derivatives go, `kept` what it computes of what stands before other routines.
    pub fn function(
        &mut self,
        name: &str,
        shape: Shape,
        (code, kept): (&Code, &[(u32, Value)]),
        places: (&[Place], &[Place]),
    ) -> Vec<Function> {
        let mut f = self.body(shape, (code, kept), !places.1.is_empty());
        let repetitions = self.repetitions(&f, places);
        let chunks = self.chunks(code, &repetitions);
        self.find_places(&mut f, &chunks);
        let mut functions = Vec::new();
        for (c, pieces) in chunks.iter().enumerate() {
            f.chunk = c;
            self.chunk(&mut f, pieces, places);
            self.outputs(&mut f, places, chunks.len());
            let called = if chunks.len() == 1 { name.to_string() } else { format!("{name}_{c}") };
            let mut lines = without_the_unread(std::mem::take(&mut f.lines));
            lines.extend(shape.parameters.iter().map(|p| Line::new(written!("    (void){};", p.name()), 0)));
            functions.push(self.finished(called, shape, lines));
        }
        if functions.len() > 1 {
            let lines = functions.iter().map(|f| self.chunk_call(shape, &f.name)).collect();
            functions.push(self.finished(name.to_string(), shape, lines));
        }
        functions
    }

    /// The steps of one function.
    fn chunk(&self, f: &mut Body, pieces: &[Repetition], places: (&[Place], &[Place])) {
        let code = f.code;
        let plain = pieces.iter().filter(|piece| piece.turns == 1);
        f.tables = Tables::default();
        f.turns = turns(plain.flat_map(|piece| &code.steps[piece.first..piece.end()]));
        for &piece in pieces {
            match piece.turns {
                1 => (piece.first..piece.end()).for_each(|at| self.step(f, at)),
                _ => self.turn_loop(f, piece, places),
            }
        }
    }

    /// Steps that stand in one function: pieces of one turn, and loops. A block that is written out counts with what that
    /// takes.
    fn chunks(&self, code: &Code, repetitions: &[Repetition]) -> Vec<Vec<Repetition>> {
        let weight = |at: usize| match &code.steps[at] {
            Step::Solve(solve) if self.is_written_out(solve) => products(&solve.pattern),
            _ => 1,
        };
        let (mut chunks, mut size) = (vec![Vec::<Repetition>::new()], 0);
        let mut put = |next: Repetition, weight: usize| {
            if size >= CHUNK {
                chunks.push(Vec::new());
                size = 0;
            }
            size += weight;
            match chunks.last_mut().expect("one").last_mut() {
                Some(last) if last.turns == 1 && next.turns == 1 && last.end() == next.first => last.length += 1,
                _ => chunks.last_mut().expect("one").push(next),
            }
        };
        let mut at = 0;
        let end = Repetition { first: code.steps.len(), length: 0, turns: 0 };
        for &r in repetitions.iter().chain([&end]) {
            (at..r.first).for_each(|first| put(Repetition { first, length: 1, turns: 1 }, weight(first)));
            if r.turns > 0 {
                put(r, (r.first..r.first + r.length).map(weight).sum());
            }
            at = r.end();
        }
        chunks
    }

    /// A function that is to be written.
    fn body<'c>(&self, shape: Shape, (code, kept): (&'c Code, &[(u32, Value)]), rates: bool) -> Body<'c> {
        let n = code.values.len();
        let mut outputs = vec![Vec::new(); n];
        for (i, a) in code.outputs.iter().enumerate() {
            if let Arg::Local(local) = a {
                outputs[local.0 as usize].push(i);
            }
        }
        Body {
            shape,
            code,
            moves: self.moves(code, shape, rates),
            wide: self.wide(code),
            read: read_of(code, kept),
            home: vec![0; n],
            definition: vec![0; n],
            place: vec![usize::MAX; n],
            rate_place: vec![usize::MAX; n],
            chunk: 0,
            last_of: FxHashMap::default(),
            turning: None,
            tables: Tables::default(),
            outputs,
            turns: FxHashMap::default(),
            names: self.variables.of_locals(code),
            kept: kept.iter().copied().collect(),
            lines: Vec::new(),
        }
    }

    /// A function of these lines.
    fn finished(&self, name: String, shape: Shape, mut lines: Vec<Line>) -> Function {
        let gives = if shape.void { Gives::Nothing } else { Gives::Status };
        if lines.iter().any(|line| line.written.notes.reads.contains(&Variable::Status)) {
            lines.insert(0, Line::new(Written::of("    int status;"), 0));
        }
        if lines.iter().any(|line| line.written.notes.reads.contains(&Variable::Turn)) {
            lines.insert(0, Line::new(Written::of("    int k;"), 0));
        }
        if !shape.void {
            lines.push(Line::new(written!("    return {}_OK;", self.capitals), 0));
        }
        Function::new(name, gives, shape.parameters, self.real, &lines)
    }

    /// A call of a piece of a function.
    fn chunk_call(&self, shape: Shape, called: &str) -> Line {
        let arguments: Vec<&str> = shape.parameters.iter().map(|p| p.name()).collect();
        let call = written!("{}({})", Needed(called.to_string().into()), arguments.join(", "));
        Line::new(
            match shape.void {
                true => written!("    {};", call),
                false => written!(
                    "    {} = {};\n    if (status != {}_OK) {{\n        return status;\n    }}",
                    Variable::Status,
                    call,
                    self.capitals
                ),
            },
            0,
        )
    }

    fn outputs(&self, f: &mut Body, (values, rates): (&[Place], &[Place]), chunks: usize) {
        let wanted = f.code.outputs.iter().copied().enumerate();
        let wanted: Vec<(usize, Arg)> = wanted.filter(|(_, a)| f.is_here(*a, chunks)).collect();
        let source = |a: Arg| match a {
            Arg::Local(_) => (Spot::Written(self.arg(f, a, f.shape.wide)), f.shape.wide),
            _ => self.spot(f, a, f.shape.wide),
        };
        let moved = |a: Arg| match a {
            Arg::Local(_) => (Spot::Written(self.rate_or_zero(f, a)), f.shape.wide),
            _ => self.rate_spot(f, a).unwrap_or((Spot::Number(0.0), f.shape.wide)),
        };
        let of = |places: &[Place], source: &dyn Fn(Arg) -> (Spot, bool)| -> Vec<Copied> {
            let there = wanted.iter().filter(|w| w.0 < places.len());
            there.map(|&(i, a)| Copied { to: places[i], from: source(a) }).collect()
        };
        let (values, rates) = (of(values, &source), of(rates, &moved));
        let mut lists = [copies::Runs::of(values), copies::Runs::of(rates)];
        for at in 0..wanted.len() {
            for list in &mut lists {
                self.copy(f, list, at);
            }
        }
    }

    /// The derivative, 0 where nothing moves.
    fn rate_or_zero(&self, f: &Body, a: Arg) -> Written {
        let zero = || Written::of(self.precision_of(f.shape.wide).number(0.0));
        self.rate(f, a, f.shape.wide).unwrap_or_else(zero)
    }

    /// Puts what other routines and Newton blocks read where these find it, as soon as it is computed.
    fn keep(&self, f: &mut Body, out: u32) {
        if !f.kept.contains_key(&out) {
            return;
        }
        let at = f.definition[out as usize];
        let Some(which) = f.code.steps[at].defines().iter().position(|own| own.0 == out) else { return };
        let of = |step: &Step| f.kept[&step.defines()[which].0];
        let all: Vec<Value> = f.turns_of(at).map(of).collect();
        let a = Arg::Local(Local(out));
        let place = self.series(f, all.iter().map(|&given| (self.givens.spot(given), false)).collect(), false);
        let value = self.arg(f, a, false);
        f.assign(&place, &value);
        if self.real == Real::Float {
            self.keep_exact(f, &all, a);
        }
    }

    /// Keeps what follows from parameters in double precision too where that is read, and sees that it fits.
    fn keep_exact(&self, f: &mut Body, given: &[Value], a: Arg) {
        let value = self.arg(f, a, true);
        if self.givens.is_exact(given[0]) {
            let place = self.series(f, given.iter().map(|&given| self.givens.wide_spot(given)).collect(), true);
            f.assign(&place, &value);
        }
        let parameter = match self.program.values.op(given[0]) {
            Op::Parameter(i) => i as usize,
            _ => self.program.parameters.len(),
        };
        let unfit = written!("!{}({})", needed("ha_fits"), value);
        f.lines.push(self.fail_if(&unfit, "OUT_OF_RANGE", &parameter, f.shape.time));
    }
}

/// Whether each local is read by a step or wanted.
fn read_of(code: &Code, kept: &[(u32, Value)]) -> Vec<bool> {
    let mut read = vec![false; code.values.len()];
    let mut mark = |a: Arg| {
        if let Arg::Local(i) = a {
            read[i.0 as usize] = true;
        }
    };
    code.steps.iter().for_each(|step| step.for_each_read(&mut mark));
    code.outputs.iter().copied().chain(kept.iter().map(|k| Arg::Local(Local(k.0)))).for_each(mark);
    read
}
