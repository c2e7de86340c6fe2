//! The names of a model: where each is declared, where the text uses it, and who reads it.

use std::collections::{BTreeMap, BTreeSet};

use halfarrow_compiler::algebra::{Expr, Symbol};
use halfarrow_compiler::bond_graph::{
    self, BondGraph, Element, HeldKind, Kind, NameKind, ResistorLaw, Storage, StorageLaw,
};
use halfarrow_compiler::diagnostic::Sources;
use halfarrow_compiler::span::{FileId, Span};
use serde::{Serialize, Serializer};

use crate::model::Model;

/// A name of a model. Names within components stand with those of their instances before them: `motor.coil`. Elements
/// with indices have one name together: `spring` for `spring[1]` to `spring[9]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Name {
    /// The name.
    pub name: String,
    /// What it stands for.
    #[serde(serialize_with = "word")]
    pub kind: NameKind,
    /// Where it is declared: the place of the name alone. What a component declares is declared there for each of its
    /// instances; a file is declared by its beginning.
    pub declared: Place,
    /// Where the text uses it, in the order of the files and of their text: the places of the name alone, without what
    /// stands before and behind the dots. A place inside a component is one of each instance's name that it means there.
    /// Components that nothing instantiates use nothing; the arguments of functions and the variables of repetitions are no names of the model.
    pub uses: Vec<Place>,
    /// Whose values or laws read it, by name: of a parameter or signal itself, of an element one of its variables. A `let` is
    /// written out where it stands: what it reads is read there. A parameter of an instance that is given another one whole
    /// is that one, which is read in its place.
    pub read_by: Vec<String>,
}

fn word<S: Serializer>(kind: &NameKind, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(kind.word())
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

/// What a name gives others to read, and what it reads.
struct Reader<'g> {
    name: &'g str,
    kind: NameKind,
    span: Span,
    symbols: Vec<Symbol>,
    reads: BTreeSet<Symbol>,
}

impl Model {
    /// All names, those of one kind in the order of the text, with the places that use them. Behind those of a kind that the
    /// text declares stand those that it implies: the states of `pid` and `tf`, and the elements that make up a constraint;
    /// their places are those of what they were made for, and no text uses them.
    ///
    /// ```
    /// use halfarrow::{Model, NameKind};
    /// let text = "model Drop\nparam m = 2 kg\nSe:weight(9.81*m) -> I:mass(m)\noutput v = mass.f\n";
    /// let names = Model::from_text("drop.bond", text, &[])?.names();
    /// let m = names.iter().find(|n| n.name == "m").unwrap();
    /// assert_eq!((m.kind, m.declared.line), (NameKind::Parameter, 2));
    /// let uses: Vec<(usize, usize)> = m.uses.iter().map(|place| (place.line, place.column)).collect();
    /// assert_eq!(uses, [(3, 16), (3, 29)]);
    /// # Ok::<(), halfarrow::Error>(())
    /// ```
    pub fn names(&self) -> Vec<Name> {
        let readers = readers(&self.graph);
        let by_name: BTreeMap<(bool, &str), usize> =
            readers.iter().enumerate().map(|(at, r)| ((r.kind.is_value(), r.name), at)).collect();
        let read_by = read_by(&readers);
        let places = Places::of(&self.found.sources);
        let mut told = vec![false; readers.len()];
        let mut all = Vec::with_capacity(self.found.names.len());
        for bond_graph::Name { name, kind, declared, uses } in self.found.names.iter() {
            let reader = by_name.get(&(kind.is_value(), name.as_str())).copied();
            reader.into_iter().for_each(|at| told[at] = true);
            all.push(Name {
                name: name.clone(),
                kind: *kind,
                declared: declared.map_or_else(|| beginning_of(name), |span| places.place(span)),
                uses: uses.iter().map(|span| places.place(*span)).collect(),
                read_by: reader.map_or_else(Vec::new, |at| read_by[at].clone()),
            });
        }
        for (at, reader) in readers.iter().enumerate().filter(|(at, _)| !told[*at]) {
            let (name, declared) = (reader.name.to_string(), places.place(reader.span));
            all.push(Name { name, kind: reader.kind, declared, uses: Vec::new(), read_by: read_by[at].clone() });
        }
        all.sort_by_key(|name| name.kind);
        all
    }
}

/// The parts of a list with commas between them, as options take it. Commas in brackets belong to a part: `node[1,2].q`.
///
/// ```
/// assert_eq!(halfarrow::listed("t, node[1,2].q,final(x)"), ["t", "node[1,2].q", "final(x)"]);
/// ```
pub fn listed(text: &str) -> Vec<&str> {
    let mut open = 0i32;
    let parts = text.split(|c| {
        open += i32::from(matches!(c, '[' | '(')) - i32::from(matches!(c, ']' | ')'));
        c == ',' && open <= 0
    });
    parts.map(str::trim).collect()
}

/// The place that stands for a whole file.
fn beginning_of(file: &str) -> Place {
    Place { file: file.to_string(), line: 1, column: 1, start: 0, end: 0 }
}

/// Places of spans, with the lines of all files known.
struct Places<'s> {
    sources: &'s Sources,
    /// Where the lines of each file begin.
    lines: Vec<Vec<usize>>,
}

