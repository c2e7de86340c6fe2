"""Differentiates the reference programs by differences, and writes sensitivity.json beside each.

`python models/differentiate_references.py [name ...]`; needs mpmath. `--check`: writes nothing, and compares with the files
that are there, byte for byte; exit status 1 if any differs.

Every program is run again, unchanged but for one quantity that is moved a little where it gets its value: all of it at 60
digits, by a step of 1e-18 of the quantity to both sides. The difference misses the derivative by some 1e-36 of it, and
rounding by some 1e-42. Closed forms and exponentials of matrices are exact to all 30 digits written; where a program
integrates, its steps are fixed, so that its error is a smooth function of the quantity and the derivative of the error as
small as itself, at most 1e-18 of what there is. An hour on one core; with gmpy2 less.
"""
import ast
import json
import sys
import time
from pathlib import Path

import reference_tools
from mpmath import mp, mpf, nstr

here = Path(__file__).parent
DIGITS, WRITTEN, STEP = 60, 30, "1e-18"

# By model and quantity what moves it by `d`, behind the assignment to the name that stands first. Several names joined by +
# move together: the sum of their derivatives.
QUANTITIES = {
    "chain_of_pendulums": {"k": "k += d", "bar3.angle(0)": "start[2] += d"},
    "chain_of_rings": {"R1": "R1 += d", "m2": "m2 += d"},
    "dc_motor_pid": {"kp": "kp += d", "j": "j += d", "ref": "ref += d"},
    "double_pendulum": {"m1": "m1 += d", "l2": "l2 += d", "phi1(0)": "start[0] += d"},
    "electrostatic": {"rs": "r += d", "mass": "m += d", "x0": "x0 += d"},
    "field_dependent": {"m12": "m12 += d", "b": "b += d", "hull.x.f(0)": "start[0] += d"},
    "gear_train": {"n2": "mesh[1] += d", "j3": "inertia[3] += d", "gear0.f(0)": "start += d"},
    "gearbox_ratio": {"j2": "j2 += d", "tau": "tau += d"},
    "half_gain_cycles": {"m1": "m1 += d", "k2": "k2 += d", "I2.f(0)": "start[2] += d"},
    "heat_plate": {"res": "res += d", "power": "power += d"},
    "imposed_motion": {"ks": "k += d", "m2": "m2 += d"},
    "lever": {"n": "n += d", "m2": "m2 += d", "mass1.f(0)": "v0 += d"},
    "parallel_bonds": {"mass": "m += d", "r": "r += d"},
    # The start speed of the mass is given upwards and stays as it is: a steeper bar turns at another speed.
    "point_pendulum": {
        "l": "l += d",
        "g": "g += d",
        "phi(0)": "start[:] = [start[0] + d, start[1] * cos(start[0]) / cos(start[0] + d)]",
    },
    "quarter_car": {"ks": "ks += d", "spring.q(0)": "start[1] += d"},
    "rc_bridge": {"r3": "g3 = 1 / (1 / g3 + d)", "c2": "c2 += d"},
    "rc_bridge_cubic": {"b": "b += d", "r2": "g2 = 1 / (1 / g2 + d)"},
    "rc_bridge_diode": {"is": "sat += d", "vt": "vt += d"},
    "rectifier": {"rs": "rs += d", "v0": "v0 += d"},
    "redundant_zc": {"ks": "k += d", "b": "b += d", "cart.f(0)": "v0 += d"},
    "ring_gyrator": {"r": "r += d", "c1": "k1 = 1 / (1 / k1 + d)"},
    "ring_modulated": {"a0": "a0 += d", "b": "b += d", "spring.q(0)": "start[0] += d"},
    "rlc_ladder": {"rs": "r += d", "load": "load += d"},
    "series_springs": {"k1": "k1 += d", "m2": "m2 += d"},
    "slider_crank": {"r": "r += d", "l": "l += d", "mass": "m += d"},
    "source_jumps": {"rs": "r += d", "cap": "cap += d"},
    "spring_chain": {"k2": "k2 += d", "b": "b += d", "spring3.q(0)": "start[2] += d"},
    "velocity_source": {"n": "n += d", "k": "k += d", "mass1.f(0)": "start += d"},
    "wave_line": {"volts": "volts += d", "+".join(f"ind[{i}]" for i in range(1, 7)): "l += d"},
    "when_bouncing_ball": {"e": "e += d", "g": "g += d", "h(0)": "h0 += d"},
    "when_rimless_wheel": {"l": "l += d", "alpha": "alpha += d", "gamma": "gamma += d"},
}


