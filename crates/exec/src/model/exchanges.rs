//! Exchanges of independent variables: where one moves many times as fast as another that stays independent, as near a
//! dead centre, the two change places. Source: `method.md`, 5.8.

use super::compiled::ModeId;
use super::machine::Tiers;
use super::minimum_norm;
use super::recorded::Recorded;
use super::system::What;
use super::{Model, clauses::EventWork};
use crate::bytecode::{Frame, Hold, Layout, Routine};
use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::program::{Block, Exchanged, Op, Program, Told, Value};
use halfarrow_sim::{Failure, StepEnd};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Variables are exchanged where one moves so many times as fast as the one that stays independent,
const FAR: f64 = 10.0;
/// or so many times as fast where a step has failed, or where steps whose error nothing controls are long beside the way that is left
/// to a singular position:
const SOON: f64 = 1.2;
/// the ratio has grown so many times since it was looked at last;
const OUTGROWS: f64 = 1.1;
/// and then until none moves so many times as fast.
const NEAR: f64 = 1.1;
/// A ratio that changes its sign has passed a position where the independent variables do not tell the motion if it is so great on
/// both sides: where numerator and divisor vanish together, as in a flat parallelogram, it is rounding there, but not beside it.
const PASSED: f64 = 5.0;
/// What varies less than by this part of the greatest is rounding.
const ROUNDING: f64 = 1e-12;
/// Ratios are looked at where what they are divided by has come to less than this part of what it was when they were last.
const SMALLER: f64 = 0.95;
/// Which positions follow from others is decided anew where the determinant of their equations has come to a tenth, as a
/// logarithm.
const TURNING: f64 = std::f64::consts::LN_10;
/// So is it at a start where one of them moves so many times as far as what it follows from: as if a quaternion followed from one of
/// its numbers that is 0 there.
const LOST: f64 = 1e3;
/// and where it is further than this from where the start has it.
const COMPARED: f64 = 1e-6;
const ITERATIONS: usize = 20;

/// The ratios between variables that could be independent and those that are.
#[derive(Debug, Clone)]
pub(super) struct Ratios {
    independent: Vec<Exchanged>,
    dependent: Vec<Exchanged>,
    /// The registers of the states, or constants, that tell the independent ones.
    registers: Vec<u32>,
    /// Independent ones, then the dependent ones.
    routine: Routine,
    /// What ratios are divided by, where it varies.
    pub(super) pivots: Routine,
    /// Whether they are looked at whatever became of that.
    always: bool,
}

impl Ratios {
    pub fn of(program: &Program, layout: &Layout) -> Option<Ratios> {
        let ratios = program.ratios()?;
        let register = |told: Told| match told {
            Told::State(k) => layout.states + k,
            Told::Conserved(k) => layout.conserved + k,
        };
        Some(Ratios {
            registers: ratios.independent.iter().map(|k| register(k.2)).collect(),
            routine: layout.routine(program, &ratios.values()),
            pivots: layout.routine(program, &ratios.pivots),
            always: ratios.always,
            independent: ratios.independent.into_iter().map(|k| k.0).collect(),
            dependent: ratios.dependent.into_iter().map(|o| o.0).collect(),
        })
    }

    /// How many things that vary they are divided by.
    pub fn divisors(&self) -> usize {
        self.pivots.outputs.len()
    }

    pub fn routines(&self) -> [&Routine; 2] {
        [&self.routine, &self.pivots]
    }
}

impl Model {
    /// Whether a run may go on in another mode: in other independent variables, or with other branches of set-valued laws.
    pub fn may_change_mode(&self) -> bool {
        let first = self.compiled.first();
        let may = first.exchanges.is_some() || first.bounds.is_some() || !first.program.positions.is_empty();
        self.compiled.has_alternatives() && may
    }

