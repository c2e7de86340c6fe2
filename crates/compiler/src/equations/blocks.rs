//! From definitions to steps: order of evaluation, loops torn at few variables, linear ones recognised.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::algo::TarjanScc;
use petgraph::graph::DiGraph;
use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;

use super::definitions::{Definition, Definitions};
use super::forms::LinearForms;
use super::recursion::{Eliminated, Recursion, recursion};
use super::supports::{Supports, to_solve};
use super::symmetry::mirrored;
use super::{EquationStep, LinearBlock, NewtonBlock};
use crate::algebra::{Expr, Exprs, SparseRow, Symbol, ZERO};
use crate::bond_graph::{ElementId, Meaning};
use crate::causal_graph::{break_set::break_set, break_set::passed_over, rank_given};
use crate::sparse::{Pattern, SparseMatrix};

/// Steps between an unknown and its equation up to which its root is looked for in writing.
const SHORT_BODY: usize = 12;
/// Terms that may be formed in the search for short forms of the entries of a matrix.
const WORK: u64 = 1_000_000;
/// Entries that are written longer than this stay products of sums, as they come about.
const LONGEST: u64 = 600;

/// Loops with at most so many unknowns are left as they are torn.
pub(super) const FEW: usize = 32;
/// What is tried for the number of unknowns that a variable may read in a larger loop; the greatest of those that take the same
/// operations. Few make a sparse matrix, which tells how much the others may take.
const LONGEST_ROWS: [usize; 5] = [2, 4, 8, 16, usize::MAX];

/// A loop is gone through from its leaves where that takes less than this part of the operations: a matrix is read more easily,
const MUCH_FEWER: f64 = 0.75;
/// and of a loop with more unknowns than [`FEW`] where it takes less than this part.
const FEWER: f64 = 0.9;
/// Operations of a factorisation by indices take so many times as long as those that are written out.
const SPARSE: f64 = 2.0;
/// What the symmetry of a full matrix leaves of the operations of its factorisation.
const WRITTEN_OUT_SYMMETRIC: f64 = 0.5;

/// Matrices of so many rates are looked at for entries that mirror each other.
const MIRRORED: usize = 4;

/// Loops with more variables than this are not written out to see whether terms that are no linear forms cancel.
const WRITTEN_OUT: usize = 64;

/// A loop that has no unique solution, whatever the values are.
#[derive(Debug, Clone)]
pub struct Insoluble {
    /// The variables at which the loop is torn.
    pub unknowns: Vec<Symbol>,
    /// All variables of the loop.
    pub members: Vec<Symbol>,
    /// The elements concerned.
    pub elements: Vec<ElementId>,
}

/// Steps in order, and the linear equations that stand behind some of them: `Σ coefficient · unknown = right`.
#[derive(Debug, Clone, Default)]
pub struct Ordered {
    /// The steps.
    pub steps: Vec<EquationStep>,
    /// The rows of all linear blocks.
    pub rows: Vec<LinearRow>,
    /// Names for parts of these rows, with their values; steps define them.
    pub named: Vec<(Symbol, Expr)>,
}

/// One linear equation.
#[derive(Debug, Clone)]
pub struct LinearRow {
    /// Unknowns with their coefficients, zeros left out.
    pub left: Vec<(Symbol, Expr)>,
    /// Right-hand side.
    pub right: Expr,
}

/// Puts the definitions of `symbols` into evaluation order. Loops are preferably torn at the variables in `first`.
pub fn order(d: &mut Definitions, symbols: &[Symbol], first: &BTreeSet<Symbol>) -> Result<Ordered, Insoluble> {
    let mut ordered = Ordered { steps: Vec::with_capacity(symbols.len()), ..Ordered::default() };
    let mut zeros: BTreeMap<Symbol, Expr> = BTreeMap::new();
    let mut waiting: Vec<Component> = components(d, symbols);
    waiting.reverse();
    while let Some(component) = waiting.pop() {
        if put_in(d, &component, &zeros) && component.len() > 1 {
            waiting.extend(components(d, &component).into_iter().rev());
            continue;
        }
        match component[..] {
            [only] if is_direct(d, only) => {
                let mut value = d.of[&only].expr();
                if d.x.is_zero(value) {
                    value = ZERO;
                    zeros.insert(only, value);
                }
                ordered.steps.push(EquationStep::Assign { symbol: only, value });
            }
            _ => block(d, component.into_vec(), first, &mut ordered)?,
        }
    }
    Ok(ordered)
}

