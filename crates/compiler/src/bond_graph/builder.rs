//! What is known while a graph is being built: symbols, dimensions, values of names.

use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::common::representatives;
use super::constraint::HeldDisplacement;
use super::dimension::{Clash, Dimensions, Quantity, Reason};
use super::faults::Faults;
use super::files::Files;
use super::flatten::{Flat, Part};
use super::repeat::Repeats;
use super::scope::{DeclId, Here};
use super::set_valued::SetValuedLaw;
use super::uses::Uses;
use super::vectors::Shaped;
use super::wire::Wiring;
use super::{BondId, ElementId, HeldId, HeldKind, InputId, Meaning, Parameter, ParameterId, PortRef, SignalId};
use crate::algebra::{Expr, Exprs, Facts, Symbol};
use crate::ast;
use crate::diagnostic::{Diagnostic, Sources, codes};
use crate::ids::{Id, Table};
use crate::span::Span;
use crate::unit::{Dimension as Dim, Domain, Unit};

/// A value that has been read: its expression in SI and its dimension.
#[derive(Debug, Clone)]
pub(super) struct Value {
    /// The expression.
    pub expr: Expr,
    /// Its dimension.
    pub quantity: Quantity,
    /// Whether it is a truth value.
    pub truth: bool,
}

impl Value {
    /// A number.
    pub fn number(expr: Expr, quantity: Quantity) -> Value {
        Value { expr, quantity, truth: false }
    }
}

/// What a symbol stands for while the graph is being built.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// What it stands for in the graph.
    Known(Meaning),
    /// Effort or flow of the bond of a constraint, which has no number before the constraint is built in.
    Reaction,
}

/// An input; its default is read after its symbol is known.
#[derive(Clone)]
pub(super) struct InputDraft {
    pub name: String,
    pub symbol: Symbol,
    pub default: Option<Expr>,
    pub unit: Option<Unit>,
    pub doc: String,
    pub span: Span,
}

/// An integrated signal; its rate is read after its symbol is known.
#[derive(Clone)]
pub(super) struct SignalDraft {
    pub name: String,
    pub symbol: Symbol,
    pub rate: Option<Expr>,
    pub initial: Option<Expr>,
    pub unit: Option<Unit>,
    pub span: Span,
}

/// A signal held from earlier times; its source is read after its symbol is known.
#[derive(Clone)]
pub(super) struct HeldDraft {
    pub name: String,
    pub symbol: Symbol,
    pub source: Option<Expr>,
    pub time: Expr,
    pub kind: HeldKind,
    pub unit: Option<Unit>,
    pub span: Span,
}

/// A named expression; its unit, where none is written, is that of its quantity when all laws have spoken.
pub(super) struct NamedDraft {
    pub name: String,
    pub value: Expr,
    pub unit: Option<Unit>,
    pub unit_is_written: bool,
    pub quantity: Quantity,
    pub doc: String,
    /// Where it is declared, and its number among the declarations, of which several may stand there.
    pub place: (Span, usize),
}

/// A signal whose rate is lowered when all names are known.
pub(super) struct OpenSignal<'a> {
    /// The signal in the table.
    pub id: SignalId,
    /// The state as written, if it is one.
    pub state: &'a ast::State,
    /// The declaration.
    pub decl: DeclId,
}

/// What a signal block reads, lowered when all names are known.
pub(super) struct OpenBlock<'a> {
    /// The input as written.
    pub input: &'a ast::Expr,
    /// Where names are looked up.
    pub here: Here,
    /// The part whose argument it is in, if it is in one.
    pub own: Option<usize>,
    /// Whether the part's own variables come first.
    pub law: bool,
    /// Name of what it stands in.
    pub owner: String,
    /// Where the value goes.
    pub goes: BlockInput,
}

/// Where the value of a block's input goes.
#[derive(Clone, Copy)]
pub(super) enum BlockInput {
    /// It is delayed or sampled.
    Held(HeldId),
    /// It is added, divided by an expression, to the rate of a signal.
    Rate(SignalId, Expr),
}

/// An equality of dimensions that is put off.
pub(super) struct PutOff {
    left: Quantity,
    right: Quantity,
    span: Span,
    /// What the two are, in words.
    what: String,
    /// Where it is asked for.
    here: Here,
    /// Whether they may differ by a time that is not written: `x' = 1 - x` of a signal without a unit.
    over_time: bool,
}

/// Effort and flow of a bond, with their dimensions.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    /// The effort.
    pub effort: Symbol,
    /// The flow.
    pub flow: Symbol,
    /// Dimension of the effort.
    pub effort_in: Rc<Quantity>,
    /// Dimension of the flow.
    pub flow_in: Rc<Quantity>,
}

