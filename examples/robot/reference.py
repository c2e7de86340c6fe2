"""The robot by the recursive Newton-Euler algorithm: accelerations.csv and run.csv.

Nothing is taken from the model but what is asked for: lengths, masses and inertias are those of Armstrong, Khatib and Burdick
in their own frames (modified Denavit-Hartenberg), not those that stand as the ground does.

    python3 reference.py            needs numpy and scipy
"""

import csv
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

HERE = Path(__file__).parent

# Twist and length of the link before, offset along the axis; mass, centre of mass, inertia about it, in the frame of the link.
ALPHA = [0, -np.pi / 2, 0, np.pi / 2, -np.pi / 2, np.pi / 2]
A = [0, 0, 0.4318, -0.0203, 0, 0]
D = [0, 0.2435, -0.0934, 0.4331, 0, 0]
MASS = [0, 17.4, 4.8, 0.82, 0.34, 0.09]
CENTRE = np.array([[0, 0, 0], [0.068, 0.006, -0.016], [0, -0.070, 0.014], [0, 0, -0.019], [0, 0, 0], [0, 0, 0.032]])
INERTIA = [
    [0, 0, 0.35],
    [0.13, 0.524, 0.539],
    [0.066, 0.0125, 0.066],
    [1.8e-3, 1.8e-3, 1.3e-3],
    [0.3e-3, 0.3e-3, 0.4e-3],
    [0.15e-3, 0.15e-3, 0.04e-3],
]
# Motors and controllers.
RATIO = np.array([62.6111, 107.815, 53.7063, 76.0364, 71.923, 76.686])
ROTOR = np.array([200e-6] * 3 + [33e-6] * 3)
BEARING = np.array([1.48e-3, 0.817e-3, 1.38e-3, 71.2e-6, 82.6e-6, 36.7e-6])
DRY = np.array([0.415, 0.0985, 0.1185, 0.01405, 0.01188, 0.00723])
K = np.array([0.22] * 3 + [0.07] * 3)
R = np.array([2.1] * 3 + [6.7] * 3)
L = np.array([5e-3] * 3 + [7e-3] * 3)
KP = np.array([1.2] * 3 + [0.3] * 3)
KI = np.array([12.0] * 3 + [3.0] * 3)
KV, U_MAX, T_T = 20.0, 40.0, 0.1
POSES = np.array([[0, -1.2, 1.0, 0, 0.3, 0], [0.9, -0.5, 0.4, 0.6, -0.5, 1.0], [-0.6, -1.0, 1.3, -0.8, 0.7, -0.5]])
G = np.array([0, 0, -9.81])
Z = np.array([0.0, 0, 1])


def cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def torques(q, qd, qdd, g):
    """Torques at the joints for a motion: outward velocities and accelerations, inward forces (Luh, Walker, Paul 1980)."""
    turns, places, forces, moments = [], [], [], []
    w, wd, vd = np.zeros(3), np.zeros(3), -g
    for i in range(6):
        ca, sa, c, s = np.cos(ALPHA[i]), np.sin(ALPHA[i]), np.cos(q[i]), np.sin(q[i])
        turn = np.array([[c, -s, 0], [s * ca, c * ca, -sa], [s * sa, c * sa, ca]])
        place = np.array([A[i], -sa * D[i], ca * D[i]])
        vd = turn.T @ (vd + cross(wd, place) + cross(w, cross(w, place)))
        before = turn.T @ w
        wd = turn.T @ wd + cross(before, qd[i] * Z) + qdd[i] * Z
        w = before + qd[i] * Z
        at_centre = vd + cross(wd, CENTRE[i]) + cross(w, cross(w, CENTRE[i]))
        inertia = np.array(INERTIA[i])
        turns.append(turn)
        places.append(place)
        forces.append(MASS[i] * at_centre)
        moments.append(inertia * wd + cross(w, inertia * w))
    found = np.zeros(6)
    f, n = np.zeros(3), np.zeros(3)
    for i in reversed(range(6)):
        n = n + moments[i] + cross(CENTRE[i], forces[i])
        f = f + forces[i]
        found[i] = n[2]
        n = turns[i] @ n + cross(places[i], turns[i] @ f)
        f = turns[i] @ f
    return found


def accelerations(q, qd, current):
    still = np.zeros(6)
    mass = np.array([torques(q, still, row, still[:3]) for row in np.eye(6)]).T + np.diag(ROTOR * RATIO**2)
    speed = RATIO * qd
    motor = K * current - BEARING * speed - DRY * np.tanh(speed / 1.0)
    return np.linalg.solve(mass, RATIO * motor - torques(q, qd, still, G))


def asked(t):
    """Angles and speeds that are asked for."""
    q, w = POSES[0].copy(), np.zeros(6)
    for low, high, begin in [(POSES[0], POSES[1], 0.1), (POSES[1], POSES[2], 1.2)]:
        s = min(max((t - begin) / 0.9, 0), 1)
        q += (high - low) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        w += (high - low) * (30 * s**2 - 60 * s**3 + 30 * s**4) / 0.9
    return q, w


def rates(t, state):
    q, qd, current, integral = state.reshape(4, 6)
    angle, speed = asked(t)
    error = RATIO * (speed + KV * (angle - q) - qd)
    given = KP * error + integral
    u = np.clip(given, -U_MAX, U_MAX)
    rate = (u - R * current - K * RATIO * qd) / L
    return np.concatenate([qd, accelerations(q, qd, current), rate, KI * error + (u - given) / T_T])


def run():
    """States at multiples of 0.1 s. Runs end where a move begins or ends."""
    state = np.concatenate([POSES[0], np.zeros(18)])
    rows = [(0.0, state)]
    for begin, end in [(0, 0.1), (0.1, 1.0), (1.0, 1.2), (1.2, 2.1), (2.1, 2.5)]:
        at = np.arange(round(begin * 10) + 1, round(end * 10) + 1) / 10
        done = solve_ivp(rates, (begin, end), state, "DOP853", at, rtol=1e-11, atol=1e-12)
        assert done.success, done.message
        rows += list(zip(at, done.y.T))
        state = done.y[:, -1]
    return rows


def write(name, head, rows):
    with open(HERE / name, "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(head)
        out.writerows([repr(float(v)) for v in row] for row in rows)


def main():
    dice = np.random.default_rng(560)
    numbered = [f"{name}{i}" for name in ("q", "w", "a") for i in range(1, 7)]
    states = [(np.round(dice.uniform(-2, 2, 6), 2), np.round(dice.uniform(-3, 3, 6), 2)) for _ in range(5)]
    write("accelerations.csv", numbered, [[*q, *w, *accelerations(q, w, np.zeros(6))] for q, w in states])
    head = ["t"] + [f"{name}{i}" for name in ("q", "w", "i") for i in range(1, 7)]
    write("run.csv", head, [[t, *state[:18]] for t, state in run()])


main()
