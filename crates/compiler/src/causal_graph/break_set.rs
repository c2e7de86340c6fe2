//! Minimum sets of break variables: the fewest vertices of a digraph that meet every cycle.
//!
//! Exact by reduction, then branch and bound ([`EXACT_KERNEL`] vertices left after reduction are always solved exactly,
//! larger kernels while a step budget lasts); beyond that a heuristic with a proven lower bound. The reductions are
//! those of Levy and Low. Everything is deterministic. Source: `method.md`, section 3.

use std::collections::{BTreeSet, VecDeque};

/// Kernels (what is left of a component after reduction) up to this many vertices are always solved exactly.
pub const EXACT_KERNEL: usize = 30;
/// Kernels up to this many vertices are tried exactly within a step budget.
const BITS: usize = 64;
/// Branch-and-bound steps allowed for kernels above [`EXACT_KERNEL`].
const BUDGET: usize = 50_000;

/// A set of vertices that meets every cycle.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct BreakSet {
    /// The vertices, ascending. No vertex can be left out.
    pub vertices: Vec<usize>,
    /// A proven lower bound on the size of any such set.
    pub lower_bound: usize,
    /// Whether the set is proven to be a smallest one.
    pub exact: bool,
}

/// The strongly connected components that hold a cycle, each ascending, in order of their first vertices.
///
/// `successors[v]` lists the heads of the edges that leave vertex `v`. Linear time.
pub fn cyclic_components(successors: &[Vec<u32>]) -> Vec<Vec<usize>> {
    let mut components = components(successors);
    components.retain(|c| c.len() > 1 || successors[c[0]].contains(&(c[0] as u32)));
    components.sort_unstable();
    components
}

/// A smallest set of vertices that meets every cycle; among equally small ones, vertices of low `rank`, then of low
/// index, are preferred (by exchange of single vertices).
pub fn break_set(successors: &[Vec<u32>], rank: &[u8]) -> BreakSet {
    let mut whole = BreakSet { exact: true, ..BreakSet::default() };
    for component in cyclic_components(successors) {
        let part = component_break_set(&restrict(successors, &component), |v| rank[component[v]]);
        whole.vertices.extend(part.vertices.iter().map(|&v| component[v]));
        whole.lower_bound += part.lower_bound;
        whole.exact &= part.exact;
    }
    whole.vertices.sort_unstable();
    whole
}

/// Edges through a vertex that are drawn from end to end, at most: a vertex with more of them stays.
const DRAWN_THROUGH: usize = 64;

/// The graph with vertices for which `passed` holds passed over: what leads to one leads to what follows it. Cycles stay
/// cycles. Vertices that are cycles by themselves then, and those with very many neighbours, stay as they are.
pub fn passed_over(successors: &[Vec<u32>], passed: impl Fn(usize) -> bool) -> Vec<Vec<u32>> {
    let n = successors.len();
    let mut next: Vec<BTreeSet<usize>> = successors.iter().map(|s| s.iter().map(|&w| w as usize).collect()).collect();
    let mut before: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); n];
    next.iter().enumerate().for_each(|(v, s)| s.iter().for_each(|&w| _ = before[w].insert(v)));
    let edges = |next: &[BTreeSet<usize>], before: &[BTreeSet<usize>], v: usize| next[v].len() * before[v].len();
    let mut queue: BTreeSet<(usize, usize)> =
        (0..n).filter(|&v| passed(v)).map(|v| (edges(&next, &before, v), v)).collect();
    while let Some((_, v)) = queue.pop_first() {
        if next[v].contains(&v) || edges(&next, &before, v) > DRAWN_THROUGH {
            continue;
        }
        let (to, from) = (std::mem::take(&mut next[v]), std::mem::take(&mut before[v]));
        let around: BTreeSet<usize> = to.union(&from).copied().collect();
        around.iter().for_each(|&w| _ = queue.remove(&(edges(&next, &before, w), w)));
        to.iter().for_each(|&w| _ = before[w].remove(&v));
        for &u in &from {
            next[u].remove(&v);
            for &w in &to {
                next[u].insert(w);
                before[w].insert(u);
            }
        }
        let open = around.into_iter().filter(|&w| passed(w) && !(next[w].is_empty() && before[w].is_empty()));
        queue.extend(open.map(|w| (edges(&next, &before, w), w)));
    }
    next.into_iter().map(|s| s.into_iter().map(|w| w as u32).collect()).collect()
}

