//! What a form and the minimal one know of each other: the variables of the graph that both have.

use super::super::Model;
use crate::bytecode::Routine;
use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::program::{Implicit, Op, Position, Program, Unavailable, Value};
use halfarrow_sim::Sparsity;
use std::collections::BTreeMap;

/// The equations of a form, and how its unknowns and the states of the minimal form, the reference, follow from each other.
/// It never changes; copies share it.
#[derive(Debug)]
pub(super) struct StateMap {
    pub equations: Implicit,
    pub sparsity: Sparsity,
    /// Columns of the pattern in groups, no two of a group with a nonzero in the same row.
    pub groups: Vec<Vec<usize>>,
    /// States of the reference that the form can tell, and what they are there: variables, and sums of stored quantities.
    pub states: Vec<usize>,
    pub of_states: Routine,
    /// Computed positions of the reference, as unknowns of its blocks, and what they are in the form.
    pub positions: Vec<(usize, usize)>,
    pub of_positions: Routine,
    /// Unknowns as the reference has them, with the routine that computes these.
    pub known: Vec<usize>,
    pub of_known: Routine,
    /// Unknowns that it does not have, and all variables that both have: here, and there.
    pub unknown: Vec<usize>,
    pub common: Routine,
    pub common_there: Routine,
    /// Unknowns of Newton blocks of the form (block, place) that the reference has, with the routine that computes them.
    pub guesses: Vec<(usize, usize)>,
    pub of_guesses: Routine,
    /// What the bonds of states with a free rate carry: in the form, and in the reference.
    pub free: Vec<usize>,
    pub carried: Routine,
    pub carried_there: Routine,
    /// The form is the minimal one itself: its unknowns are the states of the reference.
    pub twin: bool,
    /// Algebraic unknowns of a higher index, whose errors nothing controls while running.
    pub uncontrolled: Vec<usize>,
    /// The states of the reference that the form does not tell, by name.
    pub untold: Vec<String>,
}

