//! What happens at events: when, and what changes then.

use super::dependence::Dependence;
use super::lower::Lowering;
use super::{Dataflow, Value};
use crate::algebra::Symbol;
use crate::bond_graph::{self, BondGraph, BoundKind, Meaning};
use crate::equations::{self, Equations, StateKind};
use crate::ids::Id;
use crate::span::Span;

/// What happens at an event, all at once, from the values before it.
#[derive(Debug, Clone)]
pub struct Clause {
    /// As it begins in the text: `when ball.q < 0`.
    pub name: String,
    /// When it happens.
    pub trigger: Trigger,
    /// What changes.
    pub actions: Vec<Action>,
    /// The bound of a set-valued law that this is, if it is one.
    pub bound: Option<Bound>,
    /// Where it stands.
    pub span: Span,
}

/// Where the present branch of a set-valued law ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bound {
    /// The law, an entry of [`Program::set_valued`](super::Program).
    pub law: u32,
    /// The branch beyond it.
    pub next: u32,
    /// What is never negative while the branch holds; none where a condition ends it.
    pub margin: Option<Value>,
    /// What the margin is measured in.
    pub measure: Measure,
    /// Where the margin is a gap: its rate, and the flow of the element with which it stays as it is.
    pub gap: Option<(Value, Value)>,
    /// While a contact is closed: its gap, which is zero.
    pub closed: Option<Value>,
}

/// What a margin is measured in: with which variables of the graph it is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Measure {
    /// As the effort of its element.
    Effort,
    /// As its flow.
    Flow,
    /// As neither: a gap.
    Gap,
}

/// A set-valued law.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SetValued {
    /// Its element.
    pub name: String,
    /// The names of its branches.
    pub branches: Vec<&'static str>,
    /// The branch to which this program belongs.
    pub present: u32,
    /// The branch that it has while impulses are shared out, where it would take part in them otherwise.
    pub released: Option<u32>,
}

/// When an event happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// Where this truth value becomes 1.
    Becomes(Value),
    /// At every multiple of this period in s, in parameters.
    Every(Value),
}

impl Trigger {
    /// The truth value or the period.
    pub fn value(self) -> Value {
        let (Trigger::Becomes(value) | Trigger::Every(value)) = self;
        value
    }
}

/// What changes at an event.
#[derive(Debug, Clone)]
pub struct Action {
    /// Its name, for messages.
    pub name: String,
    /// What changes.
    pub target: Target,
    /// The new value.
    pub value: Value,
}

/// What an event can change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// A discrete variable: an entry of [`Program::held`](super::Program).
    Discrete(u32),
    /// A state that is an integrated signal.
    Signal(u32),
    /// A value that follows from what storages keep, brought about by an impulse, an entry of [`Jumps::impulses`].
    Moved {
        /// What gets the new value.
        what: Value,
        /// The impulse.
        impulse: u32,
    },
    /// A value that the branch of a set-valued law holds, as what sticks: an impulse lets it go first, so that it changes in
    /// another mode.
    HeldByBranch,
}

impl Target {
    /// Whether impulses bring it about.
    pub fn takes_impulse(self) -> bool {
        matches!(self, Target::Moved { .. } | Target::HeldByBranch)
    }
}

/// How storages change at events: `Σ factor · (X⁺ - X⁻) = Σ along · P` for each independent variable, all factors as they
/// are after the event.
#[derive(Debug, Clone, Default)]
pub struct Jumps {
    /// What storages keep, `X`.
    pub stored: Vec<Value>,
    /// The variables of the bond graph that these are: the same in all modes of a graph.
    pub storages: Vec<Symbol>,
    /// For each independent variable places in `stored`, with their factors.
    pub balances: Vec<Vec<(u32, Value)>>,
    /// The states by which storages tell what they keep and, after all states, conserved constants, ascending.
    pub unknowns: Vec<u32>,
    /// The impulses `P`.
    pub impulses: Vec<Impulse>,
    /// Whether factors may leap where a condition changes, without a clause.
    pub leaps: bool,
}

/// The impulse of a reset.
#[derive(Debug, Clone)]
pub struct Impulse {
    /// What tells it: an entry of [`Program::held`](super::Program).
    pub held: u32,
    /// The balances in which it stands, with factors.
    pub along: Vec<(u32, Value)>,
}

impl Jumps {
    /// Everything that is evaluated.
    pub fn values(&self) -> impl Iterator<Item = Value> + '_ {
        let factors = self.balances.iter().flatten().chain(self.impulses.iter().flat_map(|i| &i.along));
        self.stored.iter().copied().chain(factors.map(|t| t.1))
    }
}

impl Clause {
    /// Everything that is evaluated.
    pub fn values(&self) -> impl Iterator<Item = Value> + '_ {
        let of = |a: &Action| match a.target {
            Target::Moved { what, .. } => [Some(a.value), Some(what)],
            _ => [Some(a.value), None],
        };
        let gap = self.bound.and_then(|b| b.gap).into_iter().flat_map(|(rate, still)| [rate, still]);
        let closed = self.bound.and_then(|b| b.closed);
        let margin = self.bound.and_then(|b| b.margin).into_iter().chain(gap).chain(closed);
        std::iter::once(self.trigger.value()).chain(margin).chain(self.actions.iter().flat_map(of).flatten())
    }
}

