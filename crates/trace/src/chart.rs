//! Charts of one quantity over another as SVG: panels one above the other, with linear, logarithmic or angular axes.

use std::fmt::Write;

use crate::plot::{Axis, SAME};
use crate::svg::{COLOURS, FAMILIES, escape, n, shorten};

/// Width of the area of a panel, in px.
const WIDTH: f64 = 560.0;
/// Left of the panels, and around everything.
const LEFT: f64 = 84.0;
const MARGIN: f64 = 22.0;
/// Height of the title, and with a note.
const HEAD: f64 = 30.0;
const NOTE: f64 = 18.0;
/// Below a panel without and with labels of its horizontal axis.
const GAP: f64 = 22.0;
const FOOT: f64 = 52.0;
/// Longest name in the legend, in characters.
const NAME: usize = 28;
/// A rim of the ground's colour around texts on curves.
const HALO: &str = "stroke=\"#ffffff\" stroke-width=\"2.6\" stroke-linejoin=\"round\" paint-order=\"stroke\"";

/// A chart: a title and panels. Curves of one name have one colour, and one line in the legend.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chart {
    /// Above everything.
    pub title: String,
    /// Below the title, in small print; may be empty.
    pub note: String,
    /// From top to bottom. Panels with the same horizontal scale share it.
    pub panels: Vec<Panel>,
}

/// One area with axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// What is to the right.
    pub x: Scale,
    /// What is upwards.
    pub y: Scale,
    /// Height of the area, in px.
    pub height: f64,
    /// Equal lengths mean equal values on both axes.
    pub equal: bool,
    /// The curves.
    pub curves: Vec<Curve>,
    /// What is to be compared with.
    pub guides: Vec<Guide>,
}

/// An axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    /// What it is: `error`, `magnitude`.
    pub label: String,
    /// Unit of the values; empty if none. An angle is in degrees.
    pub unit: String,
    /// How values are spread.
    pub kind: ScaleKind,
}

/// How values are spread over an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScaleKind {
    /// Equal differences have equal lengths.
    Linear,
    /// Equal ratios have equal lengths.
    Logarithmic,
    /// As linear, with ticks at parts of a turn.
    Angle,
}

/// A curve through points, in order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// For the legend; curves without a name are not in it.
    pub name: String,
    /// The points; one that is not finite leaves a gap.
    pub points: Vec<[f64; 2]>,
    /// Whether each point has a mark.
    pub marks: bool,
    /// Whether the line is broken.
    pub dashed: bool,
}

/// A line or a point to compare with.
#[derive(Debug, Clone, PartialEq)]
pub enum Guide {
    /// A line straight up at this value, with a name.
    X(f64, String),
    /// A level line at this value, with a name.
    Y(f64, String),
    /// A cross at a point, with a name.
    Point([f64; 2], String),
    /// A line straight up at `x` between two values, with a name: a margin.
    Span {
        /// Where.
        x: f64,
        /// From, to.
        y: [f64; 2],
        /// What it is.
        name: String,
    },
}

