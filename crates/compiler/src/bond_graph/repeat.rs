//! What is known when a model is compiled: the turns of its repetitions, and the numbers that shape it.

use rustc_hash::{FxHashMap, FxHashSet};

use super::counted::{Counted, Reads};
use super::scope::{DeclId, Here, Names, ScopeId, TurnId, Valued};
use super::uses::{Used, Uses};
use crate::algebra::Rational;
use crate::ast;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// The greatest number of turns of all repetitions together, and of elements of arrays.
pub(crate) const MAX_TURNS: usize = 4_000_000;

/// The greatest number of terms of all sums together.
const MAX_TERMS: usize = 16_000_000;

/// One turn of a repetition: its variable and what that is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn<'a> {
    /// The variable.
    pub variable: &'a ast::Name,
    /// Its value.
    pub value: i64,
    /// The scope that it stands in.
    pub scope: ScopeId,
    /// The turn of the repetition around it, in that scope.
    pub outer: TurnId,
    /// Whether the repetition is ended by what [counts](Counted).
    pub counted: bool,
}

/// Why something is not known when the model is compiled.
#[derive(Debug, Clone)]
pub(super) enum Unknown {
    /// Something that is read is not known: its place, and what it is.
    Reads(Span, String),
    /// What is read is at fault.
    Fault(Box<Diagnostic>),
    /// Nothing stands there, which the parser has said.
    Said,
}

impl Unknown {
    /// The fault, if it has not been said: `what` must be known.
    pub fn fault(self, what: &str) -> Option<Diagnostic> {
        match self {
            Unknown::Said => None,
            Unknown::Fault(fault) => Some(*fault),
            Unknown::Reads(span, why) => {
                let title = format!("{what} must be known when the model is compiled");
                let hint = "use whole numbers, loop variables, and parameters whose values are plain numbers";
                Some(Diagnostic::error(codes::N022, title, span, why).hint(hint))
            }
        }
    }
}

/// A named number that may shape the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Key<'a> {
    Declared(DeclId),
    /// One that is declared further down in a scope.
    Ahead(ScopeId, &'a str),
}

/// What is known of a named number.
#[derive(Clone)]
pub(super) enum Known<'a> {
    /// It is being found out.
    Open,
    /// A number, made of others.
    Number(Rational, Vec<Key<'a>>),
    /// Something else, which the words tell.
    Other(String),
}

/// The turns of all repetitions, and the numbers that shape the model.
#[derive(Clone)]
pub(super) struct Repeats<'a> {
    /// The turns. The first entry stands for the outside of all repetitions.
    pub turns: Vec<Option<Turn<'a>>>,
    pub known: FxHashMap<Key<'a>, Known<'a>>,
    /// The numbers that shape the model.
    shaping: FxHashSet<Key<'a>>,
    /// The named numbers that the expression reads.
    pub read: Vec<Key<'a>>,
    /// Where names are used in what shapes the model.
    pub uses: FxHashSet<(Key<'a>, Span)>,
    /// Whether a name is only looked up, which is no use of it.
    pub looking: bool,
    pub depth: usize,
    /// A parameter that counts so many turns, whatever its value.
    pub counted: Option<Counted<'a>>,
    /// How many turns have been made, those that are forgotten with them.
    made: usize,
}

impl Default for Repeats<'_> {
    fn default() -> Self {
        let (known, shaping) = (FxHashMap::default(), FxHashSet::default());
        let (uses, looking) = (FxHashSet::default(), false);
        let (turns, read) = (vec![None], Vec::new());
        Repeats { turns, known, shaping, read, uses, looking, depth: 0, counted: None, made: 0 }
    }
}

/// Turns.
impl<'a> Repeats<'a> {
    /// A new turn.
    pub fn turn(&mut self, variable: &'a ast::Name, value: i64, here: Here) -> TurnId {
        self.turns.push(Some(Turn { variable, value, scope: here.scope, outer: here.turn, counted: false }));
        self.made += 1;
        self.turns.len() - 1
    }

    /// A new turn of a repetition that is ended by what counts.
    pub fn counted_turn(&mut self, variable: &'a ast::Name, value: i64, here: Here) -> TurnId {
        let turn = self.turn(variable, value, here);
        self.turns[turn].iter_mut().for_each(|turn| turn.counted = true);
        turn
    }

    /// Takes back the last turn, which nothing refers to any more, and those after it.
    pub fn forget(&mut self, turn: TurnId) {
        self.turns.truncate(turn);
    }

