"""A model as a differentiable function, for NumPy, JAX and PyTorch."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from . import _halfarrow
from ._errors import RunError, UsageError, choice, needed, unknown
from ._inputs import InputLike, given, numbers
from ._tables import as_html, as_text
from .result import Drift, Result

if TYPE_CHECKING:
    from .model import Model

Array = npt.NDArray[np.float64]


class Function:
    """A model as a function from numbers to an array: ``Model.function`` makes one.

    It is given an array of the shape ``(..., parameters)``: parameters and start values in SI units, inputs in the units of
    their declarations, in the order of ``parameters``. It gives what the runs recorded, of the shape
    ``(..., samples, outputs)`` in declared units. Axes in front are sets, which run in threads at the same time. What is
    given as float32 is taken as float64: there is one precision within, and results are float64.

    Derivatives are exact: those of the equations by sensitivities and adjoint, not differences of runs. With steps of fixed
    length they are those of the steps themselves, to rounding; with steps of variable length both the values and the
    derivatives are within ``rtol``, and tools that compare derivatives with differences see that.

    >>> import halfarrow as ha
    >>> drop = ha.model("model Drop\\nparam m = 2 kg, F = 10 N\\nSe:weight(F) -> I:mass(m)\\n")
    >>> f = drop.function(["m", "F", "mass.f(0)"], ["mass.f"], to=2, every=1)
    >>> f.values, f.t, f.units
    (array([ 2., 10.,  0.]), array([0., 1., 2.]), {'mass.f': 'm/s'})
    >>> f([4, 10, 1]).round(6).tolist()
    [[1.0], [3.5], [6.0]]
    >>> f.jacobian([4, 10, 1]).shape
    (3, 1, 3)
    >>> f.vjp([4, 10, 1], [[0], [0], [1]]).round(6)
    array([-1.25,  0.5 ,  1.  ])
    """

    def __init__(
        self, model: Model, parameters: Sequence[str], outputs: Sequence[str], to: float, every: float | None,
        at: npt.ArrayLike | None, fixed: Mapping[str, float], inputs: Mapping[str, InputLike], options: Mapping[str, Any],
        threads: int | None, project: bool = False,
    ) -> None:  # fmt: skip
        self.model: Model = model
        """The model that runs."""
        self.parameters: list[str] = _quantities(model, parameters)
        """What it is a function of, in order; arrays of parameters by their elements."""
        self.outputs: list[str] = _outputs(model, outputs)
        """What it gives, in order."""
        self.t: Array = _samples(to, every, at)
        """Times of the samples, in s."""
        if threads is not None and threads < 1:
            raise UsageError(f"threads is {threads}: it has to be at least 1")
        self._threads = threads or os.cpu_count() or 1
        starts = [name[: -len("(0)")] for name in self.parameters if name.endswith("(0)")]
        # Start values that are varied are parameters of a model of its own.
        self._started = type(model)(model._core.with_starts(starts)) if starts else model
        self._is_input = [name in model.inputs for name in self.parameters]
        both = [name for name in self.parameters if name in fixed or name in inputs]
        if both:
            raise UsageError(f"`{both[0]}` is varied and given a value: leave out one of them")
        sample = every or options["step"] or to / 1000
        self._fixed = dict(fixed)
        # A function of time is called once, not in every run.
        self._inputs = {n: given(n, v, to, sample) if callable(v) else v for n, v in inputs.items()}
        self._made = (to, every, at, dict(options), threads, project)
        self._project = project
        self._options = {"to": float(to), "every": every, "at": None if every else self.t, **options}
        # Derivatives by inputs come by SI units.
        self._scale = np.array([_per_unit(model, n) if i else 1.0 for n, i in zip(self.parameters, self._is_input)])

    @property
    def units(self) -> dict[str, str]:
        """Units of the outputs by name; empty where there is none."""
        known = self.model.variables
        return {name: (known[name].unit or "") for name in self.outputs}

    @property
    def parameter_units(self) -> dict[str, str]:
        """Units of what it is a function of, by name: SI units, of inputs the declared ones; empty where there is none."""
        units = {name: p.unit for name, p in self._started.parameters.items()}
        units |= {name: i.unit for name, i in self.model.inputs.items()}
        return {name: units[name] or "" for name in self.parameters}

    @property
    def values(self) -> Array:
        """The values that the model has, of the shape ``(parameters,)``."""
        known = self._started.parameters
        if not any(self._is_input) and not self._fixed:
            return np.array([known[name].value for name in self.parameters])
        # What follows from other parameters is known when a run begins.
        with self._started.stepper(step=self._options["to"], method="euler", parameters=self._fixed) as begun:
            return np.array([begun[name] for name in self.parameters])

    def __call__(self, values: npt.ArrayLike) -> Array:
        """Runs the model.

        Args:
            values: Of the shape ``(..., parameters)``.

        Returns:
            Of the shape ``(..., samples, outputs)``.

        Raises:
            UsageError: the shape is another one, or a value cannot be that of its parameter.
            RunError: a run stopped, with time, reason and, of several, the set.

        Warns:
            AuditWarning, ModelWarning: as in ``Model.simulate``.
        """
        x = self._given(values)
        return self._each(self._value, [x], (len(self.t), len(self.outputs)))

    def drift(self, values: npt.ArrayLike) -> list[dict[str, Drift]]:
        """Runs the model and tells how far positions have drifted in each set from relations that only their speeds keep.

        Args:
            values: Of the shape ``(..., parameters)``.

        Returns:
            For each set, in order, what ``Audit.drift`` tells of its run, by the relations.

        Raises:
            UsageError, RunError: as in a call.
        """
        sets = self._given(values).reshape(-1, len(self.parameters))
        runs = (self._started.simulate(**self._run(x), project=self._project) for x in sets)
        return [{drift.relation: drift for drift in run.audit.drift} for run in runs]

    def jacobian(self, values: npt.ArrayLike) -> Array:
        """All derivatives, by ``sensitivities``: one run with a set of variational equations for each parameter.

        Args:
            values: Of the shape ``(..., parameters)``.

        Returns:
            Of the shape ``(..., samples, outputs, parameters)``, in the unit of the output over that of the parameter.

        Raises:
            UsageError: as in a call; or the model is no differentiable function of a parameter.
            RunError: as in a call; or a run has come to where there is no derivative.
        """
        x = self._given(values)
        return self._each(self._jacobian, [x], (len(self.t), len(self.outputs), len(self.parameters)))

    def jvp(self, values: npt.ArrayLike, tangents: npt.ArrayLike) -> Array:
        """The derivative along a direction, by ``sensitivities``; parameters whose direction is 0 cost nothing.

        Args:
            values: Of the shape ``(..., parameters)``.
            tangents: The direction, of the same shape.

        Returns:
            Of the shape ``(..., samples, outputs)``.

        Raises:
            UsageError, RunError: as in ``jacobian``.
        """
        x, v = np.broadcast_arrays(self._given(values), self._given(tangents, "tangents"))
        return self._each(self._along, [x, v], (len(self.t), len(self.outputs)))

    def vjp(self, values: npt.ArrayLike, weights: npt.ArrayLike) -> Array:
        """The derivatives of ``sum(weights * f(values))`` by all parameters, by the adjoint: a few runs, however many
        parameters there are. Where many weights come with the same values, as in a Jacobian, sensitivities are computed
        once and used for all of them, if that is less.

        Args:
            values: Of the shape ``(..., parameters)``.
            weights: Of the shape ``(..., samples, outputs)``. Where one is not finite, the derivatives are not numbers.

        Returns:
            Of the shape ``(..., parameters)``.

        Raises:
            UsageError, RunError: as in ``jacobian``.
        """
        x, w = self._given(values), _real(weights, "weights")
        shape = (len(self.t), len(self.outputs))
        if w.shape[-2:] != shape:
            raise UsageError(f"weights has the shape {w.shape}: its last axes are samples and outputs, {shape}")
        ahead = np.broadcast_shapes(x.shape[:-1], w.shape[:-2])
        x, w = np.broadcast_to(x, (*ahead, len(self.parameters))), np.broadcast_to(w, (*ahead, *shape))
        flat, heavy = x.reshape(-1, len(self.parameters)), w.reshape(-1, *shape)
        points, which, times = np.unique(flat, axis=0, return_inverse=True, return_counts=True)
        which = which.reshape(-1)
        # An adjoint takes about two runs, sensitivities one and a quarter of one for each parameter: `bench/learning.py`.
        often = (times > 1) & (8 * times > len(self.parameters) + 4)
        found = np.empty(flat.shape)
        if often.any():
            slopes = self._each(self._jacobian, [points[often]], (*shape, len(self.parameters)))
            of = np.cumsum(often) - 1
            for i in np.flatnonzero(often[which]):
                found[i] = np.einsum("so,sop->p", heavy[i], slopes[of[which[i]]])
        once = np.flatnonzero(~often[which])
        found[once] = self._each(self._back, [flat[once], heavy[once]], (len(self.parameters),), [1, 2])
        found[~np.isfinite(heavy).all(axis=(1, 2))] = np.nan
        return found.reshape(x.shape)

    def jax(self, mode: Literal["reverse", "forward"] = "reverse") -> Callable[[Any], Any]:
        """It as a function of JAX, of an array ``(parameters,)`` to an array ``(samples, outputs)``.

        Runs are made on this computer by ``jax.pure_callback``: the function may stand in what ``jax.jit`` compiles, and a
        compiled program calls back.

        With ``mode="reverse"`` work ``jax.jit``, ``jax.vmap``, ``jax.grad``, ``jax.vjp``, ``jax.jacrev``, ``jax.jacobian``,
        and what is composed of them; derivatives by the adjoint. With ``mode="forward"`` work the same and ``jax.jvp`` and
        ``jax.jacfwd``; derivatives always by ``sensitivities``, for few parameters. Neither has second derivatives
        (``jax.hessian``); ``jax.pmap`` and sharding are not meant for it. Sets of ``vmap`` run in threads.

        A run is always computed in float64. Without ``jax_enable_x64`` JAX hands over float32 and is given float32: parameters
        and results are rounded to seven digits, the run between is not.

        What is raised within a run comes as JAX raises it out of callbacks, ``jax.errors.JaxRuntimeError``, with ``RunError``
        and the reason in its text. Ctrl-C stops at the end of the run.

        Raises:
            UsageError: JAX is not installed.

        >>> import jax, halfarrow as ha
        >>> drop = ha.model("model Drop\\nparam m = 2 kg, F = 10 N\\nSe:weight(F) -> I:mass(m)\\n")
        >>> f = drop.function(["m", "F"], ["mass.f"], to=2, every=1).jax()
        >>> slope = jax.jit(jax.grad(lambda x: f(x)[-1, 0]))
        >>> slope(jax.numpy.array([2.0, 10.0])).round(4).tolist()
        [-5.0, 1.0]
        """
        from ._jax import function

        return function(self, choice("mode", mode, ("reverse", "forward")))

    def torch(self) -> Callable[[Any], Any]:
        """It as a function of PyTorch, of a tensor ``(..., parameters)`` to a tensor ``(..., samples, outputs)``.

        ``backward`` and ``torch.autograd.grad`` go by the adjoint, forward mode (``torch.func.jvp``) by ``sensitivities``;
        ``torch.func.grad``, ``vjp``, ``jacrev``, ``jacfwd`` and ``vmap`` work, whose sets run in threads. There are no second
        derivatives. Runs are made on this computer: tensors of other devices are copied here and back. A run is always
        computed in float64; the result has the type of what was given. What is raised within a run is raised as it is.

        Raises:
            UsageError: PyTorch is not installed.

        >>> import torch, halfarrow as ha
        >>> drop = ha.model("model Drop\\nparam m = 2 kg, F = 10 N\\nSe:weight(F) -> I:mass(m)\\n")
        >>> f = drop.function(["m", "F"], ["mass.f"], to=2, every=1).torch()
        >>> x = torch.tensor([2.0, 10.0], requires_grad=True)
        >>> f(x)[-1, 0].backward()
        >>> x.grad.round(decimals=4).tolist()
        [-5.0, 1.0]
        """
        from ._torch import function

        return function(self)

    def _given(self, values: npt.ArrayLike, what: str = "values") -> Array:
        x = _real(values, what)
        if x.shape[-1:] != (len(self.parameters),):
            raise UsageError(
                f"{what} has the shape {x.shape}: its last axis is {', '.join(self.parameters)}, {len(self.parameters)} numbers"
            )
        return x

    def _each(
        self, work: Callable[..., Array], arrays: list[Array], shape: tuple[int, ...], axes: Sequence[int] | None = None
    ) -> Array:
        """The work on every set, in threads; of what goes wrong the first set's is raised."""
        axes = axes or [1] * len(arrays)
        ahead = arrays[0].shape[: arrays[0].ndim - axes[0]]
        sets = int(np.prod(ahead, dtype=np.int64))
        rows = [array.reshape(sets, *array.shape[len(ahead) :]) for array in arrays]
        if sets == 1:
            alone: Array = work(*(row[0] for row in rows), None)
            return alone.reshape(*ahead, *shape)
        found = np.empty((sets, *shape))
        stop = _Stop()
        with ThreadPoolExecutor(max(1, min(self._threads, sets))) as pool:
            futures = [pool.submit(work, *(row[i] for row in rows), stop) for i in range(sets)]
            try:
                for i, future in enumerate(futures):
                    found[i] = future.result()
            except RunError as why:
                raise RunError(f"set {i + 1} of {sets}: {why}", why.result) from why
            finally:
                stop.asked.set()
                for future in futures:
                    future.cancel()
        return found.reshape(*ahead, *shape)

    def _run(self, x: Array) -> dict[str, Any]:
        """The arguments of a run."""
        parameters, inputs = dict(self._fixed), dict(self._inputs)
        for name, value, is_input in zip(self.parameters, x.tolist(), self._is_input):
            (inputs if is_input else parameters)[name] = value
        return {**self._options, "record": self.outputs, "parameters": parameters, "inputs": inputs}

    def _column(self, run: Result, name: str) -> Array:
        column = run[name]
        if len(column) != len(self.t):
            raise RunError(
                f"the run has {len(column)} samples up to t = {run.t[-1]:g} s, where the function has {len(self.t)}", run
            )
        return column

    def _value(self, x: Array, stop: _Stop | None) -> Array:
        run = self._started.simulate(**self._run(x), project=self._project, progress=stop)
        return np.stack([self._column(run, name) for name in self.outputs], axis=-1)

    def _jacobian(self, x: Array, stop: _Stop | None) -> Array:
        return self._slopes(x, range(len(self.parameters)), stop)

    def _smooth(self) -> None:
        if self._project:
            raise UsageError("runs whose positions are put back are not differentiated: make the function without `project`")

    def _slopes(self, x: Array, some: Sequence[int], stop: _Stop | None) -> Array:
        """Derivatives by some of the parameters."""
        self._smooth()
        by = [self.parameters[i] for i in some]
        found = self._started.sensitivities(by, **self._run(x), progress=stop)
        self._column(found.result, self.outputs[0])
        slopes = [[found[name, own] * self._scale[i] for i, own in zip(some, by)] for name in self.outputs]
        return np.array(slopes).transpose(2, 0, 1)

    def _along(self, x: Array, v: Array, stop: _Stop | None) -> Array:
        some = np.flatnonzero(v).tolist()
        if not some:
            return np.zeros_like(self._value(x, stop))
        along: Array = self._slopes(x, some, stop) @ v[some]
        return along

    def _back(self, x: Array, w: Array, stop: _Stop | None) -> Array:
        if not np.isfinite(w).all():
            return np.full(len(x), np.nan)
        self._smooth()
        weights = {name: np.ascontiguousarray(w[:, i]) for i, name in enumerate(self.outputs)}
        found = self._started.gradient(weights, by=self.parameters, **self._run(x), progress=stop)
        slopes: Array = np.array([found[name] for name in self.parameters]) * self._scale
        return slopes

    def __reduce__(self) -> tuple[Any, ...]:
        to, every, at, options, threads, project = self._made
        return Function, (
            self.model, self.parameters, self.outputs, to, every, at, self._fixed, self._inputs, options, threads,
            project,
        )  # fmt: skip

    def _rows(self) -> list[tuple[Any, ...]]:
        units = self.parameter_units
        return [(name, units[name], float(value)) for name, value in zip(self.parameters, self.values)]

    def __repr__(self) -> str:
        head = f"{self.model.name}: {len(self.t)} samples of {', '.join(self.outputs)}"
        return f"{head}\n" + as_text(("by", "unit", "value"), self._rows())

    def _repr_html_(self) -> str:
        return as_html(("by", "unit", "value"), self._rows())


