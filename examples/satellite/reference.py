#!/usr/bin/env python3
"""The satellite by other equations. `slew.csv`: Kane's equations along the axes of the hull, where wheels are gyrostats,
integrated by SciPy's DOP853. `tumble.csv`: Jacobi's elliptic functions (mpmath). `dump.csv`: the two exponentials of a linear
system.

    python3 reference.py        writes slew.csv, tumble.csv, dump.csv
"""

import csv
import os

import mpmath
import numpy as np
from scipy.integrate import solve_ivp

HULL_M, HULL_J = 120.0, np.diag([12.0, 15.0, 9.0])
WHEEL_M, ACROSS, J = 2.5, 0.0036, 0.0064
R, L, K, B = 1.0, 0.02, 0.04, 2e-5
PANEL_M, PANEL_J, HINGE_K, HINGE_C = 4.0, np.diag([0.48, 0.12, 0.6]), 20.0, 0.5
AT = np.pi / 4 + np.pi / 2 * np.arange(4)
N = np.array([np.sqrt(2 / 3) * np.cos(AT), np.sqrt(2 / 3) * np.sin(AT), np.full(4, np.sqrt(1 / 3))]).T
SEAT = 0.2 * np.array([np.cos(AT), np.sin(AT), 0 * AT]).T
WHEEL_I = [ACROSS * np.eye(3) + (J - ACROSS) * np.outer(n, n) for n in N]
EX = np.array([1.0, 0, 0])


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def panel(side, angle):
    """Inertia along the axes of the hull, centre of mass, and the way to it from the hinge."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    arm = turn @ np.array([0, 0.6 * side, 0])
    return turn @ PANEL_J @ turn.T, np.array([0, 0.4 * side, 0]) + arm, arm


def inertia():
    """Of all about the centre of mass, with nothing that turns."""
    total = HULL_J.copy()
    for at, own in zip(SEAT, WHEEL_I):
        total += own + WHEEL_M * (at @ at * np.eye(3) - np.outer(at, at))
    for side in (1, -1):
        own, at, _ = panel(side, 0.0)
        total += own + PANEL_M * (at @ at * np.eye(3) - np.outer(at, at))
    return total


def accelerations(u, angles, effort):
    """u: speed of the hull's centre, turning (both along its axes), four wheels, two hinges; effort: of wheels and hinges."""
    v, w, wheels, hinges = u[:3], u[3:6], u[6:10], u[10:]
    M, f = np.zeros((12, 12)), np.zeros(12)
    f[6:] = effort

    def body(m, own, by_v, by_w, rest_v, torque):
        nonlocal M, f
        M += m * by_v.T @ by_v + by_w.T @ own @ by_w
        f -= m * by_v.T @ rest_v + by_w.T @ torque

    def moves(at):
        by = np.zeros((3, 12))
        by[:, :3], by[:, 3:6] = np.eye(3), -skew(at)
        return by

    turns = np.zeros((3, 12))
    turns[:, 3:6] = np.eye(3)
    body(HULL_M, HULL_J, moves(np.zeros(3)), turns, np.cross(w, v), np.cross(w, HULL_J @ w))
    for i in range(4):
        by_w = turns.copy()
        by_w[:, 6 + i] = N[i]
        h = WHEEL_I[i] @ (w + N[i] * wheels[i])
        rest = np.cross(w, v + np.cross(w, SEAT[i]))
        # Seen from the hull the momentum changes by accelerations alone, as the disc is round.
        body(WHEEL_M, WHEEL_I[i], moves(SEAT[i]), by_w, rest, np.cross(w, h))
    for i, side in enumerate((1, -1)):
        own, at, arm = panel(side, angles[i])
        by_v, by_w = moves(at), turns.copy()
        by_v[:, 10 + i], by_w[:, 10 + i] = np.cross(EX, arm), EX
        along = hinges[i] * np.cross(EX, arm)
        rest = np.cross(w, v) + np.cross(w, np.cross(w, at)) + 2 * np.cross(w, along) + hinges[i] ** 2 * np.cross(EX, np.cross(EX, arm))
        whole = w + EX * hinges[i]
        body(PANEL_M, own, by_v, by_w, rest, own @ np.cross(w, EX * hinges[i]) + np.cross(whole, own @ whole))
    return np.linalg.solve(M, f)


TOLD = np.array([0.159, 0.57, 0.57, 0.57])
TOLD = TOLD / np.linalg.norm(TOLD)
J_KNOWN = np.array([21.22, 15.5, 18.66])