impl StateMap {
    /// Makes room in both for the routines.
    pub fn new(form: &mut Model, reference: &mut Model) -> StateMap {
        let (form_code, reference_code) = (form.code.clone(), reference.code.clone());
        let (own, other) = (&form_code.program, &reference_code.program);
        let n = own.states.len();
        let equations = own.implicit.clone().unwrap_or_else(|| Implicit {
            explicit: vec![true; n],
            differential: vec![true; n],
            indices: vec![1; n],
            carried: Vec::new(),
        });
        let there = |s: &Symbol| other.variables.get(s).copied();
        // States of the reference that the form can tell; the others keep the value they have.
        let mut pairs: Vec<(usize, Value)> = Vec::new();
        for (k, symbol) in other.tracked.iter().enumerate() {
            let register = reference_code.layout.states + k as u32;
            let is_state = there(symbol).and_then(|v| reference_code.layout.registers.get(v)) == Some(register);
            let told = if is_state { &own.variables } else { &own.momenta };
            pairs.extend(told.get(symbol).map(|&value| (k, value)));
        }
        // States behind those that variables tell stand still.
        let tracked = 0..own.tracked.len();
        let (known, untold): (Vec<usize>, Vec<usize>) = tracked.partition(|&i| there(&own.tracked[i]).is_some());
        let both = own.variables.iter().filter_map(|(s, v)| Some((*v, there(s)?)));
        let (common, common_there): (Vec<Value>, Vec<Value>) = both.filter(|_| !untold.is_empty()).unzip();
        let told: Vec<Value> = known.iter().filter_map(|&i| there(&own.tracked[i])).collect();
        let carried: Vec<(usize, Value, Value)> =
            equations.carried.iter().filter_map(|(i, s, v)| Some((*i as usize, *v, there(s)?))).collect();
        let solution = |(s, v): (&Symbol, &Value)| match own.values.op(*v) {
            Op::Solution(block, i) => Some(((block.0 as usize, i as usize), there(s)?)),
            _ => None,
        };
        let newton = |((block, i), _): &((usize, usize), Value)| form.is_unknown(*block, *i);
        let guessed = own.variables.iter().filter_map(solution).filter(newton);
        let (guesses, guessed): (Vec<(usize, usize)>, Vec<Value>) = guessed.unzip();
        let seen: Vec<Value> = pairs.iter().map(|p| p.1).collect();
        let position = |p: &Position| Some(((p.block.0 as usize, p.unknown as usize), *own.variables.get(&p.symbol)?));
        let (positions, of_positions): (Vec<(usize, usize)>, Vec<Value>) =
            other.positions.iter().filter_map(position).unzip();
        let carried_here: Vec<Value> = carried.iter().map(|c| c.1).collect();
        let carried_there: Vec<Value> = carried.iter().map(|c| c.2).collect();
        let sparsity = sparsity_of(own, &equations);
        let names = |p: &Program| p.states.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
        let twin = own.implicit.is_none()
            && own.set_valued.is_empty()
            && own.tracked == other.tracked
            && own.conserved == other.conserved
            && names(own) == names(other);
        let algebraic = |i: &usize| !equations.differential[*i] && equations.indices[*i] > 1;
        let silent = (0..other.tracked.len()).filter(|k| pairs.iter().all(|pair| pair.0 != *k));
        let silent: Vec<String> = silent.map(|k| other.states[k].name.clone()).collect();
        StateMap {
            uncontrolled: (0..n).filter(|i| silent.is_empty() && algebraic(i)).collect(),
            untold: silent,
            of_states: form.routine_for(&seen),
            positions,
            of_positions: form.routine_for(&of_positions),
            states: pairs.iter().map(|p| p.0).collect(),
            of_known: reference.routine_for(&told),
            common: form.routine_for(&common),
            common_there: reference.routine_for(&common_there),
            unknown: untold,
            guesses,
            of_guesses: reference.routine_for(&guessed),
            carried: form.routine_for(&carried_here),
            carried_there: reference.routine_for(&carried_there),
            free: carried.iter().map(|c| c.0).collect(),
            groups: sparsity.groups(),
            sparsity,
            known,
            equations,
            twin,
        }
    }

    /// Makes room for the routines in the registers of both.
    pub fn reserve(&self, form: &mut Model, reference: &mut Model) {
        let StateMap { of_states, of_positions, common, carried, .. } = self;
        [of_states, of_positions, common, carried].into_iter().for_each(|routine| form.frame.reserve(routine));
        let StateMap { of_known, common_there, of_guesses, carried_there, .. } = self;
        let there = [of_known, common_there, of_guesses, carried_there];
        there.into_iter().for_each(|routine| reference.frame.reserve(routine));
    }
}

/// What takes the rate of an input has no value in any form: in a form whose unknowns it is among it stands for nothing.
pub(super) fn without_rates_of_inputs(program: &mut Program, reference: &Program) {
    let without = reference.observed.iter().filter(|o| matches!(o.value, Err(Unavailable::NeedsRateOf(_))));
    let without: BTreeMap<&str, &Unavailable> =
        without.filter_map(|o| Some((&*o.name, o.value.as_ref().err()?))).collect();
    for observed in &mut program.observed {
        if let Some(&why) = without.get(&*observed.name) {
            observed.value = Err(why.clone());
        }
    }
}

/// Where derivatives by unknowns or their rates may be nonzero.
fn sparsity_of(program: &Program, equations: &Implicit) -> Sparsity {
    let mut columns = vec![Vec::new(); program.states.len()];
    for (row, reads) in program.dependence.iter().enumerate() {
        reads.iter().for_each(|&column| columns[column as usize].push(row));
        if equations.explicit[row] {
            columns[row].push(row);
        }
    }
    Sparsity::from_columns(columns)
}
