//! The stage: from syntax trees to a bond graph.

use std::collections::{BTreeMap, BTreeSet};

use super::assemble::{Asked, Laws, Title};
use super::builder::Builder;
use super::constraint::Relation;
use super::counted::{Counted, Counting};
use super::files::Files;
use super::flatten::{self, Flat};
use super::load::{Loaded, load};
use super::names::{self, Name};
use super::overrides::{self, Override};
use super::recognise::{Recognised, Unstarted};
use super::shapes::ShapeDraft;
use super::uses::Uses;
use super::wire::{Wiring, wire};
use super::{BondGraph, Clause, Kind, verify};
use crate::algebra::{Expr, Symbol};
use crate::ast::Ast;
use crate::diagnostic::{Diagnostic, Diagnostics, Sources};

/// What has become of a model.
#[derive(Debug)]
pub struct Elaborated {
    /// The graph, if there is no error.
    pub graph: Option<BondGraph>,
    /// The names that the text declares, and where it uses them; as far as they are known, also if there are errors.
    pub names: Vec<Name>,
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
pub fn elaborate(main: Ast, sources: Sources, files: &dyn Files, overrides: &[Override]) -> Elaborated {
    elaborate_counting(main, sources, files, overrides, None)
}

/// The same where a parameter of the model counts so many turns of repetitions, and places in arrays, whatever its value: the
/// structure of a model of another size, with the values of this one. There is no graph where anything in it may be otherwise
/// at another size, further than so many cells from the ends of the repetitions.
pub(crate) fn elaborate_counting(
    main: Ast,
    mut sources: Sources,
    files: &dyn Files,
    overrides: &[Override],
    counting: Option<Counting<'_>>,
) -> Elaborated {
    let Loaded { files: trees, imports, mut faults } = load(main, &mut sources, files);
    let given = overrides::parse(overrides, &mut sources, &mut faults);
    let title = trees.first().and_then(|t| t.header.as_ref()).map_or(Title::default(), Title::of);
    let mut flat = flatten::flatten(&trees, &given, files, counting);
    faults.extend(std::mem::take(&mut flat.faults).into_list());
    overrides::refuse_idle(&given, &flat, &mut faults);
    let Built { graph, faults: more, uses } = match flat.lost {
        true => Built::default(),
        false => wired(&mut flat, &sources, files, &mut faults, &title),
    };
    faults.extend(more);
    faults.extend(graph.iter().flat_map(super::guesses::idle));
    in_order(&mut faults);
    let differs = flat.repeats.counted.as_ref().is_some_and(Counted::differs);
    let graph = graph.filter(|_| !differs && !faults.iter().any(Diagnostic::is_error));
    if let Some(graph) = &graph {
        debug_assert_eq!(verify(graph), Ok(()), "{}", graph.name);
    }
    let names = names::table(&trees[0], &flat, uses, &imports, &sources);
    Elaborated { graph, names, diagnostics: Diagnostics(faults), sources }
}

/// Connects the bonds of a flat model and builds its graph, as far as its faults allow.
fn wired(
    flat: &mut Flat<'_>,
    sources: &Sources,
    files: &dyn Files,
    faults: &mut Vec<Diagnostic>,
    title: &Title,
) -> Built {
    let mut wiring = wire(flat);
    flat.drawn = Vec::new();
    faults.extend(std::mem::take(&mut wiring.faults).into_list());
    let faulty = faults.iter().any(Diagnostic::is_error);
    build(flat, &wiring, sources, files, faulty, title, &BTreeSet::new())
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
) -> Built {
    let mut b = Builder::new(flat, wiring, sources, files);
    b.make_symbols(parted);
    b.later = Some(Vec::new());
    b.make_values();
    let later = b.later.take();
    let mut kinds: Vec<Option<Kind>> = (0..flat.parts.len()).map(|part| b.kind(part)).collect();
    b.later = later;
    let guesses = b.guesses();
    let clauses = b.clauses();
    let shapes = b.shapes();
    b.settle_units();
    b.finish_blocks();
    let asked = Asked {
        guesses,
        preferences: b.preferences(),
        forced_causality: b.forced_causality(),
        forced_strokes: b.forced_strokes(),
    };
    let mut sides = b.constraint_sides();
    b.leave_out_idle(&mut kinds, &mut sides);
    let rates = b.rates_of_signals();
    let relations = b.relations(&sides, &rates);
    let found = b.parted(&relations);
    if b.faults.is_empty() && found != *parted {
        return build(flat, wiring, sources, files, faulty, title, &found);
    }
    b.forgive_unwritten_units();
    if faulty || b.incomplete || !b.faults.is_empty() {
        b.repeats.add_uses(&flat.names, &mut b.uses);
        return Built { graph: None, faults: b.faults.into_list(), uses: b.uses };
    }
    b.repeats.add_uses(&flat.names, &mut b.uses);
    let (faults, uses) = (std::mem::take(&mut b.faults), std::mem::take(&mut b.uses));
    let mut faults = faults.into_list();
    faults.append(&mut b.warnings);
    let finished = finished(b, title, kinds, (asked, clauses, shapes), &relations, &rates);
    let graph = finished.map(|(graph, unstarted)| {
        faults.extend(unstarted.iter().filter_map(|signal| signal.warning(&graph)));
        graph
    });
    Built { graph, faults, uses }
}

/// The graph of what has been read without a fault, and signals that begin like storages; `None` if something is missing
/// nevertheless.
fn finished(
    mut b: Builder<'_, '_>,
    title: &Title,
    kinds: Vec<Option<Kind>>,
    (asked, clauses, shapes): (Asked, Vec<Clause>, Vec<ShapeDraft>),
    relations: &[Relation],
    rates: &BTreeMap<Symbol, Expr>,
) -> Option<(BondGraph, Vec<Unstarted>)> {
    let mut structure = b.drawn(kinds.into_iter().collect::<Option<_>>()?);
    let constraints = b.build_constraints(&mut structure, relations);
    let Recognised { signals, repeated, unstarted } = b.recognise_storages(&structure, rates)?;
    let held = b.whole_held()?;
    let set_valued = std::mem::take(&mut b.set_valued);
    let (lets, outputs) = (std::mem::take(&mut b.lets), std::mem::take(&mut b.outputs));
    let (lets, outputs) = (b.whole_named(lets), b.whole_named(outputs));
    let shapes = shapes.into_iter().map(|shape| b.whole_shape(shape)).collect();
    let laws = Laws { structure, signals, held, lets, outputs, constraints, set_valued, clauses, shapes };
    Some((b.assemble(title, asked, laws, [rates, &repeated])?, unstarted))
}

/// What building has given.
#[derive(Default)]
struct Built {
    graph: Option<BondGraph>,
    faults: Vec<Diagnostic>,
    uses: Uses,
}
