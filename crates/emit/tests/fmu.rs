//! What stands in an FMU: the rules that importers trip over, checked on every model.

use crate::common;

use common::{Exported, export_program, models, own, read_program};
use halfarrow_emit::Method;
use halfarrow_emit::c::Export;
use halfarrow_emit::fmu::{self, Version};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// An element: its name and attributes.
type Element = (String, BTreeMap<String, String>);

/// The elements of a document in order; enough of XML for what is written.
fn elements(xml: &str) -> Vec<Element> {
    let mut found = Vec::new();
    for tag in xml.split('<').skip(1).filter(|t| !t.starts_with(['?', '/', '!'])) {
        let end = tag.rfind('>').expect("a tag ends");
        let tag = tag[..end].trim_end_matches('/');
        let (name, mut rest) = tag.split_once(' ').unwrap_or((tag, ""));
        let mut attributes = BTreeMap::new();
        while let Some((key, after)) = rest.trim_start().split_once("=\"") {
            let (value, after) = after.split_once('"').expect("an attribute ends");
            let again = attributes.insert(key.to_string(), value.to_string());
            assert!(again.is_none(), "{key} stands twice in {tag}");
            rest = after;
        }
        assert!(rest.trim().is_empty(), "{tag}");
        found.push((name.to_string(), attributes));
    }
    found
}

fn written(one: &Exported, version: Version) -> fmu::Written {
    let recorded = one.model.recorded().to_vec();
    let export = Export {
        program: one.model.program(),
        start: &one.at_start,
        method: one.method,
        step: one.step,
        recorded: &recorded,
        derivatives: true,
        project: false,
        real: halfarrow_emit::Real::Double,
        modes: &[],
        independent: &[],
    };
    fmu::write(&export, version).expect("an explicit program")
}

fn description(written: &fmu::Written) -> String {
    String::from_utf8(written.files[0].bytes.clone()).expect("UTF-8")
}

fn list(text: &str) -> Vec<usize> {
    text.split_whitespace().map(|n| n.parse().expect("a number")).collect()
}

#[test]
fn descriptions_keep_the_rules() {
    for path in models() {
        let one = export_program(read_program(&path), Method::Rk4, 1e-3, true);
        for version in [Version::V2, Version::V3] {
            let written = written(&one, version);
            let xml = description(&written);
            check_rules(&elements(&xml), version)
                .unwrap_or_else(|fault| panic!("{} {version:?}: {fault}\n{xml}", path.display()));
            assert!(written.files.iter().all(|f| !f.path.contains('\\') && !f.path.ends_with("Functions.h")));
        }
    }
}

