//! The canonical layout of a model text.
//!
//! Only white space changes: tokens and comments stay as they are, in their order, and lines stay broken where they
//! were. Texts and comments at the ends of neighbouring lines are aligned.

use super::lexer::{TokenKind, lex};
use super::parse::{KEYWORDS, RESERVED, parse_with_units, significant};
use crate::diagnostic::Diagnostic;
use crate::span::{FileId, Span};

const INDENT: usize = 4;

/// Lines wider than this take no part in the alignment of what stands at their ends.
const WIDEST: usize = 60;

/// The text in canonical layout; its errors if it cannot be read.
///
/// ```
/// use halfarrow_compiler::ast::format;
/// assert_eq!(format("model M\n\n\nparam b=900N.s3/m3\nR:d( e=b * f ^3 ) // soft").unwrap(),
///     "model M\n\nparam b = 900 N.s3/m3\nR:d(e = b*f^3)  // soft\n");
/// ```
pub fn format(text: &str) -> Result<String, Vec<Diagnostic>> {
    let (parsed, units) = parse_with_units(text, FileId::default());
    if parsed.diagnostics.iter().any(Diagnostic::is_error) {
        return Err(parsed.diagnostics);
    }
    let lines = Layout::new(text, &units).lines();
    let out = joined(&lines);
    debug_assert_eq!(
        parse_with_units(&out, FileId::default()).0.ast.to_string(),
        parsed.ast.to_string(),
        "the layout changed the meaning"
    );
    Ok(out)
}

/// A line of the result.
#[derive(Default)]
struct Line {
    blank_before: bool,
    indent: usize,
    code: String,
    /// The quoted text at the end of a declaration.
    doc: Option<String>,
    comment: Option<String>,
}

/// A token as it is printed: a unit is one token.
#[derive(Clone, Copy)]
struct Piece<'t> {
    kind: PieceKind,
    text: &'t str,
    /// Newlines before it in the text.
    newlines: u8,
    /// Whether a statement ends before it.
    ends_statement: bool,
}

#[derive(Clone, Copy, PartialEq)]
enum PieceKind {
    Token(TokenKind),
    Unit,
}

/// What stands open where a piece is printed.
struct Open {
    brace: bool,
    /// Indent of the line that it was opened on; of the statement for a brace.
    indent: usize,
}

/// How the colon of a statement is set.
#[derive(Clone, Copy, PartialEq)]
enum Colon {
    /// `Kind:name`.
    Tight,
    /// `name: expr`.
    After,
    /// `name : unit`.
    Around,
}

struct Layout<'t> {
    pieces: Vec<Piece<'t>>,
    lines: Vec<Line>,
    open: Vec<Open>,
    statement_indent: usize,
    colon: Colon,
    /// Whether the quoted text of the statement is set like other tokens.
    plain_text: bool,
}

impl<'t> Layout<'t> {
    fn new(text: &'t str, units: &[Span]) -> Layout<'t> {
        let pieces = pieces(text, units);
        Layout {
            pieces,
            lines: Vec::new(),
            open: Vec::new(),
            statement_indent: 0,
            colon: Colon::Tight,
            plain_text: false,
        }
    }

    fn lines(mut self) -> Vec<Line> {
        for i in 0..self.pieces.len() {
            if self.pieces[i].kind == PieceKind::Token(TokenKind::Comment) {
                self.comment(i);
            } else {
                self.piece(i);
            }
        }
        self.lines
    }

    fn before(&self, i: usize) -> Option<Piece<'t>> {
        i.checked_sub(1).map(|j| self.pieces[j])
    }