impl<'s> Places<'s> {
    fn of(sources: &'s Sources) -> Places<'s> {
        let begin = |text: &str| std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        Places { sources, lines: sources.texts().map(begin).collect() }
    }

    fn place(&self, span: Span) -> Place {
        let FileId(file) = span.file;
        let (start, end) = (span.start as usize, span.end as usize);
        let lines = &self.lines[file as usize];
        let line = lines.partition_point(|begin| *begin <= start);
        let before = &self.sources.text(span.file)[lines[line - 1]..start];
        let (file, column) = (self.sources.name(span.file).to_string(), 1 + before.chars().count());
        Place { file, line, column, start, end }
    }
}

/// For each of them those that read one of its symbols, itself left out.
fn read_by(readers: &[Reader]) -> Vec<Vec<String>> {
    let mut readers_of: BTreeMap<Symbol, Vec<usize>> = BTreeMap::new();
    for (at, reader) in readers.iter().enumerate() {
        reader.reads.iter().for_each(|symbol| readers_of.entry(*symbol).or_default().push(at));
    }
    let names = |own: usize| {
        let all = readers[own].symbols.iter().filter_map(|symbol| readers_of.get(symbol)).flatten();
        let others: BTreeSet<usize> = all.copied().filter(|at| *at != own).collect();
        others.into_iter().map(|at| readers[at].name.to_string()).collect()
    };
    (0..readers.len()).map(names).collect()
}

fn readers(graph: &BondGraph) -> Vec<Reader<'_>> {
    let symbols = |exprs: &[Expr]| exprs.iter().flat_map(|e| graph.exprs.symbols_of(*e)).collect();
    let reader = |name, kind, span, own: &[Symbol], exprs: &[Expr]| Reader {
        name,
        kind,
        span,
        symbols: own.to_vec(),
        reads: symbols(exprs),
    };
    let mut all: Vec<Reader> = Vec::new();
    all.extend(graph.parameters.values().map(|p| {
        let kind = if p.constant { NameKind::Constant } else { NameKind::Parameter };
        reader(&p.name, kind, p.span, &[p.symbol], &[p.value])
    }));
    all.extend(graph.inputs.values().map(|i| reader(&i.name, NameKind::Input, i.span, &[i.symbol], &[i.default])));
    all.extend(graph.signals.values().map(|s| {
        let reads: Vec<Expr> = std::iter::once(s.rate).chain(s.initial).collect();
        reader(&s.name, NameKind::State, s.span, &[s.symbol], &reads)
    }));
    for held in graph.held.values().filter(|h| h.kind == HeldKind::Discrete) {
        let setting = graph.clauses.iter().filter(|c| c.actions.iter().any(|a| a.target == held.symbol));
        let mut reads = vec![held.source];
        for clause in setting {
            reads.push(clause.trigger.expr());
            reads.extend(clause.actions.iter().filter(|a| a.target == held.symbol).map(|a| a.value));
        }
        all.push(reader(&held.name, NameKind::Discrete, held.span, &[held.symbol], &reads));
    }
    all.extend(graph.lets.iter().map(|l| reader(&l.name, NameKind::Let, l.span, &[], &[l.value])));
    all.extend(graph.outputs.iter().map(|o| reader(&o.name, NameKind::Output, o.span, &[], &[o.value])));
    all.extend(
        graph.elements.values().map(|e| reader(&e.name, kind_of(e), e.span, &variables(graph, e), &laws(&e.kind))),
    );
    let bonds = graph.bonds.values().filter(|b| !b.name.is_empty());
    all.extend(bonds.map(|b| reader(&b.name, NameKind::Bond, b.span, &[b.effort, b.flow], &[])));
    together(all)
}

/// Elements with indices have one name together: what one of them reads or gives, the name does.
fn together(all: Vec<Reader<'_>>) -> Vec<Reader<'_>> {
    let mut at: BTreeMap<(bool, &str), usize> = BTreeMap::new();
    let mut merged: Vec<Reader> = Vec::with_capacity(all.len());
    for reader in all {
        let name = reader.name.strip_suffix(']').and_then(|n| n.rsplit_once('[')).map_or(reader.name, |(name, _)| name);
        match at.get(&(reader.kind.is_value(), name)).filter(|_| name != reader.name) {
            Some(&first) => {
                merged[first].symbols.extend(reader.symbols);
                merged[first].reads.extend(reader.reads);
            }
            None => {
                at.insert((reader.kind.is_value(), name), merged.len());
                merged.push(Reader { name, ..reader });
            }
        }
    }
    merged
}

fn kind_of(element: &Element) -> NameKind {
    match element.kind {
        Kind::Zero | Kind::One => NameKind::Junction,
        _ => NameKind::Element,
    }
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
        Kind::Transformer { .. } | Kind::Gyrator { .. } | Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_) => {
            kind.moduli()
        }
        Kind::ResidualEffort { residual } | Kind::ResidualFlow { residual } => residual.iter().copied().collect(),
        Kind::Inertance(storage) | Kind::Compliance(storage) => stored_by(storage),
        Kind::Resistor(laws) | Kind::SkewGyrator(laws) => laws
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
