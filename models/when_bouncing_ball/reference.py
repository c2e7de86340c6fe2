"""Bouncing ball: parabolas between impacts, whose times are a geometric series.

Closed form for the number of impacts and the flight at any time; checked impact by impact.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import floor, log, mpf, sqrt
from reference_tools import agree, write

g, e, h0 = mpf("9.81"), mpf("0.8"), mpf(1)
first = sqrt(2 * h0 / g)
times = ["0.2", "0.4", "0.5", "1", "1.5", "2", "2.5", "2.75", "3"]


def closed(t):
    """Height, speed and number of impacts."""
    if t <= first:
        return [h0 - g * t**2 / 2, -g * t, mpf(0)]
    # The k-th impact is at first (1 + 2 e (1 - e^(k-1))/(1 - e)).
    left = 1 - (t / first - 1) * (1 - e) / (2 * e)
    k = floor(log(left) / log(e)) + 1
    since = t - first * (1 + 2 * e * (1 - e ** (k - 1)) / (1 - e))
    up = e**k * g * first
    return [up * since - g * since**2 / 2, up - g * since, k]


def by_impacts(t):
    at, up, k = first, e * g * first, 1
    if t <= at:
        return [h0 - g * t**2 / 2, -g * t, mpf(0)]
    while at + 2 * up / g <= t:
        at, up, k = at + 2 * up / g, e * up, k + 1
    return [up * (t - at) - g * (t - at) ** 2 / 2, up - g * (t - at), mpf(k)]


states = [closed(mpf(t)) for t in times]
agree(states, [by_impacts(mpf(t)) for t in times])
height, speed, impacts = zip(*states)
write(__file__, times, {"h": height, "ball.f": speed, "n": impacts}, "closed form")
