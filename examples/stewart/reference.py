#!/usr/bin/env python3
"""The Stewart-Gough platform by other equations: thirteen bodies with all their coordinates, Lagrange multipliers for the 72
equations of the joints (Baumgarte's terms keep them), integrated by SciPy's DOP853. What the legs carry at rest is found by
virtual work: the derivative of the energy of all weights by the pose, shared out by the transposed Jacobian of the lengths.

    python3 reference.py        writes springs.csv, motion.csv, held.csv
"""

import csv
import os

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

G = 9.81
DEG = np.pi / 180
BASE = np.array([[np.cos(a * DEG), np.sin(a * DEG), 0] for a in (-12, 12, 108, 132, 228, 252)])
SEAT = 0.7 * np.array([[np.cos(a * DEG), np.sin(a * DEG), 0] for a in (-48, 48, 72, 168, 192, 288)])
MIDDLE = np.array([0.05, 0, 0.1])  # centre of mass of the platform, from the middle of its joints
LOW, HIGH = 0.3, 0.3  # centres of mass of the parts of a leg, from its ends
MASS = np.array([120.0] + 6 * [6.0] + 6 * [3.0])
INERTIA = np.array([[14, 18, 27]] + 6 * [[0.18, 0.18, 0.006]] + 6 * [[0.09, 0.09, 0.001]], dtype=float)
ALPHA = 20.0  # of Baumgarte, 1/s


def cardan(a, b, c):
    """Turns about x, the new y, the new z."""
    sa, ca, sb, cb, sc, cc = np.sin(a), np.cos(a), np.sin(b), np.cos(b), np.sin(c), np.cos(c)
    rx = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    ry = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    rz = np.array([[cc, -sc, 0], [sc, cc, 0], [0, 0, 1]])
    return rx @ ry @ rz


def ways(pose):
    """From the joints at the base to those at the platform."""
    return np.asarray(pose[:3]) + SEAT @ cardan(*pose[3:]).T - BASE


def lengths(pose):
    return np.sqrt((ways(pose) ** 2).sum(axis=1))


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def matrices(q):
    """Rotation matrices of quaternions, one in each row."""
    w, x, y, z = (q / np.linalg.norm(q, axis=1)[:, None]).T
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]).transpose(2, 0, 1)


def quaternion(R):
    w = np.sqrt(max(0.0, 1 + np.trace(R))) / 2
    return np.array([w, (R[2, 1] - R[1, 2]) / (4 * w), (R[0, 2] - R[2, 0]) / (4 * w), (R[1, 0] - R[0, 1]) / (4 * w)])


class Joints:
    """Equations of the joints: their values, their Jacobian by (v, w) and what is quadratic in these."""

    def __init__(self, r, R, v, w):
        self.r, self.R, self.v, self.w = r, R, v, w
        self.value, self.rows, self.bias = [], [], []

    def add(self, value, parts, bias):
        row = np.zeros(78)
        for body, linear, angular in parts:
            row[6 * body : 6 * body + 3] += linear
            row[6 * body + 3 : 6 * body + 6] += angular
        self.value.append(value)
        self.rows.append(row)
        self.bias.append(bias)

    def point(self, i, s):
        """A point of body i: place, Jacobian by w, acceleration at w' = 0."""
        R, w = self.R[i], self.w[i]
        return self.r[i] + R @ s, -R @ skew(s), R @ np.cross(w, np.cross(w, s))

    def meet(self, i, s, other, to):
        """A point of body i meets one of body `other`, or (None) of the ground."""
        at, by, bias = self.point(i, s)
        if other is None:
            there, by_there, bias_there = to, None, 0
        else:
            there, by_there, bias_there = self.point(other, to)
        gap, bias = at - there, bias - bias_there
        for k in range(3):
            e = np.eye(3)[k]
            parts = [(i, e, by[k])]
            if other is not None:
                parts.append((other, -e, -by_there[k]))
            self.add(gap[k], parts, bias[k])

    def axis(self, i, a):
        """An axis of body i, or (None) of the ground: direction, its rate by w, its second derivative at w' = 0."""
        if i is None:
            return a, np.zeros((3, 3)), np.zeros(3), np.zeros(3)
        R, w = self.R[i], self.w[i]
        return R @ a, -R @ skew(a), R @ np.cross(w, a), R @ np.cross(w, np.cross(w, a))

    def across(self, i, a, j, b):
        """Two axes stand across each other."""
        u, by_u, u1, u2 = self.axis(i, a)
        x, by_x, x1, x2 = self.axis(j, b)
        parts = [(j, np.zeros(3), u @ by_x)]
        if i is not None:
            parts.append((i, np.zeros(3), x @ by_u))
        self.add(u @ x, parts, 2 * u1 @ x1 + u2 @ x + u @ x2)

    def beside(self, i, a, j, s_i, s_j):
        """The way between points of two bodies stands across an axis of the first."""
        u, by_u, u1, u2 = self.axis(i, a)
        p, by_p, p2 = self.point(i, s_i)
        q, by_q, q2 = self.point(j, s_j)
        p1 = self.v[i] + by_p @ self.w[i]
        q1 = self.v[j] + by_q @ self.w[j]
        d = q - p
        self.add(u @ d, [(i, -u, d @ by_u - u @ by_p), (j, u, u @ by_q)], u2 @ d + 2 * u1 @ (q1 - p1) + u @ (q2 - p2))


