//! The stage: from syntax trees to a bond graph.

use std::collections::{BTreeMap, BTreeSet};

use super::builder::Builder;
use super::dimension::Quantity;
use super::files::Files;
use super::flatten::{self, Flat, Word};
use super::load::{Loaded, load};
use super::overrides::{self, Override};
use super::wire::{Wiring, wire};
use super::{
    Bond, BondGraph, Element, ForcedCausality, ForcedStroke, Guess, Kind, Meaning, Port, Preference, Variable, verify,
};
use crate::algebra::{Expr, Symbol};
use crate::ast::{Ast, Header};
use crate::diagnostic::{Diagnostic, Diagnostics, Sources};
use crate::ids::{Id, Map, Table};
use crate::unit::{Dimension, Unit};

/// What has become of a model.
#[derive(Debug)]
pub struct Elaborated {
    /// The graph, if there is no error.
    pub graph: Option<BondGraph>,
    /// All faults of this stage, and of the syntax of imported files, in the order of the text.
    pub diagnostics: Diagnostics,
    /// The texts of the model: the main file, what it imports, and the overrides.
    pub sources: Sources,
}

/// Elaborates a model: names, units, components, laws, signal blocks and constraints.
///
/// `main` is the tree of the first file of `sources`; the others are read through `files`. `overrides` replace the
/// values of parameters before anything is derived from them. The tree may have faults; what is missing in it is passed
/// over, so that the faults of this stage are found too.
///
/// ```
/// use halfarrow_compiler::{ast, bond_graph, diagnostic::Sources};
/// let mut sources = Sources::new();
/// let text = "model Drop\nSe:weight(9.81 N) -> I:mass(1 kg)\n";
/// let file = sources.add("drop.bond", text);
/// let tree = ast::parse(text, file).ast;
/// let result = bond_graph::elaborate(tree, sources, &bond_graph::NoFiles, &[]);
/// assert_eq!(result.graph.unwrap().bonds.len(), 1);
/// ```
pub fn elaborate(main: Ast, mut sources: Sources, files: &dyn Files, overrides: &[Override]) -> Elaborated {
    let Loaded { files: trees, mut faults } = load(main, &mut sources, files);
    let given = overrides::parse(overrides, &mut sources, &mut faults);
    let title = trees.first().and_then(|t| t.header.as_ref()).map_or(Title::default(), Title::of);
    let mut flat = flatten::flatten(&trees);
    faults.append(&mut flat.faults);
    overrides::apply(&given, &mut flat, &mut faults);
    let mut wiring = wire(&flat);
    faults.append(&mut wiring.faults);
    let (graph, more) =
        build(&flat, &wiring, &sources, files, faults.iter().any(Diagnostic::is_error), &title, &BTreeSet::new());
    faults.extend(more);
    faults.extend(graph.iter().flat_map(super::guesses::idle));
    in_order(&mut faults);
    let graph = graph.filter(|_| !faults.iter().any(Diagnostic::is_error));
    if let Some(graph) = &graph {
        debug_assert_eq!(verify(graph), Ok(()), "{}", graph.name);
    }
    drop(flat);
    Elaborated { graph, diagnostics: Diagnostics(faults), sources }
}

/// Brings faults into the order of the text, each once.
fn in_order(faults: &mut Vec<Diagnostic>) {
    faults.sort_by_key(|d| (d.primary.span.file, d.primary.span.start, d.code.name));
    faults.dedup();
}

/// Builds the graph of a flat model, as far as its faults allow. `parted`: the bonds in which a constraint acts; they
/// are found on the way, and then all is done again with the efforts at their two ends told apart.
fn build(
    flat: &Flat<'_>,
    wiring: &Wiring,
    sources: &Sources,
    files: &dyn Files,
    faulty: bool,
    title: &Title,
    parted: &BTreeSet<usize>,
) -> (Option<BondGraph>, Vec<Diagnostic>) {
    let mut b = Builder::new(flat, wiring, sources, files);
    b.make_symbols(parted);
    b.later = Some(Vec::new());
    b.make_values();
    let later = b.later.take();
    let kinds: Vec<Option<Kind>> = (0..flat.parts.len()).map(|part| b.kind(part)).collect();
    b.later = later;
    let guesses = b.guesses();
    b.settle_units();
    b.finish_blocks();
    let asked = Asked {
        guesses,
        preferences: b.preferences(),
        forced_causality: b.forced_causality(),
        forced_strokes: b.forced_strokes(),
    };
    let sides = b.constraint_sides();
    let rates = b.rates_of_signals();
    let relations = b.relations(&sides, &rates);
    let found = b.parted(&relations);
    if b.faults.is_empty() && found != *parted {
        return build(flat, wiring, sources, files, faulty, title, &found);
    }
    b.forgive_unwritten_units();
    let complete = !faulty && !b.incomplete && b.faults.is_empty() && kinds.iter().all(Option::is_some);
    if !complete {
        return (None, b.faults);
    }
    let kinds: Vec<Kind> = kinds.into_iter().flatten().collect();
    let mut graph = b.assemble(title, kinds, asked);
    b.build_constraints(&mut graph, &relations);
    let repeated = b.recognise_storages(&mut graph, &rates);
    let mut graph = b.finish(graph);
    graph.replace_symbols(&rates);
    graph.replace_symbols(&repeated);
    b.forgive_unwritten_units();
    (Some(graph), b.faults)
}

