"""Watt's linkage: the coupler ends where circles about the pin of the left crank and about the right pivot meet.

Positions in the angle of the left crank in closed form, then Lagrange's equation of one degree of freedom. Extrapolated
midpoint rule of orders 24 and 20; the energy and Watt's sextic are checked.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import mpf, sqrt
from reference_tools import Jet, acceleration, angle, jet, meet, one_freedom, rate, twice, write

a, b = mpf("0.5"), mpf("0.3")
d = sqrt(4 * a**2 + b**2)
j, mass, jc, k, g = mpf("0.02"), mpf(2), mpf("0.01"), mpf(400), mpf("9.81")
inertias = [j, 2 * j, jc, mass, mass]
start = [mpf("0.6"), mpf(0)]
times = ["0.1", "0.3", "0.5", "1", "2", "3"]


def positions(theta):
    """th1, th2, phi, x, y as functions of th1."""
    th1 = Jet(theta, 1)
    x1, y1 = a * th1.cos() - d / 2, a * th1.sin()
    x2, y2 = meet(x1, y1, b, jet(d / 2), jet(0), a, -1)
    return th1, angle(y2, x2 - d / 2, mpf(3)), angle(y2 - y1, x2 - x1, mpf(-1)), (x1 + x2) / 2, (y1 + y2) / 2


def potential(q):
    return k / 2 * q[4] * q[4] + mass * g * q[4]


def rates(_, state):
    q = positions(state[0])
    return [state[1], one_freedom(q, inertias, potential(q))(state[1])]


def energy(state):
    q = positions(state[0])
    return sum(m * rate(x, state[1]) ** 2 for x, m in zip(q, inertias)) / 2 + potential(q).value


states = twice(rates, start, times, "0.01")
assert all(abs(energy(x) - energy(start)) < mpf("1e-20") for x in states)
columns = {}
for place, (name, speed, effort) in enumerate([
    ("th1", "left.f", "I1.e"), ("th2", "right.f", "I2.e"), ("phi", "turn.f", "coupler.e"), ("x", "u.f", "Iu.e"), ("y", "v.f", "Iv.e"),
]):
    found = [positions(x[0])[place] for x in states]
    columns[name] = [q.value for q in found]
    columns[speed] = [rate(q, x[1]) for q, x in zip(found, states)]
    columns[effort] = [inertias[place] * acceleration(q, x[1], rates(0, x)[1]) for q, x in zip(found, states)]
for x, y in zip(columns["x"], columns["y"]):
    square = x**2 + y**2
    assert abs(square * (square - d**2 / 4 - a**2 + b**2 / 4) ** 2 + d**2 * y**2 * (square - a**2)) < mpf("1e-35")
write(__file__, times, columns, "closed form in the crank angle, Lagrange's equation, extrapolation of order 24")
