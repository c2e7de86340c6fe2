//! A model with chosen branches of its set-valued laws.

use halfarrow_exec as exec;

use crate::error::{Error, Problem};
use crate::model::Model;

impl Model {
    /// The same model with these branches of its set-valued laws, as in `d1=on,d2=off`; the others keep those with which runs
    /// begin.
    ///
    /// # Errors
    /// There is no such law, or it has no such branch.
    pub fn in_mode(&self, branches: &[String]) -> Result<Model, Error> {
        let graph = &self.graph;
        let mut mode = graph.mode();
        for given in branches.iter().flat_map(|list| list.split(',')).map(str::trim).filter(|one| !one.is_empty()) {
            let (name, branch) = given.split_once('=').unwrap_or((given, ""));
            let (name, branch) = (name.trim(), branch.trim());
            let laws = || graph.set_valued.iter().map(|law| (graph.elements[law.element].name.as_str(), law));
            let Some(at) = laws().position(|(own, _)| own == name) else {
                let known: Vec<&str> = laws().map(|(own, _)| own).collect();
                let known = match known.is_empty() {
                    true => "the model has none".to_string(),
                    false => format!("those of the model are {}", known.join(", ")),
                };
                return Err(Problem::BadOption { reason: format!("`{name}` has no set-valued law: {known}") }.into());
            };
            let own = &graph.set_valued[at].branches;
            let Some(number) = own.iter().position(|b| b.name == branch) else {
                let known: Vec<&str> = own.iter().map(|b| b.name).collect();
                let reason = format!("`{name}` has no branch `{branch}`: write one of {}", known.join(", "));
                return Err(Problem::BadOption { reason }.into());
            };
            mode[at] = number;
        }
        Ok(self.with_graph(graph.in_mode(&mode)))
    }

    /// The same model with the branches that its laws have where a run stands.
    pub(crate) fn as_in(&self, system: &exec::Model) -> Model {
        let mode: Vec<usize> = system.program().set_valued.iter().map(|law| law.present as usize).collect();
        self.with_graph(self.graph.in_mode(&mode))
    }
}
