//! Set-valued laws: at every sample one branch holds, and its margins are not negative.

use crate::laws::{raw, sensitivities};
use crate::scales::{Quantity, Scales, Settled, Term};
use crate::values::{Reader, Values};
use crate::worst::Worst;
use halfarrow_compiler::algebra::Expr;
use halfarrow_compiler::bond_graph::{BondGraph, BoundKind, Branch, Kind, ResistorLaw, SetValuedLaw};

/// A number that vanishes or is not negative, at every sample: how far it is off, and what that counts relative to.
struct Part<'v, 'a> {
    /// What a recorded column is less this, or this alone.
    reader: Reader<'v, 'a>,
    column: Option<&'a [f64]>,
    terms: Vec<Term>,
    what: &'static str,
    /// Whether it vanishes; else it is not negative.
    vanishes: bool,
}

/// A branch: its law, its margins, and the conditions that end it.
struct Held<'v, 'a> {
    law: Part<'v, 'a>,
    margins: Vec<Part<'v, 'a>>,
    commands: Vec<Reader<'v, 'a>>,
}

/// Takes note of the sample at which no branch holds by most.
pub(crate) fn residual(
    graph: &BondGraph,
    values: &Values,
    scales: (&Scales, &Settled),
    worst: &mut Worst,
    unchecked: &mut Vec<String>,
) {
    for law in &graph.set_valued {
        let name = &graph.elements[law.element].name;
        if let Err(missing) = check(graph, law, values, scales, worst) {
            unchecked.push(format!("the law of {name}: {missing} is not known"));
        }
    }
}

fn check(
    graph: &BondGraph,
    law: &SetValuedLaw,
    values: &Values,
    (scales, settled): (&Scales, &Settled),
    worst: &mut Worst,
) -> Result<(), String> {
    let branches = law.branches.iter().map(|branch| held(graph, law, branch, values, (scales, settled)));
    let branches: Vec<Held> = branches.collect::<Result<_, _>>()?;
    let name = &graph.elements[law.element].name;
    for (k, &time) in values.times.iter().enumerate() {
        let before = values.is_before_jump(k);
        let best = branches.iter().map(|branch| branch.worst(k, before, settled)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, miss, part)) = best else { continue };
        let scale = settled.scale(&part.terms);
        worst.note(miss, scale, settled, || raw(miss, time, name, part.what, part.terms.clone()));
    }
    Ok(())
}

impl<'v, 'a> Held<'v, 'a> {
    /// What is off most at a sample: relative, in its own unit, and what it is.
    fn worst(&self, k: usize, before: bool, settled: &Settled) -> (f64, f64, &Part<'v, 'a>) {
        let relative = |part: &Part, miss: f64| settled.scale(&part.terms).relative(miss);
        let miss = self.law.at(k);
        let mut worst = (relative(&self.law, miss), miss, &self.law);
        if before {
            return worst;
        }
        for margin in &self.margins {
            let miss = margin.at(k);
            let miss = if margin.vanishes { miss } else { miss.min(0.0) };
            let found = (relative(margin, miss), miss, margin);
            worst = if found.0 > worst.0 { found } else { worst };
        }
        let ended = |command: &Reader| command.values(k, &[]).is_some_and(|v| v[0] != 0.0);
        if self.commands.iter().any(ended) {
            worst.0 = f64::INFINITY;
            worst.1 = f64::INFINITY;
        }
        worst
    }
}

impl Part<'_, '_> {
    fn at(&self, k: usize) -> f64 {
        let Some(value) = self.reader.values(k, &[]) else { return 0.0 };
        self.column.map_or(value[0], |column| column[k] - value[0])
    }
}

fn held<'v, 'a>(
    graph: &'a BondGraph,
    law: &SetValuedLaw,
    branch: &Branch,
    values: &'v Values<'a>,
    (scales, settled): (&Scales, &Settled),
) -> Result<Held<'v, 'a>, String> {
    let bond = graph.elements[law.element].ports[0].bond;
    let missing = |flow: bool| format!("its {}", if flow { "flow" } else { "effort" });
    let of_column = |value: Expr, flow: bool| -> Result<Part<'v, 'a>, String> {
        let column = if flow { values.flow(bond) } else { values.effort(bond) };
        Ok(Part {
            reader: values.reader(&[value])?,
            column: Some(column.ok_or_else(|| missing(flow))?),
            terms: vec![Term::of(scales.of_bond(bond, flow), 1.0)],
            what: if flow { "its flow" } else { "its effort" },
            vanishes: true,
        })
    };
    let number = |expr: Expr, what: &'static str| -> Result<Part<'v, 'a>, String> {
        let reader = values.reader(&[expr])?;
        let middle = values.times.len() / 2;
        let moved = sensitivities(graph, scales, settled, &reader, middle, |v| v[0]);
        let mut terms: Vec<Term> = moved.into_iter().map(|(quantity, weight)| Term::of(quantity, weight)).collect();
        let found = (0..values.times.len()).filter_map(|k| reader.values(k, &[]));
        let greatest = found.map(|v| v[0].abs()).filter(|v| v.is_finite()).fold(0.0, f64::max);
        terms.push(Term::of(Quantity::Number, greatest));
        Ok(Part { reader, column: None, terms, what, vanishes: false })
    };
    let own = match &branch.kind {
        Kind::EffortSource { value } => of_column(*value, false)?,
        Kind::FlowSource { value } | Kind::ZeroCompliance { flow: value } => of_column(*value, true)?,
        Kind::Resistor(laws) => match laws[..] {
            [ResistorLaw::Implicit(expr)] => number(expr, "its law")?,
            _ => return Err("what it is".to_string()),
        },
        _ => return Err("what it is".to_string()),
    };
    let (mut margins, mut commands) = (Vec::new(), Vec::new());
    if let (Kind::ZeroCompliance { .. }, Some(constraint)) = (&branch.kind, &law.constraint) {
        margins.push(Part { vanishes: true, ..number(constraint.expr, "its gap")? });
    }
    for bound in &branch.bounds {
        match bound.kind {
            BoundKind::Margin(margin) => margins.push(number(margin, "what is never negative")?),
            BoundKind::Command(condition) => commands.push(values.reader(&[condition])?),
        }
    }
    Ok(Held { law: own, margins, commands })
}
