//! Steps as C functions: straight lines in chunks, what crosses from one to the next in the model's work array.

mod precision;
mod rates;
mod shape;
mod steps;

pub(super) use shape::{Body, Moving, Reading, Shape, Time, TimeRate};

use halfarrow_compiler::program::elimination::products;
use halfarrow_compiler::program::{Arg, BlockId, Code, Local, Op, Program, Step, Value};
use rustc_hash::FxHashMap;

use super::Export;
use super::blocks::Factored;
use super::function::{Function, Gives};
use super::givens::Givens;
use super::patterns::Patterns;
use super::variables::Variables;
use super::written::{Line, Needed, Part, Variable, Written, needed, without_the_unread, written};
use crate::Real;
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
        places: (&[String], &[String]),
    ) -> Vec<Function> {
        let chunks = self.chunks(&code.steps);
        let mut f = self.body(shape, (code, kept), &chunks, !places.1.is_empty());
        let (mut functions, mut place) = (Vec::new(), 0);
        for (c, steps) in chunks.iter().enumerate() {
            f.chunk = c;
            f.turns = turns(steps);
            steps.iter().zip(place..).for_each(|(step, at)| self.step(&mut f, step, at));
            place += steps.len();
            self.outputs(&mut f, code, places, chunks.len());
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

    /// Steps that stand in one function; a block that is written out counts with what that takes.
    fn chunks<'s>(&self, steps: &'s [Step]) -> Vec<&'s [Step]> {
        let weight = |step: &Step| match step {
            Step::Solve(solve) if self.is_written_out(solve) => products(&solve.pattern),
            _ => 1,
        };
        let (mut chunks, mut from, mut size) = (Vec::new(), 0, 0);
        for (at, step) in steps.iter().enumerate() {
            size += weight(step);
            if size >= CHUNK {
                chunks.push(&steps[from..=at]);
                (from, size) = (at + 1, 0);
            }
        }
        if from < steps.len() || chunks.is_empty() {
            chunks.push(&steps[from..]);
        }
        chunks
    }

    /// A function that is to be written, with a home for each local.
    fn body(&mut self, shape: Shape, (code, kept): (&Code, &[(u32, Value)]), chunks: &[&[Step]], rates: bool) -> Body {
        let mut f = Body {
            shape,
            moves: self.moves(code, shape, rates),
            wide: self.wide(code),
            read: read_of(code, kept),
            home: vec![0; code.values.len()],
            place: vec![usize::MAX; code.values.len()],
            rate_place: vec![usize::MAX; code.values.len()],
            chunk: 0,
            turns: FxHashMap::default(),
            names: self.variables.of_locals(code),
            kept: kept.iter().copied().collect(),
            lines: Vec::new(),
        };
        for (c, steps) in chunks.iter().enumerate() {
            steps.iter().flat_map(Step::defines).for_each(|out| f.home[out.0 as usize] = c);
        }
        for (c, steps) in chunks.iter().enumerate() {
            for step in *steps {
                step.for_each_read(|a| match a {
                    Arg::Local(i) if f.home[i.0 as usize] != c => self.cross(&mut f, i.0 as usize),
                    _ => {}
                });
            }
        }
        f
    }

    /// A function of these lines.
    fn finished(&self, name: String, shape: Shape, mut lines: Vec<Line>) -> Function {
        let gives = if shape.void { Gives::Nothing } else { Gives::Status };
        if lines.iter().any(|line| line.written.notes.reads.contains(&Variable::Status)) {
            lines.insert(0, Line::new(Written::of("    int status;"), 0));
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

    fn cross(&mut self, f: &mut Body, local: usize) {
        if f.place[local] == usize::MAX {
            let crossing = if f.wide[local] { &mut self.wide_crossing } else { &mut self.crossing };
            f.place[local] = *crossing;
            *crossing += 1;
            if f.moves[local] {
                f.rate_place[local] = *crossing;
                *crossing += 1;
            }
        }
    }

    fn outputs(&self, f: &mut Body, code: &Code, (values, rates): (&[String], &[String]), chunks: usize) {
        let wanted: Vec<(usize, Arg)> =
            code.outputs.iter().copied().enumerate().filter(|(_, a)| f.is_here(*a, chunks)).collect();
        for (i, a) in wanted {
            if let Some(place) = values.get(i) {
                let value = self.arg(f, a, f.shape.wide);
                f.assign(place, &value);
            }
            if let Some(place) = rates.get(i) {
                let zero = || Written::of(self.precision_of(f.shape.wide).number(0.0));
                let rate = self.rate(f, a, f.shape.wide).unwrap_or_else(zero);
                f.assign(place, &rate);
            }
        }
    }

    /// Puts what other routines and Newton blocks read where these find it, as soon as it is computed.
    fn keep(&self, f: &mut Body, out: u32) {
        let Some(&given) = f.kept.get(&out) else { return };
        let a = Arg::Local(Local(out));
        let (place, value) = (self.givens.written(given), self.arg(f, a, false));
        f.assign(&place.text, &value);
        if self.real == Real::Float {
            self.keep_exact(f, given, a);
        }
    }

    /// Keeps what follows from parameters in double precision too where that is read, and sees that it fits.
    fn keep_exact(&self, f: &mut Body, given: Value, a: Arg) {
        let value = self.arg(f, a, true);
        if self.givens.is_exact(given) {
            f.assign(&self.givens.wide_written(given).text, &value);
        }
        let parameter = match self.program.values.op(given) {
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
