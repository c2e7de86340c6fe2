//! The worked examples of the paper as bond graphs with strokes, built without the language.

use halfarrow_compiler::algebra::{Expr, Exprs, Facts, Symbol};
use halfarrow_compiler::bond_graph::{
    Bond, BondGraph, BondId, Element, ElementId, Input, InputId, IntegratedSignal, Kind, Meaning, Parameter,
    ParameterId, ParameterKind, Port, PortRef, ResistorLaw, SignalId, Storage, StorageLaw, Variable,
};
use halfarrow_compiler::causal_graph::{CausalGraph, Ports, Stroke};
use halfarrow_compiler::ids::{Id, Map, Table};
use halfarrow_compiler::span::Span;
use serde_json::Value;

use super::formula::formula;

/// The examples, as data.
pub fn examples() -> Vec<Value> {
    let text = include_str!("../data/paper_examples.json");
    serde_json::from_str::<Vec<Value>>(text).expect("the data is valid")
}

/// The example of that name.
pub fn example(name: &str) -> Value {
    examples().into_iter().find(|e| e["name"] == name).expect("known example")
}

/// The strokes that the example has in integral causality (Fig. 2.2 for the pendulum).
pub fn strokes(example: &Value) -> &str {
    if example["strokes_integral"].is_array() { "strokes_integral" } else { "strokes_fig22" }
}

/// The graph of an example with the strokes of that key.
pub fn causal_graph(example: &Value, strokes: &str) -> CausalGraph {
    let graph = bond_graph(example);
    let strokes = list(&example[strokes]).map(|s| if s == "to" { Stroke::To } else { Stroke::From }).collect();
    CausalGraph { graph, strokes, ports: Ports::default() }
}

/// The graph of an example.
pub fn bond_graph(example: &Value) -> BondGraph {
    let mut graph = empty(example["name"].as_str().expect("a name"));
    let mut builder = Builder { graph: &mut graph, example };
    builder.parameters();
    builder.bonds();
    builder.signals();
    builder.elements();
    graph
}

fn list(value: &Value) -> impl Iterator<Item = &str> {
    value.as_array().expect("a list").iter().map(|entry| entry.as_str().expect("a text"))
}

/// A graph without anything in it.
pub fn empty(name: &str) -> BondGraph {
    let mut exprs = Exprs::default();
    let time = exprs.symbol("t", Facts::default());
    BondGraph {
        name: name.to_owned(),
        doc: String::new(),
        exprs,
        variables: Map::from([(time, Variable { meaning: Meaning::Time, unit: None })]),
        elements: Table::new(),
        bonds: Table::new(),
        common: Default::default(),
        parameters: Table::new(),
        inputs: Table::new(),
        signals: Table::new(),
        held: Table::new(),
        clauses: Vec::new(),
        set_valued: Vec::new(),
        shapes: Vec::new(),
        lets: Vec::new(),
        outputs: Vec::new(),
        point: None,
        preferences: Vec::new(),
        forced_causality: Vec::new(),
        forced_strokes: Vec::new(),
        guesses: Vec::new(),
        constraints: Vec::new(),
        time,
        repetitions: Table::new(),
        cells: Table::new(),
    }
}

struct Builder<'a> {
    graph: &'a mut BondGraph,
    example: &'a Value,
}

