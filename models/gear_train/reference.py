"""Gear train: one equation J w' = T0 + T1 sin(W t) - B w, referred to the first shaft.

Closed form; checked by summing the power over all wheels, which needs no reduction: d/dt(sum J_k w_k²/2) = T w0 - b w5².
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, exp, mpf, sin
from reference_tools import agree, integrate, write

inertia = [mpf(s) for s in ("0.01", "0.02", "0.05", "0.08", "0.12", "0.3")]
mesh = [mpf(s) for s in ("-0.8", "-0.6", "-0.9", "-0.5", "-0.7")]
b, t0, t1, omega, start = mpf("0.5"), mpf(2), mpf(1), mpf(4), mpf(10)
times = ["0.1", "0.3", "0.7", "1", "2", "5"]

ratio = [mpf(1)]
for r in mesh:
    ratio.append(ratio[-1] * r)
whole = sum(j * r**2 for j, r in zip(inertia, ratio))
drag = b * ratio[-1] ** 2


def torque(t):
    return t0 + t1 * sin(omega * t)


def speed(t):
    size = t1 / (drag**2 + (whole * omega) ** 2)
    forced = lambda s: t0 / drag + size * (drag * sin(omega * s) - whole * omega * cos(omega * s))
    return forced(t) + (start - forced(0)) * exp(-drag / whole * t)


def energy_rate(t, s):
    speeds = [s[0] * r for r in ratio]
    power = torque(t) * speeds[0] - b * speeds[-1] ** 2
    return [power / sum(j * w * r for j, w, r in zip(inertia, speeds, ratio))]


first = [speed(mpf(t)) for t in times]
agree([[w] for w in first], integrate(energy_rate, [start], times, mpf("0.05"), 12))
columns = {f"gear{k}.f": [w * ratio[k] for w in first] for k in range(6)}
rate = [(torque(mpf(t)) - drag * w) / whole for t, w in zip(times, first)]
taken = [b * w * ratio[5] for w in first]
for k in range(5, 0, -1):
    taken = [mesh[k - 1] * (inertia[k] * ratio[k] * a + e) for a, e in zip(rate, taken)]
    columns[f"mesh{k}.in.e"] = taken
columns["torque"] = taken
write(__file__, times, columns, "closed form of one driven first-order equation")
