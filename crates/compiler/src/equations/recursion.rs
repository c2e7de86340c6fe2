//! Linear loops of many rates, gone through from the leaves of a mechanism to its base.
//!
//! Written down to the rates, a tree of bodies makes a full matrix. Here variables are put into each other from the outside
//! in, each motion together with what acts along it, so that what is known of a part of the machine is its inertia, seen from
//! where it hangs. A rate is eliminated as soon as few variables cut it off from the rest: on a chain of bodies these are the
//! motions of the joint before, and what comes about is the recursion of articulated bodies (R. Featherstone, Rigid Body
//! Dynamics Algorithms, 2008, chapter 7), with operations in proportion to its length.
//!
//! Each pivot is one of the matrix of all rates, eliminated in some order. Of a symmetric definite matrix none vanishes,
//! whatever the order; only where the matrix is found to be one is a rate eliminated.

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

use rustc_hash::{FxHashMap, FxHashSet};

use super::EquationStep;
use super::blocks::{FEW, Row, operations};
use super::definitions::Definitions;
use super::points::ROUNDING;
use super::recognition::{Parameters, Point, Recognition};
use crate::algebra::{Expr, Exprs, Node, Symbol, SymbolKind, ZERO, scattered};
use crate::bond_graph::Meaning;

/// What is written longer than this keeps a name.
const NAMED: u64 = 3;
/// Where more unknowns than this are left, whether the matrix between them is definite takes too much to find out.
const MOST_LEFT: usize = 1000;
/// A part of a machine is cut off by few variables where these are no more: six motions of a body in space, and some of the
/// joints beside.
const SHORT: usize = 9;
/// So many variables are looked at in the search for a short cut.
const WIDEST: usize = 5000;
/// Variables of bonds that are others by name alone are followed so far.
const ALIASES: usize = 100;
/// Columns of the matrix of a loop that are found at once.
const LANES: usize = 8;
/// Products that may be formed for each variable of a loop: where it takes more, variables are not few at any cut.
const WORK: usize = 60;

/// A loop solved in this way.
pub struct Recursion {
    /// Names for parts, each with its value, in what is defined before the loop and in names before it.
    pub named: Vec<(Symbol, Expr)>,
    /// The unknowns that are left, by their place among all, with the equations between them.
    pub left: Vec<usize>,
    /// Coefficients by the place of their unknown among those left, and the rest.
    pub rows: Vec<Row>,
    /// Unknowns that were eliminated.
    pub eliminated: Vec<Eliminated>,
    /// Values of eliminated unknowns and of the other variables of the loop, in order of evaluation.
    pub after: Vec<(Symbol, Expr)>,
}

impl Recursion {
    /// Operations to find all unknowns.
    pub fn operations(&self, x: &Exprs) -> f64 {
        let others: Vec<Expr> = self.eliminated.iter().flat_map(|e| [e.pivot, e.right]).collect();
        operations(x, &self.named, &self.rows, &others)
    }
}

/// An unknown that was eliminated: `pivot · unknown = right`, in variables that are known before it.
#[derive(Debug, Clone, Copy)]
pub struct Eliminated {
    /// The unknown.
    pub unknown: Symbol,
    /// What multiplies it.
    pub pivot: Expr,
    /// The right side.
    pub right: Expr,
}

/// The points at which a matrix is looked at: it is symmetric anywhere, and definite at the given parameters.
const PLACES: [(usize, Parameters); 3] = [(0, Parameters::Any), (1, Parameters::Given), (2, Parameters::Given)];

/// The coefficients of forms at a point, by the variables that they multiply.
type Coefficients = Vec<Vec<(usize, f64)>>;

/// A linear form in variables of the loop, by their numbers.
#[derive(Debug, Clone)]
struct Form {
    terms: BTreeMap<usize, Expr>,
    rest: Expr,
}

impl Form {
    /// An expression as a form in the variables of the loop; `None` if it is none.
    fn of(x: &mut Exprs, e: Expr, index: &FxHashMap<Symbol, usize>) -> Option<Form> {
        let read: Vec<Symbol> = x.symbols_of(e).into_iter().filter(|s| index.contains_key(s)).collect();
        let (own, rest) = x.sparse_linear_in(e, &read)?;
        Some(Form { terms: own.into_iter().map(|(k, e)| (index[&read[k]], e)).collect(), rest })
    }
}

/// Where an unknown is eliminated.
#[derive(Debug, Clone, Copy)]
enum Cut {
    /// Where few variables cut it off from the rest of its loop.
    Short,
    /// Where these are fewer than the unknowns further in: of short chains a matrix takes less.
    ShorterThanRates,
}

