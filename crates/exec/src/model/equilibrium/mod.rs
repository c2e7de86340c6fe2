//! Equilibria: Newton's method, and pseudo-transient continuation where it fails. Source: [KelleyKeyes].
//!
//! Equations are sparse, and of the size of the model: those of a net of many nodes are solved as those of an implicit step
//! are. Up to a few states they are full, and the shortest of many solutions is told by singular values.

mod leaf;
mod led;
mod loads;
mod open_equations;
mod point;
mod rest;
mod tangent;

pub(super) use point::exchanged;

use super::{EquilibriumError, Model};
use halfarrow_sim::{Events, Jacobian, StepEnd, System};
use leaf::Leaf;
use point::LinearisedPoint;
use rest::Rest;

const ITERATIONS: usize = 200;
/// How often what is delayed or sampled is taken anew where the rest has come to rest.
const ROUNDS: usize = 50;
/// Up to so many states equations are full.
const FEW_STATES: usize = 50;
/// A step of Newton's method that leaves more than this part of the rates, so many times in a row, is given up.
const NEARER: f64 = 0.99;
const SLOW: usize = 10;
/// How many places of a step are looked at for whether the motion turns round on its way.
const ON_THE_WAY: u32 = 8;
/// Steps by which the motion is followed away from where laws are flat, as powers of ten in s, and how many of each.
const TIMES_AWAY: std::ops::RangeInclusive<i32> = -6..=6;
const STEPS_AWAY: usize = 3;
/// A rate that changes its state by less than this part of it, in the shortest time that the model knows, says nothing of a step.
const UNSEEN: f64 = 1e-12;
/// What is rounding of a place.
const LAST_DIGITS: f64 = 4.0 * f64::EPSILON;
/// A constraint counts as kept if it is missed by less than this fraction of what its displacements come to.
const KEPT: f64 = 1e-8;

/// A state at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Equilibrium {
    /// The state.
    pub x: Vec<f64>,
    /// How many combinations of states may have any value: 0 if the equilibrium stands alone, 1 on a line of them, of
    /// which this is one near the start values.
    pub free: usize,
    /// Iterations made.
    pub iterations: usize,
}

/// The least rates of a search, all weighed as at its beginning.
struct LeastRates {
    weights: Vec<f64>,
    least: f64,
    /// The states that still move there, with their rates.
    moving: Vec<(usize, f64)>,
}

impl LeastRates {
    fn update(&mut self, rates: &[f64], rest: &Rest) {
        let size = rates.iter().zip(&self.weights).fold(0.0f64, |most, (r, w)| most.max((r * w).abs()));
        if size < self.least {
            (self.least, self.moving) = (size, rest.moving(rates));
        }
    }
}

/// What rates count, where one that no state changes but by rounding, as that of the first number of a quaternion at rest, does not
/// count beyond measure.
fn bounded_weights(weights: &[f64], leaf: Option<&Leaf>, at: &LinearisedPoint) -> Vec<f64> {
    let Some(leaf) = leaf else { return weights.to_vec() };
    let unseen = UNSEEN * at.fastest_pair();
    let bounded = |(w, size): (&f64, &f64)| if w * unseen * size > 1.0 { 1.0 / (unseen * size) } else { *w };
    weights.iter().zip(&leaf.size).map(bounded).collect()
}

impl Model {
    /// The equilibrium nearest to `x` at time `t`, with inputs and conditions as they are then: Newton with the exact
    /// Jacobian, by way of pseudo-transient continuation where Newton alone does not get there; where that fails as well,
    /// by continuation: the loads that would hold `x` at rest are taken away little by little, and the equilibrium is followed,
    /// round folds too.
    ///
    /// What is delayed or sampled is what it follows, as at a start: it is taken anew where a search has ended, until nothing moves. Where
    /// a set-valued law is at rest at `x` in another branch than that with which runs begin, as a block that sticks, `x` is the answer.
    ///
    /// The search goes only where the junction structure lets the states go from `x`: relations of displacements hold at
    /// the equilibrium as they do at `x`, those of constraints and those that the graph implies. `x` should keep the
    /// constraints.
    ///
    /// # Errors
    /// There is none near, the relations that states keep are too long to be written out, or the model has no value on the
    /// way.
    pub fn equilibrium(&mut self, t: f64, x: &[f64]) -> Result<Equilibrium, EquilibriumError> {
        if self.code.program.relations.unwritten {
            return Err(EquilibriumError::Relations);
        }
        self.restart();
        let before = self.run.positions.clone();
        let sticks = !self.code.program.set_valued.is_empty() && self.begins_at_rest(t, x);
        let found = match sticks {
            true => Ok(Equilibrium { x: x.to_vec(), free: 0, iterations: 0 }),
            false => self.search_with_held_signals(t, x),
        };
        let found = found.and_then(|found| {
            self.vary_rest(t, &found.x).map_err(EquilibriumError::Failure)?;
            Ok(found)
        });
        if found.is_err() {
            self.run.positions = before;
            self.start_at_positions();
        }
        found
    }

