//! Model text to tokens: one pass, one character of foresight but for what is written between marks.

use unicode_ident::{is_xid_continue, is_xid_start};

/// The kinds of tokens. Words are all [`Ident`](TokenKind::Ident): what is a keyword depends on where it stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TokenKind {
    /// A letter of any script or `_`, then letters, digits and `_`.
    Ident,
    /// Digits, perhaps a fraction, perhaps a power of ten.
    Number,
    /// `"..."` within a line; a backslash takes the next character along.
    Text,
    /// The same without its end.
    OpenText,
    Arrow,
    LParen,
    RParen,
    LBracket,
    RBracket,
    LBrace,
    RBrace,
    Comma,
    Semicolon,
    Colon,
    Dot,
    DotDot,
    Assign,
    EqEq,
    NotEq,
    Less,
    LessEq,
    Greater,
    GreaterEq,
    Plus,
    Minus,
    Star,
    Slash,
    Caret,
    Prime,
    Percent,
    Degree,
    MiddleDot,
    /// Raised digits and signs.
    Superscript,
    Newline,
    /// `// ...` to the end of the line.
    Comment,
    /// `/* ... */`, which other languages have.
    BlockComment,
    /// Characters without a meaning.
    Unknown,
    /// The end of the text.
    End,
}

/// A token: what it is and which bytes of the text it covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Token {
    pub kind: TokenKind,
    /// Newlines since the token or comment before it: 0, 1, or 2 for more.
    pub newlines: u8,
    pub start: u32,
    pub end: u32,
}

/// The tokens of a text, the last one being [`TokenKind::End`], with comments but without newlines.
///
/// The text must be shorter than 4 GiB.
pub(super) fn lex(text: &str) -> Vec<Token> {
    let mut tokens: Vec<Token> = Vec::with_capacity(text.len() / 3 + 1);
    let (mut newlines, mut at) = (0, 0);
    loop {
        at += leading(&text[at..], is_blank);
        let (kind, length) = first(&text[at..]);
        let (start, end) = (at as u32, (at + length) as u32);
        at += length;
        match tokens.last_mut() {
            _ if kind == TokenKind::Newline => newlines = (newlines + 1).min(2),
            Some(last) if kind == TokenKind::Unknown && last.kind == kind && last.end == start => last.end = end,
            _ => {
                tokens.push(Token { kind, newlines, start, end });
                newlines = 0;
            }
        }
        if kind == TokenKind::End {
            return tokens;
        }
    }
}

/// The token that a text begins with, and its length in bytes.
fn first(text: &str) -> (TokenKind, usize) {
    let mut chars = text.chars();
    let Some(c) = chars.next() else { return (TokenKind::End, 0) };
    match (c, chars.next()) {
        ('"', _) => quoted(text),
        ('/', Some('/')) => (TokenKind::Comment, leading(text, |c| c != '\n')),
        ('/', Some('*')) => match text[2..].find("*/") {
            Some(inside) => (TokenKind::BlockComment, inside + 4),
            None => (TokenKind::Slash, 1),
        },
        ('0'..='9', _) => (TokenKind::Number, number(text)),
        (c, _) if c == '_' || is_xid_start(c) => (TokenKind::Ident, leading(text, is_of_name)),
        (c, _) if is_raised(c) => (TokenKind::Superscript, leading(text, is_raised)),
        (c, next) => sign(c, next),
    }
}

/// A text between quotation marks, or what of it stands in its line.
fn quoted(text: &str) -> (TokenKind, usize) {
    let mut chars = text.char_indices().skip(1);
    while let Some((at, c)) = chars.next() {
        match c {
            '"' => return (TokenKind::Text, at + 1),
            '\n' => return (TokenKind::OpenText, at),
            '\\' if text[at + 1..].starts_with('\n') => return (TokenKind::OpenText, at + 1),
            '\\' => _ = chars.next(),
            _ => {}
        }
    }
    (TokenKind::OpenText, text.len())
}

/// The length of the number that a text begins with. A fraction or a power without digits is not part of it.
fn number(text: &str) -> usize {
    let digits = |at: usize| leading(&text[at..], |c| c.is_ascii_digit());
    let mut length = digits(0);
    if text[length..].starts_with('.') && digits(length + 1) > 0 {
        length += 1 + digits(length + 1);
    }
    if text[length..].starts_with(['e', 'E']) {
        let exponent = length + 1 + usize::from(text[length + 1..].starts_with(['+', '-']));
        if digits(exponent) > 0 {
            length = exponent + digits(exponent);
        }
    }
    length
}

