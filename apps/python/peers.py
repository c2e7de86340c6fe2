# ---
# jupyter:
#   jupytext:
#     formats: py:percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Beside other programs
#
# The same models in halfarrow and in three programs of others: BondGraphTools derives equations from bond graphs,
# python-control works with linear models, FMPy runs FMUs. Each cell ends in an assertion.
#
# It needs `pip install BondGraphTools==0.4.6 control==0.10.2 fmpy==0.3.32`, and a C compiler for the FMU.

# %%
import contextlib
import io
import tempfile
from pathlib import Path

import control
import numpy as np
import sympy
from scipy.integrate import solve_ivp

import halfarrow as ha

with contextlib.redirect_stdout(io.StringIO()) as said:
    import BondGraphTools as bgt
print(said.getvalue().strip())

# %% [markdown]
# ## BondGraphTools
#
# It installs from PyPI and derives equations. Its own `simulate` needs `scikits.odes`, which has no binary on PyPI and
# is built against SUNDIALS; without it, what it says stands above. So its equations are integrated with SciPy here.
#
# Each example below is built element by element: kinds and values, and which is connected to which. `rates` solves what
# BondGraphTools gives for the rates of its states, which are the `q` and `p` of storages in the order in which they
# were made.


# %%
def build(elements, bonds):
    model = bgt.new()
    made = {name: bgt.new(kind, value=value) for name, (kind, value) in elements.items()}
    bgt.add(model, *made.values())
    for tail, head in bonds:
        ends = [(made[e[0]], e[1]) if isinstance(e, tuple) else made[e] for e in (tail, head)]
        bgt.connect(*ends)
    return model


def rates(model):
    """The rates of the states by states and inputs; relations between states are what is left over."""
    relations = [sympy.nsimplify(r) for r in model.constitutive_relations]
    unknown = [sympy.Symbol(f"d{x}") for x in model.state_vars]
    solved = sympy.solve([r for r in relations if r.free_symbols & set(unknown)], unknown, dict=True)[0]
    left = [r for r in relations if not r.free_symbols & set(unknown)]
    return [solved[u] for u in unknown], left


# %% [markdown]
# ### A capacitor and a resistor
#
# The first example of its documentation: 1 F with 1 Ω.

# %%
rc = build(
    {"C": ("C", 1), "R": ("R", 1), "n": ("0", None)},
    [("n", "R"), ("n", "C")],
)
print("BondGraphTools:", rc.constitutive_relations)

ours = ha.model("""
model Rc
0:n -> R:R(1)
n -> C:C(1, q0 = 1)
""")
print("halfarrow:     ", ours.equations().text)

right = sympy.lambdify(sympy.symbols("x_0"), rates(rc)[0][0])
theirs = solve_ivp(lambda t, x: [right(x[0])], (0, 5), [1], t_eval=np.linspace(0, 5, 51), rtol=1e-10, atol=1e-12)
run = ours.simulate(to=5, every=0.1, rtol=1e-10)
print(f"greatest difference of the runs: {np.abs(run['C.q'] - theirs.y[0]).max():.1e}")
assert np.allclose(run["C.q"], theirs.y[0], atol=1e-8) and np.allclose(run["C.q"], np.exp(-run.t), atol=1e-8)

# %% [markdown]
# ### A driven series circuit

# %%
series = build(
    {"Se": ("Se", None), "R": ("R", 2), "C": ("C", 0.5), "L": ("I", 3), "loop": ("1", None)},
    [("Se", "loop"), ("loop", "R"), ("loop", "C"), ("loop", "L")],
)
print("BondGraphTools:", series.constitutive_relations)

ours = ha.model("""
model Series
input u = 0
Se:source(u) -> 1:loop -> R:R(2)
loop -> C:C(0.5)
loop -> I:L(3)
""")
print(ours.equations().text)

# Both as a matrix: states q of C and p of L there, q of C and f = p/3 of L here.
x0, x1, u0 = sympy.symbols("x_0 x_1 u_0")
theirs = np.array(sympy.Matrix(rates(series)[0]).jacobian([x0, x1, u0]), dtype=float)
lin = ours.linearize()
order = [lin.states.index("C.q"), lin.states.index("L.f")]
scale = np.diag([1, 3])
A = scale @ lin.A[np.ix_(order, order)] @ np.linalg.inv(scale)
B = scale @ lin.B[order]
assert np.allclose(np.c_[A, B], theirs, atol=1e-14)

# %% [markdown]
# ### A dependent storage
#
# Two inertias, 2 and 4, behind a gear of 3. BondGraphTools keeps both momenta as states, and the relation between them;
# halfarrow has one state. The momenta grow at the same rates, 9/11 and 6/11 for a torque of 1.

# %%
gear = build(
    {"Se": ("Se", None), "I1": ("I", 2), "I2": ("I", 4), "gear": ("TF", 3), "fast": ("1", None), "slow": ("1", None)},
    [("Se", "fast"), ("fast", "I1"), ("fast", ("gear", 0)), (("gear", 1), "slow"), ("slow", "I2")],
)
print("BondGraphTools:", gear.constitutive_relations)
theirs, relations = rates(gear)
assert len(relations) == 1

ours = ha.model("""
model Gear
Se:torque(1) -> 1:fast -> I:I1(2)
fast -> TF:gear(f_out = 1/3) -> 1:slow -> I:I2(4)
""")
print("halfarrow:     ", ours.equations().text)
run = ours.simulate(to=1, every=1, record=["I1.p", "I2.p"])
theirs = [float(rate.subs("u_0", 1)) for rate in theirs]
assert np.allclose([run["I1.p"][-1], run["I2.p"][-1]], theirs, rtol=1e-12)

