//! From a placed figure to SVG.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::figure::{FRAME, Figure, Form, Glyph, KIND, LAW, LEADING, Loop, NAME, NUMBER};
use crate::geometry::Point;
use crate::label::{law_lines, main_line};
use crate::layout::{Placement, Side};
use crate::overlay::{course, look};
use crate::route::Route;
use crate::scene::{Scene, name_size, scene};
use crate::symbol::Symbol;
use crate::text::{FAMILIES, escape, width, wrap};

const MARGIN: f64 = 24.0;
const INK: &str = "#1b1f24";
const SOFT: &str = "#4b5563";
const PALE: &str = "#6b7280";
const DERIVATIVE: &str = "#b45309";
const KEPT: &str = "#1d4ed8";
const JUNCTION: f64 = 18.0;
/// Longest line above and below the drawing, in characters.
const LEGEND: usize = 110;
/// A rim of the ground's colour, so that small texts can be read on coloured paths.
const HALO: &str = "stroke=\"#ffffff\" stroke-width=\"2.6\" stroke-linejoin=\"round\" paint-order=\"stroke\"";

/// A number for SVG: one decimal, the shortest way.
pub fn n(x: f64) -> String {
    let tenth = (x * 10.0).round() as i64;
    let sign = if tenth < 0 { "-" } else { "" };
    match (tenth.abs() / 10, tenth.abs() % 10) {
        (whole, 0) => format!("{sign}{whole}"),
        (whole, part) => format!("{sign}{whole}.{part}"),
    }
}

/// Draws a figure; elements whose places are known by their names stay there, as seen from each other.
pub fn render(figure: &Figure, keep: &BTreeMap<String, Point>) -> String {
    let head = head(figure);
    let rows = legend(figure);
    let scene = scene(figure, keep);
    let (low, high) = scene.extent(figure);
    let size = [high[0] - low[0], high[1] - low[1]];
    let content = rows.iter().chain(&head).map(|r| r.width).fold(size[0], f64::max);
    let top = MARGIN + if head.is_empty() { 0.0 } else { 16.0 + head.iter().map(|r| r.height).sum::<f64>() };
    let move_by = [MARGIN + (content - size[0]) / 2.0 - low[0], top - low[1]];
    let scene = scene.moved(move_by);
    let bottom = top + size[1] + if rows.is_empty() { 0.0 } else { 22.0 };
    let paper = [content + 2.0 * MARGIN, bottom + rows.iter().map(|r| r.height).sum::<f64>() + MARGIN];
    let mut svg = Svg::new(figure, paper);
    svg.head(&head);
    svg.drawing(figure, &scene);
    svg.legend(&rows, bottom);
    svg.finish()
}

/// Title and documentation.
fn head(figure: &Figure) -> Vec<Row> {
    let title =
        Row { mark: Mark::Title, text: figure.title.clone(), width: width(&figure.title, 17.0, true), height: 20.0 };
    let doc = |text: String| Row { mark: Mark::Doc, width: width(&text, 12.0, false), text, height: 17.0 };
    let title = (!figure.title.is_empty()).then_some(title);
    title.into_iter().chain(wrap(&figure.doc, LEGEND).into_iter().map(doc)).collect()
}

/// A line above or below the drawing.
#[derive(Clone)]
struct Row {
    mark: Mark,
    text: String,
    width: f64,
    height: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum Mark {
    Title,
    Doc,
    None,
    Path(usize),
    Derivative,
    Kept,
    Undetermined,
}

impl Row {
    const INDENT: f64 = 40.0;

