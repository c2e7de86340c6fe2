//! What happens at events, in tables.

use halfarrow_compiler::program::{EventTrigger, Op, Program, StartCondition, Target, Trigger, Value};

use crate::c::header::comment;
use crate::c::written::{Needed, Notes, Part, Written, written};

/// What an action changes, as in `runtime/events.c`.
const KINDS: [&str; 4] = ["HA_DISCRETE", "HA_SIGNAL", "HA_MOVED", "HA_HELD_BY_BRANCH"];

/// What happens at events.
#[derive(Debug, Clone, Default)]
pub(in crate::c) struct EventTables {
    /// Clauses with a condition, and those with a period.
    pub conditional: Vec<usize>,
    pub periodic: Vec<usize>,
    /// Clauses of the modeller whose condition is the sign of one number of the state, and these numbers: what they lead to may
    /// be on its way back across the border.
    pub returning: Vec<(usize, Value)>,
    /// Where the actions of each clause begin.
    starts: Vec<usize>,
    /// What each changes: of which kind, its place, the impulse that does it.
    actions: Vec<(usize, usize, usize)>,
    /// What resets change, each once.
    pub moved: Vec<Value>,
    /// States and conserved constants by which storages tell what they keep.
    pub unknowns: Vec<u32>,
    balances: usize,
    /// The states that each constraint on displacements reads which events may break.
    pub positions: Vec<Vec<u32>>,
}

impl EventTables {
    pub fn of(program: &Program) -> EventTables {
        let all = || program.clauses.iter().enumerate();
        let is_periodic = |trigger| matches!(trigger, Trigger::Every(_));
        let actions = || program.clauses.iter().flat_map(|c| &c.actions);
        let mut moved: Vec<Value> = actions()
            .filter_map(|a| if let Target::Moved { what, .. } = a.target { Some(what) } else { None })
            .collect();
        moved.sort_unstable();
        moved.dedup();
        let target = |target: Target| match target {
            Target::Discrete(place) => (0, place as usize, 0),
            Target::Signal(state) => (1, state as usize, 0),
            Target::Moved { what, impulse } => {
                (2, moved.binary_search(&what).expect("it is among what resets change"), impulse as usize)
            }
            Target::HeldByBranch => (3, 0, 0),
        };
        let sign = |trigger| match (trigger, program.values.op(Trigger::value(trigger))) {
            (Trigger::Becomes(_), Op::Sign(condition, _)) => Some(&program.conditions[condition]),
            _ => None,
        };
        let own = all().filter(|(_, c)| c.bound.is_none());
        let returning = own.filter_map(|(i, c)| Some((i, sign(c.trigger)?)));
        let mut tables = EventTables {
            returning: returning
                .filter(|(_, c)| c.trigger == EventTrigger::State)
                .map(|(i, c)| (i, c.operand))
                .collect(),
            conditional: all().filter(|(_, c)| !is_periodic(c.trigger)).map(|(i, _)| i).collect(),
            periodic: all().filter(|(_, c)| is_periodic(c.trigger)).map(|(i, _)| i).collect(),
            starts: starts(program.clauses.iter().map(|c| c.actions.len())),
            actions: actions().map(|a| target(a.target)).collect(),
            unknowns: program.jumps.iter().flat_map(|j| j.unknowns.iter().copied()).collect(),
            balances: program.jumps.as_ref().map_or(0, |j| j.balances.len()),
            positions: Vec::new(),
            moved,
        };
        let states = program.states.len() as u32;
        let reads = |reads: &[u32]| reads.iter().copied().filter(|u| *u < states).collect();
        tables.positions = tables.constraints(program).map(|c| reads(&c.reads)).collect();
        tables
    }

