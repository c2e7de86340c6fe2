//! What an audit means for a result, in words: one judgement for all forms, methods and commands.

use std::collections::BTreeMap;

use halfarrow_compiler::equations::Form;
use halfarrow_sim::{Failure, Method};
use serde::Serialize;

use crate::audited::{AuditReport, Deviation};
use crate::run::Run;

/// A miss above this part of what is there is said.
pub(crate) const SAID: f64 = 1e-6;
/// A result that misses a law by more than this part of what is there is refused.
pub(crate) const REFUSED: f64 = 1e-2;
/// Errors of steps add up over a run: as many times the tolerance of a step are what was asked for.
const STEPS: f64 = 1000.0;
/// A result that misses this part of what is there is refused whatever was asked for, and one that misses [`REFUSED`] is said to.
const MOST: f64 = 0.2;
/// One step errs by so many times its tolerance at most: it holds for each state, and is estimated.
const STEP: f64 = 10.0;
/// Unknowns of equations that a step solves to the tolerance miss laws by some of it.
const SOLVED: f64 = 30.0;
/// The form `stiff`: its springs give by so much of the ratio of speeds.
const GIVE: f64 = 10.0;

/// What the samples leave open is estimated, and may be this many times as much.
const ESTIMATED: f64 = 4.0;

/// Samples at steps as long as the tolerance lets them be, which leave more open than this, are too far apart for the estimate
/// itself: what turns within a step looks like a miss.
const COARSE: f64 = 0.05;

/// Samples of steps of fixed length that leave more open than this may hide an error: what decays within a step, or comes and goes,
/// leaves as much. A run by half the step tells.
pub(crate) const OPEN: f64 = 0.05;
/// What half the step changes by more than this part of what is there is said.
const HALVED: f64 = 0.05;

/// What an audit means for a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Every law holds, as far as it could be checked.
    #[default]
    Holds,
    /// Something is missed by more than a millionth of what is there, and said.
    Doubtful,
    /// Something is missed by more than a hundredth: the result is not to be used.
    Refused,
}

/// How a result was made: what misses may come from, and what may be done about them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Made {
    pub form: Form,
    pub method: Method,
    pub rtol: f64,
    pub step: Option<f64>,
    /// Form `stiff`: square of the ratio of frequencies.
    pub stiffness: f64,
}

impl Made {
    pub fn by(run: &Run) -> Made {
        Made {
            form: run.form,
            method: run.method,
            rtol: run.rtol,
            step: run.step,
            stiffness: run.stiffness.unwrap_or(1e6),
        }
    }

    /// By how much laws may be missed before that is said, and before the result is refused. Explicit equations meet them to
    /// rounding; in other forms steps solve them to the tolerance.
    fn laws(&self) -> (f64, f64) {
        let explicit = matches!(self.form, Form::Minimal | Form::Kane);
        let asked = if explicit { 0.0 } else { SOLVED * self.rtol };
        self.granted(asked)
    }

    /// The same for what is integrated: of a tolerance as much as was asked for.
    fn integrals(&self) -> (f64, f64) {
        let asked = if matches!(self.method, Method::Fixed(_)) { 0.0 } else { STEPS * self.rtol };
        let (said, refused) = self.granted(asked.min(MOST));
        (said.min(REFUSED.max(self.granted(0.0).0)), refused)
    }

    /// Bounds that grant this much. The springs of the form `stiff` give.
    fn granted(&self, asked: f64) -> (f64, f64) {
        let give = if self.form == Form::Stiff { GIVE / self.stiffness.sqrt() } else { 0.0 };
        (SAID.max(asked).max(give), REFUSED.max(asked).max(GIVE * give))
    }

    /// By how much energy may change in so many steps without a cause: by what the tolerance leaves open of each.
    fn at_once(&self, steps: usize) -> f64 {
        let fixed = matches!(self.method, Method::Fixed(_));
        self.granted(if fixed { 0.0 } else { STEP * self.rtol * steps as f64 }).1
    }

    /// What to do where laws are missed.
    fn remedy_for_laws(&self) -> String {
        match self.form {
            Form::Stiff => "take a greater --stiffness, or another form".into(),
            Form::Minimal => "see with `compare` which form holds, take that one with --form, or bring the values of \
                              parameters nearer to each other"
                .into(),
            _ => "take the form minimal, or see with `compare` which form holds".into(),
        }
    }

    /// What to do where energy is made or lost at once.
    fn remedy_for_leaps(&self) -> String {
        let variables = match self.form {
            Form::Minimal => "see which position it is, and keep variables by `prefer` that tell the motion there",
            _ => "take the form minimal, which goes on in other variables",
        };
        format!("its variables may tell nothing there: {variables}, or {}", self.remedy_for_integrals())
    }

    /// What to do where integrals are missed.
    fn remedy_for_integrals(&self) -> String {
        match (self.method, self.step) {
            (Method::Fixed(_), Some(step)) => {
                format!("steps of {step} s are too long here: shorten --step, or take a solver with variable step")
            }
            _ => "tighten --rtol, or take another --solver".into(),
        }
    }
}

