"""Two touching cycles as a mechanism: y2, y3 are the ways of masses 2 and 3, x that of the driven point.

The springs stretch by x, (x - y2)/2 and (x - y3)/2, mass 1 moves at (v2 + v3)/2. Lagrange in (y2, y3), with x from
dV/dx = 0 because it has no mass. Matrix exponential; checked by numerical integration of the four bond efforts.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, mpf, sin
from reference_tools import agree, integrate, linear, write

m1, m2, m3 = mpf(1), mpf("1.5"), mpf(2)
k1, k2, k3 = mpf(20), mpf(30), mpf(50)
s0, s1, w = mpf(4), mpf(3), mpf(2)
times = ["0.1", "0.3", "0.7", "1", "2", "5"]
stiff = k1 + k2 / 4 + k3 / 4
det = (m2 + m1 / 4) * (m3 + m1 / 4) - (m1 / 4) ** 2


def accelerations(p2, p3):
    """From the generalised forces k2 q2/2 and k3 q3/2; the mass matrix couples by m1/4."""
    return ((m3 + m1 / 4) * p2 - m1 / 4 * p3) / det, ((m2 + m1 / 4) * p3 - m1 / 4 * p2) / det


def stretches(y2, y3, source):
    x = (source + k2 * y2 / 4 + k3 * y3 / 4) / stiff
    return x, (x - y2) / 2, (x - y3) / 2


def row(y2, y3, v2, v3, source):
    _, q2, q3 = stretches(y2, y3, source)
    return [v2, v3, *accelerations(k2 * q2 / 2, k3 * q3 / 2)]


q2, q3 = mpf("0.1"), mpf("0.05")
x = (s0 - k2 * q2 / 2 - k3 * q3 / 2) / k1
start = [x - 2 * q2, x - 2 * q3, mpf("0.3"), mpf("-0.1")]
unit = [row(*[mpf(i == j) for j in range(5)]) for i in range(5)]
rows = [[unit[j][i] for j in range(4)] + [s0 * unit[4][i], s1 * unit[4][i], 0] for i in range(4)]
rows += [[0] * 7, [0] * 6 + [w], [0] * 5 + [-w, 0]]
states = [s[:4] for s in linear(rows, start + [1, 0, 1], times)]


def bond_rates(t, s):
    """q1, q2, q3, v2, v3 from the efforts es, eu, ew of the 0-junctions: 2 eu + es = k2 q2, 2 ew + es = k3 q3,
    es/m1 = (eu/m2 + ew/m3)/2; the flow of the driven junction from d/dt (k1 q1 + k2 q2/2 + k3 q3/2) = Se'."""
    _, p2, p3, v2, v3 = s
    es = (k2 * p2 / m2 + k3 * p3 / m3) / (4 / m1 + 1 / m2 + 1 / m3)
    f = (s1 * w * cos(w * t) + k2 * v2 / 4 + k3 * v3 / 4) / stiff
    return [f, (f - v2) / 2, (f - v3) / 2, (k2 * p2 - es) / (2 * m2), (k3 * p3 - es) / (2 * m3)]


numeric = integrate(bond_rates, [x, q2, q3, *start[2:]], times, mpf("0.05"), 12)
names = ("C1.q", "C2.q", "C3.q", "I1.f", "I2.f", "I3.f", "s.e", "u.e", "w.e", "a.f")
columns = {name: [] for name in names}
for t, (y2, y3, v2, v3) in zip(times, states):
    source = s0 + s1 * sin(w * mpf(t))
    q = stretches(y2, y3, source)
    a2, a3 = accelerations(k2 * q[1] / 2, k3 * q[2] / 2)
    flow = (s1 * w * cos(w * mpf(t)) + k2 * v2 / 4 + k3 * v3 / 4) / stiff
    values = [*q, (v2 + v3) / 2, v2, v3, m1 * (a2 + a3) / 2, m2 * a2, m3 * a3, flow]
    for name, value in zip(names, values):
        columns[name].append(value)
kept = ("C1.q", "C2.q", "C3.q", "I2.f", "I3.f")
agree(list(zip(*[columns[name] for name in kept])), numeric)
write(__file__, times, columns, "Lagrange's equations, matrix exponential")
