"""Random multibody machines: trees with loops against Newton-Euler in maximal coordinates.

A machine is drawn, written as model text of `std.multibody` (and `std.planar`), and computed here a second time: six coordinates
for each body, in the world, the equations of Newton and Euler, and a multiplier for each equation of each joint and loop, whose
rows are written out by hand. Nothing here knows of bond graphs, of relative coordinates as states, or of the program's algebra.
Redundant equations are allowed: what they leave open among the reactions is told by the null space of the transposed Jacobian.

    python3 random_trees.py campaign --binary halfarrow --from 0 --count 1000     # OK, refused, FAULT for each machine
    python3 random_trees.py one 17 --keep out/                                    # one machine, its texts and all differences
    python3 random_trees.py references random_trees.json                          # what the test of the gate compares with
    python3 random_trees.py growth --binary halfarrow                             # chains and trees of 1 to 200 bodies

Needs numpy and scipy.
"""

import argparse
import csv
import io
import json
import os
import resource
import subprocess
import sys
import time
from fractions import Fraction

import numpy as np
from scipy.integrate import DOP853
from scipy.linalg import qr

GROUND = -1
SINGULAR = 1e-3  # below this share of the greatest singular value a machine counts as near a singular position
ZERO = 1e-10  # below this share a singular value is zero: a redundant equation
TO = 0.3  # s, length of the runs
LONGEST = 10  # s of processor, for a command


# Vectors and rotations.

def cross(a, b):
    return np.array([a[1]*b[2] - a[2]*b[1], a[2]*b[0] - a[0]*b[2], a[0]*b[1] - a[1]*b[0]])


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def rotation(n, angle):
    N = skew(n)
    return np.eye(3) + np.sin(angle)*N + (1 - np.cos(angle))*(N @ N)


def of_quaternion(e):
    e = e/np.sqrt(e @ e)
    return np.array([
        [1 - 2*(e[2]**2 + e[3]**2), 2*(e[1]*e[2] - e[0]*e[3]), 2*(e[1]*e[3] + e[0]*e[2])],
        [2*(e[1]*e[2] + e[0]*e[3]), 1 - 2*(e[1]**2 + e[3]**2), 2*(e[2]*e[3] - e[0]*e[1])],
        [2*(e[1]*e[3] - e[0]*e[2]), 2*(e[2]*e[3] + e[0]*e[1]), 1 - 2*(e[1]**2 + e[2]**2)]])


def to_quaternion(R):
    """Of the four formulas the one with the greatest divisor."""
    squares = [1 + R[0, 0] + R[1, 1] + R[2, 2], 1 + R[0, 0] - R[1, 1] - R[2, 2], 1 - R[0, 0] + R[1, 1] - R[2, 2], 1 - R[0, 0] - R[1, 1] + R[2, 2]]
    k = int(np.argmax(squares))
    s = 2*np.sqrt(squares[k])
    if k == 0:
        e = [s/4, (R[2, 1] - R[1, 2])/s, (R[0, 2] - R[2, 0])/s, (R[1, 0] - R[0, 1])/s]
    elif k == 1:
        e = [(R[2, 1] - R[1, 2])/s, s/4, (R[0, 1] + R[1, 0])/s, (R[0, 2] + R[2, 0])/s]
    elif k == 2:
        e = [(R[0, 2] - R[2, 0])/s, (R[0, 1] + R[1, 0])/s, s/4, (R[1, 2] + R[2, 1])/s]
    else:
        e = [(R[1, 0] - R[0, 1])/s, (R[0, 2] + R[2, 0])/s, (R[1, 2] + R[2, 1])/s, s/4]
    return np.array(e)


def axis_angle(R):
    e = to_quaternion(R)
    if e[0] < 0:
        e = -e
    sine = np.sqrt(e[1:] @ e[1:])
    if sine < 1e-12:
        return np.array([1.0, 0, 0]), 0.0
    return e[1:]/sine, 2*np.arctan2(sine, e[0])


def cardan(R):
    """Angles q with R = Rx(q1) Ry(q2) Rz(q3)."""
    return np.array([np.arctan2(-R[1, 2], R[2, 2]), np.arctan2(R[0, 2], np.hypot(R[1, 2], R[2, 2])), np.arctan2(-R[0, 1], R[0, 0])])


def across(n):
    """Two directions across n and across each other, as the cut joints of the library say."""
    other = np.array([1.0, 0, 0]) if abs(n[0]) < 0.7 else np.array([0, 1.0, 0])
    n1 = cross(n, other)
    n1 = n1/np.sqrt(n1 @ n1)
    return n1, cross(n, n1)


X, Y, Z = np.eye(3)


class Axis:
    """A direction of length 1, as text and as numbers."""

    def __init__(self, text, value):
        self.text, self.value = text, np.array(value, float)


def whole_axis(v):
    return Axis("[" + ", ".join(str(int(x)) for x in v) + "]", v)


def exact_axis(rng):
    """By fractions: (2a, 2b, 1 - a^2 - b^2)/(1 + a^2 + b^2), turned over."""
    if rng.random() < 0.4:
        v = np.zeros(3)
        v[rng.integers(3)] = 1
        return whole_axis(v)
    a, b = (Fraction(int(rng.integers(-4, 5)), int(rng.integers(1, 5))) for _ in range(2))
    s = 1 + a*a + b*b
    parts = [2*a/s, 2*b/s, (1 - a*a - b*b)/s]
    parts = [parts[i] for i in rng.permutation(3)]
    return Axis("[" + ", ".join(str(p) for p in parts) + "]", [float(p) for p in parts])


def decimal_axis(v):
    v = np.array(v, float)
    v = v/np.sqrt(v @ v)
    return Axis(vector(v), v)


decimals = False  # whether axes of the machine being drawn may have decimals, so that their length is 1 to rounding alone


def random_axis(rng):
    return decimal_axis(rng.normal(size=3)) if decimals and rng.random() < 0.5 else exact_axis(rng)


def number(x):
    return repr(float(x))


def vector(v):
    return "[" + ", ".join(number(x) for x in v) + "]"


def matrix(M):
    return "[" + ", ".join(vector(row) for row in M) + "]"


class Mark:
    """A place on a link (or on the ground): p and Q from the frame of the link, and the text that leads there.

    `steps` are the instances between, as (kind, arguments).
    """

    def __init__(self, link, p=(0, 0, 0), turns=(), then=None):
        self.link, self.first, self.turns, self.then = link, np.array(p, float), list(turns), then
        self.Q = np.eye(3)
        for n, angle in self.turns:
            self.Q = self.Q @ rotation(n.value, angle)
        self.p = self.first if then is None else self.first + self.Q @ then

    def steps(self, planar=False):
        found = []
        if np.any(self.first != 0):
            found.append(("PlanarTranslation", f"d = {vector(self.first[:2])}") if planar else ("FixedTranslation", f"d = {vector(self.first)}"))
        for n, angle in self.turns:
            found.append(("FixedRotation", f"n = {n.text}, angle = {number(angle)}"))
        if self.then is not None:
            found.append(("FixedTranslation", f"d = {vector(self.then)}"))
        return found


class Joint:
    """Between mark `a` (towards the ground) and the link `b`, whose frame stands `tail` behind the joint.

    `ways` are the single motions it is made of at the start: ("R", axis), ("P", axis), ("S",), with values q and rates u.
    """

    def __init__(self, kind, name, a, b, ways, q, u, tail=None):
        self.kind, self.name, self.a, self.b, self.ways, self.q, self.u = kind, name, a, b, ways, q, u
        self.tail = tail  # Mark without a link: p and turn from the joint to the frame of the link
        self.axes = []  # of (way, stiffness, q0, damping, effort)
        self.torque = None  # of a ball joint, along the axes of b

    def size(self):
        return sum(3 if w[0] == "S" else 1 for w in self.ways)


class Link:
    def __init__(self, m, J, c, weld=None):
        self.m, self.J, self.c = m, np.array(J, float), np.array(c, float)
        self.weld = weld  # of a second body on the same link: the mark that carries it


class Machine:
    def __init__(self, seed):
        self.seed, self.kind = seed, ""
        self.g = np.zeros(3)
        self.links, self.joints, self.loops, self.forces = [], [], [], []
        self.planar = False
        self.redundant = False


class Loop:
    def __init__(self, kind, name, a, b, **data):
        self.kind, self.name, self.a, self.b, self.data = kind, name, a, b, data


class Force:
    def __init__(self, kind, name, a, b=None, **data):
        self.kind, self.name, self.a, self.b, self.data = kind, name, a, b, data


# The machines.

def random_inertia(rng, m):
    """Of some mass points, so that the triangle inequality holds, and turned at random."""
    size = rng.uniform(0.1, 0.5, 3)
    box = m/3*np.array([size[1]**2 + size[2]**2, size[0]**2 + size[2]**2, size[0]**2 + size[1]**2])
    if rng.random() < 0.4:
        return np.diag(box)
    T = rotation(decimal_axis(rng.normal(size=3)).value, rng.uniform(-3, 3))
    J = T @ np.diag(box) @ T.T
    return (J + J.T)/2


def random_link(rng):
    m = float(np.exp(rng.uniform(np.log(0.2), np.log(8))))
    c = np.zeros(3) if rng.random() < 0.4 else rng.uniform(-0.3, 0.3, 3)
    return Link(m, random_inertia(rng, m), c)


def random_mark(rng, link, turned=0.4, moved=0.8):
    p = rng.uniform(-0.6, 0.6, 3)*(rng.random() < moved)
    turns = [(random_axis(rng), rng.uniform(-1.5, 1.5))] if rng.random() < turned else []
    return Mark(link, p, turns)


JOINTS = ["Revolute"]*6 + ["Prismatic"]*3 + ["Universal", "Cylindrical", "Spherical", "SphericalCardan", "Planar"]*2 + ["Free"]


