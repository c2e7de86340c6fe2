"""Ring with a gyrator: u1 + r f2 = e and e + r f1 = u2 give u2 - u1 = r (f1 + f2) = r Sf; the charges add up to the fed one.

Closed form. Checked at the flows: e is found once through each of the two meshes, with numerical derivatives of the charges.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, diff, mpf, sin
from reference_tools import write

k1, k2, r, size, w = mpf(1000), mpf(500), mpf(50), mpf("0.02"), mpf(5)
times = ["0.1", "0.3", "0.7", "1", "2", "5"]


def feed(t):
    return size * cos(w * t)


def fed(t):
    """Sum of the charges; u1(0) = 3 V."""
    q1 = 3 / k1
    return q1 + (k1 * q1 + r * feed(0)) / k2 + size / w * sin(w * t)


def first(t):
    return (k2 * fed(t) - r * feed(t)) / (k1 + k2)


def second(t):
    return (k1 * fed(t) + r * feed(t)) / (k1 + k2)


def flow(t):
    """Into C1."""
    return (k2 * feed(t) + r * w * size * sin(w * t)) / (k1 + k2)


points = [mpf(t) for t in times]
q1, q2 = [first(t) for t in points], [second(t) for t in points]
f1 = [flow(t) for t in points]
f2 = [feed(t) - f for t, f in zip(points, f1)]
effort = [k1 * q + r * f for q, f in zip(q1, f2)]
for t, e, q in zip(points, effort, q2):
    assert abs(e + r * diff(first, t) - k2 * q) < mpf("1e-15")
    assert abs(diff(second, t) - feed(t) + diff(first, t)) < mpf("1e-15")
write(__file__, times, {
    "C1.q": q1, "C2.q": q2, "C1.e": [k1 * q for q in q1], "C2.e": [k2 * q for q in q2],
    "C1.f": f1, "C2.f": f2, "n0a.e": effort, "charge": [fed(t) for t in points],
}, "closed form")