    /// The search, again from where it has ended as long as held signals are others there.
    fn search_with_held_signals(&mut self, t: f64, x: &[f64]) -> Result<Equilibrium, EquilibriumError> {
        let mut x = x.to_vec();
        for _ in 0..ROUNDS {
            self.begin_delays_and_samples(t, &x).map_err(EquilibriumError::Failure)?;
            let found = self.search_equilibrium(t, &x).and_then(|found| self.at_rest_in_others(t, found))?;
            let found = self.in_this_mode(t, found)?;
            if self.run.delays_and_samples.is_empty() || self.begins_at_rest(t, &found.x) {
                return Ok(found);
            }
            x = found.x;
        }
        Err(EquilibriumError::Held(self.code.program.held.iter().map(|held| held.name.clone()).collect()))
    }

    /// Whether a run that begins at `(t, x)` is at rest there: after what happens at its beginning, in the branches of set-valued laws
    /// that it then has.
    fn begins_at_rest(&self, t: f64, x: &[f64]) -> bool {
        let (mut begun, mut y) = (self.clone(), x.to_vec());
        begun.restart();
        let begins = begun.begin_delays_and_samples(t, x).is_ok() && begun.handle_event(t, &mut y).is_ok();
        // In another branch other variables may tell the same state; what happens at events would be another one.
        let same = match begun.run.mode == self.run.mode {
            true => y == x,
            false => begun.code.program.clauses.iter().all(|clause| clause.bound.is_some()),
        };
        if !(begins && same) {
            return false;
        }
        let leaf = begun.leaf(t, &y);
        let mut jacobian = Jacobian::new(begun.sparsity());
        begun.rests_at(&mut jacobian, leaf.as_ref(), t, &y)
    }

    /// Whether rates are as good as zero at `x`, beside what they add up there and nowhere else.
    fn rests_at(&mut self, jacobian: &mut Jacobian, leaf: Option<&Leaf>, t: f64, x: &[f64]) -> bool {
        let Ok(inert) = self.inert(jacobian, t, x) else { return false };
        let Ok(at) = self.point(jacobian, (leaf, &inert), t, x.to_vec()) else { return false };
        let mut rest = Rest::new(x);
        rest.see(&at);
        rest.is_reached(&at)
    }

    /// What was found, if no branch of a set-valued law has ended there.
    fn in_this_mode(&mut self, t: f64, found: Equilibrium) -> Result<Equilibrium, EquilibriumError> {
        let ended = self.laws_ended(t, &found.x).map_err(EquilibriumError::Failure)?;
        if ended.is_empty() { Ok(found) } else { Err(EquilibriumError::Ended(ended)) }
    }

    /// What was found, if it is at rest in the independent variables too that a run would take from there: at a dead centre
    /// nothing moves the slide, whatever its crank does. Else the search goes on in those, and what it finds is told in the
    /// present ones.
    fn at_rest_in_others(&mut self, t: f64, found: Equilibrium) -> Result<Equilibrium, EquilibriumError> {
        if !self.may_change_mode() {
            return Ok(found);
        }
        let (mut other, mut y) = (self.clone(), found.x.clone());
        other.run.pivots.clear();
        if !other.exchange(t, &mut y, StepEnd::Controlled).map_err(EquilibriumError::Failure)? {
            return Ok(found);
        }
        let leaf = other.leaf(t, &y);
        let mut jacobian = Jacobian::new(other.sparsity());
        if other.rests_at(&mut jacobian, leaf.as_ref(), t, &y) {
            return Ok(found);
        }
        let rates = other.dx.iter().copied().enumerate();
        let fastest = rates.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let moving = fastest.map(|(i, rate)| (other.state_name(i), rate)).into_iter().collect();
        let there = other.search_equilibrium(t, &y)?;
        let values = other.values_of_all(t, &there.x).map_err(EquilibriumError::Failure)?;
        let mut x = there.x.clone();
        match other.go_over(self.run.mode, t, &mut x, &values).map_err(EquilibriumError::Failure)? {
            true => *self = other,
            false => return Err(EquilibriumError::None(moving)),
        }
        Ok(Equilibrium { x, ..there })
    }

