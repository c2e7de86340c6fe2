//! Named quantities: what each is, and what it is called.

use super::exprs::Exprs;
use super::fingerprint::mix;
use super::grown::{Place, place};
use super::listed::ListedSymbol;
use super::node::{Expr, Facts, Node, Symbol};
use std::cmp::Ordering;

/// What a symbol is, seen from the one that it is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SymbolKind {
    /// A quantity in its own right: of the modeller, of a bond, of a storage.
    Own,
    /// The same variable once more: that of the second of two elements on one bond, or that of a junction whose variable
    /// is kept without a storage.
    Twin(Symbol),
    /// What acts where this common variable of a junction is kept without a storage: nothing.
    Reaction(Symbol),
    /// The time derivative.
    Rate(Symbol),
    /// A sum of stored quantities, kept for this variable.
    Momentum(Symbol),
    /// The force of the spring that stands in the place of this multiplier.
    Spring(Symbol),
    /// What an unknown does to a variable of its loop.
    Gain {
        /// The variable.
        of: Symbol,
        /// The unknown.
        by: Symbol,
    },
    /// What a variable beside a loop does to one at which the loop is torn.
    LoopGain {
        /// The variable at which it is torn.
        of: Symbol,
        /// The variable beside it.
        by: Symbol,
    },
    /// What a variable of a loop is where all unknowns of the loop are zero.
    Bias(Symbol),
}

/// A symbol of the pool.
#[derive(Clone)]
pub(super) struct SymbolEntry {
    /// Where its label and its name stand in the texts of the pool.
    label: Place,
    name: Place,
    /// From the label.
    pub hash: u64,
    kind: SymbolKind,
    facts: Facts,
}

/// A name with the sign of its time derivatives: `phi` and 1 are `phi'`.
pub fn dotted(name: &str, rates: usize) -> String {
    const RATE: &str = "'";
    [name, &RATE.repeat(rates)].concat()
}

/// A name that another symbol has, told apart by marks.
fn marked(name: &str, marks: usize) -> String {
    const SAME_NAME: &str = "*";
    [name, &SAME_NAME.repeat(marks)].concat()
}

impl Exprs {
    /// The quantity of that name. The facts hold if it is new; a name always means the same symbol.
    pub fn symbol(&mut self, name: &str, facts: Facts) -> Symbol {
        self.find_symbol(name).unwrap_or_else(|| self.add_symbol(name, name, SymbolKind::Own, facts))
    }

    /// A new quantity of that name, or of that name with the first free number from 2 behind it.
    pub fn fresh(&mut self, name: &str, facts: Facts) -> Symbol {
        let hash = hash_label(name);
        if self.find_hashed(hash, name).is_none() {
            return self.add_hashed(hash, (name, name), SymbolKind::Own, facts);
        }
        let name = self.free_name(name);
        self.add_symbol(&name, &name, SymbolKind::Own, facts)
    }

    /// The symbol that is this; if it is new it is called so, or so with the first free number from 2 behind it.
    pub fn made_of(&mut self, kind: SymbolKind, name: &str) -> Symbol {
        self.find_made_of(kind).unwrap_or_else(|| {
            let name = self.free_name(name);
            self.add_symbol(&name, &name, kind, Facts::default())
        })
    }

    /// The same variable once more, with the same name.
    pub fn twin(&mut self, of: Symbol) -> Symbol {
        let name = self.name(of).to_string();
        self.marked_symbol(SymbolKind::Twin(of), &name)
    }

    /// What acts where a variable is kept without a storage; its name may belong to another variable.
    pub fn reaction(&mut self, kept: Symbol, name: &str) -> Symbol {
        self.marked_symbol(SymbolKind::Reaction(kept), name)
    }

    fn marked_symbol(&mut self, kind: SymbolKind, name: &str) -> Symbol {
        self.find_made_of(kind).unwrap_or_else(|| {
            let mut labels = (1..).map(|marks| marked(name, marks));
            let label = labels.find(|label| self.find_symbol(label).is_none()).expect("marks without end");
            self.add_symbol(&label, name, kind, Facts::default())
        })
    }

    /// The symbol of the time derivative of another.
    pub fn rate(&mut self, of: Symbol) -> Symbol {
        let kind = SymbolKind::Rate(of);
        self.find_made_of(kind).unwrap_or_else(|| {
            let (label, name) = (dotted(self.label(of), 1), dotted(self.name(of), 1));
            self.add_symbol(&label, &name, kind, Facts::default())
        })
    }

    /// What an unknown of a loop does to one of its variables, as a symbol.
    pub fn gain(&mut self, of: Symbol, by: Symbol) -> Symbol {
        let name = format!("{}.by.{}", self.name(of), self.name(by));
        self.made_of(SymbolKind::Gain { of, by }, &name)
    }

    /// What a variable beside a loop does to one at which the loop is torn, as a symbol.
    pub fn loop_gain(&mut self, of: Symbol, by: Symbol) -> Symbol {
        let name = format!("{}.by.{}", self.name(of), self.name(by));
        self.made_of(SymbolKind::LoopGain { of, by }, &name)
    }

    /// What a variable of a loop is where all unknowns of the loop are zero, as a symbol.
    pub fn bias(&mut self, of: Symbol) -> Symbol {
        let name = format!("{}.bias", self.name(of));
        self.made_of(SymbolKind::Bias(of), &name)
    }

    fn free_name(&self, name: &str) -> String {
        let free = |name: &String| self.find_symbol(name).is_none();
        let numbered = (2..).map(|n| format!("{name}_{n}"));
        std::iter::once(name.to_string()).chain(numbered).find(free).expect("numbers without end")
    }

