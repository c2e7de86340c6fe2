"""Exact derivatives of runs."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import halfarrow as ha
from conftest import MODELS

OSCILLATOR = """model Oscillator
param m = 2 kg, k = 50 N/m, b = 1.5 N.s/m, q0 = 0.1 m
input push : N = 0.3*k*q0
Se:hand(push) -> 1:v -> I:mass(m)
v -> C:spring(k = k, q0 = q0)
v -> R:damper(b)
"""


def exact(t: float, m: float, k: float, b: float, q0: float, push: float, f0: float) -> mpmath.mpf:
    """Displacement of a damped oscillator under a constant force."""
    rest, decay = push / k, b / (2 * m)
    omega = mpmath.sqrt(k / m - decay**2)
    away = q0 - rest
    wave = away * mpmath.cos(omega * t) + (f0 + decay * away) / omega * mpmath.sin(omega * t)
    return rest + mpmath.exp(-decay * t) * wave


def test_against_thirty_digits() -> None:
    names = ["m", "k", "b", "q0", "push", "mass.f(0)"]
    values = {"m": 2.0, "k": 50.0, "b": 1.5, "q0": 0.1, "f0": 0.0}
    model = ha.model(OSCILLATOR)
    s = model.sensitivities(names, to=3, every=0.25, rtol=1e-11, record="spring.q")
    assert s.names == ["spring.q"] and s.by == names and s.array().shape == (13, 1, 6)

    def displacement(name: str, t: float, value: object) -> object:
        known = {own: mpmath.mpf(v) for own, v in values.items()}
        known["push"] = mpmath.mpf(3) / 10 * known["k"] * known["q0"]
        own = {"mass.f(0)": "f0"}.get(name, name)
        known[own] = value
        # The input follows from parameters unless it is varied itself.
        if own in ("k", "q0"):
            known["push"] = mpmath.mpf(3) / 10 * known["k"] * known["q0"]
        return exact(t, **known)

    with mpmath.workdps(30):
        for name in names:
            at = {"push": 1.5, "mass.f(0)": 0.0}.get(name, values.get(name))
            wanted = [float(mpmath.diff(lambda v: displacement(name, t, v), mpmath.mpf(at))) for t in s.t.tolist()]
            scale = np.abs(wanted).max()
            np.testing.assert_allclose(s["spring.q", name], wanted, atol=1e-8 * scale, rtol=0)


def test_by_the_numbers_of_a_start() -> None:
    model = ha.model(OSCILLATOR)
    by_name = model.sensitivities(["spring.q(0)", "q0"], to=1, every=0.5, push=0.0)
    np.testing.assert_array_equal(by_name["spring.q", "spring.q(0)"], by_name["spring.q", "q0"])
    assert by_name.units["mass.f", "q0"] == "(m/s)/(m)"


def test_tables() -> None:
    s = ha.model(OSCILLATOR).sensitivities("k", to=1, every=0.5)
    frame = s.to_pandas()
    assert frame.columns.names == ["variable", "by"] and frame.shape == (3, 2)
    np.testing.assert_array_equal(frame["spring.q", "k"], s["spring.q", "k"])
    np.testing.assert_array_equal(s.result["d(spring.q)/d(k)"], s["spring.q", "k"])
    assert "Sensitivities of mass.f, spring.q by k" in repr(s) and "spring.q" in s._repr_html_()
    with pytest.raises(ha.UnknownNameError, match="variable `spring`"):
        s["spring", "k"]


def test_samples_at_given_times() -> None:
    model = ha.model(OSCILLATOR)
    at = [0.0, 0.1, 0.37, 0.9]
    r = model.simulate(to=0.9, at=at, rtol=1e-10)
    np.testing.assert_array_equal(r.t, at)
    dense = model.simulate(to=0.9, every=0.01, rtol=1e-10)
    np.testing.assert_allclose(r["spring.q"], dense["spring.q"][[0, 10, 37, 90]], atol=1e-10)
    with pytest.raises(ha.UsageError, match="after the time before it"):
        model.simulate(to=1, at=[0.2, 0.1])


def test_through_bounces() -> None:
    ball = ha.load(MODELS / "when_bouncing_ball" / "model.bond")
    s = ball.sensitivities(["e", "h(0)"], to=1, every=1, rtol=1e-11)
    g, e, h, t = 9.81, 0.8, 1.0, 1.0
    fall = np.sqrt(2 * h / g)
    # Between the first and the second bounce.
    tau = t - fall
    by_fall = e * g * tau - e * g * fall + g * tau
    np.testing.assert_allclose(s["h", "e"][-1], g * fall * tau, rtol=1e-9)
    np.testing.assert_allclose(s["h", "h(0)"][-1], by_fall * fall / (2 * h), rtol=1e-9)


def test_what_is_refused() -> None:
    model = ha.model(OSCILLATOR)
    with pytest.raises(ha.UsageError, match="no parameter or input `kk`"):
        model.sensitivities("kk", to=1)
    with pytest.raises(ha.UsageError, match="second derivatives"):
        model.sensitivities("k", to=1, method="rosenbrock", step=1e-3)
    delayed = ha.model("model M\nparam m = 1\nSe:s(delay(1 - mass.f, 0.1)) -> I:mass(m)\n")
    with pytest.raises(ha.UsageError, match="delayed"):
        delayed.sensitivities("m", to=1)
    pad = ha.model("model S\nparam v = 1, fc = 2\n1:j -> I:m(1, f0 = v)\nj -> R:pad(friction = fc)\n")
    with pytest.raises(ha.RunError, match="at t = 0.5.* pad has no derivative"):
        pad.sensitivities("v", to=2)
