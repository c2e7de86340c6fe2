"""Checks FMUs with FMPy: python check.py PATH/TO/halfarrow [NAME...]

Each model is exported as FMI 2.0 and 3.0, validated against the schemas and the rules of the standard, and run:
co-simulation must give what `halfarrow simulate` gives with the same method, bit for bit; model exchange with CVODE what
it gives with tight tolerances. States are saved, restored and serialised in the middle, derivatives are compared with
differences, parameters are set, errors are provoked, sources are built again. What happens at events is compared with closed
forms too.
"""

import csv
import ctypes
import io
import math
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy
from fmpy import fmi2, fmi3, sundials
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[3]
STEP, EVERY, POINTS = 1e-3, 0.01, 40
FAULTS = []
# CMake stands beside this Python.
os.environ["PATH"] = str(Path(sys.executable).parent) + os.pathsep + os.environ["PATH"]

# Model, tolerance of model exchange relative to the greatest value of a variable (a delay or a contact costs digits).
MODELS = [
    (ROOT / "models/quarter_car/model.bond", 1e-5),
    (ROOT / "models/slider_crank/model.bond", 1e-5),
    (ROOT / "models/rc_bridge_diode/model.bond", 1e-5),
    (ROOT / "models/gearbox_ratio/model.bond", 1e-5),
    (ROOT / "models/source_jumps/model.bond", 1e-5),
    (ROOT / "models/series_springs/model.bond", 1e-5),
    (ROOT / "models/rectifier/model.bond", 1e-4),
    (HERE.parent / "models/contact.bond", 5e-4),
    (HERE.parent / "models/clock.bond", 1e-5),
    (HERE.parent / "models/sampled.bond", 1e-5),
    (HERE.parent / "models/delay.bond", 1e-4),
    (HERE.parent / "models/tables.bond", 1e-4),
    (HERE.parent / "models/bridge.bond", 1e-4),
    (HERE.parent / "models/mesh.bond", 1e-5),
    (HERE.parent / "models/names.bond", 1e-5),
    (HERE / "tuned.bond", 1e-5),
    (HERE / "controlled.bond", 1e-6),
    (HERE.parent / "models/when_sampled.bond", 1e-4),
    (HERE.parent / "models/when_beam.bond", 1e-5),
    (HERE.parent / "models/when_four_bar.bond", 1e-5),
    (HERE.parent / "models/unsteady_ratio.bond", 1e-5),
    (ROOT / "models/when_bouncing_ball/model.bond", 1e-5),
    (ROOT / "models/when_rimless_wheel/model.bond", 1e-5),
    (HERE / "belt.bond", 1e-5),
    (HERE / "drop.bond", 1e-5),
    (HERE / "phases.bond", 1e-5),
]
# Points of those that take longer.
LONGER = {"controlled": 100, "when_bouncing_ball": 300, "when_rimless_wheel": 1500}


right_side = sundials.CVodeSolver.f


def right_side_or_shorter(solver, t, y, ydot, data):
    """The right side for CVODE, which shortens its step where a point is discarded; FMPy alone would raise in a callback."""
    try:
        return right_side(solver, t, y, ydot, data)
    except FMICallException as error:
        return 1 if error.status == DISCARD else -1


sundials.CVodeSolver.f = right_side_or_shorter
DISCARD = 2


def fault(where, what):
    FAULTS.append(f"{where}: {what}")
    print(f"FAULT {where}: {what}")


def halfarrow(*arguments):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    # Steps may be too long for the model and refused by its audit: what was computed is written all the same.
    refused = done.returncode == 3 and "as the audit found" in done.stderr and done.stdout
    if not refused and done.returncode != 0:
        raise RuntimeError(f"halfarrow {' '.join(map(str, arguments))}\n{done.stderr}")
    return done.stdout


