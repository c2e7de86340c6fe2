//! The variables that importers see: their value references, kinds and start values.

use halfarrow_compiler::program::{EventTrigger, Op, Program, Reads, Trigger, Value};
use halfarrow_compiler::unit::Unit;

use crate::c::Export;

use super::dependence::{Knowns, knowns_of};

/// What a variable is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Time,
    State,
    /// The derivative of the state with this number.
    Derivative(usize),
    Input,
    /// Whether it can be set at run time.
    Parameter(bool),
    /// A parameter given by other ones.
    Calculated(bool),
    /// Whether it changes at events only.
    Output(bool),
    /// A function that changes its sign where a condition switches; a variable in FMI 3 only.
    Indicator,
}

/// A variable.
#[derive(Debug, Clone)]
pub(super) struct Variable {
    pub name: String,
    pub reference: usize,
    pub role: Role,
    pub unit: Option<Unit>,
    /// Its value at the start, where importers may set another one.
    pub start: Option<f64>,
}

/// All of them.
#[derive(Debug, Clone)]
pub(super) struct Variables {
    pub all: Vec<Variable>,
    settable: Vec<u8>,
}

impl Variables {
    pub fn of(export: &Export) -> Variables {
        let p = export.program;
        let n = p.states.len();
        let variable = |name: &str, reference, role, unit: Option<&Unit>| Variable {
            name: name.to_string(),
            reference,
            role,
            unit: unit.cloned(),
            start: None,
        };
        let mut all = vec![variable("time", 0, Role::Time, Unit::parse("s").ok().as_ref())];
        all.extend(p.states.iter().enumerate().map(|(i, s)| variable(&s.name, 1 + i, Role::State, s.unit.as_ref())));
        all.extend(p.states.iter().enumerate().map(|(i, s)| {
            let unit = s.unit.as_ref().and_then(per_second);
            variable(&format!("der({})", s.name), 1 + n + i, Role::Derivative(i), unit.as_ref())
        }));
        let first = 1 + 2 * n;
        for (i, input) in p.inputs.iter().enumerate() {
            let start = Some(export.start.inputs[i]);
            all.push(Variable { start, ..variable(&input.name, first + i, Role::Input, input.unit.as_ref()) });
        }
        let first = first + p.inputs.len();
        let structural = structural(p);
        let mut settable = Vec::new();
        for (i, parameter) in p.parameters.iter().enumerate() {
            let given = knowns_of(p, &[parameter.default]);
            let tunable = !structural.contains(&(i as u32));
            let role = match given.parameters.iter().any(|&j| !p.parameters[j as usize].constant) {
                true => Role::Calculated(tunable),
                false => Role::Parameter(tunable),
            };
            let free = !parameter.constant && matches!(role, Role::Parameter(_));
            settable.push(if free { 1 + u8::from(tunable) } else { 0 });
            if !parameter.constant {
                let start = matches!(role, Role::Parameter(_)).then(|| export.start.parameters[i]);
                all.push(Variable { start, ..variable(&parameter.name, first + i, role, parameter.unit.as_ref()) });
            }
        }
        let first = first + p.parameters.len();
        for (i, &observed) in export.recorded.iter().enumerate() {
            let observed = &p.observed[observed];
            let discrete = observed.value.as_ref().is_ok_and(|&v| is_discrete(p, v));
            all.push(variable(&observed.name, first + i, Role::Output(discrete), observed.unit.as_ref()));
        }
        let first = first + export.recorded.len();
        all.extend(
            (0..most_indicators(export))
                .map(|i| variable(&format!("indicator_{}", i + 1), first + i, Role::Indicator, None)),
        );
        make_unique(&mut all);
        Variables { all, settable }
    }

    /// For each parameter whether it can be set: 0 no, 1 before the start, 2 at any time.
    pub fn settable(&self) -> &[u8] {
        &self.settable
    }

    /// The place of a variable in the list, by its value reference.
    pub fn place(&self, reference: usize) -> Option<usize> {
        self.all.iter().position(|v| v.reference == reference)
    }

