//! What trees of three sizes have in common, so that those of other sizes follow.

use super::segments::{Segment, segments};
use super::tree::{At, Tree};

/// A number that grows with the turn, and with the size of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Line {
    at: i64,
    by_turn: i64,
    by_size: i64,
}

impl Line {
    /// Through its value in the first turn, in the one after it, and in the first turn of the next size.
    fn through(at: i64, next_turn: i64, next_size: i64) -> Option<Line> {
        Some(Line { at, by_turn: next_turn.checked_sub(at)?, by_size: next_size.checked_sub(at)? })
    }

    fn value(self, turn: i64, size: i64) -> i64 {
        self.at.wrapping_add(self.by_turn.wrapping_mul(turn)).wrapping_add(self.by_size.wrapping_mul(size))
    }
}

/// A piece of a text.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Piece {
    Letters(Box<str>),
    Number(Line),
}

/// What gives the tree of each size.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Rule {
    Whole(Line),
    Real(u64),
    Text(Vec<Piece>),
    Kept(u32),
    Group(u32, Vec<Rule>),
    /// A sequence of as many entries at all sizes.
    Few(Vec<Rule>),
    Row(Vec<Run>),
}

/// A part of a sequence.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Run {
    Once(Rule),
    /// So many turns, each of them the same rules.
    Turns(Line, Vec<Rule>),
}

/// A tree in the first turn, in the one after it, and in the first turn of the next size.
struct Seen<'t> {
    first: &'t Tree,
    next_turn: &'t Tree,
    next_size: &'t Tree,
}

impl Rule {
    /// The rule of trees of three sizes that follow each other, if they have one.
    pub fn learned(sizes: [&Tree; 3]) -> Option<Rule> {
        let rule = match sizes {
            [Tree::Group(name, a), Tree::Group(other, b), Tree::Group(third, c)] => {
                if name != other || name != third || a.len() != b.len() || a.len() != c.len() {
                    return None;
                }
                let parts = a.iter().zip(b).zip(c).map(|((a, b), c)| Rule::learned([a, b, c]));
                return Some(Rule::Group(*name, parts.collect::<Option<_>>()?));
            }
            [Tree::Row(a), Tree::Row(b), Tree::Row(c)] => return Rule::of_rows([a, b, c]),
            [a, b, _] => Rule::fitted(&Seen { first: a, next_turn: a, next_size: b })?,
        };
        rule.gives(sizes[2], 0, 2).then_some(rule)
    }

    fn of_rows(rows: [&[Tree]; 3]) -> Option<Rule> {
        if rows[0].len() == rows[1].len() && rows[0].len() == rows[2].len() {
            let [a, b, c] = rows;
            let few = a.iter().zip(b).zip(c).map(|((a, b), c)| Rule::learned([a, b, c]));
            return Some(Rule::Few(few.collect::<Option<_>>()?));
        }
        let parted = rows.map(segments);
        let [a, b, c] = &parted;
        if a.len() != b.len() || a.len() != c.len() {
            return None;
        }
        let runs = a.iter().zip(b).zip(c).map(|((a, b), c)| Run::learned(rows, [*a, *b, *c]));
        Some(Rule::Row(runs.collect::<Option<_>>()?))
    }

    /// The only rule that these can have.
    fn fitted(seen: &Seen<'_>) -> Option<Rule> {
        Some(match (seen.first, seen.next_turn, seen.next_size) {
            (&Tree::Whole(a), &Tree::Whole(b), &Tree::Whole(c)) => Rule::Whole(Line::through(a, b, c)?),
            (&Tree::Real(a), &Tree::Real(b), &Tree::Real(c)) if a == b && a == c => Rule::Real(a),
            (Tree::Text(a), Tree::Text(b), Tree::Text(c)) => Rule::Text(text(a, b, c)?),
            (Tree::Kept(a), Tree::Kept(b), Tree::Kept(c)) if a == b && a == c => Rule::Kept(*a),
            (Tree::Group(name, a), Tree::Group(other, b), Tree::Group(third, c)) if name == other && name == third => {
                Rule::Group(*name, Rule::all_fitted(a, b, c)?)
            }
            (Tree::Row(a), Tree::Row(b), Tree::Row(c)) => Rule::Few(Rule::all_fitted(a, b, c)?),
            _ => return None,
        })
    }