fn check_rules(all: &[Element], version: Version) -> Result<(), String> {
    let is_variable = |name: &str| matches!(name, "ScalarVariable" | "Float64");
    let variables: Vec<&BTreeMap<String, String>> =
        all.iter().filter(|(n, _)| is_variable(n)).map(|(_, a)| a).collect();
    let ensure = |holds: bool, what: &str| if holds { Ok(()) } else { Err(what.to_string()) };
    let names: BTreeSet<&String> = variables.iter().map(|v| &v["name"]).collect();
    ensure(names.len() == variables.len(), "names are not unique")?;
    let references: BTreeSet<&String> = variables.iter().map(|v| &v["valueReference"]).collect();
    ensure(references.len() == variables.len(), "value references are not unique")?;
    let of = |causality: &str| variables.iter().filter(|v| v["causality"] == causality).count();
    ensure(of("independent") == 1, "not one independent variable")?;
    // In FMI 2 the attributes of the type stand in an element of its own right behind.
    let reals: Vec<&BTreeMap<String, String>> = match version {
        Version::V2 => all.iter().filter(|(n, _)| n == "Real").map(|(_, a)| a).collect(),
        Version::V3 => variables.clone(),
    };
    let units: BTreeSet<&String> = all.iter().filter(|(n, _)| n == "Unit").map(|(_, a)| &a["name"]).collect();
    let displays: BTreeSet<&String> = all.iter().filter(|(n, _)| n == "DisplayUnit").map(|(_, a)| &a["name"]).collect();
    for (variable, real) in variables.iter().zip(&reals) {
        let exact = variable.get("initial").is_some_and(|i| i == "exact") || variable["causality"] == "input";
        ensure(exact == real.contains_key("start"), &format!("start of {}", variable["name"]))?;
        ensure(real.get("unit").is_none_or(|u| units.contains(u)), "a unit is not defined")?;
        ensure(real.get("displayUnit").is_none_or(|u| displays.contains(u)), "a display unit is not defined")?;
    }
    // Unknowns by the name of their variable.
    let place = |text: &str| -> usize {
        let n: usize = text.parse().expect("a number");
        match version {
            Version::V2 => n - 1,
            Version::V3 => variables.iter().position(|v| v["valueReference"] == n.to_string()).expect("a variable"),
        }
    };
    let (mut section, mut unknowns) = (String::new(), BTreeMap::<String, BTreeSet<usize>>::new());
    for (name, attributes) in all {
        let kind = match name.as_str() {
            "Outputs" | "Derivatives" | "InitialUnknowns" => {
                section = name.trim_end_matches('s').to_string();
                continue;
            }
            "Unknown" => section.clone(),
            "ContinuousStateDerivative" => "Derivative".to_string(),
            "Output" | "InitialUnknown" | "EventIndicator" => name.clone(),
            _ => continue,
        };
        let at = attributes.get("index").or(attributes.get("valueReference")).ok_or("an unknown without place")?;
        ensure(unknowns.entry(kind.clone()).or_default().insert(place(at)), "an unknown stands twice")?;
        for known in list(&attributes["dependencies"]) {
            let known = variables[place(&known.to_string())];
            let legal = match kind.as_str() {
                "InitialUnknown" => {
                    known["causality"] == "input"
                        || known.get("initial").is_some_and(|i| i == "exact")
                        || known["causality"] == "independent"
                }
                _ => matches!(known["causality"].as_str(), "input" | "independent" | "local"),
            };
            ensure(legal, &format!("{kind} depends on {}", known["name"]))?;
        }
    }
    let having =
        |wanted: &dyn Fn(usize) -> bool| (0..variables.len()).filter(|&i| wanted(i)).collect::<BTreeSet<usize>>();
    let is_derivative = |i: usize| reals[i].contains_key("derivative");
    let is_state = |i: usize| {
        let at = |d: &String| if version == Version::V2 { d.parse::<usize>().expect("a number") - 1 } else { place(d) };
        reals.iter().filter_map(|r| r.get("derivative")).any(|d| at(d) == i)
    };
    let causality = |i: usize, wanted: &str| variables[i]["causality"] == wanted;
    let get = |kind: &str| unknowns.get(kind).cloned().unwrap_or_default();
    ensure(get("Output") == having(&|i| causality(i, "output")), "outputs")?;
    ensure(get("Derivative") == having(&is_derivative), "derivatives")?;
    let initial =
        having(&|i| causality(i, "output") || causality(i, "calculatedParameter") || is_derivative(i) || is_state(i));
    ensure(get("InitialUnknown") == initial, "initial unknowns")
}

/// What follows from what, by hand.
#[test]
fn dependencies_are_exact() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy/tuned.bond");
    let one = export_program(read_program(&path), Method::Rk4, 1e-3, true);
    let all = elements(&description(&written(&one, Version::V3)));
    let names: BTreeMap<String, String> = all
        .iter()
        .filter(|(n, _)| n == "Float64")
        .map(|(_, a)| (a["valueReference"].clone(), a["name"].clone()))
        .collect();
    let of = |element: &str, name: &str| -> String {
        let is = |a: &BTreeMap<String, String>| names[&a["valueReference"]] == name;
        let found = all.iter().find(|(n, a)| n == element && is(a)).unwrap_or_else(|| panic!("no {element} {name}"));
        list(&found.1["dependencies"]).iter().map(|r| names[&r.to_string()].as_str()).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(of("InitialUnknown", "spring.q"), "stretch");
    assert_eq!(of("InitialUnknown", "k2"), "k ratio");
    assert_eq!(of("InitialUnknown", "mass.f"), "");
    assert_eq!(of("InitialUnknown", "energy"), "k stretch");
    assert_eq!(of("Output", "energy"), "spring.q");
    assert_eq!(of("Output", "stiffness"), "");
    let rate = of("ContinuousStateDerivative", "der(mass.f)");
    assert!(rate.contains("pull") && rate.contains("spring.q"), "{rate}");
    let kind =
        |name: &str| all.iter().find(|(_, a)| a.get("name").is_some_and(|n| n == name)).expect("it is there").1.clone();
    assert_eq!(kind("k2")["causality"], "calculatedParameter");
    assert_eq!((kind("k")["variability"].as_str(), kind("k")["start"].as_str()), ("tunable", "50.0"));
}

