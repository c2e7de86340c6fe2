"""Colours of the model language."""

from __future__ import annotations

from pygments.lexer import RegexLexer, words
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text

__all__ = ["BondLexer"]

DECLARATIONS = """model import param const input output let state discrete component port in out for if else when every reset
constraint prefer causality stroke guess domain shape from at as on then and or not""".split()


class BondLexer(RegexLexer):
    """Bond graphs as text."""

    name = "Bond"
    aliases = ["bond"]
    filenames = ["*.bond"]
    url = ""
    version_added = ""

    tokens = {
        "root": [
            (r"//.*?$", Comment.Single),
            (r'"[^"\n]*"', String),
            (r"->", Operator),
            (r"\b[A-Za-z0-9]\w*(?=:\w)", Name.Class),
            (r"\b[01](?=\[)", Name.Class),
            (words(DECLARATIONS, prefix=r"\b", suffix=r"\b"), Keyword),
            (r"\d+(\.\d+)?([eE][+-]?\d+)?", Number),
            (r"[A-Za-z_]\w*'?(\.[A-Za-z_]\w*)*", Name),
            (r"[-+*/^=<>]+", Operator),
            (r"[\[\]{}(),:;.']", Punctuation),
            (r"\s+", Text),
            (r".", Text),
        ]
    }
