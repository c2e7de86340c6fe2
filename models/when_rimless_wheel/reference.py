"""Rimless wheel: an upside-down pendulum between impacts, each found by Newton's method.

Checked by energy: the speed at the end of a step follows from that at its beginning in closed form.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, mpf, sin, sqrt
from reference_tools import agree, step, write

g, l, alpha, gamma = mpf("9.81"), mpf(1), mpf("0.4"), mpf("0.08")
times = ["0.25", "0.5", "0.75", "1", "1.5", "2", "2.5", "3"]
h, columns = mpf("0.01"), 12


def rates(_, x):
    return [g / l * sin(x[1]), x[0]]


def moved(x, by):
    n = max(1, int(mpf(abs(by)) / h) + 1)
    for _ in range(n):
        x = step(rates, mpf(0), x, by / n, columns)
    return x


def walk():
    """States at the times, and for each step the speeds at its beginning and its end."""
    t, x, count, found, speeds = mpf(0), [mpf("1.2"), gamma - alpha], 0, [], []
    begun = x
    for time in [mpf(s) for s in times]:
        while True:
            ahead = moved(x, time - t)
            if ahead[1] <= gamma + alpha:
                t, x = time, ahead
                break
            dt = (gamma + alpha - x[1]) / x[0]
            for _ in range(60):
                end = moved(x, dt)
                change = (gamma + alpha - end[1]) / end[0]
                dt += change
                if abs(change) < mpf("1e-32"):
                    break
            t, end = t + dt, moved(x, dt)
            speeds.append((begun[0], end[0]))
            x = [cos(2 * alpha) * end[0], end[1] - 2 * alpha]
            begun, count = x, count + 1
        found.append([*x, mpf(count)])
    return found, speeds


states, speeds = walk()
gained = 2 * g / l * (cos(gamma - alpha) - cos(gamma + alpha))
agree([[end] for _, end in speeds], [[sqrt(begin**2 + gained)] for begin, _ in speeds])
speed, angle, count = zip(*states)
write(__file__, times, {"leg.f": speed, "theta": angle, "steps": count, "turn.f": speed}, "mpmath, impacts by Newton")
