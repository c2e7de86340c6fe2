"""Inputs over time, as users give them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol, TypeAlias, Union

import numpy as np
import numpy.typing as npt

from ._errors import FileError, UsageError

InputLike: TypeAlias = Union[
    float, str, "os.PathLike[str]", tuple[npt.ArrayLike, npt.ArrayLike], Callable[[float], float], "Series"
]
"""An input over time, in the unit of its declaration: a number; ``(times, values)``; a function of time; a series of
pandas or a one-dimensional array of xarray over times; the path of a CSV file."""


class Series(Protocol):
    """A series of pandas or an array of xarray over times."""

    def to_numpy(self) -> npt.NDArray[Any]: ...


Given: TypeAlias = float | tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]] | tuple[str, str]


def given(name: str, value: Any, to: float, sample: float) -> Given:
    """An input as the compiled part takes it; a function of time is called every ``sample`` s up to ``to``."""
    if isinstance(value, (str, os.PathLike)):
        return ("file", os.fspath(value))
    if callable(value):
        parts = max(1, round(to / sample)) if sample > 0 else 1
        times = np.linspace(0.0, to, parts + 1)
        return series(name, times, [value(t) for t in times.tolist()])
    if isinstance(value, tuple) and len(value) == 2:
        return series(name, *value)
    if hasattr(value, "index") and hasattr(value, "to_numpy"):  # a series of pandas
        return series(name, value.index.to_numpy(), value.to_numpy())
    if hasattr(value, "dims") and hasattr(value, "coords") and len(value.dims) == 1:  # an array of xarray
        return series(name, value.coords[value.dims[0]].to_numpy(), value.to_numpy())
    try:
        return float(value)
    except (TypeError, ValueError):
        raise UsageError(
            f"`{name}` is given a {type(value).__name__}: give a number, (times, values), a function of time, a series "
            "over times, or the path of a CSV file"
        ) from None


def series(name: str, times: npt.ArrayLike, values: npt.ArrayLike) -> Given:
    """Values at times in s."""
    try:
        t, v = numbers(times), numbers(values)
    except (TypeError, ValueError) as why:
        raise UsageError(f"`{name}` is given what is no numbers: {why}") from None
    if t.ndim != 1 or t.shape != v.shape:
        raise UsageError(
            f"`{name}` has times of the shape {t.shape} and values of the shape {v.shape}: "
            "give as many values as times, in one dimension"
        )
    return t, v


def numbers(values: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """An array as the compiled part takes it. What comes out of a message of another process may lie at any address."""
    return np.require(values, np.float64, ["C_CONTIGUOUS", "ALIGNED"])


def number(name: str, value: Any, unit: str = "") -> float:
    """One number, and nothing that only can be made one: ``"1 s"``, ``True``."""
    if isinstance(value, (bool, np.bool_)) or not hasattr(value, "__float__") or np.ndim(value):
        raise UsageError(f"{name} is {value!r}: give a number{unit}")
    return float(value)


def all_given(values: Mapping[str, InputLike], to: float, sample: float) -> list[tuple[str, Given]]:
    """All of them, in order."""
    return [(name, given(name, value, to, sample)) for name, value in values.items()]


def on_its_own(value: Given) -> Given:
    """The same without files, for a computer that does not have them."""
    if isinstance(value, tuple) and isinstance(value[0], str) and value[0] == "file":
        path = Path(str(value[1]))
        try:
            return ("csv", path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as why:
            raise FileError(f"{path} cannot be read: {why}") from None
    return value


def as_sent(value: Given) -> Given:
    """The same as it came out of a message of another process."""
    if isinstance(value, tuple) and isinstance(value[0], np.ndarray):
        return numbers(value[0]), numbers(value[1])
    return value
