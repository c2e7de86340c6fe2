//! Impulses: what storages keep after an event follows from what they kept before it, the resets, and what the junction
//! structure lets through.

use super::{DelayOrSample, Model, minimum_norm};
use crate::bytecode::{Layout, Routine};
use halfarrow_compiler::program::{Jumps, Program, Target, Value};
use halfarrow_sim::Failure;

/// Passes of Newton.
const ITERATIONS: usize = 50;
/// A relative step that has to shrink, or is what rounding leaves.
const NOISE: f64 = 1e-9;
/// A relative step that is rounding.
const SETTLED: f64 = 4.0 * f64::EPSILON;
/// How well the resets are met, as part of what is asked for.
const MET: f64 = 1e-9;

/// The balance of impulses as code.
#[derive(Debug, Clone)]
pub(super) struct ImpulseBalance {
    jumps: Jumps,
    /// Computes what storages keep, alone.
    stored: Routine,
    /// The same, then all factors of balances and of impulses, then what resets change.
    all: Routine,
    /// What resets change, in the order of their places in `all`.
    moved: Vec<Value>,
}

/// A reset of the round: the place of what it changes among the outputs, the value that it asks for, its impulse.
struct Asked {
    output: usize,
    value: f64,
    impulse: usize,
}

impl ImpulseBalance {
    pub fn of(program: &Program, layout: &Layout) -> Option<ImpulseBalance> {
        let jumps = program.jumps.clone()?;
        let moved = program.clauses.iter().flat_map(|c| &c.actions).filter_map(|a| match a.target {
            Target::Moved { what, .. } => Some(what),
            _ => None,
        });
        let mut moved: Vec<Value> = moved.collect();
        moved.sort_unstable();
        moved.dedup();
        let all: Vec<Value> = jumps.values().chain(moved.iter().copied()).collect();
        let (stored, all) = (layout.routine(program, &jumps.stored), layout.routine(program, &all));
        Some(ImpulseBalance { jumps, stored, all, moved })
    }

    pub fn routine(&self) -> &Routine {
        &self.all
    }

    fn unknowns(&self) -> usize {
        self.jumps.unknowns.len()
    }
}

impl Model {
    /// Keeps in mind what storages keep.
    pub(super) fn take_stored(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(balance) = &code.impulses else { return Ok(()) };
        self.place(t, x);
        self.frame.run(&balance.stored).map_err(|error| self.failure(t, error))?;
        let Model { events, frame, .. } = self;
        let outputs = balance.stored.outputs.iter();
        events.stored.iter_mut().zip(outputs).for_each(|(stored, &r)| *stored = frame.r[r as usize]);
        Ok(())
    }

