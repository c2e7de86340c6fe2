"""Line of n sections in closed form: standing waves between a held and an open end.

With v[0] = V and v[n+1] = v[n] the voltages obey l c v[i]'' = v[i-1] - 2 v[i] + v[i+1]. The waves sin(a i) with
a = (2k - 1) pi/(2n + 1) meet both ends and turn with w = 2 sin(a/2)/sqrt(l c). Checked by integrating the sections.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, mp, mpf, sin, sqrt
from reference_tools import agree, integrate, write

n, l, c, volts = 6, mpf("1e-3"), mpf("1e-6"), mpf(10)
times = ["0.00005", "0.0001", "0.0002", "0.0004", "0.0008", "0.0015"]
waves = [(2 * k - 1) * mp.pi / (2 * n + 1) for k in range(1, n + 1)]
speed = [2 * sin(a / 2) / sqrt(l * c) for a in waves]
size = [4 * sum(sin(a * i) for i in range(1, n + 1)) / (2 * n + 1) for a in waves]


def voltages(t):
    turn = [s * cos(w * t) for s, w in zip(size, speed)]
    return [volts * (1 - sum(r * sin(a * i) for r, a in zip(turn, waves))) for i in range(1, n + 1)]


def currents(t):
    turn = [s * w * sin(w * t) for s, w in zip(size, speed)]
    charging = [volts * c * sum(r * sin(a * i) for r, a in zip(turn, waves)) for i in range(1, n + 1)]
    return [sum(charging[i:]) for i in range(n)]


def rates(t, x):
    i, v = x[:n], x[n:]
    before = [volts, *v[:-1]]
    after = [*i[1:], mpf(0)]
    return [(a - b) / l for a, b in zip(before, v)] + [(a - b) / c for a, b in zip(i, after)]


states = [currents(mpf(t)) + voltages(mpf(t)) for t in times]
agree(states, integrate(rates, [mpf(0)] * (2 * n), times, mpf("1e-5"), 12))
columns = list(zip(*states))
values = {f"line[{k + 1}].coil.f": columns[k] for k in range(n)}
values |= {f"line[{k + 1}].store.e": columns[n + k] for k in range(n)}
values["at_end"] = columns[2 * n - 1]
values["energy"] = [sum(l * i * i + c * v * v for i, v in zip(s[:n], s[n:])) / 2 for s in states]
write(__file__, times, values, "standing waves")
