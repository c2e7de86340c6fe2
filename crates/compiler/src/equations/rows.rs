//! Rows of the junction structure: each variable by the ones it is defined by, and over the variables that elements give
//! where that is asked for.
//!
//! Definitions stay triangular, as elimination leaves them, so that what is evaluated grows with the graph. Written out
//! are only those in which terms cancel once the variables that they read are put in: added up while running such terms
//! leave rounding; and those that have no more terms then.

use std::collections::{BTreeMap, BTreeSet};

use crate::algebra::{Exprs, ONE, Residue, Symbol};
use crate::causal_graph::{CausalGraph, Combination, PortState, Ports, Role};
use crate::ids::Map;

/// Terms that may be formed in the search for terms that cancel.
const WORK: usize = 1_000_000;
/// A coefficient that is written longer than this is no short one.
const SHORT: u64 = 40;

/// The rows of a graph, worked out when they are asked for.
pub struct Rows<'a> {
    ports: Option<&'a Ports>,
    /// Who gives each input of the junction structure.
    givers: Map<Symbol, &'a PortState>,
    /// Sources whose value is zero: a constraint at rest imposes nothing on a dependent storage.
    zero: BTreeSet<Symbol>,
    /// Rows over inputs.
    known: Map<Symbol, Combination>,
}

impl<'a> Rows<'a> {
    /// Rows of a graph, without what is imposed as zero.
    pub fn new(causal: &'a CausalGraph, zero: BTreeSet<Symbol>) -> Rows<'a> {
        let ports = &causal.ports;
        let givers = ports.ports.iter().map(|p| (p.input, p)).collect();
        // Where two elements share a bond, what one gives is what the other takes.
        let shared = ports.ports.iter().map(|p| p.output).filter(|s| !ports.definitions.contains_key(s));
        let mut known: Map<Symbol, Combination> = shared.map(|s| (s, Combination(vec![(s, ONE)]))).collect();
        known.extend(zero.iter().map(|&s| (s, Combination::default())));
        Rows { ports: Some(ports), givers, zero, known }
    }

    /// No rows: where variables are defined along strokes they may run in circles.
    pub fn none() -> Rows<'a> {
        Rows { ports: None, givers: Map::new(), zero: BTreeSet::new(), known: Map::new() }
    }

    /// The port that gives a variable.
    pub fn giver(&self, input: Symbol) -> Option<&'a PortState> {
        self.givers.get(&input).copied()
    }

    /// A variable of the junction structure over what elements give; `None` if the structure says nothing of it.
    pub fn of(&mut self, x: &mut Exprs, symbol: Symbol) -> Option<&Combination> {
        if !self.known.contains_key(&symbol) {
            self.ports?.resolve_into(x, symbol, &mut self.known);
        }
        self.known.get(&symbol)
    }

    /// What defines each variable: triangular, and over what elements give where terms cancel. Variables that are nothing
    /// but others give way to these.
    pub fn definitions(&mut self, x: &mut Exprs) -> Vec<(Symbol, Combination)> {
        let Some(ports) = self.ports else { return Vec::new() };
        let WrittenOut { needed, as_short } = written_out(x, ports);
        let mut all: Map<Symbol, Combination> = Map::new();
        for (&symbol, row) in &ports.definitions {
            let own = Combination(row.0.iter().filter(|t| !self.zero.contains(&t.0)).copied().collect());
            let row = match (needed.contains(&symbol), as_short.contains(&symbol)) {
                (true, _) => self.of(x, symbol).expect("it is defined").clone(),
                (_, true) => self.of(x, symbol).filter(|row| is_short(x, row)).cloned().unwrap_or(own),
                _ => own,
            };
            all.insert(symbol, row);
        }
        let independent = ports.ports.iter().filter(|p| p.role == Role::Independent);
        for_junctions(&mut all, &independent.map(|p| p.output).collect());
        let last = |mut symbol: Symbol| {
            while let Some(&[(other, ONE)]) = all.get(&symbol).map(|row| &row.0[..]) {
                symbol = other;
            }
            symbol
        };
        let renamed = all.iter().map(|(&symbol, row)| (symbol, row.renamed(x, &last)));
        renamed.collect()
    }
}

/// Where a variable of a junction is nothing but what a storage takes, the junction's is defined and the storage takes it:
/// rates of states are then read by nobody.
fn for_junctions(all: &mut Map<Symbol, Combination>, outputs: &BTreeSet<Symbol>) {
    let name_of = |(&symbol, row): (&Symbol, &Combination)| match row.0[..] {
        [(output, ONE)] if outputs.contains(&output) && !outputs.contains(&symbol) => Some((output, symbol)),
        _ => None,
    };
    let names: BTreeMap<Symbol, Symbol> = all.iter().rev().filter_map(name_of).collect();
    for (output, symbol) in names {
        if let Some(row) = all.remove(&output) {
            all.insert(symbol, row);
            all.insert(output, Combination(vec![(symbol, ONE)]));
        }
    }
}

/// A row with its coefficients in a prime field; `None` where one has no value there.
type Row = Vec<(Symbol, Option<Residue>)>;

/// Definitions that are written out over what elements give.
#[derive(Default)]
struct WrittenOut {
    /// Terms cancel in them once all that they read is put in, or they read what nothing determines: their share in it may
    /// vanish.
    needed: BTreeSet<Symbol>,
    /// They have no more terms then. None where coefficients vanish at the given parameters only: which of them do is told
    /// by elimination alone.
    as_short: BTreeSet<Symbol>,
}

/// Whether all coefficients are written shortly.
fn is_short(x: &mut Exprs, row: &Combination) -> bool {
    row.0.iter().all(|t| x.written_length(t.1) <= SHORT)
}

/// What of the definitions is written out, as far as a bound of work goes.
fn written_out(x: &Exprs, ports: &Ports) -> WrittenOut {
    let mut found = WrittenOut::default();
    let mut known: Map<Symbol, Row> = Map::new();
    let mut work = 0;
    for &first in ports.definitions.keys() {
        let mut open = vec![first];
        while let Some((top, definition)) = ports.next_to_resolve(&mut open, |s| known.contains_key(s)) {
            let mut row = put_in(x, definition, &known);
            let undetermined = row.iter().any(|t| ports.undetermined.contains(&t.0));
            if undetermined || row.iter().any(|t| t.1.is_some_and(Residue::vanishes)) {
                found.needed.insert(top);
            }
            row.retain(|t| !t.1.is_some_and(Residue::vanishes));
            if row.len() <= definition.0.len() && ports.degenerate.is_empty() {
                found.as_short.insert(top);
            }
            work += row.len();
            if work > WORK && ports.undetermined.is_empty() {
                return found;
            }
            known.insert(top, row);
        }
    }
    found
}

fn put_in(x: &Exprs, definition: &Combination, known: &Map<Symbol, Row>) -> Row {
    let mut terms: Row = Vec::new();
    for &(symbol, coefficient) in &definition.0 {
        let factor = x.residue(coefficient);
        match known.get(&symbol) {
            Some(row) => terms.extend(row.iter().map(|&(s, c)| (s, factor.zip(c).map(|(a, b)| a * b)))),
            None => terms.push((symbol, factor)),
        }
    }
    terms.sort_by_key(|t| t.0);
    terms.dedup_by(|next, sum| {
        let same = next.0 == sum.0;
        if same {
            sum.1 = sum.1.zip(next.1).map(|(a, b)| a + b);
        }
        same
    });
    terms
}
