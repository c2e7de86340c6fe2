"""Parameters from measurements: least squares with exact derivatives."""

from __future__ import annotations

import dataclasses
import os
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Union

import numpy as np
import numpy.typing as npt

from ._errors import AuditWarning, FileError, ModelWarning, RunError, UsageError, needed, unknown
from ._inputs import InputLike
from ._tables import as_html, as_text

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure
    import pandas

    from .model import Model

Array = npt.NDArray[np.float64]

Bounds: TypeAlias = Union[None, float, str, tuple[Any, Any], tuple[Any, Any, Any]]
"""What is known of a parameter before: nothing; a first guess; ``(least, greatest)``; ``(least, guess, greatest)``."""

Data: TypeAlias = Union["pandas.DataFrame", Mapping[str, npt.ArrayLike], str, "os.PathLike[str]"]
"""Columns by name, with the times in ``t`` (of a frame: or in its index), or the path of a CSV file of them. Where a value
is NaN nothing was measured."""

Loss: TypeAlias = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]

_LOSSES = ("linear", "soft_l1", "huber", "cauchy", "arctan")
# Directions in which residuals change by less than this part of the greatest change are told by the errors of runs alone.
_RANK = 1e-6


@dataclasses.dataclass(frozen=True)
class Experiment:
    """One run that was measured, of several that are fitted at once.

    >>> import halfarrow as ha
    >>> ha.Experiment({"t": [0.0, 1.0], "z": [0.0, 0.5]}, inputs={"push": 3.0}, name="slow").name
    'slow'
    """

    data: Any
    """What was measured; see ``Data``."""
    inputs: Mapping[str, InputLike] = dataclasses.field(default_factory=dict)
    """Inputs as in ``simulate``; text that is the name of a column of the data is that column."""
    parameters: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    """Parameters that have other values in this run."""
    outputs: Mapping[str, str] | None = None
    """Columns by the variables that they are measurements of; nothing: those of the fit."""
    sigma: Mapping[str, Any] | None = None
    """Standard deviations of the measurements by variable: a number, or the name of a column; nothing: those of the fit."""
    name: str = ""
    """What it is called."""


class _Measured:
    """A run with its data, as arrays."""

    def __init__(
        self,
        given: Experiment,
        outputs: Mapping[str, str],
        sigma: Mapping[str, Any],
        to: float | None,
        number: int,
    ) -> None:
        self.name = given.name or f"run {number + 1}"
        columns = _columns(given.data)
        outputs = given.outputs or outputs
        shared = {name: value for name, value in sigma.items() if name in outputs}
        sigma = {**shared, **(given.sigma or {})}
        if not outputs:
            raise UsageError("nothing is compared: give `outputs`, as in {'travel': 'z_meas'}")
        for column in outputs.values():
            if column not in columns:
                raise unknown("column", column, columns)
        self.outputs = list(outputs)
        times = columns["t"]
        used = np.ones(len(times), dtype=bool) if to is None else times <= to
        if not used.any() or not np.all(np.diff(times[used]) > 0):
            raise UsageError(f"times of {self.name} have to ascend, each of them once, and to begin before the end")
        if times[0] < 0:
            raise UsageError(f"{self.name} has times below 0, where runs begin")
        self.t: Array = times[used]
        self.to = float(self.t[-1]) if to is None else float(to)
        self.measured: Array = np.stack([columns[column][used] for column in outputs.values()], axis=-1)
        self.valid = np.isfinite(self.measured)
        if not self.valid.any():
            raise UsageError(f"{self.name} has no measurement at all")
        self.sigma: Array = np.ones_like(self.measured)
        sigma = {name: value for name, value in sigma.items() if value is not None}
        for name, value in sigma.items():
            if name not in self.outputs:
                raise unknown("output", name, self.outputs)
            if isinstance(value, str) and value not in columns:
                raise unknown("column", value, columns)
        self.known = bool(sigma)
        for k, name in enumerate(self.outputs):
            if self.known and name not in sigma:
                raise UsageError(
                    f"`sigma` has no standard deviation of `{name}`: give them for all outputs, or for none"
                )
            if self.known:
                value = sigma[name]
                self.sigma[:, k] = columns[value][used] if isinstance(value, str) else value
        if np.any(self.sigma[self.valid] <= 0) or not np.all(np.isfinite(self.sigma[self.valid])):
            raise UsageError(f"standard deviations of {self.name} have to be finite and above 0")
        inputs = {}
        for name, value in given.inputs.items():
            own = isinstance(value, str) and value in columns
            inputs[name] = (times, columns[value]) if own else value  # type: ignore[index]
        self.inputs: dict[str, Any] = inputs
        self.parameters = dict(given.parameters)


