//! Nodes and bonds.

use super::*;

impl Parser<'_> {
    /// Nodes joined by half arrows.
    pub(super) fn chain(&mut self) -> Chain {
        let mut first = self.node();
        let doc = self.doc();
        let left_over = document(&mut first, doc);
        self.idle_doc(left_over);
        let mut bonds = Vec::with_capacity(1);
        while self.is(TokenKind::Arrow) {
            bonds.push(self.bond());
        }
        self.reversed_arrow();
        Chain { first, bonds }
    }

    fn bond(&mut self) -> Bond {
        let arrow = self.span();
        self.bump();
        let mut to = self.node();
        let doc = self.doc();
        let left_over = document(&mut to, doc);
        self.idle_doc(left_over);
        let name = if self.eat_word("as") { self.indexed("the name of the bond") } else { None };
        let doc = if name.is_some() { self.doc() } else { None };
        Bond { arrow, to, name, doc }
    }

    /// Warns of quoted text that documents nothing.
    pub(super) fn idle_doc(&mut self, doc: Option<Doc>) {
        if let Some(doc) = doc {
            let title = "this text documents nothing";
            let fault = Diagnostic::warning(codes::S011, title, doc.span, "no declaration stands before it").hint(
                "put it where the node is declared, as in `R:damper(b) \"text\"`, or make it a comment with `//`",
            );
            self.remark(fault);
        }
    }

    fn reversed_arrow(&mut self) {
        if self.is(TokenKind::Less) && self.ahead(1).kind == TokenKind::Minus && self.adjacent(1) {
            let span = self.span().to(self.span_of(self.ahead(1)));
            let fault = Diagnostic::error(codes::S001, "half arrows are written to the right", span, "points left")
                .hint("swap the two ends: `b -> a` for `a <- b`");
            self.report(fault);
        }
    }

    fn node(&mut self) -> Node {
        let span = self.span();
        if self.boundary() {
            self.expected("a node");
            return Node::Missing(self.gap());
        }
        match self.kind() {
            TokenKind::Ident | TokenKind::Number if self.ahead(1).kind == TokenKind::Colon => self.element(None),
            TokenKind::Ident if self.ahead(1).kind == TokenKind::LParen => self.nameless(),
            TokenKind::Ident | TokenKind::Number if self.width_follows() => {
                let kind = self.bump();
                self.element(Some(kind))
            }
            TokenKind::LBracket => self.joined(),
            TokenKind::Ident if !RESERVED.contains(&self.text_of(self.token())) => Node::Named(self.path()),
            TokenKind::Number => self.number_node(),
            _ => {
                self.expected("a node");
                Node::Missing(span)
            }
        }
    }

    /// Whether `I[3]:` comes.
    fn width_follows(&self) -> bool {
        if self.ahead(1).kind != TokenKind::LBracket || !self.adjacent(1) {
            return false;
        }
        let (mut i, mut open) = (1, 0usize);
        loop {
            match self.ahead(i).kind {
                TokenKind::LBracket | TokenKind::LParen => open += 1,
                TokenKind::RBracket | TokenKind::RParen => open -= 1,
                TokenKind::End | TokenKind::Arrow | TokenKind::Assign => return false,
                _ => {}
            }
            i += 1;
            if open == 0 {
                return self.ahead(i).kind == TokenKind::Colon;
            }
        }
    }

    /// `[v, w]`: nodes side by side.
    fn joined(&mut self) -> Node {
        let start = self.span();
        let nodes = self.bracketed(TokenKind::RBracket, |p| {
            let mut node = p.nested(Self::node).unwrap_or_else(|| Node::Missing(p.gap()));
            let doc = p.doc();
            let left_over = document(&mut node, doc);
            p.idle_doc(left_over);
            Some(node)
        });
        Node::Joined(nodes, self.since(start))
    }

    /// `Kind:name[ports](args)`; the kind has been read if it is given.
    pub(super) fn element(&mut self, wide: Option<Token>) -> Node {
        let kind = wide.unwrap_or_else(|| self.bump());
        let start = self.span_of(kind);
        let widths = if wide.is_some() { self.widths() } else { Vec::new() };
        if kind.kind == TokenKind::Number && !matches!(self.text_of(kind), "0" | "1") {
            self.no_such_junction(kind);
        }
        self.bump(); // the colon
        let name = self.name("the name of the node");
        let (indices, ports) = self.brackets();
        let args = if self.is(TokenKind::LParen) { self.args().0 } else { Vec::new() };
        let span = self.since(start);
        let port = self.port_of_declaration(span, name.as_ref());
        match name {
            Some(name) => {
                let kind = self.name_of(kind);
                Node::Declared(Box::new(Element { kind, widths, name, indices, ports, args, doc: None, port, span }))
            }
            None => Node::Missing(span),
        }
    }

    /// `Diode:d1.p`: a part cannot be declared and its port be named at once.
    fn port_of_declaration(&mut self, declared: Span, name: Option<&Name>) -> Option<Name> {
        let name = name?;
        if !self.is(TokenKind::Dot) || !self.adjacent(0) || self.ahead(1).kind != TokenKind::Ident {
            return None;
        }
        self.bump();
        let token = self.bump();
        let port = self.name_of(token);
        let text = &self.text[declared.start as usize..declared.end as usize];
        let title = "a port is named only where its part has been declared";
        let hint = format!("write `{text}` on a line of its own, and `{}.{}` here", name.text, port.text);
        self.report(Diagnostic::error(codes::S001, title, port.span, "a port").hint(hint));
        Some(port)
    }

    fn no_such_junction(&mut self, kind: Token) {
        let title = format!("there is no junction `{}`", self.text_of(kind));
        let fault = Diagnostic::error(codes::S010, title, self.span_of(kind), "")
            .hint("a junction is `0` (one effort) or `1` (one flow)");
        self.remark(fault);
    }

    fn widths(&mut self) -> Vec<Expr> {
        let start = self.span();
        let widths = self.bracketed(TokenKind::RBracket, |p| Some(p.expr()));
        if widths.is_empty() {
            let fault = Diagnostic::error(codes::S001, "a width is expected", self.since(start), "nothing stands here");
            self.report(fault.hint("write how many bonds there are: `1[3]:v`"));
        }
        widths
    }

    /// What stands in brackets behind the name of an element: indices, then ports. Names alone are ports here.
    fn brackets(&mut self) -> (Vec<Expr>, Vec<Name>) {
        if !self.is(TokenKind::LBracket) {
            return (Vec::new(), Vec::new());
        }
        if self.names_in_brackets() && !self.second_brackets() {
            return (Vec::new(), self.port_names());
        }
        let indices = self.bracketed(TokenKind::RBracket, |p| Some(p.expr()));
        let ports = if self.is(TokenKind::LBracket) && self.adjacent(0) { self.port_names() } else { Vec::new() };
        (indices, ports)
    }

    fn port_names(&mut self) -> Vec<Name> {
        self.bracketed(TokenKind::RBracket, |p| p.name("the name of a port"))
    }

    /// Whether only names stand in the brackets that open here, or nothing.
    fn names_in_brackets(&self) -> bool {
        self.ahead(self.names_and_commas()).kind == TokenKind::RBracket
    }

    /// Whether brackets follow those that open here.
    fn second_brackets(&self) -> bool {
        let close = self.names_and_commas();
        self.ahead(close + 1).kind == TokenKind::LBracket && self.adjacent(close + 1)
    }

    /// How far ahead names and commas reach behind the bracket that opens here.
    fn names_and_commas(&self) -> usize {
        let mut i = 1;
        while matches!(self.ahead(i).kind, TokenKind::Ident | TokenKind::Comma) {
            i += 1;
        }
        i
    }

    /// `R(5)`: a kind without a name, or arguments where the node is not declared.
    fn nameless(&mut self) -> Node {
        let word = self.bump();
        let start = self.span_of(word);
        self.args();
        let span = self.since(start);
        let kind = self.text_of(word);
        let fault = Diagnostic::error(codes::S010, "a node is declared as `Kind:name(...)`", span, "no `:` here")
            .hint(format!("write `{kind}:name(...)` if `{kind}` is the kind, or `Kind:{kind}(...)` if it is the name"));
        self.remark(fault);
        Node::Missing(span)
    }

    /// `0` or `0a`, where a junction should have a name.
    fn number_node(&mut self) -> Node {
        let span = self.span();
        if self.adjacent(1) && self.ahead(1).kind == TokenKind::Ident {
            self.digit_name();
        } else {
            let token = self.bump();
            let text = self.text_of(token);
            let fault = Diagnostic::error(codes::S010, "a junction needs a name", span, "only its kind is given")
                .hint(format!("write `{text}:name`"));
            self.report(fault);
        }
        Node::Missing(self.since(span))
    }
}

/// Gives the text to the node if it is declared here, else gives it back.
fn document(node: &mut Node, doc: Option<Doc>) -> Option<Doc> {
    match node {
        Node::Declared(element) => {
            element.doc = doc;
            None
        }
        _ => doc,
    }
}