/// What a model is called.
#[derive(Default)]
struct Title {
    name: String,
    doc: String,
}

impl Title {
    fn of(header: &Header) -> Title {
        let doc = header.doc.as_ref().map_or(String::new(), |d| d.text.clone());
        Title { name: header.name.text.clone(), doc }
    }
}

/// What a model asks of its causality and of its start.
struct Asked {
    guesses: Vec<Guess>,
    preferences: Vec<Preference>,
    forced_causality: Vec<ForcedCausality>,
    forced_strokes: Vec<ForcedStroke>,
}

impl Builder<'_, '_> {
    /// The graph without constraints and without the table of its variables.
    fn assemble(&mut self, title: &Title, kinds: Vec<Kind>, asked: Asked) -> BondGraph {
        let elements: Table<_, Element> =
            kinds.into_iter().enumerate().map(|(part, kind)| self.element(part, kind)).collect();
        let bonds: Table<_, Bond> = self.wiring.wires.iter().enumerate().map(|(wire, w)| self.bond(wire, w)).collect();
        BondGraph {
            name: title.name.clone(),
            doc: title.doc.clone(),
            exprs: crate::algebra::Exprs::default(),
            variables: Map::new(),
            elements,
            bonds,
            common: self.common_bonds(),
            parameters: std::mem::take(&mut self.parameters),
            inputs: std::mem::take(&mut self.inputs),
            signals: std::mem::take(&mut self.signals),
            held: std::mem::take(&mut self.held),
            lets: std::mem::take(&mut self.lets),
            outputs: self.outputs_in_order(),
            preferences: asked.preferences,
            forced_causality: asked.forced_causality,
            forced_strokes: asked.forced_strokes,
            guesses: asked.guesses,
            constraints: Vec::new(),
            time: self.time,
        }
    }

    fn outputs_in_order(&mut self) -> Vec<super::Named> {
        let mut outputs = std::mem::take(&mut self.outputs);
        outputs.sort_by_key(|o| o.span);
        self.lets.sort_by_key(|l| l.span);
        outputs
    }

    fn element(&self, part: usize, kind: Kind) -> Element {
        let p = self.part(part);
        let name_of = |port: usize| match p.word {
            w if w.is_two_port() => ["in", "out"][port].to_string(),
            _ => p.ast.ports.get(port).map_or(String::new(), |n| n.text.clone()),
        };
        let ports = self.wiring.ports[part].iter().flatten().enumerate();
        let ports = ports.map(|(port, (wire, inward))| Port {
            name: name_of(port),
            bond: Self::bond_id(*wire),
            inward: *inward,
        });
        Element { name: p.name.clone(), kind, ports: ports.collect(), span: p.ast.span, label: self.label(part) }
    }

    fn bond(&self, wire: usize, w: &super::wire::Wire) -> Bond {
        Bond {
            from: Self::port_ref(w.from.0, w.from.1),
            to: Self::port_ref(w.to.0, w.to.1),
            name: w.name.clone(),
            effort: self.pairs[wire].effort,
            flow: self.pairs[wire].flow,
            pseudo: self.pseudo[wire],
            span: w.span,
        }
    }

    /// Adds the expressions and the table of variables.
    fn finish(&mut self, mut graph: BondGraph) -> BondGraph {
        let mut variables = Vec::with_capacity(self.meanings.len());
        let mut units = BTreeMap::new();
        for (at, known) in self.meanings.iter().enumerate() {
            if let Some((meaning, quantity)) = known {
                let unit =
                    self.written_unit(*meaning, &graph).or_else(|| self.shown_unit(*meaning, quantity, &mut units));
                variables.push((Symbol(at as u32), Variable { meaning: *meaning, unit }));
            }
        }
        graph.variables = variables.into_iter().collect();
        for named in graph.lets.iter_mut().chain(&mut graph.outputs) {
            if let (None, Some(quantity)) = (&named.unit, self.named_quantities.get(&named.name)) {
                named.unit = self.dims.value(quantity).filter(|_| self.units_written).map(Unit::si);
            }
        }
        graph.exprs = std::mem::take(&mut self.exprs);
        graph
    }

