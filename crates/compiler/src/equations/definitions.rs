//! What defines each variable, and the time derivative of anything.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::Unavailable;
use super::points::{ROUNDING, somewhere};
use crate::algebra::{Evaluator, Expr, Exprs, Symbol, ZERO};
use crate::bond_graph::{BondGraph, HeldKind, Meaning};
use crate::ids::Map;

/// How a symbol gets its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Definition {
    /// It equals the expression.
    Explicit(Expr),
    /// It makes the expression vanish.
    Implicit(Expr),
}

impl Definition {
    /// The same with another expression.
    pub fn with(self, e: Expr) -> Definition {
        match self {
            Definition::Explicit(_) => Definition::Explicit(e),
            Definition::Implicit(_) => Definition::Implicit(e),
        }
    }

    /// The expression.
    pub fn expr(self) -> Expr {
        match self {
            Definition::Explicit(e) | Definition::Implicit(e) => e,
        }
    }
}

/// The definitions of all variables of a formulation, and what is given from outside.
pub struct Definitions<'a> {
    /// The pool.
    pub x: Exprs,
    /// The graph.
    pub graph: &'a BondGraph,
    /// Definitions by symbol.
    pub of: Map<Symbol, Definition>,
    /// What nonlinear laws make vanish, as written, for variables whose definition is the inverted law.
    pub written: Map<Symbol, Expr>,
    /// What laws make vanish that are steep as written, such as that of an orifice at rest, and are not the other way round: for
    /// the variables that they give.
    pub gentle: Map<Symbol, Expr>,
    /// States with the symbols of their rates.
    pub states: Map<Symbol, Symbol>,
    /// Stored quantities with the symbols of their rates, which the bonds carry.
    pub stored: Map<Symbol, Symbol>,
    /// Conserved constants.
    pub constants: BTreeSet<Symbol>,
    /// Positions that constraints on displacements determine.
    pub computed: BTreeSet<Symbol>,
    /// Those of them that are defined by an iteration; at the start they are unknowns.
    pub positions: BTreeSet<Symbol>,
    /// Unknowns that nothing defines: algebraic ones and free rates of states.
    pub free: BTreeSet<Symbol>,
    /// What algebraic laws give and take: loops are torn there rather than at variables of junctions.
    pub of_laws: BTreeSet<Symbol>,
    /// Symbols that have no value, with the reason.
    pub missing: BTreeMap<Symbol, Unavailable>,
    rates: Map<Symbol, Symbol>,
    /// Symbols in the rates of what is no integrated signal: they may be unknowns.
    open: BTreeSet<Symbol>,
}

impl<'a> Definitions<'a> {
    /// Nothing defined yet.
    pub fn new(mut x: Exprs, graph: &'a BondGraph) -> Self {
        x.forget_rates();
        let of = Map::with_capacity(x.symbol_count() + x.symbol_count() / 4);
        Definitions {
            x,
            graph,
            of,
            written: Map::new(),
            gentle: Map::new(),
            states: Map::new(),
            stored: Map::new(),
            constants: BTreeSet::new(),
            computed: BTreeSet::new(),
            positions: BTreeSet::new(),
            free: BTreeSet::new(),
            of_laws: BTreeSet::new(),
            missing: BTreeMap::new(),
            rates: Map::new(),
            open: BTreeSet::new(),
        }
    }

    /// Defines a symbol by an expression.
    pub fn set(&mut self, symbol: Symbol, value: Expr) {
        self.of.insert(symbol, Definition::Explicit(value));
    }

    /// Defines a symbol as what makes two sides equal.
    pub fn set_equal(&mut self, symbol: Symbol, left: Expr, right: Expr) {
        match self.x.solve_product(left, right, symbol).filter(|&value| self.is_safe(value)) {
            Some(value) => self.set(symbol, value),
            None => {
                let residual = self.x.sub(left, right);
                self.set_root(symbol, residual);
            }
        }
    }

    /// Defines a symbol as what makes an expression vanish; solved for it where that can be written down. A nonlinear
    /// expression is kept as well: Newton works on laws as written, since an inverse may end where the law saturates.
    pub fn set_root(&mut self, symbol: Symbol, residual: Expr) {
        let definition = match self.solve_for(residual, symbol) {
            Some(value) => {
                let plain = self.x.is_plainly_linear(residual, symbol);
                if !plain
                    && self.x.linear_in(residual, &[symbol]).is_none()
                    && !self.is_gentler(residual, (symbol, value))
                {
                    self.written.insert(symbol, residual);
                }
                Definition::Explicit(value)
            }
            None => Definition::Implicit(residual),
        };
        self.of.insert(symbol, definition);
    }

