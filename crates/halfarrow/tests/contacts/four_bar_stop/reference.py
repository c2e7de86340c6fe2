"""Four-bar that hits a stop: the way there with one angle by Lagrange's equation, the impact in maximal coordinates.

At the impact the three bars have nine speeds, the four pins eight impulses and the stop one:

    M dv = G^T pins + n stop,   G v+ = 0,   n v+ = -e n v-

Checked against the impact with one angle, and by energy, of which e² is left.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import cos, lu_solve, matrix, mpf, sin, zeros
from reference_tools import Jet, agree, angle, jet, meet, one_freedom, step, write

a, b, c, d = mpf("0.2"), mpf("0.5"), mpf("0.4"), mpf("0.5")
ma, mb, mc = mpf(1), mpf(2), mpf("1.5")
torque, e, px, py, wall = mpf(1), mpf("0.5"), mpf("0.3"), mpf("0.1"), mpf("0.25")
inertias = [x for m, l in ((ma, a), (mb, b), (mc, c)) for x in (m, m, m * l**2 / 12)]
times = ["0.1", "0.3", "0.5", "0.8", "1.1", "1.4"]


def machine(theta):
    """Centres and angles of the three bars, and the point that hits, in the angle of the crank."""
    t = Jet(theta, 1)
    ax, ay = a * t.cos(), a * t.sin()
    bx, by = meet(ax, ay, b, jet(d), jet(0), c, 1)
    th2, th3 = angle(by - ay, bx - ax, mpf("0.5")), angle(by, bx - d, mpf(2))
    x2, y2 = (ax + bx) / 2, (ay + by) / 2
    bars = [ax / 2, ay / 2, t, x2, y2, th2, (bx + d) / 2, by / 2, th3]
    return bars, x2 + px * th2.cos() - py * th2.sin()


def rates(_, x):
    bars, _ = machine(x[0])
    return [x[1], one_freedom(bars, inertias, 0, torque)(x[1])]


def impact(theta, w):
    """Speeds after it, impulses of the pins upon the bar that comes later, and that of the stop."""
    bars, _ = machine(theta)
    th = [bars[i].value for i in (2, 5, 8)]
    rows = zeros(9, 9)
    # Pins at the ground, between crank and coupler, coupler and rocker, at the ground: each end by its bar, arm and sign.
    ends = [[(0, -a / 2, 1)], [(0, a / 2, -1), (1, -b / 2, 1)], [(1, b / 2, -1), (2, c / 2, 1)], [(2, -c / 2, 1)]]
    for pin, own in enumerate(ends):
        for bar, arm, sign in own:
            rows[2 * pin, 3 * bar], rows[2 * pin + 1, 3 * bar + 1] = sign, sign
            rows[2 * pin, 3 * bar + 2], rows[2 * pin + 1, 3 * bar + 2] = -sign * arm * sin(th[bar]), sign * arm * cos(th[bar])
    rows[8, 3], rows[8, 5] = 1, -px * sin(th[1]) - py * cos(th[1])
    before = matrix([q.first * w for q in bars])
    assert max(abs(v) for v in (rows * before)[:8]) < mpf(10) ** -30
    system, right = zeros(18, 18), zeros(18, 1)
    for i in range(9):
        system[i, i], right[i] = inertias[i], inertias[i] * before[i]
        for j in range(9):
            system[i, 9 + j] = -rows[j, i]
            system[9 + i, j] = rows[i, j]
    right[17] = -e * (rows[8, :] * before)[0]
    solved = lu_solve(system, right)
    return solved[:9], solved[9:17], solved[17]


def run(h, columns):
    t, x, impacts, states = mpf(0), [mpf("1.2"), mpf(3)], [], []
    for time in map(mpf, times):
        while t < time:
            ahead = step(rates, t, x, min(h, time - t), columns)
            if machine(ahead[0])[1].value > wall:
                t, x = t + min(h, time - t), ahead
                continue
            dt = h / 2
            for _ in range(40):
                there = step(rates, t, x, dt, columns)
                point = machine(there[0])[1]
                change = (point.value - wall) / (point.first * there[1])
                dt -= change
                if abs(change) < mpf(10) ** -34:
                    break
            theta, w = step(rates, t, x, dt, columns)
            after, pins, stop = impact(theta, w)
            assert abs(after[2] + e * w) < mpf(10) ** -25
            kinetic = lambda v: sum(i * s**2 for i, s in zip(inertias, v)) / 2
            assert abs(kinetic(after) - e**2 * kinetic([q.first * w for q in machine(theta)[0]])) < mpf(10) ** -25
            t, x = t + dt, [theta, after[2]]
            names = [f"{q}{k}.p" for k in (1, 2, 3) for q in "XYJ"]
            told = {name: i * s for name, i, s in zip(names, inertias, after)} | {"stop.impulse": stop, "place": theta}
            told |= {f"pin {p}{axis}": pins[2 * i + k] for i, p in enumerate("OABC") for k, axis in enumerate("xy")}
            impacts.append((t, told))
        states.append(x)
    return states, impacts


states, impacts = run(mpf("0.01"), 12)
again, others = run(mpf("0.007"), 11)
agree(states, again, 20)
agree([[t] for t, _ in impacts], [[t] for t, _ in others], 20)
angles, speeds = zip(*states)
bars = [machine(theta)[0] for theta in angles]
# At rest upon the stop the torque is held by the slope of the point that touches.
place = impacts[-1][1]["place"]
held = torque / abs(machine(place)[1].first)
for _, told in impacts:
    del told["place"]
write(__file__, [*times, "2.5"], {
    "th1": [*angles, place], "w1.f": [*speeds, mpf(0)],
    "th2": [q[5].value for q in [*bars, machine(place)[0]]], "th3": [q[8].value for q in [*bars, machine(place)[0]]],
    "stop.e": [mpf(0)] * len(times) + [held],
}, "one angle between impacts, nine coordinates at each, mpmath", impacts=impacts)
