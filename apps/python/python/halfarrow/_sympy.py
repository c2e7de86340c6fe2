"""Expressions of the model language as expressions of SymPy."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Collection, Sequence
from typing import Any

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter

from ._errors import UsageError

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_]\w*(?:\[[^\]]*\])?(?:\.[A-Za-z_]\w*(?:\[[^\]]*\])?)*'*)"
    r"|(?P<sign><=|>=|==|!=|[-+*/^(),<>=]))"
)

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": sympy.Abs,
    "floor": sympy.floor,
    "log": sympy.log,
    "log10": lambda x: sympy.log(x, 10),
    "max": sympy.Max,
    "min": sympy.Min,
    "mod": sympy.Mod,
    "sign": sympy.sign,
    **{
        name: getattr(sympy, name)
        for name in ["sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "sqrt"]
    },
}

_RELATIONS = {"<": sympy.Lt, "<=": sympy.Le, ">": sympy.Gt, ">=": sympy.Ge, "==": sympy.Eq, "!=": sympy.Ne}

_T = sympy.Symbol("t")


def equations(lines: Sequence[str], constants: Collection[str]) -> list[sympy.Eq]:
    """Lines ``left = right``. What is no constant is a function of time."""
    return [_Reader(line, constants).equation() for line in lines]


def mathml(written: Sequence[sympy.Eq]) -> str:
    """Equations as a table of presentation MathML: variables as `f` with the name of their element below, rates with dots."""
    printer = MathMLPresentationPrinter()
    rows = []
    for equation in written:
        marks: dict[str, tuple[str, int]] = {}

        def mark(text: str, order: int, marks: dict[str, tuple[str, int]] = marks) -> sympy.Symbol:
            key = f"mark{len(marks)}end"
            marks[key] = (text, order)
            return sympy.Symbol(key)

        # Rates before what they are rates of.
        rates = sorted(equation.atoms(sympy.Derivative), key=str)
        left = {rate: mark(rate.expr.func.__name__, int(rate.derivative_count)) for rate in rates}
        plain = equation.xreplace(left)
        functions = sorted(plain.atoms(sympy.core.function.AppliedUndef), key=str)
        names = sorted((s for s in plain.free_symbols if s not in left.values() and s != _T), key=str)
        plain = plain.xreplace(
            {**{f: mark(f.func.__name__, 0) for f in functions}, **{s: mark(s.name, 0) for s in names}}
        )
        row = "".join(
            f"<mtd>{printer.doprint(side)}</mtd>" + "<mtd><mo>=</mo></mtd>" * (side is plain.lhs) for side in plain.args
        )
        for key, (text, order) in marks.items():
            row = row.replace(f"<mi>{key}</mi>", _identifier(text, order))
        # Entities that HTML knows, and XML does not.
        rows.append(f"<mtr>{html.unescape(row.replace('&lt;', '&amp;lt;').replace('&gt;', '&amp;gt;'))}</mtr>")
    return f'<math xmlns="http://www.w3.org/1998/Math/MathML" display="block"><mtable>{"".join(rows)}</mtable></math>'


def _identifier(text: str, order: int) -> str:
    """A name: what stands behind its last point, with what stands before it below; a dot above for each rate."""
    element, _, own = text.rpartition(".")
    found = f"<mi>{own}</mi>"
    if order:
        found = f"<mover>{found}<mo>{'˙¨'[order - 1] if order < 3 else '(' + str(order) + ')'}</mo></mover>"
    return f'<msub>{found}<mi mathvariant="normal">{element}</mi></msub>' if element else found


class _Reader:
    """Reads a line from the left to the right."""

    def __init__(self, line: str, constants: Collection[str]) -> None:
        self.line, self.constants = line, constants
        self.tokens: list[tuple[str, str]] = []
        at = 0
        while at < len(line.rstrip()):
            found = _TOKEN.match(line, at)
            if found is None:
                raise self._refused(line[at:].strip())
            self.tokens.append((str(found.lastgroup), found[str(found.lastgroup)]))
            at = found.end()
        self.tokens.append(("end", ""))
        self.at = 0

    def _refused(self, what: str) -> UsageError:
        return UsageError(f"`{what}` in `{self.line}` has no word in SymPy; `text` and `latex` have the equation")

    def _next(self) -> tuple[str, str]:
        self.at += 1
        return self.tokens[self.at - 1]

    def _takes(self, *texts: str) -> str | None:
        kind, text = self.tokens[self.at]
        if kind in ("sign", "name") and text in texts:
            self.at += 1
            return text
        return None

    def _expect(self, text: str) -> None:
        if self._takes(text) is None:
            raise self._refused(self.tokens[self.at][1] or "the end")

    def equation(self) -> sympy.Eq:
        left = self._either()
        self._expect("=")
        right = self._either()
        if self.tokens[self.at][0] != "end":
            raise self._refused(self.tokens[self.at][1])
        return sympy.Eq(left, right, evaluate=False)

    def _either(self) -> Any:
        if self._takes("if"):
            condition = self._either()
            self._expect("then")
            yes = self._either()
            self._expect("else")
            return sympy.Piecewise((yes, condition), (self._either(), True))
        value = self._both()
        while self._takes("or"):
            value = sympy.Or(value, self._both())
        return value

    def _both(self) -> Any:
        value = self._relation()
        while self._takes("and"):
            value = sympy.And(value, self._relation())
        return value

    def _relation(self) -> Any:
        if self._takes("not"):
            return sympy.Not(self._relation())
        value = self._sum()
        relation = self._takes(*_RELATIONS)
        return value if relation is None else _RELATIONS[relation](value, self._sum())

    def _sum(self) -> Any:
        value = self._product()
        while sign := self._takes("+", "-"):
            other = self._product()
            value = value + other if sign == "+" else value - other
        return value

    def _product(self) -> Any:
        value = self._signed()
        while sign := self._takes("*", "/"):
            other = self._signed()
            value = value * other if sign == "*" else value / other
        return value

    def _signed(self) -> Any:
        if self._takes("-"):
            return -self._signed()
        return self._power()

    def _power(self) -> Any:
        base = self._atom()
        return base ** self._signed() if self._takes("^") else base

    def _atom(self) -> Any:
        kind, text = self._next()
        if kind == "number":
            return sympy.Rational(text)
        if kind == "name" and self.tokens[self.at][1] == "(":
            if text not in _FUNCTIONS:
                raise self._refused(text)
            self._expect("(")
            arguments = [self._either()]
            while self._takes(","):
                arguments.append(self._either())
            self._expect(")")
            return _FUNCTIONS[text](*arguments)
        if kind == "name":
            return self._named(text)
        if text == "(":
            value = self._either()
            self._expect(")")
            return value
        raise self._refused(text or "the end")

    def _named(self, text: str) -> Any:
        name = text.rstrip("'")
        order = len(text) - len(name)
        if name == "t" and not order:
            return _T
        if name == "pi" and not order:
            return sympy.pi
        if name in self.constants:
            return sympy.Integer(0) if order else sympy.Symbol(name)
        value = sympy.Function(name)(_T)
        return sympy.Derivative(value, (_T, order)) if order else value
