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
# # A quarter of a car
#
# A wheel runs over a bump. Between the road and the passenger there are a tyre, a wheel, a spring with a damper, and a
# body. We write down what is connected to what, and ask for the rest.
#
# This file is a notebook as text: open it in Jupyter (with jupytext), or turn it into one with
# `jupytext --to ipynb tutorial.py`.

# %%
import matplotlib.pyplot as plt
import numpy as np

import halfarrow as ha

# %% [markdown]
# ## The model
#
# A chain `a -> b -> c` is a chain of bonds whose half arrows point to the right. `0` and `1` are junctions, `I` stores
# momentum, `C` displacement, `R` dissipates, `Se` and `Sf` are sources of effort and flow.

# %%
car = ha.model("""
model QuarterCar "Quarter car with a cubic damper"
param ms = 320 kg, mu = 40 kg, ks = 18 kN/m, kt = 190 kN/m, b = 900 N.s3/m3, g = 9.81 m/s2
input road : m/s = 0                              "vertical speed of the road"
Sf:ground(road) -> 0:tyre -> 1:hub -> I:wheel(mu)
tyre -> C:tread(k = kt, q0 = 18.6 mm)
hub -> 0:strut -> 1:chassis -> I:body(ms)
strut -> 1:gap -> C:spring(k = ks, q0 = 174.4 mm)
gap -> R:damper(e = b*f^3)
Se:weight_u(-mu*g) -> hub
Se:weight_s(-ms*g) -> chassis
output travel = spring.q : mm
""")
car

# %% [markdown]
# Causal strokes, numbered bonds, parameters: the notebook shows them. What is wrong is told with its place and what to do:

# %%
try:
    ha.model("model Wrong\nSe:push(1 N) -> I:mass(mas)\nparam mass = 2 kg\n")
except ha.ModelError as error:
    print(error)

# %% [markdown]
# ## Equations
#
# The smallest set, in text, LaTeX or SymPy; `form="break"`, `"lagrange"` and others give the classical ones.

# %%
equations = car.equations()
print(equations.text)
assert len(equations.equations) == 4

# %%
equations.sympy()[0]

# %% [markdown]
# ## A run
#
# Inputs are numbers, `(times, values)`, functions of time, series of pandas or paths of CSV files; parameters are numbers in
# SI units, or text with a unit. Here the road rises by 5 cm within 0.1 s.

# %%
r = car.simulate(to=4, every=0.01, road=lambda t: 0.5 if 0.2 <= t < 0.3 else 0.0, ks="20 kN/m")
r.plot("travel")
print(f"the strut moves from {r['travel'].min():.1f} to {r['travel'].max():.1f} {r.units['travel']}")
assert r.audit.verdict == "holds"

# %% [markdown]
# Each run is audited against the bond graph, by code that knows nothing of the equations: no power is made or lost, every
# law holds. `r.to_pandas()` and `r.to_xarray()` share the memory of the run.

# %%
r.to_pandas().describe()

# %% [markdown]
# ## Near rest
#
# Matrices with exact derivatives at the equilibrium. A cubic damper does nothing for small motions, so that nothing damps
# them; with a linear one beside it they die out.

# %%
print(car.linearize(at="equilibrium"))

# %%
damped = ha.model(car.text.replace("gap -> R:damper", "gap -> R:oil(1500 N.s/m)\ngap -> R:damper"))
lin = damped.linearize(at="equilibrium", ks=20e3)
lin.bode()
plt.show()
assert lin.stable
lin

# %% [markdown]
# ## Many runs
#
# Several values of a parameter make a sweep; what is kept of each run has a name. Sixteen sets run at once on the vectors of a
# core, on all cores. `executor=` takes any executor: processes, loky, Dask.

# %%
bump = ([0, 0.2, 0.2, 0.3, 0.3], [0, 0, 0.5, 0.5, 0])
s = damped.sweep(
    to=3,
    step=1e-3,
    ks=np.linspace(10e3, 30e3, 21),
    ms=[260, 320, 380],
    road=bump,
    reduce={"jolt": ("body.f", "max_abs"), "stroke": ("travel", "min")},
)
grid = s.to_xarray()
grid["jolt"].plot.line(x="ks")
plt.show()
assert not s.failed.any() and grid["jolt"].shape == (21, 3)

# %% [markdown]
# ## A controller in the loop
#
# A stepper goes as far as it is told. Here it is saved before the bump, and taken up again with another road.

# %%
with damped.stepper(step=1e-3) as run:
    run.step(200)
    before = run.save()
    for height in (0.5, 1.0):
        run.restore(before)
        run["road"] = height
        run.step(100)
        run["road"] = 0.0
        run.step(100)
        print(f"at t = {run.t:.1f} s the strut has {run['travel']:.1f} mm after a bump of {100 * height * 0.1:.0f} cm")

# %% [markdown]
# ## Give it away
#
# C without heap, FMUs for other tools, and one page with everything:
#
# ```python
# car.export("c", "car")
# car.export("fmu3", "car.fmu", step=1e-3)
# car.report("car.html")
# car.compare()
# ```
