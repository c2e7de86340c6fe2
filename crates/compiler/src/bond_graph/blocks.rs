//! Signal blocks unfolded: `pid` and `tf` to integrated signals, `delay` and `sample` to held ones, `table` to a table.

use super::builder::{BlockInput, Builder, HeldDraft, OpenBlock, SignalDraft, Value};
use super::csv;
use super::dimension::Quantity;
use super::files::{FileError, read_beside};
use super::value::{Reading, known_of};
use super::{HeldKind, Meaning, SignalId};
use crate::algebra::{Expr, Facts, Interpolation, Outside, Symbol, Table1d, TableError};
use crate::ast::{self, Arg, Call, ExprKind};
use crate::diagnostic::{Diagnostic, codes};
use crate::span::{FileId, Span};
use crate::unit::Dimension as Dim;
use std::rc::Rc;

/// The time constant of the filter of a `pid` is by default `kd/(10*kp)`.
const FILTER_RATIO: i64 = 10;

/// Whether a call gives a value that does not depend at once on its first argument: a delay, a sample, a transfer
/// function whose denominator has the higher degree.
pub(super) fn is_lagging(call: &Call) -> bool {
    let length = |arg: Option<&Arg>| match arg.map(|a| &a.value.kind) {
        Some(ExprKind::List(list)) => list.len(),
        _ => 0,
    };
    match call.function.text.as_str() {
        "delay" | "sample" => call.args.len() > 1,
        "tf" => length(call.args.get(1)) > 0 && length(call.args.get(1)) < length(call.args.get(2)),
        _ => false,
    }
}