/// The recursion of a loop with these unknowns, definitions of its other variables in order and residuals; `None` if it is
/// not linear or takes too much. `steps`: what is evaluated before.
pub fn recursion(
    d: &mut Definitions,
    unknowns: &[Symbol],
    body: &[(Symbol, Expr)],
    residuals: &[Expr],
    steps: &[EquationStep],
) -> Option<Recursion> {
    let short = with_cuts(Cut::Short, d, (unknowns, body, residuals), steps);
    if unknowns.len() > FEW {
        return short;
    }
    let other = with_cuts(Cut::ShorterThanRates, d, (unknowns, body, residuals), steps);
    short.into_iter().chain(other).min_by(|a, b| a.operations(&d.x).total_cmp(&b.operations(&d.x)))
}

/// Unknowns of a loop, definitions of its other variables in order, and residuals.
type Loop<'a> = (&'a [Symbol], &'a [(Symbol, Expr)], &'a [Expr]);

/// The same with unknowns eliminated in these places.
fn with_cuts(
    cut: Cut,
    d: &mut Definitions,
    (unknowns, body, residuals): Loop,
    steps: &[EquationStep],
) -> Option<Recursion> {
    let symbols: Vec<Symbol> = unknowns.iter().copied().chain(body.iter().map(|b| b.0)).collect();
    let index: FxHashMap<Symbol, usize> = symbols.iter().enumerate().map(|(k, &s)| (s, k)).collect();
    let duals = symbols.iter().map(|&s| dual(d, s).and_then(|s| index.get(&s).copied())).collect();
    let x = &mut d.x;
    let roots: Vec<Expr> = residuals.iter().copied().chain(body.iter().map(|b| b.1)).collect();
    let forms = roots.iter().map(|&e| Form::of(x, e, &index)).collect::<Option<Vec<Form>>>()?;
    let mut readers = vec![BTreeSet::new(); symbols.len()];
    for (row, form) in forms.iter().enumerate() {
        form.terms.keys().for_each(|&k| _ = readers[k].insert(row));
    }
    let (gone, rests) = (vec![false; symbols.len()], vec![ZERO; symbols.len()]);
    let recognition = Recognition::new(x, &roots, steps);
    let mut open = Open {
        x,
        symbols,
        unknowns: unknowns.len(),
        forms,
        readers,
        rests,
        depths: Vec::new(),
        gone,
        recognition,
        eliminated: Vec::new(),
        work: 0,
    };
    open.depths = open.depths();
    let order = open.levels(duals);
    // A matrix of few unknowns is looked at before, one of many by the pivots that it turns out to have.
    let many = (unknowns.len() > FEW).then(|| Products::of(&open, &roots, steps));
    let definite = many.is_some() || open.is_definite(&roots, steps);
    open.put_in_what_rests();
    if definite {
        open.eliminate(&order, cut)?;
    }
    let all = (open.unknowns..open.symbols.len()).collect();
    open.put_in_all(all, &order)?;
    let (rows, left) = open.rows_left();
    if !many.is_none_or(|products| products.are_of_a_definite_matrix(&open, (&rows, &left))) {
        return None;
    }
    open.finish(body, rows, left)
}

/// The rate that makes a power with a variable of a bond: that of its other variable.
fn dual(d: &Definitions, symbol: Symbol) -> Option<Symbol> {
    let mut other = match d.meaning(d.x.untwinned(symbol))? {
        Meaning::Effort(bond) => d.graph.bonds[bond].flow,
        Meaning::Flow(bond) => d.graph.bonds[bond].effort,
        _ => return None,
    };
    for _ in 0..ALIASES {
        if let Some(rate) = d.x.find_made_of(SymbolKind::Rate(other)).filter(|rate| d.of.contains_key(rate)) {
            return Some(rate);
        }
        let &Node::Symbol(next) = d.x.node(d.of.get(&other)?.expr()) else { return None };
        other = next;
    }
    None
}

/// A loop whose variables are put into each other.
struct Open<'a> {
    x: &'a mut Exprs,
    symbols: Vec<Symbol>,
    /// How many of them are unknowns of the loop; the others have definitions.
    unknowns: usize,
    /// Residuals of unknowns, definitions of the others.
    forms: Vec<Form>,
    /// The forms that read a variable.
    readers: Vec<BTreeSet<usize>>,
    /// What they are where all unknowns vanish.
    rests: Vec<Expr>,
    /// How far variables with definitions are from the unknowns: greater than the depths of all that their forms read.
    depths: Vec<usize>,
    /// Variables that were put in.
    gone: Vec<bool>,
    recognition: Recognition,
    eliminated: Vec<Eliminated>,
    /// Products formed so far.
    work: usize,
}

