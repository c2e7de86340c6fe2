//! Simple cycles of a digraph: Johnson's algorithm, without recursion, with a limit.

use std::collections::BTreeSet;

use crate::causal_graph::break_set::{cyclic_components, restrict};

/// Cycles as lists of vertices, and whether these are all.
#[derive(Debug, Default)]
pub(super) struct Cycles {
    /// Each cycle once, from its lowest vertex.
    pub cycles: Vec<Vec<usize>>,
    /// Whether the limit was not hit.
    pub complete: bool,
}

/// The simple cycles, at most `limit`. Time linear in the size of the graph for each cycle found.
pub(super) fn simple_cycles(successors: &[Vec<u32>], limit: usize) -> Cycles {
    let mut found = Cycles { cycles: Vec::new(), complete: true };
    let mut components = cyclic_components(successors);
    components.reverse();
    while let Some(component) = components.pop() {
        let part = restrict(successors, &component);
        let through = cycles_through(&part, 0, limit - found.cycles.len());
        found.cycles.extend(through.cycles.iter().map(|cycle| cycle.iter().map(|&v| component[v]).collect()));
        if !through.complete {
            return Cycles { complete: false, ..found };
        }
        let rest = restrict(successors, &component[1..]);
        let parts = cyclic_components(&rest).into_iter().rev();
        components.extend(parts.map(|part| part.into_iter().map(|v| component[v + 1]).collect()));
    }
    found
}

/// The simple cycles through `start`, at most `limit`.
pub(super) fn cycles_through(successors: &[Vec<u32>], start: usize, limit: usize) -> Cycles {
    let mut search = Search {
        successors,
        path: vec![start],
        next: vec![0],
        blocked: vec![false; successors.len()],
        waiting: vec![BTreeSet::new(); successors.len()],
        closed: vec![false; successors.len()],
    };
    search.blocked[start] = true;
    let mut found = Cycles { cycles: Vec::new(), complete: true };
    while let Some(cycle) = search.advance(start) {
        if found.cycles.len() == limit {
            found.complete = false;
            break;
        }
        found.cycles.push(cycle);
    }
    found
}

struct Search<'a> {
    successors: &'a [Vec<u32>],
    path: Vec<usize>,
    /// For each vertex of the path, the next edge to try.
    next: Vec<usize>,
    blocked: Vec<bool>,
    /// Who is unblocked together with a vertex.
    waiting: Vec<BTreeSet<usize>>,
    /// Whether a cycle was closed through a vertex of the path.
    closed: Vec<bool>,
}

impl Search<'_> {
    /// Goes on to the next cycle.
    fn advance(&mut self, start: usize) -> Option<Vec<usize>> {
        while let Some(&v) = self.path.last() {
            let edge = self.next.last_mut().expect("as long as the path");
            let Some(&w) = self.successors[v].get(*edge) else {
                self.retreat(v);
                continue;
            };
            *edge += 1;
            let w = w as usize;
            if w == start {
                self.path.iter().for_each(|&u| self.closed[u] = true);
                return Some(self.path.clone());
            }
            if !self.blocked[w] {
                self.path.push(w);
                self.next.push(0);
                self.closed[w] = false;
                self.blocked[w] = true;
            }
        }
        None
    }

    fn retreat(&mut self, v: usize) {
        self.path.pop();
        self.next.pop();
        if self.closed[v] {
            self.unblock(v);
            return;
        }
        for &w in &self.successors[v] {
            self.waiting[w as usize].insert(v);
        }
    }

    fn unblock(&mut self, v: usize) {
        let mut todo = vec![v];
        while let Some(u) = todo.pop() {
            if std::mem::take(&mut self.blocked[u]) {
                todo.extend(std::mem::take(&mut self.waiting[u]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_complete_digraph_has_all_its_cycles() {
        let n = 5u32;
        let successors: Vec<Vec<u32>> = (0..n).map(|v| (0..n).filter(|&w| w != v).collect()).collect();
        let found = simple_cycles(&successors, 1000);
        // Choose k of 5 and order them cyclically: 10 + 20 + 30 + 24.
        assert_eq!((found.cycles.len(), found.complete), (84, true));
        let distinct: BTreeSet<_> = found.cycles.iter().collect();
        assert_eq!(distinct.len(), 84);
    }

    #[test]
    fn the_limit_is_kept() {
        let successors: Vec<Vec<u32>> = (0..8).map(|v| (0..8).filter(|&w| w != v).collect()).collect();
        let found = simple_cycles(&successors, 10);
        assert_eq!((found.cycles.len(), found.complete), (10, false));
    }

    #[test]
    fn loops_and_separate_parts() {
        let found = simple_cycles(&[vec![0, 1], vec![0], vec![3], vec![2, 4], vec![]], 10);
        assert_eq!(found.cycles, [vec![0], vec![0, 1], vec![2, 3]]);
        assert!(found.complete);
    }
}
