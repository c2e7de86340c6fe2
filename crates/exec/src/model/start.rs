//! Consistent start values: the given ones hold, the others are solved for by Gauss-Newton iteration of minimum norm, and
//! what remains undetermined is zero, or as guessed.

use super::equilibrium::exchanged;
use super::minimum_norm;
use super::{Model, StartConflict, StartError, StartValue};
use crate::bytecode::{Layout, Routine};
use halfarrow_compiler::program::{Op, Program, StartGroup, StartGuess, Value};
use halfarrow_sim::{Affected, Failure};
use std::collections::{BTreeMap, BTreeSet};

/// A start condition is met if its residual is below this fraction of the sum of its terms' magnitudes.
const MET: f64 = 1e-9;
/// Relative rounding error of an unknown whose exact value is 0, beside the largest unknown of its group.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Relative rounding error of a sum, beside what it adds up.
const TERMS: f64 = 4.0 * f64::EPSILON;
/// Weight of a constraint relative to a start value in the least-squares solution of contradicting conditions.
const FIRM: f64 = 1e4;
/// Most passes over the conditions that have one open unknown.
const PASSES: usize = 30;
const ITERATIONS: usize = 60;
/// First guesses of open unknowns: zero; then points beside it, where laws that are flat at zero have a slope. From the fifth
/// on each unknown of a group gets a slightly larger one than the unknown before, to break symmetry.
const FIRST_GUESSES: [f64; 10] = [0.0, 1e-6, 1e-3, 1.0, -1.0, -1e-3, 30.0, -30.0, 1e3, -1e3];
/// Largest offset of a first guess from the value that the modeller guesses.
const BESIDE: f64 = 1e-3;
/// A derivative below this fraction of the largest one by the same unknown is rounding error.
const NOISE: f64 = 1e-14;
/// A state whose own size changes a rate by less than this part of it acts on it by rounding alone.
const ROUNDED: f64 = 1e-12;
/// Largest trusted ratio of an extrapolated to a given magnitude: beyond it lie directions with next to no stiffness.
const FAR: f64 = 1e3;
/// Beyond so many times what is asked for, or 1, no start value is meant.
const BEYOND: f64 = 1e12;
/// A condition that nobody asks for counts no more where its derivatives are below this part of what they were.
const LOST_FROM_SIGHT: f64 = 1e-9;
/// How many times what derivatives make of them at most rates may be for equations to be about linear.
const UNLIKE: f64 = 10.0;
/// Halvings of the way to the equilibrium of linearised equations: exponential laws are far from linear all along.
const HALVINGS: usize = 100;
/// Models with more states are not linearised to estimate typical magnitudes.
const MOST_LINEARISED: usize = 200;

/// The unknowns of the start: states, then conserved constants, then positions that iterations determine later on.
#[derive(Clone)]
struct Unknowns {
    /// Their values; of those that are not known the first guesses.
    z: Vec<f64>,
    guessed: Vec<bool>,
    known: Vec<bool>,
    /// Start conditions from which an unknown was solved.
    met: Vec<bool>,
}

/// A group of start conditions at the start time, with the routine for its residuals.
#[derive(Clone, Copy)]
struct GroupAtTime<'a> {
    t: f64,
    routine: &'a Routine,
    group: &'a StartGroup,
}

/// A holonomic constraint, with the routine for its residual.
pub(super) struct ConstraintResidual {
    group: StartGroup,
    routine: Routine,
}

impl Model {
    /// The state at the start of a run at `t`, which meets all start conditions; unknowns that they leave free are as
    /// near to zero, or to what is guessed, as they allow. Fixes the conserved constants, and the positions from which
    /// iterations go on. The run starts anew.
    ///
    /// # Errors
    /// Start values that contradict each other, with fitting ones.
    pub fn initialise(&mut self, t: f64) -> Result<Vec<f64>, StartError> {
        self.restart();
        if let Some(failure) = self.broken() {
            return Err(StartError::Failure(failure));
        }
        self.check_asked()?;
        let x = self.search_start(t)?;
        if self.scaled {
            self.run.scales = self.magnitudes(t, &x);
        }
        self.vary_start(t, &x)?;
        Ok(x)
    }

    fn search_start(&mut self, t: f64) -> Result<Vec<f64>, StartError> {
        let states = self.code.program.states.len();
        let n = self.code.program.start_unknowns();
        let mut z = vec![0.0; n];
        for _ in 0..20 {
            let mut unknowns = self.begin_search(t, n);
            self.solve_direct(t, &mut unknowns)?;
            self.solve_groups(t, &mut unknowns)?;
            let settled = z == unknowns.z;
            z = unknowns.z;
            self.give(&z);
            self.start_at_positions();
            if self.run.delays_and_samples.is_empty() || settled {
                break;
            }
            // Delayed and sampled signals start with their values at the start.
            self.begin_delays_and_samples(t, &z[..states]).map_err(StartError::Failure)?;
        }
        z.truncate(states);
        Ok(z)
    }