    /// Typical magnitudes of the states, at the start or as they grow from rest; 1 where they are not known. One that is much below that of another state of the
    /// same unit is what rounding has left of it: that of the other one is taken.
    pub fn nominals(&self, export: &Export) -> Vec<f64> {
        let states = &export.program.states;
        // In another mode a state may be of another size: what is next to nothing at the start says nothing.
        let least = if export.has_modes() { SMALL } else { 0.0 };
        let known = |scales: &[f64], i: usize| scales.get(i).copied().filter(|s| *s > least && s.is_finite());
        let scale = |i: usize| known(&export.start.scales, i).or(known(&export.start.grown, i)).unwrap_or(0.0);
        let unit = |i: usize| states[i].unit.as_ref().map(|u| u.dimension);
        let nominal = |i: usize| {
            let like = (0..states.len()).filter(|&k| unit(k) == unit(i));
            let greatest = like.map(scale).fold(0.0, f64::max);
            match (scale(i), greatest) {
                (_, 0.0) => 1.0,
                (own, greatest) if own < SMALL * greatest => greatest,
                (own, _) => own,
            }
        };
        (0..states.len()).map(nominal).collect()
    }

    /// The value references of what is known.
    pub fn references(&self, p: &Program, knowns: &Knowns) -> Vec<usize> {
        let n = p.states.len();
        let mut all: Vec<usize> = Vec::new();
        if knowns.time {
            all.push(0);
        }
        all.extend(knowns.states.iter().map(|&i| 1 + i as usize));
        all.extend(knowns.inputs.iter().map(|&i| 1 + 2 * n + i as usize));
        let first = 1 + 2 * n + p.inputs.len();
        let free = |&&i: &&u32| self.settable[i as usize] > 0;
        all.extend(knowns.parameters.iter().filter(free).map(|&i| first + i as usize));
        all
    }
}

/// Part of the magnitude of another state of its unit below which a magnitude is none.
const SMALL: f64 = 1e-6;

/// The operand of each event indicator.
pub(super) fn indicators(p: &Program) -> Vec<Value> {
    let of_state = p.conditions.values().filter(|c| c.trigger == EventTrigger::State);
    of_state.flat_map(|c| vec![c.operand; c.kind.switches()]).collect()
}

/// How many event indicators the mode with most of them has.
fn most_indicators(export: &Export) -> usize {
    let modes = export.modes.iter().map(|mode| &mode.program);
    std::iter::once(export.program).chain(modes).map(|p| indicators(p).len()).max().unwrap_or(0)
}

/// Whether a value is that of a discrete variable.
fn is_discrete(p: &Program, value: Value) -> bool {
    matches!(p.values.op(value), Op::Held(i) if p.held[i as usize].kind.is_discrete())
}

/// Parameters that delays, samples and periods of events read: what they remember depends on them.
fn structural(p: &Program) -> Vec<u32> {
    let periods = p.clauses.iter().map(|c| c.trigger).filter(|t| matches!(t, Trigger::Every(_))).map(Trigger::value);
    let times: Vec<Value> = p.held.iter().map(|h| h.time).chain(periods).collect();
    debug_assert!(times.iter().all(|&v| p.values.reads(v) == Reads::PARAMETERS));
    let mut all: Vec<u32> = knowns_of(p, &times).parameters.into_iter().collect();
    all.extend(times.iter().filter_map(|&v| if let Op::Parameter(i) = p.values.op(v) { Some(i) } else { None }));
    all
}

fn per_second(unit: &Unit) -> Option<Unit> {
    let text = unit.to_si_unit().to_string();
    let simple = text.chars().all(|c| c.is_alphanumeric());
    match text.as_str() {
        "" | "1" => Unit::parse("1/s").ok(),
        _ if simple => Unit::parse(&format!("{text}/s")).ok(),
        _ => Some(Unit::si(unit.dimension.over(halfarrow_compiler::unit::Dimension::SECOND))),
    }
}

/// Names are unique: a second one of the same name gets a number.
fn make_unique(all: &mut [Variable]) {
    let mut taken = std::collections::BTreeSet::new();
    for variable in all {
        let free = (1..).map(|i| if i == 1 { variable.name.clone() } else { format!("{}_{i}", variable.name) });
        let name = free.into_iter().find(|n| !taken.contains(n)).unwrap_or_default();
        taken.insert(name.clone());
        variable.name = name;
    }
}
