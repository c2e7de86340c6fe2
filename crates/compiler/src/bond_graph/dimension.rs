//! Dimensions of quantities, known or to be inferred, and the solver that carries them through the equations of a model.

use crate::span::Span;
use crate::unit::{Dimension as Dim, WHOLE};

/// A dimension that is to be inferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Var(pub u32);

/// The dimension of an expression.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Quantity {
    /// Not known and fits everywhere: numbers and parameters without a unit, and what is made with them.
    Any,
    /// A product of a known dimension and powers of unknown ones.
    Known(Dim, Powers),
}

/// Products of more unknown dimensions than this are taken as [`Quantity::Any`].
const MAX_VARS: usize = 4;

/// Powers (in sixtieths) of unknown dimensions: each once, none zero, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Powers {
    len: usize,
    items: [(Var, i32); MAX_VARS],
}

impl Powers {
    /// None.
    pub const NONE: Powers = Powers { len: 0, items: [(Var(0), 0); MAX_VARS] };

    /// The powers.
    pub fn as_slice(&self) -> &[(Var, i32)] {
        &self.items[..self.len]
    }

    /// With one more factor; `None` if there are too many.
    fn with(mut self, var: Var, exponent: i32) -> Option<Powers> {
        let at = self.as_slice().partition_point(|(v, _)| *v < var);
        if self.as_slice().get(at).is_some_and(|(v, _)| *v == var) {
            let sum = self.items[at].1.saturating_add(exponent);
            self.items[at].1 = sum;
            if sum == 0 {
                self.items.copy_within(at + 1..self.len, at);
                self.len -= 1;
                self.items[self.len] = (Var(0), 0);
            }
            return Some(self);
        }
        if exponent == 0 {
            return Some(self);
        }
        if self.len == MAX_VARS {
            return None;
        }
        self.items.copy_within(at..self.len, at + 1);
        self.items[at] = (var, exponent);
        self.len += 1;
        Some(self)
    }
}

impl Quantity {
    /// No dimension.
    pub const NONE: Quantity = Quantity::Known(Dim::NONE, Powers::NONE);

    /// A known dimension.
    pub fn of(dim: Dim) -> Quantity {
        Quantity::Known(dim, Powers::NONE)
    }
    /// An unknown dimension.
    pub fn var(var: Var) -> Quantity {
        let powers = Powers::NONE.with(var, WHOLE);
        powers.map_or(Quantity::Any, |powers| Quantity::Known(Dim::NONE, powers))
    }
    /// The product.
    pub fn times(&self, other: &Quantity) -> Quantity {
        let (Quantity::Known(a, av), Quantity::Known(b, bv)) = (self, other) else { return Quantity::Any };
        let powers = bv.as_slice().iter().try_fold(*av, |sum, (var, exponent)| sum.with(*var, *exponent));
        powers.map_or(Quantity::Any, |powers| Quantity::Known(a.times(*b), powers))
    }
    /// The quotient.
    pub fn over(&self, other: &Quantity) -> Quantity {
        self.times(&other.power(-WHOLE))
    }
    /// The power with an exponent in sixtieths.
    pub fn power(&self, exponent: i32) -> Quantity {
        let Quantity::Known(dim, vars) = self else { return Quantity::Any };
        let scaled = |e: i32| {
            let product = i64::from(e) * i64::from(exponent);
            (product % i64::from(WHOLE) == 0).then(|| i32::try_from(product / i64::from(WHOLE)).ok()).flatten()
        };
        let mut powers = vars.as_slice().iter();
        let powers = powers.try_fold(Powers::NONE, |all, (var, e)| all.with(*var, scaled(*e)?));
        match (dim.power(exponent), powers) {
            (Some(dim), Some(powers)) => Quantity::Known(dim, powers),
            _ => Quantity::Any,
        }
    }
}

/// Why an unknown dimension is what it is.
#[derive(Debug, Clone)]
pub(super) struct Reason {
    /// Where that follows.
    pub span: Span,
    /// Index of the part whose law says so, if one does.
    pub part: Option<usize>,
}

/// Two dimensions that should be equal and are not.
#[derive(Debug, Clone)]
pub(super) struct Clash {
    /// One side.
    pub left: Dim,
    /// The other.
    pub right: Dim,
    /// If the equation speaks of one unknown only: what it says of it, what it is, and why.
    pub unknown: Option<(Var, Dim, Dim, Reason)>,
    /// The equation.
    pub reason: Reason,
}