    /// Looks whether other variables should be independent from `(t, x)` on, and makes them so: then `x` is the same
    /// position and motion in the new ones.
    pub(super) fn exchange(&mut self, t: f64, x: &mut [f64], step: StepEnd) -> Result<bool, Failure> {
        if self.variation.is_some() {
            self.outlive(t, x, step == StepEnd::Failed);
            return Ok(false);
        }
        if self.exchange_speeds(t, x, step)? {
            return Ok(true);
        }
        Ok(self.positions_turn() && self.exchange_positions(t, x)?)
    }

    /// Whether the equations of computed positions have come near to being singular, as where a position turns round that
    /// follows from others.
    fn positions_turn(&mut self) -> bool {
        let code = self.code.clone();
        let Some(motion) = code.motion.as_ref().filter(|_| self.compiled.has_alternatives()) else { return false };
        let Model { frame, run, compiled, .. } = self;
        let now = motion.blocks.iter().map(|(block, _)| frame.solvers[block.0 as usize].factors.log_determinant());
        if run.determinants.is_empty() {
            run.determinants.extend(now.clone());
            compiled.compare_with(run.mode, &mut run.determinants);
        }
        let mut turn = false;
        for (now, before) in now.zip(&mut run.determinants) {
            turn |= now < *before - TURNING;
            // What is not known at first counts from when it is.
            if now > *before || now < *before - TURNING || !before.is_finite() {
                *before = now;
            }
        }
        turn
    }

    /// Begins a run at the start `(t, x)` in states that tell it: which positions follow from others is decided before the start is
    /// known, at an estimate of it.
    pub fn begin_at_positions(&mut self, t: f64, x: &mut [f64]) {
        if !self.may_change_mode() || self.run.positions.is_empty() || self.variation.is_some() {
            return;
        }
        let code = self.code.clone();
        let states = code.program.tracked.iter().copied().zip(x.iter().copied());
        let positions = code.program.positions.iter().map(|position| position.symbol);
        let there: BTreeMap<Symbol, f64> = states.chain(positions.zip(self.run.positions.iter().copied())).collect();
        let (start, at) = (self.clone(), x.to_vec());
        let lost = self.are_positions_lost(t, x);
        *self = start.clone();
        let independent = code.exchanges.iter().flat_map(|ratios| ratios.independent.iter().map(|e| e.symbol));
        let mode = if lost { self.compiled.decided_at(&there, &code, independent.collect()) } else { None };
        let entered =
            mode.is_some_and(|mode| matches!(self.enter_at(mode, t, x, &there, start.recorded.chosen.len()), Ok(true)));
        if mode.is_some() && !entered {
            *self = start;
            x.copy_from_slice(&at);
        }
    }

    /// Whether a computed position is not where the start has it, or moves far more than a state that it follows from.
    fn are_positions_lost(&mut self, t: f64, x: &[f64]) -> bool {
        let code = self.code.clone();
        let positions: Vec<Value> = code.program.positions.iter().map(|position| position.value).collect();
        let routine = self.routine_for(&positions);
        let start = self.run.positions.clone();
        (0..x.len()).any(|state| {
            self.place(t, x);
            self.still();
            self.frame.d[code.layout.states as usize + state] = 1.0;
            let moved = self.frame.run_along(&routine);
            let lost = |(&r, start): (&u32, &f64)| {
                let (value, slope) = (self.frame.r[r as usize], self.frame.d[r as usize]);
                (value - start).abs() > COMPARED * start.abs().max(1.0) || slope.abs() > LOST
            };
            moved.is_err() || routine.outputs.iter().zip(&start).any(lost)
        })
    }

    /// Where positions that follow from others turn round, as the fourth number of a quaternion does, others have to follow:
    /// which ones do is decided anew at `(t, x)`.
    fn exchange_positions(&mut self, t: f64, x: &mut [f64]) -> Result<bool, Failure> {
        let code = self.code.clone();
        let independent = code.exchanges.iter().flat_map(|ratios| ratios.independent.iter().map(|e| e.symbol));
        // What is looked at on the way may lead the next solutions elsewhere.
        let (before, at) = (self.clone(), x.to_vec());
        let values = self.values_of_all(t, x)?;
        let exchanged = match self.compiled.decided_at(&values, &code, independent.collect()) {
            Some(mode) => self.go_over(mode, t, x, &values)?,
            None => false,
        };
        if !exchanged {
            *self = before;
            x.copy_from_slice(&at);
        }
        Ok(exchanged)
    }

