"""Imposed motion: with pi = m1 v1 + m2 (v1 + v) the common momentum, pi' = -k q - b v1 and q' = v1.

Between two rows of input.csv the input is linear, so the matrix exponential of (q, pi, v, slope) is exact.
Checked by numerical integration in v1, which uses the slope of the input instead of the momentum.
"""
import csv
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf
from reference_tools import agree, integrate, linear, write

m1, m2, k, b = mpf(4), mpf("1.5"), mpf(80), mpf(3)
times = ["0.2", "0.6", "1", "1.8", "3", "5"]
table = [(mpf(r["t"]), mpf(r["v"])) for r in csv.DictReader(open(Path(__file__).with_name("input.csv")))]


def piece(t):
    """Start, value and slope of the stretch of the input in which t lies."""
    for (t0, v0), (t1, v1) in zip(table, table[1:]):
        if t <= t1:
            return t0, v0, (v1 - v0) / (t1 - t0)


def speed(pi, v):
    return (pi - m2 * v) / (m1 + m2)


mass = m1 + m2
rows = [[0, 1 / mass, -m2 / mass, 0], [-k, -b / mass, b * m2 / mass, 0], [0, 0, 0, 1], [0, 0, 0, 0]]
states, (t, s) = [], (mpf(0), [mpf("0.05"), mpf(0)])
for end in sorted([mpf(x) for x in times] + [x for x, _ in table if 0 < x < mpf(times[-1])]):
    t0, v0, slope = piece((t + end) / 2)
    s = linear(rows, [*s, v0 + slope * (t - t0), slope], [end - t])[0][:2]
    t = end
    if t in [mpf(x) for x in times]:
        states.append(s)


def rates(t, s, middle):
    t0, v0, slope = piece(middle)
    q, v1 = s
    return [v1, (-k * q - b * v1 - m2 * slope) / mass]


inputs = [v0 + slope * (mpf(t) - t0) for t, (t0, v0, slope) in ((t, piece(mpf(t))) for t in times)]
v1 = [speed(pi, v) for (_, pi), v in zip(states, inputs)]
numeric = integrate(rates, [mpf("0.05"), mpf(0)], times, mpf("0.05"), 12, [x for x, _ in table])
agree([[q, v] for (q, _), v in zip(states, v1)], numeric)
v2 = [a + c for a, c in zip(v1, inputs)]
write(__file__, times, {
    "spring.q": [q for q, _ in states], "cart.f": v1, "carriage.f": v2,
    "cart.p": [m1 * v for v in v1], "carriage.p": [m2 * v for v in v2],
}, "matrix exponential, exact for the piecewise linear input", {"v": "input.csv"})
