#!/usr/bin/env python3
"""Runs what the tutorials and how-tos show, and compares what is printed with what stands there.

In a page, in this order, within one empty folder of the page:

- a block with `title="name"` is a file of that name;
- a block `console` has commands behind `$ `, each with what it prints; a line `...` stands for any lines, `...` at
  the end of one for its rest; a command may fail only where the page shows an error;
- a block `python` is run, all of a page in one name space; a block `text` right behind it is what it prints.

`snippets.py` checks all pages, `snippets.py PAGE ...` some; with `UPDATE=1` it writes what is printed into them.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import time
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from program import MADE, ROOT, program  # noqa: E402

DOCS = ROOT / "docs"
FENCE = re.compile(r"^```(?P<language>[a-z]+)(?: title=\"(?P<title>[^\"]+)\")?\n(?P<body>.*?)^```$", re.M | re.S)


class Mismatch(Exception):
    """Something else is printed than stands in the page."""


@dataclass
class Block:
    """A fenced block: where its text stands in the page."""

    language: str
    title: str | None
    body: str
    start: int
    end: int
    #: The block of text right behind.
    output: Block | None = None


def pages() -> list[Path]:
    return [DOCS / "index.md", DOCS / "domains.md", *sorted(DOCS.glob("tutorials/*.md")), *sorted(DOCS.glob("how-to/*.md"))]


def blocks(text: str) -> list[Block]:
    found = [Block(m["language"], m["title"], m["body"], m.start("body"), m.end("body")) for m in FENCE.finditer(text)]
    for block, after in zip(found, found[1:]):
        if block.language == "python" and after.language == "text" and not after.title:
            if not text[block.end + len("```") : after.start - len("```text\n")].strip():
                block.output = after
    return found


def folder_of(page: Path) -> Path:
    return MADE / page.relative_to(DOCS).with_suffix("")


def stamp(page: Path) -> str:
    about = f"{page.read_text()}{program().stat().st_mtime_ns}{Path(__file__).read_text()}"
    return hashlib.sha256(about.encode()).hexdigest()


def made(page: Path) -> Path:
    """The folder with what a page makes; it is run if it has changed since."""
    folder = folder_of(page)
    mark = folder.with_suffix(".stamp")
    if not mark.exists() or mark.read_text() != stamp(page):
        run_page(page, update=False)
    return folder


def agree(shown: str, printed: str) -> bool:
    lines = []
    for line in shown.splitlines(keepends=True):
        if line == "...\n":
            lines.append(r"(?:.*\n)*?")
        elif line.endswith("...\n"):
            lines.append(re.escape(line.removesuffix("...\n")) + r".*\n")
        else:
            lines.append(re.escape(line))
    pattern = "".join(lines)
    return re.fullmatch(pattern, printed) is not None


def commands(body: str) -> list[tuple[str, str]]:
    """Each command of a block with what is shown below it."""
    found: list[tuple[str, str]] = []
    for line in body.splitlines(keepends=True):
        if line.startswith("$ "):
            found.append((line[2:], ""))
        elif found and found[-1][0].rstrip().endswith("\\") and not found[-1][1] and line.startswith("    "):
            found[-1] = (found[-1][0] + line, "")
        elif not found:
            raise Mismatch(f"no command: {line}")
        else:
            found[-1] = (found[-1][0], found[-1][1] + line)
    return found


def run_console(block: Block, folder: Path, update: bool) -> str:
    path = os.pathsep.join([str(program().parent), str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "COLUMNS": "96", "MPLBACKEND": "Agg"}
    text = ""
    for command, shown in commands(block.body):
        run = subprocess.run(
            ["bash", "-c", f"set -o pipefail; {command}"],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=300,
        )
        # Of long runs, how far they are.
        printed = re.sub(r"^ *\d+ %, after .*\n", "", run.stdout, flags=re.M)
        if run.returncode and "error" not in shown:
            raise Mismatch(f"$ {command}{printed}exit status {run.returncode}")
        if not agree(shown, printed):
            if not update:
                raise Mismatch(f"$ {command}--- shown\n{shown}--- printed\n{printed}")
            shown = printed
        text += f"$ {command}{shown}"
    return text


def run_python(block: Block, names: dict[str, object], line: int, page: Path) -> str:
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), warnings.catch_warnings():
        # What is odd is no example.
        warnings.filterwarnings("error", module="halfarrow|.*\\.md")
        # Lines of errors are those of the page.
        exec(compile("\n" * line + block.body, str(page), "exec"), names)
    return printed.getvalue()


def run_page(page: Path, update: bool) -> None:
    text = page.read_text()
    folder = folder_of(page)
    folder.with_suffix(".stamp").unlink(missing_ok=True)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for there in ("models", "examples"):
        (folder / there).symlink_to(ROOT / there)
    names: dict[str, object] = {"__name__": "__main__"}
    changes: list[tuple[Block, str]] = []
    before = Path.cwd()
    os.chdir(folder)
    os.environ.setdefault("MPLBACKEND", "Agg")
    try:
        for block in blocks(text):
            if block.title:
                Path(block.title).write_text(block.body)
            elif block.language == "console":
                changes.append((block, run_console(block, folder, update)))
            elif block.language == "python":
                printed = run_python(block, names, text[: block.start].count("\n"), page)
                if block.output is None and printed:
                    raise Mismatch(f"no block `text` for what is printed:\n{printed}")
                if block.output is not None and not agree(block.output.body, printed):
                    if not update:
                        raise Mismatch(f"--- shown\n{block.output.body}--- printed\n{printed}")
                    changes.append((block.output, printed))
    finally:
        os.chdir(before)
        for there in ("models", "examples"):
            (folder / there).unlink(missing_ok=True)
    for block, new in sorted(changes, key=lambda change: -change[0].start):
        text = text[: block.start] + new + text[block.end :]
    if update and text != page.read_text():
        page.write_text(text)
    folder.with_suffix(".stamp").write_text(stamp(page))


def main() -> int:
    update = os.environ.get("UPDATE") == "1"
    failed = 0
    for page in [Path(p).resolve() for p in sys.argv[1:]] or pages():
        begin = time.monotonic()
        name = page.relative_to(ROOT)
        try:
            run_page(page, update)
        except Exception as error:
            failed += 1
            print(f"{name}: {error if isinstance(error, Mismatch) else traceback.format_exc()}", file=sys.stderr)
        else:
            print(f"{name}: {len(blocks(page.read_text()))} blocks, {time.monotonic() - begin:.1f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
