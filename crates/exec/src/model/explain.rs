//! Why something has no value: the law that is asked for one outside its domain.

use super::Model;
use halfarrow_compiler::program::{DomainKind, LawDomain, Reads};
use halfarrow_sim::Failure;

/// Laws that are looked at when a value is missing.
const MOST: usize = 1000;

impl Model {
    /// The failure behind a value that is not a number: at the point placed last, the first law without a value, if there
    /// is one.
    pub(super) fn explain(&mut self, time: f64) -> Option<Failure> {
        let domains = self.code.program.domains.len().min(MOST);
        (0..domains).find_map(|index| self.violated(time, index))
    }

    /// A law that has no value whatever happens: all it is asked for are parameters.
    pub(super) fn violated_always(&mut self) -> Option<Failure> {
        let constant = |d: &LawDomain| self.code.program.values.reads(d.argument) == Reads::PARAMETERS;
        let constant: Vec<usize> =
            self.code.program.domains.iter().enumerate().filter(|(_, d)| constant(d)).map(|(i, _)| i).collect();
        constant.into_iter().find_map(|index| self.violated(f64::NAN, index))
    }

    fn violated(&mut self, time: f64, index: usize) -> Option<Failure> {
        let domain = self.code.program.domains[index].clone();
        let mut wanted = vec![domain.argument];
        wanted.extend(domain.asked.as_ref().map(|a| a.1));
        wanted.extend(domain.limit);
        let routine = self.code.layout.routine(&self.code.program, &wanted);
        self.frame.reserve(&routine);
        self.frame.run(&routine).ok()?;
        let mut values = routine.outputs.iter().map(|&out| self.frame.r[out as usize]);
        let argument = values.next().filter(|a| a.is_finite() && !domain.kind.holds(*a))?;
        let asked = domain.asked.as_ref().and_then(|_| values.next());
        let limit = domain.limit.and_then(|_| values.next());
        let what = match domain.elements.as_str() {
            "" => domain.given.clone(),
            elements => format!("the law of {elements}"),
        };
        Some(Failure::OutOfDomain { time, what, reason: reason(&domain, argument, asked, limit) })
    }
}

fn reason(domain: &LawDomain, argument: f64, asked: Option<f64>, limit: Option<f64>) -> String {
    let given = &domain.given;
    match (&domain.asked, asked, limit) {
        (Some((name, _)), Some(asked), Some(limit)) => {
            let end = if domain.kind == DomainKind::NotNegative { "from" } else { "beyond" };
            let way = if asked < limit { "up" } else { "down" };
            format!("{name} is {asked}, but {given} has a value only {end} {name} = {limit} {way}")
        }
        (Some((name, _)), Some(asked), None) => {
            format!("{name} is {asked}, which makes {}", outside(domain, argument))
        }
        _ => format!("{given} needs {}", outside(domain, argument)),
    }
}

fn outside(domain: &LawDomain, argument: f64) -> String {
    match domain.kind {
        DomainKind::Positive => format!("the logarithm of {argument}"),
        DomainKind::NotNegative => format!("a root of {argument}"),
        DomainKind::Within(low, high) => format!("a value at {argument}, outside of {low} to {high}"),
    }
}
