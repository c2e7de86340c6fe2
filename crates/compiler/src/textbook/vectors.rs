//! Equations of the strands of a multibond as one equation of vectors: those that are alike, `2 f_m' = -b f_m + [0, 0, -19.62]`,
//! and those that matrices and cross products couple, `diag([2, 1, 3]) f_body' = (diag([2, 1, 3]) f_body) × f_body`.

use std::collections::BTreeMap;
use std::ops::Range;

use super::display::{DisplayEquation, LONGEST, textbook};
use super::text::element_name;
use crate::algebra::{Expr, Exprs, Facts, ONE, PlainNames, Symbol, ZERO, ascii};
use crate::bond_graph::{BondGraph, part_name, strand_name};
use crate::equations::State;

/// Strands that the equations of a vector read at most.
const MOST: usize = 1000;

/// Equations of vectors.
#[derive(Debug, Clone, Default)]
pub struct Vectors {
    /// The equations, in the order of those that they stand for.
    pub equations: Vec<VectorEquation>,
    /// The vectors in them, by the name that they have in the model language, and whether it is their rate.
    pub names: BTreeMap<Symbol, (String, bool)>,
}

/// An equation of vectors: `left = right + products + added`.
#[derive(Debug, Clone)]
pub struct VectorEquation {
    /// Which equations it stands for, one a strand.
    pub rows: Range<usize>,
    /// The rate of a vector.
    pub left: Product,
    /// A sum of multiples of vectors; 0 where there are none.
    pub right: Expr,
    /// Vectors that a matrix multiplies, or another vector.
    pub products: Vec<Product>,
    /// What stands beside them in each strand; empty where nothing does.
    pub added: Vec<Expr>,
}

/// A matrix times a vector, across another one: `(J f) × w`.
#[derive(Debug, Clone)]
pub struct Product {
    /// Whether it is taken away.
    pub negative: bool,
    /// The matrix.
    pub matrix: Matrix,
    /// The vector, or a multiple of it.
    pub vector: Expr,
    /// What stands behind the cross.
    pub across: Option<Expr>,
}

/// What multiplies a vector.
#[derive(Debug, Clone)]
pub enum Matrix {
    /// Nothing.
    Unit,
    /// A matrix with nothing beside its diagonal.
    Diagonal(Vec<Expr>),
    /// What a vector across makes of another one.
    Skew(Vec<Expr>),
    /// Any other, by rows.
    Full(Vec<Vec<Expr>>),
}

impl Matrix {
    /// The matrix with these rows, and its multiple of the unit if it is one.
    fn of(x: &mut Exprs, rows: &[Vec<Expr>]) -> (Matrix, Expr) {
        let of = rows.len();
        let at = |row: usize, column: usize| rows[row][column];
        let beside = || (0..of).flat_map(|row| (0..of).filter(move |column| *column != row).map(move |c| (row, c)));
        if beside().all(|(row, column)| at(row, column) == ZERO) {
            let diagonal: Vec<Expr> = (0..of).map(|i| at(i, i)).collect();
            return match diagonal.iter().all(|&e| e == diagonal[0]) {
                true => (Matrix::Unit, diagonal[0]),
                false => (Matrix::Diagonal(diagonal), ONE),
            };
        }
        let mut mirrored = |(row, column): (usize, usize)| {
            let sum = x.add(&[at(row, column), at(column, row)]);
            x.is_zero(sum)
        };
        if of == 3 && beside().chain((0..of).map(|i| (i, i))).all(&mut mirrored) {
            return (Matrix::Skew(vec![at(2, 1), at(0, 2), at(1, 0)]), ONE);
        }
        (Matrix::Full(rows.to_vec()), ONE)
    }

    fn entries(&self) -> Vec<Expr> {
        match self {
            Matrix::Unit => Vec::new(),
            Matrix::Diagonal(entries) | Matrix::Skew(entries) => entries.clone(),
            Matrix::Full(rows) => rows.concat(),
        }
    }

