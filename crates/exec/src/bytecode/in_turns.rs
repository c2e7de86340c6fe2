//! Routines of equal cells: what comes turn by turn is done operation by operation, for many turns at a time.
//!
//! To fetch an instruction takes longer than to execute it, and the instructions of a large model do not stay at hand. Of
//! cells that are alike there is one instruction for all, and what it reads and finds stands in rows that vectors go
//! through. Every value keeps the operation it comes from, hence its bits; only the order of what does not read each
//! other changes.

use super::block_batch::BlockBatches;
use super::frame::{Frame, SolveError};
use super::instruction::{Instruction, Operation, Register, Routine};
use super::registers::{Layout, NONE};
use halfarrow_compiler::program::{Arg, Code, Op, Program, Repetition, Step};
use rustc_hash::FxHashMap;
use std::cmp::Ordering;
use std::ops::Range;
use std::sync::Arc;

/// Turns that are gone through together: what they read and find stays at hand.
const TILE: usize = 128;
/// So many turns are taken as one, at most.
const MOST_TURNS_IN_ONE: usize = 8;
/// Of a routine with a smaller part of such steps nothing is gained.
const LEAST: f64 = 0.8;

/// A routine in turns.
#[derive(Debug)]
pub(crate) struct InTurns {
    parts: Vec<Part>,
    /// What is not done in turns, with solve blocks; its registers are its own.
    routine: Routine,
    /// Registers of what is wanted: here, and in the routine as it stands.
    outputs: Vec<(Register, Register)>,
    /// Newton blocks that are solved together.
    batches: Option<Arc<BlockBatches>>,
}

#[derive(Debug)]
enum Part {
    Steps(Range<usize>),
    Turns(Turns),
}

/// The same operations turn by turn.
#[derive(Debug)]
struct Turns {
    count: usize,
    rows: Vec<Row>,
    /// Registers of operands that lie in no line.
    listed: Vec<Register>,
}

/// One operation of all turns; what it finds stands in a row.
#[derive(Debug, Clone, Copy)]
struct Row {
    out: Register,
    op: Op<Place>,
}

/// Where an operand stands in each turn.
#[derive(Debug, Clone, Copy)]
enum Place {
    /// From the first on by so many registers.
    Line(Register, Register),
    /// In a list, from there on.
    Listed(usize),
}

impl InTurns {
    /// The routine in turns, if most of its steps come in such.
    pub fn of(program: &Program, layout: &Layout, routine: &Routine) -> Option<InTurns> {
        let code = &routine.source;
        let found = code.repetitions(&kinds(code));
        let order = Order::of(code);
        let repetitions: Vec<Repetition> = found.iter().filter_map(|r| order.fitting(code, r)).collect();
        let steps: usize = repetitions.iter().map(|r| r.length * r.turns).sum();
        if (steps as f64) < LEAST * code.steps.len() as f64 {
            return None;
        }
        let mut next = layout.size.max(routine.registers);
        let mut places = vec![NONE; code.values.len()];
        for r in &repetitions {
            for place in 0..r.length {
                for turn in 0..r.turns {
                    let out = code.steps[r.first + turn * r.length + place].defines()[0];
                    places[out.0 as usize] = next;
                    next += 1;
                }
            }
        }
        let mut own = layout.placed(code, places, next);
        let batches = BlockBatches::of(program, layout, &own).map(Arc::new);
        let (mut parts, mut at) = (Vec::new(), 0);
        for r in &repetitions {
            parts.extend((at < r.first).then_some(Part::Steps(at..r.first)));
            parts.push(Part::Turns(Turns::of(&own.code, r)));
            at = r.end();
        }
        parts.extend((at < own.code.len()).then_some(Part::Steps(at..own.code.len())));
        let mut outputs: Vec<(Register, Register)> = own
            .outputs
            .iter()
            .copied()
            .zip(routine.outputs.iter().copied())
            .filter(|(own, other)| own != other)
            .collect();
        outputs.sort_unstable_by_key(|&(_, there)| there);
        outputs.dedup();
        own.source = Code::default();
        let mut in_turns = InTurns { parts, routine: own, outputs, batches };
        in_turns.forget_steps();
        Some(in_turns)
    }

