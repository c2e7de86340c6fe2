"""RC bridge with a diode: the left node is solved in closed form by Lambert's W, so no Newton iteration is needed.

Extrapolated midpoint rule of orders 24 and 20; the law of the diode is checked at the end.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import exp, lambertw, mpf, sin
from reference_tools import twice, write

g1, g2 = 1 / mpf(1000), 1 / mpf(2200)
c1, c2 = mpf("220e-6"), mpf("470e-6")
sat, vt = mpf("1e-9"), mpf("0.026")
i0, i1, w = mpf("1e-3"), mpf("2e-3"), mpf(3)
times = ["0.1", "0.3", "0.7", "1", "2", "5"]


def currents(u1, u2):
    """In R1, R2 and the diode, from g1 (u1 + u2 - left) = g2 left + sat (exp((left - u2)/vt) - 1)."""
    drive = (g1 * (u1 + u2) + sat) / (g1 + g2) - u2
    across = drive - vt * lambertw(sat / ((g1 + g2) * vt) * exp(drive / vt)).real
    left = u2 + across
    return g1 * (u1 + u2 - left), g2 * left, g1 * (u1 + u2 - left) - g2 * left


def rates(t, u):
    in1, _, diode = currents(*u)
    net = i0 + i1 * sin(w * t) - in1
    return [net / c1, (net + diode) / c2]


states = twice(rates, [mpf("0.5"), mpf(0)], times, "0.02", digits=20)
flows = list(zip(*[currents(*s) for s in states]))
u1, u2 = zip(*states)
left = [i / g2 for i in flows[1]]
for v, u, i in zip(left, u2, flows[2]):
    assert abs(sat * (exp((v - u) / vt) - 1) - i) < mpf("1e-30")
write(__file__, times, {
    "C1.e": u1, "C2.e": u2, "C1.q": [c1 * u for u in u1], "C2.q": [c2 * u for u in u2],
    "R1.f": flows[0], "R2.f": flows[1], "D.f": flows[2], "D.e": [v - u for v, u in zip(left, u2)],
    "v_left": left, "v_top": [a + b for a, b in states],
}, "nodal analysis, Lambert's W, extrapolation of order 24")
