//! The source: which parts it has, and in which order.

use halfarrow_compiler::algebra::math;
use halfarrow_compiler::program::{ConditionKind, EventTrigger, LawDomain, Reads};

use super::step_order::StepOrder;
use super::{ModeTables, Plan};
use crate::c::few;
use crate::c::flags::Flags;
use crate::c::fragment::{Fragment, assembled};
use crate::c::header::comment;
use crate::c::messages;
use crate::c::template::Filling;
use crate::c::written::Written;
use crate::{Method, Real};

/// The search of the solutions of nonlinear blocks.
const NEWTON: &str = concat!(
    include_str!("../runtime/newton/workspace.c"),
    include_str!("../runtime/newton/correction.c"),
    include_str!("../runtime/newton/floating.c"),
    include_str!("../runtime/newton/damped.c"),
    include_str!("../runtime/newton/continuation.c"),
    include_str!("../runtime/newton/search.c"),
);

/// What happens at events.
const EVENTS: &str = concat!(
    include_str!("../runtime/events.c"),
    include_str!("../runtime/impulses.c"),
    include_str!("../runtime/contacts.c"),
    include_str!("../runtime/rounds.c"),
);

impl Plan<'_> {
    /// With what templates are filled, and with what those that compute in double precision whatever real numbers are.
    fn fillings(&self, obligations: String) -> [Filling<'_>; 2] {
        let mut words = self.words();
        words.insert("OBLIGATION_LINES", Written::of(obligations));
        words.insert("MODEL_TITLE", Written::of(comment(&self.program.name)));
        let filling = |real| Filling { flags: self.flags(), words: words.clone(), model: &self.name, real };
        [filling(self.export.real), filling(Real::Double)]
    }

    /// The source file; at its head stands what it keeps to.
    pub(in crate::c) fn source(&self, obligations: String) -> String {
        let mut all = self.fragments(&obligations);
        all.extend(self.beginning(&obligations));
        assembled(&all)
    }

    /// How runs begin.
    pub(in crate::c) fn beginning(&self, obligations: &str) -> Vec<Fragment> {
        let [filling, _] = self.fillings(obligations.to_string());
        let mut all = filling.fragments(include_str!("../runtime/start.c"));
        if self.solves_start() {
            all.extend(filling.fragments(include_str!("../runtime/start_solve.c")));
        }
        all.extend(filling.fragments(include_str!("../runtime/begin.c")));
        all
    }

    /// How runs go from one mode to the next.
    pub(in crate::c) fn changes_of_mode(&self) -> Vec<Fragment> {
        let [filling, _] = self.fillings(String::new());
        filling.fragments(include_str!("../runtime/modes.c"))
    }

    /// What steps are made of.
    pub(in crate::c) fn fragments(&self, obligations: &str) -> Vec<Fragment> {
        let [filling, wide] = self.fillings(obligations.to_string());
        let mut all = filling.fragments(include_str!("../runtime/top.c"));
        let mut put = |fragments: Vec<Fragment>| all.extend(fragments);
        put(wide.fragments(math::C_SOURCE));
        put(vec![Fragment::section("small things")]);
        if self.export.real == Real::Float {
            put(wide.fragments(math::C_SOURCE_SINGLE));
            put(wide.fragments(include_str!("../runtime/small.c")));
        }
        put(filling.fragments(include_str!("../runtime/small.c")));
        put(filling.fragments(include_str!("../runtime/helpers.c")));
        if self.sizes.order > 0 {
            put(filling.fragments(include_str!("../runtime/lu.c")));
            put(filling.fragments(&few::TEMPLATE));
            put(filling.fragments(include_str!("../runtime/linear.c")));
        }
        if !self.newton.is_empty() {
            put(filling.fragments(NEWTON));
        }
        put(filling.fragments(include_str!("../runtime/tables.c")));
        put(wide.fragments(include_str!("../runtime/conditions.c")));
        put(vec![Fragment::section("the equations")]);
        put(self.functions.iter().cloned().map(Fragment::from).collect());
        if !self.clocks.is_empty() {
            put(wide.fragments(include_str!("../runtime/clock.c")));
        }
        put(filling.fragments(include_str!("../runtime/held.c")));
        put(filling.fragments(include_str!("../runtime/system.c")));
        put(filling.fragments(include_str!("../runtime/returns.c")));
        put(filling.fragments(include_str!("../runtime/accept.c")));
        put(filling.fragments(include_str!("../runtime/margins.c")));
        put(filling.fragments(include_str!("../runtime/branches.c")));
        if !self.program.clauses.is_empty() || self.program.jumps.is_some() {
            put(filling.fragments(EVENTS));
        }
        put(filling.fragments(include_str!("../runtime/ratios.c")));
        put(filling.fragments(include_str!("../runtime/enter.c")));
        put(filling.fragments(include_str!("../runtime/cross.c")));
        if self.export.method.is_implicit() {
            put(filling.fragments(include_str!("../runtime/matrix.c")));
        }
        put(filling.fragments(include_str!("../runtime/advance.c")));
        put(filling.fragments(match self.export.method {
            Method::ImplicitMidpoint => include_str!("../runtime/midpoint.c"),
            method if method.keeps_steps() => include_str!("../runtime/bdf2.c"),
            method if method.takes_time_derivative() => include_str!("../runtime/rosenbrock.c"),
            _ => include_str!("../runtime/explicit.c"),
        }));
        if !self.relations().is_empty() {
            put(filling.fragments(include_str!("../runtime/projection.c")));
        }
        put(filling.fragments(include_str!("../runtime/step.c")));
        put(filling.fragments(include_str!("../runtime/parameters.c")));
        put(messages::messages(self));
        all
    }

    pub(super) fn kinds(&self) -> impl Iterator<Item = ConditionKind> + '_ {
        self.program.conditions.values().map(|c| c.kind)
    }

    /// What the model has.
    pub(in crate::c) fn flags(&self) -> Flags {
        let Plan { export, program: p, .. } = *self;
        let mode = self.mode.as_ref();
        let bounds = mode.filter(|mode| mode.has_laws());
        let held = !(self.delays.is_empty() && self.samples.is_empty());
        let time_derivative = export.method.takes_time_derivative();
        let few = |n: usize| export.real == Real::Double && p.blocks.values().any(|block| block.size() == n);
        let always = |d: &LawDomain| p.values.reads(d.argument) == Reads::PARAMETERS;
        Flags {
            single: export.real == Real::Float,
            states: !p.states.is_empty(),
            inputs: !p.inputs.is_empty(),
            parameters: !p.parameters.is_empty(),
            outputs: !export.recorded.is_empty(),
            conserved: !p.conserved.is_empty(),
            positions: !p.positions.is_empty(),
            sought_positions: !self.sought_positions().is_empty(),
            moving_positions: !self.motion_blocks.is_empty(),
            rates_motion: self.motion_of_rates > 0,
            shown_motion: self.motion_blocks.len() > self.motion_of_rates,
            tables: !p.tables.is_empty(),
            conditions: !p.conditions.is_empty(),
            holds: !p.conditions.is_empty() || bounds.is_some(),
            sign_conditions: self.kinds().any(|k| k == ConditionKind::Sign),
            floor_conditions: self.kinds().any(|k| k == ConditionKind::Floor),
            piece_conditions: self.kinds().any(|k| matches!(k, ConditionKind::Piece(_))),
            clocks: !self.clocks.is_empty(),
            curves: self.clocks.iter().any(|&c| p.conditions[c].trigger == EventTrigger::CurvedTime),
            switches: !self.switches.is_empty(),
            clauses: !p.clauses.is_empty(),
            conditional_clauses: !self.events.conditional.is_empty(),
            periodic_clauses: !self.events.periodic.is_empty(),
            returns: !self.events.returning.is_empty(),
            locates: self.locates(),
            impulses: p.jumps.is_some(),
            resets: !self.events.moved.is_empty(),
            leaps: p.jumps.as_ref().is_some_and(|jumps| jumps.leaps),
            constraints: !self.events.positions.is_empty(),
            discretes: !self.discretes.is_empty(),
            held,
            delays: !self.delays.is_empty(),
            samples: !self.samples.is_empty(),
            only_samples: held && self.delays.is_empty(),
            newton: !self.newton.is_empty(),
            sparse: self.patterns.any_sparse(),
            two_equations: few(2),
            three_equations: few(3),
            four_equations: few(4),
            newton_single: self.newton.iter().any(|&b| p.blocks[b].size() == 1),
            follows: !(self.rates_blocks.is_empty() && self.shown_blocks.is_empty()),
            rates_newton: !self.rates_blocks.is_empty(),
            shown_newton: !self.shown_blocks.is_empty(),
            domains: !p.domains.is_empty(),
            domains_always: p.domains.iter().any(always),
            assumptions: !p.assumptions.is_empty(),
            directional_derivative: self.has_directional_derivative(),
            derivatives: export.derivatives,
            time_derivative,
            keeps_steps: export.method.keeps_steps(),
            compares_rates: self.compares_rates(),
            finds_by_parts: self.steps_to_find().is_some(),
            looks_ahead: self.ahead.is_some(),
            moves_ahead: self.ahead.is_some() && self.motion_of_rates > 0,
            shows_ahead: self.ahead.as_ref().is_some_and(|ahead| ahead.shown > 0),
            ahead_newton: self.ahead.as_ref().is_some_and(|ahead| !ahead.blocks.is_empty()),
            knows_common: self.beside.is_some(),
            common_newton: self.beside.as_ref().is_some_and(|beside| !beside.blocks.is_empty()),
            inputs_jump: self.inputs_jump,
            time_passes: time_derivative || held || bounds.is_some() || !self.events.returning.is_empty(),
            moves: !p.clauses.is_empty() || mode.is_some(),
            modes: mode.is_some(),
            exchanges: mode.is_some_and(|mode| mode.modes.exchanged() > 0),
            ratios: self.ratios().is_some(),
            watches: self.watched.is_some(),
            may_pass: self.may_pass(),
            bounds: bounds.is_some(),
            gaps: bounds.is_some_and(ModeTables::has_gaps),
            meets: bounds.is_some_and(ModeTables::meets),
            releases: bounds.is_some_and(|b| b.modes.releases()),
            leaps_balanced: bounds.is_some() || p.jumps.as_ref().is_some_and(|jumps| jumps.leaps),
            linear_constant: self.sizes.factored > 0,
            step_order: self.step_order.is_some(),
            step_full: self.step_order.as_ref().is_some_and(StepOrder::has_full),
            relations: !self.relations().is_empty(),
            solves_start: self.solves_start(),
            guesses: !p.guesses.is_empty(),
            start_groups: self.groups.iter().any(|g| g.together),
        }
    }
}