def trajectory(model, *arguments):
    text = halfarrow("simulate", model, "--to", POINTS / 100, "--every", EVERY, "--out", "-", *arguments)
    rows = list(csv.reader(io.StringIO(text)))
    return {name: [float(row[i]) for row in rows[1:]] for i, name in enumerate(rows[0])}


class Fmu:
    """An instance of either version, with what was logged."""

    def __init__(self, file, exchange=False, guid=None, events=False):
        self.description = fmpy.read_model_description(str(file))
        self.version = 2 if self.description.fmiVersion == "2.0" else 3
        self.folder = fmpy.extract(str(file))
        self.logged = []
        kind = self.description.modelExchange if exchange else self.description.coSimulation
        made = {
            "guid": guid or self.description.guid,
            "modelIdentifier": kind.modelIdentifier,
            "unzipDirectory": self.folder,
            "instanceName": "one",
        }
        classes = (fmi2.FMU2Slave, fmi2.FMU2Model) if self.version == 2 else (fmi3.FMU3Slave, fmi3.FMU3Model)
        self.api = classes[exchange](**made)
        if self.version == 2:
            callbacks = fmi2.fmi2CallbackFunctions()
            self.logger = fmi2.fmi2CallbackLoggerTYPE(lambda e, n, s, c, message: self.logged.append(message.decode()))
            callbacks.logger = self.logger
            callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
            callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
            self.callbacks = callbacks
            self.api.instantiate(callbacks=callbacks)
        else:
            more = {"eventModeUsed": True, "earlyReturnAllowed": True} if events else {}
            self.api.instantiate(logMessage=lambda e, s, c, message: self.logged.append(message.decode()), **more)
        self.variables = {v.name: v for v in self.description.modelVariables}

    def begin(self, values={}):
        if self.version == 2:
            self.api.setupExperiment(startTime=0.0)
        for name, value in values.items():
            self.set(name, value)
        self.api.enterInitializationMode()
        self.api.exitInitializationMode()

    def get(self, names):
        vr = [self.variables[n].valueReference for n in names]
        return list((self.api.getReal if self.version == 2 else self.api.getFloat64)(vr))

    def set(self, name, value):
        vr = [self.variables[name].valueReference]
        (self.api.setReal if self.version == 2 else self.api.setFloat64)(vr, [value])

    def save(self):
        return self.api.getFMUstate() if self.version == 2 else self.api.getFMUState()

    def restore(self, state):
        (self.api.setFMUstate if self.version == 2 else self.api.setFMUState)(state)

    def free(self, state):
        (self.api.freeFMUstate if self.version == 2 else self.api.freeFMUState)(state)

    def serialise(self, state):
        return self.api.serializeFMUState(state)

    def deserialise(self, data):
        return self.api.deSerializeFMUstate(data) if self.version == 2 else self.api.deserializeFMUState(data)

    def step(self, point):
        self.api.doStep(currentCommunicationPoint=point / 100, communicationStepSize=EVERY)

    def close(self):
        try:
            self.api.terminate()
        except Exception:
            pass  # it has not begun, or it has failed
        self.api.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


def recorded(fmu, reference):
    """Columns of our own trajectory that the FMU has in the same unit."""
    units = {name: v.displayUnit for name, v in fmu.variables.items()}
    return [name for name in reference if name in fmu.variables and name != "t" and units[name] is None]