    /// Derivatives are not taken over into other variables: they go on as far as the present ones do.
    fn outlive(&mut self, t: f64, x: &[f64], failed: bool) {
        let code = self.code.clone();
        let Some(ratios) = code.exchanges.as_ref().filter(|_| self.compiled.has_alternatives()) else { return };
        let most = if failed { SOON } else { FAR };
        if !self.is_due(ratios, t, x, failed) {
            return;
        }
        let steep = self.steepest(ratios, None, (t, x), true).is_some_and(|(now, _)| now.value.abs() > most);
        let outlived = steep && self.better(ratios, t, x, most).is_some();
        if let Some(variation) = &mut self.variation {
            variation.outlived = outlived;
        }
    }

    fn exchange_speeds(&mut self, t: f64, x: &mut [f64], step: StepEnd) -> Result<bool, Failure> {
        let code = self.code.clone();
        let Some(ratios) = code.exchanges.as_ref() else { return Ok(false) };
        let failed = step == StepEnd::Failed;
        let smaller = self.is_due(ratios, t, x, failed);
        if !smaller && !ratios.always {
            return Ok(false);
        }
        let before = self.run.steepest;
        let Some((now, at_before)) = self.steepest(ratios, before, (t, x), smaller) else {
            self.run.steepest = before.filter(|_| !smaller);
            return Ok(false);
        };
        self.run.steepest = Some(now);
        if before.is_some_and(|before| before.is_passed(at_before)) {
            return Err(self.passed(t));
        }
        let most = match step {
            StepEnd::Failed => SOON,
            StepEnd::Fixed if before.is_some_and(|before| now.outgrows(before)) => SOON,
            _ => FAR,
        };
        if now.value.abs() <= most || !self.compiled.has_alternatives() {
            return Ok(false);
        }
        let Some(wanted) = self.better(ratios, t, x, most) else {
            return Ok(false);
        };
        let values = self.values_of_all(t, x)?;
        match self.compiled.with_independent(&code, &wanted, &values) {
            Some(mode) => self.go_over(mode, t, x, &values),
            None => Ok(false),
        }
    }

    /// A position has been passed where the independent variables do not tell the motion: behind it the run has no meaning.
    fn passed(&self, time: f64) -> Failure {
        let program = &self.code.program;
        let tellers = program.ratios().map_or_else(String::new, |ratios| ratios.tellers(program));
        Failure::Singular { time, what: format!("what moves with {tellers}") }
    }

    /// Goes on in a mode with the same position and motion; `false`, with nothing changed, if it cannot tell them.
    pub(super) fn go_over(
        &mut self,
        mode: ModeId,
        t: f64,
        x: &mut [f64],
        values: &BTreeMap<Symbol, f64>,
    ) -> Result<bool, Failure> {
        let drifted = self.drift_before(t, x)?;
        let (before, at) = (self.clone(), x.to_vec());
        let changed = self.enter_at(mode, t, x, values, before.recorded.chosen.len());
        match changed {
            Ok(true) => self.keep_anew(drifted, t, x).map(|()| true),
            // Nothing has changed then.
            Ok(false) | Err(_) => {
                *self = before;
                x.copy_from_slice(&at);
                Ok(false)
            }
        }
    }

    /// How all of them move with what one register holds, in those of the routine; whether they have a value.
    fn move_by(&mut self, ratios: &Ratios, register: u32, t: f64, x: &[f64]) -> bool {
        self.place(t, x);
        self.still();
        self.frame.d[register as usize] = 1.0;
        self.frame.run_along(&ratios.routine).is_ok()
    }

