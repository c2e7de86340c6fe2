//! Compiled routines and how they run.

use super::chunk::{ChunkContext, ChunkItem, is_written_out};
use super::functions::{Ends, Functions, Plan};
use super::live::Live;
use super::memory::{ArrayLengths, Operands};
use super::{CHUNK, Generator, INLINE, MachineError, RARE, STATUS_OF_GUARD};
use crate::bytecode::{Frame, Hold, InnerCode, Instruction, Layout, Operation, Routine, Solve, SolveError};
use halfarrow_compiler::program::{Program, elimination};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

/// A segment of a routine, compiled as one function.
#[derive(Debug, Clone)]
struct Segment {
    function: usize,
    /// The instructions that it replaces.
    code: Range<usize>,
}

/// One step of compiled code.
#[derive(Debug, Clone)]
enum MachineStep {
    Segment(Segment),
    /// A solve block, by its number in the routine.
    Solve(usize),
}

/// The machine code of a routine.
#[derive(Debug)]
pub(crate) struct MachineCode {
    functions: Functions,
    steps: Vec<MachineStep>,
    /// Inner code of each Newton block.
    inner: Vec<Option<Arc<InnerMachineCode>>>,
    along: bool,
    /// All of it from time and states to rates, if it is one chunk.
    direct: Option<usize>,
}

/// The machine code inside a Newton block.
#[derive(Debug)]
struct InnerMachineCode {
    functions: Functions,
    /// For values, and with derivatives.
    segments: [Vec<Segment>; 2],
}

impl Generator {
    /// Compiles a routine, with derivatives along a direction if `along`.
    ///
    /// # Errors
    /// The generator refuses, or there is no executable memory.
    pub fn compile(
        &self,
        program: &Program,
        layout: &Layout,
        routine: &Routine,
        along: bool,
    ) -> Result<MachineCode, MachineError> {
        let states = layout.states..layout.states + program.states.len() as u32;
        let context = ChunkContext { conditions: &program.conditions, time: layout.time, states };
        let mut plans = Vec::new();
        let steps = steps(program, layout, routine, along, &mut plans);
        let single = matches!(steps[..], [MachineStep::Segment(_)]) && routine.outputs.len() == program.states.len();
        let direct = (single && !along).then(|| {
            let items = routine.code.iter().map(|i| item(routine, i)).collect();
            let inline = inlines(operations(&routine.code));
            plans.push(Plan { items, ends: Ends::Rates(&routine.outputs), along, inline });
            plans.len() - 1
        });
        let mut inner = Vec::with_capacity(routine.solves.len());
        for solve in &routine.solves {
            let value = inner_segments(solve, false, &mut plans);
            let derivatives = if along { inner_segments(solve, true, &mut plans) } else { Vec::new() };
            inner.push((!solve.code.is_empty()).then_some([value, derivatives]));
        }
        let lengths = ArrayLengths {
            registers: layout.size.max(routine.registers) as usize,
            conditions: program.conditions.len(),
            tables: program.tables.len(),
            states: program.states.len(),
        };
        let functions = Functions::new(self, &context, &plans, lengths)?;
        let inner = inner.into_iter().map(|segments| {
            segments.map(|segments| Arc::new(InnerMachineCode { functions: functions.clone(), segments }))
        });
        let inner = inner.collect();
        Ok(MachineCode { functions, steps, inner, along, direct })
    }
}

/// The steps of a routine, and plans of the functions that they run.
fn steps<'a>(
    program: &Program,
    layout: &Layout,
    routine: &'a Routine,
    along: bool,
    plans: &mut Vec<Plan<'a>>,
) -> Vec<MachineStep> {
    let written_out = if along { vec![false; routine.solves.len()] } else { written_out(program, layout, routine) };
    let inline = inlines(operations(&routine.code));
    let mut live = Live::of(&routine.outputs);
    let mut steps = Vec::new();
    for code in cuts(routine, &written_out, inline).into_iter().rev() {
        match routine.code[code.clone()] {
            [Instruction::Solve { solve }] if !written_out[solve as usize] => {
                live.before_solve(&routine.solves[solve as usize]);
                steps.push(MachineStep::Solve(solve as usize));
            }
            ref instructions => {
                let items: Vec<ChunkItem> = instructions.iter().map(|i| item(routine, i)).collect();
                let ends = Ends::Stores(live.before_all(&items));
                plans.push(Plan { items, ends, along, inline });
                steps.push(MachineStep::Segment(Segment { function: plans.len() - 1, code }));
            }
        }
    }
    steps.reverse();
    steps
}

/// The code inside a Newton block: its matrix and right side are the outputs.
fn inner_segments<'a>(solve: &'a Solve, along: bool, plans: &mut Vec<Plan<'a>>) -> Vec<Segment> {
    let mut live = Live::of(solve.matrix.iter().chain(&solve.right));
    let mut segments = Vec::new();
    let inline = inlines(solve.code.iter());
    let starts: Vec<usize> = (0..solve.code.len()).step_by(CHUNK).collect();
    for start in starts.into_iter().rev() {
        let code = start..(start + CHUNK).min(solve.code.len());
        let items: Vec<ChunkItem> = solve.code[code.clone()].iter().map(ChunkItem::Op).collect();
        let ends = Ends::Stores(live.before_all(&items));
        plans.push(Plan { items, ends, along, inline });
        segments.push(Segment { function: plans.len() - 1, code });
    }
    segments.reverse();
    segments
}

