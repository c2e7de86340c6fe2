//! What storages do at an event, and where a ratio leaps. An impulse acts for no time, so that whatever is finite takes
//! no part in it: what storages keep changes by what the junction structure lets through, `Nᵀ ΔX = Nᵀ P` with
//! `N = [1; S]` as it is after the event, and `P` the impulse that a reset takes. Source: `method.md`, 5.3, over an instant.

use super::definitions::Definitions;
use super::minimal::{Assembled, StoragePort, rows_of};
use super::{Form, Unavailable, observed};
use crate::algebra::{Expr, ONE, Symbol};
use crate::bond_graph::{Action, BondGraph, Clause, Meaning};
use crate::causal_graph::{CausalGraph, Role};
use crate::diagnostic::{Diagnostic, Diagnostics, codes};
use crate::span::Span;

/// How storages change at events.
#[derive(Debug, Clone, Default)]
pub struct Jumps {
    /// What storages keep, port by port.
    pub stored: Vec<Symbol>,
    /// The variables of the bond graph that these are.
    pub storages: Vec<Symbol>,
    /// For each independent variable what follows it: places in `stored` with a factor.
    pub balances: Vec<Vec<(usize, Expr)>>,
    /// The impulses that resets take.
    pub impulses: Vec<Impulse>,
    /// Whether a factor may leap by itself: a ratio that depends on a condition, a constraint with a corner.
    pub leaps: bool,
}

/// The impulse of a reset.
#[derive(Debug, Clone)]
pub struct Impulse {
    /// The variable that tells it.
    pub symbol: Symbol,
    /// How far each independent variable moves what it acts on: places in `balances` with a factor.
    pub along: Vec<(usize, Expr)>,
}

/// Independent variables by which the graph moves, storages first.
struct Moving<'p, 'a> {
    ports: &'p [StoragePort<'a>],
    /// Each with the storage that keeps it, if one does.
    independent: Vec<(Symbol, Option<usize>)>,
}

impl Assembled<'_> {
    /// How storages change at the events of a graph; `None` if none can. `truth` is the graph with its exact ports.
    pub(super) fn jumps(&mut self, truth: &CausalGraph, form: Form) -> Result<Option<Jumps>, Diagnostics> {
        let graph = self.d.graph;
        let mut ports: Vec<StoragePort> =
            truth.ports.ports.iter().filter_map(|s| self.storage_port(truth, s)).collect();
        // A spring whose displacement follows from others keeps nothing by itself.
        ports.retain(|p| !self.d.computed.contains(&p.stored));
        let clauses = || own_clauses(graph, form);
        let actions = || clauses().flat_map(|c| &c.actions);
        let reset = actions().find(|a| !is_discrete(graph, a));
        let depend = ports.iter().any(|p| p.state.role == Role::Dependent);
        let acts = actions().next().is_some();
        let switches = form.is_explicit() && !graph.set_valued.is_empty();
        if reset.is_none() && !switches && !(depend && (acts || graph.has_leaping_ratios())) {
            return Ok(None);
        }
        if let (Form::Stiff, true) = (form, depend) {
            return reset.map_or(Ok(None), |action| Err(springs(action)));
        }
        let own = ports.iter().enumerate().filter(|(_, p)| p.state.role == Role::Independent);
        let own = own.map(|(k, p)| (p.z, Some(k)));
        let virtuals = truth.ports.virtual_speeds.iter().map(|v| (v.speed, None));
        let moving = Moving { independent: own.chain(virtuals).collect(), ports: &ports };
        let mut balances: Vec<Vec<(usize, Expr)>> =
            moving.independent.iter().map(|(_, own)| own.map(|k| (k, ONE)).into_iter().collect()).collect();
        let mut rows = rows_of(&mut self.d, truth);
        for (k, port) in ports.iter().enumerate().filter(|(_, p)| p.state.role == Role::Dependent) {
            let row = rows.of(&mut self.d.x, port.z).cloned().unwrap_or_default();
            for (balance, (z, _)) in balances.iter_mut().zip(&moving.independent) {
                balance.extend(row.coefficient(*z).map(|factor| (k, factor)));
            }
        }
        let leaps = balances.iter().flatten().any(|t| self.d.x.may_leap(t.1));
        if !(acts || leaps || switches) {
            return Ok(None);
        }
        let mut impulses: Vec<Impulse> = Vec::new();
        let all = clauses().flat_map(|c| c.actions.iter().map(move |a| (c.bound.is_some(), a)));
        for (of_bound, action) in all {
            let Some(symbol) = action.impulse.filter(|s| impulses.iter().all(|i| i.symbol != *s)) else { continue };
            let along: Vec<(usize, Expr)> = match moving.storage_of(graph, action.target) {
                Some(k) => {
                    let of = |row: &[(usize, Expr)]| row.iter().find(|t| t.0 == k).map(|t| t.1);
                    balances.iter().enumerate().filter_map(|(b, row)| Some((b, of(row)?))).collect()
                }
                None => match self.along(truth, &moving, &mut rows, action) {
                    // What no storage resists takes no impulse to move.
                    Err(_) if of_bound => continue,
                    along => along?,
                },
            };
            // Nor does what a branch holds: an impulse lets it go first, and acts in another branch.
            if along.is_empty() && (of_bound || graph.may_be_released()) {
                continue;
            }
            if along.is_empty() {
                return Err(refused(action, "a source sets it, or nothing that keeps an impulse stands there"));
            }
            impulses.push(Impulse { symbol, along });
        }
        let stored: Vec<Symbol> = ports.iter().map(|p| p.stored).collect();
        let storages = stored.iter().map(|&s| self.d.x.untwinned(s)).collect();
        Ok(Some(Jumps { stored, storages, balances, impulses, leaps }))
    }

    /// What an impulse moves that acts on an effort or flow between storages.
    fn along(
        &mut self,
        causal: &CausalGraph,
        moving: &Moving<'_, '_>,
        rows: &mut super::rows::Rows<'_>,
        action: &Action,
    ) -> Result<Vec<(usize, Expr)>, Diagnostics> {
        let symbol = match self.d.meaning(action.target) {
            Some(Meaning::Stored(port)) => self.d.graph.storage_symbols(port).map_or(action.target, |(z, _)| z),
            _ => action.target,
        };
        if let Some(place) = moving.independent.iter().position(|(z, _)| self.d.x.untwinned(*z) == symbol) {
            return Ok(vec![(place, ONE)]);
        }
        let row = rows.of(&mut self.d.x, symbol).cloned().unwrap_or_default();
        let mut along = Vec::new();
        for &(input, factor) in &row.0 {
            let place = moving.independent.iter().position(|(z, _)| *z == input);
            let source =
                causal.ports.ports.iter().any(|p| p.input == input && matches!(p.role, Role::Source | Role::Redundant));
            match place {
                Some(place) => along.push((place, factor)),
                None if source => {}
                None => Err(refused(action, "it also follows from a law, which takes no impulse"))?,
            }
        }
        Ok(along)
    }
}

