//! The bond graph: a model flattened to elements, bonds and exact expressions.
//!
//! Components are instantiated (their parts are named `instance.part`), units are checked and converted to SI,
//! signal blocks are unfolded, `constraint` statements have become zero compliances behind modulated transformers.
//! Every expression reads only the symbols of [`BondGraph::variables`]: parameters, time, inputs, integrated signals,
//! held signals, and the effort, flow and stored quantity of bonds and ports. What the modeller wrote as `R1.f` is the
//! flow of the bond at `R1`; `w.f` of a 1-junction is the flow of any of its bonds.

mod arrays;
mod assemble;
mod blocks;
mod builder;
mod common;
mod constraint;
mod counted;
mod csv;
mod declare;
mod decls;
mod dimension;
mod elaborate;
mod elements;
mod ends;
mod events;
mod expressions;
mod families;
mod faults;
mod files;
mod fixed;
mod flatten;
mod guesses;
mod instances;
mod intent;
mod load;
mod lookup;
mod measure;
mod multibonds;
mod names;
mod overrides;
mod port_kinds;
mod print;
mod properties;
mod recognise;
mod repeat;
mod scope;
mod set_valued;
mod shapes;
mod start_parameters;
mod structure;
mod symbols;
mod turns;
mod two_ports;
mod uses;
mod value;
mod vectors;
mod velocity_relations;
mod verify;
mod warnings;
mod wire;

pub(crate) use counted::Counting;
pub(crate) use elaborate::elaborate_counting;
pub use elaborate::{Elaborated, elaborate};
pub use files::{FileError, Files, NoFiles};
pub(crate) use multibonds::{part_name, strand_name};
pub use names::{Name, NameKind};
pub use overrides::Override;
pub(crate) use repeat::MAX_TURNS;
pub use set_valued::{Bound, BoundKind, Branch, Impact, SetValuedLaw};
pub use shapes::{Shape, ShapeArgument, ShapeKind};
pub use velocity_relations::{Integral, VelocityRelation, velocity_relations};
pub use verify::verify;
pub use warnings::warnings;

use crate::algebra::{Expr, Exprs, Symbol};
use crate::ids::{Map, Table, id};
use crate::span::Span;
use crate::unit::Unit;
use std::sync::Arc;

id!(
    /// An element or junction.
    ElementId
);
id!(
    /// A bond. Bonds are numbered for people from 1, in the order written.
    BondId
);
id!(
    /// A parameter or constant.
    ParameterId
);
id!(
    /// An input.
    InputId
);
id!(
    /// An integrated signal (`state x' = …`, and the states of `pid` and `tf`).
    SignalId
);
id!(
    /// A repetition of statements.
    RepetitionId
);
id!(
    /// A turn of a repetition.
    CellId
);
id!(
    /// A signal held from earlier times (`delay`, `sample`, `discrete`).
    HeldId
);

