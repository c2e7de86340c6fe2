//! Positions that only rates keep together are put back onto the relations between them, where a step has ended: by the
//! least change that does it. Source: [HLW], IV.4; `method.md`, 5.4.
//!
//! A position counts in parts of what moves the relations by one, by the greatest slope that it has had on the run: of angles
//! and lengths the lengths of arcs count.

use super::compiled::ModeId;
use super::{Model, minimum_norm};
use crate::bytecode::Routine;
use halfarrow_compiler::program::Value;
use halfarrow_sim::Failure;

/// Iterations of a projection: it begins so near that one or two do.
const ITERATIONS: usize = 12;
/// A relation is kept that is missed by less than so many units in the last place of what it is the sum of,
const ROUNDING: f64 = 8.0;
/// and is not met where no iteration comes nearer than so many.
const MISSED: f64 = 1e6;

/// How positions are put back.
#[derive(Debug, Clone)]
pub(super) struct Projection {
    mode: ModeId,
    /// The relations in turn: its value, its slopes.
    routine: Routine,
    relations: Vec<Row>,
    /// The greatest slope of each state so far.
    greatest: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Row {
    /// Where its value stands among the outputs of the routine; its slopes follow.
    at: usize,
    /// The states that its slopes are by.
    states: Vec<usize>,
    vanishes: bool,
    /// What it keeps.
    value: f64,
}

/// The relations at a point.
struct Missed {
    /// How far each is from what it keeps.
    by: Vec<f64>,
    /// The same in units of the last place.
    most: f64,
    /// The slopes, row by row.
    slopes: Vec<f64>,
}

impl Model {
    /// Begins to keep relations as they are at `(t, x)`.
    fn begin_projection(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let mut wanted: Vec<Value> = Vec::new();
        let mut relations = Vec::new();
        for relation in &self.code.program.position_relations {
            let states = relation.slopes.iter().map(|s| s.0 as usize).collect();
            relations.push(Row { at: wanted.len(), states, vanishes: relation.vanishes, value: 0.0 });
            wanted.extend(relation.values());
        }
        let routine = self.routine_for(&wanted);
        let greatest = vec![0.0; x.len()];
        self.projection = Some(Projection { mode: self.run.mode, routine, relations, greatest });
        let values = self.relations_at(t, x)?;
        let rows = self.projection.iter_mut().flat_map(|p| &mut p.relations);
        rows.zip(values).filter(|(row, _)| !row.vanishes).for_each(|(row, value)| row.value = value);
        Ok(())
    }

    /// The values of the relations.
    fn relations_at(&mut self, t: f64, x: &[f64]) -> Result<Vec<f64>, Failure> {
        self.place(t, x);
        let Some(projection) = &self.projection else { return Ok(Vec::new()) };
        self.frame.run(&projection.routine).map_err(|error| self.failure(t, error))?;
        let output = |at: usize| self.frame.r[projection.routine.outputs[at] as usize];
        Ok(projection.relations.iter().map(|row| output(row.at)).collect())
    }

    /// The relations are kept from here on as they are now.
    pub(super) fn renew_projection(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        match self.projection.take() {
            Some(_) => self.begin_projection(t, x),
            None => Ok(()),
        }
    }

    /// What the relations come to before an event, which may move positions or what the relations read.
    pub(super) fn before_move(&mut self, t: f64, x: &[f64]) -> Result<Option<Vec<f64>>, Failure> {
        match self.projection.as_ref().is_some_and(|p| p.mode == self.run.mode) {
            true => self.relations_at(t, x).map(Some),
            false => Ok(None),
        }
    }

    /// From here on the relations keep what the event has made of them.
    pub(super) fn after_move(&mut self, before: Option<Vec<f64>>, t: f64, x: &[f64]) -> Result<(), Failure> {
        let Some(before) = before else { return Ok(()) };
        if self.projection.as_ref().is_some_and(|p| p.mode != self.run.mode) {
            return self.renew_projection(t, x);
        }
        let after = self.relations_at(t, x)?;
        let rows = self.projection.iter_mut().flat_map(|p| &mut p.relations);
        for ((row, before), after) in rows.zip(before).zip(after).filter(|((row, _), _)| !row.vanishes) {
            row.value += after - before;
        }
        Ok(())
    }

    /// Puts the positions of `x` back; `true` if that has moved it. The first call notes what is kept.
    pub(super) fn put_back(&mut self, t: f64, x: &mut [f64]) -> Result<bool, Failure> {
        if self.code.program.position_relations.is_empty() {
            return Ok(false);
        }
        if self.projection.as_ref().is_none_or(|p| p.mode != self.run.mode) {
            self.begin_projection(t, x)?;
            return Ok(false);
        }
        let begun = x.to_vec();
        let mut missed = self.missed(t, x)?;
        for _ in 0..ITERATIONS {
            if missed.most <= ROUNDING {
                break;
            }
            let Some(step) = self.step_back(&missed, x.len()) else { break };
            let before = x.to_vec();
            x.iter_mut().zip(&step).for_each(|(x, step)| *x += step);
            let now = self.missed(t, x)?;
            if now.most.is_nan() || now.most >= missed.most {
                x.copy_from_slice(&before);
                break;
            }
            missed = now;
        }
        if missed.most.is_nan() || missed.most > MISSED {
            let residual = missed.by.iter().fold(0.0f64, |most, by| most.max(by.abs()));
            let what = "the positions that are put back onto what their speeds keep".to_string();
            return Err(Failure::NoConvergence { time: t, what, iterations: ITERATIONS, residual });
        }
        Ok(x != begun.as_slice())
    }

    fn missed(&mut self, t: f64, x: &[f64]) -> Result<Missed, Failure> {
        let values = self.relations_at(t, x)?;
        let Model { projection, frame, .. } = self;
        let Some(Projection { routine, relations, greatest, .. }) = projection else {
            return Ok(Missed { by: Vec::new(), most: 0.0, slopes: Vec::new() });
        };
        let n = x.len();
        let mut missed = Missed { by: Vec::new(), most: 0.0, slopes: vec![0.0; n * relations.len()] };
        for (k, (row, value)) in relations.iter().zip(values).enumerate() {
            let by = value - row.value;
            let mut size = value.abs() + row.value.abs();
            for (place, &state) in row.states.iter().enumerate() {
                let slope = frame.r[routine.outputs[row.at + 1 + place] as usize];
                missed.slopes[k * n + state] = slope;
                greatest[state] = greatest[state].max(slope.abs());
                size += (slope * x[state]).abs();
            }
            missed.by.push(by);
            let places = if by == 0.0 { 0.0 } else { by.abs() / (f64::EPSILON * size) };
            missed.most = if places.is_nan() { f64::NAN } else { missed.most.max(places) };
        }
        Ok(missed)
    }

    /// The least change of the positions by which the relations are met as far as their slopes tell.
    fn step_back(&self, missed: &Missed, states: usize) -> Option<Vec<f64>> {
        let sizes: Vec<f64> = self.projection.as_ref()?.greatest.iter().map(|&g| minimum_norm::inverse(g)).collect();
        minimum_norm::sized_step(&missed.slopes, &missed.by, states, &sizes)
    }
}