def make_joint(rng, kind, name, a, b, axis=None, tail=None):
    axis = axis or random_axis(rng)
    angle, way, rate = (lambda: rng.uniform(-1.4, 1.4)), (lambda: rng.uniform(-0.5, 0.5)), (lambda: rng.uniform(-2, 2))
    if kind == "Revolute":
        ways, q = [("R", axis)], [angle()]
    elif kind == "Prismatic":
        ways, q = [("P", axis)], [way()]
    elif kind == "Cylindrical":
        ways, q = [("R", axis), ("P", axis)], [angle(), way()]
    elif kind == "Universal":
        while True:
            second = random_axis(rng)
            if abs(axis.value @ second.value) < 0.5:
                break
        if rng.random() < 0.4:
            axis, second = whole_axis(X), whole_axis(Y)
        ways, q = [("R", axis), ("R", second)], [angle(), angle()]
    elif kind == "Planar":
        ways, q = [("P", whole_axis(X)), ("P", whole_axis(Y)), ("R", whole_axis(Z))], [way(), way(), angle()]
    elif kind == "SphericalCardan":
        ways, q = [("R", whole_axis(X)), ("R", whole_axis(Y)), ("R", whole_axis(Z))], [angle(), rng.uniform(-0.9, 0.9), angle()]
    elif kind == "Spherical":
        ways, q = [("S",)], [to_quaternion(rotation(X, angle()) @ rotation(Y, rng.uniform(-0.9, 0.9)) @ rotation(Z, angle()))]
    else:
        ways = [("P", whole_axis(X)), ("P", whole_axis(Y)), ("P", whole_axis(Z)), ("S",)]
        q = [way(), way(), way(), to_quaternion(rotation(X, angle()) @ rotation(Y, rng.uniform(-0.9, 0.9)) @ rotation(Z, angle()))]
    u = np.array([rate() for _ in range(sum(3 if w[0] == "S" else 1 for w in ways))])
    return Joint(kind, name, a, b, ways, q, u, tail)


def add_axes(rng, joint, often=0.35):
    """Springs, dampers and drives at the axes of a joint."""
    if joint.kind == "Spherical" and rng.random() < often:
        joint.torque = rng.uniform(-2, 2, 3)
    if joint.kind in ("Spherical", "Free"):
        return
    for k in range(len(joint.ways)):
        if rng.random() < often:
            spring = rng.uniform(1, 30) if rng.random() < 0.6 else 0.0
            joint.axes.append((k, spring, rng.uniform(-0.5, 0.5), rng.uniform(0.1, 2) if rng.random() < 0.6 else 0.0, rng.uniform(-3, 3) if rng.random() < 0.6 else 0.0))


def grow(rng, machine, bodies, kinds=JOINTS):
    for _ in range(bodies):
        k = len(machine.links)
        parent = GROUND if k == 0 or rng.random() < 0.15 else int(rng.integers(max(0, k - 3), k))
        kind = str(rng.choice(kinds))
        if kind == "Free" and parent != GROUND and rng.random() < 0.7:
            kind = "Revolute"
        tail = random_mark(rng, None, turned=0.25) if rng.random() < 0.6 else None
        joint = make_joint(rng, kind, f"j{k}", random_mark(rng, parent), k, tail=tail)
        add_axes(rng, joint)
        machine.links.append(random_link(rng))
        machine.joints.append(joint)


def weld_some(rng, machine):
    """A second body on a link, which is computed here as a body of its own that six equations hold."""
    for k in range(len(machine.links)):
        if machine.links[k].weld is None and rng.random() < 0.12:
            link = random_link(rng)
            link.weld = random_mark(rng, k, turned=0.7, moved=1)
            machine.links.append(link)


def add_forces(rng, machine, often=1.0):
    tree = [k for k, link in enumerate(machine.links) if link.weld is None]

    def two():
        while True:
            a, b = (int(x) for x in rng.choice([GROUND] + tree, 2, replace=False))
            return random_mark(rng, a, 0.3), random_mark(rng, b, 0.3)

    for _ in range(rng.poisson(often)):
        name = f"s{len(machine.forces)}"
        kind = str(rng.choice(["SpringDamper", "SpringDamper", "SpringDamper", "Line", "LineAlong", "Force", "Torque", "Bushing"]))
        if kind == "SpringDamper":
            a, b = two()
            force = Force(kind, name, a, b, k=rng.uniform(10, 200), l0=rng.uniform(0.1, 0.8), c=rng.uniform(0.5, 10) if rng.random() < 0.6 else 0.0)
        elif kind in ("Line", "LineAlong"):
            a, b = two()
            force = Force(kind, name, a, b, k=rng.uniform(10, 200), q0=rng.uniform(-0.2, 0.2), c=rng.uniform(0.5, 10), n=random_axis(rng))
        elif kind == "Bushing":
            a, b = two()
            S = rng.normal(size=(6, 6))
            K = S @ S.T*rng.uniform(1, 10)
            D = np.diag(rng.uniform(0, 2, 6))
            force = Force(kind, name, a, b, K=(K + K.T)/2, C=D)
        else:
            a = random_mark(rng, int(rng.choice(tree)), 0.3)
            force = Force(kind, name, a, world=int(rng.random() < 0.5), value=rng.uniform(-5, 5, 3))
        machine.forces.append(force)


def gravity(rng):
    g = rng.normal(size=3)
    return 9.81*g/np.sqrt(g @ g) if rng.random() < 0.9 else np.zeros(3)


def behind(frames, link, r, R=None):
    """The mark on a link that stands at r and like R now."""
    o, A = frames(link)
    return Mark(link, A.T @ (r - o), turned_like(A.T @ R) if R is not None else [])


def turned_like(R):
    """Turns that make up R."""
    if decimals:
        n, angle = axis_angle(R)
        return [(decimal_axis(n), angle)]
    return [(whole_axis(n), angle) for n, angle in zip((X, Y, Z), cardan(R))]


CUTS = ["CutSpherical"]*3 + ["Rod"]*3 + ["CutRevolute", "CutUniversal", "CutPrismatic", "CutInline", "CutInplane", "CutOrientation"]


def add_loop(rng, machine, tries=12):
    """Closes a loop between two links where they stand; kept if the machine can move and is not near a singular position."""
    tree = [k for k, link in enumerate(machine.links) if link.weld is None]
    for _ in range(tries):
        kind = str(rng.choice(CUTS))
        a, b = (int(x) for x in rng.choice([GROUND] + tree, 2, replace=False))
        poses = assemble(machine)[0]
        frames = lambda k: (np.zeros(3), np.eye(3)) if k == GROUND else poses[k]
        name = f"c{len(machine.loops)}"
        mark = random_mark(rng, a, 0.4)
        o, A = frames(a)
        r, R = o + A @ mark.p, A @ mark.Q
        n = random_axis(rng)
        if kind == "Rod":
            other = random_mark(rng, b, 0.2)
            ob, Ab = frames(b)
            d = ob + Ab @ other.p - r
            length = np.sqrt(d @ d)
            if length < 0.1:
                continue
            loop = Loop(kind, name, mark, other, l=length)
        elif kind == "CutSpherical":
            loop = Loop(kind, name, mark, behind(frames, b, r))
        elif kind == "CutRevolute":
            loop = Loop(kind, name, mark, behind(frames, b, r, R @ rotation(n.value, rng.uniform(-1, 1))), n=n)
        elif kind == "CutUniversal":
            n1, n2 = whole_axis(X), whole_axis(Y)
            loop = Loop(kind, name, mark, behind(frames, b, r, R @ rotation(X, rng.uniform(-1, 1)) @ rotation(Y, rng.uniform(-1, 1))), n1=n1, n2=n2)
        elif kind == "CutPrismatic":
            loop = Loop(kind, name, mark, behind(frames, b, r + R @ n.value*rng.uniform(-0.5, 0.5), R), n=n)
        elif kind == "CutInline":
            loop = Loop(kind, name, mark, behind(frames, b, r + R @ n.value*rng.uniform(-0.5, 0.5)), n=n)
        elif kind == "CutInplane":
            n1, n2 = across(n.value)
            loop = Loop(kind, name, mark, behind(frames, b, r + R @ (n1*rng.uniform(-0.5, 0.5) + n2*rng.uniform(-0.5, 0.5))), n=n)
        else:
            loop = Loop(kind, name, mark, behind(frames, b, o, R))
        machine.loops.append(loop)
        values, rank, moves = mobility(machine)
        full = rank == sum(ROWS[l.kind] for l in machine.loops)
        if moves >= 1 and full and values[rank - 1] > 10*SINGULAR*values[0]:
            return True
        machine.loops.pop()
    return False


ROWS = {"CutSpherical": 3, "CutRevolute": 5, "CutUniversal": 4, "CutPrismatic": 5, "CutInline": 2, "CutInplane": 1, "CutOrientation": 3, "Rod": 1}


def add_parallel(rng, machine, cranks, rod=False):
    """A loop all of whose axes are parallel, on a link or the ground: in space three of its equations are redundant."""
    k = len(machine.links)
    base = GROUND if k == 0 or rng.random() < 0.3 else int(rng.integers(k))
    axis = random_axis(rng)
    n = axis.value
    start = random_mark(rng, base, 0.4)
    # Ways along a coordinate are whole parts of 1/1024 m, so that they add up exactly: where they do not, the loop does not close.
    even = lambda p: np.where(abs(n) == 1, np.round(p*1024)/1024, p)
    at, parent = start, base
    slides = rng.random() < 0.3
    for i in range(cranks):
        kind = "Prismatic" if slides and i == 1 else "Revolute"
        n1, n2 = across(n)
        along = axis
        if kind == "Prismatic":
            # Across the axis: exact where the axis is one of the coordinates.
            if not any(np.array_equal(abs(n), e) for e in (X, Y, Z)):
                axis = whole_axis(Z)
                kind = "Revolute"
            else:
                along = whole_axis(n1 if rng.random() < 0.5 else n2)
        joint = make_joint(rng, kind, f"j{len(machine.links)}", at, len(machine.links), along)
        add_axes(rng, joint)
        parent = len(machine.links)
        machine.links.append(random_link(rng))
        machine.joints.append(joint)
        if slides and i == 1 and kind == "Revolute":
            raise Again
        at = Mark(parent, even(rng.uniform(-0.6, 0.6, 3)))
    poses = assemble(machine)[0]
    frames = lambda k: (np.zeros(3), np.eye(3)) if k == GROUND else poses[k]
    (o, A), (ob, Ab) = frames(parent), frames(base)
    # The other end stands behind the mark of the base: axes are parallel as they are written.
    second = Mark(base, start.first, start.turns, even(start.Q.T @ (Ab.T @ (o + A @ at.p - ob) - start.p)))
    machine.loops.append(Loop("CutRevolute", f"c{len(machine.loops)}", second, Mark(parent, at.p), n=axis))
    machine.redundant = True


