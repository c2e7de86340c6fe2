//! The parser: recursive descent that never gives up.
//!
//! After an error inside brackets it goes on at the next comma or closing bracket, else at the next statement. A
//! statement ends where a line ends, unless brackets are open or the line ends with an operator, a comma or `->`.
//! Recursion is bounded by [`MAX_NESTING`], so no text can exhaust the stack.

mod chains;
mod expressions;
mod statements;
mod units;

use super::lexer::{Token, TokenKind, lex};
use super::tree::*;
use crate::diagnostic::{Diagnostic, DiagnosticCode, Diagnostics, codes};
use crate::span::{FileId, Span};

/// What the parser makes of a text: always a tree, and all that is wrong with the text.
#[derive(Debug, Clone, PartialEq)]
pub struct Parsed {
    /// The tree; parts that cannot be read are `Missing` in it.
    pub ast: Ast,
    /// The faults in the order of the text, no more than [`MAX_DIAGNOSTICS`].
    pub diagnostics: Vec<Diagnostic>,
}

impl Parsed {
    /// The tree if there are no errors in the text, else all of them.
    pub fn into_result(self) -> Result<Ast, Diagnostics> {
        if self.diagnostics.iter().any(Diagnostic::is_error) {
            Err(Diagnostics(self.diagnostics))
        } else {
            Ok(self.ast)
        }
    }
}

/// The longest text that is read, in bytes.
pub const MAX_TEXT: usize = 64 << 20;

/// The number of faults after which the parser stops reporting.
pub const MAX_DIAGNOSTICS: usize = 200;

/// The greatest depth of brackets, braces, signs and branches inside each other.
const MAX_NESTING: usize = 120;

/// Words that are no names because expressions are made with them.
pub(super) const RESERVED: [&str; 6] = ["and", "else", "if", "not", "or", "then"];

/// Words that begin a statement.
pub(super) const KEYWORDS: [&str; 18] = [
    "causality",
    "component",
    "const",
    "constraint",
    "discrete",
    "domain",
    "for",
    "guess",
    "import",
    "input",
    "let",
    "output",
    "param",
    "prefer",
    "shape",
    "state",
    "stroke",
    "when",
];

/// Reads a model text. Never fails: what is wrong stands in the diagnostics, and the tree holds what could be read.
///
/// ```
/// use halfarrow_compiler::{ast::parse, span::FileId};
/// let parsed = parse("model M\nSe:battery(12 V) -> 0:n -> R:lamp(3 ohm)\n", FileId(0));
/// assert!(parsed.diagnostics.is_empty());
/// assert_eq!(parsed.ast.statements.len(), 1);
/// ```
pub fn parse(text: &str, file: FileId) -> Parsed {
    parse_with_units(text, file).0
}

/// The tree, and the places of all units in the order of the text.
pub(super) fn parse_with_units(text: &str, file: FileId) -> (Parsed, Vec<Span>) {
    if text.len() > MAX_TEXT {
        return (too_large(text, file), Vec::new());
    }
    let tokens = lex(text);
    let blocks: Vec<Diagnostic> = block_comments(&tokens, file).collect();
    let tokens: Vec<Token> = significant(text, tokens);
    let mut parser = Parser {
        text,
        file,
        tokens,
        pos: 0,
        brackets: 0,
        signature: false,
        nesting: 0,
        quiet: false,
        faults: blocks,
        units: Vec::new(),
    };
    let ast = parser.model();
    let mut diagnostics = parser.faults;
    diagnostics.sort_by_key(|d| d.primary.span);
    (Parsed { ast, diagnostics }, parser.units)
}

/// Comments that do not end with their line.
fn block_comments(tokens: &[Token], file: FileId) -> impl Iterator<Item = Diagnostic> {
    let blocks = tokens.iter().filter(|t| t.kind == TokenKind::BlockComment).take(MAX_DIAGNOSTICS - 1);
    blocks.map(move |t| {
        let span = Span { file, start: t.start, end: t.end };
        let title = "a comment runs to the end of its line";
        Diagnostic::error(codes::S001, title, span, "").hint("begin each line of it with `//`")
    })
}

