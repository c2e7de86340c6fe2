//! Numbers, texts and containers as parts.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::rule::Rule;
use super::tree::{At, Kept, Part, Tree, constants, row};
use crate::ids::{Id, Map, Table};
use crate::span::Span;
use crate::sparse::SparseMatrix;
use crate::unit::Unit;

constants!(Span, Unit);

macro_rules! whole_numbers {
    ($($name:ty),*) => {
        $(impl Part for $name {
            fn tree(&self, _: &mut Kept) -> Tree {
                i64::try_from(*self).map_or(Tree::Other, Tree::Whole)
            }
            fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
                rule.whole(at)?.try_into().ok()
            }
        })*
    };
}

whole_numbers!(u8, u32, i64, usize);

/// Ids are their numbers.
macro_rules! ids {
    ($($name:ty),* $(,)?) => {
        $(impl Part for $name {
            fn tree(&self, _: &mut Kept) -> Tree {
                Tree::Whole(i64::from(self.0))
            }
            fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
                Some(Self(rule.whole(at)?.try_into().ok()?))
            }
        })*
    };
}

ids!(
    crate::algebra::Symbol,
    crate::algebra::TableId,
    crate::bond_graph::ElementId,
    crate::bond_graph::BondId,
    crate::bond_graph::ParameterId,
    crate::bond_graph::InputId,
    crate::bond_graph::SignalId,
    crate::bond_graph::RepetitionId,
    crate::bond_graph::CellId,
    crate::bond_graph::HeldId,
    crate::program::Value,
    crate::program::BlockId,
    crate::program::ConditionId,
);

impl Part for bool {
    fn tree(&self, _: &mut Kept) -> Tree {
        Tree::Whole(i64::from(*self))
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        match rule.whole(at)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl Part for f64 {
    fn tree(&self, _: &mut Kept) -> Tree {
        Tree::Real(self.to_bits())
    }
    fn made(rule: &Rule, _: &At<'_>) -> Option<Self> {
        rule.real()
    }
}

/// Between the names of a list in a text.
const COMMA: &str = ", ";

/// A text, or a list of them.
impl Part for String {
    fn tree(&self, _: &mut Kept) -> Tree {
        Tree::Row(self.split(COMMA).map(|name| Tree::Text(name.into())).collect())
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        let mut text = String::new();
        let mut is_first = true;
        rule.for_each_entry(at, |rule, at| {
            if !std::mem::take(&mut is_first) {
                text.push_str(COMMA);
            }
            rule.write(&mut text, at)
        })?;
        Some(text)
    }
}

impl Part for Arc<str> {
    fn tree(&self, _: &mut Kept) -> Tree {
        Tree::Text((**self).into())
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        rule.text(at).map(Arc::from)
    }
}

impl<T: Part> Part for Option<T> {
    fn tree(&self, kept: &mut Kept) -> Tree {
        row(self, kept)
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        match rule {
            Rule::Few(none) if none.is_empty() => Some(None),
            Rule::Few(one) if one.len() == 1 => T::made(&one[0], at).map(Some),
            _ => None,
        }
    }
}

impl<T: Part, E: Part> Part for Result<T, E> {
    fn tree(&self, kept: &mut Kept) -> Tree {
        match self {
            Ok(value) => Tree::Group(0, vec![value.tree(kept)]),
            Err(error) => Tree::Group(1, vec![error.tree(kept)]),
        }
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        match rule.group()? {
            (0, [value]) => Some(Ok(T::made(value, at)?)),
            (1, [error]) => Some(Err(E::made(error, at)?)),
            _ => None,
        }
    }
}

impl<T: Part> Part for Box<T> {
    fn tree(&self, kept: &mut Kept) -> Tree {
        (**self).tree(kept)
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        T::made(rule, at).map(Box::new)
    }
}

impl<T: Part> Part for Arc<T> {
    fn tree(&self, kept: &mut Kept) -> Tree {
        (**self).tree(kept)
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        T::made(rule, at).map(Arc::new)
    }
}

impl<A: Part, B: Part> Part for (A, B) {
    fn tree(&self, kept: &mut Kept) -> Tree {
        Tree::Group(0, vec![self.0.tree(kept), self.1.tree(kept)])
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        let (_, [a, b]) = rule.group()? else { return None };
        Some((A::made(a, at)?, B::made(b, at)?))
    }
}

impl<A: Part, B: Part, C: Part> Part for (A, B, C) {
    fn tree(&self, kept: &mut Kept) -> Tree {
        Tree::Group(0, vec![self.0.tree(kept), self.1.tree(kept), self.2.tree(kept)])
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        let (_, [a, b, c]) = rule.group()? else { return None };
        Some((A::made(a, at)?, B::made(b, at)?, C::made(c, at)?))
    }
}

/// The entries of a sequence, put into a container.
pub(super) fn gathered<T: Part>(rule: &Rule, at: &At<'_>) -> Option<Vec<T>> {
    let mut all = Vec::with_capacity(rule.length(at)?);
    rule.for_each_entry(at, |rule, at| {
        all.push(T::made(rule, at)?);
        Some(())
    })?;
    Some(all)
}

impl<T: Part> Part for Vec<T> {
    fn tree(&self, kept: &mut Kept) -> Tree {
        row(self, kept)
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        gathered(rule, at)
    }
}

impl<K: Id, V: Part> Part for Table<K, V> {
    fn tree(&self, kept: &mut Kept) -> Tree {
        row(self.values(), kept)
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        gathered(rule, at).map(Table::from)
    }
}

impl<K: Id + Part, V: Part + Clone> Part for Map<K, V> {
    fn tree(&self, kept: &mut Kept) -> Tree {
        Tree::Row(self.iter().map(|(id, value)| Tree::Group(0, vec![id.tree(kept), value.tree(kept)])).collect())
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        let mut map = Map::with_capacity(rule.length(at)?);
        rule.for_each_entry(at, |rule, at| {
            let (id, value) = Part::made(rule, at)?;
            map.insert(id, value);
            Some(())
        })?;
        Some(map)
    }
}

impl<K: Ord + Part, V: Part> Part for BTreeMap<K, V> {
    fn tree(&self, kept: &mut Kept) -> Tree {
        Tree::Row(self.iter().map(|(key, value)| Tree::Group(0, vec![key.tree(kept), value.tree(kept)])).collect())
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        // Keys in order: the map is built from the bottom up.
        gathered(rule, at).map(BTreeMap::from_iter)
    }
}

impl<T: Part> Part for SparseMatrix<T> {
    fn tree(&self, kept: &mut Kept) -> Tree {
        let mut entry = |(column, e): (usize, &T)| Tree::Group(0, vec![column.tree(kept), e.tree(kept)]);
        Tree::Row(self.rows().map(|row| Tree::Row(row.map(&mut entry).collect())).collect())
    }
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
        let rows: Vec<Vec<(usize, T)>> = gathered(rule, at)?;
        let (size, ascend) = (rows.len(), |row: &Vec<(usize, T)>| row.windows(2).all(|two| two[0].0 < two[1].0));
        rows.iter().all(|row| ascend(row) && row.last().is_none_or(|e| e.0 < size)).then(|| SparseMatrix::new(rows))
    }
}