    /// Keeps the instructions alone that are not done in turns.
    fn forget_steps(&mut self) {
        let mut kept = Vec::new();
        for part in &mut self.parts {
            if let Part::Steps(range) = part {
                let start = kept.len();
                kept.extend_from_slice(&self.routine.code[range.clone()]);
                *range = start..kept.len();
            }
        }
        self.routine.code = kept;
    }
}

/// A number for each step, the same for operations that differ in what they read and find alone.
fn kinds(code: &Code) -> Vec<u32> {
    let mut known: FxHashMap<Op<()>, u32> = FxHashMap::default();
    let mut single = u32::MAX;
    let kind = |step: &Step| match step {
        Step::Op { op, .. } if !op.is_held() => {
            let count = known.len() as u32;
            *known.entry(op.map_operands(|_| ())).or_insert(count)
        }
        _ => {
            single -= 1;
            single
        }
    };
    code.steps.iter().map(kind).collect()
}

/// Which step defines each local.
struct Order(Vec<u32>);

impl Order {
    fn of(code: &Code) -> Order {
        let mut defined = vec![0; code.values.len()];
        for (at, step) in code.steps.iter().enumerate() {
            step.defines().iter().for_each(|out| defined[out.0 as usize] = at as u32);
        }
        Order(defined)
    }

    /// The repetition, or one of which each turn is several of its own: operations alone do not tell that only every other
    /// one reads what the one before it has found.
    fn fitting(&self, code: &Code, r: &Repetition) -> Option<Repetition> {
        let several = (1..=MOST_TURNS_IN_ONE).map(|k| Repetition { length: r.length * k, turns: r.turns / k, ..*r });
        several.filter(Repetition::pays).find_map(|r| self.turned(code, &r))
    }

    /// The repetition with turns that begin where each operation may go through all of them before the next one does, if
    /// there is such a place.
    fn turned(&self, code: &Code, r: &Repetition) -> Option<Repetition> {
        let middle = r.first + r.turns / 2 * r.length;
        // Turns that begin between what is found and what reads it have the reader before.
        let mut change = vec![0i64; r.length + 1];
        let mut forbid = |shifts: Range<usize>| {
            change[shifts.start] += 1;
            change[shifts.end] -= 1;
        };
        for at in middle..middle + r.length {
            code.steps[at].for_each_read(|read| {
                let Arg::Local(local) = read else { return };
                let Some(from) = (self.0[local.0 as usize] as usize).checked_sub(r.first) else { return };
                let (from, to) = (from % r.length, (at - r.first) % r.length);
                match from.cmp(&to) {
                    Ordering::Less => forbid(from + 1..to + 1),
                    Ordering::Equal => forbid(0..r.length),
                    Ordering::Greater => {
                        forbid(0..to + 1);
                        forbid(from + 1..r.length);
                    }
                }
            });
        }
        let mut forbidden = 0;
        let mut fits = change[..r.length].iter().map(|change| {
            forbidden += change;
            forbidden == 0
        });
        let shift = fits.position(|fits| fits)?;
        let turned = match shift {
            0 => *r,
            _ => Repetition { first: r.first + shift, turns: r.turns - 1, ..*r },
        };
        (turned.pays() && self.allows(code, &turned)).then_some(turned)
    }

    /// Whether each operation may go through all turns before the next one does: it reads nothing of a repetition that a
    /// later one finds, nor what itself has found in an earlier turn.
    fn allows(&self, code: &Code, r: &Repetition) -> bool {
        (r.first..r.end()).all(|at| {
            let place = (at - r.first) % r.length;
            let mut is_fine = true;
            code.steps[at].for_each_read(|read| {
                if let Arg::Local(local) = read {
                    let from = self.0[local.0 as usize] as usize;
                    is_fine &= from < r.first || (from - r.first) % r.length < place;
                }
            });
            is_fine
        })
    }
}

