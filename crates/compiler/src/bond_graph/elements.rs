//! Elements with their laws.

use super::builder::{Builder, Value};
use super::constraint::HeldDisplacement;
use super::dimension::Quantity;
use super::flatten::{Part, Word};
use super::multibonds::{Width, strand_name};
use super::set_valued::is_set_valued;
use super::value::Reading;
use super::{Initial, Kind, Matrix, ResistorLaw, Storage, StorageLaw};
use crate::algebra::{Expr, Symbol, ZERO};
use crate::ast::{self, Arg, ArgLabel, ExprKind};
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;
use crate::unit::{Dimension as Dim, Domain};

/// A law of one port as written: which variable it gives (`0` for none), and the expression.
#[derive(Clone, Copy)]
struct LawArg<'a> {
    gives: char,
    value: &'a ast::Expr,
    span: Span,
}

/// The arguments of an `I`, `C` or `R`, sorted.
struct LawArgs<'a> {
    /// Laws of every port.
    laws: Vec<Vec<LawArg<'a>>>,
    /// `m l c k r g`, or the positional value under the letter that it stands for; whether it was positional.
    coefficient: Option<(&'static str, &'a Arg, bool)>,
    energy: Option<&'a Arg>,
    starts: Vec<(char, usize, &'a Arg)>,
}

/// What is read of the law of one port.
#[derive(Clone, Copy)]
struct PortLaw {
    gives: char,
    expr: Expr,
    span: Span,
}