/// The size of a smallest set of vertices that meets every cycle (of a good one, for kernels above [`EXACT_KERNEL`]).
pub fn count(successors: &[Vec<u32>]) -> usize {
    let components = cyclic_components(successors);
    components.iter().map(|component| smallest(&restrict(successors, component)).0.len()).sum()
}

/// A shortest cycle through `start` that avoids the vertices for which `closed` holds, `start` first; `None` if there is
/// none. Ties go to low indices.
pub fn shortest_cycle(successors: &[Vec<u32>], start: usize, closed: impl Fn(usize) -> bool) -> Option<Vec<usize>> {
    let mut parent = std::collections::BTreeMap::new();
    let mut queue = VecDeque::from([start]);
    while let Some(v) = queue.pop_front() {
        for w in successors[v].iter().map(|&w| w as usize) {
            if w == start {
                return Some(path_to(&parent, start, v));
            }
            if !closed(w) && !parent.contains_key(&w) {
                parent.insert(w, v);
                queue.push_back(w);
            }
        }
    }
    None
}

fn path_to(parent: &std::collections::BTreeMap<usize, usize>, start: usize, end: usize) -> Vec<usize> {
    let mut path = vec![end];
    while *path.last().expect("not empty") != start {
        path.push(parent[path.last().expect("not empty")]);
    }
    path.reverse();
    path
}

/// The subgraph on some vertices (ascending), renumbered from 0.
pub fn restrict(successors: &[Vec<u32>], vertices: &[usize]) -> Vec<Vec<u32>> {
    let local = |w: u32| vertices.binary_search(&(w as usize)).ok().map(|w| w as u32);
    vertices.iter().map(|&v| successors[v].iter().filter_map(|&w| local(w)).collect()).collect()
}

/// The break set of one strongly connected component.
fn component_break_set(successors: &[Vec<u32>], rank: impl Fn(usize) -> u8) -> BreakSet {
    let (mut set, lower_bound) = smallest(successors);
    Exchange::new(successors).improve(&mut set, rank);
    if set.len() > lower_bound {
        drop_superfluous(successors, &mut set);
    }
    BreakSet { exact: set.len() == lower_bound, lower_bound, vertices: set.into_iter().collect() }
}

/// A small set that meets every cycle, without superfluous vertices, and a lower bound on the size of such sets.
fn smallest(successors: &[Vec<u32>]) -> (BTreeSet<usize>, usize) {
    let mut work = ReducedDigraph::new(successors);
    let mut set = BTreeSet::new();
    let mut bound = 0;
    work.reduce(&mut set);
    bound += set.len();
    for kernel in work.kernels() {
        let (part, part_bound) = kernel_break_set(&work, &kernel);
        set.extend(part);
        bound += part_bound;
    }
    if set.len() > bound {
        drop_superfluous(successors, &mut set);
    }
    (set, bound)
}

fn kernel_break_set(work: &ReducedDigraph, kernel: &[usize]) -> (Vec<usize>, usize) {
    if kernel.len() <= BITS
        && let Some(exact) = Search::new(work, kernel).run()
    {
        return (exact.iter().map(|&v| kernel[v]).collect(), exact.len());
    }
    (greedy(work.part(kernel)), disjoint_cycles(work, kernel))
}