/// A graph while it is being built.
pub(super) struct Builder<'a, 'f> {
    pub flat: &'f Flat<'a>,
    pub wiring: &'f Wiring,
    pub sources: &'f Sources,
    pub files: &'f dyn Files,
    pub exprs: Exprs,
    pub dims: Dimensions,
    /// Whether the model writes any unit: without one, nothing is said about units.
    pub units_written: bool,
    /// Equalities of dimensions that are put off.
    pub later: Option<Vec<PutOff>>,
    /// Where what is read stands.
    pub now: Here,
    pub faults: Faults,
    /// What is odd and no fault.
    pub warnings: Vec<Diagnostic>,
    /// The turns of repetitions, those of sums with them, and what shapes the model.
    pub repeats: Repeats<'a>,
    /// Whether something in the tree is missing, which the parser has said.
    pub incomplete: bool,
    /// Role and dimension of every symbol, by its number.
    pub roles: Vec<Option<(Role, Rc<Quantity>)>>,
    /// Variables of every bond.
    pub pairs: Vec<Pair>,
    /// The bond that stands for each junction, by part.
    pub common: Vec<Option<usize>>,
    /// Efforts of 0-junctions that differ from that of the bond which stands for them, since a constraint acts in it: by
    /// bond, with the junction.
    pub beyond: BTreeMap<usize, (usize, Symbol)>,
    /// Variables of the bond of every constraint.
    pub reactions: Vec<Pair>,
    /// Displacements that drawn zero compliances hold at zero.
    pub held_displacements: Vec<HeldDisplacement>,
    /// What sources carry, by their parts.
    pub carried: BTreeMap<usize, Expr>,
    /// Dimensions that coefficients have, by their letters, and that are not those of what is one over them.
    pub plain: Vec<(u8, Dim)>,
    /// Dimensions of the moduli of two-ports.
    pub moduli: BTreeMap<usize, Quantity>,
    /// Stored quantities of every port of every part.
    pub stored: Vec<Vec<Symbol>>,
    /// Values of the declarations; `None` before they are known and where they are at fault.
    pub values: Vec<Option<Value>>,
    /// Values of the declarations that are vectors or matrices.
    pub shapes: FxHashMap<DeclId, Shaped>,
    /// Functions: their formal arguments and value.
    pub functions: FxHashMap<DeclId, (Vec<Symbol>, Expr)>,
    pub parameters: Table<ParameterId, Parameter>,
    /// Values of the parameters, as numbers.
    pub numbers: Vec<f64>,
    pub inputs: Table<InputId, InputDraft>,
    pub signals: Table<SignalId, SignalDraft>,
    pub held: Table<HeldId, HeldDraft>,
    pub lets: Vec<NamedDraft>,
    pub outputs: Vec<NamedDraft>,
    pub open_signals: Vec<OpenSignal<'a>>,
    pub open_blocks: Vec<OpenBlock<'a>>,
    /// Rates of signals that expressions ask for, and the signal of each.
    pub rate_symbols: FxHashMap<Symbol, SignalId>,
    /// Integrated signals and stored quantities that an event changes: they go ways of their own.
    pub reset: BTreeSet<Symbol>,
    /// Set-valued laws that have been read.
    pub set_valued: Vec<SetValuedLaw>,
    /// Whether a bond carries no power.
    pub pseudo: Vec<bool>,
    /// Columns of the tables that were read.
    pub csv: FxHashMap<String, Option<Rc<super::csv::Table>>>,
    /// Property files that were read.
    pub property_files: FxHashMap<String, Option<Rc<super::properties::Properties>>>,
    /// Values that are text, and where the text stands.
    pub texts: FxHashMap<DeclId, (&'a str, Span)>,
    /// Where names are read.
    pub uses: Uses,
    pub time: Symbol,
}

impl<'a, 'f> Builder<'a, 'f> {
    /// A builder that knows the symbols of all bonds.
    pub fn new(flat: &'f Flat<'a>, wiring: &'f Wiring, sources: &'f Sources, files: &'f dyn Files) -> Self {
        let mut exprs = Exprs::default();
        exprs.reserve(2 * wiring.wires.len() + flat.parts.len());
        let time = exprs.symbol("t", Facts::default());
        let mut b = Builder {
            flat,
            wiring,
            sources,
            files,
            exprs,
            dims: Dimensions::default(),
            units_written: false,
            warnings: Vec::new(),
            later: None,
            now: Here::of(0),
            faults: Faults::default(),
            repeats: flat.repeats.clone(),
            incomplete: wiring.broken,
            roles: Vec::with_capacity(2 * wiring.wires.len() + flat.parts.len()),
            pairs: Vec::with_capacity(wiring.wires.len()),
            moduli: BTreeMap::new(),
            plain: Vec::new(),
            common: representatives(flat, wiring),
            beyond: BTreeMap::new(),
            reactions: Vec::new(),
            held_displacements: Vec::new(),
            carried: BTreeMap::new(),
            stored: Vec::with_capacity(flat.parts.len()),
            values: vec![None; flat.names.decls.len()],
            shapes: FxHashMap::default(),
            functions: FxHashMap::default(),
            parameters: Table::new(),
            numbers: Vec::new(),
            inputs: Table::new(),
            signals: Table::new(),
            held: Table::new(),
            lets: Vec::new(),
            outputs: Vec::new(),
            open_signals: Vec::new(),
            open_blocks: Vec::new(),
            rate_symbols: FxHashMap::default(),
            reset: BTreeSet::new(),
            set_valued: Vec::new(),
            pseudo: Vec::new(),
            csv: FxHashMap::default(),
            property_files: FxHashMap::default(),
            texts: FxHashMap::default(),
            uses: Uses::default(),
            time,
        };
        b.mean(time, Meaning::Time, Quantity::Any);
        b
    }

