//! Everything about a model in one page that opens anywhere: self-contained, offline, printable.

mod causality;
mod curves;
mod page;

use halfarrow_compiler::algebra::{PlainNames, mathml_within};
use halfarrow_compiler::causal_graph::CausalGraph;
use halfarrow_compiler::causal_paths::find_paths;
use halfarrow_compiler::equations::{AlgebraicRole, Form, StateKind};
use halfarrow_compiler::textbook::{
    Style, dependent_within, events_within, meanings_within, print_certificate, print_symbol, show, sides_within,
};
use halfarrow_draw::DrawOptions;

use crate::compare::{Compare, CompareReport};
use crate::error::Error;
use crate::input::Input;
use crate::model::Model;
use crate::run::{Run, Simulated};
#[cfg(feature = "animation")]
pub(crate) use curves::{LIBRARY, LIBRARY_STYLE};

use causality::Decided;

/// Equations of a form that are set; more are counted.
const MOST: usize = 80;

/// Parts of an expression that are set; `…` stands for what comes after them.
const PARTS: usize = 300;
/// Characters of a page that lines of equations take together; further lines are counted.
const LONGEST: usize = 400_000;

/// What stands in the report.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// End of the run that is plotted and audited, in s; `None`: as `compare` chooses it.
    pub to: Option<f64>,
    /// Inputs that are given: their names and what they are over time.
    pub inputs: Vec<(String, Input)>,
    /// Whether forms are run beside each other, which takes time.
    pub compare: bool,
    /// The error at which they are compared.
    pub error: f64,
    /// Time for comparing, in s; what it does not suffice for is left out, and said.
    pub compare_budget: f64,
}

impl Default for Report {
    /// With a comparison at an error of 1e-6 within 10 s.
    fn default() -> Report {
        Report { to: None, inputs: Vec::new(), compare: true, error: 1e-6, compare_budget: 10.0 }
    }
}

/// A report, and what is to be said beside it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Page {
    /// The text of the page.
    pub html: String,
    /// What is to be known of the run.
    pub warnings: Vec<String>,
    /// Why the run stopped, or why its result is not to be used.
    pub failure: Option<String>,
    /// Forms whose results are not to be used.
    pub refused: Vec<&'static str>,
}

/// What the page is made of.
struct Content {
    title: String,
    name: String,
    facts: Vec<(&'static str, String)>,
    drawing: String,
    decided: Vec<Decided>,
    paths: Vec<PathRow>,
    paths_complete: bool,
    dependent: Vec<String>,
    conserved: Vec<String>,
    forms: Vec<FormPart>,
    /// The comparison and its picture, or why there is none; `None` if it was not wanted.
    comparison: Option<Result<(CompareReport, String), String>>,
    run: Result<(Simulated, String), String>,
    to: f64,
    warnings: Vec<String>,
}

/// A zero-order causal path.
struct PathRow {
    class: u8,
    between: String,
    route: String,
    bonds: String,
    gain: String,
    value: Option<f64>,
    breaks: String,
    fate: String,
}

/// The equations of forms that have the same, or why there are none.
struct FormPart {
    forms: Vec<Form>,
    content: Result<FormText, String>,
    /// What is said about how the equations came about, by form.
    remarks: Vec<(Form, Vec<String>)>,
}

#[derive(PartialEq)]
struct FormText {
    counts: String,
    /// Unknowns, with what each is there for.
    unknowns: Vec<(String, &'static str)>,
    equations: Vec<(String, String)>,
    left_out: usize,
    meanings: Vec<String>,
    meanings_left_out: usize,
}

impl Model {
    /// The report as an HTML page. `progress` is told what is done and what is being done.
    ///
    /// # Errors
    /// The model has errors, or an input does not fit. A run that stops is no error: the page says so.
    pub fn report(&self, report: &Report, progress: &mut dyn FnMut(f64, &str) -> bool) -> Result<Page, Error> {
        progress(0.0, "equations");
        let causal = self.causal_graph()?;
        let loops = self.loops_in_brief(6 * PARTS)?;
        let minimal = show(self.equations_in(Form::Minimal)?);
        let to = match report.to {
            Some(to) => to,
            None => self.typical_time()?,
        };
        let comparison = match report.compare {
            true => {
                let wanted = Compare {
                    to: Some(to),
                    error: report.error,
                    inputs: report.inputs.clone(),
                    repeats: 3,
                    patience: 2.0,
                    budget: Some(report.compare_budget),
                };
                let compared =
                    self.compare(&wanted, &mut |part, what| progress(0.1 + 0.6 * part, &format!("comparing: {what}")));
                let with_picture = |report: CompareReport| {
                    let svg = report.plot().svg;
                    (report, svg)
                };
                Some(compared.map(with_picture).map_err(|error| crate::compare::short(&error)))
            }
            false => None,
        };
        progress(0.7, "run");
        let run = Run { to, every: Some(to / 500.0), inputs: report.inputs.clone(), rtol: 1e-8, ..Run::default() };
        let mut page = Page::default();
        let run = match self.simulate(&run, &mut |_| true) {
            Ok(done) => {
                let svg = self.plot(&done.trace).svg;
                page.warnings.extend(done.report.notes.iter().cloned());
                Ok((done, svg))
            }
            Err(Error::Run(stopped)) => {
                page.failure = Some(stopped.to_string());
                Err(stopped.to_string())
            }
            Err(error) => return Err(error),
        };
        if let Some(Ok((compared, _))) = &comparison {
            page.refused = compared.refused();
        }
        progress(0.8, "drawing");
        let drawing = self.draw(&DrawOptions::default())?.svg;
        let mut form_part = |(i, form): (usize, Form)| {
            progress(0.85 + 0.02 * i as f64, &format!("equations of the form {}", form.name()));
            self.form_part(form)
        };
        let forms = Form::ALL.into_iter().enumerate().map(&mut form_part).collect();
        let content = Content {
            title: self.title().to_string(),
            name: self.graph.name.clone(),
            facts: self.facts(&loops, minimal.equations.states.len()),
            drawing,
            decided: causality::decided(&causal, &loops),
            paths: path_rows(&causal, &loops),
            paths_complete: loops.complete,
            dependent: first(dependent_within(&minimal, Style::MathMl, PARTS), String::len).0,
            conserved: loops.conserved.iter().map(|c| format!("{} = {}", c.name, c.value)).collect(),
            forms: together(forms),
            comparison,
            run,
            to,
            warnings: self.check()?.diagnostics.0.iter().map(|d| d.title.clone()).collect(),
        };
        progress(1.0, "page");
        page.html = page::page(&content);
        Ok(page)
    }

