//! Model text to tokens.

use logos::Logos;

/// The kinds of tokens. Words are all [`Ident`](TokenKind::Ident): what is a keyword depends on where it stands.
#[derive(Logos, Debug, Clone, Copy, PartialEq, Eq)]
#[logos(skip r"[ \t\r\u{feff}\u{a0}]+")]
pub(super) enum TokenKind {
    #[regex(r"[\p{XID_Start}_][\p{XID_Continue}--·]*")]
    Ident,
    #[regex(r"[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")]
    Number,
    #[regex(r#""([^"\\\n]|\\[^\n])*""#)]
    Text,
    #[regex(r#""([^"\\\n]|\\[^\n])*\\?"#)]
    OpenText,
    #[token("->")]
    Arrow,
    #[token("(")]
    LParen,
    #[token(")")]
    RParen,
    #[token("[")]
    LBracket,
    #[token("]")]
    RBracket,
    #[token("{")]
    LBrace,
    #[token("}")]
    RBrace,
    #[token(",")]
    Comma,
    #[token(";")]
    Semicolon,
    #[token(":")]
    Colon,
    #[token(".")]
    Dot,
    #[token("..")]
    DotDot,
    #[token("=")]
    Assign,
    #[token("==")]
    EqEq,
    #[token("!=")]
    NotEq,
    #[token("<")]
    Less,
    #[token("<=")]
    LessEq,
    #[token(">")]
    Greater,
    #[token(">=")]
    GreaterEq,
    #[token("+")]
    Plus,
    #[token("-")]
    Minus,
    #[token("*")]
    Star,
    #[token("/")]
    Slash,
    #[token("^")]
    Caret,
    #[token("'")]
    Prime,
    #[token("%")]
    Percent,
    #[token("°")]
    Degree,
    #[token("·")]
    MiddleDot,
    #[regex("[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+")]
    Superscript,
    #[token("\n")]
    Newline,
    #[regex(r"//[^\n]*", allow_greedy = true)]
    Comment,
    /// `/* ... */`, which other languages have.
    #[regex(r"/\*([^*]|\*+[^*/])*\*+/")]
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
    let mut newlines = 0;
    for (kind, range) in TokenKind::lexer(text).spanned() {
        let kind = kind.unwrap_or(TokenKind::Unknown);
        let (start, end) = (range.start as u32, range.end as u32);
        match tokens.last_mut() {
            _ if kind == TokenKind::Newline => newlines = (newlines + 1).min(2),
            Some(last) if kind == TokenKind::Unknown && last.kind == kind && last.end == start => last.end = end,
            _ => {
                tokens.push(Token { kind, newlines, start, end });
                newlines = 0;
            }
        }
    }
    let end = text.len() as u32;
    tokens.push(Token { kind: TokenKind::End, newlines, start: end, end });
    tokens
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