def add_spherical(rng, machine):
    """A four-bar whose axes meet in a point."""
    k = len(machine.links)
    base = GROUND if k == 0 or rng.random() < 0.5 else int(rng.integers(k))
    at, parent = random_mark(rng, base, 0.4), base
    start = at
    for i in range(3):
        joint = make_joint(rng, "Revolute", f"j{len(machine.links)}", at, len(machine.links), exact_axis(rng))
        add_axes(rng, joint)
        parent = len(machine.links)
        machine.links.append(random_link(rng))
        machine.joints.append(joint)
        at = Mark(parent, (0, 0, 0), [(random_axis(rng), rng.uniform(-1.5, 1.5))] if rng.random() < 0.5 else [])
    poses = assemble(machine)[0]
    frames = lambda k: (np.zeros(3), np.eye(3)) if k == GROUND else poses[k]
    _, A = frames(parent)
    _, Ab = frames(base)
    n = exact_axis(rng)
    turns = turned_like(Ab.T @ (A @ at.Q @ rotation(n.value, rng.uniform(-1, 1))))
    machine.loops.append(Loop("CutRevolute", f"c{len(machine.loops)}", Mark(base, start.p, turns), Mark(parent, at.p, at.turns), n=n))
    machine.redundant = True


def add_parallelogram(rng, machine):
    """A parallelogram with a third crank, whose loop repeats the other one."""
    k = len(machine.links)
    base = GROUND if k == 0 or rng.random() < 0.5 else int(rng.integers(k))
    axis = exact_axis(rng)
    start = random_mark(rng, base, 0.0)
    # In whole parts of 1/1024 m, so that they add up exactly.
    way, arm, start.p = (np.round(1024*p)/1024 for p in (rng.uniform(-1, 1, 3), rng.uniform(-0.5, 0.5, 3), start.p))
    way, start.first = 2*way, start.p
    first = make_joint(rng, "Revolute", f"j{k}", start, k, axis)
    crank = first.q[0]
    second = make_joint(rng, "Revolute", f"j{k + 1}", Mark(k, arm), k + 1, axis)
    second.q = [-crank]
    machine.links += [random_link(rng), random_link(rng)]
    machine.joints += [first, second]
    add_axes(rng, first)
    for i, share in enumerate([1.0, 0.5]):
        b = k + 2 + i
        joint = make_joint(rng, "Revolute", f"j{b}", Mark(base, start.p + share*way), b, axis)
        joint.q = [crank]
        machine.links.append(random_link(rng))
        machine.joints.append(joint)
        machine.loops.append(Loop("CutRevolute", f"c{len(machine.loops)}", Mark(b, arm), Mark(k + 1, share*way), n=axis))
    machine.redundant = True


class Again(Exception):
    """This draw leads to no machine; another one of the same seed is drawn."""


def flat(rng, machine, bodies):
    """A machine that moves in the plane of x and y."""
    machine.planar = True
    g = rng.normal(size=2)
    machine.g = np.array([*(9.81*g/np.sqrt(g @ g)), 0])

    def link():
        m = float(np.exp(rng.uniform(np.log(0.2), np.log(8))))
        return Link(m, np.diag([0.1*m, 0.1*m, rng.uniform(0.02, 0.2)*m]), np.array([*rng.uniform(-0.3, 0.3, 2), 0])*(rng.random() < 0.6))

    def mark(link):
        return Mark(link, np.array([*rng.uniform(-0.6, 0.6, 2), 0]))

    for k in range(bodies):
        parent = GROUND if k == 0 or rng.random() < 0.2 else int(rng.integers(max(0, k - 2), k))
        kind = str(rng.choice(["Revolute"]*4 + ["Prismatic"]*2 + ["Planar"]))
        if kind == "Revolute":
            axis = whole_axis(Z)
        else:
            axis = [whole_axis(X), whole_axis(Y), Axis("[3/5, 4/5, 0]", [0.6, 0.8, 0]), Axis("[-5/13, 12/13, 0]", [-5/13, 12/13, 0])][rng.integers(4)]
        joint = make_joint(rng, kind, f"j{k}", mark(parent), k, axis, mark(None) if rng.random() < 0.4 else None)
        add_axes(rng, joint)
        machine.links.append(link())
        machine.joints.append(joint)
    for _ in range(int(rng.integers(0, 3))):
        for _ in range(12):
            poses = assemble(machine)[0]
            frames = lambda k: (np.zeros(3), np.eye(3)) if k == GROUND else poses[k]
            a, b = (int(x) for x in rng.choice(range(-1, bodies), 2, replace=False))
            ma, mb = mark(a), mark(b)
            ra, rb = (frames(k)[0] + frames(k)[1] @ m.p for k, m in ((a, ma), (b, mb)))
            if rng.random() < 0.5:
                length = np.sqrt((rb - ra) @ (rb - ra))
                if length < 0.1:
                    continue
                loop = Loop("Rod", f"c{len(machine.loops)}", ma, mb, l=length)
            else:
                ob, Ab = frames(b)
                p = Ab.T @ (ra - ob)
                p[2] = 0
                loop = Loop("CutRevolute", f"c{len(machine.loops)}", ma, Mark(b, p), n=whole_axis(Z))
            machine.loops.append(loop)
            values, rank, moves = mobility(machine)
            if moves >= 1 and rank == sum({"Rod": 1, "CutRevolute": 2}[l.kind] for l in machine.loops) and values[rank - 1] > 10*SINGULAR*values[0]:
                break
            machine.loops.pop()
    for _ in range(rng.poisson(0.8)):
        a, b = (int(x) for x in rng.choice(range(-1, bodies), 2, replace=False))
        name = f"s{len(machine.forces)}"
        if rng.random() < 0.7:
            machine.forces.append(Force("SpringDamper", name, mark(a), mark(b), k=rng.uniform(10, 200), l0=rng.uniform(0.1, 0.8), c=rng.uniform(0.5, 10)))
        else:
            machine.forces.append(Force("Force", name, mark(max(a, b)), world=int(rng.random() < 0.5), value=np.array([*rng.uniform(-5, 5, 2), 0])))


# Machines of seeds from here on have many bodies: rates are eliminated from the leaves on.
LONG = 20000


def machine_of(seed, small=None):
    """The machine of a seed; `small` keeps to few bodies: four of five."""
    global decimals
    small = seed % 5 != 0 if small is None else small
    rng = np.random.default_rng(seed)
    decimals = rng.random() < 0.1
    for _ in range(50):
        machine = Machine(seed)
        machine.g = gravity(rng)
        draw = rng.random()
        most = 3 if small else 7
        try:
            if seed >= LONG:
                machine.kind = "long"
                grow(rng, machine, int(rng.integers(8, 17)))
                if draw < 0.3 and not add_loop(rng, machine):
                    raise Again
            elif draw < 0.30:
                machine.kind = "tree"
                grow(rng, machine, int(rng.integers(1, most + 1)))
                weld_some(rng, machine)
            elif draw < 0.62:
                machine.kind = "loops"
                grow(rng, machine, int(rng.integers(1, (2 if small else 3) + 1)))
                if not add_loop(rng, machine):
                    raise Again
                if rng.random() < 0.25 and not small:
                    add_loop(rng, machine)
                weld_some(rng, machine)
            elif draw < 0.80:
                machine.kind = "planar"
                flat(rng, machine, int(rng.integers(1, (3 if small else 6) + 1)))
            elif draw < 0.90:
                machine.kind = "parallel"
                grow(rng, machine, int(rng.integers(0, 2 if small else 3)))
                add_parallel(rng, machine, 3 if small or rng.random() < 0.7 else 4)
                if rng.random() < 0.5 and not small:
                    grow(rng, machine, 1)
                weld_some(rng, machine)
            elif draw < 0.95:
                machine.kind = "spherical"
                grow(rng, machine, 0 if small else int(rng.integers(0, 2)))
                add_spherical(rng, machine)
            else:
                machine.kind = "parallelogram"
                grow(rng, machine, 0 if small else int(rng.integers(0, 2)))
                add_parallelogram(rng, machine)
        except Again:
            continue
        if not machine.planar:
            add_forces(rng, machine)
        _, _, moves = mobility(machine)
        if moves >= 1:
            still(rng, machine)
            project_rates(machine)
            return machine
    raise RuntimeError(f"seed {seed} leads to no machine")


def still(rng, machine):
    """Some machines start at rest."""
    if rng.random() < 0.08:
        for joint in machine.joints:
            joint.u = 0*joint.u


# Where the links are, and how fast, from the joints: only at the start.

def assemble(machine):
    """Poses (o, A) of the frames of the links and velocities (v of o, w), in the world."""
    poses, speeds = [None]*len(machine.links), [None]*len(machine.links)
    for joint in machine.joints:
        place(machine, joint, poses, speeds)
    for k, link in enumerate(machine.links):
        if link.weld is not None:
            o, A = poses[link.weld.link]
            v, w = speeds[link.weld.link]
            arm = A @ link.weld.p
            poses[k], speeds[k] = (o + arm, A @ link.weld.Q), (v + cross(w, arm), w)
    return poses, speeds


def place(machine, joint, poses, speeds):
    if joint.a.link == GROUND:
        o, A, v, w = np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3)
    else:
        (o, A), (v, w) = poses[joint.a.link], speeds[joint.a.link]
    arm = A @ joint.a.p
    o, v, A = o + arm, v + cross(w, arm), A @ joint.a.Q
    k = 0
    for way, q in zip(joint.ways, joint.q):
        if way[0] == "R":
            n = A @ way[1].value
            w = w + n*joint.u[k]
            A = A @ rotation(way[1].value, q)
            k += 1
        elif way[0] == "P":
            n = A @ way[1].value
            v = v + n*joint.u[k] + cross(w, n*q)
            o = o + n*q
            k += 1
        else:
            A = A @ of_quaternion(np.array(q))
            w = w + A @ joint.u[k:k + 3]
            k += 3
    if joint.tail is not None:
        arm = A @ joint.tail.p
        o, v, A = o + arm, v + cross(w, arm), A @ joint.tail.Q
    poses[joint.b], speeds[joint.b] = (o, A), (v, w)


