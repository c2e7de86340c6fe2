//! Where the branches of set-valued laws end, in tables: margins, commands, and with what margins are compared.

use super::{Bound, ConditionId, EventTrigger, Measure, Op, Program, Target, Value};
use crate::equations::ObservedKind;
use crate::unit::Unit;

/// The bounds of the branches of a mode.
#[derive(Debug, Clone, Default)]
pub struct Bounds {
    /// Those that are margins.
    pub margins: Vec<Margin>,
    /// Those that are conditions, each with its clause.
    pub commands: Vec<(usize, Bound)>,
    /// The branch of each law.
    pub branches: Vec<u32>,
    /// What margins are compared with: groups of efforts or flows of one unit, the same ones in all modes.
    pub compared: Vec<Vec<Value>>,
}

/// A bound that is a margin.
#[derive(Debug, Clone, Copy)]
pub struct Margin {
    /// Its clause.
    pub clause: usize,
    /// The bound.
    pub bound: Bound,
    /// What is never negative while the branch holds.
    pub value: Value,
    /// Its place among [`Bounds::values`], its rate behind it if it is a gap.
    pub place: usize,
    /// The condition of the state that it is below zero, if there is one.
    pub condition: Option<ConditionId>,
    /// Law, branch and number of the bound.
    pub key: (u32, u32, u32),
    /// The group with which it is compared; of a gap its rate.
    pub group: usize,
    /// Whether impulses act where its sides meet.
    pub meets: bool,
}

impl Bounds {
    /// The margins, the rate of a gap behind it.
    pub fn values(&self) -> Vec<Value> {
        let rate = |m: &Margin| m.bound.gap.map(|(rate, _)| rate);
        self.margins.iter().flat_map(|m| std::iter::once(m.value).chain(rate(m))).collect()
    }
}

impl Program {
    /// The branch of each set-valued law in which the program holds.
    pub fn branches(&self) -> Vec<u32> {
        self.set_valued.iter().map(|law| law.present).collect()
    }

    /// Where the branches of the set-valued laws end; `None` if there are no such laws, or another form looks for their ends.
    pub fn bounds(&self) -> Option<Bounds> {
        if self.clauses.iter().all(|clause| clause.bound.is_none()) {
            return None;
        }
        let mut kinds: Vec<(ObservedKind, Option<Unit>)> = Vec::new();
        // Of each law one group of efforts and one of flows, those of one unit being one: the same in all modes.
        let groups: Vec<[usize; 2]> = (0..self.set_valued.len())
            .map(|law| [Measure::Effort, Measure::Flow].map(|measure| self.group(law, measure, &mut kinds)))
            .collect();
        let mut bounds = Bounds { branches: self.branches(), ..Bounds::default() };
        let mut numbers = vec![0; self.set_valued.len()];
        let mut place = 0;
        for (clause, c) in self.clauses.iter().enumerate() {
            let Some(bound) = c.bound else { continue };
            let law = bound.law as usize;
            let number = numbers[law];
            numbers[law] += 1;
            let Some(value) = bound.margin else {
                bounds.commands.push((clause, bound));
                continue;
            };
            bounds.margins.push(Margin {
                clause,
                bound,
                value,
                place,
                condition: self.condition_of(c.trigger.value()),
                key: (bound.law, self.set_valued[law].present, number),
                group: groups[law][usize::from(bound.measure != Measure::Effort)],
                meets: bound.gap.is_some() && c.actions.iter().any(|a| matches!(a.target, Target::Moved { .. })),
            });
            place += 1 + usize::from(bound.gap.is_some());
        }
        let alike = |(kind, unit): &(ObservedKind, Option<Unit>)| {
            let all = self.observed.iter().filter(|o| o.kind == *kind && o.unit == *unit);
            all.filter_map(|o| o.value.clone().ok()).collect()
        };
        bounds.compared = kinds.iter().map(alike).collect();
        Some(bounds)
    }

    /// The number of the group of what a law is measured in, put behind the others if it is new.
    fn group(&self, law: usize, measure: Measure, kinds: &mut Vec<(ObservedKind, Option<Unit>)>) -> usize {
        let (port, kind) = match measure {
            Measure::Effort => ("e", ObservedKind::Effort),
            Measure::Flow | Measure::Gap => ("f", ObservedKind::Flow),
        };
        let name = format!("{}.{port}", self.set_valued[law].name);
        let unit = self.observed.iter().find(|o| *o.name == *name).and_then(|o| o.unit.clone());
        let known = kinds.iter().position(|known| *known == (kind, unit.clone()));
        known.unwrap_or_else(|| {
            kinds.push((kind, unit));
            kinds.len() - 1
        })
    }

    /// The condition of the state that a truth value is.
    fn condition_of(&self, value: Value) -> Option<ConditionId> {
        match self.values.op(value) {
            Op::Sign(condition, _) => Some(condition).filter(|c| self.conditions[*c].trigger == EventTrigger::State),
            _ => None,
        }
    }
}
