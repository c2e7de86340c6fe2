#!/usr/bin/env python3
"""Computes the constants of the elementary functions, for Rust and for C.

    python3 constants.py        # rewrites constants.rs and constants.c; needs mpmath

Polynomials interpolate at Chebyshev points, which comes within a small factor of the best possible error; the error that
is left, relative to the value of the function, stands beside each of them.
"""

import pathlib
import struct
from mpmath import mp, mpf, pi, log, exp, sin, cos, sinh, cosh, atan, sqrt, floor, nstr, matrix, lu_solve

mp.prec = 1400
HERE = pathlib.Path(__file__).parent


def nearest(x):
    """The double nearest to x."""
    mp.prec, before = 53, mp.prec
    rounded = float(+x)
    mp.prec = before
    return rounded


def short(x, bits):
    """x rounded to a multiple of 2^-bits."""
    return mpf(int(floor(x * mpf(2) ** bits + mpf(0.5)))) / mpf(2) ** bits


def text(x):
    return repr(float(x))


def bits(x):
    return struct.unpack("<Q", struct.pack("<d", x))[0]


def of_bits(b):
    return struct.unpack("<d", struct.pack("<Q", b))[0]


def interpolate(f, low, high, n):
    """Coefficients, lowest first, of the polynomial that meets f at n Chebyshev points. From 0 on the error counts times
    z: of one point more, the first is at 0 and left out."""
    if low < 0:
        middle, half = (mpf(low) + high) / 2, (mpf(high) - low) / 2
        points = [middle + half * cos(pi * (2 * i + 1) / (2 * n)) for i in range(n)]
    else:
        end = cos(pi / (2 * n + 2))
        points = [(cos(pi * (2 * i + 1) / (2 * n + 2)) + end) / (1 + end) * high for i in range(n)]
    rows = matrix(n, n)
    for i, x in enumerate(points):
        for j in range(n):
            rows[i, j] = x ** j
    return [nearest(c) for c in lu_solve(rows, matrix([f(x) for x in points]))]


def worst(coefficients, f, weight, low, high):
    """Greatest |weight (p - f)|, as a power of two."""
    most = mpf(0)
    for i in range(1, 400):
        x = mpf(low) + (mpf(high) - low) * i / 401
        p = sum(mpf(c) * x ** j for j, c in enumerate(coefficients))
        most = max(most, abs(weight(x) * (p - f(x))))
    return nstr(log(most, 2), 4)


class Files:
    def __init__(self):
        self.rust = ["//! Constants of the elementary functions. Written by `constants.py`.", "",
                     "#![allow(clippy::excessive_precision, clippy::approx_constant)]", ""]
        # Exported C puts in only the items that are needed.
        self.c = ["//always", "/* Constants of the elementary functions. Written by constants.py. */", ""]

    def number(self, name, value, what):
        self.rust += [f"/// {what}", f"pub const {name}: f64 = {text(value)};"]
        self.c += [f"//item HA_{name}", f"/* {what} */", f"#define HA_{name} ({text(value)})"]

    def word(self, name, value, what):
        self.rust += [f"/// {what}", f"pub const {name}: u64 = {value:#x};"]
        self.c += [f"//item HA_{name}", f"/* {what} */", f"#define HA_{name} UINT64_C({value:#x})"]

    def table(self, name, rows, what):
        width = len(rows[0])
        shape = f"[[f64; {width}]; {len(rows)}]" if width > 1 else f"[f64; {len(rows)}]"
        dims = f"[{len(rows)}][{width}]" if width > 1 else f"[{len(rows)}]"
        join = lambda r, a, b: a + ", ".join(map(text, r)) + b if width > 1 else text(r[0])
        self.rust += [f"/// {what}", "#[rustfmt::skip]", f"pub static {name}: {shape} = ["]
        self.rust += [f"    {join(r, '[', ']')}," for r in rows] + ["];"]
        self.c += [f"//item HA_{name}: HA_DATA", f"/* {what} */", f"HA_DATA double HA_{name}{dims} = {{"]
        self.c += [f"    {join(r, '{', '}')}{',' if i + 1 < len(rows) else ''}" for i, r in enumerate(rows)] + ["};"]

    def words(self, name, values, what):
        rows = [", ".join(f"{v:#010x}" for v in values[i:i + 8]) for i in range(0, len(values), 8)]
        self.rust += [f"/// {what}", "#[rustfmt::skip]", f"pub static {name}: [u32; {len(values)}] = ["]
        self.rust += [f"    {r}," for r in rows] + ["];"]
        self.c += [f"//item HA_{name}: HA_DATA", f"/* {what} */", f"HA_DATA uint32_t HA_{name}[{len(values)}] = {{"]
        self.c += [f"    {r}{',' if i + 1 < len(rows) else ''}" for i, r in enumerate(rows)] + ["};"]

    def polynomial(self, name, what, f, weight, low, high, n):
        coefficients = interpolate(f, low, high, n)
        error = worst(coefficients, f, weight, low, high)
        self.table(name, [[c] for c in coefficients], f"{what}; error 2^{error} of the function.")

    def write(self):
        (HERE / "constants.rs").write_text("\n".join(self.rust) + "\n")
        (HERE / "constants.c").write_text("\n".join(self.c) + "\n")


