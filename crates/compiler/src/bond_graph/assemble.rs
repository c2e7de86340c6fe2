//! The graph, put together in one expression when all its parts are ready.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::builder::{Builder, HeldDraft, NamedDraft, Role};
use super::dimension::Quantity;
use super::flatten::Word;
use super::repeat::Turn;
use super::scope::{DeclId, Here, ScopeId, TurnId};
use super::set_valued::SetValuedLaw;
use super::structure::Structure;
use super::{
    BondGraph, Cell, CellId, Clause, Constraint, ForcedCausality, ForcedStroke, Guess, HeldId, HeldSignal, Input,
    InputId, IntegratedSignal, Meaning, Named, Parameter, ParameterId, Preference, Repetition, RepetitionId, Shape,
    SignalId, Variable,
};
use crate::algebra::{Expr, Node, Symbol};
use crate::ast::Header;
use crate::ids::{Id, Map, Table};
use crate::span::Span;
use crate::unit::{Dimension, Unit};

/// The cell of a turn of a repetition.
pub(super) fn cell_of(turn: TurnId) -> Option<CellId> {
    turn.checked_sub(1).map(CellId::new)
}

/// What a model is called.
#[derive(Default)]
pub(super) struct Title {
    pub name: String,
    pub doc: String,
}

impl Title {
    /// The name and documentation in the model line.
    pub fn of(header: &Header) -> Title {
        let doc = header.doc.as_ref().map_or(String::new(), |d| d.text.clone());
        Title { name: header.name.text.clone(), doc }
    }
}

/// What a model asks of its causality and of its start.
pub(super) struct Asked {
    pub guesses: Vec<Guess>,
    pub preferences: Vec<Preference>,
    pub forced_causality: Vec<ForcedCausality>,
    pub forced_strokes: Vec<ForcedStroke>,
}

/// What has expressions over the symbols of the graph.
pub(super) struct Laws {
    pub structure: Structure,
    pub signals: Table<SignalId, IntegratedSignal>,
    pub held: Table<HeldId, HeldSignal>,
    pub clauses: Vec<Clause>,
    pub lets: Vec<Named>,
    pub outputs: Vec<Named>,
    pub constraints: Vec<Constraint>,
    pub set_valued: Vec<SetValuedLaw>,
    pub shapes: Vec<Shape>,
}

/// The declarations whose units their variables have.
struct Tables<'t> {
    parameters: &'t Table<ParameterId, Parameter>,
    inputs: &'t Table<InputId, Input>,
    signals: &'t Table<SignalId, IntegratedSignal>,
    held: &'t Table<HeldId, HeldSignal>,
}

impl Laws {
    /// Visits every expression, always in the same order, those of guesses last.
    fn for_each_expr(&mut self, guesses: &mut [Guess], visit: &mut dyn FnMut(&mut Expr)) {
        for (_, element) in self.structure.elements.iter_mut() {
            element.kind.for_each_expr(visit);
            element.carries.iter_mut().for_each(&mut *visit);
        }
        for (_, signal) in self.signals.iter_mut() {
            visit(&mut signal.rate);
            signal.initial.iter_mut().for_each(&mut *visit);
        }
        self.held.iter_mut().for_each(|(_, h)| visit(&mut h.source));
        self.clauses.iter_mut().for_each(|c| c.for_each_expr(visit));
        self.lets.iter_mut().chain(&mut self.outputs).for_each(|n| visit(&mut n.value));
        self.constraints.iter_mut().for_each(|c| visit(&mut c.expr));
        self.set_valued.iter_mut().for_each(|law| law.for_each_expr(visit));
        self.shapes.iter_mut().flat_map(Shape::values_mut).for_each(|n| visit(&mut n.value));
        for guess in guesses {
            visit(&mut guess.what);
            visit(&mut guess.value);
        }
    }
}

