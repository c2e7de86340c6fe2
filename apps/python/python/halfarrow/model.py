"""Models: loaded, asked, run."""

from __future__ import annotations

import contextlib
import dataclasses
import html
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from . import _halfarrow, global_sensitivity, sweeps
from ._errors import (
    AuditWarning,
    Diagnostic,
    FileError,
    Interrupted,
    ModelWarning,
    RunError,
    UnknownNameError,
    UsageError,
    choice,
    unknown,
)
from ._inputs import InputLike, all_given, number, numbers
from ._progress import Bar
from ._tables import as_html, record
from ._words import hint, in_python
from .comparison import Comparison
from .equations import Equations
from .fitting import Bounds, Data, Experiment, Fit, Loss, fit
from .functions import Function
from .gradients import Gradient, Objective, asked, variables
from .identifiability import Identifiability, identifiability
from .linear import Linearization
from .loops import Loops
from .picture import Picture
from .result import Result
from .sensitivities import Sensitivities
from .stepper import Stepper

if TYPE_CHECKING:
    import pandas

Form: TypeAlias = Literal["minimal", "kane", "inverted", "break", "relaxed", "lagrange", "stiff"]
FixedMethod: TypeAlias = Literal[
    "euler", "heun", "rk4", "implicit-midpoint", "linearly-implicit-euler", "linearly-implicit-bdf2", "rosenbrock",
]  # fmt: skip
Method: TypeAlias = Literal[
    "auto", "explicit", "bdf", "radau",
    "euler", "heun", "rk4", "implicit-midpoint", "linearly-implicit-euler", "linearly-implicit-bdf2", "rosenbrock",
]  # fmt: skip
Target: TypeAlias = Literal["c", "fmu2", "fmu3", "casadi", "latex"]
Stage: TypeAlias = Literal["ast", "bond_graph", "causal_graph", "causal_paths", "equations", "program"]

Value: TypeAlias = float | str
"""A value of a parameter: a number in SI units, or text with a unit such as ``"20 kN/m"``."""

_FORMS = ("minimal", "kane", "inverted", "break", "relaxed", "lagrange", "stiff")
_FIXED = (
    "euler", "heun", "rk4", "implicit-midpoint", "linearly-implicit-euler", "linearly-implicit-bdf2", "rosenbrock",
)  # fmt: skip
_METHODS = ("auto", "explicit", "bdf", "radau", *_FIXED)
_TARGETS = {"c": "", "fmu2": ".fmu", "fmu3": ".fmu", "casadi": ".py", "latex": ".tex"}
_STAGES = ("ast", "bond_graph", "causal_graph", "causal_paths", "equations", "program")

# Points at which a function of time is called where nothing says how far apart.
_POINTS = 1000


@dataclasses.dataclass(frozen=True)
class Parameter:
    """A parameter or constant of a model."""

    name: str
    value: float
    """In SI units."""
    unit: str | None
    """SI unit, where known."""
    constant: bool
    """Whether it cannot be set."""
    shapes: bool
    """Whether it shapes the model, which is compiled anew for another value."""


@dataclasses.dataclass(frozen=True)
class Input:
    """An input of a model."""

    name: str
    unit: str | None
    """The unit of the values that it is given, where known."""


@dataclasses.dataclass(frozen=True)
class Variable:
    """A variable that can be recorded."""

    name: str
    unit: str | None
    """The unit of its values in results, where known."""
    default: bool
    """Whether it is recorded without being asked for."""


def load(
    path: str | os.PathLike[str],
    *,
    allow: Iterable[str | os.PathLike[str]] = (),
    parameters: Mapping[str, Value | Sequence[float]] | None = None,
) -> Model:
    """Reads a model from a file that ends in ``.bond``, and what it imports from its folder and below.

    Args:
        path: The file.
        allow: Other folders from which it may read.
        parameters: Values of parameters in the place of those that the text gives.

    Raises:
        ModelError: the model has errors.
        FileError: the file cannot be read.

    Warns:
        ModelWarning: something is odd in the model.
    """
    if "\n" in os.fspath(path):
        raise UsageError("this is no path but a text of several lines: give the text of a model to `halfarrow.model`")
    core = _halfarrow.Model.load(os.fspath(path), [os.fspath(folder) for folder in allow], _overrides(parameters or {}))
    return _told(Model(core))


def model(
    text: str,
    *,
    files: Mapping[str, str] | None = None,
    name: str = "model.bond",
    parameters: Mapping[str, Value | Sequence[float]] | None = None,
) -> Model:
    """A model from its text.

    Args:
        text: The text, in the language of ``docs/language.md``.
        files: Texts that it may import and read tables from, by path.
        name: What the text is called in messages.
        parameters: Values of parameters in the place of those that the text gives.

    Raises:
        ModelError: the model has errors.

    Warns:
        ModelWarning: something is odd in the model.

    >>> import halfarrow as ha
    >>> try:
    ...     ha.model("model Drop\\nSe:weight(9.81 N) -> I:mass(m)\\n")
    ... except ha.ModelError as error:
    ...     print(error)
    error[N001]: `m` is not declared
     --> model.bond:2:29
      |
    2 | Se:weight(9.81 N) -> I:mass(m)
      |                             ^ no such parameter or signal
      |
      = hint: declare it: `param m = …`
    """
    if "\n" not in text and text.strip().endswith(".bond"):
        raise UsageError(f"`{text}` is the name of a file, not the text of a model: `halfarrow.load` reads files")
    return _told(Model(_halfarrow.Model.from_text(name, text, dict(files or {}), _overrides(parameters or {}))))


def _told(loaded: Model) -> Model:
    for diagnostic in loaded._noticed():
        warnings.warn(ModelWarning(str(diagnostic), diagnostic), stacklevel=3)
    return loaded


