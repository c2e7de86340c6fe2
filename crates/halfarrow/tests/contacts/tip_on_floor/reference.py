"""Double pendulum by its two angles, Lagrange's equations written by hand; impacts of the tip by Newton's method in time.

Between impacts the energy stays; at one the tip keeps `e` of its speed down and nothing acts along the floor.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import cos, mpf, sin
from reference_tools import agree, step, write

g, e, depth, reach, l = mpf("9.81"), mpf("0.5"), mpf("0.7"), mpf("0.5"), mpf("0.6")
m1, j1, c1, m2, j2, c2 = mpf("1.2"), mpf("0.02"), mpf("0.3"), mpf("0.8"), mpf("0.03"), mpf("0.25")
times = ["0.2", "0.4", "0.6", "0.8", "1", "1.2", "1.4"]


def mass(a):
    both = m2 * l * c2 * cos(a[0] - a[1])
    return m1 * c1**2 + j1 + m2 * l**2, both, m2 * c2**2 + j2


def solve(matrix, right):
    a, b, c = matrix
    det = a * c - b * b
    return [(c * right[0] - b * right[1]) / det, (a * right[1] - b * right[0]) / det]


def rates(_, x):
    a, w = x[:2], x[2:]
    turn = m2 * l * c2 * sin(a[0] - a[1])
    right = [-turn * w[1] ** 2 - (m1 * c1 + m2 * l) * g * cos(a[0]), turn * w[0] ** 2 - m2 * c2 * g * cos(a[1])]
    return [*w, *solve(mass(a), right)]


def energy(x):
    p, q, r = mass(x)
    moving = p * x[2] ** 2 / 2 + q * x[2] * x[3] + r * x[3] ** 2 / 2
    return moving + (m1 * c1 + m2 * l) * g * sin(x[0]) + m2 * c2 * g * sin(x[1])


def gap(x):
    return l * sin(x[0]) + reach * sin(x[1]) + depth


def closing(x):
    return l * cos(x[0]) * x[2] + reach * cos(x[1]) * x[3]


def hit(x):
    normal = [l * cos(x[0]), reach * cos(x[1])]
    along = solve(mass(x), normal)
    impulse = -(1 + e) * closing(x) / (normal[0] * along[0] + normal[1] * along[1])
    return [*x[:2], x[2] + impulse * along[0], x[3] + impulse * along[1]], impulse


def run(h, columns):
    t, x, impacts, states = mpf(0), [mpf("0.3"), mpf("-0.2"), mpf(0), mpf(0)], [], []
    begun = energy(x)
    for time in map(mpf, times):
        while t < time:
            ahead = step(rates, t, x, min(h, time - t), columns)
            if gap(ahead) > 0:
                t, x = t + min(h, time - t), ahead
                continue
            dt = h / 2
            for _ in range(40):
                there = step(rates, t, x, dt, columns)
                change = gap(there) / closing(there)
                dt -= change
                if abs(change) < mpf(10) ** -34:
                    break
            there = step(rates, t, x, dt, columns)
            assert 0 < dt < h and abs(energy(there) - begun) < mpf(10) ** -22
            x, impulse = hit(there)
            t, begun = t + dt, energy(x)
            impacts.append((t, {"one.speed": x[2], "two.speed": x[3] - x[2], "one.angle": x[0], "floor.impulse": impulse}))
        states.append(x)
    return states, impacts


states, impacts = run(mpf("0.01"), 12)
again, others = run(mpf("0.007"), 11)
agree(states, again, 20)
agree([[t] for t, _ in impacts], [[t] for t, _ in others], 20)
a, b, v, w = zip(*states)
columns = {"one.angle": a, "two.angle": [q - p for p, q in zip(a, b)], "one.speed": v, "two.speed": [q - p for p, q in zip(v, w)]}
write(__file__, times, columns, "Lagrange's equations, extrapolation of order 24, impacts by Newton's method", impacts=impacts)