    /// The first piece from `i` on that is no comment.
    fn next_code(&self, i: usize) -> Option<Piece<'t>> {
        self.pieces[i..].iter().copied().find(|p| p.kind != PieceKind::Token(TokenKind::Comment))
    }

    fn in_brackets(&self) -> bool {
        self.open.last().is_some_and(|o| !o.brace)
    }

    /// Indent of statements where this piece stands.
    fn block_indent(&self) -> usize {
        self.open.iter().rev().find(|o| o.brace).map_or(0, |o| o.indent + 1)
    }

    fn inner_indent(&self) -> usize {
        match self.open.last() {
            Some(open) if !open.brace => open.indent + 1,
            _ => self.statement_indent + 1,
        }
    }

    fn comment(&mut self, i: usize) {
        let piece = self.pieces[i];
        let text = piece.text.trim_end().to_owned();
        if piece.newlines == 0 && i > 0 {
            self.lines.last_mut().expect("a line before").comment = Some(text);
            return;
        }
        let starts = match self.next_code(i) {
            Some(next) => !self.in_brackets() && (next.ends_statement || next.is(TokenKind::RBrace)),
            None => true,
        };
        let indent = if starts { self.block_indent() } else { self.inner_indent() };
        let blank = starts && self.blank_before(i);
        self.lines.push(Line { blank_before: blank, indent, comment: Some(text), ..Line::default() });
    }

    /// Whether an empty line is kept before piece `i`, which begins a line.
    fn blank_before(&self, i: usize) -> bool {
        self.pieces[i].newlines > 1
            && self.before(i).is_some_and(|p| !p.is(TokenKind::LBrace))
            && !self.pieces[i].is(TokenKind::RBrace)
    }

    fn piece(&mut self, i: usize) {
        let piece = self.pieces[i];
        if self.starts_statement(i) {
            self.start_statement(i);
        } else if piece.newlines > 0 && !self.ends_empty_block(i) {
            let indent = self.continued_indent(piece);
            self.lines.push(Line { indent, ..Line::default() });
        }
        self.print(i);
        self.track(piece);
    }

    fn starts_statement(&self, i: usize) -> bool {
        let code_before = self.pieces[..i].iter().rev().find(|p| !p.is(TokenKind::Comment));
        let opened = code_before.is_none_or(|p| p.is(TokenKind::LBrace));
        let piece = self.pieces[i];
        !self.ends_empty_block(i)
            && (opened || piece.is(TokenKind::RBrace) || (piece.ends_statement && !self.in_brackets()))
    }

    /// Whether `{}` ends here, with nothing inside.
    fn ends_empty_block(&self, i: usize) -> bool {
        self.pieces[i].is(TokenKind::RBrace) && self.before(i).is_some_and(|p| p.is(TokenKind::LBrace))
    }

    fn start_statement(&mut self, i: usize) {
        let closes = self.pieces[i].is(TokenKind::RBrace);
        self.statement_indent = self.block_indent() - usize::from(closes && self.block_indent() > 0);
        let blank_before = self.blank_before(i);
        self.lines.push(Line { blank_before, indent: self.statement_indent, ..Line::default() });
        let next = self.next_code(i + 1);
        let node = next.is_some_and(|p| p.is(TokenKind::Arrow) || p.is(TokenKind::Colon) || p.is(TokenKind::Dot));
        let word = if node { "" } else { self.pieces[i].text };
        self.colon = match word {
            "constraint" => Colon::After,
            "shape" => Colon::Tight,
            _ if KEYWORDS.contains(&word) => Colon::Around,
            _ => Colon::Tight,
        };
        self.plain_text = matches!(word, "import" | "model");
    }

    /// Indent of a line that goes on with a statement.
    fn continued_indent(&self, piece: Piece) -> usize {
        match self.open.last() {
            Some(open) if !open.brace && piece.closes() => open.indent,
            _ => self.inner_indent(),
        }
    }

    fn print(&mut self, i: usize) {
        let piece = self.pieces[i];
        let ends_line = self.pieces.get(i + 1).is_none_or(|n| n.newlines > 0 || n.is(TokenKind::Comment));
        let begins_line = self.lines.last().is_none_or(|l| l.code.is_empty());
        let documents =
            piece.is(TokenKind::Text) && ends_line && !begins_line && !self.in_brackets() && !self.plain_text;
        let space = !begins_line && self.before(i).is_some_and(|before| self.spaced(i, before, piece));
        let line = self.lines.last_mut().expect("a line that has begun");
        if documents {
            line.doc = Some(piece.text.to_owned());
        } else {
            line.code += if space { " " } else { "" };
            line.code += piece.text;
        }
    }

    fn track(&mut self, piece: Piece) {
        let line = self.lines.len() - 1;
        match piece.kind {
            PieceKind::Token(TokenKind::LParen | TokenKind::LBracket) => {
                let indent = self.lines[line].indent;
                self.open.push(Open { brace: false, indent });
            }
            PieceKind::Token(TokenKind::LBrace) => self.open.push(Open { brace: true, indent: self.statement_indent }),
            PieceKind::Token(TokenKind::RParen | TokenKind::RBracket | TokenKind::RBrace) => {
                self.open.pop();
            }
            _ => {}
        }
    }

    /// Whether a space stands between two pieces of a line: where it looks better, or where they would become another
    /// token without it, which two slashes do.
    fn spaced(&self, i: usize, left: Piece, right: Piece) -> bool {
        self.looks_spaced(i, left, right) || !stays_two(left.text, right.text)
    }

    fn looks_spaced(&self, i: usize, left: Piece, right: Piece) -> bool {
        use TokenKind::*;
        let (PieceKind::Token(l), PieceKind::Token(r)) = (left.kind, right.kind) else {
            return match (left.kind, right.kind) {
                (PieceKind::Unit, PieceKind::Token(Star | Slash | Caret | LParen | LBracket)) => true,
                (PieceKind::Unit, PieceKind::Token(r)) => !closes_up(r) || r == Colon,
                _ => true,
            };
        };
        match (l, r) {
            (_, Colon) => self.colon == self::Colon::Around,
            (Colon, _) => self.colon != self::Colon::Tight,
            (LParen | LBracket | Dot | DotDot, _) => false,
            (Star | Slash | Caret, _) => self.after_unit(i - 1),
            (Plus | Minus, _) if self.is_sign(i - 1) => false,
            (LBrace, RBrace) => false,
            // What happens where two sides meet stands apart from them: `x >= h (restitution = 0.8)`.
            (Ident, LParen) if self.colon == self::Colon::After && self.begins_arguments(i) => true,
            (Number, LBracket) => false,
            (_, LParen | LBracket) => !matches!(l, Ident | RBracket) || is_word(left.text),
            _ => !closes_up(r),
        }
    }

    /// Whether a name and an equals sign come after the parenthesis `i`.
    fn begins_arguments(&self, i: usize) -> bool {
        let is = |at: usize, kind: TokenKind| self.pieces.get(at).is_some_and(|piece| piece.is(kind));
        is(i + 1, TokenKind::Ident) && is(i + 2, TokenKind::Assign)
    }

    /// Whether the operator `i` stands after a unit, which it would become part of without a space.
    fn after_unit(&self, i: usize) -> bool {
        self.before(i).is_some_and(|p| p.kind == PieceKind::Unit)
    }

    /// Whether the plus or minus `i` is a sign, not an operation.
    fn is_sign(&self, i: usize) -> bool {
        use TokenKind::*;
        let before = self.pieces[..i].iter().rev().find(|p| !p.is(Comment));
        before.is_none_or(|p| match p.kind {
            PieceKind::Unit => false,
            PieceKind::Token(Ident) => is_word(p.text),
            PieceKind::Token(kind) => !matches!(kind, Number | RParen | RBracket | Prime | Text),
        })
    }
}