    /// Defines a symbol by the law of an element as it is written, which reads `asked`. Where that is steep and the other way round
    /// it is not, loops go by the latter.
    pub fn set_law(&mut self, symbol: Symbol, law: Expr, asked: Symbol) {
        self.set(symbol, law);
        if !self.x.is_steep(law) {
            return;
        }
        let own = self.x.sym(symbol);
        let residual = self.x.sub(own, law);
        let Some(inverse) = self.solve_for(residual, asked) else { return };
        if self.is_gentler(residual, (asked, inverse)) {
            let asked = self.x.sym(asked);
            let residual = self.x.sub(asked, inverse);
            self.gentle.insert(symbol, residual);
        }
    }

    /// Whether an expression that is steep vanishes wherever a symbol has this value, which is not steep and has no end: told at
    /// points on either side of 0, large and small, since laws of both signs have corners.
    fn is_gentler(&mut self, steep: Expr, (symbol, value): (Symbol, Expr)) -> bool {
        if !self.x.is_steep(steep) || self.x.is_steep(value) || !self.x.total(value) {
            return false;
        }
        let left = self.x.substitute(steep, &BTreeMap::from([(symbol, value)]));
        let (signs, sizes) = ([1.0, -1.0], [1e-3, 1.0, 30.0]);
        signs.iter().flat_map(|sign| sizes.map(|size| sign * size)).enumerate().all(|(point, size)| {
            let is_parameter = |s: Symbol| matches!(self.meaning(s), Some(Meaning::Parameter(_)));
            let mut at = |s: Symbol| somewhere(point, s) * if is_parameter(s) { 1.0 } else { size };
            let left = Evaluator::knowing(&self.x, &mut at, FxHashMap::default()).value(left);
            left.abs() <= ROUNDING * size.abs()
        })
    }

    /// The root of an expression, if it can be written down without dividing by what may vanish.
    pub fn solve_for(&mut self, residual: Expr, symbol: Symbol) -> Option<Expr> {
        self.x.solve_for(residual, symbol).filter(|&root| self.is_safe(root))
    }

    /// Whether an expression divides by nothing that may vanish.
    fn is_safe(&self, e: Expr) -> bool {
        self.x.divisors(e).into_iter().all(|divisor| self.x.nonzero(divisor))
    }

    /// Makes a symbol a state; gives the symbol of its rate.
    pub fn state(&mut self, symbol: Symbol) -> Symbol {
        let rate = self.rate_symbol(symbol);
        self.states.insert(symbol, rate);
        rate
    }

    /// Makes a stored quantity a state: its rate is the variable that the bond carries.
    pub fn stored_state(&mut self, stored: Symbol) {
        let rate = self.stored[&stored];
        self.states.insert(stored, rate);
    }

    /// The symbol that stands for the time derivative of another.
    pub fn rate_symbol(&mut self, symbol: Symbol) -> Symbol {
        self.x.rate(symbol)
    }

    /// Whether an expression keeps its value during a run: it reads parameters only.
    pub fn is_constant(&self, e: Expr) -> bool {
        !self.x.depends_on_any(e, &|s| !matches!(self.meaning(s), Some(Meaning::Parameter(_))))
    }

    /// The time derivative of an expression. Symbols whose rates it needs are defined on the way.
    pub fn rate(&mut self, e: Expr) -> Result<Expr, Unavailable> {
        if self.x.has_wholes(e) {
            return self.rate_by_parts(e);
        }
        let mut terms = Vec::new();
        for symbol in self.varying(e) {
            let slope = self.x.derivative(e, symbol);
            if self.x.is_zero(slope) {
                continue;
            }
            let rate = self.rate_of(symbol)?;
            // What keeps its value does nothing to the sum, nor to where it is defined.
            if self.x.is_number(rate).is_none_or(|rate| !rate.is_zero()) {
                terms.push(self.x.mul(&[slope, rate]));
            }
        }
        Ok(self.x.add(&terms))
    }

    /// The time derivative of a long expression, part by part from the symbols up: each part that it is made of is
    /// differentiated once, whoever else is made of it, so that it takes operations in proportion to those of its value.
    /// What reads no rate of a speed stays a whole: it is a coefficient of the speeds.
    fn rate_by_parts(&mut self, e: Expr) -> Result<Expr, Unavailable> {
        let symbols = self.varying(e);
        for &symbol in &symbols {
            let own = self.x.sym(symbol);
            if self.x.known_rate(own).is_none() {
                let rate = self.rate_of(symbol)?;
                if !matches!(self.meaning(symbol), Some(Meaning::Signal(_))) {
                    self.open.extend(self.x.symbols_of(rate));
                }
                self.x.set_rate(own, rate);
            }
        }
        for part in self.x.undifferentiated(e, &|s| symbols.contains(&s)) {
            let rate = self.x.rate_of_node(part);
            let open = self.x.depends_on_any(rate, &|s| self.open.contains(&s));
            let rate = if open { rate } else { self.x.whole(rate) };
            self.x.set_rate(part, rate);
        }
        Ok(self.x.known_rate(e).unwrap_or(ZERO))
    }

