//! Models of many equal cells: what a stage gives for three sizes that follow each other is continued to the size asked for.
//!
//! A parameter that [counts] the turns of a repetition makes a family of models, one for each number of turns, all with the
//! values that the model itself has. What is made far from the ends of the repetition is made of the same text in the same
//! way, so the graphs, and the programs, of three sizes tell those of all: each sequence in them is a few entries that stand
//! alone and a few that come again turn by turn, each place a straight line in the turn and in the size (`rule.rs`). A rule has
//! to give the three it was found from exactly, and one much larger, in which names have more digits and each turn has left
//! both ends behind; where it does not, or the text is none of a family, there is no continuation, and the model is compiled
//! as it stands.

mod graph;
mod parts;
mod program;
mod rule;
mod segments;
#[cfg(test)]
mod tests;
mod tree;

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::ast::{Count, counts};
use crate::bond_graph::{BondGraph, Counting, MAX_TURNS, Name, NameKind};
use crate::causal_graph::assign_causality;
use crate::compile::{Found, Reached, Read, Text, bond_graph_counting, read};
use crate::diagnostic::Sources;
use crate::equations::{Form, derive_equations};
use crate::program::{Program, schedule};
use rule::Rule;
use tree::{At, Kept, Part, Tree, constants, parts};

constants!(NameKind);

parts! {
    structure Name { name, kind, declared, uses }
}

/// The size of the smallest model that is looked at: the first; the last where that tells nothing, since the text reaches
/// further, or parts of some hundred variables are gone through in other ways than small ones.
const SMALLEST: [i64; 2] = [16, 104];
/// How far from the ends the text may reach where these are the smallest: twice, by an end of a repetition and from there, from
/// both ends, and the largest of those looked at has cells between.
const NEAR: [i64; 2] = [16, 32];
/// The sizes of models that are looked at differ by this much: what goes on from both ends of a repetition meets in the middle.
const STEP: i64 = 2;
/// The least size of the one that a rule is tried on: names of cells have three digits there.
const TRIED: i64 = 104;
/// Models are this much larger than the one it is tried on, or are compiled as they stand.
const LARGER: i64 = 8;

/// Models of one text that differ in the number of their cells: of three sizes that follow each other, and of one that is much
/// larger.
#[derive(Debug)]
pub struct Family {
    members: Vec<Member>,
    steps: Steps,
    /// Which of the smallest sizes its members begin with.
    smallest: usize,
    /// The texts of the model.
    sources: Sources,
}

/// Its graph, and the names in its text.
type Member = (Arc<BondGraph>, Arc<Vec<Name>>);

/// How many steps in size each member is larger than the first, and how many the model that is asked for.
#[derive(Debug, Clone, Copy)]
struct Steps {
    members: [i64; 4],
    wanted: i64,
}

impl Family {
    /// The family of a model; `None` if there is none, or the model is hardly larger than what would be looked at.
    pub fn of(text: Text<'_>, read: &Read) -> Option<Family> {
        (0..SMALLEST.len()).find_map(|smallest| Family::from(text, read, smallest))
    }

    /// The same family by the largest members, if these are smaller.
    pub fn larger(&self, text: Text<'_>, read: &Read) -> Option<Family> {
        let last = SMALLEST.len() - 1;
        (self.smallest < last).then(|| Family::from(text, read, last))?
    }

    fn from(text: Text<'_>, read: &Read, smallest: usize) -> Option<Family> {
        let sized = Sized::of(text, read)?;
        let (first, steps) = sized.steps(smallest)?;
        let (mut members, mut sources) = (Vec::new(), None);
        for step in steps.members {
            let Reached { ir, found } = sized.member(first + STEP * step, NEAR[smallest])?;
            if !sized.is_all_that_shapes(&ir) || !are_alike(&ir, NEAR[smallest] as usize) {
                return None;
            }
            sources = Some(found.sources);
            members.push((Arc::new(ir), found.names));
        }
        Some(Family { members, steps, smallest, sources: sources? })
    }

    /// The model itself as the continuation of smaller ones.
    pub fn bond_graph(&self) -> Option<Reached<BondGraph>> {
        let (graph, names) = self.continued(|at| Some(self.members[at].clone()))?;
        let found = Found { names, sources: self.sources.clone(), ..Found::default() };
        Some(Reached { ir: Arc::unwrap_or_clone(graph), found })
    }

