//! Names with indices: their elements, found by their indices in one step.

use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::fmt::Write;

use crate::ast;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// Indices of an element; none of what has none.
pub(super) type Indices = SmallVec<[i64; 2]>;

/// Index of a [`Family`].
pub(super) type FamilyId = usize;

/// Elements by their indices: those that follow each other by one index in a row, others in a table.
struct Elements<T> {
    /// The index of the first in the row.
    first: i64,
    row: Vec<T>,
    others: FxHashMap<Indices, T>,
}

impl<T> Default for Elements<T> {
    fn default() -> Self {
        Elements { first: 0, row: Vec::new(), others: FxHashMap::default() }
    }
}

impl<T> Elements<T> {
    fn get(&self, indices: &[i64]) -> Option<&T> {
        let in_row = |index: i64| self.row.get(usize::try_from(index.checked_sub(self.first)?).ok()?);
        match indices {
            [index] => in_row(*index).or_else(|| self.others.get(indices)),
            _ => self.others.get(indices),
        }
    }

    /// Adds one that is not there.
    fn insert(&mut self, indices: &[i64], element: T) {
        match indices {
            [index] if self.is_empty() || self.first.checked_add(self.row.len() as i64) == Some(*index) => {
                if self.row.is_empty() {
                    self.first = *index;
                }
                self.row.push(element);
            }
            _ => _ = self.others.insert(indices.into(), element),
        }
    }

    fn len(&self) -> usize {
        self.row.len() + self.others.len()
    }

    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn iter(&self) -> impl Iterator<Item = (Indices, &T)> {
        let row = self.row.iter().zip(self.first..).map(|(element, index)| (Indices::from_slice(&[index]), element));
        row.chain(self.others.iter().map(|(indices, element)| (indices.clone(), element)))
    }
}

/// What a name with indices stands for.
pub(super) struct Family<T> {
    /// Its elements.
    elements: Elements<T>,
    /// Least and greatest value of each index.
    ranges: Vec<(i64, i64)>,
    /// Where the first is declared.
    pub span: Span,
}

impl<T> Family<T> {
    /// Whether an element of these indices belongs to it.
    pub fn takes(&self, indices: &[i64]) -> bool {
        self.ranges.len() == indices.len()
    }

    /// The element of these indices.
    pub fn element(&self, indices: &[i64]) -> Option<&T> {
        self.elements.get(indices)
    }

    /// Whether its elements have the indices 1 to 3 at most, and at least so many.
    pub fn is_row(&self, least: usize) -> bool {
        self.row().is_some_and(|length| (least..=3).contains(&length))
    }

    /// How many elements there are, if they stand in a row from 1.
    pub fn row(&self) -> Option<usize> {
        match self.ranges.as_slice() {
            [(1, last)] if *last == self.elements.len() as i64 => Some(self.elements.len()),
            _ => None,
        }
    }

    /// How many elements there are each way, if all of them are there from 1.
    pub fn shape(&self) -> Option<Vec<usize>> {
        let whole = self.ranges.iter().map(|(_, high)| usize::try_from(*high).ok()).collect::<Option<Vec<_>>>()?;
        let full = whole.iter().product::<usize>() == self.elements.len();
        (full && self.ranges.iter().all(|(low, _)| *low == 1)).then_some(whole)
    }

    /// How many indices it has.
    pub fn rank(&self) -> usize {
        self.ranges.len()
    }

    /// All its elements, in the order of their indices.
    pub fn all(&self) -> impl Iterator<Item = &T> {
        let mut all: Vec<_> = self.elements.iter().collect();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all.into_iter().map(|(_, element)| element)
    }

    /// One of its elements, that of the least indices.
    pub fn first(&self) -> Option<&T> {
        self.elements.iter().min_by(|a, b| a.0.cmp(&b.0)).map(|(_, element)| element)
    }

    /// Whether both have elements of the same indices, as far as their ranges tell.
    pub fn is_like<S>(&self, other: &Family<S>) -> bool {
        self.ranges == other.ranges && self.elements.len() == other.elements.len()
    }

