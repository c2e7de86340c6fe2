"""What is exported for CasADi runs as the model does."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import halfarrow as ha

ca = pytest.importorskip("casadi")
MODELS = Path(__file__).resolve().parents[3] / "models"

TABLES = """model Tables "Tables of three kinds, conditions, a parameter that follows another one"
param m = 2, twice = 2*m
input push = 3
Se:s(push + (if body.f > 0.2 then 1 else 0) + table("smooth.csv", t, interpolation = cubic, outside = clamp)) -> 1:j -> I:body(m)
j -> I:other(twice)
j -> R:drag(e = f + max(f, 0)^2 + 0.1*table("smooth.csv", f, outside = extrapolate))
output stepped = table("smooth.csv", t + 0.3, interpolation = step, outside = clamp)
"""
SMOOTH = "x,y\n0,0\n0.1,1\n0.3,1.5\n0.6,1.75\n"


def loaded(model: ha.Model, folder: Path) -> Any:
    path = folder / "exported.py"
    model.export("casadi", path)
    spec = importlib.util.spec_from_file_location("exported", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def compared(model: ha.Model, folder: Path, to: float) -> None:
    exported = loaded(model, folder)
    method = "idas" if exported.z0 else "cvodes"
    options = {"abstol": 1e-13, "reltol": 1e-11, "max_num_steps": 100_000}
    run = ca.integrator("run", method, exported.dae(), 0, to, options)
    found = np.array(run(x0=exported.x0, z0=exported.z0, p=exported.u0 + exported.p0)["xf"]).ravel()
    own = model.simulate(to=to, every=to, rtol=1e-11, record=exported.STATES)
    expected = np.array([own[name][-1] for name in exported.STATES])
    assert np.abs(found - expected).max() <= 2e-8 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["chain_of_rings", "rc_bridge_cubic", "slider_crank", "dc_motor_pid", "double_pendulum"])
def test_it_runs_as_the_model_does(name: str, tmp_path: Path) -> None:
    compared(ha.load(MODELS / name / "model.bond"), tmp_path, 0.2)


def test_tables_and_conditions_are_those_of_the_model(tmp_path: Path) -> None:
    compared(ha.model(TABLES, files={"smooth.csv": SMOOTH}), tmp_path, 0.8)


def test_outputs_and_parameters_are_those_of_the_model(tmp_path: Path) -> None:
    car = ha.load(MODELS / "quarter_car" / "model.bond")
    exported = loaded(car, tmp_path)
    assert exported.PARAMETERS == ["ms", "mu", "ks", "kt", "b", "g"] and exported.INPUTS == ["road"]
    f = exported.function()
    p = [*exported.p0[:2], 20e3, *exported.p0[3:]]
    dx, _, y = f(0, exported.x0, exported.z0, [0.3], p)
    other = car.simulate(to=1e-9, rtol=1e-12, ks=20e3, road=0.3)
    for name, value in zip(exported.OUTPUTS, np.array(y).ravel(), strict=True):
        assert value == pytest.approx(other[name][0], rel=1e-12, abs=1e-12)
    gradient = ca.Function("g", [*(s := [ca.SX.sym("t"), ca.SX.sym("x", 4), ca.SX(0, 1), ca.SX.sym("u"), ca.SX.sym("p", 6)])[:2], *s[3:]],
                           [ca.jacobian(f(*s)[0], s[1])])  # fmt: skip
    lin = car.linearize(road=0.3, ks=20e3)
    assert np.allclose(np.array(gradient(0, exported.x0, 0.3, p)), lin.A, rtol=1e-12, atol=1e-12)


def test_what_has_a_memory_is_refused(tmp_path: Path) -> None:
    ball = ha.load(MODELS / "when_bouncing_ball" / "model.bond")
    with pytest.raises(ha.UsageError, match="have no memory"):
        ball.export("casadi", tmp_path / "ball.py")
