"""Equations in CasADi, where it is installed: runs, and an optimal control."""

from __future__ import annotations

import numpy as np
import pytest

import halfarrow as ha
from conftest import MODELS

casadi = pytest.importorskip("casadi")


@pytest.mark.filterwarnings("ignore::halfarrow.ModelWarning")
@pytest.mark.parametrize(
    "name",
    [
        "quarter_car",
        "electrostatic",
        "double_pendulum",
        "rc_bridge",
        "rc_bridge_diode",
        "gear_train",
        "chain_of_rings",
        "class4",
    ],
)
def test_runs_are_the_same(name: str) -> None:
    model = ha.load(MODELS / name / "model.bond")
    to = 1e-4 if name == "electrostatic" else 1.0
    r = model.simulate(to=to, every=to / 50, rtol=1e-11, record="all")
    c = model.equations().casadi()
    conserved = {"K1": r["spring.q"][0] - r["gap.me.q"][0]} if name == "electrostatic" else {}
    values = [conserved[name] if value is None else value for name, value in zip(c.parameters, c.values)]
    # IDAS, which the blocks that are solved together need, stops at tolerances as small as those of CVODES.
    small, exact = 1e-20 if name == "electrostatic" else 1e-14, 1e-10 if c.algebraic else 1e-12
    options = {"abstol": 1e-12 if c.algebraic else small, "reltol": exact, "max_num_steps": 1_000_000}
    run = casadi.integrator("run", "idas" if c.algebraic else "cvodes", c.dae, 0, to, options)
    end = run(x0=c.start, z0=[r[name][0] for name in c.algebraic], p=values, u=[0.0] * len(c.inputs))
    for i, state in enumerate(c.states):
        assert abs(float(end["xf"][i]) - r[state][-1]) <= 1e-7 * np.abs(r[state]).max(), state


def test_conditions() -> None:
    model = ha.load(MODELS / "dc_motor_pid" / "model.bond")
    c = model.equations().casadi()
    rates = casadi.Function("rates", [c.dae[k] for k in "txup"], [c.dae["ode"]])
    before, after = (np.array(rates(t, [1, 2, 3], [100], c.values)).ravel() for t in (0.5, 0.7))
    np.testing.assert_allclose(after - before, [0, -0.02 / model.parameters["j"].value, 0], rtol=1e-12)


def test_all_words() -> None:
    model = ha.model(
        "model M\ninput u = 0\nparam m = 1\n"
        "Se:s(if u > 1 and u < 2 or u > 5 then 1 else if not (u < 0) then max(u, 2) else mod(u, 3)) -> I:i(m)\n"
    )
    c = model.equations().casadi()
    rates = casadi.Function("rates", [c.dae["u"], c.dae["p"]], [c.dae["ode"]])
    for u, wanted in [(1.5, 1), (6, 1), (3, 3), (0.5, 2), (-1, 2)]:
        assert float(rates(u, c.values)) == wanted


def test_events_are_refused() -> None:
    with pytest.raises(ha.UsageError, match="has events"):
        ha.load(MODELS / "when_bouncing_ball" / "model.bond").equations().casadi()


def test_an_optimal_control() -> None:
    """A cart without drag, moved by 1 m in 1 s from rest to rest with the least square of the force: u = 6 m (1 - 2 t)."""
    cart = ha.model(
        "model M\nparam m = 2 kg\ninput push : N = 0\nSe:hand(push) -> 1:v -> I:cart(m)\nstate x' = v.f from 0 m\n"
    )
    c = cart.equations().casadi()
    rates = casadi.Function("rates", [c.dae["x"], c.dae["u"], c.dae["p"]], [c.dae["ode"]])
    n = 50
    h = 1 / n
    problem = casadi.Opti()
    x, u = problem.variable(2, n + 1), problem.variable(1, n + 1)
    for k in range(n):
        f0, f1 = rates(x[:, k], u[:, k], c.values), rates(x[:, k + 1], u[:, k + 1], c.values)
        problem.subject_to(x[:, k + 1] == x[:, k] + h / 2 * (f0 + f1))
    way = c.states.index("x")
    problem.subject_to(x[:, 0] == 0)
    problem.subject_to(x[way, n] == 1)
    problem.subject_to(x[1 - way, n] == 0)
    problem.minimize(h * (casadi.sumsqr(u[:, 1:-1]) + casadi.sumsqr(u[:, 0]) / 2 + casadi.sumsqr(u[:, -1]) / 2))
    problem.solver("ipopt", {"print_time": False}, {"print_level": 0})
    found = problem.solve().value(u)
    # At the ends half a step counts.
    np.testing.assert_allclose(found[1:-1], (6 * 2 * (1 - 2 * np.linspace(0, 1, n + 1)))[1:-1], atol=0.02)
