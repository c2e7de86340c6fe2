"""Plate of rows by columns cells in closed form: waves cos(pi k (i - 1/2)/rows) cos(pi l (j - 1/2)/columns).

Each is insulated at all edges and fades with (4 sin^2(pi k/(2 rows)) + 4 sin^2(pi l/(2 columns)))/(res cap). The heater
feeds each with its value at the corner. Checked by integrating the cells.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import cos, exp, mp, mpf, sin
from reference_tools import agree, integrate, write

rows, columns, res, cap, power = 3, 4, mpf("0.5"), mpf(20), mpf(60)
times = ["1", "3", "10", "20", "40", "80"]
cells = [(i, j) for i in range(rows) for j in range(columns)]


def wave(k, count, i):
    return cos(mp.pi * k * (2 * i + 1) / (2 * count))


def fading(k, count):
    return 4 * sin(mp.pi * k / (2 * count)) ** 2 / (res * cap)


def temperatures(t):
    found = {cell: mpf(0) for cell in cells}
    for k in range(rows):
        for l in range(columns):
            square = (rows if k == 0 else mpf(rows) / 2) * (columns if l == 0 else mpf(columns) / 2)
            rate = fading(k, rows) + fading(l, columns)
            grown = t if k == l == 0 else (1 - exp(-rate * t)) / rate
            fed = power / cap * wave(k, rows, 0) * wave(l, columns, 0) / square * grown
            for i, j in cells:
                found[i, j] += fed * wave(k, rows, i) * wave(l, columns, j)
    return [found[cell] for cell in cells]


def rates(t, x):
    at = dict(zip(cells, x))
    near = lambda i, j: [at[c] for c in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)) if c in at]
    flow = lambda i, j: sum(other - at[i, j] for other in near(i, j)) / res
    return [(flow(i, j) + (power if (i, j) == (0, 0) else 0)) / cap for i, j in cells]


states = [temperatures(mpf(t)) for t in times]
agree(states, integrate(rates, [mpf(0)] * len(cells), times, mpf(1), 12))
values = {f"heat[{i + 1},{j + 1}].e": [s[n] for s in states] for n, (i, j) in enumerate(cells)}
values["mean"] = [sum(s) / len(cells) for s in states]
values["far"] = [s[-1] for s in states]
write(__file__, times, values, "waves of the plate")