impl Builder<'_> {
    fn symbol(&mut self, name: &str, facts: Facts, meaning: Meaning) -> Symbol {
        let symbol = self.graph.exprs.symbol(name, facts);
        self.graph.variables.insert(symbol, Variable { meaning, unit: None });
        symbol
    }

    fn parameters(&mut self) {
        let values = self.example["parameters"].as_object().expect("parameters").clone();
        for (at, (name, value)) in values.iter().enumerate() {
            let value = self.graph.exprs.decimal(value.as_str().expect("a text")).expect("a number");
            let facts = Facts { nonzero: true, positive: true, given: Some(value) };
            let symbol = self.symbol(name, facts, Meaning::Parameter(ParameterId::new(at)));
            let (name, doc) = (name.clone(), String::new());
            let span = Span::default();
            self.graph.parameters.push(Parameter {
                name,
                symbol,
                value,
                constant: false,
                shapes: false,
                kind: ParameterKind::Declared,
                unit: None,
                doc,
                span,
            });
        }
        for (at, name) in list(&self.example["sources"]).enumerate() {
            let default = self.graph.exprs.int(0);
            let symbol = self.symbol(name, Facts::default(), Meaning::Input(InputId::new(at)));
            let (name, doc, span) = (name.to_owned(), String::new(), Span::default());
            self.graph.inputs.push(Input { name, symbol, default, unit: None, doc, span });
        }
    }

    fn element_names(&self) -> Vec<String> {
        let elements = self.example["elements"].as_array().expect("elements");
        elements.iter().map(|e| e["name"].as_str().expect("a name").to_owned()).collect()
    }

    fn bonds(&mut self) {
        let names = self.element_names();
        let mut port_counts = vec![0; names.len()];
        let bonds = self.example["bonds"].as_array().expect("bonds");
        for (at, bond) in bonds.iter().enumerate() {
            let mut end = |key: &str| {
                let element = names.iter().position(|n| n == bond[key].as_str().expect("a name")).expect("an element");
                port_counts[element] += 1;
                PortRef { element: ElementId::new(element), port: port_counts[element] - 1 }
            };
            let (from, to) = (end("from"), end("to"));
            let id = BondId::new(at);
            let effort = self.symbol(&format!("b{}.e", at + 1), Facts::default(), Meaning::Effort(id));
            let flow = self.symbol(&format!("b{}.f", at + 1), Facts::default(), Meaning::Flow(id));
            let span = Span::default();
            self.graph.bonds.push(Bond { from, to, name: String::new(), effort, flow, pseudo: false, span });
        }
    }

    /// The angle of the pendulum: integrated from the flow of `IJ`.
    fn signals(&mut self) {
        if self.example["name"] != "pendulum" {
            return;
        }
        let at = self.element_names().iter().position(|n| n == "IJ").expect("the bar");
        let bond = self.graph.bonds.values().find(|bond| bond.to.element.index() == at).expect("its bond");
        let flow = bond.flow;
        let rate = self.graph.exprs.sym(flow);
        let symbol = self.symbol("phi", Facts::default(), Meaning::Signal(SignalId::new(0)));
        let (name, span) = ("phi".to_owned(), Span::default());
        self.graph.signals.push(IntegratedSignal { name, symbol, rate, initial: None, unit: None, span });
    }

    fn elements(&mut self) {
        for (at, data) in self.example["elements"].as_array().expect("elements").iter().enumerate() {
            let id = ElementId::new(at);
            let is_two_port = matches!(data["type"].as_str(), Some("TF" | "MTF" | "GY"));
            let ports = self.ports(id, is_two_port);
            let kind = self.kind(data, id, &ports);
            let name = data["name"].as_str().expect("a name").to_owned();
            let label = data["parameter"].as_str().unwrap_or_default().to_owned();
            self.graph.elements.push(Element {
                name,
                kind,
                ports,
                span: Span::default(),
                label: label.into(),
                cell: None,
                component: "".into(),
                strand: None,
                carries: None,
            });
        }
    }

    fn ports(&self, id: ElementId, is_two_port: bool) -> Vec<Port> {
        let mut ports = Vec::new();
        for (bond, data) in self.graph.bonds.iter() {
            for (end, inward) in [(data.from, false), (data.to, true)] {
                if end.element == id {
                    ports.push((end.port, Port { name: String::new(), bond, inward }));
                }
            }
        }
        ports.sort_by_key(|(port, _)| *port);
        let names = if is_two_port { ["in", "out"] } else { [""; 2] };
        let named =
            |(at, (_, port)): (usize, (u32, Port))| Port { name: names.get(at).unwrap_or(&"").to_string(), ..port };
        ports.into_iter().enumerate().map(named).collect()
    }

    fn kind(&mut self, data: &Value, id: ElementId, ports: &[Port]) -> Kind {
        let value = data["parameter"].as_str().map(|text| formula(text, &mut self.graph.exprs));
        let value = |what: &str| value.unwrap_or_else(|| panic!("{what} needs a parameter"));
        let zero_compliance = data["name"].as_str().is_some_and(|name| name.starts_with("ZC"));
        match data["type"].as_str().expect("a type") {
            "0" => Kind::Zero,
            "1" => Kind::One,
            "Sf" if zero_compliance => Kind::ZeroCompliance { flow: value("ZC") },
            "Sf" => Kind::FlowSource { value: value("Sf") },
            "Se" => Kind::EffortSource { value: value("Se") },
            "TF" | "MTF" => Kind::Transformer { modulus: value("TF") },
            "GY" => Kind::Gyrator { modulus: value("GY") },
            "R" => {
                let flow = self.graph.bonds[ports[0].bond].flow;
                let flow = self.graph.exprs.sym(flow);
                Kind::Resistor(vec![ResistorLaw::Resistive(self.graph.exprs.mul(&[value("R"), flow]))])
            }
            "C" => Kind::Compliance(Box::new(self.storage(
                id,
                "q",
                |stored, k, exprs| exprs.mul(&[k, stored]),
                value("C"),
            ))),
            "I" => {
                Kind::Inertance(Box::new(self.storage(id, "p", |stored, m, exprs| exprs.div(stored, m), value("I"))))
            }
            other => panic!("unknown kind {other}"),
        }
    }

    fn storage(&mut self, id: ElementId, what: &str, law: fn(Expr, Expr, &mut Exprs) -> Expr, value: Expr) -> Storage {
        let place = PortRef { element: id, port: 0 };
        let stored = self.symbol(&format!("x{}.{what}", id.index()), Facts::default(), Meaning::Stored(place));
        let x = self.graph.exprs.sym(stored);
        let law = StorageLaw::Integral(law(x, value, &mut self.graph.exprs));
        Storage { laws: vec![law], stored: vec![stored], initial: Vec::new(), energy: None }
    }
}
