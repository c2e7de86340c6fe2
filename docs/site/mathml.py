"""Formulas as MathML, made when the site is built: no script, no fonts from elsewhere."""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert


def block(source: str, *_: object, **__: object) -> str:
    """A fenced block `math`: one formula a line."""
    lines = [line for line in source.strip().splitlines() if line.strip()]
    return f'<div class="math">{"".join(_one(line, "block") for line in lines)}</div>'


def inline(source: str, *_: object, **__: object) -> str:
    """`#!math x` in the text."""
    return _one(source, "inline")


def aligned(latex: str) -> str:
    """What `equations --format latex` prints; text between the environments stays."""
    parts = re.split(r"\\begin\{align\*?\}\n(.*?)\\end\{align\*?\}\n?", latex, flags=re.S)
    shown = ""
    for i, part in enumerate(parts):
        if i % 2:
            shown += block(part.replace("&", "").replace("\\\\\n", "\n"))
        elif part.strip():
            shown += f"<p>{html.escape(part.strip())}</p>"
    return shown


def _one(latex: str, display: str) -> str:
    latex = latex.strip().removesuffix("\\\\")
    # TeX spaces names of functions by itself.
    names = "sin|cos|tan|arcsin|arccos|arctan|sinh|cosh|tanh|exp|log|ln|max|min"
    latex = re.sub(rf"(?<=\S)\s*\\({names})\b", r"\,\\\1 ", latex)
    latex = re.sub(rf"\\({names})\b\s*(?!\s|\(|\^|_|\\left)", r"\\\1\,", latex)
    return convert(latex, display=display).replace("\n", "")
