"""RC bridge with a cubic resistor: the left node is a cubic in the bridge current, solved in closed form.

Extrapolated midpoint rule of orders 24 and 20; the cubic law is checked at the end.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import asinh, mpf, sin, sinh, sqrt
from reference_tools import twice, write

g1, g2, b = 1 / mpf(1000), 1 / mpf(2200), mpf("2e10")
c1, c2 = mpf("220e-6"), mpf("470e-6")
i0, i1, w = mpf("1e-3"), mpf("2e-3"), mpf(3)
times = ["0.1", "0.3", "0.7", "1", "2", "5"]


def currents(u1, u2):
    """In R1, R2 and the bridge: i = g1 (u1 + u2) - (g1 + g2) left with left = u2 + b i³, i.e. i³ + p i = r."""
    p = 1 / (b * (g1 + g2))
    r = p * (g1 * (u1 + u2) - (g1 + g2) * u2)
    i = 2 * sqrt(p / 3) * sinh(asinh(3 * r / (2 * p) * sqrt(3 / p)) / 3)
    left = u2 + b * i**3
    return g1 * (u1 + u2 - left), g2 * left, i


def rates(t, u):
    in1, _, bridge = currents(*u)
    net = i0 + i1 * sin(w * t) - in1
    return [net / c1, (net + bridge) / c2]


states = twice(rates, [mpf("0.5"), mpf(0)], times, "0.015", digits=19)
flows = list(zip(*[currents(*s) for s in states]))
for i1_, i2_, i3_ in zip(*flows):
    assert abs(i1_ - i2_ - i3_) < mpf("1e-30")
u1, u2 = zip(*states)
left = [i / g2 for i in flows[1]]
write(__file__, times, {
    "C1.e": u1, "C2.e": u2, "C1.q": [c1 * u for u in u1], "C2.q": [c2 * u for u in u2],
    "R1.f": flows[0], "R2.f": flows[1], "R3.f": flows[2], "R3.e": [v - u for v, u in zip(left, u2)],
    "v_left": left, "v_top": [a + b_ for a, b_ in states],
}, "nodal analysis, cubic formula, extrapolation of order 24")
