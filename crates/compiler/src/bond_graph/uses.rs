//! Where the text uses names, recorded where they are resolved.

use super::families::FamilyId;
use super::scope::{ComponentId, DeclId, Node, Valued};
use crate::span::Span;

/// What a place in the text uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Used {
    /// A value or function.
    Value(DeclId),
    /// Values with indices.
    Values(FamilyId),
    /// An element, instance, port, bond or constraint.
    Node(Node),
    /// A component.
    Component(ComponentId),
}

impl Used {
    /// What a name of values stands for.
    pub fn of(value: Valued) -> Used {
        match value {
            Valued::One(decl) => Used::Value(decl),
            Valued::Family(family) => Used::Values(family),
        }
    }
}

/// The places that use names.
#[derive(Default)]
pub(super) struct Uses {
    pub places: Vec<(Used, Span)>,
    /// Tables by the paths under which they were found.
    pub tables: Vec<(String, Span)>,
    /// What was recorded last, by place: what is repeated uses mostly the same names in each turn.
    last: Vec<Option<(Used, Span)>>,
}

/// How many places are kept in mind.
const LAST: usize = 256;

impl Uses {
    /// A name is used at this place.
    pub fn add(&mut self, used: Used, at: Span) {
        self.last.resize(LAST, None);
        let last = &mut self.last[at.start as usize % LAST];
        if *last != Some((used, at)) {
            *last = Some((used, at));
            self.places.push((used, at));
        }
    }
}
