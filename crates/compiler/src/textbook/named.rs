//! Equations that do not fit a page of a textbook: what stands in them more than once keeps its name in the bond graph,
//! or gets one of its own, and its definition is listed.

use std::collections::{BTreeMap, BTreeSet};

use super::display::{
    Dependent, DisplayEquation, Page, ShownDefinition, aliases, assign_rows, equation, from_sides, gathered,
    put_in_shown,
};
use crate::algebra::{Expr, Exprs, Node, ONE, Shared, Symbol};
use crate::equations::{
    Definitions, EquationStep, Equations, LinearBlock, LinearRow, NewtonBlock, Ordered, named_sources, put_in,
};
use crate::ids::Map;

/// Terms that may be formed in the search for short forms of all equations and definitions together.
const WORK: u64 = 400_000;
/// What is longer in print is not searched for a shorter form as a whole.
const SEARCHED: u64 = 300;
/// A variable whose value is no longer in print than this gives way to it wherever it stands.
const SHORT: u64 = 12;

/// The page with names.
pub fn named_page(d: &mut Definitions, equations: &Equations, ordered: &Ordered) -> Page {
    let named = named_sources(d);
    let open_rows = OpenRows::of(d, equations, ordered, &named);
    let mut names = FreshNames::of(d);
    let Kept { known, mut definitions } = kept(d, equations, &open_rows, &mut names);
    let aliases = aliases(d, &equations.states, &known);
    let mut exprs: Vec<Expr> = open_rows.exprs();
    exprs.extend(definitions.iter().map(|d| d.1));
    let exprs = d.x.substitute_all(&exprs, &known);
    let share = WORK / (exprs.len() as u64 + 1);
    let Shared { roots, definitions: parts } =
        d.x.share(&exprs, &mut |x| names.next(x), &mut |x, e| shortened(x, e, share));
    let (roots, values) = roots.split_at(open_rows.exprs().len());
    definitions.iter_mut().zip(values).for_each(|(definition, &value)| definition.1 = value);
    let mut all = in_order(d, parts, definitions);
    for definition in &mut all {
        definition.1 = shortened(&mut d.x, definition.1, share);
    }
    let mut display = open_rows.shown(&mut d.x, roots, share);
    let mut dependent = open_rows.dependent(&mut d.x, roots, share);
    put_in_what_stands_once(d, &mut display, &mut dependent, &mut all);
    let unknown: BTreeSet<Symbol> = open_rows.rows.iter().flat_map(|row| row.symbols.iter().copied()).collect();
    name_what_is_shared(d, &unknown, (&mut display, &mut dependent, &mut all), &mut names);
    page(d, display, dependent, all, named, aliases)
}

/// A page of what is printed.
fn page(
    d: &mut Definitions,
    mut display: Vec<DisplayEquation>,
    dependent: Vec<Dependent>,
    all: Vec<(Symbol, Expr)>,
    named: BTreeMap<Symbol, Expr>,
    aliases: BTreeMap<Symbol, String>,
) -> Page {
    let mut read = BTreeSet::new();
    for equation in &mut display {
        read.extend(d.x.symbols_of(equation.left));
        read.extend(d.x.symbols_of(equation.right));
        equation.closed = (d.x.substitute(equation.left, &named), d.x.substitute(equation.right, &named));
    }
    let by_equations = with_definitions(d, read, &all);
    let of_dependent = dependent.iter().flat_map(|row| d.x.symbols_of(row.value)).chain(by_equations.iter().copied());
    let of_dependent: BTreeSet<Symbol> = of_dependent.collect();
    let read = with_definitions(d, of_dependent, &all);
    let mut definitions = Vec::new();
    for (symbol, value) in all.into_iter().filter(|(s, _)| read.contains(s)) {
        let closed = d.x.substitute(value, &named);
        definitions.push(ShownDefinition { symbol, value, closed, of_dependent: !by_equations.contains(&symbol) });
    }
    let sources = named.into_iter().filter(|(s, _)| read.contains(s)).collect();
    Page { display, dependent, sources, aliases, definitions }
}