fn too_large(text: &str, file: FileId) -> Parsed {
    let title = format!("the text is larger than {} MiB", MAX_TEXT >> 20);
    let fault = Diagnostic::error(codes::S012, title, Span { file, start: 0, end: 0 }, "")
        .note(format!("it has {} MiB", text.len() >> 20))
        .hint("split it into files and `import` them");
    Parsed { ast: Ast { file, header: None, statements: Vec::new() }, diagnostics: vec![fault] }
}

/// The tokens that the parser reads: no comments, and newlines only where they can end a statement, which they cannot
/// before `->` or after a token that asks for more.
pub(super) fn significant(text: &str, mut tokens: Vec<Token>) -> Vec<Token> {
    let mut newlines = 0;
    tokens.retain_mut(|t| {
        newlines = newlines.max(t.newlines);
        t.newlines = newlines;
        let keep = !matches!(t.kind, TokenKind::Comment | TokenKind::BlockComment);
        newlines = if keep { 0 } else { newlines };
        keep
    });
    for i in 1..tokens.len() {
        let continues = tokens[i].kind == TokenKind::Arrow
            || (asks_for_more(text, &tokens[..i]) && !keyword_at(text, &tokens, i) && tokens[i].kind != TokenKind::End);
        if continues {
            tokens[i].newlines = 0;
        }
    }
    tokens
}

fn asks_for_more(text: &str, before: &[Token]) -> bool {
    use TokenKind::*;
    let last = before[before.len() - 1];
    match last.kind {
        Arrow | Comma | Assign | Plus | Minus | Star | Slash | Caret | EqEq | NotEq | Less | LessEq | Greater
        | GreaterEq => true,
        Ident => {
            let after_dot = before.len() > 1 && before[before.len() - 2].kind == Dot;
            !after_dot && RESERVED.contains(&&text[last.start as usize..last.end as usize])
        }
        _ => false,
    }
}

/// Whether a statement begins with the token, judged by a keyword followed by what names or quotes something.
fn keyword_at(text: &str, tokens: &[Token], i: usize) -> bool {
    tokens[i].kind == TokenKind::Ident
        && KEYWORDS.contains(&&text[tokens[i].start as usize..tokens[i].end as usize])
        && tokens.get(i + 1).is_some_and(|t| t.newlines == 0 && matches!(t.kind, TokenKind::Ident | TokenKind::Text))
}

/// An expression and the number of its levels.
type Tall = (Expr, usize);

struct Parser<'t> {
    text: &'t str,
    file: FileId,
    tokens: Vec<Token>,
    pos: usize,
    /// Open parentheses and square brackets in the statement that is read.
    brackets: usize,
    /// Whether the head of a component is read, where lines may begin with `param`.
    signature: bool,
    nesting: usize,
    /// Whether an error was just reported, so that what follows from it is not.
    quiet: bool,
    faults: Vec<Diagnostic>,
    /// Places of the units that were read.
    units: Vec<Span>,
}

/// Looking at tokens.
impl<'t> Parser<'t> {
    fn token(&self) -> Token {
        self.tokens[self.pos]
    }

    fn kind(&self) -> TokenKind {
        self.tokens[self.pos].kind
    }

    fn ahead(&self, n: usize) -> Token {
        self.tokens[(self.pos + n).min(self.tokens.len() - 1)]
    }