    /// A text of the legend, in as many lines as it takes.
    fn lines(mark: Mark, text: &str) -> Vec<Row> {
        let row = |(i, text): (usize, String)| Row {
            mark: if i == 0 { mark } else { Mark::None },
            width: Row::INDENT + width(&text, 11.5, false),
            text,
            height: if i == 0 { 19.0 } else { 14.0 },
        };
        wrap(text, LEGEND).into_iter().enumerate().map(row).collect()
    }
}

/// What the drawing needs explained.
fn legend(figure: &Figure) -> Vec<Row> {
    let path = |l: &Loop| Row::lines(Mark::Path(l.number), &format!("{}   class {}:  {}", l.number, l.class, l.text));
    let mut rows: Vec<Row> = figure.loops.iter().flat_map(path).collect();
    rows.extend(Row::lines(Mark::None, &figure.note));
    rows.extend(figure.laws.iter().flat_map(|law| Row::lines(Mark::None, law)));
    if figure.glyphs.iter().any(|g| g.derivative) {
        rows.extend(Row::lines(Mark::Derivative, "storage in derivative causality"));
    }
    if figure.glyphs.iter().any(|g| g.kept) {
        let text = "junction whose flow (1) or effort (0) is independent: no bond sets it, it acts as a source there";
        rows.extend(Row::lines(Mark::Kept, text));
    }
    if figure.bonds.iter().any(|b| b.mixed) {
        let text = "bonds side by side with their strokes at different ends (--expand draws them one by one)";
        rows.extend(Row::lines(Mark::None, text));
    }
    if figure.bonds.iter().any(|b| b.stroke.is_none()) {
        rows.extend(Row::lines(Mark::Undetermined, "bond whose effort and flow are not determined"));
    }
    rows
}

/// An SVG text under construction.
struct Svg {
    out: String,
}

impl Svg {
    fn new(figure: &Figure, size: Point) -> Svg {
        let mut out = String::new();
        let [w, h] = size.map(|x| n(x.ceil()));
        _ = write!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             role=\"img\" font-family=\"{FAMILIES}\">\n<title>{}</title>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n",
            escape(&figure.title)
        );
        Svg { out }
    }
    fn finish(mut self) -> String {
        self.out.push_str("</svg>\n");
        self.out
    }
    fn head(&mut self, rows: &[Row]) {
        let mut y = MARGIN + 13.0;
        for row in rows {
            let style = match row.mark {
                Mark::Title => format!("font-size=\"17\" font-weight=\"bold\" fill=\"{INK}\""),
                _ => format!("font-size=\"12\" fill=\"{PALE}\""),
            };
            self.text([MARGIN, y], &style, &row.text);
            y += row.height;
        }
        self.out.push('\n');
    }
    fn drawing(&mut self, figure: &Figure, scene: &Scene) {
        self.paths(figure, scene);
        self.bonds(figure, &scene.routes);
        self.glyphs(figure, &scene.placed);
        self.names(figure, scene, Form::TwoPort, "moduli");
        self.names(figure, scene, Form::Junction, "junctions");
        self.numbers(scene);
    }
    fn text(&mut self, at: Point, attributes: &str, text: &str) {
        _ = write!(self.out, "<text x=\"{}\" y=\"{}\" {attributes}>{}</text>", n(at[0]), n(at[1]), escape(text));
    }
    fn open(&mut self, class: &str, attributes: &str) {
        _ = writeln!(self.out, "<g class=\"{class}\" {attributes}>");
    }
    fn close(&mut self) {
        self.out.push_str("</g>\n");
    }

    fn paths(&mut self, figure: &Figure, scene: &Scene) {
        if figure.loops.is_empty() {
            return;
        }
        let width = n(scene.lanes.width());
        self.open(
            "paths",
            &format!("fill=\"none\" stroke-width=\"{width}\" stroke-linecap=\"round\" stroke-linejoin=\"round\" opacity=\"0.55\""),
        );
        for (i, path) in figure.loops.iter().enumerate() {
            let data = course(figure, &scene.placed, &scene.routes, &scene.lanes, i);
            let tip = escape(&format!("{}, class {}: {}", path.number, path.class, path.text));
            let look = stroked(path.number);
            _ = writeln!(
                self.out,
                "<path data-path=\"{}\" d=\"{data}\" {look}><title>{tip}</title></path>",
                path.number
            );
        }
        self.close();
    }

