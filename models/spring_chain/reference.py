"""Spring chain in the ways x1, x2 of the masses: q1 = q10 + x1, q2 = q20 + x1 - x2, q3 = q30 + x2.

Matrix exponential of the four mechanical states; checked by integrating all five storages.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf, sin
from reference_tools import agree, integrate, linear, write

m1, m2, k1, k2, k3, b = mpf(1), mpf(2), mpf(40), mpf(60), mpf(25), mpf("1.5")
start, v0, size, w = [mpf("0.02"), mpf("0.03"), mpf("-0.04")], mpf("0.3"), mpf(2), mpf(3)
times = ["0.1", "0.3", "0.7", "1", "2", "5"]
force1 = -k1 * start[0] - k2 * start[1]
force2 = k2 * start[1] - k3 * start[2]
rows = [
    [0, 0, 1, 0, 0, 0, 0],
    [0, 0, 0, 1, 0, 0, 0],
    [-(k1 + k2) / m1, k2 / m1, 0, 0, force1 / m1, size / m1, 0],
    [k2 / m2, -(k2 + k3) / m2, 0, -b / m2, force2 / m2, 0, 0],
    [0] * 7,
    [0] * 6 + [w],
    [0] * 5 + [-w, 0],
]
ways = [s[:4] for s in linear(rows, [0, 0, v0, 0, 1, 0, 1], times)]
states = [[start[0] + x, start[1] + x - y, start[2] + y, u, v] for x, y, u, v in ways]


def rates(t, s):
    q1, q2, q3, u, v = s
    return [u, u - v, v, (size * sin(w * t) - k1 * q1 - k2 * q2) / m1, (k2 * q2 - k3 * q3 - b * v) / m2]


agree(states, integrate(rates, [*start, v0, mpf(0)], times, mpf("0.05"), 12))
q1, q2, q3, u, v = zip(*states)
change = [rates(mpf(t), s) for t, s in zip(times, states)]
write(__file__, times, {
    "spring1.q": q1, "spring2.q": q2, "spring3.q": q3, "mass1.f": u, "mass2.f": v,
    "mass1.e": [m1 * c[3] for c in change], "mass2.e": [m2 * c[4] for c in change],
    "constant": [start[0] - start[1] - start[2]] * len(times),
}, "matrix exponential")