impl Piece<'_> {
    fn is(&self, kind: TokenKind) -> bool {
        self.kind == PieceKind::Token(kind)
    }

    fn closes(&self) -> bool {
        self.is(TokenKind::RParen) || self.is(TokenKind::RBracket)
    }
}

/// Whether two pieces written without a space are still two.
fn stays_two(left: &str, right: &str) -> bool {
    let end = left.len() as u32;
    lex(&format!("{left}{right}")).iter().any(|token| token.start == end)
}

/// Whether a token follows what stands before it without a space.
fn closes_up(kind: TokenKind) -> bool {
    use TokenKind::*;
    matches!(kind, RParen | RBracket | Comma | Semicolon | Prime | Dot | DotDot | Star | Slash | Caret)
}

fn is_word(text: &str) -> bool {
    RESERVED.contains(&text) || matches!(text, "from" | "in" | "when")
}

/// The tokens of a text with its comments, each unit as one piece.
fn pieces<'t>(text: &'t str, units: &[Span]) -> Vec<Piece<'t>> {
    let tokens = lex(text);
    let code = significant(text, tokens.clone());
    let mut code = code.iter().peekable();
    let mut units = units.iter().peekable();
    let mut pieces: Vec<Piece> = Vec::with_capacity(tokens.len());
    for token in tokens.iter().filter(|t| t.kind != TokenKind::End) {
        let ends_statement = code.next_if(|c| c.start == token.start).is_some_and(|c| c.newlines > 0);
        while units.next_if(|u| u.end <= token.start).is_some() {}
        let unit = units.peek().filter(|u| u.start <= token.start);
        if unit.is_some_and(|u| u.start < token.start) {
            continue; // the first token of the unit stands for all
        }
        let end = unit.map_or(token.end, |u| u.end);
        let kind = if unit.is_some() { PieceKind::Unit } else { PieceKind::Token(token.kind) };
        pieces.push(Piece {
            kind,
            text: &text[token.start as usize..end as usize],
            newlines: token.newlines,
            ends_statement,
        });
    }
    pieces
}

/// The lines as text, with the ends of the lines of a paragraph aligned.
fn joined(lines: &[Line]) -> String {
    let mut out = String::new();
    for paragraph in lines.chunk_by(|a, b| !b.blank_before && a.indent == b.indent) {
        let ends = paragraph.iter().filter(|l| l.has_end()).map(Line::width);
        let width = ends.filter(|w| *w <= WIDEST).max().unwrap_or(0);
        paragraph.iter().for_each(|line| write_line(&mut out, line, width));
    }
    out
}

fn write_line(out: &mut String, line: &Line, width: usize) {
    if line.blank_before && !out.is_empty() {
        out.push('\n');
    }
    out.extend(std::iter::repeat_n(' ', line.indent * INDENT));
    *out += &line.code;
    let pad = if line.has_end() { width.saturating_sub(line.width()) + 2 } else { 0 };
    out.extend(std::iter::repeat_n(' ', pad));
    *out += line.doc.as_deref().unwrap_or("");
    *out += if line.doc.is_some() && line.comment.is_some() { "  " } else { "" };
    *out += line.comment.as_deref().unwrap_or("");
    out.push('\n');
}

impl Line {
    /// Whether something stands at its end that is aligned.
    fn has_end(&self) -> bool {
        !self.code.is_empty() && (self.doc.is_some() || self.comment.is_some())
    }

    /// Characters before what is aligned.
    fn width(&self) -> usize {
        self.indent * INDENT + self.code.chars().count()
    }
}
