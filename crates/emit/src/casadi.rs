//! A model as functions of CasADi, for optimal control and whatever else works on its expressions: one file of Python.
//!
//! What is solved by iteration, and large linear blocks, are algebraic unknowns `z` with their residuals: what integrators and
//! collocation of CasADi take. Conditions follow their operands. Source: \[CasADi\].

use std::collections::HashMap;
use std::fmt::Write;

use halfarrow_compiler::algebra::{Function, Outside, Table1d};
use halfarrow_compiler::program::{Arg, Code, Method, Op, Program, Solve, Step, Value};

use crate::{EmitError, Start};

/// Linear blocks up to this size are solved within the expressions.
const SOLVED: usize = 4;

/// The file. `solutions`: the unknowns of solve blocks at the start, by block.
///
/// # Errors
/// Something happens at events, or is held from earlier times.
pub fn write(
    program: &Program,
    start: &Start,
    (recorded, solutions): (&[usize], &[Vec<f64>]),
) -> Result<String, EmitError> {
    let events: Vec<String> = program
        .clauses
        .iter()
        .filter(|clause| clause.bound.is_none())
        .map(|clause| clause.name.clone())
        .chain(program.held.iter().map(|held| held.name.clone()))
        .collect();
    if !events.is_empty() {
        return Err(EmitError::Events(events));
    }
    if program.states.iter().any(|state| matches!(program.values.op(state.rate), Op::Rate(_))) {
        return Err(EmitError::Implicit);
    }
    let rates: Vec<Value> = program.states.iter().map(|state| state.rate).collect();
    let outputs: Vec<usize> = recorded.iter().copied().filter(|&i| program.observed[i].value.is_ok()).collect();
    let observed: Vec<Value> = outputs.iter().filter_map(|&i| program.observed[i].value.clone().ok()).collect();
    let wanted = [rates, observed].concat();
    let mut writer = Writer::new(program);
    let determined = program.determined(&wanted);
    let preamble = program.preamble(&determined);
    writer.code(&preamble.code, "c");
    for (value, &output) in preamble.wanted.iter().zip(&preamble.code.outputs) {
        let name = writer.arg(output, "c");
        writer.given.insert(*value, name);
    }
    let routine = program.routine(&wanted);
    writer.code(&routine.code, "v");
    // What is wanted stands in the order of the values.
    let place: HashMap<Value, String> =
        routine.wanted.iter().zip(&routine.code.outputs).map(|(value, &a)| (*value, writer.arg(a, "v"))).collect();
    let named = |values: &[Value]| values.iter().map(|value| place[value].clone()).collect::<Vec<String>>();
    let (dx, y) = (named(&wanted[..program.states.len()]), named(&wanted[program.states.len()..]));
    let names = |all: Vec<&str>| format!("{all:?}");
    let free = &writer.free;
    let unknowns: Vec<f64> = writer
        .unknowns
        .iter()
        .map(|&(block, i)| {
            solutions.get(block).and_then(|s| s.get(i)).copied().filter(|v| v.is_finite()).unwrap_or(0.0)
        })
        .collect();
    let mut text = format!(
        "\"\"\"{}: rates and outputs as functions of CasADi, in SI units.\n\n\
         `function()` is `dx, alg, y = f(t, x, z, u, p)`, of which `alg = 0` determines `z`; `dae()` is what\n\
         `casadi.integrator` takes, with inputs and parameters together as `p`. Conserved constants are those of the start.\n\
         \"\"\"\n\nimport casadi as ca\n\n",
        program.name
    );
    let _ = writeln!(text, "STATES = {}", names(program.states.iter().map(|s| s.name.as_str()).collect()));
    let _ = writeln!(text, "UNKNOWNS = {}", names(writer.unknown_names.iter().map(String::as_str).collect()));
    let _ = writeln!(text, "INPUTS = {}", names(program.inputs.iter().map(|i| i.name.as_str()).collect()));
    let _ =
        writeln!(text, "PARAMETERS = {}", names(free.iter().map(|&i| program.parameters[i].name.as_str()).collect()));
    let _ = writeln!(text, "OUTPUTS = {}", names(outputs.iter().map(|&i| &*program.observed[i].name).collect()));
    let _ = writeln!(text, "\n# At the start.\nx0 = {:?}\nz0 = {unknowns:?}", start.states);
    let parameters: Vec<f64> = free.iter().map(|&i| start.parameters[i]).collect();
    let _ = writeln!(text, "u0 = {:?}\np0 = {parameters:?}\nk0 = {:?}\n", start.inputs, start.conserved);
    if !program.tables.is_empty() {
        text += TABLE;
        let _ = writeln!(text, "_TABLES = [");
        program.tables.iter().for_each(|table| text += &table_line(table));
        text += "]\n\n";
    }
    let sizes = (program.states.len(), writer.unknowns.len(), program.inputs.len(), free.len());
    let _ = writeln!(
        text,
        "\ndef _expressions():\n    t = ca.SX.sym(\"t\")\n    x = ca.SX.sym(\"x\", {})\n    z = ca.SX.sym(\"z\", {})\n    u = ca.SX.sym(\"u\", {})\n    p = ca.SX.sym(\"p\", {})",
        sizes.0, sizes.1, sizes.2, sizes.3
    );
    text += &writer.text;
    let list = |all: &[String]| format!("ca.vertcat({})", all.join(", "));
    let _ = writeln!(text, "    return t, x, z, u, p, {}, {}, {}", list(&dx), list(&writer.residuals), list(&y));
    let _ = write!(
        text,
        "\n\ndef function():\n    \"\"\"Rates, residuals and outputs: `dx, alg, y = f(t, x, z, u, p)`.\"\"\"\n    \
         t, x, z, u, p, dx, alg, y = _expressions()\n    \
         return ca.Function({:?}, [t, x, z, u, p], [dx, alg, y], [\"t\", \"x\", \"z\", \"u\", \"p\"], [\"dx\", \"alg\", \"y\"])\n\n\n\
         def dae():\n    \"\"\"For `casadi.integrator`: `p` has the inputs, then the parameters.\"\"\"\n    \
         t, x, z, u, p, dx, alg, _ = _expressions()\n    \
         return {{\"t\": t, \"x\": x, \"z\": z, \"p\": ca.vertcat(u, p), \"ode\": dx, \"alg\": alg}}\n\n\n\
         if __name__ == \"__main__\":\n    f = function()\n    print(f)\n    \
         print(\"rates at the start:\", f(0, x0, z0, u0, p0)[0])\n",
        identifier(&program.name)
    );
    Ok(text)
}

