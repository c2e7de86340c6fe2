//! Strokes where a junction keeps its variable without a storage, names of states, where constraints act, and what is
//! said about variables that nothing determines.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use halfarrow::{Form, Method, Model, Record, Run};
use halfarrow_compiler::bond_graph::{self, ElementId, Kind, NoFiles};
use halfarrow_compiler::causal_graph::{self, CausalGraph, Stroke, by_hand, kept_junctions};
use halfarrow_compiler::compile::{Text, to_causal_graph};
use halfarrow_compiler::equations::{self, derive_equations};

const FORMS: [Form; 7] =
    [Form::Minimal, Form::Kane, Form::Inverted, Form::Break, Form::Relaxed, Form::Lagrange, Form::Stiff];

fn tests() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests")
}

fn fault(name: &str) -> Model {
    Model::load(&tests().join(format!("faults/{name}.bond")), &[]).unwrap_or_else(|e| panic!("{name}: {e:?}"))
}

fn from_text(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{e:?}\n{text}"))
}

fn causal(text: &str) -> (CausalGraph, Vec<String>) {
    let reached = to_causal_graph(Text { name: "test.bond", text, files: &NoFiles, overrides: &[] });
    let reached = reached.unwrap_or_else(|found| panic!("{}\n{text}", found.render(false)));
    let titles = reached.found.diagnostics.0.iter().map(|d| format!("{d:?}")).collect();
    (reached.ir, titles)
}

/// All that has a value, at the start and after `to` seconds.
fn run(model: &Model, form: Form, to: f64) -> BTreeMap<String, [f64; 2]> {
    let run =
        Run { to, every: Some(to), form, rtol: 1e-10, record: Record::All, method: Method::Auto, ..Run::default() };
    let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}: {e:?}", form.name()));
    let ends = |values: &[f64]| [values[0], *values.last().expect("a value")];
    done.trace.columns.iter().map(|c| (c.name.clone(), ends(&c.values))).collect()
}

fn element(causal: &CausalGraph, name: &str) -> ElementId {
    causal.graph.elements.iter().find(|(_, e)| e.name == name).unwrap_or_else(|| panic!("{name}")).0
}

/// What sources impose is no less forced than what the modeller forces.
#[test]
fn strokes_forced_against_sources_are_refused() {
    let refused = |text: &str| {
        let reached = to_causal_graph(Text { name: "test.bond", text, files: &NoFiles, overrides: &[] });
        reached.err().unwrap_or_else(|| panic!("it is taken:\n{text}")).render(false)
    };
    for (graph, forced) in [
        ("Sf:s(1) -> 1:a -> R:r(2)", "causality r conductive"),
        ("Se:s(1) -> 0:a -> R:r(2)\na -> C:c(1)", "causality c integral"),
        ("Sf:s(1) -> 1:a -> I:i(2)", "causality i integral"),
        ("Se:s(1) -> 1:a -> R:r(1)", "stroke s -> a at s"),
        ("Sf:s(1) -> 1:a -> GY:g(2) -> 1:b -> R:r(1)\nb -> I:i(1)", "causality i integral\ncausality r conductive"),
    ] {
        let said = refused(&format!("model M\n{graph}\n{forced}\n"));
        assert!(said.contains("C003"), "{said}");
    }
    let alone = refused("model M\nSe:s(1) -> 0:a -> R:r(2)\na -> C:c(1)\ncausality c integral\n");
    assert!(alone.contains("a source or constraint asks for the other one") && alone.contains("what this imposes"));
    // Each of them can be met, both leave a junction without a stroke.
    let both = refused(
        "model M\n0:j0 -> 0:j1 -> 1:j2\nj0 -> 1:j3 -> GY:g4(e_out = 1.112) -> j2\nj1 -> 1:j4\nj0 -> I:i1(2.998)\n\
         j0 -> I:i2(1.476)\nSf:s3(3.978) -> j1\nSe:s5(4.057) -> j2\nj3 -> C:c6(0.557)\nj4 -> R:r7(2.854)\n\
         Se:s8(0.287) -> j4\ncausality i1 integral, r7 conductive\n",
    );
    assert!(both.contains("C003") && both.contains("at neither end"), "{both}");
}

#[test]
fn every_port_of_a_field_has_a_state_of_its_own_name() {
    for (name, variable, expected) in [("k3const", "m.f", 0.098_675_3), ("field_coils", "M.x.f", 0.050_829_2)] {
        let model = fault(name);
        for form in FORMS {
            let equations = model.equations(form).unwrap();
            let names: BTreeSet<&String> = equations.states.iter().map(|s| &s.name).collect();
            assert_eq!(names.len(), equations.states.len(), "{name} {form:?}: {:?}", equations.states);
            if form != Form::Stiff {
                let end = run(&model, form, 1.0)[variable][1];
                assert!((end - expected).abs() < 2e-7, "{name} {form:?}: {end}");
            }
        }
    }
}