/// Takes the busiest vertex, reduces, and goes on until what is left can be solved exactly.
fn greedy(mut work: ReducedDigraph) -> Vec<usize> {
    let mut set = BTreeSet::new();
    loop {
        work.reduce(&mut set);
        let Some(busiest) = work.busiest() else { return set.into_iter().collect() };
        let alive = work.alive();
        if alive.len() <= EXACT_KERNEL
            && let Some(exact) = Search::new(&work, &alive).run()
        {
            set.extend(exact.iter().map(|&v| alive[v]));
            return set.into_iter().collect();
        }
        set.insert(busiest);
        work.remove(busiest);
    }
}

/// Number of cycles found greedily that share no vertex: no smaller set can meet them all.
fn disjoint_cycles(work: &ReducedDigraph, kernel: &[usize]) -> usize {
    let successors: Vec<Vec<u32>> = kernel.iter().map(|&v| local_successors(work, kernel, v)).collect();
    let mut used = vec![false; kernel.len()];
    let mut order: Vec<usize> = (0..kernel.len()).collect();
    order.sort_by_key(|&v| (successors[v].len() + work.before[kernel[v]].len(), v));
    let mut number = 0;
    for v in order {
        if used[v] {
            continue;
        }
        if let Some(cycle) = shortest_cycle(&successors, v, |w| used[w]) {
            cycle.into_iter().for_each(|w| used[w] = true);
            number += 1;
        }
    }
    number
}

fn local_successors(work: &ReducedDigraph, kernel: &[usize], v: usize) -> Vec<u32> {
    let heads = work.after[v].iter();
    heads.filter_map(|w| kernel.binary_search(w).ok()).map(|w| w as u32).collect()
}

/// Leaves out every vertex that the others make superfluous.
fn drop_superfluous(successors: &[Vec<u32>], set: &mut BTreeSet<usize>) {
    for v in set.clone() {
        if shortest_cycle(successors, v, |w| set.contains(&w)).is_none() {
            set.remove(&v);
        }
    }
}

/// Exchange of single vertices of a set that meets every cycle.
struct Exchange<'a> {
    successors: &'a [Vec<u32>],
    predecessors: Vec<Vec<u32>>,
    /// Who was reached forwards and backwards in the present search, by its number.
    forward: Vec<u32>,
    backward: Vec<u32>,
    search: u32,
    /// Place in topological order, of the vertices inside.
    place: Vec<usize>,
    /// Steps left before only the cheap exchanges are made.
    budget: usize,
}

/// Steps allowed for exchanges in one component.
const EXCHANGE_STEPS: usize = 200_000;

impl<'a> Exchange<'a> {
    fn new(successors: &'a [Vec<u32>]) -> Self {
        let n = successors.len();
        Exchange {
            successors,
            predecessors: reverse(successors),
            forward: vec![0; n],
            backward: vec![0; n],
            search: 0,
            place: vec![0; n],
            budget: EXCHANGE_STEPS,
        }
    }

    /// Exchanges vertices for such of lower rank, then lower index, until nothing is gained.
    fn improve(&mut self, set: &mut BTreeSet<usize>, rank: impl Fn(usize) -> u8) {
        for v in set.clone() {
            let best = self.forced_with(v, set).into_iter().min_by_key(|&w| (rank(w), w)).unwrap_or(v);
            set.remove(&v);
            set.insert(best);
        }
        for _ in 0..3 {
            let before = set.clone();
            for &v in before.iter() {
                if self.budget == 0 {
                    return;
                }
                set.remove(&v);
                let best = self.meeting_all(v, set).into_iter().min_by_key(|&w| (rank(w), w));
                set.insert(best.unwrap_or(v));
            }
            if *set == before {
                return;
            }
        }
    }

    /// `v` and the vertices that every cycle through it passes because the way there or on is the only one.
    fn forced_with(&self, v: usize, set: &BTreeSet<usize>) -> Vec<usize> {
        let mut forced = vec![v];
        for edges in [&self.predecessors[..], self.successors] {
            let mut at = v;
            while let [only] = edges[at][..] {
                at = only as usize;
                if forced.contains(&at) || set.contains(&at) || forced.len() > 64 {
                    break;
                }
                forced.push(at);
            }
        }
        forced
    }