    fn text_of(&self, token: Token) -> &'t str {
        &self.text[token.start as usize..token.end as usize]
    }

    fn span_of(&self, token: Token) -> Span {
        Span { file: self.file, start: token.start, end: token.end }
    }

    fn span(&self) -> Span {
        self.span_of(self.token())
    }

    /// From `start` to the end of the token before this one.
    fn since(&self, start: Span) -> Span {
        start.to(self.span_before())
    }

    fn span_before(&self) -> Span {
        self.pos.checked_sub(1).map_or(Span { file: self.file, start: 0, end: 0 }, |i| self.span_of(self.tokens[i]))
    }

    /// The empty place right after the token before this one.
    fn gap(&self) -> Span {
        let end = self.span_before().end;
        Span { file: self.file, start: end, end }
    }

    fn is_word(&self, word: &str) -> bool {
        self.kind() == TokenKind::Ident && !self.boundary() && self.text_of(self.token()) == word
    }

    fn is(&self, kind: TokenKind) -> bool {
        self.kind() == kind && !self.boundary()
    }

    /// Whether this token stands right after the one before it.
    fn adjacent(&self, n: usize) -> bool {
        let i = self.pos + n;
        i > 0 && i < self.tokens.len() && self.tokens[i - 1].end == self.tokens[i].start
    }

    /// Whether the statement that is read cannot go on with this token.
    fn boundary(&self) -> bool {
        let token = self.token();
        match token.kind {
            TokenKind::End | TokenKind::RBrace => true,
            _ if token.newlines == 0 => false,
            _ => self.brackets == 0 || (!self.signature && self.begins_statement()),
        }
    }

    /// Whether a line inside open brackets looks like a new statement: then the bracket was forgotten.
    fn begins_statement(&self) -> bool {
        let next = self.ahead(1);
        keyword_at(self.text, &self.tokens, self.pos)
            || (matches!(self.kind(), TokenKind::Ident | TokenKind::Number)
                && matches!(next.kind, TokenKind::Colon | TokenKind::Arrow))
    }
}

/// Taking tokens.
impl Parser<'_> {
    fn bump(&mut self) -> Token {
        let token = self.token();
        if token.kind != TokenKind::End {
            self.pos += 1;
        }
        token
    }

    fn eat(&mut self, kind: TokenKind) -> bool {
        let found = self.is(kind);
        if found {
            self.bump();
        }
        found
    }

    fn eat_word(&mut self, word: &str) -> bool {
        let found = self.is_word(word);
        if found {
            self.bump();
        }
        found
    }

    /// Takes the token, or reports that `what` is expected.
    fn expect(&mut self, kind: TokenKind, what: &str) -> bool {
        let found = self.eat(kind);
        if !found {
            self.expected(what);
        }
        found
    }

    fn expect_word(&mut self, word: &str) -> bool {
        let found = self.eat_word(word);
        if !found {
            self.expected(&format!("`{word}`"));
        }
        found
    }

    fn name_of(&self, token: Token) -> Name {
        Name { text: self.text_of(token).to_owned(), span: self.span_of(token) }
    }

    /// A name that is declared or referred to; reports what is there if it is none.
    fn name(&mut self, what: &str) -> Option<Name> {
        if self.is(TokenKind::Number) && self.adjacent(1) && self.ahead(1).kind == TokenKind::Ident {
            self.digit_name();
            return None;
        }
        if !self.is(TokenKind::Ident) {
            self.expected(what);
            return None;
        }
        let token = self.bump();
        let name = self.name_of(token);
        if RESERVED.contains(&name.text.as_str()) {
            let title = format!("`{}` cannot be a name", name.text);
            self.report(Diagnostic::error(codes::S009, title, name.span, "a word of expressions"));
        }
        Some(name)
    }

    fn digit_name(&mut self) {
        let start = self.span();
        self.bump();
        self.bump();
        let span = self.since(start);
        let text = &self.text[span.start as usize..span.end as usize];
        let fault = Diagnostic::error(codes::S009, "a name begins with a letter", span, "begins with a digit")
            .hint(format!("write `n{text}`"));
        self.report(fault);
    }

    fn doc(&mut self) -> Option<Doc> {
        match self.kind() {
            TokenKind::Text if !self.boundary() => Some(self.quoted()),
            TokenKind::OpenText if !self.boundary() => {
                self.open_text();
                None
            }
            _ => None,
        }
    }

    fn quoted(&mut self) -> Doc {
        let token = self.bump();
        let inner = &self.text[token.start as usize + 1..token.end as usize - 1];
        Doc { text: unescape(inner), span: self.span_of(token) }
    }

    fn open_text(&mut self) {
        let span = self.span();
        self.bump();
        self.report(Diagnostic::error(
            codes::S004,
            "a closing quote is missing",
            span,
            "the text runs to the end of its line",
        ));
    }
}

