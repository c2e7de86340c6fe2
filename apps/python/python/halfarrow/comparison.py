"""The forms of a model beside each other."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from ._errors import needed
from ._tables import as_html, as_text
from .picture import Picture

if TYPE_CHECKING:
    import pandas


@dataclasses.dataclass(frozen=True)
class Comparison:
    """All forms of a model: size, cost of an evaluation, time at equal error, agreement."""

    model: str
    to: float
    """End of the runs, in s."""
    error: float
    """Error of the motion at which times are compared."""
    rows: list[dict[str, Any]]
    """A dict for each form, with the fields that ``docs/json.md`` describes; what does not exist is None."""
    notes: list[str]
    report: dict[str, Any]
    """All of it as plain data."""
    picture: Picture = dataclasses.field(repr=False)
    """Work against error."""

    @property
    def refused(self) -> list[str]:
        """Forms whose results do not satisfy the model, as the audit found."""
        return [row["form"] for row in self.rows if row["audit"] and row["audit"]["verdict"] == "refused"]

    _header = (
        "form",
        "differential",
        "algebraic",
        "index",
        "operations",
        "solver",
        "steps",
        "time for 1 s in s",
        "ratio",
    )
    _fields = (
        "form",
        "differential",
        "algebraic",
        "index",
        "flops",
        "solver",
        "steps",
        "seconds_per_second",
        "times_minimal",
    )

    def _table(self) -> list[list[Any]]:
        return [[row[name] for name in self._fields] for row in self.rows if row["differential"] is not None]

    def __str__(self) -> str:
        reasons = [f"{row['form']}: {row['reason']}" for row in self.rows if row["reason"]]
        return "\n".join([as_text(self._header, self._table()), *reasons, *self.notes])

    def _repr_html_(self) -> str:
        return as_html(self._header, self._table()) + self.picture.svg

    def to_pandas(self) -> pandas.DataFrame:
        """The forms as a frame, one in a row."""
        try:
            import pandas
        except ImportError:
            raise needed("pandas", "pandas", "to_pandas") from None
        return pandas.DataFrame(self.rows).set_index("form")