    /// The vertices that can stand in for `v`: each meets all cycles that avoid `set`, given that `v` does.
    ///
    /// Without `v` the cycles are paths from `v` to `v` through an acyclic graph; a vertex is on all of them if no edge
    /// jumps over it in topological order.
    fn meeting_all(&mut self, v: usize, set: &BTreeSet<usize>) -> Vec<usize> {
        let order = self.between(v, set);
        let last = order.len() + 1;
        let (mut furthest, mut meeting) = (0, vec![v]);
        for (i, w) in std::iter::once(v).chain(order).enumerate() {
            if i > 0 && furthest <= i {
                meeting.push(w);
            }
            for head in self.successors[w].iter().map(|&h| h as usize) {
                let to = if head == v { last } else { self.place_of(head) };
                furthest = furthest.max(to);
            }
        }
        meeting
    }

    fn is_inside(&self, w: usize) -> bool {
        self.forward[w] == self.search && self.backward[w] == self.search
    }

    fn place_of(&self, w: usize) -> usize {
        if self.is_inside(w) { self.place[w] } else { 0 }
    }

    /// The vertices on cycles through `v` that avoid `set`, in topological order, each with its place from 1.
    fn between(&mut self, v: usize, set: &BTreeSet<usize>) -> Vec<usize> {
        self.search += 1;
        let reached = reach(self.successors, v, set, &mut self.forward, self.search);
        let met = reach(&self.predecessors, v, set, &mut self.backward, self.search);
        self.budget = self.budget.saturating_sub(reached.len() + met.len());
        (self.forward[v], self.backward[v]) = (0, 0);
        let mut inside: Vec<usize> = met.into_iter().filter(|&w| self.is_inside(w)).collect();
        inside.sort_unstable();
        let waits = |w: usize| self.predecessors[w].iter().filter(|&&u| self.is_inside(u as usize)).count();
        let waiting: Vec<usize> = inside.iter().map(|&w| waits(w)).collect();
        inside.iter().zip(waiting).for_each(|(&w, waits)| self.place[w] = waits);
        let mut order: Vec<usize> = inside.into_iter().filter(|&w| self.place[w] == 0).collect();
        let mut done = 0;
        while done < order.len() {
            for w in self.successors[order[done]].iter().map(|&w| w as usize) {
                if self.is_inside(w) {
                    self.place[w] -= 1;
                    order.extend((self.place[w] == 0).then_some(w));
                }
            }
            done += 1;
        }
        order.iter().enumerate().for_each(|(i, &w)| self.place[w] = i + 1);
        order
    }
}

/// Vertices reached from `start` by at least one edge, avoiding `closed` and not going on through `start`; they are
/// marked with `number`.
fn reach(
    successors: &[Vec<u32>],
    start: usize,
    closed: &BTreeSet<usize>,
    marks: &mut [u32],
    number: u32,
) -> Vec<usize> {
    let (mut reached, mut done) = (Vec::new(), 0);
    let mut next = Some(start);
    while let Some(v) = next {
        for w in successors[v].iter().map(|&w| w as usize) {
            if marks[w] != number && w != start && !closed.contains(&w) {
                marks[w] = number;
                reached.push(w);
            }
        }
        next = reached.get(done).copied();
        done += 1;
    }
    reached
}

fn reverse(successors: &[Vec<u32>]) -> Vec<Vec<u32>> {
    let mut predecessors = vec![Vec::new(); successors.len()];
    for (v, heads) in successors.iter().enumerate() {
        for &w in heads {
            predecessors[w as usize].push(v as u32);
        }
    }
    predecessors
}

