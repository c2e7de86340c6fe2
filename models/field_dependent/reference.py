"""Field in mixed causality: [[m11, m12], [m12, m22 + m]] (vx, vy)' = (F - b vx, -k q), q' = vy.

Matrix exponential in velocities; checked by numerical integration in momenta.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf
from reference_tools import agree, integrate, linear, write

m11, m12, m22, m = mpf(3), mpf("0.7"), mpf(2), mpf("1.5")
b, k, force = mpf(4), mpf(60), mpf(5)
start = [mpf("0.5"), mpf("0.4"), mpf(0)]
times = ["0.1", "0.3", "0.7", "1", "2", "5"]
det = m11 * (m22 + m) - m12**2


def speeds(px, py):
    return ((m22 + m) * px - m12 * py) / det, (m11 * py - m12 * px) / det


def rates(vx, vy, q, push):
    return [*speeds(push - b * vx, -k * q), vy]


def momentum_rates(t, s):
    px, py, q = s
    vx, vy = speeds(px, py)
    return [force - b * vx, -k * q, vy]


unit = [rates(*[mpf(i == j) for j in range(4)]) for i in range(4)]
rows = [[unit[j][i] for j in range(3)] + [force * unit[3][i]] for i in range(3)] + [[0] * 4]
states = [s[:3] for s in linear(rows, start + [1], times)]
p0 = [m11 * start[0] + m12 * start[1], m12 * start[0] + (m22 + m) * start[1], mpf(0)]
numeric = integrate(momentum_rates, p0, times, mpf("0.05"), 12)
agree(states, [[*speeds(px, py), q] for px, py, q in numeric])
vx, vy, q = zip(*states)
ax, ay = zip(*[rates(*s, force)[:2] for s in states])
write(__file__, times, {
    "hull.x.f": vx, "hull.y.f": vy, "ballast.f": vy, "mooring.q": q,
    "hull.x.p": [m11 * a + m12 * c for a, c in zip(vx, vy)], "hull.y.p": [m12 * a + m22 * c for a, c in zip(vx, vy)],
    "hull.y.e": [m12 * a + m22 * c for a, c in zip(ax, ay)], "ballast.e": [m * a for a in ay],
}, "matrix exponential")
