//! What the functions of a model compute.

use std::collections::BTreeMap;

use halfarrow_compiler::program::{
    Arg, BlockId, Clause, Code, ConditionId, Jumps, Method, RatesInParts, Ratios, Routine, Solve, Value,
};

use super::{ModeTables, Plan};
use crate::Real;
use crate::c::cost::OperationCount;
use crate::c::write::Place;

/// Operations that are to be saved at each step where code is written twice for it.
const LEAST_SAVED: u64 = 300;

/// What is found where a step ends, one after the other: operands of conditions and rates of positions, outputs, and what
/// rates read that no input moves.
#[derive(Debug, Clone)]
pub(in crate::c) struct Ahead {
    /// How many of the first, and of outputs: all or none.
    seen: usize,
    pub shown: usize,
    known: Vec<Value>,
    /// Newton blocks that it reads.
    pub blocks: Vec<BlockId>,
}

impl Ahead {
    pub fn size(&self) -> usize {
        self.seen + self.shown + self.known.len()
    }

    /// The place of the first output.
    pub fn shown_from(&self) -> usize {
        self.seen
    }

    /// Where what rates read stands.
    pub fn places(&self) -> impl Iterator<Item = (Value, Place)> + '_ {
        let places = (self.seen + self.shown..).map(|index| Place { array: "m->ahead", index });
        self.known.iter().copied().zip(places)
    }
}

/// What the functions compute.
pub(super) struct Routines {
    pub preamble: Routine,
    pub rates: Routine,
    /// The unknowns of the Newton blocks that these read, and no more.
    pub solutions: Routine,
    /// Of positions that these read, and of those that only outputs do.
    pub motion: Routine,
    pub shown_motion: Routine,
    pub observe: Routine,
    pub switching: Routine,
    pub clock: Routine,
    pub sources: Routine,
    pub domains: Routine,
    /// What may be on its way back after an event.
    pub returns: Routine,
    /// Conditions of events, the new values that each event gives, what storages keep, the same with what balances of
    /// impulses read, constraints on displacements.
    pub becomes: Routine,
    pub clauses: Vec<Routine>,
    pub stored: Routine,
    pub impulses: Routine,
    pub positions: Routine,
    /// Margins of set-valued laws, with what they are compared, and what is carried from one mode to the next.
    pub margins: Routine,
    pub compared: Routine,
    pub carried: Routine,
    /// What follows from states and constants that are no variables themselves; variables that could change places, and what
    /// ratios between them are divided by.
    pub open: Routine,
    pub ratios: Routine,
    pub pivots: Routine,
    /// Relations onto which positions are put back.
    pub relations: Routine,
    /// What is asked for where a step ends and the next one begins, and rates of that.
    pub ahead: Option<(Ahead, [Routine; 2])>,
    /// What the start of a run asks for, each with the name of its function.
    pub starts: Vec<(String, Routine)>,
}

impl Routines {
    pub fn of(plan: &Plan) -> Routines {
        let p = plan.program;
        let rates: Vec<Value> = p.states.iter().map(|s| s.rate).collect();
        let shown = plan.export.recorded.iter().filter_map(|&i| p.observed[i].value.clone().ok());
        let operands = |ids: &[ConditionId]| ids.iter().map(|&c| p.conditions[c].operand).collect::<Vec<_>>();
        let residuals = |conditions: &[usize]| conditions.iter().map(|&c| p.start[c].residual).collect::<Vec<_>>();
        let passes = plan.passes.iter().enumerate().map(|(i, p)| ("pass", i, residuals(&p.conditions)));
        let groups = plan.groups.iter().enumerate().filter(|(_, g)| g.together);
        let groups = groups.map(|(i, g)| ("group", i, residuals(&g.conditions)));
        let guesses = p.guesses.iter().enumerate().filter(|_| plan.first);
        let guesses = guesses.map(|(i, g)| ("guess", i, vec![g.residual]));
        let start = |(kind, number, wanted): (&str, usize, Vec<Value>)| {
            (format!("ha_start_{kind}_{number}"), p.start_routine(&wanted))
        };
        let events = &plan.events;
        let stored = p.jumps.as_ref().map_or(&[][..], |jumps| &jumps.stored);
        // Behind the new values of a contact stands that with which it is at rest.
        let still = |c: &Clause| c.bound.and_then(|b| b.gap).map(|gap| gap.1).filter(|_| !c.actions.is_empty());
        let values = |c: &Clause| p.routine(&c.actions.iter().map(|a| a.value).chain(still(c)).collect::<Vec<_>>());
        let becomes: Vec<Value> = events.conditional.iter().map(|&c| p.clauses[c].trigger.value()).collect();
        let balanced = p.jumps.iter().flat_map(Jumps::values).chain(events.moved.iter().copied());
        let guarded = p.guarded_routine(&rates);
        let observe = p.guarded_routine(&shown.collect::<Vec<_>>());
        let read: Vec<BlockId> = newton_of(&guarded.code).map(|solve| solve.block).collect();
        let shown_blocks = newton_of(&observe.code).map(|solve| solve.block);
        let shown_alone: Vec<BlockId> = shown_blocks.filter(|block| !read.contains(block)).collect();
        let bounds = plan.mode.as_ref();
        let carried = bounds.map_or_else(Vec::new, |b| b.modes.values(p));
        let wanted: Vec<Value> = carried.iter().map(|v| v.1).collect();
        let of_bounds = |values: &dyn Fn(&ModeTables) -> Vec<Value>| p.routine(&bounds.map_or_else(Vec::new, values));
        Routines {
            open: of_bounds(&|b| b.open(p, &[0; 6]).into_iter().map(|o| o.2).collect()),
            ratios: p.routine(&plan.ratios().map_or_else(Vec::new, Ratios::values)),
            pivots: p.routine(&plan.ratios().map_or_else(Vec::new, |ratios| ratios.pivots.clone())),
            margins: of_bounds(&|b| b.bounds.values()),
            compared: of_bounds(&|b| b.bounds.compared.concat()),
            carried: p.routine(&wanted),
            becomes: p.routine(&becomes),
            returns: p.routine(&events.returning.iter().map(|r| r.1).collect::<Vec<_>>()),
            clauses: p.clauses.iter().map(values).collect(),
            stored: p.routine(stored),
            impulses: p.routine(&balanced.collect::<Vec<_>>()),
            positions: p.routine(&events.constraints(p).map(|c| c.residual).collect::<Vec<_>>()),
            preamble: p.preamble(&p.determined(&wanted)),
            solutions: p.routine(&p.unknowns_of(&read)),
            motion: p.routine(&p.rates_of_positions(&p.motion_blocks(&read))),
            shown_motion: p.routine(&p.rates_of_positions(&p.motion_blocks(&shown_alone))),
            rates: guarded,
            observe,
            switching: p.routine(&operands(&plan.switches)),
            clock: p.routine(&operands(&plan.clocks)),
            sources: p.routine(&p.held.iter().map(|h| h.source).collect::<Vec<_>>()),
            domains: p.routine(&p.domains.iter().map(|d| d.argument).collect::<Vec<_>>()),
            relations: plan.relations_routine(),
            ahead: None,
            starts: passes.chain(groups).chain(guesses).map(start).collect(),
        }
    }

