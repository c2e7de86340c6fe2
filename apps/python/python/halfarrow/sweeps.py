"""Many runs of one model, on this computer or through any executor."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
import os
import pickle
import threading
import time
import warnings
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _halfarrow
from ._errors import (
    AuditWarning,
    Error,
    FileError,
    Interrupted,
    ModelError,
    ModelWarning,
    RunError,
    UsageError,
    choice,
    needed,
    unknown,
)
from ._inputs import Given, as_sent, numbers, on_its_own
from ._kept import Columns, Done, Folder, Journal, Kept, about_of, arrow, files, gaps, identity, part_of, write_part
from ._progress import Bar
from ._tables import as_html, as_text

if TYPE_CHECKING:
    import pandas
    import xarray

    from .model import Model

Array = npt.NDArray[np.float64]

REDUCTIONS = ("initial", "final", "min", "max", "max_abs", "mean", "rms", "time_of_max")
"""What can be kept of a variable: see ``Model.sweep``."""

# Columns beside those that were asked for.
_BESIDE = ("set", "failed")
# Sets that the compiled part computes in one go.
_LANES = 64
# Rows that a part has at most where nobody says how many.
_MOST = 1 << 16
# Models that a worker keeps.
_KEPT = 8
# Parts that wait for each worker, and workers where an executor does not tell.
_AHEAD = 3
_UNKNOWN = 64
# Executors that may break one after the other with nothing done, and times that an executor may lose a part.
_IN_VAIN = 3


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
        by_name = {name: values for name, _, values in columns}
        self._columns: Mapping[str, Array] = {n: v for n, v in by_name.items() if n not in _BESIDE}
        self._beside: Mapping[str, Array] = {name: by_name[name] for name in _BESIDE}
        self._about(model, {name: unit for name, unit, _ in columns}, report, grid, complete)

    def _about(
        self, model: str, units: dict[str, str], report: dict[str, Any], grid: Mapping[str, Array], complete: bool
    ) -> None:
        self.model = model
        """Name of the model."""
        self.units: dict[str, str] = {name: unit for name, unit in units.items() if name not in _BESIDE}
        """The unit of each column; empty where there is none."""
        self.failures: dict[int, str] = {failure["set"]: failure["reason"] for failure in report["failures"]}
        """Why runs failed, by the numbers of the sets; of the first hundred."""
        self.audit: dict[str, Any] = report["audit"]
        """What the audit of some sets has found, as ``docs/json.md`` describes it."""
        self.drift: list[dict[str, Any]] = report.get("drift", [])
        """How far positions have drifted at the end of the sets from relations that only their speeds keep, as
        ``docs/json.md`` describes it."""
        self.complete = complete
        """Whether all sets are there."""
        self.resumed: int = report.get("resumed", 0)
        """Sets that were there from a sweep that was stopped."""
        self._failed: int = report["failed"]
        self._grid = dict(grid)

    @property
    def sets(self) -> npt.NDArray[np.int64]:
        """The number of the set of each row, from 1; of a sweep that was stopped of those that are done."""
        return self._beside["set"].astype(np.int64, copy=False)

    @property
    def failed(self) -> npt.NDArray[np.bool_]:
        """Whether the run of each row came to no end."""
        return np.asarray(self._beside["failed"] != 0)

    @property
    def done(self) -> int:
        """How many sets are there."""
        return len(self.sets)

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

    def _first(self) -> tuple[Mapping[str, Array], int]:
        """Columns of the first rows at least, and how many rows there are."""
        return {"set": self._beside["set"], **self._columns}, len(self.sets)

    def _shown(self) -> tuple[list[str], list[list[Any]], int]:
        columns, count = self._first()
        names = ["set", *self._columns]
        rows = zip(*(columns[name][:10].tolist() for name in names))
        return names, [[int(number), *values] for number, *values in rows], count

    def __repr__(self) -> str:
        names, rows, count = self._shown()
        head = f"{self.model}: {self.done} sets, {self._failed} failed, {self.audit['sets']} audited"
        more = [f"and {count - 10} more"] if count > 10 else []
        return "\n".join([head, as_text(names, rows), *more])

    def _repr_html_(self) -> str:
        names, rows, _ = self._shown()
        return as_html(names, rows) + f"<p>{self.done} sets</p>"


class _InFiles(Mapping[str, Array]):
    """Columns that are read when they are asked for."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self._folder, self._known = folder, list(names)

    def __getitem__(self, name: str) -> Array:
        if name not in self._known:
            raise KeyError(name)
        parts = [_read(path, [name])[name] for path in files(self._folder)]
        return np.concatenate([np.zeros(0), *parts]) if parts else np.zeros(0)

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)


