"""Quarter car by Newton's laws for the two masses, with the road speed of input.csv (linear between its rows).

Extrapolated midpoint rule of orders 24 and 20; checked by the energy: stored = supplied - dissipated.
"""
import csv
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf
from reference_tools import twice, write

ms, mu, ks, kt, b, g = mpf(320), mpf(40), mpf(18000), mpf(190000), mpf(900), mpf("9.81")
times = ["0.1", "0.3", "0.5", "1", "1.5", "3"]
table = [(mpf(r["t"]), mpf(r["road"])) for r in csv.DictReader(open(Path(__file__).with_name("input.csv")))]


def road(t, middle):
    for (t0, v0), (t1, v1) in zip(table, table[1:]):
        if middle <= t1:
            return v0 + (v1 - v0) * (t - t0) / (t1 - t0)


def rates(t, s, middle):
    tread, spring, u, v, _ = s
    strut = ks * spring + b * (u - v) ** 3
    supplied = kt * tread * road(t, middle) - mu * g * u - ms * g * v
    up, down = (kt * tread - strut) / mu - g, strut / ms - g
    return [road(t, middle) - u, u - v, up, down, supplied - b * (u - v) ** 4]


def stored(s):
    return (kt * s[0] ** 2 + ks * s[1] ** 2 + mu * s[2] ** 2 + ms * s[3] ** 2) / 2


start = [mpf("0.0186"), mpf("0.1744"), mpf(0), mpf(0), mpf(0)]
states = twice(rates, start, times, "0.008", knots=[t for t, _ in table], digits=20)
for s in states:
    assert abs(stored(s) - stored(start) - s[4]) < mpf("1e-18")
tread, spring, u, v, _ = zip(*states)
change = [rates(mpf(t), s, mpf(t)) for t, s in zip(times, states)]
write(__file__, times, {
    "tread.q": tread, "spring.q": spring, "wheel.f": u, "body.f": v, "damper.e": [b * (x - y) ** 3 for x, y in zip(u, v)],
    "tyre.e": [kt * q for q in tread], "wheel.e": [mu * c[2] for c in change], "body.e": [ms * c[3] for c in change],
    "travel": spring,
}, "Newton's laws, extrapolation of order 24, energy balance to 1e-18", {"road": "input.csv"})
