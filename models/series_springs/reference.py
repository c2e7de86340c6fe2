"""Series springs: one force k (q1 + q2), 1/k = 1/k1 + 1/k2, between two free masses; the momentum stays.

Closed form of the relative motion; checked by integrating both masses.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, mpf, sin, sqrt
from reference_tools import agree, integrate, write

m1, m2, k1, k2 = mpf(1), mpf(2), mpf(40), mpf(60)
k = k1 * k2 / (k1 + k2)
v1, v2 = mpf("0.5"), mpf("-0.1")
q = mpf("0.03") * k1 / k
momentum = m1 * v1 + m2 * v2
own = sqrt(k * (1 / m1 + 1 / m2))
times = ["0.1", "0.3", "0.7", "1", "2", "5"]


def motion(t):
    """Speeds of the masses and stretch of both springs together."""
    stretch = q * cos(own * t) + (v1 - v2) / own * sin(own * t)
    apart = (v1 - v2) * cos(own * t) - q * own * sin(own * t)
    return [(momentum + m2 * apart) / (m1 + m2), (momentum - m1 * apart) / (m1 + m2), stretch]


def rates(t, s):
    return [-k * s[2] / m1, k * s[2] / m2, s[0] - s[1]]


states = [motion(mpf(t)) for t in times]
agree(states, integrate(rates, [v1, v2, q], times, mpf("0.05"), 12))
a, b, s = zip(*states)
write(__file__, times, {
    "mass1.f": a, "mass2.f": b, "spring1.q": [k * x / k1 for x in s], "spring2.q": [k * x / k2 for x in s],
    "spring1.e": [k * x for x in s], "spring2.f": [(x - y) * k / k2 for x, y in zip(a, b)],
    "middle.f": [y + (x - y) * k / k2 for x, y in zip(a, b)], "momentum": [momentum] * len(times),
}, "closed form of an undamped oscillator")