def _read(path: Path, names: Sequence[str]) -> dict[str, Array]:
    """Columns of a partition; what a model that parameters shape has not there is not a number."""
    file = arrow().parquet.ParquetFile(path)
    known = [name for name in names if name in file.schema_arrow.names]
    table = file.read(columns=known)
    missing = np.full(file.metadata.num_rows, np.nan)
    return {n: table[n].to_numpy().astype(np.float64, copy=False) if n in known else missing for n in names}


class SweepFiles(SweepResult):
    """The rows of a sweep that stand in Parquet files: columns are read when they are asked for. Other programs read the folder
    too: ``polars.scan_parquet(s.pattern)``, ``duckdb.sql(f"select ... from '{s.pattern}'")``,
    ``dask.dataframe.read_parquet(s.pattern)``. ``halfarrow.read_sweep`` finds it again.
    """

    def __init__(self, folder: Path, told: Mapping[str, Any]) -> None:
        self.folder = folder
        """The folder with the files."""
        names, units = self._schema()
        self._columns = _InFiles(folder, [name for name in names if name not in _BESIDE])
        self._beside = _InFiles(folder, _BESIDE)
        grid = {name: np.array(values) for name, values in told["grid"].items()}
        self._about(
            told["model"], {name: units.get(name, "") for name in names}, told["report"], grid, told["complete"]
        )

    @classmethod
    def _written(cls, folder: Path, model: str, report: Any, grid: Mapping[str, Array], complete: bool) -> SweepFiles:
        return cls(folder, {"model": model, "report": report, "grid": grid, "complete": complete})

    def _schema(self) -> tuple[list[str], dict[str, str]]:
        names: dict[str, str] = {}
        for path in self.files:
            schema = arrow().parquet.read_schema(path)
            for name in schema.names:
                names.setdefault(name, (schema.metadata or {}).get(f"unit:{name}".encode(), b"").decode())
        return list(names), names

    @property
    def files(self) -> list[Path]:
        """The files, in the order of the sets."""
        return files(self.folder)

    @property
    def pattern(self) -> str:
        """All files, as other programs take them."""
        return str(self.folder / "part-*.parquet")

    @property
    def done(self) -> int:
        """How many sets are there."""
        return sum(part_of(path).sets for path in self.files)

    def parts(self) -> Iterator[dict[str, Array]]:
        """The columns of a file after the other, with ``set`` and ``failed``, for what does not fit into memory."""
        for path in self.files:
            yield _read(path, ["set", *self._columns, "failed"])

    def _first(self) -> tuple[Mapping[str, Array], int]:
        counts = [arrow().parquet.read_metadata(path).num_rows for path in self.files]
        some = next((path for path, count in zip(self.files, counts) if count), None)
        names = ["set", *self._columns]
        return (dict.fromkeys(names, np.zeros(0)) if some is None else _read(some, names)), sum(counts)


