//! A bond graph as text (`show bond_graph`).

use std::fmt::{self, Display, Formatter};

use super::{
    BondGraph, BoundKind, Element, HeldKind, Initial, Kind, PortCausality, PortRef, ResistorLaw, Storage, StorageLaw,
    Trigger, TwoPortRow,
};
use crate::algebra::{Expr, PlainNames, Symbol, ascii};
use crate::ids::Id;
use crate::unit::Unit;

impl Display for BondGraph {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "model {}", self.name)?;
        if !self.doc.is_empty() {
            write!(f, " \"{}\"", self.doc)?;
        }
        writeln!(f)?;
        self.values(f)?;
        self.print_elements(f)?;
        self.print_bonds(f)?;
        self.print_signals(f)?;
        self.print_wishes(f)
    }
}

impl BondGraph {
    fn text(&self, e: Expr) -> String {
        ascii(&self.exprs, e, &PlainNames(&self.exprs))
    }

    fn port(&self, port: PortRef) -> String {
        let element = &self.elements[port.element];
        match element.ports[port.port as usize].name.as_str() {
            "" => element.name.clone(),
            name => format!("{}.{name}", element.name),
        }
    }

    fn values(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if !self.parameters.is_empty() {
            writeln!(f, "\nparameters (SI)")?;
        }
        for p in self.parameters.values() {
            let word = if p.constant { "const " } else { "" };
            writeln!(f, "  {word}{} = {}{}", p.name, self.text(p.value), unit(p.unit.as_ref()))?;
        }
        if !self.inputs.is_empty() {
            writeln!(f, "\ninputs")?;
        }
        for i in self.inputs.values() {
            writeln!(f, "  {} = {}{}", i.name, self.text(i.default), unit(i.unit.as_ref()))?;
        }
        Ok(())
    }

    fn print_elements(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nelements")?;
        let width = self.elements.values().map(|e| e.name.chars().count()).max().unwrap_or(0);
        for (_, e) in self.elements.iter() {
            let mut facts = self.laws(e);
            if let Kind::Inertance(s) | Kind::Compliance(s) = &e.kind {
                facts.extend(s.initial.iter().map(|i| self.start(i)));
            }
            let line = format!("  {:<3} {:<width$}  {}", e.kind.word(), e.name, facts.join("; "));
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }

    fn start(&self, i: &Initial) -> String {
        format!("{}(0) = {}", self.exprs.name(i.symbol), self.text(i.value))
    }

    fn law(&self, symbol: Symbol, e: Expr) -> String {
        format!("{} = {}", self.exprs.name(symbol), self.text(e))
    }

    fn laws(&self, e: &Element) -> Vec<String> {
        let effort = |port: usize| self.bonds[e.ports[port].bond].effort;
        let flow = |port: usize| self.bonds[e.ports[port].bond].flow;
        match &e.kind {
            Kind::Zero | Kind::One | Kind::EffortDetector | Kind::FlowDetector => Vec::new(),
            Kind::EffortSource { value } => {
                let carries = e.carries.map(|carried| format!("carries {}", self.text(carried)));
                std::iter::once(self.law(effort(0), *value)).chain(carries).collect()
            }
            Kind::FlowSource { value } | Kind::ZeroCompliance { flow: value } => vec![self.law(flow(0), *value)],
            Kind::ResidualEffort { residual } => {
                let own = self.exprs.name(flow(0)).to_string();
                vec![format!("0 = {}", residual.map_or(own, |r| self.text(r)))]
            }
            Kind::ResidualFlow { residual } => {
                let own = self.exprs.name(effort(0)).to_string();
                vec![format!("0 = {}", residual.map_or(own, |r| self.text(r)))]
            }
            Kind::Transformer { modulus } => vec![format!("m = {}", self.text(*modulus))],
            Kind::Gyrator { modulus } => vec![format!("r = {}", self.text(*modulus))],
            Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_) => self.two_port_rows(e),
            Kind::Resistor(laws) | Kind::SkewGyrator(laws) => laws
                .iter()
                .enumerate()
                .map(|(port, law)| match law {
                    ResistorLaw::Resistive(x) => self.law(effort(port), *x),
                    ResistorLaw::Conductive(x) => self.law(flow(port), *x),
                    ResistorLaw::Implicit(x) => format!("0 = {}", self.text(*x)),
                })
                .collect(),
            Kind::Inertance(s) => self.storage(s, &flow),
            Kind::Compliance(s) => self.storage(s, &effort),
        }
    }

