//! The members of the structure that a model is: how they are declared, and the bytes that they take.

use halfarrow_compiler::program::EventTrigger;

use super::plan::{ModeTables, Plan, StepOrder};
use crate::{Method, Real};

/// What a member is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// A real number.
    Real,
    /// A number of double precision.
    Wide,
    Int,
    Byte,
    /// A structure of the model, by what its name ends with.
    Failure,
    Delay,
    Point,
    Sample,
    Clause,
}

impl Kind {
    fn declared(self, plan: &Plan) -> String {
        match self {
            Kind::Real => plan.export.real.kind().into(),
            Kind::Wide => Real::Double.kind().into(),
            Kind::Int => "int".into(),
            Kind::Byte => "unsigned char".into(),
            Kind::Failure => format!("{}_failure", plan.name),
            Kind::Delay => format!("{}_delay", plan.name),
            Kind::Point => format!("{}_point", plan.name),
            Kind::Sample => format!("{}_sample", plan.name),
            Kind::Clause => format!("{}_clause", plan.name),
        }
    }

    /// Its size, on machines of 64 bits.
    fn bytes(self, real: Real) -> usize {
        match (self, real) {
            (Kind::Byte, _) => 1,
            (Kind::Int, _) | (Kind::Real, Real::Float) => 4,
            (Kind::Wide, _) | (Kind::Real, Real::Double) => 8,
            (Kind::Failure, _) => 16,
            (Kind::Clause, _) => 56,
            (Kind::Point, Real::Float) => 24,
            (Kind::Point, Real::Double) | (Kind::Delay | Kind::Sample, _) => 32,
        }
    }
}

