"""Pictures: drawings of bond graphs, plots."""

from __future__ import annotations

import os
from pathlib import Path

from . import _halfarrow
from ._errors import FileError, UsageError


class Picture:
    """A picture as SVG. Notebooks show it.

    >>> import halfarrow as ha
    >>> drawing = ha.model("model Drop\\nSe:weight(9.81 N) -> I:mass(1 kg)\\n").draw()
    >>> drawing.svg[:4], drawing.png()[1:4]
    ('<svg', b'PNG')
    """

    def __init__(self, svg: str) -> None:
        self.svg = svg
        """The SVG document."""

    def png(self) -> bytes:
        """The same as PNG.

        Raises:
            UsageError: it is too large for one.
        """
        return _halfarrow.png(self.svg)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes it to a file whose name ends in ``.svg`` or ``.png``.

        Raises:
            UsageError: the name ends in something else.
            FileError: the file cannot be written.
        """
        path = Path(path)
        kinds = {".svg": lambda: self.svg.encode(), ".png": self.png}
        if path.suffix.lower() not in kinds:
            raise UsageError(f"the name {path} does not say what to write: let it end in .svg or .png")
        content = kinds[path.suffix.lower()]()
        try:
            path.write_bytes(content)
        except OSError as why:
            raise FileError(f"{path} cannot be written: {why}") from None

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"<Picture of {len(self.svg)} characters of SVG>"
