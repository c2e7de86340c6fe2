"""Buck converter from pulse to pulse: in each of its phases the circuit is linear, its solution an exponential of a matrix.

The coil carries on through the diode until its current is zero; then it rests until the next pulse. `reference.json` has the
continuous conduction of 2 ohm from the start, and the discontinuous one of 200 ohm from a charge near its steady state.
"""
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[5] / "models"))
from mpmath import expm, matrix, mpf
from reference_tools import decimal

V, duty, rate, L, C = mpf(24), mpf("0.4"), mpf(100000), mpf("1e-4"), mpf("1e-5")
period = 1 / rate


def moved(x, t, R, source, conducts):
    """Current and voltage after a phase."""
    a = matrix([[0, -1 / L, source / L], [1 / C, -1 / (R * C), 0], [0, 0, 0]] if conducts else
               [[0, 0, 0], [0, -1 / (R * C), 0], [0, 0, 0]])
    y = expm(a * t, method="taylor") * matrix([x[0], x[1], 1])
    return [y[0], y[1]]


def pulse(x, R):
    """A period on; the time at which the coil runs dry, if it does."""
    x = moved(x, duty * period, R, V, True)
    rest = (1 - duty) * period
    end = moved(x, rest, R, 0, True)
    if end[0] > 0:
        return end, None
    t = rest * x[0] / (x[0] - end[0])
    for _ in range(60):
        now = moved(x, t, R, 0, True)
        change = now[0] / (-now[1] / L)
        t -= change
        if abs(change) < mpf(10) ** -40:
            break
    dry = moved(x, t, R, 0, True)
    return moved([mpf(0), dry[1]], rest - t, R, 0, False), duty * period + t


def follow(x, R, pulses):
    rows = []
    for _ in range(pulses):
        x, dry = pulse(x, R)
        rows.append({"coil.f": decimal(x[0]), "smoothing.e": decimal(x[1])} | ({"dry": decimal(dry)} if dry else {}))
    return rows


found = {
    "continuous": follow([mpf(0), mpf(0)], mpf(2), 60),
    "discontinuous": follow([mpf(0), mpf(18)], mpf(200), 60),
    "source": "exponentials of matrices from phase to phase, 40 digits",
}
assert all("dry" in row for row in found["discontinuous"]) and sum("dry" in row for row in found["continuous"]) < 20
Path(__file__).with_name("reference.json").write_text(json.dumps(found, indent=1) + "\n")
