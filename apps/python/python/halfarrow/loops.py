"""Zero-order causal paths and what becomes of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ._errors import needed
from ._tables import as_html, as_text, record

if TYPE_CHECKING:
    import pandas


@dataclasses.dataclass(frozen=True)
class Path:
    """A zero-order causal path."""

    class_: int
    """1 storage to storage, 2 resistor to resistor, 3 resistor to itself, 4 inside the junction structure."""
    elements: list[str]
    """What it runs between."""
    route: list[str]
    """All elements that it meets, in order."""
    bonds: list[int]
    """The bonds it runs along, numbered from 1 as in the drawing."""
    gain: str
    """Its gain, in the model language."""
    gain_value: float | None
    """The gain at the start; None if it has no value there."""
    breaks: list[str]
    """Break variables on it."""
    resolution: str
    """What becomes of it in minimal form."""


@dataclasses.dataclass(frozen=True)
class Storage:
    """A port of a storage."""

    name: str
    causality: str
    """``integral`` or ``derivative``."""
    independent: bool
    follows: str | None
    """The independent variables from which a dependent one follows."""


@dataclasses.dataclass(frozen=True)
class Loops:
    """Zero-order causal paths, storages and counts of a model.

    >>> import halfarrow as ha
    >>> loops = ha.model("model Two\\nSe:push(1 N) -> 1:v -> I:a(2 kg)\\nv -> I:b(3 kg)\\n").loops
    >>> [(s.name, s.causality, s.follows) for s in loops.storages]
    [('a', 'integral', None), ('b', 'derivative', 'b.f = a.f')]
    >>> loops.dof, len(loops)
    (1, 1)
    """

    model: str
    paths: list[Path]
    complete: bool
    """Whether these are all paths; else there is one for every break variable."""
    kept: list[str]
    """Variables that are independent although no storage has them."""
    components: list[dict[str, Any]]
    """The strongly connected parts of the algebraic variables."""
    storages: list[Storage]
    conserved: list[dict[str, str]]
    """Combinations of stored quantities that no motion changes."""
    counts: dict[str, dict[str, int]]
    """Numbers of differential and algebraic equations in the forms ``break``, ``inverted``, ``minimal``."""
    dof: int
    """Number of independent storages."""
    state_matrix: dict[str, Any] | None
    """What derivative causality says of the state matrix of a linear graph."""

    @classmethod
    def _of(cls, told: Mapping[str, Any]) -> Loops:
        paths = [record(Path, {**path, "class_": path["class"]}) for path in told["paths"]]
        storages = [record(Storage, storage) for storage in told["storages"]]
        return record(cls, {**told, "paths": paths, "storages": storages})

    def __iter__(self) -> Iterator[Path]:
        return iter(self.paths)

    def __len__(self) -> int:
        return len(self.paths)

    _header = ("class", "between", "gain", "value", "break variables", "in minimal form")

    def _rows(self) -> list[tuple[Any, ...]]:
        return [(p.class_, " - ".join(p.elements), p.gain, p.gain_value, p.breaks, p.resolution) for p in self.paths]

    def _storage_rows(self) -> list[tuple[Any, ...]]:
        return [
            (s.name, s.causality, "independent" if s.independent else "dependent", s.follows) for s in self.storages
        ]

    def __str__(self) -> str:
        parts = [f"{self.model}: {len(self)} zero-order causal paths, {self.dof} independent storages"]
        if self.paths:
            parts.append(as_text(self._header, self._rows()))
        if self.storages:
            parts.append(as_text(("storage", "causality", "", "follows from"), self._storage_rows()))
        return "\n\n".join(parts)

    def _repr_html_(self) -> str:
        return as_html(self._header, self._rows()) + as_html(
            ("storage", "causality", "", "follows from"), self._storage_rows()
        )

    def to_pandas(self) -> pandas.DataFrame:
        """The paths as a frame, one in a row."""
        try:
            import pandas
        except ImportError:
            raise needed("pandas", "pandas", "to_pandas") from None
        return pandas.DataFrame([dataclasses.asdict(path) for path in self.paths]).rename(columns={"class_": "class"})
