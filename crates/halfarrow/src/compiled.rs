//! A model that is ready to run, kept for many runs.

use std::collections::BTreeMap;
use std::sync::Arc;

use halfarrow_compiler::bond_graph::Override;
use halfarrow_compiler::causal_graph::shared_reactions;
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::ids::Id;
use halfarrow_compiler::unit::Unit;
use halfarrow_exec as exec;
use halfarrow_sim::Failure;

use crate::error::{Error, Problem};
use crate::model::Model;
use crate::quantity::quantity;
use crate::run::{Progress, Run, Simulated};
use crate::sweep::known_parameter;

/// A model whose equations are derived: it runs again and again, with other parameters and inputs, and nothing is derived
/// anew but where parameters break what the equations rest on.
///
/// ```
/// use halfarrow::{Form, Model, Run};
/// let text = "model Drop\nparam m = 1 kg\nSe:weight(9.81 N) -> I:mass(m)\n";
/// let mut drop = Model::from_text("drop.bond", text, &[])?.compile(Form::Minimal)?;
/// for mass in [1.0, 2.0] {
///     drop.set("m", mass)?;
///     let fallen = drop.simulate(&Run { to: 2.0, ..Run::default() }, &mut |_| true)?;
///     let speed = fallen.trace.columns[0].values.last().unwrap();
///     assert!((speed - 9.81 * 2.0 / mass).abs() < 1e-6);
/// }
/// # Ok::<(), halfarrow::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Compiled {
    model: Arc<Model>,
    form: Form,
    pub(crate) ready: Ready,
    /// Whether its program continues those of smaller models.
    continued: bool,
    /// Whether reactions that are not unique are shared.
    shares: bool,
    /// What was set, in SI units.
    set: BTreeMap<String, f64>,
}

/// What runs.
#[derive(Debug, Clone)]
pub(crate) enum Ready {
    /// The minimal form, or one that finds the modes of set-valued laws itself.
    Explicit(Box<exec::Model>),
    /// Another one, beside the minimal form.
    Form {
        system: Box<exec::ImplicitModel>,
        /// Whether its equations give the rates, with nothing that vanishes.
        explicit: bool,
    },
}

impl Model {
    /// Derives the equations of a form and makes them ready to run.
    ///
    /// # Errors
    /// The model has errors that only later stages find.
    pub fn compile(&self, form: Form) -> Result<Compiled, Error> {
        let mut continued = false;
        let ready = match self.runs_alone(form) {
            true => Ready::Explicit(Box::new(match self.continued_system(form) {
                Some(system) => {
                    continued = true;
                    system
                }
                None => self.system_in(form)?,
            })),
            false => {
                let equations = self.equations_in(form)?;
                let system = Box::new(self.form_system(&equations)?);
                let explicit = equations.residuals.is_empty() && self.graph.set_valued.is_empty();
                Ready::Form { system, explicit }
            }
        };
        Ok(Compiled { model: Arc::new(self.clone()), form, ready, continued, shares: false, set: BTreeMap::new() })
    }

    /// Whether a form runs without the minimal one beside it. Where set-valued laws have modes, those of an explicit form are
    /// found as those of the minimal one are.
    pub(crate) fn runs_alone(&self, form: Form) -> bool {
        form == Form::Minimal || form.is_explicit() && !self.graph.set_valued.is_empty()
    }
}

impl Model {
    /// The same with the reactions of constraints that repeat others shared as those of least norm.
    pub(crate) fn compile_sharing(&self, form: Form) -> Result<Compiled, Error> {
        let bad = |reason: String| Error::from(Problem::BadOption { reason });
        if form != Form::Minimal {
            return Err(bad(format!("minimum-norm is for the form minimal, not {}", form.name())));
        }
        if !self.graph.set_valued.is_empty() {
            return Err(bad(
                "minimum-norm is not for models with set-valued laws, of which each branch has other reactions".into(),
            ));
        }
        let Some(shared) = shared_reactions(&self.graph).map_err(|errors| self.fault(errors))? else {
            return Err(bad("minimum-norm has nothing to do: the reactions of this model are unique".into()));
        };
        let inputs = shared.shares.iter().map(|share| share.index()).collect();
        let mut model = self.clone();
        (model.graph, model.family) = (Arc::new(shared.graph), None);
        let mut compiled = model.compile(form)?;
        compiled.shares = true;
        if let Ready::Explicit(system) = &mut compiled.ready {
            system.share_reactions(inputs, shared.reactions);
        }
        Ok(compiled)
    }
}

impl Compiled {
    /// The model, with the parameters that its equations were derived for.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The form of its equations.
    pub fn form(&self) -> Form {
        self.form
    }

