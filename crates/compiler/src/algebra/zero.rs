//! Whether an expression is zero whatever its symbols are.

use super::exprs::Exprs;
use super::fingerprint::{GENERIC, GIVEN, POISON};
use super::node::Expr;
use std::ops::Range;

impl Exprs {
    /// Whether the expression is zero for all values of its symbols (up to a probability of about 2^-60).
    pub fn is_zero(&self, e: Expr) -> bool {
        self.is_zero_in(e, GENERIC)
    }

    /// Whether the expression is zero at the given parameters, for all values of what is not given.
    pub fn is_zero_given(&self, e: Expr) -> bool {
        self.is_zero_in(e, GIVEN)
    }

    fn is_zero_in(&self, e: Expr, lanes: Range<usize>) -> bool {
        self.fingerprint(e)[lanes].iter().all(|&v| v == 0 && v != POISON)
    }
}
