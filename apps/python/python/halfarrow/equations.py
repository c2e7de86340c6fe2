"""The equations of a model."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ._errors import needed
from ._tables import record

if TYPE_CHECKING:
    import sympy

    from ._casadi import Casadi
    from .model import Model


@dataclasses.dataclass(frozen=True)
class State:
    """A state."""

    name: str
    initial: float | None
    """Its value at the start, in SI units; None if there is no start."""
    kind: str
    """``storage``, or ``signal`` for an integrated signal."""
    unit: str | None


@dataclasses.dataclass(frozen=True)
class Algebraic:
    """An unknown without a rate."""

    name: str
    cause: str
    """``break``, ``law`` or ``multiplier``."""
    element: str | None
    index: int
    unit: str | None


@dataclasses.dataclass(frozen=True)
class Equations:
    """The equations of a model in a form. Notebooks show them typeset.

    >>> import halfarrow as ha
    >>> text = "model Cart\\nparam m = 2 kg, b = 1 N.s/m\\nSe:push(3 N) -> 1:v -> I:cart(m)\\nv -> R:drag(b)\\n"
    >>> equations = ha.model(text).equations()
    >>> equations.equations
    ["m*cart.f' = 3 - b*cart.f"]
    >>> print(equations.text)
    m f_cart' = 3 - b f_cart
    """

    model: str
    form: str
    states: list[State]
    algebraic: list[Algebraic]
    unknowns: list[str]
    """Names of all unknowns: the states, then what stays implicit."""
    equations: list[str]
    """In the model language: one for each state, then what stays implicit."""
    definitions: list[str]
    """Names in ``equations`` for parts of them that would make them too long, each with its value."""
    lines: list[str]
    """The equations in Unicode, a line each."""
    latex_lines: list[str]
    """The same in LaTeX."""
    legend: list[str]
    """What the names in ``lines`` stand for."""
    latex_legend: list[str]
    meanings: list[str]
    """What those states are that are no variable of an element."""
    conserved: list[str]
    """Quantities that keep their start value."""
    events: list[str]
    """What happens at events; ``x+`` is the value after the event."""
    events_text: list[str]
    events_latex: list[str]
    certificate: list[str]
    """Form ``inverted``: which storage was inverted for which path, and why no other."""
    index: int
    """Differentiation index; 0 for explicit ordinary differential equations."""
    counts: dict[str, int]
    """Numbers of ``differential`` and ``algebraic`` equations."""
    dof: int
    """Number of independent storages."""
    of: Model = dataclasses.field(repr=False, compare=False)
    """The model that they are of."""

    @classmethod
    def _of(cls, told: Mapping[str, Any], model: Model) -> Equations:
        states = [record(State, state) for state in told["states"]]
        algebraic = [record(Algebraic, unknown) for unknown in told["algebraic"]]
        named = {
            "states": states,
            "algebraic": algebraic,
            "lines": told["text"],
            "latex_lines": told["latex"],
            "of": model,
        }
        return record(cls, {**told, **named})

    @property
    def text(self) -> str:
        """All of it in Unicode, for people."""
        legend = ["where", *(f"    {line}" for line in self.legend)] if self.legend else []
        return "\n\n".join("\n".join(part) for part in (self.lines, legend, self.events_text) if part)

    @property
    def latex(self) -> str:
        """All of it in LaTeX, as environments of ``amsmath``."""
        text = _aligned("align", self.latex_lines)
        if self.latex_legend:
            text += "\nwhere\n" + _aligned("align*", self.latex_legend)
        if self.events_latex:
            text += "\n" + _aligned("align*", ["& " + line for line in self.events_latex])
        return text

    def sympy(self) -> list[sympy.Eq]:
        """The equations, then the definitions, as equations of SymPy, with exact numbers. Variables are functions of ``t``
        by their names; parameters and what is conserved are symbols.

        >>> import halfarrow as ha
        >>> cart = ha.model("model Cart\\nparam m = 2 kg\\nSe:push(3 N) -> I:cart(m)\\n")
        >>> cart.equations().sympy()
        [Eq(m*Derivative(cart.f(t), t), 3)]

        Raises:
            UsageError: SymPy is not there, or an equation holds something that it has no word for, such as a table.
        """
        try:
            from . import _sympy
        except ImportError:
            raise needed("sympy", "sympy", "sympy") from None
        constants = {*self.of.parameters, *(line.split(" = ", 1)[0] for line in self.conserved)}
        return _sympy.equations([*self.equations, *self.definitions], constants)

    @property
    def mathml(self) -> str:
        """The equations, then the definitions, in presentation MathML, for pages without LaTeX; by SymPy.

        >>> import halfarrow as ha
        >>> ha.model("model Cart\\nparam m = 2 kg\\nSe:push(3 N) -> I:cart(m)\\n").equations().mathml.count("<mtr>")
        1

        Raises:
            UsageError: as of ``sympy``.
        """
        written = self.sympy()
        from . import _sympy

        return _sympy.mathml(written)

    def casadi(self) -> Casadi:
        """The equations for CasADi: ``dae`` is what ``casadi.integrator`` takes, and optimal control begins with.

        Raises:
            UsageError: CasADi or SymPy is not there, the model has events, or an equation holds something that CasADi has no
                word for.
        """
        try:
            from . import _casadi
        except ImportError:
            raise needed("casadi", "casadi", "casadi") from None
        return _casadi.casadi_of(self)

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<Equations of {self.model}, form {self.form}>\n{self.text}"

    def _repr_latex_(self) -> str:
        rows = " \\\\\n".join(_at_equal(line) for line in [*self.latex_lines, *self.latex_legend])
        return f"$$\\begin{{aligned}}\n{rows}\n\\end{{aligned}}$$"


def _aligned(environment: str, lines: list[str]) -> str:
    rows = " \\\\\n".join("  " + _at_equal(line) for line in lines)
    return f"\\begin{{{environment}}}\n{rows}\n\\end{{{environment}}}"


def _at_equal(line: str) -> str:
    return line if line.startswith("&") else line.replace(" = ", " &= ", 1)