    /// The SI unit of a quantity, if it is known. Speeds and angles of rotation are shown with their radians: `rad/s` and
    /// `rad` where efforts are torques. `units` remembers what was made before.
    fn shown_unit(
        &self,
        meaning: Meaning,
        quantity: &Quantity,
        units: &mut BTreeMap<(Dimension, bool), Unit>,
    ) -> Option<Unit> {
        let dim = self.dims.value(quantity).filter(|_| self.units_written)?;
        let turning = self.is_turning(meaning);
        let stored = matches!(meaning, Meaning::Stored(_));
        let name = match (turning, dim) {
            (true, Dimension::NONE) => Some("rad"),
            (true, _) => Some("rad/s"),
            // What is stored is never a torque: heat in a pseudo bond graph.
            (false, Dimension::JOULE) if stored => Some("J"),
            _ => None,
        };
        let make = || name.and_then(|name| Unit::parse(name).ok()).unwrap_or_else(|| Unit::si(dim));
        let turning = turning || (stored && dim == Dimension::JOULE);
        Some(units.entry((dim, turning)).or_insert_with(make).clone())
    }

    /// Whether it is the flow of a bond, or the displacement of a C, whose effort is a torque.
    fn is_turning(&self, meaning: Meaning) -> bool {
        let wire = match meaning {
            Meaning::Flow(bond) => Some(bond.index()),
            Meaning::Stored(port) if self.part(port.element.index()).word == Word::C => {
                self.wire_at(port.element.index(), port.port as usize)
            }
            _ => None,
        };
        let pair = wire.and_then(|w| self.pairs.get(w).filter(|_| !self.pseudo[w]));
        pair.is_some_and(|pair| self.dims.value(&pair.effort_in) == Some(Dimension::JOULE))
    }

    /// The SI unit of what a declaration gave a unit: it keeps its radians.
    fn written_unit(&self, meaning: Meaning, graph: &BondGraph) -> Option<Unit> {
        let unit = match meaning {
            Meaning::Parameter(id) => graph.parameters[id].unit.as_ref(),
            Meaning::Input(id) => graph.inputs[id].unit.as_ref(),
            Meaning::Signal(id) => graph.signals[id].unit.as_ref(),
            Meaning::Time => return Some(Unit::si(Dimension::SECOND)),
            _ => None,
        };
        unit.map(Unit::to_si_unit)
    }
}

impl BondGraph {
    /// Puts expressions in the place of symbols, everywhere.
    fn replace_symbols(&mut self, map: &BTreeMap<Symbol, Expr>) {
        if map.is_empty() {
            return;
        }
        let mut roots = Vec::new();
        self.for_each_expr(&mut |e| roots.push(*e));
        let new = self.exprs.substitute_all(&roots, map);
        let mut new = new.into_iter();
        self.for_each_expr(&mut |e| *e = new.next().unwrap_or(*e));
    }

    /// Visits every expression, always in the same order.
    pub(super) fn for_each_expr(&mut self, visit: &mut dyn FnMut(&mut Expr)) {
        for (_, element) in self.elements.iter_mut() {
            element.kind.for_each_expr(visit);
        }
        for (_, signal) in self.signals.iter_mut() {
            visit(&mut signal.rate);
            signal.initial.iter_mut().for_each(&mut *visit);
        }
        self.held.iter_mut().for_each(|(_, h)| visit(&mut h.source));
        self.lets.iter_mut().chain(&mut self.outputs).for_each(|n| visit(&mut n.value));
        self.constraints.iter_mut().for_each(|c| visit(&mut c.expr));
        for guess in &mut self.guesses {
            visit(&mut guess.what);
            visit(&mut guess.value);
        }
    }
}

impl Kind {
    /// Visits every expression of the element.
    pub(super) fn for_each_expr(&mut self, visit: &mut dyn FnMut(&mut Expr)) {
        match self {
            Kind::Zero | Kind::One | Kind::EffortDetector | Kind::FlowDetector => {}
            Kind::EffortSource { value: e } | Kind::FlowSource { value: e } | Kind::ZeroCompliance { flow: e } => {
                visit(e)
            }
            Kind::Transformer { modulus: e } | Kind::Gyrator { modulus: e } => visit(e),
            Kind::ResidualEffort { residual } | Kind::ResidualFlow { residual } => residual.iter_mut().for_each(visit),
            Kind::Inertance(s) | Kind::Compliance(s) => s.for_each_expr(visit),
            Kind::Resistor(laws) => laws.iter_mut().for_each(|law| match law {
                super::ResistorLaw::Resistive(e)
                | super::ResistorLaw::Conductive(e)
                | super::ResistorLaw::Implicit(e) => {
                    visit(e);
                }
            }),
        }
    }
}

impl super::Storage {
    fn for_each_expr(&mut self, visit: &mut dyn FnMut(&mut Expr)) {
        for law in &mut self.laws {
            match law {
                super::StorageLaw::Integral(e) | super::StorageLaw::Derivative(e) | super::StorageLaw::Implicit(e) => {
                    visit(e)
                }
                super::StorageLaw::Known { displacement, law } => {
                    visit(displacement);
                    visit(law);
                }
            }
        }
        self.energy.iter_mut().for_each(visit);
    }
}