def _columns(data: Any) -> dict[str, Array]:
    if isinstance(data, (str, os.PathLike)):
        try:
            table = np.genfromtxt(data, delimiter=",", names=True, deletechars="", replace_space=" ")
        except OSError as why:
            raise FileError(f"{os.fspath(data)} cannot be read: {why}") from None
        columns = {name: np.atleast_1d(table[name]).astype(np.float64) for name in table.dtype.names or ()}
    else:
        columns = {str(name): np.asarray(data[name], dtype=np.float64) for name in data}
        if "t" not in columns and hasattr(data, "index"):
            columns["t"] = np.asarray(data.index, dtype=np.float64)
    if "t" not in columns:
        raise UsageError("the data have no column `t` of times in s")
    if any(values.shape != columns["t"].shape or values.ndim != 1 for values in columns.values()):
        raise UsageError("the columns of the data are of different lengths")
    return columns


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A parameter that was estimated, in its SI unit."""

    name: str
    value: float
    error: float
    """Standard error; infinite where the data do not tell the parameter."""
    unit: str
    """SI unit, where known."""
    at_bound: bool
    """Whether it lies at a bound, where the standard error is that of the model without bounds."""


@dataclasses.dataclass(frozen=True)
class Profile:
    """The least sum of squares for each value of one parameter."""

    name: str
    values: Array
    sums: Array
    """Least sums of squares, all other parameters fitted."""
    interval: tuple[float, float]
    """Where the sum stays below the bound of the level; a bound that was not met is infinite."""
    level: float
    bound: float = np.nan
    """The sum at the ends of the interval."""

    def plot(self, ax: matplotlib.axes.Axes | None = None) -> matplotlib.axes.Axes:
        """The sums over the values, with the bound and the interval."""
        try:
            import matplotlib.pyplot as plt
        except ImportError:
            raise needed("matplotlib", "plot", "plot") from None
        ax = plt.gca() if ax is None else ax
        ax.plot(self.values, self.sums, ".-")
        ax.axhline(self.bound, color="black", linewidth=0.5)
        for end in self.interval:
            if np.isfinite(end):
                ax.axvline(end, color="black", linewidth=0.5, linestyle="--")
        ax.set_xlabel(self.name)
        ax.set_ylabel("least sum of squares")
        ax.set_title(f"{100 * self.level:g} %: {self.interval[0]:.6g} to {self.interval[1]:.6g}")
        return ax


class Problem:
    """Residuals and their exact derivatives, as functions of the parameters: for any optimizer."""

    def __init__(
        self, model: Model, names: Sequence[str], runs: Sequence[_Measured], options: Mapping[str, Any]
    ) -> None:
        self.model = model
        self.names = list(names)
        self.runs = list(runs)
        self.given = model
        self.evaluations = 0
        """Runs of all experiments."""
        self.differentiated = 0
        """Those of them with derivatives."""
        self._options = dict(options)
        self._known: dict[tuple[bytes, bool], list[tuple[Array, Array | None]]] = {}

    def _run(self, x: Array, slopes: bool) -> list[tuple[Array, Array | None]]:
        """Of each experiment the values, of the shape of its measurements, and their derivatives."""
        for kept in (slopes, True):
            known = self._known.get((x.tobytes(), kept))
            if known is not None:
                return known
        self.evaluations += 1
        self.differentiated += slopes
        all_runs = []
        values = dict(zip(self.names, x.tolist()))
        for run in self.runs:
            shared = [name for name in self.names if name in run.parameters]
            if shared:
                raise UsageError(f"`{shared[0]}` is fitted, and given for {run.name}")
            asked = {
                "to": run.to, "at": run.t, "record": run.outputs, "inputs": run.inputs,
                "parameters": {**run.parameters, **values}, **self._options,
            }  # fmt: skip
            count = len(run.t)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ModelWarning)
                warnings.simplefilter("ignore", AuditWarning)
                if slopes:
                    found = self.model.sensitivities(self.names, **asked)
                    result, array = found.result, found.array()[:count]
                else:
                    result, array = self.model.simulate(**asked), None
            all_runs.append((np.stack([result[name][:count] for name in run.outputs], axis=-1), array))
        self._known = {(x.tobytes(), slopes): all_runs}
        return all_runs

    def residuals(self, x: npt.ArrayLike) -> Array:
        """Model less measurement in standard deviations, of all experiments one after the other; NaN where a run stops."""
        x = np.asarray(x, dtype=np.float64)
        try:
            values = self._run(x, False)
        except RunError:
            return np.full(sum(int(run.valid.sum()) for run in self.runs), np.nan)
        parts = zip(self.runs, values)
        return np.concatenate([((own - run.measured) / run.sigma)[run.valid] for run, (own, _) in parts])

    def jacobian(self, x: npt.ArrayLike) -> Array:
        """Exact derivatives of the residuals, of the shape ``(residuals, parameters)``."""
        parts = zip(self.runs, self._run(np.asarray(x, dtype=np.float64), True))
        return np.concatenate([(own / run.sigma[..., None])[run.valid] for run, (_, own) in parts if own is not None])


class Fit:
    """Parameters that were fitted, how well they are told, and what is left over."""

    def __init__(
        self,
        problem: Problem,
        found: Any,
        bounds: tuple[Array, Array],
        scale: Array,
        units: Sequence[str],
        search: Mapping[str, Any],
        starts: Sequence[Mapping[str, Any]],
        seconds: float,
    ) -> None:
        self.problem = problem
        """Residuals and their derivatives."""
        own = {name: value for name, value in zip(problem.names, found.x.tolist()) if not name.endswith("(0)")}
        self.model = problem.given.with_parameters(own)
        """The model with the parameters that were found; start values are in ``estimates`` alone."""
        self.names: list[str] = problem.names
        self.x: Array = found.x
        """The values, in SI units."""
        self.success: bool = bool(found.success)
        self.message: str = str(found.message)
        self.starts = list(starts)
        """Of each start of the search its begin, its end and its cost."""
        self.seconds = seconds
        self.evaluations = problem.evaluations
        self.jacobians = problem.differentiated
        self.residuals: Array = found.fun
        """Model less measurement in standard deviations."""
        self.cost = float(2.0 * found.cost)
        """What was made least: the sum of squares, or of what the loss makes of them."""
        self._bounds, self._scale, self._search = bounds, scale, dict(search)
        count, free = len(self.residuals), len(self.x)
        # Columns in parts of the parameters: directions are relative changes.
        weighed = found.jac * scale
        _, sizes, ways = np.linalg.svd(weighed, full_matrices=False)
        ways = ways[: len(sizes)]
        told = sizes > _RANK * (sizes.max() if len(sizes) else 0.0)
        self.rank = int(told.sum())
        """How many combinations of parameters the data tell."""
        self.freedom = count - self.rank
        known = all(run.known for run in problem.runs)
        self.variance = 1.0 if known else float(np.sum(self.residuals**2)) / max(self.freedom, 1)
        """Variance of a residual: 1 where standard deviations are given, else estimated."""
        parts = ways[told] / sizes[told, None]
        covariance = self.variance * (parts.T @ parts)
        self.unidentified: list[dict[str, float]] = [_combination(self.names, way) for way in ways[~told]]
        """Combinations that the data do not tell: relative changes of parameters that change no output together."""
        lost = np.zeros(free, dtype=bool)
        for way in ways[~told]:
            lost |= np.abs(way) > 1e-3
        errors = np.sqrt(np.diag(covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            self.correlation: Array = covariance / np.outer(errors, errors)
            """Correlations of the parameters, of the shape ``(parameters, parameters)``; NaN where the data do not tell."""
        self.correlation[lost, :] = self.correlation[:, lost] = np.nan
        self.covariance: Array = covariance * np.outer(scale, scale)
        """Covariances in SI units; infinite where the data do not tell."""
        self.covariance[lost, :] = self.covariance[:, lost] = np.inf
        at_bound = np.asarray(found.active_mask) != 0
        self.estimates: dict[str, Estimate] = {
            name: Estimate(name, float(self.x[i]), float(np.sqrt(self.covariance[i, i])), units[i], bool(at_bound[i]))
            for i, name in enumerate(self.names)
        }

    def __getitem__(self, name: str) -> float:
        """The value of a parameter, in its SI unit."""
        if name not in self.estimates:
            raise unknown("parameter", name, self.names)
        return self.estimates[name].value

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """A confidence interval by the standard error and Student's distribution."""
        value, error = self[name], self.estimates[name].error
        if not np.isfinite(error):
            return -np.inf, np.inf
        stats = _scipy("stats")
        known = self.variance == 1.0 and all(run.known for run in self.problem.runs)
        law = stats.norm if known else stats.t(max(self.freedom, 1))
        reach = float(law.ppf(0.5 + 0.5 * level)) * error
        return value - reach, value + reach

    def profile(self, name: str, points: int = 12, level: float = 0.95, reach: float = 3.0) -> Profile:
        """The profile likelihood of a parameter: the others are fitted again for values around its own, ``points`` on each
        side, up to ``reach`` standard errors or the bounds."""
        stats, optimize = _scipy("stats"), _scipy("optimize")
        at = self.names.index(self.estimates[name].name) if name in self.estimates else -1
        if at < 0:
            raise unknown("parameter", name, self.names)
        known = all(run.known for run in self.problem.runs)
        count = max(self.freedom, 1)
        law = stats.chi2(1).ppf(level) if known else stats.f(1, count).ppf(level)
        bound = self.cost + self.variance * float(law)
        error = self.estimates[name].error
        step = (error if np.isfinite(error) else abs(self.x[at]) or 1.0) * reach / points
        others = [i for i in range(len(self.x)) if i != at]
        sides: list[tuple[list[float], list[float], float]] = []
        for sign in (-1.0, 1.0):
            values, sums, end, x = [], [], sign * np.inf, self.x.copy()
            before = (self.x[at], self.cost)
            for k in range(1, points + 1):
                value = self.x[at] + sign * k * step
                if not self._bounds[0][at] <= value <= self._bounds[1][at]:
                    break
                x[at] = value

                def full(part: Array, x: Array = x) -> Array:
                    all_of = x.copy()
                    all_of[others] = part
                    return all_of

                if others:
                    found = optimize.least_squares(
                        lambda part: self.problem.residuals(full(part)),
                        x[others],
                        jac=lambda part: self.problem.jacobian(full(part))[:, others],
                        bounds=(self._bounds[0][others], self._bounds[1][others]),
                        x_scale=self._scale[others],
                        **self._search,
                    )
                    x[others], total = found.x, float(2.0 * found.cost)
                else:
                    total = float(np.sum(self.problem.residuals(x) ** 2))
                values.append(float(value))
                sums.append(total)
                if total > bound:
                    # A parabola through the minimum tells where it was crossed.
                    a, b = np.sqrt(max(before[1] - self.cost, 0.0)), np.sqrt(total - self.cost)
                    part = (np.sqrt(bound - self.cost) - a) / (b - a)
                    end = float(before[0] + part * (value - before[0]))
                    break
                before = (value, total)
            sides.append((values, sums, end))
        (left, down, low), (right, up, high) = sides
        return Profile(
            name,
            np.array([*left[::-1], self.x[at], *right]),
            np.array([*down[::-1], self.cost, *up]),
            (low, high),
            level,
            bound,
        )

    def predicted(self) -> list[dict[str, Array]]:
        """Of each experiment the outputs of the fitted model at the times of the measurements."""
        runs = self.problem._run(self.x, False)
        return [
            {name: values[:, k] for k, name in enumerate(run.outputs)}
            for run, (values, _) in zip(self.problem.runs, runs)
        ]

    @property
    def table(self) -> str:
        """The estimates as a table."""
        return as_text(*self._rows())

    def _rows(self) -> tuple[list[str], list[list[Any]]]:
        rows: list[list[Any]] = []
        for e in self.estimates.values():
            low, high = self.interval(e.name)
            remark = "at its bound" if e.at_bound else "" if np.isfinite(e.error) else "not told by the data"
            rows.append([e.name, e.value, e.error, low, high, e.unit, remark])
        return ["parameter", "value", "error", "2.5 %", "97.5 %", "unit", ""], rows

    def plot(self) -> matplotlib.figure.Figure:
        """Measurements, the fitted model, and below them what is left over."""
        try:
            import matplotlib.pyplot as plt
        except ImportError:
            raise needed("matplotlib", "plot", "plot") from None
        pairs = [(run, k) for run in self.problem.runs for k in range(len(run.outputs))]
        figure, axes = plt.subplots(2, len(pairs), squeeze=False, sharex="col", height_ratios=[2, 1])
        predicted = {run.name: own for run, own in zip(self.problem.runs, self.predicted())}
        for column, (run, k) in enumerate(pairs):
            name, valid = run.outputs[k], run.valid[:, k]
            top, bottom = axes[0][column], axes[1][column]
            top.plot(run.t[valid], run.measured[valid, k], ".", markersize=3, label="measured")
            top.plot(run.t, predicted[run.name][name], label="fitted")
            top.set_title(f"{name}, {run.name}" if len(self.problem.runs) > 1 else name)
            top.legend()
            left = (predicted[run.name][name] - run.measured[:, k]) / run.sigma[:, k]
            bottom.plot(run.t[valid], left[valid], ".", markersize=3)
            bottom.axhline(0.0, color="black", linewidth=0.5)
            bottom.set_xlabel("t / s")
        axes[1][0].set_ylabel("residual / sigma")
        return figure

    def __repr__(self) -> str:
        parts = [self.table, f"sum of squares {self.cost:.6g}, {self.freedom} degrees of freedom"]
        for combination in self.unidentified:
            text = " ".join(f"{share:+.2f} {name}" for name, share in combination.items())
            parts.append(f"the data do not tell: {text} (relative changes)")
        if not self.success:
            parts.append(self.message)
        return "\n".join(parts)

    def _repr_html_(self) -> str:
        return as_html(*self._rows())


