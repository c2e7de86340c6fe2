//! Zero-order causal paths and what becomes of them, as plain data.

use std::collections::{BTreeMap, BTreeSet};

use halfarrow_compiler::algebra::{Exprs, Names, PlainNames, Symbol, ZERO, ascii, ascii_within};
use halfarrow_compiler::bond_graph::{BondGraph, Element, ElementId, Kind};
use halfarrow_compiler::causal_graph::{
    CausalGraph, Combination, PortState, Role, Stroke, by_hand, kept_junctions, state_rank,
};
use halfarrow_compiler::causal_paths::{self, CausalPaths, Path, counts};
use halfarrow_compiler::equations::{EquationStep, Equations, Form, StateKind};
use halfarrow_compiler::ids::{Id, Map};
use halfarrow_compiler::textbook::{Style, print_expr_within, show};
use serde::Serialize;

use crate::error::Error;
use crate::model::Model;

/// What `halfarrow loops` tells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopsReport {
    /// Name of the model.
    pub model: String,
    /// Variables that are independent although no storage has them, such as `w.f`. The drawing takes each as a source at
    /// its junction; `paths` are then those of the strokes that are given by hand, storages first.
    pub kept: Vec<String>,
    /// Zero-order causal paths, by class.
    pub paths: Vec<LoopReport>,
    /// Whether `paths` holds every simple path; if not, one for every break variable.
    pub complete: bool,
    /// The strongly connected parts of the algebraic variables.
    pub components: Vec<ComponentReport>,
    /// Every port of a storage.
    pub storages: Vec<StorageReport>,
    /// Combinations of stored quantities that no motion changes.
    pub conserved: Vec<ConservedReport>,
    /// How many equations each form has; integrated signals are not counted.
    pub counts: Counts,
    /// Number of independent storages.
    pub dof: usize,
    /// What derivative causality says about the state matrix; `None` if the graph is not linear.
    pub state_matrix: Option<StateMatrix>,
}

/// The state matrix `A` of a linear graph, read from causality (Sueur and Dauphin-Tanguy).
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StateMatrix {
    /// Number of independent storages.
    pub order: usize,
    /// Rank.
    pub rank: usize,
    /// Whether it is regular: every constant input has a solution at rest.
    pub regular: bool,
    /// Storages that stay in integral causality when derivative causality is preferred.
    pub integral: Vec<String>,
}

/// One zero-order causal path.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopReport {
    /// 1 storage to storage, 2 resistor to resistor, 3 resistor to itself, 4 inside the junction structure.
    pub class: u8,
    /// What it runs between; of a multibond the strand.
    pub elements: Vec<String>,
    /// All elements that it meets, in order.
    pub route: Vec<String>,
    /// The bonds it runs along, in order, numbered from 1 as in the drawing.
    pub bonds: Vec<u32>,
    /// Its gain, in the model language.
    pub gain: String,
    /// The gain at the given parameters and, where it depends on the state, at the start; `None` if it has no value.
    pub gain_value: Option<f64>,
    /// Break variables that lie on it.
    pub breaks: Vec<String>,
    /// What becomes of it in minimal form.
    pub resolution: String,
}

/// A strongly connected part of the algebraic variables.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComponentReport {
    /// Number of variables in it.
    pub size: usize,
    /// A smallest set of break variables.
    pub breaks: Vec<String>,
    /// Whether `breaks` is proven to be smallest.
    pub exact: bool,
    /// Proven lower bound on the number of break variables.
    pub lower_bound: usize,
    /// Determinant (Mason), in the model language; `None` if it was not worked out.
    pub determinant: Option<String>,
    /// Whether it vanishes: the part alone has no unique solution.
    pub singular: bool,
}

/// One port of a storage.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StorageReport {
    /// Name of the element, for fields with `.port`.
    pub name: String,
    /// `integral` or `derivative`, as drawn.
    pub causality: &'static str,
    /// Whether its variable is independent.
    pub independent: bool,
    /// The independent variables from which the dependent one follows, in the model language.
    pub follows: Option<String>,
    /// The independent variables that stand in `follows`.
    pub from: Vec<String>,
    /// The element whose strand it is, and how many that has; `None` if it is no strand of a multibond.
    #[serde(skip)]
    pub strand_of: Option<(String, usize)>,
}

