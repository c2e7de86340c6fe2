//! The equations as a textbook shows them: everything put in that can be, until only states are left.

use std::collections::{BTreeMap, BTreeSet};

use super::named::{named_page, wide_blocks};
use super::vectors::{Strands, Vectors, vectors};
use crate::algebra::{Expr, Exprs, Node, Symbol};
use crate::bond_graph::{BondGraph, Named};
use crate::equations::{
    CLOSED, Definitions, EquationStep, Equations, LinearBlock, LinearRow, NewtonBlock, Ordered, State, expansions,
    named_sources, put_in, substituted,
};
use crate::unit::Unit;

/// Up to this many steps everything is put in, if that is short; above, names stay.
const SMALL: usize = 2_000;
/// Terms that may be formed in the search for the form with everything put in.
const TEXTBOOK: u64 = 400_000;
/// A side of an equation that is longer in print than this does not fit a page of a textbook: names stay.
pub(super) const LONGEST: u64 = 600;

/// Equations with what a textbook would print of them.
#[derive(Debug, Clone)]
pub struct Shown {
    /// The equations; their pool holds the expressions of this too.
    pub equations: Equations,
    /// One equation for each state, then what stays implicit.
    pub display: Vec<DisplayEquation>,
    /// Equations of these that are alike for the strands of a multibond, as people write them.
    pub vectors: Vectors,
    /// Each dependent storage with its co-energy variable as a combination of independent ones: its row of `S`.
    pub dependent: Vec<Dependent>,
    /// Sources, and states with a constant, that stand in `display` by name, with their values.
    pub sources: Vec<(Symbol, Expr)>,
    /// Names that outputs or `let`s give to states.
    pub aliases: BTreeMap<Symbol, String>,
    /// Where the equations would be too long: names that stand in them, each with what it stands for, in variables and
    /// in names before it.
    pub definitions: Vec<ShownDefinition>,
}

/// A name for a part of equations.
#[derive(Debug, Clone, Copy)]
pub struct ShownDefinition {
    /// The name: a variable of the bond graph, or one of its own.
    pub symbol: Symbol,
    /// What it stands for, with sources that vary in time as symbols.
    pub value: Expr,
    /// The same with the values of these sources put in.
    pub closed: Expr,
    /// Whether only dependent storages need it, and no equation.
    pub of_dependent: bool,
}

/// An equation for people: `left = right`.
#[derive(Debug, Clone, Copy)]
pub struct DisplayEquation {
    /// Left side.
    pub left: Expr,
    /// Right side, with sources that vary in time as symbols.
    pub right: Expr,
    /// Both sides with the values of these sources put in.
    pub closed: (Expr, Expr),
}

/// A storage whose co-energy variable follows from others.
#[derive(Debug, Clone, Copy)]
pub struct Dependent {
    /// Its co-energy variable.
    pub variable: Symbol,
    /// What it follows from, with everything put in that can be.
    pub value: Expr,
}

/// The equations for people, with everything put in that can be. Apart from [`derive_equations`](crate::equations::derive_equations)
/// since to run a model takes none of it.
pub fn show(mut equations: Equations) -> Shown {
    let mut d = Definitions::new(std::mem::take(&mut equations.graph.exprs), &equations.graph);
    d.of = std::mem::take(&mut equations.definitions);
    d.free.extend(equations.free_rates.iter().chain(equations.algebraic.iter().map(|a| &a.symbol)));
    let ordered = Ordered {
        steps: std::mem::take(&mut equations.steps),
        rows: std::mem::take(&mut equations.rows),
        named: Vec::new(),
    };
    let Page { display, dependent, sources, aliases, definitions } = page(&mut d, &equations, &ordered);
    let Definitions { x, of, .. } = d;
    equations.graph.exprs = x;
    equations.definitions = of;
    Ordered { steps: equations.steps, rows: equations.rows, .. } = ordered;
    let vectors = Vectors::default();
    Shown { equations, display, vectors, dependent, sources, aliases, definitions }.with_vectors()
}

impl Shown {
    /// The same with the vectors of these equations.
    pub(super) fn with_vectors(mut self) -> Shown {
        let equations = &mut self.equations;
        let strands = Strands::of(&equations.graph, &equations.states, &self.sources, &self.aliases);
        self.vectors = vectors(&mut equations.graph.exprs, &strands, &self.display);
        self
    }
}

/// What is printed; see [`Shown`].
pub struct Page {
    pub display: Vec<DisplayEquation>,
    pub dependent: Vec<Dependent>,
    pub sources: Vec<(Symbol, Expr)>,
    pub aliases: BTreeMap<Symbol, String>,
    pub definitions: Vec<ShownDefinition>,
}

