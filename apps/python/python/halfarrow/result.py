"""What a run has recorded."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _halfarrow
from ._errors import needed, unknown
from ._tables import as_html, as_text, record
from .picture import Picture

if TYPE_CHECKING:
    import matplotlib.axes
    import pandas
    import xarray

    from .model import Model

Array = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Deviation:
    """The greatest miss of a kind."""

    value: float
    """Relative to the greatest magnitude of its kind around its place."""
    time: float
    """When, in s."""
    place: str
    """Where, and what was missed there."""
    resolution: float
    """Below this a miss says nothing."""


@dataclasses.dataclass(frozen=True)
class Drift:
    """How far positions have drifted from a relation that only their speeds keep."""

    relation: str
    kind: str
    """``closed``, ``open``, ``nonholonomic`` or ``undecided``."""
    value: float | None
    greatest: float | None
    resolution: float


@dataclasses.dataclass(frozen=True)
class Audit:
    """What the audit of a run against its bond graph has found."""

    verdict: str
    """``holds``; ``doubtful``: something is missed by more than a millionth; ``refused``: by more than a hundredth."""
    warnings: list[str]
    """What is missed, where, when, and what to do about it."""
    power: Deviation | None
    """Power made or eaten by the junction structure."""
    energy: Deviation | None
    """Stored less initial, supplied plus dissipated energy."""
    residual: Deviation | None
    """Laws of junctions and elements."""
    rates: Deviation | None
    """Stored quantities against the integrals of their rates."""
    events: dict[str, float]
    """What storages have gained by events, in J."""
    drift: list[Drift]
    notes: list[str]
    unchecked: list[str]
    """What could not be checked, and why."""

    @classmethod
    def _of(cls, told: Mapping[str, Any]) -> Audit:
        misses = {
            name: None if told[name] is None else record(Deviation, told[name])
            for name in ("power", "energy", "residual", "rates")
        }
        return record(cls, {**told, **misses, "drift": [record(Drift, drift) for drift in told["drift"]]})


class Result(Mapping[str, Array]):
    """What a run has recorded: arrays by the names of variables, each of the shape ``(samples,)`` and in the unit that the
    model declares, else in SI units. The arrays are the memory of the run itself, not copies.

    >>> import halfarrow as ha
    >>> r = ha.model("model Drop\\nSe:weight(9.81 N) -> I:mass(1 kg)\\n").simulate(to=2, every=0.5)
    >>> r.t
    array([0. , 0.5, 1. , 1.5, 2. ])
    >>> r["mass.f"].round(6)
    array([ 0.   ,  4.905,  9.81 , 14.715, 19.62 ])
    >>> r.units["mass.f"], r.audit.verdict
    ('m/s', 'holds')
    """

    def __init__(self, model: Model, ended: _halfarrow.Ended, to: float) -> None:
        self.model = model
        """The model that has run."""
        self.t: Array = ended.times
        """Times of the samples, in s. After an event a time stands twice, before and after it."""
        columns = ended.columns
        self.units: dict[str, str] = {name: unit for name, unit, _ in columns}
        """The unit of each variable; empty where there is none."""
        self.reached: float = ended.reached
        """The time reached, in s."""
        self.failure: str | None = ended.failure
        """Why it stopped before its end, or why its result is not to be used; None if neither."""
        self.complete: bool = self.failure is None and self.reached >= to
        """Whether the run came to its end."""
        self._columns = {name: values for name, _, values in columns}
        self._ended: _halfarrow.Ended | None = ended
        self._told: dict[str, Any] = {}

    @property
    def report(self) -> dict[str, Any]:
        """What the run took, and how well it did: steps, evaluations, what was met, as ``docs/json.md`` describes it."""
        if self._ended is not None:
            self._told = {
                **self._ended.report(),
                "seconds": self._ended.seconds,
                "tolerances": self._ended.tolerances(),
            }
            self._ended = None
        return self._told

    @property
    def audit(self) -> Audit:
        """What the audit has found."""
        return Audit._of(self.report["audit"])

    @property
    def notes(self) -> list[str]:
        """What was left out or is to be known; they were told as warnings."""
        return list(self.report["notes"])

    @property
    def tolerances(self) -> dict[str, tuple[float, float]]:
        """Of each state the magnitude that it was taken to have and the error allowed in a step, in SI units; nothing of
        methods with fixed step."""
        return {name: (scale, absolute) for name, scale, absolute in self.report["tolerances"]}

    def __getitem__(self, name: str) -> Array:
        try:
            return self._columns[name]
        except KeyError:
            if name == "t":
                return self.t
            raise unknown("variable", name, self._columns) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __getstate__(self) -> dict[str, Any]:
        told = self.report
        return {**self.__dict__, "_ended": None, "_told": told}

    def __repr__(self) -> str:
        rows = [(name, self.units[name], *_span(values)) for name, values in self._columns.items()]
        head = f"{self.model.name} to t = {self.reached:g} s, {len(self.t)} samples, audit: {self.audit.verdict}"
        return head + "\n" + as_text(("variable", "unit", "start", "end", "least", "greatest"), rows)

    def _repr_html_(self) -> str:
        rows = [(name, self.units[name], *_span(values)) for name, values in self._columns.items()]
        return self.picture().svg + as_html(("variable", "unit", "start", "end", "least", "greatest"), rows)

    def _names(self, names: Sequence[str]) -> list[str]:
        for name in names:
            if name not in self._columns:
                raise unknown("variable", name, self._columns)
        return list(names) or list(self._columns)

    def _run(self, name: str = "") -> tuple[str, Array, list[tuple[str, str, Array]]]:
        return name, self.t, [(name, self.units[name], values) for name, values in self._columns.items()]

    def picture(
        self,
        *names: str,
        x: str | None = None,
        log: tuple[bool, bool] = (False, False),
        beside: Mapping[str, Result] | None = None,
    ) -> Picture:
        """A plot as SVG, a panel for each unit; it needs nothing else installed.

        Args:
            names: What goes upwards; nothing: everything.
            x: What goes to the right; nothing: time.
            log: Whether the axis to the right is logarithmic, and the one upwards.
            beside: Other results by name, drawn over the same axes.

        Raises:
            UnknownNameError: there is no such variable.
        """
        runs = [self._run(), *(other._run(name) for name, other in (beside or {}).items())]
        return Picture(self.model._core.plot(runs, list(names), x, list(log)))

    def plot(self, *names: str, x: str | None = None, ax: matplotlib.axes.Axes | None = None) -> matplotlib.axes.Axes:
        """Draws variables with Matplotlib (``pip install halfarrow[plot]``).

        Args:
            names: What goes upwards; nothing: everything.
            x: What goes to the right; nothing: time.
            ax: Where to draw; nothing: the present axes.

        Raises:
            UnknownNameError: there is no such variable.
        """
        try:
            import matplotlib.pyplot as plt
        except ImportError:
            raise needed("matplotlib", "plot", "plot") from None
        chosen = self._names(names)
        ax = plt.gca() if ax is None else ax
        for name in chosen:
            ax.plot(self.t if x is None else self[x], self[name], label=_labelled(name, self.units[name]))
        ax.set_xlabel("t in s" if x is None else _labelled(x, self.units[x]))
        ax.set_title(self.model.name)
        ax.legend()
        return ax

    def to_pandas(self) -> pandas.DataFrame:
        """A frame over time; ``attrs`` have the model, the units and the audit. Columns are not copied."""
        try:
            import pandas
        except ImportError:
            raise needed("pandas", "pandas", "to_pandas") from None
        index = pandas.Index(self.t, name="t", copy=False)
        frame = pandas.DataFrame(self._columns, index=index, copy=False)
        frame.attrs = {"model": self.model.name, "units": dict(self.units), "audit": dataclasses.asdict(self.audit)}
        return frame

    def to_xarray(self) -> xarray.Dataset:
        """A dataset over ``t``, the unit of each variable in its ``attrs``, model and audit in those of the dataset.
        Variables are not copied."""
        try:
            import xarray
        except ImportError:
            raise needed("xarray", "xarray", "to_xarray") from None
        variables = {name: ("t", values, {"units": self.units[name]}) for name, values in self._columns.items()}
        attributes = {"model": self.model.name, "audit": dataclasses.asdict(self.audit)}
        return xarray.Dataset(variables, coords={"t": ("t", self.t, {"units": "s"})}, attrs=attributes)

    def save(self, path: str | os.PathLike[str], *, units: bool = False) -> None:
        """Writes a file whose name ends in ``.csv`` or ``.parquet``.

        Args:
            units: Whether CSV has a second line with units; Parquet has them in its metadata.

        Raises:
            UsageError: the name ends in something else.
            FileError: the file cannot be written.
        """
        _halfarrow.write_trace(os.fspath(path), [self._run()], units)


def _labelled(name: str, unit: str) -> str:
    return f"{name} in {unit}" if unit else name


def _span(values: Array) -> tuple[float, ...]:
    if not len(values):
        return (float("nan"),) * 4
    return float(values[0]), float(values[-1]), float(values.min()), float(values.max())
