//! Checks of what parameters determine: domains of laws, and what the equations rest on.

use halfarrow_compiler::program::{Assumption, DomainKind, Holds, Reads};

use super::Plan;
use crate::Real;
use crate::c::function::{Function, Gives, Parameter};
use crate::c::write::{Time, Writer};
use crate::c::written::{Line, Needed, Written, needed, written};

/// A sum of floats below this fraction of its terms is rounding of the operations that lead to it.
const ROUNDING_OF_FLOATS: f64 = 1e-5;

impl Plan<'_> {
    /// Which domain an argument has to lie in, and the check of those that parameters alone decide.
    pub(super) fn domain_checks(&self, writer: &Writer) -> [Function; 2] {
        let (program, real) = (self.program, writer.real);
        let mut cases = vec![Written::of("    switch (domain) {")];
        let mut checks = Vec::new();
        for (i, domain) in program.domains.iter().enumerate() {
            let holds = match domain.kind {
                DomainKind::Positive => format!("a > {}", real.number(0.0)),
                DomainKind::NotNegative => format!("a >= {}", real.number(0.0)),
                DomainKind::Within(low, high) => format!("{} <= a && a <= {}", real.number(low), real.number(high)),
            };
            cases.push(written!("    case {}:\n        return {};", i, holds));
            if program.values.reads(domain.argument) == Reads::PARAMETERS {
                let a = writer.givens.written(domain.argument);
                let finite = Needed(real.function("ha_finite").into());
                let beyond = written!("{}({}) && !{}({}, {})", finite, a, needed("ha_is_within"), i, a);
                checks.push(writer.fail_if(&beyond, "OUT_OF_DOMAIN", &i, Time::Always));
            }
        }
        cases.push(Written::of("    default:\n        return a == a;\n    }"));
        checks.push(Line::new(written!("    return {}_OK;", writer.capitals), 0));
        let cases: Vec<Line> = cases.into_iter().map(|case| Line::new(case, 0)).collect();
        let argument = [Parameter::Int("domain"), Parameter::Real("a")];
        [
            Function::new("ha_is_within".into(), Gives::Status, &argument, real, &cases),
            Function::new("ha_check_domains".into(), Gives::Status, &[Parameter::Model], real, &checks),
        ]
    }

    /// The number from 1 of the first assumption that parameters break, 0 if there is none.
    pub(super) fn assumption_checks(&self, writer: &Writer) -> Option<Function> {
        if self.program.assumptions.is_empty() {
            return None;
        }
        let rounding = writer.real.number(match writer.real {
            Real::Double => Assumption::ROUNDING,
            Real::Float => ROUNDING_OF_FLOATS,
        });
        let zero = writer.real.number(0.0);
        let check = |(i, a): (usize, &Assumption)| {
            let (v, s) = (writer.givens.written(a.value), writer.givens.written(a.scale));
            let holds = match a.holds {
                Holds::Zero => format!("{v} <= {rounding} * {s} && -{v} <= {rounding} * {s}"),
                Holds::NotZero => format!("{v} > {rounding} * {s} || -{v} > {rounding} * {s}"),
                Holds::Positive => format!("{v} > {zero}"),
                Holds::NotNegative => format!("{v} >= {zero}"),
            };
            Line::new(written!("    if (!({})) {{\n        return {};\n    }}", holds, i + 1), 0)
        };
        let mut lines: Vec<Line> = self.program.assumptions.iter().enumerate().map(check).collect();
        lines.push(Line::new(Written::of("    return 0;"), 0));
        Some(Function::new("ha_broken".into(), Gives::Status, &[Parameter::ConstModel], writer.real, &lines))
    }
}
