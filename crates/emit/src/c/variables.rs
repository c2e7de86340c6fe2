//! What the locals of a function are: variables of the model, where they have a name.

use halfarrow_compiler::program::{Layout, Program, Value};
use rustc_hash::FxHashMap;

use super::ssa::{self, Arg, Code, Inner};

/// More names than this for one value are not told.
const MOST_NAMES: usize = 3;

/// What is computed, told by what it is made of: equal numbers, equal values.
type Form = (String, Vec<u32>, usize);

/// The names of values in code.
#[derive(Debug, Clone, Default)]
pub(super) struct Variables {
    forms: FxHashMap<Form, u32>,
    names: FxHashMap<u32, Vec<String>>,
}

impl Variables {
    /// All that can be recorded, and the rates of the states.
    pub fn of(program: &Program, layout: &Layout) -> Variables {
        let recorded = program.observed.iter().filter_map(|o| Some((o.name.clone(), o.value.clone().ok()?)));
        let rates = program.states.iter().map(|s| (format!("{}'", s.name), s.rate));
        let named: Vec<(String, Value)> =
            recorded.chain(rates).filter(|(_, value)| !layout.registers.contains_key(value)).collect();
        let wanted: Vec<Value> = named.iter().map(|n| n.1).collect();
        let code = ssa::of_routine(program, layout, &program.routine(layout, &wanted), &mut Inner::default());
        let mut variables = Variables::default();
        let numbers = variables.numbers(&code);
        for ((name, _), output) in named.into_iter().zip(&code.outputs) {
            if let Arg::Local(i) = *output {
                variables.names.entry(numbers[i as usize]).or_default().push(name);
            }
        }
        variables
    }

    /// For each local of some code its names, with commas between them.
    pub fn of_locals(&mut self, code: &Code) -> Vec<Option<String>> {
        let numbers = self.numbers(code);
        let told = |names: &Vec<String>| match names.len() {
            n if n > MOST_NAMES => format!("{}, ...", names[..MOST_NAMES].join(", ")),
            _ => names.join(", "),
        };
        numbers.iter().map(|number| self.names.get(number).map(told)).collect()
    }

    fn numbers(&mut self, code: &Code) -> Vec<u32> {
        let mut of_local = vec![u32::MAX; code.locals as usize];
        for step in &code.steps {
            let args: Vec<u32> = step
                .args
                .iter()
                .map(|a| match *a {
                    Arg::Local(i) => of_local[i as usize],
                    given => self.number((format!("{given:?}"), Vec::new(), 0)),
                })
                .collect();
            for (place, &out) in step.outs.iter().enumerate() {
                of_local[out as usize] = self.number((format!("{:?}", step.act), args.clone(), place));
            }
        }
        of_local
    }

    fn number(&mut self, form: Form) -> u32 {
        let next = self.forms.len() as u32;
        *self.forms.entry(form).or_insert(next)
    }
}
