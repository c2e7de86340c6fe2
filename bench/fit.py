"""Fits: how often intervals hold the true values, and what exact derivatives save beside differences.

`pip install './apps/python[fit]'`, `python bench/fit.py [repetitions]`. The quarter car over a bump, its travel measured 201
times in 2 s with 1 mm of noise; stiffness and damping are fitted from the values of the model.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import scipy.optimize

import halfarrow as ha

CAR = Path(__file__).resolve().parents[1] / "models" / "quarter_car" / "model.bond"
TRUE = {"ks": 20e3, "b": 800.0}
ROAD = ([0, 0.5, 0.5, 0.6, 0.6, 2], [0, 0, 0.5, 0.5, 0, 0])
NOISE = 1e-3
LEVELS = (0.5, 0.9, 0.95)


def main(repetitions: int) -> None:
    car = ha.load(CAR)
    t = np.linspace(0, 2, 201)
    exact = car.simulate(to=2, at=t, rtol=1e-11, road=ROAD, record="travel", **TRUE)["travel"]
    rng = np.random.default_rng(0)
    held = {level: dict.fromkeys(TRUE, 0) for level in LEVELS}
    ours, theirs, apart = [], [], 0.0
    for repetition in range(repetitions):
        z = exact + NOISE * rng.normal(size=t.size)
        f = car.fit({"t": t, "z": z}, {"ks": (5e3, 50e3), "b": None}, outputs={"travel": "z"}, road=ROAD)
        ours.append((f.evaluations - f.jacobians, f.jacobians, f.seconds))
        for level in LEVELS:
            for name, value in TRUE.items():
                low, high = f.interval(name, level)
                held[level][name] += low <= value <= high
        if repetition < 20:
            runs = 0

            def residuals(x: np.ndarray, z: np.ndarray = z) -> np.ndarray:
                nonlocal runs
                runs += 1
                r = car.simulate(to=2, at=t, rtol=1e-8, road=ROAD, record="travel", ks=x[0], b=x[1])
                return r["travel"] - z

            begun = time.perf_counter()
            other = scipy.optimize.least_squares(
                residuals, [18e3, 900.0], bounds=([5e3, -np.inf], [50e3, np.inf]), x_scale=[18e3, 900.0],
                ftol=1e-10, xtol=1e-10, gtol=1e-10,
            )  # fmt: skip
            theirs.append((runs, time.perf_counter() - begun))
            errors = [e.error for e in f.estimates.values()]
            apart = max(apart, float(np.max(np.abs(f.x - other.x) / errors)))
    print(f"{repetitions} fits; of intervals of each level so many hold the true value")
    for level, by in held.items():
        spread = np.sqrt(level * (1 - level) / repetitions)
        shares = ", ".join(f"{name} {count / repetitions:.1%}" for name, count in by.items())
        print(f"  {level:.0%} +- {spread:.1%}: {shares}")
    plain, differentiated, seconds = np.median(ours, axis=0)
    runs, other_seconds = np.median(theirs, axis=0)
    print(f"a fit, median: {plain:.0f} runs and {differentiated:.0f} with derivatives, {seconds:.3f} s")
    print(f"by differences: {runs:.0f} runs, {other_seconds:.3f} s; minima apart by {apart:.1e} standard errors at most")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