    /// Whether ratios are to be looked at: since what they are divided by is smaller, or a step has failed.
    fn is_due(&mut self, ratios: &Ratios, t: f64, x: &[f64], failed: bool) -> bool {
        if !self.is_pivot_smaller(ratios, t, x) && !failed {
            return false;
        }
        self.run.pivots.clear();
        self.run.pivots.extend(ratios.pivots.outputs.iter().map(|&r| self.frame.r[r as usize]));
        true
    }

    /// Whether something that ratios are divided by is smaller than when they were last looked at, or has changed its
    /// sign. Takes no memory.
    fn is_pivot_smaller(&mut self, ratios: &Ratios, t: f64, x: &[f64]) -> bool {
        self.place(t, x);
        if self.once(What::Pivots, false).is_err() || self.run.pivots.is_empty() {
            return true;
        }
        let now = ratios.pivots.outputs.iter().map(|&r| self.frame.r[r as usize]);
        now.zip(&self.run.pivots).any(|(now, before)| (now / before).is_nan() || now / before <= SMALLER)
    }

    /// The greatest ratio of how variables move to how the independent ones do, and what it is now at the place where it was
    /// greatest before; `None` where they have no value. Takes no memory where each independent variable moves with a state of its
    /// own; they are not looked at otherwise unless it `may`.
    fn steepest(
        &mut self,
        ratios: &Ratios,
        before: Option<Steepest>,
        (t, x): (f64, &[f64]),
        may: bool,
    ) -> Option<(Steepest, Option<f64>)> {
        let n = ratios.independent.len();
        let (mut most, mut at_before) = (Steepest { row: 0, column: 0, value: 0.0 }, None);
        for (column, &register) in ratios.registers.iter().enumerate() {
            if !self.move_by(ratios, register, t, x) {
                return None;
            }
            let (own, others) = ratios.routine.outputs.split_at(n);
            let rate = |register: u32| self.frame.d[register as usize];
            // A momentum, or what is conserved, moves several of them: what follows from each is not seen from that alone.
            if own.iter().enumerate().any(|(i, &r)| i != column && rate(r) != 0.0) {
                let table = if may { self.table(ratios, t, x)? } else { return None };
                let value = |s: Steepest| table.ratios[s.row * n + s.column];
                let (row, column, _) = table.greatest()?;
                let most = Steepest { row, column, value: 0.0 };
                return Some((Steepest { value: value(most), ..most }, before.map(value)));
            }
            let unit = ratios.independent[column].weighs() * rate(own[column]);
            for (row, (dependent, &other)) in ratios.dependent.iter().zip(others).enumerate() {
                let value = dependent.weighs() * rate(other) / unit;
                if !value.is_finite() {
                    return None;
                }
                if value.abs() > most.value.abs() {
                    most = Steepest { row, column, value };
                }
                if before.is_some_and(|before| (before.row, before.column) == (row, column)) {
                    at_before = Some(value);
                }
            }
        }
        Some((most, at_before))
    }

    /// How the dependent variables move with the independent ones, all in their weights.
    fn table(&mut self, ratios: &Ratios, t: f64, x: &[f64]) -> Option<Table> {
        let (n, m) = (ratios.independent.len(), ratios.dependent.len());
        // Column by column: how all of them move with each state or constant.
        let mut columns = Vec::with_capacity(n);
        for &register in &ratios.registers {
            if !self.move_by(ratios, register, t, x) {
                return None;
            }
            let column: Vec<f64> = ratios.routine.outputs.iter().map(|&r| self.frame.d[r as usize]).collect();
            columns.push(column);
        }
        let mut table = Table::new(&columns, n, m)?;
        let weights: Vec<f64> = ratios.independent.iter().chain(&ratios.dependent).map(Exchanged::weighs).collect();
        table.weigh(&weights);
        Some(table)
    }