/// Draws a chart as SVG on a white ground. Equal charts give equal texts.
///
/// ```
/// use halfarrow_trace::{Chart, Curve, Panel, Scale, ScaleKind, chart};
/// let scale = |label: &str| Scale { label: label.into(), unit: "s".into(), kind: ScaleKind::Logarithmic };
/// let curve = Curve { name: "minimal".into(), points: vec![[1e-6, 1e-3], [1e-8, 2e-3]], marks: true, dashed: false };
/// let panel = Panel { x: scale("error"), y: scale("work"), height: 300.0, equal: false, curves: vec![curve], guides: vec![] };
/// let svg = chart(&Chart { title: "Work".into(), note: String::new(), panels: vec![panel] });
/// assert!(svg.contains("10⁻⁶") && svg.contains("minimal"));
/// ```
pub fn chart(chart: &Chart) -> String {
    let mut page = Page { out: String::new(), names: names(chart) };
    let head = MARGIN + HEAD + if chart.note.is_empty() { 0.0 } else { NOTE };
    let count = chart.panels.len();
    let labelled = |i: usize| i + 1 == count || chart.panels[i].x != chart.panels[i + 1].x;
    let below = |i: usize| if labelled(i) { FOOT } else { GAP };
    let height: f64 = chart.panels.iter().enumerate().map(|(i, p)| p.height + below(i)).sum();
    let longest = page.names.iter().map(|name| name.chars().count().min(NAME)).max();
    let legend = longest.map_or(0.0, |longest| 46.0 + 7.0 * longest as f64);
    page.begin(chart, [LEFT + WIDTH + legend + MARGIN, head + height + 0.5 * MARGIN]);
    let mut top = head;
    for (i, panel) in chart.panels.iter().enumerate() {
        page.panel(panel, top, labelled(i));
        if i == 0 {
            page.legend(chart, top);
        }
        top += panel.height + below(i);
    }
    page.out.push_str("</svg>\n");
    page.out
}

/// Names of curves, in order of first occurrence.
fn names(chart: &Chart) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for curve in chart.panels.iter().flat_map(|panel| &panel.curves) {
        if !curve.name.is_empty() && !names.contains(&curve.name) {
            names.push(curve.name.clone());
        }
    }
    names
}

/// An SVG text under construction.
struct Page {
    out: String,
    names: Vec<String>,
}

/// An area with its axes.
struct Area<'a> {
    panel: &'a Panel,
    x: Axis,
    y: Axis,
}

impl Area<'_> {
    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.x.place(x), self.panel.height - self.y.place(y)]
    }

    /// Whether two curves look like one.
    fn same(&self, a: &Curve, b: &Curve) -> bool {
        let near = |p: &[f64; 2], q: &[f64; 2]| match (self.holds(*p), self.holds(*q)) {
            (true, true) => (0..2).all(|k| (self.place(*p)[k] - self.place(*q)[k]).abs() < SAME),
            (a, b) => a == b,
        };
        a.points.len() == b.points.len() && a.points.iter().zip(&b.points).all(|(p, q)| near(p, q))
    }

    /// Whether a point can be drawn at all.
    fn holds(&self, [x, y]: [f64; 2]) -> bool {
        let fits =
            |value: f64, scale: &Scale| value.is_finite() && (scale.kind != ScaleKind::Logarithmic || value > 0.0);
        fits(x, &self.panel.x) && fits(y, &self.panel.y)
    }
}

fn area(panel: &Panel) -> Area<'_> {
    let points = || panel.curves.iter().flat_map(|c| c.points.iter().copied());
    let guided = |horizontal: bool| {
        panel.guides.iter().filter_map(move |guide| match guide {
            Guide::X(x, _) => horizontal.then_some(*x),
            Guide::Y(y, _) => (!horizontal).then_some(*y),
            Guide::Point([x, y], _) => Some(if horizontal { *x } else { *y }),
            Guide::Span { x, y, .. } => Some(if horizontal { *x } else { y[0] }),
        })
    };
    let x = axis(&panel.x, points().map(|p| p[0]).chain(guided(true)), WIDTH);
    let y = axis(&panel.y, points().map(|p| p[1]).chain(guided(false)), panel.height);
    if !panel.equal {
        return Area { panel, x, y };
    }
    let (right, up) = (x.span() / WIDTH, y.span() / panel.height);
    let (x, y) = (x.widened(up / right), y.widened(right / up));
    Area { panel, x, y }
}

fn axis(scale: &Scale, values: impl Iterator<Item = f64>, length: f64) -> Axis {
    match scale.kind {
        ScaleKind::Linear => Axis::new(values, length, true),
        ScaleKind::Logarithmic => Axis::logarithmic(values, length, true),
        ScaleKind::Angle => Axis::angles(values, length),
    }
}