    /// Puts constants and positions of the start where they are read.
    fn give(&mut self, z: &[f64]) {
        let (conserved, positions) = z[self.code.program.states.len()..].split_at(self.run.conserved.len());
        self.run.conserved.copy_from_slice(conserved);
        self.run.positions.copy_from_slice(positions);
        let first = self.code.layout.positions as usize;
        self.frame.r[first..][..positions.len()].copy_from_slice(positions);
    }

    /// The positions found last with the rates are those from which a start goes on.
    pub(super) fn keep_positions(&mut self) {
        let Model { run, frame, code, .. } = self;
        let solved: Vec<u32> = code.rates.solves.iter().map(|solve| solve.block.0).collect();
        for (position, kept) in code.program.positions.iter().zip(&mut run.positions) {
            if !solved.contains(&position.block.0) {
                continue;
            }
            let newton = &mut frame.solvers[position.block.0 as usize].newton;
            *kept = newton.x[position.unknown as usize];
        }
        self.start_at_positions();
    }

    /// The unknowns at their first guesses, none of them known.
    fn begin_search(&mut self, t: f64, n: usize) -> Unknowns {
        let mut z = vec![0.0; n];
        let mut guessed = vec![false; n];
        let guesses = self.code.program.guesses.clone();
        guesses.iter().for_each(|guess| guessed[guess.unknown as usize] = true);
        for together in beside_each_other(&guesses) {
            if self.place_guesses(t, together, &mut z).is_none() && together.len() > 1 {
                together.chunks(1).for_each(|guess| _ = self.place_guesses(t, guess, &mut z));
            }
        }
        let met = vec![false; self.code.program.start.len()];
        Unknowns { z, guessed, known: vec![false; n], met }
    }

    /// Moves unknowns to where they are guessed, none of which another of these guesses reads. `None` where one of them has no
    /// value.
    fn place_guesses(&mut self, t: f64, together: &[StartGuess], z: &mut [f64]) -> Option<()> {
        let residuals: Vec<Value> = together.iter().map(|guess| guess.residual).collect();
        let unknowns: Vec<usize> = together.iter().map(|guess| guess.unknown as usize).collect();
        let routine = self.start_routine(&residuals);
        self.residuals(t, &routine, z, Some(&unknowns)).ok()?;
        for (unknown, &out) in unknowns.into_iter().zip(&routine.outputs) {
            let place = z[unknown] - self.frame.r[out as usize] / self.frame.d[out as usize];
            z[unknown] = if place.is_finite() { place } else { z[unknown] };
        }
        Some(())
    }

    /// Checks that every start value is finite.
    fn check_asked(&self) -> Result<(), StartError> {
        let value = |asked: &Value| self.code.layout.registers.get(*asked).map(|r| self.frame.r[r as usize]);
        let given = self.code.program.start.iter().map(|s| (&s.asked, &s.name, s.span));
        for (asked, name, span) in given.chain(self.code.program.guesses.iter().map(|g| (&g.asked, &g.name, g.span))) {
            if let Some(value) = value(asked).filter(|v| !v.is_finite()) {
                return Err(StartError::NoNumber { name: name.clone(), value, span });
            }
        }
        Ok(())
    }

    /// Typical magnitudes of the states: the largest of their start values, their distances from the equilibrium of the
    /// linearised equations, and their changes within the shortest time constant of these. 0 for states at rest at zero.
    ///
    /// The equilibrium is sought along directions that the junction structure allows: a displacement that depends on others,
    /// moved alone, would change no rate by more than rounding error. Neither would a state that acts on a rate by rounding
    /// alone: a rate that no state brings to 0 has no equilibrium. Nor does the way to it count further than states may get, as
    /// those of a machine that falls, or than equations are about as they are here: a diode that hardly conducts at the start
    /// would have its capacitor charged to a million volts.
    pub(super) fn magnitudes(&mut self, t: f64, x: &[f64]) -> Vec<f64> {
        let n = x.len();
        let mut sizes: Vec<f64> = x.iter().map(|x| x.abs()).collect();
        if n > MOST_LINEARISED {
            return sizes;
        }
        let Ok((rates, mut jacobian)) = self.at_rest(t, x) else { return sizes };
        let Some(directions) = self.first_directions(t, x) else { return sizes };
        let fastest = greatest_pair(&jacobian, n);
        let reaches = reaches(&jacobian, &rates, &sizes, fastest);
        silence(&mut jacobian, &rates, &reaches);
        let Some(way) = minimum_norm::step(&directions.along(&jacobian, n), &rates, directions.count(n)) else {
            return sizes;
        };
        let mut step = directions.step(&way.step);
        step.iter_mut().zip(&reaches).for_each(|(step, reach)| *step = step.min(FAR * reach).max(-FAR * reach));
        let pulls: Vec<f64> =
            (0..n).map(|i| (0..n).map(|j| (jacobian[i * n + j] * step[j]).abs()).sum::<f64>()).collect();
        let mut fastest = fastest;
        if let Some((part, there)) = self.clone().about_linear(t, x, &step, &rates, &pulls) {
            step.iter_mut().for_each(|step| *step *= part);
            fastest = fastest.max(greatest_pair(&there, n));
        }
        for (i, size) in sizes.iter_mut().enumerate() {
            let soon = if fastest > 0.0 { pulls[i].max(rates[i].abs()) / fastest } else { 0.0 };
            let near = size.max(soon);
            *size = near.max(step[i].abs().min(FAR * near));
        }
        sizes
    }