/// A bond graph, flattened.
///
/// Invariants (see [`verify`]): every bond joins two different port places that name it back; junctions have at least
/// one bond; a one-port has one bond; a two-port has its `in` bond with the half arrow at it and its `out` bond with the
/// half arrow away from it; half arrows point into every `I`, `C`, `R`; every symbol in any expression is in `variables`.
#[derive(Debug, Clone)]
pub struct BondGraph {
    /// Name of the model.
    pub name: String,
    /// Its documentation, may be empty.
    pub doc: String,
    /// All expressions of the graph.
    pub exprs: Exprs,
    /// What each symbol stands for.
    pub variables: Map<Symbol, Variable>,
    /// Elements and junctions, in the order in which they first stand in the text.
    pub elements: Table<ElementId, Element>,
    /// Bonds, in the order written.
    pub bonds: Table<BondId, Bond>,
    /// The bond of each drawn junction whose variable stands for the common one. Two that touch have each its own.
    pub common: Map<ElementId, BondId>,
    /// Parameters and constants.
    pub parameters: Table<ParameterId, Parameter>,
    /// Inputs.
    pub inputs: Table<InputId, Input>,
    /// Integrated signals.
    pub signals: Table<SignalId, IntegratedSignal>,
    /// Delayed and sampled signals, discrete variables.
    pub held: Table<HeldId, HeldSignal>,
    /// What happens at events (`when`), in the order of the text.
    pub clauses: Vec<Clause>,
    /// Named expressions (`let` values), in order, fully expanded.
    pub lets: Vec<Named>,
    /// Outputs, in order, fully expanded.
    pub outputs: Vec<Named>,
    /// Values of variables at which it is decided what stays independent; those of the start where there are none.
    pub point: Option<Map<Symbol, f64>>,
    /// `prefer`, in order.
    pub preferences: Vec<Preference>,
    /// `causality`.
    pub forced_causality: Vec<ForcedCausality>,
    /// `stroke`.
    pub forced_strokes: Vec<ForcedStroke>,
    /// `guess`, in order.
    pub guesses: Vec<Guess>,
    /// `constraint`.
    pub constraints: Vec<Constraint>,
    /// Set-valued laws, in the order of the text. Their elements have the kind of the present branch, and the last clauses
    /// tell where it ends: see [`in_mode`](BondGraph::in_mode).
    pub set_valued: Vec<SetValuedLaw>,
    /// What a picture of the machine shows (`shape`), in the order of the text.
    pub shapes: Vec<Shape>,
    /// Time, as a symbol.
    pub time: Symbol,
    /// The repetitions of statements (`for`).
    pub repetitions: Table<RepetitionId, Repetition>,
    /// Their turns, in the order in which they are made.
    pub cells: Table<CellId, Cell>,
}

/// A `for` around statements, of the model or of one instance of a component.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Repetition {
    /// Its variable.
    pub variable: String,
    /// The instance that it stands in; empty for the model itself.
    pub within: String,
    /// Where the variable is declared.
    pub span: Span,
}

/// One turn of a repetition: what is made in it is made of the same text as what other turns of it make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell {
    /// The repetition.
    pub repetition: RepetitionId,
    /// The value of its variable.
    pub value: i64,
    /// The turn of the repetition around it, or around the instance that it stands in.
    pub outer: Option<CellId>,
}

/// A symbol's meaning, unit and place.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// What it stands for.
    pub meaning: Meaning,
    /// Its SI unit, where known.
    pub unit: Option<Unit>,
}

/// What a symbol stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    /// Time, in s.
    Time,
    /// A parameter or constant.
    Parameter(ParameterId),
    /// An input.
    Input(InputId),
    /// An integrated signal.
    Signal(SignalId),
    /// A delayed or sampled signal, a discrete variable.
    Held(HeldId),
    /// Effort of a bond.
    Effort(BondId),
    /// Flow of a bond.
    Flow(BondId),
    /// Stored quantity of a port of a storage: momentum `p` of an `I`, displacement `q` of a `C`.
    Stored(PortRef),
    /// Time derivative of another symbol (`x'` in an expression).
    Rate(Symbol),
}

/// One port of an element: the place where a bond ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PortRef {
    /// The element.
    pub element: ElementId,
    /// Index into [`Element::ports`].
    pub port: u32,
}

/// An element or junction.
#[derive(Debug, Clone)]
pub struct Element {
    /// Its full name, such as `motor.shaft`.
    pub name: String,
    /// What it is, with its law.
    pub kind: Kind,
    /// Its ports, in order; junctions have one for every bond, in the order written; `TF`/`GY`: `in`, then `out`.
    pub ports: Vec<Port>,
    /// Where it is declared.
    pub span: Span,
    /// The law or value as the modeller wrote it, for drawings: `k = ks`, `e = b*f^3`; empty for junctions.
    pub label: Arc<str>,
    /// The turn of a repetition that it is made in, if it is.
    pub cell: Option<CellId>,
    /// The component whose text declares it; empty for the model itself.
    pub component: Arc<str>,
    /// Which of how many it is, counted from 0, if it is one of the junctions, sources or sensors of a multibond.
    pub strand: Option<(u32, u32)>,
    /// At a source of effort: the effort that acts there by a constraint that is solved at the rates (`carries`). It moves
    /// nothing, and is told in the efforts of the bonds that bear it.
    pub carries: Option<Expr>,
}

