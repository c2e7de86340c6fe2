//! Equations to a program.

use super::angles::sums_of_angles;
use super::checks::{assumption, described, divisors, domain, names};
use super::dataflow::Dataflow;
use super::dependence::Dependence;
use super::kept::kept;
use super::lower::Lowering;
use super::op::Op;
use super::roots::free_sides;
use super::sharing::share;
use super::start::{is_linear, place_guesses};
use super::values::Reads;
use super::{
    Block, BlockId, ConditionId, HeldSignal, Implicit, Input, Matrix, Moved, Observed, Parameter, PivotGuard, Position,
    PositionRelation, Program, Relations, SMALL, StartCondition, StartGuess, State, Trigger, Value, events, triggers,
    verify,
};
use crate::algebra::{Expr, Function, Node, Symbol};
use crate::bond_graph::{self, BondGraph, ElementId, Meaning, ParameterId};
use crate::equations::{self, EquationStep, Equations, LinearBlock, NewtonBlock};
use crate::ids::{Id, Table};
use crate::sparse::SparseMatrix;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The program that evaluates the equations.
///
/// # Panics
/// If a step reads a symbol that is not given or defined before it: then the equations are not in evaluation order.
pub fn schedule(equations: &Equations) -> Program {
    let graph = &equations.graph;
    let Evaluated { exprs, wholes, needed } = evaluated(equations);
    let fixed: FxHashSet<Symbol> = graph.parameters.values().map(|p| p.symbol).collect();
    let varies = |e| graph.exprs.depends_on_any(e, &|s| !fixed.contains(&s));
    let sharing = share(&graph.exprs, &exprs, &varies);
    let sums = sums_of_angles(&graph.exprs, &exprs);
    let free = free_sides(&graph.exprs, &exprs, &wholes, &varies);
    let mut schedule = Schedule {
        graph,
        lower: Lowering::new(&graph.exprs, (sums, free), sharing),
        blocks: Table::new(),
        factored: FxHashMap::default(),
        pivot_guards: Vec::new(),
        nonsmooth: Vec::new(),
        positions: equations.positions.iter().map(|p| p.symbol).collect(),
    };
    let parameters = schedule.parameters();
    schedule.givens(equations);
    // What rates are made of comes first: where a value is equal to one that is there, that one is computed in any case.
    for wanted in [true, false] {
        let steps = equations.steps.iter().zip(&needed).filter(|(_, needed)| **needed == wanted);
        steps.for_each(|(step, _)| schedule.step(step));
    }
    schedule.finish(equations, parameters)
}

/// What the rates are evaluated from.
struct Evaluated {
    /// Every expression, and all below it.
    exprs: Vec<Expr>,
    /// Those that stand for themselves.
    wholes: Vec<Expr>,
    /// For each step whether it gives one of these.
    needed: Vec<bool>,
}

fn evaluated(equations: &Equations) -> Evaluated {
    let exprs = &equations.graph.exprs;
    let mut step_of: Vec<Option<u32>> = vec![None; exprs.symbol_count()];
    let mut gives = |symbol: Symbol, step: usize| step_of[symbol.0 as usize] = Some(step as u32);
    for (i, step) in equations.steps.iter().enumerate() {
        match step {
            EquationStep::Assign { symbol, .. } => gives(*symbol, i),
            EquationStep::Linear(block) => block.unknowns.iter().for_each(|&s| gives(s, i)),
            EquationStep::Newton(block) => {
                let NewtonBlock { unknowns, body, .. } = &**block;
                unknowns.iter().chain(body.iter().map(|b| &b.0)).for_each(|&s| gives(s, i));
            }
            EquationStep::Guard { .. } => {}
        }
    }
    let mut roots = equations.residuals.clone();
    let mut seen = vec![false; equations.steps.len()];
    let mut open: Vec<Symbol> = equations.states.iter().map(|s| s.rate).collect();
    let (mut read, mut met) = (0, FxHashSet::default());
    loop {
        while let Some(symbol) = open.pop() {
            let step = step_of[symbol.0 as usize].map(|i| i as usize);
            let Some(i) = step.filter(|&i| !std::mem::replace(&mut seen[i], true)) else { continue };
            match &equations.steps[i] {
                EquationStep::Assign { value, .. } => roots.push(*value),
                EquationStep::Linear(block) => roots.extend(block.matrix.entries().iter().chain(&block.right)),
                EquationStep::Newton(block) => {
                    let NewtonBlock { body, residuals, .. } = &**block;
                    roots.extend(body.iter().map(|b| &b.1).chain(residuals))
                }
                EquationStep::Guard { .. } => {}
            }
        }
        if read == roots.len() {
            return Evaluated { exprs: exprs.below(&roots, &|_| true), wholes: roots, needed: seen };
        }
        open = exprs.symbols_met(&roots[read..], &mut met);
        read = roots.len();
    }
}

