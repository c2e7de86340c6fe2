//! The page: everything in it, nothing outside it.

use std::path::Path;

use halfarrow::{Form, Model, Report};

fn load(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name).join("model.bond");
    Model::load(&path, &[]).expect("a model")
}

fn page(name: &str, compare: bool) -> String {
    let report = Report { to: Some(0.5), compare, error: 1e-3, ..Report::default() };
    load(name).report(&report, &mut |_, _| true).unwrap_or_else(|e| panic!("{}", e.render(false))).html
}

#[test]
fn nothing_in_it_points_outside() {
    let page = page("class2", true);
    for word in ["http", "src=", "url(", "@import", "<link", "<iframe", "//"] {
        let found =
            page.match_indices(word).next().map(|(at, _)| &page[at.saturating_sub(60)..(at + 60).min(page.len())]);
        assert!(found.is_none(), "{word}: {found:?}");
    }
    for id in ["graph", "causality", "paths", "equations", "comparison", "run", "audit"] {
        assert!(page.contains(&format!("<section id=\"{id}\">")), "{id}");
    }
}

#[test]
fn every_formula_is_sound_and_every_path_and_form_is_there() {
    for name in ["pendulum", "class4", "electrostatic", "rc_bridge_diode", "unity_gain", "source_jumps", "dc_motor_pid"]
    {
        let (page, model) = (page(name, false), load(name));
        for formula in page.split("<math").skip(1) {
            let formula = format!("<math{}</math>", formula.split("</math>").next().expect("it ends"));
            roxmltree::Document::parse(&formula).unwrap_or_else(|e| panic!("{name}: {e}: {formula}"));
            assert!(!formula.contains("NaN"), "{name}: {formula}");
        }
        let loops = model.loops().expect("loops");
        let routes = loops.paths.iter().filter(|p| page.contains(&p.route.join(" → "))).count();
        assert_eq!(routes, loops.paths.len(), "{name}");
        let applies = Form::ALL.into_iter().filter(|f| model.equations(*f).is_ok()).count();
        let headings = page.matches("<h3>").count() + page.matches("<h3 class=\"same\">").count();
        let others = ["Dependent storages", "Conserved quantities"].map(|h| page.matches(&format!("<h3>{h}")).count());
        assert_eq!(headings - others[0] - others[1], Form::ALL.len(), "{name}: every form once");
        assert!(page.matches("differential, ").count() <= applies, "{name}");
    }
}

#[test]
fn the_same_model_gives_the_same_page() {
    assert_eq!(page("pendulum", false), page("pendulum", false));
}