/// Everything put in, if that takes little work and fits a page; else parts keep names.
fn page(d: &mut Definitions, equations: &Equations, ordered: &Ordered) -> Page {
    d.x.bound_search(TEXTBOOK);
    let page = match textbook_page(d, equations, ordered) {
        Some(page) => page,
        None => named_page(d, equations, ordered),
    };
    d.x.bound_search(u64::MAX);
    page
}

/// The shorter page: in the states alone, or with names that the modeller gave to a state and a constant.
fn textbook_page(d: &mut Definitions, equations: &Equations, ordered: &Ordered) -> Option<Page> {
    if ordered.steps.len() > SMALL || !wide_blocks(equations, &ordered.steps).is_empty() {
        return None;
    }
    let plain = page_with(d, equations, ordered, &BTreeMap::new())?;
    let explicit = equations.residuals.is_empty();
    let names = if explicit { shifted_states(d, &equations.states) } else { Vec::new() };
    if names.is_empty() {
        return Some(plain);
    }
    let shifts = names.iter().map(|n| (n.state, n.by_name)).collect();
    let Some(mut by_name) = page_with(d, equations, ordered, &shifts) else { return Some(plain) };
    by_name.sources.extend(names.iter().map(|n| (n.name, n.value)));
    for (equation, plain) in by_name.display.iter_mut().zip(&plain.display) {
        equation.closed = plain.closed;
    }
    Some(if length(d, &by_name) < length(d, &plain) { by_name } else { plain })
}

/// The page with these expressions in place of states; `None` if it takes too much work or does not fit.
fn page_with(
    d: &mut Definitions,
    equations: &Equations,
    ordered: &Ordered,
    shifts: &BTreeMap<Symbol, Expr>,
) -> Option<Page> {
    let states = &equations.states;
    let rates: BTreeSet<Symbol> = states.iter().map(|s| s.rate).collect();
    let named = named_sources(d);
    let mut known = expansions(d, &ordered.steps, &rates, &named)?;
    let aliases = aliases(d, states, &known);
    if !shifts.is_empty() {
        known.values_mut().for_each(|value| *value = d.x.substitute(*value, shifts));
        known.extend(shifts);
    }
    let mut display = self::equations(d, states, ordered, &known)?;
    let mut unknown: Vec<Symbol> = states.iter().map(|s| s.rate).collect();
    unknown.extend(equations.algebraic.iter().map(|a| a.symbol));
    for &residual in &equations.residuals {
        let residual = put_in(&mut d.x, residual, &known);
        display.push(balanced(&mut d.x, residual, &unknown));
    }
    if !fits(d, &display) {
        return None;
    }
    let mut read = BTreeSet::new();
    for equation in &mut display {
        read.extend(d.x.symbols_of(equation.left));
        read.extend(d.x.symbols_of(equation.right));
        equation.closed = (d.x.substitute(equation.left, &named), d.x.substitute(equation.right, &named));
    }
    let mut dependent = Vec::with_capacity(equations.dependent.len());
    for &variable in &equations.dependent {
        if let Some(row) = d.of.get(&variable).map(|f| f.expr()) {
            let value = put_in_shown(&mut d.x, row, &known);
            read.extend(d.x.symbols_of(value));
            dependent.push(Dependent { variable, value });
        }
    }
    let sources = named.into_iter().filter(|(s, _)| read.contains(s)).collect();
    Some(Page { display, dependent, sources, aliases, definitions: Vec::new() })
}

/// Whether the search for short forms came to its end, and no equation is too long.
fn fits(d: &Definitions, display: &[DisplayEquation]) -> bool {
    let short = |e: Expr| d.x.printed_length(e) <= LONGEST;
    !d.x.search_is_over() && display.iter().all(|e| short(e.left) && short(e.right))
}

/// How long it all is in print.
fn length(d: &Definitions, shown: &Page) -> u64 {
    let sides = shown.display.iter().flat_map(|e| [e.left, e.right]);
    let values = shown.sources.iter().map(|s| s.1).chain(shown.dependent.iter().map(|s| s.value));
    sides.chain(values).map(|e| d.x.printed_length(e)).sum()
}

/// A name that the modeller gave to a state and a constant.
struct Shifted {
    name: Symbol,
    value: Expr,
    state: Symbol,
    /// The state by that name.
    by_name: Expr,
}

