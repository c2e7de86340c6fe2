//! The pool of shared expressions.

use super::assumptions::Assumptions;
use super::calculus::By;
use super::fingerprint::{Fingerprint, mix, near};
use super::grown::{Grown, GrownTexts};
use super::node::{Comparison, Expr, Function, Node, Symbol};
use super::properties::Properties;
use super::rational::Rational;
use super::rewrite::ShortForms;
use super::symbol_sets::{SetId, SymbolSets};
use super::symbols::{SymbolEntry, SymbolKind};
use super::table::{Table1d, TableId};
use super::zero::Told;
use hashbrown::HashTable;
use rustc_hash::FxHashMap;
use std::fmt;

/// A pool of expressions that only grows. Equal expressions are one entry, so that `==` on [`Expr`] compares them.
///
/// Whatever enters is brought into canonical form: sums and products flat and sorted, numbers folded exactly, like
/// terms and powers of one base collected. What would change where an expression is defined is left alone: `q/q`
/// stays unless `q` is known not to be zero, `sqrt(x)^2` unless `x` is known not to be negative, and `0*x` unless
/// `x` is defined everywhere (symbols are finite).
///
/// ```
/// use halfarrow_compiler::algebra::{Exprs, Facts};
/// let mut x = Exprs::default();
/// let q = x.symbol("q", Facts::default());
/// let m = x.symbol("m", Facts { positive: true, ..Facts::default() });
/// let (q, m, one) = (x.sym(q), x.sym(m), x.int(1));
/// assert_ne!(x.div(q, q), one);
/// assert_eq!(x.div(m, m), one);
/// ```
#[derive(Clone)]
pub struct Exprs {
    pub(super) entries: Grown<PoolEntry>,
    ids: HashTable<u32>,
    pub(super) symbols: Grown<SymbolEntry>,
    /// Each symbol as an expression, once there is one.
    pub(super) of_symbols: Vec<Option<Expr>>,
    pub(super) by_label: HashTable<u32>,
    /// All symbols that are made of others.
    pub(super) made: FxHashMap<SymbolKind, Symbol>,
    pub(super) texts: GrownTexts,
    pub(super) sets: SymbolSets,
    pub(super) tables: Vec<Table1d>,
    pub(super) derivatives: FxHashMap<(Expr, By), Expr>,
    pub(super) slope_tables: FxHashMap<TableId, TableId>,
    pub(super) short_forms: ShortForms,
    pub(super) assumptions: Assumptions,
    pub(super) told: Told,
}

/// An expression with what is known of it from birth.
#[derive(Clone)]
pub(super) struct PoolEntry {
    pub node: Node,
    /// From names and structure only: equal in every pool.
    pub hash: u64,
    pub depth: u32,
    /// Entries below it, shared ones each time; at most `u32::MAX`.
    pub size: u32,
    /// How long it is written; at most `u32::MAX`.
    pub length: u32,
    pub properties: Properties,
    pub symbols: SetId,
    /// The product without its number; itself if it has none.
    pub monomial: Expr,
    pub fingerprint: Fingerprint,
}

impl PoolEntry {
    fn spot(&self) -> u64 {
        spot(self.hash, &self.node)
    }
}

impl Default for Exprs {
    fn default() -> Self {
        let mut pool = Exprs {
            entries: Grown::default(),
            ids: HashTable::new(),
            symbols: Grown::default(),
            of_symbols: Vec::new(),
            by_label: HashTable::new(),
            made: FxHashMap::default(),
            texts: GrownTexts::default(),
            sets: SymbolSets::default(),
            tables: Vec::new(),
            derivatives: FxHashMap::default(),
            slope_tables: FxHashMap::default(),
            short_forms: ShortForms::default(),
            assumptions: Assumptions::default(),
            told: Told::default(),
        };
        for n in [0, 1, -1] {
            pool.int(n);
        }
        pool
    }
}

impl fmt::Debug for Exprs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Exprs({} entries, {} symbols)", self.entries.len(), self.symbols.len())
    }
}

/// The number 0, at the same place in every pool.
pub const ZERO: Expr = Expr(0);
/// The number 1, at the same place in every pool.
pub const ONE: Expr = Expr(1);
/// The number -1, at the same place in every pool.
pub const MINUS_ONE: Expr = Expr(2);

impl Exprs {
    /// How many expressions there are; their ids are the numbers below, those of the parts before those of the whole.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Makes room for so many more symbols, and expressions of them.
    pub fn reserve(&mut self, symbols: usize) {
        let (entries, known) = (&self.entries, &self.symbols);
        self.ids.reserve(symbols + symbols / 2, |&id| entries[id as usize].spot());
        self.by_label.reserve(symbols, |&id| known[id as usize].hash);
        self.of_symbols.reserve(symbols);
    }

    /// Never: 0, 1 and -1 are always there.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// An integer.
    pub fn int(&mut self, n: i64) -> Expr {
        self.number(Rational::from(n))
    }

    /// A number.
    pub fn number(&mut self, value: Rational) -> Expr {
        self.intern(Node::Number(value))
    }

    /// The quotient of two integers. Panics if the denominator is zero.
    pub fn ratio(&mut self, numerator: i64, denominator: i64) -> Expr {
        self.number(Rational::new(numerator, denominator))
    }

