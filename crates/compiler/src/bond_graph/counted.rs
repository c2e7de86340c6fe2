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

/// A parameter that counts other turns than its value says.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Counting<'a> {
    /// Its full name.
    pub name: &'a str,
    /// How many turns it counts, and how many it is.
    pub turns: i64,
    pub wanted: i64,
    /// Whole numbers up to this one are near the ends of all models of other sizes.
    pub near: i64,
}

/// The same, and what was made of it.
#[derive(Debug, Clone)]
pub(super) struct Counted<'a> {
    pub is: Counting<'a>,
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
    /// Such a variable.
    pub variable: bool,
    /// A named number that is not near.
    pub far: bool,
}

impl<'a> Counted<'a> {
    pub fn new(is: Counting<'a>) -> Counted<'a> {
        Counted { is, reads: Reads::default(), differs: Rc::default() }
    }

    fn is_near(&self, number: &Rational) -> bool {
        number.as_integer().is_some_and(|whole| whole.abs() <= self.is.near)
    }

    /// `i`, `3`, `i + 1`, `1 + i`, `i - 2`.
    fn is_side(&self, e: &Expr) -> bool {
        let is_name = |e: &Expr| match &e.kind {
            ExprKind::Path(path) => path.parts.len() == 1 && path.parts[0].indices.is_empty(),
            _ => false,
        };
        let is_small = |e: &Expr| match &e.kind {
            ExprKind::Number(n) => {
                n.unit.is_none() && Rational::from_decimal(&n.text).is_some_and(|n| self.is_near(&n))
            }
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
    fn is_plain(&self, e: &Expr) -> bool {
        match &e.kind {
            ExprKind::Unary(u) => u.op == UnaryOp::Not && self.is_plain(&u.operand),
            ExprKind::Binary(b) => match b.op {
                BinaryOp::And | BinaryOp::Or => self.is_plain(&b.left) && self.is_plain(&b.right),
                BinaryOp::Lt | BinaryOp::Le | BinaryOp::Gt | BinaryOp::Ge | BinaryOp::Eq | BinaryOp::Ne => {
                    self.is_side(&b.left) && self.is_side(&b.right)
                }
                _ => false,
            },
            _ => false,
        }
    }

    /// Something may be otherwise in a model of another size.
    pub fn note_difference(&self) {
        self.differs.set(true);
    }

    /// Whether something may be otherwise.
    pub fn differs(&self) -> bool {
        self.differs.get()
    }

    /// What is at most here where so many are allowed in the model that is wanted.
    pub fn share_of(&self, most: usize) -> usize {
        most / (self.is.wanted / self.is.turns.max(1) + 1).max(1) as usize
    }

    /// Looks at the ends of a repetition that were read: near another cell may be far from the ends, from turn to turn.
    pub fn look_at_ends(&self, ends: [Reads; 2]) {
        if ends.iter().any(|end| end.variable) {
            self.note_difference();
        }
    }

    /// A named number was read.
    pub fn read(&mut self, number: &Rational) {
        self.reads.far |= !self.is_near(number);
    }

    /// Looks at an index or the end of a repetition that was read.
    pub fn look_at_place(&self, e: &Expr, number: &Rational) {
        let alike = match self.reads.count {
            true => self.is_side(e) && !self.reads.far,
            false => self.is_near(number),
        };
        if !alike {
            self.note_difference();
        }
    }

    /// Looks at a number that tells how many there are of something else.
    pub fn look_at_size(&self, number: &Rational) {
        if self.reads.count || !self.is_near(number) {
            self.note_difference();
        }
    }

    /// Looks at an array of so many elements, of which a long one reaches far into the cells.
    pub fn look_at_array(&self, elements: usize) {
        if elements > self.is.near as usize {
            self.note_difference();
        }
    }

    /// Looks at a condition that was read.
    pub fn look_at_condition(&self, e: &Expr) {
        if self.reads.count && (self.reads.far || !self.is_plain(e)) {
            self.note_difference();
        }
    }

    /// Looks at two sides of a comparison of variables of repetitions.
    pub fn look_at_sides(&self, sides: [&Expr; 2]) {
        if !sides.into_iter().all(|side| self.is_side(side)) {
            self.note_difference();
        }
    }
}