#[test]
fn conserved_constants_and_springs_take_no_name_that_is_given() {
    let text = "model M\nparam K1 = 2\n1:a -> I:m(1, f0 = 1)\na -> 0:n -> C:c1(k = K1)\nn -> 1:b -> C:c2(k = 3)\nb -> C:c3(k = 1)\n";
    let plain = text.replace("K1", "first");
    let [named, plain] = [text, &plain].map(|text| run(&from_text(text), Form::Minimal, 1.0));
    assert_eq!(named["m.f"], plain["m.f"]);
}

#[test]
fn a_constraint_acts_at_the_junction_that_it_names() {
    for form in [Form::Minimal, Form::Lagrange, Form::Break, Form::Kane] {
        assert!((run(&fault("constraint_at"), form, 1.0)["link.e"][0] - 0.5).abs() < 1e-9);
        let by_hand = "model At\n1:a -> I:m(1, f0 = 1)\na -> 1:b as link\nb -> R:r(1)\nb -> I:n(1)\n";
        let (by_text, by_hand) = (run(&fault("constraint_at"), form, 1.0), run(&from_text(by_hand), form, 1.0));
        for name in ["link.e", "m.f", "n.f", "r.e", "m.e"] {
            assert!((by_text[name][1] - by_hand[name][1]).abs() < 1e-8, "{form:?} {name}");
        }
    }
    let (causal, _) = causal(&std::fs::read_to_string(tests().join("faults/constraint_at_big.bond")).unwrap());
    let graph = &causal.graph;
    let touched: BTreeSet<&str> = graph
        .elements
        .iter()
        .filter(|(_, e)| e.name.starts_with("k0c.tf"))
        .flat_map(|(id, e)| e.ports.iter().map(move |p| graph.far_end(p.bond, id)))
        .map(|e| graph.elements[e].name.as_str())
        .collect();
    assert_eq!(touched, BTreeSet::from(["n12x", "n11x", "k0c.0"]));
    run(&fault("constraint_at_big"), Form::Minimal, 0.1);
}

#[test]
fn a_constraint_between_a_spring_and_its_junction_parts_their_efforts() {
    let text = run(&fault("parted_effort"), Form::Minimal, 1.0);
    let hand = run(&fault("parted_by_hand"), Form::Minimal, 1.0);
    for (ours, theirs) in [("at_junction", "n.e"), ("at_spring", "spring.e"), ("n.e", "n.e"), ("body.f", "body.f")] {
        for end in 0..2 {
            assert!((text[ours][end] - hand[theirs][end]).abs() < 1e-8, "{ours}: {:?} {:?}", text[ours], hand[theirs]);
        }
    }
    assert!((text["at_junction"][0] - text["at_spring"][0]).abs() > 0.1, "{:?}", text["at_junction"]);
}

#[test]
fn the_audit_sees_a_constraint_at_the_wrong_junction() {
    let wrong =
        std::fs::read_to_string(tests().join("faults/constraint_at.bond")).unwrap().replace("b.f - c.f", "a.f - c.f");
    let (causal, _) = causal(&wrong);
    let mut graph = causal.graph.clone();
    let values = run(&from_text(&wrong), Form::Minimal, 1.0);
    let names: Vec<Arc<str>> = values.keys().map(|name| name.as_str().into()).collect();
    let columns: Vec<&[f64]> = values.values().map(|v| &v[..]).collect();
    let parameters = BTreeMap::new();
    let samples =
        halfarrow_audit::Run { times: &[0.0, 1.0], names: &names, columns: &columns, parameters: &parameters };
    let miss =
        |graph: &bond_graph::BondGraph| halfarrow_audit::audit(graph, &samples).residual.map_or(0.0, |f| f.value);
    assert!(miss(&graph) < 1e-12);
    // The same graph, but the constraint names b.
    let flow = |name: &str| graph.bonds[graph.common[&element(&causal, name)]].flow;
    let (b, c) = (flow("b"), flow("c"));
    let (b, c) = (graph.exprs.sym(b), graph.exprs.sym(c));
    graph.constraints[0].expr = graph.exprs.sub(b, c);
    assert!(miss(&graph) > 0.1, "{}", miss(&graph));
}

fn strokes_prefer(preference: &str) -> String {
    std::fs::read_to_string(tests().join("faults/strokes_prefer.bond")).unwrap().replace("prefer Iu", preference)
}

#[test]
fn a_speed_without_inertia_is_drawn_as_a_source_at_its_junction() {
    let (free, _) = causal(&strokes_prefer(""));
    assert_eq!(free.strokes.values().filter(|s| **s == Stroke::Undetermined).count(), 0);
    assert_eq!(kept_junctions(&free), BTreeSet::from([element(&free, "w")]));
    let (preferred, _) = causal(&strokes_prefer("prefer Iu"));
    assert!(kept_junctions(&preferred).is_empty());
    for causal in [&free, &preferred] {
        let weight = &causal.graph.elements[element(causal, "weight")].ports[0];
        assert_eq!(causal.strokes[weight.bond], Stroke::To, "an effort source hands its effort away");
    }
    // A person gives the strokes of storages first.
    assert_eq!(by_hand(&free).values().collect::<Vec<_>>(), preferred.strokes.values().collect::<Vec<_>>());
}

