//! Files of C in fragments, each with what it needs: what nobody needs is left out.

use std::collections::{BTreeMap, BTreeSet};

use super::function::Function;
use super::written::{FragmentName, Written};

/// What a fragment is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Kind {
    /// What always stands.
    Always,
    /// A heading, which stands where something stands under it.
    Section,
    /// A function, table or macro, which stands where something needs it.
    Item(FragmentName),
    /// Such an item by which a mode of the model is entered: where modes differ in it, it calls that of the present one.
    Entry(FragmentName),
    /// A function of the header, which always stands and is an entry as well.
    Public(FragmentName),
}

impl Kind {
    /// The name of an item.
    pub fn item(&self) -> Option<&FragmentName> {
        match self {
            Kind::Item(name) | Kind::Entry(name) => Some(name),
            Kind::Always | Kind::Section | Kind::Public(_) => None,
        }
    }
}

/// A piece of a file.
#[derive(Debug, Clone)]
pub(crate) struct Fragment {
    pub kind: Kind,
    /// Whether a line before it is empty.
    gap: bool,
    /// Its lines.
    pub text: String,
    /// Whether one behind it is.
    gap_behind: bool,
    /// The items that it needs.
    pub needs: BTreeSet<FragmentName>,
}

impl Fragment {
    /// One without lines.
    pub fn new(kind: Kind) -> Fragment {
        Fragment { kind, gap: false, text: String::new(), gap_behind: false, needs: BTreeSet::new() }
    }

    /// A heading.
    pub fn section(title: &str) -> Fragment {
        let text = format!("/* ---- {title} ---- */\n");
        Fragment { gap: true, text, gap_behind: true, ..Fragment::new(Kind::Section) }
    }

    /// A function or table, with empty lines around it.
    pub fn item(name: FragmentName, text: String, needs: BTreeSet<FragmentName>) -> Fragment {
        Fragment { kind: Kind::Item(name), gap: true, text, gap_behind: true, needs }
    }

    /// One line more, or several in one; of empty ones, never two.
    pub fn line(&mut self, line: &Written) {
        if line.text.is_empty() {
            self.gap |= self.text.is_empty();
            self.gap_behind = !self.text.is_empty();
        } else {
            self.text += if self.gap_behind { "\n" } else { "" };
            self.gap_behind = false;
            self.text += &line.text;
            self.text.push('\n');
            self.needs.extend(line.notes.needs.iter().cloned());
        }
    }
}

impl From<Function> for Fragment {
    fn from(f: Function) -> Fragment {
        Fragment::item(f.name.into(), f.text, f.needs)
    }
}

/// The file that fragments make, without items that nothing in it needs.
pub(crate) fn assembled(fragments: &[Fragment]) -> String {
    let needed = needed(fragments);
    let stands = |f: &Fragment| match &f.kind {
        Kind::Always | Kind::Public(_) => !f.text.is_empty(),
        Kind::Section => false,
        Kind::Item(name) | Kind::Entry(name) => needed.contains(name),
    };
    let mut text = String::new();
    let mut gap = false;
    for (i, fragment) in fragments.iter().enumerate() {
        let under = || fragments[i + 1..].iter().take_while(|f| f.kind != Kind::Section).any(stands);
        gap |= fragment.gap;
        if stands(fragment) || (fragment.kind == Kind::Section && under()) {
            text += if gap && !text.is_empty() { "\n" } else { "" };
            text += &fragment.text;
            gap = false;
        }
        gap |= fragment.gap_behind;
    }
    text
}

/// The items that what always stands needs, and those that they need.
fn needed(fragments: &[Fragment]) -> BTreeSet<&FragmentName> {
    let mut items: BTreeMap<&FragmentName, Vec<&Fragment>> = BTreeMap::new();
    for fragment in fragments {
        if let Some(name) = fragment.kind.item() {
            items.entry(name).or_default().push(fragment);
        }
    }
    let mut needed = BTreeSet::new();
    let mut open: Vec<&Fragment> =
        fragments.iter().filter(|f| matches!(f.kind, Kind::Always | Kind::Public(_))).collect();
    while let Some(fragment) = open.pop() {
        for name in &fragment.needs {
            if needed.insert(name) {
                open.extend(items.get(name).into_iter().flatten());
            }
        }
    }
    needed
}
