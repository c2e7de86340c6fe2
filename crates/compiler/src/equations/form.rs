//! The formulations.

use std::fmt;

/// A formulation, `method.md`, section 4.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Form {
    /// One explicit ODE per degree of freedom, nothing else.
    #[default]
    Minimal,
    /// One explicit ODE for each independent speed, dependent ones eliminated, without momenta as states.
    Kane,
    /// The inversion: storages on zero-order paths take derivative causality, their rates open the paths.
    Inverted,
    /// The classical form: preferred integral causality, zero-order paths opened by break variables and multipliers.
    Break,
    /// The classical form with relaxed causality: resistors first, storages as they come.
    Relaxed,
    /// All storages are states, every constraint has a multiplier.
    Lagrange,
    /// All storages are states, every constraint is a stiff spring with a damper.
    Stiff,
}

impl Form {
    /// All forms, the default first.
    pub const ALL: [Form; 7] =
        [Form::Minimal, Form::Kane, Form::Inverted, Form::Break, Form::Relaxed, Form::Lagrange, Form::Stiff];

    /// Whether its equations are rates of independent variables, whatever the graph. Such a form finds itself where branches
    /// of set-valued laws end; the others go by the minimal one.
    pub fn is_explicit(self) -> bool {
        matches!(self, Form::Minimal | Form::Kane)
    }

    /// Its name on the command line.
    ///
    /// ```
    /// use halfarrow_compiler::equations::Form;
    /// assert!(Form::ALL.iter().all(|form| Form::named(form.name()) == Some(*form)));
    /// ```
    pub fn name(self) -> &'static str {
        match self {
            Form::Minimal => "minimal",
            Form::Kane => "kane",
            Form::Inverted => "inverted",
            Form::Break => "break",
            Form::Relaxed => "relaxed",
            Form::Lagrange => "lagrange",
            Form::Stiff => "stiff",
        }
    }

    /// The form of that name.
    pub fn named(name: &str) -> Option<Form> {
        Form::ALL.into_iter().find(|form| form.name() == name)
    }
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