impl<'a> Builder<'a, '_> {
    /// The kind and law of a part; `None` if it is at fault, which has been said.
    pub fn kind(&mut self, part: usize) -> Option<Kind> {
        let before = self.faults.len();
        self.now = self.part(part).here;
        let kind = self.kind_of(part);
        self.met_in(self.part(part).here, before);
        kind
    }

    fn kind_of(&mut self, part: usize) -> Option<Kind> {
        let p = self.part(part);
        match p.word {
            Word::Zero | Word::One | Word::De | Word::Df => self.plain(part),
            Word::Se => self.effort_source(part),
            Word::Sf => self.only_value(part, "f", true).map(|value| Kind::FlowSource { value }),
            Word::Zc => self.zero_compliance(part),
            Word::ResidualSe => self.residual(part).map(|residual| Kind::ResidualEffort { residual }),
            Word::ResidualSf => self.residual(part).map(|residual| Kind::ResidualFlow { residual }),
            Word::Tf if matches!(p.width, Width::Matrix { .. }) => {
                self.matrix_modulus(part, &["m", "f_out"]).map(|matrix| Kind::MatrixTransformer(Box::new(matrix)))
            }
            Word::Gy if matches!(p.width, Width::Matrix { .. }) => {
                self.matrix_modulus(part, &["r", "e_out"]).map(|matrix| Kind::MatrixGyrator(Box::new(matrix)))
            }
            Word::Skew => self.skew_gyrator(part).map(Kind::SkewGyrator),
            Word::Tf => self.modulus(part, ["m", "f_out", "e_out"]).map(|modulus| Kind::Transformer { modulus }),
            Word::Gy => self.modulus(part, ["r", "e_out", "f_out"]).map(|modulus| Kind::Gyrator { modulus }),
            Word::I => self.storage(part).map(|storage| Kind::Inertance(Box::new(storage))),
            Word::C => self.storage(part).map(|storage| Kind::Compliance(Box::new(storage))),
            Word::R if is_set_valued(&p.ast.args) => self.set_valued_resistor(part),
            Word::R => self.resistor(part).map(Kind::Resistor),
            Word::Sw => self.switch(part),
        }
    }

    /// The law of a part as written, for drawings.
    pub fn label(&self, part: usize) -> String {
        let p = self.part(part);
        let beside = |a: &&Arg| a.label.as_ref().is_some_and(|l| is_start(&l.name.text)) || is_carried(a);
        let args = p.ast.args.iter().filter(|a| !beside(a));
        args.map(|a| self.sources.slice(a.span)).collect::<Vec<_>>().join(", ")
    }

    fn plain(&mut self, part: usize) -> Option<Kind> {
        let p = self.part(part);
        self.refuse_ports(p);
        if let Some(arg) = p.ast.args.first() {
            let title = format!("{} takes no argument", what(p));
            self.fault(Diagnostic::error(codes::N007, title, arg.span, "not needed").hint("remove it"));
            return None;
        }
        Some(match p.word {
            Word::Zero => Kind::Zero,
            Word::One => Kind::One,
            Word::De => Kind::EffortDetector,
            _ => Kind::FlowDetector,
        })
    }

    fn refuse_ports(&mut self, p: &Part<'_>) {
        if let Some(port) = p.ports.first().filter(|_| p.width == Width::One) {
            let title = format!("only I, C and R have a list of ports, not {}", p.word.text());
            self.fault(Diagnostic::error(codes::N007, title, port.span, "no list here"));
        }
    }

    /// Reads an argument of a part.
    fn arg(&mut self, part: usize, e: &'a ast::Expr, law: bool) -> Option<Value> {
        let p = self.part(part);
        let cx = Reading { own: Some(part), law, ..Reading::of(p.here, &p.name) };
        match p.width {
            Width::Strand(at, of) => self.strand_of(&cx, e, at, of),
            _ => self.number(&cx, e),
        }
    }

    /// Reads what is given for one port of an element: of a wide one, the entry of a vector, or a number for all.
    fn arg_at(&mut self, part: usize, e: &'a ast::Expr, slot: usize, law: bool) -> Option<Value> {
        let p = self.part(part);
        match p.width {
            Width::Field(of) => {
                let cx = Reading { own: Some(part), law, ..Reading::of(p.here, &p.name) };
                self.strand_of(&cx, e, slot, of)
            }
            _ => self.arg(part, e, law),
        }
    }

    /// The single argument of a part, positional or under one of its names.
    fn single(&mut self, part: usize, names: &[&str]) -> Result<Option<&'a Arg>, ()> {
        let p = self.part(part);
        self.refuse_ports(p);
        let mut found: Option<&'a Arg> = None;
        let mut failed = false;
        for arg in &p.ast.args {
            if p.word == Word::Se && is_carried(arg) {
                continue;
            }
            let fits = arg.label.as_ref().is_none_or(|l| l.port.is_none() && names.contains(&l.name.text.as_str()));
            if !fits {
                self.unknown_label(p, arg.label.as_ref(), names);
                failed = true;
            } else if let Some(first) = found {
                let title = format!("{} takes one value", what(p));
                let d = Diagnostic::error(codes::N007, title, arg.span, "one too many").also(first.span, "the first");
                self.fault(d.hint("remove one of them"));
                failed = true;
            } else {
                found = Some(arg);
            }
        }
        if failed { Err(()) } else { Ok(found) }
    }

    fn unknown_label(&mut self, p: &Part<'_>, label: Option<&ArgLabel>, names: &[&str]) {
        let Some(label) = label else { return };
        let name = self.sources.slice(label.span);
        let title = format!("{} takes no `{name}`", what(p));
        let d = Diagnostic::error(codes::N008, title, label.span, "not known here");
        if is_start(&label.name.text) {
            return self.fault(
                Diagnostic { code: codes::I001, ..d }
                    .note("start values belong to what stores energy: q0 and e0, f0 at a C, p0, f0 and e0 at an I"),
            );
        }
        self.fault(match (nearest(&label.name.text, names.iter().copied()), names.is_empty()) {
            (Some(near), _) if label.name.text.len() > 1 => d.hint(format!("did you mean `{near}`?")),
            (_, true) => d.hint("remove it"),
            _ => d.hint(format!("it takes: {}", names.join(", "))),
        });
    }

    /// The value of a source or `ZC`.
    fn only_value(&mut self, part: usize, gives: &str, needed: bool) -> Option<Expr> {
        let p = self.part(part);
        let Some(arg) = self.single(part, &[gives]).ok()? else {
            if needed {
                let (name, word) = (&p.ast.name.text, p.word.text());
                let title = format!("{word} `{}` has no value", p.name);
                let hint = format!("write `{}:{name}( … )`, the {} that it gives", p.ast.kind.text, variable(gives));
                self.fault(Diagnostic::error(codes::N009, title, p.ast.span, "what does it give?").hint(hint));
                return None;
            }
            return Some(self.exprs.int(0));
        };
        let value = self.arg(part, &arg.value, false)?;
        let wire = self.wire_at(part, 0)?;
        let quantity = if gives == "e" { &self.pairs[wire].effort_in } else { &self.pairs[wire].flow_in };
        self.equal_by_law(&value.quantity, &quantity.clone(), part);
        Some(value.expr)
    }

    /// A source of effort, and what it carries beside.
    fn effort_source(&mut self, part: usize) -> Option<Kind> {
        let value = self.only_value(part, "e", true)?;
        let mut carried = self.part(part).ast.args.iter().filter(|arg| is_carried(arg));
        if let Some(arg) = carried.next() {
            if let Some(second) = carried.next() {
                let title = format!("{} carries one effort", what(self.part(part)));
                let d = Diagnostic::error(codes::N007, title, second.span, "one too many").also(arg.span, "the first");
                self.fault(d.hint("add them, `carries = a + b`"));
                return None;
            }
            let effort = self.arg(part, &arg.value, false)?;
            let wire = self.wire_at(part, 0)?;
            let quantity = self.pairs[wire].effort_in.clone();
            self.equal_by_law(&effort.quantity, &quantity, part);
            let multipliers: Vec<Symbol> = self.reactions.iter().map(|r| r.effort).collect();
            if !self.exprs.linear_in(effort.expr, &multipliers).is_some_and(|(_, rest)| self.exprs.is_zero(rest)) {
                let title = format!("what {} carries is no share of a constraint", what(self.part(part)));
                let d = Diagnostic::error(codes::N007, title, arg.value.span, "it is told beside the equations");
                let hint = "write a sum of multipliers with their factors, as in `carries = 2*pin.e`; an effort that acts is \
                            the value of the source";
                self.fault(d.hint(hint));
                return None;
            }
            self.carried.insert(part, effort.expr);
        }
        Some(Kind::EffortSource { value })
    }

    /// A zero compliance: what its flow is held at, or the displacement that it holds at zero, whose rate its flow is.
    fn zero_compliance(&mut self, part: usize) -> Option<Kind> {
        let known = self.part(part).ast.args.iter().find(|a| a.label.as_ref().is_some_and(|l| l.name.text == "q"));
        let Some(known) = known else {
            return self.only_value(part, "f", false).map(|flow| Kind::ZeroCompliance { flow });
        };
        self.single(part, &["f", "q"]).ok()?;
        let value = self.arg(part, &known.value, false)?;
        let rate = self.pairs[self.wire_at(part, 0)?].flow_in.clone();
        self.equal_by_law(&value.quantity, &rate.times(&Quantity::of(Dim::SECOND)), part);
        self.held_displacements.push(HeldDisplacement { part, expr: value.expr, span: known.value.span });
        Some(Kind::ZeroCompliance { flow: ZERO })
    }

    #[allow(clippy::option_option)]
    fn residual(&mut self, part: usize) -> Option<Option<Expr>> {
        match self.single(part, &["0"]).ok()? {
            None => Some(None),
            Some(arg) => self.arg(part, &arg.value, true).map(|v| Some(v.expr)),
        }
    }

    /// The modulus of a two-port: given by its letter, as the factor from in to out of the variable that it is the
    /// factor of, or as that of the other variable, whose inverse it is.
    fn modulus(&mut self, part: usize, [letter, direct, inverse]: [&'static str; 3]) -> Option<Expr> {
        let p = self.part(part);
        let Some(arg) = self.single(part, &[letter, direct, inverse]).ok()? else {
            let title = format!("{} `{}` has no modulus", p.word.text(), p.name);
            let law =
                if p.word == Word::Tf { "e_in = m e_out, f_out = m f_in" } else { "e_in = r f_out, e_out = r f_in" };
            let d = Diagnostic::error(codes::N009, title, p.ast.span, "which ratio?");
            self.fault(d.note(law).hint(format!("write `{}:{}( … )`", p.ast.kind.text, p.ast.name.text)));
            return None;
        };
        let mut value = self.arg(part, &arg.value, false)?;
        if arg.label.as_ref().is_some_and(|label| label.name.text == inverse) {
            let one = Value::number(self.exprs.int(1), Quantity::NONE);
            value = self.quotient(&one, &value, arg.value.span)?;
        }
        self.moduli.insert(part, value.quantity.clone());
        let (inner, outer) = (self.wire_at(part, 0)?, self.wire_at(part, 1)?);
        let (a, b) = (self.pairs[inner].clone(), self.pairs[outer].clone());
        let (first, second) = match p.word {
            Word::Tf => ((&a.effort_in, &b.effort_in), (&b.flow_in, &a.flow_in)),
            _ => ((&a.effort_in, &b.flow_in), (&b.effort_in, &a.flow_in)),
        };
        self.equal_by_law(&first.0.over(first.1), &value.quantity, part);
        if self.pseudo[inner] || self.pseudo[outer] {
            self.equal_by_law(&second.0.over(second.1), &value.quantity, part);
        }
        Some(value.expr)
    }

    /// The matrix of a wide two-port; a number stands for its multiple of the unit matrix.
    fn matrix_modulus(&mut self, part: usize, names: &[&'static str]) -> Option<Matrix> {
        let p = self.part(part);
        let Width::Matrix { rows, columns } = p.width else { return None };
        let Some(arg) = self.single(part, names).ok()? else {
            let title = format!("{} `{}` has no matrix", p.word.text(), p.name);
            let law = match p.word {
                Word::Tf => "f_out = M f_in, e_in = Mᵀ e_out",
                _ => "e_out = M f_in, e_in = Mᵀ f_out",
            };
            let d = Diagnostic::error(codes::N009, title, p.ast.span, "which ratios?").note(law);
            self.fault(d.hint(format!("write `{}[{rows}, {columns}]:{}( … )`", p.ast.kind.text, p.ast.name.text)));
            return None;
        };
        let values = self.square_or_not(part, &arg.value, (rows, columns), true)?;
        for (row, entries) in values.chunks(columns).enumerate() {
            for (column, value) in entries.iter().enumerate().filter(|(_, v)| v.expr != ZERO) {
                let (input, output) = (self.wire_at(part, column)?, self.wire_at(part, columns + row)?);
                let (a, b) = (self.pairs[input].clone(), self.pairs[output].clone());
                let ratio = match p.word {
                    Word::Tf => b.flow_in.over(&a.flow_in),
                    _ => b.effort_in.over(&a.flow_in),
                };
                self.equal_by_law(&ratio, &value.quantity, part);
            }
        }
        Some(Matrix { rows, columns, entries: values.into_iter().map(|v| v.expr).collect() })
    }

    /// The entries of a matrix of this shape, row by row. What is a number stands for its multiple of the unit matrix, a
    /// vector for a diagonal, where those may be.
    fn square_or_not(
        &mut self,
        part: usize,
        e: &'a ast::Expr,
        (rows, columns): (usize, usize),
        law: bool,
    ) -> Option<Vec<Value>> {
        let p = self.part(part);
        let cx = Reading { own: Some(part), law: law && !p.word.is_two_port(), ..Reading::of(p.here, &p.name) };
        let found = self.shaped(&cx, e)?;
        let zero = Value::number(ZERO, Quantity::Any);
        let diagonal = |entry: &dyn Fn(usize) -> Value| -> Vec<Value> {
            let entry_at = |at: usize| if at / columns == at % columns { entry(at / columns) } else { zero.clone() };
            (0..rows * columns).map(entry_at).collect()
        };
        match found.shape.as_slice() {
            [r, c] if (*r, *c) == (rows, columns) => Some(found.items),
            [] if rows == columns => Some(diagonal(&|_| found.items[0].clone())),
            [n] if rows == columns && *n == rows => Some(diagonal(&|at| found.items[at].clone())),
            [n] if (columns == 1 && *n == rows) || (rows == 1 && *n == columns) => Some(found.items),
            _ => {
                let title = format!("{} needs a matrix of {rows} by {columns}, not {}", what(p), found.words());
                let d = Diagnostic::error(codes::L009, title, e.span, found.words());
                let d = match p.word {
                    Word::Tf => {
                        d.note("f_out = M f_in: it has a row for each bond at `out`, a column for each at `in`")
                    }
                    Word::Gy => {
                        d.note("e_out = M f_in: it has a row for each bond at `out`, a column for each at `in`")
                    }
                    _ => d,
                };
                let turned = found.shape == [columns, rows];
                self.fault(if turned { d.hint("write `transpose( … )`") } else { d });
                None
            }
        }
    }

    /// A gyrator of one side: its matrix is skew.
    fn skew_gyrator(&mut self, part: usize) -> Option<Vec<ResistorLaw>> {
        let p = self.part(part);
        let Width::Field(n) = p.width else { return None };
        let args: Vec<&'a Arg> = p.ast.args.iter().collect();
        let [arg] = args.as_slice() else {
            let title = format!("{} of one side takes a skew matrix", what(p));
            let d = Diagnostic::error(codes::N009, title, p.ast.span, "which one?").note("e = Sᵀ f");
            self.fault(d.hint(format!(
                "write `GY[{n}]:{}(skew(body.p))`; one between two sides is `GY[{n}, {n}]`",
                p.ast.name.text
            )));
            return None;
        };
        if let Some(label) = arg.label.as_ref().filter(|l| l.name.text != "r" || l.port.is_some()) {
            self.unknown_label(p, Some(label), &["r"]);
            return None;
        }
        let values = self.square_or_not(part, &arg.value, (n, n), false)?;
        let symbols: Option<Vec<Symbol>> =
            (0..n).map(|port| self.wire_at(part, port).map(|w| self.pairs[w].flow)).collect();
        let symbols = symbols?;
        let mut laws = Vec::with_capacity(n);
        for i in 0..n {
            let mut terms = Vec::new();
            for j in 0..n {
                let (below, above) = (values[j * n + i].expr, values[i * n + j].expr);
                let sum = self.exprs.add(&[below, above]);
                if !self.exprs.is_zero(sum) {
                    return self.not_skew(part, arg, (i, j));
                }
                if below != ZERO {
                    let (row, column) = (self.wire_at(part, i)?, self.wire_at(part, j)?);
                    let ratio = self.pairs[row].effort_in.over(&self.pairs[column].flow_in);
                    self.equal_by_law(&ratio, &values[j * n + i].quantity.clone(), part);
                    let flow = self.exprs.sym(symbols[j]);
                    terms.push(self.exprs.mul(&[below, flow]));
                }
            }
            laws.push(ResistorLaw::Resistive(self.exprs.add(&terms)));
        }
        Some(laws)
    }

    fn not_skew<T>(&mut self, part: usize, arg: &Arg, (i, j): (usize, usize)) -> Option<T> {
        let title = format!("the matrix of {} is not skew", what(self.part(part)));
        let (i, j) = (i + 1, j + 1);
        let label = match i == j {
            true => format!("its entry {i}, {i} is not zero"),
            false => format!("its entries {i}, {j} and {j}, {i} are not opposite"),
        };
        let d = Diagnostic::error(codes::L009, title, arg.value.span, label);
        let d = d.note("a gyrator of one side neither takes nor gives power: its matrix is opposite to its transpose");
        self.fault(
            d.hint("write `skew(h)` of a vector h; what dissipates is an R, what is between two sides a `GY[n, m]`"),
        );
        None
    }

    /// The coefficients of a wide `I`, `C` or `R`: a number or a vector stands for a diagonal.
    fn wide_coefficients(&mut self, part: usize, arg: &'a Arg, of: usize) -> Option<Vec<Vec<Value>>> {
        let values = self.square_or_not(part, &arg.value, (of, of), false)?;
        Some(values.chunks(of).map(<[Value]>::to_vec).collect())
    }

    /// Sorts the arguments of an `I`, `C` or `R`.
    fn law_args(&mut self, part: usize) -> Option<LawArgs<'a>> {
        let p = self.part(part);
        let ports = p.ports.len().max(1);
        let mut args = LawArgs { laws: vec![Vec::new(); ports], coefficient: None, energy: None, starts: Vec::new() };
        let mut fine = self.ports_are_distinct(p);
        for arg in &p.ast.args {
            fine &= self.sort_arg(p, arg, &mut args);
        }
        fine.then_some(args)
    }

    /// Says which name is given to two ports.
    fn ports_are_distinct(&mut self, p: &Part<'_>) -> bool {
        let ports = &p.ports;
        let twice = (1..ports.len()).find_map(|i| Some((i, ports[..i].iter().position(|q| q.text == ports[i].text)?)));
        let Some((again, first)) = twice else { return true };
        let title = format!("two ports of `{}` have the name `{}`", p.name, ports[again].text);
        let d = Diagnostic::error(codes::N002, title, ports[again].span, "again");
        self.fault(d.also(ports[first].span, "the first").hint("give each port a name of its own"));
        false
    }

    fn sort_arg(&mut self, p: &Part<'_>, arg: &'a Arg, args: &mut LawArgs<'a>) -> bool {
        let (coefficients, gives): (&[&'static str], &str) = match p.word {
            Word::I => (&["m", "l"], "fp"),
            Word::C => (&["c", "k"], "eq"),
            _ => (&["r", "g"], "ef"),
        };
        let Some(label) = &arg.label else { return self.set_coefficient(p, coefficients[0], arg, true, args) };
        let name = label.name.text.as_str();
        if let Some(letter) = coefficients.iter().find(|c| **c == name)
            && label.port.is_none()
        {
            return self.set_coefficient(p, letter, arg, false, args);
        }
        if name == "energy" && p.word != Word::R && label.port.is_none() {
            args.energy = Some(arg);
            return true;
        }
        let (letter, mut fine) = (name.chars().next().unwrap_or(' '), false);
        if p.word != Word::R && is_start(name) {
            return self.sort_start(p, letter, label, arg, args);
        }
        if name.len() == 1 && (gives.contains(letter) || letter == '0') {
            for slot in self.slots_of(p, label, letter == '0', args) {
                args.laws[slot].push(LawArg { gives: letter, value: &arg.value, span: arg.span });
                fine = true;
            }
            return fine;
        }
        self.odd_label(p, label, coefficients, gives);
        false
    }

    fn set_coefficient(
        &mut self,
        p: &Part<'_>,
        letter: &'static str,
        arg: &'a Arg,
        bare: bool,
        args: &mut LawArgs<'a>,
    ) -> bool {
        if let Some((_, first, _)) = args.coefficient {
            let title = format!("{} takes one value", what(p));
            let d = Diagnostic::error(codes::L002, title, arg.span, "one too many").also(first.span, "the first");
            self.fault(d.hint("remove one of them"));
            return false;
        }
        args.coefficient = Some((letter, arg, bare));
        true
    }

    fn sort_start(
        &mut self,
        p: &Part<'_>,
        letter: char,
        label: &ArgLabel,
        arg: &'a Arg,
        args: &mut LawArgs<'a>,
    ) -> bool {
        let wrong = matches!((p.word, letter), (Word::I, 'q') | (Word::C, 'p'));
        if wrong {
            let (has, stores) = if p.word == Word::I { ("p0", "momentum p") } else { ("q0", "displacement q") };
            let title = format!("{} `{}` has no `{}`", p.word.text(), p.name, label.name.text);
            let d = Diagnostic::error(
                codes::I001,
                title,
                label.span,
                format!("{} stores its {stores}", p.word.with_article()),
            );
            self.fault(d.hint(format!("give `{has}`, `e0` or `f0`")));
            return false;
        }
        let slots = self.slots_of(p, label, false, args);
        for &slot in &slots {
            if let Some((_, _, first)) = args.starts.iter().find(|(l, s, _)| *l == letter && *s == slot) {
                let title = format!("`{}` is given twice", label.name.text);
                let d = Diagnostic::error(codes::I002, title, arg.span, "again");
                self.fault(d.also(first.span, "given first").hint("remove one of them"));
                return false;
            }
            args.starts.push((letter, slot, arg));
        }
        !slots.is_empty()
    }

    /// The ports that a label speaks of: all of a wide element, where it names none.
    fn slots_of(&mut self, p: &Part<'_>, label: &ArgLabel, free: bool, args: &LawArgs<'_>) -> Vec<usize> {
        match (p.width, &label.port) {
            (Width::Field(of), None) => (0..of).collect(),
            _ => self.slot(p, label, free, args).into_iter().collect(),
        }
    }

    /// The port that a label speaks of.
    fn slot(&mut self, p: &Part<'_>, label: &ArgLabel, free: bool, args: &LawArgs<'_>) -> Option<usize> {
        let list = || p.ports.iter().map(|n| n.text.as_str()).collect::<Vec<_>>().join(", ");
        match (&label.port, p.ports.len()) {
            (None, 0 | 1) => Some(0),
            (None, _) if free => args.laws.iter().position(Vec::is_empty).or(Some(0)),
            (None, _) => {
                let (name, first) = (&label.name.text, &p.ports[0].text);
                let d = Diagnostic::error(
                    codes::B009,
                    format!("`{name}` of which port?"),
                    label.span,
                    "the element has several",
                );
                self.fault(d.note(format!("its ports are {}", list())).hint(format!("write `{name}.{first} = …`")));
                None
            }
            (Some(port), _) => {
                let found = p.ports.iter().position(|n| n.text == port.text);
                if found.is_none() {
                    let title = format!("`{}` has no port `{}`", p.name, port.text);
                    let d = Diagnostic::error(codes::N001, title, port.span, "not known");
                    let hint = if p.ports.is_empty() {
                        format!("list its ports: `{}:{}[{}, …]`", p.word.text(), p.ast.name.text, port.text)
                    } else {
                        format!("its ports are {}", list())
                    };
                    self.fault(d.hint(hint));
                }
                found
            }
        }
    }

    fn odd_label(&mut self, p: &Part<'_>, label: &ArgLabel, coefficients: &[&str], gives: &str) {
        let name = label.name.text.as_str();
        let reason = match (p.word, name) {
            (Word::C, "f") => Some("the flow of a C is the rate of its displacement; its law is between e and q"),
            (Word::C, "p") => Some("a C stores its displacement q; momenta belong to I"),
            (Word::I, "e") => Some("the effort of an I is the rate of its momentum; its law is between f and p"),
            (Word::I, "q") => Some("an I stores its momentum p; displacements belong to C"),
            (Word::R, "q" | "p") => Some("an R stores nothing; its law is between e and f"),
            (Word::C, "r" | "g") | (Word::I, "r" | "g") => Some("resistance belongs to R"),
            (Word::R, "k" | "c") => Some("stiffness and compliance belong to C"),
            _ => None,
        };
        let Some(reason) = reason else {
            let mut names: Vec<&str> = coefficients.to_vec();
            let letters: Vec<String> = gives.chars().map(String::from).collect();
            names.extend(letters.iter().map(String::as_str));
            names.push("0");
            if p.word != Word::R {
                names.extend(["energy", "e0", "f0", if p.word == Word::I { "p0" } else { "q0" }]);
            }
            return self.unknown_label(p, Some(label), &names);
        };
        let title = format!("{} takes no `{name}`", what(p));
        self.fault(Diagnostic::error(codes::L003, title, label.span, "not a law of this element").hint(reason));
    }

    fn storage(&mut self, part: usize) -> Option<Storage> {
        let p = self.part(part);
        let args = self.law_args(part)?;
        let ports = args.laws.len();
        let energy = match args.energy {
            Some(arg) => Some(self.energy(part, arg)?),
            None => None,
        };
        let matrix = self.coefficients(part, &args)?;
        let mut laws = Vec::new();
        for slot in 0..ports {
            let given = self.port_laws(part, slot, &args.laws[slot]);
            laws.push(given.and_then(|given| self.storage_law(part, slot, &given, &args, matrix.as_ref(), energy)));
        }
        let initial = self.start_values(part, &args.starts);
        let laws = laws.into_iter().collect::<Option<Vec<_>>>()?;
        if args.energy.is_some() && args.coefficient.is_some() {
            self.two_laws(p, args.energy?.span, args.coefficient?.1.span);
            return None;
        }
        Some(Storage { laws, stored: self.stored[part].clone(), initial: initial?, energy })
    }

    fn energy(&mut self, part: usize, arg: &'a Arg) -> Option<Expr> {
        let value = self.arg(part, &arg.value, true)?;
        let wire = self.wire_at(part, 0)?;
        if !self.pseudo[wire] {
            self.equal(&value.quantity, &Quantity::of(Dim::JOULE), arg.span, "this and an energy");
        }
        let ports = self.wiring.ports[part].len();
        for port in 0..ports {
            let wire = self.wire_at(part, port)?;
            for (symbol, name) in [(self.pairs[wire].effort, "effort"), (self.pairs[wire].flow, "flow")] {
                if self.exprs.depends_on(value.expr, symbol) {
                    let own = if self.part(part).word == Word::I { "p" } else { "q" };
                    let d = Diagnostic::error(
                        codes::L004,
                        "an energy that reads an effort or flow",
                        arg.span,
                        format!("reads its own {name}"),
                    );
                    self.fault(d.hint(format!("write it in terms of {own}, what the element stores")));
                    return None;
                }
            }
        }
        Some(value.expr)
    }

    /// The laws that are written for one port.
    fn port_laws(&mut self, part: usize, slot: usize, given: &[LawArg<'a>]) -> Option<Vec<PortLaw>> {
        let mut laws = Vec::new();
        for law in given {
            let value = self.arg_at(part, law.value, slot, true)?;
            if law.gives != '0' {
                let own = self.port_variable(part, slot, law.gives.encode_utf8(&mut [0; 4]))?;
                self.equal(&value.quantity, &own.quantity, law.span, "the two sides of this law");
            }
            laws.push(PortLaw { gives: law.gives, expr: value.expr, span: law.span });
        }
        Some(laws)
    }

    fn storage_law(
        &mut self,
        part: usize,
        slot: usize,
        given: &[PortLaw],
        args: &LawArgs<'a>,
        matrix: Option<&Coefficients>,
        energy: Option<Expr>,
    ) -> Option<StorageLaw> {
        let p = self.part(part);
        let (z, x, rate) = self.storage_variables(part, slot)?;
        let (zs, xs) = (self.exprs.sym(z), self.exprs.sym(x));
        for law in given {
            self.refuse_rate(part, law, rate)?;
        }
        let co_energy = if p.word == Word::I { 'f' } else { 'e' };
        let from_matrix = matrix.map(|m| m.law(self, part, slot)).transpose_fault()?;
        match (given, from_matrix) {
            ([], Some(law)) => Some(law),
            ([], None) => match energy {
                Some(energy) => Some(StorageLaw::Integral(self.exprs.derivative(energy, x))),
                None => self.no_law(part, slot),
            },
            ([law], None) if law.gives == '0' => Some(StorageLaw::Implicit(law.expr)),
            ([law], None) if law.gives == co_energy => Some(match self.exprs.depends_on(law.expr, z) {
                true => StorageLaw::Implicit(self.exprs.sub(zs, law.expr)),
                false => StorageLaw::Integral(law.expr),
            }),
            ([law], None) => self.stored_law(part, law, xs, x),
            ([law], Some(StorageLaw::Integral(inner))) if law.gives == 'q' => self.known(part, law, z, inner),
            ([a, b], None) if p.word == Word::C && (a.gives, b.gives) == ('e', 'q') => self.known(part, b, z, a.expr),
            ([a, b], None) if p.word == Word::C && (a.gives, b.gives) == ('q', 'e') => self.known(part, a, z, b.expr),
            ([first, .., last], _) => {
                self.two_laws(p, last.span, first.span);
                None
            }
            ([law], Some(_)) => {
                self.two_laws(p, law.span, args.coefficient.map_or(p.ast.span, |c| c.1.span));
                None
            }
        }
    }

    /// Co-energy variable, stored quantity and rate of a port of a storage.
    fn storage_variables(&self, part: usize, slot: usize) -> Option<(Symbol, Symbol, Symbol)> {
        let pair = &self.pairs[self.wire_at(part, slot)?];
        let x = *self.stored[part].get(slot)?;
        Some(match self.part(part).word {
            Word::I => (pair.flow, x, pair.effort),
            _ => (pair.effort, x, pair.flow),
        })
    }

    /// A law of a storage that reads the rate of what it stores hides a resistor.
    fn refuse_rate(&mut self, part: usize, law: &PortLaw, rate: Symbol) -> Option<()> {
        if !self.exprs.depends_on(law.expr, rate) {
            return Some(());
        }
        let (word, own, between) = match self.part(part).word {
            Word::I => ("an I", "e", "f and p"),
            _ => ("a C", "f", "e and q"),
        };
        let d = Diagnostic::error(
            codes::L004,
            format!("the law of {} reads its own `{own}`", what(self.part(part))),
            law.span,
            "here",
        )
        .note(format!("the law of {word} is between {between}"));
        self.fault(d.hint("put what depends on it into an R at the same junction"));
        None
    }

    /// `q = …` of a C, `p = …` of an I, without another law.
    fn stored_law(&mut self, part: usize, law: &PortLaw, xs: Expr, x: Symbol) -> Option<StorageLaw> {
        let ports = self.wiring.ports[part].len();
        let mut reads = false;
        for slot in 0..ports {
            let (z, _, _) = self.storage_variables(part, slot)?;
            reads |= self.exprs.depends_on(law.expr, z);
        }
        if self.exprs.depends_on(law.expr, x) {
            return Some(StorageLaw::Implicit(self.exprs.sub(xs, law.expr)));
        }
        if reads {
            return Some(StorageLaw::Derivative(law.expr));
        }
        let p = self.part(part);
        let (letter, z) = if p.word == Word::I { ("p", "f") } else { ("q", "e") };
        let d = Diagnostic::error(
            codes::L001,
            format!("{} knows its `{letter}`, but not what follows from it", what(p)),
            law.span,
            format!("does not read `{z}`"),
        );
        let hint = match p.word {
            Word::C => "add its stiffness, such as `k = …`, or a law `e = …`".to_string(),
            _ => format!("give a law `{letter} = …` that reads `{z}`"),
        };
        self.fault(d.hint(hint));
        None
    }

    /// A C whose displacement is known.
    fn known(&mut self, part: usize, law: &PortLaw, z: Symbol, inner: Expr) -> Option<StorageLaw> {
        let x = self.stored[part].first().copied();
        let own = self.exprs.depends_on(law.expr, z) || x.is_some_and(|x| self.exprs.depends_on(law.expr, x));
        if own {
            let p = self.part(part);
            let d = Diagnostic::error(
                codes::L002,
                format!("{} has two laws", what(p)),
                law.span,
                "reads its own variables",
            );
            self.fault(d.hint("a known displacement reads other variables only; else give one law"));
            return None;
        }
        Some(StorageLaw::Known { displacement: law.expr, law: inner })
    }

    fn two_laws(&mut self, p: &Part<'_>, second: Span, first: Span) {
        let d = Diagnostic::error(codes::L002, format!("{} has two laws", what(p)), second, "the second");
        self.fault(d.also(first, "the first").hint("remove one of them"));
    }

    fn no_law<T>(&mut self, part: usize, slot: usize) -> Option<T> {
        let p = self.part(part);
        let name = &p.ast.name.text;
        let (title, span) = match p.ports.get(slot) {
            Some(port) if p.ports.len() > 1 => (format!("port `{}.{}` has no law", p.name, port.text), port.span),
            _ => (format!("{} has no law", what(p)), p.ast.span),
        };
        let hint = match (p.word, p.ports.len()) {
            (Word::I, 0 | 1) => format!("write `I:{name}( … )` with its inertance, or a law `f = …` of p"),
            (Word::C, 0 | 1) => format!("write `C:{name}( … )` with its compliance, `k = …`, or a law `e = …` of q"),
            (Word::R, 0 | 1) => format!("write `R:{name}( … )` with its resistance, `g = …`, or a law `e = …` of f"),
            (Word::R, _) => "give `f.port = …` or `e.port = …` for it, or a matrix `r = [[…]]`".to_string(),
            (Word::I, _) => "give `f.port = …` for it, `energy = …`, or a matrix `m = [[…]]`".to_string(),
            _ => "give `e.port = …` for it, `energy = …`, or a matrix `k = [[…]]`".to_string(),
        };
        self.fault(Diagnostic::error(codes::L001, title, span, "what is its law?").hint(hint));
        None
    }

    fn start_values(&mut self, part: usize, starts: &[(char, usize, &'a Arg)]) -> Option<Vec<Initial>> {
        let mut initial = Vec::new();
        let mut fine = true;
        for (letter, slot, arg) in starts {
            let own = self.port_variable(part, *slot, letter.encode_utf8(&mut [0; 4]));
            let p = self.part(part);
            let cx = Reading::of(p.here, &p.name);
            let value = match p.width {
                Width::Field(of) if arg.label.as_ref().is_some_and(|l| l.port.is_none()) => {
                    self.strand_of(&cx, &arg.value, *slot, of)
                }
                _ => self.number(&cx, &arg.value),
            };
            let (Some(own), Some(value)) = (own, value) else {
                fine = false;
                continue;
            };
            self.equal(&value.quantity, &own.quantity, arg.span, "the start value and the variable");
            fine &= self.only_parameters(value.expr, arg.value.span, "a start value");
            if let crate::algebra::Node::Symbol(symbol) = self.exprs.node(own.expr) {
                initial.push(Initial { symbol: *symbol, value: value.expr, span: arg.span });
            }
        }
        fine.then_some(initial)
    }

    fn resistor(&mut self, part: usize) -> Option<Vec<ResistorLaw>> {
        let args = self.law_args(part)?;
        let matrix = self.coefficients(part, &args)?;
        let mut laws = Vec::new();
        for slot in 0..args.laws.len() {
            let given = self.port_laws(part, slot, &args.laws[slot]);
            laws.push(given.and_then(|given| self.resistor_law(part, slot, &given, &args, matrix.as_ref())));
        }
        laws.into_iter().collect()
    }

    fn resistor_law(
        &mut self,
        part: usize,
        slot: usize,
        given: &[PortLaw],
        args: &LawArgs<'a>,
        matrix: Option<&Coefficients>,
    ) -> Option<ResistorLaw> {
        let pair = self.pairs[self.wire_at(part, slot)?].clone();
        match (given, matrix) {
            ([], Some(matrix)) => matrix.resistor(self, part, slot),
            ([], None) => self.no_law(part, slot),
            ([law], None) => {
                let own = match law.gives {
                    'e' => pair.effort,
                    'f' => pair.flow,
                    _ => return Some(ResistorLaw::Implicit(law.expr)),
                };
                let symbol = self.exprs.sym(own);
                Some(match (self.exprs.depends_on(law.expr, own), law.gives) {
                    (true, _) => ResistorLaw::Implicit(self.exprs.sub(symbol, law.expr)),
                    (false, 'e') => ResistorLaw::Resistive(law.expr),
                    (false, _) => ResistorLaw::Conductive(law.expr),
                })
            }
            (given, _) => {
                let p = self.part(part);
                let first =
                    if matrix.is_some() { args.coefficient.map(|c| c.1.span) } else { given.first().map(|l| l.span) };
                self.two_laws(p, given.last().map_or(p.ast.span, |l| l.span), first.unwrap_or(p.ast.span));
                None
            }
        }
    }

    /// The coefficient or matrix of an element. The outer `None`: at fault.
    #[allow(clippy::option_option)]
    fn coefficients(&mut self, part: usize, args: &LawArgs<'a>) -> Option<Option<Coefficients>> {
        let Some((letter, arg, bare)) = args.coefficient else { return Some(None) };
        let ports = args.laws.len();
        let rows = if let Width::Field(of) = self.part(part).width {
            self.wide_coefficients(part, arg, of)?
        } else if ports == 1 && !matches!(arg.value.kind, ExprKind::List(_)) {
            vec![vec![self.arg(part, &arg.value, false)?]]
        } else {
            self.matrix(part, arg, ports)?
        };
        let mut fine = true;
        for (i, row) in rows.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                let absent = value.expr == ZERO && matches!(self.part(part).width, Width::Field(_));
                fine &= absent || self.coefficient_units(part, letter, bare, (i, j), value, arg);
            }
        }
        let entries = rows.into_iter().map(|row| row.into_iter().map(|v| v.expr).collect()).collect();
        let coefficients = Coefficients { letter, entries };
        // Where strands have to do with each other none of them alone tells what is stored.
        if fine && (ports == 1 || coefficients.is_diagonal(self, part)) {
            fine =
                (0..ports).all(|at| self.not_zero(part, letter, coefficients.entries[at][at], (at, ports), arg.span));
        }
        fine.then_some(Some(coefficients))
    }

    fn matrix(&mut self, part: usize, arg: &'a Arg, ports: usize) -> Option<Vec<Vec<Value>>> {
        let square = match &arg.value.kind {
            ExprKind::List(rows) => {
                rows.len() == ports
                    && rows.iter().all(|r| matches!(&r.kind, ExprKind::List(entries) if entries.len() == ports))
            }
            _ => false,
        };
        if !square {
            let p = self.part(part);
            let row = format!("[{}]", vec!["…"; ports].join(", "));
            let example = format!("[{}]", vec![row; ports].join(", "));
            let d = Diagnostic::error(
                codes::L009,
                format!("{} needs a matrix of {ports} by {ports}", what(p)),
                arg.value.span,
                "not of that shape",
            );
            self.fault(d.hint(format!("write `{example}`, rows and columns in the order of the ports")));
            return None;
        }
        let ExprKind::List(rows) = &arg.value.kind else { return None };
        let mut result = Vec::new();
        for row in rows {
            let ExprKind::List(entries) = &row.kind else { return None };
            let values: Vec<Option<Value>> = entries.iter().map(|e| self.arg(part, e, false)).collect();
            result.push(values.into_iter().collect::<Option<Vec<_>>>()?);
        }
        Some(result)
    }

    /// Checks the unit of a coefficient; a stiffness where a compliance belongs is told apart by its unit.
    fn coefficient_units(
        &mut self,
        part: usize,
        letter: &str,
        bare: bool,
        at: (usize, usize),
        value: &Value,
        arg: &Arg,
    ) -> bool {
        let (Some(row), Some(column)) = (self.wire_at(part, at.0), self.wire_at(part, at.1)) else { return false };
        let (row, column) = (self.pairs[row].clone(), self.pairs[column].clone());
        let second = Quantity::of(Dim::SECOND);
        let expected = match letter {
            "m" | "l" => row.effort_in.times(&second).over(&column.flow_in),
            "c" => row.flow_in.times(&second).over(&column.effort_in),
            "k" => row.effort_in.over(&column.flow_in.times(&second)),
            "r" => row.effort_in.over(&column.flow_in),
            _ => row.flow_in.over(&column.effort_in),
        };
        if self.inverse_meant(part, letter, bare, value, arg) {
            return false;
        }
        self.equal_by_law(&value.quantity, &expected, part);
        true
    }

    /// Says so if the unit is that of one over the coefficient.
    fn inverse_meant(&mut self, part: usize, letter: &str, bare: bool, value: &Value, arg: &Arg) -> bool {
        let Some(dim) = self.dims.value(&value.quantity) else { return false };
        let own = (letter.as_bytes()[0], dim);
        if self.plain.contains(&own) {
            return false;
        }
        let compliance = |d: Domain| d.flow().times(Dim::SECOND).over(d.effort());
        let resistance = |d: Domain| d.effort().over(d.flow());
        let any = |of: &dyn Fn(Domain) -> Dim, wanted: Dim| Domain::ALL.into_iter().any(|d| of(d) == wanted);
        let (meant, is, takes) = match letter {
            "c" if !any(&compliance, dim) && any(&compliance, dim.inverse()) => ("k", "a stiffness", "compliance"),
            "k" if !any(&compliance, dim.inverse()) && any(&compliance, dim) => ("c", "a compliance", "stiffness"),
            "r" if !any(&resistance, dim) && any(&resistance, dim.inverse()) => ("g", "a conductance", "resistance"),
            "g" if !any(&resistance, dim.inverse()) && any(&resistance, dim) => ("r", "a resistance", "conductance"),
            _ => {
                self.plain.push(own);
                return false;
            }
        };
        let p = self.part(part);
        let text = self.sources.slice(arg.value.span).to_string();
        let label = if bare {
            format!("the value of {} is its {takes}", p.word.with_article())
        } else {
            format!("`{letter}` is the {takes}")
        };
        let title = format!("{} is given {is} where its {takes} belongs", what(p));
        self.fault(
            Diagnostic::error(codes::U007, title, arg.span, format!("this is {is}, in {dim}"))
                .note(label)
                .hint(format!("write `{}:{}({meant} = {text})`", p.word.text(), p.ast.name.text)),
        );
        true
    }

    /// An inertance or compliance of zero is no storage, in no strand.
    fn not_zero(&mut self, part: usize, letter: &str, expr: Expr, (at, of): (usize, usize), span: Span) -> bool {
        if !matches!(letter, "m" | "l" | "c") || self.value_of(expr) != Some(0.0) {
            return true;
        }
        let p = self.part(part);
        let (name, remedy) = match (letter, of) {
            ("c", 1) => ("compliance", "leave the element out (a rigid joint)"),
            (_, 1) => ("inertance", "leave the element out"),
            ("c", _) => ("compliance", "write a small one, or one element for each strand that gives way"),
            _ => ("inertance", "write a small one, or one element for each strand that has some"),
        };
        let strand = if of == 1 { String::new() } else { format!(" in strand {}", strand_name(at, of)) };
        let title = format!("the {name} of `{}` is 0{strand}", p.name);
        self.fault(Diagnostic::error(codes::L008, title, span, "0 at the given parameters").hint(remedy));
        false
    }
}

/// The coefficients of an element: one, or a matrix.
struct Coefficients {
    letter: &'static str,
    entries: Vec<Vec<Expr>>,
}

impl Coefficients {
    /// Whether the bonds of a wide element have nothing to do with each other.
    fn is_diagonal(&self, b: &Builder<'_, '_>, part: usize) -> bool {
        let entries =
            self.entries.iter().enumerate().flat_map(|(i, row)| row.iter().enumerate().map(move |(j, e)| (i, j, e)));
        let wide = matches!(b.part(part).width, Width::Field(_));
        wide && entries.filter(|(i, j, _)| i != j).all(|(_, _, e)| *e == ZERO)
    }

    /// The law of a port of a storage.
    fn law(&self, b: &mut Builder<'_, '_>, part: usize, slot: usize) -> Option<StorageLaw> {
        let direct = self.letter != "k";
        if self.entries.len() == 1 || self.is_diagonal(b, part) {
            let (_, x, _) = b.storage_variables(part, slot)?;
            let (x, value) = (b.exprs.sym(x), self.entries[slot][slot]);
            let expr = if direct { b.exprs.div(x, value) } else { b.exprs.mul(&[value, x]) };
            return Some(StorageLaw::Integral(expr));
        }
        let mut terms = Vec::new();
        for (column, value) in self.entries[slot].iter().enumerate() {
            let (z, x, _) = b.storage_variables(part, column)?;
            let variable = b.exprs.sym(if direct { z } else { x });
            terms.push(b.exprs.mul(&[*value, variable]));
        }
        let sum = b.exprs.add(&terms);
        Some(if direct { StorageLaw::Derivative(sum) } else { StorageLaw::Integral(sum) })
    }

    /// The law of a port of a resistor.
    fn resistor(&self, b: &mut Builder<'_, '_>, part: usize, slot: usize) -> Option<ResistorLaw> {
        let mut terms = Vec::new();
        for (column, value) in self.entries[slot].iter().enumerate() {
            let pair = &b.pairs[b.wire_at(part, column)?];
            let symbol = if self.letter == "r" { pair.flow } else { pair.effort };
            let variable = b.exprs.sym(symbol);
            terms.push(b.exprs.mul(&[*value, variable]));
        }
        let sum = b.exprs.add(&terms);
        Some(if self.letter == "r" { ResistorLaw::Resistive(sum) } else { ResistorLaw::Conductive(sum) })
    }
}

/// Turns an option whose inside may be at fault inside out.
trait TransposeFault<T> {
    fn transpose_fault(self) -> Option<Option<T>>;
}

impl<T> TransposeFault<T> for Option<Option<T>> {
    fn transpose_fault(self) -> Option<Option<T>> {
        match self {
            None => Some(None),
            Some(None) => None,
            Some(Some(value)) => Some(Some(value)),
        }
    }
}

/// `R `d``, for messages.
fn what(p: &Part<'_>) -> String {
    format!("{} `{}`", p.word.text(), p.name)
}

fn variable(letter: &str) -> &'static str {
    if letter == "e" { "effort" } else { "flow" }
}

/// Whether an argument says what a source carries beside its own effort.
fn is_carried(arg: &Arg) -> bool {
    arg.label.as_ref().is_some_and(|l| l.port.is_none() && l.name.text == "carries")
}

/// Whether a label is one of the start values.
fn is_start(name: &str) -> bool {
    matches!(name, "q0" | "p0" | "e0" | "f0")
}