def loop_matrix(machine):
    """Rates of the equations of loops for each rate of a joint."""
    kept = [joint.u for joint in machine.joints]
    system = System(machine)
    columns = []
    for joint in machine.joints:
        for k in range(joint.size()):
            for other in machine.joints:
                other.u = np.zeros(other.size())
            joint.u[k] = 1
            state = system.state(*assemble(machine))
            columns.append(system.loop_rates(state))
    for joint, u in zip(machine.joints, kept):
        joint.u = u
    return np.array(columns).T


def mobility(machine):
    total = sum(joint.size() for joint in machine.joints)
    if not machine.loops:
        return np.array([]), 0, total
    values = np.linalg.svd(loop_matrix(machine), compute_uv=False)
    rank = int(np.sum(values > 1e-9*max(values[0], 1e-3)))
    return values, rank, total - rank


def project_rates(machine):
    """The nearest rates that the loops allow."""
    if not machine.loops:
        return
    G = loop_matrix(machine)
    u = np.concatenate([joint.u for joint in machine.joints])
    _, s, Vt = np.linalg.svd(G)
    rank = int(np.sum(s > 1e-9*s[0]))
    for _ in range(2):
        u = u - Vt[:rank].T @ (Vt[:rank] @ u)
    for joint in machine.joints:
        joint.u, u = u[:joint.size()], u[joint.size():]


# Maximal coordinates.