/// Puts in variables that vanish, as what a source of zero imposes does: what is multiplied by them is not there, and loops
/// through them are none. Whether any definition reads one.
fn put_in(d: &mut Definitions, symbols: &[Symbol], zeros: &BTreeMap<Symbol, Expr>) -> bool {
    let mut changed = false;
    for symbol in symbols.iter().filter(|_| !zeros.is_empty()) {
        let definition = d.of[symbol];
        if d.x.depends_on_any(definition.expr(), &|s| zeros.contains_key(&s)) {
            let value = d.x.substitute(definition.expr(), zeros);
            d.of.insert(*symbol, definition.with(value));
            changed = true;
        }
    }
    changed
}

/// Whether the definition of a symbol gives its value without reading it.
pub(super) fn is_direct(d: &Definitions, symbol: Symbol) -> bool {
    match d.of[&symbol] {
        Definition::Explicit(e) => !d.x.depends_on(e, symbol),
        Definition::Implicit(_) => false,
    }
}

/// Strongly connected components of the definitions, those that are read first.
pub(super) fn components(d: &Definitions, symbols: &[Symbol]) -> Vec<Component> {
    let graph = dependency_graph(&d.x, symbols, |s| d.of[&s].expr());
    let mut all = Vec::with_capacity(symbols.len());
    TarjanScc::new().run(&graph, |nodes| {
        let mut set: Component = nodes.iter().map(|&n| graph[n]).collect();
        set.sort_unstable();
        all.push(set);
    });
    all
}

/// Variables that depend on each other, or one alone.
pub(super) type Component = SmallVec<[Symbol; 2]>;

/// An edge from every symbol to each symbol that its expression reads.
fn dependency_graph(x: &Exprs, symbols: &[Symbol], expr: impl Fn(Symbol) -> Expr) -> DiGraph<Symbol, ()> {
    let mut graph = DiGraph::with_capacity(symbols.len(), 2 * symbols.len());
    let nodes: FxHashMap<Symbol, _> = symbols.iter().map(|&s| (s, graph.add_node(s))).collect();
    for (symbol, node) in symbols.iter().zip(graph.node_indices()) {
        for read in x.symbols_of(expr(*symbol)) {
            if let Some(&target) = nodes.get(&read) {
                graph.add_edge(node, target, ());
            }
        }
    }
    graph
}

/// Steps for variables that depend on each other.
fn block(
    d: &mut Definitions,
    symbols: Vec<Symbol>,
    first: &BTreeSet<Symbol>,
    ordered: &mut Ordered,
) -> Result<(), Insoluble> {
    for &symbol in &symbols {
        if let Some(&residual) = d.gentle.get(&symbol) {
            d.of.insert(symbol, Definition::Implicit(residual));
        }
    }
    let torn = tear(d, &symbols, first);
    let rest: Vec<Symbol> = symbols.iter().copied().filter(|s| !torn.contains(s)).collect();
    let body: Vec<(Symbol, Expr)> = components(d, &rest).into_iter().map(|c| (c[0], d.of[&c[0]].expr())).collect();
    let mut residuals = Vec::with_capacity(torn.len());
    for &t in &torn {
        residuals.push(match d.of[&t] {
            _ if d.written.contains_key(&t) => d.written[&t],
            Definition::Explicit(e) => {
                let own = d.x.sym(t);
                d.x.sub(own, e)
            }
            Definition::Implicit(e) => e,
        });
    }
    // A matrix that closes positions may be singular anywhere, and the start is to find its own way around that.
    let positions = torn.iter().any(|s| d.computed.contains(s));
    let of_rates = torn.iter().all(|s| first.contains(s));
    let inward =
        if of_rates && torn.len() >= MIRRORED { recursion(d, &torn, &body, &residuals, &ordered.steps) } else { None };
    let whole = torn.clone();
    let (torn, body, residuals) = kept_sparse(&mut d.x, torn, body, residuals);
    let forms = if positions { None } else { linear(&mut d.x, &torn, &body, &residuals) };
    let Some((named, mut rows)) = forms else {
        if let Some(root) = written_root(d, &torn, &body, &residuals).filter(|_| !positions) {
            ordered.assign(vec![(torn[0], root)]);
            ordered.assign(body);
            return Ok(());
        }
        let (inner, elements) = (body.clone(), elements_of(d, &symbols));
        ordered.steps.push(NewtonBlock { unknowns: torn, body: inner, residuals, elements }.into());
        ordered.assign(body);
        return Ok(());
    };
    let enough = if whole.len() <= FEW { MUCH_FEWER } else { FEWER };
    if let Some(inward) = inward
        && inward.operations(&d.x) < enough * operations(&d.x, &named, &rows, &[])
    {
        return recursive(d, &whole, inward, (&symbols, first), ordered);
    }
    if of_rates && (MIRRORED..=FEW).contains(&torn.len()) {
        mirrored(&mut d.x, &mut rows, &named, &ordered.steps);
    }
    ordered.named.extend(&named);
    ordered.assign(named);
    solve_rows(d, torn, rows, &symbols, ordered)?;
    ordered.assign(body);
    Ok(())
}