/// Signs, of which some are two characters long.
fn sign(c: char, next: Option<char>) -> (TokenKind, usize) {
    use TokenKind::*;
    match (c, next) {
        ('-', Some('>')) => (Arrow, 2),
        ('.', Some('.')) => (DotDot, 2),
        ('=', Some('=')) => (EqEq, 2),
        ('!', Some('=')) => (NotEq, 2),
        ('<', Some('=')) => (LessEq, 2),
        ('>', Some('=')) => (GreaterEq, 2),
        ('\n', _) => (Newline, 1),
        ('(', _) => (LParen, 1),
        (')', _) => (RParen, 1),
        ('[', _) => (LBracket, 1),
        (']', _) => (RBracket, 1),
        ('{', _) => (LBrace, 1),
        ('}', _) => (RBrace, 1),
        (',', _) => (Comma, 1),
        (';', _) => (Semicolon, 1),
        (':', _) => (Colon, 1),
        ('.', _) => (Dot, 1),
        ('=', _) => (Assign, 1),
        ('<', _) => (Less, 1),
        ('>', _) => (Greater, 1),
        ('+', _) => (Plus, 1),
        ('-', _) => (Minus, 1),
        ('*', _) => (Star, 1),
        ('/', _) => (Slash, 1),
        ('^', _) => (Caret, 1),
        ('\'', _) => (Prime, 1),
        ('%', _) => (Percent, 1),
        ('°', _) => (Degree, 2),
        ('·', _) => (MiddleDot, 2),
        (c, _) => (Unknown, c.len_utf8()),
    }
}

/// The length of the part of a text before the first character that is not of a kind.
fn leading(text: &str, of_kind: impl Fn(char) -> bool) -> usize {
    text.find(|c| !of_kind(c)).unwrap_or(text.len())
}

fn is_blank(c: char) -> bool {
    matches!(c, ' ' | '\t' | '\r' | '\u{feff}' | '\u{a0}')
}

/// Whether a character may stand within a name. The middle dot, which Unicode allows there, multiplies units.
fn is_of_name(c: char) -> bool {
    is_xid_continue(c) && c != '·'
}

fn is_raised(c: char) -> bool {
    matches!(c, '⁰' | '¹' | '²' | '³' | '⁴'..='⁹' | '⁻')
}

#[cfg(test)]
mod tests {
    use super::TokenKind::*;
    use super::*;

    fn kinds(text: &str) -> Vec<TokenKind> {
        lex(text).iter().map(|t| t.kind).collect()
    }

    #[test]
    fn numbers_end_where_ranges_paths_and_units_begin() {
        assert_eq!(kinds("1..n"), [Number, DotDot, Ident, End]);
        assert_eq!(kinds("0.a"), [Number, Dot, Ident, End]);
        assert_eq!(kinds("2eV"), [Number, Ident, End]);
        assert_eq!(kinds("2e"), [Number, Ident, End]);
        assert_eq!(kinds("2e-3"), [Number, End]);
        assert_eq!(kinds("2e-x"), [Number, Ident, Minus, Ident, End]);
        assert_eq!(kinds("1.5.2"), [Number, Dot, Number, End]);
    }

    #[test]
    fn letters_of_any_script_make_names() {
        assert_eq!(kinds("φ' = µF_1·Ω"), [Ident, Prime, Assign, Ident, MiddleDot, Ident, End]);
    }

    #[test]
    fn text_ends_with_its_line() {
        assert_eq!(kinds("\"a \\\" b\" x"), [Text, Ident, End]);
        assert_eq!(kinds("\"a\nb"), [OpenText, Ident, End]);
        assert_eq!(kinds("\"a\\\nb"), [OpenText, Ident, End]);
        assert_eq!(kinds("\""), [OpenText, End]);
    }

    #[test]
    fn characters_without_meaning_are_one_token_in_a_row() {
        assert_eq!(kinds("a ??? b"), [Ident, Unknown, Ident, End]);
    }

    #[test]
    fn newlines_are_counted_to_two() {
        let counts: Vec<u8> = lex("a\nb // c\n\n\nd\n").iter().map(|t| t.newlines).collect();
        assert_eq!(counts, [0, 1, 0, 2, 1]);
    }
}