    fn bonds(&mut self, figure: &Figure, routes: &[Route]) {
        self.open("bonds", &format!("fill=\"none\" stroke=\"{INK}\" stroke-width=\"1.4\" stroke-linecap=\"round\""));
        for (bond, route) in figure.bonds.iter().zip(routes) {
            let [from, to] = bond.ends.map(|v| &figure.glyphs[v]);
            let name = if bond.name.is_empty() { String::new() } else { format!(" {}", bond.name) };
            let tip = escape(&format!("bond {}{name}: {} → {}", bond.number, called(from), called(to)));
            _ = write!(self.out, "<g class=\"bond\" data-bond=\"{}\"><title>{tip}</title>", bond.number);
            if bond.width > 1 {
                _ = write!(self.out, "<g class=\"wide\" data-width=\"{}\" stroke-width=\"2.8\">", bond.width);
            }
            self.shaft(route, bond.stroke.is_some());
            match bond.stroke {
                _ if bond.mixed => [0, 1].into_iter().for_each(|end| self.stroke(route, end)),
                Some(end) => self.stroke(route, end),
                None => {}
            }
            if bond.width > 1 {
                self.out.push_str("</g>");
            }
            self.out.push_str("</g>\n");
        }
        self.close();
    }
    /// The bond with its half arrow: one barb on the side of the flow.
    fn shaft(&mut self, route: &Route, determined: bool) {
        let mut line = String::new();
        for (i, p) in route.points.iter().enumerate() {
            _ = write!(line, "{}{} {}", if i == 0 { 'M' } else { 'L' }, n(p[0]), n(p[1]));
        }
        let [b, barb] = route.barb();
        let barb = format!("{} {}", n(barb[0]), n(barb[1]));
        if determined {
            _ = write!(self.out, "<path class=\"shaft\" d=\"{line}L{barb}\"/>");
        } else {
            _ = write!(
                self.out,
                "<path class=\"shaft\" d=\"{line}\" stroke-dasharray=\"0.1 4\"/><path d=\"M{} {}L{barb}\"/>",
                n(b[0]),
                n(b[1])
            );
        }
    }
    /// The causal stroke at an end of a bond.
    fn stroke(&mut self, route: &Route, end: usize) {
        let [p, q] = route.stroke(end);
        let side = ["from", "to"][end];
        _ = write!(
            self.out,
            "<path class=\"stroke\" data-end=\"{side}\" stroke-width=\"2\" d=\"M{} {}L{} {}\"/>",
            n(p[0]),
            n(p[1]),
            n(q[0]),
            n(q[1])
        );
    }