    /// Which elements there are, in words.
    pub fn words(&self, name: &str) -> String {
        if self.elements.is_empty() {
            return format!("`{name}` has no elements");
        }
        let range = |&(low, high): &(i64, i64)| if low == high { low.to_string() } else { format!("{low}..{high}") };
        let ranges: Vec<String> = self.ranges.iter().map(range).collect();
        let whole = self.ranges.iter().map(|(low, high)| (high - low + 1) as usize).product::<usize>();
        let some = if whole == self.elements.len() { "" } else { ", not all of them" };
        format!("there is `{name}[{}]`{some}", ranges.join(","))
    }

    /// The name of an element for an example.
    pub fn example(&self, name: &str) -> String {
        spelled(name, &self.ranges.iter().map(|(low, _)| *low).collect::<Vec<_>>())
    }
}

/// The families of one namespace.
pub(super) struct Families<T>(Vec<Family<T>>);

impl<T> Default for Families<T> {
    fn default() -> Self {
        Families(Vec::new())
    }
}

impl<T> std::ops::Index<FamilyId> for Families<T> {
    type Output = Family<T>;
    fn index(&self, id: FamilyId) -> &Family<T> {
        &self.0[id]
    }
}

impl<T: Copy> Families<T> {
    /// A family without elements.
    pub fn open(&mut self, indices: usize, span: Span) -> FamilyId {
        self.0.push(Family { elements: Elements::default(), ranges: vec![(i64::MAX, i64::MIN); indices], span });
        self.0.len() - 1
    }

    /// Adds an element, unless there is one of these indices, which is given back.
    pub fn add(&mut self, family: FamilyId, indices: &[i64], element: T) -> Option<T> {
        let family = &mut self.0[family];
        if let Some(first) = family.elements.get(indices) {
            return Some(*first);
        }
        for (range, index) in family.ranges.iter_mut().zip(indices) {
            *range = (range.0.min(*index), range.1.max(*index));
        }
        family.elements.insert(indices, element);
        None
    }

    /// The element of these indices, which stand behind this name.
    pub fn get(&self, family: FamilyId, name: &ast::Name, indices: &[i64]) -> Result<&T, Box<Diagnostic>> {
        let family = &self.0[family];
        family.element(indices).ok_or_else(|| Box::new(missing(family, name, indices)))
    }
}

/// The diagnostic for an element that is not there.
fn missing<T>(family: &Family<T>, name: &ast::Name, indices: &[i64]) -> Diagnostic {
    let text = name.text.as_str();
    if indices.is_empty() {
        let d = Diagnostic::error(codes::N021, format!("`{text}` has indices"), name.span, "which one?");
        return d
            .also(family.span, "declared here")
            .note(family.words(text))
            .hint(format!("write `{}`", family.example(text)));
    }
    let title = format!("there is no `{}`", spelled(text, indices));
    let d = Diagnostic::error(codes::N021, title, name.span, "no such element").also(family.span, "declared here");
    let d = d.note(family.words(text));
    match family.takes(indices) {
        true => d.hint("use an index that is there; at the ends of a row, leave something out: `if i > 1 { … }`"),
        false => d.hint(format!("it has {}, as in `{}`", count(family.ranges.len()), family.example(text))),
    }
}

fn count(indices: usize) -> String {
    if indices == 1 { "one index".to_string() } else { format!("{indices} indices") }
}

/// A name with its indices as it stands in results: `spring[3]`, `node[1,2]`.
pub(super) fn spelled(name: &str, indices: &[i64]) -> String {
    let mut full = String::with_capacity(name.len() + 8 * indices.len());
    spell(&mut full, name, indices);
    full
}

/// Adds a name with its indices to a text.
pub(super) fn spell(out: &mut String, name: &str, indices: &[i64]) {
    out.push_str(name);
    for (i, index) in indices.iter().enumerate() {
        out.push(if i == 0 { '[' } else { ',' });
        write!(out, "{index}").expect("a string takes any text");
    }
    if !indices.is_empty() {
        out.push(']');
    }
}