/// An entry of a matrix: row, column, value.
type Entry = (usize, usize, Value);

struct Schedule<'a> {
    graph: &'a BondGraph,
    lower: Lowering<'a>,
    blocks: Table<BlockId, Block>,
    /// Matrices with the first solution of the linear block that factors them.
    factored: FxHashMap<Vec<Entry>, Value>,
    pivot_guards: Vec<PivotGuard>,
    /// Conditions inside Newton blocks, as seen from outside.
    nonsmooth: Vec<ConditionId>,
    /// Positions that are computed.
    positions: FxHashSet<Symbol>,
}

impl Schedule<'_> {
    /// Parameters, each after those its value reads.
    fn parameters(&mut self) -> Vec<Parameter> {
        let graph = self.graph;
        let index_of: FxHashMap<Symbol, ParameterId> = graph.parameters.iter().map(|(id, p)| (p.symbol, id)).collect();
        let mut defaults: Table<ParameterId, Option<Value>> = Table::filled(graph.parameters.len(), None);
        for id in graph.parameters.ids() {
            let mut open = vec![id];
            while let Some(&id) = open.last() {
                let parameter = &graph.parameters[id];
                let read = graph.exprs.symbols_of(parameter.value);
                let missing = read.iter().filter(|&&s| self.lower.defined(s).is_none()).map(|s| index_of[s]);
                let missing: Vec<ParameterId> = missing.collect();
                assert!(open.len() <= graph.parameters.len(), "parameters are given by each other in a circle");
                if !missing.is_empty() {
                    open.extend(missing);
                    continue;
                }
                open.pop();
                if defaults[id].is_none() {
                    defaults[id] = Some(self.lower.value(parameter.value));
                    let value = self.lower.op(Op::Parameter(id.0));
                    self.lower.define(parameter.symbol, value);
                }
            }
        }
        let named = graph.parameters.values().zip(defaults.values());
        named
            .map(|(p, &default)| Parameter {
                name: p.name.clone(),
                default: default.expect("every parameter has been given its value"),
                constant: p.constant,
                shapes: p.shapes,
                kind: p.kind,
                unit: p.unit.clone(),
            })
            .collect()
    }

    fn givens(&mut self, equations: &Equations) {
        let graph = self.graph;
        let mut give = |symbol: Symbol, op: Op, reads: Reads| {
            let value = self.lower.values.add(op, reads);
            self.lower.define(symbol, value);
        };
        give(graph.time, Op::Time, Reads::TIME);
        graph.inputs.iter().for_each(|(id, input)| give(input.symbol, Op::Input(id.0), Reads::STATE));
        graph.held.iter().for_each(|(id, held)| give(held.symbol, Op::Held(id.0), Reads::STATE));
        let conserved = equations.conserved.iter().enumerate();
        conserved.for_each(|(i, c)| give(c.symbol, Op::Conserved(i as u32), Reads::STATE));
        let states = equations.unknowns().into_iter().enumerate();
        states.for_each(|(i, s)| give(s, Op::State(i as u32), Reads::STATE));
        let free = equations.states.iter().enumerate().filter(|(_, s)| equations.is_free(s));
        free.for_each(|(i, s)| give(s.rate, Op::Rate(i as u32), Reads::STATE));
    }

    fn step(&mut self, step: &EquationStep) {
        match step {
            EquationStep::Assign { symbol, value } => {
                let value = self.lower.value(*value);
                self.lower.define(*symbol, value);
            }
            EquationStep::Linear(block) => {
                let LinearBlock { unknowns, matrix, right, elements } = &**block;
                self.linear(unknowns, matrix, right, elements)
            }
            EquationStep::Newton(block) => {
                let NewtonBlock { unknowns, body, residuals, elements } = &**block;
                self.newton(unknowns, body, residuals, elements)
            }
            EquationStep::Guard { pivot, elements } => {
                let read: Vec<Symbol> = self.graph.exprs.symbols_of(*pivot).into_iter().collect();
                // Where nothing is evaluated that a divisor reads, nothing is divided by it.
                if read.iter().any(|&s| self.lower.defined(s).is_none()) {
                    return;
                }
                let elements = self.concerned(elements, &read);
                divisors(&self.graph.exprs, *pivot).into_iter().for_each(|factor| self.guard(factor, &elements));
            }
        }
    }

    fn linear(&mut self, unknowns: &[Symbol], matrix: &SparseMatrix<Expr>, right: &[Expr], elements: &[ElementId]) {
        let zero = self.lower.constant(0.0);
        let mut rows: Vec<Vec<(usize, Value)>> = Vec::with_capacity(matrix.size());
        for row in matrix.rows() {
            let entries = row.map(|(column, &e)| (column, self.lower.value(e)));
            rows.push(entries.filter(|entry| entry.1 != zero).collect());
        }
        let matrix = Arc::new(Matrix::new(SparseMatrix::new(rows)));
        let right = right.iter().map(|&e| self.lower.value(e)).collect();
        let elements = self.concerned(elements, unknowns);
        let entries: Vec<Entry> =
            matrix.values.pattern().places().zip(matrix.values.entries()).map(|((i, j), &e)| (i, j, e)).collect();
        let symmetric = matrix.values.is_symmetric();
        let shared = self.factored.get(&entries).copied();
        let block = self.blocks.push(Block::Linear { matrix, right, shared, elements });
        self.solved(block, unknowns);
        // Symmetric ones are solved where they stand, by fewer operations than it takes to fetch their factors.
        if shared.is_none() && !symmetric && unknowns.len() <= SMALL {
            let solution = self.lower.defined(unknowns[0]).expect("it was solved for");
            self.factored.insert(entries, solution);
        }
    }

    fn newton(&mut self, unknowns: &[Symbol], body: &[(Symbol, Expr)], residuals: &[Expr], elements: &[ElementId]) {
        let block = BlockId::new(self.blocks.len());
        let from = self.lower.values.len();
        let guesses = self.lower.begin_newton(block, unknowns);
        for &(symbol, value) in body {
            let value = self.lower.value(value);
            self.lower.define(symbol, value);
        }
        let values: Vec<Value> = residuals.iter().map(|&e| self.lower.value(e)).collect();
        let zero = self.lower.values.number(0.0);
        let columns = self.lower.values.derivatives(&values, &guesses, from);
        let mut rows: Vec<Vec<(usize, Value)>> = vec![Vec::new(); values.len()];
        for (column, entries) in columns.into_iter().enumerate() {
            let moving = entries.into_iter().filter(|entry| entry.1 != zero);
            moving.for_each(|(row, value)| rows[row].push((column, value)));
        }
        let jacobian = Arc::new(Matrix::new(SparseMatrix::new(rows)));
        let piecewise = self.lower.end_newton();
        let (unknown_names, elements) = (self.names_of(unknowns), self.concerned(elements, unknowns));
        self.blocks.push(Block::Newton { residuals: values, jacobian, unknowns: unknown_names, elements });
        self.solved(block, unknowns);
        for &(symbol, value) in body {
            let value = self.lower.value(value);
            self.lower.define(symbol, value);
        }
        if piecewise {
            let known = self.lower.conditions.len();
            residuals.iter().for_each(|&e| {
                self.lower.value(e);
            });
            self.nonsmooth.extend(self.lower.conditions.ids().skip(known));
        }
    }

    /// The elements of a block or of a divisor, or if there are none but junctions and two-ports its variables.
    fn concerned(&self, elements: &[ElementId], variables: &[Symbol]) -> String {
        let listed = names(self.graph, elements);
        if listed.is_empty() { self.names_of(variables).join(", ") } else { listed }
    }

    fn names_of(&self, variables: &[Symbol]) -> Vec<String> {
        variables.iter().map(|&s| self.graph.exprs.name(s).to_string()).collect()
    }

    fn solved(&mut self, block: BlockId, unknowns: &[Symbol]) {
        let values = &self.lower.values;
        // Which of several positions it is does not follow from parameters alone.
        let from_start = unknowns.iter().any(|s| self.positions.contains(s));
        let least = if from_start { Reads::STATE } else { Reads::PARAMETERS };
        let reads = self.blocks[block].reads().fold(least, |all, v| all.with(values.reads(v)));
        let reads = self.blocks[block].reads_of_solution(reads.without(Reads::GUESS));
        for (i, &symbol) in unknowns.iter().enumerate() {
            let value = self.lower.values.add(Op::Solution(block, i as u32), reads);
            self.lower.define(symbol, value);
        }
    }

    fn guard(&mut self, factor: Expr, elements: &str) {
        let pivot = self.lower.value(factor);
        let scale = match self.graph.exprs.node(factor) {
            Node::Add(terms) => {
                let mut sum = self.lower.constant(0.0);
                for &term in terms {
                    let term = self.lower.value(term);
                    let size = self.lower.op(Op::Call(Function::Abs, term));
                    sum = self.lower.add(sum, size);
                }
                sum
            }
            Node::Call(Function::Sin | Function::Cos, _) => self.lower.constant(1.0),
            _ => self.lower.constant(0.0),
        };
        let fixed = |s: &Symbol| matches!(self.graph.variables.get(s).map(|v| v.meaning), Some(Meaning::Parameter(_)));
        let divisor = described(&self.graph.exprs, factor, &|s| !fixed(s));
        self.pivot_guards.push(PivotGuard { pivot, scale, elements: elements.to_string(), divisor });
    }

    /// Lowers what is read from outside, finds out what follows from how all of it is read, and puts the program together.
    fn finish(mut self, equations: &Equations, parameters: Vec<Parameter>) -> Program {
        let graph = self.graph;
        let states = self.states(equations);
        let implicit = implicit(&self.lower, equations);
        let variables: BTreeMap<Symbol, Value> =
            graph.variables.keys().filter_map(|&s| Some((s, self.lower.defined(s)?))).collect();
        let momenta = equations.momenta.iter().map(|m| (m.speed, self.lower.value(m.sum))).collect();
        let inputs = self.inputs();
        let held = self.held();
        let clauses = events::clauses(&mut self.lower, equations);
        let set_valued = events::set_valued(equations);
        let jumps = events::jumps(&mut self.lower, equations);
        let observed = self.observed(equations);
        let conditions = self.start_conditions(equations);
        let guesses = self.start_guesses(equations);
        let lower = &mut self.lower;
        let domains = equations.domains.iter().filter_map(|d| domain(lower, graph, d)).collect();
        let assumed = equations.assumptions.iter();
        let assumptions = assumed.filter_map(|a| assumption(lower, graph, &self.pivot_guards, a)).collect();
        let relations = relations(lower, graph, &equations.relations);
        let positions = positions(lower, equations);
        let position_relations = position_relations(lower, equations);
        let tables: Vec<_> = (0..graph.exprs.table_count()).map(|i| graph.exprs.table1d(Id::new(i)).clone()).collect();

        let Schedule { lower, blocks, pivot_guards, nonsmooth, .. } = self;
        let steep = lower.is_steep();
        let (values, found) = lower.into_values();
        let flow = Dataflow { values: &values, blocks: &blocks, parameters: &parameters };
        let rates: Vec<Value> = states.iter().map(|s| s.rate).collect();
        let residuals = conditions.iter().chain(&guesses).map(|vanishing| vanishing.residual);
        let wanted: Vec<Value> = rates.iter().copied().chain(residuals).collect();
        let count = states.len() as u32;
        let first_position = count + equations.conserved.len() as u32;
        let at_start = Dependence::new(flow, count, (first_position, &positions), &wanted);
        // What rates read is the same where no position is an unknown of the start.
        let own = (!positions.is_empty()).then(|| Dependence::new(flow, count, (first_position, &[]), &rates));
        let dependence = own.as_ref().unwrap_or(&at_start);
        let becomes = clauses.iter().filter(|c| matches!(c.trigger, Trigger::Becomes(_))).map(|c| c.trigger.value());
        let leaps = jumps.iter().filter(|jumps| jumps.leaps).flat_map(events::Jumps::values);
        let sources = held.iter().map(|h| h.source);
        let stored = stored(graph).filter_map(|s| variables.get(&s).copied());
        let integrated = rates.iter().copied().chain(sources).chain(becomes).chain(leaps).chain(stored).collect();
        let program = Program {
            name: graph.name.clone(),
            kept: kept(flow, equations, &momenta),
            jumps: jumps.map(|jumps| events::with_unknowns(jumps, flow, equations)),
            clauses,
            set_valued,
            start: start(equations, &conditions, &at_start),
            guesses: placed(equations, &guesses, &at_start, |v| is_linear(&values, &positions, v)),
            conditions: triggers::conditions(flow, &tables, &found, integrated, &nonsmooth),
            dependence: rates.iter().map(|&rate| dependence.states_of(rate)).collect(),
            tracked: equations.tracked.iter().copied().chain(equations.algebraic.iter().map(|a| a.tracked)).collect(),
            conserved: equations.conserved.iter().map(|c| c.name.clone()).collect(),
            replaced: equations.conserved.iter().map(|c| c.replaced).collect(),
            exchanges: equations.exchanges.clone(),
            states,
            positions,
            implicit,
            variables,
            momenta,
            inputs,
            held,
            observed,
            domains,
            assumptions,
            relations,
            position_relations,
            unkept_relations: equations.unkept_relations.clone(),
            tables,
            parameters,
            blocks,
            pivot_guards,
            steep,
            values,
        };
        debug_assert_eq!(verify(&program), Ok(()), "{}", program.name);
        program
    }

    fn states(&mut self, equations: &Equations) -> Vec<State> {
        let lower = &mut self.lower;
        let mut residuals = equations.residuals.iter();
        let mut residual =
            |lower: &mut Lowering| lower.value(*residuals.next().expect("as many equations as unknowns"));
        let mut states = Vec::new();
        for s in &equations.states {
            let rate = match equations.is_free(s) {
                true => residual(lower),
                false => lower.defined(s.rate).unwrap_or_else(|| panic!("no step defines the rate of {}", s.name)),
            };
            states.push(State { name: s.name.clone(), rate, unit: s.unit.clone() });
        }
        for a in &equations.algebraic {
            states.push(State { name: a.name.clone(), rate: residual(lower), unit: a.unit.clone() });
        }
        states
    }

    fn inputs(&mut self) -> Vec<Input> {
        let graph = self.graph;
        let input = |i: &bond_graph::Input| Input {
            name: i.name.clone(),
            default: self.lower.value(i.default),
            unit: i.unit.clone(),
            deduced: graph.variables.get(&i.symbol).and_then(|v| v.unit.clone()),
        };
        graph.inputs.values().map(input).collect()
    }

    fn held(&mut self) -> Vec<HeldSignal> {
        let held = |h: &bond_graph::HeldSignal| HeldSignal {
            name: h.name.clone(),
            source: self.lower.value(h.source),
            time: self.lower.value(h.time),
            kind: h.kind,
        };
        self.graph.held.values().map(held).collect()
    }

    fn observed(&mut self, equations: &Equations) -> Vec<Observed> {
        let observed = |o: &equations::Observed| Observed {
            name: o.name.clone(),
            value: o.value.clone().map(|e| self.lower.value(e)),
            unit: o.unit.clone(),
            kind: o.kind,
            default: o.default,
        };
        equations.observed.iter().map(observed).collect()
    }

    fn start_conditions(&mut self, equations: &Equations) -> Vec<Vanishing> {
        let of = |c: &equations::InitialCondition| Vanishing {
            residual: self.lower.value(c.residual),
            asked: self.lower.value(c.value),
        };
        equations.conditions.iter().map(of).collect()
    }

    fn start_guesses(&mut self, equations: &Equations) -> Vec<Vanishing> {
        let of = |g: &equations::Guess| Vanishing {
            asked: self.lower.value(g.value),
            residual: self.lower.value(g.residual),
        };
        equations.guesses.iter().map(of).collect()
    }
}