impl Turns {
    fn of(code: &[Instruction], r: &Repetition) -> Turns {
        let operation = |turn: usize, place: usize| match code[r.first + turn * r.length + place] {
            Instruction::Op(operation) => operation,
            _ => unreachable!("repetitions are operations alone"),
        };
        let mut listed = Vec::new();
        let row = |place: usize| {
            let (first, second) = (operation(0, place), operation(1, place));
            let operands = |operation: Operation| {
                let (mut all, mut count) = ([0; 3], 0);
                operation.op.for_each_operand(|register| {
                    all[count] = register;
                    count += 1;
                });
                all
            };
            let (start, then) = (operands(first), operands(second));
            let steps: [Register; 3] = std::array::from_fn(|k| then[k].wrapping_sub(start[k]));
            let mut straight = [true; 3];
            for turn in 0..r.turns {
                let here = operands(operation(turn, place));
                for k in 0..3 {
                    straight[k] &= here[k] == start[k].wrapping_add(steps[k].wrapping_mul(turn as Register));
                }
            }
            let mut k = 0;
            let op = first.op.map_operands(|_| {
                k += 1;
                match straight[k - 1] {
                    true => Place::Line(start[k - 1], steps[k - 1]),
                    false => {
                        let from = listed.len();
                        listed.extend((0..r.turns).map(|turn| operands(operation(turn, place))[k - 1]));
                        Place::Listed(from)
                    }
                }
            });
            Row { out: first.out, op }
        };
        let rows = (0..r.length).map(row).collect();
        Turns { count: r.turns, rows, listed }
    }

    /// The register of an operand in a turn.
    fn register(&self, place: Place, turn: usize) -> Register {
        match place {
            Place::Line(first, by) => first.wrapping_add(by.wrapping_mul(turn as Register)),
            Place::Listed(from) => self.listed[from + turn],
        }
    }

    /// What an operand is in some turns.
    #[inline(always)]
    fn read(&self, r: &[f64], place: Place, turns: Range<usize>, values: &mut [f64; TILE]) {
        let count = turns.len();
        match place {
            Place::Line(first, 1) => {
                let start = first as usize + turns.start;
                values[..count].copy_from_slice(&r[start..start + count]);
            }
            Place::Line(first, 0) => values[..count].fill(r[first as usize]),
            _ => values.iter_mut().zip(turns).for_each(|(value, turn)| *value = r[self.register(place, turn) as usize]),
        }
    }
}

impl Frame {
    /// Makes room for a routine in turns.
    pub fn reserve_in_turns(&mut self, in_turns: &InTurns) {
        self.reserve(&in_turns.routine);
        if let Some(batches) = &in_turns.batches {
            self.reserve_batches(batches);
        }
    }

    /// Runs a routine in turns, with derivatives along the direction that the fixed registers have in `d` if asked for.
    pub fn run_in_turns<const ALONG: bool>(&mut self, in_turns: &InTurns) -> Result<(), SolveError> {
        if in_turns.batches.is_some() {
            self.begin(in_turns.batches.as_ref());
        }
        for part in &in_turns.parts {
            match part {
                Part::Steps(range) => {
                    self.part::<ALONG>(&in_turns.routine, &in_turns.routine.code[range.clone()])?;
                }
                Part::Turns(turns) => self.turns::<ALONG>(turns),
            }
        }
        for &(from, to) in &in_turns.outputs {
            self.r[to as usize] = self.r[from as usize];
            if ALONG {
                self.d[to as usize] = self.d[from as usize];
            }
        }
        Ok(())
    }