    /// What a step asks for at its end and the next one first, in one go where that saves much: the code is written once more.
    #[must_use]
    pub fn with_ahead(mut self, plan: &Plan) -> Routines {
        let p = plan.program;
        if plan.export.real == Real::Float || !(plan.delays.is_empty() && plan.samples.is_empty()) {
            return self;
        }
        let own = |block: BlockId| !newton_of(&self.rates.code).any(|solve| solve.block == block);
        let shown = !newton_of(&self.observe.code).any(|solve| own(solve.block));
        let shown = if shown { &self.observe.wanted[..] } else { &[] };
        let RatesInParts { known, rest } = p.rates_ahead();
        let [operands, motions] = [&self.switching, &self.motion].map(|routine| &routine.wanted[..]);
        let ahead = p.guarded_routine(&[operands, motions, shown, &known].concat());
        let work = |routine: &Routine| OperationCount::of(p, &routine.code).own();
        let alone = [&self.rates, &self.switching, &self.motion]
            .into_iter()
            .chain((!shown.is_empty()).then_some(&self.observe));
        if alone.map(work).sum::<u64>() >= work(&ahead) + work(&rest) + LEAST_SAVED {
            let blocks = newton_of(&ahead.code).map(|solve| solve.block).collect();
            let (seen, shown) = (operands.len() + motions.len(), shown.len());
            self.ahead = Some((Ahead { seen, shown, known, blocks }, [ahead, rest]));
        }
        self
    }

    fn all(&self) -> impl Iterator<Item = &Routine> {
        let Routines { preamble, rates, solutions, motion, shown_motion, observe, switching, clock, .. } = self;
        let Routines { becomes, clauses, stored, impulses, positions, starts, margins, compared, carried, .. } = self;
        let Routines { open, ratios, pivots, relations, sources, domains, returns, .. } = self;
        let all = [
            preamble,
            rates,
            solutions,
            motion,
            shown_motion,
            observe,
            switching,
            clock,
            sources,
            domains,
            becomes,
            returns,
            stored,
            impulses,
            positions,
            margins,
            compared,
            carried,
            open,
            ratios,
            pivots,
            relations,
        ];
        all.into_iter().chain(clauses).chain(starts.iter().map(|s| &s.1))
    }

    /// All Newton blocks, each with what it reads from outside and its code.
    pub fn newton(&self) -> BTreeMap<BlockId, (&[Arg], &Code)> {
        let mut blocks = BTreeMap::new();
        for solve in self.all().flat_map(|r| newton_of(&r.code)) {
            if let Method::Newton { outer, code } = &solve.method {
                blocks.entry(solve.block).or_insert((&outer[..], code));
            }
        }
        blocks
    }

    /// What the preamble computes of what other routines read.
    pub fn kept(&self) -> Vec<(u32, Value)> {
        let Routine { wanted, code } = &self.preamble;
        let local =
            |(&value, &a): (&Value, &Arg)| if let Arg::Local(local) = a { Some((local.0, value)) } else { None };
        wanted.iter().zip(&code.outputs).filter_map(local).collect()
    }
}

/// The Newton blocks of some code.
pub(super) fn newton_of(code: &Code) -> impl Iterator<Item = &Solve> {
    code.solves().filter(|solve| matches!(solve.method, Method::Newton { .. }))
}