/// What vanishes at the start, and the value asked for there.
struct Vanishing {
    residual: Value,
    asked: Value,
}

/// What storages hold: where it jumps is an event, also if it is given and no rate reads it.
fn stored(graph: &BondGraph) -> impl Iterator<Item = Symbol> + '_ {
    graph.variables.iter().filter(|(_, v)| matches!(v.meaning, Meaning::Stored(_))).map(|(&symbol, _)| symbol)
}

/// Start conditions with what they read.
fn start(equations: &Equations, values: &[Vanishing], dependence: &Dependence) -> Vec<StartCondition> {
    let condition = |(c, v): (&equations::InitialCondition, &Vanishing)| StartCondition {
        name: c.name.clone(),
        residual: v.residual,
        asked: v.asked,
        firm: c.firm,
        weak: c.weak,
        reads: dependence.unknowns_of(v.residual).to_vec(),
        span: c.span,
    };
    equations.conditions.iter().zip(values).map(condition).collect()
}

/// Guesses in the order in which they are placed.
fn placed(
    equations: &Equations,
    values: &[Vanishing],
    dependence: &Dependence,
    is_linear: impl Fn(Value) -> bool,
) -> Vec<StartGuess> {
    let reads: Vec<&[u32]> = values.iter().map(|v| dependence.unknowns_of(v.residual)).collect();
    let guess = |(i, unknown): (usize, u32)| StartGuess {
        name: equations.guesses[i].name.clone(),
        asked: values[i].asked,
        residual: values[i].residual,
        unknown,
        reads: reads[i].to_vec(),
        span: equations.guesses[i].span,
    };
    let linear: Vec<bool> = values.iter().map(|v| is_linear(v.residual)).collect();
    place_guesses(&reads, &linear).into_iter().map(guess).collect()
}

