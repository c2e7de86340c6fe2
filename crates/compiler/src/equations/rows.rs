//! Rows of the junction structure: each variable by the ones it is defined by, and over the variables that elements give
//! where that is asked for.
//!
//! Definitions stay triangular, as elimination leaves them, so that what is evaluated grows with the graph. Written out
//! are only those in which terms cancel once the variables that they read are put in: added up while running such terms
//! leave rounding; and those that have no more terms then. Of the variables through which such terms come those are put in
//! that hold them, if the row has fewer terms so than over what elements give: what a spring between two bodies gives
//! cancels in what carries both, whatever else hangs on them.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::unionfind::UnionFind;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::algebra::{Expr, Exprs, ONE, Residue, Symbol};
use crate::bond_graph::{BondGraph, Kind, Meaning, ResistorLaw, StorageLaw};
use crate::causal_graph::{CausalGraph, Combination, PortState, Ports, Role, stays};
use crate::ids::Map;

/// Terms that may be formed in the search for terms that cancel.
const WORK: usize = 1_000_000;
/// Rows with more terms, or in which terms cancel through more variables than this, stay as they are where what cancels in
/// them is known: written out, each term takes as much as the chain is long, and what is saved is rounding.
const LONG_ROW: usize = 12;
const LONG_WAY: usize = 40;
/// A coefficient that is written longer than this is no short one.
const SHORT: u64 = 40;

/// The rows of a graph, worked out when they are asked for.
pub struct Rows<'a> {
    graph: Option<&'a BondGraph>,
    ports: Option<&'a Ports>,
    /// Who gives each input of the junction structure.
    givers: Map<Symbol, &'a PortState>,
    /// Sources whose value is zero: a constraint at rest imposes nothing on a dependent storage.
    zero: BTreeSet<Symbol>,
    /// Rows over inputs.
    known: Map<Symbol, Combination>,
    /// The same with coefficients in a prime field.
    residues: Map<Symbol, Row>,
    /// Rows that are written with short coefficients, over inputs and variables that are not; none for those.
    short: Map<Symbol, Option<Combination>>,
    /// Variables that are written out over inputs, since terms cancel in them.
    cancelling: BTreeSet<Symbol>,
}

impl<'a> Rows<'a> {
    /// Rows of a graph, without what is imposed as zero.
    pub fn new(causal: &'a CausalGraph, zero: BTreeSet<Symbol>) -> Rows<'a> {
        let ports = &causal.ports;
        let givers = ports.ports.iter().map(|p| (p.input, p)).collect();
        // Where two elements share a bond, what one gives is what the other takes.
        let shared = ports.ports.iter().map(|p| p.output).filter(|s| !ports.definitions.contains_key(s));
        let mut known: Map<Symbol, Combination> = shared.map(|s| (s, Combination::of(s, ONE))).collect();
        known.extend(zero.iter().map(|&s| (s, Combination::default())));
        let one = causal.graph.exprs.residue(ONE);
        let residues = known.iter().map(|(&s, row)| (s, row.0.iter().map(|t| (t.0, one)).collect())).collect();
        let short = known.iter().map(|(&s, row)| (s, Some(row.clone()))).collect();
        let graph = Some(&causal.graph);
        Rows { graph, ports: Some(ports), givers, zero, known, residues, short, cancelling: BTreeSet::new() }
    }

    /// No rows: where variables are defined along strokes they may run in circles.
    pub fn none() -> Rows<'a> {
        Rows {
            graph: None,
            ports: None,
            givers: Map::new(),
            zero: BTreeSet::new(),
            known: Map::new(),
            residues: Map::new(),
            short: Map::new(),
            cancelling: BTreeSet::new(),
        }
    }

    /// Whether nothing is imposed by the source that gives a variable.
    pub fn is_zero(&self, input: Symbol) -> bool {
        self.zero.contains(&input)
    }

    /// Whether terms cancel in a variable, which [`definitions`](Rows::definitions) has written out for that.
    pub fn cancels(&self, symbol: Symbol) -> bool {
        self.cancelling.contains(&symbol)
    }

