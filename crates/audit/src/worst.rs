//! The greatest miss of a kind, in numbers whose scale is known only when the run is over.

use crate::Finding;
use crate::lanes::{are_finite, greatest};
use crate::scales::{Scale, Settled, Term};

/// A miss before it is measured: what it counts relative to may still grow.
#[derive(Debug, Clone)]
pub(crate) struct Raw {
    /// In the unit of what is missed.
    pub miss: f64,
    /// What the samples leave open of it, in the same unit.
    pub resolution: f64,
    pub time: f64,
    pub place: String,
    /// What it counts relative to.
    pub terms: Vec<Term>,
}

/// What stands out above what the samples resolve by less than this does not.
const ROUNDING: f64 = 1e-14;

impl Raw {
    fn measured(&self, settled: &Settled) -> Finding {
        let scale = settled.scale(&self.terms);
        let (value, resolution) = (scale.relative(self.miss), scale.relative(self.resolution));
        Finding { value, time: self.time, place: self.place.clone(), resolution }
    }
}

/// The greatest misses of the parts of a run, and that of the part being looked at.
#[derive(Debug, Clone, Default)]
pub(crate) struct Worst {
    parts: Vec<Raw>,
    now: Option<(Finding, Raw)>,
    /// Which law that is of.
    law: usize,
    /// The most that the samples leave open.
    open: f64,
}

impl Worst {
    /// Takes note of a miss. `scale` is the least that it counts relative to; `raw`, which has all its terms, is asked for only
    /// where it would stand out.
    pub fn note(&mut self, miss: f64, scale: Scale, settled: &Settled, raw: impl FnOnce() -> Raw) {
        self.note_of(usize::MAX, miss, scale, settled, raw);
    }

    /// The same for a law of this number: of equal misses that of the first law stays, whichever is seen first.
    pub fn note_of(&mut self, law: usize, miss: f64, scale: Scale, settled: &Settled, raw: impl FnOnce() -> Raw) {
        if self.stands_out(law, scale.relative(miss)) {
            self.keep_of(law, raw(), settled);
        }
    }

    /// The same for misses of a law at all samples, relative to one scale.
    pub fn note_row(
        &mut self,
        law: usize,
        misses: &[f64],
        scale: Scale,
        settled: &Settled,
        raw: impl Fn(usize, f64) -> Raw,
    ) {
        if are_finite(misses) && !self.stands_out(law, scale.relative(greatest(misses))) {
            return;
        }
        misses.iter().enumerate().for_each(|(k, &miss)| self.note_of(law, miss, scale, settled, || raw(k, miss)));
    }

    /// Whether a miss of a law would stand out.
    fn stands_out(&self, law: usize, value: f64) -> bool {
        let above = |now: &Finding| value > now.value || value.is_nan() || (value == now.value && law < self.law);
        self.now.as_ref().is_none_or(|(now, _)| !now.value.is_nan() && above(now))
    }

    /// Whether what is kept stands out more than any miss up to this one, whatever the samples resolve of it.
    pub fn is_above(&self, value: f64) -> bool {
        self.now.as_ref().is_some_and(|(now, _)| value < excess(pair(now)))
    }

    /// Keeps a miss if it stands out most above what the samples resolve.
    pub fn keep(&mut self, raw: Raw, settled: &Settled) {
        self.keep_of(usize::MAX, raw, settled);
    }

    fn keep_of(&mut self, law: usize, raw: Raw, settled: &Settled) {
        let found = raw.measured(settled);
        self.leaves_open(found.resolution);
        let first = |now: &Finding| pair(&found) == pair(now) && law < self.law;
        if self.now.as_ref().is_none_or(|(now, _)| above(pair(&found), pair(now)) || first(now)) {
            (self.now, self.law) = (Some((found, raw)), law);
        }
    }

    /// Takes over what was found of laws with the numbers after `first`.
    pub fn absorb(&mut self, first: usize, other: Worst, settled: &Settled) {
        self.leaves_open(other.open);
        if let Some((_, raw)) = other.now {
            self.keep_of(other.law.saturating_add(first), raw, settled);
        }
    }

    /// So much is left open somewhere, relative to what is there.
    pub fn leaves_open(&mut self, resolution: f64) {
        self.open = self.open.max(resolution);
    }

    /// The most that the samples leave open, relative to what is there.
    pub fn open(&self) -> f64 {
        self.open
    }

    /// A part of the run is over.
    pub fn end_part(&mut self) {
        self.parts.extend(self.now.take().map(|(_, raw)| raw));
    }

    /// The greatest miss of the whole run.
    pub fn finding(&self, settled: &Settled) -> Option<Finding> {
        let mut greatest: Option<Finding> = None;
        for found in self.parts.iter().chain(self.now.iter().map(|now| &now.1)).map(|raw| raw.measured(settled)) {
            if greatest.as_ref().is_none_or(|old| above(pair(&found), pair(old))) {
                greatest = Some(found);
            }
        }
        greatest
    }
}

/// By how much a value exceeds what the samples resolve of it; nothing but for rounding is nothing.
fn excess((value, resolution): (f64, f64)) -> f64 {
    Some(value - resolution).filter(|e| *e > ROUNDING).unwrap_or(0.0)
}

fn pair(finding: &Finding) -> (f64, f64) {
    (finding.value, finding.resolution)
}

/// Whether a value with what the samples resolve of it stands out more than another; what is not a number is never right.
pub(crate) fn above(new: (f64, f64), old: (f64, f64)) -> bool {
    match (new.0.is_nan(), old.0.is_nan()) {
        (_, true) => false,
        (true, false) => true,
        _ => excess(new) > excess(old) || (excess(new) == excess(old) && new.0 > old.0),
    }
}