impl Open<'_> {
    /// The longest way from each variable down to the unknowns.
    fn depths(&self) -> Vec<usize> {
        let mut depths = vec![0; self.symbols.len()];
        for k in self.unknowns..self.symbols.len() {
            depths[k] = 1 + self.forms[k].terms.keys().map(|&j| depths[j]).max().unwrap_or(0);
        }
        depths
    }

    /// How far in a variable stands, by the longest way from a motion to the equations; what acts along a motion is put in
    /// just before it.
    fn levels(&self, duals: Vec<Option<usize>>) -> Vec<usize> {
        let (n, from) = (self.symbols.len(), &self.depths);
        let mut to = vec![0; n];
        for k in (self.unknowns..n).rev() {
            to[k] = 1 + self.readers[k].iter().map(|&j| if j < self.unknowns { 0 } else { to[j] }).max().unwrap_or(0);
        }
        let level = |k: usize| match duals[k] {
            Some(dual) if dual >= self.unknowns => 2 * to[dual],
            Some(_) => 2 * from[k] + 1,
            None => 2 * from[k].max(to[k]) + 1,
        };
        (0..n).map(level).collect()
    }

    /// Whether the matrix of the unknowns is symmetric, and definite at the given parameters. Rows may have either sign.
    fn is_definite(&self, roots: &[Expr], steps: &[EquationStep]) -> bool {
        PLACES.into_iter().all(|(number, parameters)| {
            let mut point = Point::new(self.x, number, parameters, roots, steps);
            let mut matrix = self.matrix(&mut point);
            let n = self.unknowns;
            let sizes: Vec<f64> = (0..n).map(|k| matrix[k * n + k]).collect();
            for (k, size) in sizes.iter().enumerate() {
                (0..n).for_each(|j| matrix[k * n + j] *= size.signum());
            }
            is_symmetric(n, &matrix) && (parameters == Parameters::Any || has_positive_pivots(n, matrix))
        })
    }

    /// The coefficients of all forms at a point.
    fn coefficients(&self, point: &mut Point) -> Coefficients {
        let value = |(&j, &e): (&usize, &Expr), point: &mut Point| (j, point.value(self.x, e));
        self.forms.iter().map(|form| form.terms.iter().map(|term| value(term, point)).collect()).collect()
    }

    /// What the residuals make of the unknowns, at a point.
    fn matrix(&self, point: &mut Point) -> Vec<f64> {
        let n = self.unknowns;
        let coefficients = self.coefficients(point);
        let mut matrix = vec![0.0; n * n];
        let mut values = vec![[0.0; LANES]; self.symbols.len()];
        for first in (0..n).step_by(LANES) {
            let columns = first..n.min(first + LANES);
            values.fill([0.0; LANES]);
            columns.clone().for_each(|column| values[column][column - first] = 1.0);
            let sum = |values: &[[f64; LANES]], k: usize| {
                let add = |mut sum: [f64; LANES], &(j, e): &(usize, f64)| {
                    sum.iter_mut().zip(&values[j]).for_each(|(sum, value)| *sum += e * value);
                    sum
                };
                coefficients[k].iter().fold([0.0; LANES], add)
            };
            for k in n..self.symbols.len() {
                values[k] = sum(&values, k);
            }
            for row in 0..n {
                let found = sum(&values, row);
                matrix[row * n + first..row * n + columns.end].copy_from_slice(&found[..columns.len()]);
            }
        }
        matrix
    }

    /// What variables are where all unknowns vanish is put into the residuals; their forms are without a rest then.
    fn put_in_what_rests(&mut self) {
        let n = self.symbols.len();
        for k in (self.unknowns..n).chain(0..self.unknowns) {
            let form = &self.forms[k];
            let mut sum = vec![form.rest];
            for (&j, &e) in &form.terms {
                sum.push(self.x.mul(&[e, self.rests[j]]));
            }
            let sum = self.x.add(&sum);
            let sum = if self.recognition.is_zero(self.x, sum) { ZERO } else { sum };
            if k < self.unknowns {
                self.forms[k].rest = sum;
            } else {
                let own = self.symbols[k];
                self.rests[k] = self.recognition.short(self.x, sum, NAMED, |x| x.bias(own));
                self.forms[k].rest = ZERO;
            }
        }
    }

    /// Eliminates unknowns where the rest of the loop is cut off, those furthest out first.
    fn eliminate(&mut self, order: &[usize], cut: Cut) -> Option<()> {
        let mut unknowns: Vec<(u32, usize)> = self.between_all().into_iter().zip(0..).collect();
        unknowns.sort_unstable();
        for (_, k) in unknowns {
            let mut between = self.between(k);
            let boundary = self.boundary(k, &between);
            let is_cut = match cut {
                Cut::Short if boundary.len() > SHORT && self.unknowns > FEW => {
                    let behind = shortest_cut(&boundary, SHORT, |j| self.read_inward(j));
                    between.extend(behind.iter().flatten().filter(|&&j| j >= self.unknowns));
                    behind.is_some()
                }
                Cut::Short => true,
                Cut::ShorterThanRates => boundary.len() < self.further_in(k, boundary.len()),
            };
            if !is_cut || !self.is_read(k) {
                continue;
            }
            self.put_in_all(between, order)?;
            self.solve(k)?;
            self.put_in(k);
        }
        Some(())
    }

    /// Whether variables with definitions are left that read an unknown.
    fn is_read(&self, k: usize) -> bool {
        self.readers[k].iter().any(|&j| j >= self.unknowns)
    }

    /// How many variables there are for each unknown through which its residual reads it.
    fn between_all(&self) -> Vec<u32> {
        let (n, all) = (self.unknowns, self.symbols.len());
        let mut count = vec![0; n];
        // Of as many unknowns at once as a number has bits: those that variables read, and those whose residuals read them.
        let (mut reads, mut is_read) = (vec![0u64; all], vec![0u64; all]);
        for first in (0..n).step_by(64) {
            let own = first..n.min(first + 64);
            for set in [&mut reads, &mut is_read] {
                set[..n].fill(0);
                own.clone().for_each(|k| set[k] = 1 << (k - first));
            }
            for k in n..all {
                reads[k] = self.forms[k].terms.keys().fold(0, |set, &j| set | reads[j]);
            }
            for k in (n..all).rev() {
                is_read[k] = self.readers[k].iter().fold(0, |set, &j| set | is_read[j]);
                let mut both = is_read[k] & reads[k];
                while both != 0 {
                    count[first + both.trailing_zeros() as usize] += 1;
                    both &= both - 1;
                }
            }
        }
        count
    }

    /// The variables through which the residual of an unknown reads the unknown.
    ///
    /// In a chain what reads the unknown goes all the way to one end, as does what the residual reads, and few variables are
    /// both: they are looked for from both sides at once, until one side has come to its end.
    fn between(&self, k: usize) -> BTreeSet<usize> {
        let reading = |j: usize| self.readers[j].iter().copied().filter(|&j| j >= self.unknowns);
        let read = |j: usize| self.forms[j].terms.keys().copied().filter(|&j| j >= self.unknowns);
        let least = reading(k).map(|j| self.depths[j]).min();
        let most = read(k).map(|j| self.depths[j]).max();
        let (Some(least), Some(most)) = (least, most) else { return BTreeSet::new() };
        // What is less deep than all that read the unknown does not read it, and what is deeper than all that the residual
        // reads is not read by it.
        let reading = |j: usize, found: &mut Vec<usize>| found.extend(reading(j).filter(|&j| self.depths[j] <= most));
        let read = |j: usize, found: &mut Vec<usize>| found.extend(read(j).filter(|&j| self.depths[j] >= least));
        let (mut above, mut below) = (Reached::from(k), Reached::from(k));
        loop {
            if !above.step(reading) {
                return Reached::from(k).within(&above, read);
            }
            if !below.step(read) {
                return Reached::from(k).within(&below, reading);
            }
        }
    }

    /// The other variables that the residual of an unknown reads through these.
    fn boundary(&self, k: usize, between: &BTreeSet<usize>) -> BTreeSet<usize> {
        let forms = between.iter().chain([&k]);
        let read: BTreeSet<usize> = forms.flat_map(|&j| self.forms[j].terms.keys().copied()).collect();
        read.into_iter().filter(|j| *j != k && !between.contains(j)).collect()
    }

    /// What a variable reads; none of unknowns.
    fn read_inward(&self, k: usize) -> Option<Vec<usize>> {
        (k >= self.unknowns).then(|| self.forms[k].terms.keys().copied().collect())
    }

    /// How many other unknowns the residual of an unknown reads in the end; more than `enough` are not counted.
    fn further_in(&self, k: usize, enough: usize) -> usize {
        let (mut seen, mut found) = (vec![false; self.symbols.len()], 0);
        seen[k] = true;
        let mut open = vec![k];
        while let Some(j) = open.pop().filter(|_| found <= enough) {
            for &read in self.forms[j].terms.keys() {
                if !std::mem::replace(&mut seen[read], true) {
                    if read < self.unknowns { found += 1 } else { open.push(read) }
                }
            }
        }
        found
    }

    /// Puts variables in, from the outside in; of those on one level first what takes least.
    fn put_in_all(&mut self, variables: BTreeSet<usize>, order: &[usize]) -> Option<()> {
        let is_alias = |open: &Self, k: usize| open.forms[k].terms.len() <= 1 && open.forms[k].rest == ZERO;
        let place = |open: &Self, k: usize| {
            let level = if is_alias(open, k) { 0 } else { order[k] };
            (level, open.readers[k].len() * (open.forms[k].terms.len() + 1), k)
        };
        let mut places: FxHashMap<usize, (usize, usize, usize)> = FxHashMap::default();
        let mut queue = BTreeSet::new();
        for k in variables.into_iter().filter(|&k| !self.gone[k]) {
            places.insert(k, place(self, k));
            queue.insert(places[&k]);
        }
        while let Some((.., k)) = queue.pop_first() {
            if self.work > WORK * self.symbols.len() {
                return None;
            }
            places.remove(&k);
            self.settle(k);
            for touched in self.put_in(k) {
                let Some(before) = places.get_mut(&touched) else { continue };
                queue.remove(before);
                *before = place(self, touched);
                queue.insert(*before);
            }
        }
        Some(())
    }

    /// Leaves out what is zero and gives names to what is long.
    fn settle(&mut self, k: usize) {
        let (own, mut terms) = (self.symbols[k], std::mem::take(&mut self.forms[k].terms));
        terms.retain(|&j, e| {
            let zero = self.recognition.is_zero(self.x, *e);
            if zero {
                self.readers[j].remove(&k);
            } else if k >= self.unknowns || j != k {
                let by = self.symbols[j];
                *e = self.recognition.short(self.x, *e, NAMED, |x| x.gain(own, by));
            }
            !zero
        });
        let rest = self.forms[k].rest;
        // The name of the rest without unknowns is taken.
        let rest =
            if k < self.unknowns { rest } else { self.recognition.short(self.x, rest, NAMED, |x| x.gain(own, own)) };
        self.forms[k] = Form { terms, rest };
    }

    /// Turns the residual of an unknown into its definition.
    fn solve(&mut self, k: usize) -> Option<()> {
        self.settle(k);
        let own = self.symbols[k];
        let Form { mut terms, rest } =
            std::mem::replace(&mut self.forms[k], Form { terms: BTreeMap::new(), rest: ZERO });
        let pivot = terms.remove(&k)?;
        self.readers[k].remove(&k);
        let one = self.x.int(1);
        let inverse = self.x.div(one, pivot);
        let inverse = self.recognition.short(self.x, inverse, NAMED, |x| x.gain(own, own));
        let minus = self.x.neg(inverse);
        let right = self.value(&terms, rest);
        let right = self.x.neg(right);
        for (&j, e) in &mut terms {
            let by = self.symbols[j];
            let solved = self.x.mul(&[*e, minus]);
            *e = self.recognition.short(self.x, solved, NAMED, |x| x.loop_gain(own, by));
        }
        let rest = self.x.mul(&[rest, minus]);
        let rest = self.recognition.short(self.x, rest, NAMED, |x| x.bias(own));
        self.eliminated.push(Eliminated { unknown: own, pivot, right });
        self.forms[k] = Form { terms, rest };
        Some(())
    }

    /// Puts the form of a variable in wherever it is read. The variables whose forms, or whose readers, are others then.
    fn put_in(&mut self, k: usize) -> BTreeSet<usize> {
        self.gone[k] = true;
        let form = self.forms[k].clone();
        self.work += form.terms.len() * self.readers[k].len();
        let mut touched = std::mem::take(&mut self.readers[k]);
        for &row in &touched {
            let Some(factor) = self.forms[row].terms.remove(&k) else { continue };
            for (&j, &e) in &form.terms {
                let term = self.x.mul(&[factor, e]);
                let before = self.forms[row].terms.get(&j).copied().unwrap_or(ZERO);
                let sum = self.x.add(&[before, term]);
                if sum == ZERO {
                    self.forms[row].terms.remove(&j);
                    self.readers[j].remove(&row);
                } else {
                    self.forms[row].terms.insert(j, sum);
                    self.readers[j].insert(row);
                    self.deepen(row, self.depths[j]);
                }
            }
            let rest = self.x.mul(&[factor, form.rest]);
            self.forms[row].rest = self.x.add(&[self.forms[row].rest, rest]);
        }
        for &j in form.terms.keys() {
            self.readers[j].remove(&k);
            touched.insert(j);
        }
        touched
    }

    /// A variable reads another of this depth, and may be deeper than before.
    fn deepen(&mut self, k: usize, least: usize) {
        let mut open = vec![(k, least)];
        while let Some((k, least)) = open.pop() {
            if k >= self.unknowns && self.depths[k] <= least && least < self.symbols.len() {
                self.depths[k] = least + 1;
                open.extend(self.readers[k].iter().map(|&j| (j, least + 1)));
            }
        }
    }

    /// A form by the values of variables, of which it counts what the unknowns make of them.
    fn value(&mut self, terms: &BTreeMap<usize, Expr>, rest: Expr) -> Expr {
        let mut sum = vec![rest];
        for (&j, &e) in terms {
            let own = self.x.sym(self.symbols[j]);
            let moved = self.x.sub(own, self.rests[j]);
            sum.push(self.x.mul(&[e, moved]));
        }
        self.x.add(&sum)
    }

    /// The equations between the unknowns that are left, and these.
    fn rows_left(&mut self) -> (Vec<Row>, Vec<usize>) {
        let left: Vec<usize> = (0..self.unknowns).filter(|&k| !self.gone[k]).collect();
        let mut rows = Vec::with_capacity(left.len());
        for &k in &left {
            self.settle(k);
            let form = &self.forms[k];
            let place = |j: &usize| left.binary_search(j).expect("only these are left");
            rows.push((form.terms.iter().map(|(j, &e)| (place(j), e)).collect(), form.rest));
        }
        (rows, left)
    }

    fn finish(mut self, body: &[(Symbol, Expr)], rows: Vec<Row>, left: Vec<usize>) -> Option<Recursion> {
        let mut values: Vec<(Symbol, Expr)> = Vec::with_capacity(self.eliminated.len() + body.len());
        for k in (0..self.unknowns).filter(|&k| self.gone[k]).collect::<Vec<_>>() {
            let own = self.symbols[k];
            let Form { terms, rest } = self.forms[k].clone();
            let value = self.value(&terms, rest);
            values.push((own, value));
        }
        values.extend(body);
        let after = in_order(self.x, values)?;
        Some(Recursion { named: self.recognition.named, left, rows, eliminated: self.eliminated, after })
    }
}