def _real(values: npt.ArrayLike, what: str) -> Array:
    try:
        if np.iscomplexobj(values):
            raise TypeError("they are complex, and a run is not")
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as why:
        raise UsageError(f"{what} cannot be taken: {why}") from None


class _Stop:
    """A bar that stops runs where another set has failed."""

    def __init__(self) -> None:
        self.asked = threading.Event()

    def update(self, _: float) -> None:
        if self.asked.is_set():
            raise RunError("stopped, since another set has failed")

    def close(self) -> None:
        pass


def _quantities(model: Model, parameters: Sequence[str]) -> list[str]:
    """What it is a function of."""
    asked = [parameters] if isinstance(parameters, str) else list(parameters)
    if not asked:
        raise UsageError("a function is of something: give parameters, as in `parameters=[\"ks\", \"spring.q(0)\"]`")
    found: list[str] = []
    names = model._names
    for name in asked:
        starts = [f"{state}(0)" for state in names.states]
        if name.endswith("(0)") and name[: -len("(0)")] not in names.variables:
            raise unknown("start value", name, starts)
        if name.endswith("(0)") or name in names.inputs:
            found.append(name)
        elif names.is_parameter(name):
            found += names.members(name)
        else:
            free = [own for own, p in names.parameters.items() if not p.constant]
            raise unknown("parameter, input or start value", name, [*free, *names.inputs, *starts])
    for name in found:
        parameter = names.parameters.get(name)
        if parameter is not None and parameter.constant:
            raise UsageError(f"`{name}` is a constant, which cannot be set")
        if parameter is not None and parameter.shapes:
            raise UsageError(f"`{name}` shapes the model, which is no differentiable function of it")
    twice = next((name for name in found if found.count(name) > 1), None)
    if twice is not None:
        raise UsageError(f"`{twice}` stands twice")
    return found