    /// The program of the model in a form as the continuation of those of smaller ones, if there is one.
    pub fn program(&self, form: Form) -> Option<Program> {
        self.continued(|at| {
            let equations = derive_equations(&assign_causality(&self.members[at].0).ok()?, form).ok()?;
            // States that are sums of what storages hold have names of their own in other modes of a run.
            let is_plain = equations.meanings.is_empty() && equations.conserved.is_empty();
            is_plain.then(|| schedule(&equations))
        })
    }

    /// What the rule of three members gives for the model that is asked for, if it gives the fourth.
    fn continued<T: Part>(&self, mut member: impl FnMut(usize) -> Option<T>) -> Option<T> {
        let Steps { members, wanted } = self.steps;
        let mut kept = Kept::default();
        let mut tree = |at: usize| member(at).map(|member| member.tree(&mut kept));
        let rule = Rule::learned([&tree(0)?, &tree(1)?, &tree(2)?])?;
        let is_right = rule.gives(&tree(3)?, 0, members[3]);
        is_right.then(|| T::made(&rule, &At { turn: 0, size: wanted, kept: &kept }))?
    }
}

/// A model, and what counts its cells.
struct Sized<'t> {
    text: Text<'t>,
    count: Count,
    /// How many there are.
    size: i64,
}

impl<'t> Sized<'t> {
    /// By the parameter with the greatest value, of those that count.
    fn of(text: Text<'t>, read: &Read) -> Option<Sized<'t>> {
        // An element of an array that has a value of its own is one far into the cells.
        if text.overrides.iter().any(|set| set.name.contains('[')) {
            return None;
        }
        let sized = counts(read.ast()).into_iter().filter_map(|count| {
            let set = text.overrides.iter().rfind(|set| set.name.trim() == count.name);
            let size = set.map_or(Some(count.value), |set| set.value.trim().parse().ok())?;
            Some(Sized { text, size, count })
        });
        sized.max_by_key(|sized| sized.size)
    }

    /// The size of the smallest member, and how much larger the others are; `None` if the model itself is not much larger.
    fn steps(&self, smallest: usize) -> Option<(i64, Steps)> {
        let odd = self.size.rem_euclid(STEP);
        let first = SMALLEST.get(smallest)? / STEP * STEP + odd;
        let tried = TRIED.max(2 * first) / STEP * STEP + odd;
        let steps = Steps { members: [0, 1, 2, (tried - first) / STEP], wanted: (self.size - first) / STEP };
        (LARGER * tried..=MAX_TURNS as i64).contains(&self.size).then_some((first, steps))
    }

    /// The model with so many cells, each as in the model itself, if there is nothing to be said of it, and its text reaches no
    /// further into the cells than this.
    fn member(&self, size: i64, near: i64) -> Option<Reached<BondGraph>> {
        let counting = Counting { name: &self.count.name, turns: size, wanted: self.size, near };
        let member = bond_graph_counting(read(self.text), self.text, Some(counting)).ok()?;
        member.found.diagnostics.0.is_empty().then_some(member)
    }

    /// Whether no number but the size, and such as stand in the text for all cells alike, decides what there is in a member.
    fn is_all_that_shapes(&self, member: &BondGraph) -> bool {
        let mut others = member.parameters.values().filter(|p| p.shapes && p.name != self.count.name);
        others.all(|p| !p.name.contains(['[', '.']))
    }
}

/// Whether the parameters of all cells have the same values: what follows from values that grow from cell to cell is otherwise
/// where they are greater. Few may differ.
fn are_alike(member: &BondGraph, near: usize) -> bool {
    let mut of_name: FxHashMap<String, (usize, Option<f64>, bool)> = FxHashMap::default();
    for parameter in member.parameters.values().filter(|p| p.name.contains('[')) {
        let value = member.exprs.given_value(parameter.value);
        let (count, first, alike) = of_name.entry(without_indices(&parameter.name)).or_insert((0, value, true));
        *count += 1;
        *alike &= value == *first && value.is_some();
    }
    of_name.values().all(|&(count, _, alike)| alike || count <= near)
}

/// `cell[3].r` as `cell[].r`.
fn without_indices(name: &str) -> String {
    let mut inside = false;
    let kept = name.chars().filter(|&letter| {
        let kept = !inside || letter == ']';
        inside = if letter == '[' { true } else { inside && letter != ']' };
        kept
    });
    kept.collect()
}