/// The unknown dimensions of a model and what is known of them.
#[derive(Default)]
pub(super) struct Dimensions {
    solved: Vec<Option<(Dim, Reason)>>,
    waiting: Vec<Vec<usize>>,
    ready: Vec<usize>,
    equations: Vec<Option<(Quantity, Reason)>>,
}

impl Dimensions {
    /// A new unknown dimension.
    pub fn unknown(&mut self) -> Var {
        self.solved.push(None);
        self.waiting.push(Vec::new());
        Var((self.solved.len() - 1) as u32)
    }

    /// What is known of it.
    pub fn value(&self, quantity: &Quantity) -> Option<Dim> {
        match self.put_in(quantity) {
            Quantity::Known(dim, powers) if powers == Powers::NONE => Some(dim),
            _ => None,
        }
    }

    /// The quantity with what is known put in.
    pub fn put_in(&self, quantity: &Quantity) -> Quantity {
        let Quantity::Known(dim, vars) = quantity else { return Quantity::Any };
        let mut sum = *dim;
        let mut open = Powers::NONE;
        for (var, exponent) in vars.as_slice() {
            match self.solved[var.0 as usize].as_ref().map(|(d, _)| d.power(*exponent)) {
                Some(Some(d)) => sum = sum.times(d),
                Some(None) => return Quantity::Any,
                None => open = open.with(*var, *exponent).unwrap_or(open),
            }
        }
        Quantity::Known(sum, open)
    }

    /// Two quantities have one dimension; what that makes known is carried on. Gives a clash if they cannot.
    pub fn equal(&mut self, left: &Quantity, right: &Quantity, reason: &Reason) -> Vec<Clash> {
        if *left == Quantity::Any || *right == Quantity::Any {
            return Vec::new();
        }
        let ratio = left.over(right);
        let mut clashes = Vec::new();
        if let Err(mut clash) = self.say(ratio, reason.clone()) {
            if let (Some(l), Some(r)) = (self.value(left), self.value(right)) {
                (clash.left, clash.right) = (l, r);
            }
            clashes.push(*clash);
        }
        clashes.extend(self.carry_on());
        clashes
    }

    /// The product has no dimension.
    fn say(&mut self, product: Quantity, reason: Reason) -> Result<(), Box<Clash>> {
        let Quantity::Known(dim, open) = self.put_in(&product) else { return Ok(()) };
        match open.as_slice() {
            [] if dim == Dim::NONE => Ok(()),
            [] => Err(Box::new(self.clash(&product, dim, reason))),
            [(var, exponent)] => {
                if let Some(value) = root(dim.inverse(), *exponent) {
                    self.solved[var.0 as usize] = Some((value, reason));
                    let woken = std::mem::take(&mut self.waiting[var.0 as usize]);
                    self.ready.extend(woken);
                }
                Ok(())
            }
            several => {
                let id = self.equations.len();
                for (var, _) in several {
                    self.waiting[var.0 as usize].push(id);
                }
                self.equations.push(Some((product, reason)));
                Ok(())
            }
        }
    }

    fn clash(&self, product: &Quantity, dim: Dim, reason: Reason) -> Clash {
        let unknown = match product {
            Quantity::Known(known, powers) if powers.as_slice().len() == 1 => {
                let (var, exponent) = powers.as_slice()[0];
                let says = root(known.inverse(), exponent);
                let is = self.solved[var.0 as usize].clone();
                says.zip(is).map(|(says, (is, why))| (var, says, is, why))
            }
            _ => None,
        };
        Clash { left: dim, right: Dim::NONE, unknown, reason }
    }

    /// Takes up the equations in which something became known.
    fn carry_on(&mut self) -> Vec<Clash> {
        let mut clashes = Vec::new();
        while let Some(id) = self.ready.pop() {
            if let Some((product, reason)) = self.equations[id].take()
                && let Err(clash) = self.say(product, reason)
            {
                clashes.push(*clash);
            }
        }
        clashes
    }
}

/// The dimension whose power with that exponent (in sixtieths) is given.
fn root(dim: Dim, exponent: i32) -> Option<Dim> {
    let mut result = [0; 7];
    for (r, a) in result.iter_mut().zip(dim.0) {
        let scaled = i64::from(a) * i64::from(WHOLE);
        if scaled % i64::from(exponent) != 0 {
            return None;
        }
        *r = i32::try_from(scaled / i64::from(exponent)).ok()?;
    }
    Some(Dim(result))
}
