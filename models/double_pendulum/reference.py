"""Double pendulum by Lagrange's equations, d = phi1 - phi2:

(m1 + m2) l1 phi1'' + m2 l2 cos(d) phi2'' = -m2 l2 sin(d) phi2'² - (m1 + m2) g sin(phi1)
      l1 cos(d) phi1'' +       l2 phi2'' =      l1 sin(d) phi1'² -             g sin(phi2)

Extrapolated midpoint rule of orders 24 and 20; the energy is checked.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
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


def speeds(s):
    """u1, v1, u2, v2 of the two masses."""
    a, b, p, r = s
    u, v = l1 * cos(a) * p, l1 * sin(a) * p
    return u, v, u + l2 * cos(b) * r, v + l2 * sin(b) * r


def energy(s):
    u1, v1, u2, v2 = speeds(s)
    height1 = -l1 * cos(s[0])
    height2 = height1 - l2 * cos(s[1])
    return (m1 * (u1**2 + v1**2) + m2 * (u2**2 + v2**2)) / 2 + g * (m1 * height1 + m2 * height2)


states = twice(rates, start, times, "0.03")
assert all(abs(energy(s) - energy(start)) < mpf("1e-21") for s in states)
phi1, phi2, w1, w2 = zip(*states)
u1, v1, u2, v2 = zip(*map(speeds, states))
push = []
for a, b, p, r in states:
    _, _, pp, rr = rates(0, [a, b, p, r])
    across = l1 * (cos(a) * pp - sin(a) * p**2) + l2 * (cos(b) * rr - sin(b) * r**2)
    up = l1 * (sin(a) * pp + cos(a) * p**2) + l2 * (sin(b) * rr + cos(b) * r**2)
    push.append((m2 * across, m2 * (up + g)))
write(__file__, times, {
    "phi1": phi1, "phi2": phi2, "w1.f": w1, "w2.f": w2, "Iu1.f": u1, "Iv1.f": v1, "Iu2.f": u2, "Iv2.f": v2,
    "rod_u.e": [x for x, _ in push], "rod_v.e": [y for _, y in push],
}, "Lagrange's equations, extrapolation of order 24, energy constant to 1e-21")