/// The matrix of many unknowns at a few points, as the forms that make it up: it has as many entries as there are pairs of
/// unknowns, its products with vectors take no more than the forms.
struct Products {
    points: Vec<(Point, Coefficients)>,
}

impl Products {
    fn of(open: &Open, roots: &[Expr], steps: &[EquationStep]) -> Products {
        let at = |(number, parameters)| {
            let mut point = Point::new(open.x, number, parameters, roots, steps);
            let coefficients = open.coefficients(&mut point);
            (point, coefficients)
        };
        Products { points: PLACES.into_iter().map(at).collect() }
    }

    /// Whether the matrix is symmetric, and definite at the given parameters, by the pivots of the unknowns that were
    /// eliminated and the rows between those that are left. Rows may have either sign, which is that of their pivot: all
    /// pivots are positive then, and a symmetric matrix that has such pivots in any order is definite.
    fn are_of_a_definite_matrix(mut self, open: &Open, (rows, left): (&[Row], &[usize])) -> bool {
        if left.len() > MOST_LEFT {
            return false;
        }
        let (x, n) = (&*open.x, open.unknowns);
        let number_of: FxHashMap<Symbol, usize> = open.symbols[..n].iter().copied().zip(0..).collect();
        let mut all_signs: Option<Vec<f64>> = None;
        for (point, _) in self.points.iter_mut().filter(|p| p.0.has_given_parameters()) {
            open.recognition.named.iter().for_each(|&(name, e)| point.know(x, name, e));
            let mut signs = vec![1.0; n];
            for eliminated in &open.eliminated {
                let pivot = point.value(x, eliminated.pivot);
                if !(pivot.is_finite() && pivot != 0.0) {
                    return false;
                }
                signs[number_of[&eliminated.unknown]] = pivot.signum();
            }
            let mut matrix = vec![0.0; left.len() * left.len()];
            for (i, (row, _)) in rows.iter().enumerate() {
                row.iter().for_each(|&(j, e)| matrix[i * left.len() + j] = point.value(x, e));
                let sign = matrix[i * left.len() + i].signum();
                matrix[i * left.len()..(i + 1) * left.len()].iter_mut().for_each(|e| *e *= sign);
                signs[left[i]] = sign;
            }
            if !has_positive_pivots(left.len(), matrix) || all_signs.as_ref().is_some_and(|all| *all != signs) {
                return false;
            }
            all_signs = Some(signs);
        }
        let signs = all_signs.expect("parameters are given at some of the points");
        self.points
            .iter()
            .zip(0..)
            .all(|((_, coefficients), number)| is_symmetric_by_products(coefficients, &signs, number))
    }
}

