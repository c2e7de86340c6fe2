//! An order of expressions that depends on names and structure only, never on when they were built.

use super::exprs::Exprs;
use super::node::{Expr, Node, Parts};
use std::cmp::Ordering;

/// Below this depth expressions are compared part by part, beyond it by their hash.
const SHALLOW: u32 = 24;

impl Exprs {
    /// Numbers, pi, symbols by name, powers with their bases, then functions, products, sums; the deep ones last.
    pub(super) fn order(&self, a: Expr, b: Expr) -> Ordering {
        if a == b {
            return Ordering::Equal;
        }
        let ((base_a, n_a), (base_b, n_b)) = (self.base_and_exponent(a), self.base_and_exponent(b));
        if base_a != base_b {
            return self.order_bases(base_a, base_b);
        }
        match (n_a, n_b) {
            (Some(n_a), Some(n_b)) => self.order(n_a, n_b),
            (n_a, n_b) => self.order(n_a.unwrap_or(super::ONE), n_b.unwrap_or(super::ONE)),
        }
    }

    fn base_and_exponent(&self, e: Expr) -> (Expr, Option<Expr>) {
        match self.node(e) {
            Node::Pow(base, n) => (*base, Some(*n)),
            _ => (e, None),
        }
    }

    fn order_bases(&self, a: Expr, b: Expr) -> Ordering {
        let (x, y) = (self.entry(a), self.entry(b));
        if x.depth > SHALLOW || y.depth > SHALLOW {
            return (x.depth, x.hash).cmp(&(y.depth, y.hash)).then(a.cmp(&b));
        }
        rank(&x.node).cmp(&rank(&y.node)).then_with(|| match (&x.node, &y.node) {
            (Node::Number(p), Node::Number(q)) => p.cmp(q),
            (Node::Symbol(p), Node::Symbol(q)) => self.name_order(*p, *q),
            (Node::Call(f, _), Node::Call(g, _)) => f.cmp(g).then_with(|| self.order_children(&x.node, &y.node)),
            (Node::Compare(f, ..), Node::Compare(g, ..)) => {
                f.cmp(g).then_with(|| self.order_children(&x.node, &y.node))
            }
            (Node::Table(f, _), Node::Table(g, _)) | (Node::TableSlope(f, _), Node::TableSlope(g, _)) => {
                f.cmp(g).then_with(|| self.order_children(&x.node, &y.node))
            }
            (Node::Whole(p), Node::Whole(q)) => self.entry(*p).hash.cmp(&self.entry(*q).hash).then(p.cmp(q)),
            (p, q) => self.order_children(p, q),
        })
    }

    fn order_children(&self, a: &Node, b: &Node) -> Ordering {
        let (mut left, mut right) = (Parts::new(), Parts::new());
        a.for_each_child(|c| left.push(c));
        b.for_each_child(|c| right.push(c));
        let first = left.iter().zip(&right).map(|(&p, &q)| self.order(p, q)).find(|o| o.is_ne());
        first.unwrap_or_else(|| left.len().cmp(&right.len()))
    }
}

fn rank(node: &Node) -> u8 {
    match node {
        Node::Number(_) => 0,
        Node::Pi => 1,
        Node::Symbol(_) => 2,
        Node::Pow(..) => 3,
        Node::Call(..) => 4,
        Node::Table(..) => 5,
        Node::TableSlope(..) => 6,
        Node::Mul(_) => 7,
        Node::Add(_) => 8,
        Node::Compare(..) => 9,
        Node::And(..) => 10,
        Node::Or(..) => 11,
        Node::Not(_) => 12,
        Node::Select(..) => 13,
        Node::Whole(_) => 14,
    }
}