    /// The ports that impose a variable.
    pub fn sources(&self) -> impl Iterator<Item = &'a PortState> + use<'a> {
        let all = self.ports.map_or(&[][..], |ports| &ports.ports);
        all.iter().filter(|p| matches!(p.role, Role::Source | Role::Redundant))
    }

    /// A variable of the junction structure over what elements give; `None` if the structure says nothing of it.
    pub fn of(&mut self, x: &mut Exprs, symbol: Symbol) -> Option<&Combination> {
        if !self.known.contains_key(&symbol) {
            self.ports?.resolve_into(x, symbol, &mut self.known);
        }
        self.known.get(&symbol)
    }

    /// The same as [`of`](Rows::of) for one variable alone, without the rows of those that it reads: factors are taken
    /// from it to what elements give, so that a chain takes as many products as it is long.
    pub fn alone(&self, x: &mut Exprs, symbol: Symbol) -> Option<Combination> {
        let ports = self.ports?;
        if !ports.definitions.contains_key(&symbol) {
            return self.known.get(&symbol).cloned();
        }
        let (mut order, mut open, mut done) = (Vec::new(), vec![symbol], BTreeSet::new());
        while let Some((next, _)) = ports.next_to_resolve(&mut open, |s| done.contains(s)) {
            done.insert(next);
            order.push(next);
        }
        let mut factors: BTreeMap<Symbol, Vec<Expr>> = BTreeMap::from([(symbol, vec![ONE])]);
        for next in order.into_iter().rev() {
            let Some(terms) = factors.remove(&next) else { continue };
            let factor = x.add(&terms);
            let factor = x.bounded(factor);
            for &(s, c) in ports.definitions[&next].0.iter().filter(|t| !self.zero.contains(&t.0)) {
                factors.entry(s).or_default().push(x.mul(&[factor, c]));
            }
        }
        let sum = |(s, terms): (Symbol, Vec<Expr>)| {
            let factor = x.add(&terms);
            let factor = x.bounded(factor);
            stays(x, (s, factor), &ports.undetermined).then_some((s, factor))
        };
        Some(Combination(factors.into_iter().filter_map(sum).collect()))
    }

    /// The row of a variable, where it is not known from others that of it [`alone`](Rows::alone).
    pub fn own(&self, x: &mut Exprs, symbol: Symbol) -> Option<Combination> {
        match self.known.get(&symbol) {
            Some(known) => Some(known.clone()),
            None => self.alone(x, symbol),
        }
    }

    /// A variable over what elements give, and over variables whose own rows have long coefficients.
    fn shortly(&mut self, x: &mut Exprs, symbol: Symbol) -> Option<Combination> {
        let ports = self.ports?;
        let mut open = vec![symbol];
        while let Some((next, definition)) = ports.next_to_resolve(&mut open, |s| self.short.contains_key(s)) {
            let row = definition.substitute(x, |s| self.short.get(&s)?.as_ref(), &ports.undetermined);
            self.short.insert(next, Some(row).filter(|row| is_short(x, row)));
        }
        self.short.get(&symbol)?.clone()
    }

    /// A variable with the rows of others put in, each of which comes after those that it reads; `along`: what is put into
    /// rows already.
    fn put_through(
        &self,
        x: &mut Exprs,
        symbol: Symbol,
        through: &[Symbol],
        along: &Map<Symbol, Combination>,
    ) -> Option<Combination> {
        let ports = self.ports?;
        let mut put: Map<Symbol, Combination> = self.zero.iter().map(|&s| (s, Combination::default())).collect();
        for &next in through.iter().chain([&symbol]) {
            let own = along.get(&next).or_else(|| ports.definitions.get(&next))?;
            let row = own.substitute(x, |s| put.get(&s), &ports.undetermined);
            put.insert(next, row);
        }
        put.remove(&symbol)
    }

    /// What elements give of which a variable of the junction structure is made; nothing of other variables.
    pub fn inputs_of(&mut self, x: &mut Exprs, symbol: Symbol) -> Vec<Symbol> {
        self.inputs_within(x, symbol, &mut { usize::MAX }).expect("there is no bound to it")
    }