/// Whether a matrix, given by what its forms make of each other, is symmetric where its rows have these signs: its products
/// with a vector from either side are the same.
fn is_symmetric_by_products(coefficients: &[Vec<(usize, f64)>], signs: &[f64], number: u64) -> bool {
    let (n, all) = (signs.len(), coefficients.len());
    let vector: Vec<f64> = (0..n).map(|k| scattered(number + 0x5e3d, k as u64)).collect();
    // From the right, with what rounding is measured by.
    let mut values: Vec<(f64, f64)> = vector.iter().map(|&v| (v, v)).collect();
    values.resize(all, (0.0, 0.0));
    let sum = |values: &[(f64, f64)], k: usize| {
        coefficients[k]
            .iter()
            .fold((0.0, 0.0), |(sum, size), &(j, e)| (sum + e * values[j].0, size + (e * values[j].1).abs()))
    };
    (n..all).for_each(|k| values[k] = sum(&values, k));
    let right: Vec<(f64, f64)> = (0..n).map(|k| sum(&values, k)).collect();
    // From the left: what each variable counts for in all residuals.
    let mut weights: Vec<(f64, f64)> = vec![(0.0, 0.0); all];
    let spread = |weights: &mut [(f64, f64)], k: usize, (own, size): (f64, f64)| {
        for &(j, e) in &coefficients[k] {
            weights[j].0 += e * own;
            weights[j].1 += (e * size).abs();
        }
    };
    (0..n).for_each(|k| spread(&mut weights, k, (signs[k] * vector[k], vector[k])));
    for k in (n..all).rev() {
        let own = weights[k];
        spread(&mut weights, k, own);
    }
    (0..n).all(|k| {
        let difference = signs[k] * right[k].0 - weights[k].0;
        difference.abs() <= ROUNDING * (right[k].1 + weights[k].1)
    })
}