#[test]
fn loops_of_a_model_with_a_kept_speed_are_those_of_strokes_by_hand() {
    let free = from_text(&strokes_prefer("")).loops().unwrap();
    let preferred = from_text(&strokes_prefer("prefer Iu")).loops().unwrap();
    assert_eq!((free.kept, preferred.kept), (vec!["w.f".to_string()], Vec::new()));
    assert_eq!(free.paths.len(), 1);
    assert_eq!((free.paths[0].class, &free.paths[0].elements), (1, &preferred.paths[0].elements));
    assert_eq!(free.paths[0].gain, preferred.paths[0].gain);
    let double =
        Model::load(&tests().join("../../../models/double_pendulum/model.bond"), &[]).unwrap().loops().unwrap();
    let between: BTreeSet<BTreeSet<&str>> =
        double.paths.iter().map(|p| p.elements.iter().map(String::as_str).collect()).collect();
    let expected = [["Iu1", "Iv1"], ["Iu2", "Iv2"], ["Iu1", "Iv2"]].map(BTreeSet::from);
    assert!(expected.iter().all(|pair| between.contains(pair)), "{between:?}");
}

/// The models of the repository, by name.
fn models() -> Vec<(String, String)> {
    let folder = tests().join("../../../models");
    let mut folders: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.sort();
    let text =
        |f: &PathBuf| Some((f.file_name()?.to_str()?.to_string(), std::fs::read_to_string(f.join("model.bond")).ok()?));
    folders.iter().filter_map(text).collect()
}

#[test]
fn every_model_has_strokes_names_and_counts_in_order() {
    for (name, text) in models() {
        let (causal, _) = causal(&text);
        bond_graph::verify(&causal.graph).unwrap_or_else(|why| panic!("{name}: {why}"));
        causal_graph::verify(&causal).unwrap_or_else(|why| panic!("{name}: {why}"));
        let mut counts = BTreeMap::new();
        for form in FORMS {
            let Ok(equations) = derive_equations(&causal, form) else { continue };
            equations::verify(&equations).unwrap_or_else(|why| panic!("{name} {form:?}: {why}"));
            counts.insert(form.name(), (equations.counts.differential, equations.counts.algebraic));
        }
        if kept_junctions(&causal).is_empty() {
            continue;
        }
        // What a person counts: all storages; a multiplier for each that is dependent, and each kept variable.
        let told = from_text(&text).loops().unwrap().counts;
        assert_eq!(counts["break"], (told.break_form.differential, told.break_form.algebraic), "{name}");
        assert_eq!(counts["inverted"], (told.inverted.differential, told.inverted.algebraic), "{name}");
    }
}

#[test]
fn what_is_not_determined_is_said_without_a_ring_where_there_is_none() {
    let said = |text: &str| causal(text).1.into_iter().find(|d| d.contains("C006"));
    let lonely = said("model T\n0:a -> 1:b\na -> 1:c\nSf:s(1) -> a\na -> R:r(1)\n").expect("b and c share a flow");
    assert!(!lonely.contains("circulate") && !lonely.contains("ring"), "{lonely}");
    assert!(lonely.contains("b, c have a single bond"), "{lonely}");
    let ring = said("model T\nSe:s(1) -> 1:m -> I:i(1)\nm -> 0:a -> 0:b -> C:c(1)\na -> b\n").expect("a ring");
    assert!(ring.contains("circulate"), "{ring}");
    // Every value is defined, but for how the constraint shares with the junction that ends there.
    assert_eq!(said("model T\n1:a -> 0:b\na -> 0:c\nZC:z -> c\nb -> R:r(1)\nc -> 1:d -> I:i(1)\n"), None);
    assert_eq!(
        said("model T\nSe:s(1) -> 1:w -> TF:t(2) -> 0:n -> C:c(1)\nn -> R:r(1)\n0:m -> De:d\nn -> 1:x -> m\n"),
        None
    );
}

#[test]
fn kinds_of_junctions_have_bonds_of_their_own() {
    let (causal, _) =
        causal("model T\nSe:s(1) -> 1:a -> 1:b -> 1:c -> I:i(1)\nb -> 0:n -> 0:m -> C:k(1)\nn -> R:r(1)\n");
    let graph = &causal.graph;
    let own: BTreeSet<_> =
        graph.common.iter().map(|(e, b)| (b, matches!(graph.elements[*e].kind, Kind::Zero))).collect();
    assert_eq!(own.len(), graph.common.len());
}
