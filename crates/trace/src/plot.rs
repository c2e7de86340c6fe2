//! Plots of results as SVG: one panel for each unit, one above the other over the same time.

mod axis;
mod decimate;
mod runs;

use std::fmt::Write;

use crate::svg::{COLOURS, FAMILIES, escape, n, shorten};
use crate::{Column, Trace};
pub(crate) use axis::Axis;
use decimate::decimate;
pub use runs::{PlotOptions, plot_runs};

/// Size of the area of one panel, in px.
const AREA: [f64; 2] = [640.0, 160.0];
/// From one panel to the next.
const PITCH: f64 = AREA[1] + 38.0;
/// Left of the panels, and around everything.
const LEFT: f64 = 70.0;
const MARGIN: f64 = 22.0;
/// Height of the title.
const HEAD: f64 = 34.0;
/// Panels drawn in all, and curves in each.
const PANELS: usize = 12;
const CURVES: usize = COLOURS.len();
/// Curves nearer to each other than this, in px, look like one.
pub(crate) const SAME: f64 = 0.75;
/// Longest name in the legend, in characters.
const NAME: usize = 28;

/// Draws a trace over time as SVG on a white ground.
///
/// Columns of one unit share a panel with a legend; the panels share the time axis. Of long columns first, least,
/// greatest and last value of every pixel are drawn, so that nothing visible is lost. Values that are not finite leave a
/// gap; a curve that lies on an earlier one is dashed, so that both are seen. Where a time is given twice, before and after an
/// event, a mark stands at the upper edge. At most 12 panels of 10 curves are drawn; the plot says what it leaves out. Equal traces give equal texts.
///
/// ```
/// use halfarrow_sim::Sink;
/// let mut trace = halfarrow_trace::Trace::new([("spring.q", "m")]);
/// trace.sample(0.0, &[0.1]);
/// trace.sample(1.0, &[0.2]);
/// let svg = halfarrow_trace::plot(&trace, "Spring");
/// assert!(svg.contains("spring.q in m"));
/// ```
pub fn plot(trace: &Trace, title: &str) -> String {
    let mut panels = panels(trace);
    let more = panels.len().saturating_sub(PANELS);
    panels.truncate(PANELS);
    let time = Axis::new(trace.times.iter().copied(), AREA[0], false);
    let mut page = Page::new(title, &panels, more);
    for (i, columns) in panels.iter().enumerate() {
        let top = MARGIN + HEAD + i as f64 * PITCH;
        page.panel(trace, columns, &time, top, i + 1 == panels.len());
    }
    page.finish()
}

/// The columns by unit, in order of first occurrence.
fn panels(trace: &Trace) -> Vec<Vec<&Column>> {
    let mut panels: Vec<Vec<&Column>> = Vec::new();
    for column in &trace.columns {
        match panels.iter_mut().find(|p| p[0].unit == column.unit) {
            Some(panel) => panel.push(column),
            None => panels.push(vec![column]),
        }
    }
    panels
}

/// For each column whether it lies on an earlier one all along.
fn hidden(columns: &[&Column], axis: &Axis) -> Vec<bool> {
    let place = |x: f64| if x.is_finite() { axis.place(x) } else { f64::NEG_INFINITY };
    let same = |a: &Column, b: &Column| {
        let mut pairs = a.values.iter().zip(&b.values);
        pairs.all(|(a, b)| a == b || (place(*a) - place(*b)).abs() < SAME)
    };
    (0..columns.len()).map(|i| columns[..i].iter().any(|earlier| same(earlier, columns[i]))).collect()
}

fn dashes(hidden: bool) -> &'static str {
    if hidden { " stroke-dasharray=\"7 7\"" } else { "" }
}

/// An SVG text under construction.
struct Page {
    out: String,
}