    /// The same with the other sign.
    fn turned(&self, x: &mut Exprs) -> Matrix {
        let mut turned = |entries: &[Expr]| {
            let turned = entries.iter().map(|&e| x.neg(e));
            turned.collect::<Vec<_>>().into_iter().map(|e| textbook(x, e)).collect::<Vec<Expr>>()
        };
        match self {
            Matrix::Unit => Matrix::Unit,
            Matrix::Diagonal(entries) => Matrix::Diagonal(turned(entries)),
            Matrix::Skew(entries) => Matrix::Skew(turned(entries)),
            Matrix::Full(rows) => Matrix::Full(rows.iter().map(|row| turned(row)).collect()),
        }
    }
}

impl Product {
    /// A matrix times a vector, taken away where that saves signs.
    fn new(x: &mut Exprs, matrix: Matrix, vector: Expr) -> Product {
        let minus = |x: &Exprs, e: Expr| ascii(x, e, &PlainNames(x)).starts_with('-');
        let entries = matrix.entries();
        let signs = entries.iter().filter(|&&e| e != ZERO).map(|&e| minus(x, e)).collect::<Vec<_>>();
        let negative = 2 * signs.iter().filter(|&&minus| minus).count() > signs.len();
        let matrix = if negative { matrix.turned(x) } else { matrix };
        Product { negative, matrix, vector, across: None }
    }

    /// How long it is in print, as [`Exprs::printed_length`] counts.
    fn length(&self, x: &Exprs) -> u64 {
        let brackets = match &self.matrix {
            Matrix::Unit => 0,
            Matrix::Diagonal(_) | Matrix::Skew(_) => 2,
            Matrix::Full(rows) => rows.len() as u64 + 1,
        };
        let entries: u64 = self.matrix.entries().iter().map(|&e| x.printed_length(e)).sum();
        let across = self.across.map_or(0, |across| x.printed_length(across) + 1);
        brackets + entries + x.printed_length(self.vector) + across
    }
}

/// A strand of a vector.
#[derive(Debug, Clone)]
struct Strand {
    vector: (String, bool),
    at: usize,
    of: usize,
}

/// The equations of strands that are shorter as one.
pub fn vectors(x: &mut Exprs, strands: &Strands, display: &[DisplayEquation]) -> Vectors {
    let mut found = Vectors::default();
    let mut known: BTreeMap<(String, bool), Symbol> = BTreeMap::new();
    let mut at = 0;
    while at < display.len() {
        let mut vector = |x: &mut Exprs, of: &(String, bool)| {
            let symbol = *known.entry(of.clone()).or_insert_with(|| x.fresh(&of.0, Facts::default()));
            found.names.insert(symbol, of.clone());
            x.sym(symbol)
        };
        let own = strands.together(x, (display, at), &mut vector);
        at = own.as_ref().map_or(at + 1, |own| own.rows.end);
        found.equations.extend(own);
    }
    found
}

