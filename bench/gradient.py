"""Gradients: what the derivatives by all parameters cost beside the run itself, and beside derivatives one by one.

`pip install ./apps/python`, `python bench/gradient.py`. Ladders of resistors with a cubic law and compliances, each with a parameter
of its own; medians of turns, all by bytecode, as the way back is.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import halfarrow as ha

TURNS = 5
FEW = 10


def ladder(n: int) -> ha.Model:
    r, c = (", ".join(f"{first + step * i:g}" for i in range(n)) for first, step in ((2, 0.01), (0.1, 0.001)))
    return ha.model(
        f"model Ladder\nparam u = 3, r[{n}] = [{r}], c[{n}] = [{c}]\nSe:s(u*cos(3*t)) -> 1:b[1]\n"
        f"for i in 1..{n} {{ b[i] -> R:wire[i](e = r[i]*f + 0.1*f^3)\nb[i] -> 0:k[i]\nk[i] -> C:store[i](c[i]) }}\n"
        f"for i in 1..{n - 1} {{ k[i] -> 1:b[i + 1] }}\n"
    )


def seconds(work: Callable[[], Any]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def main() -> None:
    print(f"{'sections':>8} {'parameters':>10} {'method':>8} {'run / ms':>9} {'all by gradient':>16} {f'{FEW} one by one':>14}")
    for n in (20, 60, 200):
        net, few = ladder(n), [f"r[{i}]" for i in range(1, FEW + 1)]
        for name, method in (("rk4", {"method": "rk4", "step": 1e-3}), ("auto", {"rtol": 1e-8})):
            options: dict[str, Any] = {"to": 3.0, "every": 0.1, "execution": "bytecode", **method}
            works = (
                lambda: net.simulate(record="store[5].q", **options),
                lambda: net.gradient("final(store[5].q)", record="store[5].q", **options),
                lambda: net.sensitivities(few, record="store[5].q", **options),
            )
            times = [[seconds(work) for work in works] for _ in range(TURNS + 1)][1:]
            run, gradient, forward = (statistics.median(turn[i] for turn in times) for i in range(3))
            parameters = len(net.gradient("final(store[5].q)", **{**options, "to": 0.1}))
            print(f"{n:>8} {parameters:>10} {name:>8} {1e3 * run:>9.1f} {gradient / run:>16.1f} {forward / run:>14.1f}")


if __name__ == "__main__":
    main()
