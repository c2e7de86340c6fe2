"""Indices of outputs whose indices are known."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import halfarrow as ha

pytest.importorskip("SALib")

# At the end of a long run the current is (a + b + c)/r, and the power of the source k a^2/r.
SUM = """model Sum
param a = 1 V, b = 1 V, c = 1 V, r = 2 ohm
Se:s1(a) -> 1:j -> I:coil(1 H)
Se:s2(b) -> j
Se:s3(c) -> j
j -> R:wire(r)
"""
PRODUCT = """model Product
param e = 1, g = 1
Se:s(e) -> 1:j -> I:coil(0.5)
j -> R:wire(1/g)
"""


def test_a_sum() -> None:
    ranges = {"a": (0.0, 3.0), "b": ("1 V", "3 V"), "c": (-1.0, 0.0)}
    s = ha.model(SUM).sobol(ranges, to=12, step=2e-2, n=1024, reduce={"current": ("coil.f", "final")})
    # Variances of values that are equally likely go by the squares of the widths.
    parts = np.array([9.0, 4.0, 1.0]) / 14
    found = s["current"]
    np.testing.assert_allclose(found.first, parts, atol=0.01)
    np.testing.assert_allclose(found.total, parts, atol=0.01)
    assert (np.abs(found.first - parts) < 2 * found.first_error).all()
    assert (np.abs(found.total - parts) < 2 * found.total_error).all()
    assert found.second is not None and found.second_error is not None
    assert np.isnan(np.diag(found.second)).all() and (found.second == found.second.T)[~np.eye(3, dtype=bool)].all()
    assert np.nanmax(np.abs(found.second)) < 0.05
    assert s.parameters == ["a", "b", "c"] and s.units["current"] == "A" and len(s.sweep.sets) == 1024 * 8
    assert repr(s).splitlines()[1].split() == ["output", "by", "first", "first_error", "total", "total_error"]
    assert "<table>" in s._repr_html_() and "95 %" in s._repr_html_()
    frame = s.to_pandas()
    assert frame.loc[("current", "a"), "total"] == found.total[0] and frame.shape == (3, 4)
    with pytest.raises(ha.UnknownNameError, match="did you mean `current`"):
        s["curent"]


def test_a_product_has_a_part_of_both() -> None:
    s = ha.model(PRODUCT).sobol({"e": (0.0, 2.0), "g": (0.5, 1.5)}, to=16, step=2e-2, n=1024, reduce=["final(coil.f)"])
    variances = np.array([4 / 12, 1 / 12])
    whole = (variances[0] + 1) * (variances[1] + 1) - 1
    found = s["final(coil.f)"]
    # Both means are 1.
    np.testing.assert_allclose(found.first, variances / whole, atol=0.02)
    np.testing.assert_allclose(found.total, (variances + variances.prod()) / whole, atol=0.02)
    assert found.second is not None
    assert found.second[0, 1] == pytest.approx(variances.prod() / whole, abs=0.04)


def test_effects_of_a_sum() -> None:
    ranges = {"a": (0.0, 3.0), "b": (1.0, 3.0), "c": (0.0, -1.0)}
    m = ha.model(SUM)
    with pytest.raises(ha.UsageError, match="`c` is given the range 0 to -1"):
        m.morris(ranges, to=2)
    s = m.morris({**ranges, "c": (-1.0, 0.0)}, to=12, step=1e-2, n=10, reduce={"current": ("coil.f", "final")})
    found = s["current"]
    rate = 1 - np.exp(-2 * 12)
    np.testing.assert_allclose(found.mean, np.array([3.0, 2.0, 1.0]) / 2 * rate, rtol=1e-9)
    np.testing.assert_allclose(found.mean_abs, found.mean, rtol=1e-9)
    np.testing.assert_allclose(found.deviation, 0, atol=1e-9)
    assert len(s.sweep.sets) == 40 and list(s.to_pandas()) == ["mean", "mean_abs", "mean_abs_error", "deviation"]


def test_the_same_seed_gives_the_same_through_executors_too() -> None:
    m = ha.model(SUM)
    ask = dict(to=1, step=1e-2, n=64, reduce=["max(coil.f)"], second_order=False)
    ranges = {"a": (0.0, 3.0), "r": (1.0, 2.0)}
    here, other = m.sobol(ranges, **ask), m.sobol(ranges, **ask, seed=1)
    with ThreadPoolExecutor(2) as executor:
        there = m.sobol(ranges, **ask, executor=executor)
    assert here["max(coil.f)"].first.tobytes() == there["max(coil.f)"].first.tobytes()
    assert here["max(coil.f)"].total_error.tobytes() == there["max(coil.f)"].total_error.tobytes()
    assert here["max(coil.f)"].second is None and here["max(coil.f)"].first[0] != other["max(coil.f)"].first[0]


def test_start_values_vary() -> None:
    m = ha.model("model M\nparam k = 1\n1:v -> I:mass(1)\nv -> C:spring(k = k)\nv -> R:drag(0.5)\n")
    ranges = {"mass.f(0)": (0.0, 1.0), "spring.q(0)": (0.0, 2.0)}
    s = m.morris(ranges, to=1, rtol=1e-10, reduce=["final(mass.f)"])
    # The speed is linear in both: derivatives times widths.
    slopes = m.sensitivities(list(ranges), to=1, every=1, rtol=1e-10)
    expected = [slopes["mass.f", "mass.f(0)"][-1], 2 * slopes["mass.f", "spring.q(0)"][-1]]
    np.testing.assert_allclose(s["final(mass.f)"].mean, expected, rtol=1e-7)
    with ThreadPoolExecutor(1) as executor, pytest.raises(ha.UsageError, match="in an executor"):
        m.morris(ranges, to=1, executor=executor)


def test_failed_sets_are_refused_with_the_reason() -> None:
    growing = ha.model("model M\nparam a = 1\nstate x' = a*x^2 from 1\nSe:s(x) -> R:r(1)\n")
    with pytest.raises(ha.RunError, match=r"sets failed, and the estimates need all of them; set \d+ \(a = 1.*\): .+") as error:
        growing.sobol({"a": (0.5, 1.2)}, to=1, n=8, reduce=["final(x)"])
    assert isinstance(error.value.result, ha.SweepResult) and error.value.result.failed.any()


def test_what_is_wrong_is_told() -> None:
    m = ha.model(SUM)
    with pytest.raises(ha.UnknownNameError, match="did you mean `coil.f\\(0\\)`"):
        m.sobol({"coil.g(0)": (0, 1)}, to=1)
    with pytest.raises(ha.UnknownNameError, match="there is no parameter `rr`; did you mean `r`"):
        m.sobol({"rr": (0, 1)}, to=1)
    with pytest.raises(ha.UnknownNameError, match="no argument of sobol; did you mean `second_order`"):
        m.sobol({"r": (1, 2)}, to=1, secnd_order=False)
    with pytest.raises(ha.UnknownNameError, match="no argument of morris; did you mean `reduce`"):
        m.morris({"r": (1, 2)}, to=1, reduc=["final(coil.f)"])
    with pytest.raises(ha.UsageError, match="power of two; give 1024"):
        m.sobol({"r": (1, 2)}, to=1, n=1000)
    with pytest.raises(ha.UsageError, match="`r` varies and is given a value"):
        m.sobol({"r": (1, 2)}, to=1, r=3.0)
    with pytest.raises(ha.UsageError, match="several values"):
        m.morris({"r": (1, 2)}, to=1, step=0.01, a=[1.0, 2.0])
    with pytest.raises(ha.UsageError, match="give its range"):
        m.sobol({"r": 3.0}, to=1)  # type: ignore[dict-item]
    with pytest.raises(ha.UsageError, match="`final\\(s1.e\\)` is 1 in all sets"):
        m.sobol({"r": (1, 2)}, to=1, n=4, step=0.01, reduce=["final(s1.e)"])
    with pytest.raises(ha.UsageError, match="has to be even"):
        m.morris({"r": (1, 2)}, to=1, levels=3)
    with pytest.raises(ha.UsageError, match="leave out `whole`"):
        m.morris({"r": (1, 2)}, to=1, whole=True)
    with pytest.raises(ha.UsageError, match="seed is -1"):
        m.morris({"r": (1, 2)}, to=1, seed=-1)
