//! Equations of the strands of a multibond that are alike, as one equation of vectors: `2 f_m' = -b f_m + [0, 0, -19.62]`.

use std::collections::BTreeMap;
use std::ops::Range;

use super::display::{DisplayEquation, LONGEST, textbook};
use super::text::element_name;
use crate::algebra::{Expr, Exprs, Facts, Symbol};
use crate::bond_graph::{BondGraph, part_name, strand_name};
use crate::equations::State;

/// Strands of a vector at most: those of more have numbers.
const MOST: usize = 3;

/// Equations of vectors.
#[derive(Debug, Clone, Default)]
pub struct Vectors {
    /// The equations, in the order of those that they stand for.
    pub equations: Vec<VectorEquation>,
    /// The vectors in them, by the name that they have in the model language, and whether it is their rate.
    pub names: BTreeMap<Symbol, (String, bool)>,
}

/// An equation of vectors: `left = right + added`.
#[derive(Debug, Clone)]
pub struct VectorEquation {
    /// Which equations it stands for, one a strand.
    pub rows: Range<usize>,
    /// A multiple of the rate of a vector.
    pub left: Expr,
    /// A sum of multiples of vectors.
    pub right: Expr,
    /// What stands beside them in each strand; empty where nothing does.
    pub added: Vec<Expr>,
}

/// A strand of a vector.
#[derive(Debug, Clone)]
struct Strand {
    vector: (String, bool),
    at: usize,
    of: usize,
}

/// One equation, in what it has in common with those of other strands, and the rest.
struct Row {
    left: ((String, bool), Expr),
    right: BTreeMap<(String, bool), Expr>,
    rest: Expr,
}

/// The equations of strands that are alike.
pub fn vectors(x: &mut Exprs, strands: &Strands, display: &[DisplayEquation]) -> Vectors {
    let mut found = Vectors::default();
    let mut known: BTreeMap<(String, bool), Symbol> = BTreeMap::new();
    let mut at = 0;
    while at < display.len() {
        let Some(rows) = strands.alike(x, &display[at..]) else {
            at += 1;
            continue;
        };
        let mut vector = |x: &mut Exprs, of: &(String, bool)| {
            let symbol = *known.entry(of.clone()).or_insert_with(|| x.fresh(&of.0, Facts::default()));
            found.names.insert(symbol, of.clone());
            x.sym(symbol)
        };
        let (of, coefficient) = &rows[0].left;
        let own = vector(x, of);
        let left = x.mul(&[*coefficient, own]);
        let mut terms = Vec::new();
        for (of, &coefficient) in &rows[0].right {
            let own = vector(x, of);
            terms.push(x.mul(&[coefficient, own]));
        }
        let right = x.add(&terms);
        let right = textbook(x, right);
        let is_added = rows.iter().any(|row| !x.is_zero(row.rest));
        let added = if is_added { rows.iter().map(|row| row.rest).collect() } else { Vec::new() };
        let end = at + rows.len();
        found.equations.push(VectorEquation { rows: at..end, left, right, added });
        at = end;
    }
    found
}

/// Which variables belong to strands.
pub struct Strands(BTreeMap<Symbol, Strand>);

impl Strands {
    /// Those of states that have no other name, of their rates, and of sources that stand by name.
    pub fn of(
        graph: &BondGraph,
        states: &[State],
        sources: &[(Symbol, Expr)],
        aliases: &BTreeMap<Symbol, String>,
    ) -> Strands {
        let places = places(graph);
        let strand = |place: Option<&(String, usize, usize)>, variable: Option<&str>, is_rate: bool| {
            let (base, at, of) = place?;
            let name = variable.map_or_else(|| base.clone(), |variable| format!("{base}.{variable}"));
            // What has that name would be taken for the vector.
            graph.exprs.find_symbol(&name).is_none().then_some(Strand { vector: (name, is_rate), at: *at, of: *of })
        };
        let mut of = BTreeMap::new();
        for state in states.iter().filter(|state| !aliases.contains_key(&state.symbol)) {
            let Some((part, variable)) = state.name.rsplit_once('.') else { continue };
            for (symbol, is_rate) in [(state.symbol, false), (state.rate, true)] {
                of.extend(strand(places.get(part), Some(variable), is_rate).map(|strand| (symbol, strand)));
            }
        }
        for &(symbol, _) in sources {
            let name = element_name(graph, symbol);
            of.extend(strand(places.get(&name), None, false).map(|strand| (symbol, strand)));
        }
        Strands(of)
    }