    /// Reports a fault.
    pub fn fault(&mut self, fault: Diagnostic) {
        self.faults.push(fault);
    }

    /// Says of the faults since `before` in which turn of a repetition they were found.
    pub fn met_in(&mut self, here: Here, before: usize) {
        if let Some(instance) = self.flat.names.outermost(here.scope) {
            self.faults.in_instance(before, instance);
        }
        let turn = self.flat.names.turn_around(here);
        if turn != 0 {
            self.faults.in_turn(before, || self.repeats.words(turn));
        }
    }

    /// Says what a symbol means.
    pub fn mean(&mut self, symbol: Symbol, meaning: Meaning, quantity: impl Into<Rc<Quantity>>) {
        self.play(symbol, Role::Known(meaning), quantity);
    }

    /// Says what the role of a symbol is.
    pub fn play(&mut self, symbol: Symbol, role: Role, quantity: impl Into<Rc<Quantity>>) {
        let at = symbol.0 as usize;
        if self.roles.len() <= at {
            self.roles.resize(at + 1, None);
        }
        self.roles[at] = Some((role, quantity.into()));
    }

    /// What a symbol means in the graph; `None` where that is not known yet.
    pub fn meaning(&self, symbol: Symbol) -> Option<Meaning> {
        match self.role(symbol)? {
            Role::Known(meaning) => Some(meaning),
            Role::Reaction => None,
        }
    }

    /// The role of a symbol.
    pub fn role(&self, symbol: Symbol) -> Option<Role> {
        self.roles.get(symbol.0 as usize).and_then(|m| m.as_ref()).map(|m| m.0)
    }

    /// The dimension of a symbol.
    pub fn quantity(&self, symbol: Symbol) -> Quantity {
        self.roles.get(symbol.0 as usize).and_then(|m| m.as_ref()).map_or(Quantity::Any, |m| Quantity::clone(&m.1))
    }

    /// A new symbol of that name, or of one like it if that is taken.
    pub fn fresh(&mut self, name: &str, facts: Facts) -> Symbol {
        self.exprs.fresh(name, facts)
    }

    /// A part of the flat model.
    pub fn part(&self, part: usize) -> &'f Part<'a> {
        &self.flat.parts[part]
    }

    /// The bond at a port of a part, unless the model is at fault there.
    pub fn wire_at(&self, part: usize, port: usize) -> Option<usize> {
        self.wiring.ports[part].get(port).copied().flatten().map(|(wire, _)| wire)
    }

    /// The bond whose variable stands for the common one of a junction.
    pub fn representative(&self, junction: usize) -> Option<usize> {
        self.common[junction]
    }

    /// Requires two quantities to have one dimension; reports a clash in general words. While values of names are read
    /// this is put off until the laws of the elements have spoken, so that a wrong output is not blamed on the elements.
    pub fn equal(&mut self, left: &Quantity, right: &Quantity, span: Span, what: &str) {
        self.require(left, right, span, what, false);
    }

    fn require(&mut self, left: &Quantity, right: &Quantity, span: Span, what: &str, over_time: bool) {
        if let Some(later) = &mut self.later {
            let (left, right, what) = (left.clone(), right.clone(), what.to_string());
            later.push(PutOff { left, right, span, what, here: self.now, over_time });
            return;
        }
        let reason = Reason { span, part: None };
        for clash in self.dims.equal(left, right, &reason) {
            self.clash(&clash, what, span);
        }
    }

    /// Requires the rate of a signal and the signal over time to have one dimension. Of a signal that nobody gives a unit, and
    /// whose rate reads it, numbers without a unit may stand for one over a time: whatever its unit is, its rate has it then.
    pub fn equal_over_time(&mut self, rate: &Quantity, own: &Quantity, span: Span, without_unit: bool) {
        let over_time = own.over(&Quantity::of(Dim::SECOND));
        self.require(rate, &over_time, span, "the rate and the signal over time", without_unit);
    }

