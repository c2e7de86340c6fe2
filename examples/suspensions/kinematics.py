"""Kinematics of the suspensions of this folder, from their points alone: writes kinematics.csv.

Each rigid body has six unknowns, place and rotation vector; rods, guides and the travel of the wheel are equations between points,
which scipy solves. Nothing of the models is used but their numbers, which are read from the text.
"""

import ast
import csv
import re
from pathlib import Path

import numpy as np
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

HERE = Path(__file__).parent
RADIUS = 0.3
G = 9.81
TRAVELS = [0.02 * i for i in range(-4, 5)]
MIRROR = np.array([1, -1, 1])


def numbers(model, instance):
    """The arguments `name = number or list` of an instance."""
    text = (HERE / f"{model}.bond").read_text()
    arguments = re.search(rf":{instance}\((.*?)\)\n", text, re.S)[1]
    found = re.findall(r"(\w+) = (\[\[.*?\]\]|\[.*?\]|[-\d.e]+)", arguments, re.S)
    return {name: np.array(ast.literal_eval(value), float) for name, value in found}


def solved(equations, n, start):
    x, _, ok, why = fsolve(equations, start, full_output=True, xtol=1e-13)
    assert np.abs(equations(x)).max() < 1e-11, why
    assert len(x) == n
    return x


def moved(x, point):
    """Where a point of a body is, after its motion x."""
    return Rotation.from_rotvec(x[3:6]).apply(point) + x[:3]


def kept(x, inner, outer):
    """A rod from the car to the body keeps its length, here by squares."""
    d, d0 = moved(x, outer) - inner, outer - inner
    return (d @ d - d0 @ d0) / (2 * np.sqrt(d0 @ d0))


def across(n):
    """Two directions across n."""
    u = np.linalg.svd(n.reshape(1, 3))[2]
    return u[1], u[2]


# What each suspension asks of the motion x of the part that carries the wheel: five equations.
def double_wishbone(p, x):
    arms = [("lower_front", "lower_outer"), ("lower_back", "lower_outer"), ("upper_front", "upper_outer"), ("upper_back", "upper_outer")]
    return [kept(x, p[i], p[o]) for i, o in arms + [("tie_inner", "tie_outer")]]


def mcpherson(p, x):
    rods = [kept(x, p[i], p["arm_outer"]) for i in ("arm_front", "arm_back")]
    # The top of the strut, seen from the upright, stays on the strut's axis.
    top = Rotation.from_rotvec(x[3:6]).inv().apply(p["strut_top"] - x[:3]) - p["strut_foot"]
    guide = [top @ u for u in across(p["strut_top"] - p["strut_foot"])]
    return [*rods, *guide, kept(x, p["tie_inner"], p["tie_outer"])]


def five_link(p, x):
    return [kept(x, i, o) for i, o in zip(p["inner"], p["outer"])]


def trailing_arm(p, x):
    inner, axis = p["hinge_inner"], p["hinge_outer"] - p["hinge_inner"]
    # Its hinge stays, and it turns about nothing else.
    return [*(moved(x, inner) - inner), *(x[3:6] @ u for u in across(axis))]


def swung(p, x, arm, point):
    """Where a point of an arm is: the arm turns about its hinge as its ball joint at the upright tells."""
    front, back, outer = (p[f"{arm}_{end}"] for end in ("front", "back", "outer"))
    axis = (back - front) / np.linalg.norm(back - front)
    drawn, now = outer - front, moved(x, outer) - front
    angle = np.arctan2(axis @ np.cross(drawn, now), drawn @ now - (axis @ drawn) ** 2)
    return front + Rotation.from_rotvec(angle * axis).apply(point - front)


# The ends of the spring now, and the parts with their masses and centres.
def parts_of(model, p, x):
    upright = [(p["m_upright"], moved(x, p["c_upright"]))] if "m_upright" in p else []
    if model == "double_wishbone":
        ends = p["spring_top"], swung(p, x, "lower", p["spring_foot"])
        return ends, [*upright, *((p[f"m_{arm}"], swung(p, x, arm, p[f"c_{arm}"])) for arm in ("lower", "upper"))]
    if model == "mcpherson":
        return (p["strut_top"], moved(x, p["strut_foot"])), [*upright, (p["m_arm"], swung(p, x, "arm", p["c_arm"]))]
    if model == "trailing_arm":
        upright = [(p["m_arm"], moved(x, p["c_arm"]))]
    return (p["spring_top"], moved(x, p["spring_foot"])), upright


def stance(x, spindle, side=1):
    """Camber, toe and way of the contact of a wheel, as the bench measures them."""
    axis = Rotation.from_rotvec(x[3:6]).apply([0, 1, 0])
    down = np.array([0, 0, -1]) + axis[2] * axis
    contact = moved(x, spindle) + RADIUS * down / np.linalg.norm(down)
    return [-side * np.arcsin(axis[2]), side * np.arctan2(axis[0], axis[1]), side * (contact[1] - spindle[1])]