def _combination(names: Sequence[str], way: Array) -> dict[str, float]:
    """The parameters that take part, the greatest share first and above 0."""
    order = np.argsort(-np.abs(way), kind="stable")
    sign = np.sign(way[order[0]])
    return {names[i]: float(sign * way[i]) for i in order if abs(way[i]) > 1e-3}


def _scipy(part: str) -> Any:
    try:
        import importlib

        return importlib.import_module(f"scipy.{part}")
    except ImportError:
        raise needed("scipy", "fit", "fit") from None


def _range(model: Model, name: str, known: Bounds) -> tuple[float, float, float]:
    """Least value, guess and greatest value, in SI units."""
    own = model.parameters[name].value
    si: Callable[[Any], float] = lambda value: float(model._in_si(name, value))  # noqa: E731
    if known is None:
        return -np.inf, own, np.inf
    if not isinstance(known, tuple):
        return -np.inf, si(known), np.inf
    least, greatest = si(known[0]), si(known[-1])
    if not least < greatest:
        raise UsageError(
            f"`{name}` is given the bounds {least:g} and {greatest:g}: the first has to be below the second"
        )
    if len(known) == 3:
        guess = si(known[1])
    elif least < own < greatest:
        guess = own
    else:
        guess = float(np.sqrt(least * greatest)) if least > 0 else 0.5 * (least + greatest)
    if not least <= guess <= greatest:
        raise UsageError(f"`{name}` begins at {guess:g}, which is not within its bounds")
    return least, guess, greatest


