"""What the reference programs share: a high-order integrator, linear systems, and the file they write.

Nothing here knows a bond graph. Every program derives its own equations by hand and depends on mpmath only.
"""
import json
import sys
from pathlib import Path

from mpmath import atan2, cos, expm, matrix, mp, mpf, nstr, sin, sqrt

mp.dps = 40


def step(rates, t, x, h, columns):
    """One step of Gragg's extrapolated midpoint rule, of order 2*columns. `rates(t, x)`: list of derivatives."""
    table = []
    for row in range(columns):
        n = 2 * (row + 1)
        d = h / n
        old, new = x, [a + d * r for a, r in zip(x, rates(t, x))]
        for k in range(1, n):
            old, new = new, [a + 2 * d * r for a, r in zip(old, rates(t + k * d, new))]
        smooth = [(a + b + d * r) / 2 for a, b, r in zip(old, new, rates(t + h, new))]
        line = [smooth]
        for k in range(row):
            ratio = (mpf(n) / (2 * (row - k))) ** 2 - 1
            line.append([a + (a - b) / ratio for a, b in zip(line[k], table[-1][k])])
        table.append(line)
    return table[-1][-1]


def integrate(rates, x, times, h, columns, knots=()):
    """States of x' = rates(t, x) at `times`, from t = 0. Steps of at most `h` end at every time and knot
    (where a source jumps or bends; `rates` then takes a third argument, the middle of the present stretch)."""
    states, t = {}, mpf(0)
    for end in sorted({mpf(s) for s in times} | {mpf(k) for k in knots if mpf(k) < mpf(times[-1])}):
        n = int(mp.ceil((end - t) / h))
        here = rates if not knots else (lambda s, y, middle=(t + end) / 2: rates(s, y, middle))
        for k in range(n):
            x = step(here, t + k * (end - t) / n, x, (end - t) / n, columns)
        t = end
        states[t] = x
    return [states[mpf(s)] for s in times]


def twice(rates, x, times, h, columns=12, knots=(), digits=22):
    """The states from two runs that differ in step and order, which must agree to `digits`."""
    fine = integrate(rates, x, times, mpf(h), columns, knots)
    agree(fine, integrate(rates, x, times, 2 * mpf(h) / 3, columns - 2, knots), digits)
    return fine


def linear(a, x, times):
    """exp(A t) x for the list of rows `a`, by mpmath."""
    a, x = matrix(a), matrix(x)
    return [list(expm(a * mpf(t), method="taylor") * x) for t in times]


class Jet:
    """A function of one variable at a point: its value, first and second derivative."""

    def __init__(self, value, first=0, second=0):
        self.value, self.first, self.second = mpf(value), mpf(first), mpf(second)

    def through(self, value, first, second):
        """f of this, from f and its derivatives at the value."""
        return Jet(value, first * self.first, second * self.first**2 + first * self.second)

    def __add__(self, other):
        other = jet(other)
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __mul__(self, other):
        other = jet(other)
        second = self.second * other.value + 2 * self.first * other.first + self.value * other.second
        return Jet(self.value * other.value, self.first * other.value + self.value * other.first, second)

    def __neg__(self):
        return self * -1

    def __sub__(self, other):
        return self + jet(other) * -1

    def __rsub__(self, other):
        return jet(other) - self

    def __truediv__(self, other):
        v = jet(other).value
        return self * jet(other).through(1 / v, -1 / v**2, 2 / v**3)

    def __rtruediv__(self, other):
        return jet(other) / self

    __radd__, __rmul__ = __add__, __mul__

    def sin(self):
        s, c = sin(self.value), cos(self.value)
        return self.through(s, c, -s)

    def cos(self):
        s, c = sin(self.value), cos(self.value)
        return self.through(c, -s, -c)

    def sqrt(self):
        r = sqrt(self.value)
        return self.through(r, 1 / (2 * r), -1 / (4 * r**3))


def jet(value):
    return value if isinstance(value, Jet) else Jet(value)


def angle(y, x, near):
    """The angle of (x, y) as a Jet, of its values 2 pi apart the one nearest to `near`."""
    turn = 2 * mp.pi
    value = atan2(y.value, x.value)
    value += turn * mp.nint((near - value) / turn)
    square = x.value**2 + y.value**2
    first = (x.value * y.first - y.value * x.first) / square
    second = (x.value * y.second - y.value * x.second) / square
    return Jet(value, first, second - 2 * first * (x.value * x.first + y.value * y.first) / square)


def meet(x1, y1, r1, x2, y2, r2, side):
    """Where two circles meet: of both points the one to the left (side = 1) or right (-1) of the way between the centres."""
    dx, dy = x2 - x1, y2 - y1
    square = dx * dx + dy * dy
    part = (square + r1**2 - r2**2) / (2 * square)
    high = (jet(r1**2) / square - part * part).sqrt() * side
    return x1 + part * dx - high * dy, y1 + part * dy + high * dx


def one_freedom(coordinates, inertias, energy, force=0):
    """Acceleration of a machine with one degree of freedom at speed w, by Lagrange: M a + M' w²/2 + V' = force.

    `coordinates`: Jets in the angle that tells its position; `energy`: V, a Jet. Returns a function of w."""
    mass = sum(m * q.first**2 for q, m in zip(coordinates, inertias))
    slope = sum(m * q.first * q.second for q, m in zip(coordinates, inertias))
    return lambda w: (force - jet(energy).first - slope * w**2) / mass


def rate(q, w):
    return q.first * w


def acceleration(q, w, a):
    return q.second * w**2 + q.first * a


def agree(one, other, digits=22):
    """Stops the program unless two tables of states agree to `digits` of each column's largest magnitude."""
    for a, b in zip(zip(*one), zip(*other)):
        size = max(abs(v) for v in a)
        worst = max(abs(v - w) for v, w in zip(a, b))
        assert worst <= size * mpf(10) ** -digits, f"differ by {nstr(worst / size, 3)} of {nstr(size, 3)}"


def write(program, times, columns, source, inputs=None, tolerance=1e-9, impacts=None):
    """Writes reference.json beside the program. `columns`: recorded name -> one value a time. `impacts`: the first ones,
    each with its time and what there is after it."""
    data = {"t": list(times), "values": {name: [decimal(v) for v in values] for name, values in columns.items()},
            "tolerance": tolerance, "source": source}
    if inputs:
        data["inputs"] = inputs
    if impacts:
        after = lambda values: {name: decimal(v) for name, v in values.items()}
        data["impacts"] = [{"t": decimal(t), "after": after(values)} for t, values in impacts]
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(program).with_name("reference.json")
    target.write_text(json.dumps(data, indent=1) + "\n")


def decimal(value):
    """17 significant digits; what is zero to rounding is written 0."""
    return "0" if abs(value) < mpf(10) ** -30 else nstr(value, 17, strip_zeros=False)