impl Element {
    /// The name of a port of it, as it stands in results: `spring`, `gap.el`, `twist[4]`.
    pub fn part_name(&self, port: usize) -> String {
        multibonds::part_name(&self.name, &self.ports[port].name)
    }
}

/// A port and its bond.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Port {
    /// Its name if the element is a field (`el` in `gap.el`), `in`/`out` for two-ports, else empty.
    pub name: String,
    /// The bond that ends here.
    pub bond: BondId,
    /// Whether the half arrow points at this element.
    pub inward: bool,
}

/// Kinds of elements, with their laws as expressions over the symbols of their own ports and any signals.
#[derive(Debug, Clone)]
pub enum Kind {
    /// 0-junction: one effort, flows sum to zero along the half arrows.
    Zero,
    /// 1-junction: one flow, efforts sum to zero along the half arrows.
    One,
    /// `Se`: the effort of its bond is `value`.
    EffortSource {
        /// The effort, along the half arrow as drawn.
        value: Expr,
    },
    /// `Sf`: the flow of its bond is `value`.
    FlowSource {
        /// The flow, along the half arrow as drawn.
        value: Expr,
    },
    /// `ZC`: the flow of its bond is held at `flow` (zero if none is given), its effort is a Lagrange multiplier.
    ZeroCompliance {
        /// The flow.
        flow: Expr,
    },
    /// `rSe`: an unknown effort that makes `residual` vanish (its own flow if none is given).
    ResidualEffort {
        /// The residual, if one is given.
        residual: Option<Expr>,
    },
    /// `rSf`: an unknown flow that makes `residual` vanish (its own effort if none is given).
    ResidualFlow {
        /// The residual, if one is given.
        residual: Option<Expr>,
    },
    /// `De`: reads an effort, takes no flow.
    EffortDetector,
    /// `Df`: reads a flow, takes no effort.
    FlowDetector,
    /// `I`, one port or a field.
    Inertance(Box<Storage>),
    /// `C`, one port or a field.
    Compliance(Box<Storage>),
    /// `R`, one port or a field: one law a port.
    Resistor(Vec<ResistorLaw>),
    /// `TF`: `e_in = m e_out`, `f_out = m f_in`.
    Transformer {
        /// The modulus `m`.
        modulus: Expr,
    },
    /// `GY`: `e_in = r f_out`, `e_out = r f_in`.
    Gyrator {
        /// The modulus `r`.
        modulus: Expr,
    },
    /// A wide `TF`: `f_out = M f_in`, `e_in = Mᵀ e_out`. Its ports are those at `in`, then those at `out`.
    MatrixTransformer(Box<Matrix>),
    /// A wide `GY` of two sides: `e_out = M f_in`, `e_in = Mᵀ f_out`. Its ports are those at `in`, then those at `out`.
    MatrixGyrator(Box<Matrix>),
    /// A wide `GY` of one side, with a skew matrix `S`: `e = Sᵀ f`, without power; `S` from a momentum `h` by `skew(h)` makes
    /// it an Eulerian junction structure, `e = w × h`. One law a port.
    SkewGyrator(Vec<ResistorLaw>),
}

/// A matrix of expressions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Matrix {
    /// Number of rows: the ports at `out`.
    pub rows: usize,
    /// Number of columns: the ports at `in`.
    pub columns: usize,
    /// The entries, row by row.
    pub entries: Vec<Expr>,
}

impl Matrix {
    /// An entry.
    pub fn at(&self, row: usize, column: usize) -> Expr {
        self.entries[row * self.columns + column]
    }
}

