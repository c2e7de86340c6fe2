"""Ten bars in a row: (J + M a^2) w_i' = -M g a cos(phi_i) + k (q_i - q_(i+1)), q_i' = w_(i-1) - w_i.

The last bar has friction b w in place of the next spring. Two runs at different step and order.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, mpf, sin
from reference_tools import twice, write

J, M, a, k, b, g = mpf("0.3"), mpf(2), mpf("0.75"), mpf(12), mpf("0.2"), mpf("9.81")
start = [mpf(s) for s in "0.4 0.1 -0.2 -0.5 -0.8 -1.1 -1.4 -1.7 -1.2 -0.6".split()]
times = ["0.1", "0.5", "1", "2", "5"]
n = len(start)


def rates(t, s):
    """Angles, speeds, springs."""
    phi, w, q = s[:n], s[n:2 * n], s[2 * n:]
    torque = [k * x for x in q] + [b * w[-1]]
    speed = [(-M * g * a * cos(phi[i]) + torque[i] - torque[i + 1]) / (J + M * a * a) for i in range(n)]
    return w + speed + [(w[i - 1] if i else 0) - w[i] for i in range(n)]


states = twice(rates, start + [mpf(0)] * (2 * n), times, "0.02", 12)
slopes = [rates(mpf(t), s) for t, s in zip(times, states)]
columns = {f"bar{i + 1}.angle": [s[i] for s in states] for i in range(n)}
columns |= {f"bar{i + 1}.w.f": [s[n + i] for s in states] for i in (0, 4, 9)}
columns |= {f"spring{i + 1}.q": [s[2 * n + i] for s in states] for i in (0, 5)}
columns["bar5.u.f"] = [-a * s[n + 4] * sin(s[4]) for s in states]
columns["pull"] = [
    M * g + M * a * (r[n + 4] * cos(s[4]) - s[n + 4] ** 2 * sin(s[4])) for s, r in zip(states, slopes)
]
write(__file__, times, columns, "two runs at 40 digits of an integrator of order 24 and 20")