EX, EY, EZ = np.eye(3)


def joints(r, R, v, w):
    j = Joints(r, R, v, w)
    for leg in range(6):
        low, high = 1 + leg, 7 + leg
        j.meet(low, np.array([0, 0, -LOW]), None, BASE[leg])
        j.across(None, EX, low, EY)
        j.across(low, EX, high, EY)
        j.across(low, EX, high, EZ)
        j.across(low, EY, high, EZ)
        j.beside(low, EX, high, np.zeros(3), np.zeros(3))
        j.beside(low, EY, high, np.zeros(3), np.zeros(3))
        j.meet(high, np.array([0, 0, HIGH]), 0, SEAT[leg] - MIDDLE)
    return np.array(j.value), np.array(j.rows), np.array(j.bias)


def split(y):
    y = y.reshape(13, 13)
    return y[:, :3], y[:, 3:7], y[:, 7:10], y[:, 10:]


def drives(r, R, v, w):
    """Directions of the legs, lengths, their rates."""
    tops = r[0] + (SEAT - MIDDLE) @ R[0].T
    d = tops - BASE
    length = np.linalg.norm(d, axis=1)
    e = d / length[:, None]
    speed = ((v[0] + np.cross(R[0] @ w[0], tops - r[0])) * e).sum(axis=1)
    return e, length, speed


def derivative(t, y, push):
    r, q, v, w = split(y)
    R = matrices(q)
    value, rows, bias = joints(r, R, v, w)
    force = np.zeros((13, 6))
    force[:, 2] = -MASS * G
    force[:, 3:] = -np.cross(w, INERTIA * w)
    e, length, speed = drives(r, R, v, w)
    f = push(t, length, speed)[:, None]
    force[1:7, :3] -= f * e
    force[7:, :3] += f * e
    inverse = 1 / np.hstack([np.repeat(MASS[:, None], 3, axis=1), INERTIA]).ravel()
    u = np.hstack([v, w]).ravel()
    wanted = -bias - 2 * ALPHA * (rows @ u) - ALPHA**2 * value
    free = inverse * force.ravel()
    multipliers = np.linalg.solve((rows * inverse) @ rows.T, wanted - rows @ free)
    a = (free + inverse * (rows.T @ multipliers)).reshape(13, 6)
    q0, qv = q[:, :1], q[:, 1:]
    turned = np.hstack([-(qv * w).sum(axis=1)[:, None], q0 * w + np.cross(qv, w)]) / 2
    return np.hstack([v, turned, a]).ravel()


def assembled(pose, speed):
    """All bodies where a pose of the platform puts them, with the speeds that follow from its."""
    d = ways(pose)
    length = np.linalg.norm(d, axis=1)
    r, R = np.zeros((13, 3)), np.zeros((13, 3, 3))
    R[0] = cardan(*pose[3:])
    r[0] = np.asarray(pose[:3]) + R[0] @ MIDDLE
    for leg in range(6):
        z = d[leg] / length[leg]
        # y stands across z and across the x of the ground.
        y = np.cross(z, EX)
        y /= np.linalg.norm(y)
        R[1 + leg] = R[7 + leg] = np.array([np.cross(y, z), y, z]).T
        r[1 + leg] = BASE[leg] + LOW * z
        r[7 + leg] = BASE[leg] + (length[leg] - HIGH) * z
    v, w = np.zeros((13, 3)), np.zeros((13, 3))
    a, b, c = pose[3:]
    # Rates of the turns to the angular velocity along the axes of the platform.
    sb, cb, sc, cc = np.sin(b), np.cos(b), np.sin(c), np.cos(c)
    w[0] = np.array([[cb * cc, sc, 0], [-cb * sc, cc, 0], [sb, 0, 1]]) @ speed[3:]
    v[0] = speed[:3] + R[0] @ np.cross(w[0], MIDDLE)
    _, rows, _ = joints(r, R, v, w)
    others = np.linalg.solve(rows[:, 6:], -rows[:, :6] @ np.hstack([v[0], w[0]])).reshape(12, 6)
    v[1:], w[1:] = others[:, :3], others[:, 3:]
    return np.hstack([r, np.array([quaternion(m) for m in R]), v, w]).ravel()


