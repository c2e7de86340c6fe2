//! Equations to a program.

use super::angles::sums_of_angles;
use super::lower::Lowering;
use super::op::Op;
use super::sharing::share;
use super::values::Reads;
use super::{
    Assumption, Block, BlockId, Condition, ConditionId, ConditionKind, EventTrigger, HeldSignal, Holds, Implicit,
    Input, LawDomain, Matrix, Moved, Observed, Parameter, PivotGuard, Program, Relations, StartCondition, StartGuess,
    State, Value, first_of, verify,
};
use crate::algebra::{Expr, Exprs, Function, Interpolation, MINUS_ONE, Node, PlainNames, Symbol, ascii};
use crate::bond_graph::{BondGraph, ElementId, Kind, Meaning, ParameterId};
use crate::equations::{EquationStep, Equations, Momentum};
use crate::ids::{Id, Table};
use crate::sparse::SparseMatrix;
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::Arc;

/// The program that evaluates the equations.
///
/// # Panics
/// If a step reads a symbol that is not given or defined before it: then the equations are not in evaluation order.
pub fn schedule(equations: &Equations) -> Program {
    let graph = &equations.graph;
    let exprs = evaluated(equations);
    let fixed: FxHashSet<Symbol> = graph.parameters.values().map(|p| p.symbol).collect();
    let varies = |e| graph.exprs.depends_on_any(e, &|s| !fixed.contains(&s));
    let sharing = share(&graph.exprs, &exprs, &varies);
    let mut schedule = Schedule {
        graph,
        lower: Lowering::new(&graph.exprs, sums_of_angles(&graph.exprs, &exprs), sharing),
        blocks: Table::new(),
        pivot_guards: Vec::new(),
        kinks: Vec::new(),
    };
    let parameters = schedule.parameters();
    schedule.givens(equations);
    equations.steps.iter().for_each(|step| schedule.step(step));
    schedule.finish(equations, parameters)
}

/// Every expression that the rates are evaluated from, and all below it.
fn evaluated(equations: &Equations) -> Vec<Expr> {
    let exprs = &equations.graph.exprs;
    let mut step_of: FxHashMap<Symbol, usize> = FxHashMap::default();
    for (i, step) in equations.steps.iter().enumerate() {
        match step {
            EquationStep::Assign { symbol, .. } => _ = step_of.insert(*symbol, i),
            EquationStep::Linear { unknowns, .. } => unknowns.iter().for_each(|&s| _ = step_of.insert(s, i)),
            EquationStep::Newton { unknowns, body, .. } => {
                unknowns.iter().chain(body.iter().map(|b| &b.0)).for_each(|&s| _ = step_of.insert(s, i));
            }
            EquationStep::Guard { .. } => {}
        }
    }
    let mut roots = equations.residuals.clone();
    let mut seen = vec![false; equations.steps.len()];
    let mut open: Vec<Symbol> = equations.states.iter().map(|s| s.rate).collect();
    let mut read = 0;
    loop {
        while let Some(symbol) = open.pop() {
            let Some(&i) = step_of.get(&symbol).filter(|&&i| !std::mem::replace(&mut seen[i], true)) else { continue };
            match &equations.steps[i] {
                EquationStep::Assign { value, .. } => roots.push(*value),
                EquationStep::Linear { matrix, right, .. } => roots.extend(matrix.entries().iter().chain(right)),
                EquationStep::Newton { body, residuals, .. } => {
                    roots.extend(body.iter().map(|b| &b.1).chain(residuals))
                }
                EquationStep::Guard { .. } => {}
            }
        }
        if read == roots.len() {
            return exprs.below(&roots, &|_| true);
        }
        roots[read..].iter().for_each(|&e| open.extend(exprs.symbols_of(e).iter()));
        read = roots.len();
    }
}

/// A divisor whose text is longer is described in messages by what it reads.
const SHORT: usize = 60;

