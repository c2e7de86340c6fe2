//! Statements that are repeated, or chosen.

use super::flatten::{Flat, MAX_PARTS};
use super::scope::Here;
use crate::ast::{self, StatementKind};
use crate::diagnostic::{Diagnostic, codes};

/// The greatest number of statements that one repetition makes of those in it.
const MAX_STATEMENTS: usize = 16_000_000;

impl<'a> Flat<'a> {
    /// Repeats statements, once for each value of the variable.
    pub fn repeat(&mut self, here: Here, l: &'a ast::For, pseudo: bool, imported: bool) {
        if !self.repeatable(here, l) {
            self.lost = true;
            return;
        }
        let ends = (
            self.repetition_end(here, &l.from, "where a repetition begins"),
            self.repetition_end(here, &l.to, "where a repetition ends"),
        );
        let (Some((from, begins)), Some((to, ends))) = ends else { return };
        self.repeats.counted.iter().for_each(|counted| counted.look_at_ends([begins, ends]));
        let most = self.repeats.most(MAX_STATEMENTS);
        let Some(values) = self.repeats.turns_of(from, to).filter(|v| v.clone().count() * l.body.len() <= most) else {
            self.too_large(l.from.span.to(l.to.span));
            return;
        };
        let (turns, parts, chains) = (values.clone().count(), self.parts.len(), self.chains.len());
        for (at, value) in values.enumerate() {
            if at == 1 {
                // Most turns make as much as the first.
                let others = |made: usize| (made * (turns - 1)).min(MAX_PARTS);
                self.parts.reserve(others(self.parts.len() - parts));
                self.chains.reserve(others(self.chains.len() - chains));
            }
            let turn = match begins.count || ends.count {
                true => self.repeats.counted_turn(&l.variable, value, here),
                false => self.repeats.turn(&l.variable, value, here),
            };
            let before = self.faults.len();
            self.fill(Here { turn, ..here }, &l.body, pseudo, imported);
            self.faults.in_turn(before, || self.repeats.words(turn));
            if self.full {
                break;
            }
        }
    }

    /// Whether the variable and the statements of a repetition may be repeated; says so if not.
    fn repeatable(&mut self, here: Here, l: &'a ast::For) -> bool {
        let before = self.faults.len();
        if matches!(l.variable.text.as_str(), "t" | "pi") {
            let title = format!("`{}` cannot be a loop variable", l.variable.text);
            self.faults.push(Diagnostic::error(codes::N003, title, l.variable.span, "here").hint("use another name"));
        }
        if let Some(outer) = self.repeats.around(here.turn).find(|t| t.variable.text == l.variable.text) {
            let title = format!("`{}` is the variable of the repetition around this one", l.variable.text);
            let d = Diagnostic::error(codes::N002, title, l.variable.span, "again");
            self.faults.push(d.also(outer.variable.span, "the one around it").hint("use another name"));
        }
        self.refuse_repeated(&l.body, "repeated");
        self.faults.len() == before
    }

    /// Says which statements cannot be repeated, or be there on a condition.
    fn refuse_repeated(&mut self, body: &'a [ast::Statement], how: &str) {
        for statement in body {
            let what = match &statement.kind {
                StatementKind::Component(_) => "a component",
                StatementKind::Import(_) => "an import",
                StatementKind::Function(_) if how == "repeated" => "a function",
                StatementKind::Domain(d) => {
                    self.refuse_repeated(&d.body, how);
                    continue;
                }
                _ => continue,
            };
            let d = Diagnostic::error(codes::N014, format!("{what} cannot be {how}"), statement.span, "in a block");
            self.faults.push(d.hint("write it outside of the block"));
        }
    }

    /// The statements that are there if a condition holds, or those that are there if not.
    pub fn choose(&mut self, here: Here, c: &'a ast::Choice, pseudo: bool, imported: bool) {
        let before = self.faults.len();
        self.refuse_repeated(&c.yes, "chosen");
        self.refuse_repeated(&c.no, "chosen");
        let holds = match self.repeats.condition(&self.names, here, &c.cond) {
            Ok(holds) => holds,
            Err(why) => {
                let fault = why.fault("whether statements are there");
                let hint = "a value that changes during the run is chosen in an expression: `if … then … else …`";
                self.faults.maybe(fault.map(|d| if d.code == codes::N022 { d.note(hint) } else { d }));
                self.lost = true;
                return;
            }
        };
        if self.faults.len() > before {
            return;
        }
        self.fill(here, if holds { &c.yes } else { &c.no }, pseudo, imported);
    }
}