def pose_of(y):
    r, q, v, w = split(y)
    R = matrices(q)
    at = r[0] - R[0] @ MIDDLE
    m = R[0]
    turned = [np.arctan2(-m[1, 2], m[2, 2]), np.arcsin(m[0, 2]), np.arctan2(-m[0, 1], m[0, 0])]
    return list(at) + turned, drives(r, R, v, w)


def energy(y, stiffness, free):
    r, q, v, w = split(y)
    _, length, _ = drives(r, matrices(q), v, w)
    moving = (MASS * (v**2).sum(axis=1)).sum() / 2 + (INERTIA * w**2).sum() / 2
    return moving + (MASS * G * r[:, 2]).sum() + stiffness * ((length - free) ** 2).sum() / 2


def run(start, push, marks, spans):
    """States at marks; spans end where what pushes is not smooth."""
    y, found = start, []
    for a, b in zip(spans, spans[1:]):
        at = [t for t in marks if a <= t < b]
        done = solve_ivp(derivative, (a, b), y, "DOP853", at + [b], args=(push,), rtol=1e-10, atol=1e-12)
        assert done.success
        found += list(done.y.T[: len(at)])
        y = done.y[:, -1]
    found.append(y)
    for state in found:
        r, q, v, w = split(state)
        value, rows, _ = joints(r, matrices(q), v, w)
        assert abs(value).max() < 1e-9 and abs(rows @ np.hstack([v, w]).ravel()).max() < 1e-8
    return found


def write(name, head, rows):
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), name), "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(head)
        out.writerows([[f"{v:.12g}" for v in row] for row in rows])


POSE = ["x", "y", "z", "roll", "pitch", "yaw"]
LEGS = [str(i) for i in range(1, 7)]


def springs():
    stiffness, free = 1e4, 1.2
    start = assembled([0.05, -0.03, 1.02, 0.1, -0.08, 0.15], np.array([0.1, 0.2, 0, 0, 0.3, -0.5]))
    marks = [i / 10 for i in range(21)]
    found = run(start, lambda t, l, s: -stiffness * (l - free), marks, [0, 2])
    kept = [energy(y, stiffness, free) for y in found]
    print("springs: energy", kept[0], "kept to", max(kept) - min(kept))
    rows = []
    for t, y in zip(marks, found):
        pose, (_, length, _) = pose_of(y)
        rows.append([t] + pose + list(length))
    write("springs.csv", ["t"] + POSE + [f"length[{i}]" for i in LEGS], rows)


def asked(t):
    """Lengths that the path asks for; t may be complex."""
    s = t / 2 if np.real(t) < 2 else 1
    full = s**3 * (10 - 15 * s + 6 * s**2)
    p = np.pi * t
    pose = [0.12 * full * np.sin(p), 0.1 * full * (1 - np.cos(p)), 1 + 0.06 * full * np.sin(2 * p)]
    return lengths(pose + [0.12 * full * np.sin(p), 0.1 * full * np.sin(2 * p), 0.2 * full * np.sin(p)])


def motion():
    def push(t, length, speed):
        wanted = asked(t + 1e-30j)
        return 250 + 1e5 * (wanted.real - length) + 1.5e3 * (wanted.imag / 1e-30 - speed)

    marks = [i / 10 for i in range(41)]
    found = run(assembled([0, 0, 1, 0, 0, 0], np.zeros(6)), push, marks, [0, 2, 4])
    rows = []
    for t, y in zip(marks, found):
        pose, (_, length, speed) = pose_of(y)
        rows.append([t] + pose + list(push(t, length, speed)))
    write("motion.csv", ["t"] + POSE + [f"force[{i}]" for i in LEGS], rows)


def weights(pose):
    """Energy of all weights; the pose may be complex."""
    pose = np.asarray(pose)
    d = ways(pose)
    height = d[:, 2] / lengths(pose)
    legs = 6 * LOW * height + 3 * (d[:, 2] - HIGH * height)
    return G * (120 * (pose[2] + (cardan(*pose[3:]) @ MIDDLE)[2]) + legs.sum())


def slopes(f, pose):
    return np.array([f(np.asarray(pose) + 1e-30j * e).imag / 1e-30 for e in np.eye(6)])


def held():
    given = np.array([1.12, 1.18, 1.25, 1.22, 1.15, 1.2])
    pose = fsolve(lambda p: lengths(p) - given, [0, 0, 1, 0, 0, 0], xtol=1e-14)
    for _ in range(3):
        pose = pose - np.linalg.solve(slopes(lengths, pose).T, lengths(pose) - given)
    force = np.linalg.solve(slopes(lengths, pose), slopes(weights, pose))
    write("held.csv", POSE + [f"force[{i}]" for i in LEGS], [list(pose) + list(force)])


if __name__ == "__main__":
    held()
    springs()
    motion()