/// What the equations are, where they are no explicit rates.
fn implicit(lower: &Lowering, equations: &Equations) -> Option<Implicit> {
    if equations.residuals.is_empty() {
        return None;
    }
    let algebraic = equations.algebraic.iter().map(|_| false);
    let free = equations.states.iter().zip(0u32..).filter(|(s, _)| equations.is_free(s));
    let carried = free.filter_map(|(_, i)| {
        let bond = equations.carried(i as usize)?;
        Some((i, bond, lower.defined(bond)?))
    });
    Some(Implicit {
        explicit: equations.states.iter().map(|s| !equations.is_free(s)).chain(algebraic.clone()).collect(),
        differential: equations.states.iter().map(|_| true).chain(algebraic).collect(),
        indices: equations.indices.clone(),
        carried: carried.collect(),
    })
}

/// The positions that iterations determine.
fn positions(lower: &mut Lowering, equations: &Equations) -> Vec<Position> {
    let x = &equations.graph.exprs;
    let position = |p: &equations::Position| {
        let value = lower.defined(p.symbol).expect("a step defines every position");
        let Op::Solution(block, unknown) = lower.values.op(value) else { unreachable!("it is found by an iteration") };
        let known = x.symbols_of(p.rate).iter().all(|&s| lower.defined(s).is_some());
        let rate = known.then(|| lower.value(p.rate));
        Position { name: p.name.clone(), symbol: p.symbol, rate, value, block, unknown }
    };
    equations.positions.iter().filter(|p| p.by_iteration).map(position).collect()
}

