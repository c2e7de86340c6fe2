//! What names in expressions stand for.

use super::Meaning;
use super::builder::{Builder, Role, Value};
use super::dimension::Quantity;
use super::families::spelled;
use super::flatten::Word;
use super::multibonds::{Width, strand_of};
use super::scope::{DeclId, DeclKind, Node, ScopeId, Valued, no_indices};
use super::uses::Used;
use super::value::{ONLY_FILES, Reading};
use super::vectors::Shaped;
use crate::algebra::{Expr, Symbol, SymbolKind};
use crate::ast;
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;
use crate::unit::Dimension as Dim;

impl<'a> Builder<'a, '_> {
    /// The value of a name, bare or dotted.
    pub fn path(&mut self, cx: &Reading<'_>, path: &'a ast::Path) -> Option<Value> {
        match path.parts.as_slice() {
            [one] => self.bare(cx, one),
            _ => self.dotted(cx, path),
        }
    }

    fn bare(&mut self, cx: &Reading<'_>, part: &'a ast::PathPart) -> Option<Value> {
        let (name, text) = (&part.name, part.name.text.as_str());
        let plain = part.indices.is_empty();
        if let Some((_, symbol)) = cx.formals.iter().find(|(n, _)| *n == text && plain) {
            return Some(Value::number(self.exprs.sym(*symbol), Quantity::Any));
        }
        if cx.law
            && plain
            && let Some(found) = self.own(cx, text, None, name.span)
        {
            return found;
        }
        match text {
            "t" if plain => return Some(self.symbol_value(self.time)),
            "pi" if plain => return Some(Value::number(self.exprs.pi(), Quantity::NONE)),
            _ => {}
        }
        if let Some(value) = self.repeats.variable(cx.here.turn, text).filter(|_| plain) {
            if self.repeats.is_counted(cx.here.turn, text) {
                self.note_difference();
            }
            return Some(Value::number(self.exprs.int(value), Quantity::Any));
        }
        if let Some(value) = self.flat.names.value(cx.here.scope, text) {
            return self.valued(cx, value, part);
        }
        if let Some(found) = self.own(cx, text, None, name.span).filter(|_| plain) {
            return found;
        }
        self.unknown(cx, name);
        None
    }

    /// The value of a name with its indices.
    fn valued(&mut self, cx: &Reading<'_>, value: Valued, part: &'a ast::PathPart) -> Option<Value> {
        self.uses.add(Used::of(value), part.name.span);
        let names = &self.flat.names;
        if let (Valued::Family(family), Some(array), true) = (value, cx.array, part.indices.is_empty())
            && !cx.item.is_empty()
            && !names.value_families[family].is_like(&names.value_families[array])
        {
            return self.unlike(part, names.value_families[family].words(&part.name.text));
        }
        if let Valued::One(decl) = value
            && let Some(shaped) = self.shapes.get(&decl)
        {
            return self.entry_of(cx, shaped.clone(), part);
        }
        match names.decl_of(&mut self.repeats, cx.here, value, part, cx.item) {
            Ok(decl) => self.declared(decl, part.name.span),
            Err(fault) => {
                self.fault(*fault);
                None
            }
        }
    }

    /// An entry of a named vector or matrix, by its indices.
    fn entry_of(&mut self, cx: &Reading<'_>, shaped: Shaped, part: &'a ast::PathPart) -> Option<Value> {
        let (name, span) = (&part.name.text, part.name.span);
        let indices = match self.repeats.indices(&self.flat.names, cx.here, &part.indices) {
            Ok(indices) => indices,
            Err(fault) => {
                self.fault(*fault);
                return None;
            }
        };
        let found = shaped.entry(&indices).cloned();
        if found.is_none() {
            let d = match indices.is_empty() {
                true => Diagnostic::error(
                    codes::N017,
                    "a number is needed here",
                    span,
                    format!("this is {}", shaped.words()),
                ),
                false => {
                    let title = format!("there is no `{}`", spelled(name, &indices));
                    Diagnostic::error(codes::N021, title, span, format!("`{name}` is {}", shaped.words()))
                }
            };
            let example = spelled(name, &vec![1; shaped.shape.len()]);
            self.fault(d.hint(format!("write one of its entries, such as `{example}`")));
        }
        found
    }

    fn unlike(&mut self, part: &ast::PathPart, words: String) -> Option<Value> {
        let title = format!("`{}` has not the indices of this array", part.name.text);
        let d = Diagnostic::error(codes::N021, title, part.name.span, "an array of another shape");
        self.fault(d.note(words).hint("read single elements in a list: `[a[i] for i in 1..n]`"));
        None
    }

    /// The value of a symbol.
    pub fn symbol_value(&mut self, symbol: Symbol) -> Value {
        let quantity = self.quantity(symbol);
        Value::number(self.exprs.sym(symbol), quantity)
    }

    /// The value of a declaration. `None` if it is at fault or a function.
    pub fn declared(&mut self, decl: DeclId, span: Span) -> Option<Value> {
        if let DeclKind::Function(f) = self.flat.names.decls[decl].kind {
            let title = format!("`{}` is a function", f.name.text);
            let d = Diagnostic::error(codes::N017, title, span, "used as a value").also(f.name.span, "declared here");
            self.fault(d.hint(format!("write `{}( … )`", f.name.text)));
            return None;
        }
        if self.texts.contains_key(&decl) {
            return self.misplaced(span, "text", ONLY_FILES);
        }
        self.values[decl].clone()
    }

    /// One of the element's own variables, `e f q p`, if the element has it. The outer `None`: it has not.
    fn own(&mut self, cx: &Reading<'_>, name: &str, port: Option<&ast::Name>, span: Span) -> Option<Option<Value>> {
        let part = cx.own?;
        let p = self.part(part);
        let has = match name {
            "e" | "f" => !p.word.is_junction(),
            "q" => p.word == Word::C,
            "p" => p.word == Word::I,
            _ => false,
        };
        if !has || p.word.is_two_port() {
            return None;
        }
        let slot = match (port, p.ports.len()) {
            (None, 0 | 1) => 0,
            (None, _) if !cx.law => return None,
            (None, _) => {
                let first = &p.ports[0].text;
                self.fault(
                    Diagnostic::error(codes::B009, format!("`{name}` of which port?"), span, "the element has several")
                        .hint(format!("write `{name}.{first}`")),
                );
                return Some(None);
            }
            (Some(port), _) => p.ports.iter().position(|n| n.text == port.text)?,
        };
        Some(self.port_variable(part, slot, name))
    }

    /// Effort, flow or stored quantity at a port; `None` if the model is at fault there.
    pub fn port_variable(&mut self, part: usize, port: usize, name: &str) -> Option<Value> {
        let symbol = match name {
            "e" => self.pairs[self.wire_at(part, port)?].effort,
            "f" => self.pairs[self.wire_at(part, port)?].flow,
            _ => *self.stored[part].get(port)?,
        };
        Some(self.symbol_value(symbol))
    }

    fn unknown(&mut self, cx: &Reading<'_>, name: &ast::Name) {
        let text = name.text.as_str();
        let d = Diagnostic::error(
            codes::N001,
            format!("`{text}` is not declared"),
            name.span,
            "no such parameter or signal",
        );
        if let Some((node, span)) = self.flat.names.scopes[cx.here.scope].nodes.get(text).copied() {
            let variable = self.example_variable(node);
            return self.fault(
                d.also(span, "there is an element of that name")
                    .note("a bare name is a parameter or signal; what belongs to an element has a dot")
                    .hint(format!("write `{text}.{variable}`")),
            );
        }
        if matches!(text, "e" | "f" | "q" | "p") && cx.own.is_some() {
            let word = cx.own.map_or(String::new(), |p| self.part(p).word.with_article());
            return self.fault(
                d.note(format!("{word} has no `{text}` of its own"))
                    .hint("an I has e, f, p; a C has e, f, q; an R has e, f"),
            );
        }
        let near = nearest(text, self.flat.names.visible_values(cx.here.scope));
        self.fault(match near {
            Some(near) => d.hint(format!("did you mean `{near}`?")),
            None => d.hint(format!("declare it: `param {text} = …`")),
        });
    }

    fn example_variable(&self, node: Node) -> &'static str {
        match node {
            Node::Part(part) => match self.part(part).word {
                Word::Zero => "e",
                Word::C => "q",
                w if w.is_two_port() => "in.e",
                _ => "f",
            },
            Node::Instance(_) => "name",
            _ => "e",
        }
    }

    fn dotted(&mut self, cx: &Reading<'_>, path: &'a ast::Path) -> Option<Value> {
        let first = &path.parts[0].name;
        if path.parts.len() == 2
            && matches!(first.text.as_str(), "e" | "f" | "q" | "p")
            && let Some(found) = self.own(cx, &first.text, Some(&path.parts[1].name), path.span)
        {
            return found;
        }
        let uses = &mut self.uses;
        let visit = &mut |node, span| uses.add(Used::Node(node), span);
        let (node, used) = match self.flat.names.walk_wide(&mut self.repeats, cx.here, path, visit) {
            Ok((Node::Family(family), used)) => {
                self.not_one(family, path, used);
                return None;
            }
            Ok(found) => found,
            Err(fault) => {
                self.fault(*fault);
                return None;
            }
        };
        let rest = &path.parts[used..];
        if let (Node::Instance(inner), [part]) = (node, rest) {
            return self.inner_value(cx, inner, part);
        }
        if let (Node::Part(part), [side, rest @ ..]) = (node, rest)
            && let (Width::Matrix { .. }, Some(index)) = (self.part(part).width, side.indices.first())
        {
            return self.one_of_side(cx, part, side, index, rest);
        }
        if let Some((part, index)) = rest.iter().find_map(|p| Some((p, p.indices.first()?))) {
            self.fault(no_indices(&part.name, index.span));
            return None;
        }
        let rest: Vec<&ast::Name> = rest.iter().map(|p| &p.name).collect();
        match (node, rest.as_slice()) {
            (Node::Broken, _) => None,
            (Node::Part(part), [port]) if self.is_port(part, &port.text) => self.incomplete_port(port, path),
            (Node::Part(part), [variable]) => self.element_variable(part, variable),
            (Node::Part(part), [side, strand, variable]) => self.strand_of_side(part, side, strand, variable),
            (Node::Part(part), [port, variable]) => self.named_port_variable(part, port, variable),
            (_, [variable]) if !matches!(node, Node::Instance(_)) => self.variable_of(node, variable),
            (_, []) => self.incomplete(node, path),
            (_, [.., last]) => {
                self.fault(
                    Diagnostic::error(
                        codes::N001,
                        format!("`{}` means nothing here", last.text),
                        last.span,
                        "one part too many",
                    )
                    .hint("an element's variables are e, f, q and p"),
                );
                None
            }
        }
    }

    /// A variable of a node with one bond, of a named bond or of a constraint.
    pub fn variable_of(&mut self, node: Node, variable: &ast::Name) -> Option<Value> {
        match node {
            Node::Part(part) => self.element_variable(part, variable),
            Node::Port(part, port) => self.variable_at(part, port, variable),
            Node::Joint(joint) => {
                let wire = self.wiring.of_joint[joint];
                if wire.is_none() && self.flat.joints[joint].open {
                    let title = format!("nothing is joined to the port `{}`", self.flat.joints[joint].name);
                    let d = Diagnostic::error(codes::N018, title, variable.span, "it has no variables then");
                    self.fault(d.hint("ask for the variable of the junction that it leads to"));
                }
                self.pair_variable(wire, variable)
            }
            Node::Bond(drawn) => self.pair_variable(self.wiring.of_drawn[drawn], variable),
            Node::Constraint(c) => self.reaction_variable(c, variable),
            Node::Instance(_) | Node::Family(_) | Node::Broken => None,
        }
    }

    /// A variable at one port of an element.
    fn variable_at(&mut self, part: usize, port: usize, variable: &ast::Name) -> Option<Value> {
        let word = self.part(part).word;
        let fits = match variable.text.as_str() {
            "e" | "f" => true,
            "q" => word == Word::C,
            "p" => word == Word::I,
            _ => false,
        };
        if !fits {
            self.no_such_variable(part, variable);
            return None;
        }
        self.port_variable(part, port, &variable.text)
    }

    /// `axis.out[2].f` of a wide two-port.
    fn one_of_side(
        &mut self,
        cx: &Reading<'_>,
        part: usize,
        side: &'a ast::PathPart,
        index: &'a ast::Expr,
        rest: &'a [ast::PathPart],
    ) -> Option<Value> {
        let at = self.whole(cx, index, "an index")?;
        let mut ports = self.part(part).side(side.name.text == "in");
        let port = usize::try_from(at - 1).ok().and_then(|at| ports.nth(at));
        match (port, rest, matches!(side.name.text.as_str(), "in" | "out")) {
            (Some(port), [variable], true) => self.variable_at(part, port, &variable.name),
            _ => {
                let title = format!("there is no `{}[{at}]` of `{}`", side.name.text, self.part(part).name);
                let d = Diagnostic::error(codes::N021, title, side.name.span, "no such bond");
                self.fault(d.hint("write `in[1].f`, `out[1].e` and so on"));
                None
            }
        }
    }

    /// `axis.out.x.f` of a wide two-port.
    fn strand_of_side(
        &mut self,
        part: usize,
        side: &ast::Name,
        strand: &ast::Name,
        variable: &ast::Name,
    ) -> Option<Value> {
        let ports = self.part(part).side(side.text == "in");
        let port =
            strand_of(&strand.text).filter(|at| ports.len() <= 3 && *at < ports.len()).map(|at| ports.start + at);
        match port.filter(|_| self.is_port(part, &side.text)) {
            Some(port) => self.variable_at(part, port, variable),
            None => {
                let title = format!("`{}` has no `{}.{}`", self.part(part).name, side.text, strand.text);
                self.fault(Diagnostic::error(codes::N001, title, strand.span, "not known"));
                None
            }
        }
    }

    /// Several side by side where one is needed.
    fn not_one(&mut self, family: super::families::FamilyId, path: &'a ast::Path, used: usize) {
        let part = &path.parts[used - 1];
        let row = self.flat.names.node_families[family].row();
        match (row, path.parts.get(used)) {
            (Some(n), Some(variable)) if path.parts.len() == used + 1 => {
                let (name, variable) = (&part.name.text, &variable.name.text);
                let title = format!("a number is needed here, `{name}.{variable}` is a vector of {n}");
                let d = Diagnostic::error(codes::N017, title, path.span, "a vector");
                self.fault(d.hint(format!("name one of its entries: `{name}[1].{variable}`")));
            }
            _ => {
                if let Err(fault) = self.flat.names.node_families.get(family, &part.name, &[]) {
                    self.fault(*fault);
                }
            }
        }
    }

    fn is_port(&self, part: usize, name: &str) -> bool {
        let p = self.part(part);
        p.word.is_two_port() && matches!(name, "in" | "out")
            || p.ports.iter().any(|n| n.text == name) && !matches!(name, "e" | "f" | "q" | "p")
    }

    fn incomplete_port(&mut self, port: &ast::Name, path: &ast::Path) -> Option<Value> {
        let name: Vec<&str> = path.parts.iter().map(|p| p.name.text.as_str()).collect();
        self.fault(
            Diagnostic::error(codes::N017, "a port is no number", port.span, "this is a port")
                .hint(format!("write `{0}.e` or `{0}.f`", name.join("."))),
        );
        None
    }

    fn incomplete(&mut self, node: Node, path: &ast::Path) -> Option<Value> {
        let variable = self.example_variable(node);
        let name: Vec<&str> = path.parts.iter().map(|p| p.name.text.as_str()).collect();
        self.fault(
            Diagnostic::error(codes::N017, "an element is no number", path.span, "this is an element")
                .hint(format!("write `{}.{variable}`", name.join("."))),
        );
        None
    }

    fn inner_value(&mut self, cx: &Reading<'_>, inner: ScopeId, part: &'a ast::PathPart) -> Option<Value> {
        let name = &part.name;
        match self.flat.names.scopes[inner].values.get(name.text.as_str()) {
            Some(&value) => self.valued(cx, value, part),
            None => {
                let names = &self.flat.names;
                let owner = names.scopes[inner].prefix.trim_end_matches('.');
                let title = format!("`{owner}` has no signal `{}`", name.text);
                let d = Diagnostic::error(codes::N001, title, name.span, "not declared in the component");
                let near = nearest(&name.text, names.scopes[inner].values.keys().copied());
                self.fault(match near {
                    Some(near) => d.hint(format!("did you mean `{near}`?")),
                    None => d.hint("declare it in the component: `let name = …`"),
                });
                None
            }
        }
    }

    /// `name.e` and the like.
    fn element_variable(&mut self, part: usize, variable: &ast::Name) -> Option<Value> {
        let p = self.part(part);
        let name = variable.text.as_str();
        let slot = match (p.word, name) {
            (Word::Zero, "e") | (Word::One, "f") => {
                let symbol = self.common_variable(part, name == "e")?;
                return Some(self.symbol_value(symbol));
            }
            (w, "e" | "f") if w.is_junction() || w.is_two_port() => None,
            (_, "e" | "f") | (Word::C, "q") | (Word::I, "p") => (p.ports.len() < 2).then_some(0),
            _ => {
                self.no_such_variable(part, variable);
                return None;
            }
        };
        match slot {
            Some(slot) => self.port_variable(part, slot, name),
            None => {
                self.which_port(part, variable);
                None
            }
        }
    }

    /// A variable that an element has more than one of.
    fn which_port(&mut self, part: usize, variable: &ast::Name) {
        let p = self.part(part);
        let (short, name) = (&p.ast.name.text, &variable.text);
        let (title, hint) = match p.word {
            Word::Zero => (
                format!("a 0-junction has no common flow: the flows of `{}` differ", p.name),
                format!("ask for the flow of an element at it, or name a bond: `{short} -> x as b1`, then `b1.f`"),
            ),
            Word::One => (
                format!("a 1-junction has no common effort: the efforts of `{}` differ", p.name),
                format!("ask for the effort of an element at it, or name a bond: `{short} -> x as b1`, then `b1.e`"),
            ),
            w if w.is_two_port() => (
                format!("`{name}` of which side of `{}`?", p.name),
                format!("write `{short}.in.{name}` or `{short}.out.{name}`"),
            ),
            _ => {
                let first = &p.ports[0].text;
                (format!("`{name}` of which port of `{}`?", p.name), format!("write `{short}.{first}.{name}`"))
            }
        };
        self.fault(
            Diagnostic::error(codes::N018, title, variable.span, "which one?")
                .also(p.ast.span, "declared here")
                .hint(hint),
        );
    }

    fn no_such_variable(&mut self, part: usize, variable: &ast::Name) {
        let p = self.part(part);
        let word = p.word.text();
        let has = match p.word {
            Word::I => "e, f and p (its momentum)",
            Word::C => "e, f and q (its displacement)",
            Word::Zero => "e, common to all its bonds",
            Word::One => "f, common to all its bonds",
            w if w.is_two_port() => "in.e, in.f, out.e and out.f",
            _ => "e and f",
        };
        let title = format!("{word} `{}` has no `{}`", p.name, variable.text);
        let d = Diagnostic::error(codes::N018, title, variable.span, "not a variable of this element");
        self.fault(d.also(p.ast.span, "declared here").hint(format!("it has {has}")));
    }

    fn named_port_variable(&mut self, part: usize, port: &ast::Name, variable: &ast::Name) -> Option<Value> {
        let p = self.part(part);
        let slot = match (p.word.is_two_port(), port.text.as_str()) {
            (true, "in") => Some(0),
            (true, "out") => Some(1),
            _ => p.ports.iter().position(|n| n.text == port.text),
        };
        let Some(slot) = slot else {
            let list: Vec<&str> = p.ports.iter().map(|n| n.text.as_str()).collect();
            let title = format!("`{}` has no port `{}`", p.name, port.text);
            let d = Diagnostic::error(codes::N001, title, port.span, "not known").also(p.ast.span, "declared here");
            self.fault(if list.is_empty() { d } else { d.hint(format!("its ports are {}", list.join(", "))) });
            return None;
        };
        let fits = match variable.text.as_str() {
            "e" | "f" => true,
            "q" => p.word == Word::C,
            "p" => p.word == Word::I,
            _ => false,
        };
        if !fits {
            self.no_such_variable(part, variable);
            return None;
        }
        self.port_variable(part, slot, &variable.text)
    }

    fn pair_variable(&mut self, wire: Option<usize>, variable: &ast::Name) -> Option<Value> {
        let wire = wire?;
        match variable.text.as_str() {
            "e" => Some(self.symbol_value(self.pairs[wire].effort)),
            "f" => Some(self.symbol_value(self.pairs[wire].flow)),
            _ => {
                let title = format!("a bond has no `{}`", variable.text);
                self.fault(
                    Diagnostic::error(codes::N018, title, variable.span, "not a variable of a bond")
                        .hint("it has e and f"),
                );
                None
            }
        }
    }

    fn reaction_variable(&mut self, constraint: usize, variable: &ast::Name) -> Option<Value> {
        match variable.text.as_str() {
            "e" => Some(self.symbol_value(self.reactions[constraint].effort)),
            "f" => Some(self.symbol_value(self.reactions[constraint].flow)),
            _ => {
                let title = format!("a constraint has no `{}`", variable.text);
                let d = Diagnostic::error(codes::N018, title, variable.span, "not a variable of a constraint");
                self.fault(d.hint("it has e, its multiplier"));
                None
            }
        }
    }

    /// `x'`: the rate of an expression.
    pub fn rate(&mut self, cx: &Reading<'_>, inner: &'a ast::Expr, span: Span) -> Option<Value> {
        let value = self.number(cx, inner)?;
        self.rate_of_value(cx, &value, span)
    }

    /// The rate of a number that has been read.
    pub fn rate_of_value(&mut self, cx: &Reading<'_>, value: &Value, span: Span) -> Option<Value> {
        if cx.plain {
            self.fault(
                Diagnostic::error(codes::L004, "a function cannot differentiate in time", span, "here")
                    .hint("make it a `let` value, or give the rate as an argument"),
            );
            return None;
        }
        if self.jumps_in_time(value.expr) {
            let fault = Diagnostic::error(codes::L004, "what jumps has no rate", span, "differentiated here");
            self.fault(
                fault.hint(
                    "from one instant to the next it is another: let it change over some time, `min(t/0.1 s, 1)`",
                ),
            );
            return None;
        }
        let expr = self.rate_of(value.expr, span)?;
        Some(Value::number(expr, value.quantity.over(&Quantity::of(Dim::SECOND))))
    }

    /// The rate of an expression in time.
    pub fn rate_of(&mut self, expr: Expr, span: Span) -> Option<Expr> {
        let mut terms = Vec::new();
        for symbol in self.exprs.symbols_of(expr) {
            let slope = self.exprs.derivative(expr, symbol);
            if let Some(rate) = self.symbol_rate(symbol, span)? {
                terms.push(self.exprs.mul(&[slope, rate]));
            }
        }
        Some(self.exprs.add(&terms))
    }

    /// The rate of a symbol; the inner `None` if it is constant.
    fn symbol_rate(&mut self, symbol: Symbol, span: Span) -> Option<Option<Expr>> {
        let rate = match self.role(symbol)? {
            Role::Known(Meaning::Parameter(_)) => return Some(None),
            Role::Known(Meaning::Time) => return Some(Some(self.exprs.int(1))),
            Role::Known(Meaning::Stored(port)) => {
                let wire = self.wire_at(port.element.0 as usize, port.port as usize)?;
                match self.part(port.element.0 as usize).word {
                    Word::I => self.pairs[wire].effort,
                    _ => self.pairs[wire].flow,
                }
            }
            Role::Known(Meaning::Held(id)) if self.held[id].kind.is_discrete() => {
                let title = "a discrete variable has no rate";
                let fault = Diagnostic::error(codes::L004, title, span, "differentiated here");
                self.fault(fault.hint("it jumps at events and stays as it is between them"));
                return None;
            }
            Role::Known(Meaning::Held(_)) => {
                self.fault(
                    Diagnostic::error(
                        codes::L004,
                        "a delayed or sampled signal has no rate here",
                        span,
                        "differentiated here",
                    )
                    .hint("differentiate first, then delay or sample"),
                );
                return None;
            }
            _ => self.rate_symbol(symbol),
        };
        Some(Some(self.exprs.sym(rate)))
    }

    /// The symbol of the rate of another.
    pub fn rate_symbol(&mut self, symbol: Symbol) -> Symbol {
        if let Some(known) = self.exprs.find_made_of(SymbolKind::Rate(symbol)) {
            return known;
        }
        let rate = self.exprs.rate(symbol);
        let quantity = self.quantity(symbol).over(&Quantity::of(Dim::SECOND));
        self.mean(rate, Meaning::Rate(symbol), quantity);
        if let Some(Meaning::Signal(id)) = self.meaning(symbol) {
            self.rate_symbols.insert(rate, id);
        }
        rate
    }
}
