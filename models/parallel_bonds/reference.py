"""Parallel bonds: m v' = F - 2 k q and 2 v = q' + k q/r.

Matrix exponential; checked by numerical integration.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf
from reference_tools import agree, integrate, linear, write

m, k, r, force = mpf(2), mpf(30), mpf(8), mpf(5)
times = ["0.1", "0.3", "0.7", "1", "2", "4"]


def rates(t, s):
    v, q = s
    return [(force - 2 * k * q) / m, 2 * v - k * q / r]


rows = [[0, -2 * k / m, force / m], [2, -k / r, 0], [0, 0, 0]]
states = [s[:2] for s in linear(rows, [mpf("0.4"), mpf("0.1"), 1], times)]
agree(states, integrate(rates, [mpf("0.4"), mpf("0.1")], times, mpf("0.02"), 12))
v, q = zip(*states)
write(__file__, times, {
    "body.f": v, "spring.q": q, "spring.f": [rates(0, s)[1] for s in states], "damper.f": [k * x / r for x in q],
    "upper.f": v, "lower.f": v, "upper.e": [k * x for x in q], "body.e": [force - 2 * k * x for x in q],
    "through": [2 * s for s in v],
}, "matrix exponential")
