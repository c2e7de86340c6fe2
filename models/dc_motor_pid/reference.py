"""DC motor under PI control: L i' = u - R i - kt w, J w' = kt i - b w - load, z' = ref - w, u = kp (ref - w) + ki z.

Matrix exponential on both stretches; checked by numerical integration.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf
from reference_tools import agree, integrate, linear, write

ra, la, kt, j, b = mpf(1), mpf("2e-3"), mpf("0.05"), mpf("1e-4"), mpf("1e-5")
kp, ki, ref, jump, heavy = mpf("0.1"), mpf(2), mpf(100), mpf("0.6"), mpf("0.02")
times = ["0.05", "0.15", "0.3", "0.5", "0.7", "1"]


def voltage(w, z):
    return kp * (ref - w) + ki * z


def rates(t, s, middle):
    i, w, z = s
    load = heavy if middle > jump else 0
    return [(voltage(w, z) - ra * i - kt * w) / la, (kt * i - b * w - load) / j, ref - w]


def rows(load):
    return [[-ra / la, -(kp + kt) / la, ki / la, kp * ref / la], [kt / j, -b / j, 0, -load / j], [0, -1, 0, ref], [0] * 4]


rest = [mpf(0)] * 3
before = [t for t in times if mpf(t) < jump]
after = [mpf(t) - jump for t in times if mpf(t) > jump]
on = linear(rows(0), rest + [1], [jump])[0]
states = [s[:3] for s in linear(rows(0), rest + [1], before) + linear(rows(heavy), on, after)]
agree(states, integrate(rates, rest, times, mpf("0.004"), 12, [jump]))
i, w, z = zip(*states)
u = [voltage(*s) for s in zip(w, z)]
a = [rates(0, s, mpf(t))[1] for t, s in zip(times, states)]
write(__file__, times, {
    "coil.f": i, "rotor.f": w, "voltage": u, "error": [ref - s for s in w], "coil.p": [la * s for s in i],
    "coil.e": [s - ra * f - kt * r for s, f, r in zip(u, i, w)], "rotor.e": [j * s for s in a],
}, "matrix exponential on both sides of the load jump")