/// All strongly connected components (Tarjan, without recursion), each ascending.
fn components(successors: &[Vec<u32>]) -> Vec<Vec<usize>> {
    const NEW: u32 = u32::MAX;
    let n = successors.len();
    let (mut index, mut low) = (vec![NEW; n], vec![0u32; n]);
    let mut on_stack = vec![false; n];
    let (mut stack, mut calls, mut next) = (Vec::new(), Vec::<(usize, usize)>::new(), 0);
    let mut found = Vec::new();
    for root in 0..n {
        if index[root] != NEW {
            continue;
        }
        calls.push((root, 0));
        while let Some((v, edge)) = calls.pop() {
            if edge == 0 {
                (index[v], low[v]) = (next, next);
                next += 1;
                stack.push(v);
                on_stack[v] = true;
            }
            if let Some(&w) = successors[v].get(edge) {
                let w = w as usize;
                calls.push((v, edge + 1));
                if index[w] == NEW {
                    calls.push((w, 0));
                } else if on_stack[w] {
                    low[v] = low[v].min(index[w]);
                }
                continue;
            }
            if let Some(&(parent, _)) = calls.last() {
                low[parent] = low[parent].min(low[v]);
            }
            if low[v] == index[v] {
                found.push(pop_component(&mut stack, &mut on_stack, v));
            }
        }
    }
    found
}

fn pop_component(stack: &mut Vec<usize>, on_stack: &mut [bool], root: usize) -> Vec<usize> {
    let at = stack.iter().rposition(|&v| v == root).expect("the root is on the stack");
    let mut component = stack.split_off(at);
    component.iter().for_each(|&v| on_stack[v] = false);
    component.sort_unstable();
    component
}

/// A digraph under reduction.
struct ReducedDigraph {
    after: Vec<BTreeSet<usize>>,
    before: Vec<BTreeSet<usize>>,
    alive: Vec<bool>,
}

impl ReducedDigraph {
    fn new(successors: &[Vec<u32>]) -> ReducedDigraph {
        let n = successors.len();
        let mut work =
            ReducedDigraph { after: vec![BTreeSet::new(); n], before: vec![BTreeSet::new(); n], alive: vec![true; n] };
        for (v, heads) in successors.iter().enumerate() {
            heads.iter().for_each(|&w| work.connect(v, w as usize));
        }
        work
    }

    /// A copy that holds only some vertices, with the same numbering.
    fn part(&self, vertices: &[usize]) -> ReducedDigraph {
        let keep: BTreeSet<usize> = vertices.iter().copied().collect();
        let within = |edges: &[BTreeSet<usize>], v: usize| {
            if keep.contains(&v) { edges[v].intersection(&keep).copied().collect() } else { BTreeSet::new() }
        };
        let n = self.alive.len();
        ReducedDigraph {
            after: (0..n).map(|v| within(&self.after, v)).collect(),
            before: (0..n).map(|v| within(&self.before, v)).collect(),
            alive: (0..n).map(|v| keep.contains(&v)).collect(),
        }
    }

    fn alive(&self) -> Vec<usize> {
        (0..self.alive.len()).filter(|&v| self.alive[v]).collect()
    }

    fn connect(&mut self, v: usize, w: usize) {
        self.after[v].insert(w);
        self.before[w].insert(v);
    }

    fn disconnect(&mut self, v: usize, w: usize) {
        self.after[v].remove(&w);
        self.before[w].remove(&v);
    }

    fn remove(&mut self, v: usize) {
        self.alive[v] = false;
        for w in std::mem::take(&mut self.after[v]) {
            self.before[w].remove(&v);
        }
        for u in std::mem::take(&mut self.before[v]) {
            self.after[u].remove(&v);
        }
    }

    /// Lets the cycles through `v` pass it by.
    fn bypass(&mut self, v: usize) {
        let (before, after) = (self.before[v].clone(), self.after[v].clone());
        self.remove(v);
        for &u in &before {
            after.iter().for_each(|&w| self.connect(u, w));
        }
    }

