//! Positions that only rates keep together: how far they drift from the relations between them, and how they are put back
//! where a step has ended, by the least change that does it. Source: [HLW], IV.4; `method.md`, 5.4.
//!
//! A position counts in parts of what moves the relations by one, by the greatest slope that it has had on the run: of angles
//! and lengths the lengths of arcs count. No step takes memory but the first one of a mode.

mod change;

use super::Model;
use super::compiled::ModeId;
use super::minimum_norm;
use crate::bytecode::Routine;
use change::LeastChange;
use halfarrow_compiler::program::{PositionRelation, Value};
use halfarrow_sim::Failure;

/// Iterations of a projection: it begins so near that one or two do.
const ITERATIONS: usize = 12;
/// A relation is kept that is missed by less than so many units in the last place of what it is the sum of,
const ROUNDING: f64 = 8.0;
/// and is not met where no iteration comes nearer than so many.
const MISSED: f64 = 1e6;

/// What relations between positions keep, in a run that puts them back or tells how far they drift.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Kept {
    /// The mode that it belongs to; `None`: nothing has been noted yet.
    mode: Option<ModeId>,
    /// What each relation keeps.
    values: Vec<f64>,
    /// What each came to before the event that is handled.
    before: Vec<f64>,
    /// How far positions had drifted from each before that was noted.
    drifted: Vec<f64>,
    /// The greatest slope of each state so far.
    greatest: Vec<f64>,
}

/// How far positions have drifted from a relation that only speeds keep.
#[derive(Debug, Clone, PartialEq)]
pub struct Drifted {
    /// What keeps its value, as text.
    pub relation: String,
    /// What it has changed by since the start, without what events have changed, in SI units.
    pub value: f64,
    /// Below this a drift says nothing.
    pub resolution: f64,
}

/// The relations of a mode as code.
#[derive(Debug, Clone)]
pub(super) struct Projection {
    mode: ModeId,
    /// The relations in turn: its value, its slopes.
    routine: Routine,
    rows: Vec<Row>,
    /// How far each is from what it keeps.
    by: Vec<f64>,
    /// The slopes, row by row.
    slopes: Vec<f64>,
    change: LeastChange,
    /// The states before a change: that of an iteration, and that of all.
    before: Vec<f64>,
    begun: Vec<f64>,
    /// The values before an event.
    values: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Row {
    /// Where its value stands among the outputs of the routine; its slopes follow.
    at: usize,
    /// The states that its slopes are by.
    states: Vec<usize>,
    vanishes: bool,
}

impl Model {
    /// Whether the run notes what its positions keep, so that [`drift`](Model::drift) can tell how far they have drifted.
    pub fn tell_drift(&mut self, tell: bool) {
        self.tells_drift = tell;
    }

    /// How far positions have drifted at `(t, x)` from the relations that only their speeds keep, of those in closed form; in a
    /// run that [notes](Model::tell_drift) what they keep, or [puts them back](halfarrow_sim::Options::project).
    ///
    /// # Errors
    /// What the relations read has no value.
    pub fn drift(&mut self, t: f64, x: &[f64]) -> Result<Vec<Drifted>, Failure> {
        if !self.keeps() {
            return Ok(Vec::new());
        }
        self.relations_at(t, x)?;
        let Model { code, run, projection, .. } = self;
        let now = projection.iter().flat_map(|p| &p.values);
        let kept = run.kept.values.iter().zip(&run.kept.drifted);
        let all = code.program.position_relations.iter().zip(now).zip(kept);
        let told = all.filter_map(|((relation, now), (kept, drifted))| {
            let resolution = f64::EPSILON * (now.abs() + kept.abs());
            Some(Drifted { relation: relation.told.clone()?, value: drifted + (now - kept), resolution })
        });
        Ok(told.collect())
    }

    /// Whether what the present mode keeps has been noted.
    fn keeps(&self) -> bool {
        self.run.kept.mode == Some(self.run.mode)
    }