/// The root of one equation in one unknown, if it can be written down and has a value everywhere: that of resistances in a row
/// whose laws are alike.
fn written_root(d: &mut Definitions, torn: &[Symbol], body: &[(Symbol, Expr)], residuals: &[Expr]) -> Option<Expr> {
    let &[unknown] = torn else { return None };
    if body.len() > SHORT_BODY {
        return None;
    }
    let residual = substituted(&mut d.x, body, residuals)[0];
    d.solve_for(residual, unknown).filter(|&root| d.x.total(root))
}

/// Steps that solve linear equations, coefficients by the places of their unknowns and the rest. `members`: all variables of
/// the loop.
fn solve_rows(
    d: &mut Definitions,
    unknowns: Vec<Symbol>,
    rows: Vec<Row>,
    members: &[Symbol],
    ordered: &mut Ordered,
) -> Result<(), Insoluble> {
    let elements = elements_of(d, members);
    let x = &mut d.x;
    let (matrix, right) = shortened(x, rows);
    if is_singular(x, &matrix) {
        return Err(Insoluble { unknowns, members: members.to_vec(), elements });
    }
    for (row, &right) in matrix.rows().zip(&right) {
        let left = row.map(|(k, &e)| (unknowns[k], e)).collect();
        ordered.rows.push(LinearRow { left, right });
    }
    match (matrix.entries(), &right[..], &unknowns[..]) {
        (&[pivot], [right], [unknown]) => {
            if !x.nonzero(pivot) {
                ordered.steps.push(EquationStep::Guard { pivot, elements });
                x.assume_nonzero(pivot);
            }
            let value = x.div(*right, pivot);
            ordered.steps.push(EquationStep::Assign { symbol: *unknown, value });
        }
        _ => ordered.steps.push(LinearBlock { unknowns, matrix, right, elements }.into()),
    }
    Ok(())
}

/// Operations to evaluate these rows of a symmetric loop and to solve them, with all that they and `others` need.
pub(super) fn operations(x: &Exprs, named: &[(Symbol, Expr)], rows: &[Row], others: &[Expr]) -> f64 {
    let mut roots = others.to_vec();
    rows.iter().for_each(|(row, rest)| roots.extend(row.iter().map(|e| e.1).chain([*rest])));
    let values: FxHashMap<Symbol, Expr> = named.iter().copied().collect();
    let mut seen: FxHashSet<Symbol> = FxHashSet::default();
    let mut open = roots.clone();
    while let Some(e) = open.pop() {
        let new = x.symbols_of(e).into_iter().filter(|&s| seen.insert(s)).filter_map(|s| values.get(&s));
        let before = roots.len();
        roots.extend(new);
        open.extend_from_slice(&roots[before..]);
    }
    let pattern = Pattern::new(rows.iter().map(|row| row.0.iter().map(|e| e.0)));
    let weight = if pattern.size() > FEW { SPARSE } else { WRITTEN_OUT_SYMMETRIC };
    x.cost(&roots).total() as f64 + weight * to_solve(&pattern) as f64
}

/// Steps of a loop that is gone through from its leaves.
fn recursive(
    d: &mut Definitions,
    torn: &[Symbol],
    found: Recursion,
    (members, first): (&[Symbol], &BTreeSet<Symbol>),
    ordered: &mut Ordered,
) -> Result<(), Insoluble> {
    let Recursion { named, left, mut rows, eliminated, after } = found;
    let unknowns: Vec<Symbol> = left.iter().map(|&k| torn[k]).collect();
    if (MIRRORED..=FEW).contains(&unknowns.len()) {
        mirrored(&mut d.x, &mut rows, &named, &ordered.steps);
    }
    ordered.named.extend(&named);
    ordered.assign(named);
    for Eliminated { unknown, pivot, right } in eliminated {
        if !d.x.nonzero(pivot) {
            let elements = elements_of(d, &[d.x.undotted(unknown).0]);
            ordered.steps.push(EquationStep::Guard { pivot, elements });
            d.x.assume_nonzero(pivot);
        }
        ordered.rows.push(LinearRow { left: vec![(unknown, pivot)], right });
    }
    if !unknowns.is_empty() {
        solve_rows(d, unknowns, rows, members, ordered)?;
    }
    // Motions further in stand in the equations of many rates.
    ordered.named.extend(after.iter().filter(|v| !first.contains(&v.0)));
    ordered.assign(after);
    Ok(())
}