/// Members that are declared in one line.
pub(super) struct Members {
    kind: Kind,
    /// Their names; of arrays with how many they hold.
    names: Vec<(&'static str, Option<usize>)>,
    about: &'static str,
}

/// Lines of members.
#[derive(Default)]
struct List(Vec<Members>);

impl List {
    fn put(&mut self, kind: Kind, names: Vec<(&'static str, Option<usize>)>, about: &'static str) {
        self.0.push(Members { kind, names, about });
    }

    /// Single ones.
    fn one(&mut self, kind: Kind, names: &[&'static str], about: &'static str) {
        self.put(kind, names.iter().map(|&name| (name, None)).collect(), about);
    }

    /// Arrays of a size; of none one place is left, which C asks for.
    fn arrays(&mut self, kind: Kind, names: &[&'static str], size: usize, about: &'static str) {
        self.put(kind, names.iter().map(|&name| (name, Some(size.max(1)))).collect(), about);
    }

    /// The same, where there are any.
    fn some(&mut self, kind: Kind, names: &[&'static str], size: usize, about: &'static str) {
        if size > 0 {
            self.arrays(kind, names, size, about);
        }
    }
}

/// What users read and set, in a model of these modes.
pub(super) fn public(plans: &[Plan]) -> Vec<Members> {
    of_all(plans.iter().map(public_of).collect())
}

fn public_of(plan: &Plan) -> Vec<Members> {
    let (p, mut list) = (plan.program, List::default());
    list.one(Kind::Wide, &["t"], "time, in s");
    list.one(Kind::Wide, &["step"], "length of a step, in s; may be changed before the start");
    list.arrays(Kind::Real, &["x"], p.states.len(), "states");
    list.arrays(Kind::Real, &["u"], p.inputs.len(), "inputs");
    list.arrays(Kind::Real, &["p"], p.parameters.len(), "parameters");
    list.arrays(Kind::Real, &["y"], plan.export.recorded.len(), "outputs, as they are at t");
    let about =
        "how far positions are from what only their speeds keep, since the start, but for what events have changed";
    list.some(Kind::Real, &["drift"], plan.relations().len(), about);
    list.one(Kind::Failure, &["failure"], "");
    let about = "evaluations at most each time a Newton block is solved, but for the start and jumps";
    list.one(Kind::Int, &["most_evaluations"], about);
    list.0
}

/// What is nobody's affair.
pub(super) fn private(plans: &[Plan]) -> Vec<Members> {
    of_all(plans.iter().map(private_of).collect())
}

fn private_of(plan: &Plan) -> Vec<Members> {
    let mut list = List::default();
    of_parameters(&mut list, plan);
    of_events(&mut list, plan);
    of_ratios(&mut list, plan);
    of_modes(&mut list, plan);
    of_blocks(&mut list, plan);
    of_steps(&mut list, plan);
    of_relations(&mut list, plan);
    list.0
}

/// What putting positions back takes.
fn of_relations(list: &mut List, plan: &Plan) {
    let (rows, nx) = (plan.relations().len(), plan.program.states.len());
    if rows > 0 {
        list.arrays(
            Kind::Real,
            &["kept", "relation_before", "relation_missing"],
            rows,
            "what relations of positions keep",
        );
        list.arrays(Kind::Real, &["relation_out"], plan.relation_values(), "their values and slopes");
        list.arrays(Kind::Real, &["relation_slopes", "relation_rows"], rows * nx, "");
        list.arrays(Kind::Real, &["relation_sizes", "relation_step", "relation_from"], nx, "");
        list.arrays(Kind::Byte, &["relation_taken"], rows, "");
    }
}

fn of_parameters(list: &mut List, plan: &Plan) {
    let (p, s) = (plan.program, &plan.sizes);
    let single = plan.export.real == Real::Float;
    list.arrays(Kind::Real, &["c"], s.derived, "what follows from parameters");
    if single {
        list.some(Kind::Wide, &["p_exact"], p.parameters.len(), "parameters in double precision");
    }
    list.some(Kind::Wide, &["c_exact"], s.exact, "of what follows from them, what time needs");
    if single {
        let about = "of states, what is less than their last digit";
        list.arrays(Kind::Real, &["rest", "trial_rest"], p.states.len(), about);
    }
    list.arrays(Kind::Real, &["k"], p.conserved.len(), "conserved constants");
    list.some(Kind::Real, &["positions"], p.positions.len(), "positions at the start of the run");
    list.arrays(Kind::Real, &["z"], p.held.len(), "held signals");
    list.arrays(Kind::Byte, &["set"], p.parameters.len(), "which parameters are set");
    list.one(Kind::Int, &["changed"], "whether any is set");
    if !p.assumptions.is_empty() {
        list.one(Kind::Int, &["broken"], "which assumption parameters break, from 1");
    }
}

fn of_events(list: &mut List, plan: &Plan) {
    let (p, s) = (plan.program, &plan.sizes);
    list.one(Kind::Int, &["begun"], "whether the run has begun");
    list.one(Kind::Int, &["cross_due"], "whether a parameter or an input has jumped");
    list.one(Kind::Wide, &["crossed"], "when the last jump was crossed");
    if plan.export.derivatives {
        list.one(Kind::Int, &["stops"], "whether steps end where a jump was crossed");
    }
    list.arrays(Kind::Real, &["u_crossed"], p.inputs.len(), "inputs then");
    list.arrays(Kind::Real, &["u_default"], p.inputs.len(), "inputs that nobody sets");
    list.one(Kind::Wide, &["tick_from", "tick_next", "tick_index", "tick_rate"], "times of steps");
    list.some(Kind::Wide, &["held"], p.conditions.len(), "conditions as held");
    let of_time = |t: EventTrigger| matches!(t, EventTrigger::LinearTime | EventTrigger::CurvedTime);
    let clocks = p.conditions.values().filter(|c| of_time(c.trigger)).count();
    if clocks > 0 {
        list.one(Kind::Int, &["clock_hold"], "what is done with those of time");
        list.one(Kind::Wide, &["clock_next"], "when they change next");
        list.arrays(Kind::Wide, &["clock_operand", "clock_rate"], clocks, "");
    }
    let switches = plan.switches.len();
    if switches > 0 || plan.mode.is_some() {
        list.one(Kind::Int, &["state_hold"], "what is done with those of the state");
        list.one(Kind::Wide, &["signs_taken"], "when their sides were taken last");
        list.arrays(Kind::Int, &["sides"], s.indicators, "sides of the indicators");
        let sizes = [("operands", switches), ("beyond", s.indicators)];
        list.put(Kind::Real, sizes.map(|(name, size)| (name, Some(size.max(1)))).into(), "");
    }
    list.some(Kind::Delay, &["delays"], plan.delays.len(), "");
    list.some(Kind::Point, &["points"], plan.delays.iter().map(|d| d.1).sum(), "");
    list.some(Kind::Sample, &["samples"], plan.samples.len(), "");
    if !(plan.delays.is_empty() && plan.samples.is_empty()) {
        list.some(Kind::Real, &["source", "source_rate"], p.held.len(), "what is delayed or sampled");
    }
    of_clauses(list, plan);
}

fn of_clauses(list: &mut List, plan: &Plan) {
    let (p, events) = (plan.program, &plan.events);
    if !p.clauses.is_empty() {
        list.arrays(Kind::Clause, &["clauses"], p.clauses.len(), "what happens at events");
        list.some(Kind::Real, &["becomes"], events.conditional.len(), "their conditions");
        list.arrays(Kind::Real, &["new_values"], events.actions(), "what they change");
        let returns = events.returning.len();
        if returns > 0 {
            list.one(Kind::Wide, &["returns_since"], "when conditions held whose numbers are on their way back");
            list.arrays(Kind::Int, &["returning"], p.clauses.len(), "whether they are");
            list.arrays(
                Kind::Real,
                &["returning_from", "returning_way"],
                p.clauses.len(),
                "numbers then, and their way",
            );
            list.arrays(Kind::Real, &["returns_out", "returns_rates"], returns, "");
        }
    }
    if plan.locates() {
        list.one(Kind::Int, &["handled"], "whether an event has been handled at the present time");
        let places = if plan.mode.as_ref().is_some_and(ModeTables::has_laws) { 20 } else { 3 };
        list.arrays(Kind::Real, &["seen"], places * plan.sizes.indicators, "the last values of indicators in a step");
    }
    if let Some(jumps) = &p.jumps {
        let (rows, columns, moved) = (events.equations(), events.columns(), events.moved.len());
        let values = jumps.values().count() + moved;
        list.arrays(Kind::Real, &["stored"], jumps.stored.len(), "what storages keep before an event");
        if moved > 0 {
            list.one(Kind::Int, &["asked"], "how many resets a round has");
            list.arrays(Kind::Int, &["asked_actions"], moved, "which they are");
            list.arrays(Kind::Real, &["impulses"], moved, "their impulses");
        }
        list.arrays(Kind::Real, &["jump_out", "jump_rates"], values, "");
        list.arrays(Kind::Real, &["jump_matrix"], rows * columns, "balances of impulses");
        list.arrays(Kind::Real, &["jump_residual", "jump_sizes"], rows, "");
        list.arrays(Kind::Real, &["jump_columns", "jump_step"], columns, "");
        list.arrays(Kind::Int, &["jump_order"], columns, "");
    }
    if !events.positions.is_empty() {
        let names = ["misses", "misses_after", "position_out", "position_rates"];
        list.arrays(Kind::Real, &names, events.positions.len(), "how far constraints are missed");
    }
}

fn of_ratios(list: &mut List, plan: &Plan) {
    if !plan.may_pass() {
        return;
    }
    list.one(Kind::Int, &["pivots_known"], "whether it is known what ratios of speeds are divided by");
    let pivots = plan.ratios().map_or(0, |ratios| ratios.pivots.len());
    list.arrays(Kind::Real, &["pivots"], pivots, "what they were divided by when they were last looked at");
    list.one(
        Kind::Int,
        &["steepest_known", "steepest_at"],
        "whether the greatest of them was known then, which it was",
    );
    list.one(Kind::Real, &["steepest"], "and how great");
}

fn of_modes(list: &mut List, plan: &Plan) {
    let Some(tables) = &plan.mode else { return };
    let (p, modes) = (plan.program, tables.modes);
    let (margins, values, laws, symbols) =
        (tables.bounds.margins.len(), tables.margin_values(), modes.laws(), modes.symbols());
    let (clauses, storages) = (p.clauses.len(), p.jumps.as_ref().map_or(0, |jumps| jumps.stored.len()));
    list.one(Kind::Int, &["mode"], "the mode: which branch each set-valued law has");
    if plan.export.derivatives {
        list.one(Kind::Int, &["outside"], "whether an importer integrates, and locates where a branch ends");
    }
    if modes.exchanged() > 0 {
        list.one(Kind::Wide, &["exchanged_at"], "where a step has failed and others were tried");
        list.one(Kind::Int, &["exchange_due"], "whether others should be independent");
        list.arrays(Kind::Real, &["left_x"], p.states.len(), "");
        list.arrays(Kind::Byte, &["taken_over"], modes.exchanged(), "those that have taken over last");
    }
    list.one(Kind::Int, &["switched"], "whether it has changed since the last step");
    let about = "of margins, of their rates and of the rates of these, how great they have been";
    list.arrays(Kind::Real, &["most_margins", "most_kept"], 3 * modes.keys(), about);
    let about = "variables of the machine, how great they and their rates have been, and what storages keep";
    list.arrays(Kind::Real, &["most_values", "most_rates", "most_stored"], symbols, about);
    list.arrays(Kind::Real, &["most_groups"], modes.groups(), "efforts and flows in groups of one unit");
    list.arrays(Kind::Real, &["most_beyond"], plan.sizes.indicators, "indicators");
    list.arrays(Kind::Real, &["left_values", "left_stored"], symbols, "what the mode that was left had");
    list.arrays(Kind::Real, &["carried"], modes.values(p).len(), "");
    list.arrays(Kind::Real, &["compared"], tables.bounds.compared.concat().len(), "with what margins are compared");
    list.arrays(Kind::Real, &["entered"], storages, "what storages kept where the mode was entered");
    list.one(
        Kind::Wide,
        &["gaps_at", "let_go_at"],
        "when it was found what is zero of gaps, and impulses opened contacts",
    );
    list.one(Kind::Real, &["no_leap"], "by how much storages may change where a mode ends");
    list.arrays(Kind::Real, &["gap_zero"], laws, "");
    list.arrays(Kind::Int, &["gap_known", "apart", "let_go", "short_flight", "fired_ends"], laws, "of each law");
    let names = ["margin_values", "margin_rates", "margin_changes", "margin_sizes", "margin_present"];
    list.arrays(Kind::Real, &names, values, "margins");
    list.arrays(Kind::Real, &["margin_way"], p.states.len(), "");
    let names = ["margin_value", "margin_rate", "margin_zero", "margin_still", "margin_rounding"];
    list.arrays(Kind::Real, &names, margins, "how they stand");
    list.arrays(Kind::Int, &["margin_ended", "margin_brief"], margins, "whether their branches have ended");
    list.arrays(Kind::Real, &["floors"], p.conditions.len(), "from where on conditions are watched");
    list.one(Kind::Wide, &["last_step"], "length of the last step, 0 after an event");
    list.arrays(Kind::Real, &["jump_been"], plan.events.columns(), "");
    list.arrays(Kind::Real, &["jump_greatest"], plan.events.moved.len(), "");
    let actions = p.clauses.iter().map(|c| c.actions.len() + 1).max().unwrap_or(1);
    list.arrays(Kind::Real, &["clause_values"], actions, "");
    list.arrays(Kind::Int, &["contact", "at_rest", "contact_held", "fired_before"], clauses, "of each clause");
    list.arrays(Kind::Real, &["shared", "wanted"], clauses, "impulses of contacts");
    list.arrays(Kind::Real, &["shared_from"], p.states.len() + p.conserved.len(), "");
    let (_, combinations) = modes.counts();
    list.arrays(Kind::Byte, &["tried_modes", "seen_modes"], combinations, "while a mode is sought");
    list.arrays(Kind::Int, &["waiting_modes"], combinations, "");
}

/// Those of all modes: of arrays as many places as the mode with most of them has.
fn of_all(lists: Vec<Vec<Members>>) -> Vec<Members> {
    let mut all: Vec<Members> = Vec::new();
    for members in lists.into_iter().flatten() {
        match all.iter_mut().find(|known| known.names.iter().map(|n| n.0).eq(members.names.iter().map(|n| n.0))) {
            Some(known) => {
                let sizes = known.names.iter_mut().zip(members.names);
                sizes.for_each(|(own, other)| own.1 = own.1.max(other.1));
            }
            None => all.push(members),
        }
    }
    all
}

fn of_blocks(list: &mut List, plan: &Plan) {
    let s = &plan.sizes;
    if !plan.newton.is_empty() {
        let about = "solutions of Newton blocks, where they were found, their Jacobians";
        list.arrays(Kind::Real, &["memory"], s.memory, about);
        list.arrays(Kind::Int, &["following"], plan.newton.len(), "whether they are followed");
        let about = "whether those found last and those followed are solutions where blocks read the same again";
        list.arrays(Kind::Int, &["fresh", "settled"], plan.newton.len(), about);
        list.some(Kind::Real, &["solutions"], plan.solutions, "");
        if !plan.sought_positions().is_empty() {
            let about = "whether the motion of positions is known, their last way was short, and far from where they are singular";
            list.arrays(Kind::Int, &["motion_known", "motion_short", "motion_regular"], plan.newton.len(), about);
            list.arrays(Kind::Wide, &["motion_time", "motion_passed"], plan.newton.len(), "since when, and before");
            list.one(Kind::Wide, &["sought_at"], "the time for which they are sought");
        }
        let [of_rates, of_shown] = plan.motion_sizes();
        list.some(Kind::Real, &["moves"], of_rates.max(of_shown), "their rates");
    }
    if s.factors > 0 {
        let about = "of matrices of parameters alone, and of those that several solve blocks have";
        list.arrays(Kind::Real, &["factors"], s.factors, about);
        let sizes = [("factors_order", s.factors_order), ("factored", s.factored)];
        list.put(Kind::Int, sizes.map(|(name, size)| (name, Some(size.max(1)))).into(), "");
    }
}

fn of_steps(list: &mut List, plan: &Plan) {
    let (nx, s, method) = (plan.program.states.len(), &plan.sizes, plan.export.method);
    let (shown, single) = (plan.export.recorded.len(), plan.export.real == Real::Float);
    let sizes = [("stages", nx * method.stages()), ("trial", nx), ("dx", nx)];
    list.put(Kind::Real, sizes.map(|(name, size)| (name, Some(size.max(1)))).into(), "");
    list.arrays(Kind::Real, &["beside"], nx, "a state beside another one");
    list.arrays(Kind::Real, &["w"], s.crossing, "values from one piece of code to the next");
    list.some(Kind::Wide, &["wide"], s.wide, "the same, where they follow from time alone");
    let sizes = [("along", s.directions[4]), ("along_out", nx.max(shown))];
    list.put(Kind::Real, sizes.map(|(name, size)| (name, Some(size.max(1)))).into(), "directions of derivatives");
    list.arrays(Kind::Real, &["shown"], shown, "");
    if s.order > 0 {
        list.arrays(Kind::Real, &["work"], s.work, "for solve blocks");
        list.arrays(Kind::Int, &["order"], s.order, "");
    }
    if method.is_implicit() {
        let order = plan.step_order.as_ref();
        if let Some(order) = order {
            let factors = &order.factors;
            let sizes = [("step_entries", order.entries()), ("step_lower", factors.lower.len())];
            list.put(Kind::Real, sizes.map(|(name, size)| (name, Some(size.max(1)))).into(), "");
            let sizes = [("step_upper", factors.upper.len()), ("step_rest", 3 * nx)];
            list.put(Kind::Real, sizes.map(|(name, size)| (name, Some(size.max(1)))).into(), "");
            list.arrays(Kind::Real, &["step_inverse", "step_row"], nx, "");
        }
        if order.is_none_or(StepOrder::has_full) {
            let sizes = [("matrix", nx * nx), ("matrix_scale", nx), ("matrix_work", nx)];
            list.put(Kind::Real, sizes.map(|(name, size)| (name, Some(size.max(1)))).into(), "");
            list.arrays(Kind::Int, &["matrix_order"], nx, "");
            if single {
                list.arrays(Kind::Real, &["matrix_columns"], nx, "");
            }
        }
        if order.is_some_and(StepOrder::has_full) {
            list.one(Kind::Int, &["step_full"], "whether the full matrix is taken");
        }
        if single && method == Method::ImplicitMidpoint {
            list.arrays(Kind::Real, &["half_way"], nx, "from the beginning of a step to its middle");
        }
        list.arrays(Kind::Real, &["middle", "sizes", "correction", "direction", "product"], nx, "");
        if method.keeps_steps() {
            of_kept_steps(list, plan);
        }
    }
    if let Some(ahead) = &plan.ahead {
        list.arrays(Kind::Real, &["ahead"], ahead.size(), "what the next step asks for first");
        list.one(Kind::Int, &["ahead_known"], "whether it is known, when and where it was found");
        if plan.mode.is_some() {
            list.one(Kind::Int, &["ahead_mode"], "");
        }
        list.one(Kind::Wide, &["ahead_t"], "");
        list.arrays(Kind::Real, &["ahead_x"], plan.program.states.len(), "");
        list.arrays(Kind::Real, &["ahead_u"], plan.program.inputs.len(), "");
    }
}

/// What goes on from earlier steps.
fn of_kept_steps(list: &mut List, plan: &Plan) {
    let nx = plan.program.states.len();
    let nonzeros = plan.columns().iter().map(Vec::len).sum();
    list.arrays(Kind::Real, &["jacobian"], nonzeros, "the Jacobian");
    list.one(Kind::Real, &["jacobian_scale"], "by what it is multiplied in the matrix; 0 where that is to be factored");
    let about = "whether it is known, and to be looked at; steps since it was";
    list.one(Kind::Int, &["jacobian_known", "jacobian_doubted", "jacobian_steps"], about);
    list.arrays(Kind::Real, &["before_from", "before_rates"], nx, "the step before");
    list.arrays(Kind::Real, &["last_from", "last_rates"], nx, "the step made last");
    list.arrays(Kind::Real, &["point", "way", "move_on", "at"], nx, "");
    if plan.compares_rates() {
        list.arrays(Kind::Real, &["rates_at"], nx, "");
    }
    if let Some(beside) = &plan.beside {
        list.arrays(Kind::Real, &["common"], beside.size(), "the rates there, and what those beside it have in common");
        list.arrays(Kind::Real, &["rates_room"], beside.size(), "the same at any state");
        list.one(Kind::Int, &["common_known"], "whether that is known");
    }
    if plan.steps_to_find().is_some() {
        list.arrays(Kind::Real, &["next_jacobian"], nonzeros, "the Jacobian that is to follow");
        list.arrays(Kind::Real, &["next_at"], nx, "the state at which it is found");
        list.one(Kind::Int, &["next_steps"], "steps that find columns of it yet");
        list.one(Kind::Int, &["next_waits"], "whether the last one has left that to the next one");
    }
    list.one(Kind::Wide, &["before_end", "last_end"], "where they ended, and their lengths");
    list.one(Kind::Real, &["before_length", "last_length"], "");
    list.one(Kind::Int, &["before_counts", "last_counts"], "whether they count");
}

/// Their declarations, without the last end of a line.
pub(super) fn lines(members: &[Members], plan: &Plan) -> String {
    let name = |(name, size): &(&str, Option<usize>)| match size {
        Some(size) => format!("{name}[{size}]"),
        None => name.to_string(),
    };
    let line = |m: &Members| {
        let names: Vec<String> = m.names.iter().map(name).collect();
        let about = if m.about.is_empty() { String::new() } else { format!(" /* {} */", m.about) };
        format!("    {} {};{about}", m.kind.declared(plan), names.join(", "))
    };
    members.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Bytes of the model: its members, each in whole words.
pub(super) fn bytes(plans: &[Plan]) -> usize {
    let all = public(plans).into_iter().chain(private(plans));
    let of = |m: Members| {
        let bytes = m.kind.bytes(plans[0].export.real);
        m.names.iter().map(|(_, size)| (bytes * size.unwrap_or(1)).next_multiple_of(8)).sum::<usize>()
    };
    all.map(of).sum()
}
