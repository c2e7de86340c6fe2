"""Transformer ring with modulus a(q): the flow cycle gives q' = a (v - b Sf)/(a - b), the effort cycle m v' = -k a q/(a - b).

From the bonds: flow of `top` Sf = q'/a + y with b y = v - q'; effort of `top` e = a (k q + e/b), m v' = e/b.
Extrapolated midpoint rule of orders 24 and 20; checked by the energy, stored = initial + integral of e Sf.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf, sin
from reference_tools import twice, write

m, k, a0, span, b = mpf(2), mpf(5), mpf("2.5"), mpf(4), mpf(4)
times = ["0.1", "0.5", "1", "2", "4", "6"]


def drive(t):
    return mpf("0.1") * sin(mpf("1.3") * t)


def effort(q):
    """At the top junction."""
    a = a0 * (1 + q / span)
    return -k * a * b * q / (a - b)


def rates(t, s):
    q, v, _ = s
    a = a0 * (1 + q / span)
    return [a * (v - b * drive(t)) / (a - b), effort(q) / (b * m), effort(q) * drive(t)]


def energy(s):
    return k * s[0] ** 2 / 2 + m * s[1] ** 2 / 2


start = [mpf("-0.25"), mpf("0.3"), mpf(0)]
states = twice(rates, start, times, "0.05")
assert all(abs(energy(s) - energy(start) - s[2]) < mpf("1e-22") for s in states)
q, v, _ = zip(*states)
write(__file__, times, {
    "spring.q": q, "body.f": v, "spring.f": [rates(mpf(t), s)[0] for t, s in zip(times, states)],
    "top.e": [effort(x) for x in q], "body.e": [effort(x) / b for x in q], "modulus": [a0 * (1 + x / span) for x in q],
}, "loop equations by hand, extrapolation of order 24, energy balance to 1e-22")