impl Builder<'_, '_> {
    /// The graph. `rates` and `repeated` are what takes the place of rates that expressions ask for, and of signals that
    /// storages keep already. `None` if something is missing, which has been said.
    pub fn assemble(
        mut self,
        title: &Title,
        mut asked: Asked,
        mut laws: Laws,
        [rates, repeated]: [&BTreeMap<Symbol, Expr>; 2],
    ) -> Option<BondGraph> {
        let inputs = self.whole_inputs()?;
        self.fix_parameters();
        let parameters = std::mem::take(&mut self.parameters);
        let (repetitions, cells) = self.cells();
        let tables = Tables { parameters: &parameters, inputs: &inputs, signals: &laws.signals, held: &laws.held };
        let variables = self.variables(&tables);
        self.replace_symbols(&mut laws, &mut asked.guesses, rates);
        self.replace_symbols(&mut laws, &mut asked.guesses, repeated);
        let graph = BondGraph {
            name: title.name.clone(),
            doc: title.doc.clone(),
            exprs: self.exprs,
            variables,
            elements: laws.structure.elements,
            bonds: laws.structure.bonds,
            common: laws.structure.common,
            parameters,
            inputs,
            signals: laws.signals,
            held: laws.held,
            clauses: laws.clauses,
            lets: laws.lets,
            outputs: laws.outputs,
            point: None,
            preferences: asked.preferences,
            forced_causality: asked.forced_causality,
            forced_strokes: asked.forced_strokes,
            guesses: asked.guesses,
            constraints: laws.constraints,
            set_valued: laws.set_valued,
            shapes: laws.shapes,
            time: self.time,
            repetitions,
            cells,
        };
        Some(if graph.set_valued.is_empty() { graph } else { graph.in_mode(&graph.mode()) })
    }

    /// Parameters that shape the model cannot change when it is compiled.
    fn fix_parameters(&mut self) {
        let shaping: Vec<DeclId> = self.repeats.shaping(&self.flat.names).collect();
        for decl in shaping {
            let Some(value) = &self.values[decl] else { continue };
            let Node::Symbol(symbol) = *self.exprs.node(value.expr) else { continue };
            if let Some(Meaning::Parameter(id)) = self.meaning(symbol) {
                let value = self.exprs.float(self.numbers[id.index()]);
                let parameter = &mut self.parameters[id];
                (parameter.value, parameter.constant, parameter.shapes) = (value, true, true);
            }
        }
    }

