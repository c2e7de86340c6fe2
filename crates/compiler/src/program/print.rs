//! A program as text: `%1` is a value of a routine, `$1` one of parameters alone, `.1` one within a Newton block, `?1` the
//! guess of an unknown there.

use super::{Arg, Block, Code, EventTrigger, Method, Op, Program, Routine, Solve, Step, Trigger, Value};
use crate::algebra::dotted;
use crate::ids::Id;
use rustc_hash::FxHashMap;
use std::fmt;

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let determined = self.determined(&[]);
        let names = Names::of(self, &determined);
        writeln!(f, "program {}", self.name)?;
        let preamble = self.preamble(&determined);
        if !preamble.code.steps.is_empty() {
            writeln!(f, "\nonce for a set of parameters")?;
            let names = Names { preamble: true, ..names.clone() };
            self.print_code(f, &preamble.code, &names.within(&preamble.code))?;
        }
        let rates: Vec<Value> = self.states.iter().map(|s| s.rate).collect();
        let what = if self.implicit.is_some() { "rates and residuals" } else { "rates" };
        let explicit = |i: usize| self.implicit.as_ref().is_none_or(|all| all.explicit[i]);
        let told = |(i, state): (usize, &super::State)| match explicit(i) {
            true => dotted(&state.name, 1),
            false => "0".to_string(),
        };
        let told: Vec<String> = self.states.iter().enumerate().map(told).collect();
        self.print_routine(f, what, &self.guarded_routine(&rates), &names, &told)?;
        self.print_conditions(f)?;
        self.print_events(f, &names)?;
        let shown: Vec<_> = self.observed.iter().filter_map(|o| Some((o, o.value.clone().ok()?))).collect();
        let values: Vec<Value> = shown.iter().map(|(_, v)| *v).collect();
        let told: Vec<String> = shown.iter().map(|(o, _)| o.name.to_string()).collect();
        self.print_routine(f, "recorded", &self.guarded_routine(&values), &names, &told)
    }
}

/// How values are called that stand before a routine runs.
#[derive(Clone)]
struct Names {
    given: FxHashMap<Value, String>,
    /// In the preamble what parameters determine is called so as well.
    preamble: bool,
}

/// How all that some code reads and defines is called.
struct Within<'a> {
    names: &'a Names,
    code: &'a Code,
    /// Of a Newton block what it reads from outside.
    outer: Option<Vec<String>>,
}

impl Names {
    fn of(program: &Program, determined: &[Value]) -> Names {
        let mut given = FxHashMap::default();
        let computed = determined.iter().filter(|v| !program.values.op(**v).is_given());
        given.extend(computed.zip(1..).map(|(&v, number)| (v, format!("${number}"))));
        for (value, op) in program.values.iter().filter(|(_, op)| op.is_given()) {
            let name = match op {
                Op::Constant(bits) => format!("{}", bits.number()),
                Op::Parameter(i) => program.parameters[i as usize].name.clone(),
                Op::Time => "t".to_string(),
                Op::Input(i) => program.inputs[i as usize].name.clone(),
                Op::Held(i) => program.held[i as usize].name.clone(),
                Op::Conserved(i) => program.conserved[i as usize].clone(),
                Op::State(i) => program.states[i as usize].name.clone(),
                Op::Rate(i) => dotted(&program.states[i as usize].name, 1),
                _ => unreachable!("not given"),
            };
            given.insert(value, name);
        }
        Names { given, preamble: false }
    }

    fn within<'a>(&'a self, code: &'a Code) -> Within<'a> {
        Within { names: self, code, outer: None }
    }
}

impl Within<'_> {
    fn name(&self, a: Arg) -> String {
        match a {
            Arg::Given(v) => self.names.given[&v].clone(),
            Arg::Outer(i) => self.outer.as_ref().expect("a Newton block has an outside")[i as usize].clone(),
            Arg::Guess(i) => format!("?{i}"),
            Arg::Local(i) if self.outer.is_some() => format!(".{}", i.0),
            Arg::Local(i) => {
                let value = self.code.values[i.index()].filter(|_| self.names.preamble);
                value.and_then(|v| self.names.given.get(&v).cloned()).unwrap_or_else(|| format!("%{}", i.0))
            }
        }
    }

    fn list(&self, args: impl IntoIterator<Item = Arg>) -> String {
        args.into_iter().map(|a| self.name(a)).collect::<Vec<_>>().join(", ")
    }
}

impl Program {
    fn print_routine(
        &self,
        f: &mut fmt::Formatter<'_>,
        what: &str,
        routine: &Routine,
        names: &Names,
        told: &[String],
    ) -> fmt::Result {
        writeln!(f, "\n{what}, {} instructions", routine.code.steps.len())?;
        let within = names.within(&routine.code);
        self.print_code(f, &routine.code, &within)?;
        told.iter().zip(&routine.code.outputs).try_for_each(|(told, &a)| writeln!(f, "    {told} = {}", within.name(a)))
    }