def _beginnings(ranges: Array, count: int, seed: int) -> Array:
    """Where searches begin: at the guesses, then as a Latin hypercube between the bounds; where there are none, from a tenth
    to ten times the guess."""
    guesses = ranges[:, 1]
    if count < 2:
        return guesses[None, :]
    low = np.where(np.isfinite(ranges[:, 0]), ranges[:, 0], np.where(guesses > 0, 0.1, 10.0) * guesses)
    high = np.where(np.isfinite(ranges[:, 2]), ranges[:, 2], np.where(guesses > 0, 10.0, 0.1) * guesses)
    parts = _scipy("stats").qmc.LatinHypercube(len(ranges), seed=seed).random(count - 1)
    # Positive ranges of more than a decade are walked by their logarithm.
    wide = (low > 0) & (high > 10 * low)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_factor = low * (high / low) ** parts
    return np.vstack([guesses, np.where(wide, by_factor, low + parts * (high - low))])


def fit(
    model: Model,
    experiments: Sequence[Experiment],
    params: Mapping[str, Bounds],
    outputs: Mapping[str, str],
    sigma: Mapping[str, Any],
    to: float | None,
    start: int,
    loss: Loss,
    f_scale: float,
    tolerance: float,
    most: int | None,
    seed: int,
    options: Mapping[str, Any],
) -> Fit:
    """See ``Model.fit``."""
    optimize = _scipy("optimize")
    if loss not in _LOSSES:
        raise unknown("loss", loss, _LOSSES)
    if not params:
        raise UsageError("nothing is fitted: give `params`, as in {'ks': (5e3, 50e3), 'b': None}")
    begun = time.perf_counter()
    runs = [_Measured(given, outputs, sigma, to, i) for i, given in enumerate(experiments)]
    compared = {name for run in runs for name in run.outputs}
    for name in sigma:
        if name not in compared:
            raise unknown("output", name, sorted(compared))
    if any(run.known for run in runs) and not all(run.known for run in runs):
        raise UsageError("standard deviations are given for some experiments only: give them for all, or for none")
    if not runs[0].known:
        # Outputs of different units count alike.
        for name in {name for run in runs for name in run.outputs}:
            places = [(run, run.outputs.index(name)) for run in runs if name in run.outputs]
            spread = np.nanstd(np.concatenate([run.measured[:, k] for run, k in places]))
            for run, k in places:
                run.sigma[:, k] = spread if spread > 0 else 1.0
    starts = [name[: -len("(0)")] for name in params if name.endswith("(0)")]
    given = model
    if starts:
        model = type(model)(model._core.with_starts(starts))
    names = [own for name in params for own in model._names.members(name)]
    ranges = np.array([_range(model, name, params.get(name, params.get(name.split("[")[0]))) for name in names])
    units = [model.parameters[name].unit or "" for name in names]
    problem = Problem(model, names, runs, options)
    problem.given = given
    bounds = (ranges[:, 0], ranges[:, 2])
    width = np.where(np.isfinite(ranges[:, 2] - ranges[:, 0]), ranges[:, 2] - ranges[:, 0], 1.0)
    scale = np.where(ranges[:, 1] != 0, np.abs(ranges[:, 1]), width)
    search = {
        "loss": loss, "f_scale": f_scale, "ftol": tolerance, "xtol": tolerance, "gtol": tolerance, "max_nfev": most,
    }  # fmt: skip
    tried, best, failed = [], None, None
    for x in _beginnings(ranges, start, seed):
        inside = np.clip(x, np.nextafter(bounds[0], np.inf), np.nextafter(bounds[1], -np.inf))
        try:
            # Where a search begins the model has to run; why it does not is told.
            problem._run(inside, True)
            found = optimize.least_squares(
                problem.residuals, inside, jac=problem.jacobian, bounds=bounds, x_scale=scale, **search
            )
        except RunError as why:
            tried.append({"begin": inside, "end": None, "cost": np.inf, "failure": str(why)})
            failed = failed or why
            continue
        tried.append({"begin": inside, "end": found.x, "cost": 2.0 * found.cost, "failure": None})
        if best is None or found.cost < best.cost:
            best = found
    if best is None:
        assert failed is not None
        raise failed
    # What is near zero counts as a part of where it was sought.
    sought = np.where(np.isfinite(ranges[:, 2] - ranges[:, 0]), width, scale)
    final = np.maximum(np.abs(best.x), 1e-2 * sought)
    return Fit(problem, best, bounds, final, units, search, tried, time.perf_counter() - begun)
