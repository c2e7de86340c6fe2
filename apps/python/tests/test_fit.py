"""Fits: against SciPy with differences, intervals, what the data do not tell, several runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.optimize

import halfarrow as ha

CAR = """model Car
param m = 300 kg, k = 18 kN/m, b = 900 N.s/m
param q0 = 0.05 m
input road : m/s = 0
Sf:ground(road) -> 0:strut -> 1:chassis -> I:body(m)
strut -> 1:gap -> C:spring(k = k, q0 = q0)
gap -> R:damper(b)
output travel = spring.q : mm
"""
TRUE = {"k": 20e3, "b": 1200.0}
ROAD = ([0, 0.2, 0.2, 0.4, 0.4, 2], [0, 0, 0.5, 0.5, 0, 0])
NOISE = 0.3


@pytest.fixture(scope="module")
def car() -> ha.Model:
    return ha.model(CAR, name="car.bond")


def measured(car: ha.Model, seed: int, noise: float = NOISE, **values: object) -> dict[str, np.ndarray]:
    t = np.linspace(0, 2, 81)
    r = car.simulate(to=2, at=t, rtol=1e-10, **{**TRUE, "road": ROAD, **values})  # type: ignore[arg-type]
    rng = np.random.default_rng(seed)
    return {
        "t": t,
        "z_meas": r["travel"] + noise * rng.normal(size=t.size),
        "v_meas": r["body.f"] + 1e-3 * rng.normal(size=t.size),
    }


def test_as_scipy_with_differences(car: ha.Model) -> None:
    data = measured(car, 1)
    f = car.fit(
        data, {"k": ("5 kN/m", "50 kN/m"), "b": None}, outputs={"travel": "z_meas"}, sigma={"travel": NOISE}, road=ROAD
    )
    assert f.success and f.rank == 2 and not f.unidentified

    runs = 0

    def residuals(x: np.ndarray) -> np.ndarray:
        nonlocal runs
        runs += 1
        r = car.simulate(to=2, at=data["t"], rtol=1e-10, road=ROAD, k=x[0], b=x[1], record="travel")
        return (r["travel"] - data["z_meas"]) / NOISE

    other = scipy.optimize.least_squares(
        residuals, [18e3, 900], bounds=([5e3, -np.inf], [50e3, np.inf]), x_scale=[18e3, 900], xtol=1e-10, ftol=1e-10
    )
    np.testing.assert_allclose(f.x, other.x, rtol=1e-5)
    covariance = np.linalg.inv(other.jac.T @ other.jac)
    np.testing.assert_allclose([e.error for e in f.estimates.values()], np.sqrt(np.diag(covariance)), rtol=1e-3)
    np.testing.assert_allclose(
        f.correlation[0, 1], covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]), atol=1e-3
    )
    assert f.evaluations < runs
    low, high = f.interval("k")
    assert low < 20e3 < high and f["k"] == f.x[0] == f.model.parameters["k"].value
    assert "k  " in f.table and "N/m" in f.table and "sum of squares" in repr(f)


def test_derivatives_of_residuals(car: ha.Model) -> None:
    f = car.fit(measured(car, 1), {"k": None, "b": None}, outputs={"travel": "z_meas", "body.f": "v_meas"}, road=ROAD)
    x = f.x * 1.01
    jacobian = f.problem.jacobian(x)
    for i in range(2):
        step = np.zeros(2)
        step[i] = 1e-4 * x[i]
        difference = (f.problem.residuals(x + step) - f.problem.residuals(x - step)) / (2 * step[i])
        np.testing.assert_allclose(jacobian[:, i], difference, atol=1e-5 * np.abs(difference).max())


def test_intervals_cover(car: ha.Model) -> None:
    """Of intervals of 90 % nine of ten hold the true value."""
    count, held = 60, np.zeros(2)
    for seed in range(count):
        f = car.fit(
            measured(car, 100 + seed), {"k": None, "b": None}, outputs={"travel": "z_meas"}, road=ROAD, tolerance=1e-6
        )
        for i, (name, value) in enumerate(TRUE.items()):
            low, high = f.interval(name, 0.9)
            held[i] += low <= value <= high
    # Four standard deviations of a binomial number.
    spread = 4 * np.sqrt(count * 0.9 * 0.1)
    assert np.all(np.abs(held - 0.9 * count) < spread), held


def test_profile(car: ha.Model) -> None:
    f = car.fit(measured(car, 3), {"k": (5e3, 50e3), "b": (100, 5000)}, outputs={"travel": "z_meas"}, road=ROAD)
    p = f.profile("b")
    np.testing.assert_allclose(p.interval, f.interval("b"), rtol=0.02)
    assert p.sums.min() == f.cost and len(p.values) == len(p.sums) > 5 and np.all(np.diff(p.values) > 0)


def test_what_the_data_do_not_tell(car: ha.Model) -> None:
    # Only ratios of mass, stiffness and damping count for a travel.
    f = car.fit(measured(car, 2), {"k": None, "b": None, "m": None}, outputs={"travel": "z_meas"}, road=ROAD)
    assert f.rank == 2 and len(f.unidentified) == 1
    combination = f.unidentified[0]
    assert set(combination) == {"k", "b", "m"}
    np.testing.assert_allclose(list(combination.values()), 1 / np.sqrt(3), atol=1e-3)
    assert np.isinf(f.estimates["k"].error) and f.interval("m") == (-np.inf, np.inf)
    assert "the data do not tell" in repr(f) and "not told by the data" in f.table


def test_several_runs_weights_and_starts(car: ha.Model, tmp_path: Path) -> None:
    first = measured(car, 4)
    other = ([0, 1, 1, 2], [0.1, 0.1, -0.2, -0.2])
    second = measured(car, 5, road=other, m=350.0)
    second["road"] = np.interp(second["t"], *other)
    second["z_meas"][3:7] = np.nan
    second["z_sigma"] = np.full(second["t"].size, NOISE)
    path = tmp_path / "first.csv"
    np.savetxt(path, np.column_stack(list(first.values())), delimiter=",", header=",".join(first), comments="")
    experiments = [
        ha.Experiment(path, inputs={"road": ROAD}, sigma={"travel": NOISE}, name="bump"),
        ha.Experiment(second, inputs={"road": other}, parameters={"m": 350.0}, sigma={"travel": "z_sigma"}),
    ]
    f = car.fit(experiments, {"k": (5e3, 50e3), "b": (200, 5000)}, outputs={"travel": "z_meas"}, start=4)
    assert len(f.residuals) == 81 + 77 and len(f.starts) == 4 and f.variance == 1.0
    ends = [s["cost"] for s in f.starts if np.isfinite(s["cost"])]
    np.testing.assert_allclose(min(ends), f.cost)
    for name, value in TRUE.items():
        assert abs(f[name] - value) < 4 * f.estimates[name].error
    assert len(f.predicted()) == 2 and f.plot().axes
    # The same with a column as the input.
    second_alone = ha.Experiment(second, inputs={"road": "road"}, parameters={"m": 350.0})
    assert car.fit([second_alone], {"k": None}, outputs={"travel": "z_meas"}, b=1200).success


def test_outliers(car: ha.Model) -> None:
    data = measured(car, 6)
    data["z_meas"][10:16] += 40.0
    plain = car.fit(data, {"k": None, "b": None}, outputs={"travel": "z_meas"}, sigma={"travel": NOISE}, road=ROAD)
    robust = car.fit(
        data, {"k": None, "b": None}, outputs={"travel": "z_meas"}, sigma={"travel": NOISE}, road=ROAD, loss="cauchy"
    )
    miss = [abs(f["k"] - TRUE["k"]) for f in (plain, robust)]
    assert miss[1] < 0.2 * miss[0]


def test_starts_as_parameters(car: ha.Model) -> None:
    data = measured(car, 7, q0=0.08)
    f = car.fit(data, {"q0": (0.0, 0.2), "k": None}, outputs={"travel": "z_meas"}, road=ROAD, b=1200)
    assert abs(f["q0"] - 0.08) < 4 * f.estimates["q0"].error
    # The same by the name of the start value, and one of which the model says nothing.
    g = car.fit(
        data, {"spring.q(0)": None, "k": None, "body.f(0)": (-1, 1)}, outputs={"travel": "z_meas"}, road=ROAD, b=1200
    )
    assert abs(g["spring.q(0)"] - 0.08) < 4 * g.estimates["spring.q(0)"].error
    assert abs(g["body.f(0)"]) < 4 * g.estimates["body.f(0)"].error and g.estimates["body.f(0)"].unit == "m/s"


def test_what_is_refused(car: ha.Model) -> None:
    data = measured(car, 1)
    with pytest.raises(ha.UsageError, match="nothing is fitted"):
        car.fit(data, {}, outputs={"travel": "z_meas"})
    with pytest.raises(ha.UsageError, match="nothing is compared"):
        car.fit(data, {"k": None})
    with pytest.raises(ha.UnknownNameError, match="z_mea"):
        car.fit(data, {"k": None}, outputs={"travel": "z_mea"})
    with pytest.raises(ha.UnknownNameError, match="kk"):
        car.fit(data, {"kk": None}, outputs={"travel": "z_meas"})
    with pytest.raises(ha.UsageError, match="below the second"):
        car.fit(data, {"k": (5, 1)}, outputs={"travel": "z_meas"})
    with pytest.raises(ha.UsageError, match="column `t`"):
        car.fit({"z": [1.0]}, {"k": None}, outputs={"travel": "z"})


def test_deviations_are_given_for_all_outputs_or_for_none(cart: ha.Model) -> None:
    t = np.linspace(0, 4, 41)
    r = cart.simulate(to=4, at=t, push=3, record="all")
    data = {"t": t, "v": r["speed"], "p": r["cart.p"]}
    ask: dict[str, Any] = {"outputs": {"speed": "v", "cart.p": "p"}, "push": 3}
    with pytest.raises(ha.UsageError, match="no standard deviation of `cart.p`: give them for all"):
        cart.fit(data, {"m": None}, sigma={"speed": 0.1}, **ask)
    with pytest.raises(ha.UnknownNameError, match="output `sped`; did you mean `speed`"):
        cart.fit(data, {"m": None}, sigma={"sped": 0.1}, **ask)
    with pytest.raises(ha.UnknownNameError, match="column `sd`"):
        cart.fit(data, {"m": None}, sigma={"speed": "sd", "cart.p": 1}, **ask)
    # Of several experiments each has its own outputs.
    halves = [ha.Experiment(data, outputs={own: ask["outputs"][own]}) for own in ask["outputs"]]
    f = cart.fit(halves, {"m": None}, sigma={"speed": 0.1, "cart.p": 0.1}, push=3)
    assert f.variance == 1.0 and abs(f["m"] - 2) < 1e-6
    f = cart.fit(data, {"m": (1, 5), "b": None}, sigma={"speed": 0.1, "cart.p": 0.1}, **ask)
    profile = f.profile("m")
    axes = profile.plot()
    assert axes.get_xlabel() == "m" and profile.bound > f.cost
