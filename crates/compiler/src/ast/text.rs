//! The tree as text: one line a statement, every grouping shown, places left out.

use super::tree::*;
use std::fmt::{self, Display, Formatter, Write};

/// The tree without its places: two texts that print alike mean the same.
///
/// ```
/// use halfarrow_compiler::{ast::parse, span::FileId};
/// let ast = parse("model M\nlet y = -x^2 + 3 m // rise", FileId(0)).ast;
/// assert_eq!(ast.to_string(), "model M\nlet y = ((-(x ^ 2)) + 3 <m>)\n");
/// ```
impl Display for Ast {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut out = String::new();
        if let Some(header) = &self.header {
            out += &format!("model {}", header.name.text);
            write_doc(&mut out, &header.doc);
            out.push('\n');
        }
        write_statements(&mut out, &self.statements, 0);
        f.write_str(&out)
    }
}

fn write_statements(out: &mut String, statements: &[Statement], level: usize) {
    for statement in statements {
        out.extend(std::iter::repeat_n("  ", level));
        write_statement(out, &statement.kind, level);
        out.push('\n');
    }
}

fn write_statement(out: &mut String, kind: &StatementKind, level: usize) {
    match kind {
        StatementKind::Param(list) => write_declarations(out, "param", list),
        StatementKind::Const(list) => write_declarations(out, "const", list),
        StatementKind::Input(list) => write_declarations(out, "input", list),
        StatementKind::Output(list) => write_declarations(out, "output", list),
        StatementKind::Let(list) => write_declarations(out, "let", list),
        StatementKind::Function(f) => write_function(out, f),
        StatementKind::State(s) => write_state(out, s),
        StatementKind::Import(i) if i.library => *out += &format!("import {}", i.path.text),
        StatementKind::Import(i) => *out += &format!("import {:?}", i.path.text),
        StatementKind::Component(c) => write_component(out, c, level),
        StatementKind::Prefer(paths) => {
            *out += "prefer";
            separated(out, " ", paths, write_path);
        }
        StatementKind::Causality(list) => {
            *out += "causality";
            separated(out, " ", list, |out, forced| {
                write_path(out, &forced.element);
                *out += &format!(" {:?}", forced.causality).to_lowercase();
            });
        }
        StatementKind::Stroke(s) => write_stroke(out, s),
        StatementKind::Guess(list) => write_guesses(out, list),
        StatementKind::Constraint(c) => {
            *out += &format!("constraint {}", c.name.text);
            write_indices(out, &c.indices);
            let sign = match c.sides {
                Sides::Equal => "=",
                Sides::AtLeast => ">=",
                Sides::AtMost => "<=",
            };
            *out += &format!(": {} {sign} {}", shown(&c.left), shown(&c.right));
            if !c.args.is_empty() {
                *out += " ";
                write_args(out, &c.args);
            }
            write_doc(out, &c.doc);
        }
        StatementKind::Domain(d) => {
            *out += &format!("domain {}{}", d.name.text, if d.pseudo.is_some() { " pseudo" } else { "" });
            write_doc(out, &d.doc);
            write_block(out, &d.body, level);
        }
        StatementKind::Chain(c) => write_chain(out, c),
        StatementKind::Shape(e) => {
            *out += "shape ";
            write_element(out, e);
        }
        StatementKind::PortKind(k) => {
            *out += &format!("port {} {{", k.name.text);
            for (i, (word, list)) in [("bond", &k.bonds), ("in", &k.signals)].into_iter().enumerate() {
                if !list.is_empty() {
                    *out += if i == 0 || k.bonds.is_empty() { " " } else { "; " };
                    write_declarations(out, word, list);
                }
            }
            *out += " }";
            write_doc(out, &k.doc);
        }
        StatementKind::Discrete(list) => write_declarations(out, "discrete", list),
        StatementKind::When(w) => write_when(out, w),
        StatementKind::For(l) => {
            *out += &format!("for {} in {}..{}", l.variable.text, shown(&l.from), shown(&l.to));
            write_block(out, &l.body, level);
        }
        StatementKind::Choice(c) => {
            *out += &format!("if {}", shown(&c.cond));
            write_block(out, &c.yes, level);
            if !c.no.is_empty() {
                *out += " else";
                write_block(out, &c.no, level);
            }
        }
    }
}