/// A conserved quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConservedReport {
    /// Its name among the variables.
    pub name: String,
    /// What is conserved, in the model language.
    pub value: String,
}

/// Numbers of equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Count {
    /// Differential ones.
    pub differential: usize,
    /// Algebraic ones.
    pub algebraic: usize,
}

/// Numbers of equations of the forms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Break variables and multipliers beside all storages.
    #[serde(rename = "break")]
    pub break_form: Count,
    /// The paper's inversion.
    pub inverted: Count,
    /// The smallest.
    pub minimal: Count,
}

impl From<causal_paths::Count> for Count {
    fn from(count: causal_paths::Count) -> Count {
        Count { differential: count.differential, algebraic: count.algebraic }
    }
}

impl Model {
    /// The zero-order causal paths and their fate, storages, conserved quantities and counts.
    ///
    /// # Errors
    /// The model has errors.
    pub fn loops(&self) -> Result<LoopsReport, Error> {
        self.loops_within(usize::MAX)
    }

    /// The same with expressions of so many characters: what is longer ends with `…`. No determinants, which people do not
    /// read.
    ///
    /// # Errors
    /// The model has errors.
    pub fn loops_in_brief(&self, most: usize) -> Result<LoopsReport, Error> {
        self.loops_within(most)
    }

    fn loops_within(&self, most: usize) -> Result<LoopsReport, Error> {
        let causal = self.causal_graph()?;
        let of_causal = self.paths_of(&causal);
        let counted = counts(&causal, &of_causal);
        let drawn = CausalGraph { strokes: by_hand(&causal), ..causal.clone() };
        let paths = if drawn.strokes == causal.strokes { of_causal } else { self.paths_of(&drawn) };
        let equations = self.equations_of(&causal, Form::Minimal)?;
        let start = self.values_at_start(&equations);
        let blocks = Blocks::of(&causal.graph, &equations);
        let report = |path| loop_report(&causal.graph, &paths, path, (&equations, &blocks), (&start, most));
        Ok(LoopsReport {
            model: self.graph.name.clone(),
            kept: kept_variables(&causal),
            paths: paths.paths.iter().map(report).collect(),
            complete: paths.complete,
            components: components(&paths, most == usize::MAX),
            storages: storages(&causal, most),
            conserved: conserved(&equations, most),
            counts: Counts {
                break_form: counted.break_form.into(),
                inverted: counted.inverted.into(),
                minimal: minimal_count(&equations),
            },
            dof: equations.dof,
            state_matrix: state_rank(&causal).map(|found| StateMatrix {
                order: found.order,
                rank: found.rank,
                regular: found.integral.is_empty(),
                integral: found.integral.iter().map(|&port| causal.graph.port_name(port)).collect(),
            }),
        })
    }
}

/// What junctions keep although no storage has it.
fn kept_variables(causal: &CausalGraph) -> Vec<String> {
    let name = |junction: ElementId| {
        let element = &causal.graph.elements[junction];
        let variable = if matches!(element.kind, Kind::Zero) { "e" } else { "f" };
        format!("{}.{variable}", element.name)
    };
    kept_junctions(causal).into_iter().map(name).collect()
}

/// Storage states and what stays implicit.
pub(crate) fn minimal_count(equations: &Equations) -> Count {
    let storages = equations.states.iter().filter(|s| s.kind != StateKind::Signal).count();
    Count { differential: storages, algebraic: equations.implicit.len() }
}

fn loop_report(
    graph: &BondGraph,
    paths: &CausalPaths,
    path: &Path,
    (equations, blocks): (&Equations, &Blocks),
    (start, most): (&BTreeMap<String, f64>, usize),
) -> LoopReport {
    let x = &paths.exprs;
    let names = |list: &[ElementId]| list.iter().map(|&e| graph.elements[e].name.clone()).collect();
    let value = x.eval(path.gain, &mut |symbol| value_of(x, symbol, start));
    LoopReport {
        class: path.class,
        elements: path.elements.iter().flat_map(|&e| ends(graph, path, e)).collect(),
        route: names(&path.route),
        bonds: path.signals.iter().map(|(bond, _)| bond.index() as u32 + 1).collect(),
        gain: ascii_within(x, path.gain, &PlainNames(x), most),
        gain_value: value.is_finite().then_some(value),
        breaks: path.breaks.iter().map(|&s| x.name(s).to_string()).collect(),
        resolution: resolution(path, equations, blocks),
    }
}