/// One equation of a wide two-port: a variable at one side is a sum over the other side.
#[derive(Debug, Clone)]
pub struct TwoPortRow {
    /// The port whose variable it gives.
    pub port: usize,
    /// Whether that is its effort.
    pub effort: bool,
    /// The ports that it is a sum over, with the coefficients of their variables, which are efforts or not.
    pub terms: Vec<(usize, Expr)>,
    /// Whether these are efforts.
    pub of_efforts: bool,
}

/// Laws and start values of a storage, one entry a port.
///
/// With `X` the stored quantity (`p`, `q`) and `z` the co-energy variable (flow of an `I`, effort of a `C`).
#[derive(Debug, Clone)]
pub struct Storage {
    /// The law of each port.
    pub laws: Vec<StorageLaw>,
    /// The symbol of the stored quantity of each port.
    pub stored: Vec<Symbol>,
    /// Start values, as conditions.
    pub initial: Vec<Initial>,
    /// The stored energy as given (`energy = …`), if it was.
    pub energy: Option<Expr>,
}

/// The law of one port of a storage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StorageLaw {
    /// `z = Φ(X)`, reading stored quantities (of all its ports) and signals.
    Integral(Expr),
    /// `X = Ψ(z)`, reading co-energy variables (of all its ports) and signals.
    Derivative(Expr),
    /// `0 = expr` in `X`, `z` and signals.
    Implicit(Expr),
    /// `X = expr` in signals (a `C` whose displacement is known), `z = law` in the stored symbol.
    Known {
        /// The displacement.
        displacement: Expr,
        /// `z` as an expression of the stored symbol.
        law: Expr,
    },
}

/// The law of one port of a resistor, in efforts and flows of its ports and signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResistorLaw {
    /// `e = expr`, which reads flows (own first of all).
    Resistive(Expr),
    /// `f = expr`, which reads efforts.
    Conductive(Expr),
    /// `0 = expr`.
    Implicit(Expr),
}

/// A start value: a condition at the start of the run.
#[derive(Debug, Clone, Copy)]
pub struct Initial {
    /// The symbol that has the value: effort or flow of the bond, or stored quantity.
    pub symbol: Symbol,
    /// The value, in parameters.
    pub value: Expr,
    /// Where it stands.
    pub span: Span,
}

/// A bond with its half arrow at `to`.
#[derive(Debug, Clone)]
pub struct Bond {
    /// Where it starts.
    pub from: PortRef,
    /// Where its half arrow points.
    pub to: PortRef,
    /// Its name (`as b3`), else empty.
    pub name: String,
    /// Symbol of its effort.
    pub effort: Symbol,
    /// Symbol of its flow.
    pub flow: Symbol,
    /// Whether effort times flow is no power (`domain … pseudo`).
    pub pseudo: bool,
    /// Where it is written.
    pub span: Span,
}

/// A parameter (may be changed at run time) or constant.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its symbol.
    pub symbol: Symbol,
    /// Its value, a number or an expression of other parameters, in SI.
    pub value: Expr,
    /// Whether it stays as it is while the model runs: it is a `const`, or shapes the model.
    pub constant: bool,
    /// Whether it shapes the model, as the number of turns of a repetition does: only a model that is compiled anew has
    /// another value of it.
    pub shapes: bool,
    /// What it is.
    pub kind: ParameterKind,
    /// Unit as written.
    pub unit: Option<Unit>,
    /// Documentation.
    pub doc: String,
    /// Where it is declared.
    pub span: Span,
}

/// What a parameter is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterKind {
    /// One of the model.
    Declared,
    /// Of the form `stiff`: the square of the ratio of the springs' frequency to the fastest rate.
    SpringStiffness,
    /// Of the form `stiff`: the damping of the springs, in parts of critical damping.
    SpringDamping,
    /// Of the form `stiff`: the fastest rate of the model without its constraints, in 1/s.
    FastestRate,
}