    /// All repetitions and their turns, those of sums left out.
    fn cells(&self) -> (Table<RepetitionId, Repetition>, Table<CellId, Cell>) {
        let names = &self.flat.names;
        let mut repetitions: Table<RepetitionId, Repetition> = Table::new();
        let mut known: FxHashMap<(Span, ScopeId), RepetitionId> = FxHashMap::default();
        let mut cell = |turn: &Turn<'_>| {
            let span = turn.variable.span;
            let repetition = *known.entry((span, turn.scope)).or_insert_with(|| {
                let within = names.scopes[turn.scope].prefix.trim_end_matches('.').to_string();
                repetitions.push(Repetition { variable: turn.variable.text.clone(), within, span })
            });
            let outer = cell_of(names.turn_around(Here { scope: turn.scope, turn: turn.outer }));
            Cell { repetition, value: turn.value, outer }
        };
        let cells = self.flat.repeats.all().map(&mut cell).collect();
        (repetitions, cells)
    }

    fn whole_inputs(&mut self) -> Option<Table<InputId, Input>> {
        let drafts = std::mem::take(&mut self.inputs).into_values();
        let whole = drafts.map(|i| {
            let default = i.default?;
            Some(Input { name: i.name, symbol: i.symbol, default, unit: i.unit, doc: i.doc, span: i.span })
        });
        whole.collect()
    }

    /// The signals held from earlier times; `None` if the source of one is missing.
    pub fn whole_held(&mut self) -> Option<Table<HeldId, HeldSignal>> {
        let drafts = std::mem::take(&mut self.held).into_values();
        let whole = drafts.map(|h| {
            let HeldDraft { name, symbol, source, time, kind, unit, span } = h;
            Some(HeldSignal { name, symbol, source: source?, time, kind, unit, span })
        });
        whole.collect()
    }

    /// Named expressions in the order of the text, each with the unit that is written or follows from its value.
    pub fn whole_named(&self, mut drafts: Vec<NamedDraft>) -> Vec<Named> {
        drafts.sort_by_key(|d| d.place);
        let unit = |quantity: &Quantity| self.dims.value(quantity).filter(|_| self.units_written).map(Unit::si);
        let whole = drafts.into_iter().map(|d| {
            let NamedDraft { name, value, unit: written, unit_is_written, quantity, doc, place: (span, _) } = d;
            Named { name, value, unit: written.or_else(|| unit(&quantity)), unit_is_written, doc, span }
        });
        whole.collect()
    }

    /// Puts expressions in the place of symbols, everywhere.
    fn replace_symbols(&mut self, laws: &mut Laws, guesses: &mut [Guess], map: &BTreeMap<Symbol, Expr>) {
        if map.is_empty() {
            return;
        }
        let mut roots = Vec::new();
        laws.for_each_expr(guesses, &mut |e| roots.push(*e));
        let new = self.exprs.substitute_all(&roots, map);
        let mut new = new.into_iter();
        laws.for_each_expr(guesses, &mut |e| *e = new.next().unwrap_or(*e));
    }

    /// What every symbol means, with its unit.
    fn variables(&self, tables: &Tables) -> Map<Symbol, Variable> {
        let mut units = BTreeMap::new();
        let mut variable = |meaning: Meaning, quantity: &Quantity| {
            let unit = self.written_unit(meaning, tables).or_else(|| self.shown_unit(meaning, quantity, &mut units));
            Variable { meaning, unit }
        };
        let known = self.roles.iter().enumerate().filter_map(|(at, role)| match role {
            Some((Role::Known(meaning), quantity)) => Some((Symbol(at as u32), variable(*meaning, quantity))),
            _ => None,
        });
        let mut all = Map::with_capacity(self.roles.len());
        all.extend(known);
        all
    }

    /// The SI unit of a quantity, if it is known. Speeds and angles of rotation are shown with their radians: `rad/s` and
    /// `rad` where efforts are torques. `units` remembers what was made before.
    fn shown_unit(
        &self,
        meaning: Meaning,
        quantity: &Quantity,
        units: &mut BTreeMap<(Dimension, bool), Unit>,
    ) -> Option<Unit> {
        let dim = self.dims.value(quantity).filter(|_| self.units_written)?;
        let turning = self.is_turning(meaning);
        let stored = matches!(meaning, Meaning::Stored(_));
        let name = match (turning, dim) {
            (true, Dimension::NONE) => Some("rad"),
            (true, _) => Some("rad/s"),
            // What is stored is never a torque: heat in a pseudo bond graph.
            (false, Dimension::JOULE) if stored => Some("J"),
            _ => None,
        };
        let make = || name.and_then(|name| Unit::parse(name).ok()).unwrap_or_else(|| Unit::si(dim));
        let turning = turning || (stored && dim == Dimension::JOULE);
        Some(units.entry((dim, turning)).or_insert_with(make).clone())
    }

    /// Whether it is the flow of a bond, or the displacement of a C, whose effort is a torque.
    fn is_turning(&self, meaning: Meaning) -> bool {
        let wire = match meaning {
            Meaning::Flow(bond) => Some(bond.index()),
            Meaning::Stored(port) if self.part(port.element.index()).word == Word::C => {
                self.wire_at(port.element.index(), port.port as usize)
            }
            _ => None,
        };
        let pair = wire.and_then(|w| self.pairs.get(w).filter(|_| !self.pseudo[w]));
        pair.is_some_and(|pair| self.dims.value(&pair.effort_in) == Some(Dimension::JOULE))
    }

    /// The SI unit of what a declaration gave a unit: it keeps its radians.
    fn written_unit(&self, meaning: Meaning, tables: &Tables) -> Option<Unit> {
        let unit = match meaning {
            Meaning::Parameter(id) => tables.parameters[id].unit.as_ref(),
            Meaning::Input(id) => tables.inputs[id].unit.as_ref(),
            Meaning::Signal(id) => tables.signals[id].unit.as_ref(),
            Meaning::Held(id) => tables.held[id].unit.as_ref(),
            Meaning::Time => return Some(Unit::si(Dimension::SECOND)),
            _ => None,
        };
        unit.map(Unit::to_si_unit)
    }
}
