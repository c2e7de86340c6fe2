//! A pool as lists: what it is made of, in order, and the pool that such lists make.

use super::exprs::Exprs;
use super::node::{Expr, Facts, Node, Symbol};
use super::symbols::SymbolKind;
use super::table::Table1d;

/// A symbol with all that it is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ListedSymbol<'a> {
    /// What tells it from all others.
    pub label: &'a str,
    /// Its name, which the label begins with or which stands for itself.
    pub name: &'a str,
    /// What it is.
    pub kind: SymbolKind,
    /// What is known of it.
    pub facts: Facts,
}

/// What was assumed of the expressions of a pool.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ListedAssumptions {
    /// What was divided by, in order.
    pub divisors: Vec<Expr>,
    /// What is defined because of that, in order.
    pub defined: Vec<Expr>,
    /// Expressions of which something was decided by values, with all that was; in order.
    pub decided: Vec<(Expr, u8)>,
}

impl Exprs {
    /// Its symbols in order.
    pub fn listed_symbols(&self) -> impl Iterator<Item = ListedSymbol<'_>> + '_ {
        (0..self.symbol_count() as u32).map(Symbol).map(|symbol| ListedSymbol {
            label: self.label(symbol),
            name: self.name(symbol),
            kind: self.kind(symbol),
            facts: self.facts(symbol),
        })
    }

    /// Its expressions in order, parts before wholes.
    pub fn listed_nodes(&self) -> impl Iterator<Item = &Node> + '_ {
        (0..self.len() as u32).map(|e| self.node(Expr(e)))
    }

    /// Its tables in order.
    pub fn listed_tables(&self) -> &[Table1d] {
        &self.tables
    }
}

/// A pool that is made of lists: symbols first, then expressions. What was only looked up in the pool that was listed is
/// looked up anew.
#[derive(Debug)]
pub struct ListedPool {
    pool: Exprs,
    /// How many expressions were added.
    added: usize,
}

impl ListedPool {
    /// A pool with these tables, and room for so many symbols.
    pub fn new(tables: Vec<Table1d>, symbols: usize) -> ListedPool {
        let mut pool = Exprs::default();
        pool.tables = tables;
        pool.reserve(symbols);
        ListedPool { pool, added: 0 }
    }

    /// Adds the next symbol; `None` if one has its label already.
    pub fn add_symbol(&mut self, label: &str, name: &str, kind: SymbolKind, facts: Facts) -> Option<()> {
        self.pool.list_symbol(&ListedSymbol { label, name, kind, facts }).map(|_| ())
    }

    /// Adds the next expression, or tells that one is there with every pool; `None` if it is there already, or a part of it
    /// is not.
    pub fn add_node(&mut self, node: Node) -> Option<()> {
        let ListedPool { pool, added } = self;
        let at = std::mem::replace(added, *added + 1);
        let mut is_known = true;
        node.for_each_child(|part| is_known &= (part.0 as usize) < at);
        let symbol = match node {
            Node::Symbol(symbol) if symbol.0 as usize >= pool.symbol_count() => return None,
            Node::Symbol(symbol) => Some(symbol),
            _ => None,
        };
        let e = is_known.then(|| pool.intern(node)).filter(|e| e.0 as usize == at)?;
        if let Some(symbol) = symbol {
            pool.of_symbols[symbol.0 as usize] = Some(e);
        }
        Some(())
    }

    /// The pool, with what was assumed in it; `None` if that speaks of expressions that are not there.
    pub fn finish(self, assumed: &ListedAssumptions) -> Option<Exprs> {
        let ListedPool { mut pool, .. } = self;
        let ListedAssumptions { divisors, defined, decided } = assumed;
        let mut all = divisors.iter().chain(defined).chain(decided.iter().map(|(e, _)| e));
        let exist = all.all(|e| (e.0 as usize) < pool.len());
        exist.then(|| {
            pool.assumptions.list(assumed);
            pool
        })
    }
}
