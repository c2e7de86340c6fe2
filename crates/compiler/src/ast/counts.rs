//! Parameters that count the turns of repetitions.

use rustc_hash::FxHashSet;
use std::ops::Range;

use super::lexer::{Token, TokenKind, lex};
use crate::span::{FileId, Span};

/// A parameter that counts: it is the end of repetitions, and where it or their variables decide what there is they stand in
/// indices and in comparisons alone, with whole numbers added to them. Besides it may be a number in expressions, as in
/// `length/n`; their variables may not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Count {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: i64,
    /// Where that stands.
    pub span: Span,
    /// The greatest whole number that it or a variable is compared with, or that is added to one: what is made further
    /// away from the ends of its repetitions is made of the same text in the same way.
    pub reach: i64,
}

/// The parameters of a model that count, in the order of the text.
///
/// Names are taken for what they are called, wherever they stand: a parameter whose name, or that of a variable of its
/// repetitions, is used for something else as well is left out. What is made of a parameter that counts, and decides what there
/// is, does not show here.
///
/// ```
/// use halfarrow_compiler::ast::counts;
/// let text = "model M\nparam n = 90\nfor i in 2..n { 0:a[i] -> R:b[i](1 ohm); a[i] -> 1:c[i] -> a[i - 1] }\n";
/// let found = &counts(text)[0];
/// assert_eq!((found.name.as_str(), found.value, found.reach), ("n", 90, 2));
/// assert_eq!(counts(&text.replace("1 ohm", "1 ohm/n")).len(), 1);
/// assert!(counts(&text.replace("1 ohm", "i*1 ohm")).is_empty());
/// ```
pub fn counts(text: &str) -> Vec<Count> {
    let is_meant = |token: &Token| !matches!(token.kind, TokenKind::Comment | TokenKind::BlockComment);
    let words = Words { text, tokens: lex(text).into_iter().filter(is_meant).collect() };
    let all = || 0..words.tokens.len();
    let repetitions: Vec<Repetition> = all().filter_map(|at| words.repetition(at)).collect();
    let ends = repetitions.iter().flat_map(Repetition::ends).filter_map(|end| end.name);
    let counted: FxHashSet<&str> = ends.map(|end| words.word(end)).collect();
    let declared = all().filter_map(|at| words.declared(at)).filter(|(name, _)| counted.contains(words.word(*name)));
    declared.filter_map(|(name, value)| words.count(name, value, &repetitions)).collect()
}

/// A model as its words.
struct Words<'t> {
    text: &'t str,
    tokens: Vec<Token>,
}

/// A name with a whole number added to it, or such a number alone.
struct Side {
    end: usize,
    name: Option<usize>,
    number: i64,
}

/// `for variable in from..to {`.
struct Repetition {
    variable: usize,
    from: Side,
    to: Side,
}

impl Repetition {
    fn ends(&self) -> impl Iterator<Item = &Side> {
        [&self.from, &self.to].into_iter()
    }
}

impl<'t> Words<'t> {
    fn kind(&self, at: usize) -> TokenKind {
        self.tokens.get(at).map_or(TokenKind::End, |token| token.kind)
    }