def read_sweep(folder: str | os.PathLike[str]) -> SweepFiles:
    """A sweep that was written into a folder; see ``Model.sweep``. Of one that was stopped what is there.

    Raises:
        FileError: there is none.
    """
    path = Path(folder)
    told = about_of(path)
    if told is None:
        raise FileError(f"{path} holds no sweep")
    if not told["complete"]:
        # It was stopped: the parts tell.
        parts = [part_of(own) for own in files(path)]
        sets = told["identity"]["sets"]
        report = _merged([part.report for part in parts], sets)
        told = {**told, "report": report, "complete": not gaps(parts, sets)}
    return SweepFiles(path, told)


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
    whole: bool = False
    """Whether whole trajectories are kept."""

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
        values = [np.arange(len(rows)), *self.vary.values()]
        shape = [len(each) for each in values]
        places = [
            np.broadcast_to(each.reshape(-1, *[1] * (len(shape) - i - 1)), shape) for i, each in enumerate(values)
        ]
        row, *varied = [place.ravel() for place in places]
        table = [rows[row], np.tile(list(self.fixed.values()), (len(row), 1)), *(each[:, None] for each in varied)]
        return [*names, *self.fixed, *self.vary], numbers(np.hstack([part.reshape(len(row), -1) for part in table]))

    def called(self, columns: Columns) -> Columns:
        """Columns as they were asked for: those that vary, by the names that they were given."""
        names = dict(zip(self.reduce.values(), self.reduce))
        return [(names.get(name, name), unit, values) for name, unit, values in columns if name not in self.fixed]


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


@dataclasses.dataclass(frozen=True)
class Way:
    """How a sweep is done, which its rows do not depend on."""

    executor: Executor | Callable[[], Executor] | None
    chunk: int | None
    journal: Path | None
    into: Path | None
    restart: bool
    progress: Any


@dataclasses.dataclass(frozen=True)
class _Ended:
    """What came of a sweep."""

    columns: Columns
    report: dict[str, Any]
    complete: bool
    raised: BaseException | None
    """What has stopped it."""


def run(model: Model, plan: Plan, way: Way) -> SweepResult:
    """Runs a sweep."""
    grid = {} if plan.samples or plan.whole else plan.vary
    if way.executor is None and way.journal is None and way.into is None:
        ended = _in_one_go(model, plan, way.progress)
    else:
        ended = _in_parts(model, plan, way)
    sets = ended.report["sets"]
    result: SweepResult | None = None
    if way.into is not None:
        result = SweepFiles._written(way.into, model.name, ended.report, grid, ended.complete)
    elif ended.columns:
        result = SweepResult(model.name, ended.columns, ended.report, grid, ended.complete)
    if ended.raised is not None:
        done = f"{0 if result is None else result.done} of {sets} sets are done, see `result`"
        kept = way.journal or way.into
        go_on = "" if kept is None else f"; the same call goes on from {kept}"
        if isinstance(ended.raised, KeyboardInterrupt):
            raise Interrupted(f"the sweep was stopped; {done}{go_on}", result) from ended.raised
        if isinstance(ended.raised, BrokenExecutor):
            advice = "" if callable(way.executor) else (
                ". Give what makes an executor, such as `executor=ProcessPoolExecutor`, and another one is made"
            )  # fmt: skip
            text = f"a worker was killed, and the executor is broken ({ended.raised}); {done}{go_on}{advice}"
            raise RunError(text, result) from ended.raised
        if isinstance(ended.raised, (Error, Warning)) or not isinstance(ended.raised, Exception):
            raise ended.raised
        raise RunError(f"a worker has failed: {ended.raised!r}; {done}{go_on}", result) from ended.raised
    assert result is not None
    _warn(result)
    return result


def _in_one_go(model: Model, plan: Plan, progress: Any) -> _Ended:
    """All sets on all cores of this computer."""
    sets = len(plan.samples[1]) if plan.samples else 1
    sets *= int(np.prod([len(values) for values in plan.vary.values()], dtype=np.int64))
    with Bar(progress, sets, model.name, "set") as bar:
        told = (lambda done, _: bar.reach(done)) if bar else None
        swept = model._core.sweep(plan.arguments(), plan.given, told, False)
    return _Ended(plan.called(swept.columns), swept.report(), swept.complete, swept.raised)


@dataclasses.dataclass(frozen=True)
class _Job:
    """All that a worker needs besides the sets, in a form that can be sent."""

    parts: Any
    """Name, text, files, values of parameters: what the model is made of."""
    plan: Plan
    """Its inputs without files, and without sets."""
    into: str | None
    """Where rows are written; nothing: they are sent back."""