    /// The equations of a wide two-port, as they are written.
    fn two_port_rows(&self, e: &Element) -> Vec<String> {
        let name = |port: usize, effort: bool| {
            let bond = &self.bonds[e.ports[port].bond];
            self.exprs.name(if effort { bond.effort } else { bond.flow }).to_string()
        };
        let rows = e.kind.two_port_rows();
        let row = |row: &TwoPortRow| {
            let terms: Vec<String> = row
                .terms
                .iter()
                .map(|&(port, factor)| match self.exprs.is_number(factor).is_some_and(|n| n.is_one()) {
                    true => name(port, row.of_efforts),
                    false => format!("({})*{}", self.text(factor), name(port, row.of_efforts)),
                })
                .collect();
            let sum = if terms.is_empty() { "0".to_string() } else { terms.join(" + ") };
            format!("{} = {sum}", name(row.port, row.effort))
        };
        rows.iter().map(row).collect()
    }

    fn storage(&self, s: &Storage, z: &dyn Fn(usize) -> Symbol) -> Vec<String> {
        let law = |port: usize| match s.laws[port] {
            StorageLaw::Integral(x) => self.law(z(port), x),
            StorageLaw::Derivative(x) => self.law(s.stored[port], x),
            StorageLaw::Implicit(x) => format!("0 = {}", self.text(x)),
            StorageLaw::Known { displacement, law } => {
                format!("{}; {}", self.law(s.stored[port], displacement), self.law(z(port), law))
            }
        };
        let mut laws: Vec<String> = (0..s.laws.len()).map(law).collect();
        laws.extend(s.energy.map(|e| format!("energy = {}", self.text(e))));
        laws
    }

    fn print_bonds(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nbonds")?;
        let ends: Vec<String> =
            self.bonds.values().map(|b| format!("{} -> {}", self.port(b.from), self.port(b.to))).collect();
        let width = ends.iter().map(|e| e.chars().count()).max().unwrap_or(0);
        for ((id, b), ends) in self.bonds.iter().zip(ends) {
            let name = if b.name.is_empty() { String::new() } else { format!("  as {}", b.name) };
            let pseudo = if b.pseudo { "  pseudo" } else { "" };
            let (e, flow) = (self.variable(b.effort), self.variable(b.flow));
            writeln!(f, "  {:<4} {ends:<width$}  {e}, {flow}{name}{pseudo}", id.index() + 1)?;
        }
        Ok(())
    }

    fn variable(&self, symbol: Symbol) -> String {
        let unit = unit(self.variables.get(&symbol).and_then(|v| v.unit.as_ref()));
        format!("{}{unit}", self.exprs.name(symbol))
    }