    /// The symbols in an expression that may change while it runs.
    fn varying(&self, e: Expr) -> BTreeSet<Symbol> {
        let varies =
            |&s: &Symbol| !self.constants.contains(&s) && !matches!(self.meaning(s), Some(Meaning::Parameter(_)));
        self.x.symbols_of(e).into_iter().filter(varies).collect()
    }

    /// The time derivative of a symbol.
    pub fn rate_of(&mut self, symbol: Symbol) -> Result<Expr, Unavailable> {
        if let Some(reason) = self.missing.get(&symbol) {
            return Err(reason.clone());
        }
        if let Some(&rate) = self.states.get(&symbol).or_else(|| self.stored.get(&symbol)) {
            return Ok(self.x.sym(rate));
        }
        if self.constants.contains(&symbol) {
            return Ok(self.x.int(0));
        }
        match self.meaning(symbol) {
            Some(Meaning::Parameter(_)) => return Ok(self.x.int(0)),
            Some(Meaning::Time) => return Ok(self.x.int(1)),
            Some(Meaning::Input(input)) => {
                return Err(Unavailable::NeedsRateOf(Arc::new(self.graph.inputs[input].name.clone())));
            }
            // The rate of a rate of an input, which nobody gives.
            Some(Meaning::Rate(of)) if matches!(self.meaning(of), Some(Meaning::Input(_))) => return self.rate_of(of),
            Some(Meaning::Signal(signal)) => return Ok(self.graph.signals[signal].rate),
            Some(Meaning::Held(held)) => match self.graph.held[held].kind {
                HeldKind::Sample | HeldKind::Discrete | HeldKind::Impulse => return Ok(self.x.int(0)),
                HeldKind::Delay => {
                    return Err(Unavailable::NeedsRateOf(Arc::new(self.graph.held[held].name.clone())));
                }
            },
            _ => {}
        }
        if let Some(&rate) = self.rates.get(&symbol) {
            return Ok(self.x.sym(rate));
        }
        if self.free.contains(&symbol) {
            return Err(Unavailable::NeedsRateOfUnknown(Arc::new(self.x.name(symbol).to_string())));
        }
        let Some(&definition) = self.of.get(&symbol) else { return Err(Unavailable::Unsolvable) };
        let rate = self.rate_symbol(symbol);
        self.rates.insert(symbol, rate);
        match self.rate(definition.expr()) {
            Ok(value) => {
                let definition = match definition {
                    Definition::Explicit(_) => Definition::Explicit(value),
                    Definition::Implicit(_) => Definition::Implicit(value),
                };
                self.of.insert(rate, definition);
                Ok(self.x.sym(rate))
            }
            Err(reason) => {
                self.missing.insert(rate, reason.clone());
                self.rates.remove(&symbol);
                Err(reason)
            }
        }
    }

    /// Defines what the modeller's own rates (`x'` in an expression) stand for; those that have no value are noted.
    pub fn define_user_rates(&mut self) {
        let rates: Vec<(Symbol, Symbol)> = self
            .graph
            .variables
            .iter()
            .filter_map(|(&s, v)| if let Meaning::Rate(of) = v.meaning { Some((s, of)) } else { None })
            .collect();
        for (symbol, of) in rates {
            match self.rate_of(of) {
                Ok(value) => {
                    let own = self.x.sym(symbol);
                    if value != own {
                        self.set(symbol, value);
                    }
                }
                Err(reason) => {
                    self.missing.insert(symbol, reason);
                }
            }
        }
    }

    /// Symbols of rates that follow by differentiating definitions.
    pub fn derived_rates(&self) -> impl Iterator<Item = Symbol> + '_ {
        self.rates.values().copied()
    }

    /// What a symbol of the graph stands for.
    pub fn meaning(&self, symbol: Symbol) -> Option<Meaning> {
        self.graph.variables.get(&symbol).map(|v| v.meaning)
    }

    /// Symbols that cannot be had because something they read, near or far, has no value.
    pub fn spread_missing(&mut self) {
        let mut readers: BTreeMap<Symbol, Vec<Symbol>> = BTreeMap::new();
        if self.missing.is_empty() {
            return;
        }
        for (&symbol, definition) in &self.of {
            for read in self.x.symbols_of(definition.expr()) {
                readers.entry(read).or_default().push(symbol);
            }
        }
        let mut work: Vec<Symbol> = self.missing.keys().copied().collect();
        while let Some(symbol) = work.pop() {
            let reason = self.missing[&symbol].clone();
            for &reader in readers.get(&symbol).into_iter().flatten() {
                self.missing.entry(reader).or_insert_with(|| {
                    work.push(reader);
                    reason.clone()
                });
            }
        }
        let missing: BTreeSet<Symbol> = self.missing.keys().copied().collect();
        self.of.retain(|s, _| !missing.contains(s));
    }
}
