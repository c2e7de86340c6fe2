"""Rocking block, after Housner: between impacts an upside-down pendulum about the corner that stands, whose times are
integrals; at an impact the angular momentum about the corner that comes down is kept.

Checked by a step method along the first swing, which has to end upright with the speed that energy tells.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import acos, atan, cos, mpf, quad, sin, sqrt
from reference_tools import integrate, write

m, g, b, h, start = mpf(2), mpf("9.81"), mpf("0.1"), mpf("0.3"), mpf("0.15")
radius, alpha = sqrt(b**2 + h**2), atan(b / h)
square = m * g * radius / (mpf(4) / 3 * m * radius**2)
# Angular momentum about the other corner over that about the one that stood.
kept = 1 - mpf(3) / 2 * sin(alpha) ** 2


def swing(tilt):
    """Time from rest at `tilt` to the upright position. With tilt (1 - s²) nothing is singular."""
    def slowness(s):
        now = tilt * (1 - s**2)
        # The difference of two cosines as a product, over s².
        half = tilt * s**2 / 2
        sinc = sin(half) / half if half else mpf(1)
        return 2 * tilt / sqrt(2 * square * 2 * sin(alpha - (tilt + now) / 2) * sinc * tilt / 2)
    return quad(slowness, [0, 1])


def height(speed):
    """Tilt at which a block rests that has left the upright position with a speed."""
    return alpha - acos(cos(alpha) + speed**2 / (2 * square))


def greatest(tilt):
    return sqrt(2 * square * (cos(alpha - tilt) - cos(alpha)))


impacts, t, tilt, side = [], swing(start), start, 1
while len(impacts) < 12:
    before = greatest(tilt)
    after = kept * before
    # Forces of the corner that comes down, and of friction: momentum up and along.
    corner = "right.impulse" if side > 0 else "left.impulse"
    impacts.append((t, {"turn.f": -side * after, corner: m * b * (before + after), "along.f": side * h * after}))
    tilt, side = height(after), -side
    t += 2 * swing(tilt)

# The tilt at some times, by steps, in the same way between impacts.
times = ["0.1", "0.2", "0.3", "0.45", "0.6", "0.7", "0.9"]
bounds = [mpf(0)] + [when for when, _ in impacts]
tilts, speeds = [], []
for time in map(mpf, times):
    k = sum(1 for when in bounds[1:] if when <= time)
    sign = (-1) ** k
    first = [start, mpf(0)] if k == 0 else [mpf(0), abs(impacts[k - 1][1]["turn.f"])]
    rates = lambda _, x: [x[1], -square * sin(alpha - x[0])]
    passed = time - bounds[k]
    x = integrate(rates, first, [passed], mpf("0.02"), 10)[0]
    tilts.append(sign * x[0])
    speeds.append(sign * x[1])
rates = lambda _, x: [x[1], -square * sin(alpha - x[0])]
end = integrate(rates, [start, mpf(0)], [impacts[0][0]], mpf("0.01"), 10)[0]
assert abs(end[0]) < mpf(10) ** -18 and abs(end[1] + greatest(start)) < mpf(10) ** -18
write(__file__, times, {"tilt": tilts, "turn.f": speeds}, "quadratures of free rocking, ratio after Housner, mpmath", impacts=impacts)