    fn glyphs(&mut self, figure: &Figure, placed: &Placement) {
        self.open("elements", &format!("fill=\"{INK}\""));
        for (v, glyph) in figure.glyphs.iter().enumerate() {
            let at = placed.anchors[v];
            let (tip, name) = (escape(&glyph.tip), escape(&glyph.name));
            let [x, y] = at.map(n);
            _ = write!(self.out, "<g class=\"element\" data-name=\"{name}\" data-at=\"{x} {y}\"><title>{tip}</title>");
            if glyph.derivative {
                self.frame(at, glyph.core());
            }
            if glyph.kept {
                self.ring(at, glyph.core());
            }
            if let Some(symbol) = glyph.symbol {
                self.symbol(at, symbol);
            }
            match glyph.form {
                Form::TwoPort if glyph.symbol.is_some() => {}
                Form::Junction => self.sign(at, &glyph.kind, JUNCTION),
                Form::TwoPort => self.sign(at, &glyph.kind, KIND),
                _ => self.lines(at, glyph, placed.facing[v], placed.mirrored[v]),
            }
            self.out.push_str("</g>\n");
        }
        self.close();
    }
    /// The sign of a kind, centred.
    fn sign(&mut self, at: Point, kind: &str, size: f64) {
        let y = at[1] + 0.36 * size;
        let style = format!("font-size=\"{size}\" font-weight=\"bold\" text-anchor=\"middle\"");
        self.text([at[0], y], &style, kind);
    }
    /// A symbol in the place of a keyword.
    fn symbol(&mut self, at: Point, symbol: Symbol) {
        let [x, y] = at.map(n);
        _ = write!(
            self.out,
            "<g class=\"symbol\" data-symbol=\"{}\" transform=\"translate({x} {y})\" stroke=\"{INK}\" stroke-width=\"1.3\" \
             stroke-linejoin=\"round\" stroke-linecap=\"round\"><path d=\"{}\" fill=\"none\"/>",
            symbol.name, symbol.lines
        );
        if !symbol.areas.is_empty() {
            _ = write!(self.out, "<path d=\"{}\"/>", symbol.areas);
        }
        self.out.push_str("</g>");
    }
    /// The mark of a storage in derivative causality.
    fn frame(&mut self, at: Point, core: Point) {
        _ = write!(
            self.out,
            "<rect class=\"derivative\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"5\" fill=\"#fff7ed\" \
             stroke=\"{DERIVATIVE}\" stroke-width=\"1.2\" stroke-dasharray=\"3.5 2.5\"/>",
            n(at[0] - core[0]),
            n(at[1] - core[1]),
            n(2.0 * core[0]),
            n(2.0 * core[1])
        );
    }
    /// The mark of a junction that keeps its variable.
    fn ring(&mut self, at: Point, core: Point) {
        _ = write!(
            self.out,
            "<ellipse class=\"kept\" cx=\"{}\" cy=\"{}\" rx=\"{}\" ry=\"{}\" fill=\"#eff6ff\" stroke=\"{KEPT}\" \
             stroke-width=\"1.2\"/>",
            n(at[0]),
            n(at[1]),
            n(core[0]),
            n(core[1])
        );
    }
    /// `Kind : name` with the law below or above it.
    fn lines(&mut self, at: Point, glyph: &Glyph, facing: Side, mirrored: bool) {
        let main = main_line(glyph, at, facing, mirrored);
        self.main_line(main.at, main.anchor, glyph);
        for (line, place) in glyph.law.iter().zip(law_lines(glyph, at, facing, mirrored)) {
            let style =
                format!("font-size=\"{LAW}\" font-style=\"italic\" text-anchor=\"{}\" fill=\"{SOFT}\"", place.anchor);
            self.text(place.at, &style, line);
        }
    }
    /// The name beside a symbol that stands in the place of a keyword.
    fn name_beside_symbol(&mut self, at: Point, anchor: &str, glyph: &Glyph) {
        // Spaces at the ends of a text are not drawn.
        let off = glyph.sign_width() + width(" ", NAME, false) + if glyph.derivative { FRAME } else { 0.0 };
        let (x, line) = match anchor {
            _ if glyph.name.is_empty() => return,
            "end" => (at[0] - off, format!("{} :", glyph.name)),
            _ => (at[0] + off, format!(": {}", glyph.name)),
        };
        self.text([x, at[1]], &format!("font-size=\"{NAME}\" text-anchor=\"{anchor}\""), &line);
    }
    /// `Kind : name`, or `name : Kind` if it ends at the bond.
    fn main_line(&mut self, at: Point, anchor: &str, glyph: &Glyph) {
        if glyph.symbol.is_some() {
            return self.name_beside_symbol(at, anchor, glyph);
        }
        let shift = if glyph.derivative { format!(" dx=\"{}\"", n(FRAME)) } else { String::new() };
        let before = if anchor == "end" { &shift } else { "" };
        let kind = format!("<tspan{before} font-weight=\"bold\" font-size=\"{KIND}\">{}</tspan>", escape(&glyph.kind));
        let name = escape(&glyph.name);
        let line = match (name.is_empty(), anchor) {
            (true, _) => kind,
            (_, "end") => format!("{name} : {kind}"),
            _ => format!("{kind}<tspan{shift}> : {name}</tspan>"),
        };
        _ = write!(
            self.out,
            "<text x=\"{}\" y=\"{}\" font-size=\"{NAME}\" text-anchor=\"{anchor}\">{line}</text>",
            n(at[0]),
            n(at[1])
        );
    }
    /// Modulus and name of two-ports, or small names of junctions.
    fn names(&mut self, figure: &Figure, scene: &Scene, form: Form, class: &str) {
        self.open(class, &format!("font-size=\"{LAW}\" fill=\"{SOFT}\" text-anchor=\"middle\" {HALO}"));
        for &(v, centre) in scene.names.iter().filter(|(v, _)| figure.glyphs[*v].form == form) {
            let glyph = &figure.glyphs[v];
            if form == Form::Junction {
                self.text([centre[0], centre[1] + 4.0], "", &glyph.name);
            } else {
                let top = centre[1] - name_size(figure, v)[1] / 2.0 + 10.0;
                for (i, line) in glyph.small_lines().into_iter().enumerate() {
                    let slant = if i < glyph.law.len() { "font-style=\"italic\"" } else { "" };
                    self.text([centre[0], top + i as f64 * LEADING], slant, line);
                }
            }
            self.out.push('\n');
        }
        self.close();
    }
    /// Bond numbers and port names.
    fn numbers(&mut self, scene: &Scene) {
        self.open("numbers", &format!("font-size=\"{NUMBER}\" fill=\"{SOFT}\" text-anchor=\"middle\" {HALO}"));
        for (text, centre) in &scene.numbers {
            self.text([centre[0], centre[1] + 0.36 * NUMBER], "", text);
            self.out.push('\n');
        }
        self.close();
    }

