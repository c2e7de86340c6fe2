"""Scissor lift: all bars stand at one angle phi, so x = l cos(phi) and y[i] = (2 i - 1) l sin(phi).

Lagrange's equation of one degree of freedom, extrapolated midpoint rule of orders 24 and 20; the energy is checked.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import cos, mpf, sin
from reference_tools import twice, write

n, l, m, j, g, k, rest = 4, mpf("0.5"), mpf(2), mpf("0.1"), mpf("9.81"), mpf(3000), mpf("0.65")
start = [mpf("0.6"), mpf(0)]
times = ["0.1", "0.3", "0.5", "1", "2", "3"]
# Sum of (2 i - 1)² over the stages; that of 2 i - 1 is n².
squares = mpf(n * (4 * n**2 - 1)) / 3


def mass(phi):
    return 2 * n * (m * l**2 * sin(phi) ** 2 + j) + 2 * m * l**2 * squares * cos(phi) ** 2


def slope(phi):
    return 4 * m * l**2 * (n - squares) * sin(phi) * cos(phi)


def rates(_, x):
    phi, w = x
    torque = 2 * l * sin(phi) * k * (2 * l * cos(phi) - rest) - 2 * m * g * l * n**2 * cos(phi)
    return [w, (torque - slope(phi) * w**2 / 2) / mass(phi)]


def energy(x):
    phi, w = x
    return mass(phi) * w**2 / 2 + k / 2 * (2 * l * cos(phi) - rest) ** 2 + 2 * m * g * l * n**2 * sin(phi)


states = twice(rates, start, times, "0.05")
assert all(abs(energy(x) - energy(start)) < mpf("1e-18") for x in states)
phi, w = zip(*states)
columns = {name: phi for name in ["a[1]", "b[1]", "a[4]", "b[3]"]}
columns |= {name: w for name in ["wa[1].f", "wb[4].f"]}
columns |= {f"x[{i}]": [l * cos(p) for p in phi] for i in (1, 4)} | {f"y[{i}]": [(2 * i - 1) * l * sin(p) for p in phi] for i in (2, 4)}
columns["v[4].f"] = [7 * l * cos(p) * r for p, r in states]
columns["Iv[4].e"] = [2 * m * 7 * l * (cos(p) * rates(0, x)[1] - sin(p) * r**2) for x, (p, r) in zip(states, states)]
columns["spring.e"] = [k * (2 * l * cos(p) - rest) for p in phi]
columns["height"] = [2 * n * l * sin(p) for p in phi]
write(__file__, times, columns, "closed form in the angle of the bars, extrapolation of order 24, energy constant to 1e-18")
