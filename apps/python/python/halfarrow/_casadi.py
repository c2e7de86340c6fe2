"""Equations as expressions of CasADi."""

from __future__ import annotations

import dataclasses
import functools
import operator
from typing import TYPE_CHECKING, Any

import casadi
import sympy

from ._errors import UsageError

if TYPE_CHECKING:
    from .equations import Equations

_FUNCTIONS = {
    "Abs": casadi.fabs,
    "Max": lambda *values: functools.reduce(casadi.fmax, values),
    "Min": lambda *values: functools.reduce(casadi.fmin, values),
    "Mod": lambda x, y: x - y * casadi.floor(x / y),
    "Pow": lambda x, y: x**y,
    "Add": lambda *values: sum(values),
    "Mul": lambda *values: functools.reduce(operator.mul, values),
    "And": lambda *values: functools.reduce(casadi.logic_and, values),
    "Or": lambda *values: functools.reduce(casadi.logic_or, values),
    "Not": casadi.logic_not,
    "Equality": operator.eq,
    "Unequality": operator.ne,
    "StrictLessThan": operator.lt,
    "LessThan": operator.le,
    "StrictGreaterThan": operator.gt,
    "GreaterThan": operator.ge,
    **{
        name: getattr(casadi, name)
        for name in ["sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "floor",
                     "sign"]
    },
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Casadi:
    """A model as CasADi has it: symbols and expressions, in the order of the names. All is in SI units."""

    dae: dict[str, Any]
    """``t``, ``x``, ``z``, ``u``, ``p``, ``ode``, ``alg``, as ``casadi.integrator`` takes them."""
    states: list[str]
    """Names of ``x``."""
    algebraic: list[str]
    """Names of ``z``: what no rate is known of, which ``alg`` = 0 tells."""
    inputs: list[str]
    """Names of ``u``."""
    parameters: list[str]
    """Names of ``p``: parameters, and what is conserved."""
    start: list[float | None]
    """Start values of ``x``; None where the model gives none by itself."""
    values: list[float | None]
    """Values of ``p``; None of what is conserved."""


def casadi_of(told: Equations) -> Casadi:
    """See ``Equations.casadi``."""
    if told.events:
        raise UsageError("the model has events, which CasADi has not: run parts between them by themselves")
    model = told.of
    written = told.sympy()
    count = len(told.equations)
    t = sympy.Symbol("t")
    definitions = {equation.lhs: equation.rhs for equation in written[count:]}
    residuals = []
    for equation in written[:count]:
        both = equation.lhs - equation.rhs
        while own := both.atoms(sympy.core.function.AppliedUndef) & definitions.keys():
            both = both.xreplace({name: definitions[name] for name in own})
        residuals.append(both)
    inputs = list(model.inputs)
    # Unknowns of blocks that are solved together stand behind the others.
    standing = {own.func.__name__ for residual in residuals for own in residual.atoms(sympy.core.function.AppliedUndef)}
    unknowns = [*told.unknowns, *sorted(standing - set(told.unknowns) - set(inputs))]
    functions = {name: sympy.Function(name)(t) for name in [*unknowns, *inputs]}
    rates = {name: sympy.Derivative(functions[name], t) for name in unknowns}
    known = set().union(*(residual.atoms(sympy.Derivative) for residual in residuals))
    states = [name for name in unknowns if rates[name] in known]
    algebraic = [name for name in unknowns if name not in states]
    free = set().union(*(residual.free_symbols for residual in residuals)) - {t}
    parameters = [name for name in model.parameters if sympy.Symbol(name) in free]
    parameters += sorted(symbol.name for symbol in free if symbol.name not in parameters)
    symbols = {kind: casadi.SX.sym(kind, len(names)) for kind, names in
               [("x", states), ("z", algebraic), ("u", inputs), ("p", parameters), ("dx", states)]}  # fmt: skip
    time = casadi.SX.sym("t")
    given = {t: time, **{rates[name]: symbols["dx"][i] for i, name in enumerate(states)}}
    for kind, names in [("x", states), ("z", algebraic), ("u", inputs)]:
        given.update({functions[name]: symbols[kind][i] for i, name in enumerate(names)})
    given.update({sympy.Symbol(name): symbols["p"][i] for i, name in enumerate(parameters)})
    moving = [residual for residual in residuals if residual.atoms(sympy.Derivative)]
    still = [residual for residual in residuals if not residual.atoms(sympy.Derivative)]
    moved = casadi.vertcat(casadi.SX(0, 1), *(_translated(residual, given) for residual in moving))
    # Rates stand linearly.
    dx = symbols["dx"]
    at_zero = casadi.substitute(moved, dx, casadi.SX.zeros(len(states)))
    ode = -casadi.solve(casadi.jacobian(moved, dx), at_zero) if states else casadi.SX(0, 1)
    dae = {"t": time, **{kind: symbols[kind] for kind in "xzup"}, "ode": casadi.simplify(ode)}
    dae["alg"] = casadi.vertcat(casadi.SX(0, 1), *(_translated(residual, given) for residual in still))
    starts = {state.name: state.initial for state in told.states}
    values = {name: parameter.value for name, parameter in model.parameters.items()}
    return Casadi(
        dae=dae,
        states=states,
        algebraic=algebraic,
        inputs=inputs,
        parameters=parameters,
        start=[starts.get(name) for name in states],
        values=[values.get(name) for name in parameters],
    )


def _translated(expression: Any, known: dict[Any, Any]) -> Any:
    """An expression with values in the place of what they are of; parts that stand several times are made once."""
    found = known.get(expression)
    if found is None:
        if expression.is_number:
            found = float(expression)
        elif expression.is_Boolean and not expression.args:
            found = bool(expression)
        elif isinstance(expression, sympy.Piecewise):
            *pieces, last = [[_translated(part, known) for part in piece.args] for piece in expression.args]
            found = last[0]
            for value, condition in reversed(pieces):
                found = casadi.if_else(condition, value, found)
        else:
            name = type(expression).__name__
            if name not in _FUNCTIONS:
                raise UsageError(f"`{expression}` has no word in CasADi")
            found = _FUNCTIONS[name](*[_translated(part, known) for part in expression.args])
        known[expression] = found
    return found