    /// How many operations one evaluation of its rates or residuals takes, solve blocks included: of those that are solved by
    /// iteration one.
    pub fn operations(&self) -> usize {
        match &self.ready {
            Ready::Explicit(system) => system.operations().total(),
            Ready::Form { system, .. } => system.operations().total(),
        }
    }

    /// The value of a parameter or constant, in SI units; `None` if there is none of that name.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.minimal().parameter(name)
    }

    /// The value that a text such as `20 kN/m` or `3` gives a parameter, in SI units.
    ///
    /// # Errors
    /// There is no such parameter, or the text is no number in a unit of what it measures.
    pub fn quantity(&self, name: &str, text: &str) -> Result<f64, Problem> {
        known_parameter(self.minimal(), name)?;
        let parameter = self.minimal().program().parameters.iter().find(|p| p.name == name);
        let unit = parameter.and_then(|p| p.unit.as_ref());
        quantity(text, unit)
            .map_err(|why| Problem::BadOption { reason: format!("`{name}` is given as `{text}`: {why}") })
    }

    /// Sets a parameter, in SI units. If it breaks what the equations rest on they are derived anew.
    ///
    /// # Errors
    /// There is no such parameter, or the model has errors with this value; then it stays as it was.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), Error> {
        self.set_all([(name, value)])
    }

    /// Sets several parameters at once: what the values on the way would break counts for nothing.
    ///
    /// # Errors
    /// As [`set`](Compiled::set).
    pub fn set_all<'a>(&mut self, values: impl IntoIterator<Item = (&'a str, f64)>) -> Result<(), Error> {
        let mut set = self.set.clone();
        for (name, value) in values {
            known_parameter(self.minimal(), name)?;
            if !value.is_finite() {
                return Err(Problem::BadOption { reason: format!("`{name}` is {value}: it has to be finite") }.into());
            }
            set.insert(name.to_string(), value);
        }
        if let Ready::Explicit(system) = &self.ready {
            let mut changed = system.clone();
            let placed = changed.set_parameters(set.iter().map(|(name, value)| (name.as_str(), *value)));
            if placed.is_ok() && changed.broken().is_none() {
                (self.ready, self.set) = (Ready::Explicit(changed), set);
                return Ok(());
            }
        }
        let derived = self.model.with(&self.overrides(&set))?.compile(self.form)?;
        *self = Compiled { set, ..derived };
        Ok(())
    }

    /// Computes a trajectory from the start, as [`Model::simulate`] does.
    ///
    /// # Errors
    /// Something is asked that cannot be, or the run stops; what was computed so far is kept.
    pub fn simulate(&self, run: &Run, progress: &mut dyn FnMut(Progress<'_>) -> bool) -> Result<Simulated, Error> {
        if run.form != self.form {
            let reason = format!("the model was compiled in the form {}, not {}", self.form.name(), run.form.name());
            return Err(Problem::BadOption { reason }.into());
        }
        if run.minimum_norm && !self.shares {
            let reason = "a compiled model is not prepared for minimum-norm: simulate the model itself".into();
            return Err(Problem::BadOption { reason }.into());
        }
        let done = self.model.simulate_with(self.ready.clone(), run, progress);
        match &done {
            // Equations that continue those of smaller models have to bear what is looked at in a run, or are not taken.
            Err(Error::Run(stopped)) if self.continued && !matches!(stopped.failure, Failure::Interrupted { .. }) => {
                let mut stands = self.model.as_it_stands().compile(self.form)?;
                stands.set_all(self.set.iter().map(|(name, value)| (name.as_str(), *value)))?;
                stands.simulate(run, progress)
            }
            _ => done,
        }
    }

    /// The equations in minimal form, which every form has beside it.
    pub(crate) fn minimal(&self) -> &exec::Model {
        match &self.ready {
            Ready::Explicit(system) => system,
            Ready::Form { system, .. } => system.reference(),
        }
    }

    /// The model with what was set.
    ///
    /// # Errors
    /// The model has errors with these values.
    pub fn model_as_set(&self) -> Result<Arc<Model>, Error> {
        match self.set.is_empty() {
            true => Ok(Arc::clone(&self.model)),
            false => self.model.with(&self.overrides(&self.set)).map(Arc::new),
        }
    }

    /// Values as they would be given to the model itself.
    fn overrides(&self, set: &BTreeMap<String, f64>) -> Vec<Override> {
        let parameters = &self.minimal().program().parameters;
        let unit = |name: &String| parameters.iter().find(|p| p.name == *name).and_then(|p| p.unit.as_ref());
        let text = |name: &String, value: f64| match unit(name).map(Unit::to_si_unit) {
            Some(unit) => format!("{value:?} {unit}").trim_end().to_string(),
            None => format!("{value:?}"),
        };
        set.iter().map(|(name, &value)| Override { name: name.clone(), value: text(name, value) }).collect()
    }
}
