//! Registers for the values of a routine: fixed ones for what stands before any routine runs, others given away again as
//! soon as nothing reads them any more.

use super::instruction::{Instruction, Operation, Register, Routine, Solve};
use halfarrow_compiler::ids::Id;
use halfarrow_compiler::program::{self, Arg, Code, Method, Op, Program, Step, Value};
use rustc_hash::FxHashMap;
use std::ops::Index;
use std::sync::Arc;

/// Registers that keep their contents between routines: parameters, constants and what is computed from them; time,
/// inputs, held signals, conserved constants, states, positions at the start, each group in order.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Layout {
    /// The register of each value that has a fixed one.
    pub registers: Fixed,
    /// Constants and their registers.
    pub constants: Vec<(Register, f64)>,
    /// First register of the parameters.
    pub parameters: Register,
    /// Register of time.
    pub time: Register,
    /// First register of the inputs.
    pub inputs: Register,
    /// First register of the held signals.
    pub held: Register,
    /// First register of the conserved constants.
    pub conserved: Register,
    /// First register of the states.
    pub states: Register,
    /// First register of their rates; there are some only in implicit form.
    pub rates: Register,
    /// First register of the positions that are unknowns at the start.
    pub positions: Register,
    /// Number of fixed registers.
    pub size: u32,
    /// The values of parameters alone, in order.
    determined: Vec<Value>,
}

/// The fixed registers of values, by value.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Fixed(Vec<Register>);

impl Fixed {
    /// The register of a value, if it has a fixed one.
    pub fn get(&self, value: Value) -> Option<Register> {
        self.0.get(value.index()).copied().filter(|&register| register != NONE)
    }

    fn insert(&mut self, value: Value, register: Register) {
        self.0[value.index()] = register;
    }
}

impl Index<Value> for Fixed {
    type Output = Register;
    fn index(&self, value: Value) -> &Register {
        &self.0[value.index()]
    }
}

impl Layout {
    /// The fixed registers of a program where these values are wanted besides its own.
    pub fn new(program: &Program, more: &[Value]) -> Layout {
        let registers = Fixed(vec![NONE; program.values.len()]);
        let mut layout = Layout { determined: program.determined(more), registers, ..Layout::default() };
        let mut next = program.parameters.len() as u32;
        for &value in &layout.determined {
            match program.values.op(value) {
                Op::Parameter(_) => continue,
                Op::Constant(bits) => layout.constants.push((next, bits.number())),
                _ => {}
            }
            layout.registers.insert(value, next);
            next += 1;
        }
        layout.time = next;
        layout.inputs = next + 1;
        layout.held = layout.inputs + program.inputs.len() as u32;
        layout.conserved = layout.held + program.held.len() as u32;
        layout.states = layout.conserved + program.conserved.len() as u32;
        layout.rates = layout.states + program.states.len() as u32;
        layout.positions = layout.rates + if program.implicit.is_some() { program.states.len() as u32 } else { 0 };
        layout.size = layout.positions + program.positions.len() as u32;
        let positions = program.positions.iter().zip(layout.positions..);
        positions.for_each(|(position, register)| layout.registers.insert(position.value, register));
        for (value, op) in program.values.iter() {
            let register = match op {
                Op::Parameter(i) => layout.parameters + i,
                Op::Time => layout.time,
                Op::Input(i) => layout.inputs + i,
                Op::Held(i) => layout.held + i,
                Op::Conserved(i) => layout.conserved + i,
                Op::State(i) => layout.states + i,
                Op::Rate(i) => layout.rates + i,
                _ => continue,
            };
            layout.registers.insert(value, register);
        }
        layout
    }

    /// The code that computes all that reads parameters alone, into its fixed registers; divisors among it are guarded.
    pub fn preamble(&self, program: &Program) -> Routine {
        let routine = program.preamble(&self.determined);
        let mut fixed = FxHashMap::default();
        for (value, output) in routine.wanted.iter().zip(&routine.code.outputs) {
            if let Arg::Local(local) = *output {
                fixed.insert(local.0, self.registers[*value]);
            }
        }
        Allocator::new(self, &fixed).routine(routine.code)
    }