    /// The same, as long as rows on the way have no more terms than a bound, which what is found is taken off.
    pub fn inputs_within(&mut self, x: &mut Exprs, symbol: Symbol, terms: &mut usize) -> Option<Vec<Symbol>> {
        let Some(ports) = self.ports else { return Some(Vec::new()) };
        let mut open = vec![symbol];
        while let Some((next, definition)) = ports.next_to_resolve(&mut open, |s| self.residues.contains_key(s)) {
            let mut row = put_in(x, definition, &self.residues);
            row.retain(|t| !t.1.is_some_and(Residue::vanishes));
            *terms = terms.checked_sub(row.len())?;
            self.residues.insert(next, row);
        }
        let row = self.residues.get(&symbol).map_or(&[][..], |row| row);
        let open = |t: &(Symbol, Option<Residue>)| t.1.is_none() || ports.undetermined.contains(&t.0);
        if row.iter().any(open) {
            return Some(self.of(x, symbol).map_or(Vec::new(), |row| row.0.iter().map(|t| t.0).collect()));
        }
        Some(row.iter().map(|t| t.0).collect())
    }

    /// Whether a variable is made of any of some inputs. No row is written out over the others.
    pub fn is_made_of(&mut self, x: &mut Exprs, symbol: Symbol, among: &mut Among) -> bool {
        let Some(ports) = self.ports.filter(|_| !among.inputs.is_empty()) else { return false };
        let mut open = vec![symbol];
        while let Some((next, definition)) = ports.next_to_resolve(&mut open, |s| among.rows.contains_key(s)) {
            let mut row = put_in(x, definition, &among.rows);
            row.retain(|t| !t.1.is_some_and(Residue::vanishes) && self.tells(ports, t.0, among));
            among.rows.insert(next, row);
        }
        let own = [(symbol, None)];
        let row = among.rows.get(&symbol).map_or(&own[..], |row| row);
        if row.iter().any(|t| ports.undetermined.contains(&t.0) || t.1.is_none() && t.0 != symbol) {
            return self.inputs_of(x, symbol).iter().any(|input| among.inputs.contains(input));
        }
        row.iter().any(|t| among.inputs.contains(&t.0) && !self.zero.contains(&t.0))
    }

    fn tells(&self, ports: &Ports, symbol: Symbol, among: &Among) -> bool {
        !self.zero.contains(&symbol) && (among.inputs.contains(&symbol) || ports.undetermined.contains(&symbol))
    }

    /// Unites each of some variables with the inputs that it is made of, where these have a place in `sets`; `None` where only
    /// written rows tell them, with some united already.
    ///
    /// What counts is which sets of inputs a variable is made of, so that a row has one term for each set: its coefficients
    /// times random numbers, whose sum vanishes only if all of them do. A chain of bodies has short rows then.
    pub fn unite(
        &self,
        x: &Exprs,
        variables: &[(usize, Symbol)],
        places: &FxHashMap<Symbol, usize>,
        sets: &mut UnionFind<usize>,
    ) -> Option<()> {
        let Some(ports) = self.ports else { return Some(()) };
        let mut known: Map<Symbol, Vec<(usize, Residue)>> = Map::new();
        // What others read comes first, so that its inputs are one set by then.
        for (place, symbol) in by_depth(ports, variables) {
            let mut open = vec![symbol];
            while let Some((next, definition)) = ports.next_to_resolve(&mut open, |s| known.contains_key(s)) {
                let mut row = Vec::new();
                for &(s, c) in definition.0.iter().filter(|t| !self.zero.contains(&t.0)) {
                    let factor = x.residue(c).filter(|_| !ports.undetermined.contains(&s))?;
                    match (known.get(&s), places.get(&s)) {
                        (Some(read), _) => row.extend(read.iter().map(|&(set, c)| (sets.find(set), factor * c))),
                        (None, Some(&input)) => row.push((sets.find(input), factor * Residue::random(input as u64))),
                        (None, None) => {}
                    }
                }
                row.sort_unstable_by_key(|t| t.0);
                row.dedup_by(|next, sum| {
                    let same = next.0 == sum.0;
                    if same {
                        sum.1 = sum.1 + next.1;
                    }
                    same
                });
                row.retain(|t| !t.1.vanishes());
                known.insert(next, row);
            }
            match (known.get(&symbol), places.get(&symbol)) {
                (Some(row), _) => row.iter().for_each(|&(set, _)| _ = sets.union(place, set)),
                (None, Some(&input)) if !self.zero.contains(&symbol) => _ = sets.union(place, input),
                _ => {}
            }
        }
        Some(())
    }

