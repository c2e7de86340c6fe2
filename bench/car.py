#!/usr/bin/env python3
"""The cars of the examples, a step of 1 ms, beside MuJoCo and pinocchio. See README.md."""

import json
import math
import os
import re
import statistics
import subprocess
import sys
import time

from nets import DRIVER as RATES
from nets import halfarrow, nanoseconds, ratio, scale
from run import MODELS, ROOT, ROUNDS, in_environment, row

SEDAN = ROOT / "examples" / "sedan"
ILTIS = ROOT / "examples" / "iltis"
CARS = {"sedan": SEDAN / "sedan.bond", "iltis": ILTIS / "flat.bond"}
INPUTS = {"sedan": f"steer={SEDAN / 'steer.csv'}", "iltis": f"rack={ILTIS / 'step.csv'}"}
CORNERS = {"fl": (1, 1), "fr": (1, -1), "rl": (-1, 1), "rr": (-1, -1)}

STEPS = r"""
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "NAME.h"
static NAME m;
static int order(const void *a, const void *b)
{
    const double d = *(const double *)a - *(const double *)b;
    return d > 0 ? 1 : d < 0 ? -1 : 0;
}
int main(int argc, char **argv)
{
    const long count = atol(argv[1]);
    double *times = malloc(count * sizeof *times);
    struct timespec from, to;
    long k;
    (void)argc;
    for (k = 0; k < count; ++k) {
        if (k % 20000 == 0 && (NAME_reset(&m) != 0 || NAME_start(&m, 0.0) != 0)) { return 1; } /* nothing drives it */
        m.u[0] = TURN; /* to and fro */
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &from);
        if (NAME_step(&m) != 0) { fprintf(stderr, "%g s: %s\n", m.t, NAME_message(&m)); return 2; }
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &to);
        times[k] = (to.tv_sec - from.tv_sec) * 1e9 + (to.tv_nsec - from.tv_nsec);
    }
    qsort(times, count, sizeof times[0], order);
    printf("{\"ns\": %.17g, \"p99\": %.17g, \"worst\": %.17g}\n", times[count / 2], times[count - count / 100], times[count - 1]);
    return 0;
}
"""
# Inputs at which a car goes in bends that it keeps on.
TURNS = {"sedan": "0.08 * sin(m.t)", "iltis": "0.003 * sin(m.t)"}