/// A name that CasADi takes for a function.
fn identifier(name: &str) -> String {
    let mut name: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    while name.contains("__") {
        name = name.replace("__", "_");
    }
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("f{name}") }
}

const TABLE: &str = "\
def _table(number, order, a):
    \"\"\"A table at `a`: its value, slope or curvature, by pieces, each a cubic in the distance from its point.\"\"\"
    points, pieces, outside = _TABLES[number]
    first, last = points[0], points[-1]

    def on(i):
        d = a - points[i]
        c0, c1, c2, c3 = pieces[i]
        return [((c3 * d + c2) * d + c1) * d + c0, (3 * c3 * d + 2 * c2) * d + c1, 6 * c3 * d + 2 * c2][order]

    value = on(0)
    for i in range(1, len(points)):
        value = ca.if_else(a >= points[i], on(i), value)
    if outside == \"clamp\":
        ends = [(pieces[0][0], pieces[-1][0]), (0, 0), (0, 0)][order]
        value = ca.if_else(a < first, ends[0], ca.if_else(a >= last, ends[1], value))
    if outside == \"error\":
        value = ca.if_else(ca.logic_or(a < first, a > last), float(\"nan\"), value)
    return value


";

fn table_line(table: &Table1d) -> String {
    let outside = match table.outside() {
        Outside::Error => "error",
        Outside::Clamp => "clamp",
        Outside::Extrapolate => "extrapolate",
    };
    format!("    ({:?}, {:?}, {outside:?}),\n", table.x(), table.pieces())
}

struct Writer<'p> {
    program: &'p Program,
    text: String,
    given: HashMap<Value, String>,
    locals: HashMap<(&'static str, u32), String>,
    /// Parameters that are set, by their numbers.
    free: Vec<usize>,
    /// Algebraic unknowns, by block and place; their names, and their residuals.
    unknowns: Vec<(usize, usize)>,
    unknown_names: Vec<String>,
    residuals: Vec<String>,
    /// The matrix of each linear block that is solved.
    matrices: HashMap<u32, String>,
    next: usize,
}

impl<'p> Writer<'p> {
    fn new(program: &'p Program) -> Writer<'p> {
        let is_number = |i: &usize| matches!(program.values.op(program.parameters[*i].default), Op::Constant(_));
        let free = (0..program.parameters.len()).filter(|&i| !program.parameters[i].constant);
        Writer {
            free: free.filter(is_number).collect(),
            program,
            text: String::new(),
            given: HashMap::new(),
            locals: HashMap::new(),
            unknowns: Vec::new(),
            unknown_names: Vec::new(),
            residuals: Vec::new(),
            matrices: HashMap::new(),
            next: 0,
        }
    }

    fn fresh(&mut self) -> String {
        self.next += 1;
        format!("v{}", self.next)
    }

    fn define(&mut self, of: &'static str, local: u32, value: &str) {
        let name = self.fresh();
        let _ = writeln!(self.text, "    {name} = {value}");
        self.locals.insert((of, local), name);
    }

    fn arg(&self, a: Arg, of: &'static str) -> String {
        match a {
            Arg::Given(value) => self.value(value),
            Arg::Local(local) => self.locals[&(of, local.0)].clone(),
            Arg::Outer(_) | Arg::Guess(_) => unreachable!("known where a Newton block is written"),
        }
    }

    fn value(&self, value: Value) -> String {
        if let Some(name) = self.given.get(&value) {
            return name.clone();
        }
        match self.program.values.op(value) {
            Op::Constant(bits) => number(bits.number()),
            Op::Time => "t".into(),
            Op::State(i) => format!("x[{i}]"),
            Op::Input(i) => format!("u[{i}]"),
            Op::Conserved(i) => format!("k0[{i}]"),
            _ => unreachable!("whatever else is given follows from parameters, or is held"),
        }
    }

    fn code(&mut self, code: &Code, of: &'static str) {
        for step in &code.steps {
            match step {
                Step::Op { out, op } => {
                    let text = operation(op.map_operands(|a| self.arg(a, of)));
                    self.define(of, out.0, &text);
                }
                Step::Parameter { out, index, default } => {
                    let own = self.free.iter().position(|&i| i == *index as usize);
                    let text = own.map_or_else(|| self.arg(*default, of), |place| format!("p[{place}]"));
                    self.define(of, out.0, &text);
                    // Values of the program that are this parameter.
                    if let Some(value) = code.values[out.0 as usize] {
                        let name = self.locals[&(of, out.0)].clone();
                        self.given.insert(value, name);
                    }
                }
                Step::Guard { .. } => {}
                Step::Solve(solve) => self.solve(solve, of),
            }
            // In the preamble what is computed is given from there on.
            if of == "c"
                && let Step::Op { out, .. } = step
                && let Some(value) = code.values[out.0 as usize]
            {
                let name = self.locals[&(of, out.0)].clone();
                self.given.insert(value, name);
            }
        }
    }

    /// New algebraic unknowns for those of a block.
    fn unknowns_of(&mut self, solve: &Solve, of: &'static str) -> Vec<String> {
        let block = &self.program.blocks[solve.block];
        let mut names = Vec::new();
        for (i, unknown) in solve.unknowns.iter().enumerate() {
            let name = format!("z[{}]", self.unknowns.len());
            self.unknowns.push((solve.block.0 as usize, i));
            self.unknown_names.push(block.unknown(i).to_string());
            self.locals.insert((of, unknown.0), name.clone());
            names.push(name);
        }
        names
    }

    fn solve(&mut self, solve: &Solve, of: &'static str) {
        match &solve.method {
            Method::Linear { shared, matrix, right } => {
                let entries: Vec<String> = matrix.iter().map(|&a| self.arg(a, of)).collect();
                let right: Vec<String> = right.iter().map(|&a| self.arg(a, of)).collect();
                let n = right.len();
                if n <= SOLVED {
                    let known = shared.and_then(|block| self.matrices.get(&block.0).cloned());
                    let matrix = known.unwrap_or_else(|| {
                        let name = self.fresh();
                        let _ = writeln!(self.text, "    {name} = ca.SX.zeros({n}, {n})");
                        for (entry, (row, column)) in entries.iter().zip(solve.pattern.places()) {
                            let _ = writeln!(self.text, "    {name}[{row}, {column}] = {entry}");
                        }
                        name
                    });
                    self.matrices.insert(solve.block.0, matrix.clone());
                    let name = self.fresh();
                    let _ = writeln!(self.text, "    {name} = ca.solve({matrix}, ca.vertcat({}))", right.join(", "));
                    for (i, unknown) in solve.unknowns.iter().enumerate() {
                        self.locals.insert((of, unknown.0), format!("{name}[{i}]"));
                    }
                    return;
                }
                // Its own entries, or those of the block that has the same matrix.
                let entries = match (entries.is_empty(), shared) {
                    (true, Some(block)) => self.matrices[&block.0].split('\n').map(str::to_string).collect(),
                    _ => entries,
                };
                self.matrices.insert(solve.block.0, entries.join("\n"));
                let z = self.unknowns_of(solve, of);
                let mut rows = vec![String::new(); n];
                for (entry, (row, column)) in entries.iter().zip(solve.pattern.places()) {
                    let _ = write!(rows[row], "{entry} * {} + ", z[column]);
                }
                for (row, right) in rows.iter().zip(&right) {
                    let name = self.fresh();
                    let _ = writeln!(self.text, "    {name} = {row}-({right})");
                    self.residuals.push(name);
                }
            }
            Method::Newton { outer, code } => {
                let outer: Vec<String> = outer.iter().map(|&a| self.arg(a, of)).collect();
                let z = self.unknowns_of(solve, of);
                let mut inner: HashMap<u32, String> = HashMap::new();
                let arg = |this: &Self, inner: &HashMap<u32, String>, a: Arg| match a {
                    Arg::Given(value) => this.value(value),
                    Arg::Local(local) => inner[&local.0].clone(),
                    Arg::Outer(i) => outer[i as usize].clone(),
                    Arg::Guess(i) => z[i as usize].clone(),
                };
                // The Jacobian is derived by CasADi: only what residuals need is written.
                let residuals = &code.outputs[..solve.unknowns.len()];
                let mut needed = vec![false; code.values.len()];
                let need = |a: Arg, needed: &mut Vec<bool>| {
                    if let Arg::Local(local) = a {
                        needed[local.0 as usize] = true;
                    }
                };
                residuals.iter().for_each(|&a| need(a, &mut needed));
                for step in code.steps.iter().rev() {
                    if step.defines().iter().any(|local| needed[local.0 as usize]) {
                        step.for_each_read(|a| need(a, &mut needed));
                    }
                }
                for step in &code.steps {
                    if let Step::Op { out, op } = step
                        && needed[out.0 as usize]
                    {
                        let text = operation(op.map_operands(|a| arg(self, &inner, a)));
                        let name = self.fresh();
                        let _ = writeln!(self.text, "    {name} = {text}");
                        inner.insert(out.0, name);
                    }
                }
                let residuals: Vec<String> = residuals.iter().map(|&a| arg(self, &inner, a)).collect();
                self.residuals.extend(residuals);
            }
        }
    }
}

fn number(value: f64) -> String {
    match value {
        v if v.is_nan() => "ca.nan".into(),
        v if v.is_infinite() => if v > 0.0 { "ca.inf" } else { "-ca.inf" }.into(),
        v if v < 0.0 => format!("({v:?})"),
        v => format!("{v:?}"),
    }
}

fn operation(op: Op<String>) -> String {
    match op {
        Op::Neg(a) => format!("-{a}"),
        Op::Add(a, b) => format!("{a} + {b}"),
        Op::Sub(a, b) => format!("{a} - {b}"),
        Op::Mul(a, b) => format!("{a} * {b}"),
        Op::Div(a, b) => format!("{a} / {b}"),
        Op::Powi(n, a) => format!("{a} ** {n}"),
        Op::Pow(a, b) => format!("{a} ** {b}"),
        Op::Atan2(a, b) => format!("ca.atan2({a}, {b})"),
        Op::Positive(a) | Op::Sign(_, a) => format!("{a} > 0"),
        Op::And(a, b) => format!("ca.logic_and({a} != 0, {b} != 0)"),
        Op::Or(a, b) => format!("ca.logic_or({a} != 0, {b} != 0)"),
        Op::Not(a) => format!("{a} == 0"),
        Op::Select(c, a, b) => format!("ca.if_else({c}, {a}, {b})"),
        Op::Floor(_, a) => format!("ca.floor({a})"),
        Op::Table(table, _, a) => format!("_table({table}, 0, {a})"),
        Op::TableSlope(table, _, a) => format!("_table({table}, 1, {a})"),
        Op::TableCurvature(table, _, a) => format!("_table({table}, 2, {a})"),
        Op::Call(f, a) => format!("ca.{}({a})", word(f)),
        Op::Constant(bits) => number(bits.number()),
        Op::Parameter(_)
        | Op::Time
        | Op::Input(_)
        | Op::Held(_)
        | Op::Conserved(_)
        | Op::State(_)
        | Op::Rate(_)
        | Op::Guess(..)
        | Op::Solution(..) => unreachable!("given before a routine runs"),
    }
}

/// A function of one argument as CasADi calls it.
fn word(f: Function) -> &'static str {
    match f {
        Function::Abs => "fabs",
        Function::Sign => "sign",
        Function::Asin => "asin",
        Function::Acos => "acos",
        Function::Atan => "atan",
        Function::Log => "log",
        Function::Log10 => "log10",
        other => other.name(),
    }
}