/// `let`s and outputs that are a state and a constant: `x = spring.q + rest`.
fn shifted_states(d: &mut Definitions, states: &[State]) -> Vec<Shifted> {
    let mut found: Vec<Shifted> = Vec::new();
    for named in d.graph.lets.iter().chain(outputs_with_unit(d)) {
        let symbols = d.x.symbols_of(named.value);
        let is_state = |symbol: &Symbol| states.iter().find(|state| state.symbol == *symbol);
        let Some(of) = symbols.iter().find_map(is_state) else { continue };
        let state = of.symbol;
        if !is_in_unit_of(named, of) {
            continue;
        }
        let own = d.x.sym(state);
        let constant = d.x.sub(named.value, own);
        let fresh = d.x.find_symbol(&named.name).is_none_or(|s| d.meaning(s).is_none());
        if d.is_constant(constant) && !d.x.is_zero(constant) && fresh && found.iter().all(|f| f.state != state) {
            let name = d.x.symbol(&named.name, Default::default());
            let by_name = d.x.sym(name);
            let by_name = d.x.sub(by_name, constant);
            found.push(Shifted { name, value: named.value, state, by_name });
        }
    }
    found
}

/// Outputs and `let`s that are nothing but a state, in its unit.
pub fn aliases(d: &mut Definitions, states: &[State], known: &BTreeMap<Symbol, Expr>) -> BTreeMap<Symbol, String> {
    let mut aliases = BTreeMap::new();
    for named in outputs_with_unit(d).chain(&d.graph.lets) {
        let value = d.x.substitute(named.value, known);
        if let &Node::Symbol(symbol) = d.x.node(value)
            && let Some(state) = states.iter().find(|s| s.symbol == symbol)
            && is_in_unit_of(named, state)
        {
            aliases.entry(symbol).or_insert_with(|| named.name.clone());
        }
    }
    aliases
}

/// Outputs that may give their name to a state: one without a unit does not say what its numbers are.
fn outputs_with_unit<'a>(d: &Definitions<'a>) -> impl Iterator<Item = &'a Named> + use<'a> {
    let graph: &'a BondGraph = d.graph;
    graph.outputs.iter().filter(|output| output.unit_is_written)
}

/// Whether numbers of the one are numbers of the other: a state is shown in SI units.
fn is_in_unit_of(named: &Named, state: &State) -> bool {
    let fits = |unit: &Unit| unit.is_si() && state.unit.as_ref().is_none_or(|own| own.dimension == unit.dimension);
    named.unit.as_ref().is_none_or(fits)
}

fn equations(
    d: &mut Definitions,
    states: &[State],
    ordered: &Ordered,
    known: &BTreeMap<Symbol, Expr>,
) -> Option<Vec<DisplayEquation>> {
    let rates: BTreeSet<Symbol> = states.iter().map(|s| s.rate).collect();
    let mut shown = Vec::new();
    let rows = ordered.rows.iter().filter(|r| r.left.iter().any(|t| rates.contains(&t.0)));
    let by_row: BTreeMap<Symbol, &LinearRow> = assign_rows(rows, &rates);
    for state in states {
        let shown_as = match by_row.get(&state.rate) {
            Some(row) => from_row(&mut d.x, row, known),
            None if d.free.contains(&state.rate) => continue,
            None => {
                let left = d.x.sym(state.rate);
                let value = d.of.get(&state.rate).map(|f| f.expr()).unwrap_or(left);
                let right = put_in_shown(&mut d.x, value, known);
                equation(left, right)
            }
        };
        shown.push(shown_as);
        if !fits(d, &shown[shown.len() - 1..]) {
            return None;
        }
    }
    let mut implicit = Vec::new();
    for step in &ordered.steps {
        match step {
            EquationStep::Newton(block) => {
                let NewtonBlock { residuals, body, .. } = &**block;
                let inner = substituted(&mut d.x, body, residuals);
                let zero = d.x.int(0);
                for residual in inner {
                    let left = put_in_shown(&mut d.x, residual, known);
                    implicit.push(equation(left, zero));
                }
            }
            EquationStep::Linear(block)
                if block.unknowns.len() > CLOSED && !block.unknowns.iter().any(|u| rates.contains(u)) =>
            {
                let LinearBlock { unknowns, matrix, right, .. } = &**block;
                for (row, &right) in matrix.rows().zip(right) {
                    let left = row.map(|(k, &e)| (unknowns[k], e)).collect();
                    implicit.push(from_row(&mut d.x, &LinearRow { left, right }, known));
                }
            }
            _ => {}
        }
    }
    // What stays implicit is shown only if the equations of the states read it.
    let mut read: BTreeSet<Symbol> = shown.iter().flat_map(|e| d.x.symbols_of(e.right)).collect();
    let mut waiting = implicit;
    loop {
        let (now, later): (Vec<_>, Vec<_>) = waiting
            .into_iter()
            .partition(|e| d.x.symbols_of(e.left).iter().any(|s| read.contains(s) && d.of.contains_key(s)));
        waiting = later;
        if now.is_empty() {
            return Some(shown);
        }
        for equation in now {
            read.extend(d.x.symbols_of(equation.left));
            read.extend(d.x.symbols_of(equation.right));
            shown.push(equation);
        }
    }
}