    /// The values of the variable of a repetition of statements, of which there may be none; `None` if they are too many.
    pub fn turns_of(&self, from: i64, to: i64) -> Option<std::ops::RangeInclusive<i64>> {
        values_of(from, to, self.most(MAX_TURNS).checked_sub(self.turns.len())?)
    }

    /// The same for a sum.
    pub fn terms_of(&self, from: i64, to: i64) -> Option<std::ops::RangeInclusive<i64>> {
        values_of(from, to, self.most(MAX_TERMS).checked_sub(self.made)?)
    }

    /// What there may be at most where so much may be in the model itself.
    pub fn most(&self, most: usize) -> usize {
        self.counted.as_ref().map_or(most, |counted| counted.share_of(most))
    }

    /// All turns, in order.
    pub fn all(&self) -> impl Iterator<Item = &Turn<'a>> + '_ {
        self.turns.iter().flatten()
    }

    /// A turn and those around it, from within.
    pub fn around(&self, turn: TurnId) -> impl Iterator<Item = &Turn<'a>> + '_ {
        let at = |turn: TurnId| self.turns[turn].as_ref();
        std::iter::successors(at(turn), move |t| at(t.outer))
    }

    /// The value of a loop variable.
    pub fn variable(&self, turn: TurnId, name: &str) -> Option<i64> {
        self.around(turn).find(|t| t.variable.text == name).map(|t| t.value)
    }

    /// Whether a loop variable is one of a repetition that is ended by what counts.
    pub fn is_counted(&self, turn: TurnId, name: &str) -> bool {
        self.around(turn).find(|t| t.variable.text == name).is_some_and(|t| t.counted)
    }

    /// A turn in words: `i = 3, j = 1`.
    pub fn words(&self, turn: TurnId) -> String {
        let mut all: Vec<String> = self.around(turn).map(|t| format!("{} = {}", t.variable.text, t.value)).collect();
        all.reverse();
        all.join(", ")
    }
}

/// Numbers that shape the model.
impl<'a> Repeats<'a> {
    /// Indices behind a name.
    pub fn indices(
        &mut self,
        names: &Names<'a>,
        here: Here,
        list: &'a [ast::Expr],
    ) -> Result<Vec<i64>, Box<Diagnostic>> {
        let mut indices = Vec::with_capacity(list.len());
        for e in list {
            match self.place(names, here, e, "an index") {
                Ok((index, _)) => indices.push(index),
                Err(Some(fault)) => return Err(fault),
                // Brackets that are at fault, which the parser has said: the same words are said once.
                Err(None) => {
                    let fault = Diagnostic::error(codes::N021, "an index cannot be read", e.span, "here");
                    return Err(Box::new(fault));
                }
            }
        }
        Ok(indices)
    }

    /// A whole number that tells how many there are of something; the fault if it is none, unless that has been said.
    pub fn whole(
        &mut self,
        names: &Names<'a>,
        here: Here,
        e: &'a ast::Expr,
        what: &str,
    ) -> Result<i64, Option<Box<Diagnostic>>> {
        self.whole_seen(names, here, (e, what), |counted, number| counted.look_at_size(number)).map(|(whole, _)| whole)
    }

    /// The same of an index, or of an end of a repetition, and what it follows from.
    pub fn place(
        &mut self,
        names: &Names<'a>,
        here: Here,
        e: &'a ast::Expr,
        what: &str,
    ) -> Result<(i64, Reads), Option<Box<Diagnostic>>> {
        self.whole_seen(names, here, (e, what), |counted, number| counted.look_at_place(e, number))
    }

