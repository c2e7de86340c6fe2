"""Texts of the library, which speak of options of the command line, in the words of this package."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

# What an option is called here, where it is not simply an argument of the same name.
_CALLED = {
    "--record all": 'record="all"',
    "--source-only": "binary=False",
    "--timings": "`tolerances` of the result",
    "--vary": "values for parameters",
    "--samples": "`samples`",
    "--solver": "method",
    "--input": "inputs",
}


def in_python(text: str) -> str:
    """The text with options of the command line as arguments of functions; lines of the model in it stay as they are.

    >>> in_python("give it with --step, as in `--step 1e-3`")
    'give it with step, as in `step=1e-3`'
    >>> print(in_python("4 | param a = b--c\\n  = hint: leave out --form"))
    4 | param a = b--c
      = hint: leave out form
    """
    if "--" not in text:
        return text
    lines = text.split("\n")
    return "\n".join(line if re.match(r"\s*\d+ \|", line) else _line(line) for line in lines)


def _line(text: str) -> str:
    text = re.sub(r"`--allow ([^`]*)`, in a program `Disk::allow`", r'`allow=["\1"]`', text)
    text = re.sub(r",? as by `--set`", ", as by `with_parameters`", text)
    for option, called in _CALLED.items():
        text = re.sub(rf"{re.escape(option)}(?![\w-])", called, text)
    text = re.sub(r"--([a-z]\w*(?:-\w+)*) (\d[\w.+-]*)", lambda m: f"{_name(m[1])}={m[2]}", text)
    text = re.sub(r"--([a-z]\w*(?:-\w+)*) ([a-z]\w*)(?=`)", lambda m: f'{_name(m[1])}="{m[2]}"', text)
    return re.sub(r"--([a-z]\w*(?:-\w+)*)", lambda m: _name(m[1]), text)


def _name(option: str) -> str:
    return option.replace("-", "_")


def hint(name: str, known: Iterable[str]) -> str:
    """What may have been meant, or what there is.

    >>> hint("stepp", ["step", "rtol"])
    '; did you mean `step`?'
    >>> hint("x", ["step", "rtol"])
    '; there are step, rtol'
    """
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1)
    if near:
        return f"; did you mean `{near[0]}`?"
    if not known:
        return "; there is none"
    return f"; there are {', '.join(known[:12])}{', ...' if len(known) > 12 else ''}"