/// An input.
#[derive(Debug, Clone)]
pub struct Input {
    /// Its name.
    pub name: String,
    /// Its symbol.
    pub symbol: Symbol,
    /// Its value when nothing is connected.
    pub default: Expr,
    /// Unit.
    pub unit: Option<Unit>,
    /// Documentation.
    pub doc: String,
    /// Where it is declared.
    pub span: Span,
}

/// An integrated signal.
#[derive(Debug, Clone)]
pub struct IntegratedSignal {
    /// Its name.
    pub name: String,
    /// Its symbol.
    pub symbol: Symbol,
    /// Its rate.
    pub rate: Expr,
    /// Its start value, if given (`from`).
    pub initial: Option<Expr>,
    /// Unit.
    pub unit: Option<Unit>,
    /// Where it is declared.
    pub span: Span,
}

/// A signal read from earlier times.
#[derive(Debug, Clone)]
pub struct HeldSignal {
    /// Its name, made from where it stands.
    pub name: String,
    /// Its symbol.
    pub symbol: Symbol,
    /// The signal that is delayed or sampled; the start value of a discrete variable, in parameters.
    pub source: Expr,
    /// Delay or sampling period in s, in parameters; above 0. Of a discrete variable nothing: 1.
    pub time: Expr,
    /// What it is.
    pub kind: HeldKind,
    /// Unit as written.
    pub unit: Option<Unit>,
    /// Where it stands.
    pub span: Span,
}

/// The ways of holding a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeldKind {
    /// `delay(u, T)`: the value at `t - T` (before that, the value at the start).
    Delay,
    /// `sample(u, T)`: the value at the last multiple of `T`.
    Sample,
    /// `discrete n = 0`: what an event has set last.
    Discrete,
    /// What the last `reset` of something took, 0 before: `ball.impulse`.
    Impulse,
}

impl HeldKind {
    /// Whether events alone change it.
    pub fn is_discrete(self) -> bool {
        matches!(self, HeldKind::Discrete | HeldKind::Impulse)
    }
}

/// A `when`: what happens at an event, all at once, from the values before it.
#[derive(Debug, Clone)]
pub struct Clause {
    /// As it begins in the text, with the instance that it stands in: `when ball.q < 0`.
    pub name: String,
    /// When it happens.
    pub trigger: Trigger,
    /// What changes.
    pub actions: Vec<Action>,
    /// The set-valued law of which a branch ends there, and which of its bounds that is: then nothing else changes.
    pub bound: Option<(usize, usize)>,
    /// Where it stands.
    pub span: Span,
}

/// When an event happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trigger {
    /// Where a condition becomes true.
    Becomes(Expr),
    /// At every multiple of a period in s, in parameters; above 0.
    Every(Expr),
}

impl Trigger {
    /// The condition or the period.
    pub fn expr(self) -> Expr {
        let (Trigger::Becomes(e) | Trigger::Every(e)) = self;
        e
    }
}

/// What changes at an event.
#[derive(Debug, Clone)]
pub struct Action {
    /// The variable as written, with the instance that it stands in: `ball.f`.
    pub name: String,
    /// A discrete variable, an integrated signal, a stored quantity, an effort or a flow.
    pub target: Symbol,
    /// Its new value, in values before the event.
    pub value: Expr,
    /// What tells the impulse that brings storages to it; none for discrete variables and integrated signals.
    pub impulse: Option<Symbol>,
    /// Where it stands.
    pub span: Span,
}

/// A named expression.
#[derive(Debug, Clone)]
pub struct Named {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: Expr,
    /// Unit.
    pub unit: Option<Unit>,
    /// Whether the unit stands in the model; if not, it follows from the value.
    pub unit_is_written: bool,
    /// Documentation.
    pub doc: String,
    /// Where it is declared.
    pub span: Span,
}