/// Whether so many variables at most stand between some variables and the unknowns, and which of these and of what they read
/// stands before them: what turns with a body has other numbers in the axes of each of its joints, though there are but six.
/// `read` tells what a variable reads, none of an unknown. Source: K. Menger's theorem, by paths that share no variable.
fn shortest_cut(
    from: &BTreeSet<usize>,
    most: usize,
    read: impl Fn(usize) -> Option<Vec<usize>>,
) -> Option<BTreeSet<usize>> {
    // Where paths lead on from a variable, and where they come from; none at their ends.
    let mut next: FxHashMap<usize, Option<usize>> = FxHashMap::default();
    let mut before: FxHashMap<usize, Option<usize>> = FxHashMap::default();
    for paths in 0.. {
        // One more path, which may push others aside: it comes to a variable, and leaves it.
        let mut reached: FxHashMap<(usize, Step), Option<(usize, Step)>> = FxHashMap::default();
        let mut open: VecDeque<(usize, Step)> = VecDeque::new();
        for &start in from {
            reached.insert((start, Step::To), None);
            open.push_back((start, Step::To));
        }
        let mut end = None;
        while let Some(at) = open.pop_front() {
            if reached.len() > WIDEST {
                return None;
            }
            let mut go = |to: (usize, Step)| {
                if let Entry::Vacant(new) = reached.entry(to) {
                    new.insert(Some(at));
                    open.push_back(to);
                }
            };
            match at {
                (k, Step::To) => match before.get(&k) {
                    None => go((k, Step::From)),
                    Some(pushed) => pushed.iter().for_each(|&before| go((before, Step::From))),
                },
                (k, Step::From) => {
                    let taken = next.get(&k);
                    match read(k) {
                        None if taken.is_none() => {
                            end = Some(at);
                            break;
                        }
                        None => {}
                        Some(read) => {
                            read.into_iter().filter(|j| taken != Some(&Some(*j))).for_each(|j| go((j, Step::To)))
                        }
                    }
                    if taken.is_some() {
                        go((k, Step::To));
                    }
                }
            }
        }
        let Some(end) = end else {
            let behind = reached.into_keys().filter(|at| at.1 == Step::From).map(|at| at.0);
            return Some(behind.collect());
        };
        if paths == most {
            return None;
        }
        let mut way = vec![end];
        while let Some(at) = reached[&way[way.len() - 1]] {
            way.push(at);
        }
        way.reverse();
        before.insert(way[0].0, None);
        for step in way.windows(2) {
            match (step[0], step[1]) {
                ((k, Step::From), (j, Step::To)) if k == j => {
                    next.remove(&k);
                    before.remove(&k);
                }
                ((k, Step::From), (j, Step::To)) => {
                    next.insert(k, Some(j));
                    before.insert(j, Some(k));
                }
                _ => {}
            }
        }
        next.insert(end.0, None);
    }
    None
}