fn separated<T>(out: &mut String, first: &str, items: &[T], mut write: impl FnMut(&mut String, &T)) {
    for (i, item) in items.iter().enumerate() {
        *out += if i == 0 { first } else { ", " };
        write(out, item);
    }
}

fn write_doc(out: &mut String, doc: &Option<Doc>) {
    if let Some(doc) = doc {
        *out += &format!(" {:?}", doc.text);
    }
}

fn write_unit(out: &mut String, unit: &Option<UnitText>) {
    if let Some(unit) = unit {
        *out += &format!(" : <{}>", unit.text);
    }
}

fn write_block(out: &mut String, body: &[Statement], level: usize) {
    *out += " {\n";
    write_statements(out, body, level + 1);
    out.extend(std::iter::repeat_n("  ", level));
    out.push('}');
}

fn write_declarations(out: &mut String, word: &str, list: &[Declaration]) {
    *out += word;
    separated(out, " ", list, |out, d| {
        if let Some(owner) = &d.owner {
            *out += &format!("{}.", owner.text);
        }
        *out += &d.name.text;
        write_indices(out, &d.indices);
        write_unit(out, &d.unit);
        if let Some(value) = &d.value {
            *out += &format!(" = {}", shown(value));
        }
        write_doc(out, &d.doc);
    });
}

fn write_guesses(out: &mut String, list: &[Guess]) {
    *out += "guess";
    separated(out, " ", list, |out, g| {
        write_path(out, &g.what);
        write_unit(out, &g.unit);
        *out += &format!(" = {}", shown(&g.value));
        write_doc(out, &g.doc);
    });
}

fn write_function(out: &mut String, f: &Function) {
    *out += &format!("let {}(", f.name.text);
    separated(out, "", &f.params, |out, p| *out += &p.text);
    *out += &format!(") = {}", shown(&f.body));
    write_unit(out, &f.unit);
    write_doc(out, &f.doc);
}

fn write_state(out: &mut String, s: &State) {
    *out += &format!("state {}", s.name.text);
    write_indices(out, &s.indices);
    *out += &format!("' = {}", shown(&s.rate));
    if let Some(start) = &s.start {
        *out += &format!(" from {}", shown(start));
    }
    write_unit(out, &s.unit);
    write_doc(out, &s.doc);
}

fn write_component(out: &mut String, c: &Component, level: usize) {
    *out += &format!("component {}(", c.name.text);
    let groups = [("param", &c.params), ("const", &c.consts), ("port", &c.ports), ("in", &c.ins), ("out", &c.outs)];
    let groups: Vec<_> = groups.into_iter().filter(|(_, list)| !list.is_empty()).collect();
    for (i, (word, list)) in groups.iter().enumerate() {
        *out += if i == 0 { "" } else { "; " };
        write_declarations(out, word, list);
    }
    out.push(')');
    write_doc(out, &c.doc);
    write_block(out, &c.body, level);
}

fn write_stroke(out: &mut String, s: &ForcedStroke) {
    *out += "stroke ";
    match &s.bond {
        StrokeBond::Between(from, to) => {
            write_path(out, from);
            *out += " -> ";
            write_path(out, to);
        }
        StrokeBond::Named(name) => write_part(out, name),
    }
    *out += " at ";
    write_path(out, &s.at);
}

fn write_chain(out: &mut String, c: &Chain) {
    write_node(out, &c.first);
    for bond in &c.bonds {
        *out += " -> ";
        write_node(out, &bond.to);
        if let Some(name) = &bond.name {
            *out += " as ";
            write_part(out, name);
        }
        write_doc(out, &bond.doc);
    }
}

fn write_node(out: &mut String, node: &Node) {
    match node {
        Node::Declared(element) => write_element(out, element),
        Node::Named(path) => write_path(out, path),
        Node::Joined(nodes, _) => {
            out.push('[');
            separated(out, "", nodes, write_node);
            out.push(']');
        }
        Node::Missing(_) => *out += "<missing>",
    }
}