struct Schedule<'a> {
    graph: &'a BondGraph,
    lower: Lowering<'a>,
    blocks: Table<BlockId, Block>,
    pivot_guards: Vec<PivotGuard>,
    /// Conditions inside Newton blocks, as seen from outside.
    kinks: Vec<ConditionId>,
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
            EquationStep::Linear { unknowns, matrix, right, elements } => {
                self.linear(unknowns, matrix, right, elements)
            }
            EquationStep::Newton { unknowns, body, residuals, elements } => {
                self.newton(unknowns, body, residuals, elements)
            }
            EquationStep::Guard { pivot, elements } => {
                let read: Vec<Symbol> = self.graph.exprs.symbols_of(*pivot).into_iter().collect();
                let elements = self.concerned(elements, &read);
                divisors(&self.graph.exprs, *pivot).into_iter().for_each(|factor| self.guard(factor, &elements));
            }
        }
    }

    fn linear(&mut self, unknowns: &[Symbol], matrix: &SparseMatrix<Expr>, right: &[Expr], elements: &[ElementId]) {
        let matrix = Arc::new(Matrix::new(matrix.map(|&e| self.lower.value(e))));
        let right = right.iter().map(|&e| self.lower.value(e)).collect();
        let elements = self.concerned(elements, unknowns);
        let block = self.blocks.push(Block::Linear { matrix, right, shared: None, elements });
        self.solved(block, unknowns);
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
        let columns = self.lower.values.derivatives(&values, &guesses, from);
        let entry = |row: usize, column: usize| (column, columns[column][row]);
        let zero = self.lower.values.number(0.0);
        let moves = |e: &(usize, Value)| e.1 != zero;
        let rows = (0..values.len()).map(|row| (0..columns.len()).map(move |column| entry(row, column)).filter(moves));
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
            self.kinks.extend(self.lower.conditions.ids().skip(known));
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
        let reads = self.blocks[block].reads().fold(Reads::PARAMETERS, |all, v| all.with(values.reads(v)));
        for (i, &symbol) in unknowns.iter().enumerate() {
            let value = self.lower.values.add(Op::Solution(block, i as u32), reads.without(Reads::GUESS));
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
        let divisor = self.described(factor);
        self.pivot_guards.push(PivotGuard { pivot, scale, elements: elements.to_string(), divisor });
    }

    /// An expression as text if it is short, else what varies in it.
    fn described(&self, e: Expr) -> String {
        let exprs = &self.graph.exprs;
        let text = ascii(exprs, e, &PlainNames(exprs));
        if text.len() <= SHORT {
            return text;
        }
        let fixed = |s: &Symbol| matches!(self.graph.variables.get(s).map(|v| v.meaning), Some(Meaning::Parameter(_)));
        let varies: Vec<Symbol> = exprs.symbols_of(e).into_iter().filter(|s| !fixed(s)).collect();
        format!("an expression in {}", first_of(&self.names_of(&varies).join(", ")))
    }

    fn finish(mut self, equations: &Equations, parameters: Vec<Parameter>) -> Program {
        let graph = self.graph;
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
        let implicit = implicit(lower, equations);
        let graph_variables = graph.variables.keys().copied();
        let variables = graph_variables.filter_map(|s| Some((s, lower.defined(s)?))).collect();
        let inputs = graph.inputs.values();
        let held = graph.held.values();
        let mut program = Program {
            name: graph.name.clone(),
            states,
            implicit,
            variables,
            tracked: equations.tracked.iter().copied().chain(equations.algebraic.iter().map(|a| a.tracked)).collect(),
            momenta: equations.momenta.iter().map(|m| (m.speed, lower.value(m.sum))).collect(),
            kept: Vec::new(),
            conserved: equations.conserved.iter().map(|c| c.name.clone()).collect(),
            inputs: inputs
                .map(|i| Input {
                    name: i.name.clone(),
                    default: lower.value(i.default),
                    unit: i.unit.clone(),
                    deduced: graph.variables.get(&i.symbol).and_then(|v| v.unit.clone()),
                })
                .collect(),
            held: held
                .map(|h| HeldSignal {
                    name: h.name.clone(),
                    source: lower.value(h.source),
                    time: lower.value(h.time),
                    kind: h.kind,
                })
                .collect(),
            observed: equations
                .observed
                .iter()
                .map(|o| Observed {
                    name: o.name.clone(),
                    value: o.value.clone().map(|e| lower.value(e)),
                    unit: o.unit.clone(),
                    kind: o.kind,
                    default: o.default,
                })
                .collect(),
            start: equations
                .conditions
                .iter()
                .map(|c| StartCondition {
                    name: c.name.clone(),
                    residual: lower.value(c.residual),
                    asked: lower.value(c.value),
                    firm: c.firm,
                    weak: c.weak,
                    reads: Vec::new(),
                    span: c.span,
                })
                .collect(),
            guesses: equations
                .guesses
                .iter()
                .map(|g| StartGuess {
                    name: g.name.clone(),
                    asked: lower.value(g.value),
                    residual: lower.value(g.residual),
                    unknown: 0,
                    reads: Vec::new(),
                    span: g.span,
                })
                .collect(),
            domains: equations.domains.iter().filter_map(|d| domain(lower, graph, d)).collect(),
            assumptions: equations
                .assumptions
                .iter()
                .filter_map(|a| assumption(lower, graph, &self.pivot_guards, a))
                .collect(),
            relations: relations(lower, graph, &equations.relations),
            tables: (0..graph.exprs.table_count()).map(|i| graph.exprs.table1d(Id::new(i)).clone()).collect(),
            parameters,
            blocks: self.blocks,
            pivot_guards: self.pivot_guards,
            conditions: self.lower.conditions,
            values: self.lower.values,
            dependence: Vec::new(),
        };
        program.find_dependence();
        program.place_guesses();
        find_causes(&mut program, &self.kinks);
        program.kept = kept(&program, equations);
        debug_assert_eq!(verify(&program), Ok(()), "{}", program.name);
        program
    }
}