    fn print_signals(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if !self.signals.is_empty() || !self.held.is_empty() {
            writeln!(f, "\nsignals")?;
        }
        for s in self.signals.values() {
            let start = s.initial.map_or(String::new(), |e| format!(" from {}", self.text(e)));
            writeln!(f, "  {}' = {}{start}{}", s.name, self.text(s.rate), unit(s.unit.as_ref()))?;
        }
        for h in self.held.values() {
            let (source, time, unit) = (self.text(h.source), self.text(h.time), unit(h.unit.as_ref()));
            match h.kind {
                HeldKind::Delay => writeln!(f, "  {} = delay({source}, {time})", h.name)?,
                HeldKind::Sample => writeln!(f, "  {} = sample({source}, {time})", h.name)?,
                HeldKind::Discrete => writeln!(f, "  discrete {} from {source}{unit}", h.name)?,
                HeldKind::Impulse => writeln!(f, "  {}, of resets", h.name)?,
            }
        }
        let own = || self.clauses.iter().filter(|clause| clause.bound.is_none());
        if own().next().is_some() {
            writeln!(f, "\nevents")?;
        }
        for clause in own() {
            match clause.trigger {
                Trigger::Becomes(condition) => writeln!(f, "  when {}", self.text(condition))?,
                Trigger::Every(period) => writeln!(f, "  every {}", self.text(period))?,
            }
            for action in &clause.actions {
                let word = if action.impulse.is_some() { "reset " } else { "" };
                writeln!(f, "    {word}{} = {}", self.exprs.name(action.target), self.text(action.value))?;
            }
        }
        if !self.set_valued.is_empty() {
            writeln!(f, "\nset-valued laws")?;
        }
        for law in &self.set_valued {
            let name = &self.elements[law.element].name;
            for (number, branch) in law.branches.iter().enumerate() {
                let here = if number == law.present { "  (here)" } else { "" };
                let own = Element { kind: branch.kind.clone(), ..self.elements[law.element].clone() };
                writeln!(f, "  {name} {}: {}{here}", branch.name, self.laws(&own).join("; "))?;
                for bound in &branch.bounds {
                    let next = law.branches[bound.next].name;
                    match bound.kind {
                        BoundKind::Margin(margin) => writeln!(f, "    while 0 <= {}, then {next}", self.text(margin))?,
                        BoundKind::Command(ends) => writeln!(f, "    until {}, then {next}", self.text(ends))?,
                    }
                    if let Some(impact) = &bound.impact {
                        let action = &impact.action;
                        let (flow, value) = (self.exprs.name(action.target), self.text(action.value));
                        writeln!(f, "      reset {flow} = {value}")?;
                    }
                }
            }
        }
        for (title, list) in [("lets", &self.lets), ("outputs", &self.outputs)] {
            if !list.is_empty() {
                writeln!(f, "\n{title}")?;
            }
            for n in list {
                writeln!(f, "  {} = {}{}", n.name, self.text(n.value), unit(n.unit.as_ref()))?;
            }
        }
        self.print_shapes(f)
    }

    fn print_shapes(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if !self.shapes.is_empty() {
            writeln!(f, "\nshapes")?;
        }
        for shape in &self.shapes {
            writeln!(f, "  {} {}", shape.kind.word(), shape.name)?;
            for n in shape.values() {
                writeln!(f, "    {} = {}{}", n.name, self.text(n.value), unit(n.unit.as_ref()))?;
            }
        }
        Ok(())
    }

    fn print_wishes(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if !self.constraints.is_empty() {
            writeln!(f, "\nconstraints")?;
        }
        for c in &self.constraints {
            let level = if c.holonomic { "displacements" } else { "flows" };
            writeln!(f, "  {}: 0 = {} (on {level})", c.name, self.text(c.expr))?;
        }
        let any = !self.preferences.is_empty() || !self.forced_causality.is_empty() || !self.forced_strokes.is_empty();
        if any {
            writeln!(f, "\nasked for")?;
        }
        for p in &self.preferences {
            writeln!(f, "  prefer {}", self.exprs.name(p.symbol))?;
        }
        for c in &self.forced_causality {
            let word = match c.causality {
                PortCausality::Integral => "integral",
                PortCausality::Derivative => "derivative",
                PortCausality::Resistive => "resistive",
                PortCausality::Conductive => "conductive",
            };
            writeln!(f, "  {} {word}", self.port(c.port))?;
        }
        for s in &self.forced_strokes {
            let bond = &self.bonds[s.bond];
            let at = if s.at_to { bond.to } else { bond.from };
            writeln!(f, "  stroke of bond {} at {}", s.bond.index() + 1, self.port(at))?;
        }
        if !self.guesses.is_empty() {
            writeln!(f, "\nguesses (SI)")?;
        }
        for g in &self.guesses {
            writeln!(f, "  {} = {}", self.text(g.what), self.text(g.value))?;
        }
        Ok(())
    }
}

/// The SI unit of a printed number, and the unit in which it is shown if that is another.
fn unit(unit: Option<&Unit>) -> String {
    unit.map_or(String::new(), |u| match u.is_si() {
        true => format!(" [{u}]"),
        false => format!(" [{}, shown in {u}]", u.to_si_unit()),
    })
}