/// Where a routine is cut: chunks, and solve blocks by themselves. Where there are several chunks, what may fail has its own:
/// the others store what they write as they go.
fn cuts(routine: &Routine, written_out: &[bool], inline: bool) -> Vec<Range<usize>> {
    let mut cuts = Vec::new();
    let (mut from, mut size, mut failing) = (0, 0, false);
    let several = routine.code.len() > CHUNK;
    for (at, instruction) in routine.code.iter().enumerate() {
        let mut weight = 1;
        if let Instruction::Solve { solve } = *instruction {
            if !written_out[solve as usize] {
                cuts.extend((from < at).then_some(from..at));
                cuts.push(at..at + 1);
                (from, size) = (at + 1, 0);
                continue;
            }
            let solve = &routine.solves[solve as usize];
            weight = solve.matrix.len() + elimination::products(&solve.pattern);
        }
        let fails = item(routine, instruction).may_fail(inline);
        if several && fails != failing && from < at {
            cuts.push(from..at);
            (from, size) = (at, 0);
        }
        failing = fails;
        size += weight;
        if size >= CHUNK {
            cuts.push(from..at + 1);
            (from, size) = (at + 1, 0);
        }
    }
    cuts.extend((from < routine.code.len()).then_some(from..routine.code.len()));
    cuts
}

/// Whether each solve block is written out in its chunk: small, and such that no pivot is sought as a rule. One whose
/// matrix never changes is factored once; one whose factors others use has to keep them.
fn written_out(program: &Program, layout: &Layout, routine: &Routine) -> Vec<bool> {
    let used: BTreeSet<_> = routine.solves.iter().filter_map(|solve| solve.shared).collect();
    let is_written_out = |solve: &Solve| {
        let block = &program.blocks[solve.block];
        let linear = solve.guess.is_empty() && solve.shared.is_none();
        let whole = block.matrix().factors.is_none() && block.is_symmetric();
        let small = solve.right.len() == 1 || whole && elimination::is_written_out(&solve.pattern);
        let constant = solve.matrix.iter().all(|&r| r < layout.time);
        linear && small && !constant && !used.contains(&solve.block)
    };
    routine.solves.iter().map(is_written_out).collect()
}

fn item<'a>(routine: &'a Routine, instruction: &'a Instruction) -> ChunkItem<'a> {
    match instruction {
        Instruction::Op(operation) => ChunkItem::Op(operation),
        &Instruction::Guard { pivot, scale, guard } => ChunkItem::Guard { pivot, scale, guard },
        Instruction::Solve { solve } => ChunkItem::Solve(&routine.solves[*solve as usize]),
        Instruction::Parameter { .. } => unreachable!("parameters are set by the bytecode"),
    }
}

/// Whether functions are inlined: not where there are many, as that takes long to compile.
fn inlines<'a>(code: impl Iterator<Item = &'a Operation>) -> bool {
    code.filter(|o| is_written_out(&o.op)).count() <= INLINE
}

fn operations(code: &[Instruction]) -> impl Iterator<Item = &Operation> {
    code.iter().filter_map(|i| if let Instruction::Op(operation) = i { Some(operation) } else { None })
}

impl MachineCode {
    #[cfg(test)]
    pub(super) fn functions(&self) -> &Functions {
        &self.functions
    }

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
        self.functions.enter_rates(start, arrays(frame), (t, x, dx)) == 0
    }

    fn steps<const ALONG: bool>(&self, frame: &mut Frame, routine: &Routine) -> Result<(), SolveError> {
        // Conditions that are taken anew are for the bytecode.
        if [frame.conditions.clock, frame.conditions.state].contains(&Hold::Take) {
            return frame.part::<ALONG>(routine, &routine.code);
        }
        for step in &self.steps {
            match step {
                MachineStep::Segment(segment) => match self.functions.enter(segment.function, arrays(frame)) {
                    0 => {}
                    RARE => frame.part::<ALONG>(routine, &routine.code[segment.code.clone()])?,
                    status => return Err(SolveError::Vanished { guard: (status - STATUS_OF_GUARD) as u32 }),
                },
                MachineStep::Solve(solve) if !ALONG && frame.put_known_root(&routine.solves[*solve]) => {}
                MachineStep::Solve(solve) => {
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

impl InnerCode for InnerMachineCode {
    fn run(&self, frame: &mut Frame, solve: &Solve, along: bool) {
        for segment in &self.segments[usize::from(along)] {
            if self.functions.enter(segment.function, arrays(frame)) != 0 {
                let code = &solve.code[segment.code.clone()];
                if along { frame.plain::<true>(code) } else { frame.plain::<false>(code) }
            }
        }
    }
}

#[inline]
fn arrays(frame: &mut Frame) -> Operands<'_> {
    let keeps = |hold: Hold| u64::from(hold == Hold::Keep);
    let keep = keeps(frame.conditions.clock) | keeps(frame.conditions.state) << 1;
    let held = &frame.conditions.held[..];
    Operands { values: &mut frame.r, derivatives: &mut frame.d, held, tables: &frame.tables, keep }
}