    /// Which of these sums of variables may be put together so that no input is left, whatever their factors.
    ///
    /// One with a variable that no other row has takes no part: such rows, those that define variables among them, are
    /// taken away again and again. `counts` says which inputs have to vanish; no row is written out.
    pub fn entangled<S: AsRef<[Symbol]>>(&self, sums: &[S], counts: impl Fn(&PortState) -> bool) -> Vec<bool> {
        let Some(ports) = self.ports else { return vec![true; sums.len()] };
        let has_to_vanish = |s: &Symbol| {
            ports.definitions.contains_key(s)
                || !self.zero.contains(s) && self.givers.get(s).is_some_and(|giver| counts(giver))
        };
        let mut rows: Vec<Vec<Symbol>> = sums.iter().map(|sum| sum.as_ref().to_vec()).collect();
        let mut reached: Map<Symbol, ()> = Map::new();
        let mut open: Vec<Symbol> = rows.iter().flatten().copied().collect();
        while let Some(symbol) = open.pop() {
            let Some(definition) = ports.definitions.get(&symbol) else { continue };
            if reached.insert(symbol, ()).is_some() {
                continue;
            }
            let reads = definition.0.iter().map(|t| t.0);
            open.extend(reads.clone());
            rows.push(std::iter::once(symbol).chain(reads).collect());
        }
        for row in &mut rows {
            row.retain(has_to_vanish);
            row.sort_unstable();
            row.dedup();
        }
        let columns = rows.iter().filter_map(|row| row.last()).map(|s| s.0 as usize + 1).max().unwrap_or(0);
        let mut left = without_own_columns(&rows, columns, |s| s.0 as usize);
        left.truncate(sums.len());
        left
    }

    /// What defines each variable: triangular, and over what elements give where terms cancel. Variables that are nothing
    /// but others give way to these.
    pub fn definitions(&mut self, x: &mut Exprs) -> Vec<(Symbol, Combination)> {
        let (Some(graph), Some(ports)) = (self.graph, self.ports) else { return Vec::new() };
        let giver = |input: &Symbol| self.givers.get(input).copied();
        let WrittenOut { needed, as_short } = written_out(x, graph, ports, &giver);
        let mut along: Map<Symbol, Combination> = Map::new();
        for (symbol, through) in needed.iter().filter_map(|(s, through)| Some((*s, through.as_ref()?))) {
            let row = self.put_through(x, symbol, through, &along).expect("it is defined");
            along.insert(symbol, row);
        }
        let needed: BTreeSet<Symbol> = needed.into_iter().map(|n| n.0).collect();
        let mut all: Map<Symbol, Combination> = Map::with_capacity(x.symbol_count());
        for (&symbol, row) in &ports.definitions {
            let own = Combination(row.0.iter().filter(|t| !self.zero.contains(&t.0)).copied().collect());
            let row = match (needed.contains(&symbol), as_short.contains_key(&symbol)) {
                (true, _) => match along.remove(&symbol) {
                    Some(row) => row,
                    None => self.of(x, symbol).expect("it is defined").clone(),
                },
                (_, true) => self.shortly(x, symbol).filter(|row| row.0.len() <= own.0.len()).unwrap_or(own),
                _ => own,
            };
            all.insert(symbol, row);
        }
        let independent = ports.ports.iter().filter(|p| p.role == Role::Independent);
        self.cancelling = needed;
        self.short = Map::new();
        for_junctions(&mut all, &independent.map(|p| (p.output, ())).collect());
        let last = |mut symbol: Symbol| {
            while let Some(&[(other, ONE)]) = all.get(&symbol).map(|row| &row.0[..]) {
                symbol = other;
            }
            symbol
        };
        let mut renamed = Vec::with_capacity(all.len());
        renamed.extend(all.iter().map(|(&symbol, row)| (symbol, row.renamed(x, &last))));
        renamed
    }
}