def voltages(q, w, wheels):
    part = TOLD @ q
    error = np.sign(part) * (TOLD[0] * q[1:] - q[0] * TOLD[1:] - np.cross(TOLD[1:], q[1:]))
    asked = J_KNOWN * (0.005 * error + 0.1 * w) - np.cross(w, J_KNOWN * w + J * wheels @ N)
    return R * (0.75 * N @ asked + B * wheels) / K + K * wheels


def derivative(t, y):
    q, u, i, angles = y[:4], y[4:16], y[16:20], y[20:]
    w, wheels, hinges = u[3:6], u[6:10], u[10:]
    a = accelerations(u, angles, np.hstack([K * i - B * wheels, -HINGE_K * angles - HINGE_C * hinges]))
    turned = np.hstack([-q[1:] @ w, q[0] * w + np.cross(q[1:], w)]) / 2
    u_now = voltages(q / np.linalg.norm(q), w, wheels)
    return np.hstack([turned, a, (u_now - R * i - K * wheels) / L, hinges])


def write(name, head, rows):
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), name), "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(head)
        out.writerows([[f"{float(v):.12g}" for v in row] for row in rows])


def numbered(name, n):
    return [f"{name}[{i + 1}]" for i in range(n)]


def slew():
    start = np.zeros(22)
    start[0] = 1
    start[4:7] = 0.01, 0.02, -0.01
    marks = 5.0 * np.arange(31)
    done = solve_ivp(derivative, (0, 150), start, "DOP853", marks, rtol=1e-10, atol=1e-12)
    rows = []
    for t, y in zip(marks, done.y.T):
        q = y[:4] / np.linalg.norm(y[:4])
        off = 2 * np.arccos(min(abs(TOLD @ q), 1))
        rows.append([t, *q, *y[7:10], *y[10:14], *voltages(q, y[7:10], y[10:14]), y[20], y[21], off])
    head = ["t"] + numbered("e", 4) + numbered("w", 3) + numbered("speed", 4) + numbered("voltage", 4)
    write("slew.csv", head + ["left", "right", "off"], rows)


def tumble():
    mpmath.mp.dps = 40
    x, y, z = (mpmath.mpf(v) for v in np.diag(inertia()))
    w = [mpmath.mpf(v) for v in ("0.001", "1", "0.002")]  # about y, z, x: of the least, middle, greatest inertia
    I = [y, z, x]
    assert I[0] < I[1] < I[2]
    energy, momentum = sum(i * v**2 for i, v in zip(I, w)), sum((i * v) ** 2 for i, v in zip(I, w))
    swapped = momentum < energy * I[1]
    if swapped:
        I, w = I[::-1], w[::-1]
    rate = mpmath.sqrt((I[2] - I[1]) * (momentum - energy * I[0]) / (I[0] * I[1] * I[2]))
    m = (I[1] - I[0]) * (energy * I[2] - momentum) / ((I[2] - I[1]) * (momentum - energy * I[0]))
    size = [
        mpmath.sqrt((energy * I[2] - momentum) / (I[0] * (I[2] - I[0]))),
        mpmath.sqrt((energy * I[2] - momentum) / (I[1] * (I[2] - I[1]))),
        mpmath.sqrt((momentum - energy * I[0]) / (I[2] * (I[2] - I[0]))),
    ]
    begin = mpmath.ellipf(mpmath.atan2(w[1] / size[1], w[0] / size[0]), m)
    print("tumble: over every", mpmath.nstr(2 * mpmath.ellipk(m) / rate, 10), "s")
    rows = []
    for t in range(0, 101, 2):
        found = [s * mpmath.ellipfun(k)(rate * t + begin, m=m) for s, k in zip(size, ("cn", "sn", "dn"))]
        if swapped:
            found = found[::-1]
        rows.append([t, found[2], found[0], found[1]])
    write("tumble.csv", ["t"] + numbered("w", 3), rows)


def dump():
    # Four wheels alike: h = Iz w + 4 J n w_rel is kept; J (w_rel' + n w') = K i - B w_rel; L i' = -R i - K w_rel.
    Iz, n = inertia()[2, 2], np.sqrt(1 / 3)
    h = 4 * J * n * 300
    heavy = J * (1 - 4 * J * n * n / Iz)
    values, vectors = np.linalg.eig(np.array([[-B / heavy, K / heavy], [-K / L, -R / L]]))
    parts = np.linalg.solve(vectors, [300.0, 0.0])
    rows = []
    for t in range(21):
        speed, current = vectors @ (parts * np.exp(values * t))
        rows.append([t, (h - 4 * J * n * speed) / Iz, speed, current])
    print("dump: rates", values, "1/s; the end", h / Iz, "rad/s")
    write("dump.csv", ["t", "w[3]", "speed", "i"], rows)


if __name__ == "__main__":
    print("inertia", np.diag(inertia()))
    tumble()
    dump()
    slew()