impl Page {
    fn begin(&mut self, chart: &Chart, [w, h]: [f64; 2]) {
        let [w, h] = [n(w.ceil()), n(h.ceil())];
        let (title, note) = (escape(&chart.title), escape(&chart.note));
        _ = write!(
            self.out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
             font-family=\"{FAMILIES}\" font-size=\"11\" fill=\"#1b1f24\">\n<title>{title}</title>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n\
             <text x=\"{LEFT}\" y=\"{}\" font-size=\"15\" font-weight=\"bold\">{title}</text>\n",
            n(MARGIN + 9.0),
        );
        if !note.is_empty() {
            _ = writeln!(self.out, "<text x=\"{LEFT}\" y=\"{}\" fill=\"#6b7280\">{note}</text>", n(MARGIN + 27.0));
        }
    }

    fn panel(&mut self, panel: &Panel, top: f64, labelled: bool) {
        let area = area(panel);
        _ = writeln!(self.out, "<g class=\"panel\" transform=\"translate({LEFT} {})\">", n(top));
        self.grid(&area, labelled);
        let (above, below): (Vec<&Guide>, Vec<&Guide>) =
            panel.guides.iter().partition(|guide| matches!(guide, Guide::Span { .. }));
        below.into_iter().for_each(|guide| self.guide(&area, guide));
        for (i, curve) in panel.curves.iter().enumerate() {
            let hidden = panel.curves[..i].iter().any(|earlier| area.same(earlier, curve));
            self.curve(&area, curve, hidden);
        }
        above.into_iter().for_each(|guide| self.guide(&area, guide));
        self.out.push_str("</g>\n");
    }

    fn grid(&mut self, area: &Area, labelled: bool) {
        let height = area.panel.height;
        let [w, h] = [WIDTH, height].map(n);
        let (mut fine, mut lines) = (String::new(), String::new());
        area.x.between.iter().for_each(|x| _ = write!(fine, "M{} 0V{h}", n(*x)));
        area.y.between.iter().for_each(|y| _ = write!(fine, "M0 {}H{w}", n(height - y)));
        area.x.ticks.iter().for_each(|t| _ = write!(lines, "M{} 0V{h}", n(t.place)));
        area.y.ticks.iter().for_each(|t| _ = write!(lines, "M0 {}H{w}", n(height - t.place)));
        _ = writeln!(self.out, "<path d=\"{fine}\" stroke=\"#f1f3f5\" fill=\"none\"/>");
        _ = writeln!(self.out, "<path d=\"{lines}\" stroke=\"#dfe3e8\" fill=\"none\"/>");
        _ = writeln!(self.out, "<path d=\"M0 0V{h}H{w}\" stroke=\"#6b7280\" fill=\"none\"/>");
        for tick in &area.y.ticks {
            self.text([-7.0, height - tick.place + 3.8], "font-size=\"10\" text-anchor=\"end\"", &tick.label);
        }
        let up = |a: &Axis, scale: &Scale| named(a, scale);
        let turned =
            format!("text-anchor=\"middle\" fill=\"#4b5563\" transform=\"rotate(-90 -58 {})\"", n(0.5 * height));
        self.text([-58.0, 0.5 * height + 3.8], &turned, &up(&area.y, &area.panel.y));
        if labelled {
            for tick in &area.x.ticks {
                self.text([tick.place, height + 15.0], "font-size=\"10\" text-anchor=\"middle\"", &tick.label);
            }
            let at = [0.5 * WIDTH, height + 33.0];
            self.text(at, "text-anchor=\"middle\" fill=\"#4b5563\"", &up(&area.x, &area.panel.x));
        }
        self.out.push('\n');
    }

