"""Double pendulum by Lagrange's equations in both angles, positions and forces of the rods from them.

(m1 + m2) l1 phi1'' + m2 l2 cos(d) phi2'' = -m2 l2 sin(d) phi2'² - (m1 + m2) g sin(phi1),    d = phi1 - phi2
      l1 cos(d) phi1'' +       l2 phi2'' =      l1 sin(d) phi1'² -             g sin(phi2)

Extrapolated midpoint rule of orders 24 and 20; the energy is checked, and that each mass moves along its rods' forces.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import cos, mpf, sin
from reference_tools import twice, write

m1, m2, l1, l2, g = mpf("1.2"), mpf("0.8"), mpf("0.6"), mpf("0.9"), mpf("9.81")
start = [mpf("0.9"), mpf("-0.4"), mpf(0), mpf(0)]
times = ["0.1", "0.3", "0.7", "1", "2", "3"]


def rates(t, s):
    a, b, p, r = s
    c, d = cos(a - b), sin(a - b)
    one = -m2 * l2 * d * r**2 - (m1 + m2) * g * sin(a)
    two = l1 * d * p**2 - g * sin(b)
    det = l1 * (m1 + m2 * d**2)
    return [p, r, (one - m2 * c * two) / det, ((m1 + m2) * two - c * one) * l1 / (det * l2)]


def motion(s):
    """Positions, speeds and accelerations x1, y1, x2, y2."""
    a, b, p, r = s
    _, _, pp, rr = rates(0, s)
    x1 = [l1 * sin(a), -l1 * cos(a)]
    u1 = [l1 * cos(a) * p, l1 * sin(a) * p]
    a1 = [l1 * (cos(a) * pp - sin(a) * p**2), l1 * (sin(a) * pp + cos(a) * p**2)]
    x2 = [x1[0] + l2 * sin(b), x1[1] - l2 * cos(b)]
    u2 = [u1[0] + l2 * cos(b) * r, u1[1] + l2 * sin(b) * r]
    a2 = [a1[0] + l2 * (cos(b) * rr - sin(b) * r**2), a1[1] + l2 * (sin(b) * rr + cos(b) * r**2)]
    return x1 + x2, u1 + u2, a1 + a2


def energy(s):
    x, u, _ = motion(s)
    return (m1 * (u[0] ** 2 + u[1] ** 2) + m2 * (u[2] ** 2 + u[3] ** 2)) / 2 + g * (m1 * x[1] + m2 * x[3])


def multipliers(s):
    """Forces divided by the gradients 2 x1, 2 y1 and 2 (x2 - x1), 2 (y2 - y1), found along the rods."""
    x, _, a = motion(s)
    dx, dy = x[2] - x[0], x[3] - x[1]
    fx, fy = m2 * a[2], m2 * (a[3] + g)
    two = (fx * dx + fy * dy) / (2 * l2**2)
    assert abs(fx - 2 * dx * two) + abs(fy - 2 * dy * two) < mpf("1e-30")
    fx, fy = m1 * a[0] + 2 * dx * two, m1 * (a[1] + g) + 2 * dy * two
    one = (fx * x[0] + fy * x[1]) / (2 * l1**2)
    assert abs(fx - 2 * x[0] * one) + abs(fy - 2 * x[1] * one) < mpf("1e-30")
    return one, two


states = twice(rates, start, times, "0.03")
assert all(abs(energy(s) - energy(start)) < mpf("1e-20") for s in states)
columns = {}
for place, (x, mass) in enumerate([("x1", "Iu1"), ("y1", "Iv1"), ("x2", "Iu2"), ("y2", "Iv2")]):
    found = [motion(s) for s in states]
    columns[x] = [f[0][place] for f in found]
    columns[f"{mass}.f"] = [f[1][place] for f in found]
    columns[f"{mass}.e"] = [(m1 if place < 2 else m2) * f[2][place] for f in found]
columns["rod1.e"], columns["rod2.e"] = zip(*map(multipliers, states))
write(__file__, times, columns, "Lagrange's equations in the angles, extrapolation of order 24, energy constant to 1e-20")