    /// Which part of a step can be gone before the rates are far from what their derivatives make of them, and the derivatives
    /// there; `None` if that is all of it, or if it cannot be told.
    pub(super) fn about_linear(
        &mut self,
        t: f64,
        x: &[f64],
        step: &[f64],
        rates: &[f64],
        pulls: &[f64],
    ) -> Option<(f64, Vec<f64>)> {
        // Where loops are closed a step leads off them.
        if !self.code.program.positions.is_empty() {
            return None;
        }
        let mut part = 1.0;
        for _ in 0..HALVINGS {
            let there: Vec<f64> = x.iter().zip(step).map(|(x, step)| x + part * step).collect();
            if self.rates_at(t, &there).is_ok() {
                let far = |(i, rate): (usize, &f64)| rate.abs() > UNLIKE * (rates[i].abs() + part * pulls[i]);
                if !self.dx.iter().enumerate().any(far) {
                    return if part < 1.0 { Some((part, self.at_rest(t, &there).ok()?.1)) } else { None };
                }
            }
            part *= 0.5;
        }
        None
    }

    /// Solves the conditions that have one open unknown for it, all of one pass at once.
    fn solve_direct(&mut self, t: f64, unknowns: &mut Unknowns) -> Result<(), StartError> {
        for _ in 0..PASSES {
            let mut chosen: BTreeMap<u32, usize> = BTreeMap::new();
            for (index, condition) in self.code.program.start.iter().enumerate() {
                let mut open = condition.reads.iter().filter(|&&u| !unknowns.known[u as usize]);
                if let (Some(&only), None) = (open.next(), open.next()) {
                    chosen.entry(only).or_insert(index);
                }
            }
            if chosen.is_empty() {
                return Ok(());
            }
            if self.solve_each(t, unknowns, &chosen) == 0 {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Scalar Newton iteration for each chosen pair of unknown and condition; marks the solved ones known, gives their number.
    fn solve_each(&mut self, t: f64, unknowns: &mut Unknowns, chosen: &BTreeMap<u32, usize>) -> usize {
        let wanted: Vec<Value> = chosen.values().map(|&c| self.code.program.start[c].residual).collect();
        let routine = self.start_routine(&wanted);
        let targets: Vec<usize> = chosen.keys().map(|&u| u as usize).collect();
        let begin: Vec<f64> = targets.iter().map(|&u| unknowns.z[u]).collect();
        let mut best: Vec<(f64, f64)> = targets.iter().map(|&u| (f64::INFINITY, unknowns.z[u])).collect();
        let mut step = vec![0.0; targets.len()];
        let mut done = vec![false; targets.len()];
        let mut slopes: Vec<Option<[f64; 2]>> = vec![None; targets.len()];
        for _ in 0..ITERATIONS {
            if self.residuals(t, &routine, &unknowns.z, Some(&targets)).is_err() {
                break;
            }
            for (i, (&unknown, &out)) in targets.iter().zip(&routine.outputs).enumerate() {
                let (residual, slope) = (self.frame.r[out as usize], self.frame.d[out as usize]);
                if done[i] {
                    continue;
                }
                let z = &mut unknowns.z[unknown];
                let [_, last] = slopes[i].get_or_insert([slope; 2]);
                if residual.abs() < best[i].0 {
                    *last = slope;
                    best[i] = (residual.abs(), *z);
                    step[i] = -residual / slope;
                } else {
                    step[i] *= 0.5;
                }
                done[i] = residual == 0.0 || step[i].abs() <= 2.0 * f64::EPSILON * best[i].1.abs();
                *z = if done[i] || !step[i].is_finite() { best[i].1 } else { best[i].1 + step[i] };
            }
            if done.iter().all(|&done| done) {
                break;
            }
        }
        for (i, &condition) in chosen.values().enumerate() {
            let slopes = slopes[i].unwrap_or_default().map(f64::abs);
            let is_lost = self.code.program.start[condition].weak && slopes[1] < LOST_FROM_SIGHT * slopes[0];
            done[i] &= !is_lost && best[i].1.abs() <= BEYOND * begin[i].abs().max(1.0);
        }
        for (((&unknown, &condition), &done), begin) in targets.iter().zip(chosen.values()).zip(&done).zip(begin) {
            unknowns.known[unknown] = done;
            unknowns.met[condition] = done;
            if !done {
                unknowns.z[unknown] = begin;
            }
        }
        done.iter().filter(|&&done| done).count()
    }

    /// Solves each condition that is not met simultaneously with all conditions that share unknowns with it.
    fn solve_groups(&mut self, t: f64, unknowns: &mut Unknowns) -> Result<(), StartError> {
        for group in self.code.program.start_groups() {
            if group.conditions.iter().all(|&c| unknowns.met[c]) {
                continue;
            }
            let routine = self.routine_of(&group);
            let known = group.unknowns.iter().all(|&u| unknowns.known[u as usize]);
            if known && self.is_met(t, &routine, &group, &unknowns.z) {
                continue;
            }
            self.solve_with_freedom(t, &routine, &group, unknowns)?;
        }
        Ok(())
    }

    /// Solves a group with all conditions on its undetermined unknowns (zero, or a guess); where these cannot all hold, with as
    /// many of them as can, tried one by one.
    fn solve_with_freedom(
        &mut self,
        t: f64,
        routine: &Routine,
        group: &StartGroup,
        unknowns: &mut Unknowns,
    ) -> Result<(), StartError> {
        let weak = |c: &usize| self.code.program.start[*c].weak;
        let (weak, given): (Vec<usize>, Vec<usize>) = group.conditions.iter().partition(|c| weak(c));
        let all = self.solve_group(t, routine, group, unknowns);
        if all.is_ok() || weak.is_empty() {
            return all;
        }
        let mut kept = StartGroup { conditions: given, unknowns: group.unknowns.clone() };
        // Unknowns that such conditions determined are open again.
        let begin = self.begin_search(t, unknowns.z.len());
        for u in group.unknowns.iter().map(|&u| u as usize) {
            (unknowns.z[u], unknowns.known[u]) = (begin.z[u], false);
        }
        let before = unknowns.clone();
        if !kept.conditions.is_empty() {
            self.solve_part(t, &kept, unknowns)?;
        }
        for condition in weak {
            let mut trial = kept.clone();
            trial.conditions.push(condition);
            let mut found = before.clone();
            if self.solve_part(t, &trial, &mut found).is_ok() {
                (kept, *unknowns) = (trial, found);
            }
        }
        Ok(())
    }

    fn solve_part(&mut self, t: f64, group: &StartGroup, unknowns: &mut Unknowns) -> Result<(), StartError> {
        let routine = self.routine_of(group);
        self.solve_group(t, &routine, group, unknowns)
    }

    fn is_met(&mut self, t: f64, routine: &Routine, group: &StartGroup, z: &[f64]) -> bool {
        let Some((residual, jacobian)) = self.linearised(t, routine, group, z) else { return false };
        self.unmet((group, routine), z, &residual, &jacobian).is_empty()
    }

    /// The residuals of a group, and behind them what each of them adds up.
    pub(super) fn routine_of(&mut self, group: &StartGroup) -> Routine {
        let program = &self.code.program;
        let residuals = group.conditions.iter().map(|&c| program.start[c].residual);
        let terms = residuals.clone().flat_map(|residual| terms_of(program, residual));
        let wanted: Vec<Value> = residuals.chain(terms).collect();
        self.start_routine(&wanted)
    }

    /// What rounding leaves of each residual of a group: of what it adds up, where the routine has been run.
    fn rounding_of(&self, group: &StartGroup, routine: &Routine) -> Vec<f64> {
        let mut terms = routine.outputs[group.conditions.len()..].iter();
        let program = &self.code.program;
        let sum = |&c: &usize| {
            let count = terms_of(program, program.start[c].residual).len();
            let sum: f64 = terms.by_ref().take(count).map(|&out| self.frame.r[out as usize].abs()).sum();
            TERMS * sum
        };
        group.conditions.iter().map(sum).collect()
    }

    /// Indices of the group's conditions that do not hold.
    pub(super) fn unmet(
        &self,
        (group, routine): (&StartGroup, &Routine),
        z: &[f64],
        residual: &[f64],
        jacobian: &[f64],
    ) -> Vec<usize> {
        let n = group.unknowns.len();
        let terms = self.rounding_of(group, routine);
        let asked = |i: usize| {
            let register = self.code.layout.registers.get(self.code.program.start[group.conditions[i]].asked);
            register.map_or(0.0, |r| self.frame.r[r as usize].abs())
        };
        let size = |i: usize| {
            let terms = group.unknowns.iter().enumerate().map(|(j, &u)| (jacobian[i * n + j] * z[u as usize]).abs());
            asked(i) + terms.sum::<f64>()
        };
        // Rounding error of an unknown whose exact value is 0, beside the largest of the others, each weighted by its
        // influence on the conditions. A condition on an undetermined unknown is judged by its own derivatives only: where
        // the unknowns grow without bound it must not pass for rounding error.
        let own = |i: usize| jacobian[i * n..][..n].iter().fold(0.0f64, |most, j| most.max(j.abs()));
        let weak = |i: usize| self.code.program.start[group.conditions[i]].weak;
        let rows = greatest_of(jacobian, residual.len(), n).into_iter().enumerate();
        let rows: Vec<f64> = rows.map(|(i, size)| if weak(i) { own(i) } else { size }).collect();
        let share = |i: usize, j: usize| if rows[i] > 0.0 { jacobian[i * n + j].abs() / rows[i] } else { 0.0 };
        let weight = |j: usize| (0..rows.len()).fold(0.0f64, |most, i| most.max(share(i, j)));
        let weighed = group.unknowns.iter().enumerate().map(|(j, &u)| weight(j) * z[u as usize].abs());
        let rounding = ROUNDING * weighed.fold(0.0, f64::max);
        let most = |i: usize| terms[i].max(MET * size(i) + rounding * rows[i]);
        let missed = |i: &usize| residual[*i].abs() > most(*i) || residual[*i].is_nan();
        (0..residual.len()).filter(missed).collect()
    }

    /// Damped Gauss-Newton iteration with minimum-norm steps, from each first guess in turn.
    fn solve_group(
        &mut self,
        t: f64,
        routine: &Routine,
        group: &StartGroup,
        all: &mut Unknowns,
    ) -> Result<(), StartError> {
        let names: Vec<String> = group.conditions.iter().map(|&c| self.code.program.start[c].name.clone()).collect();
        let without_value = Failure::NotFinite { time: t, what: Affected::Variables(names.clone()) };
        let open: Vec<bool> = group.unknowns.iter().map(|&u| !all.known[u as usize]).collect();
        let searched = self.names_of(group.unknowns.iter().zip(&open).filter(|(_, open)| **open).map(|(&u, _)| u));
        let at_time = GroupAtTime { t, routine, group };
        // Known unknowns stay if the conditions can be met so; in the second round all may change.
        // What conditions tell where nothing has been tried yet.
        let told = self.linearised(t, routine, group, &all.z).map(|at| at.1);
        let mut first = None;
        let all_open = vec![true; open.len()];
        let rounds = if open.contains(&true) { vec![open.clone(), all_open] } else { vec![all_open] };
        for movable in rounds {
            for (k, first_guess) in FIRST_GUESSES.into_iter().enumerate() {
                let mut z = all.z.clone();
                let offset = |j: usize| if k < 4 { first_guess } else { first_guess * (1.0 + j as f64 / 16.0) };
                for j in (0..open.len()).filter(|&j| open[j]) {
                    let u = group.unknowns[j] as usize;
                    // Guessed unknowns begin at the guess, or close to it.
                    z[u] += if all.guessed[u] && first_guess.abs() > BESIDE { 0.0 } else { offset(j) };
                }
                if let Some(at) = self.linearised(t, routine, group, &z) {
                    let before = told.clone().unwrap_or_else(|| at.1.clone());
                    let (z, residual, jacobian) = self.nearest(at_time, z, at, &movable);
                    if self.unmet((group, routine), &z, &residual, &jacobian).is_empty()
                        && !self.has_run_away(group, &z, [&before, &jacobian])
                    {
                        all.z = z;
                        group.unknowns.iter().for_each(|&u| all.known[u as usize] = true);
                        return Ok(());
                    }
                    if movable.iter().all(|m| *m) {
                        first.get_or_insert((z, residual, jacobian, before));
                    }
                }
                // Without an open unknown all first guesses are alike.
                if !open.contains(&true) {
                    break;
                }
            }
        }
        let Some((mut z, mut residual, mut jacobian, before)) = first else {
            let run = self.residuals(t, routine, &all.z, None);
            return Err(StartError::Failure(run.err().unwrap_or_else(|| self.explain(t).unwrap_or(without_value))));
        };
        // No exact solution: the weighted least-squares one, with the weights at this point.
        let firm = |&c: &usize| if self.code.program.start[c].firm { FIRM } else { 1.0 };
        let weights = weights_of(&jacobian, residual.len(), group.unknowns.len());
        let weights: Vec<f64> = weights.iter().zip(group.conditions.iter().map(firm)).map(|(w, f)| w * f).collect();
        let movable = vec![true; open.len()];
        for _ in 0..10 * ITERATIONS {
            if !self.nearer(at_time, &mut z, (&mut residual, &mut jacobian), &movable, Some(&weights)) {
                break;
            }
        }
        if self.unmet((group, routine), &z, &residual, &jacobian).is_empty()
            && !self.has_run_away(group, &z, [&before, &jacobian])
        {
            all.z = z;
            group.unknowns.iter().for_each(|&u| all.known[u as usize] = true);
            return Ok(());
        }
        Err(match self.conflict(at_time, &z, (&residual, &jacobian), &weights) {
            Some(values) => StartError::Conflict(StartConflict { values, searched }),
            None => StartError::NotFound { conditions: names, searched },
        })
    }

    /// Whether a search has gone to where conditions hold because nothing is told there any more: a ratio that comes to 0 at
    /// infinity alone, an angle of so many turns that its sine is rounding. `jacobians`: where it began, and where it has ended.
    fn has_run_away(&self, group: &StartGroup, z: &[f64], jacobians: [&[f64]; 2]) -> bool {
        let n = group.unknowns.len();
        let start = &self.code.program.start;
        let asked = group.conditions.iter().filter_map(|&c| self.code.layout.registers.get(start[c].asked));
        let most = asked.fold(1.0f64, |most, register| most.max(self.frame.r[register as usize].abs()));
        let is_beyond = group.unknowns.iter().any(|&u| z[u as usize].abs() > BEYOND * most);
        let greatest = |jacobian: &[f64], i: usize| jacobian[i * n..][..n].iter().fold(0.0f64, |m, j| m.max(j.abs()));
        let is_lost = |(i, &c): (usize, &usize)| {
            start[c].weak && greatest(jacobians[1], i) < LOST_FROM_SIGHT * greatest(jacobians[0], i)
        };
        is_beyond || group.conditions.iter().enumerate().any(is_lost)
    }

    /// The names of unknowns: states, then conserved constants, then positions.
    pub(super) fn names_of(&self, unknowns: impl Iterator<Item = u32>) -> Vec<String> {
        let Program { states, conserved, positions, .. } = &self.code.program;
        let names = states.iter().map(|s| &s.name).chain(conserved).chain(positions.iter().map(|p| &p.name));
        let names: Vec<&String> = names.collect();
        unknowns.map(|u| names[u as usize].clone()).collect()
    }

    /// The limit of damped minimum-norm steps in the movable unknowns.
    fn nearest(
        &mut self,
        at_time: GroupAtTime,
        mut z: Vec<f64>,
        (mut residual, mut jacobian): (Vec<f64>, Vec<f64>),
        movable: &[bool],
    ) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        for _ in 0..ITERATIONS {
            if !self.nearer(at_time, &mut z, (&mut residual, &mut jacobian), movable, None) {
                break;
            }
        }
        (z, residual, jacobian)
    }

    /// One damped step; whether it reduced the residuals.
    fn nearer(
        &mut self,
        GroupAtTime { t, routine, group }: GroupAtTime,
        z: &mut Vec<f64>,
        (residual, jacobian): (&mut Vec<f64>, &mut Vec<f64>),
        movable: &[bool],
        weights: Option<&[f64]>,
    ) -> bool {
        let n = group.unknowns.len();
        let weights = weights.map_or_else(|| weights_of(jacobian, residual.len(), n), <[f64]>::to_vec);
        let moving = jacobian.iter().zip(movable.iter().cycle()).map(|(j, m)| if *m { *j } else { 0.0 });
        let moving: Vec<f64> = moving.collect();
        let Some(step) = minimum_norm::weighed_step(&moving, residual, n, weights) else { return false };
        let norm = |r: &[f64]| r.iter().zip(&step.weights).map(|(r, w)| (r * w) * (r * w)).sum::<f64>().sqrt();
        let moves = |(u, s): (&u32, &f64)| s.abs() > 4.0 * f64::EPSILON * z[*u as usize].abs();
        if norm(residual) == 0.0 || !group.unknowns.iter().zip(&step.step).any(moves) {
            return false;
        }
        let mut fraction = 1.0;
        while fraction >= 1e-9 {
            let mut trial = z.clone();
            group.unknowns.iter().zip(&step.step).for_each(|(&u, s)| trial[u as usize] += fraction * s);
            match self.linearised(t, routine, group, &trial) {
                Some(next) if norm(&next.0) < norm(residual) => {
                    *z = trial;
                    (*residual, *jacobian) = next;
                    return true;
                }
                _ => fraction *= 0.5,
            }
        }
        // No damping reduces the residuals: a stationary point.
        false
    }

    /// The contradicting conditions, if the point is a least-squares solution.
    fn conflict(
        &mut self,
        GroupAtTime { t, group, .. }: GroupAtTime,
        z: &[f64],
        (residual, jacobian): (&[f64], &[f64]),
        weights: &[f64],
    ) -> Option<Vec<StartValue>> {
        let n = group.unknowns.len();
        let weighed: Vec<f64> = residual.iter().zip(weights).map(|(r, w)| r * w).collect();
        let most = weighed.iter().fold(0.0f64, |most, r| most.max(r.abs()));
        // At a least-squares solution the residual is orthogonal to the range of the Jacobian.
        for j in 0..n {
            let column = |i: usize| jacobian[i * n + j] * weights[i];
            let product: f64 = (0..residual.len()).map(|i| column(i) * weighed[i]).sum();
            let size: f64 = (0..residual.len()).map(|i| column(i).abs()).sum();
            if product.abs() > 1e-5 * size * most {
                return None;
            }
        }
        let mut involved: Vec<usize> = (0..residual.len()).filter(|&i| weighed[i].abs() > 1e-6 * most).collect();
        // Constraints are kept: start values are reported, unless there are none.
        let firm = |i: &usize| self.code.program.start[group.conditions[*i]].firm;
        if !involved.iter().all(firm) {
            involved.retain(|i| !firm(i));
        }
        // A point that violates a constraint is not offered as a remedy.
        let met = |i: usize| weighed[i].abs() <= 1e-3 * most || !firm(&i);
        if !involved.iter().all(firm) && !(0..residual.len()).all(met) {
            return None;
        }
        Some(involved.iter().map(|&i| self.start_value(t, group.conditions[i], z, residual[i])).collect())
    }

    /// The constraints on displacements that states may miss: those that read computed positions hold by these.
    pub(super) fn constraints(&mut self) -> Vec<ConstraintResidual> {
        let firm: Vec<usize> = self.code.program.constraints_on_states().map(|(c, _)| c).collect();
        firm.into_iter()
            .map(|c| ConstraintResidual {
                group: StartGroup { conditions: vec![c], unknowns: self.code.program.start[c].reads.clone() },
                routine: self.routine_for(&[self.code.program.start[c].residual]),
            })
            .collect()
    }

    /// The holonomic constraint with the largest relative violation at a state, if that exceeds `most`, with the violation
    /// relative to the magnitudes of its displacements. `size`: the scales of the states.
    pub(super) fn unmet_constraint(
        &mut self,
        constraints: &[ConstraintResidual],
        t: f64,
        x: &[f64],
        size: &[f64],
        most: f64,
    ) -> Option<(String, f64)> {
        let z: Vec<f64> = x.iter().chain(&self.run.conserved.clone()).copied().collect();
        let mut worst: Option<(f64, String, f64)> = None;
        for ConstraintResidual { group, routine } in constraints {
            let name = self.code.program.start[group.conditions[0]].name.clone();
            let Some((miss, slopes)) = self.linearised(t, routine, group, &z) else { return Some((name, f64::NAN)) };
            let moved = |u: u32| z[u as usize].abs().max(size.get(u as usize).copied().unwrap_or(0.0));
            let terms = group.unknowns.iter().zip(&slopes).map(|(&u, j)| j.abs() * moved(u));
            let part = miss[0].abs() / terms.sum::<f64>().max(f64::MIN_POSITIVE);
            if miss[0].abs() > 0.0 && part > most && worst.as_ref().is_none_or(|w| part > w.0) {
                worst = Some((part, name, miss[0]));
            }
        }
        worst.map(|(_, name, miss)| (name, miss))
    }

    fn start_value(&mut self, t: f64, condition: usize, z: &[f64], residual: f64) -> StartValue {
        let start = self.code.program.start[condition].clone();
        let observed =
            self.code.program.observed.iter().find(|o| *o.name == *start.name).and_then(|o| o.value.clone().ok());
        let mut wanted = vec![start.asked];
        wanted.extend(observed);
        let routine = self.start_routine(&wanted);
        let run = self.residuals(t, &routine, z, None);
        let value = |i: usize| routine.outputs.get(i).map(|&out| self.frame.r[out as usize]);
        let asked = value(0).unwrap_or(f64::NAN);
        let fitting = value(1).filter(|_| run.is_ok()).unwrap_or(asked + residual);
        StartValue { name: start.name, asked, fitting, span: start.span }
    }

    /// The residuals and their Jacobian by the unknowns of the group, row by row; `None` where one is not finite.
    pub(super) fn linearised(
        &mut self,
        t: f64,
        routine: &Routine,
        group: &StartGroup,
        z: &[f64],
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let (rows, columns) = (group.conditions.len(), group.unknowns.len());
        let mut jacobian = vec![0.0; rows * columns];
        if columns == 0 {
            self.residuals(t, routine, z, None).ok()?;
        }
        for (j, &unknown) in group.unknowns.iter().enumerate() {
            self.residuals(t, routine, z, Some(&[unknown as usize])).ok()?;
            for (i, &out) in routine.outputs[..rows].iter().enumerate() {
                jacobian[i * columns + j] = self.frame.d[out as usize];
            }
        }
        let residual: Vec<f64> = routine.outputs[..rows].iter().map(|&out| self.frame.r[out as usize]).collect();
        let finite = residual.iter().chain(&jacobian).all(|v| v.is_finite());
        finite.then_some((residual, jacobian))
    }

    /// Runs a routine at the start, with directional derivatives along the given unknowns.
    pub(super) fn residuals(
        &mut self,
        t: f64,
        routine: &Routine,
        z: &[f64],
        along: Option<&[usize]>,
    ) -> Result<(), Failure> {
        let states = self.code.program.states.len();
        let constants = states + self.run.conserved.len();
        if z.len() > constants || self.code.program.positions.is_empty() {
            self.give(z);
        } else {
            self.run.conserved.copy_from_slice(&z[states..]);
        }
        self.place(t, &z[..states]);
        let run = match along {
            None => self.frame.run(routine),
            Some(unknowns) => {
                self.still();
                let Layout { states: first, conserved, positions, .. } = self.code.layout;
                for &u in unknowns {
                    let register = match u {
                        _ if u < states => first as usize + u,
                        _ if u < constants => conserved as usize + u - states,
                        _ => positions as usize + u - constants,
                    };
                    self.frame.d[register] = 1.0;
                }
                self.frame.run_along(routine)
            }
        };
        run.map_err(|error| self.failure(t, error))
    }

    pub(super) fn start_routine(&mut self, wanted: &[Value]) -> Routine {
        let routine = self.code.layout.start_routine(&self.code.program, wanted);
        self.frame.reserve(&routine);
        routine
    }

    pub(super) fn routine_for(&mut self, wanted: &[Value]) -> Routine {
        let routine = self.code.layout.routine(&self.code.program, wanted);
        self.frame.reserve(&routine);
        routine
    }
}

/// Guesses in a row of which none reads what another one of them places: one routine computes them all.
fn beside_each_other(guesses: &[StartGuess]) -> Vec<&[StartGuess]> {
    let mut parts = Vec::new();
    let (mut start, mut placed, mut read) = (0, BTreeSet::new(), BTreeSet::new());
    for (k, guess) in guesses.iter().enumerate() {
        let others = || guess.reads.iter().filter(|&&u| u != guess.unknown);
        if placed.contains(&guess.unknown) || read.contains(&guess.unknown) || others().any(|u| placed.contains(u)) {
            parts.push(&guesses[start..k]);
            (start, placed, read) = (k, BTreeSet::new(), BTreeSet::new());
        }
        placed.insert(guess.unknown);
        read.extend(others().copied());
    }
    parts.push(&guesses[start..]);
    parts.retain(|part| !part.is_empty());
    parts
}

/// The greatest rate, in 1/s, at which a state moves by itself or two move each other.
fn greatest_pair(jacobian: &[f64], n: usize) -> f64 {
    let pair = |i: usize, j: usize| exchanged(jacobian[i * n + j], jacobian[j * n + i]);
    (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))).fold(0.0f64, |most, (i, j)| most.max(pair(i, j)))
}

