//! Equations as text: the model language (for programs), Unicode (for people), LaTeX (for papers), MathML (for
//! pages).

use std::collections::BTreeMap;
use std::fmt::{Display, Formatter, Result};

use super::vectors::{Matrix, Product};
use super::{Dependent, DisplayEquation, Shown, ShownDefinition, VectorEquation, places};
use crate::algebra::{
    Expr, Exprs, Names, Node, Place, Sort, Symbol, ZERO, ascii, ascii_within, dotted, latex, latex_name, latex_owner,
    mathml_name, mathml_owner, mathml_within, unicode_name, unicode_within,
};
use crate::bond_graph::{Action, BondGraph, Clause, Element, ElementId, Kind, Meaning, Trigger};
use crate::causal_paths::Refusal;
use crate::equations::{AlgebraicRole, EquationStep, LinearBlock, NewtonBlock};

/// Rows of larger systems of equations are written entry by entry.
const FULL: usize = 32;

/// A way of writing equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// The model language: `(J + M*a^2)*IJ.f' = -M*g*a*cos(phi)`.
    Ascii,
    /// Unicode text: `(J + M a²) ω' = -M g a cos φ`.
    Unicode,
    /// LaTeX.
    Latex,
    /// MathML, the elements without the `math` around them.
    MathMl,
}

/// The equations, one a line. For people, sources that vary in time stand by name; [`print_meanings`] has their values.
pub fn print(shown: &Shown, style: Style) -> Vec<String> {
    print_within(shown, style, usize::MAX).collect()
}

/// The equations, one at a time, with sides of at most so many characters: what is longer ends with `…`. Of MathML so many
/// parts, with `…` for each that is left out.
pub fn print_within(shown: &Shown, style: Style, most: usize) -> impl Iterator<Item = String> {
    sides_within(shown, style, most).map(move |(left, right)| equal(&left, &right, style))
}

/// The same, left and right sides apart.
pub fn sides_within(shown: &Shown, style: Style, most: usize) -> impl Iterator<Item = (String, String)> {
    let names = Written::within(shown, most);
    lines(shown, style).map(move |line| {
        let side = |e: Expr| expression(e, &names, style);
        match line {
            Line::Row(row) if style == Style::Ascii => (side(row.closed.0), side(row.closed.1)),
            Line::Row(row) => (side(row.left), side(row.right)),
            Line::Vector(row) => {
                let mut right = if row.right == ZERO { String::new() } else { side(row.right) };
                for of in &row.products {
                    right += &sign(of.negative, right.is_empty(), style);
                    right += &product(names.x, of, &side, style);
                }
                if !row.added.is_empty() {
                    right += &sign(false, right.is_empty(), style);
                    right += &bracketed(&row.added.iter().map(|&e| side(e)).collect::<Vec<_>>(), style);
                }
                (product(names.x, &row.left, &side, style), right)
            }
        }
    })
}

/// What stands on a line.
enum Line<'a> {
    Row(&'a DisplayEquation),
    Vector(&'a VectorEquation),
}

/// The equations, for people with one of vectors where those of strands are alike.
fn lines(shown: &Shown, style: Style) -> impl Iterator<Item = Line<'_>> {
    let vectors = if style == Style::Ascii { &[][..] } else { &shown.vectors.equations };
    let (mut at, mut next) = (0, vectors.iter().peekable());
    std::iter::from_fn(move || {
        if let Some(vector) = next.next_if(|vector| vector.rows.start == at) {
            at = vector.rows.end;
            return Some(Line::Vector(vector));
        }
        at += 1;
        shown.display.get(at - 1).map(Line::Row)
    })
}

/// What stands before a term.
fn sign(negative: bool, is_first: bool, style: Style) -> String {
    let sign = if negative { "-" } else { "+" };
    match (style, is_first) {
        (_, true) if !negative => String::new(),
        (Style::MathMl, _) => format!("<mo>{}</mo>", if negative { "−" } else { "+" }),
        (_, true) => sign.to_string(),
        (_, false) => format!(" {sign} "),
    }
}

