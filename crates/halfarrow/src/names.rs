//! The names of a model: where each is declared, and who reads it.

use std::collections::BTreeSet;

use halfarrow_compiler::algebra::{Expr, Symbol};
use halfarrow_compiler::bond_graph::{BondGraph, Element, Kind, ResistorLaw, Storage, StorageLaw};
use halfarrow_compiler::span::Span;
use serde::Serialize;

use crate::model::Model;

/// What a name stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NameKind {
    /// A parameter.
    Parameter,
    /// A constant.
    Constant,
    /// An input.
    Input,
    /// A signal that is integrated.
    State,
    /// A named expression.
    Let,
    /// An output.
    Output,
    /// An element or a junction.
    Element,
    /// A bond that has a name.
    Bond,
}

/// A name of a model. Names within components stand with those of their instances before them: `motor.coil`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Name {
    /// The name.
    pub name: String,
    /// What it stands for.
    pub kind: NameKind,
    /// Where it is declared.
    pub declared: Place,
    /// Whose values or laws read it, by name: of a parameter or signal itself, of an element one of its variables. A `let` is
    /// written out where it stands: what it reads is read there.
    pub read_by: Vec<String>,
}

/// A place in the text of a model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Place {
    /// The file.
    pub file: String,
    /// Its line, from 1.
    pub line: usize,
    /// Its column, from 1, in characters.
    pub column: usize,
    /// Its first byte in the file.
    pub start: usize,
    /// The byte behind its last one.
    pub end: usize,
}

/// A name with what it gives others to read, and what it reads.
struct NamedItem<'g> {
    name: &'g str,
    kind: NameKind,
    span: Span,
    symbols: Vec<Symbol>,
    reads: BTreeSet<Symbol>,
}

impl Model {
    /// All names, those of one kind in the order of the text.
    pub fn names(&self) -> Vec<Name> {
        let entries = entries(&self.graph);
        let named = |entry: &NamedItem| {
            let reads = |other: &&NamedItem| {
                other.name != entry.name && entry.symbols.iter().any(|symbol| other.reads.contains(symbol))
            };
            Name {
                name: entry.name.to_string(),
                kind: entry.kind,
                declared: self.place(entry.span),
                read_by: entries.iter().filter(reads).map(|other| other.name.to_string()).collect(),
            }
        };
        entries.iter().map(named).collect()
    }

    fn place(&self, span: Span) -> Place {
        let sources = &self.found.sources;
        let (line, column) = sources.line_column(span);
        let (start, end) = (span.start as usize, span.end as usize);
        Place { file: sources.name(span.file).to_string(), line, column, start, end }
    }
}

fn entries(graph: &BondGraph) -> Vec<NamedItem<'_>> {
    let symbols = |exprs: &[Expr]| exprs.iter().flat_map(|e| graph.exprs.symbols_of(*e)).collect();
    let entry = |name, kind, span, own: &[Symbol], exprs: &[Expr]| NamedItem {
        name,
        kind,
        span,
        symbols: own.to_vec(),
        reads: symbols(exprs),
    };
    let mut all: Vec<NamedItem> = Vec::new();
    all.extend(graph.parameters.values().map(|p| {
        let kind = if p.constant { NameKind::Constant } else { NameKind::Parameter };
        entry(&p.name, kind, p.span, &[p.symbol], &[p.value])
    }));
    all.extend(graph.inputs.values().map(|i| entry(&i.name, NameKind::Input, i.span, &[i.symbol], &[i.default])));
    all.extend(graph.signals.values().map(|s| {
        let reads: Vec<Expr> = std::iter::once(s.rate).chain(s.initial).collect();
        entry(&s.name, NameKind::State, s.span, &[s.symbol], &reads)
    }));
    all.extend(graph.lets.iter().map(|l| entry(&l.name, NameKind::Let, l.span, &[], &[l.value])));
    all.extend(graph.outputs.iter().map(|o| entry(&o.name, NameKind::Output, o.span, &[], &[o.value])));
    all.extend(
        graph
            .elements
            .values()
            .map(|e| entry(&e.name, NameKind::Element, e.span, &variables(graph, e), &laws(&e.kind))),
    );
    let bonds = graph.bonds.values().filter(|b| !b.name.is_empty());
    all.extend(bonds.map(|b| entry(&b.name, NameKind::Bond, b.span, &[b.effort, b.flow], &[])));
    all
}

/// The variables of an element: of its bonds and of what it stores. Those of a junction belong to its bonds' other ends.
fn variables(graph: &BondGraph, element: &Element) -> Vec<Symbol> {
    let stored = match &element.kind {
        Kind::Zero | Kind::One => return Vec::new(),
        Kind::Inertance(storage) | Kind::Compliance(storage) => storage.stored.as_slice(),
        _ => &[],
    };
    let ports = element.ports.iter().map(|port| &graph.bonds[port.bond]);
    ports.flat_map(|bond| [bond.effort, bond.flow]).chain(stored.iter().copied()).collect()
}

/// The expressions of an element.
fn laws(kind: &Kind) -> Vec<Expr> {
    match kind {
        Kind::Zero | Kind::One | Kind::EffortDetector | Kind::FlowDetector => Vec::new(),
        Kind::EffortSource { value: e } | Kind::FlowSource { value: e } | Kind::ZeroCompliance { flow: e } => vec![*e],
        Kind::Transformer { modulus } | Kind::Gyrator { modulus } => vec![*modulus],
        Kind::ResidualEffort { residual } | Kind::ResidualFlow { residual } => residual.iter().copied().collect(),
        Kind::Inertance(storage) | Kind::Compliance(storage) => stored_by(storage),
        Kind::Resistor(laws) => laws
            .iter()
            .map(|law| match law {
                ResistorLaw::Resistive(e) | ResistorLaw::Conductive(e) | ResistorLaw::Implicit(e) => *e,
            })
            .collect(),
    }
}

fn stored_by(storage: &Storage) -> Vec<Expr> {
    let laws = storage.laws.iter().flat_map(|law| match law {
        StorageLaw::Integral(e) | StorageLaw::Derivative(e) | StorageLaw::Implicit(e) => vec![*e],
        StorageLaw::Known { displacement, law } => vec![*displacement, *law],
    });
    laws.chain(storage.energy).chain(storage.initial.iter().map(|initial| initial.value)).collect()
}
