"""A run in the hands of the caller."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import TYPE_CHECKING

from . import _halfarrow
from ._errors import UsageError, unknown
from ._inputs import number
from ._tables import record
from .result import Drift

if TYPE_CHECKING:
    from .model import Model

Snapshot = _halfarrow.Snapshot


class Stepper:
    """A run that goes on as far as it is told, by steps of fixed length, and can be read and set in between. Inputs and what
    is read are in the units of their declarations, parameters in SI units, times in s.

    >>> import halfarrow as ha
    >>> text = "model Cart\\ninput push : N = 0\\nSe:hand(push) -> 1:v -> I:cart(2 kg)\\nv -> R:drag(1 N.s/m)\\n"
    >>> with ha.model(text).stepper(step=1e-3) as cart:
    ...     cart["push"] = 3.0
    ...     cart.step(1000)
    ...     there = cart.save()
    ...     cart.step(1000)
    ...     later = cart["cart.f"]
    ...     cart.restore(there)
    ...     cart.step(1000)
    ...     cart.t, cart["cart.f"] == later
    (2.0, True)
    """

    def __init__(self, model: Model, core: _halfarrow.Stepper, names: Mapping[str, bool]) -> None:
        self.model = model
        """The model that runs."""
        self._core: _halfarrow.Stepper | None = core
        # What can be set: whether it is an input, else it is a parameter.
        self._settable = names

    def _run(self) -> _halfarrow.Stepper:
        if self._core is None:
            raise UsageError("this stepper was closed: make another one of the model")
        return self._core

    @property
    def t(self) -> float:
        """How far the run has come, in s."""
        return self._run().time

    @property
    def dt(self) -> float:
        """The length of a step, in s."""
        return self._run().step_length

    def step(self, steps: int = 1) -> None:
        """Goes on by so many steps. Ctrl-C stops it at the end of a step.

        Raises:
            RunError: the run stops; it stands at the last state that it reached.
            UsageError: that is no number of steps.
        """
        core = self._core
        try:
            (core or self._run()).advance(steps)
        except (OverflowError, TypeError):
            raise UsageError(f"steps is {steps!r}: give a whole number of them, from 0 on") from None

    def __getitem__(self, name: str) -> float:
        """The present value of a variable in its declared unit, or of a parameter in SI units.

        Raises:
            UnknownNameError: there is nothing of this name.
        """
        core = self._run()
        if name in self._settable and not self._settable[name]:
            value = core.parameter(name)
            if value is not None:
                return value
        return core.read(name)

    def __setitem__(self, name: str, value: float) -> None:
        """Sets an input, which has this value from now on, or a parameter: an event at the present time.

        Raises:
            UnknownNameError: there is no such input or parameter.
            UsageError: the value is not finite, or the equations do not hold with it; then nothing has changed.
        """
        is_input = self._settable.get(name)
        if is_input is None:
            raise unknown("input or parameter", name, self._settable)
        value = number(f"`{name}`", value, ", in its declared unit" if is_input else ", in SI units")
        if is_input:
            self._run().set_input(name, value)
        else:
            self._run().set_parameter(name, value)

    @property
    def drift(self) -> list[Drift]:
        """How far positions have drifted by now from relations that only their speeds keep, since the start or the last
        parameter that was set: ``value`` of those in closed form, which alone are measured here.
        """
        return [record(Drift, told) for told in self._run().drift()]

    def save(self) -> Snapshot:
        """All that the run needs to go on from here."""
        return self._run().save()

    def restore(self, snapshot: Snapshot) -> None:
        """Goes on from there, with the same bits. The snapshot is of a stepper of the same model, method and step.

        Raises:
            UsageError: it is of another model, method or step.
        """
        self._run().restore(snapshot)

    def close(self) -> None:
        """Gives its memory back; it cannot be stepped any more."""
        self._core = None

    def __enter__(self) -> Stepper:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        if self._core is None:
            return f"<Stepper of {self.model.name}, closed>"
        return f"<Stepper of {self.model.name} at t = {self.t:g} s>"
