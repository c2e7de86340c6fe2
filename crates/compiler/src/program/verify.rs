//! What holds of all programs and routines that this stage gives; a breach is our fault, not the modeller's.

use super::op::Op;
use super::values::Reads;
use super::{
    Arg, Block, BlockId, Code, ConditionKind, EventTrigger, Method, Program, Solve, Step, Target, Trigger, Value,
};
use crate::ids::Id;
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;

/// Checks the invariants of a [`Program`]: every value reads values before it and knows on what it depends; what reads a
/// guess belongs to one Newton block, which alone reads it; blocks are square and share the factors of equal matrices; all
/// numbers of states, parameters, tables and conditions are those of something.
///
/// # Errors
/// The first breach, in words for us.
pub fn verify(program: &Program) -> Result<(), String> {
    values(program)?;
    guesses(program)?;
    program.blocks.ids().try_for_each(|block| square(program, block))?;
    conditions(program)?;
    tables_of_states(program)?;
    positions(program)?;
    outside(program)
}

fn all(holds: bool, breach: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(breach()) }
}

/// Operands before values, and what these depend on.
fn values(p: &Program) -> Result<(), String> {
    for (value, op) in p.values.iter() {
        let mut before = true;
        let mut reads = given_reads(op);
        let mut visit = |v: Value| {
            before &= v < value;
            reads = reads.with(p.values.reads(v.min(value)));
        };
        op.for_each_operand(&mut visit);
        if let Op::Solution(block, _) = op {
            all(block.index() < p.blocks.len(), || format!("{value:?} is an unknown of no block"))?;
            p.blocks[block].reads().for_each(&mut visit);
            reads = p.blocks[block].reads_of_solution(reads.without(Reads::GUESS));
            if p.positions.iter().any(|position| position.block == block) {
                reads = reads.with(Reads::STATE);
            }
        }
        all(before, || format!("{value:?} reads what comes after it"))?;
        all(names_something(p, op), || format!("{value:?} is {op:?}, which there is not"))?;
        let same = p.values.reads(value) == reads;
        all(same, || format!("{value:?} depends on {reads:?}, not on {:?}", p.values.reads(value)))?;
    }
    Ok(())
}

/// On what a given depends.
fn given_reads(op: Op) -> Reads {
    match op {
        Op::Time => Reads::TIME,
        Op::Guess(..) => Reads::GUESS,
        Op::Input(_) | Op::Held(_) | Op::Conserved(_) | Op::State(_) | Op::Rate(_) => Reads::STATE,
        _ => Reads::PARAMETERS,
    }
}

/// Whether the numbers that are fixed in an operation are those of something.
fn names_something(p: &Program, op: Op) -> bool {
    let below = |number: u32, count: usize| (number as usize) < count;
    let condition = op.condition().is_none_or(|c| c.index() < p.conditions.len());
    condition
        && match op {
            Op::Parameter(i) => below(i, p.parameters.len()),
            Op::Input(i) => below(i, p.inputs.len()),
            Op::Held(i) => below(i, p.held.len()),
            Op::Conserved(i) => below(i, p.conserved.len()),
            Op::State(i) | Op::Rate(i) => below(i, p.states.len()),
            Op::Table(i, ..) | Op::TableSlope(i, ..) | Op::TableCurvature(i, ..) => below(i, p.tables.len()),
            Op::Guess(block, i) | Op::Solution(block, i) => {
                block.index() < p.blocks.len() && below(i, p.blocks[block].size())
            }
            _ => true,
        }
}

/// What reads a guess belongs to one Newton block.
fn guesses(p: &Program) -> Result<(), String> {
    let mut owner: FxHashMap<Value, BlockId> = FxHashMap::default();
    for (value, op) in p.values.iter().filter(|(v, _)| p.values.reads(*v).includes(Reads::GUESS)) {
        let mut owners: Vec<BlockId> = Vec::new();
        match op {
            Op::Guess(block, _) => owners.push(block),
            _ => op.for_each_operand(|v| owners.extend(owner.get(&v))),
        }
        owners.dedup();
        let [block] = owners[..] else { return Err(format!("{value:?} reads guesses of {owners:?}")) };
        let newton = matches!(p.blocks[block], Block::Newton { .. });
        all(newton, || format!("{value:?} reads a guess of {block:?}, which is linear"))?;
        owner.insert(value, block);
    }
    for (id, block) in p.blocks.iter() {
        let own = block.reads().all(|v| owner.get(&v).is_none_or(|&of| of == id));
        all(own, || format!("{id:?} reads a guess of another block"))?;
    }
    Ok(())
}

