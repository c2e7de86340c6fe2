"""RC bridge by nodal analysis: the left node gives v_left, the two capacitor voltages are the states.

Matrix exponential; checked by numerical integration.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf, sin
from reference_tools import agree, integrate, linear, write

g1, g2, g3 = 1 / mpf(1000), 1 / mpf(2200), 1 / mpf(1500)
c1, c2 = mpf("220e-6"), mpf("470e-6")
i0, i1, w = mpf("1e-3"), mpf("2e-3"), mpf(3)
times = ["0.1", "0.3", "0.7", "1", "2", "5"]


def currents(u1, u2):
    """In R1, R2 and R3; u1 is the voltage from top to right, u2 that of the right node."""
    left = (g1 * (u1 + u2) + g3 * u2) / (g1 + g2 + g3)
    return g1 * (u1 + u2 - left), g2 * left, g3 * (left - u2)


def rates(t, u, feed=None):
    feed = i0 + i1 * sin(w * t) if feed is None else feed
    in1, _, in3 = currents(*u)
    return [(feed - in1) / c1, (feed - in1 + in3) / c2]


one, two, feed = rates(0, [1, 0], 0), rates(0, [0, 1], 0), rates(0, [0, 0], 1)
rows = [[one[k], two[k], i0 * feed[k], i1 * feed[k], 0] for k in (0, 1)]
rows += [[0] * 5, [0, 0, 0, 0, w], [0, 0, 0, -w, 0]]
states = [s[:2] for s in linear(rows, [mpf("0.5"), 0, 1, 0, 1], times)]
agree(states, integrate(rates, [mpf("0.5"), mpf(0)], times, mpf("0.02"), 12))
u1, u2 = zip(*states)
flows = list(zip(*[currents(*s) for s in states]))
left = [i / g2 for i in flows[1]]
top = [a + b for a, b in states]
write(__file__, times, {
    "C1.e": u1, "C2.e": u2, "C1.q": [c1 * u for u in u1], "C2.q": [c2 * u for u in u2],
    "R1.f": flows[0], "R2.f": flows[1], "R3.f": flows[2], "v_left": left, "v_top": top,
}, "nodal analysis, matrix exponential")
