//! Impulses: what storages keep after an event follows from what they kept before it, the resets, and what the junction
//! structure lets through.

use super::impulse_elimination::Elimination;
use super::{DelayOrSample, Model};
use crate::bytecode::{Frame, Layout, Routine};
use halfarrow_compiler::program::{Jumps, Program, Target, Value};
use halfarrow_sim::Failure;

/// Contacts that are let act, for each that there is, at most.
const PASSES: usize = 8;
/// Passes of Newton.
const ITERATIONS: usize = 50;
/// A relative step that has to shrink, or is what rounding leaves.
const NOISE: f64 = 1e-9;
/// A relative step that is rounding.
const SETTLED: f64 = 4.0 * f64::EPSILON;
/// What is a difference of what storages keep and below this part of it is rounding.
const ROUNDING: f64 = 1e-11;
/// What storages keep that is nothing beside what they have kept, in parts of [`MET`] of it.
const NOTHING: f64 = 1e-4;
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

/// Room for what is computed of impulses.
#[derive(Debug, Clone, Default)]
pub(super) struct ImpulseWork {
    /// What storages keep before the round.
    stored: Vec<f64>,
    asked: Vec<Asked>,
    /// Of each that is asked for.
    impulses: Vec<f64>,
    equations: Elimination,
    /// The magnitude of what each equation adds up.
    sizes: Vec<f64>,
    /// The greatest term of what is reset, on the way.
    greatest: Vec<f64>,
    /// How great what storages keep has been, and the unknowns, where a run knows.
    kept: Vec<f64>,
    been: Vec<f64>,
}

/// A reset of the round: the place of what it changes among the outputs, the value that it asks for, its impulse.
#[derive(Debug, Clone, Copy)]
struct Asked {
    output: usize,
    value: f64,
    impulse: usize,
    /// The place of the value among those of all actions.
    at: usize,
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

    /// Whether what storages keep may leap where a condition changes.
    pub fn leaps(&self) -> bool {
        self.jumps.leaps
    }

    pub fn unknowns(&self) -> usize {
        self.jumps.unknowns.len()
    }

    /// Which unknowns there are: states and, after them, conserved constants.
    pub fn unknown_numbers(&self) -> &[u32] {
        &self.jumps.unknowns
    }

    /// Computes what storages keep.
    pub fn stored(&self) -> &Routine {
        &self.stored
    }

    /// Computes all that balances are made of.
    pub fn all(&self) -> &Routine {
        &self.all
    }

    /// Derivatives of the residuals along a direction along which what [`all`](ImpulseBalance::all) gives moves by `moves`, what
    /// storages kept before by `before` and the new values of actions by `values`; impulses stay.
    pub fn residuals_along(
        &self,
        work: &ImpulseWork,
        (frame, moves): (&Frame, &[f64]),
        before: &[f64],
        values: &[f64],
    ) -> Vec<f64> {
        let at = |output: usize| (frame.r[self.all.outputs[output] as usize], moves[output]);
        let mut factor = self.jumps.stored.len();
        let mut slopes = Vec::with_capacity(self.jumps.balances.len() + work.asked.len());
        for terms in &self.jumps.balances {
            let mut slope = 0.0;
            for &(k, _) in terms {
                let ((c, dc), (stored, change)) = (at(factor), at(k as usize));
                slope += c * (change - before[k as usize]) + dc * (stored - work.stored[k as usize]);
                factor += 1;
            }
            slopes.push(slope);
        }
        for (i, impulse) in self.jumps.impulses.iter().enumerate() {
            let place = work.asked.iter().position(|a| a.impulse == i);
            for &(row, _) in &impulse.along {
                let (_, dc) = at(factor);
                factor += 1;
                slopes[row as usize] -= place.map_or(0.0, |place| dc * work.impulses[place]);
            }
        }
        slopes.extend(work.asked.iter().map(|a| at(a.output).1 - values[a.at]));
        slopes
    }