    fn all_fitted(a: &[Tree], b: &[Tree], c: &[Tree]) -> Option<Vec<Rule>> {
        if a.len() != b.len() || a.len() != c.len() {
            return None;
        }
        let seen = a.iter().zip(b).zip(c).map(|((first, next_turn), next_size)| Seen { first, next_turn, next_size });
        seen.map(|seen| Rule::fitted(&seen)).collect()
    }

    /// Whether it gives this tree.
    pub fn gives(&self, tree: &Tree, turn: i64, size: i64) -> bool {
        match (self, tree) {
            (Rule::Whole(line), Tree::Whole(number)) => line.value(turn, size) == *number,
            (Rule::Real(bits), Tree::Real(own)) => bits == own,
            (Rule::Text(pieces), Tree::Text(own)) => written(pieces, turn, size) == **own,
            (Rule::Kept(place), Tree::Kept(own)) => place == own,
            (Rule::Group(name, _), Tree::Group(own, _)) if name != own => false,
            (Rule::Group(_, parts), Tree::Group(_, all)) | (Rule::Few(parts), Tree::Row(all)) => {
                parts.len() == all.len() && parts.iter().zip(all).all(|(r, t)| r.gives(t, turn, size))
            }
            (Rule::Row(runs), Tree::Row(all)) => {
                let mut rest = &all[..];
                let mut next = |rule: &Rule, turn: i64| {
                    let Some((tree, behind)) = rest.split_first() else { return false };
                    rest = behind;
                    rule.gives(tree, turn, size)
                };
                let given = runs.iter().all(|run| match run {
                    Run::Once(rule) => next(rule, turn),
                    Run::Turns(count, body) => {
                        (0..count.value(0, size)).all(|turn| body.iter().all(|rule| next(rule, turn)))
                    }
                });
                given && rest.is_empty()
            }
            _ => false,
        }
    }
}

impl Run {
    /// The rule of segments of rows of three sizes.
    fn learned(rows: [&[Tree]; 3], segments: [Segment; 3]) -> Option<Run> {
        let [a, b, c] = segments;
        if [b.period, c.period] != [a.period; 2] {
            return None;
        }
        if [a.turns, b.turns, c.turns] == [1; 3] {
            return Rule::learned([&rows[0][a.first], &rows[1][b.first], &rows[2][c.first]]).map(Run::Once);
        }
        if a.turns < 2 {
            return None;
        }
        let count = Line::through(a.turns as i64, a.turns as i64, b.turns as i64)?;
        let body = (0..a.period).map(|place| {
            let (first, next_turn) = (&rows[0][a.first + place], &rows[0][a.first + a.period + place]);
            Rule::fitted(&Seen { first, next_turn, next_size: &rows[1][b.first + place] })
        });
        let body: Vec<Rule> = body.collect::<Option<_>>()?;
        let is_right = |size: usize| {
            let Segment { first, period, turns } = segments[size];
            let item = |turn: usize, place: usize| &rows[size][first + turn * period + place];
            let rules = || body.iter().enumerate();
            count.value(0, size as i64) == turns as i64
                && (0..turns).all(|t| rules().all(|(place, r)| r.gives(item(t, place), t as i64, size as i64)))
        };
        (0..3).all(is_right).then_some(Run::Turns(count, body))
    }
}

/// What is made by a rule.
impl Rule {
    pub fn whole(&self, at: &At<'_>) -> Option<i64> {
        let Rule::Whole(line) = self else { return None };
        Some(line.value(at.turn, at.size))
    }

    pub fn real(&self) -> Option<f64> {
        let Rule::Real(bits) = self else { return None };
        Some(f64::from_bits(*bits))
    }

    pub fn text(&self, at: &At<'_>) -> Option<String> {
        let mut text = String::new();
        self.write(&mut text, at)?;
        Some(text)
    }

