"""The components that come with the program, and the layout of model text."""

from __future__ import annotations

import dataclasses
from typing import Any

from . import _halfarrow
from ._tables import record


@dataclasses.dataclass(frozen=True)
class Component:
    """A component of a library."""

    name: str
    """Used as a kind: ``Resistor``."""
    doc: str
    law: str
    """The law that it obeys, and its source."""
    ports: list[dict[str, Any]]
    parameters: list[dict[str, Any]]
    inputs: list[dict[str, Any]]
    outputs: list[dict[str, Any]]
    text: str


@dataclasses.dataclass(frozen=True)
class Library:
    """A file of components: ``import std.electrical``."""

    name: str
    about: str
    components: list[Component]


def library() -> list[Library]:
    """The components that come with the program.

    >>> [l.name for l in library()][:2]
    ['std.electrical', 'std.mechanical']
    """
    told = _halfarrow.library()
    return [record(Library, {**l, "components": [record(Component, c) for c in l["components"]]}) for l in told]


def format(text: str, *, name: str = "model.bond") -> str:
    """Model text in its canonical layout.

    Raises:
        ModelError: the text has errors.

    >>> format("model  M\\nSe:a( 1 )->I:b(2)\\n")
    'model M\\nSe:a(1) -> I:b(2)\\n'
    """
    return _halfarrow.format_text(name, text)