/// Speeds that are states although a source that can jump moves storages that follow them.
fn kept(program: &Program, equations: &Equations) -> Vec<(u32, Value)> {
    if program.implicit.is_some() {
        return Vec::new();
    }
    // The state is the variable itself, or what its storage holds.
    let held = |m: &Momentum| stored_with(&equations.graph, m.speed);
    let of_state = |m: &Momentum| {
        let held = held(m);
        equations.tracked.iter().position(|s| *s == m.speed || Some(*s) == held)
    };
    // A sum that is itself the state keeps its value anyway.
    let is_sum = |i: usize| equations.meanings.iter().any(|(s, _)| *s == equations.states[i].symbol);
    let moved = equations.momenta.iter().filter(|m| m.moved);
    let kept: Vec<(u32, Value)> =
        moved.filter_map(|m| Some((of_state(m).filter(|&i| !is_sum(i))? as u32, program.momenta[&m.speed]))).collect();
    let sums: Vec<Value> = kept.iter().map(|k| k.1).collect();
    let live = program.live(&sums, false);
    let jumps = |op: Op| op.condition().is_some() || matches!(op, Op::Held(_));
    let jumps = program.values.iter().any(|(v, op)| live[v.index()] && jumps(op));
    if jumps { kept } else { Vec::new() }
}

/// What the storage holds whose co-energy variable this is.
fn stored_with(graph: &BondGraph, variable: Symbol) -> Option<Symbol> {
    graph.outer_ports().into_iter().find_map(|port| {
        let (z, _) = graph.storage_symbols(port)?;
        match &graph.elements[port.element].kind {
            Kind::Inertance(s) | Kind::Compliance(s) if z == variable => Some(s.stored[port.port as usize]),
            _ => None,
        }
    })
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

fn names(graph: &BondGraph, elements: &[ElementId]) -> String {
    let names: Vec<&str> = elements.iter().map(|&e| graph.elements[e].name.as_str()).collect();
    names.join(", ")
}

/// A domain, if all that it reads is evaluated.
fn domain(lower: &mut Lowering, graph: &BondGraph, domain: &crate::equations::LawDomain) -> Option<LawDomain> {
    let name = |s: Symbol| graph.exprs.name(s).to_string();
    let defined = graph.exprs.symbols_of(domain.argument).iter().all(|&s| lower.defined(s).is_some());
    defined.then(|| LawDomain {
        given: name(domain.symbol),
        elements: names(graph, &domain.elements),
        argument: lower.value(domain.argument),
        kind: domain.kind,
        asked: domain.asked.and_then(|s| Some((name(s), lower.defined(s)?))),
        limit: domain.limit.map(|limit| lower.value(limit)),
    })
}

/// An assumption with the value that tells whether it holds; none if it is a divisor that is guarded as it is.
fn assumption(
    lower: &mut Lowering,
    graph: &BondGraph,
    pivot_guards: &[PivotGuard],
    of: &crate::algebra::Assumption,
) -> Option<Assumption> {
    let exprs = &graph.exprs;
    let says = match of.holds {
        Holds::Zero => "is zero",
        Holds::NotZero => "is not zero",
        Holds::Positive => "is above zero",
        Holds::NotNegative => "is not below zero",
    };
    let text = ascii(exprs, of.expr, &PlainNames(exprs));
    let what = if text.len() <= SHORT {
        text
    } else {
        let read: Vec<&str> = exprs.symbols_of(of.expr).into_iter().map(|s| exprs.name(s)).collect();
        format!("an expression in {}", first_of(&read.join(", ")))
    };
    let value = lower.value(of.expr);
    if of.holds == Holds::NotZero && pivot_guards.iter().any(|w| w.pivot == value) {
        return None;
    }
    let sum = matches!(of.holds, Holds::Zero | Holds::NotZero) && !matches!(exprs.node(of.expr), Node::Symbol(_));
    let scale = if sum { magnitude(lower, exprs, of.expr) } else { value };
    Some(Assumption { value, scale, holds: of.holds, text: format!("{what} {says}") })
}

/// What a sum of products comes to if nothing in it cancels.
fn magnitude(lower: &mut Lowering, exprs: &Exprs, e: Expr) -> Value {
    match exprs.node(e) {
        Node::Add(terms) => {
            let mut sum = lower.constant(0.0);
            for &term in terms {
                let size = magnitude(lower, exprs, term);
                sum = lower.add(sum, size);
            }
            sum
        }
        Node::Mul(factors) => {
            let sized = factors.iter().filter(|&&factor| factor != MINUS_ONE);
            let sizes = sized.map(|&factor| magnitude(lower, exprs, factor)).collect::<Vec<_>>();
            let product = sizes.into_iter().reduce(|product, size| lower.op(Op::Mul(product, size)));
            product.expect("a product has factors")
        }
        Node::Number(n) => lower.constant(n.to_f64().abs()),
        _ => {
            let value = lower.value(e);
            lower.op(Op::Call(Function::Abs, value))
        }
    }
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
    Relations { rows, drives: of.drives }
}

/// The factors of a divisor that vary or could vanish.
fn divisors(exprs: &Exprs, pivot: Expr) -> Vec<Expr> {
    match exprs.node(pivot) {
        Node::Mul(factors) => factors.iter().flat_map(|&f| divisors(exprs, f)).collect(),
        Node::Pow(base, exponent) if exprs.is_number(*exponent).is_some_and(|n| n.signum() > 0) => {
            divisors(exprs, *base)
        }
        Node::Pow(_, exponent) if exprs.is_number(*exponent).is_some() => Vec::new(),
        Node::Number(n) if !n.is_zero() => Vec::new(),
        _ => vec![pivot],
    }
}

/// How a value depends on time while conditions are held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Degree {
    Constant,
    Line,
    Curve,
}