    /// The code that computes the wanted values from the fixed registers.
    pub fn routine(&self, program: &Program, wanted: &[Value]) -> Routine {
        Allocator::new(self, &FxHashMap::default()).routine(program.routine(wanted).code)
    }

    /// The same at the start of a run, where positions stand in fixed registers.
    pub fn start_routine(&self, program: &Program, wanted: &[Value]) -> Routine {
        Allocator::new(self, &FxHashMap::default()).routine(program.start_routine(wanted).code)
    }

    /// The code of a routine with a register of its own for every value, so that all are there when it has run.
    pub fn keeping(&self, source: &Code) -> Routine {
        let fixed = FxHashMap::default();
        Allocator { keeps: true, ..Allocator::new(self, &fixed) }.routine(source.clone())
    }

    /// The same with some of the values at places of their own, from `next` on those that have [none](NONE).
    pub fn placed(&self, source: &Code, places: Vec<Register>, next: Register) -> Routine {
        let fixed = FxHashMap::default();
        let allocator = Allocator { keeps: true, next, ..Allocator::new(self, &fixed) };
        allocator.placed(source.clone(), places)
    }

    /// The same, with all divisors guarded that vary.
    pub fn guarded_routine(&self, program: &Program, wanted: &[Value]) -> Routine {
        Allocator::new(self, &FxHashMap::default()).routine(program.guarded_routine(wanted).code)
    }
}

/// No register yet.
pub(super) const NONE: u32 = u32::MAX;
/// Read after the last step.
const END: u32 = u32::MAX - 1;

/// The values of some code: where they stand, and which step reads them last.
#[derive(Default)]
struct Places {
    register: Vec<Register>,
    last: Vec<u32>,
    /// The guess of a Newton block, and what it reads from outside.
    guess: Vec<Register>,
    outer: Vec<Register>,
}

impl Places {
    fn of(code: &Code) -> Places {
        let none = vec![NONE; code.values.len()];
        let mut places = Places { register: none.clone(), last: none, ..Places::default() };
        for (step, at) in code.steps.iter().zip(0..) {
            step.for_each_read(|a| places.note(a, at));
        }
        code.outputs.iter().for_each(|&a| places.note(a, END));
        places
    }

    fn note(&mut self, a: Arg, at: u32) {
        if let Arg::Local(local) = a {
            self.last[local.index()] = at;
        }
    }
}

struct Allocator<'a> {
    layout: &'a Layout,
    /// The fixed registers of locals that have some.
    fixed: &'a FxHashMap<u32, Register>,
    free: Vec<Register>,
    next: Register,
    solves: Vec<Solve>,
    /// Whether no register is given away again.
    keeps: bool,
}

impl<'a> Allocator<'a> {
    fn new(layout: &'a Layout, fixed: &'a FxHashMap<u32, Register>) -> Self {
        Allocator { layout, fixed, free: Vec::new(), next: layout.size, solves: Vec::new(), keeps: false }
    }

    fn routine(self, source: Code) -> Routine {
        let mut registers = vec![NONE; source.values.len()];
        self.fixed.iter().for_each(|(&local, &register)| registers[local as usize] = register);
        self.placed(source, registers)
    }

    fn placed(mut self, source: Code, registers: Vec<Register>) -> Routine {
        let mut places = Places { register: registers, ..Places::of(&source) };
        let code = source.steps.iter().zip(0..).map(|(step, at)| self.step(step, at, &mut places)).collect();
        let outputs = source.outputs.iter().map(|&a| self.register(&places, a)).collect();
        Routine { code, outputs, solves: self.solves, registers: self.next, source }
    }

    fn step(&mut self, step: &Step, at: u32, places: &mut Places) -> Instruction {
        match step {
            Step::Op { out, op } => Instruction::Op(self.operation(out.index(), *op, at, places)),
            Step::Parameter { out, index, default: value } => {
                let default = self.register(places, *value);
                self.release(places, *value, at);
                Instruction::Parameter { out: self.define(places, out.index()), index: *index, default }
            }
            Step::Guard { guard, pivot: divisor, scale: size } => {
                let [pivot, scale] = [*divisor, *size].map(|a| self.register(places, a));
                [*divisor, *size].into_iter().for_each(|a| self.release(places, a, at));
                Instruction::Guard { pivot, scale, guard: *guard }
            }
            Step::Solve(solve) => {
                let solve = self.solve(solve, at, places);
                self.solves.push(solve);
                Instruction::Solve { solve: self.solves.len() as u32 - 1 }
            }
        }
    }

