"""Pendulum that turns over on a moving base, by its angle: l theta'' = -g sin(theta) - b'' cos(theta), b = amplitude sin(omega t).

Extrapolated midpoint rule of orders 24 and 20, with the work of the base integrated beside it.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import cos, mpf, sin, sqrt
from reference_tools import twice, write

m, l, amplitude, omega, g = mpf(1), mpf(1), mpf("0.2"), mpf(3), mpf("9.81")
times = ["0.2", "0.4", "0.8", "1.6", "2.4", "4", "5"]


def base(t):
    return amplitude * sin(omega * t), amplitude * omega * cos(omega * t), -amplitude * omega**2 * sin(omega * t)


def motion(t, s):
    """Positions, speeds and accelerations x, y."""
    theta, w = s[0], s[1]
    b, speed, acceleration = base(t)
    turn = -(g * sin(theta) + acceleration * cos(theta)) / l
    place = [b + l * sin(theta), -l * cos(theta)]
    speeds = [speed + l * cos(theta) * w, l * sin(theta) * w]
    return place, speeds, [acceleration + l * (cos(theta) * turn - sin(theta) * w**2), l * (sin(theta) * turn + cos(theta) * w**2)]


def rates(t, s):
    b, speed, acceleration = base(t)
    a = motion(t, s)[2]
    return [s[1], -(g * sin(s[0]) + acceleration * cos(s[0])) / l, m * a[0] * speed]


theta = mpf(0)
start = [theta, (mpf(9) - amplitude * omega) / l, mpf(0)]
states = twice(rates, start, times, "0.02")
found = [motion(mpf(t), s) for t, s in zip(times, states)]


def energy(x, u):
    return m * (u[0] ** 2 + u[1] ** 2) / 2 + m * g * x[1]


first = energy(*motion(mpf(0), start)[:2])
assert all(abs(energy(x, u) - first - s[2]) < mpf("1e-20") for (x, u, _), s in zip(found, states))
force = [m * (a[1] + g) / (2 * x[1]) for x, _, a in found]
assert all(abs(m * a[0] - 2 * (x[0] - base(mpf(t))[0]) * f) < mpf("1e-30") for t, (x, _, a), f in zip(times, found, force))
assert abs(states[-1][0]) > 12 * mpf("1.5")
columns = {"rod.e": force}
for place, (x, mass) in enumerate([("x", "mx"), ("y", "my")]):
    columns[x] = [f[0][place] for f in found]
    columns[f"{mass}.f"] = [f[1][place] for f in found]
    columns[f"{mass}.e"] = [m * f[2][place] for f in found]
write(__file__, times, columns, "equation of the angle, extrapolation of order 24, work of the base")
