//! Pictures that move: the scene of a run, golden, and the page that shows it.
//!
//! `UPDATE=1 cargo test --test all animation` rewrites the scenes.

use std::collections::BTreeMap;
use std::path::Path;

use halfarrow::{BodyForm, FixedMethod, Method, Model, Problem, Record, Run, Scene, Source};

fn model(text: &str) -> Model {
    Model::from_text("machine.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// The scene of a run with samples so far apart.
fn filmed(model: &Model, to: f64, every: f64) -> Scene {
    filmed_with(model, to, every, &[])
}

/// The same, with variables recorded beside.
fn filmed_with(model: &Model, to: f64, every: f64, beside: &[&str]) -> Scene {
    let names = model.pictured().expect("shapes").into_iter().chain(beside.iter().map(|n| (*n).to_string()));
    let (method, record) = (Method::Fixed(FixedMethod::Rk4), Record::Names(names.collect()));
    let run = Run { to, every: Some(every), method, step: Some(1e-3), record, ..Run::default() };
    let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    model.scene(&done.trace).expect("a scene")
}

#[track_caller]
fn golden(name: &str, scene: &Scene) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/animation").join(name);
    let text = scene.to_string();
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(&path, &text).expect("it is written");
    }
    let known = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(known == text, "{} differs:\n{text}", path.display());
}

const PENDULUM: &str = "model Pendulum
import std.multibody
World:world -> Revolute:pin(n = [0, 1, 0], q0 = 0.5 rad) -> FixedTranslation:rod(d = [0, 0, -0.5]) -> Body:bob(m = 2 kg, J = diag([0.1, 0.1, 0.01]))
output angle = pin.angle
";

#[test]
fn a_pendulum() {
    golden("pendulum.txt", &filmed_with(&model(PENDULUM), 0.5, 0.25, &["pin.q", "angle"]));
}

#[test]
fn a_corner_of_the_sedan() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/sedan");
    let files: BTreeMap<String, String> = ["corner.bond", "sedan_tyre.tir"]
        .map(|name| (name.to_string(), std::fs::read_to_string(folder.join(name)).expect("a file")))
        .into();
    let text = "model Rig \"A corner that hangs from a rig, with its wheel spinning\"
import std.multibody
import \"corner.bond\"
World:world -> FixedTranslation:rig(d = [0, 0, 1]) -> 1[frame]:body
Corner:fl(w0 = 10)
body -> fl.body
body -> fl.rack
";
    let model = Model::new(Source::text("rig.bond", text).with_files(files), &[]);
    let model = model.unwrap_or_else(|e| panic!("{}", e.render(false)));
    golden("corner.txt", &filmed(&model, 0.1, 0.05));
}

#[test]
fn places_and_turns_are_those_of_the_run() {
    let scene = filmed_with(&model(PENDULUM), 1.0, 0.1, &["angle"]);
    let link = &scene.links[0];
    assert_eq!((link.name.as_str(), scene.points[link.from].len()), ("rod.link", 1));
    let body = scene.bodies.iter().find(|b| b.name == "bob.solid").expect("the bob");
    let angle = &scene.curves.iter().find(|c| c.name == "angle").expect("a curve").values;
    for (i, &q) in angle.iter().enumerate() {
        let (sine, cosine) = (libm::sinf(q), libm::cosf(q));
        let place = scene.points[link.to][i];
        let turn = scene.turns[body.turn][i];
        let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(near(&place, &[-0.5 * sine, 0.0, -0.5 * cosine]), "{place:?} at {q}");
        assert!(near(&turn, &[libm::cosf(q / 2.0), 0.0, libm::sinf(q / 2.0), 0.0]), "{turn:?} at {q}");
    }
    // m = 2, J = 0.1, 0.1, 0.01: sides of the box by 12 J/m = y^2 + z^2.
    let BodyForm::Box { size: [x, y, z], .. } = body.form else { panic!("{body:?}") };
    for (found, moment) in [(y * y + z * z, 0.1), (z * z + x * x, 0.1), (x * x + y * y, 0.01)] {
        assert!((found - 6.0 * moment).abs() < 1e-6);
    }
}

#[test]
fn in_a_plane() {
    let text = "model Slider
import std.planar
PlanarWorld:world -> PlanarPrismatic:guide(v0 = 2 m/s) -> PlanarRevolute:pin(w0 = 3 rad/s) -> PlanarBody:disc(m = 2 kg, J = 0.09 kg.m2)
";
    let scene = filmed(&model(text), 0.5, 0.1);
    assert!(scene.flat && scene.up == [0.0, 1.0, 0.0]);
    let disc = scene.bodies.iter().find(|b| b.name == "disc.solid").expect("the disc");
    assert_eq!(scene.points[disc.place][5], [1.0, 0.0, 0.0]);
    let [w, _, _, z] = scene.turns[disc.turn][5];
    assert!((2.0 * libm::atan2f(z, w) - 1.5).abs() < 1e-6);
    assert!(matches!(disc.form, BodyForm::Cylinder { radius: 0.3, .. }), "{disc:?}");
}

