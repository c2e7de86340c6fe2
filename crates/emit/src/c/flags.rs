//! Which parts of the texts of `runtime/` a model has: the words behind `//if` there.

macro_rules! flags {
    ($($(#[$doc:meta])* $name:ident)*) => {
        /// What a model has, a flag for each word behind `//if`.
        #[derive(Debug, Clone, Copy, Default)]
        pub(crate) struct Flags {
            $($(#[$doc])* pub $name: bool,)*
        }

        impl Flags {
            /// What one or the other has.
            pub fn or(self, other: Flags) -> Flags {
                Flags { $($name: self.$name || other.$name,)* }
            }

            /// Whether a condition holds.
            ///
            /// # Panics
            /// There is no such flag.
            pub fn holds(&self, word: &str) -> bool {
                match word {
                    $(stringify!($name) => self.$name,)*
                    _ => panic!("`//if {word}` asks for a flag that there is not"),
                }
            }
        }
    };
}

flags! {
    /// Real numbers are of single precision.
    single
    states
    inputs
    parameters
    outputs
    conserved
    /// Positions that iterations determine.
    positions
    /// Such as are sought while running.
    sought_positions
    /// Those whose motion is followed: that rates read, that only outputs do.
    moving_positions
    rates_motion
    shown_motion
    tables
    conditions
    /// Conditions, or modes that may have some.
    holds
    sign_conditions
    floor_conditions
    piece_conditions
    /// Conditions of time.
    clocks
    /// Such along curves.
    curves
    /// Conditions of the state.
    switches
    /// What happens at events, where a condition becomes true or at multiples of a period.
    clauses
    conditional_clauses
    periodic_clauses
    /// Conditions on one number, which may be on its way back after an event.
    returns
    /// Crossings of conditions are located within steps.
    locates
    /// Balances of impulses.
    impulses
    /// Ratios that may leap where a condition changes.
    leaps
    /// Resets that take impulses.
    resets
    /// Constraints on displacements that events may break.
    constraints
    /// Discrete variables, and what tells impulses.
    discretes
    /// Delays or samples.
    held
    delays
    samples
    /// Samples and no delays.
    only_samples
    /// Newton blocks.
    newton
    /// Large sparse solve blocks.
    sparse
    /// Solve blocks of so many equations, which are written out.
    two_equations
    three_equations
    four_equations
    /// Such of one unknown.
    newton_single
    /// Newton blocks in rates or outputs.
    follows
    rates_newton
    shown_newton
    domains
    /// Domains that parameters alone decide.
    domains_always
    assumptions
    /// A function for derivatives of the rates.
    directional_derivative
    /// Derivatives for the user.
    derivatives
    /// Derivatives of the rates by time.
    time_derivative
    /// Steps go on from what is kept of earlier ones.
    keeps_steps
    /// They compare rates in place of exact derivatives.
    compares_rates
    /// They find a new Jacobian over several steps.
    finds_by_parts
    /// Where a step ends it is found what the next one asks for,
    looks_ahead
    /// rates of positions among it,
    moves_ahead
    /// outputs,
    shows_ahead
    /// and it reads Newton blocks.
    ahead_newton
    /// What rates beside a state have in common is computed once,
    knows_common
    /// and it reads Newton blocks.
    common_newton
    /// Something that may jump with an input is looked at where one jumps.
    inputs_jump
    time_passes
    /// Linear blocks with a constant matrix.
    linear_constant
    /// The matrix of an implicit step has an order of elimination,
    step_order
    /// and room for a full one.
    step_full
    /// Relations between positions onto which these are put back.
    relations
    solves_start
    guesses
    start_groups
    /// Events may change states: clauses, or modes.
    moves
    /// Several modes.
    modes
    /// Such with other independent variables, in any mode and from this one.
    exchanges
    ratios
    /// No others may be, and it is watched whether those that are tell the motion.
    watches
    /// One or the other.
    may_pass
    /// Set-valued laws.
    bounds
    /// Gaps among their bounds; such whose sides meet with an impulse, in this mode and in any.
    gaps
    meets
    /// Impulses may open contacts and let go what sticks.
    releases
    /// Impulses balanced where ratios leap or modes change.
    leaps_balanced
}