    /// The search in the present variables. What moves at its end as it did at the beginning, clearly, is not at rest.
    fn search_equilibrium(&mut self, t: f64, x: &[f64]) -> Result<Equilibrium, EquilibriumError> {
        let leaf = self.leaf(t, x);
        let leaf = leaf.as_ref();
        let mut jacobian = Jacobian::new(self.sparsity());
        let inert = self.inert(&mut jacobian, t, x).map_err(EquilibriumError::Failure)?;
        let within = (leaf, inert.as_slice());
        let mut beginning = Rest::new(x);
        beginning.see(&self.point(&mut jacobian, within, t, x.to_vec()).map_err(EquilibriumError::Failure)?);
        let found = self.search_on_all_ways(&mut jacobian, within, t, x)?;
        self.rates_at(t, &found.x).map_err(EquilibriumError::Failure)?;
        if beginning.are_unchanged(&self.dx) || self.is_of_rounding(&beginning, t, &found.x) {
            self.rates_at(t, x).map_err(EquilibriumError::Failure)?;
            let moving = beginning.moving(&self.dx).into_iter();
            return Err(EquilibriumError::None(moving.map(|(i, rate)| (self.state_name(i), rate)).collect()));
        }
        Ok(found)
    }

    fn search_on_all_ways(
        &mut self,
        jacobian: &mut Jacobian,
        within: (Option<&Leaf>, &[bool]),
        t: f64,
        x: &[f64],
    ) -> Result<Equilibrium, EquilibriumError> {
        let leaf = within.0;
        let refused = match self.settle(jacobian, within, t, x).and_then(|found| self.audited(leaf, t, found)) {
            Err(EquilibriumError::Failure(failure)) => return Err(EquilibriumError::Failure(failure)),
            Err(refused) => refused,
            found => return found,
        };
        if let Some(found) = self.settle_from_where_laws_bend(jacobian, within, t, x) {
            return Ok(found);
        }
        let released = self.release_loads(within, t, x);
        let found = released.and_then(|near| self.settled(jacobian, within, t, &near));
        found.or_else(|| self.settle_away(jacobian, within, t, x)).ok_or(refused)
    }

    /// A search from the end of what is about linear on the way to the equilibrium of the linearised equations: behind it a diode
    /// conducts that hardly did, and from there it is told well.
    fn settle_from_where_laws_bend(
        &mut self,
        jacobian: &mut Jacobian,
        within: (Option<&Leaf>, &[bool]),
        t: f64,
        x: &[f64],
    ) -> Option<Equilibrium> {
        if within.0.is_some() {
            return None;
        }
        let at = self.point(jacobian, within, t, x.to_vec()).ok()?;
        let step = at.newton_step(true)?.step;
        let mut pulls = vec![0.0f64; x.len()];
        at.entries().for_each(|(i, j, v)| pulls[i] += (v * step[j]).abs());
        let (part, _) = self.clone().about_linear(t, x, &step, &at.rates, &pulls)?;
        let step: Vec<f64> = step.iter().map(|step| part * step).collect();
        let there = self.moved(within.0, t, x, &step)?;
        let inert = self.inert(jacobian, t, &there).ok()?;
        self.settled(jacobian, (within.0, &inert), t, &there)
    }

