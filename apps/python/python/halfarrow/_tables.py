"""Tables as text and HTML, and records out of plain data."""

from __future__ import annotations

import dataclasses
import html
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

Record = TypeVar("Record")


def record(kind: type[Record], data: Mapping[str, Any]) -> Record:
    """A dataclass of the fields of that name; others are left out."""
    fields = dataclasses.fields(kind)  # type: ignore[arg-type]
    return kind(**{field.name: data[field.name] for field in fields if field.name in data})


def cell(value: Any) -> str:
    """A value as it stands in a table: numbers short, lists with commas, nothing for None.

    >>> cell(0.1 + 0.2), cell(["a", "b"]), cell(None)
    ('0.3', 'a, b', '')
    """
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(map(cell, value))
    return str(value)


def as_text(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table with aligned columns.

    >>> print(as_text(["a", "bc"], [[1, None], ["long", 2.5]]))
    a     bc
    1
    long  2.5
    """
    lines = [list(header), *([cell(value) for value in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines)]
    return "\n".join("  ".join(text.ljust(w) for text, w in zip(line, widths)).rstrip() for line in lines)


def as_html(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """The same as an HTML table.

    >>> as_html(["a"], [["<b>"]])
    '<table><tr><th>a</th></tr><tr><td>&lt;b&gt;</td></tr></table>'
    """

    def line(tag: str, values: Iterable[Any]) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell(value))}</{tag}>" for value in values) + "</tr>"

    return "<table>" + line("th", header) + "".join(line("td", row) for row in rows) + "</table>"