/// Unknowns, definitions of other variables in order, and residuals.
type Loop = (Vec<Symbol>, Vec<(Symbol, Expr)>, Vec<Expr>);

/// Few unknowns make a full matrix: where a loop has many, variables that read too many of them become unknowns too, as far
/// as that takes fewer operations.
fn kept_sparse(x: &mut Exprs, torn: Vec<Symbol>, body: Vec<(Symbol, Expr)>, residuals: Vec<Expr>) -> Loop {
    if torn.len() <= FEW {
        return (torn, body, residuals);
    }
    let mut best: Option<(u64, Supports)> = None;
    for longest in LONGEST_ROWS {
        let plan = Supports::of(x, &torn, &body, &residuals, longest);
        let most = best.as_ref().map_or(u64::MAX, |best| best.0);
        if let Some(operations) = plan.operations(most) {
            best = Some((operations, plan));
        }
    }
    let (_, best) = best.expect("the first takes no more than any number");
    let mut whole = (torn, Vec::with_capacity(body.len()), residuals);
    for (symbol, value) in body {
        if best.unknown.contains_key(&symbol) {
            let own = x.sym(symbol);
            whole.0.push(symbol);
            whole.2.push(x.sub(own, value));
        } else {
            whole.1.push((symbol, value));
        }
    }
    whole
}

/// Names for parts, each with its value.
type Named = Vec<(Symbol, Expr)>;
/// The coefficients of unknowns that are not 0, and the rest.
pub(super) type Row = (Vec<(usize, Expr)>, Expr);

/// The residuals of a loop as linear forms in its unknowns, coefficients and rest, with names for parts of them; `None` if
/// they are none, be it that terms which are no linear forms cancel.
fn linear(x: &mut Exprs, torn: &[Symbol], body: &[(Symbol, Expr)], residuals: &[Expr]) -> Option<(Named, Vec<Row>)> {
    if let Some(found) = as_forms(x, torn, body, residuals) {
        return Some(found);
    }
    if body.len() > WRITTEN_OUT {
        return None;
    }
    let flat = substituted(x, body, residuals);
    let row = |(terms, rest): (BTreeMap<usize, Expr>, Expr)| (terms.into_iter().collect(), rest);
    let rows: Option<Vec<Row>> = flat.iter().map(|&r| x.sparse_linear_in(r, torn).map(row)).collect();
    Some((Vec::new(), rows?))
}

/// The same where every variable of the loop is a linear form.
fn as_forms(x: &mut Exprs, torn: &[Symbol], body: &[(Symbol, Expr)], residuals: &[Expr]) -> Option<(Named, Vec<Row>)> {
    let forms = LinearForms::new(x, torn, body)?;
    let mut rows = Vec::with_capacity(residuals.len());
    for &residual in residuals {
        let form = forms.of_expr(x, residual)?;
        rows.push((form.coefficients.into_iter().collect(), form.rest));
    }
    Some((forms.named, rows))
}

/// Rows of coefficients with their right sides, each in its short form, as far as the work for each goes.
fn shortened(x: &mut Exprs, rows: Vec<Row>) -> (SparseMatrix<Expr>, Vec<Expr>) {
    let work = WORK / rows.iter().map(|row| row.0.len() as u64).sum::<u64>().max(1);
    let (mut matrix, mut right) = (Vec::with_capacity(rows.len()), Vec::with_capacity(rows.len()));
    for (row, rest) in rows {
        let row = row.into_iter().map(|(k, e)| (k, short(x, e, work)));
        matrix.push(row.collect::<Vec<_>>());
        let minus = x.neg(rest);
        right.push(short(x, minus, work));
    }
    x.bound_search(u64::MAX);
    matrix.iter_mut().for_each(|row| row.retain(|e| !x.is_zero(e.1)));
    (SparseMatrix::new(matrix), right)
}