/// As many rows as columns; factors that are shared are those of the same matrix.
fn square(p: &Program, id: BlockId) -> Result<(), String> {
    let (matrix, n) = (p.blocks[id].matrix(), p.blocks[id].size());
    let rows = matrix.values.size();
    all(rows == n, || format!("the matrix of {id:?} has {rows} rows for {n} unknowns"))?;
    let inside = matrix.values.pattern().columns().iter().all(|&column| (column as usize) < n);
    all(inside, || format!("{id:?} has entries outside of its matrix"))?;
    match &p.blocks[id] {
        Block::Newton { unknowns, .. } => all(unknowns.len() == n, || format!("{id:?} has other names than unknowns")),
        Block::Linear { shared: None, .. } => Ok(()),
        Block::Linear { shared: Some(solution), .. } => {
            let of = match p.values.op(*solution) {
                Op::Solution(of, _) if of < id => Some(&p.blocks[of]),
                _ => None,
            };
            let same = matches!(of, Some(Block::Linear { matrix: other, .. }) if std::sync::Arc::ptr_eq(other, matrix) || other == matrix);
            all(same, || format!("{id:?} shares factors of another matrix"))
        }
    }
}

fn conditions(p: &Program) -> Result<(), String> {
    for (id, condition) in p.conditions.iter() {
        let known = condition.operand.index() < p.values.len();
        all(known, || format!("{id:?} is about no value"))?;
        let guess = p.values.reads(condition.operand).includes(Reads::GUESS);
        all(!guess, || format!("{id:?} holds a guess"))?;
        let timed = matches!(condition.trigger, EventTrigger::LinearTime | EventTrigger::CurvedTime);
        let of_state = p.values.reads(condition.operand).includes(Reads::STATE);
        all(timed != of_state, || format!("{id:?} is moved by something else"))?;
        if let ConditionKind::Piece(table) = condition.kind {
            all((table as usize) < p.tables.len(), || format!("{id:?} is about no table"))?;
        }
    }
    Ok(())
}

/// What there is one of for each state, and numbers of states.
fn tables_of_states(p: &Program) -> Result<(), String> {
    let n = p.states.len();
    all(p.tracked.len() == n, || format!("{} variables tell {n} states", p.tracked.len()))?;
    all(p.dependence.len() == n, || format!("what {} rates read is known of {n}", p.dependence.len()))?;
    let ascending = |reads: &[u32], most: usize| {
        reads.windows(2).all(|pair| pair[0] < pair[1]) && reads.last().is_none_or(|&last| (last as usize) < most)
    };
    all(p.dependence.iter().all(|reads| ascending(reads, n)), || "rates read states that there are not".into())?;
    let unknowns = p.start_unknowns();
    let reads = p.start.iter().map(|c| &c.reads).chain(p.guesses.iter().map(|g| &g.reads));
    all(reads.into_iter().all(|r| ascending(r, unknowns)), || "starts read unknowns that there are not".into())?;
    let placed = p.guesses.iter().all(|g| g.reads.contains(&g.unknown));
    all(placed, || "a guess places what it does not read".into())?;
    let places: BTreeSet<u32> = p.guesses.iter().map(|g| g.unknown).collect();
    all(places.len() == p.guesses.len(), || "two guesses place one unknown".into())?;
    all(p.kept.iter().all(|k| (k.0 as usize) < n), || "a state that jumps is none".into())?;
    p.implicit.as_ref().map_or(Ok(()), |of| {
        let lengths = [of.explicit.len(), of.differential.len(), of.indices.len()];
        all(lengths == [n; 3], || format!("{lengths:?} are told of {n} unknowns"))
    })
}

/// Positions are the solutions of Newton blocks, all of each.
fn positions(p: &Program) -> Result<(), String> {
    for position in &p.positions {
        let newton = matches!(p.blocks[position.block], Block::Newton { .. });
        let told = p.values.op(position.value) == Op::Solution(position.block, position.unknown);
        all(newton && told, || format!("{} is no solution of an iteration", position.name))?;
        let count = p.positions.iter().filter(|other| other.block == position.block).count();
        all(count == p.blocks[position.block].size(), || {
            format!("{} has unknowns that are no positions", position.name)
        })?;
    }
    Ok(())
}