    /// The first equations, one of each strand of a vector, if they are alike, and shorter as one.
    fn alike(&self, x: &mut Exprs, display: &[DisplayEquation]) -> Option<Vec<Row>> {
        let first = x.symbols_of(display[0].left);
        let of = first.iter().find_map(|symbol| self.0.get(symbol)).filter(|strand| strand.at == 0)?.of;
        let own = display.get(..of)?;
        let rows = own.iter().enumerate().map(|(at, equation)| self.row(x, equation, (at, of)));
        let rows = rows.collect::<Option<Vec<Row>>>()?;
        let same = |row: &Row| row.left == rows[0].left && row.right == rows[0].right;
        if !rows.iter().all(same) || rows[0].right.is_empty() {
            return None;
        }
        let length = |e: Expr| x.printed_length(e);
        let apart: u64 = own.iter().map(|e| length(e.left) + length(e.right)).sum();
        let whole = length(own[0].left) + length(own[0].right) + rows.iter().map(|row| length(row.rest)).sum::<u64>();
        (whole < apart).then_some(rows)
    }

    fn row(&self, x: &mut Exprs, equation: &DisplayEquation, (at, of): (usize, usize)) -> Option<Row> {
        if x.printed_length(equation.right) > LONGEST {
            return None;
        }
        let own = |x: &Exprs, e: Expr| -> Option<Vec<(Symbol, Strand)>> {
            let all = x.symbols_of(e).into_iter().filter_map(|symbol| Some((symbol, self.0.get(&symbol)?.clone())));
            let all: Vec<_> = all.collect();
            all.iter().all(|(_, strand)| (strand.at, strand.of) == (at, of)).then_some(all)
        };
        let [(rate, strand)] = &own(x, equation.left)?[..] else { return None };
        let (coefficient, rest) = x.linear_in(equation.left, &[*rate])?;
        if !x.is_zero(rest) || !strand.vector.1 {
            return None;
        }
        let read = own(x, equation.right)?;
        let symbols: Vec<Symbol> = read.iter().map(|(symbol, _)| *symbol).collect();
        let (coefficients, rest) = x.linear_in(equation.right, &symbols)?;
        let rest = textbook(x, rest);
        let right = read.into_iter().map(|(_, strand)| strand.vector).zip(coefficients).collect();
        Some(Row { left: (strand.vector.clone(), coefficient[0]), right, rest })
    }
}

/// The strands of multibonds and of elements on them by name, each with the name of the whole, its place and their number.
fn places(graph: &BondGraph) -> BTreeMap<String, (String, usize, usize)> {
    let mut places = BTreeMap::new();
    for element in graph.elements.values() {
        if let Some((at, of)) = element.strand.map(|(at, of)| (at as usize, of as usize))
            && of <= MOST
            && let Some(base) = element.name.strip_suffix(&part_name("", &strand_name(at, of)))
        {
            places.insert(element.name.clone(), (base.to_string(), at, of));
        }
        let of = element.ports.len();
        let is_strand = |at: usize| element.ports[at].name == strand_name(at, of);
        for at in (0..of).filter(|_| (2..=MOST).contains(&of) && (0..of).all(is_strand)) {
            places.insert(element.part_name(at), (element.name.clone(), at, of));
        }
    }
    places
}
