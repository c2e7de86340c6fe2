"""Lever: with x the way of mass 1, Lagrange gives (m1 + n² m2) x'' + n² k x = F0 + F1 sin(W t).

Closed form; checked by integrating the same equation numerically.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, mpf, sin, sqrt
from reference_tools import agree, integrate, write

m1, m2, n, k = mpf(2), mpf("0.5"), mpf("-1.6"), mpf(40)
f0, f1, w, v0 = mpf(3), mpf(2), mpf(2), mpf("0.4")
mass, stiff = m1 + n**2 * m2, n**2 * k
own = sqrt(stiff / mass)
forced = f1 / (stiff - mass * w**2)
times = ["0.1", "0.3", "0.7", "1", "2", "5"]


def motion(t):
    free = (v0 - forced * w) / own
    x = f0 / stiff * (1 - cos(own * t)) + forced * sin(w * t) + free * sin(own * t)
    v = f0 / stiff * own * sin(own * t) + forced * w * cos(w * t) + free * own * cos(own * t)
    return [x, v]


def acceleration(t, x):
    return (f0 + f1 * sin(w * t) - stiff * x) / mass


states = [motion(mpf(t)) for t in times]
agree(states, integrate(lambda t, s: [s[1], acceleration(t, s[0])], [mpf(0), v0], times, mpf("0.05"), 12))
x, v = zip(*states)
a = [acceleration(mpf(t), p) for t, p in zip(times, x)]
force = [n * (m2 * n * b + k * n * p) for b, p in zip(a, x)]
write(__file__, times, {
    "mass1.f": v, "mass2.f": [n * s for s in v], "spring.q": [n * p for p in x], "mass1.p": [m1 * s for s in v],
    "mass2.e": [m2 * n * b for b in a], "lever.in.e": force, "lever.out.f": [n * s for s in v], "force": force,
}, "closed form of a driven undamped oscillator")
