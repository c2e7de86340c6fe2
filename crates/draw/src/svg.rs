//! From a placed figure to SVG.

use std::fmt::Write;

use crate::figure::{FRAME, Figure, Form, Glyph, KIND, LAW, LEADING, NAME};
use crate::geometry::{Area, Paper, Point, add, flow_side};
use crate::layout::{Placement, Side, lay_out};
use crate::overlay::{COLOURS, course, lanes};
use crate::route::{Route, routes};
use crate::text::{FAMILIES, escape, width};

const MARGIN: f64 = 24.0;
const INK: &str = "#1b1f24";
const SOFT: &str = "#4b5563";
const PALE: &str = "#6b7280";
const DERIVATIVE: &str = "#b45309";
const JUNCTION: f64 = 18.0;
const NUMBER: f64 = 9.0;

/// A number for SVG: one decimal, the shortest way.
pub fn n(x: f64) -> String {
    let tenth = (x * 10.0).round() as i64;
    let sign = if tenth < 0 { "-" } else { "" };
    match (tenth.abs() / 10, tenth.abs() % 10) {
        (whole, 0) => format!("{sign}{whole}"),
        (whole, part) => format!("{sign}{whole}.{part}"),
    }
}

/// Draws a figure.
pub fn render(figure: &Figure) -> String {
    let head = head_height(figure);
    let rows = legend(figure);
    let mut placed = lay_out(&figure.network());
    let content = [&rows[..], &[head_row(figure)]].concat().iter().map(|r| r.width).fold(placed.size[0], f64::max);
    let left = MARGIN + (content - placed.size[0]) / 2.0;
    placed.anchors.iter_mut().for_each(|a| *a = [a[0] + left, a[1] + MARGIN + head]);
    let bottom = MARGIN + head + placed.size[1] + if rows.is_empty() { 0.0 } else { 22.0 };
    let size = [content + 2.0 * MARGIN, bottom + rows.len() as f64 * Row::HEIGHT + MARGIN];
    let mut svg = Svg::new(figure, size);
    svg.head(figure);
    svg.drawing(figure, &placed);
    svg.legend(&rows, bottom);
    svg.finish()
}

fn head_height(figure: &Figure) -> f64 {
    let lines = [&figure.title, &figure.doc].iter().filter(|t| !t.is_empty()).count();
    if lines == 0 { 0.0 } else { 16.0 + 20.0 * lines as f64 }
}

fn head_row(figure: &Figure) -> Row {
    let wide = width(&figure.title, 17.0, true).max(width(&figure.doc, 12.0, false));
    Row { mark: Mark::None, text: String::new(), width: wide }
}

/// A line of the legend.
#[derive(Clone)]
struct Row {
    mark: Mark,
    text: String,
    width: f64,
}

#[derive(Clone, Copy)]
enum Mark {
    None,
    Path(usize),
    Derivative,
    Undetermined,
}

impl Row {
    const HEIGHT: f64 = 19.0;
    const INDENT: f64 = 40.0;

    fn new(mark: Mark, text: String) -> Row {
        let width = Row::INDENT + width(&text, 11.5, false);
        Row { mark, text, width }
    }
}

/// What the drawing needs explained.
fn legend(figure: &Figure) -> Vec<Row> {
    let path =
        |(i, l): (usize, &crate::figure::Loop)| Row::new(Mark::Path(i), format!("class {}:  {}", l.class, l.text));
    let mut rows: Vec<Row> = figure.loops.iter().enumerate().map(path).collect();
    if !figure.note.is_empty() {
        rows.push(Row::new(Mark::None, figure.note.clone()));
    }
    if figure.glyphs.iter().any(|g| g.derivative) {
        rows.push(Row::new(Mark::Derivative, "storage in derivative causality".into()));
    }
    if figure.bonds.iter().any(|b| b.stroke.is_none()) {
        rows.push(Row::new(Mark::Undetermined, "bond whose effort and flow are not determined".into()));
    }
    rows
}