def _overrides(values: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [(name, _as_text(name, value)) for name, value in values.items()]


def _as_text(name: str, value: Any) -> str:
    """A value as the model language writes it."""
    if isinstance(value, str):
        return value
    if isinstance(value, (Sequence, np.ndarray)) and np.ndim(value):
        return "[" + ", ".join(_as_text(name, each) for each in value) + "]"
    return repr(_number(name, value))


def _number(name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise UsageError(f"`{name}` is {value!r}: give a number in SI units, or text with a unit") from None


class Model:
    """A model: a bond graph that can be asked and run. ``ha.load`` and ``ha.model`` make one.

    Its equations are derived when they are first needed, and kept for all runs after that. A model never changes:
    ``with_parameters`` gives another one. It can be pickled, as text and values of parameters. Notebooks show its drawing,
    its parameters and what is odd about it.

    >>> import halfarrow as ha
    >>> car = ha.model('''model Car "quarter of a car"
    ... param ks = 18 kN/m, ms = 320 kg
    ... input road : m/s = 0
    ... Sf:ground(road) -> 0:strut -> 1:v -> I:body(ms)
    ... strut -> C:spring(k = ks)
    ... strut -> R:damper(g = 1e-3)
    ... output travel = spring.q : mm
    ... ''')
    >>> car.parameters["ks"].value, car.parameters["ks"].unit
    (18000.0, 'N/m')
    >>> r = car.simulate(to=1, every=0.5, ks=20e3, road=lambda t: 0.1)
    >>> list(r), r.units["travel"]
    (['body.f', 'spring.q', 'travel'], 'mm')
    """

    def __init__(self, core: _halfarrow.Model) -> None:
        self._core = core
        self._known: _Names | None = None

    @property
    def name(self) -> str:
        """Its name, as the text says."""
        return self._core.name

    @property
    def text(self) -> str:
        """Its text."""
        return self._core.parts()[1]

    @property
    def files(self) -> dict[str, str]:
        """Texts of the files that it has read, by path; components that come with the program are not among them."""
        return self._core.parts()[2]

    def _noticed(self) -> list[Diagnostic]:
        return [Diagnostic._of(told) for told in self._core.warnings()]

    @property
    def warnings(self) -> list[Diagnostic]:
        """Everything that is odd about it, found by all stages.

        Raises:
            ModelError: it has errors that only later stages find.
        """
        return [Diagnostic._of(told) for told in self._core.check()]

    @property
    def _names(self) -> _Names:
        if self._known is None:
            self._known = _Names(self._core.interface())
        return self._known

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Parameters and constants by name, with their values in SI units."""
        return dict(self._names.parameters)

    @property
    def inputs(self) -> dict[str, Input]:
        """Inputs by name."""
        return dict(self._names.inputs)

    @property
    def states(self) -> list[str]:
        """Names of the states, in order."""
        return list(self._names.states)

    @property
    def variables(self) -> dict[str, Variable]:
        """All that can be recorded, by name: states and outputs first."""
        return dict(self._names.variables)

    @property
    def timings(self) -> dict[str, float]:
        """Seconds that each stage took so far: ``ast``, ``bond_graph``, ``causal_graph``, ``equations``, ``program``,
        ``code``, ``start``, ``run``. What is kept is not done again.

        >>> import halfarrow as ha
        >>> drop = ha.model("model Drop\\nSe:weight(9.81 N) -> I:mass(1 kg)\\n")
        >>> _ = drop.simulate(to=1)
        >>> before = drop.timings["equations"]
        >>> _ = drop.simulate(to=1)
        >>> drop.timings["equations"] == before
        True
        """
        return {stage["stage"]: stage["seconds"] for stage in self._core.timings()}

    def with_parameters(self, values: Mapping[str, Any] | None = None, /, **more: Any) -> Model:
        """The same model with other values of parameters: numbers in SI units, text in the model language
        (``"20 kN/m"``, ``"2*k0"``), lists for arrays. Files are not read again.

        Args:
            values: Values by name, for names with dots or brackets.
            more: Values of parameters whose names are words.

        Raises:
            UsageError: there is no such parameter, or the value does not fit it.
            ModelError: the model has errors with these values.
        """
        return Model(self._core.with_parameters(_overrides({**(values or {}), **more})))

    def show(self, stage: Stage) -> str:
        """A stage of the compiler as text: ``ast``, ``bond_graph``, ``causal_graph``, ``causal_paths``, ``equations`` or
        ``program``."""
        return self._core.show(choice("stage", stage, _STAGES))

    @property
    def loops(self) -> Loops:
        """Zero-order causal paths and what becomes of them, storages, counts of equations."""
        return Loops._of(self._core.loops())

    def equations(self, form: Form = "minimal", only: str | Sequence[str] = ()) -> Equations:
        """The equations.

        Args:
            form: ``minimal``, ``kane``, ``inverted``, ``break``, ``relaxed``, ``lagrange`` or ``stiff``.
            only: Variables whose equations are wanted alone; nothing: all.

        Raises:
            UnknownNameError: there is no such variable.
            ModelError: the form does not apply to the model.
        """
        names = [only] if isinstance(only, str) else list(only)
        choice("form", form, _FORMS)
        try:
            return Equations._of(self._core.equations(form, names), self)
        except UnknownNameError:
            for name in names:
                if name not in self.variables:
                    raise unknown("variable", name, self.variables) from None
            told = ", ".join(f"`{name}`" for name in names)
            raise UsageError(
                f"one of {told} has no equation, as outputs and junctions: ask for variables of elements"
            ) from None

    def draw(self, *, paths: Iterable[int] | None = None, laws: bool = True, first_cells: bool = False) -> Picture:
        """The bond graph with causal strokes, numbered bonds and causal paths.

        Args:
            paths: Numbers of the causal paths to draw, from 1; nothing: the first twelve.
            laws: Whether laws and values stand at the elements.
            first_cells: Whether of a repetition only the first of cells that are made alike is drawn.
        """
        return Picture(self._core.draw(None if paths is None else list(paths), laws, first_cells))

    def simulate(
        self,
        to: float,
        *,
        every: float | None = None,
        at: npt.ArrayLike | None = None,
        method: Method = "auto",
        step: float | None = None,
        rtol: float = 1e-6,
        atol: float | None = None,
        form: Form = "minimal",
        start: Literal["given", "equilibrium"] = "given",
        record: str | Sequence[str] | None = None,
        also: str | Sequence[str] = (),
        project: bool = False,
        minimum_norm: bool = False,
        stiffness: float | None = None,
        damping: float | None = None,
        execution: Literal["auto", "bytecode", "machine"] = "auto",
        sample: float | None = None,
        parameters: Mapping[str, Value] | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        progress: Any = None,
        **values: Any,
    ) -> Result:
        """Computes a trajectory, and audits it against the bond graph. Others may use the interpreter meanwhile; Ctrl-C
        stops the run and keeps what was computed.

        Args:
            to: End of the run in s; it begins at 0.
            every: Time between samples in s; nothing: every step, of methods of variable step with three samples inside (of
                the first 2000 steps, if up to 500 variables of at most 20,000 are recorded), between which a run is as
                exact as at them.
            at: Times of the samples in s, ascending, in the place of these; the end is sampled too.
            method: ``auto``, ``explicit``, ``bdf`` or ``radau`` with steps of variable length; ``euler``, ``heun``, ``rk4``,
                ``implicit-midpoint``, ``linearly-implicit-euler``, ``linearly-implicit-bdf2`` or ``rosenbrock`` with steps of
                fixed length.
            step: Step of a method with fixed step in s, longest step of the others.
            rtol: Relative error allowed in a step.
            atol: Absolute error allowed in a step, in the unit of each state; nothing: scaled to each state.
            form: The form of the equations.
            start: ``given``, as the model says, or ``equilibrium``, at rest as near to that as possible.
            record: Variables to record; nothing: states and outputs; ``"all"``: everything.
            also: Variables to record beside states and outputs.
            project: Whether positions that only speeds keep are put back onto their relations.
            minimum_norm: Whether reactions that are not unique are those of least norm.
            stiffness, damping: Springs of the form ``stiff``.
            execution: ``auto``, ``bytecode`` or ``machine``; results are the same to the last bit.
            sample: Time in s between the points at which functions of time are called; nothing: ``every``, else ``step``,
                else a thousandth of the run.
            parameters: Values of parameters by name: numbers in SI units, or text with units.
            inputs: Inputs by name, in the units of their declarations: a number, ``(times, values)``, a function of time, a
                series of pandas or xarray, the path of a CSV file. Straight between values; a time that stands twice is a
                jump.
            progress: True for a bar of tqdm, or a bar like it, or what makes one.
            values: Parameters and inputs whose names are words.

        Returns:
            What was recorded: arrays of the shape ``(samples,)`` by the names of variables.

        Raises:
            UnknownNameError: there is no parameter, input or variable of a name.
            UsageError: something is asked that cannot be.
            RunError: the run stopped, or its result does not satisfy the model; ``result`` has what was computed.
            Interrupted: Ctrl-C; ``result`` has what was computed.

        Warns:
            AuditWarning: a law or a balance is missed by more than a millionth.
            ModelWarning: something else is to be known.
        """
        set_values, given = self._split(values, parameters, inputs)
        options = _options(
            to=to, every=every, at=_times(at), method=method, step=step, rtol=rtol, atol=atol, form=form, start=start,
            record=_recorded(record, also), project=project, minimum_norm=minimum_norm, stiffness=stiffness,
            damping=damping, execution=execution, sensitivities=[],
        )  # fmt: skip
        if sample is None:
            sample = every or step or to / _POINTS
        with Bar(progress, to, self.name, "s") as bar:
            ended = self._core.simulate(options, all_given(given, to, sample), set_values, bar.reach if bar else None)
            bar.reach(ended.reached)
        result = Result(self, ended, to)
        _conclude(ended, result)
        return result

    def sensitivities(
        self,
        by: str | Sequence[str],
        to: float,
        *,
        every: float | None = None,
        at: npt.ArrayLike | None = None,
        method: Method = "auto",
        step: float | None = None,
        rtol: float = 1e-6,
        atol: float | None = None,
        start: Literal["given", "equilibrium"] = "given",
        record: str | Sequence[str] | None = None,
        also: str | Sequence[str] = (),
        execution: Literal["auto", "bytecode", "machine"] = "auto",
        sample: float | None = None,
        parameters: Mapping[str, Value] | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        progress: Any = None,
        **values: Any,
    ) -> Sensitivities:
        """A trajectory and its exact derivatives: the variational equations are integrated beside the states by the same
        method, through events, whose instants move, and through the start. The errors of derivatives are controlled as those
        of states are.

        Args:
            by: Parameters, constant inputs, and start values such as ``body.q(0)``.
            to, every, at, method, step, rtol, atol, start, record, also, execution, sample, parameters, inputs, progress,
                values: As in ``simulate``; a linearly implicit method cannot be taken.

        Raises:
            UsageError: a quantity is unknown, or the model is no differentiable function of it.
            RunError: the run stopped, or has come to where there is no derivative, which is told with time and place.
            UnknownNameError, Interrupted: as in ``simulate``.

        Warns:
            AuditWarning, ModelWarning: as in ``simulate``.
        """
        set_values, given = self._split(values, parameters, inputs)
        quantities = [by] if isinstance(by, str) else list(by)
        options = _options(
            to=to, every=every, at=_times(at), method=method, step=step, rtol=rtol, atol=atol, form="minimal", start=start,
            record=_recorded(record, also), project=False, minimum_norm=False, stiffness=None, damping=None,
            execution=execution, sensitivities=quantities,
        )  # fmt: skip
        sample = sample or every or step or to / _POINTS
        with Bar(progress, to, self.name, "s") as bar:
            ended = self._core.simulate(options, all_given(given, to, sample), set_values, bar.reach if bar else None)
            bar.reach(ended.reached)
        result = Result(self, ended, to)
        _conclude(ended, result)
        return Sensitivities(result, quantities)

    def gradient(
        self,
        of: Objective,
        to: float,
        by: str | Sequence[str] = (),
        *,
        every: float | None = None,
        at: npt.ArrayLike | None = None,
        method: Method = "auto",
        step: float | None = None,
        rtol: float = 1e-6,
        atol: float | None = None,
        start: Literal["given", "equilibrium"] = "given",
        record: str | Sequence[str] | None = None,
        also: str | Sequence[str] = (),
        execution: Literal["auto", "bytecode", "machine"] = "auto",
        sample: float | None = None,
        parameters: Mapping[str, Value] | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        progress: Any = None,
        **values: Any,
    ) -> Gradient:
        """The derivatives of one number that a run comes to by any number of parameters, at the cost of a few runs: the run is
        followed backwards (adjoint method), step by step where steps have a fixed length, else along its path to the same
        tolerance; through events, solve blocks and the start. Every step is kept meanwhile. Few parameters and many numbers:
        ``sensitivities``.

        Args:
            of: What is differentiated: ``"rms(travel)"`` or ``("travel", "rms")`` with a reduction of ``sweep``; weights of the
                samples by the names of variables, whose weighted sum it is; or a function that is given what was recorded, by
                name (``"t"``: the times), and gives the number and its derivatives by what was recorded, arrays by name.
            by: Parameters, constant inputs, and start values such as ``body.q(0)``; nothing: all parameters.
            to, every, at, method, step, rtol, atol, start, record, also, execution, sample, parameters, inputs, progress,
                values: As in ``simulate``; a linearly implicit method cannot be taken.

        Returns:
            The derivatives by name, with ``value`` and the run as ``result``.

        Raises:
            UsageError: a quantity is unknown, or the model is no differentiable function of it.
            RunError: the run stopped, or has come to where there is no derivative, which is told with time and place.
            UnknownNameError, Interrupted: as in ``simulate``.

        Warns:
            AuditWarning, ModelWarning: as in ``simulate``.
        """
        set_values, given = self._split(values, parameters, inputs)
        more = [*([also] if isinstance(also, str) else also), *variables(of)]
        recorded = _recorded(record, [name for name in dict.fromkeys(more) if name != record and name not in (record or ())])
        options = _options(
            to=to, every=every, at=_times(at), method=method, step=step, rtol=rtol, atol=atol, form="minimal", start=start,
            record=recorded, project=False, minimum_norm=False, stiffness=None, damping=None,
            execution=execution, sensitivities=[by] if isinstance(by, str) else list(by),
        )  # fmt: skip
        sample = sample or every or step or to / _POINTS
        sent = all_given(given, to, sample)
        with Bar(progress, to, self.name, "s") as bar:
            value, slopes, without, ended = self._core.gradient(
                options, sent, set_values, asked(of), bar.reach if bar else None
            )
            bar.reach(ended.reached)
        result = Result(self, ended, to)
        _conclude(ended, result)
        return Gradient(value, slopes, without, result)

    def function(
        self,
        parameters: str | Sequence[str],
        outputs: str | Sequence[str],
        to: float,
        *,
        every: float | None = None,
        at: npt.ArrayLike | None = None,
        method: Method = "auto",
        step: float | None = None,
        rtol: float = 1e-8,
        atol: float | None = None,
        start: Literal["given", "equilibrium"] = "given",
        project: bool = False,
        execution: Literal["auto", "bytecode", "machine"] = "auto",
        threads: int | None = None,
        fixed: Mapping[str, Value] | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        **values: Any,
    ) -> Function:
        """The model as a differentiable function, from an array ``(parameters,)`` to an array ``(samples, outputs)``: of NumPy
        with ``jvp``, ``vjp`` and ``jacobian``, of JAX (``.jax()``) and of PyTorch (``.torch()``).

        Args:
            parameters: What it is a function of: parameters, start values such as ``spring.q(0)``, inputs, which are then
                constant.
            outputs: Variables that it gives.
            to: End of the runs in s.
            every, at: As in ``simulate``; one of them, that every run has as many samples. The end is the last sample.
            method, step, rtol, atol, start, execution: As in ``simulate``; derivatives have no linearly implicit method.
            project: Whether positions that only speeds keep are put back onto their relations, as in ``simulate``. There are no
                derivatives then: they are asked for in vain.
            threads: Runs at the same time, where there are several sets; nothing: as many as there are processors.
            fixed: Values of other parameters by name.
            inputs: Other inputs over time, as in ``simulate``; a function of time is called once.
            values: Other parameters and inputs whose names are words.

        Raises:
            UnknownNameError: there is no parameter, input, start value or variable of a name.
            UsageError: something is asked that cannot be.

        >>> import halfarrow as ha
        >>> rc = ha.model("model RC\\nparam r = 2, u = 3\\nSe:s(u) -> 1:j -> R:wire(r)\\nj -> C:store(0.5)\\n")
        >>> f = rc.function(["r", "store.q(0)"], "store.q", to=2, at=[1, 2])
        >>> f.vjp(f.values, [[0], [1]]).round(4)
        array([-0.203 ,  0.1353])
        """
        set_values, given = self._split(values, fixed, inputs)
        options = dict(
            method=choice("method", method, _METHODS), step=step, rtol=rtol, atol=atol, start=_start(start),
            execution=choice("execution", execution, ("auto", "bytecode", "machine")),
        )  # fmt: skip
        asked = [parameters] if isinstance(parameters, str) else parameters
        named = [outputs] if isinstance(outputs, str) else outputs
        return Function(self, asked, named, to, every, at, dict(set_values), given, options, threads, project)

    def fit(
        self,
        data: Data | Sequence[Experiment],
        params: Mapping[str, Bounds],
        *,
        to: float | None = None,
        outputs: Mapping[str, str] | None = None,
        sigma: Mapping[str, Any] | None = None,
        start: int = 1,
        begin: Literal["given", "equilibrium"] = "given",
        loss: Loss = "linear",
        f_scale: float = 1.0,
        method: Method = "auto",
        step: float | None = None,
        rtol: float = 1e-8,
        tolerance: float = 1e-10,
        most: int | None = None,
        seed: int = 0,
        parameters: Mapping[str, Value] | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        **values: Any,
    ) -> Fit:
        """Fits parameters to measurements by least squares with exact derivatives: ``scipy.optimize.least_squares``, a
        trust-region method with bounds. Standard errors, correlations and what the data do not tell come with it.

        Args:
            data: What was measured: columns by name, with times in ``t`` in s; or several ``Experiment``, fitted at once.
            params: What is fitted, parameters and start values such as ``spring.q(0)``: for each nothing, a first guess, ``(least, greatest)`` or
                ``(least, guess, greatest)``, as numbers in SI units or text with units. Where there is no guess the value of
                the model is one.
            to: End of the runs in s; nothing: the last time of the data.
            outputs: Columns by the variables that they are measurements of, in the units of these variables.
            sigma: Standard deviations of the measurements by variable: a number, or the name of a column. Nothing: one
                variance is estimated, of which each output has a part by the spread of what was measured.
            start: From how many points it is searched: from the guesses, then from a Latin hypercube in the bounds; where
                there are none, between a tenth and ten times the guess.
            begin: Where runs begin, ``given`` or ``equilibrium``.
            loss, f_scale: What outliers count, as in SciPy: ``linear``, ``soft_l1``, ``huber``, ``cauchy``, ``arctan``.
            method, step, rtol: As in ``simulate``.
            tolerance: Relative changes at which the search ends.
            most: Evaluations at most from each point.
            seed: Of the points from which it is searched.
            parameters, inputs, values: As in ``simulate``; an input that is given the name of a column is that column.

        Raises:
            UsageError: the data do not fit together, or the model is no differentiable function of a parameter.
            UnknownNameError: there is no parameter, variable or column of a name.
            RunError: the model does not run from any of the points.

        >>> import halfarrow as ha
        >>> import numpy as np
        >>> drop = ha.model("model Drop\\nparam m = 1 kg, b = 1 N.s/m\\nSe:weight(9.81 N) -> 1:v -> I:mass(m)\\nv -> R:drag(b)\\n")
        >>> t = np.linspace(0, 4, 41)
        >>> f = drop.fit({"t": t, "v": 9.81 / 3 * (1 - np.exp(-3 / 2 * t))}, {"m": (0.1, 10), "b": None}, outputs={"mass.f": "v"})
        >>> round(f["m"], 6), round(f["b"], 6), f.rank
        (2.0, 3.0, 2)
        """
        set_values, given = self._split(values, parameters, inputs)
        experiments = list(data) if isinstance(data, Sequence) and not isinstance(data, str) else [Experiment(data)]
        for experiment in experiments:
            if not isinstance(experiment, Experiment):
                raise UsageError("several sets of data are given as a list of `halfarrow.Experiment`")
        shared = [
            dataclasses.replace(e, inputs={**given, **e.inputs}, parameters={**dict(set_values), **e.parameters})
            for e in experiments
        ]
        options: dict[str, Any] = {"method": choice("method", method, _METHODS), "step": step, "rtol": rtol}
        options["start"] = _start(begin)
        return fit(
            self, shared, params, outputs or {}, sigma or {}, to, start, loss, f_scale, tolerance, most, seed, options
        )

    def identifiability(
        self,
        by: str | Sequence[str],
        outputs: str | Sequence[str],
        *,
        to: float,
        excite: Mapping[str, float] | None = None,
        points: int = 3,
        seed: int = 0,
        parameters: Mapping[str, Value] | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        **values: Any,
    ) -> Identifiability:
        """Which parameters measurements without noise would tell, whatever their values: the rank of the exact derivatives of
        outputs, by the values of the model and at some others near them. What is found here no better data will tell.

        Args:
            by: Parameters, and start values such as ``spring.q(0)``.
            outputs: Variables that are measured.
            to: End of the run in s.
            excite: Amplitudes of inputs that move in all ways, each as a sum of five sines; others as they are given.
            points: Other values of the parameters, up to a fifth away.
            seed: Of these values and inputs.
            parameters, inputs, values: As in ``simulate``.

        Raises:
            UsageError, UnknownNameError, RunError: as in ``sensitivities``.
        """
        set_values, given = self._split(values, parameters, inputs)
        self._names.check_inputs(excite or {})
        named = [[name] if isinstance(name, str) else list(name) for name in (by, outputs)]
        options = {"parameters": dict(set_values), "inputs": given}
        return identifiability(self, named[0], named[1], to, excite or {}, points, seed, options)

    def linearize(
        self,
        at: Literal["start", "equilibrium"] | float = "start",
        *,
        between: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        symbolic: bool = False,
        sample: float | None = None,
        parameters: Mapping[str, Value] | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        **values: Any,
    ) -> Linearization:
        """Matrices, poles and zeros near a point, with exact derivatives.

        Args:
            at: ``start``, ``equilibrium``, or a time in s.
            between: Inputs of the matrices: inputs of the model, and sources, to whose value the input is added. Nothing:
                the declared inputs; if there are none, the sources in the model itself,
            outputs: Outputs of the matrices: anything that can be recorded. Nothing: the declared outputs; if there are none,
                the states.
            symbolic: Whether ``report["symbolic"]`` has matrices and transfer functions as expressions.
            sample: As in ``simulate``; nothing: a thousandth of the time.
            parameters, inputs, values: As in ``simulate``.

        Raises:
            UnknownNameError: there is no such input, output or parameter.
            UsageError: there is no such point, or the model has no matrices there.
        """
        set_values, given = self._split(values, parameters, inputs)
        to = float(at) if not isinstance(at, str) else 0.0
        options = {
            "at": at if isinstance(at, str) else to,
            "inputs": None if between is None else list(between),
            "outputs": None if outputs is None else list(outputs),
            "symbolic": symbolic,
        }
        return Linearization(self._core.linearize(options, all_given(given, to, sample or to / _POINTS), set_values))

    def sweep(
        self,
        to: float,
        *,
        step: float | None = None,
        method: Method | None = None,
        every: float | None = None,
        rtol: float = 1e-6,
        start: Literal["given", "equilibrium"] = "given",
        project: bool = False,
        record: str | Sequence[str] | None = None,
        also: str | Sequence[str] = (),
        reduce: Mapping[str, tuple[str, str]] | Sequence[str] | None = None,
        samples: pandas.DataFrame | Mapping[str, npt.ArrayLike] | None = None,
        execution: Literal["auto", "bytecode", "machine"] = "auto",
        sample: float | None = None,
        parameters: Mapping[str, Value | Sequence[Value]] | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        executor: Executor | Callable[[], Executor] | None = None,
        chunk: int | None = None,
        journal: str | os.PathLike[str] | None = None,
        into: str | os.PathLike[str] | None = None,
        whole: bool = False,
        restart: bool = False,
        progress: Any = None,
        **values: Any,
    ) -> sweeps.SweepResult:
        """Runs the model for many sets of parameters: every value of a parameter with every value of the others, and with
        every row of ``samples``. A sample of the sets is audited. Ctrl-C stops it and keeps the sets that are done.

        Args:
            to: End of each run in s.
            step: Step of a method with fixed step in s.
            method: As in ``simulate``; nothing: ``rk4`` where there is a step, which runs sixteen sets at once on vectors,
                else ``auto``.
            every, rtol, start, project, record, also, execution, sample, inputs: As in ``simulate``. Reductions go over the
                samples, without ``every`` over the motion within steps of variable length.
            reduce: What is kept of each run: by the name of its column a variable and one of ``initial``, ``final``,
                ``min``, ``max``, ``max_abs``, ``mean``, ``rms``, ``time_of_max``; or texts such as ``"max(body.f)"``.
                Nothing: the last value of what is recorded.
            samples: A frame, or arrays by name: a row for each set, in SI units.
            parameters: Values of parameters by name: one for all sets, or several that vary.
            executor: Any ``concurrent.futures.Executor``, of threads, processes, joblib's loky, Dask
                (``client.get_executor()``), Ray or MPI. Each worker is sent the text once, and compiles it once; sets go as
                arrays. Nothing: all cores of this computer. Results have the same bits. Or what makes an executor, such as
                ``ProcessPoolExecutor`` or ``get_reusable_executor``: if a worker is killed, another one is made.
            chunk: Sets in a task of an executor.
            journal: A file to which every part is written when it is done. The same call goes on from it after the program was
                killed, with any executor; a complete one gives the result at once.
            into: A folder into which the workers write the rows, as Parquet files, in the place of the memory of this program;
                it goes on as with ``journal``. The folder has to be there for all workers (``pip install
                halfarrow[parquet]``). The result reads columns when they are asked for.
            whole: Whether ``into`` gets whole trajectories: a row for each sample, with the number of its set, its parameters,
                ``t`` and what is recorded. Every run is audited.
            restart: Whether to begin anew, whatever ``journal`` or ``into`` have.
            progress: As in ``simulate``.
            values: Parameters and inputs whose names are words: ``ks=np.linspace(10e3, 30e3, 50)``, ``b=600``.

        Returns:
            Arrays of the shape ``(sets,)`` by the names of columns.

        Raises:
            UnknownNameError, UsageError: as in ``simulate``.
            RunError: all sets failed, or a worker was killed and took its executor along; ``result`` has the sets that are
                done.
            Interrupted: Ctrl-C; ``result`` has the sets that are done.

        Warns:
            ModelWarning: a set failed.
            AuditWarning: a set that was audited misses a law or a balance.
        """
        several, given = self._several(values, parameters, inputs)
        for name, value in several.items():
            if np.ndim(value) > 1:
                raise UsageError(f"`{name}` is given values in {np.ndim(value)} dimensions: give a list of numbers")
        table = _samples(samples)
        options = _options(
            to=to, every=every, at=[], sensitivities=[], method=method or ("auto" if step is None else "rk4"), step=step,
            rtol=rtol, atol=None,
            form="minimal", start=start, record=_recorded(record, also), project=project, minimum_norm=False, stiffness=None,
            damping=None, execution=execution,
        )  # fmt: skip
        plan = sweeps.Plan(
            options=options,
            given=all_given(given, to, sample or every or step or to / _POINTS),
            fixed={name: float(value) for name, value in several.items() if not np.ndim(value)},
            vary={name: numbers(value) for name, value in several.items() if np.ndim(value)},
            samples=table,
            reduce=sweeps.reductions(reduce),
            whole=whole,
        )
        for name, values_of in plan.vary.items():
            if not len(values_of):
                raise UsageError(f"`{name}` is given no values")
        if table is None and not plan.vary:
            raise UsageError(
                "nothing varies: give several values for a parameter, as in `ks=[10e3, 20e3]`, or `samples`"
            )
        if whole and (into is None or plan.reduce):
            raise UsageError("whole trajectories go `into` a folder, and nothing of them is reduced")
        if journal is not None and into is not None:
            raise UsageError(
                "a sweep is kept in a `journal` or goes `into` a folder, not both: the folder is a journal too"
            )
        way = sweeps.Way(
            executor=executor,
            chunk=chunk,
            journal=None if journal is None else Path(journal),
            into=None if into is None else Path(into),
            restart=restart,
            progress=progress,
        )
        return sweeps.run(self, plan, way)

    def sobol(
        self,
        ranges: Mapping[str, tuple[Value, Value]],
        to: float,
        *,
        n: int = 1024,
        second_order: bool = True,
        resamples: int = 100,
        confidence: float = 0.95,
        seed: int = 0,
        **run: Any,
    ) -> global_sensitivity.GlobalSensitivity[global_sensitivity.SobolIndices]:
        """Sobol' indices: which parts of the variance of an output come of which parameters, alone and together, where all of
        them vary over their ranges at once. Sampled and estimated by SALib, run by ``sweep``.

        Args:
            ranges: ``(least, greatest)`` by the names of parameters and start values such as ``spring.q(0)``, in SI units or
                as text with a unit; all values between are equally likely, and parameters independent of each other.
            to: End of each run in s.
            n: Size of the design, a power of two: ``n (2 p + 2)`` runs for ``p`` parameters, without pairs ``n (p + 2)``.
            second_order: Whether pairs are asked for.
            resamples, confidence: Of the bootstrap that gives the confidence intervals: how often, and at which level.
            seed: Of the design and the bootstrap: the same gives the same.
            run: All else that ``sweep`` takes but ``samples``: ``reduce={"peak": ("travel", "max")}``, ``step``,
                ``executor``, values of other parameters. Start values cannot vary in an executor.

        Returns:
            ``SobolIndices`` by the columns of ``reduce``; nothing: by the last values of what is recorded.

        Raises:
            RunError: a set failed, since the estimates need all of them; ``result`` has the sweep.
            UsageError: something is asked that cannot be; an output is the same in all sets.
            UnknownNameError, Interrupted: as in ``sweep``.

        >>> import halfarrow as ha
        >>> wire = ha.model("model W\\nparam a = 1, b = 1\\nSe:s(a) -> 1:j\\nSe:z(b) -> j\\nj -> R:r(2)\\nj -> I:l(1)\\n")
        >>> s = wire.sobol({"a": (0, 2), "b": (0, 1)}, to=10, n=256, step=0.01, reduce={"current": ("l.f", "final")})
        >>> s["current"].total.round(1)
        array([0.8, 0.2])
        """
        return global_sensitivity.sobol(self, ranges, to, n, second_order, resamples, confidence, seed, run)

    def morris(
        self,
        ranges: Mapping[str, tuple[Value, Value]],
        to: float,
        *,
        n: int = 20,
        levels: int = 4,
        resamples: int = 100,
        confidence: float = 0.95,
        seed: int = 0,
        **run: Any,
    ) -> global_sensitivity.GlobalSensitivity[global_sensitivity.MorrisEffects]:
        """Elementary effects (Morris): which of many parameters matter at all, for few runs. Sampled and estimated by SALib, run
        by ``sweep``.

        Args:
            ranges, to, resamples, confidence, seed, run: As in ``sobol``.
            n: Trajectories through the ranges, on each of which every parameter takes one step: ``n (p + 1)`` runs for ``p``
                parameters.
            levels: Values that each parameter may have, an even number; a step goes over half of them.

        Returns:
            ``MorrisEffects`` by the columns of ``reduce``; nothing: by the last values of what is recorded.

        Raises:
            UsageError, RunError, UnknownNameError, Interrupted: as in ``sobol``, but for outputs that do not vary.

        >>> import halfarrow as ha
        >>> drop = ha.model("model Drop\\nparam m = 1 kg, F = 1 N\\nSe:weight(F) -> I:mass(m)\\n")
        >>> s = drop.morris({"m": (1, 2), "F": ("0 N", "4 N")}, to=1, step=0.1, reduce=["final(mass.f)"])
        >>> bool(s["final(mass.f)"].mean_abs[1] > s["final(mass.f)"].mean_abs[0])
        True
        """
        return global_sensitivity.morris(self, ranges, to, n, levels, resamples, confidence, seed, run)

    def stepper(
        self,
        *,
        step: float,
        method: FixedMethod = "rk4",
        start: Literal["given", "equilibrium"] = "given",
        project: bool = False,
        parameters: Mapping[str, Value] | None = None,
        **values: Any,
    ) -> Stepper:
        """A run that is taken step by step, and can be read, set, saved and restored in between.

        Args:
            step: The length of a step in s.
            method: A method of fixed step.
            start, project: As in ``simulate``.
            parameters: Values of parameters by name.
            values: Parameters and inputs whose names are words; an input begins with this number.
        """
        choice("method", method, _FIXED)
        number("step", step, " of seconds")
        set_values, given = self._split(values, parameters, None)
        names = self._names
        settable = {**{name: False for name, p in names.parameters.items()}, **{name: True for name in names.inputs}}
        stepper = Stepper(self, self._core.stepper(method, step, _start(start), project, set_values), settable)
        for name, value in given.items():
            stepper[name] = _number(name, value)
        return stepper

    def export(
        self,
        target: Target,
        path: str | os.PathLike[str],
        *,
        method: FixedMethod = "rk4",
        step: float = 1e-3,
        form: Literal["minimal", "kane"] = "minimal",
        real: Literal["double", "float"] = "double",
        project: bool = False,
        binary: bool = True,
    ) -> dict[str, Any]:
        """Writes the model as code for elsewhere.

        Args:
            target: ``c``, C99 into the folder ``path``; ``fmu2``, ``fmu3``, a Functional Mock-up Unit; ``latex``.
            path: The folder, or the file, which ends in ``.fmu`` or ``.tex``.
            method: The method of a step.
            step: The length of a step in s.
            project: Whether steps put positions back that only speeds keep, as in ``simulate``.
            form: The form of the equations.
            real: The numbers of C.
            binary: Whether an FMU has a binary, made by the C compiler of this computer, besides its sources.

        Returns:
            What there is to know of it, as ``docs/json.md`` describes it: names, cost of a step, files.

        Raises:
            UsageError: something is asked that cannot be.
            FileError: a file cannot be written.
        """
        choice("target", target, _TARGETS)
        path, ending = Path(path), _TARGETS[target]
        if ending and path.suffix.lower() != ending:
            raise UsageError(f"the name {path} does not say what to write: let it end in {ending}")
        files, report = self._core.export(
            target, choice("form", form, _FORMS), choice("method", method, _FIXED), step,
            choice("real", real, ("double", "float")), project, binary,
        )  # fmt: skip
        written = []
        for name, content in files:
            to = path if ending else path / name
            _write(to, content)
            written.append(str(to))
        return {**report, "written": written}

    def compare(
        self,
        to: float | None = None,
        *,
        error: float = 1e-6,
        repeats: int = 7,
        patience: float = 20.0,
        budget: float | None = None,
        sample: float | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        progress: Any = None,
    ) -> Comparison:
        """Puts all forms beside each other: size, cost of an evaluation, time at equal error, agreement.

        Args:
            to: End of the runs in s; nothing: as the model suggests.
            error: Error of the motion at which times are compared.
            repeats: Runs whose median counts as the time.
            patience: Processor time of a run in s beyond which no tighter tolerance is tried.
            budget: Time for all of it in s; what it does not suffice for is left out, and said.
            sample: As in ``simulate``.
            inputs: As in ``simulate``; a function of time needs ``to``.
            progress: As in ``simulate``.
        """
        given = self._timed(inputs or {}, to, sample)
        with Bar(progress, 1.0, self.name, "") as bar:
            told = (lambda part, _: bar.reach(part)) if bar else None
            report, svg = self._core.compare(to, error, repeats, patience, budget, given, told)
        return record(Comparison, {**report, "report": report, "picture": Picture(svg)})

    def report(
        self,
        path: str | os.PathLike[str],
        *,
        to: float | None = None,
        compare: bool = True,
        budget: float = 10.0,
        sample: float | None = None,
        inputs: Mapping[str, InputLike] | None = None,
        progress: Any = None,
    ) -> None:
        """Writes everything about the model into one page that opens anywhere.

        Args:
            path: The file, which ends in ``.html``.
            to: End of the run in s; nothing: as the model suggests.
            compare: Whether forms are run beside each other.
            budget: Time for comparing, in s.
            sample, inputs, progress: As in ``compare``.

        Raises:
            RunError: the run stopped, or a result does not satisfy the model; the page is written and says so.
        """
        path = Path(path)
        if path.suffix.lower() not in (".html", ".htm"):
            raise UsageError(f"the name {path} does not say what to write: let it end in .html")
        given = self._timed(inputs or {}, to, sample)
        with Bar(progress, 1.0, self.name, "") as bar:
            told = (lambda part, _: bar.reach(part)) if bar else None
            page, noted, failure, refused = self._core.report(to, compare, budget, given, told)
        _write(path, page.encode())
        for note in noted:
            warnings.warn(ModelWarning(note), stacklevel=2)
        if failure is not None:
            raise RunError(failure)
        if refused:
            raise RunError(f"results of {', '.join(refused)} do not satisfy the model, as the audit found")

    def _timed(self, inputs: Mapping[str, InputLike], to: float | None, sample: float | None) -> list[Any]:
        self._names.check_inputs(inputs)
        if to is None and any(callable(value) for value in inputs.values()):
            raise UsageError("an input that is a function of time needs the end of the run: give `to`")
        return all_given(inputs, to or 0.0, sample or (to or 0.0) / _POINTS)

    def _split(
        self,
        values: Mapping[str, Any],
        parameters: Mapping[str, Any] | None,
        inputs: Mapping[str, Any] | None,
    ) -> tuple[list[tuple[str, float]], dict[str, Any]]:
        """Parameters in SI units, and inputs."""
        if not values and not parameters and not inputs:
            return [], {}
        several, given = self._several(values, parameters, inputs)
        for name, value in several.items():
            if np.ndim(value):
                raise UsageError(f"`{name}` is given {np.size(value)} values: a run has one; see `sweep`")
        return list(several.items()), given

    def _several(
        self,
        values: Mapping[str, Any],
        parameters: Mapping[str, Any] | None,
        inputs: Mapping[str, Any] | None,
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Parameters with one or several values in SI units, and inputs."""
        names = self._names
        given = dict(inputs or {})
        names.check_inputs(given)
        asked = dict(parameters or {})
        for name, value in values.items():
            if name in names.inputs:
                given[name] = value
            elif names.is_parameter(name):
                asked[name] = value
            else:
                function = sys._getframe(1).f_code.co_name
                function = sys._getframe(2).f_code.co_name if function == "_split" else function
                raise UnknownNameError(
                    f"`{name}` is no parameter or input of {self.name}, and no argument of {function}"
                    f"{hint(name, names.settable(function))}"
                )
        return {own: self._in_si(own, value) for name, value in asked.items() for own in names.members(name)}, given

    def _in_si(self, name: str, value: Any) -> Any:
        if isinstance(value, str):
            return self._core.quantity(name, value)
        if np.ndim(value):
            numbers = [self._in_si(name, each) for each in value]
            return np.array(numbers, dtype=np.float64)
        return _number(name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, self._core.parts()

    def __repr__(self) -> str:
        return f"<Model {self.name} with {len(self.states)} states>"

    def _repr_html_(self) -> str:
        names = self._names
        parts = [f"<h4>{html.escape(self.name)}</h4>", self.draw().svg]
        if names.parameters:
            rows = [(p.name, p.value, p.unit, "constant" if p.constant else "") for p in names.parameters.values()]
            parts.append(as_html(("parameter", "value", "SI unit", ""), rows))
        if names.inputs:
            parts.append(as_html(("input", "unit"), [(i.name, i.unit) for i in names.inputs.values()]))
        parts += [f"<pre>{html.escape(str(diagnostic))}</pre>" for diagnostic in self.warnings]
        return "\n".join(parts)


def _again(name: str, text: str, files: dict[str, str], overrides: list[tuple[str, str]]) -> Model:
    """A model from what it was pickled as."""
    return Model(_halfarrow.Model.from_text(name, text, files, overrides))


class _Names:
    """What a model takes and gives."""

    def __init__(self, told: Mapping[str, Any]) -> None:
        self.parameters = {p["name"]: record(Parameter, p) for p in told["parameters"]}
        self.inputs = {i["name"]: record(Input, i) for i in told["inputs"]}
        self.states: list[str] = told["states"]
        self.variables = {v["name"]: record(Variable, v) for v in told["variables"]}

    def members(self, name: str) -> list[str]:
        """The parameter of a name, or the elements of an array of this name."""
        if name in self.parameters:
            return [name]
        elements = [own for own in self.parameters if own.startswith(f"{name}[")]
        if not elements:
            known = [own for own, p in self.parameters.items() if not p.constant]
            raise unknown("parameter", name, known)
        return elements

    def is_parameter(self, name: str) -> bool:
        return name in self.parameters or any(own.startswith(f"{name}[") for own in self.parameters)

    def check_inputs(self, given: Mapping[str, Any]) -> None:
        for name in given:
            if name not in self.inputs:
                raise unknown("input", name, self.inputs)

    def settable(self, function: str) -> list[str]:
        """What may stand as a keyword."""
        method = getattr(Model, function)
        options = method.__code__.co_varnames[1 : method.__code__.co_argcount + method.__code__.co_kwonlyargcount]
        return [*(name for name, p in self.parameters.items() if not p.constant), *self.inputs, *options]


def _options(**options: Any) -> dict[str, Any]:
    """The options of a run, looked at."""
    choice("method", options["method"], _METHODS)
    choice("form", options["form"], _FORMS)
    choice("execution", options["execution"], ("auto", "bytecode", "machine"))
    _start(options["start"])
    number("to", options["to"], " of seconds")
    for name, unit in (("every", " of seconds"), ("step", " of seconds"), ("rtol", ""), ("atol", "")):
        if options[name] is not None:
            number(name, options[name], unit)
    return options


def _times(at: npt.ArrayLike | None) -> list[float]:
    """Times of samples as the compiled part takes them."""
    return [] if at is None else np.atleast_1d(np.asarray(at, dtype=np.float64)).tolist()


def _start(start: str) -> str:
    return choice("start", start, ("given", "equilibrium"))


def _recorded(record: str | Sequence[str] | None, also: str | Sequence[str]) -> tuple[str, list[str]]:
    more = [also] if isinstance(also, str) else list(also)
    if record is None:
        return ("also", more) if more else ("default", [])
    if record == "all":
        return "all", []
    return "names", [*([record] if isinstance(record, str) else record), *more]


def _samples(samples: Any) -> tuple[list[str], npt.NDArray[np.float64]] | None:
    """Names, and a row for each set."""
    if samples is None:
        return None
    columns = {str(name): np.asarray(samples[name]) for name in samples}
    shapes = {values.shape for values in columns.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise UsageError("samples has columns of different lengths, or none: give as many values of each parameter")
    try:
        rows = np.column_stack([values.astype(np.float64) for values in columns.values()])
    except (TypeError, ValueError) as why:
        raise UsageError(f"samples has what is no numbers: {why}") from None
    return list(columns), numbers(rows)


def _write(path: Path, content: bytes) -> None:
    """Writes a file whole, or not at all."""
    beside = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_bytes(content)
        os.replace(beside, path)
    except OSError as why:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise FileError(f"{path} cannot be written: {why}") from None


def _conclude(ended: _halfarrow.Ended, result: Result) -> None:
    """Says what is to be known of a run, by an exception if it did not come to its end."""
    if isinstance(ended.raised, KeyboardInterrupt):
        raise Interrupted(
            f"stopped at t = {result.reached:g} s; `result` has what was computed", result
        ) from ended.raised
    if ended.raised is not None:
        raise ended.raised
    notes = ended.notes
    if ended.failure is not None:
        error = RunError(ended.failure, result)
        for note in notes:
            error.add_note(in_python(note))
        raise error
    if notes:
        missed = ended.warnings
        for note in notes:
            warnings.warn((AuditWarning if note in missed else ModelWarning)(note), stacklevel=3)