    /// The variables that should be independent instead of those that are, if some should.
    fn better(&mut self, ratios: &Ratios, t: f64, x: &[f64], most: f64) -> Option<Vec<Symbol>> {
        let (n, m) = (ratios.independent.len(), ratios.dependent.len());
        let mut table = self.table(ratios, t, x)?;
        let all: Vec<Exchanged> = ratios.independent.iter().chain(&ratios.dependent).copied().collect();
        if table.greatest().is_none_or(|(_, _, ratio)| ratio <= most) {
            return None;
        }
        let mut inside: Vec<usize> = (0..n).collect();
        let mut outside: Vec<usize> = (n..n + m).collect();
        for _ in 0..4 * (n + m) {
            match table.greatest() {
                Some((row, column, ratio)) if ratio > NEAR => {
                    table.exchange(row, column);
                    std::mem::swap(&mut outside[row], &mut inside[column]);
                }
                _ => break,
            }
        }
        let mut wanted: Vec<Symbol> = inside.into_iter().map(|k| all[k].symbol).collect();
        wanted.sort_unstable();
        Some(wanted)
    }

    /// All variables of the graph at `(t, x)`.
    pub(super) fn values_of_all(&mut self, t: f64, x: &[f64]) -> Result<BTreeMap<Symbol, f64>, Failure> {
        let code = self.code.clone();
        let (symbols, wanted): (Vec<Symbol>, Vec<Value>) = code.program.variables.iter().map(|(s, v)| (*s, *v)).unzip();
        let routine = self.routine_for(&wanted);
        self.place(t, x);
        self.frame.run(&routine).map_err(|error| self.failure(t, error))?;
        let values = routine.outputs.iter().map(|&r| self.frame.r[r as usize]);
        Ok(symbols.into_iter().zip(values).collect())
    }

    /// Changes the mode: code and registers, with parameters and inputs as they are set.
    pub(super) fn enter(&mut self, mode: ModeId) -> Result<(), Failure> {
        if self.variation.is_some() && mode != self.run.mode {
            return Err(self.undifferentiated_mode(self.run.crossed, std::iter::empty()));
        }
        let code = self.compiled.mode(mode);
        let names: Vec<&str> = self.recorded.chosen.iter().map(|&i| &*self.code.program.observed[i].name).collect();
        let observed = &code.program.observed;
        let chosen = names.iter().filter_map(|name| observed.iter().position(|o| *o.name == **name && o.value.is_ok()));
        let recorded = Arc::new(Recorded::new(&code, chosen.collect()));
        let bounds = self.frame.solvers.iter().map(|s| s.newton.most()).min();
        let mut frame = Frame::new(&code.program, &code.layout, code.layout.size);
        code.routines().for_each(|routine| frame.reserve(routine));
        // What the start has fixed belongs to the first mode, to which a new run returns.
        let run = &mut self.run;
        let zero = |n: usize| vec![0.0; n];
        let others = [code.program.conserved.len(), code.program.positions.len(), code.program.states.len()].map(zero);
        let next = if mode == ModeId::default() { run.first.take().unwrap_or(others) } else { others };
        let [conserved, positions, scales] = next;
        let left = [
            std::mem::replace(&mut run.conserved, conserved),
            std::mem::replace(&mut run.positions, positions),
            std::mem::replace(&mut run.scales, scales),
        ];
        if run.mode == ModeId::default() {
            run.first = Some(left);
        }
        run.mode = mode;
        run.floors = vec![0.0; code.program.conditions.len()];
        run.pivots.clear();
        run.pivots.reserve(code.exchanges.as_ref().map_or(0, Ratios::divisors));
        run.steepest = None;
        run.determinants.clear();
        run.determinants.reserve(code.motion.as_ref().map_or(0, |motion| motion.blocks.len()));
        self.events = EventWork::of(&code);
        self.tiers = Tiers::default();
        self.projection = None;
        let states = code.program.states.len();
        [&mut self.dx, &mut self.beside].into_iter().for_each(|room| room.resize(states, 0.0));
        (self.frame, self.recorded, self.code) = (frame, recorded, code);
        self.rated = None;
        self.reserve_recorded();
        if let Some(most) = bounds {
            self.bound_iterations(most);
        }
        self.frame.set.clone_from(&self.setup.parameters);
        let run = self.frame.run(&self.code.preamble.clone());
        run.map_err(|error| self.failure(f64::NAN, error))?;
        self.broken = self.first_broken().map_err(|error| self.failure(f64::NAN, error))?;
        self.place_constant_inputs();
        Ok(())
    }