    fn turns<const ALONG: bool>(&mut self, turns: &Turns) {
        for start in (0..turns.count).step_by(TILE) {
            let tile = start..(start + TILE).min(turns.count);
            for row in &turns.rows {
                match row.op {
                    Op::Add(a, b) if !ALONG => self.row(turns, row, [a, b], &tile, |a, b| a + b),
                    Op::Sub(a, b) if !ALONG => self.row(turns, row, [a, b], &tile, |a, b| a - b),
                    Op::Mul(a, b) if !ALONG => self.row(turns, row, [a, b], &tile, |a, b| a * b),
                    Op::Div(a, b) if !ALONG => self.row(turns, row, [a, b], &tile, |a, b| a / b),
                    Op::Neg(a) if !ALONG => self.row(turns, row, [a, a], &tile, |a, _| -a),
                    op => {
                        for turn in tile.clone() {
                            let op = op.map_operands(|place| turns.register(place, turn));
                            self.operation::<ALONG>(&Operation { out: row.out + turn as Register, op });
                        }
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn row(&mut self, turns: &Turns, row: &Row, of: [Place; 2], tile: &Range<usize>, value: impl Fn(f64, f64) -> f64) {
        let (mut a, mut b) = ([0.0; TILE], [0.0; TILE]);
        turns.read(&self.r, of[0], tile.clone(), &mut a);
        turns.read(&self.r, of[1], tile.clone(), &mut b);
        let start = row.out as usize + tile.start;
        let out = &mut self.r[start..start + tile.len()];
        out.iter_mut().zip(a.iter().zip(&b)).for_each(|(out, (&a, &b))| *out = value(a, b));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfarrow_compiler::bond_graph::NoFiles;
    use halfarrow_compiler::compile::{Text, compile};
    use halfarrow_compiler::equations::Form;

    fn program(body: &str) -> Program {
        let text = format!("model Line\nparam n = 300\nparam r = 2 ohm, c = 0.1 F, l = 0.5 H\n{body}\n");
        let text = Text { name: "line.bond", text: &text, files: &NoFiles, overrides: &[] };
        compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir
    }

    /// How many steps are left that are not done in turns, of how many; values and derivatives have the same bits.
    fn left(program: &Program, wanted: impl IntoIterator<Item = halfarrow_compiler::program::Value>) -> (usize, usize) {
        let layout = Layout::new(program, &[]);
        let wanted: Vec<_> = wanted.into_iter().collect();
        let routine = layout.guarded_routine(program, &wanted);
        let in_turns = InTurns::of(program, &layout, &routine).expect("equal cells");
        let preamble = layout.preamble(program);
        let mut frame = Frame::new(program, &layout, layout.size);
        frame.reserve(&routine);
        frame.reserve(&preamble);
        frame.run(&preamble).unwrap();
        let mut seed = 1.0f64;
        for at in 0..program.states.len() {
            seed = (seed * 16807.0) % 2147483647.0;
            let register = layout.states as usize + at;
            (frame.r[register], frame.d[register]) = (seed / 2147483647.0 - 0.4, 0.7 - seed / 2147483647.0);
        }
        let mut together = frame.clone();
        together.reserve_in_turns(&in_turns);
        for along in [false, true] {
            match along {
                false => (frame.run(&routine).unwrap(), together.run_in_turns::<false>(&in_turns).unwrap()),
                true => (frame.run_along(&routine).unwrap(), together.run_in_turns::<true>(&in_turns).unwrap()),
            };
            for &out in &routine.outputs {
                let (a, b) = (frame.pair(out), together.pair(out));
                assert_eq!((a.0.to_bits(), a.1.to_bits()), (b.0.to_bits(), b.1.to_bits()), "{a:?} {b:?}");
            }
        }
        (in_turns.routine.code.len(), routine.code.len())
    }

    fn rates(program: &Program) -> (usize, usize) {
        left(program, program.states.iter().map(|state| state.rate))
    }

    const LINE: &str = "
for i in 1..n {
    1:wire[i] -> R:r[i](r)
    wire[i] -> 0:node[i] -> C:c[i](c)
    if i == 1 { Se:source(1 V) -> wire[i] } else { node[i - 1] -> wire[i] }
}";

    #[test]
    fn a_line_is_gone_through_in_turns() {
        let line = program(LINE);
        let (left_over, all) = rates(&line);
        assert!(left_over < 20 && all > 1000, "{left_over} of {all}");
        let recorded = line.observed.iter().filter_map(|o| o.value.as_ref().ok().copied());
        let (left_over, all) = left(&line, recorded.collect::<Vec<_>>());
        assert!(left_over < 20 && all > 1000, "{left_over} of {all}");
    }
}