# Models by what they are made of: a worker compiles each once, however many parts of sweeps come to it.
_models: OrderedDict[Any, _halfarrow.Model] = OrderedDict()
_jobs: OrderedDict[str, _Job] = OrderedDict()
_lock = threading.Lock()
# Jobs that Ctrl-C has stopped: threads of this process leave them.
_stopped: set[str] = set()


def _keep(kept: OrderedDict[Any, Any], key: Any, value: Any) -> Any:
    kept[key] = value
    kept.move_to_end(key)
    while len(kept) > _KEPT:
        kept.popitem(last=False)
    return value


def _made_of(parts: Any) -> str:
    return json.dumps(parts, sort_keys=True)


def _work(key: str, job: _Job | None, names: list[str], rows: Array, first: int, of: int) -> Done | None:
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
    # The executor has the other cores.
    done, raised = _part(model, job, names, numbers(rows), (first, of), None, True, key)
    if raised is not None:
        raise raised
    return done


def _part(
    model: _halfarrow.Model,
    job: _Job,
    names: list[str],
    rows: Array,
    part: tuple[int, int],
    told: Any,
    alone: bool,
    key: str,
) -> tuple[Done, BaseException | None]:
    """Some sets, so many of all, and what has stopped them."""
    plan = job.plan
    given = [(name, as_sent(value)) for name, value in plan.given]
    if plan.whole:
        columns, report = _trajectories(model, plan, names, rows, part[0], given, key)
        raised = None
    else:
        arguments = {**plan.arguments(), "vary": [], "samples": (names, rows), "part": part}
        swept = model.sweep(arguments, given, told, alone)
        columns, report, raised = swept.columns, swept.report(), swept.raised
    done = Done(part[0], len(rows), plan.called(columns), report)
    if job.into is not None and raised is None:
        write_part(Path(job.into), done)
        done = dataclasses.replace(done, columns=[])
    return done, raised


def _trajectories(
    model: _halfarrow.Model,
    plan: Plan,
    names: list[str],
    rows: Array,
    first: int,
    given: list[tuple[str, Given]],
    key: str,
) -> tuple[Columns, dict[str, Any]]:
    """Every sample of every run, each audited; of a run that came to no end those before."""
    runs: list[tuple[int, Array, Columns]] = []
    failures, audits = [], []
    for number, row in enumerate(rows, first + 1):
        if key in _stopped:
            raise InterruptedError("the sweep was stopped")
        try:
            ended = model.simulate(plan.options, given, list(zip(names, row.tolist())), None)
        except (ModelError, RunError) as why:
            failures.append({"set": number, "reason": str(why)})
            continue
        if ended.raised is not None:
            raise ended.raised
        runs.append((number, ended.times, ended.columns))
        if ended.failure is not None:
            failures.append({"set": number, "reason": ended.failure})
        else:
            audits.append((number, ended.report()["audit"]))
    samples = [len(times) for _, times, _ in runs]
    numbers_of = [number for number, _, _ in runs]
    columns: Columns = [("set", "", np.repeat(np.array(numbers_of, dtype=np.float64), samples))]
    units = {p["name"]: p["unit"] or "" for p in model.interface()["parameters"]}
    for i, name in enumerate(names):
        columns.append(
            (name, units.get(name, ""), np.repeat(rows[np.array(numbers_of, dtype=int) - first - 1, i], samples))
        )
    columns.append(("t", "s", np.concatenate([np.zeros(0), *(times for _, times, _ in runs)])))
    # Models that parameters shape may have other variables: each has a column, empty where a set has it not.
    units_of = {name: unit for _, _, own in runs for name, unit, _ in own}
    for name, unit in units_of.items():
        values = [next((v for n, _, v in own if n == name), np.full(len(t), np.nan)) for _, t, own in runs]
        columns.append((name, unit, np.concatenate([np.zeros(0), *values])))
    failing = {failure["set"] for failure in failures}
    ends = np.array([number in failing for number in numbers_of], dtype=np.float64)
    columns.append(("failed", "", np.repeat(ends, samples)))
    missed = [(number, audit) for number, audit in audits if audit["verdict"] != "holds"]
    count = {verdict: sum(audit["verdict"] == verdict for _, audit in missed) for verdict in ("doubtful", "refused")}
    told = {
        "sets": len(audits),
        **count,
        "misses": [{"set": n, "verdict": a["verdict"], "warnings": a["warnings"]} for n, a in missed],
        "greatest": _greatest_of([audit for _, audit in audits]) if audits else None,
    }
    drift = _drifts_of_runs(audits)
    return columns, {
        "sets": len(rows), "failures": failures[:100], "failed": len(failures), "drift": drift, "audit": told,
    }  # fmt: skip