    /// From where laws are flat, or infinitely steep, a slope says nothing of what is further on: a pipe in which nothing flows, a
    /// weir below its edge, tanks that are level. So searches begin where the motion leads from there, in times from short to long.
    fn settle_away(
        &mut self,
        jacobian: &mut Jacobian,
        within: (Option<&Leaf>, &[bool]),
        t: f64,
        x: &[f64],
    ) -> Option<Equilibrium> {
        let at = self.point(jacobian, within, t, x.to_vec()).ok()?;
        // What is flat along a leaf is where a body is, which leads nowhere else.
        let flat = within.0.is_none() && at.has_flat_state();
        if x.len() > FEW_STATES || !(self.code.program.steep || flat) {
            return None;
        }
        for decade in TIMES_AWAY {
            let time = crate::math::pow(10.0, f64::from(decade));
            let mut there = x.to_vec();
            for _ in 0..STEPS_AWAY {
                self.rates_at(t, &there).ok()?;
                let step: Vec<f64> = self.dx.iter().map(|rate| time * rate).collect();
                let Some(next) = self.moved(within.0, t, &there, &step) else { break };
                there = next;
                let Ok(inert) = self.inert(jacobian, t, &there) else { break };
                let found = self.settled(jacobian, (within.0, &inert), t, &there);
                if let Some(found) = found.filter(|found| self.rests_at(jacobian, within.0, t, &found.x)) {
                    return Some(found);
                }
            }
        }
        None
    }

    /// What a search from `x` finds, if constraints are kept there.
    fn settled(
        &mut self,
        jacobian: &mut Jacobian,
        within: (Option<&Leaf>, &[bool]),
        t: f64,
        x: &[f64],
    ) -> Option<Equilibrium> {
        let found = self.settle(jacobian, within, t, x).ok()?;
        self.audited(within.0, t, found).ok()
    }

    /// What was found, if the constraints are kept there.
    fn audited(&mut self, leaf: Option<&Leaf>, t: f64, found: Equilibrium) -> Result<Equilibrium, EquilibriumError> {
        let constraints = self.constraints();
        match self.unmet_constraint(&constraints, t, &found.x, leaf.map_or(&[], |leaf| &leaf.size), KEPT) {
            Some((name, miss)) => Err(EquilibriumError::Missed(name, miss)),
            None => Ok(found),
        }
    }

    /// Newton's method from `x`; where it fails pseudo-transient continuation, whose step grows as the rates shrink (switched
    /// evolution relaxation), until it is Newton's again. Inert states stay.
    fn settle(
        &mut self,
        jacobian: &mut Jacobian,
        (leaf, inert): (Option<&Leaf>, &[bool]),
        t: f64,
        x: &[f64],
    ) -> Result<Equilibrium, EquilibriumError> {
        let mut pseudo_step = f64::INFINITY;
        let mut least: Option<LeastRates> = None;
        let mut rest = Rest::new(x);
        // Where steps as the motion goes have ended.
        let mut stuck: Option<LinearisedPoint> = None;
        let mut at = self.point(jacobian, (leaf, inert), t, x.to_vec()).map_err(EquilibriumError::Failure)?;
        let mut slow = 0;
        for iteration in 0..ITERATIONS {
            rest.see(&at);
            let Some(newton) = at.newton_step(stuck.is_none()) else { break };
            let found = || Equilibrium { x: at.x.clone(), free: newton.free, iterations: iteration };
            let weights = bounded_weights(&newton.weights, leaf, &at);
            let first = || LeastRates { weights: weights.clone(), least: f64::INFINITY, moving: Vec::new() };
            least.get_or_insert_with(first).update(&at.rates, &rest);
            let stands = newton.step.iter().zip(&at.x).all(|(step, x)| step.abs() <= 1e-13 * x.abs());
            // Along a leaf rates vanish with the relations that it keeps, and steps are those of positions that turn.
            let rests = rest.is_reached(&at);
            let reached =
                rests && (leaf.is_some() || rest.is_near(&at, &newton.step)) && !self.is_of_rounding(&rest, t, &at.x);
            if stands || rest.is_exact(&at) {
                if reached {
                    return Ok(found());
                }
                if pseudo_step.is_infinite() && (stands || !rests) {
                    break;
                }
            }
            let norm = |r: &[f64]| r.iter().zip(&weights).map(|(r, w)| (r * w) * (r * w)).sum::<f64>().sqrt();
            let before = norm(&at.rates);
            let step = match pseudo_step.is_infinite() {
                true => newton.step.clone(),
                false => at.pseudo_transient_step(pseudo_step).unwrap_or_else(|| newton.step.clone()),
            };
            let least_damping = if pseudo_step.is_infinite() { 1e-3 } else { 1e-9 };
            let mut damping = 1.0;
            let moved = loop {
                let part: Vec<f64> = step.iter().map(|s| damping * s).collect();
                let trial = self.moved(leaf, t, &at.x, &part);
                let kept = trial.filter(|trial| !self.leaves_constraints(leaf, t, trial));
                let nearer = kept.filter(|trial| {
                    let known = self.rates_at(t, trial).is_ok();
                    known && (norm(&self.dx) < before || !pseudo_step.is_infinite())
                });
                let nearer = nearer.filter(|_| {
                    !pseudo_step.is_infinite() || !self.turns_round(leaf, t, (&at.x, &part), (&at.rates, &weights))
                });
                match nearer.and_then(|trial| self.point(jacobian, (leaf, inert), t, trial).ok()) {
                    Some(next) => break Some(next),
                    _ if damping < least_damping => break None,
                    _ => damping *= 0.5,
                }
            };
            // Steps that come no nearer, one after the other, lead nowhere.
            slow = match &moved {
                Some(next) if pseudo_step.is_infinite() && norm(&next.rates) > NEARER * before => slow + 1,
                _ => 0,
            };
            match moved.filter(|_| slow <= SLOW) {
                Some(next) => {
                    let gain = (before / norm(&next.rates).max(f64::MIN_POSITIVE)).clamp(0.3, 10.0);
                    pseudo_step *= gain;
                    pseudo_step = if pseudo_step > 1e12 { f64::INFINITY } else { pseudo_step };
                    at = next;
                }
                // No step comes nearer, since only rounding is left.
                None if reached => return Ok(found()),
                // Steps as the motion goes end where nothing can be done: the shortest ones, then.
                None if pseudo_step.is_infinite() && stuck.is_none() && newton.free > 0 && x.len() <= FEW_STATES => {
                    let start =
                        self.point(jacobian, (leaf, inert), t, x.to_vec()).map_err(EquilibriumError::Failure)?;
                    stuck = Some(std::mem::replace(&mut at, start));
                }
                // Newton's method fails: follow the motion in pseudo-time, with a small step at first.
                None if pseudo_step.is_infinite() => {
                    at = stuck.take().unwrap_or(at);
                    let fastest = at.entries().fold(0.0f64, |most, (_, _, j)| most.max(j.abs()));
                    pseudo_step = if fastest > 0.0 { 0.1 / fastest } else { break };
                }
                None => break,
            }
        }
        let moving = least.map(|least| least.moving).filter(|moving| !moving.is_empty());
        let moving = moving.unwrap_or_else(|| rest.moving(&at.rates));
        Err(EquilibriumError::None(moving.into_iter().map(|(i, rate)| (self.state_name(i), rate)).collect()))
    }

