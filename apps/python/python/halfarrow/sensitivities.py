"""Sensitivities: exact derivatives of a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ._errors import needed, unknown
from ._tables import as_html
from .result import Result

if TYPE_CHECKING:
    import pandas

Array = npt.NDArray[np.float64]


class Sensitivities(Mapping[tuple[str, str], Array]):
    """Derivatives of what a run has recorded: arrays of the shape ``(samples,)`` by pairs of names, variable and quantity.
    A derivative is in the unit of its variable over the SI unit of what it is by.

    >>> import halfarrow as ha
    >>> drop = ha.model("model Drop\\nparam m = 2 kg\\nSe:weight(9.81 N) -> I:mass(m)\\n")
    >>> s = drop.sensitivities(["m", "mass.f(0)"], to=2, every=1)
    >>> s["mass.f", "m"].round(4), s.units["mass.f", "m"]
    (array([ 0.    , -2.4525, -4.905 ]), '(m/s)/(kg)')
    >>> s["mass.f", "mass.f(0)"]
    array([1., 1., 1.])
    """

    def __init__(self, result: Result, by: Sequence[str]) -> None:
        self.by: list[str] = list(by)
        """What the run is differentiated by."""
        own = len(result) // (len(self.by) + 1)
        names = list(result)
        self.names: list[str] = names[:own]
        """The variables."""
        self.t: Array = result.t
        """Times of the samples, in s."""
        self.result = result
        """The run: values, and as ``d(travel)/d(ks)`` their derivatives; audit and report."""
        pairs = [(name, quantity) for quantity in self.by for name in self.names]
        self._columns = dict(zip(pairs, names[own:], strict=True))
        self.units: dict[tuple[str, str], str] = {pair: result.units[name] for pair, name in self._columns.items()}
        """The unit of each derivative; empty where there is none."""

    def __getitem__(self, pair: tuple[str, str]) -> Array:
        name, quantity = pair
        if quantity not in self.by:
            raise unknown("quantity", quantity, self.by)
        if name not in self.names:
            raise unknown("variable", name, self.names)
        return self.result[self._columns[pair]]

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def array(self) -> Array:
        """All of them, of the shape ``(samples, variables, quantities)``, in the order of ``names`` and ``by``."""
        return np.stack(
            [np.stack([self[name, quantity] for name in self.names], axis=-1) for quantity in self.by], axis=-1
        )

    def to_pandas(self) -> pandas.DataFrame:
        """A frame over time with two levels of columns, ``variable`` and ``by``."""
        try:
            import pandas
        except ImportError:
            raise needed("pandas", "pandas", "to_pandas") from None
        columns = pandas.MultiIndex.from_tuples(list(self), names=["variable", "by"])
        values = np.stack([self[pair] for pair in self], axis=-1)
        return pandas.DataFrame(values, index=pandas.Index(self.t, name="t"), columns=columns)

    def __repr__(self) -> str:
        return f"<Sensitivities of {', '.join(self.names)} by {', '.join(self.by)}, {len(self.t)} samples>"

    def _repr_html_(self) -> str:
        rows = [(*pair, self.units[pair], values.min(), values.max(), values[-1]) for pair, values in self.items()]
        return as_html(("variable", "by", "unit", "least", "greatest", "last"), rows)
