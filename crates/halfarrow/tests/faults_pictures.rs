//! Pictures and reports of models that are larger than the examples.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::path::Path;
use std::time::Instant;

use halfarrow::{
    Compare, DrawOptions, DrawnPaths, Error, Form, Linearize, Model, PlotOptions, Problem, Record, Report, Run,
    positions,
};

fn load(path: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    Model::load(&path, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn model(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn report(model: &Model, wanted: &Report, told: &mut Vec<String>) -> String {
    let mut tell = |part: f64, what: &str| {
        assert!((0.0..=1.0).contains(&part), "{part}");
        told.push(what.to_string());
        true
    };
    model.report(wanted, &mut tell).unwrap_or_else(|e| panic!("{}", e.render(false))).html
}

#[test]
fn a_report_compares_within_its_time_and_says_what_is_left_out() {
    let model = load("tests/faults/wishbone.bond");
    let wanted = Report { to: Some(0.5), compare_budget: 0.02, ..Report::default() };
    let mut told = Vec::new();
    let page = report(&model, &wanted, &mut told);
    let section = page.split("<section id=\"comparison\">").nth(1).expect("a section");
    let section = section.split("</section>").next().unwrap_or_default();
    assert!(section.contains("0.02 s for comparing do not suffice") || section.contains("left out"), "{section}");
    assert!(told.iter().any(|w| w.contains("lagrange")) && told.iter().any(|w| w == "drawing"), "{told:?}");
}

#[test]
fn comparing_keeps_to_its_budget() {
    let model = load("../../models/slider_crank/model.bond");
    let begun = Instant::now();
    let wanted = Compare { to: Some(5.0), error: 1e-9, budget: Some(1.0), ..Compare::default() };
    let report = model.compare(&wanted, &mut |_, _| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let without = report.rows.iter().filter(|row| row.seconds_per_second.is_none()).count();
    assert!(without == 0 || report.notes.iter().any(|n| n.contains("was given 1 s")), "{:?}", report.notes);
    assert!(begun.elapsed().as_secs_f64() < 60.0, "{:?}", begun.elapsed());
    let none = Compare { budget: Some(-1.0), ..Compare::default() };
    assert!(matches!(model.compare(&none, &mut |_, _| true), Err(Error::Usage(_))));
}

#[test]
fn equal_equations_stand_once_with_the_names_of_their_forms() {
    let model = load("../../models/pendulum/model.bond");
    let page = report(&model, &Report { to: Some(0.5), compare: false, ..Report::default() }, &mut Vec::new());
    for name in
        ["Minimal form", "Kane’s form", "Inverted form", "Classical form: break", "Lagrange’s form", "Stiff form"]
    {
        assert_eq!(
            page.matches(&format!("<h3>{name}")).count() + page.matches(&format!("<h3 class=\"same\">{name}")).count(),
            1,
            "{name}"
        );
    }
    let forms: Vec<&str> =
        page.split("<div class=\"form\">").skip(1).map(|f| f.split("</div>").next().unwrap_or_default()).collect();
    let tables: Vec<&str> = forms.iter().filter_map(|f| f.split("<table").nth(1)).collect();
    assert!(tables.len() < Form::ALL.len());
    for (i, table) in tables.iter().enumerate() {
        assert!(!tables[..i].contains(table), "a table stands twice: {table}");
    }
}

#[test]
fn curves_of_a_report_come_with_all_that_is_needed_to_zoom_them() {
    let page = report(
        &load("../../models/pendulum/model.bond"),
        &Report { to: Some(0.5), compare: false, ..Report::default() },
        &mut Vec::new(),
    );
    assert!(
        page.contains("<div id=\"curves\">")
            && page.contains("var uPlot=function()")
            && page.contains("const runs = {t:[")
    );
    for outside in ["http", "src=", "url(", "@import", "<link", "<iframe", "XMLHttpRequest", "fetch(", "import("] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert_eq!(page.matches("<script>").count(), page.matches("</script>").count());
}

const TWO_NAMES: &str = "model Two\nSe:push(1) -> 1:j -> I:mass(2)\nj -> R:drag(1)\noutput speed = mass.f\n";

#[test]
fn an_output_that_is_a_state_does_not_hide_it() {
    let model = model(TWO_NAMES);
    let done = model.simulate(&Run { to: 3.0, every: Some(0.1), ..Run::default() }, &mut |_| true).expect("a run");
    let svg = model.plot(&done.trace).svg;
    let curves: Vec<&str> =
        svg.split("class=\"curve\"").skip(1).map(|c| c.split("</path>").next().unwrap_or_default()).collect();
    let dashed: Vec<bool> = curves.iter().map(|c| c.contains("stroke-dasharray")).collect();
    assert_eq!(dashed, [false, true], "{svg}");
}

#[test]
fn chosen_variables_of_several_runs_lie_over_each_other() {
    let run = Run { to: 3.0, every: Some(0.1), record: Record::Also(vec!["drag.e".into()]), ..Run::default() };
    let first = model(TWO_NAMES);
    let one = first.simulate(&run, &mut |_| true).expect("a run").trace;
    assert_eq!(one.columns.iter().map(|c| &c.name[..]).collect::<Vec<_>>(), ["mass.f", "speed", "drag.e"]);
    let other = model(&TWO_NAMES.replace("mass(2)", "mass(1)")).simulate(&run, &mut |_| true).expect("a run").trace;
    let options = PlotOptions { vars: vec!["drag.e".into()], x: Some("mass.f".into()), log: [false, true] };
    let svg = first.plot_runs(&[("heavy", &one), ("light", &other)], &options).expect("a plot").svg;
    assert_eq!(svg.matches("class=\"curve\"").count(), 2);
    assert!(
        svg.contains("drag.e · heavy") && svg.contains("drag.e · light") && svg.contains(">mass.f</text>"),
        "{svg}"
    );
    assert!(!svg.contains("NaN") && svg.contains("<title>Two</title>"));
    let unknown = PlotOptions { vars: vec!["drg.e".into()], ..PlotOptions::default() };
    let error = first.plot_runs(&[("", &one)], &unknown).expect_err("there is none");
    assert!(matches!(&error, Problem::UnknownVariable { nearest: Some(near), .. } if near == "drag.e"), "{error}");
}

/// `K/(s (s + 1)^2)`, `K = 1/2`: crosses -180° at 1 rad/s with the magnitude K/2.
const LOOP: &str = "model Loop\ninput u = 0\nMSe:drive(0.5*u) -> 1:a -> I:ia(1)\na -> R:ra(1)\nstate x' = ia.f from 0\nstate y' = x - y from 0\noutput out = y\n";

#[test]
fn margins_of_a_loop_are_those_of_its_transfer_function() {
    let model = model(LOOP);
    let wanted =
        Linearize { inputs: Some(vec!["u".into()]), outputs: Some(vec!["out".into()]), ..Linearize::default() };
    let report = model.linearize(&wanted).expect("a linear model");
    let margins = report.responses()[0].margins();
    let gain = margins.iter().find(|m| m.of_gain).expect("a gain margin");
    assert!(
        (gain.hertz - 1.0 / std::f64::consts::TAU).abs() < 1e-4 && (gain.size() - 20.0 * 4.0_f64.log10()).abs() < 1e-2,
        "{gain:?}"
    );
    let phase = margins.iter().find(|m| !m.of_gain).expect("a phase margin");
    // |K/(jw (jw + 1)^2)| = 1 means w (w^2 + 1) = K: w = 0.4238537991.
    let w = 0.423_853_799_1_f64;
    let exact = 180.0 - 90.0 - 2.0 * w.atan().to_degrees();
    assert!(
        (phase.hertz - w / std::f64::consts::TAU).abs() < 1e-4 && (phase.size() - exact).abs() < 0.05,
        "{phase:?} {exact}"
    );
    let svg = report.bode().svg;
    assert!(
        svg.contains("gain margin 12.0 dB at 0.159 Hz") && svg.contains("phase margin 44.1° at 0.0675 Hz"),
        "{svg}"
    );
    assert!(svg.contains(">frequency in Hz<") && svg.contains(">magnitude in dB<"), "{svg}");
}

#[test]
fn a_path_that_does_not_exist_is_refused_and_places_can_be_kept() {
    let pendulum = load("../../models/pendulum/model.bond");
    let asked = DrawOptions { paths: DrawnPaths::Numbers(vec![3]), ..DrawOptions::default() };
    let error = pendulum.draw(&asked).expect_err("it has two");
    assert!(error.render(false).contains("from 1 to 2"), "{}", error.render(false));
    let svg = pendulum.draw(&DrawOptions::default()).expect("a drawing").svg;
    let again = pendulum.draw(&DrawOptions { keep: positions(&svg), ..DrawOptions::default() }).expect("a drawing").svg;
    assert_eq!(positions(&svg), positions(&again));
}