/// A miss beyond what may be.
struct Beyond<'a> {
    miss: &'a Deviation,
    verdict: Verdict,
    remedy: String,
}

impl AuditReport {
    /// Judges what was found, and says what is wrong.
    pub(crate) fn judge(&mut self, made: &Made) {
        let beyond = self.beyond(made);
        let verdict = beyond.iter().map(|b| b.verdict).max().unwrap_or_default();
        let mut by_remedy: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for b in &beyond {
            let Deviation { place, value, time, .. } = b.miss;
            by_remedy.entry(&b.remedy).or_default().push(format!("{place} is missed by {value:.0e} at t = {time} s"));
        }
        let said = |(remedy, misses): (&str, Vec<String>)| format!("audit: {}: {remedy}", misses.join("; "));
        let warnings = by_remedy.into_iter().map(said).collect();
        (self.verdict, self.warnings) = (verdict, warnings);
    }

    /// Forgets what has no number: of a run that has stopped where a law has no value this is what it says already.
    pub(crate) fn forget_what_is_no_number(&mut self) {
        for miss in [&mut self.power, &mut self.energy, &mut self.residual, &mut self.rates] {
            miss.take_if(|miss| miss.value.is_nan());
        }
    }

    /// Why the result is not to be used, if it is not.
    pub(crate) fn refusal(&self, made: &Made) -> Option<Failure> {
        let refused = self.beyond(made).into_iter().find(|b| b.verdict == Verdict::Refused)?;
        let Deviation { place, value, time, .. } = refused.miss.clone();
        Some(Failure::Untrue { time, what: place, miss: value, remedy: refused.remedy })
    }

    /// Whether anything is missed by more than may be.
    pub(crate) fn is_beyond(&self, made: &Made) -> bool {
        !self.beyond(made).is_empty()
    }

