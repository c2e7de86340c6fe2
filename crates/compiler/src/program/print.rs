//! A program as text.

use super::{Block, Cause, Instruction, Layout, Program, Register, Routine, Value};
use crate::ids::Id;
use std::collections::BTreeMap;
use std::fmt;

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let layout = self.layout();
        let names = self.register_names(&layout);
        writeln!(f, "program {}", self.name)?;
        let preamble = self.preamble(&layout);
        if !preamble.code.is_empty() {
            writeln!(f, "\nonce for a set of parameters")?;
            self.print_code(f, &preamble, &names)?;
        }
        let rates: Vec<Value> = self.states.iter().map(|s| s.rate).collect();
        let routine = self.watched_routine(&layout, &rates);
        let what = if self.implicit.is_some() { "rates and residuals" } else { "rates" };
        writeln!(f, "\n{what}, {} instructions, {} registers", routine.code.len(), routine.registers)?;
        self.print_code(f, &routine, &names)?;
        let explicit = |i: usize| self.implicit.as_ref().is_none_or(|all| all.explicit[i]);
        for (i, (state, &out)) in self.states.iter().zip(&routine.outputs).enumerate() {
            match explicit(i) {
                true => writeln!(f, "    {}' = {}", state.name, name(&names, out))?,
                false => writeln!(f, "    0 = {}", name(&names, out))?,
            }
        }
        self.print_conditions(f)?;
        let shown: Vec<_> = self.observed.iter().filter_map(|o| Some((o, o.value.clone().ok()?))).collect();
        let values: Vec<Value> = shown.iter().map(|(_, v)| *v).collect();
        let routine = self.watched_routine(&layout, &values);
        writeln!(f, "\nrecorded, {} instructions, {} registers", routine.code.len(), routine.registers)?;
        self.print_code(f, &routine, &names)?;
        for ((observed, _), &out) in shown.iter().zip(&routine.outputs) {
            writeln!(f, "    {} = {}", observed.name, name(&names, out))?;
        }
        Ok(())
    }
}

type Names = BTreeMap<Register, String>;

fn name(names: &Names, register: Register) -> String {
    names.get(&register).cloned().unwrap_or_else(|| format!("r{register}"))
}

impl Program {
    fn register_names(&self, layout: &Layout) -> Names {
        let mut names: Names = layout.constants.iter().map(|&(r, value)| (r, format!("{value}"))).collect();
        names.insert(layout.time, "t".to_string());
        let mut group = |first: Register, members: Vec<&String>| {
            let numbered = members.into_iter().enumerate();
            names.extend(numbered.map(|(i, name)| (first + i as u32, name.clone())));
        };
        group(layout.parameters, self.parameters.iter().map(|p| &p.name).collect());
        group(layout.inputs, self.inputs.iter().map(|i| &i.name).collect());
        group(layout.held, self.held.iter().map(|h| &h.name).collect());
        group(layout.conserved, self.conserved.iter().collect());
        group(layout.states, self.states.iter().map(|s| &s.name).collect());
        if self.implicit.is_some() {
            let rates: Vec<String> = self.states.iter().map(|s| format!("{}'", s.name)).collect();
            group(layout.rates, rates.iter().collect());
        }
        names
    }

    fn print_conditions(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.conditions.is_empty() {
            return Ok(());
        }
        writeln!(f, "\nconditions")?;
        for (id, condition) in self.conditions.iter() {
            let cause = match condition.cause {
                Cause::Clock => "of time, in closed form",
                Cause::Curve => "of time, searched",
                Cause::State => "of the state",
                Cause::Shown => "of the state, for what is recorded",
            };
            writeln!(f, "    c{}: {:?}, {cause}", id.index(), condition.kind)?;
        }
        Ok(())
    }

    fn print_code(&self, f: &mut fmt::Formatter<'_>, routine: &Routine, names: &Names) -> fmt::Result {
        for instruction in &routine.code {
            let Instruction::Solve { solve } = *instruction else {
                writeln!(f, "    {}", text(instruction, names))?;
                continue;
            };
            let solve = &routine.solves[solve as usize];
            let unknowns: Vec<String> = solve.unknowns.iter().map(|&r| name(names, r)).collect();
            let kind = match self.blocks[solve.block] {
                Block::Linear { .. } => "linear",
                Block::Newton { .. } => "newton",
            };
            writeln!(f, "    {} = {kind} block of {}", unknowns.join(", "), self.blocks[solve.block].elements())?;
            if !solve.guess.is_empty() {
                let guess: Vec<String> = solve.guess.iter().map(|&r| name(names, r)).collect();
                writeln!(f, "        guess {}", guess.join(", "))?;
            }
            solve.code.iter().try_for_each(|i| writeln!(f, "        {}", text(i, names)))?;
            for (row, right) in solve.matrix.chunks(solve.right.len().max(1)).zip(&solve.right) {
                let row: Vec<String> = row.iter().map(|&r| name(names, r)).collect();
                writeln!(f, "        [{}] | {}", row.join(", "), name(names, *right))?;
            }
        }
        Ok(())
    }
}

fn text(instruction: &Instruction, names: &Names) -> String {
    use Instruction::*;
    let n = |r: Register| name(names, r);
    let binary = |out, a, sign: &str, b| format!("{} = {} {sign} {}", n(out), n(a), n(b));
    match *instruction {
        Parameter { out, default, .. } => format!("{} = {} unless set", n(out), n(default)),
        Neg { out, a } => format!("{} = -{}", n(out), n(a)),
        Add { out, a, b } => binary(out, a, "+", b),
        Sub { out, a, b } => binary(out, a, "-", b),
        Mul { out, a, b } => binary(out, a, "*", b),
        Div { out, a, b } => binary(out, a, "/", b),
        Powi { out, a, n: power } => format!("{} = {}^{power}", n(out), n(a)),
        Pow { out, a, b } => binary(out, a, "^", b),
        Call { f, out, a } => format!("{} = {}({})", n(out), f.name(), n(a)),
        Call2 { f, out, a, b } => format!("{} = {}({}, {})", n(out), f.name(), n(a), n(b)),
        Positive { out, a } => format!("{} = {} > 0", n(out), n(a)),
        Side { out, a, condition } => format!("{} = c{}: {} > 0", n(out), condition.0, n(a)),
        Floor { out, a, condition } => format!("{} = c{}: floor({})", n(out), condition.0, n(a)),
        And { out, a, b } => binary(out, a, "and", b),
        Or { out, a, b } => binary(out, a, "or", b),
        Not { out, a } => format!("{} = not {}", n(out), n(a)),
        Select { out, c, a, b } => format!("{} = if {} then {} else {}", n(out), n(c), n(a), n(b)),
        Table { out, a, table, .. } => format!("{} = table {table} at {}", n(out), n(a)),
        TableSlope { out, a, table, .. } => format!("{} = slope of table {table} at {}", n(out), n(a)),
        TableCurvature { out, a, table, .. } => format!("{} = curvature of table {table} at {}", n(out), n(a)),
        Watch { pivot, .. } => format!("stop if {} vanishes", n(pivot)),
        Solve { solve } => format!("solve {solve}"),
    }
}