/// What events change is there, and there are as many balances as unknowns.
fn events(p: &Program) -> Result<(), String> {
    let impulses = p.jumps.as_ref().map_or(0, |j| j.impulses.len());
    for action in p.clauses.iter().flat_map(|c| &c.actions) {
        let fine = match action.target {
            Target::Discrete(i) => p.held.get(i as usize).is_some_and(|h| h.kind.is_discrete()),
            Target::Signal(i) => (i as usize) < p.states.len(),
            Target::Moved { impulse, .. } => (impulse as usize) < impulses,
            Target::HeldByBranch => p.set_valued.iter().any(|law| law.released.is_some()),
        };
        all(fine, || format!("an event changes {:?}, which there is not", action.target))?;
    }
    let Some(jumps) = &p.jumps else { return Ok(()) };
    let (rows, unknowns) = (jumps.balances.len(), jumps.unknowns.len());
    all(rows == unknowns, || format!("{rows} balances at events for {unknowns} unknowns"))?;
    let inside = jumps.balances.iter().flatten().all(|t| (t.0 as usize) < jumps.stored.len());
    all(inside, || "a balance is about storages that there are not".into())
}

/// What is read from outside reads no guess, and what must be known before a run reads parameters alone.
fn outside(p: &Program) -> Result<(), String> {
    events(p)?;
    let known = |v: Value| v.index() < p.values.len();
    for value in p.wanted_anywhere() {
        let fine = known(value) && !p.values.reads(value).includes(Reads::GUESS);
        all(fine, || format!("{value:?} is wanted and no value of its own"))?;
    }
    let carried = p.implicit.iter().flat_map(|of| of.carried.iter().map(|c| c.2));
    let told = p
        .position_relations
        .iter()
        .flat_map(|r| r.values())
        .chain(p.relations.values())
        .chain(p.variables.values().copied())
        .chain(p.kept.iter().map(|k| k.1));
    for value in told.chain(carried) {
        all(known(value), || format!("{value:?} is told and no value"))?;
    }
    let parameters = p.parameters.iter().map(|p| p.default).chain(p.inputs.iter().map(|i| i.default));
    let periods = p.clauses.iter().filter(|c| matches!(c.trigger, Trigger::Every(_))).map(|c| c.trigger.value());
    let parameters = parameters.chain(p.held.iter().map(|h| h.time)).chain(periods);
    let mut parameters = parameters.chain(p.assumptions.iter().flat_map(|a| [a.value, a.scale]));
    match parameters.find(|&v| p.values.reads(v) != Reads::PARAMETERS) {
        Some(v) => Err(format!("{v:?} varies where parameters alone may be read")),
        None => Ok(()),
    }
}

impl Code {
    /// Checks that each local is defined once, in order, before it is read, and that what stands before is there.
    ///
    /// # Errors
    /// The first breach, in words for us.
    pub fn verify(&self) -> Result<(), String> {
        self.check(&|a| !matches!(a, Arg::Outer(_) | Arg::Guess(_)))
    }

    /// The same; `there` says whether what is no local is there.
    fn check(&self, there: &dyn Fn(Arg) -> bool) -> Result<(), String> {
        let mut defined = 0;
        let known = |a: Arg, defined: u32| match a {
            Arg::Local(local) => local.0 < defined,
            _ => there(a),
        };
        for step in &self.steps {
            let mut unknown = None;
            step.for_each_read(|a| unknown = unknown.or((!known(a, defined)).then_some(a)));
            unknown.map_or(Ok(()), |a| Err(format!("{a:?} is read before it is defined")))?;
            if let Step::Solve(solve) = step {
                solve.check()?;
            }
            for out in step.defines() {
                all(out.0 == defined, || format!("{out:?} is defined after {defined} others"))?;
                defined += 1;
            }
        }
        all(defined as usize == self.values.len(), || {
            format!("{} locals of which {defined} are defined", self.values.len())
        })?;
        let missing = self.outputs.iter().find(|a| !known(**a, defined));
        missing.map_or(Ok(()), |a| Err(format!("{a:?} is wanted and not defined")))
    }
}