class System:
    """Newton-Euler for every body, multipliers for every joint, weld and loop.

    The state is x (centre of mass), e (quaternion), v, w for each body, all in the world.
    """

    def __init__(self, machine):
        self.machine = machine
        self.n = len(machine.links)
        # Every connection: rows of its equations, between marks a and b.
        self.connections = []
        for joint in machine.joints:
            b = Mark(joint.b)
            if joint.tail is not None:
                b.Q = joint.tail.Q.T
                b.p = -b.Q @ joint.tail.p
            self.connections.append((joint.kind, joint, joint.a, b))
        for k, link in enumerate(machine.links):
            if link.weld is not None:
                self.connections.append(("Weld", link, link.weld, Mark(k)))
        self.loops_from = len(self.connections)
        for loop in machine.loops:
            self.connections.append((loop.kind, loop, loop.a, loop.b))
        self.start = None

    def state(self, poses, speeds):
        y = np.zeros((self.n, 13))
        for k, link in enumerate(self.machine.links):
            (o, A), (v, w) = poses[k], speeds[k]
            arm = A @ link.c
            y[k, :3], y[k, 3:7], y[k, 7:10], y[k, 10:] = o + arm, to_quaternion(A), v + cross(w, arm), w
        return y.ravel()

    def bodies(self, y):
        y = y.reshape(self.n, 13)
        return [(b[:3], of_quaternion(b[3:7]), b[7:10], b[10:]) for b in y]

    def at(self, bodies, mark):
        """Arm from the centre of mass, place, axes, velocity, angular velocity, and what of the acceleration speeds determine."""
        if mark.link == GROUND:
            return np.zeros(3), mark.p, mark.Q, np.zeros(3), np.zeros(3), np.zeros(3)
        x, A, v, w = bodies[mark.link]
        rho = A @ (mark.p - self.machine.links[mark.link].c)
        turn = cross(w, rho)
        return rho, x + rho, A @ mark.Q, v + turn, w, cross(w, turn)

    def rows(self, bodies, connection):
        """Equations of a connection: (force and torque on a, on b at the centres of mass, right side); J a = right side.

        Each also with the force and torque about the mark of b that its multiplier 1 puts on b.
        """
        kind, thing, ma, mb = connection
        pa, ra, Ra, va, wa, ba = self.at(bodies, ma)
        pb, rb, Rb, vb, wb, bb = self.at(bodies, mb)
        d, rate, bias = rb - ra, vb - va, bb - ba
        found = []

        def meet():
            for e in (X, Y, Z):
                found.append((-e, -cross(pa, e), e, cross(pb, e), -(e @ bias), e, np.zeros(3)))

        def plane(u):
            ud = cross(wa, u)
            right = -(u @ bias + 2*(ud @ rate) + cross(wa, ud) @ d)
            found.append((-u, -cross(pa, u) + cross(u, d), u, cross(pb, u), right, u, np.zeros(3)))

        def angle(u, v):
            k = cross(u, v)
            right = -((wa - wb) @ (cross(cross(wa, u), v) + cross(u, cross(wb, v))))
            found.append((np.zeros(3), k, np.zeros(3), -k, right, np.zeros(3), -k))

        def alike():
            # Three angles between axes that stand across each other now, whatever the turn between the frames.
            T = self.turns[id(thing)]
            for i, j in ((1, 2), (0, 2), (0, 1)):
                angle(Ra[:, i], Rb @ T[:, j])

        if kind in ("Spherical", "SphericalCardan", "CutSpherical"):
            meet()
        elif kind in ("Revolute", "CutRevolute"):
            n = thing.ways[0][1].value if kind == "Revolute" else thing.data["n"].value
            meet()
            for t in across(n):
                angle(Ra @ t, Rb @ n)
        elif kind in ("Prismatic", "CutPrismatic"):
            n = thing.ways[0][1].value if kind == "Prismatic" else thing.data["n"].value
            for t in across(n):
                plane(Ra @ t)
            alike()
        elif kind == "Cylindrical":
            n = thing.ways[0][1].value
            for t in across(n):
                plane(Ra @ t)
                angle(Ra @ t, Rb @ n)
        elif kind == "Universal":
            meet()
            angle(Ra @ thing.ways[0][1].value, Rb @ thing.ways[1][1].value)
        elif kind == "CutUniversal":
            meet()
            angle(Ra @ thing.data["n1"].value, Rb @ thing.data["n2"].value)
        elif kind == "Planar":
            plane(Ra @ Z)
            angle(Ra @ X, Rb @ Z)
            angle(Ra @ Y, Rb @ Z)
        elif kind == "Weld":
            meet()
            alike()
        elif kind == "CutInline":
            for t in across(thing.data["n"].value):
                plane(Ra @ t)
        elif kind == "CutInplane":
            plane(Ra @ thing.data["n"].value)
        elif kind == "CutOrientation":
            alike()
        elif kind == "Rod":
            found.append((-d, -cross(pa, d), d, cross(pb, d), -(d @ bias + rate @ rate), d, np.zeros(3)))
        else:
            assert kind == "Free"
        return found

    def begin(self, y):
        """What is kept from the start: the turn between frames that stay alike, angles and lengths of springs."""
        bodies = self.bodies(y)
        self.turns = {}
        for kind, thing, ma, mb in self.connections:
            Ra, Rb = self.at(bodies, ma)[2], self.at(bodies, mb)[2]
            self.turns[id(thing)] = Rb.T @ Ra
        self.start, self.last, self.moved = {}, {}, {}
        for connection in self.connections[:self.loops_from]:
            if connection[0] != "Weld" and connection[1].axes:
                self.start[id(connection[1])] = self.axis_values(bodies, connection)[0]
        for force in self.machine.forces:
            if force.kind in ("Line", "LineAlong"):
                self.start[id(force)] = self.length(bodies, force)[0]

    def loop_rates(self, y):
        self.begin(y)
        bodies = self.bodies(y)
        rates = []
        for connection in self.connections[self.loops_from:]:
            a, b = connection[2].link, connection[3].link
            for row in self.rows(bodies, connection):
                total = 0.0
                for link, f, t in ((a, row[0], row[1]), (b, row[2], row[3])):
                    if link != GROUND:
                        total += f @ bodies[link][2] + t @ bodies[link][3]
                rates.append(total)
        return np.array(rates)

    def axis_values(self, bodies, connection):
        """Angles and ways of a joint, their rates, and for each the force (through the mark of b) and torque of effort 1 on b."""
        kind, joint, ma, mb = connection
        _, ra, Ra, va, wa, _ = self.at(bodies, ma)
        _, rb, Rb, vb, wb, _ = self.at(bodies, mb)
        d, w = rb - ra, wb - wa
        slide = vb - va - cross(wa, d)
        Q = Ra.T @ Rb

        def about(n, t, u):
            """Angle about n from t to u."""
            t, u = t - n*(n @ t), u - n*(n @ u)
            return np.arctan2(n @ cross(t, u), t @ u)

        none = np.zeros(3)
        values, rates, efforts = [], [], []
        turning = [way[1].value for way in joint.ways if way[0] == "R"]
        if len(turning) == 1:
            t = across(turning[0])[0]
            angles, axes = [about(turning[0], t, Q @ t)], [Ra @ turning[0]]
        elif len(turning) == 2:
            n1, n2 = turning
            angles, axes = [about(n1, n2, Q @ n2), -about(n2, n1, Q.T @ n1)], [Ra @ n1, Rb @ n2]
        elif len(turning) == 3:
            angles = list(cardan(Q))
            axes = [Ra @ X, Ra @ rotation(X, angles[0]) @ Y, Rb @ Z]
        else:
            angles, axes = [], []
        if axes:
            dual = np.linalg.pinv(np.array(axes))  # columns: torques that do work on one of the rates alone
            turn_rates = dual.T @ w
        k = 0
        for way in joint.ways:
            if way[0] == "R":
                values.append(angles[k])
                rates.append(turn_rates[k])
                efforts.append((none, dual[:, k]))
                k += 1
            else:
                n = Ra @ way[1].value
                values.append(n @ d)
                rates.append(n @ slide)
                efforts.append((n, none))
        return values, rates, efforts

    def length(self, bodies, force):
        _, ra, Ra, va, wa, _ = self.at(bodies, force.a)
        _, rb, _, vb, _, _ = self.at(bodies, force.b)
        d, rate = rb - ra, vb - va
        if force.kind == "LineAlong":
            n = Ra @ force.data["n"].value
            return n @ d, n @ rate + cross(wa, n) @ d, n
        length = np.sqrt(d @ d)
        return length, d @ rate/length, d/length

    def applied(self, bodies):
        """Forces and torques about the centres of mass, and those of drives and springs at the joints on b about its mark."""
        load = np.zeros((self.n, 6))
        at_joints = {}

        def push(mark_link, r, F, T):
            if mark_link != GROUND:
                load[mark_link, :3] += F
                load[mark_link, 3:] += T + cross(r - bodies[mark_link][0], F)

        for k, link in enumerate(self.machine.links):
            load[k, :3] += link.m*self.machine.g
        for connection in self.connections[:self.loops_from]:
            kind, joint, ma, mb = connection
            if kind == "Weld":
                continue
            rb, Rb = self.at(bodies, mb)[1:3]
            F, T = np.zeros(3), np.zeros(3)
            if joint.axes:
                values, rates, efforts = self.axis_values(bodies, connection)
                for k, spring, q0, damping, effort in joint.axes:
                    moved = values[k] - self.start[id(joint)][k]
                    if joint.ways[k][0] == "R":
                        # Of the turns the one nearest to the last step.
                        last = self.last.get((id(joint), k), 0.0)
                        moved = last + (moved - last + np.pi) % (2*np.pi) - np.pi
                        self.moved[id(joint), k] = moved
                    e = effort - spring*(q0 + moved) - damping*rates[k]
                    F, T = F + e*efforts[k][0], T + e*efforts[k][1]
            if joint.torque is not None:
                T = T + Rb @ joint.torque
            at_joints[id(joint)] = F, T
            push(mb.link, rb, F, T)
            push(ma.link, rb, -F, -T)
        for force in self.machine.forces:
            ra, Ra, va, wa = self.at(bodies, force.a)[1:5]
            none = np.zeros(3)
            if force.kind in ("Force", "Torque"):
                value = force.data["value"] if force.data["world"] else Ra @ force.data["value"]
                push(force.a.link, ra, *((value, none) if force.kind == "Force" else (none, value)))
                continue
            rb, Rb, vb, wb = self.at(bodies, force.b)[1:5]
            if force.kind == "Bushing":
                d, Q = Ra.T @ (rb - ra), Ra.T @ Rb
                way = Ra.T @ (vb - va - cross(wa, rb - ra))
                S = Q - Q.T
                phi = np.array([S[2, 1], S[0, 2], S[1, 0]])/2
                columns = []
                for e in (X, Y, Z):
                    change = skew(e) @ Q
                    change = change - change.T
                    columns.append([change[2, 1]/2, change[0, 2]/2, change[1, 0]/2])
                B = np.array(columns).T
                z, rate = np.concatenate([d, phi]), np.concatenate([way, B @ (Ra.T @ (wb - wa))])
                e = force.data["K"] @ z + force.data["C"] @ rate
                F, T = -(Ra @ e[:3]), -(Ra @ (B.T @ e[3:]))
            else:
                length, rate, direction = self.length(bodies, force)
                data = force.data
                moved = length - data["l0"] if force.kind == "SpringDamper" else data["q0"] + length - self.start[id(force)]
                F, T = -(data["k"]*moved + data["c"]*rate)*direction, none
            push(force.b.link, rb, F, T)
            push(force.a.link, rb, -F, -T)
        return load, at_joints

    def equations(self, y):
        bodies = self.bodies(y)
        n = self.n
        M = np.zeros((6*n, 6*n))
        load, at_joints = self.applied(bodies)
        for k, link in enumerate(self.machine.links):
            _, A, _, w = bodies[k]
            J = A @ link.J @ A.T
            M[6*k:6*k + 3, 6*k:6*k + 3] = link.m*np.eye(3)
            M[6*k + 3:6*k + 6, 6*k + 3:6*k + 6] = J
            load[k, 3:] -= cross(w, J @ w)
        rows, right, wrenches, owner = [], [], [], []
        for c, connection in enumerate(self.connections):
            a, b = connection[2].link, connection[3].link
            for fa, ta, fb, tb, value, F, T in self.rows(bodies, connection):
                row = np.zeros(6*n)
                if a != GROUND:
                    row[6*a:6*a + 3] += fa
                    row[6*a + 3:6*a + 6] += ta
                if b != GROUND:
                    row[6*b:6*b + 3] += fb
                    row[6*b + 3:6*b + 6] += tb
                rows.append(row)
                right.append(value)
                wrenches.append(np.concatenate([F, T]))
                owner.append(c)
        J = np.array(rows).reshape(len(rows), 6*n)
        return M, J, load.ravel(), np.array(right), wrenches, owner, at_joints

    def choose(self, y):
        """Independent equations, for the run."""
        J = self.equations(y)[1]
        if not len(J):
            self.kept = []
            return
        scaled = J/np.linalg.norm(J, axis=1)[:, None]
        _, R, order = qr(scaled.T, mode="economic", pivoting=True)
        sizes = abs(np.diag(R))
        self.kept = sorted(order[:int(np.sum(sizes > 1e-9*sizes[0]))])

    def rates(self, t, y):
        M, J, load, right = self.equations(y)[:4]
        J, right = J[self.kept], right[self.kept]
        m = len(right)
        K = np.zeros((6*self.n + m, 6*self.n + m))
        K[:6*self.n, :6*self.n] = M
        K[6*self.n:, :6*self.n] = J
        K[:6*self.n, 6*self.n:] = J.T
        a = np.linalg.solve(K, np.concatenate([load, right]))[:6*self.n].reshape(self.n, 6)
        y = y.reshape(self.n, 13)
        dy = np.zeros_like(y)
        dy[:, :3] = y[:, 7:10]
        e, w = y[:, 3:7], y[:, 10:]
        # e' = (0, w) e / 2, with w in the world.
        dy[:, 3] = -(w[:, 0]*e[:, 1] + w[:, 1]*e[:, 2] + w[:, 2]*e[:, 3])/2
        dy[:, 4] = (w[:, 0]*e[:, 0] + w[:, 1]*e[:, 3] - w[:, 2]*e[:, 2])/2
        dy[:, 5] = (w[:, 1]*e[:, 0] + w[:, 2]*e[:, 1] - w[:, 0]*e[:, 3])/2
        dy[:, 6] = (w[:, 2]*e[:, 0] + w[:, 0]*e[:, 2] - w[:, 1]*e[:, 1])/2
        dy[:, 7:] = a
        return dy.ravel()

    def solve(self, y):
        """All that is compared at one instant, and how far from singular the machine is there."""
        M, J, load, right, wrenches, owner, at_joints = self.equations(y)
        n6 = 6*self.n
        if len(right):
            lengths = np.linalg.norm(J, axis=1)
            U, s, Vt = np.linalg.svd(J/lengths[:, None])
            rank = int(np.sum(s > ZERO*s[0]))
            margin = s[rank - 1]/s[0]
            particular = Vt[:rank].T @ ((U[:, :rank].T @ (right/lengths))/s[:rank])
            N = Vt[rank:].T
        else:
            lengths, rank, margin = np.ones(0), 0, 1.0
            particular, N = np.zeros(n6), np.eye(n6)
        reduced = N.T @ M @ N
        a = particular
        if N.shape[1]:
            a = a + N @ np.linalg.solve(reduced, N.T @ (load - M @ particular))
        residual = float(np.max(abs(J @ a - right), initial=0))
        lam = np.linalg.lstsq(J.T/lengths, M @ a - load, rcond=ZERO)[0] if len(right) else np.zeros(0)
        null = U[:, rank:] if len(right) else np.zeros((0, 0))
        forces = {}
        for c, (kind, thing, ma, mb) in enumerate(self.connections):
            mine = [i for i, o in enumerate(owner) if o == c]
            B = np.array([wrenches[i]/lengths[i] for i in mine]).reshape(-1, 6).T
            total = B @ lam[mine]
            unique = null.shape[1] == 0 or not mine or np.max(abs(B @ null[mine])) < 1e-9
            if id(thing) in at_joints:
                F, T = at_joints[id(thing)]
                total = total + np.concatenate([F, T])
            forces[thing.name if kind != "Weld" else c] = (total, unique)
        bodies = self.bodies(y)
        out = {"links": [], "forces": forces, "margin": margin, "rank": rank, "rows": len(right), "residual": residual,
               "condition": float(np.linalg.cond(reduced)) if N.shape[1] else 1.0, "moves": N.shape[1]}
        a = a.reshape(self.n, 6)
        for k, link in enumerate(self.machine.links):
            x, A, v, w = bodies[k]
            arm = -(A @ link.c)
            acceleration = a[k, :3] + cross(a[k, 3:], arm) + cross(w, cross(w, arm))
            out["links"].append({"r": x + arm, "R": A, "v": v + cross(w, arm), "a": acceleration, "w": A.T @ w, "alpha": A.T @ a[k, 3:]})
        out["frames"] = {id(thing): self.at(bodies, mb)[2] for _, thing, _, mb in self.connections}
        out["frames_a"] = {id(thing): self.at(bodies, ma)[2] for _, thing, ma, _ in self.connections}
        return out


def run(machine, to=TO, rtol=1e-12):
    """The start and the end of a run, and the least margin on the way."""
    system = System(machine)
    y = system.state(*assemble(machine))
    system.begin(y)
    start = system.solve(y)
    if to is None or start["margin"] < SINGULAR or start["condition"] > 1e7:
        return start, None, start["margin"]
    system.choose(y)
    solver = DOP853(system.rates, 0.0, y, to, rtol=rtol, atol=1e-13)
    margin, steps = start["margin"], 0
    while solver.status == "running":
        solver.step()
        steps += 1
        system.equations(solver.y)
        system.last = dict(system.moved)
        if steps % 3 == 0 or solver.status == "finished":
            here = system.solve(solver.y)
            margin = min(margin, here["margin"])
            if here["rank"] != start["rank"] or steps > 400:
                return start, None, 0.0
    if solver.status != "finished":
        return start, None, 0.0
    return start, here, margin