def trigonometric(out):
    half = pi / 2
    out.number("TWO_OVER_PI", nearest(2 / pi), "2/pi.")
    out.number("PIO2_SHORT", short(half, 36), "pi/2 in 37 bits: its products with 16 bits are exact.")
    middle = short(half - short(half, 36), 73)
    out.number("PIO2_MIDDLE", middle, "The next 36 bits of pi/2.")
    out.number("PIO2_REST", nearest(half - short(half, 36) - middle), "What is left of pi/2.")
    hi = nearest(half)
    out.number("PIO2_HI", hi, "pi/2.")
    out.number("PIO2_LO", nearest(half - mpf(hi)), "pi/2 without its nearest number.")
    out.number("PI_HI", nearest(pi), "pi.")
    out.number("PI_LO", nearest(pi - mpf(nearest(pi))), "pi without its nearest number.")
    limbs = [int(floor((2 / pi) * mpf(2) ** (32 * (i + 1)))) % 2 ** 32 for i in range(38)]
    out.words("TWO_OVER_PI_BITS", [0, 0] + limbs, "2/pi in pieces of 32 bits, after two that are zero.")
    most = (pi / 4 * mpf("1.0005")) ** 2
    out.polynomial("SINE", "(a - sin a)/a^3 by z = a^2", lambda z: (sqrt(z) - sin(sqrt(z))) / (z * sqrt(z)),
                   lambda z: z * sqrt(z) / sin(sqrt(z)), 0, most, 6)
    out.polynomial("COSINE", "(cos a - 1 + a^2/2)/a^4 by z = a^2", lambda z: (cos(sqrt(z)) - 1 + z / 2) / z ** 2,
                   lambda z: z ** 2 / cos(sqrt(z)), 0, most, 6)


def exponential(out):
    step = log(2) / 64
    out.number("STEPS_PER_E", nearest(1 / step), "64/ln 2.")
    out.number("STEP_SHORT", short(step, 41), "ln 2/64 in 35 bits: its products with 18 bits are exact.")
    out.number("STEP_REST", nearest(step - short(step, 41)), "ln 2/64 without the 35 bits.")
    powers = [mpf(2) ** (mpf(j) / 64) for j in range(64)]
    out.table("POWERS", [(nearest(p), nearest(p - mpf(nearest(p)))) for p in powers], "2^(j/64), and what is left of it.")
    r = step / 2 * mpf("1.001")
    out.polynomial("EXPONENTIAL", "(e^r - 1 - r)/r^2", lambda r: (exp(r) - 1 - r) / r ** 2, lambda r: r ** 2, -r, r, 4)
    out.polynomial("SINH", "(sinh x - x)/x^3 by z = x^2", lambda z: (sinh(sqrt(z)) - sqrt(z)) / (z * sqrt(z)),
                   lambda z: z * sqrt(z) / sinh(sqrt(z)), 0, 1, 7)
    out.polynomial("COSH", "(cosh x - 1)/x^2 by z = x^2", lambda z: (cosh(sqrt(z)) - 1) / z, lambda z: z, 0,
                   mpf("0.1226"), 6)


def logarithm(out):
    one, bin_size = bits(1.0), 2 ** 45
    below = (one - bits(float(sqrt(mpf(0.5)))) - bin_size // 2) // bin_size
    start = one - below * bin_size - bin_size // 2
    out.word("BINS_START", start, "Where the 128 intervals of the mantissa begin: 1 is the middle of one of them.")
    rows, most = [], mpf(0)
    for i in range(128):
        low, high = of_bits(start + i * bin_size), of_bits(start + (i + 1) * bin_size)
        inverse = short(1 / mpf(of_bits(start + i * bin_size + bin_size // 2)), 10)
        most = max(most, abs(mpf(low) * inverse - 1), abs(mpf(high) * inverse - 1))
        value = -log(inverse)
        hi = short(value, 42)
        rows.append((inverse, hi, nearest(value - hi)))
    what = "For each interval a short number c near the inverse of its middle; -ln c in multiples of 2^-42, and what is left."
    out.table("LOGARITHMS", rows, what)
    hi = short(log(2), 42)
    out.number("LN2_SHORT", hi, "ln 2 in multiples of 2^-42.")
    out.number("LN2_REST", nearest(log(2) - hi), "ln 2 without them.")
    out.polynomial("LOGARITHM", "(ln(1 + r) - r + r^2/2)/r^3", lambda r: (log(1 + r) - r + r ** 2 / 2) / r ** 3,
                   lambda r: r ** 2, -most, most * mpf("1.001"), 7)
    for base, name in [(10, "LOG10_E"), (2, "LOG2_E")]:
        value = 1 / log(base)
        out.number(f"{name}_HI", nearest(value), f"1/ln {base}.")
        out.number(f"{name}_LO", nearest(value - mpf(nearest(value))), "What is left of it.")


def arcs(out):
    values = [atan(mpf(j) / 8) for j in range(9)]
    out.table("ARCS", [(nearest(v), nearest(v - mpf(nearest(v)))) for v in values], "atan(j/8), and what is left of it.")
    middles = [mpf(2) ** octave * (1 + mpf(2 * quarter + 1) / 8) for octave in range(-4, 4) for quarter in range(4)]
    out.table("ARCS_OF_QUARTERS", [(nearest(atan(c)), nearest(atan(c) - mpf(nearest(atan(c))))) for c in middles],
              "atan c at the middles c of quarters of octaves from 1/16 to 16, and what is left of it.")
    most = mpf("0.0631") ** 2
    out.polynomial("ARC", "(t - atan t)/t^3 by z = t^2", lambda z: (sqrt(z) - atan(sqrt(z))) / (z * sqrt(z)),
                   lambda z: z, 0, most, 5)


if __name__ == "__main__":
    files = Files()
    trigonometric(files)
    exponential(files)
    logarithm(files)
    arcs(files)
    files.write()