/// The expression as it came about or multiplied out, whichever is shorter; rather one that is known to be nonzero.
fn short(x: &mut Exprs, e: Expr, work: u64) -> Expr {
    x.bound_search(work);
    let own = x.simplify(e);
    if x.written_length(own) > LONGEST {
        return own;
    }
    let flat = x.expand(e);
    let flat = x.simplify(flat);
    let cost = |e| (!x.is_known_nonzero(e), x.written_length(e));
    if cost(flat) < cost(own) { flat } else { own }
}

impl Ordered {
    fn assign(&mut self, body: Vec<(Symbol, Expr)>) {
        self.steps.extend(body.into_iter().map(|(symbol, value)| EquationStep::Assign { symbol, value }));
    }
}

/// The variables at which a loop is torn: all that have no value of their own, be it that their law cannot be inverted
/// or that its inverse may end where Newton looks; then preferred ones, then a minimum set of the others.
pub(super) fn tear(d: &Definitions, symbols: &[Symbol], first: &BTreeSet<Symbol>) -> Vec<Symbol> {
    let looked_for = |s: &Symbol| matches!(d.of[s], Definition::Implicit(_)) || d.written.contains_key(s);
    let mut torn: BTreeSet<Symbol> = symbols.iter().copied().filter(looked_for).collect();
    for preferred in [true, false] {
        let open: Vec<Symbol> = symbols.iter().copied().filter(|s| !torn.contains(s)).collect();
        for component in components(d, &open) {
            if component.len() == 1 && is_direct(d, component[0]) {
                continue;
            }
            if preferred {
                torn.extend(component.iter().filter(|s| first.contains(s)));
            } else {
                torn.extend(break_variables(d, &component));
            }
        }
    }
    torn.into_iter().collect()
}

/// A minimum set of variables that meets every loop of a component: of those of laws, as far as the variables of junctions
/// between them are few.
fn break_variables(d: &Definitions, component: &[Symbol]) -> Vec<Symbol> {
    let index: BTreeMap<Symbol, usize> = component.iter().enumerate().map(|(i, &s)| (s, i)).collect();
    let successors: Vec<Vec<u32>> = component
        .iter()
        .map(|s| d.x.symbols_of(d.of[s].expr()).iter().filter_map(|r| index.get(r).map(|&i| i as u32)).collect())
        .collect();
    let successors = passed_over(&successors, |i| !d.of_laws.contains(&component[i]));
    let rank = vec![0; component.len()];
    break_set(&successors, &rank).vertices.into_iter().map(|i| component[i]).collect()
}

/// Expressions with the body put in.
pub fn substituted(x: &mut Exprs, body: &[(Symbol, Expr)], exprs: &[Expr]) -> Vec<Expr> {
    let mut known: BTreeMap<Symbol, Expr> = BTreeMap::new();
    for &(symbol, value) in body {
        let value = x.substitute(value, &known);
        known.insert(symbol, value);
    }
    exprs.iter().map(|&e| x.substitute(e, &known)).collect()
}

/// Whether the determinant vanishes for all values or at the given parameters.
pub fn is_singular(x: &mut Exprs, matrix: &SparseMatrix<Expr>) -> bool {
    let n = matrix.size();
    if n > 8 {
        return false; // left to the pivots of the run
    }
    let full: Vec<Vec<Expr>> = matrix.dense(ZERO).chunks(n).map(<[Expr]>::to_vec).collect();
    if x.is_regular_given(&full) {
        return false;
    }
    let before = x.assumed();
    let rows = matrix.rows().map(|row| row.map(|(k, &e)| (k, e)).filter(|e| !x.is_zero_given(e.1)).collect());
    let rows: Vec<SparseRow> = rows.map(SparseRow).collect();
    let singular = rank_given(x, n, rows) < n;
    if !singular {
        // A run chooses its own pivots.
        x.suppose(before);
    }
    singular
}

/// The elements whose efforts, flows or stored quantities these are, junctions left out.
pub fn elements_of(d: &Definitions, symbols: &[Symbol]) -> Vec<ElementId> {
    let mut elements = BTreeSet::new();
    for &symbol in symbols {
        let port = |p: crate::bond_graph::PortRef| (!d.graph.elements[p.element].kind.is_inner()).then_some(p.element);
        match d.meaning(symbol) {
            Some(Meaning::Effort(bond) | Meaning::Flow(bond)) => {
                let bond = &d.graph.bonds[bond];
                elements.extend([bond.from, bond.to].into_iter().filter_map(port));
            }
            Some(Meaning::Stored(p)) => {
                elements.insert(p.element);
            }
            _ => {}
        }
    }
    elements.into_iter().collect()
}