def _in_parts(model: Model, plan: Plan, way: Way) -> _Ended:
    """A part after the other, here or through an executor; what is done is kept on the way."""
    names, rows = plan.sets()
    of = len(rows)
    given = [(name, on_its_own(value)) for name, value in plan.given]
    bare = dataclasses.replace(plan, given=given, samples=None, vary={})
    into = None if way.into is None else str(way.into.absolute())
    job = _Job(model._core.parts(), bare, into)
    kept: Kept | None = None
    if way.journal is not None or way.into is not None:
        about = identity(job.parts, bare.arguments(), given, names, rows)
        about["columns"] = [list(plan.reduce), list(plan.fixed), plan.whole]
        if way.into is not None:
            grid = {} if plan.samples or plan.whole else {name: values.tolist() for name, values in plan.vary.items()}
            kept = Folder(way.into, about, way.restart, {"model": model.name, "grid": grid})
        elif way.journal is not None:
            kept = Journal(way.journal, about, way.restart)
    try:
        done = [] if kept is None else kept.parts()
        resumed = sum(part.sets for part in done)
        raised: BaseException | None = None
        with Bar(way.progress, of, model.name, "set") as bar:
            bar.reach(resumed)
            work = _Parts(model, job, names, rows, kept, done, bar)
            try:
                if way.executor is None and not plan.whole:
                    raised = work.here(way.chunk)
                elif way.executor is None:
                    with ThreadPoolExecutor(os.cpu_count()) as threads:
                        raised = work.through(threads, way.chunk)
                elif (
                    isinstance(way.executor, Executor) or hasattr(way.executor, "submit") and not callable(way.executor)
                ):
                    raised = work.through(way.executor, way.chunk)
                else:
                    raised = work.through_those_of(way.executor, way.chunk)
            except BaseException as why:
                raised = why
        done = sorted(done, key=lambda part: part.first)
        complete = raised is None and not gaps(done, of)
        report = {"resumed": resumed, **_merged([part.report for part in done], of)}
        columns: Columns = []
        if done and way.into is None:
            columns = [
                (name, unit, np.concatenate([part.columns[i][2] for part in done]))
                for i, (name, unit, _) in enumerate(done[0].columns)
            ]
        if isinstance(kept, Folder):
            kept.tell({"complete": complete, "report": report})
        return _Ended(columns, report, complete, raised)
    finally:
        if kept is not None:
            kept.close()


