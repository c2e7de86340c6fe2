//! Programs as parts.

use super::rule::Rule;
use super::tree::{At, Kept, Part, Tree, constants, others, parts};
use crate::algebra::Holds;
use crate::equations::{DomainKind, Exchanged, Exchanges, ObservedKind, Unavailable, Unkept, UnkeptRelation};
use crate::program::{ListedValues, *};
use crate::sparse::SparseMatrix;

constants!(Holds, DomainKind, ObservedKind, ConditionKind, EventTrigger, Measure);
others!(SetValued);

parts! {
    structure Program {
        name, values, blocks, conditions, tables, parameters, inputs, held, clauses, set_valued, jumps, states, positions,
        implicit, variables, tracked, momenta, kept, conserved, replaced, exchanges, relations, position_relations,
        unkept_relations, observed, start, guesses, pivot_guards, domains, assumptions, steep, dependence,
    }
    structure Parameter { name, default, constant, shapes, kind, unit }
    structure Input { name, default, unit, deduced }
    structure HeldSignal { name, source, time, kind }
    structure Implicit { explicit, differential, indices, carried }
    structure State { name, rate, unit }
    structure Relations { rows, drives, unwritten }
    structure Moved { quantity, by }
    structure PositionRelation { value, vanishes, slopes, told }
    structure Position { name, symbol, rate, value, block, unknown }
    structure Observed { name, value, unit, kind, default }
    structure StartCondition { name, residual, asked, firm, weak, reads, span }
    structure StartGuess { name, asked, residual, unknown, reads, span }
    structure PivotGuard { pivot, scale, elements, divisor }
    structure Assumption { value, scale, holds, text }
    structure LawDomain { given, elements, argument, kind, asked, limit }
    structure Condition { operand, kind, trigger }
    choice Block {
        Linear { matrix, right, shared, elements },
        Newton { residuals, jacobian, unknowns, elements },
    }
    structure Clause { name, trigger, actions, bound, span }
    structure Bound { law, next, margin, measure, gap, closed }
    choice Trigger { Becomes(value), Every(value) }
    structure Action { name, target, value }
    choice Target { Discrete(id), Signal(id), Moved { what, impulse }, HeldByBranch }
    structure Jumps { stored, storages, balances, unknowns, impulses, leaps }
    structure Impulse { held, along }
    structure Exchanges { independent, dependent }
    structure Exchanged { symbol, told_by, weight }
    structure UnkeptRelation { text, reason }
    choice Unkept { Nonholonomic, NoClosedForm, Undecided, Reads(text) }
    choice Unavailable { Undetermined, NeedsRateOf(input), NeedsRateOfUnknown(unknown), Unsolvable }
}

impl Part for Reads {
    fn tree(&self, kept: &mut Kept) -> Tree {
        self.bits().tree(kept)
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        u8::made(rule, at).map(Reads::of_bits)
    }
}

/// A number of a program; as in graphs none grows.
impl Part for Bits {
    fn tree(&self, _: &mut Kept) -> Tree {
        Tree::Real(self.number().to_bits())
    }
    fn made(rule: &Rule, _: &At<'_>) -> Option<Self> {
        rule.real().map(Bits::of)
    }
}

impl Part for Values {
    fn tree(&self, kept: &mut Kept) -> Tree {
        let entry = |(value, op): (Value, Op)| Tree::Group(0, vec![op.tree(kept), self.reads(value).tree(kept)]);
        Tree::Row(self.iter().map(entry).collect())
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        let mut values = ListedValues::of(rule.length(at)?);
        rule.for_each_entry(at, |rule, at| {
            let (op, reads) = Part::made(rule, at)?;
            values.add(op, reads)
        })?;
        Some(values.finish())
    }
}

/// Where its factors have entries follows from where it has some.
impl Part for Matrix {
    fn tree(&self, kept: &mut Kept) -> Tree {
        self.values.tree(kept)
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        SparseMatrix::made(rule, at).map(Matrix::new)
    }
}

macro_rules! operations {
    (($k:ident $value:ident)
     given { $($(#[$given_doc:meta])* $given:ident$(($($given_part:ident: $given_kind:ty),*))?;)* }
     plain { $($(#[$plain_doc:meta])* $plain:ident($($part:ident: $kind:ty),*) [$($a:ident $da:ident $A:ident),*] {
        $($plain_rest:tt)*
     })* }
     held { $($(#[$held_doc:meta])* $held:ident($($held_part:ident: $held_kind:ty),*) [$x:ident $dx:ident $X:ident] {
        $($held_rest:tt)*
     })* }) => {
        parts! {
            choice Op {
                $($given $(($($given_part),*))?,)*
                $($plain($($part,)* $($a),*),)*
                $($held($($held_part,)* $x),)*
            }
        }
    };
}

crate::for_each_op!(operations);