#[test]
fn what_spins_turns_by_the_integral_of_its_speed() {
    let text = "model Spin
Sf:drive(3*t) -> 1:w -> I:rotor(1)
shape cylinder:rotor(r = [0, 0, 0], R = 0, radius = 0.1 m, spin = w.f)
";
    let scene = filmed(&model(text), 2.0, 0.1);
    let angle = &scene.angles[scene.bodies[0].spin.expect("it spins")];
    assert!((angle[20][0] - 6.0).abs() < 1e-5, "{angle:?}");
}

#[test]
fn a_shape_with_the_name_of_an_instance_stands_for_it() {
    let own = "shape sphere:bob(r = rod.b.r, radius = 3 cm, color = [1, 0, 0])\n";
    let scene = filmed(&model(&format!("{PENDULUM}{own}")), 0.1, 0.1);
    let names: Vec<&str> = scene.bodies.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["world.ground", "pin.pin", "bob"]);
    assert!(matches!(scene.bodies[2].form, BodyForm::Sphere { radius: 0.03 }));
    assert_eq!(scene.bodies[2].color, Some([1.0, 0.0, 0.0]));
}

#[test]
fn surfaces_come_from_files() {
    let stl = "solid tip\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 30 0 0\nvertex 0 40 0\nendloop\nendfacet\nendsolid\n";
    let text = "model Tip\nstate x' = 1\nshape mesh:tip(\"parts/tip.stl\", r = [x, 0, 0], R = 0, scale = 1e-3)\n1:v -> I:m(1)\n";
    let with = |files: &[(&str, &str)]| {
        let files: BTreeMap<String, String> = files.iter().map(|(n, t)| ((*n).to_string(), (*t).to_string())).collect();
        Model::new(Source::text("models/tip.bond", text).with_files(files), &[]).expect("a model")
    };
    let scene = filmed(&with(&[("models/parts/tip.stl", stl)]), 1.0, 0.5);
    assert_eq!(scene.meshes[0].corners, [0.0, 0.0, 0.0, 0.03, 0.0, 0.0, 0.0, 0.04, 0.0]);
    assert_eq!(scene.points[scene.bodies[0].place], [[0.0; 3], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]]);
    for (files, why) in [(&[][..], "no such file"), (&[("models/parts/tip.stl", "solid\n")], "no triangle")] {
        let said = with(files).pictured().expect_err("no surface").to_string();
        assert!(said.contains("models/parts/tip.stl") && said.contains(why), "{said}");
    }
}

#[test]
fn a_model_without_shapes_is_refused() {
    let bare = model("model Bare\nSe:push(1) -> I:mass(1)\n");
    assert_eq!(bare.pictured(), Err(Problem::NoShapes));
    let world = model("model World\nimport std.multibody\nWorld:world -> 1[frame]:base\nSe:push(1) -> I:mass(1)\n");
    assert_eq!(world.pictured(), Err(Problem::NoShapes));
    let said = Problem::NoShapes.to_string();
    assert!(said.contains("std.multibody") && said.contains("shape box"), "{said}");
}

#[test]
fn the_page_holds_the_scene_and_points_nowhere() {
    let scene = filmed(&model(&PENDULUM.replace("model Pendulum", "model Pendulum \"</script>\"")), 0.5, 0.1);
    let page = scene.page().expect("a page");
    let begin = "<script id=\"scene\" type=\"application/json\">";
    let data = page.split(begin).nth(1).and_then(|rest| rest.split("</script>").next()).expect("the data");
    let data: serde_json::Value = serde_json::from_str(data).expect("JSON");
    assert_eq!(data["times"].as_array().map(Vec::len), Some(6));
    assert_eq!(data["bodies"].as_array().map(Vec::len), Some(scene.bodies.len()));
    assert_eq!(data["points"][0][0].as_array().map(Vec::len), Some(3));
    assert!(page.contains("SPDX-License-Identifier: MIT"));
    assert_eq!(page.matches("<script").count(), page.matches("</script>").count());
    // Of three.js a name space is named, which nobody fetches; of uPlot its home, in a comment.
    let (before, rest) = page.split_once("<script id=\"three\"").expect("three.js");
    let (three, after) = rest.split_once("</script>").expect("its end");
    assert_eq!(three.matches("://").count(), three.matches("http://www.w3.org/1999/xhtml").count());
    let own = format!("{before}{}", after.replace("/*! https://github.com/leeoniya/uPlot", ""));
    for word in ["http", "src=", "href=", "url(", "@import", "<link", "<iframe", "fetch("] {
        let found = own.match_indices(word).next().map(|(at, _)| &own[at.saturating_sub(60)..(at + 60).min(own.len())]);
        assert!(found.is_none(), "{word}: {found:?}");
    }
}