    fn word(&self, at: usize) -> &'t str {
        self.tokens.get(at).map_or("", |token| &self.text[token.start as usize..token.end as usize])
    }

    fn is_word(&self, at: Option<usize>, among: &[&str]) -> bool {
        at.is_some_and(|at| self.kind(at) == TokenKind::Ident && among.contains(&self.word(at)))
    }

    fn whole(&self, at: usize) -> Option<i64> {
        let number = (self.kind(at) == TokenKind::Number).then(|| self.word(at))?;
        number.parse().ok()
    }

    /// The name and the value of `param n = 100`, which nothing follows in its line but words on it.
    fn declared(&self, at: usize) -> Option<(usize, i64)> {
        let begins = self.is_word(Some(at), &["param"]) && self.kind(at + 1) == TokenKind::Ident;
        let value = (begins && self.kind(at + 2) == TokenKind::Assign).then(|| self.whole(at + 3))??;
        let next = self.tokens.get(at + 4)?;
        (next.newlines > 0 || matches!(next.kind, TokenKind::Text | TokenKind::End)).then_some((at + 1, value))
    }

    /// What a declared parameter counts, if it does.
    fn count(&self, name: usize, value: i64, all: &[Repetition]) -> Option<Count> {
        let counted = self.word(name);
        let ends_there = |r: &&Repetition| r.ends().any(|end| end.name.is_some_and(|n| self.word(n) == counted));
        let repetitions: Vec<&Repetition> = all.iter().filter(ends_there).collect();
        let variables = repetitions.iter().map(|r| self.word(r.variable));
        let names: Vec<&str> = std::iter::once(counted).chain(variables).collect();
        let mut reach = repetitions.iter().flat_map(|r| r.ends()).map(|end| end.number).max()?;
        for at in (0..self.tokens.len()).filter(|&at| at != name) {
            let is_meant = self.is_word(Some(at), &names);
            let belongs = |r: &&Repetition| r.variable == at || r.ends().any(|end| end.name == Some(at));
            if is_meant && !repetitions.iter().any(belongs) {
                let is_number = self.word(at) == counted && self.is_number(at);
                reach = reach.max(if is_number { 0 } else { self.reach_of_use(at, &names)? });
            }
        }
        let token = &self.tokens[name + 2];
        let span = Span { file: FileId(0), start: token.start, end: token.end };
        Some(Count { name: counted.to_string(), value, span, reach })
    }

    /// `for i in from..to {` that begins here.
    fn repetition(&self, at: usize) -> Option<Repetition> {
        let begins = self.is_word(Some(at), &["for"]) && self.is_word(Some(at + 2), &["in"]);
        let from = begins.then(|| self.side(at + 3))??;
        let to = (self.kind(from.end) == TokenKind::DotDot).then(|| self.side(from.end + 1))??;
        (self.kind(to.end) == TokenKind::LBrace).then_some(Repetition { variable: at + 1, from, to })
    }

    /// A side that begins here: `i`, `i + 1`, `1 + i`, `3`.
    fn side(&self, at: usize) -> Option<Side> {
        let adds = |at: usize| matches!(self.kind(at), TokenKind::Plus | TokenKind::Minus);
        let is_name = |at: usize| self.kind(at) == TokenKind::Ident;
        match self.whole(at) {
            Some(number) if self.kind(at + 1) == TokenKind::Plus && is_name(at + 2) => {
                Some(Side { end: at + 3, name: Some(at + 2), number })
            }
            Some(number) => Some(Side { end: at + 1, name: None, number }),
            None if !is_name(at) => None,
            None if adds(at + 1) => Some(Side { end: at + 3, name: Some(at), number: self.whole(at + 2)? }),
            None => Some(Side { end: at + 1, name: Some(at), number: 0 }),
        }
    }

    /// Whether a name stands in an expression that gives a number, and not in one that tells how often something is there, or
    /// whether, or which of many it is.
    fn is_number(&self, at: usize) -> bool {
        use TokenKind::{
            Assign, Caret, Comma, DotDot, End, LBrace, LParen, Minus, Plus, RBrace, RParen, Semicolon, Slash, Star,
            Text,
        };
        let begins = at.checked_sub(1).is_some_and(|before| {
            matches!(self.kind(before), Assign | Caret | Comma | LParen | Minus | Plus | Slash | Star)
        });
        let ends = self.tokens.get(at + 1).is_none_or(|next| {
            let within = matches!(next.kind, Caret | Comma | Minus | Plus | RParen | Slash | Star);
            within || next.newlines > 0 || matches!(next.kind, End | RBrace | Semicolon | Text)
        });
        let statement = self.statement(at);
        let brackets = |kind: TokenKind| (statement.start..at).filter(|&other| self.kind(other) == kind).count();
        let is_index = brackets(TokenKind::LBracket) > brackets(TokenKind::RBracket);
        let heads_block = (at..statement.end).any(|other| self.kind(other) == LBrace);
        let repeats = |other: usize| self.kind(other) == DotDot || self.is_word(Some(other), &["for"]);
        begins && ends && !is_index && !heads_block && !statement.into_iter().any(repeats)
    }

    /// The words of the statement that a word stands in, with the `{` behind it.
    fn statement(&self, at: usize) -> Range<usize> {
        use TokenKind::{LBrace, LBracket, LParen, RBrace, RBracket, RParen, Semicolon};
        let (mut start, mut open) = (0, 0usize);
        for (other, token) in self.tokens.iter().enumerate() {
            let next_line = token.newlines > 0 && open == 0;
            if (next_line || matches!(token.kind, RBrace | Semicolon)) && other > at {
                return start..other;
            }
            if next_line {
                start = other;
            }
            match token.kind {
                LParen | LBracket => open += 1,
                RParen | RBracket => open = open.saturating_sub(1),
                LBrace if other > at => return start..other + 1,
                LBrace | RBrace | Semicolon => (start, open) = (other + 1, 0),
                _ => {}
            }
        }
        start..self.tokens.len()
    }

    /// How far a name reaches where it stands, if it only counts there.
    fn reach_of_use(&self, at: usize, names: &[&str]) -> Option<i64> {
        let is_sum = at.checked_sub(1).is_some_and(|plus| self.kind(plus) == TokenKind::Plus);
        let start = if is_sum { at.checked_sub(2).filter(|&number| self.whole(number).is_some())? } else { at };
        let side = self.side(start).filter(|side| side.name == Some(at))?;
        let (left, right) = (start.checked_sub(1)?, side.end);
        if self.is_index(left, right, self.word(at) == names[0]) {
            return Some(side.number);
        }
        let other = self.compared(start, right, names)?;
        Some(side.number.max(other))
    }

    /// Whether what stands between two words is an index behind a name; where it is `counted` itself, not the size of an
    /// array that is declared.
    fn is_index(&self, left: usize, right: usize, counted: bool) -> bool {
        use TokenKind::{Assign, Comma, Ident, LBracket, Minus, Number, Plus, RBracket};
        let begins = matches!(self.kind(left), LBracket | Comma);
        let ends = matches!(self.kind(right), RBracket | Comma);
        let inside = |at: &usize| matches!(self.kind(*at), Comma | Ident | Number | Plus | Minus);
        let open = (0..=left).rev().find(|at| !inside(at)).filter(|&at| self.kind(at) == LBracket);
        let named = open.and_then(|at| at.checked_sub(1)).filter(|&before| self.kind(before) == Ident);
        let words = ["if", "and", "or", "not", "then", "else"];
        let closed = (right..self.tokens.len()).find(|at| !inside(at)).filter(|&at| self.kind(at) == RBracket);
        let is_given = closed.is_none_or(|at| self.kind(at + 1) == Assign);
        let begins_line = |at: &usize| self.tokens[*at].newlines > 0;
        let line = (0..=left).rev().find(begins_line).unwrap_or(0);
        let declares = counted && (is_given || self.is_word(Some(line), &["param", "const", "input"]));
        begins && ends && named.is_some() && !self.is_word(named, &words) && !declares
    }

    /// The greatest number in what a side is compared with, where it is compared with such a side.
    fn compared(&self, start: usize, end: usize, names: &[&str]) -> Option<i64> {
        use TokenKind::{EqEq, Greater, GreaterEq, Less, LessEq, NotEq};
        let compares = |at: usize| matches!(self.kind(at), EqEq | NotEq | Less | LessEq | Greater | GreaterEq);
        let left = start.checked_sub(1)?;
        let begins = |at: Option<usize>| self.is_word(at, &["if", "and", "or", "not"]);
        let ends = |at: usize| self.kind(at) == TokenKind::LBrace || self.is_word(Some(at), &["and", "or", "then"]);
        let counts = |side: &Side| side.name.is_none_or(|name| names.contains(&self.word(name)));
        let other = if compares(end) && begins(Some(left)) {
            self.side(end + 1).filter(|side| ends(side.end))?
        } else if compares(left) && ends(end) {
            let starts = [1, 3].into_iter().filter_map(|length| left.checked_sub(length));
            let whole = |from: usize| self.side(from).filter(|side| side.end == left && begins(from.checked_sub(1)));
            starts.into_iter().find_map(whole)?
        } else {
            return None;
        };
        counts(&other).then_some(other.number)
    }
}

