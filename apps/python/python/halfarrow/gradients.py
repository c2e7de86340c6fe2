"""Derivatives of one number that a run comes to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ._errors import UsageError, needed, unknown
from ._tables import as_html, as_text
from .result import Result
from .sweeps import reductions

if TYPE_CHECKING:
    import pandas

Array = npt.NDArray[np.float64]

Recorded: TypeAlias = Mapping[str, Array]
"""What a run has recorded, by name; ``"t"`` has the times."""

Objective: TypeAlias = (
    str | tuple[str, str] | Mapping[str, npt.ArrayLike] | Callable[[Recorded], tuple[float, Mapping[str, npt.ArrayLike]]]
)
"""A number that is differentiated: see ``Model.gradient``."""


class Gradient(Mapping[str, float]):
    """The derivatives of a number by the names of parameters, start values and inputs, each in the unit of the number over the
    SI unit of what it is by.

    >>> import halfarrow as ha
    >>> drop = ha.model("model Drop\\nparam m = 2 kg, F = 9.81 N\\nSe:weight(F) -> I:mass(m)\\n")
    >>> g = drop.gradient("final(mass.f)", to=2)
    >>> round(g.value, 3), round(g["m"], 4), round(g["F"], 4)
    (9.81, -4.905, 1.0)
    """

    def __init__(
        self, value: float, slopes: Sequence[tuple[str, str, float | None, float]], without: Sequence[tuple[str, str]],
        result: Result,
    ) -> None:  # fmt: skip
        self.value = value
        """The number itself."""
        self.result = result
        """The run."""
        self._slopes = {name: slope for name, _, _, slope in slopes}
        self.units: dict[str, str] = {name: unit for name, unit, _, _ in slopes}
        """The SI unit of what each derivative is by; empty where there is none."""
        self.at: dict[str, float | None] = {name: at for name, _, at, _ in slopes}
        """The present value of each parameter and input, in SI units; ``None`` of start values."""
        self.without: dict[str, str] = dict(without)
        """Parameters by which there is no derivative, and why, where none were named."""

    def __getitem__(self, name: str) -> float:
        try:
            return self._slopes[name]
        except KeyError:
            raise unknown("quantity", name, self._slopes) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._slopes)

    def __len__(self) -> int:
        return len(self._slopes)

    def array(self) -> Array:
        """The derivatives in order, of the shape ``(quantities,)``."""
        return np.array(list(self._slopes.values()))

    def to_pandas(self) -> pandas.DataFrame:
        """A frame with a row for each quantity: ``derivative``, ``unit``, ``at``."""
        try:
            import pandas
        except ImportError:
            raise needed("pandas", "pandas", "to_pandas") from None
        columns = {"derivative": self._slopes, "unit": self.units, "at": self.at}
        return pandas.DataFrame(columns, index=list(self._slopes))

    def _rows(self) -> list[tuple[Any, ...]]:
        def percent(name: str) -> float | None:
            at = self.at[name]
            return None if at is None else 0.01 * at * self[name]

        return [(name, self[name], self.units[name], percent(name)) for name in self]

    def __repr__(self) -> str:
        return f"{self.value:.6g}\n" + as_text(("by", "derivative", "unit", "of 1 %"), self._rows())

    def _repr_html_(self) -> str:
        return f"<p>{self.value:.6g}</p>" + as_html(("by", "derivative", "unit", "of 1 %"), self._rows())


def variables(objective: Objective) -> list[str]:
    """What has to be recorded for it beside what is asked for."""
    if isinstance(objective, Mapping):
        return list(objective)
    if isinstance(objective, str) and objective.endswith(")"):
        return [objective.partition("(")[2][:-1].strip()]
    if isinstance(objective, tuple) and objective:
        return [str(objective[0])]
    return []


Asked: TypeAlias = Callable[[Array, list[str], list[Array]], tuple[float, list[Array]]]


def asked(objective: Objective) -> str | Asked:
    """An objective as the compiled part takes it."""
    if isinstance(objective, str):
        return objective
    if isinstance(objective, tuple):
        (text,) = reductions({"number": objective}).values()
        return text
    if isinstance(objective, Mapping):
        weights = {name: np.asarray(weight, dtype=np.float64) for name, weight in objective.items()}
    elif not callable(objective):
        raise UsageError(f'the number is {objective!r}: give "rms(travel)", weights by name, or a function of the run')

    def number(t: Array, names: list[str], columns: list[Array]) -> tuple[float, list[Array]]:
        recorded = dict(zip(names, columns, strict=True))
        if isinstance(objective, Mapping):
            slopes = weights
        else:
            told = objective({"t": t, **recorded})
            if not (isinstance(told, tuple) and len(told) == 2 and isinstance(told[1], Mapping)):
                raise UsageError("the function has to give a number and its derivatives by name: `value, {\"body.f\": array}`")
            slopes = {name: np.asarray(slope, dtype=np.float64) for name, slope in told[1].items()}
        for name, slope in slopes.items():
            if name not in recorded:
                raise unknown("recorded variable", name, recorded)
            if slope.shape != t.shape:
                raise UsageError(f"the derivative by `{name}` has the shape {slope.shape}, not {t.shape}, that of the times")
        weighted = isinstance(objective, Mapping)
        value = float(sum(slopes[name] @ recorded[name] for name in slopes)) if weighted else float(told[0])
        return value, [np.ascontiguousarray(slopes[n]) if n in slopes else np.zeros_like(t) for n in recorded]

    return number
