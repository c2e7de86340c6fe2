//! Compiled routines and how they run.

use super::chunk::{Item, Setting};
use super::live::Live;
use super::memory::{Arrays, Gathered, Memory, Reach, Start};
use super::{CHUNK, Generator, INLINE, MachineError, RARE, STATUS_OF_WATCH, WRITTEN_OUT};
use crate::bytecode::{Frame, Hold, InnerCode, Instruction, Layout, Operation, Register, Routine, Solve, SolveError};
use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::program::{Op, Program};
use std::ops::Range;
use std::sync::Arc;

/// A part of a routine as one function.
#[derive(Debug, Clone)]
struct Piece {
    start: Start,
    /// The instructions that it stands for.
    code: Range<usize>,
}

/// What is done in turn.
#[derive(Debug, Clone)]
enum Step {
    Piece(Piece),
    /// A solve block, by its number in the routine.
    Solve(usize),
}

/// The machine code of a routine.
#[derive(Debug)]
pub(crate) struct Code {
    memory: Memory,
    reach: Reach,
    steps: Vec<Step>,
    /// Inner code of each Newton block.
    inner: Vec<Option<Arc<Inner>>>,
    along: bool,
    /// All of it from time and states to rates, if it is one chunk.
    direct: Option<Start>,
}

/// The machine code inside a Newton block.
#[derive(Debug)]
struct Inner {
    memory: Memory,
    reach: Reach,
    /// For values, and with derivatives.
    pieces: [Vec<Piece>; 2],
}

impl Generator {
    /// Compiles a routine, with derivatives along a direction if `along`.
    ///
    /// # Errors
    /// The generator refuses, or there is no executable memory.
    pub fn compile(
        &mut self,
        program: &Program,
        layout: &Layout,
        routine: &Routine,
        along: bool,
    ) -> Result<Code, MachineError> {
        let states = layout.states..layout.states + program.states.len() as u32;
        let setting = Setting { conditions: &program.conditions, time: layout.time, states };
        let mut gathered = Gathered::default();
        let written_out: Vec<bool> =
            (0..routine.solves.len()).map(|solve| !along && is_written_out(program, layout, routine, solve)).collect();
        let cuts = cuts(routine, &written_out);
        let mut live = Live::of(&routine.outputs);
        let mut steps = Vec::with_capacity(cuts.len());
        let inline = inlines(operations(&routine.code));
        for cut in cuts.into_iter().rev() {
            let items: Vec<Item> = routine.code[cut.clone()].iter().map(|i| item(routine, i)).collect();
            if let [Instruction::Solve { solve }] = routine.code[cut.clone()]
                && !written_out[solve as usize]
            {
                steps.push(Step::Solve(solve as usize));
                live.before_solve(&routine.solves[solve as usize]);
                continue;
            }
            let start = self.chunk(&mut gathered, &setting, &items, &live.registers(), (along, inline))?;
            items.iter().rev().for_each(|item| match item {
                Item::Op(operation) => live.before(operation),
                Item::Watch { pivot, scale, .. } => [*pivot, *scale].into_iter().for_each(|r| live.read(r)),
                Item::Solve(solve) => live.before_solve(solve),
            });
            steps.push(Step::Piece(Piece { start, code: cut }));
        }
        steps.reverse();
        let single = matches!(steps[..], [Step::Piece(_)]) && routine.outputs.len() == program.states.len();
        let direct = if single && !along {
            let items: Vec<Item> = routine.code.iter().map(|i| item(routine, i)).collect();
            Some(self.rates(&mut gathered, &setting, &items, &routine.outputs, inline)?)
        } else {
            None
        };
        let mut inner = Vec::with_capacity(routine.solves.len());
        for solve in &routine.solves {
            let value = self.inner(&mut gathered, &setting, solve, false)?;
            let slopes = if along { self.inner(&mut gathered, &setting, solve, true)? } else { Vec::new() };
            inner.push((!solve.code.is_empty()).then_some([value, slopes]));
        }
        let memory = gathered.seal().map_err(|why| MachineError::Memory(why.to_string()))?;
        let reach = Reach {
            registers: layout.size.max(routine.registers) as usize,
            conditions: program.conditions.len(),
            tables: program.tables.len(),
            states: program.states.len(),
        };
        let inner = inner.into_iter().map(|pieces| {
            let memory = memory.clone();
            pieces.map(|pieces| Arc::new(Inner { memory, reach, pieces }))
        });
        let inner = inner.collect();
        Ok(Code { memory, reach, steps, inner, along, direct })
    }

    /// The code inside a Newton block: what its matrix and right side read is wanted.
    fn inner(
        &mut self,
        gathered: &mut Gathered,
        setting: &Setting,
        solve: &Solve,
        along: bool,
    ) -> Result<Vec<Piece>, MachineError> {
        let wanted: Vec<Register> = solve.matrix.iter().chain(&solve.right).copied().collect();
        let mut live = Live::of(&wanted);
        let mut pieces = Vec::new();
        let inline = inlines(solve.code.iter());
        let starts: Vec<usize> = (0..solve.code.len()).step_by(CHUNK).collect();
        for start in starts.into_iter().rev() {
            let code = start..(start + CHUNK).min(solve.code.len());
            let items: Vec<Item> = solve.code[code.clone()].iter().map(Item::Op).collect();
            let start = self.chunk(gathered, setting, &items, &live.registers(), (along, inline))?;
            solve.code[code.clone()].iter().rev().for_each(|operation| live.before(operation));
            pieces.push(Piece { start, code });
        }
        pieces.reverse();
        Ok(pieces)
    }
}

