"""What can go wrong, and what is to be known."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

from ._words import hint, in_python


@dataclasses.dataclass(frozen=True)
class Diagnostic:
    """Something wrong or odd in a model, with its place in the text. Lines and columns count from 1."""

    severity: str
    """``error`` or ``warning``."""
    code: str
    """Such as ``C002``: see ``docs/diagnostics.md``."""
    title: str
    """What it is."""
    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    text: str
    """What stands at the place."""
    notes: tuple[str, ...]
    hint: str | None
    """What to do about it."""
    rendered: str = dataclasses.field(repr=False)
    """All of it, below the lines of the model."""

    @classmethod
    def _of(cls, told: Mapping[str, Any]) -> Diagnostic:
        place = told["primary"]
        names = ("file", "line", "column", "end_line", "end_column", "text")
        return cls(
            severity=told["severity"],
            code=told["code"],
            title=in_python(told["title"]),
            notes=tuple(map(in_python, told["notes"])),
            hint=None if told["hint"] is None else in_python(told["hint"]),
            rendered=in_python(told["rendered"]),
            **{name: place[name] for name in names},
        )

    def __str__(self) -> str:
        return self.rendered


class Error(Exception):
    """Why there is no result. All errors of this package are of this class."""

    def __init__(self, text: str = "") -> None:
        super().__init__(in_python(text))

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class ModelError(Error, ValueError):
    """A model with errors: each with its place in the text, the reason and what to do about it."""

    def __init__(self, text: str, diagnostics: Iterable[Any] = ()) -> None:
        super().__init__(text)
        self.diagnostics = [d if isinstance(d, Diagnostic) else Diagnostic._of(d) for d in diagnostics]
        """The errors, and the warnings before them."""

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.diagnostics)


class UsageError(Error, ValueError):
    """Something asked that cannot be."""


class UnknownNameError(UsageError, KeyError):
    """A name that the model, a result or a function does not have, with the nearest one that it has."""


class FileError(Error, OSError):
    """A file that cannot be read or written."""


class RunError(Error, RuntimeError):
    """A run that stopped before its end, or whose result does not satisfy the model."""

    result: Any = None
    """What was computed so far, of the kind that the run would have given; None if nothing was."""

    def __init__(self, text: str, result: Any = None) -> None:
        super().__init__(text)
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.result)


class Interrupted(KeyboardInterrupt):
    """A run that was stopped by Ctrl-C."""

    def __init__(self, text: str, result: Any = None) -> None:
        super().__init__(text)
        self.result = result
        """What was computed so far, of the kind that the run would have given."""

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.result)


class ModelWarning(UserWarning):
    """Something odd in a model or in a run of it."""

    def __init__(self, text: str, diagnostic: Diagnostic | None = None) -> None:
        super().__init__(in_python(text))
        self.diagnostic = diagnostic
        """Where in the text of the model it is, if it is there."""


class AuditWarning(ModelWarning):
    """What the audit of a run found missed: a law, or the balance of power or energy."""


def unknown(what: str, name: str, known: Iterable[str]) -> UnknownNameError:
    """There is nothing of this name."""
    return UnknownNameError(f"there is no {what} `{name}`{hint(name, known)}")


def choice(option: str, value: str, known: Iterable[str]) -> str:
    """A word out of some; another one is refused with the nearest."""
    if value in known:
        return value
    raise UsageError(f"{option} is {value!r}{hint(str(value), known)}")


def needed(package: str, extra: str, what: str) -> UsageError:
    """A package that is not there."""
    return UsageError(f"{what} needs the package {package}: `pip install halfarrow[{extra}]`")