/// The relations between positions, with the numbers of the states that they read.
fn position_relations(lower: &mut Lowering, equations: &Equations) -> Vec<PositionRelation> {
    let number = |s: Symbol| equations.states.iter().position(|state| state.symbol == s);
    let relation = |r: &equations::PositionRelation| PositionRelation {
        value: lower.value(r.value),
        vanishes: r.vanishes,
        slopes: r.slopes.iter().filter_map(|&(s, e)| Some((number(s)? as u32, lower.value(e)))).collect(),
        told: r.told.clone(),
    };
    equations.position_relations.iter().map(relation).collect()
}

/// The rows of which all is evaluated.
fn relations(lower: &mut Lowering, graph: &BondGraph, of: &crate::equations::Relations) -> Relations {
    let known = |lower: &Lowering, e: Expr| graph.exprs.symbols_of(e).iter().all(|&s| lower.defined(s).is_some());
    let mut rows = Vec::new();
    for row in &of.rows {
        let quantities = row.quantity.iter().all(|(factor, x)| known(lower, *factor) && lower.defined(*x).is_some());
        if !quantities || !row.by.iter().all(|b| known(lower, b.1)) {
            continue;
        }
        let quantity = |lower: &mut Lowering, (factor, x): (Expr, Symbol)| {
            (lower.value(factor), lower.defined(x).expect("what is known has a value"))
        };
        rows.push(Moved {
            quantity: row.quantity.iter().map(|&q| quantity(lower, q)).collect(),
            by: row.by.iter().map(|&(drive, c)| (drive, lower.value(c))).collect(),
        });
    }
    Relations { rows, drives: of.drives, unwritten: of.unwritten }
}