def slope(energy, z, h=1e-3):
    """The derivative of what is smooth, by differences of order 6."""
    return (45 * (energy(z + h) - energy(z - h)) - 9 * (energy(z + 2 * h) - energy(z - 2 * h)) + energy(z + 3 * h) - energy(z - 3 * h)) / (60 * h)


def independent(model, law):
    p = numbers(model, "arms")

    def at(z):
        return solved(lambda x: [*law(p, x), moved(x, p["spindle"])[2] - p["spindle"][2] - z], 6, np.zeros(6))

    def energy(z):
        (top, foot), parts = parts_of(model, p, at(z))
        return p["k"] / 2 * (np.linalg.norm(foot - top) - p["l0"]) ** 2 + G * sum(m * c[2] for m, c in parts)

    return [[*stance(at(z), p["spindle"]), slope(energy, z)] for z in TRAVELS]


def steered():
    """The McPherson strut at its height as drawn, with the rack moved to the left."""
    drawn = numbers("mcpherson", "arms")

    def at(rack, z):
        def equations(x):
            d, d0 = moved(x, drawn["tie_outer"]) - drawn["tie_inner"] - [0, rack, 0], drawn["tie_outer"] - drawn["tie_inner"]
            return [*mcpherson(drawn, x)[:-1], np.linalg.norm(d) - np.linalg.norm(d0), moved(x, drawn["spindle"])[2] - drawn["spindle"][2] - z]

        return solved(equations, 6, np.zeros(6))

    def energy(x):
        (top, foot), parts = parts_of("mcpherson", drawn, x)
        return drawn["k"] / 2 * (np.linalg.norm(foot - top) - drawn["l0"]) ** 2 + G * sum(m * c[2] for m, c in parts)

    return [[*stance(at(rack, 0), drawn["spindle"]), slope(lambda z: energy(at(rack, z)), 0)] for rack in TRAVELS]


def rigid_axle(sign):
    p, b = numbers("rigid_axle", "axle"), numbers("rigid_axle", "bar")

    def at(left, right):
        def equations(x):
            heights = [moved(x, s)[2] - s[2] - z for s, z in ((p["spindle"], left), (p["spindle"] * MIRROR, right))]
            return [*(kept(x, i, o) for i, o in zip(p["inner"], p["outer"])), *heights]

        return solved(equations, 6, np.zeros(6))

    def arm(x, mirror):
        """The angle of an arm of the bar, about the y axis through its pivot."""
        end, foot = (b["arm_end"] - b["pivot"]) * mirror, moved(x, b["link_end"] * mirror)
        link = np.linalg.norm(b["link_end"] - b["arm_end"])
        pivot = b["pivot"] * [1, 0, 1]
        end = end + b["pivot"] * [0, 1, 0] * mirror
        return solved(lambda q: [np.linalg.norm(pivot + Rotation.from_rotvec([0, q[0], 0]).apply(end) - foot) - link], 1, [0.0])[0]

    def twist(x):
        return arm(x, np.ones(3)) - arm(x, MIRROR)

    def energy(left, right):
        x = at(left, right)
        springs = [np.linalg.norm(moved(x, p["spring_foot"] * m) - p["spring_top"] * m) - p["l0"] for m in (np.ones(3), MIRROR)]
        return p["k"] / 2 * (springs[0] ** 2 + springs[1] ** 2) + b["k"] / 2 * twist(x) ** 2 + G * p["m_axle"] * moved(x, p["c_axle"])[2]

    rows = []
    for z in TRAVELS:
        x = at(z, sign * z)
        # Tension of the left link: its moment about the pivot, by how its length changes with the angle of the arm, holds the bar.
        end = Rotation.from_rotvec([0, arm(x, np.ones(3)), 0]).apply(b["arm_end"] - b["pivot"] * [1, 0, 1])
        link = moved(x, b["link_end"]) - b["pivot"] * [1, 0, 1] - end
        moment = -link @ np.cross([0, 1, 0], end) / np.linalg.norm(link)
        rows.append([*stance(x, p["spindle"]), slope(lambda left: energy(left, sign * z), z), twist(x), -b["k"] * twist(x) / moment])
    return rows


def main():
    found = {law.__name__: independent(law.__name__, law) for law in (double_wishbone, mcpherson, trailing_arm, five_link)}
    found["mcpherson_steered"] = steered()
    found["rigid_axle"] = rigid_axle(1)
    found["rigid_axle_opposite"] = rigid_axle(-1)
    with open(HERE / "kinematics.csv", "w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["model", "travel", "camber", "toe", "track", "force", "twist", "link"])
        for model, rows in found.items():
            for z, row in zip(TRAVELS, rows):
                out.writerow([model, f"{z:.2f}", *(f"{round(v, 12) + 0:.10g}" for v in [*row, 0.0, 0.0][:6])])


main()