/// Where a variable of a junction is nothing but what a storage takes, the junction's is defined and the storage takes it:
/// rates of states are then read by nobody.
fn for_junctions(all: &mut Map<Symbol, Combination>, outputs: &Map<Symbol, ()>) {
    let name_of = |(&symbol, row): (&Symbol, &Combination)| match row.0[..] {
        [(output, ONE)] if outputs.contains_key(&output) && !outputs.contains_key(&symbol) => Some((output, symbol)),
        _ => None,
    };
    let names: Map<Symbol, Symbol> = all.iter().rev().filter_map(name_of).collect();
    for (&output, &symbol) in &names {
        if let Some(row) = all.remove(&output) {
            all.insert(symbol, row);
            all.insert(output, Combination::of(symbol, ONE));
        }
    }
}

/// Rows that are left when rows with a variable of their own are taken away again and again.
pub fn without_own<C: Ord>(rows: &[Vec<C>]) -> Vec<bool> {
    let mut columns: Vec<&C> = rows.iter().flatten().collect();
    columns.sort_unstable();
    columns.dedup();
    without_own_columns(rows, columns.len(), |c| columns.partition_point(|known| *known < c))
}

/// The same where columns have numbers below `columns`.
fn without_own_columns<C>(rows: &[Vec<C>], columns: usize, number: impl Fn(&C) -> usize) -> Vec<bool> {
    let mut count = vec![0u32; columns];
    rows.iter().flatten().for_each(|c| count[number(c)] += 1);
    // The rows that hold each column, one column after the other: where those of a column end.
    let mut ends: Vec<u32> = count.iter().scan(0, |sum, n| Some(std::mem::replace(sum, *sum + n))).collect();
    let mut holders = vec![0u32; rows.iter().map(Vec::len).sum()];
    for (row, r) in rows.iter().zip(0u32..) {
        for column in row.iter().map(&number) {
            holders[ends[column] as usize] = r;
            ends[column] += 1;
        }
    }
    let holders = |column: usize| {
        let start = if column == 0 { 0 } else { ends[column - 1] };
        &holders[start as usize..ends[column] as usize]
    };
    let mut left = vec![true; rows.len()];
    let mut own: Vec<usize> = (0..columns).filter(|&column| count[column] == 1).collect();
    while let Some(column) = own.pop() {
        let Some(&row) = holders(column).iter().find(|r| left[**r as usize]) else { continue };
        left[row as usize] = false;
        for other in rows[row as usize].iter().map(&number) {
            count[other] -= 1;
            if count[other] == 1 {
                own.push(other);
            }
        }
    }
    left
}

/// Inputs that are looked for in variables, with what is known of these.
pub struct Among {
    inputs: FxHashSet<Symbol>,
    /// Rows over these inputs alone.
    rows: Map<Symbol, Row>,
}

impl Among {
    /// These are looked for.
    pub fn new(inputs: FxHashSet<Symbol>) -> Among {
        Among { inputs, rows: Map::new() }
    }
}

/// Variables, those first that are the fewest definitions away from what elements give.
fn by_depth(ports: &Ports, variables: &[(usize, Symbol)]) -> Vec<(usize, Symbol)> {
    let mut depths: Map<Symbol, u32> = Map::new();
    for &(_, symbol) in variables {
        let mut open = vec![symbol];
        while let Some((next, definition)) = ports.next_to_resolve(&mut open, |s| depths.contains_key(s)) {
            let below = definition.0.iter().filter_map(|t| depths.get(&t.0)).max();
            let depth = 1 + below.copied().unwrap_or(0);
            depths.insert(next, depth);
        }
    }
    let mut ordered = variables.to_vec();
    ordered.sort_by_key(|v| depths.get(&v.1).copied().unwrap_or(0));
    ordered
}

