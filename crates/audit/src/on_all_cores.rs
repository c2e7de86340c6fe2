//! Large models in several threads.

use crate::values::Values;
use halfarrow_compiler::bond_graph::BondGraph;
use rayon::prelude::*;

/// So many things are looked at in one thread, whatever the machine: what is found does not depend on it.
const BY_ONE: usize = 1 << 13;

/// What `look` finds of things, some thousands at a time, in their order.
pub(crate) fn on_all_cores<'a, I: Sync, T: Send>(
    things: &[I],
    values: &Values<'a>,
    look: impl Fn(&[I], &Values<'a>) -> T + Sync,
) -> Vec<T> {
    if things.len() <= BY_ONE {
        return vec![look(things, values)];
    }
    let parts: Vec<_> = things.chunks(BY_ONE).map(|part| (part, values.beside_these())).collect();
    parts.into_par_iter().map(|(part, values)| look(part, &values)).collect()
}

/// Does two things that have nothing to do with each other, of large models in two threads.
pub(crate) fn both_at_once<A: Send, B: Send>(
    graph: &BondGraph,
    one: impl FnOnce() -> A + Send,
    other: impl FnOnce() -> B + Send,
) -> (A, B) {
    match graph.elements.len() <= BY_ONE {
        true => (one(), other()),
        false => rayon::join(one, other),
    }
}

/// The same where the first stays in this thread.
pub(crate) fn beside<A, B: Send>(
    graph: &BondGraph,
    here: impl FnOnce() -> A,
    there: impl FnOnce() -> B + Send,
) -> (A, B) {
    if graph.elements.len() <= BY_ONE {
        return (here(), there());
    }
    let mut other = None;
    let one = rayon::in_place_scope(|scope| {
        scope.spawn(|_| other = Some(there()));
        here()
    });
    (one, other.expect("the scope has ended"))
}