def bound(statement):
    """Names that a statement gives a value to."""
    if not isinstance(statement, ast.Assign):
        return set()
    return {node.id for target in statement.targets for node in ast.walk(target) if isinstance(node, ast.Name)}


def asks_for_tools(statement):
    return isinstance(statement, ast.ImportFrom) and statement.module == "reference_tools"


def run(model, change=None, step=mpf(0)):
    """Times and columns of a program in which `change` moves a quantity by this part of itself."""
    program = here / model / "reference.py"
    tree, found = ast.parse(program.read_text()), {}
    names = {"__name__": "__main__", "__file__": str(program), "d": mpf(0)}
    tree.body = [statement for statement in tree.body if not asks_for_tools(statement)]
    names.update({name: getattr(reference_tools, name) for name in dir(reference_tools) if not name.startswith("_")})
    # What is checked there by a second run was checked when the reference was written.
    names["twice"] = lambda rates, x, times, h, columns=12, knots=(), digits=22: reference_tools.integrate(
        rates, x, times, mpf(h), columns, knots
    )
    names["write"] = lambda _, times, columns, *rest, **more: found.update(times=times, columns=columns)
    if change is not None:
        moving = ast.parse(change).body
        name = next(node.id for node in ast.walk(moving[0]) if isinstance(node, ast.Name) and node.id != "d")
        place = next(i for i, statement in enumerate(tree.body) if name in bound(statement))
        tree.body[place + 1 : place + 1] = moving
        names["d"] = step
    exec(compile(ast.fix_missing_locations(tree), program, "exec"), names)
    return found["times"], {name: [mpf(v) for v in values] for name, values in found["columns"].items()}


def size_of(model, quantity):
    """A size for the steps, by the numbers of the model: of a start value 1."""
    import re

    if quantity.endswith("(0)"):
        return mpf(1)
    scale = {"k": 3, "M": 6, "m": -3, "u": -6, "n": -9, "p": -12}
    name = re.escape(quantity.split("+")[0].split("[")[0])
    text = (here / model / "model.bond").read_text()
    number, unit = re.search(rf"\b{name}(?:\[[^]]*\])?(?: : [^=]*)?\s*=\s*(-?[\d.]+(?:e-?\d+)?)\s*([A-Za-z]*)", text).groups()
    prefixed = len(unit) > 1 and unit not in ("kg", "mm", "min", "mol", "ms") and unit[0] in scale
    return abs(mpf(number)) * (mpf(10) ** scale[unit[0]] if prefixed else 1)


def differentiated(model):
    """The text of sensitivity.json of a model."""
    mp.dps = DIGITS
    by = {}
    for quantity, change in QUANTITIES[model].items():
        h = size_of(model, quantity) * mpf(STEP)
        times, above = run(model, change, h)
        _, below = run(model, change, -h)
        by[quantity] = {}
        for name in above:
            slopes = [(a - b) / (2 * h) for a, b in zip(above[name], below[name])]
            # What is zero to rounding is written 0: of the derivative, or of the variable over the quantity.
            size = max(max(abs(v) for v in slopes), max(abs(v) for v in above[name]) * mpf(STEP) / h * mpf("1e-6"))
            zero = size * mpf(10) ** -WRITTEN
            by[quantity][name] = ["0" if abs(v) <= zero else nstr(v, WRITTEN, strip_zeros=False) for v in slopes]
    data = {"t": list(times), "by": by, "source": "models/differentiate_references.py"}
    return json.dumps(data, indent=1) + "\n"


def done(model):
    begun = time.perf_counter()
    return model, differentiated(model), time.perf_counter() - begun


def main(arguments):
    check = "--check" in arguments
    models = [name for name in arguments if not name.startswith("-")] or sorted(QUANTITIES)
    wrong = 0
    for model, text, took in map(done, models):
        path = here / model / "sensitivity.json"
        if check:
            same = path.is_file() and path.read_text() == text
            wrong += not same
            print("same     " if same else "DIFFERENT", model, f"{took:.0f} s", flush=True)
        else:
            path.write_text(text)
            print(model, f"{took:.0f} s", flush=True)
    return wrong > 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