/// The text between quotes with `\"`, `\\` and `\n` resolved; a backslash before another character stands for itself.
fn unescape(inner: &str) -> String {
    let mut out = String::with_capacity(inner.len());
    let mut chars = inner.chars();
    while let Some(c) = chars.next() {
        match (c, chars.as_str().chars().next()) {
            ('\\', Some(next @ ('"' | '\\' | 'n'))) => {
                out.push(if next == 'n' { '\n' } else { next });
                chars.next();
            }
            _ => out.push(c),
        }
    }
    out
}

/// Reporting and recovering.
impl Parser<'_> {
    /// Reports a fault, unless it follows from the one before.
    fn report(&mut self, fault: Diagnostic) {
        if self.quiet && fault.is_error() {
            return;
        }
        self.quiet |= fault.is_error();
        self.remark(fault);
    }

    /// Reports a fault that does not disturb the reading of what follows.
    fn remark(&mut self, fault: Diagnostic) {
        match self.faults.len() {
            n if n < MAX_DIAGNOSTICS - 1 => self.faults.push(fault),
            n if n == MAX_DIAGNOSTICS - 1 => {
                self.faults.push(fault.note("there are more errors; they are not shown"));
            }
            _ => {}
        }
    }

    fn expected(&mut self, what: &str) {
        let (span, found) = if self.boundary() {
            (self.gap(), "missing here".to_owned())
        } else {
            (self.span(), format!("not {}", self.described()))
        };
        let fault = self.explained(Diagnostic::error(codes::S001, format!("{what} is expected"), span, found));
        self.report(fault);
    }

    /// What this token is, in words.
    fn described(&self) -> String {
        match self.kind() {
            TokenKind::Text | TokenKind::OpenText => "quoted text".to_owned(),
            _ => format!("`{}`", shortened(self.text_of(self.token()))),
        }
    }

    /// Says what is meant by characters that have no meaning.
    fn explained(&self, fault: Diagnostic) -> Diagnostic {
        if self.kind() != TokenKind::Unknown || self.boundary() {
            return fault;
        }
        let text = self.text_of(self.token());
        let title = format!("`{}` has no meaning here", shortened(text));
        let code: DiagnosticCode = codes::S003;
        let mut fault = Diagnostic { code, title, ..fault };
        fault.primary.text.clear();
        match text.chars().next().and_then(remedy) {
            Some(hint) => fault.hint(hint),
            None => fault,
        }
    }

    /// Skips what cannot be read, up to a comma or closing bracket of this level or the end of the statement.
    fn skip(&mut self) {
        let mut open = 0usize;
        while !self.boundary() {
            match self.kind() {
                TokenKind::LParen | TokenKind::LBracket => open += 1,
                TokenKind::RParen | TokenKind::RBracket if open == 0 => return,
                TokenKind::RParen | TokenKind::RBracket => open -= 1,
                TokenKind::Comma | TokenKind::Semicolon | TokenKind::LBrace if open == 0 => return,
                _ => {}
            }
            self.bump();
        }
    }

    /// Skips to the end of the statement.
    fn skip_statement(&mut self) {
        let mut open = 0usize;
        loop {
            self.brackets = open;
            if self.boundary() {
                break;
            }
            match self.kind() {
                TokenKind::LParen | TokenKind::LBracket => open += 1,
                TokenKind::RParen | TokenKind::RBracket => open = open.saturating_sub(1),
                TokenKind::LBrace => break,
                _ => {}
            }
            self.bump();
        }
        self.brackets = 0;
    }

    /// Reads `items` between brackets, separated by commas; the opening one is this token.
    fn bracketed<T>(&mut self, close: TokenKind, mut item: impl FnMut(&mut Self) -> Option<T>) -> Vec<T> {
        let open = self.span();
        self.bump();
        self.brackets += 1;
        let mut items = Vec::with_capacity(1);
        while !self.boundary() && !matches!(self.kind(), TokenKind::RParen | TokenKind::RBracket) {
            items.extend(item(self));
            if !self.after_item(close) {
                break;
            }
        }
        self.close(open, close);
        items
    }

    /// Goes on to the next item; false at the end of the list.
    fn after_item(&mut self, close: TokenKind) -> bool {
        if !self.is(TokenKind::Comma) && !self.is(close) && !self.boundary() {
            self.unexpected(&format!("`,` or `{}`", bracket_text(close)));
            self.skip();
        }
        match self.kind() {
            TokenKind::Comma | TokenKind::Semicolon if !self.boundary() => {
                if self.kind() == TokenKind::Semicolon {
                    self.expected("`,`");
                }
                self.bump();
                self.quiet = false;
                true
            }
            _ => false,
        }
    }

    /// Takes the closing bracket, or reports that the one at `open` has none.
    fn close(&mut self, open: Span, close: TokenKind) {
        if self.is(close) {
            self.bump();
        } else {
            let (here, text) = (if self.boundary() { self.gap() } else { self.span() }, bracket_text(close));
            let fault = Diagnostic::error(codes::S002, format!("`{text}` is missing"), open, "opened here")
                .also(here, format!("`{text}` is expected here at the latest"));
            self.report(fault);
            // A bracket of the wrong kind is taken for the right one.
            if self.is(TokenKind::RParen) || self.is(TokenKind::RBracket) {
                self.bump();
            }
        }
        self.brackets = self.brackets.saturating_sub(1);
    }

    /// Reports what stands where an expression or item should have ended.
    fn unexpected(&mut self, what: &str) {
        let operand = matches!(self.kind(), TokenKind::Ident | TokenKind::Number | TokenKind::LParen);
        let after_operand = matches!(
            self.pos.checked_sub(1).map(|i| self.tokens[i].kind),
            Some(TokenKind::Ident | TokenKind::Number | TokenKind::RParen)
        );
        if operand && after_operand {
            let fault = Diagnostic::error(
                codes::S001,
                format!("{what} is expected"),
                self.span(),
                format!("not {}", self.described()),
            )
            .hint("if a product is meant, write `*` between the factors");
            self.report(fault);
        } else {
            self.expected(what);
        }
    }

    /// Runs `read` one level deeper, or reports that the text is nested too deeply and skips the rest of the statement.
    fn nested<T>(&mut self, read: impl FnOnce(&mut Self) -> T) -> Option<T> {
        if self.nesting >= MAX_NESTING {
            let fault =
                Diagnostic::error(codes::S006, "nested too deeply", self.span(), format!("level {}", MAX_NESTING + 1))
                    .hint("name inner parts with `let`");
            self.quiet = false;
            self.report(fault);
            self.skip_deep();
            return None;
        }
        self.nesting += 1;
        let value = read(self);
        self.nesting -= 1;
        Some(value)
    }

    /// Skips everything up to where the open brackets and braces of this statement are closed.
    fn skip_deep(&mut self) {
        let mut open = 0usize;
        while self.kind() != TokenKind::End {
            match self.kind() {
                TokenKind::LParen | TokenKind::LBracket | TokenKind::LBrace => open += 1,
                TokenKind::RParen | TokenKind::RBracket | TokenKind::RBrace if open == 0 => return,
                TokenKind::RParen | TokenKind::RBracket | TokenKind::RBrace => open -= 1,
                _ if open == 0 && self.boundary() => return,
                _ => {}
            }
            self.bump();
        }
    }
}

fn bracket_text(close: TokenKind) -> &'static str {
    match close {
        TokenKind::RBracket => "]",
        TokenKind::RBrace => "}",
        _ => ")",
    }
}

fn shortened(text: &str) -> String {
    if text.chars().count() <= 24 { text.to_owned() } else { text.chars().take(24).chain(['…']).collect() }
}

/// What to write for a character that looks like one with a meaning.
fn remedy(c: char) -> Option<&'static str> {
    Some(match c {
        '−' | '–' | '—' => "write a minus as `-`",
        '×' | '⋅' | '∙' => "write a product as `*`",
        '÷' => "write a quotient as `/`",
        '→' | '⇀' => "write a half arrow as `->`",
        '≤' => "write `<=`",
        '≥' => "write `>=`",
        '≠' => "write `!=`",
        '“' | '”' | '„' | '’' | '‘' => "write quotes as `\"`, and a time derivative with `'`",
        '&' => "write `and`",
        '|' => "write `or`",
        '!' => "write `not`",
        '#' => "a comment begins with `//`",
        _ => return None,
    })
}