/// How far each state is from 0, or soon will be: what its rate makes of it in the shortest time, and where that is 0 as well
/// what the others make of it. 0 where nothing moves it.
fn reaches(jacobian: &[f64], rates: &[f64], sizes: &[f64], fastest: f64) -> Vec<f64> {
    let n = sizes.len();
    if fastest == 0.0 {
        return sizes.to_vec();
    }
    let mut reaches: Vec<f64> = sizes.iter().zip(rates).map(|(size, rate)| size.max(rate.abs() / fastest)).collect();
    loop {
        let pulled = |i: usize| (0..n).map(|j| (jacobian[i * n + j] * reaches[j]).abs()).sum::<f64>() / fastest;
        let next: Vec<f64> = (0..n).map(|i| if reaches[i] == 0.0 { pulled(i) } else { reaches[i] }).collect();
        // Each round reaches one more at least, or none any more.
        if next == reaches {
            return reaches;
        }
        reaches = next;
    }
}

/// Takes derivatives out by which a state that is `reaches` from 0 changes a rate by no more than rounding.
fn silence(jacobian: &mut [f64], rates: &[f64], reaches: &[f64]) {
    for (row, rate) in jacobian.chunks_mut(reaches.len().max(1)).zip(rates) {
        let rounded = |(derivative, reach): &(&mut f64, &f64)| {
            **reach > 0.0 && derivative.abs() * **reach <= ROUNDED * rate.abs()
        };
        row.iter_mut().zip(reaches).filter(rounded).for_each(|(derivative, _)| *derivative = 0.0);
    }
}