# Model text.

AXIS_PORTS = {
    "Revolute": ["axis"], "Prismatic": ["axis"], "Cylindrical": ["turn", "slide"], "Universal": ["axis1", "axis2"],
    "Planar": ["x", "y", "axis"], "SphericalCardan": ["axis1", "axis2", "axis3"],
}


def chain(first, steps, last, names):
    """`first -> Kind:name(arguments) -> ... -> last`."""
    parts = [first]
    for kind, arguments in steps:
        names[0] += 1
        parts.append(f"{kind}:m{names[0]}({arguments})")
    return " -> ".join(parts + [last])


def hub(link):
    return "ground" if link == GROUND else f"f{link}"


def swapped(joint, swap):
    """The kind that a joint is written as, with ways, values and rates: ball joints by Cardan angles instead of quaternions, and back."""
    if not swap:
        return joint.kind, joint.q, joint.u
    if joint.kind == "SphericalCardan" and not joint.axes:
        R = rotation(X, joint.q[0]) @ rotation(Y, joint.q[1]) @ rotation(Z, joint.q[2])
        return "Spherical", [to_quaternion(R)], cardan_axes(joint.q) @ joint.u
    if joint.kind in ("Spherical", "Free") and joint.torque is None:
        angles = cardan(of_quaternion(np.array(joint.q[-1])))
        rates = np.linalg.solve(cardan_axes(angles), joint.u[-3:])
        q, u = [*joint.q[:-1], *angles], np.concatenate([joint.u[:-3], rates])
        return ("SphericalCardan" if joint.kind == "Spherical" else "FreeCardan"), q, u
    return joint.kind, joint.q, joint.u


def cardan_axes(q):
    R3 = rotation(Z, q[2])
    return np.array([(rotation(Y, q[1]) @ R3).T @ X, R3.T @ Y, Z]).T


def joint_steps(joint, swap):
    """The joint in its chain, and statements beside it."""
    kind, q, u = swapped(joint, swap)
    name, beside = joint.name, []
    axis = [way[1].text for way in joint.ways if way[0] != "S"]
    if kind == "Revolute":
        text = f"Revolute:{name}(n = {axis[0]}, q0 = {number(q[0])}, w0 = {number(u[0])})"
    elif kind == "Prismatic":
        text = f"Prismatic:{name}(n = {axis[0]}, q0 = {number(q[0])}, v0 = {number(u[0])})"
    elif kind == "Cylindrical":
        text = f"Cylindrical:{name}(n = {axis[0]}, angle0 = {number(q[0])}, way0 = {number(q[1])})"
    elif kind == "Universal":
        text = f"Universal:{name}(n1 = {axis[0]}, n2 = {axis[1]}, q1 = {number(q[0])}, q2 = {number(q[1])})"
    elif kind == "Planar":
        text = f"Planar:{name}(x0 = {number(q[0])}, y0 = {number(q[1])}, angle0 = {number(q[2])})"
    elif kind == "SphericalCardan":
        text = f"SphericalCardan:{name}(" + ", ".join(f"q{i + 1} = {number(q[i])}" for i in range(3)) + ", " + ", ".join(f"w{i + 1} = {number(u[i])}" for i in range(3)) + ")"
    elif kind == "Spherical":
        text = f"Spherical:{name}(e0 = {vector(q[0])}, w0 = {vector(u)})"
    elif kind == "Free":
        text = f"Free:{name}(x0 = {vector(q[:3])}, e0 = {vector(q[3])}, v0 = {vector(u[:3])}, w0 = {vector(u[3:])})"
    else:
        assert kind == "FreeCardan"
        text = " -> ".join(f"Prismatic:{name}{e}(n = {n}, q0 = {number(q[i])}, v0 = {number(u[i])})" for i, (e, n) in enumerate(zip("xyz", ["[1, 0, 0]", "[0, 1, 0]", "[0, 0, 1]"])))
        text += f" -> SphericalCardan:{name}(" + ", ".join(f"q{i + 1} = {number(q[3 + i])}, w{i + 1} = {number(u[3 + i])}" for i in range(3)) + ")"
    ports = AXIS_PORTS.get(kind, [])
    loaded = {k: rest for k, *rest in joint.axes}
    for k, port in enumerate(ports):
        guessed = kind in ("Cylindrical", "Universal", "Planar")
        if not guessed and k not in loaded:
            continue
        rate = f"{name}_{port}"
        beside.append(f"1:{rate} -> {name}.{port}")
        if guessed:
            beside.append(f"guess {rate}.f = {number(u[k])}")
        if k in loaded:
            beside += axis_load(rate, loaded[k])
    if joint.torque is not None:
        beside.append(f"Se[3]:{name}_torque({vector(joint.torque)}) -> {name}.axis")
    return text, beside


def axis_load(rate, load):
    spring, q0, damping, effort = load
    found = []
    if spring:
        found.append(f"{rate} -> C:{rate}_spring(k = {number(spring)}, q0 = {number(q0)})")
    if damping:
        found.append(f"{rate} -> R:{rate}_damper({number(damping)})")
    if effort:
        found.append(f"Se:{rate}_drive({number(effort)}) -> {rate}")
    return found


def in_space(machine, swap=False):
    """Statements of `std.multibody`, and what is recorded for each link and force."""
    names = [0]
    lines = [f"World:world(g = {vector(machine.g)}) -> 1[frame]:ground"]
    for k, link in enumerate(machine.links):
        lines.append(f"1[frame]:f{k}")
        lines.append(f"f{k} -> Body:b{k}(m = {number(link.m)}, J = {matrix(link.J)}" + (f", c = {vector(link.c)})" if np.any(link.c) else ")"))
        lines.append(f"f{k} -> FrameSensor:s{k}_")
        if link.weld is not None:
            lines.append(chain(hub(link.weld.link), link.weld.steps(), f"f{k}", names))
        lines.append(f"output R{k} = [" + ", ".join(f"f{k}.R[{i},{j}]" for i in (1, 2, 3) for j in (1, 2, 3)) + "]")
        lines.append(f"output alpha{k} = [s{k}_.w[1]', s{k}_.w[2]', s{k}_.w[3]']")
    for joint in machine.joints:
        text, beside = joint_steps(joint, swap)
        steps = joint.a.steps()
        front = chain(hub(joint.a.link), steps, text, names)
        lines.append(front + chain("", joint.tail.steps() if joint.tail is not None else [], f"f{joint.b}", names))
        lines += beside
    for loop in machine.loops:
        arguments = ", ".join(f"{key} = {value.text if isinstance(value, Axis) else number(value)}" for key, value in loop.data.items())
        lines.append(f"{loop.kind}:{loop.name}({arguments})" if arguments else f"{loop.kind}:{loop.name}")
        lines.append(chain(hub(loop.a.link), loop.a.steps(), f"{loop.name}.a", names))
        lines.append(chain(hub(loop.b.link), loop.b.steps(), f"{loop.name}.b", names))
    for force in machine.forces:
        lines += force_lines(force, names)
    record = {}
    for k in range(len(machine.links)):
        for what, text in (("r", f"s{k}_.r"), ("v", f"s{k}_.v"), ("a", f"s{k}_.acceleration"), ("w", f"s{k}_.w"), ("alpha", f"alpha{k}")):
            record[k, what] = [f"{text}[{i}]" for i in (1, 2, 3)]
        record[k, "R"] = [f"R{k}[{i}]" for i in range(1, 10)]
    for joint in machine.joints:
        kind = swapped(joint, swap)[0]
        part = {"Universal": ".second", "SphericalCardan": ".yaw", "FreeCardan": ".yaw", "Planar": ".turning", "Free": ".turning", "Cylindrical": ".sliding"}.get(kind, "")
        if kind in ("Prismatic", "Cylindrical"):
            record[joint.name, "F"] = [f"{joint.name}{part}.sum.{e}.e" for e in "xyz"]
        else:
            record[joint.name, "F"] = [f"{joint.name}{part}.turn_v.out.{e}.e" for e in "xyz"]
            record[joint.name, "T"] = [f"{joint.name}{part}.sum.{e}.e" for e in "xyz"]
    for loop in machine.loops:
        if loop.kind in ("CutSpherical", "CutRevolute", "CutUniversal"):
            record[loop.name, "meet"] = [f"{loop.name}.meet[{i}].e" for i in (1, 2, 3)]
        elif loop.kind in ("CutPrismatic", "CutInline"):
            record[loop.name, "beside"] = [f"{loop.name}.beside{i}.e" for i in (1, 2)]
        elif loop.kind == "CutInplane":
            record[loop.name, "above"] = [f"{loop.name}.above.e"]
        elif loop.kind == "Rod":
            record[loop.name, "rod"] = [f"{loop.name}.length.e"]
    return lines, record


def force_lines(force, names):
    data, lines = force.data, []
    if force.kind == "SpringDamper":
        lines.append(f"SpringDamper:{force.name}(k = {number(data['k'])}, l0 = {number(data['l0'])}, c = {number(data['c'])})")
    elif force.kind in ("Line", "LineAlong"):
        lines.append(f"Line:{force.name}" if force.kind == "Line" else f"LineAlong:{force.name}(n = {data['n'].text})")
        lines.append(f"1:{force.name}_rate -> {force.name}.axis")
        lines += axis_load(f"{force.name}_rate", (data["k"], data["q0"], data["c"], 0.0))
    elif force.kind == "Bushing":
        lines.append(f"Bushing:{force.name}(K = {matrix(data['K'])}, C = {matrix(data['C'])})")
    else:
        word = "force" if force.kind == "Force" else "torque"
        end = f"{force.kind}:{force.name}(world = {data['world']}, {word} = {vector(data['value'])})"
        return [chain(hub(force.a.link), force.a.steps(), end, names)]
    lines.append(chain(hub(force.a.link), force.a.steps(), f"{force.name}.a", names))
    lines.append(chain(hub(force.b.link), force.b.steps(), f"{force.name}.b", names))
    return lines


