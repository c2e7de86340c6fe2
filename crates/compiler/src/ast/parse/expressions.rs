//! Expressions.

use super::*;

/// How tight an operator binds; a higher number is tighter.
fn binary_op(kind: TokenKind, text: &str) -> Option<(BinaryOp, u8)> {
    Some(match kind {
        TokenKind::Ident if text == "or" => (BinaryOp::Or, 1),
        TokenKind::Ident if text == "and" => (BinaryOp::And, 2),
        TokenKind::Less => (BinaryOp::Lt, COMPARISON),
        TokenKind::LessEq => (BinaryOp::Le, COMPARISON),
        TokenKind::Greater => (BinaryOp::Gt, COMPARISON),
        TokenKind::GreaterEq => (BinaryOp::Ge, COMPARISON),
        TokenKind::EqEq => (BinaryOp::Eq, COMPARISON),
        TokenKind::NotEq => (BinaryOp::Ne, COMPARISON),
        TokenKind::Plus => (BinaryOp::Add, 5),
        TokenKind::Minus => (BinaryOp::Sub, 5),
        TokenKind::Star => (BinaryOp::Mul, 6),
        TokenKind::Slash => (BinaryOp::Div, 6),
        _ => return None,
    })
}

const COMPARISON: u8 = 4;

impl Parser<'_> {
    /// An expression; `Missing`, with an error reported, if there is none.
    pub(super) fn expr(&mut self) -> Expr {
        self.tall().0
    }

    fn tall(&mut self) -> Tall {
        self.nested(|p| p.binary(0)).unwrap_or_else(|| self.missing())
    }

    fn missing(&self) -> Tall {
        (Expr { span: self.gap(), kind: ExprKind::Missing }, 1)
    }

    /// A chain of operators that bind tighter than `min`, grouped to the left.
    fn binary(&mut self, min: u8) -> Tall {
        let (mut left, mut height) = self.unary();
        let mut compared = None;
        while let Some((op, power)) = self.operator().filter(|(_, power)| *power > min) {
            let op_span = self.span();
            if power == COMPARISON {
                self.compared_twice(compared, op_span);
                compared = Some(op_span);
            }
            self.bump();
            let (right, right_height) = self.nested(|p| p.binary(power)).unwrap_or_else(|| self.missing());
            height = 1 + height.max(right_height);
            let span = left.span.to(right.span);
            let kind = ExprKind::Binary(Binary { op, op_span, left: Box::new(left), right: Box::new(right) });
            left = Expr { span, kind };
            if height > MAX_HEIGHT - MAX_NESTING {
                return self.too_long(op_span);
            }
        }
        (left, height)
    }

    fn operator(&self) -> Option<(BinaryOp, u8)> {
        let token = self.token();
        if self.boundary() { None } else { binary_op(token.kind, self.text_of(token)) }
    }

    fn compared_twice(&mut self, first: Option<Span>, second: Span) {
        if let Some(first) = first {
            let fault = Diagnostic::error(codes::S001, "comparisons cannot be chained", second, "a second comparison")
                .also(first, "the first one")
                .hint("join two comparisons with `and`: `a < b and b < c`");
            self.report(fault);
        }
    }

    fn too_long(&mut self, span: Span) -> Tall {
        let title = format!("more than {} operators in a row", MAX_HEIGHT - MAX_NESTING);
        self.report(Diagnostic::error(codes::S006, title, span, "from here on").hint("name parts with `let`"));
        self.quiet = true;
        self.skip();
        self.missing()
    }

    fn unary(&mut self) -> Tall {
        if self.is_word("not") {
            return self.prefixed(UnaryOp::Not, |p| p.binary(COMPARISON - 1));
        }
        if self.is(TokenKind::Minus) {
            return self.prefixed(UnaryOp::Neg, Self::unary);
        }
        if self.eat(TokenKind::Plus) {
            return self.nested(Self::unary).unwrap_or_else(|| self.missing());
        }
        self.power()
    }

    fn prefixed(&mut self, op: UnaryOp, operand: impl FnOnce(&mut Self) -> Tall) -> Tall {
        let op_span = self.span();
        self.bump();
        let (operand, height) = self.nested(operand).unwrap_or_else(|| self.missing());
        let span = op_span.to(operand.span);
        (Expr { span, kind: ExprKind::Unary(Unary { op, op_span, operand: Box::new(operand) }) }, height + 1)
    }

    /// `base ^ exponent`, to the right: the exponent may have a sign and a power of its own.
    fn power(&mut self) -> Tall {
        let (base, height) = self.rate();
        let stars = self.is(TokenKind::Star) && self.ahead(1).kind == TokenKind::Star && self.adjacent(1);
        if !self.is(TokenKind::Caret) && !stars {
            return (base, height);
        }
        let mut op_span = self.span();
        self.bump();
        if stars {
            op_span = op_span.to(self.span());
            self.bump();
            self.remark(
                Diagnostic::error(codes::S001, "a power is written `^`", op_span, "").hint("write `^` for `**`"),
            );
        }
        let (exponent, right_height) = self.nested(Self::unary).unwrap_or_else(|| self.missing());
        let span = base.span.to(exponent.span);
        let binary = Binary { op: BinaryOp::Pow, op_span, left: Box::new(base), right: Box::new(exponent) };
        (Expr { span, kind: ExprKind::Binary(binary) }, 1 + height.max(right_height))
    }

    /// What may carry primes.
    fn rate(&mut self) -> Tall {
        let (mut inner, mut height) = self.atom();
        while self.is(TokenKind::Prime) {
            let prime = self.span();
            self.bump();
            if height > MAX_HEIGHT - MAX_NESTING {
                return self.too_long(prime);
            }
            height += 1;
            inner = Expr { span: inner.span.to(prime), kind: ExprKind::Rate(Box::new(inner)) };
        }
        (inner, height)
    }

    fn atom(&mut self) -> Tall {
        if self.boundary() {
            return self.no_value();
        }
        match self.kind() {
            TokenKind::Number => (self.number(), 1),
            TokenKind::Dot if self.ahead(1).kind == TokenKind::Number && self.adjacent(1) => (self.pointed_number(), 1),
            TokenKind::Text => {
                let text = self.quoted();
                (Expr { span: text.span, kind: ExprKind::Text(text.text) }, 1)
            }
            TokenKind::OpenText => {
                self.open_text();
                self.missing()
            }
            TokenKind::LParen => self.parenthesised(),
            TokenKind::LBracket => self.list(),
            TokenKind::Ident if self.is_word("if") => self.conditional(),
            TokenKind::Ident if RESERVED.contains(&self.text_of(self.token())) => self.no_value(),
            TokenKind::Ident if self.sum_follows() => self.nested(Self::sum).unwrap_or_else(|| self.missing()),
            TokenKind::Ident if self.ahead(1).kind == TokenKind::LParen && self.ahead(1).newlines == 0 => self.call(),
            TokenKind::Ident => {
                let (path, height) = self.tall_path();
                (Expr { span: path.span, kind: ExprKind::Path(path) }, height)
            }
            _ => self.no_value(),
        }
    }

    fn no_value(&mut self) -> Tall {
        self.expected("a value");
        self.missing()
    }

    fn number(&mut self) -> Expr {
        let token = self.bump();
        let mut text = self.text_of(token).to_owned();
        if self.is(TokenKind::Dot) && self.adjacent(0) && !self.adjacent(1) {
            let span = self.span_of(token).to(self.span());
            self.bump();
            self.remark(digits_missing(span, &format!("write `{text}.0`")));
            text.push_str(".0");
        }
        self.grouped_digits(token, &mut text);
        self.with_unit(self.span_of(token), text)
    }

    /// `1_000`, which should be `1000`.
    fn grouped_digits(&mut self, first: Token, text: &mut String) {
        let next = self.token();
        let more = self.text_of(next);
        let groups = more.starts_with('_') && more.trim_start_matches('_').starts_with(|c: char| c.is_ascii_digit());
        if next.kind != TokenKind::Ident || !self.adjacent(0) || !groups {
            return;
        }
        self.bump();
        text.push_str(&more.chars().filter(char::is_ascii_digit).collect::<String>());
        let title = "the digits of a number stand together";
        let span = self.span_of(first).to(self.span_of(next));
        self.remark(Diagnostic::error(codes::S007, title, span, "").hint(format!("write `{text}`")));
    }

    /// `.5`, which should be `0.5`.
    fn pointed_number(&mut self) -> Expr {
        let dot = self.span();
        self.bump();
        let token = self.bump();
        let text = format!("0.{}", self.text_of(token));
        self.remark(digits_missing(dot.to(self.span_of(token)), &format!("write `{text}`")));
        let text = if self.text_of(token).contains('.') { "0".to_owned() } else { text };
        self.with_unit(dot, text)
    }

    fn with_unit(&mut self, start: Span, text: String) -> Expr {
        let unit = self.unit_of_number();
        Expr { span: self.since(start), kind: ExprKind::Number(Number { text, unit }) }
    }

    fn parenthesised(&mut self) -> Tall {
        let open = self.span();
        self.bump();
        self.brackets += 1;
        let value = self.tall();
        if !self.is(TokenKind::RParen) && !self.boundary() {
            self.unexpected("`)`");
            self.skip_group();
        }
        self.close(open, TokenKind::RParen);
        value
    }

    /// Skips to the closing bracket of this level, commas included.
    fn skip_group(&mut self) {
        self.skip();
        while self.is(TokenKind::Comma) || self.is(TokenKind::Semicolon) {
            self.bump();
            self.skip();
        }
    }

    fn list(&mut self) -> Tall {
        let start = self.span();
        let mut height = 0;
        let mut repeated = None;
        let mut items = self.bracketed(TokenKind::RBracket, |p| {
            let (item, item_height) = p.tall();
            height = height.max(item_height);
            if !p.is_word("for") {
                return Some(item);
            }
            let (list, range_height) = p.for_list(item)?;
            height = height.max(range_height);
            repeated = Some(list);
            None
        });
        let span = self.since(start);
        let Some(repeated) = repeated else { return (Expr { span, kind: ExprKind::List(items) }, height + 1) };
        if let Some(other) = items.pop() {
            let title = "a list with `for` has nothing beside it";
            self.report(Diagnostic::error(codes::S001, title, other.span, "beside it").hint("write two lists"));
        }
        (Expr { span, kind: ExprKind::Repeated(repeated) }, height + 1)
    }

    /// `[value for i in 1..n]`, of which the value has been read; the bracket is closed by the caller.
    fn for_list(&mut self, value: Expr) -> Option<(Repeated, usize)> {
        self.bump(); // `for`
        let (variable, from, to, height) = self.range()?;
        Some((Repeated { value: Box::new(value), variable, from: Box::new(from), to: Box::new(to) }, height))
    }

    /// `sum(i in 1..n, value)`.
    fn sum(&mut self) -> Tall {
        let start = self.span();
        self.bump();
        let open = self.span();
        self.bump();
        self.brackets += 1;
        let range = self.range();
        if range.is_some() && !self.eat(TokenKind::Comma) {
            self.expected("`,` and what is added up");
        }
        let (value, height) = self.tall();
        if !self.is(TokenKind::RParen) && !self.boundary() {
            self.unexpected("`)`");
            self.skip_group();
        }
        self.close(open, TokenKind::RParen);
        let Some((variable, from, to, range_height)) = range else { return self.missing() };
        let sum = Repeated { value: Box::new(value), variable, from: Box::new(from), to: Box::new(to) };
        (Expr { span: self.since(start), kind: ExprKind::Sum(sum) }, 1 + height.max(range_height))
    }

    /// Whether `sum(i in` comes.
    fn sum_follows(&self) -> bool {
        self.is_word("sum")
            && self.ahead(1).kind == TokenKind::LParen
            && self.ahead(2).kind == TokenKind::Ident
            && self.ahead(3).kind == TokenKind::Ident
            && self.text_of(self.ahead(3)) == "in"
    }

    fn conditional(&mut self) -> Tall {
        let start = self.span();
        self.bump();
        let (cond, a) = self.tall();
        self.expect_word("then");
        let (yes, b) = self.tall();
        let (no, c) = match self.is_word("elseif") || self.is_word("elif") {
            true => self.joined_else_if(),
            false => {
                self.expect_word("else");
                self.tall()
            }
        };
        let kind = ExprKind::If(If { cond: Box::new(cond), yes: Box::new(yes), no: Box::new(no) });
        (Expr { span: self.since(start), kind }, 1 + a.max(b).max(c))
    }

    /// `elseif`, which should be `else if`.
    fn joined_else_if(&mut self) -> Tall {
        let title = format!("there is no `{}`", self.text_of(self.token()));
        self.remark(Diagnostic::error(codes::S001, title, self.span(), "").hint("write `else if`, two words"));
        self.nested(Self::conditional).unwrap_or_else(|| self.missing())
    }

    fn call(&mut self) -> Tall {
        let token = self.bump();
        let function = self.name_of(token);
        let span = function.span;
        let (args, height) = self.args();
        (Expr { span: self.since(span), kind: ExprKind::Call(Call { function, args }) }, height + 1)
    }

    /// `(a, k = b)`: the arguments and their greatest height.
    pub(super) fn args(&mut self) -> (Vec<Arg>, usize) {
        let mut height = 0;
        let args = self.bracketed(TokenKind::RParen, |p| {
            let start = p.span();
            let label = p.arg_label();
            let (value, value_height) = p.tall();
            height = height.max(value_height);
            Some(Arg { label, value, span: p.since(start) })
        });
        (args, height)
    }

    /// `k =`, `0 =`, `f.a =`, `0.a =`, if that is what comes.
    fn arg_label(&mut self) -> Option<ArgLabel> {
        let first = self.token();
        let zero = first.kind == TokenKind::Number && self.text_of(first) == "0";
        if first.kind != TokenKind::Ident && !zero {
            return None;
        }
        let name = self.name_of(first);
        if self.ahead(1).kind == TokenKind::Assign {
            self.pos += 2;
            return Some(ArgLabel { span: name.span, name, port: None });
        }
        let dotted = self.ahead(1).kind == TokenKind::Dot && self.ahead(2).kind == TokenKind::Ident;
        if !dotted || self.ahead(3).kind != TokenKind::Assign {
            return None;
        }
        let port = self.name_of(self.ahead(2));
        self.pos += 4;
        Some(ArgLabel { span: name.span.to(port.span), name, port: Some(port) })
    }

    /// A name, bare or dotted; this token is its first part.
    pub(super) fn path(&mut self) -> Path {
        self.tall_path().0
    }

    fn tall_path(&mut self) -> (Path, usize) {
        let start = self.span();
        let mut parts = Vec::with_capacity(1);
        let mut height = 1;
        loop {
            let token = self.bump();
            let (indices, index_height) = self.indices();
            height = height.max(1 + index_height);
            parts.push(PathPart { name: self.name_of(token), indices });
            let goes_on =
                self.is(TokenKind::Dot) && self.ahead(1).kind == TokenKind::Ident && self.ahead(1).newlines == 0;
            if !goes_on {
                break;
            }
            self.bump();
        }
        if self.is(TokenKind::Dot) {
            self.bump();
            self.expected("a name after the dot");
        }
        (Path { parts, span: self.since(start) }, height)
    }

    /// `[i, j]` right after a name: the indices and their greatest height.
    pub(super) fn indices(&mut self) -> (Vec<Expr>, usize) {
        let mut height = 0;
        if !self.is(TokenKind::LBracket) || !self.adjacent(0) {
            return (Vec::new(), height);
        }
        let open = self.span();
        let indices = self.bracketed(TokenKind::RBracket, |p| {
            let (index, index_height) = p.tall();
            height = height.max(index_height);
            Some(index)
        });
        if indices.is_empty() {
            let fault = Diagnostic::error(codes::S001, "an index is expected", self.since(open), "nothing stands here");
            self.report(fault.hint("write `name[1]`, or the name alone"));
        }
        (indices, height)
    }

    /// A name that may have indices.
    pub(super) fn indexed(&mut self, what: &str) -> Option<PathPart> {
        let name = self.name(what)?;
        Some(PathPart { name, indices: self.indices().0 })
    }

    /// `i in 1..n`: the variable, its first and last value and their greatest height; nothing if there is no variable.
    pub(super) fn range(&mut self) -> Option<(Name, Expr, Expr, usize)> {
        let variable = self.name("the name of a variable")?;
        self.expect_word("in");
        let (from, a) = self.tall();
        self.expect(TokenKind::DotDot, "`..`");
        let (to, b) = self.tall();
        Some((variable, from, to, a.max(b)))
    }
}

fn digits_missing(span: Span, hint: &str) -> Diagnostic {
    Diagnostic::error(codes::S007, "a decimal point has digits on both sides", span, "").hint(hint)
}
