"""Runs by steps."""

from __future__ import annotations

import os
import signal
import threading
from typing import Any

import numpy as np
import pytest

import halfarrow as ha


def test_steps_are_those_of_a_run(cart: ha.Model) -> None:
    whole = cart.simulate(to=1, every=0.1, method="rk4", step=1e-3, push=3)
    with cart.stepper(step=1e-3, push=3) as run:
        values = [run["cart.f"]]
        for _ in range(10):
            run.step(100)
            values.append(run["cart.f"])
        assert run.t == 1.0 and run.dt == 1e-3
    assert np.array(values).tobytes() == whole["cart.f"].tobytes()


def test_reading_and_setting(cart: ha.Model) -> None:
    with cart.stepper(step=1e-2, m="4 kg") as run:
        assert run["m"] == 4.0
        run["push"] = 3
        run.step()
        assert run["hand.e"] == 3.0 and run["speed"] == pytest.approx(3.6 * run["cart.f"])
        run["m"] = 1
        before = run["cart.f"]
        run.step()
        assert run["cart.f"] - before == pytest.approx(0.03, rel=0.02)
        with pytest.raises(ha.UnknownNameError, match="did you mean `push`"):
            run["puhs"] = 1
        with pytest.raises(ha.UnknownNameError, match="there is no variable `cart.g`; did you mean"):
            run["cart.g"]
        with pytest.raises(ha.UsageError, match="has to be finite"):
            run["push"] = float("nan")


def test_saved_and_restored(cart: ha.Model) -> None:
    with cart.stepper(step=1e-2) as run, cart.stepper(step=1e-2) as other:
        run["push"] = 3
        run.step(50)
        saved = run.save()
        run["push"] = 1
        run.step(50)
        later = run["cart.f"]
        for again in (run, other):
            again.restore(saved)
            assert again.t == 0.5
            again["push"] = 1
            again.step(50)
            assert again["cart.f"] == later


def test_closed(cart: ha.Model) -> None:
    with cart.stepper(step=1e-2) as run:
        assert "at t = 0 s" in repr(run)
    with pytest.raises(ha.UsageError, match="was closed"):
        run.step()
    assert "closed" in repr(run)


def test_what_cannot_be(cart: ha.Model) -> None:
    with pytest.raises(ha.UsageError, match="above 0"):
        cart.stepper(step=0)
    with pytest.raises(ha.UsageError, match="did you mean `heun`"):
        cart.stepper(step=1, method="huen")  # type: ignore[arg-type]


def test_a_run_that_stops() -> None:
    growing = ha.model("model M\nstate x' = x^2 from 1\nSe:a(x) -> R:r(1)\n")
    with growing.stepper(step=1e-3) as run:
        with pytest.raises(ha.RunError):
            run.step(10_000)
        assert 0.9 < run.t < 1.2 and np.isfinite(run["x"])


def test_control_c(cart: ha.Model) -> None:
    with cart.stepper(step=1e-6) as run:
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            run.step(10**12)
        assert run.t > 0
        run.step()


@pytest.mark.parametrize("steps", [-1, 1.5, "1"])
def test_what_is_no_number_of_steps(cart: ha.Model, steps: Any) -> None:
    with cart.stepper(step=1e-3) as run, pytest.raises(ha.UsageError, match="give a whole number of them"):
        run.step(steps)


SLIDER_CRANK = """model SliderCrank
param j = 0.002 kg.m2
state theta' = w.f from 0.3 rad
state phi' = v.f from asin(sin(0.3 rad)/3)
state x' = slide.f from 0.1*cos(0.3 rad) + 0.3*cos(asin(sin(0.3 rad)/3))
1:w -> I:crank(j, f0 = 200 rad/s)
1:v -> I:rod(0.001 kg.m2)
w -> TF:wx(f_out = -0.1*sin(theta)) -> 0:along
v -> TF:vx(f_out = -0.3*sin(phi)) -> along -> 1:slide -> I:slider(0.5 kg)
w -> TF:wy(f_out = 0.1*cos(theta)) -> 0:across
v -> TF:vy(f_out = -0.3*cos(phi)) -> across -> ZC:guide
"""


# Steps long enough for positions to drift are longer than the audit likes.
@pytest.mark.filterwarnings("ignore::halfarrow.AuditWarning")
@pytest.mark.parametrize("project", [False, True])
def test_positions_that_only_speeds_keep(project: bool) -> None:
    model = ha.model(SLIDER_CRANK)
    alone = model.simulate(to=0.3, step=5e-4, method="rk4", project=project)
    told = {drift.relation: drift for drift in alone.audit.drift}
    assert len(told) == 2
    with model.stepper(step=5e-4, project=project) as run:
        run.step(600)
        assert run["x"] == alone["x"][-1]
        for drift in run.drift:
            assert drift.kind == "closed" and drift.greatest is None and drift.value is not None
            value = told[drift.relation].value
            assert value is not None and abs(drift.value - value) < 1e-15
            assert (abs(drift.value) < 1e-14) == project
    swept = model.sweep(to=0.3, step=5e-4, j=[0.001, 0.002, 0.004], project=project)
    assert swept["final(x)"][1] == alone["x"][-1]
    assert [drift["sets"] for drift in swept.drift] == [3, 3]
    assert all((drift["greatest"] < 1e-14) == project for drift in swept.drift)
    f = model.function("j", ["x"], to=0.3, every=0.1, step=5e-4, method="rk4", project=project)
    assert f([[0.002]])[0, -1, 0] == pytest.approx(alone["x"][-1], abs=1e-12)
    (of_set,) = f.drift([[0.002]])
    assert set(of_set) == set(told)
    if project:
        with pytest.raises(ha.UsageError, match="not differentiated"):
            f.jacobian([[0.002]])
    else:
        assert f.jacobian([[0.002]]).shape == (1, 4, 1, 1)
