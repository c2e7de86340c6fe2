"""Electrostatic actuator: R q' = V - q (x0 - x)/(eps A), m x'' = q²/(2 eps A) - k x - b x', up to shortly before contact.

Extrapolated midpoint rule of orders 24 and 20; checked by the energy, stored = integral of (V - R i) i - b v².
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf
from reference_tools import twice, write

volt, r = mpf(4), mpf(10) ** 8
plate, x0 = mpf("8.8541878128e-12") * mpf("4e-8"), mpf("2e-6")
m, k, b = mpf("1e-9"), mpf(1), mpf("5e-6")
times = ["0.00001", "0.00003", "0.00005", "0.00007", "0.00009", "0.0001"]


def rates(t, s):
    q, x, v, _ = s
    i = (volt - q * (x0 - x) / plate) / r
    return [i, v, (q**2 / (2 * plate) - k * x - b * v) / m, (volt - r * i) * i - b * v**2]


states = twice(rates, [mpf(0)] * 4, times, "1e-6")
for q, x, v, work in states:
    stored = q**2 * (x0 - x) / (2 * plate) + k * x**2 / 2 + m * v**2 / 2
    assert abs(stored - work) < mpf("1e-22") * stored
q, x, v, _ = zip(*states)
assert 0 < (x0 - x[-1]) / x0 < mpf("0.4")
rate = [rates(0, s) for s in states]
write(__file__, times, {
    "gap.el.q": q, "gap.me.q": x, "plate_mass.f": v, "spring.q": x, "clearance": [x0 - s for s in x],
    "gap.el.e": [volt - r * d[0] for d in rate], "gap.me.e": [-(s**2) / (2 * plate) for s in q],
    "series.f": [d[0] for d in rate], "plate_mass.e": [m * d[2] for d in rate],
}, "equations of the circuit and the plate, extrapolation of order 24, energy balance to 1e-22")
