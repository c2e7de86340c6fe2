"""Servo on a dependent inertia: (m1 + n² m2) v' = F - n² k v, closed form; checked through the kinetic energy."""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import exp, mpf
from reference_tools import agree, integrate, write

m1, m2, n, k, force, start = mpf(2), mpf("0.5"), mpf(3), mpf("0.8"), mpf(6), mpf("-0.5")
mass, drag = m1 + n**2 * m2, n**2 * k
times = ["0.1", "0.3", "0.7", "1", "2", "5"]


def speed(t):
    return force / drag + (start - force / drag) * exp(-drag / mass * t)


def energy_rate(t, s):
    """Way of mass 1 and total kinetic energy, T' = F v - k (n v)²; v from the closed form."""
    v = speed(t)
    return [v, force * v - k * (n * v) ** 2]


v = [speed(mpf(t)) for t in times]
numeric = integrate(energy_rate, [mpf(0), mass * start**2 / 2], times, mpf("0.05"), 12)
agree([[mass * s**2 / 2] for s in v], [[e] for _, e in numeric])
rate = [(force - drag * s) / mass for s in v]
write(__file__, times, {
    "mass1.f": v, "mass2.f": [n * s for s in v], "servo.e": [-k * n * s for s in v], "mass2.e": [m2 * n * a for a in rate],
    "lever.in.e": [n * (m2 * n * a + k * n * s) for a, s in zip(rate, v)], "brake": [-k * n * s for s in v],
}, "closed form of a first-order equation")