def _outputs(model: Model, outputs: str | Sequence[str]) -> list[str]:
    names = [outputs] if isinstance(outputs, str) else list(outputs)
    if not names:
        raise UsageError("a function gives something: name outputs, as in `outputs=[\"travel\"]`")
    known = model._names.variables
    for name in names:
        if name not in known:
            raise unknown("variable", name, known)
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UsageError(f"`{twice}` stands twice")
    return names


def _samples(to: float, every: float | None, at: npt.ArrayLike | None) -> Array:
    """Times of the samples: as many in every run."""
    if (every is None) == (at is None):
        raise UsageError("as many samples in every run: give either `every` or `at`")
    if at is not None:
        given_times = numbers(np.atleast_1d(np.asarray(at, dtype=np.float64)))
        if not len(given_times):
            raise UsageError("at has no times")
        return given_times if given_times[-1] >= to else np.append(given_times, to)
    assert every is not None
    if not (every > 0 and to > 0):
        raise UsageError(f"to is {to} and every is {every}: both have to be above 0")
    parts = int(np.floor(to / every * (1 + 1e-12)))
    times: Array = float(every) * np.arange(parts + 1, dtype=np.float64)
    return times if to - times[-1] <= 1e-9 * to else np.append(times, to)


def _per_unit(model: Model, name: str) -> float:
    """SI units in the unit of an input."""
    unit = model.inputs[name].unit
    if unit is None:
        return 1.0
    text = f"model U\nparam one = 1 {unit}, two = 2 {unit}\nSe:s(1) -> R:r(1)\n"
    known = type(model)(_halfarrow.Model.from_text("unit.bond", text, {}, [])).parameters
    return known["two"].value - known["one"].value


def missing(package: str) -> UsageError:
    """The library is not there."""
    return needed(package, package, f"a function of {'JAX' if package == 'jax' else 'PyTorch'}")
