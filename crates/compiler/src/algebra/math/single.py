#!/usr/bin/env python3
"""Computes the constants of the elementary functions in single precision, for C.

    python3 single.py           # rewrites single_constants.c; needs mpmath

Polynomials interpolate at Chebyshev points; the error that is left, relative to the value of the function, stands beside
each of them.
"""

import pathlib
from mpmath import mp, mpf, pi, log, exp, sin, cos, sinh, tanh, atan, asin, sqrt, floor, matrix, lu_solve

mp.prec = 400
HERE = pathlib.Path(__file__).parent
LINES = ["", "//always", "/* Constants of the elementary functions in single precision. Written by `single.py`. */", ""]


def nearest(x):
    """The number of single precision nearest to x."""
    mp.prec, before = 24, mp.prec
    rounded = +mpf(x)
    mp.prec = before
    return rounded


def short(x, bits):
    """x rounded to a multiple of 2^-bits."""
    return mpf(int(floor(x * mpf(2) ** bits + mpf(0.5)))) / mpf(2) ** bits


def text(x):
    return repr(float(x)) + "f"


def number(name, value, what):
    LINES.extend([f"//item HA_{name}", f"/* {what} */", f"#define HA_{name} {text(value)}"])


def polynomial(name, what, f, weight, high, n, low=0):
    """Of f by z from low to high; an error of the polynomial counts by its weight."""
    middle, half = (mpf(low) + high) / 2, (mpf(high) - low) / 2
    points = [middle + half * cos(pi * (2 * i + 1) / (2 * n)) for i in range(n)]
    rows = matrix(n, n)
    for i, x in enumerate(points):
        for j in range(n):
            rows[i, j] = x ** j
    coefficients = [nearest(c) for c in lu_solve(rows, matrix([f(x) for x in points]))]
    places = [mpf(low) + (mpf(high) - low) * (i + mpf(0.5)) / 400 for i in range(400)]
    error = max(abs(weight(z) * (sum(c * z ** j for j, c in enumerate(coefficients)) - f(z))) for z in places)
    exponent = float(log(error) / log(2))
    LINES.append(f"//item HA_{name}: HA_DATA")
    LINES.append(f"/* {what}; error 2^{exponent:.2f} of the function. */")
    LINES.append(f"HA_DATA float HA_{name}[{n}] = {{{', '.join(text(c) for c in coefficients)}}};")


def by_root(f):
    return lambda z: f(sqrt(z))


quarter = pi / 2
first = short(quarter, 16)
second = short(quarter - first, 33)
number("QUARTERS_SINGLE", nearest(1 / quarter), "2/pi.")
number("QUARTER_FIRST", first, "pi/2 in multiples of 2^-16.")
number("QUARTER_SECOND", second, "What is left of it, in multiples of 2^-33.")
number("QUARTER_REST", nearest(quarter - first - second), "What is left of that.")
number("QUARTER_HI", nearest(quarter), "pi/2 as a number of single precision.")
number("QUARTER_LO", nearest(quarter - nearest(quarter)), "What is left of it.")
number("HALF_TURN_HI", nearest(pi), "pi as a number of single precision.")
number("HALF_TURN_LO", nearest(pi - nearest(pi)), "What is left of it.")
most = (pi / 4 * mpf("1.001")) ** 2
polynomial("SINE_SINGLE", "(sin a - a)/a^3 by z = a^2", by_root(lambda a: (sin(a) - a) / a ** 3), lambda z: z, most, 4)
polynomial("COSINE_SINGLE", "(cos a - 1 + z/2)/z^2 by z = a^2", by_root(lambda a: (cos(a) - 1 + a * a / 2) / a ** 4),
           lambda z: z * z, most, 4)
number("STEPS_SINGLE", nearest(1 / log(2)), "1/ln 2.")
hi = short(log(2), 15)
number("LN2_FIRST", hi, "ln 2 in multiples of 2^-15.")
number("LN2_SECOND", nearest(log(2) - hi), "ln 2 without them.")
edge = log(2) / 2 * mpf("1.01")
polynomial("EXPONENTIAL_SINGLE", "(e^r - 1 - r)/r^2", lambda r: (exp(r) - 1 - r) / r ** 2, lambda r: r * r, edge, 6, -edge)
edge = ((sqrt(mpf(2)) - 1) / (sqrt(mpf(2)) + 1) * mpf("1.001")) ** 2
polynomial("LOGARITHM_SINGLE", "(ln((1 + s)/(1 - s)) - 2 s)/s^3 by z = s^2",
           by_root(lambda s: (log((1 + s) / (1 - s)) - 2 * s) / s ** 3), lambda z: z / 2, edge, 4)
for base in [10, 2]:
    value = 1 / log(base)
    number(f"LOG{base}_FIRST", nearest(value), f"1/ln {base}.")
    number(f"LOG{base}_REST", nearest(value - nearest(value)), "What is left of it.")
edge = (sqrt(mpf(2)) - 1) ** 2 * mpf("1.001")
polynomial("ARC_SINGLE", "(atan t - t)/t^3 by z = t^2", by_root(lambda t: (atan(t) - t) / t ** 3), lambda z: z, edge, 5)
polynomial("ARC_SINE_SINGLE", "(asin x - x)/x^3 by z = x^2", by_root(lambda x: (asin(x) - x) / x ** 3), lambda z: z,
           mpf("0.2501"), 6)
polynomial("SINH_SINGLE", "(sinh x - x)/x^3 by z = x^2", by_root(lambda x: (sinh(x) - x) / x ** 3), lambda z: z, mpf(1), 4)
polynomial("TANH_SINGLE", "(tanh x - x)/x^3 by z = x^2", by_root(lambda x: (tanh(x) - x) / x ** 3), lambda z: z,
           mpf("0.4"), 6)
(HERE / "single_constants.c").write_text("\n".join(LINES) + "\n\n")