    /// Takes back what was said about units in a model that writes none: `f = e + e^3` is a law of plain numbers there.
    pub fn forgive_unwritten_units(&mut self) {
        if !self.units_written {
            self.faults.retain(|fault| ![codes::U003, codes::U005, codes::U006].contains(&fault.code));
        }
    }

    /// Requires what was put off.
    pub fn settle_units(&mut self) {
        let (over_time, plain): (Vec<_>, Vec<_>) =
            self.later.take().unwrap_or_default().into_iter().partition(|put_off| put_off.over_time);
        for PutOff { left, right, span, what, here, over_time } in plain.into_iter().chain(over_time) {
            let hidden = Quantity::of(Dim::SECOND);
            if over_time && self.dims.put_in(&left.over(&right)) == hidden {
                continue;
            }
            let before = self.faults.len();
            self.equal(&left, &right, span, &what);
            self.met_in(here, before);
        }
    }

    /// Requires two quantities to have one dimension because the law of a part says so.
    pub fn equal_by_law(&mut self, left: &Quantity, right: &Quantity, part: usize) {
        let span = self.part(part).ast.span;
        let reason = Reason { span, part: Some(part) };
        for clash in self.dims.equal(left, right, &reason) {
            self.clash(&clash, "the two sides of its law", span);
        }
    }

    fn clash(&mut self, clash: &Clash, what: &str, here: Span) {
        if let Some((_, says, is, why)) = &clash.unknown
            && let Some(part) = clash.reason.part
        {
            return self.clash_of_parts(part, *says, *is, why);
        }
        let what = if clash.reason.span == here { what } else { "two quantities" };
        let title = format!("units do not agree: {} and {}", clash.left, clash.right);
        let mut d = Diagnostic::error(codes::U003, title, clash.reason.span, format!("{what} differ"));
        if let Some((_, _, is, why)) = &clash.unknown {
            d = d.also(why.span, format!("this made it {is}"));
        }
        self.fault(d.hint("units are optional: a number without one fits everywhere"));
    }

    /// Two elements that ask for different flows (or efforts) of one junction structure.
    fn clash_of_parts(&mut self, part: usize, says: Dim, is: Dim, why: &Reason) {
        let name = &self.part(part).name;
        let title = match why.part {
            Some(other) => format!("`{name}` and `{}` do not belong to one junction structure", self.part(other).name),
            None => format!("the units of `{name}` do not fit where it is bonded"),
        };
        let asks = match Domain::of_flow(says) {
            Some(_) => format!("asks for {}", flow_words(says)),
            None => format!("its units do not fit {}", flow_words(is)),
        };
        let d = Diagnostic::error(codes::U005, title, self.part(part).ast.span, asks)
            .also(why.span, format!("here the flow is {}", flow_words(is)))
            .note("effort times flow is a power, and all bonds between 0 and 1 share their units");
        let turning = Dim::of(0, 0, -1, 0);
        let moving = Dim::of(1, 0, -1, 0);
        let hint = match (says, is) {
            (a, b) if (a, b) == (turning, moving) || (a, b) == (moving, turning) => {
                "put a TF between rotation and translation (its modulus is a radius), or correct a unit"
            }
            _ => "put a TF or GY between the two domains, or correct a unit",
        };
        // Of the two that clash a two-port is the one to look at.
        let two_port = [Some(part), why.part].into_iter().flatten().find_map(|p| self.modulus_hint(p, says, is));
        self.fault(d.hint(two_port.unwrap_or_else(|| hint.to_owned())));
    }

    /// The number that an expression of parameters is; `None` if it reads anything else.
    pub fn value_of(&self, expr: Expr) -> Option<f64> {
        let mut known = true;
        let value = self.exprs.eval(expr, &mut |symbol| match self.meaning(symbol) {
            Some(Meaning::Parameter(id)) => self.numbers[id.index()],
            _ => {
                known = false;
                f64::NAN
            }
        });
        known.then_some(value)
    }

    /// The reference of a port.
    pub fn port_ref(part: usize, port: usize) -> PortRef {
        PortRef { element: ElementId::new(part), port: port as u32 }
    }

    /// The id of a bond.
    pub fn bond_id(wire: usize) -> BondId {
        BondId::new(wire)
    }
}

/// A flow in words: `a velocity in m/s`.
fn flow_words(dim: Dim) -> String {
    match Domain::of_flow(dim).map(|d| d.words()[1]) {
        Some((name, unit)) => {
            let article = if name.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
            format!("{article} {name} in {unit}")
        }
        None => format!("in {dim}"),
    }
}