/// One entry of `prefer`.
#[derive(Debug, Clone)]
pub struct Preference {
    /// As it is written, with the names of the components it stands in before it: `along.f`.
    pub name: String,
    /// The variable that shall stay independent: an effort or flow of a bond (co-energy of a storage, or common
    /// variable of a junction).
    pub symbol: Symbol,
    /// Where it stands.
    pub span: Span,
}

/// One entry of `causality`.
#[derive(Debug, Clone, Copy)]
pub struct ForcedCausality {
    /// The port.
    pub port: PortRef,
    /// What is asked of it.
    pub causality: PortCausality,
    /// Where it stands.
    pub span: Span,
}

/// Causality of a port of a storage or resistor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PortCausality {
    /// A storage that gives its co-energy variable.
    Integral,
    /// A storage that is given its co-energy variable.
    Derivative,
    /// A resistor with flow in, effort out.
    Resistive,
    /// A resistor with effort in, flow out.
    Conductive,
}

/// One `stroke`.
#[derive(Debug, Clone, Copy)]
pub struct ForcedStroke {
    /// The bond.
    pub bond: BondId,
    /// Whether the stroke sits at the `to` end (where the half arrow is); else at `from`.
    pub at_to: bool,
    /// Where it stands.
    pub span: Span,
}

/// One entry of `guess`: where the search of the start begins, never a condition on it.
#[derive(Debug, Clone, Copy)]
pub struct Guess {
    /// The integrated signal or stored quantity; that, up to a constant, which it repeats if it is not integrated itself.
    pub what: Expr,
    /// Where its search begins, in parameters, SI.
    pub value: Expr,
    /// Where it stands.
    pub span: Span,
}

/// A `constraint`, already built into the graph as a zero compliance behind (modulated) transformers.
#[derive(Debug, Clone)]
pub struct Constraint {
    /// Its name.
    pub name: String,
    /// The expression that vanishes: on displacements if `holonomic`, else on flows.
    pub expr: Expr,
    /// Whether it is on displacements.
    pub holonomic: bool,
    /// Whether its zero compliance and the bonds by which it acts are drawn: else it acts on the flows of its rate.
    pub drawn: bool,
    /// The element that stands for it.
    pub element: ElementId,
    /// The multiplier `name.e`, in effort symbols.
    pub multiplier: Expr,
    /// Where it stands.
    pub span: Span,
}

impl BondGraph {
    /// The same graph over another pool, in which all its expressions mean the same.
    pub fn with_exprs(&self, exprs: Exprs) -> BondGraph {
        BondGraph {
            name: self.name.clone(),
            doc: self.doc.clone(),
            exprs,
            variables: self.variables.clone(),
            elements: self.elements.clone(),
            bonds: self.bonds.clone(),
            common: self.common.clone(),
            parameters: self.parameters.clone(),
            inputs: self.inputs.clone(),
            signals: self.signals.clone(),
            held: self.held.clone(),
            clauses: self.clauses.clone(),
            lets: self.lets.clone(),
            outputs: self.outputs.clone(),
            point: self.point.clone(),
            preferences: self.preferences.clone(),
            forced_causality: self.forced_causality.clone(),
            forced_strokes: self.forced_strokes.clone(),
            guesses: self.guesses.clone(),
            constraints: self.constraints.clone(),
            set_valued: self.set_valued.clone(),
            shapes: self.shapes.clone(),
            time: self.time,
            repetitions: self.repetitions.clone(),
            cells: self.cells.clone(),
        }
    }
    /// The bond at a port.
    pub fn bond_of(&self, port: PortRef) -> BondId {
        self.elements[port.element].ports[port.port as usize].bond
    }
    /// What a port is called: its element, in fields and two-ports with the port: `body`, `gap.el`, `gear.in`.
    pub fn port_name(&self, port: PortRef) -> String {
        let element = &self.elements[port.element];
        element.part_name(port.port as usize)
    }
    /// The symbols (co-energy `z`, rate `X'`) of a storage port: (flow, effort) of an `I`, (effort, flow) of a `C`.
    ///
    /// `None` if the element is no storage.
    pub fn storage_symbols(&self, port: PortRef) -> Option<(Symbol, Symbol)> {
        let bond = &self.bonds[self.bond_of(port)];
        match self.elements[port.element].kind {
            Kind::Inertance(_) => Some((bond.flow, bond.effort)),
            Kind::Compliance(_) => Some((bond.effort, bond.flow)),
            _ => None,
        }
    }
    /// The ports of all elements but junctions and two-ports, in order: where the junction structure meets the rest.
    pub fn outer_ports(&self) -> Vec<PortRef> {
        let outer = self.elements.iter().filter(|(_, e)| !e.kind.is_inner());
        outer.flat_map(|(element, e)| (0..e.ports.len() as u32).map(move |port| PortRef { element, port })).collect()
    }
}