/// The names of what a path meets of an element at one of its ends: of a multibond the strands.
fn ends(graph: &BondGraph, path: &Path, element: ElementId) -> Vec<String> {
    let at = &graph.elements[element];
    if at.kind.is_inner() || at.ports.len() < 2 {
        return vec![at.name.clone()];
    }
    let mut met: Vec<usize> = Vec::new();
    for &(bond, _) in &path.signals {
        met.extend(at.ports.iter().position(|p| p.bond == bond).filter(|port| !met.contains(port)));
    }
    met.into_iter().map(|port| at.part_name(port)).collect()
}

/// How many strands an element has: one that has a port for each bond of a multibond, with names that only strands have.
fn strands(element: &Element) -> Option<usize> {
    let of = element.ports.len();
    let is_strand = |(at, name): (usize, &str)| match of {
        ..=3 => ["x", "y", "z"][at] == name,
        _ => name.strip_prefix('[').and_then(|n| n.strip_suffix(']')) == Some(&(at + 1).to_string()),
    };
    let names = element.ports.iter().map(|port| port.name.as_str());
    (of > 1 && !element.kind.is_inner() && names.enumerate().all(is_strand)).then_some(of)
}

/// The value of a symbol: of a parameter as given, of anything else at the start; NaN if unknown.
fn value_of(x: &Exprs, symbol: Symbol, start: &BTreeMap<String, f64>) -> f64 {
    match x.facts(symbol).given {
        Some(given) => x.eval(given, &mut |inner| value_of(x, inner, start)),
        None => start.get(x.name(symbol)).copied().unwrap_or(f64::NAN),
    }
}

/// The solve blocks that elements take part in: of each kind the first, as its place among the steps and its size.
struct Blocks {
    newton: BTreeMap<ElementId, (usize, usize)>,
    linear: BTreeMap<ElementId, (usize, usize)>,
}

impl Blocks {
    fn of(graph: &BondGraph, equations: &Equations) -> Blocks {
        let mut blocks = Blocks { newton: BTreeMap::new(), linear: BTreeMap::new() };
        for (place, step) in equations.steps.iter().enumerate() {
            let (kind, unknowns, elements) = match step {
                EquationStep::Newton(block) => (&mut blocks.newton, &block.unknowns, &block.elements),
                EquationStep::Linear(block) => (&mut blocks.linear, &block.unknowns, &block.elements),
                _ => continue,
            };
            for &element in elements.iter().filter(|e| !graph.elements[**e].kind.is_inner()) {
                kind.entry(element).or_insert((place, unknowns.len()));
            }
        }
        blocks
    }

    /// What solves the equations of these elements.
    fn resolution(&self, met: &BTreeSet<ElementId>) -> String {
        let size =
            |kind: &BTreeMap<ElementId, (usize, usize)>| met.iter().filter_map(|e| kind.get(e)).min().map(|b| b.1);
        match (size(&self.newton), size(&self.linear)) {
            (Some(size), _) => format!("Newton iteration for {size} unknown{}", plural(size)),
            (None, Some(size)) => format!("solved in a block of {size} linear equation{}", plural(size)),
            (None, None) => "solved in closed form".to_string(),
        }
    }
}

fn resolution(path: &Path, equations: &Equations, blocks: &Blocks) -> String {
    if path.class == 1 {
        let graph = &equations.graph;
        let dependent: Vec<&str> = path.breaks.iter().map(|&s| graph.exprs.name(s)).collect();
        let within = match path.elements[..] {
            [element] if strands(&graph.elements[element]).is_some() => {
                format!("; both ends are strands of {}, which move together", graph.elements[element].name)
            }
            _ => String::new(),
        };
        return format!("velocity transformation: {} is eliminated with its storage{within}", dependent.join(", "));
    }
    blocks.resolution(&path.route.iter().chain(&path.elements).copied().collect())
}