fn write_element(out: &mut String, e: &Element) {
    *out += &e.kind.text;
    write_indices(out, &e.widths);
    *out += &format!(":{}", e.name.text);
    write_indices(out, &e.indices);
    if !e.ports.is_empty() {
        out.push('[');
        separated(out, "", &e.ports, |out, p| *out += &p.text);
        out.push(']');
    }
    if !e.args.is_empty() {
        write_args(out, &e.args);
    }
    write_doc(out, &e.doc);
}

fn write_args(out: &mut String, args: &[Arg]) {
    out.push('(');
    separated(out, "", args, |out, arg| {
        if let Some(label) = &arg.label {
            *out += &label.name.text;
            if let Some(port) = &label.port {
                *out += &format!(".{}", port.text);
            }
            *out += " = ";
        }
        write_expr(out, &arg.value);
    });
    out.push(')');
}

fn write_path(out: &mut String, path: &Path) {
    for (i, part) in path.parts.iter().enumerate() {
        *out += if i == 0 { "" } else { "." };
        write_part(out, part);
    }
}

fn write_part(out: &mut String, part: &PathPart) {
    *out += &part.name.text;
    write_indices(out, &part.indices);
}

fn write_indices(out: &mut String, indices: &[Expr]) {
    if !indices.is_empty() {
        out.push('[');
        separated(out, "", indices, write_expr);
        out.push(']');
    }
}

fn write_when(out: &mut String, w: &When) {
    let every = if matches!(w.trigger, Trigger::Every(_)) { "every " } else { "" };
    *out += &format!("when {every}{} {{", shown(w.trigger.expr()));
    separated(out, " ", &w.actions, |out, a| {
        *out += if a.reset { "reset " } else { "" };
        write_path(out, &a.target);
        *out += &format!(" = {}", shown(&a.value));
    });
    *out += " }";
}

fn shown(expr: &Expr) -> String {
    let mut out = String::new();
    write_expr(&mut out, expr);
    out
}

fn write_expr(out: &mut String, expr: &Expr) {
    match &expr.kind {
        ExprKind::Number(n) => {
            *out += &n.text;
            if let Some(unit) = &n.unit {
                *out += &format!(" <{}>", unit.text);
            }
        }
        ExprKind::Text(text) => write!(out, "{text:?}").expect("a string takes any text"),
        ExprKind::Path(path) => write_path(out, path),
        ExprKind::Rate(inner) => {
            write_expr(out, inner);
            out.push('\'');
        }
        ExprKind::Call(call) => {
            *out += &call.function.text;
            write_args(out, &call.args);
        }
        ExprKind::List(items) => {
            out.push('[');
            separated(out, "", items, write_expr);
            out.push(']');
        }
        ExprKind::Repeated(r) => {
            *out += &format!("[{} for {} in {}..{}]", shown(&r.value), r.variable.text, shown(&r.from), shown(&r.to));
        }
        ExprKind::Sum(r) => {
            *out += &format!("sum({} in {}..{}, ", r.variable.text, shown(&r.from), shown(&r.to));
            write_expr(out, &r.value);
            out.push(')');
        }
        ExprKind::Unary(unary) => {
            *out += if unary.op == UnaryOp::Neg { "(-" } else { "(not " };
            write_expr(out, &unary.operand);
            out.push(')');
        }
        ExprKind::Binary(binary) => {
            out.push('(');
            write_expr(out, &binary.left);
            *out += &format!(" {} ", binary.op.symbol());
            write_expr(out, &binary.right);
            out.push(')');
        }
        ExprKind::If(choice) => {
            *out += "(if ";
            write_expr(out, &choice.cond);
            *out += " then ";
            write_expr(out, &choice.yes);
            *out += " else ";
            write_expr(out, &choice.no);
            out.push(')');
        }
        ExprKind::Missing => *out += "<missing>",
    }
}

impl BinaryOp {
    /// The operator as it is written.
    pub fn symbol(self) -> &'static str {
        match self {
            BinaryOp::Or => "or",
            BinaryOp::And => "and",
            BinaryOp::Lt => "<",
            BinaryOp::Le => "<=",
            BinaryOp::Gt => ">",
            BinaryOp::Ge => ">=",
            BinaryOp::Eq => "==",
            BinaryOp::Ne => "!=",
            BinaryOp::Add => "+",
            BinaryOp::Sub => "-",
            BinaryOp::Mul => "*",
            BinaryOp::Div => "/",
            BinaryOp::Pow => "^",
        }
    }
}
