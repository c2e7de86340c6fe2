"""Slider-crank by Lagrange's equation in the crank angle: I(theta) theta'' + I'(theta) theta'²/2 = Q, I = j + m S², S = dx/dtheta.

Extrapolated midpoint rule of orders 24 and 20. The multiplier is found at the slider; that the crank's own equation
j theta'' = drive - b theta' + rod.e dg/dtheta holds with it is the second check.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, mpf, pi, sin, sqrt
from reference_tools import twice, write

j, m, r, l = mpf("0.002"), mpf("0.5"), mpf("0.1"), mpf("0.3")
k, b = mpf(200), mpf("0.005")
rest = sqrt(l**2 - r**2)
times = ["0.1", "0.2", "0.3", "0.5", "0.8", "1"]


def drive(t):
    return mpf("0.1") * sin(10 * t)


def slide(a):
    """Slider position and its first two derivatives in the crank angle."""
    s, c = sin(a), cos(a)
    foot = sqrt(l**2 - r**2 * s**2)
    slope = -(r**2) * s * c / foot
    return r * c + foot, -r * s + slope, -r * c + (r**2 * (s**2 - c**2) - slope**2) / foot


def rates(t, y):
    a, w = y
    x, first, second = slide(a)
    torque = drive(t) - b * w - k * (x - rest) * first
    return [w, (torque - m * first * second * w**2) / (j + m * first**2)]


states = twice(rates, [75 * pi / 180, mpf(0)], times, "0.01")
assert all(60 < a * 180 / pi < 120 for a, _ in states)
columns = {name: [] for name in ("theta", "w.f", "x", "slider.f", "spring.q", "crank.e", "slider.e", "rod.e")}
for t, (a, w) in zip(times, states):
    x, first, second = slide(a)
    bend = rates(mpf(t), [a, w])[1]
    push = m * (first * bend + second * w**2)
    rod = (push + k * (x - rest)) / (2 * (x - r * cos(a)))
    assert abs(j * bend - drive(mpf(t)) + b * w - rod * 2 * x * r * sin(a)) < mpf("1e-30")
    for name, value in zip(columns, (a, w, x, first * w, x - rest, j * bend, push, rod)):
        columns[name].append(value)
write(__file__, times, columns, "Lagrange's equation, extrapolation of order 24")