/// What is read, near or far.
fn with_definitions(d: &Definitions, mut read: BTreeSet<Symbol>, all: &[(Symbol, Expr)]) -> BTreeSet<Symbol> {
    for (symbol, value) in all.iter().rev() {
        if read.contains(symbol) {
            read.extend(d.x.symbols_of(*value));
        }
    }
    read
}

/// An expression in a short form, within a bound of work.
fn shortened(x: &mut Exprs, e: Expr, work: u64) -> Expr {
    if x.printed_length(e) > SEARCHED {
        return x.without_idle_terms(e);
    }
    x.bound_search(work);
    put_in_shown(x, e, &BTreeMap::new())
}

/// Linear blocks in which other variables stand beside rates of states: all their rows are needed to tell the rates.
pub fn wide_blocks<'s>(equations: &Equations, steps: &'s [EquationStep]) -> Vec<&'s EquationStep> {
    let rates: BTreeSet<Symbol> = equations.states.iter().map(|s| s.rate).collect();
    let told: BTreeSet<Symbol> = equations.algebraic.iter().map(|a| a.symbol).collect();
    let is_wide = |step: &&EquationStep| match step {
        EquationStep::Linear(block) => {
            let LinearBlock { unknowns, .. } = &**block;
            unknowns.iter().any(|u| rates.contains(u))
                && unknowns.iter().any(|u| !rates.contains(u) && !told.contains(u))
        }
        _ => false,
    };
    steps.iter().filter(is_wide).collect()
}

/// Equations before anything is put in, and what defines the variables that they read.
struct OpenRows {
    rows: Vec<OpenRow>,
    dependent: Vec<(Symbol, Expr)>,
    /// The variables that are needed, in the order of evaluation.
    values: Vec<(Symbol, Expr)>,
}

/// `Σ coefficient · symbol = right`; without symbols `0 = right`.
struct OpenRow {
    symbols: Vec<Symbol>,
    /// The coefficients, then the right side.
    sides: Vec<Expr>,
}

impl OpenRow {
    fn of_row(row: &LinearRow) -> OpenRow {
        let (symbols, mut sides): (Vec<Symbol>, Vec<Expr>) = row.left.iter().copied().unzip();
        sides.push(row.right);
        OpenRow { symbols, sides }
    }

    fn of_residual(d: &mut Definitions, residual: Expr, unknown: &[Symbol]) -> OpenRow {
        let Some((coefficients, rest)) = d.x.linear_in(residual, unknown) else {
            return OpenRow { symbols: Vec::new(), sides: vec![residual] };
        };
        let terms = unknown.iter().copied().zip(coefficients);
        let (symbols, mut sides): (Vec<Symbol>, Vec<Expr>) = terms.filter(|t| !d.x.is_zero(t.1)).unzip();
        sides.push(if symbols.is_empty() { rest } else { d.x.neg(rest) });
        OpenRow { symbols, sides }
    }
}

impl OpenRows {
    fn of(d: &mut Definitions, equations: &Equations, ordered: &Ordered, named: &BTreeMap<Symbol, Expr>) -> OpenRows {
        let states = &equations.states;
        let rates: BTreeSet<Symbol> = states.iter().map(|s| s.rate).collect();
        let wide = wide_blocks(equations, &ordered.steps);
        let in_wide: BTreeSet<Symbol> = wide.iter().flat_map(|step| step.unknowns()).copied().collect();
        let of_rates = |r: &&LinearRow| {
            r.left.iter().any(|t| rates.contains(&t.0)) && !r.left.iter().any(|t| in_wide.contains(&t.0))
        };
        let by_row = assign_rows(ordered.rows.iter().filter(of_rates), &rates);
        let mut open_rows = Vec::new();
        for state in states.iter().filter(|state| !in_wide.contains(&state.rate)) {
            match by_row.get(&state.rate) {
                Some(row) => open_rows.push(OpenRow::of_row(row)),
                None if d.free.contains(&state.rate) => {}
                None => {
                    let own = d.x.sym(state.rate);
                    let value = d.of.get(&state.rate).map_or(own, |f| f.expr());
                    open_rows.push(OpenRow { symbols: vec![state.rate], sides: vec![ONE, value] });
                }
            }
        }
        let mut unknown: Vec<Symbol> = states.iter().map(|s| s.rate).collect();
        unknown.extend(equations.algebraic.iter().map(|a| a.symbol));
        for &residual in &equations.residuals {
            open_rows.push(OpenRow::of_residual(d, residual, &unknown));
        }
        let row = |&variable| Some((variable, d.of.get(&variable)?.expr()));
        let dependent = equations.dependent.iter().filter_map(row).collect();
        let mut open_rows = OpenRows { rows: open_rows, dependent, values: Vec::new() };
        wide.into_iter().for_each(|step| open_rows.add_block(step));
        open_rows.add_what_is_read(d, ordered, &rates, named);
        open_rows
    }

