"""Which parameters matter over their whole ranges: Sobol' indices and elementary effects, by SALib on sweeps."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from ._errors import ModelWarning, RunError, UnknownNameError, UsageError, needed, unknown
from ._tables import as_html, as_text
from ._words import hint
from .sweeps import SweepResult

if TYPE_CHECKING:
    import pandas

    from .model import Model

Array = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class SobolIndices:
    """Parts of the variance of one output. Arrays have the shape ``(parameters,)``; errors are half the widths of the
    confidence intervals. Indices are estimates, which may come out a little below 0 or above 1."""

    parameters: tuple[str, ...]
    """What varies, in order."""
    first: Array
    """The part of each parameter alone."""
    first_error: Array
    total: Array
    """The part of each parameter alone and with all others."""
    total_error: Array
    second: Array | None
    """The part of each pair beyond those of its two alone, ``(parameters, parameters)``, symmetric, not a number on the
    diagonal; None if it was not asked for."""
    second_error: Array | None


@dataclasses.dataclass(frozen=True)
class MorrisEffects:
    """Elementary effects on one output, in its unit: the change of the output over a step, divided by the part of the range of
    the parameter that the step goes; of an output that is linear the change over the whole range. Arrays have the shape
    ``(parameters,)``."""

    parameters: tuple[str, ...]
    """What varies, in order."""
    mean: Array
    mean_abs: Array
    """The mean of magnitudes, by which parameters are ranked."""
    mean_abs_error: Array
    """Half the width of its confidence interval."""
    deviation: Array
    """The standard deviation: 0 if the output is linear in the parameter and has no term with another one."""


Each = TypeVar("Each", bound=SobolIndices | MorrisEffects)


class GlobalSensitivity(Mapping[str, Each], Generic[Each]):
    """Indices or effects by the names of outputs: ``Model.sobol`` and ``Model.morris`` give it."""

    def __init__(self, found: Mapping[str, Each], sweep: SweepResult, confidence: float) -> None:
        self._found = dict(found)
        self.parameters: list[str] = list(next(iter(found.values())).parameters)
        """What varies, in order."""
        self.sweep: SweepResult = sweep
        """All runs of the design."""
        self.confidence: float = confidence
        """The level of the confidence intervals."""
        self.units: dict[str, str] = {name: sweep.units[name] for name in found}
        """Units of the outputs; empty where there is none."""

    def __getitem__(self, output: str) -> Each:
        try:
            return self._found[output]
        except KeyError:
            raise unknown("output", output, self._found) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def _columns(self) -> list[str]:
        fields = dataclasses.fields(next(iter(self._found.values())))
        return [field.name for field in fields if field.name != "parameters" and not field.name.startswith("second")]

    def to_pandas(self) -> pandas.DataFrame:
        """A frame with a row for each output and parameter, and a column for each kind of index and its error. Indices of
        pairs are not in it."""
        try:
            import pandas
        except ImportError:
            raise needed("pandas", "pandas", "to_pandas") from None
        index = pandas.MultiIndex.from_product([list(self), self.parameters], names=["output", "parameter"])
        columns = {name: np.concatenate([getattr(each, name) for each in self.values()]) for name in self._columns()}
        frame = pandas.DataFrame(columns, index=index)
        frame.attrs = {"confidence": self.confidence, "units": dict(self.units)}
        return frame

    def _rows(self) -> list[list[Any]]:
        columns = self._columns()
        return [
            [output, name, *(float(getattr(each, column)[i]) for column in columns)]
            for output, each in self.items()
            for i, name in enumerate(self.parameters)
        ]

    def _head(self) -> str:
        return f"{self.sweep.model}: {len(self.sweep.sets)} sets, errors are half intervals of {100 * self.confidence:g} %"

    def __repr__(self) -> str:
        return f"{self._head()}\n" + as_text(["output", "by", *self._columns()], self._rows())

    def _repr_html_(self) -> str:
        return as_html(["output", "by", *self._columns()], self._rows()) + f"<p>{self._head()}</p>"


def sobol(
    model: Model, ranges: Mapping[str, Any], to: float, n: int, second_order: bool, resamples: int, confidence: float,
    seed: int, run: Mapping[str, Any],
) -> GlobalSensitivity[SobolIndices]:  # fmt: skip
    """See ``Model.sobol``."""
    sample, analyze = _salib("sobol")
    if n < 2 or n & (n - 1):
        near = 2 ** max(1, round(np.log2(max(n, 2))))
        raise UsageError(f"n is {n}: the sequence is balanced over a power of two; give {near}")
    _within(confidence, resamples, seed)
    started, problem = _problem(model, ranges, run, "sobol")
    rows = sample.sample(problem, n, calc_second_order=second_order, seed=seed)
    swept = _runs(started, problem, rows, to, run)
    found = {}
    for name, y in _outputs(swept, problem).items():
        if np.ptp(y) == 0:
            raise UsageError(f"`{name}` is {y[0]:g} in all sets: it has no variance of which there could be parts")
        # The bootstrap of SALib takes 0 for no seed.
        told = analyze.analyze(
            problem, y, calc_second_order=second_order, num_resamples=resamples, conf_level=confidence, seed=seed + 1
        )
        pairs = [_symmetric(told[key]) if second_order else None for key in ("S2", "S2_conf")]
        arrays = [np.asarray(told[key], dtype=np.float64) for key in ("S1", "S1_conf", "ST", "ST_conf")]
        found[name] = SobolIndices(tuple(problem["names"]), *arrays, *pairs)
    return GlobalSensitivity(found, swept, confidence)


def morris(
    model: Model, ranges: Mapping[str, Any], to: float, n: int, levels: int, resamples: int, confidence: float, seed: int,
    run: Mapping[str, Any],
) -> GlobalSensitivity[MorrisEffects]:  # fmt: skip
    """See ``Model.morris``."""
    sample, analyze = _salib("morris")
    if n < 2:
        raise UsageError(f"n is {n}: a spread takes at least 2 trajectories")
    if levels < 2 or levels % 2:
        raise UsageError(f"levels is {levels}: it has to be even")
    _within(confidence, resamples, seed)
    started, problem = _problem(model, ranges, run, "morris")
    rows = sample.sample(problem, n, num_levels=levels, seed=seed)
    swept = _runs(started, problem, rows, to, run)
    found = {}
    for name, y in _outputs(swept, problem).items():
        told = analyze.analyze(
            problem, rows, y, num_levels=levels, num_resamples=resamples, conf_level=confidence, seed=seed + 1
        )
        arrays = [np.asarray(told[key], dtype=np.float64) for key in ("mu", "mu_star", "mu_star_conf", "sigma")]
        found[name] = MorrisEffects(tuple(problem["names"]), *arrays)
    return GlobalSensitivity(found, swept, confidence)


def _salib(method: str) -> tuple[Any, Any]:
    try:
        import importlib

        return importlib.import_module(f"SALib.sample.{method}"), importlib.import_module(f"SALib.analyze.{method}")
    except ImportError:
        raise needed("SALib", "salib", method) from None


def _within(confidence: float, resamples: int, seed: int) -> None:
    if seed < 0:
        raise UsageError(f"seed is {seed}: it has to be at least 0")
    if not 0 < confidence < 1:
        raise UsageError(f"confidence is {confidence}: it has to be between 0 and 1, such as 0.95")
    if resamples < 2:
        raise UsageError(f"resamples is {resamples}: it has to be at least 2")


def _problem(model: Model, ranges: Mapping[str, Any], run: Mapping[str, Any], of: str) -> tuple[Model, dict[str, Any]]:
    """The model with start values as parameters, and what varies as SALib takes it."""
    if not ranges:
        raise UsageError('nothing varies: give ranges, as in {"ks": (10e3, 30e3)}')
    names = model._names
    options = [*names.settable(of), *names.settable("sweep")]
    for name in run:
        if name not in options and not names.is_parameter(name):
            raise UnknownNameError(f"`{name}` is no parameter or input of {model.name}, and no argument of {of}{hint(name, options)}")
        if name in ranges:
            raise UsageError(f"`{name}` varies and is given a value: leave out one of them")
    if run.get("whole"):
        raise UsageError("indices are of numbers: leave out `whole`, and say by `reduce` what is kept of each run")
    starts = [name[: -len("(0)")] for name in ranges if name.endswith("(0)")]
    for name in starts:
        if name not in names.variables:
            raise unknown("start value", f"{name}(0)", [f"{state}(0)" for state in names.states])
    if starts:
        if run.get("executor") is not None:
            raise UsageError(f"`{starts[0]}(0)` cannot vary in an executor: leave out `executor`, or declare a parameter for it")
        model = type(model)(model._core.with_starts(starts))
    bounds = {own: _bounds(model, own, given) for name, given in ranges.items() for own in model._names.members(name)}
    return model, {"num_vars": len(bounds), "names": list(bounds), "bounds": list(bounds.values())}


def _bounds(model: Model, name: str, given: Any) -> list[float]:
    if not (isinstance(given, Sequence) and not isinstance(given, str) and len(given) == 2):
        raise UsageError(f"`{name}` is given {given!r}: give its range, as in (10e3, 30e3)")
    least, greatest = (float(model._in_si(name, value)) for value in given)
    if not (least < greatest and np.isfinite([least, greatest]).all()):
        raise UsageError(f"`{name}` is given the range {least:g} to {greatest:g}: the first has to be below the second")
    if model.parameters[name].constant:
        raise UsageError(f"`{name}` is a constant, which cannot vary")
    return [least, greatest]


def _runs(model: Model, problem: dict[str, Any], rows: Array, to: float, run: Mapping[str, Any]) -> SweepResult:
    """The whole design."""
    samples = dict(zip(problem["names"], rows.T))
    with warnings.catch_warnings():
        # What fails is raised below.
        warnings.filterwarnings("ignore", message=r"set \d+ failed", category=ModelWarning)
        swept = model.sweep(to, samples=samples, **run)
    if len(swept.sets) != len(rows):
        raise UsageError("a parameter is given several values: only what has a range may vary")
    failed = np.flatnonzero(swept.failed)
    if len(failed):
        first = int(failed[0])
        at = ", ".join(f"{name} = {value:g}" for name, value in zip(problem["names"], rows[first]))
        raise RunError(
            f"{len(failed)} of {len(rows)} sets failed, and the estimates need all of them; set {first + 1} ({at}): "
            f"{swept.failures.get(first + 1, '')}",
            swept,
        )
    return swept


def _outputs(swept: SweepResult, problem: dict[str, Any]) -> dict[str, Array]:
    found = {name: values for name, values in swept.items() if name not in problem["names"]}
    for name, values in found.items():
        if not np.isfinite(values).all():
            raise RunError(f"`{name}` is no finite number in set {int(np.flatnonzero(~np.isfinite(values))[0]) + 1}", swept)
    return found


def _symmetric(upper: Any) -> Array:
    """A matrix of which the part above the diagonal is known."""
    known = np.triu(np.asarray(upper, dtype=np.float64), 1)
    whole: Array = known + known.T
    np.fill_diagonal(whole, np.nan)
    return whole