    /// Whether on a straight way the motion turns round, half as fast as where it begins: then the way leads past a place of rest,
    /// as several turns of a pendulum do, though where it ends things may be at rest, too.
    fn turns_round(
        &mut self,
        leaf: Option<&Leaf>,
        t: f64,
        (from, way): (&[f64], &[f64]),
        (rates, weights): (&[f64], &[f64]),
    ) -> bool {
        let along =
            |r: &[f64]| r.iter().zip(rates).zip(weights).map(|((r, first), w)| r * w * (first * w)).sum::<f64>();
        // Along a leaf each place takes a way of its own.
        let places = if leaf.is_some() { 2 } else { ON_THE_WAY };
        let first = along(rates);
        (1..=places).any(|k| {
            let part: Vec<f64> = way.iter().map(|way| way * f64::from(k) / f64::from(places)).collect();
            let Some(there) = self.moved(leaf, t, from, &part) else { return false };
            self.rates_at(t, &there).is_ok() && along(&self.dx) < -0.5 * first
        })
    }

    /// Whether what rounding makes of a place moves as much as where the search began: then it is one of rest by chance, as where
    /// bodies are so far away that no digit is left of what is between them.
    fn is_of_rounding(&mut self, rest: &Rest, t: f64, x: &[f64]) -> bool {
        [1.0, -1.0].into_iter().any(|way| {
            let moved = |(i, x): (usize, &f64)| x * (1.0 + if i % 2 == 0 { way } else { -way } * LAST_DIGITS);
            let near: Vec<f64> = x.iter().enumerate().map(moved).collect();
            self.rates_at(t, &near).is_ok() && rest.are_unchanged(&self.dx)
        })
    }

    /// Whether a move has left a constraint: near a position where a form is singular a long one may.
    fn leaves_constraints(&mut self, leaf: Option<&Leaf>, t: f64, x: &[f64]) -> bool {
        leaf.is_some_and(|leaf| self.unmet_constraint(&leaf.constraints, t, x, &leaf.size, KEPT).is_some())
    }
}