    fn guide(&mut self, area: &Area, guide: &Guide) {
        let style = "stroke=\"#9aa3ad\" stroke-dasharray=\"4 3\" fill=\"none\"";
        match guide {
            Guide::X(x, name) => {
                let at = area.x.place(*x);
                _ = writeln!(self.out, "<path d=\"M{} 0V{}\" {style}/>", n(at), n(area.panel.height));
                self.text([at + 4.0, 11.0], "font-size=\"10\" fill=\"#6b7280\"", name);
            }
            Guide::Y(y, name) => {
                let at = area.panel.height - area.y.place(*y);
                _ = writeln!(self.out, "<path d=\"M0 {}H{}\" {style}/>", n(at), n(WIDTH));
                self.text([WIDTH - 4.0, at - 4.0], "font-size=\"10\" fill=\"#6b7280\" text-anchor=\"end\"", name);
            }
            Guide::Point(point, name) => {
                let [x, y] = area.place(*point);
                let cross = format!("M{} {}h10m-5 -5v10", n(x - 5.0), n(y));
                _ = writeln!(self.out, "<path d=\"{cross}\" stroke=\"#b22222\" stroke-width=\"1.5\" fill=\"none\"/>");
                self.text([x + 7.0, y - 5.0], "font-size=\"10\" fill=\"#6b7280\"", name);
            }
            Guide::Span { x, y, name } => {
                let [from, to] = [area.place([*x, y[0]]), area.place([*x, y[1]])];
                let bar = format!("M{} {}h8m-4 0V{}m-4 0h8", n(from[0] - 4.0), n(from[1]), n(to[1]));
                _ = writeln!(
                    self.out,
                    "<path class=\"margin\" d=\"{bar}\" stroke=\"#b22222\" stroke-width=\"1.4\" fill=\"none\"/>"
                );
                let (anchor, off) = if from[0] > 0.6 * WIDTH { ("end", -8.0) } else { ("start", 8.0) };
                let style = format!("font-size=\"10\" fill=\"#b22222\" text-anchor=\"{anchor}\" {HALO}");
                self.text([from[0] + off, 0.5 * (from[1] + to[1]) + 3.6], &style, name);
            }
        }
        self.out.push('\n');
    }

    fn colour(&self, curve: &Curve) -> &'static str {
        let index = self.names.iter().position(|name| *name == curve.name).unwrap_or(0);
        COLOURS[index % COLOURS.len()]
    }

    fn curve(&mut self, area: &Area, curve: &Curve, hidden: bool) {
        let colour = self.colour(curve);
        let (mut data, mut pen, mut marks) = (String::new(), false, String::new());
        for &point in &curve.points {
            if !area.holds(point) {
                pen = false;
                continue;
            }
            let [x, y] = area.place(point).map(n);
            _ = write!(data, "{}{x} {y}", if pen { 'L' } else { 'M' });
            if curve.marks {
                _ = write!(marks, "<circle cx=\"{x}\" cy=\"{y}\" r=\"2.8\"/>");
            }
            pen = true;
        }
        let dashes = match (curve.dashed, hidden) {
            (true, _) => " stroke-dasharray=\"6 4\"",
            (_, true) => " stroke-dasharray=\"7 7\"",
            _ => "",
        };
        _ = writeln!(
            self.out,
            "<path class=\"curve\" d=\"{data}\" stroke=\"{colour}\" stroke-width=\"1.7\" stroke-linejoin=\"round\" \
             stroke-linecap=\"round\" fill=\"none\"{dashes}><title>{}</title></path>",
            escape(&curve.name)
        );
        if curve.marks {
            _ = writeln!(self.out, "<g fill=\"#ffffff\" stroke=\"{colour}\" stroke-width=\"1.5\">{marks}</g>");
        }
    }

    fn legend(&mut self, chart: &Chart, top: f64) {
        let mut y = top + 6.0;
        let x = LEFT + WIDTH + 16.0;
        for name in self.names.clone() {
            let mut all = chart.panels.iter().flat_map(|panel| &panel.curves);
            let Some(curve) = all.find(|curve| curve.name == name) else { continue };
            let colour = self.colour(curve);
            let dashes = if curve.dashed { " stroke-dasharray=\"6 4\"" } else { "" };
            _ = write!(
                self.out,
                "<path d=\"M{} {}h18\" stroke=\"{colour}\" stroke-width=\"2\" fill=\"none\"{dashes}/>",
                n(x),
                n(y)
            );
            if curve.marks {
                _ = write!(
                    self.out,
                    "<circle cx=\"{}\" cy=\"{}\" r=\"2.8\" fill=\"#ffffff\" stroke=\"{colour}\" stroke-width=\"1.5\"/>",
                    n(x + 9.0),
                    n(y)
                );
            }
            self.text([x + 24.0, y + 3.8], "", &shorten(&name, NAME));
            self.out.push('\n');
            y += 17.0;
        }
    }

    fn text(&mut self, at: [f64; 2], attributes: &str, text: &str) {
        _ = write!(self.out, "<text x=\"{}\" y=\"{}\" {attributes}>{}</text>", n(at[0]), n(at[1]), escape(text));
    }
}