/// Which variables belong to strands, and the strands of each vector that has all of them, in their order.
pub struct Strands {
    of: BTreeMap<Symbol, Strand>,
    whole: BTreeMap<(String, bool), Vec<Symbol>>,
}

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
        let mut parts: BTreeMap<(String, bool), Vec<Option<Symbol>>> = BTreeMap::new();
        for (&symbol, strand) in &of {
            let parts = parts.entry(strand.vector.clone()).or_insert_with(|| vec![None; strand.of]);
            parts[strand.at] = Some(symbol);
        }
        let whole =
            parts.into_iter().filter_map(|(name, parts)| Some((name, parts.into_iter().collect::<Option<_>>()?)));
        Strands { whole: whole.collect(), of }
    }

    /// The equations from a place on, one of each strand of a vector, where they are shorter as one:
    /// `M x' = sum of A y + (M x) × w + rest`, as momentum turns in the axes of a body.
    fn together(
        &self,
        x: &mut Exprs,
        (display, at): (&[DisplayEquation], usize),
        vector: &mut dyn FnMut(&mut Exprs, &(String, bool)) -> Expr,
    ) -> Option<VectorEquation> {
        let first = x.symbols_of(display[at].left);
        let strand = first.iter().find_map(|symbol| self.of.get(symbol))?;
        let (name, of) = (strand.vector.clone(), strand.of);
        let own = display.get(at..at + of).filter(|_| name.1)?;
        if own.iter().any(|e| x.printed_length(e.left).max(x.printed_length(e.right)) > LONGEST) {
            return None;
        }
        let rates = self.whole.get(&name)?;
        let mut mass = Vec::new();
        for equation in own {
            let (row, rest) = x.linear_in(equation.left, rates)?;
            let reads_strand = row.iter().any(|&e| x.depends_on_any(e, &|s| self.of.contains_key(&s)));
            if rest != ZERO || reads_strand {
                return None;
            }
            mass.push(row);
        }
        let rights: Vec<Expr> = own.iter().map(|equation| equation.right).collect();
        let apart: u64 = own.iter().map(|e| x.printed_length(e.left) + x.printed_length(e.right)).sum();
        let mut as_one = |x: &mut Exprs, mass: &[Vec<Expr>], rights: &[Expr]| {
            let (found, length) = self.as_one(x, &name, (mass, rights), vector)?;
            let multiples = found.products.is_empty() && matches!(found.left.matrix, Matrix::Unit);
            // A matrix is harder to read than its rows.
            let is_shorter = if multiples { length < apart } else { 5 * length <= 4 * apart };
            is_shorter.then_some(VectorEquation { rows: at..at + of, ..found })
        };
        as_one(x, &mass, &rights).or_else(|| {
            let (mass, rights) = with_one_mass(x, &mass, &rights)?;
            as_one(x, &mass, &rights)
        })
    }

    /// Equations of the strands of a vector as one, and its length in print.
    fn as_one(
        &self,
        x: &mut Exprs,
        name: &(String, bool),
        (mass, rights): (&[Vec<Expr>], &[Expr]),
        vector: &mut dyn FnMut(&mut Exprs, &(String, bool)) -> Expr,
    ) -> Option<(VectorEquation, u64)> {
        let of = mass.len();
        let mut read: Vec<(String, bool)> = Vec::new();
        for symbol in rights.iter().flat_map(|&e| x.symbols_of(e)) {
            read.extend(self.of.get(&symbol).filter(|strand| strand.of == of).map(|strand| strand.vector.clone()));
        }
        read.sort();
        read.dedup();
        // Of a source that is a number in some strands the others stand as they are.
        read.retain(|name| self.whole.contains_key(name));
        let vectors: Vec<&[Symbol]> = read.iter().map(|name| &self.whole[name][..]).collect();
        if vectors.is_empty() || of * vectors.len() > MOST {
            return None;
        }
        let nothing: BTreeMap<Symbol, Expr> = vectors.iter().copied().flatten().map(|&symbol| (symbol, ZERO)).collect();
        let mut linear = Vec::new();
        let mut left_over = rights.to_vec();
        for symbols in &vectors {
            let mut rows = Vec::new();
            for (row, &right) in rights.iter().enumerate() {
                let mut entries = Vec::new();
                for &symbol in *symbols {
                    if !x.depends_on(right, symbol) {
                        entries.push(ZERO);
                        continue;
                    }
                    let entry = x.derivative(right, symbol);
                    let entry = x.substitute(entry, &nothing);
                    let entry = if x.is_zero(entry) { ZERO } else { textbook(x, entry) };
                    let own = x.sym(symbol);
                    let term = x.mul(&[entry, own]);
                    left_over[row] = x.sub(left_over[row], term);
                    entries.push(entry);
                }
                rows.push(entries);
            }
            linear.push(rows);
        }
        let mut added = Vec::new();
        for (row, &right) in rights.iter().enumerate() {
            let rest = x.substitute(right, &nothing);
            left_over[row] = x.sub(left_over[row], rest);
            added.push(if x.is_zero(rest) { ZERO } else { textbook(x, rest) });
        }
        let (left, multiple) = Matrix::of(x, mass);
        let across = self.across(x, name, (mass, &vectors), &left_over)?;
        let mut sum = Vec::new();
        let mut products = Vec::new();
        for (name, rows) in read.iter().zip(&linear).filter(|(_, rows)| rows.iter().flatten().any(|&e| e != ZERO)) {
            let own = vector(x, name);
            match Matrix::of(x, rows) {
                (Matrix::Unit, coefficient) => sum.push(x.mul(&[coefficient, own])),
                (matrix, _) => products.push(Product::new(x, matrix, own)),
            }
        }
        if let Some((at, negative)) = across {
            let (own, across) = (vector(x, &(name.0.clone(), false)), vector(x, &read[at]));
            let own = x.mul(&[multiple, own]);
            products.push(Product { negative, matrix: left.clone(), vector: own, across: Some(across) });
        }
        let right = x.add(&sum);
        let right = textbook(x, right);
        let rate = vector(x, name);
        let left = Product { negative: false, matrix: left, vector: x.mul(&[multiple, rate]), across: None };
        let added = if added.iter().all(|&e| e == ZERO) { Vec::new() } else { added };
        let length = left.length(x)
            + x.printed_length(right)
            + products.iter().map(|product| product.length(x) + 1).sum::<u64>()
            + added.iter().map(|&e| x.printed_length(e)).sum::<u64>();
        Some((VectorEquation { rows: 0..of, left, right, products, added }, length))
    }

    /// Across which vector the momentum `mass · own` stands in what is left over, and whether it is taken away; `None` inside where
    /// nothing is left over, and outside where it is something else.
    fn across(
        &self,
        x: &mut Exprs,
        own: &(String, bool),
        (mass, vectors): (&[Vec<Expr>], &[&[Symbol]]),
        left_over: &[Expr],
    ) -> Option<Option<(usize, bool)>> {
        if left_over.iter().all(|&e| x.is_zero(e)) {
            return Some(None);
        }
        let own = self.whole.get(&(own.0.clone(), false)).filter(|_| mass.len() == 3)?;
        let mut momentum = Vec::new();
        for row in mass {
            let mut terms = Vec::new();
            for (&entry, &symbol) in row.iter().zip(own) {
                let symbol = x.sym(symbol);
                terms.push(x.mul(&[entry, symbol]));
            }
            momentum.push(x.add(&terms));
        }
        for (at, across) in vectors.iter().enumerate() {
            let across: Vec<Expr> = across.iter().map(|&symbol| x.sym(symbol)).collect();
            let mut parts = Vec::new();
            for i in 0..3 {
                let (next, last) = ((i + 1) % 3, (i + 2) % 3);
                let (a, b) = (x.mul(&[momentum[next], across[last]]), x.mul(&[momentum[last], across[next]]));
                parts.push(x.sub(a, b));
            }
            let mut is = |negative: bool| {
                left_over.iter().zip(&parts).all(|(&e, &part)| {
                    let rest = if negative { x.add(&[e, part]) } else { x.sub(e, part) };
                    x.is_zero(rest)
                })
            };
            if is(false) {
                return Some(Some((at, false)));
            }
            if is(true) {
                return Some(Some((at, true)));
            }
        }
        None
    }
}