    fn legend(&mut self, rows: &[Row], top: f64) {
        if rows.is_empty() {
            return;
        }
        self.open("legend", &format!("font-size=\"11.5\" fill=\"{INK}\""));
        let mut y = top;
        for row in rows {
            self.mark(row.mark, y + 9.5);
            self.text([MARGIN + Row::INDENT, y + row.height - 5.5], "", &row.text);
            self.out.push('\n');
            y += row.height;
        }
        self.close();
    }
    fn mark(&mut self, mark: Mark, y: f64) {
        let line = format!("<path d=\"M{} {y}h28\" fill=\"none\" ", MARGIN + 2.0, y = n(y));
        match mark {
            Mark::None | Mark::Title | Mark::Doc => {}
            Mark::Path(number) => {
                let look = stroked(number);
                _ = write!(self.out, "{line}{look} stroke-width=\"4.5\" stroke-linecap=\"round\" opacity=\"0.55\"/>");
            }
            Mark::Derivative => self.frame([MARGIN + 16.0, y], [11.0, 7.0]),
            Mark::Kept => self.ring([MARGIN + 16.0, y], [7.0, 8.0]),
            Mark::Undetermined => {
                _ = write!(
                    self.out,
                    "{line}stroke=\"{INK}\" stroke-width=\"1.4\" stroke-linecap=\"round\" stroke-dasharray=\"0.1 4\"/>"
                );
            }
        }
    }
}

/// How an element is called in a tip.
fn called(glyph: &Glyph) -> String {
    if glyph.name.is_empty() { glyph.kind.clone() } else { format!("{}:{}", glyph.kind, glyph.name) }
}

/// Colour and dashes of a path, as attributes.
fn stroked(number: usize) -> String {
    let (colour, dashes) = look(number);
    let dashes = if dashes.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{dashes}\"") };
    format!("stroke=\"{colour}\"{dashes}")
}
