//! What a run is measured against: the same motion at the tightest tolerance, confirmed by another form.

use std::collections::BTreeMap;

use halfarrow_compiler::equations::{Form, ObservedKind};
use halfarrow_sim::{Method, Stopped};
use halfarrow_trace::Trace;

use super::ladder::Effort;
use super::subject::{Settings, Subject, Variable, is_over};

/// Tolerance of the reference.
const TIGHTEST: f64 = 1e-12;
/// A variable counts as at least this part of the greatest one of its unit, so that what is zero by law has a magnitude.
const FLOOR: f64 = 1e-3;
/// Points in time at which runs are compared.
pub(super) const POINTS: f64 = 200.0;

/// The motion to compare with.
pub(super) struct Reference {
    pub to: f64,
    columns: BTreeMap<String, Column>,
    /// Error of the reference itself: what the run that confirms it makes of the motion; NaN if none does.
    pub confirmed: f64,
    /// The form and method that confirm it.
    pub by: (Form, Method),
}

struct Column {
    values: Vec<f64>,
    /// Greatest magnitude, in SI units.
    scale: f64,
    /// Whether it is part of the motion: a state, a stored quantity, or what an inertance or compliance sets.
    motion: bool,
}

/// Greatest difference from the reference, relative to the greatest magnitude of the variable.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Apart {
    pub value: f64,
    pub variable: String,
}

impl Reference {
    /// `others` are forms that may confirm it, the best first, in runs that are no longer than the effort allows. `motion`
    /// are the variables that the motion is.
    pub(super) fn new(
        minimal: &Subject,
        others: &[(Form, &Subject)],
        motion: &[String],
        to: f64,
        effort: Effort,
    ) -> Result<Reference, Box<Stopped>> {
        let known = minimal.variables();
        let names: Vec<&str> = known.iter().map(|v| v.name.as_str()).collect();
        let run = |subject: &Subject, method, names: &[&str], until| {
            let settings = Settings { method, rtol: TIGHTEST, to, until };
            subject.sampled(settings, to / POINTS, names).map_err(Box::new)
        };
        let auto = run(minimal, Method::Auto, &names, effort.until);
        // The second one of the same form need not come to its end.
        let patient = if auto.is_ok() { effort.run_until() } else { effort.until };
        let radau = run(minimal, Method::Radau, &names, patient);
        let confirming = others.iter().take_while(|_| !is_over(effort.until)).find_map(|(form, subject)| {
            let theirs = subject.variables();
            let common: Vec<&str> = names
                .iter()
                .copied()
                .filter(|n| motion.iter().any(|m| m == n) && theirs.iter().any(|v| v.name == *n))
                .collect();
            run(subject, Method::Radau, &common, effort.run_until()).ok().map(|trace| (*form, trace))
        });
        let candidates: Vec<(Method, Trace)> = match (auto, radau) {
            (Ok(auto), Ok(radau)) => vec![(Method::Auto, auto), (Method::Radau, radau)],
            (Ok(auto), Err(_)) => vec![(Method::Auto, auto)],
            (Err(_), Ok(radau)) => vec![(Method::Radau, radau)],
            (Err(stopped), Err(_)) => return Err(stopped),
        };
        let made = |trace: &Trace| Reference {
            to,
            columns: columns(trace, &known, motion, &minimal.magnitudes(trace)),
            confirmed: f64::NAN,
            by: (Form::Minimal, Method::Auto),
        };
        // Nothing confirms itself.
        if confirming.is_none() && candidates.len() == 1 {
            return Ok(made(&candidates[0].1));
        }
        let (form, check) = confirming.unwrap_or_else(|| (Form::Minimal, candidates[candidates.len() - 1].1.clone()));
        let mut judged: Vec<Reference> = Vec::new();
        for (method, trace) in &candidates {
            if form == Form::Minimal && candidates.len() > 1 && *method == candidates[candidates.len() - 1].0 {
                continue;
            }
            let mut reference = made(trace);
            reference.by = (form, Method::Radau);
            reference.confirmed = reference.apart(&check, true).value;
            judged.push(reference);
        }
        judged.sort_by(|a, b| a.confirmed.total_cmp(&b.confirmed));
        Ok(judged.swap_remove(0))
    }

    /// Names of the variables that it knows among these.
    pub(super) fn common<'n>(&self, names: &'n [Variable]) -> Vec<&'n str> {
        names.iter().map(|v| v.name.as_str()).filter(|name| self.columns.contains_key(*name)).collect()
    }

    /// The motion among these names.
    pub(super) fn motion<'n>(&self, names: &'n [Variable]) -> Vec<&'n str> {
        let moves = |name: &&str| self.columns.get(*name).is_some_and(|column| column.motion);
        names.iter().map(|v| v.name.as_str()).filter(moves).collect()
    }

    /// How far a run is off: in its motion, or in all variables.
    pub(super) fn apart(&self, run: &Trace, motion_only: bool) -> Apart {
        let mut most = Apart { value: 0.0, variable: String::new() };
        for column in &run.columns {
            let Some(own) = self.columns.get(&column.name).filter(|own| own.motion || !motion_only) else { continue };
            let missing = own.values.len() != column.values.len();
            let differences = own.values.iter().zip(&column.values).map(|(a, b)| (a - b).abs() / own.scale);
            let worst = differences.fold(0.0f64, |most, d| if d > most || d.is_nan() { d } else { most });
            let value = if missing { f64::INFINITY } else { worst };
            if value > most.value || value.is_nan() {
                most = Apart { value, variable: column.name.clone() };
            }
        }
        most
    }
}

/// `least` is how great variables of the graph count as at least: what is zero but for rounding has no magnitude of its own.
fn columns(
    trace: &Trace,
    known: &[Variable],
    motion: &[String],
    least: &BTreeMap<String, f64>,
) -> BTreeMap<String, Column> {
    let greatest = |values: &[f64]| values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
    let mut of_unit: BTreeMap<Like, f64> = BTreeMap::new();
    for (column, variable) in trace.columns.iter().zip(known) {
        let most = of_unit.entry(Like::of(variable)).or_default();
        *most = most.max(greatest(&column.values));
    }
    let column = |(column, variable): (&halfarrow_trace::Column, &Variable)| {
        let name = &variable.name;
        let floor = least.get(name).copied().unwrap_or(0.0).max(FLOOR * of_unit[&Like::of(variable)]);
        let scale = greatest(&column.values).max(floor).max(f64::MIN_POSITIVE / f64::EPSILON);
        (name.clone(), Column { values: column.values.clone(), scale, motion: motion.contains(name) })
    };
    trace.columns.iter().zip(known).map(column).collect()
}

/// What variables are of like size with: those of their unit; without units those of their kind.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Like<'v> {
    Unit(&'v str),
    Kind(ObservedKind),
}

impl Like<'_> {
    fn of(variable: &Variable) -> Like<'_> {
        match variable.kind {
            _ if !variable.unit.is_empty() => Like::Unit(&variable.unit),
            ObservedKind::Signal | ObservedKind::Input => Like::Kind(ObservedKind::Named),
            kind => Like::Kind(kind),
        }
    }
}
