//! What a stage gives, as a tree of numbers, texts and rows.

use std::any::{Any, TypeId};

use rustc_hash::FxHashMap;

use super::rule::Rule;

/// A value as what it is made of.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Tree {
    /// A whole number: an id, a place, a length.
    Whole(i64),
    /// A float, by its bits.
    Real(u64),
    /// A text; whole numbers within are numbers.
    Text(Box<str>),
    /// A value that stands for itself: its place in [`Kept`].
    Kept(u32),
    /// A struct, or the variant of an enum with its number.
    Group(u32, Vec<Tree>),
    /// A sequence.
    Row(Vec<Tree>),
    /// What cannot be continued.
    Other,
}

/// Values that are the same in all turns and at all sizes, each once.
#[derive(Debug, Default)]
pub(super) struct Kept {
    all: Vec<Box<dyn Any + Send + Sync>>,
    of_type: FxHashMap<TypeId, Vec<u32>>,
}

impl Kept {
    /// The place of a value, which is added if it is new.
    pub fn keep<T: Any + Clone + PartialEq + Send + Sync>(&mut self, value: &T) -> Tree {
        let known = self.of_type.entry(TypeId::of::<T>()).or_default();
        let is_it = |at: &&u32| self.all[**at as usize].downcast_ref::<T>() == Some(value);
        if let Some(&at) = known.iter().rev().find(is_it) {
            return Tree::Kept(at);
        }
        let at = self.all.len() as u32;
        known.push(at);
        self.all.push(Box::new(value.clone()));
        Tree::Kept(at)
    }

    /// The value in a place.
    fn at<T: Any + Clone>(&self, at: u32) -> Option<T> {
        self.all.get(at as usize)?.downcast_ref::<T>().cloned()
    }
}

/// Where something is made: in which turn, how much larger than the smallest model looked at.
#[derive(Debug, Clone, Copy)]
pub(super) struct At<'k> {
    pub turn: i64,
    pub size: i64,
    pub kept: &'k Kept,
}

/// What can be taken apart, and put together by a rule.
pub(super) trait Part: Sized {
    /// What it is made of.
    fn tree(&self, kept: &mut Kept) -> Tree;
    /// The one that a rule gives; `None` if the rule is one for something else, or what it gives cannot be.
    fn made(rule: &Rule, at: &At<'_>) -> Option<Self>;
}

/// A value that stands for itself.
pub(super) fn kept<T: Any + Clone>(rule: &Rule, at: &At<'_>) -> Option<T> {
    let Rule::Kept(place) = rule else { return None };
    at.kept.at(*place)
}

/// A sequence of parts.
pub(super) fn row<'p, T: Part + 'p>(parts: impl IntoIterator<Item = &'p T>, kept: &mut Kept) -> Tree {
    Tree::Row(parts.into_iter().map(|part| part.tree(kept)).collect())
}

/// Structs and enums are made of their fields.
macro_rules! parts {
    ($($kind:ident $name:ty { $($body:tt)* })*) => { $($crate::continuation::tree::parts!(@$kind $name { $($body)* });)* };
    (@structure $name:ty { $($field:ident),* $(,)? }) => {
        impl Part for $name {
            fn tree(&self, kept: &mut Kept) -> Tree {
                let Self { $($field),* } = self;
                Tree::Group(0, vec![$($field.tree(kept)),*])
            }
            fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
                let (_, [$($field),*]) = rule.group()? else { return None };
                Some(Self { $($field: Part::made($field, at)?),* })
            }
        }
    };
    // The first field is as much work as all others.
    (@halves $name:ty { $first:ident; $($field:ident),* $(,)? }) => {
        impl Part for $name {
            fn tree(&self, kept: &mut Kept) -> Tree {
                let Self { $first, $($field),* } = self;
                Tree::Group(0, vec![$first.tree(kept), $($field.tree(kept)),*])
            }
            fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
                let (_, [$first, $($field),*]) = rule.group()? else { return None };
                let ($first, others) =
                    rayon::join(|| Part::made($first, at), || Some(($(Part::made($field, at)?,)*)));
                let ($($field,)*) = others?;
                Some(Self { $first: $first?, $($field),* })
            }
        }
    };
    (@choice $name:ty { $($variant:ident $(($($part:ident),*))? $({$($field:ident),*})?),* $(,)? }) => {
        impl Part for $name {
            #[allow(unused_variables, reason = "some variants have no parts")]
            #[allow(unused_assignments, reason = "no variant comes after the last")]
            fn tree(&self, kept: &mut Kept) -> Tree {
                let mut number = 0;
                $(
                    if let Self::$variant $(($($part),*))? $({$($field),*})? = self {
                        let parts = vec![$($($part.tree(kept)),*)? $($($field.tree(kept)),*)?];
                        return Tree::Group(number, parts);
                    }
                    number += 1;
                )*
                Tree::Other
            }
            #[allow(unused_variables, reason = "some variants have no parts")]
            #[allow(unused_assignments, reason = "no variant comes after the last")]
            fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
                let (variant, parts) = rule.group()?;
                let mut number = 0;
                $(
                    if variant == number {
                        let [$($($part),*)? $($($field),*)?] = parts else { return None };
                        return Some(Self::$variant $(($(Part::made($part, at)?),*))? $({$($field: Part::made($field, at)?),*})?);
                    }
                    number += 1;
                )*
                None
            }
        }
    };
}

/// Values that stand for themselves.
macro_rules! constants {
    ($($name:ty),* $(,)?) => {
        $(impl Part for $name {
            fn tree(&self, kept: &mut Kept) -> Tree {
                kept.keep(self)
            }
            fn made(rule: &Rule, at: &At<'_>) -> Option<Self> {
                $crate::continuation::tree::kept(rule, at)
            }
        })*
    };
}

/// What cannot be continued.
macro_rules! others {
    ($($name:ty),* $(,)?) => {
        $(impl Part for $name {
            fn tree(&self, _: &mut Kept) -> Tree {
                Tree::Other
            }
            fn made(_: &Rule, _: &At<'_>) -> Option<Self> {
                None
            }
        })*
    };
}

pub(super) use {constants, others, parts};
