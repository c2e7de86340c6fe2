//! Statements.

use super::*;

/// Whether a declaration in a list has a value, and which word is used for it.
#[derive(Clone, Copy, PartialEq)]
enum Value {
    /// `= value` must be there.
    Needed,
    /// `= value` may be there.
    Optional,
}

impl Parser<'_> {
    pub(super) fn model(&mut self) -> Ast {
        let header = self.header();
        let lines = self.tokens.iter().filter(|t| t.newlines > 0).count();
        let mut statements = Vec::with_capacity(lines);
        loop {
            self.statements_into(&mut statements);
            if self.kind() == TokenKind::End {
                break;
            }
            let fault = Diagnostic::error(codes::S002, "`}` has no partner", self.span(), "nothing is open here");
            self.remark(fault);
            self.bump();
        }
        if header.is_none() && !self.is_library(&statements) {
            self.no_header();
        }
        Ast { file: self.file, header, statements }
    }

    fn header(&mut self) -> Option<Header> {
        let declared = self.kind() == TokenKind::Ident
            && self.text_of(self.token()) == "model"
            && !matches!(self.ahead(1).kind, TokenKind::Arrow | TokenKind::Colon | TokenKind::Dot);
        if !declared {
            return None;
        }
        self.bump();
        let name = self.name("the name of the model");
        let doc = self.doc();
        self.end_statement();
        let span = self.gap();
        let name = name.unwrap_or(Name { text: String::new(), span });
        Some(Header { name, doc })
    }

    /// Whether the text only declares what others import, or an error has been reported already.
    fn is_library(&self, statements: &[Statement]) -> bool {
        use StatementKind::*;
        let declares =
            |s: &Statement| matches!(s.kind, Component(_) | Import(_) | Const(_) | Let(_) | Function(_) | PortKind(_));
        !self.faults.is_empty() || (!statements.is_empty() && statements.iter().all(declares))
    }

    fn no_header(&mut self) {
        let start = Span { file: self.file, start: 0, end: 0 };
        let fault = Diagnostic::error(codes::S005, "a model begins with `model Name`", start, "no model is named here")
            .hint("write `model Name \"what it is\"` as the first line");
        self.remark(fault);
    }

    /// Statements up to a closing brace or the end.
    fn statements(&mut self) -> Vec<Statement> {
        let mut statements = Vec::new();
        self.statements_into(&mut statements);
        statements
    }

    fn statements_into(&mut self, statements: &mut Vec<Statement>) {
        while !matches!(self.kind(), TokenKind::End | TokenKind::RBrace) {
            let before = self.pos;
            statements.extend(self.statement());
            if self.pos == before {
                self.bump(); // whatever it is, it has been reported
            }
        }
    }

    fn statement(&mut self) -> Option<Statement> {
        self.tokens[self.pos].newlines = 0; // the line that begins here is the statement
        self.quiet = false;
        let start = self.span();
        let kind = self.statement_kind();
        let span = self.since(start);
        self.end_statement();
        kind.map(|kind| Statement { span, kind })
    }

    /// Reports and skips what is left of the statement.
    fn end_statement(&mut self) {
        if !self.boundary() {
            if let TokenKind::Text | TokenKind::OpenText = self.kind() {
                let doc = self.doc();
                self.idle_doc(doc);
            } else {
                self.unexpected("the end of the statement");
            }
        }
        self.skip_statement();
        while self.kind() == TokenKind::LBrace && self.token().newlines == 0 {
            self.stray_block();
        }
        self.quiet = false;
    }

    /// A block that belongs to nothing: its braces must be paired all the same.
    fn stray_block(&mut self) {
        self.unexpected("the end of the statement");
        self.block();
        self.skip_statement();
    }

    fn statement_kind(&mut self) -> Option<StatementKind> {
        let token = self.token();
        let word = match token.kind {
            TokenKind::Ident | TokenKind::Number => self.text_of(token),
            TokenKind::LBracket => return Some(StatementKind::Chain(self.chain())),
            TokenKind::Text | TokenKind::OpenText => {
                let doc = self.doc();
                self.idle_doc(doc);
                return None;
            }
            TokenKind::Slash if self.ahead(1).kind == TokenKind::Star && self.adjacent(1) => {
                let span = self.span().to(self.span_of(self.ahead(1)));
                let title = "a comment runs to the end of its line";
                self.report(Diagnostic::error(codes::S001, title, span, "").hint("begin each line of it with `//`"));
                return None;
            }
            _ => {
                self.expected("a statement");
                return None;
            }
        };
        let node = matches!(self.ahead(1).kind, TokenKind::Arrow | TokenKind::Colon | TokenKind::Dot);
        if word == "port" && self.ahead(1).kind == TokenKind::Ident && self.ahead(2).kind == TokenKind::LBrace {
            self.bump();
            return Some(StatementKind::PortKind(Box::new(self.port_kind()?)));
        }
        if !node && self.choice_follows() {
            return Some(StatementKind::Choice(Box::new(self.choice())));
        }
        if node || !(KEYWORDS.contains(&word) || word == "model") {
            return self.chain_or_mistake();
        }
        self.bump();
        self.keyword_statement(word, self.span_of(token))
    }

    fn keyword_statement(&mut self, word: &str, start: Span) -> Option<StatementKind> {
        Some(match word {
            "param" => StatementKind::Param(self.declarations(Value::Needed)),
            "const" => StatementKind::Const(self.declarations(Value::Needed)),
            "input" => StatementKind::Input(self.declarations(Value::Optional)),
            "output" => StatementKind::Output(self.declarations(Value::Needed)),
            "let" => self.let_statement()?,
            "state" => StatementKind::State(Box::new(self.state()?)),
            "import" => StatementKind::Import(self.import()?),
            "component" => StatementKind::Component(Box::new(self.component()?)),
            "prefer" => StatementKind::Prefer(self.listed(|p| p.element_path("a variable or an element"))),
            "causality" => StatementKind::Causality(self.listed(Self::forced_causality)),
            "guess" => StatementKind::Guess(self.listed(Self::guess)),
            "stroke" => StatementKind::Stroke(Box::new(self.stroke()?)),
            "constraint" => StatementKind::Constraint(Box::new(self.constraint()?)),
            "domain" => StatementKind::Domain(Box::new(self.domain()?)),
            "discrete" => StatementKind::Discrete(self.declarations(Value::Needed)),
            "when" => StatementKind::When(Box::new(self.when()?)),
            "for" => StatementKind::For(Box::new(self.for_loop()?)),
            "shape" => StatementKind::Shape(Box::new(self.shape()?)),
            _ => {
                let hint = "put the other model into a file of its own, or make it a `component`";
                let fault =
                    Diagnostic::error(codes::S005, "one file is one model", start, "a second `model`").hint(hint);
                self.report(fault);
                return None;
            }
        })
    }

    /// A chain; or a word that is no keyword where one seems to be meant.
    fn chain_or_mistake(&mut self) -> Option<StatementKind> {
        let (word, next) = (self.token(), self.ahead(1));
        let keyword_meant = word.kind == TokenKind::Ident
            && next.newlines == 0
            && matches!(next.kind, TokenKind::Ident | TokenKind::Text | TokenKind::Assign | TokenKind::Prime);
        let reserved = word.kind == TokenKind::Ident && RESERVED.contains(&self.text_of(word));
        if !keyword_meant && !reserved {
            return Some(StatementKind::Chain(self.chain()));
        }
        let text = self.text_of(word);
        if RESERVED.contains(&text) {
            self.begins_with_reserved(text);
            return None;
        }
        let fault = Diagnostic::error(codes::S013, "this is no statement", self.span(), "");
        let near = crate::diagnostic::nearest(text, KEYWORDS);
        let fault = match (next.kind, near) {
            (TokenKind::Assign, _) => fault.hint(format!("declare `{text}` with `let`, `param` or `const`")),
            (TokenKind::Prime, _) => fault.hint(format!("integrate a signal with `state {text}' = ... from ...`")),
            (_, Some(near)) => fault.hint(format!("did you mean `{near}`?")),
            (_, None) => fault.hint(format!("statements begin with a node or with one of: {}", KEYWORDS.join(", "))),
        };
        self.report(fault);
        None
    }

    fn begins_with_reserved(&mut self, word: &str) {
        let fault = Diagnostic::error(codes::S013, format!("no statement begins with `{word}`"), self.span(), "").hint(
            "an expression that goes on in the next line ends its line with an operator, or stands in parentheses",
        );
        self.report(fault);
    }

    /// Items separated by commas, up to the end of the statement.
    fn listed<T>(&mut self, mut item: impl FnMut(&mut Self) -> Option<T>) -> Vec<T> {
        let mut items = Vec::new();
        loop {
            items.extend(item(self));
            if !self.is(TokenKind::Comma) && !self.boundary() && !self.is(TokenKind::LBrace) {
                self.unexpected("`,` or the end of the statement");
                self.skip();
            }
            if !self.eat(TokenKind::Comma) {
                break;
            }
            self.quiet = false;
        }
        items
    }

    fn declarations(&mut self, value: Value) -> Vec<Declaration> {
        let mut items = self.listed(|p| p.declaration(value));
        spread_docs(&mut items);
        items
    }

    /// `name : unit = value : unit "doc"`, with the unit in one of the two places.
    fn declaration(&mut self, value: Value) -> Option<Declaration> {
        let start = self.span();
        let owner = match self.owner_follows() {
            true => {
                let owner = self.name("a port");
                self.bump(); // the dot
                owner
            }
            false => None,
        };
        let PathPart { name, indices } = self.indexed("a name")?;
        let unit = self.unit();
        let value = match value {
            _ if self.eat(TokenKind::Assign) => Some(self.expr()),
            Value::Needed => {
                self.expected("`= value`");
                None
            }
            Value::Optional => None,
        };
        let unit = self.second_unit(unit);
        let doc = self.doc();
        Some(Declaration { owner, name, indices, unit, value, doc, span: self.since(start) })
    }

    /// Whether `port.` comes, before the name of one of its signals.
    fn owner_follows(&self) -> bool {
        self.kind() == TokenKind::Ident
            && self.ahead(1).kind == TokenKind::Dot
            && self.adjacent(1)
            && self.ahead(2).kind == TokenKind::Ident
    }

    /// `path : unit = value : unit "doc"`, with the unit in one of the two places.
    fn guess(&mut self) -> Option<Guess> {
        let start = self.span();
        let what = self.element_path("a state, or `q` of a C or `p` of an I,")?;
        let unit = self.unit();
        if !self.eat(TokenKind::Assign) {
            self.expected("`= value`");
            return None;
        }
        let value = self.expr();
        let unit = self.second_unit(unit);
        let doc = self.doc();
        Some(Guess { what, unit, value, doc, span: self.since(start) })
    }

    fn unit(&mut self) -> Option<UnitText> {
        if self.eat(TokenKind::Colon) { self.unit_after_colon() } else { None }
    }

    /// The unit after the value, if none stood before it.
    fn second_unit(&mut self, first: Option<UnitText>) -> Option<UnitText> {
        if !self.is(TokenKind::Colon) {
            return first;
        }
        let second = self.unit();
        if let (Some(first), Some(second)) = (&first, &second) {
            let fault = Diagnostic::error(codes::S001, "the unit is given twice", second.span, "again here")
                .also(first.span, "first here")
                .hint("keep one of them");
            self.remark(fault);
        }
        first.or(second)
    }

    fn let_statement(&mut self) -> Option<StatementKind> {
        let function = self.kind() == TokenKind::Ident && self.ahead(1).kind == TokenKind::LParen;
        if !function {
            return Some(StatementKind::Let(self.declarations(Value::Needed)));
        }
        let name = self.name("a name")?;
        let params = self.bracketed(TokenKind::RParen, |p| p.name("the name of an argument"));
        self.expect(TokenKind::Assign, "`= value`");
        let body = self.expr();
        let unit = self.unit();
        let doc = self.doc();
        Some(StatementKind::Function(Box::new(Function { name, params, body, unit, doc })))
    }

    fn state(&mut self) -> Option<State> {
        let PathPart { name, indices } = self.indexed("the name of a signal")?;
        if !self.eat(TokenKind::Prime) {
            let fault = Diagnostic::error(codes::S001, "`'` is expected", self.gap(), "missing here")
                .hint(format!("a state is given by its derivative: `state {}' = ... from ...`", name.text));
            self.remark(fault);
        }
        self.expect(TokenKind::Assign, "`= value`");
        let rate = self.expr();
        let start = if self.eat_word("from") { Some(self.expr()) } else { None };
        let unit = self.unit();
        let doc = self.doc();
        Some(State { name, indices, rate, start, unit, doc })
    }

    fn import(&mut self) -> Option<Import> {
        if self.is(TokenKind::Text) {
            return Some(Import { path: self.quoted(), library: false });
        }
        if !self.is(TokenKind::Ident) {
            self.expected("the name of a file, in quotes, or of a library");
            return None;
        }
        let span = self.path().span;
        let text = self.text[span.start as usize..span.end as usize].to_string();
        Some(Import { path: Doc { text, span }, library: true })
    }

    /// `port frame { bond twist[6]; in R[3, 3] }`; `port` has been read.
    fn port_kind(&mut self) -> Option<PortKind> {
        let name = self.name("the name of a kind of port")?;
        let mut kind = PortKind { name, bonds: Vec::new(), signals: Vec::new(), doc: None };
        if !self.expect(TokenKind::LBrace, "`{`") {
            return None;
        }
        let open = self.span_before();
        while !matches!(self.kind(), TokenKind::End | TokenKind::RBrace) {
            let before = self.pos;
            self.tokens[self.pos].newlines = 0;
            self.quiet = false;
            let list = match self.text_of(self.token()) {
                "bond" => Some(&mut kind.bonds),
                "in" => Some(&mut kind.signals),
                _ => None,
            };
            match list {
                Some(list) => {
                    self.bump();
                    loop {
                        list.extend(self.declaration(Value::Optional));
                        if !self.eat(TokenKind::Comma) {
                            break;
                        }
                    }
                }
                None => {
                    self.expected("`bond` or `in`");
                    self.skip();
                }
            }
            if !self.eat(TokenKind::Semicolon) {
                self.end_statement();
            }
            if self.pos == before {
                self.bump();
            }
        }
        if self.kind() == TokenKind::RBrace {
            self.bump();
        } else {
            let fault = Diagnostic::error(codes::S002, "`}` is missing", open, "opened here")
                .also(self.gap(), "the text ends here");
            self.report(fault);
        }
        kind.doc = self.doc();
        Some(kind)
    }

    fn component(&mut self) -> Option<Component> {
        let name = self.name("the name of the component");
        let mut component = Component {
            name: name.unwrap_or(Name { text: String::new(), span: self.gap() }),
            params: Vec::new(),
            consts: Vec::new(),
            ports: Vec::new(),
            ins: Vec::new(),
            outs: Vec::new(),
            doc: None,
            body: Vec::new(),
        };
        if self.is(TokenKind::LParen) {
            self.signature(&mut component);
        }
        component.doc = self.doc();
        component.body = self.expect_block();
        Some(component)
    }

    /// `(param a, b = 1; const d[3]; port p, q; in u; out y)`.
    fn signature(&mut self, component: &mut Component) {
        let open = self.span();
        self.bump();
        self.brackets += 1;
        self.signature = true;
        while !self.boundary() && !matches!(self.kind(), TokenKind::RParen | TokenKind::LBrace) {
            self.group(component);
            if !self.is(TokenKind::Semicolon) && !self.is(TokenKind::RParen) {
                self.expected("`;` or `)`");
                self.skip();
            }
            if !self.eat(TokenKind::Semicolon) && !self.eat(TokenKind::Comma) {
                break;
            }
            self.quiet = false;
        }
        self.signature = false;
        self.close(open, TokenKind::RParen);
    }

    /// `port p, q`.
    fn group(&mut self, component: &mut Component) {
        let word = self.token();
        let list = match self.text_of(word) {
            "param" => &mut component.params,
            "const" => &mut component.consts,
            "port" => &mut component.ports,
            "in" => &mut component.ins,
            "out" => &mut component.outs,
            _ => {
                self.expected("`param`, `const`, `port`, `in` or `out`");
                self.skip();
                return;
            }
        };
        self.bump();
        let before = list.len();
        loop {
            list.extend(self.declaration(Value::Optional));
            if !self.is(TokenKind::Comma) || self.begins_group() {
                break;
            }
            self.bump();
        }
        spread_docs(&mut list[before..]);
    }

    /// Whether after this comma `port p` comes, where a semicolon should stand.
    fn begins_group(&self) -> bool {
        matches!(self.text_of(self.ahead(1)), "param" | "const" | "port" | "in" | "out")
            && self.ahead(2).kind == TokenKind::Ident
    }

    fn expect_block(&mut self) -> Vec<Statement> {
        if !self.is(TokenKind::LBrace) {
            self.expected("`{`");
            self.skip_to_brace();
        }
        if self.kind() == TokenKind::LBrace { self.block() } else { Vec::new() }
    }

    /// Skips to an opening brace on the rest of the statement.
    fn skip_to_brace(&mut self) {
        while !self.boundary() && self.kind() != TokenKind::LBrace {
            self.bump();
        }
    }

    /// `{ ... }`; the opening brace is this token.
    fn block(&mut self) -> Vec<Statement> {
        let open = self.span();
        let outer = (self.brackets, self.signature);
        (self.brackets, self.signature) = (0, false);
        self.bump();
        let body = self.nested(Self::statements).unwrap_or_default();
        if self.kind() == TokenKind::RBrace {
            self.bump();
        } else {
            let fault = Diagnostic::error(codes::S002, "`}` is missing", open, "opened here")
                .also(self.gap(), "the text ends here");
            self.report(fault);
        }
        (self.brackets, self.signature) = outer;
        body
    }

    fn element_path(&mut self, what: &str) -> Option<Path> {
        if self.is(TokenKind::Ident) && !RESERVED.contains(&self.text_of(self.token())) {
            return Some(self.path());
        }
        self.name(what); // reports why it is none
        None
    }

    fn forced_causality(&mut self) -> Option<ForcedCausality> {
        let element = self.element_path("an element")?;
        let span = self.span();
        let causality = match self.text_of(self.token()) {
            "integral" => Causality::Integral,
            "derivative" => Causality::Derivative,
            "resistive" => Causality::Resistive,
            "conductive" => Causality::Conductive,
            _ => {
                self.unknown_causality();
                return None;
            }
        };
        self.bump();
        Some(ForcedCausality { element, causality, span })
    }

    fn unknown_causality(&mut self) {
        const WORDS: [&str; 4] = ["integral", "derivative", "resistive", "conductive"];
        if !self.is(TokenKind::Ident) {
            return self.expected("`integral`, `derivative`, `resistive` or `conductive`");
        }
        let word = self.text_of(self.token());
        let fault = Diagnostic::error(codes::S013, format!("there is no causality `{word}`"), self.span(), "");
        let fault = match crate::diagnostic::nearest(word, WORDS) {
            Some(near) => fault.hint(format!("did you mean `{near}`?")),
            None => fault.hint("storages are `integral` or `derivative`, resistors `resistive` or `conductive`"),
        };
        self.report(fault);
        self.bump();
    }

    fn stroke(&mut self) -> Option<ForcedStroke> {
        let from = self.element_path("an end of a bond")?;
        let bond = if self.eat(TokenKind::Arrow) {
            StrokeBond::Between(from, self.element_path("the other end of the bond")?)
        } else {
            StrokeBond::Named(self.bond_name(from)?)
        };
        self.expect_word("at");
        let at = self.element_path("the end with the stroke")?;
        Some(ForcedStroke { bond, at })
    }

    /// A path that names a bond: it has one part.
    fn bond_name(&mut self, mut path: Path) -> Option<PathPart> {
        if path.parts.len() == 1 {
            return path.parts.pop();
        }
        self.expected("`->` and the other end of the bond");
        None
    }

    fn constraint(&mut self) -> Option<Constraint> {
        let PathPart { name, indices } = self.indexed("the name of the constraint")?;
        self.expect(TokenKind::Colon, "the name of the constraint with `:`, as in `constraint loop: x = y`,");
        let left = self.expr();
        let equality = self.is(TokenKind::Assign);
        let (left, sides, right, args) = match left.kind {
            ExprKind::Binary(b) if !equality && matches!(b.op, BinaryOp::Ge | BinaryOp::Le) => {
                let sides = if b.op == BinaryOp::Ge { Sides::AtLeast } else { Sides::AtMost };
                let mut right = *b.right;
                let mut args = split_arguments(&mut right);
                if args.is_empty() && self.is(TokenKind::LParen) {
                    args = self.args().0;
                }
                (*b.left, sides, right, args)
            }
            kind => {
                let left = Expr { kind, ..left };
                let right = if self.eat(TokenKind::Assign) {
                    self.expr()
                } else {
                    self.expected("`=`, `>=` or `<=`");
                    Expr { span: self.gap(), kind: ExprKind::Missing }
                };
                (left, Sides::Equal, right, Vec::new())
            }
        };
        let doc = self.doc();
        Some(Constraint { name, indices, left, sides, right, args, doc })
    }

    fn domain(&mut self) -> Option<DomainBlock> {
        let name = self.name("the name of the domain")?;
        let pseudo = self.is_word("pseudo").then(|| self.span());
        self.eat_word("pseudo");
        let doc = self.doc();
        let body = self.expect_block();
        Some(DomainBlock { name, pseudo, doc, body })
    }

    fn when(&mut self) -> Option<When> {
        let trigger = match self.period_follows() {
            true => {
                self.bump();
                Trigger::Every(self.expr())
            }
            false => Trigger::Becomes(self.expr()),
        };
        Some(When { trigger, actions: self.nested(Self::actions)? })
    }

    /// Whether `every` with a period comes, and no condition on something that is called so.
    fn period_follows(&self) -> bool {
        let next = self.ahead(1);
        let begins = matches!(next.kind, TokenKind::Number | TokenKind::Ident);
        self.is_word("every") && begins && next.newlines == 0 && !RESERVED.contains(&self.text_of(next))
    }

    /// `{ reset m.p = expr ... n = expr ... }`.
    fn actions(&mut self) -> Vec<Action> {
        let mut actions = Vec::new();
        if !self.expect(TokenKind::LBrace, "`{`") {
            return actions;
        }
        let open = self.span_before();
        while !matches!(self.kind(), TokenKind::End | TokenKind::RBrace) {
            let before = self.pos;
            self.tokens[self.pos].newlines = 0;
            self.quiet = false;
            actions.extend(self.action());
            if !self.eat(TokenKind::Semicolon) {
                self.end_statement();
            }
            if self.pos == before {
                self.bump();
            }
        }
        if self.kind() == TokenKind::RBrace {
            self.bump();
        } else {
            let fault = Diagnostic::error(codes::S002, "`}` is missing", open, "opened here")
                .also(self.gap(), "the text ends here");
            self.report(fault);
        }
        actions
    }

    /// `reset m.p = expr` or `n = expr`.
    fn action(&mut self) -> Option<Action> {
        let start = self.span();
        let word = self.text_of(self.token());
        if matches!(word, "for" | "if" | "when") {
            let title = format!("`{word}` has no place in what happens at an event");
            let hint = match word {
                "if" => "write `n = if ... then ... else n`, or another `when`",
                _ => "put it around the `when`, or beside it: what happens at one instant happens at once",
            };
            self.report(Diagnostic::error(codes::S013, title, start, "here").hint(hint));
            self.skip_to_brace();
            if self.kind() == TokenKind::LBrace {
                self.nested(Self::actions);
            }
            return None;
        }
        let reset = self.is_word("reset") && self.ahead(1).kind == TokenKind::Ident;
        if reset {
            self.bump();
        }
        let what = if reset { "the variable that is reset" } else { "`reset` or a discrete variable" };
        let target = self.element_path(what)?;
        if !self.expect(TokenKind::Assign, "`= value`") {
            return None;
        }
        let value = self.expr();
        Some(Action { reset, target, value, span: self.since(start) })
    }

    /// `kind:name[i](arguments) "doc"`.
    fn shape(&mut self) -> Option<Element> {
        if self.kind() != TokenKind::Ident || self.ahead(1).kind != TokenKind::Colon {
            self.expected("a shape, as in `box:hull(r = car.r, R = car.R, size = [4, 1.6, 1])`");
            return None;
        }
        let Node::Declared(mut shape) = self.element(None) else { return None };
        shape.doc = self.doc();
        Some(*shape)
    }

    fn for_loop(&mut self) -> Option<For> {
        let (variable, from, to, _) = self.range()?;
        let body = self.expect_block();
        Some(For { variable, from, to, body })
    }

    /// Whether `if` with a block comes. Without one it is an expression that was meant to go on.
    fn choice_follows(&self) -> bool {
        if self.text_of(self.token()) != "if" {
            return false;
        }
        let mut open = 0usize;
        for token in self.tokens.iter().skip(self.pos + 1) {
            match token.kind {
                TokenKind::End | TokenKind::RBrace => return false,
                _ if token.newlines > 0 && open == 0 => return false,
                TokenKind::LBrace => return true,
                TokenKind::LParen | TokenKind::LBracket => open += 1,
                TokenKind::RParen | TokenKind::RBracket => open = open.saturating_sub(1),
                TokenKind::Ident if open == 0 && self.text_of(*token) == "then" => return false,
                _ => {}
            }
        }
        false
    }

    /// `if cond { ... } else { ... }`; `if` is this token.
    fn choice(&mut self) -> Choice {
        self.bump();
        let cond = self.expr();
        let yes = self.expect_block();
        let no = if self.word_after_block("else") { self.otherwise() } else { Vec::new() };
        Choice { cond, yes, no }
    }

    /// Whether a word follows the block that has ended, perhaps on the next line.
    fn word_after_block(&self, word: &str) -> bool {
        self.kind() == TokenKind::Ident && self.text_of(self.token()) == word
    }

    /// What follows `else`, which is this token.
    fn otherwise(&mut self) -> Vec<Statement> {
        self.tokens[self.pos].newlines = 0;
        self.bump();
        let start = self.span();
        if !self.choice_follows() {
            return self.expect_block();
        }
        let choice = self.nested(Self::choice);
        let span = self.since(start);
        choice.map(|c| Statement { span, kind: StatementKind::Choice(Box::new(c)) }).into_iter().collect()
    }
}

/// Gives the last text of a list to those before it that have none.
fn spread_docs(items: &mut [Declaration]) {
    let mut doc = None;
    for item in items.iter_mut().rev() {
        if item.doc.is_none() {
            item.doc = doc.clone();
        } else {
            doc = item.doc.clone();
        }
    }
}

/// What reads as a call with named arguments at the end of an expression is a name, with arguments of something else behind
/// it: `h (restitution = 0.8)`.
fn split_arguments(e: &mut Expr) -> Vec<Arg> {
    match &mut e.kind {
        ExprKind::Binary(b) => split_arguments(&mut b.right),
        ExprKind::Unary(u) => split_arguments(&mut u.operand),
        ExprKind::Call(call) if !call.args.is_empty() && call.args.iter().all(|a| a.label.is_some()) => {
            let (name, args) = (call.function.clone(), std::mem::take(&mut call.args));
            let span = name.span;
            let path = Path { parts: vec![PathPart { name, indices: Vec::new() }], span };
            *e = Expr { span, kind: ExprKind::Path(path) };
            args
        }
        _ => Vec::new(),
    }
}