/// A vector by what stands in its strands.
fn bracketed(strands: &[String], style: Style) -> String {
    match style {
        Style::Ascii | Style::Unicode => format!("[{}]", strands.join(", ")),
        Style::Latex => format!(r"\begin{{bmatrix}} {} \end{{bmatrix}}", strands.join(r" \\ ")),
        Style::MathMl => format!("<mo>[</mo>{}<mo>]</mo>", strands.join("<mo>,</mo>")),
    }
}

/// A matrix times a vector, across another one.
fn product(x: &Exprs, of: &Product, side: &impl Fn(Expr) -> String, style: Style) -> String {
    let each = |entries: &[Expr]| entries.iter().map(|&e| side(e)).collect::<Vec<_>>();
    let vector = side(of.vector);
    let is_name = matches!((&of.matrix, x.node(of.vector)), (Matrix::Unit, Node::Symbol(_)));
    let (space, cross) = match style {
        Style::Ascii | Style::Unicode => (" ", " × "),
        Style::Latex => (r" \, ", r" \times "),
        Style::MathMl => (r#"<mo>&#x2062;</mo><mspace width="0.14em"/>"#, "<mo>×</mo>"),
    };
    let diagonal = |list: &str| match style {
        Style::Ascii | Style::Unicode => format!("diag([{list}])"),
        Style::Latex => format!(r"\operatorname{{diag}}({list})"),
        Style::MathMl => format!("<mi>diag</mi><mo>(</mo>{list}<mo>)</mo>"),
    };
    let comma = if style == Style::MathMl { "<mo>,</mo>" } else { ", " };
    let own = match &of.matrix {
        Matrix::Unit => vector,
        Matrix::Diagonal(entries) => diagonal(&each(entries).join(comma)) + space + &vector,
        Matrix::Skew(entries) => bracketed(&each(entries), style) + cross + &vector,
        Matrix::Full(rows) => {
            let rows: Vec<Vec<String>> = rows.iter().map(|row| each(row)).collect();
            let matrix = match style {
                Style::Latex => bracketed(&rows.iter().map(|row| row.join(" & ")).collect::<Vec<_>>(), style),
                _ => bracketed(&rows.iter().map(|row| bracketed(row, style)).collect::<Vec<_>>(), style),
            };
            matrix + space + &vector
        }
    };
    match of.across {
        None => own,
        Some(across) if is_name => own + cross + &side(across),
        Some(across) => within(&own, style) + cross + &side(across),
    }
}

fn within(text: &str, style: Style) -> String {
    match style {
        Style::MathMl => format!("<mo>(</mo>{text}<mo>)</mo>"),
        _ => format!("({text})"),
    }
}

/// What stands behind the names, one at a time; see [`print_meanings`] and [`print_within`].
pub fn meanings_within(shown: &Shown, style: Style, most: usize) -> impl Iterator<Item = String> {
    let names = Written::within(shown, most);
    meant(shown, style).map(move |(symbol, value)| definition(symbol, value, &names, style))
}

/// What stands behind the names in the equations: parts of them that would make them too long, sources that vary in
/// time, states that are sums of stored quantities, conserved quantities.
pub fn print_meanings(shown: &Shown, style: Style) -> Vec<String> {
    meanings_within(shown, style, usize::MAX).collect()
}

fn meant(shown: &Shown, style: Style) -> impl Iterator<Item = (Symbol, Expr)> {
    let parts = defined(shown, false, style);
    let conserved = shown.equations.conserved.iter().map(|c| (c.symbol, c.value));
    parts.chain(shown.sources.iter().copied()).chain(shown.equations.meanings.iter().copied()).chain(conserved)
}

fn defined(shown: &Shown, of_dependent: bool, style: Style) -> impl Iterator<Item = (Symbol, Expr)> {
    let value = move |d: &ShownDefinition| if style == Style::Ascii { d.closed } else { d.value };
    let wanted = shown.definitions.iter().filter(move |d| d.of_dependent == of_dependent);
    wanted.map(move |d| (d.symbol, value(d)))
}

/// The names that the equations have for parts of them, each with what it stands for. For people, sources that vary in
/// time stand by name.
pub fn print_definitions(shown: &Shown, style: Style) -> Vec<String> {
    let names = Written::of(shown);
    defined(shown, false, style).map(|(symbol, value)| definition(symbol, value, &names, style)).collect()
}

/// What happens at events, one a line: `when f_v < 0:  f_ball⁺ = -e f_ball`. A variable with a plus is that after the event,
/// all others are those before it.
pub fn print_events(shown: &Shown, style: Style) -> Vec<String> {
    events_within(shown, style, usize::MAX)
}

/// The same with expressions of at most so many characters; see [`print_within`].
pub fn events_within(shown: &Shown, style: Style, most: usize) -> Vec<String> {
    let names = Written::within(shown, most);
    let graph = &shown.equations.graph;
    let after = |action: &Action| {
        let (own, value) = (name(action.target, &names, style), expression(action.value, &names, style));
        match style {
            Style::Ascii => format!("{own}+ = {value}"),
            Style::Unicode => format!("{own}⁺ = {value}"),
            Style::Latex => format!("{{{own}}}^{{+}} = {value}"),
            Style::MathMl => format!("<msup><mrow>{own}</mrow><mo>+</mo></msup><mo>=</mo>{value}"),
        }
    };
    let line = |clause: &Clause| {
        let when = expression(clause.trigger.expr(), &names, style);
        let word = if matches!(clause.trigger, Trigger::Every(_)) { "every" } else { "when" };
        let mut changes: Vec<String> = clause.actions.iter().map(after).collect();
        if let Some((law, bound)) = clause.bound {
            let law = &graph.set_valued[law];
            let (element, present) = (&graph.elements[law.element].name, law.branch());
            let next = law.branches[present.bounds[bound].next].name;
            let (from, to) = (format!("{element} is {} until ", present.name), format!("it is {next}"));
            return match style {
                Style::Ascii | Style::Unicode => {
                    changes.push(to);
                    format!("{from}{when}: {}", changes.join(", "))
                }
                Style::Latex => {
                    changes.push(format!("\\text{{{to}}}"));
                    format!("\\text{{{from}}} {when}: \\quad {}", changes.join(", \\; "))
                }
                Style::MathMl => {
                    changes.push(format!("<mtext>{to}</mtext>"));
                    format!("<mtext>{from}&#xa0;</mtext>{when}<mo>:</mo>{}", changes.join("<mo>,</mo>"))
                }
            };
        }
        match style {
            Style::Ascii | Style::Unicode => format!("{word} {when}: {}", changes.join(", ")),
            Style::Latex => format!("\\text{{{word} }} {when}: \\quad {}", changes.join(", \\; ")),
            Style::MathMl => format!("<mtext>{word}&#xa0;</mtext>{when}<mo>:</mo>{}", changes.join("<mo>,</mo>")),
        }
    };
    graph.clauses.iter().map(line).collect()
}

/// The dependent storages, each with its row of `S`, one a line, and behind them the names that only they read.
pub fn print_dependent(shown: &Shown, style: Style) -> Vec<String> {
    dependent_within(shown, style, usize::MAX).collect()
}

/// The same, one at a time; see [`print_within`].
pub fn dependent_within(shown: &Shown, style: Style, most: usize) -> impl Iterator<Item = String> {
    let names = Written::within(shown, most);
    let rows = shown.dependent.iter().map(|d: &Dependent| (d.variable, d.value));
    rows.chain(defined(shown, true, style)).map(move |(symbol, value)| definition(symbol, value, &names, style))
}

/// A form in few lines: counts, index, unknowns with what they are there for, equations.
pub fn print_form(shown: &Shown) -> String {
    let equations = &shown.equations;
    let (n, index) = (equations.counts, equations.index);
    let mut text = format!("equations {} {}\n", equations.graph.name, equations.form.name());
    text += &format!("\n{} differential, {} algebraic, index {index}\n\nunknowns\n", n.differential, n.algebraic);
    let mut indices = equations.indices.iter();
    let mut higher = || indices.next().filter(|i| **i > 1).map_or(String::new(), |i| format!("  index {i}"));
    for state in &equations.states {
        text += &format!("  {}{}\n", state.name, higher());
    }
    for unknown in &equations.algebraic {
        let element = |e: ElementId| &equations.graph.elements[e].name;
        let cause = match unknown.cause {
            AlgebraicRole::Break => "break variable".to_string(),
            AlgebraicRole::Law(e) => format!("law of {}", element(e)),
            AlgebraicRole::Multiplier(e) => format!("multiplier of {}", element(e)),
        };
        text += &format!("  {}  {cause}{}\n", unknown.name, higher());
    }
    text += "\nequations\n";
    print(shown, Style::Unicode).iter().for_each(|line| text += &format!("  {line}\n"));
    print_meanings(shown, Style::Unicode).iter().for_each(|line| text += &format!("  where {line}\n"));
    let events = print_events(shown, Style::Unicode);
    if !events.is_empty() {
        text += "\nevents\n";
    }
    events.iter().for_each(|line| text += &format!("  {line}\n"));
    let certificate = print_certificate(shown);
    if !certificate.is_empty() {
        text += "\ncertificate\n";
    }
    certificate.iter().for_each(|line| text += &format!("  {line}\n"));
    text
}

/// Which storage was inverted for which paths, what follows from others, and why nothing opens what is left.
pub fn print_certificate(shown: &Shown) -> Vec<String> {
    let equations = &shown.equations;
    let Some(certificate) = &equations.certificate else { return Vec::new() };
    let graph = &equations.graph;
    let names =
        |list: &[ElementId]| list.iter().map(|&e| graph.elements[e].name.as_str()).collect::<Vec<_>>().join(" - ");
    let mut lines = Vec::new();
    for opened in &certificate.inverted {
        let paths: Vec<String> = opened.paths.iter().map(|(c, list)| format!("class {c} {}", names(list))).collect();
        lines.push(format!("{} is inverted: it opens {}", graph.port_name(opened.port), paths.join(", ")));
    }
    for &port in &certificate.eliminated {
        lines.push(format!("{} follows from the others", graph.port_name(port)));
    }
    for &symbol in &certificate.left {
        let name =
            equations.algebraic.iter().find(|a| a.symbol == symbol).map_or(names_of(graph, symbol), |a| a.name.clone());
        lines.push(format!("{name}: no storage removes this break variable"));
    }
    for (port, why) in &certificate.refused {
        let element = match why {
            Refusal::LawNotInvertible(element) | Refusal::ModulusOfRate(element) => {
                format!(" ({})", graph.elements[*element].name)
            }
            _ => String::new(),
        };
        lines.push(format!("{} stays as it is: {why}{element}", graph.port_name(*port)));
    }
    lines
}

fn names_of(graph: &BondGraph, symbol: Symbol) -> String {
    graph.exprs.name(symbol).to_string()
}

/// One expression in the names of these equations.
pub fn print_expr(shown: &Shown, e: Expr, style: Style) -> String {
    expression(e, &Written::of(shown), style)
}

/// The same up to so many characters; see [`print_within`].
pub fn print_expr_within(shown: &Shown, e: Expr, style: Style, most: usize) -> String {
    expression(e, &Written::within(shown, most), style)
}

/// One symbol in the names of these equations.
pub fn print_symbol(shown: &Shown, symbol: Symbol, style: Style) -> String {
    name(symbol, &Written::of(shown), style)
}

fn definition(symbol: Symbol, value: Expr, names: &Written, style: Style) -> String {
    equal(&name(symbol, names, style), &expression(value, names, style), style)
}

fn equal(left: &str, right: &str, style: Style) -> String {
    match style {
        Style::MathMl => format!("{left}<mo>=</mo>{right}"),
        _ => format!("{left} = {right}"),
    }
}

fn name(symbol: Symbol, names: &Written, style: Style) -> String {
    match style {
        Style::Ascii => names.ascii(symbol),
        Style::Unicode => names.unicode(symbol),
        Style::Latex => names.latex(symbol),
        Style::MathMl => names.mathml(symbol),
    }
}

fn expression(e: Expr, names: &Written, style: Style) -> String {
    match (style, names.most) {
        (Style::Ascii, most) => ascii_within(names.x, e, names, most),
        (Style::Unicode, most) => unicode_within(names.x, e, names, most),
        (Style::Latex, _) => latex(names.x, e, names),
        (Style::MathMl, most) => mathml_within(names.x, e, names, most),
    }
}

/// How the symbols of equations are written: for people by the name that an output or `let` gives to a state.
struct Written<'a> {
    x: &'a Exprs,
    aliases: &'a BTreeMap<Symbol, String>,
    states: BTreeMap<Symbol, (&'a str, bool)>,
    /// For each rate the state that it belongs to.
    rate_of: BTreeMap<Symbol, Symbol>,
    sources: BTreeMap<Symbol, String>,
    places: BTreeMap<Symbol, Place>,
    /// How long an expression may get.
    most: usize,
}

impl<'a> Written<'a> {
    fn of(shown: &'a Shown) -> Self {
        Written::within(shown, usize::MAX)
    }

    fn within(shown: &'a Shown, most: usize) -> Self {
        let equations = &shown.equations;
        let mut states = BTreeMap::new();
        for state in &equations.states {
            states.insert(state.symbol, (state.name.as_str(), false));
            states.insert(state.rate, (state.name.as_str(), true));
        }
        for (&symbol, (name, is_rate)) in &shown.vectors.names {
            states.insert(symbol, (name.as_str(), *is_rate));
        }
        let rate_of = equations.states.iter().map(|s| (s.rate, s.symbol)).collect();
        let sources = shown.sources.iter().map(|&(s, _)| (s, element_name(&equations.graph, s))).collect();
        let places = places::of(shown);
        Written { x: &equations.graph.exprs, aliases: &shown.aliases, states, rate_of, sources, places, most }
    }

    /// The name that an output or `let` gives, or what a source is called, for people.
    fn for_people(&self, symbol: Symbol) -> (String, usize) {
        if let Some(source) = self.sources.get(&symbol) {
            return (source.clone(), 0);
        }
        let (name, rates) = self.called(symbol);
        let of = if rates == 0 { Some(symbol) } else { self.rate_of.get(&symbol).copied() };
        let alias = of.and_then(|s| self.aliases.get(&s));
        (alias.cloned().unwrap_or(name), rates)
    }
}

impl Names for Written<'_> {
    fn called(&self, symbol: Symbol) -> (String, usize) {
        match self.states.get(&symbol) {
            Some(&(name, rate)) => (name.to_string(), rate.into()),
            None => {
                let (of, rates) = self.x.undotted(symbol);
                (self.x.name(of).to_string(), rates)
            }
        }
    }

    fn unicode(&self, symbol: Symbol) -> String {
        let (name, rates) = self.for_people(symbol);
        match subscripted(&name) {
            Some((variable, element)) => dotted(&format!("{}_{element}", unicode_name(variable, 0)), rates),
            None => unicode_name(&name, rates),
        }
    }

    fn latex(&self, symbol: Symbol) -> String {
        let (name, rates) = self.for_people(symbol);
        match subscripted(&name) {
            Some((variable, element)) => {
                format!("{}_{{{}}}", latex_name(variable, rates), latex_owner(element))
            }
            None => latex_name(&name, rates),
        }
    }

    fn mathml(&self, symbol: Symbol) -> String {
        let (name, rates) = self.for_people(symbol);
        match subscripted(&name) {
            Some((variable, element)) => {
                format!("<msub>{}{}</msub>", mathml_name(variable, rates), mathml_owner(element))
            }
            None => mathml_name(&name, rates),
        }
    }

    fn place(&self, symbol: Symbol) -> Place {
        let last = Place { sort: Sort::Variable, family: 3, factor: symbol.0, term: symbol.0 };
        self.places.get(&symbol).copied().unwrap_or(last)
    }
}