/// Equations that each were divided by what it could be, `f' = …` and `m f' = …`, with the same multiple of each rate.
fn with_one_mass(x: &mut Exprs, mass: &[Vec<Expr>], rights: &[Expr]) -> Option<(Vec<Vec<Expr>>, Vec<Expr>)> {
    let (Matrix::Diagonal(own), _) = Matrix::of(x, mass) else { return None };
    let one = own.iter().copied().max_by_key(|&e| x.printed_length(e))?;
    let mut scaled = Vec::new();
    for (&own, &right) in own.iter().zip(rights) {
        if own == ZERO {
            return None;
        }
        let factor = x.div(one, own);
        let right = x.mul(&[factor, right]);
        scaled.push(textbook(x, right));
    }
    let mass = (0..own.len()).map(|row| (0..own.len()).map(|column| if row == column { one } else { ZERO }).collect());
    Some((mass.collect(), scaled))
}

/// The strands of multibonds and of elements on them by name, each with the name of the whole, its place and their number.
fn places(graph: &BondGraph) -> BTreeMap<String, (String, usize, usize)> {
    let mut places = BTreeMap::new();
    for element in graph.elements.values() {
        if let Some((at, of)) = element.strand.map(|(at, of)| (at as usize, of as usize))
            && let Some(base) = element.name.strip_suffix(&part_name("", &strand_name(at, of)))
        {
            places.insert(element.name.clone(), (base.to_string(), at, of));
        }
        let of = element.ports.len();
        let is_strand = |at: usize| element.ports[at].name == strand_name(at, of);
        for at in (0..of).filter(|_| of > 1 && (0..of).all(is_strand)) {
            places.insert(element.part_name(at), (element.name.clone(), at, of));
        }
    }
    places
}