    /// The exact value of a decimal such as `1.4e-13`; `None` if the text is none.
    pub fn decimal(&mut self, text: &str) -> Option<Expr> {
        Rational::from_decimal(text).map(|value| self.number(value))
    }

    /// The exact value of a float. Panics if it is not finite.
    pub fn float(&mut self, value: f64) -> Expr {
        self.number(Rational::from_f64(value).expect("a finite number"))
    }

    /// The number pi.
    pub fn pi(&mut self) -> Expr {
        self.intern(Node::Pi)
    }

    /// What the expression is made of.
    pub fn node(&self, e: Expr) -> &Node {
        &self.entries[e.0 as usize].node
    }

    /// The number that the expression is, if it is one.
    pub fn is_number(&self, e: Expr) -> Option<&Rational> {
        match self.node(e) {
            Node::Number(value) => Some(value),
            _ => None,
        }
    }

    /// Registers a table.
    pub fn add_table(&mut self, table: Table1d) -> TableId {
        if let Some(known) = self.tables.iter().position(|t| t == &table) {
            return TableId(known as u32);
        }
        self.tables.push(table);
        TableId(u32::try_from(self.tables.len() - 1).expect("fewer than 2^32 tables"))
    }

    /// A registered table.
    pub fn table1d(&self, id: TableId) -> &Table1d {
        &self.tables[id.0 as usize]
    }

    /// How many tables are registered; their ids are the numbers below.
    pub fn table_count(&self) -> usize {
        self.tables.len()
    }

    pub(super) fn entry(&self, e: Expr) -> &PoolEntry {
        &self.entries[e.0 as usize]
    }

    /// The entry of a node that is in canonical form.
    pub(super) fn intern(&mut self, node: Node) -> Expr {
        let Whole { hash, depth, size } = self.whole_of(&node);
        let spot = spot(hash, &node);
        let entries = &self.entries;
        if let Some(&id) = self.ids.find(spot, |&id| entries[id as usize].node == node) {
            return Expr(id);
        }
        let monomial = self.monomial_of(&node);
        let entry = PoolEntry {
            hash,
            depth,
            size,
            length: self.length_of_node(&node),
            properties: self.properties_of(&node),
            symbols: self.symbols_of_node(&node),
            monomial: monomial.unwrap_or(Expr(self.entries.len() as u32)),
            fingerprint: self.fingerprint_of(&node),
            node,
        };
        let id = u32::try_from(self.entries.len()).expect("fewer than 2^32 expressions");
        self.entries.push(entry);
        self.assumptions.cover(self.entries.len());
        let entries = &self.entries;
        self.ids.insert_unique(spot, id, |&id| entries[id as usize].spot());
        Expr(id)
    }

    fn monomial_of(&mut self, node: &Node) -> Option<Expr> {
        let Node::Mul(factors) = node else { return None };
        self.is_number(factors[0])?;
        Some(match &factors[1..] {
            [single] => *single,
            several => self.intern(Node::Mul(several.into())),
        })
    }

    /// What an entry is as a whole, from that of its parts.
    fn whole_of(&self, node: &Node) -> Whole {
        let seed = match node {
            Node::Number(value) => return Whole { hash: hash_number(value), depth: 0, size: 1 },
            Node::Symbol(s) => return Whole { hash: self.symbols[s.0 as usize].hash, depth: 0, size: 1 },
            Node::Pi => 1,
            Node::Add(_) => 2,
            Node::Mul(_) => 3,
            Node::Pow(..) => 4,
            Node::Compare(c, ..) => 16 + comparison_tag(*c),
            Node::And(..) => 5,
            Node::Or(..) => 6,
            Node::Not(_) => 7,
            Node::Select(..) => 8,
            Node::Table(t, _) => mix(9, u64::from(t.0)),
            Node::TableSlope(t, _) => mix(10, u64::from(t.0)),
            Node::Whole(_) => 11,
            Node::Call(f, _) => 32 + function_tag(*f),
        };
        let mut whole = Whole { hash: mix(0x5eed, seed), depth: 0, size: 1 };
        node.for_each_child(|c| {
            let part = self.entry(c);
            whole.hash = mix(whole.hash, part.hash);
            whole.depth = whole.depth.max(part.depth + 1);
            whole.size = whole.size.saturating_add(part.size);
        });
        match node {
            Node::Whole(_) => Whole { depth: 1, size: 1, ..whole },
            _ => whole,
        }
    }
}

/// Where an entry is looked for: near those that are made of parts of about the same time.
fn spot(hash: u64, node: &Node) -> u64 {
    near(hash, |part| match node {
        Node::Symbol(symbol) => part(symbol.0),
        _ => node.for_each_child(|c| part(c.0)),
    })
}

/// What is known of an entry from its parts.
struct Whole {
    hash: u64,
    depth: u32,
    size: u32,
}

pub(super) fn function_tag(f: Function) -> u64 {
    f as u64
}

pub(super) fn comparison_tag(c: Comparison) -> u64 {
    c as u64
}

fn hash_number(value: &Rational) -> u64 {
    match value.small() {
        Some((n, d)) => mix(mix(0x0c0, n as u64), d as u64),
        None => {
            let parts = [value.numerator(), value.denominator()];
            parts.iter().flat_map(|p| p.to_le_bytes().into_vec()).fold(0xb16, |h, b| mix(h, u64::from(b)))
        }
    }
}