/// A row with its coefficients in a prime field; `None` where one has no value there.
type Row = Vec<(Symbol, Option<Residue>)>;

/// Definitions that are written out.
#[derive(Default)]
struct WrittenOut {
    /// Terms cancel in them once all that they read is put in, or they read what nothing determines: their share in it may
    /// vanish. With each what has to be put in for that, in order; none where all is. In the order of what they read.
    needed: Vec<(Symbol, Option<Vec<Symbol>>)>,
    /// They have no more terms then. None where coefficients vanish at the given parameters only: which of them do is told
    /// by elimination alone.
    as_short: Map<Symbol, ()>,
}

/// Whether all coefficients are written shortly.
fn is_short(x: &mut Exprs, row: &Combination) -> bool {
    row.0.iter().all(|t| !x.is_longer(t.1, SHORT))
}

/// What of the definitions is written out, as far as a bound of work goes.
fn written_out<'a>(
    x: &Exprs,
    graph: &BondGraph,
    ports: &'a Ports,
    giver: &dyn Fn(&Symbol) -> Option<&'a PortState>,
) -> WrittenOut {
    let mut found = WrittenOut::default();
    let mut known: Map<Symbol, Row> = Map::with_capacity(x.symbol_count());
    let mut along: Map<Symbol, Row> = Map::new();
    let mut inputs = Inputs { x, graph, ports, giver, settled: Map::new() };
    let mut work = 0;
    for &first in ports.definitions.keys() {
        let mut open = vec![first];
        while let Some((top, definition)) = ports.next_to_resolve(&mut open, |s| known.contains_key(s)) {
            let mut row = put_in(x, definition, &known);
            let undetermined = row.iter().any(|t| ports.undetermined.contains(&t.0));
            let gone = |t: &(Symbol, Option<Residue>)| t.1.is_some_and(Residue::vanishes);
            let cancelled: BTreeSet<Symbol> = row.iter().filter(|t| gone(t)).map(|t| t.0).collect();
            row.retain(|t| !gone(t));
            work += row.len();
            if undetermined {
                found.needed.push((top, None));
            } else if !cancelled.is_empty() {
                let (through, short) = through(x, ports, top, &cancelled, (&known, &along));
                work += through.len();
                let least = short.len().min(row.len());
                let long = least > definition.0.len().max(LONG_ROW) || through.len() > LONG_WAY;
                if !(long && cancelled.iter().all(|&s| inputs.is_known_before(s, top))) {
                    let through = (short.len() < row.len()).then(|| {
                        along.insert(top, short);
                        through
                    });
                    found.needed.push((top, through));
                }
            }
            if row.len() <= definition.0.len() && ports.degenerate.is_empty() {
                found.as_short.insert(top, ());
            }
            if work > WORK && ports.undetermined.is_empty() {
                return found;
            }
            known.insert(top, row);
        }
    }
    found
}

/// What elements give, and when it is known.
struct Inputs<'a, 'g> {
    x: &'g Exprs,
    graph: &'g BondGraph,
    ports: &'a Ports,
    giver: &'g dyn Fn(&Symbol) -> Option<&'a PortState>,
    /// Of laws whose variable follows from states and sources alone: the variables that it is computed from. None of others.
    settled: Map<Symbol, Option<BTreeSet<Symbol>>>,
}

impl Inputs<'_, '_> {
    /// Whether an input is known without a variable of the junction structure: a state or a source, or a law that reads what
    /// follows from these, and not through that variable.
    fn is_known_before(&mut self, input: Symbol, variable: Symbol) -> bool {
        if !self.settled.contains_key(&input) {
            let settled = self.read_for(input);
            self.settled.insert(input, settled);
        }
        self.settled[&input].as_ref().is_some_and(|read| !read.contains(&variable))
    }

