"""Bond graphs from text to equations and trajectories.

A model is text: what is connected to what. ``load`` reads a file, ``model`` takes the text itself:

>>> import halfarrow as ha
>>> car = ha.model('''model QuarterCar
... param ms = 320 kg, ks = 18 kN/m, b = 1 kN.s/m
... input road : m/s = 0                              "vertical speed of the road"
... Sf:ground(road) -> 0:strut -> 1:chassis -> I:body(ms)
... strut -> 1:gap -> C:spring(k = ks)
... gap -> R:damper(b)
... output travel = spring.q : mm
... ''')

Ask it
    ``car.loops``, ``car.equations()``, ``car.draw()``, ``car.parameters``, ``car.warnings``:

>>> print(car.equations().text)
ms f_body' = b (road - f_body) + ks q_spring
q_spring' = road - f_body

Run it
    ``simulate`` takes parameters and inputs as keywords, and gives arrays with units, and an audit against the graph:

>>> r = car.simulate(to=4, every=0.01, ks=20e3, road=([0, 1, 1, 2], [0, 0, 0.2, 0]))
>>> r["travel"].shape, r.units["travel"], r.audit.verdict
((401,), 'mm', 'holds')

    ``r.to_pandas()``, ``r.to_xarray()``, ``r.plot("travel")``, ``r.save("car.parquet")``.

Run it many times
    ``sweep`` takes several values of a parameter, on all cores or through any executor:

>>> s = car.sweep(to=4, step=1e-3, ks=[10e3, 20e3, 30e3], b=[600, 900], road=0.1, reduce={"peak": ("travel", "max")})
>>> s["peak"].shape
(6,)

Differentiate it, fit it
    ``sensitivities`` are exact derivatives of a run, ``fit`` finds parameters from measurements by them:

>>> d = car.sensitivities(["ks", "body.f(0)"], to=4, every=1, road=0.1)
>>> d["travel", "ks"].shape, d.units["travel", "ks"]
((5,), '(mm)/(N/m)')

    ``gradient`` gives the derivatives of one number by all parameters, at the cost of a few runs:

>>> g = car.gradient("rms(travel)", to=4, every=0.01, road=0.1)
>>> list(g), g.units["ks"]
(['ms', 'ks', 'b'], 'N/m')

    ``function`` makes a function of NumPy of it, with derivatives, ``.jax()`` and ``.torch()`` one of these libraries:

    >>> f = car.function(["ks", "b", "spring.q(0)"], ["travel"], to=4, every=1, road=0.1)
    >>> f(f.values).shape, f.jacobian(f.values).shape, f.vjp(f.values, [[0], [0], [0], [0], [1]]).shape
    ((5, 1), (5, 1, 3), (3,))

Ask what matters over whole ranges
    ``sobol`` gives parts of the variance of an output, ``morris`` tells which of many parameters matter at all, both with
    confidence intervals (SALib).

Let something learn to act in it
    ``gym`` and ``gym_vector`` are environments of Gymnasium: what is observed, what is acted on, what is rewarded, what
    begins at random.

Look at it near a point
    ``linearize`` gives matrices, poles, zeros, ``bode()``, ``to_control()``:

>>> car.linearize(at="equilibrium").stable
True

Step it
    ``stepper`` runs as far as it is told, beside a controller or hardware:

>>> with car.stepper(step=1e-3) as run:
...     run["road"] = 0.1
...     run.step(100)
...     round(run.t, 6)
0.1

Give it away
    ``export`` writes C and FMUs, ``report`` one page with everything, ``compare`` puts all forms beside each other.

Values of parameters are numbers in SI units or text with a unit (``ks="20 kN/m"``); inputs and results are in the units of
their declarations. What is wrong is told by exceptions with place, reason and remedy: ``ModelError``, ``UsageError``,
``UnknownNameError``, ``RunError``, which has what was computed as ``result``. What is odd is told by ``ModelWarning``, what an
audit finds missed by ``AuditWarning``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._errors import (
    AuditWarning,
    Diagnostic,
    Error,
    FileError,
    Interrupted,
    ModelError,
    ModelWarning,
    RunError,
    UnknownNameError,
    UsageError,
)
from ._halfarrow import __version__
from .comparison import Comparison
from .components import Component, Library, format, library
from .equations import Equations
from .fitting import Estimate, Experiment, Fit, Profile
from .functions import Function
from .global_sensitivity import GlobalSensitivity, MorrisEffects, SobolIndices
from .gradients import Gradient, Recorded
from .identifiability import Identifiability
from .linear import Linearization
from .loops import Loops
from .model import Input, Model, Parameter, Variable, load, model
from .picture import Picture
from .result import Audit, Result
from .sensitivities import Sensitivities
from .stepper import Snapshot, Stepper
from .sweeps import SweepFiles, SweepResult, read_sweep

if TYPE_CHECKING:
    from .gyms import Environment, Environments, gym, gym_vector

__all__ = [
    "Audit",
    "AuditWarning",
    "Comparison",
    "Component",
    "Diagnostic",
    "Environment",
    "Environments",
    "Equations",
    "Error",
    "Estimate",
    "Experiment",
    "FileError",
    "Fit",
    "Function",
    "GlobalSensitivity",
    "Gradient",
    "Identifiability",
    "Input",
    "Interrupted",
    "Library",
    "Linearization",
    "Loops",
    "Model",
    "ModelError",
    "ModelWarning",
    "MorrisEffects",
    "Parameter",
    "Picture",
    "Profile",
    "Recorded",
    "Result",
    "RunError",
    "Sensitivities",
    "Snapshot",
    "SobolIndices",
    "Stepper",
    "SweepFiles",
    "SweepResult",
    "UnknownNameError",
    "UsageError",
    "Variable",
    "__version__",
    "format",
    "gym",
    "gym_vector",
    "library",
    "load",
    "model",
    "read_sweep",
]


def __getattr__(name: str) -> Any:
    # Gymnasium is loaded when it is asked for.
    if name in ("Environment", "Environments", "gym", "gym_vector"):
        from . import gyms

        return getattr(gyms, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
