"""Parallelograms in a row: all cranks stand at one angle, couplers stay level, so one equation is left.

Lagrange's equation of the angle, extrapolated midpoint rule of orders 24 and 20; the energy is checked.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import cos, mp, mpf, sin
from reference_tools import twice, write

n, l, m, g = 4, mpf(1), mpf(1), mpf("9.81")
times = ["0.5", "1", "2", "3", "4", "5"]
start = [mpf("1.5707963267948966"), mpf(1)]
inertia = m * l**2 * (mpf(n + 1) / 3 + n)
moment = m * g * l * (mpf(n + 1) / 2 + n)


def rates(_, x):
    return [x[1], -moment / inertia * cos(x[0])]


def energy(x):
    return inertia * x[1] ** 2 / 2 + moment * sin(x[0])


states = twice(rates, start, times, "0.02")
assert all(abs(energy(x) - energy(start)) < mpf("1e-18") for x in states)
th, w = zip(*states)
assert th[-1] > 5 * mp.pi
columns = {f"th[{i}]": th for i in (0, 2, 4)} | {"w[4].f": w, "tilt[1]": [mpf(0)] * len(times), "tilt[4]": [mpf(0)] * len(times)}
columns |= {"x[3]": [l / 2 + l * cos(a) for a in th], "y[1]": [l * sin(a) for a in th], "v[4].f": [l * cos(a) * r for a, r in states]}
columns["my[2].e"] = [m * l * (cos(a) * rates(0, [a, r])[1] - sin(a) * r**2) for a, r in states]
write(__file__, times, columns, "one angle, extrapolation of order 24, energy constant to 1e-18", tolerance=1e-7)