    /// Goes on in another mode where the variables of the graph have these values. `false` if it cannot tell the same.
    fn enter_at(
        &mut self,
        mode: ModeId,
        t: f64,
        x: &mut [f64],
        values: &BTreeMap<Symbol, f64>,
        recorded: usize,
    ) -> Result<bool, Failure> {
        self.enter(mode)?;
        if self.broken.is_some() || self.recorded.chosen.len() != recorded {
            return Ok(false);
        }
        self.frame.conditions.clock = Hold::Follow;
        self.frame.conditions.state = Hold::Follow;
        self.handle_time_event(self.run.crossed);
        self.start_solutions_at(values);
        if !self.take_values(t, x, values)? {
            return Ok(false);
        }
        self.take_signs(t, x)?;
        self.follow_solutions(t, x)?;
        self.run.scales = self.magnitudes(t, x);
        self.follow_solutions(t, x)?;
        Ok(true)
    }

    /// Solutions of laws, and positions, are sought from where they are.
    pub(super) fn start_solutions_at(&mut self, values: &BTreeMap<Symbol, f64>) {
        let code = self.code.clone();
        for (symbol, &value) in &code.program.variables {
            let (Op::Solution(block, i), Some(&found)) = (code.program.values.op(value), values.get(symbol)) else {
                continue;
            };
            if matches!(code.program.blocks[block], Block::Newton { .. }) && found.is_finite() {
                self.start_solution(block.0 as usize, i as usize, found);
            }
        }
        for (kept, position) in self.run.positions.iter_mut().zip(&code.program.positions) {
            *kept = values.get(&position.symbol).copied().unwrap_or(0.0);
        }
    }