    /// Adds the equations that stay implicit, as far as they are read, and the definitions of what is read.
    fn add_what_is_read(
        &mut self,
        d: &mut Definitions,
        ordered: &Ordered,
        rates: &BTreeSet<Symbol>,
        named: &BTreeMap<Symbol, Expr>,
    ) {
        let mut values: Map<Symbol, Expr> = Map::new();
        let mut blocks: BTreeMap<Symbol, &EquationStep> = BTreeMap::new();
        for step in &ordered.steps {
            match step {
                EquationStep::Assign { symbol, value } if !named.contains_key(symbol) => {
                    _ = values.insert(*symbol, *value)
                }
                EquationStep::Linear(block) if block.unknowns.iter().any(|u| rates.contains(u)) => {}
                EquationStep::Linear(block) => blocks.extend(block.unknowns.iter().map(|&u| (u, step))),
                EquationStep::Newton(block) => blocks.extend(block.unknowns.iter().map(|&u| (u, step))),
                _ => {}
            }
        }
        let mut needed: BTreeSet<Symbol> = BTreeSet::new();
        let mut open: Vec<Expr> = self.exprs();
        while let Some(e) = open.pop() {
            for symbol in d.x.symbols_of(e) {
                if !needed.insert(symbol) {
                    continue;
                }
                open.extend(values.get(&symbol).copied());
                if let Some(step) = blocks.get(&symbol).copied() {
                    let first = self.rows.len();
                    self.add_block(step);
                    open.extend(self.rows[first..].iter().flat_map(|draft| draft.sides.iter().copied()));
                    step.unknowns().iter().for_each(|u| _ = blocks.remove(u));
                    needed.extend(step.unknowns());
                }
            }
        }
        let in_order = ordered.steps.iter().filter_map(|step| match step {
            EquationStep::Assign { symbol, value } if needed.contains(symbol) && values.contains_key(symbol) => {
                Some((*symbol, *value))
            }
            _ => None,
        });
        self.values = in_order.collect();
    }

    fn add_block(&mut self, step: &EquationStep) {
        match step {
            EquationStep::Linear(block) => {
                let LinearBlock { unknowns, matrix, right, .. } = &**block;
                for (row, &right) in matrix.rows().zip(right) {
                    let left = row.map(|(k, &e)| (unknowns[k], e)).collect();
                    self.rows.push(OpenRow::of_row(&LinearRow { left, right }));
                }
            }
            EquationStep::Newton(block) => {
                let NewtonBlock { residuals, .. } = &**block;
                self.rows.extend(residuals.iter().map(|&r| OpenRow { symbols: Vec::new(), sides: vec![r] }));
            }
            _ => {}
        }
    }

    /// All sides of all rows, then the dependent storages.
    fn exprs(&self) -> Vec<Expr> {
        let sides = self.rows.iter().flat_map(|row| row.sides.iter().copied());
        sides.chain(self.dependent.iter().map(|d| d.1)).collect()
    }

    /// The equations with these sides in place of their own.
    fn shown(&self, x: &mut Exprs, sides: &[Expr], work: u64) -> Vec<DisplayEquation> {
        let mut rest = sides;
        let mut shown = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            let (own, later) = rest.split_at(row.sides.len());
            rest = later;
            shown.push(shown_row(x, &row.symbols, own, work));
        }
        shown
    }

    fn dependent(&self, x: &mut Exprs, sides: &[Expr], work: u64) -> Vec<Dependent> {
        let values = &sides[sides.len() - self.dependent.len()..];
        let row = |(&(variable, _), &value): (&(Symbol, Expr), &Expr)| Dependent {
            variable,
            value: shortened(x, value, work),
        };
        self.dependent.iter().zip(values).map(row).collect()
    }
}

