//! What is printed of models that are larger than a textbook's, and by what names.

use halfarrow::{Form, Model};
use std::collections::BTreeSet;
use std::path::Path;

fn model(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/faults/{name}.bond"));
    Model::load(&path, &[]).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

/// An output stands for a state only in the unit in which the state is printed.
#[test]
fn outputs_name_states_in_their_own_unit_only() {
    let report = model("output_units").equations(Form::Minimal).expect("equations");
    let text = report.text.join("\n");
    for name in ["θ", "speed", "φ"] {
        assert!(!text.contains(name), "{name} stands for something else:\n{text}");
    }
    for name in ["cos th", "f_rotor'", "f_rollI'", "ω'"] {
        assert!(text.contains(name), "{name} is missing:\n{text}");
    }
}

/// Long equations have names for their parts, all of them defined, none of them a name of the model.
#[test]
fn long_equations_have_names_for_their_parts() {
    for (name, most) in [
        ("squeezer", 20_000),
        ("two_four_bars", 8_000),
        ("beam_relative", 40_000),
        ("beam_absolute", 40_000),
        ("wishbone", 4_000),
    ] {
        let report = model(name).equations(Form::Minimal).expect("equations");
        let length: usize = report.text.iter().chain(&report.legend).map(|line| line.chars().count()).sum();
        assert!(length <= most, "{name}: {length} characters");
        assert!(!report.definitions.is_empty(), "{name}");
        let line = report.text.iter().chain(&report.legend).map(|line| line.chars().count()).max();
        assert!(line <= Some(most / 2), "{name}: a line of {line:?} characters");
        let own = |line: &String| line.split(" = ").next().expect("a left side").to_string();
        let defined: Vec<String> = report.definitions.iter().map(own).collect();
        let once: BTreeSet<&String> = defined.iter().collect();
        assert_eq!(once.len(), defined.len(), "{name}: a name is defined twice: {defined:?}");
        let all = report.equations.iter().chain(&report.definitions);
        let read: BTreeSet<&str> = all.flat_map(|line| names(line)).collect();
        for name_of_its_own in read.iter().filter(|n| numbered(n, &defined)) {
            assert!(once.contains(&name_of_its_own.to_string()), "{name}: {name_of_its_own} is not defined");
        }
        let again = model(name).equations(Form::Minimal).expect("equations");
        assert!(again == report, "{name}: not the same twice");
    }
}

/// The names in a line.
fn names(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| !(c.is_alphanumeric() || "_.'".contains(c)))
        .filter(|w| w.starts_with(|c: char| c.is_alphabetic()))
}

/// Whether it is one of the names that were made up: a letter, which the first of them has too, and a number.
fn numbered(name: &str, defined: &[String]) -> bool {
    let letters = |text: &str| text.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let made_up = defined.iter().find(|d| !d.contains('.') && letters(d) < d.len());
    made_up.is_some_and(|first| letters(name) < name.len() && name[..letters(name)] == first[..letters(first)])
}