    /// Reduces until nothing more can be done; vertices that every smallest set may hold go to `set`.
    fn reduce(&mut self, set: &mut BTreeSet<usize>) {
        let mut todo: BTreeSet<usize> = (0..self.alive.len()).filter(|&v| self.alive[v]).collect();
        loop {
            while let Some(v) = todo.pop_first() {
                self.reduce_at(v, set, &mut todo);
            }
            if !self.cut_between_components(&mut todo) {
                return;
            }
        }
    }

    fn reduce_at(&mut self, v: usize, set: &mut BTreeSet<usize>, todo: &mut BTreeSet<usize>) {
        if !self.alive[v] {
            return;
        }
        let looped = self.after[v].contains(&v);
        let simple = self.before[v].len() <= 1 || self.after[v].len() <= 1;
        if !looped && !simple {
            return;
        }
        todo.extend(self.before[v].iter().chain(&self.after[v]).copied().filter(|&w| w != v));
        if looped {
            set.insert(v);
            self.remove(v);
        } else {
            self.bypass(v);
        }
    }

    /// Takes out edges that no cycle uses, and edges that only cycles use which meet a 2-cycle anyway.
    fn cut_between_components(&mut self, todo: &mut BTreeSet<usize>) -> bool {
        let alive = self.alive();
        let one_way = |v: usize, w: usize| !self.after[w].contains(&v);
        let local = |w: usize| alive.binary_search(&w).expect("edges join living vertices") as u32;
        let successors: Vec<Vec<u32>> = alive
            .iter()
            .map(|&v| self.after[v].iter().copied().filter(|&w| one_way(v, w)).map(local).collect())
            .collect();
        let mut group = vec![0; alive.len()];
        for (number, component) in components(&successors).iter().enumerate() {
            component.iter().for_each(|&v| group[v] = number);
        }
        let mut cut = Vec::new();
        for (v, heads) in successors.iter().enumerate() {
            let crossing = heads.iter().filter(|&&w| group[w as usize] != group[v]);
            cut.extend(crossing.map(|&w| (alive[v], alive[w as usize])));
        }
        for &(v, w) in &cut {
            self.disconnect(v, w);
            todo.extend([v, w]);
        }
        !cut.is_empty()
    }

    /// The strongly connected components of what is left.
    fn kernels(&self) -> Vec<Vec<usize>> {
        let alive = self.alive();
        let successors: Vec<Vec<u32>> = alive.iter().map(|&v| local_successors(self, &alive, v)).collect();
        let parts = cyclic_components(&successors);
        parts.into_iter().map(|part| part.into_iter().map(|v| alive[v]).collect()).collect()
    }

    fn busiest(&self) -> Option<usize> {
        let alive = (0..self.alive.len()).filter(|&v| self.alive[v]);
        alive.max_by_key(|&v| (self.after[v].len() * self.before[v].len(), std::cmp::Reverse(v)))
    }
}

/// Branch and bound on at most 64 vertices, edges as bit masks.
struct Search {
    best: u64,
    best_size: usize,
    steps_left: usize,
    start: Masks,
}

#[derive(Clone)]
struct Masks {
    after: Vec<u64>,
    before: Vec<u64>,
    alive: u64,
}

impl Search {
    fn new(work: &ReducedDigraph, kernel: &[usize]) -> Search {
        let mask = |edges: &BTreeSet<usize>| {
            kernel.iter().enumerate().filter(|(_, v)| edges.contains(v)).fold(0, |mask, (i, _)| mask | 1 << i)
        };
        let n = kernel.len();
        let start = Masks {
            after: kernel.iter().map(|&v| mask(&work.after[v])).collect(),
            before: kernel.iter().map(|&v| mask(&work.before[v])).collect(),
            alive: if n == BITS { u64::MAX } else { (1 << n) - 1 },
        };
        let steps_left = if n <= EXACT_KERNEL { usize::MAX } else { BUDGET };
        Search { best: start.alive, best_size: n, steps_left, start }
    }