/// Where a routine is cut: chunks, and solve blocks by themselves.
fn cuts(routine: &Routine, written_out: &[bool]) -> Vec<Range<usize>> {
    let mut cuts = Vec::new();
    let mut from = 0;
    let mut size = 0;
    for (at, instruction) in routine.code.iter().enumerate() {
        let mut weight = 1;
        if let Instruction::Solve { solve } = *instruction {
            if !written_out[solve as usize] {
                cuts.extend((from < at).then_some(from..at));
                cuts.push(at..at + 1);
                (from, size) = (at + 1, 0);
                continue;
            }
            weight = routine.solves[solve as usize].matrix.len();
        }
        size += weight;
        if size >= CHUNK {
            cuts.push(from..at + 1);
            (from, size) = (at + 1, 0);
        }
    }
    cuts.extend((from < routine.code.len()).then_some(from..routine.code.len()));
    cuts
}

/// Whether a solve block is written out in its chunk: small, and such that no pivot is sought as a rule. One whose matrix
/// never changes is factored once; one whose factors others use has to keep them.
fn is_written_out(program: &Program, layout: &Layout, routine: &Routine, solve: usize) -> bool {
    let solve = &routine.solves[solve];
    let n = solve.right.len();
    let linear = solve.guess.is_empty() && solve.shared.is_none();
    let small = n == 1 || n <= WRITTEN_OUT && program.blocks[solve.block].is_symmetric();
    let constant = solve.matrix.iter().all(|&r| r < layout.time);
    let used = routine.solves.iter().any(|other| other.shared == Some(solve.block));
    linear && small && !constant && !used
}

fn item<'a>(routine: &'a Routine, instruction: &'a Instruction) -> Item<'a> {
    match instruction {
        Instruction::Op(operation) => Item::Op(operation),
        &Instruction::Watch { pivot, scale, watch } => Item::Watch { pivot, scale, watch },
        Instruction::Solve { solve } => Item::Solve(&routine.solves[*solve as usize]),
        Instruction::Parameter { .. } => unreachable!("parameters are set by the bytecode"),
    }
}

/// Whether functions are written out: not where there are many, as that takes long to compile.
fn inlines<'a>(code: impl Iterator<Item = &'a Operation>) -> bool {
    let wanted =
        |o: &&Operation| matches!(o.op, Op::Call(Function::Sin | Function::Cos | Function::Exp | Function::Log, _));
    code.filter(wanted).count() <= INLINE
}

fn operations(code: &[Instruction]) -> impl Iterator<Item = &Operation> {
    code.iter().filter_map(|i| if let Instruction::Op(operation) = i { Some(operation) } else { None })
}

impl Code {
    /// Runs the routine that it was made of, exactly as the bytecode does.
    ///
    /// # Errors
    /// As the bytecode.
    pub fn run(&self, frame: &mut Frame, routine: &Routine) -> Result<(), SolveError> {
        if self.along { self.steps::<true>(frame, routine) } else { self.steps::<false>(frame, routine) }
    }

    /// Rates from time and states given here, all else as it was placed last; false if the routine has to be run.
    #[inline]
    pub fn rates(&self, frame: &mut Frame, t: f64, x: &[f64], dx: &mut [f64]) -> bool {
        let Some(start) = self.direct else { return false };
        if [frame.conditions.clock, frame.conditions.state].contains(&Hold::Take) {
            return false;
        }
        self.memory.enter_rates(start, self.reach, arrays(frame), (t, x, dx)) == 0
    }

    fn steps<const ALONG: bool>(&self, frame: &mut Frame, routine: &Routine) -> Result<(), SolveError> {
        // Conditions that are taken anew are for the bytecode.
        if [frame.conditions.clock, frame.conditions.state].contains(&Hold::Take) {
            return frame.part::<ALONG>(routine, &routine.code);
        }
        for step in &self.steps {
            match step {
                Step::Piece(piece) => match enter(&self.memory, self.reach, piece.start, frame) {
                    0 => {}
                    RARE => frame.part::<ALONG>(routine, &routine.code[piece.code.clone()])?,
                    status => return Err(SolveError::Vanished { watch: (status - STATUS_OF_WATCH) as u32 }),
                },
                Step::Solve(solve) if !ALONG && frame.put_known_root(&routine.solves[*solve]) => {}
                Step::Solve(solve) => {
                    frame.inner = self.inner[*solve].clone().map(|inner| inner as Arc<dyn InnerCode>);
                    let solved = frame.solve::<ALONG>(&routine.solves[*solve]);
                    frame.inner = None;
                    solved?;
                }
            }
        }
        Ok(())
    }
}

impl InnerCode for Inner {
    fn run(&self, frame: &mut Frame, solve: &Solve, along: bool) {
        for piece in &self.pieces[usize::from(along)] {
            if enter(&self.memory, self.reach, piece.start, frame) != 0 {
                let code = &solve.code[piece.code.clone()];
                if along { frame.plain::<true>(code) } else { frame.plain::<false>(code) }
            }
        }
    }
}

fn enter(memory: &Memory, reach: Reach, start: Start, frame: &mut Frame) -> u64 {
    memory.enter(start, reach, arrays(frame))
}

#[inline]
fn arrays(frame: &mut Frame) -> Arrays<'_> {
    let keeps = |hold: Hold| u64::from(hold == Hold::Keep);
    let keep = keeps(frame.conditions.clock) | keeps(frame.conditions.state) << 1;
    let held = &frame.conditions.held[..];
    Arrays { values: &mut frame.r, slopes: &mut frame.d, held, tables: &frame.tables, keep }
}
