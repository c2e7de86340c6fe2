#!/usr/bin/env python3
"""Understeer of the sedan beside a single-track model with the stiffnesses of its axles.

    python3 understeer.py --program halfarrow

`steady.bond` goes round a circle of 100 m at one speed after another; of each the end counts, where it is steady. All gradients
are slopes at no lateral acceleration, by polynomials through these ends. Needs numpy.

A single-track model says K = m/l (l_r/C_f - l_f/C_r). With the torque T to the outside that the tyres of a unit of acceleration
have about the car's middle beside their side forces, by aligning and by forces forward left and right, it is
K = ((m l_r + T)/C_f - (m l_f - T)/C_r)/l. To it come the angles by which the axles are steered without the steering
wheel: by roll, in front and behind, and by the servo of the rack, which gives way under the aligning torque. Their sum has to be
the gradient of the steering wheel, times the ratio of steering, which a run at a standstill gives.
"""

import argparse
import csv
import pathlib
import subprocess
import tempfile

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
WHEELS = ("fl", "fr", "rl", "rr")
HOLD, SPEEDS, WHEELBASE, RADIUS, PINION = 8.0, 7, 2.776, 100.0, 0.05
PLACES = ["car.x", "car.y", "car.yaw"] + [f"car.{w}.tyre.{what}" for w in WHEELS for what in ("x", "y", "Fx", "Fy", "Mz")]
TURNED = [f"car.{w}.wheel.b.R[{k},2]" for w in WHEELS for k in (1, 2, 3)] + [f"car.floating.turning.b.R[{i},{k}]" for i in (1, 2, 3) for k in (1, 2, 3)]


def simulated(program, folder, model, *words, record):
    path = folder / f"{model}.csv"
    command = [program, "simulate", HERE / f"{model}.bond", "--solver", "rk4", "--step", "1e-3", "--out", path, "--record", ",".join([*record, *TURNED]), *words]
    subprocess.run([*map(str, command)], check=True, stdout=subprocess.DEVNULL)
    with open(path) as file:
        rows = list(csv.reader(file))
    values = np.array(rows[1:], dtype=float)
    return {name: values[:, k] for k, name in enumerate(rows[0])}


def steered(run, wheel):
    """Angle by which a wheel is turned against the hull, to the left."""
    hull = np.array([[run[f"car.floating.turning.b.R[{i},{k}]"] for k in (1, 2, 3)] for i in (1, 2, 3)])
    axis = np.einsum("ikt,it->kt", hull, np.array([run[f"car.{wheel}.wheel.b.R[{k},2]"] for k in (1, 2, 3)]))
    return np.arctan2(-axis[0], axis[1])


def axle(run, end):
    return (steered(run, end + "l") + steered(run, end + "r")) / 2


def couple(run):
    """Torque to the left about the middle of the car that wheels exert beside the side forces at the middles of the axles."""
    total = 0.0
    for wheel in WHEELS:
        angle, yaw = steered(run, wheel), run["car.yaw"]
        of = lambda what: run[f"car.{wheel}.tyre.{what}"]
        dx, dy = of("x") - run["car.x"], of("y") - run["car.y"]
        x, y = dx * np.cos(yaw) + dy * np.sin(yaw), dy * np.cos(yaw) - dx * np.sin(yaw)
        forward, left = of("Fx") * np.cos(angle) - of("Fy") * np.sin(angle), of("Fx") * np.sin(angle) + of("Fy") * np.cos(angle)
        axle = (1 if wheel[0] == "f" else -1) * WHEELBASE / 2
        total = total + of("Mz") - y * forward + x * left - axle * of("Fy")
    return total


def main():
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--program", default="halfarrow", help="the program halfarrow")
    program = words.parse_args().program
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        turn = folder / "steer.csv"
        turn.write_text("t,steer\n0,0\n1,0\n1.5,0.16\n")
        still = simulated(program, folder, "sedan", "--set", "u0=0", "--to", 1.5, "--every", 0.01, "--input", f"steer={turn}", record=["car.rack.way"])
        outputs = "steering rack speed lateral roll slip_front slip_rear side_front side_rear load_front load_rear".split() + PLACES
        run = simulated(program, folder, "steady", "--to", HOLD * SPEEDS, "--every", HOLD / 100, "--set", f"hold={HOLD}", "--set", f"radius={RADIUS}", record=outputs)

    # The first speed is left out: the car has just come into the bend.
    at = [int(np.argmin(np.abs(run["t"] - (HOLD * (k + 1) - 0.08)))) for k in range(1, SPEEDS)]
    lateral = run["lateral"][at]
    slope = lambda values: np.polyfit(lateral, values, 3)[-2]
    of = lambda values: slope(np.asarray(values)[at])

    # Angle of the front wheels over the way of the rack, where they stand as on the circle.
    way, angle = -still["car.rack.way"], axle(still, "f")
    cubic = np.polyfit(way[way > 1e-5], angle[way > 1e-5], 3)
    per_way = np.polyval(np.polyder(cubic), -run["rack"][at[0]])
    ratio = PINION * per_way

    # What is left of the way to the circle, some 1e-4 of its curvature, is taken into account.
    left = WHEELBASE * (1 / RADIUS - run["lateral"] / run["speed"] ** 2)
    total = ratio * of(run["steering"]) + of(left)
    servo = ratio * of(run["steering"] + run["rack"] / PINION)
    roll_front = -(of(axle(run, "f")) - per_way * of(-run["rack"]))
    roll_rear = of(axle(run, "r"))
    slips = of(run["slip_rear"] - run["slip_front"] + left)

    # The single-track model: loads at no acceleration, stiffness of an axle by its force over its slip.
    weights = [np.polyfit(lateral, run[f"load_{end}"][at], 3)[-1] for end in ("front", "rear")]
    front, rear = (w / 9.81 for w in weights)
    stiff_front, stiff_rear = (-of(run[f"side_{end}"]) / of(run[f"slip_{end}"]) for end in ("front", "rear"))
    moved = -of(couple(run)) / WHEELBASE
    plain = front / stiff_front - rear / stiff_rear
    model = (front + moved) / stiff_front - (rear - moved) / stiff_rear

    milli = lambda value: f"{value * 1e3:7.3f} mrad per m/s2"
    print(f"lateral accelerations {', '.join(f'{a:.2f}' for a in lateral)} m/s2")
    print(f"steering wheel              {milli(total / ratio)}")
    print(f"ratio of steering           {ratio:7.4f}")
    print(f"masses on the axles         {front:.1f} and {rear:.1f} kg; stiffnesses {stiff_front / 1e3:.2f} and {stiff_rear / 1e3:.2f} kN/rad")
    print(f"roll                        {of(run['roll']) * 1e3:7.3f} mrad per m/s2")
    print(f"at the road wheels: K       {milli(total)}, of it")
    print(f"  servo of the rack         {milli(servo)}")
    print(f"  roll steer in front       {milli(roll_front)}")
    print(f"  roll steer behind         {milli(roll_rear)}")
    print(f"  slip of the tyres         {milli(slips)}; by the single-track model {milli(model)}, without the torque {milli(plain)}")
    predicted = model + servo + roll_front + roll_rear
    print(f"single-track model with these: {milli(predicted)}, {100 * (predicted / total - 1):.1f} % off")


if __name__ == "__main__":
    main()