    fn print_conditions(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.conditions.is_empty() {
            return Ok(());
        }
        writeln!(f, "\nconditions")?;
        for (id, condition) in self.conditions.iter() {
            let trigger = match condition.trigger {
                EventTrigger::LinearTime => "of time, in closed form",
                EventTrigger::CurvedTime => "of time, searched",
                EventTrigger::State => "of the state",
                EventTrigger::RecordedOnly => "of the state, for what is recorded",
            };
            writeln!(f, "    c{}: {:?}, {trigger}", id.index(), condition.kind)?;
        }
        Ok(())
    }

    fn print_events(&self, f: &mut fmt::Formatter<'_>, names: &Names) -> fmt::Result {
        for clause in &self.clauses {
            let (wanted, told): (Vec<Value>, Vec<String>) = match clause.trigger {
                Trigger::Becomes(condition) => (vec![condition], vec!["it happens where this becomes 1".into()]),
                Trigger::Every(period) => (vec![period], vec!["it happens at multiples of".into()]),
            };
            let targets = clause.actions.iter().map(|a| (a.value, format!("{}+", a.name)));
            let (wanted, told): (Vec<Value>, Vec<String>) = wanted.into_iter().zip(told).chain(targets).unzip();
            self.print_routine(f, &clause.name, &self.routine(&wanted), names, &told)?;
        }
        let Some(jumps) = &self.jumps else { return Ok(()) };
        let tell = |(k, factor): &(u32, Value)| (*factor, format!("factor of the storage {}", k + 1));
        let stored = jumps.stored.iter().zip(1..).map(|(&v, k)| (v, format!("stored {k}")));
        let balances = jumps.balances.iter().zip(1..);
        let factors =
            balances.flat_map(|(row, b)| row.iter().map(move |t| (t.1, format!("balance {b}, {}", tell(t).1))));
        let (wanted, told): (Vec<Value>, Vec<String>) = stored.chain(factors).unzip();
        self.print_routine(f, "impulse balance at events", &self.routine(&wanted), names, &told)
    }

    fn print_code(&self, f: &mut fmt::Formatter<'_>, code: &Code, names: &Within) -> fmt::Result {
        let indent = if names.outer.is_some() { "        " } else { "    " };
        code.steps.iter().try_for_each(|step| {
            let out = names.list(step.defines().iter().map(|&out| Arg::Local(out)));
            match step {
                Step::Op { op, .. } => writeln!(f, "{indent}{out} = {}", op.map_operands(|a| Named(names, a)).text()),
                Step::Parameter { default, .. } => writeln!(f, "{indent}{out} = {} unless set", names.name(*default)),
                Step::Guard { pivot, .. } => writeln!(f, "{indent}stop if {} vanishes", names.name(*pivot)),
                Step::Solve(solve) => self.print_solve(f, solve, &out, names),
            }
        })
    }

    fn print_solve(&self, f: &mut fmt::Formatter<'_>, solve: &Solve, out: &str, names: &Within) -> fmt::Result {
        let kind = match self.blocks[solve.block] {
            Block::Linear { .. } => "linear",
            Block::Newton { .. } => "newton",
        };
        writeln!(f, "    {out} = {kind} block of {}", self.blocks[solve.block].elements())?;
        let (inside, right_sides, matrix) = match &solve.method {
            Method::Linear { matrix, right, .. } => (None, &right[..], &matrix[..]),
            Method::Newton { outer, code } => {
                let outer = Some(outer.iter().map(|&a| names.name(a)).collect());
                let inside = Within { names: names.names, code, outer };
                self.print_code(f, code, &inside)?;
                let (right, matrix) = code.outputs.split_at(solve.unknowns.len());
                (Some(inside), right, matrix)
            }
        };
        let inside = inside.as_ref().unwrap_or(names);
        for (row, &right) in right_sides.iter().enumerate() {
            // Of shared factors the matrix stands where they are made.
            let entries = solve.pattern.row(row).filter(|_| !matrix.is_empty());
            let entries = entries.map(|entry| (solve.pattern.columns()[entry], inside.name(matrix[entry])));
            let row = match self.blocks[solve.block].matrix().factors {
                Some(_) => entries.map(|(column, name)| format!("{column}: {name}")).collect(),
                None => full_row(entries, right_sides.len()),
            };
            writeln!(f, "        [{}] | {}", row.join(", "), inside.name(right))?;
        }
        Ok(())
    }
}

/// A row of a matrix with zeros where no entry stands.
fn full_row(entries: impl Iterator<Item = (u32, String)>, size: usize) -> Vec<String> {
    let mut row = vec!["0".to_string(); size];
    entries.for_each(|(column, name)| row[column as usize] = name);
    row
}

/// What a step reads, under its name.
#[derive(Clone, Copy)]
struct Named<'a>(&'a Within<'a>, Arg);

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.name(self.1))
    }
}