/// The largest derivative of each condition; where all of them are rounding errors beside those of other conditions by the
/// same unknown, the largest of these, so that rounding errors are not scaled up.
fn greatest_of(jacobian: &[f64], rows: usize, columns: usize) -> Vec<f64> {
    let mut greatest = vec![0.0f64; columns];
    for row in jacobian.chunks(columns.max(1)) {
        greatest.iter_mut().zip(row).for_each(|(most, j)| *most = most.max(j.abs()));
    }
    let size = |(j, most): (&f64, &f64)| if *j != 0.0 && j.abs() <= NOISE * most { *most } else { j.abs() };
    let row = |i: usize| jacobian[i * columns..][..columns].iter().zip(&greatest).map(size).fold(0.0f64, f64::max);
    (0..rows).map(row).collect()
}

/// The weights of conditions: the inverses of their largest derivatives.
fn weights_of(jacobian: &[f64], rows: usize, columns: usize) -> Vec<f64> {
    greatest_of(jacobian, rows, columns).into_iter().map(minimum_norm::inverse).collect()
}

/// What a value adds up, each once.
fn terms_of(program: &Program, value: Value) -> Vec<Value> {
    let (mut open, mut seen, mut terms) = (vec![value], BTreeSet::new(), Vec::new());
    while let Some(value) = open.pop() {
        if !seen.insert(value) {
            continue;
        }
        match program.values.op(value) {
            Op::Add(a, b) | Op::Sub(a, b) => open.extend([b, a]),
            Op::Neg(a) => open.push(a),
            _ => terms.push(value),
        }
    }
    terms
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_acts_by_rounding_alone_is_silent() {
        // A slide whose rate of 6 an angle changes by rounding; the angle has a spring, at rest and at 0.3 rad.
        let jacobian = [0.0, 0.0, 3e-16, 0.0, 0.0, -15.0, 0.0, 1.0, 0.0];
        for sizes in [[0.0, 0.0, 0.3], [0.0, 0.0, 0.0]] {
            let rates = [6.0, 4.5, 0.0];
            let reaches = reaches(&jacobian, &rates, &sizes, 15f64.sqrt());
            let mut silent = jacobian;
            silence(&mut silent, &rates, &reaches);
            assert_eq!(silent, [0.0, 0.0, 0.0, 0.0, 0.0, -15.0, 0.0, 1.0, 0.0], "{sizes:?}");
        }
        // A weight on a spring that is neither stretched nor moves yet: all of it counts.
        let jacobian = [0.0, -1e-3, 1.0, 0.0];
        let reaches = reaches(&jacobian, &[9.81, 0.0], &[0.0, 0.0], 1e-3f64.sqrt());
        let mut silent = jacobian;
        silence(&mut silent, &[9.81, 0.0], &reaches);
        assert_eq!(silent, jacobian);
    }
}