    pub fn work(&self) -> ImpulseWork {
        let (rows, unknowns, asked) = (self.jumps.balances.len(), self.unknowns(), self.moved.len());
        ImpulseWork {
            stored: vec![0.0; self.jumps.stored.len()],
            asked: Vec::with_capacity(asked),
            impulses: Vec::with_capacity(asked),
            equations: Elimination::new(rows + asked, unknowns + asked),
            sizes: Vec::with_capacity(rows + asked),
            greatest: Vec::with_capacity(asked),
            kept: vec![0.0; self.jumps.stored.len()],
            been: vec![0.0; unknowns],
        }
    }
}

impl ImpulseWork {
    /// What storages kept when that was noted last, in the order of [`Jumps::storages`].
    pub fn stored(&self) -> &[f64] {
        &self.stored
    }

    /// The equations as they were computed last.
    pub fn equations(&self) -> &Elimination {
        &self.equations
    }

    /// Whether the equations hold to a part of what they add up.
    fn met_to(&self, part: f64) -> bool {
        self.equations.residual.iter().zip(&self.sizes).all(|(residual, size)| residual.abs() <= part * size)
    }

    /// How many resets are asked for.
    pub fn resets(&self) -> usize {
        self.asked.len()
    }

    /// The held signals that tell the impulses of what is asked for.
    pub fn asked_impulses<'w>(&'w self, balance: &'w ImpulseBalance) -> impl Iterator<Item = usize> + 'w {
        self.asked.iter().map(|a| balance.jumps.impulses[a.impulse].held as usize)
    }

    /// Notes it.
    pub fn keep_stored(&mut self, stored: &[f64]) {
        self.stored.copy_from_slice(stored);
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
        events.impulses.stored.iter_mut().zip(outputs).for_each(|(stored, &r)| *stored = frame.r[r as usize]);
        self.vary_stored(t, x, balance)
    }