/// The name of the source that sets a variable.
pub(super) fn element_name(graph: &BondGraph, symbol: Symbol) -> String {
    let bond = match graph.variables.get(&symbol).map(|v| v.meaning) {
        Some(Meaning::Effort(bond) | Meaning::Flow(bond)) => &graph.bonds[bond],
        _ => return graph.exprs.name(symbol).to_string(),
    };
    let source = |e: &&Element| matches!(e.kind, Kind::EffortSource { .. } | Kind::FlowSource { .. });
    let ends = [bond.from, bond.to].map(|p| &graph.elements[p.element]);
    ends.iter().copied().find(source).map_or_else(String::new, |e| e.name.clone())
}

/// `m.f` is written as `f` with the subscript `m`.
fn subscripted(name: &str) -> Option<(&str, &str)> {
    let (element, variable) = name.rsplit_once('.')?;
    matches!(variable, "e" | "f" | "q" | "p" | "pi").then_some((variable, element))
}

impl Display for Shown {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let equations = &self.equations;
        let names = Written::of(self);
        let text = |e: Expr| ascii(names.x, e, &names);
        writeln!(f, "equations {} {:?}", equations.graph.name, equations.form)?;
        writeln!(f, "\nstates")?;
        for state in &equations.states {
            writeln!(f, "  {}", state.name)?;
        }
        writeln!(f, "\nequations")?;
        for line in print(self, Style::Unicode) {
            writeln!(f, "  {line}")?;
        }
        for line in print_meanings(self, Style::Unicode) {
            writeln!(f, "  where {line}")?;
        }
        for line in print_dependent(self, Style::Unicode) {
            writeln!(f, "  dependent {line}")?;
        }
        for (i, line) in print_events(self, Style::Unicode).into_iter().enumerate() {
            if i == 0 {
                writeln!(f, "\nevents")?;
            }
            writeln!(f, "  {line}")?;
        }
        writeln!(f, "\nsteps")?;
        for step in &equations.steps {
            match step {
                EquationStep::Assign { symbol, value } => writeln!(f, "  {} = {}", names.ascii(*symbol), text(*value))?,
                EquationStep::Guard { pivot, .. } => writeln!(f, "  watch {}", text(*pivot))?,
                EquationStep::Linear(block) => {
                    let LinearBlock { unknowns, matrix, right, .. } = &**block;
                    writeln!(f, "  solve for {}", list(unknowns, &names))?;
                    for (row, &right) in matrix.rows().zip(right) {
                        let named = |(k, &e): (usize, &Expr)| format!("{}: {}", names.ascii(unknowns[k]), text(e));
                        let mut full = vec!["0".to_string(); unknowns.len().min(FULL)];
                        let row: Vec<String> = if unknowns.len() > FULL {
                            row.map(named).collect()
                        } else {
                            row.for_each(|(k, &e)| full[k] = text(e));
                            full
                        };
                        writeln!(f, "    [{}] = {}", row.join(", "), text(right))?;
                    }
                }
                EquationStep::Newton(block) => {
                    let NewtonBlock { unknowns, body, residuals, .. } = &**block;
                    writeln!(f, "  iterate for {}", list(unknowns, &names))?;
                    for (symbol, value) in body {
                        writeln!(f, "    {} = {}", names.ascii(*symbol), text(*value))?;
                    }
                    for &residual in residuals {
                        writeln!(f, "    0 = {}", text(residual))?;
                    }
                }
            }
        }
        Ok(())
    }
}

fn list(symbols: &[Symbol], names: &Written) -> String {
    symbols.iter().map(|&s| names.ascii(s)).collect::<Vec<_>>().join(", ")
}
