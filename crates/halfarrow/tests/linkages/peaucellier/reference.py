"""Peaucellier's linkage: Q is the inverse of P about the origin, the other joints are half-way between them and to the sides.

Positions in the angle of the crank in closed form, then Lagrange's equation of one degree of freedom. Extrapolated midpoint
rule of orders 24 and 20; the line, the lengths of the bars and the energy are checked.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import mpf
from reference_tools import Jet, acceleration, jet, one_freedom, rate, twice, write

c, l, s = mpf("0.3"), mpf("0.8"), mpf("0.35")
j, mb, md, mq = mpf("0.05"), mpf("0.4"), mpf("0.7"), mpf("1.5")
k, g = mpf(200), mpf("9.81")
inertias = [j, mb, mb, md, md, mq, mq]
start = [mpf("0.6"), mpf(0)]
times = ["0.2", "0.5", "1", "1.5", "2", "3"]


def joints(theta):
    """theta and the coordinates of B, D and Q, as functions of theta."""
    a = Jet(theta, 1)
    xp, yp = c + c * a.cos(), c * a.sin()
    square = xp * xp + yp * yp
    ratio = (l**2 - s**2) / square
    xq, yq = ratio * xp, ratio * yp
    xm, ym = (xp + xq) / 2, (yp + yq) / 2
    side = (jet(l**2) / square - (ratio + 1) * (ratio + 1) / 4).sqrt()
    return a, xm - side * yp, ym + side * xp, xm + side * yp, ym - side * xp, xq, yq


def potential(q):
    return k / 2 * q[6] * q[6] + g * (mb * q[2] + md * q[4] + mq * q[6])


def rates(_, state):
    q = joints(state[0])
    return [state[1], one_freedom(q, inertias, potential(q))(state[1])]


def energy(state):
    q = joints(state[0])
    return sum(m * rate(x, state[1]) ** 2 for x, m in zip(q, inertias)) / 2 + potential(q).value


states = twice(rates, start, times, "0.01")
assert all(abs(energy(x) - energy(start)) < mpf("1e-20") for x in states)
columns = {name: [] for name in ["theta", "xb", "yb", "xd", "yd", "xq", "yq"]}
for x in states:
    q = joints(x[0])
    for name, coordinate in zip(columns, q):
        columns[name].append(coordinate.value)
    _, xb, yb, xd, yd, xq, yq = (v.value for v in q)
    xp, yp = c + c * q[0].cos().value, c * q[0].sin().value
    assert abs(xq - (l**2 - s**2) / (2 * c)) < mpf("1e-35")
    bars = [(xb, yb, l), (xd, yd, l), (xb - xp, yb - yp, s), (xd - xp, yd - yp, s), (xq - xb, yq - yb, s), (xq - xd, yq - yd, s)]
    assert all(abs(u**2 + v**2 - r**2) < mpf("1e-35") for u, v, r in bars)
columns["w.f"] = [x[1] for x in states]
for name, place in [("ub.f", 1), ("vd.f", 4), ("vq.f", 6)]:
    columns[name] = [rate(joints(x[0])[place], x[1]) for x in states]
for name, place in [("Iub.e", 1), ("Ivd.e", 4), ("Ivq.e", 6)]:
    columns[name] = [inertias[place] * acceleration(joints(x[0])[place], x[1], rates(0, x)[1]) for x in states]
write(__file__, times, columns, "closed form in the crank angle, Lagrange's equation, extrapolation of order 24")
