//! Small graphs from one line, as data of the shape of the worked examples.

use serde_json::{Value, json};

const KINDS: [&str; 8] = ["Se", "Sf", "TF", "GY", "0", "1", "R", "C"];

/// The example `0a>R1; Sf>0a`: kinds by the first letters of names, every element with a parameter of its name in
/// small letters, whose value is `value` of its place among the elements.
pub fn sketch(bonds: &str, value: impl Fn(usize) -> f64) -> Value {
    let pairs: Vec<(&str, &str)> = bonds.split(';').map(|bond| bond.trim().split_once('>').expect("a bond")).collect();
    let mut names: Vec<&str> = Vec::new();
    for name in pairs.iter().flat_map(|(from, to)| [*from, *to]) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let elements: Vec<Value> = names.iter().map(|name| element(name)).collect();
    let parameters = names.iter().enumerate().filter(|(_, name)| !is_source(name));
    let parameters: serde_json::Map<String, Value> =
        parameters.map(|(at, name)| (name.to_lowercase(), json!(format!("{:.3}", value(at))))).collect();
    let sources: Vec<String> = names.iter().filter(|name| is_source(name)).map(|name| name.to_lowercase()).collect();
    let bonds: Vec<Value> = pairs.iter().map(|(from, to)| json!({"from": from, "to": to})).collect();
    json!({"name": "sketch", "elements": elements, "bonds": bonds, "parameters": parameters, "sources": sources})
}

fn is_source(name: &str) -> bool {
    kind(name).starts_with('S')
}

fn kind(name: &str) -> &'static str {
    KINDS.into_iter().find(|kind| name.starts_with(kind)).unwrap_or("I")
}

fn element(name: &str) -> Value {
    match kind(name) {
        junction @ ("0" | "1") => json!({"name": name, "type": junction}),
        kind => json!({"name": name, "type": kind, "parameter": name.to_lowercase()}),
    }
}