    /// The smallest set, ascending; `None` if the budget ran out.
    fn run(mut self) -> Option<Vec<usize>> {
        let start = self.start.clone();
        self.branch(start, 0);
        (self.steps_left > 0).then(|| bits(self.best).collect())
    }

    fn branch(&mut self, mut graph: Masks, mut taken: u64) {
        if self.steps_left == 0 {
            return;
        }
        self.steps_left -= 1;
        taken |= graph.reduce();
        let size = taken.count_ones() as usize;
        if graph.alive == 0 && size < self.best_size {
            (self.best, self.best_size) = (taken, size);
        }
        if graph.alive == 0 || size + graph.disjoint_cycles() >= self.best_size {
            return;
        }
        let degree = |v: usize| graph.after[v].count_ones() + graph.before[v].count_ones();
        let v = bits(graph.alive).max_by_key(|&v| (degree(v), std::cmp::Reverse(v))).expect("some are alive");
        let mut without = graph.clone();
        without.remove(v);
        self.branch(without, taken | 1 << v);
        graph.bypass(v);
        self.branch(graph, taken);
    }
}

impl Masks {
    fn remove(&mut self, v: usize) {
        bits(self.after[v]).for_each(|w| self.before[w] &= !(1 << v));
        bits(self.before[v]).for_each(|u| self.after[u] &= !(1 << v));
        (self.after[v], self.before[v]) = (0, 0);
        self.alive &= !(1 << v);
    }

    fn bypass(&mut self, v: usize) {
        let (before, after) = (self.before[v], self.after[v]);
        self.remove(v);
        bits(before).for_each(|u| self.after[u] |= after);
        bits(after).for_each(|w| self.before[w] |= before);
    }

    /// Reduces until nothing more can be done; gives the vertices that were taken.
    fn reduce(&mut self) -> u64 {
        let mut taken = 0;
        loop {
            let alive = self.alive;
            for v in bits(alive) {
                if self.after[v] >> v & 1 == 1 {
                    taken |= 1 << v;
                    self.remove(v);
                } else if self.after[v].count_ones() <= 1 || self.before[v].count_ones() <= 1 {
                    self.bypass(v);
                }
            }
            if self.alive == alive {
                return taken;
            }
        }
    }

    /// Cycles that share no vertex, shortest first, found greedily.
    fn disjoint_cycles(&self) -> usize {
        let mut free = self.alive;
        let mut number = 0;
        for v in bits(self.alive) {
            let pair = self.after[v] & self.before[v] & free;
            if free >> v & 1 == 1 && pair != 0 {
                free &= !(1 << v | 1 << pair.trailing_zeros());
                number += 1;
            }
        }
        for v in bits(free) {
            if free >> v & 1 == 1
                && let Some(cycle) = self.cycle_through(v, free)
            {
                free &= !cycle;
                number += 1;
            }
        }
        number
    }

    /// The vertices of a shortest cycle through `v` within `free`.
    fn cycle_through(&self, v: usize, free: u64) -> Option<u64> {
        let mut layers = vec![1u64 << v];
        let mut seen = 1u64 << v;
        loop {
            let last = *layers.last().expect("not empty");
            if bits(last).any(|w| self.after[w] >> v & 1 == 1) {
                break;
            }
            let next = bits(last).fold(0, |next, w| next | self.after[w]) & free & !seen;
            if next == 0 {
                return None;
            }
            seen |= next;
            layers.push(next);
        }
        let (mut at, mut cycle) = (v, 1u64 << v);
        for layer in layers[1..].iter().rev() {
            at = (layer & self.before[at]).trailing_zeros() as usize;
            cycle |= 1 << at;
        }
        Some(cycle)
    }
}