/// Parameters that delays and samples read are fixed once the run has begun.
#[test]
fn structural_parameters_are_fixed() {
    for (name, parameter) in
        [("delay", "dead"), ("sampled", "period"), ("when_sampled", "period"), ("when_sampled", "dead")]
    {
        let one = export_program(read_program(&own(name)), Method::Rk4, 1e-3, true);
        let all = elements(&description(&written(&one, Version::V2)));
        let found = all.iter().find(|(_, a)| a.get("name").is_some_and(|n| n == parameter)).expect("it is there");
        assert_eq!(found.1["variability"], "fixed");
    }
}

/// Discrete variables change at events only; what happens at the start makes states depend on what it reads.
#[test]
fn discrete_variables_are_told_as_such() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmpy/controlled.bond");
    let one = export_program(read_program(&path), Method::Rk4, 1e-3, true);
    for version in [Version::V2, Version::V3] {
        let all = elements(&description(&written(&one, version)));
        let of =
            |name: &str| &all.iter().find(|(_, a)| a.get("name").is_some_and(|n| n == name)).expect("it is there").1;
        assert_eq!((of("u")["causality"].as_str(), of("u")["variability"].as_str()), ("output", "discrete"));
        assert_eq!((of("x")["variability"].as_str(), of("kp")["variability"].as_str()), ("continuous", "tunable"));
        let known = &of("kp")["valueReference"];
        let starts =
            all.iter().find(|(n, a)| n == "InitialUnknown" && a["valueReference"] == of("u")["valueReference"]);
        let follows = |a: &BTreeMap<String, String>| a["dependencies"].split(' ').any(|d| d == known);
        assert!(starts.is_none_or(|(_, a)| follows(a)), "{starts:?}");
        assert!(version == Version::V2 || starts.is_some());
    }
}

#[test]
fn archives_hold_what_was_written() {
    let one = export_program(read_program(&own("contact")), Method::Rk4, 1e-3, true);
    let written = written(&one, Version::V3);
    let bytes = fmu::package(&written, None);
    assert_eq!(bytes, fmu::package(&written, None), "the same model gives the same bytes");
    assert!(bytes.starts_with(b"PK\x03\x04"));
    let binary = fmu::binary_path(Version::V3, "contact", "linux", "x86_64");
    assert_eq!(binary.as_deref(), Some("binaries/x86_64-linux/contact.so"));
    let binary = fmu::binary_path(Version::V2, "contact", "windows", "x86_64");
    assert_eq!(binary.as_deref(), Some("binaries/win64/contact.dll"));
    assert_eq!(fmu::binary_path(Version::V2, "contact", "plan9", "x86_64"), None);
}

/// The wrappers compile with every warning an error, with a model of every kind.
#[test]
fn wrappers_compile_without_warnings() {
    for version in [Version::V2, Version::V3] {
        let folder = common::folder(&format!("wrappers_{version:?}"));
        let mut sources = Vec::new();
        for name in ["contact", "bridge", "when_beam", "when_sampled", "when_springs"] {
            let one = export_program(read_program(&own(name)), Method::Rk4, 1e-3, true);
            let written = written(&one, version);
            let prefix = |text: &str| {
                text.replace("fmi2.c", &format!("{name}_fmi2.c")).replace("fmi3.c", &format!("{name}_fmi3.c"))
            };
            for file in written.files.iter().filter(|f| f.path.starts_with("sources/")).chain(&fmu::headers(version)) {
                let path = prefix(file.path.trim_start_matches("sources/"));
                std::fs::write(folder.join(&path), &file.bytes).expect("a file");
                sources.extend(path.ends_with(".c").then_some(path));
            }
        }
        common::cc("cc", &folder, |c| c.args(common::FLAGS).args(["-O1", "-c", "-I."]).args(&sources));
    }
}