fn plural(n: usize) -> &'static str {
    if n == 1 { "" } else { "s" }
}

fn components(paths: &CausalPaths, with_determinants: bool) -> Vec<ComponentReport> {
    let x = &paths.exprs;
    let report = |c: &causal_paths::Component| ComponentReport {
        size: c.signals.len(),
        breaks: c.breaks.iter().map(|&s| x.name(s).to_string()).collect(),
        exact: c.exact,
        lower_bound: c.lower_bound,
        determinant: c.determinant.filter(|_| with_determinants).map(|d| ascii(x, d, &PlainNames(x))),
        singular: c.singular,
    };
    paths.components.iter().map(report).collect()
}

fn storages(causal: &CausalGraph, most: usize) -> Vec<StorageReport> {
    let graph = &causal.graph;
    let mut x = graph.exprs.clone();
    let mut known: Map<Symbol, Combination> = Map::new();
    for symbol in held_at_zero(graph) {
        known.insert(symbol, Combination::default());
    }
    let of_storages = causal.ports.ports.iter().filter(|s| graph.storage_symbols(s.port).is_some());
    let mut report = |state: &PortState| {
        let (co_energy, _) = graph.storage_symbols(state.port).expect("a storage");
        let mut from = Vec::new();
        let follows = (state.role == Role::Dependent).then(|| {
            let combination = causal.ports.resolve(&mut x, co_energy, &mut known);
            from = combination.0.iter().map(|&(symbol, _)| OneName(&x).ascii(symbol)).collect();
            let value = combination.expr(&mut x);
            format!("{} = {}", x.name(co_energy), ascii_within(&x, value, &OneName(&x), most))
        });
        let element = &graph.elements[state.port.element];
        StorageReport {
            name: graph.port_name(state.port),
            causality: if integral(causal, state) { "integral" } else { "derivative" },
            independent: state.role == Role::Independent,
            follows,
            from,
            strand_of: strands(element).map(|of| (element.name.clone(), of)),
        }
    };
    of_storages.map(&mut report).collect()
}

/// Where a variable has a twin of its own at each end of a bond, both have its name.
struct OneName<'a>(&'a Exprs);

impl Names for OneName<'_> {
    fn called(&self, symbol: Symbol) -> (String, usize) {
        let (of, rates) = self.0.undotted(symbol);
        (self.0.name(of).to_string(), rates)
    }
    fn place(&self, symbol: Symbol) -> halfarrow_compiler::algebra::Place {
        PlainNames(self.0).place(symbol)
    }
}

/// The efforts and flows that sources and zero compliances hold at zero.
fn held_at_zero(graph: &BondGraph) -> impl Iterator<Item = Symbol> {
    graph.elements.iter().filter_map(|(_, element)| {
        let bond = || &graph.bonds[element.ports[0].bond];
        match element.kind {
            Kind::ZeroCompliance { flow: ZERO } | Kind::FlowSource { value: ZERO } => Some(bond().flow),
            Kind::EffortSource { value: ZERO } => Some(bond().effort),
            _ => None,
        }
    })
}

/// Whether a storage is drawn in integral causality: an `I` is given the effort, a `C` the flow.
fn integral(causal: &CausalGraph, state: &PortState) -> bool {
    let graph = &causal.graph;
    let bond = graph.bond_of(state.port);
    let at_storage = match causal.strokes[bond] {
        Stroke::Undetermined => return state.role == Role::Independent,
        Stroke::To => graph.bonds[bond].to == state.port,
        Stroke::From => graph.bonds[bond].from == state.port,
    };
    at_storage == matches!(graph.elements[state.port.element].kind, Kind::Inertance(_))
}

fn conserved(equations: &Equations, most: usize) -> Vec<ConservedReport> {
    if equations.conserved.is_empty() {
        return Vec::new();
    }
    let shown = show(equations.clone());
    let report = |c: &halfarrow_compiler::equations::Conserved| ConservedReport {
        name: c.name.clone(),
        value: print_expr_within(&shown, c.value, Style::Ascii, most),
    };
    shown.equations.conserved.iter().map(report).collect()
}