fn bits(mask: u64) -> impl Iterator<Item = usize> {
    std::iter::successors(Some(mask), |m| Some(m & m.wrapping_sub(1)))
        .take_while(|&m| m != 0)
        .map(|m| m.trailing_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn acyclic_without(successors: &[Vec<u32>], set: &[usize]) -> bool {
        let rest: Vec<usize> = (0..successors.len()).filter(|v| !set.contains(v)).collect();
        cyclic_components(&restrict(successors, &rest)).is_empty()
    }

    fn least_by_trial(successors: &[Vec<u32>]) -> usize {
        let n = successors.len();
        let sets = (0u64..1 << n).filter(|&set| acyclic_without(successors, &bits(set).collect::<Vec<_>>()));
        sets.map(|set| set.count_ones() as usize).min().expect("the set of all vertices meets every cycle")
    }

    fn digraph(n: std::ops::Range<usize>, edges: usize) -> impl Strategy<Value = Vec<Vec<u32>>> {
        n.prop_flat_map(move |n| {
            let edge = (0..n, 0..n as u32);
            proptest::collection::vec(edge, 0..=edges.max(1)).prop_map(move |edges| {
                let mut successors = vec![Vec::new(); n];
                edges.into_iter().for_each(|(v, w)| successors[v].push(w));
                successors.iter_mut().for_each(|heads| {
                    heads.sort_unstable();
                    heads.dedup();
                });
                successors
            })
        })
    }

    proptest! {
        #[test]
        fn small_sets_are_smallest(successors in digraph(1..9, 24)) {
            let found = break_set(&successors, &vec![0; successors.len()]);
            prop_assert!(found.exact);
            prop_assert!(acyclic_without(&successors, &found.vertices));
            prop_assert_eq!(found.vertices.len(), least_by_trial(&successors));
            prop_assert_eq!(count(&successors), found.vertices.len());
        }

        #[test]
        fn large_sets_break_every_cycle(successors in digraph(40..160, 420)) {
            let found = break_set(&successors, &vec![0; successors.len()]);
            prop_assert!(acyclic_without(&successors, &found.vertices));
            prop_assert!(found.lower_bound <= found.vertices.len());
            prop_assert_eq!(found.exact, found.lower_bound == found.vertices.len());
            for v in &found.vertices {
                let rest: Vec<usize> = found.vertices.iter().copied().filter(|w| w != v).collect();
                prop_assert!(!acyclic_without(&successors, &rest), "{} is superfluous", v);
            }
        }

        #[test]
        fn exchange_prefers_low_rank(successors in digraph(2..9, 14), ranks in proptest::collection::vec(0u8..3, 9)) {
            let found = break_set(&successors, &ranks[..successors.len()]);
            let size = found.vertices.len();
            for v in &found.vertices {
                for w in (0..successors.len()).filter(|w| !found.vertices.contains(w)) {
                    let mut other: Vec<usize> = found.vertices.iter().copied().filter(|u| u != v).collect();
                    other.push(w);
                    prop_assert!(other.len() == size);
                    prop_assert!(!acyclic_without(&successors, &other) || (ranks[w], w) > (ranks[*v], *v));
                }
            }
        }
    }

    #[test]
    fn a_long_chain_of_two_cycles_is_fast_and_exact() {
        let n = 20_000u32;
        let near = |v: u32| [v.checked_sub(1), Some(v + 1)].into_iter().flatten().filter(|&w| w < n).collect();
        let successors: Vec<Vec<u32>> = (0..n).map(near).collect();
        assert_eq!(count(&successors), 10_000);
    }

    #[test]
    fn a_shortest_cycle_avoids_what_is_closed() {
        let successors = vec![vec![1, 2], vec![0], vec![3], vec![0]];
        assert_eq!(shortest_cycle(&successors, 0, |_| false), Some(vec![0, 1]));
        assert_eq!(shortest_cycle(&successors, 0, |v| v == 1), Some(vec![0, 2, 3]));
        assert_eq!(shortest_cycle(&successors, 1, |v| v == 0), None);
    }
}
