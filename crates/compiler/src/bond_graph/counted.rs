//! Models of one text that differ in how many cells they have: where what there is follows from that number in no other way at
//! another size.
//!
//! A model is looked at with a few turns of its repetitions in the place of many ([`elaborate_counting`](super::elaborate_counting)).
//! What tells what there is (ends of repetitions, indices, conditions of statements) may name the number, and the variables of
//! repetitions that it ends, with a small whole number added or beside it in a comparison: then it says the same of all
//! cells but those near the ends. Whatever else is made of them, and whatever reaches far into the cells by a number of the text,
//! may be otherwise in a larger model, and is noted.

use std::cell::Cell;
use std::rc::Rc;

use crate::algebra::Rational;
use crate::ast::{BinaryOp, Expr, ExprKind, UnaryOp};

/// Whole numbers up to this one are near the ends of all models that are looked at.
pub(crate) const NEAR: i64 = 16;

/// A parameter that counts so many turns, whatever its value, and what was made of it.
#[derive(Debug, Clone)]
pub(super) struct Counted<'a> {
    /// Its full name.
    pub name: &'a str,
    pub turns: i64,
    /// What the number that is being read follows from.
    pub reads: Reads,
    /// Whether anything may be otherwise in a model of another size; copies share it.
    differs: Rc<Cell<bool>>,
}

/// What a number follows from.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Reads {
    /// The parameter, or a variable of a repetition that it ends.
    pub count: bool,
    /// A named number that is not near.
    pub far: bool,
}

impl<'a> Counted<'a> {
    pub fn new(name: &'a str, turns: i64) -> Counted<'a> {
        Counted { name, turns, reads: Reads::default(), differs: Rc::default() }
    }

    /// Something may be otherwise in a model of another size.
    pub fn note_difference(&self) {
        self.differs.set(true);
    }

    /// Whether something may be otherwise.
    pub fn differs(&self) -> bool {
        self.differs.get()
    }

    /// A named number was read.
    pub fn read(&mut self, number: &Rational) {
        self.reads.far |= !is_near(number);
    }

    /// Looks at an index or the end of a repetition that was read.
    pub fn look_at_place(&self, e: &Expr, number: &Rational) {
        let alike = match self.reads.count {
            true => is_side(e) && !self.reads.far,
            false => is_near(number),
        };
        if !alike {
            self.note_difference();
        }
    }

    /// Looks at a number that tells how many there are of something else.
    pub fn look_at_size(&self, number: &Rational) {
        if self.reads.count || !is_near(number) {
            self.note_difference();
        }
    }

    /// Looks at an array of so many elements, of which a long one reaches far into the cells.
    pub fn look_at_array(&self, elements: usize) {
        if elements > NEAR as usize {
            self.note_difference();
        }
    }

    /// Looks at a condition that was read.
    pub fn look_at_condition(&self, e: &Expr) {
        if self.reads.count && (self.reads.far || !is_plain(e)) {
            self.note_difference();
        }
    }
}

fn is_near(number: &Rational) -> bool {
    number.as_integer().is_some_and(|whole| whole.abs() <= NEAR)
}

/// `i`, `3`, `i + 1`, `1 + i`, `i - 2`.
pub(super) fn is_side(e: &Expr) -> bool {
    let is_name =
        |e: &Expr| matches!(&e.kind, ExprKind::Path(path) if path.parts.len() == 1 && path.parts[0].indices.is_empty());
    let is_small = |e: &Expr| match &e.kind {
        ExprKind::Number(n) => n.unit.is_none() && Rational::from_decimal(&n.text).is_some_and(|n| is_near(&n)),
        _ => false,
    };
    match &e.kind {
        ExprKind::Binary(b) => match b.op {
            BinaryOp::Add => is_name(&b.left) && is_small(&b.right) || is_small(&b.left) && is_name(&b.right),
            BinaryOp::Sub => is_name(&b.left) && is_small(&b.right),
            _ => false,
        },
        _ => is_name(e) || is_small(e),
    }
}

/// Comparisons of such, and what they are joined to.
fn is_plain(e: &Expr) -> bool {
    match &e.kind {
        ExprKind::Unary(u) => u.op == UnaryOp::Not && is_plain(&u.operand),
        ExprKind::Binary(b) => match b.op {
            BinaryOp::And | BinaryOp::Or => is_plain(&b.left) && is_plain(&b.right),
            BinaryOp::Lt | BinaryOp::Le | BinaryOp::Gt | BinaryOp::Ge | BinaryOp::Eq | BinaryOp::Ne => {
                is_side(&b.left) && is_side(&b.right)
            }
            _ => false,
        },
        _ => false,
    }
}