/// For each state rate the row of its block that shows it best: the one whose position it has.
pub fn assign_rows<'a>(
    rows: impl Iterator<Item = &'a LinearRow>,
    rates: &BTreeSet<Symbol>,
) -> BTreeMap<Symbol, &'a LinearRow> {
    let mut assigned: BTreeMap<Symbol, &LinearRow> = BTreeMap::new();
    let mut left_over = Vec::new();
    for row in rows {
        let free = row.left.iter().map(|t| t.0).find(|s| rates.contains(s) && !assigned.contains_key(s));
        match free {
            Some(symbol) => {
                assigned.insert(symbol, row);
            }
            None => left_over.push(row),
        }
    }
    assigned
}

/// A row without what both sides have in common, with the denominators of its coefficients multiplied out if that is
/// shorter.
fn from_row(x: &mut Exprs, row: &LinearRow, known: &BTreeMap<Symbol, Expr>) -> DisplayEquation {
    let mut sides: Vec<Expr> = Vec::with_capacity(row.left.len() + 1);
    for e in row.left.iter().map(|t| t.1).chain([row.right]) {
        sides.push(put_in(x, e, known));
    }
    let symbols: Vec<Symbol> = row.left.iter().map(|t| t.0).collect();
    from_sides(x, &symbols, sides)
}

/// `Σ side · symbol = last side`; see [`from_row`].
pub fn from_sides(x: &mut Exprs, symbols: &[Symbol], mut sides: Vec<Expr>) -> DisplayEquation {
    let plain = shortest_sides(x, &sides);
    for k in 0..symbols.len() {
        let below = x.denominator(sides[k]);
        sides = sides.into_iter().map(|e| x.mul(&[e, below])).collect();
    }
    let whole = shortest_sides(x, &sides);
    let length = |sides: &[Expr]| sides.iter().map(|&e| x.printed_length(e)).sum::<u64>();
    let sides = if length(&whole) <= length(&plain) + 4 { whole } else { plain };
    gathered(x, symbols, &sides)
}

/// The equation of symbols with their coefficients, the last side being what they add up to.
pub(super) fn gathered(x: &mut Exprs, symbols: &[Symbol], sides: &[Expr]) -> DisplayEquation {
    let mut left = Vec::with_capacity(symbols.len());
    for (&symbol, &coefficient) in symbols.iter().zip(sides) {
        let symbol = x.sym(symbol);
        left.push(x.mul(&[coefficient, symbol]));
    }
    let left = x.add(&left);
    equation(left, sides[symbols.len()])
}

fn shortest_sides(x: &mut Exprs, sides: &[Expr]) -> Vec<Expr> {
    let common = x.common_factor(sides);
    let divided: Vec<Expr> = sides.iter().map(|&e| x.div(e, common)).collect();
    divided.into_iter().map(|e| textbook(x, e)).collect()
}

pub fn equation(left: Expr, right: Expr) -> DisplayEquation {
    DisplayEquation { left, right, closed: (left, right) }
}

/// What vanishes, with the terms of the unknowns on the left.
fn balanced(x: &mut Exprs, residual: Expr, unknown: &[Symbol]) -> DisplayEquation {
    let zero = x.int(0);
    let Some((coefficients, rest)) = x.linear_in(residual, unknown) else { return equation(zero, residual) };
    let mut terms = Vec::new();
    for (&coefficient, &symbol) in coefficients.iter().zip(unknown) {
        let (coefficient, symbol) = (textbook(x, coefficient), x.sym(symbol));
        terms.push(x.mul(&[coefficient, symbol]));
    }
    let left = x.add(&terms);
    let right = x.neg(rest);
    let right = textbook(x, right);
    if left == zero { equation(zero, rest) } else { equation(left, right) }
}

pub fn put_in_shown(x: &mut Exprs, e: Expr, known: &BTreeMap<Symbol, Expr>) -> Expr {
    let e = put_in(x, e, known);
    textbook(x, e)
}

pub fn textbook(x: &mut Exprs, e: Expr) -> Expr {
    let e = x.textbook(e);
    x.without_idle_terms(e)
}