/// Whether a path comes to a variable or leaves it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Step {
    To,
    From,
}

/// What is reached from somewhere, step by step.
struct Reached {
    seen: FxHashSet<usize>,
    open: Vec<usize>,
    found: Vec<usize>,
}

impl Reached {
    fn from(start: usize) -> Reached {
        Reached { seen: FxHashSet::default(), open: vec![start], found: Vec::new() }
    }

    /// Goes on from one that was reached; whether there was one left.
    fn step(&mut self, next: impl FnOnce(usize, &mut Vec<usize>)) -> bool {
        let Some(from) = self.open.pop() else { return false };
        next(from, &mut self.found);
        self.open.extend(self.found.drain(..).filter(|&j| self.seen.insert(j)));
        true
    }

    /// All that is reached by what another search has reached.
    fn within(mut self, other: &Reached, next: impl Fn(usize, &mut Vec<usize>)) -> BTreeSet<usize> {
        let next = |from: usize, found: &mut Vec<usize>| {
            next(from, found);
            found.retain(|j| other.seen.contains(j));
        };
        while self.step(next) {}
        self.seen.into_iter().collect()
    }
}

/// Definitions, each behind those that it reads; `None` if they read each other.
fn in_order(x: &Exprs, values: Vec<(Symbol, Expr)>) -> Option<Vec<(Symbol, Expr)>> {
    let of: FxHashMap<Symbol, Expr> = values.iter().copied().collect();
    let mut done: FxHashMap<Symbol, bool> = FxHashMap::default();
    let mut ordered = Vec::with_capacity(values.len());
    for (symbol, _) in values {
        let mut open = vec![(symbol, false)];
        while let Some((symbol, read)) = open.pop() {
            let Some(&value) = of.get(&symbol) else { continue };
            if read {
                done.insert(symbol, true);
                ordered.push((symbol, value));
                continue;
            }
            match done.get(&symbol) {
                Some(true) => continue,
                // It waits for something that reads it.
                Some(false) => return None,
                None => {}
            }
            done.insert(symbol, false);
            open.push((symbol, true));
            open.extend(x.symbols_of(value).into_iter().filter(|s| done.get(s) != Some(&true)).map(|s| (s, false)));
        }
    }
    Some(ordered)
}

