//! How the functions of a model are called, and those that are more than one routine.

use halfarrow_compiler::program::{Code, Value};
use halfarrow_compiler::sparse::Pattern;

use crate::Real;
use crate::c::function::{self, Function, Gives, Parameter};
use crate::c::terms;
use crate::c::write::{Moving, Place, Shape, Time, Writer};
use crate::c::written::{Line, Written, written};

pub(super) const PLAIN: Shape = Shape {
    parameters: &[Parameter::Model, Parameter::Wide("t"), Parameter::Reals("x"), Parameter::RealsOut("out")],
    void: false,
    time: Time::Given,
    along: None,
    wide: false,
};
pub(super) const ALONG: Shape = Shape {
    parameters: &[
        Parameter::Model,
        Parameter::Wide("t"),
        Parameter::Reals("x"),
        Parameter::Reals("e"),
        Parameter::RealsOut("out"),
        Parameter::RealsOut("rates"),
    ],
    ..PLAIN
};
/// What moves with time alone.
pub(super) const CLOCK: Shape = Shape {
    parameters: &[Parameter::Model, Parameter::Wide("t"), Parameter::WideOut("out"), Parameter::WideOut("rates")],
    wide: true,
    ..PLAIN
};
/// What parameters determine.
pub(super) const PREAMBLE: Shape = Shape { parameters: &[Parameter::Model], time: Time::Always, ..PLAIN };
/// A Newton block: residuals and their Jacobian.
const BLOCK: Shape = Shape {
    parameters: &[
        Parameter::Model,
        Parameter::Reals("o"),
        Parameter::Reals("g"),
        Parameter::RealsOut("right"),
        Parameter::RealsOut("matrix"),
    ],
    void: true,
    ..PLAIN
};
/// Of what its residuals are the sums.
const BLOCK_TERMS: Shape = Shape {
    parameters: &[Parameter::Model, Parameter::Reals("o"), Parameter::Reals("g"), Parameter::RealsOut("terms")],
    ..BLOCK
};
/// Rates of its residuals.
const BLOCK_ALONG: Shape = Shape {
    parameters: &[
        Parameter::Model,
        Parameter::Reals("o"),
        Parameter::Reals("e"),
        Parameter::Reals("g"),
        Parameter::RealsOut("rates"),
    ],
    ..BLOCK
};

/// Values of parameters alone, from where the preamble leaves them.
pub(super) fn of_parameters(writer: &Writer, name: &str, values: impl Iterator<Item = Value>, wide: bool) -> Function {
    let out = if wide { Parameter::WideOut("out") } else { Parameter::RealsOut("out") };
    let value = |value| if wide { writer.givens.wide_written(value) } else { writer.givens.written(value) };
    let line = |(i, v)| Line::new(written!("    out[{}] = {};", i, value(v)), 0);
    let mut lines: Vec<Line> = values.enumerate().map(line).collect();
    lines.extend(["    (void)m;", "    (void)out;"].map(|line| Line::new(Written::of(line), 0)));
    Function::new(name.into(), Gives::Nothing, &[Parameter::ConstModel, out], writer.real, &lines)
}

/// The functions of a Newton block, each residual beside its derivatives.
pub(super) fn block_functions(writer: &mut Writer, number: usize, pattern: &Pattern, code: &Code) -> Vec<Function> {
    let n = pattern.size();
    let code = &code.near((0..n).flat_map(|row| std::iter::once(row).chain(pattern.row(row).map(move |e| n + e))));
    let mut values = Place::first("right", n);
    values.extend(Place::first("matrix", code.outputs.len() - n));
    let mut functions = writer.function(&format!("ha_block_{number}"), BLOCK, (code, &[]), (&values, &[]));
    let sums = terms::terms_of(code, n);
    let name = format!("ha_block_{number}_terms");
    functions.extend(writer.function(&name, BLOCK_TERMS, (&sums, &[]), (&Place::first("terms", n), &[])));
    let residuals = Code { outputs: code.outputs[..n].to_vec(), ..code.clone() };
    let residuals = terms::without_the_unread(residuals);
    let along = Shape { along: Some(Moving { outer: true, ..Moving::default() }), ..BLOCK_ALONG };
    let name = format!("ha_block_{number}_along");
    functions.extend(writer.function(&name, along, (&residuals, &[]), (&[], &Place::first("rates", n))));
    functions
}

/// How the functions of a Newton block are declared, before they are there.
pub(super) fn block_declarations(number: usize, real: Real) -> String {
    let shapes = [("", BLOCK), ("_along", BLOCK_ALONG), ("_terms", BLOCK_TERMS)];
    let declared = shapes.map(|(kind, shape)| {
        let name = format!("ha_block_{number}{kind}");
        function::declaration(&name, Gives::Nothing, shape.parameters, real) + ";\n"
    });
    declared.concat()
}
