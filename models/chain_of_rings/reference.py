"""Ten rings: the linear equations of all junctions, solved once for what the states and the source make of each.

Unknowns of a ring: efforts of a, b, c, d, flows of left, right, below; and the flow of every link.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, lu_solve, matrix, mpf
from reference_tools import agree, integrate, linear, write

m1, m2, R1, R2, R3, k = mpf(4), mpf("1.5"), mpf(2), mpf(3), mpf(5), mpf(30)
n, times = 10, ["0.1", "0.5", "1", "2", "5"]
unknowns = 7 * n + n - 1
ea, eb, ec, ed, left, right, below = range(7)


def at(ring, what):
    return 7 * ring + what


def link(i):
    return 7 * n + i


# Columns of the right side: outer speeds, inner speeds, springs, source.
outer, inner, spring, source = 0, n, 2 * n, 3 * n - 1
A, B = matrix(unknowns, unknowns), matrix(unknowns, 3 * n)
row = 0


def equation(terms, given=()):
    global row
    for column, factor in terms:
        A[row, column] += factor
    for column, factor in given:
        B[row, column] += factor
    row += 1


for i in range(n):
    u = lambda what: at(i, what)
    into = [(link(i - 1), -1)] if i else []
    equation([(u(left), 1), (u(right), 1)] + into, [] if i else [(source, 1)])
    equation([(u(ea), 1), (u(eb), 1), (u(ed), -1)])
    equation([(u(eb), 1), (u(ec), -1)])
    equation([(u(right), 1), (u(below), -1)], [(outer + i, 1)])
    equation([(u(ec), 1), (u(ea), -1), (u(below), -R3)])
    equation([(u(below), 1), (u(left), -1), (u(ea), -1 / R1)])
    out = [(link(i), -1)] if i + 1 < n else [(u(ed), -1 / R1)]
    equation([(u(left), 1), (u(ed), -1 / R2)] + out, [(inner + i, 1)])
for i in range(n - 1):
    equation([(at(i, ed), 1), (at(i + 1, eb), -1)], [(spring + i, k)])

solved = matrix(unknowns, 3 * n)
for column in range(3 * n):
    for r, value in enumerate(lu_solve(A, B[:, column])):
        solved[r, column] = value
wanted = [at(i, ec) for i in range(n)] + [at(i, ed) for i in range(n)] + [link(i) for i in range(n - 1)]
factor = [1 / m1] * n + [1 / m2] * n + [mpf(1)] * (n - 1)
rows = [[solved[w, c] * f for c in range(3 * n)] for w, f in zip(wanted, factor)]


def drive(t):
    return 1 + cos(t) / 2


def rates(t, s):
    """Speeds of the outer and inner inertances, springs."""
    all_ = s + [drive(t)]
    return [sum(a * x for a, x in zip(line, all_)) for line in rows]


# With 1, cos t and sin t as states the whole is linear.
size = 3 * n - 1
whole = [line[:size] + [line[size], line[size] / 2, mpf(0)] for line in rows]
whole += [[mpf(0)] * (size + 3), [mpf(0)] * (size + 2) + [mpf(-1)], [mpf(0)] * (size + 1) + [mpf(1), mpf(0)]]
states = [s[:size] for s in linear(whole, [mpf(0)] * size + [mpf(1), mpf(1), mpf(0)], times)]
agree(states, integrate(rates, [mpf(0)] * size, times, mpf("0.05"), 11), 17)
effort = lambda s, t, where: sum(solved[where, c] * x for c, x in enumerate(s + [drive(mpf(t))]))
columns = {f"ring{i + 1}.outer.f": [s[i] for s in states] for i in (0, 4, 9)}
columns |= {f"ring{i + 1}.inner.f": [s[n + i] for s in states] for i in range(n)}
columns |= {f"spring{i + 1}.q": [s[2 * n + i] for s in states] for i in (0, 8)}
columns["force"] = [effort(s, t, at(0, eb)) for s, t in zip(states, times)]
columns["ring5.through.f"] = [effort(s, t, at(4, below)) for s, t in zip(states, times)]
write(__file__, times, columns, "matrix exponential at 40 digits, checked by an integrator of order 22")
