//! What the locals of a function are: variables of the model, where they have a name.

use halfarrow_compiler::algebra::dotted;
use halfarrow_compiler::program::{Code, Program, Value};
use rustc_hash::FxHashMap;

use super::givens::Givens;

/// More names than this for one value are not told.
const MOST_NAMES: usize = 3;

/// The names of values in code.
#[derive(Debug, Clone, Default)]
pub(super) struct Variables {
    names: FxHashMap<Value, Vec<String>>,
}

impl Variables {
    /// All that can be recorded, and the rates of the states.
    pub fn of(program: &Program, givens: &Givens) -> Variables {
        let recorded = program.observed.iter().filter_map(|o| Some((o.name.to_string(), o.value.clone().ok()?)));
        let rates = program.states.iter().map(|s| (dotted(&s.name, 1), s.rate));
        let mut variables = Variables::default();
        for (name, value) in recorded.chain(rates) {
            if !program.values.op(value).is_given() && !givens.is_timely(value) {
                variables.names.entry(value).or_default().push(name);
            }
        }
        variables
    }

    /// For each local of some code its names, with commas between them.
    pub fn of_locals(&self, code: &Code) -> Vec<Option<String>> {
        let told = |names: &Vec<String>| match names.len() {
            n if n > MOST_NAMES => format!("{}, ...", names[..MOST_NAMES].join(", ")),
            _ => names.join(", "),
        };
        code.values.iter().map(|value| self.names.get(&(*value)?).map(told)).collect()
    }
}