    fn operation(&mut self, out: usize, op: Op<Arg>, at: u32, places: &mut Places) -> Operation {
        let on_registers = op.map_operands(|a| self.register(places, a));
        op.for_each_operand(|a| self.release(places, a, at));
        Operation { out: self.define(places, out), op: on_registers }
    }

    /// The code of a Newton block.
    fn inside(&mut self, code: &Code, places: &mut Places) -> Vec<Operation> {
        let operations = code.steps.iter().zip(0..).map(|(step, at)| match step {
            Step::Op { out, op } => self.operation(out.index(), *op, at, places),
            _ => unreachable!("Newton blocks hold operations alone"),
        });
        operations.collect()
    }

    fn solve(&mut self, solve: &program::Solve, at: u32, places: &mut Places) -> Solve {
        let mut inside = Places::default();
        let of = |this: &Self, args: &[Arg], places: &Places| -> Vec<Register> {
            args.iter().map(|&a| this.register(places, a)).collect()
        };
        let (mut shared, mut operations) = (None, Vec::new());
        let (right, matrix) = match &solve.method {
            Method::Linear { shared: with, matrix, right } => {
                shared = *with;
                (of(self, right, places), of(self, matrix, places))
            }
            Method::Newton { outer, code } => {
                inside = Places::of(code);
                inside.guess = (0..solve.unknowns.len()).map(|_| self.take()).collect();
                inside.outer = of(self, outer, places);
                operations = self.inside(code, &mut inside);
                let mut right = of(self, &code.outputs, &inside);
                let matrix = right.split_off(solve.unknowns.len());
                (right, matrix)
            }
        };
        // Unknowns stand apart from all that the block reads.
        let unknowns: Vec<Register> = solve.unknowns.iter().map(|u| self.place(places, u.index())).collect();
        self.free.extend(&inside.guess);
        for unknown in &solve.unknowns {
            self.release_unread(places, unknown.index());
        }
        if let Method::Newton { code, .. } = &solve.method {
            code.outputs.iter().for_each(|&a| self.release(&mut inside, a, END));
        }
        solve.reads().for_each(|a| self.release(places, a, at));
        Solve {
            block: solve.block,
            shared,
            unknowns,
            guess: inside.guess,
            outer: inside.outer,
            code: operations,
            matrix,
            pattern: Arc::clone(&solve.pattern),
            right,
        }
    }

    fn register(&self, places: &Places, a: Arg) -> Register {
        match a {
            Arg::Given(value) => self.layout.registers[value],
            Arg::Local(local) => places.register[local.index()],
            Arg::Outer(i) => places.outer[i as usize],
            Arg::Guess(i) => places.guess[i as usize],
        }
    }

    /// The register of a local that a step defines.
    fn define(&mut self, places: &mut Places, local: usize) -> Register {
        let register = self.place(places, local);
        self.release_unread(places, local);
        register
    }

    fn place(&mut self, places: &mut Places, local: usize) -> Register {
        if places.register[local] == NONE {
            places.register[local] = self.take();
        }
        places.register[local]
    }

    fn take(&mut self) -> Register {
        self.free.pop().filter(|_| !self.keeps).unwrap_or_else(|| {
            self.next += 1;
            self.next - 1
        })
    }

    fn release_unread(&mut self, places: &Places, local: usize) {
        if places.last[local] == NONE && places.register[local] >= self.layout.size {
            self.free.push(places.register[local]);
        }
    }

    /// Frees the register of a value that is read for the last time here.
    fn release(&mut self, places: &mut Places, a: Arg, at: u32) {
        let Arg::Local(local) = a else { return };
        let (register, last) = (places.register[local.index()], &mut places.last[local.index()]);
        if *last == at && register >= self.layout.size {
            *last = NONE;
            self.free.push(register);
        }
    }
}
