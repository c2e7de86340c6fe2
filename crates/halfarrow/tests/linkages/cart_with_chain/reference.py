"""Two pendulums in a chain on a free cart: Lagrange's equations in the place of the cart and both angles.

With masses below summed, m = m1 + m2, and the level place of the cart b:
(mb + m) b'' + m l1 cos(p) p'' + m2 l2 cos(q) q'' = m l1 sin(p) p'² + m2 l2 sin(q) q'²
m cos(p) b'' + m l1 p'' + m2 l2 cos(p - q) q'' = -m2 l2 sin(p - q) q'² - m g sin(p)
cos(q) b'' + l1 cos(p - q) p'' + l2 q'' = l1 sin(p - q) p'² - g sin(q)

Extrapolated midpoint rule of orders 24 and 20; energy and momentum are checked, and that each mass moves along its rods' forces.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import cos, lu_solve, matrix, mpf, sin
from reference_tools import twice, write

mb, m1, m2, l1, l2, g = mpf(2), mpf("1.2"), mpf("0.8"), mpf("0.6"), mpf("0.9"), mpf("9.81")
m = m1 + m2
# Below the cart and at rest with it, turning at 12 and 12 rad/s.
start = [mpf(0), mpf(0), mpf(0), mpf(0), mpf("7.2") / l1, (mpf(18) - mpf("7.2")) / l2]
times = ["0.1", "0.3", "0.6", "1", "1.5"]


def rates(t, s):
    _, p, q, v, w, r = s
    c, d = cos(p - q), sin(p - q)
    left = matrix([[mb + m, m * l1 * cos(p), m2 * l2 * cos(q)], [m * cos(p), m * l1, m2 * l2 * c], [cos(q), l1 * c, l2]])
    right = matrix([m * l1 * sin(p) * w**2 + m2 * l2 * sin(q) * r**2, -m2 * l2 * d * r**2 - m * g * sin(p), l1 * d * w**2 - g * sin(q)])
    return [v, w, r] + list(lu_solve(left, right))


def motion(s):
    """Positions, speeds and accelerations b, x1, y1, x2, y2."""
    b, p, q, v, w, r = s
    _, _, _, vv, ww, rr = rates(0, s)
    x = [b, b + l1 * sin(p), -l1 * cos(p)]
    u = [v, v + l1 * cos(p) * w, l1 * sin(p) * w]
    a = [vv, vv + l1 * (cos(p) * ww - sin(p) * w**2), l1 * (sin(p) * ww + cos(p) * w**2)]
    x += [x[1] + l2 * sin(q), x[2] - l2 * cos(q)]
    u += [u[1] + l2 * cos(q) * r, u[2] + l2 * sin(q) * r]
    a += [a[1] + l2 * (cos(q) * rr - sin(q) * r**2), a[2] + l2 * (sin(q) * rr + cos(q) * r**2)]
    return x, u, a


masses = [mb, m1, m1, m2, m2]


def energy(s):
    x, u, _ = motion(s)
    return sum(k * f**2 for k, f in zip(masses, u)) / 2 + g * (m1 * x[2] + m2 * x[4])


def momentum(s):
    u = motion(s)[1]
    return mb * u[0] + m1 * u[1] + m2 * u[3]


def multipliers(s):
    """Forces divided by the gradients of the rods, found along the rods."""
    x, _, a = motion(s)
    dx, dy = x[3] - x[1], x[4] - x[2]
    fx, fy = m2 * a[3], m2 * (a[4] + g)
    two = (fx * dx + fy * dy) / (2 * l2**2)
    assert abs(fx - 2 * dx * two) + abs(fy - 2 * dy * two) < mpf("1e-30")
    ex, ey = x[1] - x[0], x[2]
    fx, fy = m1 * a[1] + 2 * dx * two, m1 * (a[2] + g) + 2 * dy * two
    one = (fx * ex + fy * ey) / (2 * l1**2)
    assert abs(fx - 2 * ex * one) + abs(fy - 2 * ey * one) + abs(mb * a[0] + 2 * ex * one) < mpf("1e-30")
    return one, two


states = twice(rates, start, times, "0.02")
assert all(abs(energy(s) - energy(start)) + abs(momentum(s) - momentum(start)) < mpf("1e-20") for s in states)
found = [motion(s) for s in states]
columns = {}
names = [("b", "Ib"), ("x1", "Iu1"), ("y1", "Iv1"), ("x2", "Iu2"), ("y2", "Iv2")]
for place, (x, mass) in enumerate(names):
    columns[x] = [f[0][place] for f in found]
    columns[f"{mass}.f"] = [f[1][place] for f in found]
    columns[f"{mass}.e"] = [masses[place] * f[2][place] for f in found]
columns["rod1.e"], columns["rod2.e"] = zip(*map(multipliers, states))
write(__file__, times, columns, "Lagrange's equations, extrapolation of order 24, energy and momentum constant to 1e-20")
