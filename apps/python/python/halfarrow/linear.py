"""A model near a point of its motion."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _halfarrow
from ._errors import UsageError, choice, needed, unknown
from ._tables import as_html, as_text, record
from .picture import Picture

if TYPE_CHECKING:
    import control
    import matplotlib.axes

Array = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclasses.dataclass(frozen=True)
class Mode:
    """A real pole, or a pair of complex ones."""

    pole: complex
    """In 1/s; the imaginary part is at least 0."""
    natural_frequency: float
    """In rad/s."""
    damping: float
    """Part of critical damping; negative if it grows."""
    time_constant: float | None
    """Time in which it falls to 1/e, in s; None if it does not fall."""


@dataclasses.dataclass(frozen=True)
class Response:
    """The response of an output to an input."""

    input: str
    output: str
    frequencies: Array
    """Angular frequencies in rad/s."""
    values: ComplexArray
    """The transfer function there."""


class Linearization:
    """A model near a point: ``x' = f + A dx + B du``, ``y = g + C dx + D du``, in SI units, with exact derivatives.

    >>> import halfarrow as ha
    >>> text = "model Cart\\ninput push : N = 0\\nSe:hand(push) -> 1:v -> I:cart(2 kg)\\nv -> R:drag(1 N.s/m)\\n"
    >>> lin = ha.model(text).linearize(outputs=["cart.f"])
    >>> lin.A, lin.B
    (array([[-0.5]]), array([[0.5]]))
    >>> lin.poles, lin.stable
    (array([-0.5+0.j]), True)
    >>> complex(lin(0)[0, 0])
    (1+0j)
    """

    def __init__(self, core: _halfarrow.Linearized) -> None:
        self._core: _halfarrow.Linearized | None = core
        told = core.report()
        self.report: dict[str, Any] = told
        """All of it as plain data, as ``docs/json.md`` describes it."""
        self.model: str = told["model"]
        self.at: str = told["at"]
        """``start``, ``time`` or ``equilibrium``."""
        self.t: float = told["t"]
        """The time, in s."""
        self.states: list[str] = [state["name"] for state in told["states"]]
        self.inputs: list[str] = [terminal["name"] for terminal in told["inputs"]]
        self.outputs: list[str] = [terminal["name"] for terminal in told["outputs"]]
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        self.x: Array = np.array([state["value"] for state in told["states"]], dtype=np.float64)
        """Values of the states at the point, shape ``(n,)``."""
        self.rates: Array = np.array([state["rate"] for state in told["states"]], dtype=np.float64)
        """Their rates there, shape ``(n,)``; zero at an equilibrium."""
        self.A: Array = np.array(told["a"], dtype=np.float64).reshape(n, n)
        """Derivatives of rates by states, shape ``(n, n)``."""
        self.B: Array = np.array(told["b"], dtype=np.float64).reshape(n, m)
        """Derivatives of rates by inputs, shape ``(n, m)``."""
        self.C: Array = np.array(told["c"], dtype=np.float64).reshape(p, n)
        """Derivatives of outputs by states, shape ``(p, n)``."""
        self.D: Array = np.array(told["d"], dtype=np.float64).reshape(p, m)
        """Derivatives of outputs by inputs, shape ``(p, m)``."""
        self.poles: ComplexArray = _complex(told["poles"])
        """Eigenvalues of ``A``, in 1/s."""
        self.zeros: ComplexArray | None = None if told["zeros"] is None else _complex(told["zeros"])
        """Invariant zeros, in 1/s; None if they do not come out."""
        self.modes: list[Mode] = [record(Mode, {**mode, "pole": complex(*mode["pole"])}) for mode in told["modes"]]
        """What the poles mean; a pair counts once."""
        self.stability: str = told["stability"]
        """``asymptotic``, ``marginal`` or ``unstable``."""
        self.stable: bool = told["stable"]
        """Whether all poles are left of the imaginary axis."""
        self.notes: list[str] = told["notes"]
        """What the matrices are true of."""

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_core": None}

    def __call__(self, s: complex) -> ComplexArray:
        """The transfer matrix ``C (s - A)^-1 B + D`` at ``s`` in 1/s, shape ``(p, m)``; not a number at a pole."""
        try:
            inner = np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.B.astype(np.complex128))
            return np.asarray(self.C @ inner + self.D, dtype=np.complex128)
        except np.linalg.LinAlgError:
            return np.full(self.D.shape, np.nan, dtype=complex)

    def responses(self) -> list[Response]:
        """The responses of all outputs to all inputs, from below the slowest to above the fastest pole or zero."""
        if self._core is None:
            raise _gone()
        return [Response(*response) for response in self._core.responses()]

    def picture(self, kind: str = "bode") -> Picture:
        """The Bode or Nyquist plot as SVG, with margins; it needs nothing else installed.

        Args:
            kind: ``bode`` or ``nyquist``.
        """
        choice("kind", kind, ["bode", "nyquist"])
        if self._core is None:
            raise _gone()
        return Picture(self._core.bode() if kind == "bode" else self._core.nyquist())

    def bode(self, input: str | None = None, output: str | None = None) -> list[matplotlib.axes.Axes]:
        """Draws magnitude in dB and phase in degrees over the frequency in Hz with Matplotlib
        (``pip install halfarrow[plot]``).

        Args:
            input: The input; nothing: all.
            output: The output; nothing: all.

        Returns:
            The axes of magnitude and phase.

        Raises:
            UnknownNameError: there is no such input or output.
        """
        for name, known, what in [(input, self.inputs, "input"), (output, self.outputs, "output")]:
            if name is not None and name not in known:
                raise unknown(what, name, known)
        try:
            import matplotlib.pyplot as plt
        except ImportError:
            raise needed("matplotlib", "plot", "bode") from None
        _, axes = plt.subplots(2, 1, sharex=True)
        above, below = axes
        for response in self.responses():
            if input in (None, response.input) and output in (None, response.output):
                hertz = response.frequencies / (2 * np.pi)
                with np.errstate(divide="ignore"):
                    above.semilogx(
                        hertz, 20 * np.log10(np.abs(response.values)), label=f"{response.output} / {response.input}"
                    )
                below.semilogx(hertz, np.degrees(np.unwrap(np.angle(response.values))))
        above.set_ylabel("magnitude in dB")
        below.set_ylabel("phase in degrees")
        below.set_xlabel("frequency in Hz")
        above.set_title(self.model)
        above.legend()
        return [above, below]

    def to_control(self) -> control.StateSpace:
        """The same as a ``StateSpace`` of the package control (``pip install halfarrow[control]``). It takes no dots in
        names: they become underscores."""
        try:
            import control
        except ImportError:
            raise needed("control", "control", "to_control") from None
        names = {
            kind: [name.replace(".", "_") for name in getattr(self, kind)] for kind in ("states", "inputs", "outputs")
        }
        return control.ss(self.A, self.B, self.C, self.D, name=self.model, **names)

    _header = ("pole in 1/s", "natural frequency in rad/s", "damping", "time constant in s")

    def _rows(self) -> list[tuple[Any, ...]]:
        return [(_pair(m.pole), m.natural_frequency, m.damping, m.time_constant) for m in self.modes]

    def __repr__(self) -> str:
        where = f"at t = {self.t:g} s" if self.at == "time" else f"at the {self.at}"
        parts = [
            f"{self.model} {where}: {len(self.states)} states, {self.stability}",
            as_text(self._header, self._rows()),
        ]
        return "\n".join([*parts, *self.notes])

    def _repr_html_(self) -> str:
        return as_html(self._header, self._rows()) + (self.picture().svg if self._core and self.inputs else "")


def _complex(pairs: list[list[float]]) -> ComplexArray:
    return np.array([complex(*pair) for pair in pairs], dtype=complex)


def _pair(pole: complex) -> str:
    return f"{pole.real:.6g}" if pole.imag == 0 else f"{pole.real:.6g} ± {pole.imag:.6g} i"


def _gone() -> UsageError:
    return UsageError("a linearization that was pickled has its matrices alone: linearize the model again")