impl Page {
    fn new(title: &str, panels: &[Vec<&Column>], more: usize) -> Page {
        let names = panels.iter().flatten().map(|c| c.name.chars().count().min(NAME)).max().unwrap_or(0);
        let legend = 46.0 + 7.0 * names as f64;
        let below = if panels.is_empty() { 0.0 } else { 22.0 };
        let [w, h] = [LEFT + AREA[0] + legend + MARGIN, 2.0 * MARGIN + HEAD + panels.len() as f64 * PITCH + below];
        let [w, h] = [n(w.ceil()), n(h.ceil())];
        let mut out = String::new();
        _ = write!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             role=\"img\" font-family=\"{FAMILIES}\" font-size=\"11\" fill=\"#1b1f24\">\n<title>{title}</title>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n\
             <text x=\"{LEFT}\" y=\"{}\" font-size=\"15\" font-weight=\"bold\">{title}</text>\n",
            n(MARGIN + 11.0),
            title = escape(title),
        );
        let note = match (panels.is_empty(), more) {
            (true, _) => "nothing was recorded".to_string(),
            (_, 0) => String::new(),
            (_, more) => format!("columns in {more} more units are not drawn"),
        };
        if !note.is_empty() {
            _ = writeln!(out, "<text x=\"{LEFT}\" y=\"{}\" fill=\"#6b7280\">{note}</text>", n(MARGIN + 27.0));
        }
        Page { out }
    }
    fn finish(mut self) -> String {
        self.out.push_str("</svg>\n");
        self.out
    }
    /// One panel: grid, axes, curves, legend.
    fn panel(&mut self, trace: &Trace, columns: &[&Column], time: &Axis, top: f64, last: bool) {
        let drawn = &columns[..columns.len().min(CURVES)];
        let values = Axis::new(drawn.iter().flat_map(|c| c.values.iter().copied()), AREA[1], true);
        _ = writeln!(self.out, "<g class=\"panel\" transform=\"translate({LEFT} {})\">", n(top + 16.0));
        let names: Vec<&str> = drawn.iter().map(|c| c.name.as_str()).collect();
        let name = shorten(&names.join(", "), 80);
        self.text([0.0, -7.0], "fill=\"#4b5563\"", &format!("{name}{}", values.unit(&columns[0].unit)));
        self.grid(time, &values, last);
        self.events(&trace.times, time);
        self.out.push_str("<g fill=\"none\" stroke-width=\"1.5\" stroke-linejoin=\"round\">\n");
        let hidden = hidden(drawn, &values);
        for (i, column) in drawn.iter().enumerate() {
            self.curve(
                [COLOURS[i], dashes(hidden[i])],
                column,
                &decimate(&trace.times, &column.values, AREA[0] as usize),
                time,
                &values,
            );
        }
        self.out.push_str("</g>\n");
        self.legend(columns, &hidden);
        self.out.push_str("</g>\n");
    }
    /// Marks at the upper edge where a time is given twice, before and after an event; one a pixel.
    fn events(&mut self, times: &[f64], time: &Axis) {
        let twice = times.windows(2).filter(|pair| pair[0] == pair[1]);
        let mut places: Vec<i64> = twice.map(|pair| time.place(pair[0]).round() as i64).collect();
        places.dedup();
        if !places.is_empty() {
            let marks: String = places.iter().map(|x| format!("M{x} 0v5")).collect();
            _ = writeln!(self.out, "<path class=\"events\" d=\"{marks}\" stroke=\"#6b7280\" fill=\"none\"/>");
        }
    }
    fn grid(&mut self, time: &Axis, values: &Axis, last: bool) {
        let [w, h] = AREA.map(n);
        let mut lines = String::new();
        time.ticks.iter().for_each(|t| _ = write!(lines, "M{} 0V{h}", n(t.place)));
        values.ticks.iter().for_each(|t| _ = write!(lines, "M0 {}H{w}", n(AREA[1] - t.place)));
        _ = writeln!(self.out, "<path d=\"{lines}\" stroke=\"#e5e7eb\" fill=\"none\"/>");
        _ = writeln!(self.out, "<path d=\"M0 0V{h}H{w}\" stroke=\"#6b7280\" fill=\"none\"/>");
        for tick in &values.ticks {
            self.text([-7.0, AREA[1] - tick.place + 3.8], "font-size=\"10\" text-anchor=\"end\"", &tick.label);
        }
        if last {
            for tick in &time.ticks {
                self.text([tick.place, AREA[1] + 15.0], "font-size=\"10\" text-anchor=\"middle\"", &tick.label);
            }
            let at = [AREA[0] / 2.0, AREA[1] + 33.0];
            self.text(at, "text-anchor=\"middle\" fill=\"#4b5563\"", &format!("t{}", time.unit("s")));
        }
        self.out.push('\n');
    }
    fn curve(
        &mut self,
        [colour, dashes]: [&str; 2],
        column: &Column,
        runs: &[Vec<[f64; 2]>],
        time: &Axis,
        values: &Axis,
    ) {
        let (mut data, mut dots) = (String::new(), String::new());
        for run in runs {
            let place = |p: &[f64; 2]| [time.place(p[0]), AREA[1] - values.place(p[1])];
            let mut points = run.iter().map(place);
            let Some([x, y]) = points.next() else { continue };
            _ = write!(data, "M{} {}", n(x), n(y));
            // A lone value is a dot that can be seen.
            if run.len() == 1 {
                _ = write!(dots, "<circle cx=\"{}\" cy=\"{}\" r=\"2.4\" fill=\"{colour}\"/>", n(x), n(y));
            }
            points.for_each(|[x, y]| _ = write!(data, "L{} {}", n(x), n(y)));
        }
        let name = escape(&column.name);
        _ = writeln!(
            self.out,
            "<path class=\"curve\" d=\"{data}\" stroke=\"{colour}\" stroke-linecap=\"round\"{dashes}><title>{name}</title></path>{dots}"
        );
    }
    fn legend(&mut self, columns: &[&Column], hidden: &[bool]) {
        for (i, column) in columns.iter().take(CURVES).enumerate() {
            let y = 8.0 + 15.0 * i as f64;
            let at = AREA[0] + 14.0;
            _ = write!(
                self.out,
                "<path d=\"M{} {}h16\" stroke=\"{}\" stroke-width=\"2\" fill=\"none\"{}/>",
                n(at),
                n(y),
                COLOURS[i],
                dashes(hidden[i])
            );
            self.text([at + 22.0, y + 3.8], "", &shorten(&column.name, NAME));
            self.out.push('\n');
        }
        if columns.len() > CURVES {
            let at = [AREA[0] + 14.0, 12.0 + 15.0 * CURVES as f64];
            self.text(at, "fill=\"#6b7280\"", &format!("and {} more", columns.len() - CURVES));
        }
    }
    fn text(&mut self, at: [f64; 2], attributes: &str, text: &str) {
        _ = write!(self.out, "<text x=\"{}\" y=\"{}\" {attributes}>{}</text>", n(at[0]), n(at[1]), escape(text));
    }
}

#[cfg(test)]
mod tests;