# %% [markdown]
# ### A loop of resistors
#
# The bridge of `models/rc_bridge`: one node without a capacitor. Both programs solve the loop; BondGraphTools with
# decimals of 15 digits, halfarrow with the symbols of the parameters.

# %%
bridge = build(
    {
        "feed": ("Sf", None),
        "R1": ("R", 1000),
        "R2": ("R", 2200),
        "R3": ("R", 1500),
        "C1": ("C", 220e-6),
        "C2": ("C", 470e-6),
        **{n: ("0", None) for n in ("top", "left", "right")},
        **{n: ("1", None) for n in ("upper_left", "bridge", "upper_right")},
    },
    [
        ("feed", "top"),
        ("top", "upper_left"), ("upper_left", "left"), ("upper_left", "R1"),
        ("left", "R2"),
        ("left", "bridge"), ("bridge", "right"), ("bridge", "R3"),
        ("top", "upper_right"), ("upper_right", "right"), ("upper_right", "C1"),
        ("right", "C2"),
    ],
)  # fmt: skip
print("BondGraphTools:", *bridge.constitutive_relations, sep="\n  ")

ours = ha.model("""
model RcBridge
param r1 = 1 kohm, r2 = 2.2 kohm, r3 = 1.5 kohm, c1 = 220 uF, c2 = 470 uF
input feed : A = 0
Sf:source(feed) -> 0:top
top -> 1:upper_left -> 0:left
upper_left -> R:R1(r1)
left -> R:R2(r2)
left -> 1:bridge -> 0:right
bridge -> R:R3(r3)
top -> 1:upper_right -> right
upper_right -> C:C1(c1)
right -> C:C2(c2)
""")
print("halfarrow:", ours.equations().text, sep="\n")
theirs = np.array(sympy.Matrix(rates(bridge)[0]).jacobian([x0, x1, u0]), dtype=float)
lin = ours.linearize()
order = [lin.states.index("C1.q"), lin.states.index("C2.q")]
assert np.allclose(np.c_[lin.A[np.ix_(order, order)], lin.B[order]], theirs, rtol=1e-13)

# %% [markdown]
# ## python-control
#
# A quarter car: its transfer function from the speed of the road to the speed of the body, derived by hand from Newton's
# laws, against what `linearize` makes of the graph; then a run of each.

# %%
car = ha.model("""
model QuarterCar
param ms = 320 kg, mu = 40 kg, ks = 18 kN/m, kt = 190 kN/m, b = 900 N.s/m
input road : m/s = 0
Sf:ground(road) -> 0:tyre -> 1:hub -> I:wheel(mu)
tyre -> C:tread(k = kt)
hub -> 0:strut -> 1:chassis -> I:body(ms)
strut -> 1:gap -> C:spring(k = ks)
gap -> R:damper(b)
output speed = body.f : m/s
""")
ms, mu, ks, kt, b = 320, 40, 18e3, 190e3, 900
s = control.tf("s")
strut = b * s + ks  # times s: force by the difference of speeds
hand = kt * strut / ((ms * s**2 + strut) * (mu * s**2 + strut + kt) - strut**2)
system = car.linearize().to_control()

w = np.logspace(-1, 3, 400)
difference = np.abs(system(1j * w) - hand(1j * w)) / np.abs(hand(1j * w))
print(f"greatest relative difference of the frequency responses: {difference.max():.1e}")
assert difference.max() < 1e-10

# %%
t = np.linspace(0, 3, 3001)
road = np.where((t >= 0.2) & (t <= 0.3), (t - 0.2) * (0.3 - t) / 0.0025, 0)
theirs = control.forced_response(system, t, road)
run = car.simulate(to=3, every=1e-3, road=(t, road), rtol=1e-10)
print(f"greatest difference of the runs: {np.abs(run['speed'] - theirs.outputs).max():.1e} m/s")
assert np.abs(run["speed"] - theirs.outputs).max() < 1e-8

# %% [markdown]
# ## FMPy
#
# An exported FMU in the hands of an importer. Co-simulation makes the same steps of fixed length as `simulate`, to the
# last bit; model exchange leaves the integration to the importer, which takes CVODE.

# %%
import fmpy.validation  # noqa: E402

swing = ha.model("""
model Swing
param m = 2 kg, l = 0.75 m, g = 9.81 m/s2
state phi' = w.f from 60 deg
Se:gravity(-m*g*l*sin(phi)) -> 1:w -> I:mass(m*l^2)
w -> R:hinge(0.3 N.m.s)
output angle = phi
""")
with tempfile.TemporaryDirectory() as folder:
    path = str(Path(folder) / "swing.fmu")
    swing.export("fmu2", path, step=1e-3)
    assert not fmpy.validation.validate_fmu(path)
    steps = fmpy.simulate_fmu(
        path, fmi_type="CoSimulation", start_time=0, stop_time=5, step_size=1e-3, output_interval=1e-2, output=["angle"]
    )
    exchange = fmpy.simulate_fmu(
        path,
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-10,
        stop_time=5,
        output_interval=1e-2,
        output=["angle"],
    )

run = swing.simulate(to=5, every=1e-2, method="rk4", step=1e-3)
print("co-simulation, values that differ:", np.count_nonzero(steps["angle"] != run["angle"]), "of", run.t.size)
assert np.array_equal(steps["angle"], run["angle"])

exact = swing.simulate(to=5, every=1e-2, rtol=1e-11)
print(f"model exchange by CVODE, greatest difference: {np.abs(exchange['angle'] - exact['angle']).max():.1e} rad")
assert np.abs(exchange["angle"] - exact["angle"]).max() < 1e-6