/// The events of a form, bounds of set-valued laws where it looks for them itself. Resets are left out where the form has no [`Jumps`] of its own: another one makes them.
pub(super) fn clauses(lower: &mut Lowering, equations: &Equations) -> Vec<Clause> {
    let graph = &equations.graph;
    let mut clauses = Vec::new();
    let own = |clause: &&bond_graph::Clause| clause.bound.is_none() || equations.form.is_explicit();
    for clause in graph.clauses.iter().filter(own) {
        let trigger = match clause.trigger {
            bond_graph::Trigger::Becomes(condition) => Trigger::Becomes(lower.value(condition)),
            bond_graph::Trigger::Every(period) => Trigger::Every(lower.value(period)),
        };
        let mut actions = Vec::new();
        for action in &clause.actions {
            // What ends a branch and moves nothing has no action.
            let held = clause.bound.is_none() && equations.jumps.is_some() && graph.may_be_released();
            let held = held && action.impulse.is_some();
            let target = target(lower, equations, action).or(held.then_some(Target::HeldByBranch));
            let Some(target) = target else { continue };
            actions.push(Action { name: action.name.clone(), target, value: lower.value(action.value) });
        }
        let bound = clause.bound.map(|(law, number)| {
            let bound = &graph.set_valued[law].branch().bounds[number];
            let margin = match bound.kind {
                BoundKind::Margin(margin) => Some(lower.value(margin)),
                BoundKind::Command(_) => None,
            };
            let gap = bound.impact.as_ref().map(|i| (lower.value(i.rate), lower.value(i.still)));
            let flow = |s| matches!(meaning(graph, s), Some(Meaning::Flow(_)));
            let effort = |s| matches!(meaning(graph, s), Some(Meaning::Effort(_)));
            let reads = |wanted: &dyn Fn(Symbol) -> bool| graph.exprs.depends_on_any(bound.kind.expr(), wanted);
            let measure = match bound.impact {
                Some(_) => Measure::Gap,
                None if reads(&flow) && !reads(&effort) => Measure::Flow,
                None => Measure::Effort,
            };
            let closed = closed_gap(lower, graph, law);
            Bound { law: law as u32, next: bound.next as u32, margin, measure, gap, closed }
        });
        clauses.push(Clause { name: clause.name.clone(), trigger, actions, bound, span: clause.span });
    }
    clauses
}

fn target(lower: &mut Lowering, equations: &Equations, action: &bond_graph::Action) -> Option<Target> {
    let state = |s: Symbol| equations.states.iter().position(|state| state.symbol == s).map(|i| i as u32);
    match meaning(&equations.graph, action.target) {
        Some(Meaning::Held(id)) => Some(Target::Discrete(id.index() as u32)),
        Some(Meaning::Signal(_)) => state(action.target).map(Target::Signal),
        _ => {
            let of = |i: &equations::Impulse| Some(i.symbol) == action.impulse;
            let impulse = equations.jumps.as_ref()?.impulses.iter().position(of)? as u32;
            Some(Target::Moved { what: lower.defined(action.target)?, impulse })
        }
    }
}

/// The gap of a contact that is closed, if all that it reads is evaluated.
fn closed_gap(lower: &mut Lowering, graph: &BondGraph, law: usize) -> Option<Value> {
    let own = graph.set_valued[law].constraint.as_ref().filter(|c| c.holonomic)?;
    graph.constraints.iter().find(|constraint| constraint.element == own.element)?;
    let known = graph.exprs.symbols_of(own.expr).iter().all(|&symbol| lower.defined(symbol).is_some());
    known.then(|| lower.value(own.expr))
}

fn meaning(graph: &BondGraph, symbol: Symbol) -> Option<Meaning> {
    graph.variables.get(&symbol).map(|v| v.meaning)
}

/// The set-valued laws of a graph.
pub(super) fn set_valued(equations: &Equations) -> Vec<SetValued> {
    let graph = &equations.graph;
    let law = |law: &bond_graph::SetValuedLaw| SetValued {
        name: graph.elements[law.element].name.clone(),
        branches: law.branches.iter().map(|b| b.name).collect(),
        present: law.present as u32,
        released: law.branch().released.map(|branch| branch as u32),
    };
    graph.set_valued.iter().map(law).collect()
}

/// The balances as values; which unknowns they have is told by [`with_unknowns`].
pub(super) fn jumps(lower: &mut Lowering, equations: &Equations) -> Option<Jumps> {
    let jumps = equations.jumps.as_ref()?;
    let stored = jumps.stored.iter().map(|&s| lower.defined(s).expect("what storages keep is defined")).collect();
    let mut row = |row: &[(usize, crate::algebra::Expr)]| -> Vec<(u32, Value)> {
        row.iter().map(|&(k, factor)| (k as u32, lower.value(factor))).collect()
    };
    let balances = jumps.balances.iter().map(|b| row(b)).collect();
    let impulse = |i: &equations::Impulse| {
        let held = match meaning(&equations.graph, i.symbol) {
            Some(Meaning::Held(id)) => id.index() as u32,
            _ => panic!("an impulse is a held signal"),
        };
        Impulse { held, along: row(&i.along) }
    };
    let impulses = jumps.impulses.iter().map(impulse).collect();
    let storages = jumps.storages.clone();
    Some(Jumps { stored, storages, balances, unknowns: Vec::new(), impulses, leaps: jumps.leaps })
}

/// The same with the states and constants by which storages tell what they keep.
pub(super) fn with_unknowns(jumps: Jumps, flow: Dataflow<'_>, equations: &Equations) -> Jumps {
    let states = equations.states.len() + equations.algebraic.len();
    let dependence = Dependence::new(flow, states as u32, (0, &[]), &jumps.stored);
    let signal = |u: &u32| equations.states.get(*u as usize).is_some_and(|s| s.kind == StateKind::Signal);
    let mut unknowns: Vec<u32> =
        jumps.stored.iter().flat_map(|&s| dependence.unknowns_of(s)).copied().filter(|u| !signal(u)).collect();
    unknowns.sort_unstable();
    unknowns.dedup();
    Jumps { unknowns, ..jumps }
}