impl Moving<'_, '_> {
    /// The storage of which this is the stored quantity or the co-energy variable.
    fn storage_of(&self, graph: &BondGraph, target: Symbol) -> Option<usize> {
        self.ports
            .iter()
            .position(|p| p.stored == target || graph.storage_symbols(p.state.port).is_some_and(|(z, _)| z == target))
    }
}

/// The events that a form looks for: bounds of set-valued laws are not among them where the minimal one does.
fn own_clauses(graph: &BondGraph, form: Form) -> impl Iterator<Item = &Clause> {
    graph.clauses.iter().filter(move |clause| clause.bound.is_none() || form.is_explicit())
}

fn is_discrete(graph: &BondGraph, action: &Action) -> bool {
    matches!(graph.variables.get(&action.target).map(|v| v.meaning), Some(Meaning::Held(_)))
}

fn refused(action: &Action, why: &str) -> Diagnostics {
    Diagnostic::error(codes::E003, format!("{} cannot be reset", action.name), action.span, why)
        .hint("reset what a storage keeps that is free to move: `p` of an I, `q` of a C, or the flow of its junction")
        .into()
}

fn springs(action: &Action) -> Diagnostics {
    let why = "the springs of this form would share the impulse out over time, where the machine shares it at once";
    let title = format!("{} cannot be reset in the form stiff", action.name);
    Diagnostic::error(codes::E003, title, action.span, why).hint("choose another form, such as minimal").into()
}

/// Refuses events that read what has no value.
pub(super) fn readable(d: &mut Definitions, form: Form, jumps: Option<&Jumps>) -> Result<(), Diagnostics> {
    if let Some(jumps) = jumps {
        let factors = jumps.balances.iter().flatten().chain(jumps.impulses.iter().flat_map(|i| &i.along));
        let mut read: Vec<Expr> = factors.map(|t| t.1).collect();
        read.extend(jumps.stored.iter().map(|&s| d.x.sym(s)));
        if let Some(reason) = read.into_iter().find_map(|e| observed::value_of(d, e).err()) {
            let clause = d.graph.clauses.first().map(|c| (c.name.as_str(), c.span));
            let (name, span) = clause.unwrap_or(("a ratio that depends on a condition", Span::default()));
            return Err(unreadable(name, span, &reason));
        }
    }
    for clause in own_clauses(d.graph, form) {
        let read = std::iter::once((clause.trigger.expr(), clause.span));
        for (e, span) in read.chain(clause.actions.iter().map(|a| (a.value, a.span))) {
            if let Err(reason) = observed::value_of(d, e) {
                return Err(unreadable(&clause.name, span, &reason));
            }
        }
    }
    Ok(())
}

fn unreadable(name: &str, span: Span, reason: &Unavailable) -> Diagnostics {
    Diagnostic::error(codes::E003, format!("`{name}` reads what has no value"), span, reason.to_string())
        .hint("read states, or variables that follow from them")
        .into()
}