def co_simulation(where, file, reference, values={}):
    fmu = Fmu(file)
    fmu.begin(values)
    names = recorded(fmu, reference)
    if not names:
        fault(where, "nothing to compare")
    rows = [fmu.get(names)]
    later = []
    for point in range(POINTS):
        if point == POINTS // 2:
            # A look ahead, back again, and the same through bytes.
            state = fmu.save()
            for ahead in range(3):
                fmu.step(point + ahead)
                later.append(fmu.get(names))
            fmu.restore(state)
            data = fmu.serialise(state)
            fmu.step(point)
            other = fmu.deserialise(data)
            fmu.restore(other)
            if fmu.serialise(other) != data:
                fault(where, "a state that was serialised is another one")
            fmu.free(state)
            fmu.free(other)
        fmu.step(point)
        rows.append(fmu.get(names))
    if later != rows[POINTS // 2 + 1:POINTS // 2 + 4]:
        fault(where, "the run goes on differently from a restored state")
    for i, name in enumerate(names):
        wanted = reference[name]
        differ = [k for k in range(POINTS + 1) if rows[k][i] != wanted[k]]
        if differ:
            k = differ[0]
            fault(where, f"{name} is {rows[k][i]!r} at {k / 100} s, but {wanted[k]!r}")
    fmu.close()


def event_mode(where, file, reference, happens):
    """Co-simulation of FMI 3 that returns where something happens has the values of the one that does not."""
    fmu = Fmu(file, events=True)
    fmu.begin()
    fmu.api.updateDiscreteStates()
    fmu.api.enterStepMode()
    names = recorded(fmu, reference)
    rows, events = [fmu.get(names)], 0
    for point in range(POINTS):
        t, end = point / 100, (point + 1) / 100
        while t < end - 1e-12:
            needed, _, early, reached = fmu.api.doStep(currentCommunicationPoint=t, communicationStepSize=end - t)
            if early and not needed:
                fault(where, f"a step returns at {reached} s without an event")
            if needed:
                events += 1
                fmu.api.enterEventMode()
                fmu.api.updateDiscreteStates()
                fmu.api.enterStepMode()
            t = reached
        rows.append(fmu.get(names))
    if happens and not events:
        fault(where, "no event was told")
    for i, name in enumerate(names):
        differ = [k for k in range(POINTS + 1) if abs(rows[k][i] - reference[name][k]) > 1e-9 * abs(reference[name][k]) + 1e-12]
        if differ:
            k = differ[0]
            fault(where, f"{name} is {rows[k][i]!r} at {k / 100} s, but {reference[name][k]!r}")
    fmu.close()
    # An input that jumps between two steps, and in event mode.
    inputs = [v.name for v in fmu.description.modelVariables if v.causality == "input"]
    ends = []
    for events in (False, True) if inputs else ():
        fmu = Fmu(file, events=events)
        fmu.begin()
        if events:
            fmu.api.updateDiscreteStates()
            fmu.api.enterStepMode()
        for point in range(10):
            if point == 5:
                if events:
                    fmu.api.enterEventMode()
                fmu.set(inputs[0], fmu.get(inputs[:1])[0] + 0.1)
                if events:
                    fmu.api.updateDiscreteStates()
                    fmu.api.enterStepMode()
            t, end = point / 100, (point + 1) / 100
            while t < end - 1e-12:
                t = fmu.api.doStep(currentCommunicationPoint=t, communicationStepSize=end - t)[3]
        ends.append(fmu.get(names))
        fmu.close()
    if ends and any(abs(a - b) > 1e-12 * abs(a) + 1e-15 for a, b in zip(*ends)):
        fault(where, f"an input that jumps in event mode leads to {ends[1]}, between two steps to {ends[0]}")


def ball(t):
    """Height, speed and impacts of the ball: parabolas between impacts."""
    g, e, at, speed, n = 9.81, 0.8, 0.0, 0.0, 0
    lands = math.sqrt(2 / g)
    while lands < t:
        at, speed, n = lands, e * (g * (lands - at) - speed if n else g * lands), n + 1
        lands = at + 2 * speed / g
    passed = t - at
    return [(1.0 if n == 0 else 0.0) + speed * passed - 0.5 * g * passed**2, speed - g * passed, n]


def controlled(t):
    """The mass between samples: a constant force."""
    m, kp, kd, period = 2.0, 20.0, 12.0, 0.02
    x, v = 1.0, 0.0
    count = math.floor(t / period + 1e-9)
    for _ in range(count):
        u = -kp * x - kd * v
        x, v = x + v * period + u / (2 * m) * period**2, v + u / m * period
    u, passed = -kp * x - kd * v, t - count * period
    return [x + v * passed + u / (2 * m) * passed**2, v + u / m * passed, u, count + 1]


def wheel(theta, speed):
    """The square of the speed that the spoke began with, which energy tells."""
    alpha, gamma, g = 0.4, 0.08, 9.81
    return speed**2 + 2 * g * (math.cos(theta) - math.cos(gamma - alpha))


def closed_form(where, name, at, tolerance):
    """What a run gives at times, by name of the variable, against what is known."""
    if name == "when_bouncing_ball":
        found = [(t, [values[n] for n in ("h", "ball.f", "n")], ball(t)) for t, values in at]
    elif name == "controlled":
        found = [(t, [values[n] for n in ("x", "mass.f", "u", "samples")], controlled(t)) for t, values in at]
    else:
        alpha, gamma, g = 0.4, 0.08, 9.81
        begun, squares = wheel(gamma - alpha, 1.2), []
        for _ in range(100):
            squares.append(begun)
            begun = math.cos(2 * alpha) ** 2 * (begun + 4 * g * math.sin(gamma) * math.sin(alpha))
        found = [(t, [wheel(values["theta"], values["leg.f"])], [squares[round(values["steps"])]]) for t, values in at]
        if not found or max(values["steps"] for _, values in at) < 5:
            fault(where, "the wheel has not walked")
    for t, values, wanted in found:
        if any(abs(a - b) > tolerance * max(1.0, abs(b)) for a, b in zip(values, wanted)):
            fault(where, f"at {t} s {values}, but {wanted}")
            break


def of_closed_form(where, name, file):
    """Both ways of running an FMU against closed forms; variables by co-simulation, and by CVODE."""
    fmu = Fmu(file)
    fmu.begin()
    names = [n for n, v in fmu.variables.items() if v.causality in ("local", "output") and "der(" not in n and "indicator" not in n]
    at = [(0.0, dict(zip(names, fmu.get(names))))]
    for point in range(POINTS):
        fmu.step(point)
        at.append(((point + 1) / 100, dict(zip(names, fmu.get(names)))))
    fmu.close()
    # The wheel follows no polynomial, the others do.
    closed_form(where + " co-simulation", name, at, 1e-8)
    result = fmpy.simulate_fmu(
        str(file), fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-10, stop_time=POINTS / 100,
        output_interval=EVERY, output=names, record_events=False)
    at = [(t, dict(zip(names, list(row)[1:]))) for t, row in zip(result["time"], result)]
    closed_form(where + " model exchange", name, at, 1e-6)


def variable_steps(where, file):
    """A communication step that is no multiple of the step: two halves are near to a whole."""
    whole, halves = Fmu(file), Fmu(file)
    whole.begin()
    halves.begin()
    names = [n for n, v in whole.variables.items() if v.causality in ("local", "output") and "der(" not in n and "indicator" not in n]
    length = 2.5e-3
    whole.api.doStep(0.0, 2 * length)
    halves.api.doStep(0.0, length)
    halves.api.doStep(length, length)
    for name, a, b in zip(names, whole.get(names), halves.get(names)):
        if not math.isclose(a, b, rel_tol=1e-2, abs_tol=1e-3):
            fault(where, f"{name} is {a} after one step, {b} after two halves")
    try:
        halves.api.doStep(0.5, length)
        fault(where, "a step from another time is taken")
    except Exception:
        if not any("0.5" in text for text in halves.logged):
            fault(where, f"a step from another time is not explained: {halves.logged}")
    whole.close()
    halves.close()


def model_exchange(where, file, reference, tolerance, relative=1e-9):
    fmu = Fmu(file, exchange=True)
    names = recorded(fmu, reference)
    fmu.close()
    result = fmpy.simulate_fmu(
        str(file), fmi_type="ModelExchange", solver="CVode", relative_tolerance=relative, stop_time=POINTS / 100,
        output_interval=EVERY, output=names, record_events=False)
    for name in names:
        wanted = reference[name]
        # What is zero at all samples but for rounding, as a current of the mains at every half period, says nothing.
        scale = max(max(map(abs, wanted)), 1e-12)
        for t, value in zip(result["time"], result[name]):
            k = round(t * 100)
            if abs(t - k / 100) < 1e-9 and k <= POINTS and not abs(value - wanted[k]) <= tolerance * scale:
                fault(where, f"{name} is {value} at {t} s, but {wanted[k]}")
                break


def derivatives(where, file):
    fmu = Fmu(file, exchange=True)
    fmu.begin()
    if fmu.version == 2:
        fmu.api.newDiscreteStates()
    else:
        fmu.api.updateDiscreteStates()
    fmu.api.enterContinuousTimeMode()
    states = [v for v in fmu.description.modelVariables if any(w.derivative is v for w in fmu.description.modelVariables)]
    ders = [w for v in states for w in fmu.description.modelVariables if w.derivative is v]
    outputs = [v for v in fmu.description.modelVariables if v.causality == "output"]
    inputs = [v for v in fmu.description.modelVariables if v.causality == "input"]
    unknowns = [v.valueReference for v in ders + outputs]
    names = [v.name for v in ders + outputs]
    # A little away from the start, where much is zero and conditions may just switch.
    known = {v: fmu.get([v.name])[0] for v in states + inputs}
    known = {v: at + 1e-3 * max(abs(at), 1e-3) for v, at in known.items()}
    for v in inputs:
        fmu.set(v.name, known[v])
    fmu.api.setContinuousStates((ctypes.c_double * len(states))(*(known[v] for v in states)), len(states))

    def place(variable, value):
        if variable in inputs:
            fmu.set(variable.name, value)
        else:
            x = [known[v] if v is not variable else value for v in states]
            fmu.api.setContinuousStates((ctypes.c_double * len(x))(*x), len(x))

    # Where modes change what depends on what is not told.
    everything = {v.name for v in fmu.description.modelVariables}
    unknown = fmu.description.derivatives + fmu.description.outputs
    structure = {u.variable.name: everything if u.dependencies is None else {d.name for d in u.dependencies} for u in unknown}
    if fmu.version == 3:
        # Weighted sums of the columns.
        references, weights = [v.valueReference for v in known], [math.cos(1.0 + 3.0 * i) for i in range(len(unknowns))]
        adjoint = list(fmu.api.getAdjointDerivative(unknowns, references, weights, len(references))) if references else []
        for reference, found in zip(references, adjoint):
            terms = [w * s for w, s in zip(weights, fmu.api.getDirectionalDerivative(unknowns, [reference], [1.0]))]
            if not abs(found - sum(terms)) <= 1e-12 * sum(map(abs, terms)):
                fault(where, f"the adjoint derivative by {reference} is {found}, not {sum(terms)}")
    for variable, at in known.items():
        exact = list(fmu.api.getDirectionalDerivative(unknowns, [variable.valueReference], [1.0]))
        h = 1e-6 * max(abs(at), 1e-3)
        place(variable, at + h)
        above = fmu.get(names)
        place(variable, at - h)
        below = fmu.get(names)
        place(variable, at)
        for name, slope, a, b in zip(names, exact, above, below):
            difference = (a - b) / (2 * h)
            noise = 1e-9 * max(abs(a), abs(b)) / h
            if not abs(slope - difference) <= 1e-5 * abs(slope) + noise + 1e-6:
                fault(where, f"d {name} / d {variable.name} is {slope}, but by differences {difference}")
            if slope != 0.0 and variable.name not in structure[name]:
                fault(where, f"{name} depends on {variable.name}, which the structure does not say")
    fmu.close()


def events_by_hand(where, file):
    """Periods are told without drift, states and discrete variables change at an event, and a saved state takes it back."""
    fmu = Fmu(file, exchange=True)
    fmu.begin()

    def event():
        if fmu.version == 2:
            return fmu.api.newDiscreteStates()
        needed, ends, _, changed, defined, at = fmu.api.updateDiscreteStates()
        return needed, ends, False, changed, defined, at

    for k in range(1, 120):
        needed, _, _, changed, defined, at = event()
        if needed or changed or not defined or at != k * 0.02:
            fault(where, f"after event {k - 1} the next one is told at {at}, states changed: {changed}")
            break
        if fmu.get(["samples"]) != [float(k)]:
            fault(where, f"{fmu.get(['samples'])} samples at event {k - 1}")
        fmu.api.enterContinuousTimeMode()
        state = fmu.save()
        fmu.api.setTime(at)
        fmu.api.enterEventMode()
        event()
        if fmu.get(["samples"]) != [float(k + 1)]:
            fault(where, f"{fmu.get(['samples'])} samples after event {k}")
        other = fmu.deserialise(fmu.serialise(state))
        fmu.restore(other)
        if fmu.get(["samples"]) != [float(k)]:
            fault(where, "a discrete variable is not restored")
        fmu.free(state)
        fmu.free(other)
        fmu.api.setTime(at)
        fmu.api.enterEventMode()
    fmu.close()


def impact_by_hand(where, file):
    """An impact: the importer is told that states have changed; the height stays, the speed is turned round."""
    fmu = Fmu(file, exchange=True)
    fmu.begin()
    update = fmu.api.newDiscreteStates if fmu.version == 2 else fmu.api.updateDiscreteStates
    update()
    fmu.api.enterContinuousTimeMode()
    fmu.api.setTime(0.5)
    states = [v for v in fmu.description.modelVariables if any(w.derivative is v for w in fmu.description.modelVariables)]
    x = [-1e-9 if v.name == "h" else -4.0 for v in states]
    fmu.api.setContinuousStates((ctypes.c_double * len(x))(*x), len(x))
    fmu.api.enterEventMode()
    changed = update()[3]
    names = ["h", "ball.f", "n", "ball.impulse"]
    if not changed or fmu.get(names) != [-1e-9, 3.2, 1.0, 7.2]:
        fault(where, f"an impact gives {fmu.get(names)}, states changed: {changed}")
    fmu.api.enterEventMode()
    if update()[3] or fmu.get(["n"]) != [1.0]:
        fault(where, "an impact happens again at the same instant")
    fmu.close()


def initial_unknowns(where, file):
    """What is said to follow from parameters and inputs at the start does, and nothing else does."""
    fmu = Fmu(file)
    free = [v for v in fmu.description.modelVariables if v.causality in ("input", "parameter")]
    unknowns = fmu.description.initialUnknowns
    names = [u.variable.name for u in unknowns]
    said = {u.variable.name: {d.name for d in u.dependencies} for u in unknowns}

    def at_start(values):
        other = Fmu(file)
        if other.version == 2:
            other.api.setupExperiment(startTime=0.0)
        other.api.enterInitializationMode()
        for name, value in values.items():
            other.set(name, value)
        result = other.get(names)
        other.api.exitInitializationMode()
        if other.get(names) != result:
            fault(where, "values change at the end of the initialization")
        other.close()
        return result

    before = at_start({})
    for variable in free:
        start = float(variable.start)
        after = at_start({variable.name: start * 1.1 + 0.01})
        for name, a, b in zip(names, before, after):
            if a != b and variable.name not in said[name]:
                fault(where, f"{name} at the start follows {variable.name}, which InitialUnknowns does not say")
    fmu.close()


def sources(where, file, reference, scratch):
    """The FMU built again from its sources, by CMake as importers do."""
    folder = scratch / "again"
    shutil.rmtree(folder, ignore_errors=True)
    fmpy.extract(str(file), str(folder))
    shutil.rmtree(folder / "binaries", ignore_errors=True)
    build_platform_binary(folder, configuration="Release")
    again = scratch / "again.fmu"
    again.unlink(missing_ok=True)
    shutil.make_archive(str(again.with_suffix("")), "zip", folder)
    again.with_suffix(".zip").rename(again)
    co_simulation(where, again, reference)


def errors(where, file, falling):
    try:
        Fmu(file, guid="{other}")
        fault(where, "an instance of another model is made")
    except Exception:
        pass
    fmu = Fmu(falling)
    fmu.begin()
    said = ""
    try:
        for point in range(100):
            fmu.step(point)
        fault(where, "a root of a number below zero is no error")
    except Exception:
        said = " ".join(fmu.logged)
    if "at t = " not in said or not ("y" in said or "root" in said):
        fault(where, f"the error does not say where: {said!r}")
    try:
        fmu.set("level", 1.0)
        fault(where, "a model that has failed takes values")
    except Exception:
        pass
    fmu.close()


def parameters(where, file, model):
    values = {"m": 3.0, "ratio": 2.5, "stretch": -0.03}
    given = [part for name, value in values.items() for part in ("--set", f"{name}={value}")]
    reference = trajectory(model, "--solver", "rk4", "--step", STEP, *given)
    co_simulation(where + " with parameters", file, reference, values)
    fmu = Fmu(file)
    fmu.begin()
    for point in range(10):
        fmu.step(point)
    before = fmu.get(["spring.q", "stiffness", "k2"])
    fmu.set("k", 80.0)
    after = fmu.get(["spring.q", "stiffness", "k2"])
    if after != [before[0], 200.0, 120.0]:
        fault(where, f"tuning k gives {after}")
    fmu.step(10)
    fmu.close()


def main():
    scratch = Path(tempfile.mkdtemp())
    falling = {v: scratch / f"falling_{v}.fmu" for v in (2, 3)}
    for v, file in falling.items():
        halfarrow("export", f"fmu{v}", HERE / "falling.bond", "--out", file, "--step", STEP)
    for model, tolerance in MODELS:
        name = model.parent.name if model.name == "model.bond" else model.stem
        if sys.argv[2:] and name not in sys.argv[2:]:
            continue
        global POINTS
        POINTS = LONGER.get(name, 40)
        reference = trajectory(model, "--solver", "rk4", "--step", STEP)
        tight = trajectory(model, "--rtol", "1e-10", "--solver", "explicit")
        for version in (2, 3):
            where = f"{name} (FMI {version})"
            file = scratch / f"{name}_{version}.fmu"
            halfarrow("export", f"fmu{version}", model, "--out", file, "--step", STEP)
            for problem in validate_fmu(str(file)):
                fault(where, problem)
            co_simulation(where + " co-simulation", file, reference)
            if version == 3:
                happens = name in ("when_bouncing_ball", "when_rimless_wheel", "controlled")
                event_mode(where + " co-simulation with event mode", file, reference, happens)
            if name != "rectifier":  # its diodes turn over within one step
                variable_steps(where, file)
            model_exchange(where + " model exchange", file, tight, tolerance)
            if name == "rectifier":  # at rest at the start: its nominal tells what a loose tolerance is relative to
                model_exchange(where + " model exchange, loosely", file, tight, 2e-2, 1e-4)
            derivatives(where, file)
            if name in LONGER:
                of_closed_form(where, name, file)
            if name == "controlled":
                events_by_hand(where, file)
            if name == "when_bouncing_ball":
                impact_by_hand(where, file)
            if name in ("tuned", "controlled", "series_springs", "gearbox_ratio", "sampled"):
                initial_unknowns(where, file)
            if name in ("contact", "quarter_car"):
                sources(where + " from source", file, reference, scratch)
            if name == "quarter_car":
                errors(where, file, falling[version])
            if name == "tuned":
                parameters(where, file, model)
        print(f"{name}: checked")
    shutil.rmtree(scratch, ignore_errors=True)
    print(f"{len(FAULTS)} faults")
    return 1 if FAULTS else 0


if __name__ == "__main__":
    PROGRAM = sys.argv[1]
    sys.exit(main())