fn find_causes(program: &mut Program, kinks: &[ConditionId]) {
    let degrees = degrees(program);
    let mut triggers: Vec<EventTrigger> = Vec::new();
    for condition in program.conditions.values() {
        let reads = program.values.reads(condition.operand);
        triggers.push(match degrees[condition.operand.index()] {
            _ if reads.includes(Reads::STATE) => EventTrigger::RecordedOnly,
            Degree::Curve => EventTrigger::CurvedTime,
            _ => EventTrigger::LinearTime,
        });
    }
    let shown = |trigger: &mut EventTrigger| {
        if *trigger == EventTrigger::RecordedOnly {
            *trigger = EventTrigger::State;
            return true;
        }
        false
    };
    kinks.iter().for_each(|c| {
        shown(&mut triggers[c.index()]);
    });
    let mut roots: Vec<Value> = program.states.iter().map(|s| s.rate).collect();
    roots.extend(program.held.iter().map(|h| h.source));
    loop {
        let events = program.conditions.iter().filter(|(id, _)| triggers[id.index()] == EventTrigger::State);
        roots.extend(events.map(|(_, c)| c.operand));
        let live = program.live(&roots, false);
        let used = program.values.iter().filter(|(v, _)| live[v.index()]).filter_map(|(_, op)| op.condition());
        // Not short-circuited: all of them are marked.
        if used.filter(|c| shown(&mut triggers[c.index()])).count() == 0 {
            break;
        }
    }
    program.conditions.iter_mut().for_each(|(id, condition): (ConditionId, &mut Condition)| {
        condition.trigger = triggers[id.index()];
    });
}

fn degrees(program: &Program) -> Vec<Degree> {
    let mut degrees: Vec<Degree> = Vec::with_capacity(program.values.len());
    for (value, op) in program.values.iter() {
        let of = |v: Value| degrees[v.index()];
        let degree = match op {
            _ if program.values.reads(value) == Reads::PARAMETERS => Degree::Constant,
            Op::Time => Degree::Line,
            Op::Sign(..) | Op::Floor(..) => Degree::Constant,
            Op::Neg(a) => of(a),
            Op::Add(a, b) | Op::Sub(a, b) => of(a).max(of(b)),
            Op::Mul(a, b) if of(a) == Degree::Constant => of(b),
            Op::Mul(a, b) | Op::Div(a, b) if of(b) == Degree::Constant => of(a),
            Op::Select(c, a, b) if of(c) == Degree::Constant => of(a).max(of(b)),
            Op::Table(t, Some(_), a) if program.tables[t as usize].interpolation() != Interpolation::Cubic => of(a),
            Op::TableSlope(t, Some(_), _) if program.tables[t as usize].interpolation() != Interpolation::Cubic => {
                Degree::Constant
            }
            Op::Guess(..) | Op::Solution(..) => Degree::Curve,
            Op::Input(_) | Op::Held(_) | Op::Conserved(_) | Op::State(_) => Degree::Curve,
            _ => {
                let mut most = Degree::Constant;
                op.for_each_operand(|v| most = most.max(of(v)));
                if most == Degree::Constant { most } else { Degree::Curve }
            }
        };
        degrees.push(degree);
    }
    degrees
}

impl ConditionKind {
    /// Number of switching functions that it needs.
    pub fn switches(self) -> usize {
        match self {
            ConditionKind::Sign => 1,
            ConditionKind::Floor | ConditionKind::Piece(_) => 2,
        }
    }
}
