//! Where a unit ends: it has no spaces inside.

use super::*;

/// Words that can follow a number without being a unit.
const NOT_UNITS: [&str; 6] = ["as", "at", "from", "for", "elseif", "elif"];

impl Parser<'_> {
    /// The unit right after a number, on the same line. A `*` after it is a product, not part of the unit.
    pub(super) fn unit_of_number(&mut self) -> Option<UnitText> {
        let length = self.unit_length(0, false)?;
        let last = self.ahead(length - 1);
        let calls = last.kind == TokenKind::Ident
            && self.ahead(length).kind == TokenKind::LParen
            && self.adjacent(length)
            && length == 1;
        if calls { None } else { Some(self.take_unit(length)) }
    }

    /// The unit after `:`, which has been read.
    pub(super) fn unit_after_colon(&mut self) -> Option<UnitText> {
        let one = self.is(TokenKind::Number) && self.text_of(self.token()) == "1";
        match self.unit_length(0, true) {
            Some(length) => Some(self.take_unit(length)),
            None if one => Some(self.take_unit(1)),
            None => {
                self.expected("a unit");
                None
            }
        }
    }

    fn take_unit(&mut self, length: usize) -> UnitText {
        let start = self.span();
        self.pos += length;
        let span = self.since(start);
        self.units.push(span);
        UnitText { text: self.text[span.start as usize..span.end as usize].to_owned(), span }
    }

    /// The number of tokens, from the `i`-th on, that make a unit.
    fn unit_length(&self, i: usize, after_colon: bool) -> Option<usize> {
        if self.boundary() {
            return None;
        }
        let first = self.unit_symbol(i).or_else(|| self.reciprocal(i))?;
        let mut length = first;
        while let Some(more) = self.unit_factor(i + length, after_colon) {
            length += more;
        }
        Some(length)
    }

    /// `1` where `/s` follows without a space.
    fn reciprocal(&self, i: usize) -> Option<usize> {
        let one = self.ahead(i).kind == TokenKind::Number && self.text_of(self.ahead(i)) == "1";
        (one && self.unit_factor(i + 1, false).is_some() && self.ahead(i + 1).kind == TokenKind::Slash).then_some(1)
    }

    /// `.m`, `/s`, `/(kg.K)`, with nothing before, between or inside.
    fn unit_factor(&self, i: usize, after_colon: bool) -> Option<usize> {
        let operator = match self.ahead(i).kind {
            TokenKind::Dot | TokenKind::Slash | TokenKind::MiddleDot => true,
            TokenKind::Star => after_colon,
            _ => false,
        };
        if !operator || !self.adjacent(i) || !self.adjacent(i + 1) {
            return None;
        }
        match self.unit_symbol(i + 1) {
            Some(length) => Some(1 + length),
            None => self.unit_group(i + 1).map(|length| 1 + length),
        }
    }

    /// `(kg.K)`.
    fn unit_group(&self, i: usize) -> Option<usize> {
        if self.ahead(i).kind != TokenKind::LParen || !self.adjacent(i + 1) {
            return None;
        }
        let mut length = 1 + self.unit_symbol(i + 1)?;
        while let Some(more) = self.plain_factor(i + length) {
            length += more;
        }
        let closed = self.ahead(i + length).kind == TokenKind::RParen && self.adjacent(i + length);
        closed.then_some(length + 1)
    }

    /// A factor inside parentheses, where no further parentheses can stand.
    fn plain_factor(&self, i: usize) -> Option<usize> {
        let operator =
            matches!(self.ahead(i).kind, TokenKind::Dot | TokenKind::Slash | TokenKind::MiddleDot | TokenKind::Star);
        if !operator || !self.adjacent(i) || !self.adjacent(i + 1) {
            return None;
        }
        Some(1 + self.unit_symbol(i + 1)?)
    }

    /// `m`, `m2`, `m^2`, `m²`, `%`.
    fn unit_symbol(&self, i: usize) -> Option<usize> {
        let token = self.ahead(i);
        let length = match token.kind {
            TokenKind::Ident if !self.never_a_unit(token) => 1,
            TokenKind::Percent => 1,
            TokenKind::Degree if self.ahead(i + 1).kind == TokenKind::Ident && self.adjacent(i + 1) => 2,
            TokenKind::Degree => 1,
            _ => return None,
        };
        Some(length + self.unit_exponent(i + length))
    }

    fn never_a_unit(&self, token: Token) -> bool {
        let text = self.text_of(token);
        RESERVED.contains(&text) || NOT_UNITS.contains(&text)
    }

    /// `^2`, `^-1`, `^0.5`, `²`; 0 tokens if there is no exponent.
    fn unit_exponent(&self, i: usize) -> usize {
        let follows = |n: usize, kind: TokenKind| self.ahead(i + n).kind == kind && self.adjacent(i + n);
        if follows(0, TokenKind::Superscript) {
            1
        } else if follows(0, TokenKind::Caret) && follows(1, TokenKind::Number) {
            2
        } else if follows(0, TokenKind::Caret) && follows(1, TokenKind::Minus) && follows(2, TokenKind::Number) {
            3
        } else if follows(0, TokenKind::Caret) && follows(1, TokenKind::LParen) {
            self.fraction(i + 2).map_or(0, |length| 3 + length)
        } else {
            0
        }
    }

    /// `1/2` or `-1/2` before a closing parenthesis.
    fn fraction(&self, i: usize) -> Option<usize> {
        let sign = usize::from(self.ahead(i).kind == TokenKind::Minus);
        let kinds = [TokenKind::Number, TokenKind::Slash, TokenKind::Number, TokenKind::RParen];
        let fits = kinds.iter().enumerate().all(|(n, kind)| self.ahead(i + sign + n).kind == *kind);
        let together = (0..4 + sign).all(|n| self.adjacent(i + n));
        (fits && together).then_some(sign + 3)
    }
}