    /// Makes the code of the relations of the present mode, if it is not there.
    fn make_projection(&mut self) {
        if self.projection.as_ref().is_some_and(|p| p.mode == self.run.mode) {
            return;
        }
        let code = self.code.clone();
        let relations = &code.program.position_relations;
        let mut wanted: Vec<Value> = Vec::new();
        let mut rows = Vec::with_capacity(relations.len());
        for relation in relations {
            let states = relation.slopes.iter().map(|s| s.0 as usize).collect();
            rows.push(Row { at: wanted.len(), states, vanishes: relation.vanishes });
            wanted.extend(relation.values());
        }
        let (m, n) = (relations.len(), code.program.states.len());
        self.projection = Some(Projection {
            mode: self.run.mode,
            routine: self.routine_for(&wanted),
            rows,
            by: vec![0.0; m],
            slopes: vec![0.0; m * n],
            change: LeastChange::new(m, n),
            before: vec![0.0; n],
            begun: vec![0.0; n],
            values: vec![0.0; m],
        });
    }

    /// Begins to keep relations as they are at `(t, x)`; `drifted`: how far positions have drifted before.
    fn begin_keeping(&mut self, t: f64, x: &[f64], drifted: Vec<f64>) -> Result<(), Failure> {
        self.relations_at(t, x)?;
        let Some(projection) = &self.projection else { return Ok(()) };
        let value = |(row, value): (&Row, &f64)| if row.vanishes { 0.0 } else { *value };
        let values: Vec<f64> = projection.rows.iter().zip(&projection.values).map(value).collect();
        let (before, greatest) = (values.clone(), vec![0.0; x.len()]);
        self.run.kept = Kept { mode: Some(self.run.mode), values, before, drifted, greatest };
        Ok(())
    }

    /// Computes the values of the relations.
    fn relations_at(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.make_projection();
        self.place(t, x);
        let Model { projection, frame, .. } = self;
        let Some(Projection { routine, rows, values, .. }) = projection else { return Ok(()) };
        let done = frame.run(routine);
        values.iter_mut().zip(rows).for_each(|(value, row)| *value = frame.r[routine.outputs[row.at] as usize]);
        done.map_err(|error| self.failure(t, error))
    }

    /// Notes what positions keep where a run starts that is to tell how far they drift.
    pub(super) fn note_kept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let wanted = self.tells_drift && self.run.kept.mode.is_none();
        match wanted && !self.code.program.position_relations.is_empty() {
            true => self.begin_keeping(t, x, vec![0.0; self.code.program.position_relations.len()]),
            false => Ok(()),
        }
    }

    /// Does what may move positions, or what relations read, or change the mode: the relations keep what it makes of them.
    pub(super) fn keeping(
        &mut self,
        t: f64,
        x: &mut [f64],
        work: impl FnOnce(&mut Model, &mut [f64]) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        // A run that starts anew keeps nothing of the one before.
        if !self.keeps() || t < self.run.crossed {
            return work(self, x);
        }
        let mode = self.run.mode;
        let drifted = if self.may_change_mode() { self.drift_before(t, x)? } else { None };
        self.relations_at(t, x)?;
        if let Some(projection) = &self.projection {
            self.run.kept.before.copy_from_slice(&projection.values);
        }
        work(self, x)?;
        match self.run.mode == mode {
            true => self.after_move(t, x),
            false => self.keep_anew(drifted, t, x),
        }
    }

    /// What positions have drifted by before the mode changes at `(t, x)`, by the relations.
    pub(super) fn drift_before(&mut self, t: f64, x: &[f64]) -> Result<Option<Vec<Drifted>>, Failure> {
        if self.keeps() { self.drift(t, x).map(Some) } else { Ok(None) }
    }

    /// The relations of another mode are kept from here on as they are now.
    pub(super) fn keep_anew(&mut self, drifted: Option<Vec<Drifted>>, t: f64, x: &[f64]) -> Result<(), Failure> {
        let Some(before) = drifted else { return Ok(()) };
        let drifted = |relation: &PositionRelation| {
            let same = before.iter().find(|d| Some(&d.relation) == relation.told.as_ref());
            same.map_or(0.0, |d| d.value)
        };
        let drifted = self.code.program.position_relations.iter().map(drifted).collect();
        self.begin_keeping(t, x, drifted)
    }