impl<'a> Builder<'a, '_> {
    /// A signal block.
    pub fn block(&mut self, cx: &Reading<'_>, name: &str, call: &'a Call, span: Span) -> Option<Value> {
        if cx.plain {
            let title = format!("a function cannot contain `{name}`, which has a memory");
            self.fault(Diagnostic::error(codes::L004, title, span, "here").hint("make it a `let` value"));
            return None;
        }
        let known: &[&str] = if name == "pid" { &["filter"] } else { &[] };
        self.refuse_labels(name, call, known)?;
        match name {
            "pid" => self.pid(cx, call),
            "tf" => self.transfer_function(cx, call, span),
            _ => self.hold(cx, name, call, span),
        }
    }

    /// Says which named arguments a block does not take.
    pub fn refuse_labels(&mut self, name: &str, call: &Call, known: &[&str]) -> Option<()> {
        let mut fine = Some(());
        for arg in &call.args {
            let Some(label) = &arg.label else { continue };
            if !known.contains(&label.name.text.as_str()) {
                let title = format!("`{name}` takes no `{}`", label.name.text);
                let d = Diagnostic::error(codes::N008, title, label.span, "not known");
                self.fault(if known.is_empty() { d } else { d.hint(format!("it takes: {}", known.join(", "))) });
                fine = None;
            }
        }
        fine
    }

    /// A value that must be known before the run, and is above zero.
    pub fn positive(&mut self, cx: &Reading<'_>, e: &'a ast::Expr, what: &str) -> Option<Expr> {
        let value = self.number(cx, e)?;
        if !self.only_parameters(value.expr, e.span, what) {
            return None;
        }
        self.equal(&value.quantity, &Quantity::of(Dim::SECOND), e.span, "this and a time");
        let number = self.value_of(value.expr)?;
        if number.is_nan() || number <= 0.0 {
            let title = format!("{what} must be above 0");
            self.fault(Diagnostic::error(codes::L010, title, e.span, format!("this is {number}")));
            return None;
        }
        self.exprs.decide_positive(value.expr);
        Some(value.expr)
    }

    fn hold(&mut self, cx: &Reading<'_>, name: &str, call: &'a Call, span: Span) -> Option<Value> {
        let (what, kind) = match name {
            "delay" => ("the time of a delay", HeldKind::Delay),
            _ => ("the period of a sample", HeldKind::Sample),
        };
        let time = self.positive(cx, &call.args[1].value, what)?;
        let title = format!("{}.{name}", cx.owner);
        let symbol = self.fresh(&title, Facts::default());
        let name = self.exprs.name(symbol).to_string();
        let id = self.held.push(HeldDraft { name, symbol, source: None, time, kind, unit: None, span });
        self.mean(symbol, Meaning::Held(id), Quantity::Any);
        self.open(cx, &call.args[0].value, BlockInput::Held(id));
        Some(self.symbol_value(symbol))
    }

    fn open(&mut self, cx: &Reading<'_>, input: &'a ast::Expr, goes: BlockInput) {
        let block = OpenBlock { input, here: cx.here, own: cx.own, law: cx.law, owner: cx.owner.to_string(), goes };
        self.open_blocks.push(block);
    }

    /// A new integrated signal of a block; its rate comes later.
    fn block_signal(&mut self, cx: &Reading<'_>, name: &str, quantity: Quantity, span: Span) -> (SignalId, Symbol) {
        let symbol = self.fresh(&format!("{}.{name}", cx.owner), Facts::default());
        let name = self.exprs.name(symbol).to_string();
        let id = self.signals.push(SignalDraft { name, symbol, rate: None, initial: None, unit: None, span });
        self.mean(symbol, Meaning::Signal(id), quantity);
        (id, symbol)
    }

    /// `pid(u, kp, ki, kd)`: `kp u + ki ∫u dt + kd u'`. The derivative is exact where the rate of `u` is known without
    /// differentiating efforts, flows or inputs; else, or where `filter = T` is given, it is that of `u` behind a filter
    /// of first order, with `T = kd/(10 kp)` if none is given. Gains that are zero add no state.
    fn pid(&mut self, cx: &Reading<'_>, call: &'a Call) -> Option<Value> {
        let mut read = call.args.iter().filter(|a| a.label.is_none()).map(|a| (&a.value, self.number(cx, &a.value)));
        let mut next = || read.next().map(|(e, v)| (e.span, v));
        let (u, kp, ki, kd) = (next()?, next()?, next()?, next()?);
        drop(read);
        let ((span, u), kp, ki) = ((u.0, u.1?), kp.1?, ki.1?);
        let kd = kd.1?;
        let mut terms = vec![self.exprs.mul(&[kp.expr, u.expr])];
        let mut quantity = kp.quantity.times(&u.quantity);
        let second = Quantity::of(Dim::SECOND);
        if !self.is_left_out(ki.expr) {
            let (id, symbol) = self.block_signal(cx, "integral", u.quantity.times(&second), span);
            self.signals[id].rate = Some(u.expr);
            let integral = self.exprs.sym(symbol);
            terms.push(self.exprs.mul(&[ki.expr, integral]));
            quantity = self.same(&quantity, &ki.quantity.times(&u.quantity).times(&second), span);
        }
        if !self.is_left_out(kd.expr) {
            let rate = self.pid_rate(cx, call, &u, &kp, &kd, span)?;
            terms.push(self.exprs.mul(&[kd.expr, rate]));
            quantity = self.same(&quantity, &kd.quantity.times(&u.quantity).over(&second), span);
        }
        Some(Value::number(self.exprs.add(&terms), quantity))
    }

    /// Whether a gain is zero, so that its term is left out.
    fn is_left_out(&self, gain: Expr) -> bool {
        let zero = self.value_of(gain) == Some(0.0);
        if zero {
            self.exprs.decide_zero(gain);
        }
        zero
    }

    fn same(&mut self, a: &Quantity, b: &Quantity, span: Span) -> Quantity {
        self.equal(a, b, span, "the terms of this controller");
        known_of(a, b)
    }

    fn pid_rate(
        &mut self,
        cx: &Reading<'_>,
        call: &'a Call,
        u: &Value,
        kp: &Value,
        kd: &Value,
        span: Span,
    ) -> Option<Expr> {
        let filter = call.args.iter().find(|a| a.label.is_some());
        if filter.is_none() && self.rate_is_known(u.expr) {
            return self.rate_of(u.expr, span);
        }
        let time = match filter {
            Some(arg) => self.positive(cx, &arg.value, "the time constant of a filter")?,
            None if self.value_of(kp.expr).is_some_and(|v| v != 0.0) => {
                self.exprs.decide_nonzero(kp.expr);
                let ten = self.exprs.int(FILTER_RATIO);
                let scaled = self.exprs.mul(&[ten, kp.expr]);
                self.exprs.div(kd.expr, scaled)
            }
            None => {
                let d = Diagnostic::error(
                    codes::L010,
                    "the derivative of this signal needs a filter",
                    span,
                    "its rate is not known exactly",
                );
                self.fault(d.hint("give the time constant: `pid(u, kp, ki, kd, filter = 1 ms)`"));
                return None;
            }
        };
        let (id, symbol) = self.block_signal(cx, "filter", u.quantity.clone(), span);
        let behind = self.exprs.sym(symbol);
        let rest = self.exprs.sub(u.expr, behind);
        let rate = self.exprs.div(rest, time);
        self.signals[id].rate = Some(rate);
        Some(rate)
    }

    /// Whether the rate of an expression needs no derivative of an effort, a flow, an input or a held signal.
    fn rate_is_known(&self, expr: Expr) -> bool {
        self.exprs.symbols_of(expr).into_iter().all(|s| {
            matches!(
                self.meaning(s),
                Some(Meaning::Parameter(_) | Meaning::Time | Meaning::Stored(_) | Meaning::Signal(_))
            )
        })
    }

    /// `tf(u, [num], [den])`, highest power of `s` first, in controllable canonical form: with `a x₁⁽ⁿ⁾ + … = u` the
    /// states are `x₁` and its derivatives, and the value is the same combination of them as the numerator.
    fn transfer_function(&mut self, cx: &Reading<'_>, call: &'a Call, span: Span) -> Option<Value> {
        let num = self.polynomial(cx, &call.args[1].value);
        let den = self.polynomial(cx, &call.args[2].value);
        let (num, den) = (num?, den?);
        let n = den.len() - 1;
        if self.value_of(den[n]) == Some(0.0) {
            let d = Diagnostic::error(
                codes::L010,
                "a denominator whose leading coefficient is 0",
                call.args[2].value.span,
                "here",
            );
            self.fault(d.hint("leave leading zeros out"));
            return None;
        }
        if num.len() > den.len() {
            let d = Diagnostic::error(
                codes::L010,
                "this transfer function is not proper",
                span,
                "the numerator has the higher degree",
            );
            self.fault(d.note("it would differentiate its input").hint("add a fast pole to the denominator"));
            return None;
        }
        let direct = num.len() == den.len();
        let input = if direct { Some(self.number(cx, &call.args[0].value)?) } else { None };
        let signals: Vec<(SignalId, Symbol)> =
            (0..n).map(|i| self.block_signal(cx, &format!("x{}", i + 1), Quantity::Any, span)).collect();
        let states: Vec<Expr> = signals.iter().map(|(_, s)| self.exprs.sym(*s)).collect();
        let terms: Vec<Expr> = (0..n).map(|i| self.exprs.mul(&[den[i], states[i]])).collect();
        let sum = self.exprs.add(&terms);
        let minus = self.exprs.neg(sum);
        let highest = self.exprs.div(minus, den[n]);
        for i in 0..n {
            self.signals[signals[i].0].rate = Some(if i + 1 < n { states[i + 1] } else { highest });
        }
        let mut value: Vec<Expr> = (0..n.min(num.len())).map(|i| self.exprs.mul(&[num[i], states[i]])).collect();
        match (input, signals.last()) {
            (Some(u), last) => {
                let part = self.exprs.div(u.expr, den[n]);
                let top = self.exprs.add(&[highest, part]);
                if let Some((id, _)) = last {
                    self.signals[*id].rate = Some(top);
                }
                value.push(self.exprs.mul(&[num[n], top]));
            }
            (None, Some((id, _))) => self.open(cx, &call.args[0].value, BlockInput::Rate(*id, den[n])),
            (None, None) => {}
        }
        Some(Value::number(self.exprs.add(&value), Quantity::Any))
    }

    /// Coefficients, lowest power first.
    fn polynomial(&mut self, cx: &Reading<'_>, e: &'a ast::Expr) -> Option<Vec<Expr>> {
        let ExprKind::List(list) = &e.kind else {
            let d = Diagnostic::error(codes::N017, "a list of coefficients is needed here", e.span, "not a list");
            self.fault(d.hint("write `[1, 0]` for s, highest power first"));
            return None;
        };
        if list.is_empty() {
            self.fault(Diagnostic::error(codes::N017, "a list of coefficients is needed here", e.span, "it is empty"));
            return None;
        }
        let mut coefficients = Vec::new();
        let mut fine = true;
        for entry in list.iter().rev() {
            match self.number(cx, entry) {
                Some(value) => {
                    fine &= self.only_parameters(value.expr, entry.span, "a coefficient");
                    coefficients.push(value.expr);
                }
                None => fine = false,
            }
        }
        fine.then_some(coefficients)
    }

    /// Reads what blocks take in, now that all names are known.
    pub fn finish_blocks(&mut self) {
        while let Some(block) = self.open_blocks.pop() {
            let owner = block.owner.clone();
            let cx = Reading { own: block.own, law: block.law, ..Reading::of(block.here, &owner) };
            let Some(value) = self.number(&cx, block.input) else { continue };
            match block.goes {
                BlockInput::Held(id) => self.held[id].source = Some(value.expr),
                BlockInput::Rate(id, divisor) => {
                    let part = self.exprs.div(value.expr, divisor);
                    let terms: Vec<Expr> = self.signals[id].rate.into_iter().chain([part]).collect();
                    self.signals[id].rate = Some(self.exprs.add(&terms));
                }
            }
        }
    }

    /// `table("file.csv", x, column = 2, interpolation = linear, outside = error)`.
    pub fn table_call(&mut self, cx: &Reading<'_>, call: &'a Call, span: Span) -> Option<Value> {
        self.refuse_labels("table", call, &["column", "interpolation", "outside"])?;
        let mut positional = call.args.iter().filter(|a| a.label.is_none());
        let (file, x) = (positional.next()?, positional.next()?);
        let argument = self.number(cx, &x.value);
        let (path, place) = self.file_named(cx, &file.value, "table(\"file.csv\", x)")?;
        let interpolation = self.word(call, "interpolation", &["linear", "cubic", "step"])?;
        let outside = self.word(call, "outside", &["error", "clamp", "extrapolate"])?;
        let table = self.columns(path, place)?;
        let columns = &table.columns;
        let column = self.column(call, columns, span)?;
        let interpolation = [Interpolation::Linear, Interpolation::Cubic, Interpolation::Step][interpolation];
        let outside = [Outside::Error, Outside::Clamp, Outside::Extrapolate][outside];
        match Table1d::new(columns.columns[0].clone(), columns.columns[column].clone(), interpolation, outside) {
            Ok(table) => {
                let id = self.exprs.add_table(table);
                let argument = argument?;
                Some(Value::number(self.exprs.table(id, argument.expr), Quantity::Any))
            }
            Err(why) => {
                let why = match why {
                    TableError::TooShort => "it has too few rows".to_string(),
                    TableError::Lengths => "its columns differ in length".to_string(),
                    TableError::NotIncreasing(row) => {
                        format!("its first column must increase, but does not at row {}", row + 1)
                    }
                    TableError::NotFinite(row) => format!("row {} is not finite", row + 1),
                };
                let d = Diagnostic::error(codes::N020, format!("`{path}` cannot be used as a table"), place, why);
                self.fault(d.hint("give pairs of numbers, the first column increasing"));
                None
            }
        }
    }

    /// The word given for a named argument: its index among those known, 0 if it is not given.
    fn word(&mut self, call: &Call, label: &str, known: &[&str]) -> Option<usize> {
        let Some(arg) = labelled(call, label) else { return Some(0) };
        let word = match &arg.value.kind {
            ExprKind::Text(text) => text.as_str(),
            ExprKind::Path(path) if path.parts.len() == 1 => path.parts[0].name.text.as_str(),
            _ => "",
        };
        let found = known.iter().position(|k| *k == word);
        if found.is_none() {
            let title = format!("`{label}` is one of {}", known.join(", "));
            self.fault(Diagnostic::error(codes::N007, title, arg.value.span, "not one of them"));
        }
        found
    }

    /// The name of a file, as text or as a value that is text, and where the text stands; says so if it is none.
    pub fn file_named(&mut self, cx: &Reading<'_>, e: &'a ast::Expr, usage: &str) -> Option<(&'a str, Span)> {
        let found = self.text_of(cx.here, e);
        if found.is_none() {
            let d = Diagnostic::error(codes::N017, "the name of a file is needed here", e.span, "not text");
            self.fault(d.hint(format!("write `{usage}`")));
        }
        found
    }

    /// What a file is known by that is named in the text at `span`.
    pub fn key_of_file(&self, path: &str, span: Span) -> String {
        format!("{}\n{path}", self.file_around(span))
    }

    /// The file from whose folder a file named in the text at `span` is seen; of a new value that of the model.
    pub fn file_around(&self, span: Span) -> &str {
        let name = self.sources.name(span.file);
        if name.starts_with(super::overrides::SET) { self.sources.name(FileId(0)) } else { name }
    }

    /// Reads a file that is named in the text at `span`. Gives the path under which it was found, and its text; says so if
    /// it cannot be read.
    pub fn read_file(&mut self, path: &str, span: Span) -> Option<(String, String)> {
        match read_beside(self.files, self.file_around(span), path) {
            Ok(read) => Some(read),
            Err(why) => {
                let d = Diagnostic::error(codes::N020, format!("`{path}` cannot be read"), span, why.to_string());
                self.fault(d.hint(why.remedy().to_string()));
                None
            }
        }
    }

    /// The columns of a file, read once.
    fn columns(&mut self, path: &str, span: Span) -> Option<Rc<csv::Table>> {
        let key = self.key_of_file(path, span);
        if let Some(known) = self.csv.get(&key).cloned() {
            if let Some(known) = &known {
                self.uses.tables.push((known.path.clone(), span));
            }
            return known;
        }
        let read = self.read_file(path, span);
        let columns = read.and_then(|(found, text)| match csv::parse(&text) {
            Ok(columns) if columns.columns.len() > 1 => {
                self.uses.tables.push((found.clone(), span));
                Some(Rc::new(csv::Table { path: found, columns }))
            }
            Ok(_) => {
                let title = format!("`{path}` cannot be used as a table");
                let d = Diagnostic::error(codes::N020, title, span, "it has one column");
                self.fault(d.hint("give pairs of numbers: argument and value"));
                None
            }
            Err(why) => {
                let d = Diagnostic::error(codes::N020, format!("`{path}` cannot be read"), span, why.to_string());
                self.fault(d.hint(FileError::NotFound.remedy()));
                None
            }
        });
        self.csv.insert(key, columns.clone());
        columns
    }

    /// Index of the column that is asked for: by name, or by number from 1.
    fn column(&mut self, call: &Call, columns: &csv::Columns, span: Span) -> Option<usize> {
        let Some(arg) = labelled(call, "column") else { return Some(1) };
        let found = match &arg.value.kind {
            ExprKind::Number(n) if n.unit.is_none() => n.text.parse::<usize>().ok().filter(|c| *c > 0).map(|c| c - 1),
            ExprKind::Text(name) => columns.names.iter().position(|n| n == name),
            ExprKind::Path(path) if path.parts.len() == 1 => {
                columns.names.iter().position(|n| *n == path.parts[0].name.text)
            }
            _ => None,
        };
        let found = found.filter(|c| *c < columns.columns.len());
        if found.is_none() {
            let d = Diagnostic::error(codes::N020, "there is no such column", arg.value.span, "not in this table")
                .also(span, "read here");
            let known = if columns.names.is_empty() {
                format!("columns are numbered from 1 to {}", columns.columns.len())
            } else {
                format!("its columns are {}", columns.names.join(", "))
            };
            self.fault(d.hint(known));
        }
        found
    }
}

pub(super) fn labelled<'c>(call: &'c Call, label: &str) -> Option<&'c Arg> {
    call.args.iter().find(|a| a.label.as_ref().is_some_and(|l| l.name.text == label))
}