def in_plane(machine):
    """The same machine by `std.planar`."""
    names = [0]
    lines = [f"PlanarWorld:world(g = {vector(machine.g[:2])}) -> 1[plane]:ground"]
    record = {}
    for k, link in enumerate(machine.links):
        lines.append(f"1[plane]:f{k}")
        lines.append(f"f{k} -> PlanarBody:b{k}(m = {number(link.m)}, J = {number(link.J[2, 2])}" + (f", c = {vector(link.c[:2])})" if np.any(link.c) else ")"))
        lines.append(f"output at{k} = [f{k}.place[1], f{k}.place[2]]")
        lines.append(f"output acceleration{k} = [f{k}.x.x.f', f{k}.y.x.f']")
        lines.append(f"output alpha{k} = f{k}.w.x.f'")
        record[k, "r"] = [f"at{k}[{i}]" for i in (1, 2)]
        record[k, "v"] = [f"f{k}.x.x.f", f"f{k}.y.x.f"]
        record[k, "a"] = [f"acceleration{k}[{i}]" for i in (1, 2)]
        record[k, "wz"] = [f"f{k}.w.x.f"]
        record[k, "alphaz"] = [f"alpha{k}"]
    for joint in machine.joints:
        q, u = joint.q, joint.u
        front = chain(hub(joint.a.link), joint.a.steps(True), "", names)
        flat_axis = lambda axis: axis.text.rsplit(",", 1)[0] + "]"
        parts = []
        for k, way in enumerate(joint.ways):
            name = joint.name if len(joint.ways) == 1 else f"{joint.name}{'xyt'[k]}"
            rate = "w0" if way[0] == "R" else "v0"
            n = "" if way[0] == "R" else f"n = {flat_axis(way[1])}, "
            parts.append(f"{'PlanarRevolute' if way[0] == 'R' else 'PlanarPrismatic'}:{name}({n}q0 = {number(q[k])}, {rate} = {number(u[k])})")
            for loaded, *load in joint.axes:
                if loaded == k:
                    lines.append(f"1:{name}_axis -> {name}.axis")
                    lines += axis_load(f"{name}_axis", load)
        tail = chain("", joint.tail.steps(True) if joint.tail is not None else [], f"f{joint.b}", names)
        lines.append(front + " -> ".join(parts) + tail)
    for loop in machine.loops:
        lines.append(f"PlanarRod:{loop.name}(l = {number(loop.data['l'])})" if loop.kind == "Rod" else f"PlanarCutRevolute:{loop.name}")
        for end, mark in (("a", loop.a), ("b", loop.b)):
            lines.append(chain(hub(mark.link), mark.steps(True), f"{loop.name}.{end}", names))
        if loop.kind == "Rod":
            record[loop.name, "rod"] = [f"{loop.name}.length.e"]
    for force in machine.forces:
        data = force.data
        if force.kind == "SpringDamper":
            lines.append(f"PlanarSpringDamper:{force.name}(k = {number(data['k'])}, l0 = {number(data['l0'])}, c = {number(data['c'])})")
            for end, mark in (("a", force.a), ("b", force.b)):
                lines.append(chain(hub(mark.link), mark.steps(True), f"{force.name}.{end}", names))
        else:
            lines.append(chain(hub(force.a.link), force.a.steps(True), f"PlanarForce:{force.name}(world = {data['world']}, force = {vector(data['value'][:2])})", names))
    return lines, record


def text_of(machine, lines, planar=False):
    return f"model Machine{machine.seed} \"{machine.kind}, {len(machine.links)} bodies, {len(machine.loops)} loops\"\nimport std.{'planar' if planar else 'multibody'}\n" + "\n".join(lines) + "\n"


def variants(machine):
    """(name, text, what is recorded)."""
    lines, record = in_space(machine)
    found = [("plain", text_of(machine, lines), record)]
    if machine.seed % 3 == 0:
        found.append(("reversed", text_of(machine, lines[::-1]), record))
    swap = [swapped(joint, True)[0] != joint.kind for joint in machine.joints]
    if any(swap):
        lines, record = in_space(machine, swap=True)
        found.append(("swapped", text_of(machine, lines), record))
    if machine.planar:
        lines, record = in_plane(machine)
        found.append(("planar", text_of(machine, lines, True), record))
    return found


# Comparison.

def expected(machine, solved, key):
    """What is to be recorded under `key`, or None where it is not unique."""
    where, what = key
    if isinstance(where, int):
        link = solved["links"][where]
        if what == "wz":
            return link["w"][2:]
        if what == "alphaz":
            return link["alpha"][2:]
        return np.ravel(link[what])
    total, unique = solved["forces"][where]
    if not unique:
        return None
    thing = next(x for x in machine.joints + machine.loops if x.name == where)
    Rb, Ra = solved["frames"][id(thing)], solved["frames_a"][id(thing)]
    if what == "F":
        return Rb.T @ total[:3]
    if what == "T":
        return Rb.T @ total[3:]
    if what == "meet":
        return Ra.T @ total[:3]
    if what == "beside":
        return np.array([Ra @ t for t in across(thing.data["n"].value)]) @ total[:3]
    if what == "above":
        return np.array([(Ra @ thing.data["n"].value) @ total[:3]])
    # The multiplier of d.d - l^2: the force on b is 2 d times that.
    d = np.sqrt(total[:3] @ total[:3])
    length = thing.data["l"]
    link_a, link_b = thing.a, thing.b
    ra, rb = mark_place(solved, link_a), mark_place(solved, link_b)
    return np.array([total[:3] @ (rb - ra)/(2*length**2)]) if d > 0 else np.zeros(1)


def mark_place(solved, mark):
    if mark.link == GROUND:
        return mark.p
    link = solved["links"][mark.link]
    return link["r"] + link["R"] @ mark.p


CLASS = {"r": "position", "R": "position", "v": "velocity", "w": "velocity", "wz": "velocity", "a": "acceleration", "alpha": "acceleration", "alphaz": "acceleration",
         "F": "reaction", "T": "reaction", "meet": "reaction", "beside": "reaction", "above": "reaction", "rod": "reaction"}
START = {"position": 1e-11, "velocity": 1e-10, "acceleration": 1e-9, "reaction": 1e-9}
END = {"position": 1e-8, "velocity": 1e-8, "acceleration": 1e-7, "reaction": 1e-7}


def scales(machine, solved):
    """The greatest of each class in the machine, at least 1."""
    found = {"position": 1.0, "velocity": 1.0, "acceleration": 1.0, "reaction": 1.0}
    for link in solved["links"]:
        for what in ("r", "v", "a", "w", "alpha"):
            found[CLASS[what]] = max(found[CLASS[what]], float(np.max(abs(link[what]))))
    for total, unique in solved["forces"].values():
        if unique:
            found["reaction"] = max(found["reaction"], float(np.max(abs(total))))
    for link in machine.links:
        found["reaction"] = max(found["reaction"], link.m*found["acceleration"])
    return found


def compare(machine, solved, row, record):
    """The greatest difference of each class, in its scale, and where."""
    scale, worst = scales(machine, solved), {}
    for key, names in record.items():
        values = expected(machine, solved, key)
        if values is None:
            continue
        kind = CLASS[key[1]]
        for i, name in enumerate(names):
            off = abs(row[name] - values[i])/scale[kind]
            if not off <= worst.get(kind, (-1,))[0]:
                worst[kind] = (off, name, row[name], float(values[i]))
    return worst


def simulate(binary, text, record, folder, to=TO, atol=None):
    path = os.path.join(folder, "machine.bond")
    with open(path, "w") as file:
        file.write(text)
    names = [name for group in record.values() for name in group]
    command = [binary, "simulate", path, "--to", repr(to), "--every", repr(to), "--rtol", "1e-12", "--record", ",".join(names), "--out", "-"]
    if atol is not None:
        command += ["--atol", repr(atol)]
    began = time.monotonic()
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=30*LONGEST, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST + 1)))
    except subprocess.TimeoutExpired:
        return "timeout", None, "no end", 30*LONGEST
    if done.returncode in (-9, -24):
        return "timeout", None, f"no end after {LONGEST} s of processor", LONGEST
    took = time.monotonic() - began
    rows = []
    if done.stdout:
        table = list(csv.reader(io.StringIO(done.stdout)))
        rows = [dict(zip(table[0], map(float, line))) for line in table[1:] if len(line) == len(table[0])]
    return done.returncode, rows, done.stderr, took


def judge(machine, start, end, rows, record):
    at_start = compare(machine, start, rows[0], record)
    bad = [(c, "start", *at_start[c]) for c in at_start if not at_start[c][0] <= START[c]]
    at_end = compare(machine, end, rows[-1], record) if end is not None else {}
    bad += [(c, "end", *at_end[c]) for c in at_end if not at_end[c][0] <= END[c]]
    return bad, at_start, at_end


def check(machine, binary, folder, reference=None, only=None):
    """For each variant (name, verdict, differences or message, time). LOOSE: the end is right with `--atol` and not without."""
    start, end, margin = reference or run(machine)
    if start["margin"] < SINGULAR or start["condition"] > 1e7:
        return [("plain", "skipped", f"margin {start['margin']:.1e}, condition {start['condition']:.1e}", 0.0)], margin
    found = []
    for name, text, record in variants(machine):
        if only and name != only:
            continue
        to = TO if end is not None and margin > SINGULAR else 1e-5
        record = {key: names for key, names in record.items() if expected(machine, start, key) is not None}
        code, rows, message, took = simulate(binary, text, record, folder, to)
        if code == "timeout":
            found.append((name, "TIMEOUT", message, took))
            continue
        if code != 0 or not rows:
            verdict = "FAULT" if "panic" in message or code not in (0, 1, 3) else "refused"
            lines = [line for line in message.split("\n") if "error" in line or "panic" in line or "has no" in line] or [message.strip()]
            found.append((name, verdict, f"exit {code}: " + " ".join(lines[:2]), took))
            continue
        last = end if to == TO else None
        what = judge(machine, start, last, rows, record)
        verdict = "FAULT" if what[0] else "OK"
        if what[0] and all(at == "end" for _, at, *_ in what[0]):
            code, rows, _, _ = simulate(binary, text, record, folder, to, 1e-14)
            if code == 0 and rows and not judge(machine, start, last, rows, record)[0]:
                verdict = "LOOSE"
        found.append((name, verdict, what, took))
    return found, margin