fn shown_row(x: &mut Exprs, symbols: &[Symbol], sides: &[Expr], work: u64) -> DisplayEquation {
    let sides: Vec<Expr> = sides.iter().map(|&e| shortened(x, e, work)).collect();
    match symbols {
        [] => {
            let zero = x.int(0);
            equation(zero, sides[0])
        }
        _ if sides.iter().map(|&e| x.printed_length(e)).sum::<u64>() <= SEARCHED => {
            x.bound_search(work);
            from_sides(x, symbols, sides)
        }
        _ => gathered(x, symbols, &sides),
    }
}

impl EquationStep {
    /// What the step defines.
    fn unknowns(&self) -> &[Symbol] {
        match self {
            EquationStep::Assign { symbol, .. } => std::slice::from_ref(symbol),
            EquationStep::Linear(block) => &block.unknowns,
            EquationStep::Newton(block) => &block.unknowns,
            EquationStep::Guard { .. } => &[],
        }
    }
}

/// Variables that give way to their values, and those that keep their names.
struct Kept {
    known: BTreeMap<Symbol, Expr>,
    definitions: Vec<(Symbol, Expr)>,
}

/// What is read once, or is short, gives way to its value; the rest keeps its name where one can record it by that; parts
/// of linear loops get a name of their own, else it is left to [`Exprs::share`].
fn kept(d: &mut Definitions, equations: &Equations, open_rows: &OpenRows, names: &mut FreshNames) -> Kept {
    let recorded = recorded(d, equations);
    let mut all = open_rows.exprs();
    all.extend(open_rows.values.iter().map(|v| v.1));
    let uses = d.x.symbol_uses(&all);
    let share = WORK / (open_rows.values.len() as u64 + 1);
    let mut known = BTreeMap::new();
    let mut definitions = Vec::new();
    for &(symbol, value) in &open_rows.values {
        let mut value = d.x.substitute(value, &known);
        if d.x.printed_length(value) <= SEARCHED {
            d.x.bound_search(share);
            value = put_in(&mut d.x, value, &BTreeMap::new());
        }
        let often = uses.get(&symbol).is_some_and(|&n| n > 1);
        let named = often && d.x.printed_length(value) > SHORT;
        if named && recorded.contains(&symbol) {
            definitions.push((symbol, value));
        } else if named && equations.of_loops.contains(&symbol) {
            let name = names.next(&mut d.x);
            definitions.push((name, value));
            known.insert(symbol, d.x.sym(name));
        } else {
            known.insert(symbol, value);
        }
    }
    Kept { known, definitions }
}

/// Variables that are recorded by the very name that they are printed with.
fn recorded(d: &mut Definitions, equations: &Equations) -> BTreeSet<Symbol> {
    let mut recorded = BTreeSet::new();
    for observed in &equations.observed {
        if let Ok(value) = observed.value
            && let Node::Symbol(symbol) = *d.x.node(value)
            && d.x.name(symbol) == &*observed.name
        {
            recorded.insert(symbol);
        }
    }
    recorded
}

/// All definitions, each behind those that it reads.
fn in_order(d: &Definitions, parts: Vec<(Symbol, Expr)>, variables: Vec<(Symbol, Expr)>) -> Vec<(Symbol, Expr)> {
    let all: BTreeMap<Symbol, (usize, Expr)> =
        variables.iter().chain(&parts).enumerate().map(|(place, &(s, e))| (s, (place, e))).collect();
    let mut order = Vec::with_capacity(all.len());
    let mut done: BTreeSet<Symbol> = BTreeSet::new();
    let mut open: Vec<(Symbol, bool)> = variables.iter().chain(&parts).rev().map(|d| (d.0, false)).collect();
    while let Some((symbol, read)) = open.pop() {
        let Some(&(_, value)) = all.get(&symbol) else { continue };
        if read {
            order.push((symbol, value));
        } else if done.insert(symbol) {
            open.push((symbol, true));
            let mut first: Vec<Symbol> = d.x.symbols_of(value).into_iter().filter(|s| all.contains_key(s)).collect();
            first.sort_by_key(|s| std::cmp::Reverse(all[s].0));
            open.extend(first.into_iter().map(|s| (s, false)));
        }
    }
    order
}