#[cfg(test)]
mod tests {
    use super::counts;

    fn found(body: &str) -> Vec<(String, i64)> {
        let text =
            format!("model M \"of n parts\"\nparam n = 900 \"how many\"\nparam m = 4\nparam r = 1 ohm\n{body}\n");
        counts(&text).into_iter().map(|c| (c.name, c.reach)).collect()
    }

    #[test]
    fn ends_of_repetitions_indices_and_comparisons_count() {
        let of = |reach| vec![("n".to_string(), reach)];
        assert_eq!(found("for i in 1..n { 0:a[i] -> R:b[i](r) }"), of(1));
        assert_eq!(found("for i in 2..n - 3 { 0:a[i, 7] -> R:b[1 + i](r) } // n*2"), of(3));
        assert_eq!(
            found("for i in 1..n { if i == 1 or n > i + 4 { 0:a[i] } else if not i != 5 { 1:b } }\noutput e = a[n].e"),
            of(5)
        );
        assert_eq!(found("for i in 1..n { for j in 1..3 { if j*j > 2 { 0:a[i, j] -> a[i - 1, j] } } }"), of(1));
        assert_eq!(found("for i in 1..n { state x[i]' = a[i].f }\nlet d = x[n] - x[n - 2]"), of(2));
        assert_eq!(found("for i in 1..n { R:b[i](if i <= 2 then r else 2*r) -> 0:a[i] }"), of(2));
    }

