"""What calling from Python costs beyond the engine's own time: `pip install './apps/python[xarray]'`, `python bench/python.py`.

Medians of many calls, in µs. The engine's own time is taken in the compiled part, around the run alone.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import halfarrow as ha

CAR = Path(__file__).resolve().parents[1] / "models" / "quarter_car" / "model.bond"


def median(call: Callable[[], object], calls: int = 2000) -> float:
    times = []
    for _ in range(calls):
        begun = time.perf_counter()
        call()
        times.append(time.perf_counter() - begun)
    return 1e6 * statistics.median(times)


def run_beyond(car: ha.Model, **values: float) -> tuple[float, float]:
    """A run of one step: what it takes beyond the engine, and the engine."""
    beyond, engine = [], []
    for _ in range(2000):
        begun = time.perf_counter()
        r = car.simulate(to=1e-3, step=1e-3, method="rk4", **values)
        took = time.perf_counter() - begun
        engine.append(r.report["seconds"])
        beyond.append(took - engine[-1])
    return 1e6 * statistics.median(beyond), 1e6 * statistics.median(engine)


def main() -> None:
    car = ha.load(CAR)
    car.simulate(to=1e-3)
    for words, values in [
        ("a run of one step", {}),
        ("the same with a parameter and an input", {"ks": 20e3, "road": 0.1}),
    ]:
        beyond, engine = run_beyond(car, **values)
        print(f"{words}: {beyond:.1f} beyond the engine's {engine:.1f}")
    with car.stepper(step=1e-3) as run:
        run["body.f"], run["road"]
        thousand = median(lambda: run.step(1000), 50)
        one = median(run.step)
        print(f"a step: {one:.2f}, of which the engine {thousand / 1000:.2f}")
        print(f"setting an input: {median(lambda: run.__setitem__('road', 0.1)):.2f}")
        print(f"reading a variable: {median(lambda: run['body.f']):.2f}")
    t = np.linspace(0, 1, 100_001)
    road = (t, np.sin(t))
    print(
        f"an input of 100,001 rows: {median(lambda: car.simulate(to=1e-3, step=1e-3, method='rk4', road=road), 20):.0f}"
    )
    r = car.simulate(to=10, every=1e-4)
    print(f"{len(r)} columns of {len(r.t)} samples to xarray: {median(r.to_xarray, 100):.0f}")


if __name__ == "__main__":
    main()
