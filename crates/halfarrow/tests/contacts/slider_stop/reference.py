"""Slider-crank with one angle: Lagrange's equation; the place of the impact is known, its speeds follow from energy.

A constant torque gives back on the way to the stop what it has taken on the way from it: every impact has `e` of the speed of
the one before. Times between them are integrals, that of the first by steps.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import acos, asin, mp, mpf, sqrt
from reference_tools import Jet, agree, one_freedom, step, write

torque, e, stop = mpf(2), mpf("0.6"), mpf("0.37")
r, l, c = mpf("0.1"), mpf("0.3"), mpf("0.15")
disc, m_bar, j_bar, piston = mpf("0.02"), mpf("0.4"), mpf("0.003"), mpf("0.5")
times = ["0.1", "0.2", "0.3", "0.4", "0.6", "0.9"]


def machine(angle):
    """Slider's place, coordinates of all that moves with their inertias."""
    theta = Jet(angle, 1)
    y = r * theta.sin()
    s = y * (-1 / l)
    lean = s.through(asin(s.value), 1 / sqrt(1 - s.value**2), s.value / (1 - s.value**2) ** mpf("1.5"))
    way = r * theta.cos() + l * lean.cos()
    bar = [r * theta.cos() + c * lean.cos(), y + c * lean.sin()]
    return way, [theta, lean, *bar, way], [disc, j_bar, m_bar, m_bar, piston]


def rates(_, x):
    way, coordinates, inertias = machine(x[0])
    return [x[1], one_freedom(coordinates, inertias, 0, torque)(x[1])]


def inertia(angle):
    _, coordinates, inertias = machine(angle)
    return sum(i * q.first**2 for q, i in zip(coordinates, inertias))


# The place of the slider at which it meets the stop, on the second way out: a triangle of known sides.
place = 2 * mp.pi - acos((r**2 + stop**2 - l**2) / (2 * r * stop))
assert abs(machine(place)[0].value - stop) < mpf(10) ** -35


def run(h, columns):
    t, x, impacts, states = mpf(0), [mpf("0.9"), mpf(0)], [], []
    for time in map(mpf, times):
        while t < time:
            ahead = step(rates, t, x, min(h, time - t), columns)
            if ahead[0] < place:
                t, x = t + min(h, time - t), ahead
                continue
            dt = h / 2
            for _ in range(40):
                there = step(rates, t, x, dt, columns)
                dt -= (there[0] - place) / there[1]
            there = step(rates, t, x, dt, columns)
            before = there[1]
            way = machine(place)[0].first
            impulse = (1 + e) * inertia(place) * abs(before / way)
            t, x = t + dt, [place, -e * before]
            impacts.append((t, {"drive.speed": x[1], "drive.angle": x[0], "stop.impulse": impulse}))
        states.append(x)
    return states, impacts


states, impacts = run(mpf("0.005"), 12)
again, others = run(mpf("0.0035"), 11)
agree(states, again, 20)
agree([[t] for t, _ in impacts], [[t] for t, _ in others], 20)
# The first by energy, the others by restitution alone.
first = sqrt(2 * torque * (place - mpf("0.9")) / inertia(place))
for k, (_, after) in enumerate(impacts):
    assert abs(after["drive.speed"] + e ** (k + 1) * first) < mpf(10) ** -20 * first
held = torque / abs(machine(place)[0].first)
write(__file__, [*times, "2"], {
    "drive.angle": [x[0] for x in states] + [place], "drive.speed": [x[1] for x in states] + [mpf(0)],
    "stop.e": [mpf(0)] * len(states) + [held],
}, "one angle, extrapolation of order 24; at rest the torque over the slope of the slider's place", impacts=impacts)
