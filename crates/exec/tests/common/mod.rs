//! Equations made by hand, and the programs of the models.
#![allow(dead_code)]

use halfarrow_compiler::algebra::{Comparison, Expr, Exprs, Facts, Function, Symbol};
use halfarrow_compiler::bond_graph::NoFiles;
use halfarrow_compiler::bond_graph::{
    BondGraph, Element, ElementId, HeldKind, HeldSignal, Input, Kind, Parameter, ParameterKind,
};
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::{
    BreakBound, Conserved, Count, EquationStep, Equations, Form, InitialCondition, Observed, ObservedKind, State,
    StateKind,
};
use halfarrow_compiler::ids::{Map, Table};
use halfarrow_compiler::program::{Program, schedule};
use halfarrow_compiler::span::Span;
use halfarrow_exec::Model;

pub struct Sketch {
    pub x: Exprs,
    pub t: Expr,
    time: Symbol,
    parameters: Vec<Parameter>,
    inputs: Vec<Input>,
    held: Vec<HeldSignal>,
    elements: Table<ElementId, Element>,
    states: Vec<State>,
    conserved: Vec<Conserved>,
    steps: Vec<EquationStep>,
    observed: Vec<Observed>,
    conditions: Vec<InitialCondition>,
}

impl Default for Sketch {
    fn default() -> Self {
        let mut x = Exprs::default();
        let time = x.symbol("t", Facts::default());
        let t = x.sym(time);
        Sketch {
            x,
            t,
            time,
            parameters: Vec::new(),
            inputs: Vec::new(),
            held: Vec::new(),
            elements: Table::new(),
            states: Vec::new(),
            conserved: Vec::new(),
            steps: Vec::new(),
            observed: Vec::new(),
            conditions: Vec::new(),
        }
    }
}

