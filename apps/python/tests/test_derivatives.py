"""Derivatives of every model of the repository, against its reference program and by complex steps."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.integrate
import sympy

import halfarrow as ha
from conftest import MODELS

REFERENCES = sorted(MODELS.glob("*/sensitivity.json"))

# Of the greatest derivative of a variable in the run: what runs at rtol 1e-13 reach. They miss 1.8e-12 at most.
TOLERANCE = 5e-12


def test_every_program_is_differentiated() -> None:
    assert {path.parent for path in REFERENCES} == {path.parent for path in MODELS.glob("*/reference.py")}


def by_program(path: Path) -> tuple[dict[str, Any], ha.Sensitivities]:
    """What the program gives, by differences at 60 digits, and what the package gives."""
    wanted = json.loads(path.read_text())
    reference = json.loads(path.with_name("reference.json").read_text())
    inputs = {name: path.parent / file for name, file in reference.get("inputs", {}).items()}
    by = [name for quantity in wanted["by"] for name in quantity.split("+")]
    s = ha.load(path.parent / "model.bond").sensitivities(
        by,
        to=float(wanted["t"][-1]),
        at=[float(t) for t in wanted["t"]],
        rtol=1e-13,
        inputs=inputs,
        record=list(reference["values"]),
    )
    return wanted["by"], s


@pytest.mark.filterwarnings("ignore::halfarrow.ModelWarning")
@pytest.mark.parametrize("path", REFERENCES, ids=lambda path: path.parent.name)
def test_derivatives_are_those_of_the_program(path: Path) -> None:
    wanted, s = by_program(path)
    assert len(wanted) >= 2
    for quantity, columns in wanted.items():
        assert set(columns) == set(s.names)
        for name, values in columns.items():
            exact = np.array([float(v) for v in values])
            own = np.sum([s[name, each] for each in quantity.split("+")], axis=0)
            # What does not depend on the quantity at all is compared with itself.
            scale = np.abs(exact).max() or np.abs(s.result[name]).max()
            assert np.abs(own - exact).max() <= TOLERANCE * scale, (name, quantity)


def rates_of(model: ha.Model) -> tuple[Callable[..., Any], list[str]]:
    """Rates of the states from the equations as SymPy has them, and the parameters in the order in which they are given."""
    told = model.equations()
    written = told.sympy()
    t = sympy.Symbol("t")
    states = [sympy.Function(state.name)(t) for state in told.states]
    own, definitions = written[: len(states)], {eq.lhs: eq.rhs for eq in written[len(told.unknowns) :]}
    fixed = {sympy.Function(name)(t): 0 for name in model.inputs}
    rates = []
    for state, equation in zip(states, own, strict=True):
        both = equation.lhs - equation.rhs
        while set(both.atoms(sympy.core.function.AppliedUndef)) & set(definitions):
            both = both.xreplace(definitions)
        rate = sympy.Derivative(state, t)
        factor = sympy.diff(both, rate)
        rates.append(-(both.xreplace({rate: sympy.Integer(0)}) / factor).xreplace(fixed))
    plain = {state: sympy.Symbol(f"x{i}") for i, state in enumerate(states)}
    names = sorted({s.name for rate in rates for s in rate.free_symbols} - {"t"})
    marks = {sympy.Symbol(name): sympy.Symbol(f"p{i}") for i, name in enumerate(names)}
    ready = [rate.xreplace(plain).xreplace(marks) for rate in rates]
    return sympy.lambdify([t, list(plain.values()), list(marks.values())], ready, "numpy", cse=True), names


EXPLICIT = [
    "class2", "class2_class4_one_I", "class2_class4_one_I_variant_B", "class2_class4_two_I", "class2_class4_two_I_variant_B",
    "class3", "class4", "pendulum", "two_class3_C", "two_class3_CI", "unity_gain",
]  # fmt: skip


def test_all_others_are_here() -> None:
    """Models without a program have explicit equations, which are differentiated by complex steps."""
    known = {path.parent.name for path in REFERENCES}
    assert {path.parent.name for path in MODELS.glob("*/reference.json")} - known == set(EXPLICIT)


@pytest.mark.filterwarnings("ignore::halfarrow.ModelWarning")
@pytest.mark.parametrize("name", EXPLICIT)
def test_derivatives_are_those_of_complex_steps(name: str) -> None:
    model = ha.load(MODELS / name / "model.bond")
    rates, names = rates_of(model)
    told = model.equations()
    starts = [state.initial for state in told.states]
    values = {known: model.parameters[known].value for known in names if known in model.parameters}
    by = []
    for own in values:
        moved = model.with_parameters({own: values[own] * 1.01 + 1e-3}) if not model.parameters[own].constant else None
        if moved is not None and [state.initial for state in moved.equations().states] == starts:
            by.append(own)
    by = by[:3] + [f"{told.states[0].name}(0)"] * (len(by) < 2)
    to, t = 5.0, np.linspace(0.5, 5.0, 10)
    s = model.sensitivities(by, to=to, at=t, rtol=1e-13, record=model.states)
    for quantity in by:
        x0 = np.array(starts, dtype=complex)
        p = np.array([values.get(known, np.nan) for known in names], dtype=complex)
        if quantity.endswith("(0)"):
            x0[0] += 1e-30j
        else:
            p[names.index(quantity)] += 1e-30j
        run = scipy.integrate.solve_ivp(
            lambda at, x, p=p: np.array(rates(at, x, p), dtype=complex),
            (0, to),
            x0,
            "DOP853",
            t,
            rtol=1e-13,
            atol=1e-14,
            max_step=0.02,
        )
        for i, state in enumerate(told.states):
            exact = run.y[i].imag / 1e-30
            scale = max(np.abs(exact).max(), 1e-3 * np.abs(run.y[i].real).max())
            own_t = [int(np.argmin(np.abs(s.t - each))) for each in t]
            assert np.abs(s[state.name, quantity][own_t] - exact).max() <= TOLERANCE * scale, (state.name, quantity)