    /// States and constants at which the variables of the graph have these values: those that are variables themselves, then
    /// the others by Newton's method. `false` if there are none.
    fn take_values(&mut self, t: f64, x: &mut [f64], values: &BTreeMap<Symbol, f64>) -> Result<bool, Failure> {
        let code = self.code.clone();
        let (program, layout) = (&code.program, &code.layout);
        let mut open: Vec<(u32, Value, f64)> = Vec::new();
        let told = program.tracked.iter().chain(&program.replaced);
        let registers = (layout.states..).take(x.len()).chain(layout.conserved..);
        let idle = program.tracked.len()..x.len();
        let registers = registers.enumerate().filter(|(k, _)| !idle.contains(k));
        for (symbol, (k, register)) in told.zip(registers) {
            let (Some(&value), Some(&known)) = (program.variables.get(symbol), values.get(symbol)) else {
                return Ok(false);
            };
            match layout.registers.get(value) {
                Some(own) if own == register && k < x.len() => x[k] = known,
                _ => open.push((register, value, known)),
            }
        }
        let wanted: Vec<Value> = open.iter().map(|o| o.1).collect();
        let routine = self.routine_for(&wanted);
        let n = open.len();
        for _ in 0..ITERATIONS {
            let mut matrix = vec![0.0; n * n];
            let mut missed = vec![0.0; n];
            for column in 0..n {
                self.place(t, x);
                self.still();
                self.frame.d[open[column].0 as usize] = 1.0;
                self.frame.run_along(&routine).map_err(|error| self.failure(t, error))?;
                for (row, &out) in routine.outputs.iter().enumerate() {
                    matrix[row * n + column] = self.frame.d[out as usize];
                    missed[row] = self.frame.r[out as usize] - open[row].2;
                }
            }
            if missed.iter().zip(&open).all(|(m, o)| m.abs() <= 4.0 * f64::EPSILON * o.2.abs()) {
                return Ok(true);
            }
            let Some(step) = minimum_norm::step(&matrix, &missed, n) else { return Ok(false) };
            let mut moved = false;
            for (step, &(register, ..)) in step.step.iter().zip(&open) {
                let conserved = layout.conserved;
                let place = match register >= layout.states {
                    true => &mut x[(register - layout.states) as usize],
                    false => &mut self.run.conserved[(register - conserved) as usize],
                };
                moved |= step.abs() > 4.0 * f64::EPSILON * place.abs();
                *place += step;
            }
            if !moved {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// The greatest ratio of how a dependent variable moves to how an independent one does, in their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Steepest {
    /// Which dependent variable,
    row: usize,
    /// and which independent one.
    column: usize,
    value: f64,
}

impl Steepest {
    /// Whether the same ratio has grown from `before` so that some steps more lead beyond all bounds.
    fn outgrows(self, before: Steepest) -> bool {
        let same = (self.row, self.column) == (before.row, before.column);
        same && self.value * before.value > 0.0 && self.value.abs() >= OUTGROWS * before.value.abs()
    }

    /// Whether it has become `now` through all bounds.
    fn is_passed(self, now: Option<f64>) -> bool {
        now.is_some_and(|now| now * self.value < 0.0 && now.abs().min(self.value.abs()) > PASSED)
    }
}

/// How variables move with others: dependent ones by row, independent ones by column.
struct Table {
    columns: usize,
    ratios: Vec<f64>,
}

impl Table {
    /// From how both move with states: columns over the `n` independent ones and the `m` others.
    fn new(columns: &[Vec<f64>], n: usize, m: usize) -> Option<Table> {
        // others = R · independent: solved row by row with the transposed matrix of the independent ones.
        let transposed: Vec<f64> = columns.iter().flat_map(|c| c[..n].to_vec()).collect();
        let mut ratios = Vec::with_capacity(n * m);
        for row in n..n + m {
            let right: Vec<f64> = columns.iter().map(|c| c[row]).collect();
            if right.iter().all(|v| *v == 0.0) {
                ratios.extend(std::iter::repeat_n(0.0, n));
                continue;
            }
            let solved = minimum_norm::step(&transposed, &right, n)?;
            ratios.extend(solved.step.iter().map(|s| -s));
        }
        ratios.iter().all(|r| r.is_finite()).then_some(Table { columns: n, ratios })
    }

    /// Multiplies each variable by its weight.
    fn weigh(&mut self, weights: &[f64]) {
        let n = self.columns;
        for (k, ratio) in self.ratios.iter_mut().enumerate() {
            *ratio *= weights[n + k / n] / weights[k % n];
        }
    }

    /// The greatest ratio: row, column, magnitude.
    fn greatest(&self) -> Option<(usize, usize, f64)> {
        let all = self.ratios.iter().enumerate().map(|(k, r)| (k / self.columns, k % self.columns, r.abs()));
        all.fold(
            None,
            |most: Option<(usize, usize, f64)>, one| if most.is_none_or(|m| one.2 > m.2) { Some(one) } else { most },
        )
    }

    /// The variables of a row and a column change places.
    fn exchange(&mut self, row: usize, column: usize) {
        let n = self.columns;
        let pivot = self.ratios[row * n + column];
        let pivot_row: Vec<f64> = self.ratios[row * n..][..n].to_vec();
        let others = self.ratios.chunks_mut(n).enumerate().filter(|(r, _)| *r != row);
        for ratios in others.map(|(_, ratios)| ratios) {
            let factor = ratios[column] / pivot;
            for (k, ratio) in ratios.iter_mut().enumerate() {
                let size = ratio.abs();
                *ratio = if k == column { factor } else { *ratio - factor * pivot_row[k] };
                if k != column && ratio.abs() <= ROUNDING * size {
                    *ratio = 0.0;
                }
            }
        }
        for (k, ratio) in self.ratios[row * n..][..n].iter_mut().enumerate() {
            *ratio = if k == column { 1.0 / pivot } else { -pivot_row[k] / pivot };
        }
    }
}