    /// The constraints on displacements that events may break.
    pub fn constraints<'p>(&self, program: &'p Program) -> impl Iterator<Item = &'p StartCondition> + use<'p> {
        let any = !self.actions.is_empty();
        program.constraints_on_states().map(|(_, c)| c).filter(move |_| any)
    }

    /// The periods, in s.
    pub fn periods<'p>(&'p self, program: &'p Program) -> impl Iterator<Item = Value> + 'p {
        self.periodic.iter().map(|&c| program.clauses[c].trigger.value())
    }

    /// How many things are changed at events.
    pub fn actions(&self) -> usize {
        self.actions.len()
    }

    /// Equations and unknowns of the balance of impulses at most.
    pub fn equations(&self) -> usize {
        self.balances + self.moved.len()
    }

    pub fn columns(&self) -> usize {
        self.unknowns.len() + self.moved.len()
    }

    /// Each word with its text, as `lines` and `list` write numbers.
    pub fn words(
        &self,
        program: &Program,
        lines: &dyn Fn(Vec<String>) -> String,
        list: &dyn Fn(Vec<String>) -> String,
    ) -> Vec<(&'static str, String)> {
        let numbers = |values: &[usize]| values.iter().map(usize::to_string).collect::<Vec<_>>();
        let of_states = |values: &[u32]| values.iter().map(u32::to_string).collect::<Vec<_>>();
        let jumps = program.jumps.clone().unwrap_or_default();
        let terms: Vec<usize> = jumps.balances.iter().flatten().map(|t| t.0 as usize).collect();
        let rows: Vec<usize> = jumps.impulses.iter().flat_map(|i| &i.along).map(|t| t.0 as usize).collect();
        let held: Vec<usize> = jumps.impulses.iter().map(|i| i.held as usize).collect();
        vec![
            ("CLAUSES", program.clauses.len().to_string()),
            ("CONDITIONAL", list(numbers(&self.conditional))),
            ("CONDITIONALS", self.conditional.len().to_string()),
            ("PERIODIC", list(numbers(&self.periodic))),
            ("PERIODICS", self.periodic.len().to_string()),
            ("RETURNING", list(self.returning.iter().map(|r| r.0.to_string()).collect())),
            ("RETURNS", self.returning.len().to_string()),
            ("ACTIONS", self.actions.len().to_string()),
            ("ACTION_STARTS", lines(numbers(&self.starts))),
            ("ACTION_KINDS", lines(self.actions.iter().map(|a| KINDS[a.0].to_string()).collect())),
            ("ACTION_PLACES", lines(self.actions.iter().map(|a| a.1.to_string()).collect())),
            ("ACTION_IMPULSES", lines(self.actions.iter().map(|a| a.2.to_string()).collect())),
            ("JUMP_STORED", jumps.stored.len().to_string()),
            ("JUMP_BALANCES", jumps.balances.len().to_string()),
            ("JUMP_UNKNOWNS", self.unknowns.len().to_string()),
            ("JUMP_UNKNOWN_LIST", lines(of_states(&self.unknowns))),
            ("JUMP_IMPULSES", jumps.impulses.len().to_string()),
            ("FIRST_MOVED", jumps.values().count().to_string()),
            ("BALANCE_FACTORS", terms.len().to_string()),
            ("BALANCE_STARTS", lines(numbers(&starts(jumps.balances.iter().map(Vec::len))))),
            ("BALANCE_TERMS", lines(numbers(&terms))),
            ("IMPULSE_STARTS", lines(numbers(&starts(jumps.impulses.iter().map(|i| i.along.len()))))),
            ("IMPULSE_ROWS", lines(numbers(&rows))),
            ("IMPULSE_HELD", lines(numbers(&held))),
            ("POSITIONS", self.positions.len().to_string()),
            ("POSITION_STARTS", list(numbers(&starts(self.positions.iter().map(Vec::len))))),
            ("POSITION_READS", list(of_states(&self.positions.concat()))),
        ]
    }
}

/// The name of the function of a clause.
pub(super) fn code_of(clause: usize) -> String {
    format!("ha_clause_{clause}")
}

/// The cases of the function that calls it.
pub(super) fn cases(program: &Program) -> Written {
    cases_of(
        program.clauses.iter().enumerate().map(|(i, clause)| (format!(" /* {} */", comment(&clause.name)), code_of(i))),
    )
}

/// The cases of a function that calls code by its number, each with a comment.
pub(super) fn cases_of(codes: impl Iterator<Item = (String, String)>) -> Written {
    let mut notes = Notes::default();
    let mut text = String::new();
    for (i, (about, code)) in codes.enumerate() {
        let code = Needed(code.into());
        let case = written!("    case {}:{}\n        return {}(m, t, x, out);\n", i, about, code);
        case.note(&mut notes);
        text += &case.text;
    }
    Written { notes, ..Written::of(text.trim_end()) }
}

/// Where each of several lists begins, and the last one ends.
fn starts(lengths: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut starts = vec![0];
    lengths.for_each(|length| starts.push(starts[starts.len() - 1] + length));
    starts
}
