"""What the raw equations of a linear bond graph say, in rationals: poles and the state of rest of a graph without storages.

Every junction, two-port and law gives its equations as it stands, in all efforts, flows and stored quantities; nothing
is shared with the program. Poles are the roots of det(s E - A), found with 60 digits. Needs mpmath.

    python raw.py poles one_pole_off.bond
    python raw.py rest wrong_flow.bond
"""

import re
import sys
from fractions import Fraction

import mpmath


def number(text):
    return Fraction(text.replace(" ", "")) if "/" not in text else Fraction(text.split("/")[0]) / Fraction(text.split("/")[1])


def read(path):
    kinds, values, bonds = {}, {}, []
    for line in open(path):
        if not line.strip() or line.startswith("model"):
            continue
        nodes = [re.match(r"^(?:(\w+):)?(\w+)(?:\((.*)\))?$", node.strip()).groups() for node in line.split("->")]
        for kind, name, value in nodes:
            if kind:
                kinds[name], values[name] = kind, value
        bonds += [(a[1], b[1]) for a, b in zip(nodes, nodes[1:])]
    return kinds, values, bonds


def equations(path):
    """Rows (E, A, b) of E x' = A x + b, the number of unknowns, of stored quantities, and names."""
    kinds, values, bonds = read(path)
    n = len(bonds)
    stored = {name: 2 * n + i for i, name in enumerate(k for k in kinds if kinds[k] in "IC")}
    rows = []

    def law(terms, constant=0, rates=()):
        rows.append(({c: Fraction(v) for c, v in rates}, {c: Fraction(v) for c, v in terms}, Fraction(constant)))

    for name, kind in kinds.items():
        own = [(b, 1 if bonds[b][1] == name else -1) for b in range(n) if name in bonds[b]]
        e, f = own[0][0], n + own[0][0]
        inverse = values[name] and "=" in values[name]
        value = number(values[name].split("=")[-1]) if values[name] else None
        if kind in "01":
            common, summed = (0, n) if kind == "0" else (n, 0)
            for (a, _), (b, _) in zip(own, own[1:]):
                law([(common + a, 1), (common + b, -1)])
            law([(summed + b, sign) for b, sign in own])
        elif kind in ("TF", "GY"):
            (i,), (o,) = [b for b, sign in own if sign > 0], [b for b, sign in own if sign < 0]
            if kind == "TF":
                law([(i, 1), (o, -value)])
                law([(n + o, 1), (n + i, -value)])
            else:
                law([(i, 1), (n + o, -value)])
                law([(o, 1), (n + i, -value)])
        elif kind == "Se":
            law([(e, 1)], -value)
        elif kind == "Sf":
            law([(f, 1)], -value)
        elif kind == "R":
            law([(f, 1), (e, -value)] if inverse else [(e, 1), (f, -value)])
        else:
            x = stored[name]
            rate, other = (e, f) if kind == "I" else (f, e)
            law([(rate, 1)], rates=[(x, 1)])
            law([(other, 1), (x, -value)] if inverse else [(x, 1), (other, -value)])
    names = [f"{'ef'[i // n]}[{' -> '.join(bonds[i % n])}]" for i in range(2 * n)] + list(stored)
    return rows, 2 * n + len(stored), len(stored), names


def eliminate(rows, right):
    """Determinant (but for its sign) and solution, if there is one."""
    rows, right, done, size = [dict(r) for r in rows], list(right), [], Fraction(1)
    live = list(range(len(rows)))
    while live:
        r = min(live, key=lambda i: len(rows[i]))
        if not rows[r]:
            return Fraction(0), None
        c = min(rows[r], key=lambda c: (sum(c in rows[i] for i in live), c))
        pivot = rows[r][c]
        size *= pivot
        live.remove(r)
        done.append((r, c))
        for i in range(len(rows)):
            if i != r and c in rows[i]:
                factor = rows[i][c] / pivot
                for j, v in rows[r].items():
                    left = rows[i].get(j, Fraction(0)) - factor * v
                    if left:
                        rows[i][j] = left
                    else:
                        rows[i].pop(j, None)
                right[i] -= factor * right[r]
    return size * sign(done), {c: right[r] / rows[r][c] for r, c in done}


def sign(pairs):
    place, seen, result = dict(pairs), set(), 1
    for start in place:
        length, at = 0, start
        while at not in seen:
            seen.add(at)
            at = place[at]
            length += 1
        if length and length % 2 == 0:
            result = -result
    return result


def polynomial(path):
    """Coefficients of det(s E - A), the constant one first, by interpolation."""
    rows, _, order, _ = equations(path)
    points = [Fraction(i) for i in range(order + 1)]

    def at(s):
        both = [{c: s * E.get(c, 0) - A.get(c, 0) for c in {**E, **A}} for E, A, _ in rows]
        return eliminate([{c: v for c, v in row.items() if v} for row in both], [Fraction(0)] * len(rows))[0]

    steps = [at(s) for s in points]
    for k in range(1, len(points)):
        for i in range(len(points) - 1, k - 1, -1):
            steps[i] = (steps[i] - steps[i - 1]) / (points[i] - points[i - k])
    result = [Fraction(0)]
    for k in range(len(points) - 1, -1, -1):
        result = [a - points[k] * b for a, b in zip([Fraction(0)] + result, result + [Fraction(0)])]
        result[0] += steps[k]
    while result and result[-1] == 0:
        result.pop()
    return result


def poles(path):
    coefficients = polynomial(path)
    zeros = next(i for i, a in enumerate(coefficients) if a)
    rest = [a / coefficients[-1] for a in coefficients[zeros:]]
    even = not any(rest[1::2])
    rest = rest[::2] if even else rest
    mpmath.mp.dps = 400
    found = mpmath.polyroots([mpmath.mpf(a.numerator) / a.denominator for a in rest[::-1]], maxsteps=20000, extraprec=4000)
    mpmath.mp.dps = 60
    if even:
        found = [s * mpmath.sqrt(mpmath.mpc(z)) for z in found for s in (1, -1)]
    return [mpmath.mpc(0)] * zeros + sorted(found, key=lambda z: (abs(z), z.imag))


def rest(path):
    rows, _, _, names = equations(path)
    solution = eliminate([A for _, A, _ in rows], [-b for _, _, b in rows])[1]
    return {names[c]: float(v) for c, v in sorted(solution.items())}


if __name__ == "__main__":
    if sys.argv[1] == "poles":
        for z in poles(sys.argv[2]):
            print(mpmath.nstr(z, 20))
    else:
        for name, value in rest(sys.argv[2]).items():
            print(name, repr(value))