impl Solve {
    fn check(&self) -> Result<(), String> {
        let n = self.unknowns.len();
        let places = match &self.method {
            Method::Linear { shared: None, matrix, right } => (matrix.len(), right.len()),
            Method::Linear { right, .. } => (self.pattern.len(), right.len()),
            Method::Newton { outer, code } => {
                code.check(&|a| match a {
                    Arg::Outer(i) => (i as usize) < outer.len(),
                    Arg::Guess(i) => (i as usize) < n,
                    _ => true,
                })?;
                (code.outputs.len().saturating_sub(n), n)
            }
        };
        all(places == (self.pattern.len(), n), || format!("{:?} has {places:?} places for {n} unknowns", self.block))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ast::parse;
    use crate::bond_graph::{NoFiles, elaborate};
    use crate::causal_graph::assign_causality;
    use crate::diagnostic::Sources;
    use crate::equations::{Form, derive_equations};
    use crate::program::{Bits, Condition, Local, Matrix, schedule};
    use crate::sparse::SparseMatrix;
    use std::sync::Arc;

    /// A Newton block between two capacitors, with a table of time.
    fn bridge() -> Program {
        let text = "model Bridge\nparam r = 2, b = 3\nSf:source(sin(t)) -> 0:n1 -> C:C1(1)\nn1 -> R:R1(r) \n\
                    n1 -> 1:s -> 0:n2 -> R:D(f = b*(e + e^3))\ns -> R:G(f = b*(e + e^3))\nn2 -> R:E(f = e + e^5)\n";
        let mut sources = Sources::new();
        let file = sources.add("bridge.bond", text);
        let graph = elaborate(parse(text, file).ast, sources, &NoFiles, &[]).graph.expect("a bond graph");
        let causal = assign_causality(&graph).expect("causality");
        schedule(&derive_equations(&causal, Form::Minimal).expect("equations"))
    }

    fn newton(p: &Program) -> BlockId {
        let newton = |(_, block): &(BlockId, &Block)| matches!(block, Block::Newton { .. });
        p.blocks.iter().find(newton).expect("a Newton block").0
    }

    /// What is said of a program that has been spoilt.
    fn said(spoil: impl FnOnce(&mut Program)) -> String {
        let mut program = bridge();
        assert_eq!(verify(&program), Ok(()));
        spoil(&mut program);
        verify(&program).expect_err("it is spoilt")
    }

    #[test]
    fn a_breach_is_seen() {
        let guess = |p: &Program| p.values.find(Op::Guess(newton(p), 0)).expect("a guess");
        assert!(said(|p| p.states[0].rate = Value(9999)).contains("wanted"));
        assert!(said(|p| p.states[0].rate = guess(p)).contains("wanted"));
        assert!(said(|p| p.parameters[0].default = p.states[0].rate).contains("varies"));
        assert!(said(|p| p.dependence.clear()).contains("rates read"));
        assert!(said(|p| p.dependence[0] = vec![7]).contains("states that there are not"));
        assert!(said(|p| p.tracked.clear()).contains("tell"));
        assert!(said(|p| p.kept.push((0, Value(9999)))).contains("is told"));
        let clocked = |p: &mut Program| {
            let condition =
                Condition { operand: p.states[0].rate, kind: ConditionKind::Sign, trigger: EventTrigger::LinearTime };
            p.conditions.push(condition);
        };
        assert!(said(clocked).contains("moved by something else"));
        let shorten = |p: &mut Program| {
            let id = newton(p);
            if let Block::Newton { jacobian, .. } = &mut p.blocks[id] {
                *jacobian = Arc::new(Matrix::new(SparseMatrix::full(Vec::new())));
            }
        };
        assert!(said(shorten).contains("rows for"));
        let number = |p: &mut Program| _ = p.values.add(Op::State(99), Reads::STATE);
        assert!(said(number).contains("which there is not"));
        let dependence = |p: &mut Program| _ = p.values.add(Op::Constant(Bits::of(77.0)), Reads::TIME);
        assert!(said(dependence).contains("depends on"));
    }

    #[test]
    fn routines_are_defined_in_order() {
        let program = bridge();
        let mut code = program.guarded_routine(&[program.states[0].rate]).code;
        assert_eq!(code.verify(), Ok(()));
        assert!(code.solves().any(|s| matches!(s.method, Method::Newton { .. })));
        let whole = code.clone();
        code.outputs.push(Arg::Local(Local(code.values.len() as u32)));
        assert!(code.verify().unwrap_err().contains("wanted"));
        code = whole.clone();
        code.steps.swap(0, 1);
        assert!(code.verify().is_err());
        code = whole.clone();
        code.steps.pop();
        assert!(code.verify().is_err());
        code = whole;
        for step in &mut code.steps {
            if let Step::Solve(solve) = step
                && let Method::Newton { outer, .. } = &mut solve.method
            {
                outer.clear();
            }
        }
        assert!(code.verify().unwrap_err().contains("before it is defined"));
    }
}
