//! Where the search of the start begins: `guess`.

use std::collections::BTreeMap;

use super::builder::Builder;
use super::flatten::Word;
use super::scope::Here;
use super::value::Reading;
use super::{BondGraph, Guess, Kind, Meaning, StorageLaw};
use crate::algebra::{Expr, Node, Symbol};
use crate::ast;
use crate::diagnostic::{Diagnostic, codes};
use crate::ids::Id;
use crate::span::Span;

impl<'a> Builder<'a, '_> {
    /// The entries of all `guess` statements.
    pub fn guesses(&mut self) -> Vec<Guess> {
        let flat = self.flat;
        let mut first: BTreeMap<Symbol, Span> = BTreeMap::new();
        let mut guesses = Vec::new();
        for &(here, guess) in &flat.guesses {
            let before = self.faults.len();
            let found = self.guess(here, guess);
            self.met_in(here, before);
            let Some((symbol, entry)) = found else { continue };
            match first.get(&symbol) {
                Some(&before) => self.guessed_twice(symbol, before, guess.span),
                None => {
                    first.insert(symbol, guess.span);
                    guesses.push(entry);
                }
            }
        }
        guesses
    }

    fn guess(&mut self, here: Here, guess: &'a ast::Guess) -> Option<(Symbol, Guess)> {
        let flat = self.flat;
        let cx = Reading::of(here, flat.names.scopes[here.scope].prefix.trim_end_matches('.'));
        let own = self.path(&cx, &guess.what)?;
        let symbol = match self.common_flow(own.expr) {
            Some(symbol) => symbol,
            None => self.searched(own.expr, guess.what.span)?,
        };
        let value = self.number(&cx, &guess.value)?;
        let value = self.with_unit(value, guess.unit.as_ref(), guess.value.span);
        self.equal(&value.quantity, &own.quantity, guess.span, "the guess and what it is for");
        if !self.only_parameters(value.expr, guess.value.span, "a guess") {
            return None;
        }
        Some((symbol, Guess { what: own.expr, value: value.expr, span: guess.span }))
    }

    /// The symbol, if it is the common flow of a 1-junction, which may have no storage that could be guessed.
    fn common_flow(&self, e: Expr) -> Option<Symbol> {
        let Node::Symbol(symbol) = *self.exprs.node(e) else { return None };
        let Some(Meaning::Flow(bond)) = self.meaning(symbol) else { return None };
        let wire = &self.wiring.wires[bond.index()];
        let common = |part: usize| self.part(part).word == Word::One && self.representative(part) == Some(bond.index());
        [wire.from.0, wire.to.0].into_iter().any(common).then_some(symbol)
    }

    /// The symbol, if the start is searched for what it stands for.
    fn searched(&mut self, e: Expr, span: Span) -> Option<Symbol> {
        let symbol = match self.exprs.node(e) {
            Node::Symbol(symbol) => Some(*symbol),
            _ => None,
        };
        let meaning = symbol.and_then(|s| self.meaning(s));
        if matches!(meaning, Some(Meaning::Signal(_) | Meaning::Stored(_))) {
            return symbol;
        }
        let title = "a guess is for a state, the `q` of a C, the `p` of an I or the `f` of a 1-junction";
        let what = match meaning {
            Some(Meaning::Parameter(_)) => "a parameter has its value already",
            Some(Meaning::Input(_)) => "an input is given from outside",
            Some(Meaning::Time) => "time is never searched",
            Some(Meaning::Effort(_)) => "this is an effort",
            Some(Meaning::Flow(_)) => "this is a flow",
            _ => "this follows from other variables",
        };
        let hint = "guess the states and stored quantities that it follows from: `guess spring.q = 0.1 m`";
        self.fault(Diagnostic::error(codes::I006, title, span, what).hint(hint));
        None
    }

    fn guessed_twice(&mut self, symbol: Symbol, first: Span, again: Span) {
        let title = format!("two guesses for `{}`", self.exprs.name(symbol));
        let fault = Diagnostic::error(codes::I002, title, again, "guessed again").also(first, "guessed first");
        self.fault(fault.hint("keep one of them"));
    }
}

/// Guesses of what is given, or guessed already: nothing is ever searched from them.
pub(super) fn idle(graph: &BondGraph) -> impl Iterator<Item = Diagnostic> + '_ {
    let given = given(graph);
    let mut guessed: BTreeMap<Symbol, Span> = BTreeMap::new();
    graph.guesses.iter().filter_map(move |guess| {
        let symbol = graph.exprs.symbols_of(guess.what).into_iter().next()?;
        let title = format!("the guess of `{}` is never used", graph.exprs.name(symbol));
        let warning = Diagnostic::warning(codes::I007, title, guess.span, "nothing is searched from here");
        let (at, why) = match (given.get(&symbol), guessed.get(&symbol)) {
            (Some(&at), _) => (at, "its start value is given here"),
            (None, Some(&at)) => (at, "it is guessed here, by what repeats it"),
            (None, None) => {
                guessed.insert(symbol, guess.span);
                return None;
            }
        };
        Some(warning.also(at, why).hint("leave out one of the two"))
    })
}

/// What is given at the start, each with its place.
fn given(graph: &BondGraph) -> BTreeMap<Symbol, Span> {
    let signals = graph.signals.values().filter(|s| s.initial.is_some()).map(|s| (s.symbol, s.span));
    let mut given: BTreeMap<Symbol, Span> = signals.collect();
    for element in graph.elements.values() {
        if let Kind::Inertance(storage) | Kind::Compliance(storage) = &element.kind {
            given.extend(storage.initial.iter().map(|i| (i.symbol, i.span)));
            let known = storage.stored.iter().zip(&storage.laws);
            let known = known.filter(|(_, law)| matches!(law, StorageLaw::Known { .. }));
            given.extend(known.map(|(symbol, _)| (*symbol, element.span)));
        }
    }
    given
}