/// An SVG text under construction.
struct Svg {
    out: String,
    paper: Paper,
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
        Svg { out, paper: Paper::default() }
    }
    fn finish(mut self) -> String {
        self.out.push_str("</svg>\n");
        self.out
    }
    fn head(&mut self, figure: &Figure) {
        let mut y = MARGIN + 13.0;
        if !figure.title.is_empty() {
            self.text([MARGIN, y], &format!("font-size=\"17\" font-weight=\"bold\" fill=\"{INK}\""), &figure.title);
            y += 20.0;
        }
        if !figure.doc.is_empty() {
            self.text([MARGIN, y], &format!("font-size=\"12\" fill=\"{PALE}\""), &figure.doc);
        }
        self.out.push('\n');
    }
    fn drawing(&mut self, figure: &Figure, placed: &Placement) {
        let routes = routes(figure, placed);
        self.paths(figure, placed, &routes);
        self.bonds(figure, &routes);
        self.glyphs(figure, placed);
        self.moduli(figure, placed);
        self.junction_names(figure, placed);
        self.numbers(figure, &routes);
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

    fn paths(&mut self, figure: &Figure, placed: &Placement, routes: &[Route]) {
        if figure.loops.is_empty() {
            return;
        }
        self.open(
            "paths",
            "fill=\"none\" stroke-width=\"4.5\" stroke-linecap=\"round\" stroke-linejoin=\"round\" opacity=\"0.55\"",
        );
        for (i, (path, lane)) in figure.loops.iter().zip(lanes(figure)).enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let data = course(figure, placed, routes, path, lane);
            let tip = escape(&format!("class {}: {}", path.class, path.text));
            _ = writeln!(self.out, "<path d=\"{data}\" stroke=\"{colour}\"><title>{tip}</title></path>");
        }
        self.close();
    }

    fn bonds(&mut self, figure: &Figure, routes: &[Route]) {
        self.open("bonds", &format!("fill=\"none\" stroke=\"{INK}\" stroke-width=\"1.4\" stroke-linecap=\"round\""));
        for (i, (bond, route)) in figure.bonds.iter().zip(routes).enumerate() {
            let [from, to] = bond.ends.map(|v| &figure.glyphs[v]);
            let name = if bond.name.is_empty() { String::new() } else { format!(" {}", bond.name) };
            let tip = escape(&format!("bond {}{name}: {} → {}", i + 1, called(from), called(to)));
            _ = write!(self.out, "<g class=\"bond\" data-bond=\"{}\"><title>{tip}</title>", i + 1);
            self.shaft(route, bond.stroke.is_some());
            if let Some(end) = bond.stroke {
                self.stroke(route, end);
            }
            self.out.push_str("</g>\n");
            self.paper.add_line(route.ends[0], route.ends[1]);
        }
        self.close();
    }
    /// The bond with its half arrow: one barb on the side of the flow.
    fn shaft(&mut self, route: &Route, determined: bool) {
        let [a, b] = route.ends;
        let line = match route.bend {
            Some(c) => format!("M{} {}Q{} {} {} {}", n(a[0]), n(a[1]), n(c[0]), n(c[1]), n(b[0]), n(b[1])),
            None => format!("M{} {}L{} {}", n(a[0]), n(a[1]), n(b[0]), n(b[1])),
        };
        let along = route.arrival(1);
        let barb = add(add(b, -9.0, along), 5.5, flow_side(along));
        self.paper.add_line(b, barb);
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
        let along = route.arrival(end);
        let across = [-along[1], along[0]];
        let [p, q] = [6.5, -6.5].map(|k| add(route.ends[end], k, across));
        let side = ["from", "to"][end];
        _ = write!(
            self.out,
            "<path class=\"stroke\" data-end=\"{side}\" stroke-width=\"2\" d=\"M{} {}L{} {}\"/>",
            n(p[0]),
            n(p[1]),
            n(q[0]),
            n(q[1])
        );
        self.paper.add_line(p, q);
    }

    fn glyphs(&mut self, figure: &Figure, placed: &Placement) {
        self.open("elements", &format!("fill=\"{INK}\""));
        for (v, glyph) in figure.glyphs.iter().enumerate() {
            let at = placed.anchors[v];
            let tip = escape(&glyph.tip);
            _ = write!(self.out, "<g class=\"element\" data-name=\"{}\"><title>{tip}</title>", escape(&glyph.name));
            if glyph.derivative {
                self.frame(at, glyph.core());
            }
            match glyph.form {
                Form::Junction => self.sign(at, &glyph.kind, JUNCTION, glyph.core()),
                Form::TwoPort => self.sign(at, &glyph.kind, KIND, glyph.core()),
                Form::Field => self.field(at, glyph),
                Form::OnePort | Form::Source => self.one_port(at, glyph, placed.facing[v], placed.mirrored[v]),
            }
            self.out.push_str("</g>\n");
        }
        self.close();
    }
    /// The sign of a kind, centred.
    fn sign(&mut self, at: Point, kind: &str, size: f64, core: Point) {
        let y = at[1] + 0.36 * size;
        let style = format!("font-size=\"{size}\" font-weight=\"bold\" text-anchor=\"middle\"");
        self.text([at[0], y], &style, kind);
        self.paper.add_box(Area::around(at, [2.0 * core[0], 2.0 * core[1]]));
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
    fn small(&mut self, at: Point, anchor: &str, italic: bool, text: &str) {
        let slant = if italic { " font-style=\"italic\"" } else { "" };
        let style = format!("font-size=\"{LAW}\"{slant} text-anchor=\"{anchor}\" fill=\"{SOFT}\"");
        self.text(at, &style, text);
        let wide = width(text, LAW, false);
        let centre = match anchor {
            "start" => at[0] + wide / 2.0,
            "end" => at[0] - wide / 2.0,
            _ => at[0],
        };
        self.paper.add_box(Area::around([centre, at[1] - 4.0], [wide, LEADING - 1.0]));
    }
    fn field(&mut self, at: Point, glyph: &Glyph) {
        let lift = if glyph.law.is_empty() { 0.0 } else { LEADING / 2.0 };
        let y = at[1] + 0.36 * KIND - lift;
        self.main_line([at[0], y], "middle", glyph);
        let [w, h] = glyph.core();
        self.paper.add_box(Area::around(at, [2.0 * w, 2.0 * h]));
        if !glyph.law.is_empty() {
            self.small([at[0], y + LEADING], "middle", true, &glyph.law);
        }
    }
    /// `Kind : name`, or `name : Kind` if it ends at the bond.
    fn main_line(&mut self, at: Point, anchor: &str, glyph: &Glyph) {
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
    fn one_port(&mut self, at: Point, glyph: &Glyph, facing: Side, mirrored: bool) {
        let half = width(&glyph.kind, KIND, true) / 2.0;
        let y = at[1] + 0.36 * KIND;
        let to_left = facing == Side::East || mirrored;
        let (x, anchor, out) = if to_left { (at[0] + half, "end", -1.0) } else { (at[0] - half, "start", 1.0) };
        self.main_line([x, y], anchor, glyph);
        let [w, h] = glyph.core();
        self.paper.add_box(Area::around(at, [2.0 * w, 2.0 * h]));
        let text = glyph.name_width();
        self.paper.add_box(Area::around([at[0] + out * (half + text / 2.0), at[1]], [text, 16.0]));
        if !glyph.law.is_empty() {
            let row = if facing == Side::South { y - LEADING - 3.0 } else { y + LEADING };
            let indent = glyph.law_indent(facing);
            self.small([x + out * indent, row], anchor, true, &glyph.law);
        }
    }

    /// Modulus and name of each two-port, beside it where there is room.
    fn moduli(&mut self, figure: &Figure, placed: &Placement) {
        self.open("moduli", &format!("font-size=\"{LAW}\" fill=\"{SOFT}\" text-anchor=\"middle\""));
        for (v, glyph) in figure.glyphs.iter().enumerate().filter(|g| g.1.form == Form::TwoPort) {
            let lines = glyph.small_lines();
            let size = [glyph.small_width() + 2.0, lines.len() as f64 * LEADING];
            let centre =
                self.paper.settle(&beside_two_port(placed.anchors[v], glyph.core(), size, placed.facing[v]), size);
            for (i, line) in lines.iter().enumerate() {
                let slant = if i == 0 && !glyph.law.is_empty() { "font-style=\"italic\"" } else { "" };
                self.text([centre[0], centre[1] - size[1] / 2.0 + 10.0 + i as f64 * LEADING], slant, line);
            }
            self.out.push('\n');
        }
        self.close();
    }
    /// Small names in a free corner of each junction.
    fn junction_names(&mut self, figure: &Figure, placed: &Placement) {
        self.open("junctions", &format!("font-size=\"{LAW}\" fill=\"{SOFT}\" text-anchor=\"middle\""));
        for (v, glyph) in figure.glyphs.iter().enumerate() {
            if glyph.form == Form::Junction && !glyph.name.is_empty() && glyph.name != glyph.kind {
                let size = [width(&glyph.name, LAW, false) + 2.0, 11.0];
                let centre = self.paper.settle(&corners(placed.anchors[v], glyph.core(), size), size);
                self.text([centre[0], centre[1] + 4.0], "", &glyph.name);
                self.out.push('\n');
            }
        }
        self.close();
    }
    /// Bond numbers and port names beside the bonds.
    fn numbers(&mut self, figure: &Figure, routes: &[Route]) {
        self.open("numbers", &format!("font-size=\"{NUMBER}\" fill=\"{PALE}\" text-anchor=\"middle\""));
        for (i, (bond, route)) in figure.bonds.iter().zip(routes).enumerate() {
            for (end, port) in bond.ports.iter().enumerate().filter(|p| !p.1.is_empty()) {
                self.beside(route, if end == 0 { [0.16, 0.3] } else { [0.84, 0.7] }, port);
            }
            self.beside(route, [0.5, 0.36], &(i + 1).to_string());
        }
        self.close();
    }
    /// A small text beside a bond, at the first of these fractions of the way if it is free there.
    fn beside(&mut self, route: &Route, ways: [f64; 2], text: &str) {
        let size = [width(text, NUMBER, false) + 1.5, NUMBER];
        let flow = flow_side(route.arrival(1));
        let away = 3.0 + (flow[0] * size[0]).abs() / 2.0 + (flow[1] * size[1]).abs() / 2.0;
        let places = |t: f64| [-1.0, 1.0].map(|k| add(route.at(t), k * away, flow));
        let centres = [ways[0], ways[1], 1.0 - ways[1]].map(places).concat();
        let centre = self.paper.settle(&centres, size);
        self.text([centre[0], centre[1] + 0.36 * NUMBER], "", text);
        self.out.push('\n');
    }

    fn legend(&mut self, rows: &[Row], top: f64) {
        if rows.is_empty() {
            return;
        }
        self.open("legend", &format!("font-size=\"11.5\" fill=\"{INK}\""));
        for (i, row) in rows.iter().enumerate() {
            let y = top + (i as f64 + 0.5) * Row::HEIGHT;
            self.mark(row.mark, y);
            self.text([MARGIN + Row::INDENT, y + 4.0], "", &row.text);
            self.out.push('\n');
        }
        self.close();
    }
    fn mark(&mut self, mark: Mark, y: f64) {
        let line = format!("<path d=\"M{} {y}h28\" fill=\"none\" ", MARGIN + 2.0, y = n(y));
        match mark {
            Mark::None => {}
            Mark::Path(i) => {
                let colour = COLOURS[i % COLOURS.len()];
                _ = write!(
                    self.out,
                    "{line}stroke=\"{colour}\" stroke-width=\"4.5\" stroke-linecap=\"round\" opacity=\"0.55\"/>"
                );
            }
            Mark::Derivative => self.frame([MARGIN + 16.0, y], [11.0, 7.0]),
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

/// Places for the text of a two-port, best first: above or to the right, then around it.
fn beside_two_port(at: Point, core: Point, size: Point, facing: Side) -> Vec<Point> {
    let [x, y] = [core[0] + size[0] / 2.0, core[1] + size[1] / 2.0];
    let mut straight = [[0.0, -y], [0.0, y], [x, 0.0], [-x, 0.0]];
    if matches!(facing, Side::North | Side::South) {
        straight.rotate_left(2);
    }
    let corners = [[x - 4.0, -y], [x - 4.0, y], [4.0 - x, -y], [4.0 - x, y]];
    straight.iter().chain(&corners).map(|s| [at[0] + s[0], at[1] + s[1]]).collect()
}

/// Places for a junction's name, best first: the four corners, then further out.
fn corners(at: Point, core: Point, size: Point) -> Vec<Point> {
    let corner = |far: f64| {
        let x = core[0] - 2.0 + size[0] / 2.0;
        let y = core[1] - 1.0 + size[1] / 2.0 - 2.0 + far;
        [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|s| [at[0] + s[0] * x, at[1] + s[1] * y])
    };
    let straight = [[at[0], at[1] - core[1] - 6.0], [at[0], at[1] + core[1] + 6.0]];
    [corner(0.0).to_vec(), corner(5.0).to_vec(), straight.to_vec()].concat()
}
