"""Many runs of one model, on this computer or through any executor."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
import os
import pickle
import threading
import warnings
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _halfarrow
from ._errors import AuditWarning, Interrupted, ModelWarning, RunError, UsageError, choice, needed, unknown
from ._inputs import Given, as_sent, numbers, on_its_own
from ._progress import Bar
from ._tables import as_html, as_text

if TYPE_CHECKING:
    import pandas
    import xarray

    from .model import Model

Array = npt.NDArray[np.float64]

REDUCTIONS = ("initial", "final", "min", "max", "max_abs", "mean", "rms", "time_of_max")
"""What can be kept of a variable: see ``Model.sweep``."""

# Sets that the compiled part computes in one go.
_LANES = 64
# Models that a worker keeps.
_KEPT = 8


class SweepResult(Mapping[str, Array]):
    """The rows of a sweep: arrays by the names of columns, each of the shape ``(sets,)``. There are the parameters that vary,
    in SI units, then what is kept of each run, in declared units; not a number where the run failed.

    >>> import halfarrow as ha
    >>> drop = ha.model("model Drop\\nparam m = 1 kg\\nSe:weight(9.81 N) -> I:mass(m)\\n")
    >>> s = drop.sweep(m=[1, 2, 4], to=2, step=1e-2, reduce={"speed": ("mass.f", "final")})
    >>> s["m"], s["speed"].round(6)
    (array([1., 2., 4.]), array([19.62 ,  9.81 ,  4.905]))
    """

    def __init__(
        self,
        model: str,
        columns: Sequence[tuple[str, str, Array]],
        report: dict[str, Any],
        grid: Mapping[str, Array],
        complete: bool,
    ) -> None:
        self.model = model
        """Name of the model."""
        self._columns = {name: values for name, _, values in columns if name not in ("set", "failed")}
        self.units: dict[str, str] = {name: unit for name, unit, _ in columns if name in self._columns}
        """The unit of each column; empty where there is none."""
        by_name = {name: values for name, _, values in columns}
        self.sets: npt.NDArray[np.int64] = by_name["set"].astype(np.int64)
        """Numbers of the sets, from 1; of a sweep that was stopped those that are done."""
        self.failed: npt.NDArray[np.bool_] = by_name["failed"] != 0
        """Whether each run came to no end."""
        self.failures: dict[int, str] = {failure["set"]: failure["reason"] for failure in report["failures"]}
        """Why, by the numbers of the sets; of the first hundred."""
        self.audit: dict[str, Any] = report["audit"]
        """What the audit of some sets has found, as ``docs/json.md`` describes it."""
        self.complete = complete
        """Whether all sets are there."""
        self._grid = dict(grid)

    def __getitem__(self, name: str) -> Array:
        try:
            return self._columns[name]
        except KeyError:
            raise unknown("column", name, self._columns) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def to_pandas(self) -> pandas.DataFrame:
        """A frame with a row for each set; ``attrs`` have the model and the units."""
        try:
            import pandas
        except ImportError:
            raise needed("pandas", "pandas", "to_pandas") from None
        frame = pandas.DataFrame({**self._columns, "failed": self.failed}, index=pandas.Index(self.sets, name="set"))
        frame.attrs = {"model": self.model, "units": dict(self.units)}
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """A dataset over the parameters that vary, if all of their combinations were run, else over the sets."""
        try:
            import xarray
        except ImportError:
            raise needed("xarray", "xarray", "to_xarray") from None
        attributes = {"model": self.model}
        if self._grid and self.complete:
            coordinates = {name: (name, values, {"units": self.units[name]}) for name, values in self._grid.items()}
            shape = [len(values) for values in self._grid.values()]
            variables = {
                name: (list(self._grid), values.reshape(shape), {"units": self.units[name]})
                for name, values in self._columns.items()
                if name not in self._grid
            }
            return xarray.Dataset(variables, coords=coordinates, attrs=attributes)
        columns = {name: ("set", values, {"units": self.units[name]}) for name, values in self._columns.items()}
        return xarray.Dataset(columns, coords={"set": self.sets}, attrs=attributes)

    def _rows(self) -> list[list[Any]]:
        shown = itertools.islice(range(len(self.sets)), 10)
        return [[int(self.sets[i]), *(float(values[i]) for values in self._columns.values())] for i in shown]

    def __repr__(self) -> str:
        head = f"{self.model}: {len(self.sets)} sets, {int(self.failed.sum())} failed, {self.audit['sets']} audited"
        more = [f"and {len(self.sets) - 10} more"] if len(self.sets) > 10 else []
        return "\n".join([head, as_text(["set", *self._columns], self._rows()), *more])

    def _repr_html_(self) -> str:
        return as_html(["set", *self._columns], self._rows()) + f"<p>{len(self.sets)} sets</p>"


@dataclasses.dataclass(frozen=True)
class Plan:
    """What a sweep is to do."""

    options: dict[str, Any]
    """The run, as the compiled part takes it."""
    given: list[tuple[str, Given]]
    """Its inputs."""
    fixed: dict[str, float]
    """Parameters that have one value for all sets."""
    vary: dict[str, Array]
    """Parameters that vary, each value with each of the others."""
    samples: tuple[list[str], Array] | None
    """Parameters from a table: names, and a row for each set."""
    reduce: dict[str, str]
    """What is kept, such as ``max(body.f)``, by the name of its column; nothing: the last value of what is recorded."""

    def arguments(self) -> dict[str, Any]:
        """As the compiled part takes it. What is fixed varies over one value."""
        vary = [*((name, np.array([value])) for name, value in self.fixed.items()), *self.vary.items()]
        return {
            "run": self.options,
            "vary": vary,
            "samples": self.samples,
            "reduce": list(self.reduce.values()),
            "part": None,
        }

    def sets(self) -> tuple[list[str], Array]:
        """All sets: names, and a row for each, those of ``vary`` with the last one fastest."""
        names, rows = self.samples or ([], np.zeros((1, 0)))
        every = np.array(list(itertools.product(*self.vary.values())), dtype=np.float64).reshape(-1, len(self.vary))
        fixed = np.tile(list(self.fixed.values()), (len(rows) * len(every), 1)).reshape(len(rows) * len(every), -1)
        table = np.hstack([np.repeat(rows, len(every), axis=0), fixed, np.tile(every, (len(rows), 1))])
        return [*names, *self.fixed, *self.vary], numbers(table)


def reductions(reduce: Mapping[str, tuple[str, str]] | Sequence[str] | None) -> dict[str, str]:
    """What is kept, by the name of its column."""
    if reduce is None:
        return {}
    if isinstance(reduce, str):
        reduce = [reduce]
    if not isinstance(reduce, Mapping):
        return {text: text for text in reduce}
    kept = {}
    for name, wanted in reduce.items():
        if not (isinstance(wanted, (tuple, list)) and len(wanted) == 2):
            raise UsageError(f'`{name}` is {wanted!r}: give a variable and what is kept of it, as in ("body.f", "max")')
        kept[name] = f"{choice('reduction', wanted[1], REDUCTIONS)}({wanted[0]})"
    return kept


def run(model: Model, plan: Plan, executor: Executor | None, chunk: int | None, progress: Any) -> SweepResult:
    """Runs a sweep."""
    if executor is None:
        columns, report, complete, raised = _here(model, plan, progress)
    else:
        columns, report, complete, raised = _elsewhere(model, plan, executor, chunk, progress)
    # Columns are called as they were asked for.
    called = dict(zip(plan.reduce.values(), plan.reduce))
    columns = [(called.get(name, name), unit, values) for name, unit, values in columns if name not in plan.fixed]
    result = SweepResult(model.name, columns, report, {} if plan.samples else plan.vary, complete)
    if raised is not None:
        done = f"{len(result.sets)} of {report['sets']} sets are done"
        if isinstance(raised, KeyboardInterrupt):
            raise Interrupted(f"the sweep was stopped; {done}, see `result`", result) from raised
        raise raised
    _warn(result)
    return result


Columns = list[tuple[str, str, Array]]


def _here(model: Model, plan: Plan, progress: Any) -> tuple[Columns, dict[str, Any], bool, BaseException | None]:
    sets = len(plan.samples[1]) if plan.samples else 1
    sets *= int(np.prod([len(values) for values in plan.vary.values()], dtype=np.int64))
    with Bar(progress, sets, model.name, "set") as bar:
        told = (lambda done, _: bar.reach(done)) if bar else None
        swept = model._core.sweep(plan.arguments(), plan.given, told, False)
    return swept.columns, swept.report(), swept.complete, swept.raised


@dataclasses.dataclass(frozen=True)
class _Job:
    """All that a worker needs besides the sets, in a form that can be sent."""

    parts: Any
    """Name, text, files, values of parameters: what the model is made of."""
    arguments: dict[str, Any]
    given: list[tuple[str, Given]]


@dataclasses.dataclass(frozen=True)
class _Done:
    """A part of a sweep."""

    first: int
    columns: Columns
    report: dict[str, Any]


# Models by what they are made of: a worker compiles each once, however many parts of sweeps come to it.
_models: OrderedDict[Any, _halfarrow.Model] = OrderedDict()
_jobs: OrderedDict[str, _Job] = OrderedDict()
_lock = threading.Lock()


def _keep(kept: OrderedDict[Any, Any], key: Any, value: Any) -> Any:
    kept[key] = value
    kept.move_to_end(key)
    while len(kept) > _KEPT:
        kept.popitem(last=False)
    return value


def _made_of(parts: Any) -> str:
    return json.dumps(parts, sort_keys=True)


def _work(key: str, job: _Job | None, names: list[str], rows: Array, first: int, of: int) -> _Done | None:
    """Computes a part of a sweep in a worker; None if it does not know the job, which is to be sent then."""
    with _lock:
        job = job or _jobs.get(key)
        if job is None:
            return None
        _keep(_jobs, key, job)
        made_of = _made_of(job.parts)
        model = _models.get(made_of)
        if model is None:
            model = _halfarrow.Model.from_text(*job.parts)
        _keep(_models, made_of, model)
    arguments = {**job.arguments, "vary": [], "samples": (names, numbers(rows)), "part": (first, of)}
    given = [(name, as_sent(value)) for name, value in job.given]
    # The executor has the other cores.
    swept = model.sweep(arguments, given, None, True)
    if swept.raised is not None:
        raise swept.raised
    return _Done(first, swept.columns, swept.report())


def _elsewhere(
    model: Model, plan: Plan, executor: Executor, chunk: int | None, progress: Any
) -> tuple[Columns, dict[str, Any], bool, BaseException | None]:
    names, rows = plan.sets()
    of = len(rows)
    given = [(name, on_its_own(value)) for name, value in plan.given]
    job = _Job(model._core.parts(), plan.arguments(), given)
    key = hashlib.sha256(pickle.dumps(job)).hexdigest()
    with _lock:
        # Workers that are threads of this process, or its forks, have the model already.
        _keep(_models, _made_of(job.parts), model._core)
    workers = _workers(executor)
    size = _chunk(of, workers, chunk)
    done: list[_Done] = []
    raised: BaseException | None = None
    with Bar(progress, of, model.name, "set") as bar:
        waiting: set[Future[_Done | None]] = set()
        begun: dict[Future[_Done | None], int] = {}

        def submit(first: int, sent: _Job | None) -> None:
            future = executor.submit(_work, key, sent, names, rows[first : first + size], first, of)
            begun[future] = first
            waiting.add(future)

        try:
            for number, first in enumerate(range(0, of, size)):
                # The first parts bring the text to the workers; the others name it.
                submit(first, job if number < workers else None)
            while waiting:
                future = next(as_completed(waiting))
                waiting.discard(future)
                part = future.result()
                if part is None:
                    submit(begun[future], job)
                    continue
                done.append(part)
                bar.reach(sum(len(part.columns[0][2]) for part in done))
        except BaseException as error:
            for future in waiting:
                future.cancel()
            if not isinstance(error, KeyboardInterrupt) or not done:
                raise
            raised = error
    done.sort(key=lambda part: part.first)
    columns = [
        (name, unit, np.concatenate([part.columns[i][2] for part in done]))
        for i, (name, unit, _) in enumerate(done[0].columns)
    ]
    return columns, _merged([part.report for part in done], of), raised is None, raised


def _workers(executor: Executor) -> int:
    known = getattr(executor, "_max_workers", None)
    return known if isinstance(known, int) and known > 0 else os.cpu_count() or 1


def _chunk(sets: int, workers: int, asked: int | None) -> int:
    """Sets of a part: as asked, else so many that each worker gets some, and multiples of what is computed in one go."""
    if asked is not None:
        if asked < 1:
            raise UsageError(f"chunk is {asked}: it has to be at least 1")
        return asked
    return max(1, round(sets / (16 * workers) / _LANES)) * _LANES


def _merged(reports: Sequence[dict[str, Any]], sets: int) -> dict[str, Any]:
    """The reports of parts as one."""
    audits = [report["audit"] for report in reports]
    verdicts = ("holds", "doubtful", "refused")
    found = [audit["greatest"] for audit in audits]
    greatest = {
        **found[0],
        **{kind: _greatest([audit[kind] for audit in found]) for kind in ("power", "energy", "residual", "rates")},
        **{kind: sorted({text for audit in found for text in audit[kind]}) for kind in ("notes", "unchecked")},
        "verdict": max((audit["verdict"] for audit in found), key=verdicts.index),
    }
    return {
        "sets": sets,
        "failures": sorted((f for report in reports for f in report["failures"]), key=lambda f: f["set"])[:100],
        "failed": sum(report["failed"] for report in reports),
        "audit": {
            **{count: sum(audit[count] for audit in audits) for count in ("sets", "doubtful", "refused")},
            "misses": [miss for audit in audits for miss in audit["misses"]],
            "greatest": greatest,
        },
    }


def _greatest(misses: Sequence[dict[str, Any] | None]) -> dict[str, Any] | None:
    """The miss that is farthest above what can be told; one that is not a number first."""
    some = [miss for miss in misses if miss is not None]
    return max(some, key=lambda m: (m["value"] != m["value"], m["value"] - m["resolution"]), default=None)


def _warn(result: SweepResult) -> None:
    if result.failed.all():
        reason = next(iter(result.failures.values()), "")
        raise RunError(f"all sets failed; set {int(result.sets[0])}: {reason}", result)
    level = 4
    for number, reason in list(result.failures.items())[:10]:
        warnings.warn(ModelWarning(f"set {number} failed: {reason}"), stacklevel=level)
    for miss in result.audit["misses"][:10]:
        for text in miss["warnings"]:
            warnings.warn(AuditWarning(f"set {miss['set']}: {text}"), stacklevel=level)
    if result.audit["refused"]:
        warnings.warn(
            AuditWarning(
                f"{result.audit['refused']} of the {result.audit['sets']} sets that were audited do not satisfy the model; "
                "do not use the rows of these and of sets like them"
            ),
            stacklevel=level,
        )