    /// Adds a text.
    pub fn write(&self, text: &mut String, at: &At<'_>) -> Option<()> {
        let Rule::Text(pieces) = self else { return None };
        write(text, pieces, at.turn, at.size);
        Some(())
    }

    pub fn group(&self) -> Option<(u32, &[Rule])> {
        let Rule::Group(number, parts) = self else { return None };
        Some((*number, parts))
    }

    /// The number of entries of a sequence.
    pub fn length(&self, at: &At<'_>) -> Option<usize> {
        let of = |run: &Run| match run {
            Run::Once(_) => Some(1),
            Run::Turns(count, body) => usize::try_from(count.value(0, at.size)).ok()?.checked_mul(body.len()),
        };
        match self {
            Rule::Few(entries) => Some(entries.len()),
            Rule::Row(runs) => runs.iter().try_fold(0usize, |sum, run| sum.checked_add(of(run)?)),
            _ => None,
        }
    }

    /// Visits the rules of the entries of a sequence, each where it is made.
    pub fn for_each_entry<'r>(
        &'r self,
        at: &At<'r>,
        mut visit: impl FnMut(&'r Rule, &At<'r>) -> Option<()>,
    ) -> Option<()> {
        match self {
            Rule::Few(entries) => entries.iter().try_for_each(|rule| visit(rule, at)),
            Rule::Row(runs) => runs.iter().try_for_each(|run| match run {
                Run::Once(rule) => visit(rule, at),
                Run::Turns(count, body) => (0..count.value(0, at.size)).try_for_each(|turn| {
                    let at = At { turn, ..*at };
                    body.iter().try_for_each(|rule| visit(rule, &at))
                }),
            }),
            _ => None,
        }
    }
}

/// A text in pieces: letters, and numbers without leading zeros.
pub(super) fn pieces(text: &str) -> impl Iterator<Item = (&str, Option<i64>)> {
    let mut rest = text;
    std::iter::from_fn(move || {
        let is_digit = rest.bytes().next()?.is_ascii_digit();
        let end = rest.bytes().position(|b| b.is_ascii_digit() != is_digit).unwrap_or(rest.len());
        let (piece, behind) = rest.split_at(end);
        rest = behind;
        let plain = is_digit && piece.len() < 16 && (piece == "0" || !piece.starts_with('0'));
        Some((piece, if plain { piece.parse().ok() } else { None }))
    })
}

fn text(a: &str, b: &str, c: &str) -> Option<Vec<Piece>> {
    let (mut second, mut third) = (pieces(b), pieces(c));
    let mut all = Vec::new();
    for (piece, number) in pieces(a) {
        let (other, last) = (second.next()?, third.next()?);
        all.push(match (number, other.1, last.1) {
            (Some(a), Some(b), Some(c)) => Piece::Number(Line::through(a, b, c)?),
            (None, None, None) if piece == other.0 && piece == last.0 => Piece::Letters(piece.into()),
            _ => return None,
        });
    }
    (second.next().is_none() && third.next().is_none()).then_some(all)
}

fn written(pieces: &[Piece], turn: i64, size: i64) -> String {
    let mut text = String::new();
    write(&mut text, pieces, turn, size);
    text
}

fn write(text: &mut String, pieces: &[Piece], turn: i64, size: i64) {
    let length = |piece: &Piece| if let Piece::Letters(letters) = piece { letters.len() } else { 6 };
    text.reserve(pieces.iter().map(length).sum());
    for piece in pieces {
        match piece {
            Piece::Letters(letters) => text.push_str(letters),
            Piece::Number(line) => push_number(text, line.value(turn, size)),
        }
    }
}

fn push_number(text: &mut String, number: i64) {
    let mut digits = [0u8; 20];
    let (mut rest, mut from) = (number.unsigned_abs(), digits.len());
    loop {
        from -= 1;
        digits[from] = b'0' + (rest % 10) as u8;
        rest /= 10;
        if rest == 0 {
            break;
        }
    }
    if number < 0 {
        text.push('-');
    }
    text.extend(digits[from..].iter().map(|&digit| char::from(digit)));
}