/// What an axis is, with its unit.
fn named(axis: &Axis, scale: &Scale) -> String {
    format!("{}{}", scale.label, axis.unit(&scale.unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(kind: ScaleKind) -> Scale {
        Scale { label: "x".into(), unit: "s".into(), kind }
    }

    fn drawn(kinds: [ScaleKind; 2], points: &[[f64; 2]]) -> String {
        let curve = Curve { name: "c".into(), points: points.to_vec(), marks: true, dashed: false };
        let [x, y] = kinds.map(scale);
        let panel = Panel { x, y, height: 200.0, equal: false, curves: vec![curve], guides: vec![] };
        chart(&Chart { title: "t".into(), note: "n".into(), panels: vec![panel] })
    }

    #[test]
    fn decades_have_labels_and_what_cannot_be_drawn_leaves_a_gap() {
        let log = [ScaleKind::Logarithmic; 2];
        let svg = drawn(log, &[[1e-6, 1.0], [0.0, 1.0], [1e-3, 1e4], [f64::NAN, 1.0], [1e-2, 1e5]]);
        for label in ["10⁻⁶", "10⁻³", "0.01", "10⁵", "1000"] {
            assert!(svg.contains(&format!(">{label}</text>")), "{label}: {svg}");
        }
        let line = svg.split("class=\"curve\" d=\"").nth(1).and_then(|rest| rest.split('"').next()).expect("a curve");
        assert_eq!(line.matches('M').count(), 3, "{line}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn a_decade_is_as_long_as_any_other() {
        let axis = Axis::logarithmic([1e-3, 1e3].into_iter(), 600.0, false);
        assert!((axis.place(1e-2) - 100.0).abs() < 1e-9 && (axis.place(1.0) - 300.0).abs() < 1e-9);
    }

    #[test]
    fn angles_have_round_ticks_and_no_values_are_no_trouble() {
        let svg = drawn([ScaleKind::Logarithmic, ScaleKind::Angle], &[[1.0, -20.0], [10.0, -170.0]]);
        assert!(svg.contains(">−90</text>") && svg.contains(">−180</text>"), "{svg}");
        for kind in [ScaleKind::Linear, ScaleKind::Logarithmic, ScaleKind::Angle] {
            let svg = drawn([kind, kind], &[]);
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }

    #[test]
    fn equal_axes_keep_circles_round() {
        let circle = Curve { points: vec![[-1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, -1.0]], ..Curve::default() };
        let panel = Panel {
            x: scale(ScaleKind::Linear),
            y: scale(ScaleKind::Linear),
            height: 300.0,
            equal: true,
            curves: vec![circle],
            guides: vec![],
        };
        let area = area(&panel);
        let (right, up) = (area.x.place(1.0) - area.x.place(0.0), area.y.place(1.0) - area.y.place(0.0));
        assert!((right - up).abs() < 1e-9, "{right} {up}");
    }
}