    /// Gives states and conserved constants the values after the round, and tells the impulses; those of one instant add up,
    /// of which this is the `first` round.
    pub(super) fn balance_impulses(&mut self, t: f64, x: &mut [f64], first: bool) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(balance) = &code.impulses else { return Ok(()) };
        let asked = self.asked(balance);
        let (n, m) = (balance.unknowns(), balance.unknowns() + asked.len());
        if m == 0 {
            return Ok(());
        }
        let mut impulses = vec![0.0; asked.len()];
        let (mut last, mut met) = (f64::INFINITY, false);
        for _ in 0..ITERATIONS {
            let (matrix, residual) = self.balanced(t, x, balance, &asked, &impulses)?;
            met = residual.iter().all(|r| *r == 0.0);
            if met {
                break;
            }
            let Some(step) = minimum_norm::step(&matrix, &residual, m) else { break };
            if step.rank < m {
                return Err(self.dependent_resets(t));
            }
            let mut length = 0.0f64;
            for (&u, s) in balance.jumps.unknowns.iter().zip(&step.step) {
                let value = self.unknown_mut(x, u);
                length = length.max(s.abs() / value.abs().max(s.abs()).max(f64::MIN_POSITIVE));
                *value += s;
            }
            impulses.iter_mut().zip(&step.step[n..]).for_each(|(p, s)| *p += s);
            met = length <= SETTLED || length < NOISE && length >= 0.5 * last;
            if met {
                break;
            }
            last = length;
        }
        self.place(t, x);
        self.frame.run(&balance.all).map_err(|error| self.failure(t, error))?;
        let now = |a: &Asked| self.frame.r[balance.all.outputs[a.output] as usize];
        let fits = |a: &Asked| (now(a) - a.value).abs() <= MET * now(a).abs().max(a.value.abs());
        if !(met && asked.iter().all(fits)) {
            return Err(self.unmet_resets(t));
        }
        if first {
            for impulse in &balance.jumps.impulses {
                self.run.delays_and_samples[impulse.held as usize] =
                    match Model::is_reset(&asked, balance, impulse.held) {
                        true => DelayOrSample::Discrete(0.0),
                        false => continue,
                    };
            }
        }
        for (a, p) in asked.iter().zip(impulses) {
            let held = balance.jumps.impulses[a.impulse].held as usize;
            if let DelayOrSample::Discrete(value) = &mut self.run.delays_and_samples[held] {
                *value += p;
            }
        }
        Ok(())
    }

    fn is_reset(asked: &[Asked], balance: &ImpulseBalance, held: u32) -> bool {
        asked.iter().any(|a| balance.jumps.impulses[a.impulse].held == held)
    }

    /// The resets of the round, each thing once.
    fn asked(&self, balance: &ImpulseBalance) -> Vec<Asked> {
        let first = balance.all.outputs.len() - balance.moved.len();
        let mut asked: Vec<Asked> = Vec::new();
        for (_, at, action) in Model::actions(&self.code, &self.events) {
            let Target::Moved { what, impulse } = action.target else { continue };
            let output = first + balance.moved.binary_search(&what).expect("it is among what resets change");
            if asked.iter().all(|a| a.output != output) {
                asked.push(Asked { output, value: self.events.values[at], impulse: impulse as usize });
            }
        }
        asked
    }

    fn unknown_mut<'m>(&'m mut self, x: &'m mut [f64], unknown: u32) -> &'m mut f64 {
        let states = x.len();
        match (unknown as usize).checked_sub(states) {
            None => &mut x[unknown as usize],
            Some(constant) => &mut self.run.conserved[constant],
        }
    }

    /// Residuals of balances and resets, with their derivatives by the unknowns and by the impulses, row by row.
    fn balanced(
        &mut self,
        t: f64,
        x: &[f64],
        balance: &ImpulseBalance,
        asked: &[Asked],
        impulses: &[f64],
    ) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        let jumps = &balance.jumps;
        let (n, m) = (balance.unknowns(), balance.unknowns() + asked.len());
        let rows = jumps.balances.len();
        let (mut matrix, mut residual) = (vec![0.0; (rows + asked.len()) * m], vec![0.0; rows + asked.len()]);
        let before = self.events.stored.clone();
        for column in 0..n.max(1) {
            self.place(t, x);
            self.still();
            if let Some(&unknown) = jumps.unknowns.get(column) {
                let layout = &self.code.layout;
                let constant = (unknown as usize).checked_sub(x.len());
                let register = constant.map_or(layout.states + unknown, |c| layout.conserved + c as u32);
                self.frame.d[register as usize] = 1.0;
            }
            self.frame.run_along(&balance.all).map_err(|error| self.failure(t, error))?;
            let at = |output: usize| {
                let register = balance.all.outputs[output] as usize;
                (self.frame.r[register], self.frame.d[register])
            };
            let mut factor = jumps.stored.len();
            for (row, terms) in jumps.balances.iter().enumerate() {
                let (mut sum, mut slope) = (0.0, 0.0);
                for &(k, _) in terms {
                    let ((c, dc), (stored, change)) = (at(factor), at(k as usize));
                    let jump = stored - before[k as usize];
                    (sum, slope) = (sum + c * jump, slope + c * change + dc * jump);
                    factor += 1;
                }
                residual[row] = sum;
                if column < n {
                    matrix[row * m + column] = slope;
                }
            }
            for (i, impulse) in jumps.impulses.iter().enumerate() {
                let place = asked.iter().position(|a| a.impulse == i);
                for &(row, _) in &impulse.along {
                    let (c, dc) = at(factor);
                    factor += 1;
                    let Some(place) = place else { continue };
                    residual[row as usize] -= c * impulses[place];
                    matrix[row as usize * m + n + place] = -c;
                    if column < n {
                        matrix[row as usize * m + column] -= dc * impulses[place];
                    }
                }
            }
            for (k, a) in asked.iter().enumerate() {
                let (value, slope) = at(a.output);
                residual[rows + k] = value - a.value;
                if column < n {
                    matrix[(rows + k) * m + column] = slope;
                }
            }
        }
        Ok((matrix, residual))
    }

    pub(super) fn what_is_reset(&self) -> String {
        let moved = Model::actions(&self.code, &self.events);
        let moved = moved.filter(|(.., a)| !matches!(a.target, Target::Discrete(_)));
        let mut names: Vec<&str> = moved.map(|(.., a)| a.name.as_str()).collect();
        names.dedup();
        if names.is_empty() { "what storages keep".into() } else { names.join(", ") }
    }

    fn dependent_resets(&self, time: f64) -> Failure {
        let reason = "what is reset depends on each other there, or nothing that keeps an impulse takes part: reset one of \
                      those that move together";
        Failure::Reset { time, what: self.what_is_reset(), reason: reason.into() }
    }

    fn unmet_resets(&self, time: f64) -> Failure {
        let reason = "no impulse leads to the values that are asked for: look whether the laws of the storages have values \
                      there, and whether a constraint stands against them";
        Failure::Reset { time, what: self.what_is_reset(), reason: reason.into() }
    }
}
