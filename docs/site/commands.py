"""The reference of the command line, as the program prints it."""

from __future__ import annotations

import re
import textwrap

from program import halfarrow


def reference() -> str:
    whole = halfarrow("--help")
    listed = whole.split("Commands:\n", 1)[1].split("\n\n", 1)[0]
    names = [n for n in re.findall(r"^  (\w+) ", listed, re.M) if n != "help"]
    pages = [
        "# Command line\n\nWhat `--help` prints, made when this site was built. Every command also takes `--json` "
        f"where it says so: [JSON](json.md).\n\n```text\n{wrapped(whole)}```\n"
    ]
    for name in names:
        pages.append(f"## `{name}`\n\n```text\n{wrapped(halfarrow(name, '--help'))}```\n")
    return "\n".join(pages)


def wrapped(text: str, width: int = 96) -> str:
    """Long lines go on below where their description begins."""
    lines: list[str] = []
    for line in text.splitlines():
        if len(line) <= width:
            lines.append(line.rstrip())
            continue
        described = re.match(r"^( *\S.*?  +)\S", line)
        indent = len(described[1]) if described and len(described[1]) < width / 2 else len(line) - len(line.lstrip()) + 2
        lines += textwrap.wrap(
            line, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False, drop_whitespace=True
        )
    return "\n".join(lines) + "\n"