    /// Gives states and conserved constants the values after the round, and tells the impulses; those of one instant add up,
    /// of which this is the `first` round.
    pub(super) fn balance_impulses(&mut self, t: f64, x: &mut [f64], first: bool) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(balance) = &code.impulses else { return Ok(()) };
        let mut work = std::mem::take(&mut self.events.impulses);
        let done = self.share_out(t, x, balance, &mut work);
        self.events.impulses = work;
        done?;
        if first {
            for a in &self.events.impulses.asked {
                let held = balance.jumps.impulses[a.impulse].held as usize;
                self.run.delays_and_samples[held] = DelayOrSample::Discrete(0.0);
            }
        }
        let ImpulseWork { asked, impulses, .. } = &self.events.impulses;
        for (a, p) in asked.iter().zip(impulses) {
            let held = balance.jumps.impulses[a.impulse].held as usize;
            if let DelayOrSample::Discrete(value) = &mut self.run.delays_and_samples[held] {
                *value += p;
            }
        }
        self.vary_balance(t, x, balance, (true, first))
    }

    /// Gives states and conserved constants the values after ratios have leapt; whether any has changed.
    pub(super) fn balance_leaps(&mut self, t: f64, x: &mut [f64]) -> Result<bool, Failure> {
        let code = self.code.clone();
        let Some(balance) = &code.impulses else { return Ok(false) };
        let mut work = std::mem::take(&mut self.events.impulses);
        work.asked.clear();
        let done = self.solve_balance(t, x, balance, &mut work);
        self.events.impulses = work;
        let moved = done?.ok_or_else(|| self.dependent_resets(t))?;
        self.vary_balance(t, x, balance, (false, false))?;
        Ok(moved)
    }

    /// Shares out the impulses of resets and of contacts: `0 <= P`, `0 <= v+ - target`, one of them zero, for each contact.
    /// That is the least kinetic energy of what the impulses change, found by letting act the contact that gives way most and
    /// letting go those that would pull on the way there. A contact that others hold already adds nothing.
    /// Source: C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, chapter 23.
    fn share_out(
        &mut self,
        t: f64,
        x: &mut [f64],
        balance: &ImpulseBalance,
        work: &mut ImpulseWork,
    ) -> Result<(), Failure> {
        let contacts = self.events.contacts.clone();
        contacts.iter().for_each(|&contact| self.events.fired[contact] = false);
        if contacts.is_empty() {
            let solved = self.solve_shares(t, x, balance, work)?;
            return if solved { Ok(()) } else { Err(self.dependent_resets(t)) };
        }
        let (start, conserved) = (x.to_vec(), self.run.conserved.clone());
        // What has been shared out last, and of each contact.
        let (mut shared, mut held) = (vec![0.0; contacts.len()], vec![false; contacts.len()]);
        if !self.solve_shares(t, x, balance, work)? {
            return Err(self.dependent_resets(t));
        }
        for _ in 0..PASSES * (contacts.len() + 1) {
            let gives = |&k: &usize| !self.events.fired[contacts[k]] && !held[k];
            let open = (0..contacts.len()).filter(gives).map(|k| (k, self.gives_way(contacts[k], balance)));
            let worst = open.filter(|(_, by)| *by > 0.0).reduce(|a, b| if b.1 > a.1 { b } else { a });
            let Some((added, _)) = worst else {
                self.note_shared(t, &contacts);
                return Ok(());
            };
            self.events.fired[contacts[added]] = true;
            loop {
                x.copy_from_slice(&start);
                self.run.conserved.clone_from(&conserved);
                match self.solve_shares(t, x, balance, work) {
                    Ok(false) if !held[added] && self.events.fired[contacts[added]] => {
                        // The others hold it to rounding.
                        (held[added], self.events.fired[contacts[added]]) = (true, false);
                        continue;
                    }
                    Ok(false) => return Err(self.dependent_resets(t)),
                    solved => solved?,
                };
                let wanted: Vec<f64> = contacts.iter().map(|&c| self.impulse_of(c, work)).collect();
                if self.events.fired[contacts[added]] && shared[added] == 0.0 && wanted[added] <= 0.0 {
                    // What it gives way by is rounding.
                    (held[added], self.events.fired[contacts[added]]) = (true, false);
                    continue;
                }
                let noise = self.noise_of_impulses(balance, work);
                let pulls = |k: &usize| self.events.fired[contacts[*k]] && wanted[*k] < -noise;
                let way = |k: usize| shared[k] / (shared[k] - wanted[k]);
                let least = (0..contacts.len()).filter(pulls).map(|k| (k, way(k)));
                let Some((first, part)) = least.reduce(|a, b| if b.1 < a.1 { b } else { a }) else {
                    if self.events.fired[contacts[added]] {
                        held.fill(false);
                    }
                    shared = wanted;
                    break;
                };
                for k in 0..contacts.len() {
                    shared[k] += part * (wanted[k] - shared[k]);
                    if self.events.fired[contacts[k]] && (k == first || shared[k] <= 0.0) {
                        (shared[k], self.events.fired[contacts[k]]) = (0.0, false);
                    }
                }
            }
        }
        Err(self.unmet_resets(t))
    }

    /// Takes notice of contacts that act together.
    fn note_shared(&mut self, t: f64, contacts: &[usize]) {
        let acting = contacts.iter().filter(|&&contact| self.events.fired[contact]);
        let law = |&contact: &usize| self.code.program.clauses[contact].bound.map(|bound| bound.law);
        let laws: Vec<u32> = acting.filter_map(law).collect();
        if laws.len() > 1 {
            self.run.extents.note_shared(t, laws);
        }
    }

    /// Impulses for all that acts; `false` if some of it depends on the rest.
    fn solve_shares(
        &mut self,
        t: f64,
        x: &mut [f64],
        balance: &ImpulseBalance,
        work: &mut ImpulseWork,
    ) -> Result<bool, Failure> {
        self.take_asked(balance, &mut work.asked);
        self.solve_balance(t, x, balance, work).map(|solved| solved.is_some())
    }

    /// What a contact asks for, and its impulse.
    fn of_contact(&self, contact: usize) -> Option<(Value, usize)> {
        let action = self.code.program.clauses[contact].actions.first()?;
        match action.target {
            Target::Moved { what, impulse } => Some((what, impulse as usize)),
            _ => None,
        }
    }

    /// By how much a contact gives way after what has been solved last, beyond rounding.
    fn gives_way(&self, contact: usize, balance: &ImpulseBalance) -> f64 {
        let Some((what, _)) = self.of_contact(contact) else { return 0.0 };
        let first = balance.all.outputs.len() - balance.moved.len();
        let output = first + balance.moved.binary_search(&what).expect("it is among what resets change");
        let flow = self.frame.r[balance.all.outputs[output] as usize];
        let target = self.events.values[self.code.clauses.place(contact, 0)];
        (target - flow - ROUNDING * self.greatest_rate(contact)).max(0.0)
    }

    /// The impulse of a contact in what has been solved last.
    fn impulse_of(&self, contact: usize, work: &ImpulseWork) -> f64 {
        let Some((_, impulse)) = self.of_contact(contact).filter(|_| self.events.fired[contact]) else { return 0.0 };
        let own = work.asked.iter().zip(&work.impulses).find(|(a, _)| a.impulse == impulse);
        own.map_or(0.0, |(_, p)| *p)
    }

    /// An impulse that is rounding.
    fn noise_of_impulses(&self, balance: &ImpulseBalance, work: &ImpulseWork) -> f64 {
        let most = work.impulses.iter().fold(0.0f64, |most, p| most.max(p.abs()));
        let kept = work.sizes[..balance.jumps.balances.len()].iter().fold(0.0f64, |most, size| most.max(*size));
        MET * most + ROUNDING * kept
    }

    /// Newton on the unknowns and the impulses; whether any unknown has changed. `None` if resets depend on each other.
    fn solve_balance(
        &mut self,
        t: f64,
        x: &mut [f64],
        balance: &ImpulseBalance,
        work: &mut ImpulseWork,
    ) -> Result<Option<bool>, Failure> {
        let (n, m) = (balance.unknowns(), balance.unknowns() + work.asked.len());
        work.impulses.clear();
        work.impulses.resize(work.asked.len(), 0.0);
        work.greatest.clear();
        work.greatest.resize(work.asked.len(), 0.0);
        if m == 0 {
            return Ok(Some(false));
        }
        let (extents, tracked) = (&self.run.extents, &self.code.program.tracked);
        for (kept, symbol) in work.kept.iter_mut().zip(&balance.jumps.storages) {
            *kept = extents.stored.get(symbol).copied().unwrap_or(0.0);
        }
        for (been, &unknown) in work.been.iter_mut().zip(&balance.jumps.unknowns) {
            let symbol = tracked.get(unknown as usize);
            *been = symbol.and_then(|s| extents.states.get(s)).copied().unwrap_or(0.0);
        }
        // Without set-valued laws there are no bodies that others hold at rest, and exported C takes the same passes.
        let held = self.code.bounds.is_some();
        for k in 0..n {
            let value = self.unknown_mut(x, balance.jumps.unknowns[k]).abs();
            work.been[k] = if held { work.been[k].max(value) } else { 0.0 };
        }
        let (mut last, mut stays, mut met, mut changed) = (f64::INFINITY, false, false, false);
        for _ in 0..ITERATIONS {
            self.balanced(t, x, balance, work)?;
            // What is nothing but rounding never settles; then its equations hold to that.
            met = work.met_to(0.0) || stays && work.met_to(ROUNDING);
            if met {
                break;
            }
            match work.equations.solve() {
                None => break,
                Some(rank) if rank < m => return Ok(None),
                Some(_) => {}
            }
            let step = &work.equations.step;
            let mut length = 0.0f64;
            changed = true;
            for ((&u, s), been) in balance.jumps.unknowns.iter().zip(step).zip(&mut work.been) {
                *been = if held { been.max(s.abs()) } else { 0.0 };
                let value = self.unknown_mut(x, u);
                let size = value.abs().max(s.abs()).max(f64::MIN_POSITIVE);
                length = length.max(if s.abs() <= MET * NOTHING * *been { 0.0 } else { s.abs() / size });
                *value += s;
            }
            work.impulses.iter_mut().zip(&step[n..]).for_each(|(p, s)| *p += s);
            stays = length >= 0.5 * last;
            met = length <= SETTLED || stays && length < NOISE;
            if met {
                break;
            }
            last = length;
        }
        self.balanced(t, x, balance, work)?;
        match met && work.met_to(MET) {
            true => Ok(Some(changed)),
            false => Err(self.unmet_resets(t)),
        }
    }

    /// The resets of the round, each thing once.
    fn take_asked(&self, balance: &ImpulseBalance, asked: &mut Vec<Asked>) {
        let first = balance.all.outputs.len() - balance.moved.len();
        asked.clear();
        for (_, at, action) in Model::actions(&self.code, &self.events) {
            let Target::Moved { what, impulse } = action.target else { continue };
            let output = first + balance.moved.binary_search(&what).expect("it is among what resets change");
            if asked.iter().all(|a| a.output != output) {
                asked.push(Asked { output, value: self.events.values[at], impulse: impulse as usize, at });
            }
        }
    }

    fn unknown_mut<'m>(&'m mut self, x: &'m mut [f64], unknown: u32) -> &'m mut f64 {
        let states = x.len();
        match (unknown as usize).checked_sub(states) {
            None => &mut x[unknown as usize],
            Some(constant) => &mut self.run.conserved[constant],
        }
    }

    /// Residuals of balances and resets, with their derivatives by the unknowns and by the impulses, and with what they add up.
    pub(super) fn balanced(
        &mut self,
        t: f64,
        x: &[f64],
        balance: &ImpulseBalance,
        work: &mut ImpulseWork,
    ) -> Result<(), Failure> {
        let jumps = &balance.jumps;
        let ImpulseWork { stored: before, asked, impulses, equations, sizes, greatest, kept, been } = work;
        let (n, m) = (balance.unknowns(), balance.unknowns() + asked.len());
        let rows = jumps.balances.len();
        equations.clear(rows + asked.len(), m);
        sizes.clear();
        sizes.resize(rows + asked.len(), 0.0);
        let Elimination { matrix, residual, .. } = equations;
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
                let (mut sum, mut slope, mut size) = (0.0, 0.0, 0.0);
                for &(k, _) in terms {
                    let ((c, dc), (stored, change)) = (at(factor), at(k as usize));
                    let jump = stored - before[k as usize];
                    sum += c * jump;
                    slope += c * change + dc * jump;
                    size +=
                        (c * stored).abs() + (c * before[k as usize]).abs() + (NOTHING * c * kept[k as usize]).abs();
                    factor += 1;
                }
                (residual[row], sizes[row]) = (sum, size);
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
                    let row = row as usize;
                    residual[row] -= c * impulses[place];
                    sizes[row] += (c * impulses[place]).abs();
                    matrix[row * m + n + place] = -c;
                    if column < n {
                        matrix[row * m + column] -= dc * impulses[place];
                    }
                }
            }
            for (k, a) in asked.iter().enumerate() {
                let (value, slope) = at(a.output);
                (residual[rows + k], sizes[rows + k]) = (value - a.value, value.abs().max(a.value.abs()));
                if column < n {
                    matrix[(rows + k) * m + column] = slope;
                }
            }
            // What is reset may be a small difference of what storages keep.
            if let Some(&unknown) = jumps.unknowns.get(column) {
                let value = match (unknown as usize).checked_sub(x.len()) {
                    None => x[unknown as usize],
                    Some(constant) => self.run.conserved[constant],
                };
                for (k, a) in asked.iter().enumerate() {
                    let slope = self.frame.d[balance.all.outputs[a.output] as usize];
                    greatest[k] = greatest[k].max((slope * value).abs()).max((NOTHING * slope * been[column]).abs());
                }
            }
        }
        for (size, greatest) in sizes[rows..].iter_mut().zip(greatest.iter()) {
            *size = size.max(*greatest);
        }
        Ok(())
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