    /// From here on the relations keep what an event that left their mode as it was has made of them.
    fn after_move(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.relations_at(t, x)?;
        let Model { projection, run, .. } = self;
        let Some(Projection { rows, values: after, .. }) = projection else { return Ok(()) };
        let Kept { values, before, .. } = &mut run.kept;
        for (value, ((row, before), after)) in values.iter_mut().zip(rows.iter().zip(before).zip(after)) {
            if !row.vanishes {
                *value += *after - *before;
            }
        }
        Ok(())
    }

    /// Puts the positions of `x` back; `true` if that has moved it. The first call notes what is kept.
    pub(super) fn put_back(&mut self, t: f64, x: &mut [f64]) -> Result<bool, Failure> {
        if self.code.program.position_relations.is_empty() {
            return Ok(false);
        }
        if !self.keeps() {
            let drifted = vec![0.0; self.code.program.position_relations.len()];
            self.begin_keeping(t, x, drifted)?;
            return Ok(false);
        }
        let mut missed = self.missed(t, x)?;
        if let Some(projection) = &mut self.projection {
            projection.begun.copy_from_slice(x);
        }
        for _ in 0..ITERATIONS {
            if missed <= ROUNDING || !self.step_back(x) {
                break;
            }
            let now = self.missed(t, x)?;
            if now.is_nan() || now >= missed {
                self.projection.iter().for_each(|projection| x.copy_from_slice(&projection.before));
                break;
            }
            missed = now;
        }
        let Some(Projection { by, begun, .. }) = &self.projection else { return Ok(false) };
        if missed.is_nan() || missed > MISSED {
            let residual = by.iter().fold(0.0f64, |most, by| most.max(by.abs()));
            let what = "the positions that are put back onto what their speeds keep".to_string();
            return Err(Failure::NoConvergence { time: t, what, iterations: ITERATIONS, residual });
        }
        Ok(x != begun.as_slice())
    }

    /// How far the relations are from what they keep, the most of them in units of the last place, and their slopes.
    fn missed(&mut self, t: f64, x: &[f64]) -> Result<f64, Failure> {
        self.relations_at(t, x)?;
        let Model { projection, frame, run, .. } = self;
        let Some(Projection { routine, rows, by, slopes, values, .. }) = projection else { return Ok(0.0) };
        let (n, mut most) = (x.len(), 0.0f64);
        for (k, (row, (value, kept))) in rows.iter().zip(values.iter().zip(&run.kept.values)).enumerate() {
            by[k] = value - kept;
            let mut size = value.abs() + kept.abs();
            for (place, &state) in row.states.iter().enumerate() {
                let slope = frame.r[routine.outputs[row.at + 1 + place] as usize];
                slopes[k * n + state] = slope;
                run.kept.greatest[state] = run.kept.greatest[state].max(slope.abs());
                size += (slope * x[state]).abs();
            }
            let places = if by[k] == 0.0 { 0.0 } else { by[k].abs() / (f64::EPSILON * size) };
            most = if places.is_nan() { f64::NAN } else { most.max(places) };
        }
        Ok(most)
    }

    /// Moves the positions by the least change by which the relations are met as far as their slopes tell; `false` if there
    /// is none.
    fn step_back(&mut self, x: &mut [f64]) -> bool {
        let Model { projection, run, .. } = self;
        let Some(Projection { by, slopes, change, before, .. }) = projection else { return false };
        let sizes = run.kept.greatest.iter().map(|&greatest| minimum_norm::inverse(greatest));
        let Some(step) = change.find(slopes, by, sizes) else { return false };
        before.copy_from_slice(x);
        x.iter_mut().zip(step).for_each(|(x, step)| *x += step);
        true
    }
}