impl Sketch {
    pub fn symbol(&mut self, name: &str) -> (Symbol, Expr) {
        let symbol = self.x.symbol(name, Facts::default());
        (symbol, self.x.sym(symbol))
    }
    pub fn number(&mut self, value: f64) -> Expr {
        self.x.float(value)
    }
    pub fn parameter(&mut self, name: &str, value: Expr) -> Expr {
        let (symbol, e) = self.symbol(name);
        let (unit, doc, span) = (None, String::new(), Span::default());
        self.parameters.push(Parameter {
            name: name.into(),
            symbol,
            value,
            constant: false,
            shapes: false,
            kind: ParameterKind::Declared,
            unit,
            doc,
            span,
        });
        e
    }
    pub fn input(&mut self, name: &str, default: f64) -> Expr {
        let (symbol, e) = self.symbol(name);
        let default = self.number(default);
        let (unit, doc, span) = (None, String::new(), Span::default());
        self.inputs.push(Input { name: name.into(), symbol, default, unit, doc, span });
        e
    }
    pub fn held(&mut self, name: &str, kind: HeldKind, source: Expr, time: f64) -> Expr {
        let (symbol, e) = self.symbol(name);
        let time = self.number(time);
        self.held.push(HeldSignal { name: name.into(), symbol, source, time, kind, unit: None, span: Span::default() });
        e
    }
    pub fn element(&mut self, name: &str) -> ElementId {
        let (ports, label) = (Vec::new(), String::new());
        self.elements.push(Element {
            name: name.into(),
            kind: Kind::Zero,
            ports,
            span: Span::default(),
            label: label.into(),
            cell: None,
            component: "".into(),
            strand: None,
            carries: None,
        })
    }
    /// A state, recorded by default; its rate is given by [`rate`](Sketch::rate).
    pub fn state(&mut self, name: &str) -> Expr {
        let (symbol, e) = self.symbol(name);
        let rate = self.x.symbol(&format!("{name}'"), Facts::default());
        let (kind, unit, span) = (StateKind::Signal, None, Span::default());
        self.states.push(State { symbol, rate, name: name.into(), kind, unit, span });
        self.observe(name, e);
        e
    }
    pub fn conserved(&mut self, name: &str) -> Expr {
        let (symbol, value) = self.symbol(name);
        self.conserved.push(Conserved { symbol, name: name.into(), value, replaced: symbol });
        value
    }
    pub fn rate(&mut self, name: &str, value: Expr) {
        let symbol = self.x.symbol(&format!("{name}'"), Facts::default());
        self.steps.push(EquationStep::Assign { symbol, value });
    }
    pub fn step(&mut self, step: EquationStep) {
        self.steps.push(step);
    }
    pub fn observe(&mut self, name: &str, value: Expr) {
        self.observed.push(Observed {
            name: name.into(),
            value: Ok(value),
            unit: None,
            kind: ObservedKind::Named,
            default: true,
        });
    }
    pub fn hidden(&mut self, name: &str, value: Expr) {
        self.observed.push(Observed {
            name: name.into(),
            value: Ok(value),
            unit: None,
            kind: ObservedKind::Named,
            default: false,
        });
    }
    /// `what` has a value at the start.
    pub fn start(&mut self, name: &str, what: Expr, value: f64) {
        let value = self.number(value);
        let residual = self.x.sub(what, value);
        self.conditions.push(InitialCondition {
            residual,
            name: name.into(),
            value,
            firm: false,
            weak: false,
            span: Span::default(),
        });
    }
    pub fn call(&mut self, f: Function, a: Expr) -> Expr {
        self.x.call(f, &[a])
    }
    pub fn less(&mut self, a: Expr, b: Expr) -> Expr {
        self.x.compare(Comparison::Lt, a, b)
    }
    pub fn equations(self) -> Equations {
        let graph = BondGraph {
            name: "sketch".into(),
            doc: String::new(),
            exprs: self.x,
            variables: Map::new(),
            elements: self.elements,
            bonds: Table::new(),
            common: Default::default(),
            parameters: self.parameters.into_iter().collect(),
            inputs: self.inputs.into_iter().collect(),
            signals: Table::new(),
            held: self.held.into_iter().collect(),
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
            time: self.time,
            repetitions: Table::new(),
            cells: Table::new(),
        };
        Equations {
            form: Form::Minimal,
            graph,
            dof: self.states.len(),
            tracked: self.states.iter().map(|s| s.symbol).collect(),
            free_rates: Default::default(),
            certificate: None,
            states: self.states,
            conserved: self.conserved,
            positions: Vec::new(),
            relations: Default::default(),
            position_relations: Vec::new(),
            unkept_relations: Vec::new(),
            momenta: Vec::new(),
            jumps: None,
            exchanges: Default::default(),
            steps: self.steps,
            observed: self.observed,
            conditions: self.conditions,
            guesses: Vec::new(),
            domains: Vec::new(),
            definitions: Map::new(),
            rows: Vec::new(),
            of_loops: Default::default(),
            dependent: Vec::new(),
            meanings: Vec::new(),
            algebraic: Vec::new(),
            residuals: Vec::new(),
            index: 0,
            indices: Vec::new(),
            counts: Count { differential: 0, algebraic: 0 },
            breaks: BreakBound::default(),
            assumptions: Vec::new(),
            implicit: Vec::new(),
        }
    }
    pub fn model(self) -> Model {
        Model::new(schedule(&self.equations())).expect("parameters have values")
    }
}

/// The minimal form of every model of `models/`, by name.
pub fn models() -> Vec<(String, Program)> {
    let crates = std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let folders = std::fs::read_dir(crates.join("../models")).expect("the models are there");
    let mut files: Vec<_> = folders.map(|e| e.expect("a folder").path().join("model.bond")).collect();
    // Linear blocks of six unknowns.
    files.push(crates.join("emit/tests/models/links.bond"));
    let mut found = Vec::new();
    for file in files {
        let Ok(text) = std::fs::read_to_string(&file) else { continue };
        let name = file.to_string_lossy().to_string();
        let text = Text { name: &name, text: &text, files: &NoFiles, overrides: &[] };
        let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false)));
        found.push((name, program.ir));
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found
}