    #[test]
    fn what_counts_may_be_a_number_too() {
        for body in [
            "for i in 1..n { 0:a[i] -> R:b[i](r/n) }",
            "for i in 1..n { 0:a[i] -> R:b[i](r*(n + 1)^2); a[i] -> C:c[i](1, q0 = n) }",
            "for i in 1..n { 0:a[i] }\nparam s = r - n*r",
            "for i in 1..n { 0:a[i] }\nparam s = 1*n \"as many\"",
            "for i in 1..n { 0:a[i] }\nparam s = r/n",
            "for i in 1..n { 0:a[i] }\nlet s = max(r*n,\n  -n)",
            "param s = n\nfor i in 1..n { 0:a[i] }",
        ] {
            assert_eq!(found(body), [("n".to_string(), 1)], "{body}");
        }
    }

    #[test]
    fn what_is_used_otherwise_does_not_count() {
        for body in [
            "for i in 1..n { 0:a[i] -> R:b[i](r*i) }",
            "for i in 1..n { param k[i] = i*r }",
            "for i in 1..n { 0:a[i] }\nconst k[n] = 1",
            "for i in 1..n { 0:a[i] }\nconst k[2*n] = 1",
            "for i in 1..n { 0:a[i] }\ninput u[n]",
            "for i in 1..n { 0:a[i] -> R:b[i](i) }",
            "for i in 1..n { if i == n/2 { 0:a[i] } }",
            "for i in 1..n { if 2*n > 5\n { 0:a[i] } }",
            "for i in 1..n { 0:a[i] }\n1:b -> 0:a[n/2]",
            "for i in 1..n { 0:a[i] }\nlet s = sum(j in 1..2*n, j)",
            "for i in 1..n { 0:a[i] }\nlet s = sum(j in 1..\n2*n, j)",
            "for i in 1..n { 0:a[i] }\nfor j in 1..\n2*n {}",
            "for i in 1..n { 0:a[i] }\nI:n(3)",
            "for i in 1..n { if 2*i == 4 { 0:a[i] } }",
            "for i in 1..n { if i == 2*m { 0:a[i] } }",
            "for i in 1..n { if i == m { 0:a[i] } }",
            "for i in 1..n { 0:a[2*i] }",
            "for i in 1..n { 0:a[i] -> R:b[i]([i, 2]) }",
            "for i in 1..n { 0:a[i] -> R:b[i](f[1](i)) }",
            "for i in 1..2*n { 0:a[i] }",
            "for i in 1..n { for j in i..2*i { 0:a[i, j] } }",
            "param k[n] = [10*i for i in 1..n]",
            "let s = sum(a[i].e for i in 1..n)",
            "for i in 1..n { 0:a[i] }\nlet n = 3",
            "for i in 1..n { 0:a[i] -> I:i(1) }",
            "for i in 1..n { when a[i].e > i { reset x = 0 } }",
            "0:a -> R:b(r)",
        ] {
            assert_eq!(found(body), [], "{body}");
        }
    }

    #[test]
    fn a_parameter_that_follows_from_others_is_none() {
        assert!(counts("model M\nparam m = 3\nparam n = 2*m\nfor i in 1..n { 0:a[i] }\n").is_empty());
        assert!(counts("model M\nparam n = 20 m\nfor i in 1..n { 0:a[i] }\n").is_empty());
    }
}
