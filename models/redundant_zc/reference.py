"""Two bodies pinned together: (m1 + m2) v' = F - k q - b v; the joint carries what the trailer needs.

Closed form of a damped oscillator; checked by numerical integration of the bodies' common momentum.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, exp, mpf, sin, sqrt
from reference_tools import agree, integrate, write

m1, m2, k, b, force, v0 = mpf(2), mpf(3), mpf(50), mpf(4), mpf(10), mpf("0.5")
mass = m1 + m2
decay = b / (2 * mass)
own = sqrt(k / mass - decay**2)
times = ["0.1", "0.3", "0.7", "1", "2", "5"]


def motion(t):
    rest = force / k
    c, s, fade = cos(own * t), sin(own * t), exp(-decay * t)
    slope = (v0 - decay * rest) / own
    q = rest + fade * (-rest * c + slope * s)
    v = -decay * fade * (-rest * c + slope * s) + fade * own * (rest * s + slope * c)
    return [q, v]


def rates(t, s):
    return [s[1] / mass, force - k * s[0] - b * s[1] / mass]


states = [motion(mpf(t)) for t in times]
numeric = integrate(rates, [mpf(0), mass * v0], times, mpf("0.05"), 12)
agree(states, [[q, p / mass] for q, p in numeric])
q, v = zip(*states)
rate = [(force - k * x - b * s) / mass for x, s in states]
pull = [m2 * a + k * x + b * s for a, x, s in zip(rate, q, v)]
write(__file__, times, {
    "cart.f": v, "trailer.f": v, "spring.q": q, "cart.e": [m1 * a for a in rate], "trailer.e": [m2 * a for a in rate],
    "joint.e": pull, "pull": pull,
}, "closed form of a damped oscillator")
