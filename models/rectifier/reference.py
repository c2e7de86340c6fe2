"""Bridge rectifier: the bridge is symmetric, so that one equation for the current of the mains is left.

Diodes 1 and 4 carry one voltage, 2 and 3 another: `2 x = v - Rs i - u`, `2 y = -v + Rs i - u`, `i = G(x) - G(y)`, whose
right side falls with i. Extrapolated midpoint rule of orders 24 and 20.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import exp, mp, mpf, pi, sin
from reference_tools import twice, write

v0, f0 = mpf(10), mpf(50)
rs, rl, c = mpf(10), mpf(1000), mpf("10e-6")
sat, vt, leak = mpf("1e-9"), mpf("0.05"), mpf("1e-6")
times = ["0.001", "0.003", "0.005", "0.007", "0.009", "0.0125", "0.02"]
last = [mpf(0)]


def law(u):
    return sat * (exp(u / vt) - 1) + leak * u


def slope(u):
    return sat / vt * exp(u / vt) + leak


def mains(t, u):
    """The current of the mains, and the voltages of diodes 1 and 2: Newton, which this monotone, convex-concave equation
    needs damped only by a bound on the step in voltage."""
    v, i = v0 * sin(2 * pi * f0 * t), last[0]
    for _ in range(500):
        x, y = (v - rs * i - u) / 2, (-v + rs * i - u) / 2
        gap = i - law(x) + law(y)
        step = gap / (1 + rs / 2 * (slope(x) + slope(y)))
        i -= max(min(step, vt / rs), -vt / rs) if max(x, y) > mpf("0.6") else step
        if abs(step) < mpf(10) ** (8 - mp.dps) * (abs(i) + leak):
            last[0] = i
            return i, (v - rs * i - u) / 2, (-v + rs * i - u) / 2
    raise ArithmeticError(f"no convergence at t = {t}")


def rates(t, s):
    _, x, y = mains(t, s[0])
    return [(law(x) + law(y) - s[0] / rl) / c]


states = twice(rates, [mpf(0)], times, "0.0001", digits=18)
u = [s[0] for s in states]
currents, x, y = zip(*[mains(mpf(t), s) for t, s in zip(times, u)])
write(__file__, times, {
    "C1.e": u, "C1.q": [c * s for s in u], "v_out": u, "i_mains": currents,
    "d1.junction.e": x, "d4.junction.e": x, "d2.junction.e": y, "d3.junction.e": y,
    "Rl.f": [s / rl for s in u],
}, "symmetric bridge, one equation by Newton, extrapolation of order 24")