    fn whole_seen(
        &mut self,
        names: &Names<'a>,
        here: Here,
        (e, what): (&'a ast::Expr, &str),
        look: impl FnOnce(&Counted<'a>, &Rational),
    ) -> Result<(i64, Reads), Option<Box<Diagnostic>>> {
        let (number, reads) = self.reading(|r| r.shaped(|r| r.number(names, here, e, &[])), look);
        let number = number.map_err(|why| why.fault(what).map(Box::new))?;
        let whole = number.as_integer().ok_or_else(|| {
            let title = format!("{what} must be a whole number");
            let d = Diagnostic::error(codes::N021, title, e.span, format!("this is {number}"));
            Some(Box::new(d.hint("`floor` gives the whole number below")))
        })?;
        Ok((whole, reads))
    }

    /// Reads something, and looks at what it follows from.
    pub(super) fn reading<T>(
        &mut self,
        read: impl FnOnce(&mut Self) -> Result<T, Unknown>,
        look: impl FnOnce(&Counted<'a>, &T),
    ) -> (Result<T, Unknown>, Reads) {
        let outside = self.counted.as_mut().map(|counted| std::mem::take(&mut counted.reads));
        let found = read(self);
        let Some((counted, outside)) = self.counted.as_mut().zip(outside) else { return (found, Reads::default()) };
        match &found {
            Ok(found) => look(counted, found),
            // What is at fault here may be none elsewhere.
            Err(_) => counted.note_difference(),
        }
        let reads = counted.reads;
        counted.reads = Reads {
            count: outside.count || reads.count,
            variable: outside.variable || reads.variable,
            far: outside.far || reads.far,
        };
        (found, reads)
    }

    /// A condition that shapes the model.
    pub fn condition(&mut self, names: &Names<'a>, here: Here, e: &'a ast::Expr) -> Result<bool, Unknown> {
        self.reading(|r| r.shaped(|r| r.truth(names, here, e)), |counted, _| counted.look_at_condition(e)).0
    }

    /// The integer that a bare name stands for, if it does; it shapes the model only if [`whole`](Self::whole) asks.
    pub fn peek(&mut self, names: &Names<'a>, here: Here, name: &'a ast::Name) -> Option<i64> {
        if let Some(value) = self.variable(here.turn, &name.text) {
            return Some(value);
        }
        self.looking = true;
        let value = self.bare(names, here, name, &[]);
        self.looking = false;
        value.ok()?.as_integer()
    }

    /// A bare name as an index.
    pub fn name_as_index(&mut self, names: &Names<'a>, here: Here, name: &'a ast::Name) -> Option<i64> {
        let look = |counted: &Counted<'_>, number: &Rational| {
            if !counted.reads.count {
                counted.look_at_size(number);
            }
        };
        self.reading(|r| r.shaped(|r| r.bare(names, here, name, &[])), look).0.ok()?.as_integer()
    }

    /// How many values a list with `for` has, where that is known.
    pub fn length(&mut self, names: &Names<'a>, here: Here, list: &'a ast::Repeated) -> Option<i64> {
        let ends = |r: &mut Self| Ok((r.range_end(names, here, &list.from)?, r.range_end(names, here, &list.to)?));
        let (from, to) = self.reading(ends, |counted, ends| counted.look_at_size(&Rational::from(ends.1))).0.ok()?;
        Some(to.checked_sub(from)?.checked_add(1)?.max(0))
    }

    /// The declarations of numbers that shape the model.
    pub fn shaping<'s>(&'s self, names: &'s Names<'a>) -> impl Iterator<Item = DeclId> + 's {
        self.shaping.iter().filter_map(|key| match *key {
            Key::Declared(decl) => Some(decl),
            Key::Ahead(scope, name) => match names.scopes[scope].values.get(name) {
                Some(Valued::One(decl)) => Some(*decl),
                _ => None,
            },
        })
    }

    /// Adds where names are used in what shapes the model.
    pub fn add_uses(&self, names: &Names<'a>, uses: &mut Uses) {
        for &(key, span) in &self.uses {
            let used = match key {
                Key::Declared(decl) => names.used(decl),
                Key::Ahead(scope, name) => names.scopes[scope].values.get(name).map(|value| Used::of(*value)),
            };
            used.into_iter().for_each(|used| uses.add(used, span));
        }
    }

    /// What is read for this shapes the model.
    fn shaped<T>(&mut self, read: impl FnOnce(&mut Self) -> Result<T, Unknown>) -> Result<T, Unknown> {
        self.read.clear();
        let value = read(self)?;
        let mut found = std::mem::take(&mut self.read);
        while let Some(key) = found.pop() {
            if self.shaping.insert(key)
                && let Some(Known::Number(_, of)) = self.known.get(&key)
            {
                found.extend(of);
            }
        }
        self.read = found;
        Ok(value)
    }
}

/// The whole numbers from one to another, if they are no more than so many.
fn values_of(from: i64, to: i64, most: usize) -> Option<std::ops::RangeInclusive<i64>> {
    let count = i128::from(to) - i128::from(from) + 1;
    (count <= most as i128).then_some(from..=to)
}

/// The fault of a sum that is too long.
pub(super) fn too_long(span: Span) -> Diagnostic {
    let d = Diagnostic::error(codes::N013, "the sums are too long", span, "this many terms");
    d.note(format!("at most {MAX_TERMS} terms of all sums together"))
}
