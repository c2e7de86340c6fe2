"""How far a computation has come, told to bars like those of tqdm."""

from __future__ import annotations

from types import TracebackType
from typing import Any

from ._errors import UsageError


class Bar:
    """A bar that is told how far a computation has come, not how much further.

    ``progress``: None or False for none; True for a bar of tqdm; a class or function that makes a bar when it is called
    with ``total``, ``desc``, ``unit``; or a bar that is there. A bar has ``update(n)`` and ``close()``.
    """

    def __init__(self, progress: Any, total: float, desc: str, unit: str) -> None:
        self._bar: Any = None
        self._reached = 0.0
        self._own = True
        if progress is None or progress is False:
            return
        if progress is True:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                raise UsageError("progress=True needs the package tqdm: `pip install tqdm`") from None
            self._bar = tqdm(total=total, desc=desc, unit=unit, unit_scale=True)
        elif hasattr(progress, "update") and not isinstance(progress, type):
            self._bar, self._own = progress, False
        elif callable(progress):
            self._bar = progress(total=total, desc=desc, unit=unit)
        else:
            raise UsageError(f"progress is {progress!r}: it has to be True, or a bar like tqdm's, or what makes one")

    def __bool__(self) -> bool:
        return self._bar is not None

    def reach(self, value: float) -> None:
        """It has come to this."""
        if self._bar is not None and value > self._reached:
            self._bar.update(value - self._reached)
            self._reached = value

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None and self._own:
            self._bar.close()
