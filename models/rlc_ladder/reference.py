"""Ladder by mesh currents and node voltages: L i_k' = u_(k-1) - R i_k - u_k, C u_k' = i_k - i_(k+1), i_11 = u_10/load.

Matrix exponential of the 20 states; checked by numerical integration.
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from mpmath import mpf
from reference_tools import agree, integrate, linear, write

r, ind, cap, load, volt = mpf(5), mpf("1e-3"), mpf("1e-6"), mpf(50), mpf(10)
times = ["0.0001", "0.0002", "0.0004", "0.0008", "0.0015", "0.003"]
sections = 10


def rates(t, s):
    i, u = [*s[:sections], s[-1] / load], [volt, *s[sections:]]
    coils = [(u[k] - r * i[k] - u[k + 1]) / ind for k in range(sections)]
    return coils + [(i[k] - i[k + 1]) / cap for k in range(sections)]


rest = [mpf(0)] * (2 * sections)
supply = rates(0, rest)
columns = [[a - b for a, b in zip(rates(0, [mpf(j == k) for j in range(20)]), supply)] for k in range(20)]
rows = [[column[k] for column in columns] + [supply[k]] for k in range(20)] + [[0] * 21]
states = [s[:20] for s in linear(rows, rest + [1], times)]
agree(states, integrate(rates, rest, times, mpf("2e-5"), 12))
names = [f"L{k}.f" for k in range(1, 11)] + [f"C{k}.e" for k in range(1, 11)]
table = dict(zip(names, zip(*states)))
table["load.f"] = [u / load for u in table["C10.e"]]
table["L1.e"] = [rates(0, s)[0] * ind for s in states]
table["v_end"] = table["C10.e"]
write(__file__, times, table, "matrix exponential")
