//! Work against error, one curve a form.

use halfarrow_trace::{Chart, Curve, Guide, Panel, Scale, ScaleKind, chart};

use super::{CompareReport, Row, TimedRun};
use crate::draw::Picture;

impl CompareReport {
    /// Work against error, one curve a form: that of the method that serves the form best.
    pub fn plot(&self) -> Picture {
        let curves = self.rows.iter().filter_map(curve).collect();
        let axis =
            |label: &str, unit: &str| Scale { label: label.into(), unit: unit.into(), kind: ScaleKind::Logarithmic };
        let panel = Panel {
            x: axis("greatest error of the motion, relative", ""),
            y: axis("processor time for a simulated second", "s"),
            height: 340.0,
            equal: false,
            curves,
            guides: vec![Guide::X(self.error, "compared here".into())],
        };
        let note = "Towards the lower left is better. Each point is a run at another tolerance, each form with the method that \
                    serves it best.";
        let title = format!("{}: work against error", self.model);
        Picture { svg: chart(&Chart { title, note: note.into(), panels: vec![panel] }) }
    }
}

/// The runs of a form, from the least to the most exact; those that another beats in time and error are left out.
fn curve(row: &Row) -> Option<Curve> {
    let solver = row.solver?;
    let mut runs: Vec<&TimedRun> = row.runs.iter().filter(|r| r.solver == solver && r.error > 0.0).collect();
    runs.sort_by(|a, b| a.seconds_per_second.total_cmp(&b.seconds_per_second));
    let mut points: Vec<[f64; 2]> = Vec::new();
    for run in runs {
        if points.last().is_none_or(|last| run.error < last[0]) {
            points.push([run.error, run.seconds_per_second]);
        }
    }
    let name = format!("{} ({solver})", row.form);
    (!points.is_empty()).then_some(Curve { name, points, marks: true, dashed: false })
}
