//! `report`.

use halfarrow::{Problem, Report, write_whole};
use serde_json::json;

use super::with_model;
use crate::arguments;
use crate::screen::{self, Progress};

/// Everything about a model in one page.
pub fn report(arguments: &arguments::Report) -> u8 {
    with_model(&arguments.model, |model| {
        let path = &arguments.out;
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        if !matches!(extension.as_deref(), Some("html" | "htm")) {
            return Err(Problem::UnknownKind { path: path.clone(), known: vec!["html"] }.into());
        }
        let wanted = Report {
            to: arguments.to,
            inputs: arguments.input.iter().map(|(name, path)| (name.clone(), path.into())).collect(),
            compare: !arguments.without_comparison,
            error: arguments.error,
            compare_budget: arguments.compare_budget,
        };
        let mut bar = Progress::new(1.0);
        let page = model.report(&wanted, &mut |part, what| {
            bar.part(part, what);
            true
        });
        bar.finish();
        let page = page?;
        write_whole(path, |out| out.write_all(page.html.as_bytes()))
            .map_err(|why| Problem::Unwritable { path: path.clone(), why: why.source.to_string() })?;
        page.warnings.iter().for_each(|warning| screen::note(&format!("warning: {warning}")));
        let failure = page.failure.clone().or_else(|| {
            let forms = page.refused.join(", ");
            (!forms.is_empty()).then(|| format!("results of {forms} do not satisfy the model, as the audit found"))
        });
        if let Some(failure) = &failure {
            screen::note(&format!("error: {failure}"));
        }
        let mut object = json!({"written": [path]});
        if let Some(failure) = &failure {
            object["error"] = json!(failure);
        }
        match arguments.model.model.json {
            true => screen::print_json(&object),
            false => screen::print(&format!("{} is written\n", path.display())),
        }?;
        Ok(if failure.is_some() { 3 } else { 0 })
    })
}