    /// Energy that is gained or lost at once by more than its steps may miss, in the fewest steps that show it.
    fn beyond_at_once(&self, made: &Made) -> Option<Beyond<'_>> {
        let stands_out = |(steps, miss): &&(usize, Deviation)| miss.value - miss.resolution > made.at_once(*steps);
        let (_, miss) = self.at_once.iter().find(stands_out)?;
        Some(Beyond { miss, verdict: Verdict::Refused, remedy: made.remedy_for_leaps() })
    }

    /// What is missed by more than may be: laws first.
    fn beyond(&self, made: &Made) -> Vec<Beyond<'_>> {
        let laws = [&self.residual, &self.power].map(|m| (m, made.laws(), made.remedy_for_laws()));
        let integrals = [&self.rates, &self.energy].map(|m| (m, made.integrals(), made.remedy_for_integrals()));
        // A run that grows beyond all numbers says nothing of the laws: its steps are too long.
        let blown_up = [&self.residual, &self.power, &self.rates, &self.energy]
            .into_iter()
            .flatten()
            .any(|miss| miss.value.is_nan());
        let judged = |(miss, (said, refused), remedy): (&'_ Option<Deviation>, (f64, f64), String)| {
            let miss = miss.as_ref()?;
            // What the samples leave open says nothing about the run.
            let excess = miss.value - ESTIMATED * miss.resolution;
            let fixed = matches!(made.method, Method::Fixed(_));
            // But steps of fixed length that leave much open are too long themselves. Implicit ones may step over what decays.
            let unexplained = match made.method {
                Method::Fixed(method) if method.is_implicit() => miss.value - miss.resolution > MOST,
                Method::Fixed(_) => miss.value > MOST,
                _ => false,
            };
            let verdict = match () {
                () if !excess.is_finite() => Verdict::Refused,
                () if excess > refused && (fixed || miss.resolution < COARSE) => Verdict::Refused,
                () if excess > said || unexplained => Verdict::Doubtful,
                () => return None,
            };
            Some((verdict, if blown_up && fixed { made.remedy_for_integrals() } else { remedy }))
        };
        let all = laws.into_iter().chain(integrals);
        let found = all.filter_map(|(miss, bounds, remedy)| {
            let (verdict, remedy) = judged((miss, bounds, remedy))?;
            Some(Beyond { miss: miss.as_ref()?, verdict, remedy })
        });
        let halved = self.halved.iter().filter(|miss| miss.value.is_nan() || miss.value > HALVED);
        let halved =
            halved.map(|miss| Beyond { miss, verdict: Verdict::Doubtful, remedy: made.remedy_for_integrals() });
        found.chain(self.beyond_at_once(made)).chain(halved).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfarrow_sim::fixed_step::FixedMethod;

    fn miss(value: f64, resolution: f64) -> Option<Deviation> {
        Some(Deviation { value, time: 1.0, place: "body: its law".into(), resolution })
    }

    fn made(form: Form, method: Method) -> Made {
        Made { form, method, rtol: 1e-6, step: Some(0.1), stiffness: 1e6 }
    }

    fn verdict(report: AuditReport, made: &Made) -> Verdict {
        let mut report = report;
        report.judge(made);
        assert_eq!(report.warnings.is_empty(), report.verdict == Verdict::Holds);
        assert_eq!(report.refusal(made).is_some(), report.verdict == Verdict::Refused);
        report.verdict
    }

    #[test]
    fn laws_are_judged_alike_for_every_form() {
        for form in [Form::Minimal, Form::Break, Form::Lagrange, Form::Kane, Form::Inverted, Form::Relaxed] {
            let made = made(form, Method::Auto);
            for (value, wanted) in [
                (1e-9, Verdict::Holds),
                (1e-4, Verdict::Doubtful),
                (0.5, Verdict::Refused),
                (f64::NAN, Verdict::Refused),
                (f64::INFINITY, Verdict::Refused),
            ] {
                let residual = AuditReport { residual: miss(value, 0.0), ..AuditReport::default() };
                let power = AuditReport { power: miss(value, 0.0), ..AuditReport::default() };
                assert_eq!((verdict(residual, &made), verdict(power, &made)), (wanted, wanted), "{form:?} {value}");
            }
        }
    }

    #[test]
    fn what_samples_leave_open_says_nothing_and_a_tolerance_is_granted() {
        let rates = |value, resolution| AuditReport { rates: miss(value, resolution), ..AuditReport::default() };
        let fixed = made(Form::Minimal, Method::Fixed(FixedMethod::Rk4));
        let implicit = made(Form::Minimal, Method::Fixed(FixedMethod::Rosenbrock));
        assert_eq!(verdict(rates(0.5, 0.6), &fixed), Verdict::Doubtful);
        assert_eq!(verdict(rates(0.1, 0.2), &fixed), Verdict::Holds);
        assert_eq!(verdict(rates(0.5, 0.6), &implicit), Verdict::Holds);
        assert_eq!(verdict(rates(1.0, 0.65), &implicit), Verdict::Doubtful);
        assert_eq!(verdict(rates(1.0, 0.65), &made(Form::Minimal, Method::Auto)), Verdict::Holds);
        assert_eq!(verdict(rates(0.5, 1e-3), &fixed), Verdict::Refused);
        assert_eq!(verdict(rates(1.3, 0.1), &fixed), Verdict::Refused);
        assert_eq!(verdict(rates(1.3, 0.1), &made(Form::Minimal, Method::Auto)), Verdict::Doubtful);
        assert_eq!(verdict(rates(1e-4, 1e-8), &fixed), Verdict::Doubtful);
        assert_eq!(verdict(rates(1e-4, 1e-8), &made(Form::Minimal, Method::Auto)), Verdict::Holds);
        assert_eq!(verdict(rates(0.5, 1e-8), &made(Form::Minimal, Method::Auto)), Verdict::Refused);
    }

    #[test]
    fn no_tolerance_excuses_energy_that_vanishes_at_once() {
        let lost = |value, steps| {
            let at_once = vec![(1, miss(1e-9, 0.0).unwrap()), (steps, miss(value, 1e-6).unwrap())];
            AuditReport { at_once, ..AuditReport::default() }
        };
        let coarse = Made { rtol: 1e-3, ..made(Form::Kane, Method::Radau) };
        for (value, steps, wanted) in [(0.5, 8, Verdict::Refused), (0.05, 8, Verdict::Holds), (0.5, 64, Verdict::Holds)]
        {
            assert_eq!(verdict(lost(value, steps), &coarse), wanted, "{value} {steps}");
        }
        assert_eq!(verdict(lost(0.05, 64), &made(Form::Minimal, Method::Bdf)), Verdict::Refused);
        let integral = |value| AuditReport { energy: miss(value, 0.0), ..AuditReport::default() };
        assert_eq!(verdict(integral(0.05), &coarse), Verdict::Doubtful);
        assert_eq!(verdict(integral(0.5), &coarse), Verdict::Refused);
    }

    #[test]
    fn springs_give() {
        let laws = |value| AuditReport { residual: miss(value, 0.0), ..AuditReport::default() };
        let stiff = made(Form::Stiff, Method::Auto);
        assert_eq!(verdict(laws(1e-3), &stiff), Verdict::Holds);
        assert_eq!(verdict(laws(0.05), &stiff), Verdict::Doubtful);
        assert_eq!(verdict(laws(0.5), &stiff), Verdict::Refused);
    }

    #[test]
    fn words_name_place_time_and_remedy() {
        let mut report = AuditReport { rates: miss(0.5, 0.0), energy: miss(0.1, 0.0), ..AuditReport::default() };
        report.judge(&made(Form::Minimal, Method::Fixed(FixedMethod::Euler)));
        let [said] = &report.warnings[..] else { panic!("one remedy: {:?}", report.warnings) };
        assert!(said.contains("body") && said.contains("t = 1 s") && said.contains("shorten --step"), "{said}");
    }
}