class _Parts:
    """The parts of a sweep that are open, and those that are done."""

    def __init__(
        self, model: Model, job: _Job, names: list[str], rows: Array, kept: Kept | None, done: list[Done], bar: Bar
    ) -> None:
        self.model, self.job, self.names, self.rows = model, job, names, rows
        self.kept, self.done, self.bar = kept, done, bar
        self.of = len(rows)
        self.sets = sum(part.sets for part in done)
        self.key = hashlib.sha256(pickle.dumps(job)).hexdigest()

    def add(self, part: Done) -> None:
        if self.kept is not None:
            self.kept.add(part)
        self.done.append(part)
        self.sets += part.sets
        self.bar.reach(self.sets)

    def here(self, chunk: int | None) -> BaseException | None:
        """On all cores of this computer, in parts of about a second: so much is lost if the program is killed."""
        least = _LANES * (os.cpu_count() or 1)
        size = least if chunk is None else _chunk(self.of, 1, chunk)
        for first, end in gaps(self.done, self.of):
            while first < end:
                rows = self.rows[first : min(first + size, end)]
                before = self.sets
                told = (lambda done, _, before=before: self.bar.reach(before + done)) if self.bar else None
                begun = time.perf_counter()
                part = (first, self.of)
                done, raised = _part(self.model._core, self.job, self.names, rows, part, told, False, self.key)
                if raised is not None:
                    if self.job.into is None and len(done.columns[0][2]):
                        # They are not whole: they come into the result, and are computed again by another sweep.
                        self.done.append(dataclasses.replace(done, sets=len(done.columns[0][2])))
                    return raised
                self.add(done)
                first += len(rows)
                if chunk is None:
                    took = time.perf_counter() - begun
                    size = min(2 * size, _MOST) if took < 0.5 else max(size // 2, least) if took > 2 else size
        return None

    def through_those_of(self, make: Callable[[], Executor], chunk: int | None) -> BaseException | None:
        """Through executors that are made as long as workers die and something comes of it."""
        in_vain = 0
        while True:
            before = len(self.done)
            with make() as executor:
                raised = self.through(executor, chunk)
            in_vain = in_vain + 1 if len(self.done) == before else 0
            if not isinstance(raised, BrokenExecutor) or in_vain == _IN_VAIN:
                return raised

    def through(self, executor: Executor, chunk: int | None) -> BaseException | None:
        """Through an executor. Few parts are on their way at a time: memory stays bounded however many there are."""
        workers = _workers(executor)
        size = _chunk(self.of, workers or _UNKNOWN, chunk)
        if chunk is None and self.job.plan.whole:
            size = max(1, _MOST // _samples_of(self.job.plan.options))
        open_parts = (
            (at, min(at + size, end)) for first, end in gaps(self.done, self.of) for at in range(first, end, size)
        )
        # Workers that are threads of this process, or its forks, have the model already.
        with _lock:
            _stopped.discard(self.key)
            _keep(_models, _made_of(self.job.parts), self.model._core)
        ready: SimpleQueue[Future[Done | None]] = SimpleQueue()
        waiting: dict[Future[Done | None], tuple[int, int]] = {}
        raised: BaseException | None = None
        lost: Counter[tuple[int, int]] = Counter()

        def submit(part: tuple[int, int], sent: _Job | None) -> None:
            first, end = part
            future = executor.submit(_work, self.key, sent, self.names, self.rows[first:end], first, self.of)
            waiting[future] = part
            future.add_done_callback(ready.put)

        def begin(most: int, sent: _Job | None) -> None:
            for part in itertools.islice(open_parts, most):
                submit(part, sent)

        try:
            # The first parts bring the text to the workers; the others name it.
            begin(workers or _UNKNOWN, self.job)
            begin(_AHEAD * (workers or _UNKNOWN), None)
            while waiting:
                future = ready.get()
                part = waiting.pop(future)
                done: Done | None = None
                try:
                    done = future.result()
                except Exception as why:
                    lost[part] += 1
                    if raised is not None or lost[part] == _IN_VAIN or not _lost(why):
                        # Others may be done; nothing more is begun.
                        raised = raised or why
                        for other in waiting:
                            other.cancel()
                        continue
                if done is not None:
                    self.add(done)
                if raised is None:
                    try:
                        if done is None:
                            # The worker has not the text, or died with what it had computed.
                            submit(part, self.job)
                        else:
                            begin(1, None)
                    except BrokenExecutor as why:
                        raised = why
        except BaseException as why:
            _stopped.add(self.key)
            for future in waiting:
                future.cancel()
            return why
        return raised


def _lost(why: Exception) -> bool:
    """Whether a part may come out when it is begun again: an executor has mistaken a result that went with its worker, as Dask
    does where one is killed between computing and sending (``TypeError`` in ``distributed.cfexecutor``)."""
    return not isinstance(why, (Error, Warning, BrokenExecutor, CancelledError))


def _workers(executor: Executor) -> int | None:
    """How many workers an executor has, if it tells."""
    if hasattr(executor, "_client"):  # Dask
        return len(executor._client.nthreads()) or None
    for name in ("_max_workers", "num_workers"):
        known = getattr(executor, name, None)
        if isinstance(known, int) and known > 0:
            return known
    return None


def _chunk(sets: int, workers: int, asked: int | None) -> int:
    """Sets of a part: as asked, else so many that each worker gets some, and multiples of what is computed in one go."""
    if asked is not None:
        if asked < 1:
            raise UsageError(f"chunk is {asked}: it has to be at least 1")
        return asked
    return max(1, round(min(sets / (16 * workers), _MOST) / _LANES)) * _LANES


def _samples_of(options: Mapping[str, Any]) -> int:
    """About how many samples a run has."""
    apart = options["every"] or options["step"]
    return max(1, round(options["to"] / apart)) if apart else 1000


def _merged(reports: Sequence[dict[str, Any]], sets: int) -> dict[str, Any]:
    """The reports of parts as one."""
    audits = [report["audit"] for report in reports]
    found = [audit["greatest"] for audit in audits if audit["greatest"] is not None]
    return {
        "sets": sets,
        "failures": sorted((f for report in reports for f in report["failures"]), key=lambda f: f["set"])[:100],
        "failed": sum(report["failed"] for report in reports),
        "drift": _drifts([drift for report in reports for drift in report.get("drift", [])]),
        "audit": {
            **{count: sum(audit[count] for audit in audits) for count in ("sets", "doubtful", "refused")},
            "misses": [miss for audit in audits for miss in audit["misses"]],
            "greatest": _greatest_of(found) if found else None,
        },
    }


def _drifts(found: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The greatest drift from each relation, and in how many sets it was measured."""
    of: dict[str, dict[str, Any]] = {}
    for own in found:
        known = of.setdefault(own["relation"], {**own, "sets": 0})
        known["sets"] += own["sets"]
        known["resolution"] = max(known["resolution"], own["resolution"])
        value = own["greatest"]
        if value is not None and (known["greatest"] is None or value != value or value > known["greatest"]):
            known.update(greatest=value, set=own["set"])
    return list(of.values())


def _drifts_of_runs(audits: Sequence[tuple[int, dict[str, Any]]]) -> list[dict[str, Any]]:
    """The same of runs that were audited, by the numbers of their sets."""
    told = [(number, drift) for number, audit in audits for drift in audit["drift"]]
    return _drifts(
        [
            {
                "relation": drift["relation"],
                "kind": drift["kind"],
                "greatest": None if drift["value"] is None else abs(drift["value"]),
                "set": None if drift["value"] is None else number,
                "sets": int(drift["value"] is not None),
                "resolution": drift["resolution"],
            }
            for number, drift in told
        ]
    )


def _greatest_of(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The greatest misses of audits, and all that is said."""
    verdicts = ("holds", "doubtful", "refused")
    return {
        **found[0],
        **{kind: _greatest([audit[kind] for audit in found]) for kind in ("power", "energy", "residual", "rates")},
        **{kind: sorted({text for audit in found for text in audit[kind]}) for kind in ("notes", "unchecked")},
        "verdict": max((audit["verdict"] for audit in found), key=verdicts.index),
    }


def _greatest(misses: Sequence[dict[str, Any] | None]) -> dict[str, Any] | None:
    """The miss that is farthest above what can be told; one that is not a number first."""
    some = [miss for miss in misses if miss is not None]
    return max(some, key=lambda m: (m["value"] != m["value"], m["value"] - m["resolution"]), default=None)


def _warn(result: SweepResult) -> None:
    if result._failed == result.done:
        number, reason = next(iter(result.failures.items()), (1, ""))
        raise RunError(f"all sets failed; set {number}: {reason}", result)
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