    fn read_for(&self, input: Symbol) -> Option<BTreeSet<Symbol>> {
        let mut read = BTreeSet::new();
        let mut open = Vec::new();
        match (self.giver)(&input) {
            Some(law) if matches!(law.role, Role::Algebraic(_)) && self.is_of_itself(law) => open.push(law.output),
            _ => return self.is_given(input).then_some(read),
        }
        while let Some(next) = open.pop() {
            match self.ports.definitions.get(&next) {
                Some(definition) if read.insert(next) => open.extend(definition.0.iter().map(|t| t.0)),
                None if !self.is_given(next) => return None,
                _ => {}
            }
        }
        Some(read)
    }

    /// Whether an input is that of a state or a source.
    fn is_given(&self, input: Symbol) -> bool {
        match (self.giver)(&input) {
            Some(port) => matches!(port.role, Role::Independent | Role::Source) && self.is_of_itself(port),
            None => self.ports.virtual_speeds.iter().any(|v| v.speed == input),
        }
    }

    /// Whether what an element gives reads no other bond.
    fn is_of_itself(&self, port: &PortState) -> bool {
        let bond = &self.graph.bonds[self.graph.bond_of(port.port)];
        let (law, also) = match &self.graph.elements[port.port.element].kind {
            Kind::Resistor(laws) => match laws[..] {
                [ResistorLaw::Resistive(law) | ResistorLaw::Conductive(law) | ResistorLaw::Implicit(law)] => (law, law),
                _ => return false,
            },
            Kind::Inertance(storage) | Kind::Compliance(storage) => match storage.laws[port.port.port as usize] {
                StorageLaw::Integral(law) | StorageLaw::Derivative(law) | StorageLaw::Implicit(law) => (law, law),
                StorageLaw::Known { displacement, law } => (displacement, law),
            },
            Kind::EffortSource { value } | Kind::FlowSource { value } => (*value, *value),
            _ => return false,
        };
        let foreign = |s: Symbol| match self.graph.variables.get(&s).map(|v| v.meaning) {
            Some(Meaning::Effort(_) | Meaning::Flow(_)) => s != bond.effort && s != bond.flow,
            Some(Meaning::Rate(_)) | None => true,
            Some(_) => false,
        };
        [law, also].into_iter().all(|e| !self.x.depends_on_any(e, &foreign))
    }
}

/// The variables that have to be put into a row so that the shares of others cancel in it, in order, and its terms then.
/// `known`: rows with everything put in, `along`: with what had to be.
fn through(
    x: &Exprs,
    ports: &Ports,
    top: Symbol,
    cancelled: &BTreeSet<Symbol>,
    (known, along): (&Map<Symbol, Row>, &Map<Symbol, Row>),
) -> (Vec<Symbol>, Row) {
    let own = |s: Symbol| -> Row {
        let defined = |d: &Combination| d.0.iter().map(|&(s, c)| (s, x.residue(c))).collect();
        along.get(&s).cloned().or_else(|| ports.definitions.get(&s).map(defined)).unwrap_or_default()
    };
    let holds = |s: &Symbol| known.get(s).is_some_and(|row| row.iter().any(|t| cancelled.contains(&t.0)));
    let mut put: Map<Symbol, Row> = Map::new();
    let mut order = Vec::new();
    let mut open = vec![top];
    while let Some(&next) = open.last() {
        let row = own(next);
        let before = open.len();
        open.extend(row.iter().map(|t| t.0).filter(|s| holds(s) && !put.contains_key(s)));
        if open.len() > before {
            continue;
        }
        open.pop();
        if !put.contains_key(&next) {
            let mut row = with(row, &put);
            row.retain(|t| !t.1.is_some_and(Residue::vanishes));
            put.insert(next, row);
            order.push(next);
        }
    }
    order.pop();
    (order, put.remove(&top).unwrap_or_default())
}

fn put_in(x: &Exprs, definition: &Combination, known: &Map<Symbol, Row>) -> Row {
    with(definition.0.iter().map(|&(symbol, coefficient)| (symbol, x.residue(coefficient))), known)
}

/// A row with others put in.
fn with(row: impl IntoIterator<Item = (Symbol, Option<Residue>)>, known: &Map<Symbol, Row>) -> Row {
    let mut terms: Row = Vec::new();
    for (symbol, factor) in row {
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
