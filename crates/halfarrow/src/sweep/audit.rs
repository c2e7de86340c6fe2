//! A sample of the sets of a sweep, run once more and audited.

use halfarrow_sim::Nobody;
use rayon::prelude::*;
use serde::Serialize;

use super::{SweepContext, prepare};
use crate::audited::{AuditReport, Audited, Deviation};
use crate::drift::widen;
use crate::run::Run;
use crate::verdict::{Made, Verdict};

/// Sets that are audited at most.
const MOST: usize = 16;

/// What the audit found of a sample of the sets.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SweepAudit {
    /// Number of sets that were audited: the first, the last, and some evenly between them.
    pub sets: usize,
    /// Those that miss something by more than a millionth of what is there.
    pub doubtful: usize,
    /// Those that miss something by more than a hundredth: they are not to be used, nor others near them.
    pub refused: usize,
    /// What is wrong with each of these.
    pub misses: Vec<SetMiss>,
    /// The greatest misses of all.
    pub greatest: AuditReport,
}

/// A set that misses something.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetMiss {
    /// Its number, from 1.
    pub set: usize,
    /// Whether it is doubtful or refused.
    pub verdict: Verdict,
    /// What is missed, where, when, and what to do about it.
    pub warnings: Vec<String>,
}

/// Audits some of the sets, on all cores. Sets that fail are told by their rows.
pub(super) fn sample_of(work: &SweepContext<'_>, run: &Run) -> SweepAudit {
    let of = |set: usize| Some((set, audit_set(work, run, set)?));
    let found: Vec<(usize, AuditReport)> = work.plan.sample(MOST).into_par_iter().filter_map(of).collect();
    let count = |wanted: Verdict| found.iter().filter(|(_, audit)| audit.verdict == wanted).count();
    let mut audit = SweepAudit {
        sets: found.len(),
        doubtful: count(Verdict::Doubtful),
        refused: count(Verdict::Refused),
        ..SweepAudit::default()
    };
    for (set, found) in found {
        if found.verdict != Verdict::Holds {
            let (verdict, warnings) = (found.verdict, found.warnings.clone());
            audit.misses.push(SetMiss { set: work.plan.number(set), verdict, warnings });
        }
        audit.greatest.merge(found);
    }
    audit
}

fn audit_set(work: &SweepContext<'_>, run: &Run, set: usize) -> Option<AuditReport> {
    let structure = work.structures.get(work.structures.number(set).ok()?);
    let mut system = structure.system.clone();
    let mut x = prepare(&mut system, &structure.model, work.plan, set, run.start).ok()?;
    system.record(&[]).ok()?;
    let mut audited = Audited::new(&mut system, &structure.model.graph);
    audited.simulate(work.options, &mut x, &mut Nobody).ok()?;
    let mut report = audited.finish();
    report.judge(&Made::by(run));
    Some(report)
}

impl AuditReport {
    /// Keeps the greater misses, and all that is said.
    fn merge(&mut self, other: AuditReport) {
        let pairs = [
            (&mut self.power, other.power),
            (&mut self.energy, other.energy),
            (&mut self.residual, other.residual),
            (&mut self.rates, other.rates),
        ];
        let excess = |m: &Deviation| m.value - m.resolution;
        for (greatest, found) in pairs {
            let above = |m: &Deviation| greatest.as_ref().is_none_or(|g| excess(m) > excess(g) || m.value.is_nan());
            if let Some(miss) = found.filter(above) {
                *greatest = Some(miss);
            }
        }
        self.verdict = self.verdict.max(other.verdict);
        widen(&mut self.drift, other.drift);
        for (all, more) in [(&mut self.notes, other.notes), (&mut self.unchecked, other.unchecked)] {
            all.extend(more);
            all.sort();
            all.dedup();
        }
    }
}