def campaign(arguments):
    folder = arguments.keep or "/tmp/random_trees"
    os.makedirs(folder, exist_ok=True)
    counts, kinds, worst, short, times = {}, {}, {}, 0, []
    log = open(os.path.join(folder, arguments.log), "a") if arguments.log else None
    began = time.monotonic()
    for seed in range(arguments.first, arguments.first + arguments.count):
        machine = machine_of(seed)
        reference = run(machine)
        found, margin = check(machine, arguments.binary, folder, reference)
        verdicts = [v for _, v, _, _ in found]
        short += verdicts[0] != "skipped" and (reference[1] is None or margin <= SINGULAR)
        line = f"{seed} {machine.kind} {len(machine.links)} bodies {len(machine.loops)} loops: "
        parts = []
        for name, verdict, what, took in found:
            counts[name, verdict] = counts.get((name, verdict), 0) + 1
            kinds[machine.kind, verdict] = kinds.get((machine.kind, verdict), 0) + 1
            times.append(took)
            if verdict in ("OK", "FAULT", "LOOSE") and not isinstance(what, str):
                for at, offs in (("start", what[1]), ("end", what[2])):
                    for c, off in offs.items():
                        if verdict == "OK":
                            worst[at, c] = max(worst.get((at, c), (0, 0)), (off[0], seed))
            text = f"{name} {verdict}"
            if verdict in ("FAULT", "LOOSE") and not isinstance(what, str):
                text += " " + "; ".join(f"{c} at {at}: {n} {a!r} for {b!r} ({o:.1e})" for c, at, o, n, a, b in what[0])
            elif verdict != "OK":
                text += " " + " | ".join(str(what).split("\n")[:3])
            parts.append(text + f" {took:.2f}s")
        line += ", ".join(parts)
        if log:
            print(line, file=log, flush=True)
        if any(v != "OK" for v in verdicts) or arguments.verbose:
            print(line, flush=True)
    print(f"\n{arguments.count} machines from seed {arguments.first}, {time.monotonic() - began:.0f} s; {short} of them compared at the start alone")
    for (name, verdict), count in sorted(counts.items()):
        print(f"  {name:9} {verdict:8} {count}")
    for (kind, verdict), count in sorted(kinds.items()):
        print(f"  {kind:14} {verdict:8} {count}")
    print("greatest differences of what is OK, by the greatest of its class in the machine:")
    for (at, c), (off, seed) in sorted(worst.items()):
        print(f"  {at:6} {c:13} {off:.1e} (seed {seed})")
    print(f"program: median {np.median(times):.2f} s, longest {max(times):.2f} s")


def one(arguments):
    machine = machine_of(arguments.seed)
    folder = arguments.keep or "/tmp/random_trees"
    os.makedirs(folder, exist_ok=True)
    reference = run(machine)
    start, end, margin = reference
    print(f"{machine.kind}, {len(machine.links)} bodies, {[j.kind for j in machine.joints]}, {[l.kind for l in machine.loops]}, {[f.kind for f in machine.forces]}")
    print(f"moves {start['moves']}, {start['rows']} equations of rank {start['rank']}, margin {start['margin']:.1e} (on the way {margin:.1e}), condition {start['condition']:.1e}, residual {start['residual']:.1e}")
    for name, text, _ in variants(machine):
        with open(os.path.join(folder, f"{arguments.seed}_{name}.bond"), "w") as file:
            file.write(text)
    for name, verdict, what, took in check(machine, arguments.binary, folder, reference)[0]:
        print(name, verdict, f"{took:.2f} s")
        if isinstance(what, str):
            print(what)
        else:
            for at, offs in (("start", what[1]), ("end", what[2])):
                for c, off in offs.items():
                    print(f"  {at:6} {c:13} {off[0]:.1e} {off[1]} {off[2]!r} for {off[3]!r}")


# References for the gate.

# Machines on which something was wrong, with the variant: start speeds that were lost since gains of loops were taken as 1,
# positions that follow from others and turn round, a joint that does not move the cut joint behind it.
FOUND = [(51, "reversed"), (72, "plain"), (141, "plain"), (479, "plain"), (495, "plain"), (495, "reversed"), (507, "plain")]


def references(arguments):
    """Small machines, one for each variant, and those found wrong, with what is to come at the start and at the end of the run."""
    folder = arguments.keep or "/tmp/random_trees"
    os.makedirs(folder, exist_ok=True)
    found, left, seed = [], [], 10000
    for number, name in FOUND:
        machine = machine_of(number)
        start, end, _ = run(machine)
        text, record = next(v[1:] for v in variants(machine) if v[0] == name)
        found.append(reference(machine, name, text, record, start, end))
    while len(found) < arguments.count + len(FOUND):
        machine = machine_of(seed, small=True)
        start, end, margin = run(machine)
        if end is not None and margin > 10*SINGULAR:
            # Variants in turn, where the machine has several.
            options = variants(machine)
            name, text, record = options[seed % len(options)]
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            verdict = check(machine, arguments.binary, folder, (start, end, margin), only=name)[0][0][1]
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            if verdict == "OK" and after.ru_utime - before.ru_utime > 0.08:
                pass  # The test shall take seconds in a build that is slow.
            elif verdict == "OK":
                found.append(reference(machine, name, text, record, start, end))
            else:
                left.append(f"{seed} {name}: {verdict}")
                print(left[-1])
        seed += 1
    head = {
        "made by": f"python3 random_trees.py references --binary halfarrow --count {arguments.count} random_trees.json",
        "by": "Newton and Euler in maximal coordinates; the program is asked only which machines to leave out, and which take it more than 0.08 s",
        "left out": left, "to": TO, "start off": START, "end off": END,
    }
    with open(arguments.out, "w") as file:
        text = json.dumps(head, indent=1)[:-2]
        file.write(text + ",\n \"machines\": [\n" + ",\n".join(json.dumps(machine) for machine in found) + "\n]}\n")
    print(f"{len(found)} machines, {len(left)} left out, {os.path.getsize(arguments.out)} bytes")


def reference(machine, variant, text, record, start, end):
    columns = []
    for key, names in record.items():
        values = [expected(machine, solved, key) for solved in (start, end)]
        if key[1] != "R" and values[0] is not None:
            columns += [(name, CLASS[key[1]], *(float(f"{v[i]:.16g}") for v in values)) for i, name in enumerate(names)]
    lines = [line for line in text.split("\n") if not line.startswith("output R")]
    return {
        "seed": machine.seed, "kind": machine.kind, "variant": variant, "text": "\n".join(lines),
        "names": " ".join(c[0] for c in columns), "class": "".join(c[1][0] for c in columns),
        "scales": [[float(f"{solved[c]:.3g}") for c in START] for solved in (scales(machine, start), scales(machine, end))],
        "start": [c[2] for c in columns], "end": [c[3] for c in columns],
    }


# Growth.

def row(n, branches):
    """A chain, or a tree with two branches at each body, of hinges about axes in turn."""
    lines = ["World:world -> 1[frame]:f0"]
    for k in range(1, n + 1):
        axis = ["[1, 0, 0]", "[0, 1, 0]", "[0, 0, 1]"][k % 3]
        parent = k - 1 if branches == 1 else k // 2
        lines.append(f"f{parent} -> Revolute:j{k}(n = {axis}, q0 = 0.{k % 7 + 1}) -> FixedTranslation:d{k}(d = [0.3, {0.1 if k % 2 else -0.1}, -0.2]) -> 1[frame]:f{k}")
        lines.append(f"f{k} -> Body:b{k}(m = 1, J = diag([0.1, 0.12, 0.08]), c = [0.1, 0, 0])")
    return "model Row\nimport std.multibody\n" + "\n".join(lines) + "\n"


def growth(arguments):
    folder = arguments.keep or "/tmp/random_trees"
    os.makedirs(folder, exist_ok=True)
    stages = ["bond_graph", "causal_graph", "equations", "program", "code", "start", "run"]
    print("machine  bodies  instructions  command_ms  " + "  ".join(stages))
    for name, branches in (("chain", 1), ("binary", 2)):
        for n in arguments.bodies:
            path = os.path.join(folder, f"{name}_{n}.bond")
            with open(path, "w") as file:
                file.write(row(n, branches))
            began = time.monotonic()
            try:
                done = subprocess.run([arguments.binary, "simulate", path, "--to", "1ms", "--solver", "rk4", "--step", "1ms", "--record", "j1.angle", "--timings", "--out", os.path.join(folder, "row.csv")], capture_output=True, text=True, timeout=arguments.longest)
            except subprocess.TimeoutExpired:
                print(f"{name:8} {n:5}  no end after {arguments.longest} s", flush=True)
                continue
            took = 1e3*(time.monotonic() - began)
            cells = [[c.strip() for c in line.replace("│", "┆").split("┆")[1:-1]] for line in done.stderr.split("\n") if "┆" in line]
            table = {c[0]: c[1] for c in cells if len(c) > 1}
            print(f"{name:8} {n:5} {table.get('rates', done.stderr[-200:]):>12} {took:10.0f}   " + "  ".join(f"{float(table.get(s, 'nan')):.1f}" for s in stages), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("campaign", "one", "references", "growth"):
        command = commands.add_parser(name)
        command.add_argument("--binary", default="halfarrow")
        command.add_argument("--keep", help="folder for the texts")
        if name == "campaign":
            command.add_argument("--from", dest="first", type=int, default=0)
            command.add_argument("--count", type=int, default=1000)
            command.add_argument("--verbose", action="store_true")
            command.add_argument("--log")
        elif name == "one":
            command.add_argument("seed", type=int)
        elif name == "references":
            command.add_argument("out")
            command.add_argument("--count", type=int, default=40)
        else:
            command.add_argument("bodies", type=int, nargs="*", default=[1, 10, 50, 200])
            command.add_argument("--longest", type=float, default=600, help="s, for one command")
    arguments = parser.parse_args()
    {"campaign": campaign, "one": one, "references": references, "growth": growth}[arguments.command](arguments)


if __name__ == "__main__":
    main()
