"""Gearbox with a changing ratio n: w2 = n w1, and the momentum pi = j1 w1 + n j2 w2 obeys pi' = T - b n w2 + n' j2 w2.

Extrapolated midpoint rule of orders 24 and 20, piece by piece of input.csv; checked in the velocity form
(j1 + n² j2) w1' = T - b n² w1 - n n' j2 w1 and, for n, by its closed form on every piece.
"""
import csv
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import exp, mpf
from reference_tools import agree, integrate, twice, write

j1, j2, b, tau, torque = mpf("0.2"), mpf("1.5"), mpf("1.5"), mpf("0.2"), mpf(20)
times = ["0.2", "0.9", "1.2", "2", "3", "5"]
table = [(mpf(r["t"]), mpf(r["ratio"])) for r in csv.DictReader(open(Path(__file__).with_name("input.csv")))]
knots = [t for t, _ in table]


def piece(t):
    """Start, value and slope of the stretch of the input in which t lies."""
    for (t0, r0), (t1, r1) in zip(table, table[1:]):
        if t <= t1:
            return t0, r0, (r1 - r0) / (t1 - t0)


def lag(t, n, middle):
    t0, r0, slope = piece(middle)
    return (r0 + slope * (t - t0) - n) / tau


def momentum_form(t, s, middle):
    n, pi = s
    w1 = pi / (j1 + n**2 * j2)
    dn = lag(t, n, middle)
    return [dn, torque - b * n**2 * w1 + dn * j2 * n * w1]


def velocity_form(t, s, middle):
    n, w1 = s
    dn = lag(t, n, middle)
    return [dn, (torque - b * n**2 * w1 - n * dn * j2 * w1) / (j1 + n**2 * j2)]


def ratio(t):
    n, start = mpf("0.25"), mpf(0)
    for end in [x for x in knots if 0 < x < t] + [t]:
        t0, r0, slope = piece((start + end) / 2)
        settled = lambda s: r0 + slope * (s - t0 - tau)
        n, start = settled(end) + (n - settled(start)) * exp(-(end - start) / tau), end
    return n


n0, w0 = mpf("0.25"), mpf(50)
states = twice(momentum_form, [n0, (j1 + n0**2 * j2) * w0], times, "0.02", knots=knots)
n = [s[0] for s in states]
w1 = [pi / (j1 + r**2 * j2) for r, pi in states]
agree([[r] for r in n], [[ratio(mpf(t))] for t in times])
agree(list(zip(n, w1)), integrate(velocity_form, [n0, w0], times, mpf("0.02"), 12, knots))
bend = [velocity_form(mpf(t), s, mpf(t))[1] for t, s in zip(times, zip(n, w1))]
write(__file__, times, {
    "n": n, "flywheel.f": w1, "wheel.f": [r * w for r, w in zip(n, w1)], "flywheel.p": [j1 * w for w in w1],
    "wheel.p": [j2 * r * w for r, w in zip(n, w1)], "flywheel.e": [j1 * a for a in bend],
    "gearbox.in.e": [torque - j1 * a for a in bend],
}, "momentum form, extrapolation of order 24", {"ratio": "input.csv"})
