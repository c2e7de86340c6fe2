"""Pendulum of a point mass: Lagrange gives phi'' = -(g/l) cos(phi).

Extrapolated midpoint rule of orders 24 and 20; the energy is checked to 25 digits.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, mpf, sin
from reference_tools import twice, write

m, l, g = mpf(2), mpf("0.75"), mpf("9.81")
start = [mpf("0.4"), mpf("0.5")]
times = ["0.1", "0.5", "1", "2", "5", "10"]


def energy(s):
    return m * (l * s[1]) ** 2 / 2 + m * g * l * sin(s[0])


states = twice(lambda t, s: [s[1], -g / l * cos(s[0])], start, times, "0.05")
assert all(abs(energy(s) - energy(start)) < mpf("1e-24") for s in states)
phi, w = zip(*states)
bend = [-g / l * cos(p) for p in phi]
write(__file__, times, {
    "phi": phi, "w.f": w,
    "Iu.f": [-l * sin(p) * r for p, r in states], "Iv.f": [l * cos(p) * r for p, r in states],
    "Iu.e": [-m * l * (cos(p) * r**2 + sin(p) * a) for p, r, a in zip(phi, w, bend)],
    "Iv.e": [m * l * (-sin(p) * r**2 + cos(p) * a) for p, r, a in zip(phi, w, bend)],
    "x": [l * cos(p) for p in phi], "y": [l * sin(p) for p in phi],
}, "Lagrange's equation, extrapolation of order 24, energy constant to 1e-24")