/// Of states at rest the importer is told how great they become.
#[test]
fn states_at_rest_have_the_magnitude_to_which_they_grow() {
    let rectifier = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/rectifier/model.bond");
    let mut one = export_program(read_program(&rectifier), Method::Rk4, 1e-3, true);
    let nominal = |one: &Exported| description(&written(one, Version::V2)).contains("nominal=\"1.25e-5\"");
    assert!(!nominal(&one));
    one.at_start.grown = vec![1.25e-5];
    assert!(nominal(&one));
}

/// Parameters that are set one after the other may fit only together; where they do not, the end of the initialization, the
/// next step or the event at which they are tuned is refused with the reason.
#[test]
fn parameters_for_which_the_equations_are_others_are_refused() {
    let program = read_program(&common::difference());
    let states = program.states.len();
    let written = written(&export_program(program, Method::Rk4, 1e-3, true), Version::V2);
    let folder = common::folder("structure_fmu");
    for file in written.files.iter().filter(|f| f.path.starts_with("sources/")).chain(&fmu::headers(Version::V2)) {
        std::fs::write(folder.join(file.path.trim_start_matches("sources/")), &file.bytes).expect("a file");
    }
    let all = elements(&description(&written));
    let of = |name: &str, key: &str| {
        let found = all
            .iter()
            .find(|(_, a)| a.get("name").is_some_and(|n| n == name) || a.contains_key(key) && name.is_empty());
        found.and_then(|(_, a)| a.get(key).cloned()).unwrap_or_else(|| panic!("{name} {key}"))
    };
    let defined = [
        format!("-DGUID=\"{}\"", of("", "guid")),
        format!("-DA={}", of("a", "valueReference")),
        format!("-DB={}", of("b", "valueReference")),
        format!("-DR={}", of("r", "valueReference")),
        format!("-DSTATES={states}"),
    ];
    std::fs::write(folder.join("structure.c"), include_str!("common/structure.c")).expect("a file");
    common::cc("cc", &folder, |c| {
        c.args(common::FLAGS).args(["-O1", "-I."]).args(&defined).arg("structure.c").args(&written.sources).args([
            "-o",
            "structure",
            "-lm",
        ])
    });
    let out = std::process::Command::new(folder.join("structure")).output().expect("it runs");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stdout));
}

/// Points that an integrator tries: one beyond a fold is discarded and leaves the instance as it was; one that is only far
/// from the last completed step has its value.
#[test]
fn trial_points_are_discarded_only_without_a_value() {
    let rectifier = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/rectifier/model.bond");
    for (path, far) in [(own("draining"), 0), (rectifier, 1)] {
        let written = written(&export_program(read_program(&path), Method::Rk4, 1e-3, true), Version::V2);
        let folder = common::folder(&format!("trials_{far}"));
        for file in written.files.iter().filter(|f| f.path.starts_with("sources/")).chain(&fmu::headers(Version::V2)) {
            std::fs::write(folder.join(file.path.trim_start_matches("sources/")), &file.bytes).expect("a file");
        }
        let token =
            description(&written).split("guid=\"").nth(1).and_then(|rest| rest.split('"').next()).map(str::to_string);
        let guid = format!("-DGUID=\"{}\"", token.expect("a token"));
        std::fs::write(folder.join("trials.c"), include_str!("common/trials.c")).expect("a file");
        let far = format!("-DFAR={far}");
        common::cc("cc", &folder, |c| {
            c.args(common::FLAGS)
                .args(["-O1", "-I.", &guid, &far])
                .arg("trials.c")
                .args(&written.sources)
                .args(["-o", "trials", "-lm"])
        });
        let out = std::process::Command::new(folder.join("trials")).output().expect("it runs");
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stdout));
    }
}