impl Kind {
    /// The equations of a wide two-port, but for terms that are zero whatever happens; none of other kinds.
    pub fn two_port_rows(&self) -> Vec<TwoPortRow> {
        let (matrix, gyrator) = match self {
            Kind::MatrixTransformer(matrix) => (matrix, false),
            Kind::MatrixGyrator(matrix) => (matrix, true),
            _ => return Vec::new(),
        };
        let (rows, columns) = (matrix.rows, matrix.columns);
        let nonzero = |term: &(usize, Expr)| term.1 != crate::algebra::ZERO;
        // A transformer gives the flows at `out` by those at `in`, a gyrator the efforts.
        let at_out = (0..rows).map(|row| TwoPortRow {
            port: columns + row,
            effort: gyrator,
            terms: (0..columns).map(|c| (c, matrix.at(row, c))).filter(nonzero).collect(),
            of_efforts: false,
        });
        let at_in = (0..columns).map(|column| TwoPortRow {
            port: column,
            effort: true,
            terms: (0..rows).map(|r| (columns + r, matrix.at(r, column))).filter(nonzero).collect(),
            of_efforts: !gyrator,
        });
        at_out.chain(at_in).collect()
    }

    /// The moduli of a two-port: one, or the entries of its matrix that are not zero whatever happens; none of other kinds.
    pub fn moduli(&self) -> Vec<Expr> {
        match self {
            Kind::Transformer { modulus } | Kind::Gyrator { modulus } => vec![*modulus],
            Kind::MatrixTransformer(m) | Kind::MatrixGyrator(m) => {
                m.entries.iter().copied().filter(|e| *e != crate::algebra::ZERO).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The laws of a resistor, or of a gyrator of one side.
    pub fn resistor_laws(&self) -> Option<&[ResistorLaw]> {
        match self {
            Kind::Resistor(laws) | Kind::SkewGyrator(laws) => Some(laws),
            _ => None,
        }
    }

    /// Whether it belongs to the junction structure: 0, 1, TF, GY.
    pub fn is_inner(&self) -> bool {
        matches!(
            self,
            Kind::Zero
                | Kind::One
                | Kind::Transformer { .. }
                | Kind::Gyrator { .. }
                | Kind::MatrixTransformer(_)
                | Kind::MatrixGyrator(_)
        )
    }
    /// Its keyword in the language.
    pub fn word(&self) -> &'static str {
        match self {
            Kind::Zero => "0",
            Kind::One => "1",
            Kind::EffortSource { .. } => "Se",
            Kind::FlowSource { .. } => "Sf",
            Kind::ZeroCompliance { .. } => "ZC",
            Kind::ResidualEffort { .. } => "rSe",
            Kind::ResidualFlow { .. } => "rSf",
            Kind::EffortDetector => "De",
            Kind::FlowDetector => "Df",
            Kind::Inertance(_) => "I",
            Kind::Compliance(_) => "C",
            Kind::Resistor(_) => "R",
            Kind::Transformer { .. } | Kind::MatrixTransformer(_) => "TF",
            Kind::Gyrator { .. } | Kind::MatrixGyrator(_) | Kind::SkewGyrator(_) => "GY",
        }
    }
}