/// After all has its short form some names stand in one place only.
fn put_in_what_stands_once(
    d: &mut Definitions,
    display: &mut [DisplayEquation],
    dependent: &mut [Dependent],
    all: &mut Vec<(Symbol, Expr)>,
) {
    let sides = display.iter().flat_map(|e| [e.left, e.right]).chain(dependent.iter().map(|d| d.value));
    let exprs: Vec<Expr> = sides.chain(all.iter().map(|d| d.1)).collect();
    let uses = d.x.symbol_uses(&exprs);
    let mut known: BTreeMap<Symbol, Expr> = BTreeMap::new();
    let mut kept = Vec::with_capacity(all.len());
    for (symbol, value) in std::mem::take(all) {
        let value = d.x.substitute(value, &known);
        if uses.get(&symbol).copied().unwrap_or(0) <= 1 {
            known.insert(symbol, value);
        } else {
            kept.push((symbol, value));
        }
    }
    *all = kept;
    for equation in display {
        equation.left = d.x.substitute(equation.left, &known);
        equation.right = d.x.substitute(equation.right, &known);
    }
    dependent.iter_mut().for_each(|row| row.value = d.x.substitute(row.value, &known));
}

/// Short forms have parts in common that had none before.
fn name_what_is_shared(
    d: &mut Definitions,
    unknown: &BTreeSet<Symbol>,
    (display, dependent, all): (&mut [DisplayEquation], &mut [Dependent], &mut Vec<(Symbol, Expr)>),
    names: &mut FreshNames,
) {
    let mut sides: Vec<&mut Expr> = Vec::new();
    display.iter_mut().for_each(|e| sides.extend([&mut e.left, &mut e.right]));
    sides.extend(dependent.iter_mut().map(|row| &mut row.value));
    sides.extend(all.iter_mut().map(|definition| &mut definition.1));
    let exprs: Vec<Expr> = sides.iter().map(|side| **side).collect();
    let Shared { roots, definitions } = d.x.share(&exprs, &mut |x| names.next(x), &mut |_, e| e);
    // An unknown stands in its equation, not in a part of it.
    if definitions.iter().any(|(_, value)| d.x.symbols_of(*value).iter().any(|s| unknown.contains(s))) {
        return;
    }
    sides.into_iter().zip(roots).for_each(|(side, root)| *side = root);
    *all = in_order(d, definitions, std::mem::take(all));
}

/// Names that nothing in the model has: `s1`, `s2`, ...
struct FreshNames {
    letter: String,
    next: usize,
}

impl FreshNames {
    fn of(d: &Definitions) -> FreshNames {
        let graph = d.graph;
        let elements = graph.elements.values().map(|e| e.name.as_str());
        let named = graph.outputs.iter().chain(&graph.lets).map(|n| n.name.as_str());
        let symbols = (0..d.x.symbol_count() as u32).map(|s| d.x.label(Symbol(s)));
        let taken: BTreeSet<&str> = elements.chain(named).chain(symbols).collect();
        let free = |letter: &&str| {
            let numbered = |name: &&str| {
                name.strip_prefix(*letter).is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
            };
            !taken.iter().any(numbered)
        };
        let letter = ["s", "h", "z", "g", "u", "w", "part"].into_iter().find(free);
        FreshNames { letter: letter.unwrap_or("shared_part").to_string(), next: 1 }
    }

    fn next(&mut self, x: &mut Exprs) -> Symbol {
        loop {
            let name = format!("{}{}", self.letter, self.next);
            self.next += 1;
            if x.find_symbol(&name).is_none() {
                return x.symbol(&name, Default::default());
            }
        }
    }
}