fn is_symmetric(n: usize, matrix: &[f64]) -> bool {
    let size = |k: usize| matrix[k * n + k].abs();
    (0..n).all(|i| {
        (0..i).all(|j| {
            let (a, b) = (matrix[i * n + j], matrix[j * n + i]);
            (a - b).abs() <= ROUNDING * (a.abs() + b.abs() + (size(i) * size(j)).sqrt())
        })
    })
}

/// Whether a symmetric matrix is definite; its lower half is read.
fn has_positive_pivots(n: usize, mut matrix: Vec<f64>) -> bool {
    let mut column = vec![0.0; n];
    for k in 0..n {
        let pivot = matrix[k * n + k];
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        (k + 1..n).for_each(|i| column[i] = matrix[i * n + k]);
        for i in k + 1..n {
            let factor = column[i] / pivot;
            if factor != 0.0 {
                let row = &mut matrix[i * n + k + 1..=i * n + i];
                row.iter_mut().zip(&column[k + 1..=i]).for_each(|(own, above)| *own -= factor * above);
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four numbers of two motions: two variables stand before the unknowns, in whatever way they are read.
    #[test]
    fn short_cuts_stand_behind_what_turns_with_a_body() {
        let reads: [&[usize]; 10] = [&[], &[], &[0], &[1, 0], &[2, 3], &[2, 3], &[2], &[3, 2], &[4, 7], &[5]];
        let read = |k: usize| (k > 1).then(|| reads[k].to_vec());
        let from = |all: &[usize]| all.iter().copied().collect::<BTreeSet<usize>>();
        let turning = from(&[4, 5, 6, 7]);
        assert_eq!(shortest_cut(&turning, 1, read), None);
        assert_eq!(shortest_cut(&turning, 2, read), Some(turning));
        // A way that is taken first gives way to another one.
        assert_eq!(shortest_cut(&from(&[7, 6]), 2, read), Some(BTreeSet::new()));
        assert_eq!(shortest_cut(&from(&[6, 8]), 2, read), Some(BTreeSet::new()));
        assert_eq!(shortest_cut(&from(&[6, 9]), 1, read), None);
        assert_eq!(shortest_cut(&from(&[6]), 1, read), Some(BTreeSet::new()));
    }

    /// Of `v = a + 2 b`, `w = 3 v` the residuals `5 a + w`, `9 b + 2 w`: `[[8, 6], [6, 21]]`, but for the signs of rows.
    #[test]
    fn products_tell_whether_a_matrix_is_symmetric() {
        let forms = |first: f64, second: f64| {
            vec![
                vec![(0, 5.0 * first), (3, first)],
                vec![(1, 9.0), (3, second)],
                vec![(0, 1.0), (1, 2.0)],
                vec![(2, 3.0)],
            ]
        };
        for number in 0..3 {
            assert!(is_symmetric_by_products(&forms(1.0, 2.0), &[1.0, 1.0], number));
            assert!(is_symmetric_by_products(&forms(-1.0, 2.0), &[-1.0, 1.0], number));
            assert!(!is_symmetric_by_products(&forms(-1.0, 2.0), &[1.0, 1.0], number));
            assert!(!is_symmetric_by_products(&forms(1.0, 2.000_001), &[1.0, 1.0], number));
        }
    }
}