    fn facts(&self, loops: &crate::loops::LoopsReport, states: usize) -> Vec<(&'static str, String)> {
        let inner = self.graph.elements.values().filter(|e| e.kind.is_inner()).count();
        let outer = self.graph.elements.values().count() - inner;
        vec![
            ("elements", outer.to_string()),
            ("junctions and two-ports", inner.to_string()),
            ("bonds", self.graph.bonds.iter().count().to_string()),
            ("zero-order causal paths", format!("{}{}", loops.paths.len(), if loops.complete { "" } else { "+" })),
            ("independent storages", loops.dof.to_string()),
            ("states", states.to_string()),
        ]
    }

    fn form_part(&self, form: Form) -> FormPart {
        let mut remarks = Vec::new();
        let content = self.equations_in(form).map_err(|error| crate::compare::short(&error)).map(|equations| {
            let shown = show(equations);
            remarks = events_within(&shown, Style::Unicode, 6 * PARTS);
            remarks.extend(print_certificate(&shown));
            let equations = &shown.equations;
            let counts = equations.counts;
            let storage = |kind| if kind == StateKind::Signal { "integrated signal" } else { "storage" };
            let states =
                equations.states.iter().map(|s| (print_symbol(&shown, s.symbol, Style::MathMl), storage(s.kind)));
            let algebraic = equations.algebraic.iter().map(|a| {
                let cause = match a.cause {
                    AlgebraicRole::Break => "break variable",
                    AlgebraicRole::Law(_) => "law",
                    AlgebraicRole::Multiplier(_) => "multiplier",
                };
                (print_symbol(&shown, a.symbol, Style::MathMl), cause)
            });
            let length = |(left, right): &(String, String)| left.len() + right.len();
            let (lines, left_out) = first(sides_within(&shown, Style::MathMl, PARTS), length);
            let (meanings, meanings_left_out) = first(meanings_within(&shown, Style::MathMl, PARTS), String::len);
            let algebraic_count = counts.algebraic + equations.implicit.len();
            FormText {
                counts: format!(
                    "{} differential, {algebraic_count} algebraic, index {}",
                    counts.differential, equations.index
                ),
                unknowns: states.chain(algebraic).take(MOST).collect(),
                equations: lines,
                left_out,
                meanings,
                meanings_left_out,
            }
        });
        FormPart { forms: vec![form], content, remarks: vec![(form, remarks)] }
    }
}

impl FormPart {
    /// Whether all of its equations stand here: those of others are the same only if nothing of them is left out.
    fn is_whole(&self) -> bool {
        let Ok(text) = &self.content else { return true };
        let sides = text.equations.iter().flat_map(|(left, right)| [left, right]);
        text.left_out + text.meanings_left_out == 0 && !sides.chain(&text.meanings).any(|line| line.contains('…'))
    }
}

/// The first lines, and how many are left out after them: as many as one reads, by their number and by their length.
fn first<T>(mut lines: impl Iterator<Item = T>, length: impl Fn(&T) -> usize) -> (Vec<T>, usize) {
    let mut kept = Vec::new();
    let mut whole = 0;
    while kept.len() < MOST && whole < LONGEST {
        let Some(line) = lines.next() else { break };
        whole += length(&line);
        kept.push(line);
    }
    (kept, lines.count())
}

/// Forms with the same equations as one part, at the place of the first.
fn together(parts: Vec<FormPart>) -> Vec<FormPart> {
    let mut kept: Vec<FormPart> = Vec::new();
    for part in parts {
        match kept.iter_mut().find(|k| k.content == part.content && k.is_whole()) {
            Some(same) => {
                same.forms.extend(part.forms);
                same.remarks.extend(part.remarks);
            }
            None => kept.push(part),
        }
    }
    kept
}

fn path_rows(causal: &CausalGraph, loops: &crate::loops::LoopsReport) -> Vec<PathRow> {
    let paths = find_paths(causal);
    let x = &paths.exprs;
    let row = |(path, told): (&halfarrow_compiler::causal_paths::Path, &crate::loops::LoopReport)| PathRow {
        class: told.class,
        between: told.elements.join(" – "),
        route: told.route.join(" → "),
        bonds: told.bonds.iter().map(u32::to_string).collect::<Vec<_>>().join(" "),
        gain: mathml_within(x, path.gain, &PlainNames(x), PARTS),
        value: told.gain_value,
        breaks: told.breaks.join(", "),
        fate: told.resolution.clone(),
    };
    paths.paths.iter().zip(&loops.paths).map(row).collect()
}
