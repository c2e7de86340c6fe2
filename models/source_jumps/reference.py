"""Series circuit: on every stretch u - E rings down, L i' = E - R i - u, C u' = i; the state carries over at a jump.

Closed form, stretch by stretch; checked by the matrix exponential.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, exp, mpf, sin, sqrt
from reference_tools import agree, linear, write

r, ind, cap = mpf(2), mpf("0.1"), mpf("1e-3")
stretches = [(mpf(0), mpf(1)), (mpf("0.31"), mpf(4)), (mpf("0.57"), mpf(-2))]
times = ["0.1", "0.25", "0.4", "0.5", "0.75", "1"]
decay = r / (2 * ind)
own = sqrt(1 / (ind * cap) - decay**2)


def ring(level, u, i, t):
    """Voltage and current a time t after they were u and i, with the source at `level`."""
    d, fade, c, s = u - level, exp(-decay * t), cos(own * t), sin(own * t)
    slope = (i / cap + decay * d) / own
    rate = fade * ((own * slope - decay * d) * c - (own * d + decay * slope) * s)
    return level + fade * (d * c + slope * s), cap * rate


def exponential(level, u, i, t):
    rows = [[0, 1 / cap, 0], [-1 / ind, -r / ind, level / ind], [0, 0, 0]]
    return linear(rows, [u, i, 1], [t])[0][:2]


def at(t, advance):
    u = i = mpf(0)
    for k, (start, level) in enumerate(stretches):
        end = min(t, stretches[k + 1][0]) if k + 1 < len(stretches) else t
        if start < end:
            u, i = advance(level, u, i, end - start)
    return u, i


states = [at(mpf(t), ring) for t in times]
agree(states, [at(mpf(t), exponential) for t in times])
level = [[e for start, e in stretches if start <= mpf(t)][-1] for t in times]
u, i = zip(*states)
write(__file__, times, {
    "store.e": u, "store.q": [cap * s for s in u], "coil.f": i, "coil.p": [ind * s for s in i], "supply.e": level,
    "wire.e": [r * s for s in i], "coil.e": [e - r * f - s for e, f, s in zip(level, i, u)],
}, "closed form on each stretch between jumps")