    fn add_symbol(&mut self, label: &str, name: &str, kind: SymbolKind, facts: Facts) -> Symbol {
        self.add_hashed(hash_label(label), (label, name), kind, facts)
    }

    /// The next symbol of a list; `None` if one has its label already.
    pub(super) fn list_symbol(&mut self, listed: &ListedSymbol<'_>) -> Option<Symbol> {
        let &ListedSymbol { label, name, kind, facts } = listed;
        let hash = hash_label(label);
        let is_new = self.find_hashed(hash, label).is_none();
        is_new.then(|| self.add_hashed(hash, (label, name), kind, facts))
    }

    fn add_hashed(&mut self, hash: u64, (label, name): (&str, &str), kind: SymbolKind, facts: Facts) -> Symbol {
        let id = u32::try_from(self.symbols.len()).expect("fewer than 2^32 symbols");
        let mut push = |text: &str| self.texts.add(text.len(), |out| out.push_str(text));
        let at = push(label);
        let name = match label.strip_prefix(name) {
            Some(_) => (at.0, at.0 + place(name.len())),
            None => push(name),
        };
        self.symbols.push(SymbolEntry { label: at, name, hash, kind, facts });
        self.of_symbols.push(None);
        let symbols = &self.symbols;
        self.by_label.insert_unique(hash, id, |&id| symbols[id as usize].hash);
        if kind != SymbolKind::Own {
            self.made.insert(kind, Symbol(id));
        }
        Symbol(id)
    }

    /// The symbol of that name, if there is one; of those that share a name the first.
    pub fn find_symbol(&self, name: &str) -> Option<Symbol> {
        self.find_hashed(hash_label(name), name)
    }

    fn find_hashed(&self, hash: u64, name: &str) -> Option<Symbol> {
        let found = self.by_label.find(hash, |&id| self.label(Symbol(id)) == name);
        found.map(|&id| Symbol(id))
    }

    /// The symbol that is this, if there is one.
    pub fn find_made_of(&self, kind: SymbolKind) -> Option<Symbol> {
        self.made.get(&kind).copied()
    }

    /// What a symbol is.
    pub fn kind(&self, symbol: Symbol) -> SymbolKind {
        self.symbols[symbol.0 as usize].kind
    }

    /// The variable of the bond or junction that a symbol is: the one that it is the twin of, else itself.
    pub fn untwinned(&self, symbol: Symbol) -> Symbol {
        match self.kind(symbol) {
            SymbolKind::Twin(of) => self.untwinned(of),
            _ => symbol,
        }
    }

    /// What a symbol is a time derivative of, and how often it is differentiated.
    pub fn undotted(&self, symbol: Symbol) -> (Symbol, usize) {
        match self.kind(symbol) {
            SymbolKind::Rate(of) => {
                let (of, rates) = self.undotted(of);
                (of, rates + 1)
            }
            _ => (symbol, 0),
        }
    }

    /// What people call a symbol. Twins have one name, and what acts on a kept variable may have that of another.
    pub fn name(&self, symbol: Symbol) -> &str {
        self.texts.at(self.symbols[symbol.0 as usize].name)
    }

    /// The name with marks that tell it apart from all others.
    pub fn label(&self, symbol: Symbol) -> &str {
        self.texts.at(self.symbols[symbol.0 as usize].label)
    }

    /// What is known of a symbol.
    pub fn facts(&self, symbol: Symbol) -> Facts {
        self.symbols[symbol.0 as usize].facts
    }

    /// How many symbols there are; their ids are the numbers below.
    pub fn symbol_count(&self) -> usize {
        self.symbols.len()
    }

    /// The symbol as an expression.
    pub fn sym(&mut self, symbol: Symbol) -> Expr {
        let at = symbol.0 as usize;
        if let Some(known) = self.of_symbols[at] {
            return known;
        }
        let e = self.intern(Node::Symbol(symbol));
        self.of_symbols[at] = Some(e);
        e
    }

    /// The order of the names of two symbols.
    pub(super) fn name_order(&self, a: Symbol, b: Symbol) -> Ordering {
        natural_order(self.label(a), self.label(b))
    }
}

fn hash_label(label: &str) -> u64 {
    label.bytes().fold(0x5b01, |h, b| mix(h, u64::from(b)))
}

/// Labels in alphabetical order, numbers in them by their size: `q2` before `q10`.
pub(crate) fn natural_order(a: &str, b: &str) -> Ordering {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let same = a.iter().zip(b).take_while(|(x, y)| x == y).count();
    // A number counts whole.
    let start = a[..same].iter().rposition(|byte| !byte.is_ascii_digit()).map_or(0, |last| last + 1);
    with_lengths(&a[start..]).cmp(with_lengths(&b[start..]))
}

/// The bytes with the length of a number in front of it, which sorts shorter numbers first; `0` keeps it among the digits.
fn with_lengths(label: &[u8]) -> impl Iterator<Item = u8> + '_ {
    label.chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit()).flat_map(|run| {
        let length = run[0].is_ascii_digit().then(|| [b'0', run.len().min(127) as u8]);
        length.into_iter().flatten().chain(run.iter().copied())
    })
}

#[cfg(test)]
mod tests {
    use super::natural_order;

    #[test]
    fn numbers_in_names_sort_by_their_size() {
        let names = ["", "a", "a01", "a10", "a.2", "b2", "b2.e", "b2x", "b10", "b10.e", "b10.f", "b10x2", "b10x10"];
        let mut sorted = names;
        sorted.sort_by(|a, b| natural_order(a, b));
        assert_eq!(
            sorted,
            ["", "a", "a.2", "a01", "a10", "b2", "b2.e", "b2x", "b10", "b10.e", "b10.f", "b10x2", "b10x10"]
        );
    }
}
