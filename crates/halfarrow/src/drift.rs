//! How far positions drift from what only their speeds keep, as it is told.

use halfarrow_audit::{self as audit, DriftKind};
use halfarrow_compiler::program::{Program, Unkept};
use halfarrow_exec as exec;
use serde::Serialize;

/// How far positions have drifted from a relation that their speeds keep.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriftReport {
    /// The relation: an expression of positions that keeps its value (`closed`), else a sum of rates that vanishes.
    pub relation: String,
    /// `closed`: the relation is one of positions in closed form; `open`: it is one of positions, without a closed form;
    /// `nonholonomic`: it binds speeds and no positions; `undecided`.
    pub kind: &'static str,
    /// What the expression has changed by at the end of the run, in SI units; without a closed form, what the positions
    /// have left their rates by, times their factors. `None` where there is none, or it was not measured.
    pub value: Option<f64>,
    /// The greatest such change on the run; `None` where that was not measured, as in runs without an audit.
    pub greatest: Option<f64>,
    /// Below this a drift says nothing.
    pub resolution: f64,
}

/// How far positions have drifted in the sets of a sweep from a relation that their speeds keep.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweepDrift {
    /// The relation, as in [`DriftReport`].
    pub relation: String,
    /// As in [`DriftReport`].
    pub kind: &'static str,
    /// The greatest magnitude of the drift at the end of a set, in SI units; `None` where it was measured in none.
    pub greatest: Option<f64>,
    /// The number of that set, from 1; `None` where only the sets that are audited were measured.
    pub set: Option<usize>,
    /// In how many sets it was measured.
    pub sets: usize,
    /// Below this a drift says nothing.
    pub resolution: f64,
}

impl From<audit::Drift> for DriftReport {
    fn from(d: audit::Drift) -> DriftReport {
        let kind = match d.kind {
            DriftKind::Closed => CLOSED,
            DriftKind::Open => "open",
            DriftKind::Nonholonomic => "nonholonomic",
            DriftKind::Undecided => "undecided",
        };
        let audit::Drift { relation, value, greatest, resolution, .. } = d;
        DriftReport { relation, kind, value, greatest, resolution }
    }
}

const CLOSED: &str = "closed";

impl DriftReport {
    fn closed(drifted: exec::Drifted) -> DriftReport {
        let exec::Drifted { relation, value, resolution } = drifted;
        DriftReport { relation, kind: CLOSED, value: Some(value), greatest: None, resolution }
    }

    /// Keeps the greater of two.
    fn widen(&mut self, other: &DriftReport) {
        let greater = |own: Option<f64>, other: Option<f64>| match (own, other) {
            (Some(own), Some(other)) if other.abs() > own.abs() || other.is_nan() => Some(other),
            (own, other) => own.or(other),
        };
        self.value = greater(self.value, other.value);
        self.greatest = greater(self.greatest, other.greatest);
        self.resolution = self.resolution.max(other.resolution);
    }
}

/// The relations of which a run by itself measures no drift.
fn unmeasured(program: &Program) -> impl Iterator<Item = DriftReport> + '_ {
    program.unkept_relations.iter().map(|relation| DriftReport {
        relation: relation.text.clone(),
        kind: match relation.reason {
            Unkept::Nonholonomic => "nonholonomic",
            Unkept::NoClosedForm => "open",
            Unkept::Undecided => "undecided",
            Unkept::Reads(_) => CLOSED,
        },
        value: None,
        greatest: None,
        resolution: 0.0,
    })
}

/// The drifts of a run without an audit, at `(t, x)`.
pub(crate) fn drifts_at(system: &mut exec::Model, t: f64, x: &[f64]) -> Vec<DriftReport> {
    // What has no value there was not measured.
    let measured = system.drift(t, x).unwrap_or_default();
    measured.into_iter().map(DriftReport::closed).chain(unmeasured(system.program())).collect()
}

/// Keeps the greater drift of each relation.
pub(crate) fn widen(all: &mut Vec<DriftReport>, more: Vec<DriftReport>) {
    for drift in more {
        match all.iter_mut().find(|known| known.relation == drift.relation) {
            Some(known) => known.widen(&drift),
            None => all.push(drift),
        }
    }
}

/// The greatest drift from a relation among sets.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SetDrift {
    pub relation: String,
    pub greatest: f64,
    pub set: usize,
    pub sets: usize,
    pub resolution: f64,
}

impl SetDrift {
    /// That of one set.
    pub fn of(drifted: exec::Drifted, set: usize) -> SetDrift {
        let exec::Drifted { relation, value, resolution } = drifted;
        SetDrift { relation, greatest: value.abs(), set, sets: 1, resolution }
    }

    /// Adds the sets of another one to these.
    pub fn gather(all: &mut Vec<SetDrift>, more: SetDrift) {
        let Some(known) = all.iter_mut().find(|known| known.relation == more.relation) else { return all.push(more) };
        if more.greatest > known.greatest || more.greatest.is_nan() {
            (known.greatest, known.set) = (more.greatest, more.set);
        }
        known.sets += more.sets;
        known.resolution = known.resolution.max(more.resolution);
    }
}

/// What a sweep tells: of what its runs have measured, and of the rest what the audit of some sets has found.
pub(crate) fn of_sweep(measured: Vec<SetDrift>, audited: &[DriftReport], sets: usize) -> Vec<SweepDrift> {
    let others = audited.iter().filter(|d| measured.iter().all(|m| m.relation != d.relation));
    let of_audit = others.map(|d| SweepDrift {
        relation: d.relation.clone(),
        kind: d.kind,
        greatest: d.value.map(f64::abs),
        set: None,
        sets: if d.value.is_some() { sets } else { 0 },
        resolution: d.resolution,
    });
    let of_audit: Vec<SweepDrift> = of_audit.collect();
    let told = |m: SetDrift| SweepDrift {
        relation: m.relation,
        kind: CLOSED,
        greatest: Some(m.greatest),
        set: Some(m.set),
        sets: m.sets,
        resolution: m.resolution,
    };
    measured.into_iter().map(told).chain(of_audit).collect()
}