def timed(*command):
    """Seconds of a core that a command takes: others may use the server too."""
    before = os.times()
    subprocess.run([*map(str, command)], check=True, capture_output=True, text=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def exported(program, car, method):
    """Programs that time steps of a millisecond and rates of a car in exported C; what exporting and compiling it took."""
    folder = MODELS / f"car_{car}_{method}"
    export = timed(program, "export", "c", CARS[car], "--out", folder, "--method", method, "--step", "1e-3")
    name = next(folder.glob("*.h")).stem
    header = (folder / f"{name}.h").read_text()
    states = re.search(r"double x\[(\d+)\];", header).group(1)
    (folder / "rates.c").write_text(RATES.replace("CLOCK_MONOTONIC", "CLOCK_THREAD_CPUTIME_ID").replace("NAME", name).replace("STATES", states))
    (folder / "steps.c").write_text(STEPS.replace("NAME", name).replace("TURN", TURNS[car]))
    code = folder / f"{name}.o"
    compile_ = timed("cc", "-O2", "-Wall", "-ffp-contract=off", "-c", "-o", code, folder / f"{name}.c")
    for driver in ("rates", "steps"):
        timed("cc", "-O2", "-w", "-I", folder, "-o", folder / driver, folder / f"{driver}.c", code, "-lm")
    return {"steps": folder / "steps", "rates": folder / "rates", "export": export, "compile": compile_, "size": code.stat().st_size}


def numbers(text, name):
    found = re.search(rf"\b{name} = (\[[^\]]*\]|[-\d.e]+)", text).group(1)
    return json.loads(re.sub(r"(?<=[\[ ,])(-?)\.", r"\g<1>0.", found))


def mjcf(tie):
    """The sedan for MuJoCo, with the numbers that stand in its files: arms on hinges, uprights on ball joints, upper ball joints by
    `connect`, springs as tendons, wheels that touch a plane in one point. Tie rods are tendons of fixed length, or (`rod`) bodies
    of half a kilogram between a Cardan joint and a ball joint."""
    corner, car = (SEDAN / "corner.bond").read_text(), (SEDAN / "car.bond").read_text()
    radius = float(re.search(r"UNLOADED_RADIUS += ([\d.]+)", (SEDAN / "sedan_tyre.tir").read_text()).group(1))
    n = lambda name: numbers(corner, name)
    words = lambda v: " ".join(f"{x:.17g}" for x in v)
    minus = lambda a, b: [x - y for x, y in zip(a, b)]
    inertial = lambda c, part: f'<inertial pos="{words(c)}" mass="{n("m_" + part)}" diaginertia="{words(n("J_" + part))}"/>'
    front = json.loads(re.search(r"to_front\(d = (\[.*?\])", car).group(1))
    hull = re.search(r"hull\(m = (\d+), J = diag\((\[.*?\])\), c = (\[.*?\])", car)
    rod = re.search(r"rod\(m = ([\d.]+), J = diag\((\[.*?\])\), c = (\[.*?\])", car)
    wheel = re.search(r"wheel\(m = ([\d.]+), J_axle = ([\d.]+), J_across = ([\d.]+)", corner)
    # That of the shaft, more than a body may have, turns with the joint.
    axle, across_axle = float(wheel[2]), float(wheel[3])
    z0 = re.search(r"z0 = ([\d.]+)", car).group(1)
    servo = re.search(r"servo\(-([\de.]+)\*", car).group(1)
    friction = re.search(r"friction\(([\de.]+)\)", car).group(1)
    bodies, equalities, tendons, ties = [], [], [], {}
    for name, (end, side) in CORNERS.items():
        at = lambda key: [n(key)[0], side * n(key)[1], n(key)[2]]
        place = [end * front[0], 0.0, front[2]]
        lf, lo, uf, uo = map(at, ("lower_front", "lower_outer", "upper_front", "upper_outer"))
        seen = lambda v: words([a + b for a, b in zip(place, v)])
        inner, outer = at("tie_inner"), at("tie_outer")
        ends = f'<site name="tie_outer_{name}" pos="{words(minus(outer, lo))}"/>'
        if tie == "rod":
            d = minus(outer, inner)
            across = [-d[1], d[0], 0.0]
            ends += f'<site name="free_{name}" pos="{words(minus(outer, lo))}"/>'
            link = (
                f'<body name="tie_{name}" pos="{words(inner)}"><joint type="hinge" axis="{words(across)}"/><joint type="hinge" axis="0 0 1"/>'
                f'<inertial pos="{words([x / 2 for x in d])}" mass="0.5" diaginertia="0.005 0.005 0.005"/></body>'
            )
            equalities.append(f'<connect body1="tie_{name}" body2="upright_{name}" anchor="{words(d)}"/>')
        else:
            link = f'<site name="tie_inner_{name}" pos="{words(inner)}"/>'
            tendons.append(f'<spatial name="tie_{name}"><site site="tie_inner_{name}"/><site site="tie_outer_{name}"/></spatial>')
            equalities.append(f'<tendon tendon1="tie_{name}"/>')
        ties[name] = link if end == 1 else link.replace(words(inner), seen(inner))
        bodies.append(
            f'<site name="spring_top_{name}" pos="{seen(at("spring_top"))}"/>'
            f'<body name="lower_{name}" pos="{seen(lf)}"><joint name="lower_{name}" type="hinge" axis="{words(minus(at("lower_back"), lf))}"/>'
            + inertial(minus(at("c_lower"), lf), "lower")
            + f'<site name="spring_foot_{name}" pos="{words(minus(at("spring_foot"), lf))}"/>'
            f'<body name="upright_{name}" pos="{words(minus(lo, lf))}"><joint type="ball"/>'
            + inertial(minus(at("c_upright"), lo), "upright")
            + ends
            + f'<body name="wheel_{name}" pos="{words(minus(at("spindle"), lo))}"><joint name="wheel_{name}" type="hinge" axis="0 1 0" armature="{axle - 2 * across_axle}"/>'
            f'<inertial pos="0 0 0" mass="{wheel[1]}" diaginertia="{across_axle} {2 * across_axle} {across_axle}"/>'
            f'<geom type="ellipsoid" size="{radius} 0.1 {radius}"/></body></body></body>'
            f'<body name="upper_{name}" pos="{seen(uf)}"><joint type="hinge" axis="{words(minus(at("upper_back"), uf))}"/>'
            + inertial(minus(at("c_upper"), uf), "upper")
            + "</body>"
        )
        equalities.append(f'<connect body1="upper_{name}" body2="upright_{name}" anchor="{words(minus(uo, uf))}"/>')
        tendons.append(
            f'<spatial name="spring_{name}" stiffness="{n("k")}" springlength="{n("l0")}" damping="{n("c")}">'
            f'<site site="spring_top_{name}"/><site site="spring_foot_{name}"/></spatial>'
        )
    rack = (
        f'<body name="rack" pos="{words(front)}"><joint name="rack" type="slide" axis="0 1 0"/>'
        f'<inertial pos="{words(json.loads(rod[3]))}" mass="{rod[1]}" diaginertia="{words(json.loads(rod[2]))}"/>{ties["fl"]}{ties["fr"]}</body>'
    )
    # Bodies follow each other in the order of the file, sites of the rear tie rods are the hull's.
    return (
        '<mujoco model="sedan"><compiler angle="radian"/><default><equality solref="0.002 1"/></default>'
        '<option timestep="0.001" integrator="implicitfast"/>'
        f'<worldbody><geom type="plane" size="0 0 1"/><body name="hull" pos="0 0 {z0}"><freejoint name="hull"/>'
        f'<inertial pos="{words(json.loads(hull[3]))}" mass="{hull[1]}" diaginertia="{words(json.loads(hull[2]))}"/>'
        + rack + "".join(bodies) + ties["rl"] + ties["rr"]
        + "</body></worldbody><equality>" + "".join(equalities) + "</equality><tendon>" + "".join(tendons) + "</tendon>"
        f'<actuator><position joint="rack" kp="{servo}" kv="{friction}"/></actuator></mujoco>'
    )


def mujoco_sedan():
    """The sedan in MuJoCo: a function that times so many steps of a run in bends, and how it stands: angles of the lower arms, and
    by how much the loops are open at most."""
    import mujoco
    import numpy as np

    machine = mujoco.MjModel.from_xml_string(mjcf("tendon"))
    data = mujoco.MjData(machine)

    def begin():
        mujoco.mj_resetData(machine, data)
        data.qvel[0] = 20.0
        for name in CORNERS:
            data.qvel[machine.joint(f"wheel_{name}").dofadr[0]] = 20.0 / 0.34

    def steps(count):
        times, touching = np.empty(count), 0
        for k in range(count):
            if k % 20000 == 0:  # nothing drives it
                begin()
            data.ctrl[0] = -0.05 * 0.08 * math.sin(data.time)
            from_ = time.thread_time_ns()
            mujoco.mj_step(machine, data)
            times[k] = time.thread_time_ns() - from_
            touching += data.ncon
        assert np.isfinite(data.qpos).all() and abs(data.qpos[2]) < 0.5, "MuJoCo's car is lost"
        assert touching > 3.5 * count, f"of MuJoCo's wheels {touching / count:.2f} touch"
        return {"ns": float(np.median(times)), "p99": float(np.percentile(times, 99)), "worst": float(times.max())}

    mujoco.mj_step(machine, data, nstep=5000)
    arms = [float(data.qpos[machine.joint(f"lower_{name}").qposadr[0]]) for name in CORNERS]
    loops = data.efc_pos[: data.ne]
    return steps, arms, float(np.abs(loops).max()), machine.nv, data.ne


def pinocchio_sedan():
    """The same for pinocchio, read from the same text: functions that time accelerations of the tree, and with its loops closed."""
    import numpy as np
    import pinocchio as pin

    def read(tie):
        path = MODELS / f"sedan_{tie}.xml"
        path.write_text(mjcf(tie))
        machine, loops = pin.buildModelAndLegacyConstraintsFromMJCF(str(path))[:2]
        q = next(v for k, v in machine.referenceConfigurations.items()) if hasattr(machine.referenceConfigurations, "items") else pin.neutral(machine)
        return machine, machine.createData(), loops, q, np.full(machine.nv, 0.1), np.zeros(machine.nv)

    tree, data, _, q, v, tau = read("tendon")
    closed, work, loops, q_closed, v_closed, tau_closed = read("rod")
    held = pin.StdVec_RigidConstraintData()
    for loop in loops:
        held.append(loop.createData())
    pin.initConstraintDynamics(closed, work, loops, held)
    settings = pin.ProximalSettings(1e-10, 1e-10, 10)

    def timer(call):
        def nanoseconds(count):
            from_ = time.thread_time()
            for _ in range(count):
                call()
            return (time.thread_time() - from_) / count * 1e9

        return nanoseconds

    return (
        timer(lambda: pin.aba(tree, data, q, v, tau)),
        timer(lambda: pin.constraintDynamics(closed, work, q_closed, v_closed, tau_closed, loops, held, settings)),
        tree.nv,
        closed.nv,
        sum(3 for _ in loops),
    )


def micro(ns):
    return f"{ns / 1e3:.1f} µs"


def commands(program):
    """Whole commands, and what a second more of the model takes in them."""
    print("\nWhole commands, steps of 1 ms by rk4, seconds of a core, medians of", ROUNDS, "rounds\n")
    row("car", "`check`", "`simulate` to 1 ms", "to 3 s, bytecode", "a step", "to 3 s, machine code", "a step", "`sweep` of 16 cars, 0.3 s", "a step of a car")
    row(*["---"] * 9)
    for car, path in CARS.items():
        run = ("simulate", path, "--solver", "rk4", "--step", "1e-3", "--every", 0.02, "--out", MODELS / f"{car}.csv")
        sweep = ("sweep", path, "--vary", "u0=lin(15,25,16)", "--step", "1ms", "--every", 0.1, "--out", MODELS / f"{car}_sweep.csv", "--restart")
        ways = {
            "check": ("check", path),
            "short": (*run, "--to", 0.001, "--exec", "bytecode"),
            "bytecode": (*run, "--to", 3, "--exec", "bytecode"),
            "begun": (*run, "--to", 1, "--exec", "machine"),
            "machine": (*run, "--to", 3, "--exec", "machine"),
            "few": (*sweep, "--to", 0.1),
            "sweep": (*sweep, "--to", 0.3),
        }
        found = {way: statistics.median(timed(program, *words) for _ in range(ROUNDS)) for way, words in ways.items()}
        a = (found["bytecode"] - found["short"]) / 2999
        b = (found["machine"] - found["begun"]) / 2000
        c = (found["sweep"] - found["few"]) / (16 * 200)
        second = lambda way: f"{found[way]:.1f} s"
        row(car, second("check"), second("short"), second("bytecode"), micro(a * 1e9), second("machine"), micro(b * 1e9), second("sweep"), micro(c * 1e9))


def steps(program):
    """Steps of exported C in turns with those of MuJoCo; accelerations in turns with those of pinocchio."""
    count = 100_000
    peer, arms, open_, speeds, equations = mujoco_sedan()
    print(f"\nMuJoCo's sedan: {speeds} speeds, {equations} equations of loops; lower arms at rest at {', '.join(f'{a:.4f}' for a in arms)} rad;")
    print(f"its loops are open by {open_ * 1e3:.2f} mm at most")
    print("\nA step of 1 ms, of", count, "in bends at 20 m/s, time of the processor; medians of", ROUNDS, "rounds in turns, the worst of all\n")
    row("", "median", "99 %", "worst", "against MuJoCo", "export", "compiled", "object")
    row(*["---"] * 8)
    made = {}
    for car in CARS:
        for method in ("rk4", "linearly_implicit_bdf2"):
            try:
                made[car, method] = exported(program, car, method)
            except subprocess.CalledProcessError as error:
                print(f"{car}, {method}: {error.stderr.strip().splitlines()[0]}")
    found = {key: [] for key in [*made, "MuJoCo"]}
    for _ in range(ROUNDS):
        for key in list(found):
            try:
                found[key].append(peer(count) if key == "MuJoCo" else nanoseconds(made[key]["steps"], count))
            except subprocess.CalledProcessError as error:
                print(f"{key[0]}, {key[1]}: {error.stderr if error.stderr else error}")
                del found[key]
    middle = lambda key, what: statistics.median(one[what] for one in found[key])
    base = middle("MuJoCo", "ns")
    for key in found:
        cost = [""] * 3 if key == "MuJoCo" else [f"{made[key]['export']:.1f} s", f"{made[key]['compile']:.1f} s", f"{made[key]['size'] / 1e6:.2f} MB"]
        name = key if key == "MuJoCo" else f"{key[0]}, {key[1]}"
        row(name, micro(middle(key, "ns")), micro(middle(key, "p99")), micro(max(one["worst"] for one in found[key])), ratio(middle(key, "ns"), base), *cost)

    aba, closed, tree, speeds, equations = pinocchio_sedan()
    names = [f"{car}, rates in exported C" for car in CARS] + [f"pinocchio, aba, tree of {tree} speeds", f"pinocchio, constraintDynamics, {speeds} speeds, {equations} equations"]
    times = {name: [] for name in names}
    for _ in range(ROUNDS):
        for car in CARS:
            times[f"{car}, rates in exported C"].append(nanoseconds(made[car, "rk4"]["rates"], 500)["ns"])
        times[names[-2]].append(aba(20000))
        times[names[-1]].append(closed(10000))
    print("\nOne evaluation of the accelerations; ours have tyres, brakes and springs in them, pinocchio is called from Python\n")
    row("", "median", "against the sedan")
    row(*["---"] * 3)
    base = statistics.median(times[names[0]])
    for name in names:
        row(name, scale(statistics.median(times[name])), ratio(statistics.median(times[name]), base))


def lagrange(program):
    """The sedan with all storages as states and a multiplier for each constraint."""
    run = ("simulate", CARS["sedan"], "--solver", "radau", "--every", 0.02, "--out", MODELS / "lagrange.csv")
    print("\nThe sedan by radau at rtol 1e-6, 0.1 s, seconds of a core\n")
    row("form", "whole command")
    row(*["---"] * 2)
    for form in ("minimal", "lagrange"):
        words = (*run, "--to", 0.1, "--form", form)
        try:
            done = timed("timeout", 600, program, *words)
            row(form, f"{done:.1f} s")
        except subprocess.CalledProcessError as error:
            row(form, (error.stderr.strip().splitlines() or ["not there after 10 minutes"])[-1])


BENCHES = {"commands": commands, "steps": steps, "lagrange": lagrange}

if __name__ == "__main__":
    in_environment()
    MODELS.mkdir(exist_ok=True)
    chosen = sys.argv[1:] or list(BENCHES)
    program = halfarrow()
    for name in chosen:
        BENCHES[name](program)
